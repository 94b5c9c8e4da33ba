# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs with a resonance tracker: of the full motor, of the averaged motor, and the loop gain."""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping
from dataclasses import replace
from math import degrees, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.library import check_averaged
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, law_of
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Load, TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import audit_contact
from pyspice_runner.run.ceramic import ceramic, modal_vectors
from pyspice_runner.run.point import MOST_POINTS, Point, Solver
from pyspice_runner.run.waveforms import Array
from pyspice_runner.run.window import Window
from pyspice_runner.spice import Engine
from pyspice_runner.trackers.averaged import track_averaged
from pyspice_runner.trackers.loop_filter import DisturbanceKind, StatorLag
from pyspice_runner.trackers.result import SMOOTHED_PERIODS, Periods, Sensing, TrackedRun, Tracking, judged
from pyspice_runner.trackers.running_loop import LockedPoint, running_loop
from pyspice_runner.trackers.tracker import Disturbance, TrackedSource, Tracker, sensing, tracked_lag, tracker_filter

STALL_TIME_S = 6e-3
HARMONICS_OF_FORCE = 15  # behind a bridge; at 250 points a period and more


@checked
def track(
    motor: Motor,
    tracker: Tracker,
    duration: float | None = None,
    *,
    disturb: DisturbanceKind = "start",
    mode: int | None = None,
    contact: ContactLaw | None = PAPER_LAW,
    begin: float | None = None,
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
    margin: bool = True,
    engine: Engine = "auto",
    timeout: float | None = None,
    audit: bool = True,
) -> Tracking:
    """Track a mode of a motor from rest, under a disturbance.

    The averaged motor takes milliseconds for minutes of motor time, with a ``"pll"`` or no tracker; docs/averaged.md.

    Args:
        motor: the motor.
        tracker: the tracker and its two-phase drive; ``tracker.offset`` is its initial detuning.
        disturb: ``"start"``: only the start; ``"target"``: a step of the target phase; ``"load"``: a load torque;
            ``"preload"``: a change of the static normal force; ``"temperature"``: a drift of all frequencies;
            ``"warm-up"``, averaged motor only: the losses heat the stator.
        mode: index of the mode to follow, from 0; by default the last.
        contact: law of the contact; ``None`` for a free tip.
        begin: start of the disturbance, s; by default when the tracker has settled.
        duration: simulated time, s; by default some time after the disturbance.
        load_torque: torque of the load in N·m; by default half the stall torque, which takes a run with the shaft held.
        preload_change: relative change of the preload.
        drift: relative drift of the frequencies.
        drift_time: duration of the drift, s.
        thermal: coefficients of the drift; by default only the frequencies drift, and in a warm-up those of
            :meth:`Thermal.of` apply.
        target_step: step of the target phase of a phase-locked loop, degrees.
        speed: if given, the shaft is held at this speed, rad/s.
        step: largest time step, s; by default 1/200 of the period of the fastest motion.
        driver: circuit between tracker and the motor's pins, where the tracker senses; it sets voltages and phase.
        averaged: whether to track the averaged motor.
        margin: whether to find the loop gain of a locked loop at the end of the run, from the small signals of the
            running motor with driver and network; of the full motor this takes some ten seconds.
        engine: of the averaged motor, as in :func:`simulate_averaged`; ngspice runs the full motor.
        timeout: wall time in s after which a run is ended.
        audit: whether findings of the physical audit are an error; if not, ``audit`` of the result has them.

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
            raise ParameterError("step has no effect on an averaged run, whose engine chooses its steps. Leave it out.")
    elif engine == "compiled":
        raise ParameterError("engine = 'compiled' has no tracker for the full motor: give averaged=True, or 'spice'.")
    elif disturb == "warm-up":
        raise ParameterError("disturb = 'warm-up' takes minutes of motor time: give averaged=True, or 'temperature'.")
    lag = tracked_lag(motor, tracker, mode, contact=law is not None)
    source = TrackedSource(tracker, mode, tracker_filter(tracker, lag), driver)
    setup = Point(motor, source, Load(speed), law, Solver(step, timeout=timeout, audit=audit))
    begin = _settled(tracker, disturb) if begin is None else begin
    stall = None
    if disturb == "load" and load_torque is None:
        stall = _stall_torque(setup, source)  # of the full motor
        load_torque = 0.5 * stall
    disturbance = Disturbance(
        disturb, begin, load_torque or 0.0, preload_change, drift, drift_time,
        {"temperature": thermal, "warm-up": thermal or Thermal.of(motor)}.get(disturb),
        target_step if disturb == "target" else 0.0,
    )  # fmt: skip
    if duration is None:
        duration = begin if disturb == "start" else disturbance.end_s + {"temperature": 2e-3}.get(disturb, 12e-3)
    source = replace(source, disturbance=disturbance)
    setup = replace(setup, source=source)
    run = TrackedRun(setup, source, disturbance, duration, lag, stall, margin and tracker.kind == "pll")
    return _track_averaged(run, engine) if averaged else _track_full(run)


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
    contact: ContactLaw | None = PAPER_LAW,
    amplitude_hz: float = 150.0,
    cycles: int = 5,
    step: float | None = None,
    driver: Driver | None = None,
    begin: float | None = None,
    timeout: float | None = None,
) -> complex:
    """Measure the gain of a running phase-locked loop, by a small sine in front of its oscillator.

    At an unloaded voltage node of the loop, the ratio of returned to injected voltage is minus the loop gain
    (R. D. Middlebrook, Int. J. Electronics 38 (1975) 485).

    Args:
        motor: the motor.
        tracker: the tracker, a ``"pll"``.
        frequency_hz: frequency of the sine.
        mode: index of the mode to follow, from 0; by default the last.
        contact: law of the contact; ``None`` for a free tip.
        amplitude_hz: amplitude of the sine, as a frequency of the oscillator; large enough that the phase swings by
            several time steps, the resolution of the detector's edges.
        cycles: number of measured cycles, after the loop has settled.
        step: largest time step, s.
        driver: circuit between tracker and the motor's pins, as in :func:`track`.
        begin: time in s at which the measurement begins; by default when the tracker has settled. A light rotor may
            take longer to reach its speed.
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
    duration = (_settled(tracker, "load") if begin is None else begin) + window
    inject = f"SIN(0 {amplitude_hz / tracker.gain_hz_per_v!r} {frequency_hz!r})"
    source = TrackedSource(tracker, mode, tracker_filter(tracker, lag), driver, inject=inject)
    setup = Point(motor, source, law=law_of(contact), solver=Solver(step, timeout=timeout))
    _check_duration(setup, source, duration)
    vectors = setup.run(duration, _vectors(mode, "v(control)", "v(tuning)")).vectors()
    time = vectors["time"]
    grid = np.linspace(time[-1] - window, time[-1], 4096 * cycles + 1)
    turns = np.exp(-2j * pi * frequency_hz * grid)
    after, before = (
        np.trapezoid((values - values.mean()) * turns, grid)
        for values in (np.interp(grid, time, vectors[name]) for name in ("v(control)", "v(tuning)"))
    )
    return complex(-after / before)


