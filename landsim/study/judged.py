"""Envelopes against bounds: percentiles at the listed ranges, and from where on each bound holds.

Every figure is in the unit that its key or the entry's ``unit`` says.  Nothing is rounded, and nothing is adjusted.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import SeedSequence

from landsim.config import Scenario, StudyConfig
from landsim.study.envelope import child
from landsim.study.holding import holds_from, holds_from_interval
from landsim.study.model import (
    CHANCE,
    LEVEL,
    LEVELS,
    NORMAL,
    OF_STAGE,
    QUANTITIES,
    READINGS,
    SOURCES,
    Envelope,
    Quantity,
    StageName,
    chance,
    enough,
)
from landsim.study.precision import Precision
from landsim.units import DEG

if TYPE_CHECKING:
    from landsim.study.flights import FlownErrors

KEYS = ("p68", "p95", "p99_7")
"""Of the percentiles at ``LEVELS``."""
LEAVES = 0.05
"""Relative difference at which a percentile has left the first order, if it is not by chance."""
SAME_PLACE = 1e-6
"""Distances that differ by less are one, m."""
LINES = ("left", "threshold", "right")
_PLACES: tuple[tuple[str, ...], ...] = (tuple(OF_STAGE), READINGS, SOURCES)
"""Of an envelope's interval in the seed."""


def bound_key(quantity: Quantity) -> str:
    """The quantity's key in ``[study.bounds]``."""
    return f"{quantity.name}_{quantity.unit}"


def bounds_of(study: StudyConfig, stage: StageName, names: Iterable[str]) -> dict[str, float]:
    """The bounds of a stage, SI, of those of the named quantities that have one."""
    stated = {name: study.bound(stage, bound_key(QUANTITIES[name])) for name in names}
    return {name: value * QUANTITIES[name].scale for name, value in stated.items() if value is not None}


def entries_of(
    scenario: Scenario,
    envelopes: Sequence[Envelope],
    listed: Sequence[Envelope],
    precisions: Sequence[Precision],
    flown: Sequence["FlownErrors"] = (),
    seed: SeedSequence | None = None,
) -> list[dict[str, Any]]:
    """One entry for each quantity of each envelope.

    Parameters
    ----------
    scenario : Scenario
        A study.
    envelopes : sequence of Envelope
        By frame, or by distance for flights.
    listed : sequence of Envelope
        At ``study.ranges_m`` with more draws; an envelope without its like here is listed from its own rows.
    precisions : sequence of Precision
        Of vision with no roll error.
    flown : sequence of FlownErrors
        The flights behind the envelopes that are theirs.
    seed : SeedSequence, optional
        Of the intervals over these flights, and needed with them.
    """
    study = study_of(scenario)
    figures = {_like(e): e for e in listed}
    needed = {(p.stage, p.reading, p.quantity): p for p in precisions}
    entries = []
    for envelope in envelopes:
        rows = figures.get(_like(envelope), envelope)
        bounds = bounds_of(study, envelope.stage, envelope.quantities)
        behind = _behind(envelope, flown)
        for name in envelope.quantities:
            precision = None
            if envelope.source == "vision" and envelope.roll_error == 0.0:
                precision = needed.get((envelope.stage, envelope.reading, name))
            entry = _entry(study, envelope, rows, name, bounds.get(name), precision, behind)
            if behind is not None and seed is not None and entry["holds"] is not None:
                entry["holds_from_interval_m"] = _interval(study, envelope, behind, name, bounds[name], seed)
            entries.append(entry)
    return entries


def _behind(envelope: Envelope, flown: Sequence["FlownErrors"]) -> "FlownErrors | None":
    """The flights of which an envelope is made."""
    for one in flown:
        same = (one.stage, one.reading, one.source) == (envelope.stage, envelope.reading, envelope.source)
        if same and np.array_equal(one.distance, envelope.distance):
            return one
    return None


def _interval(
    study: StudyConfig, envelope: Envelope, behind: "FlownErrors", name: str, bound: float, seed: SeedSequence
) -> list[float | None]:
    column, there = envelope.quantities.index(name), _judged(study, envelope, name, behind)
    words = (envelope.stage, envelope.reading, envelope.source)
    place = (*(of.index(word) for of, word in zip(_PLACES, words, strict=True)), column)
    size = behind.size[:, there, column]
    return list(holds_from_interval(_part(envelope, there), size, bound, child(seed, *place)))


def _judged(
    study: StudyConfig, envelope: Envelope, name: str, behind: "FlownErrors | None"
) -> "np.ndarray[Any, np.dtype[np.intp]]":
    """The rows that are judged: from the first that there is, of a filter from where it runs in every flight there.

    Before it the filter has not started; a gap further on is no bound kept.
    """
    first = ~np.isnan(envelope.percentiles[:, envelope.quantities.index(name), 0])
    if envelope.source == "fused":
        reached = envelope.count.max(initial=0) if behind is None else behind.reached
        first &= envelope.count >= reached
    there = np.flatnonzero(first)
    there = np.arange(there[0], envelope.distance.size) if there.size else there
    if envelope.stage == "early":
        there = there[envelope.distance[there] <= study.ranges_m[0] + SAME_PLACE]
    return there


