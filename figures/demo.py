# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the motor bimodal40, and at last the paper's, in ngspice; plot the results and print a summary (`make demo`)."""

from __future__ import annotations

import time
from pathlib import Path

import admittance
import figure_5
import half_bridge
import speed_force
import spin_up
from rich.console import Console
from style import main

PARTS = {
    "spin_up.png": ("bimodal40: the rotor spins up", spin_up.draw),
    "speed_force.png": ("bimodal40: force, power and efficiency versus speed", speed_force.draw),
    "admittance.png": ("bimodal40: its resonances, free and pressed on the rotor", admittance.draw),
    "half_bridge.png": ("bimodal40: voltages and currents behind half bridges", half_bridge.draw),
    "figure_5.png": ("andersen2002: the path of its tip (figure 5 of the paper)", figure_5.draw),
}


def draw(folder: Path) -> list[str]:
    """Plot the figures, with the progress on stderr, and return the summary."""
    progress = Console(stderr=True)
    story = []
    began = time.perf_counter()
    for number, (picture, (title, part)) in enumerate(PARTS.items(), start=1):
        with progress.status(f"[{number}/{len(PARTS)}] {title} …"):
            found = part(folder)
        progress.print(f"[green]✓[/] {title} [dim]({time.perf_counter() - began:.0f} s)[/]")
        story += [f"{title}:", *(f"  · {line}" for line in found), f"  → {_near(folder / picture)}", ""]
    return ["", *story[:-1]]


def _near(path: Path) -> Path:
    """Return a path relative to the working directory, if it is below it."""
    here = Path.cwd()
    return path.resolve().relative_to(here) if path.resolve().is_relative_to(here) else path


if __name__ == "__main__":
    main(draw, __doc__)
