# SPDX-License-Identifier: GPL-3.0-or-later
"""A phase-locked loop against no tracking: they start off resonance, and then the resonance drifts."""

from __future__ import annotations

from pathlib import Path

from style import BLACK, BLUE, GREY, VERMILION, canvas, draft, main, write

import pyspice_runner as pr
from pyspice_runner.trackers.track import Tracking

MOTOR = pr.load_motor("bimodal40")
DRIVE = {"voltage": 60.0, "phase_deg": pr.default_drive(MOTOR).phase_deg}
NAMES = {"pll": "phase-locked loop", "none": "not tracked"}
COLOURS = {"pll": BLUE, "none": VERMILION}
START, OFFSET = 40.65e3, 0.01
DRIFT, BEGIN, DRIFT_TIME, END = -0.005, 1.5e-3, 4e-3, 6.5e-3
DURATION = 5e-3
if draft():
    BEGIN, DRIFT_TIME, END = 1.1e-3, 0.3e-3, 2.5e-3
    DURATION = 2.3e-3


def drifted(motor: pr.Motor) -> pr.Motor:
    """Return the motor whose modes have drifted."""
    return motor.updated(
        {f"modes.{n}.frequency_hz": (1.0 + DRIFT) * mode.frequency_hz for n, mode in enumerate(motor.modes)}
    )


def resonance_of(motor: pr.Motor) -> float:
    """Return the frequency in Hz at which the running averaged motor has the phase 0, after a loop has settled.

    It has one decimal: a start that differs by 5 µHz changes the phases of the first milliseconds by 0.2°.
    """
    tracker = pr.Tracker(kind="pll", frequency=START, **DRIVE)
    return round(pr.track(motor, tracker, duration=30e-3, averaged=True, margin=False).end_frequency_hz, 1)


def draw(folder: Path) -> list[str]:
    motor = MOTOR.updated({"rotor.inertia_kg_m2": 1e-6})
    cold, warm = (resonance_of(changed) for changed in (motor, drifted(motor)))
    starts, drifts = {}, {}
    for kind in NAMES:
        far = pr.Tracker(kind=kind, frequency=cold, offset=OFFSET, **DRIVE)
        near = far.model_copy(update={"offset": 0.0})
        starts[kind] = pr.track(motor, far, duration=DURATION, margin=False)
        drifts[kind] = pr.track(
            motor, near, disturb="temperature", drift=DRIFT, drift_time=DRIFT_TIME, begin=BEGIN, duration=END,
            margin=False,
        )  # fmt: skip

    figure, axes = canvas(3, 2, 7.2, sharex="col", sharey="row")
    for column, results in zip(axes.T, (starts, drifts), strict=True):
        for axis, panel in zip(column, ("frequency", "phase", "speed"), strict=True):
            for kind, found in results.items():
                drawn = len(axis.lines)
                found.plot(ax=axis, panel=panel)
                axis.lines[drawn].set_color(COLOURS[kind])
            axis.label_outer()
        column[1].axhline(0.0, color=GREY, lw=0.8)
    tracked = list(axes[0, 0].lines)
    dashed = axes[0, 0].axhline(1e-3 * cold, color=BLACK, lw=0.9, ls="--")
    times = [0.0, 1e3 * BEGIN, 1e3 * (BEGIN + DRIFT_TIME), 1e3 * END]
    axes[0, 1].plot(times, [1e-3 * cold] * 2 + [1e-3 * warm] * 2, color=BLACK, lw=0.9, ls="--")
    axes[0, 0].set_title(f"(a) start {100 * OFFSET:g} % above")
    axes[0, 1].set_title(f"(b) drift of {100 * DRIFT:g} % in {1e3 * DRIFT_TIME:g} ms".replace("-", "−"))
    axes[1, 0].legend(
        [*tracked, dashed], [*NAMES.values(), "resonance of the running motor"], loc="upper right", ncols=2, fontsize=7
    )
    caption = (
        f"Motor {motor.name}, preload {motor.contact.preload_n:g} N, rotor {1e7 * motor.rotor.inertia_kg_m2:g} g·cm². "
        f"Drive: {DRIVE['voltage']:g} V, φ = {DRIVE['phase_deg']:g}°. Phase: velocity of mode 4 against the force of "
        "both groups. The trackers do not see it; they sense the motional current. Dashed: the frequency at which "
        f"the running averaged motor has the phase 0, {1e-3 * cold:.2f} kHz, and {1e-3 * warm:.2f} kHz after the "
        "drift. Loop: bandwidth 500 Hz. "
        f"ngspice {starts['pll'].ngspice_version}."
    )
    write(
        figure,
        folder / "tracking.png",
        "A phase-locked loop follows the resonance as it drifts",
        caption,
    )
    story = [f"{name}: {_lock(starts[kind])}" for kind, name in NAMES.items()]
    for kind, found in drifts.items():
        speeds = f"{found.speed_before_rad_s:.1f} → {found.speed_after_rad_s:.1f} rad/s"
        story.append(f"{NAMES[kind]}, drift: {found.worst_phase_error_deg:.0f}° off resonance at worst, {speeds}")
    return story


def _lock(found: Tracking) -> str:
    return "does not lock" if found.lock_time_s is None else f"locks in {1e3 * found.lock_time_s:.1f} ms"


if __name__ == "__main__":
    main(draw, __doc__)
