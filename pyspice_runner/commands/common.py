# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands share: common options, and functions that load, check, write and print."""

from __future__ import annotations

import glob
import json
import os
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import inf, isfinite
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import typer
from rich import progress
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.errors import Interrupted
from pyspice_runner.files import save_by_ending, write_json, write_rows
from pyspice_runner.interrupts import held
from pyspice_runner.motor.load import changed_motor
from pyspice_runner.result import Result as _Result
from pyspice_runner.spice.ngspice import ngspice_version

T = TypeVar("T")
Writing = tuple[Path | None, Callable[[Path], object]]  # a file that may be asked for, and what writes it

_LONG = 15.0  # s of wall time after which a run without a terminal says what is left
_WIDEST = 1000  # characters of a line of a table in a file or pipe

_ELSEWHERE = " Choose another place."  # the end of the sentence about a file that cannot be written

_SCALES = {"p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "meg": 1e6, "G": 1e9, "": 1.0}
_UNITS = {  # as it is typed → as the help of an option names it
    "Hz": "Hz", "s": "s", "V": "V", "N.m": "N.m", "Nm": "N.m", "N·m": "N.m", "N": "N", "rad/s": "rad/s", "m/s": "m/s",
    "deg": "degrees", "°": "degrees", "ohm": "Ω", "Ω": "Ω", "A": "A", "m": "m",
}  # fmt: skip
_NUMBER = re.compile(
    rf"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)([mM][eE][gG]|[pnuµμmkG]?)({'|'.join(map(re.escape, _UNITS))})?"
)

DURATION = 5e-3  # s, of a run by default

INTERRUPTED = 130  # the status of a command that delivers what it has done; another signal than SIGINT changes it

written: list[str] = []  # the files that this command has completed


def say_versions(wanted: bool) -> None:
    """Write the versions of the package and of ngspice, and exit."""
    if wanted:
        sys.stdout.write(f"piezomotor {pr.__version__}, ngspice {ngspice_version()}\n")
        raise typer.Exit


def complete_motor(incomplete: str) -> list[str]:
    """Return the parameter sets and TOML files in this folder that start with a text, for completion."""
    begun = f"{glob.escape(incomplete)}*.toml"
    files = [str(path) for path in Path().glob(begun)] if not Path(incomplete).is_absolute() else []
    return [name for name in (*pr.available_motors(), *sorted(files)) if name.startswith(incomplete)]


SHORTCUTS = {"preload": "contact.preload_n", "friction": "contact.friction"}  # options of one parameter
MOST_VALUES = 1_000_000  # of an axis
_OPTIONS = {  # path of an axis → options that state its value, where they have another name than the path ends in
    "drive.phase_deg": ("phase",), "load.torque": ("load_torque",),
}  # fmt: skip


class OnceCommand(typer.core.TyperCommand):
    """A command whose options are given once, except those that are repeatable; typer would take the last value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line. Raise ParameterError for a repeated option."""
        given = list(args)
        rest = super().parse_args(ctx, args)
        if not ctx.resilient_parsing:  # which completes words by Tab
            order = self.make_parser(ctx).parse_args(args=given)[2]
            for option in order:
                if not getattr(option, "multiple", False) and order.count(option) > 1:
                    raise pr.ParameterError(f"{option.opts[0]} is given twice. Give it once.")
        return rest


def stated_options(context: typer.Context, *names: str) -> Iterator[str]:
    """Yield those of the options that are on the command line, as they are written there."""
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name) if parameter.name in names else None
        if source is not None and source.name == "COMMANDLINE":
            yield parameter.opts[0]


def refuse_covered(context: typer.Context, axes: Iterable[str]) -> None:
    """Raise ParameterError for an option, or a path of ``--set`` or ``--part``, whose value an axis replaces."""
    from pyspice_runner.run.paths import LOADS, canonical  # netlists, which commands without a run do not load

    changes = {path: f"--{name}" for name, path in SHORTCUTS.items() if context.params.get(name) is not None}
    changes |= {
        f"{prefix}{change.partition('=')[0].strip()}": option
        for option, name, prefix in (("--set", "changes", ""), ("--part", "part", "drive."))
        for change in context.params.get(name) or ()
    }
    for name in map(canonical, axes):
        section, _, key = name.partition(".")
        names = _OPTIONS.get(name, (key,)) if section in ("drive", "run") or name in LOADS else ()
        for option in [*stated_options(context, *names), *([changes[name]] if name in changes else [])]:
            raise pr.ParameterError(f"{name} is given twice, by {option} and as an axis. Give it once.")


