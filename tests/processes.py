# SPDX-License-Identifier: GPL-3.0-or-later
"""The command in a process of its own, and what processes do and leave behind."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pyspice_runner.spice.wasm import engine_folder

ROOT = Path(__file__).resolve().parents[1]
START = [sys.executable, "-m", "pyspice_runner"]
LONGEST = 120.0  # s; far beyond what anything here takes on a loaded machine


def other_cache(place: Path) -> str:
    """Return a cache folder with nothing in it but the engine, for XDG_CACHE_HOME."""
    (place / "piezomotor").mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):  # by another test
        (place / "piezomotor" / "engine").symlink_to(engine_folder().parent)
    return str(place)


@contextmanager
def begun(*words: str, cwd: Path, shell: bool = False, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """Begin the command as a user does; it ends with the block, and if that fails, so does its ngspice."""
    process = subprocess.Popen(
        words if shell else [*START, *words], cwd=cwd, text=True, errors="replace", start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        yield process
    except BaseException:
        process.kill()
        for left in working_in(cwd.parent):  # which would work on for hours
            os.kill(left, signal.SIGKILL)
        raise
    finally:
        process.kill()
        process.communicate()


def command(*words: str, cwd: Path, shell: bool = False, **environment: str) -> tuple[int, str, str]:
    """Run the command to its end; exit status, output, complaints."""
    with begun(*words, cwd=cwd, shell=shell, **environment) as process:
        output, said = process.communicate(timeout=LONGEST)
    return process.returncode, output, said


PRIVATE = """
script=$1; shift
mount --make-rprivate / 2>/dev/null || {
    # the root of a chroot is no mount point; a copy of it, mounted where nothing propagates, is one
    mount --make-private /proc && mount -t tmpfs none /proc && mkdir /proc/root && mount --rbind / /proc/root &&
    mount --make-rprivate /proc/root && exec chroot /proc/root sh -c "umount /proc && cd $PWD && $script" sh "$@"
}
exec sh -c "$script" sh "$@"
"""


def with_mounts(script: str) -> list[str]:
    """A command that runs a script of the shell, with further arguments; no other process sees the script's mounts."""
    user = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    return ["unshare", *user, "--mount", "--propagation", "unchanged", "sh", "-c", PRIVATE, "sh", script]


def wait_for(condition: Callable[[], object], process: subprocess.Popen[str]) -> None:
    """Wait until a condition holds, or the process that is to bring it about has ended."""
    end = time.monotonic() + LONGEST
    while not condition():
        assert process.poll() is None, f"it ended before: {process.communicate()}"
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


def working_in(folder: Path) -> list[int]:
    """The processes that work in a folder or below, by what /proc says."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            inside = (entry / "cwd").readlink().is_relative_to(folder)
        except OSError:  # it has just ended, or is another user's
            continue
        if inside and int(entry.name) != os.getpid():
            found.append(int(entry.name))
    return found


def gone(folder: Path) -> None:
    """Wait until no process works in the folder; the workers of a sweep end after it."""
    end = time.monotonic() + 30.0
    while left := working_in(folder):
        assert time.monotonic() < end, left
        time.sleep(0.01)


def simulators_in(folder: Path) -> list[int]:
    """Those of ngspice among them; a process that is to become one works there already, but is Python's still."""
    found = []
    for number in working_in(folder):
        with suppress(OSError):  # it has just ended
            if Path(f"/proc/{number}/comm").read_text(encoding="utf-8").startswith("ngspice"):
                found.append(number)
    return found


def handles(process: subprocess.Popen[str], number: int) -> bool:
    """Whether a process has a handler for a signal, by what /proc says."""
    try:
        status = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii")
    except OSError:
        return False
    caught = re.search(r"^SigCgt:\s*(\w+)$", status, re.MULTILINE)
    return caught is not None and bool(int(caught[1], 16) >> (number - 1) & 1)
