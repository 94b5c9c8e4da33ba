# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor in C: its sources, its variables, and their values for a motor.

The C files in ``behavioral/`` are written by hand, but for the contact at one phase, and the circuits in front of the
motor, which this module writes from the libraries that ngspice runs. ``piezomotor_averaged.h`` declares every variable
once, with unit, range and meaning. This module reads these lines.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from textwrap import wrap
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.library import (
    ALL_TERMS,
    HARMONICS,
    PHASES,
    Terms,
    averaged_phase,
    default_two_phase,
)
from pyspice_runner.circuit.law import OTHER_POWER
from pyspice_runner.circuit.motor import mode_values, rounded, spring_values
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.contacts import Touching
from pyspice_runner.motor.drive import UNCOUPLED, ShaftLoad
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import HERTZ
from pyspice_runner.motor.stator import carriers
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.expressions import HELPERS, Equations, equations, translated
from pyspice_runner.spice.library import LibraryParameter, data_path, read_library, slider_words
from pyspice_runner.units import linear_unit

CORE, HEADER, START, PHASE = (
    "piezomotor_averaged.c", "piezomotor_averaged.h", "piezomotor_start.h", "piezomotor_phase.h"
)  # fmt: skip
SESSION = "piezomotor_session.c"
# in the order of struct values
_GROUPS = (
    "INPUTS", "TUNABLE", "LOOP_INPUTS", "OUTPUTS", "LOOP_OUTPUTS", "NETWORK_OUTPUTS", "CONTACT_PARAMETERS",
    "PARAMETERS", "MOUNT_PARAMETERS", "MOUNT_X_PARAMETERS", "MODE_PARAMETERS", "SEAT_PARAMETERS", "TIP_PARAMETERS",
)  # fmt: skip
MOUNTS = ("mount_", "mount_x_")  # prefixes of the springs of the carrier, along y and x
# the first states, in the order of the header's enumeration; charges are integrals of the groups' complex currents
_STATES = (
    "speed", "position", "temperature", "load_speed", "load_position", "bearing", "slider", "carrier",
    "carrier_velocity", "carrier_x", "carrier_x_velocity", "charge_1", "charge_2", "charge_3", "charge_4",
)  # fmt: skip
OF_SPRINGS = ("mass", "damping", "stiffness")
Parts = Sequence[tuple[str, Mapping[str, str]]]  # names of libraries, each with the nodes to which its pins go
NETWORK: Parts = (("driver_averaged", {}),)
TRACKER: Parts = (("tracker_averaged", {}), ("tracker_filter", {"in": "out"}))


class Size(NamedTuple):
    """What the C code of a motor is compiled for, besides its terms."""

    modes: int
    moving: int  # directions in which the carrier moves
    contacts: int = 1

    @classmethod
    def of(cls, motor: Motor) -> Size:
        """Return the size of a motor."""
        return cls(len(motor.modes), len(carriers(motor.mount)), len(motor.touching))

    def lines(self, terms: Terms) -> list[str]:
        """Return the size in C."""
        mounts = [f"#define MOUNTED {int(self.moving > 0)}", f"#define MOUNTED_X {int(self.moving > 1)}"]
        more = [f"#define CONTACTS {self.contacts}"] if self.contacts > 1 else []
        more += [f"#define EXPONENT {terms.exponent!r}"] if terms.exponent != HERTZ else []
        return [f"#define MODES {self.modes}", *mounts, *more]


class Front(NamedTuple):
    """What is in front of a motor."""

    tracked: bool = False  # a phase-locked loop, which sets the frequency
    driven: bool = False  # a network between stage and group

    def has(self, group: str) -> bool:
        """Return whether a group of variables is there."""
        return {"LOOP": self.tracked, "NETWORK": self.driven}.get(group.partition("_")[0], True)


BARE = Front()


@dataclass(frozen=True)
class Variable:
    """One variable."""

    name: str  # name, such as ``speed`` or ``mode[1].mass``
    unit: str  # unit; ``1`` for none
    least: str  # smallest value, empty for an output
    greatest: str  # largest value
    meaning: str  # one line
    causality: str  # ``input``, ``output``, ``parameter``, or ``tunable`` for a parameter that may change
    reference: int  # place in the C structure
    start: float | None  # value before a run; ``None`` for an output


def header(terms: Terms) -> str:
    """Return ``piezomotor_averaged.h`` with the units and ranges of the contact's exponent."""
    text = (data_path("behavioral") / HEADER).read_text(encoding="utf-8")
    for name, (unit, *ends) in OTHER_POWER.items() if terms.exponent != HERTZ else ():
        own = f'ENTRY({name}, "{unit.format(f"{terms.exponent:g}")}", {", ".join(ends)},'
        text = re.sub(rf'ENTRY\({name}, "\S+", \S+, \S+,', own, text).replace("the Hertz law", "the power law")
    return text


