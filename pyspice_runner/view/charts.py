# SPDX-License-Identifier: GPL-3.0-or-later
"""The charts of the data sheet, as Plotly figures for a light and a dark page.

Those that do not move are the panels of the pictures, drawn by Matplotlib and handed over line by line.

An animated chart has frames in ``layout.meta["frames"]``, which the page plays with its own controls, and in
``layout.meta["order"]`` the sequence of the frames of one cycle. As frames of Plotly, a thousand lines would be
checked, which takes longer than the rest of the page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import pi
from typing import Any

import numpy as np
import plotly.graph_objects as go
import xarray
from matplotlib.colors import to_hex
from matplotlib.figure import Figure as Plain
from matplotlib.lines import Line2D
from plotly.subplots import make_subplots

from pyspice_runner.calibration.result import RecordedCurve, RecordedPoint
from pyspice_runner.datasets import Curves
from pyspice_runner.impedance.admittance import Admittance
from pyspice_runner.impedance.spectrum import COUPLING, Connection, Spectrum, State
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.trackers.loop import LoopDesign
from pyspice_runner.view import plot_calibration, plot_curves, plot_runs, plot_spectra
from pyspice_runner.view.draw import DASHES, Panel, last_periods
from pyspice_runner.view.outlines import axes_of, beam_outlines, outlines
from pyspice_runner.view.style import CYCLE, GREEN, GREY, LABELS, PURPLE, STATES, label_of, time_label

_DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}  # of Matplotlib → of Plotly
_SYMBOLS = {"s": "square", "D": "diamond", "^": "triangle-up", "v": "triangle-down", "x": "x"}

STATES_OF: dict[bool, dict[State, str]] = {  # of a motor, and of a transducer
    False: {"free": "tip free", "preloaded": "tip pressed on"},
    True: {"free": "without load", "preloaded": "under load"},
}

MODE_STEPS = 12  # frames from the middle to the largest deflection
TOOL_BAR = 32  # pixels below the chart, where datasheet.css and datasheet.js put the tool bar
PATH_FRAMES = 120  # of one drive period
_SWING = 0.07  # of the length of beam or solid: the largest deflection as it is drawn
_WEAK = 0.2  # of the best coupling; weaker resonances lie outside the range that a spectrum shows at first
_MOST_SHAPES = 6
_MOST_POINTS = 3000  # of a curve over time


def mode_shapes(motor: Motor) -> go.Figure | None:
    """Return the animated modes of a beam or a solid, with its electrodes; ``None`` for a motor with neither."""
    if motor.solid is not None:
        parts, along = outlines(motor.solid), "xyz"[axes_of(motor.solid)[0]]
    elif motor.structure is not None:
        parts, along = beam_outlines(motor.structure, len(motor.modes)), "position along the beam"
    else:
        return None
    whole = parts[0].line_m
    swing = _SWING * float((np.nanmax(whole, axis=1) - np.nanmin(whole, axis=1)).max())
    modes = motor.modes[:_MOST_SHAPES]

    def moved(share: float) -> list[Array]:
        """Return the places of the parts in mm in each mode, at a share of its largest deflection."""
        numbers = range(len(modes))
        return [1e3 * (part.line_m + share * swing * part.shapes[..., mode]) for mode in numbers for part in parts]

    titles = [f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz" for mode in modes]
    figure = make_subplots(rows=len(modes), cols=1, subplot_titles=titles, shared_xaxes=True, vertical_spacing=0.12)
    for number, (x, y) in enumerate(moved(0.0)):
        row, part = number // len(parts), parts[number % len(parts)]
        figure.add_scatter(
            x=_short(x), y=_short(y), name=part.name, legendgroup=part.name, showlegend=row == 0, mode="lines",
            line={"color": part.colour, "width": 3}, hoverinfo="skip", row=row + 1, col=1,
        )  # fmt: skip
    frames = []
    for step in range(-MODE_STEPS, MODE_STEPS + 1):
        data = [{"x": _short(x), "y": _short(y)} for x, y in moved(np.sin(0.5 * pi * step / MODE_STEPS))]
        frames.append({"name": str(step), "data": data, "traces": list(range(len(data)))})
    order = [*range(MODE_STEPS), *range(MODE_STEPS, -MODE_STEPS, -1), *range(-MODE_STEPS, 0)]
    furthest = np.concatenate(moved(-1.0) + moved(1.0), axis=1)
    for update, values in zip((figure.update_xaxes, figure.update_yaxes), furthest, strict=True):
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        room = 0.05 * (high - low)
        update(range=[low - room, high + room])
    figure.update_yaxes(title_text="mm")
    figure.update_xaxes(title_text=f"{along} in mm", row=len(modes), col=1)
    figure.update_layout(
        height=110 + TOOL_BAR + 160 * len(modes), meta={"frames": frames, "order": [str(step) for step in order]}
    )
    return figure


def tip_path(run: Waveforms) -> go.Figure:
    """Return the last drive period: the tip's path coloured by contact state, and the forces, with a moving marker."""
    inside, time = last_periods(run.time_s, run.drive_period_s, 1)
    x, y = 1e6 * run.tip_x_m[inside], 1e6 * run.tip_y_m[inside]
    normal, friction = run.normal_force_n[inside], run.friction_force_n[inside]
    panels = [partial(plot_runs.tip_path, run, 1), partial(plot_runs.forces, run, 1)]
    figure = _stacked(panels, 640, 0.14, heights=[0.58, 0.42])
    for name, _, dash in STATES:
        figure.update_traces(line={"dash": dash, "width": 3}, selector={"name": name})
    still = len(figure.data)
    places = np.linspace(0, len(time) - 1, PATH_FRAMES + 1).astype(int)[:-1]
    scale = 0.3 / max(float(np.abs([normal, friction]).max()), 1e-12)
    wide, high = float(np.ptp(x)), float(np.ptp(y))

    def moving(place: int) -> list[dict[str, Any]]:
        force_x = [x[place], x[place] + scale * wide * friction[place]]
        force_y = [y[place], y[place] + scale * high * normal[place]]
        moment = [1e6 * time[place]] * 2
        return [
            {"x": _short(force_x), "y": _short(force_y)},
            {"x": _short(moment), "y": _short([normal[place], friction[place]])},
        ]

    force, now = moving(0)
    figure.add_scatter(
        **force, name="tip, and the force it exerts", mode="lines+markers", row=1, col=1, hoverinfo="skip",
        line={"color": PURPLE, "width": 2}, marker={"color": PURPLE, "size": [13, 6], "symbol": ["circle", "diamond"]},
    )  # fmt: skip
    figure.add_scatter(
        **now, name="now", showlegend=False, mode="markers", marker={"color": PURPLE, "size": 10}, row=2, col=1,
        hoverinfo="skip",
    )  # fmt: skip
    frames = [
        {"name": str(number), "data": moving(int(place)), "traces": [still, still + 1]}
        for number, place in enumerate(places)
    ]
    for axis, values in (("xaxis", x), ("yaxis", y)):
        low, span = float(values.min()), float(np.ptp(values))
        room = 0.08 * max(span, 1e-9)
        below = 0.3 * span if axis == "xaxis" else 0.0
        figure.update_layout({axis: {"range": [low - room - below, low + 1.3 * span + room]}})
    figure.update_layout(meta={"frames": frames, "order": [one["name"] for one in frames]})
    return figure


