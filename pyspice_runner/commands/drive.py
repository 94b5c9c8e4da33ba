# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor drive``: one or two drive circuits with a motor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common, options
from pyspice_runner.commands.driving import recommended_phases
from pyspice_runner.model.drive import MatchState, two_phases

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyspice_runner.analysis.drive import DriveReport

DRIVERS = (
    "ideal, linear, half-bridge, full-bridge, or FILE:NAME of your own subcircuit; with +inductor or +llcc a matching "
    "network"
)
PartOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PART.PARAMETER=VALUE",
        help="Change a part of the driver, as bridge.dead_time=3e-7, or supply_v. Repeatable.",
    ),
]
MosfetOption = Annotated[
    str | None,
    typer.Option(metavar="FILE:NAME", help="MOSFET of a bridge, a .subckt or .model; default: IRF610."),
]
MatchOption = Annotated[
    Literal["none", MatchState], typer.Option(help="State of the motor for which the network is matched.")
]
VoltageOption = Annotated[
    float | None, typer.Option(help="Amplitude of group A, V; default: the motor's recommended drive.")
]
PhaseOption = Annotated[
    float | None, typer.Option(help="Phase of group B ahead of group A, degrees; default: the recommended drive.")
]


@options.with_options
def drive(
    context: typer.Context,
    motor: common.MotorArgument,
    *,
    driver: Annotated[str, typer.Option(help=DRIVERS)] = "linear",
    against: Annotated[str | None, typer.Option(help="A second driver for comparison.")] = None,
    voltage: VoltageOption = None,
    frequency: Annotated[float | None, typer.Option(help="Frequency, Hz; default: as above.")] = None,
    phase: PhaseOption = None,
    match: MatchOption = "running",
    part: PartOption = None,
    mosfet: MosfetOption = None,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 3e-3,
    contact: options.ContactOption = options.DEFAULT_LAW,
    speed: options.SpeedOption = None,
    load_torque: options.LoadOption = 0.0,
    timeout: common.TimeoutOption = None,
    audit: common.AuditOption = True,
    changes: common.SetOption = None,
    targets: options.Targets,
) -> None:
    """Run a motor with its drive electronics: currents, powers, harmonics, losses, efficiency, matching inductors.

    Writes .json (report), .csv (waveforms of one driver, or the table of two) or .cir (deck of one driver).

    Example: piezomotor drive andersen2002 --driver half-bridge+llcc --against linear --plot drivers.png
    """
    refuse_idle_match(context, driver, against or "")
    targets.check(".json", ".csv", *([".cir"] if against is None else []))
    of_motor, of_parts = changes_of(changes, part)
    loaded = common.load_changed(motor, of_motor)
    tone = recommended_phases(loaded, voltage, frequency, phase)
    reports: list[DriveReport] = []
    fault: pr.SimulationError | None = None
    for number, words in enumerate([driver] if against is None else [driver, against]):
        chosen = driver_of(words, tone, of_parts, mosfet, strict=number == 0)
        try:
            with common.busy(f"ngspice runs the {chosen.name}"):
                reports.append(
                    pr.drive_report(
                        loaded, chosen, duration=duration, contact=options.law_named(contact), speed=speed,
                        load_torque=load_torque,
                        match=None if chosen.network == "none" or match == "none" else match,
                        proposals=number == 0, timeout=timeout, audit=audit,
                    )
                )  # fmt: skip
            common.caution(reports[-1])
        except pr.SimulationError as error:
            if not reports:
                raise
            fault = pr.SimulationError(f"Only the {driver} is finished; the {words} failed. {error}")
    document: dict[str, Any] = (
        reports[0].to_dict() if against is None else {"drivers": [report.to_dict() for report in reports]}
    )
    save = reports[0].save if against is None else lambda path: common.write_table(path, document, _rows(reports))
    targets.write(document, _table(loaded, reports), save, lambda path: common.view().draw_beside(reports, path))
    if fault is not None:
        raise fault


def refuse_idle_match(context: typer.Context, *drivers: str) -> None:
    """Refuse ``--match`` if no driver has a matching network."""
    if all("+" not in words for words in drivers):
        common.refuse_idle(context, "without a matching network, such as --driver half-bridge+llcc", "match")


def driver_of(
    words: str, values: Mapping[str, Any], part: list[str] | None, mosfet: str | None, *, strict: bool = True
) -> pr.Driver:
    """Return the driver of a kind of stage, and behind a + its network; ``values`` are fields of the driver.

    Unless ``strict``, changes and a MOSFET that do not suit the driver are left out.
    """
    kind, plus, network = words.rpartition("+")
    if not plus or ":" in network:  # of the name of a file
        kind, network = words, "none"
    changes = _parts(part)
    stated = dict(values) | {path: value for path, value in changes.items() if "." not in path}
    if mosfet is not None and (strict or kind.endswith("-bridge")):
        stated["mosfet"] = mosfet
    chosen = pr.Driver(kind=kind, network=network, **stated)
    present = {item.label for item in chosen.parts("a")}
    return chosen.updated(
        {
            path: value
            for path, value in changes.items()
            if "." in path and (strict or path.partition(".")[0].removesuffix("_a").removesuffix("_b") in present)
        }
    )


def two_phase(drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> dict[str, float]:
    """Return voltage, frequency and phase for :func:`driver_of`. Raise ParameterError for a two-tone drive."""
    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError("A driver makes two phases of one tone. Add --drive two-phase.")
    return two_phases(drive)


def changes_of(changes: list[str] | None, part: list[str] | None) -> tuple[list[str], list[str]]:
    """Return the changes of the motor by ``--set``, and those of the driver's parts, with ``--set driver.…``."""
    of_driver = [change for change in changes or [] if change.strip().startswith("driver.")]
    return [change for change in changes or [] if change not in of_driver], [*(part or []), *of_driver]


def _parts(changes: list[str] | None) -> dict[str, float]:
    """Return the changed parameters."""
    values = {}
    told = "is not PART.PARAMETER=VALUE; write it as bridge.dead_time=3e-7."
    for path, text in common.pairs_of("--part", changes, told):
        try:
            values[path] = float(text)
        except ValueError:
            raise pr.ParameterError(f"--part {path}: {text!r} is not a number. Give one, in SI units.") from None
    return values


def _rows(reports: list[DriveReport]) -> list[list[str]]:
    """Return one row for each number of the reports, by its path in ``--json``, with one column for each driver."""
    rows = [["driver", *(report.driver["label"].replace(",", ";") for report in reports)]]
    documents = [dict(common.leaves(report.to_dict())) for report in reports]
    for path in dict.fromkeys(path for document in documents for path in document):
        values = [document.get(path) for document in documents]
        if not path.startswith(("motor.", "driver.", "run.")) and not any(isinstance(value, str) for value in values):
            rows.append([path, *("" if value is None else f"{value:.6g}" for value in values)])
    return rows


def _table(motor: pr.Motor, reports: list[DriveReport]) -> Table:
    table = Table("quantity", *(report.driver["kind"].rpartition(":")[2] for report in reports), title=motor.name)
    summaries = [report.summary() for report in reports]
    for name in summaries[0]:
        table.add_row(name, *(summary.get(name, "") for summary in summaries))
    return table
