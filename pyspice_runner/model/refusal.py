# SPDX-License-Identifier: GPL-3.0-or-later
"""How a value is refused: one sentence that names where it stands, the value, its unit and what is allowed."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from functools import wraps
from numbers import Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import ValidationError

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.parameters import Parameters

_P = TypeVar("_P", bound=Parameters)
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


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
    kinds = {"float_type": "a number", "string_type": "a text"}  # of what stands within a field
    allowed = allowed_range(kind, name) if field else kinds.get(first["type"], first["msg"])
    return _refused(first["input"], full, where, allowed, _unit(field))


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
    try:
        text = f"{value:g}" if isinstance(value, float) else str(value) if isinstance(value, date) else repr(value)
    except (ValueError, RecursionError):  # such as an integer of five thousand digits, which Python does not write
        return f"{type(value).__name__} too large to be shown"
    return text if len(text) <= 60 else text[:57] + "…"


_PLAIN: dict[Any, str] = {
    float: "a number", int: "a whole number", bool: "True or False", str: "a text", NoneType: "None",
    Mapping: "a dictionary", Callable: "a function", Path: "a path",
}  # fmt: skip


def checked(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Hold the arguments of a function to the types that its signature states; their ranges are its own business.

    Where a number is asked for it gets one of Python's, whatever kind of number was given.

    Raises:
        ParameterError: by the function, for an argument of another type.
    """
    signature = inspect.signature(function)
    stated = {name: hint for name, hint in function.__annotations__.items() if name != "return"}  # which may be a name
    holder = type("Stated", (), {"__annotations__": stated})  # that only a type checker imports
    every = get_type_hints(holder, globalns=getattr(function, "__globals__", None))
    hints = {name: hint for name, hint in every.items() if all(map(_tells, _choices(hint)))}

    @wraps(function)
    def held(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        bound = signature.bind(*args, **kwargs)
        for name, value in bound.arguments.items():
            if name in hints and signature.parameters[name].kind is not inspect.Parameter.VAR_KEYWORD:
                if not _fits(value, hints[name]):
                    raise ParameterError(f"{name} = {quoted(value)} is refused; allowed {_words(hints[name])}.")
                bound.arguments[name] = _as_python(value, hints[name])
        return function(*bound.args, **bound.kwargs)

    return held


def _choices(hint: Any) -> tuple[Any, ...]:
    """Return what a type is a choice of: itself, if it is none."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _tells(hint: Any) -> bool:
    """Whether one can tell by looking at a value that it is of a type; what is like an array, one cannot."""
    kind = get_origin(hint) or hint
    return kind in (Literal, Sequence, *_PLAIN) or str(getattr(kind, "__module__", "")).startswith("pyspice_runner.")


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of a type; one of several texts is any text here."""
    return any(_fits_one(value, one) for one in _choices(hint))


def _fits_one(value: Any, hint: Any) -> bool:
    if hint in (float, int):
        number = as_number(value)
        return number is not None and (hint is float or number.is_integer())
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Literal:
        return isinstance(value, str) or any(value is one for one in inside)
    if origin is Sequence:
        if not isinstance(value, Iterable) or isinstance(value, str | bytes | Mapping) or not hasattr(value, "__len__"):
            return False
        return all(_fits(item, inside[0]) for item in value)
    kind = origin or hint
    return isinstance(value, kind) if isinstance(kind, type) else True


def _as_python(value: Any, hint: Any) -> Any:
    """Return a number as the kind of number that is asked for."""
    number = as_number(value)
    if number is not None:
        if float in _choices(hint):
            return number
        if int in _choices(hint):
            return int(value)
    return value


def as_number(value: Any) -> float | None:
    """Return a number as one of Python's, ``None`` for what is none or too large."""
    if getattr(value, "ndim", None) == 0:  # an array of one number
        value = value.item()
    if isinstance(value, bool):
        return None
    try:
        return float(value) if isinstance(value, Real) else None
    except OverflowError:
        return None


def _words(hint: Any) -> str:
    """Say in words what a type is."""
    said = []
    for one in _choices(hint):
        origin, inside = get_origin(one), get_args(one)
        if origin is Literal:
            said += [repr(item) for item in inside]
        elif origin is Sequence:
            said.append("a list")
        else:
            kind = origin or one
            said.append(_PLAIN.get(kind) or f"a {kind.__name__}")
    return f"are {', '.join(said[:-1])} and {said[-1]}" if len(said) > 1 else f"is {said[0]}"
