# SPDX-License-Identifier: GPL-3.0-or-later
"""Match of a load to a source resistance: an element in series on the side of the source, one across the load."""

from __future__ import annotations

from math import pi, sqrt

from pyspice_runner.errors import ParameterError, require


def match_to_source(load_ohm: complex, source_ohm: float, frequency_hz: float) -> dict[str, float]:
    """Return the lossless elements that transform an impedance to a resistance, both in Ω, at a frequency in Hz.

    They are a coil in series, ``series_inductance`` in H, and across the load ``parallel_capacitance`` in F or
    ``parallel_inductance`` in H. With the load G + jB they have a susceptance b in total, and the impedance
    G/(G² + b²) − jb/(G² + b²): its real part is R for b = √(G/R − G²), and the coil cancels −jbR/G.

    Raises:
        ParameterError: for a source resistance that is not positive or above that of the load in its parallel form.
    """
    require(load_ohm.real > 0.0, "load_ohm", load_ohm, "of a positive resistance", unit="Ω")
    load, omega = 1.0 / load_ohm, 2.0 * pi * frequency_hz
    if not 0.0 < load.real * source_ohm <= 1.0:
        raise ParameterError(
            f"source_ohm = {source_ohm:g} Ω is not valid for a load of {1.0 / load.real:.4g} Ω in parallel with a "
            "reactance: it must be > 0 and at most that resistance. Take another one, or a transformer."
        )
    total = sqrt(load.real / source_ohm - load.real**2)
    across = (total - load.imag) / omega
    parallel = {"parallel_capacitance": across} if across > 0.0 else {"parallel_inductance": -1.0 / (omega**2 * across)}
    return {"series_inductance": total * source_ohm / load.real / omega, **parallel}
