# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of the commands, each declared once, and :func:`command`, which gives a command its options.

typer reads the options of a command from the signature of its function. The functions here take one argument, the
:class:`Call`, and name their options; :func:`command` builds the signature from :data:`OPTIONS`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, wraps
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.circuit.law import LAWS, PAPER_LAW
from pyspice_runner.commands import common
from pyspice_runner.errors import located
from pyspice_runner.motor.drive import DRIVES, OnePhaseDrive
from pyspice_runner.result import Result
from pyspice_runner.spice import Engine

NONE = "none"
_Write = Callable[[Path], object]
_Texts = list[str] | None
_VOLTAGE = 50.0  # V, for a kind of drive that the motor does not recommend


class Option(NamedTuple):
    """An option or an argument of the command line."""

    kind: Any  # the type of its value
    default: Any  # ``...`` for none
    described: Any  # for typer: its names, help and further settings


def option(text: str, kind: Any = float | None, default: Any = None, *flags: str, **more: Any) -> Option:
    """Return an option: help, type, default (``...`` for none), names, further arguments of ``typer.Option``.

    The name is by default the key of the option. A number may have a suffix, and a unit that the help names.
    """

    def parsed(given: str | float) -> float:
        try:
            return common.number(given, units=text) if isinstance(given, str) else given
        except pr.ParameterError as error:
            raise typer.BadParameter(str(error)) from None

    if kind in (float, float | None):
        more |= {"parser": parsed, "metavar": "NUMBER"}
    return Option(kind, default, typer.Option(*flags, help=text, **more))


def argument(text: str, kind: Any, default: Any, metavar: str, **more: Any) -> Option:
    """Return an argument, as :func:`option`."""
    return Option(kind, default, typer.Argument(help=text, metavar=metavar, **more))


def _panel(title: str, **options: Option) -> dict[str, Option]:
    """Return options with the title of their panel in the help."""
    for one in options.values():
        one.described.rich_help_panel = title
    return options


def _laws(incomplete: str) -> list[str]:
    return [name for name in (*LAWS, NONE) if name.startswith(incomplete)]


