# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor's subcircuit: self-contained, floating, copied, and true to a mode under any time step."""

import re
from math import atan, pi, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit

import pyspice_runner as pr
from pyspice_runner.circuit.bench import AC_OPTIONS, admittance_bench, motor_bench
from pyspice_runner.circuit.law import LAWS, Law, law_of
from pyspice_runner.circuit.motor import MotorSubCircuit, add_motor, dielectric_matrix, motor_library
from pyspice_runner.circuit.source import TRANSIENT_OPTIONS, DriveSource
from pyspice_runner.circuit.state import Discretisation, written
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.dielectric import lossy_capacitance
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mode
from pyspice_runner.spice.library import definitions, read_library
from pyspice_runner.spice.ngspice import BatchSimulator
from tests.circuit.batch import measured
from tests.motors import mode, motor, recommended
from tests.runs import simulated
from validation import soak

Array = NDArray[np.float64]
STEP = 1e-7


def driven(subject: Motor, drive: Drive, **settings: Any) -> Circuit:
    return motor_bench(subject, DriveSource(drive), **settings).circuit


def transient(circuit: Circuit, duration: float, *saved: str, step: float = STEP) -> dict[str, Array]:
    simulator = BatchSimulator(circuit)
    simulator.options(**TRANSIENT_OPTIONS)
    simulator.save(*saved)
    simulator.transient(step_time=step, max_time=step, end_time=duration, use_initial_condition=True)
    return {name: np.asarray(values, dtype=float) for name, values in simulator.result.raw.vectors.items()}


# --- the library that an engineer copies ---------------------------------------------------------------------


def usage(library: str) -> str:
    block = re.search(r"^\* USE[^\n]*\n(.*?)^\* END USE$", library, re.M | re.S)
    assert block
    return re.sub(r"^\*   ", "", block.group(1), flags=re.M)


@pytest.mark.parametrize("name", ["andersen2002", "off the defaults"])
def test_library_runs_with_no_other_file_and_agrees_with_simulate(name: str, tmp_path: Path) -> None:
    subject = motor() if name == "off the defaults" else pr.load_motor(name)
    library = motor_library(subject)
    found = measured(f"a motor from one file\n{library}\n{usage(library)}.end\n", tmp_path)
    run = pr.simulate(subject, pr.default_drive(subject), duration=5e-4, step=STEP, exact_resonance=False)
    at_499_us = float(np.interp(499e-6, run.time_s, run.rotor_speed_rad_s))
    # the same circuit and step; ngspice's default tolerance of 1e-3 in the example, its own steps near t = 0
    assert found["speed_rad_s"] == pytest.approx(at_499_us, rel=0.01)
    assert abs(at_499_us) > 1e-3


def test_library_is_one_file_with_the_pins_in_its_header() -> None:
    library = motor_library(motor())
    pins = re.findall(r"^\* PIN +(\w+)", library, re.M)
    (line,) = re.findall(r"^\.subckt piezomotor (.*)$", library, re.M)
    words = line.split()
    assert [word for word in words if "=" not in word] == pins == ["a", "b", "com", "shaft"]
    settable = re.findall(r"^\* PAR +(\w+)", library, re.M)
    assert settable == [word.partition("=")[0] for word in words if "=" in word]
    assert {"preload", "friction", "normal_stiffness", "inertia", "bearing", "radius"} <= set(settable)
    defined = set(re.findall(r"^\.subckt (\w+)", library, re.M))
    assert set(re.findall(r"^X\w+ .*? (piezomotor_\w+)", library, re.M)) <= defined
    code = [item for item in library.splitlines() if not item.startswith("*")]
    assert not [item for item in code if re.match(r"\.(inc|lib|global|option)", item, re.I)]
    level = 0
    for item in code:  # nothing but subcircuits, and no parameter outside of them
        level += item.startswith(".subckt")
        assert level > 0 or not item.strip(), item
        level -= item.startswith(".ends")
    assert library.count("* MODE ") == 3
    assert "turn: 66000 Hz, Q 60" in library
    assert library.isascii()


