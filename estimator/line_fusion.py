"""The filter that takes each line by itself, and the camera's calibration as part of its state.

Besides the 15 errors of `estimator.fusion` it carries the eight constants of `estimator.single_lines.Calibration`, each
with the standard deviation that it is known with.  One that is known exactly has none and stays what it is.
"""

from typing import NamedTuple

import numpy as np

from estimator.alignment import Start
from estimator.camera import PinholeCamera
from estimator.compiled import compiled
from estimator.fusion import NO_UPDATE, Gates, InertialVisionFilter, Update, taken_in
from estimator.innovation import Eye, Innovation
from estimator.mount import Mount
from estimator.single_lines import CONSTANTS, lines_innovation
from estimator.so3 import Array
from estimator.strapdown import STATES, ImuNoise, Site, predicted_with_constants


class LinesUpdate(NamedTuple):
    """What became of one frame's lines."""

    update: Update
    found: int
    believed: int
    """Lines as bits: 1 left edge, 2 threshold, 4 right edge."""


class LineVisionFilter(InertialVisionFilter):
    """Position, velocity, attitude, biases and the camera's calibration from an inertial unit and single lines.

    Parameters
    ----------
    camera, width, mount, site, noise
        As for `InertialVisionFilter`.
    gates : (3,) array
        Largest normalised square that is believed of one, two and three lines: `estimator.single_lines.gates_of`.
    start : Start
        Its covariance is (23, 23), the calibration's constants last.

    Attributes
    ----------
    calibration : (8,) array
        As estimated; never written to.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        width: float,
        mount: Mount,
        site: Site,
        noise: ImuNoise,
        gates: Array,
        start: Start,
    ) -> None:
        super().__init__(camera, width, mount, site, noise, Gates(np.inf, np.inf), start)
        self._eye = Eye(camera, width, mount).numbers()
        self._line_gates = gates
        self.calibration = np.zeros(CONSTANTS)

    _predicted = staticmethod(predicted_with_constants)

    @property
    def covariance(self) -> Array:
        """Covariance (15, 15) of the errors but the calibration's, at the last `predict` or `observe`."""
        result: Array = self._ekf.P[:STATES, :STATES].copy()
        return result

    @property
    def augmented_covariance(self) -> Array:
        """Covariance (23, 23) of all errors; not to be written to."""
        result: Array = self._ekf.P
        return result

    def observe_lines(self, lines: Array, extent: Array, tilt: float) -> LinesUpdate:
        """Correct the state by those of a frame's lines that agree with it.  `predict` comes first.

        Parameters
        ----------
        lines : (3, 7) array
            As `Lines.numbers` gives them.
        extent : (3,) array
            Mean square distance of each line's points from their centroid, px².
        tilt : float
            Mount angle as read, rad.
        """
        ekf = self._ekf
        y, H, R, found, believed, nis = lines_innovation(
            self._eye, lines, extent, self.nominal, self.calibration, tilt, ekf.P, self._line_gates
        )
        if believed == 0:
            return LinesUpdate(Update(2 * found.bit_count(), nis, False) if found else NO_UPDATE, found, 0)
        self._correct(Innovation(y, H, R))
        # what rounding leaves of P - Pᵀ grows from frame to frame where constants are hardly observed
        ekf.P = 0.5 * (ekf.P + ekf.P.T)
        _, self.nominal, self.bias = taken_in(y, ekf.SI, ekf.x, self.nominal, self.bias)
        self.calibration = self.calibration + ekf.x[STATES:]
        ekf.x = self._zero
        return LinesUpdate(Update(len(y), nis, True), found, believed)


@compiled
def carried(nominal: Array, covariance: Array, noise: Array, dt: float) -> Array:
    """The covariance (n, n) over a time, as `predicted_with_constants`."""
    _, result = predicted_with_constants(nominal, covariance, noise, dt)
    return result
