# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor as a Functional Mock-up Unit of FMI 2.0 or 3.0, for co-simulation and model exchange.

Source: Functional Mock-up Interface, versions 2.0.2 and 3.0.2, Modelica Association.
"""

from __future__ import annotations

import io
import platform
import tempfile
import uuid
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

from pyspice_runner.averaged import c_code
from pyspice_runner.averaged.library import ALL_TERMS, SUBCIRCUIT, Terms, require_averaged
from pyspice_runner.errors import SimulationError, require
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.compiler import compile_library
from pyspice_runner.spice.library import check_name, data_path

Version = Literal[2, 3]
VERSIONS: tuple[Version, ...] = (2, 3)
SHARED = "piezomotor_fmi.h"  # by both versions
PLATFORMS = {2: ("linux64", "win64"), 3: ("x86_64-linux", "x86_64-windows")}  # folders of the binaries
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
}  # fmt: skip
KINDS = {
    "input": {"causality": "input", "variability": "continuous"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "parameter": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    "tunable": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
    "state": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    "time": {"causality": "independent", "variability": "continuous"},
}


def c_files(version: Version) -> tuple[str, ...]:
    """Return the C files that a compiler is given."""
    return c_code.CORE, f"piezomotor_fmi{version}.c"


def fmu_texts(motor: Motor, *, name: str = "", thermal: Thermal | None = None, version: Version = 2) -> dict[str, str]:
    """Return the text files of a Functional Mock-up Unit: path in the archive → text. Without the binaries.

    Raise ParameterError for an invalid name or version, or a motor that has no averaged model.
    """
    require(version in VERSIONS, "fmi", version, "2 or 3")
    identifier = check_name(name) if name else SUBCIRCUIT
    motor = require_averaged(motor)
    known = c_code.variables(motor, thermal)
    behavioral = data_path("behavioral")
    compiled = c_files(version)
    sources = {file: (behavioral / file).read_text(encoding="utf-8") for file in (*compiled, c_code.HEADER, SHARED)}
    terms = ALL_TERMS._replace(exponent=Terms.of(motor).exponent)
    sources |= {c_code.HEADER: c_code.header(terms), c_code.PHASE: c_code.phase_source(terms)}
    start = c_code.start_header(motor, known)
    token = str(uuid.uuid5(uuid.NAMESPACE_URL, "\n".join((identifier, *sources.values(), start))))
    defined = f'#define GUID "{token}"\n#define STATE_COUNT {state_count(motor)}\n#define MODES'
    sources[c_code.START] = start.replace("#define MODES", defined, 1)
    described = Description(motor, known, identifier, token, compiled, version)
    build = {"sources/buildDescription.xml": described.build_text()} if version == 3 else {}
    return {
        "modelDescription.xml": described.text(),
        **{f"sources/{file}": text for file, text in sources.items()},
        **build,
    }


def fmu_archive(texts: Mapping[str, str]) -> bytes:
    """Compile the sources of a Functional Mock-up Unit, and return the unit with its binaries.

    That for Windows is in it where the compiler mingw-w64 is installed. Raise SimulationError if there is no C
    compiler, or on another system than Linux on x86-64.
    """
    here = f"{platform.system()} {platform.machine()}"
    if here != "Linux x86_64":
        raise SimulationError(f"This system is {here}: the binary of a .fmu can be built on Linux x86_64 only.")
    described = ElementTree.fromstring(texts["modelDescription.xml"]).attrib
    identifier, version = described["modelName"], VERSIONS[described["fmiVersion"] == "3.0"]
    contents = {name: text.encode() for name, text in texts.items()}
    with tempfile.TemporaryDirectory(prefix="piezomotor-") as folder:
        for name, content in contents.items():
            Path(folder, Path(name).name).write_bytes(content)
        linux, windows = PLATFORMS[version]
        for place, ending in ((linux, "so"), (windows, "dll")):
            binary = Path(folder) / f"{identifier}.{ending}"
            if compile_library(Path(folder), c_files(version), binary, windows=place == windows):
                contents[f"binaries/{place}/{binary.name}"] = binary.read_bytes()
    unit = io.BytesIO()
    with zipfile.ZipFile(unit, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)  # without the time of the export
    return unit.getvalue()


def state_count(motor: Motor) -> int:
    """Return the number of states in the C code; its compilation checks it."""
    return len(c_code.state_names(c_code.Size.of(motor)))


@dataclass(frozen=True)
class Description:
    """What a model description is made of."""

    motor: Motor
    known: list[c_code.Variable]
    identifier: str
    token: str  # which binary and description have in common
    sources: tuple[str, ...]  # C files that a compiler is given
    version: Version  # of FMI

    def text(self) -> str:
        """Return ``modelDescription.xml``."""
        title = f"standing-wave piezomotor {self.motor.name}, averaged over the period of the drive"
        root = ElementTree.Element("fmiModelDescription", {
            "fmiVersion": f"{self.version}.0", "modelName": self.identifier,
            "guid" if self.version == 2 else "instantiationToken": self.token, "description": title,
            "license": "MIT", "generationTool": "piezomotor", "variableNamingConvention": "structured",
        })  # fmt: skip
        self._add_interfaces(root)
        self._add_units(root)
        times = {"startTime": "0", "stopTime": "1", "stepSize": f"{STEP_SIZE:g}"}
        ElementTree.SubElement(root, "DefaultExperiment", times)
        self._add_variables(root)
        return written(root)

    def _add_interfaces(self, root: ElementTree.Element) -> None:
        state = "FMUstate" if self.version == 2 else "FMUState"
        common = {"modelIdentifier": self.identifier, f"canGetAndSet{state}": "true", f"canSerialize{state}": "true"}
        common |= {"canNotUseMemoryManagementFunctions": "true"} if self.version == 2 else {}
        step = {"canHandleVariableCommunicationStepSize": "true"}
        if self.version == 3:
            step |= {"providesIntermediateUpdate": "true", "mightReturnEarlyFromDoStep": "true",
                     "canReturnEarlyAfterIntermediateUpdate": "true"}  # fmt: skip
        for name, more in (("ModelExchange", {}), ("CoSimulation", step)):
            interface = ElementTree.SubElement(root, name, common | more)
            if self.version == 2:
                files = ElementTree.SubElement(interface, "SourceFiles")
                for file in self.sources:
                    ElementTree.SubElement(files, "File", {"name": file})

    @property
    def _shown(self) -> list[c_code.Variable]:
        idle = c_code.MOUNTS[len(carriers(self.motor.mount)) :]
        hidden = {f"{prefix}{name}" for prefix in idle for name in c_code.OF_SPRINGS}
        return [item for item in self.known if item.name not in hidden]

    def _add_units(self, root: ElementTree.Element) -> None:
        units = ElementTree.SubElement(root, "UnitDefinitions")
        for unit in sorted({"s", *(item.unit for item in self._shown)} - {"1"}):
            base = ElementTree.SubElement(units, "Unit", {"name": unit})
            if of_unit := _UNITS.get(unit):  # none of the contact's constants, whose powers of a metre are broken
                ElementTree.SubElement(base, "BaseUnit", {key: f"{value!r}" for key, value in of_unit.items()})

    def _add_variables(self, root: ElementTree.Element) -> None:
        count, first, shown = state_count(self.motor), len(self.known), self._shown
        listed = ElementTree.SubElement(root, "ModelVariables")
        place_of: dict[int, int] = {}  # value reference → place in the list, which FMI 2.0 refers to

        def add(name: str, reference: int, meaning: str, kind: dict[str, str], **real: str) -> None:
            place_of[reference] = len(place_of) + 1
            common = {"name": name, "valueReference": str(reference), "description": meaning, **kind}
            if self.version == 2:
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
            derivative = str(place_of[of] if self.version == 2 else of)
            add(f"der(state[{number}])", reference, "rate of this state, in 1/s", KINDS["state"], derivative=derivative)
        if self.version == 3:
            add("time", first + 2 * count, "time", KINDS["time"], unit="s")
        outputs = [item.reference for item in shown if item.causality == "output"]
        parts: dict[str, Iterable[int]] = {
            "Output": outputs,
            "ContinuousStateDerivative": rates,
            "InitialUnknown": [*outputs, *states, *rates],
        }
        self._add_structure(ElementTree.SubElement(root, "ModelStructure"), parts, place_of)

    def _add_structure(
        self, structure: ElementTree.Element, parts: dict[str, Iterable[int]], place_of: dict[int, int]
    ) -> None:
        """Add value references by what they are; for FMI 2.0 by their places and under its names."""
        for part, references in parts.items():
            if self.version == 3:
                for reference in references:
                    ElementTree.SubElement(structure, part, {"valueReference": str(reference)})
                continue
            listing = ElementTree.SubElement(structure, part.removeprefix("ContinuousState") + "s")
            for reference in references:
                ElementTree.SubElement(listing, "Unknown", {"index": str(place_of[reference])})

    def build_text(self) -> str:
        """Return ``buildDescription.xml`` of FMI 3.0: what a compiler is given."""
        root = ElementTree.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
        configuration = ElementTree.SubElement(root, "BuildConfiguration", {"modelIdentifier": self.identifier})
        files = ElementTree.SubElement(configuration, "SourceFileSet", {"language": "C11"})
        for file in self.sources:
            ElementTree.SubElement(files, "SourceFile", {"name": file})
        return written(root)


def written(root: ElementTree.Element) -> str:
    """Return an XML file."""
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