# --- the circuit ---------------------------------------------------------------------------------------------


def bench(common: str, offset: str) -> Circuit:
    """A motor off the defaults whose sources stand on its common pin."""
    circuit = Circuit("common pin")
    if common != "0":
        circuit.raw_spice += f"{offset}\n"
    circuit.V("a", "a", common, "SIN(0 60 23k)")
    circuit.V("b", "b", common, "SIN(0 40 23k 0 0 70)")
    add_motor(circuit, motor(), ("a", "b", common, "shaft"))
    return circuit


@pytest.mark.parametrize("offset", ["Voffset c 0 SIN(100 30 5k)", "Rfloat c 0 100k"])
def test_common_pin_may_float(offset: str) -> None:
    saved = ("i(va)", "i(vb)", "v(xmotor.x)", "v(xmotor.y)", "v(xmotor.normal)", "v(shaft)")
    grounded = transient(bench("0", offset), 2e-4, *saved)
    floating = transient(bench("c", offset), 2e-4, *saved)
    for name in saved:
        scale = np.abs(grounded[name]).max()
        assert scale > 0.0
        # the same equations; Newton's iteration is closed to 1e-6 of voltages that are larger by the offset, and the
        # first point is the step onto uncharged plates
        np.testing.assert_allclose(floating[name][1:], grounded[name][1:], atol=1e-4 * scale, err_msg=name)


def test_two_copies_in_one_circuit_do_the_same() -> None:
    circuit = Circuit("twins")
    for copy in ("1", "2"):
        circuit.V(f"a{copy}", f"a{copy}", circuit.gnd, "SIN(0 60 23k)")
        circuit.V(f"b{copy}", f"b{copy}", circuit.gnd, "SIN(0 40 23k 0 0 70)")
        add_motor(circuit, motor(), (f"a{copy}", f"b{copy}", circuit.gnd, f"shaft{copy}"), instance=f"motor{copy}")
    for part in ("mode", "group", "contact", "rotor"):
        assert str(circuit).count(f".subckt piezomotor_{part} ") == 1
    assert str(circuit).count(".subckt piezomotor ") == 1
    both = ("i(va{})", "i(vb{})", "v(shaft{})", "v(xmotor{}.y)")
    waves = transient(circuit, 1e-4, *(name.format(copy) for name in both for copy in "12"))
    alone = transient(bench("0", ""), 1e-4, "i(va)", "i(vb)", "v(shaft)", "v(xmotor.y)")
    for name in both:
        scale = np.abs(alone[name.format("")]).max()
        np.testing.assert_allclose(waves[name.format(1)], waves[name.format(2)], atol=1e-10 * scale)
        np.testing.assert_allclose(waves[name.format(1)], alone[name.format("")], atol=1e-5 * scale)


def test_shafts_may_be_coupled() -> None:
    circuit = Circuit("one shaft")
    for copy in ("1", "2"):
        add_motor(circuit, motor(), (circuit.gnd, circuit.gnd, circuit.gnd, "shaft"), instance=f"motor{copy}")
    circuit.I("torque", circuit.gnd, "shaft", "DC 1e-3")
    speed = transient(circuit, 2e-5, "v(shaft)")["v(shaft)"]
    # two inertias, the tips still stick: they hold the shaft back by their tangential springs
    assert 0.0 < speed[-1] <= 1e-3 * 2e-5 / (2 * 3e-6)


def test_different_motors_in_one_circuit_are_refused() -> None:
    circuit = Circuit("rivals")
    add_motor(circuit, motor(), ("a", "b", circuit.gnd, "shaft"))
    other = motor().updated({"contact.preload_n": 9.0})
    for changes in ({"motor": other}, {"law": None}, {"law": Law("brush")}, {"discretisation": Discretisation(1e-7)}):
        arguments: dict[str, Any] = {"motor": motor(), **changes}
        with pytest.raises(ParameterError) as caught:
            add_motor(circuit, arguments.pop("motor"), ("a", "b", circuit.gnd, "s2"), instance="second", **arguments)
        assert str(caught.value) == (
            "The circuit already has a different motor called piezomotor, so off the defaults cannot be its 'second'. "
            "Give the second motor another name, or the same values."
        )


