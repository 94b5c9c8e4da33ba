# SPDX-License-Identifier: GPL-3.0-or-later
"""A sampled controller in the loop with the averaged or the full motor.

At every sample time the run stops. The controller sees what a sensor would measure over the last interval, and sets
frequency, amplitudes and phase for the next one. The averaged motor runs as compiled code in this process; in ngspice,
one process runs throughout. Both keep the motor's state exactly.
"""

from __future__ import annotations

import cmath
import ctypes
import shutil
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, degrees, inf, isfinite
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import SkipValidation

from pyspice_runner.averaged.errors import estimate
from pyspice_runner.averaged.library import HARMONICS, PHASES, Schedule, first
from pyspice_runner.averaged.point import COMMANDS, AveragedPoint, ScheduleLike, deck_of, schedule_of
from pyspice_runner.averaged.run import ErrorEstimate
from pyspice_runner.averaged.simulate import averaged_engine
from pyspice_runner.circuit.bench import Bench
from pyspice_runner.control.electronics import IDEAL, Electronics, Rounding
from pyspice_runner.control.plants import CHECKED, SAMPLED, CommandedSource, Compiled, Spice, State, controlled_bench
from pyspice_runner.control.run import CONTROLLED, OF_AVERAGED, RECORDS, SAMPLES, ControlledRun
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.drive import FASTEST_DRIVE, SLOWEST_DRIVE, ShaftLoad, TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.kernel import transient_timing
from pyspice_runner.run.point import Point, Solver
from pyspice_runner.run.window import Array
from pyspice_runner.spice import Engine
from pyspice_runner.spice.process import Session

MOST_SAMPLES = 100_000
MOST_VOLTAGE = 1e4  # V, as of a drive
MOST_RECORDS = 1000  # between two samples
MOST_LOGS = 64  # of firmware


@dataclass(frozen=True)
class Sample:
    """Measurements passed to the controller, in the units of :data:`SAMPLES`; of a slider in m/s and m."""

    time_s: float
    speed_rad_s: float
    position_rad: float
    current_amplitude_a: float
    current_phase_deg: float
    temperature_k: float
    reference: float = 0.0
    current_b_amplitude_a: float = 0.0
    current_b_phase_deg: float = 0.0
    voltage_amplitude_v: float = 0.0
    voltage_b_amplitude_v: float = 0.0


Controller = Callable[[Sample], Mapping[str, float]]


