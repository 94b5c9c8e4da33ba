# SPDX-License-Identifier: GPL-3.0-or-later
"""Oblique impact of a sphere on a half-space: rebound with three contact laws, exact solution, and measurements.

The exact solution is that of Maw, Barber and Fawcett's problem by a row of a thousand elements
(tests/reference/row.py); the measurements are those of Kharaz, Gorham and Salman.
"""

from __future__ import annotations

import csv
from math import cos, radians, sin, tan
from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREEN, GREY, HERE, ORANGE, PURPLE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr
from validation.impact import Throw, impact

DATA = HERE.parent / "tests" / "data"
LAWS = {"spring-slider": (ORANGE, "-", "spring-slider (paper)"), "coulomb": (GREEN, "--", "Coulomb, no spring"),
        "brush": (BLUE, "-", "brush of 8 sliders")}  # fmt: skip
POISSON = 0.3
STEPS = 500  # of an impact: the error of ψ₂ is some 3e-5
EVERY = 8 if draft() else 2  # point of the table
BETWEEN = (1.0, 6.0, 7.5, 12.0, 14.5, 17.0, 22.5, 26.0, 33.0)  # degrees, further angles
SPEED = 3.9  # m/s, of the measurements


def rebounds(law: str, poisson: float, psis: np.ndarray, sliders: int | None = None) -> np.ndarray:
    throws = (Throw(psi=psi, poisson=poisson) for psi in psis.tolist())
    return np.array([impact(throw, pr.Law(law, sliders), steps=STEPS).psi_2 for throw in throws])


def measured() -> np.ndarray:
    lines = (DATA / "kharaz_2001.csv").read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return np.array([(float(row["angle"]), float(row["value"])) for row in rows if row["quantity"] == "restitution"])


def restitution(law: str, angle: float) -> float:
    """Tangential velocity of the centre after over before: Al₂O₃, 5 mm, on glass."""
    turned = radians(angle)
    common = {
        "velocity_m_s": SPEED * cos(turned), "friction": 0.092, "restitution": 0.98, "radius_m": 2.5e-3,
        "density_kg_m3": 4000.0, "youngs_modulus_pa": 380e9, "poisson": 0.23,
        "half_space_youngs_modulus_pa": 70e9, "half_space_poisson": 0.25,
    }  # fmt: skip
    throw = Throw(psi=tan(turned) / Throw(**common).limit_ratio, **common)
    return impact(throw, law, steps=STEPS).centre_velocity_m_s / (SPEED * sin(turned))


def draw(folder: Path) -> list[str]:
    table = np.genfromtxt(DATA / "oblique_impact.csv", delimiter=",", names=True)
    psis, exact = table["psi_1"], table[f"psi_2_poisson_{POISSON:g}".replace(".", "")]
    chosen = np.arange(0, len(psis), EVERY)
    figure, axes = canvas(3, 1, 9.4, height_ratios=(1.2, 1.0, 1.1))
    worst = {}
    axes[0].plot(psis, exact, color=BLACK, lw=4.0, alpha=0.25, label="exact (1000 elements)")
    asymptote = psis - 14.0 * (1.0 - POISSON) / (2.0 - POISSON)
    axes[0].plot(psis[asymptote > -2], asymptote[asymptote > -2], ":", color=GREY, label="slips throughout")
    for law, (colour, style, label) in LAWS.items():
        found = rebounds(law, POISSON, psis[chosen])
        worst[law] = np.abs(found - exact[chosen]).max()
        axes[0].plot(
            psis[chosen], found, style, color=colour, label=label, marker="o" if law == "brush" else None, ms=3
        )
        if law != "coulomb":
            axes[1].semilogy(psis[chosen], np.abs(found - exact[chosen]) + 1e-6, style, color=colour, label=label)
    axes[0].axvline(1.0, color=GREY, lw=0.8)
    axes[0].annotate("starts in stick  ", (1.0, -2.0), ha="right", fontsize=7, color="#555555")
    axes[0].annotate("  starts in slip", (1.0, -2.0), fontsize=7, color="#555555")
    axes[0].set(title=f"(a) rebound over incidence, ν = {POISSON:g}", xlabel="ψ₁", ylabel="ψ₂", xlim=(0.0, 7.0))
    axes[0].legend(loc="lower right")
    for sliders, colour in ((4, PURPLE), (16, VERMILION)):
        found = rebounds("brush", POISSON, psis[chosen], sliders)
        axes[1].semilogy(
            psis[chosen], np.abs(found - exact[chosen]) + 1e-6, color=colour, label=f"brush of {sliders} sliders"
        )
    axes[1].set(title="(b) how far from exact", xlabel="ψ₁", ylabel="|error of ψ₂|", xlim=(0.0, 7.0), ylim=(1e-5, 2.0))
    axes[1].legend(loc="upper right")

    points = measured()
    angles = np.array(sorted([*BETWEEN, *points[:, 0]]))
    axes[2].plot(*points.T, "s", color=BLACK, mfc="white", ms=5, label="measured, Kharaz et al. 2001")
    errors = {}
    for law, (colour, style, label) in LAWS.items():
        found = np.array([restitution(law, angle) for angle in angles])
        axes[2].plot(angles, found, style, color=colour, label=label)
        errors[law] = np.sqrt(np.mean((found[np.searchsorted(angles, points[:, 0])] - points[:, 1]) ** 2))
    axes[2].set(
        title="(c) alumina on glass at 3.9 m/s: tangential velocity of the centre, after over before",
        xlabel="angle of incidence from the normal / °", ylabel="ratio", xlim=(0.0, 90.0),
    )  # fmt: skip
    axes[2].legend(loc="lower right")
    caption = (
        "ψ = v_t/(κ v_n) of the contact patch, κ = μ E*/G*; solid sphere. (a), (b): sphere and half-space of one "
        "material. (c): A. H. Kharaz, D. A. Gorham, A. D. Salman, Powder Technology 120 (2001) 281, as read from their "
        "graphs by the authors of Lethe and of Kratos; 5 mm, 380 GPa on 70 GPa, μ 0.092, normal restitution 0.98. "
        f"Impacts in ngspice, {STEPS} steps each."
    )
    write(figure, folder / "rebound.png", "Oblique impact: partial slip decides the rebound", caption)
    return [
        f"largest error of ψ₂ at ν = {POISSON:g}: " + ", ".join(f"{law} {error:.3f}" for law, error in worst.items()),
        "off Kharaz's measurements (RMS of the ratio): "
        + ", ".join(f"{law} {error:.3f}" for law, error in errors.items()),
    ]


if __name__ == "__main__":
    main(draw, __doc__)
