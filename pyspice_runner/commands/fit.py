# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit``: one port, several spectra of one device, or both groups of a motor."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands.common import refuse_idle
from pyspice_runner.commands.fit_one_port import fit_one_port
from pyspice_runner.commands.fit_together import fit_together
from pyspice_runner.commands.fit_two_port import fit_two_port
from pyspice_runner.commands.measured import FitOptions, GroupOptions, InputOptions, OnePortOptions, SeriesOptions
from pyspice_runner.commands.options import Targets, with_options

_OF_ONE_PORT = tuple(field.name for field in fields(OnePortOptions))
_OF_SERIES = tuple(field.name for field in fields(SeriesOptions))


@with_options
def fit(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A measured spectrum in any known format.")],
    source: InputOptions,
    one_port: OnePortOptions,
    series: SeriesOptions,
    groups: GroupOptions,
    fitting: FitOptions,
    targets: Targets,
) -> None:
    """Fit an equivalent circuit to a spectrum.

    Writes .lib (SPICE), .asy (LTspice), .kicad_sym (KiCad), .s1p (Touchstone), .toml, .json (values) or .csv (curves).

    With --two-port, or --b and --sum or --difference, the couplings of every mode to both groups: writes .json, and
    with --mass-kg or --velocity-per-current a motor .toml.

    With --with, and --voltages or --temperatures, one circuit for all spectra: writes .json.

    Example: piezomotor fit measured.csv --modes 2 --output stator.lib --plot fit.png
    """
    if groups.two_port or any(path is not None for path in (groups.other, groups.both, groups.difference)):
        refuse_idle(context, "where both groups are fitted", *_OF_ONE_PORT, *_OF_SERIES)
        if targets.plot is not None:
            raise pr.ParameterError("--plot draws one connection; leave out --two-port and choose a --connection.")
        fit_two_port(context, file, source, groups, fitting, targets)
        return
    if groups.mass or groups.velocity or groups.tips:
        raise pr.ParameterError("--mass-kg, --velocity-per-current and --tip belong to --two-port or --b; add one.")
    refuse_idle(context, "without --two-port or --b", "base")
    if series.series or series.voltages is not None or series.temperatures is not None:
        if targets.plot is not None:
            raise pr.ParameterError("--plot draws one spectrum; leave out --with.")
        refuse_idle(context, "on spectra that are fitted together", *_OF_ONE_PORT, "noise", "timeout")
        fit_together(context, file, source, series, fitting.modes, targets)
        return
    fit_one_port(context, file, source, one_port, fitting, targets)
