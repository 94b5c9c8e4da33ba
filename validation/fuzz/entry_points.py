# SPDX-License-Identifier: GPL-3.0-or-later
"""The entry points through which data enter the package. Each draws an invalid input and gives it to the package.

An input must be accepted, or rejected by one of the package's own errors in one clear sentence. ngspice is replaced by
a function that rejects everything: by then all input has been validated.
"""

from __future__ import annotations

import json
import platform
import random
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import typer

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.cli import app, run
from pyspice_runner.commands.common import complete_motor
from pyspice_runner.export.circuit import CircuitExport, circuit_library
from pyspice_runner.motor.beam import resonator_modes
from pyspice_runner.motor.circuit_file import is_circuit_file, load_circuit
from pyspice_runner.motor.load import SETS
from pyspice_runner.spice.library import check_parameters, data_path, library_names, parse_library
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.spice.process import silent_fault
from pyspice_runner.spice.rawfile import RawFileError, read_rawfile
from pyspice_runner.steady.speed_torque import held_point
from pyspice_runner.sweeps.store import Store
from tests.data.spectra import make
from tests.motor.toml_text import toml
from validation.fuzz import mutate
from validation.fuzz.nasty import EDGES, MARKER, NUMBERS
from validation.fuzz.spectra import MUTATIONS
from validation.fuzz.watch import watched

OURS = (pr.ParameterError, pr.SpectrumError, pr.SimulationError, RawFileError)


class Unclear(AssertionError):
    """A wrong answer: an error without a clear sentence, or an accepted value that is read back differently."""


@dataclass(frozen=True)
class EntryPoint:
    """A place where data enter the package.

    Attributes:
        name: its name.
        draw: makes a random input.
        take: gives it to the package, in a folder that it may write to.
        share: fraction of the requested inputs that it gets; less than 1 where each takes long.
    """

    name: str
    draw: Callable[[random.Random], Any]
    take: Callable[[Any, Path], object]
    share: float = 1.0


def attempt(entry_point: EntryPoint, drawn: Any, folder: Path) -> bool:
    """Return whether the package accepted an input; every failure is raised."""
    with watched(folder):
        try:
            entry_point.take(drawn, folder)
        except OURS as error:
            if not clear(str(error)):
                raise Unclear(f"not a clear sentence: {str(error)[:1000]!r}") from error
            return False
    return True


def warm() -> None:
    """Do what a process does only once, such as asking ngspice for its version and importing large libraries."""
    ngspice_version()
    platform.processor()
    for name in ("matplotlib.pyplot", "h5netcdf", "distributed", "skrf"):
        import_module(name)


def clear(message: str) -> bool:
    """Whether a message is one readable line, ends as a sentence does, and shows nothing of Python's internals."""
    return (
        message.isprintable()
        and message[-1:] in (".", "?")
        and 15 < len(message) < 1500
        and not re.search(r"Traceback|pydantic|validation error|<class|object at 0x|Input should|\bNoneType\b", message)
    )


# --- motors, in TOML ---


@cache
def _motors() -> tuple[dict[str, Any], ...]:
    """Motors stated by a beam, by modes with provenance, by arms, and by modes with materials."""
    beam = tomllib.loads((SETS / "andersen2002.toml").read_text(encoding="utf-8"))
    modes = tomllib.loads(pr.load_motor("andersen2002-unintended-mode").to_toml())
    arm = {
        "name": "up", "resistance_ohm": 1e3, "inductance_h": 0.1, "capacitance_f": 1e-10, "coupling_ratio": 1.0,
        "mass_kg": 5e-3, "tip_x": 0.0, "tip_y": 1.0,
    }  # fmt: skip
    plain = {key: {name: _plain(value) for name, value in modes[key].items()} for key in ("piezo", "contact", "rotor")}
    arms = {"name": "by its arms", "arms": [arm, arm | {"name": "along", "inductance_h": 0.02}], **plain}
    quick = {"name": "quick", "frequency_hz": 4e4, "quality_factor": 50.0, "mass_kg": 5e-3, "coupling_a_n_per_v": 0.2}
    quick |= {"coupling_b_n_per_v": -0.2, "tip_x": 1.0, "tip_y": 0.3}
    materials = {
        "tip_radius_m": 5e-3,
        "tip_youngs_modulus_pa": 3e11,
        "tip_poisson": 0.22,
        "rotor_youngs_modulus_pa": 2e11,
    }
    contact = {"materials": materials | {"rotor_poisson": 0.3}, "friction": 0.2, "preload_n": 5.0}
    return beam, modes, arms, {"name": "by its modes", "modes": [quick], **plain, "contact": contact}


