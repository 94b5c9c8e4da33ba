# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a network as they can be bought or wound: values of the E series, and what such parts bear."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from math import floor, log10, pi

from pyspice_runner.units import engineering

# IEC 60063: preferred values of a decade
E12 = (1.0, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 3.9, 4.7, 5.6, 6.8, 8.2)
E24 = (
    1.0, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8, 2.0, 2.2, 2.4, 2.7, 3.0,
    3.3, 3.6, 3.9, 4.3, 4.7, 5.1, 5.6, 6.2, 6.8, 7.5, 8.2, 9.1,
)  # fmt: skip

WINDING_QUALITY = 100.0  # of an inductor: assumed, that of a gapped ferrite core at some ten kHz
SMALLEST_INDUCTANCE, LARGEST_INDUCTANCE = 1e-6, 0.1  # H; catalogues of wound ferrite inductors end near 100 mH
WINDING_CAPACITANCE = 20e-12  # F: assumed, of a coil of several layers in a bobbin of two chambers
FEWEST_TIMES = 3.0  # self-resonance of a coil over the frequency; below, its inductance is more than an eighth too high
# V·s, the flux linkage at which the largest core saturates: 0.3 T (ferrite N87 at 100 °C, TDK data sheet: 0.39 T) in
# the 198 mm² of an RM 14 core (IEC 62317-4), times 1000 turns, about what its bobbin takes of wire of 0.2 mm
LARGEST_FLUX = 0.3 * 198e-6 * 1000.0
HIGHEST_COIL_VOLTAGE = 1000.0  # V, amplitude: assumed, two chambers of enamelled wire
HIGHEST_CAPACITOR_VOLTAGE = 1000.0  # V, amplitude: film and C0G capacitors of a nominal 1.6 kV or 2 kV
SMALLEST_CAPACITANCE, LARGEST_CAPACITANCE = 47e-12, 1e-6  # F; below, the wiring counts


def nearest(value: float, series: Sequence[float]) -> float:
    """Return the value of a series that is nearest to a positive one, by ratio."""
    decade = 10.0 ** floor(log10(value))
    steps = [*series, 10.0]
    above = min(bisect(steps, value / decade), len(steps) - 1)
    below, over = steps[above - 1], steps[above]
    chosen = below if (value / decade) ** 2 < below * over else over
    return float(f"{chosen * decade:.6g}")


def largest_inductance(frequency_hz: float, winding_f: float = WINDING_CAPACITANCE) -> float:
    """Return the largest inductance in H of a coil whose self-resonance is high enough above a frequency.

    ``winding_f`` is the capacitance of its winding.
    """
    return min(LARGEST_INDUCTANCE, 1.0 / ((2.0 * pi * FEWEST_TIMES * frequency_hz) ** 2 * winding_f))


def beyond(
    name: str,
    value: float,
    unit: str,
    volts: float,
    amperes: float,
    frequency_hz: float,
    winding_f: float = WINDING_CAPACITANCE,
) -> tuple[str, ...]:
    """Return one sentence for each limit that a coil (unit H) or capacitor (unit F) exceeds.

    Args:
        name: of the part, for the sentences.
        value: inductance or capacitance.
        unit: ``"H"`` or ``"F"``.
        volts: greatest voltage across it, V.
        amperes: greatest current through it, A.
        frequency_hz: frequency of the drive, Hz.
        winding_f: capacitance of the winding of a coil, F.
    """
    found: list[tuple[str, float, float, str]] = []
    if unit == "H":
        found.append(("inductance", value, largest_inductance(frequency_hz, winding_f), "H"))
        found.append(("flux linkage", value * amperes, LARGEST_FLUX, "V·s"))
        found.append(("voltage", volts, HIGHEST_COIL_VOLTAGE, "V"))
    else:
        found.append(("capacitance", value, LARGEST_CAPACITANCE, "F"))
        found.append(("voltage", volts, HIGHEST_CAPACITOR_VOLTAGE, "V"))
    told = [
        f"The {name} has a {what} of {engineering(much, of)}; the limit is {engineering(most, of)}."
        for what, much, most, of in found
        if much > most * (1.0 + 1e-9)
    ]
    if unit == "F" and value < SMALLEST_CAPACITANCE:
        least = engineering(SMALLEST_CAPACITANCE, "F")
        told.append(f"The {name} has a capacitance of {engineering(value, 'F')}; the least is {least}.")
    if unit == "H" and value < SMALLEST_INDUCTANCE:
        told.append(f"The {name} has an inductance of {engineering(value, 'H')}; the least is 1 µH.")
    return tuple(told)
