# SPDX-License-Identifier: GPL-3.0-or-later
"""One thread of BLAS, for speed and for results that do not depend on the number of threads. Both are decorators."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit NumPy's BLAS to one thread: more change the last bits, and are never faster for small matrices."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


@contextmanager
def one_thread_of_scipy() -> Iterator[None]:
    """Limit SciPy's BLAS too, which is another one, and limited only where it is loaded."""
    import scipy.linalg  # noqa: F401 # takes long to load

    with one_thread():
        yield
