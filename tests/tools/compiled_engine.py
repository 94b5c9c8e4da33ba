# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled engine against the B-sources, and the traps of compiler and ngspice 46. ``make verilog-a``."""

from __future__ import annotations

import resource
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit import compiled
from pyspice_runner.circuit.law import Law
from pyspice_runner.run import engines
from pyspice_runner.run.kernel import modules_folder
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.spice.openvaf import compile_module, find_osdi_ngspice

MOTOR = pr.load_motor("beam40")
DRIVE = pr.default_drive(MOTOR)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No verdict or module of another test is used."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache with a space"))
    forget()
    yield
    forget()


def forget() -> None:
    for known in (compiled._module, engines._verdict):
        known.cache_clear()


def away(name: str, one: Waveforms, other: Waveforms) -> float:
    """RMS distance of a signal in two runs over its size; ngspice 46 divides the last step."""
    inside = one.time_s < other.time_s[-3]
    expected = getattr(one, name)[inside]
    found = np.interp(one.time_s[inside], other.time_s, getattr(other, name))
    size = float(np.sqrt(np.mean(expected**2))) or 1.0  # the slider of Coulomb friction is 0
    return float(np.sqrt(np.mean((found - expected) ** 2))) / size


# --- the engine ---

CASES: dict[str, tuple[pr.Motor, dict[str, Any]]] = {
    "free shaft": (MOTOR, {}),
    "load": (MOTOR, {"load_torque": 5e-3}),
    "held shaft": (MOTOR, {"speed": 5.0}),
    "three modes": (pr.load_motor("andersen2002-unintended-mode"), {}),
    "recoil": (MOTOR.updated({"modes.0.recoil_kg": 3.9e-3, "modes.1.recoil_kg": 2e-3}), {}),
    "recoil along the rotor": (
        MOTOR.updated(
            {
                "modes.0.recoil_kg": 2e-3,
                "modes.1.recoil_x_kg": 0.02,
                "modes.1.recoil_kg": 5e-3,
                "mount.tangential_stiffness_n_per_m": 1e5,
                "mount.tangential_damping_n_s_per_m": 50.0,
            }
        ),
        {},
    ),
    "capacitance between the groups": (MOTOR.updated({"piezo.capacitance_ab_f": 2e-10}), {}),
    "fixed distance": (pr.load_motor("andersen2002").updated({"mount": None}), {}),
    "damping and a compliance in series": (pr.load_motor("bimodal40"), {"speed": 20.0}),
    "Coulomb friction": (MOTOR, {"contact": "coulomb"}),
    "brush": (MOTOR, {"contact": "brush"}),
    "brush of three sliders": (MOTOR, {"contact": pr.Law("brush", 3)}),
    "dry bearing": (MOTOR.updated({"rotor.bearing_friction_n_m": 1e-3}), {}),
    "tip bent sideways": (MOTOR.updated({"modes.0.tip_x": 0.2, "modes.1.tip_y": 0.5}), {}),
}


@pytest.mark.parametrize("case", CASES)
def test_the_compiled_engine_gives_the_run_of_the_b_sources(case: str) -> None:
    """Both take the same steps by the same rule; Newton's iteration ends at a relative change of 1e-6."""
    motor, settings = CASES[case]
    drive = pr.default_drive(motor)
    runs = [pr.simulate(motor, drive, duration=1e-3, engine=engine, **settings) for engine in ("spice", "compiled")]
    for name in runs[0].recorded[1:]:
        assert away(name, *runs) < 3e-4, name
    assert runs[1].energy_residual == pytest.approx(runs[0].energy_residual, rel=0.05, abs=1e-6)
    assert runs[1].error_estimate == pytest.approx(runs[0].error_estimate or 0.0, rel=0.05)
    assert [run.to_dict()["run"]["engine"] for run in runs] == ["spice", "compiled"]
    assert int(runs[1].ngspice_version) >= 46
    states = [np.array(run.final_state.displacements_m) for run in runs if run.final_state]
    assert states[1] == pytest.approx(states[0], rel=1e-3, abs=1e-3 * np.abs(states[0]).max())


def test_a_driver_runs_with_the_compiled_motor() -> None:
    driver = pr.Driver(kind="linear", voltage=110.0, frequency=40.1e3, phase_deg=120.0)
    runs = [pr.simulate(MOTOR, driver, duration=1e-3, engine=engine) for engine in ("spice", "compiled")]
    assert runs[1].mean_rotor_speed_rad_s == pytest.approx(runs[0].mean_rotor_speed_rad_s, rel=1e-4)


