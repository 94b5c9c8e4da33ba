# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra at several drive levels and temperatures, fitted together; the truth is Duffing's closed form."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.export.circuit import circuit_library
from pyspice_runner.impedance.joint_fit import JointFit
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.motor.parameters import Mode
from pyspice_runner.spice.ngspice import run_deck
from tests.resonators import fitted, resonator, spectrum
from tests.said import output, refusal
from tools.benches.duffing import amplitudes, folds

NOISE = 1e-3
COUPLING = 0.1
CAPACITANCE = 2e-9
VOLTAGES = [5.0, 40.0, 80.0]


def mode(softening: float, growth: float) -> Mode:
    """A mode of 20 kHz and a Q of 200, which moves 10 µm at 80 V."""
    stiffness = 0.01 * (2.0 * np.pi * 20e3) ** 2
    return Mode(
        name="soft", mass_kg=0.01, damping_n_s_per_m=np.sqrt(stiffness * 0.01) / 200.0, stiffness_n_per_m=stiffness,
        coupling_a_n_per_v=COUPLING, coupling_b_n_per_v=0.0, tip_x=0.0, tip_y=1.0, softening_per_m2=softening,
        damping_growth_per_m2=growth,
    )  # fmt: skip


def measured(soft: Mode, voltage: float, seed: int, loss_tangent: float = 0.0) -> pr.Spectrum:
    """A sweep with rising frequency at one voltage; the clamped capacitance is a constant-phase element."""
    frequency = np.linspace(19e3, 21.5e3, 301)
    omega = 2.0 * np.pi * frequency
    square = np.array([amplitudes(soft, COUPLING * voltage, float(f))[0] for f in frequency]) ** 2
    stiffness = soft.stiffness_n_per_m * (1.0 - 0.75 * soft.softening_per_m2 * square)
    damping = soft.damping_n_s_per_m * (1.0 + 0.25 * soft.damping_growth_per_m2 * square)
    receptance = 1.0 / (stiffness - soft.mass_kg * omega**2 + 1j * omega * damping)
    # by Kramers' and Kronig's relation a constant loss tangent takes a capacitance that falls with frequency
    clamped = CAPACITANCE * (1j * frequency / 20e3) ** (-2.0 / np.pi * np.arctan(loss_tangent))
    y = 1j * omega * (COUPLING**2 * receptance + clamped)
    error = np.random.default_rng(seed).standard_normal((2, len(omega))) * NOISE / np.sqrt(2.0)
    return pr.Spectrum.from_admittance(frequency, y * (1.0 + error[0] + 1j * error[1]))


def scores(found: JointFit, soft: Mode) -> list[float]:
    """Deviations over their errors of the one arm."""
    (arm,) = found.arms
    truth = {
        "resistance_ohm": soft.damping_n_s_per_m / COUPLING**2,
        "inductance_h": soft.mass_kg / COUPLING**2,
        "capacitance_f": COUPLING**2 / soft.stiffness_n_per_m,
        "softening_per_c2": soft.softening_per_m2 / COUPLING**2,
        "damping_growth_per_c2": soft.damping_growth_per_m2 / COUPLING**2,
    }
    return [(getattr(arm, name) - value) / arm.standard_errors[name] for name, value in truth.items()]


@pytest.mark.parametrize(("softening", "growth"), [(6e7, 4e9), (0.0, 0.0)])
def test_levels_give_the_softening_and_the_losses_of_the_ceramic(softening: float, growth: float) -> None:
    """At 80 V the resonance is 0.2 % lower, by 0.4 of its bandwidth, and Q by 8 %; the curve is single-valued."""
    soft = mode(softening, growth)
    found = pr.fit_spectrum(
        [measured(soft, voltage, seed) for seed, voltage in enumerate(VOLTAGES)], voltages=VOLTAGES, modes=1
    )
    assert max(map(abs, scores(found, soft))) < 4.0
    assert max(found.rms_relative_error) == pytest.approx(NOISE, rel=0.1)
    (arm,) = found.arms
    of_mode = arm.of_mode(COUPLING)
    if softening:
        assert of_mode == {
            "softening_per_m2": pytest.approx(softening, rel=0.05),
            "damping_growth_per_m2": pytest.approx(growth, rel=0.05),
        }
    assert found.cautions == ()
    json.dumps(found.to_dict(), allow_nan=False)
    assert "softening" in " ".join(found.summary())


@pytest.mark.soak
def test_a_resonance_skewed_within_a_sweep_has_a_caution_and_its_level_gives_the_softening() -> None:
    soft = mode(6e7, 4e9)
    skewed = measured(soft, 80.0, 1)
    assert any("is skewed by the amplitude" in caution for caution in pr.fit_spectrum(skewed).cautions)
    for straight in (measured(soft, 5.0, 1), measured(mode(0.0, 0.0), 80.0, 1)):
        assert not pr.fit_spectrum(straight).cautions
    found = pr.fit_spectrum([skewed], voltages=[80.0], modes=1)
    assert max(map(abs, scores(found, soft))) < 4.0
    assert not found.cautions


