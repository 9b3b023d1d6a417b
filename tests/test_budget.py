"""Line precision from bounds: the independent prototype's figures, the paper's geometry, sampling, and the command."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from approach import PROTOTYPE
from scipy.optimize import brentq
from scipy.stats import norm

from landsim import cli, terminal
from landsim.budget import Budget, Order, Requirement, make_budget, parse_requirement, parse_sweep, setting_of
from landsim.budget.bias import shifts
from landsim.budget.drawn import confirm, seed_of
from landsim.budget.normal import bound_kept, sigma_within
from landsim.budget.setting import frames_at, hand_over, stage_at
from landsim.budget.solve import need, needed_noise
from landsim.config import load_scenario
from landsim.errors import InputError
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.frames import LINES_OF_STAGE
from landsim.study.model import OF_STAGE, READINGS, Reading
from landsim.threads import THREAD_VARIABLES
from landsim.units import DEG

REPOSITORY = Path(__file__).resolve().parents[1]
STUDY = load_scenario("paper-fig3")
LANDING = load_scenario("landing")
SETTING = setting_of(STUDY)
QUANTITIES = OF_STAGE["early"]


def budget_of(*texts: str, scenario: Any = STUDY, sweeps: tuple[str, ...] = (), **order: Any) -> Budget:
    requirements = tuple(map(parse_requirement, texts))
    return make_budget(scenario, Order(requirements, sweeps=tuple(map(parse_sweep, sweeps)), **order))


@pytest.mark.parametrize(("distance", "reading"), PROTOTYPE)
def test_the_prototypes_errors_take_its_noise(distance: float, reading: Reading) -> None:
    """Bounds that are the prototype's percentiles, at that confidence, must need the noise that it drew."""
    for name, percentile in zip(QUANTITIES, PROTOTYPE[distance, reading], strict=True):
        budget = budget_of(f"{name}={percentile}@{distance}", confidence_percent=68.27)
        needed = budget.rows[0].needs[reading].noise_px
        assert needed == pytest.approx(math.sqrt(2.0), rel=0.05), name


class TestNormal:
    @pytest.mark.parametrize("shift", [0.0, 0.3, -0.7, 0.95])
    @pytest.mark.parametrize("confidence", [0.5, 0.95, 0.997])
    def test_sigma_within_against_scipy(self, shift: float, confidence: float) -> None:
        def excess(sigma: float) -> float:
            return float(norm.cdf(1.0, shift, sigma) - norm.cdf(-1.0, shift, sigma)) - confidence

        sigma = sigma_within(1.0, shift, confidence)
        assert sigma == pytest.approx(brentq(excess, 1e-3, 10.0), rel=1e-6)
        assert sigma is not None
        assert bound_kept(sigma, shift, confidence) == pytest.approx(1.0, rel=1e-6)

    def test_a_shift_beyond_the_bound(self) -> None:
        assert sigma_within(1.0, 1.0, 0.95) is None
        assert bound_kept(0.0, 0.4, 0.95) == pytest.approx(0.4)


