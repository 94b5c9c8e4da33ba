# SPDX-License-Identifier: GPL-3.0-or-later
"""Run tasks in worker processes or in the user's executor. A dead worker loses no task.

The calling thread watches each worker over its own pipe. ProcessPoolExecutor has a thread and locks of its own; on
Python 3.13 it can hang after a worker is killed.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

from pyspice_runner.errors import require
from pyspice_runner.interrupts import TERMINAL, held, to_main_thread

Task = Callable[[], dict[str, Any]]
Outcome = dict[str, Any] | BaseException

_TRIES = 2  # for each task
_MOST_DEATHS = 8  # consecutive deaths after which the remaining tasks are given up
_SAFE_PATH = "PYTHONSAFEPATH"
_MASKS = hasattr(signal, "pthread_sigmask")  # not in Windows
_GRACE = 5.0  # s for a worker whose sweep has ended to stop ngspice and remove its files
_LONGEST_END = 20.0  # s for a worker to end, including the imports of one that is just starting


def outcomes(
    tasks: Mapping[str, Task], workers: int | None, executor: Executor | None
) -> Generator[tuple[str, Outcome]]:
    """Yield the outcome of each task on completion. The task of a dead worker process is repeated once."""
    require(workers is None or workers >= 1, "workers", workers, "a whole number > 0")
    if executor is not None:
        yield from _by_executor(tasks, executor)
    elif tasks:
        yield from _by_processes(tasks, min(workers or os.cpu_count() or 1, len(tasks)))


def _by_executor(tasks: Mapping[str, Task], executor: Executor) -> Iterator[tuple[str, Outcome]]:
    """Run tasks in the user's executor, without retries."""
    under_way: dict[Future[dict[str, Any]], str] = {}
    try:
        for address, task in tasks.items():
            try:
                with _start_of_workers():
                    under_way[executor.submit(task)] = address
            except BrokenExecutor as error:
                yield address, error
        for future in as_completed(under_way):
            address = under_way.pop(future)
            yield address, CancelledError() if future.cancelled() else future.exception() or future.result()
    finally:
        for future in under_way:
            future.cancel()


def _by_processes(tasks: Mapping[str, Task], number: int) -> Iterator[tuple[str, Outcome]]:
    """Run tasks in a number of worker processes."""
    waiting = deque(tasks)
    deaths: Counter[str] = Counter()
    in_a_row = 0
    # a worker executes the user's script only for a function or a class of it; one without a guard would sweep again
    of_script = b"__main__" in pickle.dumps(next(iter(tasks.values())))
    with _processes(sys.modules["__main__"] if of_script else ModuleType("__main__")) as start:
        idle: list[Connection] = []
        busy: dict[Connection, str] = {}
        while in_a_row < _MOST_DEATHS and (waiting or busy):
            # a task whose worker died may be short of memory: run it alone, last
            while waiting and len(busy) < (1 if deaths[waiting[0]] else number):
                worker, address = idle.pop() if idle else start(), waiting.popleft()
                with suppress(OSError):  # a dead worker: _receive sees the closed pipe
                    worker.send(tasks[address])
                busy[worker] = address
            ready = wait(list(busy)) if busy else []
            for worker in [one for one in busy if one in ready]:
                address, outcome = busy.pop(worker), _receive(worker)
                in_a_row = in_a_row + 1 if outcome is None else 0
                if outcome is not None:
                    idle.append(worker)
                    yield address, outcome
                elif deaths[address] + 1 < _TRIES:
                    deaths[address] += 1
                    waiting.append(address)
                else:
                    yield address, BrokenExecutor()
        for address in [*busy.values(), *waiting]:
            yield address, BrokenExecutor()


def _receive(worker: Connection) -> Outcome | None:
    """Return the outcome from a worker, or ``None`` if the worker is dead."""
    try:
        answer = worker.recv_bytes()
    except (EOFError, OSError):
        worker.close()
        return None
    try:
        outcome: Outcome = pickle.loads(answer)
    except Exception as error:  # noqa: BLE001 # as of an exception whose arguments are not those of its class
        return error
    return outcome


@contextmanager
def _start_of_workers() -> Iterator[None]:
    """Set the environment that new worker processes inherit.

    SIGINT is blocked where the system can do that: only the sweep reacts to Ctrl-C. PYTHONSAFEPATH keeps the working
    directory out of a worker's module path until it has the path of this process; without it, Python would execute a
    file named signal.py or pickle.py there.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if _MASKS else set()
    safe_path = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if safe_path is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = safe_path
        if _MASKS:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _processes(script: ModuleType) -> Iterator[Callable[[], Connection]]:
    """Yield a function that starts a worker process, which executes the file of a script if the module has one.

    All workers end with this process, even if it is killed.
    """
    spawn = multiprocessing.get_context("spawn")
    theirs, ours = spawn.Pipe(duplex=False)
    with _start_of_workers():
        if _MASKS:  # Windows has no such process
            resource_tracker.ensure_running()  # it unblocks SIGINT, so not at the start of the first worker
    started: list[tuple[BaseProcess, Connection]] = []

    def start() -> Connection:
        here, there = spawn.Pipe()
        with held(), _start_of_workers():
            process = spawn.Process(target=_work, args=(there, theirs))
            own, sys.modules["__main__"] = sys.modules["__main__"], script
            try:
                process.start()
            finally:
                sys.modules["__main__"] = own
            started.append((process, here))
        there.close()
        return here

    def end() -> None:
        for _, connection in started:
            connection.close()
        for process, _ in started:
            process.join(_LONGEST_END)

    try:
        yield start
        end()
    finally:
        with held():  # a second Ctrl-C would leave workers that are just starting
            ours.close()
            end()
            for process, _ in started:
                process.kill()
                process.join()
            theirs.close()


def _work(tasks: Connection, sweep_lives: Connection) -> None:
    """Run tasks until the pipe closes. If the sweep ends first, stop ngspice, remove its files and exit."""

    def watch() -> None:
        with suppress(OSError):  # Windows raises one where the pipe is closed already
            sweep_lives.poll(None)  # returns when the other end is closed, however the sweep ended
        to_main_thread(signal.SIGTERM)  # even while it waits for ngspice
        time.sleep(_GRACE)
        os._exit(1)

    try:
        for number in TERMINAL:  # only the sweep reacts to Ctrl-C and a closed terminal
            signal.signal(number, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, _end_task)
        threading.Thread(target=watch, daemon=True).start()
        while True:
            tasks.send_bytes(_answer(tasks.recv_bytes()))
    except (EOFError, OSError):  # the sweep has no more tasks, or has ended
        return
    except SweepEnded:
        os._exit(1)


def _answer(task: bytes) -> bytes:
    """Return the pickled outcome of a pickled task."""
    outcome: Outcome
    try:
        outcome = pickle.loads(task)()
    except SweepEnded:
        raise
    except BaseException as error:  # noqa: BLE001 # the sweep reports it
        outcome = error
    try:
        return pickle.dumps(outcome)
    except Exception as error:  # noqa: BLE001 # pickle raises what the outcome raises
        return pickle.dumps(RuntimeError(f"{outcome!r} cannot be pickled: {error}"))


class SweepEnded(SystemExit):
    """The sweep of this worker has ended."""


def _end_task(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # ignored from now on, while files are removed
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # suppress the message of an extension whose import is interrupted
    raise SweepEnded(1)
