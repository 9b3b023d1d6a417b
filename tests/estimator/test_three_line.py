"""The early solver.

=========================  ======================================================================================
noise-free                 10,000 random poses: position to 1e-10 of the range, angles to 1e-9 rad
noisy                      poselib's p3ll on 10,000: to 1e-6 m and 1e-9 rad on 98 %; elsewhere ours fits better
rotation                   Umeyama's by the singular value decomposition
position                   the paper's normal equations by a 3 × 3 solve; a single corner's, equal and unequal
infinity                   camera straight down; edges parallel in the image
degenerate                 invalid, NaN, no warning, neighbours untouched
=========================  ======================================================================================
"""

import math
import warnings
from collections.abc import Callable

import numpy as np
import poselib
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.typing import ArrayLike
from outside import (
    DEG,
    LENGTH,
    ODD,
    PAPER,
    WIDTH,
    ImageLines,
    Poses,
    camera_matrix,
    camera_rotation,
    cv_pixels,
    poses_of,
    random_poses,
    rotation_angle,
    runway_lines,
    scaled,
)

from estimator import three_line_pose
from estimator.camera import PinholeCamera
from estimator.pose import ThreeLinePose
from estimator.so3 import Array
from estimator.three_line import coplanarity_position, single_point_position

POSES = 10_000
GOOD = poses_of(np.array((-400.0, 5.0, -25.0)), 0.02, -0.05, 0.03)


def solved(camera: PinholeCamera, lines: ImageLines, width: ArrayLike = WIDTH) -> ThreeLinePose:
    return three_line_pose(camera, *lines, runway_width=width)


def unit_normals(camera: PinholeCamera, lines: ImageLines) -> Array:
    """(3, n, 3): of the planes of left edge, threshold and right edge, camera frame."""
    normals = np.stack(lines) @ camera_matrix(camera)
    return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def noisy(rng: np.random.Generator, lines: ImageLines, offset_px: float, angle: float) -> ImageLines:
    """The lines, each shifted across itself and turned about the middle of the image."""
    result = []
    for line in lines:
        phi = rng.normal(0.0, angle, line.shape[:-1])
        a, b, c = np.moveaxis(line, -1, 0)
        turned = (a * np.cos(phi) - b * np.sin(phi), a * np.sin(phi) + b * np.cos(phi))
        middle = a * 328.5 + b * 246.5 + c
        shift = rng.normal(0.0, offset_px, line.shape[:-1])
        result.append(np.stack((*turned, middle + shift - turned[0] * 328.5 - turned[1] * 246.5), axis=-1))
    return ImageLines(*result)


@pytest.mark.parametrize("camera", [PAPER, ODD])
def test_noise_free_lines_give_the_pose(camera: PinholeCamera) -> None:
    rng = default_rng(1)
    poses = random_poses(rng, POSES)
    result = solved(camera, scaled(rng, runway_lines(camera, poses)))
    assert result.valid.all()
    distance = np.linalg.norm(poses.position, axis=-1)
    assert (np.linalg.norm(result.position - poses.position, axis=-1) / distance).max() < 1e-10
    assert rotation_angle(result.R_cam_from_runway, poses.R).max() < 1e-9
    for name in ("yaw", "pitch", "roll"):
        assert np.abs(getattr(result, name) - getattr(poses, name)).max() < 1e-9, name


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e160, 1e300])
def test_the_scale_of_a_line_does_not_matter(scale: float) -> None:
    # scales whose squares underflow and overflow
    left, threshold, right = runway_lines(PAPER, GOOD)
    unlike = ImageLines(scale * left, -threshold, right)
    for lines in (unlike, ImageLines(*(np.stack((line, line)) for line in unlike))):
        result = solved(PAPER, lines)
        assert result.valid.all()
        assert np.abs(result.position - GOOD.position).max() < 1e-8


