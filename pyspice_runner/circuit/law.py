# SPDX-License-Identifier: GPL-3.0-or-later
"""The laws of the contact: their libraries, and the values of an instance.

:data:`LAWS` lists the built-in ones. All have the same pins. The path of a ``.lib`` file is a user's own law:
``docs/tutorial_contact_law.md`` shows how to write one; :mod:`.own_file` reads it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from math import ceil, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.document import read_bytes
from pyspice_runner.motor.motor import Motor, derived, require_one_contact
from pyspice_runner.motor.parameters import HERTZ, Contact
from pyspice_runner.spice.library import LAW, PREFIX, Library, LibraryParameter, parse_library, read_library
from pyspice_runner.spice.own_file import OwnFile, Rules, Statement, short, words_of

#: the built-in laws and their libraries; the first is the default
LAWS: dict[str, str] = {
    "spring-slider": "piezomotor_contact",
    "brush": "piezomotor_brush",
    "coulomb": "piezomotor_coulomb",
}
PINS = ("x", "y", "vx", "vy", "fx", "fy", "shaft", "normal", "friction", "slider", "state")
#: parameters that the motor sets in every law, to start the contact at its preload
REQUIRED = ("normal_stiffness", "mu", "radius", "preload", "deflection")
ENDING = ".lib"  # of the file of a user's own law
_OWN_NAME = f"{PREFIX}{LAW}"  # of the subcircuit in a netlist; the file may use another name
_MOST_BYTES = 1 << 18
_RULES = Rules("law", forbidden={r"\bic\s*=": "remove ic=; a run starts with no voltage there"})
MOST_SLIDERS = 200
_STRIBECK = ("sliding", "stribeck")  # parameters of the friction that falls with the slip velocity
# parameters of a library that follow from the motor and the run; any other is the law's own
_OF_MOTOR = (*REQUIRED, *_STRIBECK, "compliance", "damping", "flat", "span", "slider_time")
# unit and range of the parameters that depend on the exponent; the minimum compliance is SOFTNESS over the stiffness
# of the stiffest lining, 1e13 N/m
OTHER_POWER = {"normal_stiffness": ("N/m^{}", "1e3", "1e25"), "compliance": ("m/N^(1/{})", "1e-14", "1e-2")}
REACH = 4.0  # penetration over the static one that the sliders of a brush cover evenly: at eight times the force


def is_own(contact: object) -> bool:
    """Return whether a law is a user's own file, according to its ending."""
    return isinstance(contact, str | Path) and str(contact).lower().endswith(ENDING)


