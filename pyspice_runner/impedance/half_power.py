# SPDX-License-Identifier: GPL-3.0-or-later
"""Maximum conductance and half-power width of a resonance from the measured points, without a circuit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_REACH = 2.0  # bandwidths on each side in which the points are searched
_ROUND = 0.15  # of the width on each side of the peak: there it is a parabola to 1 %
_FEWEST = 5  # points within the half-power width, below which they do not show the peak


@dataclass(frozen=True)
class HalfPower:
    """A peak of the measured conductance, behind the leads of the fit.

    Keysight E4990A Help, ``CALC:EPAR:S4?``: R1 = 1/G_max, Q = fs/(f₂ − f₁) of the frequencies with half of G_max. The
    conductance of the dielectric and of neighbours is in these values.
    """

    resonance_hz: float  # fs, by the parabola through the highest points
    resistance_ohm: float  # 1/G_max
    width_hz: float  # f₂ − f₁, by straight lines between the points
    quality_factor: float  # fs/(f₂ − f₁)


def half_power(
    frequency_hz: NDArray[np.float64], device_s: NDArray[np.complex128], resonance_hz: float, quality_factor: float
) -> HalfPower | None:
    """Return the peak of the conductance about a resonance; ``None`` if the points do not show it.

    ``device_s`` is the measured admittance in S without leads, over rising frequencies. Resonance and quality factor
    set the range that is searched.
    """
    reach = _REACH * resonance_hz / quality_factor
    near = np.flatnonzero(np.abs(frequency_hz - resonance_hz) < reach)
    if len(near) < _FEWEST:
        return None
    conductance = device_s.real
    top = int(near[np.argmax(conductance[near])])
    half = conductance < 0.5 * conductance[top]
    below, above = np.flatnonzero(half[:top]), half[top:]
    if not below.size or not above.any():
        return None
    low, high = int(below[-1]), top + int(np.argmax(above))
    if high - low - 1 < _FEWEST:
        return None
    # several points average the noise
    width = frequency_hz[high] - frequency_hz[low]
    about = max(_ROUND * width, float(np.diff(frequency_hz[low:high]).max()))
    inner = np.flatnonzero(np.abs(frequency_hz - frequency_hz[top]) <= about)
    x = (frequency_hz[inner] - frequency_hz[top]) / width
    bend, slope, height = np.polyfit(x, conductance[inner], 2)
    if bend >= 0.0:
        return None
    fs, peak = frequency_hz[top] - 0.5 * slope / bend * width, height - 0.25 * slope**2 / bend

    def crossing(inside: int, outside: int) -> float:
        share = (conductance[inside] - 0.5 * peak) / (conductance[inside] - conductance[outside])
        return float(frequency_hz[inside] + share * (frequency_hz[outside] - frequency_hz[inside]))

    span = crossing(high - 1, high) - crossing(low + 1, low)
    if not (peak > 0.0 and span > 0.0):
        return None
    return HalfPower(float(fs), float(1.0 / peak), span, float(fs / span))
