# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals wait where they would do harm, and are raised where they do not."""

from __future__ import annotations

import signal
import sys
import threading
import weakref
from collections.abc import Iterator

import pytest

from pyspice_runner.interrupts import Stopped, held, raised


@pytest.fixture(autouse=True)
def _as_python_has_it() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def press() -> None:
    signal.raise_signal(signal.SIGINT)


def test_what_is_held_is_raised_at_the_end() -> None:
    done = []

    def steps() -> None:
        with held():
            press()
            done.append("the rest")

    with pytest.raises(KeyboardInterrupt):
        steps()
    assert done == ["the rest"]


def test_where_it_listens_it_is_raised_at_once() -> None:
    done = []

    def steps() -> None:
        with held() as listening:
            try:
                with listening():
                    press()
                    done.append("not this")
            finally:
                press()  # a second one waits again
                done.append("cleared away")

    with pytest.raises(KeyboardInterrupt):
        steps()
    assert done == ["cleared away"]


def test_what_came_before_it_listens_is_raised_when_it_does() -> None:
    done = []

    def steps() -> None:
        with held() as listening:
            press()
            done.append("before")
            with listening():
                done.append("not this")

    with pytest.raises(KeyboardInterrupt):
        steps()
    assert done == ["before"]


def test_a_handler_of_ones_own_is_held_too() -> None:
    came = []
    before = signal.signal(signal.SIGTERM, lambda *_: came.append("ended"))
    try:
        with held():
            signal.raise_signal(signal.SIGTERM)
            came.append("first")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert came == ["first", "ended"]


def test_other_threads_have_nothing_to_hold() -> None:
    done = []

    def work() -> None:
        with raised(), held() as listening, listening():
            done.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.default_int_handler]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_command_is_told_which_signal_came(number: signal.Signals) -> None:
    with pytest.raises(Stopped) as stopped, raised():
        signal.raise_signal(number)
    assert stopped.value.number == number


def test_a_signal_that_is_ignored_stays_so() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with raised():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_extension_that_fails_for_it_is_no_other_fault() -> None:
    def load() -> None:
        try:
            press()
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from interrupt

    with pytest.raises(Stopped), raised():
        load()
    with pytest.raises(ImportError), raised():
        raise ImportError("not there")


def test_in_a_finaliser_it_comes_again() -> None:
    class Thing:
        pass

    def wait() -> None:
        weakref.finalize(Thing(), press)  # which is gone at once
        threading.Event().wait(60.0)

    complain = sys.unraisablehook
    with pytest.raises(Stopped), raised():
        wait()
    assert sys.unraisablehook is complain
