"""A normal error about a shift, and bounds on its size.

A bound B holds in a share p of the frames if

    Φ((B - b) / σ) - Φ((-B - b) / σ) = p,

which without a shift b is σ = B / z, z = Φ⁻¹((1 + p) / 2).
"""

import math
from collections.abc import Callable
from statistics import NormalDist

NORMAL = NormalDist()


def inside(sigma: float, shift: float, bound: float) -> float:
    """Probability that a normal error of this σ about this shift is within ± bound."""
    if sigma <= 0.0:
        return 1.0 if abs(shift) <= bound else 0.0
    return NORMAL.cdf((bound - shift) / sigma) - NORMAL.cdf((-bound - shift) / sigma)


def sigma_within(bound: float, shift: float, confidence: float) -> float | None:
    """The greatest σ with which so large a share stays within ± bound; None if the shift alone is beyond it.

    A shift of NaN, of an error that there is not, is beyond every bound.
    """
    shift = abs(shift)
    if shift == 0.0:
        return bound / NORMAL.inv_cdf(0.5 + 0.5 * confidence)
    if not shift < bound:
        return None
    # the share falls with σ, and no shift leaves it larger than none does
    return bisected(
        lambda s: inside(s, shift, bound) >= confidence, 0.0, bound / NORMAL.inv_cdf(0.5 + 0.5 * confidence)
    )


def bound_kept(sigma: float, shift: float, confidence: float) -> float:
    """The bound within which so large a share stays; NaN without a σ or a shift."""
    half = sigma * NORMAL.inv_cdf(0.5 + 0.5 * confidence)
    if shift == 0.0 or not math.isfinite(sigma + shift):
        return half + shift
    return bisected(lambda bound: inside(sigma, shift, bound) < confidence, half, half + abs(shift))


def bisected(holds: Callable[[float], bool], good: float, bad: float) -> float:
    """The last value, from good toward bad, that holds."""
    for _ in range(60):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good
