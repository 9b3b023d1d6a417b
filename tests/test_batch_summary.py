"""A batch's summary: batches whose numbers are known beforehand, section by section, and batches of the worst kind."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown import DISTANCE, aloft, failed, good
from numpy.random import default_rng
from scipy import stats as scipy_stats

from landsim.batch.flights import Flights, flights_of, load_flights
from landsim.batch.row import Row, lost_row
from landsim.batch.rows import save_rows
from landsim.batch.sections.touchdown import thinned
from landsim.batch.summary import summarise
from landsim.config import load_scenario
from landsim.errors import RunFolderError, traceback_of
from landsim.log import QUANTITIES

SCENARIO = load_scenario("landing")
SECTIONS = [
    "format", "batch", "rates", "verdict", "touchdown", "distributions", "tracking", "envelopes", "consistency",
    "sensitivity", "worst", "versions",
]  # fmt: skip


def summary(rows: list[Row], **identity: Any) -> dict[str, Any]:
    found = summarise(SCENARIO, flights_of(rows), {"seed": 0, "versions": {"landsim": "1"}} | identity)
    json.dumps(found, allow_nan=False)
    assert list(found) == SECTIONS
    return found


def one(entries: list[dict[str, Any]], **named: Any) -> dict[str, Any]:
    (found,) = [entry for entry in entries if all(entry[key] == value for key, value in named.items())]
    return found


def within(count: int, n: int) -> dict[str, Any]:
    exact = scipy_stats.binomtest(count, n).proportion_ci(0.95, "exact")
    rate = {"count": count, "n": n, "rate": count / n, "low": exact.low, "high": exact.high}
    return {key: pytest.approx(value, abs=1e-12) for key, value in rate.items()}


def test_rates_are_counted_and_every_limit_is_over_the_flights_that_have_it() -> None:
    """Ten good, one short, two wide of which one also hard, one that stayed up and one that raised."""
    rows = [good(i) for i in range(10)]
    rows += [good(10, x_m=99.0, in_box=False), good(11, y_m=-2.1, in_box=False)]
    rows += [good(12, y_m=2.5, sink_rate_mps=1.01, in_box=False, outcome="crashed"), aloft(13), failed(14)]
    rates = summary(rows)["rates"]
    assert rates["success"] == within(10, 15)
    assert rates["landed"] == within(12, 15)
    outcomes = {entry["outcome"]: entry["count"] for entry in rates["outcomes"]}
    expected = {"landed": 12, "crashed": 1, "timeout": 1, "error": 1}
    assert outcomes == dict.fromkeys(outcomes, 0) | expected
    missed = {entry["key"]: entry["count"] for entry in rates["limits"]}
    keys = ("along_min_m", "along_max_m", "cross_max_m", "sink_max_mps", "bank_max_deg", "stop_cross_max_m")
    assert missed == dict(zip(keys, (1, 0, 2, 1, 0, 0), strict=True))
    assert {entry["n"] for entry in rates["limits"]} == {13}
    assert one(rates["limits"], key="cross_max_m") == {
        "key": "cross_max_m", "title": "|lateral touchdown|", "unit": "m", "limit": 2.0, "side": "above",
        "of": "flights with a touchdown", **within(2, 13),
    }  # fmt: skip


def test_on_a_limit_is_within_it() -> None:
    rates = summary([good(0, x_m=100.0, y_m=-2.0, sink_rate_mps=1.0, bank_deg=3.0, stop_y_m=-3.0), good(1, x_m=450.0)])
    assert all(entry["count"] == 0 for entry in rates["rates"]["limits"])


def test_what_n_shows_is_said_from_its_numbers() -> None:
    found = summary([good(i) for i in range(200)])["rates"]
    shown = found["can_show"]
    assert shown["failure_rate_below"] == pytest.approx(1.0 - 0.05**0.005)  # 200 in a row have 5 % at that rate
    assert [entry["n"] for entry in shown["needed_without_failure"]] == [2995, 2_995_731]
    text = " ".join(found["text"])
    assert "200 of 200 flights" in text
    assert "between 98.17 % and 100 %" in text  # 0.025^(1/200) = 0.98172
    assert "below 0.0149" in text
    assert "2,995 flights for 0.001" in text
    assert "approximate" not in text
    sobol = summary([good(0)], sampling="sobol")["rates"]["text"]
    assert "sobol" in sobol[-1]
    assert "approximate" in sobol[-1]


def test_touchdowns_are_drawn_with_their_ellipses() -> None:
    points = default_rng(1).multivariate_normal((270.0, 0.2), [[400.0, 3.0], [3.0, 0.16]], 400)
    found = summary([good(i, x_m=x, y_m=y) for i, (x, y) in enumerate(points.tolist())] + [aloft(400)])["touchdown"]
    assert (found["n"], len(found["points"]["x_m"]), found["points_rule"]) == (400, 400, "every touchdown")
    np.testing.assert_array_equal(found["points"]["y_m"], points[:, 1])
    for ellipse, level in zip(found["ellipses"], (0.5, 0.95, 0.997), strict=True):
        assert ellipse["level"] == 100.0 * level
        assert ellipse["inside"]["rate"] == pytest.approx(level, abs=0.05)
        # the polygon is on the ellipse: Mahalanobis' distance of every corner is the same, and F's quantile
        corners = np.stack((ellipse["polygon"]["x_m"], ellipse["polygon"]["y_m"]), axis=1) - points.mean(axis=0)
        squares = np.einsum("ij,ij->i", corners, np.linalg.solve(np.cov(points.T), corners.T).T)
        expected = 2.0 * 399 * 401 / (400 * 398) * scipy_stats.f.ppf(level, 2, 398)
        np.testing.assert_allclose(squares, expected, rtol=1e-9)
    assert (found["box"]["along_min_m"], found["runway"]["width_m"], found["aim_point_m"]) == (100.0, 30.0, 145.0)
    assert "agree" in found["text"][-1]


def test_touchdowns_that_are_not_normal_are_said_to_be() -> None:
    far = [good(i, x_m=x, y_m=y) for i, (x, y) in enumerate(default_rng(2).standard_cauchy((300, 2)).tolist())]
    assert any("not normally distributed" in line for line in summary(far)["touchdown"]["text"])


def test_thinned_points_keep_those_that_missed() -> None:
    rows, missed = np.arange(0, 2000, 2), np.zeros(2000, bool)
    missed[[6, 700, 1998]] = True
    kept = thinned(rows, missed, most=100)
    assert {6, 700, 1998} <= set(kept.tolist())
    assert kept.size == 100
    assert (np.diff(kept) > 0).all()
    assert thinned(rows, np.ones(2000, bool), most=100).size == 100
    assert thinned(rows, missed, most=1000) is rows


def test_distributions_by_hand() -> None:
    """Sink rates 0.01 to 1.00 and a hundred touchdowns to either side."""
    rows = [good(i, sink_rate_mps=0.01 * (i + 1), y_m=0.01 * (i + 1) * (-1) ** i) for i in range(100)]
    found = summary(rows)["distributions"]
    sink = one(found, key="sink_rate_mps")
    assert (sink["n"], sink["min"], sink["max"]) == (100, 0.01, 1.0)
    assert (sink["mean"], sink["std"]) == pytest.approx((0.505, 0.01 * math.sqrt(100 * 101 / 12)))
    median = one(sink["quantiles"], p=0.5)
    # of a hundred, the 40th and the 61st are about the median
    assert (median["value"], median["low"], median["high"]) == pytest.approx((0.505, 0.40, 0.61))
    assert one(sink["quantiles"], p=0.99)["high"] is None
    (limit,) = sink["limits"]
    assert (limit["key"], limit["value"], limit["side"], limit["missed"]["count"]) == ("sink_max_mps", 1.0, "above", 0)
    (curve,) = sink["exceedance"]
    assert (curve["side"], curve["limit"], curve["x"][-1]) == ("above", 1.0, 1.0)
    assert (curve["share"][0], curve["share"][-1]) == (1.0, 0.01)
    assert sum(sink["histogram"]["counts"]) == 100
    lateral = one(found, key="y_m")
    assert one(lateral["magnitude_quantiles"], p=0.5)["value"] == pytest.approx(0.505)
    assert lateral["exceedance"][0]["x"][0] == pytest.approx(0.01)
    assert lateral["exceedance"][0]["magnitude"] is True


def test_the_touchdown_along_the_runway_is_shown_towards_both_its_limits() -> None:
    found = one(
        summary([good(i, x_m=x) for i, x in enumerate((90.0, 200.0, 460.0, 470.0))])["distributions"], key="x_m"
    )
    above, below = found["exceedance"]
    assert (above["limit"], above["x"], above["share"]) == (450.0, [90.0, 200.0, 460.0, 470.0], [1.0, 0.75, 0.5, 0.25])
    assert (below["limit"], below["x"], below["share"]) == (100.0, [470.0, 460.0, 200.0, 90.0], [1.0, 0.75, 0.5, 0.25])
    assert [limit["missed"]["count"] for limit in found["limits"]] == [1, 2]


def test_tracking_beside_the_published_criteria() -> None:
    """12 ft are 3.6576 m; 25 of the 150 µA at 105 m are 17.5 m."""
    rows = [good(i, glide_slope_to_flare_p95_m=3.5 + 0.1 * i, localizer_p95_m=17.4 + 0.05 * i) for i in range(5)]
    found = summary(rows)["tracking"]
    slope = one(found, key="glide_slope_to_flare")
    assert slope["criteria"][0]["limit"] == pytest.approx(3.6576)
    assert slope["criteria"][0]["kept"] == within(2, 5)
    assert one(slope["p95"]["quantiles"], p=0.5)["value"] == pytest.approx(3.7)
    localizer = one(found, key="localizer")["criteria"][0]
    assert (localizer["limit"], localizer["kept"]["count"], localizer["estimate"]) == (pytest.approx(17.5), 3, True)
    assert all("no certification is claimed" in entry["source"] for entry in (localizer, slope["criteria"][0]))


def test_envelopes_are_over_the_flights_in_the_air_with_an_estimate() -> None:
    """Errors 1 to 100 of either sign at 500 m; half of the flights without a solution at 100 m; down before -100 m."""
    rows = []
    for i in range(100):
        errors = np.array([math.nan, (-1.0) ** i * (i + 1), math.nan if i % 2 else 2.0, 0.0, 7.0])
        down = 27.0 if i else 26.0
        rows.append(good(i, vision_error_cross_m=errors, touchdown_time_s=down, sigma_cross_m=np.full(5, 3.0 + i % 2)))
    found = summary(rows)["envelopes"]
    assert found["distance_m"] == DISTANCE.tolist()
    assert found["in_the_air"] == [100, 100, 100, 100, 0]
    vision = one(found["series"], source="vision", quantity="cross_m")
    assert vision["count"] == [0, 100, 50, 100, 0]
    assert vision["share"] == [0.0, 1.0, 0.5, 1.0, None]
    assert vision["p50"] == [None, 50.5, 2.0, 0.0, None]
    assert vision["p95"][1] == pytest.approx(np.percentile(np.arange(1.0, 101.0), 95.0))
    assert vision["p99_7"][1] is None  # it takes 371
    # all of a hundred are below the 95th percentile by 0.6 %, and 99 by 3.7 %, which is more than 2.5 %
    assert (vision["p95_low"][1], vision["p95_high"][1]) == (90.0, 100.0)
    fused = one(found["series"], source="fused", quantity="cross_m")
    assert fused["sigma_rms"][:4] == pytest.approx([math.sqrt(12.5)] * 4)


def test_the_percentiles_of_an_envelope_are_numpy_s() -> None:
    errors = default_rng(3).standard_t(3, (500, 5))
    rows = [good(i, fused_error_yaw_deg=e) for i, e in enumerate(errors)]
    fused = one(summary(rows)["envelopes"]["series"], source="fused", quantity="yaw_deg")
    for key, level in {"p50": 50.0, "p68": 68.27, "p95": 95.0, "p99_7": 99.73}.items():
        assert fused[key] == pytest.approx(np.percentile(np.abs(errors), level, axis=0))


def test_the_paper_s_bounds_and_the_published_limits_stand_beside_them() -> None:
    at = np.array([0.4, 0.6, 0.4, 0.1, 0.3])  # a metre, at 1000, 500, 100, 0 and -100 m
    found = summary([good(i, fused_error_cross_m=at) for i in range(20)])["envelopes"]
    early = one(found["bounds"], quantity="cross_m", stage="early")
    assert (early["value"], early["from_m"], early["to_m"]) == (0.5, 1000.0, 60.0)
    assert early["p95"]["vision"] == {"state": "kept", "first_m": 1000.0, "last_m": 100.0, "within_from_m": 1000.0}
    assert early["p95"]["fused"] == {"state": "broken", "first_m": 1000.0, "last_m": 100.0, "within_from_m": 100.0}
    late = one(found["bounds"], quantity="cross_m", stage="late")
    assert late["value"] == 0.2
    assert late["p95"]["fused"] == {"state": "broken", "first_m": 0.0, "last_m": -100.0, "within_from_m": None}
    assert {bound["quantity"] for bound in found["bounds"]} == set(QUANTITIES)
    wayfinder = one(found["limits"], name="Wayfinder", quantity="cross_m")
    assert dict(zip(wayfinder["distance_m"], wayfinder["value"], strict=True))[860.0] == 18.4
    assert one(found["limits"], name="ICAO CAT IIIB", quantity="height_m")["value"] == [2.0, 2.0]
    assert all("no certification is claimed" in limit["source"] for limit in found["limits"])


def test_a_limit_is_judged_as_far_as_the_flights_are_enough() -> None:
    """Nineteen of twenty have an estimate at 100 m, none at 0 m; the Wayfinder's limit falls with the distance."""
    rows = []
    for i in range(20):
        there = 0.1 if i else math.nan
        rows.append(good(i, fused_error_cross_m=np.array([21.8, 0.1, there, math.nan, 0.1])))
    found = summary(rows)["envelopes"]
    early = one(found["bounds"], quantity="cross_m", stage="early")["p95"]["fused"]
    assert early == {"state": "broken", "first_m": 1000.0, "last_m": 500.0, "within_from_m": 500.0}
    # 18.4 m at 860 m and 33 m at 1450 m: at 1000 m 21.864 m
    assert one(found["limits"], name="Wayfinder", quantity="cross_m")["p95"]["fused"]["state"] == "kept"
    few = one(summary(rows[:19])["envelopes"]["bounds"], quantity="cross_m", stage="early")["p95"]["fused"]
    assert few == {"state": "too few", "first_m": None, "last_m": None, "within_from_m": None}
    blind = [good(i, vision_error_yaw_deg=np.full(5, math.nan)) for i in range(20)]
    yaw = one(summary(blind)["envelopes"]["bounds"], quantity="yaw_deg", stage="early")["p95"]
    assert (yaw["vision"]["state"], yaw["fused"]["state"]) == ("none", "kept")


