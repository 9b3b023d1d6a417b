"""Inertial mechanisation in the runway frame, which is fixed to the Earth, and its error model.

The state is position and velocity of the inertial unit and the attitude of the body.  Increments of the unit are
relative to inertial space, so the Earth's rotation is taken off, and the Coriolis acceleration is that of the rotating
frame (Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., section 3.5.3).  Gravity turns with the
place: a kilometre away from the threshold it leans by 0.16 mg.

Errors are true less estimated; that of the attitude is a rotation vector ψ in the runway frame,
R_true = exp([ψ×]) R_estimated.
"""

from collections.abc import Iterator
from itertools import chain, repeat
from typing import NamedTuple

import numpy as np

from estimator.compiled import compiled, exp, log_between, matmul, to_euler
from estimator.so3 import Array, Mat3, Vec3

POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCEL_BIAS = (slice(3 * i, 3 * i + 3) for i in range(5))
STATES = 15
AXES = 6
"""Three gyros and three accelerometers."""
NOMINAL = 18
"""Numbers of a nominal state as an array: position, velocity, attitude (9, row by row), and the specific force
(runway frame, m/s) integrated since it was last set to zero."""


class Site(NamedTuple):
    """Where the runway frame stands on the Earth."""

    gravity: float
    """At the origin, m/s²."""
    earth_rate: Vec3
    """Runway frame, rad/s."""
    radius: float
    """Of the Earth, m."""

    def numbers(self) -> Array:
        """(5,) array, as the functions over arrays take it."""
        return np.array((self.gravity, *self.earth_rate, self.radius))


class Inertial(NamedTuple):
    """Position (m), velocity (m/s), runway frame, and attitude R_runway_from_body."""

    position: Vec3
    velocity: Vec3
    attitude: Mat3

    def numbers(self) -> Array:
        """(18,) array, as the functions over arrays take it, with no specific force yet."""
        return np.array((*self.position, *self.velocity, *self.attitude, 0.0, 0.0, 0.0))


def inertial(nominal: Array) -> Inertial:
    """The tuples of a nominal state (15 or more,)."""
    n = nominal.tolist()
    return Inertial((n[0], n[1], n[2]), (n[3], n[4], n[5]), (n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14]))


class ImuNoise(NamedTuple):
    """Spectral densities of the inertial unit's noise, and standard deviations of its biases at the start."""

    gyro: float
    """rad/√s."""
    accel: float
    """m/s/√s."""
    gyro_drift: float
    """Random walk of the bias, rad/s/√s."""
    accel_drift: float
    """m/s²/√s."""
    gyro_bias: float
    """rad/s."""
    accel_bias: float
    """m/s²; what a scale factor makes of gravity is in it."""
    scale_factor: float = 0.0
    """Relative, of gyros and accelerometers alike, for a filter that estimates it."""


def gravity_at(site: Site, position: Vec3) -> Vec3:
    """Gravity (m/s², runway frame) near the origin: it points to the Earth's centre and falls off with the height."""
    g = site.gravity
    k = g / site.radius
    return -k * position[0], -k * position[1], g + 2.0 * k * position[2]


@compiled
def propagate(state: Inertial, site: Site, angle: Vec3, velocity: Vec3, dt: float) -> tuple[Inertial, Vec3]:
    """One interval of the inertial unit.

    Parameters
    ----------
    state : Inertial
        At the interval's start.
    site : Site
    angle : (3,) float
        Integrated angular rate relative to inertial space, less its bias, body frame, rad.
    velocity : (3,) float
        Integrated specific force, less its bias, body frame at the interval's start, m/s.
    dt : float
        s.

    Returns
    -------
    Inertial
        At the interval's end.
    force : (3,) float
        The interval's integrated specific force in the runway frame, m/s.
    """
    (px, py, pz), (vx, vy, vz), attitude = state
    a, b, c, d, e, f, g, h, i = attitude
    gravity, (ex, ey, ez), radius = site
    fx, fy, fz = velocity
    force = (a * fx + b * fy + c * fz, d * fx + e * fy + f * fz, g * fx + h * fy + i * fz)
    # v' = R f + g - 2 ω × v, gravity as in gravity_at
    k = gravity / radius
    ux = vx + force[0] - (k * px + 2.0 * (ey * vz - ez * vy)) * dt
    uy = vy + force[1] - (k * py + 2.0 * (ez * vx - ex * vz)) * dt
    uz = vz + force[2] + (gravity + 2.0 * (k * pz - ex * vy + ey * vx)) * dt
    half = 0.5 * dt
    turn = (
        angle[0] - dt * (a * ex + d * ey + g * ez),
        angle[1] - dt * (b * ex + e * ey + h * ez),
        angle[2] - dt * (c * ex + f * ey + i * ez),
    )
    moved = (px + half * (vx + ux), py + half * (vy + uy), pz + half * (vz + uz))
    return Inertial(moved, (ux, uy, uz), matmul(attitude, exp(turn))), force


