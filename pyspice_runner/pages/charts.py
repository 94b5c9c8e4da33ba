# SPDX-License-Identifier: GPL-3.0-or-later
"""The charts of the datasheet, as Plotly figures that read well in light and in dark.

A chart that moves has frames, which the page plays by its own controls; ``layout.meta`` says how: ``order`` is the
sequence of frames of one turn.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from pyspice_runner.analysis.report import Report
from pyspice_runner.analysis.spectrum import COUPLING, Connection
from pyspice_runner.analysis.waveforms import Array, Waveforms
from pyspice_runner.model.beam import solve_resonator
from pyspice_runner.model.motor import Structure

if TYPE_CHECKING:
    from pyspice_runner.model.motor import Motor

# Four of Okabe and Ito's colours and a grey: told apart by colour-blind readers, and at least 3 : 1 against both
# backgrounds of the page. Where two curves meet in one chart, dashes or markers tell them apart as well.
BLUE, VERMILION, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#BA6A98", "#808080"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE)
DASHES = ("solid", "dash", "dot", "dashdot")
MARKS = ("circle", "diamond", "square", "cross")
STATES = ((0, "separated", GREY, "dot"), (1, "stick", BLUE, "solid"), (2, "slip", VERMILION, "dash"))

MODE_STEPS = 12  # frames from the middle to the largest deflection
PATH_FRAMES = 120  # of one drive period
_SWING = 0.07  # of the beam's length: the largest deflection as it is drawn
_MOST_SHAPES = 6
_MOST_POINTS = 3000  # of a curve over time


def theme(ink: str, grid: str) -> go.layout.Template:
    """Return what differs between light and dark."""
    axis = {"gridcolor": grid, "zerolinecolor": grid, "linecolor": ink, "automargin": True}
    return go.layout.Template(
        layout={
            "font": {"color": ink, "family": "system-ui, sans-serif", "size": 13},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "xaxis": axis,
            "yaxis": axis,
            "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.06, "x": 0.0},
            "margin": {"l": 60, "r": 12, "t": 48, "b": 48},
            "hovermode": "closest",
        }
    )


def mode_shapes(motor: Motor) -> go.Figure | None:
    """Return the modes moving on the beam, with patches and tip; ``None`` for a motor that is not given by its beam."""
    structure = motor.structure
    if structure is None:
        return None
    modes = motor.modes[:_MOST_SHAPES]
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip, count=len(motor.modes))
    titles = [f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz" for mode in modes]
    figure = make_subplots(rows=len(modes), cols=1, subplot_titles=titles, shared_xaxes=True, vertical_spacing=0.12)
    parts = _parts(structure)

    def lines(mode: int, deflection: float) -> list[tuple[Array, Array]]:
        swing = deflection * _SWING * structure.beam.length_m
        return [
            _bent(swing, points, resonator.deflection(foot)[:, mode], resonator.slope(foot)[:, mode])
            for points, foot, *_ in parts
        ]

    for row in range(len(modes)):
        for (x, y), (_, _, name, colour, fill) in zip(lines(row, 0.0), parts, strict=True):
            figure.add_scatter(
                x=_short(1e3 * x), y=_short(1e3 * y), name=name, legendgroup=name, showlegend=row == 0, mode="lines",
                line={"color": colour, "width": 4 if fill is None else 1.5}, fill=fill, hoverinfo="skip",
                row=row + 1, col=1,
            )  # fmt: skip
    frames = []
    for step in range(-MODE_STEPS, MODE_STEPS + 1):
        deflection = np.sin(0.5 * pi * step / MODE_STEPS)
        moved = [line for row in range(len(modes)) for line in lines(row, deflection)]
        data = [go.Scatter(x=_short(1e3 * x), y=_short(1e3 * y)) for x, y in moved]
        frames.append(go.Frame(name=str(step), data=data, traces=list(range(len(data)))))
    figure.frames = frames
    order = [*range(MODE_STEPS), *range(MODE_STEPS, -MODE_STEPS, -1), *range(-MODE_STEPS, 0)]
    height = _height(structure)
    figure.update_yaxes(range=[-1.1e3 * (height + _SWING * structure.beam.length_m),
                               1.1e3 * (max(height, structure.tip.length_m) + _SWING * structure.beam.length_m)],
                        title_text="mm")  # fmt: skip
    figure.update_xaxes(range=[-60.0 * structure.beam.length_m, 1060.0 * structure.beam.length_m])
    figure.update_xaxes(title_text="position along the beam in mm", row=len(modes), col=1)
    figure.update_layout(height=110 + 210 * len(modes), meta={"order": [str(step) for step in order]})
    return figure


def _parts(structure: Structure) -> list[tuple[Array, Array, str, str, str | None]]:
    """Return what is drawn: points (x, z) at rest, the place on the beam that each moves with, name, colour, fill."""
    beam, tip = structure.beam, structure.tip
    parts: list[tuple[Array, Array, str, str, str | None]] = []
    parts.append((*_box(0.0, beam.length_m, -0.5 * beam.thickness_m, 0.5 * beam.thickness_m), "beam", GREY, "toself"))
    for group, colour in (("A", BLUE), ("B", VERMILION)):
        boxes = []
        for patch in structure.patches:
            if patch.group == group:
                low, high = 0.5 * beam.thickness_m, 0.5 * beam.thickness_m + patch.thickness_m
                faces = {"top": [(low, high)], "bottom": [(-high, -low)]}
                for face in faces.get(patch.faces, faces["top"] + faces["bottom"]):
                    boxes += [_box(patch.start_m, patch.end_m, *face), (np.full((1, 2), np.nan), np.zeros(1))]
        if boxes:
            points, foot = (np.concatenate(arrays) for arrays in zip(*boxes, strict=True))
            parts.append((points, foot, f"patches of group {group}", colour, "toself"))
    stem = np.array([[tip.position_m, 0.0], [tip.position_m, tip.length_m]])
    parts.append((stem, np.full(2, tip.position_m), "tip", GREEN, None))
    return parts


def _box(start: float, end: float, low: float, high: float) -> tuple[Array, Array]:
    x = np.linspace(start, end, 41)
    outline = np.concatenate([x, x[::-1], x[:1]])
    heights = np.concatenate([np.full(41, low), np.full(41, high), [low]])
    return np.column_stack([outline, heights]), outline


def _bent(swing: float, points: Array, deflection: Array, slope: Array) -> tuple[Array, Array]:
    """Return points moved by a deflection and, away from the neutral axis, by its slope."""
    return points[:, 0] - points[:, 1] * swing * slope, points[:, 1] + swing * deflection


def _height(structure: Structure) -> float:
    return 0.5 * structure.beam.thickness_m + max(patch.thickness_m for patch in structure.patches)


def tip_path(run: Waveforms) -> go.Figure:
    """Return the last drive period: the tip's path coloured by contact state, and the forces, with a moving marker."""
    time, columns = _last_period(run)
    x, y, state = 1e6 * columns["tip_x_m"], 1e6 * columns["tip_y_m"], np.rint(columns["contact_state"])
    normal, friction = columns["normal_force_n"], columns["friction_force_n"]
    figure = make_subplots(rows=2, cols=1, row_heights=[0.58, 0.42], vertical_spacing=0.14)
    for code, name, colour, dash in STATES:
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
        line={"color": GREEN, "width": 2}, marker={"color": GREEN, "size": [13, 6], "symbol": ["circle", "diamond"]},
    )  # fmt: skip
    figure.add_scatter(
        **now, name="now", showlegend=False, mode="markers", marker={"color": GREEN, "size": 10}, row=2, col=1,
        hoverinfo="skip",
    )  # fmt: skip
    figure.frames = [
        go.Frame(name=str(number), data=[go.Scatter(**part) for part in moving(int(place))], traces=[still, still + 1])
        for number, place in enumerate(places)
    ]
    for axis, values, reach in (("xaxis", x, 0.3), ("yaxis", y, 0.3)):
        low, high_end = float(values.min()), float(values.max())
        room = 0.08 * max(high_end - low, 1e-9)
        span = reach * (high_end - low)
        figure.update_layout(
            {axis: {"range": [low - room - (span if axis == "xaxis" else 0.0), high_end + room + span]}}
        )
    figure.update_xaxes(title_text="along the rotor in µm", row=1, col=1)
    figure.update_yaxes(title_text="towards the rotor in µm", row=1, col=1)
    figure.update_xaxes(title_text="time in µs", row=2, col=1)
    figure.update_yaxes(title_text="force in N", row=2, col=1)
    figure.update_layout(height=640, meta={"order": [str(number) for number in range(len(places))]})
    return figure