def test_consistency_is_over_flights_and_two_sided() -> None:
    n = 40
    means = 9.0 + np.linspace(-1.0, 1.0, n)
    rows = [
        good(i, nees9_mean_early=mean, nees9_mean_late=13.0, nees15_mean_late=8.0)
        | {"coverage95_yaw_deg": 0.5 + 0.02 * (i % 2), "coverage95_roll_deg": 0.94 + 0.02 * (i % 2)}
        for i, mean in enumerate(means.tolist())
    ] + [aloft(n, nees9_mean_early=None, frames_early=0)]
    found = summary(rows)["consistency"]
    early = one(found["nees"], key="nees9", phase="early")
    assert (early["flights"], early["frames"], early["mean"]) == (n, 100 * n, pytest.approx(9.0))
    expected = scipy_stats.ttest_1samp(means, 9.0).confidence_interval()
    assert (early["low"], early["high"]) == pytest.approx((expected.low, expected.high))
    bounds = scipy_stats.chi2.ppf((0.025, 0.975), 9 * n) / n
    assert (early["bound_low"], early["bound_high"]) == pytest.approx(tuple(bounds))
    assert early["median"]["value"] == pytest.approx(9.0)
    # of forty the 14th and the 27th are about the median
    assert (early["median"]["low"], early["median"]["high"]) == pytest.approx((means[13], means[26]))
    verdicts = {(e["key"], e["phase"]): e["verdict"] for e in found["nees"]}
    assert verdicts["nees9", "early"] == "consistent"
    assert verdicts["nees9", "late"] == "optimistic"
    assert verdicts["nees15", "late"] == "timid"
    late = one(found["nees"], key="nees9", phase="late")
    assert late["errors_over_sigma"] == pytest.approx(math.sqrt((13.0 * n + 9.0) / (n + 1) / 9.0))
    yaw, roll = (one(found["coverage"], quantity=q) for q in ("yaw_deg", "roll_deg"))
    assert (yaw["agrees"], roll["agrees"]) == (False, True)
    assert yaw["mean"] == pytest.approx(0.51, abs=0.02)


