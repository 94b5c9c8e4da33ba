# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors with several contacts: a travelling-wave ring, and two tips on one stator."""

from math import cos, pi, sin
from pathlib import Path

import pyspice_runner as pr

RADIUS, HEIGHT, WAVES = 0.03, 0.004, 9


def ring_text(points: int = 8, turn: float = 0.0) -> str:
    """Return a ring with two degenerate modes; its electrodes are turned by an angle of the wave in rad."""
    a, b = f"{0.3 * cos(turn)!r}", f"{0.3 * sin(turn)!r}"
    mode = "mass_kg = 0.0176\ndamping_n_s_per_m = 45.0\nstiffness_n_per_m = 1.08e9\nrecoil_kg = 0.0"
    text = f"""
name = "ring"
[[modes]]
name = "cosine"
{mode}
coupling_a_n_per_v = {a}
coupling_b_n_per_v = -{b}
[[modes]]
name = "sine"
{mode}
coupling_a_n_per_v = {b}
coupling_b_n_per_v = {a}
[piezo]
capacitance_a_f = 1e-8
capacitance_b_f = 1e-8
loss_tangent = 0.01
[contact]
normal_stiffness_n_per_m15 = {170.0 / (points * WAVES) / 4.25e-6**1.5!r}
tangential_compliance_tip_m_per_n23 = 1.4e-6
tangential_compliance_rotor_m_per_n23 = 1.4e-6
friction = 0.2
preload_n = 170.0
[rotor]
radius_m = {RADIUS}
inertia_kg_m2 = 7e-5
bearing_damping_n_m_s = 1e-5
[mount]
stiffness_n_per_m = 100.0
mass_kg = 0.1
damping_n_s_per_m = 400.0
[drive]
kind = "two-phase"
voltage = 175.0
frequency = 39.9e3
phase_deg = 90.0
"""
    for point in range(points):
        c, s = cos(2.0 * pi * point / points), sin(2.0 * pi * point / points)
        along = HEIGHT * WAVES / RADIUS
        text += f"""
[[contacts]]
name = "p{point + 1}"
multiplicity = {WAVES}
tip_x = {{ cosine = {along * s!r}, sine = {-along * c!r} }}
tip_y = {{ cosine = {c!r}, sine = {s!r} }}
"""
    return text


def ring(folder: Path, points: int = 8, turn: float = 0.0) -> pr.Motor:
    """Return that ring."""
    return loaded(folder, ring_text(points, turn))


def loaded(folder: Path, text: str) -> pr.Motor:
    """Return the motor of a text."""
    path = folder / "motor.toml"
    path.write_text(text, encoding="utf-8")
    return pr.load_motor(path)


def plain(motor: pr.Motor) -> dict:
    """Return the document of a motor without what moves springs by voltages, which several contacts do not have."""
    moved = {f"piezo.motion_{axis}_{group}_m_per_v": 0.0 for axis in "xy" for group in "ab"}
    return motor.updated(moved).model_dump()


def with_contacts(motor: pr.Motor, *places: dict) -> pr.Motor:
    """Return a motor with some contacts that move as its own tip, apart from the values that are given."""
    from pyspice_runner.motor.motor import assemble

    document = plain(motor)
    tips = {axis: {mode.name: getattr(mode, axis) for mode in motor.modes} for axis in ("tip_x", "tip_y")}
    contacts = [{**tips, **place} for place in places]
    return assemble({**document, "drive": motor.drive, "contacts": contacts}, None, {}, where=motor.name)
