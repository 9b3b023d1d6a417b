"""What a study speaks of: quantities, stages, sources, and the errors of one of each by range.

SI and radians inside; a quantity knows how it is shown.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

from estimator.so3 import Array
from landsim.units import DEG

StageName: TypeAlias = Literal["early", "late"]
Reading: TypeAlias = Literal["endpoints", "edge-points"]
Source: TypeAlias = Literal["vision", "fused"]

READINGS: tuple[Reading, ...] = ("endpoints", "edge-points")
SOURCES: tuple[Source, ...] = ("vision", "fused")
LEVELS = (68.27, 95.0, 99.73)
"""Percentiles of the absolute error that are kept, %."""


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
