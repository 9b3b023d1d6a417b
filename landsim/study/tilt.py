"""What tilting the camera buys: errors against its pitch, from 0 to 20° down, at several places of the approach.

The paper says that without tilt the vanishing point of the edges runs to infinity as the aircraft nears the runway, and
that a camera pitched further down cures it.  A direction's image does not depend on where the camera is: with a camera
pitched down by τ and not yawed the point lies f tan τ above the principal point, at any range, and tilting moves it
away.  Nor would a point at infinity matter, since the direction is taken from the cross product of the edges' planes.
What tilting does is to choose which part of the runway is in the image.  About its centre a camera may turn without any
line being seen anew, so that errors change with the length of what is seen, by the share of the roll axis in the yaw,
and hardly else.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import NDArray

from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.so3 import Array
from landsim.config import Scenario
from landsim.sensors import camera_of
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.envelope import child, first_order, percentiles
from landsim.study.frames import LINES_OF_STAGE, Frames, at_distances
from landsim.study.model import OF_STAGE, QUANTITIES, READINGS, Reading, StageName
from landsim.study.words import as_text, between, listed
from landsim.units import DEG

PITCHES_DEG = tuple(float(p) for p in range(21))
"""Camera pitch, down positive, deg."""
EARLY_RANGES_M = (800.0, 400.0, 200.0, 100.0)
LATE_HEIGHTS_M = (8.0, 6.0, 4.0, 2.0)
LEVELS = (68.27, 95.0)
NAMES = {LEFT: "left edge", THRESHOLD: "threshold", RIGHT: "right edge"}


def tilt(
    scenario: Scenario,
    seed: SeedSequence,
    *,
    pitches_deg: Sequence[float] = PITCHES_DEG,
    early_ranges_m: Sequence[float] = EARLY_RANGES_M,
    late_heights_m: Sequence[float] = LATE_HEIGHTS_M,
    draws: int = 1000,
    progress: Callable[[], None] | None = None,
) -> dict[str, Any]:
    """Errors of every quantity against the camera's pitch.

    Parameters
    ----------
    scenario : Scenario
        A study, whose straight path is taken.
    seed : SeedSequence
        It is not changed.  Every pitch draws the same numbers, so that curves are smooth in it.
    pitches_deg : sequence of float
        Down positive.
    early_ranges_m : sequence of float
        Distances to the threshold for the three-line pose.
    late_heights_m : sequence of float
        Camera heights on the same path for the two-line pose, with the true roll.
    draws : int
        For each pitch, place and reading.
    progress : callable, optional
        Called after each place and reading.

    Returns
    -------
    dict
        ``pitch_down_deg``; ``vanishing_point_px`` above the principal point and ``vanishing_point_in_image``;
        ``threshold_from_m`` and ``threshold_until_m``, the greatest and the least distance at which the threshold and
        both edges are seen; for each stage ``range_m``, ``height_m``, ``reason`` (place × pitch; None where all lines
        are seen) and for each reading and quantity ``p68``, ``p95`` and ``first_order`` (place × pitch, deg or m, NaN
        where a line is not seen); ``text``.
    """
    if scenario.study is None:
        raise ValueError(f"{scenario.name}: not a study")
    camera = camera_of(scenario.camera)
    pitches = [-p * DEG for p in pitches_deg]
    above = [camera.fy * math.tan(-p) for p in pitches]
    in_view = [_threshold_in_view(scenario, p) for p in pitches]
    heights, distances = _reached(scenario, late_heights_m)
    result: dict[str, Any] = {
        "pitch_down_deg": list(pitches_deg),
        "levels_percent": list(LEVELS),
        "draws": draws,
        "vanishing_point_px": above,
        "vanishing_point_in_image": [-0.5 <= camera.cy - v <= camera.height - 0.5 for v in above],
        "threshold_from_m": [far for far, _ in in_view],
        "threshold_until_m": [near for _, near in in_view],
        "early": _stage(scenario, "early", early_ranges_m, pitches, draws, child(seed, 0), progress),
        "late": _stage(scenario, "late", distances, pitches, draws, child(seed, 1), progress),
        "late_heights_not_reached_m": [h for h in late_heights_m if h not in heights],
    }
    return {**result, "text": _text(result, -scenario.study.pitch_early_deg, -scenario.study.pitch_late_deg)}


def _reached(scenario: Scenario, heights: Sequence[float]) -> tuple[list[float], list[float]]:
    """Those camera heights that the straight path passes over the runway's near half, and the distances there, m."""
    ends = at_distances(scenario, "late", (-scenario.start.along_m, 0.0))
    fall = (ends.height[0] - ends.height[1]) / ends.distance[0]
    if fall <= 0.0:
        return [], []
    pairs = [(h, (h - float(ends.height[1])) / fall) for h in heights]
    reached = [(h, d) for h, d in pairs if -0.5 * scenario.runway.length_m < d <= -scenario.start.along_m]
    return [h for h, _ in reached], [d for _, d in reached]


