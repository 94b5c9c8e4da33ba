# SPDX-License-Identifier: GPL-3.0-or-later
r"""The averaged motor: complex amplitudes at the drive's frequency instead of waveforms.

A quantity is written :math:`q(t) = q_0 + \mathrm{Re}\sum_{h=1}^{H} Q_h e^{jh\theta}` with :math:`\dot\theta = 2\pi f`;
mean and amplitudes vary slowly. The modes are linear in them (``piezomotor_averaged_mode``). The contact is evaluated
at N phases of the period, and sums over the phases give the mean and the harmonics of its forces
(:func:`averaged_contact`). ``docs/tracking.md`` has the derivation.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import cos, pi, radians, sin
from typing import Any, NamedTuple

import numpy as np
from PySpice.Spice.Netlist import Circuit, Netlist

from pyspice_runner.circuit.law import LAWS, PAPER_LAW, ContactLaw, Law, law_of, laws_of, of_power
from pyspice_runner.circuit.motor import (
    CROWN,
    MOUNTED,
    MOUNTED_X,
    REVISION,
    Assembly,
    mode_values,
    outside,
    require_linear,
    rounded,
    spring_values,
    with_header,
)
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import ShaftLoad, TwoPhaseDrive, default_drive
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor, require_one_contact
from pyspice_runner.motor.parameters import HERTZ
from pyspice_runner.motor.stator import carriers
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import Library, Pin, check_name, read_library

SUBCIRCUIT = "piezomotor_averaged"
PINS = ("a_re", "a_im", "b_re", "b_im", "frequency", "shaft", "temperature", "heat")
PHASES, HARMONICS = 64, 3
FEWEST_PHASES, MOST_PHASES = 16, 512
MOST_HARMONICS = 6
CHECKED_HARMONICS = 2  # above those of the model; the check node gives the response to them
DEEPEST_M = 5e-4  # static penetration: half of the largest in piezomotor_averaged_phase.lib
_CONTACT = "piezomotor_averaged_contact"
_PHASE = "piezomotor_averaged_phase"
_OF_BENDING = ("stiffness", "tip_x", "tip_y")
_OF_PHASE = ("slider", "normal", "friction", "fx", "fy", "open", "slip", "motion", "bound")  # outputs of a phase


def check_resolution(phases: int, harmonics: int) -> None:
    """Raise ParameterError for a number of phases or harmonics out of range, or too few phases for the harmonics."""
    given = {"phases": (phases, FEWEST_PHASES, MOST_PHASES), "harmonics": (harmonics, 1, MOST_HARMONICS)}
    for name, (value, low, high) in given.items():
        if value not in range(low, high + 1):
            raise ParameterError(f"{name} = {value} is out of range: it must be a whole number from {low} to {high}.")
    least = 4 * (harmonics + CHECKED_HARMONICS)
    if phases < least:
        raise ParameterError(f"phases = {phases} cannot resolve {harmonics} harmonics: give at least {least} phases.")


OPEN = 100.0  # frequency of a mode over the corner of its electrode, above which that is open within 1e-4


def check_averaged(contact: ContactLaw | None, what: str = "contact") -> None:
    """Raise ParameterError for a law of the contact without an averaged model: any other than the spring-slider."""
    law = law_of(contact)
    if law is None or "averaged" not in law.forms:
        having = " or ".join(repr(name) for name in LAWS if "averaged" in Law(name).forms)
        raise ParameterError(
            f"{what} = {law.name if law else None!r} has no averaged model: it must be {having}. Use the full motor "
            "for others."
        )


def require_averaged(motor: Motor) -> Motor:
    """Return the motor that is averaged: one with a feedback electrode as it is with that open.

    Raise ParameterError for a mode that is not linear, a loss without an averaged model, a deep penetration, or a
    feedback electrode on a small resistance.
    """
    require_linear(motor, "The averaged motor")
    if (electrode := motor.feedback) and motor.modes[0].frequency_hz < (slowest := OPEN * electrode.corner_hz):
        raise ParameterError(
            f"feedback.resistance_ohm = {electrode.resistance_ohm:g} ohm loads the electrode below "
            f"{electrode.corner_hz:.3g} Hz, and the averaged motor takes it as open: the modes must be above "
            f"{slowest:.3g} Hz. Raise it, or leave the electrode out (--set feedback=none)."
        )
    if flat := max(one.contact.worn_flat_radius_m for one in motor.touching):
        raise ParameterError(
            f"contact.worn_flat_radius_m = {flat:g} has no averaged model: it must be 0. Set it, or use the full motor."
        )
    if len(exponents := {one.contact.exponent for one in motor.touching}) > 1:
        given = " and ".join(f"{value:g}" for value in sorted(exponents))
        raise ParameterError(
            f"contacts: exponent = {given} has no averaged model: it must be the same at all contacts. Set it, or use "
            "the full motor."
        )
    for one, law in zip(motor.touching, laws_of(motor, PAPER_LAW), strict=True):
        check_averaged(law, f"contacts.{one.name}.law")
    penetration = motor.at_rest.depth_m.max()
    if penetration > DEEPEST_M:
        raise ParameterError(
            f"contact.preload_n = {motor.contact.preload_n:g} N presses the tip {1e3 * penetration:.3g} mm into the "
            f"{motor.moved}; the averaged model takes up to {1e3 * DEEPEST_M:g} mm. Lower it, or use the full motor."
        )
    return motor.with_open_electrode


def _orders(name: str, harmonics: int) -> list[str]:
    """Return the nodes of a quantity: its mean, and real and imaginary part of each harmonic."""
    return [f"{name}_0", *(f"{name}_{part}{order}" for order in range(1, harmonics + 1) for part in ("re", "im"))]


def contact_pins(harmonics: int) -> list[str]:
    """Return the pins of ``piezomotor_averaged_contact``, in order; ``x_own`` is ``x_0`` without the carrier."""
    given = [*_orders("x", harmonics), *_orders("y", harmonics)]
    found = [*_orders("fx", harmonics + CHECKED_HARMONICS), *_orders("fy", harmonics + CHECKED_HARMONICS)]
    return [*given, "x_own", "frequency", "shaft", *found, "normal", "friction", "open", "slip"]


def _sums(phases: int, harmonics: int) -> Iterator[tuple[int, int, float, float]]:
    for number in range(phases):
        angle = 2.0 * pi * number / phases
        for order in range(1, harmonics + 1):
            yield number, order, cos(order * angle), sin(order * angle)


def _source(name: str, target: str, source: str, gain: float) -> str | None:
    rounded = float(f"{gain:.12g}")
    return f"G{name} 0 {target} {source} 0 {rounded!r}" if abs(rounded) > 1e-12 else None


class Terms(NamedTuple):
    """Terms of the averaged contact that are written where a motor has them."""

    series: bool = True  # a compliance in series along the normal
    series_x: bool = True  # a compliance in series along the rotor
    falling: bool = True  # friction that falls with the slip velocity
    exponent: float = HERTZ  # of the normal force in the penetration

    @classmethod
    def of(cls, motor: Motor) -> Terms:
        """Return the terms of a motor, those that any of its contacts has."""
        contacts = [one.contact for one in motor.touching]
        return cls(
            any(contact.series_compliance_m_per_n > 0.0 for contact in contacts),
            any(contact.tangential_series_compliance_m_per_n > 0.0 for contact in contacts),
            any(contact.sliding_ratio < 1.0 for contact in contacts),
            contacts[0].exponent,
        )

    @property
    def power(self) -> dict[str, str]:
        """The powers of Hertz's law in the libraries, and what stands for them."""
        return {} if self.exponent == HERTZ else {
            "(2/3)": repr(1.0 / self.exponent), "**1.5": f"**{self.exponent!r}",
            "*1e-9": f"*{10.0 ** (-6.0 * self.exponent)!r}",
            "/sqrt(max(V(hold),0.1))": f"/max(V(hold),0.1)**{self.exponent - 1.0!r}",
        }  # fmt: skip


