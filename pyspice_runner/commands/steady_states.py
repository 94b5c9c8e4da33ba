# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor steady``, ``small-signals``, ``map`` and ``speed-torque``: a motor in the steady state."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.drive import DriverOptions
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import AuditOptions, LoadOption, PeriodOptions, SpeedOption, Targets, with_options
from pyspice_runner.errors import Interrupted
from pyspice_runner.run.paths import LOADS, canonical
from pyspice_runner.steady.working_points import ACCURACY, Objective

_SHOWN = ["torque_n_m", "normal_force_n", "shaft_power_w", "efficiency", "separated", "stick", "slip", "settled"]


@with_options
def steady(
    context: typer.Context,
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    speed: SpeedOption = None,
    load: LoadOption = 0.0,
    period: PeriodOptions,
    accuracy: Annotated[float, typer.Option(help="Error allowed of the torque, relative to mu F0 R.")] = 2e-3,
    driver: DriverOptions,
    audit: AuditOptions,
    changes: common.SetOption = None,
    targets: Targets,
) -> int:
    """Find the periodic steady state and its stability. Writes .json, .csv or .nc (one period), .cir (its deck).

    Example: piezomotor steady bimodal40 --voltage 90 --speed 30 --json
    """
    driver.check(context)
    targets.check(".json", ".csv", ".nc", ".cir")
    loaded, in_front = driver.applied(motor, changes)
    stated = drive.stated(loaded)
    with common.busy("ngspice runs periods of the drive"):
        source = in_front(stated, period.law)
        result = pr.steady_state(
            loaded, source, speed=speed, load_torque=load, accuracy=accuracy, **period.settings,
            **audit.settings,
        )  # fmt: skip
    common.caution(result)
    targets.deliver(result, f"{loaded.name}: {result.drive.label}")
    return 0 if result.converged else 3


@with_options
def small_signals(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    frequencies: Annotated[
        str, typer.Option(help="Frequencies of the modulation, Hz: 10,100,1000 or 100:5000:8.")
    ] = "10,30,100,300,1000,3000",
    speed: SpeedOption = None,
    load: LoadOption = 0.0,
    period: PeriodOptions,
    changes: common.SetOption = None,
    targets: Targets,
) -> None:
    """Find transfer functions and hot admittance of a running motor. Writes .json, .csv or .nc.

    Example: piezomotor small-signals andersen2002-unintended-mode --frequency 46e3 --load 5e-3 --frequencies 100,1000
    """
    targets.check(".json", ".csv", ".nc")
    loaded = common.load_changed(motor, changes)
    with common.busy("ngspice runs periods of the drive"):
        result = pr.small_signals(
            loaded, drive.stated(loaded), frequencies=common.grid("--frequencies", frequencies), speed=speed,
            load_torque=load, **period.settings,
        )  # fmt: skip
    common.caution(result)
    targets.deliver(result, f"{loaded.name}: {result.state.drive.label}")


@with_options
def map_points(
    context: typer.Context,
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    over: Annotated[
        list[str],
        typer.Option(metavar="PATH=VALUES", help="An axis: drive.frequency=44e3:46e3:10. Twice for a plane."),
    ],
    objective: Annotated[Objective, typer.Option(help="Quantity that the best point maximises.")] = "torque",
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Greatest value allowed: current_a=0.1, temperature_c=100. Repeatable."
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="Speed of the held shaft, rad/s (slider: m/s); default: by the objective."),
    ] = None,
    load: LoadOption = 0.0,
    period: PeriodOptions,
    accuracy: Annotated[float, typer.Option(help="Error allowed of the torque, relative to mu F0 R.")] = ACCURACY,
    changes: common.SetOption = None,
    targets: Targets,
) -> None:
    """Map steady states over parameters and find the best point. Writes .nc, .csv or .json.

    Example: piezomotor map andersen2002-unintended-mode --over drive.frequency=44e3:46e3:5
    --over drive.voltage=60,100 --limit current_a=0.06 --plot map.png
    """
    targets.check(".nc", ".csv", ".json")
    loaded = common.load_changed(motor, changes)
    limits, axes = _limits(limit), common.axes_of(over)
    free = speed is None and not load and not LOADS.keys() & set(map(canonical, axes))
    if not (free and objective in ("efficiency", "power")):  # whose speed is found under the given drive
        common.refuse_covered(context, axes)
    with common.points_progress() as progress:
        dataset = pr.working_points(
            loaded, drive.stated(loaded), over=axes, objective=objective, limits=limits,
            speed=speed, load_torque=load, accuracy=accuracy, progress=progress, **period.settings,
        )  # fmt: skip
    result = dataset.piezomotor
    common.caution(result)
    targets.deliver(result, dataset.attrs["title"])


