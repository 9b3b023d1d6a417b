"""What stands beside the judgement: what ties errors together, what roll does late, and which flights were flown."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from landsim.config import Scenario, StudyConfig
from landsim.state import Stage
from landsim.study.envelope import percentiles
from landsim.study.geometry import Proportion, RollLimit, lateral_shift
from landsim.study.judged import SAME_PLACE, bounds_of, plain, rows_at
from landsim.study.model import LEVEL, LEVELS, QUANTITIES, Envelope
from landsim.units import DEG

TIED = (("cross", "yaw"), ("altitude", "pitch"))
"""Positions that an error of an angle moves by range times angle."""


def roll_entries(limits: Sequence[RollLimit]) -> list[dict[str, Any]]:
    """Up to which roll error each bound of the late stage holds."""
    return [
        {
            "quantity": limit.quantity,
            "reading": limit.reading,
            "unit": QUANTITIES[limit.quantity].unit,
            "bound": limit.bound / QUANTITIES[limit.quantity].scale,
            "roll_error_deg": None if limit.roll_error is None else limit.roll_error / DEG,
            "holds_beyond": limit.beyond,
            "limited_by": None if limit.beyond else "no solution" if limit.no_solution else "bound",
            "at_range_m": limit.distance,
            "at_height_m": limit.height,
            "p95_over_bound": plain(limit.ratio),
            "draws": limit.draws,
            "checked_at_m": list(limit.checked),
            "confirmed": limit.confirmed,
        }
        for limit in limits
    ]


def shift_entries(
    scenario: Scenario, late: Iterable[tuple[float, float, float, float]]
) -> list[dict[str, float | None]]:
    """What a roll error does to the cross estimate, by the formula and by the solver.

    Parameters
    ----------
    scenario : Scenario
        A study.
    late : iterable of (float, float, float, float)
        Distance, height, roll error (rad) and the shift (m) of the cross estimate from lines without noise; NaN, and
        None in the result, where they have no solution.
    """
    return [
        {
            "range_m": distance,
            "height_m": height,
            "roll_error_deg": roll_error / DEG,
            "formula_m": float(lateral_shift(height, scenario.runway.width_m, roll_error)),
            "measured_m": plain(shift),
        }
        for distance, height, roll_error, shift in late
    ]


def meeting_entries(study: StudyConfig, envelopes: Sequence[Envelope]) -> list[dict[str, Any]]:
    """Where a bound of a position and one of an angle ask the same, if range times angle is the position's error."""
    found = []
    for position, angle in TIED:
        bounds = bounds_of(study, "early", (position, angle))
        own = [e for e in envelopes if e.stage == "early" and e.source == "vision"]
        if len(bounds) == 2 and own:
            first = study.ranges_m[0]
            found.append(
                {
                    "stage": "early",
                    "position": position,
                    "angle": angle,
                    "position_bound_m": bounds[position],
                    "angle_bound_deg": bounds[angle] / DEG,
                    "range_m": bounds[position] / bounds[angle],
                    "first_range_m": first,
                    "angle_asked_deg": bounds[position] / first / DEG,
                    "equally_tight": [
                        {"reading": e.reading, "range_m": equally_tight(e, bounds, position, angle)} for e in own
                    ],
                }
            )
    return found


