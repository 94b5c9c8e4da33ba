# SPDX-License-Identifier: GPL-3.0-or-later
"""The laws of the contact: which library stands for each, and what values an instance of it takes.

``spring-slider`` is the paper's, ``brush`` a row of sliders that slip one after the other (partial slip), ``coulomb``
friction that follows the velocity, without a spring. All have the same pins. ``behavioral/piezomotor_brush.lib`` is
written by :func:`brush_library`: ``python -m pyspice_runner.netlist.contact``; a test proves it fresh.
"""

from __future__ import annotations

import sys
from typing import Literal, get_args

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.parameters import Contact
from pyspice_runner.netlist.library import Library, data_path, parse_library, read_library

ContactLaw = Literal["spring-slider", "brush", "coulomb"]
LIBRARIES: dict[ContactLaw, str] = {
    "spring-slider": "piezomotor_contact",
    "brush": "piezomotor_brush",
    "coulomb": "piezomotor_coulomb",
}
PINS = ("x", "y", "vx", "vy", "fx", "fy", "shaft", "normal", "friction", "slider", "state")
SLIDERS = 8
MOST_SLIDERS = 200
REACH = 4.0  # penetration over the static one that the sliders of a motor's brush cover evenly: eight times its force


def check_law(contact: str | None, *, free: bool = True) -> None:
    """Refuse what is not a law; ``None``, a free tip, only where there may be one.

    Raises:
        ParameterError: naming the laws.
    """
    if contact in get_args(ContactLaw) or (free and contact is None):
        return
    *laws, last = (*(repr(law) for law in get_args(ContactLaw)), *(["None (free tip)"] if free else []))
    raise ParameterError(f"contact = {contact!r} is refused; allowed are {', '.join(laws)} and {last}.")


def contact_library(law: ContactLaw, sliders: int = SLIDERS) -> Library:
    """Return the library of a law; the brush is written for the number of sliders asked for.

    Raises:
        ParameterError: for a number of sliders that is refused.
    """
    if sliders not in range(1, MOST_SLIDERS + 1):
        raise ParameterError(f"sliders = {sliders} is refused; allowed is a whole number from 1 to {MOST_SLIDERS}.")
    name = LIBRARIES[law]
    if law == "brush" and sliders != SLIDERS:
        return parse_library(name, brush_library(int(sliders)))
    return read_library(name)


