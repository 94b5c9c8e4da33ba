# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor admittance`` and ``compare``: spectra of a motor, and spectra against a motor or another spectrum."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.measured import FIT
from pyspice_runner.commands.options import CHANGES, TARGETS, Call, argument, command, option
from pyspice_runner.impedance.spectrum import Connection, State


@command(
    "motor", TARGETS, "state start stop points timeout audit", CHANGES,
    state=option("Free tip, or pressed on the rotor.", State, "free"),
    start=option("First frequency, Hz; default: that of the solid, else 5 kHz."),
    stop=option("Last frequency, Hz; default: that of the solid, else 100 kHz."),
    points=option("Number of frequencies.", int, 2000),
)  # fmt: skip
def admittance(call: Call) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance bimodal40 --state preloaded --plot admittance.png
    """
    call.check(".csv", ".nc", ".json")
    with common.busy("ngspice sweeps the frequency"):
        result = pr.admittance(call.loaded, **call.pick("start stop points state timeout audit"))
    call.deliver(result, f"{result.motor['name']}, {call.state}")


@command(
    "files", FIT, "leads no_leads", TARGETS, "reference share connection state columns through at label changes",
    files=argument("Spectra, and last a motor or another spectrum.", list[str], ..., "FILE... REFERENCE"),
    timeout=option("Time limit of the fit of a spectrum, s."),
    reference=option("The reference, if it is not the last: a motor or a spectrum.", str | None),
    share=option(
        "Allowed deviation of all but resistance and coupling_factor, or of NAME (frequency, quality_factor, coupling, "
        "clamped_capacitance, coupling_factor, resistance): 5% or 0.05. Exit status 1 if it is exceeded. Repeatable.",
        list[str] | None, None, "--tolerance", metavar="[NAME=]SHARE",
    ),
    connection=option("Connection of the groups, for a motor and two-ports.", Connection, "A"),
    state=option("Tip of a motor: free, or pressed on the rotor.", State, "free"),
    at=option("Condition of each spectrum, such as its temperature: 20,40,60.", str | None),
    label=option('Name and unit of --at: "temperature in °C".', str, ""),
)  # fmt: skip
def compare(call: Call) -> None:
    """Compare spectra with a motor or another spectrum, mode by mode, and name the cause. Writes .json or .csv.

    A motor as the reference gives the probability of each cause. The plot shows one spectrum over its reference, or the
    trend of several. Exit status 1 if a --tolerance is exceeded or a mode is missing. --columns and --through apply to
    every spectrum, including the reference.

    Example: piezomotor compare measured.csv andersen2002 --tolerance 5% --plot comparison.png
    """
    files, reference = call.files, call.reference
    call.check(".json", ".csv", inputs=[*files, reference])
    tolerances = _tolerances(call.share)
    if reference is None:
        *files, reference = files
    if not files:
        raise pr.ParameterError(f"There is nothing to compare with {reference}; give a spectrum, then the reference.")
    with common.busy("reading"):
        read = measured.reader(call.columns, call.through)
        spectra = [read(file) for file in files]
        against = _reference(reference, call.changes, read)
    _refuse_idle(call, spectra, against)
    with common.busy("fitting", "spectrum {} of {}") as progress:
        trend = pr.compare(
            spectra, against, leads=measured.leads(call), progress=progress, at=common.grid_or_none("--at", call.at),
            tolerances=tolerances, **call.pick("connection state label"), **measured.fit_settings(call),
        )  # fmt: skip
    measured.deliver(call, trend, f"against {trend.comparisons[0].reference.source}")
    for item in trend.comparisons if tolerances else ():
        for text in item.outside(tolerances):
            common.complain(f"{item.measured.source}: {text}", style=None)
    if trend.passed is False:
        raise typer.Exit(1)


def _reference(name: str, changes: list[str] | None, read: measured.Reader) -> pr.Motor | pr.Spectrum:
    """Return the motor of a parameter set or a TOML file, or else a spectrum."""
    if name in pr.available_motors() or Path(name).suffix == ".toml":
        return common.load_changed(name, changes)
    if changes:
        raise pr.ParameterError("--set changes a motor, but the reference is a spectrum; leave it out.")
    return read(name)


def _refuse_idle(call: Call, spectra: list[pr.Spectrum], against: pr.Motor | pr.Spectrum) -> None:
    """Reject options of a motor or of two-ports without one, and a label without --at."""
    if call.at is None:
        call.refuse_idle("without --at", "label")
    if isinstance(against, pr.Spectrum):
        call.refuse_idle("on a spectrum as the reference", "state")
        if all(spectrum.ports == 1 for spectrum in (*spectra, against)):
            call.refuse_idle("on spectra of one port", "connection")


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
