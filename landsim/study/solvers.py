"""Other solvers on one frame's noisy images: OpenCV's on corner points, poselib's on the same lines.

Errors, failures and time of each, beside the pose of the three lines.  The modules are handed in: both are extras.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from estimator.camera import PinholeCamera
from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.lines import LineFit
from estimator.so3 import Array
from estimator.three_line import angles
from landsim.runway import Runway
from landsim.study.envelope import percentiles
from landsim.study.model import OF_STAGE, QUANTITIES

REFINED = "AP3P, refined"
SOLVERS = {"AP3P": 500, REFINED: 500, "SQPNP": 250, "IPPE": 250, "ITERATIVE": 100, "EPNP": 100}
"""OpenCV's that take four points of a plane, by the names of its flags, and the most draws that each is given: those
that are slow, or never right, need few."""
NEAR_CORNER = 1e-6
"""An end is a corner if it is projected no further from it than this, px."""
SAME_POSITION, SAME_ATTITUDE = 1e-6, 1e-8
"""Relative difference of positions, and angle in rad, up to which p3ll gives the same pose."""

Pose = tuple[Array, Array]
"""Position (3,) in the runway frame and R_cam_from_runway (3, 3)."""
Poses = tuple[Array, Array]
"""Positions (n, 3) and rotations (n, 3, 3)."""
Lines = tuple[Array, Array, Array]
"""Left edge, threshold and right edge, (3,) each, px."""
Clock = Callable[[], float]


class Scene(NamedTuple):
    """One frame: what is true, and what is seen of it without noise."""

    camera: PinholeCamera
    runway: Runway
    position: Array
    rotation: Array
    """R_cam_from_runway."""
    ends: Array
    """(3, 4) px."""


def runway_corners(runway: Runway) -> Array:
    """Left and right corner of the threshold, then of the far end, (4, 3), runway frame, m."""
    (left, far_left), (right, far_right) = runway.left_edge, runway.right_edge
    return np.array((left, right, far_left, far_right))


def corners_are_seen(scene: Scene) -> bool:
    """Whether the ends of the visible edges are the corners of the runway."""
    in_cam = (runway_corners(scene.runway) - scene.position) @ scene.rotation.T
    left, right, far_left, far_right = scene.camera.project(in_cam)
    expected = np.stack((np.concatenate((left, far_left)), np.concatenate((right, far_right))))
    return bool(np.abs(scene.ends[[LEFT, RIGHT]] - expected).max() < NEAR_CORNER)


def corners_of_ends(points: dict[int, Array]) -> Array:
    """The four corners (draws, 4, 2), px, from the end points of the lines, in the order of `runway_corners`."""
    left, threshold, right = points[LEFT], points[THRESHOLD], points[RIGHT]
    return np.stack(
        (
            0.5 * (left[:, 0] + threshold[:, 0]),
            0.5 * (right[:, 0] + threshold[:, -1]),
            left[:, -1],
            right[:, -1],
        ),
        axis=1,
    )


def corners_of_fits(points: dict[int, Array], fits: dict[int, LineFit]) -> Array:
    """The four corners (draws, 4, 2), px: where the fitted lines cross, and far end points moved onto their edges."""
    found = []
    for line in (LEFT, RIGHT):
        a, b, c = np.moveaxis(np.cross(fits[line].line, fits[THRESHOLD].line), -1, 0)
        found.append(np.stack((a / c, b / c), axis=-1))
    for line in (LEFT, RIGHT):
        end, (a, b, c) = points[line][:, -1], np.moveaxis(fits[line].line, -1, 0)
        off = a * end[:, 0] + b * end[:, 1] + c
        found.append(end - off[:, None] * fits[line].line[:, :2])
    return np.stack(found, axis=1)


def level68(poses: Poses, scene: Scene) -> dict[str, float]:
    """68.27th percentile of each quantity's absolute error, deg and m."""
    position, rotation = poses
    turns = []
    for matrix in (rotation, scene.rotation):
        yaw, pitch, roll = angles(np, *([matrix[..., k, j] for k in range(3)] for j in range(3)))
        turns.append((roll, pitch, yaw))
    off = [(a - b + math.pi) % (2.0 * math.pi) - math.pi for a, b in zip(*turns, strict=True)]
    shift = position - scene.position
    errors = np.stack((*off, shift[:, 1], -shift[:, 2], shift[:, 0]), axis=-1)
    levels = percentiles(errors, (68.27,))[:, 0]
    return {
        f"{name}_{QUANTITIES[name].unit}": float(level / QUANTITIES[name].scale)
        for name, level in zip(OF_STAGE["early"], levels, strict=True)
    }


def timed(function: Callable[[Any], Any], inputs: Sequence[Any], clock: Clock) -> tuple[list[Any], float]:
    """What a function makes of each input, and the mean time of a call, µs."""
    start = clock()
    results = [function(one) for one in inputs]
    return results, 1e6 * (clock() - start) / len(inputs)


def _physical(position: Array, rotation: Array, points_in_runway: Array) -> bool:
    """Whether the camera is above the runway and upright, looks along it, and has the points in front."""
    if not (np.isfinite(position).all() and np.isfinite(rotation).all()):
        return False
    in_front = ((points_in_runway - position) @ rotation[2]).min() > 0.0
    return bool(position[2] < 0.0 and in_front and rotation[2, 0] > 0.0 and rotation[1, 2] > 0.0)


