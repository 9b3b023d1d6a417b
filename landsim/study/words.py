"""Small pieces of generated text."""

from collections.abc import Sequence

_NAMES = {"position": "3-D"}


def listed(items: Sequence[str]) -> str:
    """Items in a sentence: with commas, and an "and" before the last."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}" if items else "none"


def between(values: Sequence[float], digits: int = 2) -> str:
    """The least and the greatest of numbers, said once if they read the same."""
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def as_text(key: str) -> str:
    """A key without its unit, as it is spoken."""
    name = key.rsplit("_", 1)[0]
    return _NAMES.get(name, name)
