"""A camera frame as a measurement of the filter's errors.

====================  ============================================================================================
y                     lines of a displaced truth, projected in the test: y = H δ to first order; signs by hand
H                     camera pose and roll by finite differences; the roll column by the paper's geometry
R                     sampling, with noise on lines and mount angle
sigma                 standard deviations of the camera's pose against sampling
====================  ============================================================================================
"""

import math

import numpy as np
import pytest
from numpy.random import default_rng
from outside import DEG, ODD, PAPER, WIDTH, ImageLines, Poses, camera_rotation, derivative, runway_lines
from scipy.spatial.transform import Rotation

from estimator.camera import PinholeCamera
from estimator.innovation import (
    Innovation,
    LineObservation,
    Lines,
    camera_from_state,
    camera_sigma,
    pose_innovation,
)
from estimator.mount import Mount, camera_axes, camera_position
from estimator.so3 import Array, Vec3, flat

LEVER = (1.2, 0.1, 0.3)
MOUNT = Mount(LEVER, 0.0)
LATERAL = 2
"""Row of the late innovation."""


class Body:
    """A true state of the body and what its camera sees, by scipy and the test's own projection."""

    def __init__(self, position: tuple[float, float, float], euler: tuple[float, float, float], tilt: float) -> None:
        self.position = np.array(position)
        self.R = Rotation.from_euler("ZYX", (euler[2], euler[1], euler[0])).as_matrix()  # roll, pitch, yaw
        self.tilt = tilt

    def displaced(self, error: Array) -> "Body":
        """The body with an error (15,) added: true is what is estimated and the error."""
        other = Body((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), self.tilt)
        other.position = self.position + error[:3]
        other.R = Rotation.from_rotvec(error[6:9]).as_matrix() @ self.R
        return other

    def camera(self, lever: Vec3 = LEVER, tilt_error: float = 0.0) -> Poses:
        # the optical axis, tilted down from the nose: a turn about the body's y axis, nose up being positive
        triad = self.R @ Rotation.from_euler("y", -(self.tilt + tilt_error)).as_matrix()
        R = np.stack((triad[:, 1], triad[:, 2], triad[:, 0]))
        yaw, pitch, roll = Rotation.from_matrix(triad).as_euler("ZYX")
        return Poses(self.position + self.R @ np.array(lever), R, yaw, pitch, roll)

    def where(self) -> Vec3:
        x, y, z = self.position.tolist()
        return x, y, z


EARLY = [
    Body((-500.0, 10.0, -35.0), (0.05, 0.02, 0.03), 3.0 * DEG),
    Body((-70.0, -3.0, -11.0), (-0.2, 0.04, -0.05), 3.0 * DEG),
]
LATE = [
    Body((50.0, 4.0, -6.0), (0.03, 0.05, -0.02), 10.0 * DEG),
    Body((400.0, -1.0, -1.0), (-0.01, 0.01, 0.01), 10.0 * DEG),
]


def observation(line: Array, at: tuple[float, float], offset: float, angle: float) -> LineObservation:
    """A line as the camera reports it, its points centred next to a pixel."""
    a, b, c = (line / math.hypot(line[0], line[1])).tolist()
    off = a * at[0] + b * at[1] + c
    return LineObservation(a, b, c, at[0] - off * a, at[1] - off * b, offset**2, angle**2)


PLACES = ((200.0, 300.0), (330.0, 250.0), (450.0, 330.0))
SIGMAS = ((0.3, 0.004), (0.5, 0.006), (0.2, 0.003))


def lines_of(camera: PinholeCamera, seen: ImageLines, early: bool) -> Lines:
    left, threshold, right = (
        observation(line, at, *sigma) for line, at, sigma in zip(seen, PLACES, SIGMAS, strict=True)
    )
    return Lines(left, threshold if early else None, right)


def innovation(camera: PinholeCamera, truth: Body, estimated: Body, early: bool, mount: Mount = MOUNT) -> Innovation:
    lines = lines_of(camera, runway_lines(camera, truth.camera(mount.lever)), early)
    result = pose_innovation(camera, WIDTH, mount, lines, estimated.where(), flat(estimated.R), estimated.tilt)
    assert result is not None
    return result


@pytest.mark.parametrize("body", EARLY + LATE)
def test_camera_on_the_body(body: Body) -> None:
    expected = body.camera()
    assert np.array(camera_axes(flat(body.R), body.tilt)) == pytest.approx(expected.R, abs=1e-14)
    assert camera_position(body.where(), flat(body.R), LEVER) == pytest.approx(expected.position, abs=1e-12)


