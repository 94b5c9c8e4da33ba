# SPDX-License-Identifier: GPL-3.0-or-later
"""Run tasks in worker processes, or in the user's executor; a worker that dies loses none of them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any

from pyspice_runner.errors import ParameterError
from pyspice_runner.interrupts import held

Task = Callable[[], dict[str, Any]]
Outcome = dict[str, Any] | BaseException

_TRIES = 2  # for a task whose worker dies, and for a pool that dies before it finishes a task
_SAFE_PATH = "PYTHONSAFEPATH"
_GRACE = 2.0  # s for a worker whose sweep has ended to stop ngspice and remove its files


def outcomes(
    tasks: Mapping[str, Task], workers: int | None, executor: Executor | None
) -> Generator[tuple[str, Outcome]]:
    """Yield the outcome of each task as it is finished; tasks of a dead worker process are tried again in new ones."""
    if workers is not None and workers < 1:
        raise ParameterError(f"workers = {workers} is not valid: it must be a whole number > 0.")
    number = min(workers or os.cpu_count() or 1, len(tasks))
    # Our own pool gets few tasks at a time: if a worker dies, all tasks in the pool are lost.
    ahead = 2 * number if executor is None else len(tasks)
    waiting = deque(tasks)
    deaths: Counter[str] = Counter()
    fruitless = 0
    while waiting and fruitless < _TRIES:
        fruitless += 1
        with _processes(number) if executor is None else nullcontext(executor) as pool:
            for address, outcome in _through(pool, tasks, waiting, lambda one: 1 if deaths[one] else ahead):
                if isinstance(outcome, BrokenExecutor | CancelledError):
                    deaths[address] += 1
                    if executor is None and deaths[address] < _TRIES:
                        waiting.append(address)  # one of these killed the worker: run each alone, after all others
                        continue
                fruitless = 0
                yield address, outcome
    for address in waiting:
        yield address, BrokenExecutor()


def _through(
    pool: Executor, tasks: Mapping[str, Task], waiting: deque[str], together: Callable[[str], int]
) -> Iterator[tuple[str, Outcome]]:
    """Run waiting tasks in a pool, a given number at a time, until none waits or the pool is broken."""
    done: SimpleQueue[Future[dict[str, Any]]] = SimpleQueue()
    under_way: dict[Future[dict[str, Any]], str] = {}
    sound = True
    try:
        while True:
            while sound and waiting and len(under_way) < together(waiting[0]):
                try:
                    with _start_of_workers():
                        future = pool.submit(tasks[waiting[0]])
                except BrokenExecutor:
                    sound = False
                else:
                    under_way[future] = waiting.popleft()
                    future.add_done_callback(done.put)
            if not under_way:
                return
            future = done.get()
            address = under_way.pop(future)
            outcome = CancelledError() if future.cancelled() else future.exception() or future.result()
            sound = sound and not isinstance(outcome, BrokenExecutor | CancelledError)
            yield address, outcome
    finally:
        for future in under_way:
            future.cancel()


@contextmanager
def _start_of_workers() -> Iterator[None]:
    """Set what the worker processes inherit that a pool starts within.

    SIGINT is blocked: only the sweep reacts to Ctrl-C. PYTHONSAFEPATH keeps the working directory out of a worker's
    module path until it has received that of this process; without it, Python would execute a file named signal.py or
    pickle.py there.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    safe_path = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if safe_path is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = safe_path
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _processes(number: int) -> Iterator[Executor]:
    """Worker processes that end with this process, even if it is killed."""
    theirs, ours = multiprocessing.Pipe(duplex=False)
    with _start_of_workers():  # multiprocessing's resource tracker starts here
        pool = ProcessPoolExecutor(
            number, multiprocessing.get_context("spawn"), initializer=_begin_worker, initargs=(theirs,)
        )
    try:
        yield pool
        pool.shutdown()
    finally:
        with held():  # a second Ctrl-C would leave workers that are just starting
            ours.close()
            pool.shutdown(cancel_futures=True)
            theirs.close()


def _begin_worker(sweep_lives: Connection) -> None:
    """Let a worker end when its sweep does, after it has stopped ngspice and removed its files."""

    def watch() -> None:
        sweep_lives.poll(None)  # returns when the other end is closed, however the sweep ended
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)  # even while it waits for ngspice
        time.sleep(_GRACE)
        os._exit(1)

    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # only the sweep reacts to a closed terminal
        signal.signal(signal.SIGTERM, _end_task)  # the pool sends it to all workers when one of them dies
        threading.Thread(target=watch, daemon=True).start()
    except SweepEnded:
        os._exit(1)


class SweepEnded(SystemExit):
    """The sweep of this worker has ended."""


def _end_task(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # ignored from now on, while files are removed
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # suppress the message of an extension whose import is interrupted
    raise SweepEnded(1)
