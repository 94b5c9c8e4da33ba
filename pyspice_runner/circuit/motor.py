# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor as a PySpice subcircuit, assembled from modes, groups, contact and rotor.

``.subckt piezomotor a b com shaft`` is the interface of the model; ``behavioral/CONVENTIONS.md`` defines nodes and
units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import degrees, pi
from typing import Any

import numpy as np
from numpy import format_float_positional
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Netlist, SubCircuit

from pyspice_runner.circuit.law import (
    PAPER_LAW,
    PINS,
    REACH,
    ContactLaw,
    Law,
    contact_library,
    contact_values,
    is_own,
    laws_of,
    libraries_of,
    touching_law,
    unplotted,
)
from pyspice_runner.circuit.state import (
    CHARGED,
    FEEDBACK,
    PLATES,
    Discretisation,
    Motion,
    State,
    carrier,
    held_piezo,
    motor_states,
    plate_nodes,
    plates_of,
    pushes,
    start_values,
    static_places,
    stems,
    transducer_branches,
    written,
    written_stator,
)
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.contacts import Touching
from pyspice_runner.motor.dielectric import Branch, lossy_capacitance
from pyspice_runner.motor.drive import Drive, default_drive
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor, derived
from pyspice_runner.motor.parameters import Feedback, Mode, Mount, Piezo
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.stator import STEP_WORDS, longest_step
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import (
    PREFIX,
    Library,
    LibraryParameter,
    check_name,
    check_parameters,
    definition_texts,
    part_name,
    read_library,
    slider_words,
)

SUBCIRCUIT = PREFIX
MOUNTED = {"y": "contact_y", "vy": "contact_vy"}  # nodes of the tip at the contact if there is a mount
MOUNTED_X = {"x": "contact_x", "vx": "contact_vx"}  # those along the rotor if the carrier moves along it, too
ALL = "_all"  # ending of the node of a sum over several contacts
PRELOAD_ALL = f"preload{ALL}"  # parameter of a motor with several contacts
_OF_TIP = ("x", "y", "vx", "vy")  # its nodes, which sum what the modes add
CROWN = "crown"  # node of a motor whose preload bends the tip sideways: x of the tip from the rotor's crown, in µm
THERMAL_SUBCIRCUIT = "piezomotor_thermal"
TRANSDUCER = "transducer"
REVISION = 3  # of the exported motor: its pins, its parameters and what they mean
# parameters of the X line that set parameters of the contact; they come first
_FIRST = ("preload", "friction", "normal_stiffness", "compliance", "radius")
SLIDER_TIME = "slider_time"  # parameter of a contact or a stem: half of the time step
_DERIVED = ("deflection", "damping", "span")  # parameters of a contact that the motor sets
AMPLIFIER = LibraryParameter(
    "amplifier", "ohm", 1e7, 1.0, 1e12, "resistance at the feedback electrode; 1e12 leaves it to what is at the pin f"
)
# for a loss tangent of 0: SPICE has no resistor of 0 ohm, and a tiny one costs precision
SMALLEST_LOSS = 1e-5


class Assembly(SubCircuit):
    """A subcircuit that consists of parts from libraries; the names of the parts begin with its name."""

    settable: tuple[LibraryParameter, ...]  # parameters of the X line, with their defaults and ranges

    def __init__(self, name: str, *pins: str, **defaults: str) -> None:
        super().__init__(name, *pins, **defaults)
        self.prefix = name  # first part of the names of the parts
        self._libraries: list[Library] = []
        self._starts: list[State] = []  # states of the parts that the X line sets

    @property
    def parts(self) -> str:
        """The text of the subcircuits of the parts."""
        return "\n".join(self.part_texts.values())

    @cached_property
    def part_texts(self) -> dict[str, str]:
        """The text of the subcircuit of each part, by its name."""
        return definition_texts(*self._libraries, prefix=self.prefix)

    def library(self, about: Sequence[str], notes: Sequence[str]) -> str:
        """Return a self-contained library: its header, with lines above and below the parameters, and all circuits."""
        lines = [
            "* SPDX-License-Identifier: MIT",
            *about,
            "*",
            "*      name              unit       default  min   max   meaning",
            *(
                f"* PAR  {item.name:<16}  {item.unit:<9}  {item.default!r}  {item.least:g}  {item.greatest:g}  "
                f"{item.meaning}"
                for item in self.settable
            ),
            "*",
            *notes,
            "* END USE",
            "*",
            self.parts,
            str(self).strip(),
        ]
        return "\n".join(lines) + "\n"

    def _put(
        self,
        instance: str,
        part: str | Library,
        nodes: Sequence[str | int],
        values: Mapping[str, float | str],
        passed: Sequence[str] = (),
    ) -> None:
        """Add an instance of a part; the ``passed`` parameters are those of the X line of the same name."""
        library = part if isinstance(part, Library) else read_library(part)
        self._libraries.append(library)
        named = replace(library, name=part_name(library.name, self.prefix))
        given = dict(values)
        for state in self._starts:
            if state.part == instance:
                given[state.start] = f"{{{state.parameter}}}"
        for name in passed:
            given[name] = f"{{{name}}}"
        instantiate(self, instance, named, nodes, **given)


