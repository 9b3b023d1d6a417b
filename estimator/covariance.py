"""First-order sensitivity and covariance of the pose, from the noise of the lines, in closed form.

A line's residual against the line that a pose predicts has two numbers: its offset e (px) at the points' centroid and
its angle φ (rad).  With D the direction of the runway line, P a point of it, C the camera, N = (P - C) × D the normal
of the line's plane, w the ray of a pixel of the predicted line in the runway frame and s the length of the line's pixel
gradient, a shift dC of the camera and a small rotation ψ of it in the runway frame, R_runway_from_cam → exp([ψ×])
R_runway_from_cam, move the line by

    e = (w × D)·dC / s + (w × N)·ψ / s,

and φ is the same expression with q, the ray of a step along the line, in place of w.  Solved for the pose it follows
the paper's own steps.  Attitude: D lies in the plane, D = α w + β q, and α e + β φ is free of dC:

    (D × N)·ψ = s (α e + β φ).

Both edges give ψ_y and ψ_z, the threshold then ψ_x.  Position: w × D = (w_z/h) N at a camera height h, so what is left
of e is the coplanarity of the line with its image,

    N·dC = (h/w_z) (s e - (w × N)·ψ),

three planes for three coordinates, of which the edges alone give y and z.

Late, roll is held: yaw and pitch come from ψ_z and ψ_y, and a roll error δ about the runway's x axis that was not
accounted for moves the lateral position by -(h + (L²/4 - y²)/h) δ and z by -2 y δ.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimator.camera import Intrinsics, Number, PinholeCamera
from estimator.so3 import Array

LEFT, THRESHOLD, RIGHT = 0, 1, 2

Triple = tuple[Number, Number, Number]


class LineNoise(NamedTuple):
    """Where the points of one image line are, and how well they fix it.

    Attributes
    ----------
    u, v : (...) float or array
        Centroid of the points, px.
    offset_variance : (...) float or array
        Of the line across itself at the centroid, px².
    angle_variance : (...) float or array
        rad².
    """

    u: Number
    v: Number
    offset_variance: Number
    angle_variance: Number


class Predicted(NamedTuple):
    """A runway line as a pose predicts it in the image."""

    a: Number
    b: Number
    c: Number
    """a u + b v + c = 0, px."""
    normal: Triple
    """(P - C) × D, runway frame."""
    gradient: Number
    """Length of (a, b)."""


class Equations(NamedTuple):
    """What a line's residual says of the pose: two equations."""

    offset_share: Number
    angle_share: Number
    """(D × N)·ψ = offset_share e + angle_share φ."""
    plane_share: Number
    turn: Triple
    """N·dC = plane_share e - turn·ψ."""


def predicted_line(
    camera: Intrinsics, line: int, position: Sequence[Number], axes: Sequence[Sequence[Number]], width: Number
) -> Predicted:
    """The image of a runway line at a pose.

    Parameters
    ----------
    line : int
        `LEFT`, `THRESHOLD` or `RIGHT`.
    position : three float or (...) array
        Of the camera, runway frame, m.
    axes : three triples
        The camera's x, y and z axes in the runway frame: the rows of R_cam_from_runway.
    width : float
        m.
    """
    x, y, z = position
    (x0, x1, x2), (y0, y1, y2), (z0, z1, z2) = axes
    normal: Triple
    if line == THRESHOLD:  # (0, 0, 0) - C, crossed with the y axis
        normal = (z, 0.0, -x)
        in_cam = (z * x0 - x * x2, z * y0 - x * y2, z * z0 - x * z2)
    else:  # (0, ∓width/2, 0) - C, crossed with the x axis
        side = y + 0.5 * width if line == LEFT else y - 0.5 * width
        normal = (0.0, -z, side)
        in_cam = (side * x2 - z * x1, side * y2 - z * y1, side * z2 - z * z1)
    a, b = in_cam[0] / camera.fx, in_cam[1] / camera.fy  # as camera.line_of_plane
    c = in_cam[2] - a * camera.cx - b * camera.cy
    return Predicted(a, b, c, normal, (a * a + b * b) ** 0.5)