def load_changed(motor: str, changes: list[str] | None) -> pr.Motor:
    """Return the motor with the values of ``--set`` in place."""
    hint = "is not PATH=VALUE; write it as contact.preload_n=8."
    values = {path: _value(text.strip()) for path, text in pairs_of("--set", changes, hint)}
    with busy("reading the motor"):  # the modes of a solid can take a minute
        return changed_motor(motor, values)


def _value(text: str) -> float | int | str | None:
    """Return a number, what the words ``none``, ``true`` and ``false`` mean, or the text."""
    words = {"none": None, "true": True, "false": False}
    if text in words:
        return words[text]
    with suppress(ValueError):
        return int(text)
    with suppress(pr.ParameterError):
        return number(text)
    return text


def number(text: str, units: str = "") -> float:
    """Return the number that a text states, with an SI prefix (p, n, u, m, k, meg, G) and a unit if it has them.

    Args:
        text: such as ``40.7k``, ``2ms`` or ``1e-3``.
        units: a text that has the allowed units behind a comma or a colon, as the help of an option: "Speed, rad/s
            (slider: m/s)". Without them a unit is refused.

    Raises:
        ParameterError: for another text, or for another unit.
    """
    try:
        return float(text)
    except ValueError:
        match = _NUMBER.fullmatch(text.strip().replace(" ", ""))
    if match is None:
        raise pr.ParameterError(
            f"{text!r} is not a number. Write it as 2e-3 or 2m; p, n, u, m, k, meg and G are 1e-12 to 1e9."
        )
    value, prefix, unit = match.groups()
    named = _UNITS.get(unit or "")
    if named is not None and not re.search(rf"[,:] {re.escape(named)}(?![\w/])", units):
        fault = "which this value does not have" if units else "which is not read here"
        raise pr.ParameterError(f"{text!r} has the unit {unit}, {fault}. Leave it out.")
    return float(value) * _SCALES[prefix.lower() if len(prefix) > 1 else prefix]


def grid(option: str, text: str) -> list[float]:
    """Read the values of an axis: ``2,5,9``, or ``20:80:7`` for seven from 20 to 80."""
    try:
        if ":" not in text:
            return [number(value) for value in text.split(",")]
        start, stop, count = text.split(":")
        first, last = number(start), number(stop)
        if not 1 <= int(count) <= MOST_VALUES or not isfinite(last - first):
            raise ValueError
        return [float(value) for value in np.linspace(first, last, int(count))]
    except ValueError:
        raise pr.ParameterError(
            f"{option}: {text!r} is not valid. Write values as 2,5,9, or as 20:80:7 for seven from 20 to 80."
        ) from None


def grid_or_none(option: str, text: str | None) -> list[float] | None:
    """Read the values of an axis as :func:`grid`; ``None`` for an option that was not given."""
    return None if text is None else grid(option, text)


def axes_of(texts: list[str] | None) -> dict[str, list[float]]:
    """Return the values of the axes of ``--over PATH=VALUES``. Raise ParameterError for an axis without values."""
    return {path: grid(f"--over {path}", values) for path, values in pairs_of("--over", texts)}


def pairs_of(
    option: str, texts: list[str] | None, hint: str = "has no values; write PATH=VALUES."
) -> Iterator[tuple[str, str]]:
    """Yield path and value of the texts of an option.

    Raise ParameterError, whose message ends in ``hint``, for a text without "=", and for a path that is given twice.
    """
    paths: set[str] = set()
    for text in texts or ():
        path, equals, value = text.partition("=")
        path = path.strip()
        if not equals:
            raise pr.ParameterError(f"{option} {text!r} {hint}")
        if path in paths:
            raise pr.ParameterError(f"{option} {path} is given twice. Give it once.")
        paths.add(path)
        yield path, value


def limits_of(texts: list[str] | None, *, bare: bool = False) -> dict[str, tuple[float, float]]:
    """Return the limits that are written as NAME=LOW:HIGH, one end may be left out, or if ``bare`` as NAME=HIGH."""
    found = {}
    for name, text in pairs_of("--limit", texts):
        low, colon, high = text.rpartition(":")
        try:
            if not (low or high) or not (colon or bare):
                raise pr.ParameterError("")
            ends = number(low) if low else -inf, number(high) if high else inf
        except pr.ParameterError:
            raise pr.ParameterError(f"--limit {name}: {text!r} is not LOW:HIGH. Write 135:165, 3m: or :0.1.") from None
        if not ends[0] <= ends[1]:
            raise pr.ParameterError(
                f"--limit {name}={text} is not valid: LOW must be at most HIGH. Write {name}=LOW:HIGH, as 135:165."
            )
        found[name] = ends
    return found


