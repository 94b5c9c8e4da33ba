# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit``: one port, several spectra of one device, or both groups of a motor."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.measured import FitOptions, GroupOptions, InputOptions, OnePortOptions, SeriesOptions
from pyspice_runner.commands.options import Targets, with_options
from pyspice_runner.impedance.one_port_fit import fit_one_port
from pyspice_runner.impedance.two_port_fit import fit_groups

_ARMS_TRIED = "{} of at most {} arms"
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
        common.refuse_idle(context, "where both groups are fitted", *_OF_ONE_PORT, *_OF_SERIES)
        if targets.plot is not None:
            raise pr.ParameterError("--plot draws one connection; leave out --two-port and choose a --connection.")
        _fit_groups(context, file, source, groups, fitting, targets)
        return
    if any(option is not None for option in (groups.mass, groups.velocity, groups.tips)):
        raise pr.ParameterError("--mass-kg, --velocity-per-current and --tip belong to --two-port or --b; add one.")
    common.refuse_idle(context, "without --two-port or --b", "base")
    if series.series or series.voltages is not None or series.temperatures is not None:
        if targets.plot is not None:
            raise pr.ParameterError("--plot draws one spectrum; leave out --with.")
        common.refuse_idle(context, "on spectra that are fitted together", *_OF_ONE_PORT, "noise", "timeout")
        _fit_jointly(context, file, source, series, fitting.modes, targets)
        return
    _fit_one_port(context, file, source, one_port, fitting, targets)


def _fit_one_port(
    context: typer.Context, file: Path, source: InputOptions, options: OnePortOptions, fit: FitOptions, targets: Targets
) -> None:
    """Fit one spectrum, without its fixture, and deliver the circuit."""
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS

    parts = {"opened": options.opened, "short": options.short, "load": options.load}
    targets.check(*CIRCUIT_FORMATS, ".json", ".csv", inputs=[file, *parts.values()])
    if options.load is None:
        common.refuse_idle(context, "without --load", "load_ohm")
    settings = {"leads": options.known(context), **fit.settings}
    with common.busy("reading"):
        spectrum = source.one_port(context, file)
        read = measured.reader(source.columns, source.through)
        fixture = {name: read(path) for name, path in parts.items() if path is not None}
        if fixture:
            from pyspice_runner.impedance.fixture import without_fixture

            spectrum = without_fixture(spectrum, **fixture, load_ohm=options.load_ohm)
    with common.busy("fitting", _ARMS_TRIED) as progress:
        result = fit_one_port(spectrum, **settings, progress=progress)
    count = len(result.arms)
    targets.deliver(result, f"{result.source}: {count} arm{'s' if count > 1 else ''}; ± one standard error")
    measured.note(result.cautions, targets)


def _fit_jointly(
    context: typer.Context, file: Path, source: InputOptions, series: SeriesOptions, modes: int | None, targets: Targets
) -> None:
    """Fit several spectra together and deliver the circuit."""
    files = [file, *(series.series or ())]
    targets.check(".json", inputs=files)
    with common.busy("fitting"):
        result = pr.fit_spectrum(
            [source.one_port(context, path) for path in files],
            modes,
            voltages=common.grid_or_none("--voltages", series.voltages),
            temperatures=common.grid_or_none("--temperatures", series.temperatures),
        )
    targets.deliver(result, f"{len(files)} spectra together")
    measured.note(result.cautions, targets)


def _fit_groups(
    context: typer.Context, file: Path, source: InputOptions, options: GroupOptions, fit: FitOptions, targets: Targets
) -> None:
    """Fit both groups together and deliver the couplings, or with a calibration the motor."""
    if options.velocity is None:
        common.refuse_idle(context, "where both groups are fitted, without --velocity-per-current", "connection")
    calibration = _calibration(context, source, options)
    files = {"A": file, "B": options.other, "A+B": options.both, "A-B": options.difference}
    endings = (".json", ".toml") if calibration else (".json",)
    targets.check(*endings, inputs=[*files.values(), calibration.get("base")])
    with common.busy("reading"):
        spectra = {name: source.read(path) for name, path in files.items() if path is not None}
    if options.two_port and len(spectra) > 1:
        raise pr.ParameterError(
            "--two-port takes one file with both ports; leave it out to give --b, --sum, --difference."
        )
    given: Any = spectra["A"] if options.two_port else spectra
    with common.busy("fitting", _ARMS_TRIED) as progress:
        result = fit_groups(given, **fit.settings, progress=progress)
    motor = result.to_motor(**calibration) if calibration else None
    title = f"{result.source}: {len(result.modes)} modes; couplings in N/V per root kg; ± one standard error"
    table = common.summary_table(result.summary(), title)
    document = {**result.to_dict(), "motor": motor.to_dict() if motor else None}
    targets.write(document, table, lambda path: result.save(path, **calibration))
    measured.note(result.cautions, targets)


def _calibration(context: typer.Context, source: InputOptions, options: GroupOptions) -> dict[str, Any]:
    """Return the arguments that make a motor of the fit; empty without a calibration."""
    found: dict[str, Any] = {}
    for option, key, text in (
        ("--mass-kg", "mass_kg", options.mass),
        ("--velocity-per-current", "velocity_per_current", options.velocity),
    ):
        if text is not None:
            values = common.grid(option, text)
            found[key] = values[0] if len(values) == 1 else values
    if not found:
        common.refuse_idle(context, "without --mass-kg or --velocity-per-current", "base")
        if options.tips:
            raise pr.ParameterError("--tip belongs to a motor; add --mass-kg or --velocity-per-current.")
        return found
    if options.tips:
        found["tips"] = measured.tips_of(options.tips)
    return {**found, "connection": source.connection, "base": options.base}
