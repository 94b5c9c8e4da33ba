# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of the commands that read and fit measured spectra, declared once."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import Options, Targets
from pyspice_runner.impedance.spectrum import Connection

Reader = Callable[[str | Path], pr.Spectrum]

ModesOption = Annotated[int | None, typer.Option(help="Number of motional arms; selected by default.")]
ColumnsOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,…",
        help="Columns of a table whose header is missing or unknown, as frequency_hz,r_ohm,x_ohm or "
        "f_hz,z_ohm,phase_deg; - for a column to ignore.",
    ),
]
ThroughOption = Annotated[
    Literal["series", "shunt"] | None,
    typer.Option(help="Single device in an .s2p: series between the ports, or shunt to ground. By default detected."),
]
_group = partial(typer.Option, rich_help_panel="Both groups, towards a motor")
OtherOption = Annotated[Path | None, _group("--b", help="Spectrum of group B, A shorted; FILE is then A.")]
SumOption = Annotated[Path | None, _group("--sum", help="Spectrum of A and B in parallel.")]
DifferenceOption = Annotated[Path | None, _group("--difference", help="Spectrum of A against B.")]
MassOption = Annotated[str | None, _group("--mass-kg", help="Modal mass in kg: one, or one per mode: 2e-3,3e-3.")]
TipOption = Annotated[
    list[str] | None,
    _group("--tip", metavar="X,Y", help="Direction of the tip's motion in a mode, as 0,1. Once for each mode."),
]
BaseOption = Annotated[str, _group("--base", help="Motor to take contact and rotor from.")]
_fixture = partial(typer.Option, rich_help_panel="Fixture")
_series = partial(typer.Option, rich_help_panel="Several spectra of one device")


@dataclass(frozen=True)
class InputOptions(Options):
    """What to read of a file."""

    connection: Annotated[Connection, typer.Option(help="Connection of the groups, for a two-port.")] = "A"
    trace: Annotated[str | None, typer.Option(help="One of several spectra in the file, such as memory.")] = None
    columns: ColumnsOption = None
    through: ThroughOption = None
    start: Annotated[float, typer.Option(help="Lowest frequency to use, Hz.")] = 0.0
    stop: Annotated[float | None, typer.Option(help="Highest frequency to use, Hz.")] = None

    def read(self, path: Path) -> pr.Spectrum:
        """Read a spectrum within the band."""
        spectrum = reader(self.columns, self.through, self.trace)(path)
        return spectrum.between(self.start, inf if self.stop is None else self.stop)

    def one_port(self, context: typer.Context, path: Path) -> pr.Spectrum:
        """Read the spectrum of a one-port, which takes no connection, or of a two-port through the connection."""
        spectrum = self.read(path)
        if spectrum.ports == 2:
            return spectrum.driven(self.connection)
        common.refuse_idle(context, f"on {spectrum.source or 'a spectrum'}, which has one port", "connection")
        return spectrum


@dataclass(frozen=True)
class FitOptions(Options):
    """How a spectrum is fitted."""

    modes: ModesOption = None
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="KIND=VALUE,…",
            help="Known error: proportional=0.1%, s11=1e-4 (in 50 Ω) or z=0.1 (Ω). Estimated by default.",
        ),
    ] = None
    timeout: Annotated[float | None, typer.Option(help="Time limit of the fit of a spectrum, s.")] = None

    @property
    def settings(self) -> dict[str, Any]:
        """The arguments of a fit."""
        return {"modes": self.modes, "noise": noise_of(self.noise), "timeout": self.timeout}


@dataclass(frozen=True)
class LeadOptions(Options):
    """The leads of a one-port."""

    leads: Annotated[
        str,
        typer.Option(
            metavar="auto|none|L,R",
            help="auto: fit leads if the data need them; none: leads are compensated; or their values, as 20nH,0.1ohm.",
        ),
    ] = "auto"
    no_leads: Annotated[bool, typer.Option("--no-leads", help="The same as --leads none.")] = False

    def known(self, context: typer.Context) -> bool | tuple[float, float]:
        """Return the argument ``leads`` of a fit. Raise ParameterError for --leads beside --no-leads."""
        if self.no_leads:
            common.refuse_idle(context, "beside --no-leads", "leads")
        return leads_of("none" if self.no_leads else self.leads)


