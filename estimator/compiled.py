"""Compiled functions: what runs at every step of the inertial unit and at every camera frame.

The text of a compiled function is Python over floats, tuples of floats and float64 arrays, and means the same with or
without the compiler (``NUMBA_DISABLE_JIT=1`` leaves it out).  One that is called from Python takes and gives flat
arrays: numba reads an array in a tenth of a microsecond, and a tuple of tuples in several.

Compiled code is kept on disk, beside the modules or in the user's cache folder, so that it is made once.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

from estimator import so3

_P = ParamSpec("_P")
_T = TypeVar("_T")


def compiled(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """The function, compiled when it is first called; division by zero gives infinity or NaN, as in arrays."""
    try:
        result = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # no folder for the cache can be written
        result = numba.njit(error_model="numpy")(function)
    return cast("Callable[_P, _T]", result)


matmul = compiled(so3.matmul)
rotate = compiled(so3.rotate)
rotate_back = compiled(so3.rotate_back)
exp = compiled(so3.exp)
log_between = compiled(so3.log_between)
to_euler = compiled(so3.to_euler)
