"""How well the flights landed: each number's quantiles, histogram, and exceedance towards its limits."""

from typing import Any

import numpy as np

from estimator.so3 import Array
from landsim.batch.flights import Flights
from landsim.batch.measures import MEASURES, BoxLimit, Measure, Side, box_of
from landsim.batch.stats import exceedance, quantile_interval, rate
from landsim.config import Scenario

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
BINS = 100
"""Most bins of a histogram."""


def distributions(scenario: Scenario, flights: Flights) -> list[dict[str, Any]]:
    """The section ``distributions``: an entry for each of `MEASURES` that at least one flight has."""
    box = box_of(scenario)
    found = []
    for measure in MEASURES:
        values = flights.numbers(measure.key)
        values = np.sort(values[np.isfinite(values)])
        if values.size:
            found.append(_distribution(measure, values, [limit for limit in box if limit.measure == measure]))
    return found


def quantiles_of(ordered: Array, levels: tuple[float, ...] = QUANTILES) -> list[dict[str, Any]]:
    """``p``, ``value``, ``low`` and ``high`` of quantiles of a rising sample."""
    return [
        {"p": p, "value": float(np.quantile(ordered, p)), **quantile_interval(ordered, p)._asdict()} for p in levels
    ]


def histogram(values: Array, bins: int = BINS) -> dict[str, Any]:
    """``edges`` and ``counts``, with bins by Freedman and Diaconis or Sturges, whichever are more."""
    edges = np.histogram_bin_edges(values, bins="auto") if np.ptp(values) > 0.0 else np.array((-0.5, 0.5)) + values[0]
    if edges.size > bins + 1:
        edges = np.linspace(edges[0], edges[-1], bins + 1)
    counts, edges = np.histogram(values, bins=edges)
    return {"edges": edges, "counts": counts}


def _distribution(measure: Measure, ordered: Array, limits: list[BoxLimit]) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "key": measure.key,
        "title": measure.title,
        "unit": measure.unit,
        "of": f"flights with a {measure.of}",
        "n": int(ordered.size),
        "mean": float(ordered.mean()),
        "std": float(ordered.std(ddof=1)) if ordered.size > 1 else None,
        "min": float(ordered[0]),
        "max": float(ordered[-1]),
        "quantiles": quantiles_of(ordered),
        "magnitude_quantiles": quantiles_of(np.sort(np.abs(ordered))) if measure.magnitude else None,
        "histogram": histogram(ordered),
        "limits": [
            {
                "key": limit.key,
                "value": limit.limit,
                "side": limit.side,
                "magnitude": measure.magnitude,
                "source": "the scenario's box",
                "missed": rate(int(limit.missed(ordered).sum()), int(ordered.size)),
            }
            for limit in limits
        ],
    }
    sides: list[Side] = ["above"]
    if any(limit.side == "below" for limit in limits):
        sides.append("below")
    entry["exceedance"] = [_curve(measure, ordered, side, limits) for side in sides]
    return entry


def _curve(measure: Measure, ordered: Array, side: Side, limits: list[BoxLimit]) -> dict[str, Any]:
    """Share of the flights at x or beyond, x moving towards the limit of this side, if there is one."""
    size = np.sort(np.abs(ordered)) if measure.magnitude else ordered
    curve = exceedance(size if side == "above" else np.sort(-size))
    return {
        "side": side,
        "magnitude": measure.magnitude,
        "label": f"{measure.symbol} at x or {side}",
        "limit": next((limit.limit for limit in limits if limit.side == side), None),
        "x": curve.x if side == "above" else -curve.x,
        "share": curve.share,
        "low": curve.low,
        "high": curve.high,
    }
