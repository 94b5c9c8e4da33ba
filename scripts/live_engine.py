# SPDX-License-Identifier: GPL-3.0-or-later
"""Rebuild the engine of the live page from the npm package eecircuit-engine: ngspice as WebAssembly, once, compressed.

Run `.venv/bin/python scripts/live_engine.py`. It needs npm and network access. It writes `ngspice.wasm.gz`,
`ngspice.js`, `engine.json` and `LICENSE` into pyspice_runner/view/live_page/. The version is fixed here; a package with
another hash is an error. To take a new version, change both constants.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import json
import re
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

PACKAGE, VERSION = "eecircuit-engine", "1.8.0"
SHA512 = "surzfC0ZZYRN9X3sRN4w5RqTUypoEArTyMQJTXnBLguH10G+QKLp2LveXHybxyTZPLZVPTfahVw6J8U2caf1vg=="
NGSPICE = "45.2"  # printed by `ngspice -v` of this build
TARGET = Path(__file__).resolve().parents[1] / "pyspice_runner" / "view" / "live_page"
_MODULE = "dist/eecircuit-engine.mjs"
_WASM = re.compile(r"data:application/wasm;base64,([A-Za-z0-9+/=]+)")
_FACTORY = "async function e(e = {})"


def fetch(folder: Path) -> bytes:
    """Return the archive of the package, after a check of its hash."""
    subprocess.run(
        ["npm", "pack", "--silent", f"{PACKAGE}@{VERSION}"], cwd=folder, check=True, stdout=subprocess.DEVNULL
    )
    archive = (folder / f"{PACKAGE}-{VERSION}.tgz").read_bytes()
    found = base64.b64encode(hashlib.sha512(archive).digest()).decode("ascii")
    if found != SHA512:
        sys.exit(f"{PACKAGE} {VERSION} has the SHA-512 {found}, not {SHA512}: check the package before you use it.")
    return archive


def member(archive: bytes, name: str) -> str:
    """Return a text file of the package."""
    with tarfile.open(fileobj=io.BytesIO(archive), mode="r:gz") as files:
        file = files.extractfile(f"package/{name}")
        assert file is not None
        return file.read().decode("utf-8")


def split(module: str) -> tuple[str, bytes]:
    """Return the loader that Emscripten made, without the binary, and the binary."""
    binaries = set(_WASM.findall(module))
    if len(binaries) != 1:
        sys.exit(f"The module has {len(binaries)} different binaries, not one: adapt this script to its new form.")
    start = module.index(_FACTORY)
    loader = module[start : module.index("//#endregion", start)]
    loader = _WASM.sub("", loader).replace("import.meta.url", '""')
    return loader.replace(_FACTORY, "async function createNgspice(e = {})", 1), base64.b64decode(binaries.pop())


def write(archive: bytes, target: Path) -> None:
    """Write the four files."""
    loader, wasm = split(member(archive, _MODULE))
    head = f"// Loader of ngspice {NGSPICE}, from {PACKAGE} {VERSION}, MIT licence; written by scripts/live_engine.py\n"
    (target / "ngspice.js").write_text(head + loader, encoding="utf-8", newline="\n")
    (target / "ngspice.wasm.gz").write_bytes(gzip.compress(wasm, 9, mtime=0))
    (target / "LICENSE").write_text(member(archive, "LICENSE"), encoding="utf-8", newline="\n")
    facts = {
        "package": f"{PACKAGE} {VERSION}",
        "package_licence": "MIT",
        "package_sha512_base64": SHA512,
        "ngspice": NGSPICE,
        "ngspice_licence": "modified BSD; KLU: LGPL 2.1 or later",
        "wasm_bytes": len(wasm),
        "wasm_sha256": hashlib.sha256(wasm).hexdigest(),
        "loader_sha256": hashlib.sha256((head + loader).encode()).hexdigest(),
    }
    (target / "engine.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        write(fetch(Path(place)), TARGET)
    print(*sorted(path.name for path in TARGET.iterdir()), sep="\n")
