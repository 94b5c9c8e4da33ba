# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals are held back within steps that belong together, and raised elsewhere."""

import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from pyspice_runner.commands import common
from pyspice_runner.interrupts import Stopped, held, raised


@pytest.fixture(autouse=True)
def _pythons_own_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def press() -> None:
    signal.raise_signal(signal.SIGINT)


def at_the_end(done: list[str]) -> None:
    with held():
        press()
        done.append("the rest")


def at_once_while_listening(done: list[str]) -> None:
    with held() as listening:
        try:
            with listening():
                press()
                done.append("not this")
        finally:
            press()  # a second signal is held again
            done.append("cleared away")


def when_listening_begins(done: list[str]) -> None:
    with held() as listening:
        press()
        done.append("before")
        with listening():
            done.append("not this")


@pytest.mark.parametrize(
    ("steps", "expected"),
    [(at_the_end, "the rest"), (at_once_while_listening, "cleared away"), (when_listening_begins, "before")],
)
def test_a_held_signal_is_raised(steps: Callable[[list[str]], None], expected: str) -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        steps(done)
    assert done == [expected]


def test_a_handler_of_the_user_is_held_too() -> None:
    came = []
    before = signal.signal(signal.SIGTERM, lambda *_: came.append("ended"))
    try:
        with held():
            signal.raise_signal(signal.SIGTERM)
            came.append("first")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert came == ["first", "ended"]


def test_other_threads_hold_nothing() -> None:
    done = []

    def work() -> None:
        with raised(), held() as listening, listening():
            done.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.default_int_handler]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_exception_has_the_number_of_the_signal(number: signal.Signals) -> None:
    with pytest.raises(Stopped) as stopped, raised():
        signal.raise_signal(number)
    assert stopped.value.number == number


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with raised():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_import_error_caused_by_a_signal_is_an_interrupt() -> None:
    def load() -> None:
        try:
            press()
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from interrupt

    with pytest.raises(Stopped), raised():
        load()
    with pytest.raises(ImportError), raised():
        raise ImportError("not there")


def test_a_signal_in_a_finaliser_is_raised_again() -> None:
    class Thing:
        pass

    def wait() -> None:
        weakref.finalize(Thing(), press)  # which is gone at once
        threading.Event().wait(60.0)

    complain = sys.unraisablehook
    with pytest.raises(Stopped), raised():
        wait()
    assert sys.unraisablehook is complain


def test_a_signal_that_is_back_before_the_hook_has_ended_is_raised_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a busy machine, where the thread that sends it runs before the one that has started it."""
    start, late = threading.Timer.start, [0.05]

    def slow(timer: threading.Timer) -> None:
        start(timer)
        if late:
            time.sleep(late.pop())  # longer than the delay of the signal

    monkeypatch.setattr(threading.Timer, "start", slow)
    test_a_signal_in_a_finaliser_is_raised_again()
    assert not late


def test_a_signal_while_a_finished_file_is_noted_keeps_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, plain = tmp_path / "run.csv", Path.stat

    def stat(path: Path, **how: Any) -> Any:
        found = plain(path, **how)
        if path == file:
            press()
        return found

    monkeypatch.setattr(Path, "stat", stat)
    monkeypatch.setattr(common, "written", [])
    with pytest.raises(KeyboardInterrupt):
        common.deliver({}, "", False, (file, lambda path: path.write_text("1", encoding="utf-8")))
    assert common.written == [str(file)]
