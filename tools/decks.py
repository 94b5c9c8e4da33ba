# SPDX-License-Identifier: GPL-3.0-or-later
"""The decks of ``netlists/``: complete circuits that run by ``ngspice -b FILE``, without Python.

``python -m tools.decks`` writes them; a test compares them with those in the repository. A deck begins
with its parameters (``.param``), to which sources, instances, measurements and the analysis refer. The motor has its
physical parameters, which do not depend on the time step, so that a user can change the step.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Callable, Mapping
from math import pi, radians, tan
from pathlib import Path

from PySpice.Spice.Netlist import Circuit
from PySpice.Spice.Simulation import CircuitSimulation

from pyspice_runner.circuit.bench import AC_OPTIONS, METERED, Bench, admittance_bench, dynamometer_bench, motor_bench
from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.circuit.source import GROUPS, DriveSource
from pyspice_runner.circuit.state import Discretisation, plate_nodes
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.motor.contact import limit_ratio, resonance_under_preload, static_penetration
from pyspice_runner.motor.drive import Load, TwoPhaseDrive, TwoToneDrive, default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import data_path, read_library
from pyspice_runner.trackers.tracker import (
    RAIL,
    LoopFilter,
    StatorLag,
    TrackedSource,
    Tracker,
    add_filter,
    propose_filter,
    running_resonance,
)
from tools.averaged_decks import LIBRARY, averaged_deck_texts, averaged_library_text
from tools.benches.hysteresis import cyclic_bench
from validation.impact import Throw, impact_bench

PAPER, WORKING = "andersen2002", "bimodal40"  # the paper's motor, and one that turns
_STEP = 100e-9  # s: twice the default slider_time of the contact, 180 points a period at 55 kHz
_TAIL_PERIODS = 20  # the last periods of a run, over which the deck measures
_TAIL = f"FROM={{stop-{_TAIL_PERIODS}/frequency}} TO={{stop}}"
_RADIANS = pi / 180.0  # per degree
_TRANSIENT = ".tran {step} {stop} 0 {step} uic"
_SWEEP = ".ac lin {points} {lowest} {highest}"
_STEPPED = {"preload": "preload", "slider_time": "0.5*step"}  # what the motor's instance takes from the parameters

Parameters = dict[str, tuple[float | str, str]]  # name → value or expression, and its unit and meaning
References = dict[str, str | dict[str, str]]  # name of a line → its new text, or expressions by parameter


def deck_texts() -> dict[str, str]:
    """Return file name → text of every deck."""
    sets: dict[str, dict[str, Callable[[Motor], str]]] = {
        PAPER: _DECKS,
        WORKING: _WORKING_DECKS | {"softening": softening_deck},
    }
    decks = {f"{name}.cir": write(load_motor(motor)) for motor, own in sets.items() for name, write in own.items()}
    return decks | averaged_deck_texts()


def write_decks(folder: Path) -> list[Path]:
    """Write every deck into a folder and return the files."""
    paths = []
    for name, text in deck_texts().items():
        path = folder / name
        path.write_text(text, encoding="utf-8", newline="\n")
        paths.append(path)
    return paths


def _admittance(motor: Motor, *, preloaded: bool) -> str:
    state = "under preload, with the contact linearised at rest" if preloaded else "with a free tip"
    circuit = admittance_bench(motor, preloaded=preloaded, title=f"{motor.name}: admittance, {state}")
    for node, (source, copy) in {"y_aa": ("Va", 1), "y_ba": ("Vb", 1), "y_ab": ("Va", 2), "y_bb": ("Vb", 2)}.items():
        circuit.CurrentControlledVoltageSource(node, node, circuit.gnd, f"{source}{copy}", -1)
    circuit.raw_spice += "\n".join(
        [
            "* both groups in phase (A+B) and in antiphase (A-B)",
            "Bsum y_sum 0 V=V(y_aa)+V(y_ab)+V(y_ba)+V(y_bb)",
            "Bdifference y_difference 0 V=V(y_aa)-V(y_ab)-V(y_ba)+V(y_bb)\n",
        ]
    )
    measures = {
        "conductance_bending_1_s": "MAX v(y_sum) FROM=10k TO=25k",  # of a complex vector ngspice takes the real part
        "conductance_bending_2_s": "MAX v(y_difference) FROM=45k TO=60k",
    }
    parameters: Parameters = {
        "lowest": (5e3, "Hz, first frequency"),
        "highest": (100e3, "Hz, last frequency"),
        "points": (9501, "number of frequencies"),
    }
    references: References = {}
    if preloaded:
        parameters = {"preload": (motor.contact.preload_n, "N"), **parameters}
        references = {f"Xmotor{copy}": {"preload": "preload"} for copy in (1, 2)}
    return _deck(
        Bench(circuit, AC_OPTIONS),
        f"""The electrical two-port of the stator {state}. The voltages of y_aa, y_ab, y_ba and y_bb are the admittances
        in S; y_sum is that of both groups in phase, y_difference that of both in antiphase. Prints the greatest
        conductance of each mode, at its series resonance.""",
        parameters, references, measures, analysis=_SWEEP,
    )  # fmt: skip


def _stop_and_step(stop: float, step: float = _STEP) -> Parameters:
    return {"stop": (stop, "s, end of the run"), "step": (step, "s, time step")}


def _two_phases(drive: TwoPhaseDrive) -> Parameters:
    return {
        "frequency": (drive.frequency, "Hz"),
        "voltage": (drive.voltage, "V, amplitude"),
        "phase": (drive.phase_deg, "degrees, group B ahead of group A"),
    }


def _two_phase_sources(pins: tuple[str, str] = GROUPS) -> dict[str, str]:
    """Return the lines of the sources at two nodes."""
    phases = zip(GROUPS, pins, ("0", "{phase}"), strict=True)
    return {f"V{group}": f"{pin} 0 SIN(0 {{voltage}} {{frequency}} 0 0 {phase})" for group, pin, phase in phases}


def _plate_b(voltage: str) -> dict[str, str]:
    """Return the initial condition of the plates of group B, which are at the voltage of their source at t = 0."""
    return dict.fromkeys(_plates("b"), f"{{{voltage}*sin({_RADIANS!r}*phase)}}")


def _plates(group: str) -> list[str]:
    return [f"xmotor.{node}" for node in plate_nodes(group)]


def _two_tones(drive: TwoToneDrive) -> Parameters:
    return {
        "frequency": (drive.frequency_1, "Hz, tone of both groups in phase"),
        "voltage": (drive.voltage_1, "V, its amplitude"),
        "frequency_2": (drive.frequency_2, "Hz, tone of both groups in antiphase; a multiple of frequency"),
        "voltage_2": (drive.voltage_2, "V, its amplitude"),
        "phase": (drive.phase_deg, "degrees, phase of the tone in antiphase"),
    }


def _two_tone_sources() -> tuple[dict[str, str], dict[str, str]]:
    """Return the lines of the sources, and the initial conditions of the plates."""
    sources: dict[str, str] = {}
    start: dict[str, str] = {}
    for group, sign in zip(GROUPS, ("", "-"), strict=True):
        sources[f"V{group}"] = f"{group} drive_{group}1 SIN(0 {{voltage}} {{frequency}} 0 0 0)"
        sources[f"V{group}1"] = f"drive_{group}1 0 SIN(0 {{{sign}voltage_2}} {{frequency_2}} 0 0 {{phase}})"
        start |= dict.fromkeys(_plates(group), f"{{{sign}voltage_2*sin({_RADIANS!r}*phase)}}")
    return sources, start


def _transient(
    motor: Motor, drive: TwoPhaseDrive | TwoToneDrive, what: str, *, duration: float, load_torque: float = 0.0
) -> str:
    bench = motor_bench(
        motor,
        DriveSource(drive),
        load=Load(torque=load_torque),
        title=f"{motor.name}: {what.split('.')[0]}",
        check=True,
    )
    if isinstance(drive, TwoPhaseDrive):
        parameters, sources, start = _two_phases(drive), _two_phase_sources(), _plate_b("voltage")
    else:
        parameters, (sources, start) = _two_tones(drive), _two_tone_sources()
    parameters["preload"] = (motor.contact.preload_n, "N")
    references: References = {**sources, "Xmotor": _STEPPED}
    if load_torque:
        parameters["torque"] = (load_torque, "N.m, load")
        references["Iload"] = "shaft 0 DC {torque}"
    measures = {
        "tip_x_peak_to_peak_um": f"PP v(xmotor.x) {_TAIL}",
        "tip_y_peak_to_peak_um": f"PP v(xmotor.y) {_TAIL}",
        "normal_force_least_n": f"MIN v(xmotor.normal) {_TAIL}",
        "normal_force_greatest_n": f"MAX v(xmotor.normal) {_TAIL}",
        "friction_force_mean_n": f"AVG v(xmotor.friction) {_TAIL}",
        "rotor_speed_mean_rad_s": f"AVG v(shaft) {_TAIL}",
    }
    return _deck(
        bench,
        f"""{what} To plot, inside ngspice: v(xmotor.x), v(xmotor.y), v(xmotor.slider) in um, v(xmotor.normal),
        v(xmotor.friction) in N, v(xmotor.state) 0 separated 1 stick 2 slip, v(shaft) in rad/s.""",
        parameters | _stop_and_step(duration), references, measures, start=start,
    )  # fmt: skip


def _ellipse(motor: Motor) -> str:
    return _transient(
        motor,
        TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0),
        "Ellipse. Two phases at the second resonance, eq. (1): the tip moves on a flat ellipse and turns the rotor.",
        duration=3e-3,
    )


def _figure_eight(motor: Motor) -> str:
    return _transient(
        motor,
        TwoToneDrive(voltage_1=50.0, frequency_1=25e3, voltage_2=50.0, frequency_2=50e3, phase_deg=0.0),
        """Figure eight. A tone of both groups in phase and its octave in antiphase, eq. (2): the tip moves on a figure
        eight.""",
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
        _recommended(motor),
        "Spin-up. The rotor starts from rest against a load torque.",
        duration=20e-3,
        load_torque=5e-3,
    )


def _fast_start(motor: Motor) -> str:
    drive = _recommended(motor)
    bench = motor_bench(motor, DriveSource(drive), title=f"{motor.name}: fast start and stop", check=True)
    lines = [
        "Vlevel level 0 PWL(0 {boost} {boosted} {boost} {boosted+edge} 1 {off} 1 {off+edge} 0)",
        "Von on 0 PWL(0 1 {off} 1 {off+edge} 0)",
    ]
    for group, phase in zip(GROUPS, ("0", "{phase}"), strict=True):
        sine = f"sin({2.0 * pi!r}*{{frequency}}*time+{_RADIANS!r}*{phase})"
        lines.append(f"Bdrive_{group} drive_{group} 0 V={{voltage}}*V(level)*{sine}")
        through = f"V(drive_{group},line_{group})*(V(on)+(1-V(on))/{{resistance}})"
        lines.append(f"Bline_{group} drive_{group} line_{group} I={through}")
    bench.circuit.raw_spice += "\n".join(lines) + "\n"
    parameters: Parameters = {
        **_two_phases(drive),
        "boost": (2.0, "factor of the voltages at the start"),
        "boosted": (0.15e-3, "s, end of the boost"),
        "off": (2e-3, "s, end of the drive"),
        "edge": (1e-6, "s, in which voltage and resistance change"),
        "resistance": (2.9e3, "ohm, across each group after the drive; 1 for a short circuit"),
        "preload": (motor.contact.preload_n, "N"),
        **_stop_and_step(4e-3),
    }
    measures = {
        f"tip_y_peak_to_peak_{name}_um": f"PP v(xmotor.y) FROM={{{begin}}} TO={{{begin}+3/frequency}}"
        for name, begin in (("start", "boosted"), ("end", "off-3/frequency"), ("after", "0.5*(off+stop)"))
    }
    return _deck(
        bench,
        """Fast start and stop. The voltages are higher at first, and after the drive a resistor near the reactance of
        the clamped capacitance is across each group: a motional arm rises to the amplitude of the plain voltage in
        tau*ln(boost/(boost-1)), tau its decay time, and the resistor takes its energy. Driver and ceramic must bear
        the boost. Prints the motion of the tip at the end of the boost, at the end of the drive, and after it.""",
        parameters, {"Xmotor": _STEPPED, **{f"V{group}": f"{group} line_{group} 0" for group in GROUPS}}, measures,
        start=_plate_b("boost*voltage"),
    )  # fmt: skip


def _dynamometer(motor: Motor) -> str:
    drive = _recommended(motor)
    title = f"{motor.name}: dynamometer"
    bench = dynamometer_bench(motor, DriveSource(drive), speed=10.0, title=title, check=True)
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
        measures[f"{name}_0"] = f"FIND v({node}) AT={{stop-periods/frequency}}"
        measures[f"{name}_1"] = f"FIND v({node}) AT={{stop}}"
        measures[name] = f"PARAM='({name}_1-{name}_0)*{1e-6 * factor:g}*frequency/periods'"
    parameters: Parameters = {
        **_two_phases(drive),
        "preload": (motor.contact.preload_n, "N"),
        "speed": (10.0, "rad/s, at which the brake holds the rotor"),
        "grip": (1e6, "N.m.s, of the brake; 0 releases the rotor"),
        "torque": (0.0, "N.m, load besides the brake"),
        "periods": (80, "of frequency at the end of the run, for the means"),
        **_stop_and_step(360 * drive.period),  # the first 7 ms settle
    }
    meters = {f"X{meter}": {"lag": "0.5*step"} for meter in ("contactmeter", "meter_a", "meter_b")}
    return _deck(
        bench,
        """Dynamometer. The brake holds the rotor at a speed: 0 is stall, 50 rad/s about the no-load speed; a negative
        speed brakes the motor, a higher one drives it. For a load torque set grip=0 and torque. Prints means over whole
        periods: differences of the integrals of the instruments, divided by the time.""",
        parameters,
        {
            **_two_phase_sources(METERED), **meters, "Vset": "set 0 DC {speed}", "Xmotor": _STEPPED,
            "Xbrake": {"grip": "grip", "torque": "torque"},
        },
        measures, analysis=_TRANSIENT.replace("{stop}", "{stop+step}"), start=_plate_b("voltage"),
    )  # fmt: skip


def _impact() -> str:
    throw = Throw(psi=1.2)
    step = float(f"{throw.duration_s / 1000:.2g}")
    bench = impact_bench(throw, Law("brush"), step, "Impact: a steel sphere thrown at a half-space")
    bench.circuit.raw_spice += "* velocity of the patch in units of kappa v_n\nEpsi psi 0 vx 0 1\n"
    inertia = throw.inertia_kg_m2 / throw.mass_kg
    parameters: Parameters = {
        "velocity": (throw.velocity_m_s, "m/s, approach v_n along the normal"),
        "incidence": (throw.psi, "psi at the start: velocity of the patch over kappa v_n"),
        "mass": (throw.mass_kg, "kg"),
        "stiffness": (throw.contact.normal_stiffness_n_per_m15, "N/m^1.5, of the contact along its normal"),
        "mu": (throw.friction, "1, coefficient of friction"),
        "kappa": (f"{throw.limit_ratio / throw.friction:.10g}*mu", "1, velocity ratio at which psi is 1"),
        "seat": (f"1e6*({throw.contact.preload_n!r}/stiffness)**(2/3)", "um, penetration at the first contact"),
        **_stop_and_step(float(f"{1.1 * throw.duration_s + step:.9g}"), step),
    }
    references: References = {
        "Capproach": "vy 0 {mass} ic={velocity}",
        "Cpath": "y 0 1u ic={-seat}",
        "Ccentre": "centre 0 {mass} ic={incidence*kappa*velocity}",
        "Cspin": f"spin 0 {{{inertia:.10g}*mass}} ic=0",
        "Epsi": "psi 0 vx 0 {1/(kappa*velocity)}",
        "Xcontact": {
            "mu": "mu", "normal_stiffness": "stiffness", "slider_time": "0.5*step",
            "span": "1e6*(1.25*mass*velocity**2/stiffness)**0.4",
        },
    }  # fmt: skip
    measures = {
        "psi_1": "MAX v(psi) FROM=0 TO=1u",
        "psi_2": "FIND v(psi) AT={stop-step}",
        "departure_velocity_m_s": "FIND v(vy) AT={stop-step}",
        "spin_rad_s": "FIND v(spin) AT={stop-step}",
        "greatest_force_n": "MAX v(normal)",
        "greatest_penetration_um": "MAX v(xcontact.delta)",
        "duration_s": "WHEN v(xcontact.delta)=0 FALL=1",
    }
    return _deck(
        bench,
        f"""Impact. A steel sphere, {1e3 * 2 * throw.radius_m:g} mm, hits a half-space of steel obliquely. The
        capacitors are its masses, and their initial voltages its velocities; v(vx) is that of the patch. To plot,
        inside ngspice: v(normal), v(friction) in N, v(xcontact.delta) in um, v(psi), v(state) 0 separated, 1 stick,
        2 gross slip, between 1 and 2 the part of the contact that slips. Prints the rebound.""",
        parameters, references, measures,
    )  # fmt: skip


def _hysteresis(motor: Motor, swing: float, what: str, remark: str) -> str:
    contact = motor.contact
    amplitude = 0.8 * limit_ratio(contact) * static_penetration(contact)
    step, period = 1e-6, 1e-3
    bench = cyclic_bench(
        contact, motor.rotor, Law("brush"), amplitude=amplitude, swing=swing, phase_deg=90.0, frequency=1.0 / period,
        step=step, title=f"Hysteresis: {what}",
    )  # fmt: skip
    bench.circuit.raw_spice += "Bslips slips 0 V=max(0,V(state)-1)\n"
    parameters: Parameters = {
        "frequency": (1.0 / period, "Hz"),
        "amplitude": (1e6 * amplitude, "um, of the displacement along the rotor"),
        "preload": (contact.preload_n, "N, mean normal force"),
        "swing": (swing, "1, amplitude of the normal force over the preload"),
        "phase": (90.0, "degrees, normal force ahead of the displacement"),
        "omega": (f"{2.0 * pi!r}*frequency", "rad/s"),
        "depth": (f"1e6*(preload/{contact.normal_stiffness_n_per_m15:.10g})**(2/3)", "um, static penetration"),
        **_stop_and_step(2 * period, step),
    }
    turn = f"{{omega}}*time+({{{_RADIANS!r}*phase}})"
    force = f"(1+({{swing}})*sin({turn}))"
    references: References = {
        "Bmoved": "moved 0 V={amplitude}*sin({omega}*time)",
        "Bvx": "vx 0 V={1e-6*omega*amplitude}*cos({omega}*time)",
        "By": f"y 0 V={{depth}}*({force}**(2/3)-1)",
        "Bvy": f"vy 0 V=({{2e-6/3*depth*swing*omega}})*cos({turn})/{force}**(1/3)",
        "Xcontact": {"preload": "preload", "slider_time": "0.5*step", "span": "depth*(1+abs(swing))**(2/3)"},
    }
    second = "FROM={stop-1/frequency} TO={stop}"
    measures = {
        "loss_j": f"INTEG v(power) {second}",
        "friction_force_greatest_n": f"MAX v(friction) {second}",
        "normal_force_least_n": f"MIN v(normal) {second}",
        "normal_force_greatest_n": f"MAX v(normal) {second}",
        "part_that_slips_greatest": f"MAX v(slips) {second}",
    }
    return _deck(
        bench,
        f"""Hysteresis, {what}. The tip of the motor {motor.name} moves back and forth along a rotor at rest, by
        0.8 of the displacement at which all of the contact slips under the preload. To plot, inside ngspice:
        v(friction) in N over v(moved) in um, v(normal) in N, v(slips) the part of the contact that slips. Prints
        the energy lost in the last cycle. {remark}""",
        parameters, references, measures,
    )  # fmt: skip


def _thermal_drift(motor: Motor) -> str:
    drive = TwoPhaseDrive(voltage=20.0, frequency=51.7e3, phase_deg=180.0)
    thermal = Thermal(heat_capacity_j_per_k=2.1e-5)
    title = f"{motor.name}: thermal drift"
    bench = motor_bench(motor, DriveSource(drive), law=None, thermal=thermal, title=title, check=True)
    early = f"FROM=1m TO={{1m+{_TAIL_PERIODS}/frequency}}"
    measures = {
        "current_a_rms_early_a": f"RMS i(va) {early}",
        "current_a_rms_late_a": f"RMS i(va) {_TAIL}",
        "temperature_early_k": f"AVG v(temperature) {early}",
        "temperature_late_k": f"AVG v(temperature) {_TAIL}",
        "heat_late_w": f"AVG v(heat) {_TAIL}",
    }
    parameters: Parameters = {
        **_two_phases(drive),
        "capacity": (thermal.heat_capacity_j_per_k, "J/K, heat capacity of the stator"),
        "resistance": (thermal.thermal_resistance_k_per_w, "K/W, thermal resistance to the surroundings"),
        **_stop_and_step(10e-3),
    }
    cooling = {"capacity": "capacity", "resistance": "resistance"}
    return _deck(
        bench,
        """Thermal drift. A drive at the resonance of the cold free stator heats it, so that the resonance drifts away
        from the drive. The heat capacity is 1e-5 of the real one, so that 1 ms stands for 100 s. To plot, inside
        ngspice: v(temperature) in K above the surroundings, v(heat) in W, i(va). Without Xcooling the pins are open and
        the temperature stays 0; a voltage source at temperature holds it.""",
        parameters, {**_two_phase_sources(), "Xcooling": cooling}, measures, start=_plate_b("voltage"),
    )  # fmt: skip


# Networks that `piezomotor drive andersen2002 --frequency 51700` proposes for the running motor, rounded.
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
    bench = motor_bench(motor, driver, title=f"{motor.name}: {what.split('.')[0]}", check=True, plotted=True)
    supplies = [(f"v({rail}_{g})", f"i(vv{rail[1]}_{g})") for g in GROUPS for rail in ("vp", "vn")]
    parts = [part for group in GROUPS for part in driver.parts(group)]
    losses = [f"v(x{part.instance}.loss_{name})" for part in parts for name, _ in part.library.losses]
    feeds = [f"v(x{part.instance}.feed_{name})" for part in parts for name, _ in part.library.feeds]
    measures = {
        "supply_power_w": _average("".join(f"-{volts}*{amperes}" for volts, amperes in supplies)),
        **({"gate_power_w": _average("+".join(feeds))} if feeds else {}),
        "driver_loss_w": _average("+".join(losses)),
        "motor_power_w": _average("+".join(f"v({group})*i(vpin_{group})" for group in GROUPS)),
    }
    for group in GROUPS:
        measures[f"voltage_{group}_rms_v"] = f"RMS v({group}) {_TAIL}"
        measures[f"current_{group}_rms_a"] = f"RMS i(vpin_{group}) {_TAIL}"
    parameters: Parameters = {
        "frequency": (driver.frequency, "Hz"),
        **{
            f"voltage_{group}": (driver.amplitude(group), "V, amplitude of the fundamental of the power stage")
            for group in GROUPS
        },
        "phase": (driver.phase_deg, "degrees, group B ahead of group A"),
        "preload": (motor.contact.preload_n, "N"),
        "rise": (driver.supply_rise_s, "s, rise time of the supply"),
    }
    source = {"frequency": "frequency", "phase_deg": "phase"}
    references: References = {"Xsource": source, "Xmotor": _STEPPED}
    if not driver.switched:
        source |= {f"amplitude_{group}": f"voltage_{group}/{driver.setting('amplifier.gain'):g}" for group in GROUPS}
    for group in GROUPS:
        # a bridge's supply sets its voltage, an amplifier's supply only limits it
        ratio = driver.rails(group)[0] / driver.amplitude(group)
        supply = f"{ratio!r}*voltage_{group}" if driver.switched else driver.rails(group)[0]
        parameters[f"supply_{group}"] = (supply, "V, each rail" if driver.rails(group)[1] else "V")
        for rail, sign in zip(("vp", "vn"), ("", "-"), strict=True):
            if driver.rails(group)[rail == "vn"]:
                references[f"V{rail}_{group}"] = f"{rail}_{group} 0 PWL(0 0 {{rise}} {{{sign}supply_{group}}})"
    return _deck(
        bench,
        f"""{what} To plot, inside ngspice: v(line_a), v(line_b) behind the power stages, v(a), v(b) at the motor,
        i(vout_a), i(vpin_a) their currents, v(xstage_a.loss_...) losses, 1 V = 1 W. Prints mean powers over 20 periods:
        supply (and gates) = loss + motor.""",
        parameters | _stop_and_step(1e-3), references, measures,
    )  # fmt: skip


def _average(expression: str) -> str:
    return f"AVG par('{expression}') {_TAIL}"


def _recommended(motor: Motor) -> TwoPhaseDrive:
    drive = default_drive(motor)
    assert isinstance(drive, TwoPhaseDrive)
    return drive


def _chain(kind: str, network: str, values: Mapping[str, float]) -> Driver:
    return Driver(kind=kind, network=network, voltage=50.0, frequency=51.7e3).updated(values)


def _rounded(lag: StatorLag, loop_filter: LoopFilter) -> tuple[StatorLag, LoopFilter]:
    """Return the stator's values with four and three digits, those of the filter with three."""
    parts = (loop_filter.resistance_ohm, loop_filter.capacitance_f, loop_filter.ripple_f)
    return (
        StatorLag(float(f"{lag.resonance_hz:.4g}"), float(f"{lag.quality:.3g}")),
        LoopFilter(*(float(f"{part:.3g}") for part in parts)),
    )


