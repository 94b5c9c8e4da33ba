# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of runs over time: waveforms, averaged and controlled runs, trackers and drivers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pyspice_runner.averaged.run import AveragedRun
from pyspice_runner.control.loop import ControlLoop
from pyspice_runner.control.run import ControlledRun
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.steady.steady import SteadyState
from pyspice_runner.trackers.loop import LoopDesign, phase_shown_deg
from pyspice_runner.trackers.track import Tracking
from pyspice_runner.units import engineering
from pyspice_runner.view.draw import DASHES, LAST_PERIODS, Panel, Sheet, draw_lines, dress, last_periods
from pyspice_runner.view.style import BLUE, GREEN, GREY, GROUPS, LABELS, STATES, VERMILION, Label, label_of, time_label

_HERTZ = Label("frequency", "Hz")
_STILL = 1e-6  # relative change of a constant frequency that the spacing of the points alone leaves
LOWEST_SHOWN = 0.01  # of the crossover, of a loop gain


def waveforms(run: Waveforms) -> Sheet:
    """Return rotor speed, path of the tip, contact forces and currents, as far as they were recorded."""
    panels: dict[str, tuple[Panel, tuple[str, ...]]] = {
        "speed": (partial(_speed, run), ("rotor_speed_rad_s",)),
        "path": (partial(tip_path, run, LAST_PERIODS), ("tip_x_m", "tip_y_m", "contact_state")),
        "forces": (partial(forces, run, LAST_PERIODS), ("normal_force_n", "friction_force_n")),
        "currents": (partial(of_groups, run, "current_a", "Currents at the end"), ("current_a_a",)),
        "motional": (partial(of_groups, run, "motional_current_a", "Motional currents"), ("motional_current_a_a",)),
    }
    motor = run.provenance["motor"]
    preload = "" if run.of_transducer else f", {motor['contact']['preload_n']:g} N preload"
    title = f"{motor['name']}{preload}: {run.provenance['drive']['label']}"
    recorded = {name: panel for name, (panel, needs) in panels.items() if set(needs) <= set(run.recorded)}
    if not recorded:
        raise ParameterError("The run has no signals to plot. Record the rotor speed, tip, forces or currents.")
    return Sheet(recorded, min(2, len(recorded)), (5.0, 3.5), title)


def steady_state(state: SteadyState) -> Sheet:
    """Return the panels of the period of a steady state."""
    if state.waveforms is None:
        raise ParameterError("This steady state has no waveforms to plot.")
    return waveforms(state.waveforms)


def _speed(run: Waveforms, ax: Axes) -> None:
    lines = [(run.rotor_speed_rad_s, {"color": BLUE})]
    label = label_of("rotor_speed_rad_s", run.linear)
    draw_lines(ax, (time_label(float(run.time_s[-1])), run.time_s), label, lines, "Slider" if run.linear else "Rotor")


def tip_path(run: Waveforms, periods: int, ax: Axes) -> None:
    """Draw the path of the tip in the last drive periods, coloured by contact state."""
    last, _ = last_periods(run.time_s, run.drive_period_s, periods)
    x, y = label_of("tip_x_m", run.linear), label_of("tip_y_m", run.linear)
    state_path(ax, x.scale * run.tip_x_m[last], y.scale * run.tip_y_m[last], run.contact_state[last])
    periods = min(round(float(np.ptp(run.time_s)) / run.drive_period_s), periods)
    tip = "first of several tips" if run.of_contacts else "tip"
    title = f"Path of the {tip}, last {periods} drive periods" if periods > 1 else f"Path of the {tip} in a period"
    dress(ax, x, y, title)


def state_path(ax: Axes, x: Array, y: Array, state: Array, **look: Any) -> None:
    """Draw a path in the colours of the contact states; a step has the state at its end."""
    codes = np.rint(state).astype(int)
    for code in np.unique(codes):
        inside = codes == code
        inside[:-1] |= inside[1:]
        own: dict[str, Any] = {"color": STATES[code].colour, "label": STATES[code].name, "solid_capstyle": "round"}
        ax.plot(np.where(inside, x, np.nan), np.where(inside, y, np.nan), **{"linewidth": 2, **own, **look})


