# SPDX-License-Identifier: GPL-3.0-or-later
"""Phase-locked loops in front of the averaged motor, averaged over the pulses, by the compiled motor or in ngspice."""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import ceil, pi, radians
from time import monotonic
from typing import Any

import numpy as np
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.averaged.core import AveragedMotor, Loop
from pyspice_runner.averaged.driver import AveragedDrive
from pyspice_runner.averaged.errors import estimate
from pyspice_runner.averaged.library import HARMONICS, OPTIONS, Schedule, add_averaged_motor, schedule_text
from pyspice_runner.averaged.point import INPUT_OF, LONGEST_STEPS, VALUES_OF_A_FUNCTION, AveragedPoint, deck_of
from pyspice_runner.averaged.run import ErrorEstimate
from pyspice_runner.averaged.simulate import RECORDED, averaged_engine, mode_amplitudes, phasor
from pyspice_runner.circuit.bench import Bench, add_cooling
from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import BRIDGES
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Load, TwoPhaseDrive, two_phases, two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.kernel import Outcome, run_bench, transient_timing
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array
from pyspice_runner.spice import Engine
from pyspice_runner.spice.library import read_library
from pyspice_runner.steady.small_signals import loop_margins
from pyspice_runner.trackers.loop import POINTS_PER_DECADE, Complex, LoopDesign, swept_hz, volts
from pyspice_runner.trackers.tracker import RAIL, SMOOTHED_PERIODS, StatorLag, TrackedSource, add_filter, sensing

_AMPLITUDES = ("a_re", "a_im", "b_re", "b_im")


def averaged_front(source: TrackedSource) -> AveragedDrive:
    """Return the voltages in front of the motor, and the network of a driver."""
    return AveragedDrive.of(source.driver or TwoPhaseDrive(**two_phases(source.tracker)))


def _loop_values(motor: Motor, source: TrackedSource) -> dict[str, float]:
    tracker = source.tracker
    return {
        "drift": tracker.copies_drift_per_k, "sense_corner": tracker.sense_corner_hz,
        **sensing(motor, tracker, source.mode), **tracker.tuned_hz,
        "current": tracker.pump_current_a, "polarity": tracker.polarity, "rail": RAIL, **(source.restart or {}),
    }  # fmt: skip


def averaged_tracked_bench(
    motor: Motor, source: TrackedSource, load: Load, *, end: Mapping[str, float] | None = None
) -> Bench:
    """Return a bench with an averaged motor behind a tracker.

    Nodes: ``tuned`` (Hz, the frequency), ``phase`` (rad, of the motional current against the target), ``control`` (V),
    ``shaft`` (rad/s), ``temperature`` (K). The load adds to the disturbance. With the vectors of the ``end`` of a run
    the loop is open, for ``.ac`` from the oscillator's input, at the target, the speed and the temperature there.
    """
    tracker, disturbances, drifting = source.tracker, source.disturbances, source.disturbances.drifting
    circuit = Circuit(f"{motor.name}: averaged over the period of the drive, tracked")
    parts = ("tracker_restart", "tracker_averaged", "tracker_filter")
    circuit.raw_spice += "\n".join(read_library(part).subcircuit for part in parts) + "\n"
    start = {}
    if not end:  # the first iterations divide by the frequency
        begun = tracker.frequency * (1.0 + tracker.offset)
        start = {"tuned": begun, "tuning": tracker.start_v, "control": tracker.start_v}
    front = averaged_front(source)
    sources = "stage" if front.networks else "line"
    for group, voltage in two_phasors(front.stage).items():
        for part, value in (("re", voltage.real), ("im", voltage.imag)):
            node = f"{group}_{part}"
            course = [(0.0, value)] if end else disturbances.course("supply", value, value)
            circuit.V(f"line_{node}", f"{sources}_{node}", circuit.gnd, schedule_text(course))
            start[node] = 0.0 if front.networks else value
    if front.networks:
        front.add(circuit, after="line", frequency="tuned")
    targets = [(0.0, end["v(target)"])] if end else source.targets
    circuit.V("target", "target", circuit.gnd, schedule_text(targets))
    if tracker.kind == "none" or end:
        tuning = end["v(control)"] if end else tracker.start_v
        circuit.V("tuning", "tuning", circuit.gnd, f"DC {tuning!r} AC 1")
        circuit.V("control", "control", circuit.gnd, f"DC {tuning!r}")
    else:
        circuit.V("inject", "tuning", "control", "DC 0")
        add_filter(circuit, source.loop_filter, tracker.start_v)
    lines = [node for pin in _AMPLITUDES for node in (f"line_{pin}", pin)]
    instantiate(
        circuit, "tracker", "tracker_averaged",
        (*lines, "target", "tuning", "control", "tuned", "phase", "temperature"),
        **_loop_values(motor, source),
    )  # fmt: skip
    if end and drifting:
        circuit.V("temperature", "temperature", circuit.gnd, f"DC {end['v(temperature)']!r}")
    if not end:
        if drifting and disturbances.of("warm-up"):
            add_cooling(circuit, drifting)
        disturbances.add(circuit, motor)
    speed = end["v(shaft)"] if end else load.speed
    if speed is not None:
        circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(speed)!r}")
    pins = (*_AMPLITUDES, "tuned", "shaft", "temperature", "heat")
    add_averaged_motor(circuit, motor, pins, thermal=drifting)
    return Bench(circuit, OPTIONS, start)


