# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that state a drive of the paper's equations (1) and (2), declared once for all commands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

import typer

import pyspice_runner as pr
from pyspice_runner.commands.options import Options
from pyspice_runner.motor.drive import DRIVES

_option = partial(typer.Option, rich_help_panel="Drive")


DriveKind = Literal["two-phase", "two-tone"]
_VOLTAGE = 50.0  # V, for a kind of drive that the motor does not recommend

_TWO_PHASE = ("voltage", "frequency", "ratio_b")
_TWO_TONE = ("voltage_1", "frequency_1", "voltage_2", "frequency_2")


@dataclass(frozen=True)
class DriveOptions(Options):
    """The drive as the command line states it; ``None`` for each option that was not given."""

    drive: Annotated[
        DriveKind | None, _option(help="two-phase: eq. (1); two-tone: eq. (2). Default: the motor's recommended drive.")
    ] = None
    voltage: Annotated[float | None, _option(help="Two-phase: amplitude of group A, V.")] = None
    frequency: Annotated[float | None, _option(help="Two-phase: frequency, Hz.")] = None
    phase: Annotated[float | None, _option(help="Phase, degrees.")] = None
    ratio_b: Annotated[float | None, _option(help="Two-phase: amplitude of group B over that of A.")] = None
    voltage_1: Annotated[float | None, _option("--voltage-1", help="Two-tone: amplitude of the common tone, V.")] = None
    frequency_1: Annotated[float | None, _option("--frequency-1", help="Two-tone: common tone, Hz.")] = None
    voltage_2: Annotated[float | None, _option("--voltage-2", help="Two-tone: amplitude of the opposed tone, V.")] = (
        None
    )
    frequency_2: Annotated[float | None, _option("--frequency-2", help="Two-tone: opposed tone, Hz.")] = None
    soft_start: Annotated[float | None, _option(help="Rise time of the amplitude, s.")] = None

    def stated(self, motor: pr.Motor) -> pr.TwoPhaseDrive | pr.TwoToneDrive:
        """Return the drive for a motor: the recommended one, with the options that were given in place.

        Raise ParameterError for an option of the other kind of drive, or a missing or invalid value.
        """
        recommended = pr.default_drive(motor)
        chosen: str = self.drive or next(one for one, kind in DRIVES.items() if type(recommended) is kind)
        for name in _TWO_TONE if chosen == "two-phase" else _TWO_PHASE:
            if getattr(self, name) is not None:
                other = next(one for one in DRIVES if one != chosen)
                raise pr.ParameterError(
                    f"--{name.replace('_', '-')} has no effect on a {chosen} drive. Add --drive {other}, "
                    "or leave it out."
                )
        kind = DRIVES[chosen]
        options = {name: getattr(self, name) for name in kind.model_fields if name != "phase_deg"}
        given = {name: value for name, value in (options | {"phase_deg": self.phase}).items() if value is not None}
        if type(recommended) is kind:
            return kind(**(recommended.model_dump() | given))
        if chosen == "two-phase":
            return pr.TwoPhaseDrive(**({"voltage": _VOLTAGE, "frequency": motor.modes[-1].frequency_hz} | given))
        if self.frequency_1 is None or self.frequency_2 is None:
            raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
        return pr.TwoToneDrive(**({"voltage_1": _VOLTAGE, "voltage_2": _VOLTAGE} | given))


def recommended_phases(
    motor: pr.Motor, voltage: float | None, frequency: float | None, phase_deg: float | None
) -> dict[str, float]:
    """Return voltage, frequency and phase of two phases: those given, the others from the motor's recommended drive.

    Raise ParameterError if a value is missing and the motor recommends two tones.
    """
    given = {"voltage": voltage, "frequency": frequency, "phase_deg": phase_deg}
    missing = [name.removesuffix("_deg") for name, value in given.items() if value is None]
    recommended = pr.default_drive(motor)
    if missing and not isinstance(recommended, pr.TwoPhaseDrive):
        raise pr.ParameterError(
            f"The recommended drive of {motor.name} has two tones, and this command needs two phases of one tone. Give "
            f"--{' and --'.join(missing)}."
        )
    return {name: getattr(recommended, name) if value is None else value for name, value in given.items()}
