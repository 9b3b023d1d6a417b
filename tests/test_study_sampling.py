"""Sampled errors: against an independent prototype's table, hand computation and the first-order bound."""

import math
from dataclasses import replace

import numpy as np
import pytest
from approach import PROTOTYPE, RANGES, F, camera_rotation, paper
from numpy.random import SeedSequence, default_rng

from estimator import fit_line
from estimator.so3 import Array
from landsim.scene import runway_of
from landsim.sensors import camera_of
from landsim.study import draws
from landsim.study.draws import draw_line, draw_lines, draw_points, pose_errors
from landsim.study.envelope import child, first_order, joined, percentiles, sampled, sampled_rolls
from landsim.study.frames import Frames, at_distances, look, straight_approach
from landsim.study.model import OF_STAGE, READINGS, Envelope, Reading
from landsim.units import DEG

ROOT2 = math.sqrt(2.0)
DRAWS = 20_000
SHOWN = np.array((DEG, DEG, DEG, 1.0, 1.0, 1.0))


@pytest.fixture(scope="module")
def listed() -> dict[Reading, Envelope]:
    """The early stage at the listed ranges."""
    scenario = paper()
    frames = at_distances(scenario, "early", RANGES)
    return {reading: sampled(scenario, frames, reading, DRAWS, SeedSequence(2011)) for reading in READINGS}


@pytest.mark.parametrize(("distance", "reading"), PROTOTYPE)
def test_prototype_table(listed: dict[Reading, Envelope], distance: float, reading: Reading) -> None:
    envelope = listed[reading]
    row = RANGES.index(distance)
    assert envelope.distance[row] == pytest.approx(distance)
    assert envelope.count[row] == DRAWS
    assert envelope.percentiles[row, :, 0] / SHOWN == pytest.approx(PROTOTYPE[distance, reading], rel=0.05)


@pytest.mark.parametrize("reading", READINGS)
def test_68_percent_are_within_the_first_order_sigma(listed: dict[Reading, Envelope], reading: Reading) -> None:
    envelope = listed[reading]
    assert envelope.percentiles[..., 0] == pytest.approx(envelope.sigma, rel=0.05)


@pytest.mark.parametrize("reading", READINGS)
def test_68_percent_are_within_the_first_order_sigma_late(reading: Reading) -> None:
    scenario = paper()
    frames = at_distances(scenario, "late", (37.0, 0.0, -60.0, -106.0))
    envelope = sampled(scenario, frames, reading, DRAWS, SeedSequence(1))
    assert envelope.percentiles[..., 0] == pytest.approx(envelope.sigma, rel=0.05)
    assert envelope.quantities == ("pitch", "yaw", "cross", "altitude")


def test_tails_at_long_range_are_heavier_than_first_order() -> None:
    # the prototype: at 1000 m with noisy ends the standard deviation of altitude is 6 % above first order
    scenario = paper()
    frames = at_distances(scenario, "early", [1000.0])
    camera = camera_of(scenario.camera)
    fits = draw_lines(frames.ends[0], (0, 1, 2), "endpoints", 1.0, ROOT2, 200_000, default_rng(5))
    altitude = pose_errors(camera, frames, 0, fits, 30.0)[:, 4]
    sigma = first_order(camera, frames, "endpoints", 1.0, ROOT2, 30.0)[0, 4]
    assert altitude.std() / sigma == pytest.approx(1.06, abs=0.015)


def test_percentiles_are_order_statistics() -> None:
    errors = default_rng(0).permutation(np.arange(1.0, 1001.0))
    errors[::2] *= -1.0
    assert percentiles(np.stack((errors, 2.0 * errors), axis=-1)) == pytest.approx(
        np.array(((683.0, 950.0, 998.0), (1366.0, 1900.0, 1996.0)))
    )
    assert percentiles([[-3.0]]) == pytest.approx(np.full((1, 3), 3.0))
    assert np.isnan(percentiles(np.empty((0, 2)))).all()


def test_a_draw_without_a_solution_is_infinitely_wrong() -> None:
    errors = np.linspace(0.0, 1.0, 1000)[:, None]
    errors[100:160] = math.nan
    p68, p95, p99 = percentiles(errors)[0]
    assert math.isfinite(p68)
    assert p95 == p99 == math.inf


def test_points_are_spread_over_the_line_with_the_noise_asked_for() -> None:
    ends = np.array((10.0, 20.0, 70.5, 101.0))  # 101.1 px long
    points = draw_points(ends, "edge-points", 1.0, 0.5, 20_000, default_rng(1))
    assert points.shape == (20_000, 102, 2)
    clean = np.stack((np.linspace(10.0, 70.5, 102), np.linspace(20.0, 101.0, 102)), axis=-1)
    noise = points - clean
    # 20,000 × 204 numbers: a standard deviation is known to 0.04 %
    assert noise.std() == pytest.approx(0.5, rel=0.002)
    assert noise.std(axis=0) == pytest.approx(0.5, rel=0.03)
    assert np.abs(noise.mean(axis=0)).max() < 5.0 * 0.5 / math.sqrt(20_000)
    products = np.corrcoef(noise.reshape(20_000, -1)[:, :40].T) - np.eye(40)
    assert np.abs(products).max() < 6.0 / math.sqrt(20_000)
    assert draw_points(ends, "endpoints", 1.0, 0.0, 2, default_rng(1)) == pytest.approx(
        np.array((((10.0, 20.0), (70.5, 101.0)),) * 2)
    )
    assert draw_points(ends, "edge-points", 3.0, 1.0, 1, default_rng(1)).shape == (1, 34, 2)


