# SPDX-License-Identifier: GPL-3.0-or-later
"""A calibration as read from its JSON file, for the report of the calibrated motor."""

from __future__ import annotations

from math import isclose
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, FiniteFloat, ValidationError, model_validator

from pyspice_runner.calibration.points import MEASURED
from pyspice_runner.calibration.result import SetFit
from pyspice_runner.calibration.unknowns import THERMAL
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.document import read_document
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import Stated
from pyspice_runner.run.paths import parameter

_MOST_BYTES = 2**22  # 2000 points with ten measured quantities each
_SAME = 1e-9  # relative: the calibrated TOML has all digits of a value


class RecordedValue(BaseModel):
    """A calibrated parameter, as in :class:`~.result.Estimate`."""

    value: FiniteFloat
    standard_error: FiniteFloat
    interval_95: tuple[FiniteFloat, FiniteFloat]
    identifiable: bool
    start: FiniteFloat
    unit: str


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
    """How another law of the contact fits, as in :class:`~.result.Rival`, with the comparison in words."""

    contact: str
    aicc: FiniteFloat | None
    verdict: str


class Record(BaseModel):
    """The result of a calibration, as in :meth:`.result.Calibration.to_dict`."""

    motor: str
    data: str
    contact: str
    parameters: dict[str, RecordedValue]
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