def test_three_modes_show_their_closed_form_admittance() -> None:
    subject = motor()
    simulator = BatchSimulator(admittance_bench(subject, preloaded=False))
    simulator.options(**AC_OPTIONS)
    simulator.ac(variation="lin", number_of_points=400, start_frequency=10e3, stop_frequency=80e3)
    vectors = simulator.result.raw.vectors
    s = 2j * pi * vectors["frequency"].real
    couplings = [(m.coupling_a_n_per_v, m.coupling_b_n_per_v) for m in subject.modes]
    for row, into in enumerate("ab"):
        for column, driven in enumerate("ab"):
            expected = sum(
                s * theta[row] * theta[column] / (m.stiffness_n_per_m + s * m.damping_n_s_per_m + s**2 * m.mass_kg)
                for m, theta in zip(subject.modes, couplings, strict=True)
            )
            if into == driven:
                capacitance = getattr(subject.piezo, f"capacitance_{into}_f")
                branches = lossy_capacitance(capacitance, subject.piezo.loss_tangent)
                expected = expected + sum(s * c / (1.0 + s * r * c) for r, c in branches)
            found = -vectors[f"i(v{into}{column + 1})"]
            # linear circuit: what remains is ten digits in the deck, at a resonance times Q
            np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_free_tip_has_no_contact() -> None:
    free = MotorSubCircuit(motor(), law=None)
    assert "contact" not in str(free)
    assert "piezomotor_contact" not in free.parts
    assert "preload=0.0" in str(free)
    drive = pr.TwoPhaseDrive(voltage=80.0, frequency=22e3)
    waves = transient(driven(motor(), drive, law=None), 3e-4, "v(shaft)", "v(xmotor.y)", "v(xmotor.fy)")
    assert np.abs(waves["v(xmotor.y)"]).max() > 0.01  # um: it rings
    assert not waves["v(shaft)"].any()
    assert not waves["v(xmotor.fy)"].any()


def test_preloaded_motor_starts_at_rest_where_it_belongs() -> None:
    subject = motor()
    drive = pr.TwoPhaseDrive(voltage=0.0, frequency=22e3)
    waves = transient(driven(subject, drive), 1e-4, "v(xmotor.normal)", "v(xmotor.y)", "v(xmotor.state)")
    np.testing.assert_allclose(waves["v(xmotor.normal)"], 8.0, rtol=1e-6)
    deflection = 8.0 * sum(m.tip_y**2 / m.stiffness_n_per_m for m in subject.modes)
    np.testing.assert_allclose(waves["v(xmotor.y)"], -1e6 * deflection, rtol=1e-6)


def test_no_loss_is_written_as_next_to_none() -> None:
    lossless = motor().updated({"piezo.loss_tangent": 0.0})
    written = [float(value) for value in re.findall(r"loss=(\S+)", str(MotorSubCircuit(lossless)))]
    assert len(written) == 2
    assert all(0.0 < value < 2e-5 for value in written)  # far below the 1e-4 of the best ceramics


def test_decks_do_not_depend_on_the_last_digits() -> None:
    """Those of an eigenvalue differ between machines and numbers of threads."""
    subject = motor()
    nudged = subject.updated({f"modes.{m.name}.mass_kg": m.mass_kg * (1.0 + 4e-16) for m in subject.modes})
    assert nudged != subject
    assert str(MotorSubCircuit(nudged)) == str(MotorSubCircuit(subject))