@pytest.mark.parametrize("block", [1, 1000, 10**9])
def test_blocks_decide_nothing(monkeypatch: pytest.MonkeyPatch, block: int) -> None:
    ends = np.array((10.0, 20.0, 70.5, 101.0))
    expected = fit_line(draw_points(ends, "edge-points", 1.0, 0.5, 50, default_rng(1)))
    monkeypatch.setattr(draws, "BLOCK", block)
    fit = draw_line(ends, "edge-points", 1.0, 0.5, 50, default_rng(1))
    assert fit.line == pytest.approx(expected.line, rel=1e-12)
    assert fit.centroid == pytest.approx(expected.centroid, rel=1e-12)
    assert fit.spread == pytest.approx(expected.spread, rel=1e-12)
    assert fit.points == expected.points == 102


def test_a_line_that_is_not_seen_has_no_points() -> None:
    with pytest.raises(ValueError, match="not seen"):
        draw_points(np.full(4, np.nan), "endpoints", 1.0, 1.0, 5, default_rng(1))


def _clean_errors(frames: Frames, i: int, roll_error: float = 0.0) -> Array:
    scenario = paper()
    which = (0, 1, 2) if frames.stage == "early" else (0, 2)
    fits = draw_lines(frames.ends[i], which, "edge-points", 1.0, 0.0, 3, default_rng(1))
    return pose_errors(camera_of(scenario.camera), frames, i, fits, 30.0, roll_error)


def test_without_noise_there_is_no_error() -> None:
    for frames in straight_approach(paper()):
        for i in (0, len(frames) // 2, len(frames) - 1):
            assert np.abs(_clean_errors(frames, i)).max() < 1e-7


def test_errors_are_estimate_less_truth_in_the_order_of_the_quantities() -> None:
    frames = at_distances(paper(), "early", [300.0])
    # the lines are those of the true pose, so that a truth put elsewhere is off by just so much
    moved = replace(
        frames,
        position=frames.position + np.array((7.0, -2.0, 1.5)),
        R_cam_from_runway=camera_rotation(0.02, -3.0 * DEG + 0.03, -0.04)[None],
    )
    expected = {"roll": 0.04, "pitch": -0.03, "yaw": -0.02, "cross": 2.0, "altitude": 1.5, "along": -7.0}
    assert _clean_errors(moved, 0)[0] == pytest.approx([expected[name] for name in OF_STAGE["early"]], abs=1e-9)


@pytest.mark.parametrize(("height", "shift"), [(9.6, 0.12), (2.0, 0.4)])
def test_a_roll_error_moves_the_late_stage_sideways(height: float, shift: float) -> None:
    # (h + L²/(4h)) δ, δ about the runway's x axis and the roll about an optical axis 10° below it: 0.2° costs 0.12 m at
    # 9.6 m and 0.4 m at 2 m.  Undoing a roll to the right that is not there turns the image clockwise: the runway seems
    # to lie to the left, and the camera to the right of it
    frames = at_distances(paper(), "late", [(height - 60.0) / math.tan(3.0 * DEG) + 1000.0])
    assert frames.height[0] == pytest.approx(height)
    _, _, cross, _ = _clean_errors(frames, 0, 0.2 * DEG)[0]
    by_hand = (height + 900.0 / (4.0 * height)) * 0.2 * DEG * math.cos(10.0 * DEG)
    assert cross == pytest.approx(by_hand, rel=1e-3)
    assert cross == pytest.approx(shift, rel=0.07)


@pytest.mark.parametrize("angle", ["yaw", "roll"])
def test_angles_are_wrapped(angle: str) -> None:
    # seen at -0.05, true at π - 0.01: the difference of -π - 0.04 is π - 0.04
    scenario = paper()
    frames = at_distances(scenario, "early", [300.0])

    def at(value: float) -> Array:
        yaw, roll = (value, 0.0) if angle == "yaw" else (0.0, value)
        return camera_rotation(yaw, -3.0 * DEG, roll)

    ends = look(camera_of(scenario.camera), runway_of(scenario), frames.position[0], at(-0.05), 1.0, 8.0)
    turned = replace(frames, R_cam_from_runway=at(math.pi - 0.01)[None], ends=ends[None])
    column = OF_STAGE["early"].index(angle)
    assert _clean_errors(turned, 0)[:, column] == pytest.approx(math.pi - 0.04, abs=1e-9)


@pytest.mark.parametrize("stage", ["early", "late"])
def test_first_order_of_any_attitude_is_the_limit_of_small_noise(stage: str) -> None:
    # a camera that rolls, yaws and is off the centreline; 20,000 draws tell a sigma to 0.5 %
    scenario = paper(start__cross_m=12.0)
    frames = at_distances(scenario, "early" if stage == "early" else "late", [150.0])
    rotation = camera_rotation(-0.06, -4.0 * DEG, 0.3)
    corners = np.array(((0.0, -15.0, 0.0), (300.0, -15.0, 0.0), (0.0, 15.0, 0.0), (300.0, 15.0, 0.0)))
    in_cam = (corners - frames.position[0]) @ rotation.T
    pixels = F * in_cam[:, :2] / in_cam[:, 2:] + np.array((328.5, 246.5))
    ends = np.stack([np.concatenate((pixels[i], pixels[j])) for i, j in ((0, 1), (0, 2), (2, 3))])
    frames = replace(frames, R_cam_from_runway=rotation[None], ends=ends[None])
    camera = camera_of(scenario.camera)
    for reading in READINGS:
        which = (0, 1, 2) if stage == "early" else (0, 2)
        fits = draw_lines(ends, which, reading, 2.0, 0.01, 20_000, default_rng(3))
        errors = pose_errors(camera, frames, 0, fits, 30.0)
        assert np.abs(errors.mean(axis=0)).max() < 0.05
        assert errors.std(axis=0) == pytest.approx(first_order(camera, frames, reading, 2.0, 0.01, 30.0)[0], rel=0.025)


def _same(a: Envelope, b: Envelope) -> None:
    for name in ("distance", "time", "height", "count", "percentiles", "sigma", "single"):
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True), name