class MotorSubCircuit(Assembly):
    """``.subckt piezomotor a b com shaft`` of one motor; a thermal one also has the pins temperature and heat.

    A ``law`` of ``None`` is a free tip, without a force on the rotor. If ``startable``, the X line has the parameters
    :attr:`.State.parameter`, with which a run with ``uic`` starts from a motion; their defaults are preloaded rest,
    where a run starts otherwise. ``thermal`` is the drift with the pin ``temperature`` (1 V = 1 K), and adds a pin
    ``heat`` (1 V = 1 W). With open pins nothing drifts. The last pin may be ``approach`` (1 V = 1 um), by which the
    tip, or the far end of the mount's springs, moves towards the rotor. ``plates`` are the clamped capacitances. With
    ``check`` there is a node of that name (``piezomotor_check``). If not ``plotted``, a brush has no nodes ``slider``
    and ``state``. If ``sensed``, the node f of a feedback electrode is a pin, the fifth. The names of the parts begin
    with ``prefix``, by default the name; motors with the same law may share parts.

    That of a transducer, under its load, is ``.subckt transducer a com``, with a pin b for a second group. Its X line
    has the resistance of the load as parameter ``load``; with ``approach`` that is the voltage of a pin ``tool``,
    1 V = 1 N·s/m.
    """

    def __init__(
        self,
        motor: Motor,
        *,
        law: Law | None = PAPER_LAW,
        discretisation: Discretisation | None = None,
        startable: bool = False,
        thermal: Thermal | None = None,
        approach: bool = False,
        plates: bool = True,
        check: bool = False,
        plotted: bool = True,
        sensed: bool = False,
        name: str = "",
        prefix: str = "",
    ) -> None:
        law, transducer = None if motor.is_transducer else law, motor.is_transducer
        if thermal and transducer:
            raise ParameterError("The drift with temperature is that of motors. Leave it out for a transducer.")
        self._laws, libraries = laws_of(motor, law), libraries_of(motor, law)
        self._suffixes = [""] if transducer else [one.suffix for one in motor.touching]
        starts = [state for state in (motor_states(motor, law) if startable else ()) if state.part]
        warm = ("temperature", "heat") if thermal else ()
        pin_f = (FEEDBACK,) if sensed and motor.feedback else ()
        pins = (*motor.groups, "com", *(() if transducer else ("shaft",)), *pin_f, *warm)
        pins = (*pins, "tool" if transducer else "approach") if approach else pins
        self.settable = _settable(motor, self._laws, libraries, discretisation)
        defaults = {parameter.name: repr(parameter.default) for parameter in self.settable}
        defaults |= {state.parameter: "0" for state in starts}
        plain = TRANSDUCER if transducer else THERMAL_SUBCIRCUIT if thermal else SUBCIRCUIT
        super().__init__(name or plain, *pins, **defaults)
        self.prefix, self._starts = prefix or self.name, starts
        self._motor, self._law, self._discretisation, self._thermal = motor, law, discretisation, thermal
        self._plotted = plotted
        self._common = "common" if check else "com"
        self._mount = carrier(motor, law)
        if plates:
            self._add_groups(warm)
        self._add_modes(warm)
        if motor.feedback:
            self._add_feedback(motor.feedback)
        if law:
            self._add_contacts(libraries, approach=approach)
        else:
            for force in (f"{name}{suffix}" for suffix in self._suffixes for name in ("fx", "fy")):
                self.R(f"free_{force}", force, self.gnd, 1)
            if self._mount:
                values = spring_values(self._mount, discretisation) | {"preload": 0.0}
                self._put("mount", "piezomotor_mount", (self.gnd, "y", "vy", *MOUNTED.values(), "base"), values)
                self._add_tangential(self.gnd, "x")
        if transducer:
            self._add_load("V(tool)" if approach else "{load}")
        else:
            self._put("rotor", "piezomotor_rotor", ("shaft",), {}, ("inertia", "bearing"))
        if not transducer and motor.rotor.bearing_friction_n_m:
            dry = {"torque": motor.rotor.bearing_friction_n_m, "angle": motor.rotor.bearing_presliding_rad}
            self._put("bearing", "piezomotor_bearing", ("shaft", "xbearing.share"), dry)
        if check:
            limits: dict[str, float | str] = {"step": coarsest_step(motor), "outside": outside(self.settable)}
            self._put("check", "piezomotor_check", ("a", "com", self._common, "check"), limits)

    def _add_groups(self, warm: tuple[str, ...]) -> None:
        if self._motor.is_transducer:
            self._add_plain_groups()
            return
        piezo, thermal = held_piezo(self._motor, self._law), self._thermal
        drift = {"capacitance_drift": thermal.capacitance_drift_per_k} if thermal else {}
        part = "piezomotor_group_thermal" if thermal else "piezomotor_group"
        for group, capacitance in zip(GROUPS, piezo.capacitances, strict=True):
            values = {"capacitance": capacitance, "loss": max(piezo.loss_tangent, SMALLEST_LOSS)}
            pin = groups.named("own", group) if piezo.capacitance_ab_f else group
            nodes = (pin, self._common, *plate_nodes(group), *warm)
            self._put(groups.named("group", group), part, nodes, values | drift)
        if piezo.capacitance_ab_f:
            self._add_capacitance_between(piezo, warm)

    def _add_plain_groups(self) -> None:
        """Add the clamped capacitances of a transducer, branch by branch."""
        piezo = self._motor.piezo
        for group in self._motor.groups:
            pin = groups.named("own", group) if piezo.capacitance_ab_f else group
            branches = transducer_branches(self._motor, group)
            plates = plates_of(self._motor, group) or (pin,)
            for number, (node, (ohm, farad)) in enumerate(zip(plates, branches, strict=True)):
                if ohm:
                    self.raw_spice += f"Rplate_{group}{number} {pin} {node} {ohm!r}\n"
                self.raw_spice += f"Cplate_{group}{number} {node} {self._common} {farad!r}\n"
        if piezo.capacitance_ab_f:
            self._add_capacitance_between(piezo, ())

    def _add_capacitance_between(self, piezo: Piezo, warm: tuple[str, ...]) -> None:
        """Add the capacitance between the groups: each group draws a share of the other's current, of opposite sign.

        It has the same dielectric as the groups, so that its own plates would follow theirs.
        """
        for group, other in ("ab", "ba"):
            own, shared = groups.named("own", group), groups.named("shared", group)
            self.V(own, group, own, "DC 0")
            self.CCCS(shared, group, self._common, f"Vown_{other}", current_gain=_shared(piezo, other))
        if warm:
            drawn = (f"{_shared(piezo, b)!r}*I(Vown_{b})*V({a},{self._common})" for a, b in ("ab", "ba"))
            self.B("heat_ab", self.gnd, "heat", i="+".join(drawn))

    def _add_contacts(self, libraries: Sequence[Library], *, approach: bool) -> None:
        """Add the contacts with what is between them and the modes, and the nodes of the total forces of several."""
        motor, law, discretisation = self._motor, self._law, self._discretisation
        several = motor.touching if motor.contacts else ()
        if several:
            self.raw_spice += f".param {PRELOAD_ALL}={{preload}}\n"
            self._add_totals(np.ones(len(several)))
        first_x = "x"
        places = 1e6 * static_places(motor, law, discretisation) / motor.contact.preload_n
        laws = zip(self._laws, libraries, strict=True)
        for one, (own, library), (sway, bent), forward in zip(
            motor.touching, laws, places, motor.stator.forward, strict=True
        ):
            plain = library if self._plotted or not own.row else unplotted(library)
            moved: dict[str, str] = {}
            suffix = one.suffix
            if sway:  # the crown stands beside the tip at rest
                self.V(f"sway{suffix}", f"x{suffix}", f"{CROWN}{suffix}", f"DC {{{rounded(sway)!r}*preload}}")
                moved["x"] = f"{CROWN}{suffix}"
            if suffix:
                along_x = (moved.get("x", f"x{suffix}"), first_x, float(forward))
                moved |= self._add_carried(suffix, along_x, approach=approach)
            else:
                first_x = moved.get("x", "x")
                all_of = ALL if several else ""
                moved |= self._add_tangential(f"fx{all_of}", first_x)
                moved |= self._add_mount(f"fy{all_of}", approach=approach)
            for stem, compliance in stems(motor, law).items():
                if stem in (f"stem{suffix}", f"stem_x{suffix}"):
                    moved |= self._add_stem(stem, compliance, moved, one)
            values = touching_values(motor, own, one, discretisation, library)
            check_parameters(library.name, library.parameters, values)
            flexible = -1e-6 * bent + one.contact.series_compliance_m_per_n * one.share
            expressions = _expressions(plain, values, flexible, own.covered, one.height_m)
            if several:
                expressions["deflection"] = expressions["deflection"].replace("preload", PRELOAD_ALL)
                others = self._laws[0].own if library is not libraries[0] else {}  # of the X line, not of this law
                shared = [item for item in self.settable if item.name not in others]
                kept = {"deflection", *(("mu" if item.name == "friction" else item.name) for item in shared)}
                expressions = {name: text for name, text in expressions.items() if name in kept}
                expressions |= _own_values(shared, {name: item.default for name, item in own.own.items()} | values, one)
            nodes = [moved.get(pin, pin if pin == "shaft" else f"{pin}{suffix}") for pin in PINS]
            self._put(f"contact{suffix}", plain, nodes, {**values, **expressions})

    def _add_totals(self, alike: NDArray[np.float64]) -> None:
        """Add the sums of the voltages of nodes of several contacts, each times a gain; ``alike`` are gains of 1."""
        stator, touching = self._motor.stator, self._motor.touching
        for node, gains in (("fx", stator.forward), ("fy", alike), ("normal", alike), ("friction", stator.lever)):
            for number, (one, gain) in enumerate(zip(touching, gains.tolist(), strict=True)):
                low = f"{node}{ALL}{number + 1}" if number + 1 < len(touching) else self.gnd
                high = f"{node}{ALL}{number or ''}"
                self.VCVS(high, high, low, f"{node}{one.suffix}", self.gnd, voltage_gain=rounded(gain))

    def _add_carried(self, suffix: str, along_x: tuple[str, str, float], *, approach: bool) -> dict[str, str]:
        """Move another contact with the carrier, or the approach, as the first; return the nodes that it then has.

        ``along_x`` is its node x, the node x of the first contact, and the direction of the carrier's x at the contact.
        """
        x, first, forward = along_x
        moved: dict[str, str] = {}
        along: list[tuple[str, str, str, str, float]] = []
        if self._mount and self._mount.tangential:
            along += [("x", x, MOUNTED_X["x"], first, forward), ("vx", f"vx{suffix}", MOUNTED_X["vx"], "vx", forward)]
        if self._mount:
            along += [(name, f"{name}{suffix}", MOUNTED[name], name, 1.0) for name in MOUNTED]
        elif approach:
            along.append(("y", f"y{suffix}", "pressed", "y", 1.0))
        for name, own, carried, base, gain in along:
            moved[name] = f"{carried}{suffix}"
            self.VCVS(moved[name], moved[name], own, carried, base, voltage_gain=gain)
        return moved

    def _add_modes(self, warm: tuple[str, ...]) -> None:
        """Add the modes and the resistors that sum their motion and heat."""
        pressed = self._motor.stator.preload_motion if self._law else ()
        shaking = written_stator(self._motor, self._discretisation, self._mount).carrier_recoil.T.tolist()
        pins = [*self._motor.groups, *[self._common] * (3 - len(self._motor.groups))]
        for index, (mode, (along_y, along_x)) in enumerate(zip(self._motor.modes, shaking, strict=True), start=1):
            part, more = _mode_part(self._motor, mode, self._thermal)
            values: dict[str, float | str] = dict(mode_values(mode, self._discretisation))
            tip = {name: values.pop(name) for name in ("tip_x", "tip_y")}
            values["preload"] = f"{{{rounded(float(pressed[index - 1]))!r}*preload}}" if len(pressed) else 0.0
            base: str | int = "base" if self._mount else self.gnd
            if along_y and along_x:
                base = self._add_slant(index, along_x / along_y)
            elif along_x:
                base = "base_x"
            if along_y or along_x:
                values["recoil"] = along_y or along_x
            inside = [f"xmode{index}.{node}" for node in ("force", "damped", "velocity", "elastic")]
            if self._motor.is_transducer:  # in all digits: what a fit found is no eigenvalue
                values |= {name: repr(values[name]) for name in ("mass", "stiffness", "damping", "coupling_a")}
            self._put(f"mode{index}", part, (*pins, *inside, base, *warm), values | more)
            tip["stiffness"] = values["stiffness"]
            force, _, velocity, elastic = inside
            for suffix, (tip_x, tip_y) in zip(
                self._suffixes, self._motor.stator.contact[:, index - 1].reshape(-1, 2), strict=True
            ):
                ends = (force, velocity, elastic, *(f"{node}{suffix}" for node in ("fx", "fy", "x", "y", "vx", "vy")))
                of_this = {"tip_x": float(tip_x), "tip_y": float(tip_y)} if suffix else {}
                self._put(f"tip{index}{suffix and f'_{suffix}'}", "piezomotor_tip", ends, tip | of_this)
        for node in (*(f"{name}{suffix}" for suffix in self._suffixes for name in _OF_TIP), *warm[1:]):
            self.R(f"sum_{node}", node, self.gnd, 1)
        if warm:
            self.R("open_temperature", "temperature", self.gnd, 1e9)

    def _add_feedback(self, electrode: Feedback) -> None:
        """Add the electrode: its capacitance, the amplifier, transformers to the modes, shares of the groups."""
        self.C(CHARGED, CHARGED, self._common, rounded(electrode.capacitance_f))
        self.R(CHARGED, CHARGED, self._common, f"{{{AMPLIFIER.name}}}")
        self.V(FEEDBACK, FEEDBACK, "sensed_f", "DC 0")
        for group, share, (high, low) in zip(
            GROUPS, electrode.shares, (("sensed_f", "shared_f"), ("shared_f", CHARGED)), strict=True
        ):
            self.VCVS(f"share_{group}", high, low, group, self._common, voltage_gain=rounded(share))
            self.CCCS(f"share_{group}", self._common, group, f"V{FEEDBACK}", current_gain=rounded(share))
        for index, coupling in enumerate(self._motor.stator.sensed.tolist(), start=1):
            name, ratio, voltage = f"{FEEDBACK}{index}", rounded(coupling), (CHARGED, self._common)
            self.VCCS(f"force_{name}", self.gnd, f"xmode{index}.force", *voltage, transconductance=ratio)
            self.VCCS(f"flow_{name}", *voltage, f"xmode{index}.velocity", self.gnd, transconductance=ratio)

    def _add_slant(self, index: int, slope: float) -> str:
        """Return the pin base of a mode that shakes the carrier along y and, ``slope`` times as much, along x."""
        self.V(f"slant{index}", "base", f"slant{index}", "DC 0")
        self.VCVS(f"slant{index}", f"base{index}", f"slant{index}", "base_x", self.gnd, voltage_gain=rounded(slope))
        self.CCCS(f"slant{index}", "base_x", self.gnd, f"Vslant{index}", current_gain=rounded(slope))
        return f"base{index}"

    def _add_tangential(self, force: str | int, x: str) -> dict[str, str]:
        """Add the carrier along the rotor, if it moves; return the nodes to which the contact is connected."""
        along = self._mount and self._mount.tangential
        if not along:
            return {}
        values = spring_values(along, self._discretisation) | {"preload": 0.0}
        self._put("mount_x", "piezomotor_mount", (force, x, "vx", *MOUNTED_X.values(), "base_x"), values)
        return MOUNTED_X

    def _add_stem(self, name: str, compliance: float, nodes: Mapping[str, str], one: Touching) -> dict[str, str]:
        """Add a compliance in series with a contact, which the contact force compresses, or friction along x.

        ``nodes`` are those to which the contact would be connected. Return those that take their place: along x only
        the velocity, because the displacement, of some ten nm, would move the contact on the rotor by 1e-6 of its
        radius, and as a part of the penetration it makes ngspice's iteration diverge where the contact closes.
        """
        axis, force = ("x", "friction") if name.startswith("stem_x") else ("y", "normal")
        values: dict[str, float | str] = {"compliance": compliance}
        passed = [item.name for item in self.settable if item.name == SLIDER_TIME]
        if not passed and self._discretisation:
            values[SLIDER_TIME] = self._discretisation.slider_time
        suffix, force = one.suffix, f"{force}{one.suffix}"
        if axis == "x":
            values["preload"] = 0.0  # at rest there is no friction
        elif one.share < 1.0:
            values["preload"] = f"{{{one.share!r}*{PRELOAD_ALL}}}"
        else:
            passed.append("preload")
        moved = {axis: f"stem_{axis}{suffix}", f"v{axis}": f"stem_v{axis}{suffix}"}
        own = [nodes.get(node, f"{node}{suffix}") for node in (axis, f"v{axis}")]
        for group, per_volt in zip(GROUPS, pushes(self._motor, self._law).get(name, ()), strict=False):
            pushed, turn = groups.named(f"pushed_{axis}", group), rounded(per_volt)
            self.VCVS(pushed, pushed, force, group, self._common, voltage_gain=-turn)
            self.VCCS(pushed, group, self._common, moved[f"v{axis}"], own[1], transconductance=turn)
            force = pushed
        self._put(name, "piezomotor_stem", (*own, force, *moved.values()), values, passed)
        moved.pop("x", None)
        return moved

    def _add_mount(self, force: str, *, approach: bool) -> dict[str, str]:
        """Add carrier and approach, and return the nodes to which the contact is connected instead of its pins.

        ``force`` is the node of the force of all contacts on the stator.
        """
        mount = self._mount
        if approach:
            self.R("open_approach", "approach", self.gnd, 1e9)
        if mount is None:
            if not approach:
                return {}
            self.VCVS("approach", "pressed", "y", "approach", self.gnd, voltage_gain=1)
            return {"y": "pressed"}
        values = spring_values(mount, self._discretisation)
        if approach:  # the far end of the springs moves
            gain = rounded(1e-6 * values["stiffness"])
            self.VCVS("approach", "pressed", force, "approach", self.gnd, voltage_gain=gain)
        nodes = ("pressed" if approach else force, "y", "vy", *MOUNTED.values(), "base")
        self._put("mount", "piezomotor_mount", nodes, values, ["preload"])
        return MOUNTED

    def _add_load(self, resistance: str) -> None:
        """Add the force of the load, a current drawn from a node where 1 A = 1 N, by the velocity that it opposes."""
        motor, load = self._motor, self._motor.tool
        if motor.loads_face:
            force, velocity, (moved, per_m) = "fy", "vy", ("y", 1e-6)
        else:
            place = motor.load_motion.index(1.0) if 1.0 in motor.load_motion else 0
            force, velocity, moved = (f"xmode{place + 1}.{node}" for node in ("force", "velocity", "elastic"))
            per_m = 1.0 / spring_values(motor.modes[place], self._discretisation)["stiffness"]
        self.raw_spice += f"Bload {force} 0 I=V({velocity})*{resistance}\n"
        if load.stiffness_n_per_m:
            self.raw_spice += f"Gspring {force} 0 {moved} 0 {load.stiffness_n_per_m * per_m!r}\n"
        if load.mass_kg:
            self.raw_spice += f"Emass heavy 0 {velocity} 0 1\nVmass heavy mass 0\nCmass mass 0 {load.mass_kg!r}\n"
            self.raw_spice += f"Fmass {force} 0 Vmass 1\n"


