"""The camera as it is bought: turned on its mount, off its calibration, blurred, in fog, and with lines that are wrong.

`landsim.sensors.LineCamera` is the camera without these.  Here each point of a line is made by itself: points evenly
spread between the ends of what is seen, moved by the lens' distortion and by noise; then a line is fitted to them.
What the detector can see of the noise itself, blur and lost contrast, it reports, as fewer points and less spread: with
a noise that is f times as great, their number is divided by f², and so is the spread, as far as that is not noise too.
A line is reported when it is f times as long as one has to be without.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from estimator import camera as pinhole
from estimator import lines
from estimator.camera import Intrinsics
from estimator.compiled import compiled
from estimator.mount import camera_axes, camera_position
from estimator.single_lines import calibrated_axes
from estimator.so3 import Array, Vec3
from estimator.strapdown import unpacked
from landsim.config import CameraConfig, FaultConfig
from landsim.runway import Runway
from landsim.sensors import LINES, NO_ENDS, NO_LINES, LineCamera, View, camera_of, number_of_points, spacing_of
from landsim.state import CameraFrame
from landsim.truth import Truth
from landsim.units import DEG

FROM_TO = ((0, 1), (0, 2), (2, 3))
"""Corners, of near left, far left, near right and far right, at which left edge, threshold and right edge begin and
end."""
CONTRAST_DECAY = 3.0
"""ln of the least contrast that is seen, 5 %, over the visibility: Koschmieder's law."""
ALL_GONE = 1e-3
"""Least contrast reckoned with."""


class Fault(NamedTuple):
    """A line that is missing or wrong for a while."""

    line: int
    """Row of `View`; -1 for none."""
    start: float
    end: float
    """s."""
    wrong: bool
    offset: float
    """Of the ground line, to the right (edges) or along (threshold), m."""
    angle: float
    """Clockwise seen from above, rad."""


NO_FAULT = Fault(-1, 0.0, 0.0, wrong=False, offset=0.0, angle=0.0)
_CHOICES = {"left": (0,), "threshold": (1,), "right": (2,), "edge": (0, 2), "any": (0, 1, 2)}


def fault_of(config: FaultConfig, rng: Generator) -> Fault:
    """The fault of one flight; which line is drawn whether there is a fault or not."""
    choices = _CHOICES[config.line]
    line = choices[int(rng.integers(len(choices)))]
    if config.kind == "none":
        return NO_FAULT
    end = config.at_s + config.lasting_s
    return Fault(line, config.at_s, end, config.kind == "wrong", config.offset_m, config.angle_deg * DEG)


def is_perfect(config: CameraConfig, fault: FaultConfig) -> bool:
    """Whether a camera has none of these errors."""
    nothing = (
        config.pan_error_deg,
        config.roll_error_deg,
        config.principal_u_error_px,
        config.principal_v_error_px,
        config.radial_distortion,
        config.dropped_share,
        config.exposure_s,
    )
    clear = config.visibility_m == CameraConfig.model_fields["visibility_m"].default
    return clear and fault.kind == "none" and not any(nothing)


def ground_lines(runway: Runway, fault: Fault) -> Array:
    """Both ends (3, 2, 3) of the lines on the ground, with a wrong one in its place (m, runway frame)."""
    corners = np.array((*runway.left_edge, *runway.right_edge))
    result = np.array([[corners[first], corners[last]] for first, last in FROM_TO])
    if fault.line < 0 or not fault.wrong:
        return result
    ends = result[fault.line]
    threshold = fault.line == 1
    ends[:, 0 if threshold else 1] += fault.offset
    pivot = ends.mean(axis=0) if threshold else ends[0].copy()
    c, s = math.cos(fault.angle), math.sin(fault.angle)
    x, y = (ends - pivot)[:, :2].T
    ends[:, 0], ends[:, 1] = pivot[0] + c * x - s * y, pivot[1] + s * x + c * y
    return result


