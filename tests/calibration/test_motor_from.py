# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor is made of its spectra and its data sheet, or of a data sheet alone, and shows what was measured."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.motor_from import MotorFrom, _tips
from pyspice_runner.calibration.provenance import WIDTHS, Origin
from pyspice_runner.calibration.similar import Factors, as_stage, scaled
from pyspice_runner.cli import run
from pyspice_runner.run.point import Point
from pyspice_runner.spice.compiler import find_compiler
from pyspice_runner.spice.library import data_path
from pyspice_runner.steady.harmonic_balance import balanced_states
from tests.motors import BEAM40
from tests.said import output, refusal

NOISE = 1e-3
SHEET_ERROR = 0.01


# drive of the data sheet and band of the spectra
SHEETS = {
    "andersen2002": (pr.TwoPhaseDrive(voltage=300.0, frequency=54e3, phase_deg=90.0), (8e3, 90e3)),
    BEAM40: (pr.TwoPhaseDrive(voltage=110.0, frequency=40.1e3, phase_deg=120.0), (25e3, 60e3)),
}


def invented(name: str = "andersen2002", mass: float = 0.97, friction: float = 0.9) -> pr.Motor:
    """A motor with masses, friction and contact of its own, at the frequencies and with the couplings of another."""
    base = pr.load_motor(name)
    return base.updated(
        {
            "contact.friction": friction * base.contact.friction,
            "contact.normal_stiffness_n_per_m15": 0.9 * base.contact.normal_stiffness_n_per_m15,
            "contact.tangential_compliance_tip_m_per_n23": 1.05 * base.contact.tangential_compliance_tip_m_per_n23,
            "contact.tangential_compliance_rotor_m_per_n23": 1.05 * base.contact.tangential_compliance_rotor_m_per_n23,
        }
        | {
            f"modes.{index}.{key}": mass * getattr(mode, key)
            for index, mode in enumerate(base.modes) for key in ("mass_kg", "stiffness_n_per_m", "damping_n_s_per_m")
        }
    )  # fmt: skip


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
    masses = [mode.mass_kg for mode in truth.modes]
    found = pr.motor_from(measured(truth, 200, 1), mass_kg=masses, tips=tips, modes=2)
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
def test_the_command_writes_the_motor_and_a_page_with_data_and_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth, (drive, _) = invented(), SHEETS["andersen2002"]
    file = measured(truth, 200, 1).save(tmp_path / "free.csv")
    mine, page = tmp_path / "mine.toml", tmp_path / "mine.html"
    words = ["motor-from", file, "--modes", 2, "--mass-kg", truth.modes[0].mass_kg, "--no-load-speed", 18.0]
    words += ["--voltage", drive.voltage, "--frequency", drive.frequency, "--output", mine, "--page", page]
    assert "modes.1.coupling_b_n_per_v" in output(list(map(str, words)), capsys)
    made = pr.load_motor(mine)
    assert made.mount == truth.mount
    assert pr.default_drive(made) == drive
    text = page.read_text(encoding="utf-8")
    assert "free.csv" in text
    assert '"name":"measured"' in text.replace('": "', '":"')


def test_tips_and_the_ratio_of_masses_are_those_of_the_other_motor() -> None:
    base = pr.load_motor(BEAM40)
    free = measured(base, 300, 1, SHEETS[BEAM40][1])
    fit = pr.fit_spectrum(free, 2)
    tips, ratios = _tips(fit, base) or ([], [])
    assert tips == [(mode.tip_x, mode.tip_y) for mode in base.modes]
    assert ratios == [mode.mass_kg / base.modes[0].mass_kg for mode in base.modes]
    assert _tips(fit, base.updated({"modes.0.coupling_b_n_per_v": -0.01})) is None


def test_what_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = measured(invented(), 60, 1).save(tmp_path / "free.csv")
    assert "Give the no-load speed, or mass_kg." in " ".join(refusal(["motor-from", str(file)], capsys).split())
    assert run(["motor-from", str(file), "--no-load-speed", "3"]) == 2
    assert "give its voltage and its frequency too" in " ".join(capsys.readouterr().err.split())


