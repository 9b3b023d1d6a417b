"""What a sample shows and how surely: rates, quantiles, means, exceedance and rank correlation, with their intervals.

Everything here is a pure function of numbers.  An interval is two-sided with `CONFIDENCE` unless it says otherwise;
what a sample is too small or too uniform to show is None, and never NaN.  The distributions are scipy's.
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special, stats

from estimator.so3 import Array

CONFIDENCE = 0.95
"""Of every interval."""
SIGNIFICANT = 0.05
"""An adjusted p below it is called significant."""
EXACT = 150
"""Of as many pairs the signed ranks are counted out."""


class Interval(NamedTuple):
    """Of confidence; either end may be None, where the sample bounds nothing."""

    low: float | None
    high: float | None


NOTHING = Interval(None, None)


def clopper_pearson(
    successes: ArrayLike, n: ArrayLike, confidence: float = CONFIDENCE
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Exact interval of a binomial rate: the rates for which the count is not in a tail of (1 - confidence)/2.

    The ends are quantiles of beta distributions, B(α/2; k, n - k + 1) and B(1 - α/2; k + 1, n - k); C. Clopper and
    E. Pearson, Biometrika 26 (1934) 404.

    Parameters
    ----------
    successes, n : array_like
        Counts, broadcast; 0 <= successes <= n.
    confidence : float
        Between 0 and 1.

    Returns
    -------
    low, high : arrays
        0 and 1 where n is 0.
    """
    k, total = np.broadcast_arrays(np.asarray(successes, dtype=float), np.asarray(n, dtype=float))
    tail = 0.5 * (1.0 - confidence)
    low = special.betaincinv(np.maximum(k, 1.0), total - k + 1.0, tail)
    high = special.betaincinv(k + 1.0, np.maximum(total - k, 1.0), 1.0 - tail)
    return np.where(k > 0, low, 0.0), np.where(k < total, high, 1.0)


def rate(successes: int, n: int) -> dict[str, Any]:
    """A rate with its interval: ``count``, ``n``, ``rate``, ``low``, ``high``; the last three None where n is 0."""
    if n == 0:
        return {"count": 0, "n": 0, "rate": None, "low": None, "high": None}
    low, high = clopper_pearson(successes, n)
    return {"count": int(successes), "n": int(n), "rate": successes / n, "low": float(low), "high": float(high)}


def upper_bound(failures: int, n: int, confidence: float = CONFIDENCE) -> float | None:
    """The rate that is exceeded with no more than 1 - confidence: one-sided, exact; None where n is 0.

    Without a failure it is 1 - (1 - confidence)^(1/n), which the rule of three, 3/n at 95 %, stands for.
    """
    if n == 0:
        return None
    return 1.0 if failures == n else float(special.betaincinv(failures + 1.0, n - failures, confidence))


def flights_needed(rate_to_show: float, confidence: float = CONFIDENCE) -> int:
    """How many flights without a failure show a failure rate to be below this: the least n with (1 - p)^n <= 1 - c."""
    return math.ceil(math.log1p(-confidence) / math.log1p(-rate_to_show))


def quantile_interval(ordered: Array, p: float) -> Interval:
    """Distribution-free interval of a quantile from order statistics.

    The number of n observations below the quantile p is binomial, so that x_(r) and x_(s), with r and s from its
    quantiles at the tails of (1 - `CONFIDENCE`)/2, enclose it with at least the confidence, whatever the distribution;
    H. David and H. Nagaraja, Order Statistics, 3rd ed., 7.1.  An end is None if the sample does not reach so far: the
    99th percentile of 50 flights has no upper bound.

    Parameters
    ----------
    ordered : (n,) array
        Rising, finite.
    p : float
        Between 0 and 1.
    """
    n, tail = ordered.size, 0.5 * (1.0 - CONFIDENCE)
    if n == 0:
        return NOTHING
    # with B the number below it, x_(r) is above the quantile with P(B < r), and x_(s) is below it with P(B >= s)
    r, s = int(stats.binom.ppf(tail, n, p)), int(stats.binom.isf(tail, n, p)) + 1
    return Interval(float(ordered[r - 1]) if r >= 1 else None, float(ordered[s - 1]) if s <= n else None)


