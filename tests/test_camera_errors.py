"""The camera's errors against the outside: OpenCV's projection, hand computation, statistics of what was asked for.

====================  ============================================================================================
calibration           ends and fitted lines by cv2.projectPoints; each sign by hand
faults                a line that is missing, or elsewhere on the ground, in its window alone
lost frames           the stated share, by the binomial distribution; those that remain are as they were
fog                   what is seen ends at the visibility; noise grows as the contrast falls, and the reading says so
blur                  by finite differences of the projection of a body that moves and turns
latency               from a frame's capture to what is made of it, in flight
====================  ============================================================================================
"""

import math
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.random import default_rng
from scipy.spatial.transform import Rotation
from scipy.stats import binom
from test_sensors import LEVER, RUNWAY, F, truth_at

from estimator.lines import fit_variances
from estimator.so3 import Array, Vec3, flat
from landsim.camera_errors import ImperfectCamera, fault_of, is_perfect, line_camera
from landsim.config import CameraConfig, FaultConfig, load_scenario
from landsim.sensors import LineCamera
from landsim.simulate import fly
from landsim.truth import Truth

TRUTH = truth_at((-600.0, 7.0, -35.0), (2.0, -1.0, 5.0))
TILT = math.radians(3.0)
LEFT, THRESHOLD, RIGHT = (
    ((0.0, -15.0, 0.0), (2000.0, -15.0, 0.0)),
    ((0.0, -15.0, 0.0), (0.0, 15.0, 0.0)),
    ((0.0, 15.0, 0.0), (2000.0, 15.0, 0.0)),
)
CENTRE = (328.5, 246.5)


def camera(fault: dict[str, Any] | None = None, seed: int = 0, **changes: Any) -> ImperfectCamera:
    config = CameraConfig.model_validate({"noise_px": 0.0, **changes})
    faults = FaultConfig.model_validate(fault or {})
    return ImperfectCamera(
        config, faults, LEVER, RUNWAY, default_rng(seed), default_rng(seed + 1000), max(config.noise_px, 0.05)
    )


def level(before: float, height: float, **changes: Any) -> Truth:
    """Level on the centreline, with the projection centre so far before the threshold and so high."""
    return truth_at((-before - LEVER[0], 0.0, -height - LEVER[2]), **changes)


def pixels(truth: Truth, points: Any, tilt: float = TILT, **errors: float) -> Array:
    """Points (n, 3) of the runway frame by cv2.projectPoints (n, 2), with rotations built by scipy."""
    R_runway_from_body = np.array(truth.R_runway_from_body).reshape(3, 3)
    R_triad_from_cam = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    # pan turns the camera about its axis down, roll about the one forward: y and z
    turned = Rotation.from_rotvec(
        np.radians((0.0, errors.get("pan_error_deg", 0.0), errors.get("roll_error_deg", 0.0)))
    ).as_matrix()
    R_runway_from_cam = R_runway_from_body @ Rotation.from_euler("y", -tilt).as_matrix() @ R_triad_from_cam @ turned
    centre = np.array(truth.position) + R_runway_from_body @ np.array(LEVER)
    f = F * (1.0 + errors.get("focal_length_error", 0.0))
    cx = CENTRE[0] + errors.get("principal_u_error_px", 0.0)
    cy = CENTRE[1] + errors.get("principal_v_error_px", 0.0)
    matrix = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
    distortion = np.array((errors.get("radial_distortion", 0.0), 0.0, 0.0, 0.0))
    rotation = cv2.Rodrigues(R_runway_from_cam.T)[0]
    seen, _ = cv2.projectPoints(np.array(points), rotation, -R_runway_from_cam.T @ centre, matrix, distortion)
    return np.asarray(seen, float).reshape(-1, 2)


def fitted(points: Array) -> tuple[Array, Array]:
    """Total least squares by numpy: (a, b, c) with a² + b² = 1, and the centroid."""
    centroid = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centroid)
    return np.append(axes[1], -axes[1] @ centroid), centroid


