# SPDX-License-Identifier: GPL-3.0-or-later
"""The equivalent circuit (:mod:`pyspice_runner.motor.equivalent`) of a spectrum of one port.

:mod:`pyspice_runner.impedance.identify` describes the method.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from math import inf, log
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.errors import SpectrumError, require
from pyspice_runner.export.circuit import CircuitExport
from pyspice_runner.impedance.identify import errors
from pyspice_runner.impedance.identify.arms import GLOBALS, Solution
from pyspice_runner.impedance.identify.descent import Vector, rms
from pyspice_runner.impedance.identify.problem import PLAUSIBLE_LEADS, Problem
from pyspice_runner.impedance.identify.selection import (
    LEADS_AT_LIMIT,
    Candidate,
    Outcome,
    Progress,
    fit_arms,
    missing,
    select,
)
from pyspice_runner.impedance.noise import REFERENCE_OHM, Noise, noise_of, same_shape
from pyspice_runner.impedance.readers.touchstone import FORMAT as TOUCHSTONE
from pyspice_runner.impedance.spectrum import HalfPower, Spectrum, band_of, half_power
from pyspice_runner.motor.equivalent import Characteristics, EquivalentCircuit, MotionalArm
from pyspice_runner.motor.numerics import one_thread_of_scipy
from pyspice_runner.result import Result
from pyspice_runner.units import engineering, unit_in

_LEAST_LINE = 0.01  # capacitance of a cable over the clamped capacitance, which the best calibrations leave
# within 1 % of its maximum a peak turns by 16°, a maximally flat pair of resonances by 62°
_LEVEL, _TURN = 0.01, np.radians(75.0)
MOST_MODES = 20  # that may be given
_ANALYSER = 1e-3  # twice the accuracy of the best impedance analysers
_UNDECIDED = (
    "The data do not distinguish some descriptions of loss and leads. The errors contain the spread of the values by "
    "these. Specify the leads, or measure a wider band."
)
SKEWED = "is skewed by the amplitude within the sweep"
POOR_FIT = "The circuit does not follow the spectrum"
_DOMINANT = 0.8  # of a standard error by the choice among descriptions: two thirds of the variance
_LEAST_ADMITTANCE = 1e-30  # S; no device lies below it or above its inverse, and squares leave the range of numbers
_FREQUENCIES = 1e-9, 1e12  # Hz; outside there are no measurements, and products leave the range of numbers
_MOVED = 2.0  # ratio of two definitions of Q, assumed; a single arm has about 1
_LAST_STEPS = 20  # of the descent with all points, which starts near its end
_LEAST_CAPACITANCE = 1e-3  # clamped over motional capacitance; a strongly coupled ceramic has about 2


@dataclass(frozen=True)
class FittedArm(MotionalArm):
    """One motional arm of a fit."""

    # of R, L, C, series resonance and Qm, by their names; ``None`` for a value at the limit of its range.
    standard_errors: dict[str, float | None]
    in_band: bool  # whether the series resonance lies in the measured band
    characteristics: Characteristics  # fs, fp, fm, fn, fr, fa, k_eff and M of the fitted device behind its leads
    half_power: HalfPower | None  # of the measured points less the leads; ``None`` where they do not show the peak


_LABELS = {
    "series_resonance_hz": "f", "quality_factor": "Q", "resistance_ohm": "R", "inductance_h": "L", "capacitance_f": "C",
}  # fmt: skip
_LOSS_PARTS = {
    "falling": "falls with frequency", "causal": "constant", "flat": "constant without dispersion",
    "rising": "rises with frequency",
}  # fmt: skip
_OF_NOISE = {"proportional": "{:.2g} of Y", "s11": "{:.2g} of S11", "z": "{:.2g} Ω of Z"}
_AT_LIMIT = " (limit of its range)"
_LEAST_LOSS = 1e-9  # a smaller part is round-off
_STANDARD_LABELS = {"resistance_ohm": "R1", "inductance_h": "L1", "capacitance_f": "C1", "quality_factor": "Q"}


class Fit(Result):
    """A circuit fitted to spectra: a dataclass of values with standard errors, and cautions about their limits."""

    def to_dict(self) -> dict[str, Any]:
        """Return the fit JSON-ready."""
        document = self._entries(*(item.name for item in fields(self)))  # type: ignore[arg-type]
        document["warnings"] = document.pop("cautions")
        return document


@dataclass(frozen=True, eq=False, repr=False)
class SpectrumFit(Fit):
    """An equivalent circuit fitted to a spectrum.

    Attributes:
        source: name of the spectrum.
        format: format of its file.
        frequency_hz: measured frequencies, Hz.
        measured_s: measured admittance, S.
        circuit: the equivalent circuit.
        arms: its arms by rising frequency, with standard errors and characteristic frequencies.
        standard_errors: of ``clamped_capacitance_f``, ``loss_tangent``, ``lead_resistance_ohm``,
            ``lead_inductance_h``; ``None`` for a value at the limit of its range.
        correlation: matrix of the estimates' correlations, in the order of ``correlation_names``.
        correlation_names: dotted paths such as ``arms.0.resistance_ohm``.
        noise: the error model, kind → σ: ``proportional``, ``s11``, ``z`` (:mod:`.noise`).
        candidates: numbers of arms that were tried; the selected one has the lowest criterion of those without a note.
        cautions: limits of the values.
    """

    source: str
    format: str
    frequency_hz: Vector
    measured_s: NDArray[np.complex128]
    circuit: EquivalentCircuit
    arms: tuple[FittedArm, ...]
    standard_errors: dict[str, float | None]
    correlation: Vector
    correlation_names: tuple[str, ...]
    noise: dict[str, float]
    candidates: tuple[Candidate, ...]
    cautions: tuple[str, ...] = ()

    def admittance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the fitted admittance in S."""
        return self.circuit.admittance(frequency_hz)

    @property
    def residuals(self) -> NDArray[np.complex128]:
        """Relative residual, fitted over measured admittance less one."""
        return self.admittance(self.frequency_hz) / self.measured_s - 1.0

    @property
    def rms_relative_error(self) -> float:
        """Root mean square of the relative residual's magnitude."""
        return rms(self.residuals)

    @property
    def main_arm(self) -> FittedArm:
        """The arm in the band with the strongest coupling."""
        inside = [arm for arm in self.arms if arm.in_band] or list(self.arms)
        return max(inside, key=lambda arm: arm.capacitance_f)

    @property
    def resonances(self) -> tuple[FittedArm, ...]:
        """The arms that resonate in the band, by rising frequency; the others represent modes outside and losses."""
        return tuple(arm for arm in self.arms if arm.in_band and arm.quality_factor >= errors.RESONANT_QUALITY)

    @property
    def leads(self) -> dict[str, float] | None:
        """Resistance and inductance of the leads; ``None`` without leads."""
        names = ("resistance_ohm", "inductance_h")
        found = {name: getattr(self.circuit, f"lead_{name}") for name in names}
        return found if any(found.values()) else None

    def to_dict(self) -> dict[str, Any]:
        """Return the fit JSON-ready, SI throughout."""
        main = self.main_arm.characteristics
        arms = []
        for arm, definitions in zip(self.arms, self.circuit.definitions(), strict=True):
            entry = {name: getattr(arm, name) for name in errors.ARM_NAMES} | asdict(arm)
            arms.append(entry | entry.pop("characteristics") | {"definitions": definitions})
        circuit = asdict(self.circuit)
        del circuit["arms"]
        return {
            **self._entries("source", "format"),
            **band_of(self.frequency_hz),
            "arms": arms,
            **circuit,
            "damping_matrix": self.circuit.damping_matrix,
            **self._entries("leads", "noise", "standard_errors"),
            "coupling_factor": main.coupling_factor,
            "coupling_pair": main.coupling_pair,
            **self._entries("rms_relative_error", "candidates"),
            "correlation": {"names": list(self.correlation_names), "matrix": self.correlation.tolist()},
            "errors_conditional": self.errors_conditional,
            "warnings": list(self.cautions),
        }

    @property
    def errors_conditional(self) -> bool:
        """Whether the standard errors hold only if the circuit is the device.

        They contain the choice among descriptions of loss and leads, but not what no circuit of this kind describes:
        where residuals remain that are not noise, or an arm stands for modes outside the band.
        """
        follows = not any(caution.startswith(POOR_FIT) for caution in self.cautions)
        return not follows or not all(arm.in_band for arm in self.arms)

    def columns(self) -> dict[str, Vector]:
        """Return measured and fitted conductance and susceptance over frequency."""
        curves = {"": self.measured_s, "fitted_": self.admittance(self.frequency_hz)}
        found = {"frequency_hz": self.frequency_hz}
        for name, y in curves.items():
            found |= {f"{name}conductance_s": y.real, f"{name}susceptance_s": y.imag}
        return found

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: also ``.lib``, ``.asy``, ``.kicad_sym``, ``.s1p``, ``.toml``."""
        title = f"fitted to {self.source or 'a spectrum'}"
        return {**super().writers(), **CircuitExport(self.circuit, title, frequency_hz=self.frequency_hz).writers()}

    def summary(self) -> dict[str, str]:
        """Return source, errors, the circuit's values ± one standard error, and the numbers of arms tried."""
        circuit, loss = self.circuit, self.standard_errors["loss_tangent"]
        parts = [text for name, text in _LOSS_PARTS.items() if getattr(circuit, f"loss_tangent_{name}") > _LEAST_LOSS]
        leads = (engineering(value, unit_in(name)) for name, value in (self.leads or {}).items())
        found = {
            "source": self.source or "spectrum",
            "arms": str(len(self.arms)),
            "RMS error": f"{100.0 * self.rms_relative_error:.3g} %",
            "clamped capacitance": _shown(circuit, "clamped_capacitance_f", self.standard_errors),
            "loss tangent": f"{circuit.loss_tangent:.3g}{_AT_LIMIT if loss is None else f' ±{loss:.2g}'} at "
            f"{engineering(circuit.loss_reference_hz, 'Hz')}{', ' if parts else ''}{' and '.join(parts)}",
            "leads": " and ".join(leads) or "none",
            "error model": ", ".join(f"{_OF_NOISE[kind].format(sigma)}" for kind, sigma in self.noise.items()),
        }
        if self.errors_conditional:
            found["standard errors"] = "conditional: they do not contain what this circuit leaves out"
        if circuit.shared_losses:
            found["shared resistances"] = str(len(circuit.shared_losses))
        for number, arm in enumerate(self.arms, start=1):
            values = ", ".join(f"{label} {_shown(arm, name, arm.standard_errors)}" for name, label in _LABELS.items())
            factor, merit = arm.characteristics.coupling_factor, arm.characteristics.figure_of_merit
            found[f"arm {number}"] = f"{values}, k_eff {factor:.3f}, figure of merit M {merit:.3g}"
        definitions = circuit.definitions()[self.arms.index(self.main_arm)]
        by_width = definitions["half power"] or {}
        for definition, main in definitions.items():
            if main is not None:
                values = ", ".join(
                    f"{label} {engineering(main[name], unit_in(name).strip('1')).rstrip()}"
                    for name, label in _STANDARD_LABELS.items()
                )
                quality = main["quality_factor"]
                moved = abs(log(quality / by_width.get("quality_factor", quality))) > log(_MOVED)
                found[f"main arm by {definition}"] = values + ": disturbed by neighbouring arms" * moved
        points = self.main_arm.half_power
        if points is not None:
            found["main arm by its measured points, half power"] = (
                f"f {engineering(points.resonance_hz, 'Hz')}, R1 {engineering(points.resistance_ohm, 'Ω')}, "
                f"Q {points.quality_factor:.4g}"
            )
        tried = (
            f"{item.arms}{' coupled' if item.rank else ''}{' with leads' if item.leads else ''} "
            f"({item.criterion:.0f}, {100.0 * item.rms_relative_error:.2g} %{', ' if item.note else ''}{item.note})"
            for item in self.candidates
        )
        return found | {"arms tried (information criterion, RMS error)": ", ".join(tried)}