def line_equations(
    camera: Intrinsics, line: int, predicted: Predicted, axes: Sequence[Sequence[Number]], u: Number, v: Number
) -> Equations:
    """The equations of a line, from a pixel (u, v) of the predicted line at which its offset is taken."""
    (x0, x1, x2), (y0, y1, y2), (z0, z1, z2) = axes
    a, b, _, (n0, n1, n2), s = predicted
    across, down = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    w0 = across * x0 + down * y0 + z0
    w1 = across * x1 + down * y1 + z1
    w2 = across * x2 + down * y2 + z2
    across, down = b / (camera.fx * s), a / (-camera.fy * s)
    q2 = across * x2 + down * y2
    if line == THRESHOLD:
        cross = w2 * (across * x1 + down * y1) - w1 * q2
        ratio = -n0 / w2  # height over w_z
        turn = (ratio * w1 * n2, ratio * (w2 * n0 - w0 * n2), -ratio * w1 * n0)
    else:
        cross = w2 * (across * x0 + down * y0) - w0 * q2
        ratio = n1 / w2
        turn = (ratio * (w1 * n2 - w2 * n1), -ratio * w0 * n2, ratio * w0 * n1)
    scale = s / cross
    return Equations(-q2 * scale, w2 * scale, ratio * s, turn)


def early_rows(
    position: Sequence[Number], width: Number, left: Equations, threshold: Equations, right: Equations
) -> tuple[tuple[Number, ...], ...]:
    """Position (x, y, z) and rotation vector by the residuals: six rows of six.

    The residuals' order is offset and angle of left edge, threshold, right edge.
    """
    x, y, z = position
    al, bl, kl, (l0, l1, l2) = left
    at, bt, kt, (t0, t1, t2) = threshold
    ar, br, kr, (r0, r1, r2) = right
    # the weights with which the edges share ψ_z and y
    gl, gr = (0.5 * width - y) / (-width * z), (0.5 * width + y) / (-width * z)
    ylo, yla, yro, yra = -al / width, -bl / width, ar / width, br / width  # ψ_y
    zlo, zla, zro, zra = gl * al, gl * bl, gr * ar, gr * br  # ψ_z
    k = -z / x
    xlo, xla, xro, xra = k * zlo, k * zla, k * zro, k * zra  # ψ_x
    xto, xta = -at / x, -bt / x

    def plane(turn: Triple) -> tuple[Number, ...]:
        c0, c1, c2 = turn
        return (
            c0 * xlo + c1 * ylo + c2 * zlo,
            c0 * xla + c1 * yla + c2 * zla,
            c0 * xto,
            c0 * xta,
            c0 * xro + c1 * yro + c2 * zro,
            c0 * xra + c1 * yra + c2 * zra,
        )

    p0, p1, p2, p3, p4, p5 = plane((l0, l1, l2))
    q0, q1, q2, q3, q4, q5 = plane((r0, r1, r2))
    s0, s1, s2, s3, s4, s5 = plane((t0, t1, t2))
    # coplanarity: the edges' planes for y and z, then the threshold's for x
    down = (
        (kl - p0 + q0) / width, (q1 - p1) / width, (q2 - p2) / width, (q3 - p3) / width,
        (q4 - p4 - kr) / width, (q5 - p5) / width,
    )  # fmt: skip
    lateral = (
        gl * (kl - p0) - gr * q0, -gl * p1 - gr * q1, -gl * p2 - gr * q2, -gl * p3 - gr * q3,
        gr * (kr - q4) - gl * p4, -gl * p5 - gr * q5,
    )  # fmt: skip
    along = (
        (x * down[0] - s0) / z, (x * down[1] - s1) / z, (kt - s2 + x * down[2]) / z, (x * down[3] - s3) / z,
        (x * down[4] - s4) / z, (x * down[5] - s5) / z,
    )  # fmt: skip
    zero = 0.0 * x
    return (
        along,
        lateral,
        down,
        (xlo, xla, xto, xta, xro, xra),
        (ylo, yla, zero, zero, yro, yra),
        (zlo, zla, zero, zero, zro, zra),
    )