def _limits(texts: list[str] | None) -> dict[str, float]:
    told = "is not NAME=VALUE; write it as current_a=0.1."
    found = {}
    for name, value in common.pairs_of("--limit", texts, told):
        try:
            found[name] = float(value)
        except ValueError:
            raise pr.ParameterError(f"--limit {f'{name}={value}'!r} {told}") from None
    return found


@with_options
def speed_torque(
    context: typer.Context,
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    speeds: Annotated[
        str | None,
        typer.Option(
            help="Speeds: 0,2.5,5 or seven from -5, --speeds=-5:10:7, the default, rad/s; of a slider -0.2:0.4:7, m/s."
        ),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH=VALUES", help="A further axis, as drive.voltage=40,60,80. Repeatable."),
    ] = None,
    mode: Annotated[
        Literal["steady", "settle"], typer.Option(help="steady: solve; settle: run until settled.")
    ] = "steady",
    follow: Annotated[
        str | None,
        typer.Option(metavar="AXIS", help="Follow the branch of steady states along this axis, through folds."),
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Largest change from block to block of a settled point.")] = 1e-3,
    patience: Annotated[int, typer.Option(help="Number of blocks after which a point counts as not settled.")] = 40,
    period: PeriodOptions,
    audit: AuditOptions,
    changes: common.SetOption = None,
    targets: Targets,
) -> int:
    """Measure torque, power and losses over speed. Writes .nc, .csv or .json.

    Example: piezomotor speed-torque andersen2002-unintended-mode --voltage 100 --frequency 46e3 --phase 180
    --speeds=-5:25:13 --plot curve.png
    """
    targets.check(".nc", ".csv", ".json")
    loaded = common.load_changed(motor, changes)
    excitation, axes = drive.stated(loaded), common.axes_of(over)
    common.refuse_covered(context, axes)
    turning = common.grid("--speeds", speeds or ("-0.2:0.4:7" if loaded.slider else "-5:10:7"))
    if follow is not None:
        of_speed = canonical(follow) == "load.speed"
        along = turning if of_speed else axes.pop(follow, None)
        if along is None or axes or (len(turning) > 1 and not of_speed):
            raise pr.ParameterError(f"--follow {follow} needs --over {follow}=VALUES alone, and one value of --speeds.")
        branch = pr.steady_branch(
            loaded, excitation, follow=follow, start=along[0], stop=along[-1], speed=None if of_speed else turning[0],
            **period.settings,
        )  # fmt: skip
        targets.deliver(branch.piezomotor, branch.attrs["title"])
        return 0
    status = 0
    with common.points_progress() as progress:
        try:
            curve = pr.speed_torque(
                loaded,
                excitation,
                speeds=turning,
                over=axes,
                mode=mode,
                tolerance=tolerance,
                patience=patience,
                progress=progress,
                **period.settings,
                **audit.settings,
            )
        except (Interrupted, pr.SimulationError) as fault:
            if fault.partial is None:
                raise
            curve = fault.partial
            status = common.INTERRUPTED if isinstance(fault, Interrupted) else 3
            common.complain(f"piezomotor: {fault}")
    result = curve.piezomotor
    common.caution(result)
    shown = curve[_SHOWN]
    if result.linear:
        shown = shown.swap_dims(speed_rad_s="speed_m_s").drop_vars("speed_rad_s").rename(torque_n_m="force_n")
    points = shown.to_dataframe().dropna(subset=next(iter(shown))).to_string(float_format="{:.4g}".format)
    targets.write(result.to_dict(), f"{curve.attrs['title']}\n{points}\n", result.save, result.plot)
    return status
