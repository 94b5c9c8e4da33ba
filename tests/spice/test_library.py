# SPDX-License-Identifier: GPL-3.0-or-later
"""Every library of ``behavioral/``: header, ``.subckt`` line, example and Python model hold together."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from math import atan, cos, e, exp, inf, nan, pi, sin, sqrt, tanh
from pathlib import Path

import pytest
from scipy.optimize import brentq

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.parameters import Contact, Mode, Mount, Parameters, Piezo, Rotor
from pyspice_runner.spice.library import (
    check_parameters,
    data_path,
    definitions,
    library_names,
    number,
    parse_library,
    read_library,
)
from pyspice_runner.spice.ngspice import run_deck
from tests.circuit.batch import measured

LIBRARIES = library_names()


def code(text: str) -> list[str]:
    """The lines that a simulator reads."""
    return [line for line in text.splitlines() if line.strip() and not line.startswith("*")]


# --- headers -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LIBRARIES)
def test_header_says_what_a_reader_needs(name: str) -> None:
    library = read_library(name)
    assert library.text.startswith("* SPDX-License-Identifier: MIT\n")
    for fact in (library.title, library.source, library.omits, library.step, library.tested_with, library.usage):
        assert fact.strip()
    assert int(library.revision) >= 1
    for pin in library.pins:
        assert pin.direction in ("in", "out", "inout")
        assert pin.meaning
    units = [item.unit for item in (*library.pins, *library.parameters)]
    # the unit of a node or parameter in the netlist: SI, or um where the conventions say so; 1 for a pure number
    allowed = (
        "V A W J K ohm um m/s m/s2 N N.m rad/s 1 kg N.s/m N/m N/V F Hz N/m^1.5 "
        "N/m^exponent m/N^(2/3) m/N m s s/m kg.m2 N.m.s J/K K/W H V/s deg rad 1/K 1/m2 S"
    )
    assert set(units) <= set(allowed.split())
    for parameter in library.parameters:
        assert parameter.meaning
        assert not re.fullmatch("dc|ac|temp|sin|pulse|m", parameter.name)  # ngspice reads these otherwise


@pytest.mark.parametrize("name", LIBRARIES)
def test_one_self_contained_subcircuit_in_the_common_dialect(name: str) -> None:
    library = read_library(name)
    lines = code(library.text)
    assert lines[0].startswith(f".subckt {name} ")
    assert lines[-1] == f".ends {name}"
    assert "\n".join(lines) == "\n".join(code(library.subcircuit))
    assert sum(line.startswith(".subckt") for line in lines) == 1
    text = "\n".join(lines).lower()
    assert not re.search(r"\.inc|\.lib|\.global", text)
    assert "hertz" not in text  # as part of a name it is the frequency to ngspice


@pytest.mark.parametrize("name", LIBRARIES)
def test_a_library_instantiates_what_its_header_says_it_needs(name: str) -> None:
    library = read_library(name)
    instances = [line.split() for line in code(library.subcircuit) if line.startswith("X")]
    used = {next(word for word in reversed(words) if "=" not in word) for words in instances}
    assert used == set(library.needs)


@pytest.mark.parametrize("name", LIBRARIES)
def test_expressions_read_nothing_but_the_own_parameters(name: str) -> None:
    library = read_library(name)
    known = {parameter.name for parameter in library.parameters}
    used: set[str] = set()
    for line in code(library.subcircuit)[1:]:
        definition = re.match(r"\.param (\w+)=", line)
        for expression in re.findall(r"\{([^}]*)\}", line):
            names = set(re.findall(r"(?<![\w.])[a-z_]\w*+(?!\()", expression))
            assert names <= known, line
            used |= names
        if definition:
            known.add(definition.group(1))
    assert used == known, "a parameter that nothing reads"


# --- the model's ranges --------------------------------------------------------------------------------------

SAME = {  # library parameter: the model's field; both refuse the same values
    ("piezomotor_mode", "mass"): (Mode, "mass_kg"),
    ("piezomotor_mode", "damping"): (Mode, "damping_n_s_per_m"),
    ("piezomotor_mode", "stiffness"): (Mode, "stiffness_n_per_m"),
    ("piezomotor_mode", "coupling_a"): (Mode, "coupling_a_n_per_v"),
    ("piezomotor_mode", "coupling_b"): (Mode, "coupling_b_n_per_v"),
    ("piezomotor_tip", "stiffness"): (Mode, "stiffness_n_per_m"),
    ("piezomotor_tip", "tip_x"): (Mode, "tip_x"),
    ("piezomotor_tip", "tip_y"): (Mode, "tip_y"),
    ("piezomotor_group", "capacitance"): (Piezo, "capacitance_a_f"),
    ("piezomotor_lining", "exponent"): (Contact, "exponent"),
    ("piezomotor_contact", "mu"): (Contact, "friction"),
    ("piezomotor_contact", "preload"): (Contact, "preload_n"),
    ("piezomotor_contact", "radius"): (Rotor, "radius_m"),
    ("piezomotor_contact", "sliding"): (Contact, "sliding_ratio"),
    ("piezomotor_contact", "stribeck"): (Contact, "stribeck_velocity_m_s"),
    ("piezomotor_bearing", "torque"): (Rotor, "bearing_friction_n_m"),
    ("piezomotor_bearing", "angle"): (Rotor, "bearing_presliding_rad"),
    ("piezomotor_mount", "stiffness"): (Mount, "stiffness_n_per_m"),
    ("piezomotor_mount", "mass"): (Mount, "mass_kg"),
    ("piezomotor_mount", "damping"): (Mount, "damping_n_s_per_m"),
    ("piezomotor_rotor", "inertia"): (Rotor, "inertia_kg_m2"),
    ("piezomotor_rotor", "bearing"): (Rotor, "bearing_damping_n_m_s"),
}


@pytest.mark.parametrize(("library", "parameter"), SAME)
def test_ranges_and_units_are_those_of_the_model(library: str, parameter: str) -> None:
    kind, field = SAME[library, parameter]
    declared = next(item for item in read_library(library).parameters if item.name == parameter)
    schema = kind.model_json_schema()["properties"][field]
    assert declared.least == schema.get("minimum", schema.get("exclusiveMinimum"))
    assert declared.greatest == schema["maximum"]
    assert unit_in_ascii(kind, field) == declared.unit


def unit_in_ascii(kind: type[Parameters], field: str) -> str:
    unit = str(kind.model_fields[field].json_schema_extra["unit"])  # type: ignore[index, call-overload]
    return unit.replace("·", ".").replace("²", "2")


def test_compliance_is_that_of_both_sides_of_the_contact() -> None:
    declared = next(item for item in read_library("piezomotor_contact").parameters if item.name == "compliance")
    for tip, rotor, accepted in (
        (declared.least, 0.0, True),
        (0.0, declared.greatest, True),
        (0.4 * declared.least, 0.5 * declared.least, False),
        (0.5 * declared.greatest, 0.6 * declared.greatest, False),
        (0.0, 0.0, False),
    ):
        sides = {"tangential_compliance_tip_m_per_n23": tip, "tangential_compliance_rotor_m_per_n23": rotor}
        common = {"normal_stiffness_n_per_m15": 1e13 if tip + rotor < 1e-6 else 1e3, "friction": 0.3, "preload_n": 1.0}
        if accepted:
            Contact.model_validate(common | sides)
        else:
            with pytest.raises(ValueError, match=r"the sum must be ≤ 0\.01 m/N\^\(2/3\)|do not go together"):
                Contact.model_validate(common | sides)


# --- the examples --------------------------------------------------------------------------------------------


def _carrier(mass: float = 0.05, damping: float = 20.0, stiffness: float = 1e4, t: float = 5e-3) -> tuple[float, float]:
    """Displacement (um) and velocity (m/s) of a mass on a spring, a force of 1 N after it came on."""
    decay = 0.5 * damping / mass
    ringing = sqrt(stiffness / mass - decay**2)
    envelope = exp(-decay * t)
    risen = 1.0 - envelope * (cos(ringing * t) + decay / ringing * sin(ringing * t))
    return 1e6 / stiffness * risen, envelope * sin(ringing * t) / (mass * ringing)


# Kp ((Vgs − Vto) Vds − Vds²/2) = 1 A with Kp = 0.17, Vto = 3, inside Rd = 0.45 and Rs = 0.05 ohm: Vgs = 10 − 0.05
MOSFET = 0.5 + (6.95 - (6.95**2 - 2.0 / 0.17) ** 0.5)


def _triode(kp: float, source_ohm: float) -> float:
    """Return the voltage of the channel of such a transistor at 1 A behind the resistance of its source."""
    over = 7.0 - source_ohm
    return over - sqrt(over**2 - 2.0 / kp)


CONDUCTANCE = 2 * pi * 50e3 * 2.2e-9 * 2 ** (2 / pi * atan(0.02)) * 0.02


def _worn(depth_um: float) -> float:
    """Force in N of the example's worn tip, 7e9 N/m^1.5 and b²/R* = 1 um, by its contact's radius."""
    wide = 0.5 * (1.0 + sqrt(1.0 + 4.0 * depth_um**2))  # a²/R*
    return 7.0 * 0.5 * (2.0 * wide + 1.0) * sqrt(wide - 1.0)


WORN_SEAT_UM = brentq(lambda depth: _worn(depth) - 4.0, 0.1, 1.0, xtol=1e-14)
EXPECTED: dict[str, dict[str, tuple[float, float]]] = {
    # 1 V over 1 - w²LC + jwRC; the step of 1 us is a fiftieth of the period of the fast part, which has died away
    "driver_averaged": {"out_re_v": (0.1318911, 1e-4), "out_im_v": (-3.1776246, 1e-5)},
    # θ U / c at resonance; 3 Hz between the points of a 240 Hz wide peak: at most (1.5/119)² = 1.6e-4 below it
    "piezomotor_mode": {"peak_velocity_m_s": (0.12 / 15.0, 2e-4)},
    "piezomotor_tip": {"y_um": (2.0 * 0.5, 1e-9), "vy_m_s": (2.0 * 0.1, 1e-9), "force_n": (8.0, 1e-9)},
    # 6480 N on 10 g for 100 ns
    "piezomotor_mode_soft": {"velocity_m_s": (-0.0648, 1e-4)},
    # slides: μ F₀; tip and rotor do not approach, so that the normal force is the preload to rounding
    "piezomotor_contact": {"friction_end_n": (0.25 * 4.0, 1e-6), "state_end": (2.0, 1e-9)},
    # 4 N press it in by (4/7e9)^(2/3), and it is 1 um closer
    "piezomotor_normal": {
        "penetration_um": (1.0 + 1e6 * (4.0 / 7e9) ** (2 / 3), 1e-6),
        "normal_n": (7e9 * (1e-6 + (4.0 / 7e9) ** (2 / 3)) ** 1.5, 1e-6),
    },
    # 4 N press it in by 4/2e7, and it is 1 um closer
    "piezomotor_lining": {"penetration_um": (1.2, 1e-6), "normal_n": (2e7 * 1.2e-6, 1e-6)},
    # 4 N compress 10 nm/N; a rate that is constant is exact two lags of 50 ns after its start
    "piezomotor_stem": {"position_um": (-0.04, 1e-6), "velocity_m_s": (-0.01, 1e-6)},
    "piezomotor_worn": {"penetration_um": (1.0 + WORN_SEAT_UM, 1e-6), "normal_n": (_worn(1.0 + WORN_SEAT_UM), 1e-6)},
    # the same for a brush that slips as a whole: the cells' limits add up to μ F_N exactly
    "piezomotor_brush": {"friction_end_n": (0.25 * 4.0, 1e-6), "state_end": (2.0, 1e-9)},
    # at half of creep; the state is stick
    "piezomotor_coulomb": {"friction_end_n": (0.25 * 4.0 * tanh(0.5), 1e-6), "state_end": (1.0, 1e-9)},
    # ω C tan δ with C of 100 kHz at half of that, within what the ladder promises
    "piezomotor_group": {"conductance_s": (CONDUCTANCE, 0.05)},
    # α = (2 N · 10 mm − 5 mN·m)/J = 15e3 rad/s² for 1 ms; the trapezoidal rule is exact, but for the start of 1 ns
    "piezomotor_dynamometer": {"angle_urad": (7500.0, 1e-5), "friction_uns": (2000.0, 1e-6), "load_unms": (5.0, 1e-6)},
    # 2 N · 0.5 m/s and 2 N · 10 mm · 20 rad/s, for 1 ms
    "piezomotor_contactmeter": {
        "work_of_tip_uj": (1000.0, 1e-6),
        "work_on_rotor_uj": (400.0, 1e-6),
        "square_un2s": (4000.0, 1e-6),
        "time_in_slip_us": (1000.0, 1e-6),
    },
    # U²/2R over ten periods, and the peak of a sine that is seen at 200 points a period: at most (π/200)²/2 below it
    "piezomotor_wattmeter": {
        "energy_uj": (10.0, 1e-5),
        "square_i_ua2s": (0.01, 1e-5),
        "square_v_uv2s": (1e4, 1e-5),
        "peak_a": (0.01, 1.3e-4),
    },
    "piezomotor_heat": {"heat_uj": (100.0, 1e-6)},  # 10² V² / 1 kΩ · 1 ms
    # 10² V² (2/1 kΩ + 1.111/10 kΩ) · 1 µs
    "piezomotor_groupheat": {"heat_uj": (100.0 * (2e-3 + 1.111e-4), 1e-6)},
    # Ω = τ/C_R (1 − 1/e) after one J/C_R; trapezoidal rule with 2000 steps a time constant: below 1e-6
    "piezomotor_bearing": {"share": (1 - exp(-2), 1e-5), "torque_n_m": (-1e-3 * (1 - exp(-2)), 1e-5)},
    "piezomotor_mount": {
        "carrier_um": (_carrier()[0], 1e-4),
        "carrier_m_s": (_carrier()[1], 1e-4),
    },  # of a step of 1 us
    "piezomotor_check": {"check": (1.0, 1e-9)},
    "piezomotor_rotor": {"speed_after_one_time_constant": (1e-3 / 1e-4 * (1 - 1 / e), 1e-5)},
    # U_A U_B cos φ / 2; the ends of the mean fall between points: 1/10000 of a period of ten
    "driver_source": {"mean_product_v2": (0.5 * 2.0 * 3.0 * 0.5, 1e-4)},
    # 5 V/us behind 1 ohm into 10 ohm, read between points 2 ns apart; 4.5 V that the limit holds drop across 200 kohm
    "driver_amplifier": {"from_1_v_to_2_v_s": (1.0 / 5e6 * 1.1, 1e-3), "out_end_v": (5.0, 1e-4)},
    # T = 1/(s/p (1 + s/p2)) with s/p = j, s/p2 = 1e-4 j and hardly any load; 10 T/(1 + T)
    "driver_feedback": {"out_v": ((10.0 / (1.0 + 1j * (1.0 + 1e-4j) + 1e-8)).real, 1e-5)},
    # the triode equation with Kp = 0.17, Vto = 3, Rd + Rs = 0.5: 1.0024 A in one transistor, 1.0047 A in two
    # VDMOS in the triode region at 1 A: the channel's 0.852 ohm and Rd + Rs = 0.5 ohm
    "driver_mosfet": {"drain_v": (MOSFET, 1e-5)},
    # likewise with Kp of 1.72 and 0.877, Rd + Rs of 0.071 and 2.83
    "driver_mosfet_irf530": {"drain_v": (0.071 + _triode(1.72, 0.01), 1e-4)},
    "driver_mosfet_irf820": {"drain_v": (2.83 + _triode(0.877, 0.05), 1e-4)},
    "driver_half_bridge": {"out_end_v": (38.591144, 1e-5)},
    "driver_full_bridge": {"out_end_v": (38.587634, 1e-5)},
    # twice 0.998 of 40 V less the drop of 40 V/5 mH * 9.5 us, in the mean, across 0.3 and 1.35 ohm of the transistor
    "driver_push_pull": {"out_v": (2.0 * 0.998 * (40.0 - 40.0 / 5e-3 * 9.5e-6 * 1.65), 1e-4)},
    "driver_cable": {"out_v": (1.0 / 0.9, 1e-6)},
    "driver_inductor": {"current_a": (0.01, 1e-6)},
    # 1 kohm behind 10 mohm, with 10 mohm of the parallel inductor at a reactance of 3.16 kohm: 1e-5 below 1
    "driver_llcc": {"through_v": (1.0 - 1e-5, 1e-6)},
    # 5 mH · 4² · (1 − 0.99²) = 1.592 mH at the secondary; 1/(1 − (50 kHz/f₀)²) with 636.44 pF is 1/(1 − 0.1)
    "driver_transformer": {"open_v": (4.0 * 0.99 / 0.9, 1e-6)},
    # θ (θ U / c) at resonance, settled to exp(−15); ngspice counts the current into the source
    "piezomotor_averaged_mode": {"current_a": (-0.1 * 0.1 / 15.0, 1e-3)},
    "piezomotor_averaged_group": {
        "in_quadrature_a": (-2 * pi * 50e3 * 2e-9 * 2 ** (2 / pi * atan(0.01)) * 10.0, 1e-6),
        "heat_w": (0.5 * 2 * pi * 50e3 * 2e-9 * 2 ** (2 / pi * atan(0.01)) * 0.01 * 10.0**2, 1e-6),
    },
    "piezomotor_averaged_bending": {"deflection_um": (-0.5, 1e-6)},
    "piezomotor_averaged_check": {"response_um": (1e6 / (1.0 - (2 * pi * 20e3) ** 2), 1e-6)},
    # the curvature of the rotor takes x²/2R = 0.05 nm from the static penetration
    "piezomotor_averaged_phase": {
        "friction_n": (0.25 * 7.0 * (1e6 * (4.0 / 7e9) ** (2 / 3) - 5e-5) ** 1.5, 1e-6),
        "normal_n": (7.0 * (1e6 * (4.0 / 7e9) ** (2 / 3) - 5e-5) ** 1.5, 1e-6),
    },
    # as piezomotor_mode, the coupling 5 % greater
    "piezomotor_mode_thermal": {"peak_velocity_m_s": (1.05 * 0.12 / 15.0, 2e-4)},
    "piezomotor_group_thermal": {"conductance_s": (1.2 * CONDUCTANCE, 0.05)},
    # P R (1 − 1/e) after one time constant, 2000 steps of the trapezoidal rule
    "piezomotor_cooling": {"after_one_time_constant_k": (0.5 * 100.0 * (1 - 1 / e), 1e-5)},
    "tracker_sense": {"motional_a": (-1e-3, 1e-6), "force_v": (-1.0, 1e-9)},
    # two edges, each seen up to a step of 10 ns late: 10 ns of the 2 us that it lags
    "tracker_detector": {"before_v": (4.1, 5e-3), "after_v": (0.5, 5e-3)},
    # I t/(C + c) + I R C²/(C + c)², by the trapezoidal rule with 27 steps a time constant
    "tracker_filter": {"end_v": (2e-9 / 3.3e-9 + 0.1 * (3.0 / 3.3) ** 2, 1e-5)},
    "tracker_oscillator": {"ten_periods_s": (200e-6, 2e-5), "amplitude_v": (1.0, 1e-4)},
    "tracker_phases": {"mean_product_v2": (0.5 * 2.0 * 3.0 * 0.5, 1e-4)},
    "tracker_observer": {"control_end_v": (1.2, 1e-3)},
    "tracker_restart": {"before_v": (5.0, 1e-6), "during_v": (2.5, 1e-3)},
    "tracker_averaged": {"control_v": (0.5, 1e-5), "frequency_hz": (46e3, 1e-6)},
    "tracker_average": {"phase_rad": (-2.0 * pi * 0.1, 1e-6), "pump_ua": (-20e-6 * 0.1, 1e-6)},
}


def test_every_example_has_an_expected_result() -> None:
    missing = set(LIBRARIES) - EXPECTED.keys()
    assert not missing, "state in EXPECTED what the example in the header gives by its closed form"


@pytest.mark.parametrize("name", EXPECTED)
def test_example_gives_the_number_of_the_closed_form(name: str, tmp_path: Path) -> None:
    """With the files included, as an engineer would use them from a directory of their own."""
    library = read_library(name)
    includes = "".join(f".include {data_path('behavioral') / part}.lib\n" for part in [name, *library.needs])
    found = measured(f"example of {name}\n{includes}{library.usage}.end\n", tmp_path)
    assert found.keys() == EXPECTED[name].keys()
    for key, (value, tolerance) in EXPECTED[name].items():
        # ngspice 46 prints six digits
        assert found[key] == pytest.approx(value, rel=max(tolerance, 5e-6)), key


def test_a_meter_of_the_contact_does_not_shorten_the_steps_where_the_state_jumps() -> None:
    """The tip touches 20 times in a run with ngspice's own steps of at most 100 ns and the tolerances of a bridge."""
    deck = f"""a tip that touches and slips
{definitions(read_library("piezomotor_contactmeter"))}
Vshaft shaft 0 20
Vx x 0 0
Vvx vx 0 0.5
Vvy vy 0 0
Vnormal normal 0 10
Vfriction friction 0 2
Vphase phase 0 SIN(0 1 100k)
Bstate state 0 V=2*u(V(phase))
Xmeter shaft x vx vy normal friction state piezomotor_contactmeter
.options abstol=1e-6 reltol=1e-4 vntol=1e-5
.tran 100n 200u 0 100n uic
.end
"""
    found = run_deck(deck, vectors=["v(xmeter.v_contact)"], stop_time=200e-6).raw.vectors
    # 2000 steps and those of the start; with currents of 1 A ngspice takes 2655
    assert len(found["time"]) < 2020
    # half of the time in µs; each jump is seen at the end of its step of 100 ns
    assert found["v(xmeter.v_contact)"][-1] == pytest.approx(100.0, abs=20 * 0.1)


