# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of random motors: ``python -m validation.soak --count 2000``, or ``make soak``.

The parameters of motor, drive, driver and tracker are drawn from the whole ranges that they declare; a combination that
the model rejects is drawn again. Each valid case must give a result that passes the physical audit, or a
``SimulationError`` that names its cause. The outcome of a case is written to a file at once, so that an interrupted
soak can be resumed.
"""

from __future__ import annotations

import math
import re
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any, get_args

import numpy as np
from pydantic import ValidationError

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.circuit.source import UNIFORM_POINTS, DriveSource, Source
from pyspice_runner.drivers.driver import DriverKind, NetworkKind
from pyspice_runner.motor.drive import FASTEST_SHAFT, FASTEST_SURFACE, Drive, check_together, free_tip
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import STIFFEST_HERTZ, Contact, Mode, Parameters, Piezo, Rotor
from pyspice_runner.run.dynamometer import Dynamometer, off_beat
from pyspice_runner.run.point import Point
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.steady.speed_torque import held_point
from pyspice_runner.trackers.tracker import DisturbanceKind
from tests.motors import BEAM40
from validation.campaign import Campaign

COUNT, SEED = 2000, 7
LONGEST = 120.0  # s of wall time that a case may take; longer is a hang
FEWEST_STEPS, MOST_STEPS = 400, 4000
_DECADES = 8.0  # below the greatest value, where a range includes zero
_TRIES = 3000
DRIVES: tuple[type[Drive], ...] = (pr.TwoPhaseDrive, pr.TwoToneDrive)


# --- what is drawn -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One motor, its drive, and the analysis to run."""

    motor: Motor
    drive: Source
    question: str
    settings: dict[str, Any]

    @property
    def asked(self) -> str:
        """The question in words."""
        state = self.settings.get("state") or self.settings["contact"] or "free tip"
        if isinstance(self.drive, pr.Driver | pr.Tracker):
            state = f"{self.drive.kind}, {state}"
        shaft = " at a held speed" if "speed" in self.settings else " loaded" if "load_torque" in self.settings else ""
        return f"{self.question}, {state}{shaft}"


def case(seed: int, index: int, subject: str = "motors") -> Case:
    """Draw a valid case; the same for the same arguments."""
    rng = np.random.default_rng((seed, index))
    if subject == "electronics":
        draw = _driven if rng.random() < 0.5 else _tracked
        found: Case = _accepted(lambda: draw(rng))
        return found
    for _ in range(_TRIES):
        try:
            motor = random_motor(rng)
            drive = _drive(rng, motor)
        except FruitlessError:
            continue
        return _asked(rng, motor, drive)
    raise FruitlessError


class FruitlessError(Exception):
    """What was drawn first leaves hardly room for the rest."""


def _accepted(draw: Callable[[], Any]) -> Any:
    """Draw values until the model accepts them."""
    for _ in range(_TRIES):
        try:
            return draw()
        except (ValidationError, pr.ParameterError):
            continue
    raise FruitlessError


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


# A softened mode has no restoring force beyond 1/√γ: its range depends on the motion (analysis/test_softening.py)
NONLINEAR = ("softening_per_m2", "damping_growth_per_m2")
OF_MOTORS = ("capacitance_b_f",)  # optional, as transducers have none


def _values(rng: np.random.Generator, kind: type[Parameters]) -> dict[str, float]:
    schemas = {name: one["anyOf"][0] if name in OF_MOTORS else one for name, one in _schema(kind).items()}
    return {
        name: value(rng, schema)
        for name, schema in schemas.items()
        if schema.get("type") == "number" and name not in NONLINEAR
    }


@cache
def _schema(kind: type[Parameters]) -> dict[str, Any]:
    found = dict(kind.model_json_schema()["properties"])
    if found.pop("exponent", None):  # Hertz's contact: what its constants can be depends on the exponent
        found["normal_stiffness_n_per_m15"]["maximum"] = STIFFEST_HERTZ
    return found


