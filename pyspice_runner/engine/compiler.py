# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile C sources to a shared library by the system's compiler."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Sequence
from pathlib import Path

from pyspice_runner.engine.process import answer
from pyspice_runner.errors import SimulationError

COMPILERS = ("cc", "gcc", "clang")  # the first of them on the PATH is used
_FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-Wall", "-Wextra")
_TIMEOUT = 120.0  # s; a compiler takes about one


def compile_library(folder: Path, sources: Sequence[str], target: Path) -> None:
    """Compile C sources to a shared library for Linux on x86-64. Raise SimulationError elsewhere, or if that fails."""
    here = f"{platform.system()} {platform.machine()}"
    if here != "Linux x86_64":
        raise SimulationError(f"This system is {here}: the binary of a .fmu can be built on Linux x86_64 only.")
    compiler = next((found for found in map(shutil.which, COMPILERS) if found), None)
    if compiler is None:
        raise SimulationError(
            f"No C compiler was found on the PATH ({', '.join(COMPILERS)}); a .fmu contains a compiled motor. "
            "Install one: `sudo apt-get install gcc libc6-dev`."
        )
    command = [compiler, *_FLAGS, "-o", str(target.resolve()), *sources, "-lm"]
    hint = f"Check it by `{compiler} --version`."
    done = answer(command, timeout=_TIMEOUT, hint=hint, what=f"The C compiler {compiler}", folder=folder)
    if done.returncode != 0:
        last = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[-200:])
        raise SimulationError(
            f"The C compiler {compiler} failed: {last}. Install its headers: `sudo apt-get install libc6-dev`.",
            log=done.stderr,
        )
