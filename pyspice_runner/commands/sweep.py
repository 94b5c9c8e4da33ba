# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor sweep``: many runs, on grids and within tolerances."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    TimeoutOption,
    check_targets,
    complain,
    deliver,
    grid,
    jsonable,
    load_changed,
    points_progress,
    write_dataset,
)
from pyspice_runner.commands.contacting import ContactKind, ContactOption, SlidersOption
from pyspice_runner.commands.driving import DriveOptions, with_drive_options

if TYPE_CHECKING:
    import xarray


QUANTITIES = ["mean_rotor_speed_rad_s", "mean_torque_n_m"]
OPERATING_QUANTITIES = ["torque_n_m", "efficiency", "settled"]


class AnalysisKind(StrEnum):
    """What is done at a point."""

    simulate = "simulate"
    operating_point = "operating-point"


class DistributionKind(StrEnum):
    """How values lie within their tolerances."""

    uniform = "uniform"
    normal = "normal"


class SamplingKind(StrEnum):
    """How samples are spread."""

    sobol = "sobol"
    latin_hypercube = "latin-hypercube"


@with_drive_options
def sweep(
    motor: MotorArgument,
    drive: DriveOptions,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH=VALUES", help="A grid: contact.preload_n=2,5,9, or drive.voltage=20:80:7 (first:last:count)."
        ),
    ] = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH=PERCENT", help="A tolerance about the nominal value: contact.friction=10%."),
    ] = None,
    quantity: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="What to keep: a name in `simulate --json`, or of `speed-torque`. Repeatable."
        ),
    ] = None,
    analysis: Annotated[
        AnalysisKind, typer.Option(help="simulate: one run from rest; operating-point: settled at a speed.")
    ] = AnalysisKind.simulate,
    distribution: Annotated[
        DistributionKind, typer.Option(help="Of tolerances; normal: the tolerance is three standard deviations.")
    ] = DistributionKind.uniform,
    samples: Annotated[int, typer.Option(help="Samples within the tolerances.")] = 64,
    sampling: Annotated[SamplingKind, typer.Option(help="How samples are spread.")] = SamplingKind.sobol,
    seed: Annotated[int, typer.Option(help="Seed of the samples.")] = 0,
    workers: Annotated[int | None, typer.Option(help="Processes; default: one a core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster, as tcp://10.0.0.1:8786.")
    ] = None,
    store: Annotated[
        Path | None, typer.Option(help="Folder of finished points; default: in the user's cache folder.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Simulate: simulated time, s; default: 5e-3.")] = None,
    contact: ContactOption = ContactKind.spring_slider,
    sliders: SlidersOption = 8,
    speed: Annotated[float | None, typer.Option(help="Hold the shaft at this speed, rad/s.")] = None,
    load_torque: Annotated[float | None, typer.Option(help="Simulate: torque that a load draws, N.m.")] = None,
    timeout: TimeoutOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> int:
    """Run a motor at many values of its parameters, the drive's (drive.voltage) and the run's (run.load_torque).

    Finished points are stored; a sweep that was interrupted goes on when begun again. Writes .nc, .csv or .json.

    Example: piezomotor sweep andersen2002 --over drive.voltage=40:80:5 --tolerance contact.friction=10% --samples 16
    """
    check_targets(output, (".nc", ".csv", ".json"), plot)
    loaded = load_changed(motor, changes)
    excitation = drive.stated(loaded)
    axes: dict[str, Any] = {path: grid(f"--over {path}", text) for path, text in _pairs("--over", over)}
    for path, text in _pairs("--tolerance", tolerance):
        if path in axes:
            raise pr.ParameterError(f"{path} is given to --over and to --tolerance. Give it to one of them.")
        axes[path] = pr.Tolerance(_percent(path, text), distribution.value)
    settings: dict[str, Any] = {"speed": speed, "duration": duration, "load_torque": load_torque, "timeout": timeout}
    if contact is ContactKind.brush:
        settings["sliders"] = sliders
    run = {name: value for name, value in settings.items() if value is not None}
    if contact is not ContactKind.spring_slider:  # which is the default of the run
        run["contact"] = contact.law
    if analysis is AnalysisKind.operating_point:
        how: dict[str, Any] = {"analysis": pr.operating_point, "quantities": quantity or OPERATING_QUANTITIES, **run}
    else:
        how = {"quantities": quantity or QUANTITIES, "duration": 5e-3, **run}
    with _cluster(scheduler, workers) as executor, points_progress() as progress:
        try:
            dataset = pr.sweep(
                loaded,
                excitation,
                over=axes,
                **how,
                samples=samples,
                sampling=sampling.value,
                seed=seed,
                store=store,
                workers=workers,
                executor=executor,
                progress=progress,
            )
        except KeyboardInterrupt as interrupt:
            complain(
                f"piezomotor: interrupted; {str(interrupt) or 'nothing is lost; the same sweep, begun again, goes on'}."
            )
            return 130
    document = _document(dataset)
    deliver(
        document, _summary(dataset, document), as_json,
        (output, lambda path: write_dataset(path, dataset, document)),
        (plot, lambda path: pr.plot_sweep(dataset, path)),
    )  # fmt: skip
    if document["failures"]:
        first = document["failures"][0]["reason"]
        complain(f"piezomotor: {len(document['failures'])} of {document['points']} points failed; the first: {first}")
        return 3
    return 0


