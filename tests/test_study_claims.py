"""The paper's other claims: translations, time a frame, tilt.

=========================  =======================================================================================
rotation                   scipy's Euler angles
attitude errors            hand computation, and a least-squares position from planes by numpy
time                       a clock that is wound by hand
tilt                       the pinhole's geometry by hand, and figures of an independent prototype
=========================  =======================================================================================
"""

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng
from scipy.spatial.transform import Rotation

from estimator.so3 import Array
from landsim.config import Scenario, load_scenario
from landsim.plain import as_json
from landsim.sensors import camera_of
from landsim.study.model import Reading
from landsim.study.peers import peers
from landsim.study.tilt import tilt
from landsim.study.timing import PAPER_MS, timing
from landsim.study.translations import AXES, FORMS, Planes, planes_of, positions, shifts, translations, triad_axes

DEG = math.pi / 180.0
WIDTH = 30.0
STUDY = """
kind = "study"
aircraft.name = "pioneer"
start.speed_mps = 40.0
study.ranges_m = [1000.0, 400.0, 100.0]
study.draws = 100
study.listed_draws = 200
"""
CORNERS = np.array(((0.0, -15.0, 0.0), (0.0, 15.0, 0.0), (500.0, -15.0, 0.0), (500.0, 15.0, 0.0)))


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "some.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture
def scenario(study: Path) -> Scenario:
    return load_scenario(study)


def rotation(yaw: float, pitch: float, roll: float) -> Array:
    """R_cam_from_runway by scipy."""
    forward, right, down = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_matrix().T
    return np.stack((right, down, forward))


def clean_planes(scenario: Scenario, position: Array, R: Array) -> Planes:
    """Planes of the lines through the corners' pixels, as a batch of one."""
    camera = camera_of(scenario.camera)
    uv = np.hstack((camera.project((CORNERS - position) @ R.T), np.ones((4, 1))))
    lines = [np.cross(uv[i], uv[k])[None] for i, k in ((0, 2), (0, 1), (1, 3))]
    return planes_of(camera, lines, WIDTH)


def columns(R: Array) -> Any:
    return tuple(tuple(R[:, j]) for j in range(3))


def test_triad_axes_are_scipys() -> None:
    rng = default_rng(1)
    for yaw, pitch, roll in rng.uniform(-1.4, 1.4, (50, 3)):
        expected = rotation(yaw, pitch, roll)
        assert np.abs(np.array(triad_axes(yaw, pitch, roll)).T - expected).max() < 1e-14


def test_a_roll_error_by_hand() -> None:
    # 10 m up on the centreline, 0.01 rad: cross by coplanarity (10 + 30²/40) 0.01, by a corner 10 × 0.01 and the
    # height 15 × 0.01
    moved = shifts((-300.0, 0.0, -10.0), (0.01, 0.0, 0.0), WIDTH)
    assert moved["coplanarity"] == pytest.approx((0.0, 0.325, 0.0))
    assert moved["corner"] == pytest.approx((0.0, 0.1, 0.15))
    assert moved["middle"] == pytest.approx((0.0, 0.1, 0.0))


def test_yaw_and_pitch_errors_by_hand() -> None:
    # range times angle, the same by all forms but for the corner's own 15 m to the side
    moved = shifts((-300.0, 0.0, -10.0), (0.0, 0.002, 0.001), WIDTH)
    assert moved["coplanarity"] == pytest.approx((-0.02, -0.3, 0.6))
    assert moved["middle"] == pytest.approx((-0.02, -0.3, 0.6))
    assert moved["corner"] == pytest.approx((-0.02 - 0.015, -0.3, 0.6))


@pytest.mark.parametrize("place", [(-250.0, 0.0, -20.0), (-120.0, 9.0, -14.0), (-700.0, -40.0, -35.0)])
def test_shifts_are_what_the_forms_do(scenario: Scenario, place: tuple[float, float, float]) -> None:
    position, size = np.array(place), 1e-5
    true = rotation(0.02, -0.06, 0.05)
    planes = clean_planes(scenario, position, true)
    assert planes.valid.all()
    for form, found in positions(planes, columns(true), WIDTH).items():
        assert found[0] == pytest.approx(position, abs=1e-7), form
    for psi in size * np.eye(3):
        # R_runway_from_cam → exp([ψ×]) R_runway_from_cam
        given = true @ Rotation.from_rotvec(psi).as_matrix().T
        expected = shifts(position, psi, WIDTH)
        for form, found in positions(planes, columns(given), WIDTH).items():
            assert found[0] - position == pytest.approx(expected[form], abs=2e-3 * size * 100.0), form


