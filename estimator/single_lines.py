"""Each image line by itself as a measurement of the filter's errors and of the camera's calibration.

A line's residual against the predicted one has two numbers, its offset e (px) at the points' centroid and its angle φ
(rad).  By the sensitivities of `estimator.covariance` they are, to first order in the errors,

    e = ((w × D)·δC + (w × N)·ψ) / s,    φ the same with q in place of w,

so that one edge, or the threshold alone, tells the filter what it can.  With all lines of a frame taken it is the same
information as the pose of `estimator.innovation`, whose numbers are these residuals solved for the pose.

What the camera's calibration leaves unknown are eight constants, `Calibration`.  The value of the predicted line at a
pixel, N·w / s, moves with each of them:

- a small rotation of the camera about its own axis i: (w × N)·axis / s,
- the focal length, by a share k: e = -(n_x X + n_y Y) / s with n = R N and the pixel's normalised coordinates X, Y,
- the principal point: e = -a / s and -b / s,
- the runway's width: ±w_z / (2 s) of the left and the right edge,
- radial distortion, which moves a point at the distance r from the principal point outwards by κ r² of that distance:
  across a line that passes at ρ, points at σ along it move by κ ρ (ρ² + σ²) / f², whose mean over the points is the
  offset and whose slope the angle.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator import covariance
from estimator.camera import Intrinsics
from estimator.compiled import compiled, exp, rotate
from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.mount import camera_axes, camera_position
from estimator.so3 import Array, Vec3
from estimator.strapdown import STATES, corrected, unpacked

LINES = 3
NUMBERS = 2 * LINES
ALL = 0b111
"""Of lines as a number: bit i for line i, left edge, threshold, right edge."""
BOTH_EDGES = (1 << LEFT) | (1 << RIGHT)

_predicted_line = compiled(covariance.predicted_line)


class Calibration(NamedTuple):
    """What the camera and the runway differ by from what is believed; as an array, in this order."""

    tilt: float = 0.0
    """Of the optical axis: so much lower than the mount's angle says, rad."""
    pan: float = 0.0
    """So much further to the right, rad."""
    roll: float = 0.0
    """The right side so much further down, rad."""
    focal_length: float = 0.0
    """By this share longer."""
    principal_u: float = 0.0
    """px."""
    principal_v: float = 0.0
    """px."""
    distortion: float = 0.0
    """κ: a point at r (in focal lengths) from the principal point is seen at r (1 + κ r²)."""
    width: float = 0.0
    """The runway is so much wider, m."""


CONSTANTS = len(Calibration._fields)
AUGMENTED = STATES + CONSTANTS
_TILT, _PAN, _ROLL, _FOCAL, _PRINCIPAL, _DISTORTION, _WIDTH = (STATES + i for i in (0, 1, 2, 3, 4, 6, 7))
NO_CALIBRATION = np.zeros(CONSTANTS)


@compiled
def calibrated_axes(axes: tuple[Vec3, Vec3, Vec3], pan: float, roll: float) -> tuple[Vec3, Vec3, Vec3]:
    """The camera's axes turned about its own y axis (pan) and z axis (roll), rad."""
    if pan == 0.0 and roll == 0.0:
        return axes
    e = exp((0.0, pan, roll))
    (x0, x1, x2), (y0, y1, y2), (z0, z1, z2) = axes
    return (
        (e[0] * x0 + e[3] * y0 + e[6] * z0, e[0] * x1 + e[3] * y1 + e[6] * z1, e[0] * x2 + e[3] * y2 + e[6] * z2),
        (e[1] * x0 + e[4] * y0 + e[7] * z0, e[1] * x1 + e[4] * y1 + e[7] * z1, e[1] * x2 + e[4] * y2 + e[7] * z2),
        (e[2] * x0 + e[5] * y0 + e[8] * z0, e[2] * x1 + e[5] * y1 + e[8] * z1, e[2] * x2 + e[5] * y2 + e[8] * z2),
    )


