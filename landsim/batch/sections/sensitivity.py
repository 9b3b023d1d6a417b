"""Which draws matter: rank correlation of each with each result."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from estimator.so3 import Array
from landsim.batch.flights import Flights
from landsim.batch.row import DRAW, START
from landsim.batch.stats import SIGNIFICANT, Rank, adjusted, rank_correlation


class Result(NamedTuple):
    """A number of a flight that draws may matter to."""

    key: str
    title: str
    unit: str
    column: str
    take: Callable[[Array], Array] = np.asarray


RESULTS: tuple[Result, ...] = (
    Result("in_box", "landed in the box", "", "in_box"),
    Result("x_m", "longitudinal touchdown", "m", "x_m"),
    Result("y_m", "lateral touchdown", "m", "y_m"),
    Result("abs_y_m", "|lateral touchdown|", "m", "y_m", np.abs),
    Result("sink_rate_mps", "sink rate", "m/s", "sink_rate_mps"),
    Result("bank_deg", "bank", "deg", "bank_deg"),
    Result("abs_bank_deg", "|bank|", "deg", "bank_deg", np.abs),
    Result("ground_speed_mps", "ground speed", "m/s", "ground_speed_mps"),
    Result("pitch_deg", "pitch", "deg", "pitch_deg"),
    Result("heading_error_deg", "heading error", "deg", "heading_error_deg"),
    Result("stop_y_m", "lateral position at the stop", "m", "stop_y_m"),
    Result("glide_slope_to_flare_p95_m", "glide slope, 95 %", "m", "glide_slope_to_flare_p95_m"),
    Result("localizer_p95_m", "centreline, 95 %", "m", "localizer_p95_m"),
    Result("fused_along_rms_m", "fused along, rms", "m", "fused_along_rms_m"),
    Result("fused_cross_rms_m", "fused cross, rms", "m", "fused_cross_rms_m"),
    Result("fused_height_rms_m", "fused height, rms", "m", "fused_height_rms_m"),
    Result("vision_cross_rms_m", "vision cross, rms", "m", "vision_cross_rms_m"),
    Result("vision_height_rms_m", "vision height, rms", "m", "vision_height_rms_m"),
)
NAMED = 3
"""Draws that the text names for a result."""
FEW = 4
"""Fewer flights than this rank nothing."""


def inputs_of(flights: Flights) -> dict[str, Array]:
    """What varies from flight to flight before it begins, by key: the draws, then the start as drawn by the seed.

    A part of the start that a dispersion draws is that dispersion, and stands there once.
    """
    seeded = [f"start_{name}" for name in START if f"start.{name}" not in flights.draws]
    columns = [*(f"{DRAW}{key}" for key in flights.draws), *seeded]
    found = {name.removeprefix(DRAW): flights.numbers(name) for name in columns}
    return {key: values for key, values in found.items() if _varies(values)}


def sensitivity(flights: Flights) -> dict[str, Any]:
    """The section ``sensitivity``.

    A draw may matter by its value (a headwind carries the touchdown short), or by its distance from the median (the
    farther off to either side, the worse): both are ranked against every result, and p is adjusted for all of them.
    """
    inputs = inputs_of(flights)
    results = {result.key: result.take(flights.numbers(result.column)) for result in RESULTS}
    kept = [result for result in RESULTS if _varies(results[result.key])]
    pairs = []
    for key, values in inputs.items():
        spread = np.abs(values - np.nanmedian(values))
        for result in kept:
            of = results[result.key]
            pairs.append((key, result.key, rank_correlation(values, of), rank_correlation(spread, of)))
    both = [rank for pair in pairs for rank in pair[2:]]
    p = adjusted([np.nan if rank.p is None else rank.p for rank in both])
    tests = int(np.isfinite(p).sum())
    entries = [
        {
            "input": key,
            "result": result,
            "n": by_value.n,
            **_entry(by_value, p[2 * i]),
            "spread": _entry(by_spread, p[2 * i + 1]),
        }
        for i, (key, result, by_value, by_spread) in enumerate(pairs)
    ]
    return {
        "inputs": [{"key": key, "drawn_by": "dispersion" if key in flights.draws else "seed"} for key in inputs],
        "results": [{"key": result.key, "title": result.title, "unit": result.unit} for result in kept],
        "pairs": entries,
        "tests": tests,
        "method": "Spearman's rank correlation; p adjusted for all pairs by Benjamini and Hochberg",
        "significant_below": SIGNIFICANT,
        "text": _text(entries, kept, tests, flights.n),
    }


def _varies(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size >= FEW and np.ptp(known) > 0.0)


def _entry(rank: Rank, p_adjusted: float) -> dict[str, Any]:
    known = rank.p is not None
    return {
        "rho": rank.rho,
        "p": rank.p,
        "p_adjusted": float(p_adjusted) if known else None,
        "significant": bool(p_adjusted < SIGNIFICANT) if known else None,
    }


def _text(entries: list[dict[str, Any]], results: list[Result], tests: int, n: int) -> list[str]:
    if not entries:
        return [f"{n} flights: nothing varied, or too few flights to rank."]
    tested = (
        f"{tests} correlations were tested; at most {100.0 * SIGNIFICANT:g} % of those called significant are expected"
        " to be chance. A rank correlation sees a trend, not a cause: draws that are correlated with each other share"
        " it."
    )
    text = [tested]
    for result in results:
        of = [e for e in entries if e["result"] == result.key]
        found = [(e["rho"], e["input"]) for e in of if e["significant"]]
        found += [
            (e["spread"]["rho"], f"the distance of {e['input']} from its median")
            for e in of
            if e["spread"]["significant"]
        ]
        found.sort(key=lambda one: -abs(one[0]))
        named = ", ".join(f"{what} ({rho:+.2f})".replace("(-", "(−") for rho, what in found[:NAMED])
        text.append(f"{result.title}: {named or 'no draw matters significantly'}.")
    return text
