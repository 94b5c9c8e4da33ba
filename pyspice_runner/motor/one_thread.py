# SPDX-License-Identifier: GPL-3.0-or-later
"""One thread of BLAS, for speed and for results that do not depend on the number of threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


def one_thread(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Limit BLAS to one thread: more change the last bits of a result, and are never faster for small matrices.

    SciPy's is another one than NumPy's, and limited only where it is loaded before the call.
    """

    @wraps(function)
    def limited(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