def touching_values(
    motor: Motor, law: Law, one: Touching, discretisation: Discretisation | None, library: Library | None = None
) -> dict[str, float]:
    """Return the parameters of an instance of a law at one contact, and those that only other contacts need."""
    places = static_places(motor, law, discretisation)[motor.touching.index(one)]
    bent = float(-places[1]) + one.contact.series_compliance_m_per_n * one.preload_n
    values = contact_values(
        law, one.contact, radius=one.radius_m, preload=one.contact.preload_n, deflection=bent + one.height_m,
        slider_time=discretisation.slider_time if discretisation else None,
    )  # fmt: skip
    beside = {"flat": 0.0, "exponent": one.contact.exponent}  # of a new one beside worn ones; Hertz's beside linings
    declared = library.defaults if library else {}
    return values | {name: value for name, value in beside.items() if name in declared and name not in values}


def _own_values(shared: Sequence[LibraryParameter], values: Mapping[str, float], one: Touching) -> dict[str, str]:
    """Return the parameters of one of several contacts that differ from the X line, as expressions.

    Its preload is a share of :data:`PRELOAD_ALL`: on a line that sets ``preload``, ngspice takes the new value for
    that name in the expressions behind it.
    """
    found = {"preload": f"{{{one.share!r}*{PRELOAD_ALL}}}" if one.share else repr(one.contact.preload_n)}
    for item in shared:
        name = "mu" if item.name == "friction" else item.name
        value = values.get(name, item.default)
        ratio = rounded(value / item.default) if item.default else float(not value)
        if ratio != 1.0 and name not in found:
            found[name] = f"{{{ratio!r}*{item.name}}}" if item.default else repr(value)
    return found


