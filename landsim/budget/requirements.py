"""What is asked for: bounds on the error of a quantity, at a distance from the threshold."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from landsim.budget.typed import taken_apart
from landsim.errors import InputError, did_you_mean, nearest, shown
from landsim.schema import LARGEST
from landsim.study.model import QUANTITIES, Quantity

OTHER_NAMES = {
    "lateral": "cross", "crosstrack": "cross", "height": "altitude", "vertical": "altitude",
    "longitudinal": "along", "distance": "along", "bank": "roll", "heading": "yaw",
}  # fmt: skip
"""What a quantity is called elsewhere."""
RANGE_KEY = "range_m"
TABLE = "require"
EXAMPLE = "altitude=0.5@600"


class Requirement(NamedTuple):
    """A bound on one quantity's error."""

    quantity: Quantity
    bound: float
    """On the absolute error, m or rad."""
    distance: float | None
    """From the camera forward to the threshold, m, negative past it; None for wherever it can be held."""
    source: str
    """Where it was given, for messages."""

    def __str__(self) -> str:
        unit = "°" if self.quantity.unit == "deg" else f" {self.quantity.unit}"
        bound = f"{self.quantity.name} {self.bound / self.quantity.scale:g}{unit}"
        if self.distance is None:
            return bound
        return f"{bound} at {self.distance:g} m".replace("-", "−")


def parse_requirement(text: str) -> Requirement:
    """A requirement from ``quantity=bound@range``, degrees and metres; ``@range`` may be left out.

    Raises
    ------
    InputError
        If it is none.
    """
    what, name, rest = taken_apart("requirement", text)
    bound, at, distance = (part.strip() for part in (rest or "").partition("@"))
    if not (name and bound) or (at and not distance):
        raise InputError(f"{what}: must be quantity=bound@range, in degrees and metres, such as {EXAMPLE}")
    values = []
    for part, meaning in ((bound, "bound"), (distance, "range")):
        try:
            values.append(float(part) if part else None)
        except ValueError:
            raise InputError(f"{what}: the {meaning} must be a number, not {part}; such as {EXAMPLE}") from None
    return _requirement(_quantity(name, what), values[0], values[1], what)


def read_requirements(path: Path) -> list[Requirement]:
    """The requirements of a TOML file.

    It holds tables ``[[require]]``, each with any of ``roll_deg``, ``pitch_deg``, ``yaw_deg``, ``cross_m``,
    ``altitude_m`` and ``along_m``, and the ``range_m`` at which they are asked for.

    Raises
    ------
    InputError
        If it cannot be read, or is not such a file.
    """
    try:
        content = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not valid TOML: {error}") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    return list(_of_tables(content, path))


def _of_tables(content: Mapping[str, Any], path: Path) -> Iterator[Requirement]:
    for key in content:
        if key != TABLE:
            raise InputError(f"{path}: {key}: unknown key{did_you_mean(key, [TABLE])}")
    tables = content.get(TABLE)
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise InputError(f"{path}: must hold tables [[{TABLE}]], each with a {RANGE_KEY} and bounds such as altitude_m")
    keys = {f"{q.name}_{q.unit}": q for q in QUANTITIES.values()}
    for i, table in enumerate(tables, 1):
        place = f"{path}: {TABLE} {i}"
        numbers: dict[str, float] = {}
        for key, value in table.items():
            if key != RANGE_KEY and key not in keys:
                raise InputError(f"{place}: {key}: unknown key{_meant(key, [*keys, RANGE_KEY])}")
            numbers[key] = _number(value, f"{place}: {key}")
        if not any(key in keys for key in table):
            raise InputError(f"{place}: has no bound; known: {', '.join(keys)}")
        for key, number in numbers.items():
            if key != RANGE_KEY:
                yield _requirement(keys[key], number, numbers.get(RANGE_KEY), f"{place}: {key}")


def _number(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{what}: must be a number, not {shown(value)}")
    try:
        return float(value)
    except OverflowError:  # Python's integers, and so those of its TOML, have no end
        raise InputError(f"{what}: must be a number of at most {LARGEST:g} in size") from None


def _quantity(name: str, what: str) -> Quantity:
    quantity = QUANTITIES.get(name)
    if quantity is None:
        raise InputError(f'{what}: unknown quantity "{name}"{_meant(name, list(QUANTITIES))}')
    return quantity


def _meant(name: str, known: Sequence[str]) -> str:
    """The end of a message about an unknown name: the one of that meaning, the nearest one, or all."""
    stem, _, unit = name.lower().partition("_")
    close = nearest(stem, [*QUANTITIES, *OTHER_NAMES]) or ""
    other = OTHER_NAMES.get(close, close) + (f"_{unit}" if unit else "")
    return f"; did you mean {other}?" if other in known else did_you_mean(name, known)


def _requirement(quantity: Quantity, bound: float | None, distance: float | None, what: str) -> Requirement:
    """In SI units, if the numbers are possible."""
    if bound is None or not (math.isfinite(bound) and bound > 0.0):
        raise InputError(f"{what}: the bound must be a finite number above 0, not {bound:g}")
    largest = 180.0 if quantity.unit == "deg" else LARGEST
    if bound >= largest:
        raise InputError(f"{what}: the bound must be below {largest:g} {quantity.unit}, not {bound:g}")
    if distance is not None and not (math.isfinite(distance) and abs(distance) <= LARGEST):
        raise InputError(f"{what}: the range must be a finite number of metres, not {distance:g}")
    return Requirement(quantity, bound * quantity.scale, distance, what)
