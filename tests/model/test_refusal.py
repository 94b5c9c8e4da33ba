# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences by which a value is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import date
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike
from pydantic import Field

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import refusal
from pyspice_runner.model.load import Arm, Materials
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import (
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
from tests.model.toml_text import reads_well

KINDS = (Arm, Beam, Contact, Damping, Materials, Mode, Patch, Piezo, Rotor, Tip)


class Thing(Parameters):
    """Something of every kind."""

    size: float = quantity("how large it is", "m", gt=0.0, le=2.0)
    share: float = quantity("how much of it", "1", ge=0.0, lt=1.0)
    count: Annotated[int, Field(description="how many", ge=1, le=9)]
    side: Literal["left", "right"] = Field(description="where it is")
    name: str = label("what it is called")


NAMES = "is refused; allowed is a text of at most 40 letters, digits, - and _, the first a letter."
GOOD = {"size": 1.0, "share": 0.5, "count": 3, "side": "left", "name": "it"}


def said(table: Any) -> str:
    with pytest.raises(ParameterError) as caught:
        refusal.build(Thing, table, "things.0", "shelf.toml")
    assert reads_well(str(caught.value))
    return str(caught.value)


def test_good_table_is_built() -> None:
    assert refusal.build(Thing, GOOD, "things.0", "shelf.toml").model_dump() == GOOD


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("size", 0.0, "size = 0 m is refused; allowed is a number > 0 and ≤ 2 m."),
        ("size", 2.5, "size = 2.5 m is refused; allowed is a number > 0 and ≤ 2 m."),
        ("size", float("nan"), "size = nan m is refused; allowed is a number > 0 and ≤ 2 m."),
        ("size", "2 m", "size = '2 m' is refused; allowed is a number > 0 and ≤ 2 m."),
        ("size", True, "size = True is refused; allowed is a number > 0 and ≤ 2 m."),
        ("size", date(2002, 6, 10), "size = 2002-06-10 is refused; allowed is a number > 0 and ≤ 2 m."),
        ("share", 1.0, "share = 1 is refused; allowed is a number ≥ 0 and < 1."),
        ("count", 2.5, "count = 2.5 is refused; allowed is a whole number ≥ 1 and ≤ 9."),
        ("count", 10, "count = 10 is refused; allowed is a whole number ≥ 1 and ≤ 9."),
        ("side", "up", "side = 'up' is refused; allowed is one of left, right."),
        ("side", 1, "side = 1 is refused; allowed is one of left, right."),
        (
            "name",
            "7up",
            f"name = '7up' {NAMES}",
        ),
        (
            "name",
            "a" * 41,
            f"name = '{'a' * 41}' {NAMES}",
        ),
        (
            "name",
            7,
            f"name = 7 {NAMES}",
        ),
    ],
)
def test_wrong_value_is_named(name: str, value: Any, sentence: str) -> None:
    assert said(GOOD | {name: value}) == f"shelf.toml: things.0.{sentence}"


def test_missing_value_is_described() -> None:
    without = {key: value for key, value in GOOD.items() if key != "size"}
    assert said(without) == "shelf.toml: things.0.size is missing (how large it is, in m). State it."
    without = {key: value for key, value in GOOD.items() if key != "share"}
    assert said(without) == "shelf.toml: things.0.share is missing (how much of it). State it."


def test_misspelt_name_is_recognised() -> None:
    assert said(GOOD | {"sise": 1.0}) == "shelf.toml: there is no 'things.0.sise'. Did you mean 'size'?"
    assert said(GOOD | {"hue": 1.0}) == (
        "shelf.toml: there is no 'things.0.hue'. Known are size, share, count, side, name."
    )
    assert said(GOOD | {"a\nb": 1.0}).startswith("shelf.toml: there is no 'things.0.a\\nb'. Known are")


@pytest.mark.parametrize("table", [5, "x", None, [GOOD], True])
def test_what_is_no_table_is_refused(table: Any) -> None:
    assert said(table).startswith("shelf.toml: things.0 must be a table [things.0], not ")


def test_long_value_is_shortened() -> None:
    sentence = said(GOOD | {"size": "x" * 1000})
    assert len(sentence) < 200
    assert "…" in sentence