@dataclass(frozen=True)
class Law:
    """The law of a contact. ``None`` instead of a law is a free tip.

    What a law can do is read from the header of its library (``behavioral/CONVENTIONS.md``), for a built-in law and
    for a user's own alike.

    Attributes:
        name: one of :data:`LAWS`: the paper's law, which is the default; a row of sliders, which slips from the edge
            inwards; a friction without a tangential spring. Or the path of a ``.lib`` file with a law of the user's
            own.
        sliders: number of sliders: 0 or 1, which the library gives, or that of a row, by default the library's.
        parameters: values of the law's own parameters; others have the defaults of the library.
        whole: number of sliders of the row of which these are the inner ones; ``None`` for a whole row.

    Raises:
        ParameterError: by the constructor, for an unknown law, sliders that are out of range or have no effect, or a
            parameter that the law does not have or that is out of range.
    """

    name: str = next(iter(LAWS))
    sliders: int = None  # type: ignore[assignment]  # the constructor sets the number
    parameters: Mapping[str, float] = field(default_factory=dict, hash=False)
    whole: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", str(self.name))
        if not is_own(self.name) and self.name not in LAWS:
            raise ParameterError(
                f"contact = {self.name!r} is not valid: it must be {', '.join(map(repr, LAWS))}, None (free tip) "
                f"or the path of a {ENDING} file."
            )
        found = len(self._library.sliders)
        given = vars(self)["sliders"]
        sliders = found if given is None else given
        if self.row and sliders not in range(1, MOST_SLIDERS + 1):
            raise ParameterError(
                f"sliders = {sliders} is not valid: it must be a whole number from 1 to {MOST_SLIDERS}."
            )
        if not self.row and sliders != found:
            rows = [name for name in LAWS if Law(name).row]
            raise ParameterError(
                f"sliders = {sliders} has no effect on the law {self.name!r}. Leave it out, or write "
                f'Law("{rows[0]}", {sliders}).'
            )
        object.__setattr__(self, "sliders", int(sliders))
        for name, value in self.parameters.items():
            item = self.parameter(name)
            if not item.least <= value <= item.greatest:
                unit = "" if item.unit == "1" else f" {item.unit}"
                raise ParameterError(
                    f"law.{name} = {value:g}{unit} is not valid: it must be {item.least:g} to {item.greatest:g}{unit}."
                )

    @cached_property
    def _library(self) -> Library:
        """The library with the number of sliders and the parameters that its header gives."""
        return read_own_law(self.name) if is_own(self.name) else read_library(LAWS[self.name])

    @property
    def own(self) -> dict[str, LibraryParameter]:
        """The law's own parameters, by name: those that neither the motor nor the run sets."""
        return {item.name: item for item in self._library.parameters if item.name not in _OF_MOTOR}

    def parameter(self, name: str) -> LibraryParameter:
        """Return one of the law's own parameters. Raise ParameterError for any other."""
        if name not in self.own:
            has = f"its own are {', '.join(self.own)}" if self.own else "it has none of its own"
            raise ParameterError(f"law.{name} is not a parameter of the contact law {self.name}; {has}.")
        return self.own[name]

    @cached_property
    def forms(self) -> frozenset[str]:
        """The forms in which the law exists: ``spice``, and of built-in laws ``verilog-a``, ``averaged`` and ``c``."""
        return frozenset({"spice"}) if is_own(self.name) else self._library.forms

    @cached_property
    def spring(self) -> bool:
        """Whether the law has a tangential spring of its own, with which one in series has a place."""
        return self._library.spring

    @cached_property
    def row(self) -> bool:
        """Whether the law is a row of sliders, whose number can be chosen."""
        return not is_own(self.name) and len(self._library.sliders) > 1

    @cached_property
    def sliding(self) -> bool:
        """Whether the states of the law are sliders."""
        return self.row or len(self._library.sliders) == 1

    @property
    def falls(self) -> bool:
        """Whether the friction can fall with the slip velocity."""
        return _STRIBECK[0] in {item.name for item in self._library.parameters}

    @property
    def states(self) -> tuple[str, ...]:
        """The nodes inside a motor whose capacitors hold the state of its first contact, for ``.ic``."""
        return self.states_of("")

    def states_of(self, suffix: str) -> tuple[str, ...]:
        """Return these nodes of a contact by the suffix of its nodes."""
        nodes = contact_library(self).states
        return tuple(f"{node}{suffix}" if node in PINS else f"xcontact{suffix}.{node}" for node in nodes)

    @property
    def touching(self) -> NDArray[np.float64]:
        """Share of each slider that touches at preloaded rest, from the inner one; of a single slider 1."""
        edge = self.sliders / sqrt(REACH) if self.row else 1.0
        return np.clip(edge - np.arange(self.sliders), 0.0, 1.0)

    @property
    def covered(self) -> float:
        """Part of the default span that the sliders cover: it goes with the square of the contact's width."""
        return (self.sliders / self.whole) ** 2 if self.whole else 1.0

    def inner(self, sliders: int) -> Law:
        """Return the row with its inner sliders only, for a motion in which those beyond touch nothing."""
        return self if sliders == self.sliders else replace(self, sliders=sliders, whole=self.sliders)

    def updated(self, parameters: Mapping[str, float]) -> Law:
        """Return the law with other values of its own parameters. Raise ParameterError for an invalid one."""
        changed = {**self.parameters, **parameters}
        return self if changed == self.parameters else replace(self, parameters=changed)

    def to_dict(self) -> dict[str, object]:
        """Return the law as in the results, JSON-ready."""
        found: dict[str, object] = {"contact": self.name}
        return (
            found
            | ({"sliders": self.sliders} if self.row else {})
            | ({"law": dict(self.parameters)} if self.parameters else {})
        )


