# SPDX-License-Identifier: GPL-3.0-or-later
"""Write ``docs/averaged_accuracy.md``, averaged motor against full model: ``python -m docs.averaged_accuracy``."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pyspice_runner as pr
from pyspice_runner.analysis.averaged import TRUSTED_CHECK, TRUSTED_OPEN
from pyspice_runner.analysis.steady import steady_states
from pyspice_runner.model.drive import Load
from pyspice_runner.netlist.contact import law_of
from pyspice_runner.netlist.sources import DriveSource
from pyspice_runner.run.setup import Setup

PAGE = Path(__file__).with_name("averaged_accuracy.md")
ALLOWED = 0.02  # of the friction torque: error of a point whose check passes
SPRINGS = {"stiffness_n_per_m": 2e4, "mass_kg": 0.05, "damping_n_s_per_m": 50.0}
SETTLED = 60e-3  # s: five decay times of the mount, twenty of the modes
CASES = (  # set, mount, V, Hz, degrees, speeds of the held shaft in rad/s
    ("andersen2002", None, 100.0, 51.7e3, 90.0, (0.0, 1.0)),
    ("andersen2002", None, 300.0, 52.5e3, 90.0, (0.0, 4.0)),
    ("andersen2002", None, 150.0, 54e3, -90.0, (0.0, -2.0)),
    ("andersen2002", None, 200.0, 55e3, 90.0, (0.0, 4.0)),
    ("andersen2002", None, 50.0, 56e3, 120.0, (0.0, 0.5)),
    ("andersen2002", None, 300.0, 60e3, -60.0, (0.0, -4.0)),
    ("andersen2002", SPRINGS, 200.0, 55e3, 90.0, (0.0, 4.0)),
    ("andersen2002", SPRINGS, 300.0, 57e3, -90.0, (0.0, -4.0)),
    ("andersen2002-unintended-mode", None, 100.0, 46e3, 180.0, (0.0, 10.0)),
    ("andersen2002-unintended-mode", None, 50.0, 48e3, 180.0, (0.0, 5.0)),
    ("andersen2002-unintended-mode", None, 100.0, 44.5e3, 180.0, (0.0, 10.0)),
    ("bimodal40", SPRINGS, 60.0, 40.1e3, 120.0, (0.0, 20.0)),
    ("bimodal40", SPRINGS, 115.0, 40.1e3, -120.0, (0.0, -50.0)),
)
INTRODUCTION = f"""
Mean torque of a held shaft: the averaged motor (`simulate_averaged`, {SETTLED * 1e3:g} ms) against the steady state of
the full model (`steady_state`). The error is relative to the friction torque μ F₀ R. The check passes where the motion
that the model leaves out is below {TRUSTED_CHECK:g} and the contact is closed for the whole period; the error is then
within {100.0 * ALLOWED:g} %. On the mount the stator stands on springs of 20 kN/m; elsewhere it is held at a fixed
distance.
"""


@dataclass(frozen=True)
class Row:
    """One operating point.

    Attributes:
        name: set and mount.
        drive: the drive.
        speed: of the held shaft, rad/s.
        full: mean torque of the full model, N·m.
        averaged: that of the averaged motor, N·m.
        error: their difference over μ F₀ R.
        check: motion that is left out.
        opened: share of the period in which the contact is open.
        sticks: whether the contact never slips. A standing rotor then keeps the torque that the start left.
    """

    name: str
    drive: pr.TwoPhaseDrive
    speed: float
    full: float
    averaged: float
    error: float
    check: float
    opened: float
    sticks: bool

    @property
    def verdict(self) -> str:
        """``yes`` where the check passes, ``no`` where it does not, ``sticks`` where the torque has no one value."""
        if self.sticks:
            return "sticks"
        return "yes" if self.check <= TRUSTED_CHECK and self.opened <= TRUSTED_OPEN else "no"


def rows(cases: tuple[int, ...] | None = None) -> Iterator[Row]:
    """Measure the cases, or those of the given numbers."""
    for number, (name, mount, voltage, frequency, phase, speeds) in enumerate(CASES):
        if cases is not None and number not in cases:
            continue
        motor = pr.load_motor(name)
        motor = motor.updated({f"mount.{key}": x for key, x in mount.items()} if mount else {"mount": None})
        drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
        law = law_of("spring-slider")
        states = steady_states([Setup(motor, DriveSource(drive), Load(speed), law) for speed in speeds])
        friction_torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        for speed, state in zip(speeds, states, strict=True):
            run = pr.simulate_averaged(motor, drive, SETTLED, speed=speed)
            averaged = float(run.torque_n_m[-1])
            yield Row(
                f"{name}, on the mount" if mount else name, drive, speed, state.torque_n_m, averaged,
                (averaged - state.torque_n_m) / friction_torque, float(run.check[-1]), float(run.separated[-1]),
                float(run.slip[-1]) == 0.0,
            )  # fmt: skip


def page() -> str:
    """Return the page, freshly measured."""
    found = list(rows())
    trusted, others = ([abs(row.error) for row in found if row.verdict == verdict] for verdict in ("yes", "no"))
    closing = (
        f"{len(trusted)} of {len(found)} points pass the check; the greatest error among them is "
        f"{100.0 * max(trusted):.2g} %. The greatest where the contact opens is {100.0 * max(others):.2g} %. Where a "
        "rotor that stands never slips, its torque depends on the start, in the full model too: no error is given."
    )
    head = "| motor | drive | speed rad/s | full mN·m | averaged mN·m | error % of μF₀R | check | open % | passes |"
    return "\n".join(
        [
            "<!-- Written by `python -m docs.averaged_accuracy`; a test measures a part of it again. -->",
            "# Accuracy of the averaged motor",
            "",
            *textwrap.wrap(" ".join(INTRODUCTION.split()), 110),
            "",
            head,
            "|---|---|---|---|---|---|---|---|---|",
            *(
                f"| {row.name} | {row.drive.label} | {row.speed:g} | {1e3 * row.full:.4g} | {1e3 * row.averaged:.4g} "
                f"| {'–' if row.sticks else f'{100.0 * row.error:.2f}'} | {row.check:.2g} | {100.0 * row.opened:.1f} "
                f"| {row.verdict} |"
                for row in found
            ),
            "",
            *textwrap.wrap(closing, 110),
            "",
        ]
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
