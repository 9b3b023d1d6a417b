"""The filter: inertial navigation corrected by vision poses, 15 error states, on filterpy's extended Kalman filter.

The nominal state runs outside at the rate of the inertial unit (`estimator.strapdown`); the filter carries the error
and its covariance at the rate of the camera.  After each update the error is taken into the nominal state and set to
zero.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from estimator import strapdown
from estimator.camera import PinholeCamera
from estimator.innovation import (
    Innovation,
    Lines,
    Mount,
    pose_innovation,
)
from estimator.so3 import Array, Mat3, Vec3, flat, log, matmul, rotate, transpose
from estimator.strapdown import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY, ImuNoise, Inertial, Site


class Gates(NamedTuple):
    """Largest normalised innovation squared that is still believed."""

    early: float
    """Of six numbers."""
    late: float
    """Of four."""


class Update(NamedTuple):
    """What became of one frame."""

    degrees: int
    """6 early, 4 late, 0 without a measurement."""
    nis: float
    """Normalised innovation squared; NaN without a measurement."""
    accepted: bool


NO_UPDATE = Update(0, float("nan"), False)


class Start(NamedTuple):
    """Nominal state and covariance with which the filter starts."""

    state: Inertial
    covariance: Array
    """(15, 15)."""


class Sighting(NamedTuple):
    """A vision pose of the body in one of the first frames."""

    position: Vec3
    """Of the inertial unit, runway frame, m."""
    attitude: Mat3
    """R_runway_from_body."""


def body_from_camera(position: Sequence[float], R_cam_from_runway: Array, tilt: float, lever: Vec3) -> Sighting:
    """The body's pose from the camera's, with the mount angle as read (rad) and the lever arm (m)."""
    right, down, forward = R_cam_from_runway
    s, c = np.sin(tilt), np.cos(tilt)
    # the inverse of camera_axes: the body's axes, in the runway frame, as columns
    attitude = flat(np.stack((c * forward - s * down, right, s * forward + c * down), axis=-1))
    x, y, z = rotate(attitude, lever)
    return Sighting((float(position[0]) - x, float(position[1]) - y, float(position[2]) - z), attitude)


class Alignment:
    """The start: the first vision poses, brought to one time by the inertial unit, and a velocity along the nose.

    The first pose starts a dead reckoning; the mean difference of all poses from it corrects it.  The velocity is the
    airspeed along the body's x axis, turned down by the angle of attack: its error is that of the attitude, and the
    wind.

    Parameters
    ----------
    frames : int
        Number of poses.
    alpha : float
        Angle of attack in trim, rad.
    speed_sigma : float
        Of what the air, the tube and the sideslip leave unknown of the velocity, on each axis, m/s.
    """

    def __init__(self, site: Site, frames: int, alpha: float, speed_sigma: float) -> None:
        self._site = site
        self._frames = frames
        self._nose = (float(np.cos(alpha)), 0.0, float(np.sin(alpha)))
        self._speed_sigma = speed_sigma
        self._state: Inertial | None = None
        self._time = 0.0
        self._shifts: list[tuple[float, ...]] = []

    def propagate(self, angle: Vec3, velocity: Vec3, dt: float) -> None:
        """Carry the dead reckoning on by an interval of the inertial unit."""
        if self._state is not None:
            self._state, _ = strapdown.propagate(self._state, self._site, angle, velocity, dt)
            self._time += dt

    def add(self, sighting: Sighting, airspeed: float) -> bool:
        """Take in a vision pose; True once there are enough."""
        if self._state is None:
            self._state = Inertial(sighting.position, self._velocity(sighting.attitude, airspeed), sighting.attitude)
        p, q = sighting.position, self._state.position
        turn = log(matmul(sighting.attitude, transpose(self._state.attitude)))
        self._shifts.append((p[0] - q[0], p[1] - q[1], p[2] - q[2], *turn))
        return len(self._shifts) >= self._frames

    def _velocity(self, attitude: Mat3, airspeed: float) -> Vec3:
        x, y, z = rotate(attitude, self._nose)
        return airspeed * x, airspeed * y, airspeed * z

    def mean(self, airspeed: float) -> Inertial:
        """The dead-reckoned state, corrected by the mean of the poses."""
        assert self._state is not None
        shift = np.zeros(strapdown.STATES)
        mean = np.mean(self._shifts, axis=0)
        shift[POSITION], shift[ATTITUDE] = mean[:3], mean[3:]
        position, _, attitude = strapdown.corrected(self._state, shift.tolist())
        return Inertial(position, self._velocity(attitude, airspeed), attitude)

    def start(self, airspeed: float, pose: Innovation, mount: Mount, noise: ImuNoise) -> Start:
        """Nominal state and covariance.

        Parameters
        ----------
        airspeed : float
            m/s.
        pose : Innovation
            Early innovation of the last frame at `mean`, for its covariance: that of one frame.
        """
        state = self.mean(airspeed)
        # independent: the mean pose of the camera (6), the velocity's own error (3), the biases (6)
        camera = pose.R / len(self._shifts)
        camera[:3, :3] += np.eye(3) * (0.5 * self._speed_sigma * self._time) ** 2
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


class _ErrorFilter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy has no types
    """filterpy's filter of an error that is zero whenever it is predicted."""

    def predict_x(self, _: float = 0.0) -> None:
        """Leave the error at zero, where every update leaves it."""


