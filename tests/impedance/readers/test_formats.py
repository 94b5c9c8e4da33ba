# SPDX-License-Identifier: GPL-3.0-or-later
"""Every format gives back the known circuit that its file was made of, to the digits printed."""

import re
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.admittance import Admittance
from tests.data.spectra import make

FOLDER = Path(make.__file__).parent
FORMATS = {  # file → format, relative error that its printed digits allow
    "aim.csv": ("AIM CSV", 1e-9),
    "bode100.csv": ("Omicron Bode 100 CSV", 1e-13),
    "bode100_settings.csv": ("Omicron Bode 100 CSV", 1e-13),
    "e4990a.csv": ("Keysight E4990A CSV", 2e-11),
    "hp4294a_cs_d.txt": ("4294A ASCII", 1e-6),
    "hp4294a_turned.txt": ("4294A ASCII", 2e-6),
    "mfia.csv": ("Zurich Instruments MFIA CSV", 1e-11),
    "nanovna.csv": ("NanoVNA CSV", 5e-4),
    "one_port.s1p": ("Touchstone", 1e-12),
    "plain.csv": ("plain CSV", 1e-13),
    "two_port.csv": ("two-port CSV", 1e-11),
    "two_port.s2p": ("Touchstone", 1e-12),
    "waveforms.csv": ("Digilent WaveForms CSV", 1e-13),
}
TURNED = ("by 360°", "off by 180°")
TOLD = {  # what the cautions must tell, and nothing else
    "hp4294a_cs_d.txt": ("memory trace",),
    "hp4294a_turned.txt": TURNED,
    "mfia.csv": ("2 sweeps",),
}


def error_of(spectrum: pr.Spectrum, scale: float = 1.0) -> float:
    """Largest error, relative to the largest entry of each point."""
    assert spectrum.frequency_hz == pytest.approx(make.FREQUENCY, rel=1e-12)
    truth = scale * (make.two_port() if spectrum.ports == 2 else make.admittance()[:, None, None])
    return float(np.max(np.abs(spectrum.matrix_s - truth).max(axis=(1, 2)) / np.abs(truth).max(axis=(1, 2))))


def read(folder: Path, text: str, name: str = "measured.dat", trace: str | None = None) -> pr.Spectrum:
    path = folder / name
    path.write_text(text, encoding="utf-8", newline="")
    return pr.read_spectrum(path, trace=trace)


def test_every_file_beside_the_script_is_tested_and_made_by_it() -> None:
    there = {path.name for path in FOLDER.iterdir() if path.is_file() and path.suffix != ".py"}
    assert there == set(FORMATS) == set(make.FILES)