def admittance(
    motor: Motor, spectra: Mapping[State, Admittance], measured: Spectrum | None, measured_on: Connection
) -> tuple[go.Figure, go.Figure]:
    """Return |Y| and phase over frequency, and the G–B circle; ``meta.groups`` is the connection of every trace."""
    traces, connections = list[plot_spectra.Trace](), list[Connection]()
    for connection in (name for name in COUPLING if name in spectra["free"].resonances):
        for (state, result), colour, dash in zip(spectra.items(), CYCLE, DASHES, strict=False):
            look: dict[str, Any] = {"color": colour, "linestyle": dash, "label": STATES_OF[motor.is_transducer][state]}
            traces.append(plot_spectra.Trace(result.frequency_hz, result.driven(connection), look))
        if measured is not None and (measured.ports == 2 or connection == measured_on):
            own = measured.driven(connection) if measured.ports == 2 else measured
            look = {"color": GREEN, "linestyle": "", "marker": "o", "mfc": "none", "ms": 4, "label": "measured"}
            traces.append(plot_spectra.Trace(own.frequency_hz, own.admittance_s, look))
        connections += [connection] * (len(traces) - len(connections))
    panels = plot_spectra.spectrum_panels(traces)
    bode = _stacked([panels["magnitude"], panels["phase"]], 560, meta={"groups": connections * 2})
    bode.update_yaxes(dtick=1, minor={"dtick": "D1", "showgrid": True}, row=1, col=1)
    bode.update_xaxes(range=_resonances_khz(spectra))
    circle = _stacked([panels["circle"]], 460, meta={"groups": connections})
    circle.update_yaxes(scaleanchor="x")
    for figure in (bode, circle):
        for trace, connection, over in zip(figure.data, connections * 2, bode.data, strict=False):
            trace.update(visible=connection == "A", customdata=over.x)
    circle.update_traces(hovertemplate=f"%{{customdata:.5g}} kHz<br>{circle.data[0].hovertemplate}")
    return bode, circle


