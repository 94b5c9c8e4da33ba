# SPDX-License-Identifier: GPL-3.0-or-later
"""Trackers: lag of a running stator and its filter against closed forms, circuits, errors, and decks."""

import re
from math import atan, cos, degrees, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySpice.Spice.Netlist import Circuit

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.spice.library import read_library
from pyspice_runner.spice.ngspice import BatchSimulator
from pyspice_runner.trackers.tracker import (
    Disturbance,
    Disturbances,
    StatorLag,
    TrackedSource,
    Tracker,
    loop_gain,
    propose_filter,
    running_resonance,
    slider_cycle,
    stator_lag,
    weights,
)
from tests.circuit.test_decks import measured, run_with
from tests.motors import motor as odd_motor

pytestmark = pytest.mark.xdist_group("trackers")

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
CONTACT = MOTOR.contact
LIMIT = contact_law.limit_ratio(CONTACT) * contact_law.static_penetration(CONTACT)


def tracker(**values: Any) -> Tracker:
    return Tracker(**{"kind": "pll", "voltage": 50.0, "frequency": 51.7e3, **values})


def run(chosen: Tracker, disturbance: Disturbance, contact: Any, end: float, *names: str) -> dict[str, np.ndarray]:
    lag = running_resonance(MOTOR, chosen, contact=contact is not None)
    step = 100e-9
    source = TrackedSource(chosen, 1, propose_filter(chosen, lag), disturbances=Disturbances((disturbance,)))
    bench = motor_bench(
        MOTOR, source, law=Law() if contact else None,
        discretisation=Discretisation(step, exact_resonance=False),
    )  # fmt: skip
    simulator = BatchSimulator(bench.circuit)
    simulator.options(**bench.options)
    simulator.save(*names)
    simulator.transient(step_time=step, end_time=end, max_time=step, use_initial_condition=True)
    return {name: np.asarray(values, float) for name, values in simulator.result.raw.vectors.items()}


def test_the_phase_between_the_groups_stays_while_the_frequency_moves() -> None:
    chosen = tracker(offset=-0.03, phase_deg=60.0, ratio_b=1.5)
    found = run(chosen, Disturbance(kind="start"), None, 2e-3, "v(a)", "v(b)", "v(sine)", "v(cosine)", "v(tuned)")
    assert np.ptp(found["v(tuned)"]) > 1000.0
    turned = 0.5 * found["v(sine)"] + sqrt(0.75) * found["v(cosine)"]
    assert found["v(a)"] == pytest.approx(50.0 * found["v(sine)"], abs=1e-3)
    assert found["v(b)"] == pytest.approx(75.0 * turned, abs=1e-3)
    # the oscillator holds its amplitude, so that sine and cosine are 90° apart
    assert np.hypot(found["v(sine)"], found["v(cosine)"]) == pytest.approx(1.0, abs=1e-3)


def test_what_is_sensed_is_the_velocity_and_the_force_of_the_mode() -> None:
    """To the trapezoidal rule's own accuracy, while the frequency moves and both modes do."""
    chosen = tracker(offset=-0.03, phase_deg=40.0, ratio_b=0.7)
    names = ("v(motional)", "v(force)", "v(ahead)", "v(a)", "v(b)", "i(v.xmotor.xmode2.vvelocity)", "v(tuned)")
    found = run(chosen, Disturbance(kind="start"), None, 1e-3, *names)
    late = found["time"] > 0.1e-3  # the plates start discharged, their copies too
    velocity = found["i(v.xmotor.xmode2.vvelocity)"][late]
    scale = 2.0 * MOTOR.modes[1].coupling_a_n_per_v  # i_A − i_B = 2 θ v
    assert found["v(motional)"][late] == pytest.approx(scale * velocity, abs=1e-3 * scale * np.abs(velocity).max())
    assert found["v(force)"] == pytest.approx(found["v(a)"] - found["v(b)"], abs=1e-6)
    # the rate over 2πf, f in the middle of the range; the copies' loss lags by atan(tan δ f/f_ref) = 1.1°
    rate = np.gradient(found["v(force)"], found["time"]) / (2.0 * np.pi * 51.7e3)
    assert found["v(ahead)"][late] == pytest.approx(rate[late], abs=0.03 * np.abs(rate).max())