def mean_interval(values: Array) -> Interval:
    """Student's interval of a mean; of fewer than two values None."""
    if values.size < 2:
        return NOTHING
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, values.size - 1) * np.std(values, ddof=1) / math.sqrt(values.size))
    mean = float(np.mean(values))
    return Interval(mean - half, mean + half)


def ratio_interval(counts: Array, of: Array) -> Interval:
    """Interval of a share whose parts come in groups that are not independent: Σ counts / Σ of.

    Student's over the groups (n,), with the variance of a ratio by its linearisation: the residuals counts - share · of
    over the mean of ``of``; W. Cochran, Sampling Techniques, 3rd ed., 2.11.  Within 0 and 1; of fewer than two groups
    None.

    Parameters
    ----------
    counts, of : (n,) array
        0 <= counts <= of, and something in ``of``.
    """
    n = counts.size
    if n < 2:
        return NOTHING
    share = float(counts.sum() / of.sum())
    residuals = (counts - share * of) / np.mean(of)
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, n - 1) * math.sqrt(np.sum(residuals**2) / (n - 1) / n))
    return Interval(max(share - half, 0.0), min(share + half, 1.0))


def chi_square_bounds(dof: int, n: int) -> Interval:
    """Within which the mean of n independent χ² numbers of so many degrees of freedom is with `CONFIDENCE`."""
    if n == 0:
        return NOTHING
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = stats.chi2.ppf((tail, 1.0 - tail), dof * n) / n
    return Interval(float(low), float(high))


