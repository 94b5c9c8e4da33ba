# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states behind drivers: against ideal voltages and settled runs."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.cli import run
from pyspice_runner.motor.drive import Load, two_phases
from pyspice_runner.run.kernel import run_bench, transient_timing
from pyspice_runner.run.point import Point
from pyspice_runner.spice.process import KeptProcesses
from pyspice_runner.steady.copies import LEAD, Copy, Plant, driven_bench
from pyspice_runner.steady.driven import _metered
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.speed_torque import held_point
from pyspice_runner.steady.steady import steady_states
from tests.motors import BEAM40, friction_torque, recommended

pytestmark = pytest.mark.xdist_group("steady states")

MOTOR = pr.load_motor("andersen2002-unintended-mode")
HELD = MOTOR.updated({"mount": None})  # on the mount it settles ten times as slowly
# a heavily damped mount, on which a motor settles as fast as at a fixed distance
MOUNTED = MOTOR.updated({"mount.damping_n_s_per_m": 500.0})
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
NETWORKS = ("none", "inductor", "llcc")
KINDS = ("linear", "half-bridge", "full-bridge", "push-pull")


def driver(kind: str, network: Any = "none", **settings: float) -> pr.Driver:
    return pr.Driver(kind=kind, network=network, **two_phases(DRIVE)).updated(settings)


@pytest.mark.parametrize("speed", [6.0, pytest.param(None, marks=pytest.mark.soak)])
def test_an_ideal_driver_has_the_steady_state_of_its_voltages(speed: float | None) -> None:
    ours, plain = (pr.steady_state(HELD, one, speed=speed) for one in (driver("ideal"), DRIVE))
    assert ours.stable
    # 0.5 %: one step, where the other is extrapolated over two
    assert ours.torque_n_m == pytest.approx(plain.torque_n_m, abs=5e-3 * friction_torque(HELD))
    assert ours.speed_rad_s == pytest.approx(plain.speed_rad_s, rel=5e-3)
    for name in ("power_a_w", "current_b_rms_a", "peak_pressure_pa"):
        assert getattr(ours, name) == pytest.approx(getattr(plain, name), rel=5e-3), name
    assert abs(ours.balance_residual) < 1e-3


@pytest.mark.parametrize("kind", ["linear", pytest.param("half-bridge", marks=pytest.mark.soak)])
def test_blocks_with_meters_continue_the_motion_behind_a_driver(kind: str) -> None:
    """Of a stable motion a block of ten periods has the means of one, and leaves it where it was."""
    point = Point.of(HELD, driver(kind, "inductor"), speed=6.0)
    (state,) = steady_states([point])
    assert state.behind is not None
    period = point.source.period
    blocks = PeriodMap(period, 140, uniform=point.source.uniform, lead=LEAD).of(10 * period, 1400)
    mean, after = _metered([point], {0: Copy(state.behind.plant, state.behind.state)}, blocks)[0]
    assert HELD.rotor.radius_m * mean["friction"] == pytest.approx(state.torque_n_m, abs=5e-3 * friction_torque(HELD))
    assert mean["power_a"] == pytest.approx(state.power_a_w, rel=5e-3)
    moved = np.delete((after.state - state.behind.state) / state.behind.scale, after.plant.sliders[0])
    assert moved == pytest.approx(0.0, abs=1e-2)  # but the slider, whose distance beyond its limit is one of the step


@pytest.mark.soak
def test_a_tuned_network_does_not_make_a_steady_state_unstable() -> None:
    """The charges of the plates fade within the start of a run, all but a few ten-thousandths: they count as well."""
    motor, drive = recommended(BEAM40)
    settings = {"inductance": 22e-3, "resistance": 55.4, "capacitance": 716e-12, "bleeder": 560e3}
    tuned = pr.Driver(
        kind="ideal", network="inductor", **two_phases(drive),
        settings={f"inductor.{name}": value for name, value in settings.items()},
    )  # fmt: skip
    ours, plain = (pr.steady_state(motor, source, speed=0.0) for source in (tuned, drive))
    assert ours.stable
    # 0.1 %: the network has its own losses; its own decay is faster, e^(-R T/2L) = 0.970 in a period
    assert abs(ours.floquet_multipliers[0]) == pytest.approx(abs(plain.floquet_multipliers[0]), rel=1e-3)


def test_what_fades_before_the_period_begins_is_no_unknown_where_the_contact_stays_closed() -> None:
    """With the lags of slider and stem as unknowns, Newton's method does not end here."""
    soft = pr.load_motor("bimodal40")
    coil = {"inductance": 7.03e-3, "resistance": 25.8, "capacitance": 2.2e-9, "bleeder": 180e3}
    tuned = pr.Driver(
        kind="linear", network="inductor", voltage=104.5, frequency=40.7e3, phase_deg=90.6,
        settings={f"inductor.{name}": value for name, value in coil.items()},
    )  # fmt: skip
    found = pr.steady_state(soft, tuned, speed=20.0, accuracy=1e-2)
    averaged = pr.simulate_averaged(soft, tuned, 60e-3, speed=20.0)
    assert found.stable
    assert found.separated < 1e-6
    # the accuracy asked for; the averaged motor is within 0.2 % of a closed contact
    assert found.torque_n_m == pytest.approx(averaged.curves["torque_n_m"][-1], abs=1e-2 * friction_torque(soft))


