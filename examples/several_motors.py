# SPDX-License-Identifier: MIT
"""Several stators on one shaft, and several tips on one stator.

    python examples/several_motors.py

Three stators on one disc and four plates on one slider: at one speed their torques add up, so that the speed under a
load follows from the speed-torque curves of the single stators at their own preloads. The decks three_stators.cir and
four_elements.cir run the same stators as X lines that share the shaft.

Two tips on one plate (two_tips.toml), pressed by one carrier: how they share the preload, the phase between their
forces, and one that is worn. The stator moves in its plane and its carrier only towards the rotor: nothing tilts out of
the plane, and the carrier does not turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import pyspice_runner as pr

DISC = ("bimodal40", (18.0, 22.0, 26.0), 0.06, 3e-5)  # motor, preloads in N, load in N.m, bearing in N.m.s of the disc
SLIDER = (str(Path(__file__).with_name("plate40.toml")), (17.0, 17.5, 18.0, 18.5), 3.0, 16e-3)  # N, N.s/m of the guide
TIPS = Path(__file__).with_name("two_tips.toml")
PERIODS, LAST = 240, 40  # of a run, and of its end over which means are taken
CASES = {
    "as built": {},
    "left 0.3 um lower": {"contacts.left.height_m": -0.3e-6},
    "left flat, same share": {"contacts.left.contact.worn_flat_radius_m": 60e-6},
    "groups 60 degrees apart": {},
}


def shared_speed(
    name: str, preloads: Sequence[float], load: float, bearing: float, speeds: Sequence[float]
) -> tuple[float, list[float]]:
    """Return the speed of several motors on one shaft, and the force or torque of each, from their curves."""
    motor = pr.load_motor(name)
    drive, forces = pr.default_drive(motor), []
    for preload in preloads:
        curve = pr.speed_torque(motor.updated({"contact.preload_n": preload}), drive, speeds=speeds)
        forces.append(curve["force_n" if motor.slider else "torque_n_m"].values)
    surplus = np.sum(forces, axis=0) - load - bearing * np.asarray(speeds)
    speed = float(np.interp(0.0, -surplus, speeds))  # the surplus falls with the speed
    return speed, [float(np.interp(speed, speeds, one)) for one in forces]


def tips(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> dict[str, float]:
    """Return means of both tips: normal forces, shares of the time in contact, torques, and the phase between them."""
    run = pr.simulate(motor, drive, PERIODS / drive.frequency, speed=5.0, step=0.01 / drive.frequency)
    late = run.time_s > run.time_s[-1] - LAST / drive.frequency
    turn = np.exp(-2j * np.pi * drive.frequency * run.time_s[late])
    found, tones = {}, []
    for side in ("left", "right"):
        force = run.of_contacts[f"normal_force_{side}_n"][late]
        tones.append(np.sum(force * turn))
        found[f"{side} N"] = float(force.mean())
        found[f"{side} closed"] = float((force > 0.0).mean())
        found[f"{side} mN.m"] = 1e3 * motor.rotor.radius_m * run.of_contacts[f"friction_force_{side}_n"][late].mean()
    return {**found, "phase deg": float(np.degrees(np.angle(tones[0] / tones[1])))}


def main() -> None:
    """Print the tables."""
    for title, given, fastest in (("disc", DISC, 70.0), ("slider", SLIDER, 1.0)):
        speed, forces = shared_speed(*given, np.linspace(0.0, fastest, 15))
        load = given[2]
        print(f"{title}: {speed:.4g} under {load:g}; " + ", ".join(f"{one:.4g}" for one in forces))
    motor = pr.load_motor(TIPS)
    for title, changes in CASES.items():
        drive = pr.default_drive(motor).updated({"phase_deg": 60.0} if "groups" in title else {})
        print(f"{title:24}", *(f"{key} {value:.4g}" for key, value in tips(motor.updated(changes), drive).items()))


if __name__ == "__main__":
    main()
