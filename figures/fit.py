# SPDX-License-Identifier: GPL-3.0-or-later
"""A noisy spectrum of the stator, the fitted circuit, and the true values within the intervals of the fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from style import BLACK, BLUE, GREY, ORANGE, VERMILION, canvas, main, write

import pyspice_runner as pr
from pyspice_runner.circuit.motor import dielectric_admittance
from pyspice_runner.impedance.one_port_fit import FittedArm, SpectrumFit

NOISE, SEED = 0.01, 2002
LEAD_OHM = 15.0
START, STOP, POINTS = 8e3, 70e3, 1601
NAMES = {"series_resonance_hz": "f", "quality_factor": "Q", "resistance_ohm": "R", "inductance_h": "L"}


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    result = pr.admittance(motor, start=START, stop=STOP, points=POINTS)
    frequency = result.frequency_hz
    noise = np.random.default_rng(SEED).standard_normal((2, POINTS)) * NOISE / np.sqrt(2.0)
    y = (1.0 + noise[0] + 1j * noise[1]) / (LEAD_OHM + 1.0 / result.driven("A"))
    fit = pr.fit_spectrum(pr.Spectrum.from_admittance(frequency, y, source="stator, group A"), leads=(LEAD_OHM, 0.0))

    figure, axes = canvas(3, 2, 8.4, height_ratios=(1.0, 0.8, 0.9))
    (magnitude, circle), (phase, near), (residuals, values) = axes
    for panel, name in ((magnitude, "magnitude"), (phase, "phase"), (residuals, "residuals")):
        fit.plot(ax=panel, panel=name)
        if panel.get_legend():  # there is one for the figure
            panel.get_legend().remove()
    magnitude.set_title("(a) magnitude")
    phase.set(title="(c) phase", yticks=range(-30, 91, 30))
    residuals.set(title="(e) residuals", ylim=(-3.5, 3.5))
    fine = np.linspace(START, STOP, 20_001)
    for letter, panel, arm in zip("bd", (circle, near), fit.arms[::-1], strict=True):
        _draw_circle(panel, fit, arm, y, fine)
        panel.set(title=f"({letter}) G–B circle at {arm.series_resonance_hz / 1e3:.3g} kHz")
    values.remove()
    split = values.get_subplotspec().subgridspec(1, 2, width_ratios=(1.0, 2.6))
    inside = _draw_values([figure.add_subplot(part) for part in split], fit, motor)

    handles = [
        Line2D([], [], ls="", marker=".", color=GREY, label="measured"),
        Line2D([], [], color=BLUE, label=f"fitted, {len(fit.arms)} arms"),
        Line2D([], [], ls="", marker=".", color=BLUE, label="in phase"),
        Line2D([], [], ls="", marker=".", color=ORANGE, label="in quadrature"),
        Line2D([], [], marker="o", ms=3.5, color=VERMILION, label="95 % interval"),
        Line2D([], [], ls=":", color=VERMILION, label="resonance"),
    ]
    caption = (
        f"Admittance of group A of motor {motor.name}, tip free, by ngspice, behind leads of {LEAD_OHM:g} Ω "
        f"that the fit knows, with 1 % of noise (seed {SEED}). The fit finds the number of arms and needs no "
        f"initial values. (f) Deviation of the fitted values from the motor's; {inside[0]} of {inside[1]} lie within "
        "their 95 % intervals."
    )
    write(figure, folder / "fit.png", "From a spectrum to an equivalent circuit", caption, handles)
    arms = "; ".join(
        f"{arm.series_resonance_hz / 1e3:.4g} kHz, Q {arm.quality_factor:.3g} ± "
        f"{arm.standard_errors['quality_factor']:.1g}"
        for arm in fit.arms
    )
    return [
        f"{len(fit.arms)} arms found: {arms}; residuals {100 * fit.rms_relative_error:.2f} %",
        f"{inside[0]} of {inside[1]} values of the motor lie within the 95 % intervals of the fit",
    ]


def _draw_circle(panel: Any, fit: SpectrumFit, arm: FittedArm, y: np.ndarray, fine: np.ndarray) -> None:
    """Draw the circle over eight bandwidths on each side of a resonance."""
    half = 8.0 * arm.series_resonance_hz / arm.quality_factor
    near = np.abs(fit.frequency_hz - arm.series_resonance_hz) < half
    curve = fit.admittance(fine[np.abs(fine - arm.series_resonance_hz) < half])
    panel.plot(1e3 * y[near].real, 1e3 * y[near].imag, ".", color=GREY, ms=3)
    panel.plot(1e3 * curve.real, 1e3 * curve.imag, color=BLUE, lw=1.0)
    panel.set(xlabel="conductance G / mS", ylabel="susceptance B / mS", aspect="equal", adjustable="datalim")


def _draw_values(panels: list[Any], fit: SpectrumFit, motor: pr.Motor) -> tuple[int, int]:
    """Draw fitted over true values; return how many intervals hold the true value, and of how many."""
    rows = []
    for number, (arm, mode) in enumerate(zip(fit.arms, motor.modes, strict=True), start=1):
        squared = mode.coupling_a_n_per_v**2
        truth = {
            "series_resonance_hz": mode.frequency_hz,
            "quality_factor": mode.quality_factor,
            "resistance_ohm": mode.damping_n_s_per_m / squared,
            "inductance_h": mode.mass_kg / squared,
        }
        for name, short in NAMES.items():
            rows.append((f"{short}{number}", getattr(arm, name), arm.standard_errors[name], truth[name]))
    errors = fit.standard_errors
    centre = fit.circuit.loss_reference_hz  # at which the capacitance holds
    truth_c = dielectric_admittance(motor, "a", centre).imag / (2.0 * np.pi * centre)
    rows.append(("C0", fit.circuit.clamped_capacitance_f, errors["clamped_capacitance_f"], truth_c))
    inside = 0
    others = [row for row in rows if not row[0].startswith("f")]
    parts = ([row for row in rows if row not in others], 1e6, "deviation / ppm"), (others, 100.0, "deviation / %")
    for panel, (shown, unit, words) in zip(panels, parts, strict=True):
        for place, (_, value, error, truth) in enumerate(shown):
            scale = unit / truth
            bar = {"fmt": "o", "ms": 3.5, "color": VERMILION, "capsize": 2}
            panel.errorbar(place, scale * (value - truth), yerr=scale * 1.96 * error, **bar)
            inside += abs(value - truth) <= 1.96 * error
        panel.axhline(0.0, color=BLACK, lw=0.6)
        panel.set_xticks(range(len(shown)), [row[0] for row in shown])
        panel.set(ylabel=words, xlim=(-0.6, len(shown) - 0.4))
    panels[0].set_title("(f) fitted against the motor's values")
    return inside, len(rows)


if __name__ == "__main__":
    main(draw, __doc__)
