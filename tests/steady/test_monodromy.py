# SPDX-License-Identifier: GPL-3.0-or-later
"""The derivative along a trace, against periods that ngspice maps from perturbed states."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.evaluated import evaluable
from pyspice_runner.circuit.law import Law, contact_library
from pyspice_runner.motor.drive import Load
from pyspice_runner.steady import shooting
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.monodromy import Derivative, derivatives, differentiable
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import Orbit, Shooting, start_balanced, start_point
from tests.motors import BEAM40

STEPS = 72
PERTURBATION = 3e-5  # of the scale of each state
# Central quotients with this perturbation differ from the derivative by its square, and by the noise of Newton's
# iteration in ngspice (reltol = 1e-6 of a step's change), over the perturbation
TOLERANCE = 2e-5
PAPER = pr.load_motor("andersen2002")
PAPERS_DRIVE = pr.TwoPhaseDrive(voltage=200.0, frequency=51.7e3, phase_deg=90.0)
FLAGSHIP = pr.load_motor("bimodal40")
SHAKEN = pr.load_motor(BEAM40).updated({
    "modes.0.recoil_kg": 1e-3, "modes.1.recoil_x_kg": -2e-3, "mount.mass_kg": 0.02,
    "mount.tangential_stiffness_n_per_m": 3e6, "mount.tangential_damping_n_s_per_m": 20.0,
})  # fmt: skip
SENSED = FLAGSHIP.updated({
    "feedback": {"capacitance_f": 3e-10, "resistance_ohm": 2e4, "couplings_n_per_v": {"mode-3": 0.01, "mode-4": 0.003}}
})  # fmt: skip
LINED = FLAGSHIP.updated({"contact.lining": {"stiffness_n_per_m": 1.2e7, "stiffness_ratio": 1.2, "loss_factor": 0.05}})
CASES = {
    "free shaft, mount": (PAPER, PAPERS_DRIVE, None, Law()),
    "feedback electrode": (SENSED, pr.default_drive(FLAGSHIP), None, Law()),
    "flagship, brush": (FLAGSHIP, pr.default_drive(FLAGSHIP), 10.0, Law("brush", 8)),
    "recoil along both axes": (SHAKEN, pr.default_drive(SHAKEN), 5.0, Law()),
    "damping on a soft compliance": (
        PAPER.updated({"contact.series_compliance_m_per_n": 1e-5, "contact.restitution": 0.3}), PAPERS_DRIVE, 2.0, Law()
    ),
    "coulomb": (PAPER, PAPERS_DRIVE, 2.0, Law("coulomb")),
    "compliance along the rotor": (
        PAPER.updated({"contact.tangential_series_compliance_m_per_n": 4e-8}), PAPERS_DRIVE, 2.0, Law()
    ),
    "lining": (LINED, pr.default_drive(FLAGSHIP), 10.0, Law()),
    "worn tip": (PAPER.updated({"contact.worn_flat_radius_m": 5e-5}), PAPERS_DRIVE, 1.0, Law()),
    "falling friction": (PAPER.updated({"contact.sliding_ratio": 0.7}), PAPERS_DRIVE, 1.0, Law()),
    "modes that soften": (
        PAPER.updated({"modes.0.softening_per_m2": 1e9, "modes.1.damping_growth_per_m2": 1e10}), PAPERS_DRIVE, 2.0,
        Law(),
    ),
    "fixed distance": (PAPER.updated({"mount": None}), PAPERS_DRIVE, 2.0, Law()),
    "brush of 32": (PAPER, PAPERS_DRIVE, 2.0, Law("brush", 32)),
    "flagship, brush of 32": (FLAGSHIP, pr.default_drive(FLAGSHIP), 10.0, Law("brush", 32)),
}  # fmt: skip


def along_and_by_copies(plant: Plant, perturbation: float = PERTURBATION) -> tuple[Orbit, Derivative, Derivative]:
    """Return a point, its derivative along the trace, and the central quotient by perturbed copies."""
    period_map = PeriodMap(plant.drive.period, STEPS)
    point = start_point(plant)
    start_balanced([point])
    moves = perturbation * np.diag(point.scale)
    states = [point.state, *(point.state + moves), *(point.state - moves)]
    traces = [trace for trace in period_map.traces([Copy(plant, state) for state in states]) if trace is not None]
    assert len(traces) == len(states)
    assert traces[0].course is not None
    (along,) = derivatives([traces[0].course], period_map.discretisation)
    up, down = traces[1 : plant.order + 1], traces[plant.order + 1 :]
    width = 2.0 * perturbation * point.scale
    start, end = (
        np.array([one.states[:, at] - other.states[:, at] for one, other in zip(up, down, strict=True)]).T / width
        for at in (0, -1)
    )
    forces = np.array([one.forces(plant) - other.forces(plant) for one, other in zip(up, down, strict=True)]).T / width
    return point, along, Derivative(start, end, forces, along.monodromy)


@pytest.mark.parametrize(
    "name", [name if number < 5 else pytest.param(name, marks=pytest.mark.soak) for number, name in enumerate(CASES)]
)
def test_the_derivative_along_a_trace_is_that_of_perturbed_copies(name: str) -> None:
    motor, drive, speed, law = CASES[name]
    check_derivative(Plant(motor, drive, Load(speed), law))


def check_derivative(plant: Plant) -> None:
    """Check the derivative along a trace against that of perturbed copies."""
    point, along, copies = along_and_by_copies(plant)
    across = point.scale / point.scale[:, np.newaxis]
    for one, other in ((along.at_start, copies.at_start), (along.at_end, copies.at_end)):
        assert np.abs((one - other) * across).max() < TOLERANCE * max(1.0, np.abs(other * across).max())
    slopes = copies.forces * point.scale
    assert np.abs(along.forces * point.scale - slopes).max() < TOLERANCE * np.abs(slopes).max()
    assert np.abs((along.monodromy @ along.at_start - along.at_end) * across).max() < 1e-9  # rounding


@pytest.mark.soak
@pytest.mark.parametrize("name", ["brush of 32", "flagship, brush of 32"])
def test_the_multipliers_of_32_sliders_are_those_of_a_row_that_slips(name: str) -> None:
    """A row that slips as a whole within the period forgets its start: no slider has a multiplier of its own."""
    motor, drive, speed, law = CASES[name]
    few, many = (
        np.sort(np.abs(pr.steady_state(motor, drive, speed=speed, contact=one).floquet_multipliers))[::-1]
        for one in (Law("brush", 8), law)
    )
    moving = 2 * (len(motor.modes) + 1)  # of modes and carrier
    assert len(many) == len(few) + 24
    np.testing.assert_allclose(many[:moving], few[:moving], rtol=1e-3)  # partial slip differs with the width of a cell
    assert max(many[moving], few[moving]) < 1e-9
    _, _, coarse = along_and_by_copies(Plant(motor, drive, Load(speed), law))
    _, _, fine = along_and_by_copies(Plant(motor, drive, Load(speed), law), PERTURBATION / 3.0)
    assert np.abs(coarse.at_end - fine.at_end).max() < 1e-3 * np.abs(fine.at_end).max()


@pytest.mark.soak
def test_the_multipliers_of_32_sliders_that_stick_are_those_of_one_spring() -> None:
    drive = pr.TwoPhaseDrive(voltage=0.5, frequency=51.7e3, phase_deg=90.0)
    one, many = (
        np.sort(np.abs(pr.steady_state(PAPER, drive, speed=0.0, contact=law).floquet_multipliers))[::-1]
        for law in (Law(), Law("brush", 32))
    )
    moving = 2 * (len(PAPER.modes) + 1)
    np.testing.assert_allclose(many[:moving], one[:moving], rtol=1e-4)  # a spring that is linear, and one that is not
    assert many[moving] < 1e-9


def test_runs_with_other_points_in_time_are_differentiated_apart() -> None:
    """As after a step that ngspice shortens in one deck and not in another."""
    plant = Plant(PAPER, PAPERS_DRIVE, Load(2.0), Law())
    period_map = PeriodMap(PAPERS_DRIVE.period, STEPS)
    (trace,) = period_map.traces([Copy(plant, start_point(plant).state)])
    course = trace.course
    later = replace(
        course, time=course.time[1:], states=course.states[:, 1:], normal=course.normal[:, 1:], first=course.first - 1,
        friction=course.friction[:, 1:], penetration_um=course.penetration_um[:, 1:],
    )  # fmt: skip
    alone = [derivatives([one], period_map.discretisation)[0] for one in (course, later)]
    for one, other in zip(alone, derivatives([course, later], period_map.discretisation), strict=True):
        np.testing.assert_array_equal(one.at_end, other.at_end)


def test_a_motion_so_far_from_the_contact_that_its_derivative_overflows_is_not_a_steady_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def overflowing(*arguments: Any) -> list[Derivative]:
        return [replace(found, at_end=np.full_like(found.at_end, np.nan)) for found in derivatives(*arguments)]

    monkeypatch.setattr(shooting, "derivatives", overflowing)
    point = start_point(Plant(PAPER, PAPERS_DRIVE, Load(2.0), Law()))
    Shooting([point], PeriodMap(PAPERS_DRIVE.period, STEPS)).solve()
    assert point.failed
    assert not point.done


def test_a_point_that_starts_again_takes_a_derivative_whatever_its_last_residual_was() -> None:
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    point = start_point(Plant(motor, PAPERS_DRIVE, Load(2.0), Law("spring-slider")))
    period_map = PeriodMap(PAPERS_DRIVE.period, STEPS)
    Shooting([point], period_map).solve()
    point.restart(point.state + 1e-3 * point.scale)
    assert point.at_end is None
    assert point.residual <= point.tolerance
    Shooting([point], period_map, near=True).solve()
    assert point.done


@pytest.mark.parametrize(
    "line",
    ["D1 slip 0 open", "C1 slip friction 1u", "B1 a 0 V=V(slip,mu)", "B1 a 0 V=sgn(V(slip))", "B1 a 0 V=V(slip)>0?1:2",
     "B1 a 0 V=time", "V1 a 0 SIN(0 1 1k)", "B1 friction a V=1", "B1 0 a V=1", "B1 mu 0 V=1", "B1 in 0 V=1",
     "B1 tanh 0 V=1", "B1 A 0 V=1", "R1 1 0 1", "C1 slider 0 1u", "B1 slider 0 I=3*V(slider)",
     "Xa x y vx vy a b 0 c d e f g piezomotor_normal radius={2*radius}"],
)  # fmt: skip
def test_a_statement_that_is_not_translated_makes_a_law_one_of_copies(line: str) -> None:
    known = contact_library(Law(), PAPER.contact)
    assert evaluable(known)
    assert not evaluable(replace(known, subcircuit=known.subcircuit.replace(".ends", f"{line}\n.ends")))
    assert not differentiable(Plant(PAPER, PAPERS_DRIVE, Load(1.0), None))
