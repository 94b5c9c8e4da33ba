# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads on the shaft, courses, sensors and actuators of a controlled motor, averaged and full."""

from math import pi
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.control.electronics import Rounding
from pyspice_runner.control.run import ControlledRun
from tests.motors import BEAM40
from tests.selection import mostly

MOTOR = pr.load_motor(BEAM40)
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": 69.0})
INERTIA = MOTOR.rotor.inertia_kg_m2
WITHIN = 0.03  # of the greatest sample: what the averaged motor is to be worth in a loop


def run(duration: float = 3e-3, **how: Any) -> ControlledRun:
    return pr.simulate_controlled(MOTOR, DRIVE, lambda _: {}, duration, sample_time=0.5e-3, **how)


LOADS: dict[str, dict[str, Any]] = {
    "elastic shaft with play": {
        "shaft": pr.ShaftLoad(
            inertia_kg_m2=2.0 * INERTIA, coupling_stiffness_n_m_per_rad=INERTIA * (2.0 * pi * 600.0) ** 2,
            coupling_damping_n_m_s=1e-4, backlash_rad=1e-3,
        )
    },
    "weight and spring": {
        "shaft": pr.ShaftLoad(
            inertia_kg_m2=INERTIA, gravity_n_m=5e-3, gravity_angle_deg=30.0, spring_n_m_per_rad=0.1, damping_n_m_s=1e-5
        )
    },
    "preload": {"courses": {"preload": [(1e-3, 6.5), (1.5e-3, 8.0)]}},
    "temperature": {
        "thermal": pr.Thermal(heat_capacity_j_per_k=1e-6), "courses": {"temperature": [(1e-3, 0.0), (1.5e-3, 40.0)]}
    },
    "voltage, frequency and phase": {
        "courses": {
            "voltage": lambda time: 60.0 + 5e3 * time, "phase_deg": lambda time: 120.0 - 1e4 * time,
            "frequency": [(1e-3, 40.1e3), (1.5e-3, 40.3e3)],
        }
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def unloaded() -> ControlledRun:
    return run(4e-3)


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, LOADS, ["preload"]))
def test_loads_and_courses_act_on_the_averaged_motor_as_on_the_full_one(name: str, unloaded: ControlledRun) -> None:
    """Within 3 % of the motor without them, or of the loaded one if that is faster."""
    averaged, full = (run(4e-3, **LOADS[name], averaged=averaged) for averaged in (True, False))
    for quantity in ("speed_rad_s", "load_position_rad", "current_b_amplitude_a", "voltage_b_amplitude_v"):
        ours, theirs = averaged.samples[quantity], full.samples[quantity]
        greatest = max(np.abs(theirs).max(), np.abs(unloaded.samples[quantity]).max())
        assert np.abs(ours - theirs).max() <= WITHIN * greatest, quantity
        if quantity == "speed_rad_s":  # the effect is far larger than that
            assert np.abs(ours - unloaded.samples[quantity]).max() > 2.0 * WITHIN * greatest


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.soak) for name in LOADS if name != "preload"])
def test_loads_and_courses_act_in_ngspice_as_in_the_compiled_motor(name: str) -> None:
    """Play makes ngspice's longer steps less accurate: 12 % of the greatest speed at one sample."""
    ours, theirs = (run(4e-3, **LOADS[name], engine=engine).speed_rad_s for engine in ("compiled", "spice"))
    assert np.abs(ours - theirs).max() <= (0.15 if "play" in name else WITHIN) * np.abs(theirs).max()


def test_a_rigid_mass_is_a_heavier_rotor() -> None:
    coupled = run(4e-3, shaft=pr.ShaftLoad(inertia_kg_m2=INERTIA))
    heavier = MOTOR.updated({"rotor.inertia_kg_m2": 2.0 * INERTIA})
    alone = pr.simulate_controlled(heavier, DRIVE, lambda _: {}, 4e-3, sample_time=0.5e-3)
    assert coupled.position_rad == pytest.approx(alone.position_rad, rel=1e-9)
    assert coupled.load_position_rad == pytest.approx(coupled.position_rad)


def test_a_torque_winds_an_elastic_shaft_by_its_stiffness_behind_the_play() -> None:
    """A load without a motor: the shaft is wound by the torque over its stiffness, and half of the play."""
    stiffness, torque, play = 0.05, 2e-3, 2e-3
    shaft = pr.ShaftLoad(
        inertia_kg_m2=INERTIA, damping_n_m_s=1e-3, spring_n_m_per_rad=0.2, coupling_stiffness_n_m_per_rad=stiffness,
        coupling_damping_n_m_s=1e-3, backlash_rad=play,
    )  # fmt: skip
    free = MOTOR.updated({"contact.friction": 1e-4, "rotor.bearing_damping_n_m_s": 1e-3})
    still = DRIVE.model_copy(update={"voltage": 0.0})
    held = pr.simulate_controlled(free, still, lambda _: {}, 0.8, sample_time=1e-2, shaft=shaft, load_torque=torque)
    moved = abs(held.load_position_rad[-1])
    drawn = torque - 1e-4 * MOTOR.contact.preload_n * MOTOR.rotor.radius_m  # N·m; the contact holds the rest
    assert moved == pytest.approx(drawn / 0.2, rel=1e-4)
    assert abs(held.position_rad[-1]) - moved == pytest.approx(drawn / stiffness + 0.5 * play, rel=1e-4)


