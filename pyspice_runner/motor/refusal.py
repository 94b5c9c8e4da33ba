# SPDX-License-Identifier: GPL-3.0-or-later
"""Error messages for invalid values: one sentence with the place, the value, its unit and the range."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from numbers import Real
from operator import ge, gt, le, lt
from typing import Any, ParamSpec, Self, TypeVar, get_args, get_type_hints

from pydantic import ConfigDict, ValidationError, validate_call

from pyspice_runner.errors import ParameterError, did_you_mean
from pyspice_runner.errors import quoted as quoted
from pyspice_runner.motor.parameters import Parameters

_P = TypeVar("_P", bound=Parameters)
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")
_LIMITS = {  # of a JSON schema: sign, and whether a value keeps it
    "minimum": ("≥", ge), "exclusiveMinimum": (">", gt), "maximum": ("≤", le), "exclusiveMaximum": ("<", lt),
}  # fmt: skip


class Stated(Parameters):
    """Parameters that a user gives to the constructor: by name, or in the order of their declaration.

    Those of the class itself come before the inherited ones: ``TwoPhaseDrive(110.0, 40e3, 120.0)``.

    Raises:
        ParameterError: by the constructor, for an unknown name or an invalid value.
    """

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        parameters = []
        for name in cls._names():
            field, kind = cls.model_fields[name], inspect.Parameter.POSITIONAL_OR_KEYWORD
            default = inspect.Parameter.empty if field.is_required() else field.get_default(call_default_factory=True)
            parameters.append(inspect.Parameter(name, kind, default=default))
        cls.__signature__ = inspect.Signature(parameters)  # for help() and editors

    def __init__(self, *values: Any, **named: Any) -> None:
        where, names = type(self).__name__, self._names()
        if len(values) > len(names):
            raise ParameterError(f"{where}: there are {len(values)} values for {len(names)} parameters.")
        positional = dict(zip(names, values, strict=False))
        for name in positional.keys() & named:
            raise ParameterError(f"{where}: {name} is given twice. The order of the values is {', '.join(names)}.")
        check_keys(named, names, where, "")
        try:
            super().__init__(**positional, **named)
        except ValidationError as error:
            raise refusal(error, type(self), "", where) from error

    @classmethod
    def _names(cls) -> list[str]:
        """Return the names of the parameters in the order in which the constructor takes them."""
        own = [name for name in cls.model_fields if name in cls.__annotations__]
        rest = [name for name in cls.model_fields if name not in own]
        return [*own, *sorted(rest, key=lambda name: not cls.model_fields[name].is_required())]

    def updated(self, changes: Mapping[str, Any]) -> Self:
        """Return a copy with some values changed, by their names.

        Raises:
            ParameterError: for a name that does not exist or an invalid value.
        """
        return type(self)(**{**self.model_dump(), **changes})

    @property
    def own_text(self) -> str:
        """The text of files of the user's own that the values name; empty without one."""
        return ""

    def of_part(self, path: str) -> tuple[float, str] | None:  # noqa: ARG002
        """Return value and unit of PART.PARAMETER, ``None`` for a name without a part, or an object without parts.

        Raises:
            ParameterError: for a part or a parameter that does not exist.
        """
        return None


def build(kind: type[_P], entry: Any, path: str, where: str) -> _P:
    """Return the parameters that a table states.

    Raise ParameterError if it is not a table, or for an unknown or missing name or an invalid value.
    """
    table = as_table(entry, path, where)
    check_keys(table, tuple(kind.model_fields), where, path)
    try:
        return kind(**table)
    except ValidationError as error:
        raise refusal(error, kind, path, where) from error


