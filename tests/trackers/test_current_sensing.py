# SPDX-License-Identifier: GPL-3.0-or-later
"""Sense resistors and current transformers of a tracker, and a loop on the whole current."""

import re
from math import atan2, degrees, pi
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.averaged.core import AveragedMotor
from pyspice_runner.spice.ngspice import run_deck
from pyspice_runner.trackers.tracker import TrackedSource, propose_filter, running_resonance, sensing

BURDEN, CORNER_HZ = 1.0, 4e3  # ohm, Hz: a lead of 5.6° at 40.7 kHz
TRANSFORMER = {"sense_ohm": BURDEN, "magnetizing_h": BURDEN / (2.0 * pi * CORNER_HZ)}


def tracker(**values: Any) -> pr.Tracker:
    return pr.Tracker(**{"kind": "pll", "voltage": 60.0, "frequency": 40.7e3, "target_deg": -20.0, **values})


def phasor(time: Any, values: Any, frequency: float) -> complex:
    late = time >= time[-1] - 20.0 / frequency
    time, values = time[late], values[late]
    turns = np.exp(-2j * pi * frequency * time)
    return complex(2j * np.trapezoid(values * turns, time) / (time[-1] - time[0]))


@pytest.mark.parametrize("magnetizing_h", [0.0, TRANSFORMER["magnetizing_h"]])
def test_the_circuit_senses_the_current_behind_its_transformer(magnetizing_h: float) -> None:
    """Over 1 − j corner/frequency; a resistor of 1 Ω passes the whole. The modes still ring beside the drive: 1e-3."""
    chosen = tracker(kind="none", sense_ohm=BURDEN, magnetizing_h=magnetizing_h)
    found = pr.track(pr.load_motor("bimodal40"), chosen, 2.5e-3, contact=None, margin=False)
    names = [f"i({name}_{group})" for group in "ab" for name in ("v.xsense.vline", "vdrawn")]
    deck = re.sub(r"^\.save .*$", f".save time {' '.join(names)}", found.deck, flags=re.M)
    vectors = run_deck(deck, vectors=names, stop_time=2.5e-3).raw.vectors
    time = vectors["time"].real
    for sensed, drawn in (names[:2], names[2:]):
        whole = phasor(time, vectors[drawn].real, 40.7e3)
        part = phasor(time, vectors[sensed].real, 40.7e3)
        corner = CORNER_HZ if magnetizing_h else 0.0
        assert part / whole == pytest.approx(1.0 / (1.0 - 1j * corner / 40.7e3), abs=2e-3)


@pytest.mark.parametrize("changes", [{}, TRANSFORMER], ids=["ammeter", "transformer"])
def test_a_loop_holds_what_its_transformer_shows_at_the_target(changes: dict[str, float]) -> None:
    """The phase by hand, from the currents of the averaged motor at the frequency where the loop settles."""
    motor, chosen = pr.load_motor("bimodal40"), tracker(**changes)
    found = pr.track(motor, chosen, 150e-3, averaged=True)
    assert found.locked
    frequency = found.end_frequency_hz
    running = AveragedMotor(motor)
    preload, friction = motor.contact.preload_n, motor.contact.friction
    running.begin(
        amplitude_a=60.0, amplitude_b=60.0, phase=90.0, frequency=frequency, preload=preload, friction=friction
    )
    running.settle()
    pins, currents = np.array([60.0, 60.0j]), np.zeros(2, complex)
    for at, group in enumerate("ab"):  # a phase is that ahead of the group's voltage
        turn = 90.0 * at + running.get(f"current_phase_{group}")
        currents[at] = running.get(f"current_amplitude_{group}") * np.exp(1j * np.radians(turn))
    known = sensing(motor, chosen, motor.main_mode)
    share = 1.0 / (1.0 - 1j * CORNER_HZ / frequency) if changes else 1.0
    motional = force = 0j
    for at, group in enumerate("ab"):
        copy = 1.0 / (known[f"resistance_{group}"] - 1j / (2.0 * pi * frequency * known[f"capacitance_{group}"]))
        motional += known[f"current_{group}"] * (share * currents[at] - copy * pins[at])
        force += known[f"force_{group}"] * pins[at]
    sensed = motional / force
    assert degrees(atan2(sensed.imag, sensed.real)) == pytest.approx(-20.0, abs=0.01)


def test_without_copies_the_whole_current_is_sensed() -> None:
    motor = pr.load_motor("bimodal40")
    copies, whole = (sensing(motor, tracker(copies=copies), motor.main_mode) for copies in (True, False))
    assert whole["capacitance_a"] == pytest.approx(1e-6 * copies["capacitance_a"])
    assert whole["current_a"] == copies["current_a"]


def test_a_pin_current_is_measured_in_front_of_the_transformer() -> None:
    motor, chosen = pr.load_motor("bimodal40"), tracker(**TRANSFORMER)
    source = TrackedSource(chosen, motor.main_mode, propose_filter(chosen, running_resonance(motor, chosen)))
    assert chosen.sensed_share(40.7e3) == pytest.approx(1.0 / (1.0 - 1j * CORNER_HZ / 40.7e3))
    assert source.current("a") == ("i(vdrawn_a)", 1.0)
    assert source.tracker.sense_corner_hz == pytest.approx(CORNER_HZ)


def test_a_feedback_electrode_senses_the_velocity_of_its_mode() -> None:
    """Its current on a short circuit is θ_F times the velocity, for any shares of the voltages; 1 % still rings."""
    electrode = {"capacitance_f": 3e-10, "couplings_n_per_v": {"mode-4": 0.02}, "share_a": 0.1, "share_b": 0.12}
    motor = pr.load_motor("bimodal40").updated({"feedback": electrode})
    found = pr.track(motor, tracker(kind="none", sense="feedback"), 2.5e-3, margin=False)
    names = ["v(motional)", "i(v.xmotor.xmode4.vvelocity)"]
    deck = re.sub(r"^\.save .*$", f".save time {' '.join(names)}", found.deck, flags=re.M)
    vectors = run_deck(deck, vectors=names, stop_time=2.5e-3).raw.vectors
    sensed, velocity = (phasor(vectors["time"].real, vectors[name].real, 40.7e3) for name in names)
    assert sensed / velocity == pytest.approx(0.02, rel=0.01)


def test_a_motor_without_electrode_is_refused_with_the_remedy() -> None:
    with pytest.raises(pr.ParameterError, match=r"sense = 'feedback' needs a feedback electrode on the mode mode-4"):
        pr.track(pr.load_motor("bimodal40"), tracker(sense="feedback"), margin=False)