def _plain(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return value["value"] if "value" in value else {name: _plain(inner) for name, inner in value.items()}


def _draw_motor(rng: random.Random) -> bytes:
    document = rng.choice(_motors())
    if rng.random() < 0.6:
        with np.errstate(all="ignore"):
            try:
                text = toml(mutate.document(document, rng))
            except (RecursionError, ValueError):  # such as a number too long for Python to write
                text = toml(document)
        return text.encode("utf-8", "surrogatepass")
    return mutate.data(toml(document).encode() if rng.random() < 0.5 else _set_text(rng), rng)


def _set_text(rng: random.Random) -> bytes:
    return rng.choice(sorted(SETS.glob("*.toml"))).read_bytes()


def _take_motor(content: bytes, folder: Path) -> None:
    path = folder / "mine.toml"
    path.write_bytes(content)
    motor = pr.load_motor(path)
    path.write_text(motor.to_toml(), encoding="utf-8")
    if pr.load_motor(path).to_dict() != motor.to_dict():
        raise Unclear("the motor differs when it is read back from its own TOML")
    json.dumps(motor.to_dict(), allow_nan=False)
    harmless(motor_library(motor))
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=motor.modes[-1].frequency_hz)
    harmless(str(motor_bench(motor, DriveSource(drive)).circuit))


_CARDS = ("subckt", "ends", "param", "func", "title", "options", "ic", "save", "model", "tran", "end")


def harmless(text: str) -> None:
    """Check that a netlist has no line but ours: text that a user gave must not become a command."""
    for line in text.split("\n")[1:]:
        found = re.match(r"\.(\w*)", line)
        if (
            (found and found[1].lower() not in _CARDS)
            or not re.match(r"[*.A-Za-z+]|$", line)
            or (MARKER in line and line[0] != "*")
        ):
            raise Unclear(f"a line that is not ours is in the netlist: {line[:80]!r}")


# --- equivalent circuits, in TOML and JSON ---


@cache
def _circuit() -> dict[str, Any]:
    arms = [
        {"resistance_ohm": 159.0, "inductance_h": 0.05, "capacitance_f": 5e-11},
        {"resistance_ohm": 1263.0, "inductance_h": 0.287, "capacitance_f": 8e-12},
    ]
    return {
        "clamped_capacitance_f": 1e-9, "loss_tangent": 0.01, "loss_reference_hz": 1e5, "lead_resistance_ohm": 0.0,
        "lead_inductance_h": 1e-6, "arms": arms,
    }  # fmt: skip


def _nothing(_: object) -> None:
    """Replace by null what JSON cannot express."""


def _draw_circuit(rng: random.Random) -> tuple[str, bytes]:
    ending = rng.choice([".json", ".toml"])
    write: Callable[[dict[str, Any]], str] = (
        (lambda document: json.dumps(document, default=_nothing)) if ending == ".json" else toml
    )
    try:
        content = write(mutate.document(_circuit(), rng)).encode("utf-8", "surrogatepass")
    except (RecursionError, ValueError, TypeError):
        content = write(_circuit()).encode()
    return ending, content if rng.random() < 0.6 else mutate.data(write(_circuit()).encode(), rng)


def _take_circuit(drawn: tuple[str, bytes], folder: Path) -> None:
    ending, content = drawn
    path = folder / f"fit{ending}"
    path.write_bytes(content)
    is_circuit_file(path)
    circuit = load_circuit(path)
    for kind in (".lib", ".toml", ".s1p", ".asy", ".kicad_sym"):
        CircuitExport(circuit, "from a fit").save(folder / f"out{kind}")
    if load_circuit(folder / "out.toml") != circuit:
        raise Unclear("the circuit differs when it is read back from its own TOML")
    harmless((folder / "out.lib").read_text(encoding="utf-8"))


# --- measured spectra ---


