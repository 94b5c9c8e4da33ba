# SPDX-License-Identifier: GPL-3.0-or-later
"""Many motors in the decks of a period map, which run side by side."""

from collections.abc import Sequence

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.errors import SimulationError
from pyspice_runner.motor.drive import Load
from pyspice_runner.steady import period_map, steady
from pyspice_runner.steady.copies import Copy, Plant, copies_bench
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import start_point


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


@pytest.mark.parametrize("flat", [0.0, 2e-5])
@pytest.mark.parametrize("guess", ["exact", "too few"])
def test_sliders_that_touch_nothing_are_left_out_of_the_circuit(flat: float, guess: str) -> None:
    """They carry no force, so that the period is the same; all are in the circuit if the contact reaches further."""
    motor = pr.load_motor("andersen2002").updated({"mount": None, "contact.worn_flat_radius_m": flat})
    plant = Plant(motor, pr.TwoPhaseDrive(voltage=200.0, frequency=51.7e3, phase_deg=90.0), Load(3.0), Law("brush", 8))
    point = start_point(plant)
    (whole,) = PeriodMap(plant.drive.period, 64).traces([point.copy(point.state)])
    assert 1 < whole.reach < 8
    assert not whole.states[plant.places["contact"]][whole.reach :].any()
    assert whole.states[plant.places["contact"]][whole.reach - 1].any()
    point.reach = whole.reach if guess == "exact" else 1
    (part,) = PeriodMap(plant.drive.period, 64).traces([point.copy(point.state)])
    assert part.reach == whole.reach
    assert part.course.plant.order == plant.order - (8 - whole.reach if guess == "exact" else 0)
    # ngspice iterates to 1e-6
    assert (np.abs(part.states - whole.states).max(axis=1) <= 1e-6 * point.scale).all()
    for name in ("normal", "friction", "contact_state", "slider_um", "penetration_um"):
        one, other = getattr(part, name), getattr(whole, name)
        assert one == pytest.approx(other, abs=1e-5 * np.abs(other).max())
