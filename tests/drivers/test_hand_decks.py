# SPDX-License-Identifier: GPL-3.0-or-later
"""Designed drivers against decks that were written by hand: own gate pulses, own switches, own parts.

Only the motor comes from the package. A deck states the parts that the design had when it was written; the test first
compares them with the design of today.
"""

import re
import shutil
import subprocess
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import Design
from pyspice_runner.drivers.loads import NO_BLEEDER
from pyspice_runner.spice.library import number
from tests.motors import BEAM40

START, STEADY = 1e-3, 3e-3  # s, of a run from rest, and of one in which the networks settle: they decay in 0.5 ms
HELD = 10e-3  # s, of a run with the shaft held, in which the motor settles, too
LAST = 0.5e-3  # s of such a run, over which the means are taken


def transistor(switch: re.Match[str]) -> str:
    """Return an IRF610 by Vishay's data sheet 91023 in place of a switch.

    Gate at 12 V behind 22 Ω, square law with 0.8 S at 2 A, 0.45 of the 1.5 Ω in series, 140, 53 and 15 pF at 25 V,
    0.6 µC from 3.3 A. What the sheet does not state, the gate-drain capacitance below 1 V, has the law of a VDMOS
    (ngspice, DevCapVDMOS in devsup.c) from 171 to 10 pF: y + s tanh(v/2) above 0 V and y + s atan(v/2) below, with
    s = 161 pF/(1 + π/2) and y = 171 pF - s. At -25 V it is 15 pF.
    """
    name, drain, source, on = switch.groups()
    gate = f"v(x{name},{drain})"
    charge = (
        f"108.4p*{gate} + 62.6p*({gate} > 0 ? 2*ln(cosh(0.5*max({gate}, 0))) "
        f": {gate}*atan(0.5*{gate}) - ln(1 + 0.25*{gate}*{gate}))"
    )
    return (
        f"M{name} {drain} x{name} i{name} i{name} mos\nRm{name} i{name} {source} 0.45\n"
        f"Ro{name} {drain} {source} 100meg\nEg{name} y{name} {source} {on} 0 12\nRg{name} y{name} z{name} 22\n"
        f"Rn{name} z{name} x{name} 3\nCs{name} x{name} i{name} 125p\nCd{name} x{name} {drain} q='{charge}'"
    )


SWITCH, LOSS = r"^S(\w+) (\S+) (\S+) (\S+) 0 fet$", r"@s(\w+)\[p\]"
OF_EACH = (SWITCH, LOSS)  # these patterns stand once for each switch
TRANSISTORS = {
    SWITCH: transistor,
    r"^\.model fet .*$": ".model mos nmos level=1 kp=0.16 vto=3 is=1e-30",
    r"^(\.model body d is=1n rs=0\.3 n=1\.5).*$": r"\1 cjo=216p vj=0.8 m=0.5 tt=180n",
    LOSS: r"@m\1[p] @rm\1[p] @ro\1[p]",
}
EDGES = "10n"  # s, time step that resolves the edges: with 4 ns the losses change by 0.1 %
STATES = ("stall", "operating point", "no load")
DECKS = Path(__file__).parent / "hand_decks"
DRIVES: dict[str, tuple[str, str, str, float | None, float]] = {
    "bimodal40_full_bridge_inductor": ("bimodal40", "full-bridge", "inductor", 24.0, 20.0),
    "bimodal40_half_bridge_llcc": ("bimodal40", "half-bridge", "llcc", 100.0, 20.0),
    "bimodal40_linear_llcc": ("bimodal40", "linear", "llcc", None, 20.0),
    "bimodal40_push_pull_inductor": ("bimodal40", "push-pull", "inductor", 24.0, 20.0),
    "beam40_half_bridge_inductor": (BEAM40, "half-bridge", "inductor", 100.0, 30.0),
    "beam40_full_bridge_llcc": (BEAM40, "full-bridge", "llcc", 48.0, 30.0),
}


