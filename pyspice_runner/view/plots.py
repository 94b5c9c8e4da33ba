# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of every kind of result, drawn by Matplotlib.

Each result has a :class:`~pyspice_runner.view.draw.Sheet` of named panels; ``result.plot(ax=…, panel=NAME)`` draws one
of them into any Axes. This module is loaded when something is drawn, never before.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from pyspice_runner.analysis.averaged import AveragedRun
from pyspice_runner.analysis.controlled import ControlledRun
from pyspice_runner.analysis.drive import DriveReport
from pyspice_runner.analysis.impact import Impact
from pyspice_runner.analysis.small_signals import INPUTS, OUTPUTS, SmallSignals, unit
from pyspice_runner.analysis.steady import SteadyState
from pyspice_runner.analysis.track import Tracking
from pyspice_runner.datasets import DOUBTS, Branch, Curves, Sweep, WorkingPoints
from pyspice_runner.errors import ParameterError
from pyspice_runner.model.beam import solve_resonator
from pyspice_runner.model.motor import Motor
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.spectra.admittance import Admittance
from pyspice_runner.spectra.compare import Comparison, Trend
from pyspice_runner.spectra.fit import SpectrumFit
from pyspice_runner.spectra.spectrum import COUPLING, Spectrum
from pyspice_runner.spectra.twoport import TwoPortFit
from pyspice_runner.view.draw import Panel, Sheet, draw, draw_beside, picture, plain, save, sheet
from pyspice_runner.view.report import Report
from pyspice_runner.view.style import BLUE, CYCLE, GREEN, GREY, GROUPS, LABELS, ORANGE, STATES, VERMILION, Label

__all__ = ["draw", "draw_beside", "draw_motors", "picture", "save", "sheet"]

_PERIODS = 3  # of the drive, in panels that show its last periods
_DASHES = ("-", "--", "-.", ":")
_MARKS = ("o", "s", "^", "D")
_DOTS: dict[str, Any] = {"marker": ".", "markersize": 3, "linestyle": ""}
_AXIS: dict[str, Any] = {"color": "0.3", "linewidth": 0.8}  # of a line through zero
_MEGAHERTZ = Label("frequency", "MHz", 1e-6)


# --- a run ---


@sheet.register
def _(run: Waveforms) -> Sheet:
    panels: dict[str, tuple[Panel, tuple[str, ...]]] = {
        "speed": (partial(_speed_over_time, run), ("rotor_speed_rad_s",)),
        "path": (partial(_tip_path, run), ("tip_x_m", "tip_y_m", "contact_state")),
        "forces": (partial(_forces, run), ("normal_force_n", "friction_force_n")),
        "currents": (partial(_currents, run), ("current_a_a", "current_b_a")),
    }
    motor = run.provenance["motor"]
    title = f"{motor['name']}, {motor['contact']['preload_n']:g} N preload: {run.provenance['drive']['label']}"
    recorded = {name: panel for name, (panel, needs) in panels.items() if set(needs) <= set(run.recorded)}
    if not recorded:
        raise ParameterError("The run has no signals to plot. Record the rotor speed, tip, forces or currents.")
    return Sheet(recorded, min(2, len(recorded)), (5.0, 3.5), title)


@sheet.register
def _(result: SteadyState) -> Sheet:
    if result.waveforms is None:
        raise ParameterError("This steady state has no waveforms to plot.")
    return sheet(result.waveforms)


@sheet.register
def _(result: SmallSignals) -> Sheet:
    panels: dict[str, Panel] = {
        of: partial(_transfers, result, of) for of in INPUTS if any(name == of for _, name in result.transfers)
    }
    panels["admittance"] = partial(_hot_and_cold, result)
    return Sheet(panels, 2, (5.4, 3.6), f"{result.state.motor.name}: small signals, {result.state.drive.label}")


