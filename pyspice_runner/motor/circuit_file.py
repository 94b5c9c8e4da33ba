# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of equivalent circuits: written as TOML, read from TOML or from the JSON of a fit."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.dielectric import LARGEST_LOSS_TANGENT
from pyspice_runner.motor.document import parse_toml, read_document
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.motor.refusal import checked

_ARM = [item.name for item in fields(MotionalArm)]
_WHOLE = [item.name for item in fields(EquivalentCircuit) if item.name not in ("arms", "shared_losses")]
_LEAST, _MOST = 1e-30, 1e18  # beyond any circuit, and far from overflow
_PARTS = ("loss_tangent_falling", "loss_tangent_rising", "loss_tangent_flat")
_MAY_BE_MISSING = ("lead_resistance_ohm", "lead_inductance_h", *_PARTS)
_MAY_BE_ZERO = ("loss_tangent", *_MAY_BE_MISSING)


def circuit_toml(circuit: EquivalentCircuit, *, title: str = "") -> str:
    """Return an equivalent circuit as TOML, which :func:`load_circuit` reads back without loss."""
    lines = [
        f"# Equivalent circuit{', ' if title else ''}{_comment(title)}",
        "# USE: piezomotor simulate THIS.toml, or piezomotor export THIS.toml --output stator.lib",
        "# It is a transducer; [load] has its load, and velocity_per_current (m/s/A) of an arm the motion of its face.",
        "# A motor's file takes these [[arms]] too, each with name, coupling_ratio, mass_kg, tip_x and tip_y besides.",
        "",
        *(f"{key} = {float(getattr(circuit, key))!r}" for key in _WHOLE),
    ]
    if circuit.shared_losses:
        lines += [
            "# in the square root of ohm, of the clamped capacitance and of each arm, a row for each shared resistance"
        ]
        lines += [f"shared_losses = {[list(map(float, row)) for row in circuit.shared_losses]}"]
    for arm in circuit.arms:
        lines += ["", "[[arms]]", *(f"{key} = {float(getattr(arm, key))!r}" for key in _ARM)]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    """Return a text as one line without control characters, for a comment in TOML."""
    return "".join(sign if sign.isprintable() else "_" for sign in " ".join(text.split()))


@checked
def is_circuit_file(source: str | Path) -> bool:
    """Return whether a file holds an equivalent circuit without a load, not a motor."""
    path = Path(source)
    if path.suffix == ".json":
        return True
    try:
        document = parse_toml(read_document(path, ""), path.name) if path.suffix == ".toml" else {}
        return "clamped_capacitance_f" in document and "load" not in document
    except ParameterError:
        return False


@checked
def load_circuit(path: str | Path) -> EquivalentCircuit:
    """Read an equivalent circuit from its TOML, or from the JSON of a fit.

    Raises:
        ParameterError: if the file cannot be read, or its values do not describe a passive circuit.
    """
    path = Path(path)
    text = read_document(path, "the file of a fit")
    try:
        document = json.loads(text) if path.suffix == ".json" else parse_toml(text, path.name)
    except ParameterError:
        raise
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{path.name} is not valid JSON: {error}. Save the fit again.") from error
    return circuit_of(document, path.name)


def circuit_of(document: Any, where: str) -> EquivalentCircuit:
    """Return the equivalent circuit of a document; ``where`` names its file. Raise ParameterError if it is not one."""
    arms = document.get("arms") if isinstance(document, dict) else None
    if not isinstance(arms, list) or not arms or not all(isinstance(arm, dict) for arm in arms):
        raise ParameterError(f"{where} has no arms; give what `piezomotor fit --output` wrote as .json or .toml.")
    found = [
        MotionalArm(*(_number(arm, key, f"arms.{index}.{key}", where) for key in _ARM))
        for index, arm in enumerate(arms)
    ]
    whole = {key: _number(document, key, key, where) for key in _WHOLE}
    order = sorted(range(len(found)), key=lambda index: found[index].series_resonance_hz)
    rows = _rows(document.get("shared_losses") or [], [found[index] for index in order], order, where)
    circuit = EquivalentCircuit(tuple(found[index] for index in order), **whole, shared_losses=rows)
    if -circuit.loss_tangent_causal > circuit.loss_tangent * 1e-9 + 1e-12:
        raise ParameterError(
            f"{where}: loss_tangent = {circuit.loss_tangent:g} is less than its parts {', '.join(_PARTS[:-1])} and "
            f"{_PARTS[-1]} together. Correct one of them."
        )
    if circuit.loss_tangent_causal + circuit.loss_tangent_flat > LARGEST_LOSS_TANGENT:
        raise ParameterError(
            f"{where}: the constant part of loss_tangent = {circuit.loss_tangent:g} is too large: it must be at "
            f"most {LARGEST_LOSS_TANGENT:g}. Specify a part of it as loss_tangent_falling or loss_tangent_rising."
        )
    return circuit


def _rows(given: Any, arms: list[MotionalArm], order: list[int], where: str) -> tuple[tuple[float, ...], ...]:
    """Return the checked rows of shared losses, sorted like the arms; no arm shares more than its resistance."""
    count = len(arms) + 1
    valid = isinstance(given, list) and all(isinstance(row, list) and len(row) == count for row in given)
    valid = valid and all(isinstance(value, int | float) and abs(value) <= _MOST for row in given for value in row)
    require(valid, f"{where}: shared_losses", given, f"rows of {count} numbers")
    rows = tuple(tuple(float(row[index]) for index in (0, *(1 + place for place in order))) for row in given)
    for index, arm in enumerate(arms):
        shared = sum(row[1 + index] ** 2 for row in rows)
        if shared > arm.resistance_ohm * (1.0 + 1e-9):
            raise ParameterError(
                f"{where}: shared_losses give {shared:g} Ω to the arm at {arm.series_resonance_hz:g} Hz, whose "
                f"resistance is {arm.resistance_ohm:g} Ω; it must be at least as large."
            )
    return rows


def _number(table: dict[str, Any], key: str, path: str, where: str) -> float:
    value = table.get(key, 0.0 if key in _MAY_BE_MISSING else None)
    if value is None:
        raise ParameterError(f"{where}: {path} is missing. Specify it.")
    least = 0.0 if key in _MAY_BE_ZERO else _LEAST
    valid = isinstance(value, int | float) and not isinstance(value, bool) and least <= value <= _MOST
    require(valid, f"{where}: {path}", value, f"a number ≥ {least:g} and ≤ {_MOST:g}")
    return float(value)