@pytest.mark.parametrize("index", range(40))
def test_the_libraries_accept_every_motor_that_the_model_accepts(index: int) -> None:
    subject = soak.case(1, index).motor  # from the whole range of every parameter
    # friction that falls with the slip velocity goes with the spring-slider only
    for law in (None, *(LAWS if subject.contact.sliding_ratio == 1.0 else ("spring-slider",))):
        assert str(MotorSubCircuit(subject, law=law_of(law))).count("piezomotor_mode") == len(subject.modes)


# --- a mode under the trapezoidal rule -----------------------------------------------------------------------


@settings(max_examples=50, deadline=None)
@given(frequency=st.floats(1e3, 1e6), points=st.floats(5.0, 500.0), quality=st.floats(1.0, 1e4))
def test_adapted_mode_resonates_where_the_rule_sees_it_right(frequency: float, points: float, quality: float) -> None:
    subject = mode("m", frequency, 0.003, quality)
    step = 1.0 / (points * frequency)
    mass, stiffness = written(subject, Discretisation(step))
    omega = 2.0 * pi * frequency
    assert (2.0 / step) * atan(np.sqrt(stiffness / mass) * step / 2.0) == pytest.approx(omega, rel=1e-12)
    # The rule replaces jω by (2j/h) tan(ωh/2) =: jw, and the arm's impedance at ω is to be c, its slope there 2jm:
    # with Z(w) = c + j(m'w − k'/w), dw/dω = 1/cos²(ωh/2)
    w = (2.0 / step) * tan(omega * step / 2.0)
    assert mass * w - stiffness / w == pytest.approx(0.0, abs=1e-9 * mass * w)
    slope = (mass + stiffness / w**2) / np.cos(omega * step / 2.0) ** 2
    assert slope == pytest.approx(2.0 * subject.mass_kg, rel=1e-9)
    assert written(subject, Discretisation(step, exact_resonance=False)) == (subject.mass_kg, subject.stiffness_n_per_m)
    assert Discretisation(step).slider_time == step / 2.0


def ring(subject: Mode, step: float, periods: int, exact: bool) -> tuple[Array, Array]:
    """Release one mode from a deflection of −1 µm; return time and displacement in µm."""
    mass, stiffness = written(subject, Discretisation(step, exact_resonance=exact))
    circuit = Circuit("one free mode")
    circuit.raw_spice = definitions(read_library("piezomotor_mode"), read_library("piezomotor_tip")) + "\n"
    ends = ("force", "damped", "velocity", "elastic")
    spring = {"stiffness": stiffness, "damping": subject.damping_n_s_per_m, "preload": 1e-6 * stiffness}
    circuit.X("mode", "piezomotor_mode", 0, 0, 0, *ends, 0, mass=mass, **spring)
    circuit.X("tip", "piezomotor_tip", "force", "velocity", "elastic", 0, 0, "x", "y", "vx", "vy", stiffness=stiffness)
    for node in ("x", "y", "vx", "vy"):
        circuit.R(node, node, circuit.gnd, 1)
    waves = transient(circuit, periods / subject.frequency_hz, "v(y)", step=step)
    return waves["time"], waves["v(y)"]


@pytest.mark.parametrize("points", [12, 31])
def test_free_vibration_keeps_its_frequency_over_many_periods(points: int) -> None:
    subject = mode("m", 37e3, 0.0017, 1e5)
    step, periods = 1.0 / (points * 37e3), 150
    omega = 2.0 * pi * 37e3
    seen = (2.0 / step) * atan(omega * step / 2.0)  # what the trapezoidal rule makes of ω

    def phase(exact: bool) -> float:
        """Phase in degrees by which the last ten periods lag behind cos ωt."""
        time, y = ring(subject, step, periods, exact)
        late = time > (periods - 10) / 37e3
        columns = np.column_stack([np.cos(omega * time[late]), np.sin(omega * time[late])])
        cosine, sine = np.linalg.lstsq(columns, -y[late], rcond=None)[0]
        if exact:
            # Q = 1e5 leaves 0.5 % of decay; ngspice's first step is backward Euler and a tenth of the others
            assert np.hypot(cosine, sine) == pytest.approx(1.0, abs=0.01)
        return float(np.degrees(np.arctan2(sine, cosine)))

    lag = np.degrees((omega - seen) * (periods - 5) / 37e3)  # in the middle of the ten periods
    assert lag > 40.0
    # the first, shorter steps count less than half a step of 30° or 12°, with a rule that is not exact for them
    assert phase(exact=True) == pytest.approx(0.0, abs=2.0)
    assert (phase(exact=False) - lag + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=2.0)


