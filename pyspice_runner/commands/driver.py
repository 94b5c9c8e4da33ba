# SPDX-License-Identifier: GPL-3.0-or-later
"""The driver that the command line specifies, in front of a motor."""

from __future__ import annotations

from typing import Any

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import Call

AnyDrive = pr.TwoPhaseDrive | pr.TwoToneDrive


def refuse_idle_match(call: Call, *drivers: str) -> None:
    """Refuse ``--match`` and ``--no-match`` if no driver has a matching network."""
    if all("+" not in words for words in drivers):
        call.refuse_idle("without a matching network, such as --driver half-bridge+llcc", "match")


def check_driver(call: Call) -> None:
    """Refuse options that have no effect without a driver, or without a network."""
    if call.driver is None:
        call.refuse_idle("without --driver", "match part mosfet")
    else:
        refuse_idle_match(call, call.driver)


def in_front(call: Call) -> AnyDrive | pr.Driver:
    """Return what is in front of the motor: its drive, or the driver."""
    check_driver(call)
    if call.driver is None:
        return call.stated
    return spec_of(call, call.driver, call.stated).built(call.loaded, contact=call.law)


def spec_of(call: Call, words: str, drive: AnyDrive, *, strict: bool = True) -> pr.DriverSpec:
    """Return the specification of a stage, and behind a + its network. Raise ParameterError for a two-tone drive.

    Unless ``strict``, changes and a MOSFET that do not suit the driver are left out.
    """
    from pyspice_runner.drivers.driver import BRIDGES

    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError("A driver makes two phases of one tone. Add --drive two-phase.")
    network: Any  # which the driver checks
    stage, plus, network = words.rpartition("+")
    if not plus or ":" in network:  # a + in the name of a file
        stage, network = words, "none"
    given: dict[str, Any] = dict(_parts(call.parts))
    if not strict:
        present = {item.label for item in pr.Driver(kind=stage, network=network, voltage=1.0, frequency=1e4).parts("a")}
        labels = {path: path.partition(".")[0].removesuffix("_a").removesuffix("_b") for path in given}
        given = {path: value for path, value in given.items() if "." not in path or labels[path] in present}
    if call.mosfet is not None and (strict or stage in BRIDGES):
        given["mosfet"] = call.mosfet
    return pr.DriverSpec(drive, stage, network, call.values.get("rail"), given, call.values.get("match", True))


def _parts(changes: list[str] | None) -> dict[str, float]:
    """Return the changed parameters."""
    values = {}
    form = "is not PART.PARAMETER=VALUE; write it as bridge.dead_time=3e-7."
    for path, text in common.pairs_of("--part", changes, form):
        same = path.lower()  # SPICE does not distinguish case
        if same in values:
            raise pr.ParameterError(f"--part {path} is given twice, with different capitalisation. Give it once.")
        try:
            values[same] = common.number(text)
        except pr.ParameterError as error:
            raise pr.ParameterError(f"--part {path}: {error}") from None
    return values
