"""Geometry made without the estimator: rotations by scipy, projection by a homogeneous camera matrix.

Lines come from points and points from poses, so that a sign error in the code under test has nothing here to cancel it.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from estimator.camera import PinholeCamera
from estimator.so3 import Array

DEG = np.pi / 180.0
WIDTH = 30.0
LENGTH = 2000.0
PAPER = PinholeCamera(fx=12.5 / 9.9e-3, fy=12.5 / 9.9e-3, cx=328.5, cy=246.5, width=658, height=494)
ODD = PinholeCamera(fx=1300.0, fy=1180.0, cx=310.0, cy=262.0, width=658, height=494)
"""A camera whose axes differ and whose principal point is off the middle, so that a mix-up of them shows."""


class Poses(NamedTuple):
    """Camera poses in the runway frame."""

    position: Array
    """(n, 3) m."""
    R: Array
    """R_cam_from_runway, (n, 3, 3)."""
    yaw: Array
    pitch: Array
    roll: Array


class ImageLines(NamedTuple):
    """(..., 3) each, px."""

    left: Array
    threshold: Array
    right: Array


def camera_rotation(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Array:
    """R_cam_from_runway (..., 3, 3) of the triad's angles, by scipy."""
    yaw, pitch, roll = np.broadcast_arrays(*(np.asarray(angle, float) for angle in (yaw, pitch, roll)))
    angles = np.stack((yaw, pitch, roll), axis=-1)
    triad = Rotation.from_euler("ZYX", angles.reshape(-1, 3)).as_matrix()  # columns forward, right, down
    rows = np.stack((triad[:, :, 1], triad[:, :, 2], triad[:, :, 0]), axis=-2)
    return np.asarray(rows.reshape(*angles.shape[:-1], 3, 3))


def poses_of(position: ArrayLike, yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Poses:
    """Poses from positions (n, 3) and angles (n)."""
    where = np.asarray(position, float)
    yaw, pitch, roll = (np.broadcast_to(np.asarray(angle, float), where.shape[:-1]) for angle in (yaw, pitch, roll))
    return Poses(where, camera_rotation(yaw, pitch, roll), yaw, pitch, roll)


def random_poses(rng: Generator, n: int, nearest: float = 60.0, farthest: float = 6000.0) -> Poses:
    """Poses over the approach: the threshold somewhere in view, rolled by up to 30°."""
    distance = np.exp(rng.uniform(np.log(nearest), np.log(farthest), n))
    elevation, azimuth = rng.uniform(1.5 * DEG, 25.0 * DEG, n), rng.uniform(-25.0 * DEG, 25.0 * DEG, n)
    level = distance * np.cos(elevation)
    position = np.stack((-level * np.cos(azimuth), -level * np.sin(azimuth), -distance * np.sin(elevation)), axis=-1)
    yaw = azimuth + rng.uniform(-10.0 * DEG, 10.0 * DEG, n)
    pitch = -elevation + rng.uniform(-8.0 * DEG, 8.0 * DEG, n)
    return poses_of(position, yaw, pitch, rng.uniform(-30.0 * DEG, 30.0 * DEG, n))


def camera_matrix(camera: PinholeCamera) -> Array:
    """K."""
    return np.array(((camera.fx, 0.0, camera.cx), (0.0, camera.fy, camera.cy), (0.0, 0.0, 1.0)))


def pixels(camera: PinholeCamera, poses: Poses, points: ArrayLike) -> Array:
    """Pixels of runway points (..., 3), one pose each, without a test of being in front."""
    seen = np.einsum("...ij,...j->...i", poses.R, np.asarray(points, float) - poses.position)
    homogeneous = seen @ camera_matrix(camera).T
    return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])


def cv_pixels(camera: PinholeCamera, R: Array, position: Array, points: Array) -> Array:
    """Pixels (n, 2) of runway points (n, 3) at one pose, by OpenCV."""
    turn = Rotation.from_matrix(R).as_rotvec()
    projected, _ = cv2.projectPoints(points, turn, -R @ position, camera_matrix(camera), None)
    return np.asarray(projected[:, 0, :], float)


