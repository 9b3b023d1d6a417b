"""Lines against corner points of the same images, and against another solver of the same lines.

The corner points are those ends of the visible lines that are corners of the runway: both of the threshold, and both of
the far end.  OpenCV's solvers take them with the runway's width and its length; the lines are told the width alone.
What each is given comes from one set of noisy points:

``ends``
    The noisy end points themselves.  A corner of the threshold ends two lines and is the mean of both its points.
``fitted``
    With more than two points a line: the corners of the threshold where the fitted lines cross, and the far end points
    brought onto their fitted edges.

A solver's pose is the first of its solutions, by its own order, with a camera above the runway that lies in front and
ahead, which is what the lines' own solver asks for; without one it has failed, and that error counts as infinitely
large.  Four corners are eight numbers for six unknowns: ``AP3P, refined`` is the least-squares pose, by OpenCV's
iterative solver from the pose of AP3P, and so about the best that these points can give.  ``ITERATIVE`` alone starts
from a homography, which four corners of a runway, sixty times as long as wide, fix badly.

OpenCV and poselib are extras (``pip install landsim[peers]``); without them that part says so.
"""

import importlib
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.random import SeedSequence, default_rng

from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.lines import fit_line
from estimator.so3 import Array
from estimator.three_line import three_line_pose
from landsim.config import Scenario
from landsim.scene import runway_of
from landsim.sensors import camera_of
from landsim.study.draws import draw_points
from landsim.study.envelope import child
from landsim.study.frames import Frames, at_distances
from landsim.study.model import READINGS, Reading
from landsim.study.solvers import (
    REFINED,
    SOLVERS,
    Clock,
    Lines,
    Scene,
    by_p3ll,
    by_points,
    corners_are_seen,
    corners_of_ends,
    corners_of_fits,
    level68,
    timed,
)
from landsim.study.translations import COMPARED
from landsim.study.words import as_text, between, listed

DRAWS = 500
"""At most: OpenCV takes some tens of microseconds a solution."""


def peers(
    scenario: Scenario,
    seed: SeedSequence,
    *,
    distances: Sequence[float] | None = None,
    draws: int = 500,
    clock: Clock = time.perf_counter,
    progress: Callable[[], None] | None = None,
) -> dict[str, Any]:
    """Errors and time of other solvers, beside those of the three lines.

    Parameters
    ----------
    scenario : Scenario
        A study.
    seed : SeedSequence
        It is not changed.
    distances : sequence of float, optional
        To the threshold, m; without it, those of ``study.ranges_m`` from which all lines are seen early, or `COMPARED`
        if there are none.
    draws : int
        For each distance and reading; every solver is given the same, or the first of them, see `SOLVERS`.
    clock : callable
        s, for the time a frame.
    progress : callable, optional
        Called after each distance and reading.

    Returns
    -------
    dict
        ``installed`` (versions, None for what is not), ``points`` (a list: reading, range, corners, solver, ``draws``,
        ``p68`` of each quantity, ``ratio`` of it to the lines' on the same draws, ``failures``,
        ``solves_without_noise``, ``time_us``), ``lines`` (the same of the three lines), ``p3ll`` (agreement, failures
        and time), ``omitted`` with reasons, and ``text``.  An infinite percentile means that more than 31.73 % failed.
    """
    if scenario.study is None:
        raise ValueError(f"{scenario.name}: not a study")
    cv2, poselib = _installed("cv2"), _installed("poselib")
    camera, runway = camera_of(scenario.camera), runway_of(scenario)
    if distances is None:
        listed_ranges = np.array(scenario.study.ranges_m)
        distances = listed_ranges[at_distances(scenario, "early", listed_ranges).seen()].tolist() or COMPARED
    frames = at_distances(scenario, "early", distances)
    seen = frames.seen()
    result: dict[str, Any] = {
        "installed": {"cv2": _version(cv2), "poselib": _version(poselib)},
        "draws": draws,
        "known_to_points": {"width_m": runway.width, "length_m": runway.length},
        "known_to_lines": {"width_m": runway.width},
        "lines": [],
        "points": [],
        "p3ll": [],
        "omitted": [
            {"part": part, "reason": f"{name} is not installed"}
            for part, name, module in (("points", "cv2", cv2), ("p3ll", "poselib", poselib))
            if module is None
        ],
    }
    for r, reading in enumerate(READINGS):
        for i, distance in enumerate(distances):
            place = {"reading": reading, "range_m": float(distance)}
            if seen[i]:
                scene = Scene(camera, runway, frames.position[i], frames.R_cam_from_runway[i], frames.ends[i])
                points = _drawn(scenario, frames, i, reading, draws, child(seed, r, i))
                _at(result, place, scene, points, cv2, poselib, clock)
            else:
                result["omitted"].append({**place, "part": "all", "reason": "not all lines are in the image"})
            if progress is not None:
                progress()
    return {**result, "text": _text(result)}


