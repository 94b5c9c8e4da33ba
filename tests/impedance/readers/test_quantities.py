# SPDX-License-Identifier: GPL-3.0-or-later
"""What headings mean."""

from math import pi

import pytest

from pyspice_runner.impedance.readers.quantities import heading, unit_of


@pytest.mark.parametrize(
    ("cell", "kind", "scale"),
    [
        ("Frequency(Hz)", "frequency", 1.0),
        ("Frequency (kHz)", "frequency", 1e3),
        ("FREQ [MHZ]", "frequency", 1e6),
        ("frequency_mhz", "frequency", 1e6),
        ("frequency_mHz", "frequency", 1e-3),
        ("f/GHz", "frequency", 1e9),
        ("|Z|(Ohm)-data", "abs_z", 1.0),
        ("theta-z(deg)-data", "phase_z", pi / 180),
        ("theta-y(rad)", "phase_y", 1.0),
        ("LS(H)-Data", "ls", 1.0),
        ("Cp (pF)", "cp", 1e-12),
        ("cp_nf", "cp", 1e-9),
        ("Rs (Ω)", "r", 1.0),
        ("Rs (\N{OHM SIGN})", "r", 1.0),
        ("Xs (kOhm)", "x", 1e3),
        ("Rp (MΩ)", "rp", 1e6),
        ("G (µS)", "g", 1e-6),
        ("G (μS)", "g", 1e-6),
        ("B (mS)", "b", 1e-3),
        ("-Im(Z) (Ohm)", "x", -1.0),
        ("\N{MINUS SIGN}Z″ (Ω)", "x", -1.0),
        ("Z' (Ω)", "r", 1.0),
        ("Re(Y) [S]", "g", 1.0),
        ("Magnitude (Ω)", "abs_z", 1.0),
        ("Magnitude (S)", "abs_y", 1.0),
        ("real_s", "g", 1.0),
        ("imag_ohm", "x", 1.0),
        ("phase (°)", "phase", pi / 180),
        ("Phase", "phase", None),
        ("Q()-data", "q", 1.0),
        ("D", "d", 1.0),
        ("Rs", "r", None),
        ("conductance_s", "g", 1.0),
        ("Time (s)", None, None),
        ("Return Loss(dB)", None, None),
        ("x" * 1000, None, None),
        ("", None, None),
    ],
)
def test_headings(cell: str, kind: str | None, scale: float | None) -> None:
    found = heading(cell)
    assert (found.kind, found.wrong) == (kind, "")
    assert found.scale == (None if scale is None else pytest.approx(scale))


@pytest.mark.parametrize(
    ("cell", "wrong"),
    [
        ("Frequency (parsec)", "the unit “parsec” is not known"),
        ("|Z| (S)", "the unit “S” does not fit"),
        ("|Z| (dBm)", "the unit “dBm” is not known"),
        ("Magnitude (dB)", "it names dB without the quantity, |Z| or |Y|"),
        ("Phase (Ohm)", "the unit “Ohm” does not fit"),
    ],
)
def test_units_that_do_not_fit(cell: str, wrong: str) -> None:
    assert heading(cell).wrong == wrong


@pytest.mark.parametrize("unit", ["Hertzes", "xHz", "kk", "Ohm/s", "1e3", "__import__('os')"])
def test_units_that_are_not_known(unit: str) -> None:
    assert unit_of(unit) is None