@checked
def simulate_controlled(
    motor: Motor,
    drive: TwoPhaseDrive | Driver,
    controller: Controller | str | Path,
    duration: float,
    *,
    sample_time: float,
    averaged: bool = True,
    load_torque: float = 0.0,
    shaft: ShaftLoad | None = None,
    electronics: Electronics | None = None,
    courses: Mapping[str, SkipValidation[ScheduleLike]] | None = None,
    start: Literal["rest", "steady"] = "rest",
    records: int = 1,
    thermal: Thermal | None = None,
    phases: int = PHASES,
    harmonics: int = HARMONICS,
    step: float | None = None,
    engine: Engine = "auto",
    timeout: float | None = None,
) -> ControlledRun:
    """Run a motor with a sampled controller.

    Args:
        motor: the motor.
        drive: the commands until the first sample; or a driver, behind whose network the motor is, as in
            :func:`simulate_averaged`. The commands are then those of its stages.
        controller: called at every sample time with a :class:`Sample`; it returns what changes: ``voltage`` (V, of both
            groups), ``voltage_a``, ``voltage_b``, ``phase_deg``, ``frequency`` (Hz). A negative amplitude turns the
            phase by 180°. A path is that of a shared library of C code: firmware with the functions of
            ``piezomotor_firmware.h``, or a function ``step`` (docs/tracking.md). The library runs in this process: only
            load code that you trust. If a controller has the attribute ``quantity``, one of ``"speed"``, ``"position"``
            and ``"phase"``, the result states its static error. An attribute ``set_point``, a function of the time in
            s, is the reference; a method ``take_encoder_step`` is called with the step of the encoder, rad or m.
        duration: simulated time in s.
        sample_time: time in s between two samples; at least one period of the drive.
        averaged: whether the averaged motor runs, or the full one, cycle by cycle.
        load_torque: torque in N·m that a load draws from the shaft.
        shaft: a mass that is coupled to the shaft.
        electronics: sensors and actuators, and the computing delay; by default ideal ones.
        courses: what changes during the run, as in :func:`simulate_averaged`, and ``reference``, which the controller
            reads in the sample. A controller that sets a quantity with a course is an error.
        start: ``"rest"``, preloaded and without voltage; ``"steady"``, the steady state at the drive and the load of
            the start, of the compiled averaged motor only.
        records: number of values between two samples in the ``records`` of the result.
        thermal: drift with temperature; the losses then heat the stator.
        phases: number of phases of the period at which the averaged motor evaluates the contact.
        harmonics: number of harmonics of its tip's motion, 1 to 6.
        step: time step in s of the full motor; by default that of ``simulate``. It is made a whole part of the sample
            time.
        engine: of the averaged motor, as in :func:`simulate_averaged`.
        timeout: wall time in s for the way from one sample to the next, in ngspice.

    Raises:
        ParameterError: for a value out of range, also one that the controller returns.
        SimulationError: if the engine fails, or there is no steady state to start from.
    """
    given = dict(courses or {})
    course = schedule_of("reference", given.pop("reference", 0.0), duration)
    point = Point.of(motor, drive, load_torque=load_torque, thermal=thermal)
    run = AveragedPoint.of(point, duration, courses=given, shaft=shaft, phases=phases, harmonics=harmonics)
    stage = run.front.stage
    check_sample_time(sample_time, stage)
    count = int(duration / sample_time * (1.0 + 1e-9)) if isfinite(duration) and duration > 0.0 else 0
    allowed = f"1 to {MOST_SAMPLES} samples of {sample_time:g} s"
    require(1 <= count <= MOST_SAMPLES, "duration", duration, allowed, unit="s")
    quantity, reference = _controlled(controller, course)
    parts = electronics or IDEAL
    parts.check(sample_time, stage.frequency)
    resolution = parts.resolution(sample_time, stage.frequency, linear=motor.slider is not None)
    if callable(take := getattr(controller, "take_encoder_step", None)):
        take(resolution["position_rad"])
    require(1 <= records <= MOST_RECORDS, "records", records, f"a whole number from 1 to {MOST_RECORDS}")
    used = averaged_engine(engine) if averaged else "spice"
    if start == "steady" and used == "spice":
        raise ParameterError(
            "start = 'steady' is not valid here: only the compiled averaged motor starts at a steady state. Give "
            "averaged = True and engine = 'compiled', or start = 'rest'."
        )
    uniform = None
    if not averaged:  # the largest step that divides the sample time and is not above the usual one
        source = CommandedSource(run.settings, stage, run.front.driver)
        coarsest = Point(motor, source, solver=Solver(step)).step
        uniform = sample_time / ceil(sample_time / coarsest * (1.0 - 1e-12))
    elif step is not None:
        raise ParameterError("step has no effect on an averaged run, whose engine chooses its steps. Leave it out.")

    def bench() -> Bench:
        return controlled_bench(run, sample_time=sample_time, stops=(records, parts.delay_s), step=uniform)

    vectors = [*SAMPLED, *(CHECKED if averaged else ()), *(["v(temperature)"] if thermal else [])]
    vectors += ["v(load_position)"] if run.shaft.coupling_stiffness_n_m_per_rad else []
    timing = transient_timing(uniform or stage.period, (count + 1) * sample_time, uniform or 0.5 * sample_time)
    write_deck: Callable[[], str | None] = partial(run.deck, vectors, timing, bench)
    decide = Firmware(controller, stage, sample_time) if isinstance(controller, str | Path) else controller
    with ExitStack() as stack:
        if used == "compiled":
            plant: Spice | Compiled = Compiled(run, steady=start == "steady")
        else:
            deck = str(deck_of(bench, vectors, timing))
            write_deck = partial(str, deck)
            plant = Spice(stack.enter_context(Session(deck, vectors, timeout=timeout)))
        samples, between = _run(
            plant, decide, run, Rounding(parts), reference, count=count, sample_time=sample_time, records=records
        )
    samples["load_torque_n_m"] = np.interp(samples["time_s"], *np.transpose(run.settings["load_torque"]))
    how = {"steady": start == "steady", "controlled": quantity in ("speed", "position")}
    return ControlledRun(
        samples={name: samples[name] for name in SAMPLES if averaged or name not in OF_AVERAGED},
        records=between,
        logs=dict(zip(decide.names, np.transpose(decide.logs), strict=False)) if isinstance(decide, Firmware) else {},
        provenance=run.provenance(
            duration_s=duration, sample_time_s=sample_time, averaged=averaged, engine=used, step_s=uniform, start=start,
            electronics=None if electronics is None else electronics.model_dump(),
            resolution=resolution, reference=[*map(list, course)],
            quantity=quantity,
        ),
        write_deck=write_deck,
        find_error=partial(replayed, run, samples, parts.delay_s, duration, **how) if averaged else ErrorEstimate,
    )  # fmt: skip


