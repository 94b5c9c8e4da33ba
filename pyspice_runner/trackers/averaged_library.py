# SPDX-License-Identifier: GPL-3.0-or-later
"""A phase-locked loop in front of the averaged motor: the tracker of ``trackers.py``, averaged over its pulses."""

from __future__ import annotations

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.averaged.driver import AveragedDrive
from pyspice_runner.averaged.library import OPTIONS, add_averaged_motor
from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.fixtures import add_cooling
from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import Load, TwoPhaseDrive, two_phases
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import read_library
from pyspice_runner.trackers.tracker import (
    RAIL,
    Disturbance,
    TrackedSource,
    add_disturbance,
    add_filter,
    sensing,
    target_course,
)

AVERAGED_DISTURBANCES = ("start", "target", "load", "temperature", "warm-up")
_AMPLITUDES = ("a_re", "a_im", "b_re", "b_im")


def check_averaged_tracker(source: TrackedSource, disturbance: Disturbance) -> None:
    """Raise ParameterError for what has no averaged model: an observer, or a change of the preload."""
    if source.tracker.kind not in ("pll", "none"):
        raise ParameterError(
            f"The tracker {source.tracker.kind!r} has no averaged model: it must be 'pll' or 'none'. Leave averaged "
            "out."
        )
    if disturbance.kind not in AVERAGED_DISTURBANCES:
        raise ParameterError(
            f"disturb = {disturbance.kind!r} has no averaged model: it must be one of "
            f"{', '.join(AVERAGED_DISTURBANCES)}."
        )


def tracker_values(motor: Motor, source: TrackedSource) -> dict[str, float]:
    """Return the parameters of ``tracker_averaged`` and ``tracker_filter`` by their names, for the compiled motor.

    Without a tracker the pump has no current, and the filter keeps its voltage.
    """
    own, tracker = source.loop_filter, source.tracker
    values = _loop_values(motor, source) | {
        "resistance": own.resistance_ohm, "capacitance": own.capacitance_f, "ripple": own.ripple_f,
        "start": tracker.start_v,
    }  # fmt: skip
    return values if tracker.kind == "pll" else values | {"current": 0.0}


def averaged_front(source: TrackedSource) -> AveragedDrive:
    """Return the voltages in front of the motor, and the network of a driver."""
    if source.driver:
        return AveragedDrive.of(source.driver)
    return AveragedDrive(TwoPhaseDrive(**two_phases(source.tracker)))


def _loop_values(motor: Motor, source: TrackedSource) -> dict[str, float]:
    tracker = source.tracker
    return {
        "drift": tracker.copies_drift_per_k, **sensing(motor, tracker, source.mode), **tracker.tuned_hz,
        "current": tracker.pump_current_a, "polarity": tracker.polarity, "rail": RAIL,
    }  # fmt: skip


def averaged_tracked_bench(
    motor: Motor,
    source: TrackedSource,
    disturbance: Disturbance,
    load: Load,
    *,
    frozen: tuple[float, float] | None = None,
    thermal: Thermal | None = None,
) -> Bench:
    """Return a bench with an averaged motor behind a tracker.

    Nodes: ``tuned`` (Hz, the frequency), ``phase`` (rad, of the motional current against the target), ``control`` (V),
    ``shaft`` (rad/s), ``temperature`` (K). The load adds to the disturbance; a ``"warm-up"`` heats the motor by its
    losses. ``frozen`` is the control voltage and the temperature at which the loop is open, for ``.ac`` from the
    oscillator's input; ``thermal`` is the drift with that temperature, by default that of the disturbance.
    """
    tracker = source.tracker
    circuit = Circuit(f"{motor.name}: averaged over the period of the drive, tracked")
    parts = ("tracker_averaged", "tracker_filter")
    circuit.raw_spice += "\n".join(read_library(part).subcircuit for part in parts) + "\n"
    start = {}
    front = averaged_front(source)
    sources = "stage" if front.networks else "line"
    for group, volts in front.phasors.items():
        for part, value in (("re", volts.real), ("im", volts.imag)):
            node = f"{group}_{part}"
            circuit.V(f"line_{node}", f"{sources}_{node}", circuit.gnd, f"DC {value!r}")
            start[node] = 0.0 if front.networks else value
    if front.networks:
        front.add(circuit, after="line", frequency="tuned")
    circuit.V("target", "target", circuit.gnd, target_course(tracker, disturbance))
    if tracker.kind == "none" or frozen:
        tuning, temperature = frozen or (tracker.start_v, 0.0)
        circuit.V("tuning", "tuning", circuit.gnd, f"DC {tuning!r} AC 1")
        circuit.V("control", "control", circuit.gnd, f"DC {tuning!r}")
        if thermal:
            circuit.V("temperature", "temperature", circuit.gnd, f"DC {temperature!r}")
    else:
        circuit.V("inject", "tuning", "control", "DC 0")
        add_filter(circuit, source.loop_filter, tracker.start_v)
    lines = [node for pin in _AMPLITUDES for node in (f"line_{pin}", pin)]
    instantiate(
        circuit, "tracker", "tracker_averaged",
        (*lines, "target", "tuning", "control", "tuned", "phase", "temperature"),
        **_loop_values(motor, source),
    )  # fmt: skip
    if disturbance.kind == "warm-up":
        add_cooling(circuit, disturbance.thermal or Thermal())
    add_disturbance(circuit, motor, disturbance)
    if load.speed is not None:
        circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(load.speed)!r}")
    pins = (*_AMPLITUDES, "tuned", "shaft", "temperature", "heat")
    add_averaged_motor(circuit, motor, pins, thermal=thermal or disturbance.drifting)
    return Bench(circuit, OPTIONS, start)
