# SPDX-License-Identifier: GPL-3.0-or-later
"""The harness of the validation campaigns: run the cases, record each at once, resume, summarise, judge.

The outcomes are lines of ``records/NAME.jsonl``, one case each, so that an interrupted campaign can be resumed; the
summary is ``records/NAME.json``, from which the tables of the pages are written.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Case = dict[str, Any]
Key = int | str
RECORDS = Path(__file__).with_name("records")


def always(_: Mapping[str, Any]) -> bool:
    """Return ``True``: every case counts, every summary passes."""
    return True


@dataclass(frozen=True)
class Campaign:
    """Many cases of one question.

    Attributes:
        name: of its records, ``records/NAME.jsonl`` and ``records/NAME.json``.
        outcome: runs a case and returns its JSON-ready outcome; ``None`` if what was drawn has none. A function of a
            module, so that worker processes can import it.
        summary: returns the counts of the outcomes, JSON-ready.
        passes: whether a summary shows what it must; otherwise the exit status is 1.
        count: default number of cases.
        counts: whether an outcome counts towards the number of cases.
        keys: the cases, in order; by default 0, 1, 2, …
    """

    name: str
    outcome: Callable[[Any], Case | None]
    summary: Callable[[Sequence[Case]], dict[str, Any]]
    passes: Callable[[Mapping[str, Any]], bool] = always
    count: int = 100
    counts: Callable[[Mapping[str, Any]], bool] = always
    keys: Callable[[], Iterable[Key]] = itertools.count

    @property
    def record(self) -> Path:
        """The file of the outcomes."""
        return RECORDS / f"{self.name}.jsonl"

    def cases(self) -> list[Case]:
        """Return the recorded outcomes, without the cases that have none."""
        return [one for one in self._recorded().values() if "skipped" not in one]

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run the cases that are not recorded yet, and print the summary. Return the exit status."""
        parser = argparse.ArgumentParser(prog=f"python -m validation.{self.name}")
        parser.add_argument("--count", type=int, default=self.count, help="number of cases")
        parser.add_argument("--seconds", type=float, default=float("inf"), help="time after which no case starts")
        parser.add_argument("--workers", type=int, default=1, help="processes that run cases at the same time")
        parser.add_argument("--case", help="run this case only, show its outcome and record nothing")
        chosen = parser.parse_args(arguments)
        if chosen.case is not None:
            key = int(chosen.case) if chosen.case.lstrip("-").isdigit() else chosen.case
            print(json.dumps(self.outcome(key), indent=1, ensure_ascii=False))
            return 0
        self._run(chosen.count, chosen.seconds, chosen.workers)
        table = self.summary(self.cases())
        text = json.dumps(table, indent=1, ensure_ascii=False)
        self.record.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
        print(text)
        return 0 if self.passes(table) else 1

    def _recorded(self) -> dict[Key, Case]:
        lines = self.record.read_text(encoding="utf-8").splitlines() if self.record.exists() else []
        return {one["index"]: one for one in map(json.loads, lines)}

    def _run(self, number: int, seconds: float, workers: int) -> None:
        done = self._recorded()
        counted = sum(self.counts(one) for one in done.values() if "skipped" not in one)
        following = (key for key in self.keys() if key not in done)
        deadline = time.monotonic() + seconds
        outcomes = self._outcomes(following, workers)
        with self.record.open("a", encoding="utf-8") as stream:
            while counted < number and time.monotonic() < deadline:
                key, found = next(outcomes, (None, None))
                if key is None:
                    break
                one = {"index": key, **({"skipped": True} if found is None else found)}
                stream.write(json.dumps(one, separators=(",", ":"), ensure_ascii=False) + "\n")
                stream.flush()
                print(json.dumps(one, ensure_ascii=False)[:200], flush=True)
                counted += found is not None and self.counts(one)

    def _outcomes(self, keys: Iterator[Key], workers: int) -> Iterator[tuple[Key, Case | None]]:
        """Yield key and outcome of each case as it ends."""
        if workers == 1:
            yield from ((key, self.outcome(key)) for key in keys)
            return
        with ProcessPoolExecutor(workers) as pool:
            running = {pool.submit(self.outcome, key): key for key in itertools.islice(keys, workers)}
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
                    running |= {pool.submit(self.outcome, key): key for key in itertools.islice(keys, 1)}
