# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever a message quotes, it can be shown: on one line, with nothing in it that a terminal obeys."""

import pickle

import pytest

import pyspice_runner as pr

KINDS = (pr.ParameterError, pr.SpectrumError, pr.SimulationError)


@pytest.mark.parametrize("kind", KINDS)
def test_characters_that_are_not_printable_are_escaped(kind: type[Exception]) -> None:
    error = kind("There is no file \x1b]0;x\x07\n\u202e\udcff.toml. Give another, Ω ≥ 1.")
    assert str(error) == "There is no file \\x1b]0;x\\x07\\n\\u202e\\udcff.toml. Give another, Ω ≥ 1."
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_keeps_its_beginning_and_its_end(kind: type[Exception]) -> None:
    said = str(kind(f"name = {'x' * 10**6} is not valid: it must be at most 60 letters."))
    assert len(said) == 1000
    assert said.startswith("name = xxx")
    assert said.endswith("xxx is not valid: it must be at most 60 letters.")
