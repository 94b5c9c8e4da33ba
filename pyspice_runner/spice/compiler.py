# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile C sources to a shared library by the system's compiler.

Compiled files are in a cache that only this user can write, because the code in them is run.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice.program import answer

FOR_WINDOWS = "x86_64-w64-mingw32-gcc"  # of mingw-w64
COMPILERS = ("cc", "gcc", "clang")  # the first of them on the PATH is used
_LOOPS = ("-fno-math-errno", "-fno-trapping-math")  # those with sqrt or a comparison use vector units, at equal results
_FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-shared", "-fvisibility=hidden", "-Wall", "-Wextra", *_LOOPS)
_FOR_WINDOWS = ("-D__USE_MINGW_ANSI_STDIO=1", "-static", "-s")
_TIMEOUT = 120.0  # s; a compiler takes about one


def find_compiler() -> str:
    """Return the path of a C compiler. Raise SimulationError if none is installed."""
    compiler = next((found for found in map(shutil.which, COMPILERS) if found), None)
    if compiler is None:
        raise SimulationError(
            f"No C compiler was found on the PATH ({', '.join(COMPILERS)}). Install one: `sudo apt-get install gcc "
            "libc6-dev`."
        )
    return compiler


def compile_library(folder: Path, sources: Sequence[str], target: Path, *, windows: bool = False) -> bool:
    """Compile C sources to a shared library, for this system or for Windows on x86-64; return whether that was done.

    It is not if mingw-w64 is not installed. Raise SimulationError if the compiler fails, or none is there for this
    system.
    """
    compiler = shutil.which(FOR_WINDOWS) if windows else find_compiler()
    if compiler is None:
        return False
    flags = _FOR_WINDOWS if windows else ("-fPIC",)
    command = [compiler, *_FLAGS, *flags, "-o", str(target.resolve()), *sources, "-lm"]
    hint = f"Check it by `{compiler} --version`."
    done = answer(command, timeout=_TIMEOUT, hint=hint, what=f"The C compiler {compiler}", folder=folder)
    if done.returncode != 0:
        last = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[-200:])
        raise SimulationError(
            f"The C compiler {compiler} failed: {last}. Install its headers: `sudo apt-get install libc6-dev`.",
            log=done.stderr,
        )
    return True


def cached_library(name: str, texts: Mapping[str, str], folder: Path) -> Path:
    """Return the shared library ``NAME.so`` of C texts, file name → text; compile it if it is not in a folder yet.

    A file or folder that another user owns or can write is not used: it is replaced, or the folder cannot be written.
    Raise SimulationError if there is no compiler, if it fails, or if the folder cannot be written.
    """
    compiler = find_compiler()
    what = f"The C compiler {compiler}"
    version = answer([compiler, "--version"], timeout=_TIMEOUT, hint="Install another.", what=what).stdout
    key = "\n".join((version, platform.platform(), *_FLAGS, *texts, *texts.values()))
    place = folder / hashlib.sha256(key.encode()).hexdigest()[:32] / f"{name}.so"
    if _is_private(place):
        return place
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.parent.chmod(0o700)  # an OSError if it belongs to another user
        with tempfile.TemporaryDirectory(prefix=".part-", dir=place.parent) as work:
            for file, text in texts.items():
                Path(work, file).write_text(text, encoding="utf-8")
            made = Path(work, place.name)
            compile_library(Path(work), [file for file in texts if file.endswith(".c")], made)
            made.chmod(0o700)
            made.replace(place)  # complete or not there, also for another process
    except OSError as error:
        raise SimulationError(
            f"Cannot write the compiled module to {place.parent}: {error.strerror}. Set XDG_CACHE_HOME."
        ) from error
    return place


def _is_private(path: Path) -> bool:
    """Return whether a file exists, it and its folder belong to this user, and no one else can write them.

    Windows gives no owner; there the folder is in the user's own.
    """
    try:
        found = [place.stat() for place in (path, path.parent)]
    except OSError:
        return False
    return not hasattr(os, "getuid") or all(
        status.st_uid == os.getuid() and not status.st_mode & 0o022 for status in found
    )
