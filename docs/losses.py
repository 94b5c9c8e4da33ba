# SPDX-License-Identifier: GPL-3.0-or-later
"""Write ``docs/losses.md``, what each loss of a real motor changes on two motors: ``python -m docs.losses``."""

from __future__ import annotations

import sys
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.dielectric import HIGH_HZ, lossy_capacitance

PAGE = Path(__file__).with_name("losses.md")
RUNS = 3  # of which the fastest counts

HEAD = """# Effect of each loss

This page is written by `python -m docs.losses`. Each row changes one effect of a bundled motor and leaves the others as
they are in its set. *Stall*: mean torque of the contact on a rotor that is held. *No load*: speed at which the shaft
gives no torque, by interpolation between {count} speeds; a dash where it is above {fastest:g} rad/s.
*Efficiency*: the best at these speeds, shaft power over
electrical power. *Time*: processor time of ngspice for a run of 1 ms, relative to the first row, the least of {runs}.
The contact law is the paper's spring–slider; the last row of a table has the [brush](contact.md#the-brush) instead,
which says what the law contributes. Friction that falls with the slip velocity takes no [compliance along the
rotor](contact.md#loss-along-the-normal): compare that row with the one without it, where there is one.
"""


def effects(motor: pr.Motor) -> dict[str, dict[str, Any]]:
    """Return the changes by what they mean."""
    contact = motor.contact
    stiffness = contact_law.normal_stiffness_at_preload(contact)
    friction = 0.02 * contact.friction * contact.preload_n * motor.rotor.radius_m
    softer = {
        f"modes.{index}.{name}": value
        for index in range(len(motor.modes))
        for name, value in (("softening_per_m2", 1e9), ("damping_growth_per_m2", 1e10))
    }
    rigid = {"contact.tangential_series_compliance_m_per_n": 0.0}
    soft = contact.tangential_series_compliance_m_per_n > 0.0
    return {
        "as in the set": {},
        **({"no compliance along the rotor": rigid} if soft else {}),
        "no dielectric loss": {"piezo.loss_tangent": 0.0},
        "fixed distance instead of the mount": {"mount": None},
        "restitution 1": {"contact.restitution": 1.0},
        "restitution 0.8 at 0.1 m/s": {"contact.restitution": 0.8, "contact.restitution_velocity_m_s": 0.1},
        "sliding friction 0.8 of static, over 50 mm/s": {
            "contact.sliding_ratio": 0.8,
            "contact.stribeck_velocity_m_s": 0.05,
            **(rigid if soft else {}),
        },
        f"dry bearing, {1e3 * friction:.2g} mN·m": {"rotor.bearing_friction_n_m": friction},
        "series compliance that halves the stiffness of the contact": {
            "contact.series_compliance_m_per_n": 1.0 / stiffness
        },
        "softening of 0.1 % and 1 % more loss at 1 µm, all modes": softer,
    }


def row(motor: pr.Motor, drive: pr.TwoPhaseDrive, speeds: list[float], law: pr.Law) -> tuple[float, float, float]:
    """Return stall torque in N·m, no-load speed in rad/s and best efficiency."""
    curve = pr.speed_torque(motor, drive, speeds=speeds, contact=law, audit=False)
    load, efficiency = curve["load_torque_n_m"].values, curve["efficiency"].values
    above = np.flatnonzero((load[:-1] > 0.0) & (load[1:] <= 0.0))
    free = float("nan")
    if above.size:
        at = int(above[0])
        free = speeds[at] + (speeds[at + 1] - speeds[at]) * load[at] / (load[at] - load[at + 1])
    return float(curve["torque_n_m"].values[0]), float(free), float(np.nanmax(efficiency[load > 0.0], initial=0.0))


def seconds(motor: pr.Motor, drive: pr.TwoPhaseDrive, law: pr.Law) -> float:
    """Return the least processor time of a run in s."""
    least = float("inf")
    for _ in range(RUNS):
        before = getrusage(RUSAGE_CHILDREN).ru_utime
        pr.simulate(motor, drive, duration=1e-3, step=1e-7, contact=law, audit=False)
        least = min(least, getrusage(RUSAGE_CHILDREN).ru_utime - before)
    return least


