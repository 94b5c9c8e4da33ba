# SPDX-License-Identifier: GPL-3.0-or-later
r"""The equivalent circuit of a piezoelectric resonator: Butterworth–Van Dyke with any number of motional arms.

.. math::
    Y = \frac{1}{R_\ell + sL_\ell + 1/Y_d}, \qquad
    Y_d = \frac{1}{R_0 + 1/Y_0} + \mathbf 1^T Z^{-1} \mathbf 1, \qquad
    Z = R + sL + \frac{1}{sC}

L and C are diagonal. R is diagonal if each arm has its own losses; with shared losses it is a full positive definite
matrix, :math:`R_{ij} = \sqrt{L_i L_j} D_{ij}` with the damping matrix D in 1/s. The circuit is passive for all values:
Re Y is a sum of squares. The leads R_ℓ, L_ℓ are in series with the device Y_d.

The clamped capacitance C₀ and its loss tangent hold at the reference frequency f₀. One part of the loss tangent falls
with frequency (a conductance in parallel), one rises (the resistance R₀ in series) and the rest is constant: a ladder
of R–C branches (:func:`~.dielectric.lossy_capacitance`) from f₀/100 to 100 f₀, whose capacitance falls slowly with
frequency. A further part is constant with the same capacitance at all frequencies, as in the models of instruments; no
network of passive elements has it, and netlists have the ladder of the same tangent instead. The characteristic
frequencies are defined by IEEE 176, for the device behind its leads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, astuple, dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.motor.dielectric import Branch, lossy_capacitance

_LADDER_SPAN = 100.0  # of the constant loss, to both sides of the reference frequency
_LADDER_BRANCHES = 15  # three a decade: a ripple of 0.002 % of the loss, too small to be taken for an arm
_LEAST_LOSS = 1e-9  # loss tangent below which there is no ladder
_WINDOW = 2.0  # search range of extrema on each side of a resonance, in bandwidths
_ONE_ARM = 3.0  # bandwidths over which a circuit of one arm is fitted to a resonance
_GRID = 401  # points over that window: 100 a bandwidth


def constant_loss(capacitance_f: float, loss_tangent: float, reference_hz: float) -> tuple[Branch, ...]:
    """Return the branches of a capacitance in F at the reference frequency with a constant loss tangent."""
    return lossy_capacitance(
        capacitance_f,
        loss_tangent if loss_tangent > _LEAST_LOSS else 0.0,
        low_hz=reference_hz / _LADDER_SPAN,
        high_hz=reference_hz * _LADDER_SPAN,
        branches=_LADDER_BRANCHES,
    )


@dataclass(frozen=True)
class MotionalArm:
    """One series R–L–C arm."""

    resistance_ohm: float
    inductance_h: float
    capacitance_f: float

    @property
    def series_resonance_hz(self) -> float:
        """Frequency 1/(2π√(LC)) in Hz."""
        return 1.0 / (2.0 * pi * sqrt(self.inductance_h * self.capacitance_f))

    @property
    def quality_factor(self) -> float:
        """Mechanical quality factor Qm = √(L/C)/R."""
        return sqrt(self.inductance_h / self.capacitance_f) / self.resistance_ohm


@dataclass(frozen=True)
class Characteristics:
    """Characteristic values of one resonance; ``None`` where losses or neighbouring modes hide the extremum."""

    fs: float | None  # frequency of largest conductance, Hz
    fp: float | None  # frequency of largest resistance, Hz
    fm: float | None  # frequency of largest |Y|, Hz
    fn: float | None  # frequency of smallest |Y|, Hz
    fr: float | None  # resonance, where the susceptance vanishes near fs, Hz
    fa: float | None  # antiresonance, where it vanishes near fp, Hz
    coupling_factor: float  # k_eff, from the pair below
    # ``"fs, fp"``, and k_eff = √(1 − (fs/fp)²); ``"C, C0"`` where neighbours or losses hide one of these two, and k_eff
    # = √(C/(C + C₀)).
    coupling_pair: str
    figure_of_merit: float  # M = 1/(2π f C₀ R); below 2 the susceptance stays positive


@dataclass(frozen=True)
class EquivalentCircuit:
    """Clamped capacitance with loss, motional arms by rising frequency, and leads."""

    arms: tuple[MotionalArm, ...]  # the arms; ``resistance_ohm`` of an arm is the diagonal element of R
    clamped_capacitance_f: float  # C₀ at the reference frequency
    loss_tangent: float  # of C₀ at the reference frequency, its four parts together
    loss_reference_hz: float  # the reference frequency
    lead_resistance_ohm: float = 0.0  # R_ℓ
    lead_inductance_h: float = 0.0  # L_ℓ
    loss_tangent_falling: float = 0.0  # part of the loss tangent that falls in proportion to 1/f
    loss_tangent_rising: float = 0.0  # part that rises in proportion to f
    loss_tangent_flat: float = 0.0  # part that is constant without dispersion: its capacitance does not fall
    # one row for each shared resistance: weights in √Ω of the currents of the clamped capacitance and of each arm. R is
    # the sum of the arms' own resistances and of the products of the rows.
    shared_losses: tuple[tuple[float, ...], ...] = ()

    @property
    def loss_resistance_ohm(self) -> float:
        """Resistance R₀ in series with the clamped capacitance, Ω."""
        return self.loss_tangent_rising / (2.0 * pi * self.loss_reference_hz * self.clamped_capacitance_f)

    @property
    def loss_conductance_s(self) -> float:
        """Conductance in parallel to the clamped capacitance, S."""
        return self.loss_tangent_falling * 2.0 * pi * self.loss_reference_hz * self.clamped_capacitance_f

    @property
    def loss_tangent_causal(self) -> float:
        """Part of the loss tangent that is constant with the dispersion that causality requires."""
        return self.loss_tangent - self.loss_tangent_falling - self.loss_tangent_rising - self.loss_tangent_flat

    def dielectric(self, *, flat: bool = False) -> tuple[Branch, ...]:
        """Return the branches of the clamped capacitance with the causal part of its loss, with ``flat`` both."""
        constant = self.loss_tangent_causal + flat * self.loss_tangent_flat
        return constant_loss(self.clamped_capacitance_f, constant, self.loss_reference_hz)

    @property
    def own_resistance_ohm(self) -> tuple[float, ...]:
        """Resistance of each arm without its shared part, Ω."""
        shared = [sum(row[1 + k] ** 2 for row in self.shared_losses) for k in range(len(self.arms))]
        return tuple(arm.resistance_ohm - part for arm, part in zip(self.arms, shared, strict=True))

    @property
    def damping_matrix(self) -> list[list[float]] | None:
        """Damping matrix D of the arms in 1/s, by rows; ``None`` if R is diagonal."""
        if not self.shared_losses:
            return None
        root = np.sqrt([arm.inductance_h for arm in self.arms])
        columns = np.array(self.shared_losses)[:, 1:].T
        resistance = np.diag(self.own_resistance_ohm) + columns @ columns.T
        found: list[list[float]] = (resistance / np.outer(root, root)).tolist()
        return found

    def device_admittance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the admittance in S of the device without its leads."""
        s = 2j * pi * np.asarray(frequency_hz, dtype=float)
        flat = self.loss_tangent_flat * self.clamped_capacitance_f * np.abs(s)
        y: NDArray[np.complex128] = np.asarray(self.loss_conductance_s + flat, dtype=complex)
        for resistance, part in self.dielectric():
            y = y + s * part / (1.0 + s * resistance * part)
        y = y / (1.0 + self.loss_resistance_ohm * y)
        parts = [y]
        for arm, own in zip(self.arms, self.own_resistance_ohm, strict=True):
            parts.append(1.0 / (own + s * arm.inductance_h + 1.0 / (s * arm.capacitance_f)))
        if not self.shared_losses:
            return np.asarray(sum(parts), dtype=complex)
        each, weights = np.array(parts), np.array(self.shared_losses)
        drop = np.tensordot(weights, each, 1)  # currents through the shared resistances at 1 V, by Woodbury's formula
        matrix = np.eye(len(weights)) + np.einsum("ik,k...,jk->...ij", weights, each, weights)
        shared = np.linalg.solve(matrix, np.moveaxis(drop, 0, -1)[..., None])[..., 0]
        return np.asarray(each.sum(axis=0) - (np.moveaxis(drop, 0, -1) * shared).sum(axis=-1), dtype=complex)

    def admittance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the admittance in S at the outer ends of the leads."""
        s = 2j * pi * np.asarray(frequency_hz, dtype=float)
        leads = self.lead_resistance_ohm + s * self.lead_inductance_h
        return np.asarray(1.0 / (leads + 1.0 / self.device_admittance(frequency_hz)), dtype=complex)

    def characteristics(self) -> tuple[Characteristics, ...]:
        """Return the characteristic values of each arm, in the order of the arms."""
        return tuple(self._characterise(arm, pole) for arm, pole in zip(self.arms, self.antiresonances(), strict=True))

    def definitions(self) -> tuple[dict[str, dict[str, float] | None], ...]:
        """Return the values of every arm by each definition of standards and instruments.

        Three follow from pairs of frequencies: ``"fs, fp"`` (IEEE 176: largest conductance and resistance),
        ``"fm, fn"`` (largest and smallest admittance) and ``"fr, fa"`` (zero phase). With the pair's f₁ < f₂ and the
        clamped capacitance C0, C1 = C0 ((f₂/f₁)² − 1), L1 = 1/(4π²f₁²C1), R1 = 1/Re Y(f₁), of ``"fm, fn"`` 1/|Y(f₁)|.
        ``"half power"`` is that of analysers (Keysight E4990A Help, ``CALC:EPAR:S4?``): R1 = 1/Re Y(fs),
        Q = fs/(f₂ − f₁) of the frequencies with half that conductance, L1 = QR1/2πfs. ``"one arm"`` is the circuit of
        one arm and C0 whose impedance fits best by least squares, over three bandwidths about the arm's frequency.

        In the pairs ``resonance_hz`` and ``antiresonance_hz`` are f₁ and f₂; in the other two they are those of the
        lossless circuit with these values. Q = √(L1/C1)/R1 and k_eff = √(1 − (f₁/f₂)²). A definition is ``None`` where
        losses or neighbours hide it.
        """
        found = []
        for arm, item in zip(self.arms, self.characteristics(), strict=True):
            pairs = {"fs, fp": (item.fs, item.fp), "fm, fn": (item.fm, item.fn), "fr, fa": (item.fr, item.fa)}
            values = {name: self._from_pair(name, *pair) for name, pair in pairs.items()}
            found.append({**values, "half power": self._half_power(arm, item.fs), "one arm": self._one_arm(arm)})
        return tuple(found)

    def _from_pair(self, name: str, low: float | None, high: float | None) -> dict[str, float] | None:
        if low is None or high is None or low >= high:
            return None
        y = complex(self.device_admittance(low))
        capacitance = self.clamped_capacitance_f * ((high / low) ** 2 - 1.0)
        return self._defined(low, high, 1.0 / (abs(y) if name == "fm, fn" else y.real), capacitance)

    def _half_power(self, arm: MotionalArm, fs: float | None) -> dict[str, float] | None:
        if fs is None:
            return None
        greatest = float(self.device_admittance(fs).real)
        width = arm.series_resonance_hz / arm.quality_factor
        high = _crossing(lambda f: 0.5 * greatest - self.device_admittance(f).real, fs + 0.5 * width, width)
        low = _crossing(lambda f: self.device_admittance(f).real - 0.5 * greatest, fs - 0.5 * width, width)
        if low is None or high is None or not low < fs < high:
            return None
        return self._lossless(fs, 1.0 / greatest, (high - low) * greatest / (2.0 * pi * fs**2))

    def _one_arm(self, arm: MotionalArm) -> dict[str, float] | None:
        frequency, half = arm.series_resonance_hz, 0.5 * _ONE_ARM * arm.series_resonance_hz / arm.quality_factor
        if half >= frequency:
            return None
        w = 2.0 * pi * np.linspace(frequency - half, frequency + half, _GRID)
        z = 1.0 / (self.device_admittance(w / (2.0 * pi)) - 1j * w * self.clamped_capacitance_f)
        ratio = w / (2.0 * pi * frequency)
        by_l, by_c = np.linalg.lstsq(np.column_stack([ratio, -1.0 / ratio]), z.imag, rcond=None)[0].tolist()
        if min(by_l, by_c) <= 0.0:
            return None
        return self._lossless(frequency * sqrt(by_c / by_l), float(z.real.mean()), 1.0 / (2.0 * pi * frequency * by_c))

    def _lossless(self, frequency: float, resistance: float, capacitance: float) -> dict[str, float]:
        high = frequency * sqrt(1.0 + capacitance / self.clamped_capacitance_f)
        return self._defined(frequency, high, resistance, capacitance)

    def _defined(self, low: float, high: float, resistance: float, capacitance: float) -> dict[str, float]:
        arm = MotionalArm(resistance, 1.0 / ((2.0 * pi * low) ** 2 * capacitance), capacitance)
        return {
            "resonance_hz": low,
            "antiresonance_hz": high,
            "coupling_factor": sqrt(1.0 - (low / high) ** 2),
            "quality_factor": arm.quality_factor,
            **asdict(arm),
            "clamped_capacitance_f": self.clamped_capacitance_f,
        }

    def _characterise(self, arm: MotionalArm, pole: complex) -> Characteristics:
        resonance, width = arm.series_resonance_hz, arm.series_resonance_hz / arm.quality_factor
        anti, anti_width = abs(pole) / (2.0 * pi), -2.0 * pole.real / (2.0 * pi)
        near, far = (resonance, width), (anti, anti_width)
        fs = _peak(lambda f: self.device_admittance(f).real, *near)
        fp = _peak(lambda f: (1.0 / self.device_admittance(f)).real, *far)
        if fs is not None and fp is not None and fs < fp:
            coupling, pair = sqrt(1.0 - (fs / fp) ** 2), "fs, fp"
        else:
            coupling, pair = sqrt(arm.capacitance_f / (arm.capacitance_f + self.clamped_capacitance_f)), "C, C0"
        return Characteristics(
            fs=fs,
            fp=fp,
            fm=_peak(lambda f: np.abs(self.device_admittance(f)), *near),
            fn=_peak(lambda f: -np.abs(self.device_admittance(f)), *far),
            fr=_crossing(lambda f: -self.device_admittance(f).imag, *near),
            fa=_crossing(lambda f: self.device_admittance(f).imag, *far),
            coupling_factor=coupling,
            coupling_pair=pair,
            figure_of_merit=1.0 / (2.0 * pi * resonance * self.clamped_capacitance_f * arm.resistance_ohm),
        )

    def antiresonances(self) -> list[complex]:
        """Return the natural frequencies of the open device in 1/s; one lies above each series resonance.

        The losses of the clamped capacitance, whose effect is small, count as a series resistance; shared losses as own
        losses.
        """
        resistance, inductance, capacitance = np.array([astuple(arm) for arm in self.arms]).T
        loss = self.loss_tangent / (2.0 * pi * self.loss_reference_hz * self.clamped_capacitance_f)
        # states: currents √L i and voltages √C u of the arms and √C₀ u of the clamped capacitance
        scale = 1.0 / np.sqrt(inductance)
        damping = (np.diag(resistance) + loss) * np.outer(scale, scale)
        coupling = np.hstack(
            [np.diag(-scale / np.sqrt(capacitance)), scale[:, None] / sqrt(self.clamped_capacitance_f)]
        )
        rest = np.zeros((len(self.arms) + 1, len(self.arms) + 1))
        values = np.linalg.eigvals(np.block([[-damping, coupling], [-coupling.T, rest]]))
        values = values[np.argsort(np.abs(values))][1:]  # the first is the constant charge
        return [complex(value) for value in values[::2]]


def _window(centre: float, width: float) -> NDArray[np.float64]:
    return np.linspace(max(centre - _WINDOW * width, 0.05 * centre), centre + _WINDOW * width, _GRID)


def _peak(function: Callable[[NDArray[np.float64]], NDArray[np.float64]], centre: float, width: float) -> float | None:
    """Return the frequency of the local maximum nearest to a frequency."""
    grid = _window(centre, width)
    values = function(grid)
    peaks = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])) + 1
    if not len(peaks):
        return None
    index = int(peaks[np.argmin(np.abs(grid[peaks] - centre))])
    middle = float(grid[index])
    from scipy.optimize import minimize_scalar  # takes long to load

    offset = minimize_scalar(
        lambda x: -float(function(np.array([middle + x]))[0]),
        bounds=(float(grid[index - 1]) - middle, float(grid[index + 1]) - middle),
        method="bounded",
        options={"xatol": 1e-7 * width},
    )
    return middle + float(offset.x)


def _crossing(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]], centre: float, width: float
) -> float | None:
    """Return the frequency of the upward zero crossing nearest to a frequency."""
    grid = _window(centre, width)
    values = function(grid)
    rising = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    if not len(rising):
        return None
    index = int(rising[np.argmin(np.abs(grid[rising] - centre))])
    from scipy.optimize import brentq  # takes long to load

    return float(brentq(lambda f: float(function(np.array([f]))[0]), float(grid[index]), float(grid[index + 1])))
