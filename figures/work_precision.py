# SPDX-License-Identifier: GPL-3.0-or-later
"""Error of a run over its wall time, with scipy's solvers and a compiled integrator, as measured by ``make bench``.

The script measures no times: it plots ``benchmarks/work_precision.json``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, canvas, main, write

MEASURED = Path(__file__).resolve().parents[1] / "benchmarks" / "work_precision.json"
LOOKS: dict[str, dict[str, Any]] = {
    "ngspice, exact at resonance": {"color": BLUE, "marker": "o", "lw": 2.0},
    "ngspice, plain": {"color": BLUE, "marker": "o", "mfc": "white", "ls": "--"},
    "Runge-Kutta, numba": {"color": BLACK, "marker": "D"},
    "RK45": {"color": ORANGE, "marker": "s"},
    "DOP853": {"color": VERMILION, "marker": "^"},
    "LSODA": {"color": GREEN, "marker": "v"},
    "Radau": {"color": PURPLE, "marker": "<"},
    "BDF": {"color": GREY, "marker": ">"},
}


def draw(folder: Path) -> list[str]:
    document = json.loads(MEASURED.read_text(encoding="utf-8"))
    figure, axes = canvas(1, 2, 5.6, sharey=True)
    found = []
    for axis, (case, rows) in zip(axes, document["cases"].items(), strict=True):
        for solver, look in LOOKS.items():
            points = [(row["seconds"], 100.0 * row["error"]) for row in rows if row["solver"] == solver]
            axis.loglog(*zip(*points, strict=True), ms=4, label=solver, **look)
        axis.axhline(0.5, color=GREY, ls=":", lw=1.0)
        axis.set(title=f"5 ms, {case}", xlabel="wall time / s")
        good = {row["solver"]: 0.0 for row in rows}
        for solver in good:
            good[solver] = min(
                (r["seconds"] for r in rows if r["solver"] == solver and r["error"] <= 0.005), default=0.0
            )
        found.append(f"{case}, error at most 0.5 %: " + ", ".join(f"{name} {s:.3f} s" for name, s in good.items() if s))
    axes[0].legend(loc="lower right", fontsize=7, ncols=2)
    axes[0].set_ylabel("error of the tip's trajectory / %")
    title = "What accuracy costs"
    caption = (
        "andersen2002; left 50 V at 51.7 kHz, 5 N; right 60 V at 17.9 kHz, 3 N, which opens. Error: RMS distance of "
        "the tip from a converged event-driven integration, over the RMS of its motion. Steps from 20 to 128 a period "
        "of the fastest motion; scipy from rtol 1e-3 on. Runge–Kutta: with events, by "
        "numba. Dotted: 0.5 %."
    )
    write(figure, folder / "work_precision.png", title, caption)
    return found


if __name__ == "__main__":
    main(draw, __doc__)
