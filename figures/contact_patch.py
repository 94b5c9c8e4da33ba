# SPDX-License-Identifier: GPL-3.0-or-later
"""Pressure, traction and displacements in the contact of tip and rotor versus the tangential force.

The closed forms of Hertz, Cattaneo and Mindlin: a ring slips, from the edge inwards, while the centre sticks.
"""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, canvas, main, motor_words, write

import pyspice_runner as pr
from tools.benches.traction import HertzPatch, virgin_force

TIP, ROTOR = (370e9, 0.22), (206e9, 0.30)  # Young's modulus (Pa) and Poisson's ratio, as assumed in andersen2002
TIP_RADIUS = 5e-3  # m
SHARES = {0.25: BLUE, 0.5: GREEN, 0.75: ORANGE, 0.9: PURPLE, 1.0: VERMILION}


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    modulus = 1.0 / sum((1.0 - nu**2) / youngs for youngs, nu in (TIP, ROTOR))
    radius = 1.0 / (1.0 / TIP_RADIUS + 1.0 / motor.rotor.radius_m)
    contact = motor.contact
    patch = HertzPatch(
        force_n=contact.preload_n, friction=contact.friction, effective_modulus_pa=modulus, effective_radius_m=radius
    )
    stiffness = contact.preload_n / patch.penetration_m**1.5
    assert abs(stiffness / contact.normal_stiffness_n_per_m15 - 1.0) < 1e-9  # the same contact

    figure, axes = canvas(2, 2, 7.2)
    a = patch.radius_m
    r = np.linspace(-1.6 * a, 1.6 * a, 1201)
    axes[0, 0].plot(1e6 * r, 1e-9 * patch.pressure(np.abs(r)), color=BLACK, label="pressure p")
    friction = 1e-9 * contact.friction * patch.pressure(np.abs(r))
    for axis in axes[0]:
        axis.plot(1e6 * r, friction, "--", color=BLACK, label="μ p", zorder=5)
    axes[0, 0].plot([], [], color=GREY, label="traction q")
    limit = contact.friction * contact.preload_n
    for share, colour in SHARES.items():
        q = 1e-9 * patch.traction(np.abs(r), share * limit)
        axes[0, 0].plot(1e6 * r, q, color=colour)
        axes[0, 1].plot(1e6 * r, q, color=colour, label=f"$F_T$ = {share:g} μ$F_N$")
        stick = patch.stick_radius(share * limit)
        if stick > 0.0:
            for axis in axes[:, 1]:
                axis.axvspan(-1e6 * stick, 1e6 * stick, ymax=0.03, color=colour, lw=0)
        along, _ = patch.tangential_displacement(r, 0.0 * r, share * limit, youngs_modulus_pa=TIP[0], poisson=TIP[1])
        axes[1, 1].plot(1e6 * r, 1e9 * along, color=colour)
    axes[0, 0].set(title="(a) pressure and traction", xlabel="x / µm", ylabel="stress / GPa")
    axes[0, 0].legend(loc="upper right")
    axes[0, 1].set(title="(b) traction: where it is μ p, it slips", xlabel="x / µm", ylabel="traction / GPa")
    axes[0, 1].set_ylim(0.0, 1.45e-9 * contact.friction * patch.peak_pressure_pa)
    axes[0, 1].legend(loc="upper center", ncols=2, fontsize=7)
    axes[1, 1].set(
        title="(d) displacement of the tip's surface: flat in stick",
        xlabel="x / µm",
        ylabel="$u_x$ / nm",
        ylim=(0, None),
    )

    moved = 1.0 - np.linspace(1.0, 0.0, 400) ** 2
    axes[1, 0].plot(moved, virgin_force(moved), color=BLACK, label="$F_T$/μ$F_N$, the law of the spring")
    axes[1, 0].plot(moved, np.sqrt(1.0 - moved), "-.", color=GREY, label="radius that sticks, c/a")
    for share, colour in SHARES.items():
        stick = patch.stick_radius(share * limit) / a
        axes[1, 0].plot([1.0 - stick**2] * 2, [share, stick], "o", color=colour, ms=5)
    axes[1, 0].set(
        title="(c) both versus the displacement",
        xlabel="displacement / its limit $u_{\\mathrm{lim}}$",
        ylim=(0.0, 1.05),
    )
    axes[1, 0].legend(loc="lower center")
    caption = (
        f"{motor_words(motor)} Tip of alumina, {1e3 * TIP_RADIUS:g} mm, on a rotor of steel, "
        f"{1e3 * motor.rotor.radius_m:g} mm: the contact has a radius of {1e6 * a:.1f} µm and is pressed in by "
        f"{1e9 * patch.penetration_m:.0f} nm. Bars along the axes of (b) and (d): the circle that sticks. Closed forms "
        "of Hertz, Cattaneo and Mindlin; the tests integrate Boussinesq's and Cerruti's solutions to hold them."
    )
    write(figure, folder / "contact_patch.png", "The contact slips from its edge inwards", caption)
    mean, peak = contact.preload_n / (pi * a**2), patch.peak_pressure_pa
    return [
        f"radius {1e6 * a:.1f} µm, pressure {1e-9 * mean:.2f} GPa on average, {1e-9 * peak:.2f} GPa in the middle",
        f"at half of the maximum friction a circle of {100 * (0.5 ** (1 / 3)):.0f} % of the radius still sticks",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
