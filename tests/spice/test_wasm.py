# SPDX-License-Identifier: GPL-3.0-or-later
"""ngspice as WebAssembly: its installation, and what differs from the native program."""

import os
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from pyspice_runner.cli import run as command
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError
from pyspice_runner.result import leaves
from pyspice_runner.spice import wasm
from pyspice_runner.spice.ngspice import ngspice_version, run_deck
from pyspice_runner.spice.process import KeptProcesses
from tests.said import printed
from tests.spice.test_ngspice import ENDLESS, GOOD


@pytest.fixture(autouse=True)
def engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wasm._end_idle()  # of other tests
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "wasm")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


def run(deck: str, **settings: object) -> dict[str, np.ndarray]:
    return dict(run_deck(deck, vectors=["v(out)"], **settings).raw.vectors)  # type: ignore[arg-type]


def test_both_engines_give_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """The steps are the same; solver and compiler differ, by some roundings of a value near 1."""
    with KeptProcesses() as kept:
        ours = [run(GOOD, stop_time=1e-3), run(GOOD, stop_time=1e-3, processes=kept)]
    assert run_deck(GOOD, vectors=[]).ngspice_version == ngspice_version() == "45.2 (WebAssembly)"
    assert sum(map(len, wasm.Batch._idle.values())) == 1
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "native")
    theirs = run(GOOD, stop_time=1e-3)
    end = -2 if ngspice_version().startswith("47") else None  # which divides the last step otherwise
    for one in ours:
        np.testing.assert_allclose(one["v(out)"][:end], theirs["v(out)"][:end], rtol=0.0, atol=1e-12)


@pytest.mark.soak
@pytest.mark.parametrize("words", ["steady --speed 20", "speed-torque", "drive --rail 24 --stage full-bridge"])
def test_commands_print_the_same_numbers_with_both_engines(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Within 1e-6 of the maximum of a column, of 360° for phases: the weakest harmonics are of the size of rounding."""
    name, *others = words.split()
    found, columns = [], dict[str, list[tuple[float, float]]]()
    for engine in ("wasm", "native"):
        monkeypatch.setenv("PIEZOMOTOR_ENGINE", engine)
        found.append(dict(leaves(printed([name, "bimodal40", *others], capsys))))
    for path, value in found[0].items():
        if isinstance(value, int | float) and not re.search("seconds|multiplier", path):
            columns.setdefault(re.sub(r"\.\d+", "", path), []).append((value, found[1][path]))
    assert len(columns) > 50
    for column, pairs in columns.items():
        scale = 360.0 if column.endswith("_deg") else np.abs(pairs).max()
        np.testing.assert_allclose(*np.transpose(pairs), rtol=0.0, atol=1e-6 * scale, err_msg=column)


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


def test_a_process_that_was_killed_meanwhile_is_replaced() -> None:
    for _ in range(2):
        assert len(run(GOOD)["time"]) > 100
        (process,) = wasm.Batch._idle[os.getpid()]
        process.kill()
        process.wait()


def test_digital_parts_are_refused_before_the_run() -> None:
    with pytest.raises(SimulationError, match=r"digital part \(Abuf \[out\] \[d\] adc\).* native ngspice"):
        run(GOOD.replace(".save", "Abuf [out] [d] adc\n.model adc adc_bridge\n.save"))


def test_without_a_native_one_it_is_used_where_it_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    programs = wasm._node_and_npm()
    monkeypatch.delenv("PIEZOMOTOR_ENGINE")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(wasm, "_node_and_npm", lambda: programs)
    assert ngspice_version() == "45.2 (WebAssembly)"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(SimulationError, match=r"not on the PATH.*`pip install 'piezomotor\[engine\]'`"):
        ngspice_version()
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "fast")
    with pytest.raises(ParameterError, match="PIEZOMOTOR_ENGINE is 'fast'; set it to native or wasm"):
        ngspice_version()


def test_the_command_refuses_another_archive_and_names_a_way_without_a_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["engine", "--json"]) == 0
    assert capsys.readouterr().out == '{"ngspice": "45.2 (WebAssembly)"}\n'
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "engine.tgz").write_bytes(b"another")
    monkeypatch.setattr(wasm, "_node_and_npm", lambda: (None, [sys.executable, "-c", "raise SystemExit('no route')"]))
    for words, said in (
        (["--from", str(tmp_path / "engine.tgz")], f"not {wasm.FACTS['package_sha512_base64']} as {wasm.PACKAGE}"),
        (["--from", "none.tgz"], "the engine: none.tgz: No such file"),
        ([], "no route.* `piezomotor engine install --from eecircuit-engine-1.8.0.tgz`"),
    ):
        assert command(["engine", "install", *words]) == 3
        assert re.search(said.replace("+", r"\+"), " ".join(capsys.readouterr().err.split())), words
    assert not list((tmp_path / "piezomotor" / "engine").iterdir())
    with pytest.raises(SimulationError, match=r"npm could not load .* no route"):  # a page installs it by itself
        wasm.of_page()
    monkeypatch.setattr(wasm, "find_spec", lambda _: None)
    with pytest.raises(SimulationError, match=r"is not installed\. .*, then `piezomotor engine install`"):
        wasm.of_page()
