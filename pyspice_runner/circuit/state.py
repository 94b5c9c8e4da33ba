# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a running motor, declared once: the vectors that hold it, their units, and how a run starts from it.

:func:`motor_states` lists the states of a motor. A state with a part is set by a parameter of the motor's X line
(:attr:`State.parameter`), any other by the initial voltage of its node.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.law import Law, contact_library, laws_of
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.dielectric import Branch
from pyspice_runner.motor.equivalent import constant_loss
from pyspice_runner.motor.motor import Motor, derived
from pyspice_runner.motor.parameters import Mode, Mount, Piezo
from pyspice_runner.motor.stator import ROUNDING, Stator, carriers, discretised

PLATES = ("plate", "slow1", "slow2", "slow3", "slow4", "slow5")  # pins of a group's capacitances, the fastest first
MICRO = 1e-6
FEEDBACK = "f"  # node, and pin of an exported motor, of the feedback electrode
CHARGED = "charged_f"  # node of its capacitance
_STRONG = 100.0  # factor of the force by damping, if all of the preload came within half a step
Array = NDArray[np.float64]
#: the state of a running motor, from which a run with ``uic`` can continue: SI values by the names of states; 0 without
Motion = Mapping[str, float]
Kind = Literal["mode", "contact", "stem", "mount", "feedback", "rotor", "bearing", "group"]


@dataclass(frozen=True)
class Discretisation:
    """Adaptation of the netlist to a run with a uniform step; an exported motor has none.

    The modes are those of :meth:`.Stator.adapted`. The time constant of the slider is h/2, with which the slider
    follows its limit without ringing.
    """

    step: float  # time step h in s
    exact_resonance: bool = True  # whether to adapt the modes

    @property
    def slider_time(self) -> float:
        """Time constant that holds the slider at its limit, in s."""
        return self.step / 2.0


@lru_cache(maxsize=4096)
def written(spring: Mode | Mount, discretisation: Discretisation | None) -> tuple[float, float]:
    """Return the mass (kg) and stiffness (N/m) of a mode or a carrier in the netlist."""
    if discretisation is None or not discretisation.exact_resonance:
        return spring.mass_kg, spring.stiffness_n_per_m
    mass, stiffness = discretised(spring.mass_kg, spring.stiffness_n_per_m, discretisation.step)
    return float(mass), float(stiffness)


@derived
def written_stator(motor: Motor, discretisation: Discretisation | None, mount: Mount | None = None) -> Stator:
    """Return the stator of a motor in the netlist, on its carrier if it has a mount."""
    stator = motor.stator.with_carrier(mount)
    if discretisation is None or not discretisation.exact_resonance:
        return stator
    return stator.adapted(discretisation.step)


def stems(motor: Motor, law: Law | None) -> dict[str, float]:
    """Return the compliances in series with the contacts in m/N, by the instances that have them.

    A law without a tangential spring has none along the rotor.
    """
    found: dict[str, float] = {}
    for one, own in zip(motor.touching if law else (), laws_of(motor, law), strict=True):
        if one.contact.series_compliance_m_per_n:
            found[f"stem{one.suffix}"] = one.contact.series_compliance_m_per_n
        if own.spring and one.contact.tangential_series_compliance_m_per_n:
            found[f"stem_x{one.suffix}"] = one.contact.tangential_series_compliance_m_per_n
    return found


@derived
def pushes(motor: Motor, law: Law | None) -> dict[str, tuple[float, ...]]:
    """Return the force per volt on each group, in N/V, that moves what is in series with the contact.

    They are by the instances that voltages move. The compression by a force F is that by F less these forces.
    """
    moved = dict(zip(("stem_x", "stem"), motor.stator.residual_per_volt, strict=False))
    softness = {} if motor.contacts else stems(motor, law)  # voltages move no compliance of several contacts
    return {name: tuple((moved[name] / softness[name]).tolist()) for name in softness if moved[name].any()}


def held_piezo(motor: Motor, law: Law | None) -> Piezo:
    """Return the capacitances of the netlist: while the springs are held that the voltages move, C − Sᵀ R⁻¹ S."""
    piezo, matrix = motor.piezo, motor.stator.capacitance.copy()
    if not (moved := pushes(motor, law)):
        return piezo
    for name, forces in moved.items():
        matrix -= stems(motor, law)[name] * np.outer(forces, forces)
    (a, between), (_, b) = matrix.tolist()
    return piezo.model_copy(update={"capacitance_a_f": a, "capacitance_b_f": b, "capacitance_ab_f": -between + 0.0})


