# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor drive``: one or two drive circuits with a motor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.table import Column, Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    AuditOption,
    MotorArgument,
    SetOption,
    TimeoutOption,
    busy,
    caution,
    deliver,
    engineering,
    load_changed,
    refuse_idle,
    view,
    write_table,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, ContactOption, law_named
from pyspice_runner.commands.driving import recommended_phases
from pyspice_runner.commands.options import LoadOption, SpeedOption, Targets, with_options
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


@with_options
def drive(
    context: typer.Context,
    motor: MotorArgument,
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
    contact: ContactOption = DEFAULT_LAW,
    speed: SpeedOption = None,
    load_torque: LoadOption = 0.0,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    changes: SetOption = None,
    targets: Targets,
) -> None:
    """Run a motor with its drive electronics: currents, powers, harmonics, losses, efficiency, matching inductors.

    Writes .json (report), .csv (waveforms of one driver, or the table of two) or .cir (deck of one driver).

    Example: piezomotor drive andersen2002 --driver half-bridge+llcc --against linear --plot drivers.png
    """
    refuse_idle_match(context, driver, against or "")
    targets.check(".json", ".csv", *([".cir"] if against is None else []))
    of_motor, of_parts = changes_of(changes, part)
    loaded = load_changed(motor, of_motor)
    tone = recommended_phases(loaded, voltage, frequency, phase)
    reports: list[DriveReport] = []
    fault: pr.SimulationError | None = None
    for number, words in enumerate([driver] if against is None else [driver, against]):
        chosen = driver_of(words, tone, of_parts, mosfet, strict=number == 0)
        try:
            with busy(f"ngspice runs the {chosen.name}"):
                reports.append(
                    pr.drive_report(
                        loaded, chosen, duration=duration, contact=law_named(contact), speed=speed,
                        load_torque=load_torque,
                        match=None if chosen.network == "none" or match == "none" else match,
                        proposals=number == 0, timeout=timeout, audit=audit,
                    )
                )  # fmt: skip
            caution(reports[-1])
        except pr.SimulationError as error:
            if not reports:
                raise
            fault = pr.SimulationError(f"Only the {driver} is finished; the {words} failed. {error}")
    rows = _rows(reports)
    document: dict[str, Any] = (
        reports[0].to_dict() if against is None else {"drivers": [report.to_dict() for report in reports]}
    )
    save = reports[0].save if against is None else lambda path: write_table(path, document, rows)
    deliver(
        document, _table(loaded, reports, rows), targets.as_json,
        (targets.output, save), (targets.plot, lambda path: view().draw_beside(reports, path)),
    )  # fmt: skip
    if fault is not None:
        raise fault


def refuse_idle_match(context: typer.Context, *drivers: str) -> None:
    """Refuse ``--match`` if no driver has a matching network."""
    if all("+" not in words for words in drivers):
        refuse_idle(context, "without a matching network, such as --driver half-bridge+llcc", "match")


def driver_of(
    words: str, values: Mapping[str, Any], part: list[str] | None, mosfet: str | None, *, strict: bool = True
) -> pr.Driver:
    """Return the driver that the options of a command ask for.

    Args:
        words: kind of the stage, and behind a + its network.
        values: voltage, frequency and phase, as :class:`pyspice_runner.Driver` names them.
        part: changes of parts.
        mosfet: MOSFET of a bridge.
        strict: whether changes and MOSFET that do not suit the driver are errors; otherwise they are left out.

    Raises:
        ParameterError: for a value that is not valid.
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
    """Return voltage, frequency and phase of a two-phase drive for :func:`driver_of`.

    Raises:
        ParameterError: for a two-tone drive.
    """
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
    for change in changes or []:
        path, equals, text = change.partition("=")
        if not equals:
            raise pr.ParameterError(
                f"--part {change!r} is not PART.PARAMETER=VALUE; write it as bridge.dead_time=3e-7."
            )
        try:
            values[path.strip()] = float(text)
        except ValueError:
            raise pr.ParameterError(f"--part {path}: {text!r} is not a number. Give one, in SI units.") from None
    return values


def _rows(reports: list[DriveReport]) -> list[list[str]]:
    """Return the table: one line per quantity, one column per driver."""
    cells: list[tuple[str, list[str]]] = [("driver", [report.driver["label"].replace(",", ";") for report in reports])]

    def add(name: str, unit: str, values: list[float]) -> None:
        cells.append((name, [engineering(value, unit) if unit else f"{value:.4g}" for value in values]))

    for group in ("a", "b"):
        for what, unit in (
            ("voltage_peak_v", "V"), ("voltage_rms_v", "V"), ("current_peak_a", "A"), ("current_rms_a", "A"),
            ("real_power_w", "W"), ("reactive_power_var", "var"), ("apparent_power_va", "VA"), ("power_factor", ""),
            ("voltage_thd", ""), ("current_thd", ""),
        ):  # fmt: skip
            add(f"group_{group}.{what}", unit, [getattr(report.groups[group], what) for report in reports])
        for what, unit in (("power_factor", ""), ("displacement_factor", ""), ("slew_rate_v_per_s", "V/s")):
            add(f"output_{group}.{what}", unit, [getattr(report.outputs[group], what) for report in reports])
    for what, unit in (
        ("power_factor", ""), ("supply_power_w", "W"), ("gate_power_w", "W"), ("motor_power_w", "W"),
        ("shaft_power_w", "W"), ("driver_efficiency", ""), ("efficiency", ""), ("balance_residual", ""),
        ("mean_rotor_speed_rad_s", "rad/s"),
    ):  # fmt: skip
        add(what, unit, [getattr(report, what) for report in reports])
    cells.append(("settled", ["yes" if report.settled else "no" for report in reports]))
    for table, unit in (("supply_current_mean_a", "A"), ("supply_current_peak_a", "A"), ("losses_w", "W")):
        for key in dict.fromkeys(key for report in reports for key in getattr(report, table)):
            shown = [getattr(report, table).get(key) for report in reports]
            cells.append((f"{table}.{key}", ["–" if value is None else engineering(value, unit) for value in shown]))
    return [[name, *values] for name, values in cells]


def _table(motor: pr.Motor, reports: list[DriveReport], rows: list[list[str]]) -> Table:
    names = (report.driver["kind"].rpartition(":")[2] for report in reports)
    table = Table(Column("quantity", overflow="fold"), *names, title=motor.name)
    for row in rows:
        table.add_row(*row)
    for state, matching in reports[0].matching.items():
        for group in ("a", "b"):
            match = matching.group(group)
            element = (
                engineering(match.inductance_h, "H")
                if match.inductance_h
                else f"{engineering(match.capacitance_f, 'F')} (the group is inductive)"
            )
            source = f"{match.source_voltage_v:.4g} V at {match.source_phase_deg:.4g}°"
            factor = f"power factor {match.power_factor:.3f} without"
            filler = [""] * (len(reports) - 1)
            table.add_row(f"series match of {group}, {state}", f"{element}; {factor}; source {source}", *filler)
    return table