# --- the feedback electrode: a third group, passive ------------------------------------------------------------

FLAGSHIP, DRIVE = recommended("bimodal40")
MATCHED = 1.0 / (2.0 * np.pi * DRIVE.frequency * 3e-10)  # ohm, at which the electrode takes the most power


def sensed(**values: Any) -> Motor:
    """Return the flagship with an electrode that senses a tenth of what group A drives."""
    couplings = {mode.name: 0.1 * mode.coupling_a_n_per_v for mode in FLAGSHIP.modes}
    return FLAGSHIP.updated({"feedback": {"capacitance_f": 3e-10, "couplings_n_per_v": couplings, **values}})


def test_an_open_electrode_has_the_voltage_of_its_charge_and_the_shares_of_the_groups() -> None:
    subject = sensed(resistance_ohm=1e9, share_a=0.2, share_b=-0.1)
    state = pr.steady_state(subject, DRIVE, speed=8.0)
    plant, trace, waves = state.solution.plant, state.solution.trace, state.waveforms  # type: ignore[union-attr]
    charge = -subject.stator.sensed @ trace.states[: plant.modes]  # type: ignore[union-attr]
    shared = 0.2 * waves.voltage_a_v - 0.1 * waves.voltage_b_v  # type: ignore[union-attr]
    own = waves.feedback_v - shared  # type: ignore[union-attr]
    assert np.ptp(own) == pytest.approx(np.ptp(charge) / 3e-10, rel=2e-3)  # by the step of the period: 1e-3
    window = {"record_from": 19e-3, "signals": ["voltage_a_v", "feedback_v"]}
    run = simulated(subject, DRIVE, duration=20e-3, speed=8.0, **window)
    for name, value in state.sensed().items():  # from rest, by another time step
        assert run.sensed()[name] == pytest.approx(value, rel=5e-3)


@pytest.mark.parametrize("drive", [DRIVE, pr.Driver("linear", voltage=100.0, frequency=40.7e3, phase_deg=90.0)])
def test_the_energy_balance_counts_what_the_resistance_takes(drive: Any) -> None:
    subject = sensed(resistance_ohm=MATCHED, share_a=0.2)
    state = pr.steady_state(subject, drive, speed=8.0)
    taken = state.sensed()["feedback_amplitude_v"] ** 2 / (2.0 * MATCHED) / (state.power_a_w + state.power_b_w)
    assert taken > 0.02
    assert abs(state.balance_residual) < 0.05 * taken
    assert state.waveforms.energy_residual < 0.05 * taken  # type: ignore[union-attr]
    if drive is DRIVE:
        assert simulated(subject, drive, duration=1e-3).energy_residual < 0.05 * taken
        settled = pr.speed_torque(subject, drive, speeds=[8.0], mode="settle", tolerance=0.01)
        assert abs(float(settled["balance_residual"][0])) < 0.1 * taken
        assert float(settled["torque_n_m"][0]) == pytest.approx(state.torque_n_m, rel=0.02)


