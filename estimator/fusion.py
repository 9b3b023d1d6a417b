"""The filter: inertial navigation corrected by vision, 15 error states, on filterpy's extended Kalman filter.

The nominal state runs outside at the rate of the inertial unit (`estimator.strapdown`); the filter carries the error
and its covariance at the rate of the camera.  After each update the error is taken into the nominal state and set to
zero.
"""

from typing import Any, NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from estimator import strapdown
from estimator.alignment import Start
from estimator.camera import PinholeCamera
from estimator.innovation import Innovation, Lines, pose_innovation
from estimator.mount import Mount
from estimator.so3 import Array, Vec3
from estimator.strapdown import ImuNoise, Site


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
        innovation = pose_innovation(
            self._camera, self._width, self._mount, lines, self.state.position, self.state.attitude, tilt
        )
        if innovation is None:
            return NO_UPDATE
        return self.apply(innovation, self._gates.early if lines.threshold is not None else self._gates.late)

    def apply(self, innovation: Innovation, gate: float) -> Update:
        """Correct the state by any measurement of it, if it passes the gate.  `predict` comes first.

        Parameters
        ----------
        innovation : Innovation
            Residual, matrix and covariance, at the predicted state.
        gate : float
            Largest normalised innovation squared that is believed.
        """
        ekf = self._ekf
        y, H, ekf.R = innovation
        before = ekf.P
        # z and Hx are those of an error of zero: the innovation stands for their difference
        ekf.update(0.0, lambda _: H, _no_error, residual=lambda _z, _hx: y)
        nis = float(np.dot(y, np.dot(ekf.SI, y)))
        if not nis <= gate:
            ekf.P = before
            ekf.x = self._zero
            return Update(len(y), nis, False)
        error = ekf.x.tolist()
        self.state = strapdown.corrected(self.state, error)
        (a, b, c), (d, e, f) = self.gyro_bias, self.accel_bias
        self.gyro_bias = (a + error[9], b + error[10], c + error[11])
        self.accel_bias = (d + error[12], e + error[13], f + error[14])
        ekf.x = self._zero
        return Update(len(y), nis, True)


def _no_error(_: Array) -> float:
    """What the measurement would be of an error of zero: the nominal state holds all that is known."""
    return 0.0
