"""The filter that takes each line by itself, with the camera's calibration and scale factors as part of its state.

Besides the 15 errors of `estimator.fusion` it carries the eight constants of `estimator.single_lines.Calibration`, and
where the inertial unit has scale factors those of its six axes, each with the standard deviation that it is known with.
One that is known exactly has none and stays what it is.
"""

import functools
import operator
from typing import NamedTuple

import numpy as np

from estimator.alignment import Start
from estimator.camera import PinholeCamera
from estimator.compiled import compiled
from estimator.fusion import NO_UPDATE, Gates, InertialVisionFilter, Update, taken_in
from estimator.innovation import Eye, Innovation
from estimator.mount import Mount
from estimator.single_lines import ALL, AUGMENTED, CONSTANTS, LINES, lines_innovation
from estimator.so3 import Array
from estimator.strapdown import ACCEL_BIAS, AXES, POSITION, STATES, ImuNoise, Site, predicted_with_constants

SCALED = AUGMENTED + AXES
"""Numbers of a filter that estimates scale factors."""
_BIASES = slice(STATES - AXES, STATES)
FAR = 1.0
"""Standard deviation across or in height, m, beyond which lines are linearised again where they lead to: after a long
time without any they may lie so far off that the first linearisation makes a filter sure of a wrong place."""
ITERATIONS = 8
SETTLED = 0.01
"""Change of the position, m, at which that is over."""
_OPEN, _CLOSED = np.full(LINES, np.inf), np.full(LINES, -1.0)
"""Gates that every line passes, and none."""


def with_constants(start: Start, calibration: Array, noise: ImuNoise, gravity: float) -> Start:
    """A start with the constants behind its errors.

    Parameters
    ----------
    start : Start
        Its covariance is (15, 15), or (23, 23) if it has the calibration already.
    calibration : (8,) array
        Standard deviations.
    noise : ImuNoise
        With a scale factor, six more constants follow, and what it makes of gravity is not in the biases any more.
    gravity : float
        m/s².
    """
    given = len(start.covariance)
    size = SCALED if noise.scale_factor > 0.0 else AUGMENTED
    covariance = np.zeros((size, size))
    covariance[:given, :given] = start.covariance
    if given == STATES:
        covariance[STATES:AUGMENTED, STATES:AUGMENTED] = np.diag(calibration**2)
    if size == SCALED:
        square = noise.scale_factor**2
        covariance[AUGMENTED:, AUGMENTED:] = np.eye(AXES) * square
        covariance[ACCEL_BIAS, ACCEL_BIAS] -= np.eye(3) * square * gravity**2
    return Start(start.state, covariance)


