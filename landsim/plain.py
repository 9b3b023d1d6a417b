"""Values as JSON has them."""

import math
from collections.abc import Mapping
from typing import Any


def as_json(value: Any) -> Any:
    """A copy in JSON's own types: numpy scalars and arrays become plain, tuples lists, NaN and infinities None."""
    if isinstance(value, Mapping):
        return {str(key): as_json(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
