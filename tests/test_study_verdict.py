"""The verdict of a study: what is judged of an envelope, and what is said of it.

=======================  =========================================================================================
judgement                an envelope of powers of the distance, whose crossings are found by hand
words                    hand-made verdicts
what roll does           the formula of the paper's geometry; scipy's folded normal distribution
proportions              an independent prototype's percentiles
=======================  =========================================================================================
"""

import io
import math
from typing import Any

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng
from rich.console import Console
from scipy.stats import foldnorm

from estimator.so3 import Array
from landsim.config import Scenario, load_scenario
from landsim.sensors import camera_of
from landsim.state import Stage
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.envelope import first_order
from landsim.study.evidence import equally_tight, flights_entry, meeting_entries, roll_entries, shift_entries
from landsim.study.flights import FlownErrors
from landsim.study.frames import LINES_OF_STAGE, Frames, at_distances, straight_approach
from landsim.study.geometry import (
    GREATEST_ROLL,
    RollLimit,
    biased_percentile,
    lateral_shift,
    proportions,
    roll_bias,
    roll_limit,
)
from landsim.study.judged import bounds_of, entries_of
from landsim.study.markdown import verdict_md
from landsim.study.model import LEVELS, NORMAL, OF_STAGE, Envelope, Reading, Source, StageName, chance, enough
from landsim.study.paragraphs import closest, figure, fused, meeting, paragraphs_of, roll
from landsim.study.precision import Precision
from landsim.study.verdict import verdict_of
from landsim.tables import study_tables
from landsim.units import DEG

DISTANCE = np.arange(1000.0, 39.0, -10.0)
RANGES = (1000.0, 400.0, 100.0, 60.0)


def study(**overrides: object) -> Scenario:
    keys: dict[str, object] = {"study.ranges_m": list(RANGES), "study.flights": 0}
    return load_scenario("paper-fig3", keys | overrides)


def envelope(
    p95_at_1000: dict[str, float],
    power: float = 1.0,
    reading: Reading = "edge-points",
    source: Source = "vision",
    distance: Array = DISTANCE,
    stage: StageName = "early",
    count: int = 20_000,
) -> Envelope:
    """p95 = its value at 1000 m × (distance / 1000 m)^power, Gaussian; quantities that are left out have 1e-6."""
    names = OF_STAGE[stage]
    p95 = np.stack([p95_at_1000.get(name, 1e-6) * (distance / 1000.0) ** power for name in names], axis=-1)
    sigma = p95 / NORMAL[1]
    return Envelope(
        stage=stage,
        reading=reading,
        source=source,
        roll_error=0.0,
        quantities=names,
        distance=distance,
        time=(1000.0 - distance) / 40.0,
        height=7.6 + 0.0524 * distance,
        count=np.full(distance.shape, count),
        percentiles=sigma[..., None] * np.array(NORMAL),
        sigma=sigma,
        single=0.5 * sigma,
    )


def entry(entries: list[dict[str, Any]], quantity: str, reading: str = "edge-points") -> dict[str, Any]:
    (found,) = (e for e in entries if e["quantity"] == quantity and e["reading"] == reading)
    return found


