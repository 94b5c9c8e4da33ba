# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states by shooting: against closed forms, settled runs and the decay of disturbances."""

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.cli import run
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.drive import Load
from pyspice_runner.run.dynamometer import STUCK, UNITS
from pyspice_runner.run.point import Point
from pyspice_runner.steady.copies import Copy
from pyspice_runner.steady.period_map import PeriodMap, Trace
from pyspice_runner.steady.shooting import NEWTON
from pyspice_runner.steady.speed_torque import held_point
from pyspice_runner.steady.steady import SteadyState, steady_states
from tests.motors import BEAM40, friction_torque, recommended
from tests.said import refusal
from validation.steady_states import staying

SOFT_COMPLIANCES = Path(__file__).parents[1] / "data" / "soft_compliances.json"

pytestmark = pytest.mark.xdist_group("steady states")  # they are shared

PAPER = pr.load_motor("andersen2002")
MOTOR = pr.load_motor("andersen2002-unintended-mode")
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)


@cache
def held(speed: float) -> SteadyState:
    return pr.steady_state(MOTOR, DRIVE, speed=speed)


def test_the_quantities_are_attributes_with_unit_and_meaning() -> None:
    state = held(1.0)
    assert set(UNITS) <= set(dir(state))
    assert set(UNITS) <= set(SteadyState.__annotations__) | set(SteadyState.__mro__[1].__annotations__)
    assert state.quantities == {name: getattr(state, name) for name in UNITS}
    assert UNITS["torque_n_m"] == ("N·m", "mean torque of the contact on the rotor")
    with pytest.raises(AttributeError, match=r"SteadyState has no attribute 'torque'\. Did you mean 'torque_n_m'"):
        state.torque  # type: ignore[attr-defined]  # noqa: B018


def test_multipliers_of_a_free_linear_stator_are_those_of_its_equation_of_motion() -> None:
    state = pr.steady_state(MOTOR, DRIVE, contact=None, speed=0.0)
    assert state.converged
    assert state.stable
    assert state.waveforms is not None
    exact = []
    for mode in MOTOR.modes:
        poles = np.roots([mode.mass_kg, mode.damping_n_s_per_m, mode.stiffness_n_per_m])
        exact += np.exp(poles / DRIVE.frequency).tolist()
    ours = sorted(state.floquet_multipliers, key=lambda value: (-abs(value), value.imag))
    theirs = sorted(exact, key=lambda value: (-abs(value), value.imag))
    assert np.abs(np.array(ours) - np.array(theirs)).max() < 1e-4  # required; measured 1e-6
    # and its amplitude is that of the transfer function of each mode
    for index, mode in enumerate(MOTOR.modes):
        omega = 2.0 * np.pi * DRIVE.frequency
        force = (mode.coupling_a_n_per_v - mode.coupling_b_n_per_v) * DRIVE.voltage
        stiffness = mode.stiffness_n_per_m - omega**2 * mode.mass_kg + 1j * omega * mode.damping_n_s_per_m
        if mode.tip_x:
            swing = np.abs(state.waveforms.tip_x_m).max()
            # second order: (2π/69)²/12 of the frequency ratio's effect, at 138 steps a period
            assert swing == pytest.approx(abs(mode.tip_x * force / stiffness), rel=2e-3), index


def test_a_slider_that_slips_as_a_run_begins_leaves_no_trace_in_the_result() -> None:
    # the contact slips one way for almost all of the period, so that speed changes neither mean normal force nor decay
    setup = [
        Point(MOTOR.updated({"mount": None}), DriveSource(DRIVE), Load(speed, 0.0)) for speed in np.linspace(-10, 8, 10)
    ]
    states = steady_states(setup)
    assert all(state.stable for state in states)
    forces = np.array([state.normal_force_n for state in states])
    assert np.ptp(forces) < 1e-4 * forces.mean()
    largest = np.array([abs(state.floquet_multipliers[0]) for state in states])
    assert np.ptp(largest) < 1e-4


