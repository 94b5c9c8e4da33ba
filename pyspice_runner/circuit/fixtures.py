# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources and loads of the motor as PySpice circuits."""

from __future__ import annotations

from collections.abc import Sequence

from PySpice.Spice.Netlist import Circuit, Netlist

from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.circuit.motor import add_motor, contact_nodes, dielectric_branches, instantiate
from pyspice_runner.circuit.state import held_piezo, plate_nodes
from pyspice_runner.motor import groups
from pyspice_runner.motor.dielectric import Branch
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import Library, read_library

# ngspice ends a sweep within reltol of a frequency step. With a much smaller reltol, round-off may drop the last point.
AC_OPTIONS = {"reltol": "1e-6", "vntol": "1e-12", "abstol": "1e-12"}
METERED = ("metered_a", "metered_b")  # nodes of the source in front of the wattmeters
_METERS = ("piezomotor_contactmeter", "piezomotor_wattmeter", "piezomotor_heat", "piezomotor_groupheat")


def brake_parts(*, meters: bool) -> list[Library]:
    """Return the libraries of a dynamometer, and those of the meters if asked for."""
    return [read_library(name) for name in ("piezomotor_dynamometer", *(_METERS if meters else ()))]


def add_set_speed(circuit: Netlist, speed: float | None) -> None:
    """Put the commanded speed of a dynamometer, in rad/s, at the node ``set``."""
    circuit.V("set", "set", circuit.gnd, f"DC {float(speed or 0.0)!r}")


def connect_brake(circuit: Netlist, load_torque: float, *, grips: bool) -> None:
    """Connect the brake to the shaft: it holds the speed, or only draws a torque in N·m."""
    instantiate(
        circuit, "brake", "piezomotor_dynamometer", ("set", "shaft", "xmotor.normal", "xmotor.friction"),
        torque=load_torque, **({} if grips else {"grip": 0.0}),
    )  # fmt: skip


def add_meters(circuit: Netlist, motor: Motor, law: Law | None, lag: dict[str, float]) -> None:
    """Put meters of power, losses and states around a motor whose source is at ``metered_a`` and ``metered_b``."""
    tip, piezo = contact_nodes(motor, law), held_piezo(motor, law)
    inside = [f"xmotor.{name}" for name in (tip["x"], tip["vx"], tip["vy"], "normal", "friction", "state")]
    nodes: tuple[str | int, ...] = ("shaft", *inside)
    instantiate(circuit, "contactmeter", "piezomotor_contactmeter", nodes, radius=motor.rotor.radius_m, **lag)
    for index, mode in enumerate(motor.modes, start=1):
        nodes = (f"xmotor.xmode{index}.damped", f"xmotor.xmode{index}.elastic")
        instantiate(circuit, f"heat_{index}", "piezomotor_heat", nodes, resistance=mode.damping_n_s_per_m)
    for spring, part in zip(carriers(motor.mount), ("mount", "mount_x"), strict=False):
        nodes = (f"xmotor.x{part}.arm_r", f"xmotor.x{part}.elastic")
        instantiate(circuit, f"heat_{part}", "piezomotor_heat", nodes, resistance=spring.damping_n_s_per_m)
    between = abs(piezo.capacitance_ab_f)
    for group, line in zip(GROUPS, METERED, strict=True):
        nodes = (line, group, circuit.gnd)
        instantiate(circuit, groups.named("meter", group), "piezomotor_wattmeter", nodes, **lag)
        nodes = (group, *(f"xmotor.{node}" for node in plate_nodes(group)))
        own = 1.0 - between / groups.of(piezo.capacitances, group)
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
    for copy, driven in (("1", "a"), ("2", "b")):
        for group in ("a", "b"):
            amplitude = 1 if group == driven else 0
            circuit.V(f"{group}{copy}", f"{group}{copy}", circuit.gnd, f"DC 0 AC {amplitude}")
        add_motor(
            circuit,
            motor,
            (f"a{copy}", f"b{copy}", circuit.gnd, f"shaft{copy}"),
            instance=f"motor{copy}",
            law=PAPER_LAW if preloaded else None,
        )
    return circuit
