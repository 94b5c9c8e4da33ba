# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of a motor with its source, load and contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.evaluated import Plotted, Power, plotted_nodes
from pyspice_runner.circuit.fixtures import METERED, add_cooling, add_meters, add_set_speed, brake_parts, connect_brake
from pyspice_runner.circuit.law import PAPER_LAW, Law, contact_library, contact_values
from pyspice_runner.circuit.motor import add_motor, instantiate
from pyspice_runner.circuit.own_law import PINS
from pyspice_runner.circuit.source import GROUPS, TRANSIENT_OPTIONS, Source, not_below_rounding
from pyspice_runner.circuit.state import Discretisation, Motion, first_guess, motor_states, plate_nodes, start_nodes
from pyspice_runner.motor.drive import Load
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import definitions

Derived = Plotted | Power  # a vector that follows from others
FREE = Load()  # a free shaft


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
    source.add(circuit, motor, GROUPS, begun=begun)
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
    options = not_below_rounding(source.options(motor, law), [motor], law, discretisation)
    if thermal is not None:
        add_cooling(circuit, thermal)
        nodes = ("temperature", "heat", *nodes)
    add_motor(
        circuit, motor, ("a", "b", circuit.gnd, "shaft", *nodes),
        law=law, discretisation=discretisation, start=start,
        thermal=thermal or source.thermal, approach="approach" in nodes, check=check, plotted=False,
    )  # fmt: skip
    first = _start(motor, source, law, start, discretisation)
    return Bench(circuit, options, first, signals={**plotted_nodes(motor, law, "xmotor"), **powers})


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
    circuit.raw_spice += definitions(*brake_parts(meters=meters)) + "\n"
    source.add(circuit, motor, METERED if meters else GROUPS, begun=begun)
    add_set_speed(circuit, speed)
    add_motor(
        circuit, motor, ("a", "b", circuit.gnd, "shaft"),
        law=law, discretisation=discretisation, start=start, check=check,
    )  # fmt: skip
    connect_brake(circuit, load_torque, grips=speed is not None)
    if meters:
        add_meters(circuit, motor, law, {"lag": discretisation.slider_time} if discretisation else {})
    options = not_below_rounding(source.options(motor, law), [motor], law, discretisation)
    return Bench(circuit, options, _start(motor, source, law, start, discretisation))


def contact_bench(
    lines: Sequence[str],
    law: Law,
    contact: Contact,
    *,
    radius: float,
    span: float,
    step: float,
    title: str,
) -> Bench:
    """Return a bench of the contact alone, the instance ``Xcontact``.

    Its pins ``x`` and ``shaft`` are grounded; each other pin is a node of the same name. ``lines`` are elements that
    move the tip, at the nodes ``y``, ``vx`` and ``vy``. The radius of the rotor and the largest penetration ``span``
    are in m. The time constant of a slider is half of the step in s.
    """
    circuit = Circuit(title)
    library = contact_library(law, contact)
    values = contact_values(law, contact, radius=radius, preload=contact.preload_n, slider_time=step / 2.0, span=span)
    circuit.raw_spice += "\n".join([definitions(library), *lines, ""])
    instantiate(circuit, "contact", library, ["0" if pin in ("x", "shaft") else pin for pin in PINS], **values)
    return Bench(circuit, TRANSIENT_OPTIONS)


def _start(
    motor: Motor,
    source: Source,
    law: Law | None,
    start: Motion | None,
    discretisation: Discretisation | None,
) -> dict[str, float]:
    """Return the initial voltages inside the motor, by node; those of its states only for a given motion."""
    nodes = first_guess(motor, law, start.stem_m if start else 0.0, discretisation)
    if start is not None:
        states = motor_states(motor, law)
        nodes |= start_nodes(states, [state.of(start) for state in states], discretisation)
    else:
        for group, voltage in zip(GROUPS, source.initial_voltages(), strict=True):
            nodes |= dict.fromkeys(plate_nodes(group), voltage) if abs(voltage) > 1e-12 else {}
    return {f"xmotor.{node}": voltage for node, voltage in nodes.items()}
