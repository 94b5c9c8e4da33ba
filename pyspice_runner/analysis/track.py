# SPDX-License-Identifier: GPL-3.0-or-later
"""Resonance tracking: does a tracker find the resonance and stay there under disturbances?

It is judged by what it cannot see: the phase of the mode's own velocity against the force of the groups on it, taken
anew every period. So an error of its sensing counts as an error.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from math import isfinite, pi, sqrt
from typing import Any

import numpy as np

from pyspice_runner.analysis.averaged import averaged_ceramic, doubts
from pyspice_runner.analysis.loop import LoopDesign, averaged_loop, loop_design
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model.drive import Load
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.model.tracking import StatorLag
from pyspice_runner.netlist.averaged import HARMONICS, check_averaged
from pyspice_runner.netlist.averaged_tracker import averaged_tracked_bench, check_averaged_tracker
from pyspice_runner.netlist.contact import ContactLaw, law_of
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.trackers import (
    Disturbance,
    DisturbanceKind,
    TrackedSource,
    Tracker,
    tracked_lag,
    tracker_filter,
)
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.audit import audit_contact
from pyspice_runner.run.ceramic import ceramic, modal_vectors
from pyspice_runner.run.kernel import Outcome, transient
from pyspice_runner.run.settings import Solver
from pyspice_runner.run.setup import Setup
from pyspice_runner.run.steps import MOST_POINTS
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SETTLED, Array
from pyspice_runner.run.window import Window, change_to_come
from pyspice_runner.units import engineering

LOCKED_DEG = 20.0  # closer to the phase wanted is locked: a resonator has 94 % of its greatest amplitude or more
LOST_DEG = 60.0  # farther, a tracker that was locked has lost it: half the amplitude
SMOOTHED_PERIODS = 20  # over which phase and speed are averaged
STALL_TIME_S = 6e-3
LONGEST = 1e5  # s, of an averaged run
LONGEST_STEPS = 50  # of its duration: ngspice's longest step
POINTS_TO_COME = 1000  # at which the speed of an averaged run is read to judge what is to come


@dataclass(frozen=True, repr=False)
class Tracking(Result):
    """Result of a run with a tracker.

    Attributes:
        locked: whether it locked before the disturbance, never lost lock, and is locked at the end; false without a
            tracker.
        lock_time_s: time after which it stays locked until the disturbance; ``None`` if it does not.
        kept_lock: whether the phase came within 20° of its target before the disturbance, and stayed within 60°.
        rms_phase_error_deg: of the mode's velocity, from lock to the end; from the start without lock.
        worst_phase_error_deg: greatest deviation, averaged over 20 periods, in the same time.
        residual_detuning_hz: drive frequency minus the frequency at which the phase has its target, at the end.
        end_frequency_hz: mean frequency at the end.
        speed_before_rad_s: speed when the disturbance began.
        speed_after_rad_s: speed at the end.
        speed_lost_rad_s: speed before the disturbance minus the lowest speed after it began.
        stall_torque_n_m: torque on a held shaft; measured only if the load step is to be half of it.
        to_come: relative change of the speed that is still to be expected, extrapolated from the part after the
            disturbance; ``None`` if that part is too short, or for a held shaft.
        lag: resonance and loaded quality factor of the mode that were designed for.
        loop: the phase-locked loop's design; ``None`` for other trackers, and for an averaged one that is not locked.
        settings: motor, tracker, disturbance and run, JSON-ready.
        time_s: middle of each period.
        frequency_hz: frequency of each period.
        phase_deg: of the mode's velocity ahead of the force, each period.
        rotor_speed_rad_s: mean of each period.
        solver_seconds: wall time that ngspice took.
        ngspice_version: version of ngspice.
        deck: the netlist that was run.
        audit: outcome of the physical audit; it has findings only where ``audit=False`` was given.
        ceramic: strain, stress and temperature rise of the ceramic, and ``warnings``; empty where not measured.
        temperature_k: of the stator above that at which its parameters hold; of an averaged run only. Its points are
            those that ngspice chose.
        doubts: reasons, by the check of the averaged model, why the run may be wrong.
    """

    locked: bool
    lock_time_s: float | None
    kept_lock: bool
    rms_phase_error_deg: float
    worst_phase_error_deg: float
    residual_detuning_hz: float
    end_frequency_hz: float
    speed_before_rad_s: float
    speed_after_rad_s: float
    speed_lost_rad_s: float
    stall_torque_n_m: float | None
    to_come: float | None
    lag: StatorLag
    loop: LoopDesign | None
    settings: dict[str, Any]
    time_s: Array = field(repr=False)
    frequency_hz: Array = field(repr=False)
    phase_deg: Array = field(repr=False)
    rotor_speed_rad_s: Array = field(repr=False)
    solver_seconds: float
    ngspice_version: str
    deck: str = field(repr=False)
    audit: Audit = field(default_factory=Audit)
    ceramic: dict[str, Any] = field(default_factory=dict)
    temperature_k: Array | None = field(default=None, repr=False)
    doubts: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the result, JSON-ready."""
        names = (
            "locked", "lock_time_s", "kept_lock", "rms_phase_error_deg", "worst_phase_error_deg",
            "residual_detuning_hz", "end_frequency_hz", "speed_before_rad_s", "speed_after_rad_s", "speed_lost_rad_s",
            "stall_torque_n_m",
        )  # fmt: skip
        return {
            **{name: getattr(self, name) for name in names},
            "settled": self.settled,
            "to_come": self.to_come,
            "lag": {**asdict(self.lag), "time_constant_s": self.lag.time_constant_s},
            "loop": None if self.loop is None else self.loop.to_dict(),
            **self.settings,
            "periods": len(self.time_s),
            "solver_seconds": self.solver_seconds,
            "ngspice_version": self.ngspice_version,
            "audit": self.audit.to_dict(),
            **({} if self.temperature_k is None else {"temperature_k": float(self.temperature_k[-1])}),
            **self.ceramic,
        }

    @property
    def settled(self) -> bool | None:
        """Whether the speed stays within 2 % if the run goes on; ``None`` for a held shaft."""
        if self.settings["run"]["speed_rad_s"] is not None:
            return None
        return self.to_come is not None and self.to_come <= SETTLED

    @property
    def cautions(self) -> tuple[str, ...]:
        """Findings of the audit, and whether the speed has not settled."""
        moving = self.settled is False and self.settings["disturbance"]["kind"] != "warm-up"
        told = ["The speed has not settled at the end of the run: run it longer."] * moving
        return (*self.audit.findings, *self.doubts, *told, *self.ceramic.get("warnings", ()))

    def columns(self) -> dict[str, Array]:
        """Return frequency, phase and speed of each period, over the time; of an averaged run the temperature too."""
        names = ("time_s", "frequency_hz", "phase_deg", "rotor_speed_rad_s")
        heated = {} if self.temperature_k is None else {"temperature_k": self.temperature_k}
        return {name: getattr(self, name) for name in names} | heated

    def summary(self) -> dict[str, str]:
        """Return whether and when it locked, the phase error, and the speeds before and after the disturbance."""
        return {
            "motor": str(self.settings["motor"]),
            "tracker": str(self.settings["tracker"]["kind"]),
            "locked": f"yes, after {engineering(self.lock_time_s, 's')}" if self.locked else "no",
            "phase error": f"{self.rms_phase_error_deg:.3g}° RMS, {self.worst_phase_error_deg:.3g}° at most",
            "residual detuning": engineering(self.residual_detuning_hz, "Hz"),
            "frequency at the end": f"{1e-3 * self.end_frequency_hz:.6g} kHz",
            "speed": f"{self.speed_before_rad_s:.4g} rad/s before, {self.speed_after_rad_s:.4g} rad/s at the end"
            + (", not settled" if self.settled is False else ""),
        }


