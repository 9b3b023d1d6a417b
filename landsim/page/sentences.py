"""Words that several parts of a page share."""

from collections.abc import Mapping
from typing import Any

from landsim.charts.shared import percent

DASH = "–"
"""Where there is nothing."""


def interval(rate: Mapping[str, Any]) -> str:
    """The interval of a rate."""
    return DASH if rate["low"] is None else f"{percent(rate['low'])} to {percent(rate['high'])}"


def rate_row(name: str, rate: Mapping[str, Any]) -> tuple[str, ...]:
    """A rate as cells: name, count, of how many, share, interval."""
    return (name, str(rate["count"]), str(rate["n"]), percent(rate["rate"]), interval(rate))
