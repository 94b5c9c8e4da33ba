# SPDX-License-Identifier: GPL-3.0-or-later
"""Long runs: the memory of the process over the number of steps, for several ways to record, up to 10 million steps."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

TARGET = Path(__file__).resolve().parent / "long_run.json"
THREE = {"signals": ["tip_x_m", "tip_y_m", "rotor_speed_rad_s"]}
RUNS: list[tuple[str, int, dict[str, Any]]] = [
    ("every 100th step", 100_000, {"record_every": 100}),
    ("every 100th step", 1_000_000, {"record_every": 100}),
    ("the last 20 periods", 100_000, {"last_periods": 20}),
    ("the last 20 periods", 1_000_000, {"last_periods": 20}),
    ("all signals", 100_000, {}),
    ("all signals", 1_000_000, {}),
    ("three signals", 10_000_000, THREE),
]
SCRIPT = """
import json, resource, sys
import pyspice_runner as pr
steps, settings = int(sys.argv[1]), json.loads(sys.argv[2])
motor = pr.load_motor("andersen2002").updated({"mount": None})
drive = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)
step = 1.4e-7
last = settings.pop("last_periods", None)
if last:
    settings["record_from"] = steps * step - (last + 1) * drive.period
def peak(who): return 1024 * resource.getrusage(who).ru_maxrss
pr.simulate(motor, drive, duration=1e-4, step=step)
before = peak(resource.RUSAGE_SELF)
run = pr.simulate(motor, drive, duration=steps * step, step=step, **settings)
print(json.dumps({"points": run.points, "idle_bytes": before, "peak_bytes": peak(resource.RUSAGE_SELF),
                  "ngspice_bytes": peak(resource.RUSAGE_CHILDREN), "seconds": run.solver_seconds,
                  "mean_rotor_speed_rad_s": run.mean_rotor_speed_rad_s}))
"""


def main() -> None:
    """Measure each run in a separate process, print a line for each and write all as JSON."""
    found = []
    for what, steps, settings in RUNS:
        command = [sys.executable, "-c", SCRIPT, str(steps), json.dumps(settings)]
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        row = {"recorded": what, "steps": steps, **json.loads(answer)}
        found.append(row)
        print(
            f"{steps:>10,} steps, {what}: {row['points']:,} points, peak {row['peak_bytes'] / 1e6:.0f} MB "
            f"({row['idle_bytes'] / 1e6:.0f} MB before), ngspice {row['ngspice_bytes'] / 1e6:.0f} MB",
            flush=True,
        )
    TARGET.write_text(json.dumps(found, separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