@checked
def track(
    motor: Motor,
    tracker: Tracker,
    *,
    disturb: DisturbanceKind = "start",
    mode: int | None = None,
    contact: ContactLaw | None = "spring-slider",
    begin: float | None = None,
    duration: float | None = None,
    load_torque: float | None = None,
    preload_change: float = 0.3,
    drift: float = -0.02,
    drift_time: float = 50e-3,
    thermal: Thermal | None = None,
    target_step: float = 10.0,
    speed: float | None = None,
    step: float | None = None,
    driver: Driver | None = None,
    averaged: bool = False,
    timeout: float | None = None,
    audit: bool = True,
) -> Tracking:
    """Let a tracker follow a mode of a motor from rest, and disturb it.

    The averaged motor takes seconds for minutes of motor time, with a ``"pll"`` or no tracker; ``docs/averaged.md``.

    Args:
        motor: the motor.
        tracker: the tracker and its two-phase drive; ``tracker.offset`` is by how much it starts off.
        disturb: ``"start"``: nothing but the start; ``"target"``: a step of the phase wanted; ``"load"``: a torque;
            ``"preload"``: another static normal force; ``"temperature"``: a drift of all frequencies; ``"warm-up"``, of
            the averaged motor: the losses heat the stator.
        mode: index of the mode to follow, from 0; by default the last.
        contact: law of the contact; ``None`` for a free tip.
        begin: when the disturbance begins, s; by default when the tracker has settled.
        duration: simulated time, s; by default some time after the disturbance.
        load_torque: torque of the load in N·m; by default half the stall torque, which takes a run with the shaft held.
        preload_change: relative change of the preload.
        drift: relative drift of the frequencies.
        drift_time: time that it takes, s.
        thermal: coefficients of what drifts along with the frequencies; by default nothing does. Of a warm-up, all
            values; by default those of :meth:`Thermal.of`.
        target_step: step of the phase that a phase-locked loop is to hold, degrees.
        speed: if given, the shaft is held at this speed, rad/s.
        step: largest time step, s; by default 1/200 of the period of the fastest motion.
        driver: driver circuit through which the tracker drives the motor. Its voltages and phase are then those of the
            drive; the tracker sets its frequency, and senses behind it, at the pins.
        averaged: whether the averaged motor is tracked. ``loop`` is then that of its ``.ac`` at the end of the run, at
            the speed that is reached; ``None`` if the tracker is not locked.
        timeout: wall time in s after which a run is ended.
        audit: whether a run whose contact fails the physical audit is an error. If not, ``audit`` of the
            result has the findings.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    law = law_of(contact)
    mode = len(motor.modes) - 1 if mode is None else mode
    _check_together(motor, tracker, mode, disturb, contact, speed)
    if averaged:
        check_averaged(contact)
        if step is not None:
            raise ParameterError("step has no effect on an averaged run, whose steps ngspice chooses. Leave it out.")
    elif disturb == "warm-up":
        raise ParameterError("disturb = 'warm-up' takes minutes of motor time: give averaged=True, or 'temperature'.")
    lag = tracked_lag(motor, tracker, mode, contact=law is not None)
    loop_filter = tracker_filter(tracker, lag)
    source = TrackedSource(tracker, mode, loop_filter, driver)
    setup = Setup(motor, source, Load(speed), law, Solver(step, timeout=timeout, audit=audit))
    begin = _settled(tracker, disturb) if begin is None else begin
    stall = None
    if disturb == "load" and load_torque is None:
        stall = _stall_torque(setup)  # of the full motor
        load_torque = 0.5 * stall
    disturbance = Disturbance(
        disturb, begin, load_torque or 0.0, preload_change, drift, drift_time,
        {"temperature": thermal, "warm-up": thermal or Thermal.of(motor)}.get(disturb),
        target_step if disturb == "target" else 0.0,
    )  # fmt: skip
    if duration is None:
        duration = begin if disturb == "start" else disturbance.end_s + {"temperature": 2e-3}.get(disturb, 12e-3)
    if averaged:
        return _averaged(setup, replace(source, disturbance=disturbance), disturbance, duration, lag, stall)
    setup = replace(setup, source=replace(source, disturbance=disturbance), disturbance=disturbance)
    _check_duration(setup, duration)
    seen = disturbance.end_s + 2 * SMOOTHED_PERIODS / tracker.frequency
    if disturb != "start" and duration < seen:
        raise ParameterError(
            f"duration = {duration:g} s does not show the disturbance, which lasts from {begin:.4g} to "
            f"{disturbance.end_s:.4g} s. Give at least {seen:.4g} s, or an earlier begin."
        )
    electrical = ["v(a)", "v(b)", *(setup.source.current(group)[0] for group in "ab"), *modal_vectors(motor)]
    forces = ["v(xmotor.normal)", "v(xmotor.friction)"] if law else []
    outcome = setup.run(duration, list(dict.fromkeys(_vectors(mode, *forces, *electrical))))
    vectors = outcome.vectors()
    audited = Audit()
    if law:
        audited = Audit(audit_contact(motor.contact.friction, *(vectors[name] for name in forces)))
    if audit:
        audited.withhold("run")
    found = _judge(
        setup, duration, lag, loop_design(tracker, lag, loop_filter) if tracker.kind == "pll" else None,
        _periods(vectors, mode), stall, outcome,
    )  # fmt: skip
    power = np.asarray(
        sum(
            factor * vectors[name] * vectors[f"v({group})"]
            for group, (name, factor) in ((group, setup.source.current(group)) for group in "ab")
        )
    )
    window = Window(vectors["time"], 1.0 / found.end_frequency_hz)
    return replace(found, audit=audited, ceramic=ceramic(motor, setup.discretisation, vectors, power, window))


def _check_together(
    motor: Motor, tracker: Tracker, mode: int, disturb: DisturbanceKind, contact: ContactLaw | None, speed: float | None
) -> None:  # fmt: skip
    """Raise a ParameterError for arguments that exclude each other."""
    if mode not in range(len(motor.modes)):
        raise ParameterError(f"mode = {mode} is not valid; {motor.name} has the modes 0 to {len(motor.modes) - 1}.")
    if contact is None and disturb in ("load", "preload"):
        raise ParameterError(f"disturb = {disturb!r} needs a rotor; give a contact law.")
    if disturb == "target" and tracker.kind != "pll":
        raise ParameterError(
            f"disturb = 'target' is not valid for the tracker {tracker.kind!r}; only a pll has a target."
        )
    if speed is not None and disturb == "load":
        raise ParameterError(
            "speed and disturb = 'load' exclude each other: a shaft held at a speed takes any torque. Give one."
        )


@checked
def running_resonance(motor: Motor, tracker: Tracker, *, mode: int | None = None, contact: bool = True) -> StatorLag:
    """Return resonance and loaded quality factor of a running mode, by harmonic balance.

    Args:
        motor: the motor.
        tracker: voltages and phase of its drive.
        mode: index of the mode, from 0; by default the last.
        contact: whether the tip is on the rotor.
    """
    return tracked_lag(motor, tracker, len(motor.modes) - 1 if mode is None else mode, contact=contact)


@checked
def measured_loop_gain(
    motor: Motor,
    tracker: Tracker,
    frequency_hz: float,
    *,
    mode: int | None = None,
    contact: ContactLaw | None = "spring-slider",
    amplitude_hz: float = 150.0,
    cycles: int = 5,
    step: float | None = None,
    timeout: float | None = None,
) -> complex:
    """Measure the gain of a phase-locked loop that runs, by a small sine in front of its oscillator.

    Where the loop passes a voltage and nothing loads it, what comes back over what is put in is minus the loop gain
    (R. D. Middlebrook, Int. J. Electronics 38 (1975) 485).

    Args:
        motor: the motor.
        tracker: the tracker, a ``"pll"``.
        frequency_hz: frequency of the sine.
        mode: index of the mode to follow, from 0; by default the last.
        contact: law of the contact; ``None`` for a free tip.
        amplitude_hz: of the sine, as a frequency of the oscillator; large enough that the phase swings by several of
            the time steps by which edges are seen late.
        cycles: number of its cycles that are measured, after those that the loop takes to settle.
        step: largest time step, s.
        timeout: wall time in s after which the run is ended.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    if tracker.kind != "pll":
        raise ParameterError(f"The tracker {tracker.kind!r} has no loop gain; take a pll.")
    mode = len(motor.modes) - 1 if mode is None else mode
    lag = tracked_lag(motor, tracker, mode, contact=contact is not None)
    window = cycles / frequency_hz
    duration = _settled(tracker, "load") + window
    inject = f"SIN(0 {amplitude_hz / tracker.gain_hz_per_v!r} {frequency_hz!r})"
    source = TrackedSource(tracker, mode, tracker_filter(tracker, lag), inject=inject)
    setup = Setup(motor, source, law=law_of(contact), solver=Solver(step, timeout=timeout))
    _check_duration(setup, duration)
    vectors = setup.run(duration, _vectors(mode, "v(control)", "v(tuning)")).vectors()
    time = vectors["time"]
    begin = time[-1] - window
    grid = np.linspace(begin, time[-1], 4096 * cycles + 1)
    turns = np.exp(-2j * pi * frequency_hz * grid)
    after, before = (
        np.trapezoid((values - values.mean()) * turns, grid)
        for values in (np.interp(grid, time, vectors[name]) for name in ("v(control)", "v(tuning)"))
    )
    return complex(-after / before)


