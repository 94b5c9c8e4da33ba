# SPDX-License-Identifier: GPL-3.0-or-later
"""One device between the ports of a two-port measurement."""

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.readers.quantities import Complexes
from tests.data.spectra import make

ASSUMED = {
    "series": "The two ports are those of one device in series between them, and it was read as one port. Specify ",
    "shunt": "The two ports are those of one device from the line to ground (a shunt), and it was read as one port. ",
}


def scattering(device: str) -> Complexes:
    """S-parameters of a network of scikit-rf: a load in series with a line of no length, or across it."""
    from skrf import Frequency
    from skrf.circuit import Circuit
    from skrf.media import DefinedGammaZ0
    from skrf.network import Network

    frequency = Frequency.from_f(make.FREQUENCY, unit="hz")
    media = DefinedGammaZ0(frequency, z0=50.0)
    if device == "shunt":
        load = media.load((1.0 / make.admittance() - 50.0) / (1.0 / make.admittance() + 50.0))
        return np.asarray(media.shunt(load).s)
    ports = [Circuit.Port(frequency, f"port{number}", z0=50.0) for number in (1, 2)]
    series: Network = Circuit.SeriesImpedance(frequency, 1.0 / make.admittance(), "device", 50.0)
    return np.asarray(Circuit([[(ports[0], 0), (series, 0)], [(ports[1], 0), (series, 1)]]).network.s)


def write(folder: Path, s: Complexes, option: str = "# Hz S RI R 50") -> Path:
    path = folder / "measured.s2p"
    rows = s.transpose(0, 2, 1).reshape(len(s), 4)
    lines = [option] + [
        " ".join(
            map(repr, [float(frequency), *(part for cell in row for part in (float(cell.real), float(cell.imag)))])
        )
        for frequency, row in zip(make.FREQUENCY, rows, strict=True)
    ]
    path.write_text("\n".join([*lines, ""]), encoding="ascii")
    return path


@pytest.mark.parametrize("device", ["series", "shunt"])
def test_one_device_between_the_ports_is_recognised_by_the_parameters(device: str, tmp_path: Path) -> None:
    path = write(tmp_path, scattering(device))
    found, stated = pr.read_spectrum(path), pr.read_spectrum(path, through=device)  # type: ignore[arg-type]
    (caution,) = found.cautions
    assert caution.startswith(ASSUMED[device])
    assert stated.cautions == ()
    for spectrum in (found, stated):
        assert spectrum.admittance_s == pytest.approx(make.admittance(), rel=1e-9)


@pytest.mark.parametrize("device", ["series", "shunt"])
def test_a_fixture_that_is_not_perfect_is_recognised_too(device: str, tmp_path: Path) -> None:
    """With errors of 0.003 (0.03 dB); this device passes 0.05 in series, so that greater ones would hide the rule."""
    rng = np.random.default_rng(5)
    s = scattering(device)
    size = 0.003
    noisy = s + size * (rng.standard_normal(s.shape) + 1j * rng.standard_normal(s.shape)) / np.sqrt(2.0)
    assert pr.read_spectrum(write(tmp_path, noisy)).cautions[0].startswith(ASSUMED[device])


def test_a_file_with_the_transmission_alone_needs_the_device_stated(tmp_path: Path) -> None:
    s = scattering("shunt")
    s[:, [0, 0, 1], [0, 1, 1]] = 0.0
    path = write(tmp_path, s)
    with pytest.raises(pr.SpectrumError, match="between the ports, specify through = series or shunt"):
        pr.read_spectrum(path)
    assert pr.read_spectrum(path, through="shunt").admittance_s == pytest.approx(make.admittance(), rel=1e-9)


def test_through_where_there_is_nothing_between_two_ports(tmp_path: Path) -> None:
    folder = Path(make.__file__).parent
    with pytest.raises(
        pr.SpectrumError, match=r"line 2: one port; expected S parameters of two ports, or through left"
    ):
        pr.read_spectrum(folder / "one_port.s1p", through="series")
    with pytest.raises(pr.SpectrumError, match=r"line 1: Y parameters; expected S parameters of two ports"):
        pr.read_spectrum(write(tmp_path, scattering("series"), "# Hz Y RI R 50"), through="series")
    with pytest.raises(pr.SpectrumError, match=r"\(plain CSV\) is no Touchstone file of two ports; leave through out"):
        pr.read_spectrum(folder / "plain.csv", through="shunt")
    with pytest.raises(pr.ParameterError, match="through = 'across' is not valid: it must be 'series' or 'shunt'"):
        pr.read_spectrum(folder / "two_port.s2p", through="across")  # type: ignore[arg-type]
