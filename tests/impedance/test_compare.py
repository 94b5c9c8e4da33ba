# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra against spectra and motors: what was changed is what is found to deviate."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.impedance import causes
from pyspice_runner.impedance.compare import Comparison, _error, _share
from tests.resonators import resonator, spectrum
from validation import faults

BAND = np.linspace(15e3, 45e3, 801)
GOOD = {"frequencies": [20e3, 33e3], "qualities": [120.0, 300.0], "ratios": [0.05, 0.02]}


def measured(name: str, *, noise: float = 0.0, seed: int = 1, **changes: object) -> pr.Spectrum:
    circuit = resonator(**{**GOOD, **changes})  # type: ignore[arg-type]
    return replace(spectrum(circuit, BAND, noise=noise, seed=seed), source=name)


REFERENCE = measured("reference")


def one(first: pr.Spectrum, second: pr.Spectrum | pr.Motor = REFERENCE, **arguments: object) -> Comparison:
    (comparison,) = pr.compare(first, second, **arguments).comparisons  # type: ignore[arg-type]
    return comparison


def test_what_was_changed_is_what_deviates() -> None:
    found = one(measured("part", frequencies=[20.2e3, 33e3], qualities=[120.0, 240.0], capacitance=1.03e-9))
    deviations = found.deviations()
    expected = {
        ("frequency", 1): 0.01, ("quality_factor", 1): 0.0, ("frequency", 2): 0.0, ("quality_factor", 2): -0.2,
        ("clamped_capacitance", None): 0.03,
    }  # fmt: skip
    for key, value in expected.items():
        assert deviations[key] == pytest.approx(value, abs=1e-6), key
    # 2π f √C
    assert deviations["coupling", 1] == pytest.approx(1.01 * 1.03**0.5 - 1.0, abs=1e-6)
    # the ratios C/C0 are the same, so that k_eff is; R = 1/(2 pi f C Q)
    assert deviations["coupling_factor", 1] == pytest.approx(0.0, abs=1e-3)
    assert deviations["resistance", 1] == pytest.approx(1.0 / (1.01 * 1.03) - 1.0, abs=1e-6)
    assert found.extra_hz == ()
    assert one(REFERENCE).rms_deviation < 1e-9


def test_tolerances_show_what_is_outside() -> None:
    found = one(measured("part", frequencies=[20.2e3, 33e3], qualities=[120.0, 240.0]))
    assert found.outside({"frequency": 0.02, "quality_factor": 0.25}) == ()
    (told,) = found.outside({"frequency": 0.005})
    assert re.fullmatch(r"The frequency of mode 1 is off by \+1 ± \S+ %; the limit is 0\.5 %\.", told)
    assert len(found.outside({"frequency": 0.005, "quality_factor": 0.1})) == 2
    assert found.outside({}) == ()


def test_a_tolerance_and_a_plot_show_the_error_of_a_deviation() -> None:
    found = one(measured("part", noise=0.02, frequencies=[20.2e3, 33e3], qualities=[120.0, 240.0]))
    deviation, error = (table["frequency", 1] for table in (found.deviations(), found.errors()))
    assert 1e-5 < error < 0.1 * deviation
    (told,) = found.outside({"frequency": deviation - 0.5 * error})
    assert f"± {100.0 * error:.1g} %; the limit is " in told
    assert told.endswith(" %, within the error.")
    assert "within" not in found.outside({"frequency": deviation - 2.0 * error})[0]
    axes = {ax.get_title(): ax for ax in found.plot().figure.axes}
    bars = axes["Measured less reference, with standard errors"]
    widths = [float(np.ptp(line[:, 0])) for line in bars.collections[0].get_segments()]
    place = list(found.deviations()).index(("frequency", 1))
    assert widths[place] == pytest.approx(200.0 * error)


def test_a_missing_mode_and_one_too_many_are_reported() -> None:
    single = measured("single", frequencies=[33e3], qualities=[300.0], ratios=[0.02])
    missing = one(single)
    assert [mode.measured is None for mode in missing.modes] == [True, False]
    assert missing.outside({"frequency": 0.5}) == ("Mode 1 is missing.",)
    extra = one(REFERENCE, single)
    assert extra.extra_hz == pytest.approx((20e3,), rel=1e-6)
    assert len(extra.modes) == 1


