# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor drive``: one or two drive circuits with a motor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common, options
from pyspice_runner.commands.driving import recommended_phases
from pyspice_runner.commands.options import Options
from pyspice_runner.drivers.design import DriverSpec, NoDriverError
from pyspice_runner.drivers.driver import BRIDGES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pyspice_runner.drivers.driver import NetworkKind
    from pyspice_runner.drivers.report import DriveReport

    AnyDrive = pr.TwoPhaseDrive | pr.TwoToneDrive

DRIVERS = (
    "ideal, linear, half-bridge, full-bridge, push-pull, or FILE:NAME of your own subcircuit; with +inductor or +llcc "
    "a matching network"
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
    typer.Option(
        metavar="NAME",
        help="MOSFET of a bridge: IRF530, IRF610, IRF820, or FILE:NAME of a .subckt or .model; default: IRF610, with "
        "--rail the one of the lowest voltage that suffices.",
    ),
]
MatchOption = Annotated[
    bool,
    typer.Option(
        "--match/--no-match",
        help="Choose the parts of the network for the motor from stall to no load; --part states them instead.",
    ),
]


@dataclass(frozen=True)
class DriverOptions(Options):
    """A driver in front of a motor, for analyses that take one in place of a drive."""

    driver: Annotated[
        str | None, typer.Option(help=f"Driver in front of the motor: {DRIVERS}; default: ideal voltages.")
    ] = None
    match: MatchOption = True
    part: PartOption = None
    mosfet: MosfetOption = None

    def check(self, context: typer.Context) -> None:
        """Refuse options that have no effect without a driver, or without a network."""
        if self.driver is None:
            common.refuse_idle(context, "without --driver", "match", "part", "mosfet")
        else:
            refuse_idle_match(context, self.driver)

    def applied(
        self, motor: str, changes: list[str] | None
    ) -> tuple[pr.Motor, Callable[[AnyDrive, pr.Law | None], AnyDrive | pr.Driver]]:
        """Return the motor with its changes, and what makes the driver for it from a drive and a law of the contact."""
        if self.driver is None:
            return common.load_changed(motor, changes), lambda drive, _: drive
        of_motor, of_parts = changes_of(changes, self.part)
        loaded, words = common.load_changed(motor, of_motor), self.driver

        def in_front(drive: AnyDrive, law: pr.Law | None) -> pr.Driver:
            return spec_of(words, drive, of_parts, self.mosfet, match=self.match).built(loaded, contact=law)

        return loaded, in_front


Stage = Literal["linear", "half-bridge", "full-bridge", "push-pull"]
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
    rail: Annotated[
        float | None,
        typer.Option(help="Voltage between the rails, V: design a driver for it, from its transformer on."),
    ] = None,
    stage: Annotated[Stage | None, typer.Option(help="Power stage of the design; default: full-bridge.")] = None,
    network: Annotated[Literal["none", "inductor", "llcc"], typer.Option(help="Network of the design.")] = "inductor",
    match: MatchOption = True,
    part: PartOption = None,
    mosfet: MosfetOption = None,
    duration: Annotated[
        float | None, typer.Option(help="Simulated time, s; default: 3e-3, of a design up to 6e-3.")
    ] = None,
    events: Annotated[
        bool,
        typer.Option("--events", help="Also run a load step, a stop and a frequency sweep, for what the parts bear."),
    ] = False,
    speed: options.SpeedOption = None,
    load_torque: options.LoadOption = 0.0,
    audit: common.AuditOption = True,
    run: options.RunOptions,
    targets: options.Targets,
) -> None:
    """Run a motor with its drive electronics: currents, powers, harmonics, losses, and what the parts bear.

    With --rail it designs the driver: network, transformer and their parts, so that the pins get the drive's voltages
    from stall to no load. --speed is then the operating point, and the motor starts from rest.

    Writes .json (report), .csv (waveforms of one driver, or the table of two) or .cir (deck of one driver).

    Example: piezomotor drive andersen2002 --driver half-bridge+llcc --against linear --plot drivers.png
    """
    if rail is None:
        common.refuse_idle(context, "without --rail", "stage", "network")
        refuse_idle_match(context, driver, against or "")
    else:
        common.refuse_idle(context, "with --rail, which designs the driver", "driver", "against", "match")
        driver = f"{stage or 'full-bridge'}+{network}"
    targets.check(".json", ".csv", *([".cir"] if against is None else []))
    of_motor, of_parts = changes_of(run.changes, part)
    loaded = common.load_changed(motor, of_motor)
    tone = pr.TwoPhaseDrive(**recommended_phases(loaded, voltage, frequency, phase))
    specs = [spec_of(driver, tone, of_parts, mosfet, rail=rail, match=match)]
    if against is not None:
        specs.append(spec_of(against, tone, of_parts, mosfet, match=match, strict=False))
    reports: list[DriveReport] = []
    fault: pr.SimulationError | None = None
    for spec in specs:
        try:
            with common.busy(f"ngspice runs the {spec.name}"):
                report = pr.drive_report(
                    loaded, spec, duration, speed=speed, load_torque=load_torque, audit=audit, events=events,
                    **run.settings,
                )  # fmt: skip
            reports.append(report)
            common.caution(report)
        except NoDriverError as error:
            if against is not None:
                raise pr.ParameterError(f"{spec.name}: {error.design.reason}") from None
            refused = {"motor": loaded.to_dict(), "design": error.design.to_dict(), "maxima": {}}
            targets.write(refused, f"{loaded.name}: {error.design.reason}\n", partial(_save, refused), _no_plot)
            return
        except pr.SimulationError as error:
            if not reports:
                raise
            fault = pr.SimulationError(f"Only the {driver} is finished; the {spec.name} failed. {error}")
    document: dict[str, Any] = (
        reports[0].to_dict() if against is None else {"drivers": [report.to_dict() for report in reports]}
    )
    save = reports[0].save if against is None else lambda path: common.write_table(path, document, _rows(reports))
    targets.write(document, _table(loaded, reports), save, lambda path: common.view().draw_beside(reports, path))
    if fault is not None:
        raise fault


