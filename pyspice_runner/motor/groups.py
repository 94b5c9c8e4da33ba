# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the electrical groups at the face of the model: pins, nodes, fields and columns. Inside they are indices."""

from __future__ import annotations

GROUPS = ("a", "b")


def column(quantity: str, group: str, unit: str) -> str:
    """Return the name of a group's column, such as ``current_a_a``."""
    return f"{quantity}_{group}_{unit}"


def node(name: str, group: str) -> str:
    """Return the name of a node or an instance of a group, such as ``line_a``."""
    return f"{name}_{group}"


def voltage(name: str, group: str) -> str:
    """Return the vector of the voltage at such a node."""
    return f"v({node(name, group)})"


def current(source: str, group: str) -> str:
    """Return the vector of the current through a voltage source of a group, named without its letter V."""
    return f"i(v{node(source, group)})"
