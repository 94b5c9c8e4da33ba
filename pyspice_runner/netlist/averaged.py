# SPDX-License-Identifier: GPL-3.0-or-later
r"""The averaged motor: complex amplitudes at the drive's frequency instead of waveforms.

A quantity is written :math:`q(t) = q_0 + \mathrm{Re}\sum_{h=1}^{H} Q_h e^{jh\theta}` with :math:`\dot\theta = 2\pi f`;
mean and amplitudes vary slowly. The modes are linear in them (``piezomotor_averaged_mode``). The contact is evaluated
at N phases of the period, and sums over the phases give the mean and the harmonics of its forces
(``piezomotor_averaged_contact``, written by :func:`contact_text`). ``docs/averaged.md`` has the derivation.

``behavioral/piezomotor_averaged_contact.lib`` is written by ``python -m pyspice_runner.netlist.averaged``.
"""

from __future__ import annotations

import sys
from cmath import rect
from collections.abc import Iterator, Mapping, Sequence
from math import cos, pi, radians, sin

from PySpice.Spice.Netlist import Circuit, Netlist

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import Load, TwoPhaseDrive, default_drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.benches import add_cooling
from pyspice_runner.netlist.library import Library, check_name, data_path, parse_library, read_library
from pyspice_runner.netlist.motor import CROWN, MOUNTED, REVISION, Assembly, require_linear
from pyspice_runner.netlist.sources import FREE, Bench

SUBCIRCUIT = "piezomotor_averaged"
PINS = ("a_re", "a_im", "b_re", "b_im", "frequency", "shaft", "temperature", "heat")
PHASES, HARMONICS = 64, 3
FEWEST_PHASES, MOST_PHASES = 16, 512
MOST_HARMONICS = 6
CHECKED_HARMONICS = 2  # above those of the model; the check node gives the response to them
_CONTACT = "piezomotor_averaged_contact"
_PHASE = "piezomotor_averaged_phase"
HELD_INERTIA = 1e3  # kg·m², of a shaft that is held: its surface does not oscillate


def check_resolution(phases: int, harmonics: int) -> None:
    """Check the numbers of phases and harmonics.

    Raises:
        ParameterError: for a number out of range, or too few phases for the harmonics.
    """
    if phases not in range(FEWEST_PHASES, MOST_PHASES + 1):
        raise ParameterError(
            f"phases = {phases} is out of range: it must be a whole number from {FEWEST_PHASES} to {MOST_PHASES}."
        )
    if harmonics not in range(1, MOST_HARMONICS + 1):
        raise ParameterError(
            f"harmonics = {harmonics} is out of range: it must be a whole number from 1 to {MOST_HARMONICS}."
        )
    least = 4 * (harmonics + CHECKED_HARMONICS)
    if phases < least:
        raise ParameterError(f"phases = {phases} cannot resolve {harmonics} harmonics: give at least {least} phases.")


def check_averaged(contact: str | None) -> None:
    """Check that a law of the contact has an averaged model.

    Raises:
        ParameterError: for any other law than the spring-slider.
    """
    if contact != "spring-slider":
        raise ParameterError(
            f"contact = {contact!r} has no averaged model: it must be 'spring-slider'. Use the full motor for others."
        )


def require_averaged(motor: Motor) -> None:
    """Check that a motor has no property that the averaged motor leaves out.

    Raises:
        ParameterError: for a mode that is not linear, or a loss of contact or bearing that it does not have.
    """
    require_linear(motor, "The averaged motor")
    left_out = {
        "contact.sliding_ratio": (motor.contact.sliding_ratio, 1.0),
        "contact.series_compliance_m_per_n": (motor.contact.series_compliance_m_per_n, 0.0),
        "rotor.bearing_friction_n_m": (motor.rotor.bearing_friction_n_m, 0.0),
    }
    for name, (value, neutral) in left_out.items():
        if value != neutral:
            raise ParameterError(
                f"{name} = {value:g} has no averaged model: it must be {neutral:g}. Set it, or use the full motor."
            )


def _orders(name: str, harmonics: int) -> list[str]:
    """Return the nodes of a quantity: its mean, and real and imaginary part of each harmonic."""
    return [f"{name}_0", *(f"{name}_{part}{order}" for order in range(1, harmonics + 1) for part in ("re", "im"))]


