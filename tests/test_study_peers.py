"""Other solvers on the same images: what they are given, what is made of their answers, and doing without them.

=========================  =======================================================================================
corner points              OpenCV's projection of the runway's corners
least squares              scipy, on the reprojection of the four corners
lines                      figures of an independent prototype
not installed              modules that cannot be imported
=========================  =======================================================================================
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.lines import fit_line
from estimator.so3 import Array
from landsim.config import Scenario, load_scenario
from landsim.plain import as_json
from landsim.scene import runway_of
from landsim.sensors import camera_of
from landsim.study.draws import draw_points
from landsim.study.frames import at_distances
from landsim.study.peers import peers
from landsim.study.solvers import (
    REFINED,
    SOLVERS,
    Scene,
    by_points,
    corners_are_seen,
    corners_of_ends,
    corners_of_fits,
    level68,
    runway_corners,
)

STUDY = """
kind = "study"
aircraft.name = "pioneer"
start.speed_mps = 40.0
study.ranges_m = [1000.0, 400.0, 50.0]
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Scenario:
    path = tmp_path / "some.toml"
    path.write_text(STUDY)
    return load_scenario(path)


def scene_at(scenario: Scenario, distance: float) -> Scene:
    frames = at_distances(scenario, "early", (distance,))
    camera, runway = camera_of(scenario.camera), runway_of(scenario)
    return Scene(camera, runway, frames.position[0], frames.R_cam_from_runway[0], frames.ends[0])


def matrix_of(scene: Scene) -> Array:
    c = scene.camera
    return np.array(((c.fx, 0.0, c.cx), (0.0, c.fy, c.cy), (0.0, 0.0, 1.0)))


def cv_corners(scene: Scene) -> Array:
    """Pixels of both threshold corners and both far corners, by OpenCV."""
    world = np.array(((0.0, -15.0, 0.0), (0.0, 15.0, 0.0), (2000.0, -15.0, 0.0), (2000.0, 15.0, 0.0)))
    turn = Rotation.from_matrix(scene.rotation).as_rotvec()
    uv, _ = cv2.projectPoints(world, turn, -scene.rotation @ scene.position, matrix_of(scene), None)
    return np.asarray(uv[:, 0], float)


def points_of(
    scene: Scene, noise_px: float, draws: int, seed: int = 0, reading: Any = "edge-points"
) -> dict[int, Array]:
    rng = default_rng(seed)
    return {
        line: draw_points(scene.ends[line], reading, 1.0, noise_px, draws, rng) for line in (LEFT, THRESHOLD, RIGHT)
    }


def test_the_corners_are_those_of_the_runway(scenario: Scenario) -> None:
    scene = scene_at(scenario, 400.0)
    assert corners_are_seen(scene)
    points = points_of(scene, 0.0, 2)
    fits = {line: fit_line(there) for line, there in points.items()}
    for corners in (corners_of_ends(points), corners_of_fits(points, fits)):
        assert corners.shape == (2, 4, 2)
        assert corners[1] == pytest.approx(cv_corners(scene), abs=1e-7)


def test_corners_of_either_kind_have_the_noise_that_their_points_give_them(scenario: Scenario) -> None:
    scene = scene_at(scenario, 400.0)
    points = points_of(scene, 1.0, 4000, seed=1)
    fits = {line: fit_line(there) for line, there in points.items()}
    ends, fitted = (
        np.std(corners - cv_corners(scene), axis=0)
        for corners in (corners_of_ends(points), corners_of_fits(points, fits))
    )
    # two measured points at each corner of the threshold, one at each of the far end
    assert ends[:2] == pytest.approx(math.sqrt(0.5), rel=0.05)
    assert ends[2:] == pytest.approx(1.0, rel=0.05)
    assert (fitted[:2] < 0.6 * ends[:2]).all()
    # a far end brought onto its line keeps the noise along it
    along = scene.ends[RIGHT][2:] - scene.ends[RIGHT][:2]
    along /= np.linalg.norm(along)
    moved = (corners_of_fits(points, fits)[:, 3] - cv_corners(scene)[3]) @ along
    assert np.std(moved) == pytest.approx(1.0, rel=0.05)


def test_a_cut_edge_has_no_corner(scenario: Scenario) -> None:
    # the corners of the threshold leave the image at 58 m
    assert corners_are_seen(scene_at(scenario, 60.0))
    assert not corners_are_seen(scene_at(scenario, 50.0))


def test_solvers_are_exact_without_noise_or_said_not_to_be(scenario: Scenario) -> None:
    scene = scene_at(scenario, 400.0)
    corners = np.repeat(cv_corners(scene)[None], 2, axis=0) + 0.01 * default_rng(0).normal(size=(2, 4, 2))
    ours = np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))
    exact = {s: by_points(cv2, s, scene, corners, ours, lambda: 0.0)["solves_without_noise"] for s in SOLVERS}
    assert exact == {"AP3P": True, REFINED: True, "SQPNP": True, "IPPE": True, "ITERATIVE": True, "EPNP": False}


