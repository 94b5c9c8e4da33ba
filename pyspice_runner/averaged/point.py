# SPDX-License-Identifier: GPL-3.0-or-later
"""The operating point of an averaged run: a point, its checked courses over time, the networks and the shaft's load."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, inf, pi, radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.averaged.core import Array, AveragedMotor
from pyspice_runner.averaged.driver import AveragedDrive
from pyspice_runner.averaged.library import (
    HARMONICS,
    OPTIONS,
    PHASES,
    Schedule,
    add_angle,
    add_averaged_motor,
    add_surroundings,
    check_averaged,
    check_resolution,
    first,
    require_averaged,
    schedule_text,
)
from pyspice_runner.circuit.bench import Bench, add_cooling
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import UNCOUPLED, ShaftLoad, TwoPhaseDrive, check_together
from pyspice_runner.run.kernel import simulator
from pyspice_runner.run.point import Point

INPUT_OF = {  # setting → input of the averaged motor in C
    "frequency": "frequency", "voltage_a": "amplitude_a", "voltage_b": "amplitude_b", "phase_deg": "phase",
    "load_torque": "load_torque", "preload": "preload", "temperature": "ambient_temperature",
}  # fmt: skip
# quantities that may change during a run, with their units; further ones, which not every engine follows over time
SETTINGS = {"frequency": "Hz", "voltage_a": "V", "voltage_b": "V", "phase_deg": "deg", "load_torque": "N.m"}
SPECIAL = {"preload": "N", "temperature": "K"}
# setting of the drive → node at which a bench has its value
COMMANDS = {"frequency": "set_frequency", "voltage_a": "set_a", "voltage_b": "set_b", "phase_deg": "set_phase"}
MOST_POINTS_OF_A_SCHEDULE = 10_000
LONGEST_STEPS = {"spice": 50, "compiled": 200}  # smallest number of steps of a run; linear in between
VALUES_OF_A_FUNCTION = 1000  # over the duration of a run
ScheduleLike = ArrayLike | Callable[[float], float]


@dataclass(frozen=True)
class AveragedPoint:
    """What an averaged run needs, whichever engine runs it."""

    point: Point  # motor, load and drift
    front: AveragedDrive  # the stages at the start, and the networks behind them
    settings: Mapping[str, Schedule]  # of all quantities that may change, over time
    shaft: ShaftLoad = UNCOUPLED  # coupled to the free shaft
    phases: int = PHASES
    harmonics: int = HARMONICS

    @classmethod
    def of(
        cls,
        point: Point,
        duration: float,
        *,
        courses: Mapping[str, ScheduleLike] | None = None,
        shaft: ShaftLoad | None = None,
        phases: int = PHASES,
        harmonics: int = HARMONICS,
    ) -> AveragedPoint:
        """Return the point of a run of a duration in s; the arguments are those of :func:`simulate_averaged`.

        Raise ParameterError for a value out of range, another kind of drive or law.
        """
        front, point = AveragedDrive.of(point.drive), replace(point, motor=require_averaged(point.motor))
        check_averaged(point.touching("It has no averaged model."))
        check_resolution(phases, harmonics)
        check_together(point.motor, front.stage)
        if shaft is not None and point.load.speed is not None:
            raise ParameterError("shaft has no effect on a shaft that is held at a speed. Leave one out.")
        settings = settings_of(point, front.stage, courses or {}, duration)
        return cls(point, front, settings, shaft or UNCOUPLED, phases, harmonics)

    @property
    def inputs(self) -> dict[str, Schedule]:
        """The settings by the inputs of the averaged motor in C."""
        return {of_c: self.settings[name] for name, of_c in INPUT_OF.items() if name in self.settings}

    def compiled(self, longest: float = inf) -> AveragedMotor:
        """Return the compiled motor at the start of the run, with a longest internal step in s."""
        running = AveragedMotor(
            self.point.motor, thermal=self.point.thermal, shaft=self.shaft, speed=self.point.load.speed,
            phases=self.phases, harmonics=self.harmonics, longest=longest, networks=self.front.networks,
        )  # fmt: skip
        running.begin(**{name: first(course) for name, course in self.inputs.items()})
        return running

    def recorded(self, duration: float, *, steady: bool = False, **values: float) -> dict[str, Array]:
        """Return the records of the compiled motor, from rest or its steady state; amplitudes of the groups are ≥ 0.

        ``values`` replace parameters. Raise SimulationError if there is no C compiler, or the run fails.
        """
        running = self.compiled(max(duration / LONGEST_STEPS["compiled"], self.front.stage.period))
        running.set(**values)
        if steady:
            running.settle()
        rows = running.record(self.inputs, duration, timeout=self.point.solver.timeout, begin=not steady)
        if self.front.networks:
            rows |= {f"amplitude_{group}": rows[f"pin_amplitude_{group}"] for group in "ab"}
            rows["phase"] = rows["phase"] + rows["pin_phase_b"] - rows["pin_phase_a"]
        turned = (rows["amplitude_a"] < 0.0) != (rows["amplitude_b"] < 0.0)  # a negative amplitude turns by 180°
        amplitudes = {name: np.abs(rows[name]) for name in ("amplitude_a", "amplitude_b")}
        return rows | amplitudes | {"phase": rows["phase"] + 180.0 * turned}

    def bench(self) -> Bench:
        """Return a bench with ideal sources and an averaged motor ``Xmotor`` whose shaft is free, loaded or held.

        ``v(position)`` is the angle of the shaft in rad; ``Va_re``, ``Va_im``, ``Vb_re``, ``Vb_im`` carry the currents
        into the pins. With drift the losses heat the motor through ``Xcooling``. Networks are between the nodes
        ``stage_GROUP_PART`` of the sources and ``drive_GROUP_PART``.

        Raises:
            ParameterError: for a course of the preload, which is a number in the subcircuit.
        """
        if "preload" in self.settings:
            raise ParameterError(
                "courses: preload cannot change in the averaged motor of ngspice. Take engine = 'compiled', or the "
                "full motor."
            )
        motor, load, thermal = self.point.motor, self.point.load, self.point.thermal
        circuit = Circuit(f"{motor.name}: averaged over the period of the drive")
        add_commands(circuit, self.settings)
        angle = f"{pi / 180.0!r}*V(set_phase)"
        values = {"a_re": "V(set_a)", "a_im": "0", "b_re": f"V(set_b)*cos({angle})", "b_im": f"V(set_b)*sin({angle})"}
        for node, value in values.items():
            circuit.raw_spice += f"Bdrive_{node} {'stage' if self.front.networks else 'drive'}_{node} 0 V={value}\n"
            circuit.V(node, f"drive_{node}", node, "DC 0")
        if self.front.networks:
            self.front.add(circuit)
        if load.speed is not None:
            circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(load.speed)!r}")
        else:
            circuit.I("load", "shaft", circuit.gnd, schedule_text(self.settings["load_torque"]))
        add_angle(circuit, self.shaft)
        if thermal is not None:
            add_cooling(circuit, thermal)
            add_surroundings(circuit, self.settings, thermal)
        pins = ("a_re", "a_im", "b_re", "b_im", "set_frequency", "shaft", "temperature", "heat")
        add_averaged_motor(circuit, motor, pins, phases=self.phases, harmonics=self.harmonics, thermal=thermal)
        # of the clamped capacitances: a voltage step would draw an infinite current
        a, b, phase = (self.settings[name][0][1] for name in ("voltage_a", "voltage_b", "phase_deg"))
        at_once = {"a_re": a, "b_re": b * cos(radians(phase)), "b_im": b * cos(radians(phase - 90.0))}
        return Bench(circuit, OPTIONS, {} if self.front.networks else at_once)

    def deck(
        self, vectors: Sequence[str], timing: Mapping[str, Any], bench: Callable[[], Bench] | None = None
    ) -> str | None:
        """Return the netlist of a transient; ``None`` for contacts or a schedule that ngspice does not have."""
        absent = self.point.motor.contacts or "preload" in self.settings
        return None if absent else deck_of(bench or self.bench, vectors, timing)

    def provenance(self, **run: Any) -> dict[str, Any]:
        """Return the description of a run in its results, JSON-ready; ``run`` are the settings of an analysis."""
        settings = {
            **PAPER_LAW.to_dict(),
            "load_torque_n_m": self.point.load.torque,
            "shaft": None if self.shaft is UNCOUPLED else self.shaft.model_dump(),
            "courses": {name: [*map(list, course)] for name, course in self.settings.items() if len(course) > 1},
            "thermal": None if self.point.thermal is None else self.point.thermal.model_dump(),
        }
        return {"motor": self.point.motor.to_dict(), "drive": self.front.to_dict(), "run": run | settings}


def add_commands(circuit: Circuit, settings: Mapping[str, Schedule]) -> None:
    """Add the sources of the drive's settings over time."""
    for name, node in COMMANDS.items():
        circuit.V(node, node, circuit.gnd, schedule_text(settings[name]))