def _resonances_khz(spectra: Mapping[State, Admittance]) -> list[float]:
    """Return the range in kHz about the resonances and antiresonances that couple well."""
    items = [item for spectrum in spectra.values() for several in spectrum.resonances.values() for item in several]
    best = max(item.coupling_factor for item in items)
    coupled = [item for item in items if item.coupling_factor >= _WEAK * best]
    return [0.93e-3 * min(item.fs for item in coupled), 1.07e-3 * max(item.fp for item in coupled)]


def speed_torque(curves: Mapping[float, xarray.Dataset]) -> go.Figure:
    """Return torque, shaft power and efficiency over speed, a curve for each level of the drive."""
    linear = any(Curves(curve).linear for curve in curves.values())
    named, panels = [(f"{100.0 * level:.3g} % of the voltage", curve) for level, curve in curves.items()], []
    for quantity in ("torque_n_m", "shaft_power_w", "efficiency"):
        label = label_of(quantity, linear)
        label = label._replace(name=label.name.partition(" on the ")[0])
        panels.append(partial(plot_curves.over_speed, named, [quantity], label, "", linear))
    figure = _stacked(panels, 640, spacing=0.06)
    best = 100.0 * max(float(np.nanmax([0.0, *curve["efficiency"].values.ravel()])) for curve in curves.values())
    # in %: from a tenth of the best below zero, or to -100 if the shaft is driven
    figure.update_yaxes(range=[-0.1 * best, min(1.05 * best, 100.0)] if best else [-100.0, 0.0], row=3, col=1)
    return figure


def calibration(points: Sequence[RecordedPoint]) -> go.Figure | None:
    """Return the residuals of the measured points of a calibration; ``None`` without points."""
    parts: dict[str, Any] = {
        quantity: np.array([(one.point, one.residual) for one in points if one.quantity == quantity], dtype=float).T
        for quantity in dict.fromkeys(one.quantity for one in points)
    }
    return _stacked([partial(plot_calibration.residuals_over, "point", parts, "")], 380) if points else None


def calibration_curve(curve: RecordedCurve) -> go.Figure:
    """Return the residuals of a spectrum or a run-up of a calibration: noise, unless the model is wrong."""
    label = time_label(max(curve.at)) if curve.along == "time_s" else LABELS[curve.along]
    at = label.scale * np.array(curve.at)
    parts = {name: (at, np.array(values.residuals, dtype=float)) for name, values in curve.quantities.items()}
    return _stacked([partial(plot_calibration.residuals_over, label, parts, "")], 320)


