"""Drives the estimator: from the inertial unit, the camera's lines and the pitot tube to the navigation state.

Raw vision poses come from the paper's solvers.  The filter starts from the first of them, and from then on takes three
lines whenever the threshold is in view and two when it is not.  With ``aiding = "lines"`` it takes whatever lines there
are, one by one, and leaves out those that disagree.

A frame that arrives late is used at its capture: the filter then runs behind by the latency, and the inertial unit
carries its state on to the present.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from estimator.alignment import Alignment, Incidence, Start
from estimator.camera import PinholeCamera
from estimator.compiled import compiled, rotate_back
from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.fusion import NO_UPDATE, Gates, InertialVisionFilter, Update
from estimator.innovation import Eye, Innovation, frame_innovation
from estimator.line_fusion import LineVisionFilter, carried, with_constants
from estimator.lines import unguarded_variances
from estimator.mount import Mount, body_from_camera, camera_axes
from estimator.single_lines import (
    BOTH_EDGES,
    NO_CALIBRATION,
    Calibration,
    gates_of,
    line_residuals,
)
from estimator.so3 import IDENTITY, Array
from estimator.strapdown import (
    STATES,
    ImuNoise,
    Inertial,
    Site,
    advance_into,
    euler,
    predicted,
    process_noise,
    unpacked,
)
from estimator.three_line import three_line_pose
from landsim.config import MountConfig, NavigationConfig
from landsim.integrity import LineMonitor, is_strained, protection_factor
from landsim.state import Alarm, CameraFrame, ImuSample, NavState, Stage
from landsim.units import DEG, STANDARD_GRAVITY

NAN = math.nan
_NONE, _EARLY, _LATE, _NO_ALARM = Stage.NONE, Stage.EARLY, Stage.LATE, Alarm.NONE
"""A member looked up in its class costs as much as a call."""


def mount_of(config: MountConfig) -> Mount:
    """The camera's mount, as the filter takes it."""
    return Mount(config.position_body_m, (config.tilt_reading_sigma_deg * DEG) ** 2)


class FrameResult(NamedTuple):
    """What one camera frame gave."""

    update: Update
    stage: Stage
    roll: float
    """Of the camera triad, as predicted: what the late stage borrows, rad; NaN where it borrows none."""
    late: bool
    """Whether the threshold, in view or not, was left out of account."""
    found: int | None = None
    """Lines that were offered to the filter, as bits: 1 left edge, 2 threshold, 4 right edge; None where they follow
    from the update's degrees of freedom, three lines of 6 and both edges of 4."""
    believed: int | None = None
    """Those of them that it took."""

    def lines(self) -> tuple[int, int]:
        """``found`` and ``believed``, whether they are said or follow."""
        if self.found is not None and self.believed is not None:
            return self.found, self.believed
        found = _BY_DEGREES[self.update.degrees]
        return found, found if self.update.accepted else 0


_BY_DEGREES = {0: 0, 4: BOTH_EDGES, 6: 7}


class Known(NamedTuple):
    """What navigation says of its errors at the present."""

    covariance: Array
    """(15, 15)."""
    bias: Array
    """(6,), rad/s and m/s²."""
    calibration: Array = NO_CALIBRATION
    """(8,), as `estimator.single_lines.Calibration`."""
    calibration_covariance: Array | None = None
    """(23, 23), of all; None where the calibration is not estimated."""


def calibration_sigma(config: NavigationConfig) -> Array:
    """Standard deviations (8,) of the camera's calibration, as `estimator.single_lines.Calibration`."""
    return np.array(
        Calibration(
            tilt=config.tilt_sigma_deg * DEG,
            pan=config.pan_sigma_deg * DEG,
            roll=config.roll_sigma_deg * DEG,
            focal_length=config.focal_length_sigma,
            principal_u=config.principal_sigma_px,
            principal_v=config.principal_sigma_px,
            distortion=config.distortion_sigma,
            width=config.width_sigma_m,
        )
    )