class TestGeometry:
    def test_hand_over_and_stages_as_in_the_paper(self) -> None:
        """The threshold line leaves the image at about 38 m; the path crosses it at 7.59 m."""
        assert hand_over(SETTING) == pytest.approx(38.0, abs=0.5)
        assert SETTING.threshold_height == pytest.approx(7.592, abs=1e-3)
        assert [stage_at(SETTING, d) for d in (1000.0, 39.0, 37.0, 0.0, -100.0)] == ["early"] * 2 + ["late"] * 3

    def test_a_flight_is_on_its_glide_slope_in_trim(self) -> None:
        setting = setting_of(LANDING)
        assert setting.height(855.0) == pytest.approx(1000.0 * math.tan(math.radians(3.0)))
        assert setting.pitch_early / DEG == pytest.approx(-3.0 + 2.72 - 3.0)
        assert setting.pitch_late / DEG == pytest.approx(-3.0 + 2.72 - 10.0)

    @pytest.mark.parametrize(("height", "cost"), [(9.6, 0.115), (2.0, 0.4)])
    def test_what_a_roll_error_costs(self, height: float, cost: float) -> None:
        """(h + L²/(4 h)) δ on the centreline: 0.2° cost 0.12 m at 9.6 m and 0.4 m at 2 m."""
        setting = replace(SETTING, roll_error=0.2 * DEG)
        distance = (height - setting.threshold_height) / math.tan(3.0 * DEG)
        shift = shifts(setting, frames_at(setting, "late", np.array([distance])))[0]
        assert shift[OF_STAGE["late"].index("cross")] == pytest.approx(cost, rel=0.03)

    @pytest.mark.parametrize("roll_error", [2.0, -2.0, 5.0])
    @pytest.mark.parametrize("height", [7.0, 2.0])
    def test_what_a_roll_error_costs_in_altitude(self, height: float, roll_error: float) -> None:
        """The planes of the edges, 15 m to either side, are atan(15/h) from the vertical; both turn about the runway's
        axis, by the roll error times the cosine of the camera's pitch, and the edges stay 30 m apart."""
        edge, turned = math.atan(15.0 / height), roll_error * DEG * math.cos(10.0 * DEG)
        expected = 30.0 / (math.tan(edge + turned) + math.tan(edge - turned)) - height
        setting = replace(SETTING, roll_error=roll_error * DEG)
        distance = (height - setting.threshold_height) / math.tan(3.0 * DEG)
        shift = shifts(setting, frames_at(setting, "late", np.array([distance])))[0]
        assert shift[OF_STAGE["late"].index("altitude")] == pytest.approx(expected, rel=0.01)
        assert np.sign(shift[OF_STAGE["late"].index("cross")]) == np.sign(roll_error)

    @pytest.mark.parametrize(("roll_error", "solved"), [(7.4, True), (8.0, False), (-8.0, False)])
    def test_a_roll_error_that_puts_an_edge_above_the_horizon(self, roll_error: float, solved: bool) -> None:
        """From 2 m the edges are atan(2/15) = 7.6° below the horizon."""
        setting = replace(SETTING, roll_error=roll_error * DEG)
        distance = (2.0 - setting.threshold_height) / math.tan(3.0 * DEG)
        requirement = parse_requirement(f"altitude=100@{distance}")
        found = need(setting, requirement, "late", "endpoints", 0.95)
        assert (found.noise_px is not None) == solved == math.isfinite(found.shift) == math.isfinite(found.now)
        needed = needed_noise(setting, [requirement], ["late"], 0.95)["endpoints"]
        assert needed == ([pytest.approx(found.noise_px)] if solved else [0.0])

    def test_a_roll_error_no_precision_makes_up_for(self) -> None:
        row = budget_of("cross=0.2@-105", roll_error=0.2 * DEG).rows[0]
        assert row.stage == "late"
        assert all(row.needs[reading].noise_px is None for reading in READINGS)