class Measured(NamedTuple):
    """What `estimator.single_lines.lines_innovation` gives."""

    y: Array
    H: Array
    R: Array
    found: int
    believed: int
    nis: float


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
        Its covariance is (23, 23), the calibration's constants last, or (29, 29) with the scale factors behind them:
        `with_constants`.

    Attributes
    ----------
    calibration : (8,) array
        As estimated; never written to.
    scale_factor : (6,) array
        Of gyros and accelerometers, likewise.
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
        self.scale_factor = np.zeros(AXES)
        self._scaled = len(start.covariance) == SCALED
        self._turned = np.zeros(AXES)

    def unscaled(self, sample: Array) -> Array:
        """A sample (6,) of the inertial unit without what the scale factors make of it."""
        return sample - self.scale_factor * sample if self._scaled else sample

    def propagate(self, sample: Array, dt: float) -> tuple[float, float]:
        """As `InertialVisionFilter.propagate`."""
        if self._scaled:
            self._turned += sample
        return super().propagate(self.unscaled(sample), dt)

    def _predicted(self, nominal: Array, covariance: Array, noise: Array, dt: float) -> tuple[Array, Array]:
        moved = predicted_with_constants(nominal, covariance, noise, dt, self._turned, AUGMENTED)
        self._turned = np.zeros(AXES)
        return moved

    def biases(self, rate: Array, covariance: Array) -> tuple[Array, Array]:
        """What the inertial unit is off by as it turns now, bias and scale factor together.

        Parameters
        ----------
        rate : (6,) array
            As measured, rad/s and m/s².
        covariance : (n, n) array
            Of all errors now.

        Returns
        -------
        (6,), (15, 15) array
            rad/s and m/s², and the covariance of the 15 errors with these in place of the biases.
        """
        errors: Array = covariance[:STATES, :STATES].copy()
        if not self._scaled:
            return self.bias, errors
        scale = covariance[AUGMENTED:, AUGMENTED:] * np.outer(rate, rate)
        mixed = covariance[:STATES, AUGMENTED:] * rate
        errors[:, _BIASES] += mixed
        errors[_BIASES] += mixed.T
        errors[_BIASES, _BIASES] += scale
        return self.bias + self.scale_factor * rate, errors

    @property
    def covariance(self) -> Array:
        """Covariance (15, 15) of the errors but the calibration's, at the last `predict` or `observe`."""
        result: Array = self._ekf.P[:STATES, :STATES].copy()
        return result

    @property
    def augmented_covariance(self) -> Array:
        """Covariance (23, 23) or (29, 29) of all errors; not to be written to."""
        result: Array = self._ekf.P
        return result

    def _innovation(self, lines: Array, extent: Array, tilt: float, gates: Array, point: Array) -> Measured:
        """As `lines_innovation`, of this filter's state."""
        P = self._ekf.P
        return Measured(
            *lines_innovation(self._eye, lines, extent, self.nominal, self.calibration, tilt, P, gates, point)
        )

    def _where_led(self, lines: Array, extent: Array, tilt: float, which: int) -> Measured | None:
        """The measurement of some lines, given as bits, at the state that agrees best with it and with them.

        That state is found by Gauss and Newton.  None where this does not settle: the lines then say nothing that a
        covariance could hold.
        """
        lines = lines.copy()
        for line in range(LINES):
            if not which & (1 << line):
                lines[line] = np.nan
        point: Array = self._zero
        P = self._ekf.P
        for _ in range(ITERATIONS):
            y, H, R, *_ = self._innovation(lines, extent, tilt, _OPEN, point)
            PH = P @ H.T
            before, point = point, PH @ np.linalg.solve(H @ PH + R, y)
            if np.abs(point[POSITION] - before[POSITION]).max() < SETTLED:
                return self._innovation(lines, extent, tilt, self._line_gates, point)
        return None

    def _from_afar(self, lines: Array, extent: Array, tilt: float, found: int) -> Measured:
        """The measurement of lines that may lie far off, linearised where they lead to.

        All of them are believed if they agree.  Of three, two are if they are the only two that do; the line that two
        agreeing pairs have in common is if there are more.
        """
        measured = self._where_led(lines, extent, tilt, found)
        if measured is not None and measured.believed == found:
            return measured
        if measured is not None and found == ALL:
            pairs = [ALL & ~(1 << line) for line in range(LINES)]
            led = {pair: self._where_led(lines, extent, tilt, pair) for pair in pairs}
            agreeing = [pair for pair, told in led.items() if told is not None and told.believed == pair]
            common = functools.reduce(operator.and_, agreeing, ALL)
            if agreeing and common:
                measured = led[common] if common in led else self._where_led(lines, extent, tilt, common)
                if measured is not None and measured.believed == common:
                    return measured
        return self._innovation(lines, extent, tilt, _CLOSED, self._zero)

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
        y, H, R, found, believed, nis = self._innovation(lines, extent, tilt, self._line_gates, self._zero)
        if found and max(ekf.P[1, 1], ekf.P[2, 2]) > FAR**2:
            y, H, R, _, believed, nis = self._from_afar(lines, extent, tilt, found)
        if believed == 0:
            return LinesUpdate(Update(2 * found.bit_count(), nis, False) if found else NO_UPDATE, found, 0)
        self._correct(Innovation(y, H, R))
        # what rounding leaves of P - Pᵀ grows from frame to frame where constants are hardly observed
        ekf.P = 0.5 * (ekf.P + ekf.P.T)
        _, self.nominal, self.bias = taken_in(y, ekf.SI, ekf.x, self.nominal, self.bias)
        self.calibration = self.calibration + ekf.x[STATES:AUGMENTED]
        if self._scaled:
            self.scale_factor = self.scale_factor + ekf.x[AUGMENTED:]
        ekf.x = self._zero
        return LinesUpdate(Update(len(y), nis, True), found, believed)


@compiled
def carried(nominal: Array, covariance: Array, noise: Array, dt: float, turned: Array) -> Array:
    """The covariance (n, n) over a time, as `predicted_with_constants`."""
    _, result = predicted_with_constants(nominal, covariance, noise, dt, turned, AUGMENTED)
    return result
