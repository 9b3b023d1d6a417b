"""The verdict of batches whose numbers are known beforehand.

====================  ============================================================================================
limits                counts and quantiles of rows made for them; Clopper and Pearson's interval by scipy's binomtest
outcomes              each row is of one kind, by hand
protection levels     one flight a group: Student's interval by scipy of equal groups, counts by hand
faults                rows that say when a line was found
====================  ============================================================================================
"""

import math
from typing import Any

import numpy as np
import pytest
from flown import aloft, around, failed, good
from numpy.random import default_rng
from scipy import stats as scipy_stats

from landsim.batch.flights import flights_of
from landsim.batch.row import Row
from landsim.batch.stats import ratio_interval
from landsim.batch.summary import summarise
from landsim.config import load_scenario

LINES = {"navigation.aiding": "lines", "fault.kind": "wrong"}


def summary(rows: list[Row], **overrides: Any) -> dict[str, Any]:
    scenario = load_scenario("landing", overrides=overrides)
    return summarise(scenario, flights_of(rows), {"seed": 0, "versions": {}})


def verdict(rows: list[Row], **overrides: Any) -> dict[str, Any]:
    return dict(summary(rows, **overrides)["verdict"])


def of(entries: list[dict[str, Any]], key: str) -> dict[str, Any]:
    (found,) = [entry for entry in entries if entry["key"] == key]
    return found


def within(count: int, n: int) -> dict[str, Any]:
    exact = scipy_stats.binomtest(count, n).proportion_ci(0.95, "exact")
    rate = {"count": count, "n": n, "rate": count / n, "low": exact.low, "high": exact.high}
    return {key: pytest.approx(value, abs=1e-12) for key, value in rate.items()}


def rate_of(entry: dict[str, Any]) -> dict[str, Any]:
    return {key: entry[key] for key in ("count", "n", "rate", "low", "high")}


def test_a_limit_has_its_rate_what_n_shows_and_the_room_that_is_left() -> None:
    """Sink rates 0.01 to 2.00 m/s, of which half are beyond 1 m/s and the hardest crashed; three never came down."""
    rows = [good(i, sink_rate_mps=0.01 * (i + 1), outcome="crashed" if i > 190 else "landed") for i in range(200)]
    found = verdict([*rows, aloft(200), around(201), failed(202)])
    sink = of(found["limits"], "sink_max_mps")
    assert rate_of(sink) == within(100, 200)
    # one-sided: the rate at which 100 or fewer of 200 have 5 %
    assert scipy_stats.binom.cdf(100, 200, sink["below"]) == pytest.approx(0.05)
    # the 99 % quantile is at 0.99 · 199 = 197.01 of the sorted: 1.9801
    assert (sink["quantile"]["p"], sink["quantile"]["value"]) == (0.99, pytest.approx(1.9801))
    assert (sink["margin"], sink["worst"], sink["margin_of_worst"]) == pytest.approx((-0.9801, 2.0, -1.0))
    # of two hundred the 195th is below the 99 % quantile with 97.5 %, and none is above it with as much
    assert (sink["quantile"]["low"], sink["quantile"]["high"]) == (pytest.approx(1.95), None)
    assert sink["used"]["worst"] == pytest.approx(2.0)
    assert {q["p"]: q["value"] for q in sink["used"]["quantiles"]} == pytest.approx(
        {0.05: 0.1095, 0.5: 1.005, 0.95: 1.9005, 0.99: 1.9801}
    )
    assert (sink["criterion"]["rate"], sink["of"]) == (1e-6, "flights with a touchdown")
    assert "no certification is claimed" in sink["criterion"]["source"]
    stop = of(found["limits"], "stop_cross_max_m")
    assert (stop["count"], stop["criterion"], stop["margin_of_worst"]) == (0, None, 3.0)
    assert stop["below"] == pytest.approx(1.0 - 0.05 ** (1.0 / 200.0))


def test_a_limit_from_below_and_one_of_a_magnitude_count_towards_their_side() -> None:
    rows = [good(i, x_m=90.0 + i, y_m=-0.02 * i) for i in range(120)]
    found = verdict(rows)["limits"]
    short, far, lateral = (of(found, key) for key in ("along_min_m", "along_max_m", "cross_max_m"))
    assert rate_of(short) == within(10, 120)
    assert (short["worst"], short["margin_of_worst"]) == (90.0, -10.0)
    # the 1 % quantile is at 0.01 · 119 = 1.19 of the sorted
    assert (short["quantile"]["p"], short["quantile"]["value"]) == (pytest.approx(0.01), pytest.approx(91.19))
    assert short["margin"] == pytest.approx(-8.81)
    assert (far["count"], far["worst"], far["margin_of_worst"]) == (0, 209.0, 241.0)
    assert rate_of(lateral) == within(19, 120)  # 2.02 to 2.38 m left
    assert (lateral["worst"], lateral["margin_of_worst"]) == pytest.approx((2.38, -0.38))