def percentage(option: str, path: str, text: str) -> float:
    """Return the share that a text as ``10%`` or ``±10%`` states. Raise ParameterError for another text."""
    try:
        number, percent, rest = text.strip().removeprefix("±").partition("%")
        if not percent or rest:
            raise ValueError
        return float(number) / 100.0
    except ValueError:
        raise pr.ParameterError(f"{option} {path}: {text!r} is not a percentage. Write {path}=10%.") from None


def check_targets(
    output: Path | None, endings: tuple[str, ...], plot: Path | None, inputs: Iterable[str | Path | None] = ()
) -> None:
    """Check the files to write before any work is done; input names that are not those of files are ignored.

    Raise ParameterError for a file of another ending, a place that cannot be written, or a file that is an input too.
    """
    for path, allowed in ((output, endings), (plot, (".png", ".svg", ".pdf"))):
        if path is None:
            continue
        if path.suffix not in allowed:
            raise pr.ParameterError(
                f"No format follows from the name {path.name or str(path)!r}: let it end in {', '.join(allowed)}."
            )
        what = _obstacle(path)
        if what:
            raise pr.ParameterError(f"Cannot write {path}: {what}. Choose another place.")
        if any(_is_same_file(path, source) for source in inputs if source is not None):
            raise pr.ParameterError(f"{path} is an input file, and writing would replace it. Choose another file.")


def _obstacle(path: Path) -> str | None:
    """Return why a file cannot be written; ``None`` if nothing is known to prevent it."""
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()  # from Python 3.14 on is_dir and exists hide the error of a name that is too long
        if path.is_dir():
            return "it is a folder"
        target = path if path.exists() else path.resolve()  # a link may lead to a file that is still to be written
        if not target.absolute().parent.is_dir():
            return "it is in a folder that does not exist"
        if not os.access(target if path.exists() else target.parent, os.W_OK):
            return "permission denied"
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a name that is too long or has a null
        return getattr(error, "strerror", None) or str(error)
    return None


def _is_same_file(path: Path, source: str | Path) -> bool:
    """Tell whether two names are those of one regular file, also through a link."""
    try:
        return path.is_file() and path.samefile(source)
    except (OSError, ValueError):  # the source is not a file
        return False


def write_table(path: Path, document: Mapping[str, Any], rows: list[list[str]]) -> None:
    """Write a result as ``.json``, or its rows as ``.csv``."""
    save_by_ending(
        path, {".json": lambda file: write_json(file, document), ".csv": lambda file: write_rows(file, rows)}
    )


def deliver(document: Mapping[str, Any], table: Table | str, as_json: bool, *writings: Writing) -> None:
    """Write a finished result to the files asked for and print it: the JSON object alone, or a table for reading.

    If one part fails or is interrupted, the other parts are still done. What cannot be written is kept in a temporary
    folder, which the ParameterError names.
    """
    faults: dict[Writing, Exception] = {}
    try:
        for path, write in writings:
            if path is not None:
                with _noted(path):
                    try:
                        write(path)
                        if path.suffix == ".cir":
                            complain(f"piezomotor: Run it with: ngspice -b -r out.raw {shlex.quote(str(path))}", "dim")
                    except Exception as error:  # noqa: BLE001  # of any kind; the other parts come first
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

    with held() as listening:  # the name is noted also if a second signal comes
        before = stamp()
        try:
            with listening():
                yield
        finally:
            if stamp() != before:
                written.append(str(path))


def _print(document: Mapping[str, Any], table: Table | str, as_json: bool) -> None:
    """Print a result. Raise ParameterError if the standard output cannot be written."""
    try:
        say(json.dumps(document, allow_nan=False) + "\n" if as_json else table)
    except BrokenPipeError:  # the reader of the pipe has ended, as with `| head`
        silence()
    except OSError as error:
        silence()
        raise pr.ParameterError(f"Cannot write the standard output: {error.strerror}.{_ELSEWHERE}") from error


def keep(homeless: Sequence[Writing]) -> Path | None:
    """Write what could not be written to a temporary folder; return the folder, or ``None`` if that fails too."""
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


