# SPDX-License-Identifier: GPL-3.0-or-later
"""Discretisation error of a run, estimated from the same run with two and four times its step.

The trapezoidal rule is of second order: the error of the trajectory is then a third of its distance from that at twice
the step. The whole distance is taken where the two distances do not show that order, and where the contact opens:
impacts break the order, although two distances may show it by chance. Changes of state between two steps move the means
by varying amounts, so that the absolute changes of a mean are added.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import sqrt
from threading import Event

import numpy as np

from pyspice_runner.errors import SimulationError
from pyspice_runner.run.point import Point
from pyspice_runner.run.sequences import interpolated
from pyspice_runner.run.window import Array, Window

TIP = ("tip_x_m", "tip_y_m")
JUDGED = (*TIP, "rotor_speed_rad_s", "friction_force_n")
COST = 0.75  # of the run whose error is estimated: half of its steps and a quarter
_ROUNDING = 1e-9  # of the tip's place; less is no motion, but the rounding of a solver
_SECOND_ORDER = 2.5  # ratio of the distances from twice to four times the step; 4 where the error is of second order


@dataclass(frozen=True)
class Errors:
    """Estimated errors of a run."""

    tip: float  # of the tip's trajectory, RMS relative to its motion
    speed_rad_s: float | None  # of the mean rotor speed; ``None`` if it was not recorded
    torque_n_m: float | None  # of the mean torque; ``None`` if it was not recorded
    seconds: float  # wall time in s that ngspice took for the estimate


class CoarserRuns:
    """The runs with twice and four times the step, in a thread beside the run whose error they estimate.

    They end with the block of a ``with`` statement, whether they are complete or not.
    """

    def __init__(
        self,
        setup: Point,
        names: Collection[str],
        duration: float,
        *,
        record_from: float = 0.0,
    ) -> None:
        """Prepare the runs.

        Args:
            setup: the operating point of the run, with its step.
            names: columns that the run records.
            duration: simulated time in s.
            record_from: begin of the record, s.
        """
        self._setup, self._names = setup, [name for name in JUDGED if name in names]
        self._duration, self._record_from = duration, record_from
        self.reached_s = 0.0  # COST times the duration at the end
        self._pool = ThreadPoolExecutor(1)
        self._ended = Event()

    def __enter__(self) -> CoarserRuns:
        self._found = self._pool.submit(self._run)
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._pool.shutdown()

    def _run(self) -> tuple[list[Mapping[str, Array]], float] | None:
        """Return the columns of both runs and the wall time in s of ngspice; ``None`` if a run fails."""
        setup, seconds = self._setup, 0.0
        coarser: list[Mapping[str, Array]] = []
        for factor, before in ((2.0, 0.0), (4.0, 0.5 * self._duration)):
            if factor * setup.step > setup.coarsest_step:
                break
            trial = setup.with_step(factor * setup.step)
            recording = trial.recording(started=self._record_from == 0.0)
            vectors = [*recording.vectors(self._names), *setup.source.vectors]
            tell = partial(self._tell, factor, before)
            try:
                outcome = trial.run(self._duration, vectors, record_from=self._record_from, progress=tell)
            except (SimulationError, _Ended):
                return None
            seconds += outcome.seconds
            coarser.append(recording.columns(outcome.vectors(), self._names))
        return coarser, seconds

    def _tell(self, factor: float, before: float, reached: float) -> None:
        if self._ended.is_set():
            raise _Ended
        self.reached_s = before + reached / factor

    def errors(self, waves: Mapping[str, Array]) -> Errors | None:
        """Return the errors of a run with these columns; ``None`` if a coarser run fails, or its step is too long."""
        found = self._found.result()
        if found is None or not found[0]:
            return None
        coarser, seconds = found
        setup, rested = self._setup, self._record_from == 0.0
        first = _distance(waves, coarser[0], rested)
        opens = setup.law is not None and bool((waves.get("normal_force_n", np.ones(1)) <= 0.0).any())
        second_order = (
            len(coarser) == 2 and not opens and _distance(coarser[0], coarser[1], rested) >= _SECOND_ORDER * first
        )
        speed, force = (_of_mean(name, [waves, *coarser], setup.source.period) for name in JUDGED[2:])
        return Errors(
            first / 3.0 if second_order else first,
            speed,
            None if force is None else setup.motor.rotor.radius_m * force,
            seconds,
        )


class _Ended(Exception):
    """The errors are no longer wanted."""


def _of_mean(name: str, runs: list[Mapping[str, Array]], period: float) -> float | None:
    """Return the estimated error of the mean of a signal."""
    if name not in runs[0]:
        return None
    means = [Window(run["time_s"], period).mean(run[name]) for run in runs]
    weights = (1.0, 0.5)
    return float(sum(weight * abs(a - b) for weight, a, b in zip(weights, means[:-1], means[1:], strict=False)))


def _distance(fine: Mapping[str, Array], coarse: Mapping[str, Array], rested: bool) -> float:
    """Return the RMS distance of two tips over the RMS of the motion; 0 for a tip that does not move.

    The place of rest under the preload depends a little on the step. Where the runs began at ``rested``, motions are
    counted from there; they are otherwise a multiple of themselves apart where the drive is weak.
    """
    time = fine["time_s"]
    time = time[(time >= coarse["time_s"][0]) & (time <= coarse["time_s"][-1])]
    first = int(np.searchsorted(fine["time_s"], time[0])) if len(time) else 0
    away, motion = 0.0, 0.0
    for name in TIP:
        ours = fine[name][first : first + len(time)]
        difference = ours - interpolated(coarse["time_s"], coarse[name], time)
        away += float(np.mean((difference - (difference[0] if rested else 0.0)) ** 2))
        motion += float(np.var(ours)) if np.std(ours) > _ROUNDING * abs(np.mean(ours)) else 0.0
    return sqrt(away / motion) if motion > 0.0 else 0.0
