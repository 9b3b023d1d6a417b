"""One flight as a row of numbers.

``flight_row`` is a pure function of scenario and seed, but for the wall time that it reports.  A row has what a flight
was worth as scalars, and its navigation errors by distance to the threshold as arrays, so that flights that are flown
at different speeds can be laid over each other.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from estimator.so3 import Array
from landsim.alarms import PROTECTED
from landsim.config import Scenario
from landsim.dispersion import dispersed, draws_of_seed, keys_of
from landsim.errors import InputError, traceback_of
from landsim.log import QUANTITIES, Log
from landsim.metrics import ALL_LINES, BOTH_EDGES, CRASHES, error
from landsim.simulate import Flight, fly, must_fly
from landsim.state import Alarm, Stage

Row: TypeAlias = dict[str, Any]

STEP = 10.0
"""Of the grid of distances, m."""
BEYOND = 300.0
"""The grid goes on for so far past the threshold, m."""
REACH = 0.5 * STEP
"""A flight that begins nearer than a distance by more than this has no frame for it, m."""

START = ("along_m", "cross_m", "height_m", "heading_deg", "speed_mps")
TOUCHDOWN = ("x_m", "y_m", "sink_rate_mps", "ground_speed_mps", "pitch_deg", "bank_deg", "heading_error_deg")
TRACKING = ("glide_slope_m", "localizer_m", "glide_slope_to_flare_m")
ESTIMATES = ("vision", "fused")
PHASES = ("early", "late", "coasting", "rollout")
"""Of a flight's consistency."""
DRAW = "draw."
"""What the names of dispersed keys' columns begin with."""
STATED: dict[str, tuple[str, type]] = {
    "protection_frames": ("frames", int),
    "exceeded_frames": ("exceeded_frames", int),
    "protection_max_m": ("protection_max_m", float),
    "protection_last_m": ("protection_last_m", float),
}
"""What a row has of a protection level: what it is in metrics.json, and its type."""
INTEGRITY = ("misleading_frames", "fault_at_s", "fault_detected_after_s", "false_alarm", "flagged")
NORMALISED = ("nees9_mean", "nees15_mean")
ALARMS = tuple(str(alarm.name).lower() for alarm in Alarm if alarm)


def _stated(name: str, what: str) -> str:
    """``cross_m`` and ``rms`` to ``cross_rms_m``: the unit stays at the end."""
    stem, unit = name.rsplit("_", 1)
    return f"{stem}_{what}_{unit}"


SCALARS: dict[str, type] = {
    "index": int,
    "seed": int,
    "line_noise": str,
    "outcome": str,
    "in_box": bool,
    "reason": str,
    "end": str,
    "traceback": str,
    **{f"start_{name}": float for name in START},
    **dict.fromkeys(TOUCHDOWN, float),
    "touchdown_time_s": float,
    "bounces": int,
    "stop_x_m": float,
    "stop_y_m": float,
    "stop_time_s": float,
    **{_stated(name, of): float for name in TRACKING for of in ("rms", "p95")},
    **{f"{source}_{_stated(q, of)}": float for source in ESTIMATES for q in QUANTITIES for of in ("rms", "p95")},
    **{f"{name}_{phase}": float for phase in PHASES for name in NORMALISED},
    **{f"frames_{phase}": int for phase in PHASES},
    **{f"coverage95_{q}": float for q in QUANTITIES},
    "coverage_frames": int,
    **{f"{name}_{stated}": kind for name in PROTECTED for stated, (_, kind) in STATED.items()},
    **{f"{alarm}_alarm_s": float for alarm in ALARMS},
    "misleading_frames": int,
    "fault_at_s": float,
    "fault_detected_after_s": float,
    "false_alarm": bool,
    "flagged": bool,
    "flight_time_s": float,
    "wall_time_s": float,
}
"""The scalars of a row and their types, in order; each may be None.  The touchdown's have the names of metrics.json.

``index`` is the flight's place in its batch, which the batch knows and a flight does not.
"""
ARRAYS: tuple[str, ...] = (
    "distance_m",
    "time_s",
    "stage",
    *(f"true_{q}" for q in QUANTITIES),
    *(f"vision_error_{q}" for q in QUANTITIES),
    *(f"fused_error_{q}" for q in QUANTITIES),
    *(f"sigma_{q}" for q in QUANTITIES),
)
"""The arrays of a row, in order, (n,) floats each; NaN where there is nothing."""