def reached(law: Law, contact: Contact, depth: float) -> int:
    """Return the number of sliders of a brush that touch something at a penetration in m or less."""
    flat = contact_law.flat_length(contact)
    deep = REACH * (contact.preload_n / contact.normal_stiffness_n_per_m15) ** (2.0 / 3.0)
    edge = law.sliders * sqrt(_width(max(depth, 0.0), flat) / _width(deep, flat))
    return min(max(ceil(edge), 1), law.sliders)


def _width(depth: float, flat: float) -> float:
    """Return half of the contact's width squared, over the radius of a new tip, in m."""
    return 0.5 * (sqrt(flat**2 + 4.0 * depth**2) + flat)


@derived
def laws_of(motor: Motor, law: Law | None) -> tuple[Law, ...]:
    """Return the law of each contact: its own law, or else the law of the motor. A free tip has no law: ``()``.

    Raise ParameterError for one that is not valid; the message names the contact.
    """
    found: list[Law] = []
    if law is None:
        return ()
    for one in motor.touching:
        given = {"name": law.name, **one.law}
        try:
            own = law if given["name"] == law.name else Law(str(given["name"]))
            found.append(own.updated({name: float(value) for name, value in given.items() if name != "name"}))
        except (ParameterError, ValueError) as error:
            raise ParameterError(f"contacts.{one.name}.law: {error}") from error
        if law.row or found[-1].row:
            require_one_contact(
                motor, f"The contact {law.name if law.row else found[-1].name} of {one.name} is",
                f"Use {', '.join(name for name in LAWS if not Law(name).row)} or a {ENDING} file of your own",
            )  # fmt: skip
    return tuple(found)


def law_settings(motor: Motor, law: Law | None) -> dict[str, object]:
    """Return the law as in the results, JSON-ready, with those that contacts have of their own."""
    laws = zip(motor.touching if law else (), laws_of(motor, law), strict=True)
    own = {one.name: other.to_dict() for one, other in laws if one.law}
    return (law.to_dict() if law else {}) | ({"contacts": own} if own else {})


def libraries_of(motor: Motor, law: Law | None) -> tuple[Library, ...]:
    """Return the library of each contact; contacts with one law share a library. A free tip has no library: ``()``.

    A second file of the user's own has another name in a netlist.
    """
    if law and not motor.contacts:
        return (contact_library(law, motor.contact),)
    laws, found = laws_of(motor, law), dict[str, Library]()
    for name, own in {own.name: own for own in laws}.items():
        contacts = [one.contact for one, other in zip(motor.touching, laws, strict=True) if other.name == name]
        needs = {
            "worn_flat_radius_m": max(contact.worn_flat_radius_m for contact in contacts),
            "exponent": next((contact.exponent for contact in contacts if contact.exponent != HERTZ), HERTZ),
            "sliding_ratio": min(contact.sliding_ratio for contact in contacts),
        }
        found[name] = library = contact_library(own, motor.contact.model_copy(update=needs))
        if is_own(name) and (files := sum(map(is_own, found))) > 1:
            text = re.sub(rf"\b{library.name}\b", f"{library.name}{files}", library.subcircuit)
            found[name] = replace(library, name=f"{library.name}{files}", subcircuit=text)
    return tuple(found[own.name] for own in laws)


ContactLaw = Law | str | Path  # as an analysis accepts it: a law, its name, or the path of a user's own
PAPER_LAW = Law()


def law_of(contact: ContactLaw | None, parameters: Mapping[str, float] = {}) -> Law | None:
    """Return the law for an argument ``contact``, with values of its own parameters; ``None`` is a free tip.

    Raise ParameterError for an unknown law, or a parameter that it does not have.
    """
    law = contact if contact is None or isinstance(contact, Law) else Law(contact)  # type: ignore[arg-type]
    return law and law.updated(parameters)


def touching_law(contact: ContactLaw | None, reason: str, parameters: Mapping[str, float] = {}) -> Law:
    """Return the law as :func:`law_of`. Raise ParameterError with the reason for a free tip."""
    law = law_of(contact, parameters)
    if law is None:
        raise ParameterError(f"contact = None (free tip) is not valid here: {reason} Give a law.")
    return law