def _threshold_in_view(scenario: Scenario, pitch: float) -> tuple[float, float]:
    """Greatest and least distance, m, at which all lines of the early stage are seen; NaN if they never are."""
    first = -scenario.start.along_m

    def seen(distances: Array) -> NDArray[np.bool_]:
        return np.asarray(at_distances(scenario, "early", distances, pitch).seen(), dtype=bool)

    grid = np.geomspace(first, 0.5, 120)
    there = np.flatnonzero(seen(grid))
    if not there.size:
        return math.nan, math.nan
    return (
        _edge(seen, grid, int(there[0]), -1),
        _edge(seen, grid, int(there[-1]), 1),
    )


def _edge(seen: Callable[[Array], NDArray[np.bool_]], grid: Array, last: int, step: int) -> float:
    """The distance at which it begins or ends to be seen, between a point of the grid and the next that is not."""
    if not 0 <= last + step < grid.size:
        return float(grid[last])
    inside, outside = float(grid[last]), float(grid[last + step])
    for _ in range(30):
        middle = 0.5 * (inside + outside)
        if seen(np.array([middle]))[0]:
            inside = middle
        else:
            outside = middle
    return inside


def _stage(
    scenario: Scenario,
    stage: StageName,
    distances: Sequence[float],
    pitches: Sequence[float],
    draws: int,
    seed: SeedSequence,
    progress: Callable[[], None] | None,
) -> dict[str, Any]:
    """Errors of one stage: a table of place × pitch for each reading and quantity."""
    by_pitch = [at_distances(scenario, stage, distances, pitch) for pitch in pitches]
    places = by_pitch[0] if by_pitch else at_distances(scenario, stage, distances)
    result: dict[str, Any] = {
        "range_m": places.distance.tolist(),
        "height_m": places.height.tolist(),
        "reason": [[_reason(frames, i) for frames in by_pitch] for i in range(len(distances))],
    }
    for r, reading in enumerate(READINGS):
        spread = np.stack(
            [_row(scenario, by_pitch, i, reading, draws, child(seed, r, i), progress) for i in range(len(distances))]
            or [np.empty((0, len(OF_STAGE[stage]), len(LEVELS)))]
        )
        settings = scenario.camera
        sigma = np.stack(
            [
                first_order(
                    camera_of(settings),
                    frames,
                    reading,
                    settings.point_spacing_px,
                    settings.noise_px,
                    scenario.runway.width_m,
                )
                for frames in by_pitch
            ],
            axis=1,
        )
        result[reading] = {}
        for k, name in enumerate(OF_STAGE[stage]):
            q = QUANTITIES[name]
            result[reading][f"{name}_{q.unit}"] = {
                "p68": (spread[..., k, 0] / q.scale).tolist(),
                "p95": (spread[..., k, 1] / q.scale).tolist(),
                "first_order": (sigma[..., k] / q.scale).tolist(),
            }
    return result


def _reason(frames: Frames, i: int) -> str | None:
    """Why there is no pose at a frame: the lines that are not seen."""
    missing = [NAMES[line] for line in LINES_OF_STAGE[frames.stage] if not np.isfinite(frames.ends[i, line]).all()]
    return f"{listed(missing)} not in the image" if missing else None


def _row(
    scenario: Scenario,
    by_pitch: Sequence[Frames],
    i: int,
    reading: Reading,
    draws: int,
    seed: SeedSequence,
    progress: Callable[[], None] | None,
) -> Array:
    """Percentiles (pitches, k, levels) of the absolute errors at one place."""
    settings, camera = scenario.camera, camera_of(scenario.camera)
    row = np.full((len(by_pitch), len(OF_STAGE[by_pitch[0].stage]), len(LEVELS)), np.nan)
    for p, frames in enumerate(by_pitch):
        if frames.seen()[i]:
            which = LINES_OF_STAGE[frames.stage]
            fits = draw_lines(
                frames.ends[i],
                which,
                reading,
                settings.point_spacing_px,
                settings.noise_px,
                draws,
                default_rng(seed),
            )
            errors = pose_errors(camera, frames, i, fits, scenario.runway.width_m)
            row[p] = percentiles(errors, LEVELS)
    if progress is not None:
        progress()
    return row


