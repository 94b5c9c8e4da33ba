# SPDX-License-Identifier: MIT
"""Firmware in the loop: speed_loop.c controls the averaged motor on this computer; replay.in has what it saw.

The file also runs on a microcontroller: replay.c gives it the samples of replay.in, there or here (make firmware).

    python examples/firmware/run.py speed_loop.so replay.in
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": 60.0})
SAMPLE_TIME = 0.5e-3  # s
PARTS = pr.Electronics(
    encoder_lines=5000, current_bits=12, current_range_a=0.15, voltage_bits=12, voltage_range_v=200.0,
    amplitude_bits=10, amplitude_range_v=128.0, timer_hz=170e6, delay_s=20e-6,
)  # fmt: skip
REFERENCE = [(20e-3, 8.0), (20.5e-3, -8.0)]  # s, rad/s: a reversal
OF_A_SAMPLE = tuple(pr.Sample.__dataclass_fields__)


def run(
    library: str, duration: float, *, electronics: pr.Electronics | None = PARTS, averaged: bool = True
) -> ControlledRun:
    """Run the firmware in a shared library with the averaged motor, or with the full one."""
    return pr.simulate_controlled(
        MOTOR, DRIVE, library, duration=duration, sample_time=SAMPLE_TIME, electronics=electronics, averaged=averaged,
        courses={"reference": REFERENCE},
    )  # fmt: skip


def recorded(found: ControlledRun) -> bytes:
    """Return the inputs of the firmware in a run, for replay.c: sample time, first commands and samples, as floats."""
    first = [SAMPLE_TIME, DRIVE.voltage, DRIVE.voltage_b, DRIVE.phase_deg, DRIVE.frequency]
    samples = np.transpose([found.samples[name] for name in OF_A_SAMPLE])
    return np.concatenate([first, samples.ravel()]).astype("<f4").tobytes()


if __name__ == "__main__":
    found = run(sys.argv[1], 40e-3)
    Path(sys.argv[2]).write_bytes(recorded(found))
    print(found)
    print(f"the timer sets the frequency in steps of {found.to_dict()['run']['resolution']['frequency_hz']:.3g} Hz")
