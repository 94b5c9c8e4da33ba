# SPDX-License-Identifier: GPL-3.0-or-later
"""Benches: a motor with its source, load and contact, a dynamometer, meters, a two-port."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from PySpice.Spice.Netlist import Circuit, Netlist

from pyspice_runner.circuit.evaluated import Derived, plotted_nodes
from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.circuit.motor import ALL, add_motor, contact_nodes, dielectric_branches, instantiate
from pyspice_runner.circuit.source import GROUPS, Source, not_below_rounding
from pyspice_runner.circuit.state import (
    CHARGED,
    Discretisation,
    Motion,
    first_guess,
    held_piezo,
    motor_states,
    plate_nodes,
    plates_of,
    start_values,
)
from pyspice_runner.motor import groups
from pyspice_runner.motor.dielectric import Branch
from pyspice_runner.motor.drive import Load
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import definitions, read_library

FREE = Load()  # a free shaft
# ngspice ends a sweep within reltol of a frequency step. With a much smaller reltol, round-off may drop the last point.
AC_OPTIONS = {"reltol": "1e-6", "vntol": "1e-12", "abstol": "1e-12"}
BRAKE = "piezomotor_dynamometer"
METERED = ("metered_a", "metered_b")  # nodes of the source in front of the wattmeters
METERS = ("piezomotor_contactmeter", "piezomotor_wattmeter", "piezomotor_heat", "piezomotor_groupheat")


@dataclass(frozen=True)
class Bench:
    """A circuit that is ready to run."""

    circuit: Circuit  # the circuit
    options: Mapping[str, str]  # ngspice's options for it
    # initial voltages in V by node, in addition to those of its devices (``ic=``).
    start: Mapping[str, float] = field(default_factory=dict)
    signals: Mapping[str, Derived] = field(default_factory=dict)  # vectors that follow from others, by name


def motor_bench(
    motor: Motor,
    source: Source,
    *,
    load: Load = FREE,
    law: Law | None = PAPER_LAW,
    discretisation: Discretisation | None = None,
    thermal: Thermal | None = None,
    start: Motion | None = None,
    begun: float = 0.0,
    title: str = "",
    check: bool = False,
    approach: str = "",
    plotted: bool = False,
) -> Bench:
    """Return the bench of a motor with source and load; the motor is ``Xmotor`` on the nodes a, b, 0, shaft.

    A source ``Vshaft`` holds the speed of the load, a source ``Iload`` draws its torque. A law of ``None`` is a free
    tip. With ``thermal`` the losses heat the motor through ``Xcooling`` on the nodes heat and temperature. ``start`` is
    by default preloaded rest, with the plates at the first voltages of the source, which has been on for ``begun``
    seconds. With ``check`` the motor has the node ``check``. ``approach`` is the value of a source by which the stator
    moves towards the rotor, um. If ``plotted``, a driver has the nodes of its powers and energies; otherwise they
    follow from recorded vectors. Raise ParameterError for a source that does not suit the motor.
    """
    source.check(motor)
    circuit = Circuit(title or f"{motor.name}: transient")
    source.add(circuit, motor, motor.groups, begun=begun)
    powers = {} if plotted else dict(source.powers)
    for power in powers.values():
        circuit.raw_spice = circuit.raw_spice.replace(power.line, "")
    nodes = source.pins
    if approach:
        circuit.V("approach", "approach", circuit.gnd, approach)
        nodes = ("approach",)
    if load.speed is not None:
        circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(load.speed)!r}")
    elif load.torque:
        circuit.I("load", "shaft", circuit.gnd, f"DC {float(load.torque)!r}")
    if thermal is not None:
        add_cooling(circuit, thermal)
        nodes = ("temperature", "heat", *nodes)
    add_motor(
        circuit, motor, (*motor.groups, circuit.gnd, *([] if motor.is_transducer else ["shaft"]), *nodes),
        law=law, discretisation=discretisation, start=start,
        thermal=thermal or source.thermal, approach=bool({"approach", "tool"} & {*nodes}), check=check, plotted=False,
    )  # fmt: skip
    signals = {**plotted_nodes(motor, law, "xmotor"), **powers}
    return _bench(circuit, motor, source, law, start, discretisation, signals)


def dynamometer_bench(
    motor: Motor,
    source: Source,
    *,
    speed: float | None,
    load_torque: float = 0.0,
    law: Law = PAPER_LAW,
    meters: bool = True,
    discretisation: Discretisation | None = None,
    start: Motion | None = None,
    begun: float = 0.0,
    title: str = "",
    check: bool = False,
) -> Bench:
    """Return the bench of a motor with dynamometer and, if asked for, meters of power, losses and states.

    The integrals are the nodes ``xbrake.v_*``, and with meters ``xcontactmeter.v_*``, ``xmeter_a.v_*``,
    ``xmeter_b.v_*``, ``xheat_*.v_heat``. The motor is ``Xmotor``. The brake holds a speed in rad/s, or with ``None``
    draws only the load torque in N·m. The meters take two fifths of the run time, and their time constants from the
    discretisation. ``start``, ``begun`` and ``check`` are those of :func:`motor_bench`. Raise ParameterError for a
    source that does not suit the motor.
    """
    source.check(motor)
    circuit = Circuit(title or f"{motor.name}: dynamometer")
    circuit.raw_spice += definitions(*map(read_library, (BRAKE, *(METERS if meters else ())))) + "\n"
    source.add(circuit, motor, METERED if meters else GROUPS, begun=begun)
    circuit.V("set", "set", circuit.gnd, f"DC {float(speed or 0.0)!r}")
    add_motor(
        circuit, motor, ("a", "b", circuit.gnd, "shaft"),
        law=law, discretisation=discretisation, start=start, check=check,
    )  # fmt: skip
    connect_brake(circuit, motor, load_torque, grips=speed is not None)
    if meters:
        add_meters(circuit, motor, law, {"lag": discretisation.slider_time} if discretisation else {})
    return _bench(circuit, motor, source, law, start, discretisation, {})


def _bench(
    circuit: Circuit,
    motor: Motor,
    source: Source,
    law: Law | None,
    start: Motion | None,
    discretisation: Discretisation | None,
    signals: Mapping[str, Derived],
) -> Bench:
    """Return the bench of a motor and its source, with the initial voltages of its states only for a given motion."""
    options = not_below_rounding(source.options(motor, law), [motor], law, discretisation)
    nodes = first_guess(motor, law, start or {}, discretisation)
    if start is not None:
        nodes |= start_values(motor_states(motor, law), start, discretisation)[1]
    else:
        for group, voltage in zip(motor.groups, source.initial_voltages(), strict=False):
            nodes |= dict.fromkeys(plates_of(motor, group), voltage) if abs(voltage) > 1e-12 else {}
    return Bench(circuit, options, {f"xmotor.{node}": voltage for node, voltage in nodes.items()}, signals)


def connect_brake(circuit: Netlist, motor: Motor, load_torque: float, *, grips: bool) -> None:
    """Connect the brake to the shaft: it holds the speed, or only draws a torque in N·m."""
    all_of = ALL if motor.contacts else ""
    instantiate(
        circuit, "brake", BRAKE, ("set", "shaft", f"xmotor.normal{all_of}", f"xmotor.friction{all_of}"),
        torque=load_torque, **({} if grips else {"grip": 0.0}),
    )  # fmt: skip


def add_meters(circuit: Netlist, motor: Motor, law: Law | None, lag: dict[str, float]) -> None:
    """Put meters of power, losses and states around a motor whose source is at ``metered_a`` and ``metered_b``."""
    piezo = held_piezo(motor, law)
    nodes: tuple[str | int, ...]
    for one in motor.touching:
        tip = contact_nodes(motor, law, one.suffix)
        forces = (f"{node}{one.suffix}" for node in ("normal", "friction", "state"))
        nodes = ("shaft", *(f"xmotor.{name}" for name in (tip["x"], tip["vx"], tip["vy"], *forces)))
        instantiate(circuit, f"contactmeter{one.suffix}", METERS[0], nodes, radius=one.radius_m, **lag)
    for index, mode in enumerate(motor.modes, start=1):
        nodes = (f"xmotor.xmode{index}.damped", f"xmotor.xmode{index}.elastic")
        instantiate(circuit, f"heat_{index}", "piezomotor_heat", nodes, resistance=mode.damping_n_s_per_m)
    for spring, part in zip(carriers(motor.mount), ("mount", "mount_x"), strict=False):
        nodes = (f"xmotor.x{part}.arm_r", f"xmotor.x{part}.elastic")
        instantiate(circuit, f"heat_{part}", "piezomotor_heat", nodes, resistance=spring.damping_n_s_per_m)
    if motor.feedback:
        nodes, resistance = (f"xmotor.{CHARGED}", circuit.gnd), motor.feedback.resistance_ohm
        instantiate(circuit, f"heat_{CHARGED}", "piezomotor_heat", nodes, resistance=resistance)
    between = abs(piezo.capacitance_ab_f)
    for group, line in zip(GROUPS, METERED, strict=True):
        nodes = (line, group, circuit.gnd)
        instantiate(circuit, groups.named("meter", group), "piezomotor_wattmeter", nodes, **lag)
        nodes = (group, *(f"xmotor.{node}" for node in plate_nodes(group)))
        own = 1.0 - between / piezo.capacitance_f(group)
        _add_groupheat(circuit, dielectric_branches(motor, group, law), group, nodes, own)
    if between:  # in a capacitance of its own at the difference of the voltages, at their sum for a negative one
        plates = ([f"xmotor.{node}" for node in plate_nodes(group)] for group in GROUPS)
        pairs = [GROUPS, *zip(*plates, strict=True)]
        sign = "-" if piezo.capacitance_ab_f > 0.0 else "+"
        for number, (a, b) in enumerate(pairs):
            circuit.B(f"across{number}", f"across{number}", circuit.gnd, v=f"V({a}){sign}V({b})")
        nodes = tuple(f"across{number}" for number in range(len(pairs)))
        _add_groupheat(circuit, dielectric_branches(motor, "a", law), "ab", nodes, between / piezo.capacitance_a_f)


def _add_groupheat(
    circuit: Netlist, branches: Sequence[Branch], name: str, nodes: Sequence[str | int], share: float
) -> None:
    """Integrate the heat in a share of the capacitance of a group; that between the groups is a share of group A's."""
    resistances = [branch.resistance_ohm / share for branch in branches]
    values = {f"resistance{index}": value for index, value in enumerate(resistances)}
    instantiate(circuit, f"heat_{name}", "piezomotor_groupheat", nodes, **values)