def late_rows(
    position: Sequence[Number], optical_axis: Sequence[Number], width: Number, left: Equations, right: Equations
) -> tuple[tuple[Number, ...], ...]:
    """Yaw, pitch, y and z by the residuals with the roll held: four rows of four.

    The residuals' order is offset and angle of left edge, right edge.  Yaw turns about the runway's z axis, pitch about
    the right axis that yaw leaves, roll about the optical axis (runway frame).
    """
    _, y, z = position
    f0, f1, _ = optical_axis
    tangent = f1 / f0
    level = (f0 * f0 + f1 * f1) ** 0.5 / f0  # 1 / cos yaw
    al, bl, kl, (l0, l1, l2) = left
    ar, br, kr, (r0, r1, r2) = right
    gl, gr = (0.5 * width - y) / (-width * z), (0.5 * width + y) / (-width * z)
    ylo, yla, yro, yra = -al / width, -bl / width, ar / width, br / width  # ψ_y
    zlo, zla, zro, zra = gl * al, gl * bl, gr * ar, gr * br  # ψ_z
    l1, r1 = l1 - l0 * tangent, r1 - r0 * tangent  # a pitch at a yaw turns about x as well
    p0, p1, p2, p3 = l1 * ylo + l2 * zlo, l1 * yla + l2 * zla, l1 * yro + l2 * zro, l1 * yra + l2 * zra
    q0, q1, q2, q3 = r1 * ylo + r2 * zlo, r1 * yla + r2 * zla, r1 * yro + r2 * zro, r1 * yra + r2 * zra
    return (
        (zlo, zla, zro, zra),
        (level * ylo, level * yla, level * yro, level * yra),
        (gl * (kl - p0) - gr * q0, -gl * p1 - gr * q1, gr * (kr - q2) - gl * p2, -gl * p3 - gr * q3),
        ((kl - p0 + q0) / width, (q1 - p1) / width, (q2 - p2 - kr) / width, (q3 - p3) / width),
    )


def roll_share(position: Sequence[Number], width: Number) -> tuple[Number, Number]:
    """Shift (m/rad) of a two-line pose's y and z by an unknown rotation about the runway's x axis."""
    _, y, z = position
    return z + (0.25 * width * width - y * y) / z, -2.0 * y


def _equations(
    camera: PinholeCamera, lines: dict[int, LineNoise], position: Array, rotation: Array, width: float
) -> tuple[tuple[Array, ...], list[tuple[Array, ...]], list[Equations], list[Number]]:
    """Position and axes in components, and the equations and variances of the lines."""
    where = tuple(np.moveaxis(position, -1, 0))
    axes = [tuple(np.moveaxis(rotation[..., i, :], -1, 0)) for i in range(3)]
    equations = []
    variances: list[Number] = []
    for line, noise in lines.items():
        predicted = predicted_line(camera.intrinsics, line, where, axes, width)
        a, b, c, _, gradient = predicted
        # the centroid, moved onto the predicted line
        off = (a * noise.u + b * noise.v + c) / gradient**2
        equations.append(line_equations(camera.intrinsics, line, predicted, axes, noise.u - off * a, noise.v - off * b))
        variances += [noise.offset_variance, noise.angle_variance]
    return where, axes, equations, variances


