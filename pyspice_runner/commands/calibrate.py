# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor calibrate`` and ``motor-from``: a motor from measurements, or from the numbers of a data sheet."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any, get_args

import pyspice_runner as pr
from pyspice_runner.calibration.spectra import SPECTRUM_ERROR
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.options import DRIVE, LAW, TARGETS, Call, Option, argument, command, option
from pyspice_runner.impedance.spectrum import Connection, State


@command(
    "motor", DRIVE, "points free spectrum connection spectrum_error transient columns prior against starts resume", LAW,
    "timeout changes", TARGETS,
    points=option(
        "CSV of measured points: voltage, temperature, speed_rad_s, torque_n_m, torque_n_m_error, current_a_phase_deg, "
        "resonance_hz, …", Path | None
    ),
    free=option("Parameters to calibrate: contact.friction,modes.*.quality_factor.", str, ..., metavar="PATH,…"),
    spectrum=option(
        "Spectrum: free=FILE, or preloaded=FILE of the stator pressed on its rotor. Without a state the name of the "
        "file gives it: preloaded if it has that word. After @ its temperature in °C and the amplitude at the stator "
        "in V: free=a.csv@temperature=40,level=20. Repeatable.", list[str] | None, metavar="[STATE=]FILE[@…]"
    ),
    connection=option("Connection of the groups in the spectra.", Connection, "A"),
    spectrum_error=option("Relative standard error of a measured admittance.", float, SPECTRUM_ERROR),
    transient=option(
        "CSV of a run-up from rest: time_s, speed_rad_s, speed_rad_s_error, voltage, … Repeatable.", list[Path] | None
    ),
    prior=option(
        "Prior knowledge: the motor's value with this deviation. Repeatable.", list[str] | None, metavar="PATH=PERCENT"
    ),
    against=option(
        "Another law of the contact, to compare how well it fits. Repeatable.", list[str] | None, metavar="LAW"
    ),
    starts=option("Starts within a factor of 2, compared by ngspice; default 1, or 16 with close modes.", int | None),
    resume=option("JSON file in which an unfinished calibration is kept; if it exists, go on from it.", Path | None),
)  # fmt: skip
def calibrate(call: Call) -> int:
    """Calibrate parameters against measured points, spectra and run-ups. Writes .toml (motor), .json, .csv (residuals).

    Each value has a standard error and a 95 % interval; a warning names what the data do not identify, and the
    measurement that would.

    Example: piezomotor calibrate bimodal40 --points points.csv --free contact.friction --output calibrated.toml
    """
    if not call.spectrum:
        call.refuse_idle("without --spectrum", "connection spectrum_error")
    if not call.transient:
        call.refuse_idle("without --transient", "soft_start")
    files = [_stated(text) for text in call.spectrum or ()]
    inputs = [call.motor, call.points, call.resume, *(file for file, *_ in files), *(call.transient or ())]
    call.check(".toml", ".json", ".csv", inputs=inputs)
    loaded = call.loaded
    read = measured.reader(call.columns, None)
    spectra = [(read(file), state, conditions) for file, state, conditions in files]
    form = "is not PATH=PERCENT; write it as contact.friction=20%."
    priors = {
        path: common.percentage("--prior", path, text) for path, text in common.pairs_of("--prior", call.prior, form)
    }
    state, own = call.resume, None
    if state is None:
        own = Path(tempfile.mkdtemp(prefix="piezomotor-kept-"))
        state = own / "calibration.json"
    try:
        with common.busy("steady states", "{}") as progress:
            result = pr.calibrate(
                loaded, call.points, free=[path.strip() for path in call.free.split(",") if path.strip()],
                spectra=spectra, transients=call.transient or (), priors=priors, drive=call.stated,
                against=call.against or (), contact=call.law, progress=progress,
                checkpoint=state, **call.pick("connection spectrum_error starts timeout"),
            )  # fmt: skip
    except KeyboardInterrupt as interrupt:
        done = "nothing was kept; it had just begun"
        if str(interrupt):
            done, own = f"{interrupt}: --resume {state}", None
        common.complain(f"piezomotor: interrupted; {done}.")
        return common.INTERRUPTED
    finally:
        if own is not None:
            shutil.rmtree(own, ignore_errors=True)
    call.deliver(result, f"{loaded.name}, calibrated with {result.sources}")
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


_SHEET = "no_load_speed low_speed low_voltage stall_torque stall_force voltage frequency"
_RATED = "rated_speed rated_load rated_current rated_power"
_ERRORS = "speed_error torque_error current_error"


def _sheet(text: str, default: float | None = None) -> Option:
    """Return an option of a number of the data sheet."""
    return option(text, float | None if default is None else float, default, rich_help_panel="Data sheet")


