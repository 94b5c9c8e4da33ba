# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs with a resonance tracker, and whether it found the resonance and stayed there.

The measure is the phase of the velocity of the mode against the force of the groups on it, in every period. The tracker
does not see this phase, so an error of its sensing counts as an error.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from math import degrees, isfinite, pi, sqrt
from typing import Any, Unpack

import numpy as np

from pyspice_runner.averaged.library import check_averaged, require_averaged
from pyspice_runner.averaged.run import ErrorEstimate, Estimated
from pyspice_runner.averaged.simulate import averaged_ceramic
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, law_of
from pyspice_runner.circuit.motor import force_vectors
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.motor.drive import Load, ideal_drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Audit, Result, contact_row
from pyspice_runner.run.audit import audit_contact, ceramic, modal_vectors
from pyspice_runner.run.kernel import Outcome, progress_callback
from pyspice_runner.run.point import MOST_POINTS, Point, RunSettings, Solver
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, Array, has_settled
from pyspice_runner.run.window import Window, averaged_to_come, change_to_come
from pyspice_runner.spice import Engine
from pyspice_runner.steady.transducer import heavier
from pyspice_runner.trackers import tracker as parts
from pyspice_runner.trackers.averaged import AveragedTrack, TrackedRun, replayed, run_averaged
from pyspice_runner.trackers.loop import Complex, LoopDesign, by_group, copies, running_loop
from pyspice_runner.trackers.tracker import SMOOTHED_PERIODS, Disturbances, StatorLag, TrackedSource, Tracker
from pyspice_runner.units import engineering, unit_in

LOCKED_DEG = 20.0  # closer to the target is locked: a resonator has 94 % of its largest amplitude or more
BUILT_UP = 3.0  # time constants after which a mode's amplitude is within 5 % of its end
WARM_K = 50.0  # rise of the temperature at which the drift of the sensing is judged
CROSSINGS = 4  # of the target in the second half of a run, with which a loop oscillates: two cycles
HUNTS_DEG = 5.0  # peak to peak in both quarters of it, from which on a locked loop hunts, assumed
SAME = 1e-6  # relative difference of couplings that rounding explains
AT_LIMIT = 0.98  # of half the oscillator's range: the charge pump turns off over the last 50 mV of 5 V


@dataclass(frozen=True)
class Sensing:
    """Drift of the sensed motional current: the clamped capacitances warm up, their copies do not, or less."""

    capacitance_drift_per_k: float  # relative drift of the clamped capacitances that their copies do not follow, 1/K
    phase_drift_deg_per_k: float  # by which the loop moves the phase of the mode's velocity per kelvin
    frequency_drift_hz_per_k: float  # by which it thus moves the frequency away from the one wanted


