# SPDX-License-Identifier: GPL-3.0-or-later
"""The SPICE model against the independent integrator of ``tests/reference``, at operating points off the defaults."""

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pyspice_runner as pr
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.run.point import Point as RunPoint
from pyspice_runner.run.waveforms import Waveforms
from tests.reference.integrator import ReferenceRun, integrate
from tests.runs import simulated
from tests.selection import mostly

# one worker keeps all of these tests, which share reference runs
pytestmark = pytest.mark.xdist_group("reference")

DURATION = 4e-3  # s: at least 40 drive periods, some ten decay times of the modes
OUTPUT_STEP = 1e-7  # s


@dataclass(frozen=True)
class Point:
    """One operating point."""

    drive: pr.TwoPhaseDrive | pr.TwoToneDrive
    preload: float
    load: dict[str, float] = field(default_factory=dict)
    changes: dict[str, Any] = field(default_factory=dict)
    mount: dict[str, float] | None = None

    @property
    def motor(self) -> pr.Motor:
        return pr.load_motor("andersen2002").updated(
            {"contact.preload_n": self.preload, "mount": self.mount, **self.changes}
        )


def springs(stiffness: float, mass: float, damping: float) -> dict[str, float]:
    """A mount by its stiffness in N/m, the carrier's mass in kg and the damping in N·s/m."""
    return {"stiffness_n_per_m": stiffness, "mass_kg": mass, "damping_n_s_per_m": damping}


def two_phase(voltage: float, frequency: float, phase_deg: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase_deg)


def two_tone(
    voltage_1: float, frequency_1: float, voltage_2: float, frequency_2: float, phase: float
) -> pr.TwoToneDrive:
    return pr.TwoToneDrive(
        voltage_1=voltage_1, frequency_1=frequency_1, voltage_2=voltage_2, frequency_2=frequency_2, phase_deg=phase
    )


POINTS = {
    "stick only": Point(two_phase(10.0, 51.7e3, 90.0), 5.0),
    "stick only, hard pressed": Point(two_phase(10.0, 53e3, 90.0), 30.0),
    "mostly slip": Point(two_phase(50.0, 51.7e3, 90.0), 5.0),
    "mostly slip, reversed phase": Point(two_phase(100.0, 51.7e3, -90.0), 5.0),
    "strong drive": Point(two_phase(300.0, 52.5e3, 90.0), 10.0),
    "half stick, half slip": Point(two_phase(100.0, 55e3, 60.0), 20.0),
    "at the first resonance": Point(two_phase(100.0, 13.5e3, 90.0), 5.0),
    "opens, contact resonance": Point(two_phase(60.0, 17.9e3, 90.0), 3.0),
    "hammers, hardly pressed": Point(two_phase(300.0, 18.5e3, 20.0), 1.0),
    "opens, 10 kHz": Point(two_phase(150.0, 10e3, 45.0), 2.0),
    "60 kHz": Point(two_phase(200.0, 60e3, 120.0), 8.0),
    "between the modes": Point(two_phase(120.0, 30e3, -90.0), 1.0),
    "two tones, octave": Point(two_tone(50.0, 13.5e3, 50.0, 27e3, 0.0), 5.0),
    "two tones at mode 2": Point(two_tone(80.0, 25.85e3, 80.0, 51.7e3, 90.0), 3.0),
    "two tones, hammering": Point(two_tone(200.0, 17.9e3, 100.0, 35.8e3, 45.0), 10.0),
    "held shaft": Point(two_phase(100.0, 53e3, 90.0), 5.0, {"speed": 1.0}),
    "load torque": Point(two_phase(100.0, 53e3, 90.0), 5.0, {"load_torque": 5e-5}),
    "another motor": Point(
        two_phase(80.0, 47e3, 70.0),
        4.0,
        changes={
            "modes.0.frequency_hz": 21e3,
            "modes.1.frequency_hz": 46e3,
            "modes.1.tip_y": 0.3,
            "modes.0.tip_x": -0.2,
            "contact.friction": 0.55,
            "contact.normal_stiffness_n_per_m15": 4e9,
            "rotor.radius_m": 4e-3,
            "rotor.inertia_kg_m2": 2e-8,
        },
    ),
    # on mounts, from soft springs to almost rigid ones
    "sprung, mostly slip": Point(two_phase(100.0, 51.7e3, 90.0), 5.0, mount=springs(1e4, 0.05, 50.0)),
    "sprung, opens": Point(two_phase(60.0, 17.9e3, 90.0), 3.0, mount=springs(2e4, 0.05, 50.0)),
    "sprung, opens far": Point(two_phase(150.0, 10e3, 45.0), 5.0, mount=springs(2e4, 0.2, 100.0)),
    "sprung, strong drive": Point(two_phase(300.0, 52.5e3, 90.0), 10.0, mount=springs(1e5, 0.02, 20.0)),
    "sprung, held shaft": Point(two_phase(200.0, 53e3, 90.0), 5.0, {"speed": 3.0}, mount=springs(2e4, 0.05, 50.0)),
    "sprung, two tones": Point(two_tone(80.0, 17.9e3, 60.0, 35.8e3, 45.0), 10.0, mount=springs(1e6, 0.05, 100.0)),
    "stiff mount, load torque": Point(
        two_phase(100.0, 53e3, 90.0), 5.0, {"load_torque": 5e-5}, mount=springs(3e7, 0.01, 50.0)
    ),
    "stiff mount, opens": Point(two_phase(100.0, 16.5e3, 60.0), 4.0, mount=springs(1e9, 0.3, 500.0)),
    "rigid mount, opens": Point(two_phase(60.0, 17.9e3, 90.0), 3.0, mount=springs(1e11, 1.0, 1e3)),
}