def replayed(
    run: AveragedPoint, samples: Mapping[str, Array], delay: float, duration: float, **how: bool
) -> ErrorEstimate:
    """Estimate the errors of an averaged run with the commands of samples, which act after a delay, s, in a period."""
    settings = dict(run.settings)
    for name, column in zip(COMMANDS, ("frequency_hz", "voltage_a_v", "voltage_b_v", "phase_deg"), strict=True):
        if len(settings[name]) == 1:
            rows = [(0.0, first(settings[name]))]
            for time, value in zip(samples["time_s"] + delay, samples[column], strict=True):
                if value != rows[-1][1]:
                    rows += [(float(time), rows[-1][1]), (float(time) + run.front.stage.period, float(value))]
            settings[name] = rows
    return estimate(replace(run, settings=settings), duration, **how)


def _controlled(controller: object, course: Schedule) -> tuple[str | None, Callable[[float], float]]:
    """Return the controlled quantity, ``None`` if it is not known, and the set point over the time in s."""
    quantity = getattr(controller, "quantity", None)
    allowed = f"one of {', '.join(CONTROLLED)}, or left out"
    require(quantity is None or quantity in CONTROLLED, "quantity of the controller", quantity, allowed)
    set_point = getattr(controller, "set_point", None)
    times, values = np.transpose(course)
    if not callable(set_point):
        return quantity, lambda time: float(np.interp(time, times, values))
    if np.any(values):
        raise ParameterError("The controller has a set_point of its own, and reference has a course. Leave one out.")
    return quantity, lambda time: float(set_point(time))


def check_sample_time(sample_time: float, drive: TwoPhaseDrive) -> None:
    """Raise ParameterError for a time between two samples below one period of a drive."""
    valid, allowed = drive.period <= sample_time < inf, f"at least one period of the drive, {drive.period:.3g} s"
    require(valid, "sample_time", sample_time, allowed, unit="s")


def _run(
    plant: Spice | Compiled, decide: Controller, point: AveragedPoint, rounding: Rounding,
    reference: Callable[[float], float], *, count: int, sample_time: float, records: int,
) -> tuple[dict[str, Array], dict[str, Array]]:  # fmt: skip
    """Run a controller for a number of samples; ``reference`` is over the time in s.

    Return its inputs and commands at each sample, and the records between. Raise ParameterError for a command that is
    not valid, SimulationError if the engine fails.
    """
    motor, settings = point.point.motor, point.settings
    wanted = {name: first(settings[name]) for name in COMMANDS}  # what the controller set
    fixed = [name for name in COMMANDS if len(settings[name]) > 1]
    present, delay = {name: wanted[name] for name in COMMANDS if name not in fixed}, rounding.electronics.delay_s
    _act(plant, rounding.commands(wanted), present)
    rows, between = list[list[float]](), list[list[float]]()
    last = seen = now = State(0.0)
    measured, exact = 0.0, Rounding(IDEAL)  # the last measured angle; of the records
    for number in range(1, count + 1):
        begin, waiting = (number - 1) * sample_time, delay > 0.0 and number > 1
        for part in range(1, records + 1):
            until = begin + part * sample_time / records if part < records else number * sample_time
            if waiting and begin + delay <= until:
                now = plant.advance(begin + delay)
                _act(plant, rounding.commands(wanted), present)
                waiting = False
            if until > now.time:
                now = plant.advance(until)
            if records > 1:
                ideal = vars(_sample(now, seen, exact, seen.position, 0.0)) | {"load_position_rad": now.load_position}
                between.append([ideal[name] for name in RECORDS])
                seen = now
        sample = _sample(now, last, rounding, measured, reference(now.time), linear=motor.slider is not None)
        power = (now.energy - last.energy) / (now.time - last.time)
        measured, last = sample.position_rad, now
        changed = _commands(decide(sample), wanted, motor)
        for name in fixed:
            if name in changed:
                raise ParameterError(f"The controller set {name}, which has a course or a soft start. Leave one out.")
            wanted[name] = float(np.interp(now.time, *np.transpose(settings[name])))
        wanted |= changed
        set_now = rounding.commands(wanted)
        rows.append([
            *vars(sample).values(), *set_now.values(), power, now.heat, now.load_position, now.check,
            now.separated, now.tip_y_amplitude,
        ])  # fmt: skip
        if not delay:
            _act(plant, set_now, present)
    names = [name for name in SAMPLES if name != "load_torque_n_m"]
    samples = dict(zip(names, np.transpose(rows), strict=True))
    return samples, dict(zip(RECORDS, np.transpose(between), strict=True)) if between else {}


def _act(plant: Spice | Compiled, commands: Mapping[str, float], present: dict[str, float]) -> None:
    """Give the motor the commands that are not the present ones, which are those without a course."""
    for name in present:
        if commands[name] != present[name]:
            plant.alter(name, commands[name])
            present[name] = commands[name]


