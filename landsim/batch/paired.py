"""Differences between two batches over the seeds that they share: rates and means, with intervals and tests."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import stats

from estimator.so3 import Array
from landsim.batch.stats import CONFIDENCE, NOTHING, Interval, walsh_interval, walsh_median, walsh_p

RESAMPLES = 1999
"""Of a bootstrap."""
_AT_ONCE = 10_000_000
"""Numbers that a bootstrap holds in memory."""


class Table(NamedTuple):
    """What became of the same seeds in two batches: counts."""

    both: int
    first: int
    """In the first batch alone."""
    second: int
    """In the second alone."""
    neither: int


def table_of(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> Table:
    """Counts of two columns (n,) of the same seeds."""
    return Table(
        int(np.sum(first & second)),
        int(np.sum(first & ~second)),
        int(np.sum(~first & second)),
        int(np.sum(~first & ~second)),
    )


def mcnemar(table: Table) -> float | None:
    """McNemar's exact p: whether those that differ do so to either side alike, by the binomial with 1/2.

    None if none differs.
    """
    differ = table.first + table.second
    return float(stats.binomtest(table.second, differ).pvalue) if differ else None


def rate_difference(table: Table) -> dict[str, float | None]:
    """``difference`` of the second rate less the first, ``low`` and ``high``; None of no flights.

    The interval is Newcombe's by squaring and adding: Wilson's intervals of either rate, put together with the
    correlation φ of the pairs, which is corrected where it is positive (R. Newcombe, Statistics in Medicine 17 (1998)
    2635, method 10).
    """
    both, first, second, neither = table
    n = sum(table)
    if n == 0:
        return {"difference": None, "low": None, "high": None}
    p1, p2 = (both + first) / n, (both + second) / n
    (l1, u1), (l2, u2) = (_wilson(k, n) for k in (both + first, both + second))
    product = (both + first) * (second + neither) * (both + second) * (first + neither)
    excess = float(both * neither - first * second)
    if excess > 0.0:
        excess = max(excess - 0.5 * n, 0.0)
    phi = excess / math.sqrt(product) if product else 0.0
    down = math.sqrt(max((p2 - l2) ** 2 - 2.0 * phi * (p2 - l2) * (u1 - p1) + (u1 - p1) ** 2, 0.0))
    up = math.sqrt(max((p1 - l1) ** 2 - 2.0 * phi * (p1 - l1) * (u2 - p2) + (u2 - p2) ** 2, 0.0))
    return {"difference": p2 - p1, "low": p2 - p1 - down, "high": p2 - p1 + up}


def paired_differences(first: Array, second: Array, rng: Generator) -> dict[str, Any]:
    """The second batch's numbers less the first's, of the same seeds.

    Parameters
    ----------
    first, second : (n,) array
        NaN where a flight has no such number; only pairs that both have count.
    rng : numpy.random.Generator
        Of the bootstrap.

    Returns
    -------
    dict
        ``n`` pairs; ``mean`` with a bootstrap interval over pairs; ``shift``, Hodges and Lehmann's estimate, with the
        interval that Wilcoxon's signed ranks do not refuse; ``wilcoxon_p`` of the same ranks, None if every
        difference is zero: below 1 - `CONFIDENCE` just where the interval leaves zero out.
    """
    there = np.isfinite(first) & np.isfinite(second)
    difference = np.sort(second[there] - first[there])
    n = int(difference.size)
    if n == 0:
        nothing = {"value": None, "low": None, "high": None}
        return {"n": 0, "mean": dict(nothing), "shift": dict(nothing), "wilcoxon_p": None}
    return {
        "n": n,
        "mean": {"value": float(difference.mean()), **_bootstrap_mean(difference, rng)._asdict()},
        "shift": {"value": walsh_median(difference), **walsh_interval(difference)._asdict()},
        "wilcoxon_p": walsh_p(difference) if difference.any() else None,
    }


def _bootstrap_mean(values: Array, rng: Generator) -> Interval:
    if values.size < 2:
        return NOTHING
    if np.ptp(values) == 0.0:
        return Interval(float(values[0]), float(values[0]))
    found = stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=RESAMPLES,
        batch=max(_AT_ONCE // values.size, 1),
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=rng,
    ).confidence_interval
    return Interval(float(found.low), float(found.high))


def _wilson(successes: int, n: int) -> tuple[float, float]:
    found = stats.binomtest(successes, n).proportion_ci(CONFIDENCE, "wilson")
    return float(found.low), float(found.high)