@pytest.mark.parametrize("body", EARLY + LATE)
def test_camera_moves_with_the_state(body: Body) -> None:
    nominal = body.camera()

    def pose(error: Array) -> Array:
        moved = body.displaced(error).camera()
        return np.append(moved.position - nominal.position, Rotation.from_matrix(moved.R.T @ nominal.R).as_rotvec())

    expected = derivative(pose, np.zeros(15), 1e-4)
    assert camera_from_state(flat(body.R), LEVER) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("camera", [PAPER, ODD])
@pytest.mark.parametrize(
    ("body", "early"), [(EARLY[0], True), (EARLY[1], True), (EARLY[1], False), (LATE[0], False), (LATE[1], False)]
)
def test_innovation_is_the_error_through_h(camera: PinholeCamera, body: Body, early: bool) -> None:
    H = innovation(camera, body, body, early).H
    assert H.shape == ((6 if early else 4), 15)
    # a millionth of the distance, and a microradian
    step = np.repeat((1e-5, 1e-5, 1e-6, 1e-6, 1e-6), 3)
    by_difference = derivative(lambda e: innovation(camera, body.displaced(e), body, early).y, np.zeros(15), step)
    size = np.abs(by_difference).max(axis=1, keepdims=True)
    assert (np.abs(H - by_difference) / size).max() < 1e-5


@pytest.mark.parametrize("early", [True, False])
def test_signs(early: bool) -> None:
    here = EARLY[1]
    names = {"y": 1, "z": 2} if early else {"yaw": 0, "pitch": 1, "y": 2, "z": 3}
    error = np.zeros(15)
    error[1] = 0.2  # the truth is to the right
    assert innovation(PAPER, here.displaced(error), here, early).y[names["y"]] == pytest.approx(0.2, rel=0.02)
    error = np.zeros(15)
    error[2] = 0.1  # the truth is lower: z is down
    assert innovation(PAPER, here.displaced(error), here, early).y[names["z"]] == pytest.approx(0.1, rel=0.05)
    error = np.zeros(15)
    error[8] = 0.002  # the truth has its nose further right
    assert innovation(PAPER, here.displaced(error), here, early).y[5 if early else 0] == pytest.approx(0.002, rel=0.05)


def test_late_innovation_is_vision_less_prediction() -> None:
    level = Body((300.0, 0.0, -8.0), (0.0, 0.0, 0.0), 10.0 * DEG)
    mount = Mount((0.0, 0.0, 0.0), 0.0)
    for change, row, expected in (
        ((0.0, 0.15, 0.0, 0.0, 0.0, 0.0), 2, 0.15),
        ((0.0, 0.0, -0.1, 0.0, 0.0, 0.0), 3, -0.1),
        ((0.0, 0.0, 0.0, 0.0, 0.001, 0.0), 1, 0.001),
        ((0.0, 0.0, 0.0, 0.0, 0.0, -0.001), 0, -0.001),
    ):
        error = np.zeros(15)
        error[[0, 1, 2, 6, 7, 8]] = change
        y = innovation(PAPER, level.displaced(error), level, False, mount).y
        assert y[row] == pytest.approx(expected, rel=0.02)
        assert np.abs(np.delete(y, row)).max() < 0.03 * abs(expected)


