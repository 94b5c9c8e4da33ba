# SPDX-License-Identifier: GPL-3.0-or-later
"""Readers of measured spectra: one module a family of formats, found by what is in the file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pyspice_runner.errors import ParameterError, SpectrumError
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
from pyspice_runner.spectra.readers.reading import STATED
from pyspice_runner.spectra.readers.repair import spectrum_of
from pyspice_runner.spectra.readers.text import clean, load
from pyspice_runner.spectra.spectrum import Spectrum

READERS = (hp4294a, e4990a, mfia, touchstone, bode100, waveforms, nanovna, aim, plain)  # asked in this order
_WITH_TRACES = (hp4294a, e4990a, mfia)


@checked
def read_spectrum(
    path: str | Path,
    *,
    trace: str | None = None,
    columns: Sequence[str] | None = None,
    through: Literal["series", "shunt"] | None = None,
) -> Spectrum:
    """Read a measured spectrum; the format is found by the file's content, not by its name.

    Formats: Keysight E4990A CSV, HP/Agilent 4294A ASCII, Omicron Bode 100 CSV, Digilent WaveForms CSV, NanoVNA CSV, AIM
    CSV, Zurich Instruments MFIA CSV, Touchstone of one or two ports (with the extra ``spectra``), plain CSV whose
    header names quantity and unit in English, German or French, and the two-port that
    ``piezomotor admittance --output`` writes.

    What had to be repaired (order of the frequencies, missing points, the unit, wraps or sign of the phase) is told in
    ``Spectrum.warnings``.

    Args:
        path: the file.
        trace: which of several spectra in the file: ``"memory"`` for an analyser's memory trace, the number of
            a sweep for the MFIA. By default the data trace, or the first sweep.
        columns: names of the columns of a table without a header, or with one that is not known, such as
            ``["frequency_hz", "magnitude_ohm", "phase_deg"]``; ``"-"`` for a column that does not count.
        through: how one device was connected, if a Touchstone file of two ports is of one device: in ``"series"``
            between the ports, or as a ``"shunt"`` from the line to ground. By default that is told from the
            S-parameters, with a warning; a file that fits neither is the two-port of the groups A and B.

    Raises:
        ParameterError: for columns that are not known or make no admittance.
        SpectrumError: for a file that is none of these, with the line and what was expected there.
    """
    if columns is not None:
        headings = plain.stated(columns)
        if trace is not None or through is not None:
            raise ParameterError("columns are those of a plain table. Leave trace and through out.")
        return spectrum_of(plain.read_stated(load(path), columns, headings))
    text = load(path)
    for reader in READERS:
        reading = touchstone.read(text, trace, through) if reader is touchstone else reader.read(text, trace)
        if reading is None:
            continue
        if through is not None and reader is not touchstone:
            raise SpectrumError(
                f"{text.name} ({reading.format}) is no Touchstone file of two ports; leave through out."
            )
        if trace is not None and reader not in _WITH_TRACES:
            raise SpectrumError(f"{text.name} ({reading.format}) has no trace {clean(trace, 20)!r}; leave trace out.")
        return spectrum_of(reading)
    raise SpectrumError(
        f"{text.name}, line 1: none of the formats that are known; expected an export of E4990A, 4294A, Bode 100, "
        "WaveForms, NanoVNA, AIM or MFIA, Touchstone, or a CSV with a header like "
        f"“frequency_hz,conductance_s,susceptance_s”, or {STATED}."
    )