def measured(
    name: str, motor: pr.Motor, folder: Path, speed: float | None, duration: float | None = None
) -> dict[str, complex]:
    """Return the fundamentals of the vectors of a deck over its last whole periods, and as ``mean …`` their means.

    The shaft is held at a speed in rad/s; with ``None`` it starts from rest. With a duration in s the deck has
    the transistors of :data:`TRANSISTORS`.
    """
    pr.export_motor(motor, folder / "motor.lib")
    text = (DECKS / f"{name}.cir").read_text(encoding="utf-8")
    changes: dict[str, Any] = {r"^(Vshaft shaft 0) .*$": rf"\1 {speed!r}"}
    if speed is None:
        changes = {r"^Vshaft .*\n": "", r"i\(Vshaft\)": "v(shaft)"}
    if duration is not None:
        changes |= {
            r"^\.tran 50n .*$": rf".tran {EDGES} {duration} {duration - LAST} {EDGES} uic",
            **(TRANSISTORS if "Sa1" in text else {}),
        }
    switches = len(re.findall(r"^S", text, re.M))
    for pattern, line in changes.items():
        text, count = re.subn(pattern, line, text, flags=re.M)
        assert count == (switches if pattern in OF_EACH else 1)
    saved = " ".join(re.findall(r"^\.save (.*)$", text, re.M)).lower().split()
    stated = re.search(r" frequency=(\S+)", text)
    assert stated
    frequency = number(stated.group(1))
    control = f".control\nrun\nset wr_singlescale\nset numdgt=10\nwrdata out.txt {' '.join(saved)}\nquit 0\n.endc\n.end"
    (folder / "deck.cir").write_text(text.replace(".end", control), encoding="utf-8")
    ngspice = shutil.which("ngspice")
    assert ngspice
    subprocess.run([ngspice, "-b", "deck.cir"], cwd=folder, check=True, capture_output=True, timeout=600)
    time, *columns = np.loadtxt(folder / "out.txt").T
    periods = int((time[-1] - time[0]) * frequency)
    within = time >= time[-1] - periods / frequency
    turns = np.exp(-2j * np.pi * frequency * time[within])
    found: dict[str, complex] = {}
    for vector, values in zip(saved, columns, strict=True):
        length = time[within][-1] - time[within][0]
        found[vector] = complex(2j * np.trapezoid(values[within] * turns, time[within]) / length)
        found[f"mean {vector}"] = complex(np.trapezoid(values[within], time[within]) / length)
    return found


def stated(name: str) -> dict[str, float]:
    """Return the parameters of a deck that are numbers."""
    text = (DECKS / f"{name}.cir").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith(".param")]
    return {key: number(value) for line in lines for key, value in re.findall(r"(\w+)=([\d.]+[a-z]*)(?=\s|$)", line)}


def designed(name: str, motor: pr.Motor) -> Design:
    """Return the design of today for the drive of a deck."""
    _, stage, network, rail, speed = DRIVES[name]
    parts: dict[str, Any] = {} if stage == "linear" else {"mosfet": "IRF610"}
    if "5m\n" in (DECKS / f"{name}.cir").read_text(encoding="utf-8"):  # the transformer of the deck
        label = "bridge" if stage == "push-pull" else "transformer"
        values = {"magnetizing": 5e-3, "primary_resistance": 0.3, "secondary_resistance": 1.2}
        parts |= {f"{label}.{parameter}": value for parameter, value in values.items()}
        parts |= {"transformer": True} if stage == "half-bridge" else {}
    spec = pr.DriverSpec(pr.default_drive(motor), stage, network, rail, parts)
    design = pr.design(motor, spec, speed=speed)
    assert design.feasible, design.reason
    return design


def magnetising_loss(driver: dict[str, Any], rail: float | None) -> float:
    """Return the loss in W of the triangular magnetising currents, which the design leaves out.

    Amplitude V/(4 f L) and RMS value 1/√3 of it, in the primary's 0.3 Ω and 1.5 Ω of each transistor in series.
    """
    kind = driver["kind"]
    if rail is None or not (kind == "push-pull" or "transformer" in driver["parts"]["a"]):
        return 0.0
    volts = rail if kind != "half-bridge" else 0.5 * rail
    ohms = 0.3 + 1.5 * (2.0 if kind == "full-bridge" else 1.0)
    return 2.0 * (volts / (4.0 * driver["frequency"] * 5e-3)) ** 2 / 3.0 * ohms


