# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of datasets: speed–torque curves, branches, maps of operating points, and sweeps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pyspice_runner.datasets import FLAGS, Branch, Curves, Sweep, WorkingPoints
from pyspice_runner.errors import ParameterError
from pyspice_runner.run.waveforms import Array
from pyspice_runner.view.draw import AXIS, DASHES, MARKS, Panel, Sheet, dress
from pyspice_runner.view.style import BLUE, CYCLE, GREY, LABELS, VERMILION, Label, label_of

_QUANTITIES = {  # panel → quantity, and name of its label
    "torque": ("torque_n_m", "torque_n_m"),
    "force": ("normal_force_n", "force_n"),
    "speed": ("speed_rad_s", "speed_rad_s"),
    "efficiency": ("efficiency", "efficiency"),
    "power": ("shaft_power_w", "shaft_power_w"),
    "current of A": ("current_a_rms_a", "current_rms_a"),
    "current": ("current_a", "current_rms_a"),
    "temperature": ("temperature_c", "temperature_c"),
}


def _axis_label(data: Any, name: str) -> str:
    return f"{name} in {data[name].attrs['units']}"


def speed_torque(curves: Curves) -> Sheet:
    """Return torque, efficiency, power and currents over speed."""
    data, linear = curves.dataset, curves.linear
    data = data.assign(electrical_power_w=data["power_a_w"] + data["power_b_w"])
    lines = [
        (", ".join(f"{other} = {data[other].values[place]:g}" for other, place in at.items()), data.isel(at))
        for at in _each(data, curves.others)
    ]
    currents = ("current_a_rms_a", "current_b_rms_a")
    panels: dict[str, Panel] = {
        name: partial(over_speed, lines, quantities, label_of(label, linear), title, linear)
        for name, quantities, label, title in (
            ("torque", ["torque_n_m"], "torque_n_m", "Force" if linear else "Torque"),
            ("efficiency", ["efficiency"], "efficiency", "Efficiency: power at the shaft / electrical power"),
            ("power", ["electrical_power_w"], "electrical_power_w", "Electrical power of both groups"),
            ("current", currents, "current_rms_a", "Currents of group A and (dashed) group B"),
        )
    }
    return Sheet(panels, 2, (5.0, 3.6), data.attrs["title"])


def _each(data: Any, others: list[str]) -> Iterator[dict[str, int]]:
    """Yield each combination of places on the other axes."""
    for index in np.ndindex(*(data.sizes[name] for name in others)):
        yield dict(zip(others, index, strict=True))


def over_speed(
    curves: Sequence[tuple[str, Any]], quantities: Sequence[str], label: Label, title: str, linear: bool, ax: Axes
) -> None:
    """Draw quantities over speed for each curve, by its name; a ring marks a point not settled."""
    along, rings = label_of("speed_rad_s", linear), False
    for number, (name, curve) in enumerate(curves):
        speed = along.scale * curve["speed_rad_s"].values
        for quantity, dash in zip(quantities, DASHES, strict=False):
            values = label.scale * curve[quantity].values
            look: dict[str, Any] = {"color": CYCLE[number % 4], "marker": MARKS[number % 4], "ms": 3}
            ax.plot(speed, values, dash, label=name if dash == "-" and name else None, **look)
            ring = ~curve["settled"].values & np.isfinite(values)
            if ring.any():
                first = None if rings else "not settled"
                ax.plot(speed[ring], values[ring], "o", ms=7, mfc="none", mec=GREY, label=first)
                rings = True
    ax.axvline(0.0, **AXIS)
    ax.axhline(0.0, **AXIS)
    dress(ax, along, label, title)
    low, high = ax.get_ylim()
    if label is LABELS["efficiency"] and (low < -100.0 or high > 100.0):  # it has no limit where hardly any power flows
        ax.set_ylim(max(low, -100.0), min(high, 100.0))


def _varying(draw_panel: Callable[..., None], result: Branch | WorkingPoints, *names: str) -> dict[str, Panel]:
    """Return a panel for each quantity that is there and varies."""
    data = result.dataset
    return {
        name.removesuffix(" of A"): partial(draw_panel, result, quantity, label_of(label, result.linear))
        for name, (quantity, label) in ((name, _QUANTITIES[name]) for name in names)
        if quantity in data and float(data[quantity].std()) > 0.0
    }


def branch(result: Branch) -> Sheet:
    """Return torque, normal force, speed and current along a branch."""
    panels = _varying(_followed, result, "torque", "force", "speed", "current of A")
    return Sheet(panels, 2, (5.4, 3.6), result.dataset.attrs["title"])


def _followed(result: Branch, quantity: str, label: Label, ax: Axes) -> None:
    """Draw a quantity along a branch: stable parts solid, unstable ones dashed."""
    data = result.dataset
    x, values, stable = data[result.along].values, label.scale * data[quantity].values, data["stable"].values
    for kind, dash, words in ((stable, "-", "stable"), (~stable, "--", "not stable")):
        shown = kind | np.roll(kind, 1)  # up to the first point of the other kind
        shown[0] = kind[0]
        if kind.any():
            ax.plot(np.where(shown, x, np.nan), values, dash, color=BLUE if dash == "-" else VERMILION, label=words)
    dress(ax, _axis_label(data, result.along), label)


