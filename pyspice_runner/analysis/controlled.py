# SPDX-License-Identifier: GPL-3.0-or-later
"""A sampled controller in the loop with the averaged or the full motor.

At every sample time the run stops. The controller sees what a sensor would measure over the last interval, and sets
frequency, amplitudes and phase for the next one. One ngspice process runs throughout, so that the motor's state is kept
exactly.
"""

from __future__ import annotations

import cmath
import ctypes
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import ceil, degrees, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pyspice_runner.engine.session import Session
from pyspice_runner.errors import ParameterError
from pyspice_runner.model.drive import FASTEST_DRIVE, SLOWEST_DRIVE, Load, TwoPhaseDrive, too_fast
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.controlled import COMMANDS, SAMPLED, CommandedSource, controlled_bench
from pyspice_runner.netlist.sources import DriveSource
from pyspice_runner.result import Result
from pyspice_runner.run.kernel import simulator
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
        samples: arrays by the names of :data:`SAMPLES`, one value a sample.
        provenance: motor, drive and run settings, JSON-ready.
        deck: the netlist that was run.
    """

    samples: Mapping[str, Array] = field(repr=False)
    provenance: dict[str, Any] = field(repr=False)
    deck: str = field(repr=False)

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

    @property
    def cautions(self) -> tuple[str, ...]:
        """Whether the rotor exceeds its limit of speed."""
        fastest = float(np.abs(self.samples["speed_rad_s"]).max())
        return too_fast(self.provenance["motor"], fastest)

    def summary(self) -> dict[str, str]:
        """Return the last sample."""
        names = {name: name.removesuffix(f"_{unit}") for name, (unit, _) in SAMPLES.items()}
        names |= {name: linear_name(name) or shown for name, shown in names.items()} if self.linear else {}
        return self._worded(
            {names[name]: f"{self.samples[name][-1]:.4g} {unit}" for name, (unit, _) in SAMPLES.items()}
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the last sample and the settings, JSON-ready."""
        end = {name: float(values[-1]) for name, values in self.samples.items()}
        return self._keyed({"end": end, **self.provenance})


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
    thermal: Thermal | None = None,
    step: float | None = None,
    timeout: float | None = None,
) -> ControlledRun:
    """Run a motor with a sampled controller.

    Args:
        motor: the motor, from preloaded rest.
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
        thermal: drift with temperature; the losses then heat the stator.
        step: time step in s of the full motor; by default that of ``simulate``. It is made a whole part of the sample
            time.
        timeout: wall time in s for the way from one sample to the next.

    Raises:
        ParameterError: for a value out of range, also one that the controller returns.
        SimulationError: if ngspice fails.
    """
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
    load = Load(None, load_torque)
    load.check(motor)
    CommandedSource(drive).check(motor)
    uniform = None
    if not averaged:  # the largest step that divides the sample time and is not above the usual one
        coarsest = OperatingPoint(motor, CommandedSource(drive), solver=Solver(step)).step
        uniform = sample_time / ceil(sample_time / coarsest * (1.0 - 1e-12))
    bench = controlled_bench(motor, drive, sample_time=sample_time, step=uniform, load=load, thermal=thermal)
    vectors = [*SAMPLED, *(["v(temperature)"] if thermal else [])]
    ready = simulator(bench, vectors)
    longest = 0.5 * sample_time if averaged else uniform
    deck = str(
        ready.prepare(
            "transient", step_time=drive.period if averaged else uniform, end_time=(count + 1) * sample_time,
            max_time=longest, use_initial_condition=True,
        )
    )  # fmt: skip
    decide = _Library(controller, drive) if isinstance(controller, str | Path) else controller
    present = {"frequency": drive.frequency, "voltage_a": drive.voltage, "voltage_b": drive.voltage_b,
               "phase_deg": drive.phase_deg}  # fmt: skip
    rows: list[list[float]] = []
    last = {"v(position)": 0.0, "v(sum_re)": 0.0, "v(sum_im)": 0.0, "time": 0.0}
    with Session(deck, vectors, timeout=timeout) as session:
        for number in range(1, count + 1):
            now = session.advance(number * sample_time)
            sample = _sample(now, last)
            last = now
            changed = _commands(decide(sample), present, motor)
            for name, value in changed.items():
                if value != present[name]:
                    session.alter(COMMANDS[name], value)
            present |= changed
            rows.append([*vars(sample).values(), *present.values()])
    table = np.array(rows)
    return ControlledRun(
        samples={name: table[:, index] for index, name in enumerate(SAMPLES)},
        provenance={
            "motor": motor.to_dict(),
            "drive": DriveSource(drive).to_dict(),
            "run": {
                "duration_s": duration, "sample_time_s": sample_time, "averaged": averaged, "step_s": uniform,
                "load_torque_n_m": load_torque, "thermal": None if thermal is None else thermal.model_dump(),
            },
        },
        deck=deck,
    )  # fmt: skip


def _sample(now: Mapping[str, float], last: Mapping[str, float]) -> Sample:
    interval = now["time"] - last["time"]
    current = 1e-6 / interval * complex(now["v(sum_re)"] - last["v(sum_re)"], now["v(sum_im)"] - last["v(sum_im)"])
    return Sample(
        now["time"], (now["v(position)"] - last["v(position)"]) / interval, now["v(position)"], abs(current),
        degrees(cmath.phase(current)), now.get("v(temperature)", 0.0),
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
