"""Early stage: the camera's pose from both edges and the threshold.

The steps are those of section 3 of Li, Tang and Shen (Procedia Engineering 15, 2011, 578-584): the vanishing point of
the edges gives the runway's direction, the right angle at the threshold and the known width give the depths of its
corners, Umeyama's method gives the attitude and the coplanarity of each line with its image gives the position.

Written out in components, so that one text serves a single frame in plain floats and a batch in arrays.  Nothing is
divided by the vanishing point's coordinates: its direction is the cross product of the edges' planes, which stays
finite when the point runs to infinity.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from estimator.camera import Number, PinholeCamera
from estimator.pose import ThreeLinePose
from estimator.so3 import Array

PARALLEL = 1e-12
"""Sine of the angle between two planes below which they are taken for parallel."""
UPRIGHT = -1e-9
"""Least component for a direction to count as not pointing backward (or upside down): zero, but for rounding."""


def _unit_of_any_scale(xp: Number, x: Number, y: Number, z: Number) -> tuple[Number, Number, Number]:
    norm = xp.hypot(xp.hypot(x, y), z)  # hypot neither overflows nor underflows, and costs more than a root
    return x / norm, y / norm, z / norm


def _unit(xp: Number, x: Number, y: Number, z: Number) -> tuple[Number, Number, Number]:
    scale = 1.0 / xp.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


def _cross(a: Number, b: Number) -> tuple[Number, Number, Number]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Number, b: Number) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def solve(xp: Any, left: Number, threshold: Number, right: Number, width: Number) -> tuple[Number, ...]:
    """The closed form, in components.

    Parameters
    ----------
    xp : module
        `math` with floats, `numpy` with arrays.
    left, threshold, right : tuple of three float or (...) array
        Normals of the lines' planes, camera frame, any scale and sign.
    width : float or (...) array
        Between the edges, m.

    Returns
    -------
    x, y, z : runway frame, m
    d, e, n : three components each
        Axes of the runway frame in the camera frame: the columns of R_cam_from_runway.
    good : bool
        False where the geometry has no physical solution.

    Raises
    ------
    ZeroDivisionError, ValueError, OverflowError
        With floats, where arrays would hold NaN or infinity.
    """
    n1 = _unit_of_any_scale(xp, *left)
    n2 = _unit_of_any_scale(xp, *threshold)
    n3 = _unit_of_any_scale(xp, *right)

    # direction of the edges, whose image is the vanishing point
    along = _cross(n1, n3)
    sine = xp.sqrt(_dot(along, along))
    d = (along[0] / sine, along[1] / sine, along[2] / sine)

    # rays to the corners of the threshold, which lie in front of the camera
    n12, n32 = _cross(n1, n2), _cross(n3, n2)
    r2, r3 = _unit(xp, *n12), _unit(xp, *n32)
    s2, s3 = xp.copysign(1.0, r2[2]), xp.copysign(1.0, r3[2])
    r2, r3 = (s2 * r2[0], s2 * r2[1], s2 * r2[2]), (s3 * r3[0], s3 * r3[1], s3 * r3[2])

    # depths: k3 = s k2 from the right angle between threshold and edges, k2 from the width
    s = _dot(r2, d) / _dot(r3, d)
    span = (s * r3[0] - r2[0], s * r3[1] - r2[1], s * r3[2] - r2[2])
    length = xp.sqrt(_dot(span, span))
    k2 = width / length

    # attitude: [d, e] and its counterpart, the runway's x and y axes, are orthonormal, and then Umeyama's rotation
    # U S Vᵀ is the matrix with the columns d, e, d × e
    e = (span[0] / length, span[1] / length, span[2] / length)
    n = _cross(d, e)
    # of the two ends of d the one that leaves the camera above the runway
    up = xp.copysign(1.0, _dot(r2, n))
    d = (up * d[0], up * d[1], up * d[2])
    n = (up * n[0], up * n[1], up * n[2])

    x, y, z = coplanarity_position(n1, n2, n3, d, e, n, width)
    good = (sine > PARALLEL) & (s > 0.0) & (k2 > 0.0) & (z < 0.0) & (d[2] > UPRIGHT) & (n[1] > UPRIGHT)
    good = good & xp.isfinite(x + y + z + d[0] + d[1] + d[2] + e[0] + e[1] + e[2])
    return x, y, z, d, e, n, good


def coplanarity_position(
    n1: Number, n2: Number, n3: Number, d: Number, e: Number, n: Number, width: Number
) -> tuple[Number, Number, Number]:
    """Camera position from the three lines and a rotation, by the paper's equation 11.

    Each line lies in its own plane, n_i · (R P_i + T) = 0 for any point P_i of it, so T = -[Σ n_i n_iᵀ]⁻¹ Σ n_i (n_i ·
    R P_i). With three lines Σ n_i n_iᵀ = N Nᵀ, N = [n_1 n_2 n_3], and what remains is the inverse of N in closed form,
    whose columns are cross products.  That also keeps the condition number from being squared.

    Parameters
    ----------
    n1, n2, n3 : three components each
        Unit normals of the planes of left edge, threshold and right edge, camera frame.
    d, e, n : three components each
        Columns of R_cam_from_runway, from these lines or from elsewhere.
    width : float or (...) array
        m.

    Returns
    -------
    x, y, z : runway frame, m
    """
    n23, n12 = _cross(n2, n3), _cross(n1, n2)
    # P_1, P_2, P_3 at the left corner, the middle and the right corner of the threshold
    half = 0.5 * width / _dot(n1, n23)
    b1, b3 = -half * _dot(n1, e), half * _dot(n3, e)
    t = (b1 * n23[0] + b3 * n12[0], b1 * n23[1] + b3 * n12[1], b1 * n23[2] + b3 * n12[2])
    return _dot(d, t), _dot(e, t), _dot(n, t)


def single_point_position(
    n1: Number, n2: Number, n3: Number, d: Number, e: Number, n: Number, width: Number, xp: Any = np
) -> tuple[Number, Number, Number]:
    """Camera position from one corner and a rotation: T = P^c - R P, which the paper sets its coplanarity against.

    The corner is the left one, P_2 = k_2 r_2 with the depth of the paper's equations 2 to 5.  Parameters and result as
    in `coplanarity_position`.
    """
    along = _unit(xp, *_cross(n1, n3))
    r2, r3 = _unit(xp, *_cross(n1, n2)), _unit(xp, *_cross(n3, n2))
    s2, s3 = xp.copysign(1.0, r2[2]), xp.copysign(1.0, r3[2])
    r2, r3 = (s2 * r2[0], s2 * r2[1], s2 * r2[2]), (s3 * r3[0], s3 * r3[1], s3 * r3[2])
    s = _dot(r2, along) / _dot(r3, along)
    span = (s * r3[0] - r2[0], s * r3[1] - r2[1], s * r3[2] - r2[2])
    k2 = width / xp.sqrt(_dot(span, span))
    return -k2 * _dot(d, r2), -0.5 * width - k2 * _dot(e, r2), -k2 * _dot(n, r2)


def angles(xp: Any, d: Number, e: Number, n: Number) -> tuple[Number, Number, Number]:
    """Yaw, pitch and roll (rad) of the camera triad, from the columns of R_cam_from_runway."""
    return xp.atan2(e[2], d[2]), xp.atan2(-n[2], xp.sqrt(d[2] * d[2] + e[2] * e[2])), xp.atan2(n[0], n[1])


def three_line_pose(
    camera: PinholeCamera,
    left: ArrayLike,
    threshold: ArrayLike,
    right: ArrayLike,
    *,
    runway_width: ArrayLike,
) -> ThreeLinePose:
    """Pose of the camera from the image lines of both edges and the threshold.

    Parameters
    ----------
    camera : PinholeCamera
    left, threshold, right : (..., 3) array_like
        Lines [a, b, c], a u + b v + c = 0 in pixels, of any scale and sign.  Leading axes broadcast.
    runway_width : (...) array_like
        Between the edges, m.

    Returns
    -------
    ThreeLinePose
        With the leading shape of the inputs.  An element is not valid where the planes of the edges are parallel, where
        the runway is not in front of an upright camera above it, and where the input is not finite.

    Raises
    ------
    ValueError
        If a line does not have three numbers, shapes do not broadcast, or a width is not above zero.
    """
    one, two, three, width = check_lines("three_line_pose", runway_width, left=left, threshold=threshold, right=right)
    if one.ndim == two.ndim == three.ndim == 1 and width.ndim == 0:
        return _solve_one(camera, one.tolist(), two.tolist(), three.tolist(), float(width))
    with np.errstate(all="ignore"):
        n1, n2, n3 = (camera.plane_normal(line[..., 0], line[..., 1], line[..., 2]) for line in (one, two, three))
        x, y, z, d, e, n, good = solve(np, n1, n2, n3, width)
        yaw, pitch, roll = angles(np, d, e, n)
    values = np.broadcast_arrays(x, y, z, *d, *e, *n, yaw, pitch, roll, good)[:-1]
    result = np.stack(values)
    if not good.all():
        result[:, ~good] = np.nan
    return ThreeLinePose(
        position=np.moveaxis(result[:3], 0, -1),
        R_cam_from_runway=np.moveaxis(result[3:12].reshape(3, 3, *good.shape), (0, 1), (-1, -2)),
        yaw=result[12],
        pitch=result[13],
        roll=result[14],
        valid=good,
    )


def _solve_one(
    camera: PinholeCamera, one: list[float], two: list[float], three: list[float], width: float
) -> ThreeLinePose:
    try:
        x, y, z, d, e, n, good = solve(
            math, camera.plane_normal(*one), camera.plane_normal(*two), camera.plane_normal(*three), width
        )
    except (ZeroDivisionError, ValueError, OverflowError):
        good = False
    if not good:
        nan = np.full((), np.nan)
        return ThreeLinePose(np.full(3, np.nan), np.full((3, 3), np.nan), nan, nan, nan, np.array(False))
    yaw, pitch, roll = angles(math, d, e, n)
    return ThreeLinePose(
        np.array((x, y, z)), np.array((d, e, n)).T, np.array(yaw), np.array(pitch), np.array(roll), np.array(True)
    )


def check_lines(caller: str, runway_width: ArrayLike, **lines: ArrayLike) -> list[Array]:
    """The lines and the width as float arrays; ValueError that names the one which is wrong."""
    arrays = []
    for name, line in lines.items():
        array = np.asarray(line, dtype=float)
        if array.ndim == 0 or array.shape[-1] != 3:
            raise ValueError(f"{caller}: {name} must have the shape (..., 3), not {array.shape}")
        arrays.append(array)
    width = np.asarray(runway_width, dtype=float)
    # a single frame costs less than numpy's reductions over a single number
    if not (0.0 < float(width) < math.inf if width.ndim == 0 else ((width > 0.0) & (width < math.inf)).all()):
        raise ValueError(f"{caller}: runway_width must be finite and above zero, not {runway_width!r}")
    shapes = [a.shape[:-1] for a in arrays if a.ndim > 1]
    if shapes:
        np.broadcast_shapes(*shapes, width.shape)
    return [*arrays, width]
