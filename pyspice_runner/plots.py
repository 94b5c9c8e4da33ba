# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of results. matplotlib loads here and nowhere else; files are written without a display."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending

if TYPE_CHECKING:
    import xarray

    from pyspice_runner.analysis.admittance import Admittance
    from pyspice_runner.analysis.compare import Comparison, Trend
    from pyspice_runner.analysis.drive import DriveReport
    from pyspice_runner.analysis.fit import SpectrumFit
    from pyspice_runner.analysis.impact import Impact
    from pyspice_runner.analysis.track import Tracking
    from pyspice_runner.analysis.waveforms import Waveforms
    from pyspice_runner.model.motor import Motor

# Okabe and Ito's palette, told apart by colour-blind readers
BLUE, ORANGE, GREEN, VERMILION, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#7F7F7F"
STATE_COLOURS = {0: GREY, 1: BLUE, 2: VERMILION}
STATE_NAMES = {0: "separated", 1: "stick", 2: "slip"}


def plot_waveforms(run: Waveforms, path: str | Path) -> Path:
    """Draw a run: rotor speed, and over its last drive periods the tip's path, the forces and the currents."""
    figure, axes = _figure(2, 2)
    speed, trajectory, forces, electrical = axes.flat
    milliseconds = 1e3 * run.time_s
    speed.plot(milliseconds, run.rotor_speed_rad_s, color=BLUE)
    speed.set(xlabel="time in ms", ylabel="rotor speed in rad/s", title="Rotor")

    last = run.time_s >= run.time_s[-1] - 3.0 * run.drive_period_s
    microseconds = 1e6 * (run.time_s[last] - run.time_s[last][0])
    points = np.column_stack([1e6 * run.tip_x_m[last], 1e6 * run.tip_y_m[last]])
    states = np.rint(run.contact_state[last]).astype(int)
    segments = np.stack([points[:-1], points[1:]], axis=1)
    colours = [STATE_COLOURS[state] for state in states[1:]]
    trajectory.add_collection(LineCollection(list(segments), colors=colours, linewidths=2))
    trajectory.autoscale()
    for state in sorted(set(states)):
        trajectory.plot([], [], color=STATE_COLOURS[state], label=STATE_NAMES[state])
    trajectory.set(xlabel="tip x in µm", ylabel="tip y in µm", title="Path of the tip, last 3 drive periods")
    trajectory.legend()

    forces.plot(microseconds, run.normal_force_n[last], color=BLUE, label="normal")
    forces.plot(microseconds, run.friction_force_n[last], color=VERMILION, linestyle="--", label="friction")
    forces.set(xlabel="time in µs", ylabel="force in N", title="Contact forces")
    forces.legend()

    electrical.plot(microseconds, 1e3 * run.current_a_a[last], color=BLUE, label="group A")
    electrical.plot(microseconds, 1e3 * run.current_b_a[last], color=ORANGE, linestyle="--", label="group B")
    electrical.set(xlabel="time in µs", ylabel="current in mA", title="Currents")
    electrical.legend()
    motor = run.provenance["motor"]
    made_by = f"{motor['name']}, {motor['contact']['preload_n']:g} N preload"
    figure.suptitle(f"{made_by}: {run.provenance['drive']['label']}", fontsize=10)
    return _save(figure, path)


def plot_admittance(result: Admittance, path: str | Path) -> Path:
    """Draw |Y|, phase and the G–B circle for A+B and A−B."""
    figure, axes = _figure(1, 3, width=13.0, height=4.2)
    magnitude, phase, circle = axes.flat
    kilohertz = 1e-3 * result.frequency_hz
    for connection, colour, style in (("A+B", BLUE, "-"), ("A-B", VERMILION, "--")):
        y = result.driven(connection)  # type: ignore[arg-type]
        magnitude.semilogy(kilohertz, 1e3 * np.abs(y), style, color=colour, label=connection)
        phase.plot(kilohertz, np.degrees(np.angle(y)), style, color=colour)
        circle.plot(1e3 * y.real, 1e3 * y.imag, style, color=colour)
    magnitude.set(xlabel="frequency in kHz", ylabel="|Y| in mS", title="Admittance")
    phase.set(xlabel="frequency in kHz", ylabel="phase in degrees", title="Phase")
    circle.set(xlabel="conductance G in mS", ylabel="susceptance B in mS", title="G–B circle")
    magnitude.legend()
    figure.suptitle(f"{result.motor['name']}, {result.state}", fontsize=10)
    return _save(figure, path)


