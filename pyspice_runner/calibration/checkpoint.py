# SPDX-License-Identifier: GPL-3.0-or-later
"""A calibration that was interrupted: the places of its searches in a JSON file, from which it goes on.

The file has the hash of the problem, which reveals another problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from pydantic import BaseModel, FiniteFloat, ValidationError

from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending, write_json
from pyspice_runner.motor.document import read_document
from pyspice_runner.run.waveforms import Array
from pyspice_runner.sweeps.store import fingerprint
from pyspice_runner.sweeps.task import drive_document, law_document, motor_document

_REMEDY = "Remove it, or name another file, to start from the beginning."


class _State(BaseModel):
    """The content of the file."""

    problem: str
    places: dict[str, list[FiniteFloat]] = {}  # number of the law → coordinates


class Checkpoint:
    """The places of the searches of a calibration, one for each contact law; without a path they are not kept.

    As a context it removes the file at the end of the calibration; an error or an interruption leaves it.

    Raise ParameterError for a file of another problem, a damaged one, or a place that cannot be written.
    """

    def __init__(self, path: str | Path | None, predictors: Sequence[Predictor]) -> None:
        self.path = None if path is None else Path(path)
        problem = "" if self.path is None else fingerprint([_content(predictor) for predictor in predictors])
        self.state = _State(problem=problem)
        if self.path is not None and self.path.exists():
            self.state = self._read(self.path, len(predictors[0].unknowns))
        else:
            self._write()  # so that a place that cannot be written is an error before the work begins

    def place(self, law: int) -> Array | None:
        """Return the coordinates from which the search with the law of this number goes on; ``None`` for a new one."""
        places = self.state.places
        return np.array(places[str(law)]) if str(law) in places else None

    def keep(self, law: int, x: Array) -> None:
        """Keep the coordinates of a search."""
        self.state.places[str(law)] = x.tolist()
        self._write()

    def _read(self, path: Path, free: int) -> _State:
        text = read_document(path, "the path of a .json file in which a calibration keeps its state")
        try:
            found = _State.model_validate_json(text)
        except ValidationError:
            found = None
        if found is None or any(len(place) != free for place in found.places.values()):
            raise ParameterError(f"{path} is not the unfinished state of a calibration, or is damaged. {_REMEDY}")
        if found.problem != self.state.problem:
            raise ParameterError(
                f"{path} belongs to another calibration: motor, drive, free parameters, data, contact laws or priors "
                f"differ. {_REMEDY}"
            )
        return found

    def _write(self) -> None:
        if self.path is not None:
            save_by_ending(self.path, {".json": lambda file: write_json(file, self.state.model_dump())})

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self.path is None:
            return
        if error is None or not self.state.places:
            self.path.unlink(missing_ok=True)
        elif isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(
                f"the calibration is kept in {self.path}; start the same calibration again to continue it"
            ) from None


def _content(predictor: Predictor) -> dict[str, Any]:
    """Return all that the result of a search follows from, but its start."""
    base, points = predictor.base, predictor.points
    return {
        **motor_document(base.motor),
        "drive": drive_document(base.drive),
        "law": {**base.law.to_dict(), **law_document(base.law.name)} if base.law else None,
        "free": [vars(unknown) for unknown in predictor.unknowns],
        "conditions": [points.conditions, points.rows, points.quantities] if points else [],
        "curves": [vars(curve) | {"spectrum": None} for curve in predictor.curves],
        "reference_c": predictor.reference_c,
        "measured": predictor.measured,
        "errors": predictor.errors,
    }
