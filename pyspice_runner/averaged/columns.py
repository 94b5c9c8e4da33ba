# SPDX-License-Identifier: GPL-3.0-or-later
"""The curves of a run of the averaged motor, from what ngspice or the compiled motor records."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.library import Course
from pyspice_runner.averaged.run import COLUMNS, Array
from pyspice_runner.motor import groups
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.kernel import Outcome


def saved_vectors(motor: Motor, harmonics: int, thermal: Thermal | None) -> list[str]:
    """Return the vectors of ngspice that :func:`spice_columns` and :func:`mode_amplitudes` take."""
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


def spice_columns(
    motor: Motor, outcome: Outcome, harmonics: int, load_torque: Course | None
) -> tuple[dict[str, Array], Array]:
    """Return the columns in SI units of a run of ngspice, and the energy in modes and clamped capacitances, J.

    ``load_torque`` is its course, or ``None`` for a held shaft, which draws the torque that the bearing leaves.
    """
    samples = outcome.vectors()
    time = samples["time"]

    def amplitude(name: str) -> NDArray[np.complex128]:
        return np.asarray(samples[name.format("re")] + 1j * samples[name.format("im")])

    voltages = {group: amplitude(f"v({group}_{{}})") for group in "ab"}
    currents = {group: amplitude(f"i(v{group}_{{}})") for group in "ab"}
    electrical, contact, stored = (np.zeros(len(time)) for _ in range(3))
    for group, capacitance in zip(GROUPS, motor.piezo.capacitances, strict=True):
        electrical += 0.5 * np.real(voltages[group] * currents[group].conjugate())
        stored += 0.25 * capacitance * np.abs(voltages[group]) ** 2
    stored -= 0.5 * motor.piezo.capacitance_ab_f * np.real(voltages["a"] * voltages["b"].conjugate())
    for order in range(1, harmonics + 1):
        forces = {axis: amplitude(f"v(xmotor.f{axis}_{{}}{order})") for axis in "xy"}
        for index, mode in enumerate(motor.modes, start=1):
            place = f"xmotor.xmode{index}_{order}"
            velocity = amplitude(f"v({place}.v_{{}})")
            displacement = 1e-6 * amplitude(f"v({place}.r_{{}})")
            force = mode.tip_x * forces["x"] + mode.tip_y * forces["y"]
            contact -= 0.5 * np.real(force * velocity.conjugate())
            stored += 0.25 * (mode.mass_kg * np.abs(velocity) ** 2 + mode.stiffness_n_per_m * np.abs(displacement) ** 2)
    heat = samples["v(heat)"]
    torque = motor.rotor.radius_m * samples["v(xmotor.friction)"]
    columns = {
        "time_s": time,
        "frequency_hz": samples["v(set_frequency)"],
        "amplitude_a_v": np.abs(voltages["a"]),
        "amplitude_b_v": np.abs(voltages["b"]),
        "phase_deg": samples["v(set_phase)"],
        "current_amplitude_a_a": np.abs(currents["a"]),
        "current_amplitude_b_a": np.abs(currents["b"]),
        "electrical_power_w": electrical,
        "heat_w": heat,
        "contact_power_w": contact,
        "tip_x_amplitude_m": 1e-6 * np.abs(amplitude("v(xmotor.x_{}1)")),
        "tip_y_amplitude_m": 1e-6 * np.abs(amplitude("v(xmotor.y_{}1)")),
        "normal_force_n": samples["v(xmotor.normal)"],
        "torque_n_m": torque,
        "load_torque_n_m": _drawn(motor, time, torque, samples["v(shaft)"], load_torque),
        "rotor_speed_rad_s": samples["v(shaft)"],
        "rotor_position_rad": samples["v(position)"],
        "separated": np.clip(samples["v(xmotor.open)"], 0.0, 1.0),
        "slip": np.clip(samples["v(xmotor.slip)"], 0.0, 1.0),
        "temperature_k": samples.get("v(temperature)", np.zeros(len(time))),
        "check": samples["v(xmotor.check)"],
    }
    return {name: columns[name] for name in COLUMNS}, stored


def compiled_columns(motor: Motor, rows: Mapping[str, Array], load_torque: Course | None) -> dict[str, Array]:
    """Return the columns of a run of the compiled motor, and ``stored_energy`` in J; arguments as of ngspice's."""
    names = {
        "time_s": "time", "frequency_hz": "frequency", "phase_deg": "phase", "electrical_power_w": "electrical_power",
        "current_amplitude_a_a": "current_amplitude_a", "current_amplitude_b_a": "current_amplitude_b",
        "heat_w": "heat", "contact_power_w": "contact_power", "tip_x_amplitude_m": "tip_x_amplitude",
        "tip_y_amplitude_m": "tip_y_amplitude", "normal_force_n": "normal_force", "torque_n_m": "torque",
        "rotor_speed_rad_s": "speed", "rotor_position_rad": "position", "separated": "separated", "slip": "slip",
        "temperature_k": "temperature", "check": "check",
    }  # fmt: skip
    columns = {name: rows[of_c] for name, of_c in names.items()}
    pins = "pin_" if "pin_amplitude_a" in rows else ""
    columns |= {
        groups.column("amplitude", group, "v"): np.abs(rows[pins + groups.named("amplitude", group)]) for group in "ab"
    }
    drawn = _drawn(motor, rows["time"], rows["torque"], rows["speed"], load_torque)
    columns["load_torque_n_m"] = drawn
    return {name: columns[name] for name in COLUMNS} | {"stored_energy": rows["stored_energy"]}


def _drawn(motor: Motor, time: Array, torque: Array, speed: Array, load_torque: Course | None) -> Array:
    """Return the torque that the load draws."""
    if load_torque is None:
        return np.asarray(torque - motor.rotor.bearing_damping_n_m_s * speed)
    return np.asarray(np.interp(time, *np.transpose(load_torque)))


def missing_energy(columns: Mapping[str, Array], stored: Array) -> float:
    """Return the energy into the stator that is not found as heat, stored or in the contact, over that put in."""
    time, electrical, contact = (columns[name] for name in ("time_s", "electrical_power_w", "contact_power_w"))
    put_in = float(np.trapezoid(np.maximum(electrical, 0.0) + np.maximum(-contact, 0.0), time))
    missing = float(np.trapezoid(electrical - columns["heat_w"] - contact, time) - (stored[-1] - stored[0]))
    return abs(missing) / put_in if put_in > 0.0 else abs(missing)


def mode_amplitudes(motor: Motor, samples: Mapping[str, Array], harmonics: int) -> list[float]:
    """Return the greatest displacement of each mode's coordinate at the end of a run of ngspice, m."""
    found = []
    for index in range(1, len(motor.modes) + 1):
        moves = [
            np.hypot(*(samples[f"v(xmotor.xmode{index}_{order}.r_{part})"][-1] for part in ("re", "im")))
            for order in range(1, harmonics + 1)
        ]
        found.append(1e-6 * float(sum(moves)))
    return found
