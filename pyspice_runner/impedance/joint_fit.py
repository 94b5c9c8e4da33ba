# SPDX-License-Identifier: GPL-3.0-or-later
r"""Joint fit of several spectra of one device at different drive levels, temperatures, or both.

One circuit describes all spectra. With the voltage U and the charge amplitude q = |Y_m| U / ω of a motional arm,

.. math::
    Y_m = \left[R\,(1 + \tfrac14 \kappa_q q^2) + j\omega L + \frac{1 - \tfrac34 \gamma_q q^2}{j\omega C}\right]^{-1},

the fundamental of Duffing's oscillator (Nayfeh, Mook, *Nonlinear Oscillations*, 1979, section 4.1) with the modal
coordinate r = q/θ: a mode with the coupling θ has the softening :math:`\gamma = \gamma_q\theta^2` and the growth of
damping :math:`\kappa = \kappa_q\theta^2`. Where three amplitudes are possible, a sweep with rising frequency has the
smallest.

The logarithms of frequency, coupling θ, clamped capacitance and quality factor change in proportion to temperature; the
slopes of the first three are those of :class:`~pyspice_runner.motor.thermal.Thermal`.

The start is the fit of the spectrum with the lowest level. The weights follow from the estimated errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import pi

import numpy as np

from pyspice_runner.errors import ParameterError, SpectrumError
from pyspice_runner.impedance.identify import descent
from pyspice_runner.impedance.identify.descent import FINEST, Complexes, Vector, rms
from pyspice_runner.impedance.identify.selection import Progress
from pyspice_runner.impedance.noise import estimate
from pyspice_runner.impedance.one_port_fit import POOR_FIT, SKEWED, Fit, SpectrumFit, fit_one_port, misfit
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.motor.equivalent import MotionalArm
from pyspice_runner.motor.numerics import one_thread_of_scipy

_ARM = 5  # parameters of an arm: ln f, ln X, ln Q, and softening and growth at the maximum charge
_DRIFTS = ("frequency_drift_per_k", "coupling_drift_per_k", "capacitance_drift_per_k", "quality_drift_per_k")
_CHANGES = ("softening_per_c2", "damping_growth_per_c2")
_LOSSES = 3  # parameters of the loss
_DRIFTED = slice(1 + _LOSSES, 1 + _LOSSES + len(_DRIFTS))
_FIRST = _DRIFTED.stop  # parameter of the first arm
_LARGEST = 0.5  # limit of the law: softening at the maximum charge


@dataclass(frozen=True)
class SoftArm(MotionalArm):
    """One motional arm at small amplitude, and its change with the charge amplitude."""

    softening_per_c2: float  # γ_q
    damping_growth_per_c2: float  # κ_q
    standard_errors: dict[str, float]  # of the five values

    def of_mode(self, coupling_n_per_v: float) -> dict[str, float]:
        """Return ``softening_per_m2`` and ``damping_growth_per_m2`` of a mode with a coupling θ in N/V."""
        square = coupling_n_per_v**2
        return {name.replace("_c2", "_m2"): getattr(self, name) * square for name in _CHANGES}


@dataclass(frozen=True, eq=False, repr=False)
class JointFit(Fit):
    """One circuit fitted to several spectra.

    Attributes:
        arms: by rising frequency, at the first temperature.
        clamped_capacitance_f: C₀ at the first temperature.
        drifts: relative slopes per kelvin of frequency, coupling, clamped capacitance and quality factor; empty without
            temperatures.
        standard_errors: of the clamped capacitance and the drifts.
        rms_relative_error: root mean square of the relative residual of each spectrum.
        cautions: limits of the values.
    """

    arms: tuple[SoftArm, ...]
    clamped_capacitance_f: float
    drifts: dict[str, float]
    standard_errors: dict[str, float]
    rms_relative_error: tuple[float, ...]
    cautions: tuple[str, ...] = ()

    def summary(self) -> dict[str, str]:
        """Return the errors, the drifts, and the change of each arm with the charge."""
        found = {"RMS error": ", ".join(f"{100.0 * value:.3g} %" for value in self.rms_relative_error)}
        for name, value in self.drifts.items():
            found[name.replace("_", " ")] = f"{value:.4g} ± {self.standard_errors[name]:.2g}"
        for number, arm in enumerate(self.arms, start=1):
            for name in _CHANGES:
                error = arm.standard_errors[name]
                found[f"arm {number} {name.replace('_', ' ')}"] = f"{getattr(arm, name):.4g} ± {error:.2g}"
        return found


@one_thread_of_scipy()
def fit_jointly(
    spectra: Sequence[Spectrum],
    modes: int | None = None,
    *,
    voltages: Sequence[float] | None = None,
    temperatures: Sequence[float] | None = None,
    timeout: float | None = None,
    progress: Progress | None = None,
) -> JointFit:
    """Fit one circuit to several spectra of one device; see :func:`~.fit.fit_spectrum`."""
    for name, values in (("voltages", voltages), ("temperatures", temperatures)):
        if values is not None and len(values) != len(spectra):
            raise ParameterError(f"{name} has {len(values)} values for {len(spectra)} spectra; give one for each.")
    if voltages is not None and not all(0.0 < value < 1e6 for value in voltages):
        raise ParameterError(f"voltages = {list(voltages)} is not valid: they must be numbers > 0 V.")
    changing = [values for values in (voltages, temperatures) if values is not None]
    alone = len(spectra) == 1 and voltages is not None and temperatures is None
    if not alone and (not changing or any(len(set(values)) < 2 for values in changing)):
        raise ParameterError(
            "Give at least two spectra with voltages or temperatures that differ, or one spectrum with its voltage."
        )
    level = np.ones(len(spectra)) if voltages is None else np.array(voltages, dtype=float)
    kelvin = np.zeros(len(spectra)) if temperatures is None else np.array(temperatures, dtype=float)
    start = fit_one_port(spectra[int(np.argmin(level))], modes, leads=False, timeout=timeout, progress=progress)
    if start.circuit.shared_losses:
        raise SpectrumError(
            f"{start.source or 'The spectrum'} has arms that share losses; fit a part of the band with one resonance."
        )
    return _Problem(spectra, level, kelvin, start).solved()


class _Problem:
    """The joint least-squares problem. Parameters: ln C₀, losses, four drifts, then ``_ARM`` of each arm.

    The losses are changes of tan δ against the start, whose description of a skewed resonance may be wrong: parts
    that are constant, fall and rise with frequency. The constant one takes a capacitance that falls with frequency.
    """

    def __init__(self, spectra: Sequence[Spectrum], level: Vector, kelvin: Vector, start: SpectrumFit) -> None:
        self.spectra, self.level, self.kelvin, self.start = spectra, level, kelvin - kelvin[0], start
        self.reference = self.kelvin[np.argmin(level)]
        self.frequency = np.array([arm.series_resonance_hz for arm in start.arms])
        self.reactance = np.array([np.sqrt(arm.inductance_h / arm.capacitance_f) for arm in start.arms])
        self.quality = np.array([arm.quality_factor for arm in start.arms])
        # charge of each arm at its resonance and the maximum level: the unit of γ and κ
        self.charge = level.max() * self.quality / (self.reactance * 2.0 * pi * self.frequency)
        bare = replace(start.circuit, arms=())
        self.clamped = [bare.device_admittance(spectrum.frequency_hz) for spectrum in spectra]
        measured = [spectrum.admittance_s for spectrum in spectra]
        self.weights = [np.abs(y) / np.maximum(estimate(y).deviation(y), FINEST * np.abs(y)) for y in measured]
        self.temperatures = bool(self.kelvin.any())
        by_amplitude = bool(np.ptp(level)) or len(spectra) == 1
        per_arm = [True, True, True, *[by_amplitude] * 2]
        self.free = np.array([*[True] * (1 + _LOSSES), *[self.temperatures] * 4, *per_arm * len(self.frequency)])

    def arms(self, parameters: Vector, kelvin: float) -> Vector:
        """Return ω, X, Q, softening and growth of every arm, each a row, at a temperature above that of the start."""
        in_frequency, in_coupling, _, in_quality = parameters[_DRIFTED] * kelvin
        f, x, q, softening, growth = parameters[_FIRST:].reshape(-1, _ARM).T
        natural = 2.0 * pi * self.frequency * np.exp(f + in_frequency)
        reactance = self.reactance * np.exp(x + in_frequency - 2.0 * in_coupling)
        return np.array([natural, reactance, self.quality * np.exp(q + in_quality), softening, growth])

    def relative(self, parameters: Vector, number: int) -> Complexes:
        """Return ln Y_model − ln Y of one spectrum."""
        spectrum, kelvin = self.spectra[number], self.kelvin[number] - self.reference
        size, constant, falling, rising, _, _, in_capacitance, _ = parameters[:_FIRST]
        clamped = self.clamped[number]
        omega = 2.0 * pi * spectrum.frequency_hz
        over = spectrum.frequency_hz / self.start.circuit.loss_reference_hz
        change = constant * (-1j - 2.0 / pi * np.log(over)) - 1j * (falling / over + rising * over)
        y = np.exp(size + in_capacitance * kelvin) * (clamped + 1j * change * clamped.imag)
        arms = zip(self.charge, self.arms(parameters, kelvin).T, strict=True)
        for charge, (natural, reactance, quality, softening, growth) in arms:
            # in units of X and of the charge U/(X ω_n): detuning, damping, and their changes with the charge
            ratio = omega / natural
            unit = self.level[number] / (reactance * natural) / charge
            detuning, damping = 1.0 - ratio**2, ratio / quality
            softer, growing = 0.75 * softening * unit**2, 0.25 * growth * unit**2
            square = amplitude_squared(detuning, damping, softer, growing)
            impedance = damping * (1.0 + growing * square) - 1j * (detuning - softer * square)
            y = y + ratio / (reactance * impedance)
        return np.asarray(np.log(y / spectrum.admittance_s))

    def solved(self) -> JointFit:
        """Return the fit."""
        from scipy.optimize import least_squares  # takes long to load

        point = np.zeros(_FIRST + _ARM * len(self.frequency))
        upper = np.full(len(point), np.inf)
        upper[_FIRST + 3 :: _ARM] = _LARGEST
        lower = -upper
        circuit = self.start.circuit
        parts = circuit.loss_tangent_causal, circuit.loss_tangent_falling, circuit.loss_tangent_rising
        lower[1 : 1 + _LOSSES] = -np.maximum(parts, 0.0)  # none is below zero
        free = self.free
        scale = np.ones(len(point))
        scale[1 : 1 + _LOSSES] = 0.01
        scale[_FIRST::_ARM] = 0.1 / self.quality
        scale[_DRIFTED] = 1e-2 / max(float(np.abs(self.kelvin).max()), 1.0)

        def residual(part: Vector) -> Vector:
            parameters = point.copy()
            parameters[free] = part
            parts = [weight * self.relative(parameters, number) for number, weight in enumerate(self.weights)]
            return np.concatenate(parts).view(float)  # real and imaginary parts side by side

        found = least_squares(
            residual, point[free], bounds=(lower[free], upper[free]), x_scale=scale[free], max_nfev=100
        )
        parameters = point.copy()
        parameters[free] = found.x
        residuals = [self.relative(parameters, number) for number in range(len(self.spectra))]
        count = sum(map(len, residuals))
        independent = sum(map(descent.independent_points, residuals))
        covariance = np.zeros((len(point), len(point)))
        scatter = descent.variance(2.0 * found.cost, count, int(free.sum()), independent)
        covariance[np.ix_(free, free)] = scatter * np.linalg.pinv(found.jac.T @ found.jac)
        return self._report(parameters, covariance, residuals, independent < 0.5 * count)

    def _report(self, parameters: Vector, covariance: Vector, residuals: list[Complexes], correlated: bool) -> JointFit:
        error = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        drifts = dict(zip(_DRIFTS, parameters[_DRIFTED].tolist(), strict=True)) if self.temperatures else {}
        back = -self.reference  # from the temperature of the start to the first one
        shares = np.array([[0, 1, -1], [-1, 1, 0], [-1, -1, 0]])  # of ln R, ln L, ln C by ln f, ln X, ln Q
        arms = []
        for k, (natural, reactance, quality, *changes) in enumerate(self.arms(parameters, back).T.tolist()):
            arm = MotionalArm(reactance / quality, reactance / natural, 1.0 / (reactance * natural))
            at = _FIRST + _ARM * k
            own = np.diag(shares @ covariance[at : at + 3, at : at + 3] @ shares.T)
            relative = np.sqrt(np.maximum(own, 0.0)).tolist()
            errors = {name: value * share for (name, value), share in zip(asdict(arm).items(), relative, strict=True)}
            unit = 1.0 / float(self.charge[k]) ** 2
            softening, growth = (unit * change for change in changes)
            errors |= dict(zip(_CHANGES, (unit * error[at + 3 : at + 5]).tolist(), strict=True))
            arms.append(SoftArm(**asdict(arm), softening_per_c2=softening, damping_growth_per_c2=growth,
                                standard_errors=errors))  # fmt: skip
        capacitance = self.start.circuit.clamped_capacitance_f * float(
            np.exp(parameters[0] + drifts.get(_DRIFTS[2], 0.0) * back)
        )
        errors = {"clamped_capacitance_f": capacitance * float(error[0])}
        errors |= {name: float(value) for name, value in zip(_DRIFTS, error[_DRIFTED], strict=True) if name in drifts}
        each = tuple(rms(np.expm1(residual)) for residual in residuals)
        # this fit has a law of amplitude: cautions of the start about its absence do not hold
        cautions = [one for one in self.start.cautions if SKEWED not in one and not one.startswith(POOR_FIT)]
        if correlated:
            cautions.append(misfit("The circuit does not follow the spectra", max(each), "up to "))
        return JointFit(tuple(arms), capacitance, drifts, errors, each, tuple(cautions))


def amplitude_squared(detuning: Vector, damping: Vector, softer: float, growing: float) -> Vector:
    """Return the share A of the square of the static amplitude in a mode that softens and loses more with amplitude.

    It is the smallest positive A of A [(detuning − softer A)² + damping² (1 + growing A)²] = 1.
    """
    square = damping**2
    linear = 1.0 / (detuning**2 + square)
    if softer == growing == 0.0:
        return linear
    cubic = np.array([
        (softer**2 + square * growing**2) * linear**3,
        2.0 * (square * growing - detuning * softer) * linear**2,
        np.ones_like(detuning),
    ])  # fmt: skip
    companion = np.zeros((len(detuning), 3, 3))
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    # of 1/A, whose equation keeps its degree where the law is linear
    companion[:, :, 2] = cubic.T
    roots = np.linalg.eigvals(companion)
    real = np.where((np.abs(roots.imag) < 1e-7 * np.abs(roots)) & (roots.real > 0.0), roots.real, 0.0)
    return np.asarray(linear / real.max(axis=1))
