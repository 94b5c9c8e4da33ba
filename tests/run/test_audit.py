# SPDX-License-Identifier: GPL-3.0-or-later
"""The physical audit names what is physically impossible in a result, and accepts a result that is possible."""

import json
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.cli import run
from pyspice_runner.drivers import report as drive_module
from pyspice_runner.run.audit import (
    DRIVER_BOUND,
    ENERGY_BOUND,
    POWER_BOUND,
    audit_contact,
    audit_point,
    audit_power,
    audit_run,
    audit_two_port,
)
from pyspice_runner.run.kernel import Outcome
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import EnergyBalance
from pyspice_runner.steady import settling as settling_module
from pyspice_runner.steady.speed_torque import held_point
from tools.benches import hysteresis as hysteresis_module
from tools.benches.hysteresis import hysteresis
from validation import impact as impact_module
from validation.impact import Throw, audit_impact, impact

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
HAMMER = pr.TwoPhaseDrive(voltage=150.0, frequency=13.5e3, phase_deg=0.0)
# allowed at the preload, too coarse at six times its force
STEP = Point(MOTOR, DriveSource(HAMMER)).shortest_period / 16.05


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


def balance(missing: float) -> dict[str, float]:
    """The entries of an energy balance of 1 mJ that misses some of it, J."""
    return dict.fromkeys((item.name for item in fields(EnergyBalance)), 0.0) | {"electrical": missing, "passed": 1e-3}


def audited(missing: float = 0.0, step: float = 1e-7, **changed: float) -> tuple[str, ...]:
    return audit_run(MOTOR, waves(**changed), EnergyBalance(**balance(missing)), step=step, contact=True)


@pytest.mark.parametrize(("changed", "found"), [
    ({}, ""),
    ({"missing": 0.99 * ENERGY_BOUND * 1e-3}, ""),
    ({"missing": 1.01 * ENERGY_BOUND * 1e-3}, "The energy balance misses 1.01e-05 J; the limit is 1 % of the 0.001 J"),
    ({"missing": -1.01 * ENERGY_BOUND * 1e-3}, "The energy balance misses 1.01e-05 J; the limit is 1 % of the 0.001 J"),
    ({"normal_force_n": -0.01, "friction_force_n": 0.0}, "The contact pulls with 0.01 N"),
    ({"friction_force_n": 1.51}, "Friction exceeds mu F_N by 0.01 N"),
    ({"friction_force_n": -1.51}, "Friction exceeds mu F_N by 0.01 N"),
])  # fmt: skip
def test_waveforms_that_cannot_be_true_are_found(changed: dict[str, float], found: str) -> None:
    findings = audited(**changed)
    assert [finding[: len(found)] for finding in findings] == ([found] if found else [])


def test_a_step_too_coarse_for_the_greatest_force_is_found_and_one_that_is_allowed_is_named() -> None:
    (finding,) = audited(step=1.2e-6)
    allowed = float(finding.rpartition("<= ")[2].removesuffix(" s."))
    assert audited(step=allowed) == ()
    assert audited(step=1.02 * allowed) != ()
    (stiffer,) = audited(step=1.2e-6, normal_force_n=40.0)
    assert float(stiffer.rpartition("<= ")[2].removesuffix(" s.")) < 0.95 * allowed


def test_a_run_that_fails_is_withheld_unless_asked_for_and_then_marked() -> None:
    with pytest.raises(pr.SimulationError, match=r"Under the maximum force, .* Use a step <= .* audit = False"):
        pr.simulate(MOTOR, HAMMER, duration=1e-3, step=STEP)
    marked = pr.simulate(MOTOR, HAMMER, duration=1e-3, step=STEP, audit=False)
    told = marked.to_dict()["audit"]
    assert told["passed"] is False
    assert told["findings"][0].startswith("Under the maximum force")
    assert pr.simulate(MOTOR, HAMMER, duration=1e-3, step=STEP / 2).to_dict()["audit"] == {
        "passed": True,
        "findings": [],
    }