class TestJudgement:
    def test_the_range_from_which_a_bound_holds(self) -> None:
        # 2 m at 1000 m and in proportion to the distance: 0.5 m at 250 m
        entries = entries_of(study(), [envelope({"cross": 2.0, "along": 20.0}, 1.0)], [], [])
        cross = entry(entries, "cross")
        assert (cross["bound"], cross["unit"], cross["holds"]) == (0.5, "m", False)
        assert cross["holds_from_m"] == pytest.approx(250.0, rel=1e-6)
        assert cross["holds_from_m_at_68"] == pytest.approx(250.0 * NORMAL[1] / NORMAL[0], rel=1e-6)
        assert entry(entries, "along")["holds_from_m"] == pytest.approx(500.0, rel=1e-6)
        assert (cross["judged_from_m"], cross["judged_to_m"]) == (1000.0, 40.0)

    def test_angles_are_judged_in_degrees(self) -> None:
        entries = entries_of(study(), [envelope({"yaw": 0.4 * DEG}, 2.0)], [], [])
        yaw = entry(entries, "yaw")
        assert yaw["listed"][0]["p95"] == pytest.approx(0.4)
        assert yaw["listed"][1]["p95"] == pytest.approx(0.4 * 0.16)
        assert yaw["holds_from_m"] == pytest.approx(500.0, rel=1e-6)  # 0.4 (d/1000)² = 0.1

    def test_holds_means_from_the_first_range_to_the_end(self) -> None:
        entries = entries_of(study(), [envelope({"cross": 0.499, "altitude": 0.501})], [], [])
        assert entry(entries, "cross")["holds"] is True
        assert entry(entries, "cross")["holds_from_m"] == 1000.0
        assert entry(entries, "altitude")["holds"] is False

    def test_a_bound_that_is_broken_at_the_end_holds_from_nowhere(self) -> None:
        entries = entries_of(study(), [envelope({"cross": 0.1}, -1.0)], [], [])  # 2.5 m at 40 m
        assert (entry(entries, "cross")["holds"], entry(entries, "cross")["holds_from_m"]) == (False, None)

    def test_listed_draws_can_take_a_verdict_back(self) -> None:
        """Few draws a frame may pass by chance what many at a listed range do not."""
        listed = envelope({"cross": 0.52}, distance=np.array(RANGES))
        entries = entries_of(study(), [envelope({"cross": 0.49})], [listed], [])
        assert entry(entries, "cross")["holds"] is False
        assert entry(entries, "cross")["listed"][0]["p95"] == pytest.approx(0.52)

    def test_no_solution_keeps_no_bound(self) -> None:
        whole = envelope({"cross": 0.1})
        whole.percentiles[:3, OF_STAGE["early"].index("cross")] = math.inf
        cross = entry(entries_of(study(), [whole], [], []), "cross")
        assert cross["holds"] is False
        assert cross["holds_from_m"] == pytest.approx(970.0, abs=10.0)
        assert cross["listed"][0]["p95"] is None
        assert cross["listed"][0]["no_limit"] == ["p68", "p95", "p99_7"]
        assert cross["first_order_left"] == {key: [1000.0] for key in ("p68", "p95", "p99_7")}

    def test_few_have_no_far_percentile(self) -> None:
        """Of 100 the 99.73rd percentile would be the largest, of 19 the 95th."""
        for count, there in (
            (371, [True] * 3),
            (370, [True, True, False]),
            (20, [True, True, False]),
            (19, [True, False, False]),
        ):
            assert [bool(enough(count, level)) for level in LEVELS] == there
            listed = envelope({"cross": 0.1}, distance=np.array(RANGES), count=count)
            listed.percentiles[:, :, 2] = math.inf
            (row, *_) = entry(entries_of(study(), [envelope({})], [listed], []), "cross")["listed"]
            assert [row[key] is not None for key in ("p68", "p95")] == there[:2]
            assert row["no_limit"] == (["p99_7"] if there[2] else [])
        flown = entry(entries_of(study(), [envelope({"cross": 0.1}, source="fused", count=19)], [], []), "cross")
        assert (flown["holds"], flown["holds_from_m"], flown["holds_from_m_at_68"]) == (None, None, None)
        flown = entry(entries_of(study(), [envelope({"cross": 0.1}, source="fused", count=20)], [], []), "cross")
        assert (flown["holds"], flown["holds_from_m"]) == (True, 1000.0)

    def test_chance_of_a_percentile(self) -> None:
        found = np.quantile(np.abs(default_rng(3).standard_normal((4000, 400))), 0.95, axis=1)
        assert float(chance(400, 95.0)) == pytest.approx(found.std() / found.mean(), rel=0.05)

    def test_flights_are_judged_from_where_every_one_has_a_solution(self) -> None:
        fused = envelope({"cross": 2.0}, source="fused", count=100)
        fused.count[:3] = 0, 1, 99
        fused.count[-2:] = 60  # the others have handed over
        fused.percentiles[0] = math.nan
        reached = np.full(DISTANCE.size, 100)
        reached[-2:] = 60
        factor = np.abs(default_rng(5).standard_normal(100))
        size = np.repeat(np.outer(factor, DISTANCE * 1e-3)[..., None], len(OF_STAGE["early"]), axis=-1)
        behind = FlownErrors("early", "edge-points", "fused", DISTANCE, size, reached)
        cross = entry(entries_of(study(), [fused], [], [], [behind], SeedSequence(1)), "cross")
        assert (cross["judged_from_m"], cross["judged_to_m"], cross["judged_count"]) == (970.0, 40.0, 60)
        assert cross["holds_from_m"] == pytest.approx(250.0, rel=1e-6)
        low, high = cross["holds_from_interval_m"]
        assert 500.0 / factor.max() <= low < high <= 500.0 / np.sort(factor)[87]
        vision = entry(entries_of(study(), [envelope({"cross": 2.0})], [], [], [behind], SeedSequence(1)), "cross")
        assert vision["holds_from_interval_m"] is None

    def test_fused_is_judged_from_where_it_begins(self) -> None:
        late_start = envelope({"cross": 0.1}, source="fused", count=100)
        late_start.percentiles[:2] = math.nan
        late_start.count[:2] = 0
        entries = entries_of(study(), [late_start], [], [])
        cross = entry(entries, "cross")
        assert (cross["judged_from_m"], cross["holds"], cross["holds_from_m"]) == (980.0, True, 980.0)
        assert (cross["listed"][0]["p95"], cross["listed"][0]["count"]) == (None, 0)
        assert cross["first_order_left"] is None

    def test_nothing_at_all_is_not_judged(self) -> None:
        nothing = envelope({})
        nothing.percentiles[:] = math.nan
        cross = entry(entries_of(study(), [nothing], [], []), "cross")
        assert (cross["holds"], cross["judged_from_m"]) == (None, None)

    def test_where_the_tails_leave_first_order(self) -> None:
        listed = envelope({"cross": 2.0}, distance=np.array(RANGES))
        listed.percentiles[0, OF_STAGE["early"].index("cross"), 2] *= 1.06
        listed.percentiles[1, OF_STAGE["early"].index("cross"), 2] *= 1.04
        cross = entry(entries_of(study(), [envelope({"cross": 2.0})], [listed], []), "cross")
        assert cross["first_order_left"] == {"p68": [], "p95": [], "p99_7": [1000.0]}
        assert cross["listed"][0]["p99_7_over_first_order"] == pytest.approx(1.06)

    def test_few_draws_leave_it_by_chance(self) -> None:
        listed = envelope({"cross": 2.0}, distance=np.array(RANGES), count=100)
        listed.percentiles[:] *= 1.06
        cross = entry(entries_of(study(), [envelope({"cross": 2.0})], [listed], []), "cross")
        assert cross["first_order_left"] == {"p68": [], "p95": [], "p99_7": []}

    def test_normal_percentiles(self) -> None:
        draws = np.abs(default_rng(0).standard_normal(400_000))
        np.testing.assert_allclose(np.percentile(draws, LEVELS), NORMAL, rtol=0.01)

    def test_bounds_of_the_late_stage(self) -> None:
        settings = load_scenario("paper-flight").study
        assert settings is not None
        assert bounds_of(settings, "early", OF_STAGE["early"]) == pytest.approx(
            {"roll": 0.8 * DEG, "pitch": 0.1 * DEG, "yaw": 0.1 * DEG, "cross": 0.5, "altitude": 0.5, "along": 10.0}
        )
        assert bounds_of(settings, "late", OF_STAGE["late"]) == pytest.approx(
            {"pitch": 0.1 * DEG, "yaw": 0.1 * DEG, "cross": 0.2, "altitude": 0.2}
        )