def refusal(error: ValidationError, kind: type[Parameters], path: str, where: str) -> ParameterError:
    """Return the first error of pydantic as one sentence: path, value, unit, range."""
    first = error.errors()[0]
    name, *inside = map(str, first["loc"] or ("",))
    full = ".".join(part for part in (path, name) if part)
    if first["type"] == "value_error":
        said = str(first["ctx"]["error"]).removesuffix(".")
        owner = f"{path}." if re.split(r"\W", said, maxsplit=1)[0] in kind.model_fields else f"[{path}]: "
        return ParameterError(f"{where}: {owner if path else ''}{said}{'' if said.endswith('?') else '.'}")
    field = kind.model_fields.get(name)
    if first["type"] == "missing":
        unit = f", in{_unit(kind, name)}" if _unit(kind, name) else ""
        meaning = f" ({field.description}{unit})" if field else ""
        return ParameterError(f"{where}: {full} is missing{meaning}. Specify it.")
    schema, unit = schema_of(kind, name), _unit(kind, name)
    if schema.get("type") == "array" and first["type"] in ("too_long", "too_short"):
        most = _in_words(schema, unit)
        return ParameterError(f"{where}: {full} has {len(first['input'])} entries; there may be {most}.")
    meaning = f" ({field.description})" if field and schema.get("type") == "object" else ""
    if meaning and inside:
        full, schema = f"{full}.{inside[0]}", schema["additionalProperties"]
    return _invalid(first["input"], full, where, _in_words(schema, unit) + meaning, unit)


@cache
def schema_of(kind: type[Parameters], name: str) -> dict[str, Any]:
    """Return the JSON schema of a field, which has its range; of an optional one that without null."""
    schema: dict[str, Any] = kind.model_json_schema()["properties"][name]
    return next(iter(schema.get("anyOf", [schema])))


def limited(kind: type[Parameters], name: str, value: Any, path: str, where: str) -> float:
    """Return the value if it is valid for the field of that name. Raise ParameterError otherwise."""
    schema = schema_of(kind, name)
    if not _is_number(value) or not all(
        holds(value, schema[name]) for name, (_, holds) in _LIMITS.items() if name in schema
    ):
        raise _invalid(value, path, where, allowed_range(kind, name), _unit(kind, name))
    return float(value)


def allowed_range(kind: type[Parameters], name: str) -> str:
    """Return in words the values that a field accepts, with its unit."""
    return _in_words(schema_of(kind, name), _unit(kind, name))


def _in_words(schema: Mapping[str, Any], unit: str) -> str:
    if "enum" in schema:
        return "one of " + ", ".join(map(str, schema["enum"]))
    if "anyOf" in schema:
        return " or ".join(_in_words(each, unit) for each in schema["anyOf"])
    if schema.get("type") == "object":
        return f"a table {{ NAME = VALUE }}, each value {_in_words(schema['additionalProperties'], unit)}"
    if schema.get("type") == "boolean":
        return "true or false"
    if schema.get("type") == "string":
        return f"a text of at most {schema.get('maxLength', 1000)} {schema.get('made_of', 'characters')}"
    if schema.get("type") == "array":
        least = f"{schema['minItems']} to" if "minItems" in schema else "at most"
        return f"{least} {schema['maxItems']}"
    limits = " and ".join(f"{sign} {schema[name]:g}" for name, (sign, _) in _LIMITS.items() if name in schema)
    noun = "a whole number" if schema.get("type") == "integer" else "a number"
    return f"{noun} {limits}{unit}" if limits else "a finite number"


def unit_of(kind: type[Parameters], name: str) -> str:
    """Return the unit that a field was declared with, or an empty text."""
    extra = kind.model_fields[name].json_schema_extra if name in kind.model_fields else None
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def _unit(kind: type[Parameters], name: str) -> str:
    unit = unit_of(kind, name)
    return f" {unit}" if unit not in ("", "1") else ""


def check_keys(table: Mapping[str, Any], allowed: Sequence[str], where: str, path: str) -> None:
    """Check the names in a table; the error gives the nearest name."""
    for key in table:
        if key not in allowed:
            hint = did_you_mean(key, allowed)
            raise ParameterError(f"{where}: there is no {quoted('.'.join(p for p in (path, key) if p))}. {hint}")


