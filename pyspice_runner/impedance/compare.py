# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparison of measured spectra with a motor or another spectrum, mode by mode.

Both are fitted (:mod:`.fit`); modes with the closest frequencies and motional capacitances are paired. A deviation is
the measured over the reference value less one. A mode is judged by its frequency, its quality factor and its coupling
θ/√m = 1/√L of the motional arm, which belong to it alone; a coupling factor and a motional capacitance in proportion to
C0 do not. With a motor as the reference, :mod:`.causes` names the cause, from both groups if the spectrum has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import hypot, inf, isfinite, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError, SpectrumError
from pyspice_runner.files import write_rows
from pyspice_runner.impedance.admittance import admittance
from pyspice_runner.impedance.causes import Diagnosis, Judge, Observed
from pyspice_runner.impedance.identify.descent import rms
from pyspice_runner.impedance.one_port_fit import SKEWED, FittedArm, SpectrumFit, fit_one_port
from pyspice_runner.impedance.spectrum import Connection, Spectrum, State
from pyspice_runner.impedance.two_port_fit import fit_groups
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Result
from pyspice_runner.units import engineering

if TYPE_CHECKING:
    import pandas

_VALUES: dict[str, tuple[str, Callable[[FittedArm], float]]] = {  # quantity of a mode → its column, and of an arm
    "frequency": ("frequency_hz", lambda arm: arm.series_resonance_hz),
    "quality_factor": ("quality_factor", lambda arm: arm.quality_factor),
    "coupling_factor": ("coupling_factor", lambda arm: arm.characteristics.coupling_factor),
    "resistance": ("resistance_ohm", lambda arm: arm.resistance_ohm),
    "coupling": ("coupling_n_per_v_kg05", lambda arm: arm.inductance_h**-0.5),
}
_IN_FULL = 6  # spectra whose modes a summary shows
_MODEL_POINTS = 2000
_TEXTS = "spectrum", "mode_name", "passed", "cause"  # columns of a table


@dataclass(frozen=True)
class ModeDeviation:
    """One mode of the reference and its measured values."""

    mode: int  # number of the mode in the reference, from 1
    # frequency (Hz), quality factor, coupling factor, resistance (Ω), coupling (θ/√m, N/(V·√kg)) of the reference
    reference: dict[str, float]
    measured: dict[str, float] | None  # the same as measured; ``None`` if the mode is missing
    standard_errors: dict[str, float | None]  # of ``measured``; ``None`` if not determined
    deviations: dict[str, float]  # measured over reference less one
    deviation_errors: dict[str, float | None]  # their standard errors, from both fits; ``None`` if not determined
    name: str = ""  # name of the mode in a motor

    @property
    def label(self) -> str:
        """The mode in words."""
        return self.name or f"mode {self.mode}"