def _save(document: Mapping[str, Any], path: Path) -> None:
    """Write a design without a driver."""
    common.write_table(path, document, [["reason"], [document["design"]["reason"]]])


def _no_plot(_: Path) -> None:
    raise pr.ParameterError("There is no driver, and so no plot. Leave --plot out.")


def refuse_idle_match(context: typer.Context, *drivers: str) -> None:
    """Refuse ``--match`` and ``--no-match`` if no driver has a matching network."""
    if all("+" not in words for words in drivers):
        common.refuse_idle(context, "without a matching network, such as --driver half-bridge+llcc", "match")


def spec_of(
    words: str,
    drive: AnyDrive,
    part: list[str] | None,
    mosfet: str | None,
    *,
    rail: float | None = None,
    match: bool = True,
    strict: bool = True,
) -> DriverSpec:
    """Return the specification of a stage, and behind a + its network. Raise ParameterError for a two-tone drive.

    Unless ``strict``, changes and a MOSFET that do not suit the driver are left out.
    """
    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError("A driver makes two phases of one tone. Add --drive two-phase.")
    stage, plus, network = words.rpartition("+")
    if not plus or ":" in network:  # a + in the name of a file
        stage, network = words, "none"
    given: dict[str, Any] = dict(_parts(part))
    if not strict:
        present = {item.label for item in pr.Driver(kind=stage, network=network, voltage=1.0, frequency=1e4).parts("a")}
        labels = {path: path.partition(".")[0].removesuffix("_a").removesuffix("_b") for path in given}
        given = {path: value for path, value in given.items() if "." not in path or labels[path] in present}
    if mosfet is not None and (strict or stage in BRIDGES):
        given["mosfet"] = mosfet
    return DriverSpec(drive, stage, cast("NetworkKind", network), rail, given, match)


def changes_of(changes: list[str] | None, part: list[str] | None) -> tuple[list[str], list[str]]:
    """Return the changes of the motor by ``--set``, and those of the driver's parts, with ``--set driver.…``."""
    of_driver = [change for change in changes or [] if change.strip().startswith("driver.")]
    return [change for change in changes or [] if change not in of_driver], [*(part or []), *of_driver]


def _parts(changes: list[str] | None) -> dict[str, float]:
    """Return the changed parameters."""
    values = {}
    notes = "is not PART.PARAMETER=VALUE; write it as bridge.dead_time=3e-7."
    for path, text in common.pairs_of("--part", changes, notes):
        try:
            values[path] = float(text)
        except ValueError:
            raise pr.ParameterError(f"--part {path}: {text!r} is not a number. Give one, in SI units.") from None
    return values


def _rows(reports: list[DriveReport]) -> list[list[str]]:
    """Return one row for each number of the reports, by its path in ``--json``, with one column for each driver."""
    rows = [["driver", *(report.driver["label"] for report in reports)]]
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
