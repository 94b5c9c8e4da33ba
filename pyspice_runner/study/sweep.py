# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs: any quantity over any parameters of motor, drive and run, on grids and within tolerances.

A parameter is named by its dotted path: the motor's as in :meth:`Motor.updated`, the drive's as ``drive.voltage``, the
settings of the run as ``run.duration``. ``modes.*.tip_x`` stands for that of all modes, which then change together.

Each point is worked out by a worker and stored as soon as it is known (:mod:`.store`). A sweep that was interrupted, by
whatever means, is begun again by the same call and goes on where it was.
"""

from __future__ import annotations

import difflib
import hashlib
import inspect
import json
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import closing
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from itertools import product
from math import prod
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeGuard

import numpy as np
from pydantic import SkipValidation

from pyspice_runner.analysis.simulate import simulate
from pyspice_runner.analysis.speed_torque import operating_point, operating_points
from pyspice_runner.engine.ngspice import ngspice_version
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model.drive import Drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import as_number, checked, quoted, unit_of
from pyspice_runner.netlist.contact import Law, is_own
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.library import data_path
from pyspice_runner.netlist.sources import Excitation, updated
from pyspice_runner.run.engines import tools
from pyspice_runner.run.waveforms import Array
from pyspice_runner.study.store import Store, fingerprint
from pyspice_runner.study.workers import SweepEnded, outcomes
from pyspice_runner.units import unit_in

if TYPE_CHECKING:
    import xarray

Analysis = Callable[..., Any]
Quantity = str | Callable[[Any], float]
Distribution = Literal["uniform", "normal"]
Sampling = Literal["sobol", "latin-hypercube"]

MOST_POINTS = 1_000_000
BATCH = 64  # operating points that are solved together, and stored
FLAGS = {  # kept of every point beside the quantities, where the analysis states them; 1 is yes, 0 is no
    "settled": "whether the means are settled",
    "accurate": "whether the estimated error is allowed",
}
_SETTING_UNITS = {"duration": "s", "load_torque": "N·m", "speed": "rad/s", "step": "s"}  # of arguments without one


@dataclass(frozen=True)
class Tolerance:
    """How far a parameter may lie from its nominal value.

    Attributes:
        relative: half the width, as a fraction of the nominal value: 0.1 for ±10 %.
        distribution: ``"uniform"`` over the width, or ``"normal"`` with half the width as three standard deviations.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    relative: float
    distribution: Distribution = "uniform"

    def __post_init__(self) -> None:
        share = as_number(self.relative)
        if share is None or not 0.0 < share < 1.0:
            given = quoted(self.relative) if share is None else f"±{100.0 * share:g} %"
            raise ParameterError(f"A tolerance of {given} is not valid: it must be > 0 and < 100 %.")
        _one_of("distribution", self.distribution, ("uniform", "normal"))

    def factors(self, quantiles: Array) -> Array:
        """Return by what the nominal value is multiplied at quantiles, numbers from 0 to 1."""
        if self.distribution == "uniform":
            return 1.0 + self.relative * (2.0 * quantiles - 1.0)
        from scipy.stats import norm

        inside = 0.5 + (1.0 - 1e-10) * (quantiles - 0.5)  # 0 and 1 themselves lie at infinity
        return 1.0 + self.relative / 3.0 * np.asarray(norm.ppf(inside))


