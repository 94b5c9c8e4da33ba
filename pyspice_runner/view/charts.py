# SPDX-License-Identifier: GPL-3.0-or-later
"""The charts of the data sheet, as Plotly figures for a light and a dark page.

An animated chart has frames in ``layout.meta["frames"]``, which the page plays with its own controls, and in
``layout.meta["order"]`` the sequence of the frames of one cycle. As frames of Plotly, a thousand lines would be
checked, which takes longer than the rest of the page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from pyspice_runner.calibration.record import RecordedCurve, RecordedPoint
from pyspice_runner.datasets import Curves
from pyspice_runner.impedance.admittance import Admittance
from pyspice_runner.impedance.spectrum import COUPLING, Connection, Spectrum, State
from pyspice_runner.motor.beam import solve_resonator
from pyspice_runner.motor.motor import Motor, Structure
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.trackers.loop import LoopDesign, phase_shown_deg
from pyspice_runner.view.draw import last_periods
from pyspice_runner.view.style import (
    BLUE,
    CYCLE,
    GREEN,
    GREY,
    LABELS,
    PURPLE,
    STATES,
    VERMILION,
    Label,
    label_of,
    time_label,
)

if TYPE_CHECKING:
    import xarray

DASHES = ("solid", "dash", "dot", "dashdot")
MARKS = ("circle", "diamond", "square", "cross")

MODE_STEPS = 12  # frames from the middle to the largest deflection
TOOL_BAR = 32  # pixels below the chart, where datasheet.css puts the tool bar
PATH_FRAMES = 120  # of one drive period
_SWING = 0.07  # of the beam's length: the largest deflection as it is drawn
_MOST_SHAPES = 6
_MOST_POINTS = 3000  # of a curve over time

Line = dict[str, Any]  # of Plotly's scatter, with a name


def theme(ink: str, grid: str) -> go.layout.Template:
    """Return the template of a light or a dark page."""
    title = {"font": {"size": 13}, "standoff": 6}  # close to the axis, so that it stays clear of the tool bar
    axis = {"gridcolor": grid, "zerolinecolor": grid, "linecolor": ink, "automargin": True, "title": title}
    return go.layout.Template(
        layout={
            "font": {"color": ink, "family": "system-ui, sans-serif", "size": 13},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "xaxis": axis,
            "yaxis": axis,
            "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.06, "x": 0.0},
            "margin": {"l": 60, "r": 12, "t": 48, "b": 48 + TOOL_BAR},
            "hovermode": "closest",
        }
    )


def mode_shapes(motor: Motor) -> go.Figure | None:
    """Return the animated modes of the beam, with patches and tip; ``None`` for a motor without a beam."""
    structure = motor.structure
    if structure is None:
        return None
    modes = motor.modes[:_MOST_SHAPES]
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip, count=len(motor.modes))
    titles = [f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz" for mode in modes]
    figure = make_subplots(rows=len(modes), cols=1, subplot_titles=titles, shared_xaxes=True, vertical_spacing=0.12)
    parts = _parts(structure)

    def lines(mode: int, deflection: float) -> list[tuple[Array, Array]]:
        """Return the parts moved by a deflection and, away from the neutral axis, by its slope."""
        swing = deflection * _SWING * structure.beam.length_m
        return [
            (x - z * swing * resonator.slope(x)[:, mode], z + swing * resonator.deflection(x)[:, mode])
            for x, z, *_ in parts
        ]

    for row in range(len(modes)):
        for (x, y), (*_, name, colour) in zip(lines(row, 0.0), parts, strict=True):
            figure.add_scatter(
                x=_short(1e3 * x), y=_short(1e3 * y), name=name, legendgroup=name, showlegend=row == 0, mode="lines",
                line={"color": colour, "width": 4}, hoverinfo="skip", row=row + 1, col=1,
            )  # fmt: skip
    frames = []
    for step in range(-MODE_STEPS, MODE_STEPS + 1):
        deflection = np.sin(0.5 * pi * step / MODE_STEPS)
        moved = [line for row in range(len(modes)) for line in lines(row, deflection)]
        data = [{"x": _short(1e3 * x), "y": _short(1e3 * y)} for x, y in moved]
        frames.append({"name": str(step), "data": data, "traces": list(range(len(data)))})
    order = [*range(MODE_STEPS), *range(MODE_STEPS, -MODE_STEPS, -1), *range(-MODE_STEPS, 0)]
    length = structure.beam.length_m
    low = 0.5 * structure.beam.thickness_m + max(patch.thickness_m for patch in structure.patches)
    reach = [-1.1e3 * (low + _SWING * length), 1.1e3 * (max(low, structure.tip.length_m) + _SWING * length)]
    figure.update_yaxes(range=reach, title_text="mm")
    figure.update_xaxes(range=[-60.0 * length, 1060.0 * length])
    figure.update_xaxes(title_text="position along the beam in mm", row=len(modes), col=1)
    figure.update_layout(
        height=110 + TOOL_BAR + 210 * len(modes), meta={"frames": frames, "order": [str(step) for step in order]}
    )
    return figure


def _parts(structure: Structure) -> list[tuple[Array, Array, str, str]]:
    """Return the parts to draw: positions along the beam, heights above its middle, name and colour."""
    beam, tip = structure.beam, structure.tip
    along = np.linspace(0.0, beam.length_m, 81)
    parts = [(along, np.zeros(81), "beam", GREY)]
    for group, colour in (("A", BLUE), ("B", VERMILION)):
        lines = []
        for patch in (patch for patch in structure.patches if patch.group == group):
            height = 0.5 * (beam.thickness_m + patch.thickness_m)
            for side in {"top": (1.0,), "bottom": (-1.0,)}.get(patch.faces, (1.0, -1.0)):
                line = np.linspace(patch.start_m, patch.end_m, 21)
                lines += [(line, np.full(21, side * height)), (np.full(1, np.nan), np.full(1, np.nan))]
        if lines:
            x, z = (np.concatenate(arrays) for arrays in zip(*lines, strict=True))
            parts.append((x, z, f"patches of group {group}", colour))
    return [*parts, (np.full(2, tip.position_m), np.array([0.0, tip.length_m]), "tip", GREEN)]


def tip_path(run: Waveforms) -> go.Figure:
    """Return the last drive period: the tip's path coloured by contact state, and the forces, with a moving marker."""
    inside, time = last_periods(run.time_s, run.drive_period_s, 1)
    x, y, state = 1e6 * run.tip_x_m[inside], 1e6 * run.tip_y_m[inside], np.rint(run.contact_state[inside])
    normal, friction = run.normal_force_n[inside], run.friction_force_n[inside]
    figure = make_subplots(rows=2, cols=1, row_heights=[0.58, 0.42], vertical_spacing=0.14)
    for code, (name, colour, dash) in enumerate(STATES):
        inside = state == code
        if inside.any():
            inside = inside | np.roll(inside, -1)  # a state is reached by the step that ends with it
            figure.add_scatter(
                x=_short(np.where(inside, x, np.nan)), y=_short(np.where(inside, y, np.nan)), name=name, mode="lines",
                line={"color": colour, "width": 3, "dash": dash}, row=1, col=1,
                hovertemplate="x %{x:.4g} µm<br>y %{y:.4g} µm",
            )  # fmt: skip
    for values, name, colour, dash in (
        (normal, "normal force", BLUE, "solid"),
        (friction, "friction", VERMILION, "dash"),
    ):
        figure.add_scatter(
            x=_short(1e6 * time), y=_short(values), name=name, mode="lines", line={"color": colour, "dash": dash},
            row=2, col=1, hovertemplate="%{x:.4g} µs: %{y:.4g} N",
        )  # fmt: skip
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
    figure.update_xaxes(title_text=str(label_of("tip_x_m", run.linear)), row=1, col=1)
    figure.update_yaxes(title_text=str(label_of("tip_y_m", run.linear)), row=1, col=1)
    figure.update_xaxes(title_text=str(LABELS["time_us"]), row=2, col=1)
    figure.update_yaxes(title_text=str(LABELS["force_n"]), row=2, col=1)
    figure.update_layout(height=640 + TOOL_BAR, meta={"frames": frames, "order": [one["name"] for one in frames]})
    return figure