def _expressions(
    law: Library, values: Mapping[str, float], flexibility: float, covered: float, height_m: float = 0.0
) -> dict[str, str]:
    """Return a law's parameters that depend on the X line, as expressions; ``flexibility`` of the stator in m/N.

    ``covered`` is that of :class:`.Law`, ``height_m`` that by which a tip stands out.
    """
    written = {item.name: f"{{{_outer(item.name)}}}" for item in law.parameters if item.name not in _DERIVED}
    above = f"{rounded(1e6 * height_m):+}" if height_m else ""
    written["deflection"] = f"{{{rounded(1e6 * flexibility)!r}*preload{above}}}"
    if "span" in values:
        part = f"{covered!r}*" if covered < 1.0 else ""
        deep = f"{1e6 * REACH!r}*(preload/normal_stiffness)**(2/3)"
        # of a worn tip as far as its contact reaches, see :func:`.contact_values`
        deepest = f"0.5*(sqrt(flat**2+4*({deep})**2)+flat)" if "flat" in values else deep
        written["span"] = f"{{{part}{deepest}}}"
    return written


def _outer(name: str) -> str:
    """Return the name of a parameter of the contact on the X line of a motor; a law's own ones keep their names."""
    return "friction" if name == "mu" else name


def _settable(
    motor: Motor, laws: Sequence[Law], libraries: Sequence[Library], discretisation: Discretisation | None
) -> tuple[LibraryParameter, ...]:
    """Return the parameters of the X line: those of contact, rotor and electrode; of a transducer its load."""
    if motor.is_transducer:
        what = f"resistance of the load, against {'the face' if motor.loads_face else 'a mode'}"
        return (LibraryParameter("load", "N.s/m", rounded(motor.load_resistance_n_s_per_m), 0.0, 1e9, what),)
    values = {"inertia": motor.rotor.inertia_kg_m2, "bearing": motor.rotor.bearing_damping_n_m_s}
    items = {item.name: item for item in read_library("piezomotor_rotor").parameters if item.name in values}
    if laws:
        items = {_outer(item.name): item for item in libraries[0].parameters if item.name not in _DERIVED} | items
        values |= touching_values(motor, laws[0], motor.touching[0], discretisation)
        values |= {"preload": motor.contact.preload_n, "friction": values["mu"]}
    found = [
        replace(items[name], name=name, default=rounded(values.get(name, items[name].default)))
        for name in dict.fromkeys([*_FIRST, *items])
        if name in items
    ]
    return (*found, *([replace(AMPLIFIER, default=motor.feedback.resistance_ohm)] if motor.feedback else []))