class ImperfectCamera:
    """As `landsim.sensors.LineCamera`, with the errors of this module.

    Parameters
    ----------
    config : CameraConfig
    fault : FaultConfig
    lever : (3,) float
        Projection centre from the body's origin, body frame, m.
    runway : Runway
    rng : Generator
        Of the points' noise.
    chance : Generator
        Of dropped frames, and of which line is at fault.
    believed_px : float
        1 σ of a point as navigation takes it, px: blur and lost contrast are reported relative to it.
    """

    def __init__(
        self,
        config: CameraConfig,
        fault: FaultConfig,
        lever: Vec3,
        runway: Runway,
        rng: Generator,
        chance: Generator,
        believed_px: float,
    ) -> None:
        camera = self.camera = camera_of(config)
        fx, fy, cx, cy = camera.intrinsics
        longer = 1.0 + config.focal_length_error
        self._setup = np.array(
            (
                longer * fx,
                longer * fy,
                cx + config.principal_u_error_px,
                cy + config.principal_v_error_px,
                camera.width,
                camera.height,
                config.near_m,
                config.min_line_px,
                *lever,
                config.pan_error_deg * DEG,
                config.roll_error_deg * DEG,
                config.radial_distortion,
                config.exposure_s,
                config.visibility_m,
                believed_px,
                config.noise_factor * config.noise_px,
                spacing_of(config.line_noise, config.point_spacing_px),
            )
        )
        self._outages = config.outages_s
        self._dropped = config.dropped_share
        self._fault = fault_of(fault, chance)
        self._right = ground_lines(runway, NO_FAULT)
        self._wrong = ground_lines(runway, self._fault)
        self._rng = rng
        self._chance = chance
        longest = math.hypot(config.width_px, config.height_px)
        most = number_of_points(longest, config.line_noise, config.point_spacing_px) + 2
        self._noise = np.empty((LINES, most, 2))

    def view(self, truth: Truth, tilt: float, tilt_reading: float, rate: Vec3) -> View:
        """The image at an instant, with the true and the read mount angle (rad) and the body rates (rad/s)."""
        time, fault = truth.time, self._fault
        on = fault.line >= 0 and fault.start <= time < fault.end
        ground = self._wrong if on and fault.wrong else self._right
        missing = fault.line if on and not fault.wrong else -1
        self._rng.standard_normal(out=self._noise)
        readings, true_ends, seen = _imaged(
            self._setup, ground, missing, truth.motion, tilt, np.array(rate), self._noise
        )
        lost = self._chance.random() < self._dropped
        if lost or (self._outages and any(start <= time < end for start, end in self._outages)):
            readings, seen = NO_LINES, NO_ENDS
        return View(CameraFrame(time, readings, tilt_reading), true_ends, seen, fault.line + 1 if on else 0)


_clip = compiled(pinhole.clip)
_line_from_moments = compiled(lines.line_from_moments)


@compiled
def _within_sight(start: Vec3, end: Vec3, visibility: float) -> tuple[float, float]:
    """The shares of the way from start to end, in the camera's frame, between which it is nearer than the visibility.

    The second is not above the first where none of it is.
    """
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    a = dx * dx + dy * dy + dz * dz
    b = start[0] * dx + start[1] * dy + start[2] * dz
    c = start[0] ** 2 + start[1] ** 2 + start[2] ** 2 - visibility * visibility
    root = b * b - a * c
    if root <= 0.0:
        return 1.0, 0.0
    root = math.sqrt(root)
    return max((-b - root) / a, 0.0), min((-b + root) / a, 1.0)


@compiled
def _between(start: Vec3, end: Vec3, share: float) -> Vec3:
    return (
        start[0] + share * (end[0] - start[0]),
        start[1] + share * (end[1] - start[1]),
        start[2] + share * (end[2] - start[2]),
    )


