# SPDX-License-Identifier: GPL-3.0-or-later
"""The declaration of a motor's state: a run starts at the values that its vectors then have."""

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import MotorSubCircuit
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.circuit.state import Discretisation, motor_states, state_vectors
from pyspice_runner.run.kernel import transient
from pyspice_runner.run.point import Point
from tests.motors import BEAM40

STEP = 1e-12  # s: within it no state moves visibly
SPRUNG = pr.load_motor(BEAM40).updated({"rotor.bearing_friction_n_m": 1e-4})
HELD = SPRUNG.updated({"mount": None})


@pytest.mark.parametrize("motor", [SPRUNG, HELD], ids=["sprung", "held"])
@pytest.mark.parametrize("law", [Law(), Law("brush", 3), Law("coulomb"), None], ids=str)
def test_a_run_starts_at_the_values_of_its_states(motor: pr.Motor, law: Law | None) -> None:
    discretisation = Discretisation(1e-7)
    states = motor_states(motor, law)
    # different for each state, of the size of 10 nm or 10 mm/s
    start = {state.name: state.unit * 0.01 * (1.0 + 0.1 * place) for place, state in enumerate(states)}
    assert len(start) == len(states)
    bench = motor_bench(
        motor, DriveSource(pr.default_drive(motor)), law=law, discretisation=discretisation, start=start
    )
    outcome = transient(bench, state_vectors(motor, law), step=STEP, duration=2 * STEP)
    begun = {name: float(values[0]) for name, values in outcome.vectors().items()}
    found = Point.of(motor, pr.default_drive(motor), contact=law, step=discretisation.step).motion(begun)
    for state in states:
        if state.kind != "group":  # an ideal source recharges the plates
            assert found[state.name] == pytest.approx(start[state.name], rel=1e-3), state.name


def test_without_a_motion_the_start_of_a_startable_motor_is_preloaded_rest() -> None:
    text = str(MotorSubCircuit(SPRUNG, startable=True))
    head = text.splitlines()[0].split()
    starts = [word for word in head if word.startswith("start_")]
    assert starts == [f"{state.parameter}=0" for state in motor_states(SPRUNG, Law()) if state.part]
    assert "start_" not in str(MotorSubCircuit(SPRUNG))
