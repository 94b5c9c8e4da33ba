# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit`` and ``constants``: circuits, motors and material constants of measured spectra."""

from __future__ import annotations

from typing import Any

import pyspice_runner as pr
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.measured import FIT, INPUT
from pyspice_runner.commands.options import TARGETS, Call, command, option
from pyspice_runner.impedance.spectrum import Connection

_CONNECTION = option("Connection of the groups, for a two-port.", Connection, "A")
_ARMS_TRIED = "{} of at most {} arms"
_OF_ONE_PORT = "leads opened short fixture_load load_ohm port_extension"
_OF_SERIES = "series voltages temperatures"
_OF_GROUPS = "two_port other both difference mass velocity tips base"


@command(
    "file", INPUT, "no_leads", _OF_ONE_PORT, _OF_SERIES, _OF_GROUPS, FIT, TARGETS,
    connection=_CONNECTION,
    timeout=option("Time limit of the fit of a spectrum, s."),
)  # fmt: skip
def fit(call: Call) -> None:
    """Fit an equivalent circuit to a spectrum.

    Writes .lib (SPICE), .asy (LTspice), .kicad_sym (KiCad), .s1p (Touchstone), .toml, .json (values) or .csv (curves).

    With --two-port, or --b and --sum or --difference, the couplings of every mode to both groups: writes .json, and
    with --mass-kg or --velocity-per-current a motor .toml.

    With --with, and --voltages or --temperatures, one circuit for all spectra: writes .json.

    Example: piezomotor fit measured.csv --modes 2 --output stator.lib --plot fit.png
    """
    if call.two_port or any(path is not None for path in (call.other, call.both, call.difference)):
        call.refuse_idle("where both groups are fitted", f"{_OF_ONE_PORT} {_OF_SERIES}")
        if call.plot is not None:
            raise pr.ParameterError("--plot draws one connection; leave out --two-port and choose a --connection.")
        _fit_groups(call)
        return
    if any(option is not None for option in (call.mass, call.velocity, call.tips)):
        raise pr.ParameterError("--mass-kg, --velocity-per-current and --tip belong to --two-port or --b; add one.")
    call.refuse_idle("without --two-port or --b", "base")
    if call.series or call.voltages is not None or call.temperatures is not None:
        if call.plot is not None:
            raise pr.ParameterError("--plot draws one spectrum; leave out --with.")
        call.refuse_idle("on spectra that are fitted together", f"no_leads {_OF_ONE_PORT} noise timeout")
        _fit_jointly(call)
        return
    _fit_one_port(call)


def _fit_one_port(call: Call) -> None:
    """Fit one spectrum, without its fixture, and deliver the circuit."""
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS
    from pyspice_runner.impedance.one_port_fit import fit_one_port

    parts = call.pick("opened short", load="fixture_load")
    call.check(*CIRCUIT_FORMATS, ".json", ".csv", inputs=[call.file, *parts.values()])
    if call.fixture_load is None:
        call.refuse_idle("without --load", "load_ohm")
    settings = {"leads": measured.leads(call), **measured.fit_settings(call)}
    with common.busy("reading"):
        spectrum = measured.read_one_port(call, call.file)
        read = measured.reader(call.columns, call.through)
        fixture = {name: read(path) for name, path in parts.items() if path is not None}
        if fixture or call.port_extension:
            from pyspice_runner.impedance.fixture import without_fixture

            spectrum = without_fixture(
                spectrum, **fixture, load_ohm=call.load_ohm, port_extension_s=call.port_extension
            )
    with common.busy("fitting", _ARMS_TRIED) as progress:
        result = fit_one_port(spectrum, **settings, progress=progress)
    count = len(result.arms)
    measured.deliver(call, result, f"{result.source}: {count} arm{'s' if count > 1 else ''}; ± one standard error")


def _fit_jointly(call: Call) -> None:
    """Fit several spectra together and deliver the circuit."""
    files = [call.file, *(call.series or ())]
    call.check(".json", inputs=files)
    with common.busy("fitting"):
        result = pr.fit_spectrum(
            [measured.read_one_port(call, path) for path in files],
            call.modes,
            voltages=common.grid_or_none("--voltages", call.voltages),
            temperatures=common.grid_or_none("--temperatures", call.temperatures),
        )
    measured.deliver(call, result, f"{len(files)} spectra together")


