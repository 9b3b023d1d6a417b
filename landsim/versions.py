"""What a result was made with: the versions that decide its bits."""

import importlib.metadata
import platform
from functools import cache

LIBRARIES = ("landsim", "jsbsim", "numpy", "scipy", "filterpy", "numba", "llvmlite")


@cache
def versions(*others: str) -> dict[str, str]:
    """Versions of Python, of `LIBRARIES` and of other packages, by name."""
    found = {"python": platform.python_version()}
    for name in (*LIBRARIES, *others):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found
