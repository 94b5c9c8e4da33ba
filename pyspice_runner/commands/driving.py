# SPDX-License-Identifier: GPL-3.0-or-later
"""The options by which commands state a drive of the paper's equations (1) and (2), each declared once."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial, wraps
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

import pyspice_runner as pr

Result = TypeVar("Result")

_option = partial(typer.Option, rich_help_panel="Drive")


class DriveKind(StrEnum):
    """The drives of the paper's equations (1) and (2)."""

    two_phase = "two-phase"
    two_tone = "two-tone"


@dataclass(frozen=True)
class DriveOptions:
    """What the command line says of the drive."""

    drive: Annotated[DriveKind, _option(help="two-phase: eq. (1); two-tone: eq. (2).")] = DriveKind.two_phase
    voltage: Annotated[float, _option(help="Two-phase: amplitude of both groups, V.")] = 50.0
    frequency: Annotated[float | None, _option(help="Two-phase: frequency, Hz; default: the last mode.")] = None
    phase: Annotated[float | None, _option(help="Phase, degrees: 90 for two phases, 0 for two tones.")] = None
    voltage_1: Annotated[float, _option("--voltage-1", help="Two-tone: amplitude of the common tone, V.")] = 50.0
    frequency_1: Annotated[float | None, _option("--frequency-1", help="Two-tone: the common tone, Hz.")] = None
    voltage_2: Annotated[float, _option("--voltage-2", help="Two-tone: amplitude of the opposed tone, V.")] = 50.0
    frequency_2: Annotated[float | None, _option("--frequency-2", help="Two-tone: the opposed tone, Hz.")] = None
    soft_start: Annotated[float, _option(help="Rise time of the amplitude, s.")] = 0.0

    def stated(self, motor: pr.Motor) -> pr.TwoPhaseDrive | pr.TwoToneDrive:
        """Return the drive of a motor; what is left open follows from the motor."""
        if self.drive is DriveKind.two_phase:
            return pr.TwoPhaseDrive(
                voltage=self.voltage,
                frequency=motor.modes[-1].frequency_hz if self.frequency is None else self.frequency,
                phase_deg=90.0 if self.phase is None else self.phase,
                soft_start=self.soft_start,
            )
        if self.frequency_1 is None or self.frequency_2 is None:
            raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
        return pr.TwoToneDrive(
            voltage_1=self.voltage_1,
            frequency_1=self.frequency_1,
            voltage_2=self.voltage_2,
            frequency_2=self.frequency_2,
            phase_deg=0.0 if self.phase is None else self.phase,
            soft_start=self.soft_start,
        )


def with_drive_options(command: Callable[..., Result]) -> Callable[..., Result]:
    """Give a command, in the place of its parameter ``drive``, the options of a drive one by one.

    typer reads a command's options from its signature and knows no groups of them.
    """
    hints = get_type_hints(DriveOptions, include_extras=True)
    options = [
        parameter.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY)
        for name, parameter in inspect.signature(DriveOptions).parameters.items()
    ]
    signature = inspect.signature(command, eval_str=True)
    parameters: list[inspect.Parameter] = []
    for parameter in signature.parameters.values():
        alone = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)]
        parameters += options if parameter.name == "drive" else alone

    @wraps(command)
    def whole(**values: Any) -> Result:
        drive = DriveOptions(**{option.name: values.pop(option.name) for option in options})
        return command(drive=drive, **values)

    vars(whole)["__signature__"] = signature.replace(parameters=parameters)
    return whole