@pytest.mark.parametrize("name", FORMATS)
def test_the_files_are_those_that_the_script_makes(name: str) -> None:
    number = re.compile(rb"[-+]?[0-9]+(?:[.,][0-9]+)?(?:e[-+]?[0-9]+)?")
    there, made = (FOLDER / name).read_bytes(), make.FILES[name]
    assert number.sub(b"#", there) == number.sub(b"#", made)
    values = [[float(word.replace(b",", b".")) for word in number.findall(text)] for text in (there, made)]
    assert values[0] == pytest.approx(values[1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_gives_back_the_circuit(name: str) -> None:
    spectrum = pr.read_spectrum(FOLDER / name)
    format_name, tolerance = FORMATS[name]
    assert (spectrum.format, spectrum.source) == (format_name, name)
    assert error_of(spectrum) < tolerance
    told = TOLD.get(name, ())
    assert len(spectrum.cautions) == len(told)
    assert all(part in caution for part, caution in zip(told, spectrum.cautions, strict=True))


# --- E4990A ---


@pytest.mark.parametrize(
    ("names", "keys"),
    [
        (("R(Ohm)", "X(Ohm)"), ("R", "X")),
        (("G(S)", "B(S)"), ("G", "B")),
        (("|Y|(S)", "theta-y(deg)"), ("|Y|", "θy")),
        (("|Y|(S)", "theta-z(deg)"), ("|Y|", "θz")),
        (("|Z|(Ohm)", "theta-y(deg)"), ("|Z|", "θy")),
        (("CP(F)", "D()"), ("Cp", "D")),
        (("CS(F)", "RS(Ohm)"), ("Cs", "R")),
        (("LP(H)", "RP(Ohm)"), ("Lp", "Rp")),
        (("LS(H)", "Q()"), ("Ls", "Q")),
    ],
)
def test_any_two_traces_of_the_e4990a(names: tuple[str, str], keys: tuple[str, str], tmp_path: Path) -> None:
    spectrum = read(tmp_path, make.e4990a(names, keys))
    assert error_of(spectrum) < 1e-9
    assert spectrum.metadata["instrument"].startswith("Keysight Technologies,E4990A")


def test_the_memory_trace_of_the_e4990a_is_read_when_asked_for(tmp_path: Path) -> None:
    text = make.e4990a(("R(Ohm)", "X(Ohm)", "G(S)", "B(S)"), ("R", "X", "G", "B"))
    text = text.replace("G(S)-data", "R(Ohm)-memory").replace("B(S)-data", "X(Ohm)-memory")
    assert error_of(read(tmp_path, text)) < 1e-9
    memory = read(tmp_path, text, trace="memory")
    assert memory.impedance_ohm == pytest.approx(make.admittance(), rel=1e-9)
    with pytest.raises(pr.SpectrumError, match="trace=“other” is not valid"):
        read(tmp_path, text, trace="other")


# --- 4294A ---


@pytest.mark.parametrize("mnemonic", make.PAIRS_4294A)
def test_every_pair_of_the_4294a(mnemonic: str, tmp_path: Path) -> None:
    spectrum = read(tmp_path, make.hp4294a(mnemonic))
    root = mnemonic.startswith("IML") or mnemonic in ("IMCS", "IMCP")  # R as what |Z| leaves beside X
    assert error_of(spectrum) < (5e-5 if root else 2e-6)
    assert bool(spectrum.cautions) == root


@pytest.mark.parametrize(
    ("named", "mnemonic"),
    [
        *((name, name) for name in make.PAIRS_4294A),
        ("IMPEDANCE REAL IMAG", "IRIM"),
        ("ADMITTANCE REAL IMAG", "ARIM"),
        ("SERIES CAPACITANCE DISSIPATION FACTOR", "CSD"),
        ("PARALLEL INDUCTANCE CONDUCTANCE", "LPG"),
        ("|Z|-θ", "IMPH"),
    ],
)
def test_pairs_of_the_4294a_by_their_mnemonics_and_spelled_out(named: str, mnemonic: str, tmp_path: Path) -> None:
    assert error_of(read(tmp_path, make.hp4294a(mnemonic, named=named))) < (5e-5 if named == mnemonic else 2e-6)


@pytest.mark.parametrize("named", ["|Z|-Rs", "IMQ", "|Z|-D", "LEVEL MONITOR", "", "PHASE PHASE"])
def test_pairs_of_the_4294a_that_make_no_admittance_are_refused(named: str, tmp_path: Path) -> None:
    with pytest.raises(pr.SpectrumError, match=r"line 5: .*; expected a pair such as"):
        read(tmp_path, make.hp4294a("IMPH", named=named or " "))


def test_the_phase_of_the_4294a_in_radians(tmp_path: Path) -> None:
    text = make.hp4294a("IMPH", named="IMPEDANCE MAG PHASE (RAD)")
    head, _, phase = text.partition('"TRACE: B"')
    rows = [line.split("\t") for line in phase.splitlines()]
    turned = [
        "\t".join([r[0], f"{np.deg2rad(float(r[1])):.9e}", r[2]]) if r[0][:1].isdigit() else "\t".join(r) for r in rows
    ]
    assert error_of(read(tmp_path, head + '"TRACE: B"' + "\n".join(turned) + "\n")) < 2e-6


@pytest.mark.parametrize("mnemonic", ["CSD", "AMPH", "COMP"])
def test_the_memory_trace_of_the_4294a(mnemonic: str, tmp_path: Path) -> None:
    text = make.hp4294a(mnemonic, memory=True)
    assert error_of(read(tmp_path, text)) < 2e-6
    memory = read(tmp_path, text, trace="memory")
    assert error_of(memory, scale=2.0) < 2e-6
    assert memory.cautions == ()
    with pytest.raises(pr.SpectrumError, match="has no trace but data; trace=“memory” is not valid"):
        read(tmp_path, make.hp4294a(mnemonic), trace="memory")


@pytest.mark.parametrize("mnemonic", ["IMQ", "IMPH"])
def test_the_data_array_of_the_4294a_is_r_and_x_for_every_display(mnemonic: str, tmp_path: Path) -> None:
    named = "|Z|-Q" if mnemonic == "IMQ" else None
    assert error_of(read(tmp_path, make.hp4294a("IMPH", named=named, arrays=True))) < 2e-6


# --- Bode 100 ---


@pytest.mark.parametrize(("mark", "decimal"), [(";", "."), (";", ","), (",", "."), ("\t", "."), ("\t", ",")])
@pytest.mark.parametrize("settings", [False, True])
@pytest.mark.parametrize("polar", [False, True])
def test_separators_and_decimal_signs_of_the_bode_100(
    mark: str, decimal: str, settings: bool, polar: bool, tmp_path: Path
) -> None:
    spectrum = read(tmp_path, make.bode100(mark, decimal, settings=settings, polar=polar))
    assert spectrum.format == "Omicron Bode 100 CSV"
    assert error_of(spectrum) < 1e-12


def test_gain_of_the_bode_100_is_no_impedance(tmp_path: Path) -> None:
    with pytest.raises(pr.SpectrumError, match=r"line 1: no column of a quantity that is known; expected two"):
        read(tmp_path, make.bode100().replace("Impedance", "Gain").replace("(Ω)", ""))


# --- WaveForms, MFIA, AIM ---


@pytest.mark.parametrize(
    "names",
    [("Rs (Ohm)", "Xs (Ohm)"), ("|Y| (S)", "Cp (F)", "D"), ("th (deg)", "|Z| (Ohm)"), ("Gp (S)", "Bp (S)", "th (deg)")],
)
def test_the_columns_that_waveforms_shows_may_differ(names: tuple[str, ...], tmp_path: Path) -> None:
    spectrum = read(tmp_path, make.waveforms(names))
    assert (spectrum.format, spectrum.metadata["Resistor"]) == ("Digilent WaveForms CSV", "1 kOhm")
    assert error_of(spectrum) < 1e-12


def test_waveforms_greek_theta_and_export_without_comments(tmp_path: Path) -> None:
    text = make.waveforms(("th (deg)", "|Z| (Ohm)")).partition("\r\n\r\n")[2].replace("Trace th", "Trace θ")
    spectrum = read(tmp_path, text)
    assert spectrum.format == "Digilent WaveForms CSV"
    assert error_of(spectrum) < 1e-12


@pytest.mark.parametrize(
    "fields", [("frequency", "realz", "imagz"), ("grid", "realz", "imagz"), ("absz", "phasez", "frequency")]
)
def test_the_fields_that_labone_saves_may_differ(fields: tuple[str, ...], tmp_path: Path) -> None:
    assert error_of(read(tmp_path, make.mfia(fields, sweeps=1))) < 1e-11
    assert error_of(read(tmp_path, make.mfia(fields, sweeps=1).replace(";", ","))) < 1e-11


def test_the_sweeps_of_the_mfia_are_chosen_by_number(tmp_path: Path) -> None:
    text = make.mfia(sweeps=3)
    for sweep in range(3):
        assert error_of(read(tmp_path, text, trace=str(sweep)), scale=1.0 + sweep) < 1e-11
    with pytest.raises(pr.SpectrumError, match="no sweep “7”; it has 0, 1, 2"):
        read(tmp_path, text, trace="7")


def test_the_header_of_an_aim_file_decides(tmp_path: Path) -> None:
    assert error_of(read(tmp_path, make.aim("Frequency,SWR,R,X,Z,theta,rho,RL,P"))) < 1e-9
    with pytest.raises(pr.SpectrumError, match="none of the formats that are known"):
        read(tmp_path, make.aim("").lstrip())


# --- Touchstone ---


@pytest.mark.parametrize("ports", [1, 2])
@pytest.mark.parametrize(
    "option",
    [
        "# Hz S RI R 50",
        "# kHz S MA R 50",
        "# MHz S DB R 600",
        "# GHz S RI R 1000",
        "# Hz Y RI R 1",
        "# Hz Y MA R 50",
        "# hz z ri r 50",
        "# KHZ Z DB R 1",
    ],
)
def test_options_of_touchstone(option: str, ports: int, tmp_path: Path) -> None:
    spectrum = read(tmp_path, make.touchstone(option, ports))
    assert (spectrum.format, spectrum.ports) == ("Touchstone", ports)
    assert error_of(spectrum) < 1e-11
    normalised = option[1:].split()[1].lower() != "s" and option.split()[-1] != "1"
    assert [caution for caution in spectrum.cautions if "normalised" in caution] == list(spectrum.cautions)
    assert bool(spectrum.cautions) == normalised


NOISE = "! noise\n90000 0.5 0.1 20 0.3\n100000 0.6 0.1 20 0.3\n"  # parameters that are left out
VARIANTS = {
    "quoted headings of the Bode 100": re.sub(r"([^;\r]*(?:Real|Imag)[^;\r]*)", r'"\1"', make.bode100(), count=4),
    "tabs as the 4294A saves Touchstone": make.touchstone("# KHZ S MA R 50").partition("\n")[2].replace(" ", "\t"),
    "noise parameters after a two-port": make.touchstone("# Hz S RI R 50", 2) + NOISE,
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_of_a_format_is_read(name: str, tmp_path: Path) -> None:
    assert error_of(read(tmp_path, VARIANTS[name])) < 1e-12


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[Version] 2.0\n# Hz S RI R 50\n", "line 1: Touchstone 2; expected version 1"),
        ("# Hz S RI R 50\n1 2 3 4\n2 2 3 4\n", r"line 2: 4 numbers; expected 3 \(one port\) or 9 \(two ports\)"),
        ("# Hz S RI R 50\n1 0.2 x\n", "line 2: “x” is no number"),
        ("# Hz H RI R 50\n1 0.2 0.1\n2 0.2 0.1\n", "line 1: H parameters; expected S, Y or Z"),
        ("# Hz S RI R 0\n1 0.2 0.1\n2 0.2 0.1\n", "reference resistance is not above 0"),
        ("# Hz S S RI R 50\n1 0.2 0.1\n2 0.2 0.1\n", "names something twice"),
        ("# Hz S RI R 50\n1 0.2 0.1\n", "only 1 complete points"),
        ("# Hz Z RI R 50\n1 0 0\n2 0.2 0.1\n", "fewer than 2 complete points"),
    ],
)
def test_touchstone_that_is_refused(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(pr.SpectrumError, match=told):
        read(tmp_path, text)


# --- plain ---


@pytest.mark.parametrize(
    ("header", "keys", "scales"),
    [
        ("Frequency (kHz), |Z| (kOhm), Phase (deg)", ("|Z|", "θz"), (1e3, 1e3, 1.0)),
        ("freq [MHz],Z[MΩ],theta[°]", ("|Z|", "θz"), (1e6, 1e6, 1.0)),
        ("f/Hz,Re(Z)/Ω,-Im(Z)/Ω", ("R", "X"), (1.0, 1.0, -1.0)),
        ("frequency_mhz,phase_z_rad,abs_z_ohm", ("θz", "|Z|"), (1e6, 180.0 / np.pi, 1.0)),
        ("Frequency (Hz),|Y| (mS),Phase (rad)", ("|Y|", "θy"), (1.0, 1e-3, 180.0 / np.pi)),
        ("Frequency (Hz),Cp (pF),D", ("Cp", "D"), (1.0, 1e-12, 1.0)),
        ("Frequency (Hz),Ls (µH),Rs (mohm)", ("Ls", "R"), (1.0, 1e-6, 1e-3)),
        ("frequency_khz,cs_nf,rs_ohm", ("Cs", "R"), (1e3, 1e-9, 1.0)),
        ("Frequency (Hz),Real (Ohm),Imag (Ohm)", ("R", "X"), (1.0, 1.0, 1.0)),
        ("Frequency (Hz),Real (S),Imaginary (S)", ("G", "B"), (1.0, 1.0, 1.0)),
        ("Frequency (Hz),Magnitude (S),Phase (deg)", ("|Y|", "θy"), (1.0, 1.0, 1.0)),
        ("# frequency_hz,conductance_us,susceptance_us", ("G", "B"), (1.0, 1e-6, 1e-6)),
        ("Frequency (Hz),Rp (kΩ),Xp (kΩ)", ("Rp", "Xp"), (1.0, 1e3, 1e3)),
    ],
)
def test_headers_that_name_quantity_and_unit(
    header: str, keys: tuple[str, str], scales: tuple[float, float, float], tmp_path: Path
) -> None:
    spectrum = read(tmp_path, make.plain(header, keys, scales=scales))
    assert (spectrum.format, spectrum.cautions) == ("plain CSV", ())
    assert error_of(spectrum) < 1e-11


@pytest.mark.parametrize(
    ("mark", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), (" ", ",")]
)
def test_separators_of_plain_tables(mark: str, decimal: str, tmp_path: Path) -> None:
    header = mark.join(["frequency_hz", "conductance_s", "susceptance_s"])
    assert error_of(read(tmp_path, make.plain(header, mark=mark, decimal=decimal))) < 1e-12


def test_comments_above_and_other_columns_do_not_matter(tmp_path: Path) -> None:
    rows = make.plain().splitlines()
    table = [rows[0] + ",note,time", *(f'{row},"a; b",12:00:{place:02d}' for place, row in enumerate(rows[1:]))]
    spectrum = read(tmp_path, "\n".join(["# device: stator 7", "# a comment", *table, "", ""]))
    assert error_of(spectrum) < 1e-13
    assert spectrum.metadata == {"device": "stator 7", "comment": "a comment"}


def test_the_csv_of_the_admittance_command_is_read(tmp_path: Path, motor_admittance: Admittance) -> None:
    path = motor_admittance.save(tmp_path / "admittance.csv")
    spectrum = pr.read_spectrum(path)
    assert spectrum.ports == 2
    assert spectrum.cautions == ()
    assert spectrum.matrix_s == pytest.approx(motor_admittance.matrix_s, rel=1e-11, abs=1e-15)


@pytest.fixture(scope="module")
def motor_admittance() -> Admittance:
    return pr.admittance(pr.load_motor("andersen2002"), points=50)
