# SPDX-License-Identifier: GPL-3.0-or-later
"""The decks of ``netlists/``: complete circuits that run by ``ngspice -b FILE``, without Python.

``python -m pyspice_runner.netlist.decks`` writes them anew; a test proves that the ones checked in are fresh. They hold
the motor's own parameters, not those adapted to a time step, so that the step may be changed by hand.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path

from PySpice.Spice.Simulation import CircuitSimulation

from pyspice_runner.model.contact import limit_ratio, resonance_under_preload, static_penetration
from pyspice_runner.model.drive import Drive, Load, TwoPhaseDrive, TwoToneDrive
from pyspice_runner.model.impact import Throw
from pyspice_runner.model.load import load_motor
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.model.tracking import LoopFilter, StatorLag
from pyspice_runner.netlist.benches import AC_OPTIONS, TRANSIENT_OPTIONS, admittance_bench
from pyspice_runner.netlist.contact_benches import cyclic_bench, impact_bench
from pyspice_runner.netlist.drivers import GROUPS, Driver
from pyspice_runner.netlist.library import data_path
from pyspice_runner.netlist.motor import Discretisation
from pyspice_runner.netlist.sources import PAPER_LAW, Bench, DriveSource, dynamometer_bench, motor_bench
from pyspice_runner.netlist.trackers import (
    TrackedSource,
    Tracker,
    add_average,
    averaged_bench,
    tracked_lag,
    tracker_filter,
)

MOTOR = "andersen2002"
_STEP = 100e-9  # s: twice the default slider_time of the contact, 180 points a period at 55 kHz
_TAIL_PERIODS = 20  # at the end of a run, over which it is measured


def deck_texts() -> dict[str, str]:
    """Return file name → text of every deck."""
    motor = load_motor(MOTOR)
    return {f"{name}.cir": write(motor) for name, write in _DECKS.items()}


def write_decks(folder: Path) -> list[Path]:
    """Write every deck into a folder and return the files."""
    paths = []
    for name, text in deck_texts().items():
        path = folder / name
        path.write_text(text, encoding="utf-8", newline="\n")
        paths.append(path)
    return paths


def _admittance(motor: Motor, *, preloaded: bool) -> str:
    state = "pressed on the rotor, the contact linearised where it rests" if preloaded else "its tip free"
    circuit = admittance_bench(motor, preloaded=preloaded, title=f"{motor.name}: admittance, {state}")
    for node, (source, copy) in {"y_aa": ("Va", 1), "y_ba": ("Vb", 1), "y_ab": ("Va", 2), "y_bb": ("Vb", 2)}.items():
        circuit.CurrentControlledVoltageSource(node, node, circuit.gnd, f"{source}{copy}", -1)
    circuit.raw_spice += "\n".join(
        [
            "* both groups together (A+B) and against each other (A-B)",
            "Bsum y_sum 0 V=V(y_aa)+V(y_ab)+V(y_ba)+V(y_bb)",
            "Bdifference y_difference 0 V=V(y_aa)-V(y_ab)-V(y_ba)+V(y_bb)\n",
        ]
    )
    measures = {
        "conductance_bending_1_s": "MAX v(y_sum) FROM=10k TO=25k",  # of a complex vector ngspice takes the real part
        "conductance_bending_2_s": "MAX v(y_difference) FROM=45k TO=60k",
    }
    simulation = _simulation(Bench(circuit, AC_OPTIONS), "ac", measures)
    simulation.ac(variation="lin", number_of_points=9501, start_frequency=5e3, stop_frequency=100e3)
    return _finish(
        simulation,
        f"""The electrical two-port of the stator, {state}. The voltages of y_aa, y_ab, y_ba and
        y_bb are the admittances in S; y_sum is both groups driven alike, y_difference both driven against each other.
        Prints the greatest conductance of each mode, at its series resonance.""",
    )


def _transient(
    motor: Motor, drive: Drive, what: str, *, contact: bool = True, duration: float, load_torque: float = 0.0
) -> str:
    bench = motor_bench(
        motor, DriveSource(drive), load=Load(torque=load_torque), law=PAPER_LAW if contact else None,
        title=f"{motor.name}: {what.split('.')[0]}",
    )  # fmt: skip
    tail = f"FROM={duration - _TAIL_PERIODS * drive.period:.9g} TO={duration:g}"
    measures = {"tip_x_peak_to_peak_um": f"PP v(xmotor.x) {tail}", "tip_y_peak_to_peak_um": f"PP v(xmotor.y) {tail}"}
    if contact:
        measures |= {
            "normal_force_least_n": f"MIN v(xmotor.normal) {tail}",
            "normal_force_greatest_n": f"MAX v(xmotor.normal) {tail}",
            "friction_force_mean_n": f"AVG v(xmotor.friction) {tail}",
            "rotor_speed_mean_rad_s": f"AVG v(shaft) {tail}",
        }
    simulation = _simulation(bench, "tran", measures)
    simulation.transient(step_time=_STEP, end_time=duration, max_time=_STEP, use_initial_condition=True)
    text = _finish(
        simulation,
        f"""{what} To plot, inside ngspice: v(xmotor.x), v(xmotor.y), v(xmotor.slider) in um, v(xmotor.normal),
        v(xmotor.friction) in N, v(xmotor.state) 0 separated 1 stick 2 slip, v(shaft) in rad/s.""",
    )
    return _parametrised(text, motor, drive, duration) if contact and isinstance(drive, TwoPhaseDrive) else text


def _parametrised(text: str, motor: Motor, drive: TwoPhaseDrive, duration: float) -> str:
    """Return a deck that begins with its parameters, to which its sources, motor, times and measures refer."""
    values = {
        "frequency": drive.frequency,
        "voltage": drive.voltage,
        "phase": drive.phase_deg,
        "preload": motor.contact.preload_n,
        "stop": duration,
        "step": _STEP,
    }
    meaning = {"frequency": "Hz", "voltage": "V, amplitude", "phase": "degrees, group B ahead of A", "preload": "N"}
    block = [
        f"* {name}: {meaning.get(name, 's')}\n.param {name}={float(f'{value:.10g}')!r}"
        for name, value in values.items()
    ]
    lines = []
    for line in text.splitlines():
        if re.match(r"V[ab] [ab] 0 SIN\(", line):
            phase = "{phase}" if line.startswith("Vb") else "0"
            line = f"{line[:6]} SIN(0 {{voltage}} {{frequency}} 0 0 {phase})"
        elif line.startswith("Xmotor "):
            line += " preload={preload} slider_time={0.5*step}"
        elif line.startswith(".ic "):
            continue
        elif line.startswith(".meas "):
            line = re.sub(r"FROM=\S+ TO=\S+", f"FROM={{stop-{_TAIL_PERIODS}/frequency}} TO={{stop}}", line)
        elif line.startswith(".tran "):
            lines.append(".ic V(xmotor.xgroup_b.plate)={voltage*sin(phase*0.017453292519943295)}")
            line = ".tran {step} {stop} 0 {step} uic"
        lines.append(line)
    first = next(index for index, line in enumerate(lines[1:], start=1) if not line.startswith("*"))
    return "\n".join([*lines[:first], *block, *lines[first:], ""])


def _ellipse(motor: Motor) -> str:
    return _transient(
        motor,
        TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0),
        "Ellipse. Two phases at the second resonance, eq. (1): the tip writes a flat ellipse and turns the rotor.",
        duration=3e-3,
    )


def _figure_eight(motor: Motor) -> str:
    return _transient(
        motor,
        TwoToneDrive(voltage_1=50.0, frequency_1=25e3, voltage_2=50.0, frequency_2=50e3, phase_deg=0.0),
        "Figure eight. A common tone and its octave, opposed, eq. (2): the tip writes an eight.",
        duration=3e-3,
    )


def _first_resonance(motor: Motor) -> str:
    return _transient(
        motor,
        TwoPhaseDrive(voltage=30.0, frequency=resonance_under_preload(motor.contact, motor.modes[0]), phase_deg=0.0),
        "First resonance. Both groups in phase at the first resonance under preload: the tip hammers on the rotor.",
        duration=3e-3,
    )


def _spin_up(motor: Motor) -> str:
    return _transient(
        motor,
        TwoPhaseDrive(voltage=100.0, frequency=51.7e3, phase_deg=90.0),
        "Spin-up. The rotor starts from rest against a load torque of 20 uN.m.",
        duration=20e-3,
        load_torque=20e-6,
    )


def _dynamometer(motor: Motor) -> str:
    drive = TwoToneDrive(voltage_1=100.0, frequency_1=18e3, voltage_2=50.0, frequency_2=54e3, phase_deg=165.0)
    bench = dynamometer_bench(motor, DriveSource(drive), speed=4.0, title=f"{motor.name}: dynamometer")
    first, last = 126, 162  # periods: the first 7 ms settle, the next 2 ms are averaged over
    begin, end = first * drive.period, last * drive.period
    integrals = {
        "torque_mean_n_m": ("xbrake.v_friction", motor.rotor.radius_m),
        "load_torque_mean_n_m": ("xbrake.v_taken", 1.0),
        "normal_force_mean_n": ("xbrake.v_normal", 1.0),
        "share_in_contact": ("xcontactmeter.v_contact", 1.0),
        "share_in_slip": ("xcontactmeter.v_slip", 1.0),
        "power_a_w": ("xmeter_a.v_energy", 1.0),
        "power_b_w": ("xmeter_b.v_energy", 1.0),
        "shaft_power_w": ("xcontactmeter.v_given", 1.0),
    }
    measures = {}
    for name, (node, factor) in integrals.items():
        measures[f"{name}_0"] = f"FIND v({node}) AT={begin:.12g}"
        measures[f"{name}_1"] = f"FIND v({node}) AT={end:.12g}"
        measures[name] = f"PARAM='({name}_1-{name}_0)*{1e-6 * factor / (end - begin):.12g}'"
    simulation = _simulation(bench, "tran", measures)
    simulation.transient(step_time=_STEP, end_time=end + _STEP, max_time=_STEP, use_initial_condition=True)
    return _finish(
        simulation,
        """Dynamometer. The brake holds the rotor at the speed of Vset, in rad/s: 0 is stall, 8 about the no-load speed,
        a negative speed brakes, a higher one overruns the motor. For a load torque instead give Xbrake grip=0
        torque=1m, in N.m. Prints means over 36 periods: differences of what the instruments have integrated, over the
        time.""",
    )


def _impact() -> str:
    throw = Throw(psi=1.2)
    step = float(f"{throw.duration_s / 1000:.2g}")
    end = 1.1 * throw.duration_s
    circuit = impact_bench(throw, contact="brush", step=step, title="Impact: a steel sphere thrown at a half-space")
    scale = throw.limit_ratio * throw.velocity_m_s
    circuit.raw_spice += f"* velocity of the patch in units of kappa v_n\nEpsi psi 0 vx 0 {1.0 / scale:.10g}\n"
    measures = {
        "psi_1": "MAX v(psi) FROM=0 TO=1u",
        "psi_2": f"FIND v(psi) AT={end:.9g}",
        "departure_velocity_m_s": f"FIND v(vy) AT={end:.9g}",
        "spin_rad_s": f"FIND v(spin) AT={end:.9g}",
        "greatest_force_n": "MAX v(normal)",
        "greatest_penetration_um": "MAX v(xcontact.delta)",
        "duration_s": "WHEN v(xcontact.delta)=0 FALL=1",
    }
    simulation = _simulation(Bench(circuit, TRANSIENT_OPTIONS), "tran", measures)
    stop = float(f"{end + step:.9g}")
    simulation.transient(step_time=step, end_time=stop, max_time=step, use_initial_condition=True)
    return _finish(
        simulation,
        f"""Impact. A steel sphere, {1e3 * 2 * throw.radius_m:g} mm, lands at {throw.velocity_m_s:g} m/s on a half-space
        of steel, oblique. The capacitors hold its masses and, as ic, its velocities; v(vx) is that of the patch.
        To plot, inside ngspice: v(normal), v(friction) in N, v(xcontact.delta) in um, v(psi), v(state) 0 separated,
        1 stick, 2 gross slip, between them the part of the contact that slips. Prints the rebound.""",
    )


def _hysteresis(motor: Motor, swing: float, what: str, remark: str) -> str:
    limit = limit_ratio(motor.contact) * static_penetration(motor.contact)
    step, period = 1e-6, 1e-3
    circuit = cyclic_bench(
        motor.contact, motor.rotor, amplitude=0.8 * limit, swing=swing, phase_deg=90.0, frequency=1.0 / period,
        step=step, title=f"Hysteresis: {what}",
    )  # fmt: skip
    second = f"FROM={period:g} TO={2 * period:g}"
    measures = {
        "loss_j": f"INTEG v(power) {second}",
        "friction_force_greatest_n": f"MAX v(friction) {second}",
        "normal_force_least_n": f"MIN v(normal) {second}",
        "normal_force_greatest_n": f"MAX v(normal) {second}",
        "part_that_slips_greatest": f"MAX v(slips) {second}",
    }
    circuit.raw_spice += "Bslips slips 0 V=max(0,V(state)-1)\n"
    simulation = _simulation(Bench(circuit, TRANSIENT_OPTIONS), "tran", measures)
    simulation.transient(step_time=step, end_time=2 * period, max_time=step, use_initial_condition=True)
    return _finish(
        simulation,
        f"""Hysteresis, {what}. The tip of the motor {motor.name} is moved back and forth along a rotor that stands, by
        0.8 of the displacement at which all of the contact slips under the preload. To plot, inside ngspice:
        v(friction) in N over v(moved) in um, v(normal) in N, v(slips) the part of the contact that slips. Prints
        the energy lost in the second cycle. {remark}""",
    )


def _thermal_drift(motor: Motor) -> str:
    drive = TwoPhaseDrive(voltage=20.0, frequency=51.7e3, phase_deg=180.0)
    duration = 10e-3
    bench = motor_bench(
        motor, DriveSource(drive), law=None, thermal=Thermal(heat_capacity_j_per_k=2.1e-5),
        title=f"{motor.name}: thermal drift",
    )  # fmt: skip
    early = f"FROM=1e-3 TO={1e-3 + _TAIL_PERIODS * drive.period:.9g}"
    late = f"FROM={duration - _TAIL_PERIODS * drive.period:.9g} TO={duration:g}"
    measures = {
        "current_a_rms_early_a": f"RMS i(va) {early}",
        "current_a_rms_late_a": f"RMS i(va) {late}",
        "temperature_early_k": f"AVG v(temperature) {early}",
        "temperature_late_k": f"AVG v(temperature) {late}",
        "heat_late_w": f"AVG v(heat) {late}",
    }
    simulation = _simulation(bench, "tran", measures)
    simulation.transient(step_time=_STEP, end_time=duration, max_time=_STEP, use_initial_condition=True)
    return _finish(
        simulation,
        """Thermal drift. The free stator, driven at its cold resonance, warms up and drifts away from the drive. It
        is given a hundred thousandth of its heat capacity, so that 1 ms stands for 100 s. To plot, inside ngspice:
        v(temperature) in K above the surroundings, v(heat) in W, i(va). Without Xcooling the pins stay open, and
        nothing drifts; a source at temperature holds it.""",
    )


# Networks as `piezomotor drive andersen2002 --frequency 51700` proposes them for the running motor, rounded.
_INDUCTORS = {
    "voltage": 49.7, "ratio_b": 0.438, "phase_deg": 161.1,
    "inductor_a.inductance": 2.72e-3, "inductor_a.resistance": 8.8, "inductor_a.capacitance": 3.14e-9,
    "inductor_b.inductance": 1.52e-3, "inductor_b.resistance": 4.9, "inductor_b.capacitance": 65.5e-9,
}  # fmt: skip
_FILTERS = {
    "llcc_a.series_inductance": 5.47e-3, "llcc_a.series_capacitance": 1.73e-9, "llcc_a.series_resistance": 18.0,
    "llcc_a.parallel_inductance": 5.44e-3, "llcc_a.parallel_capacitance": 2.13e-9, "llcc_a.parallel_resistance": 18.0,
    "llcc_b.series_inductance": 7.12e-3, "llcc_b.series_capacitance": 1.33e-9, "llcc_b.series_resistance": 23.0,
    "llcc_b.parallel_inductance": 1.68e-3, "llcc_b.parallel_capacitance": 10e-12, "llcc_b.parallel_resistance": 5.4,
}  # fmt: skip


def _driver(motor: Motor, driver: Driver, what: str) -> str:
    bench = motor_bench(motor, driver, title=f"{motor.name}: {what.split('.')[0]}")
    duration = 1e-3
    tail = f"FROM={duration - _TAIL_PERIODS * driver.period:.9g} TO={duration:g}"
    supplies = [(f"v({rail}_{g})", f"i(vv{rail[1]}_{g})") for g in GROUPS for rail in ("vp", "vn")]
    parts = [part for group in GROUPS for part in driver.parts(group)]
    losses = [f"v(x{part.instance}.loss_{name})" for part in parts for name, _ in part.library.losses]
    feeds = [f"v(x{part.instance}.feed_{name})" for part in parts for name, _ in part.library.feeds]
    measures = {
        "supply_power_w": _average("".join(f"-{volts}*{amperes}" for volts, amperes in supplies), tail),
        **({"gate_power_w": _average("+".join(feeds), tail)} if feeds else {}),
        "driver_loss_w": _average("+".join(losses), tail),
        "motor_power_w": _average("+".join(f"v({group})*i(vpin_{group})" for group in GROUPS), tail),
    }
    for group in GROUPS:
        measures[f"voltage_{group}_rms_v"] = f"RMS v({group}) {tail}"
        measures[f"current_{group}_rms_a"] = f"RMS i(vpin_{group}) {tail}"
    simulation = _simulation(bench, "tran", measures)
    simulation.transient(step_time=_STEP, end_time=duration, max_time=_STEP, use_initial_condition=True)
    return _finish(
        simulation,
        f"""{what} To plot, inside ngspice: v(line_a), v(line_b) behind the power stages, v(a), v(b) at the motor,
        i(vout_a), i(vpin_a) their currents, v(xstage_a.loss_...) losses, 1 V = 1 W. Prints mean powers over 20 periods:
        supply (and gates) = loss + motor.""",
    )


def _average(expression: str, tail: str) -> str:
    return f"AVG par('{expression}') {tail}"


def _chain(kind: str, network: str, values: Mapping[str, float]) -> Driver:
    return Driver(kind=kind, network=network, voltage=50.0, frequency=51.7e3).updated(values)


def _rounded(lag: StatorLag, loop_filter: LoopFilter) -> tuple[StatorLag, LoopFilter]:
    """Return what an engineer would write: four digits of the stator, three of the parts."""
    parts = (loop_filter.resistance_ohm, loop_filter.capacitance_f, loop_filter.ripple_f)
    return (
        StatorLag(float(f"{lag.resonance_hz:.4g}"), float(f"{lag.quality:.3g}")),
        LoopFilter(*(float(f"{part:.3g}") for part in parts)),
    )


def _tracker(motor: Motor, kind: str, duration: float, what: str) -> str:
    drive = {"kind": kind, "voltage": 50.0, "ratio_b": 2.0, "phase_deg": 90.0}
    tracker = Tracker(frequency=51.7e3, offset=0.03 if kind == "pll" else 0.01, **drive)
    law = PAPER_LAW if kind == "pll" else None
    lag = tracked_lag(motor, tracker, 1, contact=law is not None)
    _, loop_filter = _rounded(lag, tracker_filter(tracker, lag))
    bench = motor_bench(
        motor, TrackedSource(tracker, 1, loop_filter), law=law,
        discretisation=Discretisation(_STEP, exact_resonance=False), title=f"{motor.name}: {what.split('.')[0]}",
    )  # fmt: skip
    tail = f"FROM={duration - 2e-3:g} TO={duration:g}"
    measures = {
        "frequency_start_hz": "FIND v(tuned) AT=1u",
        "frequency_end_hz": f"AVG v(tuned) {tail}",
        "motional_rms_a": f"RMS v(motional) {tail}",
        "power_w": f"AVG v(power) {tail}",
        # power of force and motional current over the product of their RMS values: cosine of the phase between them
        "force_rms_v": f"RMS v(force) {tail}",
        "in_phase_va": f"AVG par('v(force)*v(motional)') {tail}",
    }
    simulation = _simulation(bench, "tran", measures)
    simulation.transient(step_time=_STEP, end_time=duration, max_time=_STEP, use_initial_condition=True)
    return _finish(
        simulation,
        f"""{what} The groups get {tracker.voltage:g} V and {tracker.voltage * tracker.ratio_b:g} V, 90 degrees apart at
        any frequency. To plot, inside ngspice: v(tuned) in Hz, v(control), v(motional) in A and v(force) in V, which
        are in phase at resonance, v(shaft) in rad/s. The parts with A are XSPICE; other simulators need their own.""",
    )


def _tracking_loop(motor: Motor) -> str:
    tracker = Tracker(kind="pll", voltage=50.0, ratio_b=2.0, frequency=51.7e3)
    lag = tracked_lag(motor, tracker, 1, contact=True)
    lag, loop_filter = _rounded(lag, tracker_filter(tracker, lag))
    circuit = averaged_bench(tracker, lag, loop_filter, closed=False, title=f"{motor.name}: loop gain of the tracker")
    # FIND takes the real part; a second loop, driven a quarter of a period later, has the imaginary part as its own
    add_average(circuit, tracker, lag, loop_filter, suffix="_later", source="DC 0 AC 1 -90")
    measures = {
        "real": f"FIND v(control) AT={tracker.bandwidth_hz:g}",
        "imaginary": f"FIND v(control_later) AT={tracker.bandwidth_hz:g}",
        "loop_gain": "PARAM='sqrt(real*real+imaginary*imaginary)'",
        "phase_margin_deg": "PARAM='57.29577951308232*atan(imaginary/real)'",
    }
    simulation = _simulation(Bench(circuit, AC_OPTIONS), "ac", measures)
    simulation.ac(variation="dec", number_of_points=100, start_frequency=5, stop_frequency=50e3)
    return _finish(
        simulation,
        f"""Loop gain. The phase-locked loop of tracker_pll.cir averaged over a period, cut open in front of its
        oscillator: -v(control) is the loop gain, and the phase of v(control) the phase margin. Xaverage is stator,
        detector and oscillator; lag is the time constant of the stator's phase, 2 Q/omega at its loaded Q =
        {lag.quality:g}. Xfilter is that of tracker_pll.cir. Prints gain and margin at the bandwidth wanted, 500
        Hz. To plot, inside ngspice: vdb(control), vp(control).""",
    )


_DECKS: dict[str, Callable[[Motor], str]] = {
    "free_admittance": lambda motor: _admittance(motor, preloaded=False),
    "preloaded_admittance": lambda motor: _admittance(motor, preloaded=True),
    "ellipse": _ellipse,
    "figure_eight": _figure_eight,
    "first_resonance": _first_resonance,
    "spin_up": _spin_up,
    "dynamometer": _dynamometer,
    "impact": lambda _: _impact(),
    "hysteresis": lambda motor: _hysteresis(
        motor, 0.0, "constant normal force", "By the paper's law of one spring and one slider it would be nothing."
    ),
    "hysteresis_varying": lambda motor: _hysteresis(
        motor, 0.6, "varying normal force", "The force swings by 0.6 of the preload, a quarter of a cycle ahead."
    ),
    "thermal_drift": _thermal_drift,
    "drive_linear": lambda motor: _driver(
        motor,
        _chain("linear", "none", {}),
        "Linear drive. An amplifier for each group, straight at its pin, two phases at the second resonance.",
    ),
    "drive_half_bridge": lambda motor: _driver(
        motor,
        _chain("half-bridge", "inductor", _INDUCTORS),
        "Half-bridge drive. Two MOSFETs for each group and a series matching inductor.",
    ),
    "drive_full_bridge": lambda motor: _driver(
        motor,
        _chain("full-bridge", "inductor", _INDUCTORS),
        "Full-bridge drive. Four MOSFETs for each group at a low supply, a step-up transformer and a series inductor.",
    ),
    "drive_llcc": lambda motor: _driver(
        motor,
        _chain("half-bridge", "llcc", _FILTERS),
        "LLCC drive. Two MOSFETs for each group and an LLCC filter that takes harmonics and reactive current.",
    ),
    "tracker_pll": lambda motor: _tracker(
        motor, "pll", 8e-3, "Phase-locked loop. It starts 3 % above the resonance of the running motor and locks."
    ),
    "tracker_observer": lambda motor: _tracker(
        motor,
        "observe-current",
        14e-3,
        "Perturb and observe. It starts 1 % above the resonance of the free stator and climbs to the greatest current.",
    ),
    "tracking_loop": _tracking_loop,
}


def _simulation(bench: Bench, analysis: str, measures: Mapping[str, str]) -> CircuitSimulation:
    simulation = CircuitSimulation(bench.circuit)
    for name in ("TEMP", "TNOM"):  # nothing here depends on them
        simulation._options.pop(name)
    simulation.options(**bench.options)
    if bench.start:
        simulation.initial_condition(**bench.start)
    for name, what in measures.items():
        simulation.measure(analysis, name, what)
    return simulation


def _finish(simulation: CircuitSimulation, description: str) -> str:
    """Return the deck with its header between title and circuit."""
    simulation.SIMULATOR = "ngspice"
    title, _, body = str(simulation).partition("\n")
    header = [
        "SPDX-License-Identifier: GPL-3.0-or-later",
        "",
        *textwrap.wrap(" ".join(description.split()), 110),
        "",
        "Run: ngspice -b THIS_FILE. Written by python -m pyspice_runner.netlist.decks; do not edit, copy.",
        "Units and nodes are explained in behavioral/CONVENTIONS.md.",
        "",
    ]
    return "\n".join([title, *(f"* {line}".rstrip() for line in header), body.rstrip(), ""])


if __name__ == "__main__":
    for written in write_decks(data_path("netlists")):
        sys.stdout.write(f"{written}\n")
