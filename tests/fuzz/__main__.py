# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer as a command: ``python -m tests.fuzz --count 10000 --door motor --seed 0``."""

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

from tests.fuzz.doors import DOORS, Door, attempt, warm


def drawn(door: Door, seed: int, number: int) -> Any:
    """The input of a door by its number."""
    return door.draw(random.Random(f"{door.name} {seed} {number}"))


def fault(door: Door, content: Any, folder: Path) -> tuple[bool, str | None]:
    """Return whether the door took an input, and what is wrong with how it was dealt with."""
    here = Path.cwd()
    before = set(folder.parent.iterdir())
    try:
        with contextlib.chdir(folder):
            taken = attempt(door, content, folder)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - whatever it is, it must not come out
        return False, "".join(traceback.format_exception(error, limit=-12))
    finally:
        os.chdir(here)
    stray = [path.name for path in folder.parent.iterdir() if path not in before]
    return taken, f"files beside the folder: {stray}" if stray else None


def keep(into: Path, door: Door, seed: int, number: int, content: Any, words: str) -> Path:
    """Write a failing input to a file, and beside it what came of it."""
    into.mkdir(exist_ok=True)
    path = into / f"{door.name}-{seed}-{number}"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        sys.set_int_max_str_digits(0)  # an input may hold a number that Python does not write otherwise
        path.write_text(repr(content), encoding="utf-8", errors="backslashreplace")
        sys.set_int_max_str_digits(sys.int_info.default_max_str_digits)
    path.with_name(f"{path.name}.txt").write_text(words, encoding="utf-8", errors="backslashreplace")
    return path


def main(
    count: Annotated[int, typer.Option(help="Inputs per door; of a slow one a tenth.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Seed; the same gives the same inputs.")] = 0,
    door: Annotated[list[str] | None, typer.Option(help=f"Of {', '.join(DOORS)}; default: all. Repeatable.")] = None,
    first: Annotated[int, typer.Option(help="Number of the first input, to begin at a failing one.")] = 0,
    failures: Annotated[Path, typer.Option(help="Folder for inputs that fail.")] = Path("fuzz-failures"),
) -> None:
    """Give every door of the package inputs gone wrong. Exit status 1 if one is neither taken nor clearly refused."""
    if unknown := set(door or ()) - set(DOORS):
        raise typer.BadParameter(f"there is no door {', '.join(sorted(unknown))}; there are {', '.join(DOORS)}")
    warm()
    console = Console(stderr=True)
    table = Table(
        "door", "inputs", "taken", "refused", "failed", "slowest / s", "seconds", box=None, padding=(0, 2, 0, 0)
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
        for name in door or DOORS:
            total = max(1, round(count * DOORS[name].share))
            task, came, slowest, began = bar.add_task(name, total=total), Counter[str](), 0.0, perf_counter()
            root = Path(tempfile.mkdtemp(prefix="fuzz-"))
            os.environ["XDG_CACHE_HOME"] = os.environ["TMPDIR"] = str(root / "out")
            tempfile.tempdir = None
            for number in range(first, first + total):
                folder = root / "out"
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                content = drawn(DOORS[name], seed, number)
                start = perf_counter()
                taken, words = fault(DOORS[name], content, folder)
                slowest = max(slowest, perf_counter() - start)
                came["failed" if words else "taken" if taken else "refused"] += 1
                if words:
                    path = keep(failures, DOORS[name], seed, number, content, words)
                    console.print(
                        f"{path}: {words.strip().splitlines()[-1][:300]}", markup=False, highlight=False, soft_wrap=True
                    )
                bar.advance(task)
            shutil.rmtree(root, ignore_errors=True)
            failed += came["failed"]
            shown = (came["taken"], came["refused"], came["failed"])
            if not console.is_terminal:
                console.print(f"{name}: {total} inputs, {came['failed']} failed, {perf_counter() - began:.0f} s")
            table.add_row(name, str(total), *map(str, shown), f"{slowest:.2f}", f"{perf_counter() - began:.0f}")
    Console().print(table)
    raise typer.Exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)