def test_the_command_says_so_too(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", "andersen2002", "--voltage", "150", "--frequency", "13500", "--phase", "0", "--json"]
    words += ["--duration", "1e-3", "--step", str(STEP)]
    assert run(words) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Under the maximum force" in captured.err
    assert run([*words, "--no-audit"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["audit"]["passed"] is False
    assert captured.err.startswith("piezomotor: the result failed the audit: Under the maximum force")


def test_an_admittance_that_gives_power_is_found() -> None:
    frequency = np.array([1e4, 2e4, 3e4])
    passive = np.array([[[1.0, 0.2j], [-0.2j, 1.0]]] * 3) * 1e-3  # a gyrator, which loses nothing
    assert audit_two_port(frequency, passive) == ()
    coupled = passive.copy()
    coupled[1] = np.array([[1.0, 2.0], [2.0, 1.0]]) * 1e-3  # each port alone is passive, both together are not
    (finding,) = audit_two_port(frequency, coupled)
    assert finding.startswith("At 20000 Hz the stator delivers power, -0.001 S")


def test_the_motor_is_passive() -> None:
    for state in ("free", "preloaded"):
        assert pr.admittance(MOTOR, start=10e3, stop=60e3, points=301, state=state).to_dict()["audit"]["passed"]


def test_sources_that_only_take_back_are_balanced_by_what_they_took() -> None:
    """Charged plates may supply all the energy; the balance is then relative to the energy that the sources absorb."""
    took = balance(0.0) | {"electrical": -1e-3, "kinetic": -1e-3}
    for missing, found in ((0.99, 0), (1.01, 1)):
        energy = EnergyBalance(**took | {"damping": -missing * ENERGY_BOUND * 1e-3})
        assert energy.residual == pytest.approx(missing * ENERGY_BOUND)
        assert len(audit_run(MOTOR, waves(), energy, step=1e-7, contact=True)) == found


@pytest.mark.parametrize("contact", ["spring-slider", "brush", "coulomb", None])
@pytest.mark.parametrize("voltage", [0.0, 1e-6])
def test_a_run_without_drive_has_a_residual_that_json_can_hold(voltage: float, contact: Any) -> None:
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=51.7e3)
    run = pr.simulate(MOTOR, drive, duration=1e-4, contact=contact)
    # what rounding leaves is below the bound of the audit, and far from the 240 of energy over almost no energy
    assert run.energy_residual < ENERGY_BOUND
    json.dumps(run.to_dict(), allow_nan=False)


def test_a_run_that_gives_back_more_than_it_took_has_a_finite_residual() -> None:
    run = pr.simulate(MOTOR, pr.TwoPhaseDrive(voltage=50.0, frequency=1000.0, phase_deg=135.0), duration=2e-4)
    assert run.energy_residual < ENERGY_BOUND
    json.dumps(run.to_dict(), allow_nan=False)


# --- points on the dynamometer ---


def point(**changed: float) -> dict[str, float]:
    """A made-up point: 10 W in, of which 4 W are on the shaft."""
    return {
        "power_a_w": 6.0, "power_b_w": 4.0, "shaft_power_w": 4.0, "dielectric_loss_w": 1.0, "damping_loss_w": 2.0,
        "friction_loss_w": 3.0, "normal_loss_w": 0.0, "stored_power_w": 0.0, "apparent_power_a_va": 0.0,
        "apparent_power_b_va": 0.0, "normal_force_n": 5.0, "torque_n_m": 0.012, **changed,
    }  # fmt: skip


@pytest.mark.parametrize(("changed", "found"), [
    ({}, ""),
    ({"power_a_w": 6.0 + 9.9 * POWER_BOUND}, ""),
    ({"power_a_w": 6.0 + 10.2 * POWER_BOUND}, "The powers miss 0.102 of 10.1 W; the limit is 1 %."),
    ({"damping_loss_w": 2.11}, "The powers miss 0.11 of 10 W"),
    ({"damping_loss_w": 2.11, "apparent_power_a_va": 400.0}, ""),  # small beside the reactive power
    ({"torque_n_m": 0.01501}, ""),
    ({"torque_n_m": -0.0151}, "The mean torque of -0.0151 N.m exceeds the limit of 0.015 N.m"),
    ({"normal_force_n": -0.01, "torque_n_m": 0.0}, "On average the contact pulls with 0.01 N"),
])  # fmt: skip
def test_means_that_cannot_be_true_are_found(changed: dict[str, float], found: str) -> None:
    findings = audit_point(MOTOR, point(**changed), 1e-7)
    assert [finding[: len(found)] for finding in findings] == ([found] if found else [])


@pytest.mark.parametrize(("missing_w", "passes"), [(3e-15, True), (1e-6, False)])
def test_a_motor_at_rest_without_voltage_passes_despite_rounding(missing_w: float, passes: bool) -> None:
    rest = dict.fromkeys((name for name in point() if name.endswith(("_w", "_va"))), 0.0)
    assert (audit_point(MOTOR, point(**rest | {"friction_loss_w": missing_w}), 1e-7) == ()) is passes


def test_a_point_whose_step_is_too_coarse_is_found() -> None:
    (finding,) = audit_point(MOTOR, point(), 1.2e-6)
    assert finding.startswith("Under the mean force, 5 N, the motor oscillates at")


def test_powers_of_a_driver_and_the_energy_of_an_impact_are_held_to_their_bounds() -> None:
    assert audit_power(10.0, 10.0 * (1.0 - 0.99 * DRIVER_BOUND), 0.0) == ()
    (finding,) = audit_power(10.0, 10.0 * (1.0 - 1.01 * DRIVER_BOUND), 0.0)
    assert finding.startswith("The powers miss 0.202 of 10 W; the limit is 2 %.")
    assert audit_impact(1.0, 1.0009) == ()
    (finding,) = audit_impact(1.0, 1.0011)
    assert finding.startswith("The energy of the sphere rises from 1 J to 1.001 J")


# --- runs made false behind the simulator's back: each is withheld, or given and marked ---

SPEED: dict[str, Any] = {"mode": "settle", "speed": 2.0, "patience": 4, "tolerance": 0.1, "step": 4e-7}
DAMPED = MOTOR.updated({f"modes.{n}.damping_n_s_per_m": 200.0 for n in range(2)})  # decays in no time
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3)


def falsify(monkeypatch: pytest.MonkeyPatch, module: Any, name: str, change: Callable[[Any], Any]) -> None:
    """Change what a function of a module returns."""
    true = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *given, **named: change(true(*given, **named)))