class TestSampling:
    """To first order is only worth something if drawing the noise agrees."""

    CASES = ("altitude=0.5@600", "roll=0.8@1000", "yaw=0.1@400", "cross=0.5@290", "along=10@400", "cross=0.2@-20")

    @pytest.mark.parametrize("reading", READINGS)
    @pytest.mark.parametrize("text", CASES)
    def test_the_need_meets_the_bound(self, text: str, reading: Reading) -> None:
        roll_error = 0.1 * DEG if "@-" in text else 0.0
        setting = replace(SETTING, roll_error=roll_error)
        row = budget_of(text, roll_error=roll_error).rows[0]
        assert row.stage is not None
        noise = row.needs[reading].noise_px
        assert noise is not None
        p95 = self.percentile(setting, row.requirement, reading, noise, setting.spacing_px)
        assert p95 == pytest.approx(row.requirement.bound, rel=0.05)
        drawn = confirm(setting, row.requirement, row.stage, reading, noise, 20_000, seed_of(1, 0, reading))
        assert drawn.inside == pytest.approx(0.95, abs=0.006)

    @pytest.mark.parametrize(
        ("text", "roll_error"),
        [("altitude=0.2@-100", 2.0), ("altitude=0.15@-100", -2.0), ("cross=2@-60", 2.0), ("yaw=0.9@-80", 3.0),
         ("pitch=0.15@-60", -4.0)],
    )  # fmt: skip
    def test_the_need_meets_the_bound_with_a_large_roll_error(self, text: str, roll_error: float) -> None:
        row = budget_of(text, roll_error=roll_error * DEG, draws=20_000).rows[0]
        assert row.inside["endpoints"] == pytest.approx(0.95, abs=0.01)
        assert row.inside["edge-points"] == pytest.approx(0.95, abs=0.01)

    @pytest.mark.parametrize("reading", READINGS)
    def test_a_bound_that_the_solver_breaks_by_itself(self, reading: Reading) -> None:
        """2° cost 0.13 m of altitude at 2 m: with next to no noise every draw is beyond 0.1 m."""
        row = budget_of("altitude=0.1@-105", roll_error=2.0 * DEG, draws=10).rows[0]
        assert row.needs[reading].noise_px is None
        assert (row.inside, row.trusted) == ({}, {})
        setting = replace(SETTING, roll_error=2.0 * DEG)
        assert confirm(setting, row.requirement, "late", reading, 1e-3, 100, seed_of(0, 0, reading)).inside == 0.0

    @pytest.mark.parametrize(
        ("text", "trusted"),
        [("altitude=100@1000", False), ("along=400@600", False), ("pitch=90@-100", False), ("altitude=0.5@600", True),
         ("cross=0.5@290", True)],
    )  # fmt: skip
    def test_first_order_is_marked_where_drawing_denies_it(self, text: str, trusted: bool) -> None:
        row = budget_of(text, draws=4000).rows[0]
        for reading in READINGS:
            assert row.trusted[reading] == trusted
            assert (abs(row.inside[reading] - 0.95) < 0.03) == trusted

    @pytest.mark.parametrize("confidence", [20.0, 68.27, 99.0, 99.99])
    def test_at_any_confidence(self, confidence: float) -> None:
        for bound, trusted in ((0.1, True), (100.0, False)):
            rows = [budget_of(f"altitude={bound}@600", confidence_percent=confidence, seed=i).rows[0] for i in range(3)]
            found = {row.trusted[reading] for row in rows for reading in READINGS}
            assert found == {trusted}, bound

    def test_the_marks_seed_is_the_commands(self) -> None:
        """Near the edge of what is trusted chance decides, and the same chance each time."""
        found = [
            [budget_of(f"altitude={b}@1000", seed=i).rows[0].trusted["endpoints"] for b in range(5, 60, 3)]
            for i in (1, 1, 2)
        ]
        assert found[0] == found[1]
        assert found[0][0]
        assert not found[0][-1]

    @pytest.mark.parametrize("text", ["altitude=0.5@400", "yaw=0.1@200", "cross=0.2@-20"])
    def test_so_many_points_meet_the_bound(self, text: str) -> None:
        row = budget_of(text).rows[0]
        found = row.needs["edge-points"]
        assert found.spacing_px is not None
        p95 = self.percentile(SETTING, row.requirement, "edge-points", SETTING.noise_px, found.spacing_px)
        assert p95 <= 1.05 * row.requirement.bound
        # one point less on each line would not do, but for how points fall between two whole numbers
        p95 = self.percentile(SETTING, row.requirement, "edge-points", SETTING.noise_px, 1.35 * found.spacing_px)
        assert p95 > 1.03 * row.requirement.bound

    def test_confirmed_draws_do_not_hang_together(self) -> None:
        texts = ("altitude=0.5@600", "roll=0.8@1000")
        both, one = (budget_of(*t, draws=2000, seed=3) for t in (texts, texts[:1]))
        assert both.rows[0].inside == one.rows[0].inside
        assert both.rows[0].inside != budget_of(*texts[:1], draws=2000, seed=4).rows[0].inside

    def percentile(
        self, setting: Any, requirement: Requirement, reading: Reading, noise: float, spacing: float
    ) -> float:
        assert requirement.distance is not None
        stage = stage_at(setting, requirement.distance)
        assert stage is not None
        frames = frames_at(setting, stage, np.array([requirement.distance]))
        rng = np.random.default_rng(5)
        fits = draw_lines(frames.ends[0], LINES_OF_STAGE[stage], reading, spacing, noise, 20_000, rng)
        roll_error = setting.roll_error if stage == "late" else 0.0
        errors = pose_errors(setting.camera, frames, 0, fits, setting.runway.width, roll_error)
        return float(np.percentile(np.abs(errors[:, OF_STAGE[stage].index(requirement.quantity.name)]), 95.0))