# --- hidden variants of two motors: spectrum → motor → loop → firmware → full motor ---

PLATE40 = str(Path(__file__).parents[2] / "examples" / "plate40.toml")
BENCHES = {
    "bimodal40": pr.TwoPhaseDrive(voltage=150.0, frequency=40.7e3, phase_deg=62.0),
    PLATE40: pr.TwoPhaseDrive(voltage=150.0, frequency=40.4e3, phase_deg=70.0),
}
LOW = {"bimodal40": 80.0, PLATE40: 100.0}  # V, at which the loops are designed
VOLTAGES = {"bimodal40": (60.0, 80.0, 100.0), PLATE40: (80.0, 100.0, 120.0)}
BANDS = {"bimodal40": (30e3, 50e3), PLATE40: (15e3, 50e3)}  # Hz; the plate's band has a mode that no group drives
SET_POINTS = {"bimodal40": 0.05, PLATE40: 5e-3}  # rad, m; plate40 hunts by 0.4 mm, also with the loop of the truth
LOOP: dict[str, Any] = {"quantity": "position", "crossover": 20.0, "margin": 90.0, "sample_time": 0.5e-3}
GAIN = 1.5  # factor of the gains: a loop with a gain margin of 6 dB keeps half of it


def hidden(name: str, seed: int) -> pr.Motor:
    """A motor with values of its own: modes detuned by 0.2 %, Q by 20 %, mass, preload, contact by 10 %."""
    rng, base = np.random.default_rng(seed), pr.load_motor(name)
    common, changes = np.exp(0.1 * rng.standard_normal()), {}
    for index, mode in enumerate(base.modes):
        omega = 2.0 * np.pi * mode.frequency_hz * (1.0 + 0.002 * rng.standard_normal())
        mass = mode.mass_kg * common * np.exp(0.03 * rng.standard_normal())
        damping, both = mass * omega / 400.0 / np.exp(0.2 * rng.standard_normal()), np.exp(0.05 * rng.standard_normal())
        own = {"mass_kg": mass, "stiffness_n_per_m": mass * omega**2, "damping_n_s_per_m": damping}
        for key, value in zip(("coupling_a_n_per_v", "coupling_b_n_per_v"), mode.couplings, strict=True):
            own[key] = value * both * np.exp(0.02 * rng.standard_normal())
        changes |= {f"modes.{index}.{key}": value for key, value in own.items()}
    for key, width in {"preload_n": 0.1, "friction": 0.15, "normal_stiffness_n_per_m15": 0.1}.items():
        changes[f"contact.{key}"] = getattr(base.contact, key) * np.exp(width * rng.standard_normal())
    return base.updated(changes)


def found_on_the_bench(name: str, truth: pr.Motor, seed: int) -> tuple[pr.ControlLoop, pr.ControlLoop]:
    """Check the motor that a noisy spectrum and three numbers of a variant make; return its loop and the true one.

    The speeds have 1 % of noise, which the slope of the speed over the voltage doubles or more: 5 % of the maximum.
    """
    factors, low = 1.0 + SHEET_ERROR * np.random.default_rng(2000 + seed).standard_normal(3), LOW[name]
    bench = BENCHES[name]

    def speed(motor: pr.Motor, voltage: float) -> float:
        return pr.steady_state(motor, bench.updated({"voltage": voltage}), load_torque=0.0).speed_rad_s

    most, stall = speed(truth, bench.voltage), pr.steady_state(truth, bench, speed=0.0).torque_n_m
    made = pr.motor_from(
        measured(truth, 600, seed, BANDS[name]), **bench.model_dump(include={"voltage", "frequency", "phase_deg"}),
        no_load_speed=factors[0] * most, low_voltage=low, low_speed=factors[1] * speed(truth, low), base=name,
        **{"stall_force" if truth.slider else "stall_torque": factors[2] * stall},
    )  # fmt: skip
    if made.cautions:  # plate40 runs backward below its dead band
        assert name == PLATE40
        assert [caution for caution in made.cautions if "direction at lower voltages" in caution] == [*made.cautions]
        assert min(speed(truth, part * bench.voltage) for part in (0.3, 0.35, 0.4, 0.45)) < 0.0
    for voltage in VOLTAGES[name]:
        assert speed(made.motor, voltage) == pytest.approx(speed(truth, voltage), abs=0.05 * most)
    at = bench.updated({"voltage": low})
    loop, true = (pr.control_loop(motor, at, **LOOP) for motor in (made.motor, truth))
    for key, gain in loop.gains.items():
        assert 1.0 / GAIN < gain / true.gains[key] < GAIN, (seed, key)
    return loop, true