class Navigator:
    """The navigation computer.

    Parameters
    ----------
    camera : PinholeCamera
    noise_px : float
        1 σ of a line's points, in u and in v, px.
    width : float
        Of the runway, m.
    site : Site
    imu : ImuNoise
    imu_dt : float
        Interval of the inertial unit, s.
    mount : Mount
        Of the camera.
    config : NavigationConfig
    incidence : Incidence
        In steady flight.
    latency : float
        From the capture of a frame to `observe`, s: a whole number of the inertial unit's intervals.
    handover : Start, optional
        State and covariance (15, 15) that whatever flew before hands over, to start from; without it the filter starts
        from the first vision poses.

    Attributes
    ----------
    filter : InertialVisionFilter or None
        Once it has started.
    airspeed : float
        From the pitot tube, smoothed, m/s.
    stage : Stage
        What the last frame gave.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        noise_px: float,
        width: float,
        site: Site,
        imu: ImuNoise,
        imu_dt: float,
        mount: Mount,
        config: NavigationConfig,
        incidence: Incidence,
        latency: float = 0.0,
        handover: Start | None = None,
    ) -> None:
        self._camera = camera
        self._noise_px = max(noise_px, config.min_noise_px)
        self._width = width
        self._site = site
        self._imu = imu
        self._dt = imu_dt
        self._mount = mount
        self._gates = Gates(config.gate_early, config.gate_late)
        self._config = config
        self._incidence = incidence
        self._alignment = self._new_alignment()
        self._smoothing = 1.0 - math.exp(-imu_dt / config.airspeed_smoothing_s)
        self._rejected = 0
        self.airspeed = NAN
        self._sample = np.zeros(6)
        self._angles: tuple[float, float] | None = None
        self._earth_rate = np.array(site.earth_rate)
        self._latch = config.handover == "latched"
        self._late = False
        self.stage = _NONE
        self.filter: InertialVisionFilter | None = None
        self._lag = round(latency / imu_dt)
        self._waiting: deque[ImuSample] = deque()
        self._present: Array | None = None
        self._noise_dt, self._noise = NAN, np.empty(0)
        self._known: Known | None = None
        self._monitor: LineMonitor | None = None
        self._protection = config.protection_inflation * protection_factor(config.integrity_risk)
        if config.aiding == "lines":
            self._calibration = calibration_sigma(config)
            self._line_gates = gates_of(config.line_gate_probability)
            self._monitor = LineMonitor(config.monitor_s, config.unaided_s)
        if handover is not None:
            self._start(handover)

    def _start(self, start: Start) -> None:
        """Start the filter; the covariance is that of the 15 errors, or of the calibration too."""
        given = (self._camera, self._width, self._mount, self._site, self._imu)
        if self._monitor is None:
            self.filter = InertialVisionFilter(*given, self._gates, start)
            return
        start = with_constants(start, self._calibration, self._imu, STANDARD_GRAVITY)
        self.filter = LineVisionFilter(*given, self._line_gates, start)

    def _new_alignment(self) -> Alignment:
        config = self._config
        return Alignment(self._site, config.start_frames, self._incidence, config.start_speed_sigma_mps)

    def take_airspeed(self, airspeed: float) -> None:
        """Take in a sample of the pitot tube (m/s), at the rate of the inertial unit."""
        if math.isnan(self.airspeed):
            self.airspeed = airspeed
        self.airspeed += self._smoothing * (airspeed - self.airspeed)

    def propagate(self, sample: ImuSample) -> None:
        """Take in a sample of the inertial unit."""
        self._sample = sample
        self._known = None
        if self._lag:
            self._propagate_late(sample)
        elif self.filter is None:
            self._alignment.propagate(sample, self._dt)
        else:
            self._angles = self.filter.propagate(sample, self._dt)

    def _propagate_late(self, sample: ImuSample) -> None:
        """Carry the present on by this sample, and what runs behind by the one that is as old as the latency."""
        self._waiting.append(sample)
        due = self._waiting.popleft() if len(self._waiting) > self._lag else None
        if self.filter is None:
            if due is not None:
                self._alignment.propagate(due, self._dt)
            return
        if due is not None:
            self.filter.propagate(due, self._dt)
        before = self.filter.nominal if self._present is None else self._present
        self._present = np.empty_like(before)
        sample = self.filter.unscaled(sample)
        self._angles = advance_into(self._present, before, self.filter.bias, sample, self._site.numbers(), self._dt)

    def _to_the_present(self) -> None:
        """Carry the filter's state on by the samples that it has not had yet."""
        assert self.filter is not None
        moved = self.filter.nominal.copy()
        moved[15:] = 0.0
        site = self._site.numbers()
        for sample in self._waiting:
            before, moved = moved, np.empty_like(moved)
            advance_into(moved, before, self.filter.bias, self.filter.unscaled(sample), site, self._dt)
        self._present = moved

    def observe(self, frame: CameraFrame) -> FrameResult:
        """Take in a camera frame."""
        self._known = None
        result = self._observe(frame)
        if self._lag and self.filter is not None:
            self._to_the_present()
        return result

    def _observe(self, frame: CameraFrame) -> FrameResult:
        self._angles = None  # as they will be known after the frame
        if self.filter is None:
            return self._align(frame.lines, frame.tilt)
        self.filter.predict()
        lines, self._late, borrows = _without_threshold(frame.lines, self._noise_px, self._latch, self._late)
        roll = _camera_roll(self.filter.nominal, frame.tilt) if borrows else NAN
        if isinstance(self.filter, LineVisionFilter):
            return self._observe_lines(self.filter, frame, lines, roll)
        update = self.filter.observe(lines, frame.tilt)
        if update.degrees > 0:
            self._rejected = 0 if update.accepted else self._rejected + 1
        self.stage = _NONE if not update.accepted else _EARLY if update.degrees == 6 else _LATE
        return FrameResult(update, self.stage, roll, self._late)

    def _observe_lines(self, running: LineVisionFilter, frame: CameraFrame, lines: Array, roll: float) -> FrameResult:
        """A frame of which each line counts by itself."""
        assert self._monitor is not None
        update, found, believed = running.observe_lines(lines, _extent(frame.lines), frame.tilt)
        strained = is_strained(running.calibration, self._calibration)
        self._monitor.take(frame.time, found, believed, strained=strained)
        if found:
            self._rejected = 0 if believed else self._rejected + 1
        threshold = bool(believed & (1 << THRESHOLD))
        self.stage = _NONE if not believed else _EARLY if threshold else _LATE
        return FrameResult(update, self.stage, roll, self._late, found, believed)

    def _align(self, readings: Array, tilt: float) -> FrameResult:
        """One of the first frames: the filter starts when there are enough."""
        self.stage = _NONE
        lines = _observed(readings, self._noise_px)
        left, threshold, right = lines[:, :3]
        solution = three_line_pose(self._camera, left, threshold, right, runway_width=self._width)
        if not solution.valid:
            return FrameResult(NO_UPDATE, _NONE, NAN, late=False)
        x, y, z = solution.position.tolist()
        body = body_from_camera((x, y, z), solution.R_cam_from_runway, tilt, self._mount.lever)
        if self._alignment.add(body, self.airspeed):
            state = self._alignment.mean(self.airspeed)
            eye = Eye(self._camera, self._width, self._mount).numbers()
            pose = Innovation(*frame_innovation(eye, lines, state.numbers(), tilt))
            usable = len(pose.y) == 6
            turn_sigma = math.sqrt(max(pose.R[3, 3], pose.R[4, 4], pose.R[5, 5])) if usable else math.inf
            if turn_sigma > self._config.start_attitude_sigma_deg * DEG:
                # so far away a mean of poses is no start: begin again, nearer
                self._alignment = self._new_alignment()
            elif self._monitor is None:
                self._start(self._alignment.start(self.airspeed, pose, self._mount, self._imu))
            else:
                self._start(self._start_of_lines(eye, lines, _extent(readings), state.numbers(), tilt))
        self.stage = _EARLY
        return FrameResult(NO_UPDATE, _EARLY, NAN, late=False)

    def _start_of_lines(self, eye: Array, lines: Array, extent: Array, nominal: Array, tilt: float) -> Start:
        """The start with the calibration's part in it."""
        _, H = line_residuals(eye, lines, extent, nominal, NO_CALIBRATION, tilt)
        shared = H[:, STATES]  # the mount's angle as read is off for all lines alike
        variance = np.diag(lines[:, 5:7].ravel()) + self._mount.tilt_variance * np.outer(shared, shared)
        return self._alignment.start_of_lines(self.airspeed, H, variance, self._calibration, self._imu)

    @property
    def known(self) -> InertialVisionFilter | Known | None:
        """What says covariance and bias at the present; None before the filter has started."""
        running = self.filter
        if running is None or not (self._lag or isinstance(running, LineVisionFilter)):
            return running
        if self._known is None:
            self._known = self._known_of(running)
        return self._known

    def _known_of(self, running: InertialVisionFilter) -> Known:
        dt = len(self._waiting) * self._dt
        present = self._present if self._waiting else None
        if not isinstance(running, LineVisionFilter):
            covariance = running.covariance
            if present is not None:
                covariance = predicted(present, covariance, self._noise_over(dt), dt)[1]
            return Known(covariance, running.bias)
        augmented = running.augmented_covariance
        if present is not None:
            turned = np.sum(self._waiting, axis=0)
            augmented = carried(present, augmented, self._noise_over(dt), dt, turned)
        bias, covariance = running.biases(self._sample / self._dt, augmented)
        return Known(covariance, bias, running.calibration, augmented)

    def _noise_over(self, dt: float) -> Array:
        """The process noise (15, 15) of a time, which is mostly the latency."""
        if dt != self._noise_dt:
            self._noise_dt, self._noise = dt, process_noise(self._imu, dt)
        return self._noise

    @property
    def diverged(self) -> str | None:
        """Why the filter is no longer to be believed, if it is not."""
        if self.filter is None:
            return None
        sigma2 = _position_variance(self.filter.covariance, self.filter.nominal)
        if not math.isfinite(sigma2):
            return "its position is not finite, or a variance of it is negative"
        if sigma2 > self._config.max_position_sigma_m**2:
            return f"its position sigma is {math.sqrt(sigma2):.1f} m"
        if self._rejected > self._config.max_rejected_frames:
            return f"it rejected {self._rejected} frames in succession"
        return None

    @property
    def covariance(self) -> Array | None:
        """Of the filter's errors (15, 15), at the present; None before it has started."""
        known = self.known
        return None if known is None else known.covariance

    @property
    def bias(self) -> Array | None:
        """Of gyros and accelerometers (6,), rad/s and m/s²; None before the filter has started."""
        return None if self.filter is None else self.filter.bias

    @property
    def ready(self) -> bool:
        """Whether the filter has started."""
        return self.filter is not None

    @property
    def nominal(self) -> Array:
        """Position, velocity and attitude of the body (18,); not to be used before the filter has started."""
        if self._present is not None:
            return self._present
        return _UNKNOWN if self.filter is None else self.filter.nominal

    def roll_and_pitch(self) -> tuple[float, float]:
        """Of the body, rad: what the inner loops need between two calls of guidance."""
        if self._angles is None:
            roll, pitch, _ = euler(self.nominal)
            self._angles = roll, pitch
        return self._angles

    def state(self, time: float) -> NavState:
        """What guidance is given."""
        running = self.filter
        bias = _NO_BIAS if running is None else running.bias
        if isinstance(running, LineVisionFilter):
            bias = bias + running.scale_factor * self._sample / self._dt
        known = self.known
        covariance = _NOTHING_KNOWN if known is None else known.covariance
        n = _stated(self.nominal, bias, self._sample, self._earth_rate, self._dt, covariance, self._protection).tolist()
        return tuple.__new__(  # what NavState(...) does, at half the price
            NavState,
            (
                time,
                running is not None,
                (n[0], n[1], n[2]),
                (n[3], n[4], n[5]),
                (n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14]),
                n[15],
                n[16],
                n[17],
                (n[18], n[19], n[20]),
                self.airspeed,
                self.stage,
                n[22],
                n[23],
                _NO_ALARM if self._monitor is None else self._monitor.alarm(time),
                n[21],
            ),
        )