def image_line(camera: PinholeCamera, poses: Poses, point: ArrayLike, direction: ArrayLike) -> Array:
    """The image (..., 3) of a 3-D line: of the plane through the line and the camera, carried over by K⁻ᵀ."""
    normal = np.cross(np.asarray(point, float) - poses.position, np.asarray(direction, float))
    in_cam = np.einsum("...ij,...j->...i", poses.R, normal)
    return np.asarray(in_cam @ np.linalg.inv(camera_matrix(camera)))


def runway_lines(camera: PinholeCamera, poses: Poses, width: ArrayLike = WIDTH) -> ImageLines:
    """Left edge, threshold and right edge, scaled to unit gradient."""
    half = 0.5 * np.asarray(width, float)
    zero = np.zeros_like(half)
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    lines = (
        image_line(camera, poses, np.stack((zero, -half, zero), axis=-1), x),
        image_line(camera, poses, (0.0, 0.0, 0.0), y),
        image_line(camera, poses, np.stack((zero, half, zero), axis=-1), x),
    )
    return ImageLines(*(line / np.hypot(line[..., :1], line[..., 1:2]) for line in lines))


def scaled(rng: Generator, lines: ImageLines) -> ImageLines:
    """The same lines with scales over twelve decades and either sign."""
    shape = lines.left.shape[:-1]
    factors = [rng.choice((-1.0, 1.0), shape) * 10.0 ** rng.uniform(-6.0, 6.0, shape) for _ in lines]
    return ImageLines(*(line * factor[..., None] for line, factor in zip(lines, factors, strict=True)))


def rotation_angle(a: Array, b: Array) -> Array:
    """Angle (...) between rotations, rad; good at small angles, where an arc cosine is not."""
    off = np.swapaxes(a, -1, -2) @ b
    return np.asarray(Rotation.from_matrix(off.reshape(-1, 3, 3)).magnitude().reshape(off.shape[:-2]))


def derivative(function: Callable[[Array], Array], x: ArrayLike, step: ArrayLike) -> Array:
    """Derivative (m, n) by central differences of fourth order.

    Parameters
    ----------
    function : callable
        Takes (n,), returns (m,).
    x : (n,) array_like
    step : float or (n,) array_like
    """
    where = np.asarray(x, float)
    steps = np.broadcast_to(np.asarray(step, float), where.shape)
    columns = []
    for i, h in enumerate(steps):
        e = np.zeros_like(where)
        e[i] = h
        near = function(where + e) - function(where - e)
        far = function(where + 2.0 * e) - function(where - 2.0 * e)
        columns.append((8.0 * near - far) / (12.0 * h))
    return np.stack(columns, axis=-1)


class Visible(NamedTuple):
    """What a sampling found of a segment in the image."""

    ends: Array
    """(2, 2) px."""
    step: float
    """Between samples, px: the true ends lie no further out than this."""


def visible(
    camera: PinholeCamera, pose: Poses, start: ArrayLike, end: ArrayLike, near: float = 1.0, samples: int = 10_001
) -> Visible | None:
    """What a camera sees of a segment, by a dense sampling that is even in the image; None where nothing is seen.

    Parameters
    ----------
    camera : PinholeCamera
    pose : Poses
        One.
    start, end : (3,) array_like
        Runway frame, m.
    near : float
        Smallest depth that is seen, m.
    samples : int
    """
    a, b = (np.asarray(p, float) for p in (start, end))
    za, zb = (float((pose.R @ (p - pose.position))[2]) for p in (a, b))
    if max(za, zb) <= near:
        return None
    cut = a + (near - za) / (zb - za) * (b - a) if min(za, zb) < near else a
    a, za = (cut, near) if za < near else (a, za)
    b, zb = (cut, near) if zb < near else (b, zb)
    even = np.linspace(0.0, 1.0, samples)
    share = even / zb / ((1.0 - even) / za + even / zb)
    uv = pixels(camera, pose, a + share[:, None] * (b - a))
    size = np.array((camera.width, camera.height))
    inside = (np.abs(uv - 0.5 * (size - 1)) <= 0.5 * size).all(axis=-1)
    if not inside.any():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    return Visible(uv[[first, last]], float(np.linalg.norm(uv[1] - uv[0])))
