# SPDX-License-Identifier: GPL-3.0-or-later
"""Effect of the contact law on results and run time."""

from __future__ import annotations

import numpy as np

import pyspice_runner as pr

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
DRIVES = {
    "two tones": (
        pr.TwoToneDrive(voltage_1=100.0, frequency_1=18e3, voltage_2=50.0, frequency_2=54e3, phase_deg=165.0),
        (-4.0, 0.0, 4.0, 8.0, 12.0),
    ),
    "two phases": (pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3), (-2.0, 0.0, 2.0, 4.0)),
}
LAWS = (pr.Law("spring-slider"), pr.Law("brush", 8), pr.Law("brush", 32), pr.Law("coulomb"))
LOSSES = ("power_a_w", "power_b_w", "friction_loss_w", "damping_loss_w", "dielectric_loss_w")
DURATION = 2e-3  # s, of the runs that are timed
REPEATS = 3


def curve(name: str, law: pr.Law) -> dict[str, float]:
    """Return stall torque (N·m), no-load speed (rad/s), and powers at stall (W)."""
    drive, speeds = DRIVES[name]
    found = pr.speed_torque(MOTOR, drive, speeds=speeds, contact=law)
    assert found["settled"].all()
    torques = found["torque_n_m"].values
    stall = found.sel(speed_rad_s=0.0)
    return {
        "stall": float(stall["torque_n_m"]),
        "no_load": float(np.interp(0.0, torques[::-1], np.array(speeds)[::-1])),
        **{loss: float(stall[loss]) for loss in LOSSES},
    }


def seconds(name: str, law: pr.Law) -> float:
    """Return ngspice's wall time for 1 ms of the free-running motor, the shortest of several runs."""
    drive, _ = DRIVES[name]
    runs = (pr.simulate(MOTOR, drive, duration=DURATION, contact=law) for _ in range(REPEATS))
    return min(run.solver_seconds for run in runs) / (1e3 * DURATION)


def main() -> None:
    """Print the table."""
    print("| drive | law | stall torque, µN·m | no-load speed, rad/s | power | friction | modes | dielectric | cost |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in DRIVES:
        for law in LAWS:
            found, cost = curve(name, law), seconds(name, law)
            powers = (found["power_a_w"] + found["power_b_w"], *(found[loss] for loss in LOSSES[2:]))
            label = f"{law.name}, {law.sliders}" if law.sliders else law.name
            print(
                f"| {name} | {label} | {1e6 * found['stall']:.4g} | {found['no_load']:.2f} | "
                f"{' | '.join(f'{power:.3f}' for power in powers)} | {cost:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
