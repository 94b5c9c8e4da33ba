# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor steady``, ``small-signals``, ``map`` and ``speed-torque``: a motor in the steady state."""

from __future__ import annotations

import re
from math import inf, isnan
from typing import Literal

import numpy as np
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVE, DRIVER, PERIOD, TARGETS, Call, command, option
from pyspice_runner.errors import did_you_mean
from pyspice_runner.result import json_ready
from pyspice_runner.run.paths import LOADS, canonical
from pyspice_runner.steady.speed_torque import no_load_state
from pyspice_runner.steady.working_points import ACCURACY, Objective
from pyspice_runner.units import linear_unit

SPEEDS = 9  # of a curve, by default
_SHOWN = ["torque_n_m", "normal_force_n", "shaft_power_w", "efficiency", "separated", "stick", "slip", "settled"]


@command("motor", DRIVE, "speed load_torque", PERIOD, "accuracy", DRIVER, "audit", CHANGES, TARGETS, accuracy=2e-3)
def steady(call: Call) -> int:
    """Find the periodic steady state and its stability. Writes .json, .csv or .nc (one period), .cir (its deck).

    Example: piezomotor steady bimodal40 --voltage 90 --speed 30 --json
    """
    call.check(".json", ".csv", ".nc", ".cir", starts=False)
    motor = call.loaded
    if motor.is_transducer:
        return _linear(call)
    with common.busy("ngspice runs periods of the drive"):
        result = pr.steady_state(
            motor, call.in_front(), contact=call.law, **call.pick("speed load_torque accuracy step timeout audit"),
        )  # fmt: skip
    call.deliver(result, f"{motor.name}: {result.drive.label}")
    return 0 if result.converged else 3


def _linear(call: Call) -> int:
    """Deliver the steady state of a transducer."""
    from pyspice_runner.steady.transducer import transducer_state

    idle = "accuracy step timeout audit contact driver plot"
    call.refuse_idle("on a transducer, whose steady state under ideal voltages is in closed form", idle)
    call.check(".json")
    result = transducer_state(call.loaded, call.stated, **call.pick("speed load_torque"))
    call.deliver(result, f"{call.loaded.name}: {result.drive.label}")
    return 0


@command(
    "motor", DRIVE, "frequencies speed load_torque", PERIOD, CHANGES, TARGETS,
    frequencies=option("Frequencies of the modulation, Hz: 10,100,1000 or 100:5000:8.", str, "10,30,100,300,1000,3000"),
)  # fmt: skip
def small_signals(call: Call) -> None:
    """Find transfer functions and hot admittance of a running motor. Writes .json, .csv or .nc.

    Example: piezomotor small-signals andersen2002-unintended-mode --frequency 46e3 --load 5e-3 --frequencies 100,1000
    """
    call.check(".json", ".csv", ".nc", starts=False)
    with common.busy("ngspice runs periods of the drive"):
        result = pr.small_signals(
            call.loaded, call.stated, frequencies=common.grid("--frequencies", call.frequencies), contact=call.law,
            **call.pick("speed load_torque step timeout"),
        )  # fmt: skip
    call.deliver(result, f"{call.loaded.name}: {result.state.drive.label}")


@command(
    "motor", DRIVE, "over objective limit speed load_torque", PERIOD, "accuracy", CHANGES, TARGETS,
    over=option("An axis: drive.frequency=44e3:46e3:10. Twice for a plane.", list[str], ..., metavar="PATH=VALUES"),
    objective=option("Quantity that the best point maximises.", Objective, "torque"),
    limit=option(
        "A limit: current_a=:0.1 (or current_a=0.1) or torque_n_m=0.03:. Repeatable.",
        list[str] | None, metavar="NAME=LOW:HIGH",
    ),
    speed=option("Speed of the held shaft, rad/s (slider: m/s); default: by the objective."),
    accuracy=ACCURACY,
)  # fmt: skip
def map_points(call: Call) -> int:
    """Map steady states over parameters and find the best point. Writes .nc, .csv or .json.

    Example: piezomotor map andersen2002-unintended-mode --over drive.frequency=44e3:46e3:5
    --over drive.voltage=60,100 --limit current_a=0.06 --plot map.png
    """
    call.check(".nc", ".csv", ".json", starts=False)
    limits, axes = common.limits_of(call.limit, bare=True), common.axes_of(call.over)
    if call.loaded.is_transducer:
        return _linear_map(call, axes, limits)
    bounds = {name: high if low == -inf else (low, high) for name, (low, high) in limits.items()}
    free = call.speed is None and not call.load_torque and not LOADS.keys() & set(map(canonical, axes))
    if not (free and call.objective in ("efficiency", "power")):  # whose speed is found under the given drive
        common.refuse_covered(call.context, axes)
    with common.points_progress() as progress:
        dataset, status = common.finished(lambda: pr.working_points(
            call.loaded, call.stated, over=axes, limits=bounds, contact=call.law, progress=progress,
            **call.pick("objective speed load_torque accuracy step timeout"),
        ))  # fmt: skip
    call.deliver(dataset.piezomotor, dataset.attrs["title"])
    return status


