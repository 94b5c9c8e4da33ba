# SPDX-License-Identifier: GPL-3.0-or-later
"""A repaired file gives a note; a file that would need a guess gives an error."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.readers.text import number
from tests.data.spectra import make

Y = make.admittance()


@pytest.fixture
def table(tmp_path: Path) -> object:
    """Write a plain table and read it."""

    def read(header: str, *columns: Sequence[float] | np.ndarray) -> pr.Spectrum:
        rows = [",".join(f"{value:.15g}" for value in row) for row in zip(*columns, strict=True)]
        path = tmp_path / "measured.csv"
        path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
        return pr.read_spectrum(path)

    return read


POLAR = "frequency_hz,abs_y_s,phase_deg"
RECTANGULAR = "frequency_hz,conductance_s,susceptance_s"


F, SIZE, ANGLE = make.FREQUENCY, np.abs(Y), np.angle(Y)
MIXED, TWICE = np.random.default_rng(3).permutation(Y.size), np.sort(np.append(np.arange(Y.size), [3, 3, 40]))
REPAIRED: dict[str, tuple[str, tuple[np.ndarray, ...], tuple[str, ...]]] = {
    "half a turn": (POLAR, (F, SIZE, np.angle(-Y, deg=True)), ("wraps by 360°", "off by 180°, which was added")),
    "unwrapped beyond a turn": (POLAR, (F, SIZE, np.rad2deg(ANGLE) + 720.0), ()),
    "reversed leads": (RECTANGULAR, (F, -Y.real, -Y.imag), ("off by 180°",)),
    "falling frequencies": (RECTANGULAR, (F[::-1], Y.real[::-1], Y.imag[::-1]), ("put in rising order",)),
    "mixed frequencies": (RECTANGULAR, (F[MIXED], Y.real[MIXED], Y.imag[MIXED]), ("the points were sorted",)),
    "points that come twice": (
        RECTANGULAR, (F[TWICE], Y.real[TWICE], Y.imag[TWICE]), ("Points that came twice, with the same values: 3; one",)
    ),
    "a point at 0 Hz": (
        RECTANGULAR, (np.append(0.0, F), np.append(1e-9, Y.real), np.append(0.0, Y.imag)), ("The point at 0 Hz was",)
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", REPAIRED)
def test_a_fault_is_repaired_with_a_caution_and_no_other(fault: str, table) -> None:
    header, columns, cautions = REPAIRED[fault]
    spectrum = table(header, *columns)
    assert spectrum.admittance_s == pytest.approx(Y)
    assert len(spectrum.cautions) == len(cautions)
    assert all(re.search(text, caution) for text, caution in zip(cautions, spectrum.cautions, strict=True))


@pytest.mark.parametrize(
    ("name", "unit"), [("|Z| (dB)", "1 Ω"), ("magnitude_dbohm", "1 Ω"), ("|Z| (dBkOhm)", "1000 Ω"), ("|Y| (dB)", "1 S")]
)
def test_a_magnitude_in_decibels(name: str, unit: str, table) -> None:
    values = (Y if "Y" in name else 1.0 / Y) / float(unit.split()[0])
    spectrum = table(f"frequency_hz,{name},phase_deg", F, 20.0 * np.log10(np.abs(values)), np.angle(values, deg=True))
    assert spectrum.admittance_s == pytest.approx(Y)
    assert spectrum.cautions == (f"“{name}” was read in dB relative to {unit}.",)


# --- phase ---


def test_a_resistor_s_phase_of_one_degree_stays_degrees(table) -> None:
    frequency = np.linspace(1e3, 1e4, 50)
    y = np.full(50, 0.01) * np.exp(1j * np.deg2rad(np.linspace(0.5, 1.5, 50)))
    spectrum = table(POLAR, frequency, np.abs(y), np.angle(y, deg=True))
    assert spectrum.admittance_s == pytest.approx(y)
    assert spectrum.cautions == ()


@pytest.mark.parametrize(
    ("unit", "angle", "told"),
    [
        ("_deg", ANGLE, r"in degrees but stays within ±1\.\d+ while the magnitude varies; correct .* to phase_rad"),
        ("_rad", np.rad2deg(ANGLE), r"in radians but reaches 88\.66; correct its unit, as to phase_deg"),
        ("", ANGLE, "“phase”: it names no unit; expected two"),
    ],
)
def test_a_phase_in_another_unit_than_named_is_refused(unit: str, angle: np.ndarray, told: str, table) -> None:
    with pytest.raises(pr.SpectrumError, match=told):
        table("frequency_hz,abs_y_s,phase" + unit, F, SIZE, angle)


def test_a_capacitor_with_a_slightly_negative_loss_is_not_turned(table) -> None:
    frequency = np.linspace(1e3, 1e4, 50)
    y = 2j * np.pi * frequency * 1e-9 * np.exp(1j * np.deg2rad(0.1))
    spectrum = table(POLAR, frequency, np.abs(y), np.angle(y, deg=True))
    assert spectrum.admittance_s == pytest.approx(y)
    assert "negative throughout, but small" in spectrum.cautions[0]


def test_a_noisy_real_part_is_kept_with_a_caution(table) -> None:
    frequency = np.linspace(1e3, 1e4, 200)
    y = 2j * np.pi * frequency * 1e-9 * (1.0 - 1e-4j) + 1e-8 * np.random.default_rng(1).normal(size=200)
    spectrum = table(RECTANGULAR, frequency, y.real, y.imag)
    assert spectrum.admittance_s == pytest.approx(y)
    assert "nothing was changed" in spectrum.cautions[0]


@pytest.mark.parametrize("mirrored", [Y.conj(), Y.imag + 1j * Y.real, (1.0 / Y).conj()])
def test_an_imaginary_part_of_the_wrong_sign_or_place_is_refused(mirrored: np.ndarray, table) -> None:
    with pytest.raises(pr.SpectrumError, match="the circles of Y run against the clock"):
        table(RECTANGULAR, make.FREQUENCY, mirrored.real, mirrored.imag)


def test_circles_are_those_of_noise_and_smooth_lines_too_without_being_refused(table) -> None:
    random = np.random.default_rng(7)
    frequency = np.geomspace(1e2, 1e6, 400)
    w = 2j * np.pi * frequency
    debye = w * 1e-10 + 1.0 / (1e4 + 1.0 / (w * 1e-9))
    for y in (debye, 1.0 / (10.0 + w * 1e-3), 1.0 / (50.0 + w * 1e-6), w * 1e-9 * (1.0 - 0.02j), 0.02 + 0.0 * w):
        for noise in (0.0, 1e-4, 1e-2, 0.2):
            noisy = y * (1.0 + noise * (random.normal(size=400) + 1j * random.normal(size=400)))
            assert table(RECTANGULAR, frequency, noisy.real, noisy.imag).admittance_s == pytest.approx(noisy)


# --- points ---


def test_a_frequency_with_two_values_is_refused(table) -> None:
    frequency = make.FREQUENCY.copy()
    frequency[5] = frequency[4]
    with pytest.raises(
        pr.SpectrumError, match=r"line 7: 96000 Hz as in line 6, with other values; expected each .* once"
    ):
        table(RECTANGULAR, frequency, Y.real, Y.imag)


def test_missing_values_are_left_out_with_a_caution(table) -> None:
    assert np.isnan([number(mark) for mark in ("9.9E37", "-9.90000E+37", "9.91E+37", "OVL", "#N/A", "")]).all()
    real = Y.real.copy()
    real[[4, 9]] = np.nan
    spectrum = table(RECTANGULAR, make.FREQUENCY, real, Y.imag)
    assert len(spectrum) == Y.size - 2
    assert spectrum.cautions == ("Points left out, with values missing, zero or an overflow: 2, first in line 6.",)
    real[:40] = np.nan
    with pytest.raises(pr.SpectrumError, match="line 2: here and at 39 of 61 points values are missing"):
        table(RECTANGULAR, make.FREQUENCY, real, Y.imag)


def test_repeated_sweeps_that_differ_by_noise_are_averaged(tmp_path: Path) -> None:
    noise = 1e-3 * (np.random.default_rng(11).standard_normal((4, Y.size, 2)) @ [1.0, 1j])
    path = tmp_path / "measured.csv"
    sweeps = [pr.Spectrum.from_admittance(F, Y * (1.0 + part)).save(path).read_text() for part in noise]
    path.write_text("# again\n".join(sweeps), encoding="utf-8")  # each with its header
    spectrum = pr.read_spectrum(path)
    assert spectrum.admittance_s == pytest.approx(Y * (1.0 + noise.mean(axis=0)), rel=1e-12)
    told = r"The file holds 4 sweeps. Their mean was read; the first differs from the mean by 0.1\d? % RMS."
    assert re.fullmatch(told, spectrum.cautions[0])


def test_of_sweeps_between_which_the_device_drifts_the_first_is_read(table) -> None:
    """The resonance moves by a fifth of its width, up and down again; the mean would have a lower Q."""
    y = np.append(Y, make.admittance(F[::-1] * (1.0 + 1e-3)))
    spectrum = table(RECTANGULAR, np.append(F, F[::-1]), y.real, y.imag)
    assert spectrum.admittance_s == pytest.approx(Y)
    assert spectrum.cautions[0].startswith(
        "The file holds 2 sweeps. They differ by more than noise, and the first was read; "
    )


@pytest.mark.parametrize(
    ("frequency", "told"), [(-1.0, "below 0 Hz"), (1e13, r"1e\+13 Hz; expected at most 1e\+12 Hz")]
)
def test_frequencies_that_cannot_be_are_refused(frequency: float, told: str, table) -> None:
    with pytest.raises(pr.SpectrumError, match=told):
        table(RECTANGULAR, np.append(make.FREQUENCY, frequency), np.append(Y.real, 1.0), np.append(Y.imag, 1.0))


def test_a_last_line_without_an_end_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "measured.csv"
    path.write_text(make.plain().rstrip("\n")[:-3], encoding="utf-8")
    spectrum = pr.read_spectrum(path)
    assert spectrum.admittance_s == pytest.approx(Y[:-1])
    assert spectrum.cautions == ("Line 62, the last, has no line end and may be cut short, so it was left out.",)


@pytest.mark.parametrize(
    ("name", "told"), [("overflow.csv", "first in line 102."), ("series_through.s2p", "those of one device in series")]
)
def test_files_as_instruments_write_them(name: str, told: str) -> None:
    """An arm of 49.7 kHz, Q 50 and 250 pF beside 2.2 nF with a loss tangent of 0.01, and noise."""
    fit = pr.fit_spectrum(pr.read_spectrum(Path(make.__file__).parents[1] / "cases" / name))
    assert told in fit.cautions[0]
    (arm,) = fit.arms
    found = arm.series_resonance_hz, arm.quality_factor, arm.capacitance_f, fit.circuit.clamped_capacitance_f
    assert found == pytest.approx((49.7e3, 50.0, 250e-12, 2.2e-9), rel=1e-3)


# --- columns ---


def test_columns_that_contradict_each_other_are_refused(table) -> None:
    z = 1.0 / Y
    header = "frequency_hz,rs_ohm,xs_ohm,abs_z_ohm,phase_deg"
    good = (make.FREQUENCY, z.real, z.imag, np.abs(z), np.angle(z, deg=True))
    assert table(header, *good).admittance_s == pytest.approx(Y)
    for swapped in ((0, 2, 1, 3, 4), (0, 3, 2, 1, 4), (0, 1, 2, 4, 3)):
        with pytest.raises(
            pr.SpectrumError, match=r"contradicts those of R and X; columns may be swapped, or a unit wrong"
        ):
            table(header, *(good[place] for place in swapped))
    with pytest.raises(pr.SpectrumError, match="the frequencies jump about while R runs steadily"):
        table(header, *(good[place] for place in (1, 0, 2, 3, 4)))


def test_a_two_port_that_is_not_reciprocal_or_passive_is_refused(tmp_path: Path) -> None:
    matrix = make.two_port()
    good = pr.Spectrum.from_admittance(make.FREQUENCY, matrix).save(tmp_path / "good.csv")
    assert pr.read_spectrum(good).cautions == ()
    one_way = matrix * [[1.0, 1.0], [0.0, 1.0]]
    with pytest.raises(pr.SpectrumError, match="from A to B and from B to A the admittances differ"):
        pr.read_spectrum(pr.Spectrum.from_admittance(make.FREQUENCY, one_way).save(tmp_path / "one_way.csv"))
    with pytest.raises(pr.SpectrumError, match="not those of a passive part"):
        pr.read_spectrum(pr.Spectrum.from_admittance(make.FREQUENCY, matrix.conj()).save(tmp_path / "mirrored.csv"))


@pytest.mark.parametrize(
    ("header", "told"),
    [
        (
            "frequency_hz,abs_z_ohm,temperature_k",
            "of the columns only “abs_z_ohm”; expected two that make an admittance",
        ),
        ("frequency_hz,Rs,Xs", "“Rs”: it names no unit; expected two"),
        ("frequency_hz,|Z| (dBm),phase_deg", "“|Z| (dBm)”: the unit “dBm” is not known; expected two"),
        ("Frequency,r_ohm,x_ohm", "“Frequency”: it names no unit; expected Hz, kHz, MHz or GHz"),
        ("frequency_s,r_ohm,x_ohm", "“frequency_s”: the unit “s” does not fit; expected Hz"),
        ("frequency_hz,f (kHz),x_ohm", "2 columns of frequency; expected one"),
    ],
)
def test_headers_that_are_refused_name_the_line_and_what_was_expected(header: str, told: str, table) -> None:
    with pytest.raises(pr.SpectrumError) as caught:
        table(header, make.FREQUENCY, Y.real, Y.imag)
    assert "measured.csv, line 1: " + told in str(caught.value)


def test_one_quantity_in_two_columns(table) -> None:
    header = "frequency_hz,g_s,b_s,conductance_ms"
    assert table(header, make.FREQUENCY, Y.real, Y.imag, Y.real * 1e3).admittance_s == pytest.approx(Y)
    with pytest.raises(pr.SpectrumError, match="“conductance_ms” and “g_s” are the same quantity with other values"):
        table(header, make.FREQUENCY, Y.real, Y.imag, Y.real)


def test_a_real_part_alone_shows_its_peak_in_the_refusal(table) -> None:
    f = np.linspace(95e3, 104e3, 2001)
    y = make.admittance(f)
    with pytest.raises(pr.SpectrumError) as caught:
        table("frequency_hz,conductance_s", f, y.real)
    found = re.search(r"R1 (.*) Ω, L1 (.*) mH, C1 (.*) pF, fs 100 kHz, Q (.*) \(of .*but not C0", str(caught.value))
    w, c, q = 2e5 * np.pi, 50e-12, 200.0  # of the first arm; the loss of C0 adds 0.2 % to the conductance
    expected = 1 / (w * c * q), 1e3 / (w**2 * c), 50, q
    assert tuple(map(float, found.groups())) == pytest.approx(expected, rel=0.02)
    with pytest.raises(pr.SpectrumError, match=r"line 1: resistance alone, which shows maximum .*, but not R1, L1"):
        table("frequency_hz,resistance_ohm", f, (1.0 / y).real)
    with pytest.raises(pr.SpectrumError, match="shows no peak with points at half of its height, but not C0"):
        table("frequency_hz,conductance_s", f, f * 1e-9)


# --- text ---


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1", "cp1252"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, end: str, tmp_path: Path) -> None:
    unit = "mΩ" if "utf" in encoding else "mOhm"
    text = make.plain(f"Frequency (Hz),|Z| ({unit}),Phase (°)", ("|Z|", "θz"), scales=(1.0, 1e-3, 1.0))
    path = tmp_path / "measured.csv"
    path.write_bytes(text.replace("\n", end).encode(encoding))
    assert pr.read_spectrum(path).admittance_s == pytest.approx(Y)


def test_both_decimal_signs_in_one_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "measured.csv"
    path.write_text(make.bode100().replace(",", ".", 1), encoding="utf-8")
    with pytest.raises(pr.SpectrumError, match=r"line 2: .* has a decimal point where others have a comma"):
        pr.read_spectrum(path)


def test_what_a_file_says_of_itself_is_kept_short_and_printable(tmp_path: Path) -> None:
    path = tmp_path / "measured\n\u202e.csv"
    comments = [f"# key {place}: {'long ' * 100}\u202e\u200b" for place in range(60)]
    path.write_text("\n".join([*comments, make.plain()]), encoding="utf-8")
    spectrum = pr.read_spectrum(path)
    assert len(spectrum.metadata) == 40
    for text in (*spectrum.metadata, *spectrum.metadata.values(), spectrum.source):
        assert text.isprintable()
        assert len(text) <= 120


def test_a_workbook_is_read_by_rows(tmp_path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    for row in [["Transducer"], ["f (kHz)", "G (S)", "B (S)"], *zip(F / 1e3, Y.real, Y.imag, strict=True)]:
        book.active.append([item if isinstance(item, str) else float(item) for item in row])
    book.save(path := tmp_path / "measured.xlsx")
    assert pr.read_spectrum(path).admittance_s == pytest.approx(Y)
    book.active["B7"] = "?"
    book.save(path)
    with pytest.raises(pr.SpectrumError, match=r"measured.xlsx, line 7: “\?” in column “G \(S\)” is no number"):
        pr.read_spectrum(path)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(pr.SpectrumError, match=r"measured.xlsx is no Excel workbook that can be read: .*as CSV"):
        pr.read_spectrum(path)


def test_a_workbook_without_its_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "openpyxl", None)
    (path := tmp_path / "measured.xlsx").write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(pr.SpectrumError, match=r"measured.xlsx is an Excel .* `pip install 'piezomotor\[excel\]'`"):
        pr.read_spectrum(path)