def test_a_quantile_takes_as_many_flights_as_have_one_beyond_it() -> None:
    for n, levels in ((1, []), (2, [0.5]), (19, [0.5]), (20, [0.05, 0.5, 0.95]), (100, [0.05, 0.5, 0.95, 0.99])):
        bank = of(verdict([good(i, bank_deg=0.01 * i) for i in range(n)])["limits"], "bank_max_deg")
        assert [q["p"] for q in bank["used"]["quantiles"]] == levels
        assert (bank["quantile"] is None) == (bank["margin"] is None) == (n < 100)
        assert bank["margin_of_worst"] == pytest.approx(3.0 - 0.01 * (n - 1))


def test_the_tracking_criteria_are_limits_of_each_flight_s_95_percent() -> None:
    rows = [good(i, glide_slope_to_flare_p95_m=3.5 + 0.1 * i, localizer_p95_m=17.4 + 0.05 * i) for i in range(5)]
    slope, localizer = verdict(rows)["tracking"]
    assert (slope["key"], slope["limit"]) == ("glide_slope_to_flare_p95_m", pytest.approx(3.6576))
    assert rate_of(slope) == within(3, 5)
    assert slope["margin_of_worst"] == pytest.approx(3.6576 - 3.9)
    assert slope["used"]["worst"] == pytest.approx(3.9 / 3.6576)
    assert (localizer["count"], localizer["estimate"], slope["estimate"]) == (2, True, False)


def test_every_flight_ends_in_one_way_and_what_nobody_was_warned_of_is_told() -> None:
    rows = [good(i) for i in range(10)]
    rows += [good(10, in_box=False, flagged=True), good(11, in_box=False), good(12, in_box=False)]
    rows += [good(13, outcome="crashed", in_box=False, flagged=True), good(14, outcome="crashed", in_box=False)]
    rows += [good(15, outcome="off_runway", in_box=False), around(16), aloft(17), failed(18)]
    rows += [aloft(19, outcome="diverged", flagged=True)]
    found = verdict(rows)
    counts = {one["key"]: one["count"] for one in found["outcomes"]}
    assert counts == {
        "in_box": 10, "outside_flagged": 1, "outside": 2, "crashed_flagged": 1, "crashed": 2, "go_around": 1,
        "other": 3,
    }  # fmt: skip
    assert all(rate_of(one) == within(one["count"], 20) for one in found["outcomes"])
    assert rate_of(found["harm"]) == within(4, 20)
    text = " ".join(found["text"])
    assert found["text"][0].startswith("10 of 20 flights (50 %, between 27.2 % and 72.8 %) landed in the box, 1 of 20")
    assert "2 missed the box or crashed with a flag" in text
    assert "4 of 20 flights (20 %" in text
    assert "2,995,731 flights" in text


def test_none_unwarned_is_told_with_what_n_allows() -> None:
    text = verdict([good(i) for i in range(59)])["text"]
    # 59 in a row have 5 % at 4.95 %
    assert "No flight of 59 " in text[1]
    assert "fewer than 4.95 % of all" in text[1]
    assert "none went around" in text[0]
    assert "sink rate: 0.5 m/s in the worst flight, 0.5 m/s of room. No flight went beyond a limit." in text[2]
    wide = verdict([good(0, y_m=-2.5, in_box=False), *(good(i) for i in range(1, 5))])["text"][2]
    assert "|lateral touchdown|: 2.5 m in the worst flight, 0.5 m beyond it." in wide
    assert wide.endswith("Limits that some flight went beyond: |lateral touchdown| (1 of 5).")


def test_a_go_around_is_no_failure_and_its_reasons_are_counted_without_their_heights() -> None:
    level = "lateral protection level above 10 m"
    rows = [good(i) for i in range(6)]
    rows += [around(6 + i, f"{level}, {height} m up") for i, height in enumerate(("29.9", "12.0", "-0.1"))]
    rows += [around(9, "more than 8 m off the centreline, 25.0 m up"), around(10, "fog, 3 m up there")]
    rows += [aloft(11)]
    found = summary(rows)
    reasons = {one["reason"]: one["count"] for one in found["verdict"]["go_arounds"]}
    assert list(reasons.items()) == [
        (level, 3), ("fog, 3 m up there", 1), ("more than 8 m off the centreline", 1),
    ]  # fmt: skip
    assert rate_of(found["verdict"]["go_arounds"][0]) == within(3, 12)
    rates = found["rates"]
    assert rates["gone_around"] == within(5, 12)
    assert (rates["success"]["count"], rates["can_show"]["failures"]) == (6, 1)
    assert "5 of 12 went around" in rates["text"][1]
    assert "With 1 failure in 12 flights" in rates["text"][2]
    # what failed comes first, what was given up last
    assert [one["index"] for one in found["worst"]["flights"]] == [11, 0, 1, 2, 3, 4, 5, 6, 7, 8]
    assert all(entry["n"] == 6 for entry in found["verdict"]["limits"])


