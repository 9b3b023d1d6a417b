"""From truth to measurements: one inertial unit, a pitot tube, a tilting mount and the camera's lines.

Each sensor owns its random numbers, a Generator that it is given, and draws them in the same order whatever the others
do.
"""

import math
from collections.abc import Iterator
from itertools import chain, repeat
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from estimator import camera as pinhole
from estimator import lines
from estimator.camera import Intrinsics, PinholeCamera
from estimator.compiled import compiled
from estimator.mount import camera_axes, camera_position
from estimator.so3 import Array, Vec3
from estimator.strapdown import ImuNoise, Site, ideal_sample_into, rows, unpacked
from landsim.config import CameraConfig, ImuConfig, MountConfig, PitotConfig
from landsim.earth import MEAN_RADIUS
from landsim.runway import Runway
from landsim.schema.grades import FLOOR
from landsim.state import CameraFrame, ImuSample
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

LINES = 3
"""Left edge, threshold, right edge: the order of all that is kept of a frame."""


def site_of(runway: Runway) -> Site:
    """What the inertial unit and its mechanisation need to know of the place."""
    return Site(runway.gravity[2], runway.earth_rate, MEAN_RADIUS)


def camera_of(config: CameraConfig) -> PinholeCamera:
    """The camera of a scenario."""
    return PinholeCamera.from_lens(config.focal_length_mm * MM, config.pixel_um * UM, config.width_px, config.height_px)


def imu_noise(config: ImuConfig) -> ImuNoise:
    """The inertial unit's data sheet in SI, as the filter takes it.

    A scale factor acts on gravity and so passes for an accelerometer bias: its share is added to the bias' sigma.  So
    is that of the bias' flicker.  What flicker does meanwhile is taken for white noise and a random walk of the bias
    besides, whose Allan variance together is least at `FLICKER_LEAST_S`: `FLICKER_SHARE` of flicker's.
    """
    drift = 1.0 / math.sqrt(HOUR)
    gyro_flicker = config.gyro_bias_instability_deg_h * DEG_PER_HOUR
    accel_flicker = config.accel_bias_instability_mg * MILLI_G
    if gyro_flicker > 0.0 or accel_flicker > 0.0:
        # N²/τ + K² τ/3 is least where both are half of it
        least = FLICKER_SHARE * FLOOR**2
        white, walk = math.sqrt(0.5 * least * FLICKER_LEAST_S), math.sqrt(1.5 * least / FLICKER_LEAST_S)
        plain = imu_noise(config.model_copy(update=dict.fromkeys(_INSTABILITIES, 0.0)))
        return plain._replace(
            gyro=math.hypot(plain.gyro, white * gyro_flicker),
            accel=math.hypot(plain.accel, white * accel_flicker),
            gyro_drift=math.hypot(plain.gyro_drift, walk * gyro_flicker),
            accel_drift=math.hypot(plain.accel_drift, walk * accel_flicker),
            gyro_bias=math.hypot(plain.gyro_bias, flicker_sigma(gyro_flicker)),
            accel_bias=math.hypot(plain.accel_bias, flicker_sigma(accel_flicker)),
        )
    return ImuNoise(
        gyro=config.gyro_noise_deg_sqrt_h * DEG_PER_SQRT_HOUR,
        accel=config.accel_noise_mps_sqrt_h * MPS_PER_SQRT_HOUR,
        gyro_drift=config.gyro_bias_drift_deg_h_sqrt_h * DEG_PER_HOUR * drift,
        accel_drift=config.accel_bias_drift_mg_sqrt_h * MILLI_G * drift,
        gyro_bias=config.gyro_bias_deg_h * DEG_PER_HOUR,
        accel_bias=math.hypot(config.accel_bias_mg * MILLI_G, config.scale_factor * STANDARD_GRAVITY),
        scale_factor=config.scale_factor,
    )