def _first_physical(poses: Sequence[Pose], points_in_runway: Array) -> Pose | None:
    return next((pose for pose in poses if _physical(*pose, points_in_runway)), None)


def _gathered(poses: Sequence[Pose | None]) -> Poses:
    """Poses one after the other; NaN where there is none."""
    nothing = np.full(3, np.nan), np.full((3, 3), np.nan)
    position, rotation = zip(*(pose or nothing for pose in poses), strict=True)
    return np.array(position), np.array(rotation)


def _opencv(cv2: Any, solver: str, world: Array, matrix: Array) -> Callable[[Array], list[tuple[Array, Array]]]:
    """A function from the four corners (4, 2) to a solver's poses, as rotation vector and translation (3, 1)."""
    refined = solver == REFINED
    flag = cv2.SOLVEPNP_AP3P if refined else getattr(cv2, f"SOLVEPNP_{solver}")

    def solve(image: Array) -> list[tuple[Array, Array]]:
        try:
            _, turns, shifts, _ = cv2.solvePnPGeneric(world, image, matrix, None, flags=flag)
            if refined and turns:
                _, turn, shift = cv2.solvePnP(
                    world,
                    image,
                    matrix,
                    None,
                    turns[0],
                    shifts[0],
                    useExtrinsicGuess=True,
                    flags=cv2.SOLVEPNP_ITERATIVE,
                )
                return [(turn, shift)]
        except cv2.error:
            return []
        return list(zip(turns, shifts, strict=True))

    return solve


def by_points(cv2: Any, solver: str, scene: Scene, corners: Array, ours: Poses, clock: Clock) -> dict[str, Any]:
    """Errors, failures and time of one of OpenCV's solvers.

    Parameters
    ----------
    cv2 : module
    solver : str
        Of `SOLVERS`.
    scene : Scene
    corners : (draws, 4, 2) array
        Noisy, px, in the order of `runway_corners`.
    ours : Poses
        Of the three lines, of at least as many draws.
    clock : callable
        s.
    """
    camera, world, draws = scene.camera, runway_corners(scene.runway), len(corners)
    matrix = np.array(((camera.fx, 0.0, camera.cx), (0.0, camera.fy, camera.cy), (0.0, 0.0, 1.0)))
    solve = _opencv(cv2, solver, world, matrix)

    def chosen(found: list[tuple[Array, Array]]) -> Pose | None:
        rotations = [(cv2.Rodrigues(turn)[0], shift[:, 0]) for turn, shift in found]
        return _first_physical([(-R.T @ t, R) for R, t in rotations], world)

    exact = chosen(solve(camera.project((world - scene.position) @ scene.rotation.T)))
    off = math.inf if exact is None else float(np.linalg.norm(exact[0] - scene.position))
    solved, time_us = timed(solve, [np.ascontiguousarray(image) for image in corners], clock)
    poses = [chosen(found) for found in solved]
    theirs = level68(_gathered(poses), scene)
    lines = level68((ours[0][:draws], ours[1][:draws]), scene)
    return {
        "solver": solver,
        "draws": draws,
        "p68": theirs,
        "ratio": {key: value / lines[key] if lines[key] > 0.0 else math.nan for key, value in theirs.items()},
        "failures": sum(pose is None for pose in poses),
        "solves_without_noise": off < SAME_POSITION * float(np.linalg.norm(scene.position)),
        "time_us": time_us,
    }


def by_p3ll(poselib: Any, scene: Scene, lines: Sequence[Lines], ours: Poses, clock: Clock) -> dict[str, Any]:
    """How often poselib's pose of the same three lines is ours.

    It draws random numbers of its own, so that the last digits of its pose are not repeatable: they are compared, and
    not kept.
    """
    (left, _), (right, _) = scene.runway.left_edge, scene.runway.right_edge
    points = np.array((left, (0.0, 0.0, 0.0), right))
    directions = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    planes = []
    for three in lines:
        normals = np.array([scene.camera.plane_normal(*line.tolist()) for line in three])
        planes.append(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    def solve(normals: Array) -> Any:
        return poselib.p3ll(normals, points, directions)

    solved, time_us = timed(solve, planes, clock)
    theirs: list[Pose | None] = []
    for found in solved:
        rotations = [(np.asarray(pose.R), np.asarray(pose.t)) for pose in found]
        theirs.append(_first_physical([(-R.T @ t, R) for R, t in rotations], points))
    (there, turned), (position, rotation) = _gathered(theirs), ours
    valid, found_there = np.isfinite(position).all(axis=1), np.isfinite(there).all(axis=1)
    both = valid & found_there
    apart = np.linalg.norm(there - position, axis=1)[both] / np.linalg.norm(position, axis=1)[both]
    # the Frobenius norm of the difference of two rotations is √8 times the sine of half the angle between them
    chord = np.linalg.norm(turned - rotation, axis=(1, 2))[both]
    angle = 2.0 * np.arcsin(np.minimum(chord / math.sqrt(8.0), 1.0))
    same = (apart < SAME_POSITION) & (angle < SAME_ATTITUDE)
    return {
        "solved_by_both": int(both.sum()),
        "same": int(same.sum()),
        "differ": int((~same).sum()),
        "only_ours": int((valid & ~found_there).sum()),
        "only_theirs": int((~valid & found_there).sum()),
        "time_us": time_us,
    }