def _entry(
    study: StudyConfig,
    envelope: Envelope,
    rows: Envelope,
    name: str,
    bound: float | None,
    precision: Precision | None,
    behind: "FlownErrors | None",
) -> dict[str, Any]:
    quantity, column = QUANTITIES[name], envelope.quantities.index(name)
    scale = quantity.scale
    there = _judged(study, envelope, name, behind)
    judged = _part(envelope, there)
    table = [_figures(rows, i, column, scale) for i in rows_at(rows, study.ranges_m)]
    first = float(judged.distance[0]) if there.size else None
    entry: dict[str, Any] = {
        "quantity": name,
        "unit": quantity.unit,
        "stage": envelope.stage,
        "reading": envelope.reading,
        "source": envelope.source,
        "of_flights": envelope.source == "fused" or study.method == "flights",
        "roll_error_deg": envelope.roll_error / DEG,
        "bound": None if bound is None else bound / scale,
        "judged_from_m": first,
        "judged_to_m": float(judged.distance[-1]) if there.size else None,
        "judged_count": int(judged.count.min()) if there.size else None,
        "listed": table,
        "first_order_left": _left(table) if _pure(envelope) else None,
        "precision": None if precision is None else _precision(precision, scale),
        "holds": None,
        "holds_from_m": None,
        "holds_from_interval_m": None,
        "holds_from_m_at_68": None,
    }
    if bound is None or first is None or not enough(judged.count.min(), LEVEL):
        return entry
    start = holds_from(judged, name, bound)
    inside = [row["p95"] for row in table if row["range_m"] <= first + SAME_PLACE and row["count"] > 0]
    entry["holds_from_m"], entry["holds_from_m_at_68"] = start, holds_from(judged, name, bound, LEVELS[0])
    entry["holds"] = bool(
        start is not None
        and start >= first - SAME_PLACE
        and all(p95 is not None and p95 <= bound / scale for p95 in inside)
    )
    return entry


def _figures(rows: Envelope, i: int, column: int, scale: float) -> dict[str, Any]:
    """The percentiles at one range, in the shown unit, and over what the first order says they are.

    There is none of a level of which so few errors say nothing.  Those without a limit, for want of solutions, are
    named.
    """
    spread, sigma = rows.percentiles[i, column], float(rows.sigma[i, column])
    count = int(rows.count[i])
    spread = np.where([bool(enough(count, level)) for level in LEVELS], spread, np.nan)
    result: dict[str, Any] = {"range_m": plain(rows.distance[i]), "count": count}
    result["no_limit"] = [key for key, value in zip(KEYS, spread, strict=True) if math.isinf(value)]
    result |= {key: plain(value / scale) for key, value in zip(KEYS, spread, strict=True)}
    result["sigma"] = plain(sigma / scale)
    for key, value, normal in zip(KEYS, spread, NORMAL, strict=True):
        result[f"{key}_over_first_order"] = (
            plain(value / (normal * sigma)) if sigma > 0.0 and rows.roll_error == 0.0 else None
        )
    return result


def _left(table: Sequence[dict[str, Any]]) -> dict[str, list[float]]:
    """The listed ranges at which each percentile is off first order by more than is `allowed`, or has no limit."""
    left: dict[str, list[float]] = {}
    for key, level in zip(KEYS, LEVELS, strict=True):
        ratios = [
            (row["range_m"], math.inf if key in row["no_limit"] else row[f"{key}_over_first_order"], row["count"])
            for row in table
        ]
        left[key] = [
            distance
            for distance, ratio, count in ratios
            if ratio is not None and abs(ratio - 1.0) > allowed(level, count)
        ]
    return left


def allowed(level: float, count: int) -> float:
    """How far a percentile of so many errors may be off first order, relative, before it has left it."""
    return max(LEAVES, CHANCE * float(chance(count, level)))


def _precision(precision: Precision, scale: float) -> dict[str, Any]:
    """What the lines must be, in pixels, and how it was confirmed."""
    result: dict[str, Any] = {"noise_px": precision.noise_px, "spacing_px": precision.spacing_px}
    result |= {
        "points": dict(zip(LINES, precision.points, strict=True)),
        "ends_suffice": precision.ends_suffice,
        "at_range_m": precision.distance,
        "first_order_px": precision.first_order,
        "p95": plain(precision.p95 / scale),
        "within_percent": plain(100.0 * precision.within),
        "within_interval_percent": [plain(100.0 * end) for end in precision.within_interval],
        "draws": precision.draws,
        "checked_at_m": list(precision.checked),
        "confirmed": precision.confirmed,
    }
    return result


def study_of(scenario: Scenario) -> StudyConfig:
    """What a scenario studies.

    Raises
    ------
    ValueError
        If it is not a study.
    """
    if scenario.study is None:
        raise ValueError(f"{scenario.name}: not a study")
    return scenario.study


def _like(envelope: Envelope) -> tuple[object, ...]:
    return envelope.stage, envelope.reading, envelope.source, envelope.roll_error


def _pure(envelope: Envelope) -> bool:
    """Whether the sigma is that of the errors: first order, and no roll error beside it."""
    return envelope.source == "vision" and envelope.roll_error == 0.0


def _part(envelope: Envelope, chosen: np.ndarray[Any, np.dtype[np.intp]]) -> Envelope:
    """Some of an envelope's rows."""
    names = ("distance", "time", "height", "count", "percentiles", "sigma", "single")
    return replace(envelope, **{name: getattr(envelope, name)[chosen] for name in names})


def rows_at(envelope: Envelope, ranges: Sequence[float]) -> list[int]:
    """The rows at the listed ranges that the envelope has."""
    found = []
    for distance in ranges:
        near = np.flatnonzero(np.abs(envelope.distance - distance) <= SAME_PLACE)
        found += near[:1].tolist()
    return found


def plain(value: float) -> float | None:
    """A number as JSON has it: None for NaN and infinities."""
    number = float(value)
    return number if math.isfinite(number) else None
