# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a running motor: which vectors hold it, and what they mean. A run may go on from it (``Motion``)."""

from __future__ import annotations

from collections.abc import Mapping

from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.contact import Law
from pyspice_runner.netlist.motor import Discretisation, Motion, plate_nodes


def state_vectors(motor: Motor, law: Law | None, instance: str = "xmotor") -> list[str]:
    """Return the vectors that hold the state of a motor: modes, plates, rotor, carrier and contact."""
    names = [*_plates(instance, "a"), *_plates(instance, "b")]
    for index in range(1, len(motor.modes) + 1):
        names += [f"i(v.{instance}.xmode{index}.vvelocity)", f"v({instance}.xmode{index}.elastic)"]
    if law:
        names.append(f"v({instance}.slider)")
        if motor.mount:
            names += _carrier(instance)
    if motor.rotor.bearing_friction_n_m:
        names.append(_bearing(instance))
    return ["v(shaft)", *names, *_cells(law, instance)]


def motion(
    values: Mapping[str, float], motor: Motor, law: Law | None, discretisation: Discretisation, instance: str = "xmotor"
) -> Motion:
    """Return the motion that the values of :func:`state_vectors` stand for.

    Args:
        values: value by vector, at one time.
        motor: the motor.
        law: law of the contact; ``None`` for a free tip.
        discretisation: with which the motor was written.
        instance: name of the motor in the circuit.
    """
    numbers = range(1, len(motor.modes) + 1)
    carrier = {}
    if law and motor.mount:
        force, velocity = (values[name] for name in _carrier(instance))
        carrier = {"carrier_m": force / discretisation.mode(motor.mount)[1], "carrier_m_s": velocity}
    return Motion(
        tuple(
            values[f"v({instance}.xmode{index}.elastic)"] / discretisation.mode(mode)[1]
            for index, mode in zip(numbers, motor.modes, strict=True)
        ),
        tuple(values[f"i(v.{instance}.xmode{index}.vvelocity)"] for index in numbers),
        1e-6 * values[f"v({instance}.slider)"] if law else 0.0,
        values["v(shaft)"],
        tuple(values[name] for name in _plates(instance, "a")),
        tuple(values[name] for name in _plates(instance, "b")),
        tuple(values[name] for name in _cells(law, instance)),
        **carrier,
        bearing=values[_bearing(instance)] if motor.rotor.bearing_friction_n_m else 0.0,
    )


def _plates(instance: str, group: str) -> list[str]:
    """Return the vectors of the voltages of a group's capacitances."""
    return [f"v({instance}.{node})" for node in plate_nodes(group)]


def _bearing(instance: str) -> str:
    """Return the vector of the share of its torque that a dry bearing takes."""
    return f"v({instance}.xbearing.share)"


def _carrier(instance: str) -> tuple[str, str]:
    """Return the vectors of the force in the springs of the mount and of the velocity of the carrier."""
    return f"v({instance}.xmount.elastic)", f"i(v.{instance}.xmount.vvelocity)"


def _cells(law: Law | None, instance: str) -> list[str]:
    return [f"v({instance}.{node})" for node in law.states] if law else []