def random_motor(rng: np.random.Generator) -> Motor:
    """Draw a motor; what it draws first can leave no room for the rest: FruitlessError."""
    rotor, piezo = Rotor(**_values(rng, Rotor)), _accepted(lambda: Piezo(**_values(rng, Piezo)))
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
    bench = Dynamometer(off_beat(Point(motor, DriveSource(drive))))
    return bench.duration / bench.setup.step


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
    motor = _with_its_law(motor, law)
    fastest = min(FASTEST_SHAFT, FASTEST_SURFACE / motor.rotor.radius_m)
    speed = fastest * float(10.0 ** -rng.uniform(0.0, _DECADES)) * float(rng.choice([-1.0, 1.0]))
    if chance < 0.25 and law is not None and _steps_of_a_block(motor, drive) < 5 * MOST_STEPS:
        return Case(motor, drive, "operating_point", {"contact": law, "speed": speed, "mode": "settle", "patience": 4})
    steps = float(np.exp(rng.uniform(math.log(FEWEST_STEPS), math.log(MOST_STEPS))))
    settings = {"contact": law}
    step = Point(motor, DriveSource(drive), law=PAPER_LAW if law else None).shortest_period / UNIFORM_POINTS
    periods = float(rng.uniform(0.0, 3.0)) * drive.period  # so that the drive has done something
    settings["duration"] = min(max(steps * step, periods), 5 * MOST_STEPS * step)
    shaft = rng.random()
    if shaft < 0.25:
        settings["speed"] = speed
    elif shaft < 0.5:
        holds = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        settings["load_torque"] = _up_to(rng, min(100.0 * holds, 1e6))  # what it holds, and what drags it along
    return Case(motor, drive, "simulate", settings)


# --- drivers and trackers: near the motors of the package, since most electronics fit no random motor ---


def _scaled(rng: np.random.Generator, part: Parameters, spread: float) -> dict[str, float]:
    """The numbers of a part, each multiplied by a factor of up to 10 to the power of the spread, either way."""
    numbers = {name: x for name, x in part.model_dump().items() if isinstance(x, float) and x != 0.0}
    return {name: x * float(10.0 ** rng.uniform(-spread, spread)) for name, x in numbers.items()}


_OF_MATERIALS = ("contact.effective_radius_m", "contact.poisson", "contact.exponent")  # cannot be changed on their own


def _near(rng: np.random.Generator) -> Motor:
    motor = pr.load_motor(str(rng.choice([*pr.available_motors(), BEAM40])))
    parts: dict[str, Parameters] = {name: getattr(motor, name) for name in ("piezo", "contact", "rotor")}
    parts |= {f"modes.{index}": mode for index, mode in enumerate(motor.modes)}
    drawn = {f"{path}.{name}": x for path, part in parts.items() for name, x in _scaled(rng, part, 0.1).items()}
    return motor.updated({path: x for path, x in drawn.items() if path not in _OF_MATERIALS})


def _near_resonance(rng: np.random.Generator, motor: Motor) -> dict[str, float]:
    mode = motor.modes[rng.integers(len(motor.modes))]
    return {
        "voltage": float(10.0 ** rng.uniform(0.5, 2.2)),
        "frequency": mode.frequency_hz * float(rng.uniform(0.95, 1.1)),
        "phase_deg": float(rng.uniform(-180.0, 180.0)),
    }


def _contact(rng: np.random.Generator) -> str | None:
    return [None, "spring-slider", "spring-slider", "brush", "coulomb"][rng.integers(5)]


def _with_its_law(motor: Motor, law: str | None) -> Motor:
    """The motor without what was drawn for the spring-slider alone."""
    return motor if law == "spring-slider" else motor.updated({"contact.sliding_ratio": 1.0})


def _driven(rng: np.random.Generator) -> Case:
    motor, contact = _near(rng), _contact(rng)
    motor = _with_its_law(motor, contact)
    kind, network = (str(rng.choice(get_args(choice))) for choice in (DriverKind, NetworkKind))
    stated = {"kind": kind, "network": network, **_near_resonance(rng, motor)}
    numbers = {
        f"{part.label}.{name}": x * float(10.0 ** rng.uniform(-0.3, 0.3))
        for part in pr.Driver(**stated).parts("a")
        for name, x in part.values.items()
        if name in {one.name for one in part.library.parameters} and x != 0.0 and rng.random() < 0.2
    }
    allowed = {path: x for path, x in numbers.items() if _is_setting(stated, path, x)}
    driver = pr.Driver(**stated, settings=allowed)
    duration = float(rng.uniform(12.0, 30.0)) / driver.frequency
    return Case(motor, driver, "drive_report", {"contact": contact, "duration": duration})


