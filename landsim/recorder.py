"""What the loop keeps of a flight, and the log's table made of it.

While the aircraft flies numbers are copied and references kept; vision poses, angles, errors and standard deviations
are worked out afterwards, for all rows at once.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from estimator.camera import PinholeCamera
from estimator.compiled import compiled
from estimator.fusion import InertialVisionFilter
from estimator.innovation import camera_sigma
from estimator.mount import Mount, camera_triads, turned_triads
from estimator.single_lines import AUGMENTED
from estimator.so3 import Array, Vec3
from estimator.strapdown import ACCEL_BIAS, GYRO_BIAS, STATES
from estimator.three_line import three_line_pose
from estimator.two_line import two_line_pose
from landsim.log import AXES, CALIBRATION, COLUMNS, ENDS, LINES, QUANTITIES
from landsim.navigation import FrameResult, Known, Navigator
from landsim.plugins.guard import WITHOUT_BIASES, Belief, GuardedEstimator
from landsim.sensors import Imu, View
from landsim.state import Command, NavState, Phase, Stage
from landsim.truth import AFTER_MOTION, MOTION, NUMBERS, Truth
from landsim.units import DEG, DEG_PER_HOUR


class Body(NamedTuple):
    """Position, velocity and attitude of the body, a row each."""

    position: Array
    velocity: Array
    attitude: Array


FRAME = {
    "roll": 1, "late": 1, "nis_dof": 1, "nis": 1, "accepted": 1, "lines_found": 1, "lines_believed": 1,
}  # fmt: skip
"""The single numbers that `Recorder.frame` takes down, in its order."""


STATED = ("phase", "stage", "lateral_protection", "vertical_protection", "alarm")
"""What `Recorder.command` takes down after the command, in its order."""


def _columns(rows: int, numbers: Iterable[float]) -> Array:
    """Numbers row by row as an array of their columns (k, rows)."""
    return np.fromiter(numbers, float).reshape(rows, -1).T.copy()


BLOCK = 1024
"""Steps for which there is room at a time."""
STEP = {
    "motion": MOTION, **dict.fromkeys(AFTER_MOTION, 1), "nominal": MOTION, "pitot": 1, "tilt": 1, "reading": 1,
}  # fmt: skip
"""The numbers of a step, in their order."""
_WIDTH = sum(STEP.values())
_UNKNOWN = np.full(MOTION, np.nan)


@compiled
def _take_down(rows: Array, row: int, truth: Array, nominal: Array, pitot: float, tilt: float, reading: float) -> None:
    """Write a step's numbers to a row."""
    for i in range(NUMBERS):
        rows[row, i] = truth[i]
    for i in range(MOTION):
        rows[row, NUMBERS + i] = nominal[i]
    rows[row, NUMBERS + MOTION] = pitot
    rows[row, NUMBERS + MOTION + 1] = tilt
    rows[row, NUMBERS + MOTION + 2] = reading


def _transposed(blocks: Sequence[Array], rows: int) -> Array:
    """The first rows of blocks (BLOCK, k) one after the other, as columns (k, rows)."""
    result = np.empty((_WIDTH, rows))
    for i, block in enumerate(blocks):
        part = result[:, i * BLOCK : (i + 1) * BLOCK]
        part[:] = block[: part.shape[1]].T
    return result


def _stacked(arrays: Sequence[Array]) -> Array:
    """Arrays of one shape (...) as one, (n, ...), not to be written to."""
    joined = b"".join(arrays)  # type: ignore[arg-type]  # arrays are buffers, which only newer stubs know
    return np.frombuffer(joined).reshape(len(arrays), *arrays[0].shape)


def _body(motions: Array) -> Body:
    rows = motions.T.copy()
    return Body(rows[:, :3], rows[:, 3:6], rows[:, 6:15].reshape(-1, 3, 3))


