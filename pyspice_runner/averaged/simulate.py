# SPDX-License-Identifier: GPL-3.0-or-later
"""Transients of the averaged motor over seconds, with settings that change as in a control loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isfinite
from time import monotonic
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import SkipValidation

from pyspice_runner.averaged.errors import estimate
from pyspice_runner.averaged.library import HARMONICS, PHASES, Schedule
from pyspice_runner.averaged.point import LONGEST_STEPS, AveragedPoint, ScheduleLike
from pyspice_runner.averaged.run import COLUMNS, Array, AveragedRun
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, ShaftLoad
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.strength import peak_of_amplitudes, temperature_rise
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import stated
from pyspice_runner.run.kernel import progress_callback, run_bench, transient_timing
from pyspice_runner.run.point import Point
from pyspice_runner.spice import Engine
from pyspice_runner.spice.compiler import find_compiler

FEWEST_PERIODS = 10
BALANCE_BOUND = 0.05  # of the energy put in; the engine's own steps, summed by the trapezoidal rule


@checked
def simulate_averaged(
    motor: Motor,
    drive: Drive | Driver,
    duration: float,
    *,
    contact: ContactLaw | None = PAPER_LAW,
    speed: float | None = None,
    load_torque: float = 0.0,
    shaft: ShaftLoad | None = None,
    courses: Mapping[str, SkipValidation[ScheduleLike]] | None = None,
    thermal: Thermal | None = None,
    phases: int = PHASES,
    harmonics: int = HARMONICS,
    engine: Engine = "auto",
    progress: Callable[[float, float], object] | None = None,
    timeout: float | None = None,
) -> AveragedRun:
    """Run the averaged motor from preloaded rest: seconds of motor time in some milliseconds.

    Amplitudes and means replace the waveforms; ``docs/tracking.md`` says what that leaves out.
    :attr:`AveragedRun.error_estimate` compares the run with the full motor.

    Args:
        motor: the motor.
        drive: a two-phase drive, whose soft start is a course of both voltages; or a driver, whose network (inductor
            or LLCC) is averaged too, behind the fundamental of its stages. The commanded amplitudes and phase are
            those of the stages, the amplitudes in the result those of the groups.
        duration: simulated time in s.
        contact: law of the contact, one that has the form ``averaged``: the default.
        speed: if given, the shaft is held at this speed, rad/s.
        load_torque: torque in N·m that a load draws from the free shaft.
        shaft: a mass that is coupled to the free shaft.
        courses: what changes during the run: ``frequency`` (Hz), ``voltage`` (V, both groups), ``voltage_a``,
            ``voltage_b``, ``phase_deg``, ``load_torque`` (N·m), ``preload`` (N, not in ngspice), ``temperature`` (K, of
            the surroundings above that of the parameters; takes ``thermal``) → rows of time (s) and value, linear in
            between; a number; or a function of the time, of which a thousand values in the run are taken.
        thermal: drift with temperature; the losses then heat the stator.
        phases: number of phases of the period at which the contact is evaluated.
        harmonics: number of harmonics of the tip's motion, 1 to 6.
        engine: ``"compiled"``, the averaged motor in C, which takes a C compiler; ``"spice"``, its netlist in ngspice,
            which has one contact; ``"auto"``, the compiled motor where a compiler is installed.
        progress: called some times a second with the part that is done, 0 to 1, and the seconds that are left.
        timeout: wall time in s after which the run is ended.

    Raises:
        ParameterError: for a value out of range, another kind of drive or law.
        SimulationError: if the engine fails or its result cannot be trusted.
    """
    point = Point.of(motor, drive, speed=speed, load_torque=load_torque, contact=contact, thermal=thermal)
    run = AveragedPoint.of(point, duration, courses=courses, shaft=shaft, phases=phases, harmonics=harmonics)
    period = run.front.stage.period
    if not (isfinite(duration) and duration >= FEWEST_PERIODS * period):
        raise ParameterError(
            f"duration = {duration:g} s is out of range: it must be at least {FEWEST_PERIODS} periods of the drive, "
            f"{FEWEST_PERIODS * period:.3g} s."
        )
    used = averaged_engine(engine)
    longest = max(duration / LONGEST_STEPS[used], period)  # the compiled motor damps what is faster
    timing = transient_timing(period, duration, longest)
    vectors = saved_vectors(motor, harmonics, thermal)
    report = progress and progress_callback(progress, duration)
    course = None if speed is not None else run.settings["load_torque"]
    if used == "compiled":
        running = run.compiled(longest)
        started = monotonic()
        rows = running.record(run.inputs, duration, timeout=timeout, progress=report)
        seconds, amplitudes = monotonic() - started, running.mode_amplitudes()
        version, deck_sha256, write_deck = None, {}, partial(run.deck, vectors, timing)
    else:
        outcome = run_bench(run.bench(), vectors, timeout, "transient", timing, progress=report)
        rows, amplitudes = spice_rows(motor, outcome.vectors(), harmonics)
        seconds, version = outcome.seconds, outcome.ngspice_version
        deck_sha256, write_deck = {"deck_sha256": outcome.deck_sha256}, partial(str, outcome.deck)
    columns = averaged_columns(motor, rows, course)
    residual = missing_energy(columns, rows["stored_energy"])
    missing = (
        f"The energy balance misses {100.0 * residual:.3g} % of the energy put in; the time steps explain up to "
        f"{100.0 * BALANCE_BOUND:g} %."
    )
    return AveragedRun(
        curves=columns,
        energy_residual=residual,
        audit=Audit(() if residual <= BALANCE_BOUND else (missing,)),
        solver_seconds=seconds,
        ngspice_version=version,
        provenance={
            **run.provenance(
                engine=used, duration_s=duration, speed_rad_s=speed, phases=phases, harmonics=harmonics
            ),
            **deck_sha256,
            **averaged_ceramic(motor, amplitudes, columns),
        },
        write_deck=write_deck,
        find_error=partial(estimate, run, duration),
    )  # fmt: skip


def averaged_engine(engine: Engine) -> Literal["spice", "compiled"]:
    """Return the engine that runs an averaged motor; raise SimulationError for ``"compiled"`` without a C compiler."""
    if engine == "spice":
        return "spice"
    try:
        find_compiler()
    except SimulationError:
        if engine == "compiled":
            raise
        return "spice"
    return "compiled"


def averaged_ceramic(motor: Motor, amplitudes: Sequence[float], curves: Mapping[str, Array]) -> dict[str, Any]:
    """Return upper bounds of strain and stress at the end (all amplitudes in phase), and the temperature rise.

    ``amplitudes`` of the modes in m are those at the end; the curves are named as in :data:`COLUMNS`.
    """
    normal_force, heat = (float(curves[name][-1]) for name in ("normal_force_n", "heat_w"))
    bent = np.abs(motor.stator.preload_motion) * normal_force / motor.stator.stiffness
    total = [static + moved for static, moved in zip(bent.tolist(), amplitudes, strict=True)]
    rise = temperature_rise(motor, heat)
    return stated(motor, {**peak_of_amplitudes(motor, total), "temperature_rise_k": rise}, curves["rotor_speed_rad_s"])


# --- the curves of a run, from what ngspice or the compiled motor records ---


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
RECORDED = {
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


def phasor(samples: Mapping[str, Array], name: str) -> NDArray[np.complex128]:
    """Return the complex amplitude over time of two vectors of ngspice; in their name ``re`` and ``im`` stand at {}."""
    return np.asarray(samples[name.format("re")] + 1j * samples[name.format("im")])


def spice_rows(motor: Motor, samples: Mapping[str, Array], harmonics: int) -> tuple[dict[str, Array], list[float]]:
    """Return the records of the compiled motor from a run of ngspice, and the maximum displacement of each mode, m."""
    amplitude, stator = partial(phasor, samples), motor.stator
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
    columns = {name: rows[recorded] for name, recorded in RECORDED.items()}
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
    for mode in range(1, len(motor.modes) + 1):
        moves = [phasor(samples, f"v(xmotor.xmode{mode}_{order}.r_{{}})")[-1] for order in range(1, harmonics + 1)]
        found.append(1e-6 * float(np.abs(moves).sum()))
    return found
