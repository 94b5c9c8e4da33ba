# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor bimodal40: force, efficiency and power with their bands; preload, voltage, frequency and limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray
from style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr
from docs.bimodal40_bands import RATED_FORCE_N, motor_of, stored
from docs.bimodal40_bands import curve as curve_of
from docs.bimodal40_bands import tuned as tuned_as_band

COLOURS = (ORANGE, GREEN, BLUE)
SHARE = (5.0, 95.0)  # percentiles of the band
RATED_SPEED_M_S = 0.3


def tuned_motors() -> list[dict[str, Any]]:
    """Return the motors of the band that give the rated force at the rated speed."""
    return [motor for motor in stored()["motors"].values() if "force_n" in motor]


def band(quantity: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the speeds in m/s and two percentiles of a quantity over the tuned motors; 0 where the motor brakes."""
    values = np.array([[value or 0.0 for value in motor[quantity]] for motor in tuned_motors()])
    return np.array(stored()["speeds_m_s"]), np.percentile(values, SHARE, axis=0)


def power_of(data: xarray.Dataset) -> xarray.DataArray:
    """Return the electrical power of both groups in W."""
    return data["power_a_w"] + data["power_b_w"]


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    radius, limits = motor.rotor.radius_m, motor.limits
    assert limits is not None
    rim = np.array([0.0, 0.3] if draft() else [0.0, 0.15, 0.3, 0.4, 0.5, 0.6, 0.7, 0.74])
    voltages = [drive.voltage] if draft() else [round(part * drive.voltage) for part in (0.6, 0.8, 1.0)]
    family = pr.speed_torque(motor, drive, speeds=rim / radius, over={"drive.voltage": voltages}, audit=False)
    rated = [RATED_SPEED_M_S / radius]
    preloads = np.array([18.0, 22.0] if draft() else [8.0, 12.0, 16.0, 22.0, 28.0, 34.0])
    pressed = pr.speed_torque(motor, drive, speeds=[0.0, *rated], over={"contact.preload_n": preloads}, audit=False)
    weak = np.linspace(0.1, 1.0, 2 if draft() else 10) * drive.voltage
    dead = pr.speed_torque(motor, drive, speeds=[0.0], over={"drive.voltage": weak}, audit=False)
    tones = np.array([40.7e3] if draft() else np.arange(40.5e3, 41.05e3, 100.0))
    tuned = pr.speed_torque(motor, drive, speeds=rated, over={"drive.frequency": tones}, audit=False)

    alone = motor_of()
    matched = drive if draft() else tuned_as_band(alone)
    assert matched is not None
    nominal = curve_of(alone, matched)

    figure, axes = canvas(4, 2, 11.0)
    flat = list(axes.flat)
    for panel, quantity, scale in ((0, "force_n", 1.0), (1, "efficiency", 100.0), (2, "power_w", 1.0)):
        speeds, (low, high) = band(quantity)
        flat[panel].fill_between(1e3 * speeds, scale * low, scale * high, color=GREY, alpha=0.25, lw=0, label="band")
        shown = np.array([value or 0.0 for value in nominal[quantity]])
        flat[panel].plot(1e3 * speeds, scale * shown, color=BLACK, ls="--", lw=1.1, label="nominal, tuned as the band")
    for voltage, colour in zip(voltages, COLOURS[-len(voltages) :], strict=True):
        curve = family.sel({"drive.voltage": voltage})
        pulls = curve["load_torque_n_m"] > 0.0
        style = {"color": colour, "ms": 3}
        flat[0].plot(1e3 * rim, curve["load_torque_n_m"] / radius, "o-", label=f"{voltage:g} V", **style)
        flat[1].plot(1e3 * rim, 100.0 * curve["efficiency"].where(pulls), "o-", **style)
        flat[2].plot(1e3 * rim, power_of(curve), "o-", **style)
        flat[6].plot(1e3 * rim, 1e-6 * curve["ceramic_stress_pa"], "o-", **style)
        flat[7].plot(1e3 * rim, curve["temperature_rise_k"], "o-", **style)
    flat[0].axhline(0.0, color=BLACK, lw=0.6)
    stall, moving = (pressed["load_torque_n_m"].isel(speed_rad_s=index) / radius for index in (0, 1))
    flat[3].plot(preloads, stall, "o-", color=VERMILION, ms=3, label="stall")
    flat[3].plot(preloads, moving, "s--", color=PURPLE, ms=3, label="300 mm/s")
    flat[4].plot(weak, dead["torque_n_m"].sel(speed_rad_s=0.0) / radius, "o-", color=VERMILION, ms=3)
    flat[5].plot(1e-3 * tones, tuned["load_torque_n_m"][:, 0] / radius, "s--", color=PURPLE, ms=3)
    watts = flat[5].twinx()
    watts.grid(visible=False)
    watts.spines["right"].set_visible(True)
    watts.plot(1e-3 * tones, power_of(tuned)[:, 0], "o-", color=BLUE, ms=3)
    watts.set_ylabel("power / W", color=BLUE)
    flat[6].axhline(1e-6 * limits.dynamic_strength_pa, color=BLACK, ls=":", lw=1.0)
    flat[7].axhline(0.5 * limits.curie_temperature_c - limits.ambient_c, color=BLACK, ls=":", lw=1.0)
    titles = (
        ("(a) force", "force / N"), ("(b) efficiency", "efficiency / %"), ("(c) electrical power", "power / W"),
        ("(d) force versus preload", "force / N"), ("(e) stall force versus voltage", "force / N"),
        ("(f) force and power at 300 mm/s", "force / N"), ("(g) stress of the ceramic, limit dotted", "stress / MPa"),
        ("(h) temperature rise, limit dotted", "temperature rise / K"),
    )  # fmt: skip
    across = {3: "preload / N", 4: "voltage / V", 5: "frequency / kHz"}
    for index, (axis, (title, unit)) in enumerate(zip(flat, titles, strict=True)):
        axis.set(title=title, ylabel=unit, xlabel=across.get(index, "speed of the rim / (mm/s)"))
    flat[0].set_ylim(bottom=-3.0)
    flat[0].legend(fontsize=7, loc="lower left")
    flat[3].legend(fontsize=7)
    full = family.sel({"drive.voltage": voltages[-1]})
    load = full["load_torque_n_m"].values
    free = f"{1e3 * np.interp(0.0, -load, rim):.0f}" if (load < 0.0).any() else f"more than {1e3 * rim[-1]:.0f}"
    useful = full.where(full["load_torque_n_m"] > 0.0)
    facts = (
        f"{drive.label}: stall {load[0] / radius:.2f} N at the rim, no load {free} mm/s, best efficiency "
        f"{100 * float(useful['efficiency'].max()):.0f} %, at most {float(power_of(useful).max()):.1f} W, "
        f"{1e3 * float(np.fmax(useful['current_a_rms_a'], useful['current_b_rms_a']).max()):.0f} mA rms, "
        f"{1e-6 * float(useful['ceramic_stress_pa'].max()):.0f} MPa and "
        f"{float(useful['temperature_rise_k'].max()):.0f} K."
    )
    caption = (
        f"{facts} Colours: voltages at the recommended frequency as in (a). Band: 5 to 95 % of {len(tuned_motors())} "
        f"motors with tolerances at {drive.voltage:g} V, each at its own frequency, the first from above that gives "
        f"{RATED_FORCE_N:g} N at 300 mm/s; "
        f"dashed: the nominal motor tuned in this way, {matched.frequency / 1e3:g} kHz. Where the force is "
        "negative, the load drives the motor."
    )
    path = folder / "bimodal40.png"
    write(figure, path, "bimodal40 at its recommended drive, and motors with tolerances", caption)
    return [str(path), facts]


if __name__ == "__main__":
    main(draw, __doc__)
