# SPDX-License-Identifier: GPL-3.0-or-later
"""The node ``check`` of an exported motor: 1 for each misuse in a deck for ngspice alone, and 0 in correct use."""

import re
from math import pi, tan
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.averaged.library import averaged_library
from pyspice_runner.circuit.motor import coarsest_step, motor_library
from pyspice_runner.spice.library import read_library
from pyspice_runner.spice.process import silent_fault
from tests.circuit.batch import batch, measured
from tests.motors import BEAM40

MOTOR = pr.load_motor(BEAM40)
STEP = coarsest_step(MOTOR)
PHASES = "Va a 0 SIN(0 110 40.1k)\nVb b 0 SIN(0 110 40.1k 0 0 120)"
RIGHT = "Xmotor a b 0 shaft piezomotor"


def deck(
    motor: str = RIGHT, *, sources: str = PHASES, step: float = 1e-7, start: str = "uic", options: str = "trap"
) -> str:
    return f"""misuse
{motor_library(MOTOR)}
{sources}
{motor}
.options reltol=1e-4 method={options}
.tran {step} 250u 0 {step} {start}
.measure tran check MAX v(xmotor.check)
.end
"""


CORRECT = {
    "the recommended drive": deck(),
    "the coarsest step of the header": deck(step=STEP),
    "from an operating point": deck(start=""),
    "from an operating point with charged groups": deck(
        start="", sources="Va a 0 SIN(0 110 40.1k 0 0 60)\nVb b 0 SIN(0 110 40.1k 0 0 210)"
    ),
    "in antiphase, without a current in com": deck(sources="Va a 0 SIN(0 110 40.1k)\nVb b 0 SIN(0 -110 40.1k)"),
    "one group, the other open": deck(sources="Va a 0 SIN(0 110 40.1k)\nRb b 0 1g"),
    "a small signal": deck(sources=PHASES.replace("110", "10m")),
    "two tones": deck(sources="Va a 0 SIN(0 50 25k)\nVb b a SIN(0 50 50k)"),
    "a rotor held at stall": deck(f"{RIGHT}\nVhold shaft 0 0"),
    "com above ground": deck("Xmotor a b c shaft piezomotor\nVc c 0 SIN(100 30 5k)"),
    "parameters in their ranges": deck(f"{RIGHT} preload=1e-6 friction=5 bearing=0"),
}
MISUSE = {
    "a step of 2 us": deck(step=2e-6),
    "a step a tenth too long": deck(step=1.1 * STEP),
    "a step of half a period of the sine": deck(step=3.0 * STEP),
    "a step of one period of the sine": deck(step=6.0 * STEP),
    "com floats": deck("Xmotor a b com shaft piezomotor"),
    "com floats in antiphase": deck("Xmotor a b com shaft piezomotor", sources=PHASES.replace("120", "180")),
    "com floats from an operating point": deck("Xmotor a b com shaft piezomotor", start=""),
    "wrong order": deck("Xmotor a b shaft 0 piezomotor"),
    "wrong order with a load": deck("Xmotor a b shaft 0 piezomotor\nIload shaft 0 5m"),
    "no source": deck(sources="Ra a 0 1k\nRb b 0 1k"),
    "negative preload": deck(f"{RIGHT} preload=-6.5"),
    "no preload": deck(f"{RIGHT} preload=0"),
    "friction above its range": deck(f"{RIGHT} friction=5.001"),
    "inertia of zero": deck(f"{RIGHT} inertia=0"),
}


@pytest.mark.parametrize("case", CORRECT)
def test_check_is_0_in_correct_use(case: str, tmp_path: Path) -> None:
    assert measured(CORRECT[case], tmp_path)["check"] == 0.0


@pytest.mark.parametrize("case", MISUSE)
def test_check_is_1_in_misuse(case: str, tmp_path: Path) -> None:
    assert measured(MISUSE[case], tmp_path)["check"] == 1.0


def test_a_drive_that_begins_later_is_seen_from_then_on(tmp_path: Path) -> None:
    late = "Va a 0 SIN(0 110 40.1k 200u)\nVb b 0 0"
    text = deck(sources=late).replace(".end\n", ".measure tran later MAX v(xmotor.check) FROM=220u\n.end\n")
    found = measured(text, tmp_path)
    assert found == {"check": 1.0, "later": 0.0}


@pytest.mark.parametrize("ratio", [0.5, 0.9, 1.1, 1.9])
def test_the_deviation_is_that_of_the_trapezoidal_rule(ratio: float, tmp_path: Path) -> None:
    """The rule sees 2/h tan(wh/2) instead of w; the lag of half a coarsest step has w tau = pi/6."""
    seen = 2.0 / (ratio * pi / 3.0) * tan(ratio * pi / 6.0)
    expected = abs((1.0 + 1j * pi / 6.0) / (1.0 + 1j * seen * pi / 6.0) - 1.0)
    lines = f"""deviation
{read_library("piezomotor_check").subcircuit}
Va a 0 SIN(0 1 40k)
Xcheck a 0 common check piezomotor_check step=100n
Rcommon common a 1k
.tran {ratio * 1e-7} 100u 0 {ratio * 1e-7} uic
.measure tran deviation RMS v(xcheck.deviation) FROM=10u TO=100u
.end
"""
    # 90 us are 150 periods, of which ngspice takes the RMS over its points; the first of them have shorter steps
    found = measured(lines, tmp_path)["deviation"] * 2.0**0.5 * 1e6
    assert found == pytest.approx(expected, rel=0.02)


def test_check_cannot_see_a_wrong_order_that_leaves_a_current_in_com(tmp_path: Path) -> None:
    """So say the header and docs/other_tools.md; a rotor's inertia at the wrong pin grounds com for the drive."""
    text = deck("Xmotor a b shaft 0 piezomotor\nCinertia shaft 0 1u")
    assert measured(text, tmp_path)["check"] == 0.0


def test_the_package_finds_a_misspelt_parameter_in_a_deck() -> None:
    fault = silent_fault(deck(f"{RIGHT} perload=8"))
    assert fault.startswith("Subcircuit piezomotor has no parameter perload")
    assert silent_fault(deck()) is None


def test_a_misspelt_parameter_is_ignored_and_the_listing_shows_it(tmp_path: Path) -> None:
    text = deck(f"{RIGHT} perload=8").replace(".end\n", ".control\nlisting param\nrun\nquit 0\n.endc\n.end\n")
    log = batch(tmp_path / "deck.cir", text)
    assert not re.search("error|warning|perload", log, re.I)
    assert re.search(r"xmotor\.preload = 6\.5$", log, re.M)


def test_the_averaged_motor_checks_its_parameters(tmp_path: Path) -> None:
    library = averaged_library(MOTOR)
    for line, out in (("preload=-6.5", True), ("friction=9", True), ("preload=6", False)):
        text = f"""averaged
{library}
Va a_re 0 110
Vb_re b_re 0 -55
Vb_im b_im 0 95.26
Vf f 0 40.1k
Xmotor a_re 0 b_re b_im f shaft 0 heat piezomotor_averaged {line}
.options method=gear trtol=50
.tran 20u 2m 0 1m uic
.measure tran check MAX v(xmotor.check)
.end
"""
        assert (measured(text, tmp_path)["check"] >= 1.0) is out
