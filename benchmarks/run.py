# SPDX-License-Identifier: GPL-3.0-or-later
"""Run every benchmark of this folder, or the named ones: ``python benchmarks/run.py speed_torque``."""

from __future__ import annotations

import importlib
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run(names: list[str]) -> int:
    """Run the ``main`` of each module; return the exit status."""
    sys.path.insert(0, str(HERE.parent))  # some take helpers from tests and from each other
    known = sorted(path.stem for path in HERE.glob("*.py") if "\ndef main(" in path.read_text(encoding="utf-8"))
    unknown = [name for name in names if name not in known]
    if unknown:
        print(f"There is no benchmark {', '.join(unknown)}; there are {', '.join(known)}.", file=sys.stderr)
        return 2
    for name in names or known:
        module = importlib.import_module(name)
        print(f"--- {name}: {(module.__doc__ or '').partition(chr(10))[0]}", flush=True)
        began = time.perf_counter()
        module.main()
        print(f"    ({time.perf_counter() - began:.0f} s)", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
