# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor bimodal40 over the tolerances of its contact, its ceramic and its width: docs/bimodal40_bands.json.

``python -m docs.bimodal40_bands`` computes 60 motors, a Latin hypercube, in about 5 minutes on two cores and can be
resumed. The frequency of each is tuned again, as by a driver that comes from above the resonances: in steps of
20 Hz down to the first that gives the rated force at the rated speed. The width changes the modes, which plate theory
gives for each motor.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

import pyspice_runner as pr
from pyspice_runner.motor.load import SETS, changed_motor, stated_solid
from pyspice_runner.motor.solid.parameters import Solid

NAME = "bimodal40"
FILE = Path(__file__).with_name("bimodal40_bands.json")
COUNT = 60
BAND = {  # lowest and highest value; factors of the set's value but for friction, restitution and the width in m
    "friction": (0.2, 0.4),
    "restitution": (0.9, 1.0),
    "quality_factor": (0.7, 1.3),
    "contact_modulus": (0.7, 1.3),
    "width_change_m": (-50e-6, 50e-6),
}
RATED_FORCE_N, RATED_SPEED_M_S = 3.0, 0.3
FREQUENCIES_HZ = np.arange(41.4e3, 39.9e3, -20.0)
SPEEDS_M_S = (0.0, 0.15, 0.3, 0.4, 0.5, 0.6, 0.7)
TABLE = ("force_n", "power_w", "efficiency", "ceramic_stress_pa", "temperature_rise_k", "peak_pressure_pa")


def samples(count: int = COUNT) -> list[dict[str, float]]:
    """Return the values of the band for each motor."""
    low, high = np.transpose(list(BAND.values()))
    points = qmc.scale(qmc.LatinHypercube(len(BAND), seed=0).random(count), low, high)
    return [dict(zip(BAND, map(float, point), strict=True)) for point in points]


def plate(solid: Solid, width_change_m: float) -> Iterator[tuple[str, Any]]:
    """Yield the changes of a solid that make it a plate of another width, whose electrodes meet in the middle."""
    length, width, _ = solid.boxes[0].to_m
    other = width + width_change_m

    def moved(point: tuple[float, ...], *, electrode: bool) -> list[float]:
        x, y, z = point
        if not electrode:
            return [x, other if y == width else y and y + 0.5 * width_change_m, z]
        return [x if x in (0.0, length) else 0.5 * length, y and (other if y == width else 0.5 * other), z]

    yield "solid.theory", "plate"
    yield "solid.element_m", 1e-3
    for name, parts in (("boxes", solid.boxes), ("electrodes", solid.electrodes)):
        for index, part in enumerate(parts):
            for end in ("from_m", "to_m"):
                yield f"solid.{name}.{index}.{end}", moved(getattr(part, end), electrode=name == "electrodes")
    for end in ("from_m", "to_m"):
        yield f"solid.contact.{end}", moved(getattr(solid.contact, end), electrode=False)


def motor_of(sample: Mapping[str, float] | None = None) -> pr.Motor:
    """Return the motor by plate theory, with the values of a sample."""
    solid = stated_solid(SETS / f"{NAME}.toml")
    assert solid is not None
    changes = dict(plate(solid, sample["width_change_m"] if sample else 0.0))
    if sample:
        contact, modulus = pr.load_motor(NAME).contact, sample["contact_modulus"]
        changes |= {
            "solid.quality_factor": sample["quality_factor"] * solid.quality_factor,
            "contact.friction": sample["friction"],
            "contact.restitution": sample["restitution"],
            "contact.normal_stiffness_n_per_m15": modulus * contact.normal_stiffness_n_per_m15,
        }
        for body in ("tip", "rotor"):  # Johnson's constant: (E*)^(1/3)/G
            name = f"tangential_compliance_{body}_m_per_n23"
            changes[f"contact.{name}"] = modulus ** (-2 / 3) * getattr(contact, name)
    return changed_motor(NAME, changes)


def tuned(motor: pr.Motor) -> pr.TwoPhaseDrive | None:
    """Return the set's drive at the first frequency from above with the rated force at the rated speed, or None."""
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    radius = motor.rotor.radius_m
    for frequency in FREQUENCIES_HZ:
        trial = drive.updated({"frequency": float(frequency)})
        if pr.steady_state(motor, trial, speed=RATED_SPEED_M_S / radius).torque_n_m >= RATED_FORCE_N * radius:
            return trial
    return None


def curve(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> dict[str, Any]:
    """Return the curve at a drive: lists over SPEEDS_M_S, forces and speeds at the rim."""
    radius = motor.rotor.radius_m
    found = pr.speed_torque(motor, drive, speeds=[speed / radius for speed in SPEEDS_M_S], audit=False)
    columns = {name: found[name].to_numpy() for name in TABLE if name in found}
    columns["force_n"] = found["load_torque_n_m"].to_numpy() / radius
    columns["power_w"] = (found["power_a_w"] + found["power_b_w"]).to_numpy()

    def rounded(values: Sequence[float]) -> list[float | None]:
        return [None if np.isnan(value) else float(f"{value:.4g}") for value in values]

    lists = {name: rounded(values) for name, values in columns.items()}
    return {"frequency_hz": drive.frequency, "settled": bool(found["settled"].all()), **lists}


def measured(numbered: tuple[int, Mapping[str, float]]) -> tuple[int, dict[str, Any]]:
    """Return the values of a motor of the band, with its curve if it was tuned."""
    number, sample = numbered
    motor = motor_of(sample)
    drive = tuned(motor)
    return number, {**sample, **(curve(motor, drive) if drive else {})}


def free_speed(speeds_m_s: Sequence[float], motor: Mapping[str, Any]) -> float:
    """Return the speed without load in m/s, or the greatest speed of the curve if the motor still pulls there."""
    return float(np.interp(0.0, -np.array(motor["force_n"]), speeds_m_s))


def stored() -> dict[str, Any]:
    """Return the content of the file: the speeds of the curves, and the motors by their number."""
    return dict(json.loads(FILE.read_text(encoding="utf-8")))


def main() -> None:
    """Compute what is missing in the file."""
    found: dict[str, Any] = stored()["motors"] if FILE.exists() else {}
    wanted = [(number, sample) for number, sample in enumerate(samples()) if str(number) not in found]
    with Pool(2) as pool:
        for number, values in pool.imap_unordered(measured, wanted):
            found[str(number)] = values
            lines = ",\n".join(f'"{key}": {json.dumps(found[key])}' for key in sorted(found, key=int))
            text = f'{{"speeds_m_s": {json.dumps(SPEEDS_M_S)}, "motors": {{\n{lines}\n}}}}\n'
            FILE.write_text(text, encoding="utf-8")
            sys.stdout.write(f"{len(found)} of {COUNT}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