def _transfers(result: SmallSignals, of: str, ax: Axes) -> None:
    """Draw the magnitudes of the transfer functions from one input, each relative to its first value."""
    for number, output in enumerate(name for name in OUTPUTS if not name.startswith("motional")):
        values = np.abs(result.transfer(output, of))
        if values[0] > 0.0:
            name = f"{output}, {values[0]:.3g} {unit(output, of)}"
            look: dict[str, Any] = {"color": CYCLE[number % 4], "linestyle": _DASHES[number // 4], "marker": "."}
            ax.loglog(result.modulation_hz, values / values[0], label=name, **look)
    _dress(ax, "modulation frequency in Hz", "magnitude over that at the lowest", f"From {of}")
    ax.legend(fontsize="x-small")


def _hot_and_cold(result: SmallSignals, ax: Axes) -> None:
    """Draw the admittance that a small voltage sees of each group, of the running motor and of the free stator."""
    frequency, size = LABELS["frequency_hz"], LABELS["magnitude_s"]
    for place, (group, colour) in enumerate(GROUPS.items()):
        for matrix, dash, words in (
            (result.hot_admittance_s, "-", "running"),
            (result.cold_admittance_s, "--", "at rest, free"),
        ):
            values = size.scale * np.abs(matrix[:, place, place])
            ax.plot(frequency.scale * result.probe_hz, values, dash, color=colour, label=f"{group.upper()}, {words}")
    _dress(ax, frequency, size, "Admittance for a small voltage")
    ax.legend(fontsize="x-small")


def _speed_over_time(run: Waveforms, ax: Axes) -> None:
    time, speed = LABELS["time_ms"], LABELS["rotor_speed_rad_s"]
    ax.plot(time.scale * run.time_s, run.rotor_speed_rad_s, color=BLUE)
    _dress(ax, time, speed, "Rotor")


def _tip_path(run: Waveforms, ax: Axes) -> None:
    last = _last(run.time_s, run.drive_period_s)
    x, y = LABELS["tip_x_m"], LABELS["tip_y_m"]
    state_path(ax, x.scale * run.tip_x_m[last], y.scale * run.tip_y_m[last], run.contact_state[last])
    states = np.rint(run.contact_state[last]).astype(int)
    for state in sorted(set(states.tolist())):
        ax.plot([], [], color=STATES[state].colour, label=STATES[state].name)
    _dress(ax, x, y, f"Path of the tip, last {_PERIODS} drive periods")
    ax.legend()


def state_path(
    ax: Axes,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    state: NDArray[np.float64],
    **look: Any,
) -> None:
    """Draw a path in the colours of the contact's states; a step has the state that it ends with."""
    points = np.column_stack([x, y])
    colours = [STATES[number].colour for number in np.rint(state[1:]).astype(int)]
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    ax.add_collection(LineCollection(list(pieces), colors=colours, **{"linewidths": 2, "capstyle": "round", **look}))
    ax.autoscale_view()


def _forces(run: Waveforms, ax: Axes) -> None:
    last = _last(run.time_s, run.drive_period_s)
    time, force = LABELS["time_us"], LABELS["force_n"]
    microseconds = time.scale * (run.time_s[last] - run.time_s[last][0])
    ax.plot(microseconds, run.normal_force_n[last], color=BLUE, label="normal")
    ax.plot(microseconds, run.friction_force_n[last], color=VERMILION, linestyle="--", label="friction")
    _dress(ax, time, force, "Contact forces")
    ax.legend()


def _currents(run: Waveforms, ax: Axes) -> None:
    last = _last(run.time_s, run.drive_period_s)
    time, current = LABELS["time_us"], LABELS["current_a"]
    microseconds = time.scale * (run.time_s[last] - run.time_s[last][0])
    for (group, colour), dash in zip(GROUPS.items(), _DASHES, strict=False):
        values = getattr(run, f"current_{group}_a")[last]
        ax.plot(microseconds, current.scale * values, dash, color=colour, label=f"group {group.upper()}")
    _dress(ax, time, current, "Currents")
    ax.legend()


# --- spectra ---


class _Trace:
    """A curve of admittance over frequency, and how it looks in each of the three panels."""

    def __init__(self, frequency_hz: Any, admittance_s: Any, **look: Any) -> None:
        self.frequency_hz, self.y, self.look = np.asarray(frequency_hz), np.asarray(admittance_s), look


def _spectrum_panels(traces: list[_Trace]) -> dict[str, Panel]:
    """Return |Y|, phase and the circle of conductance and susceptance."""
    frequency = _frequency_label(traces[0].frequency_hz)
    magnitude, phase = LABELS["magnitude_s"], LABELS["phase_deg"]
    real, imaginary = LABELS["conductance_s"], LABELS["susceptance_s"]

    def draw_magnitude(ax: Axes) -> None:
        for trace in traces:
            ax.semilogy(frequency.scale * trace.frequency_hz, magnitude.scale * np.abs(trace.y), **trace.look)
        _dress(ax, frequency, magnitude, "Admittance")
        ax.legend(fontsize="small")

    def draw_phase(ax: Axes) -> None:
        for trace in traces:
            ax.plot(frequency.scale * trace.frequency_hz, np.degrees(np.angle(trace.y)), **trace.look)
        _dress(ax, frequency, phase, "Phase")

    def draw_circle(ax: Axes) -> None:
        for trace in traces:
            ax.plot(real.scale * trace.y.real, imaginary.scale * trace.y.imag, **trace.look)
        _dress(ax, real, imaginary, "G–B circle")
        ax.axis("equal")

    return {"magnitude": draw_magnitude, "phase": draw_phase, "circle": draw_circle}


@sheet.register
def _(result: Admittance) -> Sheet:
    looks = {"A+B": {"color": BLUE, "linestyle": "-"}, "A-B": {"color": VERMILION, "linestyle": "--"}}
    traces = [
        _Trace(result.frequency_hz, result.driven(connection), label=connection.replace("-", "−"), **looks[connection])  # type: ignore[arg-type]
        for connection in looks
    ]
    return Sheet(_spectrum_panels(traces), 3, (4.4, 4.2), f"{result.motor['name']}, {result.state}")


@sheet.register
def _(spectrum: Spectrum) -> Sheet:
    if spectrum.ports == 1:
        traces = [_Trace(spectrum.frequency_hz, spectrum.admittance_s, color=BLUE, label="measured")]
    else:
        traces = [
            _Trace(spectrum.frequency_hz, spectrum.driven(name).admittance_s, color=colour, linestyle=dash,
                   label=name.replace("-", "−"))
            for name, colour, dash in zip(COUPLING, CYCLE, _DASHES, strict=True)
        ]  # fmt: skip
    return Sheet(_spectrum_panels(traces), 3, (4.4, 4.2), spectrum.source)


@sheet.register
def _(fit: SpectrumFit) -> Sheet:
    fine = np.union1d(np.linspace(fit.frequency_hz[0], fit.frequency_hz[-1], 4001), fit.frequency_hz)
    arms = f"{len(fit.arms)} arm{'s' if len(fit.arms) > 1 else ''}"
    traces = [
        _Trace(fit.frequency_hz, fit.measured_s, **_DOTS, color=GREY, label="measured"),
        _Trace(fine, fit.admittance(fine), color=BLUE, linewidth=1.2, label=f"fitted, {arms}"),
    ]
    panels = _spectrum_panels(traces)
    marked = {name: _with_resonances(fit, panels[name]) for name in ("magnitude", "phase")}
    residuals = _with_resonances(fit, partial(_residuals, fit))
    return Sheet(
        {"magnitude": marked["magnitude"], "circle": panels["circle"], "phase": marked["phase"],
         "residuals": residuals},
        2, (5.5, 4.0), fit.source,
    )  # fmt: skip


def _with_resonances(fit: SpectrumFit, panel: Panel) -> Panel:
    """Return a panel with a dotted line at the series resonance of every arm in the band."""

    def drawn(ax: Axes) -> None:
        panel(ax)
        for arm in fit.arms:
            if arm.in_band:
                scale = _frequency_label(fit.frequency_hz).scale
                ax.axvline(scale * arm.series_resonance_hz, color=VERMILION, linewidth=0.8, linestyle=":")

    return drawn


def _residuals(fit: SpectrumFit, ax: Axes) -> None:
    frequency = _frequency_label(fit.frequency_hz)
    for values, colour, name in ((fit.residuals.real, BLUE, "in phase"), (fit.residuals.imag, ORANGE, "in quadrature")):
        ax.plot(frequency.scale * fit.frequency_hz, 100.0 * values, **_DOTS, color=colour, label=name)
    _dress(ax, frequency, Label("residual", "% of |Y|"), f"Residuals: {100.0 * fit.rms_relative_error:.3g} % RMS")
    ax.legend()


@sheet.register
def _(fit: TwoPortFit) -> Sheet:
    def couplings(ax: Axes) -> None:
        places = np.arange(len(fit.modes))
        for (group, colour), shift in zip(GROUPS.items(), (-0.2, 0.2), strict=True):
            values = [getattr(mode, f"coupling_{group}_n_per_v_kg05") for mode in fit.modes]
            errors = [mode.standard_errors[f"coupling_{group}_n_per_v_kg05"] for mode in fit.modes]
            ax.bar(places + shift, values, 0.4, yerr=errors, capsize=3, color=colour, label=f"group {group.upper()}")
        ax.set_xticks(places, [f"{1e-3 * mode.series_resonance_hz:.4g} kHz" for mode in fit.modes])
        ax.axhline(0.0, **_AXIS)
        ax.set(ylabel="coupling in N/(V·√kg)", title="Couplings of the modes")
        ax.grid(True, axis="y", alpha=0.3)
        ax.legend()

    return Sheet({"couplings": couplings}, 1, (7.0, 4.0), fit.source)


@sheet.register
def _(result: Comparison) -> Sheet:
    traces = [
        _Trace(result.reference.frequency_hz, result.reference.measured_s, color=BLUE, linewidth=1.2,
               label=plain(f"reference: {result.reference.source}")),
        _Trace(result.measured.frequency_hz, result.measured.measured_s, **_DOTS, color=VERMILION,
               label=plain(f"measured: {result.measured.source}")),
    ]  # fmt: skip
    panels = _spectrum_panels(traces)
    within = {name: _within_measured(result, panels[name]) for name in ("magnitude", "phase")}
    return Sheet(
        {"magnitude": within["magnitude"], "circle": panels["circle"], "phase": within["phase"],
         "deviations": partial(_deviations, result)},
        2, (5.5, 4.0), f"{100.0 * result.rms_deviation:.3g} % RMS between the admittances",
    )  # fmt: skip


def _within_measured(result: Comparison, panel: Panel) -> Panel:
    """Return a panel over the band of the measured spectrum only."""

    def drawn(ax: Axes) -> None:
        panel(ax)
        scale = _frequency_label(result.reference.frequency_hz).scale
        ax.set_xlim(scale * result.measured.frequency_hz[0], scale * result.measured.frequency_hz[-1])

    return drawn


def _deviations(result: Comparison, ax: Axes) -> None:
    known = {key: value for key, value in result.deviations().items() if np.isfinite(value)}
    names = [name.replace("_", " ") + (f", mode {mode}" if mode else "") for name, mode in known]
    bars = ax.barh(names, [100.0 * value for value in known.values()], color=BLUE)
    ax.bar_label(bars, [f"{100.0 * value:+.2f}" for value in known.values()], padding=3, fontsize=7)
    ax.invert_yaxis()
    ax.margins(x=0.2)
    ax.axvline(0.0, **_AXIS)
    ax.grid(True, alpha=0.3)
    ax.set(xlabel=str(LABELS["deviation"]), title="Measured less reference")


@sheet.register
def _(trend: Trend) -> Sheet:
    if len(trend.comparisons) == 1:
        return sheet(trend.comparisons[0])
    panels: dict[str, Panel] = {
        name: partial(_trend, trend, name, title)
        for name, title in (
            ("frequency", "Series resonance"),
            ("quality_factor", "Quality factor"),
            ("coupling_factor", "Coupling factor k_eff"),
            ("clamped_capacitance", "Clamped capacitance"),
        )
    }
    reference = trend.comparisons[0].reference.source
    return Sheet(panels, 2, (5.0, 3.5), f"{len(trend.comparisons)} spectra against {reference}")


def _trend(trend: Trend, name: str, title: str, ax: Axes) -> None:
    tables = [item.deviations() for item in trend.comparisons]
    for number, key in enumerate(key for key in tables[0] if key[0] == name):
        values = [100.0 * table[key] if np.isfinite(table[key]) else np.nan for table in tables]
        label = f"mode {key[1]}" if key[1] else None
        ax.plot(trend.at, values, color=CYCLE[number % 4], marker=_MARKS[number % 4], label=label)
    ax.axhline(0.0, **_AXIS)
    if np.ptp(ax.get_ylim()) < 0.01:  # only rounding errors
        ax.set_ylim(-0.1, 0.1)
    ax.grid(True, alpha=0.3)
    ax.set(xlabel=plain(trend.label), ylabel=str(LABELS["deviation"]), title=title)
    if name != "clamped_capacitance":
        ax.legend()


def _frequency_label(frequency_hz: NDArray[np.float64]) -> Label:
    return _MEGAHERTZ if frequency_hz[-1] >= 1e6 else LABELS["frequency_hz"]


# --- an impact ---


@sheet.register
def _(result: Impact) -> Sheet:
    time, force = LABELS["time_us"], LABELS["force_n"]
    microseconds = time.scale * result.time_s

    def forces(ax: Axes) -> None:
        ax.plot(microseconds, result.normal_force_n, color=BLUE, label="normal")
        ax.plot(microseconds, result.friction_force_n, color=VERMILION, linestyle="--", label="friction, on the sphere")
        _dress(ax, time, force, "Forces")
        ax.legend()

    def patch(ax: Axes) -> None:
        ax.plot(microseconds, result.patch_velocity_m_s, color=BLUE)
        _dress(ax, time, Label("velocity", "m/s"), "Tangential velocity of the contact patch")

    def slip(ax: Axes) -> None:
        ax.plot(microseconds, np.clip(result.contact_state - 1.0, 0.0, 1.0), color=VERMILION)
        _dress(ax, time, "part of the contact", "Slip")
        ax.set_ylim(-0.05, 1.05)

    law, poisson = result.provenance["contact"], result.provenance["throw"]["poisson"]
    title = f"{law}, ν = {poisson:g}: ψ = {result.psi_1:.4g} rebounds as {result.psi_2:.4g}"
    return Sheet({"forces": forces, "velocity": patch, "slip": slip}, 1, (8.0, 2.7), title)


# --- motors ---


@sheet.register
def _(motor: Motor) -> Sheet:
    if motor.structure is None:
        raise ParameterError(f"Motor {motor.name} is given by its modes, not by a beam; there are no shapes to draw.")
    return Sheet({"modes": partial(_mode_shapes, motor)}, 1, (7.0, 4.0))


def _mode_shapes(motor: Motor, ax: Axes) -> None:
    structure = motor.structure
    assert structure is not None
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip, count=len(motor.modes))
    x = np.linspace(0.0, structure.beam.length_m, 401)
    for index, (mode, shape) in enumerate(zip(motor.modes, resonator.deflection(x).T, strict=True)):
        label = f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz"
        ax.plot(1e3 * x, shape, _DASHES[index % 4], color=CYCLE[index % 4], label=label)
    for patch in structure.patches:
        ax.axvspan(1e3 * patch.start_m, 1e3 * patch.end_m, color=GREY, alpha=0.15)
        ax.text(0.5e3 * (patch.start_m + patch.end_m), -1.15, f"group {patch.group}", ha="center", color="0.3")
    ax.axvline(1e3 * structure.tip.position_m, color="0.3", linewidth=1, linestyle=":")
    title = f"{motor.name}: bending modes (dotted: tip)"
    _dress(ax, Label("position along the beam", "mm"), "deflection (largest = 1)", title)
    ax.set_ylim(-1.3, 1.3)
    ax.legend()


def draw_motors(motors: list[Motor], path: Any) -> Any:
    """Draw the mode frequencies of several motors, one below the other, and write the picture."""

    def frequencies(ax: Axes) -> None:
        for row, motor in enumerate(motors):
            ax.plot([mode.frequency_hz / 1e3 for mode in motor.modes], [row] * len(motor.modes), "o", color=BLUE)
        ax.set_yticks(range(len(motors)), [motor.name for motor in motors])
        _dress(ax, LABELS["frequency_hz"], "", "Modes of the parameter sets")
        ax.set_ylim(-0.7, len(motors) - 0.3)

    return draw(Sheet({"frequencies": frequencies}, 1, (7.0, 1.6 + 0.5 * len(motors))), path)


@sheet.register
def _(page: Sheet) -> Sheet:
    return page


# --- drivers ---


@sheet.register
def _(report: DriveReport) -> Sheet:
    panels: dict[str, Panel] = {
        "voltages": partial(_ports, report, "v", LABELS["voltage_v"], report.driver["label"]),
        "currents": partial(_ports, report, "a", LABELS["current_a"], ""),
        "spectrum": partial(_harmonics, report),
        "powers": partial(_powers, report),
    }
    return Sheet(panels, 1, (6.5, 3.0), report.motor)


def _ports(report: DriveReport, unit: str, label: Label, title: str, ax: Axes) -> None:
    """Draw what enters the groups (lines) and what leaves the power stage (dotted) over the last drive periods."""
    waves, time = report.waveforms, LABELS["time_us"]
    last = _last(waves["time_s"], 1.0 / report.driver["frequency"])
    microseconds = time.scale * (waves["time_s"][last] - waves["time_s"][last][0])
    for group, colour in GROUPS.items():
        for place, dash, name in (("group", "-", "pin"), ("output", ":", "stage")):
            values = label.scale * waves[f"{place}_{group}_{unit}"][last]
            ax.plot(microseconds, values, dash, color=colour, label=f"{name} {group.upper()}")
    _dress(ax, time, label, title)
    ax.legend(fontsize="small", ncols=2)


def _harmonics(report: DriveReport, ax: Axes) -> None:
    largest = max(report.groups[group].harmonics[0].current_a for group in GROUPS)
    for (group, colour), shift in zip(GROUPS.items(), (-0.2, 0.2), strict=True):
        harmonics = report.groups[group].harmonics
        orders = np.array([item.order for item in harmonics]) + shift
        ax.bar(
            orders, [max(item.current_a, 1e-9) for item in harmonics], 0.4, color=colour, label=f"pin {group.upper()}"
        )
    ax.set(xlabel="harmonic", ylabel="current in A", yscale="log", ylim=(1e-5 * largest, 3.0 * largest))
    ax.set_xticks(range(1, 21, 2))
    ax.grid(True, alpha=0.3)
    ax.legend(fontsize="small")


def _powers(report: DriveReport, ax: Axes) -> None:
    shares = {"motor": report.motor_power_w}
    for device, loss in report.losses_w.items():
        part = device.partition("_")[0]
        shares[part] = shares.get(part, 0.0) + loss
    ax.barh(list(shares), list(shares.values()), color=[GREEN, *[VERMILION] * (len(shares) - 1)])
    ax.invert_yaxis()
    ax.grid(True, alpha=0.3)
    ax.set(
        xlabel="power in W",
        title=f"supply {report.power_in_w:.3g} W, power factor {report.power_factor:.3f}, "
        f"{100 * report.driver_efficiency:.1f} % reach the motor",
    )


# --- trackers ---


@sheet.register
def _(result: Tracking) -> Sheet:
    curves: dict[str, tuple[NDArray[np.float64], Label]] = {
        "frequency": (result.frequency_hz, LABELS["frequency_hz"]),
        "phase": (result.phase_deg, Label("phase of the mode", "degrees")),
        "speed": (result.rotor_speed_rad_s, LABELS["rotor_speed_rad_s"]),
    }
    panels: dict[str, Panel] = {name: partial(_over_time, result, *curve) for name, curve in curves.items()}
    title = f"{result.settings['motor']}: {result.settings['disturbance']['kind']}"
    return Sheet(panels, 1, (8.0, 2.7), title)


def _over_time(result: Tracking, values: NDArray[np.float64], label: Label, ax: Axes) -> None:
    time = LABELS["time_ms"]
    ax.plot(time.scale * result.time_s, label.scale * values, linewidth=1.0, label=result.settings["tracker"]["kind"])
    begin = result.settings["disturbance"]["begin_s"]
    if begin is not None:
        ax.axvline(time.scale * begin, color=GREY, linestyle=":", linewidth=1.0)
    _dress(ax, time, label, "")
    if label.unit == "degrees":
        ax.set_ylim(-95.0, 95.0)


# --- averaged and controlled runs ---


@sheet.register
def _(run: AveragedRun) -> Sheet:
    curves: dict[str, tuple[NDArray[np.float64], Label]] = {
        "speed": (run.rotor_speed_rad_s, LABELS["rotor_speed_rad_s"]),
        "torque": (run.torque_n_m, LABELS["torque_n_m"]),
        "power": (run.electrical_power_w, LABELS["electrical_power_w"]),
        "frequency": (run.frequency_hz, LABELS["frequency_hz"]),
        "temperature": (run.temperature_k, Label("temperature rise", "K")),
        "check": (run.check, Label("check (accurate below 2 %)", "%", 100.0)),
    }
    panels: dict[str, Panel] = {
        name: partial(_over_seconds, run.time_s, values, label) for name, (values, label) in curves.items()
    }
    title = f"{run.provenance['motor']['name']}, averaged: {run.provenance['drive']['label']}"
    return Sheet(panels, 2, (5.0, 2.5), title)


@sheet.register
def _(run: ControlledRun) -> Sheet:
    curves = {
        "speed": (run.speed_rad_s, LABELS["rotor_speed_rad_s"]),
        "position": (run.position_rad, Label("rotor position", "rad")),
        "voltage": (run.voltage_a_v, Label("amplitude of group A", "V")),
        "current": (run.current_amplitude_a, Label("current amplitude", "mA", 1e3)),
        "current phase": (run.current_phase_deg, Label("current phase", "degrees")),
        "frequency": (run.frequency_hz, LABELS["frequency_hz"]),
    }
    panels: dict[str, Panel] = {
        name: partial(_over_seconds, run.time_s, values, label, marker=".") for name, (values, label) in curves.items()
    }
    kind = "averaged motor" if run.provenance["run"]["averaged"] else "full motor"
    title = (
        f"{run.provenance['motor']['name']}, {kind}, a sample every {1e3 * run.provenance['run']['sample_time_s']:g} ms"
    )
    return Sheet(panels, 2, (5.0, 2.5), title)


def _over_seconds(
    time_s: NDArray[np.float64], values: NDArray[np.float64], label: Label, ax: Axes, **look: Any
) -> None:
    ax.plot(time_s, label.scale * values, color=BLUE, **look)
    ax.ticklabel_format(axis="y", useOffset=False)
    _dress(ax, "time in s", label, "")


# --- curves and sweeps ---


@sheet.register
def _(curves: Curves) -> Sheet:
    data = curves.dataset
    electrical = data["power_a_w"] + data["power_b_w"]
    panels: dict[str, Panel] = {
        "torque": partial(_over_speed, curves, [data["torque_n_m"]], LABELS["torque_n_m"], "Torque"),
        "efficiency": partial(
            _over_speed, curves, [data["efficiency"]], LABELS["efficiency"],
            "Efficiency: shaft power over electrical power",
        ),
        "power": partial(
            _over_speed, curves, [electrical], LABELS["electrical_power_w"], "Electrical power of both groups"
        ),
        "current": partial(
            _over_speed, curves, [data["current_a_rms_a"], data["current_b_rms_a"]], LABELS["current_rms_a"],
            "Currents of group A and (dashed) group B",
        ),
    }  # fmt: skip
    return Sheet(panels, 2, (5.0, 3.6), data.attrs["title"])


def _over_speed(curves: Curves, quantities: list[Any], label: Label, title: str, ax: Axes) -> None:
    """Draw quantities over speed, one curve for each value of the other axes; a ring marks a point not settled."""
    data = curves.dataset
    speed, others = data["speed_rad_s"].values, curves.others
    rings = False
    for number, index in enumerate(np.ndindex(*(data.sizes[name] for name in others))):
        at = dict(zip(others, index, strict=True))
        one = data.isel(at)
        name = ", ".join(f"{other} = {one[other].item():g}" for other in others)
        doubtful = ~one["settled"].values
        for quantity, dash in zip(quantities, _DASHES, strict=False):
            values = label.scale * quantity.isel(at).values
            look: dict[str, Any] = {"color": CYCLE[number % 4], "label": name if dash == "-" and name else None}
            ax.plot(speed, values, dash, marker=".", **look)
            if (doubtful & np.isfinite(values)).any():
                rings = True
                ax.plot(speed[doubtful], values[doubtful], "o", mfc="none", mec="black")
    _dress(ax, LABELS["speed_rad_s"], label, title)
    ax.axvline(0.0, **_AXIS)
    ax.axhline(0.0, **_AXIS)
    if rings:
        ax.plot([], [], "o", mfc="none", mec="black", label="not settled")
    if others or rings:
        ax.legend(fontsize="small")
    if label is LABELS["efficiency"]:
        _limit_efficiency(ax)


def _limit_efficiency(ax: Axes) -> None:
    """Show −100 to 100 % at most: where hardly any power is drawn, the quotient has no limit."""
    low, high = ax.get_ylim()
    if low < -100.0 or high > 100.0:
        ax.set_ylim(max(low, -100.0), min(high, 100.0))
        note = "values beyond ±100 % not shown"
        ax.text(0.99, 0.02, note, transform=ax.transAxes, ha="right", fontsize="small")


@sheet.register
def _(result: Branch) -> Sheet:
    labels = {
        "torque": ("torque_n_m", LABELS["torque_n_m"]),
        "force": ("normal_force_n", LABELS["force_n"]),
        "speed": ("speed_rad_s", LABELS["speed_rad_s"]),
        "current": ("current_a_rms_a", LABELS["current_rms_a"]),
    }
    panels: dict[str, Panel] = {
        name: partial(_followed, result, quantity, label)
        for name, (quantity, label) in labels.items()
        if float(result.dataset[quantity].std()) > 0.0
    }
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
    _dress(ax, f"{result.along} in {data[result.along].attrs['units']}", label, "")
    ax.legend(fontsize="small")


@sheet.register
def _(result: WorkingPoints) -> Sheet:
    labels = {
        "torque": ("torque_n_m", LABELS["torque_n_m"]),
        "speed": ("speed_rad_s", LABELS["speed_rad_s"]),
        "efficiency": ("efficiency", LABELS["efficiency"]),
        "power": ("shaft_power_w", LABELS["shaft_power_w"]),
        "current": ("current_a", LABELS["current_rms_a"]),
        "temperature": ("temperature_c", Label("temperature", "°C")),
    }
    panels: dict[str, Panel] = {}
    for name, (quantity, label) in labels.items():
        if quantity in result.dataset and float(result.dataset[quantity].std()) > 0.0:
            draw_panel = _contours if len(result.axes) == 2 else _mapped
            panels[name] = partial(draw_panel, result, quantity, label)
    if len(result.axes) > 2 or not panels:
        raise ParameterError("A map is drawn over one or two axes. Choose values of the others, by dataset.isel.")
    return Sheet(panels, 2, (5.4, 4.0), result.dataset.attrs["title"])


def _contours(result: WorkingPoints, quantity: str, label: Label, ax: Axes) -> None:
    """Draw contours over two axes; marks show points that are unstable or not converged, and the best one.

    The region outside the limits is hatched.
    """
    data = result.dataset
    across, along = result.axes
    x, y = data[along].values, data[across].values
    values = np.ma.masked_invalid(label.scale * data[quantity].transpose(across, along).values)
    if min(values.shape) > 1 and values.count() > 3:
        filled = ax.contourf(x, y, values, levels=12, cmap="viridis")
        ax.get_figure().colorbar(filled, ax=ax)  # type: ignore[union-attr]
    converged = data["converged"].transpose(across, along).values
    unstable = converged & ~data["stable"].transpose(across, along).values
    outside = np.zeros_like(converged)
    for name, limit in result.limits.items():
        outside |= np.abs(data[name].transpose(across, along).values) > limit
    for marked, hatch, words in ((outside, "//", "outside the limits"), (unstable, "xx", "")):
        if min(values.shape) > 1 and marked.any():
            ax.contourf(x, y, marked, levels=[0.5, 1.5], colors="none", hatches=[hatch])
            if words:
                ax.fill_between([], [], fc="none", ec="black", hatch=hatch, lw=0.0, label=words)
    for marked, mark, words in ((unstable, "x", "not stable"), (~converged, "s", "not converged")):
        rows, columns = np.nonzero(marked)
        if rows.size:
            ax.plot(x[columns], y[rows], mark, color=VERMILION, mfc="none", ms=5, ls="", label=words)
    if result.best:
        ax.plot(result.best[along], result.best[across], "*", color="white", mec="black", ms=12, ls="", label="best")
    ax.set(xlabel=f"{along} in {data[along].attrs['units']}", ylabel=f"{across} in {data[across].attrs['units']}")
    ax.set_title(str(label))
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
    _dress(ax, f"{along} in {data[along].attrs['units']}", label, "")
    if result.best or unstable.any():
        ax.legend(fontsize="small")


@sheet.register
def _(result: Sweep) -> Sheet:
    data = result.dataset
    shown = [name for name in result.quantities if name not in DOUBTS] or result.quantities
    panels: dict[str, Panel] = {name: partial(_swept, data[name], result.doubtful) for name in shown}
    return Sheet(panels, 1, (8.0, 3.4), data.attrs.get("parameter_set", ""))


def _swept(values: Any, doubtful: dict[str, Any], ax: Axes) -> None:
    """Draw a quantity of a sweep over the first dimension, or if there are only samples, how it is distributed.

    A ring marks a point that is not settled, a square one that is not accurate.
    """
    label = f"{values.name} in {values.attrs['units']}" if values.attrs["units"] != "1" else str(values.name)
    ax.grid(True, alpha=0.3)
    if "sample" in values.dims[:1]:
        drawn = np.sort(values.values[np.isfinite(values.values)])
        ax.step(drawn, np.arange(1, drawn.size + 1) / max(drawn.size, 1), color=BLUE, where="post")
        ax.set(xlabel=label, ylabel="fraction of the samples at or below", ylim=(0.0, 1.0))
        if drawn.size:
            ax.axvspan(*np.quantile(drawn, [0.05, 0.95]), color=GREY, alpha=0.2, label="5 to 95 %")
            ax.legend()
        return
    along, *others = (str(dimension) for dimension in values.dims if dimension != "sample")
    x = values[along].values
    marked: set[str] = set()
    for number, index in enumerate(np.ndindex(*(values.sizes[name] for name in others))):
        curve = values.isel(dict(zip(others, index, strict=True)))
        colour = CYCLE[number % 4]
        name = ", ".join(f"{other} {curve[other].item():g}" for other in others)
        if "sample" in curve.dims:
            cloud = curve.transpose(along, "sample").values
            low, median, high = np.transpose([_quantiles(samples[np.isfinite(samples)]) for samples in cloud])
            ax.plot(x, cloud, color=colour, alpha=0.25, linewidth=0.6)
            ax.fill_between(x, low, high, color=colour, alpha=0.2)
            ax.plot(x, median, color=colour, label=f"{name} median, 5 to 95 %".strip())
        else:
            ax.plot(x, curve.values, ".-", color=colour, label=name or None)
            for mark, (words, points) in zip("os", doubtful.items(), strict=False):
                at = points.isel(dict(zip(others, index, strict=True))).values
                if at.any():
                    first = None if words in marked else words
                    ax.plot(x[at], curve.values[at], mark, mfc="none", mec="black", ms=5 + 3 * len(marked), label=first)
                    marked.add(words)
    ax.set(xlabel=f"{along} in {values[along].attrs['units']}", ylabel=label)
    if "sample" in values.dims or others or marked:
        ax.legend(fontsize=7)


def _quantiles(samples: NDArray[np.float64]) -> Any:
    return np.quantile(samples, [0.05, 0.5, 0.95]) if samples.size else [np.nan] * 3


@sheet.register
def _(report: Report) -> Sheet:
    """Draw torque and efficiency at full voltage, the admittance of the free tip, and the speed of the run."""
    curve = sheet(Curves(report.curves[max(report.curves)]))
    spectrum, run = sheet(report.spectra["free"]), sheet(report.run)
    panels = {
        "torque": curve.panels["torque"],
        "efficiency": curve.panels["efficiency"],
        "magnitude": spectrum.panels["magnitude"],
        "speed": run.panels["speed"],
    }
    return Sheet(panels, 2, (5.0, 3.5), f"{report.motor.name}: {report.drive.label}")


# --- what the panels share ---


def _dress(ax: Axes, x: Label | str, y: Label | str, title: str) -> None:
    ax.set(xlabel=str(x), ylabel=str(y))
    if title:
        ax.set_title(title)
    ax.grid(True, alpha=0.3)


def _last(time_s: NDArray[np.float64], period_s: float) -> NDArray[np.bool_]:
    """Return which points lie in the last drive periods."""
    return np.asarray(time_s >= time_s[-1] - _PERIODS * period_s)