@checked
def sweep(
    motor: Motor,
    drive: Excitation,
    *,
    over: Mapping[str, SkipValidation[Sequence[float] | Array | Tolerance]],
    quantities: Sequence[str] | Mapping[str, Quantity] = ("mean_rotor_speed_rad_s", "mean_torque_n_m"),
    samples: int = 64,
    sampling: Sampling = "sobol",
    seed: int = 0,
    analysis: Analysis = simulate,
    store: str | Path | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    **run: Any,
) -> xarray.Dataset:
    """Run a motor at every point of a grid, within tolerances, or both.

    Args:
        motor: the motor at its nominal values.
        drive: the drive at its nominal values.
        over: dotted path → values, which become a dimension of the result, or → :class:`Tolerance`; all tolerances
            together become the dimension ``sample``.
        quantities: what to keep of each point: dotted names of numbers in :meth:`Waveforms.to_dict`. Or names of one's
            own → such a name, or → a function of the point's result, which workers find by its name in its module.
        samples: number of samples within the tolerances.
        sampling: how they are spread: by a scrambled Sobol sequence, or a Latin hypercube.
        seed: seed of the samples.
        analysis: what is done at a point, a function of motor, drive and the settings of the run, such as
            :func:`simulate`, :func:`operating_point`, or :func:`drive_report` with a driver; its result is a mapping,
            or has a ``to_dict`` that gives one.
        store: folder of the finished points; by default in the user's cache folder.
        workers: number of processes; by default one a core.
        executor: what runs the points instead of processes of our own, such as that of a Dask client.
        progress: called with the number of points that are finished and of all.
        **run: settings of the run, as :func:`simulate` takes them.

    Returns:
        The quantities over the dimensions, with units and provenance. Where a point failed they are NaN, and the
        variable ``failure`` says why; ``deck_sha256`` is the hash of each point's deck.

    Raises:
        ParameterError: for an invalid value.
        KeyboardInterrupt: when interrupted; it says how many points are finished and where they are.
    """
    wanted: dict[str, Quantity] = (
        dict(quantities)
        if isinstance(quantities, Mapping)
        else {name: name for name in ([quantities] if isinstance(quantities, str) else quantities)}
    )
    functions = {name: function for name, function in wanted.items() if not isinstance(function, str)}
    origin = _identity(analysis)
    _check_settings({path[4:] for path in over if path.startswith("run.")} | set(run), set(run), analysis)
    for name, value in _plain(run).items():
        try:
            fingerprint(value)
        except (TypeError, ValueError, AttributeError, RecursionError):
            raise ParameterError(
                f"run.{name} = {quoted(value)} is not valid: it must be numbers, texts, and lists of them."
            ) from None
    plan = _plan(over, {path: _find(path, motor, drive, run) for path in over}, samples, sampling, seed)
    versions = _versions()
    tasks = [_task(analysis, motor, drive, run, change, functions, versions) for change in plan.changes]
    addresses = [task.address for task in tasks]
    found, failed = _answers(
        dict(zip(addresses, tasks, strict=True)),
        lambda result: _picked(result, wanted),
        Store(store), workers, executor, progress or (lambda *_: None),
    )  # fmt: skip
    refusals = [error for error in failed.values() if isinstance(error, ParameterError)]
    if not found and len(refusals) == len(failed):
        raise refusals[0]
    dataset = _dataset(plan, addresses, list(wanted), found, failed)
    dataset.attrs = {
        "title": f"{motor.name}: {', '.join(wanted)} over {', '.join(over)}",
        "parameter_set": motor.name,
        **{
            name: json.dumps(document)
            for name, document in (("motor", motor.to_dict()), ("drive", _drive(drive)), ("run", _plain(run)))
        },
        "analysis": origin["function"],
        **({"sampling": f"{sampling}, seed {seed}"} if "sample" in plan.shape else {}),
        **versions,
        "deck_sha256": fingerprint(dataset["deck_sha256"].values.tolist()),
    }
    return dataset


# --- the points ---


@dataclass(frozen=True)
class _Parameter:
    """What a dotted path stands for: one value, or with ``modes.*`` one of each mode."""

    nominal: dict[str, Any]  # dotted path → nominal value; None for a setting of the run that is not stated
    attributes: dict[str, str]


@dataclass(frozen=True)
class _Plan:
    """The points of a sweep: what changes at each, in the order of the dimensions."""

    shape: dict[str, int]
    coordinates: dict[str, tuple[str, Array, dict[str, Any]]]
    changes: list[dict[str, float]]


