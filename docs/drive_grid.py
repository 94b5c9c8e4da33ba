# SPDX-License-Identifier: GPL-3.0-or-later
"""Power up every driver at both ends of every range, one by one, and print a table: ``python -m docs.drive_grid``."""

from __future__ import annotations

import sys

from tests.drivers.test_driver import KINDS, NETWORKS, powered_up, ranges


def main() -> None:
    """Print for every kind and network how many runs converged, and the worst power balance among them."""
    sys.stdout.write("| driver | network | runs | rejected | worst balance | at |\n|---|---|---|---|---|---|\n")
    for kind in KINDS:
        for network in NETWORKS:
            found, refused = {}, 0
            for name, end in ranges(kind, network).items():
                for value in end:
                    report = powered_up(kind, network, {name: value})
                    if report is None:
                        refused += 1
                    else:
                        found[f"{name} = {value:g}"] = abs(report.balance_residual)
            worst = max(found, key=lambda setting: found[setting])
            sys.stdout.write(
                f"| {kind} | {network} | {len(found)} | {refused} | {100 * found[worst]:.2g} % | `{worst}` |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