_UNKNOWN = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), IDENTITY).numbers()
_NO_BIAS = np.zeros(6)
_NOTHING_KNOWN = np.full((STATES, STATES), NAN)


_variances = compiled(unguarded_variances)


def _extent(readings: Array) -> Array:
    """Mean square distance (3,) of each line's points from their centroid, px²."""
    result: Array = readings[:, 5] / readings[:, 6]
    return result


@compiled
def _observed(readings: Array, noise_px: float) -> Array:
    """A frame's lines (3, 7) as the filter takes them: in place of spread and number of points, variances."""
    result = readings.copy()
    for line in range(3):
        result[line, 5], result[line, 6] = _variances(readings[line, 5], readings[line, 6], noise_px)
    return result


@compiled
def _without_threshold(readings: Array, noise_px: float, latch: bool, late: bool) -> tuple[Array, bool, bool]:
    """As `_observed`, whether the threshold is left out of account from now on, and whether the lines do without it.

    With `latch` the threshold is left out from the first frame on that shows both edges and no threshold.
    """
    lines = _observed(readings, noise_px)
    missing = math.isnan(lines[THRESHOLD, 0])
    if latch:
        late = late or (missing and not math.isnan(lines[LEFT, 0] + lines[RIGHT, 0]))
        if late:
            lines[THRESHOLD] = NAN
            missing = True
    return lines, late, missing


