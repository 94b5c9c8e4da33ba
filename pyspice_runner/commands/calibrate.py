# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor calibrate``: parameters of a motor from measurements."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import get_args

import pyspice_runner as pr
from pyspice_runner.calibration.spectra import SPECTRUM_ERROR
from pyspice_runner.commands import common, measured
from pyspice_runner.commands.options import DRIVE, LAW, TARGETS, Call, command, option
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
    starts=option("Number of starts within a factor of 2: 1, or 16 with close modes.", int | None),
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