def _averaged(
    setup: Setup, source: TrackedSource, disturbance: Disturbance, duration: float, lag: StatorLag, stall: float | None
) -> Tracking:  # fmt: skip
    """Track the averaged motor."""
    motor, tracker = setup.motor, source.tracker
    check_averaged_tracker(source, disturbance)
    least = 2 * SMOOTHED_PERIODS / tracker.frequency
    if not least <= duration <= LONGEST:
        raise ParameterError(f"duration = {duration:g} s is not valid: it must be from {least:.3g} to {LONGEST:g} s.")
    bench = averaged_tracked_bench(motor, source, disturbance, setup.load)
    outcome = transient(
        bench, ["all"], step=source.period, duration=duration, longest=duration / LONGEST_STEPS,
        timeout=setup.solver.timeout,
    )  # fmt: skip
    vectors = outcome.vectors()
    own, volts, time = motor.modes[source.mode], tracker.phasors(), vectors["time"]
    velocity = _complex(vectors, f"v(xmotor.xmode{source.mode + 1}_1.v_{{}})")
    force = own.coupling_a_n_per_v * volts["a"] + own.coupling_b_n_per_v * volts["b"]
    periods = _Periods(
        time, vectors["v(tuned)"], np.degrees(np.angle(velocity / force)), vectors["v(shaft)"], np.gradient(time)
    )
    last = outcome.last()
    drifting = disturbance.drifting
    found = _judge(replace(setup, source=source, disturbance=disturbance), duration, lag, None, periods, stall, outcome)
    loop = None
    if found.locked:
        held = averaged_tracked_bench(
            motor, replace(source, tracker=tracker.model_copy(update={"target_deg": last["v(target)"]})),
            Disturbance("start"), Load(last["v(shaft)"]), frozen=(last["v(control)"], last.get("v(temperature)", 0.0)),
            thermal=drifting,
        )  # fmt: skip
        guess = {name[2:-1]: value for name, value in last.items() if name.startswith("v(xmotor.")}
        loop = averaged_loop(tracker, source.loop_filter, held, guess)
    found.settings["run"] = {
        name: found.settings["run"][name] for name in ("duration_s", "contact", "speed_rad_s", "mode", "deck_sha256")
    } | {"averaged": True}
    return replace(
        found,
        loop=loop,
        temperature_k=vectors["v(temperature)"] if drifting else np.zeros(len(time)),
        doubts=doubts(float(vectors["v(xmotor.check)"].max()), float(vectors["v(xmotor.open)"].max())),
        ceramic=averaged_ceramic(motor, vectors, HARMONICS),
    )