def add_cooling(circuit: Circuit, thermal: Thermal) -> None:
    """Put heat capacity and thermal resistance between the nodes heat and temperature."""
    circuit.raw_spice += read_library("piezomotor_cooling").subcircuit + "\n"
    instantiate(
        circuit, "cooling", "piezomotor_cooling", ("heat", "temperature"),
        capacity=thermal.heat_capacity_j_per_k, resistance=thermal.thermal_resistance_k_per_w,
        ambient=thermal.ambient_k, start=thermal.ambient_k,
    )  # fmt: skip


def admittance_bench(motor: Motor, *, preloaded: bool, title: str = "") -> Circuit:
    """Return two copies of one motor, the first driven at A with B shorted, the second at B with A shorted.

    One AC analysis gives the two-port: the currents of ``Va1``, ``Vb1`` are −Y_AA, −Y_BA, those of ``Va2``,
    ``Vb2`` are −Y_AB, −Y_BB. Shafts are free to turn on their bearings.
    """
    circuit = Circuit(title or f"{motor.name}: admittance, {'preloaded' if preloaded else 'free'}")
    if motor.is_transducer and not preloaded:
        motor = motor.model_copy(update={"load": None})
    motor = motor.with_one_law()  # contacts that stick, as with any law of the motor
    shaft = [] if motor.is_transducer else ["shaft"]
    for copy, driven in zip("12", motor.groups, strict=False):
        for group in motor.groups:
            amplitude = 1 if group == driven else 0
            circuit.V(f"{group}{copy}", f"{group}{copy}", circuit.gnd, f"DC 0 AC {amplitude}")
        add_motor(
            circuit,
            motor,
            (*(f"{group}{copy}" for group in motor.groups), circuit.gnd, *(f"{pin}{copy}" for pin in shaft)),
            instance=f"motor{copy}",
            law=PAPER_LAW if preloaded and shaft else None,
        )
    return circuit
