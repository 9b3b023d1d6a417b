"""How the camera sits on the body: a lever arm, and a tilt about the body's y axis."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled, rotate
from estimator.so3 import Array, Mat3, Vec3, flat


class Mount(NamedTuple):
    """The camera's mount."""

    lever: Vec3
    """Projection centre from the inertial unit, body frame, m."""
    tilt_variance: float
    """Of the mount angle as read, rad², white from frame to frame."""


class BodyPose(NamedTuple):
    """Where the body is."""

    position: Vec3
    """Of the inertial unit, runway frame, m."""
    attitude: Mat3
    """R_runway_from_body."""


@compiled
def camera_axes(attitude: Mat3, tilt: float) -> tuple[Vec3, Vec3, Vec3]:
    """The camera's x, y and z axes in the runway frame: the rows of R_cam_from_runway.

    The mount turns about the body's y axis; `tilt` (rad) is how far the optical axis points below the body's x axis.
    """
    s, c = math.sin(tilt), math.cos(tilt)
    f0, r0, d0, f1, r1, d1, f2, r2, d2 = attitude
    return (
        (r0, r1, r2),
        (c * d0 - s * f0, c * d1 - s * f1, c * d2 - s * f2),
        (c * f0 + s * d0, c * f1 + s * d1, c * f2 + s * d2),
    )


@compiled
def camera_position(position: Vec3, attitude: Mat3, lever: Vec3) -> Vec3:
    """The projection centre, runway frame, m."""
    x, y, z = rotate(attitude, lever)
    return position[0] + x, position[1] + y, position[2] + z


def body_from_camera(position: Sequence[float], R_cam_from_runway: Array, tilt: float, lever: Vec3) -> BodyPose:
    """The body's pose from the camera's, with the mount angle as read (rad) and the lever arm (m)."""
    right, down, forward = R_cam_from_runway
    s, c = math.sin(tilt), math.cos(tilt)
    # the inverse of camera_axes: the body's axes, in the runway frame, as columns
    attitude = flat(np.stack((c * forward - s * down, right, s * forward + c * down), axis=-1))
    x, y, z = rotate(attitude, lever)
    return BodyPose((float(position[0]) - x, float(position[1]) - y, float(position[2]) - z), attitude)


def camera_triads(attitude: Array, tilt: Array) -> Array:
    """R_runway_from_triad (n, 3, 3) of the camera triad (forward, right, down), as `camera_axes` for many.

    Parameters
    ----------
    attitude : (n, 3, 3) array
        R_runway_from_body.
    tilt : (n,) array
        rad.
    """
    s, c = np.sin(tilt)[:, None], np.cos(tilt)[:, None]
    forward, right, down = attitude[:, :, 0], attitude[:, :, 1], attitude[:, :, 2]
    return np.stack((c * forward + s * down, right, c * down - s * forward), axis=-1)


def turned_triads(triads: Array, pan: Array | float, roll: Array | float) -> Array:
    """Camera triads (n, 3, 3) turned about their own axis down by `pan` and forward by `roll` (rad), to second order.

    What is left is of the third order: 1e-6 rad at a degree.
    """
    forward, right, down = triads[:, :, 0], triads[:, :, 1], triads[:, :, 2]
    p, r = np.broadcast_to(pan, len(triads))[:, None], np.broadcast_to(roll, len(triads))[:, None]
    # exp of the rotation vector p down + r forward, column by column
    return np.stack(
        (
            (1.0 - 0.5 * p * p) * forward + p * right + 0.5 * p * r * down,
            (1.0 - 0.5 * (p * p + r * r)) * right - p * forward + r * down,
            (1.0 - 0.5 * r * r) * down - r * right + 0.5 * p * r * forward,
        ),
        axis=-1,
    )
