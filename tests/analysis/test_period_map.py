# SPDX-License-Identifier: GPL-3.0-or-later
"""Many motors in the decks of a period map, which run side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.analysis import period_map, steady
from pyspice_runner.analysis.period_map import PeriodMap
from pyspice_runner.analysis.shooting import start_point
from pyspice_runner.errors import SimulationError
from pyspice_runner.model.drive import Load
from pyspice_runner.netlist.contact import Law
from pyspice_runner.netlist.copies import Copy, Plant, copies_bench


def plants(friction: Sequence[float]) -> list[Plant]:
    """Return plants whose motors differ in the friction, each with objects of its own."""
    found = []
    for value in friction:
        motor = pr.load_motor("andersen2002").updated({"contact.friction": float(value)})
        drive = pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3, phase_deg=90.0)
        found.append(Plant(motor, drive, Load(3.0), Law()))
    return found


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.soak), 2])
def test_many_motors_need_no_second_attempt(monkeypatch: pytest.MonkeyPatch, workers: int) -> None:
    monkeypatch.setattr(period_map, "cores", lambda: workers)
    monkeypatch.setattr(steady, "cores", lambda: workers)
    decks: list[int] = []
    run = PeriodMap._run

    def counted(self: PeriodMap, copies: Sequence[Copy], duration: float, whole: bool) -> object:
        try:
            return run(self, copies, duration, whole)
        except (SimulationError, period_map._Uneven) as error:  # PeriodMap would repeat the deck in halves
            pytest.fail(f"a deck of {len(copies)} copies failed: {error}")
        finally:
            decks.append(len(copies))

    monkeypatch.setattr(PeriodMap, "_run", counted)
    found = pr.working_points(
        pr.load_motor("andersen2002"), pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3, phase_deg=90.0),
        over={"contact.friction": np.linspace(0.15, 0.35, 40)}, speed=3.0,
    )  # fmt: skip
    assert found.converged.all()
    assert len(decks) > 10


def test_motors_share_names_by_their_values() -> None:
    one, same, other = plants([0.2, 0.2, 0.3])
    assert one.motor is not same.motor
    assert one.motor_name == same.motor_name != other.motor_name
    assert one.curve == same.curve != other.curve


def test_a_deck_has_each_subcircuit_once() -> None:
    mapped = PeriodMap(1.0 / 51.7e3, 128)
    copies = [Copy(plant, start_point(plant).state) for plant in plants([0.2, 0.2, 0.3])]
    text = str(copies_bench(copies, mapped.discretisation).circuit)
    names = [line.split()[1] for line in text.splitlines() if line.startswith(".subckt")]
    assert len(names) == len(set(names))
    assert len([name for name in names if name.startswith("motor_")]) == 2


def test_a_period_after_others_continues_their_run() -> None:
    """The free stator decays: r'' + 2ar' + w²r = 0, by exp(-aT) in each period, for any start."""
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=0.0, frequency=51.7e3)
    plant, after = Plant(motor, drive, Load(0.0), None), 40
    start = np.zeros(plant.order)
    start[: plant.modes] = 1e-6
    early, late = (PeriodMap(drive.period, 128).traces([Copy(plant, start)], count)[0] for count in (0, after))
    assert early is not None
    assert late is not None
    for place, mode in enumerate(motor.modes):
        rate, omega = mode.damping_n_s_per_m / (2.0 * mode.mass_kg), 2.0 * np.pi * mode.frequency_hz
        at = late.time - early.time[0]
        angle = np.sqrt(omega**2 - rate**2)
        r, v = early.states[[place, plant.modes + place], 0]
        free = np.exp(-rate * at) * (r * np.cos(angle * at) + (v + rate * r) / angle * np.sin(angle * at))
        # ngspice's relative tolerance is 1e-4; the steps of the two runs lie differently
        assert np.abs(late.states[place] - free).max() < 1e-3 * np.abs(free).max()
