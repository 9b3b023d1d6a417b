"""Drives the estimator: from the inertial unit, the camera's lines and the pitot tube to the navigation state.

Raw vision poses come from the paper's solvers.  The filter starts from the first of them, and from then on takes three
lines whenever the threshold is in view and two when it is not.
"""

import math
from typing import NamedTuple

import numpy as np

from estimator.alignment import Alignment, Incidence
from estimator.camera import PinholeCamera
from estimator.compiled import compiled, rotate_back
from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.fusion import NO_UPDATE, Gates, InertialVisionFilter, Update
from estimator.innovation import Eye, Innovation, frame_innovation
from estimator.lines import unguarded_variances
from estimator.mount import Mount, body_from_camera, camera_axes
from estimator.so3 import IDENTITY, Array
from estimator.strapdown import ImuNoise, Inertial, Site, euler, unpacked
from estimator.three_line import three_line_pose
from landsim.config import MountConfig, NavigationConfig
from landsim.state import CameraFrame, ImuSample, NavState, Stage
from landsim.units import DEG

NAN = math.nan


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
        self.stage = Stage.NONE
        self.filter: InertialVisionFilter | None = None

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
        if self.filter is None:
            self._alignment.propagate(sample, self._dt)
        else:
            self._angles = self.filter.propagate(sample, self._dt)

    def observe(self, frame: CameraFrame) -> FrameResult:
        """Take in a camera frame."""
        self._angles = None  # as they will be known after the frame
        if self.filter is None:
            return self._align(_observed(frame.lines, self._noise_px), frame.tilt)
        self.filter.predict()
        lines, self._late, borrows = _without_threshold(frame.lines, self._noise_px, self._latch, self._late)
        roll = _camera_roll(self.filter.nominal, frame.tilt) if borrows else NAN
        update = self.filter.observe(lines, frame.tilt)
        if update.degrees > 0:
            self._rejected = 0 if update.accepted else self._rejected + 1
        self.stage = Stage.NONE if not update.accepted else Stage.EARLY if update.degrees == 6 else Stage.LATE
        return FrameResult(update, self.stage, roll, self._late)

    def _align(self, lines: Array, tilt: float) -> FrameResult:
        """One of the first frames: the filter starts when there are enough."""
        self.stage = Stage.NONE
        left, threshold, right = lines[:, :3]
        solution = three_line_pose(self._camera, left, threshold, right, runway_width=self._width)
        if not solution.valid:
            return FrameResult(NO_UPDATE, Stage.NONE, NAN, late=False)
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
            else:
                start = self._alignment.start(self.airspeed, pose, self._mount, self._imu)
                self.filter = InertialVisionFilter(
                    self._camera, self._width, self._mount, self._site, self._imu, self._gates, start
                )
        self.stage = Stage.EARLY
        return FrameResult(NO_UPDATE, Stage.EARLY, NAN, late=False)

    @property
    def diverged(self) -> str | None:
        """Why the filter is no longer to be believed, if it is not."""
        if self.filter is None:
            return None
        p = self.filter.covariance
        nominal = self.filter.nominal
        sigma2 = p.item(0, 0) + p.item(1, 1) + p.item(2, 2)
        x, y, z = nominal.item(0), nominal.item(1), nominal.item(2)
        if not math.isfinite(sigma2 + x + y + z):
            return "its numbers are not finite"
        if sigma2 > self._config.max_position_sigma_m**2:
            return f"its position sigma is {math.sqrt(sigma2):.1f} m"
        if self._rejected > self._config.max_rejected_frames:
            return f"it rejected {self._rejected} frames in succession"
        return None

    @property
    def covariance(self) -> Array | None:
        """Of the filter's errors (15, 15); None before it has started."""
        return None if self.filter is None else self.filter.covariance

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
        n = _known(self.nominal, bias, self._sample, self._earth_rate, self._dt).tolist()
        return NavState(
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
        )


_UNKNOWN = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), IDENTITY).numbers()
_NO_BIAS = np.zeros(6)


_variances = compiled(unguarded_variances)


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
def _camera_roll(nominal: Array, tilt: float) -> float:
    """Roll of the camera triad (rad), with the mount angle as read."""
    right, down, _ = camera_axes(unpacked(nominal).attitude, tilt)
    return math.atan2(right[2], down[2])


@compiled
def _known(nominal: Array, bias: Array, sample: Array, earth_rate: Array, dt: float) -> Array:
    """What `NavState` says of the motion (21,): position, velocity, attitude, Euler angles and body rates.

    The rates are those relative to the ground: of the inertial unit's last sample, less bias and the Earth's rotation.
    """
    earth = rotate_back(unpacked(nominal).attitude, (earth_rate[0], earth_rate[1], earth_rate[2]))
    angles = euler(nominal)
    result = np.empty(21)
    result[:15] = nominal[:15]
    for i in range(3):
        result[15 + i] = angles[i]
        result[18 + i] = sample[i] / dt - bias[i] - earth[i]
    return result
