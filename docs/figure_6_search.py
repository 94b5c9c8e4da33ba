# SPDX-License-Identifier: GPL-3.0-or-later
"""Search for a third mode that gives the paper's figure 6 on a sprung mount: ``python -m docs.figure_6_search``.

The experiment had high torque and low speed at 44.5 kHz, and low torque and high speed at 46 kHz. The paper's
conjecture is a mode near 45 kHz that moves the tip towards the rotor. This script draws such modes at random (a Sobol
sequence), with carriers of several masses, and then maps the surroundings of the best one. It writes
``docs/figure_6_search.json`` after every point and continues where it was stopped. It takes about ten minutes of one
core.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

import pyspice_runner as pr
from tests.reference.integrator import Tone, integrate

RECORD = Path(__file__).with_suffix(".json")
SET = "andersen2002-unintended-mode"
MODE = 1  # index of the unintended mode
CURVES = {"high_torque": 44.5e3, "high_speed": 46e3}  # Hz, the paper's two curves
VOLTAGE = 100.0  # V; the paper does not say it
SPEEDS = (0.0, 8.0, 16.0, 26.0, 40.0)  # rad/s
SETTLING, MEANS, OUTPUTS, STEP = 15e-3, 60, 40, 4e-7  # s; periods; samples a period; s, 1/54 of a period
DRAWN = 128
# frequency in Hz; the others as a multiple of the set's value, on a logarithmic scale
BOX = {
    "frequency_hz": (42.5e3, 46.5e3),
    "mass": (1 / 3, 3.0),
    "coupling": (1 / 3, 3.0),
    "damping": (1 / 3, 3.0),
    "carrier": (1 / 4, 4.0),
}
# of the map around the best mode that was drawn: frequency in Hz from that mode's, and coupling as a multiple of it
OFFSETS = np.arange(-800.0, 801.0, 200.0)
COUPLINGS = np.geomspace(0.5, 2.0, 5)
# a change of one parameter of the best mode at a time
CHANGES: dict[str, Mapping[str, float]] = {
    "frequency −1 %": {"frequency_hz": 0.99},
    "frequency +1 %": {"frequency_hz": 1.01},
    "quality factor halved": {"damping": 2.0},
    "quality factor doubled": {"damping": 0.5},
    "contact stiffness halved": {"contact.normal_stiffness_n_per_m15": 0.5},
    "contact stiffness doubled": {"contact.normal_stiffness_n_per_m15": 2.0},
    "restitution 0.9": {"contact.restitution": 0.9},
    "restitution 0.8": {"contact.restitution": 0.8},
    "carrier 4 times as heavy": {"carrier": 4.0},
}
NEUTRAL = {"mass": 1.0, "coupling": 1.0, "damping": 1.0, "carrier": 1.0}


def motor(point: Mapping[str, float]) -> pr.Motor:
    """Return the set with another third mode and carrier; the fields of ``point`` are those of ``BOX``."""
    return pr.load_motor(SET).updated(changes(point))


def changes(point: Mapping[str, float]) -> dict[str, float]:
    """Return the same as values of the set's parameters by their dotted paths."""
    base = pr.load_motor(SET)
    assert base.mount is not None
    mode = base.modes[MODE]
    mass = mode.mass_kg * point["mass"]
    stiffness = mass * (2.0 * np.pi * point["frequency_hz"]) ** 2
    # the damping follows from the quality factor of the set's mode, so that mass and frequency leave it alone
    damping = np.sqrt(stiffness * mass) / mode.quality_factor * point["damping"]
    path = f"modes.{MODE}."
    return {
        path + "mass_kg": mass,
        path + "stiffness_n_per_m": float(stiffness),
        path + "damping_n_s_per_m": float(damping),
        path + "coupling_a_n_per_v": mode.coupling_a_n_per_v * point["coupling"],
        path + "coupling_b_n_per_v": mode.coupling_b_n_per_v * point["coupling"],
        "mount.mass_kg": base.mount.mass_kg * point["carrier"],
        "mount.damping_n_s_per_m": base.mount.damping_n_s_per_m * np.sqrt(point["carrier"]),
    }


def measured(subject: pr.Motor) -> dict[str, Any]:
    """Return stall torque (N·m) and no-load speed (rad/s) at both frequencies, by the independent integrator.

    It settles in a fraction of a second, also where the tip hammers and Newton's method fails.
    """
    document = subject.to_dict()

    def torque(frequency: float, speed: float) -> float:
        run = integrate(
            document, [Tone(VOLTAGE, frequency)], [Tone(VOLTAGE, frequency, pi)], duration=SETTLING + MEANS / frequency,
            output_step=1.0 / (OUTPUTS * frequency), step=STEP, speed=speed,
        )  # fmt: skip
        late = run.time_s >= SETTLING
        return float(subject.rotor.radius_m * run.friction_force_n[late].mean())

    return _summary(
        {name: [torque(f, speed) - _bearing(subject, speed) for speed in SPEEDS] for name, f in CURVES.items()}
    )