DRIVERS = (
    "ideal, linear, feedback, half-bridge, full-bridge, push-pull, or FILE:NAME of your own subcircuit; with "
    "+inductor, +l or +llcc a matching network"
)
VOLTAGE = option("Amplitude of group A, V; default: the motor's recommended drive.")
PHASE = option("Phase of group B ahead of group A, degrees; default: the recommended drive.")
DRIVE = "drive voltage frequency phase ratio_b voltage_1 frequency_1 voltage_2 frequency_2 soft_start"
LAW = "contact sliders"
PERIOD = f"{LAW} step timeout"
DRIVER = "driver match part mosfet"
CHANGES = "changes preload friction temperature"
TARGETS = "as_json output plot"
LOAD = ("--load", "--load-torque")  # both names of the load, of which the first is shown
ROOM_C = 25.0  # °C, of the parameters of a motor without a table of limits
LEAST_C, MOST_C = -60.0, 200.0  # °C, within which linear drift is a fair description of a hard ceramic
OPTIONS: dict[str, Option] = {
    # the motor
    "motor": argument(
        "A parameter set, or the path of a TOML file.", str, ..., "MOTOR", autocompletion=common.complete_motor
    ),
    "changes": option(
        "Change a parameter by its path in `show --json` or in the motor's TOML: contact.preload_n=8. Repeatable.",
        _Texts, None, "--set", metavar="PATH=VALUE",
    ),
    "preload": option("Preload, N; the same as --set contact.preload_n=PRELOAD."),
    "friction": option("Friction coefficient; the same as --set contact.friction=FRICTION."),
    "temperature": option("Temperature of the stator, °C, with the coefficients of drift of `export --thermal`."),
    "contact": option(
        f"Contact law: {', '.join(LAWS)}, the path of a .lib file, or none for a free tip.",
        str, PAPER_LAW.name, metavar="LAW", autocompletion=_laws,
    ),
    "sliders": option("Number of sliders of the brush; default: 8.", int | None),
    # the shaft
    "speed": option("Speed of the held shaft, rad/s (slider: m/s); default: free."),
    "load_torque": option("Torque that a load draws from the free shaft, N.m (slider: N).", float, 0.0, *LOAD),
    # how it is run
    "duration": option("Simulated time, s."),
    "step": option("Longest time step, s; default: from the fastest motion."),
    "accuracy": option("Error allowed of the torque, relative to mu F0 R."),
    "timeout": option("Stop ngspice after this time, s."),
    "audit": option("Whether a result that fails the physical audit is an error.", bool, True, "--audit/--no-audit"),
    "averaged": option("Average over the drive's period, for runs over seconds.", bool, False),
    "engine": option(
        "Of the averaged motor. compiled: C code; spice: ngspice; auto: C code where a compiler is installed.",
        Engine, "auto",
    ),
    "over": option(
        "An axis: drive.frequency=44e3:46e3:10 (first:last:count). Repeatable.", _Texts, metavar="PATH=VALUES"
    ),
    "speeds": option("Speeds, rad/s (slider: m/s): 0,2.5,5, or 0:10:6 for six from 0 to 10.", str | None),
    # where the result goes
    "as_json": option("Print one JSON object and nothing else.", bool, False, "--json"),
    "output": option("Write the result to a file; the ending sets the format.", Path | None),
    "plot": option("Plot the result to a .png, .svg or .pdf file.", Path | None),
    # the driver
    "driver": option(f"Driver in front of the motor: {DRIVERS}; default: ideal voltages.", str | None),
    "match": option(
        "Choose the parts of the network for the motor from stall to no load; --part states them instead.",
        bool, True, "--match/--no-match",
    ),
    "part": option(
        "Change a part of the driver, as bridge.dead_time=3e-7, or supply_v. Repeatable.",
        _Texts, metavar="PART.PARAMETER=VALUE",
    ),
    "mosfet": option(
        "MOSFET of a bridge: IRF530, IRF610, IRF820, or FILE:NAME of a .subckt or .model; default: IRF610, with "
        "--rail the one with the lowest losses whose voltage suffices.", str | None, metavar="NAME"
    ),
    **_panel(
        "Drive",
        drive=option(
            "two-phase: eq. (1); two-tone: eq. (2). Default: the motor's recommended drive.",
            Literal["two-phase", "two-tone"] | None,
        ),
        voltage=option("Two-phase: amplitude of group A, V."),
        frequency=option("Two-phase: frequency, Hz."),
        phase=option("Phase, degrees."),
        ratio_b=option("Two-phase: amplitude of group B over that of A."),
        voltage_1=option("Two-tone: amplitude of the common tone, V."),
        frequency_1=option("Two-tone: common tone, Hz."),
        voltage_2=option("Two-tone: amplitude of the opposed tone, V."),
        frequency_2=option("Two-tone: opposed tone, Hz."),
        soft_start=option("Rise time of the amplitude, s."),
    ),
    # measured spectra
    "file": argument("A measured spectrum in any known format.", Path, ..., "FILE"),
    "columns": option(
        "Columns of a table whose header is missing or unknown, as frequency_hz,r_ohm,x_ohm or f_hz,z_ohm,phase_deg; "
        "- for a column to ignore.", str | None, metavar="NAME,…"
    ),
    "through": option(
        "Single device in an .s2p: series between the ports, or shunt to ground. By default detected.",
        Literal["series", "shunt"] | None,
    ),
    "trace": option("One of several spectra in the file, such as memory.", str | None),
    "start": option("Lowest frequency to use, Hz.", float, 0.0),
    "stop": option("Highest frequency to use, Hz."),
    "modes": option("Number of motional arms; selected by default.", int | None),
    "noise": option(
        "Known error: proportional=0.1%, s11=1e-4 (in 50 Ω) or z=0.1 (Ω). Estimated by default.",
        str | None, metavar="KIND=VALUE,…",
    ),
    "leads": option(
        "auto: fit leads if the data need them; none: leads are compensated; or their values, as 20nH,0.1ohm.",
        str, "auto", metavar="auto|none|L,R",
    ),
    "no_leads": option("The same as --leads none.", bool, False),
    **_panel(
        "Fixture",
        opened=option("Spectrum of the fixture without the device.", Path | None, None, "--open"),
        short=option("Spectrum of the fixture with a short.", Path | None),
        fixture_load=option("Spectrum of the fixture with a resistor of --load-ohm.", Path | None, None, "--load"),
        load_ohm=option("Resistance of that resistor, Ω.", float, 50.0),
        port_extension=option("Delay of a 50 Ω cable before the device, one way, s.", float, 0.0),
    ),
    **_panel(
        "Several spectra of one device",
        series=option("Spectrum of the same device, fitted together. Repeatable.", list[Path] | None, None, "--with"),
        voltages=option("Amplitudes at the device in V, of FILE and each --with: 1,5,20.", str | None),
        temperatures=option("Temperatures in °C, of FILE and each --with: 20,40,60.", str | None),
    ),
    **_panel(
        "Both groups, towards a motor",
        two_port=option("Fit both groups of a two-port together.", bool, False),
        other=option("Spectrum of group B, A shorted; FILE is then A.", Path | None, None, "--b"),
        both=option("Spectrum of A and B in parallel.", Path | None, None, "--sum"),
        difference=option("Spectrum of A against B.", Path | None),
        mass=option("Modal mass in kg: one, or one per mode: 2e-3,3e-3.", str | None, None, "--mass-kg"),
        velocity=option(
            "Instead, tip velocity per motional current of --connection, m/s/A: of mode 1, or of each mode.",
            str | None, None, "--velocity-per-current",
        ),
        tips=option(
            "Direction of the tip's motion in a mode, as 0,1. Once for each mode.", _Texts, None, "--tip", metavar="X,Y"
        ),
        base=option("Motor to take contact and rotor from.", str, "andersen2002"),
    ),
}  # fmt: skip


