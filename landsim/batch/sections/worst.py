"""The flights nearest to a limit of the box, or beyond it."""

from typing import Any

import numpy as np

from estimator.so3 import Array
from landsim.batch.flights import Flights
from landsim.batch.measures import box_of
from landsim.batch.row import TOUCHDOWN
from landsim.batch.sections.sensitivity import inputs_of
from landsim.config import Scenario

MOST = 10
RULE = (
    "flights that did not land first, those without a touchdown before the others; then by the largest share of a limit"
    " of the box that was used: 1 is at the limit, more is beyond it; those that went around last"
)
HINTS = 3
"""Draws that are named for a flight."""


def worst(scenario: Scenario, flights: Flights) -> dict[str, Any]:
    """The section ``worst``: what did not land first, then those that used most of a limit, and go-arounds last."""
    group = flights.are("outcome", "landed") + 2 * flights.are("outcome", "go_around").astype(int)
    box = box_of(scenario)
    used = np.stack([limit.used(flights.numbers(limit.measure.key)) for limit in box], axis=1)
    known = np.asarray(np.isfinite(used).any(axis=1))
    score = np.where(known, np.max(np.where(np.isfinite(used), used, -np.inf), axis=1, initial=-np.inf), np.inf)
    # stable: of equal ones the lower index comes first; a flight without a touchdown has no score, and is the worst
    order = np.lexsort((np.arange(flights.n), -score, group))[:MOST]
    inputs = inputs_of(flights)
    found = []
    for rank, i in enumerate(order.tolist(), 1):
        limit = box[int(np.nanargmax(used[i]))] if known[i] else None
        index = flights.columns["index"][i]
        found.append(
            {
                "rank": rank,
                "index": index,
                "seed": flights.columns["seed"][i],
                "outcome": flights.columns["outcome"][i],
                "in_box": bool(flights.columns["in_box"][i]),
                "reason": flights.columns["reason"][i],
                "score": float(score[i]) if known[i] else None,
                "limit": None
                if limit is None
                else {
                    "key": limit.key,
                    "title": limit.measure.symbol,
                    "unit": limit.measure.unit,
                    "value": flights.columns[limit.measure.key][i],
                    "limit": limit.limit,
                },
                "touchdown": {name: flights.columns[name][i] for name in TOUCHDOWN}
                if np.isfinite(flights.numbers("x_m")[i])
                else None,
                "draws": _unusual(inputs, i),
                "command": None if index is None else f"landsim replay DIR {index}",
            }
        )
    return {
        "rule": RULE,
        "flights": found,
    }


def _unusual(inputs: dict[str, Array], row: int) -> list[dict[str, Any]]:
    """The draws of a flight that are farthest from their median, in spreads; a hint at the cause, and no more."""
    found: list[tuple[float, str, dict[str, Any]]] = []
    for key, values in inputs.items():
        known, value = values[np.isfinite(values)], float(values[row])
        median = float(np.median(known))
        if np.isfinite(value):
            off = (value - median) / float(np.std(known))
            share = float(np.mean(known < value))
            hint = {"key": key, "value": value, "median": median, "spreads_off": off, "share_below": share}
            found.append((-abs(off), key, hint))
    return [hint for _, _, hint in sorted(found, key=lambda one: one[:2])[:HINTS]]