class _Tabulated(Result):
    """A result with a table of texts."""

    def rows(self) -> list[list[str]]:
        """Return the table: a header, then the rows."""
        raise NotImplementedError

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: ``.json`` and ``.csv`` (:meth:`rows`)."""
        return {**super().writers(), ".csv": lambda file: write_rows(file, self.rows())}

    def to_dataframe(self) -> pandas.DataFrame:
        """Return :meth:`rows` as a pandas table."""
        import pandas

        header, *rows = self.rows()
        return pandas.DataFrame(rows, columns=header).apply(
            lambda column: column if column.name in _TEXTS else pandas.to_numeric(column)
        )


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(_Tabulated):
    """A spectrum against a reference."""

    # names that a tolerance may have.
    QUANTITIES: ClassVar = (*_VALUES, "clamped_capacitance")
    # quantities of a tolerance without a name; resistance and coupling factor follow from them
    JUDGED: ClassVar = ("frequency", "quality_factor", "coupling", "clamped_capacitance")

    measured: SpectrumFit  # the spectrum's fit
    reference: SpectrumFit  # the reference's fit
    modes: tuple[ModeDeviation, ...]  # the reference's modes in the common band, by rising frequency
    extra_hz: tuple[float, ...]  # frequencies of measured modes that the reference does not have
    clamped_capacitance_deviation: float  # measured over reference less one
    clamped_capacitance_deviation_error: float | None  # its standard error; ``None`` if not determined
    rms_deviation: float  # root mean square of |Y/Y_reference − 1| over the common band
    cautions: tuple[str, ...] = ()  # limits of the deviations
    tolerances: Mapping[str, float] = field(default_factory=dict)  # quantity → limit
    diagnosis: Diagnosis | None = None  # the cause, of a motor as the reference

    @property
    def passed(self) -> bool | None:
        """Whether no deviation is outside of the tolerances; ``None`` without tolerances."""
        return not self.outside(self.tolerances) if self.tolerances else None

    def _quantities(self) -> Iterator[tuple[str, ModeDeviation | None, float, float | None]]:
        """Yield each quantity with its mode, its deviation, infinite for a missing mode, and the standard error."""
        for item in self.modes:
            for name in _VALUES:
                yield name, item, item.deviations.get(name, inf), item.deviation_errors.get(name)
        yield "clamped_capacitance", None, self.clamped_capacitance_deviation, self.clamped_capacitance_deviation_error

    def deviations(self) -> dict[tuple[str, int | None], float]:
        """Return quantity and mode → deviation; infinite for a missing mode."""
        return {(name, item.mode if item else None): deviation for name, item, deviation, _ in self._quantities()}

    def errors(self) -> dict[tuple[str, int | None], float | None]:
        """Return quantity and mode → standard error of the deviation, from both fits; ``None`` if not determined."""
        return {(name, item.mode if item else None): error for name, item, _, error in self._quantities()}

    def outside(self, tolerances: Mapping[str, float]) -> tuple[str, ...]:
        """Return the deviations outside of tolerances, one sentence each, with their standard errors.

        Args:
            tolerances: quantity (of ``QUANTITIES``) → limit of the magnitude of its relative deviation.
        """
        outside = [
            f"{item.label[0].upper()}{item.label[1:]} is missing." for item in self.modes if item.measured is None
        ]
        for name, mode, deviation, error in self._quantities():
            limit = tolerances.get(name, inf)
            if isfinite(deviation) and abs(deviation) > limit:
                where = f" of {mode.label}" if mode else ""
                near = error is not None and abs(deviation) - error <= limit
                outside.append(
                    f"The {name.replace('_', ' ')}{where} is off by {_percent(deviation, error, compared=False)}; "
                    f"the limit is {100.0 * limit:.3g} %{', within the error' if near else ''}."
                )
        return tuple(outside)

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison JSON-ready."""
        return {
            "measured": self.measured.source,
            "reference": self.reference.source,
            **self._entries("modes", "extra_hz"),
            "clamped_capacitance_f": self.measured.circuit.clamped_capacitance_f,
            **self._entries("clamped_capacitance_deviation", "clamped_capacitance_deviation_error"),
            **self._entries("rms_deviation", "cautions", "diagnosis", "passed"),
            "outside_tolerance": list(self.outside(self.tolerances)) if self.tolerances else [],
        }

    def rows(self) -> list[list[str]]:
        """Return the table: a header, then one row for each mode."""
        return Trend((self,), (1.0,)).rows()

    def summary(self) -> dict[str, str]:
        """Return both sources, the RMS deviation and the deviations of each mode."""
        found = {
            "measured": self.measured.source,
            "reference": self.reference.source,
            "RMS deviation": f"{100.0 * self.rms_deviation:.3g} %",
            "clamped capacitance": _percent(
                self.clamped_capacitance_deviation, self.clamped_capacitance_deviation_error
            ),
        }
        if self.diagnosis is not None:
            found["cause"] = self.diagnosis.text
            found["evidence"] = (
                "; ".join(self.diagnosis.evidence) or "no deviation exceeds the tolerances of manufacture"
            )
            if others := self.diagnosis.causes[1:3]:
                found["next causes"] = ", ".join(cause.text for cause in others)
        for item in self.modes:
            errors = item.deviation_errors
            shown = (
                f"{name.replace('_', ' ')} {_percent(value, errors[name])}" for name, value in item.deviations.items()
            )
            frequency = engineering((item.measured or {}).get("frequency"), "Hz")
            found[item.label] = ", ".join((frequency, *shown)) if item.measured else "missing"
        if self.extra_hz:
            found["further modes"] = ", ".join(engineering(frequency, "Hz") for frequency in self.extra_hz)
        return found