def outside(settable: Sequence[LibraryParameter]) -> str:
    """Return an expression that is 1 if a parameter of the X line is out of its range, else 0."""
    distances = (f"max(0,max({item.least:g}-{item.name},{item.name}-{item.greatest:g}))" for item in settable)
    return f"{{min(1,1e30*({'+'.join(distances)}))}}"


def spring_values(part: Mode | Mount, discretisation: Discretisation | None = None) -> dict[str, float]:
    """Return mass, damping and stiffness of a mode or a carrier as parameters of its subcircuit."""
    mass, stiffness = written(part, discretisation)
    return {"mass": mass, "damping": part.damping_n_s_per_m, "stiffness": stiffness}


def mode_values(mode: Mode, discretisation: Discretisation | None = None) -> dict[str, float]:
    """Return a linear mode as parameters of its subcircuit."""
    couplings = {"coupling_a": mode.coupling_a_n_per_v, "coupling_b": mode.coupling_b_n_per_v}
    return {**spring_values(mode, discretisation), **couplings, "tip_x": mode.tip_x, "tip_y": mode.tip_y}


def rounded(value: float) -> float:
    """Round to ten digits, because the last digits of an eigenvalue depend on the computer."""
    return float(f"{value:.10g}")


def require_linear(motor: Motor, what: str) -> None:
    """Raise a ParameterError if stiffness or damping of a mode depends on the amplitude. ``what`` is the subject."""
    for mode in motor.modes:
        if not mode.linear:
            raise ParameterError(
                f"modes.{mode.name} has softening_per_m2 = {mode.softening_per_m2:g} 1/m² and damping_growth_per_m2 = "
                f"{mode.damping_growth_per_m2:g} 1/m². {what} takes linear modes only: set both to 0."
            )


