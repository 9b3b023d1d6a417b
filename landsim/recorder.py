"""What the loop keeps of a flight, and the log's table made of it.

While the aircraft flies a row of numbers is appended a step; angles, errors and standard deviations are worked out
afterwards, for all rows at once.
"""

import contextlib
from typing import NamedTuple

import numpy as np

from estimator.camera import PinholeCamera
from estimator.fusion import InertialVisionFilter
from estimator.innovation import Mount, camera_sigma
from estimator.so3 import Array, Vec3
from estimator.strapdown import ACCEL_BIAS, GYRO_BIAS
from estimator.three_line import three_line_pose
from estimator.two_line import two_line_pose
from landsim.log import AXES, COLUMNS, ENDS, LINES, QUANTITIES
from landsim.navigation import FrameResult, Navigator
from landsim.sensors import Imu, View
from landsim.state import Command, LineReading, Phase
from landsim.truth import Truth
from landsim.units import DEG, DEG_PER_HOUR


class Body(NamedTuple):
    """Position, velocity and attitude of the body, a row each."""

    position: Array
    velocity: Array
    attitude: Array


class Recorder:
    """Takes a flight down.

    Parameters
    ----------
    camera : PinholeCamera
    width : float
        Of the runway, m.
    mount : Mount
        Of the camera.
    wheels : (3,) float
        Midpoint of the main wheels, body frame, m.
    """

    def __init__(self, camera: PinholeCamera, width: float, mount: Mount, wheels: Vec3) -> None:
        self._camera = camera
        self._width = width
        self._mount = mount
        self._wheels = wheels
        # flat, so that a long flight does not leave the garbage collector a hundred thousand objects to visit
        self._steps: list[float] = []
        self._count = 0
        self._frames: list[float] = []
        self._frame_rows: list[int] = []
        self._filter: list[float] = []
        self._filter_rows: list[int] = []
        self._covariance: list[Array] = []

    def step(
        self,
        truth: Truth,
        navigator: Navigator,
        command: Command,
        phase: Phase,
        pitot: float,
        tilt: float,
        reading: float,
    ) -> None:
        """Take down a step; the frame of the same step comes before it."""
        self._count += 1
        position, velocity, attitude = navigator.inertial
        self._steps += (
            truth.time, *truth.position, *truth.velocity, *truth.R_runway_from_body, truth.airspeed,
            truth.wow_nose, truth.wow_left, truth.wow_right,
            truth.elevator, truth.aileron, truth.rudder, truth.throttle,
            navigator.filter is not None, *position, *velocity, *attitude, navigator.stage,
            command.engaged, command.pitch, command.roll, command.airspeed, command.brake, command.steering,
            phase, pitot, tilt, reading,
        )  # fmt: skip

    def frame(self, view: View, result: FrameResult, running: InertialVisionFilter | None, imu: Imu) -> None:
        """Take down a camera frame."""
        left, threshold, right = view.true_ends
        frame, update = view.frame, result.update
        self._frames += (
            result.roll,
            update.degrees, update.nis, update.accepted,
            *(left or _NOTHING), *(threshold or _NOTHING), *(right or _NOTHING),
            *_seen(frame.left), *_seen(frame.threshold), *_seen(frame.right),
        )  # fmt: skip
        self._frame_rows.append(self._count)
        if running is not None:
            self._filter += (*running.gyro_bias, *running.accel_bias, *imu.errors())
            self._filter_rows.append(self._count)
            self._covariance.append(running.covariance)

    def table(self) -> dict[str, Array]:
        """The log: a column for each of `landsim.log.COLUMNS`."""
        log = {column.name: np.full(self._count, np.nan) for column in COLUMNS}
        if self._count == 0:
            return log
        columns = np.fromiter(self._steps, float, len(self._steps)).reshape(self._count, -1).T.copy()
        true = Body(columns[1:4].T, columns[4:7].T, columns[7:16].T.reshape(-1, 3, 3))
        ready = columns[24] > 0.0
        columns[25:40, ~ready] = np.nan
        fused = Body(columns[25:28].T, columns[28:31].T, columns[31:40].T.reshape(-1, 3, 3))
        tilt, reading = columns[49], columns[50]

        log["time_s"], log["phase"], log["stage"] = columns[0], columns[47], columns[40]
        _pose(log, "true", true, self._mount.lever, tilt)
        _pose(log, "fused", fused, self._mount.lever, reading)
        log["body_x_m"], log["body_y_m"], log["body_height_m"] = columns[1], columns[2], -columns[3]
        log["wheel_height_m"] = -columns[3] - true.attitude[:, 2, :] @ np.array(self._wheels)
        log["body_roll_deg"], log["body_pitch_deg"], log["body_yaw_deg"] = euler_deg(true.attitude)
        for i, axis in enumerate(AXES):
            log[f"true_velocity_{axis}_mps"] = columns[4 + i]
            log[f"fused_velocity_{axis}_mps"] = columns[28 + i]
        log["true_airspeed_mps"], log["pitot_airspeed_mps"] = columns[16], columns[48]
        log["wow_nose"], log["wow_left"], log["wow_right"] = columns[17:20]
        log["elevator_deg"], log["aileron_deg"], log["rudder_deg"] = columns[20:23] / DEG
        log["throttle"], log["brake"], log["steering"] = columns[23], columns[45], columns[46]
        log["tilt_deg"] = tilt / DEG
        engaged = columns[41] > 0.0
        log["command_pitch_deg"] = np.where(engaged, columns[42] / DEG, np.nan)
        log["command_roll_deg"] = np.where(engaged, columns[43] / DEG, np.nan)
        log["command_airspeed_mps"] = np.where(engaged, columns[44], np.nan)
        self._frame_columns(log)
        self._filter_columns(log, true, fused, reading)
        return log

    def _frame_columns(self, log: dict[str, Array]) -> None:
        """Columns that have a value at camera frames alone."""
        if not self._frame_rows:
            return
        at = np.array(self._frame_rows)
        values = np.fromiter(self._frames, float, len(self._frames)).reshape(at.size, -1).T
        measured = values[1] > 0.0
        values[1:4, ~measured] = np.nan
        names = ["nis_dof", "nis", "accepted"]
        names += [f"{line}_true_{end}" for line in LINES for end in ENDS]
        for name, column in zip(names, values[1:16], strict=True):
            log[name][at] = column
        lines = values[16:].reshape(3, 7, at.size)
        for line, ends in zip(LINES, lines[:, 3:], strict=True):
            for end, column in zip(ENDS, ends, strict=True):
                log[f"{line}_seen_{end}"][at] = column
        for quantity, column in zip(QUANTITIES, self._vision(lines[:, :3], values[0]), strict=True):
            log[f"vision_{quantity}"][at] = column

    def _vision(self, lines: Array, roll: Array) -> Array:
        """The poses (6, n) that each frame's lines (3, 3, n) give by themselves, late with the roll as predicted."""
        left, threshold, right = np.moveaxis(lines, 1, -1)
        early = three_line_pose(self._camera, left, threshold, right, runway_width=self._width)
        late = two_line_pose(self._camera, left, right, runway_width=self._width, roll=roll)
        x, y, z = early.position.T
        result = np.stack((x, y, -z, np.degrees(early.roll), np.degrees(early.pitch), np.degrees(early.yaw)))
        two = np.isnan(threshold[:, 0])
        nothing = np.full(two.size, np.nan)
        pair = (nothing, late.lateral, late.height, nothing, np.degrees(late.pitch), np.degrees(late.yaw))
        return np.where(two, np.stack(pair), result)

    def _filter_columns(self, log: dict[str, Array], true: Body, fused: Body, reading: Array) -> None:
        """The filter's sigmas, biases and normalised errors; sigmas and biases hold from frame to frame."""
        if not self._filter_rows:
            return
        at = np.array(self._filter_rows)
        covariance = np.array(self._covariance)
        values = np.array(self._filter).reshape(at.size, 12)
        bias, imu_error = values[:, :6], values[:, 6:]
        error = np.concatenate(
            (
                true.position[at] - fused.position[at],
                true.velocity[at] - fused.velocity[at],
                rotation_vector(true.attitude[at] @ np.swapaxes(fused.attitude[at], 1, 2)),
                imu_error - bias,
            ),
            axis=1,
        )
        log["nees9"][at], log["nees15"][at] = normalised_squares(error, covariance, 9)
        counts = np.diff(np.append(at, self._count))

        def held(name: str, values: Array) -> None:
            log[name][at[0] :] = np.repeat(values, counts)

        sigma = camera_sigma(covariance, fused.attitude[at], self._mount, reading[at])
        sigma[:, 3:] /= DEG
        for i, quantity in enumerate(QUANTITIES):
            held(f"sigma_{quantity}", sigma[:, i])
        deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        for i, axis in enumerate(AXES):
            held(f"sigma_velocity_{axis}_mps", deviation[:, 3 + i])
            held(f"true_gyro_bias_{axis}_deg_h", imu_error[:, i] / DEG_PER_HOUR)
            held(f"fused_gyro_bias_{axis}_deg_h", bias[:, i] / DEG_PER_HOUR)
            held(f"sigma_gyro_bias_{axis}_deg_h", deviation[:, GYRO_BIAS.start + i] / DEG_PER_HOUR)
            held(f"true_accel_bias_{axis}_mps2", imu_error[:, 3 + i])
            held(f"fused_accel_bias_{axis}_mps2", bias[:, 3 + i])
            held(f"sigma_accel_bias_{axis}_mps2", deviation[:, ACCEL_BIAS.start + i])