@dataclass(frozen=True, eq=False, repr=False)
class Trend(_Tabulated):
    """Comparisons of many spectra with one reference, in their order."""

    comparisons: tuple[Comparison, ...]  # one for each spectrum
    at: tuple[float, ...]  # condition of each spectrum, such as a temperature or an age; by default its number from 1
    label: str = "number of the spectrum"  # name and unit of ``at``

    @property
    def passed(self) -> bool | None:
        """Whether no deviation of any spectrum is outside of the tolerances; ``None`` without tolerances."""
        return all(item.passed for item in self.comparisons) if self.comparisons[0].tolerances else None

    def drifts(self) -> list[dict[str, Any]]:
        r"""Return the change of each quantity with ``at``: the slope of its logarithm over all spectra.

        Over temperature, the slopes of ``frequency``, ``coupling`` (θ, in proportion to f √C) and
        ``clamped_capacitance`` are the drifts of :class:`~pyspice_runner.motor.thermal.Thermal`; over the drive level,
        those of ``frequency`` and ``quality_factor`` are the softening and the losses of the ceramic. Weighted least
        squares; the errors of the fits, or the scatter about the line if it is greater, give the standard error.

        Returns:
            For each mode and quantity ``mode``, ``quantity``, ``slope`` and ``standard_error`` per unit of ``at``; an
            empty list for fewer than three spectra.
        """
        found: list[dict[str, Any]] = []
        at = np.array(self.at)
        if len(at) < 3 or float(np.ptp(at)) == 0.0:
            return found
        for number, first in enumerate(self.comparisons[0].modes):
            modes = [item.modes[number] for item in self.comparisons]
            if any(mode.measured is None for mode in modes):
                continue
            for name in ("frequency", "quality_factor", "coupling"):
                values = [mode.measured[name] for mode in modes if mode.measured]
                errors = [mode.standard_errors[name] for mode in modes]
                found.append({"mode": first.mode, "quantity": name, **_slope(at, values, errors)})
        values = [item.measured.circuit.clamped_capacitance_f for item in self.comparisons]
        errors = [item.measured.standard_errors["clamped_capacitance_f"] for item in self.comparisons]
        slope = _slope(at, values, errors)
        return [*found, {"mode": None, "quantity": "clamped_capacitance", **slope}]

    def rows(self) -> list[list[str]]:
        """Return the table: a header, then one row for each spectrum and mode."""
        names = Comparison.QUANTITIES
        header = ["spectrum", "at", "mode", *(column for column, _ in _VALUES.values()), "clamped_capacitance_f"]
        header += [*(f"{name}_deviation" for name in names), "rms_deviation"]
        header += [*(f"{name}_deviation_error" for name in names), "mode_name", "passed", "cause", "cause_probability"]
        rows = [header]
        for item, at in zip(self.comparisons, self.at, strict=True):
            capacitance = {"clamped_capacitance": item.measured.circuit.clamped_capacitance_f}
            for mode in item.modes:
                values = (mode.measured or {}) | capacitance
                deviations = mode.deviations | {"clamped_capacitance": item.clamped_capacitance_deviation}
                cells = [f"{values[name]:.9g}" if name in values else "" for name in names]
                cells += [f"{deviations[name]:.6g}" if name in deviations else "" for name in names]
                cells.append(f"{item.rms_deviation:.6g}")
                errors = mode.deviation_errors | {"clamped_capacitance": item.clamped_capacitance_deviation_error}
                cells += ["" if errors.get(name) is None else f"{errors[name]:.3g}" for name in names]
                cells += [mode.name, "" if item.passed is None else ("fail", "pass")[item.passed]]
                first = item.diagnosis.causes[0] if item.diagnosis else None
                cells += [first.name, f"{first.probability:.3g}"] if first else ["", ""]
                rows.append([item.measured.source, f"{at:g}", str(mode.mode), *cells])
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return all comparisons JSON-ready."""
        return {
            "reference": self.comparisons[0].reference.source,
            **self._entries("at", "label", "comparisons"),
            "drifts": self.drifts(),
            "tolerances": dict(self.comparisons[0].tolerances),
            "within_tolerance": self.passed,
        }

    def _limits(self) -> Iterable[str]:
        """Return the cautions of all comparisons."""
        return (text for item in self.comparisons for text in item.cautions)

    def summary(self) -> dict[str, str]:
        """Return the reference, the number of spectra and the deviations of each; of many, verdict and cause."""
        found = {"reference": self.comparisons[0].reference.source, "spectra": str(len(self.comparisons))}
        for item, at in zip(self.comparisons, self.at, strict=True):
            if len(self.comparisons) > _IN_FULL:
                verdict = {True: "pass", False: "fail", None: f"RMS deviation {100.0 * item.rms_deviation:.3g} %"}
                text = f"{item.measured.source}: {verdict[item.passed]}"
                found[f"{self.label} {at:g}"] = f"{text}; {item.diagnosis.text}" if item.diagnosis else text
                continue
            entries = item.summary()
            found[f"{self.label} {at:g}"] = entries.pop("measured")
            found |= {f"{name} at {at:g}": text for name, text in entries.items() if name != "reference"}
        return found


def _slope(at: NDArray[np.float64], values: Sequence[float], errors: Sequence[float | None]) -> dict[str, float]:
    """Return the slope of the logarithm of values, and its standard error."""
    deviation = np.maximum([(error or 0.0) / value for value, error in zip(values, errors, strict=True)], 1e-12)
    line, covariance = np.polyfit(at, np.log(values), 1, w=1.0 / deviation, cov="unscaled")
    scatter = float(np.sum(((np.polyval(line, at) - np.log(values)) / deviation) ** 2)) / (len(at) - 2)
    return {"slope": float(line[0]), "standard_error": float(np.sqrt(covariance[0, 0] * max(scatter, 1.0)))}


@checked
def compare(
    measured: Spectrum | Sequence[Spectrum],
    reference: Spectrum | Motor,
    *,
    modes: int | None = None,
    connection: Connection = "A",
    state: State = "free",
    leads: bool | tuple[float, float] = True,
    noise: Mapping[str, float] | None = None,
    timeout: float | None = None,
    at: Sequence[float] | NDArray[np.float64] | None = None,
    label: str = "",
    tolerances: Mapping[str, float] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Trend:
    """Compare one or many spectra with a motor or another spectrum.

    A motor names the modes, and the cause of the deviations with its probability. Two-ports show both groups.

    Args:
        measured: the spectra.
        reference: a spectrum, or a motor whose admittance ngspice computes over the measured band.
        modes: number of modes to fit; by default selected for each spectrum.
        connection: connection of the groups, of a motor and of two-ports.
        state: ``"free"`` or ``"preloaded"``, of a motor.
        leads: as of :func:`.fit_spectrum`; not for a motor.
        noise: as of :func:`.fit_spectrum`; not for a motor.
        timeout: time limit of the fit of a spectrum in s.
        at: condition of each spectrum, such as a temperature or an age.
        label: name and unit of ``at``.
        tolerances: quantity (of ``Comparison.QUANTITIES``) → limit of the magnitude of its relative deviation.
        progress: callback with the number of the next spectrum and their count, including the reference.

    Raises:
        ParameterError: for an invalid argument.
        SimulationError: if ngspice fails to compute a motor's admittance.
        SpectrumError: if a spectrum cannot be fitted, or has no band in common with the reference.
    """
    spectra = [measured] if isinstance(measured, Spectrum) else list(measured)
    if not spectra:
        raise ParameterError("There is nothing to compare; give at least one spectrum.")
    if at is not None and len(at) != len(spectra):
        raise ParameterError(f"at has {len(at)} values for {len(spectra)} spectra; give one for each.")
    limits = dict(tolerances or {})
    if unknown := limits.keys() - set(Comparison.QUANTITIES):
        raise ParameterError(f"tolerances has no {min(unknown)!r}; there are {', '.join(Comparison.QUANTITIES)}.")
    motor = reference if isinstance(reference, Motor) else None
    if isinstance(reference, Motor):
        start = min(float(spectrum.frequency_hz[0]) for spectrum in spectra)
        stop = max(float(spectrum.frequency_hz[-1]) for spectrum in spectra)
        result = admittance(reference, start=start, stop=stop, points=_MODEL_POINTS, state=state)
        name = f"{reference.name} ({state}, {connection})"
        reference = Spectrum(result.frequency_hz, result.matrix_s, name, "model")
    against, *ports = (one.driven(connection) if one.ports == 2 else one for one in (reference, *spectra))
    for port in ports:
        if min(port.frequency_hz[-1], against.frequency_hz[-1]) <= max(port.frequency_hz[0], against.frequency_hz[0]):
            raise SpectrumError(
                f"{port.source or 'The spectrum'} and {against.source or 'the reference'} share no frequencies."
            )
    fits, notify = [], progress or (lambda *_: None)
    for number, spectrum in enumerate((against, *ports), start=1):
        notify(number, len(ports) + 1)
        known = {"leads": False} if motor and number == 1 else {"leads": leads, "noise": noise}
        fits.append(fit_one_port(spectrum, modes, timeout=timeout, **known))
    judges: dict[int, Judge] = {}  # by the number of ports
    if motor:
        judges[1] = Judge(motor, state, connection, fits[0])
        if max(spectrum.ports for spectrum in spectra) == 2:
            judges[2] = Judge(motor, state, None, fit_groups(reference, leads=False))
    names = judges[1].called if judges else None
    search = {"noise": noise, "timeout": timeout, "leads": leads is not False}
    found = tuple(
        replace(
            _compare(fit, fits[0], names), tolerances=limits,
            diagnosis=_diagnosed(judges, spectrum, fit, search) if judges else None,
        )
        for fit, spectrum in zip(fits[1:], spectra, strict=True)
    )  # fmt: skip
    places = tuple(range(1, len(spectra) + 1)) if at is None else tuple(float(value) for value in at)
    return Trend(found, places, label or ("number of the spectrum" if at is None else "at"))


def _diagnosed(
    judges: Mapping[int, Judge], spectrum: Spectrum, one: SpectrumFit, search: Mapping[str, Any]
) -> Diagnosis:
    """Return the causes by both groups of a two-port, or else by the fit of its connection."""
    skewed = any(SKEWED in caution for caution in one.cautions)
    if spectrum.ports == 2:
        with suppress(SpectrumError):  # no mode that both groups show
            return judges[2].judge(fit_groups(spectrum, **search), skewed=skewed)
    # leads are one of the causes: the fit must have them in the device
    with suppress(SpectrumError):
        if one.leads:
            driven = Spectrum.from_admittance(one.frequency_hz, one.measured_s, source=one.source)
            one = fit_one_port(driven, len(one.arms), **{**search, "leads": False})
    return judges[1].judge(one, skewed=skewed)


def _compare(measured: SpectrumFit, reference: SpectrumFit, names: Mapping[int, str] | None) -> Comparison:
    """Compare two fits; ``names`` are the names of the reference's arms that are modes of a motor."""
    low = max(measured.frequency_hz[0], reference.frequency_hz[0])
    high = min(measured.frequency_hz[-1], reference.frequency_hz[-1])
    wanted, found = (
        {k: arm for k, arm in enumerate(fit.resonances) if low <= arm.series_resonance_hz <= high}
        for fit in (reference, measured)
    )
    wanted = {k: arm for k, arm in wanted.items() if names is None or k in names}
    first, second = (Observed.of(fit)[0] for fit in (reference, measured))
    pairs = {k: own for k, own in zip(*first.paired(second), strict=True) if k in wanted and own in found}
    modes = tuple(
        _deviation(
            number, (names or {}).get(k, ""), (reference, arm), (measured, found[pairs[k]]) if k in pairs else None
        )
        for number, (k, arm) in enumerate(wanted.items(), start=1)
    )
    common = (measured.frequency_hz >= low) & (measured.frequency_hz <= high)
    frequency, y = measured.frequency_hz[common], measured.measured_s[common]
    ratio = y / reference.admittance(frequency) - 1.0
    deviation = measured.circuit.clamped_capacitance_f / reference.circuit.clamped_capacitance_f - 1.0
    apart = [] if pairs else [f"No resonance is common: {_listed(measured)}; {_listed(reference)}."]
    return Comparison(
        measured=measured,
        reference=reference,
        modes=modes,
        extra_hz=tuple(arm.series_resonance_hz for k, arm in found.items() if k not in pairs.values()),
        clamped_capacitance_deviation=deviation,
        clamped_capacitance_deviation_error=_error(deviation, _clamped_share(measured), _clamped_share(reference)),
        rms_deviation=rms(ratio),
        cautions=(*apart, *(f"{fit.source}: {text}" for fit in (measured, reference) for text in fit.cautions)),
    )


