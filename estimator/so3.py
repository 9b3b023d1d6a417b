"""Rotations on plain numbers: 3-vectors as 3-tuples, 3 × 3 matrices as 9-tuples, row by row.

On tuples of floats the same text serves as it stands and compiled (`estimator.compiled`), where a small array would
cost more to allocate than to compute with.  Every function is pure; those that are compiled call no other.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vec3: TypeAlias = tuple[float, float, float]
Mat3: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
Array: TypeAlias = NDArray[np.float64]

IDENTITY: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def flat(matrix: ArrayLike) -> Mat3:
    """A (3, 3) array as a 9-tuple, row by row."""
    a, b, c, d, e, f, g, h, i = np.asarray(matrix, dtype=float).ravel().tolist()
    return a, b, c, d, e, f, g, h, i


def matmul(a: Mat3, b: Mat3) -> Mat3:
    """The product a b."""
    a0, a1, a2, a3, a4, a5, a6, a7, a8 = a
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = b
    return (
        a0 * b0 + a1 * b3 + a2 * b6,
        a0 * b1 + a1 * b4 + a2 * b7,
        a0 * b2 + a1 * b5 + a2 * b8,
        a3 * b0 + a4 * b3 + a5 * b6,
        a3 * b1 + a4 * b4 + a5 * b7,
        a3 * b2 + a4 * b5 + a5 * b8,
        a6 * b0 + a7 * b3 + a8 * b6,
        a6 * b1 + a7 * b4 + a8 * b7,
        a6 * b2 + a7 * b5 + a8 * b8,
    )


def transpose(a: Mat3) -> Mat3:
    """The transpose, which is the inverse of a rotation."""
    return a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]


def rotate(a: Mat3, v: Vec3) -> Vec3:
    """The product a v."""
    x, y, z = v
    return (
        a[0] * x + a[1] * y + a[2] * z,
        a[3] * x + a[4] * y + a[5] * z,
        a[6] * x + a[7] * y + a[8] * z,
    )


def rotate_back(a: Mat3, v: Vec3) -> Vec3:
    """The product aᵀ v."""
    x, y, z = v
    return (
        a[0] * x + a[3] * y + a[6] * z,
        a[1] * x + a[4] * y + a[7] * z,
        a[2] * x + a[5] * y + a[8] * z,
    )


def exp(vector: Vec3) -> Mat3:
    """The rotation matrix of a rotation vector (rad), by Rodrigues' formula."""
    x, y, z = vector
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-8:  # the series is exact to rounding here, and has no 0/0
        s = 1.0 - angle2 / 6.0
        c = 0.5 - angle2 / 24.0
    else:
        angle = math.sqrt(angle2)
        s = math.sin(angle) / angle
        c = (1.0 - math.cos(angle)) / angle2
    return (
        1.0 - c * (y * y + z * z),
        c * x * y - s * z,
        c * x * z + s * y,
        c * x * y + s * z,
        1.0 - c * (x * x + z * z),
        c * y * z - s * x,
        c * x * z - s * y,
        c * y * z + s * x,
        1.0 - c * (x * x + y * y),
    )


def log(a: Mat3) -> Vec3:
    """The rotation vector (rad) of a rotation matrix; for angles below π."""
    return log_between(IDENTITY, a)


def log_between(a: Mat3, b: Mat3) -> Vec3:
    """The rotation vector (rad) of aᵀ b, without the product's other numbers; for angles below π."""
    a0, a1, a2, a3, a4, a5, a6, a7, a8 = a
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = b
    x = 0.5 * (a2 * b1 + a5 * b4 + a8 * b7 - a1 * b2 - a4 * b5 - a7 * b8)
    y = 0.5 * (a0 * b2 + a3 * b5 + a6 * b8 - a2 * b0 - a5 * b3 - a8 * b6)
    z = 0.5 * (a1 * b0 + a4 * b3 + a7 * b6 - a0 * b1 - a3 * b4 - a6 * b7)
    trace = a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3 + a4 * b4 + a5 * b5 + a6 * b6 + a7 * b7 + a8 * b8
    cosine = 0.5 * (trace - 1.0)
    sine2 = x * x + y * y + z * z
    if sine2 < 1e-8 and cosine > 0.0:
        k = 1.0 + sine2 / 6.0
    else:
        sine = math.sqrt(sine2)
        k = math.atan2(sine, cosine) / sine
    return k * x, k * y, k * z


def from_euler(roll: float, pitch: float, yaw: float) -> Mat3:
    """The matrix that takes triad vectors to the reference frame, of intrinsic z-y-x angles (rad).

    The triad is forward, right, down.  Right side down, nose up and nose right are positive.
    """
    sr, cr = math.sin(roll), math.cos(roll)
    sp, cp = math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    return (
        cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy,
        cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy,
        -sp, sr * cp, cr * cp,
    )  # fmt: skip


def to_euler(a: Mat3) -> Vec3:
    """Roll, pitch and yaw (rad) of a matrix that takes triad vectors to the reference frame."""
    return (
        math.atan2(a[7], a[8]),
        math.atan2(-a[6], math.hypot(a[0], a[3])),
        math.atan2(a[3], a[0]),
    )
