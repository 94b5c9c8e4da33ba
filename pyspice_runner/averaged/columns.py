# SPDX-License-Identifier: GPL-3.0-or-later
"""The curves of a run of the averaged motor, from what ngspice or the compiled motor records."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.library import Schedule
from pyspice_runner.averaged.run import COLUMNS, Array
from pyspice_runner.motor import groups
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.kernel import Outcome


def saved_vectors(motor: Motor, harmonics: int, thermal: Thermal | None) -> list[str]:
    """Return the vectors of ngspice that :func:`spice_rows` takes."""
    names = ["v(set_frequency)", "v(set_a)", "v(set_b)", "v(set_phase)", "v(shaft)", "v(position)"]
    names += [f"v({pin})" for pin in ("a_re", "a_im", "b_re", "b_im")]
    names += [f"i(v{pin})" for pin in ("a_re", "a_im", "b_re", "b_im")]
    names += [f"v(xmotor.{node})" for node in ("normal", "friction", "open", "slip", "check", "x_0", "y_0")]
    names.append("v(heat)")
    names += ["v(temperature)"] if thermal else []
    for order in range(1, harmonics + 1):
        names += [f"v(xmotor.{axis}_{part}{order})" for axis in ("x", "y", "fx", "fy") for part in ("re", "im")]
        for index in range(1, len(motor.modes) + 1):
            mode = f"xmotor.xmode{index}_{order}"
            names += [f"v({mode}.{node}_{part})" for node in ("r", "v") for part in ("re", "im")]
    return names


# column of a run → what the averaged motor in C calls it; of the others :func:`averaged_columns` has more
_RECORDED = {
    "time_s": "time", "frequency_hz": "frequency", "phase_deg": "phase", "electrical_power_w": "electrical_power",
    "current_amplitude_a_a": "current_amplitude_a", "current_amplitude_b_a": "current_amplitude_b",
    "heat_w": "heat", "contact_power_w": "contact_power", "tip_x_amplitude_m": "tip_x_amplitude",
    "tip_y_amplitude_m": "tip_y_amplitude", "normal_force_n": "normal_force", "torque_n_m": "torque",
    "rotor_speed_rad_s": "speed", "rotor_position_rad": "position", "separated": "separated", "slip": "slip",
    "temperature_k": "temperature", "check": "check",
}  # fmt: skip
# vectors of ngspice that are such values
_SAVED = {
    "time": "time", "frequency": "v(set_frequency)", "phase": "v(set_phase)", "heat": "v(heat)",
    "normal_force": "v(xmotor.normal)", "speed": "v(shaft)", "position": "v(position)", "check": "v(xmotor.check)",
}  # fmt: skip


def spice_rows(motor: Motor, outcome: Outcome, harmonics: int) -> tuple[dict[str, Array], list[float]]:
    """Return the records of the compiled motor from a run of ngspice, and the maximum displacement of each mode, m."""
    samples = outcome.vectors()

    def amplitude(name: str) -> NDArray[np.complex128]:
        return np.asarray(samples[name.format("re")] + 1j * samples[name.format("im")])

    stator = motor.stator
    voltage = np.array([amplitude(f"v({group}_{{}})") for group in GROUPS])
    current = np.array([amplitude(f"i(v{group}_{{}})") for group in GROUPS])
    contact = np.zeros(len(samples["time"]))
    stored = 0.25 * np.real(np.einsum("gt,gh,ht->t", voltage.conj(), stator.capacitance, voltage))
    for order in range(1, harmonics + 1):
        forces = np.array([amplitude(f"v(xmotor.f{axis}_{{}}{order})") for axis in "xy"])
        for mode, mass, stiffness, tip in zip(
            range(1, len(stator.mass) + 1), stator.mass, stator.stiffness, stator.contact.T, strict=True
        ):
            velocity = amplitude(f"v(xmotor.xmode{mode}_{order}.v_{{}})")
            displacement = 1e-6 * amplitude(f"v(xmotor.xmode{mode}_{order}.r_{{}})")
            contact -= 0.5 * np.real(tip @ forces * velocity.conj())
            stored += 0.25 * (mass * np.abs(velocity) ** 2 + stiffness * np.abs(displacement) ** 2)
        if order == 1:  # the groups work on the contact by modes that are left out
            turning = 2j * np.pi * samples["v(set_frequency)"]
            contact += 0.5 * np.real(voltage.conj() * (turning * (stator.residual_per_volt.T @ forces))).sum(axis=0)
    rows = {name: samples[vector] for name, vector in _SAVED.items()} | {
        "electrical_power": 0.5 * np.real(voltage * current.conj()).sum(axis=0),
        "contact_power": contact,
        "stored_energy": stored,
        "torque": motor.rotor.radius_m * samples["v(xmotor.friction)"],
        "separated": np.clip(samples["v(xmotor.open)"], 0.0, 1.0),
        "slip": np.clip(samples["v(xmotor.slip)"], 0.0, 1.0),
        "temperature": samples.get("v(temperature)", np.zeros(len(contact))),
        **{f"tip_{axis}_amplitude": 1e-6 * np.abs(amplitude(f"v(xmotor.{axis}_{{}}1)")) for axis in "xy"},
    }
    for number, group in enumerate(GROUPS):
        rows[groups.named("pin_amplitude", group)] = np.abs(voltage[number])
        rows[groups.named("current_amplitude", group)] = np.abs(current[number])
    return rows, mode_amplitudes(motor, samples, harmonics)


def averaged_columns(motor: Motor, rows: Mapping[str, Array], load_torque: Schedule | None) -> dict[str, Array]:
    """Return the columns in SI units of a run, by what the motor records.

    ``load_torque`` is its course, or ``None`` for a held shaft, which draws the torque that the bearing leaves.
    """
    columns = {name: rows[recorded] for name, recorded in _RECORDED.items()}
    pins = "pin_" if "pin_amplitude_a" in rows else ""
    columns |= {
        groups.column("amplitude", group, "v"): np.abs(rows[pins + groups.named("amplitude", group)])
        for group in GROUPS
    }
    if load_torque is None:
        columns["load_torque_n_m"] = rows["torque"] - motor.rotor.bearing_damping_n_m_s * rows["speed"]
    else:
        columns["load_torque_n_m"] = np.interp(rows["time"], *np.transpose(load_torque))
    return {name: columns[name] for name in COLUMNS}


def missing_energy(columns: Mapping[str, Array], stored: Array) -> float:
    """Return the energy into the stator that is not found as heat, stored or in the contact, over that put in."""
    time, electrical, contact = (columns[name] for name in ("time_s", "electrical_power_w", "contact_power_w"))
    put_in = float(np.trapezoid(np.maximum(electrical, 0.0) + np.maximum(-contact, 0.0), time))
    missing = float(np.trapezoid(electrical - columns["heat_w"] - contact, time) - (stored[-1] - stored[0]))
    return abs(missing) / put_in if put_in > 0.0 else abs(missing)


def mode_amplitudes(motor: Motor, samples: Mapping[str, Array], harmonics: int) -> list[float]:
    """Return the maximum displacement of each mode's coordinate at the end of a run of ngspice, m."""
    found = []
    for index in range(1, len(motor.modes) + 1):
        moves = [
            np.hypot(*(samples[f"v(xmotor.xmode{index}_{order}.r_{part})"][-1] for part in ("re", "im")))
            for order in range(1, harmonics + 1)
        ]
        found.append(1e-6 * float(sum(moves)))
    return found