def _percent(deviation: float, error: float | None, *, compared: bool = True) -> str:
    """Return a deviation in percent, with its sign unless it is 0, and its standard error.

    If ``compared``, a deviation that does not exceed its error is marked.
    """
    value = f"{100.0 * deviation:+.3g}" if deviation else "0"
    if not error:
        return f"{value} %"
    return f"{value} ± {100.0 * error:.1g} %{' (within the error)' if compared and abs(deviation) <= error else ''}"


def _listed(fit: SpectrumFit) -> str:
    """Return the resonances of a spectrum in words."""
    found = " and ".join(engineering(arm.series_resonance_hz, "Hz") for arm in fit.resonances) or "none"
    return f"{fit.source or 'the spectrum'} has {found}".replace("\N{NO-BREAK SPACE}", " ")


def _deviation(
    number: int, name: str, reference: tuple[SpectrumFit, FittedArm], measured: tuple[SpectrumFit, FittedArm] | None
) -> ModeDeviation:
    wanted = {name: of(reference[1]) for name, (_, of) in _VALUES.items()}
    if measured is None:
        return ModeDeviation(number, wanted, None, {}, {}, {}, name)
    found = {name: of(measured[1]) for name, (_, of) in _VALUES.items()}
    deviations = {name: found[name] / wanted[name] - 1.0 for name in wanted}
    shares = _shares(*measured), _shares(*reference)
    errors = {name: None if isnan(share) else share * found[name] for name, share in shares[0].items()}
    return ModeDeviation(
        number, wanted, found, errors, deviations,
        {name: _error(deviation, *(one[name] for one in shares)) for name, deviation in deviations.items()}, name,
    )  # fmt: skip


