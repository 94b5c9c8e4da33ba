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
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from pyspice_runner.averaged.c_code import CORE, HEADER, PHASE, START, phase_source, start_header, variables
from pyspice_runner.averaged.library import SUBCIRCUIT, require_averaged
from pyspice_runner.errors import SimulationError, require
from pyspice_runner.export.fmu_description import VERSIONS, Description, Version, state_count
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.compiler import compile_library
from pyspice_runner.spice.library import check_name, data_path

SHARED = "piezomotor_fmi.h"  # by both versions
PLATFORMS = {2: ("linux64", "win64"), 3: ("x86_64-linux", "x86_64-windows")}  # folders of the binaries


def c_files(version: Version) -> tuple[str, ...]:
    """Return the C files that a compiler is given."""
    return CORE, f"piezomotor_fmi{version}.c"


def fmu_texts(motor: Motor, *, name: str = "", thermal: Thermal | None = None, version: Version = 2) -> dict[str, str]:
    """Return the text files of a Functional Mock-up Unit: path in the archive → text. Without the binaries.

    Raise ParameterError for an invalid name or version, or a motor that has no averaged model.
    """
    require(version in VERSIONS, "fmi", version, "2 or 3")
    identifier = check_name(name) if name else SUBCIRCUIT
    require_averaged(motor)
    known = variables(motor, thermal)
    behavioral = data_path("behavioral")
    compiled = c_files(version)
    sources = {file: (behavioral / file).read_text(encoding="utf-8") for file in (*compiled, HEADER, SHARED)}
    sources[PHASE] = phase_source()
    start = start_header(motor, known)
    token = str(uuid.uuid5(uuid.NAMESPACE_URL, "\n".join((identifier, *sources.values(), start))))
    defined = f'#define GUID "{token}"\n#define STATE_COUNT {state_count(motor)}\n#define MODES'
    sources[START] = start.replace("#define MODES", defined, 1)
    described = Description(motor, known, identifier, token, compiled)
    build = {"sources/buildDescription.xml": described.build_text()} if version == 3 else {}
    return {
        "modelDescription.xml": described.text(version),
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