def contact_pins(harmonics: int) -> list[str]:
    """Return the pins of ``piezomotor_averaged_contact``, in order."""
    given = [*_orders("x", harmonics), *_orders("y", harmonics)]
    found = [*_orders("fx", harmonics + CHECKED_HARMONICS), *_orders("fy", harmonics + CHECKED_HARMONICS)]
    return [*given, "frequency", "shaft", *found, "normal", "friction", "open", "slip"]


def _sums(phases: int, harmonics: int) -> Iterator[tuple[int, int, float, float]]:
    for number in range(phases):
        angle = 2.0 * pi * number / phases
        for order in range(1, harmonics + 1):
            yield number, order, cos(order * angle), sin(order * angle)


def _source(name: str, target: str, source: str, gain: float) -> str | None:
    rounded = float(f"{gain:.12g}")
    return f"G{name} 0 {target} {source} 0 {rounded!r}" if abs(rounded) > 1e-12 else None


def _phase(number: int, phases: int) -> str:
    """Return the line of one phase; the slider goes from phase to phase, and by a capacitor from period to period."""
    before, after = (number - 1) % phases, (number + 1) % phases
    slider = "carry" if number == 0 else f"slider{before}"
    nodes = f"x{number} y{number} x{before} y{before} x{after} y{after} {slider} turn rate"
    outputs = " ".join(f"{name}{number}" for name in ("slider", "normal", *_FOUND))
    return f"Xphase{number} {nodes} {outputs} {_PHASE} {_PASSED}"


def _fine_phase(number: int, phases: int) -> str:
    """Return the line of one phase that passes the slider with a delay and knows the phases about it."""
    earlier, before, after = ((number + step) % phases for step in (-2, -1, 1))
    rooms = " ".join(f"{way}{at}" for way in ("up", "down") for at in (earlier, before, after))
    nodes = f"x{number} y{number} x{before} y{before} x{after} y{after} anchor{before} {rooms} hold{before} mean{after}"
    outputs = " ".join(
        f"{name}{number}" for name in ("slider", "anchor", "up", "down", "hold", "mean", "normal", *_FOUND)
    )
    return f"Xphase{number} {nodes} turn rate {outputs} {_PHASE}_fine {_PASSED}"


def contact_text(phases: int = PHASES, harmonics: int = HARMONICS, *, side_bands: bool = False) -> str:
    """Return the text of ``piezomotor_averaged_contact`` for some number of phases and harmonics.

    Args:
        phases: number of phases.
        harmonics: number of harmonics of the tip's motion.
        side_bands: whether it follows modulations up to a tenth of the drive's frequency.
    """
    check_resolution(phases, harmonics)
    pins = contact_pins(harmonics)
    lines: list[str | None] = []
    for number in range(phases):
        lines.append((_fine_phase if side_bands else _phase)(number, phases))
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
            gain = 2.0 / phases
            if side_bands and axis == "x":  # the mean from the phase before to the phase after has smaller harmonics
                gain *= 2.0 * pi * order / phases / sin(2.0 * pi * order / phases)
            lines.append(_source(f"{place}re", f"f{axis}_re{order}", source, gain * real))
            lines.append(_source(f"{place}im", f"f{axis}_im{order}", source, -gain * imaginary))
    found = pins[pins.index("shaft") + 1 :]
    lines += [f"R{name} {name} 0 1" for name in found]
    given = "\n".join(
        f"* PIN  {name:<9} in     um     {_meaning(name)}" for name in pins if name.startswith(("x", "y"))
    )
    forces = "\n".join(
        f"* PIN  {name:<9} out    N      {_meaning(name)}" for name in pins if name[:3] in ("fx_", "fy_")
    )
    return _CONTACT_LIB.format(
        name=_CONTACT, phases=phases, harmonics=harmonics, given=given, forces=forces, pins=" ".join(pins),
        body="\n".join(line for line in lines if line),
        memory="" if side_bands else _CARRY.format(last=phases - 1),
        text=_FINE if side_bands else _PLAIN, part=f"{_PHASE}_fine" if side_bands else _PHASE,
        omits="" if side_bands else "motion of the contact between two phases, ",
        example=" ".join("0" if name.startswith(("x", "y")) else name for name in pins),
    )  # fmt: skip