def _linear_map(call: Call, axes: dict[str, list[float]], limits: dict[str, tuple[float, float]]) -> int:
    """Deliver the steady states of a transducer on a grid, and the point of most power into its load within limits."""
    from pyspice_runner.steady.transducer import transducer_state

    call.refuse_idle(
        "on a transducer, whose map is of the power into its load", f"objective speed load_torque {PERIOD}"
    )
    common.refuse_covered(call.context, axes)
    motor = call.loaded
    known = [name for name, value in transducer_state(motor, call.stated).quantities.items() if value is not None]
    for name in limits:
        if name not in known:
            raise pr.ParameterError(f"--limit {name} is not known of {motor.name}. {did_you_mean(name, known)}")
    dataset = pr.sweep(motor, call.stated, over=axes, quantities=known, analysis=transducer_state, workers=1)
    goal = "load_power_w" if float(dataset["load_power_w"].max()) else "damping_loss_w"
    allowed = dataset[goal].where(dataset[goal].notnull(), -inf)
    for name, (low, high) in limits.items():
        allowed = allowed.where((dataset[name] >= low) & (dataset[name] <= high), -inf)
    point, result, best = dataset.isel(allowed.argmax(...)), dataset.piezomotor, None
    if float(allowed.max()) > -inf:
        best = {str(name): float(point[name]) for name in (*dataset.sizes, *known)}
    common.caution(result)
    shown = {f"best {name}": f"{value:.6g}" for name, value in best.items()} if best else {"best": "none within limits"}
    table = common.summary_table(shown, f"{motor.name}: {goal} over {' and '.join(axes)}")
    call.write(result.to_dict() | json_ready({"best": best, "limits": limits}), table, result.save, result.plot)
    return 3 if result.failures else 0


@command(
    "motor", DRIVE, "speeds over mode follow tolerance patience", PERIOD, "audit", CHANGES, TARGETS,
    speeds=option(
        "Speeds, rad/s (slider: m/s): 0,2.5,5, or --speeds=-5:10:7 for seven from -5 to 10 (first:last:count); "
        "default: nine from stall to no load.", str | None
    ),
    over=option("A further axis, as drive.voltage=40,60,80. Repeatable.", list[str] | None, metavar="PATH=VALUES"),
    mode=option("steady: solve; settle: run until settled.", Literal["steady", "settle"], "steady"),
    follow=option("Follow the branch of steady states along this axis, through folds.", str | None, metavar="AXIS"),
    tolerance=option("Largest change from block to block of a settled point.", float, 1e-3),
    patience=option("Number of blocks after which a point counts as not settled.", int, 40),
)  # fmt: skip
def speed_torque(call: Call) -> int:
    """Measure torque, power and losses versus speed. Writes .nc, .csv or .json.

    Example: piezomotor speed-torque andersen2002-unintended-mode --voltage 100 --frequency 46e3 --phase 180
    --speeds=-5:25:13 --plot curve.png
    """
    call.check(".nc", ".csv", ".json", starts=False)
    motor, axes = call.loaded, common.axes_of(call.over)
    common.refuse_covered(call.context, axes)
    speeds = common.grid_or_none("--speeds", call.speeds)
    if call.follow is not None:
        _follow(call, axes, speeds)
        return 0
    if speeds is None and "load.speed" not in map(canonical, axes):
        speeds = _up_to_no_load(call)
    with common.points_progress() as progress:
        curve, status = common.finished(lambda: pr.speed_torque(
            motor, call.stated, speeds=speeds, over=axes, contact=call.law, progress=progress,
            **call.pick("mode tolerance patience step timeout audit"),
        ))  # fmt: skip
    shown = curve[_SHOWN]
    if curve.piezomotor.linear:
        shown = shown.swap_dims(speed_rad_s="speed_m_s").drop_vars("speed_rad_s").rename(torque_n_m="force_n")
    points = shown.to_dataframe().dropna(subset=next(iter(shown))).reset_index()
    table = Table(title=curve.attrs["title"], box=None, padding=(0, 1, 0, 0))
    for name in points:
        unit = linear_unit(shown[name].attrs["units"]) if curve.piezomotor.linear else shown[name].attrs["units"]
        words = name.removesuffix(re.sub(r"\W", "_", f" {unit.lower()}")).replace("_", "\n").replace(".", ".\n")
        table.add_column(words if unit == "1" else f"{words}\n{unit}", justify="right")
    for *values, settled in points.itertuples(index=False, name=None):
        table.add_row(*("–" if isnan(value) else f"{value + 0.0:.4g}" for value in values), "yes" if settled else "no")
    call.deliver(curve.piezomotor, "", table)
    return status


def _up_to_no_load(call: Call) -> list[float]:
    """Return speeds from stall to no load. Raise ParameterError for a motor without a stable speed."""
    with common.busy("The speed without load"):
        free = no_load_state(call.loaded, call.stated, contact=call.law, **call.pick("step timeout"))
    if free is None or not free.reached:
        raise pr.ParameterError(
            f"{call.loaded.name} has no stable speed without load at {call.stated.label}. Give --speeds, as 0:40:9."
        )
    return [float(speed) for speed in np.linspace(0.0, free.speed_rad_s, SPEEDS)]


def _follow(call: Call, axes: dict[str, list[float]], speeds: list[float] | None) -> None:
    """Follow the branch of steady states along an axis, and deliver it."""
    of_speed = canonical(call.follow) == "load.speed"
    along = speeds if of_speed else axes.pop(call.follow, None)
    if along is None or axes or speeds is None or (len(speeds) > 1 and not of_speed):
        raise pr.ParameterError(
            f"--follow {call.follow} needs --over {call.follow}=VALUES alone, and one value of --speeds."
        )
    branch = pr.steady_branch(
        call.loaded, call.stated, follow=call.follow, start=along[0], stop=along[-1],
        speed=None if of_speed else speeds[0], contact=call.law, **call.pick("step timeout"),
    )  # fmt: skip
    call.deliver(branch.piezomotor, branch.attrs["title"])
