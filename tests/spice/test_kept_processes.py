# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in processes of ngspice that stay for the next deck."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice import kept_processes as processes
from pyspice_runner.spice.kept_processes import KeptProcesses
from pyspice_runner.spice.ngspice import run_deck
from pyspice_runner.spice.pipe import Pipe

DECK = """rc
V1 in 0 SIN(0 1 1k)
R1 in out {}
C1 out 0 1u
.save v(out) i(v1)
.tran 1u 1m 0 1u
.end
"""


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[KeptProcesses]:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with KeptProcesses() as several:
        yield several
    assert not list(tmp_path.iterdir())


def test_a_process_that_stays_gives_the_points_of_one_that_ends(kept: KeptProcesses) -> None:
    for resistance in ("1k", "2k", "1k"):
        deck = DECK.format(resistance)
        ours = kept.run(deck, ["v(out)", "i(v1)"], 1e-3).raw.vectors
        for name, values in run_deck(deck, vectors=["v(out)", "i(v1)"], stop_time=1e-3).raw.vectors.items():
            assert np.array_equal(ours[name], values)
    assert len(kept._idle) == 1


def test_a_deck_that_fails_is_told_as_by_a_run_of_its_own_and_spoils_no_other(kept: KeptProcesses) -> None:
    with pytest.raises(SimulationError, match="no parameter r") as faulty:
        kept.run(DECK.format("1k\nX1 out part r=2\n.subckt part a\nR1 a 0 1\n.ends"), ["v(out)"], 1e-3)
    with pytest.raises(SimulationError, match=r"left out the vector v\(none\)") as caught:
        kept.run(DECK.format("1k"), ["v(none)"], 1e-3)
    for error in (faulty.value, caught.value):  # the netlists are kept
        assert error.deck is not None
        shutil.rmtree(error.deck.parent)
    assert kept.run(DECK.format("1k"), ["v(out)"], 1e-3).raw.points > 100


def test_a_run_whose_process_is_killed_is_repeated(kept: KeptProcesses) -> None:
    kept.run(DECK.format("1k"), ["v(out)"], 1e-3)
    kept._idle[0]._process.kill()
    assert kept.run(DECK.format("1k"), ["v(out)"], 1e-3).raw.points > 100


def test_an_ngspice_without_a_dialogue_runs_each_deck_in_a_process_of_its_own(
    kept: KeptProcesses, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[float] = []

    def refused(timeout: float) -> None:
        begun.append(timeout)
        raise SimulationError("ngspice ended.")

    monkeypatch.setattr(processes, "Pipe", refused)
    for _ in range(5):
        assert kept.run(DECK.format("1k"), ["v(out)"], 1e-3).raw.points > 100
    assert len(begun) == processes._MOST_FAILURES


def test_processes_end_with_the_one_that_keeps_them(tmp_path: Path) -> None:
    script = f"""
import sys, time
from pyspice_runner.spice.pipe import Pipe
from pyspice_runner.spice.kept_processes import KeptProcesses
with KeptProcesses() as kept:
    kept.run({DECK.format("1k")!r}, ["v(out)"], 1e-3)
    print(kept._idle[0]._process.pid, flush=True)
    time.sleep(60.0)
"""
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    owner = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment, text=True)
    assert owner.stdout is not None
    ours = int(owner.stdout.readline())
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    owner.stdout.close()
    ends = time.monotonic() + 20.0
    while time.monotonic() < ends:
        state = Path(f"/proc/{ours}/stat")
        if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("ngspice is still there")


def test_a_process_that_is_closed_twice_leaves_the_descriptors_of_others_open() -> None:
    pipe = Pipe(5.0)
    pipe.close()
    others = [os.open(os.devnull, os.O_RDONLY) for _ in range(8)]  # the lowest free numbers, with that of the terminal
    pipe.close()
    for one in others:
        os.close(one)  # an OSError if it is closed
