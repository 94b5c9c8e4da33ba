# SPDX-License-Identifier: GPL-3.0-or-later
"""How the commands read and fit measured spectra by their options."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, Literal

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import Call
from pyspice_runner.result import Result

Reader = Callable[[str | Path], pr.Spectrum]

INPUT = "connection trace columns through start stop"  # what to read of a file
FIT = "modes noise timeout"


def read(call: Call, path: Path) -> pr.Spectrum:
    """Read a spectrum within the band of a call."""
    spectrum = reader(call.columns, call.through, call.trace)(path)
    return spectrum.between(call.start, inf if call.stop is None else call.stop)


def read_one_port(call: Call, path: Path) -> pr.Spectrum:
    """Read the spectrum of a one-port, which takes no connection, or of a two-port through the connection."""
    spectrum = read(call, path)
    if spectrum.ports == 2:
        return spectrum.driven(call.connection)
    call.refuse_idle(f"on {spectrum.source or 'a spectrum'}, which has one port", "connection")
    return spectrum


def reader(columns: str | None, through: Literal["series", "shunt"] | None, trace: str | None = None) -> Reader:
    """Return the function that reads a spectrum with the options of a command."""
    names = [name.strip() for name in columns.split(",")] if columns is not None else None
    return partial(pr.read_spectrum, trace=trace, columns=names, through=through)


_PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3}
_LEAD = re.compile(r"((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?) ?([pnuµmk]?)(H|ohm|Ω)")


def leads(call: Call) -> bool | tuple[float, float]:
    """Return the argument ``leads`` of a fit.

    It is True to look for them, False for none, or resistance in Ω and inductance in H. Raise ParameterError for
    --leads beside --no-leads, or another text.
    """
    if call.no_leads:
        call.refuse_idle("beside --no-leads", "leads")
        return False
    if call.leads in ("auto", "none"):
        return bool(call.leads == "auto")
    found = {"H": 0.0, "ohm": 0.0}
    for part in call.leads.split(","):
        match = _LEAD.fullmatch(part.strip())
        if match is None:
            raise pr.ParameterError(f"--leads {call.leads!r} is not valid: write auto, none, or values as 20nH,0.1ohm.")
        found["H" if match[3] == "H" else "ohm"] = float(match[1]) * _PREFIXES[match[2]]
    return found["ohm"], found["H"]


def fit_settings(call: Call) -> dict[str, Any]:
    """Return the arguments of a fit; of --noise, kind → σ."""
    noise = None
    if call.noise is not None:
        noise, form = {}, "is not valid: write proportional=0.1%, s11=1e-4 or z=0.1, or proportional and one other."
        for kind, value in common.pairs_of("--noise", call.noise.split(","), form):
            try:
                noise[kind] = float(value.removesuffix("%")) * (0.01 if value.endswith("%") else 1.0)
            except ValueError:
                raise pr.ParameterError(f"--noise {call.noise!r} {form}") from None
    return {"noise": noise, **call.pick("modes timeout")}


def tips_of(tips: list[str] | None) -> list[tuple[float, float]] | None:
    """Read the pairs of --tip."""
    if not tips:
        return None
    pairs = [common.grid("--tip", tip) for tip in tips]
    if any(len(pair) != 2 for pair in pairs):
        raise pr.ParameterError(f"--tip {tips[0]!r} is not valid; write X,Y as 0,1, once for each mode.")
    return [(pair[0], pair[1]) for pair in pairs]


def deliver(call: Call, result: Result, title: str) -> None:
    """Write a fit to its files, print its summary, or with ``--json`` the whole, and note its cautions."""
    call.write(result.to_dict(), common.summary_table(result.summary(), title), result.save, result.plot)
    note(result.cautions, call)


def note(cautions: Iterable[str], call: Call) -> None:
    """Print the cautions of a fit to standard error, except with ``--json``."""
    for caution in () if call.as_json else cautions:
        common.complain(f"note: {caution}", style=None)
