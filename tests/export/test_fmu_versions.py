# SPDX-License-Identifier: GPL-3.0-or-later
"""FMI 2.0 and FMI 3.0, co-simulation and model exchange, in FMPy."""

import ctypes
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.export.fmu import Version
from tests.motors import BEAM40
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("fmu")
END, SAMPLE = 0.01, 1e-3  # s
MOTOR = pr.load_motor(BEAM40)


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    folder = tmp_path_factory.mktemp("versions")
    versions: tuple[Version, ...] = (2, 3)
    return {version: pr.export_motor(MOTOR, folder / f"motor{version}.fmu", fmi=version) for version in versions}


@pytest.fixture(scope="module")
def expected() -> Any:
    return pr.simulate_averaged(MOTOR, pr.default_drive(MOTOR), END)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.soak
def test_both_interfaces_of_both_versions_give_the_speed_of_simulate_averaged(
    version: int, kind: str, units: dict[int, Path], expected: Any
) -> None:
    """Within the error of the steps: 0.01 % here; of the other program, by its tolerance of 1e-5 a step, 0.1 %."""
    exchange = kind == "ModelExchange"
    result = simulate_fmu(
        str(units[version]), fmi_type=kind, stop_time=END, output=["speed", "position", "heat", "state[1]"],
        output_interval=0.1 * SAMPLE if exchange else SAMPLE,
    )  # fmt: skip
    for ours, column in (("speed", "rotor_speed_rad_s"), ("position", "rotor_position_rad"), ("heat", "heat_w")):
        theirs = np.interp(result["time"], expected.time_s, getattr(expected, column))
        after = result["time"] > 2.0 * SAMPLE  # before, the modes swing in, which the steps of both resolve differently
        assert np.abs(result[ours] - theirs)[after].max() < (2e-3 if exchange else 5e-4) * np.abs(theirs).max(), ours
    np.testing.assert_array_equal(result["state[1]"], result["speed"])


POINTS = [
    (voltage, torque)
    for voltage in (45.0, 50.0, 60.0, 69.0, 75.0, 80.0, 90.0, 100.0, 110.0, 120.0, 135.0, 150.0)
    for torque in (0.0, 4e-3)
]


@pytest.mark.parametrize(("voltage", "torque"), mostly(pytest.mark.soak, POINTS, always=[(75.0, 4e-3)]))
def test_model_exchange_runs_with_the_default_tolerance(voltage: float, torque: float, units: dict[int, Path]) -> None:
    """From standstill to an open contact, by CVODE and its 500 steps between two outputs.

    3e-3 rad/s bounds the error of CVODE, the larger of the two: 2.9e-3 at 150 V and 4 mN·m, where its tolerance of 1e-6
    comes within 1.3e-4 of the other one.
    """
    start = {"amplitude_a": voltage, "amplitude_b": voltage, "load_torque": torque}
    found = simulate_fmu(
        str(units[2]), fmi_type="ModelExchange", stop_time=0.1, start_values=start, output=["speed"]
    )  # fmt: skip
    drive = pr.default_drive(MOTOR).model_copy(update={"voltage": voltage})
    ours = pr.simulate_averaged(MOTOR, drive, 0.1, load_torque=torque)
    assert found["time"][-1] == pytest.approx(0.1)
    assert found["speed"][-1] == pytest.approx(ours.rotor_speed_rad_s[-1], abs=3e-3)