def _track_full(run: TrackedRun) -> Tracking:
    """Track the full motor."""
    setup, source, disturbance, duration = run.setup, run.source, run.disturbance, run.duration
    motor, mode = setup.motor, source.mode
    _check_duration(setup, source, duration)
    seen = disturbance.end_s + 2 * SMOOTHED_PERIODS / source.tracker.frequency
    if disturbance.kind != "start" and duration < seen:
        raise ParameterError(
            f"duration = {duration:g} s does not show the disturbance, which lasts from {disturbance.begin_s:.4g} to "
            f"{disturbance.end_s:.4g} s. Give at least {seen:.4g} s, or an earlier begin."
        )
    forces = ["v(xmotor.normal)", "v(xmotor.friction)"] if setup.law else []
    electrical = ["v(a)", "v(b)", *(source.current(group)[0] for group in GROUPS), *modal_vectors(motor)]
    outcome = setup.run(duration, list(dict.fromkeys(_vectors(mode, *forces, *electrical))))
    vectors = outcome.vectors()
    audit = Audit(audit_contact(motor.contact.friction, *(vectors[name] for name in forces)) if forces else ())
    if setup.solver.audit:
        audit.withhold("run")
    found = judged(run, _periods(vectors, mode), outcome)
    window = Window(vectors["time"], 1.0 / found.end_frequency_hz)
    stressed = ceramic(motor, setup.law, setup.discretisation, vectors, source, window)
    found = replace(found, audit=audit, ceramic=stressed)
    if run.source.tracker.kind == "pll":
        currents = _phasors(vectors, {group: source.current(group)[0] for group in GROUPS})
        found = replace(found, sensing=_sensing(run, _pins(vectors), currents, found))
    if not (run.margin and found.locked):
        return found
    force = np.array([_phasors(vectors, {"": "v(force)"}, order)[""] for order in range(1, HARMONICS_OF_FORCE + 1)])
    return _with_loop(run, found, _pins(vectors), force)


