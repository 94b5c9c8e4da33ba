# SPDX-License-Identifier: GPL-3.0-or-later
r"""From a measured spectrum to its equivalent circuit (:mod:`pyspice_runner.model.equivalent`).

How it is found, and why that way, says :mod:`pyspice_runner.spectra.identify`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.errors import ParameterError, SpectrumError
from pyspice_runner.export.circuit import CircuitExport
from pyspice_runner.model.equivalent import Characteristics, EquivalentCircuit, MotionalArm
from pyspice_runner.model.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.spectra.identify import (
    COST,
    GLOBALS,
    LEADS,
    LOSSES,
    RESONANT_QUALITY,
    SIGNIFICANT,
    Problem,
    Solution,
    Vector,
    couplings,
    derivatives,
)
from pyspice_runner.spectra.noise import KINDS, Noise, estimate, same_shape
from pyspice_runner.spectra.spectrum import Spectrum
from pyspice_runner.spectra.threads import one_thread
from pyspice_runner.units import engineering

MOST_MODES = 20  # that may be asked for
_ANALYSER = 1e-3  # what impedance analysers are accurate to, at best half of it
_LEAST_ADMITTANCE = 1e-30  # S; below it, and above its inverse, is no device, and squares leave the range of numbers
_FREQUENCIES = 1e-9, 1e12  # Hz; outside is no measurement, and products leave the range of numbers
_DISPERSION = 5e-3  # what a dielectric that is not quite that of the model leaves over at most
_LAST_STEPS = 20  # of the descent with all points, which starts near its end
_LEAST_CAPACITANCE = 1e-3  # clamped over motional capacitance; a strongly coupled ceramic has about 2

_GLOBAL_NAMES = ("clamped_capacitance_f", "loss_tangent", "lead_resistance_ohm", "lead_inductance_h")
_ARM_NAMES = ("resistance_ohm", "inductance_h", "capacitance_f", "series_resonance_hz", "quality_factor")


@dataclass(frozen=True)
class FittedArm:
    """One motional arm of a fit.

    Attributes:
        resistance_ohm: R.
        inductance_h: L.
        capacitance_f: C.
        series_resonance_hz: 1/(2π√(LC)).
        quality_factor: Qm = √(L/C)/R.
        standard_errors: of the five values above, same names and units; ``None`` for a value at the limit of its range.
        in_band: whether the series resonance lies in the measured band.
        characteristics: fs, fp, fm, fn, fr, fa, k_eff and M of the fitted device behind its leads.
    """

    resistance_ohm: float
    inductance_h: float
    capacitance_f: float
    series_resonance_hz: float
    quality_factor: float
    standard_errors: dict[str, float | None]
    in_band: bool
    characteristics: Characteristics


@dataclass(frozen=True)
class Candidate:
    """A number of arms that was tried.

    Attributes:
        arms: number of arms.
        rank: rank of the coupling of their damping.
        leads: whether it has leads.
        criterion: Schwarz's information criterion; the lowest is best.
        rms_relative_error: root mean square of the relative residual's magnitude.
        note: why it is not taken at any criterion: an arm is not determined, follows the background, or is narrower
            than
            the points.
    """

    arms: int
    rank: int
    leads: bool
    criterion: float
    rms_relative_error: float
    note: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class SpectrumFit(Result):
    """An equivalent circuit fitted to a spectrum.

    Attributes:
        source: name of the spectrum.
        format: format that it was read from.
        frequency_hz: measured frequencies, Hz.
        measured_s: measured admittance, S.
        circuit: the equivalent circuit.
        arms: its arms by rising frequency, with standard errors and characteristic frequencies.
        standard_errors: of what is no arm's: ``clamped_capacitance_f``, ``loss_tangent``, ``lead_resistance_ohm``,
            ``lead_inductance_h``; ``None`` for a value at the limit of its range.
        correlation: matrix of the estimates' correlations, in the order of ``correlation_names``.
        correlation_names: dotted paths such as ``arms.0.resistance_ohm``.
        noise: the error model, kind → σ: ``proportional``, ``s11``, ``z`` (:mod:`.noise`).
        candidates: numbers of arms that were tried; of those without a note, the criterion is lowest for the one that
            was taken.
        warnings: what to know before using the values.
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
    warnings: tuple[str, ...] = field(default=())

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
        return float(np.sqrt(np.mean(np.abs(self.residuals) ** 2)))

    @property
    def main_arm(self) -> FittedArm:
        """The arm in the band with the strongest coupling."""
        inside = [arm for arm in self.arms if arm.in_band] or list(self.arms)
        return max(inside, key=lambda arm: arm.capacitance_f)

    @property
    def resonances(self) -> tuple[FittedArm, ...]:
        """The arms that ring in the band, by rising frequency; the others stand for modes beyond it and for losses."""
        return tuple(arm for arm in self.arms if arm.in_band and arm.quality_factor >= RESONANT_QUALITY)

    @property
    def leads(self) -> dict[str, float] | None:
        """Resistance and inductance of the leads; ``None`` if there are none."""
        circuit = self.circuit
        if not (circuit.lead_resistance_ohm or circuit.lead_inductance_h):
            return None
        return {"resistance_ohm": circuit.lead_resistance_ohm, "inductance_h": circuit.lead_inductance_h}

    def to_dict(self) -> dict[str, Any]:
        """Return the fit JSON-ready, SI throughout."""
        main = self.main_arm.characteristics
        return {
            "source": self.source,
            "format": self.format,
            "points": len(self.frequency_hz),
            "start_hz": float(self.frequency_hz[0]),
            "stop_hz": float(self.frequency_hz[-1]),
            "arms": [
                {**_without(asdict(arm), "characteristics"), **asdict(arm.characteristics), "definitions": definitions}
                for arm, definitions in zip(self.arms, self.circuit.definitions(), strict=True)
            ],
            **_without(asdict(self.circuit), "arms"),
            "damping_matrix": self.circuit.damping_matrix,
            "leads": self.leads,
            "noise": self.noise,
            "standard_errors": self.standard_errors,
            "coupling_factor": main.coupling_factor,
            "coupling_pair": main.coupling_pair,
            "rms_relative_error": self.rms_relative_error,
            "candidates": [asdict(candidate) for candidate in self.candidates],
            "correlation": {"names": list(self.correlation_names), "matrix": self.correlation.tolist()},
            "warnings": list(self.warnings),
        }

    def columns(self) -> dict[str, Vector]:
        """Return measured and fitted conductance and susceptance over frequency."""
        fitted = self.admittance(self.frequency_hz)
        return {
            "frequency_hz": self.frequency_hz,
            "conductance_s": self.measured_s.real,
            "susceptance_s": self.measured_s.imag,
            "fitted_conductance_s": fitted.real,
            "fitted_susceptance_s": fitted.imag,
        }

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: also ``.lib``, ``.asy``, ``.kicad_sym``, ``.s1p``, ``.toml``."""
        title = f"fitted to {self.source or 'a spectrum'}"
        return {**super().writers(), **CircuitExport(self.circuit, title, frequency_hz=self.frequency_hz).writers()}

    @property
    def cautions(self) -> tuple[str, ...]:
        """The warnings of the fit."""
        return self.warnings

    def summary(self) -> dict[str, str]:
        """Return source, error, clamped capacitance, and frequency, Qm and R of each arm."""
        found = {
            "source": self.source or "spectrum",
            "arms": str(len(self.arms)),
            "RMS error": f"{100.0 * self.rms_relative_error:.3g} %",
            "clamped capacitance": engineering(self.circuit.clamped_capacitance_f, "F"),
        }
        for number, arm in enumerate(self.arms, start=1):
            found[f"arm {number}"] = (
                f"{engineering(arm.series_resonance_hz, 'Hz')}, Qm {arm.quality_factor:.4g}, "
                f"R {engineering(arm.resistance_ohm, 'Ω')}"
            )
        return found


@checked
@one_thread
def fit_spectrum(
    spectrum: Spectrum,
    modes: int | None = None,
    *,
    leads: bool | tuple[float, float] = True,
    noise: Mapping[str, float] | None = None,
    timeout: float | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SpectrumFit:
    """Fit clamped capacitance with loss, motional arms and leads to a one-port spectrum.

    Args:
        spectrum: as from :func:`read_spectrum`; of a two-port, ``spectrum.driven("A")`` is the one-port.
        modes: number of motional arms; found if it is not given.
        leads: whether leads are looked for; or the known resistance in Ω and inductance in H of the leads.
        noise: the known error of the measurement: σ of ``"proportional"`` (a share of the magnitude), ``"s11"`` (the
            reflection
            coefficient in 50 Ω) or ``"z"`` (Ω), of the complex value; estimated if it is not given.
        timeout: seconds after which the fit ends with an error.
        progress: called with the number of arms that is tried next and the greatest that may be tried.

    Raises:
        ParameterError: for a number of modes, leads, a noise or a timeout out of its range.
        SpectrumError: if the spectrum shows no resonance, has too few points, or the time is over.
    """
    if modes is not None and not 1 <= modes <= MOST_MODES:
        raise ParameterError(f"modes = {modes!r} is not valid: it must be a whole number from 1 to {MOST_MODES}.")
    stated = (0.0, 0.0) if isinstance(leads, bool) else _leads(leads)
    deadline = _deadline(timeout)
    name = spectrum.source or "The spectrum"
    _check(spectrum, name, modes or 1)
    y = spectrum.admittance_s
    model = Noise(checked_noise(noise), stated=True) if noise is not None else estimate(y)
    whole = Problem(spectrum.frequency_hz, y, model, stated, deadline=deadline)
    outcome = _search(whole.thinned(), modes, leads is True, progress)
    if noise is None:  # what the fit leaves over tells the error better than neighbouring points
        problem, best = outcome.problem, outcome.best
        fitted = problem.admittance(best) * problem.unit_s
        white = problem.independent_points(best) > 0.5 * len(problem.w)
        measured = problem.y * problem.unit_s
        better = estimate(fitted, measured - fitted) if white else Noise({"proportional": _share(problem, best)})
        if not same_shape(better, model, fitted):
            smooth = whole.admittance(best) * whole.unit_s
            whole = whole.reweighted(better, smooth)
            outcome = _search(whole.thinned(), modes, leads is True, progress)
        model = better
    problem, best = outcome.problem, outcome.best
    needed = problem.criterion(best, outcome.points) < problem.criterion(outcome.bare, outcome.points)
    if not ((needed or best.cost < 0.5 * outcome.bare.cost) and problem.resonances(best)):
        first, last = spectrum.frequency_hz[[0, -1]]
        if modes is not None and modes > 1 and problem.resonances(problem.fit(1, outcome.bare)):
            raise SpectrumError(
                f"{name} cannot be fitted by {modes} arms: they leave the band, in which one arm finds a resonance; "
                "try fewer modes, or measure more of the spectrum."
            )
        raise SpectrumError(
            f"{name} shows no resonance between {first:g} Hz and {last:g} Hz: "
            f"beside the clamped capacitance and its leads nothing rings with a Q above {RESONANT_QUALITY}."
        )
    whole.far, whole.ridge = problem.far, problem.ridge
    if len(whole.w) > len(problem.w):
        best = whole.descend(best, steps=_LAST_STEPS)
    circuit = _circuit(whole, best)
    if circuit.clamped_capacitance_f < _LEAST_CAPACITANCE * sum(arm.capacitance_f for arm in circuit.arms):
        raise SpectrumError(f"{name} shows a resonance but no clamped capacitance; a piezoelectric resonator has one.")
    return _report(spectrum, whole, best, outcome, model, modes is None)


@dataclass(frozen=True)
class _Outcome:
    """What a search found: the problem with the points that it took, the bare and the best solution."""

    problem: Problem
    bare: Solution
    best: Solution
    points: float  # independent ones
    candidates: tuple[Candidate, ...]
    shifts: Vector  # of the values, see _shifts


def _search(
    problem: Problem, modes: int | None, leads: bool, progress: Callable[[int, int], object] | None
) -> _Outcome:
    """Try numbers of arms, leads and ranks of the coupling, and take the best by the criterion."""
    bare = problem.fit_bare()
    solutions = problem.search(bare, leads, progress, modes)
    points = problem.independent_points(min(solutions, key=COST))
    best = min(solutions, key=lambda solution: problem.criterion(solution, points))
    if best.rank and not problem.settled(best):
        if modes is None:
            solutions += problem.wider(best)
        else:
            problem = problem.reaching(best)
            solutions += problem.polished(best)
    candidates: list[Candidate] = []
    for solution in solutions:
        error = problem.rms_relative_error(solution)
        note = problem.doubts(solution) if modes is None else ""
        fewer = [item.rms_relative_error for item in candidates if item.arms < solution.arms]
        idle = modes is None and len(problem.resonances(solution)) < solution.arms
        if not note and idle and fewer and min(fewer) ** 2 - error**2 < _DISPERSION**2:
            note = "an arm follows the background"
        with_leads, criterion = LEADS[0] not in solution.held, problem.criterion(solution, points)
        candidates.append(Candidate(solution.arms, solution.rank, with_leads, criterion, error, note))
    among = [k for k in range(len(solutions)) if not candidates[k].note] or [
        k for k in range(len(solutions)) if problem.resonances(solutions[k])
    ]
    chosen = min(among or range(len(solutions)), key=lambda k: candidates[k].criterion)
    # of a stated number that cannot follow the spectrum, the best
    most = [(0.0, min(solutions, key=COST))]
    ranked = most if problem.far else problem.simplified(solutions[chosen], points, leads)
    bare = problem.simplified(bare, points, leads=False)[0][1]
    return _Outcome(problem, bare, ranked[0][1], points, tuple(candidates), _shifts(ranked))


def _shifts(ranked: Sequence[tuple[float, Solution]]) -> Vector:
    """Return the values of rivals less those of the best solution, each times the root of the rival's probability.

    The sum of their squares is the variance that the choice among the descriptions adds (Hoeting et al., Statistical
    Science 14, 1999, doi:10.1214/ss/1009212519).
    """
    odds = np.exp(-0.5 * (np.array([score for score, _ in ranked]) - ranked[0][0]))
    probable = [
        (share, solution) for share, (_, solution) in zip(odds / odds.sum(), ranked, strict=True) if share > 1e-9
    ]
    best = _values(ranked[0][1].parameters, ranked[0][1].arms)
    return np.array([np.sqrt(share) * (_values(item.parameters, item.arms) - best) for share, item in probable])


def _share(problem: Problem, solution: Solution) -> float:
    """Return the residuals' root mean square, relative, as far as they are finite."""
    return max(problem.rms_relative_error(solution), 1e-12)