class TestHeld:
    def test_where_a_bound_begins_to_hold_it_is_just_met(self) -> None:
        held = budget_of("altitude=0.5", "roll=0.8", precision_px=1.0)
        for row in held.rows:
            for reading in READINGS:
                (begin, _), *others = row.held[reading]
                assert not others
                again = budget_of(
                    f"{row.requirement.quantity.name}={row.requirement.bound / row.requirement.quantity.scale}@{begin}"
                )
                assert again.rows[0].needs[reading].noise_px == pytest.approx(
                    1.0, rel=1e-2
                )  # a step of the points' number
        assert held.rows[0].held["edge-points"][0][1] == pytest.approx(held.end)
        assert held.rows[1].held["edge-points"][0][1] == pytest.approx(held.hand_over, abs=0.01)
        assert held.end is not None
        assert SETTING.height(held.end) == pytest.approx(2.0)

    def test_roll_and_along_end_with_the_threshold(self) -> None:
        budget = budget_of("along=1000", "pitch=90", precision_px=0.01)
        (along,), (pitch,) = (row.held["endpoints"] for row in budget.rows)
        assert along == pytest.approx((budget.far, budget.hand_over), abs=0.01)
        assert pitch == pytest.approx((budget.far, budget.end))

    def test_where_first_order_is_not_to_be_trusted(self) -> None:
        near, far = budget_of("altitude=0.3", "altitude=100", precision_px=10.0).rows
        assert near.held_trusted["edge-points"] == [True]
        assert far.held_trusted["endpoints"] == [False]

    def test_a_roll_error_ends_it(self) -> None:
        """2° cost 0.1 m of altitude where 30 / (tan(a + t) + tan(a - t)) - h does, at about 2.65 m."""

        def excess(height: float) -> float:
            edge, turned = math.atan(15.0 / height), 2.0 * DEG * math.cos(10.0 * DEG)
            return height - 30.0 / (math.tan(edge + turned) + math.tan(edge - turned)) - 0.1

        ((_, end),) = budget_of("altitude=0.1", precision_px=1e-3, roll_error=2.0 * DEG).rows[0].held["endpoints"]
        assert SETTING.height(end) == pytest.approx(brentq(excess, 1.0, 6.0), rel=0.02)

    def test_nowhere(self) -> None:
        assert budget_of("along=0.001", precision_px=5.0).rows[0].held == {"endpoints": [], "edge-points": []}


class TestSweep:
    def test_more_pixels_of_the_same_view_ask_for_the_same_angle(self) -> None:
        """Twice the pixels over the same field of view: the same geometry, in half the unit."""
        sweep = budget_of("altitude=0.5@600", "yaw=0.1@200", sweeps=("resolution=658:1316:2",)).sweeps[0]
        for low, high in sweep.needed["endpoints"]:
            assert high == pytest.approx(2.0 * low, rel=2e-3)

    def test_everything_twice_as_large(self) -> None:
        """A runway, a path and a bound twice as large look the same."""
        keys = {"runway.width_m": 60.0, "runway.length_m": 4000.0, "start.along_m": -2000.0, "start.height_m": 120.0}
        large = budget_of("altitude=1.0@1200", scenario=load_scenario("paper-fig3", keys))
        small = budget_of("altitude=0.5@600")
        for reading in READINGS:
            a, b = (budget.rows[0].needs[reading].noise_px for budget in (large, small))
            assert a == pytest.approx(b, rel=1e-3)

    @pytest.mark.parametrize(
        ("sweep", "key"),
        [("focal-length=25:30:2", "camera.focal_length_mm"), ("runway.width_m=45:60:2", "runway.width_m"),
         ("runway-length=1000:1500:2", "runway.length_m"), ("image-height=300:800:2", "camera.height_px")],
    )  # fmt: skip
    def test_a_value_is_that_scenario(self, sweep: str, key: str) -> None:
        texts = ("altitude=0.5@600", "yaw=0.1@100")
        found = budget_of(*texts, sweeps=(sweep,)).sweeps[0]
        value = found.values[0]
        other = load_scenario("paper-fig3", {key: round(value) if key.endswith("px") else value})
        alone = budget_of(*texts, scenario=other)
        for reading in READINGS:
            for row, values in zip(alone.rows, found.needed[reading], strict=True):
                assert values[0] == pytest.approx(row.needs[reading].noise_px, rel=1e-9)

    def test_tilt_is_that_of_the_stage(self) -> None:
        budget = budget_of("altitude=0.5@600", "cross=0.2@-20", sweeps=("tilt=3:10:2",))
        (early, late) = budget.rows
        sweep = budget.sweeps[0]
        assert sweep.present == pytest.approx({"early": 3.0, "late": 10.0})
        assert sweep.needed["endpoints"][0][0] == pytest.approx(early.needs["endpoints"].noise_px)
        assert sweep.needed["endpoints"][1][1] == pytest.approx(late.needs["endpoints"].noise_px)

    def test_out_of_the_image_is_a_gap(self) -> None:
        """Half the image is 11.07° high: with 15° of tilt what lies 3.4° below the horizon is above it."""
        sweep = budget_of("altitude=0.5@1000", sweeps=("tilt=3:15:2",)).sweeps[0]
        assert [math.isfinite(value) for value in sweep.needed["endpoints"][0]] == [True, False]


