# SPDX-License-Identifier: GPL-3.0-or-later
"""Analyses for sweeps that take no time, and some that fail; in a module, so that workers find them by name."""

import os
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

import pyspice_runner as pr
from pyspice_runner.motor.drive import Drive


def formula(motor: pr.Motor, drive: Drive, *, duration: float, speed: float = 0.0) -> dict[str, Any]:
    """A made-up motor, whose torque tells the parameters apart; what it was given is in it too."""
    torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m * (1.0 - 0.1 * speed)
    return {
        "torque_n_m": torque,
        "shares": {"stick": 0.25, "slip": 0.75},
        "settled": True,
        "solver_seconds": time.perf_counter(),
        "voltage_v": drive.model_dump()["voltage"],
        "duration_s": duration,
        "motor": motor.to_dict(),
        "deck_sha256": f"{torque!r}",
    }


def fails_above_8_n(motor: pr.Motor, drive: Drive, **run: float) -> dict[str, Any]:
    """Fails as a simulator does, its deck kept, above a preload of 8 N; with a programmer's error above 20 N."""
    if motor.contact.preload_n > 20.0:
        return {"torque_n_m": formula(motor, drive, **run)["torque"]}
    if motor.contact.preload_n > 8.0:
        deck = Path(tempfile.mkdtemp(prefix="piezomotor-")) / "deck.cir"
        deck.touch()
        raise pr.SimulationError(f"ngspice gave up. The netlist is kept as {deck}.", deck=deck)
    return formula(motor, drive, **run)


def refuses(motor: pr.Motor, drive: Drive, *, duration: float) -> dict[str, Any]:
    """Raises an error for every input."""
    raise pr.ParameterError(f"duration = {duration:g} s is not valid for {motor.name} and {drive.label}.")


def kills_its_worker_at_7_n(motor: pr.Motor, drive: Drive, **run: float) -> dict[str, Any]:
    """Takes its worker down at a preload of 7 N, whenever it is tried."""
    if motor.contact.preload_n == 7.0:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return formula(motor, drive, **run)


def kills_one_worker(motor: pr.Motor, drive: Drive, *, mark: str, **run: float) -> dict[str, Any]:
    """Takes its worker down if it is the first of all, by the file that it leaves."""
    try:
        Path(mark).open("x", encoding="utf-8").close()
    except FileExistsError:
        return formula(motor, drive, **run)
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def power(point: dict[str, Any]) -> float:
    """A quantity of one's own."""
    return float(2.0 * point["torque_n_m"])
