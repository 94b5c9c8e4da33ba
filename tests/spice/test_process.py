# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes of ngspice that stay for the next deck, and a transient that pauses at samples."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from math import exp
from pathlib import Path

import numpy as np
import pytest

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice import process, program
from pyspice_runner.spice.ngspice import SpiceRun, ngspice_version, run_deck
from pyspice_runner.spice.process import KeptProcesses, Server, Session, silent_fault

DECK = """rc
V1 in 0 SIN(0 1 1k)
R1 in out {}
C1 out 0 1u
.save v(out) i(v1)
.tran 1u 1m 0 1u
.end
"""


Run = Callable[..., SpiceRun]
NEEDS_TERMINAL = 44  # version of ngspice whose interactive mode fails on Linux without a controlling terminal


@pytest.fixture(params=[True, False], ids=["posix", "like Windows"])  # which has neither terminals nor process groups
def kept(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[KeptProcesses]:
    for module in (process, program):
        monkeypatch.setattr(module, "POSIX", request.param)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "native")  # the processes of WebAssembly stay in any case
    if not request.param and int(ngspice_version().split(".")[0]) >= NEEDS_TERMINAL:
        pytest.skip("this ngspice ends on Linux without a terminal")
    with KeptProcesses() as several:
        yield several
    assert not list(tmp_path.iterdir())


@pytest.fixture
def run(kept: KeptProcesses) -> Run:
    return partial(run_deck, vectors=["v(out)"], stop_time=1e-3, processes=kept)


def test_a_process_that_stays_gives_the_points_of_one_that_ends(run: Run, kept: KeptProcesses) -> None:
    for resistance in ("1k", "2k", "1k"):
        deck = DECK.format(resistance)
        ours = run(deck, vectors=["v(out)", "i(v1)"]).raw.vectors
        for name, values in run(deck, vectors=["v(out)", "i(v1)"], processes=None).raw.vectors.items():
            assert np.array_equal(ours[name], values)
    assert len(kept._idle) == 1


def test_a_deck_that_fails_has_the_message_of_a_run_of_its_own_and_spoils_no_other(run: Run) -> None:
    with pytest.raises(SimulationError, match="no parameter r") as faulty:
        run(DECK.format("1k\nX1 out part r=2\n.subckt part a\nR1 a 0 1\n.ends"))
    with pytest.raises(SimulationError, match=r"left out the vector v\(none\)") as caught:
        run(DECK.format("1k"), vectors=["v(none)"])
    for error in (faulty.value, caught.value):  # the netlists are kept
        shutil.rmtree(error.deck.parent)
    assert run(DECK.format("1k")).raw.points > 100


def test_a_run_whose_process_is_killed_is_repeated(run: Run, kept: KeptProcesses) -> None:
    run(DECK.format("1k"))
    kept._idle[0]._process.kill()
    assert run(DECK.format("1k")).raw.points > 100


def test_an_ngspice_without_a_dialogue_runs_each_deck_in_a_process_of_its_own(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[bool] = []

    def refused() -> None:
        started.append(True)
        raise SimulationError("ngspice ended.")

    monkeypatch.setattr(process, "Server", refused)
    for _ in range(5):
        assert run(DECK.format("1k")).raw.points > 100
    assert len(started) == process._MOST_FAILURES


def test_processes_end_with_the_one_that_keeps_them(tmp_path: Path) -> None:
    script = f"""
import sys, time
from pyspice_runner.spice.ngspice import run_deck
from pyspice_runner.spice.process import KeptProcesses
with KeptProcesses() as kept:
    run_deck({DECK.format("1k")!r}, vectors=["v(out)"], stop_time=1e-3, processes=kept)
    print(kept._idle[0]._process.pid, flush=True)
    time.sleep(60.0)
"""
    environment = os.environ | {"TMPDIR": str(tmp_path), "PIEZOMOTOR_ENGINE": "native"}
    owner = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment, text=True)
    ours = int(owner.stdout.readline())
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    owner.stdout.close()
    ends = time.monotonic() + 20.0
    while time.monotonic() < ends:
        state = Path(f"/proc/{ours}/stat")
        if not state.exists() or state.read_text(encoding="utf-8").rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("ngspice is still there")


