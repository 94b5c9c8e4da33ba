# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare steady states behind drivers with settled runs and print the table: ``python -m docs.steady_driven``."""

from __future__ import annotations

from itertools import product

from tests.steady.test_steady_driven import HELD, KINDS, MOUNTED, NETWORKS, both, friction_torque

STATORS = {"fixed": HELD, "mount": MOUNTED}


def row(kind: str, network: str, stator: str) -> str:
    """Return the row of a power stage with a network, at a fixed distance or on a mount."""
    motor = STATORS[stator]
    ours, settled = both(kind, network, motor)
    torque, drift, friction = settled["torque_n_m"], abs(settled["torque_drift_n_m"]), friction_torque(motor)
    found = f"| {kind} | {network} | {stator} | {1e3 * ours.torque_n_m:.3f}{'' if ours.stable else ' (unstable)'} |"
    found += f" {1e3 * torque:.3f} | {1e3 * settled['simulated_s']:.1f} | {100.0 * drift / friction:.3f} % |"
    return f"{found} {100.0 * abs(ours.torque_n_m - torque) / friction:.3f} % |"


def main() -> None:
    """Print a row for every power stage and network, at a fixed distance and on a mount."""
    print("| driver | network | stator | steady state, mN·m | settled, mN·m | after, ms | drift | difference |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for kind, network, stator in product(KINDS, NETWORKS, STATORS):
        print(row(kind, network, stator), flush=True)


if __name__ == "__main__":
    main()