def _tracker(motor: Motor, kind: str, duration: float, what: str) -> str:
    drive = {"kind": kind, "voltage": 50.0, "ratio_b": 2.0, "phase_deg": 90.0}
    tracker = Tracker(frequency=51.7e3, offset=0.03 if kind == "pll" else 0.01, **drive)
    law = PAPER_LAW if kind == "pll" else None
    lag = running_resonance(motor, tracker, mode=1, contact=law is not None)
    _, loop_filter = _rounded(lag, propose_filter(tracker, lag))
    bench = motor_bench(
        motor, TrackedSource(tracker, 1, loop_filter), law=law,
        discretisation=Discretisation(_STEP, exact_resonance=False), title=f"{motor.name}: {what.split('.')[0]}",
        check=True,
    )  # fmt: skip
    tail = "FROM={stop-2m} TO={stop}"
    measures = {
        "frequency_start_hz": "FIND v(tuned) AT=1u",
        "frequency_end_hz": f"AVG v(tuned) {tail}",
        "motional_rms_a": f"RMS v(motional) {tail}",
        "power_w": f"AVG v(power) {tail}",
        # power of force and motional current over the product of their RMS values: cosine of the phase between them
        "force_rms_v": f"RMS v(force) {tail}",
        "in_phase_va": f"AVG par('v(force)*v(motional)') {tail}",
    }
    parameters: Parameters = {
        "frequency": (tracker.frequency, "Hz, middle of the oscillator's range"),
        "span": (tracker.span, "1, half of the range over frequency"),
        "offset": (tracker.offset, "1, start above frequency, over frequency"),
        "voltage_a": (tracker.voltage, "V, amplitude of group A"),
        "voltage_b": (tracker.voltage * tracker.ratio_b, "V, amplitude of group B"),
        "phase": (tracker.phase_deg, "degrees, group B ahead of group A"),
    }
    start = f"{RAIL / 2.0!r}*(1+offset/span)"
    references: References = {
        "Xoscillator": {"least": "frequency*(1-span)", "greatest": "frequency*(1+span)"},
        "Xphases": {"amplitude_a": "voltage_a", "amplitude_b": "voltage_b", "phase_deg": "phase"},
        "Xsense": {"frequency": "frequency"},
    }
    if kind == "pll":
        parameters["target"] = (tracker.target_deg, "degrees, motional current ahead of the force")
        parameters["preload"] = (motor.contact.preload_n, "N")
        references |= {"Vtarget": "target 0 DC {target}", "Xfilter": {"start": start}, "Xmotor": _STEPPED}
    else:
        parameters["interval"] = (tracker.period_s, "s, between two changes of the frequency")
        parameters["increment"] = (tracker.step_hz, "Hz, size of a change")
        volts = f"increment*{RAIL / 2.0!r}/(span*frequency)"
        references["Xobserver"] = {"period": "interval", "step": volts, "start": start}
    return _deck(
        bench,
        f"""{what} The groups are driven with a constant phase between them at any frequency. To plot, inside ngspice:
        v(tuned) in Hz, v(control), v(motional) in A and v(force) in V, which are in phase at resonance, v(shaft) in
        rad/s. The parts with A are XSPICE; other simulators need their own.""",
        parameters | _stop_and_step(duration), references, measures, start=_plate_b("voltage_b"),
    )  # fmt: skip