def first_guess(
    motor: Motor, law: Law | None, start: Motion, discretisation: Discretisation | None
) -> dict[str, float]:
    """Return the voltages inside a motor from which ngspice's first iteration starts, by node.

    Without a guess the iteration starts at zero force. It then diverges where damping, by the rate of a soft compliance
    in series, multiplies the force by a hundred or more. Other motors need no guess, and the result is empty.
    The compressions of the series compliances along y are taken from the motion ``start``.
    """
    found = dict[str, float]()
    if law is None or discretisation is None:
        return found
    for one, own in zip(motor.touching, laws_of(motor, law), strict=True):
        contact, compliance = one.contact, one.contact.series_compliance_m_per_n
        if not compliance:
            continue
        force = max(one.preload_n + start.get(f"stem{one.suffix}", 0.0) / compliance, 0.0)
        if not {"delta", "factor"} <= {*contact_library(own, contact).subcircuit.split()}:  # of the user's own law
            continue
        rate = compliance * contact.preload_n / discretisation.slider_time
        if contact_law.normal_damping(contact) * rate >= _STRONG:
            guess = {"delta": contact_law.penetration(contact, force) / MICRO, "factor": 1.0}
            found |= {f"xcontact{one.suffix}.{node}": value for node, value in guess.items()}
    return found


@derived
def carrier(motor: Motor, law: Law | None) -> Mount | None:
    """Return the mount of a motor in the netlist: a free tip, without a law, has one only if its modes shake it."""
    return motor.mount if law or motor.stator.recoil[:, : len(carriers(motor.mount))].any() else None


@derived
def static_places(motor: Motor, law: Law | None, discretisation: Discretisation | None) -> Array:
    """Return the displacements x and y in m of each contact under the preload, shape (contacts, 2)."""
    if law is None:
        return np.zeros((1, 2))
    flexibility = written_stator(motor, discretisation).flexibility[:, 1::2]
    bent = flexibility @ motor.stator.share
    bent[np.abs(bent) < ROUNDING * np.trace(flexibility[1::2])] = 0.0  # where the shares of several cancel
    return np.asarray(-motor.contact.preload_n * bent.reshape(-1, 2) + 0.0)


@dataclass(frozen=True)
class State:
    """One number of the state of a motor."""

    name: str  # its name
    kind: Kind  # the part of the motor that it belongs to
    vector: str  # the vector that holds it, a format of the instance of the motor and the node of the shaft
    part: str = ""  # instance whose parameter sets its start; empty if the initial voltage of its node does
    start: str = "start"  # that parameter
    unit: float = 1.0  # SI value of 1 of the start, and of 1 V or 1 A of the vector if there is no spring
    spring: Mode | Mount | None = None  # mode or carrier whose elastic force in N the vector is
    rest: float = 0.0  # elastic force at preloaded rest, N. The start is relative to rest.

    @property
    def parameter(self) -> str:
        """Parameter of the X line of a motor that sets the start."""
        return f"start_{self.name}"

    def within(self, instance: str) -> str:
        """Return the vector for the instance of a motor, in lower case, whose shaft is the node ``shaft``."""
        return self.vector.format(instance, "shaft")

    def scale(self, discretisation: Discretisation | None) -> float:
        """Return the SI value of 1 V or 1 A of the vector."""
        return 1.0 / written(self.spring, discretisation)[1] if self.spring else self.unit

    def at_rest(self, discretisation: Discretisation | None) -> float:
        """Return the SI value at preloaded rest."""
        return self.rest / written(self.spring, discretisation)[1] if self.spring else 0.0


