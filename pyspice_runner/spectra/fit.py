# SPDX-License-Identifier: GPL-3.0-or-later
r"""From a measured spectrum to its equivalent circuit (:mod:`pyspice_runner.model.equivalent`).

How it is found, and why that way, says :mod:`pyspice_runner.spectra.identify`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.errors import ParameterError, SpectrumError
from pyspice_runner.model.equivalent import Characteristics, EquivalentCircuit, MotionalArm
from pyspice_runner.model.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.spectra.export import circuit_writers
from pyspice_runner.spectra.identify import COST, GLOBALS, RESONANT_QUALITY, SIGNIFICANT, Problem, Solution, Vector
from pyspice_runner.spectra.spectrum import Spectrum
from pyspice_runner.spectra.threads import one_thread
from pyspice_runner.units import engineering

MOST_MODES = 20  # that may be asked for
_ANALYSER = 1e-3  # what impedance analysers are accurate to, at best half of it
_LEAST_ADMITTANCE = 1e-30  # S; below it, and above its inverse, is no device, and squares leave the range of numbers
_FREQUENCIES = 1e-9, 1e12  # Hz; outside is no measurement, and products leave the range of numbers
_LAST_STEPS = 20  # of the descent with all points, which starts near its end
_SHARED = "arms share a peak"
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
        criterion: Schwarz's information criterion; the lowest is best.
        rms_relative_error: root mean square of the relative residual's magnitude.
        note: why it is not taken, however low its criterion: two of its arms stand for one peak that is no circle, or
            one rings nowhere in the band and takes out what no analyser measures.
    """

    arms: int
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

    def to_dict(self) -> dict[str, Any]:
        """Return the fit JSON-ready, SI throughout."""
        main = self.main_arm.characteristics
        return {
            "source": self.source,
            "format": self.format,
            "points": len(self.frequency_hz),
            "start_hz": float(self.frequency_hz[0]),
            "stop_hz": float(self.frequency_hz[-1]),
            "arms": [{**_without(asdict(arm), "characteristics"), **asdict(arm.characteristics)} for arm in self.arms],
            **_without(asdict(self.circuit), "arms"),
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
        return {**super().writers(), **circuit_writers(self.circuit, title=title, frequency_hz=self.frequency_hz)}

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
    leads: bool = True,
    timeout: float | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SpectrumFit:
    """Fit clamped capacitance with loss, motional arms and leads to a one-port spectrum.

    Args:
        spectrum: as from :func:`read_spectrum`; of a two-port, ``spectrum.driven("A")`` is the one-port.
        modes: number of motional arms; found if it is not given.
        leads: whether the leads' resistance and inductance are fitted, or zero, as after a compensated measurement.
        timeout: seconds after which the fit ends with an error.
        progress: called with the number of arms that is tried next and the greatest that may be tried.

    Raises:
        ParameterError: for a number of modes or a timeout out of its range.
        SpectrumError: if the spectrum shows no resonance, has too few points, or the time is over.
    """
    if modes is not None and not 1 <= modes <= MOST_MODES:
        raise ParameterError(f"modes = {modes!r} is not valid: it must be a whole number from 1 to {MOST_MODES}.")
    deadline = _deadline(timeout)
    name = spectrum.source or "The spectrum"
    _check(spectrum, name, modes or 1)
    whole = Problem(spectrum.frequency_hz, spectrum.admittance_s, leads, deadline=deadline)
    problem = whole.thinned()
    bare = problem.fit_bare()
    solutions = problem.search(bare, progress) if modes is None else [problem.fit_exactly(modes, bare)]
    independent = problem.independent_points(min(solutions, key=COST))
    criteria = [problem.criterion(solution, independent) for solution in (bare, *solutions)]
    candidates = _candidates(problem, solutions, criteria[1:])
    chosen = _choose(candidates, range(len(solutions)))
    if not problem.resonances(solutions[chosen]) and problem.resonances(
        solutions[0] if modes is None else problem.fit(1, bare)
    ):
        # arms have left the band, as they do where it ends amid a resonance; one arm finds what rings
        ringing = [k for k, solution in enumerate(solutions) if problem.resonances(solution)]
        if not ringing:
            raise SpectrumError(
                f"{name} cannot be fitted by {modes} arms: they leave the band, in which one arm finds a resonance; "
                "try fewer modes, or measure more of the spectrum."
            )
        chosen = _choose(candidates, ringing)
    best = solutions[chosen]
    needed = candidates[chosen].criterion < criteria[0] or best.cost < 0.5 * bare.cost
    if not (needed and problem.resonances(best)):
        first, last = spectrum.frequency_hz[[0, -1]]
        raise SpectrumError(
            f"{name} shows no resonance between {first:g} Hz and {last:g} Hz: "
            f"beside the clamped capacitance and its leads nothing rings with a Q above {RESONANT_QUALITY}."
        )
    if whole is not problem:
        best = whole.descend(best.parameters, steps=_LAST_STEPS)
    circuit = _circuit(whole, best.parameters)
    if circuit.clamped_capacitance_f < _LEAST_CAPACITANCE * sum(arm.capacitance_f for arm in circuit.arms):
        raise SpectrumError(f"{name} shows a resonance but no clamped capacitance; a piezoelectric resonator has one.")
    return _report(spectrum, whole, len(problem.w), best, candidates)


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


def _choose(candidates: Sequence[Candidate], among: Sequence[int]) -> int:
    """Return the candidate with the lowest criterion, of those without a note if there are any."""
    return min([k for k in among if not candidates[k].note] or among, key=lambda k: candidates[k].criterion)


def _candidates(problem: Problem, solutions: Sequence[Solution], criteria: Sequence[float]) -> tuple[Candidate, ...]:
    found = list[Candidate]()
    for solution, criterion in zip(solutions, criteria, strict=True):
        note = ""
        if problem.overlap(solution) > 1.0:
            note = _SHARED
        elif found and found[-1].rms_relative_error < _ANALYSER and len(problem.resonances(solution)) < solution.arms:
            note = "an arm follows the background"
        found.append(Candidate(solution.arms, criterion, problem.rms_relative_error(solution), note))
    return tuple(found)


def _report(
    spectrum: Spectrum, problem: Problem, searched: int, solution: Solution, candidates: tuple[Candidate, ...]
) -> SpectrumFit:
    """Turn the solution into values with units, standard errors and words."""
    arms_by_frequency = solution.parameters[GLOBALS:].reshape(-1, 3)
    arms_by_frequency = arms_by_frequency[np.argsort(arms_by_frequency[:, 0])]
    solution = Solution(np.concatenate([solution.parameters[:GLOBALS], arms_by_frequency.ravel()]), solution.cost)
    circuit = _circuit(problem, solution.parameters)
    free = problem.free(solution)
    covariance = problem.covariance(solution, free)

    transform = _to_values(problem, solution)
    spread = transform @ covariance @ transform.T
    deviation = np.sqrt(np.maximum(np.diag(spread), 0.0))
    known = (np.abs(transform) @ ~free) == 0.0

    scale = (circuit.clamped_capacitance_f, 1.0, 1.0 / problem.unit_s, problem.unit_henry)
    standard_errors = {
        name: float(unit * error) if sure else None
        for name, unit, error, sure in zip(_GLOBAL_NAMES, scale, deviation, known, strict=False)
    }
    arms = []
    for index, (arm, characteristics) in enumerate(zip(circuit.arms, circuit.characteristics(), strict=True)):
        rows = slice(GLOBALS + 5 * index, GLOBALS + 5 * index + 5)
        values = {name: float(getattr(arm, name)) for name in _ARM_NAMES}
        errors = {
            name: float(value * error) if sure else None
            for (name, value), error, sure in zip(values.items(), deviation[rows], known[rows], strict=True)
        }
        in_band = bool(spectrum.frequency_hz[0] <= arm.series_resonance_hz <= spectrum.frequency_hz[-1])
        arms.append(FittedArm(**values, standard_errors=errors, in_band=in_band, characteristics=characteristics))
    names = (*_GLOBAL_NAMES, *(f"arms.{index}.{name}" for index in range(len(arms)) for name in _ARM_NAMES))
    divisor = np.where(deviation > 0.0, deviation, 1.0)
    warnings = [*spectrum.warnings, *_warnings(spectrum, problem, solution, tuple(arms), candidates)]
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
        candidates=candidates,
        warnings=tuple(warnings),
    )