def deck_of(bench: Callable[[], Bench], vectors: Sequence[str], timing: Mapping[str, Any]) -> str:
    """Return the netlist of a transient of a bench."""
    return str(simulator(bench(), vectors).prepare("transient", **timing))


def settings_of(
    point: Point, stage: TwoPhaseDrive, courses: Mapping[str, ScheduleLike], duration: float
) -> dict[str, Schedule]:
    """Return the courses of all settings, constant unless the user gives one, over a duration in s.

    ``stage`` is the drive at the start. Preload and temperature are in it only if the user gives them. Raise
    ParameterError for an invalid course.
    """
    given = dict(courses)
    if "voltage" in given:
        if {"voltage_a", "voltage_b"} & given.keys():
            raise ParameterError("courses: voltage and voltage_a or voltage_b exclude each other. Give one or the two.")
        given["voltage_a"] = given["voltage_b"] = given.pop("voltage")
    constant = (stage.frequency, stage.voltage, stage.voltage_b, stage.phase_deg, point.load.torque)
    settings: dict[str, Schedule] = {name: [(0.0, value)] for name, value in zip(SETTINGS, constant, strict=True)}
    if stage.soft_start > 0.0:
        settings["voltage_a"] = [(0.0, 0.0), (stage.soft_start, stage.voltage)]
        settings["voltage_b"] = [(0.0, 0.0), (stage.soft_start, stage.voltage_b)]
    for name, rows in given.items():
        if name == "reference":
            raise ParameterError("courses: reference has an effect on a controller only. Leave it out.")
        settings[name] = schedule_of(name, rows, duration)
    ambient = point.thermal.ambient_k if point.thermal else 0.0
    for name, value in (("preload", point.motor.contact.preload_n), ("temperature", ambient)):
        if name in given and settings[name][0][1] != value:
            raise ParameterError(
                f"courses: {name} begins at {settings[name][0][1]:g} {SPECIAL[name]}: it must begin at the value "
                f"of the motor, {value:g} {SPECIAL[name]}."
            )
    if "temperature" in given and point.thermal is None:
        raise ParameterError("courses: temperature takes thermal, which has the coefficients of the drift. Give it.")
    if point.load.speed is not None and "load_torque" in given:
        raise ParameterError("courses: load_torque has no effect on a shaft that is held at a speed. Leave one out.")
    return settings


