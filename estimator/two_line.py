"""Late stage: yaw, pitch, lateral position and height from both edges and a roll angle.

Section 4 of Li, Tang and Shen (2011): R(roll) R(pitch) R(yaw) takes the runway's direction to that of the vanishing
point, which with a known roll gives yaw and pitch; the planes of the two edges then give lateral position and height.
The longitudinal position is not observable.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from estimator.camera import Number, PinholeCamera
from estimator.pose import TwoLinePose
from estimator.three_line import PARALLEL, UPRIGHT, _cross, _dot, _unit_of_any_scale, check_lines


def solve(xp: Any, left: Number, right: Number, width: Number, roll: Number) -> tuple[Number, ...]:
    """The closed form, in components.

    Parameters
    ----------
    xp : module
        `math` with floats, `numpy` with arrays.
    left, right : tuple of three float or (...) array
        Normals of the edges' planes, camera frame, any scale and sign.
    width, roll : float or (...) array
        m, rad.

    Returns
    -------
    yaw, pitch, lateral, height, good
    """
    n1 = _unit_of_any_scale(xp, *left)
    n3 = _unit_of_any_scale(xp, *right)
    along = _cross(n1, n3)
    sine = xp.sqrt(_dot(along, along))

    # triad axes (forward, right, down) are the camera's z, x, y; undoing the roll leaves
    # u = (cos pitch cos yaw, -sin yaw, sin pitch cos yaw)
    sr, cr = xp.sin(roll), xp.cos(roll)
    ux = along[2] / sine
    uy = (cr * along[0] - sr * along[1]) / sine
    uz = (sr * along[0] + cr * along[1]) / sine
    cos_yaw = xp.sqrt(ux * ux + uz * uz)
    sp, cp = uz / cos_yaw, ux / cos_yaw

    # components of the planes' normals along the runway's y and z axes, which in the frame of u are
    # (cp sin yaw, cos yaw, sp sin yaw) and (-sp, 0, cp), sin yaw = -uy
    y1, z1 = _cross_section(n1, sr, cr, sp, cp, uy, cos_yaw)
    y3, z3 = _cross_section(n3, sr, cr, sp, cp, uy, cos_yaw)
    # an edge at y = ∓ width/2 seen from (lateral, height): z/y = (lateral ± width/2) / height
    apart = z1 * y3 - z3 * y1
    height = width * y1 * y3 / apart
    lateral = 0.5 * width * (z1 * y3 + z3 * y1) / apart

    # the other end of the direction turns the runway's z axis over: take the one that leaves the camera above
    up = xp.copysign(1.0, height)
    yaw = xp.atan2(-up * uy, cos_yaw)
    pitch = xp.atan2(up * uz, up * ux)
    height = up * height
    good = (sine > PARALLEL) & (height > 0.0) & (up * ux > UPRIGHT) & xp.isfinite(yaw + pitch + lateral + height)
    return yaw, pitch, lateral, height, good


def _cross_section(
    n: Number, sr: Number, cr: Number, sp: Number, cp: Number, uy: Number, cos_yaw: Number
) -> tuple[Number, Number]:
    forward, right, down = n[2], cr * n[0] - sr * n[1], sr * n[0] + cr * n[1]
    return cos_yaw * right - uy * (cp * forward + sp * down), cp * down - sp * forward


def two_line_pose(
    camera: PinholeCamera, left: ArrayLike, right: ArrayLike, *, runway_width: ArrayLike, roll: ArrayLike
) -> TwoLinePose:
    """Yaw, pitch, lateral position and height of the camera from the image lines of both edges and its roll angle.

    Parameters
    ----------
    camera : PinholeCamera
    left, right : (..., 3) array_like
        Lines [a, b, c], a u + b v + c = 0 in pixels, of any scale and sign.  Leading axes broadcast.
    runway_width : (...) array_like
        Between the edges, m.
    roll : (...) array_like
        Of the camera triad, rad.

    Returns
    -------
    TwoLinePose
        An element is not valid where the planes of the edges are parallel, where the runway does not run away from a
        camera above it, and where the input is not finite.

    Raises
    ------
    ValueError
        If a line does not have three numbers, shapes do not broadcast, or a width is not above zero.
    """
    one, three, width = check_lines("two_line_pose", runway_width, left=left, right=right)
    angle = np.asarray(roll, dtype=float)
    if one.ndim == three.ndim == 1 and width.ndim == angle.ndim == 0:
        return _solve_one(camera, one.tolist(), three.tolist(), float(width), float(angle))
    shape = np.broadcast_shapes(one.shape[:-1], three.shape[:-1], width.shape, angle.shape)
    with np.errstate(all="ignore"):
        *values, good = solve(
            np,
            camera.plane_normal(one[..., 0], one[..., 1], one[..., 2]),
            camera.plane_normal(three[..., 0], three[..., 1], three[..., 2]),
            width,
            angle,
        )
    result = np.stack([np.broadcast_to(value, shape) for value in values])
    result[:, ~good] = np.nan
    yaw, pitch, lateral, height = result
    return TwoLinePose(yaw=yaw, pitch=pitch, lateral=lateral, height=height, valid=good)


def _solve_one(camera: PinholeCamera, one: list[float], three: list[float], width: float, roll: float) -> TwoLinePose:
    try:
        yaw, pitch, lateral, height, good = solve(
            math, camera.plane_normal(*one), camera.plane_normal(*three), width, roll
        )
    except (ZeroDivisionError, ValueError, OverflowError):
        good = False
    if not good:
        yaw = pitch = lateral = height = math.nan
    return TwoLinePose(np.array(yaw), np.array(pitch), np.array(lateral), np.array(height), np.array(good))