def test_lines_through_opencvs_pixels_give_the_pose() -> None:
    rng = default_rng(2)
    poses = random_poses(rng, 300, farthest=1500.0)
    corners = np.array(((0.0, -15.0, 0.0), (400.0, -15.0, 0.0), (0.0, 15.0, 0.0), (400.0, 15.0, 0.0)))
    for i in range(300):
        uv = np.hstack((cv_pixels(ODD, poses.R[i], poses.position[i], corners), np.ones((4, 1))))
        result = three_line_pose(
            ODD, np.cross(uv[0], uv[1]), np.cross(uv[0], uv[2]), np.cross(uv[2], uv[3]), runway_width=30.0
        )
        # pixels to 1e-10, over edges as short as a few pixels
        assert np.linalg.norm(result.position - poses.position[i]) < 1e-5 * np.linalg.norm(poses.position[i])
        assert rotation_angle(result.R_cam_from_runway, poses.R[i]) < 1e-6


def p3ll(normals: Array) -> tuple[Array, Array] | None:
    """Position and rotation of p3ll's physical solution: above the runway, which lies in front; None without one."""
    points = np.array(((0.0, -WIDTH / 2, 0.0), (0.0, 0.0, 0.0), (0.0, WIDTH / 2, 0.0)))
    directions = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    for pose in poselib.p3ll(normals, points, directions):
        R, t = np.asarray(pose.R), np.asarray(pose.t)
        position = -R.T @ t
        in_front = (R @ points.T + t[:, None])[2].min() > 0.0
        if position[2] < 0.0 and in_front and R[2, 0] > 0.0 and R[1, 2] > 0.0:
            return position, R
    return None


def line_residual(normals: Array, position: Array, R: Array) -> float:
    """Largest angle between the planes of the lines and those that a pose predicts, rad."""
    points = np.array(((0.0, -WIDTH / 2, 0.0), (0.0, 0.0, 0.0), (0.0, WIDTH / 2, 0.0)))
    directions = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    predicted = np.cross(points - position, directions) @ R.T
    predicted /= np.linalg.norm(predicted, axis=-1, keepdims=True)
    return float(np.linalg.norm(np.cross(normals, predicted), axis=-1).max())


def test_noisy_lines_give_poselibs_pose(record_property: Callable[[str, object], None]) -> None:
    rng = default_rng(3)
    poses = random_poses(rng, POSES)
    lines = noisy(rng, runway_lines(PAPER, poses), 0.3, 0.003)
    result = solved(PAPER, lines)
    # at 6 km, where the threshold is 6 px wide, the noise turns a few over and throws a few a thousand kilometres off
    near = np.linalg.norm(result.position, axis=-1) < 20_000.0
    valid = np.flatnonzero(result.valid & near)
    assert len(valid) > 0.95 * POSES
    normals = unit_normals(PAPER, lines)
    same, absent, better, worse = 0, 0, 0, 0
    for i in valid:
        theirs = p3ll(normals[:, i])
        if theirs is None:
            absent += 1
            continue
        position, R = result.position[i], result.R_cam_from_runway[i]
        if np.linalg.norm(position - theirs[0]) < 1e-6 and rotation_angle(R, theirs[1]) < 1e-9:
            same += 1
        elif line_residual(normals[:, i], position, R) < line_residual(normals[:, i], *theirs):
            better += 1
        else:
            worse += 1
    for name, count in (
        ("solved", len(valid)),
        ("same", same),
        ("ours fits better", better),
        ("p3ll has none", absent),
    ):
        record_property(name, count)
        print(f"{name}: {count}")
    assert same >= 0.98 * len(valid)
    assert worse == 0


def test_noisy_lines_are_reproduced() -> None:
    rng = default_rng(4)
    poses = random_poses(rng, 2000, farthest=2000.0)
    lines = noisy(rng, runway_lines(ODD, poses), 1.0, 0.005)
    result = solved(ODD, lines)
    normals = unit_normals(ODD, lines)
    for i in np.flatnonzero(result.valid):
        assert line_residual(normals[:, i], result.position[i], result.R_cam_from_runway[i]) < 1e-11


def umeyama(A: Array, B: Array) -> Array:
    """The rotation of least |A - R B|², U S Vᵀ of A Bᵀ, S = diag(1, 1, det U det V)."""
    U, _, Vt = np.linalg.svd(A @ np.swapaxes(B, -1, -2))
    S = np.zeros_like(U)
    S[..., 0, 0] = S[..., 1, 1] = 1.0
    S[..., 2, 2] = np.linalg.det(U) * np.linalg.det(Vt)
    return np.asarray(U @ S @ Vt)