def distances_of(scenario: Scenario) -> Array:
    """Distances to the threshold (n,), m, falling, at which a row of a scenario has its errors.

    They are those divisible by `STEP`, from the start to `BEYOND` past the threshold, where they are negative, and the
    study's own, if the scenario has a study.
    """
    first, last = math.floor(-scenario.start.along_m / STEP), -math.floor(BEYOND / STEP)
    grid = STEP * np.arange(last, first + 1)
    ranges = () if scenario.study is None else scenario.study.ranges_m
    return np.asarray(np.unique(np.append(grid, ranges))[::-1])


def scalars_of(scenario: Scenario) -> dict[str, type]:
    """The scalars of a scenario's rows and their types, in order: `SCALARS`, and ``draw.<key>`` of what is drawn."""
    return SCALARS | {f"{DRAW}{key}": float for key in keys_of(scenario)}


def flight_row(
    scenario: Scenario,
    seed: int,
    distances: ArrayLike | None = None,
    draws: Mapping[str, float] | None = None,
    *,
    look: Callable[[Flight], None] | None = None,
) -> Row:
    """Fly a scenario once, and say in one row what came of it.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``flight``.
    seed : int
        Not negative.
    distances : (n,) array_like, optional
        To the threshold, m; without them, those of `distances_of`.
    draws : mapping, optional
        As for `landsim.simulate.fly`.
    look : callable, optional
        Is given the flight, if there is one, before it is a row.

    Returns
    -------
    dict
        `scalars_of` the scenario and `ARRAYS`, every one of them in every row.  At each distance stand the numbers of
        the first camera frame at or past it: ``vision_error_*`` of the pose that its lines alone give and
        ``fused_error_*`` of the filter after it, estimate less true, ``sigma_*`` the filter's own, ``true_*`` the
        camera's pose, and as ``stage`` what the frame offered, whether the filter believed it or not: 1 three lines, 2
        two, 0 less.  An exception in the flight makes a row with the outcome ``error``.

    Raises
    ------
    InputError
        If the aircraft's model does not load, or the scenario does not allow a drawn value.
    ValueError
        If the scenario is not a flight, or the seed is not a whole number of zero or more.
    """
    must_fly(scenario, seed)
    at = np.asarray(distances_of(scenario) if distances is None else distances, dtype=float)
    draws = draws_of_seed(scenario, seed) if draws is None else draws
    try:
        flight = fly(scenario, seed, draws)
        if look is not None:
            look(flight)
        return row_of(scenario, flight, at)
    except InputError:
        raise
    except Exception as failure:  # noqa: BLE001 - one flight must not take the others with it, and its row says why
        return lost_row(scenario, seed, at, f"{type(failure).__name__}: {failure}", traceback_of(failure), draws)


def lost_row(
    scenario: Scenario,
    seed: int,
    distances: Array,
    reason: str,
    traceback: str | None = None,
    draws: Mapping[str, float] | None = None,
) -> Row:
    """The row of a flight that came to nothing: outcome and end ``error``, the reason, and no number.

    Parameters
    ----------
    scenario, seed, distances
        As for `flight_row`.
    reason : str
        What became of it, in a line.
    traceback : str, optional
        Of `traceback_of`.
    draws : mapping, optional
        As for `landsim.simulate.fly`.
    """
    draws = draws_of_seed(scenario, seed) if draws is None else draws
    lost: Row = dict.fromkeys(SCALARS)
    lost |= {"seed": seed, "line_noise": scenario.camera.line_noise, "in_box": False}
    lost |= {"outcome": "error", "end": "error", "reason": reason, "traceback": traceback}
    lost |= {f"{DRAW}{key}": draws[key] for key in keys_of(scenario)}
    return lost | {name: np.full(distances.size, np.nan) for name in ARRAYS} | {"distance_m": distances}