def test_coplanarity_holds_the_corners_and_the_middle(scenario: Scenario) -> None:
    # the camera for which each measured plane, turned by the wrong rotation, holds its point, by numpy's solver
    position, given = np.array((-200.0, 5.0, -18.0)), rotation(0.01, -0.05, 0.03)
    planes = clean_planes(scenario, position, rotation(0.0, -0.06, 0.0))
    normals = np.array([[c[0] for c in n] for n in (planes.n1, planes.n2, planes.n3)]) @ given
    points = np.array(((0.0, -15.0, 0.0), (0.0, 0.0, 0.0), (0.0, 15.0, 0.0)))
    expected = np.linalg.solve(normals, (normals * points).sum(axis=1))
    assert positions(planes, columns(given), WIDTH)["coplanarity"][0] == pytest.approx(expected, abs=1e-8)
    assert np.linalg.norm(expected - position) > 1.0


def test_the_forms_are_equal_with_the_lines_own_rotation(scenario: Scenario) -> None:
    result = translations(scenario, SeedSequence(1), draws=2000)
    same = result["same_rotation"]
    assert {(e["reading"], e["range_m"]) for e in same["at"]} == {
        (r, d) for r in ("endpoints", "edge-points") for d in (1000.0, 400.0, 100.0)
    }
    assert 0.0 < same["largest_relative_difference"] < 1e-9
    assert same["equal"]
    assert "the same position" in result["text"]
    # and only then: with another rotation they are metres apart
    true = [e for e in result["other_rotation"] if e["rotation"] == "true" and e["range_m"] == 1000.0]
    assert all(abs(e["ratio"]["altitude_m"] - 1.0) > 0.01 for e in true)


def test_a_roll_error_alone_decides_the_ratio(study: Path) -> None:
    # lines all but free of noise, at 100 m, 3° down, h = 7.5922 + 100 tan 3°: rolled about the optical axis,
    # ψ = δ (cos 3°, 0, sin 3°)
    quiet = load_scenario(study, {"camera.noise_px": 1e-4})
    result = translations(quiet, SeedSequence(1), draws=50)
    h = 60.0 - 900.0 * math.tan(3.0 * DEG)
    px, pz = 0.5 * DEG * math.cos(3.0 * DEG), 0.5 * DEG * math.sin(3.0 * DEG)
    swing = px * h - pz * 100.0
    by_hand = {"coplanarity": (swing + px * 225.0 / h, 0.0), "corner": (swing, 15.0 * px), "middle": (swing, 0.0)}
    for entry in result["other_rotation"]:
        if entry["range_m"] == 100.0 and entry["rotation"] == "true, roll off":
            for form, (cross, altitude) in by_hand.items():
                assert entry["rms"][form]["cross_m"] == pytest.approx(cross, rel=0.01)
                assert entry["rms"][form]["altitude_m"] == pytest.approx(altitude, rel=0.01, abs=4e-3)  # δ² × 28 m
            assert entry["ratio"]["cross_m"] == pytest.approx(by_hand["coplanarity"][0] / swing, rel=0.01)
            assert (entry["better"]["cross_m"], entry["better"]["altitude_m"]) == ("corner", "coplanarity")


def test_attitude_errors_of_a_filter_are_taken(study: Path) -> None:
    # a pitch error of 0.1° at 400 m costs 0.698 m of altitude, a yaw error as much of cross; at other ranges there is
    # no filter, and that is said
    quiet = load_scenario(study, {"camera.noise_px": 1e-4})
    errors: dict[tuple[Reading, float], Array] = {
        ("endpoints", 400.0): np.tile((0.0, 0.1 * DEG, 0.0), (7, 1)),
        ("edge-points", 400.0): np.tile((0.0, 0.0, -0.1 * DEG), (7, 1)),
        ("edge-points", 100.0): np.empty((0, 3)),
    }
    result = translations(quiet, SeedSequence(1), errors, draws=50)
    by_filter = {e["reading"]: e["rms"] for e in result["other_rotation"] if e["rotation"] == "filter"}
    for form in FORMS:
        assert by_filter["endpoints"][form]["altitude_m"] == pytest.approx(0.698, rel=0.01)
        assert by_filter["endpoints"][form]["cross_m"] < 0.01
        assert by_filter["edge-points"][form]["cross_m"] == pytest.approx(0.698, rel=0.01)
    missing = {(e["reading"], e["range_m"]): e["reason"] for e in result["omitted"]}
    assert set(missing) == {
        ("endpoints", 1000.0),
        ("endpoints", 100.0),
        ("edge-points", 1000.0),
        ("edge-points", 100.0),
    }
    assert "with the filter's attitude" in result["text"]