def test_a_strong_mode_that_moved_past_a_weak_one_is_still_itself() -> None:
    before = measured("before", frequencies=[25e3, 25.8e3], qualities=[300.0, 300.0], ratios=[0.05, 0.0005])
    after = measured("after", frequencies=[25.8e3, 26.4e3], qualities=[300.0, 300.0], ratios=[0.0005, 0.05])
    modes = one(after, before).modes
    assert [mode.deviations["frequency"] for mode in modes] == pytest.approx([26.4 / 25.0 - 1.0, 0.0], abs=1e-6)


@pytest.mark.soak
def test_a_motor_is_held_against_its_own_spectrum() -> None:
    motor = pr.load_motor("andersen2002")
    softer = motor.updated({"modes.1.frequency_hz": 51.0e3})
    result = pr.admittance(softer, start=8e3, stop=70e3, points=800)
    two_port = pr.Spectrum.from_admittance(result.frequency_hz, result.matrix_s, source="stator")
    found = one(two_port, motor, connection="A-B")  # which drives the second mode alone
    assert len(found.modes) == 1
    # the ripple of the motor's ladder, 5 % of its loss tangent of 0.02, is not in the fit: a phase of 1e-3, of which
    # the
    # two fits, 1.4 % of the frequency apart, have all but a thousandth in common
    expected = 51.0e3 / motor.modes[1].frequency_hz - 1.0
    assert found.modes[0].deviations["frequency"] == pytest.approx(expected, abs=1e-6)
    assert found.reference.source == "andersen2002 (free, A-B)"


def test_spectra_at_several_temperatures_give_the_drifts() -> None:
    """Frequency, coupling and capacitance change linearly with temperature; so do their logarithms, to 1e-3 of the
    drift."""
    spectra = []
    for seed, kelvin in enumerate((-20.0, 0.0, 20.0, 40.0)):
        frequency, capacitance = 20e3 * (1.0 - 1.6e-4 * kelvin), 1e-9 * (1.0 + 4e-3 * kelvin)
        # k_eff^2 is nearly C/C0, and theta^2 = C1 k: with theta constant C1 goes with 1/f^2
        ratio = 0.05 * (20e3 / frequency) ** 2 * 1e-9 / capacitance
        circuit = resonator([frequency], [120.0], [ratio], capacitance=capacitance)
        spectra.append(spectrum(circuit, np.linspace(15e3, 27e3, 601), noise=0.001, seed=seed))
    trend = pr.compare(spectra, REFERENCE, modes=1, at=[-20, 0, 20, 40], label="K")
    found = {item["quantity"]: item for item in trend.drifts()}
    truth = {"frequency": -1.6e-4, "coupling": 0.0, "clamped_capacitance": 4e-3}
    for name, slope in truth.items():
        curvature = 0.5 * slope**2 * 60.0  # of ln(1 + at) over the range
        assert abs(found[name]["slope"] - slope) < 4.0 * found[name]["standard_error"] + 2.0 * curvature, name
    assert trend.to_dict()["drifts"] == trend.drifts()


@pytest.mark.soak
def test_many_make_a_table_and_a_trend(tmp_path: Path) -> None:
    spectra = [
        measured(f"at {at} C", noise=0.002, seed=at, frequencies=[20e3 * (1.0 - 1e-4 * at), 33e3])
        for at in (20, 40, 60)
    ]
    trend = pr.compare(spectra, REFERENCE, modes=2, at=[20, 40, 60], label="temperature in °C")
    found = [item.deviations()["frequency", 1] for item in trend.comparisons]
    assert found == pytest.approx([-0.002, -0.004, -0.006], abs=1e-5)
    with trend.save(tmp_path / "trend.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["spectrum"], row["at"], row["mode"]) for row in rows[:3]] == [
        ("at 20 C", "20", "1"), ("at 20 C", "20", "2"), ("at 40 C", "40", "1"),
    ]  # fmt: skip
    assert float(rows[0]["frequency_deviation"]) == pytest.approx(found[0], rel=1e-5)
    document = json.loads(trend.save(tmp_path / "trend.json").read_text(encoding="utf-8"))
    assert (document["reference"], len(document["comparisons"])) == ("reference", 3)
    trend.plot(tmp_path / "trend.png")
    assert (tmp_path / "trend.png").stat().st_size > 20_000


