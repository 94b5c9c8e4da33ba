# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor compare``: spectra against a motor or another spectrum."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.options import Targets, with_options
from pyspice_runner.impedance.spectrum import Connection, State


@with_options
def compare(
    context: typer.Context,
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE... REFERENCE", help="Spectra, and last a motor or another spectrum."),
    ],
    fitting: measured.FitOptions,
    leads: measured.LeadOptions,
    targets: Targets,
    reference: Annotated[
        str | None, typer.Option(help="The reference, if it is not the last: a motor or a spectrum.")
    ] = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[NAME=]SHARE",
            help="Allowed deviation of all but resistance, or of NAME (frequency, quality_factor, coupling_factor, "
            "resistance, clamped_capacitance): 5% or 0.05. Exit status 1 if it is exceeded. Repeatable.",
        ),
    ] = None,
    connection: Annotated[Connection, typer.Option(help="Connection of the groups, for a motor and two-ports.")] = "A",
    state: Annotated[State, typer.Option(help="Tip of a motor: free, or pressed on the rotor.")] = "free",
    columns: measured.ColumnsOption = None,
    through: measured.ThroughOption = None,
    at: Annotated[
        str | None, typer.Option(help="Condition of each spectrum, such as its temperature: 20,40,60.")
    ] = None,
    label: Annotated[str, typer.Option(help='Name and unit of --at: "temperature in °C".')] = "",
    changes: common.SetOption = None,
) -> None:
    """Compare spectra with a motor or another spectrum, mode by mode. Writes .json or .csv.

    The plot shows one spectrum over its reference, or the trend of several. Exit status 1 if a --tolerance is exceeded
    or a mode is missing. --columns and --through apply to every spectrum, including the reference.

    Example: piezomotor compare measured.csv andersen2002 --tolerance 5% --plot comparison.png
    """
    targets.check(".json", ".csv", inputs=[*files, reference])
    tolerances = _tolerances(tolerance)
    if reference is None:
        *files, reference = files
    if not files:
        raise pr.ParameterError(f"There is nothing to compare with {reference}; give a spectrum, then the reference.")
    with common.busy("reading"):
        read = measured.reader(columns, through)
        spectra = [read(file) for file in files]
        against = _reference(reference, changes, read)
    _refuse_idle(context, spectra, against, at)
    with common.busy("fitting", "spectrum {} of {}") as progress:
        trend = pr.compare(
            spectra, against, connection=connection, state=state, leads=leads.known(context), label=label,
            progress=progress, at=common.grid("--at", at) if at is not None else None, **fitting.settings,
        )  # fmt: skip
    outside = [item.outside(tolerances) if tolerances else () for item in trend.comparisons]
    document = trend.to_dict()
    for entry, faults in zip(document["comparisons"], outside, strict=True):
        entry["outside_tolerance"] = list(faults)
    document |= {"tolerances": tolerances, "within_tolerance": not any(outside) if tolerances else None}
    targets.deliver(trend, f"against {trend.comparisons[0].reference.source}", document)
    measured.note(trend.cautions, targets)
    for item, faults in zip(trend.comparisons, outside, strict=True):
        for text in faults:
            common.complain(f"{item.measured.source}: {text}", style=None)
    if any(outside):
        raise typer.Exit(1)


def _reference(name: str, changes: list[str] | None, read: measured.Reader) -> pr.Motor | pr.Spectrum:
    """Return the motor of a parameter set or a TOML file, or else a spectrum."""
    if name in pr.available_motors() or Path(name).suffix == ".toml":
        return common.load_changed(name, changes)
    if changes:
        raise pr.ParameterError("--set changes a motor, but the reference is a spectrum; leave it out.")
    return read(name)


def _refuse_idle(
    context: typer.Context, spectra: list[pr.Spectrum], against: pr.Motor | pr.Spectrum, at: str | None
) -> None:
    """Reject options of a motor or of two-ports without one, and a label without --at."""
    if at is None:
        common.refuse_idle(context, "without --at", "label")
    if isinstance(against, pr.Spectrum):
        common.refuse_idle(context, "on a spectrum as the reference", "state")
        if all(spectrum.ports == 1 for spectrum in (*spectra, against)):
            common.refuse_idle(context, "on spectra of one port", "connection")


def _tolerances(given: list[str] | None) -> dict[str, float]:
    """Read tolerances: a ratio such as 0.05, or a percentage such as 5%."""
    from pyspice_runner.impedance.compare import Comparison

    found: dict[str, float] = {}
    named: set[str] = set()  # what a tolerance is given for; empty for all quantities
    for text in given or []:
        name, equals, value = text.rpartition("=")
        if name in named:
            raise pr.ParameterError(f"--tolerance {name or 'of all quantities'} is given twice. Give it once.")
        named.add(name)
        if equals and name not in Comparison.QUANTITIES:
            raise pr.ParameterError(f"--tolerance has no {name!r}; there are {', '.join(Comparison.QUANTITIES)}.")
        try:
            share = float(value.removesuffix("%"))
        except ValueError:
            share = -1.0
        if not (isfinite(share) and share >= 0.0):
            raise pr.ParameterError(f"--tolerance {text!r} is not valid: write 5%, 0.05 or quality_factor=20%.")
        if share >= 1.0 and not value.endswith("%"):
            raise pr.ParameterError(
                f"--tolerance {text!r} is a ratio of {share:g}, which is {100.0 * share:g} %. Write a percentage with "
                f"its sign: {value}%."
            )
        share = share / 100.0 if value.endswith("%") else share
        found |= {name: share} if equals else {key: share for key in Comparison.JUDGED if key not in found}
    return found