@compiled
def line_residuals(
    eye: Array, lines: Array, extent: Array, nominal: Array, calibration: Array, tilt: float
) -> tuple[Array, Array]:
    """Residuals of the lines, true less predicted, and what they are of the errors.

    Parameters
    ----------
    eye : (9,) array
        As `estimator.innovation.Eye.numbers` gives it.
    lines : (3, 7) array
        As `estimator.innovation.Lines.numbers` gives them; NaN for a line that was not found.
    extent : (3,) array
        Mean square distance of each line's points from their centroid, px².
    nominal : (15 or more,) array
        Predicted state of the body, as `Inertial.numbers` gives it.
    calibration : (8,) array
        As estimated, in the order of `Calibration`.
    tilt : float
        Mount angle as read, rad.

    Returns
    -------
    d : (6,) array
        Offset (px) and angle (rad) of left edge, threshold and right edge; NaN for a line that was not found.
    H : (6, 23) array
        d = H δ + noise, of the 15 errors of the filter and those of the calibration.
    """
    d, H = np.full(6, np.nan), np.zeros((6, AUGMENTED))
    longer = 1.0 + calibration[3]
    camera = Intrinsics(longer * eye[0], longer * eye[1], eye[2] + calibration[4], eye[3] + calibration[5])
    width, lever = eye[4] + calibration[7], (eye[5], eye[6], eye[7])
    body = unpacked(nominal)
    axes = calibrated_axes(camera_axes(body.attitude, tilt + calibration[0]), calibration[1], calibration[2])
    (x0, x1, x2), (y0, y1, y2), (z0, z1, z2) = axes
    where = camera_position(body.position, body.attitude, lever)
    r0, r1, r2 = rotate(body.attitude, lever)
    for line in range(3):
        if np.isnan(lines[line, 0]):
            continue
        predicted = _predicted_line(camera, line, where, axes, width)
        n0, n1, n2 = predicted.normal
        s = predicted.gradient
        a, b = predicted.a / s, predicted.b / s
        u, v = lines[line, 3], lines[line, 4]
        off = a * u + b * v + predicted.c / s
        sine = a * lines[line, 1] - b * lines[line, 0]
        if a * lines[line, 0] + b * lines[line, 1] < 0.0:
            sine = -sine
        u, v = u - off * a, v - off * b
        for k in range(2):
            # the ray of the pixel, then that of a step along the line
            if k == 0:
                across, down, ahead = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0
            else:
                across, down, ahead = b / camera.fx, -a / camera.fy, 0.0
            w0 = across * x0 + down * y0 + ahead * z0
            w1 = across * x1 + down * y1 + ahead * z1
            w2 = across * x2 + down * y2 + ahead * z2
            if line == THRESHOLD:  # w × D / s
                g0, g1, g2 = -w2 / s, 0.0, w0 / s
            else:
                g0, g1, g2 = 0.0, w2 / s, -w1 / s
            t0, t1, t2 = (w1 * n2 - w2 * n1) / s, (w2 * n0 - w0 * n2) / s, (w0 * n1 - w1 * n0) / s
            row = 2 * line + k
            H[row, 0], H[row, 1], H[row, 2] = g0, g1, g2
            H[row, 6] = t0 + r1 * g2 - r2 * g1
            H[row, 7] = t1 + r2 * g0 - r0 * g2
            H[row, 8] = t2 + r0 * g1 - r1 * g0
            # the axis lies lower by a turn of nose down, against that about the camera's x axis
            H[row, _TILT] = -(t0 * x0 + t1 * x1 + t2 * x2)
            H[row, _PAN] = t0 * y0 + t1 * y1 + t2 * y2
            H[row, _ROLL] = t0 * z0 + t1 * z1 + t2 * z2
            H[row, _FOCAL] = -(a * (u - camera.cx) + b * (v - camera.cy)) / longer if k == 0 else 0.0
            if line != THRESHOLD:
                H[row, _WIDTH] = (0.5 if line == LEFT else -0.5) * w2 / s
        H[2 * line, _PRINCIPAL], H[2 * line, _PRINCIPAL + 1] = -a, -b
        # the foot of the principal point on the line, and the points along it
        rho = a * (u - camera.cx) + b * (v - camera.cy)
        along = b * (u - camera.cx) - a * (v - camera.cy)
        square = camera.fx * camera.fy
        H[2 * line, _DISTORTION] = -rho * (rho * rho + along * along + extent[line]) / square
        H[2 * line + 1, _DISTORTION] = -2.0 * rho * along / square
        d[2 * line] = -off - H[2 * line, _DISTORTION] * calibration[6]
        d[2 * line + 1] = -sine - H[2 * line + 1, _DISTORTION] * calibration[6]
    return d, H


@compiled
def _normalised(rows: NDArray[np.int64], d: Array, S: Array) -> float:
    """D' S⁻¹ d of some rows; infinite where S has no Cholesky factor."""
    n = len(rows)
    root, z, total = np.zeros((n, n)), np.zeros(n), 0.0
    for i in range(n):
        for j in range(i + 1):
            rest = S[rows[i], rows[j]]
            for k in range(j):
                rest -= root[i, k] * root[j, k]
            if j < i:
                root[i, j] = rest / root[j, j]
            elif rest > 0.0:
                root[i, i] = math.sqrt(rest)
            else:
                return np.inf
        rest = d[rows[i]]
        for k in range(i):
            rest -= root[i, k] * z[k]
        z[i] = rest / root[i, i]
        total += z[i] * z[i]
    return total


@compiled
def _rows(lines: int) -> NDArray[np.int64]:
    """Of the residuals of lines, given as bits."""
    result, n = np.empty(6, np.int64), 0
    for line in range(3):
        if lines & (1 << line):
            result[n], result[n + 1] = 2 * line, 2 * line + 1
            n += 2
    return result[:n]