PARTS = pr.Electronics(
    encoder_lines=1000, current_bits=12, current_range_a=0.05, voltage_bits=10, voltage_range_v=200.0,
    amplitude_bits=8, amplitude_range_v=128.0, timer_hz=64e6, delay_s=0.1e-3,
)  # fmt: skip


def test_what_is_measured_and_set_are_whole_steps_of_sensors_and_actuators() -> None:
    """The command of 66.4 V becomes the step of 1 V at 66 V, 40.123 kHz the nearest whole period of the clock."""
    command = {"voltage": 66.4, "frequency": 40.123e3, "phase_deg": 100.0}
    found = pr.simulate_controlled(MOTOR, DRIVE, lambda _: command, 3e-3, sample_time=0.5e-3, electronics=PARTS)
    steps = found.to_dict()["run"]["resolution"]
    for name, step in (
        ("position_rad", "position_rad"),
        ("speed_rad_s", "speed_rad_s"),
        ("voltage_a_v", "amplitude_v"),
    ):
        counts = found.samples[name] / steps[step]
        assert counts == pytest.approx(np.round(counts), abs=1e-6)
    assert steps["position_rad"] == pytest.approx(2.0 * pi / 4000.0)
    assert found.voltage_a_v[-1] == 66.0
    ticks = round(64e6 / 40.123e3)
    assert found.frequency_hz[-1] == pytest.approx(64e6 / ticks, rel=1e-12)
    assert found.phase_deg[-1] == pytest.approx(360.0 * round(100.0 / 360.0 * ticks) / ticks)
    assert abs(found.phase_deg[-1] - 100.0) <= 0.5 * steps["phase_deg"]


def test_commands_act_after_the_computing_delay() -> None:
    """The mean of the voltage since the last sample has the former command for a fifth of the time."""
    late = pr.Electronics(delay_s=0.1e-3)
    for averaged in (True, False):
        found = pr.simulate_controlled(
            MOTOR, DRIVE, lambda _: {"voltage": 50.0}, 1.5e-3, sample_time=0.5e-3, electronics=late, averaged=averaged
        )
        expected = [69.0, 0.2 * 69.0 + 0.8 * 50.0, 50.0]
        # a period of the beat of the full motor's mean: 1/(2 pi 40 kHz 0.5 ms), 0.8 %
        assert found.voltage_amplitude_v == pytest.approx(expected, rel=1e-6 if averaged else 0.01)


def test_noise_has_its_rms_value_and_a_run_its_seed() -> None:
    noisy = pr.Electronics(current_noise_a=1e-4, encoder_jitter_rad=1e-5)
    rounding = Rounding(noisy)
    currents = np.array([rounding.current(0.01 + 0j) for _ in range(4000)])
    for part in (currents.real - 0.01, currents.imag):  # 4 standard errors of an rms value of 4000 numbers
        assert np.std(part) == pytest.approx(1e-4, rel=4.0 / np.sqrt(2.0 * 4000.0))
    first, again = (run(electronics=noisy) for _ in range(2))
    assert first.current_amplitude_a == pytest.approx(again.current_amplitude_a, abs=0.0)


def test_the_controller_reads_the_course_of_the_reference() -> None:
    seen = []
    pr.simulate_controlled(
        MOTOR, DRIVE, lambda sample: seen.append(sample.reference) or {}, 2e-3, sample_time=0.5e-3,
        courses={"reference": [(0.0, 1.0), (1e-3, 3.0)]},
    )  # type: ignore[func-returns-value]  # fmt: skip
    assert seen == pytest.approx([2.0, 3.0, 3.0, 3.0])


@pytest.mark.parametrize("engine", mostly(pytest.mark.soak, ["compiled", "spice"], ["compiled"]))
def test_records_between_samples_meet_the_samples(engine: str) -> None:
    found = run(1e-3, records=5, engine=engine)
    assert found.records["time_s"] == pytest.approx(1e-4 * np.arange(1, 11))
    assert found.records["position_rad"][4::5] == pytest.approx(found.position_rad, abs=1e-12)
    assert found.records["speed_rad_s"].reshape(2, 5).mean(axis=1) == pytest.approx(found.speed_rad_s, abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"electronics": pr.Electronics(delay_s=0.5e-3)}, "delay_s = 0.0005 s is not valid: it must be below"),
        ({"electronics": pr.Electronics(timer_hz=1e5)}, "timer_hz = 100000 Hz is not valid: it must be at least ten"),
        ({"records": 0}, "records = 0 is not valid"),
        ({"courses": {"temperature": [(0.0, 0.0), (1.0, 1.0)]}}, "temperature takes thermal"),
        ({"courses": {"preload": [(0.0, 5.0), (1.0, 6.0)]}}, "preload begins at 5 N: it must begin at"),
        ({"courses": {"preload": [(0.0, 6.5), (1.0, 7.0)]}, "engine": "spice"}, "preload cannot change"),
        ({"courses": {"voltage": lambda _: "loud"}}, "voltage_a must be 1 to"),
    ],
)  # fmt: skip
def test_loads_courses_and_electronics_out_of_range_are_an_error(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        run(**changes)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"spring_n_m_per_rad": 1.0}, "the load needs a mass"),
        ({"inertia_kg_m2": 1e-6, "backlash_rad": 0.1}, "no effect on a rigid coupling"),
        ({"inertia_kg_m2": -1.0}, "inertia_kg_m2"),
    ],
)
def test_a_load_that_has_no_mass_or_a_useless_value_is_an_error(values: dict[str, float], message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        pr.ShaftLoad(**values)