def test_one_sweep_gives_the_softening_of_a_ceramic_with_a_loss_tangent() -> None:
    # the fit without softening, from which this one starts, takes the loss for another one
    soft = mode(6e7, 4e9)
    found = pr.fit_spectrum([measured(soft, 80.0, 1, loss_tangent=0.02)], voltages=[80.0], modes=1)
    assert max(map(abs, scores(found, soft))) < 4.0
    assert found.rms_relative_error[0] == pytest.approx(NOISE, rel=0.1)


def test_a_sweep_that_jumps_is_followed() -> None:
    soft = mode(4e8, 0.0)
    jumps = folds(soft, COUPLING * 80.0, 19e3, 20.5e3)
    assert jumps[1] - jumps[0] > 50.0  # Hz in which three amplitudes are possible, of points 8 Hz apart
    found = pr.fit_spectrum(
        [measured(soft, volts, seed) for seed, volts in enumerate((5.0, 80.0))], voltages=[5.0, 80.0], modes=1
    )
    assert max(map(abs, scores(found, soft))) < 4.0


def test_temperatures_give_the_drifts_of_thermal() -> None:
    truth = {"frequency_drift_per_k": -1.6e-4, "coupling_drift_per_k": 1e-3, "capacitance_drift_per_k": 4e-3}
    spectra, kelvin = [], [20.0, 40.0, 60.0]
    for seed, at in enumerate(kelvin):
        f, theta, c0 = (
            value * np.exp(drift * (at - 20.0)) for value, drift in zip((20e3, 1.0, 1e-9), truth.values(), strict=True)
        )
        # the mass stays: C1 = θ²/k goes with (θ/f)²
        ratio = 0.05 * (theta * 20e3 / f) ** 2 * 1e-9 / c0
        circuit = resonator([f], [120.0], [ratio], capacitance=c0)
        spectra.append(spectrum(circuit, np.linspace(17e3, 24e3, 401), noise=NOISE, seed=seed))
    found = pr.fit_spectrum(spectra, temperatures=kelvin, modes=1)
    for name, value in truth.items():
        assert abs(found.drifts[name] - value) < 4.0 * found.standard_errors[name], name
    assert abs(found.drifts["quality_drift_per_k"]) < 4.0 * found.standard_errors["quality_drift_per_k"]
    assert found.arms[0].softening_per_c2 == 0.0
    assert pr.Thermal(**{name: found.drifts[name] for name in truth}).frequency_drift_per_k < 0.0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({}, "with voltages or temperatures that differ"),
        ({"voltages": [1.0, 1.0]}, "with voltages or temperatures that differ"),
        ({"voltages": [1.0]}, "voltages has 1 values for 2 spectra"),
        ({"voltages": [1.0, -1.0]}, "they must be numbers > 0 V"),
    ],
)
def test_refused_levels(arguments: dict[str, list[float]], says: str) -> None:
    linear = [measured(mode(0.0, 0.0), 1.0, seed) for seed in range(2)]
    with pytest.raises(pr.ParameterError, match=says):
        pr.fit_spectrum(linear, **arguments)


def test_the_command_fits_spectra_at_several_levels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    soft = mode(6e7, 0.0)
    files = [measured(soft, volts, seed).save(tmp_path / f"{volts:g}.csv") for seed, volts in enumerate(VOLTAGES)]
    words = ["fit", files[0], "--with", files[1], "--with", files[2], "--voltages", "5,40,80", "--modes", 1]
    assert "softening per c2" in output([*map(str, words), "--output", str(tmp_path / "joint.json")], capsys)
    (arm,) = json.loads((tmp_path / "joint.json").read_text(encoding="utf-8"))["arms"]
    assert arm["softening_per_c2"] == pytest.approx(6e7 / COUPLING**2, rel=0.05)
    assert "at least two spectra" in " ".join(refusal([*map(str, words[:2]), "--temperatures", "20"], capsys).split())


