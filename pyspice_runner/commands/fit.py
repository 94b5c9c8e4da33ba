# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit``: the equivalent circuit of a measured spectrum."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    CIRCUIT_ENDINGS,
    JsonOption,
    OutputOption,
    PlotOption,
    busy,
    check_targets,
    engineering,
    show_result,
)


class Port(StrEnum):
    """How the groups of a two-port are connected."""

    a = "A"
    b = "B"
    a_plus_b = "A+B"
    a_minus_b = "A-B"


FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="A measured spectrum, in any format that is known.")]
ModesOption = Annotated[int | None, typer.Option(help="Number of motional arms; found if it is not given.")]
ConnectionOption = Annotated[Port, typer.Option(help="Connection of the groups, for the spectrum of a two-port.")]
LeadsOption = Annotated[bool, typer.Option("--leads/--no-leads", help="Fit the leads, or take them as compensated.")]
TraceOption = Annotated[str | None, typer.Option(help="Which of several spectra in the file, such as memory.")]


_COLUMNS = {
    "series_resonance_hz": "Hz",
    "quality_factor": "",
    "resistance_ohm": "Ω",
    "inductance_h": "H",
    "capacitance_f": "F",
}
_WITH_ERROR = ("series_resonance_hz", "quality_factor", "resistance_ohm")


def read_one_port(file: Path, trace: str | None, connection: Port) -> pr.Spectrum:
    """Read a spectrum; of a two-port, take one connection of its groups."""
    spectrum = pr.read_spectrum(file, trace=trace)
    return spectrum.driven(connection.value) if spectrum.ports == 2 else spectrum


def fit(
    file: FileArgument,
    modes: ModesOption = None,
    connection: ConnectionOption = Port.a,
    leads: LeadsOption = True,
    trace: TraceOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Fit an equivalent circuit to a spectrum.

    Writes .lib (SPICE), .asy (LTspice), .kicad_sym (KiCad), .s1p (Touchstone), .toml, .json (values) or .csv (curves).

    Example: piezomotor fit measured.csv --modes 2 --output stator.lib --plot fit.png
    """
    check_targets(output, (*CIRCUIT_ENDINGS, ".json", ".csv"), plot)
    with busy("fitting"):
        result = pr.fit_spectrum(read_one_port(file, trace, connection), modes, leads=leads)
    if output is not None:
        result.save(output)
    if plot is not None:
        result.plot(plot)
    if not as_json:
        _tell(result)
    show_result(result.to_dict(), _table(result), as_json)


def _table(result: pr.SpectrumFit) -> Table:
    table = Table("arm", "f", "Q", "R", "L", "C", "k_eff", "M", box=None, padding=(0, 1, 0, 0))
    error = 100.0 * result.rms_relative_error
    table.title = f"{result.source}: {count_of(len(result.arms))}, {error:.3g} % RMS; ± one standard error"
    for number, arm in enumerate(result.arms, start=1):
        cells = [
            f"{engineering(getattr(arm, name), unit)} {_percent(arm, name) if name in _WITH_ERROR else ''}"
            for name, unit in _COLUMNS.items()
        ]
        factor, merit = arm.characteristics.coupling_factor, arm.characteristics.figure_of_merit
        table.add_row(f"{number}", *cells, f"{factor:.3f}", f"{merit:.3g}")
    return table


def count_of(arms: int) -> str:
    """Return ``1 arm`` or ``2 arms``."""
    return f"{arms} arm{'s' if arms > 1 else ''}"


def _percent(arm: pr.FittedArm, name: str) -> str:
    error = arm.standard_errors[name]
    return "±?" if error is None else f"±{100.0 * error / getattr(arm, name):.2g}%"


def _tell(result: pr.SpectrumFit) -> None:
    """Print what is no arm's, and what to know before using the values."""
    circuit = result.circuit
    console = Console(highlight=False, soft_wrap=True)
    console.print(
        f"clamped capacitance {engineering(circuit.clamped_capacitance_f, 'F')}, loss tangent "
        f"{circuit.loss_tangent:.3g} at {engineering(circuit.loss_reference_hz, 'Hz')}, leads "
        f"{engineering(circuit.lead_resistance_ohm, 'Ω')} and {engineering(circuit.lead_inductance_h, 'H')}"
    )
    tried = ", ".join(
        f"{item.arms} ({item.criterion:.0f}, {100.0 * item.rms_relative_error:.2g} %"
        f"{', ' if item.note else ''}{item.note})"
        for item in result.candidates
    )
    console.print(f"numbers of arms tried (information criterion, RMS error): {tried}")
    complain = Console(stderr=True, highlight=False, soft_wrap=True)
    for warning in result.warnings:
        complain.print(f"note: {warning}", markup=False)