def _meaning(node: str) -> str:
    what = {"x": "tip displacement, tangential", "y": "tip displacement towards the rotor",
            "fx": "force on the tip, tangential", "fy": "force on the tip, towards the rotor"}  # fmt: skip
    name, _, order = node.partition("_")
    if order == "0":
        return f"{what[name]}: mean"
    part = "real" if order.startswith("re") else "imaginary"
    return f"{what[name]}: harmonic {order[2:]}, {part} part"


_PASSED = " ".join(
    f"{name}={{{name}}}"
    for name in ("normal_stiffness", "compliance", "mu", "radius", "preload", "deflection", "damping")
)

_FOUND = ("friction", "fx", "fy", "open", "slip")
_PLAIN = "* The displacement of the slider is passed from phase to phase and, by a capacitor, from period to period.\n"
_FINE = """\
* The displacement of the slider is passed from phase to phase, each time with the delay of a phase. The surface of the
* rotor oscillates with the friction force at the drive's frequency. So .ac is right up to a tenth of this frequency.
"""
_CARRY = """\
* the slider's displacement at the end of the period, for the start of the next
Bcarry 0 carry I=1u*V(frequency)*(V(slider{last})-V(carry))
Ccarry carry 0 1u
Rcarry carry 0 1g
"""
_CONTACT_LIB = """\
* SPDX-License-Identifier: GPL-3.0-or-later
* {name}: contact of tip and rotor averaged over the drive's period, {phases} phases, {harmonics} harmonics
*
*   mean and harmonics o--[ tip at each ]--[ contact at  ]--[ sums ]--o mean and harmonics of fx, fy
*   of x, y               [ phase       ]  [ each phase  ]         '--o torque on the shaft
*
{text}*
* A quantity is q(t) = q_0 + Re(sum of Q_h exp(j h theta)), d theta/dt = 2 pi frequency. The forces have two harmonics
* more than the displacements; these show what the model leaves out.
*
* Written by python -m pyspice_runner.netlist.averaged; do not edit.
*
{given}
* PIN  frequency in     Hz     drive frequency
* PIN  shaft     inout  rad/s  rotor speed; the contact feeds the mean torque, 1 A = 1 N.m
{forces}
* PIN  normal    out    N      mean normal force
* PIN  friction  out    N      mean friction force, positive where it drives the rotor forward
* PIN  open      out    1      share of the period in which the contact is open
* PIN  slip      out    1      share of the period in which the contact slips
*
*      name              unit       default  min   max   meaning
* PAR  normal_stiffness  N/m^1.5    7e9      1e3   1e13  K_N of the Hertz law
* PAR  compliance        m/N^(2/3)  3.3e-7   2.2e-10 1e-2  tangential compliance K_t of tip and rotor together
* PAR  mu                1          0.3      1e-4  5     coefficient of friction
* PAR  radius            m          0.01     1e-4  10    radius of the rotor
* PAR  preload           N          5        0     1e5   static normal force F_0
* PAR  deflection        um         0        0     1e6   static bending of the stator under the preload
* PAR  damping           s/m        0        0     1e6   Hunt-Crossley damping: F_N grows by damping * approach velocity
*
* SOURCE Andersen, Helbo, Blanke, "Modelling and Experiments of a Standing Wave Piezomotor", 2002, eqs. 13-18, corrected
* NEEDS  {part}
* OMITS  {omits}partial slip before gross slip, roughness, wear, adhesion
* REVISION 1
* STEP   that of the circuit in which it is used
* TESTED WITH ngspice 39 and 46
*
* USE    the first line of a deck is its title; then:
*   * a tip at rest on a rotor that turns: gross slip, the friction force is -mu F_N
*   Vshaft shaft 0 1
*   Vf frequency 0 50k
*   Xcontact {example} {name} mu=0.25 preload=4
*   .tran 10u 10m uic
*   .measure tran friction_n FIND v(friction) AT=10m
*   .measure tran slip FIND v(slip) AT=10m
* END USE
*
.subckt {name} {pins} normal_stiffness=7e9 compliance=3.3e-7 mu=0.3 radius=0.01 preload=5 deflection=0 damping=0
Bturn turn 0 V={{1e6*radius/{phases}}}*V(shaft)/max(V(frequency),1)
Erate rate 0 frequency 0 {{0.5*{phases}}}
{memory}Gtorque 0 shaft friction 0 {{radius}}
{body}
.ends {name}
"""


