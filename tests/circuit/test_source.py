# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources behind one interface, and what a motor keeps of its circuits."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import DriveSource, Waveform, source_of
from pyspice_runner.circuit.state import motor_states
from pyspice_runner.run.point import Point
from pyspice_runner.spice.library import read_library

MOTOR = pr.load_motor("andersen2002")
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)
DRIVER = pr.Driver(kind="linear", voltage=50.0, frequency=51.7e3)
TRACKER = pr.Tracker(kind="pll", voltage=50.0, frequency=51.7e3)
WAVEFORM = Waveform([0.0, 1e-3], [0.0, 1.0], [0.0, 1.0], 51.7e3)


@pytest.mark.parametrize("given", [DRIVE, DRIVER, TRACKER, WAVEFORM], ids=lambda given: type(given).__name__)
def test_whatever_drives_a_motor_is_a_source_of_its_bench(given: Any) -> None:
    source = source_of(given, MOTOR, Law())
    assert source_of(source, MOTOR, Law()) is source
    text = str(motor_bench(MOTOR, source).circuit)
    for group in "ab":
        vector, sign = source.current(group)
        assert abs(sign) == 1.0
        assert vector.startswith("i(v")
    assert "Xmotor a b 0 shaft piezomotor" in text
    assert bool(source.unsteady) == (given is TRACKER)
    assert (source.ideal is DRIVE) == (given is DRIVE)


@pytest.mark.parametrize("given", [TRACKER, WAVEFORM], ids=lambda given: type(given).__name__)
def test_a_source_without_parameters_of_its_own_says_so(given: Any) -> None:
    with pytest.raises(pr.ParameterError, match="have no paths"):
        Point.of(MOTOR, given).updated({"drive.voltage": 60.0})


def test_a_changed_motor_derives_its_facts_anew() -> None:
    stiffer = MOTOR.model_copy(
        update={"modes": (MOTOR.modes[0].model_copy(update={"stiffness_n_per_m": 2e7}), *MOTOR.modes[1:])}
    )
    assert MOTOR.stator is MOTOR.stator
    assert stiffer.stator.stiffness[0] == 2e7
    assert np.array_equal(MOTOR.stator.stiffness[1:], stiffer.stator.stiffness[1:])


def test_a_document_of_a_motor_can_be_changed_by_its_reader() -> None:
    MOTOR.to_dict()["contact"]["friction"] = 9.0
    assert MOTOR.to_dict()["contact"]["friction"] == MOTOR.contact.friction


def test_an_edited_law_of_the_users_own_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "law.lib"
    texts, text = [], read_library("piezomotor_coulomb").text
    for changed in (text, text.replace("V=", "V=1*", 1)):
        path.write_text(changed, encoding="utf-8")
        law = Law(str(path))
        assert motor_states(MOTOR, law)
        texts.append(str(motor_bench(MOTOR, DriveSource(DRIVE), law=law).circuit))
    assert texts[0] != texts[1]