@compiled
def increments(
    position: Vec3, velocity: Vec3, attitude: Mat3, next_velocity: Vec3, next_attitude: Mat3, site: Site, dt: float
) -> tuple[Vec3, Vec3]:
    """What an ideal inertial unit reports over an interval: the inverse of `propagate`.

    Parameters
    ----------
    position, velocity, attitude
        At the interval's start, as in `Inertial`.
    next_velocity, next_attitude
        At its end.
    site : Site
    dt : float
        s.

    Returns
    -------
    angle, velocity : (3,) float
        rad and m/s, as `propagate` takes them.
    """
    px, py, pz = position
    vx, vy, vz = velocity
    ux, uy, uz = next_velocity
    a, b, c, d, e, f, g, h, i = attitude
    gravity, (ex, ey, ez), radius = site
    k = gravity / radius
    fx = ux - vx + (k * px + 2.0 * (ey * vz - ez * vy)) * dt
    fy = uy - vy + (k * py + 2.0 * (ez * vx - ex * vz)) * dt
    fz = uz - vz - (gravity + 2.0 * (k * pz - ex * vy + ey * vx)) * dt
    turn = log_between(attitude, next_attitude)
    return (
        (
            turn[0] + dt * (a * ex + d * ey + g * ez),
            turn[1] + dt * (b * ex + e * ey + h * ez),
            turn[2] + dt * (c * ex + f * ey + i * ez),
        ),
        (a * fx + d * fy + g * fz, b * fx + e * fy + h * fz, c * fx + f * fy + i * fz),
    )


@compiled
def unpacked(n: Array) -> Inertial:
    """As `inertial`, for compiled functions."""
    return Inertial((n[0], n[1], n[2]), (n[3], n[4], n[5]), (n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14]))


@compiled
def advance(nominal: Array, bias: Array, sample: Array, site: Array, dt: float) -> Array:
    """One interval of the inertial unit, as `propagate`, over arrays.

    Parameters
    ----------
    nominal : (18,) array
        At the interval's start, as `Inertial.numbers` gives it.
    bias : (6,) array
        Gyros (rad/s) and accelerometers (m/s²), taken off the sample.
    sample : (6,) array
        Integrated angular rate (rad) and specific force (m/s), body frame.
    site : (5,) array
        As `Site.numbers` gives it.
    dt : float
        s.

    Returns
    -------
    (18,) array
        At the interval's end.
    """
    result = np.empty(NOMINAL)
    advance_into(result, nominal, bias, sample, site, dt)
    return result


@compiled
def advance_into(
    result: Array, nominal: Array, bias: Array, sample: Array, site: Array, dt: float
) -> tuple[float, float]:
    """Write to `result` (18,) what `advance` gives; return the roll and the pitch (rad) there."""
    place = Site(site[0], (site[1], site[2], site[3]), site[4])
    angle = (sample[0] - bias[0] * dt, sample[1] - bias[1] * dt, sample[2] - bias[2] * dt)
    velocity = (sample[3] - bias[3] * dt, sample[4] - bias[4] * dt, sample[5] - bias[5] * dt)
    moved, force = propagate(unpacked(nominal), place, angle, velocity, dt)
    for i in range(3):
        result[i] = moved.position[i]
        result[3 + i] = moved.velocity[i]
        result[15 + i] = nominal[15 + i] + force[i]
    for i in range(9):
        result[6 + i] = moved.attitude[i]
    roll, pitch, _ = to_euler(moved.attitude)
    return roll, pitch


def rows(width: int) -> Iterator[Array]:
    """Arrays (width,) without end, to be written to; made many at a time, which is cheaper than one by one."""
    return chain.from_iterable(np.empty((256, width)) for _ in repeat(None))


@compiled
def ideal_sample(before: Array, after: Array, site: Array, dt: float) -> Array:
    """What an ideal inertial unit reports between two states (15 or more,), as `increments`: (6,) array."""
    result = np.empty(6)
    ideal_sample_into(result, before, after, site, dt)
    return result


@compiled
def ideal_sample_into(result: Array, before: Array, after: Array, site: Array, dt: float) -> None:
    """Write to `result` (6,) what `ideal_sample` gives."""
    place = Site(site[0], (site[1], site[2], site[3]), site[4])
    start, end = unpacked(before), unpacked(after)
    angle, velocity = increments(start.position, start.velocity, start.attitude, end.velocity, end.attitude, place, dt)
    for i in range(3):
        result[i] = angle[i]
        result[3 + i] = velocity[i]


@compiled
def euler(nominal: Array) -> Vec3:
    """Roll, pitch and yaw (rad) of a nominal state."""
    return to_euler(unpacked(nominal).attitude)


