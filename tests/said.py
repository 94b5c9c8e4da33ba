# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command prints for the words that a user types."""

import json
from collections.abc import Sequence
from typing import Any

import pytest

from pyspice_runner.cli import run


def output(words: Sequence[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Standard output of a command that succeeds."""
    assert run(words) == 0
    return capsys.readouterr().out


def printed(words: Sequence[str], capsys: pytest.CaptureFixture[str]) -> Any:
    """The JSON value that it prints with ``--json``."""
    return json.loads(output([*words, "--json"], capsys))


def refusal(words: Sequence[str], capsys: pytest.CaptureFixture[str], status: int = 2) -> str:
    """Standard error of a command that ends with an exit status."""
    assert run(words) == status
    return capsys.readouterr().err
