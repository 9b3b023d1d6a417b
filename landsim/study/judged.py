"""Envelopes against bounds: percentiles at the listed ranges, and from where on each bound holds.

Every figure is in the unit that its key or the entry's ``unit`` says.  Nothing is rounded, and nothing is adjusted.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from landsim.config import Scenario, StudyConfig
from landsim.study.model import LEVELS, QUANTITIES, Envelope, Quantity, StageName
from landsim.study.precision import Precision, holds_from
from landsim.units import DEG

KEYS = ("p68", "p95", "p99_7")
"""Of the percentiles at ``LEVELS``."""
NORMAL = (1.0000217133229992, 1.959963984540054, 2.9999769927034015)
"""The same percentiles of a standard normal's magnitude: Φ⁻¹((1 + p)/2)."""
LEAVES = 0.05
"""Relative difference at which a percentile has left the first order, if it is not by chance."""
CHANCE = 3.0
"""So many standard errors of a sampled percentile pass for chance."""
SAME_PLACE = 1e-6
"""Distances that differ by less are one, m."""
LINES = ("left", "threshold", "right")


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
    """
    study = study_of(scenario)
    figures = {_like(e): e for e in listed}
    needed = {(p.stage, p.reading, p.quantity): p for p in precisions}
    entries = []
    for envelope in envelopes:
        rows = figures.get(_like(envelope), envelope)
        bounds = bounds_of(study, envelope.stage, envelope.quantities)
        for name in envelope.quantities:
            precision = None
            if envelope.source == "vision" and envelope.roll_error == 0.0:
                precision = needed.get((envelope.stage, envelope.reading, name))
            entries.append(_entry(study, envelope, rows, name, bounds.get(name), precision))
    return entries


def _entry(
    study: StudyConfig,
    envelope: Envelope,
    rows: Envelope,
    name: str,
    bound: float | None,
    precision: Precision | None,
) -> dict[str, Any]:
    quantity, column = QUANTITIES[name], envelope.quantities.index(name)
    scale = quantity.scale
    # from the first that there is: before it the filter has not started; a gap further on is no bound kept
    there = np.flatnonzero(~np.isnan(envelope.percentiles[:, column, 0]))
    there = np.arange(there[0], envelope.distance.size) if there.size else there
    if envelope.stage == "early":
        there = there[envelope.distance[there] <= study.ranges_m[0] + SAME_PLACE]
    judged = _part(envelope, there)
    table = [_figures(rows, i, column, scale) for i in rows_at(rows, study.ranges_m)]
    first = float(judged.distance[0]) if there.size else None
    entry: dict[str, Any] = {
        "quantity": name,
        "unit": quantity.unit,
        "stage": envelope.stage,
        "reading": envelope.reading,
        "source": envelope.source,
        "roll_error_deg": envelope.roll_error / DEG,
        "bound": None if bound is None else bound / scale,
        "judged_from_m": first,
        "judged_to_m": float(judged.distance[-1]) if there.size else None,
        "listed": table,
        "first_order_left": _left(table) if _pure(envelope) else None,
        "precision": None if precision is None else _precision(precision, scale),
        "holds": None,
        "holds_from_m": None,
        "holds_from_m_at_68": None,
    }
    if bound is None or first is None:
        return entry
    start = holds_from(judged, name, bound)
    at_68 = holds_from(replace(judged, percentiles=judged.percentiles[..., [0, 0, 2]]), name, bound)
    inside = [row["p95"] for row in table if row["range_m"] <= first + SAME_PLACE and row["count"] > 0]
    entry["holds_from_m"], entry["holds_from_m_at_68"] = start, at_68
    entry["holds"] = bool(
        start is not None
        and start >= first - SAME_PLACE
        and all(p95 is not None and p95 <= bound / scale for p95 in inside)
    )
    return entry


def _figures(rows: Envelope, i: int, column: int, scale: float) -> dict[str, Any]:
    """The percentiles at one range, in the shown unit, and over what the first order says they are."""
    spread, sigma = rows.percentiles[i, column], float(rows.sigma[i, column])
    result: dict[str, Any] = {"range_m": plain(rows.distance[i]), "count": int(rows.count[i])}
    result |= {key: plain(value / scale) for key, value in zip(KEYS, spread, strict=True)}
    result["sigma"] = plain(sigma / scale)
    for key, value, normal in zip(KEYS, spread, NORMAL, strict=True):
        result[f"{key}_over_first_order"] = (
            plain(value / (normal * sigma)) if sigma > 0.0 and rows.roll_error == 0.0 else None
        )
    return result


def _left(table: Sequence[Mapping[str, Any]]) -> dict[str, list[float]]:
    """The listed ranges at which each percentile is off first order, see `LEAVES` and `CHANCE`."""
    left: dict[str, list[float]] = {}
    for key, level, normal in zip(KEYS, LEVELS, NORMAL, strict=True):
        ratios = [(row["range_m"], row[f"{key}_over_first_order"], row["count"]) for row in table]
        left[key] = [
            distance
            for distance, ratio, count in ratios
            if ratio is not None and abs(ratio - 1.0) > max(LEAVES, CHANCE * _chance(level, normal, count))
        ]
    return left


def _chance(level: float, normal: float, count: int) -> float:
    """Relative standard error √(p (1 - p)/n) / (2 φ(z) z) of the percentile p of n normal errors' magnitudes."""
    p, density = level / 100.0, 2.0 * math.exp(-0.5 * normal * normal) / math.sqrt(2.0 * math.pi)
    return math.sqrt(p * (1.0 - p) / count) / (density * normal)


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
