# SPDX-License-Identifier: GPL-3.0-or-later
"""Real exports of real instruments, which are not part of this project: skipped where their folder is not there."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.fixture import without_fixture

MEASURED = next(
    (above / "shared" / "measured" for above in Path(__file__).parents if (above / "shared" / "measured").is_dir()),
    Path("measured"),
)

pytestmark = pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured spectra are not here")


def test_keysight_e4990a() -> None:
    spectrum = pr.read_spectrum(MEASURED / "e4990a_thickness_mode" / "MODULOFASEMODOTHICKNES.CSV")
    assert (spectrum.format, len(spectrum), spectrum.cautions) == ("Keysight E4990A CSV", 1601, ())
    assert spectrum.frequency_hz[[0, -1]].tolist() == [950e3, 1130e3]
    assert np.abs(spectrum.impedance_ohm[0]) == pytest.approx(60.8781245395, rel=1e-11)
    assert np.angle(spectrum.impedance_ohm[-1], deg=True) == pytest.approx(-80.5241136707, rel=1e-11)
    # the instrument's own circuit resonates at 1/(2π √(151.992 µH · 168.607 pF))
    assert spectrum.frequency_hz[np.argmax(spectrum.admittance_s.real)] == pytest.approx(994.2e3, rel=0.01)


def test_the_phase_trap_of_the_hp_4294a_is_found_with_a_caution() -> None:
    spectrum = pr.read_spectrum(MEASURED / "hp4294a_admittance" / "sampleadmittance.txt")
    assert (spectrum.format, len(spectrum)) == ("4294A ASCII", 801)
    assert [text for text in ("wraps by 360°", "off by 180°") if any(text in told for told in spectrum.cautions)] == [
        "wraps by 360°",
        "off by 180°",
    ]
    y = spectrum.admittance_s
    assert (y.real > 0.0).all()
    assert np.abs(y[0]) == pytest.approx(1.103217e-03, rel=1e-12)
    assert np.angle(y[0], deg=True) == pytest.approx(180.0 - 90.68633, abs=1e-5)
    assert spectrum.frequency_hz[np.argmax(np.abs(y))] == pytest.approx(112_679, rel=5e-4)
    assert spectrum.frequency_hz[np.argmin(np.abs(y))] == pytest.approx(114_242, rel=5e-4)


def test_the_inductor_of_the_agilent_4294a() -> None:
    spectrum = pr.read_spectrum(MEASURED / "hp4294a_inductor" / "impedance.txt")
    assert (spectrum.format, len(spectrum), spectrum.cautions) == ("4294A ASCII", 534, ())
    inductance = spectrum.impedance_ohm.imag / (2.0 * np.pi * spectrum.frequency_hz)
    assert inductance == pytest.approx(204e-6, rel=0.01)


def test_nanovna() -> None:
    spectrum = pr.read_spectrum(MEASURED / "nanovna_polymer" / "T61.csv")
    assert (spectrum.format, len(spectrum), spectrum.cautions) == ("NanoVNA CSV", 1016, ())
    assert spectrum.impedance_ohm[[0, -1]] == pytest.approx([5.7 - 36.8j, 5.5 - 65.5j])


def test_what_is_no_spectrum_is_refused() -> None:
    for path in (MEASURED / "README.md", MEASURED / "e4990a_thickness_mode" / "circuitoParametriConcentrati.txt"):
        with pytest.raises(pr.SpectrumError, match="none of the formats that are known"):
            pr.read_spectrum(path)


CASES = MEASURED.parent / "cases" / "impedance"
ARM = {"clamped_capacitance_f": 2.2e-9, "capacitance_f": 250e-12, "inductance_h": 41.02e-3, "resistance_ohm": 256.2}
CABLE = {"clamped_capacitance_f": 1e-9, "capacitance_f": 80e-12, "inductance_h": 219.9e-6}


@pytest.mark.parametrize(
    ("file", "told", "known"),
    [
        ("c11.s1p", "", CABLE),
        ("c19.csv", "the peak is clipped", {}),
        ("c31.csv", "Points left out", ARM),
        ("flat_loss_default_rng7_draw4.csv", "", ARM),
        ("nanovna_series_through.s2p", "in series between them", ARM),
        ("case129.txt", "leads at their limits", {"quality_factor": 291.0, "resistance_ohm": 62.5}),
    ],
)
def test_an_input_that_failed_has_its_right_values(file: str, told: str, known: dict[str, float]) -> None:
    names = ["frequency_hz", "magnitude_ohm", "phase_deg", "-", "-", "-", "-"] if file.endswith(".txt") else None
    spectrum = pr.read_spectrum(CASES / file, columns=names)
    fit = pr.fit_spectrum(without_fixture(spectrum, port_extension_s=5e-9) if file == "c11.s1p" else spectrum)
    assert told in " ".join(fit.cautions)
    assert (len(fit.arms) == 1) == (names is None)
    main = fit.circuit.definitions()[fit.arms.index(fit.main_arm)]["one arm"]  # three bandwidths wide
    found = main if names else asdict(fit.circuit) | asdict(fit.circuit.arms[0])
    assert {name: found[name] for name in known} == pytest.approx(known, rel=5e-3 if names else 2e-3)


def test_a_two_port_that_failed_has_the_couplings_of_its_motor() -> None:
    first, second = pr.fit_spectrum(pr.read_spectrum(CASES / "clean2p.csv")).modes
    assert [first.quality_factor, second.quality_factor] == pytest.approx([400.0, 400.0], rel=1e-3)
    assert first.coupling_a_n_per_v_kg05 == pytest.approx(1.537, rel=1e-3)