def test_a_hidden_variant_comes_back_from_the_bench_with_its_direction_and_gains() -> None:
    found_on_the_bench("bimodal40", hidden("bimodal40", 5), 5)


@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "seed"), [*(("bimodal40", seed) for seed in range(1, 6)), *((PLATE40, seed) for seed in (1, 3))]
)
def test_firmware_for_the_motor_of_the_bench_runs_the_hidden_full_motor(name: str, seed: int, tmp_path: Path) -> None:
    """It reaches the set point but for the friction between its dead band and the true one, and a tenth."""
    truth, bench, wanted = hidden(name, seed), BENCHES[name], SET_POINTS[name]
    loop, true = found_on_the_bench(name, truth, seed)
    page = (Path(__file__).parents[2] / "docs" / "tutorial_tracking.md").read_text(encoding="utf-8")
    source = page.split('write_text("""')[1].split('""")')[0].replace("phase = 90.0f", f"phase = {bench.phase_deg}f")
    (tmp_path / "loop.c").write_text(source, encoding="utf-8")
    gains = {**loop.gains, "dead_band": loop.dead_band_v}
    constants = [f"-D{name.upper()}={value:.6e}f" for name, value in gains.items()]
    words = [find_compiler(), "-shared", "-fPIC", "-I", data_path("behavioral"), *constants, tmp_path / "loop.c"]
    subprocess.run([*words, "-o", tmp_path / "loop.so"], check=True)
    run = pr.simulate_controlled(
        truth, bench, str(tmp_path / "loop.so"), 0.06, sample_time=0.5e-3, averaged=False,
        courses={"reference": [(0.0, 0.0), (1e-3, 0.0), (1.5e-3, wanted)]},
    )  # fmt: skip
    short = max(true.dead_band_v - loop.dead_band_v, 0.0) / loop.gains["proportional"]
    assert run.position_rad[-1] == pytest.approx(wanted, abs=0.1 * wanted + short)
    assert run.position_rad.max() < 1.1 * wanted


@pytest.mark.soak
def test_a_motor_that_turns_the_other_way_at_lower_voltages_has_a_caution() -> None:
    truth, at = pr.load_motor("bimodal40"), {"voltage": 100.0, "frequency": 40e3, "phase_deg": 62.0}
    speed = pr.steady_state(truth, pr.TwoPhaseDrive(**at), load_torque=0.0).speed_rad_s
    found = pr.motor_from(measured(truth, 600, 1, (30e3, 50e3)), **at, no_load_speed=speed, base="bimodal40")  # type: ignore[arg-type]
    assert speed < -3.0
    assert any("against its measured direction at lower voltages" in caution for caution in found.cautions)


# --- from a data sheet alone ---

STAGE = {"stall_force": 4.0, "no_load_speed": 0.3, "voltage": 100.0, "frequency": 39.6e3}
ERRORS = {"speed": 0.02, "force": 0.02, "torque": 0.02, "current": 0.05, "power": 0.05}  # relative, of the entry


def sheet_of(motor: pr.Motor) -> dict[str, float]:
    """The data sheet of a motor at its recommended drive, rated at half of its no-load speed."""
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    idle = pr.steady_state(motor, drive, load_torque=0.0).speed_rad_s
    rated = pr.steady_state(motor, drive, speed=0.5 * idle)
    return {
        "no_load_speed": idle, "rated_speed": 0.5 * idle, "voltage": drive.voltage, "frequency": drive.frequency,
        "stall_force" if motor.slider else "stall_torque": pr.steady_state(motor, drive, speed=0.0).torque_n_m,
        "rated_load": rated.load_torque_n_m,
        "rated_current": float(np.sqrt(0.5 * (rated.current_a_rms_a**2 + rated.current_b_rms_a**2))),
    }  # fmt: skip