def working_points(result: WorkingPoints) -> Sheet:
    """Return the quantities of a map over one or two axes."""
    draw_panel = _contours if len(result.axes) == 2 else _mapped
    panels = _varying(draw_panel, result, "torque", "speed", "efficiency", "power", "current", "temperature")
    if len(result.axes) > 2 or not panels:
        raise ParameterError("A map is drawn over one or two axes. Choose values of the others, by dataset.isel.")
    return Sheet(panels, 2, (5.4, 4.0), result.dataset.attrs["title"])


def _contours(result: WorkingPoints, quantity: str, label: Label, ax: Axes) -> None:
    """Draw contours over two axes; marks show points that are unstable or not converged, and the best one.

    The region outside the limits is hatched.
    """
    across, along = result.axes
    data = result.dataset.transpose(across, along, ...)
    x, y = data[along].values, data[across].values
    values = np.ma.masked_invalid(label.scale * data[quantity].values)
    wide = min(values.shape) > 1
    if wide and values.count() > 3:
        filled = ax.contourf(x, y, values, levels=12, cmap="viridis")
        ax.get_figure().colorbar(filled, ax=ax)  # type: ignore[union-attr]
    converged = data["converged"].values
    unstable = converged & ~data["stable"].values
    outside = converged & data["stable"].values & ~data["allowed"].values
    if wide and outside.any():
        ax.contourf(x, y, outside, levels=[0.5, 1.5], colors="none", hatches=["//"])
        ax.fill_between([], [], fc="none", ec="black", hatch="//", lw=0.0, label="outside the limits")
    for marked, mark, words in ((unstable, "x", "not stable"), (~converged, "s", "not converged")):
        rows, columns = np.nonzero(marked)
        if rows.size:
            ax.plot(x[columns], y[rows], mark, color=VERMILION, mfc="none", ms=5, ls="", label=words)
    if result.best:
        ax.plot(result.best[along], result.best[across], "*", color="white", mec="black", ms=12, ls="", label="best")
    ax.set(xlabel=_axis_label(data, along), ylabel=_axis_label(data, across), title=str(label))
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize="small")


def _mapped(result: WorkingPoints, quantity: str, label: Label, ax: Axes) -> None:
    """Draw a quantity over one axis, with a mark at the points that are not stable, and at the best one."""
    data = result.dataset
    (along,) = result.axes
    x, values = data[along].values, label.scale * data[quantity].values
    ax.plot(x, values, ".-", color=BLUE)
    unstable = ~data["stable"].values
    if unstable.any():
        ax.plot(x[unstable], values[unstable], "x", color=VERMILION, label="not stable")
    if result.best:
        ax.plot(result.best[along], label.scale * result.best[quantity], "*", color="black", ms=10, label="best")
    dress(ax, _axis_label(data, along), label)


def sweep(result: Sweep) -> Sheet:
    """Return a panel for each quantity."""
    shown = [name for name in result.quantities if name not in FLAGS] or result.quantities
    panels: dict[str, Panel] = {name: partial(_swept, result, name) for name in shown}
    return Sheet(panels, 1, (8.0, 3.4), result.dataset.attrs.get("parameter_set", ""))


def _swept(result: Sweep, quantity: str, ax: Axes) -> None:
    """Draw a quantity over the first axis, or its distribution if there are only samples.

    A ring marks a point that is not settled, a square one that is not accurate.
    """
    values = result.dataset[quantity]
    label = _axis_label(result.dataset, quantity) if values.attrs["units"] != "1" else quantity
    if values.dims[:1] == ("sample",):
        _distribution(values.values[np.isfinite(values.values)], label, ax)
        return
    along, *others = (str(dimension) for dimension in values.dims if dimension != "sample")
    x = values[along].values
    marked: set[str] = set()
    for number, at in enumerate(_each(values, others)):
        curve, colour = values.isel(at), CYCLE[number % 4]
        name = ", ".join(f"{other} {curve[other].item():g}" for other in others)
        if "sample" in curve.dims:
            cloud = curve.transpose(along, "sample").values
            low, median, high = np.transpose([_quantiles(samples[np.isfinite(samples)]) for samples in cloud])
            ax.plot(x, cloud, color=colour, alpha=0.25, linewidth=0.6)
            ax.fill_between(x, low, high, color=colour, alpha=0.2)
            ax.plot(x, median, color=colour, label=f"{name} median, 5 to 95 %".strip())
            continue
        ax.plot(x, curve.values, ".-", color=colour, label=name or None)
        for mark, (words, points) in zip("os", result.flagged.items(), strict=False):
            where = points.isel(at).values
            if where.any():
                first = None if words in marked else words
                ax.plot(x[where], curve.values[where], mark, mfc="none", mec="black", ms=5 + 3 * len(marked),
                        label=first)  # fmt: skip
                marked.add(words)
    dress(ax, _axis_label(result.dataset, along), label)


def _distribution(samples: Array, label: str, ax: Axes) -> None:
    """Draw the cumulative distribution of samples."""
    ax.step(np.sort(samples), np.arange(1, samples.size + 1) / max(samples.size, 1), color=BLUE, where="post")
    ax.set_ylim(0.0, 1.0)
    if samples.size:
        ax.axvspan(*np.quantile(samples, [0.05, 0.95]), color=GREY, alpha=0.2, label="5 to 95 %")
    dress(ax, label, "fraction of the samples at or below")


def _quantiles(samples: Array) -> Any:
    return np.quantile(samples, [0.05, 0.5, 0.95]) if samples.size else [np.nan] * 3
