# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of spectra: admittances, fits, comparisons, and small signals of a running motor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from pyspice_runner.impedance.admittance import Admittance
from pyspice_runner.impedance.compare import Comparison, Trend
from pyspice_runner.impedance.one_port_fit import SpectrumFit
from pyspice_runner.impedance.spectrum import COUPLING, Connection, Spectrum
from pyspice_runner.impedance.two_port_fit import TwoPortFit
from pyspice_runner.motor import groups
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady.small_signals import INPUTS, OUTPUTS, SmallSignals
from pyspice_runner.units import linear_words
from pyspice_runner.view.draw import AXIS, DASHES, MARKS, Panel, Sheet, draw_lines, dress, plain
from pyspice_runner.view.style import BLUE, CYCLE, GREY, GROUPS, LABELS, ORANGE, VERMILION, Label

_DOTS: dict[str, Any] = {"marker": ".", "markersize": 3, "linestyle": ""}
_ERROR_BARS: dict[str, Any] = {"capsize": 3, "ecolor": VERMILION, "elinewidth": 1.2}
_FREQUENCY = LABELS["frequency_hz"]


class Trace(NamedTuple):
    """A curve of admittance over frequency, and its Matplotlib properties."""

    frequency_hz: Array
    admittance_s: Any
    look: dict[str, Any]


def spectrum_panels(traces: list[Trace], marks: Mapping[str, Panel] | None = None) -> dict[str, Panel]:
    """Return |Y|, phase, and the circle of conductance and susceptance; ``marks`` complete panels, by their names."""

    def draw_traces(name: str, x: str, y: str, title: str, of: Callable[[Trace], tuple[Any, Any]], ax: Axes) -> None:
        for trace in traces:
            across, up = of(trace)
            ax.plot(LABELS[x].scale * across, LABELS[y].scale * up, **trace.look)
        ax.set_yscale("log" if y == "magnitude_s" else "linear")
        dress(ax, LABELS[x], LABELS[y], title, legend=y == "magnitude_s")
        if x == "conductance_s":
            ax.axis("equal")
        if marks and name in marks:
            marks[name](ax)

    kinds: dict[str, tuple[str, str, str, Callable[[Trace], tuple[Any, Any]]]] = {
        "magnitude": ("frequency_hz", "magnitude_s", "Admittance", lambda one: (one[0], np.abs(one[1]))),
        "phase": ("frequency_hz", "phase_deg", "Phase", lambda one: (one[0], np.angle(one[1], deg=True))),
        "circle": ("conductance_s", "susceptance_s", "G–B circle", lambda one: (one[1].real, one[1].imag)),
    }
    return {name: partial(draw_traces, name, *kind) for name, kind in kinds.items()}


def _with_residuals(traces: list[Trace], marks: Mapping[str, Panel], name: str, residuals: Panel, title: str) -> Sheet:
    """Return the sheet of a comparison."""
    panels = spectrum_panels(traces, marks)
    order = {panel: panels[panel] for panel in ("magnitude", "circle", "phase")}
    return Sheet({**order, name: residuals}, 2, (5.5, 4.0), title)


def admittance(result: Admittance) -> Sheet:
    """Return the admittance of both groups in phase, and in antiphase; of one group that of it."""
    looks: dict[Connection, dict[str, Any]] = {
        "A+B": {"color": BLUE, "label": "A+B"},
        "A-B": {"color": VERMILION, "linestyle": "--", "label": "A−B"},
    }
    looks = {"A": {"color": BLUE}} if result.matrix_s.shape[-1] == 1 else looks
    traces = [Trace(result.frequency_hz, result.driven(name), look) for name, look in looks.items()]
    return Sheet(spectrum_panels(traces), 3, (4.4, 4.2), f"{result.motor['name']}, {result.state}")


def spectrum(result: Spectrum) -> Sheet:
    """Return a measured spectrum; of a two-port, every connection of the groups."""
    frequency = result.frequency_hz
    if result.ports == 1:
        traces = [Trace(frequency, result.admittance_s, {"color": BLUE, "label": "measured"})]
    else:
        traces = [
            Trace(frequency, result.driven(name).admittance_s,
                   {"color": colour, "linestyle": dash, "label": name.replace("-", "−")})
            for name, colour, dash in zip(COUPLING, CYCLE, DASHES, strict=True)
        ]  # fmt: skip
    return Sheet(spectrum_panels(traces), 3, (4.4, 4.2), result.source)


