# SPDX-License-Identifier: GPL-3.0-or-later
"""Frequency response near the contact resonance: steady states, stable and unstable, and transients swept up and down.

A tip that lifts off is in contact for part of the period only, so that its resonance frequency falls with the
amplitude. At a fixed distance the response bends over, and between its folds the motion depends on the history. On the
mount the hammering motion is unstable, and a transient does not repeat.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray
from matplotlib.axes import Axes
from style import BLACK, BLUE, ORANGE, VERMILION, canvas, draft, drive_words, main, write

import pyspice_runner as pr
from pyspice_runner.run.dynamometer import Dynamometer, off_beat
from pyspice_runner.run.point import Point
from pyspice_runner.steady.settling import Settling, settle

VOLTAGE = 30.0
LOW, HIGH = (17.9e3, 17.93e3) if draft() else (16.2e3, 18.4e3)  # Hz
STEP, FINE_STEP, FINE = 200.0, 50.0, (16.5e3, 17.0e3)  # Hz, of the sweeps; fine about the folds at a fixed distance
SETTLING = {"tolerance": 0.1, "patience": 4} if draft() else {"patience": 8}
HAMMERING = {"patience": 4}  # on the mount a transient repeats nowhere
ROWS = (
    ("normal_force_n", 1.0, "mean normal force / N"),
    ("torque_n_m", 1e3, "stall torque / (mN·m)"),
    ("separated", 100.0, "contact open / % of period"),
)


def draw(folder: Path) -> list[str]:
    sprung = pr.load_motor("andersen2002")
    rigid = sprung.updated({"mount": None})
    drive = pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=HIGH, phase_deg=90.0)
    coarse = np.arange(LOW, HIGH + 1.0, STEP)
    grid = coarse if draft() else np.union1d(coarse, np.arange(FINE[0], FINE[1] + 1.0, FINE_STEP))
    ends = {"follow": "drive.frequency", "speed": 0.0, "points": 2 if draft() else 200}
    branches = {
        "(a) fixed distance": [pr.steady_branch(rigid, drive, start=HIGH, stop=LOW, **ends)],
        "(b) on the mount": [
            pr.steady_branch(sprung, drive, start=HIGH, stop=LOW, **ends),
            pr.steady_branch(sprung, drive, start=LOW, stop=HIGH, **ends),
        ],
    }
    sweeps = {
        "(a) fixed distance": _swept(rigid, drive, grid, SETTLING),
        "(b) on the mount": _swept(sprung, drive, coarse, SETTLING if draft() else HAMMERING),
    }

    figure, axes = canvas(3, 2, 8.4, sharex=True, sharey="row")
    for column, (title, found) in enumerate(branches.items()):
        swept = sweeps[title]
        for panel, (name, factor, label) in zip(axes[:, column], ROWS, strict=True):
            for branch in found:
                _line(panel, branch, name, factor)
            _markers(panel, swept, name, factor)
            if column == 0:
                panel.set_ylabel(label)
            panel.grid(True)
        axes[0, column].set_title(title)
        axes[2, column].set_xlabel("frequency / kHz")
    axes[0, 0].legend(fontsize=7)
    folds = json.loads(branches["(a) fixed distance"][0].attrs["folds"])
    band = f"{LOW / 1e3:g} to {HIGH / 1e3:g} kHz"
    caption = (
        f"Motor andersen2002. Drive: {drive_words(drive).replace(f'{HIGH / 1e3:g} kHz', band)}, shaft held. Lines: "
        f"branches of steady states, dashed where they are unstable. Triangles: transients in steps of {STEP:g} Hz, "
        f"near the folds {FINE_STEP:g} Hz, each of which continues the one before; hollow where the mean still varies. "
        f"Where the contact is never open and only sticks, a held shaft can have any of a range of torques. "
        f"ngspice {branches['(a) fixed distance'][0].attrs['ngspice_version']}."
    )
    write(figure, folder / "frequency_sweep.png", "Frequency response near the contact resonance", caption)
    force = sweeps["(a) fixed distance"]["normal_force_n"].values
    up, down = force[: len(grid)], force[: len(grid) - 1 : -1]
    differs = np.flatnonzero(np.abs(up - down) > 0.5)
    where = ", ".join(f"{fold / 1e3:.2f} kHz" for fold in folds) or "no frequency"
    stories = [f"fixed distance: folds at {where}"]
    if differs.size:
        low, high = grid[differs[[0, -1]]]
        stories.append(f"sweeps up and down differ from {low / 1e3:.2f} to {high / 1e3:.2f} kHz")
    return stories


def _swept(motor: pr.Motor, drive: pr.TwoPhaseDrive, grid: np.ndarray, settling: Mapping[str, float]) -> xarray.Dataset:
    """Let transients follow the frequency up and then down, with the shaft held."""
    there_and_back, motion, rows = np.concatenate([grid, grid[::-1]]), None, []
    for frequency in there_and_back.tolist():
        point = Point.of(motor, drive.updated({"frequency": frequency}), speed=0.0)
        row, last = settle(Dynamometer(off_beat(point)), motion, Settling(**settling))
        motion = last.end
        rows.append({name: row[name] for name in ("settled", *(name for name, *_ in ROWS))})
    columns = {name: ("drive.frequency", [row[name] for row in rows]) for name in rows[0]}
    return xarray.Dataset(columns, {"drive.frequency": there_and_back})


def _line(panel: Axes, branch: xarray.Dataset, name: str, factor: float) -> None:
    """Draw a branch, dashed where it is unstable."""
    kilohertz, values = branch["drive.frequency"].values / 1e3, factor * branch[name].values
    stable = branch["stable"].values
    unstable = ~stable | np.roll(~stable, 1) | np.roll(~stable, -1)  # up to the stable parts
    known = [line.get_label() for line in panel.get_lines()]
    for chosen, style, colour, label in ((stable, "-", BLUE, "stable"), (unstable, "--", BLACK, "unstable")):
        shown = np.where(chosen, values, np.nan)
        panel.plot(kilohertz, shown, style, color=colour, lw=1.3, label=None if label in known else label)


def _markers(panel: Axes, swept: xarray.Dataset, name: str, factor: float) -> None:
    """Draw the transients of the sweeps up and down, hollow where they did not settle."""
    settled, count = swept["settled"].values, swept.sizes["drive.frequency"] // 2
    for part, marker, colour, label in (
        (slice(None, count), "^", ORANGE, "swept up"),
        (slice(count, None), "v", VERMILION, "swept down"),
    ):
        kilohertz = swept["drive.frequency"].values[part] / 1e3
        values = factor * swept[name].values[part]
        for chosen, face in ((settled[part], colour), (~settled[part], "none")):
            panel.plot(
                kilohertz[chosen], values[chosen], marker=marker, ms=4, ls="", mec=colour, mfc=face,
                label=label if face != "none" else None,
            )  # fmt: skip


if __name__ == "__main__":
    main(draw, __doc__)
