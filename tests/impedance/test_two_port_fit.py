# SPDX-License-Identifier: GPL-3.0-or-later
"""From the spectra of both groups back to the motor that they were computed from."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.spectrum import Connection
from pyspice_runner.impedance.two_port_fit import _VALUES, TwoPortFit, _Problem, fit_groups
from tests.selection import mostly
from validation import faults

pytestmark = pytest.mark.xdist_group("two-port")  # the fit is shared

CONNECTIONS = get_args(Connection)
CHANGES = {  # groups that differ in size and coupling, one mode driven alike, one against each other
    "modes.0.coupling_b_n_per_v": 0.05,
    "modes.1.coupling_b_n_per_v": -0.12,
    "piezo.capacitance_b_f": 5e-9,
}


@pytest.fixture(scope="module")
def motor() -> pr.Motor:
    return pr.load_motor("andersen2002").updated(CHANGES)


@pytest.fixture(scope="module")
def two_port(motor: pr.Motor) -> pr.Spectrum:
    result = pr.admittance(motor, start=8e3, stop=70e3, points=1200)
    return pr.Spectrum.from_admittance(result.frequency_hz, result.matrix_s, source="stator.s2p")


@pytest.fixture(scope="module")
def fitted(two_port: pr.Spectrum) -> TwoPortFit:
    return pr.fit_spectrum(two_port)


def noisy(spectrum: pr.Spectrum, seed: int, name: str) -> pr.Spectrum:
    error = np.random.default_rng(seed).standard_normal((2, len(spectrum))) * 0.01 / np.sqrt(2.0)
    y = spectrum.admittance_s * (1.0 + error[0] + 1j * error[1])
    return pr.Spectrum.from_admittance(spectrum.frequency_hz, y, source=name)


def truth(motor: pr.Motor) -> np.ndarray:
    return np.array(
        [
            value
            for mode in motor.modes
            for value in (
                mode.frequency_hz,
                mode.quality_factor,
                mode.coupling_a_n_per_v / np.sqrt(mode.mass_kg),
                mode.coupling_b_n_per_v / np.sqrt(mode.mass_kg),
            )
        ]
    )


def found(fit: TwoPortFit) -> np.ndarray:
    return np.ravel([[getattr(mode, name) for name in _VALUES] for mode in fit.modes])


def test_couplings_come_back_with_their_signs(motor: pr.Motor, two_port: pr.Spectrum) -> None:
    fit = pr.fit_spectrum(two_port)
    assert found(fit) == pytest.approx(truth(motor), rel=1e-6)
    assert (fit.capacitance_a_f, fit.capacitance_b_f) == pytest.approx(
        (motor.piezo.capacitance_a_f, motor.piezo.capacitance_b_f), rel=1e-6
    )
    assert fit.cautions == ()


@pytest.mark.parametrize("left_out", [None, "A+B", "A-B"])
def test_one_ports_of_a_bench_do_as_well(motor: pr.Motor, two_port: pr.Spectrum, left_out: str | None) -> None:
    """Each connection swept by itself, with noise and over a range of its own."""
    ports = {}
    for index, name in enumerate(CONNECTIONS):
        if name != left_out:
            ports[name] = noisy(two_port.driven(name), index, f"{name}.csv").between(8e3 + 100 * index, 69e3)
    fit = pr.fit_spectrum(ports)
    errors = [error for mode in fit.modes for error in mode.standard_errors.values()]
    assert np.all(np.abs(found(fit) - truth(motor)) < 4.0 * np.array(errors))
    assert found(fit) == pytest.approx(truth(motor), rel=0.01)
    assert set(fit.rms_relative_error) == set(ports)
    assert list(fit.rms_relative_error.values()) == pytest.approx([0.01] * len(ports), rel=0.1)


@pytest.mark.parametrize("kind", ["mass_kg", "velocity_per_current"])
def test_a_calibrated_motor_is_the_one_measured(motor: pr.Motor, fitted: TwoPortFit, tmp_path: Path, kind: str) -> None:
    calibration = {
        "mass_kg": [mode.mass_kg for mode in motor.modes],
        # the tip moves with |tip| times the modal velocity, which takes θ times it in current
        "velocity_per_current": [np.hypot(mode.tip_x, mode.tip_y) / mode.coupling_a_n_per_v for mode in motor.modes],
    }[kind]
    tips = [(mode.tip_x, mode.tip_y) for mode in motor.modes]
    path = fitted.save(tmp_path / "motor.toml", **{kind: calibration}, tips=tips, name="again")
    again = pr.load_motor(path)
    for mode, expected in zip(again.modes, motor.modes, strict=True):
        for name in ("mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "coupling_a_n_per_v", "coupling_b_n_per_v"):
            assert getattr(mode, name) == pytest.approx(getattr(expected, name), rel=1e-6), name
    assert again.contact == motor.contact
    assert again.provenance["modes.0.coupling_a_n_per_v"].kind == "derived"
    assert again.provenance["contact.preload_n"].kind == "assumed"
    run = pr.simulate(again, pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3), duration=1e-4)
    assert run.time_s[-1] == pytest.approx(1e-4)


def test_one_calibration_stands_for_all_modes_and_says_so(fitted: TwoPortFit) -> None:
    made = fitted.to_motor(velocity_per_current=2.0, connection="A+B")
    assert made.modes[0].mass_kg == made.modes[1].mass_kg
    assert made.modes[0].coupling_a_n_per_v + made.modes[0].coupling_b_n_per_v == pytest.approx(0.5)
    assert [(mode.tip_x, mode.tip_y) for mode in made.modes] == [(0.0, 1.0), (1.0, 0.0)]
    assert "taken to be that of all" in made.provenance["modes.1.mass_kg"].note
    assert made.provenance["modes.1.tip_x"].kind == "assumed"


def test_a_transfer_that_is_not_reciprocal_has_a_caution(two_port: pr.Spectrum) -> None:
    matrix = two_port.matrix_s.copy()
    matrix[:, 0, 1] *= 1.2
    fit = pr.fit_spectrum(pr.Spectrum.from_admittance(two_port.frequency_hz, matrix))
    assert any("Y_AB and Y_BA differ by" in text for text in fit.cautions)


def test_connections_that_leave_the_couplings_open_are_refused(two_port: pr.Spectrum) -> None:
    one = two_port.driven("A")
    for spectra in ({}, {"A": one, "B": one}, {"A": one, "A+B": one}):
        with pytest.raises(pr.SpectrumError, match="give A, B, and A\\+B or A-B"):
            pr.fit_spectrum(spectra)  # type: ignore[arg-type]
    with pytest.raises(pr.ParameterError, match=r"an instance of Spectrum or 'A', 'B', 'A\+B' or 'A-B'"):
        pr.fit_spectrum({"A": one, "B": one, "A+B": one, "C": one})  # type: ignore[dict-item]
    with pytest.raises(pr.SpectrumError, match="has one port"):
        fit_groups(one)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({}, "give either mass_kg or velocity_per_current"),
        ({"mass_kg": 1e-3, "velocity_per_current": 1.0}, "give either mass_kg or velocity_per_current"),
        ({"mass_kg": -1.0}, "it must be a number > 0, or one for each of 2 modes"),
        ({"mass_kg": [1e-3, 1e-3, 1e-3]}, "or one for each of 2 modes"),
        ({"mass_kg": 1e-3, "tips": [(0.0, 1.0)]}, "tips has 1 entries for 2 modes"),
        ({"mass_kg": 1e-3, "connection": "B-A"}, "connection = 'B-A' is not valid"),
        ({"mass_kg": 1e-3, "base": "andersen2003"}, "Did you mean"),
        ({"mass_kg": 1e-3, "name": "*"}, "name"),
    ],
)
def test_refused_calibrations(fitted: TwoPortFit, arguments: dict[str, object], says: str) -> None:
    with pytest.raises(pr.ParameterError, match=says.replace("+", "\\+")):
        fitted.to_motor(**arguments)  # type: ignore[arg-type]


def test_a_mode_that_a_connection_does_not_drive_cannot_be_calibrated_by_it() -> None:
    result = pr.admittance(pr.load_motor("andersen2002"), start=8e3, stop=70e3, points=600)
    fit = pr.fit_spectrum(pr.Spectrum.from_admittance(result.frequency_hz, result.matrix_s))
    with pytest.raises(pr.ParameterError, match="Mode 2 takes no current through A\\+B"):
        fit.to_motor(velocity_per_current=[1.0, 1.0], connection="A+B")


# --- noise ---


def with_error(spectrum: pr.Spectrum, kind: str, sigma: float, rng: np.random.Generator) -> pr.Spectrum:
    """Add noise that is the same at all points in ln Y, in the reflection coefficient in 50 Ω, or in Z."""
    y = spectrum.admittance_s
    error = sigma / np.sqrt(2.0) * (rng.standard_normal(len(y)) + 1j * rng.standard_normal(len(y)))
    reflection = (1.0 - 50.0 * y) / (1.0 + 50.0 * y) + error
    changed = {
        "proportional": y * (1.0 + error),
        "s11": (1.0 - reflection) / (1.0 + reflection) / 50.0,
        "z": 1.0 / (1.0 / y + error),
    }
    return pr.Spectrum.from_admittance(spectrum.frequency_hz, changed[kind])


ERRORS = {"proportional": 3e-3, "s11": 3e-4, "z": 1.0}


def scores(two_port: pr.Spectrum, motor: pr.Motor, kind: str, seed: int) -> np.ndarray:
    """Fit noisy spectra of three connections; return the deviations over their errors."""
    rng = np.random.default_rng([list(ERRORS).index(kind), seed])
    names: tuple[Connection, ...] = ("A", "B", "A+B")
    spectra = {name: with_error(two_port.driven(name), kind, ERRORS[kind], rng) for name in names}
    fit = pr.fit_spectrum(spectra)
    assert len(fit.modes) == len(motor.modes)
    for noise in fit.noise.values():
        # of 1200 points: 2 % is its own deviation; another, smaller error may take a part
        assert noise[kind] == pytest.approx(ERRORS[kind], rel=0.1)
    error = np.array([value for mode in fit.modes for value in mode.standard_errors.values()])
    return (found(fit) - truth(motor)) / error


@pytest.mark.parametrize("kind", ERRORS)
def test_the_error_of_each_connection_is_estimated_and_no_mode_is_added(
    two_port: pr.Spectrum, motor: pr.Motor, kind: str
) -> None:
    assert np.abs(scores(two_port, motor, kind, 0)).max() < 4.0  # 1 of 16,000 values is farther off


@pytest.mark.soak
@pytest.mark.parametrize("kind", ERRORS)
def test_intervals_of_95_percent_hold_as_often_as_they_say(two_port: pr.Spectrum, motor: pr.Motor, kind: str) -> None:
    deviations = np.array([scores(two_port, motor, kind, seed) for seed in range(60)])
    assert 0.90 <= np.mean(np.abs(deviations) < 1.96) <= 0.98
    assert np.abs(deviations.mean(axis=0)).max() < 0.5


@pytest.mark.soak
def test_intervals_of_a_two_port_hold_as_often_as_they_say(two_port: pr.Spectrum, motor: pr.Motor) -> None:
    """Proportional noise in each entry of the matrix; the connections then have correlated errors."""
    piezo = motor.piezo
    wanted = np.append(truth(motor), [piezo.capacitance_a_f, piezo.capacitance_b_f, piezo.loss_tangent])
    deviations = []
    for seed in range(60):
        error = np.random.default_rng(seed).standard_normal((2, *two_port.matrix_s.shape)) * 2e-3 / np.sqrt(2.0)
        matrix = two_port.matrix_s * (1.0 + error[0] + 1j * error[1])
        fit = pr.fit_spectrum(pr.Spectrum.from_admittance(two_port.frequency_hz, matrix))
        here = np.append(found(fit), [fit.capacitance_a_f, fit.capacitance_b_f, fit.loss_tangent])
        each = [value for mode in fit.modes for value in mode.standard_errors.values()]
        own = [fit.standard_errors[name] for name in ("capacitance_a_f", "capacitance_b_f", "loss_tangent")]
        deviations.append((here - wanted) / np.append(each, own))
    assert 0.90 <= np.mean(np.abs(deviations) < 1.96) <= 0.98
    assert np.abs(np.mean(deviations, axis=0)).max() < 0.5


def test_a_spectrum_that_the_modes_do_not_follow_keeps_its_two_modes() -> None:
    fit = pr.fit_spectrum(pr.read_spectrum(Path(__file__).parents[1] / "data" / "spectra" / "two_port.s2p"))
    assert len(fit.modes) == 2  # both resonances of the file, although 44 to 85 % remain
    assert any("residuals of up to 85 %" in caution for caution in fit.cautions)


def test_the_capacitance_between_the_groups_is_that_of_the_motor_or_not_significant(two_port: pr.Spectrum) -> None:
    """Modes outside the band, from 30 to 50 kHz, add 1e-5 of it."""
    motor = pr.load_motor("bimodal40")
    swept = pr.admittance(motor, start=30e3, stop=50e3, state="free")
    fit = pr.fit_spectrum(pr.Spectrum.from_admittance(swept.frequency_hz, swept.matrix_s))
    assert fit.capacitance_ab_f == pytest.approx(motor.piezo.capacitance_ab_f, rel=1e-4)
    assert max(fit.rms_relative_error.values()) < 1e-5
    assert fit.to_motor(mass_kg=3e-3).piezo.capacitance_ab_f == fit.capacitance_ab_f
    rng = np.random.default_rng(6)
    noisy = {name: with_error(two_port.driven(name), "proportional", 3e-3, rng) for name in CONNECTIONS}
    assert pr.fit_spectrum(noisy).capacitance_ab_f == 0.0


def with_noise(frequency: np.ndarray, matrix: np.ndarray, noise: float, seed: int) -> pr.Spectrum:
    error = np.random.default_rng(seed).standard_normal((2, *matrix.shape)) * noise / np.sqrt(2.0)
    error[:, :, 1, 0] = error[:, :, 0, 1]
    return pr.Spectrum.from_admittance(frequency, matrix * (1.0 + error[0] + 1j * error[1]))


def beside_a_mode(noise: float, seed: int) -> np.ndarray:
    """Return deviations over their errors of the flagship in a band that ends 500 Hz above its mode at 36.5 kHz."""
    motor = pr.load_motor("bimodal40")
    swept = pr.admittance(motor, start=37e3, stop=43e3, points=601, state="free")
    fit = pr.fit_spectrum(with_noise(swept.frequency_hz, swept.matrix_s, noise, seed))
    assert fit.cautions == ()
    wanted = [truth(motor)[8:], [getattr(motor.piezo, name) for name in fit.standard_errors]]
    here = [found(fit), [getattr(fit, name) for name in fit.standard_errors]]
    errors = [[value for mode in fit.modes for value in mode.standard_errors.values()], [*fit.standard_errors.values()]]
    return (np.concatenate(here) - np.concatenate(wanted)) / np.concatenate(errors)


def test_a_mode_beside_the_band_does_not_move_those_within_it() -> None:
    assert np.abs(beside_a_mode(1e-3, 1)).max() < 4.0  # 25 for the capacitances without that mode


@pytest.mark.soak
@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_intervals_hold_beside_a_mode_outside_the_band(noise: float) -> None:
    assert 0.90 <= np.mean(np.abs([beside_a_mode(noise, seed) for seed in range(40)]) < 1.96) <= 0.98


def behind_leads(name: str, seed: int, *ohms: float) -> np.ndarray:
    """Return deviations over their errors of a motor behind resistances and 1 µH; no leads may be found without."""
    motor = faults.motor(name)
    swept = pr.admittance(motor, start=36e3, stop=44e3, points=500, state="free")
    jw = 2j * np.pi * swept.frequency_hz[:, None, None]
    ahead = np.diag(ohms or (0.0, 0.0)) + 1e-6 * bool(ohms) * jw * np.eye(2)
    matrix = np.linalg.inv(np.linalg.inv(swept.matrix_s) + ahead)
    fit = pr.fit_spectrum(with_noise(swept.frequency_hz, matrix, 1e-3, seed))
    assert list(fit.leads)[:2] == ["resistance_a_ohm", "resistance_b_ohm"][: len(ohms)]
    errors = [value for mode in fit.modes for value in mode.standard_errors.values()]
    wanted, here = [truth(motor)[-len(errors) :], ohms], [found(fit), list(fit.leads.values())[: len(ohms)]]
    errors += list(fit.lead_standard_errors.values())[: len(ohms)]
    return (np.concatenate(here) - np.concatenate(wanted)) / errors


def test_leads_in_front_of_each_group_are_not_part_of_the_modes() -> None:
    assert np.abs(behind_leads("bimodal40", 1, 2.0, 5.0)).max() < 4.0  # 70 for the quality factors without leads


@pytest.mark.soak
@pytest.mark.parametrize("ohms", [(), (2.0, 2.0), (5.0, 5.0), (114.0, 114.0)])
@pytest.mark.parametrize("name", ["bimodal40", "plate40"])
def test_intervals_hold_behind_leads(name: str, ohms: tuple[float, ...]) -> None:
    assert 0.90 <= np.mean(np.abs([behind_leads(name, seed, *ohms) for seed in range(20)]) < 1.96) <= 0.985


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, faults.MOTORS, ["bimodal40"]))
def test_a_resistance_in_front_of_a_pressed_stator_is_within_its_interval(name: str) -> None:
    """The losses of the contact couple the modes; a fit without them is off by 5 to 24 errors."""
    low, high = faults.MOTORS[name][2]
    swept = pr.admittance(faults.motor(name), start=low, stop=high, points=250, state="preloaded")
    matrix = np.linalg.inv(np.linalg.inv(swept.matrix_s) + 114.0 * np.eye(2))
    fit = pr.fit_spectrum(with_noise(swept.frequency_hz, matrix, 1e-3, 1))
    ohms, errors = (np.array([*one.values()][:2]) for one in (fit.leads, fit.lead_standard_errors))
    assert np.all((np.abs(ohms - 114.0) < 3.0 * errors) & (errors < 33.0))


def test_a_mode_that_is_stated_but_not_there_is_not_significant(two_port: pr.Spectrum) -> None:
    rng = np.random.default_rng(5)
    ports = {name: with_error(two_port.driven(name), "proportional", 3e-3, rng) for name in CONNECTIONS}
    problem = _Problem(ports, {"proportional": 3e-3}, 2)
    fitted = problem.descend(problem.start())
    assert problem.doubtful(fitted) is None
    invented = problem.descend(np.concatenate([fitted, [0.0, 4.0, 1e-4, 1e-4, 0.0, 0.0]]))
    assert problem.doubtful(invented) == len(fitted)


@pytest.mark.parametrize("flat", mostly(pytest.mark.soak, [False, True], [True]))
def test_intervals_hold_with_and_without_the_dispersion_of_the_loss(flat: bool) -> None:
    f = np.linspace(36e3, 46e3, 400)
    s, deviations = 2j * np.pi * f, []
    # by Kramers and Kronig a constant tangent takes C ~ f^(−2 δ/π); the capacitances are those at 100 kHz
    plates = s * (1.0 - 0.02j) * (1.0 if flat else (f / 100e3) ** (-2.0 / np.pi * np.arctan(0.02)))
    matrix = plates[:, None, None] * np.array([[1.3e-9, -0.5e-9], [-0.5e-9, 1.4e-9]])
    modes = ((39.6e3, 400.0, 1.5, 1.5), (40.5e3, 350.0, 1.1, -1.1), (43e3, 300.0, 0.6, 0.5))
    for frequency, quality, *theta in modes:
        w = 2.0 * np.pi * frequency
        matrix = matrix + (s / (s**2 + s * w / quality + w**2))[:, None, None] * np.outer(theta, theta)
    for seed in range(8):
        fit = pr.fit_spectrum(with_noise(f, matrix, 1e-3, seed))
        assert fit.loss_dispersion != flat
        deviations.append((found(fit) - np.ravel(modes)) / [v for m in fit.modes for v in m.standard_errors.values()])
    assert 0.90 <= np.mean(np.abs(deviations) < 1.96) <= 0.98
    # without dispersion C is the one of a motor in the middle of the band
    wanted = 1.3e-9 * (1.0 if not flat else np.sqrt(36 * 46 / 100**2) ** (2.0 / np.pi * np.arctan(0.02)))
    assert fit.capacitance_a_f == pytest.approx(wanted, rel=2e-3)
