"""Two ways from lines and a rotation to a position: the coplanarity of three lines, and a single point.

The paper takes T from the coplanarity of each line with its image and not from one point, T = P^c - R P, since lines
are steadier than points.  With R from the same three lines the two are the same position: three lines are six numbers
for six unknowns, both forms reproduce the pose that they fix.  They differ where R comes from elsewhere.

What a wrong attitude does, without noise
-----------------------------------------
Let ψ be the rotation vector, runway frame, by which the given attitude is turned too far (estimate less truth), M a
point and C the camera.  A single point in the camera frame stays where it was measured, so the camera swings about it:

    dC = -ψ × (M - C).

Coplanarity asks N_i · dC = -N_i · (ψ × (P_i - C)) of three lines at points P_i: left corner, middle and right corner of
the threshold.  "Any point of the line" will do only as long as R agrees with the lines.  With h the camera's height, x
and y its place, L the width and M the middle of the threshold, the three equations give

    dC = -ψ × (M - C) + ψ_x (-x y / h, (L²/4 - y²) / h, y),

that of the middle point and, by the roll about the runway's axis alone, a lateral shift: a roll that lifts one corner
and lowers the other is taken for a camera to one side.  It grows as the camera sinks.  The corner P_2 = (0, -L/2, 0)
swings with its own lever,

    dC = -ψ × (M - C) + (L/2) (-ψ_z, 0, ψ_x),

which puts the same roll into the altitude.  What yaw and pitch do across the line of sight, range times angle, is in
all three.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from numpy.typing import ArrayLike, NDArray

from estimator.camera import Number, PinholeCamera
from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.so3 import Array
from estimator.three_line import coplanarity_position, single_point_position, three_line_pose
from landsim.config import Scenario
from landsim.sensors import camera_of
from landsim.study.draws import draw_lines
from landsim.study.envelope import child
from landsim.study.frames import Frames, at_distances
from landsim.study.model import READINGS, Reading
from landsim.study.words import as_text, between, listed
from landsim.units import DEG

FORMS = ("coplanarity", "corner", "middle")
"""The three lines; the left corner of the threshold, which is the paper's P_2; the middle of the threshold, which is
the mean of both corners and so no single measured point, but as simple."""
AXES = ("along_m", "cross_m", "altitude_m", "position_m")
SAME = 1e-9
"""Relative difference below which two positions are the same."""
COMPARED = (1000.0, 400.0, 100.0)
"""Distances at which the forms are compared, m."""
EQUAL = 0.02
"""Relative difference of two root mean squares below which neither form is called better."""

Axes = tuple[tuple[Number, Number, Number], ...]
AttitudeErrors = Mapping[tuple[Reading, float], Array]
"""Roll, pitch and yaw errors (m, 3) of a filter, rad, by noise reading and distance."""


class Planes(NamedTuple):
    """Unit normals, camera frame, of the planes of noisy lines, and the pose that the lines themselves give."""

    n1: tuple[Array, ...]
    n2: tuple[Array, ...]
    n3: tuple[Array, ...]
    yaw: Array
    pitch: Array
    roll: Array
    axes: Axes
    """Columns of R_cam_from_runway."""
    valid: NDArray[np.bool_]


def triad_axes(yaw: Number, pitch: Number, roll: Number) -> Axes:
    """Columns of R_cam_from_runway, three components each, of a triad's angles (rad)."""
    sy, cy, sp, cp, sr, cr = np.sin(yaw), np.cos(yaw), np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)
    # rows are the triad's right, down, forward
    return (
        (cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, cy * cp),
        (sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, sy * cp),
        (cp * sr, cp * cr, -sp),
    )


def planes_of(camera: PinholeCamera, lines: Sequence[Array], width: float) -> Planes:
    """Planes and pose of left edge, threshold and right edge, (draws, 3) each."""
    normals = []
    for line in lines:
        normal = np.stack(camera.plane_normal(line[:, 0], line[:, 1], line[:, 2]))
        normals.append(tuple(normal / np.linalg.norm(normal, axis=0)))
    pose = three_line_pose(camera, *lines, runway_width=width)
    R = pose.R_cam_from_runway
    columns = tuple((R[:, 0, j], R[:, 1, j], R[:, 2, j]) for j in range(3))
    return Planes(normals[0], normals[1], normals[2], pose.yaw, pose.pitch, pose.roll, columns, pose.valid)