def _complex(vectors: dict[str, Array], name: str) -> Any:
    return vectors[name.format("re")] + 1j * vectors[name.format("im")]


def _settled(tracker: Tracker, disturb: str) -> float:
    """Return a time after which a tracker should have settled, or for a start, how long to watch it."""
    if tracker.kind == "pll":
        return 4e-3 + 12.0 / (2.0 * pi * tracker.bandwidth_hz) + (2e-3 if disturb == "start" else 0.0)
    if tracker.kind == "none":
        return 8e-3
    steps = 12.0 + 1.3 * abs(tracker.offset) * tracker.frequency / tracker.step_hz
    return steps * tracker.period_s


def _stall_torque(setup: Setup) -> float:
    """Return the mean torque of the contact on a shaft that is held, the tracker at its resonance."""
    source = setup.source
    assert isinstance(source, TrackedSource)
    still = replace(source, tracker=source.tracker.model_copy(update={"offset": 0.0}), disturbance=None)
    held = replace(setup, source=still, load=Load(0.0), disturbance=None)
    vectors = held.run(STALL_TIME_S, ["v(xmotor.friction)"]).vectors()
    time = vectors["time"]
    late = time > 0.5 * STALL_TIME_S
    friction = np.trapezoid(vectors["v(xmotor.friction)"][late], time[late]) / (time[late][-1] - time[late][0])
    return float(setup.motor.rotor.radius_m * friction)