ALL_TERMS = Terms()


@cache
def averaged_phase(terms: Terms) -> Library:
    """Return ``piezomotor_averaged_phase`` with the terms that a motor has."""
    library = read_library(_PHASE)
    lines, absent = {line.partition(" 0 V=")[0]: line for line in library.subcircuit.splitlines()}, list[str]()
    left: list[tuple[str, str]] = []  # terms that are left out, and what stands for them
    if not terms.series:
        del lines["Bhold hold"], lines["Bdepth depth"]
        factor = lines["Bfree free"].partition(" 0 V=")[2].partition("+{damping*series}")[0]
        lines["Bfree free"] = f"Bhold hold 0 V=min(uramp({factor}),4)"
        lines["Bnormal normal"] = lines["Bnormal normal"].partition("uramp")[0] + "V(hold)*V(depth)**1.5"
        left += [(" series=0", ""), ("+1e6*series*preload", ""), ("Bapproach approach", "Bdepth depth")]
        absent.append("series")
    if not terms.series_x:
        del lines["Bbound bound"]
        left += [(" series_x=0", ""), ("-{1e6*series_x}*V(friction)", ""), ("{1e6*series_x}*V(friction)+", "")]
        clipped = "max(-V(limit),min(V(limit),V(moved)"
        for name in ("Bfriction friction", "Bslipped slipped"):
            lines[name] = lines[name].replace(f"{clipped}-{{1e6*series_x}}*V(friction)))", "V(slider)")
            lines[name] = lines[name].replace(f"{clipped}))", "V(slider)")
        left += [(" limit ", " bound "), ("(limit)", "(bound)")]
        absent.append("series_x")
    if not terms.falling:
        del lines["Bslipped slipped"], lines["Bfallen fallen"]
        left += [("*V(fallen)", ""), (" sliding=1 stribeck=50m", "")]
        absent += ["sliding", "stribeck"]
    text = "\n".join(lines.values())
    for term, instead in (*left, *terms.power.items()):
        text = text.replace(term, instead)
    parameters = tuple(item for item in library.parameters if item.name not in absent)
    if terms.exponent != HERTZ:
        other = (of_power(item, f"{terms.exponent:g}") for item in parameters)
        parameters = tuple(replace(one, meaning=one.meaning.replace("the Hertz law", "the power law")) for one in other)
    return replace(library, subcircuit=text, parameters=parameters)