def spin_up(run: Waveforms) -> go.Figure:
    """Return the rotor's speed from rest."""
    figure = _stacked([plot_runs.waveforms(run).panels["speed"]], 380)
    points = len(run.time_s)
    kept = np.unique(np.linspace(0, points - 1, min(points, _MOST_POINTS)).astype(int))
    figure.update_traces(x=figure.data[0].x[kept], y=figure.data[0].y[kept])
    return figure


def electrical(run: Waveforms) -> go.Figure:
    """Return voltages and currents over the last three drive periods."""
    return _stacked([partial(plot_runs.of_groups, run, quantity, "") for quantity in ("voltage_v", "current_a")], 460)


def loop_gain(loop: LoopDesign) -> go.Figure:
    """Return magnitude and phase of the loop gain of a tracker over frequency, with its crossover and phase margin."""
    return _stacked([*plot_runs.loop_design(loop).panels.values()], 460)


def _stacked(
    panels: Sequence[Panel], height: int, spacing: float = 0.08, heights: Sequence[float] | None = None, **layout: Any
) -> go.Figure:
    """Return panels of Matplotlib one below the other, over the axis of the last; the legend is that of the first.

    Of a panel it takes lines, markers and bands over the whole width, not the title. Panels with relative ``heights``
    have axes and legends of their own.
    """
    shared = heights is None
    figure = make_subplots(rows=len(panels), cols=1, shared_xaxes=shared, vertical_spacing=spacing, row_heights=heights)
    for row, panel in enumerate(panels, start=1):
        ax = Plain().add_subplot()
        panel(ax)
        place: Any = {"row": row, "col": 1}
        hover = f"{ax.get_xlabel()}: %{{x:.5g}}<br>{ax.get_ylabel()}: %{{y:.4g}}"
        for line in ax.lines:
            if line.get_transform() is ax.transData:  # not a line along an axis, which Plotly has at zero
                figure.add_scatter(**_trace(line, row == 1 or not shared), hovertemplate=hover, **place)
        for band in ax.patches:
            low, high = band.get_extents().transformed(ax.transData.inverted()).intervaly
            figure.add_hrect(low, high, fillcolor=GREY, opacity=0.15, line_width=0, layer="below", **place)
        title = ax.get_xlabel() if row == len(panels) or not shared else None
        figure.update_xaxes(type=ax.get_xscale(), title_text=title, exponentformat="power", **place)
        figure.update_yaxes(type=ax.get_yscale(), title_text=ax.get_ylabel(), exponentformat="power", **place)
    figure.update_layout(height=height + TOOL_BAR, **layout)
    return figure


def _trace(line: Line2D, legend: bool) -> dict[str, Any]:
    """Return a line of Matplotlib as a scatter of Plotly; a value that is not a number leaves a gap."""
    name = str(line.get_label())
    named, drawn, marked = not name.startswith("_"), line.get_linestyle() != "None", line.get_marker() != "None"
    symbol = _SYMBOLS.get(str(line.get_marker()), "circle") + ("-open" if line.get_markerfacecolor() == "none" else "")
    edge = to_hex(line.get_markeredgecolor())
    return {
        "name": name if named else "", "legendgroup": name, "showlegend": legend and named,
        "x": _short(line.get_xdata(), precise=True), "y": _short(line.get_ydata()),
        "mode": "+".join(["lines"] * drawn + ["markers"] * marked),
        "line": {"color": to_hex(line.get_color()), "dash": _DASHES.get(str(line.get_linestyle()), "solid")},
        "marker": {"color": edge, "symbol": symbol, "size": 2.0 * line.get_markersize()},
    }  # fmt: skip


def _short(values: Any, precise: bool = False) -> Any:
    """Return values as the page stores them: 4 bytes each, or 8 where 7 digits are too few."""
    return np.asarray(values, dtype=np.float64 if precise else np.float32)