def lossless(means: dict[str, float]) -> dict[str, float]:
    return means | {"damping_loss_w": 0.0}


def test_a_point_that_is_not_true_is_withheld_or_marked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert held_point(DAMPED, DRIVE, **SPEED)["audit"] == {"passed": True, "findings": []}
    falsify(monkeypatch, settling_module, "quantities", lossless)
    with pytest.raises(pr.SimulationError, match=r"The powers miss .* The point at 2 rad/s is not returned"):
        held_point(DAMPED, DRIVE, **SPEED)
    marked = held_point(DAMPED, DRIVE, **SPEED, audit=False)["audit"]
    assert (marked["passed"], marked["findings"][0][:15]) == (False, "The powers miss")
    settings = {name: value for name, value in SPEED.items() if name != "speed"}
    curve = pr.speed_torque(DAMPED, DRIVE, speeds=[2.0], **settings, audit=False)
    assert not curve["audit_passed"].any()
    assert json.loads(curve.attrs["audit"]) == marked
    words = ["speed-torque", "andersen2002", "--frequency", "51700", "--speeds", "2", "--patience", "4", "--json"]
    words += ["--mode", "settle", "--tolerance", "0.1", "--step", "4e-7"]
    words += [f"--set=modes.{n}.damping_n_s_per_m=200" for n in range(2)]
    assert run(words) == 3
    assert capsys.readouterr().out == ""
    assert run([*words, "--no-audit"]) == 0
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert document["audit_passed"] == [False]
    assert document["audit"] == marked
    assert captured.err.startswith("piezomotor: the result failed the audit: The powers miss")


def test_a_driver_whose_powers_do_not_balance_is_withheld_or_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = pr.Driver(kind="linear", voltage=50.0, frequency=51.7e3)
    settings: dict[str, Any] = {"duration": 2e-4}
    assert pr.drive_report(MOTOR, driver, **settings).to_dict()["audit"]["passed"]
    falsify(monkeypatch, drive_module._Measurement, "budget", lambda budget: (1.1 * budget[0], *budget[1:]))
    with pytest.raises(pr.SimulationError, match=r"The powers miss .* The report is not returned"):
        pr.drive_report(MOTOR, driver, **settings)
    told = pr.drive_report(MOTOR, driver, **settings, audit=False).to_dict()["audit"]
    assert (told["passed"], told["findings"][0][:15]) == (False, "The powers miss")


@pytest.mark.soak
def test_a_tracked_motor_whose_contact_pulls_is_withheld_or_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    tracker = pr.Tracker(kind="none", voltage=50.0, frequency=55.4e3)
    settings: dict[str, Any] = {"duration": 1.7e-3, "begin": 1.7e-3, "step": 1.8e-7}
    assert pr.track(MOTOR, tracker, **settings).to_dict()["audit"]["passed"]
    falsify(
        monkeypatch, Outcome, "vectors",
        lambda found: found | {"v(xmotor.normal)": found["v(xmotor.normal)"] - 6.0},
    )  # fmt: skip
    with pytest.raises(pr.SimulationError, match=r"The contact pulls .* The run is not returned"):
        pr.track(MOTOR, tracker, **settings)
    told = pr.track(MOTOR, tracker, **settings, audit=False).to_dict()["audit"]
    assert (told["passed"], told["findings"][0][:17]) == (False, "The contact pulls")


def test_a_loop_and_an_impact_beyond_coulomb_are_withheld_or_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    assert hysteresis(MOTOR, 0.8).audit.passed
    assert impact(Throw()).provenance["audit"]["passed"]
    for module in (hysteresis_module, impact_module):
        monkeypatch.setattr(module, "audit_contact", lambda mu, *forces: audit_contact(0.5 * mu, *forces))
    with pytest.raises(pr.SimulationError, match=r"Friction exceeds mu F_N .* The loop is not returned"):
        hysteresis(MOTOR, 1.8)
    with pytest.raises(pr.SimulationError, match=r"Friction exceeds mu F_N .* The impact is not returned"):
        impact(Throw(psi=15.0))
    assert not hysteresis(MOTOR, 1.8, audit=False).audit.passed
    assert not impact(Throw(psi=15.0), audit=False).provenance["audit"]["passed"]