def _carry(node: str, last: str, start: str) -> tuple[str, ...]:
    """Return the lines of a node with what another had at the end of the period, for the start of the next."""
    carry = f"B{node} 0 {node} I=1u*V(frequency)*(V({last})-V({node}))"
    return carry, f"C{node} {node} 0 1u ic={start}", f"R{node} {node} 0 1g"


@cache
def averaged_contact(phases: int = PHASES, harmonics: int = HARMONICS, terms: Terms = ALL_TERMS) -> Library:
    """Return ``piezomotor_averaged_contact``, which chains one ``piezomotor_averaged_phase`` per phase.

    The parameters are those of a phase. The displacement of the slider, and with a compliance in series the force, go
    from phase to phase and, by capacitors, from period to period. (A closed ring of forces, whose equations have larger
    terms beside the diagonal than on it, makes ngspice's matrix inaccurate.) The forces have :data:`CHECKED_HARMONICS`
    harmonics more than the tip's motion, which show what the model leaves out. Raise ParameterError for a number out of
    range.
    """
    check_resolution(phases, harmonics)
    phase, series = averaged_phase(terms), terms.series
    defaults = phase.subcircuit.partition("\n")[0].split()[len(phase.pins) + 2 :]
    passed = " ".join(f"{item.name}={{{item.name}}}" for item in phase.parameters)
    pins = contact_pins(harmonics)
    lines: list[str | None] = [
        f".subckt {_CONTACT} {' '.join(pins)} {' '.join(defaults)}",
        f"Bturn turn 0 V={{1e6*radius/{phases}}}*V(shaft)/max(V(frequency),1)",
        f"Erate rate 0 frequency 0 {{0.5*{phases}}}",
        "Gtorque 0 shaft friction 0 {radius}",
        *_carry("carry", f"taken{phases - 1}", "0"),
        # the slider that is carried over is that which the tip takes along as it moves from period to period, unless it
        # slips in the period that follows: taken0 to the last
        f"Bown own 0 V=V(x{phases - 1})-V(x_0)+V(x_own)",
        "Vmoves own moves 0",
        "Cmoves moves 0 1u",
        "Btaken taken 0 V=V(carry)+1e6*I(Vmoves)/max(V(frequency),1)",
        *(_carry("carry_1", f"normal{phases - 1}", "{preload}") if series else []),
        *(_carry("carry_2", f"normal{phases - 2}", "{preload}") if series else []),
    ]
    for number in range(phases):
        before, after = (number - 1) % phases, (number + 1) % phases
        slider = "carry" if number == 0 else f"slider{before}"
        forces = " ".join(f"normal{(number - back) % phases}" for back in (1, 2))
        if series and number < 2:
            forces = ("carry_1 carry_2", "normal0 carry_1")[number]
        nodes = f"x{number} y{number} x{before} y{before} x{after} y{after} {slider} {forces} turn rate"
        outputs = " ".join(f"{name}{number}" for name in _OF_PHASE)
        lines.append(f"Xphase{number} {nodes} {outputs} {_PHASE} {passed}")
        taken, bound = f"taken{before if number else ''}", f"V(bound{number})"
        lines.append(f"Btaken{number} taken{number} 0 V=max(-{bound},min({bound},V({taken})+V(motion{number})))")
        for axis in "xy":
            lines += [f"R{axis}{number} {axis}{number} 0 1", f"G{axis}{number}_0 0 {axis}{number} {axis}_0 0 1"]
        for name in ("normal", "friction", "open", "slip"):
            lines.append(_source(f"{name}{number}", name, f"{name}{number}", 1.0 / phases))
        for axis in "xy":
            lines.append(_source(f"f{axis}{number}_0", f"f{axis}_0", f"f{axis}{number}", 1.0 / phases))
    for number, order, real, imaginary in _sums(phases, harmonics):
        for axis in "xy":
            target, place = f"{axis}{number}", f"{axis}{number}_{order}"
            lines.append(_source(f"{place}re", target, f"{axis}_re{order}", real))
            lines.append(_source(f"{place}im", target, f"{axis}_im{order}", -imaginary))
    for number, order, real, imaginary in _sums(phases, harmonics + CHECKED_HARMONICS):
        for axis in "xy":
            source, place = f"f{axis}{number}", f"f{axis}{number}_{order}"
            lines.append(_source(f"{place}re", f"f{axis}_re{order}", source, 2.0 / phases * real))
            lines.append(_source(f"{place}im", f"f{axis}_im{order}", source, -2.0 / phases * imaginary))
    lines += [f"R{name} {name} 0 1" for name in pins[pins.index("shaft") + 1 :]]
    lines.append(f".ends {_CONTACT}")
    return replace(
        phase, name=_CONTACT, title=f"averaged contact, {phases} phases, {harmonics} harmonics",
        pins=tuple(Pin(name, "in" if name[0] in "xy" else "inout", "", "") for name in pins),
        subcircuit="\n".join(line for line in lines if line), text="", usage="", needs=(_PHASE,),
    )  # fmt: skip


