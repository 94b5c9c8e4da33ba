# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers and plotted quantities that a run leaves out of its circuit, against the nodes of the libraries."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.evaluated import LINE, powers_of
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import MotorSubCircuit
from pyspice_runner.circuit.source import GROUPS, DriveSource
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.run.kernel import transient
from pyspice_runner.spice.library import library_names, read_library
from tests.drivers.test_driver import KINDS, NETWORKS, driver
from tests.selection import mostly

PARTS = [name for name in library_names() if read_library(name).losses or read_library(name).stores]


@pytest.mark.parametrize("name", [name for name in PARTS if name.startswith("driver_")])
def test_every_loss_feed_and_store_of_a_header_is_a_power(name: str) -> None:
    library = read_library(name)
    values = {parameter.name: parameter.default for parameter in library.parameters}
    found = dict(powers_of(library, "xpart", dict.fromkeys(library.pin_names, "0"), values))
    kinds = {"loss": library.losses, "feed": library.feeds, "store": library.stores, "limit": library.limits}
    assert found.keys() == {f"v(xpart.{kind}_{entry})" for kind, entries in kinds.items() for entry, _ in entries}


@pytest.mark.parametrize("network", mostly(pytest.mark.soak, NETWORKS, ["llcc"]))  # which has all kinds of parts
@pytest.mark.parametrize("kind", mostly(pytest.mark.soak, KINDS, ["full-bridge"]))
def test_powers_are_those_of_the_nodes_that_the_circuit_leaves_out(kind: str, network: str) -> None:
    """Within the tolerance of the solver, which the nodes have and the evaluated expressions do not need."""
    motor, source = pr.load_motor("andersen2002"), driver(kind, network=network)
    vectors = [name for group in GROUPS for part in source.parts(group) for name in part.power_vectors]
    recorded = [*vectors, *dict.fromkeys(name for power in source.powers.values() for name in power.terms)]
    run = transient(motor_bench(motor, source, plotted=True), recorded, step=1e-7, duration=1e-4).vectors()
    for name in vectors:
        scale = float(np.abs(run[name]).max())
        assert source.powers[name].of(run) == pytest.approx(run[name], rel=1e-3, abs=1e-3 * scale + 1e-4), name


def test_a_run_leaves_the_powers_out_and_a_deck_to_plot_has_them() -> None:
    motor, source = pr.load_motor("andersen2002"), driver("half-bridge", network="llcc")
    plain, plotted = (str(motor_bench(motor, source, plotted=with_nodes).circuit) for with_nodes in (False, True))
    assert not LINE.search(plain)
    assert len(LINE.findall(plotted)) == 4 + 4  # of a half bridge and of an LLCC


def test_powers_of_a_stage_of_the_user_stay_in_the_circuit() -> None:
    path = Path(__file__).parents[2] / "examples" / "drivers" / "my_drivers.lib"
    source = driver(f"{path}:generator")
    assert not source.powers


# --- what only serves a plot of a brush ---


@pytest.mark.parametrize(("sliders", "flat"), [(1, 0.0), (5, 40e-6)])
def test_slider_and_state_of_a_brush_are_those_of_its_circuit(sliders: int, flat: float) -> None:
    motor, law = pr.load_motor("bimodal40").updated({"contact.worn_flat_radius_m": flat}), Law("brush", sliders)
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    step = Discretisation(2e-7)
    bench = motor_bench(motor, DriveSource(drive), law=law, discretisation=step)
    whole = MotorSubCircuit(motor, law=law, discretisation=step)
    text = str(bench.circuit)
    assert "Bslips" not in text
    assert "Bslips" in whole.parts
    full = motor_bench(motor, DriveSource(drive), law=law, discretisation=step)
    lean = MotorSubCircuit(motor, law=law, discretisation=step, plotted=False)
    full.circuit.raw_spice = full.circuit.raw_spice.replace(lean.parts, whole.parts)
    names = ["v(xmotor.slider)", "v(xmotor.state)"]
    runs = [transient(each, names, step=2e-7, duration=3e-4) for each in (bench, replace(full, signals={}))]
    computed, in_circuit = (run.vectors() for run in runs)
    for name in names:
        assert np.ptp(in_circuit[name]) > 0.02
        # the iteration of the circuit ends at 1e-6 of a value
        np.testing.assert_allclose(computed[name], in_circuit[name], atol=1e-5 * np.abs(in_circuit[name]).max())