def test_what_cannot_be_compared() -> None:
    with pytest.raises(pr.ParameterError, match="nothing to compare"):
        pr.compare([], REFERENCE)
    with pytest.raises(pr.ParameterError, match="at has 1 values for 2 spectra"):
        pr.compare([REFERENCE, REFERENCE], REFERENCE, at=[1.0])
    far = pr.Spectrum.from_admittance(BAND + 1e6, REFERENCE.admittance_s, source="far")
    with pytest.raises(pr.SpectrumError, match="far and reference share no frequencies"):
        pr.compare(far, REFERENCE)


# --- the command ---


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    REFERENCE.save("good.csv")
    # a stiffer mode: its coupling θ/√m = 2π f √C stays
    measured("", frequencies=[20.2e3, 33e3], ratios=[0.05 / 1.01**2, 0.02]).save("part.csv")
    return tmp_path


@pytest.mark.parametrize(
    ("tolerances", "status"),
    [
        ([], 0),
        (["2%"], 0),
        (["0.02"], 0),
        (["0.5%"], 1),
        (["0.5%", "frequency=2%"], 0),
        (["frequency=0.1%"], 1),
    ],
)
@pytest.mark.usefixtures("files")
def test_exit_status_is_by_tolerance(tolerances: list[str], status: int, capsys: pytest.CaptureFixture[str]) -> None:
    words = [word for text in tolerances for word in ("--tolerance", text)]
    assert run(["compare", "part.csv", "good.csv", *words, "--json"]) == status
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["within_tolerance"] == (None if not tolerances else status == 0)
    (comparison,) = document["comparisons"]
    assert comparison["modes"][0]["deviations"]["frequency"] == pytest.approx(0.01, rel=1e-6)
    assert len(comparison["outside_tolerance"]) == status
    assert ("part.csv: The frequency of mode 1 is off by +1 ± " in err) == bool(status)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["part.csv"], "nothing to compare with part.csv"),
        (["part.csv", "good.csv", "--tolerance", "much"], "write 5%, 0.05"),
        (["part.csv", "good.csv", "--tolerance", "2"], "a ratio of 2, which is 200 %"),
        (["part.csv", "good.csv", "--tolerance", "-1%"], "write 5%, 0.05"),
        (["part.csv", "good.csv", "--tolerance", "colour=1%"], "--tolerance has no 'colour'"),
        (["part.csv", "good.csv", "--set", "contact.preload_n=1"], "the reference is a spectrum"),
        (["part.csv", "absent.csv"], "No such file"),
        (["part.csv", "good.csv", "--plot", "x.txt"], "let it end in .png"),
    ],
)
@pytest.mark.usefixtures("files")
def test_refused(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", *words]) == 2
    assert says in capsys.readouterr().err


def test_spectra_without_a_common_resonance_have_a_caution_with_the_resonances_of_both() -> None:
    other = measured("other", frequencies=[26e3, 41.5e3])
    found = one(other)
    assert found.extra_hz == pytest.approx((26e3, 41.5e3), rel=1e-6)
    told = "No resonance is common: other has 26 kHz and 41.5 kHz; reference has 20 kHz and 33 kHz."
    assert found.cautions == (told,)
    assert one(REFERENCE).cautions == ()


def test_a_spectrum_against_itself_has_deviations_without_a_sign_within_their_errors() -> None:
    noisy = measured("noisy", noise=0.01)
    same = one(noisy, noisy).summary()
    assert same["clamped capacitance"] == "0 ± 0.04 % (within the error)"
    for name, error in (("frequency", "0.002"), ("quality factor", "0.3"), ("coupling factor", "0.05")):
        assert f"{name} 0 ± {error} % (within the error)" in same["mode 1"]
    part = measured("part", noise=0.01, frequencies=[20.2e3, 33e3])
    assert "frequency +1 ± 0.002 %, quality" in one(part, noisy).summary()["mode 1"]


@pytest.mark.soak
def test_deviations_of_one_device_scatter_as_their_errors_say() -> None:
    pairs = [[measured("same", noise=0.01, seed=2 * number + side) for side in (1, 2)] for number in range(16)]
    found = [one(*pair, modes=2) for pair in pairs]
    for key in found[0].deviations():
        errors = [item.errors()[key] or 0.0 for item in found]
        scatter = [item.deviations()[key] / error for item, error in zip(found, errors, strict=True)]
        # χ² of 16: 1 ± 0.18, so that one of a thousand leaves this range; measured 0.77 to 1.30
        assert 0.45 < float(np.sqrt(np.mean(np.square(scatter)))) < 1.6, key
    mode = found[0].to_dict()["modes"][0]
    assert mode["deviation_errors"].keys() == mode["deviations"].keys()
    header, row, *_ = found[0].rows()
    written = dict(zip(header, row, strict=True))
    assert float(written["frequency_deviation_error"]) == pytest.approx(mode["deviation_errors"]["frequency"], rel=1e-2)


def test_the_error_of_a_deviation_from_a_value_at_its_limit_is_not_known() -> None:
    fit = one(REFERENCE)
    assert _error(0.1, _share(None, 1.0), 1e-3) is None
    assert _error(0.1, 3e-3, 4e-3) == pytest.approx(1.1 * 5e-3)
    assert (
        "frequency 0 %, quality"
        in replace(
            fit, modes=tuple(replace(mode, deviation_errors=dict.fromkeys(mode.deviations)) for mode in fit.modes)
        ).summary()["mode 1"]
    )


# --- the cause ---

CASES = Path(__file__).parents[1] / "data" / "cases"
# bimodal40 as it was when the case files were computed: another contact, capacitances without a static motion
OLD = {
    "contact.preload_n": 16.5, "contact.restitution": 0.9, "contact.restitution_velocity_m_s": 0.1,
    "contact.materials.tip_radius_m": 0.0065, "contact.materials.on_face": False,
    "contact.materials.rotor_youngs_modulus_pa": 370e9, "contact.materials.rotor_poisson": 0.22,
    "piezo.capacitance_a_f": 1.34427e-9, "piezo.capacitance_b_f": 1.34427e-9, "piezo.capacitance_ab_f": 4.96728e-10,
    **{f"piezo.motion_{axis}_{group}_m_per_v": 0.0 for axis in "xy" for group in "ab"},
}  # fmt: skip
FAULTS = {  # file → cause, size with its true value in %
    "a_mass_n": (causes.BODY, "modal mass of mode-3", 3.0),
    "b_crack_n": (causes.PATCH, "θ of group A in mode-3", -40.0),
    "c_depol_n": (causes.DEPOLARISED, "θ of group A in all modes", -40.0),
    "d_preload_n": (causes.CONTACT, "preload", 100.0 * (8.0 / 16.5 - 1.0)),
}


@pytest.mark.parametrize("state", ["free", pytest.param("preloaded", marks=pytest.mark.soak)])
def test_the_cause_of_a_fault_is_named_by_both_groups_and_by_one(state: str, tmp_path: Path) -> None:
    names = [name for name in FAULTS if (name == "d_preload_n") == (state == "preloaded")]
    both = [pr.read_spectrum(CASES / f"{name}.csv") for name in names]
    spectra = [*both, *(spectrum.driven("A") for spectrum in both)]
    tolerances = {"frequency": 0.01, "coupling": 0.02}
    motor = pr.load_motor("bimodal40").updated(OLD)
    trend = pr.compare(spectra, motor, state=state, tolerances=tolerances)  # type: ignore[arg-type]
    for name, comparison in zip(names * 2, trend.comparisons, strict=True):
        cause, size, value = FAULTS[name]
        first, second = comparison.diagnosis.causes[:2]
        assert first.name == cause
        assert first.probability > 0.9 > 0.1 > second.probability
        assert sum(one.probability for one in comparison.diagnosis.causes) == pytest.approx(1.0)
        found = re.search(rf"{size} (\S+) ± (\S+) %", comparison.diagnosis.text)
        # within three of the errors, which contain the tolerances of manufacture that the files do not have
        assert abs(float(found[1]) - value) < 3.0 * float(found[2])
    if state == "free":
        # a mass on one mode moves the coupling factors of its neighbours, but not what is theirs
        mass = trend.comparisons[0]
        assert [mode.name for mode in mass.modes] == ["mode-2", "mode-3", "mode-4"]
        assert abs(mass.deviations()["coupling_factor", 3]) > 0.05 > abs(mass.deviations()["coupling", 3])
        assert [text[:24] for text in mass.outside(tolerances)] == ["The frequency of mode-3 "]
        with trend.save(tmp_path / "parts.csv").open(encoding="utf-8", newline="") as file:
            row = list(csv.DictReader(file))[1]
        assert (row["mode_name"], row["passed"], row["cause"]) == ("mode-3", "fail", causes.BODY)
        assert float(row["coupling_n_per_v_kg05"]) == pytest.approx(0.11201 / (1.03 * 0.0053072) ** 0.5, rel=1e-3)
        assert "Most probable causes" in {ax.get_title() for ax in trend.plot().figure.axes}


def test_a_crack_that_moves_two_of_three_modes_is_one_in_the_body() -> None:
    """The third mode is stiffer, within the tolerances of manufacture: no crack does that, and none has to."""
    motor = pr.load_motor("bimodal40")
    changed = {f"modes.{mode}.stiffness_n_per_m": share for mode, share in ((1, 1.005), (2, 0.946), (3, 0.923))}
    cracked = pr.admittance(faults.scaled(motor, changed), start=35e3, stop=44e3, points=450)
    spectrum = pr.Spectrum.from_admittance(cracked.frequency_hz, cracked.matrix_s).driven("A")
    assert [cause.name for cause in one(spectrum, motor).diagnosis.causes if cause.probability > 0.9] == [causes.BODY]


@pytest.mark.soak
@pytest.mark.parametrize("name", ["plate40", "andersen2002"])
def test_drawn_faults_are_named(name: str) -> None:
    """Three faults of the first draw of validation/faults.py, which has all of them, and a part without one."""
    chosen = (causes.PATCH, causes.TEMPERATURE, causes.BONDING, causes.HEALTHY)
    found = faults.outcome(f"{name} 0", chosen)["faults"]
    assert {fault: one["both groups"]["named"] for fault, one in found.items()} == {fault: fault for fault in chosen}


def test_the_page_has_the_counts_of_the_recorded_faults() -> None:
    table = faults.summary(faults.CAMPAIGN.cases())
    assert table == json.loads(faults.CAMPAIGN.record.with_suffix(".json").read_text(encoding="utf-8"))
    assert faults.passes(table)
    both, single = table["six faults, both groups"], table["six faults, one group"]
    sure = [table["right by the stated probability"][band] for band in ("0.9 to 0.99", "0.99 to 1")]
    right, answers = (sum(band[k] for band in sure) for k in (0, 1))
    text = " ".join((Path(pr.__file__).parents[1] / "docs" / "impedance.md").read_text(encoding="utf-8").split())
    assert f"Of {both[1]} faulty parts" in text
    assert f"name {both[0]}, one group {single[0]}; above 90 % of probability {right} of {answers} answers" in text


def test_a_spectrum_as_the_reference_names_no_cause() -> None:
    assert one(REFERENCE).diagnosis is None
    assert one(REFERENCE).to_dict()["passed"] is None
    with pytest.raises(pr.ParameterError, match="tolerances has no 'colour'"):
        pr.compare(REFERENCE, REFERENCE, tolerances={"colour": 0.1})