def _fit_groups(call: Call) -> None:
    """Fit both groups together and deliver the couplings, or with a calibration the motor."""
    from pyspice_runner.impedance.two_port_fit import fit_groups

    if call.velocity is None:
        call.refuse_idle("where both groups are fitted, without --velocity-per-current", "connection")
    calibration = _calibration(call)
    files = {"A": call.file, "B": call.other, "A+B": call.both, "A-B": call.difference}
    endings = (".json", ".toml") if calibration else (".json",)
    call.check(*endings, inputs=[*files.values(), calibration.get("base")])
    with common.busy("reading"):
        spectra = {name: measured.read(call, path) for name, path in files.items() if path is not None}
    if call.two_port and len(spectra) > 1:
        raise pr.ParameterError(
            "--two-port takes one file with both ports; leave it out to give --b, --sum, --difference."
        )
    given: Any = spectra["A"] if call.two_port else spectra
    with common.busy("fitting", _ARMS_TRIED) as progress:
        result = fit_groups(given, leads=not call.no_leads, **measured.fit_settings(call), progress=progress)
    motor = result.to_motor(**calibration) if calibration else None
    title = f"{result.source}: {len(result.modes)} modes; couplings in N/V per root kg; ± one standard error"
    table = common.summary_table(result.summary(), title)
    document = {**result.to_dict(), "motor": motor.to_dict() if motor else None}
    call.write(document, table, lambda path: result.save(path, **calibration))
    measured.note(result.cautions, call)


@command(
    "file", INPUT, "as_json output",
    connection=_CONNECTION,
    shape=option(
        "bar (length, width, thickness), disc (diameter, thickness; radial modes), rod (length, and "
        "diameter or width and thickness), plate (thickness, and diameter or length and width).",
        str, ..., metavar="SHAPE",
    ),
    length=option("Length, m."),
    width=option("Width, m."),
    thickness=option("Thickness, m."),
    diameter=option("Diameter, m."),
    density=option("Density, kg/m3.", float, ...),
    share=option(
        "Standard error of a size or the density, by ratio: length=0.1%. Repeatable.",
        list[str] | None, None, "--tolerance", metavar="NAME=SHARE",
    ),
    base=option("Card with the other constants: a ceramic of the library, or a .toml file.", str, "PZT-4"),
)  # fmt: skip
def constants(call: Call) -> None:
    """Determine the constants of a ceramic from the spectrum of a bar, disc, rod or plate. Writes .toml, .json, .csv.

    The .toml is a card for the library of solids. As --base of the next shape it collects the constants.

    Example: piezomotor constants bar.csv --shape bar --length 20mm --width 3mm --thickness 1mm --density 7.8k
    """
    from pyspice_runner.impedance.constants import material_constants

    call.check(".toml", ".json", ".csv", inputs=[call.file, call.base])
    tolerances = {}
    for name, text in common.pairs_of("--tolerance", call.share, "is not NAME=SHARE; write it as length=0.1%."):
        tolerances[name] = common.number(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
    sizes = {name: value for name, value in call.pick("length width thickness diameter").items() if value is not None}
    with common.busy("fitting"):
        spectrum = measured.read_one_port(call, call.file)
        result = material_constants(spectrum, call.shape, sizes, call.density, tolerances=tolerances, base=call.base)
    measured.deliver(call, result, f"{result.source}: constants of the {call.shape}; ± one standard error")


def _calibration(call: Call) -> dict[str, Any]:
    """Return the arguments that make a motor of the fit; empty without a calibration."""
    arguments: dict[str, Any] = {}
    for name, key, text in (
        ("--mass-kg", "mass_kg", call.mass),
        ("--velocity-per-current", "velocity_per_current", call.velocity),
    ):
        if text is not None:
            values = common.grid(name, text)
            arguments[key] = values[0] if len(values) == 1 else values
    if not arguments:
        call.refuse_idle("without --mass-kg or --velocity-per-current", "base")
        if call.tips:
            raise pr.ParameterError("--tip belongs to a motor; add --mass-kg or --velocity-per-current.")
        return arguments
    if call.tips:
        arguments["tips"] = measured.tips_of(call.tips)
    return {**arguments, **call.pick("connection base")}