def average_bench(tracker: Tracker, lag: StatorLag, loop_filter: LoopFilter, title: str = "averaged loop") -> Circuit:
    """Return the averaged loop, open at the oscillator's input and driven there by ``AC 1``.

    The voltage at ``control`` is minus the loop gain.
    """
    circuit = Circuit(title)
    circuit.raw_spice += "\n".join(read_library(f"tracker_{part}").subcircuit for part in ("average", "filter")) + "\n"
    circuit.V("target", "target", circuit.gnd, "DC 0")
    _add_average(circuit, tracker, lag, loop_filter, source="DC 0 AC 1")
    return circuit


def _add_average(
    circuit: Circuit,
    tracker: Tracker,
    lag: StatorLag,
    loop_filter: LoopFilter,
    *,
    suffix: str = "",
    source: str | None = None,
) -> None:
    """Add an averaged loop: closed, or open and driven by a source at the oscillator's input."""
    control = f"control{suffix}"
    if source:
        circuit.V(f"tuning{suffix}", f"tuning{suffix}", circuit.gnd, source)
    instantiate(
        circuit, f"average{suffix}", "tracker_average",
        (f"tuning{suffix}" if source else control, "target", f"phase{suffix}", control),
        lag=lag.time_constant_s, detune=-tan(radians(tracker.target_deg)), gain=tracker.gain_hz_per_v,
        current=tracker.pump_current_a, polarity=tracker.polarity,
    )  # fmt: skip
    add_filter(circuit, loop_filter, 0.0, suffix=suffix)
    circuit.R(f"leak{suffix}", control, circuit.gnd, 1e15)  # a DC path for the operating point