def require_no_feedback(motor: Motor, what: str) -> None:
    """Raise a ParameterError for a motor with a feedback electrode. ``what`` is the subject."""
    if motor.feedback:
        raise ParameterError(
            f"{what} has no feedback electrode. Leave it out (--set feedback=none), or take the full motor, whose .lib "
            "has it."
        )


def contact_nodes(motor: Motor, law: Law | None = None, suffix: str = "") -> dict[str, str]:
    """Return the nodes of the tip at the contact: x (from the crown), y, vx and vy, with a law as voltages move it.

    ``suffix`` is that of the nodes of one of several contacts.
    """
    place = [one.suffix for one in motor.touching].index(suffix)
    nodes = {name: name for name in _OF_TIP}
    if static_places(motor, PAPER_LAW, None)[place, 0]:
        nodes["x"] = CROWN
    nodes |= (MOUNTED if motor.mount else {}) | (MOUNTED_X if motor.mount and motor.mount.tangential else {})
    moved = {"stem": {"vy": "stem_vy"}, "stem_x": {"vx": "stem_vx"}}
    nodes |= {pin: node for name in pushes(motor, law) for pin, node in moved[name].items()}
    return {name: f"{node}{suffix}" for name, node in nodes.items()}


def force_vectors(motor: Motor) -> tuple[str, str]:
    """Return the vectors of normal and friction force of ``Xmotor``, of several contacts those of the sums."""
    all_of = ALL if motor.contacts else ""
    return f"v(xmotor.normal{all_of})", f"v(xmotor.friction{all_of})"


def coarsest_step(motor: Motor) -> float:
    """Return the coarsest time step in s of an exported motor, for its modes, free and pressed; a carrier is slow."""
    frequency, quality = motor.pressed_stator.damped()
    fast = frequency > 0.5 * min(mode.frequency_hz for mode in motor.modes)
    return longest_step(
        [*frequency[fast], *(mode.frequency_hz for mode in motor.modes)],
        [*quality[fast], *(mode.quality_factor for mode in motor.modes)],
    )


def add_motor(
    circuit: Netlist,
    motor: Motor,
    nodes: Sequence[str | int],
    *,
    instance: str = "motor",
    law: Law | None = PAPER_LAW,
    discretisation: Discretisation | None = None,
    start: Motion | None = None,
    settings: Mapping[str, float | str] | None = None,
    **written: Any,
) -> None:
    """Add a motor to a PySpice circuit. All copies of one motor share one definition.

    ``nodes`` connect the pins a, b, com, shaft, then f, temperature, heat, approach if the motor has them. A run
    with ``uic`` begins with the motion ``start``, by default preloaded rest; the initial voltages of the plates and the
    cells of a brush are not set here. ``settings`` are parameters of the X line, such as ``{"preload": 8}``; a text
    such as ``"{preload}"`` is an expression. ``written`` are further arguments of :class:`MotorSubCircuit`. A run of
    the package is without the node ``check``: parameters, step and drive are checked before it; what only serves a plot
    of a brush is computed after it, if not ``plotted``. A second, different motor in one circuit needs another name.
    Raise ParameterError if the circuit already has a different motor of that name, or for a setting that the motor does
    not have or whose value is out of range.
    """
    own = any(is_own(one.name) for one in laws_of(motor, law))  # a user's own file may change
    write: Any = MotorSubCircuit if own else _definition
    definition = write(motor, law=law, discretisation=discretisation, startable=start is not None, **written)
    name = definition.name
    present = [str(subcircuit) for subcircuit in circuit.subcircuits if subcircuit.name == name]
    if not present:
        circuit.raw_spice += definition.parts + "\n"
        circuit.subcircuit(definition)
    elif present[0] != str(definition):
        raise ParameterError(
            f"The circuit already has a different motor called {name}, so {motor.name} cannot be its {instance!r}. "
            "Give the second motor another name, or the same values."
        )
    if settings:
        check_parameters(name, definition.settable, settings)
    starts: dict[str, float] = {}
    if start:
        starts, _ = start_values(motor_states(motor, law), start, discretisation)
    circuit.X(instance, name, *nodes, **(settings or {}), **starts)


@derived
def _definition(motor: Motor, /, **settings: Any) -> MotorSubCircuit:
    """Return the subcircuit of a motor; many runs of one motor share it."""
    return MotorSubCircuit(motor, **settings)