class TestMeeting:
    def test_range_times_angle(self) -> None:
        """0.5 m / 0.1°, by hand: 0.5 × 180 / (0.1 π)."""
        settings = study().study
        assert settings is not None
        found = meeting_entries(settings, [envelope({})])
        assert [(m["position"], m["angle"]) for m in found] == [("cross", "yaw"), ("altitude", "pitch")]
        assert found[0]["range_m"] == pytest.approx(286.479, abs=1e-3)
        assert found[0]["angle_asked_deg"] == pytest.approx(math.degrees(0.5 / 1000.0))

    def test_equally_tight_where_the_ratio_of_the_errors_is_that_of_the_bounds(self) -> None:
        # cross over yaw is 1.25 times the range: 0.5 m / 0.1° / 1.25
        one = envelope({"yaw": 0.1 * DEG}, 0.0)
        names = OF_STAGE["early"]
        cross = 1.25 * DISTANCE * 0.1 * DEG
        one.percentiles[:, names.index("cross"), 1] = cross
        bounds = {"cross": 0.5, "yaw": 0.1 * DEG}
        assert equally_tight(one, bounds, "cross", "yaw") == pytest.approx(286.479 / 1.25, rel=0.02)

    def test_not_without_a_bound(self) -> None:
        settings = load_scenario("paper-fig4").study
        assert settings is not None
        assert meeting_entries(settings, []) == []
        assert equally_tight(envelope({}), {"cross": 0.5}, "cross", "yaw") is None

    def test_proportions_of_the_prototype(self) -> None:
        """Percentiles of an independent prototype at 1000 and 200 m, endpoints: cross, yaw, altitude, pitch."""
        far, near = proportions(study(), "endpoints", [1000.0, 200.0], 5000, SeedSequence(1))
        assert far.cross_over_yaw == pytest.approx(3.82 / (0.176 * DEG) / 1000.0, rel=0.06)
        assert near.cross_over_yaw == pytest.approx(0.455 / (0.0732 * DEG) / 200.0, rel=0.06)
        assert far.altitude_over_pitch == pytest.approx(6.89 / (0.296 * DEG) / 1000.0, rel=0.06)
        assert near.altitude_over_pitch == pytest.approx(0.386 / (0.0783 * DEG) / 200.0, rel=0.06)
        assert abs(far.cross_yaw_correlation) > abs(near.cross_yaw_correlation) > 0.5

    @pytest.mark.parametrize(
        ("pitch_deg", "cross_yaw", "cross_roll", "yaw_roll"), [(0.0, 0.15, 0.83, 0.0), (-3.0, 0.99, 0.84, 0.88)]
    )
    def test_the_cross_error_is_roll_and_the_yaw_takes_it_up_by_its_tilt(
        self, pitch_deg: float, cross_yaw: float, cross_roll: float, yaw_roll: float
    ) -> None:
        """Shares of variance at 1000 m, edge-points, by another script's draws on hand-built geometry."""
        scenario = study(**{"study.pitch_early_deg": pitch_deg})
        (found,) = proportions(scenario, "edge-points", [1000.0], 4000, SeedSequence(2))
        assert found.cross_yaw_correlation**2 == pytest.approx(cross_yaw, abs=0.05)
        assert found.cross_roll_correlation**2 == pytest.approx(cross_roll, abs=0.03)
        assert found.yaw_roll_correlation**2 == pytest.approx(yaw_roll, abs=0.03)
        assert math.degrees(found.sight) == pytest.approx(math.degrees(math.atan(0.06)))


