# SPDX-License-Identifier: GPL-3.0-or-later
r"""Calibration: the parameters of a motor from measured operating points, spectra and run-ups.

With the coordinates x of the free parameters (:class:`~.unknowns.Unknown`), the residuals are
:math:`r_i = (f_i(x) - y_i)/\sigma_i` of each measured value, and :math:`x_j/w_j` of the prior knowledge, at
least an order of magnitude. :mod:`.search` computes x, :mod:`.statistics` the errors and the intervals.

A calibration that was interrupted goes on from a JSON file with the places of its searches, and the hash of the
problem, which reveals another problem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from pydantic import BaseModel, FiniteFloat, SkipValidation, ValidationError

from pyspice_runner.calibration.points import read_points
from pyspice_runner.calibration.prediction import STEP, Counter, Predictor
from pyspice_runner.calibration.result import Calibration, Rival
from pyspice_runner.calibration.run_up import RunUp
from pyspice_runner.calibration.search import Search
from pyspice_runner.calibration.spectra import SPECTRUM_ERROR, bands_of, fitted, scales, temperatures_of
from pyspice_runner.calibration.statistics import Judgement, misfits
from pyspice_runner.calibration.unknowns import THERMAL, unknowns_of
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, touching_law
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.files import save_by_ending, write_json
from pyspice_runner.impedance.spectrum import Connection
from pyspice_runner.motor.document import read_document
from pyspice_runner.motor.drive import Drive, default_drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array
from pyspice_runner.sweeps.store import fingerprint
from pyspice_runner.sweeps.task import drive_document, law_document, motor_document

_REMEDY = "Remove it, or name another file, to start from the beginning."


@checked
def calibrate(
    motor: Motor,
    data: SkipValidation[str | Path | Mapping[str, Any] | Any] = None,
    *,
    free: Sequence[str],
    spectra: SkipValidation[Sequence[tuple[Any, ...]]] = (),
    connection: Connection = "A",
    spectrum_error: float = SPECTRUM_ERROR,
    transients: SkipValidation[Sequence[Any]] = (),
    priors: Mapping[str, float] | None = None,
    drive: Drive | None = None,
    contact: ContactLaw | None = PAPER_LAW,
    against: Sequence[ContactLaw] = (),
    starts: int | None = None,
    timeout: float | None = None,
    progress: Callable[[int], None] | None = None,
    checkpoint: str | Path | None = None,
) -> Calibration:
    """Calibrate parameters of a motor against measured operating points, spectra and run-ups.

    Args:
        motor: the motor, with the values to start from.
        data: the measured points: path of a CSV file, a dictionary of columns or a pandas table (:mod:`.points`);
            ``None`` without points.
        free: dotted paths of the parameters to calibrate; ``modes.*.quality_factor`` stands for each mode's.
        spectra: measured spectra with the state of the tip, ``"free"`` or ``"preloaded"``, and with
            ``{"temperature": °C, "level": V}``, or one of these, where it is known (:mod:`.spectra`).
        connection: of the groups in the spectra.
        spectrum_error: standard error of a measured admittance, relative to its magnitude.
        transients: measured run-ups from rest, each a table like ``data`` with ``time_s`` (:mod:`.run_up`).
        priors: path of a free parameter → relative standard deviation of its value in ``motor``, as a soft limit.
        drive: what the points leave out; by default the recommended drive.
        contact: law of the contact, as in :func:`~pyspice_runner.simulate`.
        against: other laws, with which the parameters are calibrated too; ``rivals`` of the result compares them.
        starts: number of starts; all but the first change the values that no free spectrum shows, within a factor of 2
            about ``motor``, and ngspice compares them. By default 1, or 16 by the fast model where two modes are closer
            than three half widths.
        timeout: wall time in s after which a run of ngspice is ended.
        progress: called with the number of steady states found so far.
        checkpoint: path of a JSON file in which an unfinished calibration is kept. The same calibration, started again
            with it, goes on there. The file is removed at the end.

    Returns:
        The values with standard errors, intervals, correlations and warnings; ``motor`` of it is the calibrated motor.

    Raises:
        ParameterError: for invalid values, unknown paths, no data, or a ``checkpoint`` that is damaged or belongs to
            another calibration.
        KeyboardInterrupt: when interrupted; the message names the ``checkpoint``, if there is one.
        SimulationError: if the motor has no steady state at any of the points, or ngspice fails.
    """
    if data is None and not spectra and not transients:
        raise ParameterError("There is nothing to calibrate against: give measured points, spectra or transients.")
    require(starts is None or 1 <= starts <= 64, "starts", starts, "a whole number from 1 to 64")
    require(0.0 < spectrum_error < 1.0, "spectrum_error", spectrum_error, "a number > 0 and < 1")
    linear = motor.slider is not None
    points = read_points(data, linear) if data is not None else None
    moving = [RunUp.read(one, number, linear) for number, one in enumerate(transients, start=1)]
    laws = [touching_law(one, "A free tip has no torque.", motor.law) for one in (contact, *against)]
    excitation = drive or default_drive(motor)
    bands = bands_of(spectra, connection, spectrum_error)
    unknowns = unknowns_of(motor, excitation, free, priors, scales(motor, bands), laws[0])
    conditions = [(f"spectrum {number}", one.conditions) for number, one in enumerate(bands, start=1)]
    conditions += [(f"point {row}", one) for row, one in enumerate(points.conditions if points else (), start=1)]
    temperatures = temperatures_of(conditions + [(one.source, one.conditions) for one in moving])
    if any(one.path.startswith(THERMAL) for one in unknowns) and len(set(temperatures)) < 2:
        raise ParameterError(
            "A drift takes spectra, points or run-ups at temperatures that differ; give that of each of them."
        )
    predictors = []
    for law in laws:
        base = Point.of(motor, excitation, contact=law, timeout=timeout, audit=False)
        predictor = Predictor(
            base.with_step(STEP * base.step), unknowns, points, (*bands, *moving),
            temperatures[0] if temperatures else None, counter=Counter(progress or (lambda _: None)),
        )  # fmt: skip
        # a wrong path or value is an error now, not a point that is left out
        predictor.motor(np.zeros(len(unknowns)))
        if points:
            points.check([predictor.point(predictor.base, one) for one in points.conditions])
        for one in moving:
            one.check(predictor.point(predictor.base, one.conditions))
        predictors.append(predictor)
    with Checkpoint(checkpoint, predictors) as file:
        start = fitted(motor, unknowns, spectra, connection)
        searches = [Search(one, file.place(law), partial(file.keep, law), start=start)
                    for law, one in enumerate(predictors)]  # fmt: skip
        found = Judgement(searches[0], searches[0].solved(starts)).calibration()
        others = zip(searches[1:], laws[1:], strict=True)
        return replace(found, rivals=tuple(_rival(search, law.name, starts) for search, law in others))


def _rival(search: Search, law: str, starts: int | None) -> Rival:
    """Return the fit with another law of the contact."""
    try:
        found = Judgement(search, search.solved(starts)).calibration()
    except SimulationError as error:
        return Rival(law, float("nan"), 0, (), str(error))
    return Rival(law, found.aicc, found.freedom, tuple(fit.data for fit in misfits(found.fits)))


# --- an unfinished calibration ---


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
