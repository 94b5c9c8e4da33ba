# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables in other languages, and tables whose columns the user states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.data.spectra import make

MAGNITUDE = ["frequency_hz", "magnitude_ohm", "phase_deg"]
NUMBERS = "".join(make.plain("header", ("|Z|", "θz")).splitlines(keepends=True)[1:])


def read(folder: Path, content: str | bytes, columns: list[str] | None = None) -> pr.Spectrum:
    path = folder / "measured.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return pr.read_spectrum(path, columns=columns)


def is_the_circuit(spectrum: pr.Spectrum) -> bool:
    return spectrum.admittance_s == pytest.approx(make.admittance(), rel=1e-11)


# --- languages ---

HEADERS = [
    ("Frequenz [Hz];Betrag [kOhm];Phase [°]", ("|Z|", "θz"), (1.0, 1e3, 1.0)),
    ("Frequenz in kHz;Scheinwiderstand in Ohm;Phasenwinkel in Grad", ("|Z|", "θz"), (1e3, 1.0, 1.0)),
    ("Frequenz (Hz);Realteil (Ohm);Imaginärteil (Ohm)", ("R", "X"), (1.0, 1.0, 1.0)),
    ("Frequenz (Hz);Widerstand (kOhm);Blindwiderstand (kOhm)", ("R", "X"), (1.0, 1e3, 1e3)),
    ("Messfrequenz/Hz;Leitwert/mS;Blindleitwert/µS", ("G", "B"), (1.0, 1e-3, 1e-6)),
    ("Frequenz (Hz);Parallelkapazität (pF);Verlustfaktor", ("Cp", "D"), (1.0, 1e-12, 1.0)),
    ("Fréquence (kHz);Module (Ohm);Phase (degrés)", ("|Z|", "θz"), (1e3, 1.0, 1.0)),
    ("Fréquence (Hz);Partie réelle (S);Partie imaginaire (S)", ("G", "B"), (1.0, 1.0, 1.0)),
    ("Fréquence en Hz;Résistance en Ohm;Réactance en Ohm", ("R", "X"), (1.0, 1.0, 1.0)),
    ("Fréquence (Hz);Admittance (mS);Déphasage (rad)", ("|Y|", "θy"), (1.0, 1e-3, 180.0 / np.pi)),
    ("Fréquence (Hz);Module de l’impédance (Ohm);Phase de l’impédance (°)", ("|Z|", "θz"), (1.0, 1.0, 1.0)),
]


@pytest.mark.parametrize("lost", ["no", "latin-1", "twice", "question marks", "U+FFFD", "DOS", "left out"])
@pytest.mark.parametrize(("header", "keys", "scales"), HEADERS)
def test_german_and_french_headers_also_when_their_accents_are_lost(
    header: str, keys: tuple[str, str], scales: tuple[float, float, float], lost: str, tmp_path: Path
) -> None:
    """``twice``: UTF-8 read as Windows' Western European and written again. The decimal sign is a comma."""
    text = make.plain(header, keys, mark=";", decimal=",", scales=scales)
    if "°" in text or "µ" in text:
        text = text if lost in ("no", "latin-1", "twice") else text.replace("°", "deg").replace("µS", "uS")
    text = text.replace("’", "'") if lost != "no" else text
    letters = sorted({sign for sign in text if sign.isalpha() and not sign.isascii()})
    for sign in letters if lost in ("question marks", "U+FFFD", "left out") else ():
        text = text.replace(sign, {"question marks": "?", "U+FFFD": "\N{REPLACEMENT CHARACTER}", "left out": ""}[lost])
    for sign in letters if lost == "twice" else ():
        text = text.replace(sign, sign.encode().decode("latin-1"))
    text = text.replace("°", "Â°") if lost == "twice" else text
    spectrum = read(tmp_path, text.encode({"latin-1": "latin-1", "DOS": "cp850"}.get(lost, "utf-8")))
    assert (spectrum.format, spectrum.cautions) == ("plain CSV", ())
    assert is_the_circuit(spectrum)


# --- columns that the user states ---