ERRORS: list[dict[str, Any]] = [
    {},
    {"focal_length_error": 0.02},
    {"pan_error_deg": 0.7},
    {"roll_error_deg": -1.2},
    {"principal_u_error_px": 5.0, "principal_v_error_px": -8.0},
    {"radial_distortion": 0.3},
    {
        "focal_length_error": -0.01,
        "pan_error_deg": -0.4,
        "roll_error_deg": 0.8,
        "principal_u_error_px": -3.0,
        "principal_v_error_px": 4.0,
        "radial_distortion": -0.2,
    },
]


@pytest.mark.parametrize("errors", ERRORS, ids=lambda errors: "+".join(errors) or "none")
def test_lines_are_those_of_opencv(errors: dict[str, Any]) -> None:
    view = camera(**errors).view(TRUTH, TILT, 0.05, (0.0, 0.0, 0.0))
    assert view.frame.tilt == 0.05
    for row, segment in enumerate((LEFT, THRESHOLD, RIGHT)):
        np.testing.assert_allclose(view.true_ends[row], pixels(TRUTH, segment, **errors).ravel(), atol=1e-6)
        # a point a pixel of what there would be without distortion: evenly spread in the image, each on its own ray
        ends = pixels(TRUTH, segment, **(errors | {"radial_distortion": 0.0}))
        number = math.floor(np.linalg.norm(ends[1] - ends[0])) + 1
        share = np.linspace(0.0, 1.0, number)[:, None]
        f = F * (1.0 + errors.get("focal_length_error", 0.0))
        off = errors.get("principal_u_error_px", 0.0), errors.get("principal_v_error_px", 0.0)
        c = np.add(CENTRE, off)
        rays = np.append((ends[0] + share * (ends[1] - ends[0]) - c) / f, np.ones((number, 1)), axis=1)
        kappa = errors.get("radial_distortion", 0.0)
        matrix = np.array([[f, 0.0, c[0]], [0.0, f, c[1]], [0.0, 0.0, 1.0]])
        points, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, np.array((kappa, 0.0, 0.0, 0.0)))
        line, centroid = fitted(np.asarray(points, float).reshape(-1, 2))
        reading = view.frame.reading(row)
        assert reading is not None
        sign = math.copysign(1.0, reading.a * line[0] + reading.b * line[1])
        np.testing.assert_allclose(reading[:3], sign * line, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(reading[3:5], centroid, atol=1e-6)
        assert reading.points == pytest.approx(number, rel=0.01)  # less what the clearest air takes
        bent = np.abs(np.append(np.asarray(points, float).reshape(-1, 2), np.ones((number, 1)), axis=1) @ line).max()
        assert (bent > 1e-6) == (kappa != 0.0)


THRESHOLD_PX = np.array(((-0.15 * F, 0.1 * F), (0.15 * F, 0.1 * F)))
"""Of a level camera 100 m before the threshold and 10 m up, from the principal point."""


def threshold_of(**errors: Any) -> Array:
    view = camera(**errors).view(level(100.0, 10.0), 0.0, 0.0, (0.0, 0.0, 0.0))
    ends: Array = view.true_ends[1].reshape(2, 2) - np.array(CENTRE)
    return ends


def test_pan_to_the_right_moves_the_image_left() -> None:
    """100 m ahead become 100 m cos p ahead and 100 m sin p to the left; 10 m down stay."""
    p = math.radians(2.0)
    middle = np.array((-math.tan(p) * F, 0.1 / math.cos(p) * F))
    left, right = threshold_of(pan_error_deg=2.0)
    assert left[0] < THRESHOLD_PX[0, 0] - 40.0
    assert right[0] < THRESHOLD_PX[1, 0] - 40.0
    line, _ = fitted(np.array((left, right)))
    assert line[:2] @ middle + line[2] == pytest.approx(0.0, abs=1e-9)
    # the left end: 15 m to the left of the middle, seen from an axis that has turned by p
    ahead, aside = 100.0 * math.cos(p) - 15.0 * math.sin(p), -100.0 * math.sin(p) - 15.0 * math.cos(p)
    np.testing.assert_allclose(left, (aside / ahead * F, 10.0 / ahead * F), atol=1e-9)


def test_right_side_down_turns_the_image_anticlockwise() -> None:
    r = math.radians(3.0)
    left, right = threshold_of(roll_error_deg=3.0)
    assert right[1] < left[1] - 15.0, "the right end goes up, v falls"
    turn = np.array(((math.cos(r), math.sin(r)), (-math.sin(r), math.cos(r))))
    np.testing.assert_allclose((left, right), THRESHOLD_PX @ turn.T, atol=1e-9)


def test_longer_lens_shifted_and_distorting_by_hand() -> None:
    np.testing.assert_allclose(threshold_of(focal_length_error=0.03), 1.03 * THRESHOLD_PX, atol=1e-9)
    shifted = threshold_of(principal_u_error_px=6.0, principal_v_error_px=-2.0)
    np.testing.assert_allclose(shifted, np.add(THRESHOLD_PX, (6.0, -2.0)), atol=1e-9)
    outwards = 1.0 + 0.2 * (0.15**2 + 0.1**2)
    np.testing.assert_allclose(threshold_of(radial_distortion=0.2), outwards * THRESHOLD_PX, atol=1e-9)


def test_without_errors_it_is_the_plain_camera() -> None:
    plain = LineCamera(CameraConfig(noise_px=0.0), LEVER, RUNWAY, default_rng(0)).view(TRUTH, TILT, TILT)
    view = camera().view(TRUTH, TILT, TILT, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(view.true_ends, plain.true_ends, rtol=1e-12)
    np.testing.assert_allclose(view.seen_ends, plain.seen_ends, rtol=1e-9)
    # less what 600 m of the clearest air take: exp(-6 × 600 m / 1000 km)
    np.testing.assert_allclose(view.frame.lines, plain.frame.lines, rtol=0.02)
    np.testing.assert_allclose(view.frame.lines[:, :5], plain.frame.lines[:, :5], rtol=1e-9)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"pan_error_deg": 0.1}, {}),
        ({"roll_error_deg": -0.1}, {}),
        ({"principal_u_error_px": 1.0}, {}),
        ({"principal_v_error_px": -1.0}, {}),
        ({"radial_distortion": 0.01}, {}),
        ({"dropped_share": 0.1}, {}),
        ({"exposure_s": 0.01}, {}),
        ({"visibility_m": 2000.0}, {}),
        ({}, {"kind": "missing"}),
        ({}, {"kind": "wrong"}),
    ],
)
def test_each_error_takes_the_other_camera(changes: dict[str, Any], fault: dict[str, Any]) -> None:
    config, faults = CameraConfig.model_validate(changes), FaultConfig.model_validate(fault)
    assert not is_perfect(config, faults)
    made = line_camera(config, faults, LEVER, RUNWAY, default_rng(0), default_rng(1), 1.0)
    assert isinstance(made, ImperfectCamera)


