# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 6 of the paper: speed–torque curves of the experiment at 44.5 and 46 kHz, and the paths of the tip.

A mode near 45 kHz, which was not intended, turns the rotor. φ = π drives it and, off resonance, the second bending
mode, but not the first. Dashed is the mode of the set ``andersen2002-unintended-mode``, which was identified with a
stator at a fixed distance; solid is the best mode that ``python -m docs.figure_6_search`` found on the sprung mount.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import xarray
from style import (
    BLACK,
    GREY,
    PURPLE,
    canvas,
    draft,
    drive_words,
    main,
    motor_words,
    recent,
    state_handles,
    state_path,
    write,
)

import pyspice_runner as pr

SEARCH = Path(__file__).parents[1] / "docs" / "figure_6_search.json"
VOLTAGE = 100.0
SPEEDS = np.arange(0.0, 22.1, 22.0 if draft() else 2.0)
SETTLING = {"tolerance": 0.1, "patience": 4} if draft() else {}
COLOURS = {44.5e3: PURPLE, 46e3: GREY}
DURATION = (
    1e-3 if draft() else 8e-3
)  # of the runs that show the path: six times the 1.3 ms in which the slowest mode decays


def draw(folder: Path) -> list[str]:
    bundled = pr.load_motor("andersen2002-unintended-mode")
    motor = bundled.updated(json.loads(SEARCH.read_text(encoding="utf-8"))["best"]["changes"])
    mode, mount = motor.modes[1], motor.mount
    assert mount is not None
    drives = {f: pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=f, phase_deg=180.0) for f in COLOURS}
    curves = {f: pr.speed_torque(motor, drive, speeds=SPEEDS, **SETTLING) for f, drive in drives.items()}
    former = {f: pr.speed_torque(bundled, drive, speeds=SPEEDS, **SETTLING) for f, drive in drives.items()}
    no_load = {f: no_load_speed(curve) for f, curve in curves.items()}

    figure, axes = canvas(2, 2, 6.6, width_ratios=(1.35, 1.0))
    torque, power = axes[:, 0]
    paths = axes[:, 1]
    stories = []
    for (f, curve), letter, path in zip(curves.items(), "cd", paths, strict=True):
        line = {"color": COLOURS[f], "marker": "o", "ms": 3, "label": f"{f / 1e3:g} kHz"}
        loads, shaft = 1e3 * curve["load_torque_n_m"], 1e3 * curve["load_torque_n_m"] * SPEEDS
        torque.plot(SPEEDS, loads, **line)
        torque.plot(SPEEDS, 1e3 * former[f]["load_torque_n_m"], color=COLOURS[f], ls="--", lw=0.9)
        power.plot(SPEEDS, shaft, **line)
        run = pr.simulate(motor, drives[f], duration=DURATION, speed=0.5 * no_load[f])
        part = recent(run, 3.02)
        state_path(path, 1e6 * run.tip_x_m[part], 1e6 * (run.tip_y_m - run.tip_y_m[0])[part], run.contact_state[part])
        path.set(
            title=f"({letter}) tip at {f / 1e3:g} kHz, {0.5 * no_load[f]:.1f} rad/s",
            xlabel="x along the rotor / µm", ylabel="y towards the rotor / µm",
        )  # fmt: skip
        path.set_aspect("equal", adjustable="datalim")
        shares = ", ".join(f"{name} {share:.0%}" for name, share in run.state_fractions.items())
        stories.append(
            f"{f / 1e3:g} kHz: stall torque {float(loads[0]):.1f} mN·m, no-load speed {no_load[f]:.1f} rad/s, "
            f"{float(shaft.max()):.0f} mW at most; at half that speed {shares}"
        )
    torque.axhline(0.0, color=BLACK, lw=0.6)
    torque.set(title="(a) torque on the load", xlabel="speed / (rad/s)", ylabel="torque / (mN·m)")
    power.set(title="(b) power to the load", xlabel="speed / (rad/s)", ylabel="power / mW", ylim=(0.0, None))
    torque.legend()
    drive = drive_words(drives[46e3]).replace("46 kHz", "44.5 and 46 kHz")
    caption = (
        f"{motor_words(motor)} Mount: {1e3 * mount.mass_kg:.0f} g on {mount.stiffness_n_per_m:g} N/m. Third mode: "
        f"{mode.frequency_hz / 1e3:.2f} kHz, {1e3 * mode.mass_kg:.1f} g, {mode.coupling_b_n_per_v:.2f} N/V, "
        f"Q {mode.quality_factor:.0f}; dashed: as in the set, on its mount. Drive: {drive}. (a, b) steady states with "
        f"the shaft held at {len(SPEEDS)} speeds; all points settled. (c, d) the last three periods of "
        f"{1e3 * DURATION:g} ms at half the no-load speed; y counts from the place of rest. "
        f"ngspice {curves[46e3].attrs['ngspice_version']}."
    )
    if not all(bool(curve["settled"].all()) for curve in curves.values()):
        caption = caption.replace("all points settled", "not all points settled")
    title = "More torque at 44.5 kHz, more speed at 46 kHz (after the paper's figure 6)"
    write(figure, folder / "figure_6.png", title, caption, state_handles())
    return stories


def no_load_speed(curve: xarray.Dataset) -> float:
    """Return the speed at which the load torque is zero, rad/s."""
    return float(np.interp(0.0, -curve["load_torque_n_m"], curve["speed_rad_s"]))


if __name__ == "__main__":
    main(draw, __doc__)
