# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of random motors: ``python -m tests.soak --count 2000``, or ``make soak``.

Motors and drives are drawn over the whole range that every parameter is allowed, by its declaration; what the model
refuses for a relation between parameters is drawn anew. Each valid one must give a result that passes the physical
audit, or a ``SimulationError`` that names its cause. What came of a case is written down as soon as it is known, so
that an interrupted soak goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

import pyspice_runner as pr
from pyspice_runner.analysis.dynamometer import Bench, uniform_step
from pyspice_runner.analysis.simulate import POINTS_PER_PERIOD, shortest_period
from pyspice_runner.engine.ngspice import ngspice_version
from pyspice_runner.model.drive import Drive, check_together, free_tip
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import Contact, Mode, Parameters, Piezo, Rotor

RESULT = Path(__file__).with_suffix(".json")
COUNT, SEED = 2000, 7
LONGEST = 120.0  # s of wall time that a case may take; longer is a hang
FEWEST_STEPS, MOST_STEPS = 400, 4000
_DECADES = 8.0  # below the greatest value, where a range includes zero
_TRIES = 3000
DRIVES: tuple[type[Drive], ...] = (pr.TwoPhaseDrive, pr.TwoToneDrive)


# --- what is drawn -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One motor, its drive, and the question put to it."""

    motor: Motor
    drive: Drive
    question: str
    settings: dict[str, Any]

    @property
    def asked(self) -> str:
        """The question in words."""
        state = self.settings.get("state") or self.settings["contact"] or "free tip"
        shaft = " at a held speed" if "speed" in self.settings else " loaded" if "load_torque" in self.settings else ""
        return f"{self.question}, {state}{shaft}"


def case(seed: int, index: int) -> Case:
    """Draw a valid case; the same for the same numbers."""
    rng = np.random.default_rng((seed, index))
    while True:
        try:
            motor = _motor(rng)
            drive = _drive(rng, motor)
        except _FruitlessError:
            continue
        return _asked(rng, motor, drive)


class _FruitlessError(Exception):
    """What was drawn first leaves hardly room for the rest."""


def _accepted(draw: Callable[[], Any]) -> Any:
    """Draw until the model accepts."""
    for _ in range(_TRIES):
        try:
            return draw()
        except (ValidationError, pr.ParameterError):
            continue
    raise _FruitlessError


def value(rng: np.random.Generator, schema: Mapping[str, Any]) -> float:
    """Draw from the whole range of a parameter: by order of magnitude, an angle evenly."""
    low = schema.get("minimum", schema.get("exclusiveMinimum"))
    high = schema.get("maximum", schema.get("exclusiveMaximum"))
    if "default" in schema and rng.random() < 0.5:
        return float(schema["default"])
    if schema.get("unit") == "°":
        return float(rng.uniform(low, high))
    if low > 0.0:
        drawn = float(np.exp(rng.uniform(math.log(low), math.log(high))))
        return min(max(drawn, math.nextafter(low, high)), high)
    if rng.random() < 0.1:
        return 0.0
    drawn = high * float(10.0 ** -rng.uniform(0.0, _DECADES))
    return -drawn if low < 0.0 and rng.random() < 0.5 else drawn


def _values(rng: np.random.Generator, kind: type[Parameters]) -> dict[str, float]:
    return {name: value(rng, schema) for name, schema in _schema(kind).items() if schema.get("type") == "number"}


@cache
def _schema(kind: type[Parameters]) -> dict[str, Any]:
    return dict(kind.model_json_schema()["properties"])


def _motor(rng: np.random.Generator) -> Motor:
    rotor, piezo = Rotor(**_values(rng, Rotor)), Piezo(**_values(rng, Piezo))
    contact = _accepted(lambda: Contact(**_values(rng, Contact)))
    count = min(1 + int(rng.exponential(1.5)), 20)
    motor: Motor | None = None

    def with_another() -> Motor:
        mode = Mode(name=f"m{len(motor.modes) if motor else 0}", **_values(rng, Mode))
        modes = sorted((*(motor.modes if motor else ()), mode), key=lambda one: one.frequency_hz)
        return Motor(name="soak", modes=tuple(modes), piezo=piezo, contact=contact, rotor=rotor)

    for _ in range(count):
        motor = _accepted(with_another)
    assert motor is not None
    return motor


def _drive(rng: np.random.Generator, motor: Motor) -> Drive:
    kind, lively = DRIVES[rng.integers(len(DRIVES))], rng.random() < 0.7

    def one() -> Drive:
        values = _values(rng, kind)
        for name in values:
            if name.startswith("frequency") and rng.random() < 0.5:  # where most happens
                mode = motor.modes[rng.integers(len(motor.modes))]
                values[name] = mode.frequency_hz * (1.0 + rng.normal() / mode.quality_factor)
        if rng.random() < 0.7:  # most start at once; a soft start is often longer than a run
            values["soft_start"] = 0.0
        drive = kind(**values)
        velocity, _ = free_tip(motor, drive)
        if velocity > 0.0 and lively:  # a drive that moves the tip as motors do, not one of any voltage
            scale = float(10.0 ** rng.uniform(-2.0, 2.0)) / velocity
            drive = kind(**values | {name: scale * values[name] for name in values if name.startswith("voltage")})
        check_together(motor, drive)
        return drive

    found: Drive = _accepted(one)
    return found


