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
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import ceil, degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydantic import SkipValidation

from pyspice_runner.analysis.averaged import INPUT_OF, averaged_engine, deck_of, model_cautions, settings_of
from pyspice_runner.engine.session import Session
from pyspice_runner.errors import ParameterError
from pyspice_runner.model.drive import FASTEST_DRIVE, SLOWEST_DRIVE, Load, TwoPhaseDrive, too_fast
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import Course
from pyspice_runner.netlist.contact import PAPER_LAW
from pyspice_runner.netlist.controlled import CHECKED, COMMANDS, SAMPLED, CommandedSource, controlled_bench
from pyspice_runner.netlist.sources import Bench, DriveSource
from pyspice_runner.result import Result, contact_row
from pyspice_runner.run.averaged_motor import AveragedMotor
from pyspice_runner.run.engines import Engine
from pyspice_runner.run.kernel import transient_timing
from pyspice_runner.run.operating_point import OperatingPoint, Solver
from pyspice_runner.run.window import Array
from pyspice_runner.units import linear_name

MOST_SAMPLES = 100_000
MOST_VOLTAGE = 1e4  # V, as of a drive
SAMPLES: dict[str, tuple[str, str]] = {
    "time_s": ("s", "time of the sample"),
    "speed_rad_s": ("rad/s", "mean speed of the rotor since the last sample"),
    "position_rad": ("rad", "angle of the rotor"),
    "current_amplitude_a": ("A", "amplitude of the current into group A, mean since the last sample"),
    "current_phase_deg": ("deg", "phase of that current ahead of the voltage of group A"),
    "temperature_k": ("K", "temperature of the stator above that at which its parameters hold"),
    "frequency_hz": ("Hz", "drive frequency from this sample on"),
    "voltage_a_v": ("V", "amplitude of group A from this sample on"),
    "voltage_b_v": ("V", "amplitude of group B from this sample on"),
    "phase_deg": ("deg", "phase of group B ahead of group A from this sample on"),
    "load_torque_n_m": ("N·m", "torque that the load draws"),
    "check": ("1", "motion that the averaged motor leaves out, relative to static penetration and limit of stick"),
    "separated": ("1", "share of the period in which the contact of the averaged motor is open"),
}


@dataclass(frozen=True)
class Sample:
    """Measurements passed to the controller, in the units of :data:`SAMPLES`; of a slider in m/s and m."""

    time_s: float
    speed_rad_s: float
    position_rad: float
    current_amplitude_a: float
    current_phase_deg: float
    temperature_k: float


Controller = Callable[[Sample], Mapping[str, float]]