def test_refined_is_the_least_squares_pose(scenario: Scenario) -> None:
    scene = scene_at(scenario, 400.0)
    world, K = runway_corners(scene.runway), matrix_of(scene)
    noisy = cv_corners(scene) + default_rng(4).normal(size=(4, 2))

    def residuals(x: Array) -> Array:
        R = Rotation.from_rotvec(x[:3]).as_matrix() @ scene.rotation
        seen = (world - (scene.position + x[3:])) @ R.T @ K.T
        return np.asarray((seen[:, :2] / seen[:, 2:] - noisy).ravel())

    fit = least_squares(residuals, np.zeros(6), x_scale=(1e-3, 1e-3, 1e-3, 10.0, 1.0, 1.0), xtol=1e-14, ftol=1e-14)
    expected = scene.position + fit.x[3:], Rotation.from_rotvec(fit.x[:3]).as_matrix() @ scene.rotation
    ours = np.repeat(scene.position[None], 1, axis=0) + 1.0, scene.rotation[None]
    found = by_points(cv2, REFINED, scene, noisy[None], ours, lambda: 0.0)["p68"]
    assert found == pytest.approx(level68((expected[0][None], expected[1][None]), scene), rel=1e-3)
    assert found["along_m"] > 0.01


def test_errors_by_hand(scenario: Scenario) -> None:
    scene = scene_at(scenario, 400.0)
    turned = Rotation.from_euler("ZYX", (0.2, -3.0 + 0.1, 0.5), degrees=True).as_matrix().T  # forward, right, down
    pose = (scene.position + np.array((5.0, -2.0, 1.0)))[None], turned[[1, 2, 0]][None]
    expected = {
        "roll_deg": 0.5,
        "pitch_deg": 0.1,
        "yaw_deg": 0.2,
        "cross_m": 2.0,
        "altitude_m": 1.0,
        "along_m": 5.0,
    }
    assert level68(pose, scene) == pytest.approx(expected)


def test_the_same_draws_for_all(scenario: Scenario) -> None:
    seed = SeedSequence(1)
    result = peers(scenario, seed, draws=40, clock=lambda: 0.0)
    assert seed.n_children_spawned == 0
    assert result["omitted"] == [
        {
            "reading": reading,
            "range_m": 50.0,
            "part": "points",
            "reason": "not all four corners of the runway are in the image",
        }
        for reading in ("endpoints", "edge-points")
    ]
    assert {(e["reading"], e["corners"]) for e in result["points"]} == {
        ("endpoints", "ends"),
        ("edge-points", "ends"),
        ("edge-points", "fitted"),
    }
    lines = {(e["reading"], e["range_m"]): e["p68"] for e in result["lines"]}
    assert len(lines) == 6
    for entry in result["points"]:
        ours = lines[entry["reading"], entry["range_m"]]
        assert entry["ratio"] == pytest.approx({key: entry["p68"][key] / ours[key] for key in ours})
        if entry["solver"] == "EPNP":
            assert entry["failures"] > 30
            assert math.isinf(entry["p68"]["along_m"])
    # p3ll solves the same three equations
    assert len(result["p3ll"]) == 6
    for entry in result["p3ll"]:
        assert entry["same"] + entry["differ"] == entry["solved_by_both"] >= 39
        assert entry["differ"] <= 1
    assert json.loads(json.dumps(as_json(result), allow_nan=False))["points"]
    assert "EPNP fails in" in result["text"]
    again = peers(scenario, seed, draws=40, clock=lambda: 0.0)
    assert again == result


def test_without_the_extras_it_says_so(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("cv2", "poselib"):
        monkeypatch.setitem(sys.modules, name, None)
    result = peers(scenario, SeedSequence(1), distances=(400.0, 200.0), draws=4000)
    assert result["installed"] == {"cv2": None, "poselib": None}
    assert result["points"] == result["p3ll"] == []
    assert [(e["part"], e["reason"]) for e in result["omitted"]] == [
        ("points", "cv2 is not installed"),
        ("p3ll", "poselib is not installed"),
    ]
    assert "not installed" in result["text"]
    # an independent prototype's figures for the lines
    prototype = {
        ("endpoints", 400.0): (1.21, 0.119, 0.0892, 0.982, 1.16, 10.5),
        ("edge-points", 400.0): (0.304, 0.0274, 0.0215, 0.251, 0.303, 2.15),
        ("endpoints", 200.0): (0.606, 0.0783, 0.0732, 0.455, 0.386, 3.26),
        ("edge-points", 200.0): (0.107, 0.0140, 0.0130, 0.0886, 0.0805, 0.500),
    }
    for entry in result["lines"]:
        expected = prototype[entry["reading"], entry["range_m"]]
        assert list(entry["p68"].values()) == pytest.approx(expected, rel=0.06)


def test_ranges_that_show_nothing_early_are_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("cv2", "poselib"):
        monkeypatch.setitem(sys.modules, name, None)
    path = tmp_path / "late.toml"
    path.write_text(STUDY.replace("[1000.0, 400.0, 50.0]", "[20.0, -50.0]"))
    result = peers(load_scenario(path), SeedSequence(1), draws=10)
    assert {e["range_m"] for e in result["lines"]} == {1000.0, 400.0, 100.0}
