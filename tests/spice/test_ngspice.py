# SPDX-License-Identifier: GPL-3.0-or-later
"""The runner: only a verified run gives a result, and no run leaves files or processes behind."""

import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice import ngspice, process
from pyspice_runner.spice.ngspice import SpiceRun, find_ngspice, run_deck
from tests.processes import other_cache, working_in

GOOD = """a low-pass
V1 in 0 SIN(0 2 1k) AC 1
R1 in out 1k
C1 out 0 100n
.save v(out) i(v1)
.tran 1u 1m 0 1u
.end
"""
ENDLESS = GOOD.replace(".tran 1u 1m 0 1u", ".tran 1u 1000 0 1u")


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The place for temporary folders, empty at first."""
    place = tmp_path / "scratch"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    return place


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Put an ngspice on the PATH that does what a shell script says; its arguments are -b -n -r RAW DECK."""

    def install(script: str, version: str = "** ngspice-39.3 : Circuit level simulation program") -> Path:
        path = tmp_path / "bin" / "ngspice"
        path.parent.mkdir()
        path.write_text(f"#!/bin/sh\nif [ \"$1\" = --version ]; then echo '{version}'; exit 0; fi\n{script}\n")
        path.chmod(0o755)
        monkeypatch.setenv("PATH", f"{path.parent}{os.pathsep}{os.environ['PATH']}")
        monkeypatch.setenv("PIEZOMOTOR_ENGINE", "native")
        return path

    return install


def fails(deck: str, *, vectors: tuple[str, ...] = (), **arguments: float) -> SimulationError:
    """Run a deck that must fail, and return its error; only the deck may be kept."""
    with pytest.raises(SimulationError) as caught:
        run_deck(deck, vectors=vectors, **arguments)
    error = caught.value
    assert error.deck.read_text() == deck
    assert [path.name for path in error.deck.parent.iterdir()] == ["deck.cir"]
    assert str(error).endswith(f"The netlist is kept as {error.deck}.")
    return error


def message(error: SimulationError) -> str:
    """What the error says, without the place of the deck; one or two sentences."""
    text = re.sub(r" The netlist is kept as .*$", "", str(error))
    assert "\n" not in text
    assert len(text) < 400
    return text