@pytest.mark.parametrize("level", [0.0, 0.5])
@pytest.mark.parametrize("phase_deg", [-90.0, 62.0, 180.0])
@pytest.mark.parametrize("kind", KINDS[1:])
def test_a_run_begins_between_the_edges_of_a_bridge(kind: str, phase_deg: float, level: float) -> None:
    settings = {"bridge.level": level} if kind == "full-bridge" else {}
    bridge = driver(kind, phase_deg=phase_deg, **settings)
    plant = Plant(HELD, pr.TwoPhaseDrive(**two_phases(bridge)), Load(6.0, 0.0), PAPER_LAW, bridge)
    dead = bridge.dead_time("a") * bridge.frequency
    turns = plant.begins + np.linspace(-dead, LEAD, 101)  # no gate is about to switch as it begins
    for ahead in (0.0, phase_deg / 360.0):
        control = np.sin(2.0 * pi * (turns + ahead))
        limits = (level, -level) if kind == "full-bridge" else (0.0,)
        for limit in limits:
            assert np.ptp(np.sign(control - limit)) == 0.0, (ahead, limit)
    for rounding in (-1e-12, 1e-12):  # opposite phases are as far from the edges
        same = driver(kind, phase_deg=phase_deg * (1.0 + rounding), **settings)
        assert Plant(HELD, plant.drive, plant.load, plant.law, same).begins == plant.begins, rounding


def both(kind: str, network: str, motor: pr.Motor) -> tuple[pr.SteadyState, dict[str, Any]]:
    """The steady state behind a driver, and what a run settles to."""
    ours = pr.steady_state(motor, driver(kind, network), speed=6.0)
    return ours, held_point(motor, driver(kind, network), speed=6.0, mode="settle", tolerance=2e-4)


@pytest.mark.soak
@pytest.mark.parametrize("motor", [HELD, MOUNTED], ids=["held", "mounted"])
@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize("kind", KINDS)
def test_behind_a_driver_a_steady_state_is_what_a_run_settles_to(kind: str, network: str, motor: pr.Motor) -> None:
    ours, settled = both(kind, network, motor)
    assert ours.stable
    assert settled["settled"]
    # required: 0.1 % of μF₀R, and what the settled run has not yet reached: its drift from block to block
    off = 1e-3 * friction_torque(motor) + abs(settled["torque_drift_n_m"])
    assert ours.torque_n_m == pytest.approx(settled["torque_n_m"], abs=off)
    for name in ("normal_force_n", "power_a_w", "power_b_w", "current_a_rms_a", "current_b_rms_a", "damping_loss_w"):
        assert getattr(ours, name) == pytest.approx(settled[name], rel=1e-2), name  # settled means to its tolerance


@pytest.mark.soak
@pytest.mark.slow
def test_a_leakage_that_rings_with_the_groups_does_not_stop_newtons_method() -> None:
    """With 25 steps in a period of the ringing the map repeated within 6e-4, and the motor ran for some decay times."""
    motor = pr.load_motor("bimodal40")
    bridge = pr.Driver(kind="full-bridge", **two_phases(pr.default_drive(motor)))
    free = pr.steady_state(motor, bridge, load_torque=3e-3)
    assert free.method == "newton"
    assert free.stable
    assert free.load_torque_n_m == pytest.approx(3e-3, rel=1e-6)


def test_behind_a_coil_the_steps_of_many_copies_stay_uniform() -> None:
    """The rounding of 100 V, 1.4e-14 V, must not be a current above abstol, or steps fall to 1e-18 s and stay there."""
    amplifier = driver("linear", "inductor")
    plant = Plant(HELD, pr.TwoPhaseDrive(**two_phases(amplifier)), Load(6.0, 0.0), PAPER_LAW, amplifier)
    with KeptProcesses() as processes:
        period_map = PeriodMap(amplifier.period, 160, None, uniform=True, processes=processes, lead=LEAD)
        (begun,) = period_map.settled([Copy(plant, np.zeros(plant.order))], 10)
    assert begun is not None
    bench = driven_bench([Copy(plant, begun)] * 13, period_map.discretisation)
    timing = transient_timing(period_map.step, period_map.duration)
    steps = np.diff(run_bench(bench, ["v(xc0.a)"], None, "transient", timing).vectors()["time"])
    # ngspice doubles its steps from a hundredth, with one more that ends at a whole number of the first
    assert steps[12:-2] == pytest.approx(period_map.step, rel=1e-9)


def test_the_command_refuses_options_of_a_driver_without_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["steady", MOTOR.name, "--mosfet", "IRF530"]) == 2
    assert "--mosfet has no effect without --driver" in capsys.readouterr().err


def test_a_coil_in_series_makes_the_default_step_resolve_its_ringing() -> None:
    bridge = driver("half-bridge", "inductor", **{"inductor.inductance": 1e-6})
    ringing = 2.0 * pi * sqrt(1e-6 * MOTOR.piezo.capacitance_a_f)
    assert Point.of(MOTOR, bridge).step == pytest.approx(ringing / 50.0)
    usual = Point.of(MOTOR, driver("half-bridge", "inductor")).step
    assert usual == Point.of(MOTOR, driver("half-bridge")).step


def test_drivers_without_a_steady_state_by_shooting_are_refused_with_what_to_do() -> None:
    half = driver("half-bridge")
    with pytest.raises(pr.ParameterError, match="contact = None is not valid behind a driver"):
        pr.steady_state(HELD, half, speed=6.0, contact=None)
    wound = driver("half-bridge", "inductor", **{"inductor.winding_capacitance": 20e-12, "cable.inductance": 1e-6})
    # 1/(2π √(1 µH · 20 pF))
    with pytest.raises(pr.ParameterError, match=r"at 35\.59 MHz after .* Set winding_capacitance = 0"):
        pr.steady_state(HELD, wound, speed=6.0)