def _tracking_loop(motor: Motor) -> str:
    tracker = Tracker(kind="pll", voltage=50.0, ratio_b=2.0, frequency=51.7e3)
    lag = running_resonance(motor, tracker, mode=1)
    lag, loop_filter = _rounded(lag, propose_filter(tracker, lag))
    circuit = average_bench(tracker, lag, loop_filter, f"{motor.name}: loop gain of the tracker")
    # FIND takes the real part; the real part of a second loop, driven 90 degrees later, is the imaginary part
    _add_average(circuit, tracker, lag, loop_filter, suffix="_later", source="DC 0 AC 1 -90")
    measures = {
        "real": "FIND v(control) AT={bandwidth}",
        "imaginary": "FIND v(control_later) AT={bandwidth}",
        "loop_gain": "PARAM='sqrt(real*real+imaginary*imaginary)'",
        "phase_margin_deg": "PARAM='57.29577951308232*atan(imaginary/real)'",
    }
    parameters: Parameters = {
        "frequency": (lag.resonance_hz, "Hz, resonance of the running motor"),
        "quality": (lag.quality, "1, its loaded Q"),
        "gain": (tracker.gain_hz_per_v, "Hz/V, of the oscillator"),
        "current": (tracker.pump_current_a, "A, of the charge pump"),
        "resistance": (loop_filter.resistance_ohm, "ohm, of the filter"),
        "capacitance": (loop_filter.capacitance_f, "F, in series with it"),
        "ripple": (loop_filter.ripple_f, "F, in parallel"),
        "bandwidth": (tracker.bandwidth_hz, "Hz, at which gain and margin are measured"),
        "lowest": (5.0, "Hz, first frequency"),
        "highest": (50e3, "Hz, last frequency"),
        "points": (100, "frequencies per decade"),
    }
    loop = {"lag": f"quality/({pi!r}*frequency)", "gain": "gain", "current": "current"}
    network = {name: name for name in ("resistance", "capacitance", "ripple")}
    return _deck(
        Bench(circuit, AC_OPTIONS),
        """Loop gain. The phase-locked loop of tracker_pll.cir, averaged over a period and opened before its oscillator:
        -v(control) is the loop gain, and the phase of v(control) the phase margin. Xaverage is stator, detector and
        oscillator, with the time constant of the stator's phase, 2 Q/omega. Xfilter is that of tracker_pll.cir. Prints
        gain and margin at the bandwidth. To plot, inside ngspice: vdb(control), vp(control).""",
        parameters,
        {f"X{part}{copy}": each for part, each in (("average", loop), ("filter", network)) for copy in ("", "_later")},
        measures, analysis=".ac dec {points} {lowest} {highest}",
    )  # fmt: skip


