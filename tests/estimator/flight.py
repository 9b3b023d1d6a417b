"""A flight from splines, with what an inertial unit and a camera would report of it, made without the estimator.

The increments are integrals of the splines' derivatives (Gauss-Legendre) and rotations of scipy, in axes that do not
turn with the Earth; the lines are projected by `outside`.  It need not be one that an aircraft could fly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from outside import DEG, LENGTH, PAPER, WIDTH, Poses, runway_lines, visible
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from estimator.innovation import LineObservation, Lines
from estimator.mount import Mount
from estimator.so3 import Array
from estimator.strapdown import ImuNoise, Site

SITE = Site(9.7803, (4.2e-5, -3.1e-5, -5.1e-5), 6_371_000.0)
LEVER = (1.2, 0.1, 0.3)
TILT_SIGMA = 0.05 * DEG
MOUNT = Mount(LEVER, TILT_SIGMA**2)
IMU = ImuNoise(gyro=2.9e-5, accel=1.7e-3, gyro_drift=2.4e-7, accel_drift=4.9e-5, gyro_bias=4.8e-5, accel_bias=1.0e-2)
RATE, EVERY, DURATION = 120, 4, 22.0
DT = 1.0 / RATE
POINT_SIGMA = np.sqrt(2.0)


class Truth(NamedTuple):
    """At the times of the inertial unit."""

    time: Array
    position: Array
    velocity: Array
    R: Array
    """R_runway_from_body."""
    angle: Array
    """Increments over the interval that ends at the time; the first is not used."""
    push: Array
    tilt: Array


class CleanLine(NamedTuple):
    """What is to be seen of a line, and how well its points fix it."""

    line: Array
    centroid: Array
    offset_sigma: float
    angle_sigma: float


def _splines() -> tuple[CubicSpline, CubicSpline]:
    """Position (m) and roll, pitch, yaw (rad) over time."""
    t = np.linspace(0.0, DURATION, 12)
    x = -800.0 + 41.0 * t
    y = np.array((7.0, 6.0, 6.5, 4.0, 1.0, -1.5, -1.0, 0.5, 1.5, 1.0, 0.3, 0.5))
    down = np.array((-47.0, -43.5, -40.0, -34.0, -31.0, -27.0, -21.0, -17.0, -13.0, -8.0, -4.0, -2.5))
    roll = np.array((0.0, -4.0, -6.0, -2.0, 5.0, 6.0, 0.0, -3.0, 2.0, 1.0, -1.0, 0.5)) * DEG
    pitch = np.array((0.0, 1.0, 0.0, -1.5, 0.5, 1.0, 0.0, -1.0, 0.0, 1.0, 2.0, 2.5)) * DEG
    yaw = np.array((-1.0, -0.5, -1.0, -1.5, 0.0, 1.0, 1.0, 0.5, 0.0, -0.5, 0.3, 0.0)) * DEG
    return CubicSpline(t, np.stack((x, y, down), -1)), CubicSpline(t, np.stack((roll, pitch, yaw), -1))


def _body(angles: Array) -> Rotation:
    return Rotation.from_euler("ZYX", angles[:, ::-1])


@lru_cache(maxsize=1)
def truth() -> Truth:
    """The one flight."""
    where, angles = _splines()
    time: Array = np.asarray(np.arange(round(DURATION * RATE) + 1) * DT, dtype=np.float64)
    omega: Array = np.array(SITE.earth_rate)
    attitude = _body(angles(time))
    inertial = Rotation.from_rotvec(omega * time[:, None]) * attitude
    turn = (inertial[:-1].inv() * inertial[1:]).as_rotvec()
    # specific force: acceleration and Coriolis acceleration, less gravity, which points to the centre of the Earth
    nodes, weights = np.polynomial.legendre.leggauss(4)
    force = np.zeros((len(time) - 1, 3))
    for node, weight in zip(nodes, weights, strict=True):
        at = time[:-1] + 0.5 * DT * (1.0 + node)
        down = np.array((0.0, 0.0, SITE.radius)) - where(at)
        gravity = SITE.gravity * SITE.radius**2 * down / np.linalg.norm(down, axis=-1, keepdims=True) ** 3
        force += 0.5 * DT * weight * (where(at, 2) + 2.0 * np.cross(omega, where(at, 1)) - gravity)
    push = attitude[:-1].inv().apply(force)
    none = np.zeros((1, 3))
    # the mount turns down when the threshold is about to leave the image
    tilt = np.asarray(DEG * np.clip(3.0 + 10.0 * (time - 18.5), 3.0, 10.0), float)
    return Truth(
        time, where(time), where(time, 1), attitude.as_matrix(), np.vstack((none, turn)), np.vstack((none, push)), tilt
    )


def camera_pose(position: Array, R: Array, tilt: float) -> Poses:
    """The camera on the body; its optical axis points below the nose by the tilt."""
    triad = R @ Rotation.from_euler("y", -tilt).as_matrix()
    yaw, pitch, roll = Rotation.from_matrix(triad).as_euler("ZYX")
    return Poses(position + R @ np.array(LEVER), np.stack((triad[:, 1], triad[:, 2], triad[:, 0])), yaw, pitch, roll)


@lru_cache(maxsize=1)
def clean_frames() -> list[tuple[CleanLine | None, CleanLine | None, CleanLine | None]]:
    """What the camera would see without noise: left edge, threshold, right edge, a frame every `EVERY` steps."""
    t = truth()
    near_left, near_right = (0.0, -WIDTH / 2, 0.0), (0.0, WIDTH / 2, 0.0)
    segments = (
        (near_left, (LENGTH, -WIDTH / 2, 0.0)),
        (near_left, near_right),
        (near_right, (LENGTH, WIDTH / 2, 0.0)),
    )
    frames = []
    for k in range(0, len(t.time), EVERY):
        pose = camera_pose(t.position[k], t.R[k], float(t.tilt[k]))
        found: list[CleanLine | None] = []
        for line, (start, end) in zip(runway_lines(PAPER, pose), segments, strict=True):
            seen = visible(PAPER, pose, start, end, samples=801)
            length = 0.0 if seen is None else float(np.linalg.norm(seen.ends[1] - seen.ends[0]))
            if seen is None or length < 8.0:
                found.append(None)
                continue
            number = int(length) + 1
            spread = length**2 * number * (number + 1) / (12.0 * (number - 1))  # of evenly spaced points
            found.append(
                CleanLine(
                    line,
                    seen.ends.mean(axis=0),
                    float(POINT_SIGMA / np.sqrt(number)),
                    float(POINT_SIGMA / np.sqrt(spread)),
                )
            )
        frames.append((found[0], found[1], found[2]))
    return frames


def measured(rng: Generator, clean: CleanLine) -> LineObservation:
    """The line, shifted across itself and turned about the centroid of its points."""
    shift, angle = clean.offset_sigma * rng.standard_normal(), clean.angle_sigma * rng.standard_normal()
    a, b, c = clean.line
    u, v = clean.centroid - (clean.centroid @ (a, b) + c) * np.array((a, b))  # the middle of a sampling, onto the line
    a, b = a * np.cos(angle) - b * np.sin(angle), a * np.sin(angle) + b * np.cos(angle)
    u, v = u + shift * a, v + shift * b
    return LineObservation(
        float(a), float(b), float(-(a * u + b * v)), float(u), float(v), clean.offset_sigma**2, clean.angle_sigma**2
    )


@dataclass(frozen=True)
class Step:
    """One interval of the inertial unit, and the frame at its end if there is one."""

    index: int
    sample: Array
    """(6,): rad and m/s."""
    lines: Lines | None
    tilt: float
    """As read, rad."""


@dataclass(frozen=True)
class Readings:
    """What the sensors report in one draw of their noise.

    Attributes
    ----------
    bias : (n, 6) array
        True biases of gyros (rad/s) and accelerometers (m/s²).
    first : Lines
        Of the frame at the start.
    """

    bias: Array
    samples: Array
    frames: list[Lines]
    tilt: list[float]

    def steps(self) -> Iterator[Step]:
        """In order of time, from the first interval."""
        for k in range(1, len(self.samples)):
            frame, rest = divmod(k, EVERY)
            yield Step(k, self.samples[k], None if rest else self.frames[frame], self.tilt[frame])


def readings(rng: Generator) -> Readings:
    """One draw."""
    t = truth()
    n = len(t.time)
    sigma = np.repeat((IMU.gyro_bias, IMU.accel_bias), 3)
    walk = np.repeat((IMU.gyro_drift, IMU.accel_drift), 3) * np.sqrt(DT)
    white = np.repeat((IMU.gyro, IMU.accel), 3) * np.sqrt(DT)
    bias = sigma * rng.standard_normal(6) + np.cumsum(walk * rng.standard_normal((n, 6)), axis=0)
    added = bias * DT + white * rng.standard_normal((n, 6))
    frames = []
    for clean in clean_frames():
        left, threshold, right = (None if line is None else measured(rng, line) for line in clean)
        frames.append(Lines(left, threshold, right))
    tilt = t.tilt[::EVERY] + TILT_SIGMA * rng.standard_normal(len(frames))
    return Readings(
        bias,
        np.hstack((t.angle, t.push)) + added,
        frames,
        tilt.tolist(),
    )
