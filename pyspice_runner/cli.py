# SPDX-License-Identifier: GPL-3.0-or-later
"""The command ``piezomotor``.

Standard output carries the result, with ``--json`` one JSON object and nothing else. Progress and messages go to
standard error. Exit status: 0 success, 1 outside of a tolerance that was given, 2 invalid input, 3 the simulator
failed, 128 plus the signal number after a signal: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
"""

from __future__ import annotations

import errno
import os
import sys
import warnings
from copy import copy
from functools import cache
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

import pyspice_runner as pr
from pyspice_runner.commands.admittance import admittance
from pyspice_runner.commands.burst import burst
from pyspice_runner.commands.calibrate import calibrate
from pyspice_runner.commands.common import INTERRUPTED, OnceCommand, complain, say, say_versions, silence, written
from pyspice_runner.commands.compare import compare
from pyspice_runner.commands.drive import drive
from pyspice_runner.commands.fit import fit
from pyspice_runner.commands.impact import impact
from pyspice_runner.commands.loop import loop
from pyspice_runner.commands.motor_from import motor_from
from pyspice_runner.commands.motors import export, motors, show
from pyspice_runner.commands.pages import live, report
from pyspice_runner.commands.simulate import simulate
from pyspice_runner.commands.state_space import state_space
from pyspice_runner.commands.steady_states import map_points, small_signals, speed_torque, steady
from pyspice_runner.commands.sweep import sweep
from pyspice_runner.commands.track import track
from pyspice_runner.interrupts import raised

app = typer.Typer(
    name="piezomotor",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

COMMANDS = (
    motors, show, simulate, admittance, speed_torque, steady, small_signals, loop, state_space, sweep, drive, burst, track,
    impact, fit, compare, motor_from, calibrate, export, report, live,
)  # fmt: skip
NAMES = {command.__name__.replace("_", "-"): command for command in COMMANDS} | {"map": map_points}
for name, command in NAMES.items():
    app.command(name=name, cls=OnceCommand)(command)

FIRST_STEPS = {
    "Try first": {"report bimodal40": "a motor on one page"},
    "Then": {
        "simulate bimodal40 --plot run.png": "one run, plotted",
        "export bimodal40 --output motor.lib": "a .subckt for SPICE",
        "drive bimodal40 --driver half-bridge": "its driver's losses",
        "admittance bimodal40 --state preloaded": "its impedance",
    },
    "Help": {
        "COMMAND --help": "one command with an example",
        "--help": "all commands",
        "--install-completion": "completion by Tab",
    },
}


@app.callback()
def first_steps(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001
        bool,
        typer.Option("--version", callback=say_versions, is_eager=True, help="Show the versions and exit."),
    ] = False,
) -> None:
    """A SPICE model of a standing-wave piezomotor, run on ngspice."""
    if context.invoked_subcommand is not None:
        return
    table = Table.grid(padding=(0, 3, 0, 0))
    for heading, lines in FIRST_STEPS.items():
        table.add_row(Text(heading, style="bold"))
        for words, meaning in lines.items():
            table.add_row(f"  piezomotor {words}", meaning)
    say(f"{first_steps.__doc__}\n\n")
    say(table)


def run(arguments: list[str]) -> int:
    """Run the command line with these arguments and return the exit status."""
    written.clear()
    came: list[int] = []  # the signals, until the end of the command
    try:
        with raised() as came:
            status = _invoked(arguments)
            sys.stdout.flush()
    except (pr.ParameterError, pr.SpectrumError, pr.SimulationError) as error:
        complain(f"piezomotor: {error}")
        return 3 if isinstance(error, pr.SimulationError) else 2
    except MemoryError:
        complain(f"piezomotor: {OUT_OF_MEMORY}")
        return 3
    except (BrokenPipeError, SystemExit):  # the reader of the pipe has ended; for --help rich raises SystemExit then
        silence(sys.stdout)
        return 0
    except (KeyboardInterrupt, typer.Abort):
        done = f"{' and '.join(written)} {'are' if len(written) > 1 else 'is'} complete" if written else ""
        complain(f"piezomotor: interrupted; {done or 'nothing was written'}.")
        return _status_of(came)
    except OSError as error:
        complain(f"piezomotor: {_told(error)}")
        silence(sys.stdout)
        return 2
    except _usage_error() as error:
        message = error.message.replace("Value error, ", "")
        error.message = str(pr.ParameterError(message))  # shortened and printable like our own
        error.show()
        return 2
    return _status_of(came) if status == INTERRUPTED else status if isinstance(status, int) else 0


def _status_of(signals: list[int]) -> int:
    """Return the exit status after signals, by the first of them, as a shell does: 143 for SIGTERM, 129 for SIGHUP."""
    return 128 + signals[0] if signals else INTERRUPTED


def _invoked(arguments: list[str]) -> Any:
    """Run the command and return its value; typer alone would hide an interrupt."""
    if "_PIEZOMOTOR_COMPLETE" in os.environ:  # the shell asks for completions
        return app(arguments, prog_name="piezomotor", standalone_mode=False)
    group = _group(arguments[0] if arguments and arguments[0] in NAMES else None)
    try:
        with warnings.catch_warnings(), group.make_context("piezomotor", list(arguments)) as context:
            warnings.showwarning = lambda message, *_: complain(f"piezomotor: {message}", style="yellow")
            return group.invoke(context)
    except typer.Exit as end:
        return end.exit_code


@cache
def _group(name: str | None) -> Any:
    """Return the command line with one command, or with all: typer takes 3 ms for each."""
    line = copy(app)
    if name is not None:
        line.registered_commands = [one for one in app.registered_commands if one.name == name]
    return typer.main.get_command(line)


OUT_OF_MEMORY = (
    "Out of memory. Free some memory, shorten the run, or record less by --record-from, --record-every, --signals."
)


def _told(error: OSError) -> str:
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return "Too many files are open. Raise the limit, as by `ulimit -n 1024`."
    place = error.filename or "standard output"
    return f"Cannot read or write {place}: {error.strerror or error}. Check the place, or choose another one."


def _usage_error() -> type[Any]:
    """Return the class of typer's errors about the command line."""
    base: type[Any] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
    return base
