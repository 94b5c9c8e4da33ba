# SPDX-License-Identifier: GPL-3.0-or-later
"""Many runs: any quantity over any parameters of motor, drive and run, on grids and within tolerances.

A parameter is named by its dotted path (:mod:`~pyspice_runner.run.paths`): ``contact.friction``, ``drive.voltage``,
``load.speed``, ``run.duration``. ``modes.*.tip_x`` names that of all modes, which then change together.

A point is answered out of the store, by a run that points share, or by a worker (:mod:`.task`), and its result is
stored at once (:mod:`.store`). To continue a sweep after an interrupt, repeat the call.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import SkipValidation

from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import Stated, checked, quoted
from pyspice_runner.result import grouped, json_ready
from pyspice_runner.run.paths import LOADS, canonical, changed, unit_of_name, unknown
from pyspice_runner.run.simulate import simulate
from pyspice_runner.steady.speed_torque import held_point, held_points
from pyspice_runner.sweeps.plan import Sampling, Tolerance, Values, named, plan_of
from pyspice_runner.sweeps.store import Store, fingerprint
from pyspice_runner.sweeps.task import Analysis, Task, drive_document, identity, plain, versions_here
from pyspice_runner.sweeps.workers import outcomes

if TYPE_CHECKING:
    import xarray

Quantity = str | Callable[[Any], float]

BATCH = 64  # operating points that are solved together, and stored
FLAGS = {  # kept of every point beside the quantities, where the analysis has them; 1 is yes, 0 is no
    "settled": "whether the means are settled",
    "accurate": "whether the estimated error is allowed",
}


@checked
def sweep(
    motor: Motor,
    drive: Stated,
    *,
    over: Mapping[str, SkipValidation[Values]],
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
        quantities: the numbers to keep of each point: dotted names in :meth:`Waveforms.to_dict`, or a mapping from new
            names to such names or to functions of the result. Workers import such a function by its name.
        samples: number of samples within the tolerances.
        sampling: ``"sobol"``, a scrambled Sobol sequence, or ``"latin-hypercube"``.
        seed: seed of the samples.
        analysis: analysis of a point: a function of motor, drive and the settings of the run, such as
            :func:`simulate`, :func:`.held_point`, or :func:`drive_report` with a driver; its result is a mapping,
            or has a ``to_dict`` that gives one.
        store: folder of the finished points; by default in the user's cache folder.
        workers: number of processes; by default one a core.
        executor: executor that runs the points instead of local processes, such as that of a Dask client.
        progress: called with the number of finished points and of all points.
        **run: settings of the run, as :func:`simulate` takes them.

    Returns:
        The quantities over the dimensions, with units and provenance. Where a point failed they are NaN, and the
        variable ``failure`` says why; ``deck_sha256`` is the hash of each point's deck.

    Raises:
        ParameterError: for an invalid value.
        KeyboardInterrupt: when interrupted; the message gives the number of finished points and their folder.
    """
    listed = [quantities] if isinstance(quantities, str) else quantities
    wanted: dict[str, Quantity] = dict(listed) if isinstance(listed, Mapping) else {name: name for name in listed}
    functions = {name: function for name, function in wanted.items() if not isinstance(function, str)}
    origin = identity(analysis)
    swept = {
        LOADS[path][0] if path in LOADS else path[4:]: given
        for given, path in zip(over, map(canonical, over), strict=True)
        if path in LOADS or path[:4] == "run."
    }
    for name, path in swept.items():
        if name in run and not isinstance(over[path], Tolerance):
            raise ParameterError(f"{canonical(path)} is given twice, by {name} and as an axis. Give it once.")
    _check_settings(swept.keys() | set(run), set(run), analysis)
    for name, value in plain(run).items():
        try:
            fingerprint(value)
        except (TypeError, ValueError, AttributeError, RecursionError):
            raise ParameterError(
                f"run.{name} = {quoted(value)} is not valid: it must be numbers, texts, and lists of them."
            ) from None
    parameters = {path: named(path, motor, drive, run) for path in over}
    shape, coordinates, changes = plan_of(over, parameters, samples, sampling, seed)
    versions = versions_here()
    tasks = [Task(analysis, *changed(motor, drive, run, change), functions, versions) for change in changes]
    addresses = [task.address for task in tasks]
    found, failed = _answers_to(
        dict(zip(addresses, tasks, strict=True)), wanted, Store(store), workers, executor, progress or (lambda *_: None)
    )
    refusals = [error for error in failed.values() if isinstance(error, ParameterError)]
    if not found and len(refusals) == len(failed):
        raise refusals[0]
    dataset = _dataset(shape, coordinates, addresses, list(wanted), found, failed)
    dataset.attrs = {
        "title": f"{motor.name}: {', '.join(wanted)} over {', '.join(over)}",
        "parameter_set": motor.name,
        "motor": json.dumps(motor.to_dict()),
        "drive": json.dumps(drive_document(drive)),
        "run": json.dumps(plain(run)),
        "cautions": json.dumps(grouped([found[address]["cautions"] for address in addresses if address in found])),
        "analysis": origin["function"],
        **({"sampling": f"{sampling}, seed {seed}"} if "sample" in shape else {}),
        **versions,
        "deck_sha256": fingerprint(dataset["deck_sha256"].values.tolist()),
    }
    return dataset


