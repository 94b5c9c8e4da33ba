# SPDX-License-Identifier: GPL-3.0-or-later
"""Roots without scipy.optimize, which takes half a second to load, and one thread of BLAS as decorators.

One thread is fast, and gives results that do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


def root(function: Callable[[float], float], low: float, high: float, tolerance: float = 0.0) -> float:
    """Return where a continuous function changes its sign between two places, by bisection.

    The values at the two places differ in sign, or one of them is 0. A tolerance of 0 gives neighbouring numbers.
    """
    at_low = function(low)
    if at_low == 0.0 or function(high) == 0.0:
        return low if at_low == 0.0 else high
    while abs(high - low) > tolerance:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if (function(middle) > 0.0) == (at_low > 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


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