def _with_loop(
    run: TrackedRun, found: Tracking, pins: Mapping[str, complex], force: NDArray[np.complex128]
) -> Tracking:
    """Return a result with the loop gain of the running motor at its end; with a caution if there is none."""
    setup, disturbance, tracker = run.setup, run.disturbance, run.source.tracker
    motor, speed = setup.motor, setup.load.speed
    if disturbance.kind == "temperature":
        motor = disturbance.coefficients.warmed(motor, disturbance.rise_k)
    if disturbance.kind == "preload":
        motor = motor.updated({"contact.preload_n": motor.contact.preload_n * (1.0 + disturbance.preload_change)})
    if speed is None and not found.settled:
        speed = found.speed_after_rad_s
    ratio = pins["b"] / pins["a"]
    drive = TwoPhaseDrive(
        voltage=abs(pins["a"]), ratio_b=abs(ratio), phase_deg=degrees(phase(ratio)), frequency=found.end_frequency_hz
    )
    target = tracker.target_deg + disturbance.target_step_deg
    source = replace(run.source, tracker=tracker.model_copy(update={"target_deg": target}))
    begins = np.exp(-1j * phase(pins["a"]) * np.arange(1, len(force) + 1))  # group A has the phase 0
    point = LockedPoint(
        motor, drive, speed, disturbance.load_torque_n_m if disturbance.kind == "load" else 0.0, force * begins
    )
    try:
        return replace(found, loop=running_loop(setup, source, point, timeout=setup.solver.timeout))
    except SimulationError as error:
        return replace(found, no_loop=str(error))


def _track_averaged(run: TrackedRun, engine: Engine) -> Tracking:
    """Track the averaged motor."""
    found, voltages, currents = track_averaged(run, engine)
    if run.source.tracker.kind == "pll":
        found = replace(found, sensing=_sensing(run, voltages, currents, found))
    return found


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
    vectors = replace(setup, source=still, load=Load(0.0)).run(STALL_TIME_S, ["v(xmotor.friction)"]).vectors()
    time = vectors["time"]
    late = time > 0.5 * STALL_TIME_S
    friction = np.trapezoid(vectors["v(xmotor.friction)"][late], time[late]) / (time[late][-1] - time[late][0])
    return float(setup.motor.rotor.radius_m * friction)


def _check_duration(setup: Point, source: TrackedSource, duration: float) -> None:
    longest_period = 1.0 / ((1.0 - source.tracker.span) * source.tracker.frequency)
    least = max(100.0 * setup.shortest_period, (2 * SMOOTHED_PERIODS + 2) * longest_period)
    most = MOST_POINTS * setup.step
    if not least <= duration <= most:
        raise ParameterError(f"duration = {duration:g} s is not valid: it must be from {least:.3g} to {most:.3g} s.")


