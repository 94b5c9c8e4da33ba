# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor behind the network of a driver: an inductor or an LLCC filter on complex amplitudes."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run as command
from pyspice_runner.spice import Engine
from tests.motors import BEAM40, recommended

ENGINES: tuple[Engine, ...] = ("compiled", "spice")
MOTOR, DRIVE = recommended(BEAM40)
OMEGA, CLAMPED = 2.0 * np.pi * DRIVE.frequency, MOTOR.piezo.capacitance_a_f


def behind(network: str, voltage: float, **values: float) -> pr.Driver:
    settings = {f"{network}.{name}": value for name, value in values.items()}
    return pr.Driver(
        kind="ideal", network=network, voltage=voltage, frequency=DRIVE.frequency, phase_deg=DRIVE.phase_deg,
        settings=settings,
    )  # fmt: skip


def resonant(frequency: float, voltage: float, resistance: float) -> pr.Driver:
    """A driver whose inductor resonates with the clamped capacitance at a frequency."""
    return behind(
        "inductor", voltage, inductance=1.0 / ((2.0 * np.pi * frequency) ** 2 * CLAMPED), resistance=resistance
    )


def llcc(parallel: float = 1e-9) -> pr.Driver:
    return behind(
        "llcc", DRIVE.voltage,
        series_inductance=5e-3, series_capacitance=1.0 / (OMEGA**2 * 5e-3), series_resistance=20.0,
        parallel_capacitance=parallel, parallel_inductance=1.0 / (OMEGA**2 * (parallel + CLAMPED)),
        parallel_resistance=20.0,
    )  # fmt: skip


INDUCTOR = behind("inductor", 55.0, inductance=12e-3, resistance=60.0)
ADDED = {"cable.capacitance": 2e-10, "cable.inductance": 5e-7}  # 2 m of RG 174


def test_a_step_of_the_stage_at_a_motor_that_does_not_move_is_that_of_the_circuit() -> None:
    """The circuit L, R, C0 on complex amplitudes by its eigenvalues; a beat of 1 kHz with the drive, decay in 0.4 ms.

    Its fast part, at twice the drive's frequency, is a hundredth of the amplitude; long steps damp it.
    """
    still = MOTOR.updated({f"modes.{mode}.coupling_{group}_n_per_v": 1e-9 for mode in (0, 1) for group in "ab"})
    driver = resonant(DRIVE.frequency + 1e3, 10.0, 200.0)
    run = pr.simulate_averaged(still, driver, 4e-3)
    inductance, resistance = driver.setting("inductor.inductance"), driver.setting("inductor.resistance")
    loss = MOTOR.piezo.loss_tangent
    admittance = OMEGA * CLAMPED * (1e5 / DRIVE.frequency) ** (2.0 / np.pi * np.arctan(loss)) * (1j + loss)
    rates, turns = np.linalg.eig(
        np.array([[-resistance / inductance - 1j * OMEGA, -1.0 / inductance], [1.0 / CLAMPED, -admittance / CLAMPED]])
    )
    steady = 10.0 * np.array([admittance, 1.0]) / (1.0 + admittance * (resistance + 1j * OMEGA * inductance))
    parts = np.linalg.solve(turns, -steady)
    course = steady[1] + (turns[1] * parts) @ np.exp(np.outer(rates, run.time_s))
    error = np.abs(run.amplitude_a_v - np.abs(course)) / abs(steady[1])
    assert error.max() < 0.05
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert run.amplitude_a_v[-1] == pytest.approx(abs(course[-1]), rel=2e-3)


def test_both_engines_agree_behind_an_inductor() -> None:
    """The settled end; ngspice's error at reltol = 1e-3 is a thousandth of that here."""
    ours, theirs = (pr.simulate_averaged(MOTOR, INDUCTOR, 0.03, speed=20.0, engine=engine) for engine in ENGINES)
    for column in ("amplitude_a_v", "amplitude_b_v", "current_amplitude_a_a", "torque_n_m", "electrical_power_w"):
        assert getattr(ours, column)[-1] == pytest.approx(getattr(theirs, column)[-1], rel=1e-4), column
    assert ours.to_dict()["drive"]["parts"]["a"]["inductor"]["inductance"] == 12e-3


