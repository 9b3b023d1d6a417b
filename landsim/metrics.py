"""What a flight was worth: touchdown, outcome, tracking, navigation errors and the filter's consistency, from its log.

Everything here is a pure function of the log's columns (``landsim.log.COLUMNS``), the scenario and the aircraft.  What
does not exist is None and never NaN, so that the result is valid JSON.
"""

from collections.abc import Mapping
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landsim.alarms import integrity
from landsim.log import QUANTITIES
from landsim.state import Phase
from landsim.units import DEG

if TYPE_CHECKING:
    from landsim.config import AircraftConfig, BoxConfig, Scenario

Array: TypeAlias = NDArray[np.float64]
Log: TypeAlias = Mapping[str, Array]
Rows: TypeAlias = slice | NDArray[np.bool_]
"""Of a log."""

ENDS = (
    "stopped", "touchdown", "timeout", "diverged", "trim_failed", "error", "structure_contact", "below_ground", "fault",
    "go_around",
)  # fmt: skip
"""Why the simulation loop ended."""
CRASHES = {
    "structure_contact": "a part that is not a wheel touched the ground",
    "below_ground": "it went below the ground",
}
"""Those of the ends that are a crash, and what to say of it."""
BEGIN = -1000.0
"""Tracking and navigation count from here: along the runway, m."""
ALL_LINES, BOTH_EDGES, THRESHOLD_LINE = 7, 5, 2
"""Lines as bits: 1 left edge, 2 threshold, 4 right edge."""
COASTING_S = 1.0
"""A filter that has believed no frame for longer is said to coast."""
WITHIN = NormalDist().inv_cdf(0.975)
"""Standard deviations either side of the mean that hold 95 % of a normal distribution."""
EVERY = slice(None)
"""All rows of a log."""
BOUNCE_S = 0.1
"""Both main wheels in the air for longer than this, between contacts, is a bounce."""


class Touchdown(NamedTuple):
    """The first contact of a main wheel."""

    row: int
    """Of the log."""
    time: float
    """s."""
    x: float
    y: float
    """Midpoint of the main wheels, runway frame, m."""
    sink_rate: float
    """Of that midpoint over the last step in the air, m/s, positive down."""
    ground_speed: float
    """m/s."""
    pitch_deg: float
    bank_deg: float
    heading_error_deg: float
    """Heading less the runway's, nose right positive."""


class Verdict(NamedTuple):
    """How a flight ended."""

    outcome: str
    reason: str


def wrapped_deg(angle_deg: ArrayLike) -> Array:
    """Angles (deg) in [-180, 180)."""
    return np.asarray(np.mod(np.asarray(angle_deg, dtype=float) + 180.0, 360.0) - 180.0)


def rms(values: ArrayLike) -> float | None:
    """Root of the mean square of the finite values; None if there is none."""
    finite = _finite(values)
    return float(np.sqrt(np.mean(finite**2))) if finite.size else None


def p95(values: ArrayLike) -> float | None:
    """95th percentile (linear interpolation) of the magnitude of the finite values; None if there is none."""
    finite = _finite(values)
    return float(np.percentile(np.abs(finite), 95.0)) if finite.size else None


def error(log: Log, source: str, quantity: str, rows: Rows = EVERY) -> Array:
    """Error of ``vision`` or ``fused`` in a quantity of ``landsim.log.QUANTITIES``, in its unit; angles are wrapped."""
    difference = log[f"{source}_{quantity}"][rows] - log[f"true_{quantity}"][rows]
    return wrapped_deg(difference) if quantity.endswith("_deg") else difference


def main_wheels(log: Log, aircraft: "AircraftConfig", rows: Rows = EVERY) -> tuple[Array, Array]:
    """Along and cross position of the midpoint of the main wheels in these rows, runway frame, m.

    That is the cg's + R_runway_from_body m, with R_runway_from_body that of ``estimator.so3.from_euler`` and m the
    wheels' mean position in body axes.
    """
    f, r, d = aircraft.gear.main_wheels_body_m
    roll, pitch, yaw = (log[f"body_{angle}_deg"][rows] * DEG for angle in ("roll", "pitch", "yaw"))
    sr, cr, sp, cp, sy, cy = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch), np.sin(yaw), np.cos(yaw)
    ahead = cp * f + sr * sp * r + cr * sp * d  # the components level ahead and level right of the nose
    right_of = cr * r - sr * d
    x, y = log["body_x_m"][rows], log["body_y_m"][rows]
    return x + cy * ahead - sy * right_of, y + sy * ahead + cy * right_of