@pytest.mark.parametrize("law", ["coulomb", pytest.param("brush", marks=pytest.mark.soak)])
def test_every_contact_law_has_a_steady_state(law: Any) -> None:
    law = pr.Law(law, 3 if law == "brush" else None)
    motor = MOTOR.updated({"mount": None})  # on the mount it settles ten times as slowly
    state = pr.steady_state(motor, DRIVE, speed=6.0, contact=law)
    assert state.converged
    assert state.stable
    assert abs(state.balance_residual) < 1e-4
    settled = held_point(motor, DRIVE, speed=6.0, mode="settle", contact=law)
    assert state.torque_n_m == pytest.approx(settled["torque_n_m"], abs=5e-3 * friction_torque(MOTOR))


def test_a_free_rotor_runs_where_the_curve_of_held_ones_crosses_the_load() -> None:
    load = 5e-3
    free = pr.steady_state(MOTOR, DRIVE, load_torque=load)
    assert free.converged
    assert free.stable
    assert free.load_torque_n_m == pytest.approx(load, rel=1e-3)
    low, high = (held(speed) for speed in (16.0, 16.1))  # the curve has a bend at 16.13 rad/s, and is straight here
    crossing = np.interp(-load, [-low.load_torque_n_m, -high.load_torque_n_m], [16.0, 16.1])
    # required; measured 0.06 %, because the free rotor swings a little in each period
    assert free.speed_rad_s == pytest.approx(float(crossing), rel=1e-3)


def test_a_load_that_bursts_the_rotor_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    said = refusal(["steady", "andersen2002", "--load", "100"], capsys)
    assert "load_torque = 100 N·m is not valid: the contact gives 0.015 N·m, and the load drives the shaft." in said
    # the closed form of a rotor that slips: (μ F₀ R − load) / damping of the bearing; at most 1 km/s over the radius
    speed = (friction_torque(PAPER) - 100.0) / PAPER.rotor.bearing_damping_n_m_s
    assert f"The rotor moves at {speed:.4g} rad/s; the limit is 1e+05 rad/s" in said
    drive = pr.default_drive(PAPER)
    chart = pr.working_points(PAPER, drive, over={"load.torque": [0.0, 100.0]}, objective="speed")
    assert chart.allowed.values.tolist() == [True, False]


def test_a_period_of_a_steady_state_counts_as_settled() -> None:
    for state in (held(6.0), pr.steady_state(MOTOR, DRIVE)):
        waves = state.waveforms
        assert waves.settled
        assert not waves.cautions
        assert "not settled" not in str(waves.summary())


@pytest.mark.parametrize("sliders", [16, pytest.param(32, marks=[pytest.mark.slow, pytest.mark.soak])])
def test_sliders_that_slip_add_no_multipliers(sliders: int) -> None:
    motor, drive = recommended(BEAM40)
    few, many = (pr.steady_state(motor, drive, speed=45.0, contact=pr.Law("brush", count)) for count in (8, sliders))
    assert many.stable
    assert many.method == "newton"
    assert many.provenance["period_maps"] < 100  # of 38 states the sliders are perturbed once; measured 66, else 130
    # the finer row changes the contact a little
    assert np.abs(many.floquet_multipliers[:2]) == pytest.approx(np.abs(few.floquet_multipliers[:2]), rel=1e-3)
    assert many.torque_n_m == pytest.approx(few.torque_n_m, abs=0.01 * friction_torque(motor))