def averaged_contact(phases: int = PHASES, harmonics: int = HARMONICS, *, side_bands: bool = False) -> Library:
    """Return the library of the averaged contact, as :func:`contact_text` has it."""
    if (phases, harmonics, side_bands) == (PHASES, HARMONICS, False):
        return read_library(_CONTACT)
    return parse_library(_CONTACT, contact_text(phases, harmonics, side_bands=side_bands))


class AveragedSubCircuit(Assembly):
    """``.subckt piezomotor_averaged a_re a_im b_re b_im frequency shaft temperature heat`` of one motor.

    Args:
        motor: the motor.
        phases: number of phases at which the contact is evaluated.
        harmonics: number of harmonics of the tip's motion.
        thermal: drift with the pin ``temperature``; by default the motor does not drift.
        side_bands: whether it follows modulations up to a tenth of the drive's frequency, for ``.ac``.
        name: name of the subcircuit.
    """

    def __init__(
        self,
        motor: Motor,
        *,
        phases: int = PHASES,
        harmonics: int = HARMONICS,
        thermal: Thermal | None = None,
        side_bands: bool = False,
        name: str = SUBCIRCUIT,
    ) -> None:
        require_linear(motor, "The averaged motor")
        contact = motor.contact
        values = {
            "preload": contact.preload_n, "friction": contact.friction,
            "normal_stiffness": contact.normal_stiffness_n_per_m15, "inertia": motor.rotor.inertia_kg_m2,
            "bearing": motor.rotor.bearing_damping_n_m_s, "radius": motor.rotor.radius_m,
        }  # fmt: skip
        #: parameters of the X line, with their defaults
        self.settable = {key: float(f"{value:.10g}") for key, value in values.items()}
        super().__init__(name, *PINS, **{key: repr(value) for key, value in self.settable.items()})
        self._add_groups(motor, thermal)
        drift = {
            "frequency_drift": thermal.frequency_drift_per_k if thermal else 0.0,
            "coupling_drift": thermal.coupling_drift_per_k if thermal else 0.0,
        }
        kind = "_fine" if side_bands else ""
        for index, mode in enumerate(motor.modes, start=1):
            tip = {"tip_x": mode.tip_x, "tip_y": mode.tip_y}
            arm = {"mass": mode.mass_kg, "damping": mode.damping_n_s_per_m, "stiffness": mode.stiffness_n_per_m, **tip}
            bending = arm if side_bands else {"stiffness": mode.stiffness_n_per_m, **tip}
            pins = ("fx_0", "fy_0", "x_0", "y_0")
            self._put(f"bending{index}", f"{SUBCIRCUIT}_bending{kind}", pins, bending, ["preload"])
            for order in range(1, harmonics + 1):
                groups = ("a_re", "a_im", "b_re", "b_im") if order == 1 else (self.gnd,) * 4
                forces = [f"{axis}_{part}{order}" for axis in ("fx", "fy") for part in ("re", "im")]
                moves = [f"{axis}_{part}{order}" for axis in "xy" for part in ("re", "im")]
                couplings = {"coupling_a": mode.coupling_a_n_per_v, "coupling_b": mode.coupling_b_n_per_v}
                nodes = (*groups, *forces, *moves, "frequency", "temperature", "heat")
                self._put(
                    f"mode{index}_{order}", f"{SUBCIRCUIT}_mode{kind}", nodes,
                    {**arm, **drift, **couplings, "harmonic": order},
                )  # fmt: skip
            for order in range(harmonics + 1, harmonics + CHECKED_HARMONICS + 1):
                forces = [f"{axis}_{part}{order}" for axis in ("fx", "fy") for part in ("re", "im")]
                moves = [f"left_{axis}_{part}{order}" for axis in "xy" for part in ("re", "im")]
                nodes = (*forces, *moves, "frequency")
                self._put(f"check{index}_{order}", f"{SUBCIRCUIT}_check", nodes, {**arm, "harmonic": order})
        for node in (*_orders("x", harmonics), *_orders("y", harmonics), "heat"):
            self.R(f"sum_{node}", node, self.gnd, 1)
        self.R("open_temperature", "temperature", self.gnd, 1e9)
        self._add_check(motor, harmonics)
        library = averaged_contact(phases, harmonics, side_bands=side_bands)
        touching = contact_pins(harmonics)
        self._add_contact(motor, library, self._add_surface(touching, harmonics) if side_bands else touching)
        self._put("rotor", "piezomotor_rotor", ("shaft",), {}, ["inertia", "bearing"])

    def _add_surface(self, nodes: list[str], harmonics: int) -> list[str]:
        """Let the rotor's surface oscillate under the harmonics of the friction force; return the contact's nodes.

        The surface is a mode without a spring, of the mass J/R². Its force is opposite to that on the tip, and
        its motion is taken from that of the tip: so both have the factor -1. The stiffness is the least of the part.
        """
        values: dict[str, float | str] = {
            "mass": "{inertia/radius**2}", "damping": "{bearing/radius**2}", "stiffness": 1e-3, "coupling_a": 0.0,
            "coupling_b": 0.0, "tip_x": -1.0, "tip_y": 0.0,
        }  # fmt: skip
        for order in range(1, harmonics + 1):
            parts = (f"re{order}", f"im{order}")
            forces = [f"{axis}_{part}" for axis in ("fx", "fy") for part in parts]
            moves = [*(f"relative_{part}" for part in parts), self.gnd, self.gnd]
            pins = (*(self.gnd,) * 4, *forces, *moves, "frequency", "temperature", self.gnd)
            self._put(f"surface_{order}", f"{SUBCIRCUIT}_mode_fine", pins, {**values, "harmonic": order})
            for part in parts:
                self.VCVS(f"tip_{part}", f"tip_{part}", self.gnd, f"x_{part}", self.gnd, voltage_gain=1)
                self.R(f"tip_{part}", f"tip_{part}", f"relative_{part}", 1)
        return [f"relative_{name[2:]}" if name.startswith("x_") and name != "x_0" else name for name in nodes]

    def _add_groups(self, motor: Motor, thermal: Thermal | None) -> None:
        capacitances = {"a": motor.piezo.capacitance_a_f, "b": motor.piezo.capacitance_b_f}
        for group, capacitance in capacitances.items():
            values = {
                "capacitance": capacitance, "loss": motor.piezo.loss_tangent,
                "capacitance_drift": thermal.capacitance_drift_per_k if thermal else 0.0,
            }  # fmt: skip
            nodes = (f"{group}_re", f"{group}_im", "frequency", "temperature", "heat")
            self._put(f"group_{group}", f"{SUBCIRCUIT}_group", nodes, values)

    def _add_contact(self, motor: Motor, library: Library, nodes: list[str]) -> None:
        contact, preload = motor.contact, motor.contact.preload_n
        sway = contact_law.static_sway(contact, motor.modes) / preload
        if sway:  # the crown of the rotor is above the tip at rest
            self.V("sway", "x_0", CROWN, f"DC {{{1e6 * sway:.10g}*preload}}")
            nodes[0] = CROWN
        if motor.mount:  # the carrier follows the mean force; its inertia keeps it at rest at the drive frequency
            self.VCVS("carrier", "fy_carrier", self.gnd, "fy_0", self.gnd, voltage_gain=1)
            carrier = {
                "stiffness": motor.mount.stiffness_n_per_m, "mass": motor.mount.mass_kg,
                "damping": motor.mount.damping_n_s_per_m,
            }  # fmt: skip
            pins = ("fy_carrier", "y_0", self.gnd, *MOUNTED.values())
            self._put("mount", "piezomotor_mount", pins, carrier, ["preload"])
            nodes[nodes.index("y_0")] = MOUNTED["y"]
        values: dict[str, float | str] = {
            "compliance": contact_law.total_compliance(contact), "mu": "{friction}",
            "damping": contact_law.normal_damping(contact),
            "deflection": f"{{{1e6 * contact_law.static_deflection(contact, motor.modes) / preload:.10g}*preload}}",
        }  # fmt: skip
        self._put("contact", library, nodes, values, ["normal_stiffness", "radius", "preload"])

    def _add_check(self, motor: Motor, harmonics: int) -> None:
        """Add the node ``check``: motion at the harmonics left out, over the static penetration and limit of stick."""
        depth = "(1e6*(preload/normal_stiffness)**(2/3))"
        softness = contact_law.limit_ratio(motor.contact) / motor.contact.friction
        softness /= motor.contact.normal_stiffness_n_per_m15 ** (2.0 / 3.0)
        limits = {"x": f"({softness:.10g}*friction*normal_stiffness**(2/3)*{depth})", "y": depth}
        squares = []
        for order in range(harmonics + 1, harmonics + CHECKED_HARMONICS + 1):
            for axis, limit in limits.items():
                for part in ("re", "im"):
                    node = f"left_{axis}_{part}{order}"
                    self.R(f"sum_{node}", node, self.gnd, 1)
                    squares.append(f"(V({node})/{{{limit}}})**2")
        self.raw_spice += f"Bcheck check 0 V=sqrt({'+'.join(squares)}+1e-24)\n"


