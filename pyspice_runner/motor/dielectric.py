# SPDX-License-Identifier: GPL-3.0-or-later
r"""A dielectric with a loss tangent that is constant over frequency, as a ladder of series R–C branches.

A branch adds the admittance :math:`sC_k/(1 + s\tau_k)`, :math:`\tau_k = R_k C_k`, and its loss has the peak
:math:`\frac{1}{2} C_k` at :math:`\omega = 1/\tau_k`. Time constants spaced by the factor :math:`e^h` add up to a
constant loss with a relative ripple of :math:`4 e^{-\pi^2/h}` (Poisson's sum): 5 % with one branch for each decade,
0.08 % with two. By the relation of Kramers and Kronig the capacitance falls by about
:math:`\frac{2}{\pi} \tan\delta` for each factor e in frequency, as that of a real ceramic does.

The ladder stands for a constant-phase element
(Cole and Cole, J. Chem. Phys. 9, 341, 1941): :math:`C(\omega) = C\,(\omega/\omega_0)^{-m}`, :math:`m = 2\delta/\pi`.
An infinite ladder with the time constants :math:`\tau_k = r^k/\omega_0` and the capacitances :math:`C_k = c\,r^{mk}`
has this phase, apart from the ripple; its sum over k, taken as an integral, gives
:math:`c = (2/\pi)\,C \sin\delta \ln r`. In the band, the branches that are faster act as a capacitance with a
resistance, those that are slower as a resistance with a capacitance. One branch for each of these two tails has the
same first two terms of the series in :math:`\omega`; they are geometric series. All elements are positive, so that the
ladder is passive at all frequencies.
"""

from __future__ import annotations

from math import atan, ceil, exp, expm1, log, pi, sin, sqrt
from typing import NamedTuple

LOW_HZ, HIGH_HZ = 1e3, 1e7  # band of a motor: from the frequency of an LCR meter to the edges of a switching driver
LARGEST_LOSS_TANGENT = 0.5
# The loss tangent is within 5 % if the ladder extends beyond the band by this factor, with at most this ratio between
# two time constants. A test shows it for bands of one to six decades and loss tangents up to 0.5.
MARGIN, _WIDEST_RATIO = 2.5, 9.2


class Branch(NamedTuple):
    """A resistance in series with a capacitance."""

    resistance_ohm: float
    capacitance_f: float


def lossy_capacitance(
    capacitance_f: float,
    loss_tangent: float,
    *,
    low_hz: float = LOW_HZ,
    high_hz: float = HIGH_HZ,
    branches: int | None = None,
) -> tuple[Branch, ...]:
    """Return the branches, in parallel, of a capacitance with a constant loss tangent; the fastest first.

    The capacitance in F is that at the centre of the band, the geometric mean of its ends. A loss tangent of 0 gives
    one branch without resistance. ``branches``, at least 2, are by default the fewest that keep the loss tangent within
    5 % over the band: 6 for 1 kHz to 10 MHz.
    """
    if loss_tangent == 0.0:
        return (Branch(0.0, capacitance_f),)
    span = log(MARGIN**2 * high_hz / low_hz)
    count = branches or max(2, 1 + ceil(span / log(_WIDEST_RATIO)))
    angle = atan(loss_tangent)
    ratio = span / (count - 1)  # ln r
    growth = 2.0 * angle / pi * ratio  # m ln r
    centre = 0.5 / (pi * sqrt(low_hz * high_hz))  # tau at the centre of the band
    scale = 2.0 / pi * capacitance_f * sin(angle) * ratio
    times = [centre * exp(ratio * (number - 0.5 * (count - 1))) for number in range(count)]
    capacitances = [scale * exp(growth * (number - 0.5 * (count - 1))) for number in range(count)]
    # the faster branches: sum of C, and of C tau; the slower ones: sum of C / tau, and of C / tau^2
    times[0] *= expm1(-growth) / expm1(-growth - ratio)
    capacitances[0] /= -expm1(-growth)
    conductance = -capacitances[-1] / times[-1] / expm1(growth - ratio)
    times[-1] *= expm1(growth - 2.0 * ratio) / expm1(growth - ratio)
    capacitances[-1] = conductance * times[-1]
    return tuple(Branch(time / capacitance, capacitance) for time, capacitance in zip(times, capacitances, strict=True))
