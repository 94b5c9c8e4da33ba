# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor sweep``: many runs, on grids and within tolerances."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVE, DRIVERS, LAW, LOAD, TARGETS, Call, command, option
from pyspice_runner.errors import did_you_mean
from pyspice_runner.motor import groups
from pyspice_runner.sweeps.plan import Distribution, Sampling
from pyspice_runner.sweeps.sweep import FLAGS, met
from pyspice_runner.units import linear_name

_DRIVEN = "driver part mosfet rail"
_IDLE = {  # options without effect on each analysis
    "simulate": _DRIVEN,
    "operating-point": f"duration load_torque soft_start {_DRIVEN}",
    "drive": "",
    "driver-state": "duration soft_start",
}


@command(
    "motor", DRIVE, "over tolerance quantity analysis driver rail limit part mosfet",
    "distribution samples sampling seed workers scheduler store duration", LAW, "speed load_torque timeout",
    CHANGES, TARGETS,
    over=option(
        "A grid: contact.preload_n=2,5,9, or drive.voltage=20:80:7 (first:last:count).",
        list[str] | None, metavar="PATH=VALUES",
    ),
    tolerance=option(
        "A tolerance about the nominal value: contact.friction=10%.", list[str] | None, metavar="PATH=PERCENT"
    ),
    quantity=option(
        "What to keep: a name in `simulate --json`, or of `speed-torque`. Repeatable.", list[str] | None, metavar="NAME"
    ),
    analysis=option(
        "simulate: a run from rest; operating-point: settled at a speed; drive: a run of a driver; driver-state: the "
        "steady state behind one.", Literal["simulate", "operating-point", "drive", "driver-state"], "simulate"
    ),
    driver=option(f"Drive, driver-state: {DRIVERS}; default: linear.", str | None),
    rail=option("Drive, driver-state: rails for which transformer and MOSFET are designed, V."),
    limit=option(
        "A limit of a quantity, for the yield. Either end may be left out.", list[str] | None, metavar="NAME=LOW:HIGH"
    ),
    distribution=option("Distribution; normal: the tolerance is three standard deviations.", Distribution, "uniform"),
    samples=option("Samples within the tolerances.", int, 64),
    sampling=option("Sampling method.", Sampling, "sobol"),
    seed=option("Seed of the samples.", int, 0),
    workers=option("Worker processes; default: one per core.", int | None),
    scheduler=option("Address of a Dask cluster, such as tcp://10.0.0.1:8786.", str | None, metavar="ADDRESS"),
    store=option("Folder of finished points; default: in the user's cache folder.", Path | None),
    duration=option("Simulate: simulated time, s; default: as `simulate`."),
    speed=option("Hold the shaft at this speed, rad/s (slider: m/s)."),
    load_torque=option("Simulate: torque of a load, N.m (slider: N).", float | None, None, *LOAD),
)  # fmt: skip
def sweep(call: Call) -> int:
    """Run a motor at many values of its parameters, the drive's (drive.voltage) and the run's (run.load_torque).

    Finished points are stored; an interrupted sweep continues when it is started again. Writes .nc, .csv or .json.

    Example: piezomotor sweep andersen2002 --over drive.voltage=40:80:5 --tolerance contact.friction=10% --samples 16
    """
    contact, analysis = call.law, call.analysis
    call.driven = analysis in ("drive", "driver-state")
    call.refuse_idle(f"on --analysis {analysis}", _IDLE[analysis])
    if not call.tolerance:
        call.refuse_idle("without --tolerance", "distribution samples sampling seed")
    call.check(".nc", ".csv", ".json")
    loaded = call.loaded
    behind: pr.Driver | None = None
    if call.driven:
        behind = call.spec_of(call.driver or "linear", call.stated).built(
            loaded, contact=contact, speed=call.speed, load_torque=call.load_torque or 0.0
        )
    excitation = behind or call.stated
    axes: dict[str, Any] = {**common.axes_of(call.over)}
    common.refuse_covered(call.context, axes)
    for path, text in common.pairs_of("--tolerance", call.tolerance):
        if path in axes:
            raise pr.ParameterError(f"{path} is given to --over and to --tolerance. Give it to one of them.")
        name = path.removeprefix("drive.")
        if behind and name != path and "." in name and behind.left_out(name):
            raise pr.ParameterError(
                f"{path} has no tolerance: at {behind.setting(name):g} {behind.unit(name)}, an end of its "
                "range, there is no such part in this driver. Leave it out."
            )
        axes[path] = pr.Tolerance(common.percentage("--tolerance", path, text), call.distribution)
    settings = call.pick("speed duration load_torque timeout")
    run = {name: value for name, value in settings.items() if value is not None}
    if call.contact != PAPER_LAW.name:  # which is the default of the run
        run["contact"] = contact
    usual = _question(analysis, call.quantity, loaded)
    if loaded.slider and not call.quantity:
        usual["quantities"] = [linear_name(name) or name for name in usual["quantities"]]
    limits = _limits(call.limit, [*usual["quantities"], *FLAGS])
    how = {name: value for name, value in usual.items() if f"run.{name}" not in axes} | run
    with _cluster(call.scheduler, call.workers) as executor, common.points_progress() as progress:
        try:
            dataset = pr.sweep(
                loaded, excitation, over=axes, **how, **call.pick("samples sampling seed store workers"),
                executor=executor, progress=progress,
            )  # fmt: skip
        except KeyboardInterrupt as interrupt:
            common.complain(
                f"piezomotor: interrupted; {str(interrupt) or 'start the same sweep again to continue it'}."
            )
            return common.INTERRUPTED
    result = dataset.piezomotor
    common.caution(result)
    document = result.to_dict()
    specified = {} if limits is None else met(dataset, limits)
    values = dataset[result.quantities].to_dataframe().astype(float).where(np.isfinite)
    marks = values.quantile([0.0, 0.05, 0.5, 0.95, 1.0]).T.to_string(float_format="{:.4g}".format)
    title = f"{dataset.attrs['parameter_set']}, {excitation.label}, quantiles of {len(values)} points"
    if specified:
        low, high = specified["interval_95"]
        marks += f"\nyield: {specified['good']} of {specified['points']} points, {specified['yield']:.3g}"
        marks += f" (95 %: {low:.3g} to {high:.3g})"
        document["yield"] = specified
    call.write(document, f"{title}\n{marks}\n", result.save, result.plot)
    return 3 if result.failures else 0


