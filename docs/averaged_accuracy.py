# SPDX-License-Identifier: GPL-3.0-or-later
"""Averaged motor against full model, tables of ``docs/accuracy.md``: ``python -m docs.averaged_accuracy``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from runpy import run_path

import numpy as np

import pyspice_runner as pr
from pyspice_runner.circuit.law import law_of
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.control.simulate import Sample
from pyspice_runner.motor.drive import Load
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states

put = run_path(str(Path(__file__).with_name("tables.py")))["put"]
ALLOWED = 0.02  # of the friction torque: error of a point that is trusted
OWN: dict[str, float] = {}  # changes nothing of the set's mount
SETTLED = 60e-3  # s: five decay times of the mount, twenty of the modes
CASES = (  # set, mount, V, Hz, degrees, speeds of the held shaft in rad/s
    ("andersen2002", None, 200.0, 55e3, 90.0, (0.0, 4.0)),
    ("bimodal40", OWN, 60.0, 40.7e3, 90.0, (0.0, 20.0)),
    ("bimodal40", OWN, 100.0, 40.7e3, 90.0, (0.0, 20.0, 40.0)),
)
STEP, END = 10e-3, 20e-3  # s, of the transients
SAMPLE = 0.25e-3  # s: over which their speeds are averaged
ALLOWED_TRANSIENT = 0.03  # RMS, of the greatest speed
LOAD = 20e-3  # N·m, of the load step
TRANSIENTS = {  # what changes at STEP
    "spin-up": {},
    "frequency + 1 %": {"frequency": 1.01},
    "amplitude − 20 %": {"voltage": 0.8},
    "load step": {"load_torque": LOAD},
}
MOVING = (("bimodal40", 100.0, 40.7e3, 90.0),)  # set, V, Hz, degrees
STATES_HEAD = "|motor|drive|rad/s|full, mN·m|averaged, mN·m|error, % of μF₀R|open, %|trusted|"
TRANSIENTS_HEAD = "|motor|event|speed before, after, rad/s|error, RMS, % of the maximum speed|"


@dataclass(frozen=True)
class Row:
    """One operating point.

    Attributes:
        name: set and mount.
        drive: the drive.
        speed: of the held shaft, rad/s.
        full: mean torque of the full model, N·m.
        averaged: that of the averaged motor, N·m.
        error: their difference over μ F₀ R.
        trusted: whether the averaged run is trusted.
        opened: share of the period in which the contact is open.
        sticks: whether the contact never slips. A standing rotor then keeps the torque that the start left.
    """

    name: str
    drive: pr.TwoPhaseDrive
    speed: float
    full: float
    averaged: float
    error: float
    trusted: bool
    opened: float
    sticks: bool

    @property
    def verdict(self) -> str:
        """``yes`` where the run is trusted, ``no`` where it is not, ``sticks`` where the torque has no one value."""
        if self.sticks:
            return "sticks"
        return "yes" if self.trusted else "no"


def rows(cases: tuple[int, ...] | None = None) -> Iterator[Row]:
    """Measure the cases, or those of the given numbers."""
    for number, (name, mount, voltage, frequency, phase, speeds) in enumerate(CASES):
        if cases is not None and number not in cases:
            continue
        motor = pr.load_motor(name)
        motor = motor.updated({"mount": None} if mount is None else {f"mount.{key}": x for key, x in mount.items()})
        drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
        law = law_of("spring-slider")
        states = steady_states([Point(motor, DriveSource(drive), Load(speed), law) for speed in speeds])
        friction_torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        for speed, state in zip(speeds, states, strict=True):
            run = pr.simulate_averaged(motor, drive, SETTLED, speed=speed)
            averaged = float(run.torque_n_m[-1])
            yield Row(
                name if mount is None else f"{name}, on the mount", drive, speed, state.torque_n_m, averaged,
                (averaged - state.torque_n_m) / friction_torque, run.trusted, float(run.separated[-1]),
                float(run.slip[-1]) == 0.0,
            )  # fmt: skip


@dataclass(frozen=True)
class Transient:
    """A transient of both motors.

    Attributes:
        name: set.
        drive: the drive at the start.
        event: what changes.
        before: speed of the full motor at the change, rad/s.
        after: at the end.
        error: RMS of the difference of the speeds from the change on, over the greatest speed.
    """

    name: str
    drive: pr.TwoPhaseDrive
    event: str
    before: float
    after: float
    error: float


def transients(cases: tuple[tuple[str, str], ...] | None = None) -> Iterator[Transient]:
    """Measure the transients, or those of the given sets and events."""
    for name, voltage, frequency, phase in MOVING:
        motor, drive = pr.load_motor(name), pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
        for event, changes in TRANSIENTS.items():
            if cases is not None and (name, event) not in cases:
                continue
            begin = STEP if changes else 0.0
            run = _loaded if "load_torque" in changes else _commanded
            (time, full), (_, averaged) = (run(motor, drive, changes, averaged) for averaged in (False, True))
            late = time > begin
            error = float(np.sqrt(np.mean((averaged[late] - full[late]) ** 2)) / np.abs(full).max())
            yield Transient(name, drive, event, float(np.interp(begin, time, full)), float(full[-1]), error)


def _commanded(
    motor: pr.Motor, drive: pr.TwoPhaseDrive, changes: dict[str, float], averaged: bool
) -> tuple[np.ndarray, np.ndarray]:
    new = {name: factor * getattr(drive, name) for name, factor in changes.items()}

    def step(sample: Sample) -> dict[str, float]:
        return new if sample.time_s >= STEP - 0.5 * SAMPLE else {}

    run = pr.simulate_controlled(motor, drive, step, duration=END, sample_time=SAMPLE, averaged=averaged)
    return run.time_s - 0.5 * SAMPLE, run.speed_rad_s


def _loaded(
    motor: pr.Motor, drive: pr.TwoPhaseDrive, changes: dict[str, float], averaged: bool
) -> tuple[np.ndarray, np.ndarray]:
    constant = pr.Tracker(kind="none", voltage=drive.voltage, frequency=drive.frequency, phase_deg=drive.phase_deg)
    run = pr.track(motor, constant, disturb="load", begin=STEP, duration=END, averaged=averaged, **changes)
    time = np.arange(0.5 * SAMPLE, END, SAMPLE)
    return time, np.interp(time, run.time_s, run.rotor_speed_rad_s)


def main() -> None:
    """Measure and write the tables."""
    states = (
        f"|{row.name}|{row.drive.label}|{row.speed:g}|{1e3 * row.full:.4g}|{1e3 * row.averaged:.4g}"
        f"|{100.0 * row.error:.2f}|{100.0 * row.opened:.1f}|{row.verdict}|"
        for row in rows()
    )
    put(STATES_HEAD, states)
    moving = (
        f"|{row.name}|{row.event}|{row.before:.3g}, {row.after:.3g}|{100.0 * row.error:.2f}|" for row in transients()
    )
    put(TRANSIENTS_HEAD, moving)


if __name__ == "__main__":
    main()
