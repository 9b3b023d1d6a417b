"""The camera, against pixels worked out by hand, OpenCV and a dense sampling of segments.

=====================  ==========================================================================
projection             four poses by hand; 5000 by cv2.projectPoints to 1e-9 px
planes and lines       a plane holds the rays of its line's pixels; there and back
clip                   segments by hand; 600 random ones against a dense sampling
refusals               impossible cameras
=====================  ==========================================================================
"""

import math

import numpy as np
import pytest
from numpy.random import default_rng
from outside import DEG, LENGTH, ODD, PAPER, WIDTH, Poses, camera_rotation, cv_pixels, pixels, poses_of, visible

from estimator.camera import PinholeCamera
from estimator.so3 import Array, Vec3

F = 12.5 / 0.0099  # 1262.626 px


def seen(
    camera: PinholeCamera, R: Array, position: tuple[float, float, float], point: tuple[float, float, float]
) -> Array:
    return camera.project(R @ (np.array(point) - np.array(position)))


@pytest.mark.parametrize(
    ("triad", "position", "point", "u", "v"),
    [
        # level, 1000 m before the threshold, 60 m up: the left corner is 15 m left, 60 m down, 1000 m ahead
        #   u = 328.5 - F 15/1000 = 309.5606,  v = 246.5 + F 60/1000 = 322.2576
        ((0.0, 0.0, 0.0), (-1000.0, 0.0, -60.0), (0.0, -15.0, 0.0), 328.5 - F * 0.015, 246.5 + F * 0.06),
        # 3° nose down from the same place: the middle of the threshold lies atan(60/1000) = 3.4336° below the
        # horizon, so 0.4336° below the axis
        #   v = 246.5 + F tan(atan(0.06) - 3°) = 246.5 + F (0.06 - t)/(1 + 0.06 t), t = tan 3° = 0.0524078
        (
            (0.0, -3.0, 0.0),
            (-1000.0, 0.0, -60.0),
            (0.0, 0.0, 0.0),
            328.5,
            246.5 + F * (0.06 - 0.0524077793) / (1.0 + 0.06 * 0.0524077793),
        ),
        # nose 5° right, point straight ahead on the runway's horizon: it moves left by F tan 5° = F 0.0874886635
        ((5.0, 0.0, 0.0), (-100.0, 0.0, -10.0), (900.0, 0.0, -10.0), 328.5 - F * 0.0874886635, 246.5),
        # right side down by 90°: right of the camera is the runway's down, its down is the runway's left.  A point
        # 10 m to the right at 100 m is then up by F 0.1, and 20 m below is right by F 0.2
        ((0.0, 0.0, 90.0), (0.0, 0.0, -20.0), (100.0, 10.0, 0.0), 328.5 + F * 0.2, 246.5 - F * 0.1),
        # straight down from 50 m with the top of the image ahead: 4 m ahead is up by F 4/50, 3 m right is right
        ((0.0, -90.0, 0.0), (0.0, 0.0, -50.0), (4.0, 3.0, 0.0), 328.5 + F * 0.06, 246.5 - F * 0.08),
    ],
)
def test_pixels_by_hand(
    triad: tuple[float, float, float],
    position: tuple[float, float, float],
    point: tuple[float, float, float],
    u: float,
    v: float,
) -> None:
    yaw, pitch, roll = (angle * DEG for angle in triad)
    assert seen(PAPER, camera_rotation(yaw, pitch, roll), position, point) == pytest.approx((u, v), abs=1e-6)


def test_from_lens_is_the_papers_camera() -> None:
    # 12.5 mm over 9.9 µm = 1262.6 px; the middle of 658 pixels counted from 0 is 328.5
    camera = PinholeCamera.from_lens(12.5e-3, 9.9e-6, 658, 494)
    assert (camera.fx, camera.fy) == pytest.approx((1262.62626, 1262.62626), abs=1e-5)
    assert (camera.cx, camera.cy) == (328.5, 246.5)