def _leads(leads: tuple[float, float]) -> tuple[float, float]:
    """Check the stated resistance and inductance of the leads."""
    ohm, henry = (float(value) for value in leads)
    if not (0.0 <= ohm <= 1e6 and 0.0 <= henry <= 1.0):
        raise ParameterError(
            f"leads = {leads!r} is not valid: it must be a resistance of 0 to 1e6 Ω and an inductance of 0 to 1 H."
        )
    return ohm, henry


def checked_noise(noise: Mapping[str, float]) -> dict[str, float]:
    """Check a stated noise: kind → σ."""
    if not noise or not noise.keys() <= set(KINDS) or len(noise.keys() - {"proportional"}) > 1:
        raise ParameterError(
            f"noise = {dict(noise)!r} is not valid: it must have proportional, s11 or z, or proportional and one other."
        )
    for kind, sigma in noise.items():
        if not 0.0 < sigma < 1e6:
            raise ParameterError(f"noise: {kind} = {sigma!r} is not valid: it must be a number > 0 and < 1e6.")
    return {kind: float(sigma) for kind, sigma in noise.items()}


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
    if not np.all(np.abs(y) > 0.0):
        zero = spectrum.frequency_hz[np.abs(y) == 0.0][0]
        raise SpectrumError(f"{name} has an admittance of zero at {zero:g} Hz; leave that point out.")
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