def plot_fit(fit: SpectrumFit, path: str | Path) -> Path:
    """Draw measured and fitted |Y| and phase, the G–B circle, and the residuals."""
    figure, axes = _figure(2, 2, width=11.0, height=8.0)
    magnitude, circle, phase, residuals = axes.flat
    scale, prefix = _unit_of_frequency(fit.frequency_hz)
    frequency, fine = scale * fit.frequency_hz, np.linspace(fit.frequency_hz[0], fit.frequency_hz[-1], 4001)
    fine = np.union1d(fine, fit.frequency_hz)
    fitted = fit.admittance(fine)
    dots = {"marker": ".", "markersize": 3, "linestyle": "", "color": GREY, "label": "measured"}
    line = {"color": BLUE, "linewidth": 1.2, "label": f"fitted, {len(fit.arms)} arm{'s' if len(fit.arms) > 1 else ''}"}
    magnitude.semilogy(frequency, 1e3 * np.abs(fit.measured_s), **dots)
    magnitude.semilogy(scale * fine, 1e3 * np.abs(fitted), **line)
    phase.plot(frequency, np.degrees(np.angle(fit.measured_s)), **dots)
    phase.plot(scale * fine, np.degrees(np.angle(fitted)), **line)
    circle.plot(1e3 * fit.measured_s.real, 1e3 * fit.measured_s.imag, **dots)
    circle.plot(1e3 * fitted.real, 1e3 * fitted.imag, **line)
    residuals.plot(frequency, 100.0 * fit.residuals.real, ".", markersize=3, color=BLUE, label="in phase")
    residuals.plot(frequency, 100.0 * fit.residuals.imag, ".", markersize=3, color=ORANGE, label="in quadrature")
    for arm in fit.arms:
        for axis in (magnitude, phase, residuals):
            if arm.in_band:
                axis.axvline(scale * arm.series_resonance_hz, color=VERMILION, linewidth=0.8, linestyle=":")
    for axis in (magnitude, phase, residuals):
        axis.set(xlabel=f"frequency in {prefix}Hz")
    magnitude.set(ylabel="|Y| in mS", title="Admittance (dotted: series resonances of the arms)")
    phase.set(ylabel="phase in degrees", title="Phase")
    circle.set(xlabel="conductance G in mS", ylabel="susceptance B in mS", title="G–B circle")
    circle.axis("equal")
    error = 100.0 * fit.rms_relative_error
    residuals.set(ylabel="residual in % of |Y|", title=f"Residuals: {error:.3g} % RMS")
    magnitude.legend()
    residuals.legend()
    figure.suptitle(_plain(fit.source), fontsize=10)
    return _save(figure, path)


