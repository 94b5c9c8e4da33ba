# SPDX-License-Identifier: GPL-3.0-or-later
"""Resonance trackers: they start beside the resonance, and then it drifts."""

from __future__ import annotations

from pathlib import Path

from style import BLACK, BLUE, GREY, ORANGE, VERMILLION, canvas, draft, main, write

import pyspice_runner as pr

DRIVE = {"voltage": 50.0, "ratio_b": 2.0, "phase_deg": 90.0}
NAMES = {"pll": "phase-locked loop", "observe-current": "perturb and observe", "none": "not tracked"}
COLOURS = {"pll": BLUE, "observe-current": ORANGE, "none": VERMILLION}
OFFSET = 0.02
DRIFT, BEGIN, DRIFT_TIME, END = -0.01, 2e-3, 20e-3, 24e-3
DURATIONS = {"pll": 15e-3, "observe-current": 15e-3, "none": 5e-3}
if draft():
    BEGIN, DRIFT_TIME, END = 0.9e-3, 0.5e-3, 2e-3
    DURATIONS = dict.fromkeys(NAMES, 2e-3)
STEP = 1.8e-7


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002").updated({"rotor.inertia_kg_m2": 1e-7})
    lag = pr.running_resonance(motor, pr.Tracker(kind="pll", frequency=51.7e3, **DRIVE))
    starts, drifts = {}, {}
    for kind in NAMES:
        far = pr.Tracker(kind=kind, frequency=lag.resonance_hz, offset=OFFSET, **DRIVE)
        near = far.model_copy(update={"offset": 0.0})
        starts[kind] = pr.track(motor, far, duration=DURATIONS[kind], step=STEP)
        drifts[kind] = pr.track(
            motor, near, disturb="temperature", drift=DRIFT, drift_time=DRIFT_TIME, begin=BEGIN, duration=END,
            step=STEP,
        )  # fmt: skip

    figure, axes = canvas(3, 2, 7.2, sharex="col")
    for column, results in zip(axes.T, (starts, drifts), strict=True):
        for kind, found in results.items():
            time = 1e3 * found.time_s
            line = {"color": COLOURS[kind], "label": NAMES[kind], "lw": 1.1}
            column[0].plot(time, 1e-3 * found.frequency_hz, **line)
            column[1].plot(time, found.phase_deg, **line)
            column[2].plot(time, found.rotor_speed_rad_s, **line)
        column[1].axhline(0.0, color=GREY, lw=0.8)
        column[1].set_ylim(-95.0, 95.0)
        column[2].set_xlabel("time / ms")
    axes[0, 0].axhline(1e-3 * lag.resonance_hz, color=BLACK, lw=0.9, ls="--", label="resonance")
    times = [0.0, 1e3 * BEGIN, 1e3 * (BEGIN + DRIFT_TIME), 1e3 * END]
    drifted = 1e-3 * lag.resonance_hz * (1.0 + DRIFT)
    axes[0, 1].plot(times, [1e-3 * lag.resonance_hz] * 2 + [drifted] * 2, color=BLACK, lw=0.9, ls="--")
    axes[0, 0].set(title=f"(a) start {100 * OFFSET:g} % above", ylabel="frequency / kHz")
    axes[0, 1].set(title=f"(b) drift of {100 * DRIFT:g} % in {1e3 * DRIFT_TIME:g} ms".replace("-", "−"))
    axes[1, 0].set_ylabel("phase of the mode / °")
    axes[2, 0].set_ylabel("rotor speed / (rad/s)")
    axes[0, 0].legend(loc="upper right")
    caption = (
        f"Motor {motor.name}, preload {motor.contact.preload_n:g} N, rotor {1e7 * motor.rotor.inertia_kg_m2:g} g·cm². "
        "Drive: 50 V and 100 V, 90° apart at any frequency. Phase: velocity of mode 2 against the force of both "
        "groups. The trackers do not see it; they sense the motional current. Dashed: running resonance by harmonic "
        f"balance, {1e-3 * lag.resonance_hz:.2f} kHz, loaded Q = {lag.quality:.0f}. Loop: bandwidth 500 Hz. Perturb "
        f"and observe: 80 Hz every 0.8 ms. ngspice {starts['pll'].ngspice_version}."
    )
    write(figure, folder / "tracking.png", "Two trackers find the resonance and stay on it as it drifts", caption)
    story = [f"{name}: {_lock(starts[kind])}" for kind, name in NAMES.items()]
    for kind, found in drifts.items():
        speeds = f"{found.speed_before_rad_s:.1f} → {found.speed_after_rad_s:.1f} rad/s"
        story.append(f"{NAMES[kind]}, drift: {found.worst_phase_error_deg:.0f}° off resonance at worst, {speeds}")
    return story


def _lock(found: pr.Tracking) -> str:
    return "does not lock" if found.lock_time_s is None else f"locks in {1e3 * found.lock_time_s:.1f} ms"


if __name__ == "__main__":
    main(draw, __doc__)
