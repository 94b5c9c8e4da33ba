# SPDX-License-Identifier: GPL-3.0-or-later
"""ngspice as WebAssembly: its installation, and what differs from the native program."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pyspice_runner.errors import Interrupted, ParameterError, SimulationError
from pyspice_runner.spice import wasm
from pyspice_runner.spice.ngspice import ngspice_version, run_deck
from pyspice_runner.spice.process import KeptProcesses, Session
from tests.spice.test_process import DECK, STEPPED

ENDLESS = DECK.format("1k").replace(".tran 1u 1m 0 1u", ".tran 1u 1000 0 1u")


@pytest.fixture(autouse=True)
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The engine, with an empty place for its folders."""
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "wasm")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    yield
    wasm._end_idle()


def run(deck: str, **settings: object) -> dict[str, np.ndarray]:
    return dict(run_deck(deck, vectors=["v(out)"], **settings).raw.vectors)  # type: ignore[arg-type]


def test_both_engines_give_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """The steps are the same; solver and compiler differ, by some roundings of a value near 1."""
    deck = DECK.format("1k")
    with KeptProcesses() as kept:
        ours = [run(deck, stop_time=1e-3), run(deck, stop_time=1e-3, processes=kept)]
    assert run_deck(deck, vectors=[]).ngspice_version == ngspice_version() == "45.2 (WebAssembly)"
    assert sum(map(len, wasm.Batch._idle.values())) == 1
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "native")
    theirs = run(deck, stop_time=1e-3)
    for one in ours:
        np.testing.assert_allclose(one["v(out)"], theirs["v(out)"], rtol=0.0, atol=1e-12)


def test_a_session_gives_the_samples_of_the_native_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """This ngspice has a time point where it stops, 1e-9 before the sample; the error of a step is below 1e-6."""
    samples = []
    for choice in ("wasm", "native"):
        monkeypatch.setenv("PIEZOMOTOR_ENGINE", choice)
        with Session(STEPPED, ["v(out)"]) as session:
            session.advance(1e-3)
            session.alter("vin", 3.0)
            samples.append(session.advance(2e-3))
    assert samples[0] == pytest.approx(samples[1], rel=1e-6)


def test_a_timeout_or_an_interrupt_ends_it_and_keeps_what_was_written() -> None:
    with pytest.raises(SimulationError, match=r"did not finish within 0\.5 s"):
        run(ENDLESS, timeout=0.5)
    seen: list[float] = []

    def interrupt(reached: float) -> None:
        seen.append(reached)
        if len(seen) == 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(Interrupted) as caught:
        run(ENDLESS, stop_time=1000.0, progress=interrupt, keep_partial=True)
    assert 0.0 < seen[0] < seen[1]
    assert caught.value.partial.raw.points > 1000
    assert not any(wasm.Batch._idle.values())


def test_it_ends_with_a_process_that_is_killed(tmp_path: Path) -> None:
    script = "import sys; from pyspice_runner.spice.ngspice import run_deck; run_deck(sys.stdin.read(), vectors=[])"
    with subprocess.Popen(
        [sys.executable, "-c", script], env=os.environ | {"TMPDIR": str(tmp_path)}, stdin=subprocess.PIPE, text=True
    ) as owner:
        assert owner.stdin is not None
        owner.stdin.write(ENDLESS)
        owner.stdin.close()
        ends = time.monotonic() + 60.0
        while not list(tmp_path.glob("*/out.raw")) and time.monotonic() < ends:
            time.sleep(0.02)
        owner.kill()
    (raw,) = tmp_path.glob("*/out.raw")
    while time.monotonic() < ends:
        size = raw.stat().st_size
        time.sleep(0.3)
        if raw.stat().st_size == size:
            return
    pytest.fail("it still runs")


def test_a_process_that_was_killed_meanwhile_is_replaced() -> None:
    for _ in range(2):
        assert len(run(DECK.format("1k"))["time"]) > 100
        ((process, _),) = wasm.Batch._idle[os.getpid()]
        process.kill()
        process.wait()


def test_digital_parts_are_refused_before_the_run() -> None:
    with pytest.raises(SimulationError, match=r"digital part \(Abuf \[out\] \[d\] adc\)") as caught:
        run(DECK.format("1k\nAbuf [out] [d] adc\n.model adc adc_bridge"))
    assert "native ngspice" in str(caught.value)


def test_the_choice_of_an_engine_has_two_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "fast")
    with pytest.raises(ParameterError, match="PIEZOMOTOR_ENGINE is 'fast'; set it to native or wasm"):
        ngspice_version()


def test_without_a_native_one_it_is_used_where_it_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    node = wasm.find_node()
    monkeypatch.delenv("PIEZOMOTOR_ENGINE")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(wasm, "find_node", lambda: node)
    assert ngspice_version() == "45.2 (WebAssembly)"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(SimulationError, match=r"not on the PATH.*`pip install 'piezomotor\[engine\]'`"):
        ngspice_version()


def test_another_archive_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "engine.tgz").write_bytes(b"another")
    with pytest.raises(SimulationError, match=re.escape(f"not {wasm.SHA512} as {wasm.PACKAGE}: it is another version")):
        wasm.install(tmp_path / "engine.tgz")
    assert not list((tmp_path / "cache" / "piezomotor" / "engine").iterdir())
    with pytest.raises(SimulationError, match=r"Cannot install the engine: .*none\.tgz: No such file"):
        wasm.install(tmp_path / "none.tgz")


def test_without_a_network_npm_gives_a_way_round(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(wasm, "_npm", lambda: [sys.executable, "-c", "import sys; sys.exit('no route')"])
    with pytest.raises(SimulationError, match=r"no route.*`piezomotor engine install --from eecircuit-engine-1\.8\.0"):
        wasm.install()