def compared(name: str, state: str, folder: Path) -> dict[str, tuple[float, float, float]]:
    """Return quantity → value in the deck, value in the design, and 1 % of what the difference counts against.

    The torque counts against the friction torque under the preload: that of a period is the difference between times
    of drive and of brake, each of which is a share of it, and at no load it goes through 0. A current counts against
    the greatest of its group from stall to no load, which sizes the stage: the steps of a design, for 1 % of the
    friction torque, leave up to 1.3 % of the least one, the difference between the currents of capacitance and motion.
    """
    motor = pr.load_motor(DRIVES[name][0])
    design = designed(name, motor)
    point = next(point for point in design.points if point.state == state)
    speed = point.speed_rad_s
    deck = measured(name, motor, folder, speed)
    found: dict[str, tuple[float, float, float]] = {}
    for group in ("a", "b"):
        volts, amperes = point.group(group).voltage_v, point.group(group).current_a
        most = max(other.group(group).current_a for other in design.points)
        found[f"voltage {group}"] = (abs(deck[f"v({group})"]), volts, 0.01 * volts)
        found[f"current {group}"] = (abs(deck[f"i(vi{group})"]), amperes, 0.01 * most)
    told = point.stage_power_w + magnetising_loss(design.driver.to_dict(), DRIVES[name][3])
    # the design leaves out the diodes, which conduct in the dead time, and the snubbers of a push-pull stage
    beside = [value.real for vector, value in deck.items() if re.match(r"mean (@d|v\(snubbers)", vector)]
    power = told + sum(beside)
    found["supply power"] = (deck["mean v(power)"].real, power, 0.01 * power)
    # the source that holds the shaft takes the torque of the contact less that of the bearing
    torque = deck["mean i(vshaft)"].real + motor.rotor.bearing_damping_n_m_s * speed
    friction = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    return found | {"torque": (torque, point.torque_n_m, 0.01 * friction)}


@pytest.mark.soak
@pytest.mark.parametrize("name", DRIVES)
def test_a_deck_written_by_hand_has_the_parts_of_the_design(name: str) -> None:
    _, _, network, _, _ = DRIVES[name]
    design = designed(name, pr.load_motor(DRIVES[name][0]))
    parameters = stated(name)
    values = design.driver.to_dict()
    for group in ("a", "b"):
        parts: dict[str, Any] = values["parts"][group]
        net = parts[network]
        prefix = "series_" if network == "llcc" else ""
        assert parameters[f"coil_{group}"] == pytest.approx(net[f"{prefix}inductance"])
        assert parameters[f"series_{group}"] == pytest.approx(net[f"{prefix}capacitance"])
        assert parameters.get(f"bleed_{group}", NO_BLEEDER) == pytest.approx(net["bleeder"])
        for label in {"transformer", "bridge"} & parts.keys():
            if "ratio" in parts[label]:
                assert parameters[f"ratio_{group}"] == pytest.approx(parts[label]["ratio"])
        if "amplifier" in parts:
            share = values["ratio_b"] if group == "b" else 1.0
            assert parameters[f"level_{group}"] == pytest.approx(share * values["voltage"], rel=1e-5)  # six digits
    assert parameters["ahead"] == pytest.approx(values["phase_deg"], rel=1e-5)


BEYOND = {  # 1.1 to 1.3 % apart; behind filters and linear stages, which leave less distortion, they agree
    ("bimodal40_push_pull_inductor", "stall"), ("bimodal40_push_pull_inductor", "operating point"),
    ("bimodal40_push_pull_inductor", "no load"),
}  # fmt: skip


@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "state"),
    [
        pytest.param(*both, marks=[pytest.mark.xfail(strict=True, reason="1.1 to 1.3 % apart")] * (both in BEYOND))
        for both in product(DRIVES, STATES)
    ],
)
def test_a_deck_written_by_hand_has_the_voltages_currents_power_and_torque_of_the_design(
    name: str, state: str, tmp_path: Path
) -> None:
    """Within 1 %.

    The design counts the fundamental of the stage alone; the deck has switching edges, dead time of 200 ns (0.03 % of
    the fundamental) and harmonics. It settles until the slowest mode has decayed to 0.4 %, that of beam40 to 6 %.
    """
    for quantity, (deck, design, bound) in compared(name, state, tmp_path).items():
        assert deck == pytest.approx(design, abs=bound), quantity