def contact_library(law: Law, contact: Contact | None = None) -> Library:
    """Return the library of a law; the brush is written for its number of sliders.

    The spring-slider has the factor of Stribeck's curve only for a contact whose friction falls with the velocity.
    Raise ParameterError for a user's own law that is not valid.
    """
    library = law._library
    if contact is None or contact.sliding_ratio == 1.0:
        library = _constant_friction(library)
    return on_contact(_row(library, law.sliders) if law.sliders != len(library.sliders) else library, contact)


def on_contact(library: Library, contact: Contact | None) -> Library:
    """Return a law on the normal contact that it has: of a worn tip, of a lining, or Hertz's."""
    if contact is not None and contact.exponent != HERTZ:
        if contact.worn_flat_radius_m:
            raise ParameterError("A worn tip beside a lining has no library: set contact.worn_flat_radius_m to 0.")
        return lined(library)
    return worn(library) if contact is not None and contact.worn_flat_radius_m else library


@cache
def _row(library: Library, sliders: int) -> Library:
    return parse_library(library.name, row_library(library, sliders))


@cache
def unplotted(library: Library) -> Library:
    """Return the brush without what serves its pins ``slider`` and ``state`` alone, on which nothing else depends."""
    before, plotting, after = library.subcircuit.partition("* for plotting only")
    return replace(library, subcircuit=before + after[after.rindex(".ends") :]) if plotting else library


def _statements(text: str) -> dict[str, str]:
    """Return the statements of a subcircuit by their first words; lines that begin alike are one entry."""
    found: dict[str, str] = {}
    for line in text.split("\n"):
        word = line.partition(" ")[0]
        found[word if word[0] not in "*." or word in (".subckt", ".ends") else line] = line
    return found


def _joined(statements: Mapping[str, str]) -> str:
    """Return the text of statements; an empty one is left out."""
    return "\n".join(line for line in statements.values() if line)


@cache
def _constant_friction(library: Library) -> Library:
    """Return the spring-slider without Stribeck's curve, whose exponential takes a sixth of the run time."""
    lines = _statements(library.subcircuit)
    words = lines[".subckt"].split(" ")
    lines[".subckt"] = " ".join(word for word in words if word.partition("=")[0] not in _STRIBECK)
    if "Bfriction" in lines:
        lines["Bfriction"] = lines["Bfriction"].partition(f"*({{{_STRIBECK[0]}}}+")[0]
    parameters = tuple(item for item in library.parameters if item.name not in _STRIBECK)
    return replace(library, subcircuit=_joined(lines), parameters=parameters)


@cache
def worn(library: Library) -> Library:
    """Return a law on the normal contact of a worn tip; its name ends in ``_worn``."""
    lines = _statements(library.subcircuit)
    _spring_of_worn(lines)
    _row_of_worn(lines)
    return _on_other(library, lines, "worn", "flat")


@cache
def lined(library: Library) -> Library:
    """Return a law on the normal contact of a lining, F_N = K δ^exponent; its name ends in ``_lining``.

    The friction of the spring-slider is that of :func:`_spring_of_worn`, in which f^(1 − p) is left of κ^−p.
    """
    lines = _statements(library.subcircuit.replace("^(3/2)", "^exponent"))
    if "limit_ratio" in lines.get("Bgrip", ""):
        ratio = next(key for key in lines if key.startswith(".param limit_ratio="))
        lines[ratio] = ratio.replace("**(2/3)", "**(1/exponent)")
        ahead, behind = (f"uramp(V(limit)-uramp({held}))**{{exponent}}" for held in ("-V(held)", "V(held)"))
        lines["Bgrip"] = f"Bgrip grip 0 V={{mu*normal_stiffness/(1e6*limit_ratio)**exponent}}*({ahead}-{behind})"
        factor = "max(max(V(factor),1m)**({exponent-1}),31.6m)"  # not below that of Hertz's contact, √1m
        lines["Bfriction"] = lines["Bfriction"].replace("sqrt(max(V(factor),1m))", factor)
    library = _on_other(library, lines, "lining", "exponent")
    return replace(library, parameters=tuple(of_power(item, "exponent") for item in library.parameters))


