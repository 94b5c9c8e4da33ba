# SPDX-License-Identifier: GPL-3.0-or-later
"""The physical audit: what cannot be true is found and named, what is true passes."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.analysis.audit import ENERGY_BOUND, audit_run, audit_two_port
from pyspice_runner.analysis.simulate import shortest_period
from pyspice_runner.cli import run

MOTOR = pr.load_motor("andersen2002")
HAMMER = pr.TwoPhaseDrive(voltage=150.0, frequency=13.5e3, phase_deg=0.0)
STEP = shortest_period(MOTOR, HAMMER, contact=True) / 16.05  # allowed at the preload, too coarse at six times its force


def waves(**changed: float) -> dict[str, np.ndarray]:
    """A made-up run: 1 W for 1 ms, pressed with 5 N; the columns named differ in one point."""
    columns = {
        "time_s": np.linspace(0.0, 1e-3, 1001),
        "voltage_a_v": np.ones(1001),
        "current_a_a": np.ones(1001),
        "voltage_b_v": np.zeros(1001),
        "current_b_a": np.zeros(1001),
        "normal_force_n": np.full(1001, 5.0),
        "friction_force_n": np.full(1001, 1.2),
    }
    for name, value in changed.items():
        columns[name][500] = value
    return columns


def audited(missing: float = 0.0, step: float = 1e-7, **changed: float) -> tuple[str, ...]:
    return audit_run(MOTOR, waves(**changed), missing_j=missing, from_load_j=0.0, step=step, contact=True)


def test_a_sound_run_passes() -> None:
    assert audited() == ()
    assert audited(missing=0.99 * ENERGY_BOUND * 1e-3) == ()


@pytest.mark.parametrize("missing", [1.01 * ENERGY_BOUND * 1e-3, -1.01 * ENERGY_BOUND * 1e-3])
def test_energy_that_is_missing_or_too_much_is_found(missing: float) -> None:
    (finding,) = audited(missing=missing)
    assert finding.startswith("The energy balance misses 1.01e-05 of 0.001 J; allowed is 1 %.")


def test_tension_is_found() -> None:
    (finding,) = audited(normal_force_n=-0.01, friction_force_n=0.0)
    assert finding.startswith("The contact pulls with 0.01 N")


@pytest.mark.parametrize("force", [1.51, -1.51])
def test_friction_beyond_coulomb_is_found(force: float) -> None:
    (finding,) = audited(friction_force_n=force)
    assert finding.startswith("Friction exceeds mu F_N by 0.01 N")


def test_a_step_too_coarse_for_the_greatest_force_is_found_and_one_that_is_allowed_is_named() -> None:
    (finding,) = audited(step=1.2e-6)
    allowed = float(finding.rpartition("<= ")[2].removesuffix(" s."))
    assert audited(step=allowed) == ()
    assert audited(step=1.02 * allowed) != ()
    (stiffer,) = audited(step=1.2e-6, normal_force_n=40.0)
    assert float(stiffer.rpartition("<= ")[2].removesuffix(" s.")) < 0.95 * allowed


def test_a_run_that_fails_is_withheld_unless_asked_for_and_then_marked() -> None:
    with pytest.raises(pr.SimulationError, match=r"Under the greatest force, .* Give step <= .* audit = False"):
        pr.simulate(MOTOR, HAMMER, duration=1e-3, step=STEP)
    marked = pr.simulate(MOTOR, HAMMER, duration=1e-3, step=STEP, audit=False)
    told = marked.to_dict()["audit"]
    assert told["passed"] is False
    assert told["findings"][0].startswith("Under the greatest force")
    assert pr.simulate(MOTOR, HAMMER, duration=1e-3, step=STEP / 2).to_dict()["audit"] == {
        "passed": True,
        "findings": [],
    }


def test_the_command_says_so_too(capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "simulate",
        "andersen2002",
        "--voltage",
        "150",
        "--frequency",
        "13500",
        "--phase",
        "0",
        "--duration",
        "1e-3",
    ]
    words += ["--step", str(STEP), "--json"]
    assert run(words) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Under the greatest force" in captured.err
    assert run([*words, "--no-audit"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["audit"]["passed"] is False
    assert captured.err.startswith("piezomotor: not to be trusted: Under the greatest force")


def test_an_admittance_that_gives_power_is_found() -> None:
    frequency = np.array([1e4, 2e4, 3e4])
    passive = np.array([[[1.0, 0.2j], [-0.2j, 1.0]]] * 3) * 1e-3  # a gyrator, which loses nothing
    assert audit_two_port(frequency, passive) == ()
    coupled = passive.copy()
    coupled[1] = np.array([[1.0, 2.0], [2.0, 1.0]]) * 1e-3  # each port alone is passive, both together are not
    (finding,) = audit_two_port(frequency, coupled)
    assert finding.startswith("At 20000 Hz the stator gives power, -0.001 S")


def test_the_motor_is_passive() -> None:
    for state in ("free", "preloaded"):
        assert pr.admittance(MOTOR, start=10e3, stop=60e3, points=301, state=state).to_dict()["audit"]["passed"]