def _check_settings(given: set[str], arguments: set[str], analysis: Analysis) -> None:
    """Check that the analysis has the settings that are given, some of them as arguments, and all that it needs."""
    _, _, *settings = inspect.signature(analysis).parameters.values()
    named = {setting.name: setting for setting in settings if setting.kind is not setting.VAR_KEYWORD}
    for name in sorted(given):
        if name not in named and len(named) == len(settings):
            own = [argument for argument in inspect.signature(sweep).parameters if argument != "run"]
            known = [f"run.{setting}" for setting in named]
            raise unknown(name, [*own, *named], "argument") if name in arguments else unknown(f"run.{name}", known)
    for name, setting in named.items():
        if setting.default is setting.empty and name not in given:
            raise ParameterError(f"The setting {name} is missing. Specify it, or sweep over run.{name}.")


def _answers_to(
    tasks: Mapping[str, Task],
    wanted: Mapping[str, Quantity],
    store: Store,
    workers: int | None,
    executor: Executor | None,
    progress: Callable[[int, int], None],
) -> tuple[dict[str, dict[str, Any]], dict[str, BaseException]]:
    """Return by address what the points gave, and why others failed: out of the store, or worked out and stored."""
    stored = {address: store.get(task.content) for address, task in tasks.items()}
    found = {address: _picked(result, wanted) for address, result in stored.items() if result is not None}
    failed: dict[str, BaseException] = {}
    progress(len(found), len(tasks))
    missing = {address: task for address, task in tasks.items() if address not in found}
    try:
        if executor is None:
            for address, answer in _together(missing):
                store.put(tasks[address].content, answer)
                found[address] = _picked(answer, wanted)
                del missing[address]
                progress(len(found), len(tasks))
        with closing(outcomes(missing, workers, executor)) as answers:
            for address, outcome in answers:
                if isinstance(outcome, BaseException):
                    failed[address] = outcome
                else:
                    store.put(tasks[address].content, outcome)
                    found[address] = _picked(outcome, wanted)
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


def _picked(result: Mapping[str, Any], wanted: Mapping[str, Quantity]) -> dict[str, Any]:
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


def _dataset(
    shape: Mapping[str, int],
    coordinates: Mapping[str, Any],
    addresses: Sequence[str],
    names: Sequence[str],
    found: Mapping[str, Mapping[str, Any]],
    failed: Mapping[str, BaseException],
) -> xarray.Dataset:
    from pyspice_runner.datasets import Dataset

    def shaped(values: list[Any]) -> Any:
        return np.array(values).reshape(tuple(shape.values()))

    empty = dict.fromkeys(names, float("nan")) | {"deck_sha256": ""}
    rows = [found.get(address, empty) for address in addresses]
    variables = {name: (shaped([row[name] for row in rows]), {"units": unit_of_name(name)}) for name in names}
    for flag, meaning in FLAGS.items():
        if flag not in names and any(flag in row for row in rows):
            values = [row.get(flag, float("nan")) for row in rows]
            variables[flag] = (shaped(values), {"units": "1", "long_name": meaning})
    variables["failure"] = (
        shaped([_reason(failed[address]) if address in failed else "" for address in addresses]),
        {"long_name": "why the point failed"},
    )
    variables["deck_sha256"] = (shaped([row["deck_sha256"] for row in rows]), {"long_name": "hash of the deck"})
    return Dataset(
        {name: (tuple(shape), values, attributes) for name, (values, attributes) in variables.items()},
        coordinates,
        {},
    )


def _reason(error: BaseException) -> str:
    if isinstance(error, BrokenExecutor | CancelledError):
        return (
            "The worker was lost: killed, out of memory, or cut off. Begin the sweep again for what is missing. If all "
            "are lost, the sweep uses a function of a script, which needs `if __name__ == '__main__':`."
        )
    return str(error) if isinstance(error, ParameterError | SimulationError) else f"{type(error).__name__}: {error}"


def met(dataset: xarray.Dataset, limits: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Return the yield of a sweep, the share of its points within all limits, JSON-ready.

    A point that failed does not meet them. The interval of 95 % is that of E. B. Wilson (J. Am. Stat. Assoc. 22, 1927)
    for samples that are drawn at random; those of a Sobol sequence lie closer.

    Args:
        dataset: the result of ``sweep``.
        limits: name of a quantity → minimum and maximum.

    Raises:
        ParameterError: for a name that is no quantity of the sweep.
    """
    from scipy.stats import binomtest  # takes long to load

    from pyspice_runner.datasets import Sweep

    known = Sweep(dataset).quantities
    for name in limits:
        if name not in known:
            raise ParameterError(f"{name} is no quantity of the sweep; it has {', '.join(known)}.")
    within = {
        name: (dataset[name].values >= low) & (dataset[name].values <= high) for name, (low, high) in limits.items()
    }
    count, good = int(np.prod(list(dataset.sizes.values()))), int(np.all([*within.values()], axis=0).sum())
    interval = binomtest(good, count).proportion_ci(method="wilson")
    return {
        "points": count, "good": good, "yield": good / count,
        "interval_95": [float(interval.low), float(interval.high)],
        "limits": {name: json_ready(list(ends)) for name, ends in limits.items()},
        "each": {name: int(points.sum()) for name, points in within.items()},
    }  # fmt: skip
