# SPDX-License-Identifier: GPL-3.0-or-later
"""One transient run of a motor: from a drive and a load to verified waveforms with their energy balance."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from math import isfinite, nan, sqrt
from threading import Event
from typing import Any, Unpack

import numpy as np

from pyspice_runner.circuit.source import FEWEST_POINTS_PER_PERIOD, UNIFORM_POINTS, Excitation
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError, require
from pyspice_runner.interrupts import held
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import audit_run, ceramic, delivering
from pyspice_runner.run.kernel import Outcome, progress_callback
from pyspice_runner.run.point import MOST_POINTS, Point, Settings
from pyspice_runner.run.recording import Recording
from pyspice_runner.run.waveforms import HEATED, OF_TRANSDUCER, EnergyBalance, Waveforms, interpolated
from pyspice_runner.run.window import Array, Window

_USUAL_ERROR = 5e-4  # of the tip's motion, at the default step; more than at nearly all reference points of the tests
_MARGIN = 1.25  # by which an estimate stays below an accuracy that is asked for: estimates are right to about 20 %
_MOST_TRIALS = 5
_FEWEST_KEPT = 10  # points of an interrupted run; fewer show nothing


@checked
def simulate(
    motor: Motor,
    drive: Drive | Excitation,
    duration: float,
    *,
    accuracy: float | None = None,
    thermal: Thermal | None = None,
    exact_resonance: bool = True,
    signals: Sequence[str] | None = None,
    record_from: float = 0.0,
    record_every: int = 1,
    progress: Callable[[float, float], object] | None = None,
    audit: bool = True,
    **settings: Unpack[Settings],
) -> Waveforms:
    """Run a motor from rest under its preload; the drive comes on at t = 0.

    Memory grows with the recorded points, not with the duration; ``signals``, ``record_from`` and ``record_every``
    select them. The energy balance and the audit need all signals at every step, which is the default.

    Args:
        motor: the motor.
        drive: the voltages of both groups, or what makes them: a driver circuit, or a tracker of the last mode; also a
            waveform (:class:`pyspice_runner.circuit.source`).
        duration: simulated time in s.
        accuracy: error allowed of the tip's trajectory, RMS relative to its motion, such as 0.005. The step is chosen
            so that :attr:`Waveforms.error_estimate` stays below it; a given step that is too coarse is an error. By
            default the error is estimated too, by two more runs with coarser steps that take 0.75 times as long;
            a run with a given step, or without the tip among its signals, has no estimate.
        thermal: drift of a motor that its losses heat; the column ``temperature_k`` is then recorded.
        exact_resonance: write the modes so that the trapezoidal rule resonates where they do
            (:class:`~pyspice_runner.circuit.motor.Discretisation`).
        signals: columns to record beside the time; by default all.
        record_from: time in s from which on points are recorded: for a look at the end of a long run.
        record_every: number of steps from one recorded point to the next.
        progress: called several times a second with the fraction that is done, 0 to 1, and the remaining seconds.
        audit: whether findings of the physical audit (:mod:`.audit`) are an error; if not, ``audit`` has them.
        settings: load, contact and solver, as in :class:`.Settings`.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
        Interrupted: when interrupted; ``partial`` has what was done, marked as not complete.
    """
    point = Point.of(
        motor, drive, thermal=thermal, accuracy=accuracy, exact_resonance=exact_resonance, audit=audit, **settings
    )
    return simulated(
        point, duration, signals=signals, record_from=record_from, record_every=record_every, progress=progress
    )


def simulated(
    point: Point,
    duration: float,
    *,
    signals: Sequence[str] | None = None,
    record_from: float = 0.0,
    record_every: int = 1,
    progress: Callable[[float, float], object] | None = None,
) -> Waveforms:
    """Run an operating point from rest; the arguments are those of :func:`simulate`."""
    step, accuracy = point.solver.step, point.solver.accuracy
    if accuracy is not None and step is None:
        # of the fastest motion; the error falls with the square of the points in its period
        points = max(UNIFORM_POINTS * sqrt(_USUAL_ERROR / accuracy), 4.0 * FEWEST_POINTS_PER_PERIOD)
        point = point.with_step(point.shortest_period / points)
    require(isfinite(duration) and duration > 0.0, "duration", duration, "a number > 0 s", unit="s")
    if duration < 10.0 * point.step:
        raise ParameterError(
            f"duration = {duration:g} s is shorter than ten steps of {point.step:g} s; give at least "
            f"{10 * point.step:.3g} s."
        )
    columns = [name for name in Recording(point, point.discretisation).all_columns if name not in HEATED]
    _check_recording(signals, columns, record_from, record_every, duration, point.step)
    judged = TIP if "tip_x_m" in columns else [name for name in columns if name in OF_TRANSDUCER]
    estimate = (step is None or accuracy is not None) and (signals is None or {*judged} <= {*signals})
    if accuracy is not None and not estimate:
        raise ParameterError("accuracy is the error of the tip: signals must have tip_x_m and tip_y_m.")
    for _ in range(_MOST_TRIALS):
        run = _run(point, duration, signals, record_from, record_every, estimate=estimate, progress=progress)
        if accuracy is None:
            return run
        assert run.error_estimate is not None
        error = _MARGIN * run.error_estimate
        if error <= accuracy:
            return run
        finer = point.step * max(0.9 * sqrt(accuracy / error), 0.25)
        if step is not None:
            raise ParameterError(
                f"step = {step:g} s is too coarse for accuracy = {accuracy:g}: its error is about {error:.2g}. "
                f"It must be about {finer:.2g} s; leave the step out, and it is chosen."
            )
        point = point.with_step(finer)
        _check_recording(signals, columns, record_from, record_every, duration, point.step)
    raise SimulationError(
        f"No step down to {point.step / 0.9:.2g} s reached accuracy = {accuracy:g}; the last error was about "
        f"{error:.2g}. The motion is likely chaotic: then only averages can be accurate. Run it with a step of your "
        "own."
    )


def _run(
    setup: Point,
    duration: float,
    signals: Sequence[str] | None,
    start: float,
    every: int,
    *,
    estimate: bool,
    progress: Callable[[float, float], object] | None,
) -> Waveforms:
    """Run an operating point and return its waveforms, audited, with an estimate of their errors if requested.

    The signals are recorded from the start in s on, at every n-th step.
    """
    motor = setup.motor
    recording = Recording(setup, setup.discretisation, start == 0.0)
    balanced = signals is None and every == 1

    def waveforms(outcome: Outcome, *, complete: bool, coarser: CoarserRuns | None = None) -> Waveforms:
        samples = outcome.vectors(every)
        waves = recording.columns(samples, recording.all_columns if signals is None else signals)
        energy: EnergyBalance | None = None
        findings: tuple[str, ...] = ()
        inexact: list[str] = []
        if balanced:
            energy = recording.energy(waves, samples)
            losses = {"friction_loss_w": energy.friction, "normal_loss_w": energy.contact_damping}
            rest = dict.fromkeys(("power_b_w", "shaft_power_w", "damping_loss_w", "dielectric_loss_w"), 0.0)
            # energies stand for the powers of a point
            inexact = list(delivering([{"power_a_w": energy.passed, **losses, **rest}]))
            findings = audit_run(motor, waves, energy, step=setup.step, contact=setup.law is not None)
            if findings and setup.solver.audit and complete:
                Audit(findings).withhold("run")
        errors, interrupted = None, False
        if coarser is not None:
            try:
                errors = coarser.errors(waves)
            except KeyboardInterrupt:
                interrupted = True
            inexact += filter(None, [coarser.missing])
        window = Window(samples["time"], setup.source.measured_period(samples))
        stressed: dict[str, Any] = {"cautions": []}
        if signals is None:
            stressed = ceramic(motor, setup.law, setup.discretisation, samples, setup.source, window)
        provenance: dict[str, Any] = {
            "motor": motor.to_dict(),
            "drive": setup.source.to_dict(),
            "run": {
                "duration_s": duration,
                **setup.to_dict(),
                "accuracy": setup.solver.accuracy,
                "record_from_s": start,
                "record_every": every,
            },
            "deck_sha256": outcome.deck_sha256,
            "audit": {"passed": not findings if balanced else None, "findings": list(findings)},
            **stressed,
            "cautions": [*stressed["cautions"], *inexact],
        }
        arrays: dict[str, Any] = {name: waves.get(name) for name in Waveforms.units}
        found = Waveforms(
            **arrays,
            of_contacts={name: values for name, values in waves.items() if name not in Waveforms.units},
            energy=energy,  # type: ignore[arg-type]
            drive_period_s=window.period,
            rotor_radius_m=nan if motor.is_transducer else motor.rotor.radius_m,
            decay_s=motor.decay_s,
            solver_seconds=outcome.seconds + (errors.seconds if errors else 0.0),
            ngspice_version=outcome.ngspice_version,
            provenance=provenance,
            deck=outcome.deck,
            final_state=setup.motion(outcome.last()) if signals is None else None,
            error_estimate=errors.tip if errors else None,
            speed_error_rad_s=errors.speed_rad_s if errors else None,
            torque_error_n_m=errors.torque_n_m if errors else None,
            complete=complete,
        )
        if interrupted:
            raise Interrupted("The run is complete; the estimate of its error was interrupted.", found)
        return found

    vectors = [*recording.vectors(signals), *setup.source.vectors, *(setup.state_vectors() if signals is None else ())]
    tell = progress_callback(progress, duration * (1.0 + COST if estimate else 1.0)) if progress else None
    recorded = recording.all_columns if signals is None else signals
    beside = CoarserRuns(setup, recorded, duration, record_from=start) if estimate else nullcontext()
    # an interrupt waits until the coarser runs have ended
    with held() as listening, beside as coarser:
        try:
            with listening():
                after = (lambda at: tell(at + coarser.reached_s if coarser else at)) if tell else None
                outcome = setup.run(duration, vectors, record_from=start, progress=after, keep_partial=True)
        except Interrupted as interrupt:
            if interrupt.partial.raw.points < _FEWEST_KEPT:
                raise KeyboardInterrupt from None
            found = waveforms(interrupt.partial, complete=False)
            ended = f"The run was interrupted at {found.time_s[-1]:.4g} of {duration:g} s."
            raise Interrupted(ended, found) from None
        with listening():
            return waveforms(outcome, complete=True, coarser=coarser)


def _check_recording(
    signals: Sequence[str] | None, columns: Sequence[str], record_from: float, record_every: int, duration: float,
    step: float,
) -> None:  # fmt: skip
    for name in signals or ():
        if name not in columns:
            raise ParameterError(f"signals: {name!r} is not valid: it must be one of {', '.join(columns)}.")
    most = max(1, int(min(duration / (10.0 * step), sys.maxsize)))  # the quotient may overflow
    words = f"a whole number of steps from 1 to {most}"
    require(1 <= record_every <= most, "record_every", record_every, words)
    last = max(duration - 10.0 * step * record_every, 0.0)
    words = f"from 0 to {last:.6g} s, ten points before the end"
    require(0.0 <= record_from <= last, "record_from", record_from, words, unit="s")
    points = (duration - record_from) / (step * record_every)
    if points > MOST_POINTS:
        raise ParameterError(
            f"duration = {duration:g} s records {points:.3g} points; at most {MOST_POINTS:.0e} fit in memory. Shorten "
            "it, or record less: record_from for its end, record_every for fewer points."
        )


TIP = ("tip_x_m", "tip_y_m")
JUDGED = (*TIP, "rotor_speed_rad_s", "friction_force_n")
COST = 0.75  # of the run whose error is estimated: half of its steps and a quarter
_ROUNDING = 1e-9  # of the tip's place or static penetration; less is no motion, but the rounding of a solver
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

    They end with the block of a ``with`` statement, whether they are complete or not. ``names`` are the columns that
    the run records from ``record_from`` in s on.
    """

    def __init__(self, setup: Point, names: Collection[str], duration: float, *, record_from: float = 0.0) -> None:
        judged = OF_TRANSDUCER if setup.motor.is_transducer else JUDGED
        self._setup, self._names = setup, [name for name in judged if name in names]
        self._duration, self._record_from = duration, record_from
        self.reached_s = 0.0  # COST times the duration at the end
        self.missing = ""  # why there is no estimate, in a sentence
        self._pool = ThreadPoolExecutor(1)
        self._ended = Event()

    def __enter__(self) -> CoarserRuns:
        self._found = self._pool.submit(self._run)
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._pool.shutdown()

    def _run(self) -> tuple[list[Mapping[str, Array]], float]:
        """Return the columns of the runs up to one that fails, and the wall time in s of ngspice."""
        setup, seconds = self._setup, 0.0
        coarser: list[Mapping[str, Array]] = []
        for factor, before in ((2.0, 0.0), (4.0, 0.5 * self._duration)):
            if factor * setup.step > setup.coarsest_step:
                if factor == 2.0:
                    self.missing = "No error is estimated: the model does not allow twice the step. Give a shorter one."
                break
            trial = setup.with_step(factor * setup.step)
            recording = Recording(trial, trial.discretisation, self._record_from == 0.0)
            vectors = [*recording.vectors(self._names), *setup.source.vectors]
            tell = partial(self._tell, factor, before)
            try:
                outcome = trial.run(self._duration, vectors, record_from=self._record_from, progress=tell)
            except SimulationError as error:
                if factor == 2.0:
                    self.missing = f"No error is estimated, since the run with twice the step failed: {error}"
                break
            except _Ended:
                break
            seconds += outcome.seconds
            coarser.append(recording.columns(outcome.vectors(), self._names))
        return coarser, seconds

    def _tell(self, factor: float, before: float, reached: float) -> None:
        if self._ended.is_set():
            raise _Ended
        self.reached_s = before + reached / factor

    def errors(self, waves: Mapping[str, Array]) -> Errors | None:
        """Return the errors of a run with these columns; ``None`` if the run with twice the step fails.

        Raise SimulationError if it fails and an accuracy is requested.
        """
        coarser, seconds = self._found.result()
        if not coarser and self._setup.solver.accuracy is not None:
            raise SimulationError(self.missing)
        if not coarser:
            return None
        setup, rested = self._setup, self._record_from == 0.0
        depth = float(setup.motor.at_rest.depth_m.max()) if setup.law else 0.0
        distance = partial(_distance, rested=rested, depth_m=depth)
        first = distance(waves, coarser[0])
        opens = setup.law is not None and bool((waves.get("normal_force_n", np.ones(1)) <= 0.0).any())
        second_order = len(coarser) == 2 and not opens and distance(coarser[0], coarser[1]) >= _SECOND_ORDER * first
        speed, force = (_of_mean(name, [waves, *coarser], setup.source.period) for name in JUDGED[2:])
        torque = None if force is None else setup.motor.rotor.radius_m * force  # there is none of a transducer
        return Errors(first / 3.0 if second_order else first, speed, torque, seconds)