@dataclass(frozen=True)
class _Task:
    """One point: what to do, and with what. It is called by a worker."""

    analysis: Analysis
    motor: Motor
    drive: Excitation
    run: dict[str, Any]
    functions: dict[str, Callable[[Any], float]]
    versions: dict[str, str]

    @cached_property
    def content(self) -> dict[str, Any]:
        """All that the result follows from. How long it may take is not among it."""
        return {
            "analysis": _identity(self.analysis),
            "functions": {name: _identity(function) for name, function in self.functions.items()},
            "motor": self.motor.to_dict(),
            "drive": _drive(self.drive),
            "run": {name: value for name, value in _plain(self.run).items() if name != "timeout"}
            | _law(self.run)
            | _tools(self.run),
            "versions": self.versions,
        }

    @cached_property
    def address(self) -> str:
        return fingerprint(self.content)

    def __call__(self) -> dict[str, Any]:
        try:
            return self._answer()
        except SweepEnded:
            os._exit(1)  # ngspice is stopped, its files are cleared away; do not begin another task

    def _answer(self) -> dict[str, Any]:
        here = _versions()
        if here != self.versions:
            raise SimulationError(
                f"The worker has other versions ({_listed(here)}) than the sweep ({_listed(self.versions)}). "
                "Install the same on both sides."
            )
        try:
            result = self.analysis(self.motor, self.drive, **self.run)
        except SimulationError as error:
            if error.deck is None:
                raise
            shutil.rmtree(error.deck.parent, ignore_errors=True)  # a sweep may fail a thousand times
            reason = str(error).replace(f" The netlist is kept as {error.deck}.", "")
            raise SimulationError(reason, log=error.log) from None
        return self.answer(result)

    def answer(self, result: Any) -> dict[str, Any]:
        """Return what is kept of a result."""
        document = result if isinstance(result, Mapping) else result.to_dict()
        numbers = dict(_numbers(document)) | {name: float(of(result)) for name, of in self.functions.items()}
        numbers.pop("solver_seconds", None)  # of the machine, not of the motor
        settings = document.get("run") or {}
        deck = document.get("deck_sha256") or settings.get("deck_sha256", "")
        return {"numbers": numbers, "deck_sha256": str(deck)}


def _task(
    analysis: Analysis,
    motor: Motor,
    drive: Excitation,
    run: Mapping[str, Any],
    change: Mapping[str, float],
    functions: dict[str, Callable[[Any], float]],
    versions: dict[str, str],
) -> _Task:
    parts: dict[str, dict[str, float]] = {"motor": {}, "drive": {}, "run": {}}
    for path, value in change.items():
        section, _, name = path.partition(".")
        if section in ("drive", "run"):
            parts[section][name] = value
        else:
            parts["motor"][path] = value
    return _Task(
        analysis,
        motor.updated(parts["motor"]) if parts["motor"] else motor,
        updated(drive, parts["drive"]) if parts["drive"] else drive,
        {**run, **parts["run"]},
        functions,
        versions,
    )


def _find(path: str, motor: Motor, drive: Excitation, run: Mapping[str, Any]) -> _Parameter:
    """Return what a path stands for.

    Raises:
        ParameterError: if there is no such parameter, or it is no number.
    """
    section, _, key = path.partition(".")
    if section == "run":
        return _Parameter({path: run.get(key)}, {"units": _unit(key)})
    kind: Any = type(drive)
    if isinstance(drive, Driver) and section == "drive" and "." in key:
        return _Parameter({path: drive.setting(key)}, {"units": drive.unit(key)})
    if section == "drive":
        if key not in kind.model_fields:
            raise _unknown(path, [f"drive.{name}" for name in kind.model_fields])
        nominal = {path: getattr(drive, key)}
    else:
        every = [path.replace("*", str(index), 1) for index in range(len(motor.modes))]
        nominal = {one: _value(motor, one) for one in (every if path.startswith("modes.*.") else [path])}
        kind = type(motor.modes[0]) if section == "modes" else type(getattr(motor, section))
        key = path.rpartition(".")[2]
    if key not in kind.model_fields:  # frequency_hz, which the model derives
        return _Parameter(nominal, {"units": _unit(key)})
    return _Parameter(nominal, {"units": unit_of(kind, key), "long_name": str(kind.model_fields[key].description)})


def _value(motor: Motor, path: str) -> float:
    node: Any = motor.to_dict()
    for part in path.split("."):
        if isinstance(node, list):
            node = {mode["name"]: mode for mode in node} | {str(index): mode for index, mode in enumerate(node)}
        node = node.get(part) if isinstance(node, dict) else None
    if not isinstance(node, Real):
        if node is None:
            motor.updated({path: 0.0})  # says which path may have been meant
        raise ParameterError(f"{quoted(path)} is not a number, so it cannot be swept. Name one that is.")
    return float(node)