_INSTABILITIES = ("gyro_bias_instability_deg_h", "accel_bias_instability_mg")
FLICKER_TIMES = 0.1 * 4.0 ** np.arange(9)
"""Correlation times of the processes that make up flicker noise, s: from a tenth of a second to two hours."""
FLICKER_LEAST_S = 5.0
FLICKER_SHARE = 0.7
"""With these two what a filter says of angle, place and velocity is right to 5 % of their σ on a flight of a minute,
whatever the grade: the least squares of what `tests/test_imu_errors.py` works out from the covariances."""


def flicker_sigma(instability: float) -> float:
    """1 σ of flicker noise by its bias instability B, from one flight to the next.

    First-order processes of the variance B² ln(r)/π each, their times apart by a factor r, add up to the one-sided
    spectrum B²/(π f), whose Allan variance is 2 ln 2 B²/π (IEEE Std 952).
    """
    return instability * math.sqrt(math.log(4.0) / math.pi * FLICKER_TIMES.size)


class Flicker:
    """Flicker noise of six axes, a block of samples at a time.

    Parameters
    ----------
    instability : (6,) array
        B of each.
    dt : float
        Between samples, s.
    rng : Generator
    """

    def __init__(self, instability: Array, dt: float, rng: Generator) -> None:
        self._rng = rng
        self._decay = np.exp(-dt / FLICKER_TIMES)
        self._sigma = instability * math.sqrt(math.log(4.0) / math.pi)
        self._state = rng.standard_normal((FLICKER_TIMES.size, 6))

    def block(self, samples: int) -> Array:
        """The next samples (n, 6)."""
        total = np.zeros((samples, 6))
        for i, decay in enumerate(self._decay.tolist()):
            noise = math.sqrt(1.0 - decay * decay) * self._rng.standard_normal((samples, 6))
            series = _first_order(noise, self._state[i], decay)
            self._state[i] = series[-1]
            total += series
        return total * self._sigma


@compiled
def _first_order(noise: Array, start: Array, decay: float) -> Array:
    """x_k = decay x_{k-1} + noise_k, of columns (n, m) that begin with x_{-1} = start (m,)."""
    result = np.empty_like(noise)
    for j in range(noise.shape[1]):
        x = start[j]
        for i in range(noise.shape[0]):
            x = decay * x + noise[i, j]
            result[i, j] = x
    return result


class ImuErrors:
    """What an inertial unit's samples are off by, whatever it feels: bias, bias drift and flicker, and white noise.

    Parameters
    ----------
    config : ImuConfig
    rng : Generator

    Attributes
    ----------
    bias : (6,) array
        That after power-up, with the drift up to the end of the last block: gyros (rad/s) and accelerometers (m/s²).
    scale : (6,) array
        Scale factors less one, which act on what the unit feels.
    """

    def __init__(self, config: ImuConfig, rng: Generator) -> None:
        noise, factor = imu_noise(config.model_copy(update=dict.fromkeys(_INSTABILITIES, 0.0))), config.error_factor
        dt = 1.0 / config.rate_hz
        self._drift = factor * np.repeat((noise.gyro_drift, noise.accel_drift), 3) * math.sqrt(dt)
        self._white = factor * np.repeat((noise.gyro, noise.accel), 3) * math.sqrt(dt)
        self.bias = factor * rng.standard_normal(6)
        self.bias *= (*[noise.gyro_bias] * 3, *[config.accel_bias_mg * MILLI_G] * 3)
        self.scale = factor * config.scale_factor * rng.standard_normal(6)
        self._rng = rng
        self._flicker: Flicker | None = None
        if config.gyro_bias_instability_deg_h > 0.0 or config.accel_bias_instability_mg > 0.0:
            gyro, accel = config.gyro_bias_instability_deg_h * DEG_PER_HOUR, config.accel_bias_instability_mg * MILLI_G
            self._flicker = Flicker(factor * np.repeat((gyro, accel), 3), dt, rng)

    def block(self, samples: int) -> Array:
        """The next samples (n, 12): biases as rates (rad/s, m/s²), and white noise as increments (rad, m/s)."""
        drift, white = self._rng.standard_normal((2, samples, 6))
        bias = self.bias + np.cumsum(drift * self._drift, axis=0)
        self.bias = bias[-1]
        if self._flicker is not None:
            bias = bias + self._flicker.block(samples)
        return np.concatenate((bias, white * self._white), axis=1)


