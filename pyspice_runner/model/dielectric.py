# SPDX-License-Identifier: GPL-3.0-or-later
r"""A dielectric with a loss tangent that is constant over frequency, as a ladder of series R–C branches.

A branch adds the admittance :math:`sC_k/(1 + s\tau_k)`, :math:`\tau_k = R_k C_k`, and its loss has the peak
:math:`\frac{1}{2} C_k` at :math:`\omega = 1/\tau_k`. Equal capacitances at time constants spaced by the factor
:math:`e^h` add up to the constant loss

.. math::
    \sum_k \tfrac{1}{2} C_k \operatorname{sech}(\ln\omega\tau_k) \approx \frac{\pi}{2h} C_k = C \tan\delta,

with a relative ripple of :math:`4 e^{-\pi^2/h}` (Poisson's sum): 5 % with one branch for each decade, 0.08 % with two. By
the relation of Kramers and Kronig the capacitance falls by :math:`\frac{2}{\pi} \tan\delta` for each factor e in
frequency, as that of a real ceramic does.
"""

from __future__ import annotations

from math import log, pi


def loss_ladder(
    capacitance_f: float, loss_tangent: float, low_hz: float, high_hz: float, branches: int
) -> list[tuple[float, float]]:
    """Return the branches as pairs of R in Ω and C in F, to be connected in parallel to the capacitance.

    The loss tangent holds between the frequencies: it is 1 to 4 % low a decade from them, a third low at them.

    Args:
        capacitance_f: the capacitance whose loss tangent this is, F.
        loss_tangent: the loss tangent.
        low_hz: corner frequency of the slowest branch, Hz.
        high_hz: corner frequency of the fastest branch, Hz.
        branches: number of branches, 2 or more.
    """
    spacing = log(high_hz / low_hz) / (branches - 1)
    share = 2.0 * spacing / pi * loss_tangent * capacitance_f
    corners = (low_hz * (high_hz / low_hz) ** (k / (branches - 1)) for k in range(branches))
    return [(1.0 / (2.0 * pi * corner * share), share) for corner in corners]
