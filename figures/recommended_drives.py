# SPDX-License-Identifier: GPL-3.0-or-later
"""The recommended drives of the paper's motors: the best points of maps of steady states within limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from style import BLACK, BLUE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr

SHOWN = {"power": ("shaft_power_w", "shaft power / mW", 1e3), "efficiency": ("efficiency", "efficiency / %", 100.0)}
AXES = {
    "drive.frequency": ("frequency / kHz", 1e-3),
    "drive.voltage": ("voltage / V", 1.0),
}


@dataclass(frozen=True)
class Choice:
    """What makes a drive the best one of a motor.

    Attributes:
        objective: what is greatest.
        speed: at which the shaft is held, rad/s; about half the speed of the free rotor.
        voltage: greatest amplitude in V.
        over: axes of the map.
    """

    objective: Literal["power", "efficiency"]
    speed: float
    voltage: float
    over: Mapping[str, Sequence[float]]

    def limits(self, motor: pr.Motor) -> dict[str, float]:
        """Return the limits: the voltage, half the Curie temperature and, where the beam is known, the strength."""
        assert motor.limits is not None
        found = {"voltage_v": self.voltage, "temperature_c": 0.5 * motor.limits.curie_temperature_c}
        return found | ({"ceramic_stress_pa": motor.limits.dynamic_strength_pa} if motor.structure else {})


CHOICES = {
    "andersen2002": Choice(
        "efficiency", 0.35, 50.0,
        {"drive.frequency": np.arange(53.0e3, 55.1e3, 250.0), "drive.voltage": np.arange(35.0, 60.0, 5.0)},
    ),
    "andersen2002-unintended-mode": Choice(
        "power", 10.0, 100.0,
        {"drive.frequency": np.arange(44.4e3, 46.1e3, 200.0), "drive.voltage": np.arange(70.0, 120.0, 10.0)},
    ),
}  # fmt: skip


def mapped(name: str, over: Mapping[str, Sequence[float]] | None = None) -> xarray.Dataset:
    """Return the map of a set within the limits of its choice, over its axes or others."""
    motor, choice = pr.load_motor(name), CHOICES[name]
    return pr.working_points(
        motor, pr.default_drive(motor), over=over or choice.over, objective=choice.objective, speed=choice.speed,
        limits=choice.limits(motor),
    )  # fmt: skip


def recommended(name: str) -> dict[str, float]:
    """Return frequency and voltage of the set's drive, by the paths of the axes."""
    drive = pr.default_drive(pr.load_motor(name))
    assert isinstance(drive, pr.TwoPhaseDrive)
    return {path: getattr(drive, path.removeprefix("drive.")) for path in AXES}


def draw(folder: Path) -> list[str]:
    figure, axes = canvas(1, 2, 4.6)
    stories = []
    for panel, (name, choice) in zip(axes, CHOICES.items(), strict=True):
        over = {path: values[:: len(values) - 1 if draft() else 1] for path, values in choice.over.items()}
        data = mapped(name, over)
        _contours(panel, data, name, choice)
        stories.append(_story(name, choice, data.piezomotor.best))
    speeds = ", ".join(f"{choice.speed:g}" for choice in CHOICES.values())
    voltages = ", ".join(f"{choice.voltage:.0f}" for choice in CHOICES.values())
    caption = (
        f"Steady states at held speeds of {speeds} rad/s, about half of those of the free rotors. Hatched: above the "
        f"limit of the voltage ({voltages} V), above half the Curie temperature or the strength of the ceramic. Cross: "
        "not stable. Star: best point. Circle: the set's drive. "
        f"ngspice {data.attrs['ngspice_version']}."
    )
    write(figure, folder / "recommended_drives.png", "Recommended drives as the best working points", caption)
    return stories


def _story(name: str, choice: Choice, best: Mapping[str, Any] | None) -> str:
    quantity, words, scale = SHOWN[choice.objective]
    drive = recommended(name)
    words, unit = words.split(" / ")
    if best is None:
        return f"{name}: no point is within the limits"
    where = ", ".join(f"{AXES[path][1] * best[path]:.5g} {AXES[path][0].split()[-1]}" for path in choice.over)
    own = ", ".join(f"{factor * drive[path]:.5g} {label.split()[-1]}" for path, (label, factor) in AXES.items())
    return f"{name}: most {words}, {scale * best[quantity]:.3g} {unit}, at {where}; drive of the set: {own}"


def _contours(panel: Axes, data: xarray.Dataset, name: str, choice: Choice) -> None:
    quantity, words, scale = SHOWN[choice.objective]
    (along, (x, to_x)), (across, (y, to_y)) = ((path, AXES[path]) for path in choice.over)
    places = to_x * data[along].values, to_y * data[across].values
    values = scale * data[quantity].transpose(across, along).values
    levels = MaxNLocator(8).tick_values(0.0, np.nanmax(values))[1:]
    lines = panel.contour(*places, values, levels=levels, colors=BLUE, linewidths=1.0)
    panel.clabel(lines, fontsize=7)
    outside = np.any(
        [(data[one] > limit).transpose(across, along) for one, limit in choice.limits(pr.load_motor(name)).items()],
        axis=0,
    )
    if outside.any():
        panel.contourf(*places, outside, levels=[0.5, 1.5], colors="none", hatches=["///"])
    rows, columns = np.nonzero(~data["stable"].transpose(across, along).values)
    panel.plot(places[0][columns], places[1][rows], "x", color=VERMILION, ms=5)
    best, drive = data.piezomotor.best, recommended(name)
    if best:
        panel.plot(to_x * best[along], to_y * best[across], "*", color=VERMILION, ms=11)
    panel.plot(to_x * drive[along], to_y * drive[across], "o", mfc="none", mec=BLACK, ms=14)
    panel.set(title=f"{name}\n{words}", xlabel=x, ylabel=y)


if __name__ == "__main__":
    main(draw, __doc__)
