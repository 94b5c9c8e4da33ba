# SPDX-License-Identifier: GPL-3.0-or-later
"""Proposals of cores for coils and transformers: area product, turns, gap, flux density, losses, temperature.

A core takes the flux linkage λ of its peak and the current I of its winding if its area product A_e A_w is at least
λ I/(k_u J B), with λ = L Î of a coil; for a transformer, I is the sum of the primary and the referred secondary current
(C. W. T. McLyman, Transformer and Inductor Design Handbook, 4th ed., chapters 7 and 8; R. W. Erickson, D. Maksimović,
Fundamentals of Power Electronics, 2nd ed., chapters 14 and 15). The turns give the smallest loss, within the
limits of flux density and gap. Cores and ferrite are in ``cores.toml``.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from math import ceil, pi, sqrt
from pathlib import Path
from typing import Any

from pyspice_runner.drivers.driver import Driver
from pyspice_runner.units import engineering

_MU_0 = 4e-7 * pi  # H/m
_COPPER = 2.0e-8  # Ω·m at 60 °C
_FILL = 0.4  # k_u, copper in the winding area: assumed, round enamelled wire and insulation
_CURRENT_DENSITY = 4e6  # J, A/m²: assumed, usual without a fan
_LEAST_GAP = 1e-4  # m, of a coil: below, its inductance depends on the permeability, which scatters by 25 %
_LEAST_MAGNETISING = 1e-4  # H, of the library of transformers
_RESIDUAL = 1e-5  # m, gap between ground faces: assumed; with it A_L of the sheets of RM 8 and ETD 34 within 15 %
_HOTTEST = 40.0  # K, rise of a proposal
_THINNEST = 1e-4  # m, wire
_OF_RATIO = 5e-3  # largest error of whole turns against the ratio of a transformer
_MORE_TURNS = 1.5  # times the turns of the smallest loss, up to which they are sought


@dataclass(frozen=True)
class Wound:
    """A coil or a transformer on a standard core."""

    name: str  # of the core
    turns: int  # of the coil, or of the primary
    secondary_turns: int  # 0 of a coil
    gap_m: float  # 0 of a transformer
    inductance_h: float  # of turns and gap; of a transformer the magnetising inductance
    peak_t: float  # flux density at the peak
    settled_t: float  # its amplitude in the settled state
    wire_m: float  # diameter of the copper, in the primary of a transformer
    skin_depths: float  # diameter over the skin depth; from 2 on litz wire is needed
    winding_ohm: float  # resistance of the coil or primary to direct current, at 60 °C
    winding_w: float  # loss in all windings by that resistance; skin and proximity effect come on top
    ferrite_w: float  # loss in the core
    rise_k: float  # above the ambient
    rms_a: float  # current for which it is; of a transformer the sum of primary and referred secondary
    instead_of: str = ""  # core of the design that does not take this current

    def words(self) -> str:
        """Return core, turns and losses for a summary."""
        second, ratio = "", self.secondary_turns / self.turns
        if ratio:
            second = f" and {self.secondary_turns} (1 : {ratio:.4g})"
        wire = "litz wire, copper as of" if self.skin_depths > 2.0 else "wire of"
        gap = f", gap {engineering(self.gap_m, 'm')}" if self.gap_m else ""
        instead = f"; {self.instead_of} of the design does not take the RMS current" if self.instead_of else ""
        return (
            f"{self.name} {_data()['material']['name']}: {self.turns}{second} turns, {wire} "
            f"{engineering(self.wire_m, 'm')}{gap}; {engineering(self.peak_t, 'T')} at the peak; winding "
            f"{engineering(self.winding_w, 'W')} at DC, core {engineering(self.ferrite_w, 'W')}, {self.rise_k:.3g} K "
            f"warmer{instead}"
        )


@cache
def _data() -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / "cores.toml").read_text(encoding="utf-8"))


def cores(frequency: float) -> list[tuple[str, dict[str, float]]]:
    """Return names and dimensions of the cores for a frequency in Hz; none above the range of the ferrite."""
    return list(_data()["cores"].items()) if frequency <= _data()["material"]["highest_hz"] else []


def wound(
    peak_v_s: float, settled_v_s: float, rms_a: float, frequency: float, inductance: float = 0.0, ratio: float = 0.0,
    kept: Wound | None = None,
) -> Wound | None:  # fmt: skip
    """Return the smallest core for a coil of an inductance in H, or a transformer of a ratio secondary to primary.

    The coil or the primary has these flux linkages, at the peak and the settled amplitude; the current is that of
    the coil, or the sum of primary and referred secondary current. ``kept`` has the smallest core, and its turns
    if it takes the current. ``None`` if no core of the list takes it, and above the frequencies of the ferrite.
    """
    iron, skin = _data()["material"], sqrt(_COPPER / (pi * frequency * _MU_0))
    listed = cores(frequency)
    for name, core in listed[[name for name, _ in listed].index(kept.name) if kept else 0 :]:
        path, turn = 1e-3 * core["path_mm"], 1e-3 * core["turn_mm"]
        area, copper = 1e-6 * core["area_mm2"], 1e-6 * core["window_mm2"] * _FILL
        if area * copper < peak_v_s * rms_a / (_CURRENT_DENSITY * iron["flux_density_t"]):
            continue
        magnetic = path / iron["permeability"]
        heat = _COPPER * turn / copper * rms_a**2  # of one turn
        loss = path * area * iron["loss_w_per_m3"] * (frequency / iron["frequency_hz"]) ** iron["alpha"]
        loss *= (settled_v_s / (area * iron["amplitude_t"])) ** iron["beta"]
        least = peak_v_s / (iron["flux_density_t"] * area)
        henries, least_gap = (inductance, _LEAST_GAP) if inductance else (_LEAST_MAGNETISING, _RESIDUAL)
        gapped = sqrt(henries * (least_gap + magnetic) / (_MU_0 * area))
        share = 0.5 if ratio else 1.0  # of the copper, in the primary
        most = 4.0 * share * copper / (pi * _THINNEST**2 * max(1.0, ratio))
        best = (iron["beta"] * loss / (2.0 * heat)) ** (1.0 / (iron["beta"] + 2.0))
        turns, secondary = ceil(max(least, gapped, min(best, most))), 0
        if ratio:
            turns, secondary = _turns(turns, ratio)
        if kept and kept.name == name:
            turns, secondary = kept.turns, kept.secondary_turns
        gap = _MU_0 * turns**2 * area / inductance - magnetic if inductance else 0.0
        winding_w, ferrite_w = heat * turns**2, loss / turns ** iron["beta"]
        wire = sqrt(4.0 * share * copper / (pi * turns))
        # S. A. Mulder, Loss formulas for power ferrites, Philips 1994: 53 K/W by the volume in cm³ to the power −0.54
        rise = 53.0 * (1e6 * path * area) ** -0.54 * (winding_w + ferrite_w)
        if rise <= _HOTTEST and turns <= most + 1.0:
            return Wound(
                name, turns, secondary, gap, _MU_0 * turns**2 * area / (magnetic + (gap or _RESIDUAL)),
                peak_v_s / (turns * area), settled_v_s / (turns * area), wire, wire / skin,
                _COPPER * turn * turns**2 / (share * copper), winding_w, ferrite_w, rise,
                rms_a, kept.name if kept and kept.name != name else "",
            )  # fmt: skip
    return None


def _turns(least: int, ratio: float) -> tuple[int, int]:
    """Return turns of the primary, from a minimum on, and of the secondary: the first within a tolerance of a ratio.

    If there are none, return the turns with the smallest error.
    """
    pairs = [(turns, max(round(ratio * turns), 1)) for turns in range(least, ceil(_MORE_TURNS * least) + 1)]
    errors = [abs(second / (ratio * first) - 1.0) for first, second in pairs]
    return pairs[next((at for at, error in enumerate(errors) if error <= _OF_RATIO), errors.index(min(errors)))]


def wound_transformer(driver: Driver, group: str, rms_a: float, kept: Wound | None = None) -> Wound | None:
    """Return a core for the transformer of a group, by the RMS current in A of its primary; ``kept`` if it takes it.

    At power-up the flux starts at zero instead of its negative peak, and reaches up to twice its amplitude (1.16 times
    with bimodal40 and a supply that rises in 20 µs).
    """
    high, low = driver.rails(group)
    volts = high - low if driver.kind in ("full-bridge", "push-pull") else high
    linkage = volts / ((4.0 if driver.switched else 2.0 * pi) * driver.frequency)  # of a square or a sine wave
    both = 1.0 + sqrt(2.0) if driver.kind == "push-pull" else 2.0  # windings; each half for a half of the time
    if kept and both * rms_a <= kept.rms_a:
        return kept
    return wound(2.0 * linkage, linkage, both * rms_a, driver.frequency, ratio=driver.ratio(group), kept=kept)
