# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor calibrate``: parameters of a motor from measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

import pyspice_runner as pr
from pyspice_runner.calibration.spectra import SPECTRUM_ERROR
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import RunOptions, Targets, with_options
from pyspice_runner.impedance.spectrum import Connection, State


@with_options
def calibrate(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    points: Annotated[
        Path | None,
        typer.Option(
            help="CSV of measured points: voltage, temperature, speed_rad_s, torque_n_m, torque_n_m_error, "
            "current_a_phase_deg, resonance_hz, …"
        ),
    ] = None,
    free: Annotated[
        str,
        typer.Option(metavar="PATH,…", help="Parameters to calibrate: contact.friction,modes.*.quality_factor."),
    ],
    spectrum: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[STATE=]FILE[@…]",
            help="Spectrum: free=FILE, or preloaded=FILE of the stator pressed on its rotor. Without a state the name "
            "of the file tells it: preloaded if it has that word. After @ its temperature in °C and the amplitude at "
            "the stator in V: free=a.csv@temperature=40,level=20. Repeatable.",
        ),
    ] = None,
    connection: Annotated[Connection, typer.Option(help="Connection of the groups in the spectra.")] = "A",
    spectrum_error: Annotated[
        float, typer.Option(help="Relative standard error of a measured admittance.")
    ] = SPECTRUM_ERROR,
    transient: Annotated[
        list[Path] | None,
        typer.Option(help="CSV of a run-up from rest: time_s, speed_rad_s, speed_rad_s_error, voltage, … Repeatable."),
    ] = None,
    columns: measured.ColumnsOption = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH=PERCENT", help="What is known: the motor's value with this deviation. Repeatable."),
    ] = None,
    against: Annotated[
        list[str] | None,
        typer.Option(metavar="LAW", help="Another law of the contact, to compare how well it fits. Repeatable."),
    ] = None,
    starts: Annotated[int, typer.Option(help="Number of starts, all but the first within a factor of 2.")] = 1,
    resume: Annotated[
        Path | None,
        typer.Option(help="JSON file in which an unfinished calibration is kept; if it exists, go on from it."),
    ] = None,
    run: RunOptions,
    targets: Targets,
) -> int:
    """Calibrate parameters against measured points, spectra and run-ups. Writes .toml (motor), .json, .csv (residuals).

    Each value has a standard error and a 95 % interval; a warning names what the data do not decide, and the
    measurement that would.

    Example: piezomotor calibrate bimodal40 --points points.csv --free contact.friction --output calibrated.toml
    """
    files = [_stated(text) for text in spectrum or ()]
    inputs = [motor, points, resume, *(file for file, *_ in files), *(transient or ())]
    targets.check(".toml", ".json", ".csv", inputs=inputs)
    loaded = common.load_changed(motor, run.changes)
    read = measured.reader(columns, None)
    spectra = [(read(file), state, conditions) for file, state, conditions in files]
    told = "is not PATH=PERCENT; write it as contact.friction=20%."
    priors = {path: common.percentage("--prior", path, text) for path, text in common.pairs_of("--prior", prior, told)}
    try:
        with common.counting("steady states") as progress:
            result = pr.calibrate(
                loaded, points, free=[path.strip() for path in free.split(",") if path.strip()],
                spectra=spectra, connection=connection, spectrum_error=spectrum_error,
                transients=transient or (), priors=priors,
                drive=drive.stated(loaded), against=against or (), starts=starts, progress=progress, checkpoint=resume,
                **run.settings,
            )  # fmt: skip
    except KeyboardInterrupt as interrupt:
        told = str(interrupt) or "nothing was kept; with --resume FILE a calibration can be continued"
        common.complain(f"piezomotor: interrupted; {told}.")
        return common.INTERRUPTED
    common.caution(result)
    targets.deliver(result, f"{loaded.name}, calibrated with {result.sources}")
    return 0


def _stated(text: str) -> tuple[Path, State, dict[str, float]]:
    """Return the file of a spectrum, the state of the tip, and its conditions."""
    own, at, conditions = text.rpartition("@")
    if not at or "=" not in conditions:  # a file with the sign in its name
        own, conditions = text, ""
    found = {}
    for part in conditions.split(",") if conditions else ():
        key, _, value = part.partition("=")
        if key.strip() in found:
            raise pr.ParameterError(f"--spectrum {text!r} gives {key.strip()} twice. Give it once.")
        try:
            found[key.strip()] = float(value)
        except ValueError:
            raise pr.ParameterError(
                f"--spectrum {text!r} is not valid: write the conditions as FILE@temperature=40,level=20."
            ) from None
    for state in get_args(State):
        if own.startswith(f"{state}="):
            return Path(own.removeprefix(f"{state}=")), state, found
    return Path(own), "preloaded" if "preload" in Path(own).stem.lower() else "free", found
