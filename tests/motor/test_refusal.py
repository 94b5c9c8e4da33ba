# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages for invalid values."""

from collections.abc import Callable, Mapping, Sequence
from datetime import date
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from pydantic import Field

import pyspice_runner as pr
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import refusal
from pyspice_runner.motor.load import Arm
from pyspice_runner.motor.materials import Materials
from pyspice_runner.motor.parameters import (
    Beam,
    Contact,
    Damping,
    Mode,
    Parameters,
    Patch,
    Piezo,
    Rotor,
    Tip,
    label,
    quantity,
)
from tests.motor.toml_text import reads_well

KINDS = (Arm, Beam, Contact, Damping, Materials, Mode, Patch, Piezo, Rotor, Tip)


class Thing(Parameters):
    """Something of every kind."""

    size: float = quantity("how large it is", "m", gt=0.0, le=2.0)
    share: float = quantity("how much of it", "1", ge=0.0, lt=1.0)
    count: Annotated[int, Field(description="how many", ge=1, le=9)]
    side: Literal["left", "right"] = Field(description="where it is")
    name: str = label("what it is called")
    moved: dict[str, Annotated[float, Field(ge=-1.0, le=1.0)]] = Field(default={}, description="by name")
    holes: tuple[float, ...] = Field(default=(), max_length=2)


GOOD = {"size": 1.0, "share": 0.5, "count": 3, "side": "left", "name": "it"}


def said(table: Any) -> str:
    with pytest.raises(ParameterError) as caught:
        refusal.build(Thing, table, "things.0", "shelf.toml")
    assert reads_well(str(caught.value))
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "values", "said_of_it"),
    [
        ("size", {"0 m": 0.0, "2.5 m": 2.5, "nan m": float("nan"), "'2 m'": "2 m"}, "a number > 0 and ≤ 2 m."),
        ("size", {"True": True, "2002-06-10": date(2002, 6, 10)}, "a number > 0 and ≤ 2 m."),
        ("share", {"1": 1.0}, "a number ≥ 0 and < 1."),
        ("count", {"2.5": 2.5, "10": 10}, "a whole number ≥ 1 and ≤ 9."),
        ("side", {"'up'": "up", "1": 1}, "one of left, right."),
        ("moved", {"0.9": 0.9, "[1]": [1]}, "a table { NAME = VALUE }, each value a number ≥ -1 and ≤ 1 (by name)."),
        ("moved.up", {"nan": float("nan"), "'x'": "x", "2": 2.0}, "a number ≥ -1 and ≤ 1 (by name)."),
        ("name", {"'7up'": "7up", "7": 7}, "a text of at most 40 letters, digits, - and _, the first a letter."),
    ],
)
def test_wrong_value_is_named(name: str, values: dict[str, Any], said_of_it: str) -> None:
    for shown, value in values.items():
        wanted = f"shelf.toml: things.0.{name} = {shown} is not valid: it must be {said_of_it}"
        field, _, key = name.partition(".")
        assert said(GOOD | {field: {key: value} if key else value}) == wanted
    assert said(GOOD | {"holes": (1.0,) * 3}) == "shelf.toml: things.0.holes has 3 entries; there may be at most 2."


def test_missing_value_is_described() -> None:
    without = {key: value for key, value in GOOD.items() if key != "size"}
    assert said(without) == "shelf.toml: things.0.size is missing (how large it is, in m). Specify it."
    without = {key: value for key, value in GOOD.items() if key != "share"}
    assert said(without) == "shelf.toml: things.0.share is missing (how much of it). Specify it."


def test_misspelt_name_is_recognised() -> None:
    assert said(GOOD | {"sise": 1.0}) == "shelf.toml: there is no 'things.0.sise'. Did you mean 'size'?"
    assert said(GOOD | {"hue": 1.0}) == (
        "shelf.toml: there is no 'things.0.hue'. Known are size, share, count, side, name, moved, holes."
    )
    assert said(GOOD | {"a\nb": 1.0}).startswith("shelf.toml: there is no 'things.0.a\\nb'. Known are")


@pytest.mark.parametrize("table", [5, "x", None, [GOOD], True])
def test_a_value_that_is_not_a_table_is_rejected(table: Any) -> None:
    assert said(table).startswith("shelf.toml: things.0 must be a table [things.0], not ")


