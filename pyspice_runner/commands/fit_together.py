# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit --with``: one circuit for several spectra of one device."""

from __future__ import annotations

from pathlib import Path

import typer

import pyspice_runner as pr
from pyspice_runner.commands.common import busy, grid
from pyspice_runner.commands.measured import InputOptions, SeriesOptions, note
from pyspice_runner.commands.options import Targets


def fit_together(
    context: typer.Context,
    file: Path,
    source: InputOptions,
    options: SeriesOptions,
    modes: int | None,
    targets: Targets,
) -> None:
    """Fit several spectra together and deliver the circuit."""
    files = [file, *(options.series or ())]
    targets.check(".json", inputs=files)
    with busy("fitting"):
        result = pr.fit_together(
            [source.one_port(context, path) for path in files], modes=modes,
            voltages=grid("--voltages", options.voltages) if options.voltages is not None else None,
            temperatures=grid("--temperatures", options.temperatures) if options.temperatures is not None else None,
        )  # fmt: skip
    targets.deliver(result, f"{len(files)} spectra together")
    if not targets.as_json:
        note(result.warnings)
