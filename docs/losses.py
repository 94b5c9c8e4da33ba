# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the table of losses of ``docs/motors.md``, what each changes on bimodal40: ``python -m docs.losses``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.motor.dielectric import HIGH_HZ, lossy_capacitance

PAGE = Path(__file__).with_name("motors.md")
MARK, END = "<!-- table by python -m docs.losses -->", "<!-- end of the losses -->"
NAME = "bimodal40"
SPEEDS = (0.0, 10.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 60.0)  # rad/s
SHOWN = SPEEDS.index(30.0)


def effects(motor: pr.Motor) -> dict[str, dict[str, Any]]:
    """Return the changes by what they mean."""
    rigid = {"contact.tangential_series_compliance_m_per_n": 0.0}
    return {
        "as in the set": {},
        "no compliance along the rotor": rigid,
        "restitution 1": {"contact.restitution": 1.0},
        "restitution 0.8": {"contact.restitution": 0.8},
        "sliding friction 0.8 of static, above 50 mm/s": {
            "contact.sliding_ratio": 0.8,
            "contact.stribeck_velocity_m_s": 0.05,
            **rigid,
        },
        "softening of 0.1 % and 1 % more loss at 1 µm, all modes": {
            f"modes.{index}.{name}": value
            for index in range(len(motor.modes))
            for name, value in (("softening_per_m2", 1e9), ("damping_growth_per_m2", 1e10))
        },
    }


def row(motor: pr.Motor, drive: pr.TwoPhaseDrive, law: pr.Law) -> tuple[float, float, float, float]:
    """Return torques in N·m at stall and at the speed shown, no-load speed in rad/s, and best efficiency."""
    curve = pr.speed_torque(motor, drive, speeds=SPEEDS, contact=law, audit=False)
    load, efficiency = curve["load_torque_n_m"].values, curve["efficiency"].values
    free = float(np.interp(0.0, -load, SPEEDS)) if load[-1] < 0.0 else float("nan")
    best = float(np.nanmax(efficiency[load > 0.0], initial=0.0))
    return float(curve["torque_n_m"].values[0]), float(curve["torque_n_m"].values[SHOWN]), free, best


def table() -> str:
    """Return the table of the losses."""
    motor = pr.load_motor(NAME)
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    lines = [
        f"|effect|stall, mN·m|{SPEEDS[SHOWN]:g} rad/s, mN·m|no load, rad/s|maximum efficiency|",
        "|:--|:--|:--|:--|:--|",
    ]
    cases = {name: (changes, pr.Law()) for name, changes in effects(motor).items()}
    cases["contact law `brush` of 8 sliders"] = {}, pr.Law("brush", 8)
    for name, (changes, law) in cases.items():
        stall, moving, free, best = row(motor.updated(changes) if changes else motor, drive, law)
        speed = f"above {SPEEDS[-1]:g}" if np.isnan(free) else f"{free:.0f}"
        lines.append(f"|{name}|{1e3 * stall:.1f}|{1e3 * moving:.1f}|{speed}|{100 * best:.2g} %|")
    return "\n".join(lines).replace("|-", "|\N{MINUS SIGN}")


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


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    new = re.sub(rf"{MARK}\n.*?{END}", lambda _: f"{MARK}\n{table()}\n{END}", text, flags=re.S)
    PAGE.write_text(new, encoding="utf-8")