def _deadline(timeout: float | None) -> float:
    """Return the time of ``time.monotonic()`` at which a fit must end."""
    if timeout is None:
        return inf
    if not timeout > 0.0:
        raise ParameterError(f"timeout = {timeout!r} is not valid: it must be a number of seconds > 0.")
    return time.monotonic() + timeout


def _report(
    spectrum: Spectrum,
    problem: Problem,
    solution: Solution,
    outcome: _Outcome,
    noise: Noise,
    found: bool,
) -> SpectrumFit:
    """Turn the solution into values with units, standard errors and words."""
    searched = len(outcome.problem.w)
    order = np.argsort(solution.columns[0])
    places = [0, 1, 2, 3, *(4 + 5 * arm + k for arm in order for k in range(5))]
    coupling = couplings(solution.parameters, solution.arms)[[0, *(1 + order)]]
    parameters = [solution.parameters[:GLOBALS], solution.columns.T[order].ravel(), coupling.ravel()]
    solution = replace(solution, parameters=np.concatenate(parameters))
    circuit = _circuit(problem, solution)
    free = problem.free(solution)
    covariance = problem.covariance(solution, free)

    transform = derivatives(lambda parameters: _values(parameters, solution.arms), solution.parameters)
    shifts = outcome.shifts[:, places]
    spread = transform @ covariance @ transform.T + shifts.T @ shifts
    deviation = np.sqrt(np.maximum(np.diag(spread), 0.0))
    # the part of a damping that lies in the coupling is known even where the rest is at its limit
    known = (np.abs(transform) @ ~free) < 1e-2
    known[1] = free[list(LOSSES)].any()

    scale = (circuit.clamped_capacitance_f, 1.0, 1.0 / problem.unit_s, problem.unit_henry)
    standard_errors = {
        name: float(unit * error) if sure else None
        for name, unit, error, sure in zip(_GLOBAL_NAMES, scale, deviation, known, strict=False)
    }
    arms = []
    for index, (arm, characteristics) in enumerate(zip(circuit.arms, circuit.characteristics(), strict=True)):
        rows = slice(len(_GLOBAL_NAMES) + 5 * index, len(_GLOBAL_NAMES) + 5 * index + 5)
        values = {name: float(getattr(arm, name)) for name in _ARM_NAMES}
        errors = {
            name: float(value * error) if sure else None
            for (name, value), error, sure in zip(values.items(), deviation[rows], known[rows], strict=True)
        }
        in_band = bool(spectrum.frequency_hz[0] <= values["series_resonance_hz"] <= spectrum.frequency_hz[-1])
        arms.append(FittedArm(**values, standard_errors=errors, in_band=in_band, characteristics=characteristics))
    names = (*_GLOBAL_NAMES, *(f"arms.{index}.{name}" for index in range(len(arms)) for name in _ARM_NAMES))
    divisor = np.where(deviation > 0.0, deviation, 1.0)
    warnings = [*spectrum.warnings, *_warnings(spectrum, problem, solution, tuple(arms), found)]
    if searched < len(spectrum):
        warnings.append(
            f"The arms were searched with {searched} of {len(spectrum)} points, closest where the admittance changes "
            "most; the values are those of a fit to all points. Fit a part of the band to search it with more points."
        )
    return SpectrumFit(
        source=spectrum.source,
        format=spectrum.format,
        frequency_hz=spectrum.frequency_hz,
        measured_s=spectrum.admittance_s,
        circuit=circuit,
        arms=tuple(arms),
        standard_errors=standard_errors,
        correlation=np.clip(spread / np.outer(divisor, divisor), -1.0, 1.0),
        correlation_names=names,
        noise=dict(noise.sigma),
        candidates=outcome.candidates,
        warnings=tuple(warnings),
    )