@compiled
def transition(nominal: Array, dt: float) -> Array:
    """Transition matrix of the 15 errors over several intervals of the inertial unit.

    To second order in time where a bias or the attitude moves velocity and position; what a gyro bias does to them
    within the time is of a higher order, and reaches them through the attitude in the next.

    Parameters
    ----------
    nominal : (18,) array
        At the end of the time, with the specific force integrated over it.
    dt : float
        s.

    Returns
    -------
    (15, 15) array
    """
    x, y, z = nominal[15], nominal[16], nominal[17]
    result = np.eye(STATES)
    half = 0.5 * dt
    for i in range(3):
        result[i, 3 + i] = dt
        for j in range(3):
            turned = -dt * nominal[6 + 3 * i + j]
            result[i, 12 + j] = half * turned
            result[3 + i, 12 + j] = turned
            result[6 + i, 9 + j] = turned
    # minus the cross product with the force: ψ turns it by ψ × f
    result[3, 7], result[3, 8], result[4, 6] = z, -y, -z
    result[4, 8], result[5, 6], result[5, 7] = x, y, -x
    for i in range(3):
        for j in range(3):
            result[i, 6 + j] = half * result[3 + i, 6 + j]
    return result


@compiled
def predicted(nominal: Array, covariance: Array, noise: Array, dt: float) -> tuple[Array, Array]:
    """Covariance of the errors over several intervals of the inertial unit, F P Fᵀ + Q with F as `transition`.

    Three quarters of F are zero, and the rows of a product that they would add to are left out.

    Parameters
    ----------
    nominal : (18,) array
        At the end of the time, with the specific force integrated over it.
    covariance : (15, 15) array
        P, symmetric, at the beginning of the time.
    noise : (15, 15) array
        Q.
    dt : float
        s.

    Returns
    -------
    (18,), (15, 15) array
        The nominal state with no specific force any more, and the covariance at the end of the time.
    """
    F = transition(nominal, dt)
    half, result = np.zeros((STATES, STATES)), noise.copy()
    _add_product(half, F, covariance)
    _add_product(result, F, half.T.copy())  # F (F P)ᵀ = F P Fᵀ
    moved = nominal.copy()
    moved[15:] = 0.0
    return moved, result


@compiled
def predicted_with_constants(
    nominal: Array, covariance: Array, noise: Array, dt: float, turned: Array, first_scale: int
) -> tuple[Array, Array]:
    """As `predicted`, of a covariance (n, n) in which constants follow the 15 errors.

    Six of them may be the scale factors of the inertial unit: what it measured over the time is off by so much of it,
    as a bias is off by so much a second.

    Parameters
    ----------
    nominal, covariance, noise, dt
        As for `predicted`, the covariance (n, n).
    turned : (6,) array
        What the inertial unit measured over the time, angle (rad) and velocity (m/s), body frame.
    first_scale : int
        Row of the first scale factor; n where there are none.
    """
    n = covariance.shape[0]
    F, half, result = np.eye(n), np.zeros((n, n)), np.zeros((n, n))
    F[:STATES, :STATES] = transition(nominal, dt)
    if first_scale < n:
        for i in range(3):
            for j in range(3):
                body = -nominal[6 + 3 * i + j]
                F[6 + i, first_scale + j] = body * turned[j]
                F[3 + i, first_scale + 3 + j] = body * turned[3 + j]
                F[i, first_scale + 3 + j] = 0.5 * dt * body * turned[3 + j]
    result[:STATES, :STATES] = noise
    _add_product(half, F, covariance)
    _add_product(result, F, half.T.copy())
    moved = nominal.copy()
    moved[15:] = 0.0
    return moved, result


@compiled
def _add_product(result: Array, sparse: Array, matrix: Array) -> None:
    """Add the product of two square matrices, of which the first is mostly zero, to a third."""
    n = len(sparse)
    for i in range(n):
        for k in range(n):
            factor = sparse[i, k]
            if factor != 0.0:
                for j in range(n):
                    result[i, j] += factor * matrix[k, j]


def process_noise(noise: ImuNoise, dt: float) -> Array:
    """Covariance (15, 15) that the inertial unit's noise adds to the errors over a time.

    The noise is alike on all axes, so it does not depend on the attitude; the coupling of gyro noise into velocity
    within the time is of third order and left out.
    """
    gyro, accel = noise.gyro**2, noise.accel**2
    result = np.zeros((STATES, STATES))
    for i in range(3):
        p, v, a, g, b = (3 * block + i for block in range(5))
        result[p, p] = accel * dt**3 / 3.0
        result[p, v] = result[v, p] = accel * dt**2 / 2.0
        result[v, v] = accel * dt
        result[a, a] = gyro * dt
        result[g, g] = noise.gyro_drift**2 * dt
        result[b, b] = noise.accel_drift**2 * dt
    return result


@compiled
def corrected(nominal: Array, error: Array) -> Array:
    """The nominal state (18,) with the first nine of the errors taken into it, and no specific force any more."""
    attitude = matmul(exp((error[6], error[7], error[8])), unpacked(nominal).attitude)
    result = np.zeros(NOMINAL)
    for i in range(6):
        result[i] = nominal[i] + error[i]
    for i in range(9):
        result[6 + i] = attitude[i]
    return result
