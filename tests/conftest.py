# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests share."""

import gc
import os

# before NumPy loads: two workers with two threads each would wait for each other on two cores
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# each Python that a test starts would compile the package again, which takes 0.1 s
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

gc.disable()  # while the tests are collected, which makes many objects and little garbage: half of the time


def pytest_collection_finish() -> None:
    """Collect garbage from here on, but do not search what is needed to the end."""
    gc.freeze()
    gc.enable()