def _shown(item: object, name: str, deviations: Mapping[str, float | None]) -> str:
    """Return an attribute with its unit, ± its standard error in percent."""
    value, error = getattr(item, name), deviations[name]
    share = _AT_LIMIT if error is None else f" ±{100.0 * error / value:.2g}%"
    return f"{engineering(value, unit_in(name).strip('1'))}{share}"


@one_thread_of_scipy()
def fit_one_port(
    spectrum: Spectrum,
    modes: int | None = None,
    *,
    leads: bool | tuple[float, float] = True,
    noise: Mapping[str, float] | None = None,
    timeout: float | None = None,
    progress: Progress | None = None,
) -> SpectrumFit:
    """Fit clamped capacitance with loss, motional arms and leads; see :func:`~.fit.fit_spectrum`."""
    require(modes is None or 1 <= modes <= MOST_MODES, "modes", modes, f"a whole number from 1 to {MOST_MODES}")
    require(timeout is None or timeout > 0.0, "timeout", timeout, "a number of seconds > 0")
    deadline = inf if timeout is None else time.monotonic() + timeout
    ohm, henry = (0.0, 0.0) if isinstance(leads, bool) else map(float, leads)
    plausible = 0.0 <= ohm <= 1e6 and 0.0 <= henry <= 1.0
    require(plausible, "leads", leads, "a resistance of 0 to 1e6 Ω and an inductance of 0 to 1 H")
    name = spectrum.source or "The spectrum"
    _check(spectrum, name, modes or 1)
    noise_model = noise_of(noise, spectrum.admittance_s)
    whole = Problem(spectrum.frequency_hz, spectrum.admittance_s, noise_model, (ohm, henry), deadline=deadline)
    whole, noise_model, outcome = _searched(whole, modes, leads is True, progress)
    problem, best = outcome.problem, outcome.best
    if not outcome.finds_resonance():
        first, last = spectrum.frequency_hz[[0, -1]]
        if modes is not None and modes > 1 and errors.resonances(problem, fit_arms(problem, 1, outcome.bare)):
            raise SpectrumError(
                f"{name} cannot be fitted by {modes} arms: they leave the band, in which one arm finds a resonance; "
                "try fewer modes, or measure more of the spectrum."
            )
        raise SpectrumError(
            f"{name} shows no resonance between {first:g} Hz and {last:g} Hz: "
            f"beside the clamped capacitance and its leads nothing rings with a Q above {errors.RESONANT_QUALITY} at "
            "more than one point."
        )
    whole.far, whole.ridge = problem.far, problem.ridge
    if len(whole.w) > len(problem.w):
        best = whole.descend(best, steps=_LAST_STEPS)
    solution, circuit, global_errors, arm_errors, correlation = errors.estimates(whole, best, outcome.shifts)
    if circuit.clamped_capacitance_f < _LEAST_CAPACITANCE * sum(arm.capacitance_f for arm in circuit.arms):
        raise SpectrumError(f"{name} shows a resonance but no clamped capacitance; a piezoelectric resonator has one.")
    low, high = spectrum.frequency_hz[[0, -1]].tolist()
    leads_ohm = circuit.lead_resistance_ohm + 2j * np.pi * spectrum.frequency_hz * circuit.lead_inductance_h
    device = np.asarray(1.0 / (spectrum.impedance_ohm - leads_ohm), dtype=complex)
    arms = tuple(
        FittedArm(
            **asdict(arm),
            standard_errors=deviations,
            in_band=low <= arm.series_resonance_hz <= high,
            characteristics=characteristics,
            half_power=half_power(spectrum.frequency_hz, device, arm.series_resonance_hz, arm.quality_factor),
        )
        for arm, deviations, characteristics in zip(circuit.arms, arm_errors, circuit.characteristics(), strict=True)
    )
    cautions = [*spectrum.cautions, *_clipped(spectrum), *_uncertain_arms(spectrum, arms)]
    cautions += _misfits(whole, solution, arms, modes)
    if leads is True:
        cautions += _leads(circuit, outcome, spectrum.format == TOUCHSTONE or "s11" in noise_model.sigma)
    if _undecided(outcome.shifts, np.argsort(best.columns[0]), arms):
        cautions.append(_UNDECIDED)
    if len(problem.w) < len(spectrum):
        cautions.append(
            f"The arms were searched with {len(problem.w)} of {len(spectrum)} points, closest where the admittance "
            "changes most; the values are those of a fit to all points. Fit a part of the band to search it with more "
            "points."
        )
    return SpectrumFit(
        source=spectrum.source,
        format=spectrum.format,
        frequency_hz=spectrum.frequency_hz,
        measured_s=spectrum.admittance_s,
        circuit=circuit,
        arms=arms,
        standard_errors=global_errors,
        correlation=correlation,
        correlation_names=(
            *errors.GLOBAL_NAMES,
            *(f"arms.{k}.{name}" for k in range(len(arms)) for name in errors.ARM_NAMES),
        ),
        noise=dict(noise_model.sigma),
        candidates=outcome.candidates,
        cautions=tuple(cautions),
    )