LONGEST = 1e5  # s, of an averaged run
# s of wall time without a timeout: at the limit of its oscillator a loop can oscillate with very short steps
PATIENCE = 60.0
NEAR = ("v(xmotor.", "v(xnetwork_", "v(line_", "v(a_", "v(b_")  # nodes with which the search of the .op begins
# states that the loop is too fast for, and those of a restart
_HELD = ("speed", "position", "load_speed", "load_position", "temperature", "timer", "restart")


@dataclass(frozen=True)
class TrackedRun:
    """Inputs of a run with a tracker."""

    setup: Point  # motor, source, load, law and solver
    source: TrackedSource  # the tracker at its pins, with the disturbance
    duration: float  # simulated time in s
    lag: StatorLag  # resonance and lag of the mode, for which the filter was designed
    stall_torque_n_m: float | None  # torque on a held shaft, if it was measured
    margin: bool  # whether to find the loop gain at the end


@dataclass(frozen=True)
class AveragedTrack:
    """A run of the averaged motor with a loop: over time, and at the end; by either engine.

    Over time: the names of an averaged run, ``phase_deg`` of the mode's velocity ahead of the force, and ``restart``,
    1 while a restart returns the oscillator to its start. At the end: phasors of the voltages (V) and currents (A) of
    the groups, amplitudes of the modes (m) and the loop.
    """

    curves: Mapping[str, Array]
    voltages: Complex
    currents: Complex
    amplitudes: list[float]
    find_loop: Callable[[], LoopDesign]
    seconds: float
    ngspice_version: str | None
    deck: str | None = field(repr=False)  # for ngspice; ``None`` where it has no model of the run
    deck_sha256: str | None


def run_averaged(run: TrackedRun, engine: Engine) -> AveragedTrack:
    """Run the averaged motor with a tracker.

    Raise ParameterError for what has no averaged model, SimulationError if the engine fails.
    """
    setup, source, disturbances = run.setup, run.source, run.source.disturbances
    if source.tracker.kind not in ("pll", "none"):
        raise ParameterError(
            f"tracker = {source.tracker.kind!r} has no averaged model: it must be pll or none. Or leave averaged out."
        )
    if disturbances.of("supply") and source.driver and source.driver.kind not in ("ideal", *BRIDGES):
        raise ParameterError(
            f"disturb = 'supply' of a {source.driver.name} has no averaged model, as it clips its voltages. Leave "
            "averaged out."
        )
    compiled = averaged_engine(engine) == "compiled"
    if disturbances.of("preload") and not compiled:
        raise ParameterError(
            "disturb = 'preload' has no averaged model in ngspice: give engine='compiled', or leave averaged out."
        )
    least = 2 * SMOOTHED_PERIODS / source.tracker.frequency
    words = f"from {least:.3g} s, 40 periods, to {LONGEST:g} s"
    require(least <= run.duration <= LONGEST, "duration", run.duration, words, unit="s")
    bench = partial(averaged_tracked_bench, setup.motor, source, setup.load)
    timing = transient_timing(source.period, run.duration, run.duration / LONGEST_STEPS["spice"])
    if compiled:
        absent = setup.motor.contacts or disturbances.of("preload")  # of ngspice
        return _compiled(run, None if absent else deck_of(bench, ["all"], timing))
    return _spice(run, run_bench(bench(), ["all"], setup.solver.timeout, "transient", timing))


