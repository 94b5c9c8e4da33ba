# SPDX-License-Identifier: GPL-3.0-or-later
"""The recommended drives of the paper's motors are the best points within limits."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import pyspice_runner as pr
from tests.selection import mostly

SCRIPT = Path(__file__).resolve().parents[2] / "figures" / "recommended_drives.py"


NAMES = ["andersen2002", "andersen2002-unintended-mode"]


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, NAMES, ["andersen2002"]))
def test_the_drive_of_a_set_is_the_best_of_its_neighbours_within_the_limits(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(SCRIPT.parent)
    with mpl.rc_context():
        script = runpy.run_path(str(SCRIPT))
    drive, choice = script["recommended"](name), script["CHOICES"][name]
    over = {}
    for path, values in choice.over.items():
        at = int(np.argmin(np.abs(np.asarray(values) - drive[path])))
        assert values[at] == pytest.approx(drive[path], rel=1e-9)
        over[path] = values[at - 1 : at + 2]
    found = script["mapped"](name, over)
    assert found["stable"].values[1, 1]
    for path in over:
        assert found.piezomotor.best[path] == pytest.approx(drive[path], rel=1e-9)
    # the voltage is the greatest within its limit, rounded to 5 V
    assert 0.0 <= choice.voltage - drive["drive.voltage"] < 5.0
    temperature = found.piezomotor.best["temperature_c"]
    motor = pr.load_motor(name)
    assert motor.limits is not None
    assert temperature < 0.5 * motor.limits.curie_temperature_c