def default_two_phase(motor: Motor) -> TwoPhaseDrive:
    """Return the recommended drive, or 50 V at the highest resonance where that drive has two tones."""
    drive = default_drive(motor)
    if not isinstance(drive, TwoPhaseDrive):  # two tones have no common amplitude
        drive = TwoPhaseDrive(voltage=50.0, frequency=max(mode.frequency_hz for mode in motor.modes))
    return drive


def averaged_library(motor: Motor, *, name: str = "", thermal: Thermal | None = None) -> str:
    """Return a self-contained library of one averaged motor: header, parts and ``.subckt piezomotor_averaged``.

    Args:
        motor: the motor.
        name: name of the subcircuit; by default ``piezomotor_averaged``. The names of its parts begin with it.
        thermal: drift with the pin ``temperature``; by default the motor does not drift.

    Raises:
        ParameterError: for an invalid name.
    """
    require_averaged(motor)
    circuit = AveragedSubCircuit(motor, thermal=thermal, name=check_name(name) if name else SUBCIRCUIT)
    drive = default_two_phase(motor)
    b = rect(drive.voltage, radians(drive.phase_deg))
    ranges = {item.name: item for item in read_library(_CONTACT).parameters}
    ranges |= {item.name: item for item in read_library("piezomotor_rotor").parameters}
    ranges["friction"] = ranges["mu"]
    lines = [
        "* SPDX-License-Identifier: GPL-3.0-or-later",
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
        "*",
        "*      name              unit       default  min   max   meaning",
        *(
            f"* PAR  {key:<16}  {ranges[key].unit:<9}  {value!r}  {ranges[key].least:g}  {ranges[key].greatest:g}  "
            f"{ranges[key].meaning}"
            for key, value in circuit.settable.items()
        ),
        "*",
        "* NODES inside, to plot: normal friction (N), open slip (share of the period), check (accurate below 0.02)",
        "*",
        "* SOURCE generalised averaging of the motor of Andersen, Helbo, Blanke, 2002; docs/averaged.md",
        f"* OMITS  {'' if thermal else 'temperature, '}{read_library(_CONTACT).omits}",
        f"* REVISION {REVISION}",
        f"* TESTED WITH {read_library(_CONTACT).tested_with}",
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
        "* END USE",
        "*",
        circuit.parts,
        str(circuit).strip(),
    ]
    return "\n".join(lines) + "\n"