class TestRoll:
    def test_shift_of_the_paper_s_geometry(self) -> None:
        """0.2° costs 0.12 m at 9.6 m and 0.4 m at 2 m over a 30 m runway."""
        assert lateral_shift(9.6, 30.0, 0.2 * DEG) == pytest.approx(0.115, abs=0.005)
        assert lateral_shift(2.0, 30.0, 0.2 * DEG) == pytest.approx(0.4, abs=0.005)

    def test_the_solver_is_shifted_as_the_formula_says(self) -> None:
        frames = at_distances(load_scenario("paper-fig4"), "late", [35.0, 0.0, -100.0])
        for angle in (0.02, -0.2):
            bias = roll_bias(load_scenario("paper-fig4"), frames, angle * DEG)
            np.testing.assert_allclose(
                np.abs(bias[:, OF_STAGE["late"].index("cross")]),
                lateral_shift(frames.height, 30.0, abs(angle) * DEG),
                rtol=0.02,
            )
        np.testing.assert_allclose(roll_bias(load_scenario("paper-fig4"), frames, 0.0), 0.0, atol=1e-9)

    @pytest.mark.parametrize("bias", [0.0, 0.3, -2.0])
    def test_percentile_of_a_biased_normal(self, bias: float) -> None:
        expected = foldnorm.ppf(0.95, abs(bias) / 0.7, scale=0.7)
        assert biased_percentile(bias, 0.7) == pytest.approx(expected, rel=1e-9)
        assert biased_percentile(bias, 0.0) == abs(bias)

    def test_limit(self) -> None:
        """At 2 m one radian of roll moves the cross estimate by 114.5 m: nearly all of 0.2 m is for the bias."""
        scenario = load_scenario("paper-fig4")
        _, late = straight_approach(scenario)
        quiet = np.full((len(late), len(OF_STAGE["late"])), 1e-6)
        noiseless = scenario.model_copy(update={"camera": scenario.camera.model_copy(update={"noise_px": 1e-6})})
        limit = roll_limit(noiseless, late, quiet, "cross", 0.2, "edge-points", 100, SeedSequence(0))
        assert limit.roll_error == pytest.approx(0.2 / 113.8, rel=0.02)
        assert limit.height == pytest.approx(2.0, abs=0.05)
        assert limit.ratio == pytest.approx(1.0, abs=0.01)

    def test_no_limit_where_noise_alone_breaks_the_bound(self) -> None:
        limit = limit_of("cross", 0.2, "endpoints", {"camera.noise_px": 10.0}, 200)
        assert (limit.roll_error, limit.beyond, limit.no_solution, limit.confirmed) == (None, False, False, True)
        assert limit.ratio > 1.0

    def test_a_limit_beyond_what_is_looked_at(self) -> None:
        limit = limit_of("altitude", 50.0, "edge-points", {"study.end_height_m": 8.0}, 200)
        assert (limit.roll_error, limit.beyond, limit.no_solution) == (GREATEST_ROLL, True, False)

    @pytest.mark.parametrize(("cross", "bound_deg"), [(0.0, 1.0), (0.0, 20.0), (6.0, 5.0)])
    def test_limited_by_no_solution(self, cross: float, bound_deg: float) -> None:
        """By hand: turned by atan(h / (L/2 + |y|)) about the runway's axis, the far edge's plane is level.

        The roll turns about the camera's axis, 10° down from it: the more of it is needed, by 1 / cos 10°.
        """
        over = {"start.cross_m": cross, "camera.noise_px": 0.01}
        limit = limit_of("pitch", bound_deg * DEG, "endpoints", over, 200)
        level = math.atan(limit.height / (15.0 + cross)) / math.cos(10.0 * DEG)
        assert limit.roll_error == pytest.approx(level, rel=0.01)
        assert (limit.beyond, limit.no_solution, limit.confirmed) == (False, True, True)
        assert limit.height == pytest.approx(2.0, abs=0.05)  # at the end, where the camera is lowest
        assert limit.ratio < 1.0
        (entry_,) = roll_entries([limit])
        assert (entry_["holds_beyond"], entry_["limited_by"]) == (False, "no solution")

    @pytest.mark.parametrize("cross", [0.0, 6.0])
    @pytest.mark.parametrize(("quantity", "bound"), [("pitch", 0.1 * DEG), ("altitude", 0.4), ("yaw", 2.0 * DEG)])
    def test_the_bound_holds_to_the_end_either_way(self, cross: float, quantity: str, bound: float) -> None:
        """Other draws, in the frames at both ends of the stage: at the limit it holds, by 3 % more it does not."""
        over = {"start.cross_m": cross, "camera.noise_px": 0.2}
        limit = limit_of(quantity, bound, "endpoints", over, 4000)
        assert limit.roll_error is not None
        assert limit.confirmed
        assert kept(quantity, bound, over, limit.roll_error) >= 0.95 - 0.015
        assert kept(quantity, bound, over, 1.03 * limit.roll_error) < 0.95

    def test_the_worse_sign_counts(self) -> None:
        """6 m off the centreline, 2° one way cost far more altitude than the other way: by the solver alone."""
        scenario, late = late_stage({"start.cross_m": 6.0})
        column = OF_STAGE["late"].index("altitude")
        one, other = (abs(roll_bias(scenario, late[-1:], sign * 2.0 * DEG)[0, column]) for sign in (1.0, -1.0))
        assert max(one, other) > 1.5 * min(one, other)
        quiet = {"start.cross_m": 6.0, "camera.noise_px": 1e-3}
        limit = limit_of("altitude", max(one, other), "endpoints", quiet, 100)
        assert limit.roll_error == pytest.approx(2.0 * DEG, rel=0.01)

    @pytest.mark.parametrize(
        ("quantity", "bound"),
        [("altitude", 1.9), ("cross", 14.8), ("yaw", 2.0 * DEG), ("cross", 1e-6), ("altitude", 0.1503), ("pitch", 1e3)],
    )
    def test_any_bound_has_an_answer(self, quantity: str, bound: float) -> None:
        limit = limit_of(quantity, bound, "endpoints", {}, 300)
        assert limit.roll_error is None or 0.0 <= limit.roll_error < 8.0 * DEG
        assert not math.isnan(limit.ratio)
        assert roll({"roll_shifts": [], "roll_limits": roll_entries([limit])}).startswith("With `endpoints` ")

    def test_no_shift_without_a_solution(self) -> None:
        (one,) = shift_entries(load_scenario("paper-fig4"), [(-106.0, 2.0, 20.0 * DEG, math.nan)])
        assert one["measured_m"] is None
        assert roll({"roll_shifts": [one], "roll_limits": []}) == ""