def _covariance(rows: Sequence[Sequence[Number]], variances: Sequence[Number]) -> Array:
    """J Σ Jᵀ (..., n, n) of rows of floats or (...) arrays."""
    shape = np.broadcast_shapes(*(np.shape(item) for row in (*rows, variances) for item in row))
    matrix = np.stack([np.stack([np.broadcast_to(i, shape) for i in row], axis=-1) for row in rows], axis=-2)
    sigma2 = np.stack([np.broadcast_to(v, shape) for v in variances], axis=-1)
    result = (matrix * sigma2[..., None, :]) @ np.swapaxes(matrix, -1, -2)
    return np.asarray(np.where(np.isfinite(result).all(axis=(-1, -2), keepdims=True), result, np.nan))


def three_line_covariance(
    camera: PinholeCamera,
    left: LineNoise,
    threshold: LineNoise,
    right: LineNoise,
    *,
    position: ArrayLike,
    R_cam_from_runway: ArrayLike,
    runway_width: float,
) -> Array:
    """Covariance (..., 6, 6) of the three-line pose: position (m), then rotation vector (rad), runway frame.

    Parameters
    ----------
    camera : PinholeCamera
    left, threshold, right : LineNoise
    position : (..., 3) array_like
        Pose at which it is taken: a predicted one.  At the measured pose it is correlated with the error itself.
    R_cam_from_runway : (..., 3, 3) array_like
    runway_width : float
        m.

    Returns
    -------
    (..., 6, 6) array
        NaN where the geometry is degenerate.
    """
    lines = {LEFT: left, THRESHOLD: threshold, RIGHT: right}
    with np.errstate(all="ignore"):
        where, _, equations, variances = _equations(
            camera, lines, np.asarray(position, float), np.asarray(R_cam_from_runway, float), runway_width
        )
        return _covariance(early_rows(where, runway_width, *equations), variances)


def two_line_covariance(
    camera: PinholeCamera,
    left: LineNoise,
    right: LineNoise,
    *,
    lateral: ArrayLike,
    height: ArrayLike,
    R_cam_from_runway: ArrayLike,
    runway_width: float,
    roll_variance: ArrayLike = 0.0,
) -> Array:
    """Covariance (..., 4, 4) of the two-line pose: yaw, pitch (rad), lateral and height (m), with the roll's share.

    Parameters
    ----------
    camera : PinholeCamera
    left, right : LineNoise
    lateral, height : (...) array_like
        m.
    R_cam_from_runway : (..., 3, 3) array_like
        At the predicted pose.
    runway_width : float
        m.
    roll_variance : (...) array_like
        Of the roll angle that was given, rad².

    Returns
    -------
    (..., 4, 4) array
        NaN where the geometry is degenerate.
    """
    rotation = np.asarray(R_cam_from_runway, float)
    y, z = np.broadcast_arrays(np.asarray(lateral, float), -np.asarray(height, float))
    with np.errstate(all="ignore"):
        where, axes, equations, variances = _equations(
            camera, {LEFT: left, RIGHT: right}, np.stack((np.zeros_like(y), y, z), axis=-1), rotation, runway_width
        )
        forward = axes[2]
        rows = late_rows(where, forward, runway_width, *equations)
        share = late_roll(where, forward, runway_width)
        # the roll angle is one more residual, and height is -z
        rows = tuple((*row, part) for row, part in zip(rows, share, strict=True))
        down = rows[3]
        return _covariance((*rows[:3], tuple(-item for item in down)), (*variances, np.asarray(roll_variance, float)))


def late_roll(position: Sequence[Number], optical_axis: Sequence[Number], width: Number) -> tuple[Number, ...]:
    """By how much yaw, pitch, y and z of a two-line pose move with a roll error (rad) that it does not know."""
    f0, f1, f2 = optical_axis
    lateral, down = roll_share(position, width)
    about_x = f0 + f1 * f1 / f0
    return f2, f1 * (f0 * f0 + f1 * f1) ** 0.5 / f0, lateral * about_x, down * about_x