_NOTHING = (np.nan,) * 4
_NOT_SEEN = (np.nan,) * 7


def _seen(reading: LineReading | None) -> tuple[float, ...]:
    """A measured line and its ends."""
    return _NOT_SEEN if reading is None else (reading.a, reading.b, reading.c, *reading.ends)


def euler_deg(attitude: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and yaw (deg) of matrices (n, 3, 3) that take triad vectors to the runway frame."""
    a = attitude
    return (
        np.degrees(np.atan2(a[:, 2, 1], a[:, 2, 2])),
        np.degrees(np.atan2(-a[:, 2, 0], np.hypot(a[:, 0, 0], a[:, 1, 0]))),
        np.degrees(np.atan2(a[:, 1, 0], a[:, 0, 0])),
    )


def _pose(log: dict[str, Array], source: str, body: Body, lever: Vec3, tilt: Array) -> None:
    camera = body.position + body.attitude @ np.array(lever)
    s, c = np.sin(tilt)[:, None], np.cos(tilt)[:, None]
    forward, right, down = body.attitude[:, :, 0], body.attitude[:, :, 1], body.attitude[:, :, 2]
    triad = np.stack((c * forward + s * down, right, c * down - s * forward), axis=-1)
    values = (camera[:, 0], camera[:, 1], -camera[:, 2], *euler_deg(triad))
    for quantity, value in zip(QUANTITIES, values, strict=True):
        log[f"{source}_{quantity}"] = value


def rotation_vector(rotation: Array) -> Array:
    """Rotation vectors (n, 3), rad, of rotations (n, 3, 3) by less than half a turn."""
    skew = 0.5 * (rotation - np.swapaxes(rotation, 1, 2))
    vector = np.stack((skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]), axis=-1)
    sine = np.linalg.norm(vector, axis=1)
    angle = np.atan2(sine, 0.5 * (np.trace(rotation, axis1=1, axis2=2) - 1.0))
    scale = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 1e-12)
    return np.asarray(vector * scale[:, None])


def normalised_squares(error: Array, covariance: Array, leading: int) -> tuple[Array, Array]:
    """Errors squared over their covariance, eᵀ P⁻¹ e: of the leading ones, and of all.

    With P = L Lᵀ and L z = e it is the sum of z²; what leads in e leads in z.

    Parameters
    ----------
    error : (n, k) array
    covariance : (n, k, k) array
    leading : int

    Returns
    -------
    (n,), (n,) array
        NaN where a covariance is not positive definite.
    """
    # in units of the standard deviations: metres beside rad/s would cost ten digits
    with np.errstate(all="ignore"):
        deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        scaled = error / deviation
        correlation = covariance / (deviation[:, :, None] * deviation[:, None, :])
    factor = _cholesky(correlation)
    solved = np.empty_like(scaled)
    for i in range(scaled.shape[1]):
        known = (factor[:, i, :i] * solved[:, :i]).sum(axis=1)
        solved[:, i] = (scaled[:, i] - known) / factor[:, i, i]
    squares = np.cumsum(solved**2, axis=1)
    return squares[:, leading - 1], squares[:, -1]


def _cholesky(matrices: Array) -> Array:
    """Lower factors (n, k, k); NaN where a matrix has none."""
    try:
        return np.asarray(np.linalg.cholesky(matrices), dtype=float)
    except np.linalg.LinAlgError:
        result = np.full_like(matrices, np.nan)
        for i, matrix in enumerate(matrices):
            with contextlib.suppress(np.linalg.LinAlgError):
                result[i] = np.linalg.cholesky(matrix)
        return result