def positions(planes: Planes, axes: Axes, width: float) -> dict[str, Array]:
    """Camera positions (draws, 3), runway frame, m, by each of `FORMS` with a rotation's columns."""
    n1, n2, n3 = planes.n1, planes.n2, planes.n3
    d, e, n = axes
    with np.errstate(all="ignore"):
        lines = coplanarity_position(n1, n2, n3, d, e, n, width)
        left = single_point_position(n1, n2, n3, d, e, n, width)
        # the other corner is the same formula in the mirror
        x, y, z = single_point_position(n3, n2, n1, d, tuple(-c for c in e), n, width)
    found = [np.stack(np.broadcast_arrays(*p), axis=-1) for p in (lines, left, (x, -y, z))]
    return dict(zip(FORMS, (found[0], found[1], 0.5 * (found[1] + found[2])), strict=True))


def shifts(position: ArrayLike, psi: ArrayLike, width: float) -> dict[str, Array]:
    """What an attitude error does to each form to first order, without noise.

    Parameters
    ----------
    position : (3,) array_like
        Of the camera, runway frame, m.
    psi : (3,) array_like
        Rotation vector by which the attitude is turned too far, runway frame, rad.
    width : float
        m.

    Returns
    -------
    dict of (3,) array
        Estimated less true position, m.
    """
    centre, turn = np.asarray(position, float), np.asarray(psi, float)
    (x, y, z), (px, _, pz) = centre.tolist(), turn.tolist()
    middle = np.cross(turn, centre)
    h = -z
    return {
        "coplanarity": middle + px * np.array((-x * y / h, (0.25 * width * width - y * y) / h, y)),
        "corner": middle + 0.5 * width * np.array((-pz, 0.0, px)),
        "middle": middle,
    }


def translations(
    scenario: Scenario,
    seed: SeedSequence,
    attitude_errors: AttitudeErrors | None = None,
    *,
    roll_error: float = 0.5 * DEG,
    compared: Sequence[float] = COMPARED,
    draws: int = 20_000,
) -> dict[str, Any]:
    """Both ways to a position: that they agree with the lines' own rotation, and which errs less with another.

    Parameters
    ----------
    scenario : Scenario
        A study.  Agreement is taken at those of ``study.ranges_m`` and `compared` from which all lines are seen early.
    seed : SeedSequence
        It is not changed.
    attitude_errors : mapping of (reading, distance) to (m, 3) array, optional
        Roll, pitch and yaw errors of a filter, rad, from flights; each draw of the lines takes one of them at random,
        as if a filter's error did not depend on the noise of the present frame.
    roll_error : float
        rad, about the optical axis.
    compared : sequence of float
        Distances to the threshold, m.
    draws : int
        For each distance and reading.

    Returns
    -------
    dict
        ``same_rotation``, ``other_rotation`` (a list of root mean square errors and their ratios, coplanarity over the
        corner's and over the middle's), ``omitted`` (a list, with reasons), ``shift_of_roll_error`` and ``text``.
    """
    if scenario.study is None:
        raise ValueError(f"{scenario.name}: not a study")
    camera, width = camera_of(scenario.camera), scenario.runway.width_m
    distances = sorted({*scenario.study.ranges_m, *compared}, reverse=True)
    frames = at_distances(scenario, "early", distances)
    seen = frames.seen()
    same, other, omitted = [], [], []
    for r, reading in enumerate(READINGS):
        for i, distance in enumerate(distances):
            if not seen[i]:
                if distance in compared:
                    omitted.append(
                        {"reading": reading, "range_m": distance, "reason": "not all lines are in the image"}
                    )
                continue
            rng = default_rng(child(seed, r, i))
            planes = _drawn(scenario, camera, frames, i, reading, draws, rng)
            same.append({"reading": reading, "range_m": distance, **_agreement(planes, frames.position[i], width)})
            if distance not in compared:
                continue
            errors = None if attitude_errors is None else attitude_errors.get((reading, distance))
            for name, axes in _rotations(planes, float(frames.pitch[i]), roll_error, errors, rng):
                if axes is None:
                    reason = "no flights gave attitude errors" if errors is None else "there is no attitude error"
                    omitted.append({"reading": reading, "range_m": distance, "rotation": name, "reason": reason})
                    continue
                entry = _compared(positions(planes, axes, width), frames.position[i], planes.valid)
                other.append({"reading": reading, "range_m": distance, "rotation": name, **entry})
    largest = max((s["largest_relative_difference"] for s in same), default=math.nan)
    result = {
        "corner": "left corner of the threshold, P_2",
        "roll_error_deg": roll_error / DEG,
        "same_rotation": {
            "largest_relative_difference": largest,
            "limit": SAME,
            "equal": bool(largest < SAME),
            "draws": draws,
            "at": same,
        },
        "other_rotation": other,
        "shift_of_roll_error": [_shift_entry(frames, distances.index(d), roll_error, width) for d in compared],
        "omitted": omitted,
    }
    return {**result, "text": _text(result)}