@command(
    "sheet other both difference preloaded connection", _SHEET, "phase", _RATED, _ERRORS,
    "mass tips modes base columns page as_json output",
    sheet=argument(
        "Spectrum of the free stator: a two-port, or group A. Without it the motor is of the class of --base.",
        Path | None, None, "FILE",
    ),
    preloaded=option("Spectrum of the stator pressed on its rotor.", Path | None),
    connection=option("Connection of the groups in a preloaded two-port.", Connection, "A"),
    no_load_speed=_sheet("rad/s, or m/s of a linear stage."),
    low_speed=_sheet("The same at --low-voltage."),
    low_voltage=_sheet("Amplitude below --voltage, V."),
    stall_torque=_sheet("N·m."),
    stall_force=_sheet("Of a linear stage, N."),
    voltage=_sheet("Amplitude on each group, V."),
    frequency=_sheet("Of the drive, Hz."),
    phase=_sheet("Of group B, degrees: 90, or without spectra that of --base."),
    rated_speed=_sheet("Of a point at the same drive, rad/s or m/s."),
    rated_load=_sheet("Of the rated point, N·m or N."),
    rated_current=_sheet("RMS of a group at the rated point, A."),
    rated_power=_sheet("Electrical, at the rated point, W."),
    speed_error=_sheet("Relative, of the speed.", 0.02),
    torque_error=_sheet("Relative, of torques and forces.", 0.02),
    current_error=_sheet("Relative, of current and power.", 0.05),
    base=option(
        "Motor to take contact and rotor from: andersen2002, or without FILE bimodal40, whose class it is.",
        str | None, rich_help_panel="Both groups, towards a motor",
    ),
    page=option("A page, .html, with the data and the motor together.", Path | None),
)  # fmt: skip
def motor_from(call: Call) -> None:
    """Make a motor from spectra and numbers of its data sheet, or from a data sheet alone. Writes .toml or .json.

    The spectra are those of `fit --two-port` or `fit --b`. The no-load speed determines the modal mass, the stall load
    the friction, a preloaded spectrum the contact's stiffness. Without spectra the motor has the force and the speed of
    the sheet and is otherwise similar to --base. The table gives the origin of each value: spectrum, data sheet,
    derived, or class average with its spread. A motor with --stall-force is a linear stage, in m/s and N.

    Example: piezomotor motor-from free.csv --no-load-speed 18.4 --stall-torque 0.9e-3 --voltage 300 --frequency 54e3
    """
    inputs = [call.sheet, call.other, call.both, call.difference, call.preloaded, call.base]
    call.check(".toml", ".json", inputs=inputs)
    common.check_targets(call.page, (".html",), None, inputs)
    stall = call.stall_torque if call.stall_force is None else call.stall_force
    if (call.no_load_speed, stall, *call.pick(_RATED).values()) == (None,) * 6:
        call.refuse_idle("without --no-load-speed or --stall-torque", "voltage frequency phase")
    if call.no_load_speed is None or call.mass is not None:  # with the mass, the speed is computed to compare it
        call.refuse_idle("without --no-load-speed, or with --mass-kg", "speed_error")
    if stall is None and call.rated_load is None:
        call.refuse_idle("without --stall-torque, --stall-force or --rated-load", "torque_error")
    if call.rated_current is None and call.rated_power is None:
        call.refuse_idle("without --rated-current or --rated-power", "current_error")
    if call.sheet is None and (call.other or call.both or call.difference):
        raise pr.ParameterError("--b, --sum and --difference go with FILE, the spectrum of group A. Give it too.")
    masses = common.grid_or_none("--mass-kg", call.mass)
    mass_kg = masses[0] if masses and len(masses) == 1 else masses
    read = measured.reader(call.columns, None)
    with common.busy("reading"):
        files = {"A": call.sheet, "B": call.other, "A+B": call.both, "A-B": call.difference}
        spectra = {name: read(path) for name, path in files.items() if path is not None}
        pressed = read(call.preloaded) if call.preloaded is not None else None
    if pressed is None or pressed.ports == 1:
        call.refuse_idle("without a --preloaded two-port", "connection")
    given: Any = spectra if len(spectra) > 1 else spectra.get("A")
    with common.busy("fitting", "step {} of at most {}") as progress:
        result = pr.motor_from(
            given, preloaded=pressed, mass_kg=mass_kg, tips=measured.tips_of(call.tips), progress=progress,
            **call.pick(f"{_SHEET} {_RATED} {_ERRORS} modes connection base", phase_deg="phase"),
        )  # fmt: skip
    writings = [(call.output, result.save)]
    if call.page is not None:
        with common.busy("page"):
            drive = pr.default_drive(result.motor)
            shown = pr.report(result.motor, drive, levels=(1.0,), measured=spectra.get("A"))
        writings.append((call.page, shown.save))
    table = common.summary_table(result.summary(), result.motor.name)
    common.deliver(result.to_dict(), table, call.as_json, *writings)
    measured.note(result.cautions, call)