@pytest.mark.parametrize(
    "settings",
    [
        {"speed": 2.0},
        {"load_torque": 1e-4},
        {"speed": 1.0, "contact": "coulomb"},
        {"speed": 2.0, "contact": pr.Law("brush", 3)},
    ],
)
def test_the_steady_state_is_that_of_the_b_sources(settings: dict[str, Any]) -> None:
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=200.0, frequency=51.7e3, phase_deg=90.0)
    expected, found = (pr.steady_state(motor, drive, engine=engine, **settings) for engine in ("spice", "compiled"))
    scale = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    # Newton's method ends at a step of 1e-4; what that leaves of the torque turns a free shaft by more than itself
    assert found.torque_n_m == pytest.approx(expected.torque_n_m, abs=(1e-5 if "speed" in settings else 1e-4) * scale)
    assert found.speed_rad_s == pytest.approx(expected.speed_rad_s, rel=2e-3)
    multipliers = [np.sort(np.abs(state.floquet_multipliers)) for state in (expected, found)]
    assert multipliers[1] == pytest.approx(multipliers[0], abs=1e-4)
    assert found.to_dict()["run"]["engine"] == "compiled"


def test_a_curve_and_a_sweep_take_the_compiled_engine(tmp_path: Path) -> None:
    speeds = [-5.0, 5.0, 15.0]
    curves = [pr.speed_torque(MOTOR, DRIVE, speeds=speeds, engine=engine) for engine in ("spice", "compiled")]
    assert curves[1]["torque_n_m"].values == pytest.approx(curves[0]["torque_n_m"].values, rel=1e-4)
    assert '"engine": "compiled"' in curves[1].attrs["run"]
    over = {"drive.voltage": [80.0, 110.0]}
    swept = [
        pr.sweep(MOTOR, DRIVE, over=over, duration=5e-4, engine=engine, store=tmp_path / "store", workers=1)
        for engine in ("spice", "compiled")
    ]
    speeds_found = [one["mean_rotor_speed_rad_s"].values for one in swept]
    assert speeds_found[1] == pytest.approx(speeds_found[0], rel=1e-3)
    assert len(list((tmp_path / "store").glob("*/*.json"))) == 4  # each engine has its own points


# --- what is verified ---


@pytest.mark.parametrize("modes", [1, 2, 3])
@pytest.mark.parametrize("law", ["spring-slider", "coulomb", "brush"])
def test_the_comparison_passes_by_far(modes: int, law: str) -> None:
    motor = {1: MOTOR.model_copy(update={"modes": MOTOR.modes[:1]}), 2: MOTOR, 3: CASES["three modes"][0]}[modes]
    found = engines.verdict(motor, Law(law))
    assert max(found.values()) < 0.3 * engines.TOLERANCE  # measured: at most 5e-5


def test_a_verdict_is_kept_and_belongs_to_its_module(monkeypatch: pytest.MonkeyPatch) -> None:
    first = engines.verdict(MOTOR, Law())
    monkeypatch.setattr(engines, "_compared", lambda *_: pytest.fail("compared again"))
    engines._verdict.cache_clear()
    assert engines.verdict(MOTOR, Law()) == first
    forget()
    plant(monkeypatch, "heat = 0.0;\n", "heat = 0.0; // another text\n")
    with pytest.raises(pytest.fail.Exception, match="compared again"):
        engines.verdict(MOTOR, Law())


def plant(monkeypatch: pytest.MonkeyPatch, old: str, new: str) -> None:
    """Change the module, as a compiler would that makes something else of it."""
    text = compiled.module_source
    assert old in text(2, Law())
    monkeypatch.setattr(compiled, "module_source", lambda *of, **how: text(*of, **how).replace(old, new, 1))


WRONG = {
    "a constant before ddt is lost": ("ddt(1e-06 * V(slider))", "ddt(1.05e-06 * V(slider))"),
    "mass": ("ddt(mass_2 * V(velocity_2)", "ddt(1.01 * mass_2 * V(velocity_2)"),
    "capacitance": ("ddt((capacitance) * V(plate, com))", "ddt(0.999 * (capacitance) * V(plate, com))"),
    "inertia": ("ddt(inertia * V(shaft))", "ddt(1.01 * inertia * V(shaft))"),
    "softening": ("1e-12 * softening_1", "0.9e-12 * softening_1"),
    "friction": ("tangential = contact_grip /", "tangential = 1.01 * contact_grip /"),
    "mount": ("ddt(mount_mass * V(carrier_velocity)", "ddt(1.05 * mount_mass * V(carrier_velocity)"),
    "recoil on the carrier": ("recoil = recoil + recoil_1 *", "recoil = recoil + 1.3 * recoil_1 *"),
    "recoil on the mode": ("+ recoil_2 * rise +", "+ 1.3 * recoil_2 * rise +"),
    "dry bearing": ("ddt(bearing_angle * V(share))", "ddt(1.3 * bearing_angle * V(share))"),
}