def _draw_spectrum(rng: random.Random) -> bytes:
    content = make.FILES[rng.choice(sorted(make.FILES))]
    for _ in range(rng.choice([1, 1, 2])):
        mutated = mutate.data(content, rng) if rng.random() < 0.6 else content
        if mutated is content:
            try:
                mutated = rng.choice(MUTATIONS)(content, rng)
            except (IndexError, ValueError, StopIteration, KeyError):  # it found nothing to change
                mutated = mutate.data(content, rng)
        content = mutated
    return content


def _take_spectrum(content: bytes, folder: Path) -> None:
    path = folder / "measured.dat"
    path.write_bytes(content)
    spectrum = pr.read_spectrum(path)
    said = [*spectrum.cautions, *spectrum.metadata, *spectrum.metadata.values(), spectrum.source, spectrum.format]
    if not all(text.isprintable() for text in said):
        raise Unclear(f"not printable: {said!r}")
    spectrum.save(folder / "again.csv")
    if not np.array_equal(pr.read_spectrum(folder / "again.csv").matrix_s, spectrum.matrix_s):
        raise Unclear("the spectrum differs when it is read back from its own file")


@np.errstate(all="ignore")
def _draw_points(rng: random.Random) -> tuple[Any, Any, int | None]:
    """A spectrum that is well formed but not, or hardly, that of a resonator; and a number of arms."""
    frequency, y = make.FREQUENCY.copy(), make.admittance()
    noise = np.random.default_rng(rng.randrange(2**32))
    for _ in range(rng.choice([1, 2, 3])):
        size = len(frequency)
        deed = rng.randrange(12)
        if deed == 0:
            kept = sorted(rng.sample(range(size), min(size, rng.choice([2, 3, 5, 8, 15, 30]))))
            frequency, y = frequency[kept], y[kept]
        elif deed == 1:
            frequency = frequency * 10.0 ** rng.uniform(-6.0, 8.0)
        elif deed == 2:
            y = np.full_like(y, rng.choice([0.0, 1.0, 1j, -1.0, 1e-300, 1e300]))
        elif deed == 3:
            y[rng.randrange(size)] = rng.choice([0.0, 1e9, -1e9, 1e-30, 1e150])
        elif deed == 4:
            y = y + noise.normal(size=size) * np.abs(y).max() * 10.0 ** rng.uniform(-4.0, 2.0)
        elif deed == 5:
            y = noise.normal(size=size) + 0j
        elif deed == 6:
            y = 1.0 / np.where(y == 0.0, 1e-300, y)
        else:
            changes = (y * 10.0 ** rng.uniform(-14.0, 14.0), -y, y.conj(), 1j * y.imag, y.real + 0j)
            y = changes[deed - 7]
    return frequency, y, rng.choice([None, None, 1, 2, 5, 20])


def _take_points(drawn: tuple[Any, Any, int | None], folder: Path) -> None:
    fit = pr.fit_spectrum(pr.Spectrum.from_admittance(*drawn[:2]), drawn[2])
    for ending in (".json", ".lib", ".toml", ".csv"):
        fit.save(folder / f"fit{ending}")
    if set(load_circuit(folder / "fit.json").arms) != set(fit.circuit.arms):
        raise Unclear("the circuit differs when it is read back from the fit's JSON")


# --- what ngspice writes ---


@cache
def _raw() -> bytes:
    time = np.linspace(0.0, 1.0, 7)
    table = np.column_stack([time, np.sin(time), time**2])
    names = ("time", "v(out)", "i(v.xmotor.xmode1.vvelocity)")
    lines = [
        "Title: a title",
        "Plotname: Transient Analysis",
        "Flags: real",
        "No. Variables: 3",
        "No. Points: 7       ",
        "Variables:",
    ]
    lines += [*(f"\t{index}\t{name}\tvoltage" for index, name in enumerate(names)), "Binary:", ""]
    return "\n".join(lines).encode() + table.tobytes()


