# SPDX-License-Identifier: GPL-3.0-or-later
"""The command ``piezomotor``.

Standard output carries the result, and with ``--json`` one JSON object and nothing else; progress and complaints go to
standard error. Exit status: 0 success, 2 refused input, 3 the simulator failed, 130 interrupted.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from enum import StrEnum
from math import floor, log10
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

import pyspice_runner as pr

app = typer.Typer(
    name="piezomotor",
    help="A SPICE model of a standing-wave piezomotor, run on ngspice.",
    epilog="Try first: piezomotor simulate andersen2002 --plot run.png",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

MotorArgument = Annotated[str, typer.Argument(metavar="MOTOR", help="A parameter set, or the path of a TOML file.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
OutputOption = Annotated[Path | None, typer.Option("--output", help="Write the result to a file, by its ending.")]
PlotOption = Annotated[Path | None, typer.Option("--plot", help="Draw the result: a .png, .svg or .pdf file.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Change a parameter, as contact.preload_n=8. Repeatable."),
]
TimeoutOption = Annotated[float | None, typer.Option(help="End ngspice after this many seconds.")]


class DriveKind(StrEnum):
    """The drives of the paper's equations (1) and (2)."""

    two_phase = "two-phase"
    two_tone = "two-tone"


class ContactKind(StrEnum):
    """What the tip touches."""

    spring_slider = "spring-slider"
    none = "none"


class StateKind(StrEnum):
    """State of the tip in an admittance."""

    free = "free"
    preloaded = "preloaded"


@app.command()
def motors(as_json: JsonOption = False, output: OutputOption = None, plot: PlotOption = None) -> None:
    """List the parameter sets that come with the package."""
    _check_targets(output, (".json", ".csv"), plot)
    found = [pr.load_motor(name) for name in pr.available_motors()]
    document = {
        "motors": [
            {"name": motor.name, "frequencies_hz": [mode.frequency_hz for mode in motor.modes]} for motor in found
        ]
    }
    table = Table("set", "modes", title="Parameter sets")
    for motor in found:
        table.add_row(motor.name, ", ".join(f"{mode.frequency_hz / 1e3:.4g} kHz" for mode in motor.modes))
    if output is not None:
        rows = [["motor", "mode", "frequency_hz"]]
        rows += [[motor.name, mode.name, f"{mode.frequency_hz:.9g}"] for motor in found for mode in motor.modes]
        _write(output, document, rows)
    if plot is not None:
        pr.plot_motors(found, plot)
    _print(document, table, as_json)


