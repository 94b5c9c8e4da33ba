# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor invented here, measured with noise, comes back from its spectra and its data sheet."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.analysis.motor_from import MotorFrom
from pyspice_runner.cli import run

NOISE = 1e-3
SHEET_ERROR = 0.01
MASS = 2.6e-3


def invented() -> pr.Motor:
    """The paper's motor with other masses, friction and contact, at its own frequencies."""
    base = pr.load_motor("andersen2002")
    stiffness = 0.9 * base.contact.normal_stiffness_n_per_m15
    changed = base.updated({"contact.friction": 0.25, "contact.normal_stiffness_n_per_m15": stiffness})
    changed = changed.updated({f"modes.{index}.mass_kg": MASS for index in (0, 1)})
    return changed.updated({f"modes.{index}.frequency_hz": base.modes[index].frequency_hz for index in (0, 1)})


def measured(motor: pr.Motor, points: int, seed: int) -> pr.Spectrum:
    """The two-port of the free stator with proportional noise; it stays reciprocal."""
    y = pr.admittance(motor, start=8e3, stop=90e3, points=points)
    error = np.random.default_rng(seed).standard_normal((2, points, 2, 2)) * NOISE / np.sqrt(2.0)
    matrix = y.matrix_s * (1.0 + error[0] + 1j * error[1])
    matrix[:, 1, 0] = matrix[:, 0, 1]
    return pr.Spectrum.from_admittance(y.frequency_hz, matrix, source="free.csv")


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
    found = pr.motor_from(measured(truth, 200, 1), mass_kg=MASS, tips=tips, modes=2)
    assert max(map(abs, deviations(found, truth).values())) < 4.0
    json.dumps(found.to_dict(), allow_nan=False)
    again = pr.load_motor(found.save(tmp_path / "mine.toml"))
    assert again.to_dict() == found.motor.to_dict()
    assert "standard error" in again.provenance["modes.0.coupling_a_n_per_v"].note
    assert again.provenance["contact.friction"].kind == "assumed"


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(5))
def test_a_motor_comes_back_from_its_spectra_and_its_data_sheet_within_its_errors(seed: int) -> None:
    truth = invented()
    drive = pr.TwoPhaseDrive(voltage=300.0, frequency=54e3, phase_deg=90.0)
    rng = np.random.default_rng(100 + seed)
    factors = 1.0 + SHEET_ERROR * rng.standard_normal(2)
    pressed = pr.admittance(truth, start=8e3, stop=90e3, points=600, state="preloaded")
    error = rng.standard_normal((2, 600)) * NOISE / np.sqrt(2.0)
    preloaded = pr.Spectrum.from_admittance(
        pressed.frequency_hz, pressed.driven("A") * (1.0 + error[0] + 1j * error[1])
    )
    found = pr.motor_from(
        measured(truth, 600, seed), preloaded=preloaded, voltage=300.0, frequency=54e3,
        no_load_speed=factors[0] * pr.steady_state(truth, drive, load_torque=0.0).speed_rad_s,
        stall_torque=factors[1] * pr.steady_state(truth, drive, speed=0.0).torque_n_m,
        speed_error=SHEET_ERROR, torque_error=SHEET_ERROR, tips=[(mode.tip_x, mode.tip_y) for mode in truth.modes],
    )  # fmt: skip
    scores = deviations(found, truth)
    assert max(map(abs, scores.values())) < 4.0
    for name, value in found.measured.items():
        assert found.computed[name] == pytest.approx(value, rel=3.0 * SHEET_ERROR)


def test_what_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = measured(invented(), 60, 1).save(tmp_path / "free.csv")
    assert run(["motor-from", str(file)]) == 2
    assert "Give the no-load speed, or mass_kg." in " ".join(capsys.readouterr().err.split())
    assert run(["motor-from", str(file), "--no-load-speed", "3"]) == 2
    assert "give its voltage and its frequency too" in " ".join(capsys.readouterr().err.split())