class _Ended(Exception):
    """The errors are no longer wanted."""


def _of_mean(name: str, runs: list[Mapping[str, Array]], period: float) -> float | None:
    """Return the estimated error of the mean of a signal."""
    if name not in runs[0]:
        return None
    means = [Window(run["time_s"], period).mean(run[name]) for run in runs]
    return float(sum(weight * abs(a - b) for weight, a, b in zip((1.0, 0.5), means[:-1], means[1:], strict=False)))


def _distance(fine: Mapping[str, Array], coarse: Mapping[str, Array], rested: bool, depth_m: float) -> float:
    """Return the RMS distance of two tips of a static penetration over the RMS of the motion; 0 if they do not move.

    The place of rest under the preload depends a little on the step. Where the runs began at ``rested``, motions are
    counted from there; they are otherwise a multiple of themselves apart where the drive is weak.
    """
    time = fine["time_s"]
    time = time[(time >= coarse["time_s"][0]) & (time <= coarse["time_s"][-1])]
    first = int(np.searchsorted(fine["time_s"], time[0])) if len(time) else 0
    away, motion = 0.0, 0.0
    for name in TIP if "tip_x_m" in coarse else [name for name in OF_TRANSDUCER if name in coarse]:
        ours = fine[name][first : first + len(time)]
        difference = ours - interpolated(coarse["time_s"], coarse[name], time)
        away += float(np.mean((difference - (difference[0] if rested else 0.0)) ** 2))
        motion += float(np.var(ours)) if np.std(ours) > _ROUNDING * max(abs(float(np.mean(ours))), depth_m) else 0.0
    return sqrt(away / motion) if motion > 0.0 else 0.0
