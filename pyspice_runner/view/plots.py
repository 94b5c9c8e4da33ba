# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of results, drawn by Matplotlib.

:func:`sheet` returns the panels of a result, by its type; ``result.plot(ax=…, panel=NAME)`` draws one panel into any
Axes. The first plot loads this module.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from pyspice_runner.datasets import Curves
from pyspice_runner.errors import ParameterError
from pyspice_runner.view import plot_calibration, plot_curves, plot_motors, plot_runs, plot_spectra
from pyspice_runner.view.datasheet import Report
from pyspice_runner.view.draw import Sheet, filled, save, write

_SCREEN_DPI = 80  # of the picture in a notebook


def _report(report: Report) -> Sheet:
    """Return torque and efficiency at full voltage, the free admittance, and the run; of a transducer the last two."""
    found = plot_spectra.admittance(report.spectra["free"]).panels | plot_runs.waveforms(report.run).panels
    kept = ["magnitude", "currents"]
    if report.curves:
        found = found | plot_curves.speed_torque(Curves(report.curves[max(report.curves)])).panels
        kept = ["torque", "efficiency", "magnitude", "speed"]
    return Sheet({name: found[name] for name in kept}, 2, (5.0, 3.5), f"{report.motor.name}: {report.drive.label}")


@singledispatch
def sheet(result: Any) -> Sheet:
    """Return the panels of a result. Raise ParameterError for an object without a plot."""
    raise ParameterError(f"There is no plot of an object of type {type(result).__name__}.")


for of_a_kind in (  # functions that return the panels of a result of the type of their argument
    plot_runs.waveforms,
    plot_runs.steady_state,
    plot_runs.averaged_run,
    plot_runs.controlled_run,
    plot_runs.control_loop,
    plot_runs.loop_design,
    plot_runs.tracking,
    plot_runs.drive_report,
    plot_spectra.admittance,
    plot_spectra.spectrum,
    plot_spectra.spectrum_fit,
    plot_spectra.two_port_fit,
    plot_spectra.comparison,
    plot_spectra.trend,
    plot_spectra.small_signals,
    plot_curves.speed_torque,
    plot_curves.branch,
    plot_curves.working_points,
    plot_curves.sweep,
    plot_calibration.calibration,
    plot_motors.motor,
    _report,
):
    sheet.register(of_a_kind)
sheet.register(list, plot_motors.motors)


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
