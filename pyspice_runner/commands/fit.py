# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit``: the equivalent circuit of a measured spectrum."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    JsonOption,
    OutputOption,
    PlotOption,
    busy,
    check_targets,
    complain,
    deliver,
    engineering,
    grid,
    refuse_idle,
    say,
)

if TYPE_CHECKING:
    from pyspice_runner.spectra.fit import FittedArm, SpectrumFit


class Port(StrEnum):
    """How the groups of a two-port are connected."""

    a = "A"
    b = "B"
    a_plus_b = "A+B"
    a_minus_b = "A-B"


class Through(StrEnum):
    """How one device is connected between two ports."""

    series = "series"
    shunt = "shunt"


FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="A measured spectrum, in any format that is known.")]
ModesOption = Annotated[int | None, typer.Option(help="Number of motional arms; found if it is not given.")]
ConnectionOption = Annotated[Port, typer.Option(help="Connection of the groups, for the spectrum of a two-port.")]
StartOption = Annotated[float, typer.Option(help="First frequency that counts, Hz.")]
StopOption = Annotated[float | None, typer.Option(help="Last frequency that counts, Hz.")]
LeadsOption = Annotated[
    str,
    typer.Option(
        metavar="auto|none|L,R",
        help="Find leads where the data demand them, take them as compensated, or state them as 20nH,0.1ohm.",
    ),
]
NoLeadsOption = Annotated[bool, typer.Option("--no-leads", help="The same as --leads none.")]
NoiseOption = Annotated[
    str | None,
    typer.Option(
        metavar="KIND=VALUE,…",
        help="Known error: proportional=0.1%, s11=1e-4 (in 50 Ω) or z=0.1 (Ω). Estimated if not given.",
    ),
]
_FIXTURE = "Fixture"
OpenOption = Annotated[
    Path | None, typer.Option("--open", help="Spectrum of the fixture without the device.", rich_help_panel=_FIXTURE)
]
ShortOption = Annotated[
    Path | None, typer.Option("--short", help="Spectrum of the fixture with a short.", rich_help_panel=_FIXTURE)
]
LoadOption = Annotated[
    Path | None,
    typer.Option("--load", help="Spectrum of the fixture with a resistor of --load-ohm.", rich_help_panel=_FIXTURE),
]
LoadOhmOption = Annotated[float, typer.Option("--load-ohm", help="That resistor, Ω.", rich_help_panel=_FIXTURE)]
FitTimeoutOption = Annotated[
    float | None, typer.Option("--timeout", help="Seconds after which the fit of a spectrum ends with an error.")
]
ColumnsOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,…",
        help="Columns of a table whose header is missing or not known, as frequency_hz,r_ohm,x_ohm or "
        "f_hz,z_ohm,phase_deg; - for a column that does not count.",
    ),
]
ThroughOption = Annotated[
    Through | None,
    typer.Option(help="One device between the ports of an .s2p: in series, or a shunt to ground. Told if not given."),
]
TraceOption = Annotated[str | None, typer.Option(help="Which of several spectra in the file, such as memory.")]
_SERIES = "Several spectra of one device"
WithOption = Annotated[
    list[Path] | None,
    typer.Option("--with", help="Spectrum of the same device, fitted together. Repeatable.", rich_help_panel=_SERIES),
]
VoltagesOption = Annotated[
    str | None,
    typer.Option(help="Amplitudes at the device in V, of FILE and each --with: 1,5,20.", rich_help_panel=_SERIES),
]
TemperaturesOption = Annotated[
    str | None, typer.Option(help="Temperatures in °C, of FILE and each --with: 20,40,60.", rich_help_panel=_SERIES)
]
_PANEL = "Both groups, towards a motor"
TwoPortOption = Annotated[
    bool, typer.Option("--two-port", help="Fit both groups of a two-port together.", rich_help_panel=_PANEL)
]
OtherOption = Annotated[
    Path | None, typer.Option("--b", help="Spectrum of group B, A shorted; FILE is then A.", rich_help_panel=_PANEL)
]
SumOption = Annotated[
    Path | None, typer.Option("--sum", help="Spectrum of A and B in parallel.", rich_help_panel=_PANEL)
]
DifferenceOption = Annotated[
    Path | None, typer.Option("--difference", help="Spectrum of A against B.", rich_help_panel=_PANEL)
]
MassOption = Annotated[
    str | None,
    typer.Option("--mass-kg", help="Modal mass in kg: one, or one a mode: 2e-3,3e-3.", rich_help_panel=_PANEL),
]
VelocityOption = Annotated[
    str | None,
    typer.Option(
        "--velocity-per-current",
        help="Instead, the tip's velocity per motional current of --connection, m/s/A: of mode 1, or of each.",
        rich_help_panel=_PANEL,
    ),
]
TipOption = Annotated[
    list[str] | None,
    typer.Option(
        "--tip", metavar="X,Y", help="Motion of the tip in a mode, as 0,1. Once a mode.", rich_help_panel=_PANEL
    ),
]
BaseOption = Annotated[
    str, typer.Option("--base", help="Motor that contact and rotor are taken from.", rich_help_panel=_PANEL)
]