def of_power(item: LibraryParameter, exponent: str) -> LibraryParameter:
    """Return a parameter of a Hertz contact with the unit and range of a lining; the unit contains ``exponent``."""
    if item.name not in OTHER_POWER:
        return item
    unit, least, greatest = OTHER_POWER[item.name]
    return replace(item, unit=unit.format(exponent), least=float(least), greatest=float(greatest))


def _on_other(library: Library, lines: dict[str, str], ending: str, parameter: str) -> Library:
    """Return a law on the normal contact of another library with one more parameter; its name has the same ending."""
    name, other = f"{library.name}_{ending}", read_library(f"piezomotor_{ending}")
    item = next(item for item in other.parameters if item.name == parameter)
    own = lines[".subckt"].replace(f" {library.name} ", f" {name} ", 1)
    lines |= {".subckt": f"{own} {parameter}={item.default:g}", ".ends": f".ends {name}"}
    for key, line in lines.items():
        if key.startswith("X") and " piezomotor_normal " in line:
            lines[key] = line.replace(" piezomotor_normal ", f" {other.name} ") + f" {parameter}={{{parameter}}}"
    parameters = (*library.parameters, item)
    return replace(library, name=name, subcircuit=_joined(lines), parameters=parameters, needs=(other.name,))


def _spring_of_worn(lines: dict[str, str]) -> None:
    """Write the spring-slider of a worn tip; other laws stay as they are.

    At the displacement u the tangential force is μ f (F(δ) − F(δ − |u|/(κ f))), for any axisymmetric profile
    (Ciavarella, Jäger); f is the factor of the damping, taken as 0.1 at least within F. For Hertz's law that is the
    spring of the paper.
    """
    if "limit_ratio" not in lines.get("Bgrip", ""):
        return
    elastic = _statements(read_library("piezomotor_worn").subcircuit)["Belastic"].partition("}*")[2]
    ahead, behind = (elastic.replace("V(deep)", f"V({node})") for node in ("ahead", "behind"))
    lines["Bgrip"] = (
        "Bahead ahead 0 V=(V(limit)-uramp(-V(held)))/({limit_ratio}*max(V(factor),0.1))\n"
        "Bbehind behind 0 V=(V(limit)-uramp(V(held)))/({limit_ratio}*max(V(factor),0.1))\n"
        f"Bgrip grip 0 V={{mu*normal_stiffness*1.414213562373095e-9}}*({ahead}-{behind})"
    )
    lines["Bfriction"] = lines["Bfriction"].replace("V(grip)/sqrt(max(V(factor),1m))", "V(grip)*V(factor)")


def _row_of_worn(lines: dict[str, str]) -> None:
    """Write the brush of a worn tip; other laws stay as they are.

    Beyond the flat an element at x penetrates by δ − x √(x² − b²)/R*, within it by δ. The integral of that is
    δ x − (x² − b²)^(3/2)/(3 R*).
    """
    if "Bl1" not in lines:
        return
    for key in lines:
        if key in ("Bf1", "Rf1", "Bf2", "Rf2") or key.startswith(("Gm", "Rm")):
            lines[key] = ""  # what only the limits of a new tip need
        elif key.startswith("Bl"):
            element, _, limit = lines[key].partition(" I=")
            inner, x = int(key.removeprefix("Bl")) - 1, limit.partition("*")[0]
            beyond = f"uramp(({inner}+{x})*({inner}+{x})-{{flat/cell}})**1.5-{{max(0,{inner * inner}-flat/cell)**1.5}}"
            lines[key] = f"{element} I=V(f0)*({{1.5/cell}}*V(depth)*{x}-0.5*({beyond}))"
    lines["Bx0"] = (
        "Bdepth 0 depth I=max(V(delta),1e-9)\nRdepth depth 0 1\n"
        "Bx0 0 x0 I=sqrt((sqrt({flat*flat}+4*V(depth)*V(depth))+{flat})*{0.5/cell})"
    )


