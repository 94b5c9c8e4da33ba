# SPDX-License-Identifier: GPL-3.0-or-later
"""How a value is refused: one sentence that names where it stands, the value, its unit and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any, TypeVar

from pydantic import ValidationError

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.parameters import Parameters

_P = TypeVar("_P", bound=Parameters)


class Stated(Parameters):
    """Parameters that a user states by the constructor.

    Raises:
        ParameterError: by the constructor, for an unknown name or a value that is refused.
    """

    def __init__(self, **values: Any) -> None:
        name = type(self).__name__
        check_keys(values, tuple(type(self).model_fields), name, "")
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise refusal(error, type(self), "", name) from error


def build(kind: type[_P], entry: Any, path: str, where: str) -> _P:
    """Return the parameters that a table states.

    Args:
        kind: class of parameters.
        entry: the table, still untrusted.
        path: dotted path of the table, for messages.
        where: file or object it stands in, for messages.

    Raises:
        ParameterError: for what is not a table, an unknown or missing name, or a refused value.
    """
    table = as_table(entry, path, where)
    check_keys(table, tuple(kind.model_fields), where, path)
    try:
        return kind(**table)
    except ValidationError as error:
        raise refusal(error, kind, path, where) from error


def refusal(error: ValidationError, kind: type[Parameters], path: str, where: str) -> ParameterError:
    """Put pydantic's first finding into one sentence: path, value, unit, what is allowed."""
    first = error.errors()[0]
    name = str(first["loc"][-1]) if first["loc"] else ""
    full = ".".join(part for part in (path, name) if part)
    if first["type"] == "value_error":
        prefix = f"{where}: {path}." if path else f"{where}: "
        return ParameterError(f"{prefix}{first['ctx']['error']}.")
    field = kind.model_fields.get(name)
    if first["type"] == "missing":
        unit = f", in{_unit(field)}" if _unit(field) else ""
        meaning = f" ({field.description}{unit})" if field else ""
        return ParameterError(f"{where}: {full} is missing{meaning}. State it.")
    return _refused(first["input"], full, where, allowed_range(kind, name) if field else first["msg"], _unit(field))


def limited(kind: type[Parameters], name: str, value: Any, path: str, where: str) -> float:
    """Return the value if the field of that name takes it.

    Raises:
        ParameterError: otherwise.
    """
    schema = kind.model_json_schema()["properties"][name]
    inside = (
        _is_number(value)
        and schema.get("exclusiveMinimum", float("-inf")) < value < schema.get("exclusiveMaximum", float("inf"))
        and schema.get("minimum", float("-inf")) <= value <= schema.get("maximum", float("inf"))
    )
    if not inside:
        raise _refused(value, path, where, allowed_range(kind, name), _unit(kind.model_fields[name]))
    return float(value)


def allowed_range(kind: type[Parameters], name: str) -> str:
    """Say in words what values a field takes, with its unit."""
    schema = kind.model_json_schema()["properties"][name]
    if "enum" in schema:
        return "one of " + ", ".join(map(str, schema["enum"]))
    if schema.get("type") == "string":
        return f"a text of at most {schema.get('maxLength', 1000)} {schema.get('made_of', 'characters')}"
    if schema.get("type") == "array":
        return f"{schema['minItems']} to {schema['maxItems']} entries"
    low = f"≥ {schema['minimum']:g}" if "minimum" in schema else f"> {schema.get('exclusiveMinimum', float('-inf')):g}"
    high = f"≤ {schema['maximum']:g}" if "maximum" in schema else f"< {schema.get('exclusiveMaximum', float('inf')):g}"
    noun = "a whole number" if schema.get("type") == "integer" else "a number"
    return f"{noun} {low} and {high}{_unit(kind.model_fields[name])}"


def unit_of(kind: type[Parameters], name: str) -> str:
    """Return the unit that a field was declared with, or an empty text."""
    extra = kind.model_fields[name].json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else ""


def _unit(field: Any) -> str:
    extra = field.json_schema_extra if field is not None else None
    unit = extra.get("unit", "") if isinstance(extra, dict) else ""
    return f" {unit}" if unit not in ("", "1") else ""


def check_keys(table: Mapping[str, Any], allowed: Sequence[str], where: str, path: str) -> None:
    """Refuse a name that is not among the allowed ones, and say which one may have been meant."""
    for key in table:
        if key not in allowed:
            close = difflib.get_close_matches(key, allowed, n=1)
            hint = f"Did you mean {close[0]!r}?" if close else f"Known are {', '.join(allowed)}."
            raise ParameterError(f"{where}: there is no {quoted('.'.join(p for p in (path, key) if p))}. {hint}")


def as_table(value: Any, path: str, where: str) -> dict[str, Any]:
    """Return the value if it is a table."""
    if not isinstance(value, dict):
        raise ParameterError(f"{where}: {path} must be a table [{path}], not {quoted(value)}.")
    return value


def positive(value: Any, path: str, where: str, unit: str = "") -> float:
    """Return the value if it is a number above zero, and not so large that one would have to fear an overflow."""
    unit = f" {unit}" if unit else ""
    if not (_is_number(value) and 0.0 < value < 1e18):
        raise _refused(value, path, where, f"a number > 0 and < 1e+18{unit}", unit)
    return float(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _refused(value: Any, path: str, where: str, allowed: str, unit: str) -> ParameterError:
    shown = f"{len(value)} entries" if isinstance(value, tuple) else quoted(value)
    return ParameterError(
        f"{where}: {path} = {shown}{unit if _is_number(value) else ''} is refused; allowed is {allowed}."
    )


def quoted(value: Any) -> str:
    """Return a value as it was written, made short and printable."""
    text = f"{value:g}" if isinstance(value, float) else str(value) if isinstance(value, date) else repr(value)
    return text if len(text) <= 60 else text[:57] + "…"
