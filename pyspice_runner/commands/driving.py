# SPDX-License-Identifier: GPL-3.0-or-later
"""The options by which commands state a drive."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

import pyspice_runner as pr


class DriveKind(StrEnum):
    """The drives of the paper's equations (1) and (2)."""

    two_phase = "two-phase"
    two_tone = "two-tone"


DriveOption = Annotated[DriveKind, typer.Option("--drive", help="two-phase: eq. (1); two-tone: eq. (2).")]
VoltageOption = Annotated[float, typer.Option(help="Two-phase: amplitude of both groups, V.")]
FrequencyOption = Annotated[float | None, typer.Option(help="Two-phase: frequency, Hz; default: the last mode.")]
PhaseOption = Annotated[float | None, typer.Option(help="Phase, degrees: 90 for two phases, 0 for two tones.")]
Voltage1Option = Annotated[float, typer.Option("--voltage-1", help="Two-tone: amplitude of the common tone, V.")]
Frequency1Option = Annotated[float | None, typer.Option("--frequency-1", help="Two-tone: the common tone, Hz.")]
Voltage2Option = Annotated[float, typer.Option("--voltage-2", help="Two-tone: amplitude of the opposed tone, V.")]
Frequency2Option = Annotated[float | None, typer.Option("--frequency-2", help="Two-tone: the opposed tone, Hz.")]
SoftStartOption = Annotated[float, typer.Option(help="Rise time of the amplitude, s.")]


def stated_drive(
    motor: pr.Motor,
    kind: DriveKind,
    voltage: float,
    frequency: float | None,
    phase: float | None,
    tones: tuple[float, float | None, float, float | None],
    soft_start: float,
) -> pr.TwoPhaseDrive | pr.TwoToneDrive:
    """Return the drive that the options state; ``tones`` are voltage and frequency of the first and the second."""
    if kind is DriveKind.two_phase:
        return pr.TwoPhaseDrive(
            voltage=voltage,
            frequency=motor.modes[-1].frequency_hz if frequency is None else frequency,
            phase_deg=90.0 if phase is None else phase,
            soft_start=soft_start,
        )
    voltage_1, frequency_1, voltage_2, frequency_2 = tones
    if frequency_1 is None or frequency_2 is None:
        raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
    return pr.TwoToneDrive(
        voltage_1=voltage_1,
        frequency_1=frequency_1,
        voltage_2=voltage_2,
        frequency_2=frequency_2,
        phase_deg=0.0 if phase is None else phase,
        soft_start=soft_start,
    )