class AveragedSubCircuit(Assembly):
    """``.subckt piezomotor_averaged a_re a_im b_re b_im frequency shaft temperature heat`` of one motor.

    The contact is evaluated at a number of phases, for a number of harmonics of the tip's motion. Without ``thermal``
    the motor does not drift.
    """

    def __init__(
        self,
        motor: Motor,
        *,
        phases: int = PHASES,
        harmonics: int = HARMONICS,
        thermal: Thermal | None = None,
        name: str = SUBCIRCUIT,
    ) -> None:
        motor = require_averaged(motor)
        require_one_contact(motor, "The averaged motor in ngspice, and its .lib, are", "Export a .fmu or a full .lib")
        motor = motor.on_carrier()
        contact = motor.contact
        values = {
            "preload": contact.preload_n, "friction": contact.friction,
            "normal_stiffness": contact.normal_stiffness_n_per_m15, "inertia": motor.rotor.inertia_kg_m2,
            "bearing": motor.rotor.bearing_damping_n_m_s, "radius": motor.rotor.radius_m,
        }  # fmt: skip
        parts = averaged_phase(Terms.of(motor)), read_library("piezomotor_rotor")
        known = {item.name: item for part in parts for item in part.parameters}
        known["friction"] = known["mu"]
        self.settable = tuple(replace(known[key], name=key, default=rounded(value)) for key, value in values.items())
        super().__init__(name, *PINS, **{item.name: repr(item.default) for item in self.settable})
        self._add_groups(motor, thermal)
        drift = {
            "frequency_drift": thermal.frequency_drift_per_k if thermal else 0.0,
            "coupling_drift": thermal.coupling_drift_per_k if thermal else 0.0,
        }
        for index, mode in enumerate(motor.modes, start=1):
            values = {name: value for name, value in mode_values(mode).items() if name in _OF_BENDING}
            self._put(f"bending{index}", f"{SUBCIRCUIT}_bending", ("fx_0", "fy_0", "x_0", "y_0"), values, ["preload"])
            self._add_harmonics(f"mode{index}", mode_values(mode) | drift, ("temperature", "heat"), harmonics)
        for springs, axis in zip(carriers(motor.mount), "yx", strict=False):  # at the harmonics modes without a drive
            shape = {f"tip_{name}": float(name == axis) for name in "xy"}
            moved = spring_values(springs) | {"coupling_a": 0.0, "coupling_b": 0.0} | shape
            self._add_harmonics(f"carrier_{axis}", moved, (self.gnd, self.gnd), harmonics)
        self._add_motion_by_voltage(motor)
        for node in (*_orders("x", harmonics), *_orders("y", harmonics), "heat"):
            self.R(f"sum_{node}", node, self.gnd, 1)
        self.R("open_temperature", "temperature", self.gnd, 1e9)
        self._add_check(motor, harmonics)
        terms = Terms.of(motor)
        self._libraries.append(averaged_phase(terms))  # instead of that which the contact needs by its name
        self._add_contact(motor, averaged_contact(phases, harmonics, terms), contact_pins(harmonics))
        self._put("rotor", "piezomotor_rotor", ("shaft",), {}, ["inertia", "bearing"])
        if motor.rotor.bearing_friction_n_m:
            dry = {"torque": motor.rotor.bearing_friction_n_m, "angle": motor.rotor.bearing_presliding_rad}
            self._put("bearing", "piezomotor_bearing", ("shaft", "bearing_share"), dry)

    def _add_harmonics(
        self, name: str, values: dict[str, float], warm: tuple[str | int, str | int], harmonics: int
    ) -> None:
        """Add a mode at each harmonic, and its response to the harmonics left out."""
        arm = {key: value for key, value in values.items() if not key.startswith(("coupling", "frequency"))}
        for order in range(1, harmonics + CHECKED_HARMONICS + 1):
            within = order <= harmonics
            groups = ("a_re", "a_im", "b_re", "b_im") if order == 1 else (self.gnd,) * 4
            forces = [f"{axis}_{part}{order}" for axis in ("fx", "fy") for part in ("re", "im")]
            moves = [f"{'' if within else 'left_'}{axis}_{part}{order}" for axis in "xy" for part in ("re", "im")]
            if within:
                nodes = (*groups, *forces, *moves, "frequency", *warm)
                self._put(f"{name}_{order}", f"{SUBCIRCUIT}_mode", nodes, values | {"harmonic": order})
            else:
                nodes = (*forces, *moves, "frequency")
                self._put(f"check_{name}_{order}", f"{SUBCIRCUIT}_check", nodes, arm | {"harmonic": order})

    def _add_motion_by_voltage(self, motor: Motor) -> None:
        """Add what moves the tip by modes that are left out, and its current j ω S F."""
        for axis, row in zip("xy", motor.stator.residual_per_volt.tolist(), strict=True):
            for group, moved in zip(GROUPS, row, strict=True):
                for part, other, sign in (("re", "im", -1.0), ("im", "re", 1.0)) if moved else ():
                    name, pin = f"moved_{axis}_{group}_{part}", f"{group}_{part}"
                    self.VCCS(name, self.gnd, f"{axis}_{part}1", pin, self.gnd, transconductance=rounded(1e6 * moved))
                    drawn = f"{rounded(sign * 2.0 * pi * moved)!r}*V(frequency)*V(f{axis}_{other}1)"
                    self.B(name, pin, self.gnd, i=drawn)

    def _add_groups(self, motor: Motor, thermal: Thermal | None) -> None:
        piezo, between = motor.piezo, abs(motor.piezo.capacitance_ab_f)
        capacitances = {group: own - between for group, own in zip(GROUPS, piezo.capacitances, strict=True)}
        if between:  # a group of its own at the difference of the voltages, at their sum for a negative capacitance
            capacitances["ab"] = between
            sign = -1.0 if piezo.capacitance_ab_f > 0.0 else 1.0
            for part in ("re", "im"):
                self.B(f"ab_{part}", f"across_{part}", self.gnd, v=f"V(a_{part})+({sign})*V(b_{part})")
                self.V(f"ab_{part}", f"across_{part}", f"ab_{part}", "DC 0")
                self.CCCS(f"a_{part}", f"a_{part}", self.gnd, f"Vab_{part}", current_gain=1)
                self.CCCS(f"b_{part}", f"b_{part}", self.gnd, f"Vab_{part}", current_gain=sign)
        for group, capacitance in capacitances.items():
            values = {
                "capacitance": capacitance, "loss": motor.piezo.loss_tangent,
                "capacitance_drift": thermal.capacitance_drift_per_k if thermal else 0.0,
            }  # fmt: skip
            nodes = (f"{group}_re", f"{group}_im", "frequency", "temperature", "heat")
            self._put(groups.named("group", group), f"{SUBCIRCUIT}_group", nodes, values)

    def _add_contact(self, motor: Motor, library: Library, nodes: list[str]) -> None:
        contact, preload = motor.contact, motor.contact.preload_n
        sway = motor.sway_m / preload
        if sway:  # the crown of the rotor is above the tip at rest
            self.V("sway", "x_0", CROWN, f"DC {{{1e6 * sway:.10g}*preload}}")
            nodes[0] = CROWN
        nodes[nodes.index("x_own")] = nodes[0]
        if motor.mount:
            self.VCVS("carrier", "fy_carrier", self.gnd, "fy_0", self.gnd, voltage_gain=1)
            pins = ("fy_carrier", "y_0", self.gnd, *MOUNTED.values(), "base")
            self._put("mount", "piezomotor_mount", pins, spring_values(motor.mount), ["preload"])
            nodes[nodes.index("y_0")] = MOUNTED["y"]
        if motor.mount and (along := motor.mount.tangential):  # likewise, by the mean force along the rotor
            self.VCVS("carrier_x", "fx_carrier", self.gnd, "fx_0", self.gnd, voltage_gain=1)
            pins = ("fx_carrier", nodes[0], self.gnd, *MOUNTED_X.values(), "base_x")
            self._put("mount_x", "piezomotor_mount", pins, spring_values(along) | {"preload": 0.0})
            nodes[0] = MOUNTED_X["x"]
            # its velocity adds to that of the tip on the rotor; the torque passes through the source
            self.VCVS("passed", "passed", "shaft", MOUNTED_X["vx"], self.gnd, voltage_gain="{-1/radius}")
            nodes[nodes.index("shaft")] = "passed"
        values: dict[str, float | str] = {
            "compliance": contact_law.total_compliance(contact), "mu": "{friction}",
            "damping": contact_law.normal_damping(contact),
            "deflection": f"{{{1e6 * motor.deflection_m / preload:.10g}*preload}}",
        }  # fmt: skip
        if contact.series_compliance_m_per_n:
            values["series"] = contact.series_compliance_m_per_n
        if contact.tangential_series_compliance_m_per_n:
            values["series_x"] = contact.tangential_series_compliance_m_per_n
        if contact.sliding_ratio < 1.0:
            values |= {"sliding": contact.sliding_ratio, "stribeck": contact.stribeck_velocity_m_s}
        self._put("contact", library, nodes, values, ["normal_stiffness", "radius", "preload"])

    def _add_check(self, motor: Motor, harmonics: int) -> None:
        """Add the node ``check``: the motion at the harmonics left out, over the static penetration and limit of stick.

        It is at least 1 if a parameter of the X line is out of its range.
        """
        power, softness = Terms.of(motor).power.get("(2/3)", "(2/3)"), contact_law.total_compliance(motor.contact)
        depth = f"(1e6*(preload/normal_stiffness)**{power})"
        limits = {"x": f"({softness:.10g}*friction*normal_stiffness**{power}*{depth})", "y": depth}
        squares = []
        for order in range(harmonics + 1, harmonics + CHECKED_HARMONICS + 1):
            for axis, limit in limits.items():
                for part in ("re", "im"):
                    node = f"left_{axis}_{part}{order}"
                    self.R(f"sum_{node}", node, self.gnd, 1)
                    squares.append(f"(V({node})/{{{limit}}})**2")
        self.raw_spice += f".param outside={outside(self.settable)}\n"
        self.raw_spice += f"Bcheck check 0 V=sqrt({'+'.join(squares)}+{{1e-24+outside}})\n"