@cache
def _declared(terms: Terms) -> Mapping[str, tuple[tuple[str, str, str, str, str], ...]]:
    """Return the lines of the header: group → name, unit, smallest and largest value, meaning."""
    text, found = header(terms), {}
    for group in _GROUPS:
        block = re.search(rf"#define {group}\(ENTRY\)(.*?[^\\])\n", text, re.S)
        assert block is not None, group
        found[group] = tuple(re.findall(r'ENTRY\((\w+), "(\S+)", (?:(\S+), (\S+), )?"([^"]+)"\)', block[1]))
    return found


def variables(
    motor: Motor, thermal: Thermal | None = None, load: ShaftLoad = UNCOUPLED, front: Front = BARE
) -> list[Variable]:
    """Return the variables of a motor and the load on its shaft, in the order of the C structure.

    Without ``thermal`` nothing drifts, and the motor's own heat capacity holds.
    """
    values, declared = _values(motor, thermal, load), _declared(Terms.of(motor))
    modes = [(f"mode[{number}].", f", mode {mode.name}") for number, mode in enumerate(motor.modes, start=1)]
    contacts = [(prefix, f", contact {one.name}" if prefix else "") for prefix, one in _contacts(motor)]
    repeated = {  # groups that a motor has several times: prefix of the name, end of the meaning
        "MODE_PARAMETERS": modes, "CONTACT_PARAMETERS": contacts, "SEAT_PARAMETERS": contacts if motor.contacts else [],
        "TIP_PARAMETERS": [(one + mode, of + by) for one, of in contacts[1:] for mode, by in modes],
    }  # fmt: skip
    found: list[Variable] = []
    for group in _GROUPS:
        if not front.has(group):
            continue
        for prefix, of in repeated.get(group, [("", "")]):
            for name, unit, least, greatest, meaning in declared[group]:
                full = prefix + name
                causality = {"INPUTS": "input", "TUNABLE": "tunable"}.get(group.removeprefix("LOOP_"), "parameter")
                causality = "output" if group.endswith("OUTPUTS") else causality
                start = None if causality == "output" else values[full]
                text = meaning + of
                if motor.slider:
                    unit, text = linear_unit(unit), slider_words(text)
                found.append(Variable(full, unit, least, greatest, text, causality, len(found), start))
    return found


def _contacts(motor: Motor) -> list[tuple[str, Touching]]:
    """Return the contacts of a motor with the prefixes of their values; one contact has none."""
    return [
        (f"contact[{number}]." if motor.contacts else "", one) for number, one in enumerate(motor.touching, start=1)
    ]


def _contact_values(motor: Motor) -> dict[str, float]:
    """Return the values of the contacts."""
    motion, values = motor.stator.on_carrier(motor.mount).contact.tolist(), dict[str, float]()
    for place, (prefix, one) in enumerate(_contacts(motor)):
        contact = one.contact
        found = {
            "normal_stiffness": contact.normal_stiffness_n_per_m15, "compliance": contact_law.total_compliance(contact),
            "normal_damping": contact_law.normal_damping(contact),
            "series_compliance": contact.series_compliance_m_per_n,
            "series_compliance_x": contact.tangential_series_compliance_m_per_n, "radius": one.radius_m,
            "sliding_ratio": contact.sliding_ratio, "stribeck_velocity": contact.stribeck_velocity_m_s,
            "share": one.share, "height": 0.0 - one.gap_m, "direction": float(one.direction),
            "friction_ratio": contact.friction / motor.contact.friction,
        }  # fmt: skip
        for axis, row in zip("xy", motion[2 * place :], strict=False):
            found |= {f"mode[{mode}].tip_{axis}": moved for mode, moved in enumerate(row, start=1)}
        values |= {f"{prefix}{name}": value for name, value in found.items()}
    return values