def find_touchdown(log: Log, aircraft: "AircraftConfig") -> Touchdown | None:
    """The first row with weight on a main wheel; None if there is none.

    The sink rate is the wheels' height difference over the last step that begins and ends in the air, so that the
    gear's compression has no part in it; it includes what the pitch rate does to wheels behind the cg.
    """
    rows = np.flatnonzero(_on_mains(log))
    if not rows.size:
        return None
    row = int(rows[0])
    (x,), (y,) = main_wheels(log, aircraft, slice(row, row + 1))
    time, height = log["time_s"], log["wheel_height_m"]
    if row >= 1:
        first, last = max(row - 2, 0), max(row - 1, 1)
        sink_rate = float(-(height[last] - height[first]) / (time[last] - time[first]))
    else:  # begun on the wheels: no step in the air to difference
        sink_rate = float(log["true_velocity_z_mps"][row])
    return Touchdown(
        row=row,
        time=float(time[row]),
        x=float(x),
        y=float(y),
        sink_rate=sink_rate,
        ground_speed=float(np.hypot(log["true_velocity_x_mps"][row], log["true_velocity_y_mps"][row])),
        pitch_deg=float(log["body_pitch_deg"][row]),
        bank_deg=float(log["body_roll_deg"][row]),
        heading_error_deg=float(wrapped_deg(log["body_yaw_deg"][row])),
    )


def count_bounces(log: Log) -> int:
    """How often both main wheels left the ground for more than ``BOUNCE_S`` and came back."""
    rows = np.flatnonzero(_on_mains(log))
    if rows.size < 2:
        return 0
    step = float(log["time_s"][1] - log["time_s"][0])
    airborne = np.diff(log["time_s"][rows]) - step
    return int(np.sum(airborne > BOUNCE_S + 0.5 * step))  # counted in steps: rounding of the times must not decide


def judge(
    log: Log,
    scenario: "Scenario",
    aircraft: "AircraftConfig",
    end: str,
    touchdown: Touchdown | None,
    detail: str = "",
) -> Verdict:
    """The outcome of a flight by the first thing that went wrong, or ``landed`` if nothing did.

    What happened at the wheels happened before the loop's end, or with it: a crash in the same row counts first.

    Parameters
    ----------
    log, scenario, aircraft, end
        As for `flight_metrics`.
    touchdown : Touchdown or None
    detail : str
        What the loop says of its end.

    Raises
    ------
    ValueError
        If ``end`` is not one of ``ENDS``.
    """
    if end not in ENDS:
        raise ValueError(f"end: {end!r} is not one of {', '.join(ENDS)}")
    if end == "trim_failed":
        return Verdict("trim_failed", detail or "JSBSim found no trim at the start")
    if end == "error":
        return Verdict("error", detail or "the simulation failed")
    faults = _contact_faults(log, scenario, aircraft, touchdown)
    if end in CRASHES:
        faults.insert(0, (log["time_s"].size - 1, Verdict("crashed", CRASHES[end])))
    if faults:
        row, verdict = min(faults, key=lambda fault: fault[0])
        return verdict._replace(reason=verdict.reason + _navigation_then(log, row))
    if end == "diverged":
        return Verdict("diverged", "the navigation filter diverged" + (f": {detail}" if detail else ""))
    if end == "timeout":
        where = "in the air" if touchdown is None else "still rolling"
        return Verdict("timeout", f"{where} at the time limit of {scenario.simulation.time_limit_s:g} s")
    if end == "go_around":
        return Verdict("go_around", f"gone around: {detail}" if detail else "gone around")
    if end == "fault":
        return Verdict("error", "the loop ended for a fault at the wheels that the log does not show")
    if touchdown is None:
        return Verdict("error", "stopped without contact of a main wheel")
    last = "stopped on the runway" if end == "stopped" else "not flown beyond the touchdown"
    return Verdict("landed", f"main wheels first, within the gear's limit, {last}")