def _check_settings(given: set[str], stated: set[str], analysis: Analysis) -> None:
    """Check that the analysis has the settings that are given, some of them as arguments, and all that it needs."""
    _, _, *settings = inspect.signature(analysis).parameters.values()
    named = {setting.name: setting for setting in settings if setting.kind is not setting.VAR_KEYWORD}
    for name in sorted(given):
        if name not in named and len(named) == len(settings):
            own = [argument for argument in inspect.signature(sweep).parameters if argument != "run"]
            known = [f"run.{setting}" for setting in named]
            raise _unknown(name, [*own, *named], "argument") if name in stated else _unknown(f"run.{name}", known)
    for name, setting in named.items():
        if setting.default is setting.empty and name not in given:
            raise ParameterError(f"The setting {name} is missing. State it, or sweep over run.{name}.")


def _plan(
    over: Mapping[str, Sequence[float] | Array | Tolerance],
    parameters: Mapping[str, _Parameter],
    samples: int,
    sampling: Sampling,
    seed: int,
) -> _Plan:
    touched = Counter(target for parameter in parameters.values() for target in parameter.nominal)
    if not touched or max(touched.values()) > 1:
        which = f"{touched.most_common(1)[0][0]} twice; name it once" if touched else "nothing; name a parameter"
        raise ParameterError(f"The sweep goes over {which}.")
    steps: dict[str, list[dict[str, float]]] = {}
    coordinates: dict[str, tuple[str, Array, dict[str, Any]]] = {}
    for path, values in over.items():
        if not isinstance(values, Tolerance):
            grid = _grid(path, values)
            coordinates[path] = (path, grid, parameters[path].attributes)
            steps[path] = [dict.fromkeys(parameters[path].nominal, float(value)) for value in grid]
    tolerances = {path: values for path, values in over.items() if isinstance(values, Tolerance)}
    if tolerances:
        quantiles = _quantiles(len(tolerances), samples, sampling, seed)
        steps["sample"] = [{} for _ in range(samples)]
        for (path, tolerance), column in zip(tolerances.items(), quantiles.T, strict=True):
            factors = tolerance.factors(column)
            coordinates[path] = ("sample", *_scatter(parameters[path], tolerance, factors))
            for step, factor in zip(steps["sample"], factors, strict=True):
                step |= {target: float(value * factor) for target, value in parameters[path].nominal.items()}
    shape = {dimension: len(changes) for dimension, changes in steps.items()}
    if prod(shape.values()) > MOST_POINTS:
        raise ParameterError(f"The sweep has {prod(shape.values()):.3g} points; at most {MOST_POINTS:.0e} are allowed.")
    changes = [{path: value for part in parts for path, value in part.items()} for parts in product(*steps.values())]
    return _Plan(shape, coordinates, changes)


def _scatter(parameter: _Parameter, tolerance: Tolerance, factors: Array) -> tuple[Array, dict[str, Any]]:
    """Return the coordinate of a parameter within its tolerance: its values, or one factor for those of all modes."""
    if not any(parameter.nominal.values()):
        path, value = next(iter(parameter.nominal.items()))
        raise ParameterError(f"{path} = {value} has no tolerance; give it a nominal value other than 0.")
    attributes = {**parameter.attributes, "tolerance": tolerance.relative, "distribution": tolerance.distribution}
    if len(parameter.nominal) > 1:
        return factors, attributes | {"units": "1", "comment": "factor by which the values of all modes are multiplied"}
    (value,) = parameter.nominal.values()
    return value * factors, attributes | {"nominal": value}


def _grid(path: str, values: Any) -> Array:
    try:
        grid = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        grid = np.array([])
    if grid.ndim != 1 or not grid.size or not np.all(np.isfinite(grid)):
        raise ParameterError(f"{path} = {quoted(values)} is not valid: it must be one or more numbers, or a Tolerance.")
    return grid