class Imu:
    """The inertial unit, at the body's origin: the increments it feels, with its scale factors and `ImuErrors`.

    Parameters
    ----------
    config : ImuConfig
    site : Site
    start : Truth
    rng : Generator
    """

    def __init__(self, config: ImuConfig, site: Site, start: Truth, rng: Generator) -> None:
        self._source = ImuErrors(config, rng)
        self._last = self._source.bias.copy()
        self._setup = np.array((*site.numbers(), 1.0 / config.rate_hz, *self._source.scale))
        self._rows = rows(6)
        self._count = 0
        self._errors = self._source.block(BLOCK)
        self._before = start.motion

    def sample(self, truth: Truth) -> ImuSample:
        """The increments since the last call, which was one interval ago."""
        if self._count == BLOCK:
            self._errors = self._source.block(BLOCK)
            self._count = 0
        before, self._before = self._before, truth.motion
        count, self._count = self._count, self._count + 1
        sample = next(self._rows)
        _sample(sample, before, truth.motion, self._setup, self._errors, count, self._last)
        return sample

    def errors(self) -> Array:
        """What the last sample was off by, its white noise apart.

        That is the bias, and what the scale factor made of the input.

        Returns
        -------
        (6,) array
            Gyros (rad/s) and accelerometers (m/s²).
        """
        return self._last.copy()


@compiled
def _sample(sample: Array, before: Array, after: Array, setup: Array, errors: Array, row: int, last: Array) -> None:
    """Write to `sample` (6,).

    `setup` is the site, the interval (s) and the scale factors; a row of `errors` is biases, as rates, and white noise.
    What the sample is off by as rates, but for the white noise, is left in `last` (6,).
    """
    dt = setup[5]
    ideal_sample_into(sample, before, after, setup, dt)
    for i in range(6):
        last[i] = setup[6 + i] * sample[i] / dt + errors[row, i]
        sample[i] += last[i] * dt + errors[row, 6 + i]


def _white(sigma: float, rng: Generator) -> Iterator[float]:
    """White noise without end, drawn a block at a time."""
    return chain.from_iterable((sigma * rng.standard_normal(BLOCK)).tolist() for _ in repeat(None))


class Pitot:
    """The airspeed: a first-order lag, an error of scale, and white noise on each sample.

    It gives true airspeed, made from the pressure with the density of the standard atmosphere.

    Parameters
    ----------
    config : PitotConfig
    dt : float
        Between samples, s.
    start : Truth
    rng : Generator
    density_ratio : float
        Of the air over that of the standard atmosphere.
    """

    def __init__(
        self, config: PitotConfig, dt: float, start: Truth, rng: Generator, density_ratio: float = 1.0
    ) -> None:
        self._noise = _white(config.noise_mps, rng)
        self._scale = (1.0 + config.scale_error) * math.sqrt(density_ratio)
        self._gain = 1.0 if config.lag_s == 0.0 else 1.0 - math.exp(-dt / config.lag_s)
        self._lagged = start.airspeed

    def sample(self, truth: Truth) -> float:
        """Airspeed, m/s."""
        self._lagged += self._gain * (truth.airspeed - self._lagged)
        reading = self._scale * self._lagged + next(self._noise)
        return reading if not reading < 0.0 else 0.0


class TiltMount:
    """The camera's mount: follows the commanded angle at a limited rate; its angle is read with white noise.

    Parameters
    ----------
    config : MountConfig
    dt : float
        Between calls of `move`, s.
    rng : Generator
    misalignment : float
        Of the optical axis, rad: by so much it lies lower than the mount's angle says.

    Attributes
    ----------
    tilt : float
        Of the optical axis below the body's forward axis, true, rad.
    """

    def __init__(self, config: MountConfig, dt: float, rng: Generator, misalignment: float = 0.0) -> None:
        self._angle = config.tilt_early_deg * DEG
        self._misalignment = misalignment
        self.tilt = self._angle + misalignment
        self._step = config.tilt_rate_deg_s * DEG * dt
        self._noise = _white(config.tilt_reading_sigma_deg * DEG, rng)

    def move(self, command: float) -> None:
        """Move toward an angle (rad) for one step."""
        if command != self._angle:
            self._angle += max(-self._step, min(self._step, command - self._angle))
            self.tilt = self._angle + self._misalignment

    def read(self) -> float:
        """The angle as read, rad."""
        return self._angle + next(self._noise)


