# SPDX-License-Identifier: GPL-3.0-or-later
"""The amplifier with feedback: its loop gain against ngspice's with the loop broken, and the step that shows it."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.drivers.feedback import loop_gain, margins, step_response
from pyspice_runner.motor.drive import two_phases
from pyspice_runner.spice.library import definitions, read_library

pytestmark = pytest.mark.xdist_group("drivers")

MOTOR = pr.load_motor("bimodal40")
STABLE = {"cable.inductance": 250e-9, "cable.capacitance": 100e-12}  # 1 m of coaxial cable
# 100 m of it, an amplifier with much open-loop resistance and a low second pole, and no isolation
UNSTABLE = {
    "cable.inductance": 25e-6, "cable.capacitance": 10e-9, "amplifier.isolation_resistance": 1e-3,
    "amplifier.output_resistance": 100.0, "amplifier.second_pole": 3e5,
}  # fmt: skip


def driver(**settings: float) -> pr.Driver:
    drive = two_phases(pr.default_drive(MOTOR))  # type: ignore[arg-type]
    return pr.Driver(kind="feedback", settings=settings, **drive)


def broken(values: dict[str, dict[str, float]], folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in Hz and the loop gain by ngspice: the output for 1 V at the node to which it was fed back."""
    library = definitions(read_library("driver_feedback"), read_library("driver_cable"))
    text = library.replace("Vloop sense fed 0", "Vloop fed 0 DC 0 AC 1")
    assert text != library
    pr.export_motor(MOTOR, folder / "motor.lib")
    words = {label: " ".join(f"{name}={value!r}" for name, value in part.items()) for label, part in values.items()}
    (folder / "loop.cir").write_text(f"""the loop of group A, broken
.include motor.lib
{text}
Vin in 0 0
Vp vp 0 115
Vn vn 0 -115
Xamplifier in out 0 vp vn driver_feedback {words["amplifier"]}
Xcable out a 0 driver_cable {words["cable"]}
Vb b 0 0
Xmotor a b 0 shaft piezomotor
.control
set numdgt=12
set wr_singlescale
ac dec 400 100k 100meg
wrdata out.txt real(v(xamplifier.sense)) imag(v(xamplifier.sense))
quit 0
.endc
.end
""")
    subprocess.run(["ngspice", "-b", "loop.cir"], cwd=folder, check=True, capture_output=True, timeout=120)
    frequency, real, imaginary = np.loadtxt(folder / "out.txt").T
    return frequency, -(real + 1j * imaginary)


@pytest.mark.parametrize("settings", [STABLE, UNSTABLE], ids=["stable", "unstable"])
def test_loop_gain_and_margin_are_those_of_ngspice_with_the_loop_broken(
    settings: dict[str, float], tmp_path: Path
) -> None:
    chosen = driver(**settings)
    frequency, gain = broken({part.label: part.values for part in chosen.parts("a")}, tmp_path)
    ours = loop_gain(MOTOR, chosen, "a", frequency)
    # the modes, free here and pressed there, are below 70 kHz; the ladder of the plates has a ripple of 5 % of its
    # loss, which counts in the notch where cable and group are in series resonance, with 0.02 of loop gain left
    np.testing.assert_allclose(ours, gain, rtol=2e-3, atol=1e-3)
    crossed = np.flatnonzero((np.abs(gain[:-1]) >= 1.0) & (np.abs(gain[1:]) < 1.0))
    phases = np.degrees(np.angle(-gain[crossed]))
    found = margins(MOTOR, chosen, "a")
    assert found.stable is (settings is STABLE)
    # between points 0.6 % apart the phase turns by 0.6 % of 90° for each pole and zero that is near
    assert found.phase_margin_deg == pytest.approx(phases.min(), abs=1.5)
    assert found.crossover_hz == pytest.approx(frequency[crossed[phases.argmin()]], rel=0.006)


def test_the_step_of_a_stable_loop_settles_and_that_of_an_unstable_one_oscillates() -> None:
    for settings, most in ((STABLE, 0.02), (UNSTABLE, np.inf)):  # where the modes ring on
        chosen = driver(**settings)
        time, output = step_response(MOTOR, chosen, "a", margins(MOTOR, chosen, "a"))
        swing = np.ptp(output[time > 0.8 * time[-1]])
        assert swing < most
        assert bool(swing > 2.0) is (settings is UNSTABLE)


def test_a_report_has_margin_and_step_and_the_powers_of_the_linear_amplifier(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    words = ["drive", "bimodal40", "--duration", "5e-4", "--json"]
    found = {}
    for kind in ("linear", "feedback"):
        assert run([*words, "--driver", kind, "--plot", str(tmp_path / "plot.png")]) == 0
        found[kind] = json.loads(capsys.readouterr().out)
    assert found["linear"]["stability"] == {}
    assert found["feedback"]["stability"]["a"]["phase_margin_deg"] > 60.0
    assert found["feedback"]["cautions"] == []
    assert abs(found["feedback"]["balance_residual"]) < 0.01
    # 10 ohm of isolation at 0.1 A take 1 % of the voltage in phase
    for key in ("supply_power_w", "motor_power_w"):
        assert found["feedback"][key] == pytest.approx(found["linear"][key], rel=0.03), key
    assert run([*words, "--driver", "feedback", *(f"--part={name}={value}" for name, value in UNSTABLE.items())]) == 0
    cautions = json.loads(capsys.readouterr().out)["cautions"]
    assert "group A is unstable into this load" in cautions[0]
