# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors with several contacts, compared with an independent integrator: ``python -m validation.contacts``.

A lined ring with 8 and with 16 points on a wave, and a plate with two tips, each with contacts that stay closed and
with contacts that lift off: ten points each, five with the shaft held and five with a free one under load. Further
cases are the symmetries, a single contact given as a list, and a ring below its resonance, reached from above and from
rest. The integrator alone shows how many points suffice, and the figures of a prototype. The integrator
(:mod:`validation.contact_points`) shares no code with the package; both run from preloaded rest, and their means over
the same last periods are compared.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from tests.rings import loaded, ring_text, with_contacts
from validation.campaign import Campaign
from validation.contact_points import Drive, History, Points, integrate, no_load, read, settle

ALLOWED = 5e-3  # of μ F₀ R for a torque, of the speed at no load for a speed, of their product for a power
SAME = 1e-9  # of the largest value of a column: one contact given as a list
MIRRORED = 1e-4  # of the fastest speed: both runs have the same error, apart from ngspice's iteration
PERIODS, MEANS = 240, 40  # of a run from rest, and of its end that is compared
STEPS = 800  # of the integrator in a period; twice as many change the table by less than 1e-4
PACKAGE_STEPS = 100  # of the package in a period, its default
SPEEDS = (0.0, 0.2, 0.4, 0.6, 0.8)  # of the speed at no load, held
LOADS = (0.0, 0.2, 0.4, 0.6, 0.8)  # of the stall torque, on a free shaft
LINING = 4e7  # N/m of all points
KAPPA = 1.2  # limit of stick of the ring over μ δ
ANGLE = 0.7  # rad, by which a basis of modes is turned
TILT = 0.17  # y of a tip per x of a bending mode: 0.9 mm beside the middle, times the slope of the edge, about 7.9/L


@dataclass(frozen=True)
class Setting:
    """A motor, its drive, and about what it does at stall and at no load by the integrator."""

    motor: str
    voltage: float
    frequency: float
    stall: float
    """N·m"""
    speed: float
    """rad/s"""


SETTINGS = {
    "ring8 closed": Setting("ring8", 175.0, 39.9e3, 0.335, 17.7),
    "ring8 open": Setting("ring8", 350.0, 39.9e3, 0.73, 45.6),
    "ring16 closed": Setting("ring16", 175.0, 39.9e3, 0.335, 17.7),
    "ring16 open": Setting("ring16", 350.0, 39.9e3, 0.73, 45.6),
    "tips closed": Setting("tips", 60.0, 40.7e3, 0.017, 9.0),
    "tips open": Setting("tips", 220.0, 40.7e3, 0.06, 100.0),
}
"""by the beginning of the keys"""
SINGLE = ("bimodal40", "examples/plate40.toml")
PROTOTYPE = {39.9e3: (0.338, 171.0), 40.3e3: (0.195, 51.0), 41e3: (0.042, 5.0)}
"""N·m at stall and rpm at no load by Hz, as printed for 8 points at 175 V with constants of two or three digits"""
WITHIN_DIGITS = {
    "stiffness": np.full(2, 1.0823e9),
    "damping": np.full(2, 45.49),
    "coupling": 0.302 * np.eye(2),
    "normal": np.full(8, 4.049e7 / 8),
}
"""constants that print as those of the prototype, fitted to its figures: torques within 0.2 % of μ F₀ R"""
POINTS = (4, 8, 16, 32)
SUFFICE = (1e-4, 1e-3)  # by which stall and no load with 8 points may differ from those with 32: the prototype's claim
HIGH, LOW, RATE, STAY = 40.4e3, 39.65e3, 1.5e5, 120  # Hz, Hz, Hz/s, and periods at the end of the sweep
LITTLE = 15.0  # N·s/m of a mode: with the 45 of the prototype the motion has one branch
WAVE_POINTS = 40  # of a period of the swept voltage