def _drawn(
    scenario: Scenario, camera: PinholeCamera, frames: Frames, i: int, reading: Reading, draws: int, rng: Generator
) -> Planes:
    settings = scenario.camera
    fits = draw_lines(
        frames.ends[i], (LEFT, THRESHOLD, RIGHT), reading, settings.point_spacing_px, settings.noise_px, draws, rng
    )
    return planes_of(camera, [fit.line for fit in fits], scenario.runway.width_m)


def _agreement(planes: Planes, true: Array, width: float) -> dict[str, Any]:
    """Largest distance between the forms, in parts of the distance to the threshold, with the lines' own rotation."""
    found = positions(planes, planes.axes, width)
    apart = [np.linalg.norm(found[form] - found["coplanarity"], axis=-1)[planes.valid] for form in FORMS[1:]]
    scale = float(np.linalg.norm(true))
    return {
        "largest_relative_difference": max((float(a.max()) / scale for a in apart if a.size), default=math.nan),
        "invalid": int((~planes.valid).sum()),
    }


def _rotations(
    planes: Planes, pitch: float, roll_error: float, errors: Array | None, rng: Generator
) -> list[tuple[str, Axes | None]]:
    """Rotations that are not the lines' own, by name; None for one that cannot be made."""
    n = planes.valid.size
    level = np.zeros(n)
    from_filter = None
    if errors is not None and len(errors):
        roll, pitched, yaw = np.asarray(errors, float)[rng.integers(len(errors), size=n)].T
        from_filter = triad_axes(yaw, pitch + pitched, roll)
    return [
        ("filter", from_filter),
        ("lines, roll off", triad_axes(planes.yaw, planes.pitch, planes.roll + roll_error)),
        ("true, roll off", triad_axes(level, level + pitch, level + roll_error)),
        ("true", triad_axes(level, level + pitch, level)),
    ]


def _compared(found: dict[str, Array], true: Array, valid: NDArray[np.bool_]) -> dict[str, Any]:
    """Root mean square errors of the forms over the draws that have a pose, their ratios, and which is smaller."""
    rms = {}
    for form, position in found.items():
        square = ((position - true)[valid] ** 2).mean(axis=0)
        along, cross, down = np.sqrt(square).tolist()
        rms[form] = dict(zip(AXES, (along, cross, down, math.sqrt(square.sum())), strict=True))
    ratio = {form: {axis: _quotient(rms["coplanarity"][axis], rms[form][axis]) for axis in AXES} for form in FORMS[1:]}
    return {
        "draws": int(valid.sum()),
        "invalid": int((~valid).sum()),
        "rms": rms,
        "ratio": ratio["corner"],
        "ratio_to_middle": ratio["middle"],
        "better": {axis: _better(ratio["corner"][axis]) for axis in AXES},
    }


def _quotient(one: float, other: float) -> float:
    return one / other if other > 0.0 else math.nan