def linear_multipliers(motor: pr.Motor, period: float, *, turns: bool) -> np.ndarray:
    """e^(λT) of modes, carrier and rotor on the springs of a contact that sticks under the preload."""
    contact, rotor, mount = motor.contact, motor.rotor, motor.mount
    assert mount is not None
    springs = [*motor.modes, mount]
    mass = np.array([*(spring.mass_kg for spring in springs), rotor.inertia_kg_m2])
    along = np.array([*(mode.tip_x for mode in motor.modes), 0.0, -rotor.radius_m])
    towards = np.array([*(mode.tip_y for mode in motor.modes), 1.0, 0.0])
    stiffness = np.diag([*(spring.stiffness_n_per_m for spring in springs), 0.0])
    stiffness += contact_law.tangential_stiffness_at_preload(contact) * np.outer(along, along)
    stiffness += contact_law.normal_stiffness_at_preload(contact) * np.outer(towards, towards)
    damping = np.diag([*(spring.damping_n_s_per_m for spring in springs), rotor.bearing_damping_n_m_s])
    damping += contact_law.normal_damping(contact) * contact.preload_n * np.outer(towards, towards)
    count = len(mass) - (not turns)
    rates = [-(matrix / mass[:, np.newaxis])[:count, :count] for matrix in (stiffness, damping)]
    system = np.block([[np.zeros((count, count)), np.eye(count)], rates])
    return np.exp(np.linalg.eigvals(system) * period)


@pytest.mark.parametrize("name", pr.available_motors())
def test_a_set_has_no_caution_at_its_recommended_drive(name: str) -> None:
    assert pr.steady_state(*recommended(name)).cautions == ()


@pytest.mark.parametrize("name", ["andersen2002", BEAM40])
@pytest.mark.parametrize("speed", [0.0, None])
def test_a_row_of_sliders_that_stick_has_the_multipliers_of_one_spring(name: str, speed: float | None) -> None:
    motor = pr.load_motor(name)
    drive = pr.default_drive(motor).updated({"voltage": 0.1})
    state = pr.steady_state(motor, drive, speed=speed, contact=pr.Law("brush", 16))
    assert state.stable
    assert state.method in ("newton", "damped")
    exact = linear_multipliers(motor, drive.period, turns=speed is None)
    found, others = np.split(state.floquet_multipliers, [len(exact)])
    # second order: the trapezoidal rule delays the stiffness of the contact by (2π/71)²/12 of an angle of 2π at most,
    # 4e-3; measured 6e-4
    assert max(np.abs(found - one).min() for one in exact) < 2e-3
    assert np.abs(found) == pytest.approx(np.sort(np.abs(exact))[::-1], abs=2e-4)
    assert np.abs(others).max(initial=0.0) < NEWTON.memory  # sliders at the edge, which slip


def test_one_period_of_waveforms_closes_and_balances() -> None:
    waves = held(6.0).waveforms
    assert waves.time_s[-1] - waves.time_s[0] == pytest.approx(1.0 / DRIVE.frequency)
    for name in ("tip_x_m", "tip_y_m", "normal_force_n", "friction_force_n", "current_a_a"):
        signal = getattr(waves, name)
        assert signal[-1] == pytest.approx(signal[0], abs=1e-3 * np.ptp(signal)), name
    assert waves.energy_residual < 1e-3
    assert waves.mean_torque_n_m == pytest.approx(held(6.0).torque_n_m, abs=2e-3 * friction_torque(MOTOR))
    assert isinstance(waves.to_dict()["cautions"], list)


def test_tones_without_a_common_period_are_refused_with_what_to_do() -> None:
    beating = pr.TwoToneDrive(voltage_1=60.0, frequency_1=45e3, voltage_2=60.0, frequency_2=45.21e3)
    with pytest.raises(pr.ParameterError, match=r"no short common period.*settle"):
        pr.steady_state(MOTOR, beating, speed=0.0)


def test_dry_friction_of_the_bearing_takes_its_torque_from_a_held_shaft() -> None:
    dry = MOTOR.updated({"rotor.bearing_friction_n_m": 1e-3})
    state = pr.steady_state(dry, DRIVE, speed=6.0)
    assert state.torque_n_m == pytest.approx(held(6.0).torque_n_m, rel=1e-6)
    assert state.load_torque_n_m == pytest.approx(held(6.0).load_torque_n_m - 1e-3, rel=1e-6)
    assert state.waveforms.energy_residual < 1e-3
    with pytest.raises(pr.ParameterError, match="dry friction is not found by shooting"):
        pr.steady_state(dry, DRIVE)


