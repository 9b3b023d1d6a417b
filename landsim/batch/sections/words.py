"""Numbers in the sentences of a report, written as in its tables and figures."""

import math
from collections.abc import Iterable
from typing import Any

UNITS = {"deg": "°"}
"""Of a summary, as printed; others are printed as they are."""
PLAIN = 1e5
"""From here on a number is written with a power of ten."""


def unit_of(name: str) -> str:
    """A unit as printed."""
    return UNITS.get(name, name)


def number(value: float | None, digits: int = 3) -> str:
    """A number for a person, with so many significant digits and a minus sign; a dash where there is none."""
    if value is None:
        return "–"
    text = f"{value + 0.0:.{digits}g}"  # -0 is 0
    if "e" in text:
        if 1.0 <= abs(float(text)) < PLAIN:  # 1.62e+03 is 1620
            return f"{float(text):.0f}".replace("-", "−")
        mantissa, exponent = text.split("e")
        raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{mantissa}·10{raised}"
    return text.replace("-", "−")


def signed(value: float | None, digits: int = 3) -> str:
    """A difference: with its sign, but zero without one; a question mark where there is none."""
    if value is None:
        return "?"
    return f"{'+' if value > 0.0 else ''}{number(value, digits)}"


def with_unit(value: float | None, unit: str, digits: int = 3, *, sign: bool = False) -> str:
    """A number and its unit; ``unit`` as in a summary."""
    printed = unit_of(unit)
    text = signed(value, digits) if sign else number(value, digits)
    return text + ("" if value is None or not printed else printed if printed == "°" else f" {printed}")


def several(count: int, of: str) -> str:
    """A number of things, with its plural."""
    return f"{count:,} {of}{'' if count == 1 else 's'}"


def flights_for(level: float) -> int:
    """How many flights a percentile (%) takes: 1/(1 - p), fewer have none beyond it."""
    return math.ceil(100.0 / (100.0 - level) - 1e-9)


def span_of(seeds: Iterable[Any]) -> list[int] | None:
    """The first and the last seed; None of no flight."""
    known = [int(seed) for seed in seeds if seed is not None]
    return [min(known), max(known)] if known else None
