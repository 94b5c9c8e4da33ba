# SPDX-License-Identifier: GPL-3.0-or-later
"""Common parts of all figures: colours, sizes, the caption with the parameters, and the command line."""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from runpy import run_path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

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
NUMBERS = 9  # of each line are recorded
LARGEST_SVG = 300_000  # bytes

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


def recorded(figure: Figure) -> dict[str, list[float]]:
    """Return the numbers that a figure draws, by axes and artist: nine points of each line, nine values of the rest.

    A curve with increasing abscissae is interpolated at nine of them, so that its number of points does not matter.
    """
    numbers: dict[str, Any] = {}
    for place, axes in enumerate(one for one in figure.axes if one.axison):  # a diagram draws no numbers
        for line in axes.lines:
            x, y = (np.asarray(values, dtype=float) for values in line.get_data(orig=False))
            if x.size > NUMBERS and (np.diff(x) > 0.0).all():
                at = np.linspace(x[0], x[-1], NUMBERS)
                x, y = at, np.interp(at, x, y)
            numbers[f"{place} {line.get_label()}"] = np.concatenate([_nine(x), _nine(y)])
        for artist in (*axes.collections, *axes.images):
            drawn = artist.get_array() if artist.get_array() is not None else artist.get_datalim(axes.transData)
            numbers[f"{place} {artist.get_label()}"] = _nine(np.ma.filled(np.ma.asarray(drawn, dtype=float), np.nan))
        for bar in axes.containers:
            sizes = np.array([[one.get_width(), one.get_height()] for one in bar if isinstance(one, Rectangle)])
            numbers[f"{place} {bar.get_label()}"] = _nine(sizes)
    return {name: [float(f"{value:.4g}") for value in values] for name, values in numbers.items() if values.size}


def _nine(values: np.ndarray) -> np.ndarray:
    """Return nine values, or all if they are fewer; those that are not numbers are left out."""
    flat = np.ravel(values)
    flat = flat[np.isfinite(flat)]
    return flat[np.unique(np.linspace(0, max(flat.size - 1, 0), NUMBERS).astype(int))] if flat.size else flat


def write(figure: Figure, path: Path, title: str, caption: str, legend: Sequence[Line2D] = ()) -> None:
    """Put title and legend around a figure's axes and write it; the caption goes into its metadata, and is printed.

    The metadata (text chunks of the PNG) are ``Title``, ``Description``, which is the caption, and ``Numbers``, see
    :func:`recorded`, as JSON. A vector graphic of at most 300 kB is written beside the PNG.

    Raises:
        pyspice_runner.ParameterError: if the file cannot be written.
    """
    height = figure.get_figheight()
    top = 1.0 - (0.62 if legend else 0.36) / height
    layout = figure.get_layout_engine()
    assert isinstance(layout, ConstrainedLayoutEngine)
    layout.set(rect=(0.0, 0.0, 1.0, top))
    figure.text(0.1 / WIDTH, 1.0 - 0.1 / height, title, va="top", fontsize=11, fontweight="bold")
    if legend:
        place = {"loc": "upper left", "bbox_to_anchor": (0.0, 1.0 - 0.33 / height)}
        figure.legend(handles=legend, ncols=len(legend), columnspacing=1.4, **place).set_in_layout(False)
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        axis.set_label_text(_quantity_and_unit(axis.get_label_text()))
    numbers = json.dumps(recorded(figure), ensure_ascii=False)
    metadata = {"Software": None, "Title": title, "Description": caption, "Numbers": numbers}
    vector = BytesIO()
    with mpl.rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(vector, format="svg", metadata={"Date": None, "Creator": None, "Title": title})
    with _writing(path):
        figure.savefig(path, metadata=metadata)
        path.with_suffix(".svg").unlink(missing_ok=True)
        if vector.tell() <= LARGEST_SVG:
            path.with_suffix(".svg").write_bytes(vector.getvalue())
    print(textwrap.fill(caption, 120))


def _quantity_and_unit(label: str) -> str:
    """Return the label of an axis as quantity / unit, also of the package's panels, which have quantity in unit."""
    quantity, found, unit = label.rpartition(" in ")
    unit = "°" if unit == "degrees" else f"({unit})" if any(sign in unit for sign in "/· ") else unit
    return f"{quantity} / {unit}" if found else label


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn a failure to write a path into a message."""
    try:
        yield
    except OSError as error:
        raise pr.ParameterError(f"Cannot write {path}: {error.strerror or error}. Choose another place.") from error


def controller(name: str, duration: float) -> tuple[dict[str, Any], ControlledRun, ControlledRun]:
    """Return what a controller of ``examples/`` defines, and its runs with the averaged and with the full motor."""
    defined = run_path(str(HERE.parent / "examples" / "controllers" / f"{name}.py"))
    averaged, full = (defined["run"](3e-3 if draft() else duration, averaged=averaged) for averaged in (True, False))
    return defined, averaged, full


def samples(axes: Axes, averaged: ControlledRun, full: ControlledRun, name: str, scale: float, what: str) -> None:
    """Draw a quantity of both motors over the time: the full motor as dots on the line of the averaged one."""
    axes.plot(1e3 * averaged.time_s, scale * averaged.samples[name], color=BLUE, label="averaged motor")
    axes.plot(1e3 * full.time_s, scale * full.samples[name], ".", ms=3.5, color=VERMILION, label="full motor")
    axes.set(ylabel=what, xlim=(0.0, 1e3 * averaged.time_s[-1]))


def farthest(averaged: ControlledRun, full: ControlledRun, name: str) -> float:
    """Return by how much the samples differ at most, in per cent of the maximum."""
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
