"""What one camera frame tells the filter: the vision pose against the predicted one, and its covariance.

Three lines and the six numbers of a pose fix one another, as do two edges and four of them once the roll is held.  So
the difference between the vision pose and the predicted one is taken where the noise is Gaussian, between the lines,
and carried over by the derivative J of the pose by the lines at the predicted pose, y = J d, R = J Σ Jᵀ.  Taken between
the poses themselves it would bring in the curvature of the solution: at 1000 m, with line ends perturbed by √2 px, the
vision height is 0.46 m too high on average (20,000 draws), which thirty frames a second do not average out.

The late stage borrows its roll from the filter.  Its four numbers move with the roll's error, which stands in H, where
the filter's own covariance of the roll meets it.
"""

import math
from typing import NamedTuple

import numpy as np

from estimator.camera import PinholeCamera
from estimator.covariance import (
    LEFT,
    RIGHT,
    THRESHOLD,
    Equations,
    early_rows,
    late_rows,
    line_equations,
    predicted_line,
    roll_share,
)
from estimator.mount import Mount, camera_axes, camera_position, camera_triads
from estimator.so3 import Array, Mat3, Vec3, rotate
from estimator.strapdown import ATTITUDE, POSITION, STATES


class LineObservation(NamedTuple):
    """One measured image line."""

    a: float
    b: float
    c: float
    """a u + b v + c = 0, px, a² + b² = 1."""
    u: float
    v: float
    """Centroid of its points, px."""
    offset_variance: float
    """Across the line at the centroid, px²."""
    angle_variance: float
    """rad²."""


class Lines(NamedTuple):
    """What one frame holds; a line that was not found is None."""

    left: LineObservation | None
    threshold: LineObservation | None
    right: LineObservation | None


class Innovation(NamedTuple):
    """A measurement of the 15-state error: y = H δ + noise of covariance R."""

    y: Array
    H: Array
    R: Array


def camera_from_state(attitude: Mat3, lever: Vec3) -> Array:
    """Derivative (6, 15) of the camera's position and rotation by the filter's errors."""
    x, y, z = rotate(attitude, lever)
    result = _POSE_OF_STATE.copy()
    # δC = δp + ψ × (R lever)
    result[0, 7], result[0, 8] = z, -y
    result[1, 6], result[1, 8] = -z, x
    result[2, 6], result[2, 7] = y, -x
    return result


class Frame(NamedTuple):
    """Residuals and equations of the lines of a frame, against the lines that a pose predicts."""

    residual: list[float]
    """Offset (px) and angle (rad) of each line, true less predicted."""
    variance: list[float]
    equations: list[Equations]


def frame_residuals(
    camera: PinholeCamera, width: float, lines: Lines, where: Vec3, axes: tuple[Vec3, Vec3, Vec3]
) -> Frame:
    """Residuals of the lines that are there.

    Parameters
    ----------
    camera : PinholeCamera
    width : float
        Of the runway, m.
    lines : Lines
    where, axes
        Predicted pose, as `camera_position` and `camera_axes` give it.

    Raises
    ------
    ZeroDivisionError
        If a predicted line lies at infinity.
    """
    residual: list[float] = []
    variance: list[float] = []
    equations: list[Equations] = []
    for which, seen in ((LEFT, lines.left), (THRESHOLD, lines.threshold), (RIGHT, lines.right)):
        if seen is None:
            continue
        predicted = predicted_line(camera, which, where, axes, width, math)
        a, b, c, _, gradient = predicted
        pa, pb = a / gradient, b / gradient
        seen_a, seen_b, _, u, v, offset_variance, angle_variance = seen
        off = pa * u + pb * v + c / gradient
        sine = pa * seen_b - pb * seen_a
        if pa * seen_a + pb * seen_b < 0.0:
            sine = -sine
        # the centroid and the direction as measured lie on the true line
        residual += (-off, -sine)
        variance += (offset_variance, angle_variance)
        equations.append(line_equations(camera, which, predicted, axes, u - off * pa, v - off * pb))
    return Frame(residual, variance, equations)