def _text(result: dict[str, Any], early_deg: float, late_deg: float) -> str:
    """The paragraph that the numbers make."""
    pitches = result["pitch_down_deg"]
    level, early, late = (_nearest(pitches, p) for p in (0.0, early_deg, late_deg))
    points, until, far = (result[key] for key in ("vanishing_point_px", "threshold_until_m", "threshold_from_m"))
    chosen = sorted({level, early, late}, key=lambda i: pitches[i])
    shown = [f"{points[i]:.0f} px at {pitches[i]:g}°" for i in chosen]
    parts: list[str] = []
    parts.append(
        "The paper says that pitching the camera down cures a vanishing point that runs to infinity near the runway. "
        f"At every range it is {listed(shown)} above the principal point: tilting moves it away, and the pose does "
        "not need its coordinates."
    )
    out = [p for p, inside in zip(pitches, result["vanishing_point_in_image"], strict=True) if not inside]
    if out:
        parts.append(f"From {out[0]:g}° on it is outside the image.")
    held = [i for i in chosen if math.isfinite(until[i])]
    if held:
        parts.append(
            "What tilt buys is sight of the runway's near end: all three lines are seen until "
            f"{listed([f'{until[i]:.0f} m at {pitches[i]:g}°' for i in held])}."
        )
    start = np.nanmax(far) if np.isfinite(far).any() else math.nan
    late_seen = [i for i in range(len(pitches)) if not far[i] >= start]
    if late_seen and math.isfinite(start):
        i = late_seen[0]
        seen = f"are seen only from {far[i]:.0f} m on" if math.isfinite(far[i]) else "are never seen"
        parts.append(f"What it costs is the far end: at {pitches[i]:g}° they {seen}, and not from {start:.0f} m.")
    for stage, base, words in (("early", early, "three-line"), ("late", level, "two-line")):
        change = _change(result[stage], base, late)
        if change and base != late:
            parts.append(
                f"The {words} pose errs at {pitches[late]:g}°, over what it errs at {pitches[base]:g}° in the same "
                f"places, to first order by a factor of {listed(change)}."
            )
        steep = _steepest(result[stage])
        if steep is not None and steep > late and change:
            name, factor = _worst(result[stage], base, steep)
            parts.append(
                f"At {pitches[steep]:g}°, the steepest at which its lines are seen from all of these places"
                f"{'' if result['vanishing_point_in_image'][steep] else ' and with the horizon out of the image'}, its "
                f"{name} errs {factor:.1f} times as much."
            )
    if early != late:
        parts.append(
            "The yaw of a camera pitched down by τ takes up sin τ of the roll's error, since it is counted about the "
            "vertical and roll about the optical axis; the position has no share in that."
        )
    return " ".join(parts)


def _nearest(pitches: Sequence[float], wanted: float) -> int:
    return int(np.argmin(np.abs(np.asarray(pitches) - wanted)))


def _ratios(stage: dict[str, Any], base: int, other: int) -> dict[str, list[float]]:
    """For each quantity the ratios of its first-order errors at two pitches, over readings and places."""
    result: dict[str, list[float]] = {}
    for key in stage[READINGS[0]]:
        tables = [np.asarray(stage[reading][key]["first_order"], float) for reading in READINGS]
        with np.errstate(divide="ignore", invalid="ignore"):
            parts = [table[:, other] / table[:, base] for table in tables if table.size]
        ratios = np.concatenate(parts or [np.empty(0)])
        result[as_text(key)] = ratios[np.isfinite(ratios)].tolist()
    return {name: ratios for name, ratios in result.items() if ratios}


def _change(stage: dict[str, Any], base: int, other: int) -> list[str]:
    """For each quantity the least and the greatest of its ratios."""
    return [f"{name} {between(ratios)}" for name, ratios in _ratios(stage, base, other).items()]


def _worst(stage: dict[str, Any], base: int, other: int) -> tuple[str, float]:
    """The quantity with the greatest ratio, and that ratio."""
    greatest = {name: max(ratios) for name, ratios in _ratios(stage, base, other).items()}
    name = max(greatest, key=lambda n: greatest[n])
    return name, greatest[name]


def _steepest(stage: dict[str, Any]) -> int | None:
    """The steepest pitch at which the lines of a stage are seen from all of its places."""
    seen = [all(reasons[p] is None for reasons in stage["reason"]) for p in range(len((stage["reason"] or [[]])[0]))]
    return max((p for p, there in enumerate(seen) if there), default=None)