def forces(run: Waveforms, periods: int, ax: Axes) -> None:
    """Draw the forces of the contact over the last drive periods."""
    last, time = last_periods(run.time_s, run.drive_period_s, periods)
    lines = [
        (run.normal_force_n[last], {"color": BLUE, "label": "normal force"}),
        (run.friction_force_n[last], {"color": VERMILION, "linestyle": "--", "label": "friction"}),
    ]
    draw_lines(
        ax,
        (LABELS["time_us"], time),
        LABELS["force_n"],
        lines,
        "Contact forces, sums, at the end" if run.of_contacts else "Contact forces at the end",
    )


def of_groups(run: Waveforms, quantity: str, title: str, ax: Axes) -> None:
    """Draw voltages or currents of both groups over the last drive periods."""
    last, time = last_periods(run.time_s, run.drive_period_s)
    kind, _, unit = quantity.rpartition("_")
    lines = [
        (
            getattr(run, groups.column(kind, group, unit))[last],
            {"color": colour, "linestyle": dash, "label": f"group {group.upper()}"},
        )
        for (group, colour), dash in zip(GROUPS.items(), DASHES, strict=False)
        if groups.column(kind, group, unit) in run.recorded
    ]
    draw_lines(ax, (LABELS["time_us"], time), LABELS[quantity.removeprefix("motional_")], lines, title)


def averaged_run(run: AveragedRun) -> Sheet:
    """Return means and amplitudes over time."""
    curves = {
        "speed": (run.rotor_speed_rad_s, label_of("rotor_speed_rad_s", run.linear)),
        "torque": (run.torque_n_m, Label("force", "N") if run.linear else Label("torque", "mN·m", 1e3)),
        "power": (run.electrical_power_w, LABELS["electrical_power_w"]),
        "frequency": (run.frequency_hz, LABELS["frequency_hz"]),
        "temperature": (run.temperature_k, Label("temperature rise", "K")),
        "check": (run.check, Label("check (below 2 %)", "%", 100.0)),
    }
    title = f"{run.provenance['motor']['name']}, averaged: {run.provenance['drive']['label']}"
    return _over_time(run.time_s, curves, title)


def controlled_run(run: ControlledRun) -> Sheet:
    """Return the measurements and settings of a controller for each sample."""
    curves = {
        "speed": (run.speed_rad_s, label_of("rotor_speed_rad_s", run.linear)),
        "position": (run.position_rad, label_of("rotor_position_rad", run.linear)),
        "voltage": (run.voltage_a_v, Label("amplitude of group A", "V")),
        "current": (run.current_amplitude_a, Label("current amplitude", "mA", 1e3)),
        "current phase": (run.current_phase_deg, Label("current phase", "degrees")),
        "frequency": (run.frequency_hz, LABELS["frequency_hz"]),
    }
    settings = run.provenance["run"]
    kind = "averaged motor" if settings["averaged"] else "full motor"
    title = f"{run.provenance['motor']['name']}, {kind}, a sample every {1e3 * settings['sample_time_s']:g} ms"
    found = run.summary()
    figures = [f"{name}: {found[name]}" for name in ("settled", "static error") if name in found]
    return _over_time(run.time_s, curves, "; ".join([title, *figures]), marker=".")


def control_loop(loop: ControlLoop) -> Sheet:
    """Return magnitude and phase of plant and loop gain, and the step response by small signals and by simulation."""
    gains = ", ".join(f"{name} {value:.4g} {loop.gain_units[name]}" for name, value in loop.gains.items())
    panels: dict[str, Panel] = {
        "magnitude": partial(_loop_magnitude, loop),
        "phase": lambda ax: bode_phase(ax, loop, loop.loop_gain),
        "step": partial(_loop_step, loop),
    }
    title = f"{loop.provenance['motor']['name']}: loop of the {loop.quantity}, {gains}"
    return Sheet(panels, 3, (4.0, 3.4), title)


def loop_design(loop: LoopDesign) -> Sheet:
    """Return magnitude and phase of the loop gain of a tracker."""
    magnitude = partial(bode_magnitude, loop=loop, gain=loop.gain, others={})
    panels: dict[str, Panel] = {"magnitude": magnitude, "phase": partial(bode_phase, loop=loop, gain=loop.gain)}
    return Sheet(panels, 2, (4.6, 3.4), "Loop of the phase")


