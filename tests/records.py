# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON record of a study. Each case is written at once, so that an interrupted study can be resumed."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

Record = list[dict[str, Any]]


def read(path: Path) -> Record:
    """Return the cases of a record; none if there is no file."""
    found: Record = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    return found


def write(path: Path, record: Record) -> None:
    """Write a record, a case in a line."""
    lines = ",\n".join(json.dumps(one, separators=(",", ":"), ensure_ascii=False) for one in record)
    path.write_text(f"[{lines}]\n", encoding="utf-8")


def extended(
    path: Path, description: str | None, count: int, cases: Callable[[Record], Iterable[dict[str, Any] | None]],
    counted: Callable[[Record], int] = len,
) -> Record:  # fmt: skip
    """Return a record with further cases, until ``--count`` of them count or ``--seconds`` are over.

    Args:
        path: file of the record.
        description: of the command.
        count: default of ``--count``.
        cases: returns the cases that follow those of a record, ``None`` for one without an outcome.
        counted: number of cases of a record that count.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seconds", type=float, default=1e9)
    chosen = parser.parse_args()
    record, begun = read(path), time.monotonic()
    following = iter(cases(record))
    while counted(record) < chosen.count and time.monotonic() - begun < chosen.seconds:
        try:
            found = next(following)
        except StopIteration:
            break
        if found is not None:
            record.append(found)
            write(path, record)
    return record