def test_contact_example_sticks_before_it_slips(tmp_path: Path) -> None:
    """u = v t until u_lim = μ K_t F^(2/3): at half of that time the contact sticks with F_T of the virgin curve."""
    library = read_library("piezomotor_contact")
    limit = 0.25 * 3.3e-7 * 4.0 ** (2.0 / 3.0)
    half = 0.5 * limit / 0.01
    usage = (
        library.usage
        + f".measure tran friction_n FIND v(friction) AT={half}\n.measure tran state FIND v(state) AT={half}\n"
    )
    found = measured(f"half\n{definitions(library)}\n{usage}.end\n", tmp_path)
    assert found["state"] == pytest.approx(1.0)
    # steps of 0.1 us of 10.4 us, linear in between: (0.01)²/8 · curvature
    assert found["friction_n"] == pytest.approx(0.25 * 4.0 * (1.0 - 0.5**1.5), rel=1e-3)


# --- reading and checking ------------------------------------------------------------------------------------

SMALL = """* SPDX-License-Identifier: MIT
* small: a resistor
* PIN  a   inout  V    one end
* PIN  b   inout  V    the other end
* PAR  r   ohm    1k   1  1meg  resistance
* PAR  tc  1      0   -1  1     temperature coefficient
* SOURCE Ohm's law
* OMITS  noise
* REVISION 3
* STEP   1 us
* TESTED WITH ngspice 39
* USE
*   V1 x 0 1
*   X1 x 0 small r=5
* END USE
.subckt small a b r=1k tc=0
R1 a b {r} tc1={tc}
.ends small
"""