def _of_profile(law: Law, contact: Contact) -> dict[str, float]:
    """Return the parameter that a worn tip or a lining adds to a law. Raise ParameterError for one that has neither."""
    lining, worn_flat, row = contact.exponent != HERTZ, contact.worn_flat_radius_m, law.row
    if not (lining or worn_flat):
        return {}
    if (is_own(law.name) and law.spring) or (lining and row):
        given = f"exponent = {contact.exponent:g}" if lining else f"worn_flat_radius_m = {worn_flat:g} m"
        taken = " or ".join(name for name in LAWS if not (lining and Law(name).row))
        raise ParameterError(
            f"contact.{given} is not valid with the contact {law.name}, whose spring is Hertz's of a new tip: "
            f"it must be {taken}, or a law without a spring. Choose one of these, or set it to {1.5 if lining else 0}."
        )
    return {"exponent": contact.exponent} if lining else {"flat": 1e6 * contact_law.flat_length(contact)}


def contact_values(
    law: Law,
    contact: Contact,
    *,
    radius: float,
    preload: float,
    deflection: float = 0.0,
    slider_time: float | None = None,
    span: float | None = None,
) -> dict[str, float]:
    """Return the parameters of an instance of a law's subcircuit, in the library's units.

    Lengths are in m, the preload in N. ``slider_time``, by default the library's, is the time constant in s with which
    a slider is held at its limit. The brush's sliders cover the penetration ``span`` evenly, by default :data:`REACH`
    times the static one of a new tip; of a worn tip they reach as far as its contact then does.
    """
    values = {
        "normal_stiffness": contact.normal_stiffness_n_per_m15,
        "mu": contact.friction,
        "radius": radius,
        "preload": preload,
        "deflection": 1e6 * deflection,
    }
    declared = contact_library(law).defaults
    damping = contact_law.normal_damping(contact)
    if damping:
        if "damping" not in declared:
            raise ParameterError(
                f"The contact law {law.name} has no parameter damping. Set contact.restitution to 1, or add it to the "
                "law."
            )
        values["damping"] = damping
    if contact.sliding_ratio < 1.0:
        if not law.falls:
            falling = " or ".join(name for name in LAWS if Law(name).falls)
            raise ParameterError(
                f"contact.sliding_ratio = {contact.sliding_ratio:g} is not valid with the contact {law.name}, which "
                f"has one coefficient of friction. Set it to 1, or choose the contact {falling}."
            )
        values |= {"sliding": contact.sliding_ratio, "stribeck": contact.stribeck_velocity_m_s}
    values |= _of_profile(law, contact)
    if "compliance" in declared:
        values["compliance"] = contact_law.total_compliance(contact)
    if "slider_time" in declared and slider_time is not None:
        values["slider_time"] = slider_time
    if "span" in declared:
        flat = contact_law.flat_length(contact)
        deep = REACH * (preload / contact.normal_stiffness_n_per_m15) ** (2.0 / 3.0) if span is None else span
        values["span"] = 1e6 * law.covered * _width(deep, flat)
    return values | dict(law.parameters)


def row_library(library: Library, sliders: int) -> str:
    """Return the text of a library with a row of sliders, with another number of them."""
    given = len(library.sliders)
    cells, plotted = [], []
    for inner in range(sliders):
        number = inner + 1
        x, w, m = f"V(x{inner})", f"V(w{number})", f"V(m{inner})" if inner else "V(f2)"
        y, rest = f"V(y{number})", f"V(q{number})-V(y{number})"
        if inner:
            cells += [
                f"Bx{inner} 0 x{inner} I=uramp(V(x0)-{inner})",
                f"Rx{inner} x{inner} 0 1",
                f"Gm{inner} 0 m{inner} f2 0 1",
                f"Gmb{inner} m{inner} 0 f1 0 {inner / 2:g}",
                f"Gmbb{inner} m{inner} 0 f0 0 {inner * inner / 2:g}",
                f"Rm{inner} m{inner} 0 1",
            ]
        cells += [
            f"Bl{number} {f'y{inner}' if inner else 0} y{number} I={x}*{m}",
            f"Gy{number} 0 y{number} q{number} 0 1",
            f"Ry{number} y{number} 0 0.5",
            f"Bq{number} {f'q{inner}' if inner else 0} q{number} I={x}*V(slip)",
            f"Cq{number} q{number} 0 {{slider_time}}",
            f"Rq{number} q{number} 0 {{hold}}",
            f"Bc{number} held q{number} I=abs({y})-abs({rest})",
        ]
        if number < sliders:
            plotted += [f"Gw{number} 0 w{number} x{inner} x{number} 1", f"Rw{number} w{number} 0 1"]
        plotted.append(f"Bslips{number} 0 state I={w if number < sliders else x}*u({y}*({rest}))")
    text = _between(library.text, "\nBl1 ", "\nRheld ", cells)
    text = _between(text, "\nGw1 ", "\nBslider ", plotted)
    text = text.replace("V(w1)", "V(x0)") if sliders == 1 else text
    text = text.replace(f"a row of {given} ", f"a row of {sliders} ", 1)
    text = text.replace(f"the end of cell {given}:", f"the end of cell {sliders}:", 1)
    nodes = " ".join(f"q{number + 1}" for number in range(sliders))
    text = text.replace(f"* SLIDERS {' '.join(library.sliders)}", f"* SLIDERS {nodes}", 1)
    return text.replace(f"{{span/{given**2}}}", f"{{span/{sliders**2}}}", 1)