def test_rotation_is_umeyamas() -> None:
    rng = default_rng(5)
    lines = noisy(rng, runway_lines(PAPER, random_poses(rng, 2000, farthest=1500.0)), 1.0, 0.005)
    result = solved(PAPER, lines)
    n1, n2, n3 = unit_normals(PAPER, lines)
    # by the paper: direction of the vanishing point, corners by their depths, all written out anew
    d = np.cross(n1, n3)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    d *= np.sign(d[:, 2:])
    r2, r3 = np.cross(n1, n2), np.cross(n3, n2)
    r2, r3 = (r / np.linalg.norm(r, axis=-1, keepdims=True) * np.sign(r[:, 2:]) for r in (r2, r3))
    s = (r2 * d).sum(-1, keepdims=True) / (r3 * d).sum(-1, keepdims=True)
    across = s * r3 - r2
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    A = np.stack((d, across), axis=-1)
    B = np.array(((1.0, 0.0), (0.0, 1.0), (0.0, 0.0)))
    expected = umeyama(A, np.broadcast_to(B, A.shape))
    assert result.valid.mean() > 0.99
    assert rotation_angle(result.R_cam_from_runway[result.valid], expected[result.valid]).max() < 1e-9
    assert np.linalg.det(result.R_cam_from_runway[result.valid]) == pytest.approx(1.0)


def by_normal_equations(normals: Array, R: Array) -> Array:
    """Camera position by the paper's T = [Σ (I - K_i)]⁻¹ Σ (K_i - I) R P_i, as it stands."""
    K = np.eye(3) - normals[..., :, None] * normals[..., None, :]
    M = np.eye(3) - K
    left, middle, right = ((0.0, y, 0.0) for y in (-WIDTH / 2, 0.0, WIDTH / 2))
    right_side = sum(-M[i] @ (R @ np.array(P))[..., None] for i, P in enumerate((left, middle, right)))
    T = np.linalg.solve(M.sum(axis=0), right_side)
    return np.asarray(-np.swapaxes(R, -1, -2) @ T)[..., 0]


def position_by(function: Callable[..., tuple[Array, Array, Array]], normals: Array, R: Array) -> Array:
    """Position (n, 3) by one of the estimator's two translations, from planes (3, n, 3) and rotations."""
    axes = np.moveaxis(R, -1, 0)
    components = [(v[..., 0], v[..., 1], v[..., 2]) for v in (*normals, *axes)]
    return np.stack(function(*components, WIDTH), axis=-1)


def test_position_is_that_of_the_papers_normal_equations() -> None:
    # within 500 m, where squaring the condition number still leaves ten digits; with R of the lines, and with R from
    # elsewhere
    rng = default_rng(6)
    poses = random_poses(rng, 2000, farthest=500.0)
    lines = noisy(rng, runway_lines(PAPER, poses), 0.5, 0.003)
    normals = unit_normals(PAPER, lines)
    result = solved(PAPER, lines)
    assert result.valid.all()
    expected = by_normal_equations(normals, result.R_cam_from_runway)
    assert np.abs(result.position - expected).max() < 1e-6
    elsewhere = position_by(coplanarity_position, normals, poses.R)
    assert np.abs(elsewhere - by_normal_equations(normals, poses.R)).max() < 1e-6
    assert np.abs(elsewhere - result.position).max() > 1.0


def test_one_corner_and_three_lines_differ_only_with_a_rotation_from_elsewhere() -> None:
    rng = default_rng(7)
    poses = random_poses(rng, 2000, farthest=1000.0)
    lines = noisy(rng, runway_lines(PAPER, poses), 0.5, 0.003)
    result = solved(PAPER, lines)
    distance = np.linalg.norm(poses.position, axis=-1)
    normals = unit_normals(PAPER, lines)
    for R, same in ((result.R_cam_from_runway, True), (poses.R, False)):
        lines_give = position_by(coplanarity_position, normals, R)
        corner_gives = position_by(single_point_position, normals, R)
        apart = np.linalg.norm(lines_give - corner_gives, axis=-1) / distance
        ok = result.valid
        assert (apart[ok].max() < 1e-9) if same else (np.median(apart[ok]) > 1e-4)