def _loop_magnitude(loop: ControlLoop, ax: Axes) -> None:
    bode_magnitude(ax, loop, loop.loop_gain, {"plant / its first value": np.abs(loop.plant)})
    if loop.gain_margin_db is not None:
        ax.axhline(10.0 ** (-loop.gain_margin_db / 20.0), color=VERMILION, linestyle=":", linewidth=1.0)
        ax.set_title(f"Magnitude; gain margin {loop.gain_margin_db:.3g} dB")


def bode_magnitude(
    ax: Axes, loop: ControlLoop | LoopDesign, gain: NDArray[np.complex128], others: Mapping[str, Array]
) -> None:
    """Draw the magnitudes of a loop gain and of others, each over its first value."""
    lowest = int(np.argmin(np.abs(loop.frequency_hz - LOWEST_SHOWN * loop.crossover_hz)))
    shown = slice(lowest, None)
    lines: list[tuple[Any, dict[str, Any]]] = [
        (np.abs(gain[shown]), {"color": BLUE} | ({"label": "loop gain"} if others else {}))
    ]
    lines += [(values[shown] / values[lowest], {"color": GREY, "label": name}) for name, values in others.items()]
    draw_lines(
        ax, (_HERTZ, loop.frequency_hz[shown]), Label("magnitude", ""), lines, "Magnitude" if others else "Loop gain"
    )
    ax.loglog()
    ax.axhline(1.0, color=GREY, linewidth=0.7)
    ax.plot([loop.crossover_hz], [1.0], "o", color=VERMILION, markersize=3)


def bode_phase(ax: Axes, loop: ControlLoop | LoopDesign, gain: NDArray[np.complex128]) -> None:
    """Draw the phase of a loop gain with its margin."""
    shown = loop.frequency_hz > LOWEST_SHOWN * loop.crossover_hz
    phase = phase_shown_deg(loop.frequency_hz[shown], gain[shown], loop.crossover_hz, loop.phase_margin_deg)
    title = f"Phase margin {loop.phase_margin_deg:.3g}° at {loop.crossover_hz:.4g} Hz"
    label = Label("phase of the loop gain", "degrees")
    draw_lines(ax, (_HERTZ, loop.frequency_hz[shown]), label, [(phase, {"color": BLUE})], title)
    ax.set_xscale("log")
    ax.axhline(-180.0, color=GREY, linewidth=0.7)
    margin = (-180.0, loop.phase_margin_deg - 180.0)
    ax.plot([loop.crossover_hz] * 2, margin, "o-", color=VERMILION, markersize=3)


def _loop_step(loop: ControlLoop, ax: Axes) -> None:
    lines = [
        (loop.step_predicted, {"color": GREY, "label": "by small signals"}),
        (loop.step_simulated, {"color": BLUE, "marker": ".", "linestyle": "", "label": "averaged motor"}),
    ]
    title = f"Step; overshoot {100.0 * loop.overshoot_simulated:.3g} %"
    draw_lines(ax, (time_label(float(loop.time_s[-1])), loop.time_s), Label("deviation / step", ""), lines, title)
    ax.axhline(1.0, color=GREY, linewidth=0.7)


def _over_time(
    time_s: Array, curves: dict[str, tuple[Array, Label]], title: str, begins_s: Sequence[float] = (), **look: Any
) -> Sheet:
    """Return a panel for each curve, over time, with a mark at the beginning of each disturbance."""
    time = time_label(float(time_s[-1]))

    def draw_curve(values: Array, label: Label, ax: Axes) -> None:
        draw_lines(ax, (time, time_s), label, [(values, {"color": BLUE, **look})])
        ax.ticklabel_format(axis="y", useOffset=False)
        low, high = ax.get_ylim()
        if high - low < _STILL * max(abs(low), abs(high)):
            ax.set_ylim(low - 100.0 * _STILL * abs(low), high + 100.0 * _STILL * abs(high))
        for begin in begins_s:
            ax.axvline(time.scale * begin, color=GREY, linestyle=":", linewidth=1.0)

    return Sheet({name: partial(draw_curve, *curve) for name, curve in curves.items()}, 2, (6.0, 3.1), title)