def test_a_part_of_group_a_that_is_cut_off_and_connected_to_it_changes_nothing() -> None:
    part, own = 0.1, FLAGSHIP.piezo.capacitance_a_f
    changes: dict[str, Any] = {"name": "cut", "piezo.capacitance_a_f": (1.0 - part) * own}
    for index, one in enumerate(FLAGSHIP.modes):
        changes[f"modes.{index}.coupling_a_n_per_v"] = (1.0 - part) * one.coupling_a_n_per_v
    cut, circuit = sensed(capacitance_f=part * own).updated(changes), Circuit("both motors")
    for number, subject, more in ((1, FLAGSHIP, {}), (2, cut, {"a2": {"amplifier": 1e12}})):
        circuit.V(f"a{number}", f"a{number}", circuit.gnd, "DC 0 AC 1")
        pins = (f"a{number}", circuit.gnd, circuit.gnd, f"shaft{number}", *more)
        own_name = {"instance": f"m{number}", "name": f"motor{number}", "settings": more.get("a2")}
        add_motor(circuit, subject, pins, law=None, sensed=True, **own_name)
    simulator = BatchSimulator(circuit)
    simulator.options(**AC_OPTIONS)
    simulator.save("i(va1)", "i(va2)", "v(xm1.vy)", "v(xm2.vy)")
    simulator.ac(start_frequency=30e3, stop_frequency=50e3, number_of_points=41, variation="lin")
    found = simulator.result.raw.vectors  # type: ignore[union-attr]
    assert found["v(xm2.vy)"] == pytest.approx(found["v(xm1.vy)"], rel=1e-9)
    hertz = np.real(found["frequency"])
    # without the capacitances, of which the electrode's has no loss
    clamped = [np.array([dielectric_matrix(one, at)[0, 0] for at in hertz.tolist()]) for one in (FLAGSHIP, cut)]
    clamped[1] += 2j * np.pi * hertz * part * own
    whole, both = (-found[f"i(va{number})"] - clamped[number - 1] for number in (1, 2))
    assert both == pytest.approx(whole, abs=1e-9 * np.abs(whole).max())


def test_an_exported_library_has_the_pin_and_runs(tmp_path: Path) -> None:
    deck = (
        f"an electrode\n{motor_library(sensed(share_a=0.2))}\nVa a 0 SIN(0 100 40.7k)\nVb b 0 SIN(0 100 40.7k 0 0 90)\n"
        "Xmotor a b 0 shaft f piezomotor\n.tran 100n 300u 0 100n uic\n"
        ".measure tran sensed MAX v(f) FROM=200u TO=300u\n.measure tran check MAX v(xmotor.check)\n.end\n"
    )
    found = measured(deck, tmp_path)
    run = pr.simulate(sensed(share_a=0.2), DRIVE, 300e-6, step=1e-7, exact_resonance=False)
    assert found["sensed"] == pytest.approx(run.feedback_v[run.time_s > 200e-6].max(), rel=0.01)
    assert found["check"] == pytest.approx(0.0, abs=1e-6)


def test_an_electrode_that_is_not_possible_is_refused_and_what_has_none_says_so(tmp_path: Path) -> None:
    for coupling, words in (("mode-9", "which is no mode: they are mode-1"), ("mode-3", "k_eff² above 0.9")):
        with pytest.raises(ParameterError, match=words):
            sensed(couplings_n_per_v={coupling: 10.0})
    with pytest.raises(ParameterError, match=r"A \.va file has no feedback electrode"):
        pr.export_motor(sensed(), tmp_path / "motor.va")
    with pytest.raises(ParameterError, match="loads the electrode below"):
        pr.export_motor(sensed(resistance_ohm=1e3), tmp_path / "motor.fmu")


def test_an_open_electrode_stiffens_and_couples_the_modes_that_it_senses() -> None:
    """The averaged motor takes it so: the admittance of the groups is that on a large resistance."""
    motor = sensed(resistance_ohm=1e9, couplings_n_per_v={"mode-3": 0.02, "mode-4": -0.03})
    omega = 2.0 * np.pi * np.linspace(39e3, 41.5e3, 101)
    opened = motor.with_open_electrode
    assert opened.feedback is None
    ours, full = (one.stator.admittance(omega) for one in (opened, motor))
    assert np.abs(ours - full).max() < 1e-3 * np.abs(full).max()  # what the damping couples is left out
    assert np.abs(motor.updated({"feedback": None}).stator.admittance(omega) - full).max() > 0.1 * np.abs(full).max()
