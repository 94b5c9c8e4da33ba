# SPDX-License-Identifier: GPL-3.0-or-later
"""A driver in front of the averaged motor: the fundamental of its stages, and its network as ``driver_averaged``."""

from __future__ import annotations

from cmath import rect
from dataclasses import dataclass
from math import radians
from typing import Any

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.drive import Drive, TwoPhaseDrive, two_phases
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.library import read_library
from pyspice_runner.netlist.motor import instantiate
from pyspice_runner.netlist.networks import CABLE
from pyspice_runner.netlist.source import GROUPS
from pyspice_runner.netlist.sources import DriveSource

_LIBRARY = "driver_averaged"
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

        Raise ParameterError for a drive with two frequencies, a cable, or a capacitance of a winding.
        """
        if isinstance(drive, Driver):
            _check(drive)
            same = drive.equivalent()
            return cls(TwoPhaseDrive(**two_phases(same)), None if same.network == "none" else same, drive)
        if isinstance(drive, TwoPhaseDrive):
            return cls(drive)
        raise ParameterError(
            "The averaged motor takes a drive with one frequency, a TwoPhaseDrive or a Driver, not "
            f"{drive.label}: use simulate."
        )

    @property
    def phasors(self) -> dict[str, complex]:
        """Voltages of the stages in V, group A at phase 0."""
        stage = self.stage
        return {"a": complex(stage.voltage), "b": rect(stage.voltage_b, radians(stage.phase_deg))}

    @property
    def networks(self) -> tuple[dict[str, float], ...]:
        """Parameters of ``driver_averaged`` of each group; empty without a network."""
        return tuple(self._values(group) for group in GROUPS) if self.driver else ()

    def _values(self, group: str) -> dict[str, float]:
        assert self.driver is not None
        (part,) = self.driver.parts(group)
        names = {item.name: item.name for item in read_library(_LIBRARY).parameters} | (
            _INDUCTOR if part.label == "inductor" else {}
        )
        return {ours: part.values[theirs] for ours, theirs in names.items() if theirs in part.values}

    def add(self, circuit: Circuit, after: str = "drive", frequency: str = "set_frequency") -> None:
        """Add the networks between the nodes ``stage_GROUP_PART`` and ``AFTER_GROUP_PART``; PART is re or im.

        ``frequency`` is the node of the frequency.
        """
        circuit.raw_spice += read_library(_LIBRARY).subcircuit + "\n"
        for group, values in zip(GROUPS, self.networks, strict=True):
            pins = [f"{place}_{group}_{part}" for place in ("stage", after) for part in ("re", "im")]
            instantiate(circuit, f"network_{group}", _LIBRARY, (*pins, frequency), **values)

    def to_dict(self) -> dict[str, Any]:
        """Return the drive or driver that was given, JSON-ready."""
        return self.given.to_dict() if self.given else DriveSource(self.stage).to_dict()


def _check(driver: Driver) -> None:
    for part in (part for group in GROUPS for part in driver.parts(group)):
        if part.label == CABLE:
            raise ParameterError(
                "Driver: a cable has no averaged model. Leave it out, or use the full motor; its capacitance "
                "may be added to llcc.parallel_capacitance."
            )
        if winding := part.values.get("winding_capacitance", 0.0):
            raise ParameterError(
                f"Driver: {part.label}.winding_capacitance = {winding:g} F has no averaged model: it must be 0. "
                "Set it, or use the full motor."
            )
