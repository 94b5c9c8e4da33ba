# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor as a linear system, against its own step and in other programs."""

import json
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.io import loadmat

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.control.state_space import StateSpace
from tests.motors import BEAM40

STEP = 0.2  # V


@pytest.fixture(scope="module")
def drive() -> pr.TwoPhaseDrive:
    return pr.default_drive(pr.load_motor(BEAM40)).model_copy(update={"voltage": 69.0})


@pytest.fixture(scope="module")
def system(drive: pr.TwoPhaseDrive) -> StateSpace:
    return pr.state_space(pr.load_motor(BEAM40), drive)


def test_a_small_step_of_the_voltage_moves_the_averaged_motor_as_the_system_says(
    system: StateSpace, drive: pr.TwoPhaseDrive
) -> None:
    motor, period = pr.load_motor(BEAM40), 1e-3

    def controller(sample: pr.Sample) -> dict[str, float]:
        return {"voltage": drive.voltage + STEP * (sample.time_s > 4.5 * period)}

    found = pr.simulate_controlled(motor, drive, controller, 60 * period, sample_time=period, start="steady")
    begun = 5  # samples; the step is set at the sixth
    plant = system.to_control()["speed", "amplitude"]
    time = found.time_s[begun - 1 :] - found.time_s[begun - 1]
    _, response = control.step_response(plant, np.linspace(0.0, time[-1], 20 * (len(time) - 1) + 1))
    # a sample is the mean over the interval before it
    mean = np.array([response[20 * at : 20 * at + 21].mean() for at in range(len(time) - 1)])
    moved = (found.speed_rad_s[begun:] - system.point["speed"]) / STEP
    # a step of 0.3 % changes the gain by some per cent; the integration's tolerance of 1e-4 is 1 % of the step
    assert np.abs(moved[: len(mean)] - mean).max() < 0.05 * mean.max()


@pytest.mark.parametrize("name", [BEAM40, "andersen2002"])
def test_no_oscillation_against_the_drive_is_faster_than_half_of_its_frequency(name: str) -> None:
    """Those of modes at harmonics, of 0.7 to 3 times the frequency, would be free motions that no average describes."""
    motor = pr.load_motor(name)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 69.0})
    poles = np.linalg.eigvals(pr.state_space(motor, drive).a) / (2.0 * np.pi * drive.frequency)
    fast = poles[np.abs(poles) > 0.5]
    assert len(fast) > 5
    assert np.all(np.abs(fast.imag) < -0.25 * fast.real)  # they settle within a period


def test_other_programs_read_the_system_with_its_names(system: StateSpace, tmp_path: Path) -> None:
    known = system.to_control()
    assert known.input_labels == list(system.inputs) == ["amplitude", "phase", "frequency", "load_torque"]
    assert known.output_labels[:2] == ["speed", "position"]
    assert known.state_labels == list(system.states)
    at = system.transfer("speed", "frequency", np.array([40.0]))
    assert complex(known["speed", "frequency"](2j * np.pi * 40.0)) == pytest.approx(complex(at[0]), rel=1e-9)
    read = loadmat(system.save(tmp_path / "plant.mat"), simplify_cells=True)
    assert np.array_equal(read["A"], system.a)
    assert list(read["state_units"]) == list(system.states.values())
    assert read["point"]["speed"] == system.point["speed"]


def test_a_load_torque_acts_on_the_inertia_alone(system: StateSpace) -> None:
    inertia = pr.load_motor(BEAM40).rotor.inertia_kg_m2
    column = system.b[:, list(system.inputs).index("load_torque")]
    assert column[list(system.states).index("speed")] == pytest.approx(-1.0 / inertia, rel=1e-6)
    assert np.count_nonzero(column) == 1


def test_the_command_writes_matrices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "plant.mat"
    assert run(["state-space", BEAM40, "--voltage", "69", "--json", "--output", str(target)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert np.shape(found["a"]) == (len(found["states"]),) * 2
    assert found["inputs"]["load_torque"] == "N·m"
    assert target.stat().st_size > 1000
    with pytest.raises(pr.ParameterError, match="There is no transfer from wind to speed"):
        pr.state_space(pr.load_motor(BEAM40), pr.default_drive(pr.load_motor(BEAM40))).transfer(
            "speed", "wind", np.array([1.0])
        )