def _installed(name: str) -> Any:
    """A module, or None."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def _version(module: Any) -> str | None:
    return None if module is None else str(getattr(module, "__version__", "unknown"))


def _drawn(
    scenario: Scenario, frames: Frames, i: int, reading: Reading, draws: int, seed: SeedSequence
) -> dict[int, Array]:
    """Noisy points (draws, N, 2) of each line of a frame, px."""
    settings, rng = scenario.camera, default_rng(seed)
    return {
        line: draw_points(frames.ends[i, line], reading, settings.point_spacing_px, settings.noise_px, draws, rng)
        for line in (LEFT, THRESHOLD, RIGHT)
    }


def _at(
    result: dict[str, Any],
    place: dict[str, Any],
    scene: Scene,
    points: dict[int, Array],
    cv2: Any,
    poselib: Any,
    clock: Clock,
) -> None:
    """Add what every solver makes of one frame's draws."""
    camera, width = scene.camera, scene.runway.width
    fits = {line: fit_line(there) for line, there in points.items()}
    pose = three_line_pose(camera, fits[LEFT].line, fits[THRESHOLD].line, fits[RIGHT].line, runway_width=width)
    ours = pose.position, pose.R_cam_from_runway
    lines = list(zip(fits[LEFT].line, fits[THRESHOLD].line, fits[RIGHT].line, strict=True))

    def by_lines(three: Lines) -> object:
        return three_line_pose(camera, *three, runway_width=width)

    _, time_us = timed(by_lines, lines[: max(1, len(lines) // 4)], clock)
    result["lines"].append(
        {**place, "p68": level68(ours, scene), "failures": int((~pose.valid).sum()), "time_us": time_us}
    )
    if cv2 is not None and not corners_are_seen(scene):
        result["omitted"].append(
            {**place, "part": "points", "reason": "not all four corners of the runway are in the image"}
        )
    elif cv2 is not None:
        sets = {"ends": corners_of_ends(points)}
        if place["reading"] == "edge-points":
            sets["fitted"] = corners_of_fits(points, fits)
        result["points"] += [
            {**place, "corners": name, **by_points(cv2, solver, scene, corners[:most], ours, clock)}
            for name, corners in sets.items()
            for solver, most in SOLVERS.items()
        ]
    if poselib is not None:
        result["p3ll"].append({**place, **by_p3ll(poselib, scene, lines, ours, clock)})


def _text(result: dict[str, Any]) -> str:
    """The paragraph that the numbers make."""
    parts = []
    if result["points"]:
        parts.append(
            f"Corner points are given the runway's length, {result['known_to_points']['length_m']:g} m, besides its "
            "width, and use where along a line its ends lie; the lines keep of their points what is across them, and "
            "the width."
        )
        parts += [_against_lines(result["points"], reading) for reading in READINGS]
        parts.append(_others(result["points"]))
    for omitted in result["omitted"]:
        if "range_m" not in omitted:
            parts.append(f"{omitted['reason'].capitalize()}: that comparison is left out.")
    if result["p3ll"]:
        both, same = (sum(entry[key] for entry in result["p3ll"]) for key in ("solved_by_both", "same"))
        ours, theirs = (sum(entry[key] for entry in result["p3ll"]) for key in ("only_ours", "only_theirs"))
        parts.append(
            f"Of the same three lines poselib's p3ll makes the same pose in {same} of {both} draws; in {ours} only the "
            f"closed form has one, in {theirs} only p3ll."
        )
    return " ".join(part for part in parts if part)


def _against_lines(entries: list[dict[str, Any]], reading: Reading) -> str:
    """The least-squares pose of the best corner points beside the lines, over the ranges."""
    of_reading = [e for e in entries if e["reading"] == reading and e["solver"] == REFINED]
    best = [e for e in of_reading if e["corners"] == "fitted"] or of_reading
    if not best:
        return ""
    ratios = {key: [e["ratio"][key] for e in best if math.isfinite(e["ratio"][key])] for key in best[0]["ratio"]}
    spans = [f"{as_text(key)} {between(values)}" for key, values in ratios.items() if values]
    known = [ratio for values in ratios.values() for ratio in values]
    if not known:
        return ""
    fewer = sum(ratio < 1.0 for ratio in known)
    source = "the fitted lines' corners" if best[0]["corners"] == "fitted" else "the end points"
    return (
        f"With {reading}, the least-squares pose of {source} errs, over that of the lines (68 %, ranges from "
        f"{max(e['range_m'] for e in best):g} to {min(e['range_m'] for e in best):g} m), by a factor of "
        f"{listed(spans)}: less than the lines in {fewer} of {len(known)} cases."
    )


def _others(entries: list[dict[str, Any]]) -> str:
    """How the solvers as they are fare: failures, and their worst ratio."""
    words = []
    for solver in SOLVERS:
        of_solver = [e for e in entries if e["solver"] == solver]
        if of_solver and solver != REFINED:
            failed = sum(e["failures"] for e in of_solver) / sum(e["draws"] for e in of_solver)
            time_us = float(np.median([e["time_us"] for e in of_solver]))
            wrong = "" if all(e["solves_without_noise"] for e in of_solver) else ", and is wrong without noise"
            words.append(f"{solver} fails in {failed:.0%}{wrong} ({time_us:.0f} µs)")
    return f"OpenCV's solvers by themselves: {listed(words)}." if words else ""
