# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 5 of the paper: paths of the tip, free and in contact, with stick, slip and impact.

(a, b) eq. (1) between the resonances; (c, d) eq. (2) off resonance; (e) eq. (1) at f₁; (f) eq. (1) at the contact
resonance, the first mode's frequency with the tip pressed on the rotor. The paper prints neither voltages nor the
frequencies of (a-d); those here are chosen so that each panel shows what the paper finds. The rotor is held, so that
while the tip sticks the tangential spring follows it step by step.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from style import BLACK, GREY, canvas, main, recent, state_handles, state_path, write

import pyspice_runner as pr

DURATION = 8e-3  # six times the 1.3 ms in which the slowest mode decays


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    f_1 = motor.modes[0].frequency_hz
    (pressed,) = pr.admittance(motor, state="preloaded").resonances["A+B"]
    drives = {
        "eq1": pr.TwoPhaseDrive(voltage=200.0, frequency=21e3, phase_deg=-90.0),
        "eq2": pr.TwoToneDrive(voltage_1=200.0, frequency_1=40e3, voltage_2=200.0, frequency_2=80e3),
        "f1": pr.TwoPhaseDrive(voltage=50.0, frequency=f_1, phase_deg=-90.0),
        "contact": pr.TwoPhaseDrive(voltage=50.0, frequency=pressed.fs, phase_deg=-90.0),
    }
    free = {key: pr.simulate(motor, drive, duration=DURATION, contact=None) for key, drive in drives.items()}
    held = {key: pr.simulate(motor, drive, duration=DURATION, speed=0.0) for key, drive in drives.items()}
    height = {key: (np.ptp(_path(free[key])[1]), np.ptp(_path(held[key])[1])) for key in drives}

    figure, axes = canvas(3, 2, 9.4)
    titles = {
        "eq1": "(a) eq. (1), 200 V, 21 kHz",
        "eq2": "(c) eq. (2) off resonance, 200 V, 40 and 80 kHz",
        "f1": f"(e) eq. (1) at f₁ = {f_1 / 1e3:.1f} kHz, 50 V",
        "contact": f"(f) eq. (1) at contact resonance, {pressed.fs / 1e3:.1f} kHz, 50 V",
    }
    for (key, title), panel in zip(titles.items(), (axes[0, 0], axes[1, 0], axes[2, 0], axes[2, 1]), strict=True):
        _paths(panel, free[key], held[key])
        panel.set(title=f"{title}\ny spans {height[key][0]:.2f} µm free, {height[key][1]:.2f} µm in contact")
    _inset(axes[2, 0], held["f1"])
    _over_time(axes[0, 1], held["eq1"], "(b) drive of (a): x and the tangential spring's u")
    _over_time(axes[1, 1], held["eq2"], "(d) drive of (c): x and the tangential spring's u")
    handles = [Line2D([], [], color=GREY, lw=2.2, label="free tip"), *state_handles()]
    handles.append(Line2D([], [], color=BLACK, lw=1.0, label="spring's displacement u"))
    write(
        figure,
        folder / "figure_5.png",
        "The tip's path, free and pressed on the rotor (the paper's figure 5)",
        f"Motor {motor.name}, preload {motor.contact.preload_n:g} N, friction {motor.contact.friction:g}, rotor held at "
        f"0 rad/s. Phase φ = −90° in eq. (1), 0° in eq. (2). Last periods of {1e3 * DURATION:g} ms from rest; steps of "
        f"{1e6 * held['eq1'].provenance['run']['step_s']:.2f} µs ({1e6 * held['eq2'].provenance['run']['step_s']:.2f} µs "
        f"in c and d); ngspice {held['eq1'].ngspice_version}. y counts from each tip's own place of rest: the preload bends "
        f"the stator by {-1e6 * held['eq1'].tip_y_m[0]:.2f} µm. Each panel has its own scales.",
        handles,
    )
    shares = held["eq1"].state_fractions
    return [
        f"sticks {shares['stick']:.0%}, slips {shares['slip']:.0%} and flies {shares['separated']:.0%} of the time "
        "with 200 V at 21 kHz on a rotor that is held (a, b)",
        f"off resonance the contact hardly matters: {height['eq2'][0]:.2f} µm high free, {height['eq2'][1]:.2f} µm in "
        "contact (c, d)",
        f"rings at f₁ = {f_1 / 1e3:.1f} kHz: {height['f1'][0]:.1f} µm free, but {height['f1'][1]:.2f} µm in contact (e)",
        f"rings in contact at {pressed.fs / 1e3:.1f} kHz instead: {height['contact'][1]:.2f} µm, "
        f"{height['contact'][0]:.2f} µm free (f)",
    ]


def _path(run: pr.Waveforms) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x and y in µm, y from the place of rest, and the state, over the last two periods."""
    part = recent(run, 2.02)
    return 1e6 * run.tip_x_m[part], 1e6 * (run.tip_y_m[part] - run.tip_y_m[0]), run.contact_state[part]


def _paths(axes: Axes, free: pr.Waveforms, held: pr.Waveforms) -> None:
    x, y, _ = _path(free)
    axes.plot(x, y, color=GREY, lw=2.6)
    state_path(axes, *_path(held))
    axes.margins(0.08)
    axes.set(xlabel="x along the rotor / µm", ylabel="y towards the rotor / µm")


def _inset(axes: Axes, held: pr.Waveforms) -> None:
    """Enlarge the path in contact, which is lost on the scale of the free one."""
    inset = axes.inset_axes((0.64, 0.2, 0.35, 0.34))
    state_path(inset, *_path(held), width=1.4)
    inset.margins(0.12)
    inset.tick_params(labelsize=7)
    inset.set_title("in contact, enlarged", fontsize=7.5, loc="center", pad=3)
    axes.set_xlim(right=axes.get_xlim()[1] + 0.9 * np.ptp(axes.get_xlim()))


def _over_time(axes: Axes, run: pr.Waveforms, title: str) -> None:
    part = recent(run, 3.0)
    time = 1e6 * (run.time_s[part] - run.time_s[part][0])
    state_path(axes, time, 1e6 * run.tip_x_m[part], run.contact_state[part])
    axes.plot(time, 1e6 * run.contact_displacement_m[part], color=BLACK, lw=1.0, zorder=5)
    axes.set(title=title, xlabel="time / µs", ylabel="displacement along the rotor / µm", xlim=(0.0, time[-1]))


if __name__ == "__main__":
    main(draw, __doc__)