def _values(motor: Motor, thermal: Thermal | None, load: ShaftLoad) -> dict[str, float]:
    """Return the start values of inputs and parameters; the inputs are those of the recommended drive."""
    drive, contact, of_contacts = default_two_phase(motor), motor.contact, _contact_values(motor)
    motor = motor.on_carrier()
    body = thermal or Thermal.of(motor)
    values = {
        "amplitude_a": drive.voltage, "amplitude_b": drive.voltage_b, "phase": drive.phase_deg,
        "frequency": drive.frequency, "load_torque": 0.0, "ambient_temperature": body.ambient_k,
        "target": 0.0, "preload": contact.preload_n, "friction": contact.friction,
        "inertia": motor.rotor.inertia_kg_m2, "bearing": motor.rotor.bearing_damping_n_m_s,
        "bearing_friction": motor.rotor.bearing_friction_n_m, "bearing_presliding": motor.rotor.bearing_presliding_rad,
        "load_inertia": load.inertia_kg_m2, "load_damping": load.damping_n_m_s, "load_spring": load.spring_n_m_per_rad,
        "load_gravity": load.gravity_n_m, "load_angle": load.gravity_angle_deg,
        "coupling_stiffness": load.coupling_stiffness_n_m_per_rad, "coupling_damping": load.coupling_damping_n_m_s,
        "backlash": load.backlash_rad,
        **{groups.named("capacitance", one): own for one, own in zip(GROUPS, motor.piezo.capacitances, strict=True)},
        **{
            f"motion_{axis}_{group}": moved
            for axis, row in zip("xy", motor.stator.residual_per_volt.tolist(), strict=False)
            for group, moved in zip(GROUPS, row, strict=True)
        },
        "capacitance_ab": motor.piezo.capacitance_ab_f, "loss": motor.piezo.loss_tangent,
        "frequency_drift": thermal.frequency_drift_per_k if thermal else 0.0,
        "coupling_drift": thermal.coupling_drift_per_k if thermal else 0.0,
        "capacitance_drift": thermal.capacitance_drift_per_k if thermal else 0.0,
        "heat_capacity": body.heat_capacity_j_per_k, "thermal_resistance": body.thermal_resistance_k_per_w,
    }  # fmt: skip
    held = dict.fromkeys(OF_SPRINGS, 1.0)
    for prefix, along in zip(MOUNTS, (*carriers(motor.mount), None, None), strict=False):
        values |= {f"{prefix}{name}": value for name, value in (spring_values(along) if along else held).items()}
    for number, mode in enumerate(motor.modes, start=1):
        values |= {f"mode[{number}].{name}": value for name, value in mode_values(mode).items()}
    values |= of_contacts
    return {name: rounded(value) for name, value in values.items()}


def start_header(motor: Motor, known: list[Variable]) -> str:
    """Return ``piezomotor_start.h``: the size of a motor, and its values."""
    rows = [f"    {0.0 if item.start is None else item.start!r}, /* {item.name} */ \\" for item in known]
    lines = [
        "/* SPDX-License-Identifier: MIT",
        " *",
        f" * The values of the motor {motor.name}, written by its export, in the order of struct values.",
        " */",
        *Size.of(motor).lines(Terms.of(motor)),
        "#define START { \\",
        *rows,
        "}",
    ]
    return "\n".join(lines) + "\n"


def state_names(size: Size, harmonics: int = HARMONICS, *, tracked: bool = False) -> list[str]:
    """Return the names of the states of an averaged motor, in their order; the states of a network follow them.

    A loop has the two voltages of its filter, and a restart.
    """
    modes, moving, behind = size.modes, size.moving, _STATES.index("slider") + 1
    sliders = [f"slider{number}" for number in range(2, size.contacts + 1)]
    bent = [f"deflection_{number}" for number in range(1, modes + 1)] if modes > 1 else ["deflection"]
    moved = [*(f"mode{number}" for number in range(1, modes + 1)), *("carrier", "carrier_x")[:moving]]
    orders = range(1, harmonics + 1)
    vibrating = [f"{name}_harmonic{order}_{part}" for name in moved for order in orders for part in ("re", "im")]
    first = [*_STATES[:behind], *sliders, *_STATES[behind:]]
    return [*first, *bent, *vibrating, *(("control", "filter", "timer", "restart") if tracked else ())]


def session_texts(
    size: Size, terms: Terms, front: Front = BARE, *, phases: int = PHASES, harmonics: int = HARMONICS
) -> dict[str, str]:
    """Return the C texts of a library that runs averaged motors of one size: file → text.

    They are for the terms of the contact and for what is in front of the motor. Similar motors share one compilation.
    """
    behavioral = data_path("behavioral")
    sized = [*size.lines(terms), f"#define PHASES {phases}", f"#define HARMONICS {harmonics}", "#define START {0.0}"]
    sized += [f"#define TRACKED {int(front.tracked)}", f"#define DRIVEN {int(front.driven)}"]
    circuits = {"tracker": TRACKER} if front.tracked else {}
    circuits |= {"network": NETWORK} if front.driven else {}
    return {
        **{f"piezomotor_{name}.h": circuit_source(name, parts) for name, parts in circuits.items()},
        **{file: (behavioral / file).read_text(encoding="utf-8") for file in (CORE, SESSION)},
        HEADER: header(terms),
        PHASE: phase_source(terms),
        START: "\n".join(sized) + "\n",
    }


