# SPDX-License-Identifier: GPL-3.0-or-later
"""What a part of a driver withstands, the core of a coil or transformer, and the ratings of transistors.

Ratings come from a data sheet, by the ``RATING`` lines of a library, or from the user's ``.model``. Fields of the
driver, such as ``drain_a``, replace them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass, fields, replace
from math import inf, isfinite, sqrt
from types import MappingProxyType
from typing import Any

from pyspice_runner.drivers import parts as stock
from pyspice_runner.drivers.driver import RATED, Driver
from pyspice_runner.drivers.magnetics import Wound, wound, wound_transformer
from pyspice_runner.drivers.parts import CABLE, MOSFETS, ratings
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.spice.library import number
from pyspice_runner.units import engineering

TRANSISTOR = "MOSFET"  # first word of the names of transistors
TRANSFORMER = "transformer"  # of the names of values of transformers
# parameters of a VDMOS in ngspice: breakdown, thermal resistances and its check of the safe operating area
_OF_MODEL = {
    "bv": "breakdown_v", "id_max": "drain_pulsed_a", "te_max": "junction_c", "rthjc": "junction_case_k_per_w",
    "rthca": "case_ambient_k_per_w",
}  # fmt: skip
_PEAKS = ("peak_voltage_v", "peak_current_a", "primary_peak_voltage_v", "primary_peak_current_a")
_MODEL = re.compile(r"^\.model\s+\S+\s+(?:vdmos|nmos)\b(.*)", re.I | re.M)
_STATED = re.compile(rf"\b({'|'.join(_OF_MODEL)})\s*=\s*([^\s()=]*)", re.I)


@dataclass(frozen=True)
class PartLoad:
    """A part of a driver, with its value and what it must withstand; ``None`` where that does not apply.

    RMS values, ripple and loss describe a settled state: the operating point of a design, else the last periods of a
    run. Of several transistors the one with the largest values counts.
    """

    name: str  # with its group, for a table
    value: float  # in its unit
    unit: str  # H, F, Ω, V, s, or 1 for a ratio of turns or a number of pieces
    peak_voltage_v: float | None  # largest voltage across it
    peak_current_a: float | None  # largest current through it
    # smallest and largest peak at power-up, by the recovery of body diodes; of transistors and supplies of a design
    peak_range_a: tuple[float, float] | None = None
    rms_voltage_v: float | None = None
    rms_current_a: float | None = None
    apparent_power_va: float | None = None  # RMS voltage times RMS current
    ripple_v: float | None = None  # voltage of a capacitor from peak to peak in the last period
    loss_w: float | None = None  # mean loss, of one of several transistors
    junction_c: float | None = None  # of a transistor, if its thermal resistances are known
    exceeds: tuple[str, ...] = ()  # values of a transistor above its ratings, with these
    core: Wound | None = None  # proposal for a coil or a transformer; ``None`` where no core of the list takes it
    # of a transformer, whose other values describe the secondary; in a push-pull stage of a half
    primary_peak_voltage_v: float | None = None
    primary_peak_current_a: float | None = None
    primary_rms_voltage_v: float | None = None
    primary_rms_current_a: float | None = None
    group: str = ""  # a or b

    def words(self) -> str:
        """Return value, maxima and RMS values for a summary."""
        rows = {
            "peak": {"V": self.peak_voltage_v, "A": self.peak_current_a},
            "RMS": {"V": self.rms_voltage_v, "A": self.rms_current_a, "VA": self.apparent_power_va},
            "ripple": {"V": self.ripple_v}, "loss": {"W": self.loss_w}, "junction": {"°C": self.junction_c},
            "primary peak": {"V": self.primary_peak_voltage_v, "A": self.primary_peak_current_a},
            "primary RMS": {"V": self.primary_rms_voltage_v, "A": self.primary_rms_current_a},
        }  # fmt: skip
        between = " to ".join(dict.fromkeys(engineering(value, "A") for value in self.peak_range_a or ()))
        words = [engineering(self.value, self.unit.removesuffix("1")).rstrip()]
        for name, row in rows.items():
            known = [engineering(value, unit) for unit, value in row.items() if value is not None]
            words += [f"{name} {', '.join(known)}"] if known else []
        words += [f"at power-up {between} by the recovery of the body diodes"] if between else []
        return "; ".join([*words, *(f"EXCEEDED: {one}" for one in self.exceeds)])

    def beyond(self, largest_h: float) -> list[str]:
        """Return one sentence for each limit that a coil, whose largest inductance is given, or a capacitor exceeds."""
        volts, linkage = self.peak_voltage_v or 0.0, self.value * (self.peak_current_a or 0.0)
        limits = {
            "H": [
                ("inductance", self.value, stock.SMALLEST_INDUCTANCE, largest_h, "H"),
                ("flux linkage", linkage, 0.0, stock.LARGEST_FLUX, "V·s"),
                ("voltage", volts, 0.0, stock.HIGHEST_COIL_VOLTAGE, "V"),
            ],
            "F": [
                ("capacitance", self.value, stock.SMALLEST_CAPACITANCE, stock.LARGEST_CAPACITANCE, "F"),
                ("voltage", volts, 0.0, stock.HIGHEST_CAPACITOR_VOLTAGE, "V"),
            ],
        }[self.unit]
        return [
            f"The {self.name} has a {what} of {engineering(much, of)}; "
            f"the limit is {engineering(low if much < low else high, of)}."
            for what, much, low, high, of in limits
            if not low <= much <= high * (1.0 + 1e-9)
        ]

    def largest(self, others: Iterable[PartLoad]) -> PartLoad:
        """Return the part with the largest voltage and current of several runs."""
        every = (self, *others)
        several = {name: [value for one in every if (value := getattr(one, name)) is not None] for name in _PEAKS}
        most: dict[str, Any] = {name: max(values, default=None) for name, values in several.items()}
        return replace(self, **most)

    def settled(self, at: PartLoad) -> PartLoad:
        """Return the part with the RMS values, ripple and loss of another state."""
        return replace(at, **{name: getattr(self, name) for name in _PEAKS})


def transistor_ratings(driver: Driver) -> dict[str, float]:
    """Return the ratings of the transistors of a bridge, by their names; infinite where not known."""
    found = dict.fromkeys(("breakdown_v", *RATED), inf)
    if driver.mosfet in MOSFETS:
        found |= {name: getattr(ratings(driver.mosfet), name) for name in found}
    for name, value in _STATED.findall(" ".join(_MODEL.findall(driver.own_text.replace("\n+", " ")))):
        try:
            found[_OF_MODEL[name.lower()]] = number(value)
        except ParameterError:
            raise ParameterError(f"{driver.mosfet}: {name} = {value} is not a number: write 20 or 1.5k.") from None
    for name, rating in found.items():
        require(rating > 0.0, f"{driver.mosfet}: {name}", rating, "> 0")
    return found | {name: value for name in RATED if (value := getattr(driver, name))}


def judged(driver: Driver, part: PartLoad, cores: Mapping[str, Wound] = MappingProxyType({})) -> PartLoad:
    """Return a transistor with its ratings, a coil or a transformer with a core; ``cores`` are a design's."""
    if part.name.startswith(TRANSISTOR):
        return _rated(driver, part)
    rms = part.rms_current_a
    if part.name.startswith(TRANSFORMER) and rms:
        own = None if driver.kind == "push-pull" else part.primary_rms_current_a  # one of the halves has no half of it
        rms = driver.ratio(part.group) * rms if own is None else own
        return replace(part, core=wound_transformer(driver, part.group, rms, cores.get(part.group)))
    if part.unit == "H" and part.peak_current_a and rms and not part.name.startswith(CABLE):
        peak, settled = part.value * part.peak_current_a, sqrt(2.0) * part.value * rms
        return replace(part, core=wound(peak, settled, rms, driver.frequency, part.value))
    return part