def equally_tight(envelope: Envelope, bounds: Mapping[str, float], position: str, angle: str) -> float | None:
    """The range at which a position's and an angle's p95 are the same part of their bounds, m.

    Position over angle grows with the range, so it is read off a straight line through the logarithms, near the last
    distance at which the position's part is the greater.  None if they do not meet, or if a bound is missing.
    """
    if position not in bounds or angle not in bounds:
        return None
    columns = [envelope.quantities.index(name) for name in (position, angle)]
    p95 = envelope.percentiles[:, columns, LEVELS.index(LEVEL)]
    known = np.isfinite(p95).all(axis=1) & (p95 > 0.0).all(axis=1) & (envelope.distance > 0.0)
    if known.sum() < 2:
        return None
    x = np.log(envelope.distance[known])
    excess = np.log(p95[known, 0] / bounds[position]) - np.log(p95[known, 1] / bounds[angle])
    window = max(3, x.size // 20)
    smooth = np.array([np.mean(excess[max(0, i - window) : i + window + 1]) for i in range(x.size)])
    above = np.flatnonzero(smooth > 0.0)
    if not above.size or above[-1] == x.size - 1:
        return None
    i = int(above[-1])
    share = smooth[i] / (smooth[i] - smooth[i + 1])
    return math.exp(float(x[i] + share * (x[i + 1] - x[i])))


def proportion_entries(found: Sequence[Proportion]) -> list[dict[str, Any]]:
    """How cross goes with yaw, and altitude with pitch."""
    return [
        {
            "reading": p.reading,
            "range_m": p.distance,
            "cross_over_range_times_yaw": plain(p.cross_over_yaw),
            "altitude_over_range_times_pitch": plain(p.altitude_over_pitch),
            "cross_yaw_correlation": plain(p.cross_yaw_correlation),
            "altitude_pitch_correlation": plain(p.altitude_pitch_correlation),
            "cross_roll_correlation": plain(p.cross_roll_correlation),
            "yaw_roll_correlation": plain(p.yaw_roll_correlation),
            "sight_line_down_deg": plain(p.sight / DEG),
            "optical_axis_down_deg": plain(p.axis / DEG),
        }
        for p in found
    ]


def flights_entry(
    rows: Sequence[Mapping[str, Any]],
    envelopes: Sequence[Envelope],
    ranges: Sequence[float],
    seed: int,
    lowest: float = 0.0,
) -> dict[str, Any]:
    """Where the fused errors come from: how many flights, how they ended, and from where on the filter runs.

    Parameters
    ----------
    rows : sequence of mapping
        Of `landsim.batch.row.flight_row`.
    envelopes : sequence of Envelope
        Of the flights.
    ranges : sequence of float
        At which the filter's own roll error in the late stage is told, m.
    seed : int
        Of the first flight.
    lowest : float
        Height of the camera at which the late stage ends, m.

    Returns
    -------
    dict
        By noise reading; ``fused_from_m`` is where the first flight has a fused solution, ``fused_in_all_from_m`` where
        every one has.
    """
    result: dict[str, Any] = {}
    for reading in dict.fromkeys(row["line_noise"] for row in rows):
        flown = [row for row in rows if row["line_noise"] == reading]
        outcomes = [row["outcome"] for row in flown]
        fused = {e.stage: e for e in envelopes if e.reading == reading and e.source == "fused"}
        begin = {"fused_from_m": 1, "fused_in_all_from_m": len(flown)}
        result[reading] = {
            "flights": len(flown),
            "first_seed": seed,
            "last_seed": seed + len(flown) - 1,
            "outcomes": {outcome: outcomes.count(outcome) for outcome in sorted(set(outcomes))},
            **{key: _first_with(fused.get("early"), number) for key, number in begin.items()},
            "late_roll": _late_roll(flown, fused.get("late"), ranges, lowest),
        }
    return result


def _first_with(envelope: Envelope | None, number: int) -> float | None:
    """The first distance at which there are so many, m."""
    there = [] if envelope is None else envelope.distance[envelope.count >= number].tolist()
    return there[0] if there else None


def _late_roll(
    flown: Sequence[Mapping[str, Any]], late: Envelope | None, ranges: Sequence[float], lowest: float
) -> list[dict[str, Any]]:
    """95th percentile of the filter's roll error at the listed ranges, over the flights in the late stage there."""
    result = []
    for i in [] if late is None else rows_at(late, ranges):
        distance = float(late.distance[i]) if late is not None else math.nan
        errors = [_late_error(row, "fused_error_roll_deg", distance, lowest) for row in flown]
        known = np.array([error for error in errors if math.isfinite(error)])
        if known.size:
            p95 = float(percentiles(known[:, None], (LEVEL,))[0, 0])
            result.append({"range_m": distance, "flights": int(known.size), "p95_deg": p95})
    return result


def _late_error(row: Mapping[str, Any], name: str, distance: float, lowest: float) -> float:
    """Of one flight; NaN where it is not in the late stage, as `landsim.study.flights.envelopes` has it."""
    near = np.flatnonzero(np.abs(np.asarray(row["distance_m"]) - distance) <= SAME_PLACE)
    if not near.size:
        return math.nan
    i, touchdown = near[0], row["touchdown_time_s"]
    airborne = (touchdown is None or row["time_s"][i] < touchdown) and row["true_height_m"][i] >= lowest
    return float(row[name][i]) if airborne and row["stage"][i] == Stage.LATE else math.nan