def at_temperature(motor: pr.Motor, celsius: float) -> pr.Motor:
    """Return a motor whose stator has a temperature in °C. Raise ParameterError beyond the Curie temperature."""
    limits = motor.limits
    ambient, most = (ROOM_C, MOST_C) if limits is None else (limits.ambient_c, limits.curie_temperature_c)
    if not LEAST_C <= celsius <= most:
        raise pr.ParameterError(
            f"--temperature {celsius:g} °C is out of range: it must be from {LEAST_C:g} to {most:g} °C."
        )
    if motor.structure or motor.solid or motor.ring:
        common.complain("piezomotor: The stress of the ceramic is not computed at --temperature.", style="yellow")
    return pr.Thermal.of(motor).warmed(motor, celsius - ambient)


class Call:
    """One call of a command: its options as attributes, by their keys in :data:`OPTIONS`.

    Attributes:
        context: typer's context of the call.
        values: value of each option.
    """

    def __init__(self, context: typer.Context, values: Mapping[str, Any]) -> None:
        self.context, self.values = context, values
        self.driven = values.get("driver") is not None  # whether a driver stands between drive and motor

    def __getattr__(self, name: str) -> Any:
        """Return the value of an option."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None

    @cached_property
    def loaded(self) -> pr.Motor:
        """The motor with the values of ``--set`` in place, but for those of a driver."""
        return self.load(self.motor)

    def load(self, source: str) -> pr.Motor:
        """Return a motor with the values of ``--set``, ``--preload`` and ``--friction``, at ``--temperature``."""
        of_driver = self._of_driver
        changes = [change for change in self.changes or [] if change not in of_driver]
        changes += [
            f"{path}={self.values[key]!r}" for key, path in common.SHORTCUTS.items() if self.values.get(key) is not None
        ]
        motor = common.load_changed(source, changes)
        celsius = self.values.get("temperature")
        return motor if celsius is None else at_temperature(motor, celsius)

    @property
    def _of_driver(self) -> list[str]:
        changes = self.changes or [] if self.driven else []
        return [change for change in changes if change.strip().startswith("driver.")]

    @cached_property
    def stated(self) -> pr.TwoPhaseDrive | pr.TwoToneDrive:
        """The drive for the motor: the recommended one, with the options of the call in place.

        Raise ParameterError for an option of the other kind of drive, or a missing or invalid value.
        """
        self._check_frequency()
        recommended = pr.default_drive(self.loaded)
        chosen: str = self.drive or next(one for one, kind in DRIVES.items() if type(recommended) is kind)
        other = next(one for one in DRIVES if one != chosen and (chosen == "two-tone" or one == "two-tone"))
        kind = DRIVES[chosen]
        if chosen == "one-phase":
            self.refuse_idle(f"on {self.loaded.name}, which has one group", "phase ratio_b")
        for name in DRIVES[other].model_fields:
            if name not in kind.model_fields and self.values[name] is not None:
                raise pr.ParameterError(
                    f"--{name.replace('_', '-')} has no effect on a {chosen} drive. Add --drive {other}, or leave it "
                    "out."
                )
        base: dict[str, Any]
        if type(recommended) is kind:
            base = recommended.model_dump()
        elif chosen != "two-tone":
            base = {"voltage": _VOLTAGE, "frequency": self.loaded.modes[self.loaded.main_mode].frequency_hz}
        elif self.frequency_1 is None or self.frequency_2 is None:
            raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
        else:
            base = {"voltage_1": _VOLTAGE, "voltage_2": _VOLTAGE}
        given = {**self.values, "phase_deg": self.phase}
        return kind(**base | {name: given[name] for name in kind.model_fields if given[name] is not None})

    def one_tone(self, what: str) -> pr.TwoPhaseDrive:
        """Return the drive. Raise ParameterError, with what needs one frequency, for two tones."""
        if not isinstance(self.stated, pr.TwoPhaseDrive):
            raise pr.ParameterError(f"{what} a drive with one frequency. Add --drive two-phase.")
        return self.stated

    def phases(self, **more: float) -> pr.TwoPhaseDrive:
        """Return a drive with the voltage, frequency and phase given, the others from the recommended drive.

        It has one phase for a motor with one group. Raise ParameterError if a value is missing and the motor recommends
        two tones.
        """
        if alone := len(self.loaded.groups) == 1:
            self.refuse_idle(f"on {self.loaded.name}, which has one group", "phase ratio_b")
        self._check_frequency()
        given = self.pick("voltage frequency", phase_deg="phase")
        missing = [name.removesuffix("_deg") for name, value in given.items() if value is None]
        recommended = pr.default_drive(self.loaded)
        if missing and not isinstance(recommended, pr.TwoPhaseDrive):
            raise pr.ParameterError(
                f"The recommended drive of {self.loaded.name} has two tones, and this command needs two phases of one "
                f"tone. Give --{' and --'.join(missing)}."
            )
        found = {name: getattr(recommended, name) if value is None else value for name, value in given.items()}
        return (OnePhaseDrive if alone else pr.TwoPhaseDrive)(**found | more)

    def _check_frequency(self) -> None:
        """Raise ParameterError for a frequency in Hz that is meant in kHz: a thousandth of a resonance."""
        resonances = [mode.frequency_hz for mode in self.loaded.modes]
        low, high = min(resonances), max(resonances)
        if self.frequency is not None and 0.5 * low < 1e3 * self.frequency < 2.0 * high:
            raise pr.ParameterError(
                f"--frequency {self.frequency:g} is in Hz, and the modes of {self.loaded.name} are at {low / 1e3:.4g} "
                f"to {high / 1e3:.4g} kHz. Did you mean {self.frequency:g}k?"
            )

    @cached_property
    def law(self) -> pr.Law | None:
        """The law of the contact; ``None`` for a free tip.

        Raise ParameterError for an unknown law, or sliders of another law.
        """
        law = None if self.contact == NONE else pr.Law(self.contact)
        sliders = self.values.get("sliders")
        if sliders is None:
            return law
        if law is None or not law.row:
            rows = " or ".join(name for name in LAWS if pr.Law(name).row)
            raise pr.ParameterError(f"--sliders has no effect without --contact {rows}. Leave it out.")
        return pr.Law(self.contact, sliders)

    def refuse_idle_match(self, *drivers: str) -> None:
        """Refuse ``--match`` and ``--no-match`` if no driver has a matching network."""
        if all("+" not in words for words in drivers):
            self.refuse_idle("without a matching network, such as --driver half-bridge+llcc", "match")

    def check_driver(self) -> None:
        """Refuse options that have no effect without a driver, or without a network."""
        if self.driver is None:
            self.refuse_idle("without --driver", "match part mosfet")
        else:
            self.refuse_idle_match(self.driver)

    def in_front(self) -> pr.TwoPhaseDrive | pr.TwoToneDrive | pr.Driver:
        """Return what is in front of the motor: its drive, or the driver."""
        self.check_driver()
        if self.driver is None:
            return self.stated
        return self.spec_of(self.driver, self.stated).built(self.loaded, contact=self.law)

    def spec_of(self, words: str, drive: pr.TwoPhaseDrive | pr.TwoToneDrive, *, strict: bool = True) -> pr.DriverSpec:
        """Return the specification of a stage, and behind a + its network. Raise ParameterError for a two-tone drive.

        Unless ``strict``, changes and a MOSFET that do not suit the driver are left out.
        """
        from pyspice_runner.drivers.driver import BRIDGES

        if not isinstance(drive, pr.TwoPhaseDrive):
            raise pr.ParameterError("A driver makes two phases of one tone. Add --drive two-phase.")
        network: Any  # which the driver checks
        stage, plus, network = words.rpartition("+")
        if not plus or ":" in network:  # a + in the name of a file
            stage, network = words, "none"
        given: dict[str, Any] = self._parts()
        if not strict:
            plain = pr.DriverSpec(drive, stage, network).driver(voltage=1.0, frequency=1e4)
            present = {item.label for item in plain.parts("a")}
            labels = {path: path.partition(".")[0].removesuffix("_a").removesuffix("_b") for path in given}
            given = {path: value for path, value in given.items() if "." not in path or labels[path] in present}
        if self.mosfet is not None and (strict or stage in BRIDGES):
            given["mosfet"] = self.mosfet
        rail, match, ohms = (self.values.get(name) for name in ("rail", "match", "source_resistance"))
        return pr.DriverSpec(drive, stage, network, rail, given, match is not False, ohms)

    def _parts(self) -> dict[str, Any]:
        """Return the changes of the driver's parts, by ``--part`` and by ``--set driver.…``."""
        values = {}
        form = "is not PART.PARAMETER=VALUE; write it as bridge.dead_time=3e-7."
        for path, text in common.pairs_of("--part", [*(self.part or []), *self._of_driver], form):
            same = path.lower()  # SPICE does not distinguish case
            if same in values:
                raise pr.ParameterError(f"--part {path} is given twice, with different capitalisation. Give it once.")
            with located(f"--part {path}"):
                values[same] = common.number(text)
        return values

    def pick(self, names: str, **renamed: str) -> dict[str, Any]:
        """Return arguments for a function: options by their names, and others as ``argument="option"``."""
        return {name: self.values[name] for name in names.split()} | {
            name: self.values[key] for name, key in renamed.items()
        }

    def refuse_idle(self, reason: str, names: str) -> None:
        """Raise ParameterError for the first of these options that is on the command line: it has no effect."""
        for name in common.stated_options(self.context, *names.split()):
            raise pr.ParameterError(f"{name} has no effect {reason}. Leave it out.")

    def check(self, *endings: str, inputs: Iterable[str | Path | None] = (), starts: bool = True) -> None:
        """Check the files to write (:func:`.common.check_targets`), and refuse a soft start of what has no start."""
        if not starts:
            self.refuse_idle("on a steady state, which has no start", "soft_start")
        common.check_targets(self.output, endings, self.values.get("plot"), inputs)

    def deliver(self, result: Result, title: str, table: Table | str = "") -> None:
        """Print the cautions of a result, write its files, and print summary or table, or with ``--json`` the whole."""
        common.caution(result)
        self.write(result.to_dict(), table or common.summary_table(result.summary(), title), result.save, result.plot)

    def write(
        self, document: Mapping[str, Any], table: Table | str, save: _Write, draw: _Write = lambda _: None
    ) -> None:
        """Write the files by two functions and print a table, or with ``--json`` a document."""
        common.deliver(document, table, self.as_json, (self.output, save), (self.values.get("plot"), draw))