class InertialVisionFilter:
    """Position, velocity, attitude, gyro and accelerometer bias from an inertial unit and a camera.

    Parameters
    ----------
    camera : PinholeCamera
    width : float
        Between the runway's edges, m.
    mount : Mount
    site : Site
    noise : ImuNoise
    gates : Gates
    start : Start

    Attributes
    ----------
    state : Inertial
        Of the inertial unit, at the last `propagate`.
    gyro_bias, accel_bias : (3,) float
        rad/s and m/s², body frame.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        width: float,
        mount: Mount,
        site: Site,
        noise: ImuNoise,
        gates: Gates,
        start: Start,
    ) -> None:
        self._camera = camera
        self._width = width
        self._mount = mount
        self._site = site
        self._noise = noise
        self._gates = gates
        self.state = start.state
        self.gyro_bias: Vec3 = (0.0, 0.0, 0.0)
        self.accel_bias: Vec3 = (0.0, 0.0, 0.0)
        self._ekf = _ErrorFilter(dim_x=strapdown.STATES, dim_z=6)
        self._zero = np.zeros(strapdown.STATES)
        self._zero.flags.writeable = False
        self._ekf.x = self._zero
        self._ekf.P = start.covariance.copy()
        self._ekf.F = np.eye(strapdown.STATES)
        # numbers are written to a view of the buffer at a tenth of what an index of the array costs
        self._transition: Any = memoryview(self._ekf.F.reshape(-1))
        self._noise_dt = 0.0
        self._elapsed = 0.0
        self._fx = self._fy = self._fz = 0.0

    @property
    def covariance(self) -> Array:
        """Covariance (15, 15) of the errors, at the last `predict` or `observe`."""
        result: Array = self._ekf.P
        return result

    def propagate(self, angle: Vec3, velocity: Vec3, dt: float) -> None:
        """Carry the nominal state on by one interval, whose increments are as `strapdown.propagate` takes them."""
        g, a = self.gyro_bias, self.accel_bias
        self.state, force = strapdown.propagate(
            self.state,
            self._site,
            (angle[0] - g[0] * dt, angle[1] - g[1] * dt, angle[2] - g[2] * dt),
            (velocity[0] - a[0] * dt, velocity[1] - a[1] * dt, velocity[2] - a[2] * dt),
            dt,
        )
        self._fx += force[0]
        self._fy += force[1]
        self._fz += force[2]
        self._elapsed += dt

    def predict(self) -> None:
        """Carry the covariance on to the nominal state's time."""
        dt = self._elapsed
        if dt == 0.0:
            return
        ekf = self._ekf
        if abs(dt - self._noise_dt) > 1e-9:
            self._noise_dt = dt
            ekf.Q = strapdown.process_noise(self._noise, dt)
        numbers = strapdown.transition(self.state.attitude, (self._fx, self._fy, self._fz), dt)
        transition = self._transition
        for place, number in zip(strapdown.TRANSITION_PLACES, numbers, strict=True):
            transition[place] = number
        ekf.predict()
        self._elapsed = self._fx = self._fy = self._fz = 0.0

    def observe(self, lines: Lines, tilt: float) -> Update:
        """Correct the state by one frame, if it passes the gate.  `predict` comes first.

        Parameters
        ----------
        lines : Lines
        tilt : float
            Mount angle as read, rad.
        """
        ekf = self._ekf
        innovation = pose_innovation(
            self._camera, self._width, self._mount, lines, self.state.position, self.state.attitude, tilt
        )
        if innovation is None:
            return NO_UPDATE
        y, H, ekf.R = innovation
        before = ekf.P
        # z and Hx are those of an error of zero: the innovation stands for their difference
        ekf.update(0.0, lambda _: H, _no_error, residual=lambda _z, _hx: y)
        nis = float(np.dot(y, np.dot(ekf.SI, y)))
        degrees = len(y)
        if not nis <= (self._gates.early if degrees == 6 else self._gates.late):
            ekf.P = before
            ekf.x = self._zero
            return Update(degrees, nis, False)
        error = ekf.x.tolist()
        self.state = strapdown.corrected(self.state, error)
        (a, b, c), (d, e, f) = self.gyro_bias, self.accel_bias
        self.gyro_bias = (a + error[9], b + error[10], c + error[11])
        self.accel_bias = (d + error[12], e + error[13], f + error[14])
        ekf.x = self._zero
        return Update(degrees, nis, True)


def _no_error(_: Array) -> float:
    """What the measurement would be of an error of zero: the nominal state holds all that is known."""
    return 0.0


def _cross(v: Vec3) -> Array:
    return np.array(((0.0, -v[2], v[1]), (v[2], 0.0, -v[0]), (-v[1], v[0], 0.0)))
