"""Batches to draw and to print, none of them flown: an ordinary one, and those that have little to show."""

from typing import Any

import numpy as np
from flown import aloft, around, failed, good
from numpy.random import default_rng

from landsim.batch.compare import compare
from landsim.batch.flights import flights_of
from landsim.batch.row import DRAW, Row
from landsim.batch.summary import summarise
from landsim.config import load_scenario
from landsim.log import QUANTITIES

SCENARIO = load_scenario("landing")
OTHER = load_scenario("landing", overrides={"camera.line_noise": "endpoints"})
VERSIONS = {"landsim": "1.2.3", "numpy": "2.0"}


def ordinary(n: int = 60, seed: int = 1, spread: float = 1.0) -> list[Row]:
    """Landings that scatter with a wind, the last few of them wide, in the air to the end, and raised."""
    rng = default_rng(seed)
    rows = []
    for i in range(n - 3):
        wind, noise = rng.normal(0.0, 2.0), rng.lognormal()
        y = spread * (0.25 * wind + rng.normal(0.0, 0.2))
        sink = 0.5 + 0.1 * rng.random()
        size = noise * np.array([30.0, 8.0, 0.4, 0.2, 0.6])
        errors = {
            f"{source}_error_{q}": scale * size * rng.standard_normal(5)
            for q in QUANTITIES
            for source, scale in (("vision", 1.0), ("fused", 0.1))
        }
        rows.append(
            good(
                i, x_m=275.0 + 20.0 * rng.standard_normal(), y_m=y, sink_rate_mps=sink, in_box=bool(abs(y) <= 2.0),
                bank_deg=rng.normal(0.0, 0.4), pitch_deg=rng.normal(3.0, 0.2), ground_speed_mps=36.0 + rng.random(),
                heading_error_deg=rng.normal(), stop_y_m=rng.normal(0.0, 0.3), start_height_m=rng.normal(60.0, 4.0),
                nees9_mean_early=float(rng.chisquare(9)), nees15_mean_late=float(rng.chisquare(15)),
                coverage95_cross_m=min(1.0, 0.9 + 0.05 * rng.random()), glide_slope_to_flare_p95_m=3.0 + rng.random(),
                localizer_p95_m=2.0 + rng.random(), **errors, **{f"sigma_{q}": 0.1 * size for q in QUANTITIES},
                **{f"{DRAW}wind.cross_mps": wind, f"{DRAW}camera.noise_px": noise},
            )
        )  # fmt: skip
    drawn = {f"{DRAW}wind.cross_mps": 3.0, f"{DRAW}camera.noise_px": 1.0}
    lost = failed(n - 1, reason="ValueError: no", traceback="Traceback: no", **drawn)
    return [*rows, aloft(n - 3, **drawn), good(n - 2, y_m=2.5, in_box=False, **drawn), lost]


BATCHES: dict[str, list[Row]] = {
    "ordinary": ordinary(),
    "one flight": [good(0)],
    "all raised": [failed(i) for i in range(5)],
    "no touchdown": [aloft(i) for i in range(5)],
    "no flight": [],
    "all alike": [good(i) for i in range(20)],
    "gone around": [*(good(i) for i in range(25)), *(around(i) for i in range(25, 30))],
    "beside the runway": [good(0), good(1, y_m=-114.0, in_box=False, outcome="off_runway")],
    "all gone around": [around(i) for i in range(5)],
}
"""Rows by what is particular about them."""


def summary(rows: list[Row], **identity: Any) -> dict[str, Any]:
    """What summary.json says of them."""
    return summarise(SCENARIO, flights_of(rows), {"scenario": "landing", "seed": 0, "versions": VERSIONS} | identity)


def comparison(**batches: list[Row]) -> dict[str, Any]:
    """What compare.json says of batches of two scenarios."""
    scenarios = (SCENARIO, OTHER, OTHER)
    return compare([(name, scenarios[i], flights_of(rows)) for i, (name, rows) in enumerate(batches.items())])


COMPARISONS: dict[str, dict[str, list[Row]]] = {
    "ordinary": {"points": ordinary(), "ends": ordinary(seed=2, spread=2.0)},
    "three": {"points": ordinary(), "ends": ordinary(seed=2), "far": ordinary(seed=3, spread=3.0)},
    "all raised": {"points": [failed(0)], "ends": [failed(0)]},
    "one raised": {"points": ordinary(), "ends": [failed(i) for i in range(60)]},
}
