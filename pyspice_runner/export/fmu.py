# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor as a Functional Mock-up Unit: C sources and model description of FMI 2.0 for co-simulation.

Source: Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.2, Modelica Association.
"""

from __future__ import annotations

import io
import platform
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from math import pi
from pathlib import Path
from xml.etree import ElementTree

from pyspice_runner.engine.compiler import compile_library
from pyspice_runner.errors import SimulationError
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.recoil import carriers
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import SUBCIRCUIT, require_averaged
from pyspice_runner.netlist.averaged_c import (
    CORE,
    HEADER,
    MOUNTS,
    OF_SPRINGS,
    PHASE,
    START,
    Variable,
    phase_source,
    start_header,
    variables,
)
from pyspice_runner.netlist.library import check_name, data_path

C_FILES = (CORE, "piezomotor_fmi2.c")  # what a compiler is given
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
    "s/m": {"m": -1, "s": 1}, "m/N": {"kg": -1, "s": 2}, "N/m^1.5": {}, "m/N^(2/3)": {},
}  # fmt: skip


def fmu_texts(motor: Motor, *, name: str = "", thermal: Thermal | None = None) -> dict[str, str]:
    """Return the text files of a Functional Mock-up Unit: path in the archive → text. Without the binary.

    Raise ParameterError for an invalid name, or a motor that has no averaged model.
    """
    identifier = check_name(name) if name else SUBCIRCUIT
    require_averaged(motor)
    known = variables(motor, thermal)
    behavioral = data_path("behavioral")
    sources = {file: (behavioral / file).read_text(encoding="utf-8") for file in (*C_FILES, HEADER)}
    sources[PHASE] = phase_source()
    start = start_header(motor, known)
    guid = str(uuid.uuid5(uuid.NAMESPACE_URL, "\n".join((identifier, *sources.values(), start))))
    sources[START] = start.replace("#define MODES", f'#define GUID "{guid}"\n#define MODES', 1)
    return {
        "modelDescription.xml": _model_description(motor, known, identifier, guid),
        **{f"sources/{file}": text for file, text in sources.items()},
    }


def fmu_archive(texts: Mapping[str, str]) -> bytes:
    """Compile the sources of a Functional Mock-up Unit, and return the unit with its binary.

    Raise SimulationError if there is no C compiler, or on another system than Linux on x86-64.
    """
    here = f"{platform.system()} {platform.machine()}"
    if here != "Linux x86_64":
        raise SimulationError(f"This system is {here}: the binary of a .fmu can be built on Linux x86_64 only.")
    identifier = ElementTree.fromstring(texts["modelDescription.xml"]).attrib["modelName"]
    contents = {name: text.encode() for name, text in texts.items()}
    with tempfile.TemporaryDirectory(prefix="piezomotor-") as folder:
        for name, content in contents.items():
            Path(folder, Path(name).name).write_bytes(content)
        binary = Path(folder) / f"{identifier}.so"
        compile_library(Path(folder), C_FILES, binary)
        contents[f"binaries/linux64/{identifier}.so"] = binary.read_bytes()
    unit = io.BytesIO()
    with zipfile.ZipFile(unit, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)  # without the time of the export
    return unit.getvalue()


def _model_description(motor: Motor, known: list[Variable], identifier: str, guid: str) -> str:
    root = ElementTree.Element("fmiModelDescription", {
        "fmiVersion": "2.0", "modelName": identifier, "guid": f"{guid}",
        "description": f"standing-wave piezomotor {motor.name}, averaged over the period of the drive",
        "license": "GPL-3.0-or-later", "generationTool": "pyspice-runner", "variableNamingConvention": "structured",
    })  # fmt: skip
    simulation = ElementTree.SubElement(root, "CoSimulation", {
        "modelIdentifier": identifier, "canHandleVariableCommunicationStepSize": "true",
        "canNotUseMemoryManagementFunctions": "true", "canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true",
    })  # fmt: skip
    files = ElementTree.SubElement(simulation, "SourceFiles")
    for file in C_FILES:
        ElementTree.SubElement(files, "File", {"name": file})
    hidden = {f"{prefix}{name}" for prefix in MOUNTS[len(carriers(motor.mount)) :] for name in OF_SPRINGS}
    shown = [item for item in known if item.name not in hidden]
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in sorted({item.unit for item in shown} - {"1"}):
        base = ElementTree.SubElement(units, "Unit", {"name": unit})
        if _UNITS[unit]:
            ElementTree.SubElement(base, "BaseUnit", {key: f"{value!r}" for key, value in _UNITS[unit].items()})
    ElementTree.SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": "1", "stepSize": f"{STEP_SIZE:g}"})
    listed = ElementTree.SubElement(root, "ModelVariables")
    for item in shown:
        kind = {
            "input": {"causality": "input", "variability": "continuous"},
            "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
            "parameter": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
            "tunable": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
        }[item.causality]
        variable = ElementTree.SubElement(listed, "ScalarVariable", {
            "name": item.name, "valueReference": str(item.reference), "description": item.meaning, **kind,
        })  # fmt: skip
        real = {} if item.unit == "1" else {"unit": item.unit}
        if item.start is not None:
            real |= {"min": item.least, "max": item.greatest, "start": f"{item.start!r}"}
        ElementTree.SubElement(variable, "Real", real)
    structure = ElementTree.SubElement(root, "ModelStructure")
    places = [str(place) for place, item in enumerate(shown, start=1) if item.causality == "output"]
    for part in ("Outputs", "InitialUnknowns"):
        unknowns = ElementTree.SubElement(structure, part)
        for place in places:
            ElementTree.SubElement(unknowns, "Unknown", {"index": place})
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
