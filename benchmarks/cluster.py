# SPDX-License-Identifier: GPL-3.0-or-later
"""A sweep on a Dask cluster of four local workers, one of which is killed: ``python -m benchmarks.motors cluster``."""

from __future__ import annotations

import os
import signal
import tempfile
import time

import numpy as np
from dask.distributed import Client, LocalCluster

import pyspice_runner as pr

WORKERS = 4


def beginning(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> dict[str, float]:
    """Return the mean normal force in N of the first 20 µs: an analysis that takes 20 ms."""
    run = pr.simulate(motor, drive, duration=2e-5, step=2e-7)
    return {"normal_force_n": float(run.normal_force_n.mean())}


def after_a_death(points: int) -> int:
    """Run a sweep of so many points, a square; kill a worker after a quarter of them; return and print what is lost."""
    side, killed, began = round(points**0.5), list[int](), time.perf_counter()
    with (
        tempfile.TemporaryDirectory() as store,
        LocalCluster(n_workers=WORKERS, threads_per_worker=1, dashboard_address=None) as local,
        Client(local) as client,
    ):

        def end_one(done: int, _: int) -> None:
            if not killed and done > points // 4:
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
                killed.append(done)

        found = pr.sweep(
            pr.load_motor("andersen2002"), pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3),
            over={"drive.voltage": np.linspace(10.0, 50.0, side), "drive.phase_deg": np.linspace(0.0, 180.0, side)},
            quantities=["normal_force_n"], analysis=beginning, store=store, executor=client.get_executor(),
            progress=end_one,
        )  # fmt: skip
    lost = int(np.isnan(found.normal_force_n.values).sum())
    seconds = time.perf_counter() - began
    when = f"one of which was killed after {killed[0]} points" if killed else "none of which was killed"
    print(f"{side**2} points on {WORKERS} workers, {when}: {lost} lost, {seconds:.0f} s")
    return lost
