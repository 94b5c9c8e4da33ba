# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of results, drawn by Matplotlib.

:data:`SHEETS` maps each kind of result to the function that returns its panels; ``result.plot(ax=…, panel=NAME)``
draws one panel into any Axes. The first plot loads this module.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from pyspice_runner.averaged.run import AveragedRun
from pyspice_runner.calibration.result import Calibration
from pyspice_runner.control.loop import ControlLoop
from pyspice_runner.control.run import ControlledRun
from pyspice_runner.datasets import Branch, Curves, Sweep, WorkingPoints
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.errors import ParameterError
from pyspice_runner.impedance.admittance import Admittance
from pyspice_runner.impedance.compare import Comparison, Trend
from pyspice_runner.impedance.one_port_fit import SpectrumFit
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.impedance.two_port_fit import TwoPortFit
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.steady.small_signals import SmallSignals
from pyspice_runner.steady.steady import SteadyState
from pyspice_runner.trackers.track import Tracking
from pyspice_runner.view import plot_calibration, plot_curves, plot_motors, plot_runs, plot_spectra
from pyspice_runner.view.datasheet import Report
from pyspice_runner.view.draw import Sheet, filled, save, write

_SCREEN_DPI = 80  # of the picture in a notebook


def _report(report: Report) -> Sheet:
    """Return torque and efficiency at full voltage, the admittance of the free tip, and the speed of the run."""
    curve = plot_curves.speed_torque(Curves(report.curves[max(report.curves)])).panels
    panels = {
        "torque": curve["torque"],
        "efficiency": curve["efficiency"],
        "magnitude": plot_spectra.admittance(report.spectra["free"]).panels["magnitude"],
        "speed": plot_runs.waveforms(report.run).panels["speed"],
    }
    return Sheet(panels, 2, (5.0, 3.5), f"{report.motor.name}: {report.drive.label}")


SHEETS: dict[type, Callable[[Any], Sheet]] = {
    Waveforms: plot_runs.waveforms,
    SteadyState: plot_runs.steady_state,
    AveragedRun: plot_runs.averaged_run,
    ControlledRun: plot_runs.controlled_run,
    ControlLoop: plot_runs.control_loop,
    Tracking: plot_runs.tracking,
    DriveReport: plot_runs.drive_report,
    Admittance: plot_spectra.admittance,
    Spectrum: plot_spectra.spectrum,
    SpectrumFit: plot_spectra.spectrum_fit,
    TwoPortFit: plot_spectra.two_port_fit,
    Comparison: plot_spectra.comparison,
    Trend: plot_spectra.trend,
    SmallSignals: plot_spectra.small_signals,
    Curves: plot_curves.speed_torque,
    Branch: plot_curves.branch,
    WorkingPoints: plot_curves.working_points,
    Sweep: plot_curves.sweep,
    Calibration: plot_calibration.calibration,
    Motor: plot_motors.motor,
    list: plot_motors.motors,
    Report: _report,
}


def sheet(result: Any) -> Sheet:
    """Return the panels of a result. Raise ParameterError for an object without a plot."""
    for kind in type(result).__mro__:
        if kind in SHEETS:
            return SHEETS[kind](result)
    raise ParameterError(f"There is no plot of an object of type {type(result).__name__}.")


def draw(result: Any, path: str | Path | None = None, ax: Axes | None = None, panel: str | None = None) -> Axes:
    """Draw a result; see :meth:`pyspice_runner.display.Shown.plot`."""
    page = sheet(result)
    if panel is not None and panel not in page.panels:
        raise ParameterError(f"There is no panel {panel!r}. The panels are {', '.join(page.panels)}.")
    if ax is not None:
        page.panels[panel or next(iter(page.panels))](ax)
        figure: Any = ax.figure
    else:
        if panel is not None:
            page = page._replace(panels={panel: page.panels[panel]}, columns=1)
        figure = filled([page], getattr(result, "cautions", ()), shown=path is None)
        ax = figure.axes[0]
    if path is not None:
        save(figure, path)
    return ax


def draw_beside(results: Sequence[Any], path: str | Path) -> Path:
    """Draw several results of one kind side by side, a column of panels for each."""
    cautions = tuple(dict.fromkeys(caution for result in results for caution in result.cautions))
    return save(filled([sheet(result)._replace(columns=1) for result in results], cautions), path)


def picture(result: Any) -> bytes:
    """Return a PNG of a result, sized for a notebook."""
    file = io.BytesIO()
    write(filled([sheet(result)]), file, _SCREEN_DPI, "png")
    return file.getvalue()
