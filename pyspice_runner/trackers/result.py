# SPDX-License-Identifier: GPL-3.0-or-later
"""Result of a run with a resonance tracker: whether it found the resonance and stayed there.

The measure is the phase of the mode's own velocity against the force of the groups on it, in every period. The tracker
does not see this phase, so an error of its sensing counts as an error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from math import isfinite, sqrt
from typing import Any, Protocol

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.result import Audit, Result, contact_row
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SETTLED, Array
from pyspice_runner.run.window import averaged_to_come, change_to_come
from pyspice_runner.trackers.loop import LoopDesign
from pyspice_runner.trackers.loop_filter import LoopFilter, StatorLag
from pyspice_runner.trackers.tracker import Disturbance, TrackedSource
from pyspice_runner.units import engineering

LOCKED_DEG = 20.0  # closer to the target is locked: a resonator has 94 % of its greatest amplitude or more
LOST_DEG = 60.0  # farther from it, lock is lost: half the amplitude
BUILT_UP = 3.0  # time constants after which a mode's amplitude is within 5 % of its end
SMOOTHED_PERIODS = 20  # over which phase and speed are averaged
WARM_K = 50.0  # rise of the temperature at which the drift of the sensing is judged


@dataclass(frozen=True)
class Sensing:
    """Drift of the sensed motional current: the clamped capacitances warm up, their copies do not, or less.

    Attributes:
        capacitance_drift_per_k: relative drift of the clamped capacitances that their copies do not follow, 1/K.
        phase_drift_deg_per_k: by which the loop moves the phase of the mode's velocity per kelvin.
        frequency_drift_hz_per_k: by which it thus moves the frequency away from the one wanted.
    """

    capacitance_drift_per_k: float
    phase_drift_deg_per_k: float
    frequency_drift_hz_per_k: float

    def words(self) -> str:
        """Return the drift in a line."""
        if not self.capacitance_drift_per_k:
            return "copies of the clamped capacitances follow the temperature"
        return (
            f"copies of the clamped capacitances stay cold: {self.phase_drift_deg_per_k:.2g}° and "
            f"{engineering(self.frequency_drift_hz_per_k, 'Hz')} per kelvin"
        )

    @property
    def off(self) -> str:
        """A caution where the drift matters, else empty."""
        if abs(self.phase_drift_deg_per_k) * WARM_K <= LOCKED_DEG:
            return ""
        return (
            f"The copies of the clamped capacitances do not warm up: {WARM_K:g} K move the phase by "
            f"{WARM_K * self.phase_drift_deg_per_k:.2g}°. Let the copies follow the temperature (--compensate), or "
            "match them where the motor runs."
        )


@dataclass(frozen=True, repr=False)
class Tracking(Result):
    """A run with a tracker.

    Attributes:
        locked: whether the tracker locked before the disturbance, never lost lock, and is locked at the end; false
            without a tracker.
        lock_time_s: time after which it stays locked until the disturbance; ``None`` if it does not.
        kept_lock: whether the phase came within 20° of its target before the disturbance, and stayed within 60°.
        rms_phase_error_deg: of the mode's velocity, from lock to the end; from the start without lock.
        worst_phase_error_deg: greatest deviation, averaged over 20 periods, in the same time.
        residual_detuning_hz: drive frequency minus the frequency at which the phase has its target, at the end.
        static_phase_error_deg: phase of the mode's velocity minus its target, mean at the end.
        end_frequency_hz: mean frequency at the end.
        resonance_reached_hz: frequency at which the mode's velocity would be in phase with the force, at the end; from
            the phase there, by the loaded quality factor of the design.
        speed_before_rad_s: speed when the disturbance began.
        speed_after_rad_s: speed at the end.
        speed_lost_rad_s: speed before the disturbance minus the lowest speed after it began.
        stall_torque_n_m: torque on a held shaft; measured only if the load step is to be half of it.
        to_come: expected further relative change of the speed, extrapolated from the part after the disturbance;
            ``None`` if that part is too short, or for a held shaft.
        lag: resonance and loaded quality factor of the mode, for which the filter was designed.
        loop: gain and margin of a locked phase-locked loop in front of the running motor, at the end; ``None`` for
            other trackers, for one that is not locked, and where there is none.
        settings: motor, tracker, disturbance and run, JSON-ready.
        time_s: middle of each period.
        frequency_hz: frequency of each period.
        phase_deg: of the mode's velocity ahead of the force, each period.
        rotor_speed_rad_s: mean of each period.
        solver_seconds: wall time that the engine took.
        ngspice_version: version of ngspice; ``None`` of a run with the compiled motor.
        deck: netlist of the run.
        audit: outcome of the physical audit; it has findings only with ``audit=False``.
        ceramic: strain, stress and temperature rise of the ceramic, and ``cautions``; empty where not measured.
        temperature_k: of the stator above that at which its parameters hold; averaged runs only.
        model_cautions: cautions by the check of the averaged model.
        loop_filter: filter of a phase-locked loop.
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
    loop_filter: LoopFilter
    settings: dict[str, Any]
    time_s: Array = field(repr=False)
    frequency_hz: Array = field(repr=False)
    phase_deg: Array = field(repr=False)
    rotor_speed_rad_s: Array = field(repr=False)
    solver_seconds: float
    ngspice_version: str | None
    deck: str = field(repr=False)
    audit: Audit = field(default_factory=Audit)
    ceramic: dict[str, Any] = field(default_factory=dict)
    temperature_k: Array | None = field(default=None, repr=False)
    model_cautions: tuple[str, ...] = ()
    loop: LoopDesign | None = None
    no_loop: str = ""
    sensing: Sensing | None = None

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.settings["motor"]

    def to_dict(self) -> dict[str, Any]:
        """Return the result, JSON-ready."""
        names = (
            "locked", "lock_time_s", "kept_lock", "rms_phase_error_deg", "worst_phase_error_deg",
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
            **self.ceramic,
            "cautions": list(self.cautions),
        })  # fmt: skip

    @property
    def settled(self) -> bool | None:
        """Whether the speed would stay within 2 % in a longer run; ``None`` for a held shaft."""
        if self.settings["run"]["speed_rad_s"] is not None:
            return None
        return self.to_come is not None and self.to_come <= SETTLED

    def _limits(self) -> Iterator[str]:
        """Yield whether the speed has not settled or the mode's motion has not built up, and limits of the ceramic."""
        yield from self.model_cautions
        if self.settled is False and self.settings["disturbance"]["kind"] != "warm-up":
            yield "The speed has not settled at the end of the run: run it longer."
        lasted = float(self.time_s[-1] - self.time_s[0])
        if lasted < BUILT_UP * self.lag.time_constant_s:
            yield (
                f"The run of {engineering(lasted, 's')} is shorter than {BUILT_UP:g} time constants of the mode, "
                f"{engineering(self.lag.time_constant_s, 's')} each: the motion has not built up, and the end "
                f"frequency is known within ±{engineering(0.5 / (np.pi * lasted), 'Hz')} only. Run it longer."
            )
        if self.no_loop:
            yield f"The loop gain of the running motor is not known: {self.no_loop}"
        if self.sensing is not None and (off := self.sensing.off):
            yield off
        yield from self.ceramic.get("cautions", ())

    def columns(self) -> dict[str, Array]:
        """Return frequency, phase and speed of each period over time; for an averaged run also the temperature."""
        names = ("time_s", "frequency_hz", "phase_deg", "rotor_speed_rad_s")
        heated = {} if self.temperature_k is None else {"temperature_k": self.temperature_k}
        return self._localised({name: getattr(self, name) for name in names} | heated)

    def summary(self) -> dict[str, str]:
        """Return lock, phase error, and the speeds before and after the disturbance."""
        rows = {
            "motor": str(self.settings["motor"]["name"]),
            "tracker": str(self.settings["tracker"]["kind"]),
            "disturbance": str(self.settings["disturbance"]["kind"]),
            **contact_row(self.settings["run"]),
            "locked": "yes" if self.locked else "no",
            "lock time": "–" if self.lock_time_s is None else engineering(self.lock_time_s, "s"),
            "phase error": f"{self.rms_phase_error_deg:.3g}° RMS, {self.worst_phase_error_deg:.3g}° at most",
            "static phase error": self._static_error(),
            "residual detuning": engineering(self.residual_detuning_hz, "Hz"),
            "frequency reached": f"{1e-3 * self.end_frequency_hz:.6g} kHz, by design {self._design()}",
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
        if self.stall_torque_n_m is not None:
            rows["stall torque"] = engineering(self.stall_torque_n_m, "N·m")
        if self.settings["tracker"]["kind"] == "pll":
            parts, units = asdict(self.loop_filter), ("Ω", "F", "F")
            designed = f"for {engineering(self.settings['tracker']['bandwidth_hz'], 'Hz')}"
            rows["loop filter"] = f"{', '.join(map(engineering, parts.values(), units))}, {designed}"
        if self.sensing is not None:
            rows["sensing"] = self.sensing.words()
        if self.loop is not None:
            error = "" if self.loop.margin_error_deg is None else f" ± {self.loop.margin_error_deg:.1g}°"
            rows["phase margin"] = f"{self.loop.phase_margin_deg:.1f}°{error} at {self.loop.crossover_hz:.4g} Hz"
        return self._localised(rows)

    @property
    def design_frequency_hz(self) -> float:
        """Frequency at which the mode has the target phase by design, at the end."""
        return self.lag.resonance_hz + self.lag.detuning_hz(self._wanted_deg)

    @property
    def _wanted_deg(self) -> float:
        """Target phase at the end."""
        step = self.settings["disturbance"]["target_step_deg"] or 0.0
        return (
            float(self.settings["tracker"]["target_deg"] + step) if self.settings["tracker"]["kind"] == "pll" else 0.0
        )

    def _static_error(self) -> str:
        sensed = self.loop.sensed_phase_deg if self.loop else None
        told = f"{self.static_phase_error_deg:.2g}° of the mode"
        return told if sensed is None else f"{told}, {sensed - self._wanted_deg:.2g}° of the sensed current"

    def _design(self) -> str:
        return f"{1e-3 * self.design_frequency_hz:.6g} kHz"


@dataclass(frozen=True)
class TrackedRun:
    """Inputs of a run with a tracker."""

    setup: Point  # motor, source, load, law and solver
    source: TrackedSource  # the tracker at its pins, with the disturbance
    disturbance: Disturbance  # the disturbance
    duration: float  # simulated time in s
    lag: StatorLag  # resonance and lag of the mode, for which the filter was designed
    stall_torque_n_m: float | None  # torque on a held shaft, if it was measured
    margin: bool  # whether to find the loop gain at the end


@dataclass(frozen=True)
class Periods:
    """Course of a run with a tracker: one point a period, or the points of an averaged run."""

    time: Array
    frequency: Array
    phase: Array
    speed: Array
    weight: Array | None = None  # time of each point of an averaged run; None for periods

    def smoothed(self, values: Array) -> Array:
        """Return the means of the last 20 periods; an averaged run has no ripple."""
        if self.weight is not None:
            return values
        summed = np.concatenate(([0.0], np.cumsum(values)))
        last = np.arange(1, values.size + 1)
        first = np.maximum(last - SMOOTHED_PERIODS, 0)
        return np.asarray((summed[last] - summed[first]) / (last - first))

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


class Ran(Protocol):
    """What an engine tells about a run: netlist and its hash, wall time in s, version of ngspice."""

    @property
    def deck(self) -> str: ...  # noqa: D102

    @property
    def deck_sha256(self) -> str | None: ...  # noqa: D102

    @property
    def seconds(self) -> float: ...  # noqa: D102

    @property
    def ngspice_version(self) -> str | None: ...  # noqa: D102


def judged(run: TrackedRun, periods: Periods, outcome: Ran) -> Tracking:
    """Return lock, phase errors and speeds of a run. Raise ParameterError for a disturbance that begins too early."""
    setup, disturbance, tracker, time = run.setup, run.disturbance, run.source.tracker, periods.time
    wanted = tracker.wanted_deg + disturbance.target_step_deg * (time > disturbance.begin_s)
    error = periods.smoothed(periods.phase - wanted)
    speed = periods.smoothed(periods.speed)
    disturbed = disturbance.kind not in ("start", "warm-up")
    begin = disturbance.begin_s if disturbed else float(time[-1])
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
    kept = bool(acquired and np.all(np.abs(error[since]) < LOST_DEG))
    end_phase = min(max(periods.mean(periods.phase, last), -89.9), 89.9)
    speed_before = float(speed[before[-1]])
    since_begin = speed[before[-1] :] if disturbed else speed[-1:]
    return Tracking(
        locked=bool(tracked and kept and np.all(np.abs(error[last]) < LOCKED_DEG)),
        lock_time_s=float(time[first]) if tracked and acquired else None,
        kept_lock=kept,
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
            "disturbance": disturbance.to_dict() | {"begin_s": begin if disturbed else None},
            "driver": run.source.driver.to_dict() if run.source.driver else None,
            "run": {
                "duration_s": run.duration,
                **setup.to_dict(),
                "mode": run.source.mode,
                "deck_sha256": outcome.deck_sha256,
            },
        },
        time_s=time,
        frequency_hz=periods.frequency,
        phase_deg=periods.phase,
        rotor_speed_rad_s=periods.speed,
        solver_seconds=outcome.seconds,
        ngspice_version=outcome.ngspice_version,
        deck=outcome.deck,
    )
