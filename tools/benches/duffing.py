# SPDX-License-Identifier: GPL-3.0-or-later
r"""Duffing's oscillator in closed form: the resonance curve of one free mode that softens with amplitude.

With :math:`r = a\cos(\omega t + \varphi)` the fundamental of
:math:`m\ddot r + c(1+\kappa r^2)\dot r + kr(1-\gamma r^2)` balances a force of amplitude F if

.. math::
    a^2\left[\left(k(1-\tfrac34\gamma a^2) - m\omega^2\right)^2 + \omega^2c^2(1+\tfrac14\kappa a^2)^2\right] = F^2 .

This is a cubic in a². Where it has three positive roots, the middle one is unstable, and the amplitude depends on the
history; at the folds, two of them meet, and the motion jumps (Nayfeh, Mook, *Nonlinear Oscillations*, 1979, section
4.1).
The harmonics that it leaves out are of the order of :math:`\gamma a^2/32`.
"""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor.parameters import Mode

_BISECTIONS = 50


def amplitudes(mode: Mode, force_n: float, frequency_hz: float) -> NDArray[np.float64]:
    """Return the amplitudes in m at a frequency, the smallest first: one, or three of which the middle is unstable."""
    omega = 2.0 * pi * frequency_hz
    detuned = mode.stiffness_n_per_m - mode.mass_kg * omega**2
    softer = -0.75 * mode.stiffness_n_per_m * mode.softening_per_m2
    damping = omega * mode.damping_n_s_per_m
    growing = 0.25 * damping * mode.damping_growth_per_m2
    scale = force_n / damping  # of the amplitude, so that the roots are of order one
    cubic = [
        (softer**2 + growing**2) * scale**6,
        2.0 * (detuned * softer + damping * growing) * scale**4,
        (detuned**2 + damping**2) * scale**2,
        -(force_n**2),
    ]
    roots = np.roots(cubic)
    real = roots[(np.abs(roots.imag) < 1e-7 * np.abs(roots)) & (roots.real > 0.0)].real
    return np.asarray(np.sort(np.sqrt(real)) * scale)


def folds(mode: Mode, force_n: float, low_hz: float, high_hz: float, points: int = 2000) -> tuple[float, float] | None:
    """Return the frequencies in Hz at which the motion jumps down and up, or ``None`` where it does not.

    Args:
        mode: the mode.
        force_n: amplitude of the force on its modal coordinate, N.
        low_hz: lower end of the search.
        high_hz: upper end of the search.
        points: number of frequencies at which branches are counted before the ends are refined.
    """
    grid = np.linspace(low_hz, high_hz, points)
    several = np.array([len(amplitudes(mode, force_n, float(frequency))) > 1 for frequency in grid])
    if not several.any():
        return None

    def edge(outside: float, inside: float) -> float:
        for _ in range(_BISECTIONS):
            middle = 0.5 * (outside + inside)
            if len(amplitudes(mode, force_n, middle)) > 1:
                inside = middle
            else:
                outside = middle
        return inside

    first, last = (int(place) for place in np.flatnonzero(several)[[0, -1]])
    return (
        edge(float(grid[max(first - 1, 0)]), float(grid[first])),
        edge(float(grid[min(last + 1, points - 1)]), float(grid[last])),
    )