def _to_come(periods: _Periods, begin: float) -> float | None:
    """Return by how much the speed would still change after the disturbance, relative."""
    time, speed = periods.time, periods.speed
    if periods.weight is not None:
        time = np.linspace(begin, time[-1], POINTS_TO_COME)
        speed = np.interp(time, periods.time, speed)
    since = time >= begin
    change = change_to_come(time[since], speed[since], float(np.mean(np.diff(time[since]))))
    scale = abs(float(np.mean(speed[-SMOOTHED_PERIODS:]))) + ROUNDING_RAD_S
    return change / scale if isfinite(change) else None


def _check_duration(setup: Setup, duration: float) -> None:
    assert isinstance(setup.source, TrackedSource)
    tracker = setup.source.tracker
    longest_period = 1.0 / ((1.0 - tracker.span) * tracker.frequency)
    least = max(100.0 * setup.shortest_period, (2 * SMOOTHED_PERIODS + 2) * longest_period)
    most = MOST_POINTS * setup.step
    if not least <= duration <= most:
        raise ParameterError(f"duration = {duration:g} s is not valid: it must be from {least:.3g} to {most:.3g} s.")


def _vectors(mode: int, *more: str) -> list[str]:
    return ["v(force)", "v(tuned)", "v(shaft)", f"i(v.xmotor.xmode{mode + 1}.vvelocity)", *more]