def admittance(
    spectra: Mapping[State, Admittance], measured: Spectrum | None, measured_on: Connection
) -> tuple[go.Figure, go.Figure]:
    """Return |Y| and phase over frequency, and the G–B circle; ``meta.groups`` is the connection of every trace."""
    magnitude, phase, circle, groups = list[Line](), list[Line](), list[Line](), list[str]()
    for connection in COUPLING:
        for frequency, y, name, look in _spectra(spectra, measured, measured_on, connection):
            hertz, shown = _short(1e-3 * frequency, precise=True), {"visible": connection == "A", **look}
            magnitude.append(_line(name, hertz, 1e3 * np.abs(y), "%{x:.5g} kHz: %{y:.4g} mS", **shown))
            phase.append(_line(name, hertz, np.degrees(np.angle(y)), "%{x:.5g} kHz: %{y:.4g}°", **shown))
            hover = "%{customdata:.5g} kHz<br>G %{x:.4g} mS<br>B %{y:.4g} mS"
            circle.append(_line(name, _short(1e3 * y.real), 1e3 * y.imag, hover, customdata=hertz, **shown))
            groups.append(connection)
    rows = [(LABELS["magnitude_s"], magnitude), (LABELS["phase_deg"], phase)]
    bode = _stacked(LABELS["frequency_hz"], rows, 560, meta={"groups": groups * 2})
    bode.update_yaxes(type="log", dtick="D2", row=1, col=1)
    locus = _stacked(LABELS["conductance_s"], [(LABELS["susceptance_s"], circle)], 460, meta={"groups": groups})
    locus.update_yaxes(scaleanchor="x")
    return bode, locus


