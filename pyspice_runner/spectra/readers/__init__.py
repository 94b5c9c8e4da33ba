# SPDX-License-Identifier: GPL-3.0-or-later
"""Readers of measured spectra: one module a family of formats, found by what is in the file."""

from __future__ import annotations

from pathlib import Path

from pyspice_runner.errors import SpectrumError
from pyspice_runner.model.refusal import checked
from pyspice_runner.spectra.readers import (
    aim,
    bode100,
    e4990a,
    hp4294a,
    mfia,
    nanovna,
    plain,
    touchstone,
    waveforms,
)
from pyspice_runner.spectra.readers.repair import spectrum_of
from pyspice_runner.spectra.readers.text import clean, load
from pyspice_runner.spectra.spectrum import Spectrum

READERS = (hp4294a, e4990a, mfia, touchstone, bode100, waveforms, nanovna, aim, plain)  # asked in this order
_WITH_TRACES = (hp4294a, e4990a, mfia)


@checked
def read_spectrum(path: str | Path, *, trace: str | None = None) -> Spectrum:
    """Read a measured spectrum; the format is found by the file's content, not by its name.

    Formats: Keysight E4990A CSV, HP/Agilent 4294A ASCII, Omicron Bode 100 CSV, Digilent WaveForms CSV, NanoVNA CSV, AIM
    CSV, Zurich Instruments MFIA CSV, Touchstone of one or two ports (with the extra ``spectra``), plain CSV whose
    header names quantity and unit, and the two-port that ``piezomotor admittance --output`` writes.

    What had to be repaired (order of the frequencies, missing points, the unit, wraps or sign of the phase) is told in
    ``Spectrum.warnings``.

    Args:
        path: the file.
        trace: which of several spectra in the file: ``"memory"`` for an analyser's memory trace, the number of
            a sweep for the MFIA. By default the data trace, or the first sweep.

    Raises:
        SpectrumError: for a file that is none of these, with the line and what was expected there.
    """
    text = load(path)
    for reader in READERS:
        reading = reader.read(text, trace)
        if reading is None:
            continue
        if trace is not None and reader not in _WITH_TRACES:
            raise SpectrumError(f"{text.name} ({reading.format}) has no trace {clean(trace, 20)!r}; leave trace out.")
        return spectrum_of(reading)
    raise SpectrumError(
        f"{text.name}, line 1: none of the formats that are known; expected an export of E4990A, 4294A, Bode 100, "
        "WaveForms, NanoVNA, AIM or MFIA, Touchstone, or a CSV with a header like "
        "“frequency_hz,conductance_s,susceptance_s”."
    )