def test_a_similar_motor_moves_alike_in_other_units() -> None:
    # the ladder of a loss tangent has fixed time constants: its loss varies by some per cent with the frequency
    motor = as_stage(pr.load_motor("andersen2002-unintended-mode").updated({"piezo.loss_tangent": 0.0}))
    drive = pr.default_drive(motor)
    factors = Factors(force=3.0, speed=0.5, frequency=1.3, voltage=0.7)
    like = scaled(motor, factors, "like")
    its = drive.updated({"voltage": 0.7 * drive.voltage, "frequency": 1.3 * drive.frequency})  # type: ignore[union-attr]
    points = [(motor, drive, 0.0), (motor, drive, 0.1), (like, its, 0.0), (like, its, 0.05)]
    setups = [Point.of(one, volts, speed=speed, audit=False) for one, volts, speed in points]
    stall, moving, its_stall, its_moving = balanced_states(setups, [None] * 4)
    for here, there in ((stall, its_stall), (moving, its_moving)):
        assert here is not None
        assert there is not None
        # the fall of a face of radius 1 m does not scale, and the search ends at 1e-6 of the motion
        for name, factor in {"torque_n_m": 3.0, "power_a_w": 1.5, "current_a_rms_a": 3.0 * 0.5 / 0.7}.items():
            assert there.values[name] == pytest.approx(factor * here.values[name], rel=1e-4), name


def test_a_data_sheet_alone_makes_a_stage_with_its_numbers_and_names_the_class_averages(tmp_path: Path) -> None:
    found = pr.motor_from(**STAGE, base="andersen2002-unintended-mode")  # type: ignore[arg-type]
    assert found.motor.slider is not None
    # similar motors are exact; ngspice's steady states have 2e-3 of the friction force
    for name, value in found.measured.items():
        assert found.computed[name] == pytest.approx(value, rel=2e-3)
    assert str(found.origins["drive.voltage"]) == "data sheet"
    assert str(found.origins["contact.friction"]) == "class average, ± 23 %"
    assert found.origins["modes.0.mass_kg"].kind == "class average"
    again = pr.load_motor(found.save(tmp_path / "stage.toml"))
    assert again.provenance["contact.friction"].kind == "assumed"
    assert "class average" in again.provenance["contact.friction"].note
    assert pr.default_drive(again) == pr.default_drive(found.motor)
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "base"),
    [
        ("bimodal40", "andersen2002-unintended-mode"),
        ("andersen2002-unintended-mode", "bimodal40"),
        (BEAM40, "bimodal40"),
    ],
)
def test_the_sheet_of_a_motor_makes_one_of_another_class_with_the_same_numbers(name: str, base: str) -> None:
    """Stall, no-load speed, and load and current at the rated point come back within three of their errors."""
    for motor in (pr.load_motor(name), as_stage(pr.load_motor(name))):
        sheet = sheet_of(motor)
        found = pr.motor_from(**sheet, base=base)  # type: ignore[arg-type]
        assert not found.cautions
        assert len(found.measured) == 4
        drive = pr.default_drive(found.motor)
        again = sheet_of(found.motor)  # at the no-load speed and the rated point of its own
        assert pr.steady_state(found.motor, drive, load_torque=0.0).speed_rad_s == pytest.approx(
            found.computed["no_load_speed_m_s" if motor.slider else "no_load_speed_rad_s"], rel=1e-6
        )
        for key in ("no_load_speed", "stall_force" if motor.slider else "stall_torque", "rated_load", "rated_current"):
            error = next(value for word, value in {**ERRORS, "load": 0.02}.items() if word in key)
            assert again[key] == pytest.approx(sheet[key], rel=3.0 * error), key
        derived = [path for path, origin in found.origins.items() if origin.kind == "derived"]
        assert derived