def test_the_command_prints_the_state_and_writes_its_period(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["steady", MOTOR.name, "--voltage", "100", "--frequency", "46e3", "--phase", "180", "--speed", "6"]
    assert run([*words, "--json", "--output", str(tmp_path / "period.cir")]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["converged"] is True
    assert document["stable"] is True
    assert document["torque_n_m"] == pytest.approx(held(6.0).torque_n_m, rel=1e-6)
    assert {"iterations", "residual", "method", "floquet_multipliers", "normal_force_n"} <= set(document)
    assert ".tran" in (tmp_path / "period.cir").read_text(encoding="utf-8")


@pytest.mark.soak
def test_a_contact_that_sticks_at_a_standstill_has_no_unique_torque_and_every_result_says_so() -> None:
    motor = pr.load_motor("andersen2002")
    weak = pr.default_drive(motor).updated({"voltage": 2.0})
    held = pr.steady_state(motor, weak, speed=0.0)
    assert (held.stick, held.stable) == (1.0, True)
    free = pr.steady_state(motor, weak)
    curve, table = (
        pr.speed_torque(motor, weak, speeds=[0.0]),
        pr.working_points(motor, weak, over={"drive.voltage": [2.0]}, speed=0.0),
    )
    point = held_point(motor, weak)
    averaged = pr.simulate_averaged(motor, weak, 2e-3, speed=0.0)
    for cautions in (held.cautions, curve.cautions, table.cautions, averaged.cautions, point["cautions"]):
        assert any(text.startswith(STUCK) for text in cautions)
    regularised = pr.steady_state(motor, weak, speed=0.0, contact="coulomb")
    assert STUCK not in (*free.cautions, *regularised.cautions, *pr.steady_state(motor, weak, speed=1.0).cautions)


@pytest.mark.parametrize(
    ("name", "volts", "frequency"),
    [
        pytest.param("andersen2002", 6.0, 51.7e3, marks=pytest.mark.soak),
        ("andersen2002", 10.0, 51.7e3),
        ("bimodal40", 3.0, 40.7e3),
    ],
)
def test_a_held_shaft_whose_contact_does_not_slip_has_an_interval_of_torques_about_that_of_a_run_from_rest(
    name: str, volts: float, frequency: float
) -> None:
    """At 10 V the contact of the paper's motor reaches its limit of stick for one step only.

    The path of the flagship's tip encloses an area, by which the contact creeps along the rotor while it sticks: in the
    duration of the run by 5e-3 of the limit at 10 V, and with the square of the voltage.
    """
    motor = pr.load_motor(name)
    drive = pr.TwoPhaseDrive(voltage=volts, frequency=frequency, phase_deg=90.0)
    state = pr.steady_state(motor, drive, speed=0.0)
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    assert not state.determined
    assert state.torque_min_n_m < -0.1 * limit < 0.1 * limit < state.torque_max_n_m
    settled = pr.simulate(motor, drive, duration=2.0 * motor.decay_s, speed=0.0, step=state.step_s)
    # 2e-4 of the preload by the search, 1e-3 of the torque by the run's last disturbance
    assert state.torque_n_m == pytest.approx(settled.mean_torque_n_m, abs=3e-3 * limit)


@pytest.mark.parametrize(("law", "share"), [("spring-slider", 0.7), ("brush", 0.95)])
def test_the_torques_that_friction_holds_end_within_those_of_a_shaft_that_creeps(law: str, share: float) -> None:
    """A shaft that creeps slips once in a period, which is the limit; its spring softens."""
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=10.0, frequency=51.7e3, phase_deg=90.0)
    state = pr.steady_state(motor, drive, speed=0.0, contact=law)
    ends = [pr.steady_state(motor, drive, speed=speed, contact=law).torque_n_m for speed in (0.02, -0.02)]
    assert share * ends[0] > state.torque_min_n_m > ends[0]
    assert share * ends[1] < state.torque_max_n_m < ends[1]


@pytest.mark.soak
def test_a_shaft_that_turns_slowly_has_no_steady_state_that_sticks() -> None:
    """In a period the shaft turns by 2 nrad, but it does not stop until the contact slips."""
    motor = pr.load_motor("andersen2002")
    found = pr.steady_state(motor, pr.default_drive(motor).updated({"voltage": 2.0}), speed=1e-4)
    assert not found.converged or found.slip > 0.0


@pytest.mark.parametrize("speed", [1e-3, -1e-3])
def test_sliders_that_a_slow_shaft_drags_begin_at_their_limits(speed: float) -> None:
    """From where the row of sliders sticks it is not found: the shaft turns by 20 nrad in a period.

    ``simulate`` over 60 ms, 28 s of ngspice, gives 0.8294 and 0.8296 of the friction torque, and 0.8269 after 20 ms.
    """
    motor = pr.load_motor("andersen2002")
    found = pr.steady_state(motor, pr.default_drive(motor).updated({"voltage": 1.0}), speed=speed, contact="brush")
    friction = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    assert found.torque_n_m / friction == pytest.approx(-0.8295 if speed > 0.0 else 0.8295, abs=5e-4)


@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "voltage", "speed"),
    [
        (BEAM40, 110.0, 20.0),
        (BEAM40, 110.0, 50.0),
        ("andersen2002-unintended-mode", 60.0, 5.0),
        ("andersen2002-unintended-mode", 100.0, 0.0),
        (str(Path(__file__).parents[2] / "examples" / "plate40.toml"), 100.0, 0.0),
        (str(Path(__file__).parents[2] / "examples" / "plate40.toml"), 100.0, 0.1),
    ],
)
def test_the_estimated_error_of_the_torque_holds_where_the_contact_opens(
    name: str, voltage: float, speed: float
) -> None:
    """Against a step of 25 ns, whose own error is a few times smaller."""
    motor = pr.load_motor(name)
    drive = pr.default_drive(motor).updated({"voltage": voltage})
    state, fine = (pr.steady_state(motor, drive, speed=speed, step=step) for step in (None, 2.5e-8))
    assert state.separated > 0.1
    assert abs(state.torque_n_m - fine.torque_n_m) < state.torque_error_n_m + fine.torque_error_n_m