def _searched(
    whole: Problem, modes: int | None, leads: bool, progress: Progress | None
) -> tuple[Problem, Noise, Outcome]:
    """Select the circuit; return the problem with the weights of the selection, the final error model, the outcome."""
    outcome = select(whole.thinned(), modes, leads, progress)
    if whole.noise.stated:
        return whole, whole.noise, outcome
    # the residuals of the fit give a better estimate of the errors than neighbouring points
    problem, best = outcome.problem, outcome.best
    fitted, measured = problem.admittance(best) * problem.unit_s, problem.y * problem.unit_s
    white = errors.independent(problem, best) > 0.5 * len(problem.w)
    better = whole.noise.refined(fitted, measured - fitted, white, measured)
    if not same_shape(better, whole.noise, fitted):
        whole = whole.reweighted(better, whole.admittance(best) * whole.unit_s)
        outcome = select(whole.thinned(), modes, leads, progress)
    return whole, better, outcome


def _check(spectrum: Spectrum, name: str, modes: int) -> None:
    """Check that a spectrum has the points and values that a fit needs."""
    y = spectrum.admittance_s
    lowest, highest = _FREQUENCIES
    for place in spectrum.frequency_hz[[0, -1]].tolist():
        if not lowest <= place <= highest:
            raise SpectrumError(
                f"{name} has a frequency of {place:g} Hz; it must be from {lowest:g} Hz to {highest:g} Hz. "
                "Check its unit."
            )
    beyond = (np.abs(y) < _LEAST_ADMITTANCE) | (np.abs(y) > 1.0 / _LEAST_ADMITTANCE)
    if beyond.any():
        value, place = np.abs(y)[beyond][0], spectrum.frequency_hz[beyond][0]
        raise SpectrumError(f"{name} has an admittance of {value:.3g} S at {place:g} Hz; leave that point out.")
    if 2 * len(y) < GLOBALS + 3 * modes + 1:
        raise SpectrumError(
            f"{name} has {len(y)} points, too few for {modes} arms; measure at least {(GLOBALS + 3 * modes) // 2 + 1}."
        )
    if not np.any(y.imag > 0.0):
        raise SpectrumError(
            f"{name} is not capacitive at any frequency: it has no clamped capacitance and no piezoelectric resonance."
        )