def box_limits(
    touchdown: Touchdown | None, stop_y: float | None, outcome: str, box: "BoxConfig"
) -> dict[str, dict[str, Any]]:
    """Each limit of the scenario's box: ``value``, ``limit``, and whether it is ``ok`` (not without a value).

    ``margin`` is what is left of it, negative beyond it, in its unit; None without a value.
    """
    t = touchdown
    upper: dict[str, tuple[float | None, float]] = {
        "along_max_m": (None if t is None else t.x, box.along_max_m),
        "cross_max_m": (None if t is None else abs(t.y), box.cross_max_m),
        "sink_max_mps": (None if t is None else t.sink_rate, box.sink_max_mps),
        "bank_max_deg": (None if t is None else abs(t.bank_deg), box.bank_max_deg),
        "stop_cross_max_m": (None if stop_y is None else abs(stop_y), box.stop_cross_max_m),
    }
    along = None if t is None else t.x
    return {
        "outcome": {"value": outcome, "limit": "landed", "ok": outcome == "landed", "margin": None},
        "along_min_m": _limit(along, box.along_min_m, -1.0),
        **{key: _limit(value, limit, 1.0) for key, (value, limit) in upper.items()},
    }


def _limit(value: float | None, limit: float, side: float) -> dict[str, Any]:
    """A limit that a number is beyond above it (side 1) or below it (-1)."""
    margin = None if value is None else side * (limit - value)
    return {"value": value, "limit": limit, "ok": margin is not None and margin >= 0.0, "margin": margin}


def tracking_errors(log: Log, glide_slope_deg: float, aim_point_m: float) -> dict[str, Array]:
    """Deviation of the true cg from the glide slope (up positive) and the centreline (right positive), m, a row each.

    The glide slope is the line that rises from the aim point, back along the approach.
    """
    slope = (aim_point_m - log["body_x_m"]) * np.tan(glide_slope_deg * DEG)
    return {"glide_slope_m": log["body_height_m"] - slope, "localizer_m": log["body_y_m"]}


def flare_row(log: Log, touchdown: Touchdown | None) -> int:
    """The first row of the flare or of what follows it, or of the touchdown, or the number of rows."""
    rows = np.flatnonzero(log["phase"] >= Phase.FLARE)
    flare = int(rows[0]) if rows.size else log["time_s"].size
    return flare if touchdown is None else min(flare, touchdown.row)


def _given_up_row(log: Log) -> int:
    """The first row of a go-around, or the number of rows: what is flown on the way up follows no approach."""
    rows = np.flatnonzero(log["phase"] == Phase.GO_AROUND)
    return int(rows[0]) if rows.size else log["time_s"].size


def navigation_errors(log: Log, end_row: int) -> dict[str, dict[str, dict[str, Any]]]:
    """Errors of vision and of the filter, a quantity, before ``end_row`` and past ``BEGIN``.

    ``rms``, ``p95`` and ``frames`` are over all rows in which the source has the quantity: for vision the frames that
    give it, for the filter every step since its start, coasting or not.  ``paired_rms`` and ``paired_frames`` are over
    the rows in which both have it.
    """
    result: dict[str, dict[str, dict[str, Any]]] = {"vision": {}, "fused": {}}
    counted = (np.arange(log["time_s"].size) < end_row) & (log["true_along_m"] >= BEGIN)
    for quantity in QUANTITIES:
        errors = {source: error(log, source, quantity) for source in result}
        both = counted & np.isfinite(errors["vision"]) & np.isfinite(errors["fused"])
        for source, values in errors.items():
            own = counted & np.isfinite(values)
            result[source][quantity] = _summary(values[own]) | {
                "frames": int(np.sum(own)),
                "paired_rms": rms(values[both]),
                "paired_frames": int(np.sum(both)),
            }
    return result