def _named(rows: Array, widths: dict[str, int]) -> dict[str, Array]:
    """Rows of numbers by name: (n,) for a single one, (k, n) for k.

    Raises
    ------
    ValueError
        If there are not as many rows as the widths add up to.
    """
    if len(rows) != sum(widths.values()):
        raise ValueError(f"{len(rows)} numbers were taken down where {sum(widths.values())} are named")
    ends = np.cumsum(list(widths.values())).tolist()
    return {
        name: rows[end - 1] if width == 1 else rows[end - width : end]
        for (name, width), end in zip(widths.items(), ends, strict=True)
    }


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
    pan, roll : float
        By how much the camera is truly turned on its mount, about its own axis down and forward, rad.
    """

    def __init__(
        self, camera: PinholeCamera, width: float, mount: Mount, wheels: Vec3, pan: float = 0.0, roll: float = 0.0
    ) -> None:
        self._camera = camera
        self._width = width
        self._mount = mount
        self._wheels = wheels
        self._turned = pan, roll
        self._calibration: list[Array] = []
        self._calibration_rows: list[int] = []
        self._augmented: list[Array] = []
        self._blocks: list[Array] = []
        self._block = np.empty((0, _WIDTH))
        self._row = 0
        self._count = 0
        self._commands: list[float] = []
        self._command_rows: list[int] = []
        self._frames: list[float] = []
        self._frame_rows: list[int] = []
        self._update_rows: list[int] = []
        self._faults: list[int] = []
        self._lines: list[Array] = []
        self._true_ends: list[Array] = []
        self._seen_ends: list[Array] = []
        self._bias: list[Array] = []
        self._errors: list[Array] = []
        self._filter_rows: list[int] = []
        self._covariance: list[Array] = []

    def step(
        self, truth: Truth, navigator: Navigator | GuardedEstimator, pitot: float, tilt: float, reading: float
    ) -> None:
        """Take down a step; the frame of the same step comes before it, and a command before the first."""
        nominal = navigator.nominal if navigator.ready else _UNKNOWN  # a plug-in's may raise
        if self._row == len(self._block):
            self._block, self._row = np.empty((BLOCK, _WIDTH)), 0
            self._blocks.append(self._block)
        _take_down(self._block, self._row, truth.motion, nominal, pitot, tilt, reading)
        self._row += 1
        self._count += 1

    @property
    def row(self) -> int:
        """The row of the step that has not been taken down yet."""
        return self._count

    def frame(
        self,
        view: View,
        result: FrameResult,
        running: InertialVisionFilter | Known | Belief | None,
        imu: Imu,
        captured: int | None = None,
    ) -> None:
        """Take down a camera frame, and what navigation made of it.

        Parameters
        ----------
        captured : int, optional
            Row in which it was captured, if that is not this one.
        """
        update = result.update
        found, believed = result.lines()
        self._frames += (result.roll, result.late, update.degrees, update.nis, update.accepted, found, believed)
        self._lines.append(view.frame.lines)
        self._true_ends.append(view.true_ends)
        self._seen_ends.append(view.seen_ends)
        self._frame_rows.append(self._count if captured is None else captured)
        self._update_rows.append(self._count)
        self._faults.append(view.fault)
        if running is not None:
            self._bias.append(running.bias)
            self._errors.append(imu.errors())
            self._filter_rows.append(self._count)
            self._covariance.append(running.covariance)
            if isinstance(running, Known) and running.calibration_covariance is not None:
                self._calibration.append(running.calibration)
                self._augmented.append(running.calibration_covariance)
                self._calibration_rows.append(self._count)

    def command(self, command: Command, phase: Phase, stage: Stage, nav: NavState) -> None:
        """Take down what holds from this step to the next frame: the command, and what guidance was given for it."""
        self._commands += command
        self._commands += (phase, stage, nav.lateral_protection, nav.vertical_protection, nav.alarm)
        self._command_rows.append(self._count)

    def table(self) -> dict[str, Array]:
        """The log: a column for each of `landsim.log.COLUMNS`."""
        log = self._written() if self._count > 0 else {}
        return {
            column.name: log[column.name] if column.name in log else np.full(self._count, np.nan) for column in COLUMNS
        }

    def _written(self) -> dict[str, Array]:
        """Those columns for which there is something."""
        log: dict[str, Array] = {}
        self._drop_frame_without_step()
        step = _named(_transposed(self._blocks, self._count), STEP)
        true, fused = _body(step["motion"]), _body(step["nominal"])
        pitot, tilt, reading = step["pitot"], step["tilt"], step["reading"]
        commands = _columns(len(self._command_rows), self._commands)
        held = np.diff(np.append(self._command_rows, self._count))
        command = _named(np.repeat(commands, held, axis=1), dict.fromkeys((*Command._fields, *STATED), 1))

        log["time_s"] = step["time"]
        log["phase"], log["stage"], log["alarm"] = command["phase"], command["stage"], command["alarm"]
        log["lateral_protection_m"] = command["lateral_protection"]
        log["vertical_protection_m"] = command["vertical_protection"]
        _pose(log, "true", true, self._mount.lever, tilt, *self._turned)
        lower, pan, roll = self._misalignment()
        _pose(log, "fused", fused, self._mount.lever, reading + lower, pan, roll)
        x, y, z = true.position.T
        log["body_x_m"], log["body_y_m"], log["body_height_m"] = x, y, -z
        log["wheel_height_m"] = -z - true.attitude[:, 2, :] @ np.array(self._wheels)
        log["body_roll_deg"], log["body_pitch_deg"], log["body_yaw_deg"] = euler_deg(true.attitude)
        for i, axis in enumerate(AXES):
            log[f"true_velocity_{axis}_mps"] = true.velocity[:, i]
            log[f"fused_velocity_{axis}_mps"] = fused.velocity[:, i]
        for axis in AXES:
            log[f"wind_{axis}_mps"] = step[f"wind_{axis}"]
        log["true_airspeed_mps"], log["pitot_airspeed_mps"] = step["airspeed"], pitot
        for wheel in ("nose", "left", "right"):
            log[f"wow_{wheel}"] = step[f"wow_{wheel}"]
        for surface in ("elevator", "aileron", "rudder"):
            log[f"{surface}_deg"] = step[surface] / DEG
        log["throttle"], log["brake"], log["steering"] = step["throttle"], command["brake"], command["steering"]
        log["tilt_deg"], log["tilt_reading_deg"] = tilt / DEG, reading / DEG
        engaged, flying = command["engaged"] > 0.0, command["idle"] == 0.0
        log["command_pitch_deg"] = np.where(engaged, command["pitch"] / DEG, np.nan)
        log["command_roll_deg"] = np.where(engaged, command["roll"] / DEG, np.nan)
        log["command_airspeed_mps"] = np.where(engaged & flying, command["airspeed"], np.nan)
        self._frame_columns(log)
        self._filter_columns(log, true, fused, reading)
        return log

    def _drop_frame_without_step(self) -> None:
        """Leave out the last frame and its command if what came after it in the same step raised."""
        if self._command_rows and self._command_rows[-1] == self._count:
            del self._command_rows[-1]
            del self._commands[-len(Command._fields) - len(STATED) :]
        if self._update_rows and self._update_rows[-1] == self._count:
            del self._frames[-len(FRAME) :]
            images = self._lines, self._true_ends, self._seen_ends, self._faults
            for frames in (self._frame_rows, self._update_rows, *images):
                del frames[-1]
        if self._filter_rows and self._filter_rows[-1] == self._count:
            for frames in (self._filter_rows, self._bias, self._errors, self._covariance):
                del frames[-1]
        if self._calibration_rows and self._calibration_rows[-1] == self._count:
            for frames in (self._calibration_rows, self._calibration, self._augmented):
                del frames[-1]

    def _misalignment(self) -> Array:
        """Tilt, pan and roll (3, n) of the camera on its mount as estimated, rad; they hold from frame to frame."""
        result = np.zeros((3, self._count))
        if self._calibration:
            counts = np.diff(np.append(self._calibration_rows, self._count))
            result[:, self._calibration_rows[0] :] = np.repeat(_stacked(self._calibration)[:, :3].T, counts, axis=1)
        return result

    def _frame_columns(self, log: dict[str, Array]) -> None:
        """Columns that have a value at camera frames alone."""
        if not self._frame_rows:
            return
        at, update = np.array(self._frame_rows), np.array(self._update_rows)
        frame = _named(_columns(at.size, self._frames), FRAME)
        measured = frame["nis_dof"] > 0.0
        for name in ("nis_dof", "nis", "accepted"):
            log[name] = self._between(update[measured], frame[name][measured])
        log |= self._held(update, {name: frame[name] for name in ("lines_found", "lines_believed")})
        log["fault"] = self._between(at, self._faults)
        true_ends, seen_ends = _stacked(self._true_ends), _stacked(self._seen_ends)
        for i, line in enumerate(LINES):
            for k, end in enumerate(ENDS):
                log[f"{line}_true_{end}"] = self._between(at, true_ends[:, i, k])
                log[f"{line}_seen_{end}"] = self._between(at, seen_ends[:, i, k])
        lines = _stacked(self._lines)[:, :, :3].copy()
        lines[frame["late"] > 0.0, 1] = np.nan
        for quantity, column in zip(QUANTITIES, self._vision(lines, frame["roll"]), strict=True):
            log[f"vision_{quantity}"] = self._between(at, column)

    def _between(self, rows: Array, values: Array | Sequence[float]) -> Array:
        """A column that has these values in these rows, and NaN between them."""
        column = np.full(self._count, np.nan)
        column[rows] = values
        return column

    def _held(self, rows: Array, columns: dict[str, Array]) -> dict[str, Array]:
        """Columns whose values hold from these rows to the next of them; NaN before the first."""
        first = rows[0]
        source = np.repeat(np.arange(len(rows)), np.diff(np.append(rows, self._count)))
        result = {}
        for name, values in columns.items():
            column = result[name] = np.empty(self._count)
            column[:first] = np.nan
            np.take(values, source, out=column[first:])
        return result

    def _vision(self, lines: Array, roll: Array) -> Array:
        """The poses (6, n) that each frame's lines (n, 3, 3) give by themselves, late with the roll as predicted."""
        left, threshold, right = np.moveaxis(lines, 1, 0)
        early = three_line_pose(self._camera, left, threshold, right, runway_width=self._width)
        late = two_line_pose(self._camera, left, right, runway_width=self._width, roll=roll)
        x, y, z = early.position.T
        result = np.stack((x, y, -z, np.degrees(early.roll), np.degrees(early.pitch), np.degrees(early.yaw)))
        two = np.isnan(threshold[:, 0])
        nothing = np.full(two.size, np.nan)
        pair = (nothing, late.lateral, late.height, nothing, np.degrees(late.pitch), np.degrees(late.yaw))
        return np.where(two, np.stack(pair), result)

    def _calibration_columns(self, log: dict[str, Array]) -> None:
        """The camera's calibration as estimated; it holds from frame to frame."""
        estimate = _stacked(self._calibration)
        deviation = np.sqrt(np.diagonal(_stacked(self._augmented), axis1=1, axis2=2)[:, STATES:AUGMENTED])
        columns = {}
        for i, name in enumerate(CALIBRATION):
            unit = DEG if name.endswith("_deg") else 1.0
            columns[f"fused_{name}"] = estimate[:, i] / unit
            columns[f"sigma_{name}"] = deviation[:, i] / unit
        log |= self._held(np.array(self._calibration_rows), columns)

    def _filter_columns(self, log: dict[str, Array], true: Body, fused: Body, reading: Array) -> None:
        """The filter's sigmas, biases and normalised errors; sigmas and biases hold from frame to frame."""
        if not self._filter_rows:
            return
        at = np.array(self._filter_rows)
        covariance = _stacked(self._covariance)
        bias, imu_error = _stacked(self._bias), _stacked(self._errors)
        error = np.concatenate(
            (
                true.position[at] - fused.position[at],
                true.velocity[at] - fused.velocity[at],
                rotation_vector(true.attitude[at] @ np.swapaxes(fused.attitude[at], 1, 2)),
                imu_error - bias,
            ),
            axis=1,
        )
        without = bool(np.isnan(covariance[:, WITHOUT_BIASES:, WITHOUT_BIASES:]).all())
        if without:  # a plug-in's, which does not estimate biases
            k = WITHOUT_BIASES
            nine, _ = normalised_squares(error[:, :k], covariance[:, :k, :k], k)
        else:
            nine, fifteen = normalised_squares(error, covariance, WITHOUT_BIASES)
            log["nees15"] = self._between(at, fifteen)
        log["nees9"] = self._between(at, nine)
        known = np.nan_to_num(covariance) if without else covariance
        if self._augmented and len(self._augmented) == at.size:
            known = _stacked(self._augmented)
        sigma = camera_sigma(known, fused.attitude[at], self._mount, reading[at])
        sigma[:, 3:] /= DEG
        columns = {f"sigma_{quantity}": sigma[:, i] for i, quantity in enumerate(QUANTITIES)}
        deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        gyro, accel = imu_error[:, :3] / DEG_PER_HOUR, imu_error[:, 3:]
        for i, axis in enumerate(AXES):
            columns[f"sigma_velocity_{axis}_mps"] = deviation[:, 3 + i]
            columns[f"true_gyro_bias_{axis}_deg_h"] = gyro[:, i]
            columns[f"fused_gyro_bias_{axis}_deg_h"] = bias[:, i] / DEG_PER_HOUR
            columns[f"sigma_gyro_bias_{axis}_deg_h"] = deviation[:, GYRO_BIAS.start + i] / DEG_PER_HOUR
            columns[f"true_accel_bias_{axis}_mps2"] = accel[:, i]
            columns[f"fused_accel_bias_{axis}_mps2"] = bias[:, 3 + i]
            columns[f"sigma_accel_bias_{axis}_mps2"] = deviation[:, ACCEL_BIAS.start + i]
        log |= self._held(at, columns)
        if self._augmented:
            self._calibration_columns(log)


