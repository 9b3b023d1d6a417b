"""What the charts of a batch and those of a comparison have in common."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from landsim.batch.sections.words import number, several, unit_of, with_unit
from landsim.charts.model import Axis, Band, Curve, Dash, Limit, Numbers, Points, Tone

__all__ = [
    "PERCENT", "QUANTITIES", "SOURCES", "beyond", "counted", "distance_axis", "floor_of", "flown", "limits_near",
    "number", "percent", "rates", "several", "share_floor", "there", "times", "unit_of", "with_unit", "within",
]  # fmt: skip
QUANTITIES = {
    "along_m": "along", "cross_m": "cross", "height_m": "height", "roll_deg": "roll", "pitch_deg": "pitch",
    "yaw_deg": "yaw",
}  # fmt: skip
"""Of the camera triad, as they are called in a figure."""
SOURCES = {"vision": "vision, a frame alone", "fused": "fused with the IMU"}
PERCENT = 100.0


def percent(share: float | None) -> str:
    """A share as a percentage, with four digits: 1 less a little must not look like 1."""
    return "–" if share is None else f"{number(PERCENT * share, 4)} %"


def counted(entry: Mapping[str, Any]) -> str:
    """A rate of a summary in words: count, share and interval."""
    if entry["rate"] is None:
        return "no flight"
    return (
        f"{entry['count']} of {entry['n']}: {percent(entry['rate'])}"
        f" ({percent(entry['low'])} to {percent(entry['high'])})"
    )


def flown(scenario: Any, n: int, seeds: Sequence[int] | None) -> str:
    """Which flights a figure is of: scenario, how many, and the seeds that fly them again."""
    if not seeds:
        return f"{scenario}: {several(n, 'flight')}"
    first, last = seeds
    return f"{scenario}: {several(n, 'flight')}, seed{f' {first}' if first == last else f's {first} to {last}'}"


def times(values: Iterable[float | None], factor: float) -> Numbers:
    """Numbers in another unit."""
    return tuple(None if value is None else factor * value for value in values)


def there(numbers: Sequence[float | None]) -> bool:
    """Whether there is a number to draw: a curve of none would be named in a legend and seen nowhere."""
    return any(value is not None for value in numbers)


def rates(
    name: str, entries: Sequence[Mapping[str, Any]], rows: Sequence[float], tone: Tone, floor: float | None = None
) -> Points:
    """Rates with their intervals, %, one a row of a list; with a floor, for a logarithmic axis that begins there."""

    def at(value: float | None) -> float | None:
        if value is None:
            return None
        return PERCENT * value if floor is None else max(PERCENT * value, floor)

    shown = tuple(None if floor is not None and not entry["rate"] else at(entry["rate"]) for entry in entries)
    if floor is None:
        shown = tuple(at(entry["rate"]) for entry in entries)
    bars = (tuple(at(entry["low"]) for entry in entries), tuple(at(entry["high"]) for entry in entries))
    return Points(
        name, shown, tuple(rows), tone, size=4.5, hover=tuple(counted(entry) for entry in entries), x_bar=bars,
        bar_width=1.4,
    )  # fmt: skip


def floor_of(entries: Iterable[Mapping[str, Any]]) -> float:
    """A power of ten below every rate (%) that is not zero, and below the upper end of those that are."""
    least = [PERCENT * (entry["rate"] or 0.1 * entry["high"]) for entry in entries if entry["rate"] is not None]
    return 10.0 ** math.floor(math.log10(min(least, default=1.0)) - 1e-9)


def beyond(
    name: str,
    curve: Mapping[str, Any],
    missed: Mapping[str, Any] | None,
    limit: float | None,
    floor: float,
    tone: Tone,
    dash: Dash = "solid",
    *,
    band: bool = True,
) -> tuple[Band | Curve | Points, ...]:
    """How many flights reach a value or go beyond it, %, and the band of its confidence.

    A flight is at its own value: between two of them the share is that of the one farther out.  Where no flight is
    left the band goes on to the limit: what so many flights without one still allow.
    """
    x, share = tuple(curve["x"]), times(curve["share"], PERCENT)
    low = tuple(max(PERCENT * value, floor) for value in curve["low"])
    high = times(curve["high"], PERCENT)
    if not x:
        return ()
    series: list[Band | Curve | Points] = []
    if band:
        more = missed is not None and limit is not None and missed["count"] == 0 and missed["high"] is not None
        tail = (floor, PERCENT * missed["high"]) if more and missed is not None else None
        series.append(
            Band(
                "95 % confidence", (*x, *((limit,) if tail else ())),
                (*low, *((tail[0],) if tail else ())), (*high, *((tail[1],) if tail else ())), tone, 0.18,
                step="before", legend=False,
            )
        )  # fmt: skip
    series.append(Curve(name, x, share, tone, dash, step="before"))
    if len(x) == 1:  # all flights alike: a line of one point is none
        series.append(Points(name, x, share, tone, size=4.5, legend=False))
    return tuple(series)


def share_floor(curves: Iterable[Mapping[str, Any]]) -> float:
    """Where the logarithmic axis of `beyond` begins, %: a power of ten below the smallest share."""
    least = min((PERCENT * share for curve in curves for share in curve["share"] if share > 0.0), default=1.0)
    return 10.0 ** math.floor(math.log10(least) - 0.3)


def within(span: tuple[float, float], value: float) -> bool:
    """Whether a limit is near enough to numbers that span so much to be drawn beside them."""
    low, high = span
    reach = high - low
    return low - reach <= value <= high + reach


def limits_near(limits: Iterable[tuple[float, str]], span: tuple[float, float]) -> tuple[tuple[Limit, ...], str]:
    """Limits (value and label) that are near the numbers, and of the others what there is to say.

    Drawn at any distance, a limit that is far off would leave no room for what the panel shows.
    """
    every = sorted(dict(limits).items())
    near = tuple(Limit("x", value, f"limit {label}") for value, label in every if within(span, value))
    far = [label for value, label in every if not within(span, value)]
    beyond_it = f"beyond this panel: limit{'s' if len(far) > 1 else ''} {' and '.join(far)}"
    return near, beyond_it if far else ""


def distance_axis(distances: Sequence[float]) -> Axis:
    """Of distances to the threshold, as they are flown: falling to the right."""
    first, last = (max(distances), min(distances)) if distances else (1.0, 0.0)
    return Axis("distance to the threshold", "m", span=(first, last if last < first else first - 1.0))
