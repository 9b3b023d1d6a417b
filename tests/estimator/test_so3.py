"""Rotations on tuples, against scipy, and the signs of the three angles against pixels worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import default_rng
from outside import PAPER
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.mount import camera_axes
from estimator.so3 import Mat3, Vec3

component = st.floats(-2.0, 2.0)
vectors = st.tuples(component, component, component)


def matrix(rotation: Rotation) -> Mat3:
    return so3.flat(rotation.as_matrix())


def test_products_are_numpys() -> None:
    rng = default_rng(1)
    a, b, v = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
    fa, fb, fv = so3.flat(a), so3.flat(b), (float(v[0]), float(v[1]), float(v[2]))
    assert so3.matmul(fa, fb) == pytest.approx((a @ b).ravel())
    assert so3.transpose(fa) == tuple(a.T.ravel())
    assert so3.rotate(fa, fv) == pytest.approx(a @ v)
    assert so3.rotate_back(fa, fv) == pytest.approx(a.T @ v)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 9.9e-5, 1.01e-4, 1e-3, 0.3, 1.5, 3.0, 3.1415])
def test_exp_and_log_are_scipys(angle: float) -> None:
    rng = default_rng(2)
    for _ in range(50):
        axis = rng.normal(size=3)
        x, y, z = (angle * axis / np.linalg.norm(axis)).tolist()
        expected = Rotation.from_rotvec((x, y, z)).as_matrix().ravel()
        assert so3.exp((x, y, z)) == pytest.approx(expected, abs=2e-15)
        # near half a turn the matrix itself holds the angle's sine to rounding only
        assert so3.log(so3.flat(expected)) == pytest.approx((x, y, z), rel=1e-9, abs=1e-15 if angle < 3.0 else 1e-10)


@pytest.mark.parametrize("angle", [0.0, 1e-10, 1e-6, 9.9e-5, 1.01e-4, 0.02, 2.5])
def test_log_between_is_scipys(angle: float) -> None:
    rng = default_rng(3)
    for a in Rotation.random(50, random_state=4):
        axis = rng.normal(size=3)
        vector = angle * axis / np.linalg.norm(axis)
        b = a * Rotation.from_rotvec(vector)
        # at 2.5 rad the logarithm's slope, angle / sin(angle), makes four of a rounding error of the product
        assert so3.log_between(matrix(a), matrix(b)) == pytest.approx(vector, abs=4e-15 if angle > 1.0 else 1e-15)


def test_euler_angles_are_scipys() -> None:
    rng = default_rng(5)
    for roll, pitch, yaw in rng.uniform(-1.0, 1.0, (500, 3)) * (np.pi, 1.5, np.pi):
        a = so3.from_euler(float(roll), float(pitch), float(yaw))
        assert a == pytest.approx(Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_matrix().ravel(), abs=1e-15)
        assert so3.to_euler(a) == pytest.approx((roll, pitch, yaw), abs=1e-13)


@given(vectors)
def test_exp_is_a_rotation_and_log_its_inverse(vector: Vec3) -> None:
    a = so3.exp(vector)
    assert so3.matmul(a, so3.transpose(a)) == pytest.approx(so3.IDENTITY, abs=1e-14)
    if math.hypot(*vector) < 3.1:
        assert so3.log(a) == pytest.approx(vector, abs=1e-12)


def pixel_of(point: Vec3, roll_deg: float = 0.0, pitch_deg: float = 0.0, yaw_deg: float = 0.0) -> tuple[float, float]:
    """Pixel, from the principal point, of a point seen from the origin by a camera along the body's axis."""
    rad = math.pi / 180.0
    attitude = so3.from_euler(roll_deg * rad, pitch_deg * rad, yaw_deg * rad)
    right, down, forward = camera_axes(attitude, 0.0)
    in_cam = [sum(a * p for a, p in zip(axis, point, strict=True)) for axis in (right, down, forward)]
    u, v = PAPER.project(in_cam)
    return float(u) - PAPER.cx, float(v) - PAPER.cy


AHEAD = (1000.0, 0.0, 0.0)
AHEAD_RIGHT = (1000.0, 100.0, 0.0)  # on the horizon, 100 m right at 1000 m: F 0.1 = 126.26 px right of the middle


def test_signs_seen_in_the_image() -> None:
    f = 12.5 / 0.0099
    # level: on the right half, on the middle row
    assert pixel_of(AHEAD_RIGHT) == pytest.approx((0.1 * f, 0.0))
    # nose up by 2°: what lies ahead sinks in the image, by F tan 2° = F 0.0349208
    assert pixel_of(AHEAD, pitch_deg=2.0) == pytest.approx((0.0, 0.0349207695 * f))
    # nose right by 2°: what lies ahead moves left
    assert pixel_of(AHEAD, yaw_deg=2.0) == pytest.approx((-0.0349207695 * f, 0.0))
    # right side down by 30°: the image turns to the left about its middle, so the right end of the horizon rises,
    # to (cos 30°, -sin 30°) of its distance
    assert pixel_of(AHEAD_RIGHT, roll_deg=30.0) == pytest.approx((0.1 * f * 0.8660254038, -0.1 * f * 0.5))


def test_tilt_points_the_camera_below_the_nose() -> None:
    # 10° down: what lies straight ahead of the body is above the middle by F tan 10° = F 0.1763270
    right, down, forward = camera_axes(so3.IDENTITY, 10.0 * math.pi / 180.0)
    assert forward == pytest.approx((0.9848077530, 0.0, 0.1736481777))
    assert down == pytest.approx((-0.1736481777, 0.0, 0.9848077530))
    assert right == (0.0, 1.0, 0.0)