_ARMS_TRIED = "{} of at most {} arms"
_COLUMNS = {
    "series_resonance_hz": "Hz",
    "quality_factor": "",
    "resistance_ohm": "Ω",
    "inductance_h": "H",
    "capacitance_f": "F",
}


def reader(
    columns: str | None, through: Through | None, trace: str | None = None
) -> Callable[[str | Path], pr.Spectrum]:
    """Return the function that reads a spectrum as the options of a command say."""
    names = [name.strip() for name in columns.split(",")] if columns is not None else None
    device: Literal["series", "shunt"] | None = through.value if through else None
    return partial(pr.read_spectrum, trace=trace, columns=names, through=device)


def driven(context: typer.Context, spectrum: pr.Spectrum, connection: Port) -> pr.Spectrum:
    """Return a spectrum of one port, of a two-port that through a connection.

    Raises:
        ParameterError: if the command line has a connection, and the spectrum has one port.
    """
    if spectrum.ports == 2:
        return spectrum.driven(connection.value)
    refuse_idle(context, f"on {spectrum.source or 'a spectrum'}, which has one port", "connection")
    return spectrum


_OF_ONE_PORT = ("leads", "no_leads", "opened", "short", "load", "load_ohm")
_OF_SERIES = ("series", "voltages", "temperatures")
_PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3}
_LEAD = re.compile(r"(?P<number>[0-9.]+(?:e[-+]?[0-9]+)?) ?(?P<prefix>[pnuµmk]?)(?P<unit>H|ohm|Ω)")


def leads_of(text: str, none: bool) -> bool | tuple[float, float]:
    """Read --leads: True to find them, False for none, or resistance in Ω and inductance in H."""
    if none or text in ("auto", "none"):
        return not (none or text == "none")
    found = {"H": 0.0, "ohm": 0.0}
    for part in text.split(","):
        match = _LEAD.fullmatch(part.strip())
        try:
            value = float(match["number"]) * _PREFIXES[match["prefix"]] if match else None
        except ValueError:
            value = None
        if match is None or value is None:
            raise pr.ParameterError(f"--leads {text!r} is not valid: write auto, none, or values as 20nH,0.1ohm.")
        found["H" if match["unit"] == "H" else "ohm"] = value
    return found["ohm"], found["H"]


def noise_of(text: str | None) -> dict[str, float] | None:
    """Read --noise: kind → σ."""
    if text is None:
        return None
    found = {}
    for part in text.split(","):
        kind, _, value = part.partition("=")
        try:
            found[kind.strip()] = float(value.removesuffix("%")) * (0.01 if value.endswith("%") else 1.0)
        except ValueError:
            raise pr.ParameterError(
                f"--noise {text!r} is not valid: write proportional=0.1%, s11=1e-4 or z=0.1, or proportional "
                f"and one other."
            ) from None
    return found