def _last_period(run: Waveforms) -> tuple[Array, dict[str, Array]]:
    """Return the last drive period: time from its start, and the columns on it."""
    begin = max(float(run.time_s[-1]) - run.drive_period_s, 0.0)
    inside = run.time_s >= begin
    names = ("tip_x_m", "tip_y_m", "contact_state", "normal_force_n", "friction_force_n")
    return run.time_s[inside] - begin, {name: getattr(run, name)[inside] for name in names}


def admittance(report: Report) -> tuple[go.Figure, go.Figure]:
    """Return |Y| and phase over frequency, and the G–B circle; ``meta.groups`` is the connection of every trace."""
    over = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.08)
    circle = go.Figure()
    groups_over: list[str] = []
    groups_circle: list[str] = []
    for connection in COUPLING:
        for frequency, y, name, look in _spectra(report, connection):
            shown = {"name": name, "legendgroup": name, "visible": connection == "A", **look}
            hertz = _short(1e-3 * frequency, precise=True)
            over.add_scatter(
                x=hertz, y=_short(1e3 * np.abs(y)), row=1, col=1, **shown,
                hovertemplate="%{x:.5g} kHz: %{y:.4g} mS",
            )  # fmt: skip
            over.add_scatter(
                x=hertz, y=_short(np.degrees(np.angle(y))), row=2, col=1, **shown | {"showlegend": False},
                hovertemplate="%{x:.5g} kHz: %{y:.4g}°",
            )  # fmt: skip
            circle.add_scatter(
                x=_short(1e3 * y.real), y=_short(1e3 * y.imag), **shown, customdata=hertz,
                hovertemplate="%{customdata:.5g} kHz<br>G %{x:.4g} mS<br>B %{y:.4g} mS",
            )  # fmt: skip
            groups_over += [connection] * 2
            groups_circle += [connection]
    over.update_yaxes(type="log", dtick="D2", title_text="|Y| in mS", row=1, col=1)
    over.update_yaxes(title_text="phase in °", row=2, col=1)
    over.update_xaxes(title_text="frequency in kHz", row=2, col=1)
    circle.update_xaxes(title_text="conductance G in mS")
    circle.update_yaxes(title_text="susceptance B in mS", scaleanchor="x")
    over.update_layout(height=560, meta={"groups": groups_over})
    circle.update_layout(height=460, meta={"groups": groups_circle})
    return over, circle


