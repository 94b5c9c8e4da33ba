# SPDX-License-Identifier: GPL-3.0-or-later
"""FMI 2.0 and FMI 3.0, co-simulation and model exchange, in FMPy."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.export.fmu_description import Version

pytestmark = pytest.mark.xdist_group("fmu")
END, SAMPLE = 0.01, 1e-3  # s
MOTOR = pr.load_motor("beam40")


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
def test_both_interfaces_of_both_versions_give_the_speed_of_simulate_averaged(
    version: int, kind: str, units: dict[int, Path], expected: Any
) -> None:
    """Within the error of the steps: 0.01 % here; of the other program's, with a tolerance of 1e-3, 0.1 %."""
    exchange = kind == "ModelExchange"
    result = simulate_fmu(
        str(units[version]), fmi_type=kind, stop_time=END, output=["speed", "position", "heat", "state[1]"],
        output_interval=0.1 * SAMPLE if exchange else SAMPLE, relative_tolerance=1e-3 if exchange else None,
    )  # fmt: skip
    for ours, column in (("speed", "rotor_speed_rad_s"), ("position", "rotor_position_rad"), ("heat", "heat_w")):
        theirs = np.interp(result["time"], expected.time_s, getattr(expected, column))
        after = result["time"] > 2.0 * SAMPLE  # before, the modes swing in, which the steps of both resolve differently
        assert np.abs(result[ours] - theirs)[after].max() < (2e-3 if exchange else 5e-4) * np.abs(theirs).max(), ours
    np.testing.assert_array_equal(result["state[1]"], result["speed"])


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
    assert run(["export", "beam40", "--fmi", "3", "--output", str(target)]) == 0
    with zipfile.ZipFile(target) as archive:
        names = set(archive.namelist())
    assert {"binaries/x86_64-linux/piezomotor_averaged.so", "sources/buildDescription.xml"} <= names


def test_the_command_rejects_another_version_and_another_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["export", "beam40", "--fmi", "4", "--output", str(tmp_path / "motor.fmu")]) == 2
    assert "fmi = 4 is not valid: it must be 2 or 3" in capfd.readouterr().err
    assert run(["export", "beam40", "--fmi", "3", "--output", str(tmp_path / "motor.lib")]) == 2
    assert "--fmi 3 is for a Functional Mock-up Unit" in capfd.readouterr().err