def _up_to(rng: np.random.Generator, greatest: float) -> float:
    return greatest * float(10.0 ** -rng.uniform(0.0, _DECADES)) * float(rng.choice([-1.0, 1.0]))


def _steps_of_a_block(motor: Motor, drive: Drive) -> float:
    """How many steps a point of a speed-torque curve takes between two looks: the decay of the slowest mode."""
    bench = Bench(motor, drive, uniform_step(motor, drive))
    return bench.duration / bench.step


def _asked(rng: np.random.Generator, motor: Motor, drive: Drive) -> Case:
    chance = rng.random()
    settings: dict[str, Any]
    if chance < 0.06:
        lowest, highest = motor.modes[0].frequency_hz, motor.modes[-1].frequency_hz
        state = str(rng.choice(["free", "preloaded"]))
        return Case(
            motor, drive, "admittance", {"start": 0.1 * lowest, "stop": 10.0 * highest, "points": 501, "state": state}
        )
    law = [None, "spring-slider", "spring-slider", "brush", "coulomb"][rng.integers(5)]
    fastest = (
        min(1e6, pr.FASTEST_SURFACE / motor.rotor.radius_m)
        if hasattr(pr, "FASTEST_SURFACE")
        else min(1e6, 1e3 / motor.rotor.radius_m)
    )
    speed = fastest * float(10.0 ** -rng.uniform(0.0, _DECADES)) * float(rng.choice([-1.0, 1.0]))
    if chance < 0.25 and law is not None and _steps_of_a_block(motor, drive) < 5 * MOST_STEPS:
        return Case(motor, drive, "operating_point", {"contact": law, "speed": speed, "patience": 4})
    steps = float(np.exp(rng.uniform(math.log(FEWEST_STEPS), math.log(MOST_STEPS))))
    settings = {"contact": law}
    step = shortest_period(motor, drive, contact=law is not None) / POINTS_PER_PERIOD
    periods = float(rng.uniform(0.0, 3.0)) * drive.period  # so that the drive has done something
    settings["duration"] = min(max(steps * step, periods), 5 * MOST_STEPS * step)
    shaft = rng.random()
    if shaft < 0.25:
        settings["speed"] = speed
    elif shaft < 0.5:
        holds = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        settings["load_torque"] = _up_to(rng, min(100.0 * holds, 1e6))  # what it holds, and what drags it along
    return Case(motor, drive, "simulate", settings)


# --- what came of it -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What came of a case: result, simulation error, refused, traceback, hang or not audited."""

    index: int
    kind: str
    asked: str
    said: str
    seen: str
    seconds: float
    drawn: dict[str, float]


def outcome(seed: int, index: int) -> Outcome:
    """Run a case and say what came of it."""
    subject = case(seed, index)
    began = time.monotonic()
    kind = said = seen = ""
    try:
        signal.signal(signal.SIGALRM, _hangs)
        signal.alarm(int(2 * LONGEST))
        found = _run(subject)
        seen = _seen(found)
        kind, said = ("result", "") if _passed(found) else ("not audited", "the result does not say that it passed")
    except pr.SimulationError as error:
        kind, said = ("hang" if "did not finish within" in str(error) else "simulation error"), str(error)
        if error.deck is not None:  # drawn again from its number, whenever it is wanted
            shutil.rmtree(error.deck.parent, ignore_errors=True)
            said = said.replace(f" The netlist is kept as {error.deck}.", "")
    except pr.ParameterError as error:
        kind, said = "refused", str(error)
    except _HangError:
        kind, said = "hang", f"no answer within {2 * LONGEST:g} s"
    except Exception as error:  # noqa: BLE001  this is what is looked for
        kind, said = "traceback", f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
    return Outcome(index, kind, subject.asked, said, seen, time.monotonic() - began, drawn(subject))


def drawn(subject: Case) -> dict[str, float]:
    """Return what was drawn of a case, of its modes those of the first."""
    document = subject.motor.model_dump()
    parts = {"mode": document["modes"][0], type(subject.drive).__name__: subject.drive.model_dump()}
    parts |= {part: document[part] for part in ("piezo", "contact", "rotor")}
    values = {f"{part}.{name}": x for part, table in parts.items() for name, x in table.items() if name != "name"}
    return {"modes": len(subject.motor.modes), **values}


