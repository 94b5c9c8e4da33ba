# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m pyspice_runner`` is the command ``piezomotor``."""

from __future__ import annotations

import gc
import io
import os
import sys

from pyspice_runner.interrupts import end_at_once


def main() -> None:
    """Run the command line and leave with its exit status."""
    end_at_once()  # also while the rest is loaded, which takes half a second
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small, so that a second thread only waits
    os.environ["MPLBACKEND"] = "agg"  # the command opens no window, and what a notebook sets may be absent here
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:  # closed, as by `>&-`
            setattr(sys, stream, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
    if isinstance(sys.stdout, io.TextIOWrapper):  # a file's name may hold what cannot be printed
        sys.stdout.reconfigure(errors="backslashreplace")
    gc.disable()  # what is loaded stays: a tenth of the time
    from pyspice_runner.cli import run

    gc.freeze()
    gc.enable()
    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