def test_long_value_is_shortened() -> None:
    sentence = said(GOOD | {"size": "x" * 1000})
    assert len(sentence) < 200
    assert "…" in sentence


@pytest.mark.parametrize("kind", KINDS)
def test_every_quantity_says_its_range_unit_and_meaning(kind: type[Parameters]) -> None:
    for name, field in kind.model_fields.items():
        assert field.description
        # a default leaves an optional effect out, and lies in the range of the field
        schema = kind.model_json_schema()["properties"][name]
        if field.default is not None and schema.get("type") not in ("boolean", "string"):
            least = schema.get("minimum", schema.get("exclusiveMinimum"))
            assert field.is_required() or least <= field.default <= schema["maximum"]
        allowed = refusal.allowed_range(kind, name)
        assert "inf" not in allowed
        if field.annotation in (float, float | None):
            assert refusal.unit_of(kind, name)
            assert allowed.startswith("a number ")


def test_a_value_without_a_repr_is_named() -> None:
    assert refusal.quoted(10**5000) == "int too large to be shown"
    assert refusal.quoted([10**5000]) == "list too large to be shown"


class _Part:
    pass


@refusal.checked
def held(
    part: _Part,
    size: float,
    *,
    count: int = 1,
    way: Literal["up", "down"] | None = None,
    names: Sequence[str] | None = None,
    tables: Mapping[str, float] | None = None,
    tell: Callable[[], object] | None = None,
    whole: bool = True,
    **rest: Any,
) -> tuple[Any, ...]:
    return part, size, count, way, names, tables, tell, whole, rest


@refusal.checked
def strict_names(duration: float, *, load_torque: float = 0.0, record_every: int = 1) -> float:
    return duration * load_torque * record_every


def test_valid_types_pass_and_numpy_numbers_become_python_numbers() -> None:
    part = _Part()
    found = held(part, np.array(0.5), count=np.int64(3), names=("a", "b"), way="up", rest={"x": 1})  # type: ignore[arg-type]
    assert found[:5] == (part, 0.5, 3, "up", ("a", "b"))
    assert [type(value) for value in found[1:3]] == [float, int]
    assert held(part, np.float32(0.5))[1] == 0.5
    assert held(part, 2)[1] == 2.0


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("part", [5], "it must be an instance of _Part"),
        ("size", ["1", True, None, 1j], "it must be a valid number"),
        ("count", [2.0, float("inf")], "it must be a valid integer"),
        ("way", ["sideways"], "it must be 'up' or 'down'"),
        ("names", ["abc"], "'str' instances are not allowed as a Sequence value"),
        ("tables", [[1]], "it must be a valid dictionary"),
        ("tell", [1], "it must be callable"),
        ("whole", [1], "it must be a valid boolean"),
    ],
)
def test_an_argument_of_another_type_is_an_error_that_names_the_function(
    name: str, values: list[Any], says: str
) -> None:
    for value in values:
        with pytest.raises(ParameterError) as caught:
            held(**{"part": _Part(), "size": 1.0, name: value})
        assert str(caught.value) == f"held: {name} = {value!r} is not valid: {says}."


@pytest.mark.parametrize(
    ("args", "kwargs", "says"),
    [
        ((1.0,), {"load_torqe": 1.0}, "there is no argument 'load_torqe'. Did you mean 'load_torque'?"),
        ((1.0,), {"xyz": 1.0}, "there is no argument 'xyz'. The arguments are duration, load_torque, record_every."),
        ((), {}, "duration: missing required argument."),
        ((1.0, 2.0), {}, "load_torque: unexpected positional argument."),
        ((1.0,), {"duration": 2.0}, "duration: got multiple values for argument."),
    ],
)
def test_a_wrong_name_is_an_error_that_names_the_function_and_the_nearest_name(
    args: tuple[float, ...], kwargs: dict[str, float], says: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        strict_names(*args, **kwargs)  # type: ignore[arg-type]
    assert str(caught.value) == f"strict_names: {says}"


@pytest.mark.parametrize("name", ["simulate", "speed_torque", "admittance", "track", "compare", "export_motor"])
def test_a_typo_in_an_argument_of_a_public_function_names_the_function_and_the_argument(name: str) -> None:
    with pytest.raises(ParameterError, match=f"^{name}: there is no argument 'x'. The arguments are "):
        getattr(pr, name)(x=1)
