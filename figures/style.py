# SPDX-License-Identifier: GPL-3.0-or-later
"""Common parts of all figures: colours, sizes, the caption with the parameters, and the command line."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from runpy import run_path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun
from pyspice_runner.motor.drive import Drive
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.view.plot_runs import state_path as coloured_path
from pyspice_runner.view.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, STATES, VERMILION

# the colours are the package's; the scripts take them from here
__all__ = ["BLACK", "BLUE", "GREEN", "GREY", "ORANGE", "PURPLE", "STATES", "VERMILION"]

HERE = Path(__file__).resolve().parent
WIDTH = 7.5  # inches: text width of a page
CAPTION_COLUMNS = 128

TOUCH_DOWN = {"marker": "o", "ls": "", "ms": 4.5, "mfc": "white", "mec": BLACK, "mew": 0.9}

mpl.use("Agg")
mpl.rcParams.update(
    {
        "font.size": 8.5,
        "axes.titlesize": 9,
        "axes.titlelocation": "left",
        "axes.labelsize": 8.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#E4E4E4",
        "grid.linewidth": 0.6,
        "axes.axisbelow": True,
        "legend.fontsize": 8,
        "legend.frameon": False,
        "lines.linewidth": 1.4,
        "figure.constrained_layout.h_pad": 0.06,
        "figure.constrained_layout.w_pad": 0.06,
        "savefig.dpi": 150,
    }
)


def canvas(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    """Return a figure of page width, ``height`` in inches, and its axes."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def state_path(axes: Axes, x: np.ndarray, y: np.ndarray, state: np.ndarray, width: float = 1.8) -> None:
    """Draw a path in the colours of the contact's state, with a ring where contact begins."""
    coloured_path(axes, x, y, state, linewidth=width, zorder=3, label="_path")
    number = np.rint(state).astype(int)
    landed = np.flatnonzero((number[:-1] == 0) & (number[1:] > 0)) + 1
    axes.plot(x[landed], y[landed], **TOUCH_DOWN, zorder=4)


def state_handles() -> list[Line2D]:
    """Return the entries of the legend for :func:`state_path`."""
    lines = [Line2D([], [], color=state.colour, lw=2.2, label=state.name) for state in STATES]
    return [*lines, Line2D([], [], **TOUCH_DOWN, label="touch-down (impact)")]


def recent(run: Waveforms, periods: float) -> slice:
    """Return the points of the last periods of the drive."""
    start = run.time_s[-1] - periods * run.drive_period_s
    return slice(int(np.searchsorted(run.time_s, start)), None)


def motor_words(motor: pr.Motor) -> str:
    """Return a caption's first sentence: the motor and its contact."""
    contact = motor.contact
    return f"Motor {motor.name}, preload {contact.preload_n:g} N, friction {contact.friction:g}."


def drive_words(drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> str:
    """Return the text of a drive in a caption."""
    phase = f"φ = {drive.phase_deg:g}°".replace("-", "−").replace(" ", "\N{NO-BREAK SPACE}")
    if isinstance(drive, pr.TwoPhaseDrive):
        return f"eq.\N{NO-BREAK SPACE}(1), {drive.voltage:g} V, {drive.frequency / 1e3:.4g} kHz, {phase}"
    return (
        f"eq.\N{NO-BREAK SPACE}(2), {drive.voltage_1:g} V at {drive.frequency_1 / 1e3:.4g} kHz and "
        f"{drive.voltage_2:g} V at {drive.frequency_2 / 1e3:.4g} kHz, {phase}"
    )


def write(figure: Figure, path: Path, title: str, caption: str, legend: Sequence[Line2D] = ()) -> None:
    """Put title, legend and caption around a figure's axes and write it.

    Raises:
        pyspice_runner.ParameterError: if the file cannot be written.
    """
    height = figure.get_figheight()
    lines = textwrap.wrap(caption, CAPTION_COLUMNS)
    top = 1.0 - (0.62 if legend else 0.36) / height
    bottom = (0.14 + 0.135 * len(lines)) / height
    layout = figure.get_layout_engine()
    assert isinstance(layout, ConstrainedLayoutEngine)
    layout.set(rect=(0.0, bottom, 1.0, top - bottom))
    left = 0.1 / WIDTH
    figure.text(left, 1.0 - 0.1 / height, title, va="top", fontsize=11, fontweight="bold")
    figure.text(left, 0.08 / height, "\n".join(lines), va="bottom", fontsize=7, color="#444444", linespacing=1.35)
    if legend:
        place = {"loc": "upper left", "bbox_to_anchor": (0.0, 1.0 - 0.33 / height)}
        figure.legend(handles=legend, ncols=len(legend), columnspacing=1.4, **place).set_in_layout(False)
    with _writing(path):
        figure.savefig(path, metadata={"Software": None})


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn a failure to write a path into a message."""
    try:
        yield
    except OSError as error:
        raise pr.ParameterError(f"Cannot write {path}: {error.strerror or error}. Choose another place.") from error


def controller(name: str) -> tuple[dict[str, Any], ControlledRun, ControlledRun]:
    """Return what a controller of ``examples/`` defines, and 50 ms of it with the averaged and with the full motor."""
    defined = run_path(str(HERE.parent / "examples" / "controllers" / f"{name}.py"))
    averaged, full = (defined["run"](3e-3 if draft() else 50e-3, averaged=averaged) for averaged in (True, False))
    return defined, averaged, full


def samples(axes: Axes, averaged: ControlledRun, full: ControlledRun, name: str, scale: float, what: str) -> None:
    """Draw a quantity of both motors over the time: the full motor as dots on the line of the averaged one."""
    axes.plot(1e3 * averaged.time_s, scale * averaged.samples[name], color=BLUE, label="averaged motor")
    axes.plot(1e3 * full.time_s, scale * full.samples[name], ".", ms=3.5, color=VERMILION, label="full motor")
    axes.set(ylabel=what, xlim=(0.0, 1e3 * averaged.time_s[-1]))


def farthest(averaged: ControlledRun, full: ControlledRun, name: str) -> float:
    """Return by how much the samples differ at most, in per cent of the greatest."""
    ours, theirs = averaged.samples[name], full.samples[name]
    return float(100.0 * np.abs(ours - theirs).max() / np.abs(theirs).max())


def draft() -> bool:
    """Whether the picture is a draft (``--draft``) with few points, as in the tests."""
    return "--draft" in sys.argv


def simulated(motor: pr.Motor, drive: Drive, **settings: Any) -> Waveforms:
    """Simulate with the default step, which is stated, so that no two more runs estimate the error."""
    step = Point.of(motor, drive, contact=settings.get("contact", "spring-slider")).step
    return pr.simulate(motor, drive, step=step, **settings)


def main(work: Callable[[Path], list[str]], what: str | None) -> None:
    """Run a script: ``--output DIR`` is the folder of the pictures; results are printed."""
    parser = argparse.ArgumentParser(description=(what or "").partition("\n")[0])
    parser.add_argument("--output", type=Path, default=HERE, metavar="DIR", help="where pictures go (%(default)s)")
    parser.add_argument("--draft", action="store_true", help="only a draft, with fewer points where they cost time")
    folder = parser.parse_args().output
    try:
        with _writing(folder):  # before the work, which may take minutes
            folder.mkdir(parents=True, exist_ok=True)
        print("\n".join(work(folder)))
    except (pr.ParameterError, pr.SimulationError) as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, pr.ParameterError) else 3)
    except KeyboardInterrupt:
        sys.exit(130)
