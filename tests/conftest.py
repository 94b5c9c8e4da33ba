# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests share."""

import os

# before NumPy loads: two workers with two threads each would wait for each other on two cores
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