@cache
def motor_of(name: str) -> pr.Motor:
    """Return a motor of the campaign; its shaft is light, so that a free one settles in the run."""
    with tempfile.TemporaryDirectory() as folder:
        if name.startswith("ring"):
            motor = loaded(Path(folder), ring_text(int(name.removeprefix("ring"))))
            stiffness = LINING / sum(place.multiplicity for place in motor.contacts)
            changes = {
                f"contact.tangential_compliance_{part}_m_per_n23": 0.5 * KAPPA / stiffness for part in ("tip", "rotor")
            }
            changes |= {"contact.exponent": 1.0, "contact.normal_stiffness_n_per_m15": stiffness}
            return motor.updated({**changes, "rotor.inertia_kg_m2": 1e-5, "piezo.loss_tangent": 0.0})
        whole = pr.load_motor("bimodal40").updated(
            {
                "contact.normal_stiffness_n_per_m15": 1.5e9,  # of two pads
                "contact.restitution": 1.0,
                "contact.series_compliance_m_per_n": 0.0,
                "contact.tangential_series_compliance_m_per_n": 0.0,
                "piezo.loss_tangent": 0.0,
                "rotor.inertia_kg_m2": 3e-7,
            }
        )
        bending = [mode for mode in whole.modes if abs(mode.tip_x) > 0.1]
        pairs = [
            {
                "name": side,
                "share": share,
                "tip_y": {
                    mode.name: mode.tip_y + (sign * TILT * mode.tip_x if mode in bending else 0.0)
                    for mode in whole.modes
                },
            }
            for side, sign, share in (("left", 1.0, 0.55), ("right", -1.0, 0.45))
        ]  # fmt: skip
        return with_contacts(whole, *pairs)


def keys() -> list[str]:
    """Return the keys of the cases."""
    return [
        *(f"prototype {frequency:g}" for frequency in PROTOTYPE),
        *(f"points {number} {state}" for state in ("closed", "open") for number in POINTS),
        *(f"single {name}" for name in SINGLE),
        "mirror",
        "turned",
        *(f"{kind} {place}" for kind in SETTINGS for place in range(len(SPEEDS) + len(LOADS))),
        "sweep down",
        "sweep up",
    ]


def outcome(key: str) -> dict[str, Any]:
    """Return the outcome of a case."""
    kind, _, which = key.rpartition(" ")
    if kind in SETTINGS:
        return _compared(kind, int(which))
    if kind == "sweep":
        return {"kind": "sweep", "way": which, **_swept(which)}
    if kind == "prototype":
        rings, drive = (
            {"found": prototype(8), "within_digits": prototype(8, **WITHIN_DIGITS)},
            Drive(175.0, float(which)),
        )
        return {"kind": kind, "frequency": float(which), **{name: _ends(ring, drive) for name, ring in rings.items()}}
    if kind.startswith("points"):
        number, voltage = int(kind.split()[1]), {"closed": 175.0, "open": 350.0}[which]
        return {"kind": f"points {which}", "points": number, "found": _ends(prototype(number), Drive(voltage, 39.9e3))}
    return {"kind": key.partition(" ")[0], "difference": _same(key)}


def prototype(points: int, **changes: Any) -> Points:
    """Return the lined ring of the prototype, which is not read from the package."""
    angle = 2.0 * pi * np.arange(points) / points
    along = 9 * 0.004 / 0.03  # waves, height and radius
    ring = Points(
        mass=np.full(2, 17.6e-3),
        damping=np.full(2, 45.0),
        stiffness=np.full(2, 1.08e9),
        coupling=0.3 * np.eye(2),
        x=along * np.stack([np.sin(angle), -np.cos(angle)], axis=1),
        y=np.stack([np.cos(angle), np.sin(angle)], axis=1),
        normal=np.full(points, LINING / points),
        kappa=np.full(points, KAPPA),
        friction=np.full(points, 0.2),
        radius=np.full(points, 0.03),
        exponent=1.0,
        preload=170.0,
        carrier_mass=0.1,
        carrier_damping=400.0,
    )
    return ring.only(**changes)


