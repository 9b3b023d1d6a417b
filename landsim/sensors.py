"""From truth to measurements: one inertial unit, a pitot tube, a tilting mount and the camera's lines.

Each sensor owns its random numbers, a Generator that it is given, and draws them in the same order whatever the others
do.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from estimator.camera import PinholeCamera
from estimator.lines import line_from_moments
from estimator.mount import camera_axes, camera_position
from estimator.so3 import Array, Vec3
from estimator.strapdown import ImuNoise, Site, increments
from landsim.config import CameraConfig, ImuConfig, MountConfig, PitotConfig
from landsim.earth import MEAN_RADIUS
from landsim.runway import Runway
from landsim.state import CameraFrame, ImuSample, LineReading
from landsim.truth import Truth
from landsim.units import (
    DEG,
    DEG_PER_HOUR,
    DEG_PER_SQRT_HOUR,
    HOUR,
    MILLI_G,
    MM,
    MPS_PER_SQRT_HOUR,
    STANDARD_GRAVITY,
    UM,
)

BLOCK = 256
"""Samples whose noise is drawn at once."""

PixelSegment = tuple[float, float, float, float]


def site_of(runway: Runway) -> Site:
    """What the inertial unit and its mechanisation need to know of the place."""
    return Site(runway.gravity[2], runway.earth_rate, MEAN_RADIUS)


def camera_of(config: CameraConfig) -> PinholeCamera:
    """The camera of a scenario."""
    return PinholeCamera.from_lens(config.focal_length_mm * MM, config.pixel_um * UM, config.width_px, config.height_px)


def imu_noise(config: ImuConfig) -> ImuNoise:
    """The inertial unit's data sheet in SI, as the filter takes it.

    A scale factor acts on gravity and so passes for an accelerometer bias: its share is added to the bias' sigma.
    """
    drift = 1.0 / math.sqrt(HOUR)
    return ImuNoise(
        gyro=config.gyro_noise_deg_sqrt_h * DEG_PER_SQRT_HOUR,
        accel=config.accel_noise_mps_sqrt_h * MPS_PER_SQRT_HOUR,
        gyro_drift=config.gyro_bias_drift_deg_h_sqrt_h * DEG_PER_HOUR * drift,
        accel_drift=config.accel_bias_drift_mg_sqrt_h * MILLI_G * drift,
        gyro_bias=config.gyro_bias_deg_h * DEG_PER_HOUR,
        accel_bias=math.hypot(config.accel_bias_mg * MILLI_G, config.scale_factor * STANDARD_GRAVITY),
    )


class Imu:
    """The inertial unit, at the centre of gravity: bias, bias drift, white noise and scale factor.

    Parameters
    ----------
    config : ImuConfig
    site : Site
    start : Truth
    rng : Generator
    """

    def __init__(self, config: ImuConfig, site: Site, start: Truth, rng: Generator) -> None:
        noise = imu_noise(config)
        self._dt = dt = 1.0 / config.rate_hz
        self._drift = np.repeat((noise.gyro_drift, noise.accel_drift), 3) * math.sqrt(dt)
        self._white = np.repeat((noise.gyro, noise.accel), 3) * math.sqrt(dt)
        self._last_bias = rng.standard_normal(6)
        self._last_bias *= (*[noise.gyro_bias] * 3, *[config.accel_bias_mg * MILLI_G] * 3)
        self._scale: list[float] = (config.scale_factor * rng.standard_normal(6)).tolist()
        self._rng = rng
        self._site = site
        self._count = 0
        self._draw()
        self._before = start
        self._true = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)

    def _draw(self) -> None:
        """The biases of the next block of samples, and what bias and white noise add to each."""
        drift, white = self._rng.standard_normal((2, BLOCK, 6))
        bias = self._last_bias + np.cumsum(drift * self._drift, axis=0)
        self._last_bias = bias[-1]
        self._bias = bias
        self._added: list[list[float]] = (bias * self._dt + white * self._white).tolist()

    def sample(self, truth: Truth) -> ImuSample:
        """The increments since the last call, which was one interval ago."""
        before, self._before = self._before, truth
        self._true = (ax, ay, az), (vx, vy, vz) = increments(
            before.position,
            before.velocity,
            before.R_runway_from_body,
            truth.velocity,
            truth.R_runway_from_body,
            self._site,
            self._dt,
        )
        if self._count == BLOCK:
            self._draw()
            self._count = 0
        s0, s1, s2, s3, s4, s5 = self._scale
        e0, e1, e2, e3, e4, e5 = self._added[self._count]
        self._count += 1
        return ImuSample(
            (ax + s0 * ax + e0, ay + s1 * ay + e1, az + s2 * az + e2),
            (vx + s3 * vx + e3, vy + s4 * vy + e4, vz + s5 * vz + e5),
        )

    def errors(self) -> tuple[float, ...]:
        """What the last sample was off by, its white noise apart.

        That is the bias, and what the scale factor made of the input.

        Returns
        -------
        (6,) tuple
            Gyros (rad/s) and accelerometers (m/s²).
        """
        (ax, ay, az), (vx, vy, vz) = self._true
        b0, b1, b2, b3, b4, b5 = self._bias[max(self._count - 1, 0)].tolist()
        s0, s1, s2, s3, s4, s5 = self._scale
        k = 1.0 / self._dt
        return (
            b0 + k * s0 * ax, b1 + k * s1 * ay, b2 + k * s2 * az,
            b3 + k * s3 * vx, b4 + k * s4 * vy, b5 + k * s5 * vz,
        )  # fmt: skip


def _white(sigma: float, rng: Generator) -> Iterator[float]:
    """White noise without end, drawn a block at a time."""
    while True:
        yield from (sigma * rng.standard_normal(BLOCK)).tolist()


class Pitot:
    """The airspeed: a first-order lag, and white noise on each sample.

    It gives true airspeed: that the density is known on board is an idealisation.

    Parameters
    ----------
    config : PitotConfig
    dt : float
        Between samples, s.
    start : Truth
    rng : Generator
    """

    def __init__(self, config: PitotConfig, dt: float, start: Truth, rng: Generator) -> None:
        self._noise = _white(config.noise_mps, rng)
        self._gain = 1.0 if config.lag_s == 0.0 else 1.0 - math.exp(-dt / config.lag_s)
        self._lagged = start.airspeed

    def sample(self, truth: Truth) -> float:
        """Airspeed, m/s."""
        self._lagged += self._gain * (truth.airspeed - self._lagged)
        return max(self._lagged + next(self._noise), 0.0)


class TiltMount:
    """The camera's mount: follows the commanded angle at a limited rate; its angle is read with white noise.

    Parameters
    ----------
    config : MountConfig
    dt : float
        Between calls of `move`, s.
    rng : Generator

    Attributes
    ----------
    tilt : float
        True angle, rad, down positive.
    """

    def __init__(self, config: MountConfig, dt: float, rng: Generator) -> None:
        self.tilt = config.tilt_early_deg * DEG
        self._step = config.tilt_rate_deg_s * DEG * dt
        self._noise = _white(config.tilt_reading_sigma_deg * DEG, rng)

    def move(self, command: float) -> None:
        """Move toward an angle (rad) for one step."""
        if command != self.tilt:
            self.tilt += max(-self._step, min(self._step, command - self.tilt))

    def read(self) -> float:
        """The angle as read, rad."""
        return self.tilt + next(self._noise)


class View(NamedTuple):
    """One image: what navigation receives, and what there was to see."""

    frame: CameraFrame
    true_ends: tuple[PixelSegment | None, PixelSegment | None, PixelSegment | None]
    """Left edge, threshold, right edge as projected and clipped, px."""


class LineCamera:
    """Projects the painted lines, clips them, and reports noisy lines.

    Parameters
    ----------
    config : CameraConfig
    lever : (3,) float
        Projection centre from the centre of gravity, body frame, m.
    runway : Runway
    rng : Generator
    """

    def __init__(self, config: CameraConfig, lever: Vec3, runway: Runway, rng: Generator) -> None:
        self.camera = camera_of(config)
        self._config = config
        self._lever = lever
        self._corners = (*runway.left_edge, *runway.right_edge)
        self._rng = rng
        most = 3 * (int(math.hypot(config.width_px, config.height_px) / config.point_spacing_px) + 3)
        self._places = np.arange(most, dtype=float)

    def view(self, truth: Truth, tilt: float, tilt_reading: float) -> View:
        """The image at an instant, with the true and the read mount angle (rad)."""
        near_left, far_left, near_right, far_right = self._in_camera(truth, tilt)
        ends = (
            self._seen(near_left, far_left),
            self._seen(near_left, near_right),
            self._seen(near_right, far_right),
        )
        time = truth.time
        if any(start <= time < end for start, end in self._config.outages_s):
            return View(CameraFrame(time, None, None, None, tilt_reading), ends)
        left, threshold, right = self._read(ends)
        return View(CameraFrame(time, left, threshold, right, tilt_reading), ends)

    def _in_camera(self, truth: Truth, tilt: float) -> list[Vec3]:
        """The corners of the runway in the camera frame, m."""
        px, py, pz = camera_position(truth.position, truth.R_runway_from_body, self._lever)
        (a, b, c), (d, e, f), (g, h, i) = camera_axes(truth.R_runway_from_body, tilt)
        result = []
        for corner in self._corners:
            x, y, z = corner[0] - px, corner[1] - py, corner[2] - pz
            result.append((a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z))
        return result

    def _seen(self, start: Vec3, end: Vec3) -> PixelSegment | None:
        seen = self.camera.clip(start, end, self._config.near_m)
        if seen is not None and math.hypot(seen[2] - seen[0], seen[3] - seen[1]) >= self._config.min_line_px:
            return seen
        return None

    def _read(self, ends: Sequence[PixelSegment | None]) -> list[LineReading | None]:
        """Lines fitted to noisy points: both ends of each, or points evenly spread between them."""
        numbers = [0 if seen is None else self._number(seen) for seen in ends]
        firsts = [0, numbers[0], numbers[0] + numbers[1]]
        total = sum(numbers)
        if total == 0:
            return [None, None, None]
        # all lines at once: n_u, n_v, i n_u, i n_v, n_u², n_u n_v, n_v² of each point i, with its noise n in units of
        # σ, summed over the points of each line
        terms: Array = np.empty((7, total))
        noise = self._rng.standard_normal(out=terms[:2])
        np.multiply(noise, self._places[:total], out=terms[2:4])
        np.multiply(noise, noise[0], out=terms[4:6])
        np.multiply(noise[1], noise[1], out=terms[6])
        there = [i for i in range(3) if numbers[i]]
        sums = np.add.reduceat(terms, [firsts[i] for i in there], axis=1).T.tolist()
        readings: list[LineReading | None] = [None, None, None]
        for i, summed in zip(there, sums, strict=True):
            seen = ends[i]
            assert seen is not None
            readings[i] = _fitted(seen, numbers[i], firsts[i], self._config.noise_px, summed)
        return readings

    def _number(self, seen: PixelSegment) -> int:
        """How many points a line is fitted to."""
        if self._config.line_noise == "endpoints":
            return 2
        return max(2, int(math.hypot(seen[2] - seen[0], seen[3] - seen[1]) / self._config.point_spacing_px) + 1)


def _fitted(seen: PixelSegment, number: int, first: int, sigma: float, sums: Sequence[float]) -> LineReading:
    """A line fitted to its points.

    The moments that the fit needs are those of the points, p_i = middle + (i - (N-1)/2) step + σ noise_i, multiplied
    out.

    Parameters
    ----------
    seen : PixelSegment
        The true ends.
    number : int
        Of its points.
    first : int
        The i of its first point in the sums.
    sigma : float
        Of the points, px.
    sums : sequence of float
        Of n_u, n_v, i n_u, i n_v, n_u², n_u n_v and n_v².
    """
    u0, v0, u1, v1 = seen
    nu, nv, ku, kv, nuu, nuv, nvv = sums
    middle = first + 0.5 * (number - 1)
    ku, kv = ku - middle * nu, kv - middle * nv
    du, dv = (u1 - u0) / (number - 1), (v1 - v0) / (number - 1)
    places = number * (number * number - 1) / 12.0  # Σ (i - middle)²
    square = sigma * sigma
    u, v = 0.5 * (u0 + u1) + sigma * nu / number, 0.5 * (v0 + v1) + sigma * nv / number
    suu = du * du * places + 2.0 * sigma * du * ku + square * (nuu - nu * nu / number)
    suv = du * dv * places + sigma * (du * kv + dv * ku) + square * (nuv - nu * nv / number)
    svv = dv * dv * places + 2.0 * sigma * dv * kv + square * (nvv - nv * nv / number)
    a, b, c, spread = line_from_moments(u, v, suu, suv, svv, math)
    off0, off1 = a * u0 + b * v0 + c, a * u1 + b * v1 + c
    ends = (u0 - off0 * a, v0 - off0 * b, u1 - off1 * a, v1 - off1 * b)
    return LineReading(a, b, c, u, v, spread, number, ends)