def _question(analysis: str, quantity: list[str] | None, motor: pr.Motor) -> dict[str, Any]:
    """Return the analysis of a point, what is kept of it, and the settings that are not given."""
    if motor.is_transducer and analysis in ("simulate", "operating-point"):
        from pyspice_runner.steady.transducer import transducer_state

        kept = ["power_w", "power_factor", "current_a_rms_a", "motional_current_amplitude_a_a"]
        run: dict[str, Any] = {"duration": max(common.DURATION, motor.settled_s)}
        return {"quantities": quantity or kept, **(run if analysis == "simulate" else {"analysis": transducer_state})}
    if analysis == "operating-point":
        from pyspice_runner.steady.speed_torque import held_point

        return {"analysis": held_point, "quantities": quantity or ["torque_n_m", "efficiency", "settled"]}
    if analysis == "driver-state":
        from pyspice_runner.drivers.design import driver_state

        shaft = ["motional_current_a"] if motor.is_transducer else ["torque_n_m", "speed_rad_s"]
        volts = [groups.column("voltage", group, "v") for group in motor.groups]
        kept = [*shaft, *volts, "stage_power_w", "power_factor"]
        return {"quantities": quantity or kept, "analysis": driver_state}
    if analysis == "drive":
        kept = ["motor_power_w", "driver_efficiency", "mean_rotor_speed_rad_s"]
        if motor.is_transducer:  # values of the steady state
            kept = ["load_power_w", "damping_loss_w", "motional_current_amplitude_a_a"]
        return {"quantities": quantity or kept, "analysis": pr.drive_report, "duration": 3e-3}
    return {"quantities": quantity or ["mean_rotor_speed_rad_s", "mean_torque_n_m"], "duration": common.DURATION}


def _limits(texts: list[str] | None, known: list[str]) -> dict[str, tuple[float, float]] | None:
    """Return the limits of a specification, of known quantities."""
    found = common.limits_of(texts)
    for name in found:
        if name not in known:
            raise pr.ParameterError(
                f"--limit {name}: there is no such quantity in this sweep. {did_you_mean(name, known, 'It has')} "
                "Keep another one by --quantity NAME."
            )
    return found or None


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
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError:
        raise pr.ParameterError(
            "--scheduler needs Dask. Install it: `pip install 'piezomotor[distributed]'`."
        ) from None
    try:
        # a client would start its event loop first, and repeat a refused connection for its whole timeout
        socket.create_connection(parse_host_port(parse_address(address)[1]), timeout=10).close()
        client = Client(address, timeout=10, set_as_default=False)  # a failed one would remain Dask's default
    except (OSError, ValueError, TypeError, RuntimeError, OverflowError) as error:  # by the kind of address
        raise pr.ParameterError(
            f"There is no Dask scheduler at {address}: {error}. Start one, `dask scheduler`."
        ) from error
    with client:
        yield client.get_executor()