def add_averaged_motor(
    circuit: Netlist,
    motor: Motor,
    nodes: Sequence[str | int],
    *,
    instance: str = "motor",
    phases: int = PHASES,
    harmonics: int = HARMONICS,
    thermal: Thermal | None = None,
    side_bands: bool = False,
    inertia: float | None = None,
) -> None:
    """Put an averaged motor and its parts into a PySpice circuit.

    Args:
        circuit: the circuit to add to.
        motor: the motor.
        nodes: the nodes for the pins :data:`PINS`.
        instance: name of the instance (``X`` + this).
        phases: as in :class:`AveragedSubCircuit`.
        harmonics: as in :class:`AveragedSubCircuit`.
        thermal: as in :class:`AveragedSubCircuit`.
        side_bands: as in :class:`AveragedSubCircuit`.
        inertia: of the rotor in kg·m²; by default that of the motor.
    """
    require_averaged(motor)
    definition = AveragedSubCircuit(motor, phases=phases, harmonics=harmonics, thermal=thermal, side_bands=side_bands)
    circuit.raw_spice += definition.parts + "\n"
    circuit.subcircuit(definition)
    circuit.X(instance, SUBCIRCUIT, *nodes, **({} if inertia is None else {"inertia": inertia}))


# Gear damps what the averages leave out, such as the ringing of a mode far from the drive; the trapezoidal
# rule does not. ngspice chooses the step; with trtol = 50 the error of the speed is a few tenths of a per cent.
OPTIONS = {"method": "gear", "trtol": "50", "reltol": "1e-3", "vntol": "1e-6", "abstol": "1e-9"}
_AC_OPTIONS = {"itl1": "200"}  # iterations to the operating point, before ngspice adds conductances
SETTINGS = {  # quantities that may change during a run, with their units
    "frequency": "Hz",
    "voltage_a": "V",
    "voltage_b": "V",
    "phase_deg": "deg",
    "load_torque": "N.m",
}
Course = Sequence[tuple[float, float]]  # times in s and values; linear in between, constant before and after


