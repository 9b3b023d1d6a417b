"""Inertial mechanisation in the runway frame, which is fixed to the Earth, and its error model.

The state is position and velocity of the inertial unit and the attitude of the body.  Increments of the unit are
relative to inertial space, so the Earth's rotation is taken off, and the Coriolis acceleration is that of the rotating
frame (Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., section 3.5.3).  Gravity turns with the
place: a kilometre away from the threshold it leans by 0.16 mg.

Errors are true less estimated; that of the attitude is a rotation vector ψ in the runway frame,
R_true = exp([ψ×]) R_estimated.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimator.so3 import (
    Array,
    Mat3,
    Vec3,
    exp,
    log_between,
    matmul,
)

POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCEL_BIAS = (slice(3 * i, 3 * i + 3) for i in range(5))
STATES = 15


class Site(NamedTuple):
    """Where the runway frame stands on the Earth."""

    gravity: float
    """At the origin, m/s²."""
    earth_rate: Vec3
    """Runway frame, rad/s."""
    radius: float
    """Of the Earth, m."""


class Inertial(NamedTuple):
    """Position (m), velocity (m/s), runway frame, and attitude R_runway_from_body."""

    position: Vec3
    velocity: Vec3
    attitude: Mat3


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
    """m/s²."""


def gravity_at(site: Site, position: Vec3) -> Vec3:
    """Gravity (m/s², runway frame) near the origin: it points to the Earth's centre and falls off with the height."""
    g = site.gravity
    k = g / site.radius
    return -k * position[0], -k * position[1], g + 2.0 * k * position[2]


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
        The interval's integrated specific force in the runway frame, m/s, as `transition` takes it.
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


def transition(attitude: Mat3, force: Vec3, dt: float) -> tuple[float, ...]:
    """Transition matrix of the 15 errors over several intervals of the inertial unit: what it has besides its identity.

    To second order in time where a bias or the attitude moves velocity and position; what a gyro bias does to them
    within the time is of a higher order, and reaches them through the attitude in the next.

    Parameters
    ----------
    attitude : Mat3
        R_runway_from_body.
    force : (3,) float
        Specific force in the runway frame, integrated over the time, m/s.
    dt : float
        s.

    Returns
    -------
    tuple of float
        The numbers at `TRANSITION_PLACES`.
    """
    x, y, z = force
    a, b, c, d, e, f, g, h, i = attitude
    n, k = -dt, 0.5 * dt
    m = k * n
    turn = (n * a, n * b, n * c, n * d, n * e, n * f, n * g, n * h, n * i)
    return (
        dt, dt, dt,
        k * z, -k * y, -k * z, k * x, k * y, -k * x,
        m * a, m * b, m * c, m * d, m * e, m * f, m * g, m * h, m * i,
        z, -y, -z, x, y, -x,
        *turn,
        *turn,
    )  # fmt: skip


def _places(row: slice, column: slice, kind: str) -> list[int]:
    """Where the numbers of a 3 × 3 block lie in the matrix, row by row: its diagonal, what lies off it, or all."""
    chosen = {"diagonal": (True,), "skew": (False,), "full": (True, False)}[kind]
    return [STATES * (row.start + i) + column.start + j for i in range(3) for j in range(3) if (i == j) in chosen]


TRANSITION_PLACES = tuple(
    _places(POSITION, VELOCITY, "diagonal")
    + _places(POSITION, ATTITUDE, "skew")
    + _places(POSITION, ACCEL_BIAS, "full")
    + _places(VELOCITY, ATTITUDE, "skew")
    + _places(VELOCITY, ACCEL_BIAS, "full")
    + _places(ATTITUDE, GYRO_BIAS, "full")
)
"""Where the numbers of `transition` lie in the (15, 15) matrix, counted row by row."""


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


def corrected(state: Inertial, error: Sequence[float]) -> Inertial:
    """The state with the first nine of the errors taken into it; the biases are the caller's."""
    (px, py, pz), (vx, vy, vz), attitude = state
    return Inertial(
        (px + error[0], py + error[1], pz + error[2]),
        (vx + error[3], vy + error[4], vz + error[5]),
        matmul(exp((error[6], error[7], error[8])), attitude),
    )
