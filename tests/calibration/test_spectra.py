# SPDX-License-Identifier: GPL-3.0-or-later
"""Drift and softening from spectra at several temperatures and levels, against Duffing's closed form and ngspice."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.spectra import added
from pyspice_runner.cli import run
from pyspice_runner.impedance.spectrum import Spectrum
from tools.benches.duffing import amplitudes
from validation import calibration as study

MOTOR = study.base()
DRIFT = pr.Thermal(frequency_drift_per_k=-2.5e-4, coupling_drift_per_k=6e-4, capacitance_drift_per_k=3e-3)
TEMPERATURES = (20.0, 40.0, 60.0)
LEVELS = (1.0, 60.0, 120.0)  # V
BAND, POINTS = (41e3, 55e3), 121
NOISE = 0.01
MODE = MOTOR.modes[0]
AMPLITUDE = abs(MODE.coupling_a_n_per_v) * LEVELS[-1] * MODE.quality_factor / MODE.stiffness_n_per_m
# the resonance leans by half of its bandwidth at the greatest level, and its losses grow by a quarter
SOFT = {
    "modes.0.softening_per_m2": 0.5 * 8.0 / 3.0 / MODE.quality_factor / AMPLITUDE**2,
    "modes.0.damping_growth_per_m2": 0.25 * 4.0 / AMPLITUDE**2,
}


def soft_arm(frequency: np.ndarray[Any, Any], motor: pr.Motor, level: float) -> np.ndarray[Any, Any]:
    """What the amplitude adds to the admittance of group A, by the bench's roots of Duffing's equation."""
    mode = motor.modes[0]
    coupling, found = mode.coupling_a_n_per_v, []
    for one in frequency:
        omega = 2.0 * np.pi * one
        linear = mode.stiffness_n_per_m - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m
        a = min(amplitudes(mode, abs(coupling) * level, float(one)))  # reached with rising frequency
        soft = linear - 0.75 * mode.softening_per_m2 * a**2 * mode.stiffness_n_per_m
        soft += 0.25j * omega * mode.damping_n_s_per_m * mode.damping_growth_per_m2 * a**2
        found.append(1j * omega * coupling**2 * (1.0 / soft - 1.0 / linear))
    return np.array(found)


def measured(motor: pr.Motor, seed: int, level: float = 0.0) -> Spectrum:
    """A spectrum of the free stator with noise."""
    linear = motor.updated(dict.fromkeys(SOFT, 0.0))
    clean = pr.admittance(linear, start=BAND[0], stop=BAND[1], points=POINTS, state="free")
    values = clean.driven("A") + (soft_arm(clean.frequency_hz, motor, level) if level else 0.0)
    noise = np.random.default_rng(seed).standard_normal((2, POINTS))
    values = values + NOISE * np.abs(values) * (noise[0] + 1j * noise[1])
    return Spectrum.from_admittance(clean.frequency_hz, values, source=f"{seed}.csv")


@pytest.mark.soak
def test_spectra_at_temperatures_and_levels_give_back_drift_and_softening(tmp_path: Path) -> None:
    truth = MOTOR.updated(SOFT | {"modes.0.quality_factor": 0.9 * MODE.quality_factor})
    drifts = {f"thermal.{key}": value for key, value in DRIFT.model_dump().items() if "drift" in key}
    spectra: list[Any] = [
        (measured(DRIFT.warmed(truth, warm - TEMPERATURES[0]), seed), "free", {"temperature": warm})
        for seed, warm in enumerate(TEMPERATURES)
    ]
    spectra += [
        (measured(truth, 10 + seed, level), "free", {"temperature": TEMPERATURES[0], "level": level})
        for seed, level in enumerate(LEVELS)
    ]
    result = pr.calibrate(MOTOR, free=[*drifts, *SOFT, "modes.0.quality_factor"], spectra=spectra)
    wanted = drifts | SOFT | {"modes.0.quality_factor": 0.9 * MODE.quality_factor}
    for one in result.estimates:
        assert one.identifiable, one.path
        assert abs(one.value - wanted[one.path]) < 4.0 * one.standard_error, one.path  # one in 16,000 by chance
    # 1452 parts of 1 % noise: the mean square is 1 within four of its standard deviations
    assert result.rms_residual**2 == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 1452))
    assert result.thermal.frequency_drift_per_k == pytest.approx(DRIFT.frequency_drift_per_k, rel=0.05)
    text = result.save(tmp_path / "calibrated.toml").read_text(encoding="utf-8")
    assert "thermal.frequency_drift_per_k = -0.000" in text
    assert pr.load_motor(tmp_path / "calibrated.toml").modes[0].softening_per_m2 > 0.0


def test_two_temperatures_and_a_level_give_back_a_drift_and_a_softening() -> None:
    truth = MOTOR.updated({"modes.0.softening_per_m2": SOFT["modes.0.softening_per_m2"]})
    wanted = {"thermal.frequency_drift_per_k": -2.5e-4, "modes.0.softening_per_m2": truth.modes[0].softening_per_m2}
    drift = pr.Thermal(frequency_drift_per_k=-2.5e-4)
    spectra = [
        (measured(drift.warmed(truth, warm - 20.0), seed, level), "free", {"temperature": warm, "level": level})
        for seed, (warm, level) in enumerate([(20.0, LEVELS[-1]), (60.0, LEVELS[0])])
    ]
    result = pr.calibrate(MOTOR, free=list(wanted), spectra=spectra)
    for one in result.estimates:
        assert one.identifiable, one.path
        assert abs(one.value - wanted[one.path]) < 4.0 * one.standard_error, one.path  # one in 16,000 by chance


@pytest.mark.soak
def test_the_admittance_at_a_level_is_that_of_the_steady_state() -> None:
    motor = MOTOR.updated(SOFT)
    for frequency in (0.985 * MODE.frequency_hz, 0.995 * MODE.frequency_hz, 1.01 * MODE.frequency_hz):
        currents = []
        for own in (motor, MOTOR):
            drive = pr.TwoPhaseDrive(voltage=LEVELS[-1], frequency=frequency, ratio_b=0.01)
            state = pr.steady_state(own, drive, speed=0.0, contact=None)
            waves = state.waveforms
            turn = np.exp(-2j * np.pi * frequency * (waves.time_s - waves.time_s[0]))
            phasors = [np.trapezoid(one * turn, waves.time_s) for one in (waves.current_a_a, waves.voltage_a_v)]
            currents.append(phasors[0] / phasors[1])
        own = added(motor, np.array([frequency]), "A", LEVELS[-1])[0]
        # group B has a hundredth of the voltage in quadrature, so that the phase of the force is off by 1e-2, and with
        # it that of what softening adds; the harmonics have γ a²/32 = 3e-4, the two steady states 2e-3 of the current
        assert currents[0] - currents[1] == pytest.approx(own, abs=2e-3 * abs(currents[0]) + 1e-2 * abs(own))


@pytest.mark.parametrize(
    ("conditions", "free", "told"),
    [
        ({"temprature": 20.0}, "contact.friction", "Did you mean 'temperature'?"),
        ({"temperature": "warm"}, "contact.friction", "temperature = 'warm' is not valid"),
        ({"temperature": -300.0}, "contact.friction", "must be a number >= -273.15"),
        ({"level": 0.0}, "contact.friction", "level = 0 is not valid"),
        (40.0, "contact.friction", "the conditions 40 are not valid"),
        (
            {"level": 1.0},
            "thermal.frequency_drift_per_k",
            "A drift takes spectra, points or run-ups at temperatures that differ",
        ),
        ({"level": 1.0}, "thermal.drift", "is not a drift"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(conditions: Any, free: str, told: str) -> None:
    spectrum = Spectrum.from_admittance(np.array([1e3, 2e3]), np.array([1e-3, 1e-3], complex))
    with pytest.raises(pr.ParameterError, match=told.replace("?", r"\?")):
        pr.calibrate(MOTOR, free=[free], spectra=[(spectrum, "free", conditions)])


def test_a_temperature_of_some_spectra_and_a_level_on_the_rotor_are_refused() -> None:
    spectrum = Spectrum.from_admittance(np.array([1e3, 2e3]), np.array([1e-3, 1e-3], complex))
    with pytest.raises(pr.ParameterError, match="spectrum 2 has no temperature, 1 of 2"):
        pr.calibrate(MOTOR, free=["contact.friction"], spectra=[
            (spectrum, "free", {"temperature": 20.0}), (spectrum, "free")])  # fmt: skip
    with pytest.raises(pr.ParameterError, match="level goes with a free stator"):
        pr.calibrate(MOTOR, free=["contact.friction"], spectra=[(spectrum, "preloaded", {"level": 1.0})])


@pytest.mark.parametrize(("words", "told"), [
    ("free=a.csv@temperature=warm", "write the conditions as"),
    ("free=a.csv@temperature=1,temperature=2", "gives temperature twice"),
])  # fmt: skip
def test_the_command_refuses_malformed_conditions(words: str, told: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["calibrate", "bimodal40", "--spectrum", words, "--free", "contact.friction"]) == 2
    assert told in " ".join(capfd.readouterr().err.split())


@pytest.mark.soak
def test_the_command_takes_temperatures_and_levels(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    motor = tmp_path / "motor.toml"
    motor.write_text(MOTOR.to_toml(), encoding="utf-8")
    words = ["calibrate", str(motor), "--free", "thermal.frequency_drift_per_k,modes.0.softening_per_m2", "--json"]
    for warm, level in ((20.0, 1.0), (60.0, 120.0)):
        file = measured(DRIFT.warmed(MOTOR.updated(SOFT), warm - 20.0), int(warm), level).save(tmp_path / f"{warm}.csv")
        words += ["--spectrum", f"free={file}@temperature={warm},level={level}"]
    assert run(words) == 0
    assert "thermal.frequency_drift_per_k" in capfd.readouterr().out