# one of each regime and drive, and a mount; the others with `make soak`
ALWAYS = ["mostly slip", "hammers, hardly pressed", "sprung, opens far"]


@cache
def reference(name: str, perturbation_m: float = 0.0) -> ReferenceRun:
    point = POINTS[name]
    return integrate(
        point.motor.to_dict(),
        point.drive.tones_a,
        point.drive.tones_b,
        duration=DURATION,
        output_step=OUTPUT_STEP,
        perturbation_m=perturbation_m,
        statistics_from=DURATION - averaged(point.drive),
        **point.load,
    )


def averaged(drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> float:
    """Length in s of the last whole drive periods, over which the package averages."""
    return min(20, int(DURATION / drive.period * (1 + 1e-9))) * drive.period


@cache
def ours(name: str, points_per_period: int | None = None) -> Waveforms:
    point = POINTS[name]
    if points_per_period is None:
        return simulated(point.motor, point.drive, duration=DURATION, **point.load)
    step = RunPoint(point.motor, DriveSource(point.drive)).shortest_period / points_per_period
    return pr.simulate(point.motor, point.drive, duration=DURATION, step=step, **point.load)


def rms(signal: np.ndarray) -> float:
    return float(np.sqrt(np.mean(signal**2)))


def trajectory_error(name: str, run: Waveforms) -> float:
    """RMS distance of the tip from the reference's, relative to the RMS of the tip's own motion."""
    exact = reference(name)
    away = np.hypot(
        CubicSpline(run.time_s, run.tip_x_m)(exact.time_s) - exact.tip_x_m,
        CubicSpline(run.time_s, run.tip_y_m)(exact.time_s) - exact.tip_y_m,
    )
    motion = np.hypot(exact.tip_x_m - exact.tip_x_m.mean(), exact.tip_y_m - exact.tip_y_m.mean())
    return rms(away) / rms(motion)


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, POINTS, ["sprung, opens far"]))
def test_the_reference_motion_is_not_chaotic_there(name: str) -> None:
    # a start 1 pm away stays within 1 nm, so that trajectories and not only statistics can be compared
    assert np.abs(reference(name).tip_y_m - reference(name, 1e-12).tip_y_m).max() < 1e-9


def state_error(name: str, run: Waveforms) -> float:
    """Largest deviation of a state's share of time from the reference's."""
    return max(abs(run.state_fractions[state] - share) for state, share in reference(name).state_fractions.items())


def speed_error(name: str, run: Waveforms) -> float:
    """Deviation of the mean rotor speed over the last periods, relative to the peak speed."""
    exact = reference(name)
    window = exact.time_s >= DURATION - averaged(POINTS[name].drive) - 0.5 * OUTPUT_STEP
    mean = np.trapezoid(exact.rotor_speed_rad_s[window], exact.time_s[window]) / np.ptp(exact.time_s[window])
    return float(abs(run.mean_rotor_speed_rad_s - mean) / np.abs(exact.rotor_speed_rad_s).max())


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, POINTS, ALWAYS))
def test_tip_states_rotor_and_energy_are_those_of_the_reference(name: str) -> None:
    run = ours(name)
    assert trajectory_error(name, run) < 0.005  # required; measured 0.01 % to 0.1 %
    assert state_error(name, run) < 0.01  # required; a point of 128 a period is 0.8 percentage points
    assert speed_error(name, run) < 0.01  # required; measured at most 0.4 %
    assert run.energy_residual < 1e-3  # required; measured at most 4e-5


GAIN_POINT = "mostly slip"
GAIN_STEPS = (0.4e-6, 0.2e-6, 0.1e-6, 0.05e-6)
COARSE_STEPS = GAIN_STEPS[:2]  # each finer step takes as long as the coarser ones together


@cache
def gain(step: float) -> tuple[float, float]:
    """Return the trajectory error at a step, without and with the discretisation that is exact at resonance."""
    point = POINTS[GAIN_POINT]
    plain, exact = (
        pr.simulate(point.motor, point.drive, duration=DURATION, step=step, exact_resonance=exact_resonance)
        for exact_resonance in (False, True)
    )
    return trajectory_error(GAIN_POINT, plain), trajectory_error(GAIN_POINT, exact)


def test_halving_the_step_quarters_the_error_with_and_without_exact_resonance() -> None:
    errors = np.array([gain(step) for step in COARSE_STEPS])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.1)


def test_exact_resonance_makes_the_error_many_times_smaller() -> None:
    for step in COARSE_STEPS:
        plain, exact = gain(step)
        assert exact < plain / 20  # measured 76 times, at the second resonance


@cache
def told() -> dict[str, list[str]]:
    """The rows of the accuracy page."""
    page = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|")]
    return {row[0]: row[1:] for row in rows}


SHOWN = [name for name in POINTS if name in told()]


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, SHOWN, [name for name in ALWAYS if name in SHOWN]))
def test_the_accuracy_page_tells_what_is_measured(name: str) -> None:
    """Numbers may move with ngspice's version and the compiler by their last digit, not more."""
    run = ours(name)
    measured = (trajectory_error(name, run), state_error(name, run), speed_error(name, run))
    for cell, value in zip(told()[name][:3], measured, strict=True):
        assert float(cell) == pytest.approx(100 * value, rel=0.2, abs=0.02)
