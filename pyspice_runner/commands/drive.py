# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor drive``: one or two drive circuits with a motor."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVERS, LAW, PHASE, TARGETS, VOLTAGE, Call, command, option
from pyspice_runner.drivers.design import NoDriverError
from pyspice_runner.drivers.ratings import bill_of_materials
from pyspice_runner.files import write_rows
from pyspice_runner.result import leaves

if TYPE_CHECKING:
    from pyspice_runner.drivers.report import DriveReport


@command(
    "motor driver against voltage frequency phase rail stage network source_resistance match part mosfet duration",
    "events power current amplitude at load_range speed load_torque audit", LAW, "timeout", CHANGES, TARGETS,
    driver=option(DRIVERS, str, "linear"),
    against=option("A second driver for comparison.", str | None),
    voltage=VOLTAGE,
    frequency=option("Frequency, Hz; default: as above."),
    phase=PHASE,
    rail=option("Voltage between the rails, V: design a driver for it, from its transformer on."),
    stage=option(
        "Power stage of the design; default: full-bridge.",
        Literal["linear", "feedback", "half-bridge", "full-bridge", "push-pull"] | None,
    ),
    network=option("Default: inductor, with --load-range llcc.", Literal["none", "inductor", "l", "llcc"] | None),
    source_resistance=option("Resistance to which a network l (default: 50) or llcc transforms the motor, ohm."),
    duration=option("Simulated time, s; default: 3e-3, of a design up to 6e-3; of a transducer until settled."),
    events=option(
        "Also run a load step, a stop and a frequency sweep, for the stress on the parts; default with --load-range.",
        bool, False,
    ),
    power=option("Transducer: power into the load, W; without a load into the arms."),
    current=option("Transducer: amplitude of the motional current, A."),
    amplitude=option("Transducer: amplitude of the face, m, where its motion is known."),
    at=option(
        "Transducer: series or parallel resonance under load, or between, in place of --frequency.",
        Literal["series", "between", "parallel"] | None,
    ),
    load_range=option(
        "Transducer: damping idle and under full load, relative to the file, as 1:20. The motional current is kept.",
        str | None, metavar="IDLE:FULL",
    ),
    bom=option("File of the bill of materials of the driver, with peaks, ratings and cores, .csv.", Path | None),
)  # fmt: skip
def drive(call: Call) -> None:
    """Run a motor with its drive electronics: currents, powers, harmonics, losses, and the stress on the parts.

    With --rail it designs the driver: network, transformer and their parts, so that the pins get the drive's voltages
    from stall to no load. --speed is then the operating point, and the motor starts from rest. The exit status is 0
    whether or not the design is feasible.

    Writes .json (report), .csv (waveforms of one driver, or the table of two) or .cir (deck of one driver).

    Example: piezomotor drive andersen2002 --driver half-bridge+llcc --against linear --plot drivers.png
    """
    driver, against = _stage(call), call.against
    call.check(".json", ".csv", *([".cir"] if against is None else []))
    bom = call.values["bom"]
    _check_bom(call, bom)
    motor = call.loaded
    tone = call.phases()
    targets = call.pick("power current amplitude at")
    targets["load_range"] = call.load_range and tuple(map(common.number, call.load_range.split(":")))
    specs = [replace(call.spec_of(driver, tone), **targets)]
    if against is not None:
        specs.append(call.spec_of(against, tone, strict=False))
    reports: list[DriveReport] = []
    fault: pr.SimulationError | None = None
    for spec in specs:
        try:
            with common.run_progress(f"ngspice runs the {spec.name} from power-up") as progress:
                report = pr.drive_report(
                    motor, spec, contact=call.law, events=call.events or spec.load_range is not None, progress=progress,
                    **call.pick("duration speed load_torque audit timeout"),
                )  # fmt: skip
            reports.append(report)
            common.caution(report)
        except NoDriverError as error:
            if against is not None:
                raise pr.ParameterError(f"{spec.name}: {error.design.reason}") from None
            if call.output is not None and call.output.suffix not in (".json", ".csv"):
                raise pr.ParameterError(f"{error.design.reason} There is no deck for {call.output}.") from None
            refused = {"motor": motor.to_dict(), "design": error.design.to_dict(), "maxima": {}}
            rows = [["reason"], [error.design.reason]]
            reason = f"{motor.name}: {error.design.reason}\n"
            if bom:
                reason += "There is no bill of materials.\n"
            call.write(refused, reason, partial(common.write_table, document=refused, rows=rows), _no_plot)
            return
        except pr.SimulationError as error:
            if not reports:
                raise
            fault = pr.SimulationError(f"Only the {driver} is finished; the {spec.name} failed. {error}")
    document: dict[str, Any] = (
        reports[0].to_dict() if against is None else {"drivers": [report.to_dict() for report in reports]}
    )
    save = reports[0].save if against is None else lambda path: common.write_table(path, document, _rows(reports))
    bill: common.Writing = (bom, lambda path: write_rows(path, bill_of_materials(reports[0].bill)))
    drawn: common.Writing = (call.values["plot"], partial(_draw, reports))
    common.deliver(document, _table(motor, reports), call.as_json, (call.output, save), drawn, bill)
    if fault is not None:
        raise fault