def test_what_the_plain_camera_and_the_loop_do_themselves_is_no_error_here() -> None:
    config = CameraConfig.model_validate(
        {
            "focal_length_error": 0.01,
            "tilt_error_deg": 0.2,
            "noise_factor": 2.0,
            "latency_s": 0.1,
            "outages_s": [[1.0, 2.0]],
        }
    )
    assert is_perfect(config, FaultConfig())
    made = line_camera(config, FaultConfig(), LEVER, RUNWAY, default_rng(0), default_rng(1), 1.0)
    assert isinstance(made, LineCamera)


WINDOW = ((7.99, False), (8.0, True), (10.99, True), (11.0, False))


@pytest.mark.parametrize(("line", "row"), [("left", 0), ("threshold", 1), ("right", 2)])
def test_a_line_is_missing_in_its_window_alone(line: str, row: int) -> None:
    device = camera({"kind": "missing", "line": line, "at_s": 8.0, "lasting_s": 3.0})
    whole = camera().view(TRUTH, TILT, TILT, (0.0, 0.0, 0.0))
    for time, gone in WINDOW:
        view = device.view(TRUTH._replace(time=time), TILT, TILT, (0.0, 0.0, 0.0))
        assert view.fault == (row + 1 if gone else 0)
        for other in range(3):
            if gone and other == row:
                for numbers in (view.frame.lines, view.true_ends, view.seen_ends):
                    assert np.isnan(numbers[other]).all()
            else:
                np.testing.assert_array_equal(view.frame.lines[other], whole.frame.lines[other])


