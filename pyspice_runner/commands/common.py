# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands share: their common options, and how they load, refuse, write and print."""

from __future__ import annotations

import csv
import glob
import io
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import floor, isfinite, log10
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

import pyspice_runner as pr

if TYPE_CHECKING:
    import xarray

Writing = tuple[Path | None, Callable[[Path], object]]  # a file that may be asked for, and what writes it

_ELSEWHERE = " Choose another place."  # the end of the sentence about a file that cannot be written

written: list[str] = []  # the files that this command has completed


def complete_motor(incomplete: str) -> list[str]:
    """Return the parameter sets and the motors' files here that begin so, for the shell."""
    begun = f"{glob.escape(incomplete)}*.toml"
    files = [str(path) for path in Path().glob(begun)] if not Path(incomplete).is_absolute() else []
    return [name for name in (*pr.available_motors(), *sorted(files)) if name.startswith(incomplete)]


MotorArgument = Annotated[
    str,
    typer.Argument(metavar="MOTOR", help="A parameter set, or the path of a TOML file.", autocompletion=complete_motor),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
OutputOption = Annotated[Path | None, typer.Option("--output", help="Write the result to a file, by its ending.")]
PlotOption = Annotated[Path | None, typer.Option("--plot", help="Draw the result: a .png, .svg or .pdf file.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Change a parameter, as contact.preload_n=8. Repeatable."),
]
MOST_VALUES = 1_000_000  # of an axis
CIRCUIT_ENDINGS = (".lib", ".asy", ".kicad_sym", ".s1p", ".toml")  # of what an equivalent circuit is exported to
TimeoutOption = Annotated[float | None, typer.Option(help="End ngspice after this many seconds.")]
AuditOption = Annotated[
    bool, typer.Option("--audit/--no-audit", help="Whether a result that fails the physical audit is an error.")
]


def load_changed(motor: str, changes: list[str] | None) -> pr.Motor:
    """Return the motor with the values of ``--set`` in place."""
    loaded = pr.load_motor(motor)
    if not changes:
        return loaded
    values: dict[str, Any] = {}
    for change in changes:
        path, equals, text = change.partition("=")
        if not equals:
            raise pr.ParameterError(f"--set {change!r} is not PATH=VALUE; write it as contact.preload_n=8.")
        try:
            values[path.strip()] = float(text)
        except ValueError:
            raise pr.ParameterError(f"--set {path}: {text!r} is not a number. Give one, in SI units.") from None
    return loaded.updated(values)


def grid(option: str, text: str) -> list[float]:
    """Read the values of an axis: ``2,5,9``, or ``20:80:7`` for seven from 20 to 80."""
    try:
        if ":" not in text:
            return [float(value) for value in text.split(",")]
        start, stop, count = text.split(":")
        if not 0 <= int(count) <= MOST_VALUES or not isfinite(float(stop) - float(start)):
            raise ValueError
        return [float(value) for value in np.linspace(float(start), float(stop), int(count))]
    except ValueError:
        raise pr.ParameterError(
            f"{option}: {text!r} is refused. Write values as 2,5,9, or as 20:80:7 for seven from 20 to 80."
        ) from None


def check_targets(output: Path | None, endings: tuple[str, ...], plot: Path | None) -> None:
    """Refuse a place that cannot be written before any work is done."""
    for path, allowed in ((output, endings), (plot, (".png", ".svg", ".pdf"))):
        if path is None:
            continue
        if path.suffix not in allowed:
            raise pr.ParameterError(f"Cannot tell a format from {path.name!r}; let it end in {', '.join(allowed)}.")
        try:
            what = None
            if path.is_dir() or not path.absolute().parent.is_dir():
                what = "it is a folder" if path.is_dir() else "it is in a folder that does not exist"
            elif not os.access(path if path.exists() else path.absolute().parent, os.W_OK):
                what = "permission denied"
        except (OSError, ValueError) as error:  # such as a name that is too long, or has a zero in it
            what = getattr(error, "strerror", None) or str(error)
        if what:
            raise pr.ParameterError(f"Cannot write {path}: {what}. Choose another place.")


def write_table(path: Path, document: Mapping[str, Any], rows: list[list[str]]) -> None:
    """Write a result as ``.json``, or its rows as ``.csv``."""
    pr.save_by_ending(
        path,
        {
            ".json": lambda file: file.write_text(_json(document), encoding="utf-8"),
            ".csv": lambda file: file.write_text(_csv(rows), encoding="utf-8"),
        },
    )


def write_dataset(path: Path, dataset: xarray.Dataset, document: Mapping[str, Any]) -> None:
    """Write a result as ``.nc`` or ``.csv``, or what is printed of it as ``.json``."""
    pr.save_by_ending(
        path,
        {
            ".nc": lambda file: pr.write_netcdf(file, dataset),
            ".csv": lambda file: dataset.to_dataframe().to_csv(file),
            ".json": lambda file: file.write_text(_json(document), encoding="utf-8"),
        },
    )


def _json(document: Mapping[str, Any]) -> str:
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _csv(rows: list[list[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def jsonable(values: Any) -> Any:
    """Return numbers, or lists of them, with ``None`` for what is not finite."""
    if isinstance(values, list):
        return [jsonable(value) for value in values]
    return values if np.isfinite(values) else None


def deliver(document: Mapping[str, Any], table: Table | str, as_json: bool, *writings: Writing) -> None:
    """Write a finished result to the files asked for and print it: the JSON object alone, or a table for the eye.

    Whatever fails on the way, or interrupts it, the rest is done; what finds no place is kept in a temporary folder.

    Raises:
        ParameterError: for what cannot be written; it says where it is kept.
    """
    faults: dict[Writing, Exception] = {}
    try:
        for path, write in writings:
            if path is not None:
                with _noted(path):
                    try:
                        write(path)
                    except Exception as error:  # noqa: BLE001  # whatever it is, the rest comes first
                        faults[path, write] = error
    finally:
        try:
            _print(document, table, as_json)
        except pr.ParameterError as error:
            faults[Path("result.json"), lambda path: write_table(path, document, [])] = error
    for fault in faults.values():
        if not isinstance(fault, pr.ParameterError):
            raise fault
    if faults:
        kept = keep([writing for writing, fault in faults.items() if isinstance(fault.__cause__, OSError)])
        said = " ".join(map(str, faults.values()))
        raise pr.ParameterError(f"{said.replace(_ELSEWHERE, '')} It is kept in {kept}." if kept else said)


@contextmanager
def _noted(path: Path) -> Iterator[None]:
    """Note among what is written a file that is another one afterwards, even if an interrupt came right behind it."""

    def stamp() -> tuple[int, int] | None:
        return (path.stat().st_ino, path.stat().st_mtime_ns) if path.is_file() else None

    before = stamp()
    try:
        yield
    finally:
        if stamp() != before:
            written.append(str(path))


def _print(document: Mapping[str, Any], table: Table | str, as_json: bool) -> None:
    """Print a result.

    Raises:
        ParameterError: if the standard output cannot be written.
    """
    try:
        say(json.dumps(document, allow_nan=False) + "\n" if as_json else table)
    except BrokenPipeError:  # the reader has gone, as with `| head`
        silence(sys.stdout)
    except OSError as error:
        silence(sys.stdout)
        raise pr.ParameterError(f"Cannot write the standard output: {error.strerror}.{_ELSEWHERE}") from error


def keep(homeless: Sequence[Writing]) -> Path | None:
    """Write what found no place to a temporary folder and return that, if there is room for all of it."""
    if not homeless:
        return None
    try:
        folder = Path(tempfile.mkdtemp(prefix="piezomotor-kept-"))
    except OSError:
        return None
    try:
        for path, write in homeless:
            write(folder / (path or Path()).name)
    except (OSError, pr.ParameterError):
        shutil.rmtree(folder, ignore_errors=True)
        return None
    return folder


def say(what: Table | str) -> None:
    """Print a table, or text as it is, to standard output."""
    if isinstance(what, Table):
        console = Console(markup=False, emoji=False)  # names of files may look like either
        with console.capture() as shown:  # printing it, rich would end the program where nobody reads
            console.print(what)
        what = shown.get()
    sys.stdout.write(what)
    sys.stdout.flush()


def complain(text: str, style: str | None = "red") -> None:
    """Print a sentence to standard error; that nobody may read it is no reason to end."""
    with suppress(OSError):
        _Complaints(stderr=True, soft_wrap=True, highlight=False, emoji=False).print(text, style=style, markup=False)


class _Complaints(Console):
    def on_broken_pipe(self) -> None:
        self.quiet = True


def silence(stream: Any) -> None:
    """Let what a stream still holds go nowhere, so that Python does not try it again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def leaves(document: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted path and value of every leaf."""
    items = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in items:
        path = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, dict | list):
            yield from leaves(value, path)
        else:
            yield path, value


def engineering(value: float, unit: str) -> str:
    """Write a value with four digits and the prefix of its unit."""
    exponent = 0 if value == 0.0 else min(max(floor(log10(abs(value)) / 3), -5), 3)
    return f"{value / 1000.0**exponent:.4g}\N{NO-BREAK SPACE}{'fpnµm kMG'[exponent + 5].strip()}{unit}"


def warn_of(findings: Iterable[str]) -> None:
    """Say on stderr what the audit found in a result that is given all the same."""
    for finding in findings:
        complain(f"piezomotor: not to be trusted: {finding}")


@contextmanager
def busy(what: str) -> Iterator[None]:
    """Show on a terminal that something runs, and for how long."""
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description} …"), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        bar.add_task(what, total=None)
        yield


@contextmanager
def run_progress(what: str) -> Iterator[Callable[[float, float], None]]:
    """Show on a terminal how far a run is, and how many seconds are left."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[left]}"))
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(what, total=1.0, left="")
        yield lambda done, left: bar.update(task, completed=done, left=f"{left:.0f} s left")


@contextmanager
def points_progress() -> Iterator[Callable[[int, int], None]]:
    """Show on a terminal how many points are finished, and how long the others will take."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(
        *columns, TextColumn("left"), TimeRemainingColumn(),
        console=console, disable=not console.is_terminal, speed_estimate_period=600.0,
    ) as bar:  # fmt: skip
        task = bar.add_task("points", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
