# SPDX-License-Identifier: GPL-3.0-or-later
"""A mount with soft springs keeps the mean normal force at the preload; one with rigid springs keeps the distance."""

import numpy as np
import pytest

import pyspice_runner as pr
from tests.motors import BEAM40
from tests.selection import mostly

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("mount")]

SPRINGS = {"stiffness_n_per_m": 2e4, "mass_kg": 0.05, "damping_n_s_per_m": 50.0}
LONG = "opens, contact resonance"  # takes twenty seconds
FULL = "beam40, full voltage of the field limit, 300 mm/s"
FURTHER = (LONG, "slip, driven shaft", "unintended mode, 44.5 kHz", FULL, "beam40, 200 mm/s")
POINTS = {  # set, voltage, frequency, phase, preload, speed of the rotor in rad/s
    "slip": ("andersen2002", 50.0, 51.7e3, 90.0, 5.0, 0.0),
    "slip, driven shaft": ("andersen2002", 100.0, 53e3, 90.0, 5.0, 3.0),
    "hard pressed": ("andersen2002", 100.0, 55e3, 60.0, 20.0, 0.0),
    LONG: ("andersen2002", 30.0, 17.9e3, 90.0, 3.0, 0.0),
    "opens, 10 kHz": ("andersen2002", 150.0, 10e3, 45.0, 2.0, 0.0),
    "unintended mode, 44.5 kHz": ("andersen2002-unintended-mode", 100.0, 44.5e3, 180.0, 5.0, 0.0),
    "unintended mode, 46 kHz": ("andersen2002-unintended-mode", 100.0, 46e3, 180.0, 5.0, 0.0),
    "beam40, stall": (BEAM40, 115.0, 40.1e3, 120.0, 6.5, 0.0),
    FULL: (BEAM40, 130.0, 39.8e3, 120.0, 6.5, 20.0),
    "beam40, 200 mm/s": (BEAM40, 115.0, 40.1e3, 120.0, 6.5, 13.3),
}


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, POINTS, [name for name in POINTS if name not in FURTHER]))
def test_the_mean_normal_force_on_soft_springs_is_the_preload(name: str) -> None:
    source, voltage, frequency, phase, preload, speed = POINTS[name]
    motor = pr.load_motor(source).updated({"mount": SPRINGS, "contact.preload_n": preload})
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    point = pr.speed_torque(motor, drive, speeds=[speed])
    # the springs take 2e4 N/m times the micrometre by which the carrier moves: 0.02 N at most; required: 0.5 %
    assert float(point["normal_force_n"][0]) == pytest.approx(preload, rel=5e-3)


def test_on_rigid_springs_the_stator_is_held() -> None:
    held = pr.load_motor("andersen2002").updated({"mount": None, "contact.preload_n": 3.0})
    rigid = held.updated({"mount": {"stiffness_n_per_m": 1e11, "mass_kg": 1.0, "damping_n_s_per_m": 1e3}})
    drive = pr.TwoPhaseDrive(voltage=60.0, frequency=17.9e3, phase_deg=90.0)
    runs = [pr.simulate(motor, drive, duration=2e-3, step=2e-7) for motor in (held, rigid)]
    for column in ("tip_x_m", "tip_y_m", "normal_force_n"):
        ours, theirs = (getattr(run, column) for run in runs)
        # the springs give way by k_contact/k = 1e-4 of the penetration
        assert float(np.std(ours - theirs)) < 2e-3 * float(np.std(theirs)), column
