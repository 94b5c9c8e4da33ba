# SPDX-License-Identifier: GPL-3.0-or-later
"""Ratings of the transistors of a bridge: currents and temperature of the junction.

They are those of the data sheet of a built-in MOSFET, in the ``RATING`` lines of its library; of the user's own those
of its ``.model``, by their names in ngspice. Fields of the driver, as ``drain_a``, take their place.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from math import inf, isfinite
from typing import TYPE_CHECKING

from pyspice_runner.drivers.driver import RATED, Driver
from pyspice_runner.drivers.parts import MOSFETS, ratings
from pyspice_runner.spice.library import number

if TYPE_CHECKING:
    from pyspice_runner.drivers.loads import PartLoad

# rating → parameters of a VDMOS in ngspice, breakdown and those of its check of the safe operating area
_OF_MODEL = {
    "breakdown_v": ("bv", "vds_max"), "drain_pulsed_a": ("id_max",), "junction_c": ("te_max",),
    "junction_case_k_per_w": ("rthjc",), "case_ambient_k_per_w": ("rth_ext", "rthca"),
}  # fmt: skip
_STATED = re.compile(r"\b([a-z_]+)\s*=\s*(\d[\d.]*(?:e[-+]?\d+)?(?:meg|[kmu])?)", re.I)


def transistor_ratings(driver: Driver) -> dict[str, float]:
    """Return the ratings of the transistors of a bridge, by their names; infinite where not known."""
    found = dict.fromkeys(("breakdown_v", *RATED), inf)
    if driver.mosfet in MOSFETS:
        found |= {name: getattr(ratings(driver.mosfet), name) for name in found}
    stated = [(name.lower(), number(value)) for name, value in _STATED.findall(driver.own_text)]
    for rating, names in _OF_MODEL.items():
        known = next((values for name in names if (values := [value for key, value in stated if key == name])), [])
        found[rating] = min(known, default=found[rating])
    return found | {name: value for name in RATED if (value := getattr(driver, name))}


def rated(driver: Driver, part: PartLoad) -> PartLoad:
    """Return a transistor with the temperature of its junction, and its values that exceed its ratings."""
    found = transistor_ratings(driver)
    resistance = found["junction_case_k_per_w"] + found["case_ambient_k_per_w"]
    hot = None if part.loss_w is None or not isfinite(resistance) else driver.ambient_c + part.loss_w * resistance
    rows = [
        ("peak", part.peak_voltage_v, "V", found["breakdown_v"], "breakdown"),
        ("peak", part.peak_current_a, "A", found["drain_pulsed_a"], "pulsed"),
        ("RMS", part.rms_current_a, "A", found["drain_a"], "continuous"),
        ("junction", hot, "°C", found["junction_c"], "maximum"),
    ]
    exceeds = tuple(
        f"{what} {value:.4g} {unit}, {rating} {limit:.4g} {unit}"
        for what, value, unit, limit, rating in rows
        if value is not None and value > limit
    )
    return replace(part, junction_c=hot, exceeds=exceeds)


def rating_notes(parts: Iterable[PartLoad]) -> list[str]:
    """Return one sentence for each type of transistor that exceeds its ratings, with its groups and what to do."""
    words = {
        "breakdown": "lower the rail",
        "pulsed": "raise supply_rise_s against a peak at power-up",
        "continuous": "lower the voltage",
        "maximum": "lower case_ambient_k_per_w by a heat sink",
    }
    found: dict[str, list[str]] = {}
    for part in parts:
        name, _, group = part.name.partition(", ")
        if part.exceeds:
            found.setdefault(name, []).append(f"{group}: {', '.join(part.exceeds)}")
    return [
        f"The {name} exceeds its ratings ({told}): take another MOSFET, or "
        f"{', or '.join(remedy for word, remedy in words.items() if word in told)}."
        for name, groups in found.items()
        if (told := "; ".join(groups))
    ]
