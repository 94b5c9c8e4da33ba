# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampled controllers in the loop with the averaged and the full motor."""

from collections.abc import Callable, Mapping
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner import simulate_controlled
from pyspice_runner.control.loop import LoopController
from pyspice_runner.control.run import ControlledRun
from pyspice_runner.control.simulate import Sample
from tests.motors import BEAM40, recommended
from tests.runs import unestimated

DRIVE = pr.TwoPhaseDrive(voltage=150.0, frequency=54e3, phase_deg=90.0)


def speed_loop() -> Callable[[Sample], Mapping[str, float]]:
    """A proportional-integral controller of the speed, which sets the amplitude."""
    state = {"sum": 0.0}

    def step(sample: Sample) -> Mapping[str, float]:
        error = 2.0 - sample.speed_rad_s
        state["sum"] += 3.0 * error
        return {"voltage": min(max(150.0 + 10.0 * error + state["sum"], 0.0), 300.0)}

    return step


def test_a_rotor_that_bursts_has_a_caution(motor: pr.Motor) -> None:
    run = simulate_controlled(motor, DRIVE, lambda _: {}, duration=2e-3, sample_time=0.5e-3, load_torque=100.0)
    assert "the limit is 1e+05 rad/s" in " ".join(run.cautions)


class Turning:
    """A controller of the phase that also turns back every 5 ms, with an attribute of its own."""

    quantity, resolution = "phase", 12

    def set_point(self, _: float) -> float:
        return -30.0

    def __call__(self, sample: Sample) -> dict[str, float]:
        return {"phase_deg": 90.0 if sample.time_s % 10e-3 < 5e-3 else -90.0, "voltage": 5.0 * self.resolution}


def test_a_motion_that_is_commanded_and_the_noise_of_an_encoder_are_no_hunting() -> None:
    motor, drive = recommended("bimodal40")
    turning = simulate_controlled(motor, drive, Turning(), 60e-3, sample_time=0.5e-3)
    assert np.ptp(turning.position_rad[60:]) > 1e-2
    noisy = simulate_controlled(
        motor, drive, lambda _: {"voltage": 0.0}, 0.1, sample_time=1e-3, courses={"reference": [(0.0, 0.05)]},
        electronics=pr.Electronics(encoder_lines=5000, encoder_jitter_rad=1e-3),
    )  # fmt: skip
    assert not any("hunts" in caution for run in (turning, noisy) for caution in unestimated(run).cautions)


@pytest.mark.parametrize(
    ("controller", "sample_time", "message"),
    [
        ("nothing.so", 0.5e-3, "nothing.so cannot be used as a controller"),
        ("missing.so", 0.5e-3, "missing.so cannot be used as a controller"),
        (3, 0.5e-3, "controller = 3 is not valid"),
        (lambda _: {}, 1e-6, "at least one period of the drive"),
    ],
)
def test_a_controller_that_cannot_run_is_an_error(
    motor: pr.Motor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, controller: Any, sample_time: float, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("nothing.so").write_bytes(b"no library")
    with pytest.raises(pr.ParameterError, match=message):
        simulate_controlled(motor, DRIVE, controller, duration=1e-3, sample_time=sample_time)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ({"colour": 1.0}, "The controller set 'colour': it must be voltage or one of"),
        ({"voltage": float("nan")}, "voltage_a = nan: it must be"),
        ({"frequency": 1e12}, r"frequency = 1000000000000\.0: it must be"),
        (None, "it must return a mapping"),
    ],
)
def test_what_a_controller_returns_is_checked(motor: pr.Motor, returned: object, message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        simulate_controlled(motor, DRIVE, lambda _: returned, duration=1e-3, sample_time=0.5e-3)  # type: ignore[arg-type, return-value]


def test_an_error_in_a_controller_ends_ngspice_and_is_raised(motor: pr.Motor) -> None:
    def fails(sample: Sample) -> Mapping[str, float]:
        raise RuntimeError(f"sensor lost at {sample.time_s:g} s")

    with pytest.raises(RuntimeError, match=r"sensor lost at 0\.0005 s"):
        simulate_controlled(motor, DRIVE, fails, duration=1e-3, sample_time=0.5e-3)


@pytest.mark.soak
def test_a_load_step_brakes_the_averaged_motor_as_the_full_one() -> None:
    """Held at its voltage, beam40 loses speed; every sample within 3 % of the greatest."""
    motor = pr.load_motor(BEAM40)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 69.0})
    step = {"load_torque": [(2e-3, 0.0), (2.1e-3, 6e-3)]}
    compiled, spice, full = (
        simulate_controlled(motor, drive, lambda _: {}, duration=4e-3, sample_time=0.5e-3, courses=step, **how)
        for how in ({}, {"engine": "spice"}, {"averaged": False})
    )
    assert compiled.speed_rad_s.max() > compiled.speed_rad_s[-1] + 0.2
    assert full.load_torque_n_m[[0, -1]] == pytest.approx([0.0, 6e-3])
    for averaged in (compiled, spice):
        for name in ("speed_rad_s", "position_rad", "current_amplitude_a"):
            ours, theirs = averaged.samples[name], full.samples[name]
            assert np.abs(ours - theirs).max() <= 0.03 * theirs.max()
    # the mean of 20 periods of the full motor against the averages, at the start beside a step of the voltage
    for run in (compiled, spice):
        assert run.electrical_power_w[2:] == pytest.approx(full.electrical_power_w[2:], rel=0.03)
    assert compiled.heat_w[2:] == pytest.approx(spice.heat_w[2:], rel=0.01)
    assert compiled.summary()["electrical power"] == f"{compiled.electrical_power_w[-1]:.4g} W"
    assert not {"check", "heat_w"} & full.samples.keys()