def _quantiles(parameters: int, samples: int, sampling: Sampling, seed: int) -> Array:
    """Return numbers from 0 to 1, shape (samples, parameters)."""
    from scipy.stats import qmc

    if not 1 <= samples <= MOST_POINTS:
        raise ParameterError(f"samples = {samples} is not valid: it must be a whole number > 0 and ≤ {MOST_POINTS}.")
    if seed < 0:
        raise ParameterError(f"seed = {seed} is not valid: it must be a whole number ≥ 0.")
    if sampling == "latin-hypercube":
        return np.asarray(qmc.LatinHypercube(parameters, rng=seed).random(samples))
    if samples & (samples - 1):
        raise ParameterError(
            f"samples = {samples} is not valid: a Sobol sequence is balanced only for a power of two. "
            f"Give {1 << samples.bit_length()}, or sampling = 'latin-hypercube'."
        )
    return np.asarray(qmc.Sobol(parameters, rng=seed).random(samples))


# --- the answers ---


def _answers(
    tasks: Mapping[str, _Task],
    picked: Callable[[Mapping[str, Any]], dict[str, Any]],
    store: Store,
    workers: int | None,
    executor: Executor | None,
    progress: Callable[[int, int], None],
) -> tuple[dict[str, dict[str, Any]], dict[str, BaseException]]:
    """Return by address what the points gave, and why others failed: out of the store, or worked out and stored."""
    stored = {address: store.get(task.content) for address, task in tasks.items()}
    found = {address: picked(result) for address, result in stored.items() if _is_answer(result)}
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