def fit(
    context: typer.Context,
    file: FileArgument,
    modes: ModesOption = None,
    connection: ConnectionOption = Port.a,
    leads: LeadsOption = "auto",
    no_leads: NoLeadsOption = False,
    noise: NoiseOption = None,
    opened: OpenOption = None,
    short: ShortOption = None,
    load: LoadOption = None,
    load_ohm: LoadOhmOption = 50.0,
    timeout: FitTimeoutOption = None,
    trace: TraceOption = None,
    columns: ColumnsOption = None,
    through: ThroughOption = None,
    start: StartOption = 0.0,
    stop: StopOption = None,
    series: WithOption = None,
    voltages: VoltagesOption = None,
    temperatures: TemperaturesOption = None,
    two_port: TwoPortOption = False,
    other: OtherOption = None,
    both: SumOption = None,
    difference: DifferenceOption = None,
    mass: MassOption = None,
    velocity: VelocityOption = None,
    tips: TipOption = None,
    base: BaseOption = "andersen2002",
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Fit an equivalent circuit to a spectrum.

    Writes .lib (SPICE), .asy (LTspice), .kicad_sym (KiCad), .s1p (Touchstone), .toml, .json (values) or .csv (curves).

    With --two-port, or --b and --sum or --difference, the couplings of every mode to both groups: writes .json, and
    with --mass-kg or --velocity-per-current a motor .toml.

    With --with, and --voltages or --temperatures, one circuit for all spectra: writes .json.

    Example: piezomotor fit measured.csv --modes 2 --output stator.lib --plot fit.png
    """
    read = reader(columns, through, trace)

    def part(path: Path) -> pr.Spectrum:
        return read(path).between(start, inf if stop is None else stop)

    def one_port(path: Path) -> pr.Spectrum:
        return driven(context, part(path), connection)

    if two_port or other is not None or both is not None or difference is not None:
        refuse_idle(context, "where both groups are fitted", *_OF_ONE_PORT, *_OF_SERIES)
        _refuse_uncalibrated(context, mass, velocity)
        given = {"A": file, "B": other, "A+B": both, "A-B": difference}
        calibration = _calibration(mass, velocity, connection, tips, base)
        _fit_two_port(given, two_port, modes, noise_of(noise), timeout, part, calibration, as_json, output, plot)
        return
    if mass or velocity or tips:
        raise pr.ParameterError("--mass-kg, --velocity-per-current and --tip belong to --two-port or --b; add one.")
    refuse_idle(context, "without --two-port or --b", "base")
    if series or voltages is not None or temperatures is not None:
        if plot is not None:
            raise pr.ParameterError("--plot draws one spectrum; leave out --with.")
        refuse_idle(context, "on spectra that are fitted together", *_OF_ONE_PORT, "noise", "timeout")
        _fit_together([file, *(series or ())], one_port, voltages, temperatures, modes, as_json, output)
        return
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS

    check_targets(output, (*CIRCUIT_FORMATS, ".json", ".csv"), plot, [file, opened, short, load])
    if load is None:
        refuse_idle(context, "without --load", "load_ohm")
    known, error = leads_of(leads, no_leads), noise_of(noise)
    with busy("reading"):
        spectrum = one_port(file)
        of_fixture = reader(columns, through)
        fixture = [of_fixture(path) if path is not None else None for path in (opened, short, load)]
        if any(part is not None for part in fixture):
            from pyspice_runner.spectra.fixture import without_fixture

            parts = dict(zip(("opened", "short", "load"), fixture, strict=True))
            spectrum = without_fixture(spectrum, **parts, load_ohm=load_ohm)
    with busy("fitting", _ARMS_TRIED) as progress:
        result = pr.fit_spectrum(spectrum, modes, leads=known, noise=error, timeout=timeout, progress=progress)
    deliver(result.to_dict(), _table(result), as_json, (output, result.save), (plot, result.plot))
    if not as_json:
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
    _note(result.warnings)


def _note(warnings: tuple[str, ...]) -> None:
    for warning in warnings:
        complain(f"note: {warning}", style=None)


def _refuse_uncalibrated(context: typer.Context, mass: str | None, velocity: str | None) -> None:
    """Refuse options of the calibration that the given one does not use."""
    if velocity is None:
        refuse_idle(context, "where both groups are fitted, without --velocity-per-current", "connection")
    if velocity is None and mass is None:
        refuse_idle(context, "without --mass-kg or --velocity-per-current", "base")


def _calibration(
    mass: str | None, velocity: str | None, connection: Port, tips: list[str] | None, base: str
) -> dict[str, Any]:
    """Return what makes a motor of the fit, as far as it is given."""
    found: dict[str, Any] = {}
    for option, key, text in (
        ("--mass-kg", "mass_kg", mass),
        ("--velocity-per-current", "velocity_per_current", velocity),
    ):
        if text is not None:
            values = grid(option, text)
            found[key] = values[0] if len(values) == 1 else values
    if not found:
        if tips:
            raise pr.ParameterError("--tip belongs to a motor; add --mass-kg or --velocity-per-current.")
        return found
    if tips:
        found["tips"] = tips_of(tips)
    return {**found, "connection": connection.value, "base": base}


def tips_of(tips: list[str] | None) -> list[tuple[float, float]] | None:
    """Read the pairs of --tip."""
    if not tips:
        return None
    pairs = [grid("--tip", tip) for tip in tips]
    if any(len(pair) != 2 for pair in pairs):
        raise pr.ParameterError(f"--tip {tips[0]!r} is not valid; write X,Y as 0,1, once for each mode.")
    return [(pair[0], pair[1]) for pair in pairs]


def _fit_together(
    files: list[Path],
    part: Callable[[Path], pr.Spectrum],
    voltages: str | None,
    temperatures: str | None,
    modes: int | None,
    as_json: bool,
    output: Path | None,
) -> None:
    check_targets(output, (".json",), None, files)
    with busy("fitting"):
        result = pr.fit_together(
            [part(path) for path in files], modes=modes,
            voltages=grid("--voltages", voltages) if voltages is not None else None,
            temperatures=grid("--temperatures", temperatures) if temperatures is not None else None,
        )  # fmt: skip
    table = Table("", "", box=None, padding=(0, 1, 0, 0), show_header=False)
    for name, value in result.summary().items():
        table.add_row(name, value)
    deliver(result.to_dict(), table, as_json, (output, result.save))
    if not as_json:
        _note(result.warnings)


def _fit_two_port(
    files: Mapping[str, Path | None],
    two_port: bool,
    modes: int | None,
    noise: dict[str, float] | None,
    timeout: float | None,
    read: Callable[[Path], pr.Spectrum],
    calibration: Mapping[str, Any],
    as_json: bool,
    output: Path | None,
    plot: Path | None,
) -> None:
    if plot is not None:
        raise pr.ParameterError("--plot draws one connection; leave out --two-port and choose a --connection.")
    inputs = [*files.values(), calibration.get("base")]
    check_targets(output, (".json", ".toml") if calibration else (".json",), None, inputs)
    with busy("reading"):
        spectra = {name: read(file) for name, file in files.items() if file is not None}
    if two_port and len(spectra) > 1:
        raise pr.ParameterError(
            "--two-port takes one file with both ports; leave it out to give --b, --sum, --difference."
        )
    given: Any = spectra["A"] if two_port else spectra
    with busy("fitting", _ARMS_TRIED) as progress:
        result = pr.fit_two_port(given, modes, noise=noise, timeout=timeout, progress=progress)
    motor = result.to_motor(**calibration) if calibration else None
    table = Table("mode", "f", "Q", "coupling A", "coupling B", box=None, padding=(0, 1, 0, 0))
    table.title = f"{result.source}: {len(result.modes)} modes; couplings in N/V per root kg; ± one standard error"
    for number, mode in enumerate(result.modes, start=1):
        table.add_row(
            str(number), engineering(mode.series_resonance_hz, "Hz"), f"{mode.quality_factor:.4g}",
            *(
                f"{getattr(mode, name):.4g} ±{mode.standard_errors[name]:.2g}"
                for name in ("coupling_a_n_per_v_kg05", "coupling_b_n_per_v_kg05")
            ),
        )  # fmt: skip
    document = {**result.to_dict(), "motor": motor.to_dict() if motor else None}
    deliver(document, table, as_json, (output, lambda path: result.save(path, **calibration)))
    if not as_json:
        _note(result.warnings)