def late_stage(overrides: dict[str, Any]) -> tuple[Scenario, Frames]:
    scenario = load_scenario("paper-fig4", overrides)
    _, late = straight_approach(scenario)
    return scenario, late[late.seen()]


def limit_of(quantity: str, bound: float, reading: Reading, overrides: dict[str, Any], draws: int) -> RollLimit:
    scenario, late = late_stage(overrides)
    c = scenario.camera
    sigma = first_order(camera_of(c), late, reading, c.point_spacing_px, c.noise_px, scenario.runway.width_m)
    return roll_limit(scenario, late, sigma, quantity, bound, reading, draws, SeedSequence(0))


def kept(quantity: str, bound: float, overrides: dict[str, Any], roll_error: float) -> float:
    """Least share of the draws within a bound, in the first and last frame and for both signs."""
    scenario, late = late_stage(overrides)
    c, rng, shares = scenario.camera, default_rng(99), []
    for i in (0, len(late) - 1):
        for sign in (1.0, -1.0):
            fits = draw_lines(late.ends[i], LINES_OF_STAGE["late"], "endpoints", 1.0, c.noise_px, 4000, rng)
            errors = pose_errors(camera_of(c), late, i, fits, 30.0, sign * roll_error)
            shares.append(float(np.mean(np.abs(errors[:, OF_STAGE["late"].index(quantity)]) <= bound)))
    return min(shares)