def _sample(
    now: State, last: State, rounding: Rounding, measured: float, reference: float, *, linear: bool = False
) -> Sample:
    """Return the sample between two states; ``measured`` is the angle that was measured at the last one, rad."""
    interval = now.time - last.time
    position = rounding.position(now.position, linear=linear)
    charges, fluxes = zip(now.charges, last.charges, strict=True), zip(now.fluxes, last.fluxes, strict=True)
    currents = [rounding.current((after - before) / interval) for after, before in charges]
    voltages = [rounding.voltage((after - before) / interval) for after, before in fluxes]
    current_a, current_b = ((abs(current), degrees(cmath.phase(current))) for current in currents)
    return Sample(
        now.time, (position - measured) / interval, position, *current_a, now.temperature, reference, *current_b,
        *map(abs, voltages),
    )  # fmt: skip


def _commands(returned: Mapping[str, float], present: Mapping[str, float], motor: Motor) -> dict[str, float]:
    """Return the checked commands of a controller. Raise ParameterError for an unknown name or a value out of range."""
    if not isinstance(returned, Mapping):
        raise ParameterError(
            f"The controller returned {type(returned).__name__}: it must return a mapping of settings."
        )
    given = dict(returned)
    if "voltage" in given:
        voltage = given.pop("voltage")
        given = {"voltage_a": voltage, "voltage_b": voltage} | given
    lowest, highest = (bound(mode.frequency_hz for mode in motor.modes) for bound in (min, max))
    ranges = {
        "frequency": (SLOWEST_DRIVE * lowest, FASTEST_DRIVE * highest), "phase_deg": (-1e4, 1e4),
        "voltage_a": (-MOST_VOLTAGE, MOST_VOLTAGE), "voltage_b": (-MOST_VOLTAGE, MOST_VOLTAGE),
    }  # fmt: skip
    for name, value in given.items():
        if name not in present:
            raise ParameterError(f"The controller set {name!r}: it must be voltage or one of {', '.join(present)}.")
        low, high = ranges[name]
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = float("nan")
        if not low <= number <= high:
            raise ParameterError(f"The controller set {name} = {value!r}: it must be {low:g} to {high:g}.")
        given[name] = number
    return given


# --- controllers in C ---


class Firmware:
    """A controller in a shared library, loaded from a copy so that its variables are initialised.

    It has the interface of ``piezomotor_firmware.h``, or one function ``step``.

    Raises:
        ParameterError: for a file that is not a library with the functions of a controller.
    """

    def __init__(self, path: str | Path, drive: TwoPhaseDrive, sample_time: float) -> None:
        try:
            # Windows keeps the file of a library that is loaded
            with tempfile.TemporaryDirectory(prefix="piezomotor-", ignore_cleanup_errors=True) as folder:
                self._c = ctypes.CDLL(str(shutil.copy(path, folder)))
            self._single = hasattr(self._c, "firmware_step")
            step = self._c.firmware_step if self._single else self._c.step
            self.names = self._log_names() if self._single else []
        except (OSError, AttributeError, ValueError) as error:
            raise ParameterError(
                f"{path} cannot be used as a controller: {error}. Compile it as a shared library with the functions of "
                "piezomotor_firmware.h, or with a function step."
            ) from None
        self._step = step
        self._step.restype = None
        self.logs: list[list[float]] = []
        if self._single:
            self._out: Any = (ctypes.c_float * 4)(drive.voltage, drive.voltage_b, drive.phase_deg, drive.frequency)
            self._c.firmware_init(ctypes.c_float(sample_time), self._out)
        else:
            pointer = ctypes.POINTER(ctypes.c_double)
            self._step.argtypes = (ctypes.c_double, pointer, pointer)
            self._out = (ctypes.c_double * 3)(drive.voltage, drive.phase_deg, drive.frequency)

    def _log_names(self) -> list[str]:
        count = ctypes.c_int.in_dll(self._c, "firmware_logs").value
        if not 0 <= count <= MOST_LOGS:
            raise ValueError(f"firmware_logs = {count} must be 0 to {MOST_LOGS}")
        self._c.firmware_init, self._c.firmware_log  # noqa: B018 -- both must be there
        return [(name or b"").decode() for name in (ctypes.c_char_p * count).in_dll(self._c, "firmware_log_names")]

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return the commands of the library for a sample."""
        time, *seen = vars(sample).values()
        if not self._single:
            self._step(time, (ctypes.c_double * len(seen))(*seen), self._out)
            return dict(zip(("voltage", "phase_deg", "frequency"), map(float, self._out), strict=True))
        self._step((ctypes.c_float * (1 + len(seen)))(time, *seen), self._out)
        values = (ctypes.c_float * MOST_LOGS)()
        self._c.firmware_log(values)
        self.logs.append(list(values[: len(self.names)]))
        return dict(zip(("voltage_a", "voltage_b", "phase_deg", "frequency"), map(float, self._out), strict=True))