def plot_comparison(result: Comparison, path: str | Path) -> Path:
    """Draw a spectrum over its reference: |Y|, phase, G–B circle, and the deviations of every mode."""
    figure, axes = _figure(2, 2, width=11.0, height=8.0)
    magnitude, circle, phase, deviations = axes.flat
    curves = (
        (result.reference, {"color": BLUE, "linewidth": 1.2, "label": _plain(f"reference: {result.reference.source}")}),
        (result.measured, {"marker": ".", "markersize": 3, "linestyle": "", "color": VERMILION,
                           "label": _plain(f"measured: {result.measured.source}")}),
    )  # fmt: skip
    scale, prefix = _unit_of_frequency(result.measured.frequency_hz)
    for fit, look in curves:
        y = fit.measured_s
        magnitude.semilogy(scale * fit.frequency_hz, 1e3 * np.abs(y), **look)
        phase.plot(scale * fit.frequency_hz, np.degrees(np.angle(y)), **look)
        circle.plot(1e3 * y.real, 1e3 * y.imag, **look)
    for axis in (magnitude, phase):
        axis.set(xlabel=f"frequency in {prefix}Hz")
        axis.set_xlim(scale * result.measured.frequency_hz[0], scale * result.measured.frequency_hz[-1])
    magnitude.set(ylabel="|Y| in mS", title=f"Admittance: {100.0 * result.rms_deviation:.3g} % RMS apart")
    phase.set(ylabel="phase in degrees", title="Phase")
    circle.set(xlabel="conductance G in mS", ylabel="susceptance B in mS", title="G–B circle")
    circle.axis("equal")
    magnitude.legend(fontsize=7)
    known = {key: value for key, value in result.deviations().items() if np.isfinite(value)}
    names = [name.replace("_", " ") + (f", mode {mode}" if mode else "") for name, mode in known]
    bars = deviations.barh(names, [100.0 * value for value in known.values()], color=BLUE)
    deviations.bar_label(bars, [f"{100.0 * value:+.2f}" for value in known.values()], padding=3, fontsize=7)
    deviations.invert_yaxis()
    deviations.margins(x=0.2)
    deviations.axvline(0.0, color="0.3", linewidth=0.8)
    deviations.set(xlabel="deviation in %", title="Measured less reference")
    return _save(figure, path)


def plot_trend(trend: Trend, path: str | Path) -> Path:
    """Draw the deviations of many spectra from one reference over what they were measured at."""
    figure, axes = _figure(2, 2, width=10.0, height=7.0)
    colours, marks = (BLUE, VERMILION, GREEN, ORANGE, GREY), ("o", "s", "^", "D", "v")
    tables = [item.deviations() for item in trend.comparisons]
    panels = (
        ("frequency", "Series resonance"),
        ("quality_factor", "Quality factor"),
        ("coupling_factor", "Coupling factor k_eff"),
        ("clamped_capacitance", "Clamped capacitance"),
    )
    for axis, (name, title) in zip(axes.flat, panels, strict=True):
        for number, key in enumerate(key for key in tables[0] if key[0] == name):
            values = [100.0 * table[key] if np.isfinite(table[key]) else np.nan for table in tables]
            look = {"color": colours[number % 5], "marker": marks[number % 5]}
            axis.plot(trend.at, values, **look, label=f"mode {key[1]}" if key[1] else None)
        axis.axhline(0.0, color="0.3", linewidth=0.8)
        if np.ptp(axis.get_ylim()) < 0.01:  # nothing but rounding errors
            axis.set_ylim(-0.1, 0.1)
        axis.set(xlabel=_plain(trend.label), ylabel="deviation in %", title=title)
    axes.flat[0].legend()
    figure.suptitle(_plain(f"{len(tables)} spectra against {trend.comparisons[0].reference.source}"), fontsize=10)
    return _save(figure, path)


def _unit_of_frequency(frequency_hz: Any) -> tuple[float, str]:
    return (1e-6, "M") if frequency_hz[-1] >= 1e6 else (1e-3, "k")


def plot_impact(result: Impact, path: str | Path) -> Path:
    """Draw an impact over time: forces, velocity of the patch, and the part of the contact that slips."""
    figure, axes = _figure(3, 1, width=8.0, height=8.0)
    forces, patch, state = axes.flat
    time = 1e6 * result.time_s
    forces.plot(time, result.normal_force_n, color=BLUE, label="normal")
    forces.plot(time, result.friction_force_n, color=VERMILION, linestyle="--", label="friction, on the sphere")
    forces.set(ylabel="force in N", title="Forces")
    forces.legend()
    patch.plot(time, result.patch_velocity_m_s, color=BLUE)
    patch.set(ylabel="velocity in m/s", title="Tangential velocity of the contact patch")
    state.plot(time, np.clip(result.contact_state - 1.0, 0.0, 1.0), color=VERMILION)
    state.set(xlabel="time in µs", ylabel="part of the contact", ylim=(-0.05, 1.05), title="Slip")
    law, poisson = result.provenance["contact"], result.provenance["throw"]["poisson"]
    figure.suptitle(f"{law}, ν = {poisson:g}: ψ = {result.psi_1:.4g} rebounds as {result.psi_2:.4g}", fontsize=10)
    return _save(figure, path)