@compiled
def believed_lines(d: Array, S: Array, gates: Array) -> tuple[int, int, float]:
    """Which of a frame's lines agree with the prediction, and with each other.

    A line that by itself is past the gate of two numbers is left out.  If those that remain are past theirs together,
    the one without which the others agree is left out too.  Where there are several of that kind it is not known which
    of them is wrong, and none of them is believed; nor is any line where there is none of that kind.

    Parameters
    ----------
    d : (6,) array
        Residuals; NaN for a line that was not found.
    S : (6, 6) array
        Their predicted covariance.
    gates : (3,) array
        Largest normalised square that is believed of one, two and three lines.

    Returns
    -------
    found, believed : int
        Lines as bits.
    nis : float
        Normalised innovation squared of those that are believed, or of all that were found if none is.
    """
    found, good = 0, 0
    for line in range(3):
        if np.isfinite(d[2 * line] + d[2 * line + 1]):
            found |= 1 << line
            if _normalised(_rows(1 << line), d, S) <= gates[0]:
                good |= 1 << line
    if good == 0:
        return found, 0, _normalised(_rows(found), d, S) if found else np.nan
    together = _normalised(_rows(good), d, S)
    if together <= gates[len(_rows(good)) // 2 - 1]:
        return found, good, together
    # of two lines that disagree neither is known to be the right one; of three that without which the others agree
    certain, none = good, True
    if len(_rows(good)) == 6:
        for line in range(3):
            rest = good & ~(1 << line)
            if _normalised(_rows(rest), d, S) <= gates[1]:
                certain &= rest
                none = False
    if none or certain == 0:
        return found, 0, _normalised(_rows(found), d, S)
    return found, certain, _normalised(_rows(certain), d, S)


@compiled
def lines_innovation(
    eye: Array,
    lines: Array,
    extent: Array,
    nominal: Array,
    calibration: Array,
    tilt: float,
    covariance: Array,
    gates: Array,
    point: Array,
) -> tuple[Array, Array, Array, int, int, float]:
    """The measurement that the believed lines of a frame make of the errors of a predicted state.

    The residuals d and their matrix H are those at the predicted state moved by `point`; y = d + H point is the
    measurement of the errors of the predicted state itself, as an iterated filter has it (Jazwinski, Stochastic
    Processes and Filtering Theory, section 8.3).

    Parameters
    ----------
    eye, lines, extent, nominal, calibration, tilt
        As for `line_residuals`.
    covariance : (23, 23) or larger array
        Of the predicted errors; on what follows the calibration no line depends.
    gates : (3,) array
        As for `believed_lines`.
    point : (23 or more,) array
        Errors of the predicted state at which the lines are linearised; zero for the predicted state itself.

    Returns
    -------
    y, H, R : (n,), (n, 23 or more) and (n, n) array
        n is two for each line that is believed.
    found, believed : int
    nis : float
        As `believed_lines` gives them.
    """
    if np.any(point):
        moved = corrected(nominal, point)
        d, H = line_residuals(eye, lines, extent, moved, calibration + point[STATES:AUGMENTED], tilt)
        for i in range(6):
            for j in range(AUGMENTED):
                d[i] += H[i, j] * point[j]
    else:
        d, H = line_residuals(eye, lines, extent, nominal, calibration, tilt)
    size = covariance.shape[0]
    HP = np.zeros((6, size))
    R, S = np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(6):
        for k in range(AUGMENTED):
            if H[i, k] != 0.0:
                for j in range(size):
                    HP[i, j] += H[i, k] * covariance[k, j]
        # the reading of the mount's angle is off for all lines alike
        for j in range(6):
            R[i, j] = H[i, _TILT] * H[j, _TILT] * eye[8]
        R[i, i] += lines[i // 2, 5 + i % 2]
    for i in range(6):
        for j in range(6):
            S[i, j] = R[i, j]
            for k in range(AUGMENTED):
                S[i, j] += HP[i, k] * H[j, k]
    found, believed, nis = believed_lines(d, S, gates)
    rows = _rows(believed)
    n = len(rows)
    y, rows_of_H, block = np.empty(n), np.zeros((n, size)), np.empty((n, n))
    for i in range(n):
        y[i] = d[rows[i]]
        rows_of_H[i, :AUGMENTED] = H[rows[i]]
        for j in range(n):
            block[i, j] = R[rows[i], rows[j]]
    return y, rows_of_H, block, found, believed, nis


def gates_of(probability: float) -> Array:
    """Normalised squares (3,) of two, four and six numbers that are passed by chance with a probability.

    Of an even number 2 m of degrees of freedom the χ² distribution has the tail exp(-x/2) Σ_{k<m} (x/2)^k / k!.
    """
    result = np.empty(LINES)
    for m in range(1, LINES + 1):
        low, high = 0.0, 2000.0
        for _ in range(80):
            x = 0.5 * (low + high)
            tail = math.exp(-0.5 * x) * sum((0.5 * x) ** k / math.factorial(k) for k in range(m))
            low, high = (x, high) if tail > probability else (low, x)
        result[m - 1] = high
    return result
