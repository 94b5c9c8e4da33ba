# SPDX-License-Identifier: GPL-3.0-or-later
"""A tip that moves back and forth along a rotor at rest: loops of the contact laws, and the energy lost in a cycle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, canvas, draft, main, motor_words, write

import pyspice_runner as pr
from tools.benches.hysteresis import hysteresis
from tools.benches.traction import microslip_loss, virgin_force

LAWS = {"spring-slider": (ORANGE, "-"), "coulomb": (GREEN, "--"), "brush": (BLUE, "-")}
AMPLITUDE = 0.8
SWING = 0.6


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    slide = motor.contact.friction * motor.contact.preload_n
    figure, axes = canvas(2, 2, 7.4)
    for law, (colour, style) in LAWS.items():
        run = hysteresis(motor, AMPLITUDE, law)
        axes[0, 0].plot(run.displacement_m / run.limit_m, run.friction_force_n / slide, style, color=colour, label=law)
    u = np.linspace(0.0, AMPLITUDE, 100)
    turned = AMPLITUDE - 2.0 * u
    down = virgin_force(AMPLITUDE) - 2.0 * virgin_force(u)
    for x, f in ((u, virgin_force(u)), (turned, down), (-turned, -down)):
        axes[0, 0].plot(x, f, color=BLACK, lw=4.0, alpha=0.25)
    axes[0, 0].plot([], [], color=BLACK, lw=4.0, alpha=0.25, label="Mindlin, exact")
    axes[0, 0].set(title="(a) constant normal force")
    for axis, phase in ((axes[0, 1], 0.0), (axes[1, 0], 180.0)):
        for law in ("spring-slider", "brush"):
            run = hysteresis(motor, AMPLITUDE, law, swing=SWING, phase_deg=phase, harmonic=2)
            cycle = run.time_s >= 1e-3 * (1.0 - 1e-9)
            loss = f"{1e6 * run.loss_j:+.3f}".replace("-", "−")
            label = f"{law}: {loss} µJ a cycle"
            axis.plot(
                run.displacement_m[cycle] / run.limit_m, run.friction_force_n[cycle] / slide,
                color=LAWS[law][0], label=label,
            )  # fmt: skip
    axes[0, 1].set(title=f"(b) $F_N$ swings by {100 * SWING:g} %, twice a cycle")
    axes[1, 0].set(title="(c) the same, in opposite phase")
    for axis in (axes[0, 0], axes[0, 1], axes[1, 0]):
        axis.set(xlabel="displacement / $u_{\\mathrm{lim}}$", ylabel="$F_T$ / μ$F_0$")
        axis.legend(loc="upper left", fontsize=7)
        axis.set_ylim(-1.6, 2.1)

    amplitudes = np.append(np.geomspace(0.05, 1.0, 2 if draft() else 13), (1.5,) if draft() else (1.2, 1.5, 2.0))
    fine = np.geomspace(0.05, 2.0, 200)
    axes[1, 1].loglog(fine, microslip_loss(fine), color=BLACK, lw=4.0, alpha=0.25, label="Mindlin, exact")
    relative = {}
    for sliders, colour in ((4, PURPLE), (8, BLUE), (16, VERMILION)):
        runs = [hysteresis(motor, amplitude, pr.Law("brush", sliders)) for amplitude in amplitudes.tolist()]
        losses = np.array([run.loss_j / (slide * run.limit_m) for run in runs])
        lost = losses > 1e-6
        axes[1, 1].loglog(amplitudes[lost], losses[lost], "o-", color=colour, ms=3, lw=0.9, label=f"{sliders} sliders")
        relative[sliders] = np.abs(losses - microslip_loss(amplitudes))[amplitudes <= 1.0].max() / 0.8
    slips = amplitudes[amplitudes > 1.02]
    axes[1, 1].loglog(slips, 4.0 * (slips - 1.0), color=ORANGE, label="spring-slider")
    axes[1, 1].axvline(1.0, color=GREY, lw=0.8)
    axes[1, 1].set(
        title="(d) loss per cycle", xlabel="amplitude / $u_{\\mathrm{lim}}$", ylabel="loss / μ$F_0 u_{\\mathrm{lim}}$"
    )
    axes[1, 1].set_ylim(3e-5, 10.0)
    axes[1, 1].legend(loc="lower right", fontsize=7)
    full = 0.8 * slide * hysteresis(motor, 1.0, "brush").limit_m
    caption = (
        f"{motor_words(motor)} Amplitude of (a) to (c): {AMPLITUDE:g} of the limit of stick u_lim. The paper's "
        "spring, whose stiffness follows the normal force, loses too little in (b) and delivers energy in (c). "
        f"A full swing to ±u_lim costs {1e6 * full:.2f}\N{NO-BREAK SPACE}µJ. A brush loses nothing below the "
        "amplitude at which its outermost slider slips; more sliders follow Mindlin's cube farther down. ngspice."
    )
    write(figure, folder / "hysteresis.png", "A contact loses energy while it still sticks", caption)
    return [
        "largest error of the loss up to u_lim, of that of a full swing: "
        + ", ".join(f"{100 * error:.1f} % with {sliders} sliders" for sliders, error in relative.items()),
        f"a full swing costs {1e6 * full:.2f} µJ, {1e3 * full * 51.7e3:.0f} mW at 51.7 kHz",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