@app.command()
def show(
    motor: MotorArgument,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Show a motor: its modes, groups, contact and rotor, in SI units.

    Example: piezomotor show andersen2002 --plot modes.png
    """
    _check_targets(output, (".json", ".csv"), plot)
    loaded = _load(motor, changes)
    document = loaded.to_dict()
    rows = [["parameter", "value"], *([path, f"{value}"] for path, value in _flat(document))]
    if output is not None:
        _write(output, document, rows)
    if plot is not None:
        pr.plot_mode_shapes(loaded, plot)
    table = Table("parameter", "value", "from", title=loaded.name)
    for path, value in _flat(document):
        origin = loaded.provenance.get(path)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(path, shown, origin.kind if origin else "derived")
    _print(document, table, as_json)


@app.command()
def simulate(
    motor: MotorArgument,
    drive: Annotated[DriveKind, typer.Option(help="two-phase: eq. (1); two-tone: eq. (2).")] = DriveKind.two_phase,
    voltage: Annotated[float, typer.Option(help="Two-phase: amplitude of both groups, V.")] = 50.0,
    frequency: Annotated[float | None, typer.Option(help="Two-phase: frequency, Hz; default: the last mode.")] = None,
    phase: Annotated[float | None, typer.Option(help="Phase, degrees: 90 for two phases, 0 for two tones.")] = None,
    voltage_1: Annotated[float, typer.Option("--voltage-1", help="Two-tone: amplitude of the common tone, V.")] = 50.0,
    frequency_1: Annotated[float | None, typer.Option("--frequency-1", help="Two-tone: the common tone, Hz.")] = None,
    voltage_2: Annotated[float, typer.Option("--voltage-2", help="Two-tone: amplitude of the opposed tone, V.")] = 50.0,
    frequency_2: Annotated[float | None, typer.Option("--frequency-2", help="Two-tone: the opposed tone, Hz.")] = None,
    soft_start: Annotated[float, typer.Option(help="Rise time of the amplitude, s.")] = 0.0,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 5e-3,
    contact: Annotated[ContactKind, typer.Option(help="Contact law; none is a free tip.")] = ContactKind.spring_slider,
    speed: Annotated[float | None, typer.Option(help="Hold the shaft at this speed, rad/s.")] = None,
    load_torque: Annotated[float, typer.Option(help="Torque that a load draws from the shaft, N.m.")] = 0.0,
    step: Annotated[float | None, typer.Option(help="Uniform time step, s; default: from the fastest motion.")] = None,
    timeout: TimeoutOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Run a motor from rest under preload. Writes .csv or .nc (waveforms), .json (summary) or .cir (the deck).

    Example: piezomotor simulate andersen2002 --voltage 100 --duration 20e-3 --output run.csv --plot run.png
    """
    _check_targets(output, (".csv", ".nc", ".json", ".cir"), plot)
    loaded = _load(motor, changes)
    if drive is DriveKind.two_phase:
        last = loaded.modes[-1].frequency_hz
        excitation: pr.TwoPhaseDrive | pr.TwoToneDrive = pr.TwoPhaseDrive(
            voltage=voltage,
            frequency=last if frequency is None else frequency,
            phase_deg=90.0 if phase is None else phase,
            soft_start=soft_start,
        )
    else:
        if frequency_1 is None or frequency_2 is None:
            raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
        excitation = pr.TwoToneDrive(
            voltage_1=voltage_1,
            frequency_1=frequency_1,
            voltage_2=voltage_2,
            frequency_2=frequency_2,
            phase_deg=0.0 if phase is None else phase,
            soft_start=soft_start,
        )
    with _busy("ngspice runs the motor"):
        run = pr.simulate(
            loaded,
            excitation,
            duration=duration,
            contact=None if contact is ContactKind.none else "spring-slider",
            speed=speed,
            load_torque=load_torque,
            step=step,
            timeout=timeout,
        )
    if output is not None:
        run.save(output)
    if plot is not None:
        run.plot(plot)
    states = run.state_fractions
    table = Table("quantity", "value", title=f"{loaded.name}, {duration:g} s")
    table.add_row("mean rotor speed", f"{run.mean_rotor_speed_rad_s:.4g} rad/s")
    table.add_row("mean torque", f"{run.mean_torque_n_m:.4g} N·m")
    table.add_row("separated / stick / slip", " / ".join(f"{100 * share:.1f} %" for share in states.values()))
    table.add_row("energy residual", f"{run.energy_residual:.1e}")
    table.add_row("points", f"{run.points} in {run.solver_seconds:.2f} s, ngspice {run.ngspice_version}")
    _print(run.to_dict(), table, as_json)


@app.command()
def admittance(
    motor: MotorArgument,
    state: Annotated[StateKind, typer.Option(help="Free tip, or pressed on the rotor.")] = StateKind.free,
    start: Annotated[float, typer.Option(help="First frequency, Hz.")] = 5e3,
    stop: Annotated[float, typer.Option(help="Last frequency, Hz.")] = 100e3,
    points: Annotated[int, typer.Option(help="Number of frequencies.")] = 2000,
    timeout: TimeoutOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance andersen2002 --state preloaded --plot admittance.png
    """
    _check_targets(output, (".csv", ".nc", ".json"), plot)
    with _busy("ngspice sweeps the frequency"):
        result = pr.admittance(
            _load(motor, changes), start=start, stop=stop, points=points, state=state.value, timeout=timeout
        )
    if output is not None:
        result.save(output)
    if plot is not None:
        result.plot(plot)
    table = Table("driven", "mode", "fs", "fp", "k_eff", "Qm", "R", "L", "C", box=None, padding=(0, 1, 0, 0))
    table.title = f"{result.motor['name']}, {state.value}"
    for connection, resonances in result.resonances.items():
        for item in resonances:
            table.add_row(
                connection,
                item.mode,
                *(_engineering(value, "Hz") for value in (item.fs, item.fp)),
                f"{item.coupling_factor:.3f}",
                f"{item.quality_factor:.1f}",
                _engineering(item.resistance_ohm, "Ω"),
                _engineering(item.inductance_h, "H"),
                _engineering(item.capacitance_f, "F"),
            )
    _print(result.to_dict(), table, as_json)


@app.command()
def export(
    motor: MotorArgument,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Write a motor as one self-contained SPICE library, .subckt piezomotor a b com shaft. Writes .lib.

    Example: piezomotor export andersen2002 --output motor.lib
    """
    _check_targets(output, (".lib",), plot)
    loaded = _load(motor, changes)
    text = pr.motor_library(loaded)
    if output is not None:
        _guarded(output, lambda: output.write_text(text, encoding="utf-8"))
    if plot is not None:
        pr.plot_mode_shapes(loaded, plot)
    if as_json:
        sys.stdout.write(json.dumps({"motor": loaded.name, "library": text}) + "\n")
    elif output is None:
        sys.stdout.write(text)


def main() -> None:
    """Run the command line and leave with its exit status."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run the command line on the given words and return the exit status."""
    complain = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        status = app(arguments, prog_name="piezomotor", standalone_mode=False)
    except (pr.ParameterError, pr.SpectrumError) as error:
        complain.print(f"piezomotor: {error}", style="red", markup=False)
        return 2
    except pr.SimulationError as error:
        complain.print(f"piezomotor: {error}", style="red", markup=False)
        return 3
    except BrokenPipeError:  # the reader has gone, as with `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (KeyboardInterrupt, typer.Abort):
        complain.print("piezomotor: interrupted; nothing was written.", style="red")
        return 130
    except _usage_error() as error:
        error.show()
        return 2
    return status if isinstance(status, int) else 0


def _usage_error() -> type[Any]:
    """Return the class of typer's own complaints about the command line."""
    base: type[Any] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
    return base


def _load(motor: str, changes: list[str] | None) -> pr.Motor:
    loaded = pr.load_motor(motor)
    if not changes:
        return loaded
    values: dict[str, Any] = {}
    for change in changes:
        path, equals, text = change.partition("=")
        if not equals:
            raise pr.ParameterError(f"--set {change!r} is not PATH=VALUE; write it as contact.preload_n=8.")
        try:
            values[path.strip()] = float(text)
        except ValueError:
            raise pr.ParameterError(f"--set {path}: {text!r} is not a number. Give one, in SI units.") from None
    return loaded.updated(values)


def _check_targets(output: Path | None, endings: tuple[str, ...], plot: Path | None) -> None:
    """Refuse a place that cannot be written before any work is done."""
    for path, allowed in ((output, endings), (plot, (".png", ".svg", ".pdf"))):
        if path is None:
            continue
        if path.suffix not in allowed:
            raise pr.ParameterError(f"Cannot tell a format from {path.name!r}; let it end in {', '.join(allowed)}.")
        if path.is_dir() or not path.absolute().parent.is_dir():
            what = "is a folder" if path.is_dir() else "is in a folder that does not exist"
            raise pr.ParameterError(f"Cannot write {path}: it {what}. Choose another place.")
        if not os.access(path if path.exists() else path.absolute().parent, os.W_OK):
            raise pr.ParameterError(f"Cannot write {path}: permission denied. Choose another place.")


def _guarded(path: Path, write: Callable[[], object]) -> None:
    try:
        write()
    except OSError as error:
        raise pr.ParameterError(f"Cannot write {path}: {error.strerror or error}. Choose another place.") from error


def _write(path: Path, document: Mapping[str, Any], rows: list[list[str]]) -> None:
    text = (
        json.dumps(document, indent=2, allow_nan=False)
        if path.suffix == ".json"
        else "\n".join(",".join(row) for row in rows)
    )
    _guarded(path, lambda: path.write_text(text + "\n", encoding="utf-8"))


def _print(document: Mapping[str, Any], table: Table, as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(document, allow_nan=False) + "\n")
    else:
        Console().print(table)
    sys.stdout.flush()


def _flat(document: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted path and value of every leaf."""
    items = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in items:
        path = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, dict | list):
            yield from _flat(value, path)
        else:
            yield path, value


def _engineering(value: float, unit: str) -> str:
    """Write a value with four digits and the prefix of its unit."""
    exponent = 0 if value == 0.0 else min(max(floor(log10(abs(value)) / 3), -5), 3)
    return f"{value / 1000.0**exponent:.4g}\N{NO-BREAK SPACE}{'fpnµm kMG'[exponent + 5].strip()}{unit}"


@contextmanager
def _busy(what: str) -> Iterator[None]:
    """Show on a terminal that something runs."""
    console = Console(stderr=True)
    if console.is_terminal:
        with console.status(f"{what} …"):
            yield
    else:
        yield