def _together(tasks: Mapping[str, _Task]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the answers of operating points with a stable steady state, which share runs of ngspice."""
    batched = [
        (address, task, task.drive) for address, task in tasks.items()
        if task.analysis is operating_point and isinstance(task.drive, Drive)
        and task.run.get("mode", "steady") == "steady" and task.run.get("audit", True)
    ]  # fmt: skip
    for begin in range(0, len(batched), BATCH):
        batch = batched[begin : begin + BATCH]
        results = operating_points([(task.motor, drive, task.run) for _, task, drive in batch])
        for (address, task, _), result in zip(batch, results, strict=True):
            if result is not None:
                yield address, task.answer(result)


# --- the result ---


def _is_answer(stored: Any) -> TypeGuard[Mapping[str, Any]]:
    """Tell whether an entry of the store has the form that :class:`_Task` returns."""
    if not isinstance(stored, dict) or not isinstance(stored.get("deck_sha256"), str):
        return False
    numbers = stored.get("numbers")
    return isinstance(numbers, dict) and all(type(value) in (float, int) for value in numbers.values())


def _picked(result: Mapping[str, Any], wanted: Mapping[str, Quantity]) -> dict[str, Any]:
    """Return the quantities that are wanted, and the hash of the deck.

    Raises:
        ParameterError: if there is no such quantity.
    """
    numbers = result["numbers"]
    values: dict[str, Any] = {"deck_sha256": result["deck_sha256"]}
    values |= {name: numbers[name] for name in FLAGS if name in numbers and name not in wanted}
    for name, source in wanted.items():
        key = source if isinstance(source, str) else name
        if key not in numbers:
            inputs = ("motor.", "drive.", "run.")
            raise _unknown(key, [known for known in numbers if not known.startswith(inputs)], "quantity")
        values[name] = numbers[key]
    return values


def _dataset(
    plan: _Plan,
    addresses: Sequence[str],
    names: Sequence[str],
    found: Mapping[str, Mapping[str, Any]],
    failed: Mapping[str, BaseException],
) -> xarray.Dataset:
    from pyspice_runner.datasets import labelled

    def shaped(values: list[Any]) -> Any:
        return np.array(values).reshape(tuple(plan.shape.values()))

    empty = dict.fromkeys(names, float("nan")) | {"deck_sha256": ""}
    rows = [found.get(address, empty) for address in addresses]
    variables = {name: (shaped([row[name] for row in rows]), {"units": _unit(name)}) for name in names}
    for flag, meaning in FLAGS.items():
        if flag not in names and any(flag in row for row in rows):
            values = [row.get(flag, float("nan")) for row in rows]
            variables[flag] = (shaped(values), {"units": "1", "long_name": meaning})
    variables["failure"] = (
        shaped([_reason(failed[address]) if address in failed else "" for address in addresses]),
        {"long_name": "why the point failed"},
    )
    variables["deck_sha256"] = (shaped([row["deck_sha256"] for row in rows]), {"long_name": "hash of the deck"})
    return labelled(
        {name: (tuple(plan.shape), values, attributes) for name, (values, attributes) in variables.items()},
        plan.coordinates,
        {},
    )


def _reason(error: BaseException) -> str:
    if isinstance(error, BrokenExecutor | CancelledError):
        return (
            "The worker was lost: killed, out of memory, or cut off. Begin the sweep again for what is missing. If all "
            "are lost, the script lacks `if __name__ == '__main__':`; each worker imports it."
        )
    return str(error) if isinstance(error, ParameterError | SimulationError) else f"{type(error).__name__}: {error}"


def _numbers(document: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number in a document with its dotted name."""
    items = document.items() if isinstance(document, Mapping) else enumerate(document)
    for key, value in items:
        if isinstance(value, Mapping | list | tuple):
            yield from _numbers(value, f"{prefix}{key}.")
        elif isinstance(value, Real | np.bool_):
            yield f"{prefix}{key}", float(value)


def _unit(name: str) -> str:
    """Return the unit that a dotted name or one of its parts ends in."""
    for part in reversed(name.split(".")):
        unit = _SETTING_UNITS.get(part) or unit_in(part)
        if unit != "1":
            return unit
    return "1"


# --- identities ---


def _drive(drive: Excitation) -> dict[str, Any]:
    own = {"own_sha256": _sha256(drive.own_text)} if isinstance(drive, Driver) and drive.own_text else {}
    return {"kind": type(drive).__name__, **drive.model_dump(), **own}


def _plain(run: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a run with the law of the contact as text and number."""
    contact = run.get("contact")
    return {**run, **(contact.to_dict() if isinstance(contact, Law) else {})}


def _law(run: Mapping[str, Any]) -> dict[str, str]:
    """Return the hash of a contact law of the user's own, whose file may change while its name stays."""
    contact = _plain(run).get("contact")
    return {"contact_sha256": _sha256(Law(str(contact)).library.subcircuit)} if is_own(contact) else {}


def _tools(run: Mapping[str, Any]) -> dict[str, str]:
    """Return which compiler and which ngspice run the motor, where it may be a compiled module."""
    if run.get("engine", "spice") == "spice":
        return {}
    try:
        return {"tools": tools()}
    except SimulationError:
        return {"tools": "none"}


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _identity(function: Callable[..., Any]) -> dict[str, str]:
    """Return by what a function is known: its place and its text.

    Raises:
        ParameterError: for what a worker cannot import.
    """
    try:
        text = inspect.getsource(function) if "<" not in function.__qualname__ else ""
    except (TypeError, AttributeError, OSError):  # no function, or one that stands in no file
        text = ""
    if not text:
        raise ParameterError(f"{quoted(function)} is not valid: workers need a function with a name in a module.")
    return {
        "function": f"{function.__module__}.{function.__qualname__}",
        "sha256": _sha256(text),
    }


def _versions() -> dict[str, str]:
    return {
        "pyspice_runner_version": version("pyspice-runner"),
        "code_sha256": _code_sha256(),
        "ngspice_version": ngspice_version(),
    }


@cache
def _code_sha256() -> str:
    """Return a hash of what turns a point into numbers, so that no edited source meets what older ones stored."""
    package = Path(__file__).resolve().parents[1]
    sources = [
        path for part in ("model", "netlist", "engine", "run", "analysis") for path in package.glob(f"{part}/**/*.py")
    ]
    libraries = data_path("behavioral").glob("*.lib")
    return fingerprint({"/".join(path.parts[-2:]): path.read_text(encoding="utf-8") for path in (*sources, *libraries)})


def _listed(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name.removesuffix('_version')} {value[:12]}" for name, value in versions.items())


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ParameterError(f"{name} = {quoted(value)} is not valid: it must be {' or '.join(map(repr, allowed))}.")


def _unknown(name: str, known: Sequence[str], what: str = "parameter") -> ParameterError:
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"Did you mean {close[0]!r}?" if close else f"There are {', '.join(known)}."
    return ParameterError(f"There is no {what} {quoted(name)}. {hint}")