SINE, COSINE = math.sin(math.radians(2.0)), math.cos(math.radians(2.0))


@pytest.mark.parametrize(
    ("line", "row", "fault", "elsewhere"),
    [
        ("left", 0, {"offset_m": 10.0}, ((0.0, -5.0, 0.0), (2000.0, -5.0, 0.0))),
        ("right", 2, {"offset_m": -4.0}, ((0.0, 11.0, 0.0), (2000.0, 11.0, 0.0))),
        ("threshold", 1, {"offset_m": 60.0}, ((60.0, -15.0, 0.0), (60.0, 15.0, 0.0))),
        # clockwise, seen from above: the far end of an edge goes to the right, a threshold's right end comes back
        (
            "left",
            0,
            {"offset_m": 3.0, "angle_deg": 2.0},
            ((0.0, -12.0, 0.0), (2000.0 * COSINE, -12.0 + 2000.0 * SINE, 0.0)),
        ),
        (
            "threshold",
            1,
            {"offset_m": 20.0, "angle_deg": 2.0},
            ((20.0 + 15.0 * SINE, -15.0 * COSINE, 0.0), (20.0 - 15.0 * SINE, 15.0 * COSINE, 0.0)),
        ),
    ],
)
def test_a_wrong_line_lies_elsewhere_on_the_ground(
    line: str, row: int, fault: dict[str, float], elsewhere: tuple[Vec3, Vec3]
) -> None:
    device = camera({"kind": "wrong", "line": line, "at_s": 8.0, "lasting_s": 3.0, **fault})
    lines = [LEFT, THRESHOLD, RIGHT]
    for time, wrong in WINDOW:
        view = device.view(TRUTH._replace(time=time), TILT, TILT, (0.0, 0.0, 0.0))
        assert view.fault == (row + 1 if wrong else 0)
        for other, right in enumerate(lines):
            expected = pixels(TRUTH, elsewhere if wrong and other == row else right)
            reading = view.frame.reading(other)
            assert reading is not None
            np.testing.assert_allclose(view.true_ends[other], expected.ravel(), atol=1e-6)
            np.testing.assert_allclose(expected @ reading[:2] + reading.c, 0.0, atol=1e-6)


@pytest.mark.parametrize(("line", "rows"), [("edge", (0, 2)), ("any", (0, 1, 2))])
def test_which_line_is_at_fault_is_drawn_evenly(line: str, rows: tuple[int, ...]) -> None:
    config = FaultConfig.model_validate({"kind": "missing", "line": line})
    drawn = [fault_of(config, default_rng(seed)).line for seed in range(600)]
    assert set(drawn) == set(rows)
    low, high = binom.ppf((1e-6, 1.0 - 1e-6), 600, 1.0 / len(rows))
    for row in rows:
        assert low < drawn.count(row) < high


def test_frames_are_lost_by_the_stated_share_and_the_others_stay() -> None:
    every, some = camera(noise_px=1.0, pan_error_deg=0.1), camera(noise_px=1.0, pan_error_deg=0.1, dropped_share=0.2)
    lost = []
    for _ in range(2000):
        whole, view = (device.view(TRUTH, TILT, 0.0, (0.0, 0.0, 0.0)) for device in (every, some))
        lost.append(bool(np.isnan(view.frame.lines).all() and np.isnan(view.seen_ends).all()))
        if not lost[-1]:
            np.testing.assert_array_equal(view.frame.lines, whole.frame.lines)
        np.testing.assert_array_equal(view.true_ends, whole.true_ends)
    low, high = binom.ppf((1e-6, 1.0 - 1e-6), 2000, 0.2)
    assert low < sum(lost) < high
    # each by itself: two in succession are as rare as chance makes them
    low, high = binom.ppf((1e-6, 1.0 - 1e-6), 1999, 0.2**2)
    assert low < sum(a and b for a, b in pairwise(lost)) < high