@compiled
def _position_variance(covariance: Array, nominal: Array) -> float:
    """Of the three axes together, m²; NaN where the position is not finite or a variance is negative."""
    x, y, z = covariance[0, 0], covariance[1, 1], covariance[2, 2]
    if not (x >= 0.0 and y >= 0.0 and z >= 0.0 and math.isfinite(nominal[0] + nominal[1] + nominal[2])):
        return math.nan
    return float(x + y + z)


@compiled
def _camera_roll(nominal: Array, tilt: float) -> float:
    """Roll of the camera triad (rad), with the mount angle as read."""
    right, down, _ = camera_axes(unpacked(nominal).attitude, tilt)
    return math.atan2(right[2], down[2])


@compiled
def _stated(
    nominal: Array, bias: Array, sample: Array, earth_rate: Array, dt: float, covariance: Array, protection: float
) -> Array:
    """The numbers of `NavState` (24,).

    Position, velocity, attitude, Euler angles, body rates, side force, lateral and vertical protection level.  The
    rates are those relative to the ground: of the inertial unit's last sample, less bias and the Earth's rotation.  A
    protection level is so many standard deviations.
    """
    earth = rotate_back(unpacked(nominal).attitude, (earth_rate[0], earth_rate[1], earth_rate[2]))
    angles = euler(nominal)
    result = np.empty(24)
    result[:15] = nominal[:15]
    for i in range(3):
        result[15 + i] = angles[i]
        result[18 + i] = sample[i] / dt - bias[i] - earth[i]
    result[21] = sample[4] / dt - bias[4]
    result[22] = protection * math.sqrt(covariance[1, 1])
    result[23] = protection * math.sqrt(covariance[2, 2])
    return result