def drawn(n: int, seed: int = 0) -> list[Row]:
    """The sink rate goes by the wind, |y| by how far the start is off, nothing by the mass."""
    rng = default_rng(seed)
    rows = []
    for i, (wind, cross, mass, noise) in enumerate(rng.standard_normal((n, 4)).tolist()):
        draws = {
            "draw.wind.head_mps": 3.0 * wind,
            "draw.loading.extra_mass_kg": mass,
            "draw.camera.tilt_error_deg": 0.1,
        }
        sink, y = 0.5 + 0.02 * wind + 0.01 * noise, 0.1 * cross**3
        rows.append(good(i, start_cross_m=8.0 * cross, sink_rate_mps=sink, y_m=y, abs_y=abs(y)) | draws)
        del rows[-1]["abs_y"]
    return rows


def test_what_matters_is_found_and_what_does_not_is_not() -> None:
    rows = drawn(200)
    found = summary(rows)["sensitivity"]
    assert [entry["key"] for entry in found["inputs"]] == ["wind.head_mps", "loading.extra_mass_kg", "start_cross_m"]
    assert [entry["drawn_by"] for entry in found["inputs"]] == ["dispersion", "dispersion", "seed"]
    assert {entry["key"] for entry in found["results"]} == {"sink_rate_mps", "y_m", "abs_y_m"}
    assert len(found["pairs"]) == 9
    assert found["tests"] == 18
    wind = one(found["pairs"], input="wind.head_mps", result="sink_rate_mps")
    expected = scipy_stats.spearmanr([r["draw.wind.head_mps"] for r in rows], [r["sink_rate_mps"] for r in rows])
    assert (wind["rho"], wind["p"]) == pytest.approx((expected.statistic, expected.pvalue))
    assert wind["significant"]
    across = one(found["pairs"], input="start_cross_m", result="abs_y_m")
    assert not across["significant"]
    assert across["spread"]["significant"]
    assert across["spread"]["rho"] > 0.95
    mass = [entry for entry in found["pairs"] if entry["input"] == "loading.extra_mass_kg"]
    assert not any(entry["significant"] or entry["spread"]["significant"] for entry in mass)
    assert all(e["p_adjusted"] >= e["p"] for e in found["pairs"])
    (line,) = [line for line in found["text"] if line.startswith("sink rate")]
    assert "wind.head_mps (+" in line


