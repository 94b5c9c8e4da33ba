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
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import typer

import pyspice_runner as pr
from pyspice_runner.commands.common import INTERRUPTED, OnceCommand, complain, say, say_versions, silence, written
from pyspice_runner.interrupts import raised

# groups of the help → their commands → the module in :mod:`.commands`; a command loads no other one's
GROUPS = {
    "Run a motor": {
        "motors": "motors", "show": "motors", "simulate": "simulate", "steady": "steady_states",
        "speed-torque": "steady_states", "map": "steady_states", "sweep": "sweep", "report": "pages", "live": "pages",
    },
    "Electronics and control": {
        "drive": "drive", "track": "track", "loop": "loop", "small-signals": "steady_states", "state-space": "loop",
    },
    "Measurements": {
        "admittance": "compare", "fit": "fit", "compare": "compare", "constants": "fit", "motor-from": "calibrate",
        "calibrate": "calibrate",
    },
    "Files": {"export": "motors", "new": "motors"},
    "First steps": {"demo": "pages", "engine": "pages"},
}  # fmt: skip
MODULES = {name: module for commands in GROUPS.values() for name, module in commands.items()}
FUNCTIONS = {"map": "map_points"}  # of commands whose function has another name
SYNONYMS = {  # what other programs call a command → the arguments it stands for
    "run": ["simulate"], "list": ["motors"], "impedance": ["admittance"], "torque-speed": ["speed-torque"],
    "bode": ["small-signals"], "pll": ["track"], "montecarlo": ["sweep"], "version": ["--version"],
}  # fmt: skip
MEANT = {  # options that other programs have → what stands for them here
    "--time": "--duration TIME", "--stall": "--speed 0", "--supply": "--rail VOLTAGE", "--torque": "--load TORQUE",
}  # fmt: skip

FIRST_STEPS = """A SPICE model of a standing-wave piezomotor, run on ngspice.

Try first
  piezomotor report bimodal40                        a motor on one page
Then
  piezomotor simulate bimodal40 --plot run.png       one run, plotted
  piezomotor export bimodal40 --output motor.lib     a .subckt for SPICE
  piezomotor drive bimodal40 --driver half-bridge    its driver's losses
  piezomotor admittance bimodal40 --state preloaded  its impedance
Help
  piezomotor COMMAND --help                          one command with an example
  piezomotor --help                                  all commands
  piezomotor --install-completion                    completion by Tab
"""


def first_steps(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001
        bool,
        typer.Option("--version", callback=say_versions, is_eager=True, help="Show the versions and exit."),
    ] = False,
) -> None:
    """A SPICE model of a standing-wave piezomotor, run on ngspice."""
    if context.invoked_subcommand is None:
        say(FIRST_STEPS)


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
        advice = "Free some memory, shorten the run, or record less by --record-from, --record-every, --signals."
        complain(f"piezomotor: Out of memory. {advice}")
        return 3
    except (BrokenPipeError, SystemExit):  # the reader of the pipe has ended; for --help rich raises SystemExit then
        silence()
        return 0
    except (KeyboardInterrupt, typer.Abort):
        done = f"{' and '.join(written)} {'are' if len(written) > 1 else 'is'} complete" if written else ""
        complain(f"piezomotor: interrupted; {done or 'nothing was written'}.")
        return _status_of(came)
    except OSError as error:
        complain(f"piezomotor: {_told(error)}")
        silence()
        return 2
    except _usage_error() as error:
        message = error.message.replace("Value error, ", "")
        if (meant := MEANT.get(getattr(error, "option_name", ""))) is not None:
            error.possibilities = []
            message = f"{message} Write {meant}."
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
        return app()(arguments, prog_name="piezomotor", standalone_mode=False)
    arguments = _translated(arguments)
    group = typer.main.get_command(app(arguments[0]) if arguments and arguments[0] in MODULES else app())
    try:
        with warnings.catch_warnings(), group.make_context("piezomotor", list(arguments)) as context:
            warnings.showwarning = lambda message, *_: complain(f"piezomotor: {message}", style="yellow")
            return group.invoke(context)
    except typer.Exit as end:
        return end.exit_code


def _translated(arguments: list[str]) -> list[str]:
    """Return the arguments with a synonym replaced, and ``help COMMAND`` as ``COMMAND --help``."""
    first, rest = arguments[:1], arguments[1:]
    if first == ["help"]:
        return [*_translated(rest), "--help"]
    return [*SYNONYMS.get(first[0], first), *rest] if first else arguments


@cache
def app(*names: str) -> typer.Typer:
    """Return the command line with some commands, or with all: each takes time to load."""
    line = typer.Typer(
        name="piezomotor",
        invoke_without_command=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
    )
    line.callback()(first_steps)
    for name in names or MODULES:
        module = import_module(f"pyspice_runner.commands.{MODULES[name]}")
        command = getattr(module, FUNCTIONS.get(name, name.replace("-", "_")))
        group = next(group for group, commands in GROUPS.items() if name in commands)
        line.command(name=name, cls=OnceCommand, rich_help_panel=group)(command)
    return line


def _told(error: OSError) -> str:
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return "Too many files are open. Raise the limit, as by `ulimit -n 1024`."
    place = error.filename or "standard output"
    return f"Cannot read or write {place}: {error.strerror or error}. Check the place, or choose another one."


def _usage_error() -> type[Any]:
    """Return the class of typer's errors about the command line."""
    base: type[Any] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
    return base