@pytest.mark.parametrize("term", WRONG)
def test_a_wrong_compile_fails_the_comparison_and_is_not_used(term: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenVAF has been seen to compile ``I(n) <+ 1e-6*ddt(V(n))`` to wrong dynamics; the present one does not, see
    below. So a wrong factor is planted into the text instead, from which the compiler makes a module that loads and
    runs without a message."""
    plant(monkeypatch, *WRONG[term])
    motor = MOTOR.updated({"rotor.bearing_friction_n_m": 1e-4})
    with pytest.raises(
        pr.SimulationError, match=r"does not move as the B-sources do: .* generates wrong code for the module"
    ):
        pr.simulate(motor, DRIVE, duration=1e-4, engine="compiled")
    run = pr.simulate(motor, DRIVE, duration=1e-4, engine="auto")
    assert run.to_dict()["run"]["engine"] == "spice"


@pytest.mark.parametrize("changes", [{}, {"rotor.bearing_friction_n_m": 1e-3}])
def test_auto_is_right_where_the_compiler_itself_makes_wrong_code(changes: dict[str, float]) -> None:
    """OpenVAF osdi_0.5_20260820 makes wrong code, at every optimisation level, of a brush of four sliders on a mount.

    With three or eight sliders, or without the mount, it does not; a later compiler may be right in all cases.
    """
    motor = MOTOR.updated(changes)
    settings: dict[str, Any] = {"duration": 3e-4, "contact": pr.Law("brush", 4)}
    expected = pr.simulate(motor, DRIVE, **settings)
    found = pr.simulate(motor, DRIVE, engine="auto", **settings)
    assert away("rotor_speed_rad_s", expected, found) < 3e-4
    if found.to_dict()["run"]["engine"] == "spice":
        with pytest.raises(pr.SimulationError, match="generates wrong code for the module"):
            pr.simulate(motor, DRIVE, engine="compiled", **settings)


def test_a_constant_before_ddt_is_seen_by_the_comparison_whatever_the_compiler_makes_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One version of OpenVAF compiles this form to wrong code; the module itself avoids the form."""
    plant(monkeypatch, "ddt(1e-6 * V(displacement_1))", "1e-6 * ddt(V(displacement_1))")
    worst = max(engines.verdict(MOTOR, Law()).values())
    assert (worst <= engines.TOLERANCE) == (worst < 0.3 * engines.TOLERANCE)  # right or wrong, with nothing between


# --- ngspice 46 ---


def test_eight_threads_make_a_run_slow_and_a_deck_asks_for_one() -> None:
    """Processor time, which does not depend on what else the machine does."""
    deck = pr.simulate(MOTOR, DRIVE, duration=2e-4, engine="compiled").deck
    assert "set num_threads=1" in deck

    def seconds(text: str, folder: Path) -> float:
        module = compiled.module_of(MOTOR, Law())
        folder.mkdir(parents=True)
        (folder / module.file).symlink_to(compile_module(module.name, module.source, modules_folder()))
        (folder / "deck.cir").write_text(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [find_osdi_ngspice(), "-b", "-n", "-r", "out.raw", "deck.cir"], cwd=folder, check=True,
            capture_output=True, timeout=300,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    scratch = modules_folder() / "threads"
    assert seconds(deck.replace("set num_threads=1\n", ""), scratch / "8") > 2.0 * seconds(deck, scratch / "1")


def test_an_inner_node_takes_no_initial_voltage_and_a_port_does(tmp_path: Path) -> None:
    source = """`include "disciplines.vams"
module relaxing(pin{port}); inout pin{port}; electrical pin, inner;
    analog begin
        I(inner) <+ ddt(1e-6 * V(inner)) + 1e-3 * V(inner);
        I(pin) <+ V(pin) - V(inner);
    end
endmodule
"""
    found = {}
    for name, port in (("inner", ""), ("port", ", inner")):
        module = compile_module("relaxing", source.replace("{port}", port), tmp_path / name)
        nodes, at = ("pin", "n1#inner") if name == "inner" else ("pin inner", "inner")
        (module.parent / "deck.cir").write_text(
            f"relaxing\n.control\npre_osdi relaxing.osdi\n.endc\nN1 {nodes} one\n.model one relaxing\n"
            f".ic v({at})=2\n.tran 1u 20u uic\n.measure tran first FIND v(pin) AT=5u\n.end\n"
        )
        done = subprocess.run(
            [find_osdi_ngspice(), "-b", "deck.cir"], cwd=module.parent, capture_output=True, text=True, check=False
        )
        measured = [line for line in done.stdout.splitlines() if line.startswith("first")]
        found[name] = float(measured[0].split("=")[1].split()[0]) if measured else 0.0
    assert found["port"] == pytest.approx(2.0 * np.exp(-5e-3), rel=1e-3)
    assert abs(found["inner"]) < 1e-9
