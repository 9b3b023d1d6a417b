"""The range from which a bound holds to the end of a stage, and how well flights fix it."""

import math

import numpy as np
from numpy.random import SeedSequence, default_rng

from estimator.so3 import Array
from landsim.study.model import CHANCE, LEVEL, LEVELS, Envelope, chance

REACH = 0.15
"""Half the window of the local regression, relative to the distance, or late to the height."""
LEAST_POINTS = 5
"""Of a local regression; with fewer in the window, a percentile is taken as it is."""
RESAMPLES = 500
"""Of the flights, for an interval."""
AT_ONCE = 100
"""Resamples of which the errors are held at a time."""


def holds_from(envelope: Envelope, quantity: str, bound: float, level: float = LEVEL) -> float | None:
    """The greatest distance from which a quantity's percentile keeps a bound to the end of the stage.

    Single frames' percentiles are noisy, so it is read off a local regression: at each frame a straight line through
    the logarithms of the percentiles within ±15 %, over the logarithm of the distance; late, where the stage passes the
    threshold, of the height, of which the errors are nearly powers.  At the end, where the regression has one side
    alone, no frame's own percentile may exceed the bound by more than chance explains either.

    Parameters
    ----------
    envelope : Envelope
        With heights above zero, if late.
    quantity : str
        Of `Envelope.quantities`.
    bound : float
        rad or m.
    level : float
        Of `LEVELS`, %.

    Returns
    -------
    float or None
        m, negative past the threshold.  The first distance if the bound always holds, None if it does not hold at the
        end.  Where there is no percentile, or no solution in more than one of 20 draws (at 95 %), no bound holds.
    """
    if envelope.distance.size == 0:
        return None
    spread = envelope.percentiles[:, envelope.quantities.index(quantity), LEVELS.index(level)]
    found = float(_from(envelope, spread[None], bound, level)[0])
    return found if math.isfinite(found) else None


def holds_from_interval(
    envelope: Envelope, size: Array, bound: float, seed: SeedSequence
) -> tuple[float | None, float | None]:
    """In which `holds_from` of flights is at 95 %: its percentiles over flights drawn anew from those flown.

    Parameters
    ----------
    envelope : Envelope
    size : (flights, n) array
        Magnitude of each flight's error of the quantity at the distances of the envelope, rad or m: infinite without a
        solution, NaN where the flight does not count.
    bound : float
        rad or m.
    seed : SeedSequence
        It is not changed.

    Returns
    -------
    (float or None, float or None)
        The nearer and the farther end, m; None for not at the end of the stage.
    """
    rng, flights, found = default_rng(seed), size.shape[0], []
    for _ in range(0, RESAMPLES, AT_ONCE):
        chosen = rng.integers(flights, size=(AT_ONCE, flights))
        drawn = np.sort(size.T[:, chosen], axis=-1)  # NaN comes last
        number = np.isfinite(drawn).sum(axis=-1) + np.isinf(drawn).sum(axis=-1)
        rank = np.maximum(np.ceil(LEVEL / 100.0 * number - 1e-9).astype(int), 1) - 1
        p95 = np.take_along_axis(drawn, rank[..., None], axis=-1)[..., 0]
        found.append(_from(envelope, p95.T, bound, LEVEL))
    ordered = np.sort(np.concatenate(found))
    outside = int(0.5 * (1.0 - LEVEL / 100.0) * RESAMPLES)
    low, high = (float(value) for value in (ordered[outside], ordered[-1 - outside]))
    return (low if math.isfinite(low) else None), (high if math.isfinite(high) else None)


def _from(envelope: Envelope, spread: Array, bound: float, level: float) -> Array:
    """The distance from which each of many courses (m, n) of a percentile keeps a bound; -inf if not at the end."""
    distance, early = envelope.distance, envelope.stage == "early" and bool((envelope.distance > 0.0).all())
    x = np.log(distance if early else envelope.height)
    known = np.isfinite(spread)
    with np.errstate(divide="ignore"):
        own = np.log(np.where(known, spread, 1.0)) - math.log(bound)
    excess = np.where(known, _smooth(x, own, known), math.inf)
    # what the last percentiles say themselves
    last = slice(-LEAST_POINTS, None)
    excused = np.where(envelope.count > 0, np.log1p(CHANCE * chance(envelope.count, level)), math.inf)
    off = (own > excused) & known
    excess[:, last] = np.where(off[:, last], np.maximum(own, excess)[:, last], excess[:, last])
    n = distance.size
    result = np.empty(len(spread))
    for row, one in enumerate(excess):
        over = np.flatnonzero(one > 0.0)
        if over.size == 0:
            result[row] = distance[0]
            continue
        i = int(over[-1])
        if i == n - 1:
            result[row] = -math.inf
            continue
        share = 0.0
        if math.isfinite(one[i]) and math.isfinite(one[i + 1]):
            share = float(one[i + 1] / (one[i + 1] - one[i]))
        near, far = float(distance[i + 1]), float(distance[i])
        result[row] = near * (far / near) ** share if early else near + share * (far - near)
    return result


def _smooth(x: Array, y: Array, known: Array) -> Array:
    """Local straight lines through the known of many courses y (m, n) over x (n,), each read at its middle."""
    # y of no finite logarithm, an error of zero, is no part of a line
    usable = known & np.isfinite(y)
    weight, value = usable.astype(float), np.where(usable, y, 0.0)
    dx = x[:, None] - x  # [of, at]
    near = (np.abs(dx) <= REACH).astype(float)
    number = weight @ near
    sum_x, sum_xx = weight @ (near * dx), weight @ (near * dx * dx)
    sum_y, sum_xy = value @ near, value @ (near * dx)
    square = sum_xx * number - sum_x**2
    slope = np.divide(sum_xy * number - sum_x * sum_y, square, out=np.zeros_like(y), where=square > 1e-12)
    middle = np.divide(sum_y - slope * sum_x, number, out=np.zeros_like(y), where=number > 0)
    return np.asarray(np.where((number >= LEAST_POINTS) & usable, middle, y))