def consistency(log: Log, touchdown: Touchdown | None) -> dict[str, dict[str, Any]]:
    """Mean normalised errors squared by phase: early and late in the air, coasting in the air, and the rollout.

    A frame is early or late by the lines that it offered, with the threshold or without, whether the filter believed
    them or not; ``rejected`` says of how many it believed none.  Coasting frames offered none.
    """
    rows = np.arange(log["time_s"].size)
    airborne = rows < (rows.size if touchdown is None else touchdown.row)
    frame = np.isfinite(log["nees9"])
    offered = np.nan_to_num(log["lines_found"]).astype(int)
    threshold = (offered & THRESHOLD_LINE) != 0
    phases = {
        "early": frame & airborne & threshold,
        "late": frame & airborne & ~threshold & (offered != 0),
        "coasting": frame & airborne & (offered == 0),
        "rollout": frame & ~airborne & (log["phase"] < Phase.STOPPED),
    }
    return {
        name: {
            "nees9_mean": _mean(log["nees9"][rows_of]),
            "nees15_mean": _mean(log["nees15"][rows_of]),
            "frames": int(np.sum(rows_of)),
            "rejected": int(np.sum(log["accepted"][rows_of] == 0.0)),
        }
        for name, rows_of in phases.items()
    }


def coverage(log: Log, touchdown: Touchdown | None) -> dict[str, Any]:
    """Share of the camera frames, from the filter's start to the touchdown, that are within the predicted 95 %.

    Within: the magnitude of the fused error is at most `WITHIN` of the filter's own σ.  A filter that predicts its
    errors well has 0.95 in each quantity, one that trusts itself too much has less.  ``frames`` is their number; a
    share of none is None.
    """
    rows = np.arange(log["time_s"].size)
    counted = np.isfinite(log["nees9"]) & (rows < (rows.size if touchdown is None else touchdown.row))
    shares = {
        q: _mean(np.abs(error(log, "fused", q, counted)) <= WITHIN * log[f"sigma_{q}"][counted]) for q in QUANTITIES
    }
    return {"frames": int(np.sum(counted)), **shares}