def _spectra(
    spectra: Mapping[State, Admittance], measured: Spectrum | None, measured_on: Connection, connection: Connection
) -> list[tuple[Array, Any, str, dict[str, Any]]]:
    """Return frequency, admittance, name and look of every spectrum that is drawn for a connection."""
    found: list[tuple[Array, Any, str, dict[str, Any]]] = []
    names = {"free": "tip free", "preloaded": "tip pressed on"}
    for (state, result), colour, dash in zip(spectra.items(), CYCLE, DASHES, strict=False):
        look = {"mode": "lines", "line": {"color": colour, "dash": dash}}
        found.append((result.frequency_hz, result.driven(connection), names[state], look))
    if measured is not None and (measured.ports == 2 or connection == measured_on):
        y = measured.driven(connection).admittance_s if measured.ports == 2 else measured.admittance_s
        look = {"mode": "markers", "marker": {"color": GREEN, "size": 5, "symbol": "circle-open"}}
        found.append((measured.frequency_hz, y, "measured", look))
    return found


def speed_torque(curves: Mapping[float, xarray.Dataset]) -> go.Figure:
    """Return torque, shaft power and efficiency over speed, a curve for each level of the drive."""
    linear = any(Curves(curve).linear for curve in curves.values())
    along, rows = label_of("speed_rad_s", linear), []
    for quantity in ("torque_n_m", "shaft_power_w", "efficiency"):
        label, lines = label_of(quantity, linear), list[Line]()
        for number, (level, curve) in enumerate(curves.items()):
            settled, speed = curve["settled"].values, along.scale * curve["speed_rad_s"].values
            symbols = [MARKS[number % 4] + ("" if steady else "-open") for steady in settled]
            text = ["" if steady else "<br>did not settle" for steady in settled]
            look = {"line": {"color": CYCLE[number % 4], "dash": DASHES[number % 4]}, "mode": "lines+markers"}
            look |= {"marker": {"symbol": symbols, "size": 8}, "text": text}
            name, hover = f"{100.0 * level:.3g} % of the voltage", f"%{{x:.4g}} {along.unit}: %{{y:.4g}}%{{text}}"
            lines.append(_line(name, _short(speed), label.scale * curve[quantity].values, hover, **look))
        rows.append((label._replace(name=label.name.partition(" on the ")[0]), lines))
    figure = _stacked(along, rows, 640, spacing=0.06)
    figure.update_yaxes(range=_efficiency_range(curves), row=3, col=1)
    return figure


def _efficiency_range(curves: Mapping[float, xarray.Dataset]) -> list[float]:
    """Return the range of efficiencies in %: from a tenth of the best below zero, or to -100 if the shaft is driven."""
    best = 100.0 * max(float(np.nanmax([0.0, *curve["efficiency"].values.ravel()])) for curve in curves.values())
    return [-0.1 * best, min(1.05 * best, 100.0)] if best else [-100.0, 0.0]


def calibration(points: Sequence[RecordedPoint]) -> go.Figure | None:
    """Return the residuals of the measured points of a calibration; ``None`` without points."""
    if not points:
        return None
    parts: dict[str, tuple[list[float], list[float | None]]] = {}
    for one in points:
        numbers, residuals = parts.setdefault(one.quantity, ([], []))
        numbers.append(one.point)
        residuals.append(one.residual)
    return _residuals("point", parts, 8, "point %{x}", 380)


def calibration_curve(curve: RecordedCurve) -> go.Figure:
    """Return the residuals of a spectrum or a run-up of a calibration: noise, unless the model is wrong."""
    label = time_label(max(curve.at)) if curve.along == "time_s" else LABELS[curve.along]
    at = _short(label.scale * np.array(curve.at), precise=True)
    residuals = {name: (at, values.residuals) for name, values in curve.quantities.items()}
    return _residuals(label, residuals, 5, f"%{{x:.5g}} {label.unit}", 320)