def plot_mode_shapes(motor: Motor, path: str | Path) -> Path:
    """Draw the mode shapes on the beam, with patches and tip.

    Raises:
        ParameterError: for a motor that was not given by its beam.
    """
    if motor.structure is None:
        raise ParameterError(f"Motor {motor.name} is given by its modes, not by a beam; there are no shapes to draw.")
    from pyspice_runner.model.beam import solve_resonator

    structure = motor.structure
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip, count=len(motor.modes))
    x = np.linspace(0.0, structure.beam.length_m, 401)
    figure, axes = _figure(1, 1, width=7.0, height=4.0)
    (axis,) = axes.flat
    colours, styles = (BLUE, VERMILION, GREEN, ORANGE), ("-", "--", "-.", ":")
    for index, (mode, shape) in enumerate(zip(motor.modes, resonator.deflection(x).T, strict=True)):
        label = f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz"
        axis.plot(1e3 * x, shape, styles[index % 4], color=colours[index % 4], label=label)
    for patch in structure.patches:
        axis.axvspan(1e3 * patch.start_m, 1e3 * patch.end_m, color=GREY, alpha=0.15)
        axis.text(0.5e3 * (patch.start_m + patch.end_m), -1.15, f"group {patch.group}", ha="center", color="0.3")
    axis.axvline(1e3 * structure.tip.position_m, color="0.3", linewidth=1, linestyle=":")
    axis.set(xlabel="position along the beam in mm", ylabel="deflection (largest = 1)", ylim=(-1.3, 1.3))
    axis.set_title(f"{motor.name}: bending modes (dotted: tip)")
    axis.legend()
    return _save(figure, path)


def plot_motors(motors: Sequence[Motor], path: str | Path) -> Path:
    """Draw the mode frequencies of several motors side by side."""
    figure, axes = _figure(1, 1, width=7.0, height=1.6 + 0.5 * len(motors))
    (axis,) = axes.flat
    for row, motor in enumerate(motors):
        axis.plot([mode.frequency_hz / 1e3 for mode in motor.modes], [row] * len(motor.modes), "o", color=BLUE)
    axis.set_yticks(range(len(motors)), [motor.name for motor in motors])
    axis.set(xlabel="frequency in kHz", title="Modes of the parameter sets", ylim=(-0.7, len(motors) - 0.3))
    return _save(figure, path)


def plot_sweep(dataset: xarray.Dataset, path: str | Path) -> Path:
    """Draw each quantity of a sweep: over the first dimension, or if there are only samples, how it is distributed."""
    names = [name for name in dataset.data_vars if name not in ("failure", "deck_sha256")]
    figure, axes = _figure(len(names), 1, width=8.0, height=0.6 + 3.2 * len(names))
    for axis, name in zip(axes.flat, names, strict=True):
        label = f"{name} in {dataset[name].attrs['units']}"
        if "sample" in dataset[name].dims[:1]:
            values = np.sort(dataset[name].values[np.isfinite(dataset[name].values)])
            axis.step(values, np.arange(1, values.size + 1) / max(values.size, 1), color=BLUE, where="post")
            axis.set(xlabel=label, ylabel="fraction of the samples at or below", ylim=(0.0, 1.0))
            if values.size:
                axis.axvspan(*np.quantile(values, [0.05, 0.95]), color=GREY, alpha=0.2, label="5 to 95 %")
                axis.legend()
        else:
            _plot_curves(axis, dataset[name])
            axis.set(ylabel=label)
    figure.suptitle(dataset.attrs["parameter_set"], fontsize=10)
    return _save(figure, path)


