# SPDX-License-Identifier: GPL-3.0-or-later
"""The firmware of examples/firmware in the loop; tests/tools/firmware.py runs the same samples on a microcontroller."""

import subprocess
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.control.electronics import Rounding
from pyspice_runner.control.run import ControlledRun
from pyspice_runner.spice.compiler import find_compiler

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples" / "firmware"
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-I", str(ROOT / "behavioral")]
LOGS = 3
DEFINED: dict[str, Any] = run_path(str(FOLDER / "run.py"))


def built(folder: Path) -> tuple[str, Path]:
    """The firmware as a shared library, and with replay.c as a program."""
    library, program = folder / "speed_loop.so", folder / "replay"
    source = FOLDER / "speed_loop.c"
    subprocess.run([find_compiler(), *FLAGS, "-shared", "-fPIC", "-o", library, source], check=True, timeout=60)
    subprocess.run([find_compiler(), *FLAGS, "-o", program, FOLDER / "replay.c", source], check=True, timeout=60)
    return str(library), program


def replayed(found: ControlledRun, program: list[Path | str], folder: Path) -> tuple[bytes, str]:
    """What the firmware sets and logs for the samples of a run, and what the program prints."""
    (folder / "replay.in").write_bytes(DEFINED["recorded"](found))
    (folder / "replay.out").unlink(missing_ok=True)
    said = subprocess.run(program, cwd=folder, check=True, timeout=120, capture_output=True, text=True).stdout
    return (folder / "replay.out").read_bytes(), said


def values_of(content: bytes) -> np.ndarray:
    return np.frombuffer(content, "<f4").reshape(-1, 4 + LOGS)


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path, Path]:
    folder = tmp_path_factory.mktemp("firmware")
    return *built(folder), folder


def test_firmware_replayed_sets_what_it_set_in_the_loop_bit_by_bit(firmware: tuple[str, Path, Path]) -> None:
    library, program, folder = firmware
    found = DEFINED["run"](library, 40e-3)
    content, said = replayed(found, [program], folder)
    values = values_of(content)
    assert said == f"samples {len(found.time_s)}\n"
    rounding = Rounding(DEFINED["PARTS"])
    set_then = (found.voltage_a_v, found.voltage_b_v, found.phase_deg, found.frequency_hz)
    for row, *actual in zip(values, *set_then, strict=True):
        given = dict(zip(("voltage_a", "voltage_b", "phase_deg", "frequency"), map(float, row[:4]), strict=True))
        made = rounding.commands(given)
        assert [made[name] for name in given] == actual
    for place, name in enumerate(("error", "integral", "power")):
        assert (found.logs[name] == values[:, 4 + place]).all()


def test_the_firmware_holds_the_speed_and_reverses_it(firmware: tuple[str, Path, Path]) -> None:
    """To a step of the encoder: 0.63 rad/s. The timer's steps are in the result."""
    found = DEFINED["run"](firmware[0], 80e-3)
    resolution = found.to_dict()["run"]["resolution"]
    assert resolution["frequency_hz"] == pytest.approx(40.7e3**2 / 170e6)
    before = (found.time_s > 15e-3) & (found.time_s < 20e-3)
    assert found.speed_rad_s[before].mean() == pytest.approx(8.0, rel=0.1)
    assert found.speed_rad_s[-20:].mean() == pytest.approx(-8.0, abs=resolution["speed_rad_s"])


@pytest.mark.soak
def test_the_full_motor_gives_the_firmware_the_samples_of_the_averaged_one(firmware: tuple[str, Path, Path]) -> None:
    averaged, full = (
        DEFINED["run"](firmware[0], 6e-3, electronics=None, averaged=averaged) for averaged in (True, False)
    )
    for name in ("speed_rad_s", "position_rad", "voltage_a_v"):
        assert np.abs(averaged.samples[name] - full.samples[name]).max() <= 0.03 * np.abs(full.samples[name]).max()


def test_a_library_that_lacks_a_function_of_firmware_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "half.c").write_text("void firmware_step(void *in, void *out) { (void)in, (void)out; }\n")
    command = [find_compiler(), "-shared", "-fPIC", "-o", tmp_path / "half.so", tmp_path / "half.c"]
    subprocess.run(command, check=True, timeout=60)
    with pytest.raises(pr.ParameterError, match="firmware_logs"):
        DEFINED["run"](str(tmp_path / "half.so"), 2e-3)