@dataclass(frozen=True)
class OnePortOptions(LeadOptions):
    """Leads and fixture of a one-port."""

    opened: Annotated[Path | None, _fixture("--open", help="Spectrum of the fixture without the device.")] = None
    short: Annotated[Path | None, _fixture("--short", help="Spectrum of the fixture with a short.")] = None
    load: Annotated[Path | None, _fixture("--load", help="Spectrum of the fixture with a resistor of --load-ohm.")] = (
        None
    )
    load_ohm: Annotated[float, _fixture("--load-ohm", help="Resistance of that resistor, Ω.")] = 50.0


@dataclass(frozen=True)
class SeriesOptions(Options):
    """Several spectra of one device."""

    series: Annotated[
        list[Path] | None, _series("--with", help="Spectrum of the same device, fitted together. Repeatable.")
    ] = None
    voltages: Annotated[str | None, _series(help="Amplitudes at the device in V, of FILE and each --with: 1,5,20.")] = (
        None
    )
    temperatures: Annotated[str | None, _series(help="Temperatures in °C, of FILE and each --with: 20,40,60.")] = None


@dataclass(frozen=True)
class GroupOptions(Options):
    """Spectra of both groups, and the calibration for a motor."""

    two_port: Annotated[bool, _group("--two-port", help="Fit both groups of a two-port together.")] = False
    other: OtherOption = None
    both: SumOption = None
    difference: DifferenceOption = None
    mass: MassOption = None
    velocity: Annotated[
        str | None,
        _group(
            "--velocity-per-current",
            help="Instead, tip velocity per motional current of --connection, m/s/A: of mode 1, or of each mode.",
        ),
    ] = None
    tips: TipOption = None
    base: BaseOption = "andersen2002"


def reader(columns: str | None, through: Literal["series", "shunt"] | None, trace: str | None = None) -> Reader:
    """Return the function that reads a spectrum with the options of a command."""
    names = [name.strip() for name in columns.split(",")] if columns is not None else None
    return partial(pr.read_spectrum, trace=trace, columns=names, through=through)


_PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3}
_LEAD = re.compile(r"((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?) ?([pnuµmk]?)(H|ohm|Ω)")


def leads_of(text: str) -> bool | tuple[float, float]:
    """Read --leads: True to look for them, False for none, or resistance in Ω and inductance in H."""
    if text in ("auto", "none"):
        return text == "auto"
    found = {"H": 0.0, "ohm": 0.0}
    for part in text.split(","):
        match = _LEAD.fullmatch(part.strip())
        if match is None:
            raise pr.ParameterError(f"--leads {text!r} is not valid: write auto, none, or values as 20nH,0.1ohm.")
        found["H" if match[3] == "H" else "ohm"] = float(match[1]) * _PREFIXES[match[2]]
    return found["ohm"], found["H"]


def noise_of(text: str | None) -> dict[str, float] | None:
    """Read --noise: kind → σ."""
    if text is None:
        return None
    found = {}
    for part in text.split(","):
        kind, _, value = part.partition("=")
        if kind.strip() in found:
            raise pr.ParameterError(f"--noise {text!r} gives {kind.strip()} twice. Give it once.")
        try:
            found[kind.strip()] = float(value.removesuffix("%")) * (0.01 if value.endswith("%") else 1.0)
        except ValueError:
            raise pr.ParameterError(
                f"--noise {text!r} is not valid: write proportional=0.1%, s11=1e-4 or z=0.1, or proportional "
                f"and one other."
            ) from None
    return found


def tips_of(tips: list[str] | None) -> list[tuple[float, float]] | None:
    """Read the pairs of --tip."""
    if not tips:
        return None
    pairs = [common.grid("--tip", tip) for tip in tips]
    if any(len(pair) != 2 for pair in pairs):
        raise pr.ParameterError(f"--tip {tips[0]!r} is not valid; write X,Y as 0,1, once for each mode.")
    return [(pair[0], pair[1]) for pair in pairs]


def note(cautions: Iterable[str], targets: Targets) -> None:
    """Print the cautions of a fit to standard error, except with ``--json``."""
    for caution in () if targets.as_json else cautions:
        common.complain(f"note: {caution}", style=None)