def _rated(driver: Driver, part: PartLoad) -> PartLoad:
    """Return a transistor with the temperature of its junction, and its values that exceed its ratings."""
    found = transistor_ratings(driver)
    resistance = found["junction_case_k_per_w"] + found["case_ambient_k_per_w"]
    hot = None if part.loss_w is None or not isfinite(resistance) else driver.ambient_c + part.loss_w * resistance
    most = max(part.peak_current_a or 0.0, *(part.peak_range_a or (0.0,)))
    rows = [
        ("peak", part.peak_voltage_v, "V", found["breakdown_v"], "breakdown"),
        ("peak", most, "A", found["drain_pulsed_a"], "pulsed"),
        ("RMS", part.rms_current_a, "A", found["drain_a"], "continuous"),
        ("junction", hot, "°C", found["junction_c"], "maximum"),
    ]
    exceeds = tuple(
        f"{what} {value:.4g} {unit}, {rating} {limit:.4g} {unit}"
        for what, value, unit, limit, rating in rows
        if value is not None and value > limit
    )
    return replace(part, junction_c=hot, exceeds=exceeds)


def rating_notes(driver: Driver, parts: Iterable[PartLoad]) -> list[str]:
    """Return one sentence if transistors exceed their ratings, with their groups and what to do."""
    told = [
        f"{part.name.partition(', ')[2]}: {', '.join(exceeds)}"
        for part in parts
        if part.name.startswith(TRANSISTOR) and (exceeds := _rated(driver, part).exceeds)
    ]
    remedy = "Take another MOSFET, a lower rail or voltage, a slower supply_rise_s, or a lower case_ambient_k_per_w."
    name = driver.mosfet.rpartition(":")[2]
    return [f"The {TRANSISTOR} {name} exceeds its ratings ({'; '.join(told)}). {remedy}"] if told else []


def bill_of_materials(parts: Iterable[PartLoad]) -> list[list[str]]:
    """Return the rows of a table of parts to buy or to wind, the names of its columns first; SI units."""
    own = [one.name for one in fields(PartLoad) if one.name not in ("core", "exceeds", "group", "peak_range_a")]
    rows = [["quantity", *own, "exceeds", *(f"core_{one.name}" for one in fields(Wound))]]
    for part in parts:
        if part.unit not in ("V", "s"):  # of supplies and dead times
            quantity = part.value if part.name.startswith(TRANSISTOR) else 1.0
            core = astuple(part.core) if part.core else ()
            values = [quantity, *(getattr(part, name) for name in own), "; ".join(part.exceeds), *core]
            texts = [f"{value:.6g}" if isinstance(value, float | int) else value or "" for value in values]
            rows.append(texts + [""] * (len(rows[0]) - len(texts)))
    return rows
