# SPDX-License-Identifier: GPL-3.0-or-later
"""A ceramic that softens: a free stator driven up and down through its resonance, and Duffing's closed form."""

from __future__ import annotations

from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
from style import BLACK, BLUE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr
from pyspice_runner.spice.ngspice import run_deck
from tools.benches.duffing import amplitudes, folds
from tools.decks import SOFTENING, softening_deck

VOLTAGE = 50.0


def draw(folder: Path) -> list[str]:
    duration = 0.02 if draft() else 0.1
    motor = pr.load_motor("beam40")
    mode = motor.updated(SOFTENING).modes[1]
    lines = softening_deck(motor, VOLTAGE, duration).splitlines()
    deck = "\n".join(line for line in lines if not line.startswith(".meas")).replace(
        ".tran", ".save v(xmotor.x)\n.tran"
    )
    raw = run_deck(deck, vectors=["v(xmotor.x)"]).raw
    time, x = raw.vectors["time"].real, np.abs(raw.vectors["v(xmotor.x)"].real)
    low, high = (round(factor * mode.frequency_hz, -1) for factor in (0.975, 1.01))
    force = VOLTAGE * abs(mode.coupling_a_n_per_v - mode.coupling_b_n_per_v)
    figure, axes = canvas(1, 1, 5.6)
    axis = axes if not isinstance(axes, np.ndarray) else axes.flat[0]
    frequency = np.linspace(low, high, 1500)
    closed = [(value, found) for value in frequency for found in amplitudes(mode, force, float(value))]
    at, found = np.transpose(closed) * np.array([[1e-3], [abs(mode.tip_x) * 1e6]])
    axis.plot(at, found, ".", color=BLACK, ms=3.0, alpha=0.25)
    edges = np.linspace(0.0, 2.0 * duration, 801)
    peaks = np.array([x[(time >= a) & (time < b)].max() for a, b in pairwise(edges)])
    middle = 0.5 * (edges[1:] + edges[:-1])
    swept = 1e-3 * np.where(middle < duration, low + (high - low) * middle / duration,
                            high - (high - low) * (middle / duration - 1.0))  # fmt: skip
    for chosen, colour, name in ((middle < duration, BLUE, "upwards"), (middle >= duration, VERMILION, "downwards")):
        axis.plot(swept[chosen], peaks[chosen], color=colour, label=name)
    axis.plot([], [], ".", color=BLACK, alpha=0.4, label="Duffing, closed form")
    axis.set(xlabel="frequency / kHz", ylabel="tip along the rotor / µm", ylim=(0.0, None))
    axis.legend()
    fold = folds(mode, force, low, high)
    assert fold is not None
    linear = force / (2.0 * pi * mode.frequency_hz * mode.damping_n_s_per_m)
    softer = 75.0 * mode.softening_per_m2 * linear**2
    words = (
        f"Free stator of beam40 at {VOLTAGE:g} V in antiphase. The softening of its second mode is "
        f"{mode.softening_per_m2:.3g} 1/m², {softer:.2g} % of the stiffness at the linear amplitude. Swept in "
        f"{1e3 * duration:g} ms each way. Closed form: jump down at {1e-3 * fold[0]:.2f} kHz, up at "
        f"{1e-3 * fold[1]:.2f} kHz."
    )
    path = folder / "softening.png"
    write(figure, path, "A ceramic that softens with amplitude", words)
    return [str(path), words]


if __name__ == "__main__":
    main(draw, __doc__)
