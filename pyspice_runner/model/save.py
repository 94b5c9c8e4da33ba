# SPDX-License-Identifier: GPL-3.0-or-later
"""How a motor is written as a TOML file, by its ``[[modes]]``; :func:`.load_motor` reads it back."""

from __future__ import annotations

import json

from pyspice_runner.model.motor import Motor

_KINDS = ("given", "derived", "assumed")


def motor_toml(motor: Motor, *, heading: str = "") -> str:
    """Return a motor as TOML, every value as it was set, with where it comes from as far as the motor knows.

    Args:
        motor: the motor.
        heading: words for the first lines, as a comment.
    """
    lines = [*(f"# {line}".rstrip() for line in heading.splitlines()), "# USE: piezomotor simulate THIS.toml"]
    lines += ["", f"name = {_written(motor.name)}"]
    document = motor.model_dump()
    for index, mode in enumerate(document["modes"]):
        lines += ["", "[[modes]]", *_entries(motor, f"modes.{index}", mode)]
    for section in ("piezo", "contact", "rotor"):
        lines += ["", f"[{section}]", *_entries(motor, section, document[section])]
    return "\n".join(lines) + "\n"


def _entries(motor: Motor, path: str, table: dict[str, object]) -> list[str]:
    return [f"{key} = {_value(motor, f'{path}.{key}', value)}" for key, value in table.items()]


def _value(motor: Motor, path: str, value: object) -> str:
    text = _written(value)
    origin = motor.provenance.get(path)
    if origin is None or origin.kind not in _KINDS:
        return text
    return f"{{ value = {text}, {origin.kind} = {_written(origin.note)} }}"


def _written(value: object) -> str:
    """Return a number or a text as TOML; JSON writes them alike, but for DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
