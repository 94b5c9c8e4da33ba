# SPDX-License-Identifier: GPL-3.0-or-later
"""The laws of the contact: their libraries, and the values of an instance.

``spring-slider`` is the paper's law, ``brush`` a row of sliders that slip one after the other (partial slip),
``coulomb`` friction as a function of the velocity, without a spring. All have the same pins. The path of a
``.lib`` file is a user's own law, see :mod:`.own_law`. ``python -m pyspice_runner.netlist.contact`` writes
``behavioral/piezomotor_brush.lib``; a test compares the file with :func:`brush_library`.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.parameters import Contact
from pyspice_runner.netlist.library import Library, data_path, parse_library, read_library
from pyspice_runner.netlist.own_law import ENDING, PINS, read_own_law

LIBRARIES: dict[str, str] = {
    "spring-slider": "piezomotor_contact",
    "brush": "piezomotor_brush",
    "coulomb": "piezomotor_coulomb",
}
SLIDERS = 8
MOST_SLIDERS = 200
REACH = 4.0  # penetration over the static one that the sliders of a brush cover evenly: at eight times the force


def is_own(contact: object) -> bool:
    """Return whether a law is a user's own file, according to its ending."""
    return isinstance(contact, str | Path) and str(contact).lower().endswith(ENDING)


@dataclass(frozen=True)
class Law:
    """The law of a contact. ``None`` instead of a law is a free tip.

    Attributes:
        name: ``"spring-slider"``, the paper's law; ``"brush"``, which slips from the edge inwards; ``"coulomb"``,
            without a tangential spring; or the path of a ``.lib`` file with a law of the user's own.
        sliders: number of sliders of the brush, 8 by default; ``None`` for the other laws.

    Raises:
        ParameterError: by the constructor, for an unknown law, or sliders that are out of range or have no effect.
    """

    name: str = "spring-slider"
    sliders: int | None = None

    def __post_init__(self) -> None:
        if is_own(self.name):
            object.__setattr__(self, "name", str(self.name))
            read_own_law(self.name)
        elif self.name not in tuple(LIBRARIES):
            raise ParameterError(
                f"contact = {self.name!r} is not valid: it must be {', '.join(map(repr, LIBRARIES))}, None (free tip) "
                f"or the path of a {ENDING} file."
            )
        if self.name == "brush":
            sliders = SLIDERS if self.sliders is None else self.sliders
            if sliders not in range(1, MOST_SLIDERS + 1):
                raise ParameterError(
                    f"sliders = {sliders} is not valid: it must be a whole number from 1 to {MOST_SLIDERS}."
                )
            object.__setattr__(self, "sliders", int(sliders))
        elif self.sliders is not None:
            raise ParameterError(
                f"sliders = {self.sliders} has no effect on the law {self.name!r}. Leave it out, or write "
                f'Law("brush", {self.sliders}).'
            )

    @property
    def library(self) -> Library:
        """The library with the law's subcircuit."""
        return contact_library(self)

    @property
    def states(self) -> tuple[str, ...]:
        """The nodes inside a motor whose capacitors hold the state of the contact, for ``.ic``.

        The state of ``spring-slider`` is an attribute of :class:`~pyspice_runner.netlist.motor.Motion`.
        """
        if self.name == "spring-slider":
            return ()
        nodes = re.findall(r"^C\w+ (\w+) 0 ", self.library.subcircuit, re.M | re.I)
        return tuple(node if node in PINS else f"xcontact.{node}" for node in map(str.lower, nodes))

    def to_dict(self) -> dict[str, object]:
        """Return the law as in the results, JSON-ready."""
        return {"contact": self.name, **({"sliders": self.sliders} if self.sliders else {})}


ContactLaw = Law | str | Path  # as an analysis accepts it: a law, its name, or the path of a user's own
PAPER_LAW = Law()


def law_of(contact: ContactLaw | None) -> Law | None:
    """Return the law for the argument ``contact`` of an analysis; ``None`` is a free tip.

    Raises:
        ParameterError: for an unknown law.
    """
    return contact if contact is None or isinstance(contact, Law) else Law(contact)  # type: ignore[arg-type]


def touching_law(contact: ContactLaw | None, reason: str) -> Law:
    """Return the law for the argument ``contact`` of an analysis that needs a contact.

    Args:
        contact: the argument.
        reason: why it needs one, as a sentence.

    Raises:
        ParameterError: for an unknown law, or a free tip.
    """
    law = law_of(contact)
    if law is None:
        raise ParameterError(f"contact = None (free tip) is not valid here: {reason} Give a law.")
    return law