class View(NamedTuple):
    """One image: what navigation receives, and what there was to see."""

    frame: CameraFrame
    true_ends: Array
    """(3, 4): u, v of both ends of left edge, threshold and right edge as projected and clipped, px; NaN for a line
    that is not in the image."""
    seen_ends: Array
    """(3, 4): those ends moved onto the fitted lines; NaN for a line that is not reported."""
    fault: int = 0
    """Which line is missing or another one: 1 left edge, 2 threshold, 3 right edge; 0 for none."""


class LineCamera:
    """Projects the painted lines, clips them, and reports noisy lines.

    The lens that projects may be another than the `camera` that navigation believes in.

    Parameters
    ----------
    config : CameraConfig
    lever : (3,) float
        Projection centre from the body's origin, body frame, m.
    runway : Runway
    rng : Generator
    """

    def __init__(self, config: CameraConfig, lever: Vec3, runway: Runway, rng: Generator) -> None:
        camera = self.camera = camera_of(config)
        self._outages = config.outages_s
        self._noise_px = config.noise_factor * config.noise_px
        fx, fy, cx, cy = camera.intrinsics
        longer = 1.0 + config.focal_length_error
        lens = (longer * fx, longer * fy, cx, cy)
        self._setup = np.array((*lens, camera.width, camera.height, config.near_m, config.min_line_px, *lever))
        self._corners = np.array((*runway.left_edge, *runway.right_edge))
        self._spacing = spacing_of(config.line_noise, config.point_spacing_px)
        self._rng = rng
        most = int(math.hypot(config.width_px, config.height_px) / config.point_spacing_px) + 3
        self._noise = np.empty(2 * LINES * most)

    def view(self, truth: Truth, tilt: float, tilt_reading: float, _rate: Vec3 = (0.0, 0.0, 0.0)) -> View:
        """The image at an instant, with the true and the read mount angle (rad)."""
        ends, numbers, total = _ends(self._setup, self._corners, self._spacing, truth.motion, tilt)
        time = truth.time
        if self._outages and any(start <= time < end for start, end in self._outages):
            total = 0
        if total == 0:
            return View(CameraFrame(time, NO_LINES, tilt_reading), ends, NO_ENDS)
        noise = self._rng.standard_normal(out=self._noise[: 2 * total])
        readings, seen = _fitted(ends, numbers, noise, self._noise_px)
        return View(CameraFrame(time, readings, tilt_reading), ends, seen)


NO_LINES = np.full((LINES, 7), np.nan)
NO_ENDS = np.full((LINES, 4), np.nan)


def spacing_of(line_noise: str, spacing_px: float) -> float:
    """Between the points of a line, px."""
    return math.inf if line_noise == "endpoints" else spacing_px


def number_of_points(length_px: float, line_noise: str, spacing_px: float) -> int:
    """How many points a line is fitted to: its two ends, or so many evenly spread between them.

    Parameters
    ----------
    length_px : float
        What is seen of it.
    line_noise : {"endpoints", "edge-points"}
    spacing_px : float
        Between the points, with ``edge-points``; they are spread a little wider to reach both ends.
    """
    return _number_of_points(length_px, spacing_of(line_noise, spacing_px))


@compiled
def _number_of_points(length: float, spacing: float) -> int:
    return max(2, int(length / spacing) + 1)


_clip = compiled(pinhole.clip)
_line_from_moments = compiled(lines.line_from_moments)


_FROM_TO = ((0, 1), (0, 2), (2, 3))
"""The corners at which each line begins and ends."""


