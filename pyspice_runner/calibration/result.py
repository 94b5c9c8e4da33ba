# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a calibration: values with intervals, residuals, predictions with a band; and as read from its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isclose, log
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, FiniteFloat, ValidationError, model_validator

from pyspice_runner.calibration.points import MEASURED, TEMPERATURE, Curve, Points, read_points
from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.calibration.spectra import temperatures_of
from pyspice_runner.calibration.unknowns import THERMAL
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.document import read_document
from pyspice_runner.motor.motor import ALIASES, Motor, Provenance
from pyspice_runner.motor.refusal import Stated
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Result, json_ready
from pyspice_runner.run.paths import parameter
from pyspice_runner.run.waveforms import Array

NORMAL_95 = 1.959964  # standard errors to each side that hold 95 % of a normal distribution
NO_SUPPORT = 10.0  # difference in AICc beyond which the other law has no support; Burnham and Anderson, sec. 2.6
_SAMPLE = 20_000  # cases: the quantile of 95 % is known to 0.3 %
_MOST_BYTES = 2**22  # of its file: 2000 points with ten measured quantities each
_SAME = 1e-9  # relative: the calibrated TOML has all digits of a value


@dataclass(frozen=True)
class Estimate:
    """The value of one parameter."""

    value: FiniteFloat
    standard_error: FiniteFloat
    interval_95: tuple[FiniteFloat, FiniteFloat]  # of the profile likelihood; at most a factor of 10 to each side
    identifiable: bool  # whether the data decide it: to 25 % and better, without what was known before
    start: FiniteFloat
    unit: str
    path: str = ""  # it is the key of the value in the file


@dataclass(frozen=True)
class SetFit:
    """How the calibrated motor fits one set of data."""

    data: str  # name of the file, and the state of a spectrum
    values: int
    squares: float  # sum of squares, with Huber's loss
    expected: float  # its mean if the model holds
    probability: float  # of a sum that is as large, if the model holds


@dataclass(frozen=True)
class Rival:
    """How another law of the contact fits the same data."""

    law: str
    aicc: float  # as that of :class:`Calibration`; NaN if it failed
    freedom: int  # number of values less that of parameters
    misfits: tuple[str, ...]  # the data that it does not explain
    failed: str = ""  # why, if it failed


@dataclass(frozen=True)
class PredictedCurve:
    """Predicted values with their standard errors by the calibration, not those of a measurement."""

    quantities: tuple[str, ...]
    rows: tuple[int, ...]  # point of each value
    values: Array
    standard_errors: Array  # by the covariance of the parameters
    low: Array  # ends of the 95 % interval of each value
    high: Array
    low_of_all: Array  # ends of the band that contains all values together in 95 % of calibrations
    high_of_all: Array
    measured: Array