def schedule_of(name: str, rows: ScheduleLike, duration: float) -> Schedule:
    """Return the course of a quantity over a duration in s, of which a function gives a thousand values.

    Raise ParameterError for an unknown name, or rows that are not valid.
    """
    known = SETTINGS | SPECIAL | {"reference": "the controller's unit"}
    if name not in known:
        raise ParameterError(f"courses: {name!r} is not known: it must be voltage or one of {', '.join(known)}.")
    try:
        if callable(rows):
            times = np.linspace(0.0, duration, VALUES_OF_A_FUNCTION + 1)
            table = np.array([[time, float(rows(float(time)))] for time in times])
        else:
            table = np.asarray(rows, dtype=float)
            table = np.array([[0.0, float(table)]]) if table.ndim == 0 else table
    except (TypeError, ValueError):
        table = np.empty(0)
    if table.ndim != 2 or table.shape[1] != 2 or not 1 <= len(table) <= MOST_POINTS_OF_A_SCHEDULE:
        raise ParameterError(
            f"courses: {name} must be 1 to {MOST_POINTS_OF_A_SCHEDULE} rows of time (s) and value ({known[name]}), a "
            "number, or a function of the time."
        )
    if not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0.0).any() or table[0, 0] < 0.0:
        raise ParameterError(f"courses: {name} must have finite values and rising times from 0 s on.")
    if name in ("frequency", "preload") and (table[:, 1] <= 0.0).any():
        unit = known[name]
        raise ParameterError(f"courses: {name} = {table[:, 1].min():g} {unit} is out of range: it must be > 0 {unit}.")
    return [(float(time), float(value)) for time, value in table]
