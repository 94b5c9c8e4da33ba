# SPDX-License-Identifier: GPL-3.0-or-later
"""A driver or a MOSFET of the user's own: ``FILE:NAME``, a ``.subckt`` or ``.model`` in a SPICE library.

Only NAME and the definitions it refers to in the same file enter a netlist. ``docs/drive.md`` lists pins and
parameters; :mod:`.own_file` the statements that are accepted.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.document import read_bytes
from pyspice_runner.spice.library import Header, Library
from pyspice_runner.spice.own_file import OwnFile, Parameters, Rules, Statement, short, words_of

DRIVER = "driver_own"  # name of the subcircuit in a netlist
MOSFET = "driver_mosfet"  # that of the part of the bridges that it replaces
#: parameters of a driver that the package sets where the driver declares them
DRIVEN = ("amplitude", "frequency", "phase_deg")
_NEEDED = ("out", "com")
_PINS = ("in", *_NEEDED, "vp", "vn")
_MOST_BYTES = 1 << 22  # manufacturers' libraries have hundreds of parts
_TYPES = ("D", "SW", "CSW", "NMOS", "PMOS", "VDMOS", "NPN", "PNP", "NJF", "PJF", "R", "RES", "C", "CAP", "L", "IND")
_RULES = Rules("device", "RLCVIEFGHBDKSWMQJTX", _TYPES, MOSFET)
_DEEPEST = 8  # subcircuits within subcircuits
_MOST_ELEMENTS = 10_000  # with those of the subcircuits within; 90,000 take ngspice more than a minute to read
_WITH_MODEL = "DSWMQJ"  # elements that need a .model
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,59}")
_DRAIN_GATE_SOURCE = ({"d", "drain"}, {"g", "gate"}, {"s", "source"})


def is_reference(text: str) -> bool:
    """Return whether a text has the form ``FILE:NAME``."""
    return ":" in text


def read_driver(text: str) -> Library:
    """Read ``FILE:NAME``: a subcircuit with the pins ``out`` and ``com``, and any of ``in``, ``vp`` and ``vn``.

    Raise ParameterError for a file that cannot be read or used; the message names the line.
    """
    return _Devices(text, "driver", "driver library").driver()


def read_mosfet(text: str) -> Library:
    """Read ``FILE:NAME``: a subcircuit with the pins drain, gate, source, or an n-channel model of type NMOS or VDMOS.

    Raise ParameterError for a file that cannot be read or used; the message names the line.
    """
    return _Devices(text, "mosfet", "MOSFET library").mosfet()


@dataclass
class _Block:
    """One subcircuit of a file."""

    begin: int  # number of its first line
    first: str  # its first line
    name: str  # its name as it is written
    pins: tuple[str, ...]  # in lower case
    parameters: list[str]  # words ``name=value`` of the first line
    body: list[Statement] = field(default_factory=list)  # statements between the first and the last line
    header: str = ""  # text from the end of the previous subcircuit to its own end


class _Devices(OwnFile):
    """Reader of ``FILE:NAME``: the subcircuits of the file and the models outside of them, by names in lower case.

    A character that is not ASCII is an error only in a line that a simulator reads.
    """

    def __init__(self, reference: str, what: str, file: str) -> None:
        path, _, self._name = reference.rpartition(":")
        form = "FILE:NAME, with a NAME of letters, digits and _ . + -"
        require(path and _NAME.fullmatch(self._name), what, reference, form)
        super().__init__(path, read_bytes(path, file, _MOST_BYTES).decode("ascii", errors="replace"), _RULES)
        self._blocks: dict[str, _Block] = {}
        self._models: dict[str, Statement] = {}
        self._sort()

    def driver(self) -> Library:
        """Return a driver as a library whose subcircuit is called :data:`DRIVER`."""
        block = self._chosen()
        pins = block.pins
        if not set(_NEEDED) <= set(pins) <= set(_PINS) or len(set(pins)) < len(pins):
            self._fail(
                block.begin,
                f"the pins of {block.name} are {' '.join(pins) or 'missing'}; they must be out and com, "
                "and may include in, vp and vn, in any order",
            )
        parameters = self._parameters(block.begin, block.parameters)
        declared = {parameter.name for parameter in parameters}
        missing = [] if "in" in pins else [parameter for parameter in DRIVEN if parameter not in declared]
        if missing:
            self._fail(
                block.begin,
                f"the parameters {', '.join(missing)} are missing; the package sets them in a driver without a pin in",
            )
        text, needs = self._netlist(block, DRIVER, pins, parameters)
        self._check_powers(text)
        return self._library(DRIVER, block.name, pins, parameters, text, needs)

    def mosfet(self) -> Library:
        """Return a MOSFET as a library that replaces :data:`MOSFET`; its parameters keep their defaults."""
        name = self._name
        if name.lower() in self._models and name.lower() not in self._blocks:
            text = self._wrapped(name)
            return self._library(MOSFET, name, ("d", "g", "s"), (), text, ())
        block = self._chosen()
        pins = block.pins
        if len(pins) != 3 or len(set(pins)) < 3:
            self._fail(
                block.begin,
                f"the pins of {block.name} are {' '.join(pins) or 'missing'}; they must be three: drain gate source",
            )
        named = [[pin for pin in pins if pin in names] for names in _DRAIN_GATE_SOURCE]
        ordered = tuple(pin for one in named for pin in one)
        text, needs = self._netlist(block, MOSFET, ordered if len(ordered) == 3 else pins, ())
        if needs:
            self._fail(block.begin, f"{block.name} needs {needs[0]}, which is not a part of a MOSFET")
        return self._library(MOSFET, block.name, ("d", "g", "s"), (), text, needs)

    def _sort(self) -> None:
        """Sort the statements into subcircuits and models; nothing else is accepted outside of subcircuits."""
        inside: _Block | None = None
        raw, ended = self._text.split("\n"), 0
        for line, text in self._statements:
            keyword, *words = words_of(text)
            if keyword.lower() == ".ends":
                if inside is None or (words and words[0].lower() != inside.name.lower()):
                    self._fail(line, f"{short(text)} does not end a subcircuit; write .subckt NAME and .ends NAME")
                inside.header = "\n".join(raw[ended:line])
                inside, ended = None, line
            elif keyword.lower() == ".subckt":
                if inside:
                    self._fail(line, f"{short(text)} is inside of .subckt {inside.name}; move it out of there")
                name = words[0] if words else ""
                self._check_name(line, name, self._blocks)
                pins = tuple(word.lower() for word in words[1:] if "=" not in word)
                inside = _Block(line, text, name, pins, [word for word in words[1:] if "=" in word])
                self._blocks[name.lower()] = inside
            elif inside:
                inside.body.append((line, text))
            elif re.match(r"\.model\s+\S", text, re.I):
                self._check_name(line, words[0], self._models)
                self._models[words[0].lower()] = (line, text)
            elif text.lower() != ".end":
                self._fail(line, f"{short(text)} is outside of a subcircuit; only .subckt and .model are read there")
        if inside:
            self._fail(inside.begin, f".subckt {inside.name} has no .ends")

    def _check_name(self, line: int, name: str, others: Collection[str]) -> None:
        if not _NAME.fullmatch(name):
            self._fail(line, f"the name {short(name)} is not valid: it must be at most 60 letters, digits and _ . + -")
        if name.lower() in others:
            self._fail(line, f"{name} is defined twice")

    def _chosen(self) -> _Block:
        """Return the subcircuit NAME, and take its header for that of the library."""
        block = self._blocks.get(self._name.lower())
        if block is None:
            known = [one.name for one in self._blocks.values()]
            listed = f"{', '.join(known[:8])}{', …' if len(known) > 8 else ''}"
            has = f"It has {listed}." if known else "It has none."
            raise ParameterError(f"{self._path}: there is no .subckt {self._name}. {has}")
        self._header = Header(self._path, block.header)
        return block

    def _wrapped(self, name: str) -> str:
        """Return a subcircuit around a model."""
        line, text = self._models[name.lower()]
        self._check(line, text, (), ())
        kind = re.match(r"\.model\s+\S+\s+(\w+)", text, re.I)
        if kind is None or kind.group(1).upper() not in ("NMOS", "VDMOS") or re.search(r"\bpchan\b", text, re.I):
            self._fail(line, f"{short(text)} is not valid: the type must be NMOS or VDMOS, of n-channel")
        bulk = "" if kind.group(1).upper() == "VDMOS" else " s"
        return f".subckt {MOSFET} d g s\nMswitch d g s{bulk} {name}\n{text}\n.ends {MOSFET}"

    def _netlist(
        self, block: _Block, name: str, pins: Sequence[str], parameters: Parameters
    ) -> tuple[str, tuple[str, ...]]:
        """Return a subcircuit with its parts, and the libraries of ``behavioral/`` that they need.

        A subcircuit gets copies of the outside models that it refers to, and its parts are named after it, so that no
        name clashes with the rest of a netlist.
        """
        allowed = {*self._blocks, *self._needs()}
        written: dict[str, str] = {}
        elements: dict[str, int] = {}  # of a subcircuit, with those of its parts
        needs: set[str] = set()

        def write(one: _Block, called: str, head: str, depth: int) -> None:
            if depth > _DEEPEST:
                self._fail(one.begin, f"{one.name} contains itself, or is nested too deeply")
            lines, count = [f".subckt {called} {head}"], 0
            for _, text in self._checked(one, allowed):
                part = self._part(text) if text[0] in "xX" else ""
                if part in self._blocks:
                    inner, deeper = self._blocks[part], f"{name}_{part}"
                    words = words_of(text)
                    words[max(place for place, word in enumerate(words) if "=" not in word)] = deeper
                    lines.append(" ".join(words))
                    if deeper not in written:
                        write(inner, deeper, " ".join([*inner.pins, *inner.parameters]), depth + 1)
                    count += elements[deeper]
                else:
                    lines.append(text)
                    count += text[0] != "."
                    needs.update([part] if part else [])
            written[called] = "\n".join([*lines, f".ends {called}"])
            elements[called] = count

        values = [f"{parameter.name}={parameter.default!r}" for parameter in parameters] or block.parameters
        write(block, name, " ".join([*pins, *values]), 0)
        if elements[name] > _MOST_ELEMENTS:
            self._fail(
                block.begin,
                f"{block.name} has {elements[name]:.3g} elements with those of its subcircuits; at most "
                f"{_MOST_ELEMENTS} are allowed",
            )
        return "\n".join(written.values()), tuple(sorted(needs))

    def _checked(self, block: _Block, allowed: Collection[str]) -> list[Statement]:
        """Return the checked lines of a subcircuit, and of the outside models that it refers to."""
        known = {word.partition("=")[0].lower() for word in block.parameters}
        self._check_text(block.begin, block.first, known)
        if not all(re.fullmatch(r"[\w.+-]{1,60}", word, re.A) for word in (*block.pins, *known)):
            self._fail(block.begin, f"{short(block.first)} has a name with other characters than letters, digits, _.+-")
        local = {words_of(text)[1].lower() for _, text in block.body if re.match(r"\.model\s+\S", text, re.I)}
        models: set[str] = set()
        for line, text in block.body:
            known |= self._check(line, text, known, allowed)
            words = set() if text[0] == "." else set(re.split(r"[\s()=,]+", text.lower()))
            outside = (words & self._models.keys()) - local
            if text[0].upper() in _WITH_MODEL and not (outside or words & local):
                self._fail(line, f"the model of {text.split()[0]} is not in the file; add its .model")
            models |= outside
        for model in sorted(models):
            self._check(*self._models[model], known, ())
        return [*block.body, *(self._models[model] for model in sorted(models))]

    def _check_powers(self, netlist: str) -> None:
        """Check that each ``LOSS``, ``FEED``, ``STORE`` and ``LIMIT`` line of the header has its node."""
        for kind in ("loss", "feed", "store", "limit"):
            for name, _ in self._header.entries(kind.upper(), 2):
                if not re.fullmatch(r"[a-z]\w{0,39}", name, re.A) or not re.search(rf"\b{kind}_{name}\b", netlist):
                    node = short(f"{kind}_{name}")
                    raise ParameterError(
                        f"{self._path}: {kind.upper()} {short(name)} has no node {node} in the subcircuit."
                    )
