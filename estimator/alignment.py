"""The start of the filter: from the first vision poses and the inertial unit to a state and its covariance."""

import math
from typing import NamedTuple

import numpy as np

from estimator import strapdown
from estimator.innovation import Innovation
from estimator.mount import BodyPose, Mount
from estimator.so3 import Array, Mat3, Vec3, log, matmul, rotate, transpose
from estimator.strapdown import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY, ImuNoise, Inertial, Site


class Incidence(NamedTuple):
    """The angle of attack of steady flight."""

    alpha: float
    """At `speed`, rad."""
    slope: float
    """rad per m/s."""
    speed: float
    """Airspeed, m/s."""

    def at(self, airspeed: float) -> float:
        """Angle of attack (rad) at an airspeed (m/s)."""
        return self.alpha + self.slope * (airspeed - self.speed)


class Start(NamedTuple):
    """Nominal state and covariance with which the filter starts."""

    state: Inertial
    covariance: Array
    """(15, 15)."""


class Alignment:
    """The start: the first vision poses, brought to one time by the inertial unit, and a velocity along the nose.

    The first pose starts a dead reckoning; the mean difference of all poses from it corrects it.  The velocity is the
    airspeed along the body's x axis, turned down by the angle of attack: its error is that of the attitude, and the
    wind.

    Parameters
    ----------
    frames : int
        Number of poses.
    incidence : Incidence
        By the airspeed.
    speed_sigma : float
        Of what the air, the tube and the sideslip leave unknown of the velocity, on each axis, m/s.
    """

    def __init__(self, site: Site, frames: int, incidence: Incidence, speed_sigma: float) -> None:
        self._site = site.numbers()
        self._frames = frames
        self._incidence = incidence
        self._speed_sigma = speed_sigma
        self._nominal: Array | None = None
        self._time = 0.0
        self._shifts: list[tuple[float, ...]] = []

    def propagate(self, sample: Array, dt: float) -> None:
        """Carry the dead reckoning on by an interval of the inertial unit, its sample as `advance` takes it."""
        if self._nominal is not None:
            self._nominal = strapdown.advance(self._nominal, _NO_BIAS, sample, self._site, dt)
            self._time += dt

    def add(self, pose: BodyPose, airspeed: float) -> bool:
        """Take in a vision pose; True once there are enough."""
        if self._nominal is None:
            first = Inertial(pose.position, self._velocity(pose.attitude, airspeed), pose.attitude)
            self._nominal = first.numbers()
        reckoned = strapdown.inertial(self._nominal)
        p, q = pose.position, reckoned.position
        turn = log(matmul(pose.attitude, transpose(reckoned.attitude)))
        self._shifts.append((p[0] - q[0], p[1] - q[1], p[2] - q[2], *turn))
        return len(self._shifts) >= self._frames

    def _velocity(self, attitude: Mat3, airspeed: float) -> Vec3:
        alpha = self._incidence.at(airspeed)
        return rotate(attitude, (airspeed * math.cos(alpha), 0.0, airspeed * math.sin(alpha)))

    def mean(self, airspeed: float) -> Inertial:
        """The dead-reckoned state, corrected by the mean of the poses."""
        assert self._nominal is not None
        shift = np.zeros(strapdown.STATES)
        mean = np.mean(self._shifts, axis=0)
        shift[POSITION], shift[ATTITUDE] = mean[:3], mean[3:]
        position, _, attitude = strapdown.inertial(strapdown.corrected(self._nominal, shift))
        return Inertial(position, self._velocity(attitude, airspeed), attitude)

    def start(self, airspeed: float, pose: Innovation, mount: Mount, noise: ImuNoise) -> Start:
        """Nominal state and covariance.

        Parameters
        ----------
        airspeed : float
            m/s.
        pose : Innovation
            Early innovation of the last frame at `mean`, for its covariance: that of one frame.
        mount : Mount
        noise : ImuNoise
        """
        state = self.mean(airspeed)
        # independent: the mean pose of the camera (6), the velocity's own error (3), the biases (6)
        camera = pose.R / len(self._shifts)
        camera[:3, :3] += np.eye(3) * (0.5 * self._speed_sigma * self._time) ** 2
        camera[3:, 3:] += np.eye(3) * (noise.gyro**2 * self._time + (noise.gyro_bias * self._time) ** 2)
        source = np.zeros((strapdown.STATES, strapdown.STATES))
        source[:6, :6] = camera
        source[6:9, 6:9] = np.eye(3) * self._speed_sigma**2
        source[9:12, 9:12] = np.eye(3) * noise.gyro_bias**2
        source[12:, 12:] = np.eye(3) * noise.accel_bias**2
        spread = np.zeros_like(source)
        spread[POSITION, :3] = np.eye(3)
        spread[POSITION, 3:6] = _cross(rotate(state.attitude, mount.lever))
        spread[ATTITUDE, 3:6] = np.eye(3)
        spread[VELOCITY, 3:6] = -_cross(state.velocity)
        spread[VELOCITY, 6:9] = np.eye(3)
        spread[GYRO_BIAS, 9:12] = np.eye(3)
        spread[ACCEL_BIAS, 12:] = np.eye(3)
        return Start(state, spread @ source @ spread.T)

    def start_of_lines(
        self, airspeed: float, lines: Array, variance: Array, calibration: Array, noise: ImuNoise
    ) -> Start:
        """As `start`, with the camera's calibration in the covariance, which is (23, 23).

        The calibration's errors are the same in all frames, so they do not average out, and the pose that they falsify
        is correlated with them.

        Parameters
        ----------
        airspeed : float
            m/s.
        lines : (6, 23) array
            H of `estimator.single_lines.line_residuals` at `mean`, of all three lines.
        variance : (6, 6) array
            Of one frame's residuals.
        calibration : (8,) array
            Standard deviations of the calibration's constants.
        noise : ImuNoise
        """
        state = self.mean(airspeed)
        size = lines.shape[1]
        constants = slice(strapdown.STATES, size)
        pose = np.linalg.inv(lines[:, [0, 1, 2, 6, 7, 8]])  # δ of the body's pose by the residuals
        falsified = -pose @ lines[:, constants] * calibration
        body = pose @ variance @ pose.T / len(self._shifts)
        body[:3, :3] += np.eye(3) * (0.5 * self._speed_sigma * self._time) ** 2
        body[3:, 3:] += np.eye(3) * (noise.gyro**2 * self._time + (noise.gyro_bias * self._time) ** 2)
        body += falsified @ falsified.T
        spread = np.zeros((size, 6))
        spread[POSITION, :3] = np.eye(3)
        spread[ATTITUDE, 3:] = np.eye(3)
        spread[VELOCITY, 3:] = -_cross(state.velocity)
        covariance = spread @ body @ spread.T
        covariance[VELOCITY, VELOCITY] += np.eye(3) * self._speed_sigma**2
        covariance[GYRO_BIAS, GYRO_BIAS] = np.eye(3) * noise.gyro_bias**2
        covariance[ACCEL_BIAS, ACCEL_BIAS] = np.eye(3) * noise.accel_bias**2
        covariance[:, constants] = spread @ falsified * calibration
        covariance[constants, :] = covariance[:, constants].T
        covariance[constants, constants] = np.diag(calibration**2)
        return Start(state, covariance)


_NO_BIAS = np.zeros(6)


def _cross(v: Vec3) -> Array:
    return np.array(((0.0, -v[2], v[1]), (v[2], 0.0, -v[0]), (-v[1], v[0], 0.0)))
