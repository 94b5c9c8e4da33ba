# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables whose columns the user states."""

import re
from pathlib import Path

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


@pytest.mark.parametrize(
    "first",
    ["", "Frequenz (Hz);Betrag (Ohm);Phase (deg)\n", "Messung 7;;\n\n", "f;Z;phi\n", "# no header\n", "12,5;3\n"],
)
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
    assert is_the_circuit(read(tmp_path, numbers, ["frequency_khz", "Real part [Ohm]", "xs_kohm"]))


def test_columns_that_do_not_count_may_hold_anything(tmp_path: Path) -> None:
    rows = "".join(f"12:00,{line},ok\n" for line in NUMBERS.splitlines())
    assert is_the_circuit(read(tmp_path, rows, ["-", *MAGNITUDE, "-"]))


def test_a_header_that_contradicts_has_a_caution(tmp_path: Path) -> None:
    spectrum = read(tmp_path, "frequency_hz,R (Ohm),phase_deg\n" + NUMBERS, MAGNITUDE)
    assert is_the_circuit(spectrum)
    assert spectrum.cautions == ("The column headed “R (Ohm)” was read as magnitude_ohm, as specified.",)


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ("frequency_hz,magnitud_ohm,phase_deg", "columns: there is no 'magnitud_ohm'. Did you mean 'magnitude_ohm'?"),
        ("frequency_hz,color,phase_deg", "columns: there is no 'color'. Known are frequency_hz, "),
        ("frequency,magnitude_ohm,phase_deg", "columns: “frequency”: it names no unit. Write it as frequency_hz."),
        ("frequency_hz,R,X", "columns: “R”: it names no unit. Write it as resistance_ohm."),
        ("frequency_hz,|Z| (VA),phase_deg", "columns: “|Z| (VA)”: the unit “VA” is not known. Write it as magnitude_"),
        ("magnitude_ohm,phase_deg,-", "has no frequency. Add frequency_hz at its place."),
        ("frequency_hz,r_ohm,resistance_ohm", "“r_ohm” and “resistance_ohm” are the same quantity. Write -"),
        ("frequency_hz,resistance_ohm,phase_deg", "makes no admittance. Give two that make an admittance, such as"),
    ],
)
def test_columns_that_are_not_valid(columns: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(told)):
        read(tmp_path, NUMBERS, columns.split(","))


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
