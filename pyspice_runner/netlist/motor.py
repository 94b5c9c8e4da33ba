# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor as a PySpice subcircuit: modes, groups, contact and rotor put together.

``.subckt piezomotor a b com shaft`` is the face of the model; see ``behavioral/CONVENTIONS.md`` for nodes and units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin

from PySpice.Spice.Netlist import Netlist, SubCircuit

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import Mode
from pyspice_runner.model.refusal import checked
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.contact import PINS, SLIDERS, ContactLaw, check_law, contact_library, contact_values
from pyspice_runner.netlist.library import Library, read_library

SUBCIRCUIT = "piezomotor"
CROWN = "crown"  # node inside a motor whose preload bends the tip sideways: the tip's x from there, in µm
THERMAL_SUBCIRCUIT = "piezomotor_thermal"
_PARTS = ("piezomotor_mode", "piezomotor_group", "piezomotor_rotor")
# at the highest mode's frequency; it stands for none: SPICE allows no resistor of zero ohm, and a tiny one costs digits
_SMALLEST_LOSS = 3e-8


@dataclass(frozen=True)
class Discretisation:
    """What a run with a uniform step adapts in the netlist; an exported motor has none of it.

    The trapezoidal rule with step h shows a resonance ω at (2/h) atan(ω h/2). With m′ = m cos²(ωh/2) and
    k′ = (4m/h²) sin²(ωh/2) the discretised mode resonates at ω exactly. The slider's time constant becomes h/2: then
    the rule's two half steps cancel, and the slider follows its limit without ringing.

    Attributes:
        step: time step h in s.
        exact_resonance: whether to adapt the modes.
    """

    step: float
    exact_resonance: bool = True

    def mode(self, mode: Mode) -> tuple[float, float]:
        """Return the mass (kg) and stiffness (N/m) to write for a mode."""
        if not self.exact_resonance:
            return mode.mass_kg, mode.stiffness_n_per_m
        half_angle = pi * mode.frequency_hz * self.step
        return mode.mass_kg * cos(half_angle) ** 2, 4.0 * mode.mass_kg / self.step**2 * sin(half_angle) ** 2

    @property
    def slider_time(self) -> float:
        """Time constant of the pull that holds the slider, in s."""
        return self.step / 2.0


@dataclass(frozen=True)
class Motion:
    """The state of a running motor, from which a run with ``uic`` may go on.

    Attributes:
        displacements_m: modal displacements r, in the order of the modes.
        velocities_m_s: modal velocities.
        slider_m: displacement of the contact's slider.
        speed_rad_s: speed of the rotor.
        plate_a_v: voltage of the clamped capacitance of group A.
        plate_b_v: the same of group B.
        brush_m: sums of the displacements of a brush's cells, from the centre outwards; for ``.ic``.
    """

    displacements_m: tuple[float, ...]
    velocities_m_s: tuple[float, ...]
    slider_m: float
    speed_rad_s: float
    plate_a_v: float
    plate_b_v: float
    brush_m: tuple[float, ...] = ()


