"""Navigation errors by distance to the threshold: percentile bands of vision and the filter, limits beside them."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from estimator.so3 import Array
from landsim.batch.flights import Flights
from landsim.batch.published import NAVIGATION, NO_CLAIM
from landsim.batch.row import ESTIMATES
from landsim.batch.sections.words import flights_for
from landsim.batch.stats import CONFIDENCE
from landsim.config import load_scenario
from landsim.log import QUANTITIES

LEVELS = {"p50": 50.0, "p68": 68.27, "p95": 95.0, "p99_7": 99.73}
"""Percentiles of the magnitude, %."""
PAPER = (("paper-fig3", "early"), ("paper-fig4", "late"))
"""The shipped scenarios that state the paper's bounds, and the stage that each is about."""
_COLUMN = {"altitude_m": "height_m"}
"""Keys of a bound that are called otherwise in a log."""


_OVER = (
    "Percentiles are over the flights that have an estimate at a distance, and the share of those in the air there that"
    " do stands beside them: where it is low, the percentiles are those of the better frames."
)
_LEFT_OUT = (
    "A percentile is left out where the flights are too few for it, fewer than 1/(1 − p): 95 % takes"
    f" {flights_for(LEVELS['p95'])} with an estimate at the distance, 99.73 % takes {flights_for(LEVELS['p99_7'])}."
)


def envelopes(flights: Flights) -> dict[str, Any]:
    """The section ``envelopes``: at each distance over the flights that are in the air there."""
    distance = flights.distances
    airborne = in_the_air(flights)
    series = []
    for source in ESTIMATES:
        for quantity in QUANTITIES:
            errors = flights.arrays[f"{source}_error_{quantity}"]
            found = bands(errors, airborne)
            if source == "fused":
                found["sigma_rms"] = _root_mean_square(flights.arrays[f"sigma_{quantity}"], airborne)
            series.append({"source": source, "quantity": quantity, "unit": quantity.rsplit("_", 1)[1], **found})
    return {
        "levels": dict(LEVELS),
        "distance_m": distance,
        "in_the_air": airborne.sum(axis=0),
        "series": series,
        "bounds": [
            bound | {"p95": {s: _judged(distance, series, s, bound["quantity"], *_level(bound)) for s in ESTIMATES}}
            for bound in paper_bounds()
        ],
        "limits": [
            {
                "name": limit.name,
                "quantity": limit.quantity,
                "distance_m": [point[0] for point in limit.points],
                "value": [point[1] for point in limit.points],
                "source": f"{limit.source}; {NO_CLAIM}",
                "p95": {
                    s: _judged(distance, series, s, limit.quantity, *map(np.array, zip(*limit.points, strict=True)))
                    for s in ESTIMATES
                },
            }
            for limit in NAVIGATION
        ],
        "text": [_OVER, _LEFT_OUT],
    }


def in_the_air(flights: Flights) -> NDArray[np.bool_]:
    """Which flights have a frame at which distance, before they touch down, (n, m)."""
    time = flights.arrays["time_s"]
    down = flights.numbers("touchdown_time_s")
    return np.asarray(time < np.where(np.isnan(down), np.inf, down)[:, None])


def bands(errors: Array, airborne: NDArray[np.bool_]) -> dict[str, Any]:
    """Percentiles of the magnitude at `LEVELS`, an interval of the 95th, and over how many flights.

    Parameters
    ----------
    errors : (n, m) array
        NaN where there is no estimate.
    airborne : (n, m) bool array
        Which count.

    Returns
    -------
    dict
        ``p50`` ... ``p99_7``, ``p95_low`` and ``p95_high`` (distribution-free order statistics), (m,) each, NaN where
        there are too few; ``count``, those with an estimate; ``share``, of those in the air.
    """
    size = np.sort(np.abs(np.where(airborne, errors, np.nan)), axis=0)  # NaN last
    count = np.isfinite(size).sum(axis=0)
    reached = airborne.sum(axis=0)
    found: dict[str, Any] = {}
    for key, level in LEVELS.items():
        place = level / 100.0 * np.maximum(count - 1, 0)
        low = np.floor(place)
        values = _at(size, low) + (place - low) * (_at(size, np.ceil(place)) - _at(size, low))
        found[key] = np.where(count * (1.0 - level / 100.0) >= 1.0 - 1e-9, values, np.nan)
    tail = 0.5 * (1.0 - CONFIDENCE)
    r, s = stats.binom.ppf(tail, count, 0.95), stats.binom.isf(tail, count, 0.95) + 1
    found["p95_low"] = np.where((count > 0) & (r >= 1), _at(size, r - 1), np.nan)
    found["p95_high"] = np.where((count > 0) & (s <= count), _at(size, s - 1), np.nan)
    found["count"] = count
    found["share"] = np.divide(count, reached, out=np.full(count.shape, np.nan), where=reached > 0)
    return found