@pytest.mark.soak
def test_the_widths_of_the_class_are_those_of_the_bundled_motors() -> None:
    logarithms: dict[str, list[float]] = {}
    for name in ("andersen2002-unintended-mode", BEAM40, "bimodal40"):
        motor = as_stage(pr.load_motor(name))
        drive = pr.default_drive(motor)
        assert isinstance(drive, pr.TwoPhaseDrive)
        own = Factors(
            pr.steady_state(motor, drive, speed=0.0).torque_n_m,
            pr.steady_state(motor, drive, load_torque=0.0).speed_rad_s, drive.frequency, drive.voltage,
        )  # fmt: skip
        near = [mode for mode in motor.modes if abs(mode.frequency_hz / drive.frequency - 1.0) < 0.15]
        values = {
            "mass_kg": [mode.mass_kg for mode in near], "quality": [mode.quality_factor for mode in near],
            "coupling_a_n_per_v": [abs(mode.coupling_a_n_per_v) for mode in near],
            **{key: [getattr(motor.contact, key)] for key in (
                "preload_n", "normal_stiffness_n_per_m15", "tangential_compliance_rotor_m_per_n23")},
            "capacitance_a_f": [motor.piezo.capacitance_a_f],
        }  # fmt: skip
        for key, several in values.items():
            logarithms.setdefault(key, []).append(
                float(np.mean(np.log(several)) - np.log(1.0 if key == "quality" else own.of(key)))
            )
    for key, three in logarithms.items():
        stated = WIDTHS["damping_n_s_per_m" if key == "quality" else key]
        assert stated == pytest.approx(np.std(three, ddof=1), rel=0.15), key  # they are rounded


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"rated_speed": 0.4, "rated_load": 1.0}, "rated_speed = 0.4 m/s contradicts no_load_speed = 0.3 m/s"),
        ({"rated_speed": 0.1, "rated_load": 5.0}, "rated_load = 5 N contradicts stall_force = 4 N"),
        ({"rated_speed": 0.2, "rated_load": 2.0, "rated_power": 0.3}, "gives 0.4 W at the shaft"),
        ({"rated_speed": 0.2, "rated_load": 2.0, "rated_current": 1e-3}, "takes at most the apparent power of 0.1414"),
        ({"rated_speed": 0.2, "rated_current": 1e-3, "rated_power": 1.0}, "rated_power = 1 W contradicts"),
        ({"rated_current": 0.1}, "give its rated_load or rated_speed"),
        ({"rated_speed": 0.1}, "One value does not make a rated point"),
        ({"stall_torque": 1.0}, "stall_force is given too"),
        ({"stall_force": -1.0}, "stall_force = -1 is not valid"),
        ({"no_load_speed": -0.3}, "stall_force = 4 is not valid: it must be a number < 0, like the other"),
        ({"no_load_speed": -0.3, "stall_force": -4.0}, "not run in the measured direction.*0.729, measured -0.3"),
        ({"low_speed": 0.1}, "low_speed is the no-load speed at low_voltage"),
        ({"low_speed": 0.1, "low_voltage": 120.0}, "low_voltage = 120 is not valid: it must be > 0 and < 100 V"),
        ({"voltage": None}, "give its voltage and its frequency too"),
        ({"no_load_speed": None}, "takes its no-load speed and its stall"),
        ({"mass_kg": 1e-3}, "mass_kg goes with spectra"),
    ],
)
def test_a_contradictory_or_incomplete_data_sheet_is_refused_with_a_reason(changes: dict[str, Any], told: str) -> None:
    with pytest.raises((pr.ParameterError, pr.SimulationError), match=told):
        pr.motor_from(**STAGE | changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("width", "words"),
    [
        (0.05, "± 5 %"),
        (1.0, "×/÷ 2.7"),
        (800.0, "not determined"),
        (np.inf, "not determined"),
        (np.nan, "not determined"),
    ],
)
def test_a_value_that_the_numbers_do_not_determine_is_called_so(width: float, words: str) -> None:
    assert str(Origin("derived", width)) == f"derived, {words}"