def contact_library(law: Law, contact: Contact | None = None) -> Library:
    """Return the library of a law; the brush is written for its number of sliders.

    The spring-slider with friction that falls with the slip velocity is a separate library.

    Args:
        law: the law.
        contact: constants of the contact.

    Raises:
        ParameterError: for a user's own law that is not valid.
    """
    if is_own(law.name):
        return read_own_law(law.name)
    name = LIBRARIES[law.name]
    if law.name == "spring-slider" and contact is not None and contact.sliding_ratio < 1.0:
        return read_library("piezomotor_stribeck")
    if law.sliders not in (None, SLIDERS):
        return parse_library(name, brush_library(law.sliders))
    return read_library(name)


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

    Args:
        law: the law.
        contact: constants of the contact.
        radius: of the rotor, m.
        preload: static normal force, N.
        deflection: static bending under the preload, m.
        slider_time: time constant with which a slider is held at its limit, s; by default the library's.
        span: penetration in m that the brush's sliders cover evenly; by default :data:`REACH` times the static one.
    """
    values = {
        "normal_stiffness": contact.normal_stiffness_n_per_m15,
        "mu": contact.friction,
        "radius": radius,
        "preload": preload,
        "deflection": 1e6 * deflection,
    }
    declared = {parameter.name for parameter in contact_library(law).parameters}
    damping = contact_law.normal_damping(contact)
    if damping:
        if "damping" not in declared:
            raise ParameterError(
                f"The contact law {law.name} has no parameter damping. Set contact.restitution to 1, or add it to the "
                "law."
            )
        values["damping"] = damping
    if contact.sliding_ratio < 1.0:
        if law.name != "spring-slider":
            raise ParameterError(
                f"contact.sliding_ratio = {contact.sliding_ratio:g} is not valid with the contact {law.name}, which "
                "has one coefficient of friction. Set it to 1, or choose the contact spring-slider."
            )
        values |= {"sliding": contact.sliding_ratio, "stribeck": contact.stribeck_velocity_m_s}
    if "compliance" in declared:
        values["compliance"] = contact_law.total_compliance(contact)
    if "slider_time" in declared and slider_time is not None:
        values["slider_time"] = slider_time
    if "span" in declared:
        values["span"] = 1e6 * (span if span is not None else REACH * contact_law.static_penetration(contact))
    return values


def brush_library(sliders: int = SLIDERS) -> str:
    """Return the text of ``behavioral/piezomotor_brush.lib`` with some number of sliders."""
    numbers = range(1, sliders + 1)
    cells = []
    for number in numbers:
        inner = number - 1
        width = f"V(edge)-{inner}" if number == sliders else f"min(1,V(edge)-{inner})"
        w = f"V(w{number})"
        cells += [
            f"Bw{number} w{number} 0 V=max(0,{width})",
            f"Bl{number} l{number} 0 V={{mu*ratio}}*{w}*(V(depth)-{{cell}}*({inner**2}+{w}*({inner}+{w}/3)))",
            f"Bc{number} c{number} 0 V=max(-V(l{number}),min(V(l{number}),V(q{number})))",
            f"Bq{number} 0 q{number} I={w}*V(slip)",
            f"Rpull{number} q{number} c{number} {{1e6*slider_time}}",
            f"Cq{number} q{number} 0 1u",
            f"Rq{number} q{number} 0 1g",
            f"Gheld{number} 0 held c{number} 0 1",
            f"Bslips{number} 0 slips I={w}*u(abs(V(q{number}))-V(l{number}))",
        ]
    return _BRUSH.format(
        sliders=sliders,
        square=sliders**2,
        cells="\n".join(cells),
        pins=" ".join(PINS),
    )


_BRUSH = """\
* SPDX-License-Identifier: GPL-3.0-or-later
* piezomotor_brush: a row of {sliders} friction sliders that slip from the edge inwards, on Hertz normal contact
*
*      rotor      ___|_|_|_|_|_|_|_|___      half of the contact's width, from its centre to its edge, in cells
*                 s s s s s s s s s          of one width; springs without a coupling between them (method of
*      tip       -o-o-o-o-o-o-o-o  o  o      dimensionality reduction). The last cell has no outer end.
*                 1 2 ...    edge -->
*
* The penetration of an element at x is delta - x^2/R*, where that is positive; its normal force is E* per length times
* the penetration, its tangential force G* per length times its displacement u. It slips at
* |u| = mu E*/G* (delta - x^2/R*).
* E*/G* = compliance * normal_stiffness^(2/3); R* cancels. A cell sums its elements: w is the part of it in
* contact, in cells; q the sum of their displacements over w, the voltage of 1 uF that the relative velocity charges
* where they are in contact; l the sum of their limits, mu E*/G* (delta w - cell (b^2 w + b w^2 + w^3/3)), with b the
* inner edge of the cell.
* The normal force, the friction force in gross slip and the stiffness in stick are thus exact for any number of cells.
* A resistor holds q inside +-l with the time constant slider_time, half of the time step (see piezomotor_contact).
* span is the penetration at which the contact reaches the end of cell {sliders}: choose it to cover the contact.
* At a larger penetration the last cell grows.
*
* Written by python -m pyspice_runner.netlist.contact; do not edit.
*
* PIN  x         in     um     tip displacement, tangential
* PIN  y         in     um     tip displacement towards the rotor
* PIN  vx        in     m/s    tip velocity, tangential
* PIN  vy        in     m/s    tip velocity towards the rotor
* PIN  fx        out    N      force on the tip, tangential
* PIN  fy        out    N      force on the tip, towards the rotor (a contact pushes: negative)
* PIN  shaft     inout  rad/s  rotor speed; the contact feeds the torque R F_T, 1 A = 1 N.m
* PIN  normal    out    N      normal force F_N
* PIN  friction  out    N      friction force F_T, positive where it drives the rotor forward
* PIN  slider    out    um     elastic displacement of the innermost cell, which slips last
* PIN  state     out    1      0 separated, 1 stick, 2 gross slip, between them 1 + the part of the contact that slips
*
*      name              unit       default  min   max   meaning
* PAR  normal_stiffness  N/m^1.5    7e9      1e3   1e13  K_N of the Hertz law
* PAR  compliance        m/N^(2/3)  3.3e-7   2.2e-10 1e-2  tangential compliance K_t of tip and rotor together
* PAR  mu                1          0.3      1e-4  5     coefficient of friction
* PAR  radius            m          0.01     1e-4  10    radius of the rotor
* PAR  preload           N          5        1e-6  1e5   static normal force F_0
* PAR  deflection        um         0        0     1e6   static bending of the stator under the preload
* PAR  damping           s/m        0        0     1e6   Hunt-Crossley damping: F_N grows by damping * approach velocity
* PAR  span              um         1.6      1e-9  1e9   penetration that the sliders cover evenly
* PAR  slider_time       s          50n      1e-12 1e-3  time constant that holds the sliders: half of the time step
*
* NEEDS  piezomotor_normal
* SOURCE Popov, Hess, Method of Dimensionality Reduction in Contact Mechanics and Friction, 2015, applied to Hertz
* OMITS  roughness, wear, adhesion, sideways slip in the contact, motion of the rotor's centre
* REVISION 2
* STEP   1/100 of the shortest period of the motion; slider_time is half of it
* TESTED WITH ngspice 39 and 46
*
* USE    the first line of a deck is its title; then:
*   * a tip pressed on a rotor at rest and moved along it at 10 mm/s: partial slip, then gross slip
*   Vx x 0 0
*   Vy y 0 0
*   Vvx vx 0 0.01
*   Vvy vy 0 0
*   Vshaft shaft 0 0
*   Xcontact {pins} piezomotor_brush mu=0.25 preload=4
*   .tran 100n 100u 0 100n uic
*   .measure tran friction_end_n FIND v(friction) AT=99u
*   .measure tran state_end FIND v(state) AT=99u
* END USE
*
.subckt piezomotor_brush {pins} normal_stiffness=7e9 compliance=3.3e-7 mu=0.3 radius=0.01 preload=5 deflection=0 \
damping=0 span=1.6 slider_time=50n
.param ratio={{compliance*normal_stiffness**(2/3)}}
.param cell={{span/{square}}}
.param spring={{1.5e-9*normal_stiffness*cell**0.5/ratio}}
* normal contact, and the relative velocity as the voltage of slip
Xnormal x y vx vy fx fy shaft normal friction delta factor slip piezomotor_normal \
normal_stiffness={{normal_stiffness}} radius={{radius}} preload={{preload}} deflection={{deflection}} \
damping={{damping}}
Rslip slip 0 1
* the edge of the contact, in cells, with a least penetration, so that the root is smooth
Bdepth depth 0 V=max(V(delta),1e-9)
Bedge edge 0 V=sqrt(max(V(delta),1e-9)/{{cell}})
* cells, from the centre outwards: w, l, q held inside +-l, q; their sums, and the number of those that slip
{cells}
Rheld held 0 1
Rslips slips 0 1
* in gross slip the sum is mu ratio depth edge 2/3, and the friction force mu F_N
Bfriction friction 0 V={{spring}}*V(factor)*V(held)
* for plotting only
Bslider slider 0 V=V(c1)/max(V(w1),1e-6)
Bstate state 0 V=u(V(delta))*(1+V(slips)/V(edge))
.ends piezomotor_brush
"""


if __name__ == "__main__":
    target = data_path("behavioral") / f"{LIBRARIES['brush']}.lib"
    target.write_text(brush_library(), encoding="utf-8", newline="\n")
    sys.stdout.write(f"{target}\n")