def test_small_library_is_read() -> None:
    library = parse_library("small", SMALL)
    assert [(pin.name, pin.direction, pin.unit, pin.meaning) for pin in library.pins] == [
        ("a", "inout", "V", "one end"),
        ("b", "inout", "V", "the other end"),
    ]
    resistance = library.parameters[0]
    assert (resistance.default, resistance.least, resistance.greatest) == (1e3, 1.0, 1e6)
    assert library.title == "a resistor"
    assert library.usage == "V1 x 0 1\nX1 x 0 small r=5\n"
    assert library.subcircuit.splitlines()[0] == ".subckt small a b r=1k tc=0"


def without(start: str) -> Callable[[str], str]:
    return lambda text: "".join(line for line in text.splitlines(keepends=True) if not line.startswith(start))


def swap(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new, 1)


PINS = ": the PIN lines and the pins of .subckt differ; make them the same."
PARS = ": the PAR lines and the parameters of .subckt differ; make them the same."


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (without("* small:"), " lacks title"),
        (without("* REVISION"), " lacks REVISION"),
        (without("* TESTED"), " lacks TESTED WITH"),
        (without("* END USE"), " lacks USE"),
        (without(".ends"), " lacks .subckt"),
        (swap(".subckt small", ".subckt large"), " lacks .subckt"),
        (without("* PIN  a"), PINS),
        (swap("small a b", "small b a"), PINS),
        (swap("* PIN  b   inout  V    the other end", "* PIN b"), PINS),
        (without("* PAR  tc"), PARS),
        (swap("r=1k tc=0", "tc=0 r=1k"), PARS),
        (swap("* PAR  r", "* PAR  r   ohm    1k   1  1meg  twice\n* PAR  r"), PARS),
        (swap("1k   1  1meg", "1k   2k  1meg"), ": the default of r is outside its range; correct its PAR."),
        (swap("1k   1  1meg", "much 1  1meg"), ", parameter r: 'much' is not a SPICE number."),
        (swap("r=1k", "r={q}"), ", parameter r: '{q}' is not a SPICE number."),
    ],
)  # fmt: skip
def test_malformed_library_is_refused(damage: Callable[[str], str], sentence: str) -> None:
    damaged = damage(SMALL)
    assert damaged != SMALL
    with pytest.raises(ParameterError) as caught:
        parse_library("small", damaged)
    conventions = "; see behavioral/CONVENTIONS.md." if "lacks" in sentence else ""
    assert str(caught.value) == f"behavioral/small.lib{sentence}{conventions}"


