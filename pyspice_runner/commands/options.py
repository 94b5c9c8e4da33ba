# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of options that commands share, each declared once.

A group is a dataclass whose fields are options. :func:`with_options` replaces a parameter of a command that has the
type of a group by the options of the group.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.circuit.law import LAWS, PAPER_LAW
from pyspice_runner.commands import common
from pyspice_runner.result import Result

Returned = TypeVar("Returned")
_Write = Callable[[Path], object]

SpeedOption = Annotated[float | None, typer.Option(help="Speed of the held shaft, rad/s (slider: m/s); default: free.")]
LoadOption = Annotated[float, typer.Option(help="Torque that a load draws from the free shaft, N.m (slider: N).")]
StepOption = Annotated[float | None, typer.Option(help="Longest time step, s; default: from the fastest motion.")]

NONE = "none"


def _complete_law(incomplete: str) -> list[str]:
    return [name for name in (*LAWS, NONE) if name.startswith(incomplete)]


ContactOption = Annotated[
    str,
    typer.Option(
        "--contact",
        metavar="LAW",
        help=f"Contact law: {', '.join(LAWS)}, the path of a .lib file, or none for a free tip.",
        autocompletion=_complete_law,
    ),
]
SlidersOption = Annotated[int | None, typer.Option(help="Number of sliders of the brush; default: 8.")]


def law_named(contact: str, sliders: int | None = None) -> pr.Law | None:
    """Return the law; ``None`` for a free tip. Raise ParameterError for an unknown law, or sliders of another law."""
    if contact == NONE and sliders is not None:
        raise pr.ParameterError("--sliders has no effect on a free tip. Leave it out.")
    if contact == NONE:
        return None
    return pr.Law(contact) if sliders is None else pr.Law(contact, sliders)


class Options:
    """A group of options."""

    @property
    def settings(self) -> dict[str, Any]:
        """The options as arguments of an analysis, by default under their names."""
        return dict(vars(self))


def with_options(command: Callable[..., Returned]) -> Callable[..., Returned]:
    """Replace the parameters of a command that are groups by the options of the groups.

    typer reads options from the signature of the command and has no groups of options.
    """
    signature = inspect.signature(command, eval_str=True)
    parameters: list[inspect.Parameter] = []
    groups: dict[str, tuple[type[Options], list[str]]] = {}
    for parameter in signature.parameters.values():
        kind = parameter.annotation
        if not (isinstance(kind, type) and issubclass(kind, Options)):
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
            continue
        hints = get_type_hints(kind, include_extras=True)
        options = inspect.signature(kind).parameters
        groups[parameter.name] = kind, list(options)
        parameters += (
            option.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY)
            for name, option in options.items()
        )

    @wraps(command)
    def whole(**values: Any) -> Returned:
        for group, (kind, names) in groups.items():
            values[group] = kind(**{name: values.pop(name) for name in names})
        return command(**values)

    vars(whole)["__signature__"] = signature.replace(parameters=parameters)
    return whole


@dataclass(frozen=True)
class LawOptions(Options):
    """The law of the contact."""

    contact: ContactOption = PAPER_LAW.name
    sliders: SlidersOption = None

    @property
    def law(self) -> pr.Law | None:
        """The law; ``None`` for a free tip."""
        return law_named(self.contact, self.sliders)


@dataclass(frozen=True)
class RunOptions(LawOptions):
    """How a motor is run: its changes, the law of its contact, and the time that ngspice may take."""

    timeout: common.TimeoutOption = None
    changes: common.SetOption = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of an analysis; the changes are those of its motor."""
        return {"contact": self.law, "timeout": self.timeout}


@dataclass(frozen=True)
class PeriodOptions(LawOptions):
    """How periods of a steady state are run."""

    step: StepOption = None
    timeout: common.TimeoutOption = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of an analysis."""
        return {"contact": self.law, "step": self.step, "timeout": self.timeout}


@dataclass(frozen=True)
class AuditOptions(Options):
    """The audit of the result."""

    audit: common.AuditOption = True

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of an analysis."""
        return {"audit": self.audit}


@dataclass(frozen=True)
class Targets(Options):
    """Where the result goes."""

    as_json: common.JsonOption = False
    output: common.OutputOption = None
    plot: common.PlotOption = None

    def check(self, *endings: str, inputs: Iterable[str | Path | None] = ()) -> None:
        """Check the files to write before any work is done; see :func:`.common.check_targets`."""
        common.check_targets(self.output, endings, self.plot, inputs)

    def deliver(self, result: Result, title: str, document: dict[str, Any] | None = None) -> None:
        """Write a result to its files and print its summary under a title, or with ``--json`` a document."""
        document = result.to_dict() if document is None else document
        self.write(document, common.summary_table(result.summary(), title), result.save, result.plot)

    def write(
        self, document: Mapping[str, Any], table: Table | str, save: _Write, draw: _Write = lambda _: None
    ) -> None:
        """Write the files by two functions and print a table, or with ``--json`` a document."""
        common.deliver(document, table, self.as_json, (self.output, save), (self.plot, draw))
