# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor with each contact law: speed–torque curves with eq. (1) and eq. (2), and the distribution of the power."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr

LAWS = {"spring-slider": (ORANGE, "-"), "coulomb": (GREEN, "--"), "brush": (BLUE, "-")}
DRIVES = {
    "(a) two tones": (
        pr.TwoToneDrive(voltage_1=100.0, frequency_1=18e3, voltage_2=50.0, frequency_2=54e3, phase_deg=165.0),
        np.array([0.0, 8.0]) if draft() else np.linspace(-4.0, 12.0, 5),
    ),
    "(b) two phases": (
        pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3),
        np.array([0.0, 4.0]) if draft() else np.linspace(-2.0, 4.0, 4),
    ),
}
SLIDERS = 2 if draft() else 8
RUN = {"tolerance": 0.1} if draft() else {}
LOSSES = {"friction_loss_w": (VERMILION, "friction"), "damping_loss_w": (PURPLE, "modes"),
          "dielectric_loss_w": (GREY, "dielectric")}  # fmt: skip


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002").updated({"mount": None})  # as docs/contact.md, whose reference has no mount
    figure, axes = canvas(2, 2, 6.6)
    said = []
    for column, (title, (drive, speeds)) in enumerate(DRIVES.items()):
        curves = {
            law: pr.speed_torque(
                motor, drive, speeds=speeds, contact=pr.Law(law, SLIDERS if law == "brush" else None), **RUN
            )
            for law in LAWS
        }
        torque, losses = axes[:, column]
        for law, (colour, style) in LAWS.items():
            torque.plot(speeds, 1e3 * curves[law]["torque_n_m"], style, color=colour, marker="o", ms=3, label=law)
        torque.axhline(0.0, color=GREY, lw=0.8)
        torque.axvline(0.0, color=GREY, lw=0.8)
        torque.set(title=title, xlabel="speed / (rad/s)", ylabel="torque / (mN·m)")
        torque.legend()
        at_stall = {law: curve.sel(speed_rad_s=0.0) for law, curve in curves.items()}
        bottom = np.zeros(len(LAWS))
        for name, (colour, label) in LOSSES.items():
            heights = np.array([float(found[name]) for found in at_stall.values()])
            losses.bar(list(LAWS), heights, 0.6, bottom=bottom, color=colour, label=label)
            bottom += heights
        losses.set(
            title=f"({'cd'[column]}) {title[4:]}: losses at stall", ylabel="power / W", ylim=(0.0, 1.25 * bottom.max())
        )
        losses.grid(visible=False, axis="x")
        losses.legend(ncols=3, loc="upper center", fontsize=7, columnspacing=1.0, handlelength=1.0)
        for law, curve in curves.items():
            if not curve["settled"].all():
                raise pr.SimulationError(f"{title}, {law}: not every point has settled.")
            falling = np.argsort(curve["torque_n_m"].values)
            no_load = np.interp(0.0, curve["torque_n_m"].values[falling], speeds[falling])
            said.append(
                f"{title[4:]}, {law}: stall torque {1e6 * float(at_stall[law]['torque_n_m']):.0f} µN·m, "
                f"no-load speed {no_load:.2f} rad/s"
            )
    words = ", ".join(f"{title}: {drive_words(drive)}" for title, (drive, _) in DRIVES.items())
    caption = (
        f"{motor_words(motor)} Means over periods once settled; {words}. Brush of {SLIDERS} sliders: what slips in "
        "part makes the motor weaker than the paper's spring and slider do. Without a tangential spring (coulomb) two "
        "tones turn the rotor the other way, and two phases hardly turn it. ngspice."
    )
    write(figure, folder / "contact_laws.png", "What the contact law does to the motor", caption)
    return said


if __name__ == "__main__":
    main(draw, __doc__)