def test_vanishing_point_at_infinity() -> None:
    # straight down at various headings, where the edges are parallel in the image; and with the nose at right angles to
    # the edges
    headings = np.arange(-90.0, 91.0, 15.0) * DEG
    where = np.tile((-3.0, 2.0, -80.0), (len(headings), 1))
    down = Poses(where, camera_rotation(0.0, -np.pi / 2, -headings), headings, headings, headings)
    result = solved(PAPER, runway_lines(PAPER, down))
    upright = np.abs(headings) < 89.0 * DEG
    assert result.valid[upright].all()
    assert np.abs(result.position - where)[upright].max() < 1e-10 * 80.0
    assert rotation_angle(result.R_cam_from_runway, down.R)[upright].max() < 1e-9

    side = np.array((89.0, 89.999, 90.0 - 1e-9, -89.0, -90.0 + 1e-9)) * DEG
    across = poses_of(np.stack((np.full(5, 20.0), -90.0 * np.sign(side), np.full(5, -15.0)), axis=-1), side, -0.1, 0.05)
    result = solved(ODD, runway_lines(ODD, across))
    assert result.valid.all()
    assert np.abs(result.position - across.position).max() < 1e-10 * 90.0
    assert np.abs(result.yaw - side).max() < 1e-9


def degenerate() -> dict[str, ImageLines]:
    """Inputs without a physical solution."""
    left, threshold, right = runway_lines(PAPER, GOOD)
    nan, inf, zero = np.full(3, np.nan), np.array((1.0, np.inf, 0.0)), np.zeros(3)
    behind = runway_lines(PAPER, poses_of(np.array((-400.0, 5.0, -25.0)), np.pi, -0.05, 0.0))
    below = runway_lines(PAPER, poses_of(np.array((-400.0, 5.0, 25.0)), 0.0, 0.05, 0.0))
    return {
        "the same edge twice": ImageLines(left, threshold, left),
        "the same edge twice, scaled": ImageLines(left, threshold, -3.0 * left),
        "edges swapped": ImageLines(right, threshold, left),
        "threshold is an edge": ImageLines(left, left, right),
        "NaN": ImageLines(left, nan, right),
        "one NaN": ImageLines(left * (1.0, 1.0, np.nan), threshold, right),
        "infinity": ImageLines(left, threshold, inf),
        "zero line": ImageLines(zero, threshold, right),
        "all zero": ImageLines(zero, zero, zero),
        "runway behind": behind,
        "camera below": below,
        "line at infinity": ImageLines(left, np.array((0.0, 0.0, 1.0)), right),
        "three lines through one pixel": ImageLines(
            np.array((1.0, 0.0, -300.0)), np.array((0.0, 1.0, -200.0)), np.array((1.0, 1.0, -500.0))
        ),
    }


def assert_nothing(result: ThreeLinePose, at: tuple[int, ...] = ()) -> None:
    assert not result.valid[at]
    for name in ("position", "R_cam_from_runway", "yaw", "pitch", "roll"):
        assert np.isnan(getattr(result, name)[at]).all(), name


@pytest.mark.parametrize("name", degenerate())
def test_degenerate_input_is_not_valid(name: str) -> None:
    bad, good = degenerate()[name], runway_lines(PAPER, GOOD)
    alone = solved(PAPER, good)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_nothing(solved(PAPER, bad))
        batch = solved(PAPER, ImageLines(*(np.stack((g, b, g)) for g, b in zip(good, bad, strict=True))))
    assert_nothing(batch, (1,))
    for i in (0, 2):
        assert batch.valid[i]
        assert batch.position[i] == pytest.approx(alone.position, rel=1e-12)
        assert batch.R_cam_from_runway[i] == pytest.approx(alone.R_cam_from_runway, abs=1e-14)