def _spectra(report: Report, connection: Connection) -> list[tuple[Array, Any, str, dict[str, Any]]]:
    """Return frequency, admittance, name and look of every spectrum that is drawn for a connection."""
    found: list[tuple[Array, Any, str, dict[str, Any]]] = []
    names = {"free": "tip free", "preloaded": "pressed on the rotor"}
    for (state, result), colour, dash in zip(report.spectra.items(), COLOURS, DASHES, strict=False):
        look = {"mode": "lines", "line": {"color": colour, "dash": dash}}
        found.append((result.frequency_hz, result.driven(connection), names[state], look))
    measured = report.measured
    if measured is not None and (measured.ports == 2 or connection == report.connection):
        y = measured.driven(connection).admittance_s if measured.ports == 2 else measured.admittance_s
        look = {"mode": "markers", "marker": {"color": GREEN, "size": 5, "symbol": "circle-open"}}
        found.append((measured.frequency_hz, y, "measured", look))
    return found


def speed_torque(report: Report) -> go.Figure:
    """Return torque, shaft power and efficiency over speed, a curve for each level of the drive."""
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    panels = (
        ("torque_n_m", 1e3, "torque in mN·m"),
        ("shaft_power_w", 1e3, "shaft in mW"),
        ("efficiency", 100.0, "η in %"),
    )
    for number, (level, curve) in enumerate(report.curves.items()):
        colour, name = COLOURS[number % 4], f"{100.0 * level:.3g} % of the voltage"
        settled = curve["settled"].values
        marks = [MARKS[number % 4] + ("" if steady else "-open") for steady in settled]
        for row, (quantity, scale, _) in enumerate(panels, start=1):
            values = scale * curve[quantity].values
            if quantity == "efficiency":  # of a motor; not where the shaft drives it
                values = np.where(curve["shaft_power_w"].values < 0.0, np.nan, values)
            figure.add_scatter(
                x=_short(curve["speed_rad_s"].values), y=_short(values), row=row, col=1,
                name=name, legendgroup=name, showlegend=row == 1, mode="lines+markers",
                line={"color": colour, "dash": DASHES[number % 4]}, marker={"symbol": marks, "size": 8},
                text=["" if steady else "<br>did not settle" for steady in settled],
                hovertemplate="%{x:.4g} rad/s: %{y:.4g}%{text}",
            )  # fmt: skip
    for row, (*_, title) in enumerate(panels, start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    figure.update_xaxes(title_text="speed in rad/s", row=3, col=1)
    figure.update_layout(height=640)
    return figure


def spin_up(run: Waveforms) -> go.Figure:
    """Return the rotor's speed from rest."""
    kept = _thinned(len(run.time_s))
    figure = go.Figure()
    figure.add_scatter(
        x=_short(1e3 * run.time_s[kept], precise=True), y=_short(run.rotor_speed_rad_s[kept]), mode="lines",
        line={"color": BLUE}, name="rotor", hovertemplate="%{x:.4g} ms: %{y:.4g} rad/s",
    )  # fmt: skip
    figure.update_xaxes(title_text="time in ms")
    figure.update_yaxes(title_text="rotor speed in rad/s")
    figure.update_layout(height=380)
    return figure


def electrical(run: Waveforms, periods: int = 3) -> go.Figure:
    """Return voltages and currents over the last drive periods."""
    begin = max(float(run.time_s[-1]) - periods * run.drive_period_s, 0.0)
    inside = run.time_s >= begin
    time = 1e6 * (run.time_s[inside] - begin)
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.08)
    for row, (quantity, scale, title) in enumerate(
        (("voltage_{}_v", 1.0, "voltage in V"), ("current_{}_a", 1e3, "current in mA")), start=1
    ):
        for group, colour, dash in (("a", BLUE, "solid"), ("b", VERMILION, "dash")):
            figure.add_scatter(
                x=_short(time), y=_short(scale * getattr(run, quantity.format(group))[inside]), row=row, col=1,
                name=f"group {group.upper()}", legendgroup=group, showlegend=row == 1, mode="lines",
                line={"color": colour, "dash": dash}, hovertemplate="%{x:.4g} µs: %{y:.4g}",
            )  # fmt: skip
        figure.update_yaxes(title_text=title, row=row, col=1)
    figure.update_xaxes(title_text="time in µs", row=2, col=1)
    figure.update_layout(height=460)
    return figure


def _thinned(points: int) -> Array:
    return np.unique(np.linspace(0, points - 1, min(points, _MOST_POINTS)).astype(int))


def _short(values: Any, precise: bool = False) -> Any:
    """Return values as the page stores them, in 4 bytes each, or 8 where 7 digits are too few."""
    return np.asarray(values, dtype=np.float64 if precise else np.float32)
