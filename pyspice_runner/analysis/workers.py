# SPDX-License-Identifier: GPL-3.0-or-later
"""Taking tasks through worker processes, or an executor of the user's, losing none to a worker's death."""

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

_TRIES = 2  # of a task whose worker dies, and of a pool that dies before any of its tasks is finished
_GRACE = 2.0  # s in which a worker that has lost its master stops ngspice and clears its files away


def outcomes(
    tasks: Mapping[str, Task], workers: int | None, executor: Executor | None
) -> Generator[tuple[str, Outcome]]:
    """Yield what came of each task, as it comes. What dying workers of our own leave behind is tried in fresh ones."""
    if workers is not None and workers < 1:
        raise ParameterError(f"workers = {workers} is refused; allowed is a whole number > 0.")
    number = min(workers or os.cpu_count() or 1, len(tasks))
    # No more in our own pool than it can take up at once: if a worker dies, all that is in the pool counts as lost.
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
                        waiting.append(address)  # one of these is to blame: when all others are done, each goes alone
                        continue
                fruitless = 0
                yield address, outcome
    for address in waiting:
        yield address, BrokenExecutor()


def _through(
    pool: Executor, tasks: Mapping[str, Task], waiting: deque[str], together: Callable[[str], int]
) -> Iterator[tuple[str, Outcome]]:
    """Take tasks that wait through a pool, so many together, until none waits or the pool is broken."""
    done: SimpleQueue[Future[dict[str, Any]]] = SimpleQueue()
    under_way: dict[Future[dict[str, Any]], str] = {}
    sound = True
    try:
        while True:
            while sound and waiting and len(under_way) < together(waiting[0]):
                # workers that this starts inherit the mask: Ctrl-C is the sweep's business, not theirs
                before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                try:
                    future = pool.submit(tasks[waiting[0]])
                except BrokenExecutor:
                    sound = False
                else:
                    under_way[future] = waiting.popleft()
                    future.add_done_callback(done.put)
                finally:
                    signal.pthread_sigmask(signal.SIG_SETMASK, before)
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
def _processes(number: int) -> Iterator[Executor]:
    """Worker processes that live no longer than they are needed, even if this process is killed."""
    theirs, ours = multiprocessing.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        number, multiprocessing.get_context("spawn"), initializer=_begin_worker, initargs=(theirs,)
    )
    try:
        yield pool
        pool.shutdown()
    finally:
        with held():  # who presses Ctrl-C twice would leave workers in the middle of their start
            ours.close()
            pool.shutdown(cancel_futures=True)
            theirs.close()


def _begin_worker(sweep_lives: Connection) -> None:
    """Let a worker end when its sweep does, in good order."""

    def watch() -> None:
        sweep_lives.poll(None)  # returns when the other end is closed, by whatever death
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)  # even while it waits for ngspice
        time.sleep(_GRACE)
        os._exit(1)

    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # a terminal that is closed is the sweep's business, too
        signal.signal(signal.SIGTERM, _end_task)  # which the pool sends to all when one of them is gone
        threading.Thread(target=watch, daemon=True).start()
    except SweepEnded:
        os._exit(1)


class SweepEnded(SystemExit):
    """The sweep that a worker belongs to has come to its end."""


def _end_task(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough: what follows is clearing away
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # an extension that is being loaded would complain of it
    raise SweepEnded(1)