def command(*names: str, **own: Any) -> Callable[[Callable[[Call], int | None]], Callable[..., int | None]]:
    """Give a command its options.

    Args:
        names: keys of :data:`OPTIONS`, in the order of the help; a text may have several, with spaces between them.
        own: an :class:`Option` of this command alone, or another default of an option of the table.
    """
    keys = " ".join(names).split()
    table = {
        key: own[key] if isinstance(own.get(key), Option)
        else OPTIONS[key]._replace(default=own.get(key, OPTIONS[key].default))
        for key in dict.fromkeys([*keys, *own])
    }  # fmt: skip

    def decorated(function: Callable[[Call], int | None]) -> Callable[..., int | None]:
        @wraps(function)
        def whole(context: typer.Context, **values: Any) -> int | None:
            return function(Call(context, values))

        by_name, none = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.empty
        parameters = [inspect.Parameter("context", by_name, annotation=typer.Context)]
        for key, (kind, default, described) in table.items():
            default = none if default is ... else default
            if default is False and described.default is ...:  # without a name typer would add a --no-
                described.param_decls = (f"--{key.replace('_', '-')}",)
            parameters.append(inspect.Parameter(key, by_name, default=default, annotation=Annotated[kind, described]))
        vars(whole)["__signature__"] = inspect.Signature(parameters)
        vars(whole)["__annotations__"] = {one.name: one.annotation for one in parameters}
        return whole

    return decorated