def precision(quantity: str, reading: Reading, noise_px: float, spacing_px: float | None) -> Precision:
    return Precision(
        stage="early",
        reading=reading,
        quantity=quantity,
        bound=0.5,
        noise_px=noise_px,
        spacing_px=spacing_px,
        ends_suffice=False,
        first_order=noise_px,
        distance=1000.0,
        points=(400, 300, 400) if spacing_px else (2, 2, 2),
        checked=(1000.0,),
        draws=20_000,
        p95=0.499,
        within=0.951,
        within_interval=(0.948, 0.954),
        confirmed=True,
    )


@pytest.fixture(scope="module")
def verdict() -> dict[str, Any]:
    """Two readings that fall with the distance; edge-points keeps everything but cross, which holds from 250 m."""
    good = envelope({"cross": 2.0, "altitude": 0.4})
    poor = envelope({"cross": 4.0, "altitude": 4.0}, reading="endpoints")
    poor.percentiles[:, OF_STAGE["early"].index("yaw")] = 1.0 * DEG
    filtered = envelope({"cross": 0.3}, source="fused", count=70)
    filtered.percentiles[:2] = math.nan
    filtered.count[:2] = 0
    made = verdict_of(
        study(),
        3,
        [poor, good, filtered],
        [],
        precisions=[
            precision("cross", "edge-points", 1.4, 0.125),
            precision("cross", "endpoints", 0.0625, None),
        ],
        shifts=[(35.0, 9.5, 0.2 * DEG, -0.115), (-106.0, 2.0, 0.2 * DEG, -0.4)],
    )
    made["flights"] = {
        "edge-points": {
            "flights": 7,
            "first_seed": 3,
            "last_seed": 9,
            "outcomes": {"crashed": 1, "landed": 6},
            "fused_from_m": 990.0,
            "fused_in_all_from_m": 980.0,
            "late_roll": [{"range_m": 0.0, "flights": 7, "p95_deg": 0.03125}],
        }
    }
    made["roll_limits"] = [
        {
            "quantity": name,
            "reading": "edge-points",
            "unit": unit,
            "bound": bound,
            "roll_error_deg": limit,
            "holds_beyond": False,
            "limited_by": "bound",
            "at_range_m": -106.0,
            "at_height_m": 2.0,
            "p95_over_bound": 1.004,
            "draws": 20_000,
            "checked_at_m": [-106.0],
            "confirmed": True,
        }
        for name, unit, bound, limit in (("cross", "m", 0.2, 0.0625), ("yaw", "deg", 0.1, None))
    ]
    made["proportions"] = [
        {
            "reading": "endpoints",
            "range_m": distance,
            "cross_over_range_times_yaw": ratio,
            "altitude_over_range_times_pitch": None,
            "cross_yaw_correlation": tied,
            "altitude_pitch_correlation": None,
            "cross_roll_correlation": 0.8,
            "yaw_roll_correlation": -0.7,
            "sight_line_down_deg": 3.43,
            "optical_axis_down_deg": 3.0,
        }
        for distance, ratio, tied in ((1000.0, 1.25, -0.9), (60.0, 1.875, -0.5))
    ]
    made["paragraphs"] = paragraphs_of(made)
    made["claims"] = {"tilt": {"text": "What tilt buys."}, "timing": {"text": ""}}
    made["versions"] = {"landsim": "1.2.3"}
    return made


