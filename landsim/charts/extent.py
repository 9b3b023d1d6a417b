"""Where a panel's axes begin and end, and where the names of its limits go: the same for every renderer."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

from landsim.charts.model import COLOURS, Axis, Band, Cells, Histogram, Limit, Panel, Points, Region, Series

MARGIN = 0.05
"""Beyond the outermost number, as a share of what lies between them."""
DECADES = 6.0
"""A logarithmic axis shows no more below its largest number."""
Along = Literal["x", "y"]


class Name(NamedTuple):
    """Where the name of a limit stands above a panel."""

    limit: Limit
    at: float
    """Share of the panel's width at which its line is."""
    align: Literal["center", "right"]
    """Whether it stands over its line, or ends there because the panel does."""
    level: int
    """0 right above the panel, 1 a row further up."""


def extent(panel: Panel, along: Along) -> tuple[float, float]:
    """From the left, or the bottom, to the other end of an axis.

    What the axis says, or else what its data, limits and regions need and a margin; histograms stand on zero.
    The ends of a logarithmic axis are positive, whatever the data.
    """
    axis = panel.x if along == "x" else panel.y
    if axis.span is not None:
        return axis.span
    if axis.ticks:
        names = (-0.5, len(axis.ticks) - 0.5)
        return names if along == "x" else (names[1], names[0])  # a list is read from its top
    values = [value for value in _numbers(panel, along) if math.isfinite(value)]
    return _logarithmic(values) if axis.log else _linear(values)


def _linear(values: Sequence[float]) -> tuple[float, float]:
    if not values:
        return 0.0, 1.0
    low, high = min(values), max(values)
    margin = MARGIN * (high - low) or 0.5 * abs(high) or 1.0
    # a quantity that starts from zero, such as a share or a count, has its axis start there too
    return (low if low == 0.0 else low - margin), high + margin


def _logarithmic(values: Sequence[float]) -> tuple[float, float]:
    positive = [value for value in values if value > 0.0]
    if not positive:
        return 0.1, 1.0
    high = max(positive)
    low = max(min(positive), high * 10.0**-DECADES)
    room = max(MARGIN * math.log10(high / low), 0.1)
    return low * 10.0**-room, high * 10.0**room


def _numbers(panel: Panel, along: Along) -> Iterator[float]:
    """Every number that an axis has to reach."""
    for series in panel.series:
        yield from (value for value in _of_series(series, along) if value is not None)
    for mention in panel.mentions:
        if isinstance(mention, Limit) and mention.along == along:
            yield mention.at
        elif isinstance(mention, Region):
            yield from (value for value in (mention.x if along == "x" else mention.y) if value is not None)


def _of_series(series: Series, along: Along) -> Iterable[float | None]:
    if isinstance(series, Cells):
        return range(len(series.values[0] if along == "x" else series.values))
    if isinstance(series, Histogram):
        return series.edges if along == "x" else (*series.heights, 0.0)
    if isinstance(series, Band):
        return series.x if along == "x" else (*series.low, *series.high)
    own = series.x if along == "x" else series.y
    if isinstance(series, Points):
        bars = series.x_bar if along == "x" else series.y_bar
        return own if bars is None else (*own, *bars[0], *bars[1])
    return own


def share(axis: Axis, ends: tuple[float, float], value: float) -> float:
    """Where on an axis a value is, from 0 at its first end to 1 at the other; outside of it, less or more."""
    low, high = ends
    if axis.log:
        low, high, value = math.log10(low), math.log10(high), math.log10(value) if value > 0.0 else -math.inf
    return (value - low) / (high - low)


def names_above(panel: Panel, width: float, letter: float) -> list[Name]:
    """Where the names of a panel's vertical limits go: each over its line, and none over another.

    Parameters
    ----------
    panel : Panel
    width : float
        Of the panel.
    letter : float
        Width of an ordinary letter, in the unit of ``width``.
    """
    ends = extent(panel, "x")
    upright = [one for one in panel.mentions if isinstance(one, Limit) and one.along == "x" and one.label]
    where = sorted(((share(panel.x, ends, one.at), one) for one in upright), key=lambda pair: pair[0])
    free: list[float] = []
    found = []
    for at, limit in where:
        if not -1e-9 <= at <= 1.0 + 1e-9:
            continue
        half = 0.5 * (len(limit.label) + 1.5) * letter / width
        align: Literal["center", "right"] = "center" if at + half <= 1.0 else "right"
        first, last = (at - half, at + half) if align == "center" else (at - 2.0 * half, at)
        level = next((i for i, end in enumerate(free) if first >= end), len(free))
        free[level : level + 1] = [last]
        found.append(Name(limit, at, align, level))
    return found


def tint(value: float | None) -> str:
    """Colour of a number from -1 to 1: white at 0, blue towards -1, vermilion towards 1; white without a number."""
    end = COLOURS["vermilion" if (value or 0.0) > 0.0 else "blue"]
    share = min(abs(value or 0.0), 1.0)
    parts = (round(255.0 + share * (int(end[i : i + 2], 16) - 255.0)) for i in (1, 3, 5))
    return "#" + "".join(f"{part:02x}" for part in parts)
