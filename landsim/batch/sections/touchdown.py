"""Where the flights touched down, on the runway as drawn."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.so3 import Array
from landsim.batch.ellipse import prediction_ellipse
from landsim.batch.flights import Flights
from landsim.batch.measures import touched_down
from landsim.batch.sections.words import number, several
from landsim.batch.stats import rate
from landsim.config import Scenario
from landsim.units import DEG

LEVELS = {50.0: 5, 95.0: 10, 99.7: 20}
"""Of the ellipses (%), and how many touchdowns each takes.

With so many it is at most 1.45 times as long as it would be with a known mean and covariance; of fewer it shows what
they leave open rather than where they land.
"""
MOST = 5000
"""Points that are kept for the picture."""


def touchdown(scenario: Scenario, flights: Flights) -> dict[str, Any]:
    """The section ``touchdown``."""
    down = touched_down(flights)
    points = np.stack((flights.numbers("x_m"), flights.numbers("y_m")), axis=1)[down]
    kept = thinned(np.flatnonzero(down), ~flights.flags("in_box"))
    n = len(points)
    result = {
        "n": n,
        "points": {
            "index": [flights.columns["index"][i] for i in kept],
            "seed": [flights.columns["seed"][i] for i in kept],
            "x_m": flights.numbers("x_m")[kept],
            "y_m": flights.numbers("y_m")[kept],
            "sink_rate_mps": flights.numbers("sink_rate_mps")[kept],
            "outcome": [flights.columns["outcome"][i] for i in kept],
            "in_box": flights.flags("in_box")[kept],
        },
        "points_rule": "every touchdown"
        if kept.size == n
        else f"{kept.size} of {n}: those of flights that missed the box first, then evenly spaced by index",
        "mean": None if n == 0 else {"x_m": points[:, 0].mean(), "y_m": points[:, 1].mean()},
        "std": None if n < 2 else {"x_m": points[:, 0].std(ddof=1), "y_m": points[:, 1].std(ddof=1)},
        "ellipses": [_ellipse(points, level, least) for level, least in LEVELS.items()],
        "box": {key: getattr(scenario.box, key) for key in ("along_min_m", "along_max_m", "cross_max_m")},
        "runway": {"width_m": scenario.runway.width_m, "length_m": scenario.runway.length_m},
        "aim_point_m": scenario.approach.aim_point_m,
    }
    result["text"] = _text(result)
    return result


def thinned(rows: NDArray[np.intp], first: NDArray[np.bool_], most: int = MOST) -> NDArray[np.intp]:
    """At most so many of the rows, in their order: those that come first, and others evenly spaced."""
    if rows.size <= most:
        return rows
    important, rest = rows[first[rows]], rows[~first[rows]]
    if important.size >= most:
        return np.asarray(important[np.linspace(0, important.size - 1, most).astype(int)])
    chosen = rest[np.linspace(0, rest.size - 1, most - important.size).astype(int)]
    return np.sort(np.concatenate((important, chosen)))


def _ellipse(points: Array, level: float, least: int) -> dict[str, Any]:
    """One ellipse; with ``center`` None if there is none."""
    found = prediction_ellipse(points, level / 100.0) if len(points) >= least else None
    if found is None:
        shape = dict.fromkeys(("center", "semi_major_m", "semi_minor_m", "angle_deg", "polygon", "inside"))
        return {"level": level, **shape}
    corners = found.polygon()
    return {
        "level": level,
        "center": {"x_m": found.center[0], "y_m": found.center[1]},
        "semi_major_m": found.semi_major,
        "semi_minor_m": found.semi_minor,
        "angle_deg": found.angle / DEG,
        "polygon": {"x_m": corners[:, 0], "y_m": corners[:, 1]},
        "inside": rate(int(found.holds(points).sum()), len(points)),
    }


def _text(found: dict[str, Any]) -> list[str]:
    drawn = [e for e in found["ellipses"] if e["center"] is not None]
    if not drawn:
        return [f"{several(found['n'], 'touchdown')}: too few, or too much alike, for an ellipse."]
    meaning = (
        "Each ellipse holds the next touchdown with its probability, if touchdowns are normally distributed; it allows"
        f" for mean and covariance being estimates from {found['n']} flights."
    )
    few = [f"{level:g} % takes {least}" for level, least in LEVELS.items() if found["n"] < least]
    left_out = [f"Too few touchdowns for every ellipse: {', '.join(few)}."] if few else []
    off = [
        f"The {e['level']:g} % ellipse holds {number(100.0 * e['inside']['rate'], 4)} % of these touchdowns: they are"
        " not normally distributed, and the ellipse is a description, not a bound."
        for e in drawn
        if not e["inside"]["low"] <= e["level"] / 100.0 <= e["inside"]["high"]
    ]
    return [meaning, *left_out, *(off or ["The shares of these touchdowns that they hold agree with that assumption."])]