SOFT = 3  # mode of the working motor that its groups in antiphase move alone, as in Duffing's closed form
SOFTENING = {f"modes.{SOFT}.softening_per_m2": 1.5e10, f"modes.{SOFT}.damping_growth_per_m2": 0.0}  # assumed


def softening_deck(motor: Motor, voltage: float = 5.0, duration: float = 0.05) -> str:
    """Return the deck of a free stator that softens, driven through the resonance of a mode up and down again.

    Args:
        motor: the motor.
        voltage: amplitude of both groups in antiphase, V.
        duration: of the sweep in each direction, s.
    """
    soft = motor.updated(SOFTENING)
    mode = soft.modes[SOFT]
    low, high = 0.975 * mode.frequency_hz, 1.01 * mode.frequency_hz
    drive = TwoPhaseDrive(voltage=voltage, frequency=mode.frequency_hz, phase_deg=180.0)
    step = float(f"{0.02 / mode.frequency_hz:.3g}")
    bench = motor_bench(
        soft, DriveSource(drive), law=None, discretisation=Discretisation(step),
        title=f"{soft.name}: a ceramic that softens",
    )  # fmt: skip
    rise, fall = "min(time,{sweep})", "max(time-{sweep},0)"
    slope = "{(high-low)/(2*sweep)}"
    turns = f"{{low}}*{rise}+{slope}*{rise}**2+{{high}}*{fall}-{slope}*{fall}**2"
    line = f"Bsweep sweep 0 V={{voltage}}*sin({2.0 * pi!r}*({turns}))"
    bench.circuit.raw_spice += f"{line}\nEother other 0 sweep 0 -1\n"
    parameters: Parameters = {
        "voltage": (voltage, "V, amplitude"),
        "low": (round(low, -1), "Hz, start and end of the sweep"),
        "high": (round(high, -1), "Hz, its turning point"),
        "sweep": (duration, "s, in each direction"),
        "step": (step, "s, time step, to which the modes are adapted: do not change it"),
    }
    sources: References = {"Va": "a sweep 0", "Vb": "b other 0"}
    up, down = "FROM=0 TO={sweep}", "FROM={sweep} TO={2*sweep}"
    measures = {
        "greatest_up_um": f"MAX v(xmotor.x) {up}",
        "time_up_s": f"MAX_AT v(xmotor.x) {up}",
        "greatest_down_um": f"MAX v(xmotor.x) {down}",
        "time_down_s": f"MAX_AT v(xmotor.x) {down}",
    }
    return _deck(
        bench,
        """Softening. A free stator whose second bending mode softens with amplitude is driven in antiphase through its
        resonance, upwards and downwards. The resonance curve bends to lower frequencies and the motion jumps: upwards
        to the large amplitude, downwards, later, to the small one. To plot, inside ngspice: v(xmotor.x) in um.""",
        parameters, sources, measures,
        analysis=".tran {step} {2*sweep} 0 {step} uic",
    )  # fmt: skip