@pytest.mark.soak
@pytest.mark.parametrize(
    ("driver", "of_voltage"),
    [
        (INDUCTOR, 1e-3),
        (llcc(), 1e-3),
        (resonant(45e3, 20.8, 300.0), 2e-3),
        (INDUCTOR.updated(ADDED), 1e-3),
        (INDUCTOR.updated({"inductor.winding_capacitance": 2e-11}), 1e-3),
        (llcc().updated(ADDED | {"llcc.winding_capacitance": 2e-11}), 1e-3),
    ],
    ids=["inductor", "llcc", "resonant", "inductor and cable", "inductor and winding", "llcc, cable and winding"],
)
def test_it_settles_at_the_steady_state_behind_the_same_driver(driver: pr.Driver, of_voltage: float) -> None:
    """Voltages within 0.1 %, torque within 0.1 % of the friction torque under the preload, as without a network.

    Near resonance the inductor magnifies an error of the motional current 4.8 times: 0.13 %. Half the step of the
    steady state changes 0.03 %.
    """
    run = pr.simulate_averaged(MOTOR, driver, 0.03, speed=20.0)
    state = pr.steady_state(MOTOR, driver, speed=20.0)
    waves = state.waveforms
    assert waves is not None
    for group in "ab":
        turned = getattr(waves, f"voltage_{group}_v") * np.exp(-1j * OMEGA * waves.time_s)
        amplitude = 2.0 * abs(np.trapezoid(turned, waves.time_s)) / waves.drive_period_s
        assert getattr(run, f"amplitude_{group}_v")[-1] == pytest.approx(amplitude, rel=of_voltage)
    contact = MOTOR.contact
    friction_torque = contact.friction * contact.preload_n * MOTOR.rotor.radius_m
    assert run.torque_n_m[-1] == pytest.approx(state.torque_n_m, abs=1e-3 * friction_torque)


def controlled(engine: Engine = "auto", *, averaged: bool = True, duration: float = 8e-3) -> pr.ControlledRun:
    """A step of the stage's voltage at 4 ms behind a network."""
    driver = resonant(45e3, 20.8, 300.0)

    def step(sample: pr.Sample) -> dict[str, float]:
        return {"voltage": 20.8 if sample.time_s < 4e-3 else 26.0}

    return pr.simulate_controlled(MOTOR, driver, step, duration, sample_time=5e-4, averaged=averaged, engine=engine)


@pytest.mark.soak
def test_a_controller_sees_the_voltage_behind_the_network_in_both_engines_and_the_full_motor() -> None:
    """Means over a sample, behind the first two, in which the network rings: engines within 0.3 %, full motor 1 %."""
    ours, theirs, full = controlled("compiled"), controlled("spice"), controlled(averaged=False)
    for name in ("voltage_amplitude_v", "voltage_b_amplitude_v", "current_amplitude_a"):
        scale = np.abs(full.samples[name]).max()
        for found, most in ((theirs, 0.003), (full, 0.01)):
            assert np.abs(ours.samples[name] - found.samples[name])[2:].max() < most * scale, (name, most)
    assert ours.voltage_amplitude_v[8] > 1.1 * ours.voltage_amplitude_v[7]  # the step


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"cable.inductance": 1e-4}, "a cable of 25.2 ohm at the drive frequency is out of range"),
        ({"llcc.winding_capacitance": 2e-10}, "llcc.winding_capacitance = 2e-10 F is out of range"),
    ],
)
def test_a_part_that_is_too_large_to_be_averaged_is_an_error(setting: dict[str, float], message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        pr.simulate_averaged(MOTOR, llcc().updated(setting), 0.03)


def test_the_command_runs_the_averaged_motor_behind_a_driver(capsys: pytest.CaptureFixture[str]) -> None:
    """With the parts stated, the amplitude at the group is that of the same driver in Python."""
    parts = ["--part", "inductor.inductance=12e-3", "--part", "inductor.resistance=60", "--no-match"]
    driver = ["--driver", "ideal+inductor", "--voltage", "55", *parts]
    assert command(["simulate", BEAM40, "--averaged", "--duration", "5e-3", *driver, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["end"]["amplitude_a_v"] == pr.simulate_averaged(MOTOR, INDUCTOR, 5e-3).amplitude_a_v[-1]
    assert command(["simulate", BEAM40, "--driver", "linear"]) == 2
    assert "no effect without --averaged" in capsys.readouterr().err


@pytest.mark.soak
def test_a_loop_behind_an_inductor_is_that_of_the_full_motor() -> None:
    """Both engines print one margin; the small signals of the full motor give it within 2 degrees and 3 % in frequency.

    Between the two are the pulses of the pump and the edges that the full motor's detector sees up to 1.8 degrees late.
    """
    tracker = pr.Tracker(
        kind="pll", voltage=DRIVE.voltage, phase_deg=DRIVE.phase_deg, frequency=40.5e3, target_deg=-20.0
    )
    driver = pr.Driver(
        kind="linear", network="inductor", voltage=DRIVE.voltage, frequency=40.5e3, phase_deg=DRIVE.phase_deg,
        settings={"inductor.inductance": 1.5e-3},
    )  # fmt: skip
    ours, theirs = (
        pr.track(MOTOR, tracker, duration=0.02, driver=driver, speed=20.0, averaged=True, engine=engine)
        for engine in ENGINES
    )
    full = pr.track(MOTOR, tracker, driver=driver, speed=20.0)
    assert ours.loop.phase_margin_deg == pytest.approx(theirs.loop.phase_margin_deg, abs=0.05)
    assert ours.loop.crossover_hz == pytest.approx(theirs.loop.crossover_hz, rel=1e-3)
    assert ours.loop.phase_margin_deg == pytest.approx(full.loop.phase_margin_deg, abs=2.0)
    assert ours.loop.crossover_hz == pytest.approx(full.loop.crossover_hz, rel=0.03)
    assert ours.end_frequency_hz == pytest.approx(theirs.end_frequency_hz, rel=1e-5)