def table(motor: pr.Motor, drive: pr.TwoPhaseDrive, speeds: list[float]) -> list[str]:
    """Return the rows of one motor at one drive."""
    lines = ["| effect | stall, mN·m | no load, rad/s | efficiency | time |", "|---|---|---|---|---|"]
    base = None
    cases = {name: (changes, pr.Law()) for name, changes in effects(motor).items()}
    cases["contact law `brush` of 8 sliders"] = {}, pr.Law("brush", 8)
    for name, (changes, law) in cases.items():
        changed = motor.updated(changes) if changes else motor
        stall, free, best = row(changed, drive, speeds, law)
        cost = seconds(changed, drive, law)
        base = base or cost
        shown = "–" if free != free else f"{free:.1f}"
        lines.append(f"| {name} | {1e3 * stall:.2f} | {shown} | {100 * best:.2g} % | {cost / base:.2f} |")
    return lines


SQUARE = """## Dielectric loss under a square wave

A half bridge applies the odd harmonics of its frequency; edges of some 30 ns leave those up to 10 MHz. The table has
the dielectric loss of group A, $\\frac12\\sum V_n^2\\,\\mathrm{Re}\\,Y(n\\omega)$, for a square wave and for its
fundamental alone. The ladder of the model has a constant loss tangent. One resistance in series or in parallel has the
same loss tangent at the drive's frequency only; in series it makes the loss of the square wave several times too high.

| motor, square wave | circuit of the loss | fundamental, mW | square wave, mW | ratio to the ladder |
|---|---|---|---|---|
"""


def square_wave_loss(motor: pr.Motor, amplitude_v: float, frequency_hz: float) -> dict[str, tuple[float, float]]:
    """Return the dielectric loss in W of group A, under the fundamental and under all harmonics, by circuit."""
    loss_tangent, capacitance = motor.piezo.loss_tangent, motor.piezo.capacitance_a_f
    order = np.arange(1, int(HIGH_HZ / frequency_hz) + 1, 2)
    harmonics = 4.0 * amplitude_v / (np.pi * order)
    s = 2j * np.pi * frequency_hz * order
    tau = loss_tangent / (2.0 * np.pi * frequency_hz)
    ladder = sum(s * c / (1.0 + s * r * c) for r, c in lossy_capacitance(capacitance, loss_tangent))
    circuits = {
        "ladder": np.real(ladder),
        "resistance in series": np.real(s * capacitance / (1.0 + s * tau)),
        "resistance in parallel": np.full(len(order), 2.0 * np.pi * frequency_hz * capacitance * loss_tangent),
    }
    powers = {name: 0.5 * harmonics**2 * conductance for name, conductance in circuits.items()}
    return {name: (float(power[0]), float(power.sum())) for name, power in powers.items()}


def square_waves() -> str:
    """Return the table of the losses under a square wave."""
    lines = []
    for name, amplitude, frequency in (("andersen2002-unintended-mode", 100.0, 46e3), ("bimodal40", 150.0, 40.7e3)):
        losses = square_wave_loss(pr.load_motor(name), amplitude, frequency)
        for circuit, (sine, square) in losses.items():
            lines.append(
                f"| `{name}`, ±{amplitude:g} V, {frequency / 1e3:g} kHz | {circuit} | {1e3 * sine:.1f} | "
                f"{1e3 * square:.1f} | {square / losses['ladder'][1]:.2f} |\n"
            )
    return SQUARE + "".join(lines)


def page() -> str:
    """Measure and return the text of the page."""
    paper = pr.load_motor("andersen2002-unintended-mode")
    new = pr.load_motor("bimodal40")
    speeds = [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 37.5, 45.0]
    parts = [HEAD.format(count=len(speeds), fastest=speeds[-1], runs=RUNS)]
    for frequency in (44.5e3, 46e3):
        drive = pr.TwoPhaseDrive(voltage=100.0, frequency=frequency, phase_deg=180.0)
        parts.append(f"## `{paper.name}`, {drive.label}\n")
        parts += [*table(paper, drive, speeds), ""]
    drive = pr.default_drive(new)
    assert isinstance(drive, pr.TwoPhaseDrive)
    parts.append(f"## `{new.name}`, {drive.label}\n")
    parts += [*table(new, drive, speeds), ""]
    return "\n".join(parts) + "\n" + square_waves()


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")