def wait_until(condition: Callable[[], object], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


linux = pytest.mark.skipif(not Path("/proc/self/cwd").exists(), reason="looks for processes in /proc")


# --- a good run -------------------------------------------------------------------------------------------------


def test_a_good_run_gives_the_requested_vectors_and_leaves_no_files(scratch: Path) -> None:
    result = run_deck(GOOD, vectors=["v(out)", "i(v1)"], stop_time=1e-3)
    time_s, out = result.raw.vectors["time"], result.raw.vectors["v(out)"]
    assert result.raw.plot == "Transient Analysis"
    assert result.seconds > 0.0
    assert "No. of Data Rows" in result.log
    assert time_s[-1] == pytest.approx(1e-3)
    # first-order low-pass from its operating point: steady sine plus decaying exponential
    w, tau = 2e3 * np.pi, 1e-4
    gain = 2.0 / (1.0 + 1j * w * tau)
    exact = np.imag(gain * np.exp(1j * w * time_s)) - gain.imag * np.exp(-time_s / tau)
    # trapezoidal rule at 1000 points a period: (ωh)²/12 = 3e-6 of the amplitude, ngspice's tolerance is 1e-3
    np.testing.assert_allclose(out, exact, atol=1e-3)
    assert list(scratch.iterdir()) == []


def test_an_ac_analysis_and_an_operating_point_give_their_vectors(scratch: Path) -> None:
    ac = run_deck(GOOD.replace(".tran 1u 1m 0 1u", ".ac lin 3 500 1500"), vectors=["v(out)"], stop_frequency=1500.0)
    w = 2.0 * np.pi * np.array([500.0, 1000.0, 1500.0])
    np.testing.assert_allclose(ac.raw.vectors["v(out)"], 1.0 / (1.0 + 1e-4j * w), rtol=1e-12)
    op = run_deck("divider\nV1 in 0 3\nR1 in out 2k\nR2 out 0 1k\n.save v(out)\n.op\n.end\n", vectors=["v(out)"])
    np.testing.assert_allclose(op.raw.vectors["v(out)"], [1.0], rtol=1e-9)
    assert list(scratch.iterdir()) == []


def test_vectors_are_found_under_the_names_of_the_save_line() -> None:
    deck = GOOD.replace(".save v(out) i(v1)", ".save out V(In) v1#branch @r1[i]")
    raw = run_deck(deck, vectors=["out", "V(In)", "v1#branch", "@r1[i]"]).raw
    np.testing.assert_allclose(raw.find("@R1[I]"), -raw.find("V1#branch"), atol=1e-15)
    np.testing.assert_allclose(1e3 * raw.find("@r1[i]"), raw.find("in") - raw.find("v(out)"), atol=1e-12)
    assert raw.find("v1") is not None
    assert raw.find("nothing") is None


@pytest.mark.parametrize("word", ["error", "unknown", "warning", "fail", "singular", "aborted", "no such thing"])
def test_a_title_or_a_node_may_be_named_like_an_error_message(word: str) -> None:
    node = word.replace(" ", "_")
    deck = f"{word}: not found, too few\nV1 {node} 0 1\nR1 {node} 0 1k\n.save v({node})\n.tran 1u 10u\n.end\n"
    assert run_deck(deck, vectors=[f"v({node})"]).raw.points > 10


# --- what ngspice says, or does not say ----------------------------------------------------------------------


def deck(*lines: str, save: str = "v(a)", analysis: str = ".tran 1u 10u") -> str:
    return "\n".join(["a trap", *lines, f".save {save}", analysis, ".end", ""])


FLIP = "B1 b 0 V=V(a)>0.5 ? sgn(sin(1e9*V(b)*V(b)+1)-V(b)) : 0"  # has no solution once v(a) is above half a volt
SPOKEN = {
    "parallel voltage sources": (
        deck("V1 a 0 1", "V2 a 0 1", "R1 a 0 1"),
        ["ended with status 1", "singular matrix"],
    ),
    "node that hangs on capacitors: status 0": (
        deck("V1 v 0 1", "R1 v w 1", "C1 w a 1", "C2 a 0 1"),
        ["finished but complained", "singular matrix:  check node a"],
    ),
    "undefined model": (deck("V1 a 0 1", "D1 a 0 nomodel"), ["can't find model 'nomodel'"]),
    "undefined parameter": (deck("V1 a 0 1", "R1 a 0 {nothing}"), ["Undefined parameter [nothing]"]),
    "unknown parameter of a device": (deck("V1 a 0 1", "R1 a 0 1 foo=2"), ["unknown parameter (foo)"]),
    "names that differ in case only": (
        deck("V1 a 0 1", "Ga1 0 b a 0 1", "GA1 0 b a 0 1", "R1 b 0 1"),
        ["device already exists"],
    ),
    "parameter named like a keyword": (deck(".param dc=7", "V1 a 0 DC 1", "R1 a 0 1"), ["unknown parameter (1)"]),
    "initial condition on no node: status 0": (
        deck("V1 a 0 1", "R1 a 0 1", ".ic v(nono)=1"),
        ["finished but complained", "IC on non-existent node - nono, ignored"],
    ),
    "resistance left out: status 0": (deck("V1 a 0 1", "R1 a 0"), ["finished but complained", "r1"]),
    "measurement that is not made: status 0": (
        deck("V1 a 0 1", "R1 a 0 1", ".measure tran m FIND v(a) AT=5u"),
        ["finished but complained", "No .measure possible"],
    ),
    "bad vector in .control: status 0": (
        deck("V1 a 0 1", "R1 a 0 1", ".control", "run", "print v(nope)", ".endc"),
        ["finished but complained", "vector nope is not available"],
    ),
    "only bad vectors in .save": (
        deck("V1 a 0 1", "R1 a 0 1", save="v(nope)"),
        ["no data saved for Transient analysis"],
    ),
    "stopped by .control: status 0": (
        deck("V1 a 0 1", "R1 a 0 1", ".control", "stop when time > 5u", "run", "write out.raw v(a)", "quit", ".endc"),
        ["finished but complained", "run simulation interrupted"],
    ),
    "time step too small": (
        deck("I1 0 a 1m", "C1 a 0 1u ic=0", FLIP, "R1 a 0 1meg", "R2 b 0 1", analysis=".tran 1u 1m uic"),
        ["ended with status 1", "Timestep too small; time = 0.0005", 'trouble with node "b"'],
    ),
    "root of a negative number": (
        deck("V1 a 0 1", "R1 a 0 1", "B1 b 0 V=sqrt(-V(a))", "R2 b 0 1"),
        ["-1 out of range for sqrt"],
    ),
}


@pytest.mark.parametrize("name", SPOKEN)
def test_a_complaint_of_ngspice_is_an_error_that_quotes_it(name: str) -> None:
    netlist, words = SPOKEN[name]
    error = fails(netlist, vectors=("v(a)",), stop_time=10e-6)
    for word in words:
        assert word in message(error)
    assert words[-1] in error.log


def test_an_unknown_parameter_of_a_subcircuit_is_found_before_the_run_and_ngspice_ignores_it(tmp_path: Path) -> None:
    """The second is the reason for looking; should a later ngspice speak up, this says so."""
    netlist = deck(".subckt res p n r=1k", "R1 p n {r}", ".ends", "V1 a 0 1", "X1 a 0 res m=2 rr = {1 + (2==2)}")
    assert message(fails(netlist)) == (
        "Subcircuit res has no parameter rr, and ngspice would ignore it without a message on the line of x1; it has r."
    )
    (tmp_path / "deck.cir").write_text(netlist)
    done = subprocess.run(
        [find_ngspice(), "-b", "-n", "-r", "out.raw", "deck.cir"],
        cwd=tmp_path, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert not re.search("error|warning|unknown", done.stdout + done.stderr, re.IGNORECASE)


@pytest.mark.parametrize(
    "netlist",
    [
        deck(
            ".subckt res p n PARAMS: R=1k", "R1 p n {r}", ".ends",
            "V1 a 0 1", "X1 a 0 res r={1k + 2*(3 == 3)} m=2 ; rr=5", "* .options nonsense",
        ),
        deck("V1 a 0 1", "R1 a 0 1", ".control", "option nonsense", ".endc"),
    ],
)  # fmt: skip
def test_sound_decks_pass_the_check_before_the_run(netlist: str) -> None:
    assert run_deck(netlist, vectors=["v(a)"]).raw.points >= 3


def test_missing_vector_is_named() -> None:
    netlist = deck("V1 a 0 1", "R1 a 0 1", save="v(a) v(nope)")
    sentence = "ngspice left out the vector v(nope); check that the netlist has it."
    assert message(fails(netlist, vectors=("v(a)", "v(nope)"))) == sentence


@pytest.mark.parametrize("gain", ["1e16", "1e250"])
def test_values_that_are_not_finite_or_far_too_large_are_rejected(gain: str) -> None:
    netlist = deck("V1 v 0 1", "E1 a 0 v 0 1e90", f"E2 b 0 a 0 {gain}", "R1 b 0 1", save="v(a) v(b)", analysis=".op")
    assert message(fails(netlist, vectors=("v(a)", "v(b)"))) == (
        "ngspice gave values of v(b) that are not finite or exceed 1e+100."
    )


def test_analysis_must_reach_its_end() -> None:
    assert message(fails(GOOD, stop_time=2e-3)) == "ngspice stopped at 0.001 s, before the end at 0.002 s."
    # ngspice gives but one point where two are asked for
    two = deck("V1 a 0 AC 1", "R1 a 0 1", analysis=".ac lin 2 1k 2k")
    assert message(fails(two, stop_frequency=2e3)) == "ngspice stopped at 1000 Hz, before the end at 2000 Hz."
    # of a narrow sweep its round-off drops the last point, which is no failure; more than that is
    narrow = deck(
        "V1 a 0 AC 1", "R1 a 0 1", ".options reltol=1e-6", analysis=".ac lin 1201 24209288.774215207 24211126.85997644"
    )  # fmt: skip
    found = run_deck(narrow, vectors=["v(a)"], stop_frequency=24211126.85997644)
    assert found.raw.points == 1200
    assert message(fails(narrow, stop_frequency=24211132.0)).startswith("ngspice stopped at")


def test_another_analysis_than_expected_is_rejected() -> None:
    netlist = deck("V1 a 0 AC 1", "R1 a 0 1", analysis=".ac lin 3 1k 2k")
    assert message(fails(netlist, stop_time=1e-3)) == "ngspice gave no time; its result is 'AC Analysis'."


def test_no_analysis_and_two_analyses_are_rejected() -> None:
    none, two = deck("V1 a 0 AC 1", "R1 a 0 1", analysis=""), deck("V1 a 0 AC 1", "R1 a 0 1", ".op")
    assert "no raw file was written" in message(fails(none))
    assert "holds more than one analysis" in message(fails(two))


def test_error_survives_a_pickle() -> None:
    error = fails(SPOKEN["undefined model"][0])
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.deck, copy.log) == (str(error), error.deck, error.log)


# --- an ngspice that misbehaves ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("script", "sentence"),
    [
        (
            "echo halfway; kill -9 $$",
            'ngspice was killed by signal 9 (Killed), as the system does when memory runs out: "halfway".',
        ),
        ("echo 'Fatal error: no luck' >&2; exit 0", 'ngspice finished but complained: "Fatal error: no luck".'),
        ("exit 7", "ngspice ended with status 7."),
        (  # only the first lines are quoted
            'i=0; while [ $i -lt 2000 ]; do echo "warning $i: no"; i=$((i+1)); done',
            'ngspice finished but complained: "warning 0: no / warning 1: no / warning 2: no".',
        ),
        (r"printf 'error \377\n'", 'ngspice finished but complained: "error \N{REPLACEMENT CHARACTER}".'),
    ],
)
def test_what_goes_wrong_is_reported(script: str, sentence: str, fake: Callable[..., Path]) -> None:
    fake(script)
    assert message(fails(GOOD)) == sentence


