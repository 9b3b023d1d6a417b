"""What one camera frame tells the filter: the vision pose against the predicted one, and its covariance.

Three lines and the six numbers of a pose fix one another, as do two edges and four of them once the roll is held.  So
the difference between the vision pose and the predicted one is taken where the noise is Gaussian, between the lines,
and carried over by the derivative J of the pose by the lines at the predicted pose, y = J d, R = J Σ Jᵀ.  Taken between
the poses themselves it would bring in the curvature of the solution: at 1000 m, with line ends perturbed by √2 px, the
vision height is 0.46 m too high on average (20,000 draws), which thirty frames a second do not average out.

The late stage borrows its roll from the filter.  Its four numbers move with the roll's error, which stands in H, where
the filter's own covariance of the roll meets it.
"""

from typing import NamedTuple

import numpy as np

from estimator import covariance
from estimator.camera import Intrinsics, PinholeCamera
from estimator.compiled import compiled, rotate
from estimator.covariance import LEFT, RIGHT, THRESHOLD, Equations
from estimator.mount import Mount, camera_axes, camera_position, camera_triads
from estimator.so3 import Array, Mat3, Vec3
from estimator.strapdown import ATTITUDE, POSITION, STATES, unpacked

_predicted_line = compiled(covariance.predicted_line)
_line_equations = compiled(covariance.line_equations)
_early_rows = compiled(covariance.early_rows)
_late_rows = compiled(covariance.late_rows)
_roll_share = compiled(covariance.roll_share)


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

    def numbers(self) -> Array:
        """(3, 7) array, a row a line; NaN for a line that was not found."""
        return np.array([_NOT_FOUND if line is None else line for line in self])


_NOT_FOUND = (np.nan,) * 7


class Innovation(NamedTuple):
    """A measurement of the 15-state error: y = H δ + noise of covariance R."""

    y: Array
    H: Array
    R: Array


class Eye(NamedTuple):
    """What turns lines into a measurement: camera, runway width and mount."""

    camera: PinholeCamera
    width: float
    """Of the runway, m."""
    mount: Mount

    def numbers(self) -> Array:
        """(9,) array, as `frame_innovation` takes it."""
        return np.array((*self.camera.intrinsics, self.width, *self.mount.lever, self.mount.tilt_variance))


@compiled
def camera_from_state(attitude: Mat3, lever: Vec3) -> Array:
    """Derivative (6, 15) of the camera's position and rotation by the filter's errors."""
    x, y, z = rotate(attitude, lever)
    result = np.zeros((6, STATES))
    for i in range(3):
        result[i, i] = result[3 + i, 6 + i] = 1.0
    # δC = δp + ψ × (R lever)
    result[0, 7], result[0, 8] = z, -y
    result[1, 6], result[1, 8] = -z, x
    result[2, 6], result[2, 7] = y, -x
    return result


@compiled
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


@compiled
def _residual(
    camera: Intrinsics, line: int, seen: Array, where: Vec3, axes: tuple[Vec3, Vec3, Vec3], width: float
) -> tuple[float, float, Equations]:
    """Offset (px) and angle (rad) of a line, true less predicted, and its equations."""
    predicted = _predicted_line(camera, line, where, axes, width)
    pa, pb = predicted.a / predicted.gradient, predicted.b / predicted.gradient
    u, v = seen[3], seen[4]
    off = pa * u + pb * v + predicted.c / predicted.gradient
    sine = pa * seen[1] - pb * seen[0]
    if pa * seen[0] + pb * seen[1] < 0.0:
        sine = -sine
    # the centroid and the direction as measured lie on the true line
    return -off, -sine, _line_equations(camera, line, predicted, axes, u - off * pa, v - off * pb)


