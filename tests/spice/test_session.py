# SPDX-License-Identifier: GPL-3.0-or-later
"""A transient that stops, is altered and goes on, against the closed form of an RC circuit."""

from __future__ import annotations

from math import exp

import pytest

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice.session import Session

DECK = """a capacitor that is charged in steps
Vin in 0 DC 1
R1 in out 1k
C1 out 0 1u ic=0
Vclock clock 0 PULSE(0 1 0 0.5m 0.2m 0.2m 1m)
.save v(out) v(in)
.tran 2u 1 0 2u uic
.end
"""


def test_samples_follow_the_closed_form_while_the_source_is_altered() -> None:
    """Trapezoidal rule with 500 steps a time constant: (1/500)²/12 a time constant, below 1e-6."""
    expected = 0.0
    with Session(DECK, ["v(out)", "v(in)"]) as session:
        for number in range(1, 6):
            level = float(number)
            expected = level + (expected - level) * exp(-1.0)
            sample = session.advance(number * 1e-3)
            assert sample["time"] == pytest.approx(number * 1e-3, rel=2e-9)
            assert sample["v(out)"] == pytest.approx(expected, rel=1e-3)
            session.alter("vin", level + 1.0)
        raw = session.finish()
    assert raw.vectors["time"][-1] == pytest.approx(5e-3)
    assert raw.vectors["v(out)"][-1] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "value"),
    [("vin; shell touch x", 1.0), ("vin\nquit", 1.0), ("rload", 1.0), ("vin", float("nan")), ("vin", float("inf"))],
)
def test_only_a_source_takes_a_finite_number(name: str, value: float) -> None:
    with Session(DECK, ["v(out)"]) as session, pytest.raises(SimulationError, match="it takes the name of a source"):
        session.alter(name, value)


def test_a_vector_with_other_text_is_an_error() -> None:
    with pytest.raises(SimulationError, match="cannot be read in a session"):
        Session(DECK, ["v(out); quit"])


def test_a_deck_with_a_fault_says_so_in_ngspice_words() -> None:
    with pytest.raises(SimulationError, match="ngspice"):  # noqa: SIM117
        with Session(DECK.replace("R1 in out 1k", "X1 in out missing"), ["v(out)"]) as session:
            session.advance(1e-3)


def test_a_slow_run_ends_with_the_timeout() -> None:
    slow = DECK.replace(".tran 2u 1 0 2u uic", ".tran 100n 1 0 100n uic")
    with Session(slow, ["v(out)"], timeout=0.2) as session, pytest.raises(SimulationError, match=r"within 0\.2 s"):
        session.advance(0.9)