REQUIRE = ("--require", "altitude=0.5@600")
BAD: dict[str, tuple[tuple[str, ...], str]] = {
    "nothing": ((), "nothing is asked for"),
    "unknown quantity": (("--require", "altitud=0.5@600"), 'unknown quantity "altitud"; did you mean altitude?'),
    "another name": (("--require", "lateral=0.5@600"), "did you mean cross?"),
    "no bound": (("--require", "altitude@600"), "must be quantity=bound@range"),
    "no number": (("--require", "altitude=a@600"), "the bound must be a number, not a"),
    "no range": (("--require", "altitude=0.5"), "the range is missing"),
    "empty range": (("--require", "altitude=0.5@"), "must be quantity=bound@range"),
    "zero": (("--require", "altitude=0@600"), "the bound must be a finite number above 0, not 0"),
    "negative": (("--require", "altitude=-1@600"), "above 0, not -1"),
    "nan": (("--require", "altitude=nan@600"), "above 0, not nan"),
    "infinite": (("--require", "altitude=inf@600"), "above 0, not inf"),
    "half a turn": (("--require", "roll=180@600"), "the bound must be below 180 deg"),
    "nan range": (("--require", "altitude=1@nan"), "the range must be a finite number of metres"),
    "too far": (("--require", "altitude=1@6000"), "below camera.min_line_px = 8"),
    "above the image": (("paper-fig3", *REQUIRE, "--set", "study.pitch_early_deg=-15.0"), "above the image"),
    "landed": (("--require", "altitude=1@-145"), "the straight approach has met the ground"),
    "behind the runway": (("--require", "altitude=1@-3000"), "has met the ground"),
    "edges out of view": (
        ("--require", "cross=1@-20", "--set", "camera.focal_length_mm=40.0"),
        "in the late stage, the left edge is not in",
    ),
    "roll late": (("--require", "roll=1@10"), "two edges do not tell roll"),
    "along late": (("--require", "along=1@-10"), "two edges do not tell along"),
    "unknown sweep": ((*REQUIRE, "--plot", "a.png", "--sweep", "focal=1:2"), "did you mean focal-length?"),
    "sweep of nothing": ((*REQUIRE, "--plot", "a.png", "--sweep", "runway.heading_deg=1:2"), "can be swept"),
    "sweep backward": ((*REQUIRE, "--plot", "a.png", "--sweep", "tilt=5:1"), "low must be below high"),
    "sweep to nan": ((*REQUIRE, "--plot", "a.png", "--sweep", "tilt=5:nan"), "low must be below high"),
    "sweep of one": ((*REQUIRE, "--plot", "a.png", "--sweep", "tilt=1:5:1"), "2 to 10000 values"),
    "sweep malformed": ((*REQUIRE, "--plot", "a.png", "--sweep", "tilt=1"), "must be tilt=low:high"),
    "sweep from zero": ((*REQUIRE, "--plot", "a.png", "--sweep", "focal-length=0:5"), "low must be above 0"),
    "sweep too small": (
        (*REQUIRE, "--plot", "a.png", "--sweep", "image-width=2:5"),
        "camera.width_px: must be at least",
    ),
    "sweep unseen": ((*REQUIRE, "--sweep", "tilt"), "give --plot FILE"),
    "figure's ending": ((*REQUIRE, "--plot", "a.jpg"), "must end in .png or .pdf"),
    "figure nowhere": ((*REQUIRE, "--plot", "no/a.png"), "no is not a folder"),
    "figure is a folder": ((*REQUIRE, "--plot", "f.png"), "is a folder"),
    "figure without range": (("--require", "roll=1", "--precision", "1", "--plot", "a.png"), "need a range"),
    "confidence": ((*REQUIRE, "--confidence", "100"), "below 100 %"),
    "confidence nan": ((*REQUIRE, "--confidence", "nan"), "below 100 %"),
    "confidence text": ((*REQUIRE, "--confidence", "x"), "not a valid float"),
    "precision": ((*REQUIRE, "--precision", "0"), "finite number of pixels above 0"),
    "precision nan": ((*REQUIRE, "--precision", "nan"), "finite number of pixels above 0"),
    "roll error": ((*REQUIRE, "--roll-error-deg", "nan"), "within ±10°"),
    "draws": ((*REQUIRE, "--confirm", "-1"), "the draws must be"),
    "unknown key": ((*REQUIRE, "--set", "camera.focal_mm=3.0"), "did you mean camera.focal_length_mm?"),
    "unknown scenario": (("landnig", *REQUIRE), "did you mean landing?"),
    "full folder": ((*REQUIRE, "--out", "full"), "is not empty"),
    "no file": (("--requirements", "none.toml"), "none.toml: cannot be read"),
    "not TOML": (("--requirements", "broken.toml"), "broken.toml: not valid TOML"),
    "other tables": (("--requirements", "tables.toml"), "requires: unknown key; did you mean require?"),
    "key without unit": (("--requirements", "unit.toml"), "require 2: altitude: unknown key; did you mean altitude_m?"),
    "file's bound": (("--requirements", "zero.toml"), "require 1: cross_m: the bound must be a finite number above 0"),
    "file's huge bound": (("--requirements", "huge.toml"), "require 1: altitude_m: must be a number of at most 1e+06"),
    "file's huge range": (("--requirements", "far.toml"), "require 1: range_m: must be a number of at most 1e+06"),
    "file's endless range": (("--requirements", "endless.toml"), "require 1: range_m: must be a number of at most"),
    "file's endless bound": (("--requirements", "digits.toml"), "digits.toml: "),
    "file's large bound": (("--requirements", "large.toml"), "the bound must be below 1e+06 m"),
    "file's type": (("--requirements", "type.toml"), 'require 1: cross_m: must be a number, not "1"'),
}
FILES = {
    "broken.toml": "[[require",
    "tables.toml": "[[requires]]\nrange_m = 1.0\n",
    "unit.toml": "[[require]]\nrange_m = 600.0\nyaw_deg = 1\n[[require]]\naltitude = 1.0\n",
    "zero.toml": "[[require]]\nrange_m = 600.0\ncross_m = 0\n",
    "huge.toml": f"[[require]]\nrange_m = 600\naltitude_m = 1{'0' * 400}\n",
    "far.toml": f"[[require]]\naltitude_m = 1\nrange_m = -1{'0' * 400}\n",
    "endless.toml": f"[[require]]\naltitude_m = 1\nrange_m = 0x1{'0' * 5000}\n",
    "digits.toml": f"[[require]]\nrange_m = 600\naltitude_m = 1{'0' * 5000}\n",
    "large.toml": f"[[require]]\nrange_m = 600\naltitude_m = 1{'0' * 20}\n",
    "type.toml": '[[require]]\nrange_m = 600.0\ncross_m = "1"\n',
    "full/mine": "mine",
    "f.png/mine": "mine",
}
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def landsim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs ``landsim budget`` in an empty folder: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    for variable in THREAD_VARIABLES:
        monkeypatch.setenv(variable, "1")

    def run(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            cli.main(["budget", *arguments])
        printed = capsys.readouterr()
        assert isinstance(stopped.value.code, int)
        return stopped.value.code, printed.out, printed.err

    return run


class TestCommand:
    @pytest.mark.parametrize("case", BAD)
    def test_bad_input_is_one_line_and_nothing_is_written(self, case: str, landsim: Run, tmp_path: Path) -> None:
        for name, text in FILES.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text)
        before = sorted(tmp_path.rglob("*"))
        arguments, told = BAD[case]
        code, out, err = landsim(*arguments)
        assert (code, out, len(err.splitlines())) == (2, "", 1)
        assert told in err
        assert sorted(tmp_path.rglob("*")) == before

    def test_table(self, landsim: Run, tmp_path: Path) -> None:
        code, out, err = landsim("paper-fig3", "--require", "altitude=0.5@600", "--require", "cross=0.2@-20")
        assert (code, err) == (0, "")
        assert "95 % of the frames" in out
        assert "altitude 0.5 m at 600" in out
        needed = budget_of("altitude=0.5@600").rows[0].needs["endpoints"].noise_px
        assert f"endpoints: altitude 0.5 m at 600 m decides, with {needed:.3g} px" in " ".join(out.split())
        assert list(tmp_path.iterdir()) == []
        assert max(map(len, out.splitlines())) <= terminal.WIDTH

    def test_settings_reach_it(self, landsim: Run) -> None:
        outs = [landsim(*REQUIRE, *setting)[1] for setting in ((), ("--set", "runway.width_m=45"))]
        assert outs[0] != outs[1]
        assert "runway 45 × 2000 m" in " ".join(outs[1].split())

    def test_json_and_file(self, landsim: Run, tmp_path: Path) -> None:
        early = "[[require]]\nrange_m = 600\naltitude_m = 0.5\nroll_deg = 0.8\n"
        (tmp_path / "bounds.toml").write_text(early + "[[require]]\nrange_m = -20.0\ncross_m = 0.2\n")
        code, out, err = landsim("paper-fig3", "--requirements", "bounds.toml", *REQUIRE, "--json", "--confirm", "500")
        assert (code, err) == (0, "")
        told = json.loads(out)
        kinds = [(r["quantity"], r["range_m"], r["stage"]) for r in told["requirements"]]
        assert kinds == [
            ("altitude", 600, "early"),
            ("roll", 600, "early"),
            ("cross", -20, "late"),
            ("altitude", 600, "early"),
        ]
        assert told["requirements"][0]["bound_m"] == 0.5
        assert told["requirements"][1]["bound_deg"] == pytest.approx(0.8)
        assert told["requirements"][0]["endpoints"]["inside_percent"] == pytest.approx(95.0, abs=4.0)
        assert told["binding"]["endpoints"] == 0
        assert told["sweeps"] == []

    def test_folder_holds_the_numbers_and_the_figure(self, landsim: Run, tmp_path: Path) -> None:
        arguments = (*REQUIRE, "--require", "cross=0.2@-20", "--sweep", "tilt=0:8:3", "--sweep", "focal-length=8:50:3")
        code, out, _ = landsim(*arguments, "--out", "mine")
        assert code == 0
        assert {path.name for path in (tmp_path / "mine").iterdir()} == {"budget.json", "budget.png", "budget.pdf"}
        assert "  mine/budget.json\n" in out
        told = json.loads((tmp_path / "mine/budget.json").read_text())
        assert [sweep["name"] for sweep in told["sweeps"]] == ["tilt", "focal-length"]
        assert told["sweeps"][1]["values"] == pytest.approx([8.0, 20.0, 50.0])
        assert (tmp_path / "mine/budget.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / "mine/budget.pdf").read_bytes().startswith(b"%PDF")
        landsim(*arguments, "--out", "again")
        assert (tmp_path / "mine/budget.pdf").read_bytes() == (tmp_path / "again/budget.pdf").read_bytes()

    def test_plot_alone(self, landsim: Run, tmp_path: Path) -> None:
        assert landsim(*REQUIRE, "--sweep", "runway-width=20:60:2", "--plot", "a.PNG")[0] == 0
        assert [path.name for path in tmp_path.iterdir()] == ["a.PNG"]

    def test_a_shift_that_no_precision_makes_up_for_is_told(self, landsim: Run) -> None:
        code, out, _ = landsim("--require", "cross=0.2@-100", "--roll-error-deg", "1")
        assert code == 0
        assert (
            "no precision will do for cross 0.2 m at −100 m, since with the roll error perfect lines are off by"
            in " ".join(out.split())
        )

    def test_no_pose_with_the_roll_error_is_told(self, landsim: Run) -> None:
        arguments = ("paper-fig3", "--require", "altitude=10@-105", "--roll-error-deg", "9")
        code, out, _ = landsim(*arguments, "--confirm", "10")
        assert code == 0
        assert "since with the roll error perfect lines tell no pose" in " ".join(out.split())
        of = json.loads(landsim(*arguments, "--json")[1])["requirements"][0]["endpoints"]
        keys = ("needed_noise_px", "roll_shift_m", "present_m", "first_order_holds")
        assert [of[key] for key in keys] == [None] * 4

    def test_a_need_not_to_be_trusted_is_marked(self, landsim: Run) -> None:
        mark = "? not to be trusted"
        far, near = (landsim("paper-fig3", "--require", text)[1] for text in ("altitude=100@1000", "altitude=0.5@600"))
        assert " px ?" in far
        assert mark in " ".join(far.split())
        assert "which drawing does not bear out" in " ".join(far.split())
        assert "?" not in near
        told = json.loads(landsim("paper-fig3", "--require", "altitude=100@1000", *REQUIRE, "--json")[1])
        assert [of["endpoints"]["first_order_holds"] for of in told["requirements"]] == [False, True]
        assert told["checked"]["draws"] == 2000
        _, out, _ = landsim("paper-fig3", "--require", "altitude=100", "--precision", "10")
        assert " m ?" in out
        assert mark in " ".join(out.split())

    def test_help_imports_no_library(self) -> None:
        code = (
            "import sys\nfrom landsim.cli import main\ntry:\n    main(['budget', '--help'])\n"
            "finally:\n    assert not {'numpy', 'rich', 'pydantic', 'matplotlib'} & set(sys.modules)\n"
        )
        environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert "--require" in done.stdout


class TestFigure:
    def test_panels_share_their_axis_and_name_their_units(self) -> None:
        from landsim.budget import as_dict
        from landsim.plain import as_json
        from landsim.plots.budget import budget_sweeps

        texts = ("altitude=0.5@600", "cross=0.2@-20", *(f"yaw={0.1 * i}@100" for i in range(1, 7)))
        budget = as_json(as_dict(budget_of(*texts, sweeps=("tilt=0:20:9", "runway-width=15:60:9"))))
        figure = budget_sweeps(budget)
        axes = figure.axes
        assert len(axes) == 4
        assert len({panel.get_ylim() for panel in axes}) == 1
        assert axes[0].get_ylabel() == "σ needed, px"
        assert [panel.get_xlabel() for panel in axes[1::2]] == [
            "camera tilt below the runway's plane, °",
            "runway width, m",
        ]
        assert [panel.get_xscale() for panel in axes[::2]] == ["linear", "log"]
        (legend,) = figure.legends
        names = [text.get_text() for text in legend.get_texts()]
        assert names[:2] == ["altitude 0.5 m at 600 m", "cross 0.2 m at −20 m"]

    def test_a_mark_not_to_be_trusted_is_hollow(self) -> None:
        from landsim.budget import as_dict
        from landsim.plain import as_json
        from landsim.plots.budget import budget_sweeps

        hollow = []
        for texts in (("altitude=0.5@600",), ("altitude=0.5@600", "altitude=100@1000")):
            figure = budget_sweeps(as_json(as_dict(budget_of(*texts, sweeps=("tilt=0:5:3",)))))
            marks = [line for panel in figure.axes for line in panel.get_lines() if line.get_linestyle() == "None"]
            hollow.append([line.get_markerfacecolor() == "white" for line in marks])
            assert any("Hollow" in text.get_text() for text in figure.texts) == any(hollow[-1])
        assert hollow == [[False, False], [False, True] * 2]

    def test_what_a_colour_tells_line_and_mark_tell_too(self) -> None:
        from landsim.plots.budget import CURVES

        for key in ("color", "ls", "marker"):
            assert len({str(curve[key]) for curve in CURVES}) == len(CURVES)

    def test_nothing_to_draw_is_drawn(self) -> None:
        """Only gaps: every value of the sweep has the threshold out of the image."""
        from landsim.budget import as_dict
        from landsim.plain import as_json
        from landsim.plots.budget import budget_sweeps

        budget = as_json(as_dict(budget_of("altitude=0.5@1000", sweeps=("tilt=16:20:3",))))
        assert budget["sweeps"][0]["needed_noise_px"]["endpoints"] == [[None] * 3]
        budget_sweeps(budget)


def test_a_need_without_a_distance() -> None:
    with pytest.raises(ValueError, match="without a distance"):
        need(SETTING, parse_requirement("altitude=1"), "early", "endpoints", 0.95)


def test_requirements_say_what_they_are() -> None:
    assert str(parse_requirement(" roll = 0.8 @ -20 ")) == "roll 0.8° at −20 m"
    assert str(parse_requirement("cross=1e-1")) == "cross 0.1 m"
    with pytest.raises(InputError):
        parse_requirement("\udcff=1@2")
