"""Compiled functions: what runs at every step of the inertial unit and at every camera frame.

The text of a compiled function is Python over floats, tuples of floats and float64 arrays, and gives the same numbers
to rounding without the compiler (``NUMBA_DISABLE_JIT=1`` leaves it out; what is infinite or NaN here may be an
exception or a warning there).  One that is called from Python takes and gives flat arrays: numba reads an array in a
tenth of a microsecond, and a tuple of tuples in several.

Compiled code is kept on disk, beside the modules or in the user's cache folder, so that it is made once.  It holds the
code of the functions that it calls as well, wherever they stand, so it is kept under a digest of all of them.
"""

import dis
import hashlib
import types
from collections.abc import Callable, Iterator
from typing import Any, ParamSpec, TypeVar, cast

import numba

from estimator import so3

_P = ParamSpec("_P")
_T = TypeVar("_T")


def compiled(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """The function, compiled when it is first called; division by zero gives infinity or NaN, as in arrays."""
    try:
        result: Any = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # no folder for the cache can be written
        return cast("Callable[_P, _T]", numba.njit(error_model="numpy")(function))
    if hasattr(result, "py_func"):  # not where the compiler is left out
        # numba itself looks at the date of the file in which the function stands, and no further
        index = result._cache._cache_file
        index._source_stamp = (index._source_stamp, digest(result.py_func))
    return cast("Callable[_P, _T]", result)


def digest(function: Callable[..., Any]) -> str:
    """A digest of a function's code, of what it calls and of the constants that it and they refer to."""
    return hashlib.sha256("\n".join(_parts(function.__code__, function.__globals__)).encode()).hexdigest()


def _parts(code: types.CodeType, names: dict[str, Any]) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _parts(constant, names)
        else:
            yield repr(constant)
    loaded = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    for name in sorted(loaded & names.keys()):
        value = getattr(names[name], "py_func", names[name])
        if isinstance(value, types.FunctionType):
            yield f"{name} {digest(value)}"
        elif isinstance(value, type):
            yield f"{name} {getattr(value, '_fields', value.__qualname__)}"
        elif isinstance(value, types.ModuleType):
            yield f"{name} {value.__name__}"
        else:
            yield f"{name} {value!r}"


matmul = compiled(so3.matmul)
rotate = compiled(so3.rotate)
rotate_back = compiled(so3.rotate_back)
exp = compiled(so3.exp)
log_between = compiled(so3.log_between)
to_euler = compiled(so3.to_euler)
