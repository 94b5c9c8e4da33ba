# SPDX-License-Identifier: GPL-3.0-or-later
"""The spectrum itself: what it checks, how it is cut, connected, written."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.data.spectra import make

F = make.FREQUENCY


def one_port() -> pr.Spectrum:
    return pr.Spectrum.from_admittance(F, make.admittance(), source="stator 7", metadata={"date": "today"})


def two_port() -> pr.Spectrum:
    return pr.Spectrum.from_admittance(F, make.two_port(), source="stator 7")


def test_admittance_and_impedance_make_the_same_spectrum() -> None:
    spectrum = one_port()
    assert (spectrum.ports, len(spectrum)) == (1, 61)
    assert np.array_equal(spectrum.admittance_s, make.admittance())
    again = pr.Spectrum.from_impedance(F, spectrum.impedance_ohm)
    assert again.admittance_s == pytest.approx(spectrum.admittance_s, rel=1e-14)
    both = pr.Spectrum.from_impedance(F, np.linalg.inv(make.two_port()))
    assert both.matrix_s == pytest.approx(make.two_port(), rel=1e-12)


def test_a_two_port_is_driven_in_four_ways() -> None:
    spectrum, y = two_port(), make.two_port()
    assert np.array_equal(spectrum.driven("A").admittance_s, y[:, 0, 0])
    assert np.array_equal(spectrum.driven("B").admittance_s, y[:, 1, 1])
    assert spectrum.driven("A+B").admittance_s == pytest.approx(y.sum(axis=(1, 2)))
    assert spectrum.driven("A-B").admittance_s == pytest.approx(y[:, 0, 0] + y[:, 1, 1] - y[:, 0, 1] - y[:, 1, 0])
    assert spectrum.driven("A-B").metadata["connection"] == "A-B"
    assert spectrum.driven("A").source == "stator 7"


def test_a_two_port_has_no_one_admittance_and_a_one_port_is_not_connected() -> None:
    with pytest.raises(pr.SpectrumError, match="stator 7 has two ports; choose one of A, B, A\\+B, A-B by driven"):
        _ = two_port().admittance_s
    with pytest.raises(pr.SpectrumError, match="stator 7 has one port"):
        one_port().driven("A")
    with pytest.raises(pr.SpectrumError, match="connection 'C' is not valid"):
        two_port().driven("C")  # type: ignore[arg-type]


def test_a_band_is_cut_out_with_its_ends() -> None:
    part = one_port().between(96e3, 97e3)
    assert part.frequency_hz.tolist() == [96e3, 96250.0, 96500.0, 96750.0, 97e3]
    assert np.array_equal(part.admittance_s, make.admittance()[4:9])
    assert (part.source, part.metadata) == ("stator 7", {"date": "today"})
    assert len(one_port().between(start_hz=109e3)) == 5
    with pytest.raises(
        pr.SpectrumError, match="fewer than 2 points from 1 Hz to 2 Hz; it covers 95000 Hz to 110000 Hz"
    ):
        one_port().between(1.0, 2.0)


@pytest.mark.parametrize("spectrum", [one_port(), two_port()])
def test_the_csv_is_read_back_without_loss(spectrum: pr.Spectrum, tmp_path: Path) -> None:
    again = pr.read_spectrum(spectrum.save(tmp_path / "spectrum.csv"))
    assert np.array_equal(again.frequency_hz, spectrum.frequency_hz)
    assert np.array_equal(again.matrix_s, spectrum.matrix_s)
    assert again.cautions == ()


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(pr.ParameterError, match=r"let it end in \.json, \.csv"):
        one_port().save(tmp_path / "spectrum.txt")
    with pytest.raises(pr.ParameterError, match="Choose another place"):
        one_port().save(tmp_path / "absent" / "spectrum.csv")


def test_the_arrays_are_copies_and_locked() -> None:
    frequency = F.copy()
    spectrum = pr.Spectrum.from_admittance(frequency, make.admittance())
    frequency[0] = 1.0
    assert spectrum.frequency_hz[0] == F[0]
    with pytest.raises(ValueError, match="read-only"):
        spectrum.matrix_s[0] = 0.0
    assert np.array_equal(pickle.loads(pickle.dumps(spectrum)).matrix_s, spectrum.matrix_s)


@pytest.mark.parametrize(
    ("frequency", "admittance", "told"),
    [
        ([1.0], [1j], "at least 2 frequencies; there is 1"),
        ([], [], "there are 0"),
        ([1.0, 2.0], [1j], "shape \\(2, 1, 1\\)"),
        ([1.0, 2.0], np.zeros((2, 3, 3)), "shape \\(2, 1, 1\\) or \\(2, 2, 2\\), not \\(2, 3, 3\\)"),
        ([1.0, 2.0], [1j, np.nan], "finite"),
        ([1.0, np.inf], [1j, 1j], "finite"),
        ([0.0, 1.0], [1j, 1j], "above 0 Hz"),
        ([2.0, 1.0], [1j, 1j], "rise from point to point"),
        ([1.0, 1.0], [1j, 1j], "rise from point to point"),
    ],
)
def test_what_is_no_spectrum_is_refused(frequency: list[float], admittance: object, told: str) -> None:
    with pytest.raises(pr.SpectrumError, match=told):
        pr.Spectrum.from_admittance(frequency, admittance)  # type: ignore[arg-type]


def test_an_impedance_of_zero_has_no_admittance() -> None:
    with pytest.raises(pr.SpectrumError, match="zero or singular"):
        pr.Spectrum.from_impedance([1.0, 2.0], [1.0, 0.0])
