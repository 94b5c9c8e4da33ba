# SPDX-License-Identifier: GPL-3.0-or-later
"""The steady state of the averaged motor by ``.op`` and ``.ac`` of the decks, and the start where these do not end."""

import re
import resource
import subprocess
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.spice.ngspice import find_ngspice
from tests.motors import BEAM40, HARD_TIP

ROOT = Path(__file__).resolve().parents[2]
DECKS = {"op": "averaged_operating_point.cir", "ac": "averaged_small_signal.cir"}
RESULT = {"op": "speed_rad_s", "ac": "slow_speed_in_phase"}
# frequency, voltage, phase, load torque; ngspice 39 steps its sources without an end there
ENDLESS = (40352.4, 149.521, 91.7708, 4.33227e-3)
MOTOR = pr.load_motor(BEAM40)


def recipe() -> str:
    """Return the control section that docs/tracking.md gives for the start by a transient."""
    page = (ROOT / "docs" / "tracking.md").read_text(encoding="utf-8")
    found = re.search(r"```spice\n(\.control\noption trtol.*?)```", page, re.S)
    return found[1]


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The averaged library of a motor whose contact opens."""
    return pr.export_motor(
        MOTOR, tmp_path_factory.mktemp("beam") / "motor.lib", averaged=True, thermal=pr.Thermal.of(MOTOR)
    )


def deck(
    analysis: str, point: tuple[float, float, float, float], library: Path | None = None, motor: pr.Motor = MOTOR
) -> str:
    text = (ROOT / "netlists" / DECKS[analysis]).read_text(encoding="utf-8")
    for name, value in zip(("frequency", "voltage", "phase", "torque"), point, strict=True):
        text, count = re.subn(rf"(\.param {name}=)\S+", rf"\g<1>{value!r}", text)
        assert count == 1
    if library:
        text = re.sub(r"(\.param preload=)\S+", rf"\g<1>{motor.contact.preload_n!r}", text)
    return text.replace("piezomotor_averaged.lib", str(library or ROOT / "netlists" / "piezomotor_averaged.lib"))


def result(analysis: str, text: str, folder: Path, limit: float = 60.0) -> tuple[float, float]:
    """Run a deck for at most so many seconds; return its result and the CPU time that it took, s."""
    (folder / "deck.cir").write_text(text, encoding="utf-8")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [find_ngspice(), "-b", "deck.cir"], cwd=folder, capture_output=True, text=True, timeout=limit, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = re.search(rf"{RESULT.get(analysis, '$')} *= *(\S+)", done.stdout)
    return float(found[1]) if found else float("nan"), after.ru_utime - before.ru_utime


def expected(point: tuple[float, float, float, float], motor: pr.Motor = MOTOR) -> float:
    """Return the settled speed of the compiled averaged motor."""
    frequency, voltage, phase, torque = point
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    run = pr.simulate_averaged(motor, drive, 2.0, load_torque=torque, engine="compiled")
    return float(run.rotor_speed_rad_s[-1])


def test_a_transient_gives_op_and_ac_the_start_that_they_do_not_find(beam: Path, tmp_path: Path) -> None:
    """A thousandth: the tolerances of ngspice. The slow small signal is the slope of the speed over the voltage."""
    start = re.sub(r"\.control.*?\.endc\n", lambda _: recipe(), deck("op", ENDLESS, beam), flags=re.S)
    result("start", start, tmp_path)
    speed, seconds = result(
        "op", deck("op", ENDLESS, beam).replace(".control", ".include start.nodeset\n.control"), tmp_path
    )
    assert speed == pytest.approx(expected(ENDLESS), rel=1e-3)
    assert seconds < 2.0
    slope, seconds = result(
        "ac", deck("ac", ENDLESS, beam).replace(".ac dec", ".include start.nodeset\n.ac dec"), tmp_path
    )
    frequency, voltage, phase, torque = ENDLESS
    above, below = (expected((frequency, voltage + change, phase, torque)) for change in (0.5, -0.5))
    assert slope == pytest.approx(above - below, rel=0.02)  # at 1 Hz, a seventh of the corner frequency
    assert seconds < 2.0


@pytest.mark.soak
def test_a_transient_from_the_op_of_a_motor_that_lifts_off_has_the_speed_of_a_run_from_rest(tmp_path: Path) -> None:
    """bimodal40 with a hard tip at 80 V, where the contact opens."""
    motor = pr.load_motor("bimodal40").updated(HARD_TIP)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 80.0, "phase_deg": 62.0})
    assert isinstance(drive, pr.TwoPhaseDrive)
    library = pr.export_motor(motor, tmp_path / "motor.lib", averaged=True)
    text = deck("op", (drive.frequency, 80.0, drive.phase_deg, 0.0), library, motor)
    follow = ".options trtol=50\n.control\nop\nlet at_op = v(shaft)\nprint at_op\ntran 20u 400m 0 5m\n"
    follow += "let speed_rad_s = v(shaft)[length(time)-1]\nprint speed_rad_s\nquit 0\n.endc\n"
    # .op takes about 20 s on an idle core
    speed, _ = result("op", re.sub(r"\.control.*?\.endc\n", lambda _: follow, text, flags=re.S), tmp_path, 180.0)
    settled = float(pr.simulate_averaged(motor, drive, 1.0, engine="compiled").rotor_speed_rad_s[-1])
    assert speed == pytest.approx(settled, rel=1e-3)


@pytest.mark.soak
@pytest.mark.parametrize("torque", [0.0, 20e-3])
@pytest.mark.parametrize("voltage", [60.0, 70.0, 80.0, 90.0, 100.0, 110.0])
def test_op_and_ac_of_the_decks_end_by_themselves_at_the_usual_voltages(
    voltage: float, torque: float, tmp_path: Path
) -> None:
    point = (40.7e3, voltage, 90.0, torque)
    speed, seconds = result("op", deck("op", point), tmp_path)
    assert speed == pytest.approx(expected(point, pr.load_motor("bimodal40")), rel=1e-3)
    assert seconds < 2.0
    slope, seconds = result("ac", deck("ac", point), tmp_path)
    assert slope > 0.0
    assert seconds < 2.0