@compiled
def frame_innovation(eye: Array, lines: Array, nominal: Array, tilt: float) -> tuple[Array, Array, Array]:
    """As `pose_innovation`, over arrays.

    Parameters
    ----------
    eye : (9,) array
        As `Eye.numbers` gives it.
    lines : (3, 7) array
        As `Lines.numbers` gives them.
    nominal : (15 or more,) array
        Predicted state of the body, as `Inertial.numbers` gives it.
    tilt : float
        Mount angle as read, rad.

    Returns
    -------
    y, H, R : (n,), (n, 15) and (n, n) array
        n is 6 early and 4 late; 0 where there is no measurement.
    """
    nothing = np.empty(0), np.empty((0, STATES)), np.empty((0, 0))
    if np.isnan(lines[LEFT, 0]) or np.isnan(lines[RIGHT, 0]):
        return nothing
    camera = Intrinsics(eye[0], eye[1], eye[2], eye[3])
    width, lever = eye[4], (eye[5], eye[6], eye[7])
    body = unpacked(nominal)
    axes = camera_axes(body.attitude, tilt)
    right, _, forward = axes
    where = camera_position(body.position, body.attitude, lever)
    H = camera_from_state(body.attitude, lever)
    early = not np.isnan(lines[THRESHOLD, 0])
    n = 6 if early else 4
    d, sigma2 = np.zeros(n + 1), np.empty(n + 1)
    J = np.empty((n, n + 1))
    # an error of the mount angle, one more residual, turns the camera about the body's y axis, its own x axis
    sigma2[n] = eye[8]
    d[0], d[1], of_left = _residual(camera, LEFT, lines[LEFT], where, axes, width)
    d[n - 2], d[n - 1], of_right = _residual(camera, RIGHT, lines[RIGHT], where, axes, width)
    sigma2[0], sigma2[1] = lines[LEFT, 5], lines[LEFT, 6]
    sigma2[n - 2], sigma2[n - 1] = lines[RIGHT, 5], lines[RIGHT, 6]
    if early:
        d[2], d[3], of_threshold = _residual(camera, THRESHOLD, lines[THRESHOLD], where, axes, width)
        sigma2[2], sigma2[3] = lines[THRESHOLD, 5], lines[THRESHOLD, 6]
        six = _early_rows(where, width, of_left, of_threshold, of_right)
        for i in range(6):
            for j in range(6):
                J[i, j] = six[i][j]
            J[i, 6] = 0.0 if i < 3 else right[i - 3]
    else:
        four = _late_rows(where, forward, width, of_left, of_right)
        tangent = forward[1] / forward[0]
        secant = np.hypot(forward[0], forward[1]) / forward[0]
        lateral, down = _roll_share(where, width)
        about_x = right[0] + tangent * right[1]
        for i in range(4):
            for j in range(4):
                J[i, j] = four[i][j]
        J[0, 4], J[1, 4], J[2, 4], J[3, 4] = right[2], secant * right[1], lateral * about_x, down * about_x
        H = _late_state(H, secant, tangent, lateral, down)
    y, R = np.zeros(n), np.zeros((n, n))
    total = 0.0
    for i in range(n):
        for k in range(n + 1):
            y[i] += J[i, k] * d[k]
            weighted = J[i, k] * sigma2[k]
            for j in range(n):
                R[i, j] += weighted * J[j, k]
        total += y[i] + R[i, i]
    # one number that is not finite would spoil the whole state
    return (y, H, R) if np.isfinite(total) else nothing


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
    nominal = np.array((*position, 0.0, 0.0, 0.0, *attitude))
    y, H, R = frame_innovation(Eye(camera, width, mount).numbers(), lines.numbers(), nominal, float(tilt))
    return Innovation(y, H, R) if y.size else None


def camera_sigma(covariance: Array, attitude: Array, mount: Mount, tilt: Array) -> Array:
    """Standard deviations of the camera's pose, by the filter's covariance.

    Parameters
    ----------
    covariance : (n, 15, 15) or (n, 23, 23) array
        The latter with the camera's calibration, as `estimator.single_lines`: how it sits on its mount turns it.
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
    triad = camera_triads(attitude, tilt)
    forward = triad[:, :, 0]
    level = np.hypot(forward[:, 0], forward[:, 1])
    ahead = forward / level[:, None]
    rise = -ahead[:, 2]
    arm = attitude @ np.array(mount.lever)
    zero, one = np.zeros_like(level), np.ones_like(level)
    derivative = np.zeros((len(level), 6, covariance.shape[-1]))
    derivative[:, :3, POSITION] = np.eye(3)
    x, y, z = arm.T
    derivative[:, :3, ATTITUDE] = np.stack((zero, z, -y, -z, zero, x, y, -x, zero), axis=-1).reshape(-1, 3, 3)
    # ψ = (0, 0, 1) yaw + (-s, c, 0) pitch + forward roll, solved for the three
    u, v, _ = ahead.T
    angles = (u / level, v / level, zero, -v, u, zero, rise * u, rise * v, one)
    derivative[:, 3:, ATTITUDE] = np.stack(angles, axis=-1).reshape(-1, 3, 3)
    by_turn = derivative[:, 3:, ATTITUDE]
    if covariance.shape[-1] > STATES:  # lower by a turn against the right axis, then about the axes down and forward
        turns = np.stack((-attitude[:, :, 1], triad[:, :, 2], forward), axis=-1)
        derivative[:, 3:, STATES : STATES + 3] = by_turn @ turns
    variance = ((derivative @ covariance) * derivative).sum(axis=-1)
    sway = (by_turn @ attitude[:, :, 1, None])[..., 0]
    variance[:, 3:] += mount.tilt_variance * sway**2
    return np.asarray(np.sqrt(variance))