def test_complaint_late_in_a_long_log_is_heard(fake: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    fake("yes 'all is well' | head -c 2000000; echo; echo 'error at the end'")
    assert 'complained: "error at the end"' in message(fails(GOOD))
    monkeypatch.setattr(ngspice, "_LONGEST_LOG", 1 << 20)
    assert message(fails(GOOD)) == "ngspice wrote a log of more than 1 MiB, too long to be checked."


@pytest.mark.parametrize(
    ("cut", "sentence"),
    [
        ("head -c -8", "ngspice gave no usable result: the raw file is cut short: it announces 3 points of 2 vectors."),
        ("head -c 60", "ngspice gave no usable result: the raw file has no binary part."),
        ("head -c 0", "ngspice gave no usable result: the raw file has no binary part."),
        ("sed s/Points:.3/Points:_0/", "ngspice gave no usable result: the raw file's header is broken."),
        ("sed 's/Points: 3/Points: 0/'", "ngspice gave no usable result: the raw file holds no points."),
    ],
)
def test_a_truncated_result_is_rejected(cut: str, sentence: str, fake: Callable[..., Path]) -> None:
    real = find_ngspice()
    fake(f'{real} "$@" && {cut} out.raw > cut && mv cut out.raw')
    netlist = deck("V1 a 0 AC 1", "R1 a 0 1", save="v(a) v(a)", analysis=".ac lin 3 1 3")
    assert message(fails(netlist)) == sentence


@linux
@pytest.mark.parametrize(
    ("advance", "says"), [("4.0000%03de-10", "become too small at 4e-10 s of 0.001 s"), ("%03de-6", "ended with")]
)
def test_a_transient_that_hardly_advances_is_stopped(
    advance: str, says: str, fake: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In 0.5 s the first run advances by 1e-16 s of 1 ms, the second by 10 µs."""
    monkeypatch.setattr(ngspice, "_PATIENCE", 0.5)
    reports = f"printf ' Reference value :  {advance}\\r' $i; i=$((i+1)); sleep 0.05"
    fake(f"i=100; while [ $i -lt 200 ]; do {reports}; done; exit 1")
    assert says in message(fails(GOOD, stop_time=1e-3))


@linux
def test_timeout_ends_ngspice_and_its_children(fake: Callable[..., Path], scratch: Path) -> None:
    fake("sleep 300 & wait")
    started = time.monotonic()
    assert message(fails(GOOD, timeout=0.3)) == "ngspice did not finish within 0.3 s and was stopped."
    assert time.monotonic() - started < 100.0  # and not the 300 s that its child sleeps
    wait_until(lambda: not working_in(scratch))  # a killed grandchild is reaped by init in its own time


RUN = "run_deck(sys.stdin.read(), vectors=[])"
RUN_IN_A_THREAD = (
    "thread = threading.Thread(target=run_deck, args=[sys.stdin.read()], kwargs={'vectors': []})\n"
    "thread.start()\nthread.join()"  # after its main thread Python 3.12.1 starts no other one
)


@linux
@pytest.mark.parametrize(
    ("run", "number", "last", "engine"),
    [
        (RUN, signal.SIGINT, "KeyboardInterrupt", "native"),
        (RUN, signal.SIGTERM, "", "native"),
        # as steady states of several points; no thread is told of the signal
        (RUN_IN_A_THREAD, signal.SIGTERM, "", "native"),
        (RUN_IN_A_THREAD, signal.SIGTERM, "", "wasm"),
    ],
)
def test_a_signal_to_a_script_ends_ngspice(
    run: str, number: signal.Signals, last: str, engine: str, scratch: Path
) -> None:
    script = (
        "import signal, sys, threading; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"from pyspice_runner.spice.ngspice import run_deck\n{run}\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], env=os.environ | {"TMPDIR": str(scratch), "PIEZOMOTOR_ENGINE": engine},
        stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as python:  # fmt: skip
        try:
            python.stdin.write(ENDLESS)
            python.stdin.close()
            wait_until(lambda: any(folder.joinpath("out.raw").exists() for folder in scratch.iterdir()))
            assert working_in(scratch)
            python.send_signal(number)
            assert python.wait(timeout=60) == -number
            assert python.stderr.read().rstrip().endswith(last)
            wait_until(lambda: not working_in(scratch))
        finally:  # what a test that failed leaves behind would run for hours
            python.kill()
            for left in working_in(scratch):
                os.kill(left, signal.SIGKILL)
    assert run == RUN_IN_A_THREAD or list(scratch.iterdir()) == []


# --- the world around it -------------------------------------------------------------------------------------


def test_concurrent_runs_do_not_meet(scratch: Path) -> None:
    def run(volts: int) -> SpiceRun | str:
        netlist = deck(f"V1 a 0 {volts}", "R1 a 0 1", *(["X1 a nosub"] if volts % 5 == 0 else []))
        try:
            return run_deck(netlist, vectors=["v(a)"], stop_time=10e-6)
        except SimulationError as error:
            return error.deck.read_text() if error.deck else ""

    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(run, range(1, 41)))
    for volts, result in enumerate(results, start=1):
        if volts % 5 == 0:
            assert isinstance(result, str)
            assert f"V1 a 0 {volts}\n" in result
        else:
            assert isinstance(result, SpiceRun)
            assert set(result.raw.vectors["v(a)"]) == {float(volts)}
    assert len(list(scratch.iterdir())) == 8  # the decks that failed


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A home and a working directory with a start-up file that spoils every run."""
    place = tmp_path / "home"
    place.mkdir()
    (place / ".spiceinit").write_text("echo hello from spiceinit\nquit\n")
    monkeypatch.setenv("XDG_CACHE_HOME", other_cache(tmp_path))  # the engine is below HOME otherwise
    monkeypatch.setenv("HOME", str(place))
    monkeypatch.chdir(place)
    return place


def test_start_up_file_of_a_user_is_not_read(home: Path) -> None:
    (home / "deck.cir").write_text(GOOD)
    plain = subprocess.run(
        [find_ngspice(), "-b", "deck.cir"], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )
    assert "hello from spiceinit" in plain.stdout + plain.stderr  # it would be
    result = run_deck(GOOD, vectors=["v(out)"], stop_time=1e-3)
    assert "hello" not in result.log


def test_the_users_environment_does_not_reach_ngspice(
    fake: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("LC_NUMERIC", "LC_ALL", "LANG"):
        monkeypatch.setenv(name, "de_DE.UTF-8")
    for name in ("SPICE_LIB_DIR", "SPICE_SCRIPTS", "SPICE_ASCIIRAWFILE", "NGSPICE_INPUT_DIR"):
        monkeypatch.setenv(name, "1")
    assert run_deck(GOOD, vectors=["v(out)"], stop_time=1e-3).raw.points > 100
    fake("env; echo error")
    seen = [line for line in fails(GOOD).log.splitlines() if line.startswith(("LC_", "SPICE", "NGSPICE"))]
    assert seen == ["LC_ALL=C"]


def test_an_entry_of_path_may_be_relative(
    fake: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = find_ngspice()
    fake(f'exec {real} "$@"')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"bin{os.pathsep}{os.environ['PATH']}")
    assert find_ngspice() == str(tmp_path / "bin" / "ngspice")
    assert run_deck(GOOD, vectors=("v(out)",)).raw.points > 100


@pytest.mark.parametrize(
    ("version", "sentence"),
    [
        ("** ngspice-34 : Circuit level", "ngspice 34 is too old; version 36 or later is needed."),
        ("I am a fish", "does not state its version. It says 'I am a fish'. Install it:"),
    ],
)
def test_an_unsuitable_ngspice_is_rejected(version: str, sentence: str, fake: Callable[..., Path]) -> None:
    fake("exit 0", version=version)
    with pytest.raises(SimulationError, match=re.escape(sentence)):
        run_deck(GOOD, vectors=[])


def test_an_ngspice_that_does_not_run_is_reported(fake: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = fake("exit 0")
    path.write_text("#!/nowhere/sh\n")
    with pytest.raises(SimulationError, match=r"does not run: .* Install it:"):
        run_deck(GOOD, vectors=[])
    monkeypatch.setattr(process, "_VERSION_TIMEOUT", 0.2)
    path.write_text("#!/bin/sh\nexec sleep 300\n")
    with pytest.raises(SimulationError, match=r"does not run: .*timed out"):
        run_deck(GOOD, vectors=[])


def test_a_vanished_temporary_folder_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(SimulationError) as caught:
        run_deck(GOOD, vectors=[])
    assert str(caught.value) == "Cannot write the netlist: No such file or directory. Free some space or set TMPDIR."


def test_a_full_disk_is_reported(monkeypatch: pytest.MonkeyPatch, scratch: Path) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(SimulationError, match=r"No space left on device\. Free some space or set TMPDIR\."):
        run_deck(GOOD, vectors=[])
    assert list(scratch.iterdir()) == []