def test_a_start_that_a_dispersion_draws_is_counted_once() -> None:
    rows = [row | {"draw.start.cross_m": row["start_cross_m"], "start_height_m": 60.0 + i} for i, row in
            enumerate(drawn(50))]  # fmt: skip
    found = summary(rows)["sensitivity"]
    assert [entry["key"] for entry in found["inputs"]] == [
        "wind.head_mps", "loading.extra_mass_kg", "start.cross_m", "start_height_m",
    ]  # fmt: skip


def test_an_ellipse_takes_as_many_touchdowns_as_its_level_asks_for() -> None:
    """Of five, 99.7 % would reach ten times as far as they lie apart."""
    places = default_rng(2).normal(0.0, (10.0, 0.3), (20, 2))
    for n, levels in ((4, []), (5, [50.0]), (10, [50.0, 95.0]), (20, [50.0, 95.0, 99.7])):
        found = summary([good(i, x_m=275.0 + x, y_m=y) for i, (x, y) in enumerate(places[:n].tolist())])["touchdown"]
        assert [one["level"] for one in found["ellipses"] if one["center"] is not None] == levels
        assert any("99.7 % takes 20" in text for text in found["text"]) == (4 < n < 20)


def test_sentences_have_numbers_as_tables_have_them() -> None:
    found = summary([good(i, nees9_mean_early=1619.0 + i % 3) for i in range(30)])
    (line,) = [text for text in found["consistency"]["text"] if text.startswith("early, 9 states")]
    assert "mean 1620 (" in line
    texts = [*found["consistency"]["text"], *found["rates"]["text"], *found["touchdown"]["text"]]
    assert not [text for text in texts if re.search(r"\de[+-]\d", text)]
    assert "1·10⁻⁶" in found["rates"]["text"][3]


