# SPDX-License-Identifier: GPL-3.0-or-later
"""Admittance of the motor with both groups in phase (A+B) and against each other (A−B), free and preloaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from style import BLACK, BLUE, VERMILLION, canvas, main, write

import pyspice_runner as pr

COLOURS = {"free": BLUE, "preloaded": VERMILLION}
MARKS = {"fs": "o", "fm": "^", "fn": "v"}
CONNECTIONS = {"A+B": (10e3, 22e3, "A+B drives mode 1, towards the rotor"),
               "A-B": (46e3, 62e3, "A−B drives mode 2, along the rotor")}  # fmt: skip
POINTS = 3000


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    figure, axes = canvas(3, 2, 8.6, height_ratios=(1.0, 0.8, 1.25))
    lines = []
    for column, (connection, (start, stop, title)) in zip(axes.T, CONNECTIONS.items(), strict=True):
        found = {}
        for state in COLOURS:
            spectrum = pr.admittance(motor, start=start, stop=stop, points=POINTS, state=state)
            (found[state],) = spectrum.resonances[connection]
            _draw_spectrum(column, spectrum, connection, found[state])
        column[0].set(title=title, ylabel="|Y| / mS", yscale="log")
        column[0].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        column[0].yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        column[0].yaxis.set_minor_locator(NullLocator())
        column[1].set(xlabel="frequency / kHz", ylabel="phase of Y / °", ylim=(-50, 100), yticks=range(-45, 91, 45))
        column[0].sharex(column[1])
        column[1].set(xlim=(start / 1e3, stop / 1e3), xticks=np.arange(start, stop + 1, 2e3) / 1e3)
        column[0].tick_params(labelbottom=False)
        column[2].set(xlabel="conductance G / mS", ylabel="susceptance B / mS", aspect="equal", adjustable="datalim")
        shift = found["preloaded"].fs / found["free"].fs - 1.0
        lines.append(
            f"{found['free'].mode} stands at {found['free'].fs / 1e3:.2f} kHz free and {found['preloaded'].fs / 1e3:.2f} kHz "
            f"preloaded ({shift:+.0%}); k_eff = {found['free'].coupling_factor:.3f}, Qm = {found['free'].quality_factor:.0f} free"
        )
    handles = [Line2D([], [], color=colour, label=state) for state, colour in COLOURS.items()]
    meaning = {"fs": "fs, most conductance", "fm": "fm, most |Y|", "fn": "fn, least |Y|"}
    handles += [
        Line2D([], [], marker=mark, ls="", ms=5, mfc="white", mec=BLACK, label=meaning[name])
        for name, mark in MARKS.items()
    ]
    write(
        figure,
        folder / "admittance.png",
        "Preload moves both resonances up: admittance free and preloaded",
        f"Motor {motor.name}, preload {motor.contact.preload_n:g} N; A+B: 1 V on both groups, currents added; A−B: +1 V and "
        f"−1 V, currents subtracted. Small-signal analysis, the contact linearised where it sticks; {POINTS} frequencies a "
        f"curve; ngspice {spectrum.ngspice_version}. The circles run through the frequencies of the panels above.",
        handles,
    )
    return lines


def _draw_spectrum(column: np.ndarray, spectrum: pr.Admittance, connection: str, resonance: object) -> None:
    y = 1e3 * spectrum.driven(connection)
    colour = COLOURS[spectrum.state]
    magnitude, phase, circle = column
    magnitude.plot(spectrum.frequency_hz / 1e3, np.abs(y), color=colour)
    phase.plot(spectrum.frequency_hz / 1e3, np.degrees(np.angle(y)), color=colour)
    circle.plot(y.real, y.imag, color=colour)
    for name, mark in MARKS.items():
        at = getattr(resonance, name)
        if at is not None:
            value = np.interp(at, spectrum.frequency_hz, y)
            style = {"marker": mark, "ms": 5, "mfc": "white", "mec": colour, "mew": 1.2, "zorder": 4}
            magnitude.plot(at / 1e3, abs(value), **style)
            phase.plot(at / 1e3, np.degrees(np.angle(value)), **style)
            circle.plot(value.real, value.imag, **style)


if __name__ == "__main__":
    main(draw, __doc__)
