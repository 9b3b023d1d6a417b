"""The late solver.

=========================  =======================================================================================
noise-free                 10,000 random poses with their roll
noisy                      a least-squares fit of the four numbers to the planes of both edges, by scipy
roll                       what an error of it does to the lateral position, against the paper's geometry
degenerate                 invalid, NaN, no warning, neighbours untouched
=========================  =======================================================================================
"""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.typing import ArrayLike
from outside import (
    DEG,
    ODD,
    PAPER,
    WIDTH,
    ImageLines,
    camera_matrix,
    camera_rotation,
    poses_of,
    random_poses,
    runway_lines,
    scaled,
)
from scipy.optimize import least_squares

from estimator import two_line_pose
from estimator.camera import PinholeCamera
from estimator.pose import TwoLinePose
from estimator.so3 import Array

NAMES = ("yaw", "pitch", "lateral", "height")
GOOD = poses_of(np.array((100.0, 3.0, -8.0)), 0.03, -0.15, 0.05)


def solved(camera: PinholeCamera, lines: ImageLines, roll: ArrayLike, width: ArrayLike = WIDTH) -> TwoLinePose:
    return two_line_pose(camera, lines.left, lines.right, runway_width=width, roll=roll)


@pytest.mark.parametrize("camera", [PAPER, ODD])
def test_noise_free_lines_give_the_pose(camera: PinholeCamera) -> None:
    rng = default_rng(1)
    far, near = random_poses(rng, 5000), random_poses(rng, 5000, nearest=5.0, farthest=100.0)
    for poses in (far, near):
        result = solved(camera, scaled(rng, runway_lines(camera, poses)), poses.roll)
        assert result.valid.all()
        distance = np.hypot(poses.position[:, 1], poses.position[:, 2])
        assert np.abs(result.yaw - poses.yaw).max() < 1e-9
        assert np.abs(result.pitch - poses.pitch).max() < 1e-9
        assert (np.abs(result.lateral - poses.position[:, 1]) / distance).max() < 1e-10
        assert (np.abs(result.height + poses.position[:, 2]) / distance).max() < 1e-10