def _check_bom(call: Call, bom: Path | None) -> None:
    """Raise ParameterError for a bill of materials that cannot be written, or of two drivers."""
    common.check_targets(bom, (".csv",), None)
    if bom is None:
        return
    if call.against is not None:
        raise pr.ParameterError("--bom is of one driver: leave --against out.")
    for name in ("output", "plot"):
        if (other := call.values[name]) is not None and bom.resolve() == other.resolve():
            raise pr.ParameterError(f"--bom and --{name} are one file, {bom}. Choose another one.")


def _stage(call: Call) -> str:
    """Return stage and network; raise ParameterError for options that have no effect together."""
    if call.rail is None:
        call.refuse_idle("without --rail", "stage network power current amplitude at load_range")
        call.refuse_idle_match(call.driver, call.against or "")
        return str(call.driver)
    for name in common.stated_options(call.context, "driver"):
        raise pr.ParameterError(
            f"{name} has no effect with --rail, which designs the driver. Choose the power stage of the design "
            f"with --stage {call.driver.partition('+')[0]}."
        )
    call.refuse_idle("with --rail, which designs the driver", "against match")
    if [*common.stated_options(call.context, "power", "current", "amplitude")]:
        call.refuse_idle("with a target", "voltage")
    call.refuse_idle("with --at", "frequency" if call.at else "")
    network = call.network or ("llcc" if call.load_range else "inductor")
    return f"{call.stage or 'full-bridge'}+{network}"


def _draw(reports: list[DriveReport], path: Path) -> None:
    from pyspice_runner.view import plots  # with Matplotlib, which takes a second to load

    plots.draw_beside(reports, path)


def _no_plot(_: Path) -> None:
    raise pr.ParameterError("There is no driver, and so no plot. Leave --plot out.")


def _rows(reports: list[DriveReport]) -> list[list[str]]:
    """Return one row for each number of the reports, by its path in ``--json``, with one column for each driver."""
    rows = [["driver", *(report.driver["label"] for report in reports)]]
    documents = [dict(leaves(report.to_dict())) for report in reports]
    for path in dict.fromkeys(path for document in documents for path in document):
        values = [document.get(path) for document in documents]
        if not path.startswith(("motor.", "driver.", "run.")) and not any(isinstance(value, str) for value in values):
            rows.append([path, *("" if value is None else f"{value:.6g}" for value in values)])
    return rows


def _table(motor: pr.Motor, reports: list[DriveReport]) -> Table:
    table = Table("quantity", *(report.driver["kind"].rpartition(":")[2] for report in reports), title=motor.name)
    if not all(report.operating for report in reports):  # which are compared in the same state
        reports = [replace(report, operating=None) for report in reports]
    summaries = [report.summary() for report in reports]
    for name in summaries[0]:
        table.add_row(name, *(summary.get(name, "") for summary in summaries))
    return table