def replayed(run: TrackedRun, time: Array, frequency: Array) -> ErrorEstimate:
    """Estimate the errors of the averaged motor at the frequencies in Hz that a tracker sets at times in s."""
    setup, source, disturbances = run.setup, run.source, run.source.disturbances
    thermal, every = disturbances.drifting, ceil(len(time) / VALUES_OF_A_FUNCTION)
    courses: dict[str, Any] = {"frequency": np.transpose([time, frequency])[::every], **_moved(run)}
    if disturbances.of("temperature") and thermal:  # the stator follows the course at once, not its own losses
        thermal = thermal.model_copy(update={"heat_capacity_j_per_k": 1e-9, "thermal_resistance_k_per_w": 1e-3})
    drive = source.driver or TwoPhaseDrive(**two_phases(source.tracker))
    point = Point.of(
        setup.motor, drive, speed=setup.load.speed, contact=setup.law, thermal=thermal, timeout=setup.solver.timeout
    )
    return estimate(AveragedPoint.of(point, run.duration, courses=courses), run.duration)


def _moved(run: TrackedRun) -> dict[str, Schedule]:
    """Return the courses of both voltages and of what the disturbances move, by the settings of an averaged run."""
    stage, preload = averaged_front(run.source).stage, run.setup.motor.contact.preload_n
    moved = {  # what disturbs it, its value before, and that by which a change counts
        "voltage_a": ("supply", stage.voltage, stage.voltage),
        "voltage_b": ("supply", stage.voltage_b, stage.voltage_b),
        "load_torque": ("load", 0.0, 1.0), "preload": ("preload", preload, preload),
        "temperature": ("temperature", 0.0, 1.0),
    }  # fmt: skip
    courses = {name: run.source.disturbances.course(*how) for name, how in moved.items()}
    return {name: one for name, one in courses.items() if len(one) > 1 or moved[name][0] == "supply"}


def _compiled(run: TrackedRun, deck: str | None) -> AveragedTrack:
    setup, source, disturbances = run.setup, run.source, run.source.disturbances
    tracker, own, front = source.tracker, source.loop_filter, averaged_front(source)
    stage = front.stage
    values = _loop_values(setup.motor, source) | {
        "resistance": own.resistance_ohm, "capacitance": own.capacitance_f, "ripple": own.ripple_f,
        "start": tracker.start_v,
    }  # fmt: skip
    if tracker.kind == "none":  # without current of the pump the filter keeps its voltage
        values["current"] = 0.0
    running = AveragedMotor(
        setup.motor, thermal=disturbances.drifting, speed=setup.load.speed,
        longest=max(run.duration / LONGEST_STEPS["compiled"], source.period), loop=Loop(values, source.mode),
        networks=front.networks,
    )  # fmt: skip
    running.set(phase=stage.phase_deg)
    courses = {"target": source.targets} | {INPUT_OF[name]: course for name, course in _moved(run).items()}
    if disturbances.of("temperature"):  # the stator follows the course, not its own losses
        running.set(heat_capacity=0.0)
    begun = monotonic()
    rows = running.record(courses, run.duration, timeout=setup.solver.timeout or PATIENCE)

    def phasors(of: str) -> Complex:
        found = []
        for group, ahead in zip(GROUPS, (0.0, stage.phase_deg), strict=True):
            turned = radians(running.get(groups.named(f"{of}_phase", group)) + ahead)
            found.append(rect(running.get(groups.named(f"{of}_amplitude", group)), turned))
        return np.array(found)

    return AveragedTrack(
        curves={column: rows[recorded] for column, recorded in RECORDED.items()}
        | {"phase_deg": rows["mode_phase"], "restart": rows["restart"]},
        voltages=phasors("pin") if front.networks else volts(stage),
        currents=phasors("current"),
        amplitudes=running.mode_amplitudes(),
        find_loop=partial(_compiled_loop, run, running),
        seconds=monotonic() - begun,
        ngspice_version=None,
        deck=deck,
        deck_sha256=None,
    )


