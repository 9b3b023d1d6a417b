"""How often a landing succeeds, how often it ends how, and what so many flights can and cannot show."""

from typing import Any

import numpy as np

from landsim.batch.flights import Flights
from landsim.batch.measures import box_of
from landsim.batch.sections.words import number, several
from landsim.batch.stats import CONFIDENCE, flights_needed, rate, upper_bound
from landsim.config import Scenario

OUTCOMES = ("landed", "crashed", "off_runway", "go_around", "diverged", "timeout", "trim_failed", "error")
SHOWN = (1e-3, 1e-6)
"""Failure rates for which the number of flights is said."""


def rates(scenario: Scenario, flights: Flights, sampling: str) -> dict[str, Any]:
    """The section ``rates``; ``sampling`` is that of the dispersions."""
    n = flights.n
    in_box = flights.flags("in_box")
    landed = flights.are("outcome", "landed")
    others = sorted({str(o) for o in flights.columns["outcome"]} - set(OUTCOMES))
    success = rate(int(in_box.sum()), n)
    gone_around = rate(int(flights.are("outcome", "go_around").sum()), n)
    result: dict[str, Any] = {
        "confidence": CONFIDENCE,
        "interval": "Clopper-Pearson, two-sided",
        "success": success,
        "landed": rate(int(landed.sum()), n),
        "gone_around": gone_around,
        "outcomes": [
            {"outcome": outcome, **rate(int(flights.are("outcome", outcome).sum()), n)}
            for outcome in (*OUTCOMES, *others)
        ],
        "limits": [],
        "can_show": can_show(n - success["count"] - gone_around["count"], n),
    }
    for limit in box_of(scenario):
        values = flights.numbers(limit.measure.key)
        known = np.isfinite(values)
        result["limits"].append(
            {
                "key": limit.key,
                "title": limit.measure.symbol,
                "unit": limit.measure.unit,
                "limit": limit.limit,
                "side": limit.side,
                "of": f"flights with a {limit.measure.of}",
                **rate(int(limit.missed(values).sum()), int(known.sum())),
            }
        )
    result["text"] = _text(result, n, sampling)
    return result


def can_show(failures: int, n: int) -> dict[str, Any]:
    """What so many flights with so many failures bound, and what they would have seen; every bound one-sided, exact.

    A landing that was given up is no failure.
    """
    return {
        "n": n,
        "failures": failures,
        "failure_rate_below": upper_bound(failures, n),
        "no_failure_would_show_below": upper_bound(0, n),
        "seen_at_least_once_from": upper_bound(0, n),
        "needed_without_failure": [{"failure_rate": p, "n": flights_needed(p)} for p in SHOWN],
    }


def _text(found: dict[str, Any], n: int, sampling: str) -> list[str]:
    if n == 0:
        return ["No flight was flown: nothing is shown."]
    success, shown, percent = found["success"], found["can_show"], f"{100.0 * CONFIDENCE:g} %"
    failures = several(shown["failures"], "failure")
    needed = " and ".join(
        f"{p['n']:,} flights for {number(p['failure_rate'])}" for p in shown["needed_without_failure"]
    )
    rate_text = (
        f"{success['count']} of {n} flights landed in the box: a success rate of"
        f" {number(100.0 * success['rate'], 4)} %, between {number(100.0 * success['low'], 4)} % and"
        f" {number(100.0 * success['high'], 4)} % with {percent} confidence."
    )
    bound_text = (
        f"With {failures} in {n} flights the rate of failure is below {number(shown['failure_rate_below'])} with"
        f" {percent} confidence; no claim below that is supported."
    )
    seen_text = (
        f"A failure that happens in {number(shown['seen_at_least_once_from'])} of all flights or more would have been"
        f" seen at least once with {percent} confidence; a rarer one may be there unseen."
    )
    needed_text = f"Without a single failure it takes {needed} to show that the rate of failure is below it."
    text = [rate_text, bound_text, seen_text, needed_text]
    around = found["gone_around"]
    if around["count"]:
        text.insert(
            1,
            f"{around['count']} of {n} went around, {number(100.0 * around['rate'], 4)} %, between"
            f" {number(100.0 * around['low'], 4)} % and {number(100.0 * around['high'], 4)} %: neither a landing nor a"
            " failure.",
        )
    if sampling != "random":
        text.append(
            f"The draws are by {sampling}, and so not independent of each other: the intervals, which are for"
            " independent flights, are approximate."
        )
    return text
