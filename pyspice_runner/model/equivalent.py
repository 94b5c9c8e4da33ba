# SPDX-License-Identifier: GPL-3.0-or-later
r"""The equivalent circuit of a piezoelectric resonator: Butterworth–Van Dyke with any number of motional arms.

.. math::
    Y = \frac{1}{R_\ell + sL_\ell + 1/Y_d}, \qquad
    Y_d = \frac{1}{R_0 + 1/(sC_0)} + \sum_n \frac{1}{R_n + sL_n + 1/(sC_n)}, \qquad
    R_0 = \frac{\tan\delta}{2\pi f_0 C_0}

The leads R_ℓ, L_ℓ stand in series with the device Y_d. The loss of the clamped capacitance C₀ is a resistance in series
with it, as in ``behavioral/piezomotor_group.lib``: tan δ holds at the reference frequency f₀ and rises in proportion to
frequency. The characteristic frequencies are IEEE 176's, of the device behind its leads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

_WINDOW = 2.0  # bandwidths on each side of a resonance in which its extrema are looked for
_GRID = 401  # points over that window: 100 a bandwidth


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
    """Characteristic values of one resonance; ``None`` where losses or neighbouring modes hide the extremum.

    Attributes:
        fs: frequency of greatest conductance, Hz.
        fp: frequency of greatest resistance, Hz.
        fm: frequency of greatest |Y|, Hz.
        fn: frequency of least |Y|, Hz.
        fr: resonance, where the susceptance vanishes near fs, Hz.
        fa: antiresonance, where it vanishes near fp, Hz.
        coupling_factor: k_eff, from the pair below.
        coupling_pair: ``"fs, fp"``, and k_eff = √(1 − (fs/fp)²); ``"C, C0"`` where neighbours or losses hide one of
            these two, and k_eff = √(C/(C + C₀)).
        figure_of_merit: M = 1/(2π f C₀ R); below 2 the susceptance stays positive.
    """

    fs: float | None
    fp: float | None
    fm: float | None
    fn: float | None
    fr: float | None
    fa: float | None
    coupling_factor: float
    coupling_pair: str
    figure_of_merit: float


@dataclass(frozen=True)
class EquivalentCircuit:
    """Clamped capacitance with loss, motional arms by rising frequency, and leads."""

    arms: tuple[MotionalArm, ...]
    clamped_capacitance_f: float
    loss_tangent: float
    loss_reference_hz: float
    lead_resistance_ohm: float = 0.0
    lead_inductance_h: float = 0.0

    @property
    def loss_resistance_ohm(self) -> float:
        """Resistance in series with the clamped capacitance, Ω."""
        return self.loss_tangent / (2.0 * pi * self.loss_reference_hz * self.clamped_capacitance_f)

    def device_admittance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the admittance in S of the device without its leads."""
        s = 2j * pi * np.asarray(frequency_hz, dtype=float)
        y = 1.0 / (self.loss_resistance_ohm + 1.0 / (s * self.clamped_capacitance_f))
        for arm in self.arms:
            y = y + 1.0 / (arm.resistance_ohm + s * arm.inductance_h + 1.0 / (s * arm.capacitance_f))
        return np.asarray(y, dtype=complex)

    def admittance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the admittance in S at the outer ends of the leads."""
        s = 2j * pi * np.asarray(frequency_hz, dtype=float)
        leads = self.lead_resistance_ohm + s * self.lead_inductance_h
        return np.asarray(1.0 / (leads + 1.0 / self.device_admittance(frequency_hz)), dtype=complex)

    def characteristics(self) -> tuple[Characteristics, ...]:
        """Return the characteristic frequencies of every arm, in their order."""
        return tuple(self._characterise(arm, pole) for arm, pole in zip(self.arms, self._antiresonances(), strict=True))

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

    def _antiresonances(self) -> list[complex]:
        """Return the natural frequencies of the open device in 1/s; one lies above each series resonance."""
        count = len(self.arms)
        inductance = np.array([arm.inductance_h for arm in self.arms])
        resistance = np.array([arm.resistance_ohm for arm in self.arms])
        capacitance = np.array([arm.capacitance_f for arm in self.arms])
        # states: currents √L i and voltages √C u of the arms and √C₀ u of the clamped capacitance
        matrix = np.zeros((2 * count + 1, 2 * count + 1))
        scale = 1.0 / np.sqrt(inductance)
        matrix[:count, :count] = -np.diag(resistance / inductance) - self.loss_resistance_ohm * np.outer(scale, scale)
        coupling = np.hstack(
            [np.diag(-scale / np.sqrt(capacitance)), scale[:, None] / sqrt(self.clamped_capacitance_f)]
        )
        matrix[:count, count:] = coupling
        matrix[count:, :count] = -coupling.T
        values = np.linalg.eigvals(matrix)
        values = values[np.argsort(np.abs(values))][1:]  # the first is the charge that stays
        return [complex(value) for value in values[::2]]


def _window(centre: float, width: float) -> NDArray[np.float64]:
    return np.linspace(max(centre - _WINDOW * width, 0.05 * centre), centre + _WINDOW * width, _GRID)


def _peak(function: Callable[[NDArray[np.float64]], NDArray[np.float64]], centre: float, width: float) -> float | None:
    """Return where a function has the local maximum nearest to a frequency."""
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
    """Return where a function crosses zero upwards nearest to a frequency."""
    grid = _window(centre, width)
    values = function(grid)
    rising = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    if not len(rising):
        return None
    index = int(rising[np.argmin(np.abs(grid[rising] - centre))])
    from scipy.optimize import brentq  # takes long to load

    return float(brentq(lambda f: float(function(np.array([f]))[0]), float(grid[index]), float(grid[index + 1])))
