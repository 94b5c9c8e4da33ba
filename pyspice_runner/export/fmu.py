# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor as a Functional Mock-up Unit: C sources and model description of FMI 2.0 for co-simulation.

The C files in ``behavioral/`` are written by hand, but for the contact at one phase, which :func:`phase_source` writes
from the library that ngspice runs. ``piezomotor_averaged.h`` declares every variable once, with unit,
range and meaning. This module reads these lines and writes ``modelDescription.xml`` and ``piezomotor_start.h``, which
has the values of a motor.

Source: Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.2, Modelica Association.
"""

from __future__ import annotations

import io
import re
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import pi
from pathlib import Path
from textwrap import wrap
from xml.etree import ElementTree

from pyspice_runner.engine.compiler import compile_library
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.recoil import carriers, modes_on_carrier
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.averaged import SUBCIRCUIT, default_two_phase, require_averaged
from pyspice_runner.netlist.expressions import HELPERS, equations, translated
from pyspice_runner.netlist.library import check_name, data_path, read_library, slider_words
from pyspice_runner.netlist.motor import mode_values, rounded, spring_values
from pyspice_runner.units import linear_unit

C_FILES = ("piezomotor_averaged.c", "piezomotor_fmi2.c")  # what a compiler is given
_HEADER, _START, _PHASE = "piezomotor_averaged.h", "piezomotor_start.h", "piezomotor_phase.h"
STEP_SIZE = 1e-3  # s, of the default experiment: a controller at 1 kHz
# in the order of struct values
_GROUPS = ("INPUTS", "OUTPUTS", "PARAMETERS", "MOUNT_PARAMETERS", "MOUNT_X_PARAMETERS", "MODE_PARAMETERS")
_MOUNTS = ("mount_", "mount_x_")  # prefixes of the springs of the carrier, along y and x
_OF_SPRINGS = ("mass", "damping", "stiffness")
# SI base units with their exponents; FMI 2.0 has whole exponents only, so that two units have no such definition
_UNITS: dict[str, dict[str, float]] = {
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "A": {"A": 1}, "Hz": {"s": -1}, "K": {"K": 1}, "s": {"s": 1},
    "deg": {"rad": 1, "factor": pi / 180.0}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1}, "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2}, "N.m": {"kg": 1, "m": 2, "s": -2}, "N.m.s": {"kg": 1, "m": 2, "s": -1},
    "W": {"kg": 1, "m": 2, "s": -3}, "kg": {"kg": 1}, "kg.m2": {"kg": 1, "m": 2}, "N/m": {"kg": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1}, "N/V": {"m": -1, "s": 1, "A": 1}, "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "J/K": {"kg": 1, "m": 2, "s": -2, "K": -1}, "K/W": {"kg": -1, "m": -2, "s": 3, "K": 1}, "1/K": {"K": -1},
    "s/m": {"m": -1, "s": 1}, "m/N": {"kg": -1, "s": 2}, "N/m^1.5": {}, "m/N^(2/3)": {},
}  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """One variable of the unit."""

    name: str  # name, such as ``speed`` or ``mode[1].mass``
    unit: str  # unit; ``1`` for none
    least: str  # least value, empty for an output
    greatest: str  # greatest value
    meaning: str  # one line
    causality: str  # ``input``, ``output`` or ``parameter``
    reference: int  # place in the C structure
    start: float | None  # value before a run; ``None`` for an output


@cache
def _declared() -> Mapping[str, tuple[tuple[str, str, str, str, str], ...]]:
    """Return the lines of the header: group → name, unit, least and greatest value, meaning."""
    text = (data_path("behavioral") / _HEADER).read_text(encoding="utf-8")
    found = {}
    for group in _GROUPS:
        block = re.search(rf"#define {group}\(ENTRY\)(.*?[^\\])\n", text, re.S)
        assert block is not None, group
        found[group] = tuple(re.findall(r'ENTRY\((\w+), "(\S+)", (?:(\S+), (\S+), )?"([^"]+)"\)', block[1]))
    return found


def variables(motor: Motor, thermal: Thermal | None = None) -> list[Variable]:
    """Return the variables of a motor, in the order of the C structure.

    Without ``thermal`` nothing drifts, and the motor's own heat capacity holds.
    """
    values = _values(motor, thermal)
    found: list[Variable] = []
    for group in _GROUPS:
        for number in range(1, len(motor.modes) + 1) if group == "MODE_PARAMETERS" else (0,):
            for name, unit, least, greatest, meaning in _declared()[group]:
                full = f"mode[{number}].{name}" if number else name
                causality = {"INPUTS": "input", "OUTPUTS": "output"}.get(group, "parameter")
                start = None if causality == "output" else values[full]
                text = f"{meaning}, mode {motor.modes[number - 1].name}" if number else meaning
                if motor.slider:
                    unit, text = linear_unit(unit), slider_words(text)
                found.append(Variable(full, unit, least, greatest, text, causality, len(found), start))
    return found


def _values(motor: Motor, thermal: Thermal | None) -> dict[str, float]:
    """Return the start values of inputs and parameters; the inputs are those of the recommended drive."""
    drive, contact = default_two_phase(motor), motor.contact
    motor = motor.model_copy(update={"modes": modes_on_carrier(motor.modes, motor.mount)})
    body = thermal or Thermal.of(motor)
    values = {
        "amplitude_a": drive.voltage, "amplitude_b": drive.voltage_b, "phase": drive.phase_deg,
        "frequency": drive.frequency, "load_torque": 0.0, "ambient_temperature": body.ambient_k,
        "preload": contact.preload_n, "friction": contact.friction,
        "normal_stiffness": contact.normal_stiffness_n_per_m15, "compliance": contact_law.total_compliance(contact),
        "normal_damping": contact_law.normal_damping(contact),
        "series_compliance": contact.series_compliance_m_per_n, "radius": motor.rotor.radius_m,
        "inertia": motor.rotor.inertia_kg_m2, "bearing": motor.rotor.bearing_damping_n_m_s,
        "capacitance_a": motor.piezo.capacitance_a_f, "capacitance_b": motor.piezo.capacitance_b_f,
        "capacitance_ab": motor.piezo.capacitance_ab_f, "loss": motor.piezo.loss_tangent,
        "frequency_drift": thermal.frequency_drift_per_k if thermal else 0.0,
        "coupling_drift": thermal.coupling_drift_per_k if thermal else 0.0,
        "capacitance_drift": thermal.capacitance_drift_per_k if thermal else 0.0,
        "heat_capacity": body.heat_capacity_j_per_k, "thermal_resistance": body.thermal_resistance_k_per_w,
    }  # fmt: skip
    held = dict.fromkeys(_OF_SPRINGS, 1.0)
    for prefix, along in zip(_MOUNTS, (*carriers(motor.mount), None, None), strict=False):
        values |= {f"{prefix}{name}": value for name, value in (spring_values(along) if along else held).items()}
    for number, mode in enumerate(motor.modes, start=1):
        values |= {f"mode[{number}].{name}": value for name, value in mode_values(mode).items()}
    return {name: rounded(value) for name, value in values.items()}


def fmu_texts(motor: Motor, *, name: str = "", thermal: Thermal | None = None) -> dict[str, str]:
    """Return the text files of a Functional Mock-up Unit: path in the archive → text. Without the binary.

    Raise ParameterError for an invalid name, or a motor that has no averaged model.
    """
    identifier = check_name(name) if name else SUBCIRCUIT
    require_averaged(motor)
    known = variables(motor, thermal)
    behavioral = data_path("behavioral")
    sources = {file: (behavioral / file).read_text(encoding="utf-8") for file in (*C_FILES, _HEADER)}
    sources[_PHASE] = phase_source()
    start = _start_header(motor, known)
    guid = str(uuid.uuid5(uuid.NAMESPACE_URL, "\n".join((identifier, *sources.values(), start))))
    sources[_START] = start.replace("#define MODES", f'#define GUID "{guid}"\n#define MODES', 1)
    return {
        "modelDescription.xml": _model_description(motor, known, identifier, guid),
        **{f"sources/{file}": text for file, text in sources.items()},
    }


def fmu_archive(texts: Mapping[str, str]) -> bytes:
    """Compile the sources of a Functional Mock-up Unit, and return the unit with its binary.

    Raise SimulationError if there is no C compiler.
    """
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


def phase_source() -> str:
    """Return the contact at one phase in C, with the equations of ``piezomotor_averaged_phase``."""
    library = read_library("piezomotor_averaged_phase")
    found = equations(library)
    inputs = [pin.name for pin in library.pins if pin.name not in found.values]
    fields = [*(item.name for item in library.parameters), *inputs, *found.parameters, *found.values]
    lines = {
        name: f"    p->{name} = {translated(text, 'c', lambda used: f'p->{used}')};" for name, text in found.ordered()
    }
    return "\n".join(
        (
            "/* SPDX-License-Identifier: GPL-3.0-or-later",
            " *",
            f" * {library.title}; displacements in um.",
            f" * Written from {library.name}.lib.",
            " */",
            "#include <math.h>",
            "",
            HELPERS["c"],
            "",
            "struct phase {",
            *wrap(f"double {', '.join(fields)};", 110, initial_indent="    ", subsequent_indent="        "),
            "};",
            "",
            "static void phase_parameters(struct phase *p)",
            "{",
            *(lines[name] for name in lines if name in found.parameters),
            "}",
            "",
            "static void phase_forces(struct phase *p)",
            "{",
            *(lines[name] for name in lines if name in found.values),
            "}",
            "",
        )
    )


def _start_header(motor: Motor, known: list[Variable]) -> str:
    rows = [f"    {0.0 if item.start is None else item.start!r}, /* {item.name} */ \\" for item in known]
    lines = [
        "/* SPDX-License-Identifier: GPL-3.0-or-later",
        " *",
        f" * The values of the motor {motor.name}, written by its export, in the order of struct values.",
        " */",
        f"#define MODES {len(motor.modes)}",
        f"#define MOUNTED {int(motor.mount is not None)}",
        f"#define MOUNTED_X {int(len(carriers(motor.mount)) > 1)}",
        "#define START { \\",
        *rows,
        "}",
    ]
    return "\n".join(lines) + "\n"


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
    hidden = {f"{prefix}{name}" for prefix in _MOUNTS[len(carriers(motor.mount)) :] for name in _OF_SPRINGS}
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