def _transducer_library(motor: Motor, **settings: Any) -> str:
    """Return the library of a transducer."""
    circuit, step = MotorSubCircuit(motor, check=True, **settings), coarsest_step(motor)
    about = [
        f"* {circuit.name}: transducer {motor.name}, under its load",
        "*",
        *(f"* PIN  {pin:<5}  inout  V      electrical pin" for pin in (*motor.groups, "com")),
    ]
    notes = [
        *(f"* MODE {mode.name}: {mode.frequency_hz:.6g} Hz, Q {mode.quality_factor:.4g} idle" for mode in motor.modes),
        "* NODES inside, to plot: vy (m/s) and y (um) of the face; check is 1 for a step longer than STEP, else 0",
        "* SOURCE equivalent circuit after Butterworth and Van Dyke, IEEE 176-1987",
        "* OMITS  temperature, nonlinearity, a loss tangent beyond 100 times its frequency to both sides",
        f"* REVISION {REVISION}",
        f"* STEP   at most {step:.2g} s; {STEP_WORDS}",
        "* TESTED WITH ngspice 39 and 46",
        "*",
        "* USE    the first line of a deck is its title; then:",
        *(f"*   {line}" for line in source_lines(default_drive(motor))),
        f"*   Xpiezo {' '.join(motor.groups)} 0 {circuit.name}",
        f"*   .tran {step:.2g} {20.0 / motor.modes[0].frequency_hz:.2g} 0 {step:.2g} uic",
        "*   .measure tran current_a MAX i(Va)",
    ]
    return circuit.library(about, notes)


@checked
def motor_library(
    motor: Motor,
    *,
    contact: ContactLaw | None = PAPER_LAW,
    name: str = "",
    thermal: Thermal | None = None,
) -> str:
    """Return a self-contained library of one motor: header, parts and ``.subckt piezomotor a b com shaft``.

    The names of the parts begin with that of the subcircuit, so that two exports with different names fit in one
    circuit. With ``thermal`` it is ``piezomotor_thermal``, with the pins ``temperature`` and ``heat``.

    Raises:
        ParameterError: for an invalid law or name.
    """
    if motor.is_transducer:
        return _transducer_library(motor, name=check_name(name) if name else "", thermal=thermal)
    law = touching_law(contact, "The library contains the rotor.", motor.law)
    given = check_name(name) if name else ""
    circuit = MotorSubCircuit(motor, law=law, thermal=thermal, check=True, sensed=True, name=given)
    name = circuit.name
    step = coarsest_step(motor)
    pins = [("shaft", "rad/s", "rotor speed; a current fed into the pin is a driving torque")]
    if motor.feedback:
        pins.append((FEEDBACK, "V", "feedback electrode, a third group; it may stay open"))
    if thermal:
        pins += [
            ("temperature", "K", "temperature above that at which the parameters hold; if open, nothing drifts"),
            ("heat", "W", "heat of the losses, 1 V = 1 W; it may stay open"),
        ]
    library = contact_library(law, motor.contact)
    about = [
        f"* {name}: standing-wave piezomotor {motor.name}, with Hertz contact, friction ({law.name}) and rotor",
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
        *(f"* PIN  {pin:<5}  inout  {unit:<5}  {meaning}" for pin, unit, meaning in pins),
    ]
    notes = [
        *(
            f"* MODE {mode.name}: {mode.frequency_hz:.6g} Hz, Q {mode.quality_factor:.4g}, "
            f"coupling A {mode.coupling_a_n_per_v:.4g} N/V, B {mode.coupling_b_n_per_v:.4g} N/V"
            for mode in motor.modes
        ),
        _mount_line(motor),
        *_clamped_lines(motor),
        *([f"* FEEDBACK {motor.feedback.model_dump_json()}"] if motor.feedback else []),
        "* NODES inside, to plot: x y slider (um), vx vy (m/s), normal friction (N), state (0 open, 1 stick, 2 slip)",
        *_contact_lines(motor, law),
        "* CHECK  the node check is 0, or 1 for a parameter out of its range, a step longer than STEP and, after",
        f"*        {550 * step:.2g} s of .tran, pins that carry no alternating drive, as when com floats. If the drive",
        "*        begins later, measure check from then on. It does not see a misspelt parameter, ignored by ngspice:",
        "*        `listing param` in .control prints the values that the motor has. Nor does it see pins in a wrong",
        "*        order if com carries an alternating current, or the method and tolerances of the simulator.",
        "*",
        '* SOURCE Andersen, Helbo, Blanke, "Modelling and Experiments of a Standing Wave Piezomotor", 2002, corrected',
        f"* OMITS  {'' if thermal else 'temperature, '}piezoelectric hysteresis, {library.omits}",
        f"* REVISION {REVISION}",
        f"* STEP   at most {step:.2g} s; {STEP_WORDS}",
        f"* TESTED WITH {library.tested_with}",
        "*",
        "* USE    the first line of a deck is its title; then:",
        *(f"*   {line}" for line in source_lines(default_drive(motor))),
        f"*   Xmotor a b 0 shaft {f'{FEEDBACK} ' if motor.feedback else ''}{'0 heat ' if thermal else ''}{name}",
        "*   .tran 100n 500u 0 100n uic",
        "*   .measure tran speed_rad_s FIND v(shaft) AT=499u",
        "*   .measure tran check MAX v(xmotor.check)",
    ]
    return with_header(motor, circuit.library(about, notes))


def with_header(motor: Motor, text: str) -> str:
    """Return a library whose header is that of a slider, if the motor has one."""
    head, subcircuits, rest = text.partition("\n.subckt")
    return f"{slider_words(head)}{subcircuits}{rest}" if motor.slider else text


def editable_parameters(motor: Motor) -> str:
    """Return the parameters of the X line that a motor has with each contact law, or a transducer, with their values.

    The values have no exponent: KiCad would round them to six digits.
    """
    return " ".join(
        f"{item.name}={format_float_positional(item.default, trim='-')}"
        for item in _definition(motor).settable
        if item.name in (*_FIRST, "inertia", "bearing", "load")
    )


