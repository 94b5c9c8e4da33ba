# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer as a command: ``python -m validation.fuzz --count 10000 --entry-point motor --seed 0``."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import sys
import tempfile
import traceback
from collections import Counter
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from validation.fuzz.entry_points import ENTRY_POINTS, EntryPoint, attempt, warm


def drawn(entry_point: EntryPoint, seed: int, number: int) -> Any:
    """Return the input of an entry point that has this number."""
    return entry_point.draw(random.Random(f"{entry_point.name} {seed} {number}"))


def fault(entry_point: EntryPoint, content: Any, folder: Path) -> tuple[bool, str | None]:
    """Return whether the entry point accepted an input, and what it did wrong, if anything."""
    here = Path.cwd()
    before = set(folder.parent.iterdir())
    try:
        with contextlib.chdir(folder):
            taken = attempt(entry_point, content, folder)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - no exception may escape
        return False, "".join(traceback.format_exception(error, limit=-12))
    finally:
        os.chdir(here)
    stray = [path.name for path in folder.parent.iterdir() if path not in before]
    return taken, f"files beside the folder: {stray}" if stray else None


def keep(into: Path, entry_point: EntryPoint, seed: int, number: int, content: Any, words: str) -> Path:
    """Write an input that failed to a file, and the failure to another beside it."""
    into.mkdir(exist_ok=True)
    path = into / f"{entry_point.name}-{seed}-{number}"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        sys.set_int_max_str_digits(0)  # repr() of a very long number needs it
        path.write_text(repr(content), encoding="utf-8", errors="backslashreplace")
        sys.set_int_max_str_digits(sys.int_info.default_max_str_digits)
    path.with_name(f"{path.name}.txt").write_text(words, encoding="utf-8", errors="backslashreplace")
    return path


def main(
    count: Annotated[int, typer.Option(help="Inputs for each entry point; a slow one gets a tenth.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers; the same seed gives the same inputs.")] = 0,
    entry_point: Annotated[
        list[str] | None, typer.Option(help=f"One of {', '.join(ENTRY_POINTS)}; default: all. Repeatable.")
    ] = None,
    first: Annotated[int, typer.Option(help="Number of the first input, to repeat one that failed.")] = 0,
    failures: Annotated[Path, typer.Option(help="Folder for the inputs that fail.")] = Path("fuzz-failures"),
) -> None:
    """Give every entry point invalid inputs. Exit status 1 if one is neither accepted nor clearly rejected."""
    if unknown := set(entry_point or ()) - set(ENTRY_POINTS):
        raise typer.BadParameter(f"no entry point {', '.join(sorted(unknown))}; there are {', '.join(ENTRY_POINTS)}")
    warm()
    console = Console(stderr=True)
    table = Table(
        "entry point",
        "inputs",
        "accepted",
        "rejected",
        "failed",
        "slowest / s",
        "seconds",
        box=None,
        padding=(0, 2, 0, 0),
    )
    failed = 0
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        place = tempfile.gettempdir()  # an input may change the folder
        for name in entry_point or ENTRY_POINTS:
            total = max(1, round(count * ENTRY_POINTS[name].share))
            task, came, slowest, began = bar.add_task(name, total=total), Counter[str](), 0.0, perf_counter()
            root = Path(tempfile.mkdtemp(prefix="fuzz-", dir=place))
            os.environ["XDG_CACHE_HOME"] = os.environ["TMPDIR"] = str(root / "out")
            tempfile.tempdir = None
            for number in range(first, first + total):
                folder = root / "out"
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                content = drawn(ENTRY_POINTS[name], seed, number)
                start = perf_counter()
                taken, words = fault(ENTRY_POINTS[name], content, folder)
                slowest = max(slowest, perf_counter() - start)
                came["failed" if words else "accepted" if taken else "rejected"] += 1
                if words:
                    path = keep(failures, ENTRY_POINTS[name], seed, number, content, words)
                    console.print(
                        f"{path}: {words.strip().splitlines()[-1][:300]}", markup=False, highlight=False, soft_wrap=True
                    )
                bar.advance(task)
            shutil.rmtree(root, ignore_errors=True)
            failed += came["failed"]
            shown = (came["accepted"], came["rejected"], came["failed"])
            if not console.is_terminal:
                console.print(f"{name}: {total} inputs, {came['failed']} failed, {perf_counter() - began:.0f} s")
            table.add_row(name, str(total), *map(str, shown), f"{slowest:.2f}", f"{perf_counter() - began:.0f}")
    Console().print(table)
    raise typer.Exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)
