# SPDX-License-Identifier: GPL-3.0-or-later
"""Readers of measured spectra. The format is found by the content of the file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pyspice_runner.errors import ParameterError, SpectrumError
from pyspice_runner.impedance.readers import hp4294a, plain, tabular, touchstone
from pyspice_runner.impedance.readers.reading import STATED, spectrum_of
from pyspice_runner.impedance.readers.text import clean, load
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.motor.refusal import checked

# tried in this order: the function that returns a reading, or None for a file in another format, and its options
FORMATS = (
    (hp4294a.read, ("trace",)),
    (tabular.read_e4990a, ("trace",)),
    (tabular.read_mfia, ("trace",)),
    (touchstone.read, ("through",)),
    (tabular.read, ()),
    (tabular.read_aim, ()),
    (plain.read, ()),
)


@checked
def read_spectrum(
    path: str | Path,
    *,
    trace: str | None = None,
    columns: Sequence[str] | None = None,
    through: Literal["series", "shunt"] | None = None,
) -> Spectrum:
    """Read a measured spectrum. The format is found by the content of the file, not by its name.

    Formats: Keysight E4990A CSV, HP/Agilent 4294A ASCII, Omicron Bode 100 CSV, Digilent WaveForms CSV, NanoVNA CSV, AIM
    CSV, Zurich Instruments MFIA CSV, Touchstone of one or two ports, plain CSV whose header names quantity and unit in
    English, the two-port CSV of ``piezomotor admittance``; a table also as the first sheet of an .xlsx file (openpyxl).

    ``Spectrum.cautions`` lists all repairs: order, missing points, mean of sweeps, wraps or sign of the phase.

    Args:
        path: the file.
        trace: one of several spectra in the file: ``"memory"`` for the memory trace of an analyser, the number of a
            sweep for the MFIA. Default: the data trace, or the first sweep.
        columns: names of the columns of a table whose header is missing or unknown, such as
            ``["frequency_hz", "magnitude_ohm", "phase_deg"]``; ``"-"`` for a column to ignore.
        through: connection of a single device in a two-port Touchstone file: in ``"series"`` between the ports, or as
            a ``"shunt"`` from the line to ground. By default the S-parameters decide, with a caution; a file that fits
            neither is the two-port of the groups A and B.

    Raises:
        ParameterError: for unknown columns, or columns that make no admittance.
        SpectrumError: for a file in no known format, with the line and what was expected there.
    """
    if columns is not None:
        headings = plain.stated(columns)
        if trace is not None or through is not None:
            raise ParameterError("columns are those of a plain table. Leave trace and through out.")
        return spectrum_of(plain.read_stated(load(path), columns, headings))
    text = load(path)
    given = {"trace": trace, "through": through}
    for read, options in FORMATS:
        reading = read(text, **{name: given[name] for name in options})
        if reading is None:
            continue
        if through is not None and "through" not in options:
            raise SpectrumError(
                f"{text.name} ({reading.format}) is no Touchstone file of two ports; leave through out."
            )
        if trace is not None and "trace" not in options:
            raise SpectrumError(f"{text.name} ({reading.format}) has no trace {clean(trace, 20)!r}; leave trace out.")
        return spectrum_of(reading)
    raise SpectrumError(
        f"{text.name}, line 1: none of the formats that are known; expected an export of E4990A, 4294A, Bode 100, "
        "WaveForms, NanoVNA, AIM or MFIA, Touchstone, or a CSV with a header like "
        f"“frequency_hz,conductance_s,susceptance_s”, or {STATED}."
    )
