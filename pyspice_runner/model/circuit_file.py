# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of equivalent circuits: written as TOML, read from TOML or from the JSON of a fit."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.document import parse_toml, read_document
from pyspice_runner.model.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.model.refusal import checked, quoted

_ARM = [item.name for item in fields(MotionalArm)]
_WHOLE = [item.name for item in fields(EquivalentCircuit) if item.name != "arms"]
_LEAST, _MOST = 1e-30, 1e18  # beyond any circuit, and far from where numbers end
_MAY_BE_ZERO = ("loss_tangent", "lead_resistance_ohm", "lead_inductance_h")


def circuit_toml(circuit: EquivalentCircuit, *, title: str = "") -> str:
    """Return an equivalent circuit as TOML, which :func:`load_circuit` reads back without loss.

    Args:
        circuit: the circuit.
        title: description of the circuit, one line.
    """
    lines = [
        f"# Equivalent circuit{', ' if title else ''}{_comment(title)}",
        "# USE: piezomotor export THIS.toml --output stator.lib",
        "# A motor's file takes these [[arms]] too, each with name, coupling_ratio, mass_kg, tip_x and tip_y besides.",
        "",
        *(f"{key} = {float(getattr(circuit, key))!r}" for key in _WHOLE),
    ]
    for arm in circuit.arms:
        lines += ["", "[[arms]]", *(f"{key} = {float(getattr(arm, key))!r}" for key in _ARM)]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    """Return a text as it can stand in a comment of TOML: one line, no control characters."""
    return "".join(sign if sign.isprintable() else "_" for sign in " ".join(text.split()))


@checked
def is_circuit_file(source: str | Path) -> bool:
    """Whether a path is the file of an equivalent circuit and not of a motor."""
    path = Path(source)
    if path.suffix == ".json":
        return True
    try:
        return path.suffix == ".toml" and "clamped_capacitance_f" in parse_toml(read_document(path, ""), path.name)
    except ParameterError:
        return False


@checked
def load_circuit(path: str | Path) -> EquivalentCircuit:
    """Read an equivalent circuit from its TOML, or from the JSON of a fit.

    Raises:
        ParameterError: for a file that cannot be read, or whose values make no passive circuit.
    """
    path = Path(path)
    text = read_document(path, "the file of a fit")
    document = _parse_json(text, path.name) if path.suffix == ".json" else parse_toml(text, path.name)
    arms = document.get("arms") if isinstance(document, dict) else None
    if not isinstance(arms, list) or not arms or not all(isinstance(arm, dict) for arm in arms):
        raise ParameterError(f"{path.name} has no arms; give what `piezomotor fit --output` wrote as .json or .toml.")
    found = [
        MotionalArm(*(_number(arm, key, f"arms.{index}.{key}", path.name) for key in _ARM))
        for index, arm in enumerate(arms)
    ]
    whole = [_number(document, key, key, path.name) for key in _WHOLE]
    return EquivalentCircuit(tuple(sorted(found, key=lambda arm: arm.series_resonance_hz)), *whole)


def _parse_json(text: str, name: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{name} is not valid JSON: {error}. Save the fit again.") from error


def _number(table: dict[str, Any], key: str, path: str, where: str) -> float:
    value = table.get(key, 0.0 if key.startswith("lead_") else None)
    if value is None:
        raise ParameterError(f"{where}: {path} is missing. State it.")
    least = 0.0 if key in _MAY_BE_ZERO else _LEAST
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= _MOST:
        allowed = f"a number ≥ {least:g} and ≤ {_MOST:g}"
        raise ParameterError(f"{where}: {path} = {quoted(value)} is not valid: it must be {allowed}.")
    return float(value)