def _shares(fit: SpectrumFit, arm: FittedArm) -> dict[str, float]:
    """Return the relative standard errors of the quantities of an arm; NaN for one that is not determined.

    That of the coupling factor follows from k² = C/(C + C₀), with the correlation of both capacitances.
    """
    errors = arm.standard_errors
    paths = {"frequency": "series_resonance_hz", "quality_factor": "quality_factor", "resistance": "resistance_ohm"}
    found = {name: _share(errors[path], getattr(arm, path)) for name, path in paths.items()}
    found["coupling"] = 0.5 * _share(errors["inductance_h"], arm.inductance_h)
    arm_share = _share(errors["capacitance_f"], arm.capacitance_f)
    clamped_share = _clamped_share(fit)
    place = next(number for number, one in enumerate(fit.arms) if one is arm)
    names = (f"arms.{place}.capacitance_f", "clamped_capacitance_f")
    common = fit.correlation[tuple(map(fit.correlation_names.index, names))]
    spread = arm_share**2 + clamped_share**2 - 2.0 * common * arm_share * clamped_share
    share = 0.5 * (1.0 - arm.characteristics.coupling_factor**2) * float(np.sqrt(np.maximum(spread, 0.0)))
    return found | {"coupling_factor": share}


def _clamped_share(fit: SpectrumFit) -> float:
    return _share(fit.standard_errors["clamped_capacitance_f"], fit.circuit.clamped_capacitance_f)


def _share(error: float | None, value: float) -> float:
    return nan if error is None else abs(error / value)


def _error(deviation: float, measured: float, reference: float) -> float | None:
    """Return the standard error of a deviation from the relative ones of both values; ``None`` if one is NaN."""
    error = (1.0 + deviation) * hypot(measured, reference)
    return None if isnan(error) else error