def source_lines(drive: Drive) -> list[str]:
    """Return ideal sources of a drive at the nodes ``a`` and ``b``: one for each tone, in series."""
    lines = []
    for group, tones in zip(GROUPS, drive.tones, strict=False):
        nodes = [group, *(f"{group}{number}" for number in range(2, len(tones) + 1)), "0"]
        for number, tone in enumerate(tones):
            source = f"V{group}{number + 1 if number else ''} {nodes[number]} {nodes[number + 1]}"
            lines.append(f"{source} SIN(0 {tone.amplitude:g} {tone.frequency:.6g} 0 0 {degrees(tone.phase):.6g})")
    return lines


def _mount_line(motor: Motor) -> str:
    if motor.mount is None:
        return "* MOUNT none: the stator is held at a fixed distance from the rotor"
    mount = motor.mount
    return (
        f"* MOUNT {mount.mass_kg:g} kg on springs of {mount.stiffness_n_per_m:g} N/m, "
        f"damping {mount.damping_n_s_per_m:g} N.s/m: the preload is a force"
        + (f"; along the rotor {mount.tangential_stiffness_n_per_m:g} N/m" if mount.tangential else "")
    )


def _contact_lines(motor: Motor, law: Law) -> list[str]:
    """Return what distinguishes the contacts of a motor with several."""
    if not motor.contacts:
        return []
    return [
        f"* CONTACTS {len(motor.touching)}: normal{ALL} and friction{ALL} (N) are sums. The nodes of the first have",
        "*        the names above, those of the others end in their number; normal_stiffness, compliance and radius",
        "*        are those of the first, in proportion to which those of the others change.",
        *(
            f"* CONTACT {one.suffix or 1} {one.name}: {100.0 * one.share:.4g} % of the preload"
            + (f", {one.multiplicity} equal points" if one.multiplicity > 1 else "")
            + (f", friction ({own.name})" if one.law else "")
            for one, own in zip(motor.touching, laws_of(motor, law), strict=True)
        ),
    ]


def _clamped_lines(motor: Motor) -> list[str]:
    """Return the clamped capacitances at the last mode, and the copies that a tracker subtracts (:func:`.sensing`)."""
    frequency = motor.modes[-1].frequency_hz
    (a, between), (_, b) = 1e9 * dielectric_matrix(motor, frequency).imag / (2.0 * pi * frequency)
    lines = [f"* CLAMPED at {frequency:.6g} Hz: C of A {a:.4g} nF, of B {b:.4g} nF, C_AB between {-between:.4g} nF"]
    if not between:
        return lines
    return [
        *lines,
        "*        The copy whose current a tracker subtracts (tracker_sense) is not C, but for modes driven",
        f"*        in antiphase: C + C_AB = {a - between:.4g} nF (A), {b - between:.4g} nF (B)",
        f"*        in phase:     C - C_AB = {a + between:.4g} nF (A), {b + between:.4g} nF (B)",
    ]


def _mode_part(motor: Motor, mode: Mode, thermal: Thermal | None) -> tuple[str, dict[str, float]]:
    """Return the library of a mode, and the parameters that only this one has."""
    if thermal:
        require_linear(motor, "A motor that its losses heat")
        drift = {"frequency_drift": thermal.frequency_drift_per_k, "coupling_drift": thermal.coupling_drift_per_k}
        return "piezomotor_mode_thermal", drift
    if mode.linear:
        return "piezomotor_mode", {}
    return "piezomotor_mode_soft", {"softening": mode.softening_per_m2, "growth": mode.damping_growth_per_m2}


@derived
def dielectric_branches(motor: Motor, group: str, law: Law | None = None) -> tuple[Branch, ...]:
    """Return the branches of the clamped capacitance of group ``"a"`` or ``"b"``, for a motor those of PLATES.

    With a law they are those of the netlist (:func:`.held_piezo`).
    """
    if motor.is_transducer:
        return transducer_branches(motor, group)
    own = held_piezo(motor, law).capacitance_f(group)
    return lossy_capacitance(own, max(motor.piezo.loss_tangent, SMALLEST_LOSS), branches=len(PLATES))


def dielectric_admittance(motor: Motor, group: str, frequency_hz: float) -> complex:
    """Return the admittance in S of the clamped capacitance of a group in the netlist, the other group shorted."""
    s, found = 2j * pi * frequency_hz, 0j
    for resistance, capacitance in dielectric_branches(motor, group):
        found += s * capacitance / (1.0 + s * resistance * capacitance)
    return found


def dielectric_matrix(motor: Motor, frequency_hz: float) -> NDArray[np.complex128]:
    """Return the admittance matrix in S of the clamped capacitances in the netlist."""
    piezo, own = motor.piezo, [dielectric_admittance(motor, group, frequency_hz) for group in motor.groups]
    between = -own[0] * piezo.capacitance_ab_f / piezo.capacitance_a_f
    return np.where(np.eye(len(own)), np.diag(own), between)


def _shared(piezo: Piezo, group: str) -> float:
    """Return the share of the dielectric current of a group that the other group draws."""
    return rounded(-piezo.capacitance_ab_f / piezo.capacitance_f(group))


def instantiate(
    parent: Netlist,
    instance: str,
    part: str | Library,
    nodes: Sequence[str | int],
    **values: float | str,
) -> None:
    """Add an instance of a library, given by its name or itself, and check its parameters against the header.

    A text such as ``"{preload}"`` is an expression. Raise ParameterError for a parameter that the library does not have
    or a value out of its range.
    """
    library = part if isinstance(part, Library) else read_library(part)
    check_parameters(library.name, library.parameters, values)
    texts = {name: value if isinstance(value, str) else rounded(value) for name, value in values.items()}
    parent.X(instance, library.name, *nodes, **texts)
