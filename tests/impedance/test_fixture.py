# SPDX-License-Identifier: GPL-3.0-or-later
"""A device behind a fixture is found again from the open, the short and the load."""

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.fixture import without_fixture
from tests.said import printed

FREQUENCY = np.linspace(38e3, 42e3, 801)
S = 2j * np.pi * FREQUENCY
RESISTANCE, INDUCTANCE, CAPACITANCE, CLAMPED = 120.0, 0.16, 1.0 / (0.16 * (2.0 * np.pi * 40e3) ** 2), 2e-9
DEVICE = 1.0 / (S * CLAMPED + 1.0 / (RESISTANCE + S * INDUCTANCE + 1.0 / (S * CAPACITANCE)))


def spectrum(impedance: np.ndarray) -> pr.Spectrum:
    return pr.Spectrum.from_admittance(FREQUENCY, 1.0 / impedance)


def seen(impedance: np.ndarray | float) -> np.ndarray:
    """Through 25 Ω and 1 mH in series, and 300 pF with 2 MΩ across the device: a long cable's worth of fixture."""
    return 25.0 + 1e-3 * S + 1.0 / (S * 300e-12 + 5e-7 + 1.0 / impedance)


def seen_through_a_cable(impedance: np.ndarray | float) -> np.ndarray:
    """Through a lossy line of 75 Ω, of which open and short alone do not tell the device."""
    turn = np.tanh(0.02 + S * 300e-9)
    return 75.0 * (impedance + 75.0 * turn) / (75.0 + impedance * turn)


OPEN, SHORT = 1e15, 1e-12  # Ω


def test_open_and_short_remove_a_series_and_a_shunt_part() -> None:
    found = without_fixture(spectrum(seen(DEVICE)), opened=spectrum(seen(OPEN)), short=spectrum(seen(SHORT)))
    np.testing.assert_allclose(found.impedance_ohm, DEVICE, rtol=1e-6)  # round-off of the open's reciprocal


def test_open_short_and_load_remove_any_two_port() -> None:
    measured = [spectrum(seen_through_a_cable(z)) for z in (DEVICE, OPEN, SHORT, 100.0)]
    found = without_fixture(measured[0], opened=measured[1], short=measured[2], load=measured[3], load_ohm=100.0)
    np.testing.assert_allclose(found.impedance_ohm, DEVICE, rtol=1e-6)
    partly = without_fixture(measured[0], opened=measured[1], short=measured[2])
    assert np.abs(partly.impedance_ohm / DEVICE - 1.0).max() > 1e-5  # without the load the line is not removed


def test_what_cannot_be_compensated_is_an_error() -> None:
    measured = spectrum(seen(DEVICE))
    with pytest.raises(pr.ParameterError, match="only together with its open and its short"):
        without_fixture(measured, load=measured)
    with pytest.raises(pr.ParameterError, match="load_ohm = 0 is not valid"):
        without_fixture(measured, load_ohm=0.0)
    with pytest.raises(pr.SpectrumError, match="cannot be compensated"):
        without_fixture(measured, short=measured)
    narrow = pr.Spectrum.from_admittance(FREQUENCY[100:], 1.0 / seen(OPEN)[100:])
    with pytest.raises(pr.SpectrumError, match="measure the fixture over the device's band"):
        without_fixture(measured, opened=narrow)


def test_the_command_fits_the_device_behind_its_fixture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, z in (("device", DEVICE), ("open", OPEN), ("short", SHORT)):
        columns = np.column_stack([FREQUENCY, (values := seen(z)).real, values.imag])
        np.savetxt(tmp_path / f"{name}.csv", columns, delimiter=",", header="frequency_hz,r_ohm,x_ohm", comments="")
    words = ["fit", str(tmp_path / "device.csv"), "--open", str(tmp_path / "open.csv")]
    found = printed([*words, "--short", str(tmp_path / "short.csv"), "--modes", "1"], capsys)
    assert found["leads"] is None
    assert found["arms"][0]["resistance_ohm"] == pytest.approx(RESISTANCE, rel=1e-3)
    assert found["arms"][0]["inductance_h"] == pytest.approx(INDUCTANCE, rel=1e-3)
    assert found["clamped_capacitance_f"] == pytest.approx(CLAMPED, rel=1e-3)


def test_a_cable_before_the_port_has_a_caution_and_is_removed_by_a_port_extension(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frequency = np.linspace(0.5e6, 3e6, 801)
    jw, rng = 2j * np.pi * frequency, np.random.default_rng(0)
    y = 50.0 * (jw * 1e-9 + 1.0 / (27.6 + jw * 220e-6 + 1.0 / (jw * 80e-12)))
    reflected = (1.0 - y) / (1.0 + y) * np.exp(-2.0 * jw * 5e-9)
    reflected += 3e-5 * (rng.standard_normal(801) + 1j * rng.standard_normal(801))
    rows = np.column_stack([frequency, reflected.real, reflected.imag])
    np.savetxt(tmp_path / "cable.s1p", rows, header="Hz S RI R 50", comments="# ")
    found = printed(["fit", str(tmp_path / "cable.s1p")], capsys)
    assert found["clamped_capacitance_f"] == pytest.approx(1.1e-9, rel=5e-3)  # with the cable's 5 ns / 50 Ω
    assert any("--port-extension" in text for text in found["warnings"])
    found = printed(["fit", str(tmp_path / "cable.s1p"), "--port-extension", "5n"], capsys)
    assert found["clamped_capacitance_f"] == pytest.approx(1e-9, rel=5e-4)
    assert found["arms"][0]["inductance_h"] == pytest.approx(220e-6, rel=5e-4)
    assert found["leads"] is None
    with pytest.raises(pr.ParameterError, match="port_extension_s = 1 is not valid: it must be a delay from 0 to"):
        without_fixture(spectrum(DEVICE), port_extension_s=1.0)