def _to_values(problem: Problem, solution: Solution) -> Vector:
    """Return the derivatives of ln C₀, tan δ, R_ℓ, L_ℓ and each arm's ln R, L, C, f, Q by the parameters."""
    arm = np.array([[0, 1, -1], [-1, 1, 0], [-1, -1, 0], [1, 0, 0], [0, 0, 1]], dtype=float)
    transform = np.zeros((GLOBALS + 5 * solution.arms, len(solution.parameters)))
    transform[:3, :3] = np.eye(3)
    transform[3, 3] = float(np.exp(-solution.parameters[0])) / problem.w[-1] ** 2
    transform[3, 0] = -problem.lead_inductance(solution.parameters)
    for index in range(solution.arms):
        rows, columns = GLOBALS + 5 * index, GLOBALS + 3 * index
        transform[rows : rows + 5, columns : columns + 3] = arm
    return transform


def _circuit(problem: Problem, parameters: Vector) -> EquivalentCircuit:
    omega = 2.0 * pi * problem.reference_hz
    arms = []
    for frequency, reactance, quality in np.exp(parameters[GLOBALS:]).reshape(-1, 3).tolist():
        ohm = reactance / problem.unit_s
        arms.append(MotionalArm(ohm / quality, ohm / (omega * frequency), 1.0 / (ohm * omega * frequency)))
    return EquivalentCircuit(
        arms=tuple(arms),
        clamped_capacitance_f=float(np.exp(parameters[0])) * problem.unit_s / omega,
        loss_tangent=float(parameters[1]),
        loss_reference_hz=problem.reference_hz,
        lead_resistance_ohm=float(parameters[2]) / problem.unit_s,
        lead_inductance_h=problem.lead_inductance(parameters) * problem.unit_henry,
    )


