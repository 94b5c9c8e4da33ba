# SPDX-License-Identifier: GPL-3.0-or-later
"""Circuits around the motor: sources and loads, as PySpice circuits."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, pi

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.model.drive import Drive, Tone
from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.contact import SLIDERS, ContactLaw
from pyspice_runner.netlist.motor import Discretisation, add_motor

# Newton's iteration is closed to a part in 10⁶, so that its error stays far below that of the time step. Nodes carry
# V, N, µm, m/s and rad/s of order one; a nanovolt and a nanoampere stand for nothing. The step is uniform: trtol takes
# the truncation-error control, which would shorten steps, out of play.
TRANSIENT_OPTIONS = {"reltol": "1e-6", "vntol": "1e-9", "abstol": "1e-9", "trtol": "1e9", "method": "trap"}
# ngspice ends a sweep within reltol of a frequency step: much smaller, and round-off may drop the last frequency.
AC_OPTIONS = {"reltol": "1e-6", "vntol": "1e-12", "abstol": "1e-12"}


def transient_bench(
    motor: Motor,
    drive: Drive,
    *,
    contact: ContactLaw | None = "spring-slider",
    sliders: int = SLIDERS,
    speed: float | None = None,
    load_torque: float = 0.0,
    discretisation: Discretisation | None = None,
    title: str = "",
) -> Circuit:
    """Drive a motor by ideal voltage sources, its shaft free, loaded or held.

    Args:
        motor: the motor; instance ``Xmotor`` on the nodes a, b, 0, shaft.
        drive: the two voltages; sources ``Va`` and ``Vb``.
        contact: law of the contact; ``None`` for a free tip.
        sliders: number of sliders of the brush.
        speed: if given, a source ``Vshaft`` holds the shaft at this speed, rad/s.
        load_torque: torque in N·m that a source ``Iload`` draws from the shaft.
        discretisation: adaptation to a uniform step, if any.
        title: title line of the deck.
    """
    circuit = Circuit(title or f"{motor.name}: transient")
    _drive_group(circuit, "a", drive.tones_a, drive.soft_start)
    _drive_group(circuit, "b", drive.tones_b, drive.soft_start)
    if speed is not None:
        circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(speed)!r}")
    elif load_torque:
        circuit.I("load", "shaft", circuit.gnd, f"DC {float(load_torque)!r}")
    add_motor(
        circuit, motor, ("a", "b", circuit.gnd, "shaft"),
        contact=contact, sliders=sliders, discretisation=discretisation,
    )  # fmt: skip
    return circuit


def admittance_bench(motor: Motor, *, preloaded: bool, title: str = "") -> Circuit:
    """Two copies of one motor, the first driven at A with B shorted, the second at B with A shorted.

    One AC analysis then gives the whole two-port: the currents of ``Va1``, ``Vb1`` are −Y_AA, −Y_BA, those of ``Va2``,
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
            contact="spring-slider" if preloaded else None,
        )
    return circuit


def plate_voltages(drive: Drive, instance: str = "motor") -> dict[str, float]:
    """Return the initial voltages of the clamped capacitances, for ``.ic``.

    They start charged to the drive's first value: an ideal source that steps onto a capacitance would have to deliver
    an infinite current. The mechanics are not affected.
    """
    voltage_a, voltage_b = drive.initial_voltages()
    return {f"x{instance}.xgroup_a.plate": voltage_a, f"x{instance}.xgroup_b.plate": voltage_b}


def _drive_group(
    circuit: Circuit, group: str, tones: Sequence[Tone], soft_start: float, begun: float = 0.0, node: str = ""
) -> None:
    """Put the source ``Vgroup`` between the node of a group and ground; several sines are stacked.

    ``begun`` is the time in s since the drive came on.
    """
    active = [tone for tone in tones if tone.amplitude] or [tones[0]]
    phases = [tone.phase + 2.0 * pi * ((tone.frequency * begun) % 1.0) for tone in active]
    node = node or group
    if soft_start > 0.0:
        shape = "+".join(
            f"({tone.amplitude!r})*sin({2.0 * pi * tone.frequency!r}*time+({phase!r}))"
            for tone, phase in zip(active, phases, strict=True)
        )
        since = f"(time+{begun!r})" if begun else "time"
        circuit.raw_spice += f"Bdrive_{group} drive_{group} 0 V=min(1,{since}/{soft_start!r})*({shape})\n"
        circuit.V(group, node, f"drive_{group}", "DC 0")
        return
    nodes = [node, *(f"drive_{group}{index}" for index in range(1, len(active))), circuit.gnd]
    for index, (tone, phase) in enumerate(zip(active, phases, strict=True)):
        name = group if index == 0 else f"{group}{index}"
        circuit.V(
            name, nodes[index], nodes[index + 1],
            f"SIN(0 {tone.amplitude!r} {tone.frequency!r} 0 0 {degrees(phase)!r})",
        )  # fmt: skip
