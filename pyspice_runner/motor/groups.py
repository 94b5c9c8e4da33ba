# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the electrical groups at the face of the model: pins, nodes, fields and columns. Inside they are indices."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TypeVar

GROUPS = ("a", "b")
_Value = TypeVar("_Value")


def of(values: Sequence[_Value], group: str) -> _Value:
    """Return the value of a group from a sequence over the groups."""
    return values[GROUPS.index(group)]


@cache
def column(quantity: str, group: str, unit: str) -> str:
    """Return the name of a group's column, such as ``current_a_a``."""
    return f"{quantity}_{group}_{unit}"


@cache
def named(name: str, group: str) -> str:
    """Return the name of a node, an instance or a value of a group, such as ``line_a``."""
    return f"{name}_{group}"


def voltage(name: str, group: str) -> str:
    """Return the vector of the voltage at such a node."""
    return f"v({named(name, group)})"


def current(source: str, group: str) -> str:
    """Return the vector of the current through a voltage source of a group, named without its letter V."""
    return f"i(v{named(source, group)})"