def as_table(value: Any, path: str, where: str) -> dict[str, Any]:
    """Return the value if it is a table."""
    if not isinstance(value, dict):
        raise ParameterError(f"{where}: {path} must be a table [{path}], not {quoted(value)}.")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _invalid(value: Any, path: str, where: str, allowed: str, unit: str) -> ParameterError:
    return ParameterError(
        f"{where}: {path} = {quoted(value)}{unit if _is_number(value) else ''} is not valid: it must be {allowed}."
    )


def checked(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Check the names and types of a function's arguments by pydantic's ``validate_call``, not their ranges.

    A number of NumPy's becomes one of Python's. The function raises ParameterError for an unknown or missing argument,
    or a value of another type. Keywords that are the ``Unpack`` of a TypedDict are named one by one in its signature.
    """
    _unpack_keywords(function)
    returned = function.__annotations__.pop("return", None)  # may name what only a type checker imports
    validated = validate_call(config=ConfigDict(arbitrary_types_allowed=True, strict=True))(function)
    function.__annotations__["return"] = returned

    @wraps(function)
    def call(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        plain = dict(zip(kwargs, map(_as_python, kwargs.values()), strict=True))
        try:
            return validated(*map(_as_python, args), **plain)
        except ValidationError as error:
            if error.title not in (function.__name__, function.__qualname__):  # raised within the function
                raise
            raise ParameterError(_complaint(function, error)) from None

    return call


def _unpack_keywords(function: Callable[..., Any]) -> None:
    """Name the keywords ``**settings: Unpack[TypedDict]`` one by one in a signature, with their defaults."""
    *others, last = inspect.signature(function, eval_str=False).parameters.values()
    if last.kind is not last.VAR_KEYWORD or "Unpack[" not in str(last.annotation):
        return
    (kind,) = get_args(eval(str(last.annotation), function.__globals__))
    own = {parameter.name for parameter in others}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if name not in own:
            plain, field = get_args(hint)
            others.append(inspect.Parameter(name, last.KEYWORD_ONLY, default=field.default, annotation=plain))
            function.__annotations__[name] = plain
    del function.__annotations__[last.name]
    function.__signature__ = inspect.Signature(others, return_annotation=Any)  # type: ignore[attr-defined]


def _complaint(function: Callable[..., Any], error: ValidationError) -> str:
    """Return what is wrong with the arguments of a call, in pydantic's words about the first that is wrong."""
    names = list(inspect.signature(function).parameters)
    where, faults = function.__qualname__.removesuffix(".__init__").rpartition(".")[2], error.errors()
    first = next((fault for fault in faults if fault["type"].startswith("unexpected")), faults[0])
    place = first["loc"][0]
    name = names[place] if isinstance(place, int) and place < len(names) else str(place)
    if first["type"] == "unexpected_keyword_argument":
        hint = did_you_mean(name, [known for known in names if known != "self"], "The arguments are")
        return f"{where}: there is no argument {quoted(name)}. {hint}"
    # in words; a union has a fault for each of its types
    said = " or ".join(dict.fromkeys(fault["msg"] for fault in faults if fault["loc"][0] == place))
    said = said.replace("Input should be", "it must be", 1).replace("Input should be ", "")
    if "argument" in first["type"]:  # missing, given twice, or without a name
        return f"{where}: {name}: {said[0].lower()}{said[1:]}."
    shown = repr(first["input"]) if isinstance(first["input"], float) else quoted(first["input"])
    return f"{where}: {name} = {shown} is not valid: {said}."


def _as_python(value: Any) -> Any:
    """Return a NumPy number, or an array of one number, as a Python number."""
    return value.item() if getattr(value, "ndim", None) == 0 else value


def as_number(value: Any) -> float | None:
    """Return a number as a Python ``float``, or ``None`` if the value is not a number or is too large."""
    value = _as_python(value)
    if isinstance(value, bool):
        return None
    try:
        return float(value) if isinstance(value, Real) else None
    except OverflowError:
        return None