def _better(ratio: float) -> str:
    """The form with the smaller error, of the coplanarity's error over the corner's."""
    return "neither" if not abs(ratio - 1.0) >= EQUAL else ("coplanarity" if ratio < 1.0 else "corner")


def _shift_entry(frames: Frames, i: int, roll_error: float, width: float) -> dict[str, Any]:
    """By how much the roll error alone moves each form, at one distance."""
    forward = frames.R_cam_from_runway[i, 2]
    moved = shifts(frames.position[i], roll_error * forward, width)
    return {
        "range_m": float(frames.distance[i]),
        **{
            form: dict(zip(AXES, (*(shift * (1.0, 1.0, -1.0)).tolist(), float(np.linalg.norm(shift))), strict=True))
            for form, shift in moved.items()
        },
    }


def _text(result: dict[str, Any]) -> str:
    """The paragraph that the numbers make."""
    same, other = result["same_rotation"], result["other_rotation"]
    if math.isnan(same["largest_relative_difference"]):
        return "Coplanarity and single point: the three lines are seen from none of the ranges."
    parts: list[str] = []
    parts.append(
        f"With the rotation of the same three lines, coplanarity and single point give "
        f"{'the same position' if same['equal'] else 'different positions'}: over {same['draws']} draws at each range "
        f"and reading they differ by at most {same['largest_relative_difference']:.0e} of the distance."
    )
    if other:
        ranges = sorted({f"{entry['range_m']:g}" for entry in other}, key=float, reverse=True)
        parts.append(
            f"With a rotation from elsewhere the rms error by coplanarity over that by the corner is, at "
            f"{listed(ranges)} m in either reading: {_ratios(other, result['roll_error_deg'])}."
        )
        for form, words in (("coplanarity", "the coplanarity"), ("corner", "the corner")):
            wins = [f"{as_text(axis)} in {_wins(other, axis, form)}" for axis in AXES if _wins(other, axis, form)]
            if wins:
                parts.append(f"Of the {len(other)} cases, {words} errs less by more than {EQUAL:.0%}: {listed(wins)}.")
    if all(entry["rotation"] != "filter" for entry in other):
        parts.append("No flight gave attitude errors of a filter, so that comparison is left out.")
    parts.append(
        "Either form swings the camera about the points that it holds, by range times angle; beyond that, a roll goes "
        "into the cross position by coplanarity, L²/(4h) a radian on the centreline, and into the altitude by the "
        "corner, L/2 a radian."
    )
    if result["shift_of_roll_error"]:
        near = min(result["shift_of_roll_error"], key=lambda entry: entry["range_m"])
        moved = [
            f"{words} by {abs(near[form]['cross_m']):.2f} m across and {abs(near[form]['altitude_m']):.2f} m in height"
            for form, words in (("coplanarity", "the coplanarity position"), ("corner", "the corner's"))
        ]
        parts.append(
            f"At {near['range_m']:g} m a roll error of {result['roll_error_deg']:g}° alone moves {listed(moved)}; the "
            f"middle of both corners is moved by {abs(near['middle']['cross_m']):.2f} m and "
            f"{abs(near['middle']['altitude_m']):.2f} m."
        )
    return " ".join(parts)


def _wins(entries: list[dict[str, Any]], axis: str, form: str) -> int:
    return sum(entry["better"][axis] == form for entry in entries)


def _ratios(entries: list[dict[str, Any]], roll_error_deg: float) -> str:
    """The smallest and the largest ratio for each rotation and axis, over ranges and readings."""
    words = []
    for rotation, name in (
        ("filter", "with the filter's attitude"),
        ("lines, roll off", f"with the lines' own, rolled by {roll_error_deg:g}°"),
        ("true, roll off", f"with the true one, rolled by {roll_error_deg:g}°"),
        ("true", "with the true one"),
    ):
        of_rotation = [entry["ratio"] for entry in entries if entry["rotation"] == rotation]
        if of_rotation:
            spans = [f"{as_text(axis)} {between([r[axis] for r in of_rotation])}" for axis in AXES]
            words.append(f"{name}, {listed(spans)}")
    return "; ".join(words)
