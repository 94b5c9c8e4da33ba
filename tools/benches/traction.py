# SPDX-License-Identifier: GPL-3.0-or-later
r"""Closed forms of pressure, traction in stick and slip, and surface displacements in the contact.

Two elastic bodies touch in a circle of radius a under Hertz's pressure and are then dragged along x (Cattaneo,
Mindlin). A ring slips, c ≤ r ≤ a; inside it the surfaces stick together:

.. math::
    p = p_0\sqrt{1 - r^2/a^2}, \quad F_N = \tfrac23 \pi a^2 p_0, \quad
    q = \mu p_0\sqrt{1 - r^2/a^2} - \mu\tfrac ca\,p_0\sqrt{1 - r^2/c^2}, \quad
    F_T = \mu F_N\left(1 - \frac{c^3}{a^3}\right)

The second term of q is there for r ≤ c only. A load √(1 − r²/a²) on the circle displaces a half-space by an integral
over the lines through the point, each with the load along its chord. With Θ = arcsin min(1, a/r),

.. math::
    I_0 = \int_{-\Theta}^{\Theta} (a^2 - r^2\sin^2\theta)\,d\theta, \qquad
    I_2 = \int_{-\Theta}^{\Theta} (a^2 - r^2\sin^2\theta)\cos 2\theta\,d\theta

and α the direction of the point, the displacements per load are, inside and outside of the circle alike,

.. math::
    u_z = \frac{I_0}{2aE^*}, \qquad
    u_x = \frac{(2-\nu)\,I_0 + \nu\cos 2\alpha\,I_2}{8Ga}, \qquad
    u_y = \frac{\nu\sin 2\alpha\,I_2}{8Ga}.

Sources: Andersen, Helbo and Blanke (2002), eqs. (5)–(12), corrected as ``docs/physics.md`` shows; K. L. Johnson,
*Contact Mechanics*, Cambridge 1985, §3.6, §3.7 and §7.2; R. D. Mindlin, H. Deresiewicz, J. Appl. Mech. 20 (1953) 327.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cbrt, isfinite, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.errors import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HertzPatch:
    """The contact circle of two elastic bodies under a normal and a tangential force.

    Attributes:
        force_n: normal force F_N.
        friction: coefficient of friction μ.
        effective_modulus_pa: modulus E*.
        effective_radius_m: relative radius R*.

    Raises:
        ParameterError: for a value that is not above zero.
    """

    force_n: float
    friction: float
    effective_modulus_pa: float
    effective_radius_m: float

    def __post_init__(self) -> None:
        for name in ("force_n", "friction", "effective_modulus_pa", "effective_radius_m"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ParameterError(f"HertzPatch: {name} = {value:g} is not valid: it must be a number > 0.")

    @property
    def radius_m(self) -> float:
        """Radius a of the circle, a³ = 3 F_N R*/(4 E*)."""
        return cbrt(0.75 * self.force_n * self.effective_radius_m / self.effective_modulus_pa)

    @property
    def penetration_m(self) -> float:
        """Penetration δ = a²/R*."""
        return self.radius_m**2 / self.effective_radius_m

    @property
    def peak_pressure_pa(self) -> float:
        """Greatest pressure p₀ = 3 F_N/(2π a²), in the middle."""
        return 1.5 * self.force_n / (pi * self.radius_m**2)

    def pressure(self, r: ArrayLike) -> Array:
        """Return the pressure p (Pa) at distances r (m) from the middle (paper eqs. 5, 6)."""
        return self.peak_pressure_pa * _half_ellipse(r, self.radius_m)

    def stick_radius(self, tangential_force_n: float) -> float:
        """Return the radius c (m) of the circle that sticks, c = a ∛(1 − F_T/(μ F_N)) (paper eq. 12, corrected).

        Raises:
            ParameterError: for a force above μ F_N, the largest friction force.
        """
        share = abs(tangential_force_n) / (self.friction * self.force_n)
        if not share <= 1.0:
            raise ParameterError(
                f"tangential_force_n = {tangential_force_n:g} N is not valid; friction carries at most "
                f"{self.friction * self.force_n:g} N."
            )
        return self.radius_m * cbrt(1.0 - share)

    def traction(self, r: ArrayLike, tangential_force_n: float) -> Array:
        """Return the traction q (Pa), in the force's direction, at distances r (m) (paper eq. 8, corrected)."""
        stick = self.stick_radius(tangential_force_n)
        cancelled = stick / self.radius_m * _half_ellipse(r, stick) if stick > 0.0 else 0.0
        whole = _half_ellipse(r, self.radius_m) - cancelled
        return np.asarray(np.sign(tangential_force_n) * self.friction * self.peak_pressure_pa * whole)

    def normal_displacement(self, r: ArrayLike) -> Array:
        """Return the total displacement of both surfaces (m) at distances r (m), inside and outside."""
        first, _ = _chords(np.asarray(r, dtype=float), self.radius_m)
        return self.peak_pressure_pa / (2.0 * self.radius_m * self.effective_modulus_pa) * first

    def tangential_displacement(
        self, x: ArrayLike, y: ArrayLike, tangential_force_n: float, *, youngs_modulus_pa: float, poisson: float
    ) -> tuple[Array, Array]:
        """Return the displacement (u_x, u_y) (m) of one body's surface (paper eqs. 7 and 10, corrected).

        Args:
            x: along the force, m.
            y: across it, m.
            tangential_force_n: force that drags the body along x.
            youngs_modulus_pa: of the body.
            poisson: of the body.
        """
        stick = self.stick_radius(tangential_force_n)
        shear = youngs_modulus_pa / (2.0 * (1.0 + poisson))
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        along, across = _cerruti(x, y, self.radius_m, shear, poisson)
        if stick > 0.0:
            inner_along, inner_across = _cerruti(x, y, stick, shear, poisson)
            along = along - stick / self.radius_m * inner_along
            across = across - stick / self.radius_m * inner_across
        load = np.sign(tangential_force_n) * self.friction * self.peak_pressure_pa
        return load * along, load * across