class _Library:
    """A controller in a shared C library, loaded from a copy so that its variables are initialised."""

    def __init__(self, path: str | Path, drive: TwoPhaseDrive) -> None:
        try:
            with tempfile.TemporaryDirectory(prefix="piezomotor-") as folder:
                self._step = ctypes.CDLL(str(shutil.copy(path, folder))).step
        except (OSError, AttributeError) as error:
            raise ParameterError(
                f"{path} cannot be used as a controller: {error}. Compile it as a shared library with a function step."
            ) from None
        pointer = ctypes.POINTER(ctypes.c_double)
        self._step.argtypes, self._step.restype = (ctypes.c_double, pointer, pointer), None
        self._out: Any = (ctypes.c_double * 3)(drive.voltage, drive.phase_deg, drive.frequency)

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return the commands of the library."""
        time, *seen = vars(sample).values()
        self._step(time, (ctypes.c_double * len(seen))(*seen), self._out)
        return dict(zip(("voltage", "phase_deg", "frequency"), map(float, self._out), strict=True))


@dataclass(frozen=True, repr=False)
class ControlledRun(Result):
    """Samples and commands of a controller.

    Attributes:
        samples: arrays by the names of :data:`SAMPLES`, one value a sample; of the full motor without ``check`` and
            ``separated``.
        provenance: motor, drive and run settings, JSON-ready.
        write_deck: returns the netlist of the run, for ngspice; the controller is not in it.
    """

    samples: Mapping[str, Array] = field(repr=False)
    provenance: dict[str, Any] = field(repr=False)
    write_deck: Callable[[], str] = field(repr=False)

    units = SAMPLES

    if TYPE_CHECKING:  # the samples are attributes

        def __getattr__(self, name: str) -> Array: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "samples", self._keyed(self.samples))
        self.__dict__.update(self.samples)

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.provenance["motor"]

    def columns(self) -> Mapping[str, Array]:
        """Return the samples over time."""
        return self.samples

    @cached_property
    def deck(self) -> str:  # type: ignore[override]
        """Netlist of the run, for ngspice, without the controller."""
        return self.write_deck()

    @property
    def trusted(self) -> bool:
        """Whether the averaged motor's own check passes at every sample, and the rotor keeps its limit of speed.

        The full motor has no such check.
        """
        return not (self._model_cautions or self._too_fast)

    @property
    def _model_cautions(self) -> tuple[str, ...]:
        if "check" not in self.samples:
            return ()
        return model_cautions(float(self.samples["check"].max()), float(self.samples["separated"].max()))

    @property
    def _too_fast(self) -> tuple[str, ...]:
        return too_fast(self.provenance["motor"], float(np.abs(self.samples["speed_rad_s"]).max()))

    @property
    def cautions(self) -> tuple[str, ...]:
        """Findings of the averaged motor's own check, and whether the rotor exceeds its limit of speed."""
        return self._told((*self._model_cautions, *self._too_fast))

    def summary(self) -> dict[str, str]:
        """Return the last sample, and whether the averaged motor's own check passed."""
        shown = {name: unit for name, (unit, _) in SAMPLES.items() if name in self.samples and unit != "1"}
        names = {name: name.removesuffix(f"_{unit}") for name, unit in shown.items()} | {
            "load_torque_n_m": "load torque"
        }
        names |= {name: linear_name(name) or words for name, words in names.items()} if self.linear else {}
        found = {names[name]: f"{self.samples[name][-1]:.4g} {unit}" for name, unit in shown.items()}
        checked = {"check": "passed" if self.trusted else "not passed"} if "check" in self.samples else {}
        return self._worded(found | checked | contact_row(self.provenance["run"]))

    def to_dict(self) -> dict[str, Any]:
        """Return the last sample and the settings, JSON-ready."""
        end = {name: float(values[-1]) for name, values in self.samples.items()}
        checked = [name for name in ("check", "separated") if name in self.samples]
        greatest = {f"greatest_{name}": float(self.samples[name].max()) for name in checked}
        return self._keyed(
            {"end": end, **self._entries("trusted"), **greatest, **self.provenance, **self._entries("cautions")}
        )