def default_two_phase(motor: Motor) -> TwoPhaseDrive:
    """Return the recommended drive, or 50 V at the highest resonance if that drive has two tones."""
    drive = default_drive(motor)
    if not isinstance(drive, TwoPhaseDrive):  # two tones have no common amplitude
        drive = TwoPhaseDrive(voltage=50.0, frequency=max(mode.frequency_hz for mode in motor.modes))
    return drive


def averaged_library(motor: Motor, *, name: str = "", thermal: Thermal | None = None) -> str:
    """Return a self-contained library of one averaged motor: header, parts and ``.subckt piezomotor_averaged``.

    The names of the parts begin with that of the subcircuit. Without ``thermal`` the motor does not drift.

    Raises:
        ParameterError: for an invalid name.
    """
    circuit = AveragedSubCircuit(motor, thermal=thermal, name=check_name(name) if name else SUBCIRCUIT)
    drive = default_two_phase(motor)
    b = rect(drive.voltage, radians(drive.phase_deg))
    about = [
        f"* {circuit.name}: standing-wave piezomotor {motor.name}, averaged over the period of the drive",
        "*",
        "*   a_re, a_im o---.---------------------------.---o shaft        1 V = 1 rad/s, 1 A = 1 N.m",
        "*   b_re, b_im o---|  complex amplitudes       |---o temperature  1 V = 1 K",
        "*    frequency o---|  1 V = 1 Hz               |---o heat         1 V = 1 W",
        "*                  '---------------------------'",
        "*",
        "* The voltage of group A is u(t) = Re((a_re + j a_im) exp(j theta)), d theta/dt = 2 pi frequency; B likewise.",
        "* The pins draw the amplitude of the current. Frequency, amplitude and phase may change at any time.",
        "* .op is the steady state, .dc a frequency response, .ac a transfer function up to a fortieth of the drive's",
        "* frequency, .tran a run over seconds. Under a load torque, start .op from rest: .nodeset v(shaft)=0.",
        "*",
        "* PIN  a_re         inout  V      amplitude of group A, real part",
        "* PIN  a_im         inout  V      amplitude of group A, imaginary part",
        "* PIN  b_re         inout  V      amplitude of group B, real part",
        "* PIN  b_im         inout  V      amplitude of group B, imaginary part",
        "* PIN  frequency    in     Hz     drive frequency",
        "* PIN  shaft        inout  rad/s  rotor speed; a current fed into the pin is a driving torque",
        "* PIN  temperature  in     K      temperature above that of the parameters; if open, nothing drifts",
        "* PIN  heat         out    W      heat of the losses; it may stay open",
    ]
    notes = [
        "* NODES inside, to plot: normal friction (N), open slip (share of the period), check (accurate below 0.02,",
        "*        1 or more for a parameter out of its range)",
        "*",
        "* SOURCE generalised averaging of the motor of Andersen, Helbo, Blanke, 2002; docs/tracking.md",
        f"* OMITS  {'' if thermal else 'temperature, '}{read_library(_PHASE).omits}",
        f"* REVISION {REVISION}",
        f"* TESTED WITH {read_library(_PHASE).tested_with}",
        "* NOTE   an XSPICE device (A...) in the deck makes ngspice set trtol = 1, against .options: several times as",
        "*        many time steps. Use a B source instead, or put these three lines into the deck:",
        *(f"*          {line}" for line in KEEP_TRTOL),
        "*",
        "* USE    the first line of a deck is its title, so put these after a title",
        f"*   Va a_re 0 {drive.voltage:g}",
        f"*   Vb_re b_re 0 {b.real:.6g}",
        f"*   Vb_im b_im 0 {b.imag:.6g}",
        f"*   Vf frequency 0 {drive.frequency:.6g}",
        f"*   Xmotor a_re 0 b_re b_im frequency shaft 0 heat {circuit.name}",
        "*   .options method=gear trtol=50",
        "*   .tran 20u 100m 0 2m uic",
        "*   .measure tran speed_rad_s FIND v(shaft) AT=100m",
    ]
    return with_header(motor, circuit.library(about, notes))