def spectrum_fit(fit: SpectrumFit) -> Sheet:
    """Return the measured and the fitted admittance, and the residuals; dotted lines mark the series resonances.

    On the circle are f₁ and f₂, between which the measured conductance of an arm exceeds half of its maximum.
    """
    fine = np.union1d(np.linspace(fit.frequency_hz[0], fit.frequency_hz[-1], 4001), fit.frequency_hz)
    traces = [
        Trace(fit.frequency_hz, fit.measured_s, {**_DOTS, "color": GREY, "label": "measured"}),
        Trace(fine, fit.admittance(fine), {"color": BLUE, "linewidth": 1.2, "label": f"fitted, arms: {len(fit.arms)}"}),
    ]

    def mark_resonances(ax: Axes) -> None:
        for arm in fit.arms:
            if arm.in_band:
                ax.axvline(_FREQUENCY.scale * arm.series_resonance_hz, color=VERMILION, linewidth=0.8, linestyle=":")

    def mark_half_power(ax: Axes) -> None:
        for points in (arm.half_power for arm in fit.arms):
            for name, frequency in (("f₁", points.lower_hz), ("f₂", points.upper_hz)) if points else ():
                y = np.interp(frequency, fit.frequency_hz, fit.measured_s)
                place = LABELS["conductance_s"].scale * y.real, LABELS["susceptance_s"].scale * y.imag
                ax.plot(*place, "o", color=VERMILION, markersize=4, fillstyle="none")
                ax.annotate(name, place, (4, 4), textcoords="offset points", fontsize=7, color=VERMILION)

    def draw_residuals(ax: Axes) -> None:
        lines = [
            (fit.residuals.real, {**_DOTS, "color": BLUE, "label": "in phase"}),
            (fit.residuals.imag, {**_DOTS, "color": ORANGE, "label": "in quadrature"}),
        ]
        title = f"Residuals: {100.0 * fit.rms_relative_error:.3g} % RMS"
        draw_lines(ax, (_FREQUENCY, fit.frequency_hz), Label("residual", "% of |Y|", 100.0), lines, title)
        mark_resonances(ax)

    marks = {"magnitude": mark_resonances, "phase": mark_resonances, "circle": mark_half_power}
    return _with_residuals(traces, marks, "residuals", draw_residuals, fit.source)


def two_port_fit(fit: TwoPortFit) -> Sheet:
    """Return the couplings of the modes, with their standard errors."""

    def draw_couplings(ax: Axes) -> None:
        places = np.arange(len(fit.modes))
        for (group, colour), shift in zip(GROUPS.items(), (-0.2, 0.2), strict=True):
            name = groups.column("coupling", group, "n_per_v_kg05")
            values = [getattr(mode, name) for mode in fit.modes]
            errors = [mode.standard_errors[name] for mode in fit.modes]
            ax.bar(places + shift, values, 0.4, yerr=errors, capsize=3, color=colour, label=f"group {group.upper()}")
        ax.set_xticks(places, [f"{1e-3 * mode.series_resonance_hz:.4g} kHz" for mode in fit.modes])
        ax.axhline(0.0, **AXIS)
        dress(ax, "", "coupling in N/(V·√kg)", "Couplings of the modes")

    return Sheet({"couplings": draw_couplings}, 1, (7.0, 4.0), fit.source)


def comparison(result: Comparison) -> Sheet:
    """Return both admittances over the band of the measured one, and the deviations."""
    reference, measured = result.reference, result.measured
    traces = [
        Trace(reference.frequency_hz, reference.measured_s,
               {"color": BLUE, "linewidth": 1.2, "label": plain(f"reference: {reference.source}")}),
        Trace(measured.frequency_hz, measured.measured_s,
               {**_DOTS, "color": VERMILION, "label": plain(f"measured: {measured.source}")}),
    ]  # fmt: skip
    band = _FREQUENCY.scale * measured.frequency_hz[0], _FREQUENCY.scale * measured.frequency_hz[-1]
    title = f"{100.0 * result.rms_deviation:.3g} % RMS between the admittances"
    marks = dict.fromkeys(("magnitude", "phase"), lambda ax: ax.set_xlim(*band))
    return _with_residuals(traces, marks, "deviations", partial(_deviations, result), title)