def virgin_force(amplitude: ArrayLike) -> Array:
    """Return F_T/(μ F_N) of a contact in first loading to u/u_lim, 1 − (1 − u/u_lim)^(3/2)."""
    return np.asarray(1.0 - np.maximum(1.0 - np.asarray(amplitude, dtype=float), 0.0) ** 1.5)


def microslip_loss(amplitude: ArrayLike) -> Array:
    r"""Return the energy lost per cycle at a constant normal force, in units of μ F_N u_lim.

    Mindlin and Deresiewicz's loop, with s = F_T/(μ F_N) at the amplitude:

    .. math::
        \tfrac{24}5\left\{1 - (1-s)^{5/3} - \tfrac56\,s\left[1 + (1-s)^{2/3}\right]\right\}

    and beyond the limit of stick 4 (amplitude − 1) more.

    Args:
        amplitude: of the displacement, in units of u_lim.
    """
    reach: Array = np.abs(np.asarray(amplitude, dtype=float))
    stick = np.sqrt(np.maximum(1.0 - reach, 0.0))  # c/a = (1 − s)^(1/3)
    share = 1.0 - stick**3
    loop = 4.8 * (1.0 - stick**5 - share * (1.0 + stick**2) / 1.2)
    return np.asarray(loop + 4.0 * np.maximum(reach - 1.0, 0.0))


def _half_ellipse(r: ArrayLike, radius: float) -> Array:
    return np.asarray(np.sqrt(np.maximum(1.0 - (np.asarray(r, dtype=float) / radius) ** 2, 0.0)))


def _chords(r: Array, radius: float) -> tuple[Array, Array]:
    """Return I₀ and I₂ of the module's header."""
    angle = np.arcsin(np.minimum(1.0, radius / np.maximum(np.abs(r), radius)))
    double = np.sin(2.0 * angle)
    first = 2.0 * radius**2 * angle - r**2 * (angle - 0.5 * double)
    second = radius**2 * double - 0.5 * r**2 * (double - angle - 0.25 * np.sin(4.0 * angle))
    return np.asarray(first), np.asarray(second)


def _cerruti(x: Array, y: Array, radius: float, shear: float, poisson: float) -> tuple[Array, Array]:
    """Return (u_x, u_y) under the traction √(1 − r²/radius²) along x."""
    r = np.hypot(x, y)
    first, second = _chords(r, radius)
    direction = np.arctan2(y, x)
    scale = 1.0 / (8.0 * shear * radius)
    along = scale * ((2.0 - poisson) * first + poisson * np.cos(2.0 * direction) * second)
    return np.asarray(along), np.asarray(scale * poisson * np.sin(2.0 * direction) * second)