def _compiled_loop(run: TrackedRun, running: AveragedMotor) -> LoopDesign:
    """Return the loop of the motor at the end of a run, at the speed and the temperature there.

    The small signals about the state there are those of the closed loop. What the control voltage moves, less the
    filter's own current, is what the oscillator's input moves when the loop is open there.
    """
    found, tracker, own = running.linearised(), run.source.tracker, run.source.loop_filter
    place = found.place
    free = [index for index in range(len(found.by_state)) if index not in {place[name] for name in _HELD}]
    row, inner = free.index(place["control"]), free.index(place["filter"])
    closed = found.by_state[np.ix_(free, free)]
    by_filter = np.zeros(len(free))  # of the control voltage, through the filter's resistance
    by_filter[[row, inner]] = -1.0 / own.ripple_f / own.resistance_ohm, 1.0 / own.capacitance_f / own.resistance_ohm
    by_tuning = closed[:, row] - by_filter
    opened = closed.copy()
    opened[:, row] = by_filter
    frequency = swept_hz(tracker)
    s = 2j * pi * frequency[:, np.newaxis, np.newaxis]
    by_frequency = np.linalg.solve(s * np.eye(len(free)) - opened, by_tuning[:, np.newaxis])
    gain = np.asarray(-by_frequency[:, row, 0], dtype=np.complex128)
    return LoopDesign(own, *loop_margins(frequency, gain)[:2], frequency, gain)


def _spice(run: TrackedRun, outcome: Outcome) -> AveragedTrack:
    motor, mode, vectors = run.setup.motor, run.source.mode, outcome.vectors()
    drifting = run.source.disturbances.drifting
    pins = np.array([phasor(vectors, f"v({group}_{{}})") for group in GROUPS])
    currents = [phasor(vectors, f"i(v.xtracker.{groups.named('vline', group)}_{{}})")[-1] for group in GROUPS]
    velocity = phasor(vectors, f"v(xmotor.xmode{mode + 1}_1.v_{{}})")
    force = np.array(motor.modes[mode].couplings) @ pins
    curves = {
        "time_s": vectors["time"], "frequency_hz": vectors["v(tuned)"], "rotor_speed_rad_s": vectors["v(shaft)"],
        "phase_deg": np.degrees(np.angle(velocity * force.conjugate())),
        "temperature_k": vectors["v(temperature)"] if drifting else np.zeros(len(vectors["time"])),
        "normal_force_n": vectors["v(xmotor.normal)"], "heat_w": vectors["v(heat)"],
        "restart": vectors["v(xtracker.restart)"],
    }  # fmt: skip
    return AveragedTrack(
        curves=curves,
        voltages=pins[:, -1],
        currents=np.array(currents),
        amplitudes=mode_amplitudes(motor, vectors, HARMONICS),
        find_loop=partial(_spice_loop, run, outcome),
        seconds=outcome.seconds,
        ngspice_version=outcome.ngspice_version,
        deck=outcome.deck,
        deck_sha256=outcome.deck_sha256,
    )


def _spice_loop(run: TrackedRun, outcome: Outcome) -> LoopDesign:
    """Return the loop of the averaged motor at the end of a run, at the speed and the temperature there."""
    last, source = outcome.last(), replace(run.source, restart=None)  # its timer has no operating point near a guess
    held = averaged_tracked_bench(run.setup.motor, source, run.setup.load, end=last)
    tracker = source.tracker
    lowest, *_, highest = swept_hz(tracker).tolist()
    sweep = {
        "variation": "dec", "number_of_points": POINTS_PER_DECADE, "start_frequency": lowest, "stop_frequency": highest,
    }  # fmt: skip
    guess = {name[2:-1]: value for name, value in last.items() if name.startswith(NEAR)}
    vectors = run_bench(held, ["v(phase)"], None, "ac", sweep, guess).phasors()
    frequency = vectors["frequency"].real
    pump = tracker.polarity * tracker.pump_current_a / (2.0 * pi)
    gain = -pump * source.loop_filter.impedance(2j * pi * frequency) * vectors["v(phase)"]
    return LoopDesign(source.loop_filter, *loop_margins(frequency, gain)[:2], frequency, gain)