def test_unknown_library_is_refused() -> None:
    with pytest.raises(ParameterError) as caught:
        read_library("piezomotor_group_thermals")
    assert str(caught.value) == (
        "There is no library 'piezomotor_group_thermals' in behavioral/. Did you mean 'piezomotor_group_thermal'?"
    )


def test_data_path_finds_both_folders_and_nothing_else() -> None:
    assert (data_path("behavioral") / "piezomotor_mode.lib").is_file()
    assert data_path("netlists").is_dir()
    with pytest.raises(ParameterError, match=r"The folder nonsense is missing beside the package; install"):
        data_path("nonsense")


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"R": 5.0}, "Subcircuit small has no parameter 'R'; it has r, tc."),
        ({"r": 0.5}, "Subcircuit small: r = 0.5 ohm is not valid: it must be 1 to 1e+06 ohm."),
        ({"r": nan}, "Subcircuit small: r = nan ohm is not valid: it must be 1 to 1e+06 ohm."),
        ({"r": inf}, "Subcircuit small: r = inf ohm is not valid: it must be 1 to 1e+06 ohm."),
        ({"tc": 2.0}, "Subcircuit small: tc = 2 is not valid: it must be -1 to 1."),
    ],
)
def test_instance_is_held_against_the_header(values: dict[str, float], sentence: str) -> None:
    library = parse_library("small", SMALL)
    with pytest.raises(ParameterError) as caught:
        check_parameters(library.name, library.parameters, values)
    assert str(caught.value) == sentence
    check_parameters(library.name, library.parameters, {"r": 1e6, "tc": -1.0})


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0), ("-2.5", -2.5), ("+.5", 0.5), ("3.", 3.0), ("1e-12", 1e-12), ("1E6", 1e6), ("2e3k", 2e6),
        ("50n", 50e-9), ("1meg", 1e6), ("1MEG", 1e6), ("1m", 1e-3), ("1M", 1e-3), ("1g", 1e9), ("3t", 3e12),
        ("4k", 4e3), ("5u", 5e-6), ("6p", 6e-12), ("7f", 7e-15),
    ],
)  # fmt: skip
def test_spice_number(text: str, value: float) -> None:
    assert number(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["", ".", "1.2.3", "k", "1x", "1 k", "nan", "inf", "{r}", "1e", "--1", "１", "1e400", f"1e{'9' * 20}k"]
)
def test_text_that_is_no_spice_number_is_refused(text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        number(text)
    assert str(caught.value) == f"{text!r} is not a SPICE number."


def test_a_header_that_never_ends_is_refused_at_once() -> None:
    text = ".subckt thing a\n" * 20_000
    start = time.process_time()
    with pytest.raises(ParameterError, match="lacks"):
        parse_library("thing", text)
    assert time.process_time() - start < 1.0