class MotorSubCircuit(SubCircuit):
    """``.subckt piezomotor a b com shaft`` of one motor; a thermal one has the pins temperature and heat besides.

    Args:
        motor: the motor.
        contact: law of the contact; ``None`` for a free tip, which leaves the rotor on its bearing alone.
        sliders: number of sliders of the brush.
        discretisation: adaptation to a run's time step, if any.
        start: motion with which a run with ``uic`` starts; by default preloaded rest. The plates and the cells of a
            brush are not among it: their voltages are for ``.ic``.
        thermal: drift with the pin ``temperature`` (1 V = 1 K), and a pin ``heat`` (1 V = 1 W). Both pins may be left
            open, then nothing drifts.
        approach: whether there is, as the last pin, ``approach`` (1 V = 1 um), by which the tip is moved towards the
            rotor: the preload changes.
        name: name of the subcircuit; by default ``piezomotor``, or ``piezomotor_thermal``.
    """

    def __init__(
        self,
        motor: Motor,
        *,
        contact: ContactLaw | None = "spring-slider",
        sliders: int = SLIDERS,
        discretisation: Discretisation | None = None,
        start: Motion | None = None,
        thermal: Thermal | None = None,
        approach: bool = False,
        name: str = "",
    ) -> None:
        warm = ("temperature", "heat") if thermal else ()
        kind = "_thermal" if thermal else ""
        pins = ("a", "b", "com", "shaft", *warm, *(("approach",) if approach else ()))
        super().__init__(name or (THERMAL_SUBCIRCUIT if thermal else SUBCIRCUIT), *pins)
        preload = motor.contact.preload_n if contact else 0.0
        adapted = [
            discretisation.mode(mode) if discretisation else (mode.mass_kg, mode.stiffness_n_per_m)
            for mode in motor.modes
        ]
        loss = _loss_tangent(motor)
        for group, capacitance in (("a", motor.piezo.capacitance_a_f), ("b", motor.piezo.capacitance_b_f)):
            instantiate(
                self, f"group_{group}", f"piezomotor_group{kind}", (group, "com", *warm),
                capacitance=capacitance, loss=loss, reference=motor.piezo.loss_reference_hz,
                **({"capacitance_drift": thermal.capacitance_drift_per_k} if thermal else {}),
            )  # fmt: skip
        for index, (mode, (mass, stiffness)) in enumerate(zip(motor.modes, adapted, strict=True), start=1):
            instantiate(
                self, f"mode{index}", f"piezomotor_mode{kind}",
                ("a", "b", "com", "fx", "fy", "x", "y", "vx", "vy", *warm),
                mass=mass, damping=mode.damping_n_s_per_m, stiffness=stiffness,
                coupling_a=mode.coupling_a_n_per_v, coupling_b=mode.coupling_b_n_per_v,
                tip_x=mode.tip_x, tip_y=mode.tip_y, preload=preload,
                **_mode_start(start, index - 1, mode.tip_y * preload / stiffness), **_mode_drift(thermal),
            )  # fmt: skip
        for node in ("x", "y", "vx", "vy"):
            self.R(f"sum_{node}", node, self.gnd, 1)
        if thermal:
            self.R("sum_heat", "heat", self.gnd, 1)
            self.R("open_temperature", "temperature", self.gnd, 1e9)
        if contact:
            deflection = preload * sum(
                mode.tip_y**2 / stiffness for mode, (_, stiffness) in zip(motor.modes, adapted, strict=True)
            )
            values = contact_values(
                contact, motor.contact, radius=motor.rotor.radius_m, preload=preload, deflection=deflection,
                slider_time=discretisation.slider_time if discretisation else None,
            )  # fmt: skip
            sway = contact_law.static_sway(motor.contact, _softened(motor, discretisation))
            if sway:  # the rotor's crown stands over the tip as it rests
                self.V("sway", "x", CROWN, f"DC {float(f'{1e6 * sway:.10g}')!r}")
            if start and contact == "spring-slider":
                values["start"] = 1e6 * start.slider_m
            if approach:
                self.VCVS("approach", "pressed", "y", "approach", self.gnd, voltage_gain=1)
                self.R("open_approach", "approach", self.gnd, 1e9)
            moved = {"y": "pressed" if approach else "y", "x": CROWN if sway else "x"}
            nodes = [moved.get(pin, pin) for pin in PINS]
            instantiate(self, "contact", contact_library(contact, sliders), nodes, **values)
        else:
            self.R("free_fx", "fx", self.gnd, 1)
            self.R("free_fy", "fy", self.gnd, 1)
        instantiate(
            self, "rotor", "piezomotor_rotor", ("shaft",),
            inertia=motor.rotor.inertia_kg_m2, bearing=motor.rotor.bearing_damping_n_m_s,
            **({"start": start.speed_rad_s} if start else {}),
        )  # fmt: skip