def euler_deg(attitude: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and yaw (deg) of matrices (n, 3, 3) that take triad vectors to the runway frame."""
    a = attitude
    return (
        np.degrees(np.atan2(a[:, 2, 1], a[:, 2, 2])),
        np.degrees(np.atan2(-a[:, 2, 0], np.hypot(a[:, 0, 0], a[:, 1, 0]))),
        np.degrees(np.atan2(a[:, 1, 0], a[:, 0, 0])),
    )


def _pose(
    log: dict[str, Array],
    source: str,
    body: Body,
    lever: Vec3,
    tilt: Array,
    pan: Array | float = 0.0,
    roll: Array | float = 0.0,
) -> None:
    camera = body.position + body.attitude @ np.array(lever)
    triad = camera_triads(body.attitude, tilt)
    if np.any(pan) or np.any(roll):
        triad = turned_triads(triad, pan, roll)
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


@compiled
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
    n, k = error.shape
    root, solved, deviation = np.zeros((k, k)), np.empty(k), np.empty(k)
    first, every = np.full(n, np.nan), np.full(n, np.nan)
    for row in range(n):
        P, total, partial = covariance[row], 0.0, 0.0
        for i in range(k):
            deviation[i] = np.sqrt(P[i, i])
            solved[i] = error[row, i] / deviation[i]
            for j in range(i + 1):
                # in units of the standard deviations: metres beside rad/s would cost ten digits
                rest = P[i, j] / (deviation[i] * deviation[j])
                for m in range(j):
                    rest -= root[i, m] * root[j, m]
                root[i, j] = rest / root[j, j] if j < i else np.sqrt(rest)
            for j in range(i):
                solved[i] -= root[i, j] * solved[j]
            solved[i] /= root[i, i]
            total += solved[i] * solved[i]
            if i == leading - 1:
                partial = total
        if np.isfinite(total):
            first[row], every[row] = partial, total
    return first, every
