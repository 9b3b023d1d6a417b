"""The filter: inertial navigation corrected by vision, 15 error states, on filterpy's extended Kalman filter.

The nominal state runs outside at the rate of the inertial unit (`estimator.strapdown`); the filter carries the error
and its covariance at the rate of the camera.  The update is filterpy's; the prediction of an error that is zero is that
of its covariance alone (`estimator.strapdown.predicted`).  After each update the error is taken into the nominal state
and set to zero.
"""

import math
import types
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from estimator import strapdown
from estimator.alignment import Start
from estimator.camera import PinholeCamera
from estimator.compiled import compiled
from estimator.innovation import Eye, Innovation, frame_innovation
from estimator.mount import Mount
from estimator.so3 import Array
from estimator.strapdown import ImuNoise, Inertial, Site, advance_into, corrected, inertial, predicted, rows


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


@compiled
def _cholesky_inverse(matrix: Array) -> Array:
    """The inverse of a symmetric, positive definite matrix (n, n); NaN where it is neither."""
    n = matrix.shape[0]
    root, result = np.zeros((n, n)), np.empty((n, n))
    for i in range(n):  # the inverse of the lower factor, row by row, next to the factor itself
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= root[i, k] * root[j, k]
            root[i, j] = rest / root[j, j] if j < i else np.sqrt(rest)
    back = np.zeros((n, n))
    for j in range(n):
        back[j, j] = 1.0 / root[j, j]
        for i in range(j + 1, n):
            rest = 0.0
            for k in range(j, i):
                rest -= root[i, k] * back[k, j]
            back[i, j] = rest / root[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, n):
                total += back[k, i] * back[k, j]
            result[i, j] = result[j, i] = total
    return result


class _Inverse:
    """What stands for scipy.linalg in filterpy's update, which asks it for one thing."""

    @staticmethod
    def inv(matrix: Array) -> Array:
        """The inverse of an innovation's covariance (n, n).

        Raises
        ------
        numpy.linalg.LinAlgError
            If it has none.
        """
        result = _cholesky_inverse(matrix)
        # one that is positive but for rounding has no Cholesky factor
        return result if math.isfinite(result[0, 0]) else np.asarray(np.linalg.inv(matrix), dtype=float)


def _update_of(base: type[Any]) -> Any:
    """The update of filterpy as it stands, but for scipy's inverse, whose checks take as long as all the rest."""
    update = base.update
    return types.FunctionType(
        update.__code__, {**update.__globals__, "linalg": _Inverse}, "update", update.__defaults__, update.__closure__
    )


class _ErrorFilter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy has no types
    """filterpy's filter of an error that is zero before every update."""

    update = _update_of(ExtendedKalmanFilter)


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
    nominal : (18,) array
        Of the inertial unit, at the last `propagate`, as `Inertial.numbers` gives it.  Never written to: each step
        makes a new one.
    bias : (6,) array
        Gyros (rad/s) and accelerometers (m/s²), body frame; never written to either.
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
        self._eye = Eye(camera, width, mount).numbers()
        self._site = site.numbers()
        self._noise = noise
        self._gates = gates
        self.nominal = start.state.numbers()
        self.bias = np.zeros(6)
        self._rows = rows(strapdown.NOMINAL)
        size = len(start.covariance)
        self._ekf = _ErrorFilter(dim_x=size, dim_z=6)
        self._zero = np.zeros(size)
        self._ekf.x = self._zero
        self._ekf.P = start.covariance.copy()
        self._noise_dt = 0.0
        self._elapsed = 0.0

    _predicted: Callable[..., tuple[Array, Array]] = staticmethod(predicted)

    def unscaled(self, sample: Array) -> Array:
        """A sample (6,) of the inertial unit without what scale factors make of it: this filter knows of none."""
        return sample

    @property
    def state(self) -> Inertial:
        """The nominal state, as tuples."""
        return inertial(self.nominal)

    @property
    def covariance(self) -> Array:
        """Covariance (15, 15) of the errors, at the last `predict` or `observe`."""
        result: Array = self._ekf.P
        return result

    def propagate(self, sample: Array, dt: float) -> tuple[float, float]:
        """Carry the nominal state on by one interval, whose sample (6,) is as `strapdown.advance` takes it.

        Returns
        -------
        roll, pitch : float
            Of the body, at its end, rad.
        """
        before, self.nominal = self.nominal, next(self._rows)
        self._elapsed += dt
        return advance_into(self.nominal, before, self.bias, sample, self._site, dt)

    def predict(self) -> None:
        """Carry the covariance on to the nominal state's time."""
        dt = self._elapsed
        if dt == 0.0:
            return
        ekf = self._ekf
        if abs(dt - self._noise_dt) > 1e-9:
            self._noise_dt = dt
            ekf.Q = strapdown.process_noise(self._noise, dt)
        self.nominal, ekf.P = self._predicted(self.nominal, ekf.P, ekf.Q, dt)
        self._elapsed = 0.0

    def observe(self, lines: Array, tilt: float) -> Update:
        """Correct the state by one frame, if it passes the gate.  `predict` comes first.

        Parameters
        ----------
        lines : (3, 7) array
            As `Lines.numbers` gives them.
        tilt : float
            Mount angle as read, rad.
        """
        innovation = Innovation(*frame_innovation(self._eye, lines, self.nominal, tilt))
        degrees = len(innovation.y)
        if degrees == 0:
            return NO_UPDATE
        return self.apply(innovation, self._gates.early if degrees == 6 else self._gates.late)

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
        y, before = innovation.y, ekf.P
        self._correct(innovation)
        nis, nominal, bias = taken_in(y, ekf.SI, ekf.x, self.nominal, self.bias)
        ekf.x = self._zero
        if not nis <= gate:
            ekf.P = before
            return Update(len(y), nis, False)
        self.nominal, self.bias = nominal, bias
        return Update(len(y), nis, True)

    def _correct(self, innovation: Innovation) -> None:
        """Filterpy's update of the error, which was zero, and of its covariance."""
        y, H, self._ekf.R = innovation
        # z and Hx are those of an error of zero: the innovation stands for their difference
        self._ekf.update(0.0, lambda _: H, _no_error, residual=lambda _z, _hx: y)


@compiled
def taken_in(y: Array, SI: Array, error: Array, nominal: Array, bias: Array) -> tuple[float, Array, Array]:
    """The normalised innovation squared, and the nominal state (18,) and the biases (6,) with the error taken in."""
    nis = 0.0
    for i in range(len(y)):
        for j in range(len(y)):
            nis += y[i] * SI[i, j] * y[j]
    return nis, corrected(nominal, error), bias + error[9:15]


def _no_error(_: Array) -> float:
    """What the measurement would be of an error of zero: the nominal state holds all that is known."""
    return 0.0