def _deviations(result: Comparison, ax: Axes) -> None:
    known = {key: 100.0 * value for key, value in result.deviations().items() if np.isfinite(value)}
    errors = [100.0 * (result.errors()[key] or 0.0) for key in known]  # 0, and no bar, where it is not determined
    labels: dict[int | None, str] = {item.mode: f", {item.label}" for item in result.modes}
    names = [name.replace("_", " ") + labels.get(mode, "") for name, mode in known]
    bars = ax.barh(names, list(known.values()), xerr=errors, color=BLUE, error_kw=_ERROR_BARS)
    texts = [f"{value:+.2f}" for value in known.values()]
    texts = [f"{text} ± {error:.1g}" if error else text for text, error in zip(texts, errors, strict=True)]
    ax.bar_label(bars, texts, padding=3, fontsize=7)
    ax.invert_yaxis()
    ax.margins(x=0.45)  # room for the texts at the ends
    ax.axvline(0.0, **AXIS)
    dress(ax, LABELS["deviation"], "", "Measured less reference, with standard errors")


def trend(result: Trend) -> Sheet:
    """Return the deviations of several spectra from one reference."""
    if len(result.comparisons) == 1:
        return comparison(result.comparisons[0])
    panels: dict[str, Panel] = {
        name: partial(_trend, result, name, title)
        for name, title in (
            ("frequency", "Series resonance"),
            ("quality_factor", "Quality factor"),
            ("coupling", "Coupling θ/√m"),
            ("clamped_capacitance", "Clamped capacitance"),
        )
    }
    reference = result.comparisons[0].reference.source
    if result.comparisons[0].diagnosis is not None:
        panels["causes"] = partial(_causes, result)
    return Sheet(panels, 2, (5.0, 3.5), f"{len(result.comparisons)} spectra against {reference}")


def _causes(result: Trend, ax: Axes) -> None:
    """Draw the number of parts with each cause."""
    first = [fill(item.diagnosis.causes[0].name, 16) for item in result.comparisons if item.diagnosis is not None]
    names = sorted(set(first), key=first.count)
    ax.bar_label(ax.barh(names, [first.count(name) for name in names], color=BLUE), padding=3, fontsize=7)
    dress(ax, "spectra", "", "Most probable causes")


def _trend(result: Trend, name: str, title: str, ax: Axes) -> None:
    tables = [item.deviations() for item in result.comparisons]
    for number, key in enumerate(key for key in tables[0] if key[0] == name):
        values = [100.0 * table[key] if np.isfinite(table[key]) else np.nan for table in tables]
        errors = [100.0 * (item.errors()[key] or 0.0) for item in result.comparisons]
        label = next((mode.label for mode in result.comparisons[0].modes if mode.mode == key[1]), None)
        look: dict[str, Any] = {"color": CYCLE[number % 4], "marker": MARKS[number % 4], "capsize": 3}
        ax.errorbar(result.at, values, errors, label=label, **look)
    ax.axhline(0.0, **AXIS)
    dress(ax, plain(result.label), LABELS["deviation"], title)


def small_signals(result: SmallSignals) -> Sheet:
    """Return the transfer functions from each input, and the admittance for a small voltage."""
    panels: dict[str, Panel] = {
        of: partial(_transfers, result, of) for of in INPUTS if any(name == of for _, name in result.transfers)
    }
    panels["admittance"] = partial(_small_admittance, result)
    return Sheet(panels, 2, (5.4, 3.6), f"{result.state.motor.name}: small signals, {result.state.drive.label}")


def _transfers(result: SmallSignals, of: str, ax: Axes) -> None:
    """Draw the magnitudes of the transfer functions from one input, each relative to its first value."""
    for number, output in enumerate(name for name in OUTPUTS if not name.startswith("motional")):
        values = np.abs(result.transfer(output, of))
        if values[0] > 0.0:
            name = f"{output}, {values[0]:.3g} {result.unit(output, of)}"
            name = linear_words(name) if result.linear else name
            look: dict[str, Any] = {"color": CYCLE[number % 4], "linestyle": DASHES[number // 4], "marker": "."}
            ax.loglog(result.modulation_hz, values / values[0], label=name, **look)
    dress(ax, "modulation frequency in Hz", "magnitude over that at the lowest", f"From {of}")


def _small_admittance(result: SmallSignals, ax: Axes) -> None:
    """Draw the admittance of each group for a small voltage, of the running motor and of the free stator."""
    states = ((result.hot_admittance_s, "-", "running"), (result.cold_admittance_s, "--", "at rest, free"))
    lines = [
        (np.abs(matrix[:, place, place]), {"linestyle": dash, "color": colour, "label": f"{group.upper()}, {words}"})
        for place, (group, colour) in enumerate(GROUPS.items())
        for matrix, dash, words in states
    ]
    axis = LABELS["frequency_hz"], result.probe_hz
    draw_lines(ax, axis, LABELS["magnitude_s"], lines, "Admittance for a small voltage", fontsize="x-small")