def test_weights_single_out_a_mode_of_any_motor() -> None:
    assert weights(MOTOR, 0) == pytest.approx({"force_a": 1, "force_b": 1, "current_a": 1, "current_b": 1})
    assert weights(MOTOR, 1) == pytest.approx({"force_a": 1, "force_b": -1, "current_a": 1, "current_b": -1})
    odd = odd_motor()
    two = odd.model_copy(update={"modes": odd.modes[:2]})
    for mode in (0, 1):
        found = weights(two, mode)
        seen = [
            found["current_a"] * own.coupling_a_n_per_v + found["current_b"] * own.coupling_b_n_per_v
            for own in two.modes
        ]
        assert seen[1 - mode] == pytest.approx(0.0, abs=1e-12)
        assert seen[mode] > 0.0


@pytest.mark.parametrize("change", [0.3, pytest.param(-0.3, marks=pytest.mark.soak)])
def test_a_preload_steps_to_what_is_asked_for(change: float) -> None:
    """The mean once the modes have rung down: Hertz's law is curved, by 1e-3 for what still rings."""
    chosen = tracker(kind="none", voltage=0.01)
    found = run(
        chosen,
        Disturbance(kind="preload", begin_s=0.1e-3, preload_change=change),
        "spring-slider",
        3e-3,
        "v(xmotor.normal)",
    )
    late = found["time"] > 2e-3
    mean = np.trapezoid(found["v(xmotor.normal)"][late], found["time"][late]) / np.ptp(found["time"][late])
    assert found["v(xmotor.normal)"][5] == pytest.approx(MOTOR.contact.preload_n, rel=1e-3)
    assert mean == pytest.approx(MOTOR.contact.preload_n * (1.0 + change), rel=1e-3)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"kind": "magic"}, "kind = 'magic' is not valid"),
        ({"offset": 0.1}, "offset = 0.1 is not valid; the oscillator reaches 0.07 either way"),
        ({"target_deg": 90.0}, "target_deg = 90 ° is not valid"),
    ],
)
def test_errors_name_the_value(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        tracker(**values)


@pytest.mark.parametrize("target", [-60.0, 0.0, 45.0])
def test_the_detector_and_its_mean_measure_leads_from_both_sides(target: float) -> None:
    """Over 20 periods of 200 steps; an edge is seen at the end of a step, each of two by up to 1.8° late."""
    leads = (-150.0, -90.0, -30.0, 30.0, 90.0, 150.0, 180.0)
    circuit = Circuit("detectors")
    parts = ("tracker_detector", "tracker_restart", "tracker_averaged")
    circuit.raw_spice += "\n".join(read_library(part).subcircuit for part in parts) + "\n"
    circuit.V("target", "target", 0, target)
    circuit.V("force", "force", 0, "SIN(0 1 50k 0 0 0)")
    circuit.V("ahead", "ahead", 0, "SIN(0 1 50k 0 0 90)")
    circuit.V("middle", "middle", 0, 2.5)
    for at, lead in enumerate(leads):
        circuit.V(f"motional{at}", f"motional{at}", 0, f"SIN(0 1 50k 0 0 {lead})")
        circuit.I(f"re{at}", f"re{at}", 0, cos(radians(lead)))
        circuit.I(f"im{at}", f"im{at}", 0, sin(radians(lead)))
        for kind in "pm":
            circuit.V(f"{kind}{at}", f"{kind}{at}", "middle", 0.0)
        pins = (f"motional{at}", "force", "ahead", "target", f"p{at}")
        instantiate(circuit, f"detector{at}", "tracker_detector", pins)
        ends = ("target", "middle", f"m{at}", f"tuned{at}", f"phase{at}", 0)
        pins = ("middle", f"re{at}", 0, f"im{at}", 0, f"c{at}", 0, f"d{at}", *ends)
        instantiate(circuit, f"averaged{at}", "tracker_averaged", pins, capacitance_a=1e-15)
    simulator = BatchSimulator(circuit)
    simulator.save(*(f"i(v{kind}{at})" for kind in "pm" for at in range(len(leads))))
    simulator.transient(step_time=100e-9, end_time=420e-6, max_time=100e-9, use_initial_condition=True)
    found = {name: np.asarray(values, float) for name, values in simulator.result.raw.vectors.items()}
    late = found["time"] >= 20e-6
    for at, lead in enumerate(leads):
        wanted = 20e-6 * ((lead if lead < 165.0 else -165.0) - target) / 360.0
        of_pulses = np.trapezoid(found[f"i(vp{at})"][late], found["time"][late]) / 400e-6
        assert of_pulses == pytest.approx(wanted, abs=20e-6 * 3.6 / 360.0), lead
        assert found[f"i(vm{at})"][-1] == pytest.approx(wanted, abs=1e-10), lead


# --- lag and filter --------------------------------------------------------------------------------------------


def test_a_small_cycle_sticks_and_a_large_one_slips() -> None:
    stiffness, loss = slider_cycle(CONTACT, 1e-4 * LIMIT)
    # the spring softens by |u|/4 u_lim
    assert stiffness == pytest.approx(contact_law.tangential_stiffness_at_preload(CONTACT), rel=1e-4)
    assert abs(loss) < 1e-9 * stiffness
    amplitude = 1e3 * LIMIT
    stiffness, loss = slider_cycle(CONTACT, amplitude)
    # a square wave of ±μF₀, but for 2 u_lim at each corner
    assert loss == pytest.approx(4.0 / pi * CONTACT.friction * CONTACT.preload_n / amplitude, rel=2e-3)
    assert stiffness < 0.1 * loss


def test_a_free_mode_has_its_own_lag() -> None:
    mode = MOTOR.modes[1]
    lag = stator_lag(MOTOR, 1, 3.0, contact=False)
    assert (lag.resonance_hz, lag.quality) == (mode.frequency_hz, mode.quality_factor)
    assert lag.time_constant_s == pytest.approx(2.0 * mode.mass_kg / mode.damping_n_s_per_m)
    assert lag.amplitude_m == pytest.approx(3.0 / (mode.damping_n_s_per_m * 2.0 * pi * mode.frequency_hz))
    # at half the bandwidth, f/2Q, the phase is 45°
    assert lag.detuning_hz(-45.0) == pytest.approx(mode.frequency_hz / (2.0 * mode.quality_factor))


def test_a_mode_that_sticks_resonates_with_the_springs_of_the_contact() -> None:
    mode = MOTOR.modes[1]
    stiffness = mode.stiffness_n_per_m + contact_law.tangential_stiffness_at_preload(CONTACT) * mode.tip_x**2
    lag = stator_lag(MOTOR, 1, 1e-4)
    assert lag.resonance_hz == pytest.approx(sqrt(stiffness / mode.mass_kg) / (2.0 * pi), rel=1e-4)
    assert lag.quality == pytest.approx(sqrt(stiffness * mode.mass_kg) / mode.damping_n_s_per_m, rel=1e-4)


@pytest.mark.parametrize("target", [0.0, -40.0])
@pytest.mark.parametrize("ratio", [2.0, 6.0])
def test_the_proposed_filter_gives_the_bandwidth_and_the_margin(target: float, ratio: float) -> None:
    lag, chosen = StatorLag(50e3, 40.0), tracker(bandwidth_hz=700.0, target_deg=target, ripple_ratio=ratio)
    proposed = propose_filter(chosen, lag)
    gain = loop_gain(chosen, lag, proposed, 700.0)
    assert abs(gain) == pytest.approx(1.0, rel=1e-12)
    if target == 0.0:  # elsewhere the zero does not lie on the lag
        assert 180.0 + degrees(np.angle(gain)) == pytest.approx(90.0 - degrees(atan(1.0 / ratio)), abs=1e-9)
    assert proposed.resistance_ohm * proposed.capacitance_f == pytest.approx(lag.time_constant_s)


def test_a_mode_that_does_not_rub_keeps_its_own_damping() -> None:
    motor = MOTOR.updated({"modes.0.tip_x": 0.0})
    mode = motor.modes[0]
    lag = stator_lag(motor, 0, 3.0)
    stiffness = mode.stiffness_n_per_m + contact_law.normal_stiffness_at_preload(CONTACT) * mode.tip_y**2
    omega = sqrt(stiffness / mode.mass_kg)
    assert lag.resonance_hz == pytest.approx(omega / (2.0 * pi))
    assert lag.quality == pytest.approx(mode.mass_kg * omega / mode.damping_n_s_per_m)
    assert lag.amplitude_m == pytest.approx(3.0 / (mode.damping_n_s_per_m * omega))


@pytest.mark.parametrize("contact", [True, False])
def test_a_mode_that_nothing_drives_is_rejected(contact: bool) -> None:
    motor = MOTOR.updated({"modes.1.coupling_a_n_per_v": 0.0, "modes.1.coupling_b_n_per_v": 0.0})
    with pytest.raises(pr.ParameterError, match=r"Nothing drives mode .*; choose another mode"):
        running_resonance(motor, tracker(kind="none"), contact=contact)


# --- decks ---------------------------------------------------------------------------------------------------


@pytest.mark.soak
def test_deck_of_the_phase_locked_loop_locks(tmp_path: Path) -> None:
    found = run_with("tracker_pll", {"stop": "5.5m"}, tmp_path)  # locked after 3 ms; means of the last 2 ms
    lag = running_resonance(MOTOR, tracker(ratio_b=2.0))
    assert found["frequency_start_hz"] == pytest.approx(1.03 * 51.7e3)
    # harmonic balance leaves out what the other mode and the turning rotor do: 2 % of the bandwidth, 1100 Hz
    assert found["frequency_end_hz"] == pytest.approx(lag.resonance_hz, abs=20.0)
    assert found["in_phase_va"] > 0.99 * found["force_rms_v"] * found["motional_rms_a"]


def test_deck_of_the_loop_gain_has_the_bandwidth_and_the_margin(tmp_path: Path) -> None:
    found = measured("tracking_loop", tmp_path)
    assert found["loop_gain"] == pytest.approx(1.0, rel=0.01)  # parts of three digits
    assert found["phase_margin_deg"] == pytest.approx(90.0 - np.degrees(np.arctan(1.0 / 6.0)), abs=0.3)


def test_a_drift_by_temperature_takes_a_coefficient() -> None:
    still = pr.Thermal(frequency_drift_per_k=0.0)
    assert Disturbance(kind="temperature", thermal=still).rise_k == 0.0
    with pytest.raises(pr.ParameterError, match=r"frequency_drift_per_k = 0 is not valid: it must be other than 0"):
        _ = Disturbance(kind="temperature", drift=-0.01, thermal=still).rise_k


def test_disturbances_lead_from_one_value_to_the_next_and_do_not_overlap() -> None:
    steps = [Disturbance(kind="load", begin_s=at, load_torque_n_m=load) for at, load in ((1e-3, 0.1), (2e-3, 0.0))]
    found = Disturbances(tuple(steps))
    times, loads = np.transpose(found.course("load"))
    assert np.interp([0.5e-3, 1.1e-3, 1.5e-3, 3e-3], times, loads) == pytest.approx([0.0, 0.05, 0.1, 0.0])
    assert (found.begin_s, found.end_s, found.last("load"), found.last("preload")) == (1e-3, 2.2e-3, 0.0, 0.0)
    with pytest.raises(pr.ParameterError, match=r"'load' at 0\.0011 s is not valid: it must begin at 0\.0012 s"):
        Disturbances((steps[0], steps[1].model_copy(update={"begin_s": 1.1e-3})))