def test_ranges_without_the_lines_are_left_out(scenario: Scenario) -> None:
    result = translations(scenario, SeedSequence(1), compared=(400.0, 20.0), draws=20)
    assert {(e["range_m"], e["reason"]) for e in result["omitted"] if "rotation" not in e} == {
        (20.0, "not all lines are in the image")
    }
    assert {e["range_m"] for e in result["other_rotation"]} == {400.0}


def test_the_seed_is_the_result_and_stays_as_it_is(scenario: Scenario) -> None:
    seed = SeedSequence(5)
    one = translations(scenario, seed, draws=20)
    assert one == translations(scenario, seed, draws=20)
    assert one != translations(scenario, SeedSequence(6), draws=20)
    assert seed.n_children_spawned == 0
    assert {key for entry in one["other_rotation"] for key in entry["rms"]["corner"]} == set(AXES)


def test_time_by_a_clock_wound_by_hand(scenario: Scenario) -> None:
    ticks = itertools.count()
    result = timing(scenario, repeats=3, calls=100, batch=1000, clock=lambda: 0.002 * next(ticks))
    for stage in ("early", "late"):
        # 2 ms for 100 calls, and for 2 calls of 1000 frames
        assert result[stage]["single_us"] == pytest.approx(20.0)
        assert result[stage]["batch_us"] == pytest.approx(1.0)
        assert result[stage]["single_meets"]
    assert result["early"]["share_of_paper"] == pytest.approx(0.02 / 1.3)
    assert result["late"]["share_of_paper"] == pytest.approx(0.1)
    assert PAPER_MS == {"early": 1.3, "late": 0.2}
    assert "20 µs against the paper's 1.3 ms" in result["text"]
    slow = timing(scenario, repeats=1, calls=100, clock=lambda: 0.006 * next(ticks))
    assert slow["early"]["single_meets"]
    assert not slow["late"]["single_meets"]  # 60 µs of the 50 that are a quarter of the paper's
    assert not slow["early"]["batch_meets"]


def test_no_time_without_a_frame(study: Path) -> None:
    # a camera that looks up sees no runway
    up = load_scenario(study, {"study.pitch_early_deg": 40.0, "study.pitch_late_deg": 40.0})
    result = timing(up, repeats=1, calls=1)
    assert "omitted" in result["early"]
    assert "no frame" in result["text"]


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("tilt") / "some.toml"
    path.write_text(STUDY)
    pitches = (0.0, 3.0, 10.0, 12.0, 16.0, 20.0)
    return tilt(load_scenario(path), SeedSequence(2), pitches_deg=pitches, draws=2000)


def test_the_vanishing_point_stays(tilted: dict[str, Any]) -> None:
    # f tan τ, f = 12.5 mm / 9.9 µm; the image reaches 247 px up
    by_hand = [1262.626 * math.tan(p * DEG) for p in tilted["pitch_down_deg"]]
    assert tilted["vanishing_point_px"] == pytest.approx(by_hand, rel=1e-6)
    assert tilted["vanishing_point_px"][1:3] == pytest.approx((66.0, 223.0), abs=0.5)
    assert tilted["vanishing_point_in_image"] == [True, True, True, False, False, False]


def test_what_tilt_keeps_in_view(tilted: dict[str, Any]) -> None:
    # the path is 7.592 + x tan 3° up at a distance x; the lower rim of the image lies atan(247/f) below the axis
    over = 60.0 - 1000.0 * math.tan(3.0 * DEG)
    for k in range(4):
        rim = math.tan(tilted["pitch_down_deg"][k] * DEG + math.atan(247.0 / 1262.626))
        assert tilted["threshold_until_m"][k] == pytest.approx(over / (rim - math.tan(3.0 * DEG)), abs=0.01)
        assert tilted["threshold_from_m"][k] == 1000.0
    assert tilted["threshold_until_m"][1:3] == pytest.approx((38.0, 23.0), abs=0.5)
    # at 16° the upper rim is 4.93° down, and a min_line_px of the edges below it the threshold comes into the image
    upper = math.tan(16.0 * DEG - math.atan(247.0 / 1262.626))
    first = over / (upper - math.tan(3.0 * DEG))
    assert 0.85 * first < tilted["threshold_from_m"][4] < first