def test_a_process_that_is_closed_twice_leaves_the_descriptors_of_others_open() -> None:
    server = Server()
    server.close()
    others = [os.open(os.devnull, os.O_RDONLY) for _ in range(8)]  # the lowest free numbers, with that of the terminal
    server.close()
    for one in others:
        os.close(one)  # an OSError if it is closed


# --- sessions ---

STEPPED = """a capacitor that is charged in steps
Vin in 0 DC 1
R1 in out 1k
C1 out 0 1u ic=0
Vclock clock 0 PULSE(0 1 0 0.5m 0.2m 0.2m 1m)
.save v(out) v(in)
.tran 2u 1 0 2u uic
.end
"""


@pytest.mark.parametrize("engine", ["native", "wasm"])
def test_samples_follow_the_closed_form_while_a_source_is_altered(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trapezoidal rule with 500 steps a time constant: (1/500)²/12 a time constant, below 1e-6."""
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", engine)
    expected = 0.0
    with Session(STEPPED, ["v(out)", "v(in)"]) as session:
        for number in range(1, 6):
            level = float(number)
            expected = level + (expected - level) * exp(-1.0)
            sample = session.advance(number * 1e-3)
            assert sample["time"] == pytest.approx(number * 1e-3, rel=2e-9)
            assert sample["v(out)"] == pytest.approx(expected, rel=1e-3)
            session.alter("vin", level + 1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [("vin; shell touch x", 1.0), ("vin\nquit", 1.0), ("rload", 1.0), ("vin", float("nan")), ("vin", float("inf"))],
)
def test_only_a_source_takes_a_finite_number(name: str, value: float) -> None:
    with Session(STEPPED, ["v(out)"]) as session, pytest.raises(SimulationError, match="it takes the name of a source"):
        session.alter(name, value)


def test_a_vector_with_other_text_is_an_error() -> None:
    with pytest.raises(SimulationError, match="cannot be read in a session"):
        Session(STEPPED, ["v(out); quit"])


def test_a_deck_with_a_fault_says_so_in_ngspice_words() -> None:
    with pytest.raises(SimulationError, match="ngspice"):  # noqa: SIM117
        with Session(STEPPED.replace("R1 in out 1k", "X1 in out missing"), ["v(out)"]) as session:
            session.advance(1e-3)


def test_a_slow_run_ends_with_the_timeout() -> None:
    slow = STEPPED.replace(".tran 2u 1 0 2u uic", ".tran 100n 1 0 100n uic")
    with Session(slow, ["v(out)"], timeout=0.2) as session, pytest.raises(SimulationError, match=r"within 0\.2 s"):
        session.advance(0.9)


# --- what is looked for in a netlist before ngspice runs; that ngspice does pass over it, test_ngspice.py shows ---


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("Xa n part r={2*{k=3}} c='x=1'", None),  # what stands in braces or quotes is an expression
        ("Xa n part r={f(a b=1", None),  # ngspice itself refuses what is not closed
        ("Xa n part b=1", "Subcircuit part has no parameter b"),
        ("Xa part", "The line of xa has 0 of the 1 nodes of subcircuit part, and ngspice 42 would"),  # Ubuntu 24.04
        ("Xa n part\n* a comment\n + b=1", "Subcircuit part has no parameter b"),
        ("Xa n part\nR1 n 0 1\n+ b=1", None),  # continues the resistor
        ("x=1 y=2", None),  # names no subcircuit
        ("}", None),
    ],
)
def test_an_instance_is_held_to_the_parameters_of_its_subcircuit(line: str, fault: str | None) -> None:
    found = silent_fault(f"title\n.subckt part n r=1 c=1\nR1 n 0 {{r}}\n.ends\n{line}\n.end\n")
    assert (found or "").startswith(fault or "")
    assert (found is None) == (fault is None)


@pytest.mark.parametrize(
    "signs", ["{" * 100_000, "}" * 100_000, "{" * 50_000 + "}" * 50_000, "{'" * 50_000, "\n" * 100_000]
)
def test_nested_braces_cost_no_time(signs: str) -> None:
    start = time.process_time()
    silent_fault(f"title\nX1 a 0 {signs}\n.end\n")
    assert time.process_time() - start < 1.0