def transistor_losses(deck: dict[str, complex], losses_w: dict[str, float]) -> tuple[float, float]:
    """Return the loss of all transistors without their gates, in a deck and in a report."""
    lost = sum(value.real for vector, value in deck.items() if vector.startswith("mean @"))
    ours = sum(
        loss for key, loss in losses_w.items()
        if key.startswith("bridge_") and key.rpartition(".")[2] in {"p", "n", "high", "low", "ph", "pl", "nh", "nl"}
    )  # fmt: skip
    ours -= 3.0 / 22.0 * sum(loss for key, loss in losses_w.items() if key.endswith(".gates"))  # 3 Ω are inside
    return lost, ours


def started(name: str, folder: Path, duration: float = START) -> dict[str, tuple[float, float, float]]:
    """Return the values of :func:`compared` for a start from rest.

    They are the mean speed in the last half millisecond, and the loss of all transistors without that of their gates.
    """
    motor = pr.load_motor(DRIVES[name][0])
    design = designed(name, motor)
    report = pr.drive_report(motor, design, duration=duration, audit=False)
    assert report.design
    assert report.design.starts
    deck = measured(name, motor, folder, None, duration)
    lost, ours = transistor_losses(deck, report.losses_w)
    speed = report.mean_rotor_speed_rad_s
    found = {"speed": (deck["mean v(shaft)"].real, speed, 0.01 * speed)}
    return found | ({"FET loss": (lost, ours, 0.01 * ours)} if ours else {})


@pytest.mark.soak
@pytest.mark.parametrize("name", DRIVES)
def test_the_motor_of_a_deck_starts_from_rest_as_that_of_the_design(name: str, tmp_path: Path) -> None:
    """Within 3 %: the first switching edge of the design is another one; a period is 25 µs."""
    deck, design, bound = started(name, tmp_path)["speed"]
    assert deck == pytest.approx(design, abs=3.0 * bound)


@pytest.mark.soak
@pytest.mark.parametrize("duration", [START, STEADY])
@pytest.mark.parametrize("name", [name for name, (_, stage, *_) in DRIVES.items() if stage != "linear"])
def test_the_transistors_of_a_deck_lose_as_much_as_those_of_the_design(
    name: str, duration: float, tmp_path: Path
) -> None:
    """Within 5 %: two models of a transistor, and at ``beam40`` behind half bridges 2 % more voltage left at turn-on.

    In short steps (10 ns, a tenth of the tolerances) the design differs as much, by 4.0 % there.
    """
    deck, design, bound = started(name, tmp_path, duration)["FET loss"]
    assert deck == pytest.approx(design, abs=5.0 * bound)


@pytest.mark.soak
def test_the_operating_point_of_a_report_has_the_power_and_the_losses_of_a_deck_that_holds_the_shaft(
    tmp_path: Path,
) -> None:
    """Power within 2 %: means over 20 periods scatter by 1 %; measured: 0.8 % less. Losses as above: 0.4 % less."""
    name = "bimodal40_full_bridge_inductor"
    motor = pr.load_motor("bimodal40")
    report = pr.drive_report(motor, designed(name, motor), audit=False)
    assert report.operating
    deck = measured(name, motor, tmp_path, 20.0, HELD)
    assert report.operating.supply_power_w == pytest.approx(deck["mean v(power)"].real, rel=0.02)
    lost, ours = transistor_losses(deck, report.operating.losses_w)
    assert lost == pytest.approx(ours, rel=0.05)


if __name__ == "__main__":
    for deck in DRIVES:
        for place in (*STATES, START, STEADY):
            with TemporaryDirectory() as scratch:
                folder = Path(scratch)
                rows = compared(deck, place, folder) if isinstance(place, str) else started(deck, folder, place)
            told = [f"{key} {design:.4g} {(one - design) / bound:+.2f} %" for key, (one, design, bound) in rows.items()]
            print(f"{deck}, {place}: {'; '.join(told)}", flush=True)