class TestWords:
    def test_which_reading_comes_closest(self, verdict: dict[str, Any]) -> None:
        text = closest(verdict, "early")
        assert text.startswith("Of the readings `edge-points` comes closest to the bounds of the early stage.")
        assert "times the bound with `edge-points`. At 95 % with `edge-points` all bounds hold from 250 m on" in text
        assert "At 1000 m the 95th percentile is 2e-06" not in text
        assert "to 4 (cross) times the bound with `edge-points`" in text  # 2 m over 0.5 m
        assert "to 10 (yaw) times the bound with `endpoints`" in text  # 1° over 0.1°
        assert "yaw does not hold at the end of the early stage" in text
        assert "With the noise as stated no reading meets all bounds from 1000 m on." in text

    def test_what_it_would_take_is_said_when_all_is_solved(self, verdict: dict[str, Any]) -> None:
        assert "it would take" not in closest(verdict, "early")  # five of six bounds have no solution here
        only = verdict | {"entries": [e for e in verdict["entries"] if e["quantity"] == "cross"]}
        text = closest(only, "early")
        assert "0.0625 px at each end of a line (`endpoints`), because of cross" in text
        assert "points 0.125 px apart (`edge-points`), that is 300 and 400 on the lines, because of cross" in text

    def test_where_bounds_meet(self, verdict: dict[str, Any]) -> None:
        text = meeting(verdict)
        assert "bounds of 0.1° and 0.5 m ask the same at 0.5 m / 0.1° = 286 m" in text
        assert "At 1000 m the cross bound alone asks for 0.0286°." in text
        assert "cross over yaw is 1.25 to 1.88 times the range" in text
        assert "81 % of the cross error's variance at 1000 m and 25 % at 60 m" in text
        assert "altitude over pitch" not in text

    def test_what_roll_does(self, verdict: dict[str, Any]) -> None:
        text = roll(verdict)
        assert "0.2° costs 0.115 m at 9.5 m and 0.4 m at 2 m" in text
        assert (
            "with a roll error of either sign: cross (0.2 m) up to 0.0625°; yaw does not hold even with the true roll."
            in text
        )
        assert "within 0.4 % of the bound" in text

    def test_limits_without_a_percentile_of_their_own(self, verdict: dict[str, Any]) -> None:
        cross = verdict["roll_limits"][0]
        beyond = cross | {"roll_error_deg": 20.0, "holds_beyond": True, "limited_by": None, "p95_over_bound": None}
        text = roll(verdict | {"roll_limits": [beyond]})
        assert "of either sign: cross (0.2 m) beyond 20°." in text
        assert "Sampled there" not in text
        least = fused(verdict | {"roll_limits": [beyond]})
        assert "where the bound of cross bears more than 20°" in least
        without = cross | {"roll_error_deg": 7.5, "limited_by": "no solution", "p95_over_bound": 0.25}
        text = roll(verdict | {"roll_limits": [without]})
        assert "cross (0.2 m) up to 7.5°. Cross is limited by no solution" in text
        assert "at a camera height of 2 m." in text
        assert "Sampled there" not in text
        assert "do not confirm it for cross." in roll(verdict | {"roll_limits": [cross | {"confirmed": False}]})

    def test_how_fused_comes_about(self, verdict: dict[str, Any]) -> None:
        text = fused(verdict)
        assert "those of 7 flights in JSBSim, seeds 3 to 9 (1 crashed and 6 landed)" in text
        assert "in every flight from 980 m on, from where it is judged." in text
        assert (
            "off by at most 0.0312° in 95 % of the flights at each of the listed ranges (most at 0 m). " in text
        )  # yaw does not hold whatever the roll
        cross = [limit for limit in verdict["roll_limits"] if limit["quantity"] == "cross"]
        text = fused(verdict | {"roll_limits": cross})
        assert "(most at 0 m), where the bound of cross bears 0.0625°." in text
        assert "Fused, early, at 95 % all bounds hold with `edge-points` over the whole stage, from 980 m on." in text

    def test_without_flights_that_is_said(self, verdict: dict[str, Any]) -> None:
        assert "no flights" in fused(verdict | {"flights": {}})

    def test_nothing_to_say(self) -> None:
        empty: dict[str, Any] = {
            "entries": [],
            "meeting": [],
            "proportions": [],
            "roll_limits": [],
            "roll_shifts": [],
            "flights": {},
        }
        assert paragraphs_of(empty | {"method": "flights"}) == {}

    @pytest.mark.parametrize(
        ("value", "text"), [(0.0, "0"), (1234.5, "1230"), (0.00001234, "0.000012"), (-4.4, "-4.4"), (980.0, "980")]
    )
    def test_figure(self, value: float, text: str) -> None:
        assert figure(value) == text


