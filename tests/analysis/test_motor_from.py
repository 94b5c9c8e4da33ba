# SPDX-License-Identifier: GPL-3.0-or-later
"""An invented motor, measured with noise, is recovered from its spectra and its data sheet."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.analysis.motor_from import MotorFrom, _tips
from pyspice_runner.cli import run

NOISE = 1e-3
SHEET_ERROR = 0.01


# drive of the data sheet and band of the spectra
SHEETS = {
    "andersen2002": (pr.TwoPhaseDrive(voltage=300.0, frequency=54e3, phase_deg=90.0), (8e3, 90e3)),
    "beam40": (pr.TwoPhaseDrive(voltage=110.0, frequency=40.1e3, phase_deg=120.0), (25e3, 60e3)),
}


def invented(name: str = "andersen2002", mass: float = 0.97, friction: float = 0.9) -> pr.Motor:
    """A motor with masses, friction and contact of its own, at the frequencies and with the couplings of another."""
    base = pr.load_motor(name)
    changed = base.updated(
        {
            "contact.friction": friction * base.contact.friction,
            "contact.normal_stiffness_n_per_m15": 0.9 * base.contact.normal_stiffness_n_per_m15,
            "contact.tangential_compliance_tip_m_per_n23": 1.05 * base.contact.tangential_compliance_tip_m_per_n23,
            "contact.tangential_compliance_rotor_m_per_n23": 1.05 * base.contact.tangential_compliance_rotor_m_per_n23,
        }
    )
    # one modal mass for all modes; the modal coordinates are scaled to it, which changes no motion
    for index, mode in enumerate(base.modes):
        scale = np.sqrt(base.modes[0].mass_kg / mode.mass_kg)
        changed = changed.updated(
            {f"modes.{index}.tip_x": scale * mode.tip_x, f"modes.{index}.tip_y": scale * mode.tip_y}
            | {f"modes.{index}.coupling_{g}_n_per_v": scale * getattr(mode, f"coupling_{g}_n_per_v") for g in "ab"}
            | {f"modes.{index}.mass_kg": mass * base.modes[0].mass_kg}
            | {f"modes.{index}.damping_n_s_per_m": mass * scale**2 * mode.damping_n_s_per_m}
        )
        changed = changed.updated({f"modes.{index}.frequency_hz": mode.frequency_hz})
    return changed


def measured(
    motor: pr.Motor, points: int, seed: int, band: tuple[float, float] = (8e3, 90e3), state: str = "free"
) -> pr.Spectrum:
    """The two-port of the stator with proportional noise; it stays reciprocal."""
    y = pr.admittance(motor, start=band[0], stop=band[1], points=points, state=state)  # type: ignore[arg-type]
    error = np.random.default_rng(seed).standard_normal((2, points, 2, 2)) * NOISE / np.sqrt(2.0)
    matrix = y.matrix_s * (1.0 + error[0] + 1j * error[1])
    matrix[:, 1, 0] = matrix[:, 0, 1]
    return pr.Spectrum.from_admittance(y.frequency_hz, matrix, source=f"{state}.csv")


def deviations(found: MotorFrom, truth: pr.Motor) -> dict[str, float]:
    """Every value with an error: deviation from the truth over the error."""
    scores = {}
    for path, error in found.standard_errors.items():
        here: Any = found.motor.to_dict()
        there: Any = truth.to_dict()
        for key in path.split("."):
            place: Any = int(key) if isinstance(here, list) else key
            here, there = here[place], there[place]
        scores[path] = (here - there) / error
    return scores


def test_spectra_and_a_known_mass_make_a_motor_with_errors_and_origins(tmp_path: Path) -> None:
    truth = invented()
    tips = [(mode.tip_x, mode.tip_y) for mode in truth.modes]
    found = pr.motor_from(measured(truth, 200, 1), mass_kg=truth.modes[0].mass_kg, tips=tips, modes=2)
    assert max(map(abs, deviations(found, truth).values())) < 4.0
    json.dumps(found.to_dict(), allow_nan=False)
    again = pr.load_motor(found.save(tmp_path / "mine.toml"))
    assert again.to_dict() == found.motor.to_dict()
    assert "standard error" in again.provenance["modes.0.coupling_a_n_per_v"].note
    assert again.provenance["contact.friction"].kind == "assumed"


def comes_back(truth: pr.Motor, name: str, seed: int) -> None:
    """Check a motor that was made of noisy spectra and a noisy data sheet against the one that was measured."""
    drive, band = SHEETS[name]
    factors = 1.0 + SHEET_ERROR * np.random.default_rng(100 + seed).standard_normal(2)
    found = pr.motor_from(
        measured(truth, 600, seed, band), preloaded=measured(truth, 600, 1000 + seed, band, "preloaded"),
        voltage=drive.voltage, frequency=drive.frequency, phase_deg=drive.phase_deg,
        no_load_speed=factors[0] * pr.steady_state(truth, drive, load_torque=0.0).speed_rad_s,
        stall_torque=factors[1] * pr.steady_state(truth, drive, speed=0.0).torque_n_m,
        speed_error=SHEET_ERROR, torque_error=SHEET_ERROR, base=name,
    )  # fmt: skip
    scores = deviations(found, truth)
    assert max(map(abs, scores.values())) < 4.0, scores
    for quantity, value in found.measured.items():
        assert found.computed[quantity] == pytest.approx(value, rel=3.0 * SHEET_ERROR)
    assert found.motor.mount == truth.mount


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", SHEETS)
def test_a_motor_comes_back_from_its_spectra_and_its_data_sheet_within_its_errors(name: str, seed: int) -> None:
    comes_back(invented(name), name, seed)


@pytest.mark.soak
@pytest.mark.parametrize(("mass", "friction"), [(0.7, 1.2), (1.4, 0.7)])
def test_a_motor_far_from_the_other_one_comes_back_too(mass: float, friction: float) -> None:
    comes_back(invented("andersen2002", mass, friction), "andersen2002", 1)


@pytest.mark.soak
def test_the_command_writes_the_motor_and_a_page_with_data_and_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth, (drive, _) = invented(), SHEETS["andersen2002"]
    file = measured(truth, 200, 1).save(tmp_path / "free.csv")
    mine, page = tmp_path / "mine.toml", tmp_path / "mine.html"
    words = ["motor-from", file, "--modes", 2, "--mass-kg", truth.modes[0].mass_kg, "--no-load-speed", 18.0]
    words += ["--voltage", drive.voltage, "--frequency", drive.frequency, "--output", mine, "--page", page]
    assert run(list(map(str, words))) == 0
    assert "modes.1.coupling_b_n_per_v" in capsys.readouterr().out
    made = pr.load_motor(mine)
    assert made.mount == truth.mount
    assert pr.default_drive(made) == drive
    text = page.read_text(encoding="utf-8")
    assert "free.csv" in text
    assert '"name":"measured"' in text.replace('": "', '":"')


def test_tips_are_those_of_the_other_motor_for_one_modal_mass() -> None:
    """The modes of beam40 have masses of 3.3 and 117 g, in coordinates of their own."""
    base = pr.load_motor("beam40")
    free = measured(base, 300, 1, SHEETS["beam40"][1])
    fit = pr.fit_two_port(free, 2)
    tips = _tips(fit, base)
    assert tips is not None
    made = fit.to_motor(mass_kg=base.modes[0].mass_kg, tips=tips, base=base)
    for here, there in zip(made.modes, base.modes, strict=True):  # the same motion of the tip at the same voltage
        for group in "ab":
            key = f"coupling_{group}_n_per_v"
            one, other = (
                getattr(mode, key) / mode.mass_kg * np.array([mode.tip_x, mode.tip_y]) for mode in (here, there)
            )
            assert one == pytest.approx(other, rel=5e-3, abs=1e-9)
    assert made.mount == base.mount
    assert _tips(fit, pr.load_motor("beam40").updated({"modes.0.coupling_b_n_per_v": -0.01})) is None


def test_what_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = measured(invented(), 60, 1).save(tmp_path / "free.csv")
    assert run(["motor-from", str(file)]) == 2
    assert "Give the no-load speed, or mass_kg." in " ".join(capsys.readouterr().err.split())
    assert run(["motor-from", str(file), "--no-load-speed", "3"]) == 2
    assert "give its voltage and its frequency too" in " ".join(capsys.readouterr().err.split())