def add_averaged_motor(circuit: Netlist, motor: Motor, nodes: Sequence[str | int], **settings: Any) -> None:
    """Put an averaged motor ``Xmotor`` with the pins :data:`PINS`, and its parts, into a PySpice circuit.

    ``settings`` are those of :class:`AveragedSubCircuit`.
    """
    definition = AveragedSubCircuit(motor, **settings)
    circuit.raw_spice += definition.parts + "\n"
    circuit.subcircuit(definition)
    circuit.X("motor", SUBCIRCUIT, *nodes)


# Gear damps what the averages leave out, such as the ringing of a mode far from the drive; the trapezoidal
# rule does not. ngspice chooses the step; with trtol = 50 the error of the speed is a few tenths of a per cent.
OPTIONS = {"method": "gear", "trtol": "50", "reltol": "1e-3", "vntol": "1e-6", "abstol": "1e-9"}
# an XSPICE device makes ngspice set trtol = 1 while it reads the circuit; this variable has to be set before that
KEEP_TRTOL = (".control", f"pre_set xtrtol={OPTIONS['trtol']}", ".endc")
Schedule = Sequence[tuple[float, float]]  # times in s and values; linear in between, constant before and after


def add_angle(circuit: Circuit, load: ShaftLoad) -> None:
    """Add the node ``position``, the angle of the shaft in rad, and what is coupled to the shaft.

    Behind an elastic coupling it turns with ``v(load)`` in rad/s, to the angle ``v(load_position)``.
    """

    def angle(of: str, node: str) -> str:
        return f"G{node} 0 {node} {of} 0 1\nC{node} {node} 0 1 ic=0\nR{node} {node} 0 1t\n"

    text, of, turned = angle("shaft", "position"), "shaft", "position"
    if load.coupling_stiffness_n_m_per_rad:
        of, turned = "load", "load_position"
        twist, play = f"(V(position)-V({turned}))", repr(0.5 * load.backlash_rad)
        text += angle(of, turned)
        text += f"Bwound wound 0 V=uramp({twist}-{play})-uramp(-{twist}-{play})\n"
        text += (
            f"Bpassed passed 0 V={load.coupling_stiffness_n_m_per_rad!r}*V(wound)"
            f"+{load.coupling_damping_n_m_s!r}*(V(shaft)-V({of}))\n"
        )
        # a coupling with play does not pull its sides together
        sided = "u(V(wound))*uramp(V(passed))-u(-V(wound))*uramp(-V(passed))" if load.backlash_rad else "V(passed)"
        text += f"Bcoupling shaft {of} I={sided}\n"
    if load.inertia_kg_m2:
        text += f"Cload {of} 0 {load.inertia_kg_m2!r} ic=0\nRload {of} 0 1t\n"
        text += f"Gload {of} 0 {of} 0 {load.damping_n_m_s!r}\n"
        weight = f"{load.gravity_n_m!r}*sin(V({turned})+{radians(load.gravity_angle_deg)!r})"
        text += f"Bheld {of} 0 I={load.spring_n_m_per_rad!r}*V({turned})+{weight}\n"
    circuit.raw_spice += text


def add_surroundings(circuit: Circuit, settings: Mapping[str, Schedule], thermal: Thermal) -> None:
    """Let the surroundings of a motor with cooling follow the course ``temperature``, if there is one."""
    if "temperature" in settings:
        flow = [(time, (value - thermal.ambient_k) / thermal.thermal_resistance_k_per_w)
                for time, value in settings["temperature"]]  # fmt: skip
        circuit.I("surroundings", circuit.gnd, "temperature", schedule_text(flow))


def first(course: Schedule) -> float:
    """Return the value of a course at the start."""
    return float(np.interp(0.0, *np.transpose(course)))


def schedule_text(points: Schedule) -> str:
    """Return the value of an independent source that follows a course."""
    if len(points) == 1:
        return f"DC {float(points[0][1])!r}"
    return "PWL(" + " ".join(f"{float(time)!r} {float(value)!r}" for time, value in points) + ")"