# --- code that is written from the libraries that ngspice runs ---


def circuit_parameters(parts: Parts) -> tuple[LibraryParameter, ...]:
    """Return the parameters of a circuit: the first fields of its structure, in this order."""
    return tuple(item for name, _ in parts for item in read_library(name).parameters)


def part_values(parts: Parts, *values: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the parameters of equal circuits, one behind the other; by default those of their libraries."""
    known = circuit_parameters(parts)
    return np.array([of_one.get(item.name, item.default) for of_one in values for item in known], dtype=float)


def circuit_source(name: str, parts: Parts) -> str:
    """Return a circuit in C: the structure ``NAME``, and the function ``NAME_flows``.

    The function takes parameters, voltages of pins and capacitors, and the currents of sources that sense one. It finds
    the other voltages and, for each capacitor to ground, the current into its node and its capacitance, ``flow_NODE``
    and ``store_NODE``.
    """
    found = Equations()
    for part, pins in parts:
        found.add(read_library(part), pins)
    found.resolve()
    parameters = [item.name for item in circuit_parameters(parts)]
    texts = {node: _c(text) for node, text in found.ordered()}
    for node, capacitance in found.capacitances.items():
        texts[f"flow_{node}"] = _c("+".join(found.currents.get(node, ["0"])))
        texts[f"store_{node}"] = _c(capacitance)
    used = dict.fromkeys(re.findall(r"p->(\w+)", " ".join(texts.values())))
    fields = [*parameters, *(word for word in used if word not in parameters and word not in texts), *texts]
    about = f"Written from {' and '.join(f'{part}.lib' for part, _ in parts)}."
    return _source([about], name, fields, *_function(f"static inline void {name}_flows", name, texts))


def phase_source(terms: Terms = ALL_TERMS) -> str:
    """Return the contact at one phase in C, with the equations of ``piezomotor_averaged_phase`` that a motor has.

    A force is the right side of its equation, for a value of it; it is a root where the equation contains its own node.
    """
    library = averaged_phase(terms)
    found = equations(library)
    inputs = [pin.name for pin in library.pins if pin.name not in found.values]
    fields = [*(item.name for item in averaged_phase(ALL_TERMS).parameters), *inputs, *found.parameters, *found.values]
    texts = {name: translated(text, "c", lambda used: f"p->{used}") for name, text in found.ordered()}
    values = [name for name in texts if name in found.values]
    normal, bound, motion, friction = map(values.index, ("normal", "bound", "motion", "friction"))
    ends = pairwise((0, normal, max(bound, motion) + 1, friction, len(values)))
    lines = [*_function("static void phase_parameters", "phase", {name: texts[name] for name in found.parameters})]
    for name in ("normal", "friction"):
        lines += [f"#define {name.upper()}_ROOT {int(f'V({name})' in found.values[name])}"]
        lines += [f"static inline double phase_{name}_by(struct phase *p, double value)", "{"]
        lines += [f"    p->{name} = value;", f"    return {texts.pop(name)};", "}", ""]
    for part, (begin, end) in zip(("approach", "motion", "moved", "forces"), ends, strict=True):
        of_part = {name: texts[name] for name in values[begin:end] if name in texts}
        lines += _function(f"static inline void phase_{part}", "phase", of_part)
    about = [f"{library.title}; displacements in um.", f"Written from {library.name}.lib."]
    return _source(about, "phase", fields, *lines)


def _source(about: Sequence[str], name: str, fields: Sequence[str], *lines: str) -> str:
    """Return a C header with a structure of numbers and functions."""
    comment = ["/* SPDX-License-Identifier: MIT", " *", *(f" * {line}" for line in about), " */"]
    members = wrap(f"double {', '.join(fields)};", 110, initial_indent="    ", subsequent_indent="        ")
    head = [*comment, "#include <math.h>", "", HELPERS["c"], "", f"struct {name} {{", *members, "};", ""]
    return "\n".join((*head, *lines))


def _function(declared: str, name: str, values: Mapping[str, str]) -> tuple[str, ...]:
    """Return the lines of a function that sets fields of a structure ``p``."""
    return f"{declared}(struct {name} *p)", "{", *(f"    p->{key} = {text};" for key, text in values.items()), "}", ""


def _c(text: str) -> str:
    return translated(text, "c", lambda used: f"p->{used.lower()}")
