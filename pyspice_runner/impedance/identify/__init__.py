# SPDX-License-Identifier: GPL-3.0-or-later
r"""The least-squares problem of :func:`~pyspice_runner.impedance.fit.fit_spectrum`.

**Objective** (:mod:`.problem`). The residual is the difference of model and measurement in the quantity with the same
error at all points (:mod:`..noise`): ln Y for an analyser with a relative error, the reflection coefficient for a
network analyser.

**Parameters** (:mod:`.arms`) are the logarithms of C₀ and of the frequency, reactance √(L/C) and quality factor of each
arm, so that every arm is passive; three parts of the loss tangent, R_ℓ and L_ℓ are not negative. With coupled damping
each arm has further parameters b_k: the damping matrix is :math:`D = \operatorname{diag}(\omega_n/Q_n) + BB^T`,
:math:`B_{nk} = \sqrt{\omega_n}\,b_{nk}`, which is positive definite. The clamped capacitance takes part in it.
Levenberg–Marquardt steps (:mod:`.descent`) use the exact Jacobian: with
:math:`v = (j\omega + D + K/j\omega)^{-1}\theta` (by Woodbury's formula) it is :math:`\partial Y = 2 v^T \partial\theta
- v^T (\partial D + \partial K/j\omega) v`. An arm may leave the measured band by a quarter of its span and then stands
for the modes there. With a given number of arms that cannot follow the spectrum to the noise, arms may lie up to a
decade outside the band, and the coupling has its highest rank.

**Start**. The clamped capacitance is fitted alone, then with one arm after the other. A matched filter over frequency
and bandwidth searches the residuals for a missing arm, in the band and beside it; the two most significant are tried.
With the arm, a further one is added in the same way and the least certain one removed, and the better fit is kept. The
coupling starts from the leading eigenvectors of the off-diagonal damping of one linear step.

**Choice** (:mod:`.selection`). Schwarz's criterion, BIC = 2 n ln σ² + p ln 2n, of n independent points and p
parameters, selects the number of arms, the rank of the coupling, the parts of the loss and the leads. Where residuals
are correlated, n is the equivalent number of independent points, and standard errors grow accordingly
(:mod:`.errors`). Descriptions of similar probability add the spread of their values to the errors. Leads are searched
only if the fit with them follows the spectrum to the noise; larger residuals hide leads.

**Long spectra.** For more than ``MOST_SEARCHED`` points, the search takes those of :func:`.problem.thinning`; a last
descent takes all points.
"""
