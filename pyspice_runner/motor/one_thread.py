# SPDX-License-Identifier: GPL-3.0-or-later
"""One thread of BLAS, for speed and for results that do not depend on the number of threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def one_thread(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Limit NumPy's BLAS to one thread: more change the last bits, and are never faster for small matrices."""

    @wraps(function)
    def limited(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def one_thread_of_scipy(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Limit SciPy's BLAS too, which is another one, and limited only where it is loaded."""
    limited = one_thread(function)

    @wraps(function)
    def loaded(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
        import scipy.linalg  # noqa: F401 # takes long to load

        return limited(*args, **kwargs)

    return loaded
