# SPDX-License-Identifier: GPL-3.0-or-later
"""The answers to the points of a sweep: from the store, from runs that points share, and from workers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing
from typing import Any

from pyspice_runner.motor.drive import Drive
from pyspice_runner.run.paths import unknown
from pyspice_runner.steady.speed_torque import held_point, held_points
from pyspice_runner.sweeps.store import Store
from pyspice_runner.sweeps.task import Task
from pyspice_runner.sweeps.workers import outcomes

Quantity = str | Callable[[Any], float]

BATCH = 64  # operating points that are solved together, and stored
FLAGS = {  # kept of every point beside the quantities, where the analysis has them; 1 is yes, 0 is no
    "settled": "whether the means are settled",
    "accurate": "whether the estimated error is allowed",
}


def answers_to(
    tasks: Mapping[str, Task],
    picked: Callable[[Mapping[str, Any]], dict[str, Any]],
    store: Store,
    workers: int | None,
    executor: Executor | None,
    progress: Callable[[int, int], None],
) -> tuple[dict[str, dict[str, Any]], dict[str, BaseException]]:
    """Return by address what the points gave, and why others failed: out of the store, or worked out and stored."""
    stored = {address: store.get(task.content) for address, task in tasks.items()}
    found = {address: picked(result) for address, result in stored.items() if result is not None}
    failed: dict[str, BaseException] = {}
    progress(len(found), len(tasks))
    missing = {address: task for address, task in tasks.items() if address not in found}
    try:
        if executor is None:
            for address, answer in _together(missing):
                store.put(tasks[address].content, answer)
                found[address] = picked(answer)
                del missing[address]
                progress(len(found), len(tasks))
        with closing(outcomes(missing, workers, executor)) as answers:
            for address, outcome in answers:
                if isinstance(outcome, BaseException):
                    failed[address] = outcome
                else:
                    store.put(tasks[address].content, outcome)
                    found[address] = picked(outcome)
                progress(len(found) + len(failed), len(tasks))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"{len(found)} of {len(tasks)} points are finished and kept in {store.folder}; "
            "start the same sweep again to continue it"
        ) from None
    return found, failed


def _together(tasks: Mapping[str, Task]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the answers of operating points with a stable steady state, which share runs of ngspice."""
    batched = [
        (address, task, task.drive) for address, task in tasks.items()
        if task.analysis is held_point and isinstance(task.drive, Drive)
        and task.run.get("mode", "steady") == "steady" and task.run.get("audit", True)
    ]  # fmt: skip
    for begin in range(0, len(batched), BATCH):
        batch = batched[begin : begin + BATCH]
        results = held_points([(task.motor, drive, task.run) for _, task, drive in batch])
        for (address, task, _), result in zip(batch, results, strict=True):
            if result is not None:
                yield address, task.answer(result)


def picked_from(result: Mapping[str, Any], wanted: Mapping[str, Quantity]) -> dict[str, Any]:
    """Return the wanted quantities and the hash of the deck. Raise ParameterError if there is no such quantity."""
    numbers = result["numbers"]
    values: dict[str, Any] = {"deck_sha256": result["deck_sha256"], "cautions": result["cautions"]}
    values |= {name: numbers[name] for name in FLAGS if name in numbers and name not in wanted}
    for name, source in wanted.items():
        key = source if isinstance(source, str) else name
        if key not in numbers:
            inputs = ("motor.", "drive.", "run.")
            raise unknown(key, [known for known in numbers if not known.startswith(inputs)], "quantity")
        values[name] = numbers[key]
    return values