def _is_setting(stated: Mapping[str, Any], path: str, x: float) -> bool:
    """Whether a driver accepts a value of one of its parts."""
    try:
        pr.Driver(**stated, settings={path: x})
    except pr.ParameterError:
        return False
    return True


def _tracked(rng: np.random.Generator) -> Case:
    motor, kind = _near(rng), str(rng.choice(["pll", "observe-current", "observe-power"]))
    contact = _contact(rng)
    motor = _with_its_law(motor, contact)
    # the full motor cannot warm up in the time of a case
    kinds = [one for one in get_args(DisturbanceKind) if one != "warm-up" and not (one == "target" and kind != "pll")]
    disturb = str(rng.choice([one for one in kinds if contact or one not in ("load", "preload")]))
    mode = int(rng.integers(len(motor.modes)))
    values = _near_resonance(rng, motor) | {"frequency": motor.modes[mode].frequency_hz * float(rng.uniform(1.0, 1.1))}
    tracker = pr.Tracker(kind=kind, bandwidth_hz=float(10.0 ** rng.uniform(1.5, 3.2)), **values)
    begin = float(rng.uniform(60.0, 120.0)) / tracker.frequency
    settings = {"contact": contact, "disturb": disturb, "mode": mode, "begin": begin, "duration": 2.0 * begin}
    settings |= {"drift_time": 0.25 * begin} if disturb == "temperature" else {}
    return Case(motor, tracker, "track", settings)


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


def outcome_of(subject: Case, index: int) -> Outcome:
    """Run a case and return its outcome."""
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
    drive = {name: x for name, x in subject.drive.model_dump().items() if isinstance(x, float)}
    parts = {"mode": document["modes"][0], type(subject.drive).__name__: drive}
    parts |= {part: document[part] for part in ("piezo", "contact", "rotor")}
    values = {f"{part}.{name}": x for part, table in parts.items() for name, x in table.items() if isinstance(x, float)}
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
    if isinstance(subject.drive, pr.Driver):
        return pr.drive_report(subject.motor, subject.drive, **settings).to_dict()
    if isinstance(subject.drive, pr.Tracker):
        return pr.track(subject.motor, subject.drive, margin=False, **settings).to_dict()
    if subject.question == "operating_point":
        return held_point(subject.motor, subject.drive, **settings)
    return pr.simulate(subject.motor, subject.drive, **settings).to_dict()


def _passed(document: Mapping[str, Any]) -> bool:
    audit = document.get("audit")
    return isinstance(audit, Mapping) and audit.get("passed") is True


# --- the soak ------------------------------------------------------------------------------------------------


def cause(said: str) -> str:
    """Return what a message says with its numbers taken out, so that like causes are counted together."""
    return re.sub(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", "#", said)[:160]


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts, JSON-ready."""
    outcomes = [Outcome(**one) for one in record]
    failures = Counter((one.kind, cause(one.said)) for one in outcomes if one.kind != "result")
    return {
        "cases": len(outcomes),
        "seed": SEED,
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


def motors(index: int) -> dict[str, Any]:
    """Return the outcome of a random motor."""
    return asdict(outcome_of(case(SEED, index), index))


def electronics(index: int) -> dict[str, Any]:
    """Return the outcome of a random driver or tracker."""
    return asdict(outcome_of(case(SEED, index, "electronics"), index))


CAMPAIGN = Campaign("soak", motors, summary, passes, COUNT)
ELECTRONICS = Campaign("soak_electronics", electronics, summary, passes, 200)

if __name__ == "__main__":
    of_electronics = sys.argv[1:2] == ["electronics"]
    sys.exit(ELECTRONICS.main(sys.argv[2:]) if of_electronics else CAMPAIGN.main())