def _plot_curves(axis: Any, values: xarray.DataArray) -> None:
    """Draw a curve over the first dimension for each value of the others, with the 5 to 95 % band of samples."""
    along, *others = (str(dimension) for dimension in values.dims if dimension != "sample")
    x = values[along].values
    for number, index in enumerate(np.ndindex(*(values.sizes[name] for name in others))):
        curve = values.isel(dict(zip(others, index, strict=True)))
        colour = (BLUE, VERMILION, GREEN, ORANGE)[number % 4]
        label = ", ".join(f"{name} {curve[name].item():g}" for name in others)
        if "sample" in curve.dims:
            cloud = curve.transpose(along, "sample").values
            low, median, high = np.transpose([_quantiles(samples[np.isfinite(samples)]) for samples in cloud])
            axis.plot(x, cloud, color=colour, alpha=0.25, linewidth=0.6)
            axis.fill_between(x, low, high, color=colour, alpha=0.2)
            axis.plot(x, median, color=colour, label=f"{label} median, 5 to 95 %".strip())
        else:
            axis.plot(x, curve.values, ".-", color=colour, label=label or None)
    axis.set(xlabel=f"{along} in {values[along].attrs['units']}")
    if "sample" in values.dims or others:
        axis.legend(fontsize=7)


def _quantiles(samples: np.ndarray[Any, Any]) -> Any:
    return np.quantile(samples, [0.05, 0.5, 0.95]) if samples.size else [np.nan] * 3


def plot_drive(reports: Sequence[DriveReport], path: str | Path) -> Path:
    """Draw drivers side by side: voltages, currents and spectra at the pins, and where the power goes."""
    figure, axes = _figure(4, len(reports), width=max(7.0, 6.0 * len(reports)), height=12.0)
    for report, (voltages, currents, spectrum, powers) in zip(reports, axes.T, strict=True):
        waves = report.waveforms
        last = waves["time_s"] >= waves["time_s"][-1] - 3.0 / report.driver["frequency"]
        microseconds = 1e6 * (waves["time_s"][last] - waves["time_s"][last][0])
        for group, colour, shift in (("a", BLUE, -0.2), ("b", ORANGE, 0.2)):
            name = group.upper()
            voltages.plot(microseconds, waves[f"group_{group}_v"][last], color=colour, label=f"pin {name}")
            voltages.plot(
                microseconds, waves[f"output_{group}_v"][last], color=colour, linestyle=":", label=f"stage {name}"
            )
            currents.plot(microseconds, 1e3 * waves[f"group_{group}_a"][last], color=colour, label=f"pin {name}")
            currents.plot(microseconds, 1e3 * waves[f"output_{group}_a"][last], color=colour, linestyle=":")
            harmonics = report.groups[group].harmonics
            orders = np.array([item.order for item in harmonics]) + shift
            spectrum.bar(
                orders, [max(item.current_a, 1e-9) for item in harmonics], 0.4, color=colour, label=f"pin {name}"
            )
        voltages.set(xlabel="time in µs", ylabel="voltage in V", title=report.driver["label"])
        voltages.legend(fontsize=7, ncols=2)
        currents.set(xlabel="time in µs", ylabel="current in mA")
        largest = max(report.groups[group].harmonics[0].current_a for group in ("a", "b"))
        spectrum.set(xlabel="harmonic", ylabel="current in A", yscale="log", ylim=(1e-5 * largest, 3.0 * largest))
        spectrum.set_xticks(range(1, 21, 2))
        spectrum.legend(fontsize=7)
        shares = {"motor": report.motor_power_w}
        for device, loss in report.losses_w.items():
            part = device.partition("_")[0]
            shares[part] = shares.get(part, 0.0) + loss
        powers.barh(list(shares), list(shares.values()), color=[GREEN, *[VERMILION] * (len(shares) - 1)])
        powers.invert_yaxis()
        powers.set(
            xlabel="power in W",
            title=f"supply {report.power_in_w:.3g} W, power factor {report.power_factor:.3f}, "
            f"{100 * report.driver_efficiency:.1f} % reach the motor",
        )
    figure.suptitle(f"{reports[0].motor}", fontsize=10)
    return _save(figure, path)