def _take_raw(content: bytes, folder: Path) -> None:
    path = folder / "out.raw"
    path.write_bytes(content)
    why = ""
    for partial in (False, True):
        try:
            raw = read_rawfile(path, partial=partial)
        except RawFileError as error:
            why = f"ngspice gave no usable result: {error}."  # the user sees this
            continue
        raw.beyond(1e100, [*raw.vectors, "v(out)"])
        why = ""
        sizes = {len(values) for values in raw.thinned(2).values()}
        if sizes != {(raw.points + 1) // 2}:
            raise Unclear(f"{raw.points} points, but every second of them are {sizes}")
    if why:
        raise pr.SimulationError(why)


# --- libraries and netlists ---


def _library_text(name: str) -> str:
    return (data_path("behavioral") / f"{name}.lib").read_text(encoding="utf-8")


def _draw_library(rng: random.Random) -> tuple[str, str]:
    name = rng.choice(library_names())
    return name, mutate.text(_library_text(name), rng)


def _take_library(drawn: tuple[str, str], _: Path) -> None:
    library = parse_library(*drawn)
    check_parameters(library.name, library.parameters, {item.name: item.default for item in library.parameters})


def _draw_netlist(rng: random.Random) -> str:
    return mutate.text(rng.choice(sorted(data_path("netlists").glob("*.cir"))).read_text(encoding="utf-8"), rng)


def _take_netlist(deck: str, _: Path) -> None:
    fault = silent_fault(deck)
    if fault is not None:
        raise pr.SimulationError(f"{fault.rstrip('.')}.")


# --- finished points of a sweep ---

_CONTENT: dict[str, Any] = {"motor": {"preload_n": 5.0}, "run": {"duration": 1e-3}}
_RESULT: dict[str, Any] = {"numbers": {"torque_n_m": 0.1 + 0.2, "efficiency": 0.5}, "deck_sha256": "ab"}


@cache
def _entry() -> bytes:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        Store(folder).put(_CONTENT, _RESULT)
        (path,) = Path(folder).rglob("*.json")
        return path.read_bytes()


def _draw_entry(rng: random.Random) -> bytes:
    if rng.random() < 0.5:
        return mutate.data(_entry(), rng)
    try:
        return json.dumps(mutate.document(json.loads(_entry()), rng), default=_nothing).encode("utf-8", "surrogatepass")
    except (RecursionError, ValueError, TypeError):
        return _entry()


def _take_entry(content: bytes, folder: Path) -> None:
    store = Store(folder / "points")
    store.put(_CONTENT, _RESULT)
    (path,) = store.folder.rglob("*.json")
    path.write_bytes(content)
    found = store.get(_CONTENT)
    if found is None:
        raise pr.ParameterError("The entry counts as missing.")
    if found != _RESULT:
        raise Unclear("the store returned another result than was put in")


# --- the command line ---


@contextmanager
def nothing_runs() -> Iterator[None]:
    """Replace the simulator and the fit by functions that reject everything; run a sweep's tasks in this process."""

    def refuse(*_: object, **__: object) -> Any:
        raise pr.SimulationError("Nothing is run here.")

    def here(tasks: Mapping[str, Callable[[], Any]], workers: int | None, _: object) -> Iterator[tuple[str, Any]]:
        if workers is not None and workers < 1:
            raise pr.ParameterError(f"workers = {workers} is not valid: it must be a whole number > 0.")
        for address, task in tasks.items():
            try:
                yield address, task()
            except OURS as error:
                yield address, error

    def unreachable(*_: object, **__: object) -> Any:
        raise OSError("no scheduler at this address")

    with (
        mock.patch("pyspice_runner.spice.ngspice.run_deck", refuse),
        mock.patch("pyspice_runner.averaged.core.cached_library", refuse),
        mock.patch("pyspice_runner.sweeps.sweep.outcomes", here),
        mock.patch("pyspice_runner.sweeps.plan.MOST_POINTS", 200),  # more would take long
        mock.patch("pyspice_runner.impedance.identify.problem.Problem.__init__", refuse),
        mock.patch("socket.create_connection", unreachable),
        mock.patch("distributed.Client", unreachable),
        mock.patch("typer.main.get_command", return_value=_GROUP),  # typer would build it for every run
        mock.patch("pyspice_runner.motor.beam.resonator_modes", _resonator_modes),
    ):
        yield


_GROUP: Any = typer.main.get_command(app())
COMMANDS: dict[str, Any] = _GROUP.commands
_resonator_modes = cache(resonator_modes)
_SPECTRA = ["measured.csv", "two_port.s2p"]
_WORDS = {  # valid values by the name of the option
    "motor": ["andersen2002", "andersen2002-unintended-mode", "mine.toml"],
    "source": ["andersen2002", "fit.json", "fit.toml"],
    **dict.fromkeys(("file", "other", "both", "difference", "measured"), _SPECTRA),
    "files": [*_SPECTRA, "andersen2002"],
    "reference": ["andersen2002", "measured.csv"],
    "base": ["andersen2002", "mine.toml"],
    "output": [f"out.{end}" for end in ("json", "csv", "nc", "cir", "lib", "asy", "kicad_sym", "s1p", "toml", "html")],
    "plot": ["out.png", "out.svg", "out.pdf"],
    "store": ["points"],
    "scheduler": ["tcp://127.0.0.1:8786"],
    "changes": ["contact.preload_n=8", "modes.0.frequency_hz=2e4", "modes.up.tip_x=1", "rotor.radius_m=0.01"],
    "part": ["amplifier.slew_rate=1e8", "supply_v=100"],
    "driver": ["linear", "half-bridge+llcc", "ideal", "full-bridge+inductor"],
    "against": ["linear", "half-bridge"],
    "over": ["drive.voltage=40,60", "contact.preload_n=5:8:3", "run.load_torque=0,1e-3"],
    "tolerance": ["contact.friction=10%", "modes.*.tip_x=5%", "5%", "frequency=1%"],
    "quantity": ["mean_torque_n_m", "energy_residual"],
    "speeds": ["0,1", "-5:10:3"],
    "levels": ["0.5,1"],
    "at": ["20", "20,40"],
    "label": ["temperature in °C"],
    "trace": ["memory"],
    "mass": ["2e-3", "2e-3,3e-3"],
    "velocity": ["0.3"],
    "tips": ["0,1", "1,0"],
    "signals": ["tip_x_m,tip_y_m"],
    "follow": ["speed_rad_s"],
}


def _right(option: Any, rng: random.Random) -> str:
    """A value that the option should accept."""
    if option.name in _WORDS:
        return rng.choice(_WORDS[option.name])
    default = option.default
    if isinstance(default, Enum):
        return str(rng.choice(list(type(default))).value)
    if isinstance(default, int | float) and rng.random() < 0.5:
        return f"{default * rng.choice([1, 1, 0.5, 2]):g}"
    return rng.choice(["1", "8", "0.5", "1e-3", "5e4", "20"])


def _wrong(right: str, rng: random.Random) -> str:
    if rng.random() < 0.3:
        return mutate.nasty(rng)
    if rng.random() < 0.6:
        number = rng.choice(NUMBERS if rng.random() < 0.5 else EDGES)
        left, equals, _ = right.partition("=")
        return f"{left}{equals}{number if len(number) < 9999 else number[:9999]}"
    return mutate.text(right, rng)[:20_000]


_LIKELY = {"over": 0.5, "tolerance": 0.5}  # otherwise most sweeps are rejected because they have no axis


def _draw_command(rng: random.Random) -> list[str]:
    name = rng.choice(sorted(COMMANDS))
    words = [name]
    wrong = rng.choice([1, 1, 1, 2])  # number of invalid values
    options = [item for item in COMMANDS[name].params if item.name != "help"]
    given = [item for item in options if item.required or rng.random() < _LIKELY.get(item.name, 0.2)]
    spoilt = {id(item) for item in rng.sample(given, min(wrong, len(given)))}
    for item in given:
        if getattr(item, "is_flag", False):
            words.append(rng.choice([*item.opts, *item.secondary_opts]))
            continue
        for _ in range(rng.choice([1, 1, 2]) if item.multiple or item.nargs == -1 else 1):
            value = _right(item, rng)
            value = _wrong(value, rng) if id(item) in spoilt else value
            words += [value] if item.param_type_name == "argument" else [f"{item.opts[0]}={value}"]
    if rng.random() < 0.1:
        words.insert(rng.randrange(len(words) + 1), mutate.nasty(rng)[:20_000])
    return words


def _take_command(words: list[str], folder: Path) -> None:
    motor, fit, measured = _files()
    for name, content in {
        "mine.toml": motor,
        "fit.json": fit,
        "measured.csv": measured,
        "two_port.s2p": make.FILES["two_port.s2p"],
    }.items():
        if not (folder / name).exists():
            (folder / name).write_bytes(content)
    (folder / "fit.toml").write_text(toml(_circuit()), encoding="utf-8")
    with nothing_runs(), watched(folder) as (out, err):
        complete_motor(words[-1][:200])
        status = run(words)
    if status not in (0, 1, 2, 3):
        raise Unclear(f"exit status {status}")
    for said in (out.text, err.text):
        if not said.replace("\n", "").isprintable():
            raise Unclear(f"not printable: {said[:500]!r}")
    for line in err.text.splitlines():
        if line.startswith("piezomotor: ") and not clear(line.removeprefix("piezomotor: ")):
            raise Unclear(f"not a clear sentence: {line[:500]!r}")
    if status != 0:
        raise pr.ParameterError("The command line was refused.")


@cache
def _files() -> tuple[bytes, bytes, bytes]:
    return toml(_motors()[1]).encode(), json.dumps(_circuit()).encode(), make.FILES["plain.csv"]


def _draw_set(rng: random.Random) -> list[str]:
    changes = [rng.choice(_changes()) for _ in range(rng.choice([1, 1, 2]))]
    return ["show", "andersen2002", *(f"--set={_wrong(change, rng)}" for change in changes)]


@cache
def _changes() -> list[str]:
    return [f"{path}={value:g}" for path, value in _numbers(pr.load_motor("andersen2002").to_dict())]


def _numbers(document: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    for key, value in document.items() if isinstance(document, dict) else enumerate(document):
        if isinstance(value, dict | list):
            yield from _numbers(value, f"{prefix}{key}.")
        elif isinstance(value, float):
            yield f"{prefix}{key}", value


# --- Python ---


# fmt: off
@cache
def _calls() -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Functions with valid arguments."""
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3)
    tracker = pr.Tracker(kind="pll", voltage=50.0, frequency=51.7e3)
    driver = pr.Driver(kind="half-bridge", network="llcc", voltage=50.0, frequency=51.7e3)
    held = {"contact": "spring-slider", "timeout": 5.0}
    return {
        "updated": (lambda **changes: motor.updated(changes), dict(_numbers(motor.to_dict()))),
        "TwoPhaseDrive": (pr.TwoPhaseDrive, drive.model_dump()),
        "TwoToneDrive": (
            pr.TwoToneDrive,
            {"voltage_1": 50.0, "frequency_1": 2e4, "voltage_2": 50.0, "frequency_2": 4e4, "phase_deg": 0.0},
        ),
        "Thermal": (pr.Thermal, pr.Thermal().model_dump()),
        "Tracker": (pr.Tracker, tracker.model_dump()),
        "Driver": (pr.Driver, driver.model_dump() | {"settings": {"bridge.dead_time": 3e-7}}),
        "Tolerance": (pr.Tolerance, {"relative": 0.1, "distribution": "normal"}),
        "simulate": (
            lambda **run: pr.simulate(motor, drive, **run),
            {**held, "duration": 1e-3, "speed": 1.0, "load_torque": 0.0, "step": 1e-7, "signals": ["tip_x_m"],
                "record_from": 1e-4, "record_every": 2, "audit": True, "exact_resonance": True, "accuracy": 0.005},
        ),
        "admittance": (
            lambda **run: pr.admittance(motor, **run),
            {"start": 5e3, "stop": 1e5, "points": 100, "state": "preloaded", "timeout": 5.0, "audit": True},
        ),
        "speed_torque": (
            lambda **run: pr.speed_torque(motor, drive, **run),
            {**held, "speeds": [0.0, 1.0], "over": {"drive.voltage": [40.0]}, "mode": "settle", "follow": "speed_rad_s",
                "step": 1e-7, "tolerance": 1e-3, "patience": 10},
        ),
        "operating_point": (
            lambda **run: held_point(motor, drive, **run),
            {**held, "speed": 1.0, "step": 1e-7, "tolerance": 1e-3, "patience": 10},
        ),
        "sweep": (
            lambda **run: pr.sweep(motor, drive, store="points", **run),
            {"over": {"drive.voltage": [40.0]}, "quantities": ["mean_torque_n_m"], "samples": 4, "sampling": "sobol",
                "seed": 0, "workers": 1, "duration": 1e-3, "load_torque": 0.0},
        ),
        "sweep within tolerances": (
            lambda **run: pr.sweep(
                motor, drive, over={"contact.friction": pr.Tolerance(0.1)}, store="points", duration=1e-3, **run
            ),
            {"samples": 4, "sampling": "latin-hypercube", "seed": 0, "workers": 1},
        ),
        "track": (
            lambda **run: pr.track(motor, tracker, **run),
            {"disturb": "load", "mode": 1, "contact": "spring-slider", "begin": 1e-3, "duration": 5e-3, "load_torque":
                1e-3, "preload_change": 0.3, "drift": -0.02, "drift_time": 1e-3, "target_step": 10.0, "speed": None,
                "step": 1e-7, "timeout": 5.0},
        ),
        "drive_report": (
            lambda **run: pr.drive_report(motor, driver, **run),
            {"duration": 1e-3, "contact": "spring-slider", "speed": 1.0, "load_torque": 0.0, "step": 1e-7, "timeout":
                5.0},
        ),
        "report": (
            lambda **run: pr.report(motor, drive, **run),
            {"duration": 1e-3, "speeds": [0.0, 1.0], "levels": [0.5, 1.0], "connection": "A", "timeout": 5.0},
        ),
        "motor_library": (lambda **run: motor_library(motor, **run), {"contact": "brush"}),
        "circuit_library": (
            lambda **run: circuit_library(load_circuit("fit.json"), **run),
            {"name": "resonator", "title": "a fit"},
        ),
        "load_motor": (pr.load_motor, {"source": "andersen2002"}),
        "load_circuit": (load_circuit, {"path": "fit.json"}),
        "read_spectrum": (pr.read_spectrum, {"path": "measured.csv", "trace": None, "columns": None, "through": None}),
    }
# fmt: on


_NEEDED = (
    "duration",
    "speeds",
    "over",
    "amplitude",
    "relative",
    "source",
    "path",
)  # else Python raises
_OPEN = (
    "updated",
    "TwoPhaseDrive",
    "TwoToneDrive",
    "Thermal",
    "Tracker",
    "Driver",
)  # accept any keyword


def _draw_call(rng: random.Random) -> tuple[str, dict[str, Any]]:
    name = rng.choice(sorted(_calls()))
    right = _calls()[name][1]
    if name == "updated":
        right = dict(rng.sample(sorted(right.items()), rng.choice([1, 2, 3])))
    else:
        right = {key: value for key, value in right.items() if rng.random() < 0.7 or key in _NEEDED}
    for key in rng.sample(sorted(right), min(len(right), rng.choice([1, 1, 2]))):
        value = right[key]
        if rng.random() < 0.1 and name in _OPEN:
            right[mutate.nasty(rng)[:300]] = right.pop(key)
        elif isinstance(value, float) and rng.random() < 0.3:
            right[key] = value * rng.choice([-1, 0, 1e-12, 1e-3, 1e3, 1e12])
        elif isinstance(value, dict | list) and rng.random() < 0.6:
            right[key] = mutate.document({"it": value}, rng).get("it")
        elif isinstance(value, str) and rng.random() < 0.4:
            right[key] = mutate.text(value, rng)[:20_000]
        else:
            right[key] = mutate.value(rng)
    return name, right


def _take_call(drawn: tuple[str, dict[str, Any]], folder: Path) -> None:
    name, arguments = drawn
    (folder / "fit.json").write_text(json.dumps(_circuit()), encoding="utf-8")
    (folder / "measured.csv").write_bytes(make.FILES["plain.csv"])
    with nothing_runs():
        _calls()[name][0](**arguments)


ENTRY_POINTS = {
    entry_point.name: entry_point
    for entry_point in (
        EntryPoint("motor", _draw_motor, _take_motor),
        EntryPoint("set", _draw_set, _take_command),
        EntryPoint("command", _draw_command, _take_command),
        EntryPoint("python", _draw_call, _take_call),
        EntryPoint("spectrum", _draw_spectrum, _take_spectrum),
        EntryPoint("fit", _draw_points, _take_points, share=0.1),
        EntryPoint("circuit", _draw_circuit, _take_circuit),
        EntryPoint("rawfile", lambda rng: mutate.data(_raw(), rng), _take_raw),
        EntryPoint("library", _draw_library, _take_library),
        EntryPoint("netlist", _draw_netlist, _take_netlist),
        EntryPoint("store", _draw_entry, _take_entry),
    )
}