@pytest.mark.parametrize("option", ["--noise", "--leads", "--timeout"])
def test_an_option_of_a_single_spectrum_is_an_error(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    value = {"--noise": "proportional=0.1%", "--leads": "20nH,0.1ohm", "--timeout": "10"}[option]
    file = str(measured(mode(0.0, 0.0), 1.0, 0).save(tmp_path / "one.csv"))
    assert run(["fit", file, "--with", file, "--voltages", "5,40", option, value]) == 2
    assert f"{option} has no effect on spectra that are fitted together" in " ".join(capsys.readouterr().err.split())


# --- arms that share losses: passivity by closed form, and the exported library in ngspice, AC and transient ---


ARMS = (
    MotionalArm(120.0, 0.0513, 1.0 / (0.0513 * (2 * np.pi * 111.4e3) ** 2)),
    MotionalArm(112.0, 0.0511, 1.0 / (0.0511 * (2 * np.pi * 112.7e3) ** 2)),
    MotionalArm(300.0, 0.12, 1.0 / (0.12 * (2 * np.pi * 114.1e3) ** 2)),
)
SHARED = EquivalentCircuit(
    ARMS, 1.5e-9, 0.012, 112.5e3, loss_tangent_falling=0.002, loss_tangent_rising=0.003,
    shared_losses=((0.5, 9.0, -6.0, 12.0), (0.0, -3.0, 5.0, 4.0)),
)  # fmt: skip
BAND = np.linspace(108e3, 118e3, 801)


def matrix_admittance(circuit: EquivalentCircuit, frequency: np.ndarray) -> np.ndarray:
    """Y by the full impedance matrix of the arms and the clamped capacitance."""
    found = []
    for s in 2j * np.pi * frequency:
        clamped = circuit.loss_conductance_s + sum(s * c / (1 + s * r * c) for r, c in circuit.dielectric())
        own = [circuit.loss_resistance_ohm + 1.0 / clamped]
        for arm, ohm in zip(circuit.arms, circuit.own_resistance_ohm, strict=True):
            own.append(ohm + s * arm.inductance_h + 1.0 / (s * arm.capacitance_f))
        weights = np.array(circuit.shared_losses)
        found.append(np.linalg.inv(np.diag(own) + weights.T @ weights).sum())
    return np.array(found)


def test_the_admittance_is_that_of_the_impedance_matrix() -> None:
    assert SHARED.device_admittance(BAND) == pytest.approx(matrix_admittance(SHARED, BAND), rel=1e-12)


def test_the_conductance_is_positive_from_direct_current_to_1_ghz() -> None:
    """By closed form Re Y is a sum of squares; here on a grid that is finer than the resonances."""
    assert min(SHARED.own_resistance_ohm) > 0.0
    assert np.linalg.eigvalsh(np.array(SHARED.damping_matrix)).min() > 0.0
    wide = np.concatenate([np.geomspace(1e-3, 1e9, 40_001), np.linspace(100e3, 125e3, 20_001)])
    assert SHARED.admittance(wide).real.min() >= 0.0


def test_the_library_has_the_admittance_of_the_fit() -> None:
    """:func:`tests.resonators.fitted` runs the library in ngspice and compares it to a millionth."""
    fit = fitted(pr.Spectrum.from_admittance(BAND, SHARED.admittance(BAND)), 3)
    assert fit.circuit.shared_losses
    assert fit.rms_relative_error < 2e-3
    document = fit.to_dict()
    assert np.shape(document["damping_matrix"]) == (3, 3)
    assert document["leads"] is None


@pytest.mark.soak
def test_an_arm_of_a_stated_number_may_lie_far_from_the_band() -> None:
    """The fourth arm is at 190 kHz, the band ends at 118 kHz; the error was 0.07 % with arms of up to 120.5 kHz."""
    beyond = MotionalArm(9e3, 0.1, 1.0 / (0.1 * (2 * np.pi * 190e3) ** 2))
    device = replace(SHARED, arms=(*ARMS, beyond), shared_losses=((0.5, 9.0, -6.0, 12.0, 20.0),))
    fit = fitted(pr.Spectrum.from_admittance(BAND, device.admittance(BAND)), 4)
    assert sum(not arm.in_band for arm in fit.arms) == 1
    assert fit.rms_relative_error < 5e-5
    assert fit.main_arm.quality_factor == pytest.approx(
        max(ARMS, key=lambda arm: arm.capacitance_f).quality_factor, rel=0.01
    )


def oscillation(circuit: EquivalentCircuit, periods: int) -> np.ndarray:
    """The current after a step of 1 V, over so many periods of the slowest arm, 20 points each."""
    period = 1.0 / circuit.arms[0].series_resonance_hz
    deck = "\n".join(
        [
            "a step",
            circuit_library(circuit),
            f"Vdrive a 0 PWL(0 0 {period!r} 1)",
            "Xdevice a 0 resonator",
            f".tran {period / 20!r} {periods * period!r} 0 {period / 20!r} uic",
            ".save i(vdrive)",
            ".end",
        ]
    )
    return run_deck(deck, vectors=["i(vdrive)"], stop_time=periods * period).raw.vectors["i(vdrive)"].real


def decays(periods: int) -> None:
    """Check that the current is largest in the beginning and ends at nothing."""
    # what flows through the conductance in parallel for ever is not part of it
    current = np.abs(oscillation(SHARED, periods) + SHARED.loss_conductance_s)
    begin, end = current[: len(current) // 20].max(), current[-len(current) // 20 :].max()
    assert np.isfinite(current).all()
    assert end < 0.01 * begin


def test_the_current_after_a_step_dies_away() -> None:
    decays(2000)


@pytest.mark.soak
def test_the_current_after_a_step_dies_away_over_100000_periods() -> None:
    decays(100_000)