@dataclass(frozen=True)
class _Periods:
    time: Array
    frequency: Array
    phase: Array
    speed: Array
    weight: Array | None = None  # time that each point stands for, of an averaged run; None for periods

    def smoothed(self, values: Array) -> Array:
        """Return means over 20 periods; an averaged run has no ripple."""
        return values if self.weight is not None else _smoothed(values)

    def mean(self, values: Array, where: Any) -> float:
        """Return a mean over the time."""
        return float(np.average(values[where], weights=None if self.weight is None else self.weight[where]))


def _periods(vectors: dict[str, Array], mode: int) -> _Periods:
    """Return, period by period from one rising edge of the force to the next, what its fundamental is."""
    time, force = vectors["time"], vectors["v(force)"]
    velocity = vectors[f"i(v.xmotor.xmode{mode + 1}.vvelocity)"]
    rising = np.flatnonzero((force[:-1] < 0.0) & (force[1:] >= 0.0))
    if rising.size < 2 * SMOOTHED_PERIODS:
        raise SimulationError("The oscillator did not oscillate; see the deck.")
    edges = time[rising] - force[rising] * (time[rising + 1] - time[rising]) / (force[rising + 1] - force[rising])
    turns = np.exp(-2j * pi * np.interp(time, edges, np.arange(edges.size)))

    def over_periods(values: Array) -> Any:
        summed = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
        return np.diff(np.interp(edges, time, summed.real) + 1j * np.interp(edges, time, summed.imag))

    length = np.diff(edges)
    return _Periods(
        0.5 * (edges[1:] + edges[:-1]),
        1.0 / length,
        np.degrees(np.angle(over_periods(velocity * turns) / over_periods(force * turns))),
        over_periods(vectors["v(shaft)"]).real / length,
    )


