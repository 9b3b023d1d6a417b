"""What a study speaks of: quantities, stages, sources, and the errors of one of each by range.

SI and radians inside; a quantity knows how it is shown.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.so3 import Array
from landsim.units import DEG

StageName: TypeAlias = Literal["early", "late"]
Reading: TypeAlias = Literal["endpoints", "edge-points"]
Source: TypeAlias = Literal["vision", "fused"]

READINGS: tuple[Reading, ...] = ("endpoints", "edge-points")
SOURCES: tuple[Source, ...] = ("vision", "fused")
LEVELS = (68.27, 95.0, 99.73)
"""Percentiles of the absolute error that are kept, %."""
LEVEL = 95.0
"""The one of them at which a bound has to hold, %."""
JUDGED = LEVELS.index(LEVEL)
NORMAL = tuple(NormalDist().inv_cdf(0.5 + 0.005 * level) for level in LEVELS)
"""The same percentiles of a standard normal's magnitude: Φ⁻¹((1 + p)/2)."""
CHANCE = 3.0
"""So many standard errors of a sampled percentile, or share, pass for chance."""


def enough(count: ArrayLike, level: float) -> NDArray[np.bool_]:
    """Whether so many errors have a percentile of a level (%): with fewer it would be the largest of them."""
    return np.asarray(np.asarray(count) * (1.0 - level / 100.0) >= 1.0 - 1e-9)


def chance(count: ArrayLike, level: float) -> Array:
    """Relative standard error √(p (1 - p)/n) / (2 φ(z) z) of the percentile p of n normal errors' magnitudes."""
    p, z = level / 100.0, NormalDist().inv_cdf(0.5 + 0.005 * level)
    with np.errstate(divide="ignore"):
        spread = np.sqrt(p * (1.0 - p) / np.asarray(count, float))
    return np.asarray(spread / (2.0 * math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi) * z))


class Quantity(NamedTuple):
    """One number of a pose."""

    name: str
    unit: str
    """In which it is shown: deg or m."""
    scale: float
    """SI value of that unit."""
    column: str
    """Its column in a log, without the source: ``vision_<column>``; there it is in the shown unit."""


QUANTITIES: dict[str, Quantity] = {
    q.name: q
    for q in (
        Quantity("roll", "deg", DEG, "roll_deg"),
        Quantity("pitch", "deg", DEG, "pitch_deg"),
        Quantity("yaw", "deg", DEG, "yaw_deg"),
        Quantity("cross", "m", 1.0, "cross_m"),
        Quantity("altitude", "m", 1.0, "height_m"),
        Quantity("along", "m", 1.0, "along_m"),
    )
}
"""By name, in the order of the paper's Fig. 3; cross is y, altitude -z and along (longitudinal) x."""
OF_STAGE: dict[StageName, tuple[str, ...]] = {
    "early": ("roll", "pitch", "yaw", "cross", "altitude", "along"),
    "late": ("pitch", "yaw", "cross", "altitude"),
}
"""What the three lines of the early stage give, and the two of the late."""


@dataclass(frozen=True)
class Envelope:
    """Errors by range, of one stage, noise reading and source; n ranges, k quantities.

    Attributes
    ----------
    stage : {"early", "late"}
    reading : {"endpoints", "edge-points"}
    source : {"vision", "fused"}
    roll_error : float
        By which the roll angle given to the late stage is off, rad; 0 early and for what is fused.
    quantities : (k,) tuple of str
        Names, of `QUANTITIES`.
    distance : (n,) array
        From the camera forward to the threshold, m; negative past it.  It falls along the approach.
    time : (n,) array
        s since the start.
    height : (n,) array
        Of the camera above the runway, m.
    count : (n,) int array
        Errors at each range: draws, or flights.
    percentiles : (n, k, 3) array
        Of the absolute error at `LEVELS`, m and rad; NaN where there is none.
    sigma : (n, k) array
        Predicted 1 σ: first order (Cramér-Rao) for vision, the filter's own (root mean square over the flights) if
        fused; m and rad.  A roll error is not in it.
    single : (n, k) array
        Error of one realisation, estimate less truth, m and rad.
    """

    stage: StageName
    reading: Reading
    source: Source
    roll_error: float
    quantities: tuple[str, ...]
    distance: Array
    time: Array
    height: Array
    count: Array
    percentiles: Array
    sigma: Array
    single: Array