def averaged_bench(
    motor: Motor,
    settings: Mapping[str, Course],
    *,
    load: Load = FREE,
    phases: int = PHASES,
    harmonics: int = HARMONICS,
    thermal: Thermal | None = None,
    modulated: Mapping[str, float] | None = None,
    side_bands: bool = False,
    title: str = "",
) -> Bench:
    """Drive an averaged motor by ideal amplitudes, its shaft free, loaded or held.

    Args:
        motor: the motor; instance ``Xmotor``. ``v(position)`` is the angle of the shaft in rad.
        settings: :data:`SETTINGS` over time; the phase is that of group B ahead of group A. The sources
            ``Va_re``, ``Va_im``, ``Vb_re``, ``Vb_im`` carry the currents into the pins.
        load: on the shaft; its torque is that of ``settings``.
        phases: as in :class:`AveragedSubCircuit`.
        harmonics: as in :class:`AveragedSubCircuit`.
        thermal: drift of the motor; its losses then heat it through ``Xcooling``.
        modulated: settings that ``.ac`` modulates → by how much.
        side_bands: as in :class:`AveragedSubCircuit`.
        title: title line of the deck.
    """
    circuit = Circuit(title or f"{motor.name}: averaged over the period of the drive")
    sources = {name: _course(course) for name, course in settings.items()}
    sources |= {name: f"{sources[name]} AC {size!r}" for name, size in (modulated or {}).items()}
    nodes = {"frequency": "set_frequency", "voltage_a": "set_a", "voltage_b": "set_b", "phase_deg": "set_phase"}
    for name, node in nodes.items():
        circuit.V(node, node, circuit.gnd, sources[name])
    angle = f"{pi / 180.0!r}*V(set_phase)"
    values = {"a_re": "V(set_a)", "a_im": "0", "b_re": f"V(set_b)*cos({angle})", "b_im": f"V(set_b)*sin({angle})"}
    for node, value in values.items():
        circuit.raw_spice += f"Bdrive_{node} drive_{node} 0 V={value}\n"
        circuit.V(node, f"drive_{node}", node, "DC 0")
    if load.speed is not None:
        circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(load.speed)!r}")
    else:
        circuit.I("load", "shaft", circuit.gnd, sources["load_torque"])
    circuit.raw_spice += "Gposition 0 position shaft 0 1\nCposition position 0 1 ic=0\nRposition position 0 1t\n"
    if thermal is not None:
        add_cooling(circuit, thermal)
    pins = ("a_re", "a_im", "b_re", "b_im", "set_frequency", "shaft", "temperature", "heat")
    add_averaged_motor(
        circuit, motor, pins, phases=phases, harmonics=harmonics, thermal=thermal, side_bands=side_bands,
        inertia=HELD_INERTIA if side_bands and load.speed is not None else None,
    )  # fmt: skip
    start = {"a_re": _at_start(settings, "voltage_a", 0.0), "b_re": _at_start(settings, "voltage_b", 0.0)}
    start["b_im"] = _at_start(settings, "voltage_b", -90.0)
    return Bench(circuit, OPTIONS | _AC_OPTIONS if side_bands else OPTIONS, start)


def _at_start(settings: Mapping[str, Course], name: str, shift_deg: float) -> float:
    """Return a voltage to which a clamped capacitance starts charged; a step onto it would be an infinite current."""
    voltage = settings[name][0][1]
    return voltage if name == "voltage_a" else voltage * cos(radians(settings["phase_deg"][0][1] + shift_deg))


def _course(points: Course) -> str:
    if len(points) == 1:
        return f"DC {float(points[0][1])!r}"
    return "PWL(" + " ".join(f"{float(time)!r} {float(value)!r}" for time, value in points) + ")"


if __name__ == "__main__":
    target = data_path("behavioral") / f"{_CONTACT}.lib"
    target.write_text(contact_text(), encoding="utf-8", newline="\n")
    sys.stdout.write(f"{target}\n")
