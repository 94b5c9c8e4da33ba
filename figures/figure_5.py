# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 5 of the paper: paths of the tip, free and in contact, with stick, slip and impact.

(a, b) eq. (1) between the resonances; (c, d) eq. (2) off resonance; (e) eq. (1) at f₁; (f) eq. (1) at the contact
resonance, the first mode's frequency with the tip pressed on the rotor. Voltages, and the frequencies of (a-d), are
chosen so that each panel shows the result of the paper. The 40 and 80 kHz of (c, d) are away from the resonances, 13.5
and 51.7 kHz free, 17.9 and 55.5 kHz under preload, and from twice the contact resonance: near 35.8 kHz a strong drive
makes the tip hop at half the frequency. The rotor is held, so that the tangential spring follows the tip in stick.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from style import (
    BLACK,
    GREY,
    canvas,
    draft,
    drive_words,
    main,
    motor_words,
    recent,
    simulated,
    state_handles,
    state_path,
    write,
)

import pyspice_runner as pr
from pyspice_runner.run.waveforms import Waveforms

DURATION = 1.5e-3 if draft() else 8e-3  # six times the 1.3 ms in which the slowest mode decays


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    (pressed,) = pr.admittance(motor, state="preloaded").resonances["A+B"]
    f_1, f_c = motor.modes[0].frequency_hz, pressed.fs
    drives = [
        pr.TwoPhaseDrive(voltage=200.0, frequency=21e3, phase_deg=-90.0),
        pr.TwoToneDrive(voltage_1=200.0, frequency_1=40e3, voltage_2=200.0, frequency_2=80e3),
        pr.TwoPhaseDrive(voltage=50.0, frequency=f_1, phase_deg=-90.0),
        pr.TwoPhaseDrive(voltage=50.0, frequency=f_c, phase_deg=-90.0),
    ]
    free = [simulated(motor, drive, duration=DURATION, contact=None) for drive in drives]
    held = [simulated(motor, drive, duration=DURATION, speed=0.0) for drive in drives]
    spans = [(np.ptp(_path(a)[1]), np.ptp(_path(b)[1])) for a, b in zip(free, held, strict=True)]

    figure, axes = canvas(3, 2, 9.4)
    titles = [
        "(a) eq. (1) between the resonances, 21 kHz",
        "(c) eq. (2) off resonance, 40 and 80 kHz",
        f"(e) eq. (1) at f₁ = {f_1 / 1e3:.1f} kHz",
        f"(f) eq. (1) at contact resonance, {f_c / 1e3:.1f} kHz",
    ]
    places = (axes[0, 0], axes[1, 0], axes[2, 0], axes[2, 1])
    for title, place, a, b, span in zip(titles, places, free, held, spans, strict=True):
        _draw_paths(place, a, b)
        place.set_title(f"{title}\ny spans {span[0]:.2f} µm free, {span[1]:.2f} µm in contact")
    _draw_inset(axes[2, 0], held[2])
    _draw_over_time(axes[0, 1], held[0], "(b) drive of (a): x and the tangential spring's u")
    _draw_over_time(axes[1, 1], held[1], "(d) drive of (c): x and the tangential spring's u")
    handles = [Line2D([], [], color=GREY, lw=2.2, label="free tip"), *state_handles()]
    handles.append(Line2D([], [], color=BLACK, lw=1.0, label="spring's displacement u"))
    steps = [1e6 * run.provenance["run"]["step_s"] for run in held]
    caption = (
        f"{motor_words(motor)} Rotor held still. Drives: (a, b) {drive_words(drives[0])}; (c, d) "
        f"{drive_words(drives[1])}; (e) {drive_words(drives[2])}; (f) {drive_words(drives[3])}. The last periods of "
        f"{1e3 * DURATION:g} ms from rest; steps of {min(steps):.2f} to {max(steps):.2f} µs; ngspice "
        f"{held[0].ngspice_version}. y counts from each tip's own place of rest: the preload bends the stator by "
        f"{-1e6 * held[0].tip_y_m[0]:.2f} µm. Each panel has its own scales."
    )
    title = "The tip's path, free and pressed on the rotor (after the paper's figure 5)"
    write(figure, folder / "figure_5.png", title, caption, handles)
    shares = held[0].state_fractions
    span = [f"y spans {one[0]:.2f} µm free, {one[1]:.2f} µm in contact" for one in spans]
    return [
        f"(a, b) 21 kHz: {', '.join(f'{name} {share:.0%}' for name, share in shares.items())} of the time; {span[0]}",
        f"(c, d) eq. (2) off resonance hardly feels the contact: {span[1]}",
        f"(e) at f₁ = {f_1 / 1e3:.1f} kHz the free tip rings: {span[2]}",
        f"(f) at {f_c / 1e3:.1f} kHz the tip in contact rings: {span[3]}",
    ]


def _path(run: Waveforms) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x and y in µm, y from the position at rest, and the state, over the last two periods."""
    part = recent(run, 2.02)
    return 1e6 * run.tip_x_m[part], 1e6 * (run.tip_y_m[part] - run.tip_y_m[0]), run.contact_state[part]


def _draw_paths(axes: Axes, free: Waveforms, held: Waveforms) -> None:
    x, y, _ = _path(free)
    axes.plot(x, y, color=GREY, lw=2.6)
    state_path(axes, *_path(held))
    axes.margins(0.08)
    axes.set(xlabel="x along the rotor / µm", ylabel="y towards the rotor / µm")


def _draw_inset(axes: Axes, held: Waveforms) -> None:
    """Enlarge the path in contact, which is not visible on the scale of the free one."""
    inset = axes.inset_axes((0.64, 0.2, 0.35, 0.34))
    state_path(inset, *_path(held), width=1.4)
    inset.margins(0.12)
    inset.tick_params(labelsize=7)
    inset.set_title("in contact, enlarged", fontsize=7.5, loc="center", pad=3)
    axes.set_xlim(right=axes.get_xlim()[1] + 0.9 * np.ptp(axes.get_xlim()))


def _draw_over_time(axes: Axes, run: Waveforms, title: str) -> None:
    part = recent(run, 3.0)
    time = 1e6 * (run.time_s[part] - run.time_s[part][0])
    state_path(axes, time, 1e6 * run.tip_x_m[part], run.contact_state[part])
    axes.plot(time, 1e6 * run.contact_displacement_m[part], color=BLACK, lw=1.0, zorder=5)
    axes.set(title=title, xlabel="time / µs", ylabel="x and u along the rotor / µm", xlim=(0.0, time[-1]))


if __name__ == "__main__":
    main(draw, __doc__)