class TestPage:
    def test_the_verdict_in_a_table(self, verdict: dict[str, Any]) -> None:
        lines = verdict_md(verdict).splitlines()
        assert lines[0] == "# paper-fig3, seed 3: what holds"
        assert "| early | vision | edge-points | cross | 0.5 m | from 250 m | 300–400 points |" in lines
        assert "| early | vision | edge-points | altitude | 0.5 m | holds | – |" in lines
        assert "| early | vision | endpoints | yaw | 0.1° | does not hold | – |" in lines
        assert "| early | vision | endpoints | cross | 0.5 m | from 125 m | 0.0625 px |" in lines
        assert "| early | fused | edge-points | cross | 0.5 m | holds | – |" in lines
        assert "| cross, m | 95 % | 2 | 0.8 | 0.2 | 0.12 |" in lines
        assert "| cross, m | 95 % | – | 0.12 | 0.03 | 0.018 |" in lines
        assert "| flights |  | 0 | 70 | 70 | 70 |" in lines
        assert "| cross, m | 99.73 % | – | – | – | – |" in lines
        assert "What tilt buys." in lines
        assert lines[-1] == "landsim 1.2.3."

    def test_what_chance_explains_is_said_with_the_number(self, verdict: dict[str, Any]) -> None:
        """Of 100 flights the 95th percentile has a standard error of 9.5 %, as √(0.05 · 0.95/100)/(0.1169 · 1.96)."""
        few = envelope({"cross": 2.0}, count=100)
        few.percentiles[:] *= 1.2
        page = verdict_md(verdict | {"entries": entries_of(study(), [few], [], [])})
        assert "off it by no more than chance explains with n = 100 (by up to" in page
        assert "% at 68.27 %, 28.5 % at 95 %)" in page
        assert "within 5 %" not in page
        many = entries_of(study(), [envelope({"cross": 2.0})], [], [])
        assert "within 5 % of it everywhere (68.27 %: 1.000 to 1.000 times it)." in verdict_md(
            verdict | {"entries": many}
        )

    def test_no_limit_is_not_no_figure(self, verdict: dict[str, Any]) -> None:
        one = envelope({"cross": 2.0})
        one.percentiles[0, :, 1:] = math.inf
        page = verdict_md(verdict | {"entries": entries_of(study(), [one], [], [])})
        assert "| cross, m | 95 % | no limit | 0.8 | 0.2 | 0.12 |" in page
        assert "leaves it at 95 % roll at 1000 m" in page

    def test_what_is_said_of_few_flights_and_of_an_interval(self, verdict: dict[str, Any]) -> None:
        few, (many,) = envelope({"cross": 0.1}, source="fused", count=19), [envelope({"cross": 2.0}, source="fused")]
        page = verdict_md(verdict | {"entries": entries_of(study(), [few], [], [])})
        assert "| cross | 0.5 m | too few flights | – |" in page
        entries = entries_of(study(), [many], [], [])
        entry(entries, "cross")["holds_from_interval_m"] = [231.4, 262.6]
        assert "| from 250 m (231 to 263 m) | – |" in verdict_md(verdict | {"entries": entries})

    def test_every_paragraph_is_in_it(self, verdict: dict[str, Any]) -> None:
        page = verdict_md(verdict)
        assert set(verdict["paragraphs"]) == {"closest_early", "meeting", "roll", "fused"}
        assert all(text in page for text in verdict["paragraphs"].values())

    @pytest.mark.parametrize("width", [100, 40])
    def test_tables_in_the_terminal(self, verdict: dict[str, Any], width: int) -> None:
        console = Console(width=width, file=io.StringIO())
        with console.capture() as captured:
            for table in study_tables(verdict, width):
                console.print(table, crop=False)
        text = captured.get()
        assert max(map(len, text.splitlines())) <= width
        assert "…" not in text
        for word in (
            "early, vision, edge-points",
            "early, fused, edge-points",
            "from 250 m",
            "needs",
            "points",
            "300–400",
            "yes",
        ):
            assert word in text
        assert " ".join(verdict["paragraphs"]["meeting"].split()) in " ".join(text.split())


def test_flights_are_counted() -> None:
    distance = np.array([1000.0, 980.0, 0.0])
    rows = [
        {
            "line_noise": "endpoints",
            "outcome": outcome,
            "distance_m": distance,
            "fused_error_roll_deg": np.array([math.nan, 1.0, error]),
            "stage": np.array([Stage.EARLY, Stage.EARLY, stage]),
            "time_s": np.array([0.0, 0.5, 25.0]),
            "true_height_m": np.array([60.0, 59.0, height]),
            "touchdown_time_s": touchdown,
        }
        for outcome, error, stage, height, touchdown in (
            ("landed", 0.1, Stage.LATE, 7.0, 30.0),
            ("landed", -0.3, Stage.LATE, 7.0, None),
            ("crashed", math.nan, Stage.LATE, 7.0, None),
            ("landed", 4.0, Stage.EARLY, 7.0, None),  # the rest are not in the late stage there
            ("landed", 5.0, Stage.LATE, 1.9, None),
            ("landed", 6.0, Stage.LATE, 7.0, 24.0),
        )
    ]
    early = envelope({}, reading="endpoints", source="fused", distance=distance[:2])
    early.count[:] = 0, 6
    late = envelope({}, reading="endpoints", source="fused", distance=distance[2:], stage="late")
    (counted,) = flights_entry(rows, [early, late], [980.0, 0.0, -50.0], 5, 2.0).values()
    assert counted["outcomes"] == {"crashed": 1, "landed": 5}
    assert (counted["flights"], counted["first_seed"], counted["last_seed"]) == (6, 5, 10)
    assert (counted["fused_from_m"], counted["fused_in_all_from_m"]) == (980.0, 980.0)
    assert counted["late_roll"] == [{"range_m": 0.0, "flights": 2, "p95_deg": 0.3}]