def test_errors_beyond_the_protection_level_are_over_flights() -> None:
    """Forty flights of 700 frames: of the lateral error 70 in each of ten are beyond; of the vertical none."""
    rows = [good(i, lateral_exceeded_frames=70 if i < 10 else 0, misleading_frames=7 * (i < 4)) for i in range(40)]
    rows += [aloft(40, lateral_protection_frames=0, vertical_protection_frames=0), failed(41)]
    found = verdict(rows)["protection"]
    assert found["risk"] == 1e-4
    lateral, vertical = found["levels"]
    assert (lateral["frames"], lateral["exceeded_frames"], lateral["share"]) == (28000, 700, 0.025)
    # groups of one size: their shares are 0.1 and 0, ten times and thirty times
    student = scipy_stats.ttest_1samp([0.1] * 10 + [0.0] * 30, 0.0).confidence_interval()
    assert lateral["low"] == pytest.approx(student.low)
    assert lateral["high"] == pytest.approx(max(student.high, 0.1 * within(10, 40)["high"].expected))
    assert lateral["state"] == "more"
    assert rate_of(lateral["flights"]) == within(10, 40)
    nothing = within(0, 40)
    assert (vertical["share"], vertical["low"], vertical["high"]) == (0.0, 0.0, nothing["high"])
    assert vertical["state"] == "open"
    assert rate_of(found["misleading"]) == within(4, 40)
    assert found["misleading"]["frames"] == 28
    text = " ".join(verdict(rows)["text"])
    assert "the lateral error was beyond its own in 2.5 % of 28,000 frames" in text
    assert "passed in 4 of 40 flights (10 %" in text


def test_the_risk_that_is_stated_can_be_shown_to_be_kept() -> None:
    rows = [good(i) for i in range(40)]
    levels = verdict(rows, **{"navigation.integrity_risk": 0.1})["protection"]["levels"]
    assert [one["state"] for one in levels] == ["kept", "kept"]  # none of forty: below 8.8 %
    few = [good(i, lateral_exceeded_frames=7 if i < 2 else 0) for i in range(40)]
    lateral, _ = verdict(few, **{"navigation.integrity_risk": 0.1})["protection"]["levels"]
    assert lateral["state"] == "open"  # two flights say nothing of how long it lasts
    assert lateral["high"] == pytest.approx(0.01 * within(2, 40)["high"].expected)
    nobody = verdict([failed(0)])["protection"]
    assert [one["state"] for one in nobody["levels"]] == [None, None]
    assert nobody["misleading"]["rate"] is None


def test_a_share_of_unequal_groups_by_its_linearisation() -> None:
    """Drawn anew from such groups, the interval holds the true share as often as it says."""
    rng, held = default_rng(5), 0
    for _ in range(400):
        sizes = rng.integers(100, 900, 60)
        counts = rng.binomial(sizes, rng.beta(2.0, 8.0, 60))
        low, high = ratio_interval(counts.astype(float), sizes.astype(float))
        assert low is not None
        assert high is not None
        held += low <= 0.2 <= high
    assert scipy_stats.binomtest(held, 400, 0.95).pvalue > 0.001
    assert ratio_interval(np.array([1.0]), np.array([2.0])) == (None, None)
    assert ratio_interval(np.array([2.0, 2.0]), np.array([2.0, 2.0])) == (1.0, 1.0)


def test_wrong_lines_are_found_in_time_late_or_never() -> None:
    rows = [good(i, fault_at_s=8.0, fault_detected_after_s=0.3) for i in range(6)]
    rows += [good(6, fault_at_s=8.0, fault_detected_after_s=9.0 - 8.0 + 1e-14)]
    rows += [good(7, fault_at_s=8.0, fault_detected_after_s=1.1), good(8, fault_at_s=8.0, fault_detected_after_s=None)]
    rows += [good(9, false_alarm=True), good(10), aloft(11), failed(12)]
    found = verdict(rows, **LINES)["faults"]
    assert rate_of(found["detected"]) == within(7, 9)
    assert rate_of(found["detected_ever"]) == within(8, 9)
    assert (found["median_s"], found["longest_s"]) == (pytest.approx(0.3), 1.1)
    assert rate_of(found["false_alarms"]) == within(1, 3)
    text = " ".join(verdict(rows, **LINES)["text"])
    assert "within 1 s in 7 of 9 flights (77.78 %" in text
    assert "it took 1.1 s at most, and was never found in 1." in text
    missing = verdict(rows, **LINES | {"fault.kind": "missing"})["faults"]
    assert missing["detected"]["n"] == 0  # a line that is not there is not to be found wrong
    poses = verdict(rows)
    assert (poses["faults"]["monitored"], poses["faults"]["false_alarms"]["n"]) == (False, 0)
    assert any("No line was judged by itself" in line for line in poses["text"])
    truth = verdict(rows, **LINES | {"simulation.guidance_state": "truth"})["faults"]
    assert (truth["monitored"], truth["false_alarms"]["n"]) == (False, 0)


@pytest.mark.parametrize("rows", [[], [failed(0)], [aloft(0)], [around(0)], [good(0)], [good(0), around(1)]])
def test_batches_of_little_have_a_verdict(rows: list[Row]) -> None:
    found = verdict(rows, **LINES)
    assert sum(one["count"] for one in found["outcomes"]) == len(rows)
    assert all(math.isfinite(one["count"]) for one in found["limits"])
    assert found["text"]
    assert not [line for line in found["text"] if "nan" in line or "None" in line.split()]