def pose_innovation(
    camera: PinholeCamera, width: float, mount: Mount, lines: Lines, position: Vec3, attitude: Mat3, tilt: float
) -> Innovation | None:
    """Vision pose less predicted pose, to first order in the lines: six numbers, or four without the threshold.

    Parameters
    ----------
    camera : PinholeCamera
    width : float
        Of the runway, m.
    mount : Mount
    lines : Lines
    position, attitude
        Predicted state of the body.
    tilt : float
        Mount angle as read, rad.

    Returns
    -------
    Innovation or None
        Early: position (m) and rotation vector (rad) of the camera, runway frame.  Late: yaw, pitch (rad), y and z (m).
        None without both edges, where the prediction sees no such lines, and where a number is not finite.
    """
    if lines.left is None or lines.right is None:
        return None
    axes = camera_axes(attitude, tilt)
    (r0, r1, r2), _, forward = axes
    where = camera_position(position, attitude, mount.lever)
    H = camera_from_state(attitude, mount.lever)
    try:
        residual, variance, equations = frame_residuals(camera, width, lines, where, axes)
        if lines.threshold is not None:
            rows = early_rows(where, width, *equations)
            sway: tuple[float, ...] = (0.0, 0.0, 0.0, r0, r1, r2)
        else:
            rows = late_rows(where, forward, width, *equations)
            tangent = forward[1] / forward[0]
            secant = math.hypot(forward[0], forward[1]) / forward[0]
            lateral, down = roll_share(where, width)
            about_x = r0 + tangent * r1
            sway = (r2, secant * r1, lateral * about_x, down * about_x)
            H = _late_state(H, secant, tangent, lateral, down)
    except (ZeroDivisionError, ValueError):
        return None
    # one number that is not finite would spoil the whole state
    if not math.isfinite(sum(residual) + sum(variance)):
        return None
    # an error of the mount angle, one more residual, turns the camera about the body's y axis, which is its own x axis
    residual.append(0.0)
    variance.append(mount.tilt_variance)
    numbers: list[float] = []
    for row, turn in zip(rows, sway, strict=True):
        numbers += row
        numbers.append(turn)
    J = np.array(numbers).reshape(len(rows), -1)
    d, sigma2 = np.array((residual, variance))
    return Innovation(np.dot(J, d), H, np.dot(J * sigma2, J.T))


def _late_state(camera: Array, secant: float, tangent: float, lateral: float, down: float) -> Array:
    """Derivative (4, 15) of the two-line pose by the filter's errors, from that of the camera's pose (6, 15).

    The direction of the edges gives yaw and pitch whatever the roll; y and z are off by what the filter's rotation
    about the runway's x axis is off, which the pose was held to.
    """
    result = np.zeros((4, STATES))
    result[0, 8] = 1.0
    result[1, 7] = secant
    result[2:] = camera[1:3]
    result[2, 6] += lateral
    result[2, 7] += lateral * tangent
    result[3, 6] += down
    result[3, 7] += down * tangent
    return result


def camera_sigma(covariance: Array, attitude: Array, mount: Mount, tilt: Array) -> Array:
    """Standard deviations of the camera's pose, by the filter's covariance.

    Parameters
    ----------
    covariance : (n, 15, 15) array
    attitude : (n, 3, 3) array
        R_runway_from_body.
    mount : Mount
    tilt : (n,) array
        Mount angle as read, rad; the reading's own noise is part of the camera's attitude.

    Returns
    -------
    (n, 6) array
        x, y, z (m), roll, pitch and yaw (rad) of the camera triad in the runway frame.
    """
    forward = camera_triads(attitude, tilt)[:, :, 0]
    level = np.hypot(forward[:, 0], forward[:, 1])
    ahead = forward / level[:, None]
    rise = -ahead[:, 2]
    arm = attitude @ np.array(mount.lever)
    zero, one = np.zeros_like(level), np.ones_like(level)
    derivative = np.zeros((len(level), 6, STATES))
    derivative[:, :3, POSITION] = np.eye(3)
    x, y, z = arm.T
    derivative[:, :3, ATTITUDE] = np.stack((zero, z, -y, -z, zero, x, y, -x, zero), axis=-1).reshape(-1, 3, 3)
    # ψ = (0, 0, 1) yaw + (-s, c, 0) pitch + forward roll, solved for the three
    u, v, _ = ahead.T
    angles = (u / level, v / level, zero, -v, u, zero, rise * u, rise * v, one)
    derivative[:, 3:, ATTITUDE] = np.stack(angles, axis=-1).reshape(-1, 3, 3)
    variance = ((derivative @ covariance) * derivative).sum(axis=-1)
    sway = (derivative[:, 3:, ATTITUDE] @ attitude[:, :, 1, None])[..., 0]
    variance[:, 3:] += mount.tilt_variance * sway**2
    return np.asarray(np.sqrt(variance))


_POSE_OF_STATE = np.zeros((6, STATES))
_POSE_OF_STATE[:3, POSITION] = _POSE_OF_STATE[3:, ATTITUDE] = np.eye(3)