def by_the_package(subject: pr.Motor) -> dict[str, Any]:
    """Return the same from ``speed_torque``."""
    curves = {}
    for name, frequency in CURVES.items():
        drive = pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=frequency, phase_deg=180.0)
        curves[name] = pr.speed_torque(subject, drive, speeds=SPEEDS)["load_torque_n_m"].values.tolist()
    return _summary(curves)


def _bearing(subject: pr.Motor, speed: float) -> float:
    return subject.rotor.bearing_damping_n_m_s * speed


def _summary(loads: Mapping[str, list[float]]) -> dict[str, Any]:
    """Return stall torque and no-load speed of curves of load torque (N·m) over ``SPEEDS``."""
    found: dict[str, Any] = {}
    for name, torque in loads.items():
        found[f"stall_{name}_n_m"] = torque[0]
        found[f"speed_{name}_rad_s"] = None  # it turns the other way, or faster than the last speed
        for k in range(len(SPEEDS) - 1):
            if torque[k] > 0.0 >= torque[k + 1]:
                share = torque[k] / (torque[k] - torque[k + 1])
                found[f"speed_{name}_rad_s"] = SPEEDS[k] + share * (SPEEDS[k + 1] - SPEEDS[k])
                break
    return found


def margin(found: Mapping[str, Any]) -> float:
    """Return by which factor, less 1, both orders of the paper hold: below 0 if one does not, −1 without a speed."""
    if (
        None in (found["speed_high_torque_rad_s"], found["speed_high_speed_rad_s"])
        or found["stall_high_speed_n_m"] <= 0.0
    ):
        return -1.0
    torques = found["stall_high_torque_n_m"] / found["stall_high_speed_n_m"]
    speeds = found["speed_high_speed_rad_s"] / found["speed_high_torque_rad_s"]
    return float(min(torques, speeds) - 1.0)


def drawn() -> list[dict[str, float]]:
    """Return the modes of the search."""
    unit = qmc.Sobol(len(BOX), seed=2002).random(DRAWN)
    points = []
    for row in unit:
        point = {}
        for (name, (low, high)), share in zip(BOX.items(), row, strict=True):
            point[name] = low + share * (high - low) if name == "frequency_hz" else low * (high / low) ** share
        points.append({name: float(value) for name, value in point.items()})
    return points


def changed(best: Mapping[str, float], change: Mapping[str, float]) -> pr.Motor:
    """Return the motor of the best mode with one change."""
    scaled = {name: value * change.get(name, 1.0) for name, value in best.items()}
    subject = motor(scaled)
    for path, value in change.items():
        if path == "contact.normal_stiffness_n_per_m15":
            subject = subject.updated({path: subject.contact.normal_stiffness_n_per_m15 * value})
        elif path == "contact.restitution":
            subject = subject.updated({path: value})
    return subject


def main() -> None:
    """Run what the record does not have yet."""
    record: dict[str, Any] = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}

    def write() -> None:
        RECORD.write_text(json.dumps(record, separators=(",", ":")) + "\n", encoding="utf-8")

    def run(
        table: str,
        key: str,
        point: Mapping[str, float],
        subject: pr.Motor,
        method: Callable[[pr.Motor], dict[str, Any]] = measured,
    ) -> dict[str, Any]:
        results = record.setdefault(table, {})
        if key not in results:
            found = method(subject)
            results[key] = {"point": dict(point), **found, "margin": margin(found)}
            write()
            print(f"{table} {key}: {results[key]['margin']:+.3f}", file=sys.stderr, flush=True)
        return dict(results[key])

    base = {"frequency_hz": pr.load_motor(SET).modes[MODE].frequency_hz, **NEUTRAL}
    run("set", "on the mount", base, motor(base))
    run("set", "at a fixed distance", base, motor(base).updated({"mount": None}))
    results = [run("search", str(number), point, motor(point)) for number, point in enumerate(drawn())]
    best = max(results, key=lambda one: float(one["margin"]))["point"]
    run("best", "on the mount", best, motor(best))
    record["best"]["changes"] = changes(best)
    write()
    run("best", "by the package", best, motor(best), by_the_package)
    run("best", "at a fixed distance", best, motor(best).updated({"mount": None}))
    for name, change in CHANGES.items():
        restituted = "contact.restitution" in change  # which the integrator does not have
        run("sensitivity", name, dict(change), changed(best, change), by_the_package if restituted else measured)
    for offset in OFFSETS:
        for factor in COUPLINGS:
            near = dict(best) | {
                "frequency_hz": best["frequency_hz"] + float(offset), "coupling": best["coupling"] * float(factor)
            }  # fmt: skip
            run("map", f"{offset:g} Hz, {factor:.4f}", near, motor(near))


if __name__ == "__main__":
    main()