@derived
def motor_states(motor: Motor, law: Law | None, kinds: tuple[Kind, ...] | None = None) -> tuple[State, ...]:
    """Return the states of a motor, of some kinds or of all; ``law`` is ``None`` for a free tip."""
    modes = list(enumerate(motor.modes))
    rest = -motor.stator.preload_motion * motor.contact.preload_n if law else np.zeros(len(modes))
    states = [
        State(
            f"displacement_{at + 1}", "mode", f"v({{0}}.xmode{at + 1}.elastic)", f"mode{at + 1}", unit=MICRO,
            spring=mode, rest=float(rest[at]),
        )
        for at, mode in modes
    ]  # fmt: skip
    states += [
        State(f"velocity_{at + 1}", "mode", f"i(v.{{0}}.xmode{at + 1}.vvelocity)", f"mode{at + 1}", "velocity")
        for at, _ in modes
    ]
    laws = zip(motor.touching if law else (), laws_of(motor, law), strict=True)
    inside = [node for one, own in laws for node in own.states_of(one.suffix)]
    states += [State(node, "contact", f"v({{0}}.{node})", unit=MICRO) for node in inside]
    for name in stems(motor, law):
        states += [
            State(name, "stem", f"v({{0}}.x{name}.lag)", name, unit=MICRO),
            State(f"{name}_rate", "stem", f"v({{0}}.x{name}.slow)", name, "velocity"),
        ]
    parts = (("carrier", "mount"), ("carrier_x", "mount_x"))
    for spring, (name, part) in zip(carriers(carrier(motor, law)), parts, strict=False):
        states += [
            State(name, "mount", f"v({{0}}.x{part}.elastic)", part, unit=MICRO, spring=spring),
            State(f"{name}_velocity", "mount", f"i(v.{{0}}.x{part}.vvelocity)", part, "velocity"),
        ]
    if motor.feedback:
        states.append(State(CHARGED, "feedback", f"v({{0}}.{CHARGED})"))
    if not motor.is_transducer:
        states.append(State("speed", "rotor", "v({1})", "rotor"))
        if motor.rotor.bearing_friction_n_m:
            states.append(State("share", "bearing", "v({0}.xbearing.share)", "bearing"))
    nodes = [node for group in motor.groups for node in plates_of(motor, group)]
    states += [State(node, "group", f"v({{0}}.{node})") for node in nodes]
    return tuple(state for state in states if kinds is None or state.kind in kinds)


def transducer_branches(motor: Motor, group: str) -> tuple[Branch, ...]:
    """Return the branches of a transducer's clamped capacitance, as in a fitted circuit."""
    return constant_loss(motor.piezo.capacitance_f(group), motor.piezo.loss_tangent, motor.stator.capacitance_at)


def plates_of(motor: Motor, group: str) -> tuple[str, ...]:
    """Return the nodes of the capacitances of a group; none for a capacitance without loss, which is at the pin."""
    if not motor.is_transducer:
        return plate_nodes(group)
    branches = transducer_branches(motor, group)
    return tuple(f"plate_{group}{number}" for number in range(len(branches))) if len(branches) > 1 else ()


@cache
def plate_nodes(group: str) -> tuple[str, ...]:
    """Return the nodes of the capacitances of group ``"a"`` or ``"b"`` inside the motor, in the order of PLATES."""
    return tuple(f"{groups.named('xgroup', group)}.{plate}" for plate in PLATES)


def state_vectors(motor: Motor, law: Law | None, kinds: tuple[Kind, ...] | None = None) -> list[str]:
    """Return the vectors that hold the state of the motor of a bench, of some kinds or of all."""
    return [state.within("xmotor") for state in motor_states(motor, law, kinds)]


def recorded_states(
    values: Mapping[str, Array], motor: Motor, law: Law | None, discretisation: Discretisation, kind: Kind
) -> list[tuple[float, float, Array]]:
    """Return each state of a kind in a run: its value at preloaded rest, the SI value of 1 V or 1 A, and its vector."""
    return [
        (state.at_rest(discretisation), state.scale(discretisation), values[state.within("xmotor")])
        for state in motor_states(motor, law, (kind,))
    ]


def recorded_motion(
    values: Mapping[str, float], motor: Motor, law: Law | None, discretisation: Discretisation
) -> Motion:
    """Return the motion that the vectors of :func:`state_vectors` hold at one time."""
    states = motor_states(motor, law)
    return {state.name: values[state.within("xmotor")] * state.scale(discretisation) for state in states}


def start_values(
    states: Sequence[State], motion: Motion, discretisation: Discretisation | None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the parameters of the X line and the initial voltages of a motor that starts from a motion.

    The voltages, by node inside the motor, are those of the states without a parameter.
    """
    parameters: dict[str, float] = {}
    nodes: dict[str, float] = {}
    for state in states:
        start = float((motion.get(state.name, 0.0) - state.at_rest(discretisation)) / state.unit)
        if state.part:
            parameters[state.parameter] = start
        else:
            nodes[state.name] = start
    return parameters, nodes