_DECKS: dict[str, Callable[[Motor], str]] = {
    "free_admittance": lambda motor: _admittance(motor, preloaded=False),
    "preloaded_admittance": lambda motor: _admittance(motor, preloaded=True),
    "ellipse": _ellipse,
    "figure_eight": _figure_eight,
    "first_resonance": _first_resonance,
    "impact": lambda _: _impact(),
    "hysteresis": lambda motor: _hysteresis(
        motor, 0.0, "constant normal force", "The paper's law of one spring and one slider has no loss here."
    ),
    "hysteresis_varying": lambda motor: _hysteresis(
        motor,
        0.6,
        "varying normal force",
        "The amplitude of the force is 0.6 of the preload, its phase a quarter of a cycle ahead.",
    ),
    "thermal_drift": _thermal_drift,
    "drive_linear": lambda motor: _driver(
        motor,
        _chain("linear", "none", {}),
        "Linear drive. An amplifier for each group, connected directly to its pin; two phases at the second resonance.",
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
        "LLCC drive. Two MOSFETs for each group and an LLCC filter against harmonics and reactive current.",
    ),
    "tracker_pll": lambda motor: _tracker(
        motor, "pll", 8e-3, "Phase-locked loop. It starts 3 % above the resonance of the running motor and locks."
    ),
    "tracker_observer": lambda motor: _tracker(
        motor,
        "observe-current",
        14e-3,
        "Perturb and observe. It starts 1 % above the resonance of the free stator and seeks the greatest current.",
    ),
    "tracking_loop": _tracking_loop,
}
_WORKING_DECKS: dict[str, Callable[[Motor], str]] = {
    "spin_up": _spin_up,
    "fast_start": _fast_start,
    "dynamometer": _dynamometer,
}