def test_a_single_frame_and_a_batch_agree() -> None:
    rng = default_rng(8)
    lines = noisy(rng, scaled(rng, runway_lines(ODD, random_poses(rng, 500))), 0.0, 0.0)
    batch = solved(ODD, lines)
    for i in range(500):
        one = solved(ODD, ImageLines(*(line[i] for line in lines)))
        assert one.valid == batch.valid[i]
        distance = np.linalg.norm(batch.position[i])
        assert one.position == pytest.approx(batch.position[i], abs=1e-10 * float(distance))
        assert one.R_cam_from_runway == pytest.approx(batch.R_cam_from_runway[i], abs=1e-10)
        assert (one.yaw, one.pitch, one.roll) == pytest.approx((batch.yaw[i], batch.pitch[i], batch.roll[i]), abs=1e-9)
        assert (one.position.shape, one.R_cam_from_runway.shape, np.shape(one.yaw)) == ((3,), (3, 3), ())


def test_leading_axes_broadcast() -> None:
    lines = runway_lines(PAPER, GOOD)
    left = np.broadcast_to(lines.left, (4, 1, 3))
    threshold = np.broadcast_to(lines.threshold, (5, 3))
    result = three_line_pose(PAPER, left, threshold, lines.right, runway_width=np.linspace(20.0, 60.0, 5))
    assert (result.position.shape, result.R_cam_from_runway.shape, result.valid.shape) == (
        (4, 5, 3),
        (4, 5, 3, 3),
        (4, 5),
    )
    # every distance is in proportion to the width
    assert result.position[2, 4] == pytest.approx(2.0 * GOOD.position)
    assert result.position[0, 1] == pytest.approx(GOOD.position)
    assert solved(PAPER, lines, width=np.array([30.0, 45.0])).position[1] == pytest.approx(1.5 * GOOD.position)
    empty = three_line_pose(PAPER, np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3)), runway_width=30.0)
    assert empty.position.shape == (0, 3)


@pytest.mark.parametrize(
    ("left", "threshold", "right", "width", "message"),
    [
        (np.ones(2), np.ones(3), np.ones(3), 30.0, "left must have the shape"),
        (np.ones(3), np.ones((3, 4)), np.ones(3), 30.0, "threshold must have the shape"),
        (np.ones(3), np.ones(3), 1.0, 30.0, "right must have the shape"),
        (np.ones((2, 3)), np.ones((4, 3)), np.ones(3), 30.0, "broadcast"),
        (np.ones((2, 3)), np.ones(3), np.ones(3), np.ones(3), "broadcast"),
        (np.ones(3), np.ones(3), np.ones(3), 0.0, "runway_width must be"),
        (np.ones(3), np.ones(3), np.ones(3), -30.0, "runway_width must be"),
        (np.ones(3), np.ones(3), np.ones(3), math.nan, "runway_width must be"),
        (np.ones(3), np.ones(3), np.ones(3), math.inf, "runway_width must be"),
        (np.ones(3), np.ones(3), np.ones(3), [30.0, -1.0], "runway_width must be"),
    ],
)
def test_wrong_input(left: ArrayLike, threshold: ArrayLike, right: ArrayLike, width: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        three_line_pose(PAPER, left, threshold, right, runway_width=width)


@given(
    st.floats(-3000.0, -40.0),
    st.floats(-100.0, 100.0),
    st.floats(-300.0, -2.0),
    st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-1.0, 1.0)),
    st.floats(10.0, 80.0),
)
def test_round_trip(x: float, y: float, z: float, angles: tuple[float, float, float], width: float) -> None:
    pose = poses_of(np.array((x, y, z)), *angles)
    # the threshold in front, and high enough above the runway for the planes of the edges to differ
    corners = np.array(((0.0, -width / 2, 0.0), (0.0, width / 2, 0.0)))
    assume(((corners - pose.position) @ pose.R.T)[:, 2].min() > 1.0)
    result = solved(ODD, runway_lines(ODD, pose, width), width)
    assert result.valid
    assert result.position == pytest.approx(pose.position, abs=1e-9 * math.hypot(x, LENGTH))
    assert (result.yaw, result.pitch, result.roll) == pytest.approx(angles, abs=1e-8)