@dataclass(frozen=True)
class LostLock:
    """A loss of lock: the phase error exceeds 60°. It is regained when the error stays within 20° for 20 periods."""

    lost_s: float  # time at which lock is lost
    lost_hz: float  # drive frequency then, the pull-out frequency
    regained_s: float | None = None  # time from which on it is regained; ``None`` if it is not in the run
    regained_hz: float | None = None  # drive frequency then
    # what the disturbances have changed when it is lost: the load in N·m, others as :class:`.Disturbance`
    pull_out: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class Tracking(Estimated, Result):
    """A run with a tracker.

    Attributes:
        locked: whether it locked before the disturbance, and is locked at the end; false without a tracker.
        lock_time_s: time after which it stays locked until the disturbance; ``None`` if it does not.
        kept_lock: whether the phase came within 20° of its target before the disturbance, and stayed within 60°.
        rms_phase_error_deg: of the mode's velocity, from lock to the end; from the start without lock.
        worst_phase_error_deg: largest deviation, averaged over 20 periods, in the same time.
        residual_detuning_hz: drive frequency minus the frequency at which the phase has its target, at the end.
        static_phase_error_deg: phase of the mode's velocity minus its target, mean at the end.
        end_frequency_hz: mean frequency at the end.
        resonance_reached_hz: frequency at which the velocity would be in phase, by the phase at the end and ``lag``.
        speed_before_rad_s: speed when the disturbance began.
        speed_after_rad_s: speed at the end.
        speed_lost_rad_s: speed before the disturbance minus the lowest speed after it began.
        stall_torque_n_m: torque on a held shaft; measured only if the load step is to be half of it.
        to_come: expected further relative change of the speed; ``None`` after too short a time or for a held shaft.
        lag: resonance and loaded quality factor of the mode, for which the filter was designed.
        loop_filter: filter of a phase-locked loop.
        settings: motor, tracker, disturbances and run, JSON-ready.
        time_s: middle of each period.
        frequency_hz: frequency of each period.
        phase_deg: of the mode's velocity ahead of the force, each period.
        rotor_speed_rad_s: mean of each period.
        solver_seconds: wall time that the engine took.
        ngspice_version: version of ngspice; ``None`` of a run with the compiled motor.
        deck: netlist of the run; ``None`` where ngspice has no model of it.
        losses: losses of lock after the lock time.
        restarts_s: times at which a restart began.
        audit: outcome of the physical audit; it has findings only with ``audit=False``.
        ceramic: strain, stress and temperature rise of the ceramic, and ``cautions``; empty where not measured.
        temperature_k: of the stator above that at which its parameters hold; averaged runs only.
        model_cautions: modes that the groups cannot separate.
        find_error: returns the estimate of the errors of an averaged run.
        loop: gain and margin of a locked phase-locked loop in front of the running motor at the end, else ``None``.
        no_loop: why a locked loop has no ``loop``.
        sensing: how the sensing of a phase-locked loop drifts with the temperature of the stator.
    """

    locked: bool
    lock_time_s: float | None
    kept_lock: bool
    rms_phase_error_deg: float
    worst_phase_error_deg: float
    residual_detuning_hz: float
    static_phase_error_deg: float
    end_frequency_hz: float
    resonance_reached_hz: float
    speed_before_rad_s: float
    speed_after_rad_s: float
    speed_lost_rad_s: float
    stall_torque_n_m: float | None
    to_come: float | None
    lag: StatorLag
    loop_filter: parts.LoopFilter
    settings: dict[str, Any]
    time_s: Array = field(repr=False)
    frequency_hz: Array = field(repr=False)
    phase_deg: Array = field(repr=False)
    rotor_speed_rad_s: Array = field(repr=False)
    solver_seconds: float
    ngspice_version: str | None
    deck: str | None = field(repr=False)
    losses: tuple[LostLock, ...] = ()
    restarts_s: tuple[float, ...] = ()
    audit: Audit = field(default_factory=Audit)
    ceramic: dict[str, Any] = field(default_factory=dict)
    temperature_k: Array | None = field(default=None, repr=False)
    model_cautions: tuple[str, ...] = ()
    find_error: Callable[[], ErrorEstimate] = field(default=ErrorEstimate, repr=False)
    loop: LoopDesign | None = None
    no_loop: str = ""
    sensing: Sensing | None = None

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.settings["motor"]

    @property
    def of_transducer(self) -> bool:
        """Whether the device is a transducer: the speeds are then amplitudes of the mode's motional current in A."""
        return "contact" not in self.settings["motor"]

    def _localised(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return a document, columns or a summary, of a transducer with its motional current for the speed."""
        if not self.of_transducer:
            return super()._localised(found)
        flow = {"rotor_speed_rad_s": "motional_current_a"}
        flow |= {f"speed_{when}_rad_s": f"motional_current_{when}_a" for when in ("before", "after", "lost")}
        return {
            flow.get(name, name.replace("speed", "motional current") if isinstance(value, str) else name):
            value.replace(" rad/s", " A") if isinstance(value, str) else value
            for name, value in found.items()
        }  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the result, JSON-ready."""
        names = (
            "locked", "lock_time_s", "kept_lock", "losses", "restarts_s",
            "rms_phase_error_deg", "worst_phase_error_deg",
            "residual_detuning_hz", "static_phase_error_deg", "end_frequency_hz", "design_frequency_hz",
            "resonance_reached_hz", "speed_before_rad_s", "speed_after_rad_s",
            "speed_lost_rad_s", "stall_torque_n_m", "settled", "to_come",
        )  # fmt: skip
        return self._localised({
            **self._entries(*names),
            "lag": {**asdict(self.lag), "time_constant_s": self.lag.time_constant_s},
            **self._entries("loop", "loop_filter", "sensing"),
            **self.settings,
            "periods": len(self.time_s),
            **self._entries("solver_seconds", "ngspice_version", "audit"),
            **({} if self.temperature_k is None else {"temperature_k": float(self.temperature_k[-1])}),
            **({} if self.temperature_k is None else self._entries("trusted", "error_estimate")),
            **self.ceramic,
            "cautions": list(self.cautions),
        })  # fmt: skip

    @property
    def settled(self) -> bool | None:
        """Whether the speed would stay within 2 % in a longer run; ``None`` for a held shaft."""
        if self.settings["run"]["speed_rad_s"] is not None:
            return None
        return has_settled(self.to_come)

    def _lock(self) -> Iterator[str]:
        """Yield losses of lock, or that the tracker ended at a limit of its oscillator or without lock; what to do."""
        tracker, lost = self.settings["tracker"], self.lock_time_s is not None
        at_limit = abs(self.end_frequency_hz / tracker["frequency"] - 1.0) > AT_LIMIT * tracker["span"]
        if tracker["kind"] == "none":
            return
        if self.losses:
            yield f"The tracker lost lock: {self._lost_words}. Raise the voltage or the bandwidth, or load it less."
        late = 1e-3 * self.frequency_hz[self.time_s >= 0.5 * self.time_s[-1]]
        swing = f"from {late.min():.6g} to {late.max():.6g} kHz"
        if self.locked and not at_limit:
            if self._swing_deg > HUNTS_DEG:
                yield f"The loop hunts to the end, {swing}. Raise the voltage, or move the target towards 0."
            return
        advice = "Run it longer (duration), start nearer to the resonance (offset), or raise the voltage."
        if at_limit:
            advice = "Start nearer to the resonance (offset), widen the range (span), or reverse the polarity."
        elif tracker["kind"] != "pll":
            advice = (
                "Run it longer (duration), or start nearer to the resonance (offset). Where what it observes has no "
                "maximum at resonance, use observe-current or a pll."
            )
        elif self._swing_deg > 2.0 * LOCKED_DEG:
            advice = f"It oscillates {swing}. Raise the voltage, or move the target towards 0."
        yield (
            f"The tracker {'is locked' if self.locked else 'has lost lock' if lost else 'has not locked'}: it ended at "
            f"{1e-3 * self.end_frequency_hz:.6g} kHz{', the limit of its oscillator' if at_limit else ''}, "
            f"{self.static_phase_error_deg:.3g}° from its target, by design {1e-3 * self.design_frequency_hz:.6g} kHz. "
            + advice
        )

    @property
    def _swing_deg(self) -> float:
        """Swing of a loop's phase about its target in the second half of a run, the smaller of both quarters; or 0."""
        error = self.phase_deg[self.time_s >= 0.5 * self.time_s[-1]] - self._wanted_deg
        if self.temperature_k is None:  # periods of a full motor, with the ripple of its contact
            error = np.convolve(error, np.full(SMOOTHED_PERIODS, 1.0 / SMOOTHED_PERIODS), "valid")
        about = self.settings["tracker"]["kind"] == "pll" and np.count_nonzero(np.diff(np.sign(error))) >= CROSSINGS
        return float(min(map(np.ptp, np.array_split(error, 2)))) if about else 0.0

    @property
    def _lost_words(self) -> str:
        """When and where lock was lost and regained, of the first loss."""
        first, *others = self.losses
        words = f"at {engineering(first.lost_s, 's')} and {1e-3 * first.lost_hz:.5g} kHz"
        words += "".join(f", {kind} {value:.3g}" for kind, value in first.pull_out.items())
        if first.regained_s is None or first.regained_hz is None:
            return f"{words}, not regained"
        words += f", regained at {engineering(first.regained_s, 's')} and {1e-3 * first.regained_hz:.5g} kHz"
        return words + (f", and {len(others)} more" if others else "")

    def _limits(self) -> Iterator[str]:
        """Yield whether it is not locked, whether the mode's motion has not built up, and limits of the ceramic."""
        yield from (*self._lock(), *self.model_cautions, *self._doubts())
        lasted = float(self.time_s[-1] - self.time_s[0])
        if lasted < BUILT_UP * self.lag.time_constant_s:
            yield (
                f"The run of {engineering(lasted, 's')} is shorter than {BUILT_UP:g} time constants of the mode, "
                f"{engineering(self.lag.time_constant_s, 's')} each: the motion has not built up, and the end "
                f"frequency is known within ±{engineering(0.5 / (np.pi * lasted), 'Hz')} only. Run it longer."
            )
        if self.speed_after_rad_s * self.speed_before_rad_s < 0.0 and self.settings["run"]["speed_rad_s"] is None:
            yield "The motor turns backwards at the end. Lower the load, or raise the voltage."
        if self.no_loop:
            yield f"The loop gain of the running motor is not known: {self.no_loop}"
        moved = WARM_K * self.sensing.phase_drift_deg_per_k if self.sensing else 0.0
        if abs(moved) > LOCKED_DEG:
            yield (
                f"The copies of the clamped capacitances do not warm up: {WARM_K:g} K move the phase by {moved:.2g}°. "
                "Let the copies follow the temperature (--compensate), or match them where the motor runs."
            )
        yield from self.ceramic.get("cautions", ())

    def columns(self) -> dict[str, Array]:
        """Return frequency, phase and speed of each period over time; for an averaged run also the temperature."""
        names = ("time_s", "frequency_hz", "phase_deg", "rotor_speed_rad_s")
        heated = {} if self.temperature_k is None else {"temperature_k": self.temperature_k}
        return self._localised({name: getattr(self, name) for name in names} | heated)

    def summary(self) -> dict[str, str]:
        """Return lock, phase error, and the speeds before and after the disturbance."""
        tracker = self.settings["tracker"]
        rows = {
            "transducer" if self.of_transducer else "motor": str(self.settings["motor"]["name"]),
            "tracker": str(tracker["kind"]),
            "mode": str(self.settings["motor"]["modes"][self.settings["run"]["mode"]]["name"]),
            "drive": f"{engineering(tracker['voltage'], 'V')}, target {tracker['target_deg']:g}°",
            "disturbance": ", ".join(map(_event_words, self.settings["disturbances"])),
            **contact_row(self.settings["run"]),
            "locked": f"yes{', but it hunts' if self._swing_deg > HUNTS_DEG else ''}" if self.locked else "no",
            "lock time": "–" if self.lock_time_s is None else engineering(self.lock_time_s, "s"),
            **({"lock lost": self._lost_words} if self.losses else {}),
            **({"restarts": f"{len(self.restarts_s)}"} if self.restarts_s else {}),
            "phase error": f"{self.rms_phase_error_deg:.3g}° RMS, {self.worst_phase_error_deg:.3g}° at most",
            "static phase error": f"{self.static_phase_error_deg:.3g}° of the mode",
            "residual detuning": engineering(self.residual_detuning_hz, "Hz"),
            "frequency reached": f"{1e-3 * self.end_frequency_hz:.6g} kHz, by design "
            f"{1e-3 * self.design_frequency_hz:.6g} kHz",
            "running resonance": f"{1e-3 * self.resonance_reached_hz:.6g} kHz at the end, by design "
            f"{self.lag.resonance_hz / 1e3:.6g} kHz with Q = {self.lag.quality:.3g}",
            "speed": f"{self.speed_before_rad_s:.4g} rad/s before, {self.speed_after_rad_s:.4g} rad/s at the end"
            + (", not settled" if self.settled is False else ""),
            "speed lost": f"{self.speed_lost_rad_s:.3g} rad/s",
        }
        if self.settings["driver"]:
            rows["driver"] = self.settings["driver"]["label"]
        if self.temperature_k is not None:
            rows["temperature rise at the end"] = f"{self.temperature_k[-1]:.3g} K"
            rows |= self._trust()
        if self.stall_torque_n_m is not None:
            rows["stall torque"] = engineering(self.stall_torque_n_m, "N·m")
        if tracker["kind"] == "pll":
            rows["loop filter"] = ", ".join(map(engineering, asdict(self.loop_filter).values(), ("Ω", "F", "F")))
        if self.sensing is not None:
            drift = engineering(self.sensing.frequency_drift_hz_per_k, "Hz")
            rows["drift of the sensing"] = f"{self.sensing.phase_drift_deg_per_k:.2g}° and {drift} per kelvin"
        if self.loop is not None:
            error = f" ± {self.loop.margin_error_deg:.1g}°" if self.loop.margin_error_deg else ""
            rows["phase margin"] = f"{self.loop.phase_margin_deg:.1f}°{error} at {self.loop.crossover_hz:.4g} Hz"
            if self.loop.sensed_phase_deg is not None:
                sensed = self.loop.sensed_phase_deg - self._wanted_deg
                rows["static phase error"] += f", {sensed:.2g}° of the sensed current"
        return self._localised(rows)

    @property
    def design_frequency_hz(self) -> float:
        """Frequency at which the mode has the target phase by design, at the end."""
        return self.lag.resonance_hz + self.lag.detuning_hz(self._wanted_deg)

    @property
    def _wanted_deg(self) -> float:
        """Target phase at the end."""
        steps = [one["target_step_deg"] for one in self.settings["disturbances"] if one["kind"] == "target"]
        return Tracker(**self.settings["tracker"]).wanted_deg + (steps[-1] if steps else 0.0)


@dataclass(frozen=True)
class Periods:
    """Course of a run with a tracker: one point a period, or the points of an averaged run."""

    time: Array
    frequency: Array
    phase: Array
    speed: Array
    restart: Array  # above 0.5 during a restart
    weight: Array | None = None  # time of each point of an averaged run; None for periods

    def smoothed(self, values: Array) -> Array:
        """Return the means of the last 20 periods; an averaged run has no ripple."""
        if self.weight is not None:
            return values
        last = np.arange(1, values.size + 1)
        first = np.maximum(last - SMOOTHED_PERIODS, 0)
        summed = np.concatenate(([0.0], np.cumsum(values)))
        return np.asarray((summed[last] - summed[first]) / (last - first))

    def losses(self, error: Array, first: int, disturbances: Disturbances) -> tuple[LostLock, ...]:
        """Return the losses of lock from a point on, by the smoothed phase error in degrees."""
        time, frequency, found = self.time, self.smoothed(self.frequency), list[LostLock]()
        outside = np.where(np.abs(error) >= LOCKED_DEG, time, time[-1])
        held = np.minimum.accumulate(outside[::-1])[::-1] - time >= SMOOTHED_PERIODS / frequency
        far = np.abs(error) >= parts.LOST_DEG
        while far[first:].any():
            first += int(np.argmax(far[first:]))
            back = first + int(np.argmax(held[first:]))
            lost_s, lost_hz, ends_s, ends_hz = (float(of[at]) for at in (first, back) for of in (time, frequency))
            back_s, back_hz = (ends_s, ends_hz) if held[back] else (None, None)
            found.append(LostLock(lost_s, lost_hz, back_s, back_hz, pull_out=disturbances.at(lost_s)))
            first = back if held[back] else error.size
        return tuple(found)

    def mean(self, values: Array, where: Any) -> float:
        """Return the mean of a part of the course over time."""
        return float(np.average(values[where], weights=None if self.weight is None else self.weight[where]))

    def to_come(self, begin: float) -> float | None:
        """Return the expected further relative change of the speed, from the part after a time in s."""
        time, speed = self.time, self.speed
        if self.weight is None:
            since = time >= begin
            change = change_to_come(time[since], speed[since], float(np.mean(np.diff(time[since]))))
        else:
            change = averaged_to_come(time, speed, begin)
        scale = abs(float(np.mean(speed[-SMOOTHED_PERIODS:]))) + ROUNDING_RAD_S
        return change / scale if isfinite(change) else None


def judged(
    run: TrackedRun, periods: Periods, outcome: Outcome | AveragedTrack, settings: Mapping[str, Any], **more: Any
) -> Tracking:
    """Return lock, phase errors and speeds of a run; ``settings`` are those of the run, ``more`` further fields.

    Raise ParameterError for a disturbance that begins too early.
    """
    setup, disturbances, tracker, time = run.setup, run.source.disturbances, run.source.tracker, periods.time
    wanted = tracker.wanted_deg + np.interp(time, *np.transpose(disturbances.course("target")))
    error = periods.smoothed(periods.phase - wanted)
    speed = periods.smoothed(periods.speed)
    disturbed = disturbances.begin_s is not None
    begin = float(time[-1]) if disturbances.begin_s is None else disturbances.begin_s
    averaged = periods.weight is not None
    before = np.flatnonzero(time <= begin)
    earliest = int(np.searchsorted(time, SMOOTHED_PERIODS / tracker.frequency)) if averaged else SMOOTHED_PERIODS
    if begin < 2 * SMOOTHED_PERIODS / tracker.frequency if averaged else before.size < 2 * SMOOTHED_PERIODS:
        raise ParameterError(f"begin = {begin:g} s is not valid; the disturbance needs 40 periods before it.")
    far = np.flatnonzero(np.abs(error[before]) > LOCKED_DEG)
    first = int(far[-1]) + 1 if far.size else earliest
    # locked for at least the last tenth before the disturbance
    acquired = first < before.size and time[first] <= 0.9 * begin
    tracked = tracker.kind != "none"
    since = slice(first if acquired else 0, None)
    last = time >= time[-1] - max(
        0.1 * (time[-1] - (begin if disturbed else 0.0)), SMOOTHED_PERIODS / run.lag.resonance_hz
    )
    losses = periods.losses(error, first, disturbances) if acquired else ()
    end_phase = min(max(periods.mean(periods.phase, last), -89.9), 89.9)
    speed_before = float(speed[before[-1]])
    since_begin = speed[before[-1] :] if disturbed else speed[-1:]
    return Tracking(
        locked=bool(tracked and acquired and np.all(np.abs(error[last]) < LOCKED_DEG)),
        lock_time_s=float(time[first]) if tracked and acquired else None,
        kept_lock=bool(acquired and not losses),
        losses=losses if tracked else (),
        restarts_s=tuple(time[1:][np.diff(periods.restart > 0.5) & (periods.restart[1:] > 0.5)].tolist()),
        rms_phase_error_deg=sqrt(periods.mean((periods.phase - wanted) ** 2, since)),
        worst_phase_error_deg=float(np.abs(error[since]).max()),
        residual_detuning_hz=run.lag.detuning_hz(end_phase) - run.lag.detuning_hz(float(wanted[-1])),
        static_phase_error_deg=end_phase - float(wanted[-1]),
        end_frequency_hz=(reached := periods.mean(periods.frequency, last)),
        resonance_reached_hz=reached - run.lag.detuning_hz(end_phase),
        speed_before_rad_s=speed_before,
        speed_after_rad_s=float(speed[-1]),
        to_come=periods.to_come(begin if disturbed else 0.0) if setup.load.speed is None else None,
        speed_lost_rad_s=float(speed_before - since_begin.min()),
        stall_torque_n_m=run.stall_torque_n_m,
        lag=run.lag,
        loop_filter=run.source.loop_filter,
        settings={
            "motor": setup.motor.to_dict(),
            "tracker": tracker.model_dump(),
            "disturbance": disturbances.events[0].to_dict() | {"begin_s": disturbances.begin_s},
            "disturbances": [one.to_dict() for one in disturbances.events],
            "driver": run.source.driver.to_dict() if run.source.driver else None,
            "run": settings,
        },
        time_s=time,
        frequency_hz=periods.frequency,
        phase_deg=periods.phase,
        rotor_speed_rad_s=periods.speed,
        solver_seconds=outcome.seconds,
        ngspice_version=outcome.ngspice_version,
        deck=outcome.deck,
        **more,
    )


STALL_TIME_S = 6e-3
HARMONICS_OF_FORCE = 15  # behind a bridge; at 250 points a period and more


@checked
def track(
    motor: Motor,
    tracker: Tracker,
    duration: float | None = None,
    *,
    disturb: parts.DisturbanceKind = "start",
    disturbances: Sequence[parts.Disturbance] = (),
    mode: int | None = None,
    begin: float | None = None,
    load_torque: float | None = None,
    preload_change: float = 0.3,
    supply_change: float = -0.3,
    drift: float = -0.02,
    drift_time: float = 50e-3,
    thermal: Thermal | None = None,
    target_step: float = 10.0,
    load_factor: float = 2.0,
    speed: float | None = None,
    driver: Driver | None = None,
    averaged: bool = False,
    margin: bool = True,
    engine: Engine = "auto",
    audit: bool = True,
    progress: Callable[[float, float], object] | None = None,
    **settings: Unpack[RunSettings],
) -> Tracking:
    """Track a mode of a motor from rest, under a disturbance.

    The averaged motor takes milliseconds for minutes of motor time, with a ``"pll"`` or no tracker; docs/tracking.md.

    Args:
        motor: the motor.
        tracker: the tracker and its two-phase drive; ``tracker.offset`` is its initial detuning.
        disturb: ``"start"``: only the start; ``"target"``: a step of the target phase; ``"load"``: a load torque;
            ``"preload"``: a change of the static normal force; ``"supply"``: a change of the supply;
            ``"temperature"``: a drift of all frequencies; ``"warm-up"``, averaged only: the losses heat the stator.
        disturbances: several disturbances in place of ``disturb``; each moves a value from the last one of its kind.
        mode: index of the mode to follow, from 0; by default the last.
        begin: start of the disturbance, s; by default when the tracker, and the mode of a transducer, have settled.
        duration: simulated time, s; by default some time after the disturbance.
        load_torque: torque of the load in N·m; by default half the stall torque, which takes a run with the shaft held.
        load_factor: of a transducer, damping of the mode after the step of the load over that before.
        preload_change: relative change of the preload.
        supply_change: relative change of the supply: the rails of a driver, without one the voltages.
        drift: relative drift of the frequencies.
        drift_time: duration of the drift, s.
        thermal: coefficients of the drift; by default of frequencies only, in a warm-up those of :meth:`Thermal.of`.
        target_step: step of the target phase of a phase-locked loop, degrees.
        speed: if given, the shaft is held at this speed, rad/s.
        driver: circuit between tracker and the motor's pins, where the tracker senses; it sets voltages and phase.
        averaged: whether to track the averaged motor.
        margin: whether to find the loop gain of a locked loop at the end; of the full motor this takes about 1 s.
        engine: of the averaged motor, as in :func:`simulate_averaged`; ngspice runs the full motor.
        audit: whether findings of the physical audit are an error; if not, ``audit`` of the result has them.
        progress: of the full motor, as in :func:`simulate`.
        settings: contact and solver, as in :class:`.RunSettings`.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    contact = None if motor.is_transducer else settings.get("contact", PAPER_LAW)
    law = law_of(contact, motor.law)
    mode = motor.main_mode if mode is None else mode
    if disturbances and disturb != "start":
        raise ParameterError(f"disturb = {disturb!r} and disturbances exclude each other. Give one.")
    built_up = (BUILT_UP + 1.0) * motor.loaded_stator.decay_s if motor.is_transducer else 0.0
    begin = max(_settled(tracker, disturb), built_up) if begin is None else begin
    one = parts.Disturbance(
        kind=disturb, begin_s=begin, load_torque_n_m=load_torque or 0.0, preload_change=preload_change, drift=drift,
        supply_change=supply_change, drift_time_s=drift_time, target_step_deg=target_step,
        thermal={"temperature": thermal, "warm-up": thermal or Thermal.of(motor)}.get(disturb),
        load_change_n_s_per_m=heavier(motor, mode, load_factor) if disturb == "load" and motor.is_transducer else None,
    )  # fmt: skip
    sequence = Disturbances(tuple(sorted(disturbances, key=lambda one: one.begin_s)) or (one,))
    _check_together(motor, tracker, mode, sequence, contact, speed)
    if averaged:
        _ = motor.rotor  # of a transducer an error
        check_averaged(contact)
        allowed = "'current' of the averaged motor; leave averaged out to sense the electrode"
        require(tracker.sense == "current", "sense", tracker.sense, allowed)
        motor = require_averaged(motor)
        if settings.get("step") is not None:
            raise ParameterError("step has no effect on an averaged run, whose engine chooses its steps. Leave it out.")
    elif engine == "compiled":
        raise ParameterError("engine = 'compiled' has no tracker for the full motor: give averaged=True, or 'spice'.")
    elif sequence.of("warm-up"):
        raise ParameterError("disturb = 'warm-up' takes minutes of motor time: give averaged=True, or 'temperature'.")
    lag = parts.running_resonance(motor, tracker, mode=mode, contact=law is not None)
    source = TrackedSource(tracker, mode, parts.propose_filter(tracker, lag), driver)
    setup = Point(
        motor, source, Load(speed), law, Solver(settings.get("step"), timeout=settings.get("timeout"), audit=audit)
    )
    if duration is None:
        last = max(sequence.events, key=lambda one: one.end_s)
        duration = last.end_s + {"start": 0.0, "temperature": 2e-3}.get(last.kind, max(12e-3, built_up))
    if not averaged:
        _check_duration(setup, source, duration)
    seen = sequence.end_s + 2 * SMOOTHED_PERIODS / tracker.frequency
    if sequence.begin_s is not None and duration < seen:
        raise ParameterError(
            f"duration = {duration:g} s does not show the disturbance, which lasts from {sequence.begin_s:.4g} to "
            f"{sequence.end_s:.4g} s. Give at least {seen:.4g} s, or an earlier begin."
        )
    stall = None
    if disturb == "load" and load_torque is None and not motor.is_transducer:
        stall = _stall_torque(setup, source)  # of the full motor
        sequence = Disturbances((one.model_copy(update={"load_torque_n_m": 0.5 * stall}),))
    restart = parts.restart_values(motor, tracker, mode, lag, source.loop_filter)
    begins = tracker.restart and tracker.kind == "pll" and restart["wait"] < duration  # else it takes no time
    source = replace(source, disturbances=sequence, restart=restart if begins else None)
    setup = replace(setup, source=source)
    run = TrackedRun(setup, source, duration, lag, stall, margin and tracker.kind == "pll")
    return _track_averaged(run, engine) if averaged else _track_full(run, progress)


def _check_together(
    motor: Motor, tracker: Tracker, mode: int, sequence: Disturbances, contact: ContactLaw | None, speed: float | None
) -> None:  # fmt: skip
    """Raise a ParameterError for arguments that exclude each other."""
    if mode not in range(len(motor.modes)):
        raise ParameterError(f"mode = {mode} is not valid; {motor.name} has the modes 0 to {len(motor.modes) - 1}.")
    if tracker.kind == "observe-speed" and (contact is None or speed is not None):
        raise ParameterError("tracker = 'observe-speed' needs a rotor that turns; give a contact law and no speed.")
    for kind in ("load", "preload") if contact is None else ():
        if any(one.load_change_n_s_per_m is None for one in sequence.of(kind)):
            raise ParameterError(f"disturb = {kind!r} needs a rotor; give a contact law.")
    if sequence.of("target") and tracker.kind != "pll":
        raise ParameterError(
            f"disturb = 'target' is not valid for the tracker {tracker.kind!r}; only a pll has a target."
        )
    if speed is not None and sequence.of("load"):
        raise ParameterError(
            "speed and disturb = 'load' exclude each other: a shaft held at a speed takes any torque. Give one."
        )


def _track_full(run: TrackedRun, progress: Callable[[float, float], object] | None) -> Tracking:
    """Track the full motor."""
    setup, source, mode = run.setup, run.source, run.source.mode
    motor = setup.motor
    forces = force_vectors(motor) if setup.law else ()
    currents = [source.current(group)[0] for group in GROUPS]
    shaft = [] if motor.is_transducer else ["v(shaft)"]
    of_mode = ["v(force)", "v(sine)", "v(tuned)", *shaft, f"i(v.xmotor.xmode{mode + 1}.vvelocity)"]
    watched = ["v(restart)"] if source.restart else []
    names = dict.fromkeys([*of_mode, *watched, *forces, "v(a)", "v(b)", *currents, *modal_vectors(motor)])
    outcome = setup.run(run.duration, list(names), progress=progress and progress_callback(progress, run.duration))
    vectors = outcome.vectors()
    audit = Audit(audit_contact(motor.contact.friction, *(vectors[name] for name in forces)) if forces else ())
    if setup.solver.audit:
        audit.withhold("run")
    settings = {"duration_s": run.duration, **setup.to_dict(), "mode": mode, "deck_sha256": outcome.deck_sha256}
    cautions = _inseparable(motor, mode, source.tracker.sense)
    found = judged(run, _periods(vectors, motor, mode), outcome, settings, audit=audit, model_cautions=cautions)
    window = Window(vectors["time"], 1.0 / found.end_frequency_hz)
    stressed = ceramic(motor, setup.law, setup.discretisation, vectors, source, window)
    pins = np.array([_phasor(vectors, f"v({group})") for group in GROUPS])
    drawn = np.array([_phasor(vectors, name) for name in currents])
    found = replace(found, ceramic=stressed, sensing=_sensing(run, pins, drawn, found.end_frequency_hz))
    force = np.array([_phasor(vectors, "v(force)", order) for order in range(1, HARMONICS_OF_FORCE + 1)])
    if not found.locked:
        return replace(found, model_cautions=(*cautions, *_rings(source, force, found.end_frequency_hz)))
    return _with_loop(run, found, pins, force) if run.margin else found


def _rings(source: TrackedSource, force: Complex, frequency: float) -> Iterator[str]:
    """Yield a caution where the harmonics of a bridge move an edge at the detector by half the limit of lock."""
    orders, turns = np.arange(1, len(force) + 1), np.linspace(-0.5, 0.5, 50 * len(force))
    seen = force * source.low_pass(orders * frequency)
    waves = (seen * np.exp(-1j * orders * np.angle(seen[0])) @ np.exp(2j * pi * np.outer(orders, turns))).imag
    moved = 360.0 * float(np.abs(turns[1:][(waves[:-1] < 0.0) & (waves[1:] >= 0.0)]).max(initial=0.0))
    if source.filtered and source.tracker.kind == "pll" and moved > 0.5 * LOCKED_DEG:
        most = int(np.argmax(np.abs(force[1:]))) + 1
        yield (
            f"Harmonics move the edge of the voltage at the detector by {moved:.2g}°. The network resonates near "
            f"{engineering(orders[most] * frequency, 'Hz')}, a harmonic of {abs(force[most] / force[0]):.2g} times the "
            "fundamental. Change the network by --part, or take another one."
        )


def _inseparable(motor: Motor, mode: int, sense: str = "current") -> tuple[str, ...]:
    """Return a caution where the tracker senses another mode more than the one to track."""
    sensed = np.abs(parts.sensed_modes(motor, mode, sense))
    other, names = int(np.argmax(sensed)), [one.name for one in motor.modes]
    if motor.is_transducer or sensed[other] <= sensed[mode] * (1.0 + SAME):  # its modes are far from each other
        return ()
    by = "feedback electrode" if sense == "feedback" else "two groups"
    said = (
        f"The {by} of {motor.name} cannot separate {names[mode]} from {names[other]}, whose current at the same "
        f"velocity is {sensed[other] / sensed[mode]:.3g} times as large. Track {names[other]}."
    )
    return (said,)


def _at_end(run: TrackedRun, rise_k: float) -> Motor:
    """Return the motor with temperature rise, preload and resistance of its load at the end of a run."""
    motor, disturbances = run.setup.motor, run.source.disturbances
    if disturbances.drifting:
        motor = disturbances.drifting.warmed(motor, rise_k)
    if disturbances.on_tool:
        after = motor.tool.resistance_n_s_per_m + disturbances.last("load")
        motor = motor.updated({"load.resistance_n_s_per_m": max(after, 0.0)})
    if disturbances.of("preload"):
        preload = motor.contact.preload_n * (1.0 + disturbances.last("preload"))
        motor = motor.updated({"contact.preload_n": preload})
    return motor


def _with_loop(run: TrackedRun, found: Tracking, pins: Complex, force: Complex) -> Tracking:
    """Return a result with the loop gain of the running motor at its end; with a caution if there is none."""
    setup, disturbances, tracker = run.setup, run.source.disturbances, run.source.tracker
    motor, speed = _at_end(run, disturbances.last("temperature")), setup.load.speed
    if speed is None and not found.settled and not motor.is_transducer:
        speed = found.speed_after_rad_s
    target = tracker.target_deg + disturbances.last("target")
    source = replace(run.source, tracker=tracker.model_copy(update={"target_deg": target}))
    begins = np.exp(-1j * phase(pins[0]) * np.arange(1, len(force) + 1))  # group A has the phase 0
    a, b = pins.tolist()
    drive = ideal_drive(abs(a), abs(b), degrees(phase(b) - phase(a)), found.end_frequency_hz)
    point = Point.of(
        motor, drive, speed=speed, contact=setup.law, timeout=setup.solver.timeout,
        load_torque=disturbances.last("load") if speed is None and not motor.is_transducer else 0.0,
    )  # fmt: skip
    try:
        return replace(found, loop=running_loop(setup.motor, source, point, force * begins))
    except (ParameterError, SimulationError) as error:  # the former for a law whose derivatives are not known
        return replace(found, no_loop=str(error))


def _track_averaged(run: TrackedRun, engine: Engine) -> Tracking:
    """Track the averaged motor."""
    done, motor = run_averaged(run, engine), run.setup.motor
    curves, time = done.curves, done.curves["time_s"]
    phases, restart = curves["phase_deg"], curves["restart"]
    periods = Periods(
        time, curves["frequency_hz"], phases, curves["rotor_speed_rad_s"], restart, weight=np.gradient(time)
    )
    stated = run.setup.to_dict()
    settings = {
        "duration_s": run.duration, "contact": stated["contact"], "speed_rad_s": stated["speed_rad_s"],
        "mode": run.source.mode, "averaged": True, "engine": "spice" if done.ngspice_version else "compiled",
        **({"deck_sha256": done.deck_sha256} if done.deck_sha256 else {}),
    }  # fmt: skip
    found = judged(
        run, periods, done, settings, temperature_k=curves["temperature_k"],
        model_cautions=_inseparable(motor, run.source.mode),
        find_error=partial(replayed, run, time, curves["frequency_hz"]),
        ceramic=averaged_ceramic(motor, done.amplitudes, curves),
    )  # fmt: skip
    found = replace(found, sensing=_sensing(run, done.voltages, done.currents, found.end_frequency_hz))
    return replace(found, loop=done.find_loop()) if run.margin and found.locked else found


def _settled(tracker: Tracker, disturb: str) -> float:
    """Return the time in s that a tracker takes to settle; for a start alone, the duration of the run."""
    if tracker.kind == "pll":
        return 4e-3 + 12.0 / (2.0 * pi * tracker.bandwidth_hz) + (2e-3 if disturb == "start" else 0.0)
    if tracker.kind == "none":
        return 8e-3
    steps = 12.0 + 1.3 * abs(tracker.offset) * tracker.frequency / tracker.step_hz
    return steps * tracker.period_s


def _stall_torque(setup: Point, source: TrackedSource) -> float:
    """Return the mean torque of the contact on a held shaft, with the tracker at its resonance."""
    still = replace(source, tracker=source.tracker.model_copy(update={"offset": 0.0}))
    name = force_vectors(setup.motor)[1]
    vectors = replace(setup, source=still, load=Load(0.0)).run(STALL_TIME_S, [name]).vectors()
    time = vectors["time"]
    late = time > 0.5 * STALL_TIME_S
    friction = np.trapezoid(vectors[name][late], time[late]) / (time[late][-1] - time[late][0])
    return float(setup.motor.rotor.radius_m * friction)


def _check_duration(setup: Point, source: TrackedSource, duration: float) -> None:
    longest_period = 1.0 / ((1.0 - source.tracker.span) * source.tracker.frequency)
    least = max(100.0 * setup.shortest_period, (2 * SMOOTHED_PERIODS + 2) * longest_period)
    most = MOST_POINTS * setup.step
    words = f"from {least:.3g} s, 40 periods, to {most:.3g} s, so that the points fit in memory"
    require(least <= duration <= most, "duration", duration, words, unit="s")


def _event_words(event: Mapping[str, Any]) -> str:
    """Return kind, size and beginning of a disturbance."""
    name = "load_change_n_s_per_m" if event.get("load_change_n_s_per_m") else parts.CHANGED.get(event["kind"], "")
    if not (size := event.get(name)):
        return str(event["kind"])
    unit = "N·s/m" if name.endswith("n_s_per_m") else unit_in(name)
    words = f"{100.0 * size:+.3g} %" if unit == "1" else engineering(size, unit)
    return f"{event['kind']} {words} at {engineering(event['begin_s'], 's')}"


def _edges(vectors: Mapping[str, Array]) -> Array:
    """Return the times in s of the rising edges of the oscillator; the force behind a network may ring through zero."""
    time, sine = vectors["time"], vectors["v(sine)"]
    rising = np.flatnonzero((sine[:-1] < 0.0) & (sine[1:] >= 0.0))
    if rising.size < 2 * SMOOTHED_PERIODS:
        raise SimulationError("The oscillator did not oscillate; see the deck.")
    return np.asarray(time[rising] - (sine / np.diff(sine, append=1.0))[rising] * np.diff(time)[rising])


def _phasor(vectors: Mapping[str, Array], name: str, order: int = 1) -> complex:
    """Return the phasor of a vector over the last periods, or that of a harmonic."""
    time, edges = vectors["time"], _edges(vectors)[-1 - SMOOTHED_PERIODS :]
    late = (time >= edges[0]) & (time <= edges[-1])
    turns = np.exp(-2j * pi * order * np.interp(time[late], edges, np.arange(edges.size)))
    return complex(2.0j / (edges[-1] - edges[0]) * np.trapezoid(vectors[name][late] * turns, time[late]))


def _sensing(run: TrackedRun, pins: Complex, currents: Complex, frequency: float) -> Sensing | None:
    """Return how the sensed motional current drifts where the copies of the clamped capacitances do not warm up.

    ``None`` for a tracker that is no phase-locked loop.
    """
    motor, tracker = run.setup.motor, run.source.tracker
    if tracker.kind != "pll" or tracker.sense == "feedback":
        return None
    disturbances = run.source.disturbances
    thermal = next((one.thermal for one in disturbances.events if one.thermal), Thermal.of(motor))
    drift = thermal.capacitance_drift_per_k - tracker.copies_drift_per_k
    weights = parts.sensing(motor, tracker, run.source.mode)
    taken = copies(weights, frequency) @ pins
    charging = by_group(weights, "current") @ taken
    motional = by_group(weights, "current") @ (tracker.sensed_share(frequency) * currents - taken)
    turn = -degrees((drift * charging / motional).imag)  # the loop turns the mode back
    wanted = tracker.target_deg + disturbances.last("target")
    moved = run.lag.detuning_hz(wanted + turn) - run.lag.detuning_hz(wanted)
    return Sensing(drift, turn, moved)


def _periods(vectors: dict[str, Array], motor: Motor, mode: int) -> Periods:
    """Return the fundamentals of each period, from one rising edge of the oscillator to the next.

    Instead of a speed a transducer has the amplitude of the motional current of the mode.
    """
    time, force, edges = vectors["time"], vectors["v(force)"], _edges(vectors)
    velocity = vectors[f"i(v.xmotor.xmode{mode + 1}.vvelocity)"]
    turns = np.exp(-2j * pi * np.interp(time, edges, np.arange(edges.size)))

    def over_periods(values: Array) -> Any:
        summed = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
        return np.diff(np.interp(edges, time, summed.real) + 1j * np.interp(edges, time, summed.imag))

    length = np.diff(edges)
    moved = over_periods(velocity * turns)
    if motor.is_transducer:
        speed = 2.0 * abs(motor.modes[mode].coupling_a_n_per_v) * np.abs(moved) / length
    else:
        speed = over_periods(vectors["v(shaft)"]).real / length
    return Periods(
        0.5 * (edges[1:] + edges[:-1]),
        1.0 / length,
        np.degrees(np.angle(moved / over_periods(force * turns))),
        speed,
        over_periods(vectors.get("v(restart)", np.zeros_like(time))).real / length,
    )