@pytest.mark.parametrize("height", [9.6, 2.0])
def test_late_roll_column_is_the_papers(height: float) -> None:
    # a truth that rolls right by δ more than the filter holds: the filter's roll is too small, and the vision pose is
    # to the left by (h + L²/(4h)) δ; the camera level, so that the turn is about its axis
    body = Body((300.0, 0.0, -height), (0.0, 0.0, 0.0), 0.0)
    H = innovation(PAPER, body, body, False, Mount((0.0, 0.0, 0.0), 0.0)).H
    assert H[LATERAL, 6] == pytest.approx(-(height + WIDTH**2 / (4.0 * height)), rel=1e-6)
    assert np.abs(H[:, 0]).max() < 1e-9  # x is not seen
    assert H[LATERAL, 1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("body", "early", "tilt_sigma"),
    [
        (EARLY[0], True, 0.003),
        (EARLY[1], True, 0.003),
        (EARLY[1], False, 0.003),
        (LATE[0], False, 0.003),
        # nose far to the side, where a turn of the mount is in part a roll, and large
        (Body((50.0, 4.0, -6.0), (0.1, 0.05, 0.4), 10.0 * DEG), False, 0.03),
    ],
)
def test_covariance_by_sampling(body: Body, early: bool, tilt_sigma: float) -> None:
    # noise on each line, and on the mount angle as read; 6000 draws know a variance to 1.8 %
    draws, scale = 6000, 0.01
    rng = default_rng(1)
    mount = Mount(LEVER, tilt_sigma**2)
    clean = lines_of(ODD, runway_lines(ODD, body.camera()), early)
    attitude = flat(body.R)
    nominal = pose_innovation(ODD, WIDTH, mount, clean, body.where(), attitude, body.tilt)
    assert nominal is not None
    samples = []
    for e in scale * rng.standard_normal((draws, 7)):
        noisy: list[LineObservation | None] = []
        for i, seen in enumerate(clean):
            if seen is None:
                noisy.append(None)
                continue
            offset, angle = e[2 * i] * math.sqrt(seen.offset_variance), e[2 * i + 1] * math.sqrt(seen.angle_variance)
            a = seen.a * math.cos(angle) - seen.b * math.sin(angle)
            b = seen.a * math.sin(angle) + seen.b * math.cos(angle)
            u, v = seen.u - offset * a, seen.v - offset * b
            noisy.append(seen._replace(a=a, b=b, c=-(a * u + b * v), u=u, v=v))
        sample = pose_innovation(
            ODD, WIDTH, mount, Lines(*noisy), body.where(), attitude, body.tilt + e[6] * tilt_sigma
        )
        assert sample is not None
        samples.append(sample.y / scale)
    size = np.sqrt(np.diag(nominal.R))
    assert np.abs((np.cov(np.transpose(samples)) - nominal.R) / np.outer(size, size)).max() < 0.08
    # the mount angle has a share in this
    still = pose_innovation(ODD, WIDTH, MOUNT, clean, body.where(), attitude, body.tilt)
    assert still is not None
    assert (np.diag(nominal.R) / np.diag(still.R)).max() > 10.0


def test_the_sign_of_a_line_does_not_matter() -> None:
    body = EARLY[0].displaced(np.repeat((0.5, 0.0, 0.003, 0.0, 0.0), 3))
    clean = lines_of(PAPER, runway_lines(PAPER, body.camera()), True)
    turned = Lines(*(seen and seen._replace(a=-seen.a, b=-seen.b, c=-seen.c) for seen in clean))
    results = [
        pose_innovation(PAPER, WIDTH, MOUNT, lines, EARLY[0].where(), flat(EARLY[0].R), EARLY[0].tilt)
        for lines in (clean, turned)
    ]
    assert results[0] is not None
    assert results[1] is not None
    assert results[1].y == pytest.approx(results[0].y)


def test_what_is_missing() -> None:
    body = EARLY[1]
    left, threshold, right = lines_of(PAPER, runway_lines(PAPER, body.camera()), True)
    for lines in (Lines(None, threshold, right), Lines(left, threshold, None), Lines(None, None, None)):
        assert pose_innovation(PAPER, WIDTH, MOUNT, lines, body.where(), flat(body.R), body.tilt) is None
    # a prediction in the runway's plane sees no such lines
    flat_on = Body((-70.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
    for lines in (Lines(left, threshold, right), Lines(left, None, right)):
        mount = Mount((0.0, 0.0, 0.0), 0.0)
        assert pose_innovation(PAPER, WIDTH, mount, lines, flat_on.where(), flat(flat_on.R), 0.0) is None


def test_camera_sigma_by_sampling() -> None:
    rng = default_rng(2)
    bodies = (EARLY[0], LATE[0])
    roots = rng.normal(size=(2, 15, 15)) * np.repeat((0.5, 0.1, 0.004, 1e-4, 1e-3), 3)[:, None]
    covariance = roots @ np.swapaxes(roots, -1, -2)
    tilt = np.array([body.tilt for body in bodies])
    tilt_sigma = 0.005
    got = camera_sigma(covariance, np.stack([body.R for body in bodies]), Mount(LEVER, tilt_sigma**2), tilt)
    for k, body in enumerate(bodies):
        # 40,000 draws know a standard deviation to 0.35 %
        errors = 0.1 * rng.standard_normal((40_000, 15)) @ roots[k].T
        R = (Rotation.from_rotvec(errors[:, 6:9]) * Rotation.from_matrix(body.R)).as_matrix()
        position = body.position + errors[:, :3] + R @ np.array(LEVER)
        reading = 0.1 * tilt_sigma * rng.standard_normal((40_000, 1))
        triad = Rotation.from_matrix(R) * Rotation.from_euler("y", -(body.tilt + reading))
        angles = triad.as_euler("ZYX")[:, ::-1]
        sampled = 10.0 * np.std(np.hstack((position, angles)), axis=0)
        assert got[k] == pytest.approx(sampled, rel=0.02)


def test_camera_rotation_of_a_level_body_is_its_tilt() -> None:
    level = Body((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
    assert np.abs(level.camera().R - camera_rotation(0.0, -0.1, 0.0)).max() < 1e-15
