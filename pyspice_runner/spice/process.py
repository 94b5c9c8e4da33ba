# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes of ngspice and of compilers: their folder, environment, output and end."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from pyspice_runner.errors import SimulationError

FREE_SPACE = "Free some space or set TMPDIR."


def answer(
    command: Sequence[str], *, timeout: float, hint: str, what: str = "", folder: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end and return its output.

    ``timeout`` is wall time in s; a message names the program as ``what`` and ends in ``hint``. Raise SimulationError
    if the program does not start, or does not end in time.
    """
    try:
        return subprocess.run(
            command, cwd=folder, capture_output=True, encoding="utf-8", errors="replace", timeout=timeout,
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
            hint = "Raise the limit of open files, as by `ulimit -n 1024`."
        raise SimulationError(f"{what or command[0]} does not run: {error}. {hint}") from error


def new_folder() -> Path:
    """Return a new temporary folder for one run of ngspice. Raise SimulationError if it cannot be created."""
    try:
        return Path(tempfile.mkdtemp(prefix="piezomotor-"))
    except OSError as error:
        raise SimulationError(f"Cannot write the netlist: {error.strerror}. {FREE_SPACE}") from error


def start(
    command: Sequence[str], folder: Path, *, ends_with_thread: bool = True, **streams: Any
) -> subprocess.Popen[bytes]:
    """Start ngspice in a folder, as the leader of a process group of its own.

    Only the main thread receives signals (:func:`.held`); a run of another thread ends with that thread, where
    ``setpriv`` of util-linux is installed, unless it may outlive the thread.

    Without a HOME ngspice 39 crashes; the user's own start-up file must not be read.
    """
    own = ("SPICE", "NGSPICE", "LC_")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(own)}
    environment |= {"LC_ALL": "C", "HOME": str(folder)}
    if (folder / "spinit").exists():
        environment["SPICE_SCRIPTS"] = str(folder)
    if ends_with_thread and threading.current_thread() is not threading.main_thread():
        command = [*_ending_with_thread(), *command]
    return subprocess.Popen(command, cwd=folder, env=environment, start_new_session=True, **streams)


@cache
def _ending_with_thread() -> tuple[str, ...]:
    """Return the words before a command by which Linux kills it at the end of the thread that started it."""
    words = (shutil.which("setpriv") or "", "--pdeathsig", "KILL")
    with contextlib.suppress(OSError):
        if subprocess.run([*words, "true"], capture_output=True, check=False).returncode == 0:
            return words
    return ()


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process of :func:`start` and its children, unless it has ended."""
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()