@pytest.mark.parametrize("camera", [PAPER, ODD])
def test_projection_is_opencvs(camera: PinholeCamera) -> None:
    rng = default_rng(1)
    for _ in range(100):
        angles = rng.uniform(-1.0, 1.0, 3) * (np.pi, np.pi / 2, np.pi)
        R, position = camera_rotation(*angles), rng.normal(0.0, 300.0, 3)
        depth = 10.0 ** rng.uniform(0.0, 3.5, 50)
        in_cam = np.stack((*(rng.uniform(-0.5, 0.5, (2, 50)) * depth), depth), axis=-1)
        runway = in_cam @ R + position
        # carried to the runway frame and back: cv2 has its own rotation (Rodrigues) and sums in another order
        assert np.abs(camera.project((runway - position) @ R.T) - cv_pixels(camera, R, position, runway)).max() < 1e-9


def test_projection_of_what_is_not_in_front_is_nan() -> None:
    points = [[1.0, 2.0, -3.0], [1.0, 2.0, 0.0], [0.0, 0.0, 5.0], [math.nan, 0.0, 1.0]]
    result = ODD.project(points)
    assert np.isnan(result[:2]).all()
    assert result[2].tolist() == [310.0, 262.0]
    assert math.isnan(result[3, 0])


def test_plane_holds_the_rays_of_its_line() -> None:
    # the line through two pixels; their rays are ((u - 310)/1300, (v - 262)/1180, 1)
    a, b, c = np.cross((40.0, 400.0, 1.0), (600.0, 10.0, 1.0))
    normal = np.array(ODD.plane_normal(a, b, c))
    for u, v in ((40.0, 400.0), (600.0, 10.0)):
        ray = np.array(((u - 310.0) / 1300.0, (v - 262.0) / 1180.0, 1.0))
        assert normal @ ray / np.linalg.norm(normal) == pytest.approx(0.0, abs=1e-12)


def test_plane_and_line_are_inverse() -> None:
    lines = default_rng(2).normal(size=(3, 1000))
    back = ODD.line_of_plane(ODD.plane_normal(*lines))
    assert np.abs(np.array(back) - lines).max() < 1e-12


@pytest.mark.parametrize(
    ("start", "end", "expected"),
    [
        # f = 100, image 200 × 100 with the principal point at (100, 50): u from -0.5 to 199.5, v from -0.5 to 99.5
        # inside altogether
        ((-1.0, 0.0, 10.0), (1.0, 0.2, 10.0), (90.0, 50.0, 110.0, 52.0)),
        # both ends outside, left and right: cut where u = -0.5 and 199.5
        ((-20.0, 1.0, 10.0), (20.0, 1.0, 10.0), (-0.5, 60.0, 199.5, 60.0)),
        # leaves at the bottom: v = 99.5 at y = 4.95
        ((0.0, 0.0, 10.0), (0.0, 20.0, 10.0), (100.0, 50.0, 100.0, 99.5)),
        # enters at the top: v = -0.5 at y = -5.05
        ((0.0, -20.0, 10.0), (0.0, 0.0, 10.0), (100.0, -0.5, 100.0, 50.0)),
        # from behind the camera to far ahead, 0.2 m below the axis: the near plane at 1 m shows it at v = 70
        ((0.0, 0.2, -5.0), (0.0, 0.2, 100.0), (100.0, 70.0, 100.0, 50.2)),
        # and the other way round
        ((0.0, 0.2, 100.0), (0.0, 0.2, -5.0), (100.0, 50.2, 100.0, 70.0)),
        # behind, beside, above, a corner cut outside the image, and one that touches a side from outside
        ((0.0, 0.0, -1.0), (0.0, 1.0, -9.0), None),
        ((20.0, -1.0, 10.0), (30.0, 1.0, 10.0), None),
        ((-1.0, -20.0, 10.0), (1.0, -6.0, 10.0), None),
        ((9.0, 8.0, 10.0), (20.0, -5.0, 10.0), None),
        ((199.0, -1.0, 200.0), (300.0, -1.0, 200.0), None),
        # a point
        ((1.0, 1.0, 10.0), (1.0, 1.0, 10.0), (110.0, 60.0, 110.0, 60.0)),
    ],
)
def test_clip_by_hand(start: Vec3, end: Vec3, expected: tuple[float, ...] | None) -> None:
    camera = PinholeCamera(fx=100.0, fy=100.0, cx=100.0, cy=50.0, width=200, height=100)
    result = camera.clip(start, end, near=1.0)
    if expected is None:
        assert result is None
    else:
        assert result == pytest.approx(expected, abs=1e-9)