def _clipped(spectrum: Spectrum) -> Iterator[str]:
    """Yield a caution where |Y| or |Z| stays at its maximum while the phase turns: no resonance does that."""
    y = spectrum.admittance_s
    for name, size in (("|Y|", np.abs(y)), ("|Z|", 1.0 / np.abs(y))):
        top = int(np.argmax(size))
        below = np.flatnonzero(size < (1.0 - _LEVEL) * size[top])
        first = int(below[below < top].max(initial=-1)) + 1
        last = int(below[below > top].min(initial=len(y))) - 1
        turned = np.unwrap(np.angle(y[first : last + 1]))
        if np.ptp(turned) > _TURN:
            low, high = (engineering(float(spectrum.frequency_hz[place]), "Hz") for place in (first, last))
            yield (
                f"{name} is the same within {100.0 * _LEVEL:g} % from {low} to {high} while its phase turns by "
                f"{np.degrees(np.ptp(turned)):.0f}°: the peak is clipped, and its arm is wrong. Measure with a larger "
                "range or a lower level."
            )


def _uncertain_arms(spectrum: Spectrum, arms: tuple[FittedArm, ...]) -> Iterator[str]:
    """Yield a caution for each arm whose values are uncertain."""
    for arm in arms:
        where = f"The arm at {arm.series_resonance_hz:.6g} Hz"
        if not arm.in_band:
            yield f"{where} lies outside the measured band and stands for modes there; its values are uncertain."
            continue
        if arm.quality_factor < errors.RESONANT_QUALITY:
            yield f"{where} is too broad for a resonance (Q {arm.quality_factor:.2g}); it follows the background."
        spacing = np.interp(arm.series_resonance_hz, spectrum.frequency_hz[1:], np.diff(spectrum.frequency_hz))
        if arm.series_resonance_hz / arm.quality_factor < spacing:
            yield f"{where} is narrower than the distance of the measured points; measure finer there."
        uncertainty = arm.standard_errors["resistance_ohm"]
        if uncertainty is None or uncertainty > 0.3 * arm.resistance_ohm:
            yield f"{where} is hardly determined: its resistance is uncertain by more than 30 %."