def test_the_rates_do_not_jump_where_the_contact_begins_to_slip(units: dict[int, Path], tmp_path: Path) -> None:
    """Between a state that sticks and one that slips, half of the distance halves the greatest change of the rates."""
    described = read_model_description(str(units[2]))
    places = {item.name: item.valueReference for item in described.modelVariables}
    unit = FMU2Model(
        guid=described.guid, unzipDirectory=extract(str(units[2]), str(tmp_path / "unit")), instanceName="motor",
        modelIdentifier=described.modelExchange.modelIdentifier,
    )  # fmt: skip
    unit.instantiate()
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    count = described.numberOfContinuousStates
    states = [f"state[{number + 1}]" for number in range(count)]
    ends, slips = [], []
    for voltage in (45.0, 69.0):
        start = {"amplitude_a": voltage, "amplitude_b": voltage}
        found = simulate_fmu(
            str(units[2]), fmi_type="ModelExchange", stop_time=0.02, start_values=start, output=[*states, "slip"]
        )  # fmt: skip
        ends.append(np.array([found[name][-1] for name in states]))
        slips.append(found["slip"][-1])
    assert slips[0] == 0.0 < slips[1]

    def greatest(parts: int) -> float:
        rates = []
        for share in np.linspace(0.0, 1.0, parts + 1):
            unit.setContinuousStates(*_doubles(ends[0] + share * (ends[1] - ends[0])))
            rates.append(unit.getReal([places[f"der(state[{number + 1}])"] for number in range(count)]))
        steps = np.diff(np.array(rates), axis=0)
        return np.abs(steps / np.ptp(rates, axis=0).clip(1e-300)).max()

    assert greatest(2000) < 0.6 * greatest(1000)
    unit.terminate()
    unit.freeInstance()


def _doubles(values: np.ndarray) -> tuple[Any, int]:
    return (ctypes.c_double * values.size)(*values), values.size


@pytest.mark.parametrize("version", [2, 3])
def test_the_checker_of_fmpy_finds_nothing(version: int, units: dict[int, Path]) -> None:
    assert validate_fmu(str(units[version])) == []


def test_version_3_is_called_after_each_internal_step_and_returns_early(units: dict[int, Path], tmp_path: Path) -> None:
    folder = extract(str(units[3]), str(tmp_path / "unit"))
    described = read_model_description(str(units[3]))
    place = {item.name: item.valueReference for item in described.modelVariables}
    for early in (False, True):
        unit = FMU3Slave(
            guid=described.guid or described.instantiationToken, unzipDirectory=folder, instanceName="motor",
            modelIdentifier=described.coSimulation.modelIdentifier,
        )  # fmt: skip
        seen: list[tuple[float, float]] = []

        def between(_: Any, time: float, *rest: Any, unit: FMU3Slave = unit, seen: list[Any] = seen) -> None:
            *_flags, may_end, ends, until = rest
            seen.append((time, unit.getFloat64([place["speed"]])[0]))
            if may_end and len(seen) == 3:
                ends[0], until[0] = True, time

        unit.instantiate(intermediateUpdate=between, earlyReturnAllowed=early)
        unit.enterInitializationMode(startTime=0.0)
        unit.exitInitializationMode()
        *_, returned, reached = unit.doStep(0.0, 2e-3)
        assert returned == early
        assert reached == (seen[2][0] if early else 2e-3)
        assert len(seen) == 3 if early else len(seen) > 10
        assert np.all(np.diff([time for time, _ in seen]) > 0.0)
        assert seen[-1] == (reached, unit.getFloat64([place["speed"]])[0])
        unit.terminate()
        unit.freeInstance()


@pytest.mark.soak
def test_the_command_writes_version_3(tmp_path: Path) -> None:
    target = tmp_path / "motor.fmu"
    assert run(["export", BEAM40, "--fmi", "3", "--output", str(target)]) == 0
    with zipfile.ZipFile(target) as archive:
        names = set(archive.namelist())
    assert {"binaries/x86_64-linux/piezomotor_averaged.so", "sources/buildDescription.xml"} <= names


def test_the_command_rejects_another_version_and_another_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["export", BEAM40, "--fmi", "4", "--output", str(tmp_path / "motor.fmu")]) == 2
    assert "fmi = 4 is not valid: it must be 2 or 3" in capfd.readouterr().err
    assert run(["export", BEAM40, "--fmi", "3", "--output", str(tmp_path / "motor.lib")]) == 2
    assert "fmi = 3 has no effect on a .lib: give a file name that ends in .fmu." in capfd.readouterr().err
