# SPDX-License-Identifier: GPL-3.0-or-later
"""Phasors of the linear parts between a stage and a pin: ``driver_inductor``, ``driver_llcc`` and ``driver_cable``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

CABLE = "cable"  # label of the part between network and pin
NO_CAPACITOR = 1.0  # F in series, which stands for none


class Passed(NamedTuple):
    """A part in a linear steady state. Phasors are complex numbers or arrays of them."""

    volts: Any  # in front of it, V
    amperes: Any  # into it, A
    inner: Any  # voltage at the node ``inner`` of a network
    stores: dict[str, Any]  # currents of its inductances and voltages of its capacitances, by device in lower case


def passed(label: str, values: Mapping[str, float], volts: Any, amperes: Any, omega: float) -> Passed | None:
    """Return the phasors in front of a part for those behind it, at an angular frequency in rad/s.

    ``None`` for a part that is none of these. Below 0 rad/s the phasors are conjugate ones.
    """
    if label == CABLE:
        through = amperes + 1j * omega * values["capacitance"] * volts
        before = volts + (values["resistance"] + 1j * omega * values["inductance"]) * through
        return Passed(before, through, volts, {"lline": through, "cline": volts})
    if label not in ("inductor", "llcc"):
        return None
    prefix, through, across = "", amperes, 0j
    if label == "llcc":
        prefix = "series_"
        across = volts / (values["parallel_resistance"] + 1j * omega * values["parallel_inductance"])
        through = amperes + across + 1j * omega * values["parallel_capacitance"] * volts
    capacitance, capacitor = values[f"{prefix}capacitance"], 0j
    if capacitance != NO_CAPACITOR:
        capacitor = through / (1j * omega * capacitance + 1.0 / values["bleeder"])
    coil = values[f"{prefix}resistance"] + 1j * omega * values[f"{prefix}inductance"]
    winding = through * coil / (1.0 + 1j * omega * values["winding_capacitance"] * coil)
    stores = {"lseries": winding / coil, "cseries": capacitor, "cwinding": winding, "lparallel": across}
    return Passed(volts + capacitor + winding, through, volts + capacitor, stores | {"cparallel": volts})
