# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes plain values as TOML, and checks the messages for an invalid motor."""

import json
import re
from collections.abc import Mapping
from typing import Any

# a name as repr writes it, which may hold blanks and full stops; a long one ends in …
QUOTED = r"""(?<!\w)(['"])(?:\\.|(?!\1).)*?(?:\1|…)"""


def toml(document: Mapping[str, Any]) -> str:
    """One line for each entry; tables are written inline."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in document.items())


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value).replace("\x7f", "\\u007f") if isinstance(value, str) else str(value)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def reads_well(sentence: str) -> bool:
    """One or two sentences on one line, short enough to be read aloud, with nothing of Python's in it."""
    plain = re.sub(QUOTED, "''", sentence)
    ends = re.findall(r"[.?!](?= [A-Z]|$)", plain)
    return (
        sentence.isprintable()
        and sentence[-1] in ".?"
        and 1 <= len(ends) <= 2
        and len(sentence) <= 400
        and not re.search(r"Traceback|pydantic|validation error|<class|None of|\bInput should\b", plain)
        and "  " not in plain
    )