def _values(parameters: Vector, arms: int) -> Vector:
    """Return ln C₀, tan δ, R_ℓ, L_ℓ and each arm's ln R, L, C, f, Q, in the problem's units."""
    frequency, reactance, quality = parameters[GLOBALS : GLOBALS + 3 * arms].reshape(-1, 3).T
    quality = -np.log(np.exp(-quality) + (couplings(parameters, arms)[1:] ** 2).sum(axis=1))
    found = [reactance - quality, reactance - frequency, -reactance - frequency, frequency, quality]
    first = [parameters[0], parameters[list(LOSSES)].sum(), *parameters[list(LEADS)]]
    return np.concatenate([first, np.array(found).T.ravel()])


def _circuit(problem: Problem, solution: Solution) -> EquivalentCircuit:
    omega = 2.0 * pi * problem.reference_hz
    coupling = couplings(solution.parameters, solution.arms)
    frequency, reactance, quality = np.exp(solution.columns)
    ohm = reactance / problem.unit_s
    resistance = ohm * (1.0 / quality + (coupling[1:] ** 2).sum(axis=1))
    inductance, capacitance = ohm / (omega * frequency), 1.0 / (ohm * omega * frequency)
    arms = [MotionalArm(*map(float, values)) for values in zip(resistance, inductance, capacitance, strict=True)]
    columns = coupling * np.sqrt(np.append(np.exp(-solution.parameters[0]) / problem.unit_s, ohm))[:, None]
    size, *losses, lead_ohm, lead_henry = solution.parameters[:GLOBALS].tolist()
    return EquivalentCircuit(
        arms=tuple(arms),
        clamped_capacitance_f=float(np.exp(size)) * problem.unit_s / omega,
        loss_tangent=sum(losses),
        loss_reference_hz=problem.reference_hz,
        lead_resistance_ohm=lead_ohm / problem.unit_s,
        lead_inductance_h=lead_henry * problem.unit_henry,
        loss_tangent_falling=losses[0],
        loss_tangent_rising=losses[2],
        shared_losses=tuple(map(tuple, columns.T.tolist())),
    )


