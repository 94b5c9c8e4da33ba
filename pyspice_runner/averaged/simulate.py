# SPDX-License-Identifier: GPL-3.0-or-later
"""Transients of the averaged motor over seconds, with settings that change as in a control loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isfinite
from time import monotonic
from typing import Any, Literal

import numpy as np
from pydantic import SkipValidation

from pyspice_runner.averaged.columns import averaged_columns, missing_energy, saved_vectors, spice_rows
from pyspice_runner.averaged.library import HARMONICS, PHASES
from pyspice_runner.averaged.point import AveragedPoint
from pyspice_runner.averaged.run import Array, AveragedRun
from pyspice_runner.averaged.schedules import ScheduleLike
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import Drive, ShaftLoad, ideal_drive
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
from pyspice_runner.steady.steady import stability_cautions

FEWEST_PERIODS = 10
LONGEST_STEPS = {"spice": 50, "compiled": 200}  # smallest number of steps of a run; linear in between
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

    Amplitudes and means replace the waveforms; ``docs/tracking.md`` says what that leaves out. The result says by
    :attr:`AveragedRun.trusted` whether the model's own check passes.

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
        engine: ``"compiled"``, the averaged motor in C, which takes a C compiler; ``"spice"``, its netlist in ngspice;
            ``"auto"``, the compiled motor where a compiler is installed.
        progress: called some times a second with the part that is done, 0 to 1, and the seconds that are left.
        timeout: wall time in s after which the run is ended.

    Raises:
        ParameterError: for a value out of range, another kind of drive or law.
        SimulationError: if the engine fails or its result cannot be trusted.
    """
    point = Point.of(motor, drive, speed=speed, load_torque=load_torque, contact=contact, thermal=thermal)
    return averaged_run(
        point, duration, courses=courses, shaft=shaft, phases=phases, harmonics=harmonics, engine=engine,
        progress=progress, timeout=timeout,
    )  # fmt: skip


def averaged_run(
    point: Point,
    duration: float,
    *,
    engine: Engine = "auto",
    progress: Callable[[float, float], object] | None = None,
    timeout: float | None = None,
    **settings: Any,
) -> AveragedRun:
    """Run the averaged motor of an operating point; the arguments are those of :func:`simulate_averaged`."""
    run = AveragedPoint.of(point, duration, **settings)
    motor, period = run.motor, run.drive.period
    if not (isfinite(duration) and duration >= FEWEST_PERIODS * period):
        raise ParameterError(
            f"duration = {duration:g} s is out of range: it must be at least {FEWEST_PERIODS} periods of the drive, "
            f"{FEWEST_PERIODS * period:.3g} s."
        )
    used = averaged_engine(engine)
    longest = max(duration / LONGEST_STEPS[used], period)  # the compiled motor damps what is faster
    timing = transient_timing(period, duration, longest)
    vectors = saved_vectors(motor, run.harmonics, run.thermal)
    report = progress and progress_callback(progress, duration)
    course = None if point.load.speed is not None else run.settings["load_torque"]
    version, deck_sha256 = None, {}
    if used == "compiled":
        running = run.compiled(longest)
        started = monotonic()
        rows = running.record(run.inputs, duration, timeout=timeout, progress=report)
        seconds, amplitudes = monotonic() - started, running.mode_amplitudes()
        write_deck = run.deck(vectors, timing)
    else:
        outcome = run_bench(run.bench(), vectors, timeout, "transient", timing, progress=report)
        rows, amplitudes = spice_rows(motor, outcome, run.harmonics)
        seconds, version = outcome.seconds, outcome.ngspice_version
        deck_sha256 = {"deck_sha256": outcome.deck_sha256}
        write_deck = partial(str, outcome.deck)
    columns = averaged_columns(motor, rows, course)
    end = {name: float(values[-1]) for name, values in columns.items()}
    ceramic = averaged_ceramic(
        motor, amplitudes, end["normal_force_n"], end["heat_w"], columns["rotor_speed_rad_s"]
    )  # fmt: skip
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
            "motor": motor.to_dict(),
            "drive": run.front.to_dict(),
            "run": {
                "engine": used, "duration_s": duration, "speed_rad_s": point.load.speed, "phases": run.phases,
                "harmonics": run.harmonics, **run.run_settings(),
            },
            **deck_sha256,
            **ceramic,
        },
        write_deck=write_deck,
        check_stability=partial(_stability, run, end, timeout),
    )  # fmt: skip


def _stability(run: AveragedPoint, end: dict[str, float], timeout: float | None) -> tuple[str, ...]:
    """Return the cautions for the stability of the motion at the end of a run, whose columns end with these values."""
    if not end["amplitude_a_v"] + end["amplitude_b_v"]:
        return ()
    motor = run.motor if run.thermal is None else run.thermal.warmed(run.motor, end["temperature_k"])
    if "preload" in run.settings:
        preload = float(np.interp(end["time_s"], *np.transpose(run.settings["preload"])))
        motor = motor.updated({"contact.preload_n": preload})
    drive = ideal_drive(end["amplitude_a_v"], end["amplitude_b_v"], end["phase_deg"], end["frequency_hz"])
    return stability_cautions(
        motor, drive, end["rotor_speed_rad_s"], end["tip_y_amplitude_m"], run.point.law, timeout
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


def averaged_ceramic(
    motor: Motor, amplitudes: Sequence[float], normal_force: float, heat: float, speed: Array
) -> dict[str, Any]:
    """Return upper bounds of strain and stress at the end (all amplitudes in phase), and the temperature rise.

    ``amplitudes`` of the modes in m, ``normal_force`` in N and ``heat`` in W are those at the end; ``speed`` in rad/s
    is over time.
    """
    bent = [abs(mode.tip_y) * normal_force / mode.stiffness_n_per_m for mode in motor.modes]
    total = [static + moved for static, moved in zip(bent, amplitudes, strict=True)]
    rise = temperature_rise(motor, heat)
    return stated(motor, {**peak_of_amplitudes(motor, total), "temperature_rise_k": rise}, speed)
