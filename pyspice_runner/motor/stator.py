# SPDX-License-Identifier: GPL-3.0-or-later
r"""The linear stator as matrices: n coordinates, g electrical groups, k contacts.

.. math::
    M\ddot r + B\dot r + K r = \Theta U + P^T F, \qquad Q = C U + \Theta^T r + S^T F, \qquad u = P r + R F + S U

with r the coordinates, U and Q the voltages and charges of the groups, F and u the forces and motions of the contacts.
R and S are of the modes that are left out. A beam, a solid, measured modes or a fitted spectrum end in the modes of a
motor, and :attr:`.Motor.stator` makes these arrays of them.

**Recoil.** The modes shake the carrier that holds their supports; ``docs/physics.md`` derives the terms Γ ṙ ż of it.

**Feedback electrode.** One more group, on a resistance, gives the coordinates the stiffness of its charge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import atan, floor, log10, pi, sqrt
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.motor.contacts import Touching
from pyspice_runner.motor.parameters import Feedback, Mode, Mount, Piezo, ToolLoad

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
CAPACITANCE_AT = 100e3  # Hz, of :attr:`Stator.capacitance`
MAX_TIP_MASS_KG = 1e9  # assumed: if a mode has a larger mass at the tip, the tip is at a node of it
MODE_COLUMNS = (  # of a mode, in the order of :attr:`Stator.mode_rows`
    "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "coupling_a_n_per_v", "coupling_b_n_per_v", "tip_x", "tip_y",
    "recoil_kg", "recoil_x_kg",
)  # fmt: skip
ROUNDING = 1e-12  # of the trace of the flexibility: an element that differs from 0 only by rounding


@dataclass(frozen=True, eq=False)
class Stator:
    """Matrices of a stator with n coordinates, g groups and k contacts.

    ``mass``, ``damping`` and ``stiffness`` have the shape (n,) if they are diagonal, else (n, n). The rows of
    ``contact`` are the tangential and the normal motion of each contact, x₁, y₁, x₂, y₂ and so on.
    """

    mass: Array  # M, kg
    damping: Array  # B, N·s/m
    stiffness: Array  # K with all groups shorted, N/m
    coupling: Array  # Θ, shape (n, g), N/V
    contact: Array  # P, shape (2k, n): motion of the contacts per coordinate
    capacitance: Array  # C of the clamped stator, shape (g, g), F
    recoil: Array  # momentum along y and along x per velocity of a coordinate, shape (n, 2), kg
    residual: Array  # R, shape (2k, 2k), m/N
    residual_per_volt: Array  # S, shape (2k, g), m/V
    capacitance_at: float = CAPACITANCE_AT  # Hz, at which C holds
    loss_tangent: float = 0.0  # of the clamped capacitances, the same at all frequencies
    carriers: int = 0  # number of coordinates of the carrier, the last ones: along y, then along x
    feedback: Feedback | None = None  # electrode that loads the coordinates; M, B, K and C are those with it shorted
    sensed: Array = field(default_factory=lambda: np.zeros(0))  # its force per coordinate, shape (n,), N/V
    # of each contact: the direction of the carrier's x there, the radius of the rotor over that of its surface, and its
    # share of the preload
    forward: Array = field(default_factory=lambda: np.ones(1))
    lever: Array = field(default_factory=lambda: np.ones(1))
    share: Array = field(default_factory=lambda: np.ones(1))
    # of each mode at large amplitudes, shape (modes,), 1/m²
    softening: Array = field(default_factory=lambda: np.zeros(0))
    growth: Array = field(default_factory=lambda: np.zeros(0))  # of the damping

    @classmethod
    def of_modes(
        cls, modes: Sequence[Mode], piezo: Piezo, touching: Sequence[Touching], feedback: Feedback | None = None,
        motion: Array | None = None, radius_m: float = 1.0,
    ) -> Self:  # fmt: skip
        """Return the stator of modes with its contacts, or one face of a transducer; a recoil that is not known is 0.

        ``motion`` is P, by default that of the modes, and ``radius_m`` that of the rotor. Voltages do not move a
        contact without a compliance in series: its modes that are left out do not count.
        """
        names = ("tangential_series_compliance_m_per_n", "series_compliance_m_per_n")
        softness = np.array([getattr(one.contact, name) for one in touching for name in names] or [0.0, 0.0])
        per_volt = np.tile(piezo.motion, (len(softness) // 2, 1))
        return cls(
            mass=np.array([mode.mass_kg for mode in modes]),
            damping=np.array([mode.damping_n_s_per_m for mode in modes]),
            stiffness=np.array([mode.stiffness_n_per_m for mode in modes]),
            coupling=np.array([mode.couplings[: len(piezo.capacitances)] for mode in modes]),
            contact=np.array([(mode.tip_x, mode.tip_y) for mode in modes]).T if motion is None else motion,
            capacitance=np.array(piezo.matrix),
            recoil=np.array([(mode.recoil_kg or 0.0, mode.recoil_x_kg or 0.0) for mode in modes]),
            residual=np.diag(softness),
            residual_per_volt=np.where(softness[:, np.newaxis] > 0.0, per_volt, 0.0),
            capacitance_at=piezo.reference_hz or CAPACITANCE_AT,
            loss_tangent=piezo.loss_tangent,
            feedback=feedback,
            sensed=np.array([feedback.couplings_n_per_v.get(mode.name, 0.0) for mode in modes if feedback]),
            forward=np.array([float(one.direction) for one in touching] or [1.0]),
            lever=np.array([one.radius_m / radius_m for one in touching] or [1.0]),
            share=np.array([one.share for one in touching] or [1.0]),
            softening=np.array([mode.softening_per_m2 for mode in modes]),
            growth=np.array([mode.damping_growth_per_m2 for mode in modes]),
        )

    def loaded(self, motion: Array, load: ToolLoad, resistance_n_s_per_m: float) -> Self:
        """Return the stator with a load on one velocity: that of its coordinates times a row ``motion``."""
        along = np.outer(motion, motion)
        return replace(
            self, mass=square(self.mass) + load.mass_kg * along,
            damping=square(self.damping) + resistance_n_s_per_m * along,
            stiffness=square(self.stiffness) + load.stiffness_n_per_m * along,
        )  # fmt: skip

    def with_carrier(self, mount: Mount | None) -> Self:
        """Return the stator on its carrier, whose coordinates are the last: along y and, unless it is held, along x."""
        if not (moving := carriers(mount)):
            return self
        n = len(self.mass)
        found = self._extended(len(moving))
        found.mass[n:, :n] = self.recoil.T[: len(moving)]
        found.mass[:n, n:] = found.mass[n:, :n].T
        for place, along in enumerate(moving):
            own = n + place
            found.mass[own, own], found.damping[own, own] = along.mass_kg, along.damping_n_s_per_m
            found.stiffness[own, own] = along.stiffness_n_per_m
            found.contact[1 - place :: 2, own] = self.forward if place else 1.0
        return replace(found, recoil=np.zeros((n + len(moving), 2)), carriers=len(moving))

    def pressed(self, stiffness: ArrayLike, damping: ArrayLike, surface_kg: float, surface_n_s_per_m: float) -> Self:
        """Return the stator with its contacts stuck to the surface of a rotor, which is one more coordinate, the last.

        Args:
            stiffness: of each contact along x₁, y₁, x₂ and so on, without R, in N/m.
            damping: of each contact likewise, in parallel with that stiffness, in N·s/m; it counts to first order.
            surface_kg: mass of the rotor at its surface.
            surface_n_s_per_m: damping of its bearing there.
        """
        springs = np.diag(np.asarray(stiffness, dtype=float))
        share = np.linalg.inv(np.eye(len(springs)) + self.residual @ springs)  # of a motion, not taken up by R
        springs = springs @ share
        found = self._extended(1)
        found.mass[-1, -1], found.damping[-1, -1] = surface_kg, surface_n_s_per_m
        found.contact[::2, -1] = -self.lever
        along, held = found.contact, springs @ self.residual_per_volt  # ``held``: forces of the contacts per volt
        taken = share @ along
        return replace(
            found, damping=found.damping + (taken.T * np.asarray(damping)) @ taken,
            stiffness=found.stiffness + along.T @ springs @ along, coupling=found.coupling - along.T @ held,
            capacitance=self.capacitance - self.residual_per_volt.T @ held, carriers=0,
        )  # fmt: skip

    def _extended(self, count: int) -> Self:
        """Return the stator with more coordinates, so far without mass, spring, damping and motion of the contacts."""
        more, none = (0, count), (0, 0)
        return replace(
            self, mass=np.pad(square(self.mass), more), damping=np.pad(square(self.damping), more),
            stiffness=np.pad(square(self.stiffness), more), coupling=np.pad(self.coupling, (more, none)),
            contact=np.pad(self.contact, (none, more)), recoil=np.pad(self.recoil, (more, none)),
            sensed=np.pad(self.sensed, more) if self.feedback else self.sensed,
        )  # fmt: skip

    def adapted(self, step: float) -> Self:
        """Return the stator, on its carrier, that a netlist needs so that the trapezoidal rule is exact at resonances.

        With a step h the rule shifts a resonance ω to (2/h) atan(ω h/2). With m′ = m cos²(ωh/2) and
        k′ = (4m/h²) sin²(ωh/2) the discretised coordinate resonates at ω. The recoil raises a mode from ω to
        ω/√(1 − s), with s the sum of Γ²/(m m_c) along y and x, if the springs of the carrier are soft; Γ′ is such that
        the discretised one is raised alike.
        """
        whole, elastic = square(self.mass), np.diag(square(self.stiffness))
        own, n = np.diag(whole), len(whole) - self.carriers
        half = 0.5 * step * np.sqrt(elastic / own)
        written, springs = discretised(own, elastic, step)
        mass = np.diag(written)
        recoil = whole[n:, :n]
        square_kg2 = np.sum(recoil**2, axis=0)
        shaking = np.flatnonzero(square_kg2)
        if len(shaking):
            share = square_kg2[shaking] / (own[shaking] * own[n])
            share = 1.0 - (np.tan(half[shaking]) / np.tan(half[shaking] / np.sqrt(1.0 - share))) ** 2
            parts = recoil[:, shaking] ** 2 / square_kg2[shaking]
            exact = np.sqrt(share * parts * written[shaking] * written[n:, np.newaxis])
            mass[n:, shaking] = np.copysign(exact, recoil[:, shaking])
            mass[:n, n:] = mass[n:, :n].T
        return replace(self, mass=mass if self.carriers else written, stiffness=springs)

    def dynamic_stiffness(self, omega: ArrayLike) -> Complex:
        """Return K − ω²M + jωB in N/m at angular frequencies in rad/s, shape (…, n, n), with the feedback electrode."""
        rate = 1j * np.asarray(omega, dtype=float)[..., np.newaxis, np.newaxis]
        found = np.asarray(square(self.stiffness) + rate * square(self.damping) + rate**2 * square(self.mass))
        if self.feedback:
            found += self.feedback_gain(omega)[..., np.newaxis, np.newaxis] * np.outer(self.sensed, self.sensed)
        return found

    def feedback_gain(self, omega: ArrayLike) -> Complex:
        """Return volts at the feedback electrode per coulomb on it in 1/F at angular frequencies in rad/s."""
        assert self.feedback is not None
        rate = 1j * np.asarray(omega, dtype=float)
        return np.asarray(rate / (1.0 / self.feedback.resistance_ohm + rate * self.feedback.capacitance_f))

    def admittance(self, omega: ArrayLike) -> Complex:
        """Return the admittance matrices of the groups in S at angular frequencies in rad/s, shape (…, g, g).

        Y = jω (1 − j tan δ) (f/f₀)^(−2δ/π) C + jω Θᵀ (K − ω²M + jωB)⁻¹ Θ. The factor of C is that of a loss tangent
        that is the same at all frequencies; f₀ is the frequency at which C holds.
        """
        angular = np.asarray(omega, dtype=float)[..., np.newaxis, np.newaxis]
        exponent = -2.0 / pi * atan(self.loss_tangent)
        dispersed = (angular / (2.0 * pi * self.capacitance_at)) ** exponent * self.capacitance
        dynamic = self.dynamic_stiffness(omega)
        motion = np.linalg.solve(dynamic, np.broadcast_to(self.coupling, (*dynamic.shape[:-1], self.coupling.shape[1])))
        return np.asarray(1j * angular * ((1.0 - 1j * self.loss_tangent) * dispersed + self.coupling.T @ motion))

    def resonances(self) -> Array:
        """Return the undamped resonances in Hz with all groups shorted, ascending."""
        mass, stiffness = square(self.mass), square(self.stiffness)
        scale = np.sqrt(np.outer(np.diag(mass), np.diag(mass)))
        factor = np.linalg.inv(np.linalg.cholesky(mass / scale))  # the unit matrix without recoil
        squares = np.linalg.eigvalsh(factor @ (stiffness / scale) @ factor.T)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi))

    def damped(self) -> tuple[Array, Array]:
        """Return the frequencies in Hz and the quality factors of the motions that oscillate, all groups shorted."""
        mass, count = square(self.mass), len(square(self.mass))
        below = -np.linalg.solve(mass, np.hstack([square(self.stiffness), square(self.damping)]))
        rates = np.linalg.eigvals(np.vstack([np.eye(count, 2 * count, count), below]))
        rates = rates[(rates.imag > 0.0) & (rates.real < 0.0)]
        return np.abs(rates) / (2.0 * pi), np.abs(rates) / (-2.0 * rates.real)

    def on_carrier(self, mount: Mount | None) -> Self:
        """Return the stator of the modes that this one has on its carrier, without recoil, in the order of its own.

        They are the normal modes of stator, carrier and springs. What the damping couples between them is left out.
        """
        carried = self.with_carrier(mount)
        return self._uncoupled(carried) if self.recoil[:, : carried.carriers].any() else self

    def with_open_electrode(self) -> Self:
        """Return the stator of the modes that this one has with its feedback electrode open, as on a large resistance.

        The charge that stays on the electrode stiffens the modes, and couples those that it senses.
        """
        if self.feedback is None:
            return self
        stiffness = square(self.stiffness) + np.outer(self.sensed, self.sensed) / self.feedback.capacitance_f
        return self._uncoupled(replace(self, stiffness=stiffness, feedback=None, sensed=np.zeros(0)))

    def _uncoupled(self, coupled: Self) -> Self:
        """Return the normal modes of a stator with more springs or coordinates, as many as this one has."""
        from scipy.linalg import eigh  # takes long to load
        from scipy.optimize import linear_sum_assignment

        n, stiffness = len(self.mass), square(coupled.stiffness)
        _, shapes = eigh(stiffness, square(coupled.mass))
        shares = np.diag(stiffness)[:, np.newaxis] * shapes**2
        shapes = shapes[:, linear_sum_assignment(shares / shares.sum(axis=0), maximize=True)[1]]
        shapes = (shapes / np.diag(shapes))[:, :n]
        mass, damping, elastic = (
            np.sum(shapes * (square(one) @ shapes), axis=0) for one in (coupled.mass, coupled.damping, stiffness)
        )
        return replace(
            coupled, mass=mass, damping=damping, stiffness=elastic, coupling=shapes.T @ coupled.coupling,
            contact=coupled.contact @ shapes, recoil=shapes.T @ coupled.recoil, carriers=0,
            sensed=shapes.T @ coupled.sensed if coupled.feedback else coupled.sensed,
        )  # fmt: skip

    @cached_property
    def preload_motion(self) -> Array:
        """What the coordinates move the contacts towards the rotor, weighted by their shares of the preload."""
        return np.asarray(self.share @ self.contact[1::2])

    @cached_property
    def flexibility(self) -> Array:
        """P K⁻¹ Pᵀ in m/N: static motion of the contacts per force, without R; shape (2k, 2k).

        Elements that differ from 0 only by rounding are 0.
        """
        if self.stiffness.ndim == 1:
            found = (self.contact / self.stiffness) @ self.contact.T
        else:
            found = self.contact @ np.linalg.solve(self.stiffness, self.contact.T)
        return np.where(np.abs(found) > ROUNDING * np.trace(found), found, 0.0)

    @property
    def carrier_recoil(self) -> Array:
        """Recoil of the modes along y and x on the carrier in kg, shape (2, modes); 0 where nothing moves."""
        n = len(self.mass) - self.carriers
        found = np.zeros((2, n))
        if self.carriers:
            found[: self.carriers] = self.mass[n:, :n]
        return found

    @property
    def mode_rows(self) -> Array:
        """Values of the modes of a stator with diagonal matrices, columns :data:`MODE_COLUMNS`."""
        return np.column_stack(
            [self.mass, self.damping, self.stiffness, self.coupling, self.contact[:2].T, self.recoil]
        )

    @property
    def decay_s(self) -> float:
        """Longest time in s in which a coordinate alone decays by e, 2m/c."""
        return float(np.max(2.0 * np.diag(square(self.mass)) / np.diag(square(self.damping))))


STEP_ERROR = 0.01  # of the power at a resonance, at the coarsest step of an export
STEP_WORDS = f"the power at a resonance is then within {100.0 * STEP_ERROR:g} %; with a coarser one v(check) is 1"
_SHIFT = 0.5 * STEP_ERROR  # of it by the shift of the resonance; the rest is for the contact and for tolerances
_POINTS = 100  # smallest number of steps in a period of it


def longest_step(frequency_hz: ArrayLike, quality: ArrayLike) -> float:
    """Return the longest time step in s, with two digits, at which resonances keep their power within STEP_ERROR.

    The trapezoidal rule shifts a resonance by δ = (ωh)²/12 of its frequency; driven at its own frequency it then has
    1/(1 + (2Qδ)²) of the power.
    """
    turn = np.sqrt(6.0 * sqrt(_SHIFT / (1.0 - _SHIFT)) / np.asarray(quality))
    found = float(np.min(np.minimum(turn / (2.0 * pi), 1.0 / _POINTS) / np.asarray(frequency_hz)))
    digits = 10.0 ** (floor(log10(found)) - 1)
    return float(f"{floor(found / digits * (1.0 + 1e-9)) * digits:.2g}")


def discretised(mass_kg: ArrayLike, stiffness_n_per_m: ArrayLike, step: float) -> tuple[Array, Array]:
    """Return the mass (kg) and stiffness (N/m) whose resonance by the trapezoidal rule is that of the given ones."""
    half = 0.5 * step * np.sqrt(np.divide(stiffness_n_per_m, mass_kg))
    return np.multiply(mass_kg, np.cos(half) ** 2), np.multiply(4.0 / step**2 * np.sin(half) ** 2, mass_kg)


def square(values: Array) -> Array:
    """Return the matrix of a diagonal, or the matrix itself."""
    return np.diag(values) if values.ndim == 1 else values


@lru_cache(maxsize=256)
def carriers(mount: Mount | None) -> tuple[Mount, ...]:
    """Return the springs of the carrier along y and, unless it is held along the rotor, along x."""
    return tuple(along for along in (mount, mount and mount.tangential) if along)


def unknown_recoil(modes: Sequence[Mode], mount: Mount | None, motion: Array) -> tuple[str, ...]:
    """Return one sentence for each mode whose recoil is not known and may shift it by half a bandwidth or more.

    Its estimate is that of a mode whose mass moves with the tip, by ``motion`` P; of several tips as their mean.
    """
    found = []
    tips = motion.reshape(-1, 2, len(modes))
    for mode, (x, y), square_motion in zip(
        modes, tips.mean(axis=0).T, np.sum(tips**2, axis=1).mean(axis=0), strict=True
    ):
        for carrier, (name, moves) in zip(carriers(mount), (("recoil_kg", y), ("recoil_x_kg", x)), strict=False):
            if getattr(mode, name) is not None or mode.mass_kg >= MAX_TIP_MASS_KG * square_motion:
                continue
            estimate = mode.mass_kg * moves / square_motion
            shift = 0.5 * estimate**2 / (mode.mass_kg * carrier.mass_kg)
            if 2.0 * shift * mode.quality_factor > 1.0:
                found.append(
                    f"The recoil of mode {mode.name} on the carrier is not known: one of {1e3 * abs(estimate):.2g} g, "
                    f"an estimate, would raise its frequency by {100.0 * shift:.2g} %; half its bandwidth is "
                    f"{50.0 / mode.quality_factor:.2g} %. Specify {name} of the mode, or beam.recoil = true for a beam."
                )
    return tuple(found)
