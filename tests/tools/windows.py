# SPDX-License-Identifier: GPL-3.0-or-later
"""The binary for Windows of a Functional Mock-up Unit, under wine (``make windows``)."""

import os
import subprocess
import zipfile
from pathlib import Path

import numpy as np
from fmpy import read_model_description, simulate_fmu

import pyspice_runner as pr
from tests.motors import BEAM40

STEPS = 20  # of 1 ms


def test_the_motor_runs_on_windows_as_on_linux(tmp_path: Path) -> None:
    """Within 1e-9: the C libraries round functions such as the sine differently."""
    unit = pr.export_motor(pr.load_motor(BEAM40), tmp_path / "motor.fmu", fmi=3)
    with zipfile.ZipFile(unit) as archive:
        (tmp_path / "motor.dll").write_bytes(archive.read("binaries/x86_64-windows/piezomotor_averaged.dll"))
    source, program = Path(__file__).with_name("fmu_windows.c"), tmp_path / "run.exe"
    subprocess.run(["x86_64-w64-mingw32-gcc", "-std=c11", "-O2", "-o", program, source], check=True, timeout=60)
    described = read_model_description(str(unit))
    speed = next(item for item in described.modelVariables if item.name == "speed")
    words = ["motor.dll", described.guid or described.instantiationToken, str(speed.valueReference), str(STEPS)]
    environment = os.environ | {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all", "DISPLAY": ""}
    command = ["wine", program, *words]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, timeout=300, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    ours = np.array(done.stdout.split(), dtype=float)
    theirs = simulate_fmu(str(unit), stop_time=1e-3 * STEPS, output_interval=1e-3, output=["speed"])["speed"][1:]
    assert len(ours) == STEPS
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    print(f"greatest difference {np.abs(ours / theirs - 1.0).max():.2g}, speed {ours[-1]:.6g} rad/s")