def _smoothed(values: Array) -> Array:
    """Return the mean of the last 20 periods, or of those there are."""
    summed = np.concatenate(([0.0], np.cumsum(values)))
    last = np.arange(1, values.size + 1)
    first = np.maximum(last - SMOOTHED_PERIODS, 0)
    return np.asarray((summed[last] - summed[first]) / (last - first))


def _judge(
    setup: Setup, duration: float, lag: StatorLag, loop: LoopDesign | None, periods: _Periods, stall: float | None,
    outcome: Outcome,
) -> Tracking:  # fmt: skip
    source, disturbance, time = setup.source, setup.disturbance, periods.time
    assert isinstance(source, TrackedSource)
    assert disturbance is not None
    tracker = source.tracker
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
    # locked for the last tenth before the disturbance at least
    acquired = first < before.size and time[first] <= 0.9 * begin
    lock_time = float(time[first]) if acquired else None
    since = slice(first if acquired else 0, None)
    last = time >= time[-1] - max(0.1 * (time[-1] - (begin if disturbed else 0.0)), SMOOTHED_PERIODS / lag.resonance_hz)
    kept = bool(acquired and np.all(np.abs(error[since]) < LOST_DEG))
    tracked = tracker.kind != "none"
    locked = bool(tracked and kept and np.all(np.abs(error[last]) < LOCKED_DEG))
    end_phase = periods.mean(periods.phase, last)
    detuning = lag.detuning_hz(min(max(end_phase, -89.9), 89.9)) - lag.detuning_hz(float(wanted[-1]))
    speed_before = float(speed[before[-1]])
    since_begin = speed[before[-1] :] if disturbed else speed[-1:]
    return Tracking(
        locked=locked,
        lock_time_s=lock_time if tracked else None,
        kept_lock=kept,
        rms_phase_error_deg=sqrt(periods.mean((periods.phase - wanted) ** 2, since)),
        worst_phase_error_deg=float(np.abs(error[since]).max()),
        residual_detuning_hz=detuning,
        end_frequency_hz=periods.mean(periods.frequency, last),
        speed_before_rad_s=speed_before,
        speed_after_rad_s=float(speed[-1]),
        to_come=_to_come(periods, begin if disturbed else 0.0) if setup.load.speed is None else None,
        speed_lost_rad_s=float(speed_before - since_begin.min()),
        stall_torque_n_m=stall,
        lag=lag,
        loop=loop,
        settings={
            "motor": setup.motor.name,
            "tracker": tracker.model_dump(),
            "disturbance": {
                "kind": disturbance.kind,
                "begin_s": begin if disturbed else None,
                "load_torque_n_m": disturbance.load_torque_n_m if disturbance.kind == "load" else None,
                "preload_change": disturbance.preload_change if disturbance.kind == "preload" else None,
                "drift": disturbance.drift if disturbance.kind == "temperature" else None,
                "target_step_deg": disturbance.target_step_deg if disturbance.kind == "target" else None,
                "drift_time_s": disturbance.drift_time_s if disturbance.kind == "temperature" else None,
            },
            "driver": source.driver.to_dict() if source.driver else None,
            "run": {
                "duration_s": duration,
                **setup.to_dict(),
                "mode": source.mode,
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
