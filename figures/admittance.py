# SPDX-License-Identifier: GPL-3.0-or-later
"""Admittance of the motor with both groups in phase (A+B) and in antiphase (A−B), free and preloaded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from style import BLACK, BLUE, VERMILION, canvas, main, motor_words, write

import pyspice_runner as pr
from pyspice_runner.impedance.admittance import Admittance

COLOURS = {"free": BLUE, "preloaded": VERMILION}
MARKS = {
    "fs": ("o", "fs, maximum conductance"),
    "fm": ("^", "fm, maximum |Y|"),
    "fn": ("v", "fn, minimum |Y|"),
}
CONNECTIONS = {
    "A+B": (38.5e3, 44e3, "A+B drives the longitudinal mode"),
    "A-B": (39e3, 45e3, "A−B drives the bending mode"),
}
POINTS = 3000


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("bimodal40")
    figure, axes = canvas(3, 2, 8.6, height_ratios=(1.0, 0.8, 1.25))
    lines = []
    for column, (connection, (start, stop, title)) in zip(axes.T, CONNECTIONS.items(), strict=True):
        found = {}
        for state in COLOURS:
            spectrum = pr.admittance(motor, start=start, stop=stop, points=POINTS, state=state)
            (found[state],) = spectrum.resonances[connection]
            _draw_spectrum(column, spectrum, connection, found[state])
        magnitude, phase, circle = column
        magnitude.set(title=title, ylabel="|Y| / mS", yscale="log")
        magnitude.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        magnitude.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        magnitude.yaxis.set_minor_locator(NullLocator())
        magnitude.sharex(phase)
        magnitude.tick_params(labelbottom=False)
        phase.set(
            xlabel="frequency / kHz", xlim=(start / 1e3, stop / 1e3), xticks=np.arange(start, stop + 1, 1e3) / 1e3
        )
        phase.set(ylabel="phase of Y / °", ylim=(-95, 100), yticks=range(-90, 91, 45))
        circle.set(xlabel="conductance G / mS", ylabel="susceptance B / mS", aspect="equal", adjustable="datalim")
        free, pressed = found["free"], found["preloaded"]
        lines.append(
            f"{free.mode}: {free.fs / 1e3:.2f} kHz free, {pressed.fs / 1e3:.2f} kHz preloaded "
            f"({pressed.fs / free.fs - 1.0:+.1%}); free k_eff = {free.coupling_factor:.3f}, "
            f"Qm = {free.quality_factor:.0f}"
        )
    handles = [Line2D([], [], color=colour, label=state) for state, colour in COLOURS.items()]
    handles += [Line2D([], [], ls="", mfc="white", mec=BLACK, ms=5, marker=m, label=name) for m, name in MARKS.values()]
    title = "Preload moves both resonances up: admittance free and preloaded"
    caption = (
        f"{motor_words(motor)} A+B: 1 V on both groups, currents added; A−B: +1 V and −1 V, currents subtracted. "
        f"Small-signal analysis, the contact linearised where it sticks; {POINTS} frequencies a curve; "
        f"ngspice {spectrum.ngspice_version}. The circles run through the frequencies of the panels above."
    )
    write(figure, folder / "admittance.png", title, caption, handles)
    return lines


def _draw_spectrum(column: np.ndarray, spectrum: Admittance, connection: str, resonance: object) -> None:
    y = 1e3 * spectrum.driven(connection)
    magnitude, phase, circle = column
    colour = COLOURS[spectrum.state]
    line = {"color": colour}
    _draw_point_or_line((magnitude, phase, circle), spectrum.frequency_hz, y, line)
    for name, (mark, _) in MARKS.items():
        at = getattr(resonance, name)
        if at is not None:
            point = {"marker": mark, "ms": 5, "mfc": "white", "mec": colour, "mew": 1.2, "zorder": 4}
            value = np.interp(at, spectrum.frequency_hz, y)
            _draw_point_or_line((magnitude, phase, circle), np.array([at]), np.array([value]), point)


def _draw_point_or_line(column: tuple, frequency: np.ndarray, y: np.ndarray, style: dict[str, Any]) -> None:
    magnitude, phase, circle = column
    magnitude.plot(frequency / 1e3, np.abs(y), **style)
    phase.plot(frequency / 1e3, np.degrees(np.angle(y)), **style)
    circle.plot(y.real, y.imag, **style)


if __name__ == "__main__":
    main(draw, __doc__)