@compiled
def _smear(camera: Intrinsics, ray: Vec3, depth: float, normal: tuple[float, float], speed: Vec3, turn: Vec3) -> float:
    """Speed (px/s) of an image point across its line.

    Parameters
    ----------
    ray : (3,) float
        Of the point in the camera's frame, its z one.
    depth : float
        m.
    normal : (2,) float
        Of the line in the image, of length one.
    speed, turn : (3,) float
        Of the camera, in its own frame, m/s and rad/s.
    """
    x, y, z = ray
    # of a point at rest: Ṗ = -v - ω × P, with P = depth ray
    px = -speed[0] / depth - (turn[1] * z - turn[2] * y)
    py = -speed[1] / depth - (turn[2] * x - turn[0] * z)
    pz = -speed[2] / depth - (turn[0] * y - turn[1] * x)
    return normal[0] * camera.fx * (px - x * pz) + normal[1] * camera.fy * (py - y * pz)


@compiled
def _imaged(
    setup: Array, ground: Array, missing: int, motion: Array, tilt: float, rate: Array, noise: Array
) -> tuple[Array, Array, Array]:
    """Readings (3, 7), true and seen ends (3, 4) of the lines, as `View` has them.

    `setup` is intrinsics, width and height, near plane, shortest line, lever arm, pan and roll (rad), distortion,
    exposure (s), visibility (m), noise as believed and as it is (px), spacing of points (px).
    """
    readings, ends, seen = np.full((3, 7), np.nan), np.full((3, 4), np.nan), np.full((3, 4), np.nan)
    camera = Intrinsics(setup[0], setup[1], setup[2], setup[3])
    body = unpacked(motion)
    px, py, pz = camera_position(body.position, body.attitude, (setup[8], setup[9], setup[10]))
    axes = calibrated_axes(camera_axes(body.attitude, tilt), setup[11], setup[12])
    distortion, exposure, visibility, believed, spacing = setup[13], setup[14], setup[15], setup[16], setup[18]
    (a, b, c), (d, e, f), (g, h, i) = axes
    m = body.attitude  # of the body's rates, by way of the runway's frame
    wx = m[0] * rate[0] + m[1] * rate[1] + m[2] * rate[2]
    wy = m[3] * rate[0] + m[4] * rate[1] + m[5] * rate[2]
    wz = m[6] * rate[0] + m[7] * rate[1] + m[8] * rate[2]
    # of the projection centre, which the lever arm swings
    x, y, z = px - body.position[0], py - body.position[1], pz - body.position[2]
    vx, vy, vz = (
        body.velocity[0] + wy * z - wz * y,
        body.velocity[1] + wz * x - wx * z,
        body.velocity[2] + wx * y - wy * x,
    )
    speed = (a * vx + b * vy + c * vz, d * vx + e * vy + f * vz, g * vx + h * vy + i * vz)
    turn = (a * wx + b * wy + c * wz, d * wx + e * wy + f * wz, g * wx + h * wy + i * wz)
    for line in range(3):
        if line == missing:
            continue
        x, y, z = ground[line, 0, 0] - px, ground[line, 0, 1] - py, ground[line, 0, 2] - pz
        start = (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        x, y, z = ground[line, 1, 0] - px, ground[line, 1, 1] - py, ground[line, 1, 2] - pz
        end = (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        first, last = _within_sight(start, end, visibility)
        if last <= first:
            continue
        start, end = _between(start, end, first), _between(start, end, last)
        there, u0, v0, u1, v1 = _clip(camera, setup[4], setup[5], start, end, setup[6])
        length = math.hypot(u1 - u0, v1 - v0)
        if not there or length < setup[7]:
            continue
        # where the middle of what is seen lies on the ground line, by the cross ratio along a line
        u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        ray = ((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0)
        share = _share(start, end, ray)
        depth = start[2] + share * (end[2] - start[2])
        normal = ((v1 - v0) / length, (u0 - u1) / length)
        smear = exposure * _smear(camera, ray, depth, normal, speed, turn)
        distance = depth * math.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + 1.0)
        contrast = max(math.exp(-CONTRAST_DECAY * distance / visibility), ALL_GONE)
        blur = smear * smear / 12.0
        sigma = math.sqrt((setup[17] / contrast) ** 2 + blur)
        worse = 1.0 / (contrast * contrast) + blur / (believed * believed)
        if length < setup[7] * math.sqrt(worse):  # no line stands out of so much noise
            continue
        number = max(2, int(length / spacing) + 1)
        su = sv = suu = suv = svv = 0.0
        for k in range(number):
            along = k / (number - 1)
            x, y = u0 + along * (u1 - u0) - camera.cx, v0 + along * (v1 - v0) - camera.cy
            out = 1.0 + distortion * ((x / camera.fx) ** 2 + (y / camera.fy) ** 2)
            x, y = camera.cx + out * x, camera.cy + out * y
            if k == 0:
                ends[line, 0], ends[line, 1] = x, y
            if k == number - 1:
                ends[line, 2], ends[line, 3] = x, y
            # from the middle, so that the moments lose no digits
            x, y = x - u + sigma * noise[line, k, 0], y - v + sigma * noise[line, k, 1]
            su += x
            sv += y
            suu += x * x
            suv += x * y
            svv += y * y
        mu, mv = su / number, sv / number
        la, lb, lc, spread = _line_from_moments(
            u + mu, v + mv, suu - number * mu * mu, suv - number * mu * mv, svv - number * mv * mv
        )
        readings[line] = np.array((la, lb, lc, u + mu, v + mv, _told(spread, number, believed, worse), number / worse))
        off0, off1 = la * ends[line, 0] + lb * ends[line, 1] + lc, la * ends[line, 2] + lb * ends[line, 3] + lc
        seen[line] = np.array(
            (
                ends[line, 0] - off0 * la,
                ends[line, 1] - off0 * lb,
                ends[line, 2] - off1 * la,
                ends[line, 3] - off1 * lb,
            )
        )
    return readings, ends, seen


@compiled
def _told(spread: float, number: int, believed: float, worse: float) -> float:
    """The spread by which number / worse points of the noise that is believed fix the line's angle as well as these do.

    What noise there is along the line is no lever arm and is taken off the spread, S; a fit whose points are noisy by
    σ both along and across the line has an angle of the variance (1 + N σ²/S) σ²/S to second order.  Where the noise
    is what is believed, the spread is told as measured: `estimator.lines.unguarded_variances` does the rest.

    Parameters
    ----------
    spread : float
        As measured, px².
    number : int
        Of points.
    believed : float
        1 σ of a point as navigation believes it, px.
    worse : float
        Variance of a point, as the detector sees it, over what is believed.
    """
    noise = believed * believed
    lever = max(spread - (number - 1) * worse * noise, 0.1 * spread)
    more = 1.0 + number * (worse - 1.0) * noise / lever if lever > 0.0 else 1.0
    return lever / (worse * more) + max(number / worse - 1.0, 0.0) * noise


@compiled
def _share(start: Vec3, end: Vec3, ray: Vec3) -> float:
    """The share of the way from start to end at which a ray meets it, as nearly as it does."""
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    # (start + t d) × ray = 0, least squares
    nx, ny, nz = dy * ray[2] - dz * ray[1], dz * ray[0] - dx * ray[2], dx * ray[1] - dy * ray[0]
    mx = start[1] * ray[2] - start[2] * ray[1]
    my = start[2] * ray[0] - start[0] * ray[2]
    mz = start[0] * ray[1] - start[1] * ray[0]
    square = nx * nx + ny * ny + nz * nz
    share = 0.0 if square == 0.0 else -(mx * nx + my * ny + mz * nz) / square
    return min(max(share, 0.0), 1.0)


def line_camera(
    config: CameraConfig,
    fault: FaultConfig,
    lever: Vec3,
    runway: Runway,
    rng: Generator,
    chance: Generator,
    believed_px: float,
) -> LineCamera | ImperfectCamera:
    """The camera of a scenario: the plain one where it has none of the errors of this module."""
    if is_perfect(config, fault):
        return LineCamera(config, lever, runway, rng)
    return ImperfectCamera(config, fault, lever, runway, rng, chance, believed_px)