def test_what_is_seen_ends_at_the_visibility() -> None:
    """From 300 m before the threshold and 18 m up, by Pythagoras."""
    truth, device = level(300.0, 18.0), camera(visibility_m=500.0, min_line_px=2.0)
    view = device.view(truth, TILT, 0.0, (0.0, 0.0, 0.0))
    far = math.sqrt(500.0**2 - 15.0**2 - 18.0**2) - 300.0
    for row, ends in enumerate(
        (((0.0, -15.0, 0.0), (far, -15.0, 0.0)), THRESHOLD, ((0.0, 15.0, 0.0), (far, 15.0, 0.0)))
    ):
        np.testing.assert_allclose(view.true_ends[row], pixels(truth, ends).ravel(), atol=1e-6)
    # the middle of the threshold is nearer than its corners
    half = math.sqrt(300.7**2 - 300.0**2 - 18.0**2)
    view = camera(visibility_m=300.7, min_line_px=2.0).view(truth, TILT, 0.0, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(
        view.true_ends[1], pixels(truth, ((0.0, -half, 0.0), (0.0, half, 0.0))).ravel(), atol=1e-6
    )
    assert np.isnan(view.true_ends[[0, 2]]).all()


@pytest.mark.parametrize("before", [500.5, 900.0])
def test_nothing_is_seen_from_beyond_the_visibility(before: float) -> None:
    view = camera(visibility_m=500.0).view(level(before, 18.0), TILT, 0.0, (0.0, 0.0, 0.0))
    for numbers in (view.frame.lines, view.true_ends, view.seen_ends):
        assert np.isnan(numbers).all()


def scatter(
    device: ImperfectCamera, truth: Truth, row: int, rate: Vec3 = (0.0, 0.0, 0.0), noise: float = 1.5, draws: int = 4000
) -> Array:
    """Of a line's readings: σ of offset (px) and angle (rad) about the true line, and what they imply by themselves.

    The offset is taken at the middle of what is seen; believed is that of each reading's points and spread.
    """
    found, believed = [], []
    for _ in range(draws):
        view = device.view(truth, TILT, 0.0, rate)
        reading = view.frame.reading(row)
        assert reading is not None
        u0, v0, u1, v1 = view.true_ends[row]
        length = math.hypot(u1 - u0, v1 - v0)
        along = (u1 - u0) / length, (v1 - v0) / length
        sign = math.copysign(1.0, reading.b * along[0] - reading.a * along[1])
        offset = 0.5 * (reading.a * (u0 + u1) + reading.b * (v0 + v1)) + reading.c
        found.append((sign * offset, math.asin(sign * (reading.a * along[0] + reading.b * along[1]))))
        believed.append(fit_variances(reading.spread, reading.points, noise))
    return np.array((np.std(found, axis=0), np.sqrt(np.mean(believed, axis=0))))


@pytest.mark.parametrize(("before", "row"), [(100.0, 1), (300.0, 1), (300.0, 0), (500.0, 1)])
def test_noise_grows_as_contrast_falls_and_the_reading_says_so(before: float, row: int) -> None:
    """At d the noise of a point is exp(3 d / visibility) times what it is; N of them give σ²/N and σ²/Σ(x - x̄)².

    Total least squares through points that are as noisy along the line adds to the angle what is of second order.
    """
    truth, visibility = level(before, 18.0), 600.0
    device = camera(noise_px=1.5, visibility_m=visibility, min_line_px=2.0)
    if row == 1:
        middle = np.array((before, 0.0, 18.0))
    else:
        # the middle of the image of an edge: depths to the projection are those of an axis 3° down
        far = math.sqrt(visibility**2 - 15.0**2 - 18.0**2)
        near_end, far_end = np.array((before, -15.0, 18.0)), np.array((far, -15.0, 18.0))
        axis = np.array((math.cos(TILT), 0.0, math.sin(TILT)))
        share = (near_end @ axis) / (near_end @ axis + far_end @ axis)
        middle = near_end + share * (far_end - near_end)
    sigma = 1.5 * math.exp(3.0 * float(np.linalg.norm(middle)) / visibility)
    ends = device.view(truth, TILT, 0.0, (0.0, 0.0, 0.0)).true_ends[row].reshape(2, 2)
    length = float(np.linalg.norm(ends[1] - ends[0]))
    places = np.linspace(0.0, length, math.floor(length) + 1)
    first = np.array((1.0 / places.size, 1.0 / ((places - places.mean()) ** 2).sum()))
    second = 1.0, 1.0 + sigma**2 * first[1] / first[0]
    stated = sigma * np.sqrt(first * second)
    measured, believed = scatter(device, truth, row)
    np.testing.assert_allclose(measured, stated, rtol=0.05)
    np.testing.assert_allclose(believed, measured, rtol=0.05)


@pytest.mark.parametrize(("before", "seen"), [(540.0, True), (590.0, False)])
def test_a_line_stands_out_of_its_noise(before: float, seen: bool) -> None:
    """The threshold is 30 m f / d long and has to be 8 px exp(3 d / 800 m): both are 67 px at 567 m."""
    view = camera(noise_px=1.5, visibility_m=800.0).view(level(before, 18.0), TILT, 0.0, (0.0, 0.0, 0.0))
    assert (view.frame.reading(1) is not None) is seen
    assert np.isfinite(view.true_ends[1]).all() == seen


def test_the_detector_is_not_told_of_noise_beyond_its_own() -> None:
    truth = level(300.0, 18.0)
    once, thrice = (camera(noise_px=1.5, noise_factor=factor, visibility_m=1200.0) for factor in (1.0, 3.0))
    one, three = scatter(once, truth, 1, draws=2000), scatter(thrice, truth, 1, draws=2000)
    np.testing.assert_allclose(three[0], 3.0 * one[0], rtol=0.07)
    np.testing.assert_allclose(three[1], one[1], rtol=0.05)


MOVING = truth_at((-150.0, 4.0, -12.0), (3.0, 2.0, 6.0), velocity=(38.0, -3.0, 2.5))
RATE: Vec3 = (0.25, -0.1, 0.15)


def moved(truth: Truth, rate: Vec3, time: float) -> Truth:
    """The body so much later, by its velocity and its rates."""
    R = np.array(truth.R_runway_from_body).reshape(3, 3) @ Rotation.from_rotvec(time * np.array(rate)).as_matrix()
    motion = truth.motion.copy()
    motion[:3] += time * motion[3:6]
    motion[6:15] = flat(R)
    return truth._replace(motion=motion)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("rate", [(0.0, 0.0, 0.0), RATE])
def test_blur_is_that_of_a_projection_that_moves(row: int, rate: Vec3) -> None:
    exposure, noise = 0.1, 0.5
    device = camera(noise_px=noise, exposure_s=exposure)
    view = device.view(MOVING, TILT, 0.0, rate)
    reading = view.frame.reading(row)
    assert reading is not None
    ends = view.true_ends[row].reshape(2, 2)
    segment = np.array((LEFT, THRESHOLD, RIGHT)[row])
    # the ground point in the middle of what is seen, by bisection
    low, high = 0.0, 1.0
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    for _ in range(60):
        share = 0.5 * (low + high)
        point = segment[0] + share * (segment[1] - segment[0])
        R = np.array(MOVING.R_runway_from_body).reshape(3, 3) @ Rotation.from_euler("y", -TILT).as_matrix()
        ahead = (point - np.array(MOVING.position)) @ R[:, 0] > 1.0
        before = not ahead or float((pixels(MOVING, [point])[0] - ends.mean(axis=0)) @ along) < 0.0
        low, high = (share, high) if before else (low, share)
    h = 1e-4
    flow = (pixels(moved(MOVING, rate, h), [point])[0] - pixels(moved(MOVING, rate, -h), [point])[0]) / (2.0 * h)
    smear = exposure * float(flow @ (along[1], -along[0]))
    assert abs(smear) > 0.2
    number = math.floor(np.linalg.norm(ends[1] - ends[0])) + 1
    # and in the clearest air there is, exp(3 d / 1000 km)
    worse = math.exp(6.0 * float(np.linalg.norm(point - np.array(MOVING.position))) / 1e6) + smear**2 / 12.0 / noise**2
    assert reading.points == pytest.approx(number / worse, rel=1e-4)
    measured, believed = scatter(device, MOVING, row, rate, noise, draws=3000)
    sigma = math.sqrt(noise**2 + smear**2 / 12.0)
    np.testing.assert_allclose(measured[0], sigma / math.sqrt(number), rtol=0.06)
    np.testing.assert_allclose(measured, believed, rtol=0.06)


def test_an_edge_is_not_smeared_along_itself() -> None:
    """Straight ahead along the runway both edges stay where they are in the image; the threshold comes nearer."""
    truth = level(150.0, 12.0, velocity=(40.0, 0.0, 0.0))
    sharp = camera(noise_px=1.5, pan_error_deg=0.1).view(truth, TILT, 0.0, (0.0, 0.0, 0.0)).frame.lines[:, 6]
    blurred = camera(noise_px=1.5, pan_error_deg=0.1, exposure_s=0.02).view(truth, TILT, 0.0, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(blurred.frame.lines[[0, 2], 6], sharp[[0, 2]], rtol=1e-9)
    # v = f h / x, so that it moves by f h / x² × 40 m/s, at an axis 3° down nearly so
    smear = 0.02 * F * 12.0 / 150.0**2 * 40.0
    assert blurred.frame.lines[1, 6] == pytest.approx(sharp[1] / (1.0 + smear**2 / 12.0 / 1.5**2), rel=0.02)
    # without noise of its own it is told by what navigation takes for noise, here 0.05 px
    device = camera(noise_px=0.0, min_line_px=2.0, pan_error_deg=0.1, exposure_s=0.02)
    noiseless = device.view(truth, TILT, 0.0, (0.0, 0.0, 0.0)).frame.lines[1, 6]
    assert noiseless == pytest.approx(sharp[1] / (1.0 + smear**2 / 12.0 / 0.05**2), rel=0.02)


def test_in_flight_blur_is_told_by_the_noise_that_navigation_takes() -> None:
    """Of a camera without noise navigation takes 0.05 px: blurred lines are seen, and believed for what they are."""
    changes = {"navigation.aiding": "lines", "camera.noise_px": 0.0, "camera.exposure_s": 0.002}
    flight = fly(load_scenario("landing", changes | {"simulation.time_limit_s": 5.0}), seed=0)
    found, believed = (flight.log[f"lines_{kind}"][120:] for kind in ("found", "believed"))
    assert (found == 7.0).mean() > 0.9
    assert (believed == found).mean() > 0.99
    assert np.nanmean(flight.log["nees9"]) < 18.0  # of 9


def test_a_frame_counts_when_it_arrives_and_shows_what_was_there_before() -> None:
    """A flight's first second: 0.1 s are twelve of its steps."""
    settings: dict[str, Any] = {"simulation.time_limit_s": 1.0, "navigation.start": "handover"}
    log = fly(load_scenario("landing", overrides={**settings, "camera.latency_s": 0.1}), seed=1).log
    at_once = fly(load_scenario("landing", overrides=settings), seed=1).log
    assert np.flatnonzero(np.isfinite(at_once["nis"]))[0] == 0
    assert np.flatnonzero(np.isfinite(log["nis"])).tolist() == list(range(12, len(log["nis"]), 4))
    assert np.flatnonzero(np.isfinite(log["left_seen_u0"]))[0] == 0
    assert log["left_seen_u0"][0] == at_once["left_seen_u0"][0]