def _seen(found: Mapping[str, Any]) -> str:
    """What the contact did in a result."""
    shares = found.get("state_fractions", found)
    if shares.get("separated"):
        return "separated" if shares["separated"] >= 1.0 else "lifted off"
    return "slipped" if shares.get("slip") else "stuck" if "stick" in shares else ""


class _HangError(Exception):
    """A case took longer than it may."""


def _hangs(*_: object) -> None:
    raise _HangError


def _run(subject: Case) -> dict[str, Any]:
    settings = {**subject.settings, "timeout": LONGEST}
    if subject.question == "admittance":
        return pr.admittance(subject.motor, **settings).to_dict()
    if subject.question == "operating_point":
        return pr.operating_point(subject.motor, subject.drive, **settings)
    return pr.simulate(subject.motor, subject.drive, **settings).to_dict()


def _passed(document: Mapping[str, Any]) -> bool:
    audit = document.get("audit")
    return isinstance(audit, Mapping) and audit.get("passed") is True


# --- the soak ------------------------------------------------------------------------------------------------


def cause(said: str) -> str:
    """Return what a message says with its numbers taken out, so that like causes are counted together."""
    return re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", said)[:160]


def soak(count: int, seed: int, workers: int, notes: Path) -> Iterator[Outcome]:
    """Yield the outcome of every case, those first that are already noted; note the others as they come."""
    done: dict[int, Outcome] = {}
    if notes.exists():
        for line in notes.read_text(encoding="utf-8").splitlines():
            noted = Outcome(**json.loads(line))
            done[noted.index] = noted
    yield from (one for index, one in done.items() if index < count)
    open_cases = iter([index for index in range(count) if index not in done])
    with notes.open("a", encoding="utf-8") as file, ProcessPoolExecutor(workers) as pool:
        running = {pool.submit(outcome, seed, index) for _, index in zip(range(2 * workers), open_cases, strict=False)}
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                one = future.result()
                file.write(json.dumps(one.__dict__) + "\n")
                file.flush()
                running |= {pool.submit(outcome, seed, index) for _, index in zip(range(1), open_cases, strict=False)}
                yield one


def summary(outcomes: list[Outcome], seed: int) -> dict[str, Any]:
    """Return the counts, JSON-ready."""
    failures = Counter((one.kind, cause(one.said)) for one in outcomes if one.kind != "result")
    return {
        "cases": len(outcomes),
        "seed": seed,
        "results": sum(one.kind == "result" for one in outcomes),
        "kinds": dict(Counter(one.kind for one in outcomes).most_common()),
        "asked": dict(Counter(one.asked for one in outcomes).most_common()),
        "seen": dict(Counter(one.seen for one in outcomes if one.seen).most_common()),
        "drawn": {name: [min(found), max(found)] for name, found in _columns(outcomes).items()},
        "failures": [
            {"kind": kind, "cause": what, "count": number,
             "indices": [one.index for one in outcomes if one.kind == kind and cause(one.said) == what][:10]}
            for (kind, what), number in failures.most_common()
        ],
        "seconds": round(sum(one.seconds for one in outcomes)),
        "ngspice": ngspice_version(),
    }  # fmt: skip


def _columns(outcomes: list[Outcome]) -> dict[str, list[float]]:
    columns: dict[str, list[float]] = {}
    for one in outcomes:
        for name, drawn_value in one.drawn.items():
            columns.setdefault(name, []).append(drawn_value)
    return columns


def passes(found: Mapping[str, Any]) -> bool:
    """Whether a soak shows what it must: 98 % results, and the rest errors that name their cause."""
    return found["results"] >= 0.98 * found["cases"] and set(found["kinds"]) <= {"result", "simulation error"}


def main() -> int:
    """Run the soak of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=COUNT, help="number of cases")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--output", type=Path, default=RESULT, help="where the counts go")
    parser.add_argument("--case", type=int, help="run one case only, and show it")
    arguments = parser.parse_args()
    if arguments.case is not None:
        subject = case(arguments.seed, arguments.case)
        print(json.dumps({"motor": subject.motor.to_dict(), "drive": subject.drive.model_dump()}, indent=1))
        print(subject.question, subject.settings, outcome(arguments.seed, arguments.case))
        return 0
    notes = arguments.output.with_name(f"{arguments.output.stem}-{arguments.seed}.jsonl")
    outcomes: list[Outcome] = []
    with Progress(*Progress.get_default_columns(), MofNCompleteColumn(), TimeRemainingColumn()) as progress:
        bar = progress.add_task("soak", total=arguments.count)
        for one in soak(arguments.count, arguments.seed, arguments.workers, notes):
            outcomes.append(one)
            progress.advance(bar)
    found = summary(outcomes, arguments.seed)
    arguments.output.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1, ensure_ascii=False))
    return 0 if passes(found) else 1


if __name__ == "__main__":
    sys.exit(main())