def test_errors_at_the_papers_tilt_are_the_prototypes(tilted: dict[str, Any]) -> None:
    # an independent prototype, 68.27th percentiles at 3° down
    at = {400.0: tilted["early"]["range_m"].index(400.0), 200.0: tilted["early"]["range_m"].index(200.0)}
    prototype = {
        (400.0, "endpoints"): (1.21, 0.119, 0.0892, 0.982, 1.16, 10.5),
        (400.0, "edge-points"): (0.304, 0.0274, 0.0215, 0.251, 0.303, 2.15),
        (200.0, "endpoints"): (0.606, 0.0783, 0.0732, 0.455, 0.386, 3.26),
        (200.0, "edge-points"): (0.107, 0.0140, 0.0130, 0.0886, 0.0805, 0.500),
    }
    for (distance, reading), expected in prototype.items():
        errors = tilted["early"][reading].values()
        for key in ("p68", "first_order"):
            found = [of[key][at[distance]][1] for of in errors]
            assert found == pytest.approx(expected, rel=0.08), (distance, reading, key)


def test_yaw_takes_its_share_of_roll(tilted: dict[str, Any]) -> None:
    # counted about the vertical, with a roll about the optical axis: ψ_z = yaw' + roll' sin τ, the first of which is
    # what a level camera has
    far = tilted["early"]["range_m"].index(800.0)
    of = tilted["early"]["endpoints"]
    level, tilted10 = of["yaw_deg"]["first_order"][far][0], of["yaw_deg"]["first_order"][far][2]
    roll = of["roll_deg"]["first_order"][far][2]
    assert tilted10 == pytest.approx(math.hypot(level, roll * math.sin(10.0 * DEG)), rel=0.02)
    cross = of["cross_m"]["first_order"][far]
    assert cross[2] == pytest.approx(cross[0], rel=0.03)


def test_lines_out_of_the_image_have_no_error_and_a_reason(tilted: dict[str, Any]) -> None:
    for stage in ("early", "late"):
        reasons = tilted[stage]["reason"]
        assert any(reason is not None for row in reasons for reason in row)
        for reading in ("endpoints", "edge-points"):
            for of in tilted[stage][reading].values():
                for key in ("p68", "p95", "first_order"):
                    table = np.array(of[key])
                    assert (np.isnan(table) == [[r is not None for r in row] for row in reasons]).all()
    assert tilted["early"]["reason"][0][-1] == "left edge, threshold and right edge not in the image"
    assert tilted["late"]["height_m"] == pytest.approx([8.0, 6.0, 4.0, 2.0])


def test_tilt_is_said_from_its_numbers(tilted: dict[str, Any]) -> None:
    text = tilted["text"]
    assert "66 px at 3° and 223 px at 10°" in text
    assert f"{tilted['threshold_until_m'][1]:.0f} m at 3° and {tilted['threshold_until_m'][2]:.0f} m at 10°" in text


def test_a_path_that_does_not_sink_has_no_late_heights(study: Path) -> None:
    level = load_scenario(study, {"start.flight_path_deg": 0.0, "study.end_height_m": 2.0})
    result = tilt(level, SeedSequence(1), pitches_deg=(0.0, 3.0), early_ranges_m=(400.0,), draws=20)
    assert result["late_heights_not_reached_m"] == [8.0, 6.0, 4.0, 2.0]
    assert result["late"]["range_m"] == []
    assert result["text"]


def test_all_claims_are_json_and_tell_their_progress(scenario: Scenario) -> None:
    calls: list[int] = []

    def told() -> None:
        calls.append(1)

    result = {
        "translations": translations(scenario, SeedSequence(3), draws=100),
        "peers": peers(scenario, SeedSequence(4), draws=50, progress=told),
        "tilt": tilt(scenario, SeedSequence(5), draws=100, progress=told),
    }
    assert all(claim["text"].endswith(".") for claim in result.values())
    json.dumps(as_json(result), allow_nan=False)
    assert len(calls) == 2 * 3 + 2 * (4 + 4)  # ranges of the peers, ranges and heights of the tilt, in either reading


def test_translations_without_noise(study: Path) -> None:
    # nothing over nothing is no ratio; what a wrong rotation does is left
    result = translations(load_scenario(study, {"camera.noise_px": 0.0}), SeedSequence(3), draws=100)
    true = [e for e in result["other_rotation"] if e["rotation"] == "true"]
    assert all(entry["rms"]["coplanarity"]["position_m"] < 1e-6 for entry in true)
    json.dumps(as_json(result), allow_nan=False)
