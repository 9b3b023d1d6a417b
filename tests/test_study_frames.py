"""The straight approach: the paper's geometry by hand, and OpenCV's projection."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from approach import F, paper
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from landsim.config import load_scenario
from landsim.errors import ScenarioError
from landsim.study.frames import Frames, at_distances, straight_approach
from landsim.units import DEG

LEFT, THRESHOLD, RIGHT = 0, 1, 2
TAN3 = math.tan(3.0 * DEG)


@pytest.fixture(scope="module")
def approach() -> tuple[Frames, Frames]:
    return straight_approach(paper())


def test_one_frame_every_thirtieth_of_a_second_from_the_start_to_two_metres(approach: tuple[Frames, Frames]) -> None:
    early, late = approach
    time = np.concatenate((early.time, late.time))
    assert time == pytest.approx(np.arange(len(time)) / 30.0)
    assert early.distance[0] == 1000.0
    assert early.height[0] == 60.0
    distance, height = np.concatenate((early.distance, late.distance)), np.concatenate((early.height, late.height))
    assert np.diff(distance) == pytest.approx(-40.0 * math.cos(3.0 * DEG) / 30.0)
    assert np.diff(height) == pytest.approx(-40.0 * math.sin(3.0 * DEG) / 30.0)
    assert 2.0 <= late.height[-1] < 2.0 + 40.0 * math.sin(3.0 * DEG) / 30.0
    assert (early.position[:, 1] == 0.0).all()


def test_the_path_crosses_the_threshold_at_7_59_m_and_meets_the_ground_145_m_beyond() -> None:
    over, before = at_distances(paper(), "late", [0.0]), at_distances(paper(), "late", [-144.0])
    assert over.height[0] == pytest.approx(7.59, abs=0.005)
    assert before.height[0] == pytest.approx((144.9 - 144.0) * TAN3, abs=0.005)


def test_corners_leave_the_image_at_about_58_m() -> None:
    # by hand: a corner 15 m to the side leaves a half-width of 329 px at a depth of 15 f / 329 = 57.57 m, which 3°
    # down and 7.59 m + d tan 3° up is d = 57.1 m before the threshold
    clipped = at_distances(paper(), "early", np.arange(70.0, 45.0, -0.01))
    for line, side, end in ((LEFT, -0.5, 0), (RIGHT, 657.5, 0)):
        out = np.abs(clipped.ends[:, line, end] - side) < 1e-9
        first = clipped.distance[np.argmax(out)]
        assert first == pytest.approx(57.1, abs=0.1)
        assert first == pytest.approx(58.0, abs=1.0)  # as the paper's restatement has it
        assert out[np.argmax(out) :].all()


@pytest.mark.parametrize(("pitch_deg", "expected"), [(-3.0, 38.0), (-10.0, 23.0)])
def test_the_threshold_line_leaves_the_image(pitch_deg: float, expected: float) -> None:
    # the lower side of the image, 247 px below the middle, looks atan(247 / f) below the optical axis
    slope = math.tan(math.atan(247.0 / F) - pitch_deg * DEG)
    by_hand = brentq(lambda d: (7.592 + d * TAN3) - slope * d, 1.0, 100.0)
    frames = at_distances(paper(), "early", np.arange(50.0, 10.0, -0.01), pitch=pitch_deg * DEG)
    seen = np.asarray(np.isfinite(frames.ends[:, THRESHOLD]).all(axis=1))
    last = frames.distance[seen][-1]
    assert last == pytest.approx(by_hand, abs=0.02)
    assert last == pytest.approx(expected, abs=0.5)
    assert seen[: seen.sum()].all()


def test_the_hand_over_is_latched(approach: tuple[Frames, Frames]) -> None:
    early, late = approach
    assert early.seen().all()
    assert late.seen().all()
    step = 40.0 * math.cos(3.0 * DEG) / 30.0
    assert early.distance[-1] - step == pytest.approx(late.distance[0])
    assert late.distance[0] < 38.4 < early.distance[-1]
    # tilted to 10° the threshold is back in the image, until 23 m, and the late stage stays
    again = np.asarray(np.isfinite(late.ends[:, THRESHOLD]).all(axis=1))
    assert again[0]
    assert late.distance[again].min() == pytest.approx(23.0, abs=step)


@pytest.mark.parametrize(("stage", "drop"), [(0, 66.0), (1, 223.0)])
def test_edges_meet_on_the_horizon(approach: tuple[Frames, Frames], stage: int, drop: float) -> None:
    frames = approach[stage]
    left, right = (np.c_[frames.ends[:, line], np.ones((len(frames), 1))] for line in (LEFT, RIGHT))
    lines = [np.cross(side[:, [0, 1, 4]], side[:, [2, 3, 4]]) for side in (left, right)]
    point = np.cross(lines[0], lines[1])
    assert point[:, 0] / point[:, 2] == pytest.approx(328.5, abs=1e-6)
    above = 246.5 - point[:, 1] / point[:, 2]
    assert above == pytest.approx(-F * np.tan(frames.pitch), abs=1e-6)
    assert above == pytest.approx(drop, abs=0.5)


def test_ends_are_opencvs_projection() -> None:
    frames = at_distances(paper(start__cross_m=7.0), "early", [1000.0, 300.0, 120.0])
    far_edge = np.array(((0.0, -15.0, 0.0), (2000.0, -15.0, 0.0), (0.0, 15.0, 0.0), (2000.0, 15.0, 0.0)))
    matrix = np.array(((F, 0.0, 328.5), (0.0, F, 246.5), (0.0, 0.0, 1.0)))
    triad = Rotation.from_euler("ZYX", [0.0, -3.0 * DEG, 0.0]).as_matrix()
    rotation = np.stack((triad[:, 1], triad[:, 2], triad[:, 0]))
    for position, ends, R in zip(frames.position, frames.ends, frames.R_cam_from_runway, strict=True):
        assert rotation == pytest.approx(R, abs=1e-15)
        projected, _ = cv2.projectPoints(far_edge, cv2.Rodrigues(R)[0], -R @ position, matrix, None)
        expected = np.asarray(projected, float).reshape(-1)
        assert ends[LEFT] == pytest.approx(expected[:4], abs=1e-6)
        assert ends[RIGHT] == pytest.approx(expected[4:], abs=1e-6)
        assert ends[THRESHOLD] == pytest.approx(expected[[0, 1, 4, 5]], abs=1e-6)


def test_frames_at_distances_are_those_of_the_approach(approach: tuple[Frames, Frames]) -> None:
    for whole in approach:
        some = whole[5:200:60]
        again = at_distances(paper(), whole.stage, some.distance)
        for name in ("time", "position", "pitch", "R_cam_from_runway", "ends"):
            assert getattr(again, name) == pytest.approx(getattr(some, name), abs=1e-9, nan_ok=True), name
        assert len(some) == len(again)


def test_what_is_too_short_too_near_or_under_the_ground_is_not_seen() -> None:
    # 30 m at 5000 m are 7.6 px wide
    far = at_distances(paper(), "early", [4500.0, 5000.0])
    assert np.isfinite(far.ends[:, THRESHOLD]).all(axis=1).tolist() == [True, False]
    assert far.seen().tolist() == [True, False]
    under = at_distances(paper(), "late", [-140.0, -150.0])
    assert np.isfinite(under.ends[1]).sum() == 0
    assert under.seen().tolist() == [True, False]


def test_threshold_that_is_never_in_view_leaves_the_late_stage_alone() -> None:
    early, late = straight_approach(paper(start__along_m=-30.0, start__height_m=20.0))
    assert len(early) == 0
    assert late.distance[0] == 30.0


def test_late_camera_begins_when_the_threshold_has_been_seen_and_lost() -> None:
    # a start so far out that the threshold is not seen at first
    early, late = straight_approach(paper(start__along_m=-5200.0, start__height_m=280.0))
    assert not early.seen()[0]
    assert early.seen()[-1]
    assert late.distance[0] < 60.0


def test_a_path_that_does_not_descend_ends_with_the_runway() -> None:
    early, late = straight_approach(paper(start__flight_path_deg=0.0))
    assert late.distance[-1] == pytest.approx(-2000.0, abs=40.0 / 30.0)
    assert late.height[-1] == 60.0
    assert early.distance[0] == 1000.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"study__end_height_m": 61.0}, "study.end_height_m: must be below start.height_m = 60, not 61"),
        ({"start__speed_mps": 0.001}, "start.speed_mps: an approach of"),
    ],
)
def test_impossible_approaches_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        straight_approach(paper(**changes))


def test_a_flight_has_no_straight_approach() -> None:
    with pytest.raises(ValueError, match="has no straight approach"):
        straight_approach(load_scenario("landing"))
