# SPDX-License-Identifier: GPL-3.0-or-later
"""A calibration that was interrupted: the places of its searches in a JSON file, from which it goes on.

The file has the hash of the problem and a hash of its content, which reveal another problem and a damaged file.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending, write_json
from pyspice_runner.motor.document import read_document
from pyspice_runner.run.waveforms import Array
from pyspice_runner.sweeps.store import fingerprint
from pyspice_runner.sweeps.task import drive_document, law_document

_REMEDY = "Remove it, or name another file, to start from the beginning."


class Checkpoint:
    """The places of the searches of a calibration, one for each contact law; without a path they are not kept.

    As a context it removes the file at the end of the calibration; an error or an interruption leaves it.

    Raise ParameterError for a file of another problem, a damaged one, or a place that cannot be written.
    """

    def __init__(self, path: str | Path | None, predictors: Sequence[Predictor]) -> None:
        self.path = None if path is None else Path(path)
        self.places: dict[str, list[float]] = {}  # number of the law → coordinates
        if self.path is None:
            return
        self.problem = fingerprint([_content(predictor) for predictor in predictors])
        if self.path.exists():
            self.places = self._read(self.path)
        else:
            self._write(self.path)  # so that a place that cannot be written is an error before the work begins

    def place(self, law: int) -> Array | None:
        """Return the coordinates from which the search with the law of this number goes on; ``None`` for a new one."""
        return np.array(self.places[str(law)]) if str(law) in self.places else None

    def keep(self, law: int, x: Array) -> None:
        """Keep the coordinates of a search."""
        self.places[str(law)] = x.tolist()
        if self.path is not None:
            self._write(self.path)

    def _read(self, path: Path) -> dict[str, list[float]]:
        damaged = ParameterError(f"{path} is not the unfinished state of a calibration, or is damaged. {_REMEDY}")
        try:
            found = json.loads(read_document(path, "the path of a .json file in which a calibration keeps its state"))
            problem, places = found["problem"], found["places"]
            if found["seal"] != fingerprint([problem, places]):
                raise damaged
        except (ValueError, TypeError, KeyError, RecursionError):
            raise damaged from None
        if problem != self.problem:
            raise ParameterError(
                f"{path} belongs to another calibration: motor, drive, free parameters, data, contact laws or priors "
                f"differ. {_REMEDY}"
            )
        return dict(places)

    def _write(self, path: Path) -> None:
        seal = fingerprint([self.problem, self.places])
        document = {"problem": self.problem, "places": self.places, "seal": seal}
        save_by_ending(path, {".json": lambda file: write_json(file, document)})

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if self.path is None:
            return
        if error is None or not self.places:
            self.path.unlink(missing_ok=True)
        elif isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(
                f"the calibration is kept in {self.path}; start the same calibration again to continue it"
            ) from None


def _content(predictor: Predictor) -> dict[str, Any]:
    """Return all that the result of a search follows from, but its start."""
    base, points = predictor.base, predictor.points
    return {
        "motor": base.motor.to_dict(),
        "drive": drive_document(base.drive),
        "law": {**base.law.to_dict(), **law_document(base.law.name)} if base.law else None,
        "free": [vars(unknown) for unknown in predictor.unknowns],
        "conditions": [points.conditions, points.rows, points.quantities] if points else [],
        "curves": [vars(curve) | {"spectrum": None} for curve in predictor.curves],
        "reference_c": predictor.reference_c,
        "measured": predictor.measured,
        "errors": predictor.errors,
    }