def row_of(scenario: Scenario, flight: Flight, distances: Array) -> Row:
    """The row of a flight that has been flown; parameters and result as for `flight_row`.

    A wheel that touches while the aircraft goes around is no landing's: the row has no touchdown then.
    """
    metrics = flight.metrics
    touchdown = (None if metrics["outcome"] == "go_around" else metrics["touchdown"]) or {}
    stop = metrics["stop"] or {}
    consistency, coverage, integrity = metrics["consistency"], metrics["coverage"], metrics["integrity"]
    row: Row = {
        "index": None,
        "seed": metrics["seed"],
        "line_noise": scenario.camera.line_noise,
        **{name: metrics[name] for name in ("outcome", "in_box", "reason", "end")},
        "traceback": metrics.get("traceback"),
        **{f"start_{name}": metrics["start"].get(name) for name in START},
        **{name: touchdown.get(name) for name in TOUCHDOWN},
        "touchdown_time_s": touchdown.get("time_s"),
        "bounces": metrics["bounces"],
        **{f"stop_{name}": stop.get(name) for name in ("x_m", "y_m", "time_s")},
        **{_stated(name, of): metrics["tracking"][name][of] for name in TRACKING for of in ("rms", "p95")},
        **{
            f"{source}_{_stated(q, of)}": metrics["navigation"][source][q][of]
            for source in ESTIMATES
            for q in QUANTITIES
            for of in ("rms", "p95")
        },
        **{f"{name}_{phase}": consistency[phase][name] for phase in PHASES for name in NORMALISED},
        **{f"frames_{phase}": consistency[phase]["frames"] for phase in PHASES},
        **{f"coverage95_{q}": coverage[q] for q in QUANTITIES},
        "coverage_frames": coverage["frames"],
        **{f"{name}_{stated}": integrity[name][of] for name in PROTECTED for stated, (of, _) in STATED.items()},
        **{f"{alarm}_alarm_s": integrity["first_alarm_s"][alarm] for alarm in ALARMS},
        **{name: integrity[name] for name in INTEGRITY},
        "flight_time_s": metrics["flight_time_s"],
        "wall_time_s": metrics["wall_time_s"],
        **{f"{DRAW}{key}": metrics["draws"][key] for key in keys_of(scenario)},
    }
    flown = dispersed(scenario, metrics["draws"])
    every = round(flown.simulation.rate_hz / flown.camera.rate_hz)
    return row | by_distance(flight.log, distances, every, crashed=metrics["end"] in CRASHES)


def by_distance(log: Log, distances: Array, every: int, *, crashed: bool = False) -> dict[str, Array]:
    """The arrays of a row.

    Parameters
    ----------
    log : mapping of str to (n,) array
        The columns of ``landsim.log.COLUMNS``; n may be 0.
    distances : (m,) array
        To the threshold, m.
    every : int
        Rows from one camera frame to the next.
    crashed : bool
        Whether the last row is that of a crash, which no camera sees any more.

    Returns
    -------
    dict of str to (m,) array
        `ARRAYS`.
    """
    frames = np.arange(0, log["time_s"].size - crashed, every)
    passed = np.maximum.accumulate(log["true_along_m"][frames])
    nearest = np.searchsorted(passed, -distances)
    there = nearest < frames.size
    if frames.size:
        there &= (nearest > 0) | (distances <= REACH - passed[0])
    rows = frames[nearest[there]]

    def at(values: Array) -> Array:
        result = np.full(distances.size, np.nan)
        result[there] = values[rows]
        return result

    return {
        "distance_m": distances.copy(),
        "time_s": at(log["time_s"]),
        "stage": at(_offered(log)),
        **{f"true_{q}": at(log[f"true_{q}"]) for q in QUANTITIES},
        **{f"{source}_error_{q}": at(error(log, source, q)) for source in ESTIMATES for q in QUANTITIES},
        **{f"sigma_{q}": at(log[f"sigma_{q}"]) for q in QUANTITIES},
    }


def _offered(log: Log) -> Array:
    """What each row's frame offered to the filter, as a number of `landsim.state.Stage`.

    The log's own stage is 0 where the gate refused a frame; to leave those out would take the worst of vision away.
    Before the filter starts, frames with three lines are those from which it does.
    """
    three = np.all([np.isfinite(log[f"{line}_seen_u0"]) for line in ("left", "threshold", "right")], axis=0)
    offered = log["lines_found"]
    waiting = np.isnan(log["fused_along_m"]) | ((offered == 0.0) & (log["stage"] == Stage.EARLY))
    early = (offered == ALL_LINES) | (three & waiting)
    return np.select([early, offered == BOTH_EDGES], [float(Stage.EARLY), float(Stage.LATE)], float(Stage.NONE))