def walsh_median(ordered: Array) -> float:
    """Hodges and Lehmann's estimate of where a sample is centred: the median of the means of all its pairs.

    Each number pairs with itself too, which makes n (n + 1)/2 means: Walsh's averages; M. Hollander and D. Wolfe,
    Nonparametric Statistical Methods, 2nd ed., 3.2.

    Parameters
    ----------
    ordered : (n,) array
        Rising, finite; n >= 1.
    """
    count = ordered.size * (ordered.size + 1) // 2
    return 0.5 * (_walsh_average(ordered, (count + 1) // 2) + _walsh_average(ordered, count // 2 + 1))


def walsh_interval(ordered: Array) -> Interval:
    """The centres that Wilcoxon's signed ranks do not refuse with `CONFIDENCE`; None at either end for n < 6.

    Between the k-th of Walsh's averages from below and from above, k - 1 being the largest value of the signed-rank
    statistic whose tail is no more than (1 - confidence)/2: as `walsh_p` has it of the same numbers.
    """
    n, tail = ordered.size, 0.5 * (1.0 - CONFIDENCE)
    low, high = -1, n * (n + 1) // 2  # the tail at the first is no more, at the other it is
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if _signed_rank_tail(n, middle) <= tail else (low, middle)
    if low < 0:
        return NOTHING
    count = n * (n + 1) // 2
    return Interval(_walsh_average(ordered, low + 1), _walsh_average(ordered, count - low))


def walsh_p(ordered: Array) -> float:
    """Two-sided p of Wilcoxon's signed ranks: that the numbers (n,), rising, are centred at zero.

    By the counts of Walsh's averages on either side of zero, those at zero being on both: differences of zero speak
    for it.  Without zeros and ties it is Wilcoxon's exact test.
    """
    n = ordered.size
    below = _walsh_below(ordered, 0.0)
    above = _walsh_below(-ordered[::-1], 0.0)
    return min(1.0, 2.0 * _signed_rank_tail(n, min(below, above)))


def _walsh_below(ordered: Array, value: float) -> int:
    """How many of Walsh's averages are at a value or below it."""
    ends = np.searchsorted(ordered, 2.0 * value - ordered, side="right")
    return int(np.maximum(ends - np.arange(ordered.size), 0).sum())


def _walsh_average(ordered: Array, k: int) -> float:
    """The k-th smallest of Walsh's averages, without making all of them: 5000 flights have twelve million."""
    low, high = float(np.nextafter(ordered[0], -np.inf)), float(ordered[-1])
    for _ in range(60):  # of the range no more is left than the last bit
        middle = low + 0.5 * (high - low)
        low, high = (low, middle) if _walsh_below(ordered, middle) >= k else (middle, high)
    ends = np.maximum(np.searchsorted(ordered, 2.0 * low - ordered, side="right"), np.arange(ordered.size))
    there = ends < ordered.size
    return float(np.min(0.5 * (ordered[there] + ordered[ends[there]])))


def _signed_rank_tail(n: int, value: int) -> float:
    """Probability that Wilcoxon's statistic of n numbers is at most a value, if they are centred at zero.

    Exact up to `EXACT` numbers, and by the normal distribution with a correction for continuity beyond.
    """
    if value < 0:
        return 0.0
    if n <= EXACT:
        return float(_signed_rank_tails(n)[value])
    mean, variance = n * (n + 1) / 4.0, n * (n + 1) * (2 * n + 1) / 24.0
    return float(special.ndtr((value + 0.5 - mean) / math.sqrt(variance)))


@cache
def _signed_rank_tails(n: int) -> Array:
    """Each rank is in the sum or not, with even odds: the distribution is built up a rank at a time."""
    share = np.zeros(n * (n + 1) // 2 + 1)
    share[0] = 1.0
    for rank in range(1, n + 1):
        share = 0.5 * (share + np.concatenate((np.zeros(rank), share[:-rank])))
    return np.minimum(np.cumsum(share), 1.0)


class Exceedance(NamedTuple):
    """The share of a sample that is at x or beyond, (m,) each, with the band of `clopper_pearson` at each x."""

    x: Array
    share: Array
    low: Array
    high: Array


def exceedance(ordered: Array, most: int = 200) -> Exceedance:
    """Share at or above x, at values of the sample.

    Parameters
    ----------
    ordered : (n,) array
        Rising, finite.
    most : int
        Points of the curve.  Of a larger sample those are taken that are evenly spaced in the logarithm of the share,
        so that every one of the largest values is there, and fewer of the many.
    """
    n = ordered.size
    beyond = np.arange(n, 0, -1)  # how many are at this value or above it
    if n > most:
        wanted = np.unique(np.round(np.geomspace(1.0, n, most)).astype(int))
        beyond = wanted[::-1]
    x = ordered[n - beyond]
    # of equal values the first one counts them all
    beyond = n - np.searchsorted(ordered, x, side="left")
    _, first = np.unique(x, return_index=True)
    low, high = clopper_pearson(beyond[first], np.full(first.size, n))
    return Exceedance(x[first], beyond[first] / max(n, 1), low, high)


class Rank(NamedTuple):
    """Of a pair of columns: Spearman's ρ, its p, and of how many flights; None where it says nothing."""

    n: int
    rho: float | None
    p: float | None


def rank_correlation(one: Array, other: Array) -> Rank:
    """Spearman's rank correlation over the flights (n,) that have both numbers.

    None for fewer than four flights, and where either column is constant.
    """
    both = np.isfinite(one) & np.isfinite(other)
    x, y = one[both], other[both]
    if x.size < 4 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return Rank(int(x.size), None, None)
    found = stats.spearmanr(x, y)
    return Rank(int(x.size), float(found.statistic), float(found.pvalue))


def adjusted(p_values: ArrayLike) -> Array:
    """The p of many tests, adjusted for their number by Benjamini and Hochberg.

    Of those below a level, no more than that share is expected to be there by chance.  NaN stays NaN, and does
    not count.
    """
    p = np.asarray(p_values, dtype=float)
    known = np.isfinite(p)
    result = np.full(p.shape, np.nan)
    if known.any():
        result[known] = stats.false_discovery_control(p[known])
    return result