@checked
def simulate_controlled(
    motor: Motor,
    drive: TwoPhaseDrive,
    controller: Controller | str | Path,
    duration: float,
    *,
    sample_time: float,
    averaged: bool = True,
    load_torque: float = 0.0,
    courses: Mapping[str, SkipValidation[ArrayLike]] | None = None,
    start: Literal["rest", "steady"] = "rest",
    thermal: Thermal | None = None,
    step: float | None = None,
    engine: Engine = "auto",
    timeout: float | None = None,
) -> ControlledRun:
    """Run a motor with a sampled controller.

    Args:
        motor: the motor.
        drive: the commands until the first sample.
        controller: called at every sample time with a :class:`Sample`; it returns what changes: ``voltage`` (V, of both
            groups), ``voltage_a``, ``voltage_b``, ``phase_deg``, ``frequency`` (Hz). A negative amplitude turns the
            phase by 180°. A path is that of a shared library of C code with the function
            ``void step(double t, const double *in, double *out)``. ``in`` has speed (rad/s), position (rad), current
            amplitude (A), current phase (deg) and temperature (K). ``out`` takes amplitude of both groups (V), phase
            (deg) and frequency (Hz), and has the present values on entry. The library runs in this process: only load
            code that you trust.
        duration: simulated time in s.
        sample_time: time in s between two samples; at least one period of the drive.
        averaged: whether the averaged motor runs, or the full one, cycle by cycle.
        load_torque: torque in N·m that a load draws from the shaft.
        courses: what changes during the run, as in :func:`simulate_averaged`; a controller that sets a quantity with a
            course is an error.
        start: ``"rest"``, preloaded and without voltage; ``"steady"``, the steady state at the drive and the load of
            the start, of the compiled averaged motor only.
        thermal: drift with temperature; the losses then heat the stator.
        step: time step in s of the full motor; by default that of ``simulate``. It is made a whole part of the sample
            time.
        engine: of the averaged motor, as in :func:`simulate_averaged`.
        timeout: wall time in s for the way from one sample to the next, in ngspice.

    Raises:
        ParameterError: for a value out of range, also one that the controller returns.
        SimulationError: if the engine fails, or there is no steady state to start from.
    """
    count = _count(drive, duration, sample_time)
    load = Load(None, load_torque)
    load.check(motor)
    settings = settings_of(drive, load, courses or {})
    CommandedSource(settings, drive).check(motor)
    used = averaged_engine(engine) if averaged else "spice"
    if start == "steady" and used == "spice":
        raise ParameterError(
            "start = 'steady' is not valid here: only the compiled averaged motor starts at a steady state. Give "
            "averaged = True and engine = 'compiled', or start = 'rest'."
        )
    uniform = None
    if not averaged:  # the largest step that divides the sample time and is not above the usual one
        coarsest = OperatingPoint(motor, CommandedSource(settings, drive), solver=Solver(step)).step
        uniform = sample_time / ceil(sample_time / coarsest * (1.0 - 1e-12))
    elif step is not None:
        raise ParameterError("step has no effect on an averaged run, whose engine chooses its steps. Leave it out.")

    def bench() -> Bench:
        return controlled_bench(motor, drive, settings, sample_time=sample_time, step=uniform, thermal=thermal)

    vectors = [*SAMPLED, *(CHECKED if averaged else ()), *(["v(temperature)"] if thermal else [])]
    timing = transient_timing(uniform or drive.period, (count + 1) * sample_time, uniform or 0.5 * sample_time)
    write_deck = partial(deck_of, bench, vectors, timing)
    decide = _Library(controller, drive) if isinstance(controller, str | Path) else controller
    with ExitStack() as stack:
        if used == "compiled":
            motion: _Motion = _Compiled(motor, settings, thermal, steady=start == "steady")
        else:
            write_deck = partial(str, write_deck())
            motion = _Spice(stack.enter_context(Session(write_deck(), vectors, timeout=timeout)))
        table = _run(motion, decide, settings, motor, (number * sample_time for number in range(1, count + 1)))
    names = [name for name in SAMPLES if name != "load_torque_n_m"]
    samples = {name: table[:, index] for index, name in enumerate(names)}
    samples["load_torque_n_m"] = np.interp(samples["time_s"], *np.transpose(settings["load_torque"]))
    return ControlledRun(
        samples={name: samples[name] for name in SAMPLES if averaged or name not in ("check", "separated")},
        provenance={
            "motor": motor.to_dict(),
            "drive": DriveSource(drive).to_dict(),
            "run": {
                "duration_s": duration, "sample_time_s": sample_time, "averaged": averaged, "engine": used,
                "step_s": uniform, "start": start, "load_torque_n_m": load_torque,
                "courses": {name: [*map(list, course)] for name, course in settings.items() if len(course) > 1},
                "thermal": None if thermal is None else thermal.model_dump(),
                **PAPER_LAW.to_dict(),
            },
        },
        write_deck=write_deck,
    )  # fmt: skip