def _warnings(
    spectrum: Spectrum, problem: Problem, solution: Solution, arms: tuple[FittedArm, ...], found: bool
) -> list[str]:
    said = []
    for arm in arms:
        where = f"The arm at {arm.series_resonance_hz:.6g} Hz"
        if not arm.in_band:
            said.append(f"{where} lies outside the measured band and stands for modes there; its values are uncertain.")
            continue
        if arm.quality_factor < RESONANT_QUALITY:
            said.append(
                f"{where} is too broad for a resonance (Q {arm.quality_factor:.2g}); it follows the background."
            )
        spacing = np.interp(arm.series_resonance_hz, spectrum.frequency_hz[1:], np.diff(spectrum.frequency_hz))
        if arm.series_resonance_hz / arm.quality_factor < spacing:
            said.append(f"{where} is narrower than the distance of the measured points; measure finer there.")
        error = arm.standard_errors["resistance_ohm"]
        if error is None or error > 0.3 * arm.resistance_ohm:
            said.append(f"{where} is hardly determined: its resistance is uncertain by more than 30 %.")
    share = problem.independent_points(solution) / len(spectrum)
    if share < 0.5 and problem.rms_relative_error(solution) > _ANALYSER:
        said.append(
            f"The circuit does not follow the spectrum to the noise: residuals of "
            f"{100.0 * problem.rms_relative_error(solution):.2g} % remain and are correlated."
        )
    if not found and problem.missing(solution)[0][0] >= 2 * SIGNIFICANT and share < 0.5:
        said.append("The residuals hide at least one more arm; try a greater number of modes.")
    return said


def _without(table: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in table.items() if name != key}