def test_the_frames_may_be_split_in_any_way() -> None:
    scenario = paper()
    frames = straight_approach(scenario)[1]
    seed = SeedSequence(7, spawn_key=(3,))
    whole = sampled(scenario, frames[:9], "edge-points", 100, seed)
    parts = [sampled(scenario, frames, "edge-points", 100, seed, indices=i) for i in ((4, 5, 6, 7, 8), (0, 2), (1, 3))]
    _same(joined(parts), whole)
    assert seed.n_children_spawned == 0
    assert child(seed, 4).generate_state(4).tolist() == seed.spawn(5)[4].generate_state(4).tolist()
    # frames do not share their noise
    assert np.unique(whole.single[:, 0] / whole.sigma[:, 0]).size == 9


def test_several_roll_errors_come_from_the_same_lines() -> None:
    scenario = paper()
    frames = at_distances(scenario, "late", (30.0, -100.0))
    rolls = (0.0, 0.1 * DEG, -0.3 * DEG)
    together = sampled_rolls(scenario, frames, "endpoints", 200, SeedSequence(1), rolls)
    for roll, envelope in zip(rolls, together, strict=True):
        _same(envelope, sampled(scenario, frames, "endpoints", 200, SeedSequence(1), roll_error=roll))
        assert envelope.roll_error == roll
    assert (together[2].percentiles[:, 2, 1] > together[0].percentiles[:, 2, 1]).all()
    with pytest.raises(ValueError, match="no roll angle"):
        sampled(scenario, at_distances(scenario, "early", [400.0]), "endpoints", 10, SeedSequence(1), roll_error=0.1)


def test_noise_and_spacing_may_be_given() -> None:
    scenario = paper()
    frames = at_distances(scenario, "early", [400.0])
    seed = SeedSequence(1)
    plain = sampled(scenario, frames, "edge-points", 4000, seed)
    loud = sampled(scenario, frames, "edge-points", 4000, seed, noise_px=2.0 * ROOT2)
    dense = sampled(scenario, frames, "edge-points", 4000, seed, spacing_px=0.25)
    assert loud.percentiles[0, :, 0] == pytest.approx(2.0 * plain.percentiles[0, :, 0], rel=0.06)
    assert dense.percentiles[0, :, 0] == pytest.approx(0.5 * plain.percentiles[0, :, 0], rel=0.06)
    assert loud.sigma == pytest.approx(2.0 * plain.sigma)


def test_where_a_line_is_not_seen_there_is_no_error() -> None:
    scenario = paper()
    frames = at_distances(scenario, "early", (400.0, 30.0))
    envelope = sampled(scenario, frames, "endpoints", 100, SeedSequence(1))
    assert envelope.count.tolist() == [100, 0]
    for values in (envelope.percentiles, envelope.sigma, envelope.single):
        assert np.isfinite(values[0]).all()
        assert np.isnan(values[1]).all()


def test_only_parts_of_one_envelope_are_joined(listed: dict[Reading, Envelope]) -> None:
    with pytest.raises(ValueError, match="only envelopes of one stage"):
        joined(list(listed.values()))
    with pytest.raises(ValueError, match="only envelopes of one stage"):
        joined([])