def _ends(ring: Points, drive: Drive) -> dict[str, float]:
    """Return stall torque in N·m, speed at no load in rpm, and the share of time in which the points are open."""
    stall = settle(ring, drive, 0.0, steps=STEPS // 2)
    fast = 5.0
    while settle(ring, drive, fast, steps=STEPS // 4).torque > 0.0:
        fast *= 2.0
    speed, _ = no_load(ring, drive, fast, steps=STEPS // 2)
    rpm = _digits(speed * 30.0 / pi)
    return {"stall": _digits(stall.torque), "rpm": rpm, "open": _digits(1.0 - float(stall.touching.mean()))}


def _compared(kind: str, place: int) -> dict[str, Any]:
    setting = SETTINGS[kind]
    held = place < len(SPEEDS)
    speed = SPEEDS[place] * setting.speed if held else None
    load = 0.0 if held else LOADS[place - len(SPEEDS)] * setting.stall
    motor = motor_of(setting.motor)
    points = read(motor.model_dump())
    drive = Drive(setting.voltage, setting.frequency)
    run = integrate(points, drive, blocks=PERIODS, steps=STEPS, speed=speed, load=load)
    expected = _means(run)
    source = pr.TwoPhaseDrive(voltage=setting.voltage, frequency=setting.frequency, phase_deg=90.0)
    found = _simulated(
        motor, source, PERIODS / setting.frequency, 1.0 / setting.frequency, speed=speed, load_torque=load
    )
    scales = {"torque": points.scale, "speed": setting.speed, "power": points.scale * setting.speed}
    return {
        "kind": kind,
        "open": _digits(1.0 - float(run.touching[-MEANS:].mean())),
        **{name: [_digits(expected[name]), _digits(found[name])] for name in scales},
        "errors": {name: _digits((found[name] - expected[name]) / of) for name, of in scales.items()},
    }


def _means(run: History) -> dict[str, float]:
    """Return the means over the last blocks of a run of the integrator."""
    ends = {"torque": run.torque, "speed": run.mean_speed, "power": run.power}
    return {name: float(values[-MEANS:].mean()) for name, values in ends.items()}


def _simulated(motor: pr.Motor, source: Any, duration: float, period: float, **load: Any) -> dict[str, float]:
    """Return the same means of the package."""
    run = pr.simulate(motor, source, duration, step=period / PACKAGE_STEPS, audit=False, **load)
    times = duration - np.arange(MEANS * PACKAGE_STEPS, -1, -1) / PACKAGE_STEPS * period

    def mean(values: Any) -> float:
        return float(np.trapezoid(np.interp(times, run.time_s, values), times) / (times[-1] - times[0]))

    electric = run.voltage_a_v * run.current_a_a + run.voltage_b_v * run.current_b_a
    torque = motor.rotor.radius_m * mean(run.friction_force_n)
    return {"torque": torque, "speed": mean(run.rotor_speed_rad_s), "power": mean(electric)}


def _swept(way: str) -> dict[str, Any]:
    """Return the speeds of a free shaft at LOW, reached from above, or from rest."""
    motor = motor_of("ring8").updated({f"modes.{place}.damping_n_s_per_m": LITTLE for place in range(2)})
    points, period, voltage = read(motor.model_dump()), 1.0 / LOW, 175.0
    seconds = (HIGH - LOW) / RATE if way == "down" else 0.0
    stay = STAY if way == "down" else STAY + round((HIGH - LOW) / RATE / period)
    start, begun = None, 0.0
    if seconds:
        blocks = 100
        run = integrate(points, Drive(voltage, HIGH), blocks=blocks, block=seconds / blocks, steps=STEPS, chirp=-RATE)
        start, begun = run.state[-1], (HIGH * seconds - 0.5 * RATE * seconds**2) / LOW  # time of the same phase
    run = integrate(points, Drive(voltage, LOW), blocks=stay, steps=STEPS, start=start, start_time=begun)
    expected = _means(run)
    duration = seconds + stay * period
    times = np.linspace(0.0, duration, round(WAVE_POINTS * duration * HIGH))
    sweeping = np.minimum(times, seconds)
    phase = 2.0 * pi * (HIGH * sweeping - 0.5 * RATE * sweeping**2 + LOW * (times - sweeping))
    peak = (
        voltage / np.sinc(times[1] * LOW) ** 2
    )  # of straight lines between the points, with the voltage as fundamental
    source = pr.Waveform(times, peak * np.sin(phase), peak * np.cos(phase), LOW)
    found = _simulated(motor, source, duration, period)
    return {
        "speed": [_digits(expected["speed"]), _digits(found["speed"])],
        "power": [expected["power"], found["power"]],
    }


def _same(key: str) -> float:
    """Return the largest difference of two runs that must be the same, relative to the largest value."""
    drive = pr.TwoPhaseDrive(voltage=175.0, frequency=39.9e3, phase_deg=90.0)
    if key.startswith("single"):
        motor = pr.load_motor(key.partition(" ")[2])
        one = motor.updated({f"piezo.motion_{axis}_{group}_m_per_v": 0.0 for axis in "xy" for group in "ab"})
        runs = [
            pr.simulate(each, pr.default_drive(motor), 4e-4, step=2.5e-7) for each in (one, with_contacts(motor, {}))
        ]
        pairs = [[np.asarray(getattr(run, name)) for run in runs] for name in runs[0].recorded]
        return max(float(np.abs(a - b).max() / max(np.abs(a).max(), 1e-300)) for a, b in pairs)
    motor = motor_of("ring8")
    other = turned(motor, ANGLE) if key == "turned" else motor
    again = drive.updated({"phase_deg": -90.0}) if key == "mirror" else drive
    sign = -1.0 if key == "mirror" else 1.0
    first, second = (pr.simulate(*one, 2e-3, step=2.5e-7).rotor_speed_rad_s for one in ((motor, drive), (other, again)))
    return float(np.abs(first - sign * second).max() / np.abs(first).max())


def turned(motor: pr.Motor, angle: float) -> pr.Motor:
    """Return the same ring in a basis of its two modes that is turned by an angle in rad."""
    document = motor.model_dump()
    c, s = cos(angle), sin(angle)
    basis = np.array([[c, s], [-s, c]])
    names = [mode["name"] for mode in document["modes"]]
    changes: dict[str, float] = {}
    for group in "ab":
        old = [mode[f"coupling_{group}_n_per_v"] for mode in document["modes"]]
        for place, value in enumerate(basis @ old):
            changes[f"modes.{place}.coupling_{group}_n_per_v"] = float(value)
    for number, place in enumerate(motor.contacts):
        for axis in ("tip_x", "tip_y"):
            old = [getattr(place, axis).get(name, 0.0) for name in names]
            for name, value in zip(names, basis @ old, strict=True):
                changes[f"contacts.{number}.{axis}.{name}"] = float(value)
    return motor.updated(changes)


def _digits(value: float) -> float:
    """Return a number as it is recorded."""
    return float(f"{value:.6g}")


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the largest errors by motor, the convergence with the points, and the prototype's figures beside ours."""
    table: dict[str, Any] = {"cases": len(record), "largest_errors": {}, "points": {}, "prototype": {}, "same": {}}
    for kind in SETTINGS:
        found = [one for one in record if one["kind"] == kind]
        errors = {name: max((abs(one["errors"][name]) for one in found), default=None) for name in _NAMES}
        opened = [one["open"] for one in found]
        table["largest_errors"][kind] = {
            **errors,
            "points": len(found),
            "open": [min(opened, default=None), max(opened, default=None)],
        }
    for state in ("closed", "open"):
        found = {one["points"]: one["found"] for one in record if one["kind"] == f"points {state}"}
        table["points"][state] = {
            str(number): {
                **found[number],
                **{f"{name}_of_32": found[number][name] / found[32][name] - 1.0 for name in ("stall", "rpm")},
            }
            for number in POINTS
            if number in found and 32 in found
        }
    for one in record:
        if one["kind"] == "prototype":
            printed = dict(zip(("stall", "rpm"), PROTOTYPE[one["frequency"]], strict=True))
            table["prototype"][f"{one['frequency']:g}"] = {
                "printed": printed,
                **{name: one[name] for name in ("found", "within_digits")},
            }
        elif "difference" in one:
            table["same"][one["index"]] = one["difference"]
        elif one["kind"] == "sweep":
            table[f"sweep_{one['way']}"] = {"speed": one["speed"], "power": one["power"]}
    return table


def passes(table: Mapping[str, Any]) -> bool:
    """Whether the package agrees with the integrator, and 8 points suffice.

    The prototype's figures are shown and not judged: half of the last printed digit of the stiffness moves the
    resonance by a fifth of its width. WITHIN_DIGITS shows how near constants within these digits come.
    """
    errors = [one[name] for one in table["largest_errors"].values() for name in _NAMES]
    enough = [
        abs(one["8"][f"{name}_of_32"]) <= most
        for one in table["points"].values() for name, most in zip(("stall", "rpm"), SUFFICE, strict=True)
    ]  # fmt: skip
    same = all(value <= (SAME if key.startswith("single") else MIRRORED) for key, value in table["same"].items())
    down, up = (table[f"sweep_{way}"]["speed"] for way in ("down", "up"))
    followed = all(abs(ours - theirs) <= ALLOWED * abs(down[0]) for theirs, ours in (down, up))
    return all(error <= ALLOWED for error in errors) and all(enough) and same and followed and down[1] > 2.0 * up[1]


_NAMES = ("torque", "speed", "power")
CAMPAIGN = Campaign("contacts", outcome, summary, passes, len(keys()), keys=keys)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
