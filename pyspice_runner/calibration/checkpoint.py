# SPDX-License-Identifier: GPL-3.0-or-later
"""A calibration that was interrupted: the places of its searches in a JSON file, from which it goes on.

The file has the hash of the problem and a hash over its content, so that another problem and a damaged file are told.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending, write_json
from pyspice_runner.motor.document import read_document
from pyspice_runner.run.waveforms import Array
from pyspice_runner.sweeps.store import fingerprint
from pyspice_runner.sweeps.task import drive_document, law_document

_OTHERWISE = "Remove it, or name another file, to start from the beginning."


class Checkpoint:
    """The places of the searches of a calibration, one for each contact law; without a path they are not kept.

    As a context it removes the file at the end of the calibration; an error or an interruption leaves it.

    Raise ParameterError for a file of another problem, a damaged one, or a place that cannot be written.
    """

    def __init__(self, path: str | Path | None, predictors: Sequence[Predictor]) -> None:
        self.path = None if path is None else Path(path)
        self.problem = "" if path is None else fingerprint([_content(predictor) for predictor in predictors])
        self.places: dict[str, list[float]] = {}  # number of the law → coordinates
        if self.path is None:
            return
        if self.path.exists():
            self.places = self._read(self.path)
        else:
            self._write()  # a place that cannot be written is told before the work begins

    def place(self, law: int) -> Array | None:
        """Return the coordinates from which the search with the law of this number goes on; ``None`` for a new one."""
        return np.array(self.places[str(law)]) if str(law) in self.places else None

    def keep(self, law: int, x: Array) -> None:
        """Keep the coordinates of a search."""
        self.places[str(law)] = x.tolist()
        self._write()

    def _read(self, path: Path) -> dict[str, list[float]]:
        damaged = ParameterError(f"{path} is not the unfinished state of a calibration, or is damaged. {_OTHERWISE}")
        try:
            found = json.loads(read_document(path, "the path of a .json file in which a calibration keeps its state"))
            problem, places = found["problem"], found["places"]
            whole = found["seal"] == fingerprint([problem, places])
        except (ValueError, TypeError, KeyError, RecursionError):
            raise damaged from None
        if not whole:
            raise damaged
        if problem != self.problem:
            raise ParameterError(
                f"{path} belongs to another calibration: motor, drive, free parameters, data, contact laws or priors "
                f"differ. {_OTHERWISE}"
            )
        return dict(places)

    def _write(self) -> None:
        if self.path is not None:
            document = {"problem": self.problem, "places": self.places}
            document["seal"] = fingerprint([self.problem, self.places])
            save_by_ending(self.path, {".json": lambda file: write_json(file, document)})

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


def _content(predictor: Predictor) -> dict[str, object]:
    """Return all that the result of a search follows from, but its start."""
    base, points = predictor.base, predictor.points
    return {
        "motor": base.motor.to_dict(),
        "drive": drive_document(base.drive),
        "law": {**base.law.to_dict(), **law_document(base.law.name)} if base.law else None,
        "free": [vars(unknown) for unknown in predictor.unknowns],
        "conditions": [[points.conditions, points.rows, points.quantities]] if points else [],
        "spectra": [[band.spectrum.frequency_hz, band.state, band.connection, band.error, vars(band.condition)]
                    for band in predictor.bands],
        "run_ups": [[own.conditions, own.time_s] for own in predictor.run_ups],
        "reference_c": predictor.reference_c,
        "measured": predictor.measured,
        "errors": predictor.errors,
    }  # fmt: skip
