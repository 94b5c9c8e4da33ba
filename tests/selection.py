# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cases of a parametrized test run in ``make test``, and which only in ``make fuzz`` or ``make soak``."""

from collections.abc import Iterable
from typing import Any

import pytest


def mostly(mark: pytest.MarkDecorator, cases: Iterable[Any], always: Iterable[Any]) -> list[Any]:
    """The cases for ``parametrize``: those of ``always`` run in every case, the others with the mark."""
    chosen = list(always)
    every = list(cases)
    assert all(case in every for case in chosen), "a case that does not exist"
    return [
        case if case in chosen else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=mark)
        for case in every
    ]