def contact_values(
    law: ContactLaw,
    contact: Contact,
    *,
    radius: float,
    preload: float,
    deflection: float = 0.0,
    slider_time: float | None = None,
    span: float | None = None,
) -> dict[str, float]:
    """Return what an instance of a law's subcircuit takes, in the library's units.

    Args:
        law: the law.
        contact: constants of the contact.
        radius: of the rotor, m.
        preload: static normal force, N.
        deflection: static bending under the preload, m.
        slider_time: time constant of the pull that holds a slider, s; by default the library's.
        span: penetration in m that the brush's sliders cover evenly; by default :data:`REACH` times the static one.
    """
    values = {
        "normal_stiffness": contact.normal_stiffness_n_per_m15,
        "mu": contact.friction,
        "radius": radius,
        "preload": preload,
        "deflection": 1e6 * deflection,
    }
    damping = contact_law.normal_damping(contact)
    if damping:
        values["damping"] = damping
    if law != "coulomb":
        values["compliance"] = contact_law.total_compliance(contact)
        if slider_time is not None:
            values["slider_time"] = slider_time
    if law == "brush":
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
* piezomotor_brush: Hertz normal contact and a row of {sliders} friction sliders, which slip from the edge inwards
*
*      rotor      ___|_|_|_|_|_|_|_|___      half of the contact's width, from its centre to its edge, in cells
*                 s s s s s s s s s          of one width; springs without a coupling between them (method of
*      tip       -o-o-o-o-o-o-o-o  o  o      dimensionality reduction). The last cell reaches on without an end.
*                 1 2 ...    edge -->
*
* An element at x is pressed in by delta - x^2/R*, where that is positive, and carries E* per length of that as
* normal force and G* per length of its tangential displacement u; it slips at |u| = mu E*/G* (delta - x^2/R*).
* E*/G* = compliance * normal_stiffness^(2/3); R* drops out. A cell adds up its elements: w is the part of it that
* touches, in cells; q the sum of their displacements over w, the voltage of 1 uF that the relative velocity charges
* where they touch; l the sum of their limits, mu E*/G* (delta w - cell (b^2 w + b w^2 + w^3/3)) with b its inner edge.
* So the normal force, the friction force in gross slip and the stiffness in stick are exact for any number of cells.
* q is held inside +-l by a one-sided pull with the time constant slider_time, half of the time step (see
* piezomotor_contact). Spread the cells over the contact: span is the penetration at which it reaches the end of
* cell {sliders}; where it goes beyond, the last cell grows.
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
* PIN  slider    out    um     elastic displacement of the innermost cell, the last to slip
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
* PAR  slider_time       s          50n      1e-12 1e-3  time constant of the pull that holds the sliders
*
* SOURCE Popov, Hess, Method of Dimensionality Reduction in Contact Mechanics and Friction, 2015, applied to Hertz
* OMITS  roughness, wear, adhesion, sideways slip in the contact, motion of the rotor's centre
* TESTED WITH ngspice 39
*
* USE
*   * a tip pressed and dragged at 10 mm/s along a rotor that stands still: partial slip, then gross slip
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
.param seat={{1e6*(preload/normal_stiffness)**(2/3)+deflection}}
.param radius_um={{1e6*radius}}
.param ratio={{compliance*normal_stiffness**(2/3)}}
.param cell={{span/{square}}}
.param spring={{1.5e-9*normal_stiffness*cell**0.5/ratio}}
* geometry in um: delta (2 R - delta) = sigma (2 R - sigma) - x^2, of which Newton's iteration finds the small root;
* sine and versine (1 - cosine) of the angle by which the contact lies off the crown of the rotor
Vseat sigma y {{seat}}
Bdelta delta 0 V=V(sigma)+{{0.5/radius_um}}*(V(delta)*V(delta)-V(sigma)*V(sigma)-V(x)*V(x))
Bsine sine 0 V=V(x)/({{radius_um}}-V(delta))
Bversine versine 0 V=0.5*(V(sine)*V(sine)+V(versine)*V(versine))
* normal force: Hertz's, times 1 + damping * approach velocity
Belastic elastic 0 V={{normal_stiffness*1e-9}}*uramp(V(delta))**1.5
Bhold hold 0 V=uramp(1+{{damping}}*(V(vy)-V(vx)*V(sine)-V(vy)*V(versine)))
Bnormal normal 0 V=V(elastic)*V(hold)
* the edge of the contact, in cells, with a floor under the penetration that keeps the root smooth
Bdepth depth 0 V=max(V(delta),1e-9)
Bedge edge 0 V=sqrt(max(V(delta),1e-9)/{{cell}})
* relative velocity
Gtip 0 slip vx 0 1
Grotor slip 0 shaft 0 {{radius}}
Bturn 0 slip I=V(vy)*V(sine)-V(vx)*V(versine)
Rslip slip 0 1
* cells, from the centre outwards: w, l, q held inside +-l, q; their sums, and the number of those that slip
{cells}
Rheld held 0 1
Rslips slips 0 1
* in gross slip the sum is mu ratio depth edge 2/3, and the friction force mu F_N
Bfriction friction 0 V={{spring}}*V(hold)*V(held)
* forces on the tip and torque on the rotor
Bfx fx 0 V=V(normal)*V(sine)-V(friction)+V(friction)*V(versine)
Bfy fy 0 V=V(normal)*V(versine)-V(normal)-V(friction)*V(sine)
Gtorque 0 shaft friction 0 {{radius}}
* for the eye only: nothing depends on these
Bslider slider 0 V=V(c1)/max(V(w1),1e-6)
Bstate state 0 V=u(V(delta))*(1+V(slips)/V(edge))
.ends piezomotor_brush
"""


if __name__ == "__main__":
    target = data_path("behavioral") / f"{LIBRARIES['brush']}.lib"
    target.write_text(brush_library(), encoding="utf-8", newline="\n")
    sys.stdout.write(f"{target}\n")
