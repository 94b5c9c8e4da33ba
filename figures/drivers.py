# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers of the motor: voltages and currents of the groups, and the distribution of the supply power."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import GREEN, GREY, PURPLE, VERMILION, canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr
from pyspice_runner.drivers.report import DriveReport

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR)
DURATION = 0.2e-3 if draft() else 3e-3
CHAINS = {  # kind, network, settings
    "linear amplifier": ("linear", "none", {}),
    "linear + inductor": ("linear", "inductor", {}),
    "half bridge + inductor": ("half-bridge", "inductor", {}),
    "half bridge + LLCC": ("half-bridge", "llcc", {}),
    "full bridge + LLCC": ("full-bridge", "llcc", {"bridge.level": 0.5}),
}
SHOWN = ("half bridge + inductor", "half bridge + LLCC")
DRAWN = ("linear amplifier", *SHOWN) if draft() else tuple(CHAINS)


def draw(folder: Path) -> list[str]:
    reports = {}
    for name in DRAWN:
        kind, network, settings = CHAINS[name]
        spec = pr.DriverSpec(DRIVE, kind, network, parts=settings)
        reports[name] = pr.drive_report(MOTOR, pr.design(MOTOR, spec), duration=DURATION)

    figure, axes = canvas(2, 2, 6.4)
    for axis, name in zip(axes[0], SHOWN, strict=True):
        reports[name].plot(ax=axis, panel="voltages")
        axis.set(title=f"({'ab'[SHOWN.index(name)]}) {name}", ylim=(-160.0, 230.0))
        axis.legend(loc="upper center", ncols=2)

    for shift, name, colour in ((-0.3, SHOWN[0], VERMILION), (0.3, SHOWN[1], GREEN)):
        harmonics = reports[name].groups["a"].harmonics[::2]
        amplitudes = [1e3 * item.current_a for item in harmonics]
        axes[1, 0].bar([item.order + shift for item in harmonics], amplitudes, 0.6, color=colour, label=name)
    axes[1, 0].set(
        title="(c) current into group A", xlabel="harmonic", ylabel="amplitude / mA", yscale="log", ylim=(1e-2, 1e3),
        xticks=range(1, 21, 2),
    )  # fmt: skip
    axes[1, 0].legend(loc="upper right")

    largest = max(report.power_in_w for report in reports.values())
    left = np.zeros(len(reports))
    places = np.arange(len(reports))
    for part, colour in (("motor", GREY), ("stage", VERMILION), ("network", PURPLE)):
        values = np.array([_share(report, part) for report in reports.values()])
        axes[1, 1].barh(places, values, left=left, color=colour, label=part, height=0.6)
        left += values
    axes[1, 1].set(title="(d) where the power of the supply goes", xlabel="power / W")
    axes[1, 1].set_yticks(places, list(reports))
    axes[1, 1].invert_yaxis()
    axes[1, 1].set_xlim(0.0, 1.9 * largest)  # room for the words
    axes[1, 1].legend(loc="lower right")
    for place, report in enumerate(reports.values()):
        axes[1, 1].text(
            left[place] + 0.01 * largest, place, f"power factor {report.power_factor:.2f}", va="center", fontsize=7
        )

    first = next(iter(reports.values()))
    caption = (
        f"{motor_words(MOTOR)} Drive: {drive_words(DRIVE)}, {1e3 * DURATION:g} ms "
        "from power-up, rotor free. Networks designed from stall to no load. Bridges: IRF610, dead time 200 ns; the "
        "full bridge gives three steps behind a transformer of 1:2. Power factor: both groups, at the outputs of the "
        f"power stages; of a square wave and a sine it is 0.90 at most. ngspice {first.ngspice_version}."
    )
    title = "The same voltage at the motor costs a linear amplifier more than twice the power"
    write(figure, folder / "drivers.png", title, caption)
    return [
        f"{name}: {report.power_in_w:.2f} W in, {100 * report.driver_efficiency:.0f} % reach the motor, "
        f"power factor {report.power_factor:.2f}"
        for name, report in reports.items()
    ]


def _share(report: DriveReport, part: str) -> float:
    if part == "motor":
        return report.motor_power_w
    stage = sum(loss for name, loss in report.losses_w.items() if name.startswith(("amplifier", "bridge")))
    return stage if part == "stage" else sum(report.losses_w.values()) - stage


if __name__ == "__main__":
    main(draw, __doc__)