def summary_table(summary: Mapping[str, str], title: str) -> Table:
    """Return the summary of a result as a table."""
    table = Table("quantity", "value", title=title)
    for name, value in summary.items():
        table.add_row(name, value.replace("\N{NO-BREAK SPACE}", " "))  # terminals search for plain spaces
    return table


def say(what: Table | str) -> None:
    """Print a table or text to standard output. A table loses nothing, however narrow the terminal is."""
    if isinstance(what, Table):
        for column in what.columns:
            column.overflow = "fold"
        console = Console(markup=False, emoji=False)  # file names may contain either
        if not console.is_terminal:  # as wide as the terminal behind the pipe, or 80; wider where words would break
            words = Measurement.get(console, console.options.update(max_width=_WIDEST), what).minimum
            console.width = max(console.width, words)
        with console.capture() as shown:  # rich's own print would end the program at a closed pipe
            console.print(what)
        what = "".join(f"{line.rstrip()}\n" for line in shown.get().splitlines())
    sys.stdout.write(what)
    sys.stdout.flush()


def complain(text: str, style: str | None = "red") -> None:
    """Print a message to standard error; a closed standard error is not an error."""
    with suppress(OSError):
        console = Console(stderr=True, highlight=False, emoji=False)
        with console.capture() as shown:  # as in say
            console.print(text, style=style, markup=False, soft_wrap=not console.is_terminal)
        console.file.write(shown.get())


def silence() -> None:
    """Discard what standard output still holds, so that Python does not try to write it again at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def caution(result: _Result) -> None:
    """Print on stderr what the audit found in a result that is returned nevertheless, and what else to know of it."""
    for finding in result.audit.findings:
        complain(f"piezomotor: the result failed the audit: {finding}")
    for sentence in result.cautions:
        if sentence not in result.audit.findings:
            complain(f"piezomotor: {sentence}", style="yellow")


def finished(run: Callable[[], T]) -> tuple[T, int]:
    """Return the result of a run and the exit status; after an interrupt or a failure what is finished, if any."""
    try:
        return run(), 0
    except (Interrupted, pr.SimulationError) as fault:
        if fault.partial is None:
            raise
        complain(f"piezomotor: {fault}")
        return fault.partial, INTERRUPTED if isinstance(fault, Interrupted) else 3


@contextmanager
def _bar(what: str, *columns: Any, total: float | None = None, **look: Any) -> Iterator[Callable[..., None]]:
    """Show on a terminal that a task runs; the yielded function updates what the columns show."""
    console = Console(stderr=True)
    parts = (progress.TextColumn("{task.description}"), *columns)
    with progress.Progress(*parts, console=console, disable=not console.is_terminal, **look) as bar:
        task = bar.add_task(what, total=total, left="")
        yield lambda **shown: bar.update(task, **shown)


@contextmanager
def busy(what: str, part: str = "") -> Iterator[Callable[..., None]]:
    """Show that a task runs, and for how long; the yielded function fills ``part``, as "{} of {}"."""
    with _bar(what, progress.SpinnerColumn(), progress.TimeElapsedColumn(), transient=True) as update:
        yield lambda *numbers: update(description=f"{what}, {part.format(*numbers)}")


@contextmanager
def run_progress(what: str) -> Iterator[Callable[[float, float], None]]:
    """Show the progress of a run and the remaining time; without a terminal the latter once, of a long run."""
    columns = progress.BarColumn(), progress.TaskProgressColumn(), progress.TextColumn("{task.fields[left]}")
    quiet = not Console(stderr=True).is_terminal
    with _bar(what, *columns, total=1.0, transient=True) as update:

        def show(done: float, left: float) -> None:
            nonlocal quiet
            update(completed=done, left=f"{left:.0f} s left")
            if quiet and done * left > _LONG * (1.0 - done):
                quiet = False
                complain(f"piezomotor: {what}: about {left:.0f} s left.", style=None)

        yield show


@contextmanager
def points_progress() -> Iterator[Callable[[int, int], None]]:
    """Show the number of finished points and the remaining time."""
    done = progress.BarColumn(), progress.MofNCompleteColumn(), progress.TimeElapsedColumn()
    left = progress.TextColumn("left"), progress.TimeRemainingColumn()
    with _bar("points", *done, *left, speed_estimate_period=600.0) as update:
        yield lambda done, total: update(completed=done, total=total)