def test_the_power_and_heat_of_a_controlled_run_are_those_of_its_steady_state() -> None:
    """The averaged motor at rest in its loop draws what a run without a controller draws."""
    motor = pr.load_motor(BEAM40)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 69.0})
    run = simulate_controlled(motor, drive, lambda _: {}, duration=2e-3, sample_time=0.5e-3, start="steady")
    settled = pr.simulate_averaged(motor, drive, 0.5)
    assert run.electrical_power_w == pytest.approx(settled.electrical_power_w[-1], rel=1e-5)
    assert run.heat_w == pytest.approx(settled.heat_w[-1], rel=1e-5)


def test_a_run_starts_at_the_steady_state(motor: pr.Motor, monkeypatch: pytest.MonkeyPatch) -> None:
    run = simulate_controlled(motor, DRIVE, lambda _: {}, duration=2e-3, sample_time=0.5e-3, start="steady")
    settled = pr.simulate_averaged(motor, DRIVE, 0.5)
    assert run.speed_rad_s == pytest.approx(settled.rotor_speed_rad_s[-1], rel=1e-4)
    assert run.position_rad == pytest.approx(run.speed_rad_s * run.time_s, rel=1e-6)
    undamped = motor.updated({"rotor.bearing_damping_n_m_s": 0.0})
    monkeypatch.setattr("pyspice_runner.averaged.core.PATIENCE", 0.2)
    with pytest.raises(pr.SimulationError, match="does not settle"):
        simulate_controlled(
            undamped, DRIVE, lambda _: {}, duration=2e-3, sample_time=0.5e-3, start="steady", load_torque=100.0
        )


def test_a_load_that_rattles_does_not_settle(motor: pr.Motor, monkeypatch: pytest.MonkeyPatch) -> None:
    """An elastic shaft with play and no damping; it would be followed for days."""
    monkeypatch.setattr("pyspice_runner.averaged.core.PATIENCE", 0.2)
    load = pr.ShaftLoad(
        inertia_kg_m2=5e-6, coupling_stiffness_n_m_per_rad=50.0, backlash_rad=1e-3, gravity_n_m=1e-4
    )  # fmt: skip
    with pytest.raises(pr.SimulationError, match="does not settle"):
        simulate_controlled(motor, DRIVE, lambda _: {}, 2e-3, sample_time=0.5e-3, start="steady", shaft=load)


def test_a_run_that_ngspice_cannot_follow_is_saved_without_a_netlist(motor: pr.Motor, tmp_path: Path) -> None:
    preload = motor.contact.preload_n
    courses = {"preload": [(0.0, preload), (1e-3, 1.1 * preload)]}
    run = simulate_controlled(motor, DRIVE, lambda _: {}, 2e-3, sample_time=0.5e-3, courses=courses)
    for one in (run, pr.simulate_averaged(motor, DRIVE, 2e-3, courses=courses)):
        assert one.deck is None
        assert one.save(tmp_path / "run.csv").exists()


