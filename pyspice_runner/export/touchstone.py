# SPDX-License-Identifier: GPL-3.0-or-later
"""Touchstone 1.1 of an admittance, ``.s1p`` or ``.s2p``: S = (1 + Z₀Y)⁻¹ (1 − Z₀Y) at Z₀ = 50 Ω."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.export.symbols import ascii_line

REFERENCE_OHM = 50.0


def touchstone(frequency_hz: NDArray[np.float64], matrix_s: NDArray[np.complex128], *, title: str = "") -> str:
    """Return an admittance in S, shape (points, ports, ports), as the text of a Touchstone file, to sixteen digits."""
    ports = matrix_s.shape[-1]
    one = np.eye(ports)
    normalised = REFERENCE_OHM * matrix_s
    scattering = np.linalg.solve(one + normalised, one - normalised)
    # a two-port's columns are S11 S21 S12 S22, by the standard
    cells = scattering.transpose(0, 2, 1).reshape(len(frequency_hz), -1)
    lines = [
        f"! {ascii_line(title) or 'piezoelectric resonator'}",
        f'! USE: import skrf; y = skrf.Network("THIS.s{ports}p").y, or `piezomotor fit THIS.s{ports}p`',
        f"# Hz S RI R {REFERENCE_OHM:g}",
    ]
    for frequency, row in zip(frequency_hz.tolist(), cells, strict=True):
        lines.append(" ".join([repr(frequency), *(f"{part:.16e}" for cell in row for part in (cell.real, cell.imag))]))
    return "\n".join(lines) + "\n"