@pytest.mark.parametrize("kind", KINDS)
def test_every_quantity_says_its_range_unit_and_meaning(kind: type[Parameters]) -> None:
    for name, field in kind.model_fields.items():
        assert field.description
        # a default stands for the absence of something: here, of loss in an impact
        assert field.is_required() or name in ("restitution", "restitution_velocity_m_s")
        allowed = refusal.allowed_range(kind, name)
        assert "inf" not in allowed
        if field.annotation is float:
            assert refusal.unit_of(kind, name)
            assert allowed.startswith("a number ")


def test_name_of_a_motor_may_hold_more_than_that_of_a_mode() -> None:
    assert "spaces, dots" in refusal.allowed_range(Motor, "name")
    assert refusal.allowed_range(Motor, "modes") == "1 to 20 entries"


@pytest.mark.parametrize("value", [1.0, 1, 1e-300, 9e17])
def test_positive_number_passes(value: float) -> None:
    assert refusal.positive(value, "f", "here", "Hz") == value


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), 1e18, 10**400, "1", True, None])
def test_other_than_positive_is_refused(value: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        refusal.positive(value, "modes.0.frequency_hz", "motor x", "Hz")
    assert reads_well(str(caught.value))
    assert str(caught.value).startswith("motor x: modes.0.frequency_hz = ")
    assert str(caught.value).endswith(" is refused; allowed is a number > 0 and < 1e+18 Hz.")


@pytest.mark.parametrize("value", [2.1, 0.0, "1", True, float("nan")])
def test_single_value_is_held_to_the_range_of_its_field(value: Any) -> None:
    assert refusal.limited(Thing, "size", 2, "things.0.size", "shelf.toml") == 2.0
    with pytest.raises(ParameterError) as caught:
        refusal.limited(Thing, "size", value, "things.0.size", "shelf.toml")
    assert str(caught.value) == said(GOOD | {"size": value})


def test_what_python_cannot_write_is_named_all_the_same() -> None:
    assert refusal.quoted(10**5000) == "int too large to be shown"
    assert refusal.quoted([10**5000]) == "list too large to be shown"


class _Part:
    pass


_Part.__module__ = "pyspice_runner.model.part"


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
    like: ArrayLike = (),
    whole: bool = True,
    **rest: Any,
) -> tuple[Any, ...]:
    return part, size, count, way, names, tables, tell, like, whole, rest


def test_right_types_pass_and_numbers_become_those_of_python() -> None:
    assert held(_Part(), np.array(0.5))[1] == 0.5  # type: ignore[arg-type]
    found = held(_Part(), np.float32(0.5), count=np.int64(3), names=("a", "b"), like=[[1.0]], rest={"x": 1})
    assert [type(value) for value in found[1:3]] == [float, int]
    assert held(_Part(), 2, count=4.0)[1:3] == (2.0, 4)  # type: ignore[arg-type]
    assert held(_Part(), float("nan"), way="sideways")[3] == "sideways"  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"part": 5}, "part = 5 is refused; allowed is a _Part."),
        ({"size": "1"}, "size = '1' is refused; allowed is a number."),
        ({"size": True}, "size = True is refused; allowed is a number."),
        ({"size": None}, "size = None is refused; allowed is a number."),
        ({"size": 10**400}, "size = 1000"),
        ({"size": 1j}, "size = 1j is refused; allowed is a number."),
        ({"count": 2.5}, "count = 2.5 is refused; allowed is a whole number."),
        ({"count": float("inf")}, "count = inf is refused; allowed is a whole number."),
        ({"way": 3}, "way = 3 is refused; allowed are 'up', 'down' and None."),
        ({"names": "abc"}, "names = 'abc' is refused; allowed are a list and None."),
        ({"names": [1]}, "names = [1] is refused; allowed are"),
        ({"tables": [1]}, "tables = [1] is refused; allowed are a dictionary and None."),
        ({"tell": 1}, "tell = 1 is refused; allowed are a function and None."),
        ({"whole": 1}, "whole = 1 is refused; allowed is True or False."),
    ],
)
def test_an_argument_of_another_type_is_refused(given: dict[str, Any], says: str) -> None:
    with pytest.raises(ParameterError) as caught:
        held(**{"part": _Part(), "size": 1.0, **given})
    assert str(caught.value).startswith(says)