def _residuals(
    along: Label | str, parts: Mapping[str, tuple[Any, Any]], size: int, place: str, height: int
) -> go.Figure:
    """Return residuals in standard errors by the name of their quantity, over a band of two standard errors."""
    lines = []
    for number, (name, (x, y)) in enumerate(parts.items()):
        marker = {"color": CYCLE[number % len(CYCLE)], "symbol": MARKS[number % len(MARKS)], "size": size}
        lines.append(_line(name, x, y, f"{place}: %{{y:.3g}} standard errors", mode="markers", marker=marker))
    figure = _stacked(along, [("(predicted − measured)/error", lines)], height, showlegend=True)
    figure.add_hrect(-2.0, 2.0, fillcolor=GREY, opacity=0.15, line_width=0, layer="below")
    return figure


def spin_up(run: Waveforms) -> go.Figure:
    """Return the rotor's speed from rest."""
    points, label = len(run.time_s), label_of("rotor_speed_rad_s", run.linear)
    kept = np.unique(np.linspace(0, points - 1, min(points, _MOST_POINTS)).astype(int))
    time, speed = _short(1e3 * run.time_s[kept], precise=True), label.scale * run.rotor_speed_rad_s[kept]
    line = _line(label.name, time, speed, f"%{{x:.4g}} ms: %{{y:.4g}} {label.unit}", line={"color": BLUE})
    return _stacked(LABELS["time_ms"], [(label, [line])], 380, showlegend=False)


def electrical(run: Waveforms) -> go.Figure:
    """Return voltages and currents over the last three drive periods."""
    inside, time = last_periods(run.time_s, run.drive_period_s)
    rows = []
    for quantity in ("voltage_v", "current_a"):
        kind, unit = quantity.split("_")
        lines = []
        for group, colour, dash in (("a", BLUE, "solid"), ("b", VERMILION, "dash")):
            values = LABELS[quantity].scale * getattr(run, f"{kind}_{group}_{unit}")[inside]
            name, look = f"group {group.upper()}", {"color": colour, "dash": dash}
            lines.append(_line(name, _short(1e6 * time), values, "%{x:.4g} µs: %{y:.4g}", line=look))
        rows.append((LABELS[quantity], lines))
    return _stacked(LABELS["time_us"], rows, 460)


def loop_gain(loop: LoopDesign) -> go.Figure:
    """Return magnitude and phase of the loop gain of a tracker over frequency, with its crossover and phase margin."""
    frequency, at = loop.frequency_hz, loop.crossover_hz
    phase = phase_shown_deg(frequency, loop.gain, at, loop.phase_margin_deg)
    rows = []
    for values, title, unit, marked in (
        (np.abs(loop.gain), "loop gain", "", [1.0]),
        (phase, "phase in °", "°", [-180.0, loop.phase_margin_deg - 180.0]),
    ):
        hover = f"%{{x:.4g}} Hz: %{{y:.4g}}{unit}"
        gain = _line("running motor", _short(frequency), values, hover, line={"color": BLUE})
        look = {"mode": "lines+markers", "line": {"color": VERMILION}}
        rows.append((title, [gain, _line("crossover and phase margin", [at] * len(marked), marked, hover, **look)]))
    figure = _stacked("frequency of a modulation in Hz", rows, 460)
    figure.update_yaxes(type="log", exponentformat="power", row=1, col=1)
    figure.update_xaxes(type="log", exponentformat="power")
    return figure


def _line(name: str, x: Any, y: Any, hover: str, **look: Any) -> Line:
    """Return a line or markers; a value that is ``None`` or not a number leaves a gap."""
    values = y if isinstance(y, list) else _short(y)
    return {"name": name, "legendgroup": name, "mode": "lines", "x": x, "y": values, "hovertemplate": hover, **look}


def _stacked(
    along: Label | str,
    rows: Sequence[tuple[Label | str, Sequence[Line]]],
    height: int,
    spacing: float = 0.08,
    **layout: Any,
) -> go.Figure:
    """Return panels over one axis, each with its label and its lines; the legend has those of the first."""
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=spacing)
    for row, (label, lines) in enumerate(rows, start=1):
        for line in lines:
            figure.add_scatter(**line, showlegend=row == 1, row=row, col=1)
        figure.update_yaxes(title_text=str(label), row=row, col=1)
    figure.update_xaxes(title_text=str(along), row=len(rows), col=1)
    figure.update_layout(height=height + TOOL_BAR, **layout)
    return figure


def _short(values: Any, precise: bool = False) -> Any:
    """Return values as the page stores them: 4 bytes each, or 8 where 7 digits are too few."""
    return np.asarray(values, dtype=np.float64 if precise else np.float32)