def test_the_seeds_that_were_flown_are_said() -> None:
    assert summary([good(i) for i in (7, 4, 9)])["batch"]["seeds"] == [4, 9]
    assert summary([])["batch"]["seeds"] is None


def test_the_worst_are_those_that_failed_and_then_those_nearest_a_limit() -> None:
    rows = [good(i, sink_rate_mps=0.3 + 0.01 * i) for i in range(20)]
    rows[3] |= {"y_m": -1.9}  # uses 0.95 of 2 m
    rows[4] |= {"x_m": 432.5}  # uses 0.9 of the 175 m from the middle, 275 m, to the end
    rows[5] |= {"x_m": 107.5, "sink_rate_mps": 0.1}  # uses 0.957
    rows[6] |= {"sink_rate_mps": 1.2, "in_box": False}
    rows[7] |= {"bank_deg": -9.0, "in_box": False, "outcome": "crashed"}
    rows[8], rows[9] = failed(8), aloft(9)
    found = summary(rows)["worst"]["flights"]
    assert [entry["index"] for entry in found] == [8, 9, 7, 6, 5, 3, 4, 19, 18, 17]
    assert [entry["rank"] for entry in found] == list(range(1, 11))
    keys = [entry["limit"] and entry["limit"]["key"] for entry in found[:7]]
    assert keys == [None, None, "bank_max_deg", "sink_max_mps", "along_min_m", "cross_max_m", "along_max_m"]
    scores = [entry["score"] for entry in found[2:8]]
    assert scores == pytest.approx([3.0, 1.2, 167.5 / 175.0, 0.95, 0.9, 0.49])
    assert found[0]["command"] == "landsim replay DIR 8"
    assert found[0]["reason"] == "ValueError: no"
    assert found[0]["touchdown"] is None
    assert found[5]["touchdown"]["y_m"] == -1.9