def tracking(result: Tracking) -> Sheet:
    """Return frequency, phase and speed over time with the beginnings of the disturbances, and the loop gain."""
    curves = {
        "frequency": (result.frequency_hz, LABELS["frequency_hz"]),
        "phase": (result.phase_deg, Label("phase of the mode", "degrees")),
        "speed": (result.rotor_speed_rad_s, label_of("rotor_speed_rad_s", result.linear)),
    }
    if result.of_transducer:
        curves["speed"] = result.rotor_speed_rad_s, Label("motional current", "A")
    if result.temperature_k is not None and result.temperature_k.any():
        curves["temperature"] = (result.temperature_k, Label("temperature rise", "K"))
    disturbances, loop = result.settings["disturbances"], result.loop
    kinds = ", ".join(dict.fromkeys(one["kind"] for one in disturbances))
    tracker = result.settings["tracker"]
    drive = f"{engineering(tracker['voltage'], 'V')}, target {tracker['target_deg']:g}°"
    title = f"{result.settings['motor']['name']}, {drive}: {kinds}"
    begins = [one["begin_s"] for one in disturbances if one["kind"] not in ("start", "warm-up")]
    sheet = _over_time(result.time_s, curves, title, begins, linewidth=1.0)
    if loop is not None:
        sheet.panels["loop magnitude"] = lambda ax: bode_magnitude(ax, loop, loop.gain, {})
        sheet.panels["loop phase"] = lambda ax: bode_phase(ax, loop, loop.gain)
    return sheet


def drive_report(report: DriveReport) -> Sheet:
    """Return voltages and currents of motor and power stage, the harmonics, and the powers."""
    of_run = "end of the run from power-up" if report.operating else ""
    panels: dict[str, Panel] = {
        "voltages": partial(_ports, report, "v", LABELS["voltage_v"], f"{report.driver['label']}\n{of_run}".strip()),
        "currents": partial(_ports, report, "a", LABELS["current_a"], of_run),
        "spectrum": partial(_harmonics, report),
        "powers": partial(_powers, report),
    }
    if report.steps:
        panels["step"] = partial(_steps, report)
    return Sheet(panels, 1, (6.5, 3.0), report.motor["name"])


def _steps(report: DriveReport, ax: Axes) -> None:
    for group, (time, output) in report.steps.items():
        label = f"{group.upper()}: {report.stability[group].words()}"
        ax.plot(1e6 * time, output, color=GROUPS[group], label=label)
    dress(ax, LABELS["time_us"], "output / step")


def _ports(report: DriveReport, unit: str, label: Label, title: str, ax: Axes) -> None:
    """Draw a quantity at the groups (solid) and at the power stage (dotted) over the last drive periods."""
    waves = report.waveforms
    last, time = last_periods(waves["time_s"], 1.0 / report.driver["frequency"])
    lines = [
        (waves[groups.column(place, group, unit)][last],
         {"linestyle": dash, "color": colour, "label": f"{name} {group.upper()}"})
        for group, colour in zip(report.groups, GROUPS.values(), strict=False)
        for place, dash, name in (("group", "-", "pin"), ("output", ":", "stage"))
    ]  # fmt: skip
    draw_lines(ax, (LABELS["time_us"], time), label, lines, title, fontsize="small", ncols=2)


def _harmonics(report: DriveReport, ax: Axes) -> None:
    ports = (report.operating or report).groups
    largest = max(port.harmonics[0].current_a for port in ports.values())
    for (group, port), colour, shift in zip(ports.items(), GROUPS.values(), (-0.2, 0.2), strict=False):
        harmonics = port.harmonics
        orders = [item.order + shift for item in harmonics]
        heights = [max(item.current_a, 1e-9) for item in harmonics]
        ax.bar(orders, heights, 0.4, color=colour, label=f"pin {group.upper()}")
    dress(ax, "harmonic", "current in A, amplitude", "operating point" if report.operating else "")
    ax.set(yscale="log", ylim=(1e-5 * largest, 3.0 * largest))
    ax.set_xticks(range(1, 21, 2))


def _powers(report: DriveReport, ax: Axes) -> None:
    best = report.operating or report
    shares = {"motor": best.motor_power_w}
    for device, loss in best.losses_w.items():
        part = device.partition("_")[0]
        shares[part] = shares.get(part, 0.0) + loss
    ax.barh(list(shares), list(shares.values()), color=[GREEN, *[VERMILION] * (len(shares) - 1)])
    ax.invert_yaxis()
    title = (
        f"supply {best.power_in_w:.3g} W, power factor {best.power_factor:.3f}, "
        f"{100 * best.driver_efficiency:.1f} % reach the motor"
    )
    dress(ax, "power in W", "", "operating point\n" + title if report.operating else title)