def clip_at(camera: PinholeCamera, pose: Poses, start: Array, end: Array) -> tuple[float, float, float, float] | None:
    a, b = (tuple((pose.R @ (p - pose.position)).tolist()) for p in (start, end))
    return camera.clip(a, b, near=1.0)


@pytest.mark.parametrize("camera", [PAPER, ODD])
def test_clip_against_a_dense_sampling(camera: PinholeCamera) -> None:
    rng = default_rng(3)
    kinds = {"none": 0, "whole": 0, "cut": 0}
    for _ in range(300):
        position = rng.uniform((-150.0, -40.0, -30.0), (150.0, 40.0, -1.0))
        angles = rng.uniform((-0.4, -0.4, -0.6), (0.4, 0.2, 0.6))
        pose = poses_of(position, *angles)
        corner, other = np.array((0.0, -WIDTH / 2, 0.0)), np.array((LENGTH, -WIDTH / 2, 0.0))
        start, end = ((corner, other), (other, corner), (corner, -corner))[rng.integers(3)]
        expected, result = visible(camera, pose, start, end), clip_at(camera, pose, start, end)
        if expected is None:
            kinds["none"] += 1
            assert result is None or math.hypot(result[2] - result[0], result[3] - result[1]) < 2.0
            continue
        assert result is not None
        got = np.array(result).reshape(2, 2)
        assert np.linalg.norm(got - expected.ends, axis=-1).max() < 1.01 * expected.step + 1e-6
        whole = all((pose.R @ (p - pose.position))[2] > 1.0 for p in (start, end)) and (
            np.abs(got - pixels(camera, pose, np.stack((start, end)))).max() < 1e-6
        )
        kinds["whole" if whole else "cut"] += 1
        if not whole:  # a cut end lies on a side of the image or on the near plane
            low, high = np.array((-0.5, -0.5)), np.array((camera.width, camera.height)) - 0.5
            assert (got > low - 1e-6).all()
            assert (got < high + 1e-6).all()
    assert min(kinds.values()) >= 15, kinds


@pytest.mark.parametrize("name", ["fx", "fy", "width", "height"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf])
def test_impossible_cameras(name: str, value: float) -> None:
    good = {"fx": 1000.0, "fy": 1000.0, "cx": 320.0, "cy": 240.0, "width": 640, "height": 480}
    with pytest.raises(ValueError, match=f"{name} must be finite and above zero"):
        PinholeCamera(**{**good, name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["cx", "cy"])
def test_principal_point_is_finite(name: str) -> None:
    good = {"fx": 1000.0, "fy": 1000.0, "cx": 320.0, "cy": 240.0, "width": 640, "height": 480}
    with pytest.raises(ValueError, match=f"{name} must be finite"):
        PinholeCamera(**{**good, name: math.nan})  # type: ignore[arg-type]


@pytest.mark.parametrize(("focal_length", "pixel"), [(0.0, 1e-5), (-0.01, 1e-5), (0.01, 0.0), (0.01, math.nan)])
def test_impossible_lenses(focal_length: float, pixel: float) -> None:
    with pytest.raises(ValueError, match="must be"):
        PinholeCamera.from_lens(focal_length, pixel, 640, 480)