def test_a_flight_s_most_unusual_draws_are_named() -> None:
    rows = drawn(100)
    rows[42] |= {"draw.wind.head_mps": 30.0, "y_m": 5.0, "in_box": False}
    worst = summary(rows)["worst"]["flights"][0]
    assert worst["index"] == 42
    hint = worst["draws"][0]
    assert (hint["key"], hint["value"], hint["share_below"]) == ("wind.head_mps", 30.0, 0.99)
    winds = np.array([row["draw.wind.head_mps"] for row in rows])
    assert hint["spreads_off"] == pytest.approx((30.0 - np.median(winds)) / winds.std())


@pytest.mark.parametrize(
    "rows",
    [
        [],
        [good(0)],
        [good(0), good(1)],
        [good(i) for i in range(30)],
        [failed(0)],
        [failed(i) for i in range(12)],
        [aloft(i) for i in range(12)],
        [good(0), failed(1), aloft(2)],
        [good(i) | {"index": None} for i in range(3)],
        [good(0, outcome="lost")],
    ],
)
def test_batches_of_the_worst_kind_have_a_summary(rows: list[Row]) -> None:
    found = summary(rows)
    assert found["batch"]["n"] == len(rows)
    assert sum(entry["count"] for entry in found["rates"]["outcomes"]) == len(rows)
    assert found["touchdown"]["n"] == sum(row["x_m"] is not None for row in rows)
    assert found["touchdown"]["ellipses"][0]["center"] is None
    assert len(found["worst"]["flights"]) == min(len(rows), 10)


def test_the_same_flights_have_the_same_summary() -> None:
    rows = drawn(50)
    one_time, another = (summarise(SCENARIO, flights_of(rows), {"seed": 0, "wall_time_s": t}) for t in (10.0, 20.0))
    assert (one_time["batch"].pop("wall_time_s"), another["batch"].pop("wall_time_s")) == (10.0, 20.0)
    assert one_time["batch"].pop("flights_per_second") == 5.0
    assert another["batch"].pop("flights_per_second") == 2.5
    assert json.dumps(one_time) == json.dumps(another)