def crown_node(motor: Motor) -> str:
    """Return the node inside a motor at which the tip's sideways displacement from the rotor's crown stands."""
    return CROWN if contact_law.static_sway(motor.contact, motor.modes) else "x"


def _softened(motor: Motor, discretisation: Discretisation | None) -> tuple[Mode, ...]:
    """Return the modes with the stiffness that is written for them."""
    if discretisation is None:
        return motor.modes
    return tuple(mode.model_copy(update={"stiffness_n_per_m": discretisation.mode(mode)[1]}) for mode in motor.modes)


def parts_text(contact: ContactLaw | None = "spring-slider", sliders: int = SLIDERS, *, thermal: bool = False) -> str:
    """Return the text of the subcircuits that a motor is put together from."""
    parts = (f"{part}_thermal" if thermal and part != "piezomotor_rotor" else part for part in _PARTS)
    mode, group, rotor = (read_library(part).subcircuit for part in parts)
    return "\n".join([mode, group, *([contact_library(contact, sliders).subcircuit] if contact else []), rotor])


def add_motor(
    circuit: Netlist,
    motor: Motor,
    nodes: Sequence[str | int],
    *,
    instance: str = "motor",
    contact: ContactLaw | None = "spring-slider",
    sliders: int = SLIDERS,
    discretisation: Discretisation | None = None,
    start: Motion | None = None,
    thermal: Thermal | None = None,
    approach: bool = False,
) -> None:
    """Put a motor into a PySpice circuit; its definitions are written once, however many copies there are.

    Args:
        circuit: the circuit to add to.
        motor: the motor.
        nodes: the four nodes for the pins a, b, com, shaft; those for temperature, heat and approach besides, if there.
        instance: name of the instance (``X`` + this).
        contact: as in :class:`MotorSubCircuit`.
        sliders: as in :class:`MotorSubCircuit`.
        discretisation: as in :class:`MotorSubCircuit`.
        start: as in :class:`MotorSubCircuit`.
        thermal: as in :class:`MotorSubCircuit`.
        approach: as in :class:`MotorSubCircuit`.

    Raises:
        ParameterError: if the circuit already has a different motor.
    """
    definition = MotorSubCircuit(
        motor, contact=contact, sliders=sliders, discretisation=discretisation, start=start, thermal=thermal,
        approach=approach,
    )  # fmt: skip
    name = definition.name
    present = [str(subcircuit) for subcircuit in circuit.subcircuits if subcircuit.name == name]
    if not present:
        circuit.raw_spice += parts_text(contact, sliders, thermal=thermal is not None) + "\n"
        circuit.subcircuit(definition)
    elif present[0] != str(definition):
        raise ParameterError(
            f"The circuit already has a different {name}; {motor.name} as {instance!r} is refused. "
            "Copies in one circuit must have the same values."
        )
    circuit.X(instance, name, *nodes)