@pytest.mark.parametrize(
    "one",
    [
        pytest.param(one, id=one["case"], marks=[pytest.mark.soak] * (one["case"] in ("40", "92")))
        for one in json.loads(SOFT_COMPLIANCES.read_text(encoding="utf-8"))
    ],
)
def test_a_motor_with_a_soft_compliance_in_series_has_a_steady_state(one: dict[str, Any], tmp_path: Path) -> None:
    """Random motors of which ngspice ended a run, or shortened its steps.

    Causes were a first iteration from no force (214), tolerances below rounding (180, 159, 40), and the control of the
    truncation error where the lags come to rest (92).
    """
    file = tmp_path / "motor.toml"
    file.write_text(one["motor"], encoding="utf-8")
    motor, drive = pr.load_motor(file), getattr(pr, one["kind"])(**one["drive"])
    found = pr.steady_state(motor, drive, contact=one["contact"], speed=one["speed"], audit=False)
    assert found.method == "newton"
    assert staying(found, periods=4) == "stays"


def test_a_finer_step_that_fails_leaves_the_answer_of_the_step_before(monkeypatch: pytest.MonkeyPatch) -> None:
    motor = pr.load_motor("andersen2002-unintended-mode").updated({"mount": None})
    drive = pr.default_drive(motor)
    usual, traces = pr.steady_state(motor, drive, speed=1.0), PeriodMap.traces

    def failing(self: PeriodMap, copies: Sequence[Copy], after: int = 0) -> list[Trace | None]:
        return [None] * len(copies) if self.step < 0.9 * usual.step_s else traces(self, copies, after)

    monkeypatch.setattr(PeriodMap, "traces", failing)
    found = pr.steady_state(motor, drive, speed=1.0, accuracy=1e-6)  # which the usual step does not reach
    assert found.converged
    assert (found.torque_n_m, found.torque_error_n_m) == (usual.torque_n_m, usual.torque_error_n_m)