def test_the_batch_is_told_as_its_identity_has_it() -> None:
    known = {"scenario": "gusty", "n": 9, "seed": 4, "shard": "1/3", "engine": "dask", "workers": 2, "wall_time_s": 4.0}
    batch = summary([good(4, wall_time_s=0.5), good(7, wall_time_s=1.5)], sampling="sobol", **known)["batch"]
    assert {key: batch[key] for key in known if key != "n"} == {key: known[key] for key in known if key != "n"}
    assert (batch["n"], batch["asked"]) == (2, 9)
    assert (batch["sampling"], batch["flights_per_second"]) == ("sobol", 0.5)
    assert batch["flight_wall_time_s"] == {"median": 1.0, "p95": pytest.approx(1.45)}


def test_flights_come_from_a_file_as_from_rows(tmp_path: Path) -> None:
    rows = [*drawn(20), failed(20) | {"draw.wind.head_mps": 1.0, "draw.loading.extra_mass_kg": None}]
    rows[-1] |= {"draw.camera.tilt_error_deg": 0.1, "traceback": "one.py:1\nValueError: no"}
    save_rows(tmp_path / "flights.parquet", rows)
    read, made = load_flights(tmp_path / "flights.parquet"), flights_of(rows)
    assert (read.n, read.draws) == (21, ("wind.head_mps", "loading.extra_mass_kg", "camera.tilt_error_deg"))
    assert read.columns["traceback"][-1] == rows[-1]["traceback"]
    for name, values in made.columns.items():
        np.testing.assert_array_equal(read.columns[name], values, err_msg=name)
    for name, array in made.arrays.items():
        np.testing.assert_array_equal(read.arrays[name], array, err_msg=name)
    assert summarise(SCENARIO, read, {}) == summarise(SCENARIO, made, {})


def test_no_flights_come_from_a_file(tmp_path: Path) -> None:
    save_rows(tmp_path / "flights.parquet", [])
    read = load_flights(tmp_path / "flights.parquet")
    assert (read.n, read.distances.size) == (0, 0)
    assert summarise(SCENARIO, read, {})["rates"]["success"]["rate"] is None


def test_a_file_of_something_else_is_told_in_a_line(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "flights.parquet"
    with pytest.raises(RunFolderError, match="No such file"):
        load_flights(path)
    path.write_text("nothing")
    with pytest.raises(RunFolderError, match="not a Parquet file"):
        load_flights(path)
    pq.write_table(pa.table({"index": [1], "seed": [1]}), path)
    with pytest.raises(RunFolderError, match="column line_noise is missing"):
        load_flights(path)
    save_rows(path, [good(0), good(1, distance_m=DISTANCE + 1.0)])
    with pytest.raises(RunFolderError, match="distances differ"):
        load_flights(path)
    save_rows(path, [good(0), good(1, distance_m=DISTANCE[1:])])
    with pytest.raises(RunFolderError, match="differ in length"):
        load_flights(path)


def test_rows_of_different_batches_are_not_put_together() -> None:
    with pytest.raises(ValueError, match="columns"):
        flights_of([good(0), good(1) | {"draw.wind.head_mps": 1.0}])
    with pytest.raises(ValueError, match="distances"):
        flights_of([good(0), good(1, distance_m=DISTANCE + 1.0)])


def test_a_lost_flight_s_row_says_what_became_of_it() -> None:
    def inner() -> None:
        raise RuntimeError("wings fell off")

    try:
        inner()
    except RuntimeError as failure:
        told = traceback_of(failure)
    lines = told.splitlines()
    assert lines[-1] == "RuntimeError: wings fell off"
    assert lines[-2].startswith("test_batch_summary.py:")
    assert lines[-2].endswith('in inner: raise RuntimeError("wings fell off")')
    row = lost_row(SCENARIO, 5, DISTANCE, "RuntimeError: wings fell off", told)
    assert (row["outcome"], row["end"], row["in_box"], row["seed"]) == ("error", "error", False, 5)
    assert row["traceback"] == told
    flights = flights_of([row])
    assert isinstance(flights, Flights)
    assert np.isnan(flights.arrays["fused_error_cross_m"]).all()
    assert summarise(SCENARIO, flights, {})["worst"]["flights"][0]["reason"] == "RuntimeError: wings fell off"
