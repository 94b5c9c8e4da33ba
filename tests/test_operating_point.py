# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs of the operating point: each gives exactly what the function of the same analysis gives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import design_driver

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR)
POINT = pr.OperatingPoint(MOTOR, DRIVE, load=pr.Load(speed=20.0))
OVER = {"drive.phase_deg": [60.0, 70.0]}

VERBS: dict[str, tuple[Callable[[], Any], Callable[[], Any], str]] = {
    "simulate": (
        lambda: POINT.simulate(1e-4, signals=["tip_x_m", "normal_force_n"]),
        lambda: pr.simulate(MOTOR, DRIVE, 1e-4, speed=20.0, signals=["tip_x_m", "normal_force_n"]),
        "normal_force_n",
    ),
    "steady": (POINT.steady, lambda: pr.steady_state(MOTOR, DRIVE, speed=20.0), "floquet_multipliers"),
    "curve": (
        lambda: POINT.curve([0.0, 10.0]),
        lambda: pr.speed_torque(MOTOR, DRIVE, speeds=[0.0, 10.0]),
        "torque_n_m",
    ),
    "map": (
        lambda: POINT.map(OVER, objective="power"),
        lambda: pr.working_points(MOTOR, DRIVE, over=OVER, objective="power", speed=20.0),
        "torque_n_m",
    ),
    "branch": (
        lambda: POINT.branch("drive.voltage", 110.0, 109.9),
        lambda: pr.steady_branch(MOTOR, DRIVE, follow="drive.voltage", start=110.0, stop=109.9, speed=20.0),
        "torque_n_m",
    ),
    "small_signals": (
        lambda: POINT.small_signals([100.0]),
        lambda: pr.small_signals(MOTOR, DRIVE, frequencies=[100.0], speed=20.0),
        "hot_admittance_s",
    ),
    "averaged": (
        lambda: POINT.averaged(2e-3),
        lambda: pr.simulate_averaged(MOTOR, DRIVE, 2e-3, speed=20.0),
        "torque_n_m",
    ),
    "design": (
        lambda: POINT.design(rail=24.0),
        lambda: design_driver(MOTOR, pr.DriverSpec(DRIVE, rail=24.0), speed=20.0),
        "feasible",
    ),
}


@pytest.mark.parametrize("verb", ["simulate", "steady", "curve", "averaged",
    pytest.param("map", marks=pytest.mark.slow),
    *(pytest.param(verb, marks=pytest.mark.soak) for verb in ("branch", "small_signals", "design")),
])  # fmt: skip
def test_a_verb_gives_exactly_what_its_function_gives(verb: str) -> None:
    by_point, by_function, name = VERBS[verb]
    ours, theirs = (np.asarray(getattr(run(), name)) for run in (by_point, by_function))
    assert ours.size
    assert np.array_equal(ours, theirs)


def test_an_updated_point_keeps_what_is_not_named() -> None:
    point = pr.OperatingPoint(MOTOR, DRIVE, contact="brush", step=1e-7, timeout=9.0, audit=False)
    there = point.updated({"drive.voltage": 60.0, "load.torque": 1e-3, "contact.friction": 0.3})
    assert isinstance(there, pr.OperatingPoint)
    assert (there.solver, there.law) == (point.solver, point.law)
    assert there.load == pr.Load(torque=1e-3)
    assert there.motor.contact.friction == 0.3
    assert point.motor.contact.friction != 0.3


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"stp": 1e-7}, "OperatingPoint: there is no argument 'stp'. Did you mean 'step'?"),
        ({"load": 20.0}, "OperatingPoint: load = 20.0 is not valid: it must be an instance of Load"),
        ({"contact": "glue"}, "contact = 'glue' is not valid"),
    ],
)
def test_a_wrong_setting_is_refused_by_its_name(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(pr.ParameterError) as refusal:
        pr.OperatingPoint(MOTOR, DRIVE, **settings)
    assert says in str(refusal.value)