def _warnings(
    spectrum: Spectrum,
    problem: Problem,
    solution: Solution,
    arms: tuple[FittedArm, ...],
    candidates: tuple[Candidate, ...],
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
    if problem.overlap(solution) > 1.0:
        said.append(
            "Two arms are closer than their bandwidths: they share one peak, which is no circle, and only their sum is "
            "meant; try a smaller number of modes."
        )
    share = problem.independent_points(solution) / len(spectrum)
    if share < 0.5 and problem.rms_relative_error(solution) > _ANALYSER:
        said.append(
            f"The circuit does not follow the spectrum to the noise: residuals of "
            f"{100.0 * problem.rms_relative_error(solution):.2g} % remain and are correlated."
        )
    closest = min(candidates, key=lambda candidate: candidate.rms_relative_error)
    if closest.note == _SHARED and closest.arms > solution.arms and problem.rms_relative_error(solution) > _ANALYSER:
        said.append(
            f"{closest.arms} arms leave {100.0 * closest.rms_relative_error:.2g} %, but some of them share one peak; "
            f"where only the curve matters, ask for modes = {closest.arms}."
        )
    if len(candidates) == 1 and problem.missing(solution)[0][0] >= 2 * SIGNIFICANT and share < 0.5:
        said.append("The residuals hide at least one more arm; try a greater number of modes.")
    return said


def _without(table: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in table.items() if name != key}