def _count(drive: TwoPhaseDrive, duration: float, sample_time: float) -> int:
    """Return the number of samples."""
    if not (isfinite(sample_time) and sample_time >= drive.period):
        raise ParameterError(
            f"sample_time = {sample_time:g} s is out of range: it must be at least one period of the drive, "
            f"{drive.period:.3g} s."
        )
    count = int(duration / sample_time * (1.0 + 1e-9)) if isfinite(duration) and duration > 0.0 else 0
    if not 1 <= count <= MOST_SAMPLES:
        raise ParameterError(
            f"duration = {duration:g} s is out of range: it must hold 1 to {MOST_SAMPLES} samples of {sample_time:g} s."
        )
    return count


def _run(
    motion: _Motion, decide: Controller, settings: Mapping[str, Course], motor: Motor, times: Iterable[float]
) -> Array:
    """Let a controller act on a running motor at sample times in s; return a row for each sample, with the check."""
    present = {name: _first(settings[name]) for name in COMMANDS}
    fixed = [name for name in COMMANDS if len(settings[name]) > 1]
    rows: list[list[float]] = []
    last = State(0.0)
    for time in times:
        now = motion.advance(time)
        sample = _sample(now, last)
        last = now
        changed = _commands(decide(sample), present, motor)
        for name in fixed:
            if name in changed:
                raise ParameterError(f"The controller set {name}, which has a course or a soft start. Leave one out.")
            present[name] = float(np.interp(time, *np.transpose(settings[name])))
        for name, value in changed.items():
            if value != present[name]:
                motion.alter(name, value)
        present |= changed
        rows.append([*vars(sample).values(), *present.values(), now.check, now.separated])
    return np.array(rows)


def _first(course: Course) -> float:
    return float(np.interp(0.0, *np.transpose(course)))


@dataclass(frozen=True)
class State:
    """What a sample and the check are made of."""

    time: float  # s
    position: float = 0.0  # rad
    charge: complex = 0.0  # integral of the amplitude of the current into group A, A·s
    temperature: float = 0.0  # K
    check: float = 0.0
    separated: float = 0.0


class _Motion(Protocol):
    """A running motor."""

    def advance(self, until: float) -> State:
        """Run to a time in s."""

    def alter(self, name: str, value: float) -> None:
        """Set a command from now on."""


class _Spice:
    """A motor in ngspice."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def advance(self, until: float) -> State:
        now = self._session.advance(until)
        return State(
            now["time"], now["v(position)"], 1e-6 * complex(now["v(sum_re)"], now["v(sum_im)"]),
            now.get("v(temperature)", 0.0), *(now.get(name, 0.0) for name in CHECKED),
        )  # fmt: skip

    def alter(self, name: str, value: float) -> None:
        self._session.alter(COMMANDS[name], value)


class _Compiled:
    """The compiled averaged motor."""

    def __init__(self, motor: Motor, settings: Mapping[str, Course], thermal: Thermal | None, *, steady: bool) -> None:
        self._motor, self._time = AveragedMotor(motor, thermal=thermal), 0.0
        self._motor.begin(
            **{of_c: float(np.interp(0.0, *np.transpose(settings[name]))) for name, of_c in INPUT_OF.items()}
        )
        self._courses = {of_c: settings[name] for name, of_c in INPUT_OF.items() if len(settings[name]) > 1}
        if steady:
            self._motor.settle()

    def advance(self, until: float) -> State:
        self._motor.advance(self._time, until, self._courses)
        self._time = until
        numbers = (self._motor.get(name) for name in ("temperature", "check", "separated"))
        return State(until, self._motor.get("position"), self._motor.charge, *numbers)

    def alter(self, name: str, value: float) -> None:
        self._motor.set(**{INPUT_OF[name]: value})


def _sample(now: State, last: State) -> Sample:
    interval = now.time - last.time
    current = (now.charge - last.charge) / interval
    return Sample(
        now.time, (now.position - last.position) / interval, now.position, abs(current),
        degrees(cmath.phase(current)), now.temperature,
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
