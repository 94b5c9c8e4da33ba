# SPDX-License-Identifier: GPL-3.0-or-later
"""What a spectrum, a data sheet and a speed–torque curve decide of a motor whose values are known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from style import BLACK, BLUE, ORANGE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.run.paths import parameter
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states

FREE = {  # path → words
    "contact.friction": "friction", "contact.normal_stiffness_n_per_m15": "normal stiffness",
    "contact.tangential_compliance_tip_m_per_n23": "tangential compliance", "contact.restitution": "restitution",
    "contact.preload_n": "preload", "modes.0.quality_factor": "Q of mode 1", "modes.1.quality_factor": "Q of mode 2",
    "modes.0.coupling_a_n_per_v": "coupling of mode 1", "modes.1.coupling_a_n_per_v": "coupling of mode 2",
}  # fmt: skip
BANDS = {"free": (41e3, 55e3), "preloaded": (41e3, 60e3)}  # Hz
NOISE, SHEET = 0.01, 0.05  # relative errors of measurements, and of a data sheet
SPREAD = 0.2  # of the logarithm of each value
VOLTAGES, SPEEDS = (60.0, 100.0), (0.5, 3.0, 6.0, 9.0, 12.0, 15.0)  # V; rad/s
SEED = 7


def measured(
    motor: pr.Motor, rows: list[dict[str, float]], names: list[str], error: float, seed: int
) -> dict[str, Any]:
    """Return measured points: conditions by rows, quantities with an error relative to the maximum."""
    drive, rng = pr.default_drive(motor), np.random.default_rng(seed)
    states = steady_states([
        Point.of(motor, drive.updated({"voltage": row["voltage"]}), speed=row.get("speed_rad_s"),
                          load_torque=row.get("load_torque_n_m", 0.0), audit=False)
        for row in rows
    ])  # fmt: skip
    columns: dict[str, Any] = {
        name: [row.get(name) for row in rows] for name in dict.fromkeys(k for r in rows for k in r)
    }
    for name in names:
        values = np.array([getattr(state, name) for state in states])
        deviation = error * np.abs(values).max()
        columns[name] = values + deviation * rng.standard_normal(len(values))
        columns[f"{name}_error"] = np.full(len(values), deviation)
    return columns


def spectra(motor: pr.Motor) -> list[Any]:
    """Return noisy spectra of the free stator and of the stator on its rotor."""
    found, rng = [], np.random.default_rng(SEED)
    for state, (start, stop) in BANDS.items():
        clean = pr.admittance(motor, start=start, stop=stop, points=121, state=state)  # type: ignore[arg-type]
        values = clean.driven("A")
        values = values + NOISE * np.abs(values) * (
            rng.standard_normal(len(values)) + 1j * rng.standard_normal(len(values))
        )
        found.append((Spectrum.from_admittance(clean.frequency_hz, values, source=f"{state}.csv"), state))
    return found


def data_sheet(truth: pr.Motor) -> dict[str, Any]:
    """Return torque and current near stall and at a rated speed, and the speed without a load, of a data sheet."""
    held = measured(truth, [{"voltage": 100.0, "speed_rad_s": speed} for speed in (0.5, 8.0)],
                    ["torque_n_m", "current_a_rms_a"], SHEET, SEED)  # fmt: skip
    idle = measured(truth, [{"voltage": 100.0, "load_torque_n_m": 0.0}], ["speed_rad_s"], SHEET, SEED + 1)
    return {name: [*held.get(name, [None] * 2), *idle.get(name, [None])] for name in dict.fromkeys([*held, *idle])}


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002-unintended-mode").updated({"contact.restitution": 0.7})
    start = motor.model_copy(update={"modes": motor.modes[1:], "provenance": {}})
    drive, rng = pr.default_drive(start), np.random.default_rng(SEED)
    values = {path: parameter(path, start, drive, {}).nominal or 0.0 for path in FREE}
    true = {path: value * float(np.exp(SPREAD * rng.uniform(-1.0, 1.0))) for path, value in values.items()}
    truth = start.updated(true)
    both, sheet = spectra(truth), data_sheet(truth)
    rows = [{"voltage": volts, "speed_rad_s": speed} for volts in VOLTAGES for speed in SPEEDS]
    curve = measured(truth, rows, ["torque_n_m", "current_a_rms_a"], NOISE, SEED)
    cases = {
        "free spectrum and data sheet": (sheet, both[:1], VERMILION),
        "two spectra and data sheet": (sheet, both, ORANGE),
        "two spectra and twelve points": (curve, both, BLUE),
    }
    figure, axes = canvas(1, 1, 6.4)
    axis = axes if not isinstance(axes, np.ndarray) else axes.flat[0]
    decided = []
    for number, (name, (points, some, colour)) in enumerate(list(cases.items())[: 1 if draft() else None]):
        result = pr.calibrate(start, points, free=list(FREE), spectra=some)
        for place, one in enumerate(reversed(result.estimates)):
            low, high = sorted(end / true[one.path] for end in one.interval_95)
            height = place + 0.22 * (1 - number)
            axis.plot([low, high], [height, height], color=colour, lw=2.2, label=name if place == 0 else None)
            axis.plot(one.value / true[one.path], height, "o", color=colour, ms=4.5,
                      mfc=colour if one.identifiable else "white")  # fmt: skip
        open_ones = [FREE[one.path] for one in result.estimates if not one.identifiable]
        decided.append(f"{name}: {', '.join(open_ones) or 'none'}")
    axis.axvline(1.0, color=BLACK, lw=0.8)
    axis.set_yticks(range(len(FREE)), list(reversed(FREE.values())))
    axis.set(xscale="log", xlabel="value over the true one, with its 95 % interval", xlim=(0.1, 10.0))
    axis.set_xticks([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0], ["0.1", "0.2", "0.5", "1", "2", "5", "10"])
    axis.minorticks_off()
    axis.legend(loc="lower left")
    words = (
        "Motor of two modes, values up to 20 % off those at the start. Data sheet: torque and current at 0.5 and 8 "
        "rad/s, speed without load, 5 % each. Spectra and points: 1 % noise. Not decided (rings), with "
        f"{'; with '.join(decided)}."
    )
    path = folder / "decided.png"
    write(figure, path, "Parameters that the measurements identify", words)
    return [str(path), words]


if __name__ == "__main__":
    main(draw, __doc__)