@pytest.mark.parametrize("first", ["", "Messung 7;;\n\n", "f;Z;phi\n", "# no header\n", "12,5;3\n"])
def test_a_table_without_a_header_is_read_with_its_columns_stated(first: str, tmp_path: Path) -> None:
    numbers = NUMBERS.replace(",", ";").replace(".", ",")
    with pytest.raises(pr.SpectrumError, match="--columns frequency_hz,magnitude_ohm,phase_deg"):
        read(tmp_path, first + numbers)
    spectrum = read(tmp_path, first + numbers, MAGNITUDE)
    assert (spectrum.format, spectrum.cautions) == ("plain CSV", ())
    assert spectrum.metadata["columns"] == "frequency_hz,magnitude_ohm,phase_deg"
    assert is_the_circuit(spectrum)


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
@pytest.mark.parametrize("decimal", [".", ","])
def test_stated_columns_in_every_separator_and_decimal_sign(mark: str, decimal: str, tmp_path: Path) -> None:
    if mark == decimal:
        return
    numbers = make.plain("f", ("R", "X"), mark=mark, decimal=decimal, scales=(1e3, 1.0, 1e3)).partition("\n")[2]
    assert is_the_circuit(read(tmp_path, numbers, ["frequency_khz", "Realteil [Ohm]", "xs_kohm"]))


def test_columns_that_do_not_count_may_hold_anything(tmp_path: Path) -> None:
    rows = "".join(f"12:00,{line},ok\n" for line in NUMBERS.splitlines())
    assert is_the_circuit(read(tmp_path, rows, ["-", *MAGNITUDE, "-"]))


def test_a_header_that_contradicts_has_a_caution(tmp_path: Path) -> None:
    spectrum = read(tmp_path, "frequency_hz,R (Ohm),phase_deg\n" + NUMBERS, MAGNITUDE)
    assert is_the_circuit(spectrum)
    assert spectrum.cautions == ("The column headed “R (Ohm)” was read as magnitude_ohm, as stated.",)


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ("frequency_hz,magnitud_ohm,phase_deg", "columns: there is no 'magnitud_ohm'. Did you mean 'magnitude_ohm'?"),
        ("frequency_hz,Betrag,phase_deg", "columns: “Betrag” names no unit. Write it as Betrag_ohm or Betrag_s."),
        ("frequency_hz,color,phase_deg", "columns: there is no 'color'. Known are frequency_hz, "),
        ("frequency,magnitude_ohm,phase_deg", "columns: “frequency”: it names no unit. Write it as frequency_hz."),
        ("frequency_hz,R,X", "columns: “R”: it names no unit. Write it as resistance_ohm."),
        ("frequency_hz,|Z| (dB),phase_deg", "columns: “|Z| (dB)”: the unit “dB” is not known. Write it as magnitude_"),
        ("magnitude_ohm,phase_deg,-", "has no frequency. Add frequency_hz at its place."),
        ("frequency_hz,r_ohm,resistance_ohm", "“r_ohm” and “resistance_ohm” are the same quantity. Write -"),
        ("frequency_hz,resistance_ohm,phase_deg", "makes no admittance. Give two that make an admittance, such as"),
    ],
)
def test_columns_that_are_not_valid(columns: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(pr.ParameterError) as caught:
        read(tmp_path, NUMBERS, columns.split(","))
    assert told in str(caught.value)


def test_columns_that_are_not_those_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(
        pr.SpectrumError, match=r"line 1: 3 columns, but columns states 4; expected a name for each, - f"
    ):
        read(tmp_path, NUMBERS, [*MAGNITUDE, "-"])
    with pytest.raises(
        pr.SpectrumError, match=r"measured\.csv has no row of 3 numbers, one for each of frequency_hz,m"
    ):
        read(tmp_path, "nothing\nbut words\n", MAGNITUDE)
    broken = NUMBERS.replace("\n", "\n1,x,2\n", 1)
    with pytest.raises(pr.SpectrumError, match="line 2: “x” in column “magnitude_ohm” is no number"):
        read(tmp_path, broken, MAGNITUDE)
    with pytest.raises(pr.ParameterError, match="columns are those of a plain table"):
        pr.read_spectrum(tmp_path / "measured.csv", columns=MAGNITUDE, trace="memory")
    with pytest.raises(
        pr.ParameterError, match="columns = 'frequency_hz' is not valid: 'str' instances are not allowed"
    ):
        pr.read_spectrum(tmp_path / "measured.csv", columns="frequency_hz")