@cache
def _paper_bounds() -> tuple[tuple[str, str, float, float, float, str], ...]:
    found = []
    for name, stage in PAPER:
        study = load_scenario(name).study
        if study is None:  # the shipped files say otherwise
            continue
        for key in type(study.bounds).model_fields:
            value = study.bound(stage, key)  # type: ignore[arg-type]
            if value is not None:
                found.append((_COLUMN.get(key, key), stage, value, study.ranges_m[0], study.ranges_m[-1], name))
    return tuple(found)


def paper_bounds() -> list[dict[str, Any]]:
    """What the paper says its errors stay below, from the scenarios that restate it."""
    return [
        {
            "quantity": quantity,
            "stage": stage,
            "value": value,
            "from_m": first,
            "to_m": last,
            "source": f"F. Li, D. Tang, N. Shen, Procedia Engineering 15 (2011) 578-584, as in {name}",
        }
        for quantity, stage, value, first, last, name in _paper_bounds()
    ]


def _level(bound: dict[str, Any]) -> tuple[Array, Array]:
    """Distances and values of a bound that is the same all along."""
    return np.array((bound["from_m"], bound["to_m"])), np.full(2, bound["value"])


def _judged(
    distance: Array, series: list[dict[str, Any]], source: str, quantity: str, where: Array, limit: Array
) -> dict[str, Any]:
    """Whether the 95th percentile keeps to a limit, where the flights are enough to have one.

    Parameters
    ----------
    distance : (m,) array
        Falling.
    series : list of dict
        Of the section.
    source, quantity : str
    where, limit : (k,) array
        Distances, falling, and the limit at each; straight lines between them.

    Returns
    -------
    dict
        ``state``: ``kept`` at every distance that has a percentile, ``broken`` at one or more, ``too few`` flights for
        a percentile at any, or ``none`` where there is no estimate; ``first_m`` and ``last_m``, how far those
        distances reach; ``within_from_m``, from which of them on it is kept to the last, None if it is not.
    """
    (of,) = (s for s in series if s["source"] == source and s["quantity"] == quantity)
    over = (distance <= where[0]) & (distance >= where[-1])
    judged = over & np.isfinite(of["p95"])
    if not judged.any():
        state = "too few" if np.any(of["count"][over]) else "none"
        return {"state": state, "first_m": None, "last_m": None, "within_from_m": None}
    at = distance[judged]
    kept = of["p95"][judged] <= np.interp(-at, -where, limit)
    rest = int(np.flatnonzero(~kept)[-1]) + 1 if not kept.all() else 0
    return {
        "state": "kept" if kept.all() else "broken",
        "first_m": float(at[0]),
        "last_m": float(at[-1]),
        "within_from_m": float(at[rest]) if rest < at.size else None,
    }


def _at(ordered: Array, rows: Array) -> Array:
    """A row of each column, (m,); rows beyond the ends are the ends."""
    if not ordered.shape[0]:
        return np.full(ordered.shape[1], np.nan)
    inside = np.clip(np.nan_to_num(rows), 0, ordered.shape[0] - 1).astype(int)
    return np.asarray(np.take_along_axis(ordered, inside[None], axis=0)[0])


def _root_mean_square(values: Array, airborne: NDArray[np.bool_]) -> Array:
    known = airborne & np.isfinite(values)
    total = np.where(known, values, 0.0)
    number = known.sum(axis=0)
    square = np.divide((total * total).sum(axis=0), number, out=np.full(number.shape, np.nan), where=number > 0)
    return np.asarray(np.sqrt(square))
