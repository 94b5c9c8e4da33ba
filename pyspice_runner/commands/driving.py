# SPDX-License-Identifier: GPL-3.0-or-later
"""The drive of the paper's equations (1) and (2) that the command line specifies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pyspice_runner as pr
from pyspice_runner.motor.drive import DRIVES

_VOLTAGE = 50.0  # V, for a kind of drive that the motor does not recommend
_TWO_PHASE = ("voltage", "frequency", "ratio_b")
_TWO_TONE = ("voltage_1", "frequency_1", "voltage_2", "frequency_2")


def check_frequency(motor: pr.Motor, frequency: float | None) -> None:
    """Raise ParameterError for a frequency in Hz that is meant in kHz: a thousandth of a resonance."""
    resonances = [mode.frequency_hz for mode in motor.modes]
    if frequency is not None and 0.5 * min(resonances) < 1e3 * frequency < 2.0 * max(resonances):
        raise pr.ParameterError(
            f"--frequency {frequency:g} is in Hz, and the modes of {motor.name} are at {min(resonances) / 1e3:.4g} to "
            f"{max(resonances) / 1e3:.4g} kHz. Did you mean {frequency:g}k?"
        )


def stated(options: Mapping[str, Any], motor: pr.Motor) -> pr.TwoPhaseDrive | pr.TwoToneDrive:
    """Return the drive for a motor: the recommended one, with the options that were given in place.

    Raise ParameterError for an option of the other kind of drive, or a missing or invalid value.
    """
    check_frequency(motor, options["frequency"])
    recommended = pr.default_drive(motor)
    chosen: str = options["drive"] or next(one for one, kind in DRIVES.items() if type(recommended) is kind)
    for name in _TWO_TONE if chosen == "two-phase" else _TWO_PHASE:
        if options[name] is not None:
            other = next(one for one in DRIVES if one != chosen)
            raise pr.ParameterError(
                f"--{name.replace('_', '-')} has no effect on a {chosen} drive. Add --drive {other}, or leave it out."
            )
    kind = DRIVES[chosen]
    fields = {name: options[name] for name in kind.model_fields if name != "phase_deg"} | {
        "phase_deg": options["phase"]
    }
    given = {name: value for name, value in fields.items() if value is not None}
    if type(recommended) is kind:
        return kind(**(recommended.model_dump() | given))
    if chosen == "two-phase":
        return pr.TwoPhaseDrive(**({"voltage": _VOLTAGE, "frequency": motor.modes[-1].frequency_hz} | given))
    if options["frequency_1"] is None or options["frequency_2"] is None:
        raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
    return pr.TwoToneDrive(**({"voltage_1": _VOLTAGE, "voltage_2": _VOLTAGE} | given))


def recommended_phases(
    motor: pr.Motor, voltage: float | None, frequency: float | None, phase_deg: float | None
) -> dict[str, float]:
    """Return voltage, frequency and phase of two phases: those given, the others from the motor's recommended drive.

    Raise ParameterError if a value is missing and the motor recommends two tones.
    """
    check_frequency(motor, frequency)
    given = {"voltage": voltage, "frequency": frequency, "phase_deg": phase_deg}
    missing = [name.removesuffix("_deg") for name, value in given.items() if value is None]
    recommended = pr.default_drive(motor)
    if missing and not isinstance(recommended, pr.TwoPhaseDrive):
        raise pr.ParameterError(
            f"The recommended drive of {motor.name} has two tones, and this command needs two phases of one tone. Give "
            f"--{' and --'.join(missing)}."
        )
    return {name: getattr(recommended, name) if value is None else value for name, value in given.items()}


def one_tone(drive: pr.TwoPhaseDrive | pr.TwoToneDrive, what: str) -> pr.TwoPhaseDrive:
    """Return a drive with one frequency. Raise ParameterError, with what needs it, for two tones."""
    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError(f"{what} a drive with one frequency. Add --drive two-phase.")
    return drive