def factor_of_all(covariance: Array) -> float:
    """Return the number of standard errors that contains all of several normal values together in 95 % of cases.

    The quantile of their maximum, by a fixed sample: 1.96 if all go together, 2.5 if five are independent.
    J. L. Montiel Olea, M. Plagborg-Møller, J. Applied Econometrics 34, 1 (2019).
    """
    deviations = np.sqrt(np.diag(covariance))
    moving = deviations > 0.0
    if not moving.any():
        return NORMAL_95
    correlation = (covariance / np.outer(deviations, deviations).clip(np.finfo(float).tiny))[np.ix_(moving, moving)]
    squares, along = np.linalg.eigh(correlation)
    normal = np.random.default_rng(0).standard_normal((_SAMPLE, len(squares)))
    maxima = np.abs((normal * np.sqrt(squares.clip(0.0))) @ along.T).max(axis=1)
    return float(np.quantile(maxima, 0.95))


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """Calibrated parameters of a motor.

    Attributes:
        estimates: value, standard error and interval of each free parameter.
        calibrated: the motor with the new values.
        predictor: data, motor at the start and model.
        predicted: the measured values, of the calibrated motor.
        predicted_errors: standard errors of the predicted values by those of the parameters.
        correlations, covariance: of the coordinates of the parameters, in the order of ``estimates``.
        coordinates: of the solution: ln(value/start) of each parameter, or the difference over ``start``.
        ends: coordinates at the ends of the intervals, the other parameters following; without open ends.
        rms_residual: root mean square of (predicted − measured)/error.
        squares: sum of squares, with Huber's loss.
        freedom: number of values less that of parameters.
        fits: how the motor fits each set of data; empty if the errors of the points are not given.
        scale: by which the standard errors of the data were multiplied; 1 if they were given.
        warnings: what the data do not decide and what does not fit, one sentence each.
        steady_states: number of steady states that were computed.
        rivals: how other laws of the contact fit.
    """

    estimates: tuple[Estimate, ...]
    calibrated: Motor
    predictor: Predictor
    predicted: Array
    predicted_errors: Array
    correlations: Array
    covariance: Array
    coordinates: Array
    ends: tuple[Array, ...]
    rms_residual: float
    squares: float
    freedom: int
    scale: float
    fits: tuple[SetFit, ...]
    warnings: tuple[str, ...]
    steady_states: int
    rivals: tuple[Rival, ...] = ()

    @property
    def start(self) -> Motor:
        """The motor at the start."""
        return self.predictor.base.motor

    @property
    def law(self) -> str:
        """Law of the contact."""
        assert self.predictor.base.law is not None
        return self.predictor.base.law.name

    @property
    def points(self) -> Points | None:
        """The measured points; ``None`` without."""
        return self.predictor.points

    @property
    def curves(self) -> list[tuple[Curve, slice]]:
        """The measured spectra, then the run-ups, each with the places of its values."""
        return [(one, own) for one, own in self.predictor.sets if isinstance(one, Curve)]

    @property
    def measured(self) -> Array:
        """All measured values: of the points, the spectra, the run-ups."""
        return self.predictor.measured

    @property
    def errors(self) -> Array:
        """Their standard errors."""
        return self.predictor.errors

    @property
    def motor(self) -> Motor:
        """The calibrated motor; its provenance has error, interval and data of each value."""
        provenance = dict(self.calibrated.provenance)
        for one in self.estimates:
            if one.path.startswith(THERMAL):
                continue
            section, _, key = one.path.rpartition(".")
            share = one.standard_error / abs(one.value) if one.value else float("nan")
            low, high = one.interval_95
            note = (
                f"calibrated with {self.sources}: {one.path} = {one.value:.5g} ± {100.0 * share:.2g} %, 95 % interval "
                f"{low:.4g} to {high:.4g}"
            )
            note += "" if one.identifiable else "; the data do not identify it"
            provenance[f"{section}.{ALIASES.get(key, key)}"] = Provenance("derived", note)
        return self.calibrated.model_copy(update={"provenance": provenance})

    @property
    def thermal(self) -> Thermal:
        """The drift of the motor: calibrated values, defaults for the others."""
        return self.predictor.thermal(self.coordinates)

    @property
    def sources(self) -> str:
        """Names of the data."""
        names = [self.points.source] if self.points else []
        return " and ".join([*names, *(one.file for one in self.predictor.curves)])

    @property
    def aicc(self) -> float:
        """Akaike's information criterion for small samples: the minimum of several contact laws fits best.

        K. P. Burnham, D. R. Anderson, "Model Selection and Multimodel Inference", Springer 2002, sec. 2.4.
        """
        count, free = len(self.measured), len(self.estimates)
        if count <= free + 2:
            return float("nan")
        given = self.points is None or self.points.errors_given
        fit = self.squares if given else count * log(self.squares / count)
        free += 0 if given else 1  # the size of the errors
        return fit + 2.0 * free + 2.0 * free * (free + 1.0) / (count - free - 1.0)

    def _limits(self) -> tuple[str, ...]:
        """Return the warnings."""
        return self.warnings

    def predict(self, data: Any) -> PredictedCurve:
        """Return the values at other points, with their standard errors by the uncertainty of the parameters.

        Args:
            data: points as for :func:`~pyspice_runner.calibrate`; their measured columns name the quantities.

        Raises:
            ParameterError: for an invalid table.
            SimulationError: if ngspice fails.
        """
        points = read_points(data, self.start.slider is not None, measured=False)
        own = self.predictor
        temperatures_of([(f"point {row}", one) for row, one in enumerate(points.conditions, start=1)])
        predictor = Predictor(own.base, own.unknowns, points, reference_c=own.reference_c)
        if own.reference_c is None and TEMPERATURE in points.conditions[0]:
            raise ParameterError(
                "The points have a temperature, the calibration has none: that of the motor's values is not known. "
                "Leave it out, or calibrate with data whose temperature is stated."
            )
        points.check([predictor.point(own.base, conditions) for conditions in points.conditions])
        predictor, here = predictor.refined(self.coordinates)
        if not here.known:
            raise SimulationError("The calibrated motor has no steady state at any of the points.")
        slope = predictor.jacobian(self.coordinates, here, central=True)
        covariance = slope @ self.covariance @ slope.T
        deviations = np.sqrt(np.diag(covariance))
        # where parameters replace each other the sum of squares has a curved valley, which the covariance does not know
        ends = [(one.values - here.values) / NORMAL_95 for one in predictor.at(self.ends, here)] if self.ends else []
        below, above = (sign * np.fmax.reduce([deviations, *(sign * end for end in ends)]) for sign in (-1.0, 1.0))
        factor = factor_of_all(covariance)
        return PredictedCurve(
            points.quantities, points.rows, here.values, deviations,
            here.values + NORMAL_95 * below, here.values + NORMAL_95 * above,
            here.values + factor * below, here.values + factor * above, points.values,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return values, fit, correlations and residuals, JSON-ready."""
        return dict(json_ready({
            "motor": self.start.name,
            "data": self.sources,
            "contact": self.law,
            "parameters": {
                one.path: {name: value for name, value in vars(one).items() if name != "path"} for one in self.estimates
            },
            **self._entries("rms_residual", "warnings"),
            "sum_of_squares": self.squares,
            "degrees_of_freedom": self.freedom,
            "error_scale": self.scale,
            **self._entries("fits", "aicc"),
            "rivals": [
                {"contact": one.law, "aicc": one.aicc, "misfits": one.misfits, "failed": one.failed,
                 "verdict": self._against(one)}
                for one in self.rivals
            ],
            **self._entries("correlations", "steady_states"),
            "points": [
                {"point": row + 1, "quantity": quantity, "measured": float(measured), "predicted": float(predicted),
                 "error": float(error)}
                for row, quantity, measured, predicted, error in (
                    zip(self.points.rows, self.points.quantities, self.measured, self.predicted, self.errors,
                        strict=False) if self.points else ()
                )
            ],
            "curves": [self._curve(*each) for each in self.curves],
        }))  # fmt: skip

    def summary(self) -> dict[str, str]:
        """Return each value with its error and interval, and how well the data fit."""
        found = {}
        for one in self.estimates:
            unit = "" if one.unit == "1" else f" {one.unit}"
            low, high = one.interval_95
            text = f"{one.value:.5g} ± {one.standard_error:.2g}{unit}, 95 %: {low:.4g} to {high:.4g}"
            found[one.path] = text if one.identifiable else f"{text} (not identified by the data)"
        found["RMS residual"] = f"{self.rms_residual:.3g} standard errors, {len(self.measured)} values"
        if self.predictor.reference and (averages := np.count_nonzero(self.predictor.reference.scatter)):
            found["time averages"] = f"{averages} of {len(self.measured)} values"
        return found | {f"law {one.law}": self._against(one) for one in self.rivals}

    def _against(self, other: Rival) -> str:
        """Return a sentence that compares another law of the contact with this one."""
        if other.failed:
            return f"failed: {other.failed}"
        if other.freedom != self.freedom:
            return f"not comparable: it has {other.freedom - self.freedom:+d} values, where it has a steady state"
        by = other.aicc - self.aicc
        verdict = f"{self.law if by > 0.0 else other.law} fits better by {abs(by):.3g} in AICc"
        verdict += "" if abs(by) > NO_SUPPORT else ", which is not conclusive"
        return verdict + (f"; {other.law} does not explain {' and '.join(other.misfits)}" if other.misfits else "")

    def _curve(self, curve: Curve, places: slice) -> dict[str, Any]:
        """Return a spectrum or a run-up, JSON-ready."""
        columns = {"measured": self.measured, "predicted": self.predicted, "error": self.errors}
        parts = {name: np.split(values[places], len(curve.quantities)) for name, values in columns.items()}
        quantities = {
            quantity: {name: values[number] for name, values in parts.items()}
            for number, quantity in enumerate(curve.quantities)
        }
        return {"data": curve.source, "along": curve.along, "at": curve.at, "quantities": quantities}

    def columns(self) -> Mapping[str, Array]:
        """Return measured and predicted value and residual of each measured value, in the order of the data.

        ``set`` is the number of its set of data: points, spectra, run-ups. ``at`` is the time in s of a run-up, the
        frequency in Hz of a spectrum, whose real parts come before its imaginary ones, and NaN of a point. ``point``
        is the number of the point in its set.
        """
        rows = np.array(self.points.rows if self.points else (), dtype=float)
        curves = [(curve.at, len(curve.quantities)) for curve, _ in self.curves]
        lengths = [len(one.errors) for one, _ in self.predictor.sets]
        return {
            "point": np.concatenate([rows + 1.0, *(np.tile(np.arange(len(at)) + 1.0, many) for at, many in curves)]),
            "set": np.repeat(np.arange(len(lengths)) + 1.0, lengths),
            "at": np.concatenate([np.full(len(rows), np.nan), *(np.tile(at, many) for at, many in curves)]),
            "measured": self.measured,
            "predicted": self.predicted,
            "error": self.errors,
            "residual": (self.predicted - self.measured) / self.errors,
        }

    def _write_csv(self, file: Path) -> None:
        """Write the columns with the names of data and quantity in place of the number of the set."""
        import pandas

        names = [one.source for one, _ in self.predictor.sets for _ in one.errors]
        quantities = list(self.points.quantities) if self.points else []
        quantities += [name for curve, _ in self.curves for name in curve.quantities for _ in curve.at]
        table = pandas.DataFrame({"data": names, "quantity": quantities, **self.columns()}).drop(columns="set")
        table.to_csv(file, index=False, float_format="%.12g", lineterminator="\n")

    def writers(self) -> dict[str, Callable[[Path], object]]:
        """Return the writers by ending: ``.toml`` (the calibrated motor), ``.json`` and ``.csv`` (the residuals)."""
        drifts = [f"{one.path} = {one.value:.5g} {one.unit} ± {one.standard_error:.2g}, an argument of Thermal"
                  for one in self.estimates if one.path.startswith(THERMAL)]  # fmt: skip
        text = self.motor.to_toml(heading="\n".join([f"{self.start.name}, calibrated with {self.sources}.", *drifts]))
        own = {".csv": self._write_csv, ".toml": lambda file: file.write_text(text, encoding="utf-8")}
        return {**super().writers(), **own}


# --- the file ---


def _measured(name: str) -> str:
    if name not in MEASURED:
        raise ValueError(f"{name!r} is not a quantity that can be measured")
    return name


class RecordedPoint(BaseModel):
    """A measured value of a point; ``predicted`` is ``None`` where the motor has no steady state."""

    point: int
    quantity: Annotated[str, AfterValidator(_measured)]
    measured: FiniteFloat
    predicted: FiniteFloat | None
    error: FiniteFloat

    @property
    def residual(self) -> float | None:
        """(predicted − measured)/error."""
        return None if self.predicted is None else (self.predicted - self.measured) / self.error


class RecordedValues(BaseModel):
    """Values of one quantity along a curve; ``None`` where the motor has none."""

    measured: list[FiniteFloat]
    predicted: list[FiniteFloat | None]
    error: list[FiniteFloat]

    @property
    def residuals(self) -> list[float | None]:
        """(predicted − measured)/error."""
        rows = zip(self.measured, self.predicted, self.error, strict=True)
        return [None if there is None else (there - own) / error for own, there, error in rows]


class RecordedCurve(BaseModel):
    """A spectrum over ``frequency_hz``, or a run-up over ``time_s``."""

    data: str
    along: Literal["frequency_hz", "time_s"]
    at: list[FiniteFloat]
    quantities: dict[str, RecordedValues]

    @model_validator(mode="after")
    def _of_one_length(self) -> RecordedCurve:
        lists = [values for one in self.quantities.values() for values in (one.measured, one.predicted, one.error)]
        if any(len(values) != len(self.at) for values in lists):
            raise ValueError("the lists of a curve have different lengths")
        return self


class RecordedRival(BaseModel):
    """How another law of the contact fits, as in :class:`Rival`, with the comparison in words."""

    contact: str
    aicc: FiniteFloat | None
    verdict: str


class Record(BaseModel):
    """A calibration as read from its JSON file, :meth:`Calibration.to_dict`, for the report of the calibrated motor."""

    motor: str
    data: str
    contact: str
    parameters: dict[str, Estimate]
    rms_residual: FiniteFloat
    warnings: list[str]
    fits: list[SetFit]
    points: list[RecordedPoint]
    curves: list[RecordedCurve]
    rivals: list[RecordedRival]
    aicc: FiniteFloat | None

    @classmethod
    def read(cls, path: str | Path) -> Record:
        """Read the JSON file that ``calibrate --output`` writes. Raise ParameterError for another file."""
        text = read_document(Path(path), "the path of the .json file of a calibration", _MOST_BYTES)
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"]))
            raise ParameterError(
                f"{path} is not the result of a calibration: {f'{place}: ' if place else ''}{first['msg']}. Give the "
                "file that `piezomotor calibrate … --output result.json` writes."
            ) from None

    def differing(self, motor: Motor, drive: Stated) -> list[str]:
        """Return the paths of the values that a motor does not have."""
        return [path for path, one in self.parameters.items()
                if not path.startswith(THERMAL) and not _has(motor, drive, path, one.value)]  # fmt: skip


def _has(motor: Motor, drive: Stated, path: str, value: float) -> bool:
    try:
        own = path.startswith("law.")
        found = motor.law.get(path.removeprefix("law.")) if own else parameter(path, motor, drive, {}).nominal
    except ParameterError:
        return False
    return found is not None and isclose(found, value, rel_tol=_SAME)