def _deck(
    bench: Bench,
    description: str,
    parameters: Parameters,
    references: References,
    measures: Mapping[str, str],
    *,
    analysis: str = _TRANSIENT,
    start: Mapping[str, str] | None = None,
) -> str:
    """Return a deck: title, header, parameters, the circuit that refers to them, measurements and analysis.

    Args:
        bench: circuit and options.
        description: text of the header.
        parameters: the ``.param`` block.
        references: lines of the circuit that refer to parameters: their text behind the name, or expressions for
            parameters of their instance.
        measures: ``.meas`` by name.
        analysis: last line.
        start: initial conditions by node.
    """
    simulation = CircuitSimulation(bench.circuit)
    simulation.SIMULATOR = "ngspice"
    for name in ("TEMP", "TNOM"):  # the circuits do not depend on the temperature
        simulation._options.pop(name)
    simulation.options(**bench.options)
    if start:
        simulation.initial_condition(**start)
    if "Xcheck " in str(bench.circuit):
        measures = {**measures, "check": "MAX v(xmotor.check)"}
        description += " The greatest v(xmotor.check) is 0 if parameters, step and pins are right."
    for name, what in measures.items():
        simulation.measure(analysis[1:].split()[0], name, what)
    title, _, body = str(simulation).partition("\n")
    header = [
        "SPDX-License-Identifier: MIT",
        "",
        *textwrap.wrap(" ".join(description.split()), 110),
        "",
        "Run: ngspice -b THIS_FILE. Written by python -m tools.decks: to change it, edit a copy.",
        "Units and nodes are explained in behavioral/CONVENTIONS.md.",
        "",
        "Parameters",
    ]
    block = [f".param {name}={_value(value)} ; {meaning}" for name, (value, meaning) in parameters.items()]
    circuit = _refer(body.removesuffix(".end\n").splitlines(), references)
    return "\n".join([title, *(f"* {line}".rstrip() for line in header), *block, *circuit, analysis, ".end", ""])


def _value(value: float | str) -> str:
    return f"{{{value}}}" if isinstance(value, str) else f"{value:.10g}"


def _refer(lines: list[str], references: References) -> list[str]:
    """Return the lines of a circuit, those that are named with references to parameters."""
    found, left, inside = [], dict(references), False
    for line in lines:
        name = line.partition(" ")[0]
        inside = (inside or name == ".subckt") and name != ".ends"
        reference = {} if inside else left.pop(name, {})
        if isinstance(reference, str):
            line = f"{name} {reference}"
        else:
            for parameter, expression in reference.items():
                line = re.sub(rf" {parameter}=\S+|$", f" {parameter}={{{expression}}}", line, count=1)
        found.append(line)
    if left:
        raise KeyError(f"The circuit has no line {', '.join(left)}.")
    return found


if __name__ == "__main__":
    library = data_path("netlists") / LIBRARY  # which the averaged decks include
    library.write_text(averaged_library_text(), encoding="utf-8", newline="\n")
    for written in (library, *write_decks(data_path("netlists"))):
        sys.stdout.write(f"{written}\n")
