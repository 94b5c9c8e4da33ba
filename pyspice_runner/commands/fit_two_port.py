# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit --two-port`` and ``--b``: the couplings of every mode to both groups, towards a motor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import busy, deliver, engineering, grid, refuse_idle
from pyspice_runner.commands.fit_one_port import ARMS_TRIED
from pyspice_runner.commands.measured import FitOptions, GroupOptions, InputOptions, note, tips_of
from pyspice_runner.commands.options import Targets


def fit_two_port(
    context: typer.Context, file: Path, source: InputOptions, options: GroupOptions, fit: FitOptions, targets: Targets
) -> None:
    """Fit both groups together and deliver the couplings, or with a calibration the motor."""
    if options.velocity is None:
        refuse_idle(context, "where both groups are fitted, without --velocity-per-current", "connection")
    calibration = _calibration(context, source, options)
    files = {"A": file, "B": options.other, "A+B": options.both, "A-B": options.difference}
    endings = (".json", ".toml") if calibration else (".json",)
    targets.check(*endings, inputs=[*files.values(), calibration.get("base")])
    with busy("reading"):
        spectra = {name: source.read(path) for name, path in files.items() if path is not None}
    if options.two_port and len(spectra) > 1:
        raise pr.ParameterError(
            "--two-port takes one file with both ports; leave it out to give --b, --sum, --difference."
        )
    given: Any = spectra["A"] if options.two_port else spectra
    with busy("fitting", ARMS_TRIED) as progress:
        result = pr.fit_two_port(given, **fit.settings, progress=progress)
    motor = result.to_motor(**calibration) if calibration else None
    table = Table("mode", "f", "Q", "coupling A", "coupling B", box=None, padding=(0, 1, 0, 0))
    table.title = f"{result.source}: {len(result.modes)} modes; couplings in N/V per root kg; ± one standard error"
    for number, mode in enumerate(result.modes, start=1):
        couplings = (
            f"{getattr(mode, name):.4g} ±{mode.standard_errors[name]:.2g}"
            for name in ("coupling_a_n_per_v_kg05", "coupling_b_n_per_v_kg05")
        )
        frequency = engineering(mode.series_resonance_hz, "Hz")
        table.add_row(str(number), frequency, f"{mode.quality_factor:.4g}", *couplings)
    document = {**result.to_dict(), "motor": motor.to_dict() if motor else None}
    deliver(document, table, targets.as_json, (targets.output, lambda path: result.save(path, **calibration)))
    if not targets.as_json:
        note(result.warnings)


def _calibration(context: typer.Context, source: InputOptions, options: GroupOptions) -> dict[str, Any]:
    """Return the arguments that make a motor of the fit; empty without a calibration."""
    found: dict[str, Any] = {}
    for option, key, text in (
        ("--mass-kg", "mass_kg", options.mass),
        ("--velocity-per-current", "velocity_per_current", options.velocity),
    ):
        if text is not None:
            values = grid(option, text)
            found[key] = values[0] if len(values) == 1 else values
    if not found:
        refuse_idle(context, "without --mass-kg or --velocity-per-current", "base")
        if options.tips:
            raise pr.ParameterError("--tip belongs to a motor; add --mass-kg or --velocity-per-current.")
        return found
    if options.tips:
        found["tips"] = tips_of(options.tips)
    return {**found, "connection": source.connection, "base": options.base}
