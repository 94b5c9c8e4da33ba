# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit`` of the equivalent circuit of a one-port."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import busy, engineering, refuse_idle, say
from pyspice_runner.commands.measured import FitOptions, InputOptions, OnePortOptions, note, reader
from pyspice_runner.commands.options import Targets

if TYPE_CHECKING:
    from pyspice_runner.spectra.fit import FittedArm, SpectrumFit

ARMS_TRIED = "{} of at most {} arms"
_COLUMNS = {
    "series_resonance_hz": "Hz", "quality_factor": "", "resistance_ohm": "Ω", "inductance_h": "H", "capacitance_f": "F",
}  # fmt: skip


def fit_one_port(
    context: typer.Context, file: Path, source: InputOptions, options: OnePortOptions, fit: FitOptions, targets: Targets
) -> None:
    """Fit one spectrum, without its fixture, and deliver the circuit."""
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS

    parts = {"opened": options.opened, "short": options.short, "load": options.load}
    targets.check(*CIRCUIT_FORMATS, ".json", ".csv", inputs=[file, *parts.values()])
    if options.load is None:
        refuse_idle(context, "without --load", "load_ohm")
    settings = {"leads": options.known, **fit.settings}
    with busy("reading"):
        spectrum = source.one_port(context, file)
        read = reader(source.columns, source.through)
        fixture = {name: read(path) for name, path in parts.items() if path is not None}
        if fixture:
            from pyspice_runner.spectra.fixture import without_fixture

            spectrum = without_fixture(spectrum, **fixture, load_ohm=options.load_ohm)
    with busy("fitting", ARMS_TRIED) as progress:
        result = pr.fit_spectrum(spectrum, **settings, progress=progress)
    targets.deliver(result, _table(result))
    if not targets.as_json:
        _tell(result)


def _table(result: SpectrumFit) -> Table:
    table = Table("arm", "f", "Q", "R", "L", "C", "k_eff", "M", box=None, padding=(0, 1, 0, 0))
    error = 100.0 * result.rms_relative_error
    table.title = f"{result.source}: {count_of(len(result.arms))}, {error:.3g} % RMS; ± one standard error"
    for number, arm in enumerate(result.arms, start=1):
        cells = [f"{engineering(getattr(arm, name), unit)} {_percent(arm, name)}" for name, unit in _COLUMNS.items()]
        factor, merit = arm.characteristics.coupling_factor, arm.characteristics.figure_of_merit
        table.add_row(f"{number}", *cells, f"{factor:.3f}", f"{merit:.3g}")
    return table


def count_of(arms: int) -> str:
    """Return ``1 arm`` or ``2 arms``."""
    return f"{arms} arm{'s' if arms > 1 else ''}"


def _percent(arm: FittedArm, name: str) -> str:
    error = arm.standard_errors[name]
    return "±?" if error is None else f"±{100.0 * error / getattr(arm, name):.2g}%"


def _tell(result: SpectrumFit) -> None:
    """Print what is no arm's, and what to know before using the values."""
    circuit, errors = result.circuit, result.standard_errors
    error, loss_error = errors["clamped_capacitance_f"], errors["loss_tangent"]
    share = "±?" if error is None else f"±{100.0 * error / circuit.clamped_capacitance_f:.2g}%"
    loss = "±?" if loss_error is None else f"±{loss_error:.2g}"
    say(
        f"clamped capacitance {engineering(circuit.clamped_capacitance_f, 'F')} {share}, loss tangent "
        f"{circuit.loss_tangent:.3g} {loss} at {engineering(circuit.loss_reference_hz, 'Hz')}, "
        + (
            f"leads {engineering(circuit.lead_resistance_ohm, 'Ω')} and {engineering(circuit.lead_inductance_h, 'H')}, "
            if result.leads
            else "no leads, "
        )
        + (f"damping coupled by {len(circuit.shared_losses)} shared resistance, " if circuit.shared_losses else "")
        + f"error {', '.join(f'{kind} {sigma:.2g}' for kind, sigma in result.noise.items())}\n"
    )
    main = circuit.definitions()[result.arms.index(result.main_arm)]
    by_definition = "; ".join(
        f"{name}: R1 {engineering(values['resistance_ohm'], 'Ω')}, L1 {engineering(values['inductance_h'], 'H')}, "
        f"C1 {engineering(values['capacitance_f'], 'F')}, Q {values['quality_factor']:.4g}"
        for name, values in main.items()
        if values is not None
    )
    say(f"main arm by other definitions: {by_definition}\n")
    tried = ", ".join(
        f"{item.arms}{' coupled' if item.rank else ''}{' with leads' if item.leads else ''} "
        f"({item.criterion:.0f}, {100.0 * item.rms_relative_error:.2g} %"
        f"{', ' if item.note else ''}{item.note})"
        for item in result.candidates
    )
    say(f"numbers of arms tried (information criterion, RMS error): {tried}\n")
    note(result.warnings)
