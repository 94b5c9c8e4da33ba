# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks in threads. While ngspice runs in one, Python works in another."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

Given = TypeVar("Given")
Found = TypeVar("Found")


def in_threads(task: Callable[[Given], Found], parts: Sequence[Given], workers: int) -> list[Found]:
    """Return the results of a task for each part, in a number of threads at a time; one worker needs no thread."""
    if min(workers, len(parts)) <= 1:
        return [task(part) for part in parts]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(task, parts))


def as_ready(
    task: Callable[[int], Found], needs: Sequence[Collection[int]], workers: int
) -> Iterator[tuple[int, Found]]:
    """Yield the numbers and results of tasks as they end, each begun after the tasks that it needs have been yielded.

    A task needs only tasks with smaller numbers.
    """
    if workers <= 1:
        yield from ((number, task(number)) for number in range(len(needs)))
        return
    waiting = {number: set(several) for number, several in enumerate(needs)}
    running: dict[Future[Found], int] = {}
    with ThreadPoolExecutor(workers) as pool:
        try:
            while waiting or running:
                for number in [one for one, several in waiting.items() if not several]:
                    del waiting[number]
                    running[pool.submit(task, number)] = number
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    ended = running.pop(future)
                    yield ended, future.result()
                    for several in waiting.values():
                        several.discard(ended)
        finally:
            for future in running:
                future.cancel()