def by_least_squares(camera: PinholeCamera, left: Array, right: Array, roll: float, guess: Array) -> Array:
    """Yaw, pitch, lateral and height that bring the planes of both edges onto those of the lines."""
    measured = np.stack((left, right)) @ camera_matrix(camera)
    measured /= np.linalg.norm(measured, axis=-1, keepdims=True)

    def off(x: Array) -> Array:
        R = camera_rotation(x[0], x[1], roll)
        camera_in_runway = np.array((0.0, x[2], -x[3]))
        corners = np.array(((0.0, -WIDTH / 2, 0.0), (0.0, WIDTH / 2, 0.0)))
        planes = np.cross(corners - camera_in_runway, (1.0, 0.0, 0.0)) @ R.T
        planes /= np.linalg.norm(planes, axis=-1, keepdims=True)
        return np.asarray(np.cross(measured, planes).ravel())

    fit = least_squares(off, guess, x_scale=(0.01, 0.01, 1.0, 1.0), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.asarray(fit.x)


def test_noisy_lines_give_the_least_squares_fit() -> None:
    rng = default_rng(2)
    n = 200
    position = np.stack((rng.uniform(-200, 1500, n), rng.uniform(-14, 14, n), -rng.uniform(1.0, 30.0, n)), axis=-1)
    poses = poses_of(position, *(rng.uniform(-w, w, n) for w in (0.15, 0.2, 0.3)))
    clean = runway_lines(ODD, poses)
    lines = ImageLines(*(line + rng.normal(0.0, 1.0, (n, 3)) * (1e-3, 1e-3, 1.0) for line in clean))
    roll = poses.roll + rng.normal(0.0, 0.01, n)
    result = solved(ODD, lines, roll)
    assert result.valid.all()
    for i in range(n):
        guess = np.array((poses.yaw[i], poses.pitch[i], position[i, 1], -position[i, 2]))
        expected = by_least_squares(ODD, lines.left[i], lines.right[i], float(roll[i]), guess)
        got = np.array([getattr(result, name)[i] for name in NAMES])
        assert got[:2] == pytest.approx(expected[:2], abs=1e-8)
        assert got[2:] == pytest.approx(expected[2:], abs=1e-6)


@pytest.mark.parametrize(("height", "per_fifth_degree"), [(9.6, 0.12), (2.0, 0.40)])
def test_roll_error_moves_the_lateral_position(height: float, per_fifth_degree: float) -> None:
    # on the centreline the edges are seen under ±atan(15/h).  Rolling the camera right side down by δ turns the picture
    # left; taken for no roll, the plane of the left edge is met lower and of the right edge higher, which is what a
    # camera further to the one side sees: (h + L²/(4h)) δ.  By hand at 9.6 m: (9.6 + 23.44) 0.00349 = 0.115 m; at 2 m:
    # (2 + 112.5) 0.00349 = 0.400 m
    delta = 0.2 * DEG
    expected = (height + WIDTH**2 / (4.0 * height)) * delta
    assert expected == pytest.approx(per_fifth_degree, abs=0.005)
    # tilted, the share of the turn that is about the vertical goes into the yaw
    for tilt in (0.0, 10.0 * DEG):
        pose = poses_of(np.array((300.0, 0.0, -height)), 0.0, -tilt, 0.0)
        result = solved(PAPER, runway_lines(PAPER, pose), delta)
        assert abs(float(result.lateral)) == pytest.approx(expected * math.cos(tilt), rel=0.02)
        # told a roll to the right that is not there, it puts itself to the right of where it is
        assert np.sign(result.lateral) == np.sign(side_of_a_roll_error(pose.R, height, delta))
        assert float(result.height) == pytest.approx(height, rel=0.02)


def side_of_a_roll_error(R: Array, height: float, delta: float) -> float:
    """Lateral position, by an independent fit, of a camera whose roll is said to be `delta` too far right."""
    pose = poses_of(np.array((300.0, 0.0, -height)), 0.0, math.asin(-R[2, 2]), 0.0)
    left, _, right = runway_lines(PAPER, pose)
    start = np.array((0.0, float(pose.pitch), 0.0, height))
    return float(by_least_squares(PAPER, left, right, delta, start)[2])


def degenerate() -> dict[str, tuple[Array, Array, float]]:
    left, _, right = runway_lines(PAPER, GOOD)
    nan, zero = np.full(3, np.nan), np.zeros(3)
    behind = runway_lines(PAPER, poses_of(np.array((100.0, 3.0, -8.0)), np.pi, -0.1, 0.0))
    return {
        "the same edge twice": (left, left, 0.05),
        "scaled": (left, -2.0 * left, 0.05),
        "edges swapped": (right, left, 0.05),
        "NaN line": (nan, right, 0.05),
        "infinite line": (left, np.array((1.0, np.inf, 0.0)), 0.05),
        "zero line": (zero, right, 0.05),
        "NaN roll": (left, right, math.nan),
        "infinite roll": (left, right, math.inf),
        "runway behind": (behind.left, behind.right, 0.0),
        "line at infinity": (np.array((0.0, 0.0, 1.0)), np.array((0.0, 0.0, 2.0)), 0.0),
    }


@pytest.mark.parametrize("name", degenerate())
def test_degenerate_input_is_not_valid(name: str) -> None:
    bad_left, bad_right, bad_roll = degenerate()[name]
    left, _, right = runway_lines(PAPER, GOOD)
    roll = float(GOOD.roll)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = two_line_pose(PAPER, bad_left, bad_right, runway_width=30.0, roll=bad_roll)
        batch = two_line_pose(
            PAPER,
            np.stack((left, bad_left, left)),
            np.stack((right, bad_right, right)),
            runway_width=30.0,
            roll=np.array((roll, bad_roll, roll)),
        )
    assert not one.valid
    assert batch.valid.tolist() == [True, False, True]
    truth = (GOOD.yaw, GOOD.pitch, GOOD.position[1], -GOOD.position[2])
    for field, expected in zip(NAMES, truth, strict=True):
        assert math.isnan(getattr(one, field))
        assert math.isnan(getattr(batch, field)[1])
        assert getattr(batch, field)[[0, 2]] == pytest.approx(np.full(2, expected), rel=1e-9)


def test_a_single_frame_and_a_batch_agree() -> None:
    rng = default_rng(3)
    poses = random_poses(rng, 300, nearest=10.0, farthest=2000.0)
    lines = scaled(rng, runway_lines(ODD, poses))
    batch = solved(ODD, lines, poses.roll)
    for i in range(300):
        one = solved(ODD, ImageLines(*(line[i] for line in lines)), float(poses.roll[i]))
        assert one.valid
        assert np.shape(one.lateral) == ()
        for name in NAMES:
            assert getattr(one, name) == pytest.approx(getattr(batch, name)[i], rel=1e-9, abs=1e-10)


def test_leading_axes_broadcast() -> None:
    left, _, right = runway_lines(PAPER, GOOD)
    result = two_line_pose(
        PAPER, np.broadcast_to(left, (4, 1, 3)), right, runway_width=np.array((30.0, 45.0)), roll=float(GOOD.roll)
    )
    assert result.lateral.shape == result.yaw.shape == result.valid.shape == (4, 2)
    assert result.lateral[3] == pytest.approx(np.array((3.0, 4.5)))
    assert result.height[0] == pytest.approx(np.array((8.0, 12.0)))
    rolls = two_line_pose(PAPER, left, right, runway_width=30.0, roll=np.array((0.0, float(GOOD.roll))))
    assert rolls.height[1] == pytest.approx(8.0)
    assert rolls.height.shape == rolls.yaw.shape == (2,)


@pytest.mark.parametrize(
    ("left", "right", "width", "roll", "message"),
    [
        (np.ones(2), np.ones(3), 30.0, 0.0, "left must have the shape"),
        (np.ones(3), np.ones((3, 1)), 30.0, 0.0, "right must have the shape"),
        (np.ones((2, 3)), np.ones((3, 3)), 30.0, 0.0, "broadcast"),
        (np.ones((2, 3)), np.ones((2, 3)), 30.0, np.zeros(3), "broadcast"),
        (np.ones(3), np.ones(3), 0.0, 0.0, "runway_width must be"),
        (np.ones(3), np.ones(3), math.nan, 0.0, "runway_width must be"),
    ],
)
def test_wrong_input(left: ArrayLike, right: ArrayLike, width: float, roll: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        two_line_pose(PAPER, left, right, runway_width=width, roll=roll)


@given(
    st.floats(-60.0, 60.0),
    st.floats(-200.0, -0.5),
    st.tuples(st.floats(-1.4, 1.4), st.floats(-1.3, 1.3), st.floats(-1.5, 1.5)),
    st.floats(10.0, 80.0),
)
def test_round_trip(y: float, z: float, angles: tuple[float, float, float], width: float) -> None:
    pose = poses_of(np.array((50.0, y, z)), *angles)
    result = solved(ODD, runway_lines(ODD, pose, width), angles[2], width)
    assert result.valid
    assert (result.yaw, result.pitch) == pytest.approx(angles[:2], abs=1e-8)
    assert (result.lateral, result.height) == pytest.approx((y, -z), abs=1e-8 * math.hypot(y, z, width))
