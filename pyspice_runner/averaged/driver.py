# SPDX-License-Identifier: GPL-3.0-or-later
"""A driver in front of the averaged motor: the fundamental of its stages, and its network as ``driver_averaged``."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.circuit.source import GROUPS, DriveSource
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.drivers.parts import CABLE
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, TwoPhaseDrive, two_phases
from pyspice_runner.spice.library import read_library

_LIBRARY = "driver_averaged"
MOST_WINDING = 0.05  # (drive frequency / self-resonance of a coil)²: the slope of its reactance is within 10 %
MOST_CABLE = 5.0  # ohm of a cable that is left out, behind a filter or alone: a hundredth of a group's reactance
_INDUCTOR = {"series_inductance": "inductance", "series_resistance": "resistance", "series_capacitance": "capacitance"}


@dataclass(frozen=True)
class AveragedDrive:
    """Voltages of the stages, and the networks behind them."""

    stage: TwoPhaseDrive  # fundamental of the stages; without a network the voltages of the groups
    driver: Driver | None = None  # ideal sources with the network
    given: Driver | None = None  # the driver as it was given

    @classmethod
    def of(cls, drive: Drive | Driver) -> AveragedDrive:
        """Return the drive and the network in front of the averaged motor.

        Raise ParameterError for a drive with two frequencies, or for too large a cable or capacitance of a winding.
        """
        if isinstance(drive, TwoPhaseDrive):
            return cls(drive)
        if isinstance(drive, Drive):
            raise ParameterError(
                "The averaged motor takes a drive with one frequency, a TwoPhaseDrive or a Driver, not "
                f"{drive.label}: use simulate."
            )
        same = drive.equivalent
        _check(same)
        return cls(TwoPhaseDrive(**two_phases(same)), None if same.network == "none" else same, drive)

    @property
    def networks(self) -> tuple[dict[str, float], ...]:
        """Parameters of ``driver_averaged`` of each group; empty without a network."""
        return tuple(_network_values(self.driver, group) for group in GROUPS) if self.driver else ()

    def add(self, circuit: Circuit, after: str = "drive", frequency: str = "set_frequency") -> None:
        """Add the networks between the nodes ``stage_GROUP_PART`` and ``AFTER_GROUP_PART``; PART is re or im.

        ``frequency`` is the node of the frequency.
        """
        circuit.raw_spice += read_library(_LIBRARY).subcircuit + "\n"
        for group, values in zip(GROUPS, self.networks, strict=True):
            pins = [groups.column(place, group, part) for place in ("stage", after) for part in ("re", "im")]
            instantiate(circuit, groups.named("network", group), _LIBRARY, (*pins, frequency), **values)

    def to_dict(self) -> dict[str, Any]:
        """Return the drive or driver that was given, JSON-ready."""
        return self.given.to_dict() if self.given else DriveSource(self.stage).to_dict()


def _network_values(driver: Driver, group: str) -> dict[str, float]:
    """Return the parameters of ``driver_averaged`` that stand for the network and the cable of a group."""
    network, *cables = driver.parts(group)
    names = {item.name: item.name for item in read_library(_LIBRARY).parameters} | (
        _INDUCTOR if network.label == "inductor" else {}
    )
    found = {ours: network.values[theirs] for ours, theirs in names.items() if theirs in network.values}
    # a winding with its capacitance is a larger inductance and resistance at the drive frequency
    omega = 2.0 * pi * driver.frequency
    rise = 1.0 / (1.0 - omega**2 * found["series_inductance"] * network.values["winding_capacitance"])
    found["series_inductance"] *= rise
    found["series_resistance"] *= rise**2
    for cable in cables:
        capacitance = cable.values["capacitance"]
        found["parallel_capacitance"] = found.get("parallel_capacitance", 0.0) + capacitance
        if network.label == "inductor":
            found["series_inductance"] += cable.values["inductance"]
            found["series_resistance"] += cable.values["resistance"]
    return found


def _check(driver: Driver) -> None:
    """Raise ParameterError for a driver whose network the averaged one does not stand for."""
    omega = 2.0 * pi * driver.frequency
    for group in GROUPS:
        parts = {part.label: part.values for part in driver.parts(group)}
        for label, values in parts.items():
            coil = values.get("series_inductance", values.get("inductance", 0.0))
            share = omega**2 * coil * values.get("winding_capacitance", 0.0)
            if share > MOST_WINDING:
                given, most = values["winding_capacitance"], MOST_WINDING / (omega**2 * coil)
                raise ParameterError(
                    f"Driver: {label}.winding_capacitance = {given:g} F is out of range for the averaged motor: it "
                    f"must be ≤ {most:.3g} F. Or use the full motor."
                )
        cable = parts.get(CABLE)
        ohms = abs(complex(cable["resistance"], omega * cable["inductance"])) if cable else 0.0
        if ohms > MOST_CABLE and driver.network != "inductor":
            raise ParameterError(
                f"Driver: a cable of {ohms:.3g} ohm at the drive frequency is out of range for the averaged motor: it "
                f"must have ≤ {MOST_CABLE:g} ohm. Or use the full motor."
            )