def _between(text: str, first: str, after: str, lines: Sequence[str]) -> str:
    """Return a text with other lines from one to before another, which are given by their beginnings."""
    return "\n".join((text[: text.index(first)], *lines)) + text[text.index(after) :]


def read_own_law(path: str) -> Library:
    """Read a contact law from a ``.lib`` file that holds one ``.subckt`` with the pins :data:`PINS`.

    Raise ParameterError for a file that cannot be read or used; the message names the line.
    """
    data = read_bytes(path, "contact law", _MOST_BYTES)
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ParameterError(f"{path}, line {line}: only ASCII characters are allowed; write um for µm.") from None
    return _OwnLaw(path, text, _RULES).library()


class _OwnLaw(OwnFile):
    """Reader of one law."""

    def library(self) -> Library:
        """Return the law as a library with the subcircuit :data:`_OWN_NAME`."""
        (begin, first), *body, (end, last) = self._subcircuit()
        words = words_of(first)
        name, pins = words[1].lower(), [word.lower() for word in words[2:] if "=" not in word]
        if tuple(pins) != PINS:
            self._fail(begin, f"the pins are {' '.join(pins) or 'missing'}; they must be {' '.join(PINS)}")
        if last.split()[1:] and last.split()[1].lower() != name:
            self._fail(end, f"{short(last)} does not end .subckt {words[1]}")
        needs = self._needs()
        parameters = self._parameters(begin, [word for word in words[2:] if "=" in word])
        known = {parameter.name for parameter in parameters}
        missing = [name for name in REQUIRED if name not in known]
        if missing:
            self._fail(begin, f"the parameters {', '.join(missing)} are missing; the motor sets them")
        for taken in ("friction", "inertia", "bearing"):
            if taken in known:
                self._fail(begin, f"a parameter cannot be called {taken}, since another one is; rename it")
        for line, text in body:
            known |= self._check(line, text, known, needs)
        values = " ".join(f"{parameter.name}={parameter.default!r}" for parameter in parameters)
        lines = [f".subckt {_OWN_NAME} {' '.join(PINS)} {values}", *(text for _, text in body), f".ends {_OWN_NAME}"]
        return self._library(_OWN_NAME, words[1], PINS, parameters, "\n".join(lines), needs)

    def _subcircuit(self) -> list[Statement]:
        """Return the lines from ``.subckt`` to ``.ends``, the only ones in the file."""
        lines = self._statements
        begins = [index for index, (_, line) in enumerate(lines) if re.match(r"\.subckt\s+\S", line, re.I)]
        ends = [index for index, (_, line) in enumerate(lines) if re.match(r"\.ends\b", line, re.I)]
        if len(begins) != 1 or len(ends) != 1 or ends[0] < begins[0]:
            raise ParameterError(
                f"{self._path} must hold one subcircuit, from .subckt NAME {' '.join(PINS)} to .ends; "
                f"it has {len(begins)} .subckt and {len(ends)} .ends."
            )
        for count, line in (*lines[: begins[0]], *lines[ends[0] + 1 :]):
            self._fail(count, f"{short(line)} is outside of the subcircuit; remove it")
        return lines