def flight_metrics(
    log: Log,
    scenario: "Scenario",
    aircraft: "AircraftConfig",
    *,
    seed: int,
    end: str,
    wall_time_s: float,
    versions: Mapping[str, str],
    detail: str = "",
    start: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """All that metrics.json holds.

    Parameters
    ----------
    log : mapping of str to (n,) array
        The columns of ``landsim.log.COLUMNS``; n may be 0.
    scenario, aircraft
        As flown.
    seed : int
        Of the flight.
    end : str
        Why the loop ended, one of ``ENDS``.
    wall_time_s : float
        What the flight took.
    versions : mapping of str to str
        Of the libraries in use.
    detail : str
        What the loop says of its end.
    start : mapping of str to float, optional
        The start as drawn.

    Returns
    -------
    dict
        ``scenario``, ``seed``, ``outcome``, ``reason``, ``start``, ``in_box``, ``box`` (a limit: value, limit, ok,
        margin), ``touchdown``, ``bounces``, ``stop``, ``tracking`` (of the cg, to the touchdown; the glide slope also
        to the flare, which leaves it), ``navigation`` (of the camera, to the touchdown), ``consistency``,
        ``coverage``, ``integrity`` (of `landsim.alarms.integrity`), ``end``, ``flight_time_s``, ``wall_time_s``,
        ``versions``.  Every ``p95`` is of the magnitude.

    Raises
    ------
    ValueError
        If ``end`` is not one of ``ENDS``.
    """
    touchdown = find_touchdown(log, aircraft)
    verdict = judge(log, scenario, aircraft, end, touchdown, detail)
    n = log["time_s"].size
    stop = None
    if end == "stopped" and n:
        stop = {
            "x_m": float(log["body_x_m"][-1]),
            "y_m": float(log["body_y_m"][-1]),
            "time_s": float(log["time_s"][-1]),
        }
    box = box_limits(touchdown, None if stop is None else stop["y_m"], verdict.outcome, scenario.box)
    if scenario.simulation.end == "touchdown":
        del box["stop_cross_max_m"]
    rows, end_row = np.arange(n), min(n if touchdown is None else touchdown.row, _given_up_row(log))
    flown = log["body_x_m"] >= BEGIN
    airborne = flown & (rows < end_row)
    deviations = tracking_errors(log, scenario.approach.glide_slope_deg, scenario.approach.aim_point_m)
    return {
        "scenario": scenario.name,
        "seed": seed,
        "outcome": verdict.outcome,
        "reason": verdict.reason,
        "start": dict(start or {}),
        "in_box": all(limit["ok"] for limit in box.values()),
        "box": box,
        "touchdown": None if touchdown is None else _touchdown_dict(touchdown),
        "bounces": count_bounces(log),
        "stop": stop,
        "tracking": {
            **{name: _summary(values[airborne]) for name, values in deviations.items()},
            "glide_slope_to_flare_m": _summary(deviations["glide_slope_m"][flown & (rows < flare_row(log, touchdown))]),
        },
        "navigation": navigation_errors(log, end_row),
        "consistency": consistency(log, touchdown),
        "coverage": coverage(log, touchdown),
        "integrity": integrity(
            log,
            n if touchdown is None else touchdown.row,
            scenario.go_around.decision_height_m,
            scenario.go_around.commit_height_m,
            wrong=scenario.fault.kind == "wrong",
        ),
        "end": end,
        "flight_time_s": float(log["time_s"][-1]) if n else 0.0,
        "wall_time_s": wall_time_s,
        "versions": dict(versions),
    }


def _navigation_then(log: Log, row: int) -> str:
    """What there is to say of navigation at a row in which the flight failed."""
    if not np.isfinite(log["fused_along_m"][: row + 1]).any():
        seen = int(np.sum(np.isfinite(log["vision_along_m"][: row + 1])))
        return f"; navigation never started, with {seen} usable frames"
    believed = np.flatnonzero(log["accepted"][: row + 1] == 1.0)
    since = float(log["time_s"][row] - log["time_s"][believed[-1]]) if believed.size else float(log["time_s"][row])
    return f"; navigation had believed no frame for {since:.1f} s" if since > COASTING_S else ""


def _contact_faults(
    log: Log, scenario: "Scenario", aircraft: "AircraftConfig", touchdown: Touchdown | None
) -> list[tuple[int, Verdict]]:
    """What went wrong at the wheels, each with its row; the earliest row, then the first in the list, decides."""
    faults: list[tuple[int, Verdict]] = []
    nose = np.flatnonzero(log["wow_nose"] > 0.0)
    if nose.size and (touchdown is None or nose[0] <= touchdown.row):
        faults.append((int(nose[0]), Verdict("crashed", "the nose wheel touched first")))
    if touchdown is None:
        return faults
    limit = aircraft.gear.sink_limit_mps
    if touchdown.sink_rate > limit:
        text = f"sink rate {touchdown.sink_rate:.2f} m/s at touchdown, the gear bears {limit:g} m/s"
        faults.append((touchdown.row, Verdict("crashed", text)))
    x, y = main_wheels(log, aircraft, slice(touchdown.row, None))
    on_it = (x >= 0.0) & (x <= scenario.runway.length_m) & (np.abs(y) <= 0.5 * scenario.runway.width_m)
    # a wheel that touched while the aircraft was going around says nothing of where it flies afterwards
    climbing = (log["phase"] == Phase.GO_AROUND) & ~_on_mains(log)
    off = np.flatnonzero(~(on_it | climbing[touchdown.row :]))
    if off.size:
        first = int(off[0])
        what = "touched down" if first == 0 else "rolled"
        text = f"{what} off the runway, at {x[first]:.1f} m along, {y[first]:+.1f} m across"
        faults.append((touchdown.row + first, Verdict("off_runway", text)))
    return faults


def _touchdown_dict(touchdown: Touchdown) -> dict[str, float]:
    return {
        "x_m": touchdown.x,
        "y_m": touchdown.y,
        "sink_rate_mps": touchdown.sink_rate,
        "ground_speed_mps": touchdown.ground_speed,
        "pitch_deg": touchdown.pitch_deg,
        "bank_deg": touchdown.bank_deg,
        "heading_error_deg": touchdown.heading_error_deg,
        "time_s": touchdown.time,
    }


def _on_mains(log: Log) -> NDArray[np.bool_]:
    return np.asarray((log["wow_left"] > 0.0) | (log["wow_right"] > 0.0))


def _finite(values: ArrayLike) -> Array:
    array: Array = np.asarray(values, dtype=float)
    return array[np.isfinite(array)]


def _mean(values: ArrayLike) -> float | None:
    finite = _finite(values)
    return float(np.mean(finite)) if finite.size else None


def _summary(values: ArrayLike) -> dict[str, Any]:
    return {"rms": rms(values), "p95": p95(values)}