@compiled
def _ends(
    setup: Array, corners: Array, spacing: float, motion: Array, tilt: float
) -> tuple[Array, NDArray[np.int64], int]:
    """The ends of the lines as `View.true_ends`, how many points each is fitted to, and of all together.

    `setup` is intrinsics, width and height, near plane, shortest line, lever arm; `corners` are near left, far left,
    near right and far right (m).
    """
    camera = Intrinsics(setup[0], setup[1], setup[2], setup[3])
    body = unpacked(motion)
    px, py, pz = camera_position(body.position, body.attitude, (setup[8], setup[9], setup[10]))
    (a, b, c), (d, e, f), (g, h, i) = camera_axes(body.attitude, tilt)
    ends, numbers, total = np.full((3, 4), np.nan), np.zeros(3, np.int64), 0
    for line in range(3):
        first, last = _FROM_TO[line]
        x, y, z = corners[first, 0] - px, corners[first, 1] - py, corners[first, 2] - pz
        start = (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        x, y, z = corners[last, 0] - px, corners[last, 1] - py, corners[last, 2] - pz
        end = (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        there, u0, v0, u1, v1 = _clip(camera, setup[4], setup[5], start, end, setup[6])
        length = math.hypot(u1 - u0, v1 - v0)
        if there and length >= setup[7]:
            ends[line, 0], ends[line, 1], ends[line, 2], ends[line, 3] = u0, v0, u1, v1
            numbers[line] = _number_of_points(length, spacing)
            total += numbers[line]
    return ends, numbers, total


@compiled
def _fitted(ends: Array, numbers: NDArray[np.int64], noise: Array, sigma: float) -> tuple[Array, Array]:
    """Lines fitted to their points.

    The moments that the fit needs are those of the points, p_i = middle + (i - (N-1)/2) step + σ noise_i, multiplied
    out.

    Parameters
    ----------
    ends : (3, 4) array
        As `View.true_ends`.
    numbers : (3,) array
        Of points of each line; 0 for one that is not there.
    noise : (2 n,) array
        Of all points, first in u, then in v, in units of σ.
    sigma : float
        Of the points, px.

    Returns
    -------
    (3, 7), (3, 4) array
        As `CameraFrame.lines` and `View.seen_ends`.
    """
    readings, seen = np.full((3, 7), np.nan), np.full((3, 4), np.nan)
    first, total = 0, noise.size // 2
    square = sigma * sigma
    for line in range(3):
        number = numbers[line]
        if number == 0:
            continue
        u0, v0, u1, v1 = ends[line, 0], ends[line, 1], ends[line, 2], ends[line, 3]
        middle = 0.5 * (number - 1)
        nu = nv = ku = kv = nuu = nuv = nvv = 0.0
        for i in range(number):
            a, b, k = noise[first + i], noise[total + first + i], i - middle
            nu += a
            nv += b
            ku += k * a
            kv += k * b
            nuu += a * a
            nuv += a * b
            nvv += b * b
        first += number
        du, dv = (u1 - u0) / (number - 1), (v1 - v0) / (number - 1)
        places = number * (number * number - 1) / 12.0  # Σ (i - middle)²
        u, v = 0.5 * (u0 + u1) + sigma * nu / number, 0.5 * (v0 + v1) + sigma * nv / number
        suu = du * du * places + 2.0 * sigma * du * ku + square * (nuu - nu * nu / number)
        suv = du * dv * places + sigma * (du * kv + dv * ku) + square * (nuv - nu * nv / number)
        svv = dv * dv * places + 2.0 * sigma * dv * kv + square * (nvv - nv * nv / number)
        a, b, c, spread = _line_from_moments(u, v, suu, suv, svv)
        readings[line] = np.array((a, b, c, u, v, spread, float(number)))
        off0, off1 = a * u0 + b * v0 + c, a * u1 + b * v1 + c
        seen[line] = np.array((u0 - off0 * a, v0 - off0 * b, u1 - off1 * a, v1 - off1 * b))
    return readings, seen