def _pairs(option: str, texts: list[str] | None) -> Iterator[tuple[str, str]]:
    for text in texts or []:
        path, equals, values = text.partition("=")
        if not equals:
            raise pr.ParameterError(f"{option} {text!r} names no values; write it as PATH=VALUES.")
        yield path.strip(), values


def _percent(path: str, text: str) -> float:
    try:
        number, percent, rest = text.strip().removeprefix("±").partition("%")
        if not percent or rest:
            raise ValueError
        return float(number) / 100.0
    except ValueError:
        raise pr.ParameterError(f"--tolerance {path}: {text!r} is no percentage. Write it as 10%.") from None


@contextmanager
def _cluster(address: str | None, workers: int | None) -> Iterator[Executor | None]:
    """Yield the executor of a Dask cluster, or none."""
    if address is None:
        yield None
        return
    if workers is not None:
        raise pr.ParameterError("--workers and --scheduler exclude each other: a cluster has its own workers.")
    try:
        from distributed import Client
    except ImportError:
        raise pr.ParameterError(
            "--scheduler needs Dask. Install it: `pip install 'pyspice-runner[distributed]'`."
        ) from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError, TypeError, RuntimeError) as error:  # by the kind of address
        raise pr.ParameterError(
            f"There is no Dask scheduler at {address}: {error}. Start one, `dask scheduler`."
        ) from error
    with client:
        yield client.get_executor()


def _document(dataset: xarray.Dataset) -> dict[str, Any]:
    """Return the result JSON-ready, ``null`` where a point failed."""
    failure = dataset["failure"]
    quantities = [str(name) for name in dataset.data_vars if name not in ("failure", "deck_sha256")]
    failures = [failure[tuple(index)] for index in np.argwhere(failure.values != "")]
    attributes = {str(name): value for name, value in dataset.attrs.items()}
    decoded = {name: json.loads(attributes[name]) for name in ("motor", "drive", "run")}
    return {
        "points": failure.size,
        "dimensions": {str(name): size for name, size in dataset.sizes.items()},
        "coordinates": {str(name): values.values.tolist() for name, values in dataset.coords.items()},
        "quantities": {name: jsonable(dataset[name].values.tolist()) for name in quantities},
        "failures": [
            {"at": {str(name): value.item() for name, value in point.coords.items()}, "reason": point.item()}
            for point in failures
        ],
        "provenance": attributes | decoded,
    }


def _summary(dataset: xarray.Dataset, document: dict[str, Any]) -> Table:
    marked = ("lowest", "5 %", "median", "95 %", "highest")
    table = Table("quantity", "unit", *marked, box=None, padding=(0, 2, 0, 0))
    table.title = f"{dataset.attrs['parameter_set']}, {document['points']} points"
    for name in document["quantities"]:
        values = dataset[name].values
        values = values[np.isfinite(values)]
        marks = np.quantile(values, [0.0, 0.05, 0.5, 0.95, 1.0]) if values.size else []
        table.add_row(name, dataset[name].attrs["units"], *(f"{mark:.4g}" for mark in marks))
    return table