def test_the_error_of_the_averaged_motor_is_in_the_result() -> None:
    """At 150 V the contact opens. From 60 V there is no estimate: at low speeds the motion is unstable."""
    motor = pr.load_motor(BEAM40)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 100.0})
    quarter = 10.0 * drive.period

    def louder(sample: pr.Sample) -> dict[str, float]:
        return {"voltage": 150.0 if sample.time_s > 3.5 * quarter else 100.0}

    averaged, full = (
        simulate_controlled(motor, drive, louder, duration=16.0 * quarter, sample_time=quarter, averaged=averaged)
        for averaged in (True, False)
    )
    found = averaged.to_dict()
    assert found["greatest_separated"] > 0.0
    assert found["trusted"]
    assert averaged.cautions == ()
    error = float(np.sqrt(np.mean((averaged.speed_rad_s - full.speed_rad_s) ** 2)) / np.abs(full.speed_rad_s).max())
    assert error <= found["error_estimate"]["shares"]["rotor_speed_rad_s"] <= 10.0 * error
    assert full.trusted
    assert not full.error_estimate.shares


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": "steady", "engine": "spice"}, "only the compiled averaged motor starts at a steady state"),
        ({"start": "steady", "averaged": False}, "only the compiled averaged motor starts at a steady state"),
        ({"step": 1e-7}, "step has no effect on an averaged run"),
        ({"courses": {"voltage": [(0.0, 1.0), (1e-3, 2.0)]}}, "set voltage_a, which has a course"),
        ({"courses": {"speed": [(0.0, 1.0)]}}, "'speed' is not known"),
    ],
)
def test_settings_that_exclude_each_other_are_an_error(motor: pr.Motor, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        simulate_controlled(motor, DRIVE, speed_loop(), duration=1e-3, sample_time=0.5e-3, **changes)


def test_a_second_of_a_speed_loop_at_4_khz_takes_less_than_a_second(motor: pr.Motor) -> None:
    simulate_controlled(motor, DRIVE, speed_loop(), duration=1e-3, sample_time=0.25e-3)  # compiles the motor, once
    begun = process_time()
    run = simulate_controlled(motor, DRIVE, speed_loop(), duration=1.0, sample_time=0.25e-3, engine="compiled")
    assert process_time() - begun < 1.0
    assert run.speed_rad_s[-1] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.soak
def test_a_second_of_a_position_loop_that_hunts_at_4_khz_takes_less_than_a_second() -> None:
    flagship, drive = recommended("bimodal40")
    loop = pr.control_loop(flagship, drive, quantity="position", sample_time=0.25e-3)
    controller, begun = LoopController(loop, lambda _: 0.05), process_time()
    run = simulate_controlled(flagship, drive, controller, duration=1.0, sample_time=0.25e-3)
    assert process_time() - begun < 1.0
    assert np.ptp(run.position_rad[-400:]) > 1e-3


def test_a_run_says_what_has_settled_and_the_static_error_of_what_is_controlled(motor: pr.Motor) -> None:
    class Proportional:
        quantity = "speed"

        def __call__(self, sample: Sample) -> dict[str, float]:
            return {"voltage": 150.0 + 10.0 * (sample.reference - sample.speed_rad_s)}

    def run(duration: float, controller: object) -> ControlledRun:
        return simulate_controlled(
            motor, DRIVE, controller, duration, sample_time=0.5e-3, engine="compiled", courses={"reference": 2.0}
        )  # type: ignore[call-overload, unused-ignore]

    early, late, nameless = run(3e-3, Proportional()), run(0.3, Proportional()), run(0.3, Proportional().__call__)
    assert (early.settled, late.settled) == (False, True)
    assert early.summary()["settled"].startswith("no: speed")
    assert late.to_dict()["static_error"] == late.static_error
    # without an integral part the error is what the amplitude beyond 150 V takes
    assert late.static_error == pytest.approx((late.voltage_a_v[-1] - 150.0) / 10.0, rel=1e-6)
    assert abs(late.static_error) > 1e-3
    assert "static error" in late.summary()
    # the controller corrects the speed: its errors are those at this speed
    controlled, at_equal_commands = (one.error_estimate.shares for one in (early, run(3e-3, Proportional().__call__)))
    assert at_equal_commands.keys() - controlled.keys() == {"rotor_speed_rad_s"}
    assert controlled
    assert nameless.static_error is None
    assert nameless.settled
    Proportional.quantity = "torque"
    with pytest.raises(pr.ParameterError, match="= 'torque' is not valid: it must be one of speed, position, phase"):
        run(3e-3, Proportional())
