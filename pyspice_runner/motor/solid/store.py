# SPDX-License-Identifier: GPL-3.0-or-later
"""Where computed stators are kept: those of the bundled sets in the package, others in the user's cache.

A bundled stator is found by the content of its ``[solid]`` alone, so that the set needs no finite elements; a test
computes it anew. The user's cache also asks for the same program.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import fields
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.files import cache_folder, save_by_ending
from pyspice_runner.motor.solid.parameters import Solid
from pyspice_runner.motor.solid.stator import Stator, solve_stator

BUNDLED = Path(__file__).parents[1] / "sets" / "stators"
_DRAWN = ("nodes_m", "shapes")  # in single precision


@cache
def stator_of(solid: Solid) -> Stator:
    """Return the modes of a stator: bundled, from the user's cache, or computed.

    Raise ParameterError as :func:`solve_stator`.
    """
    bundled = _read(BUNDLED / bundled_name(solid))
    if bundled is not None:
        return bundled
    content = hashlib.sha256(solid.model_dump_json().encode())
    for source in sorted(Path(__file__).parent.glob("*.*")):
        content.update(source.read_bytes())
    stored = None
    with suppress(ParameterError):
        stored = cache_folder("stators", ParameterError("no home")) / f"{content.hexdigest()[:32]}.npz"
    kept = stored and _read(stored)
    if kept:
        return kept
    found = solve_stator(solid)
    with suppress(OSError, ParameterError):  # a result that cannot be kept is still one
        if stored:
            stored.parent.mkdir(parents=True, exist_ok=True)
            write_stator(stored, found)
    return found


def bundled_name(solid: Solid) -> str:
    """Return the name of a bundled stator's file; entries that a later version adds do not change it."""
    content = solid.model_dump_json(exclude_defaults=True)
    return f"{hashlib.sha256(content.encode()).hexdigest()[:16]}.npz"


def write_stator(path: Path, stator: Stator) -> None:
    """Write a stator to a compressed .npz. Raise ParameterError for a place that cannot be written."""
    arrays = vars(stator) | {name: getattr(stator, name).astype(np.float32) for name in _DRAWN}
    save_by_ending(path, {".npz": lambda place: np.savez_compressed(place, **arrays)})


def _read(path: Path) -> Stator | None:
    """Return the stator in a file, or None if it is missing or damaged."""
    with suppress(OSError, ValueError, KeyError, BadZipFile), path.open("rb") as file, np.load(file) as arrays:
        return Stator(**{field.name: arrays[field.name] for field in fields(Stator)})
    return None
