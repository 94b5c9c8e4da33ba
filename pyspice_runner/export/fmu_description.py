# SPDX-License-Identifier: GPL-3.0-or-later
"""The model descriptions of FMI 2.0 and FMI 3.0: variables, units and structure of the averaged motor.

Source: Functional Mock-up Interface, versions 2.0.2 and 3.0.2, Modelica Association.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import pi
from typing import Literal
from xml.etree import ElementTree

from pyspice_runner.averaged.c_code import MOUNTS, OF_SPRINGS, Variable, state_names
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers

Version = Literal[2, 3]
VERSIONS: tuple[Version, ...] = (2, 3)
STEP_SIZE = 1e-3  # s, of the default experiment: a controller at 1 kHz
# SI base units with their exponents; FMI 2.0 has whole exponents only, so that two units have no such definition
_UNITS: dict[str, dict[str, float]] = {
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "A": {"A": 1}, "Hz": {"s": -1}, "K": {"K": 1}, "s": {"s": 1},
    "deg": {"rad": 1, "factor": pi / 180.0}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1}, "m": {"m": 1},
    "m/s": {"m": 1, "s": -1}, "J": {"kg": 1, "m": 2, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2}, "N.m": {"kg": 1, "m": 2, "s": -2}, "N.m.s": {"kg": 1, "m": 2, "s": -1},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "W": {"kg": 1, "m": 2, "s": -3}, "kg": {"kg": 1}, "kg.m2": {"kg": 1, "m": 2}, "N/m": {"kg": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1}, "N/V": {"m": -1, "s": 1, "A": 1}, "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "J/K": {"kg": 1, "m": 2, "s": -2, "K": -1}, "K/W": {"kg": -1, "m": -2, "s": 3, "K": 1}, "1/K": {"K": -1},
    "m/V": {"kg": -1, "m": -1, "s": 3, "A": 1}, "s/m": {"m": -1, "s": 1}, "m/N": {"kg": -1, "s": 2},
    "N/m^1.5": {}, "m/N^(2/3)": {},
}  # fmt: skip


def state_count(motor: Motor) -> int:
    """Return the number of states in the C code; its compilation checks it."""
    return len(state_names(len(motor.modes), len(carriers(motor.mount))))


@dataclass(frozen=True)
class Description:
    """What a model description is made of."""

    motor: Motor
    known: list[Variable]
    identifier: str
    token: str  # which binary and description have in common
    sources: tuple[str, ...]  # C files that a compiler is given

    def text(self, version: Version) -> str:
        """Return ``modelDescription.xml`` of a version of FMI."""
        title = f"standing-wave piezomotor {self.motor.name}, averaged over the period of the drive"
        root = ElementTree.Element("fmiModelDescription", {
            "fmiVersion": f"{version}.0", "modelName": self.identifier,
            "guid" if version == 2 else "instantiationToken": self.token, "description": title,
            "license": "MIT", "generationTool": "piezomotor", "variableNamingConvention": "structured",
        })  # fmt: skip
        self._add_interfaces(root, version)
        self._add_units(root)
        times = {"startTime": "0", "stopTime": "1", "stepSize": f"{STEP_SIZE:g}"}
        ElementTree.SubElement(root, "DefaultExperiment", times)
        self._add_variables(root, version)
        return written(root)

    def _add_interfaces(self, root: ElementTree.Element, version: Version) -> None:
        state = "FMUstate" if version == 2 else "FMUState"
        common = {"modelIdentifier": self.identifier, f"canGetAndSet{state}": "true", f"canSerialize{state}": "true"}
        common |= {"canNotUseMemoryManagementFunctions": "true"} if version == 2 else {}
        step = {"canHandleVariableCommunicationStepSize": "true"}
        if version == 3:
            step |= {"providesIntermediateUpdate": "true", "mightReturnEarlyFromDoStep": "true",
                     "canReturnEarlyAfterIntermediateUpdate": "true"}  # fmt: skip
        for name, more in (("ModelExchange", {}), ("CoSimulation", step)):
            interface = ElementTree.SubElement(root, name, common | more)
            if version == 2:
                files = ElementTree.SubElement(interface, "SourceFiles")
                for file in self.sources:
                    ElementTree.SubElement(files, "File", {"name": file})

    @property
    def _shown(self) -> list[Variable]:
        hidden = {f"{prefix}{name}" for prefix in MOUNTS[len(carriers(self.motor.mount)) :] for name in OF_SPRINGS}
        return [item for item in self.known if item.name not in hidden]

    def _add_units(self, root: ElementTree.Element) -> None:
        units = ElementTree.SubElement(root, "UnitDefinitions")
        for unit in sorted({"s", *(item.unit for item in self._shown)} - {"1"}):
            base = ElementTree.SubElement(units, "Unit", {"name": unit})
            if _UNITS[unit]:
                ElementTree.SubElement(base, "BaseUnit", {key: f"{value!r}" for key, value in _UNITS[unit].items()})

    def _add_variables(self, root: ElementTree.Element, version: Version) -> None:
        count, first, shown = state_count(self.motor), len(self.known), self._shown
        listed = ElementTree.SubElement(root, "ModelVariables")
        place_of: dict[int, int] = {}  # value reference → place in the list, which FMI 2.0 refers to

        def add(name: str, reference: int, meaning: str, kind: dict[str, str], **real: str) -> None:
            place_of[reference] = len(place_of) + 1
            common = {"name": name, "valueReference": str(reference), "description": meaning, **kind}
            if version == 2:
                ElementTree.SubElement(ElementTree.SubElement(listed, "ScalarVariable", common), "Real", real)
            else:
                ElementTree.SubElement(listed, "Float64", common | real)

        for item in shown:
            real = {} if item.unit == "1" else {"unit": item.unit}
            if item.start is not None:
                real |= {"min": item.least, "max": item.greatest, "start": f"{item.start!r}"}
            add(item.name, item.reference, item.meaning, KINDS[item.causality], **real)
        states, rates = (range(first + begin, first + begin + count) for begin in (0, count))
        for number, reference in enumerate(states, start=1):
            add(f"state[{number}]", reference, "state of the averaged motor", KINDS["state"])
        for number, (reference, of) in enumerate(zip(rates, states, strict=True), start=1):
            derivative = str(place_of[of] if version == 2 else of)
            add(f"der(state[{number}])", reference, "rate of this state, in 1/s", KINDS["state"], derivative=derivative)
        if version == 3:
            add("time", first + 2 * count, "time", KINDS["time"], unit="s")
        outputs = [item.reference for item in shown if item.causality == "output"]
        parts: dict[str, Iterable[int]] = {
            "Output": outputs,
            "ContinuousStateDerivative": rates,
            "InitialUnknown": [*outputs, *states, *rates],
        }
        _add_structure(ElementTree.SubElement(root, "ModelStructure"), parts, place_of if version == 2 else None)

    def build_text(self) -> str:
        """Return ``buildDescription.xml`` of FMI 3.0: what a compiler is given."""
        root = ElementTree.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
        configuration = ElementTree.SubElement(root, "BuildConfiguration", {"modelIdentifier": self.identifier})
        files = ElementTree.SubElement(configuration, "SourceFileSet", {"language": "C11"})
        for file in self.sources:
            ElementTree.SubElement(files, "SourceFile", {"name": file})
        return written(root)


def _add_structure(
    structure: ElementTree.Element, parts: dict[str, Iterable[int]], place_of: dict[int, int] | None
) -> None:
    """Add value references by what they are; by their places and under the names of FMI 2.0, if places are given."""
    for part, references in parts.items():
        if place_of is None:
            for reference in references:
                ElementTree.SubElement(structure, part, {"valueReference": str(reference)})
            continue
        listing = ElementTree.SubElement(structure, part.removeprefix("ContinuousState") + "s")
        for reference in references:
            ElementTree.SubElement(listing, "Unknown", {"index": str(place_of[reference])})


KINDS = {
    "input": {"causality": "input", "variability": "continuous"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "parameter": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    "tunable": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
    "state": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    "time": {"causality": "independent", "variability": "continuous"},
}


def written(root: ElementTree.Element) -> str:
    """Return an XML file."""
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