def _vectors(mode: int, *more: str) -> list[str]:
    return ["v(force)", "v(tuned)", "v(shaft)", f"i(v.xmotor.xmode{mode + 1}.vvelocity)", *more]


def _edges(vectors: Mapping[str, Array]) -> Array:
    """Return the times in s of the rising edges of the force."""
    time, force = vectors["time"], vectors["v(force)"]
    rising = np.flatnonzero((force[:-1] < 0.0) & (force[1:] >= 0.0))
    if rising.size < 2 * SMOOTHED_PERIODS:
        raise SimulationError("The oscillator did not oscillate; see the deck.")
    return np.asarray(
        time[rising] - force[rising] * (time[rising + 1] - time[rising]) / (force[rising + 1] - force[rising])
    )


def _phasors(vectors: Mapping[str, Array], names: Mapping[str, str], order: int = 1) -> dict[str, complex]:
    """Return the phasors of vectors, by group, over the last periods, or those of a harmonic."""
    time, edges = vectors["time"], _edges(vectors)[-1 - SMOOTHED_PERIODS :]
    late = (time >= edges[0]) & (time <= edges[-1])
    turns = (
        2.0j / (edges[-1] - edges[0]) * np.exp(-2j * pi * order * np.interp(time[late], edges, np.arange(edges.size)))
    )
    return {group: complex(np.trapezoid(vectors[name][late] * turns, time[late])) for group, name in names.items()}


def _pins(vectors: Mapping[str, Array]) -> dict[str, complex]:
    """Return the phasors in V of the voltages at the pins over the last periods."""
    return _phasors(vectors, {group: f"v({group})" for group in GROUPS})


def _sensing(run: TrackedRun, pins: Mapping[str, complex], currents: Mapping[str, complex], found: Tracking) -> Sensing:
    """Return how the sensed motional current drifts where the copies of the clamped capacitances do not warm up."""
    motor, tracker = run.setup.motor, run.source.tracker
    drift = (run.disturbance.thermal or Thermal.of(motor)).capacitance_drift_per_k - tracker.copies_drift_per_k
    weights = sensing(motor, tracker, run.source.mode)
    motional = charging = 0j
    for group in GROUPS:
        reactance = 1.0 / (2j * pi * found.end_frequency_hz * weights[groups.named("capacitance", group)])
        taken = pins[group] / (weights[groups.named("resistance", group)] + reactance)
        motional += weights[groups.named("current", group)] * (currents[group] - taken)
        charging += weights[groups.named("current", group)] * taken
    turn = -degrees((drift * charging / motional).imag)  # the loop turns the mode back
    wanted = tracker.target_deg + run.disturbance.target_step_deg
    moved = run.lag.detuning_hz(wanted + turn) - run.lag.detuning_hz(wanted)
    return Sensing(drift, turn, moved)


def _periods(vectors: dict[str, Array], mode: int) -> Periods:
    """Return the fundamentals of each period, from one rising edge of the force to the next."""
    time, force, edges = vectors["time"], vectors["v(force)"], _edges(vectors)
    velocity = vectors[f"i(v.xmotor.xmode{mode + 1}.vvelocity)"]
    turns = np.exp(-2j * pi * np.interp(time, edges, np.arange(edges.size)))

    def over_periods(values: Array) -> Any:
        summed = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
        return np.diff(np.interp(edges, time, summed.real) + 1j * np.interp(edges, time, summed.imag))

    length = np.diff(edges)
    return Periods(
        0.5 * (edges[1:] + edges[:-1]),
        1.0 / length,
        np.degrees(np.angle(over_periods(velocity * turns) / over_periods(force * turns))),
        over_periods(vectors["v(shaft)"]).real / length,
    )
