# SPDX-License-Identifier: MIT
"""What a feedback electrode shows of the speed: a strip of 1.5 mm across the middle of the plate of bimodal40.

The strip senses the longitudinal mode, which moves the tip towards the rotor. Subtract what the drive adds to its
voltage, s_A U_A + s_B U_B, and the amplitude of this mode follows. A straight line through the points without load
infers the speed; the table has the error of that speed at other loads, voltages and frequencies.

    python examples/feedback.py FOLDER

The motor is written to FOLDER as bimodal40-feedback.toml. Finite elements compute its modes, once, in about 20 s.
"""

from __future__ import annotations

import sys
from importlib.resources import files
from pathlib import Path

import numpy as np

import pyspice_runner as pr

DRIVES = [(volts, 40.7e3) for volts in (60.0, 70.0, 80.0, 90.0, 100.0)]  # V, Hz
DRIVES += [(100.0, hertz) for hertz in (40.5e3, 40.6e3, 40.8e3, 41.0e3)]
LOADS = (0.0, 10e-3, 20e-3, 30e-3)  # N.m
GROUND = '[[solid.electrodes]]\ngroup = "ground"'
STRIP = '[[solid.electrodes]]\ngroup = "feedback"\nfrom_m = [0.01975, 0.0, 0.003]\nto_m = [0.02125, 0.0118, 0.003]\n\n'


def with_strip(folder: Path) -> pr.Motor:
    """Return bimodal40 with the strip on 100 pF of cable, the groups 1 mm shorter on both sides of it."""
    text = (files("pyspice_runner") / "motor" / "sets" / "bimodal40.toml").read_text(encoding="utf-8")
    text = text.replace("0.02025,", "0.01925,").replace("0.02075,", "0.02175,").replace(GROUND, STRIP + GROUND)
    path = folder / "bimodal40-feedback.toml"
    text = text.replace('name = "bimodal40"', 'name = "bimodal40-feedback"')
    path.write_text(f"{text}\n[feedback]\ncapacitance_f = 100e-12\n", encoding="utf-8")
    return pr.load_motor(path)


def point(motor: pr.Motor, volts: float, hertz: float, load: float) -> tuple[float, float, float, float]:
    """Return both amplitudes at the electrode (V), the tip's motion towards the rotor (m), and the speed (rad/s)."""
    drive = pr.TwoPhaseDrive(voltage=volts, frequency=hertz, phase_deg=90.0)
    state = pr.steady_state(motor, drive, load_torque=load)
    sensed, electrode = state.sensed(), motor.feedback
    phasor = sensed["feedback_amplitude_v"] * np.exp(1j * np.radians(sensed["feedback_phase_deg"]))
    own = phasor - volts * (electrode.share_a + 1j * electrode.share_b)  # group B is 90 degrees ahead
    return abs(phasor), abs(own), 0.5 * np.ptp(state.waveforms.tip_y_m), state.speed_rad_s


def main(folder: Path) -> None:
    """Print the table."""
    motor = with_strip(folder)
    found = {(*drive, load): point(motor, *drive, load) for drive in DRIVES for load in LOADS}
    idle = np.array([values for (_, hertz, load), values in found.items() if hertz == 40.7e3 and not load])
    slope, offset = np.polyfit(idle[:, 1], idle[:, 3], 1)
    print("  V    kHz   mN.m  electrode V  less drive V  tip nm  nm/V   rad/s  inferred  error")
    for (volts, hertz, load), (whole, own, tip, speed) in found.items():
        inferred = slope * own + offset
        print(
            f"{volts:4.0f} {hertz / 1e3:6.1f} {1e3 * load:5.0f} {whole:11.2f} {own:12.2f} {1e9 * tip:9.1f} "
            f"{1e9 * tip / own:6.3f} {speed:6.2f} {inferred:8.2f} {100 * (inferred / speed - 1):7.1f} %"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
