# SPDX-License-Identifier: GPL-3.0-or-later
"""Write a motor as a TOML file with ``[[modes]]``, for :func:`.load_motor`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

KINDS = ("given", "derived", "assumed")  # of the origin of a value in a file


def motor_toml(document: Mapping[str, Any], provenance: Mapping[str, Any], *, heading: str = "") -> str:
    """Return a motor as TOML: every value as set, with its origin if known."""

    def entries(path: str, table: Mapping[str, Any]) -> list[str]:
        found = []
        for key, value in table.items():
            text, origin = _written(value), provenance.get(f"{path}.{key}")
            if origin is not None and origin.kind in KINDS:
                text = f"{{ value = {text}, {origin.kind} = {_written(origin.note)} }}"
            found += [] if value is None else [f"{key} = {text}"]
        return found

    lines = [*(f"# {line}".rstrip() for line in heading.splitlines()), "# USE: piezomotor simulate THIS.toml"]
    lines += ["", f"name = {_written(document['name'])}"]
    for index, mode in enumerate(document["modes"]):
        lines += ["", "[[modes]]", *entries(f"modes.{index}", mode)]
    for section, table in document.items():
        if isinstance(table, Mapping):
            lines += ["", f"[{section}]", *entries(section, table)]
    return "\n".join(lines) + "\n"


def _written(value: object) -> str:
    """Return a number or a text as TOML; the syntax is that of JSON, except for DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