def _leads(circuit: EquivalentCircuit, outcome: Outcome, reflected: bool) -> Iterator[str]:
    """Yield cautions for leads at their limits, and for leads of a reflection that may be a cable."""
    if any(item.note == LEADS_AT_LIMIT for item in outcome.candidates):
        ohm, henry = map(engineering, PLAUSIBLE_LEADS, ("Ω", "H"))
        yield (
            f"The fit is better with leads at their limits of {ohm} and {henry}, which are no leads of a fixture: they "
            "are left out. Specify the leads, or what is in series with the device."
        )
    delay = circuit.lead_inductance_h / REFERENCE_OHM
    capacitance = delay / REFERENCE_OHM
    if reflected and capacitance > _LEAST_LINE * circuit.clamped_capacitance_f:
        yield (
            f"The leads have the inductance of a {REFERENCE_OHM:g} Ω cable of {engineering(delay, 's')}; "
            f"its {engineering(capacitance, 'F')} would be part of the clamped capacitance. If there is a cable "
            "between the calibrated port and the device, specify its delay (fit --port-extension)."
        )


def _misfits(problem: Problem, solution: Solution, arms: tuple[FittedArm, ...], modes: int | None) -> Iterator[str]:
    """Yield cautions for residuals that are not noise; ``modes`` is the given number of arms."""
    if errors.independent(problem, solution) < 0.5 * len(problem.w):
        if (error := problem.rms_relative_error(solution)) > _ANALYSER:
            yield misfit(POOR_FIT, error)
        if modes is not None and missing(problem, solution)[0][0] >= 2 * errors.SIGNIFICANT:
            yield "The residuals hide at least one more arm; try a greater number of modes."
    for place in errors.skewed_arms(problem, solution):
        yield (
            f"The resonance at {arms[place].series_resonance_hz:.6g} Hz {SKEWED}: its values hold at no level. Repeat "
            "at a lower level, or specify the level by voltages (fit --voltages) for its softening and its growth of "
            "losses."
        )


def _undecided(shifts: Vector, order: NDArray[np.intp], arms: tuple[FittedArm, ...]) -> bool:
    """Whether the choice among descriptions of loss and leads, by its ``shifts``, makes most of an arm's error.

    The ``order`` of the arms is that by rising frequency.
    """
    by_choice = np.linalg.norm(shifts, axis=0)[len(errors.GLOBAL_NAMES) :].reshape(len(arms), -1)[order]
    shares = by_choice[:, errors.ARM_NAMES.index("inductance_h")]
    return any(
        share > _ANALYSER and share * arm.inductance_h > _DOMINANT * arm.standard_errors["inductance_h"]
        for arm, share in zip(arms, shares, strict=True)
        if arm.standard_errors["inductance_h"] is not None
    )


def misfit(what: str, error: float, limit: str = "") -> str:
    """Return the caution for correlated residuals."""
    return f"{what} to the noise: residuals of {limit}{100.0 * error:.2g} % remain and are correlated."
