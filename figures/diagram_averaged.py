# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor: complex amplitudes of the modes, and the contact at the phases of one period."""

from __future__ import annotations

from pathlib import Path

from diagram import CONTACT, GROUP_A, MODE, MOUNT, Sheet, rotor
from style import main

MOTOR = "piezomotor_averaged"
CAPTION = (
    "Names that end in _re and _im are real and imaginary part of an amplitude at a harmonic of the drive; a line "
    "from a pin stands for both. There is one block of the modes for each mode and harmonic, one of the contact "
    "for each phase. Groups and modes read frequency and temperature and add to heat."
)


def resonator(sheet: Sheet) -> None:
    """Draw the pins, the groups, the modes and the static bending."""
    pins = {"a_re a_im": 8.6, "b_re b_im": 8.0, "frequency": 3.2, "temperature": 2.65, "heat": 2.1}
    for name, y in pins.items():
        sheet.pin((2.5, y))
        sheet.node(MOTOR, name, (2.3, y), ha="right", fontsize=7)
        sheet.wire((2.6, y), (3.6, y))
    for x, start, end in ((3.15, 8.6, 5.9), (2.9, 8.0, 5.3)):
        sheet.wire((x, start), (x, end), (3.6, end))
        sheet.joint((x, start))
    common = {"frequency": 7.4, "temperature": 7.95, "heat": 8.5}
    sheet.box(f"{MOTOR}_group", 3.6, 8.2, 7.0, 9.4, GROUP_A, west={"p_re p_im": 8.6}, east=common)
    sheet.note("groups A, B", (4.9, 7.5), fontweight="bold")
    sheet.box(
        f"{MOTOR}_mode", 3.6, 8.2, 1.8, 6.5, MODE,
        west={"a_re a_im": 5.9, "b_re b_im": 5.3, "frequency": 3.2, "temperature": 2.65, "heat": 2.1},
        east={"fx_re fx_im": 5.9, "fy_re fy_im": 5.3, "x_re x_im": 4.4, "y_re y_im": 3.8},
    )  # fmt: skip
    sheet.note("modes,\nharmonics\n1 … H", (7.05, 2.6), fontweight="bold", linespacing=1.2)
    sheet.box(f"{MOTOR}_bending", 3.6, 8.2, 0.1, 1.5, MODE, east={"x y": 1.1, "fx fy": 0.5})
    sheet.note("static bending", (5.4, 0.8), fontweight="bold")


def harmonics(sheet: Sheet) -> None:
    """Draw the change between harmonics and phases, the mount and the check."""
    sheet.block((9.1, 5.0), (4.1, 1.4), CONTACT)
    sheet.note("$F_h = \\frac{2}{N}\\,\\sum_n F(\\theta_n)\\,e^{-jh\\theta_n}$", (11.15, 5.7), fontsize=9)
    sheet.block((10.2, 3.3), (3.0, 1.4), CONTACT)
    sheet.note("$\\mathrm{Re}\\,\\sum_h X_h\\,e^{jh\\theta_n}$", (11.7, 4.0), fontsize=9)
    for points in (
        [(9.1, 5.9), (8.2, 5.9)],
        [(9.1, 5.3), (8.2, 5.3)],
        [(8.2, 4.4), (10.2, 4.4)],
        [(8.2, 3.8), (10.2, 3.8)],
        [(14.6, 5.7), (13.2, 5.7)],
        [(13.2, 4.0), (14.6, 4.0)],
        [(9.4, 5.0), (9.4, 0.5), (8.2, 0.5)],
        [(9.4, 0.5), (10.2, 0.5)],
        [(8.2, 1.1), (10.2, 1.1)],
        [(13.2, 1.1), (13.7, 1.1), (13.7, 2.8), (11.7, 2.8), (11.7, 3.3)],
        [(11.15, 6.4), (11.15, 7.0)],
    ):
        sheet.flow(*points)
    sheet.joint((9.4, 0.5))
    sheet.note("mean", (9.25, 2.6), rotation=90, fontsize=7)
    sheet.box(
        "piezomotor_mount", 10.2, 13.2, 0.1, 2.4, MOUNT,
        west={"y": 1.1, "fy": 0.5, "vy": 1.7}, east={"contact_y": 1.1, "contact_vy": 1.7},
    )  # fmt: skip
    sheet.note("mount", (11.9, 2.15), fontweight="bold")
    sheet.box(
        f"{MOTOR}_check", 8.9, 13.4, 7.0, 9.4, MODE,
        west={"fx_re fx_im": 8.6, "fy_re fy_im": 8.0, "frequency": 7.4}, east={"x_re x_im": 8.6, "y_re y_im": 8.0},
    )  # fmt: skip
    sheet.note("check", (12.3, 7.4), fontweight="bold")


def contact(sheet: Sheet) -> None:
    """Draw the contact at the phases, and the rotor."""
    phase = f"{MOTOR}_phase"
    for shift in (0.4, 0.2):
        sheet.block((14.6 + shift, 0.1 + shift), (4.3, 8.2), CONTACT, fc="#FBEDE4")
    sheet.block((14.6, 0.1), (4.3, 8.2), CONTACT, fc="#FBEDE4")
    sheet.box(
        phase, 14.6, 18.9, 0.1, 8.3, CONTACT,
        west={"slider_before": 7.2, "normal_before": 6.75, "normal_earlier": 6.3, "fx fy": 5.7, "x y": 4.0,
              "x_before y_before": 3.4, "x_after y_after": 2.8, "turn": 1.6, "rate": 1.0},
        east={"slider": 7.2, "normal": 6.3, "friction": 5.7, "motion bound": 1.6, "open slip": 1.0},
    )  # fmt: skip
    sheet.note("contact, phase n", (16.75, 7.85), fontweight="bold")
    sheet.flow((18.9, 7.2), (19.9, 7.2), (19.9, 9.4), (14.0, 9.4), (14.0, 7.2), (14.6, 7.2))
    sheet.note("to the next phase or period", (16.95, 9.0), fontsize=7)
    sheet.flow((18.9, 5.7), (20.2, 5.7))
    sheet.wire((20.2, 5.7), (21.05, 5.7))
    rotor(sheet, 0.5, 5.0, 5.7)


def sheet() -> Sheet:
    """Return the diagram."""
    drawn = Sheet(9.6)
    resonator(drawn)
    harmonics(drawn)
    contact(drawn)
    return drawn


def draw(folder: Path) -> list[str]:
    return sheet().write(folder / "diagram_averaged.png", "The averaged motor", CAPTION)


if __name__ == "__main__":
    main(draw, __doc__)