def plot_speed_torque(curve: xarray.Dataset, path: str | Path) -> Path:
    """Draw speed–torque curves: torque, efficiency, electrical power and currents; a ring is a point not settled."""
    figure, axes = _figure(2, 2)
    torque, efficiency, power, current = axes.flat
    speed = curve["speed_rad_s"].values
    others = [str(name) for name in curve["torque_n_m"].dims if name != "speed_rad_s"]
    for number, index in enumerate(np.ndindex(*(curve.sizes[name] for name in others))):
        one = curve.isel(dict(zip(others, index, strict=True)))
        line = {"color": (BLUE, VERMILION, GREEN, ORANGE)[number % 4], "marker": "."}
        label = ", ".join(f"{name} = {one[name].item():g}" for name in others)
        torque.plot(speed, 1e3 * one["torque_n_m"], **line, label=label)
        unsettled = ~one["settled"].values
        torque.plot(speed[unsettled], 1e3 * one["torque_n_m"].values[unsettled], "o", mfc="none", mec="black")
        efficiency.plot(speed, 100.0 * np.maximum(one["efficiency"], 0.0), **line)
        power.plot(speed, one["power_a_w"] + one["power_b_w"], **line)
        current.plot(speed, 1e3 * one["current_a_rms_a"], **line)
        current.plot(speed, 1e3 * one["current_b_rms_a"], "--", **line)
    torque.set(ylabel="torque on the rotor in mN·m", title="Torque")
    efficiency.set(ylabel="efficiency in %", title="Efficiency: shaft power over electrical power")
    power.set(ylabel="electrical power in W", title="Electrical power of both groups")
    current.set(ylabel="RMS current in mA", title="Currents of group A and (dashed) group B")
    torque.axhline(0.0, color="0.3", linewidth=0.8)
    for axis in axes.flat:
        axis.set(xlabel="speed in rad/s")
        axis.axvline(0.0, color="0.3", linewidth=0.8)
    if others:
        torque.legend(fontsize=7)
    figure.suptitle(curve.attrs["title"], fontsize=10)
    return _save(figure, path)


def plot_tracking(results: Sequence[Tracking], path: str | Path) -> Path:
    """Draw frequency, phase and speed over time of one tracker, or of several on the same motor."""
    figure, axes = _figure(3, 1, width=8.0, height=8.0)
    frequency, phase, speed = axes.flat
    for result, colour in zip(results, (BLUE, VERMILION, GREEN, ORANGE, GREY), strict=False):
        line: dict[str, Any] = {"color": colour, "linewidth": 1.0, "label": result.settings["tracker"]["kind"]}
        milliseconds = 1e3 * result.time_s
        frequency.plot(milliseconds, 1e-3 * result.frequency_hz, **line)
        phase.plot(milliseconds, result.phase_deg, **line)
        speed.plot(milliseconds, result.rotor_speed_rad_s, **line)
    begin = results[0].settings["disturbance"]["begin_s"]
    for axis in axes.flat:
        axis.set(xlabel="time in ms")
        if begin is not None:
            axis.axvline(1e3 * begin, color=GREY, linestyle=":", linewidth=1.0)
    frequency.set(ylabel="frequency in kHz")
    phase.set(ylabel="phase of the mode in degrees", ylim=(-95.0, 95.0))
    speed.set(ylabel="rotor speed in rad/s")
    frequency.legend()
    kind = results[0].settings["disturbance"]["kind"]
    figure.suptitle(f"{results[0].settings['motor']}: {kind}", fontsize=10)
    return _save(figure, path)


def _figure(rows: int, columns: int, *, width: float = 10.0, height: float = 7.0) -> tuple[Figure, Any]:
    with matplotlib.rc_context({"font.size": 9}):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, columns, squeeze=False)
    for axis in axes.flat:
        axis.grid(True, alpha=0.3)
    return figure, axes


def _plain(text: str) -> str:
    """Return a text from outside as Matplotlib draws it as it is: a dollar begins no formula."""
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text).replace("$", r"\$")


def _save(figure: Figure, path: str | Path) -> Path:
    def write(file: Path) -> None:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # a box is drawn instead
            figure.savefig(file, dpi=150)

    return save_by_ending(path, dict.fromkeys((".png", ".svg", ".pdf"), write))