@checked
def motor_library(motor: Motor, *, contact: ContactLaw = "spring-slider", sliders: int = SLIDERS) -> str:
    """Return a self-contained library of one motor: header, parts and ``.subckt piezomotor a b com shaft``.

    Args:
        motor: the motor.
        contact: law of the contact, as in ``simulate``.
        sliders: number of sliders of the brush.

    Raises:
        ParameterError: for a law or a number of sliders that is refused.
    """
    check_law(contact, free=False)
    subcircuit = str(MotorSubCircuit(motor, contact=contact, sliders=sliders)).strip()
    lines = [
        "* SPDX-License-Identifier: GPL-3.0-or-later",
        f"* {SUBCIRCUIT}: standing-wave piezomotor {motor.name}, with Hertz contact, friction ({contact}) and rotor",
        "*",
        "*     a o---.---------------------------------.",
        "*           |  stator: clamped capacitance    |       1 V = 1 rad/s",
        f"*     b o---|  {len(motor.modes):2d} motional arms, tip, contact |---o shaft",
        "*           |  and rotor                      |       1 A = 1 N.m",
        "*   com o---'---------------------------------'",
        "*",
        "* PIN  a      inout  V      electrical pin of group A",
        "* PIN  b      inout  V      electrical pin of group B",
        "* PIN  com    inout  V      common electrical pin",
        "* PIN  shaft  inout  rad/s  rotor speed; a current fed into the pin is a driving torque",
        "*",
        *(
            f"* MODE {mode.name}: {mode.frequency_hz:.6g} Hz, Q {mode.quality_factor:.4g}, "
            f"coupling A {mode.coupling_a_n_per_v:.4g} N/V, B {mode.coupling_b_n_per_v:.4g} N/V"
            for mode in motor.modes
        ),
        f"* PRELOAD {motor.contact.preload_n:g} N, friction {motor.contact.friction:g}; with uic it starts at rest",
        "* NODES inside, to plot: x y slider (um), vx vy (m/s), normal friction (N), state (0 open, 1 stick, 2 slip)",
        "*",
        '* SOURCE Andersen, Helbo, Blanke, "Modelling and Experiments of a Standing Wave Piezomotor", 2002, corrected',
        f"* OMITS  temperature, piezoelectric hysteresis, {contact_library(contact, sliders).omits}",
        "* TESTED WITH ngspice 39",
        "*",
        "* USE",
        f"*   Va a 0 SIN(0 50 {max(mode.frequency_hz for mode in motor.modes):.6g})",
        f"*   Vb b 0 SIN(0 50 {max(mode.frequency_hz for mode in motor.modes):.6g} 0 0 90)",
        f"*   Xmotor a b 0 shaft {SUBCIRCUIT}",
        "*   .tran 100n 500u 0 100n uic",
        "*   .measure tran speed_rad_s FIND v(shaft) AT=499u",
        "* END USE",
        "*",
        parts_text(contact, sliders),
        subcircuit,
    ]
    return "\n".join(lines) + "\n"


def _mode_start(start: Motion | None, index: int, bending: float) -> dict[str, float]:
    """Return what a mode starts with, beside its displacement under the preload, which is minus the bending (m)."""
    if start is None:
        return {}
    return {"start": 1e6 * (start.displacements_m[index] + bending), "velocity": start.velocities_m_s[index]}


def _mode_drift(thermal: Thermal | None) -> dict[str, float]:
    if thermal is None:
        return {}
    return {"frequency_drift": thermal.frequency_drift_per_k, "coupling_drift": thermal.coupling_drift_per_k}


def dielectric_resistance(motor: Motor, group: str) -> float:
    """Return the resistance in Ω that stands for the dielectric loss of group ``"a"`` or ``"b"`` in the netlist."""
    capacitance: float = getattr(motor.piezo, f"capacitance_{group}_f")
    return _loss_tangent(motor) / (2.0 * pi * motor.piezo.loss_reference_hz * capacitance)


def _loss_tangent(motor: Motor) -> float:
    """Return the loss tangent to write, at the reference frequency."""
    highest = max(mode.frequency_hz for mode in motor.modes)
    return max(motor.piezo.loss_tangent, _SMALLEST_LOSS * motor.piezo.loss_reference_hz / highest)


def instantiate(
    parent: Netlist, instance: str, part: str | Library, nodes: Sequence[str | int], **values: float
) -> None:
    """Put an instance of a library's subcircuit into a netlist, its values held against the library's header."""
    library = part if isinstance(part, Library) else read_library(part)
    # ten digits: the last ones of an eigenvalue depend on the machine's linear algebra, and a deck must not
    rounded = {name: float(f"{value:.10g}") for name, value in values.items()}
    parent.X(instance, library.name, *nodes, **library.check(**rounded))
