# SPDX-License-Identifier: GPL-3.0-or-later
"""Transients of the averaged motor over seconds, with settings that change as in a control loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isfinite
from time import monotonic
from typing import Any, Literal

from pydantic import SkipValidation

from pyspice_runner.averaged.columns import (
    compiled_columns,
    missing_energy,
    mode_amplitudes,
    saved_vectors,
    spice_columns,
)
from pyspice_runner.averaged.core import AveragedMotor
from pyspice_runner.averaged.driver import AveragedDrive
from pyspice_runner.averaged.library import (
    HARMONICS,
    PHASES,
    averaged_bench,
    check_averaged,
    check_resolution,
)
from pyspice_runner.averaged.run import Array, AveragedRun
from pyspice_runner.averaged.schedules import CourseLike, coupled_to, settings_of
from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import Drive, Load, check_together
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.shaft import ShaftLoad
from pyspice_runner.motor.strength import peak_of_amplitudes, temperature_rise
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Audit
from pyspice_runner.run.ceramic import stated
from pyspice_runner.run.kernel import progress_callback, run_bench, simulator, transient_timing
from pyspice_runner.spice import Engine
from pyspice_runner.spice.compiler import find_compiler

FEWEST_PERIODS = 10
LONGEST_STEPS = {"spice": 50, "compiled": 200}  # least number of steps of a run; linear in between
BALANCE_BOUND = 0.05  # of the energy put in; the engine's own steps, summed by the trapezoidal rule
INPUT_OF = {  # setting → input of the averaged motor in C
    "frequency": "frequency", "voltage_a": "amplitude_a", "voltage_b": "amplitude_b", "phase_deg": "phase",
    "load_torque": "load_torque", "preload": "preload", "temperature": "ambient_temperature",
}  # fmt: skip


@checked
def simulate_averaged(
    motor: Motor,
    drive: Drive | Driver,
    duration: float,
    *,
    contact: ContactLaw | None = "spring-slider",
    speed: float | None = None,
    load_torque: float = 0.0,
    shaft: ShaftLoad | None = None,
    courses: Mapping[str, SkipValidation[CourseLike]] | None = None,
    thermal: Thermal | None = None,
    phases: int = PHASES,
    harmonics: int = HARMONICS,
    engine: Engine = "auto",
    progress: Callable[[float, float], object] | None = None,
    timeout: float | None = None,
) -> AveragedRun:
    """Run the averaged motor from preloaded rest: seconds of motor time in some milliseconds.

    Amplitudes and means replace the waveforms; ``docs/averaged.md`` says what that leaves out. The result says by
    :attr:`AveragedRun.trusted` whether the model's own check passes.

    Args:
        motor: the motor.
        drive: a two-phase drive, whose soft start is a course of both voltages; or a driver, whose network (inductor
            or LLCC) is averaged too, behind the fundamental of its stages. The commanded amplitudes and phase are
            those of the stages, the amplitudes in the result those of the groups.
        duration: simulated time in s.
        contact: law of the contact; only ``"spring-slider"`` has an average.
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
    front = AveragedDrive.of(drive)
    drive = front.stage
    check_averaged(contact)
    check_resolution(phases, harmonics)
    check_together(motor, drive)
    load = Load(speed, load_torque)
    load.check(motor)
    if not (isfinite(duration) and duration >= FEWEST_PERIODS * drive.period):
        raise ParameterError(
            f"duration = {duration:g} s is out of range: it must be at least {FEWEST_PERIODS} periods of the drive, "
            f"{FEWEST_PERIODS * drive.period:.3g} s."
        )
    settings = settings_of(motor, drive, load, courses or {}, duration, thermal)
    coupled = coupled_to(shaft, speed)
    used = averaged_engine(engine)
    longest = max(duration / LONGEST_STEPS[used], drive.period)  # the compiled motor damps what is faster
    timing = transient_timing(drive.period, duration, longest)
    vectors = saved_vectors(motor, harmonics, thermal)

    def bench() -> Bench:
        return averaged_bench(
            motor, settings, load=load, phases=phases, harmonics=harmonics, thermal=thermal, shaft=coupled,
            add_networks=front.add if front.networks else None,
        )  # fmt: skip

    report = progress and progress_callback(progress, duration)
    course = None if speed is not None else settings["load_torque"]
    version, deck_sha256 = None, {}
    if used == "compiled":
        running = AveragedMotor(
            motor, thermal=thermal, shaft=coupled, speed=speed, phases=phases, harmonics=harmonics, longest=longest,
            networks=front.networks,
        )  # fmt: skip
        begun = monotonic()
        inputs = {of_c: settings[name] for name, of_c in INPUT_OF.items() if name in settings}
        columns = compiled_columns(motor, running.record(inputs, duration, timeout=timeout, progress=report), course)
        seconds, stored = monotonic() - begun, columns.pop("stored_energy")
        amplitudes = running.mode_amplitudes()
        write_deck: Callable[[], str | None] = no_deck
        if runs_in_ngspice(settings):
            write_deck = partial(deck_of, bench, vectors, timing)
    else:
        outcome = run_bench(bench(), vectors, timeout, "transient", timing, progress=report)
        columns, stored = spice_columns(motor, outcome, harmonics, course)
        seconds, version = outcome.seconds, outcome.ngspice_version
        deck_sha256 = {"deck_sha256": outcome.deck_sha256}
        amplitudes = mode_amplitudes(motor, outcome.vectors(), harmonics)
        write_deck = partial(str, outcome.deck)
    residual = missing_energy(columns, stored)
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
            "drive": front.to_dict(),
            "run": {
                "engine": used,
                "duration_s": duration, **PAPER_LAW.to_dict(), "speed_rad_s": speed, "load_torque_n_m": load_torque,
                "shaft": None if shaft is None else shaft.model_dump(), "phases": phases, "harmonics": harmonics,
                "courses": {name: [*map(list, course)] for name, course in settings.items() if len(course) > 1},
                "thermal": None if thermal is None else thermal.model_dump(),
            },
            **deck_sha256,
            **averaged_ceramic(
                motor, amplitudes, float(columns["normal_force_n"][-1]), float(columns["heat_w"][-1]),
                columns["rotor_speed_rad_s"],
            ),
        },
        write_deck=write_deck,
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


def runs_in_ngspice(settings: Mapping[str, Any]) -> bool:
    """Return whether the averaged motor of ngspice can follow these courses: its preload is a number."""
    return "preload" not in settings


def no_deck() -> None:
    """Return the netlist of a run that ngspice cannot run: none."""


def deck_of(bench: Callable[[], Bench], vectors: Sequence[str], timing: Mapping[str, Any]) -> str:
    """Return the netlist of a transient of a bench."""
    return str(simulator(bench(), vectors).prepare("transient", **timing))


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
