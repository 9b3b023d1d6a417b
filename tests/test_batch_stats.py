"""Statistics of a sample.

Clopper-Pearson        scipy's exact interval; Newcombe, Statistics in Medicine 17 (1998) 857, table I
no failure             the binomial itself
quantiles              the table of order statistics about the median; how often the interval holds, by drawing
ellipses               how often they hold, by drawing; an ellipse laid out by hand
mean, χ²               scipy's t test; a χ² table
rank correlation       ranks by hand, with ties; the worked example of IQ and hours of television
many tests             the example of Benjamini and Hochberg, J. R. Statist. Soc. B 57 (1995) 289
pairs                  Fagerland, Lydersen, Laake, Statistics in Medicine 33 (2014) 2850, airway hyper-responsiveness
"""

import math

import numpy as np
import pytest
from scipy import stats as scipy_stats

from landsim.batch import stats
from landsim.batch.ellipse import prediction_ellipse
from landsim.batch.paired import Table, mcnemar, paired_differences, rate_difference, table_of

IQ = [106.0, 100.0, 86.0, 101.0, 99.0, 103.0, 97.0, 113.0, 112.0, 110.0]
HOURS = [7.0, 27.0, 2.0, 50.0, 28.0, 29.0, 20.0, 12.0, 6.0, 17.0]
"""Of television a week."""


def test_clopper_pearson_is_scipy_s_exact_interval() -> None:
    for n in (1, 2, 7, 60, 1000):
        counts = np.unique(np.linspace(0, n, 25).astype(int))
        low, high = stats.clopper_pearson(counts, n)
        for k, a, b in zip(counts.tolist(), low, high, strict=True):
            exact = scipy_stats.binomtest(k, n).proportion_ci(0.95, "exact")
            assert (a, b) == pytest.approx((exact.low, exact.high), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("count", "n", "low", "high"),
    [(81, 263, 0.2527, 0.3676), (15, 148, 0.0578, 0.1617), (0, 20, 0.0, 0.1684), (1, 29, 0.0009, 0.1776)],
)
def test_clopper_pearson_as_published(count: int, n: int, low: float, high: float) -> None:
    found = stats.rate(count, n)
    assert (found["low"], found["high"]) == pytest.approx((low, high), abs=5.1e-5)
    assert found["rate"] == count / n


def test_nothing_is_known_of_no_flights() -> None:
    assert stats.rate(0, 0) == {"count": 0, "n": 0, "rate": None, "low": None, "high": None}
    assert stats.upper_bound(0, 0) is None


@pytest.mark.parametrize("n", [1, 10, 200, 5000])
def test_the_bound_without_a_failure_is_the_rate_that_would_have_been_seen(n: int) -> None:
    bound = stats.upper_bound(0, n)
    assert bound is not None
    assert (1.0 - bound) ** n == pytest.approx(0.05, rel=1e-9)  # the chance of no failure at that rate
    assert bound < 3.0 / n


def test_the_bound_with_failures_is_where_so_few_are_unlikely() -> None:
    bound = stats.upper_bound(3, 200)
    assert bound is not None
    assert scipy_stats.binom.cdf(3, 200, bound) == pytest.approx(0.05, rel=1e-9)
    assert stats.upper_bound(5, 5) == 1.0


@pytest.mark.parametrize(("rate", "needed"), [(0.01, 299), (1e-3, 2995), (1e-6, 2_995_731)])
def test_flights_that_show_a_rate_without_failure(rate: float, needed: int) -> None:
    assert stats.flights_needed(rate) == needed
    none = [math.exp(n * math.log1p(-rate)) for n in (needed, needed - 1)]
    assert none[0] <= 0.05 < none[1]


@pytest.mark.parametrize(("n", "r", "s"), [(6, 1, 6), (10, 2, 9), (20, 6, 15), (30, 10, 21), (100, 40, 61)])
def test_order_statistics_about_the_median_as_tabulated(n: int, r: int, s: int) -> None:
    assert stats.quantile_interval(np.arange(1.0, n + 1.0), 0.5) == (r, s)


def test_a_quantile_that_the_sample_does_not_reach_has_no_bound() -> None:
    values = np.arange(50.0)
    assert stats.quantile_interval(values, 0.99).high is None
    assert stats.quantile_interval(values, 0.01).low is None
    assert stats.quantile_interval(values[:5], 0.5) == (None, None)  # 1/16 of five are all on one side
    assert stats.quantile_interval(np.empty(0), 0.5) == (None, None)


@pytest.mark.parametrize(("n", "p"), [(40, 0.5), (120, 0.9), (400, 0.95), (60, 0.95)])
def test_quantile_intervals_hold_as_often_as_they_say(n: int, p: float) -> None:
    """Of a skew distribution; no more often than order statistics have to, where both ends exist."""
    rng, truth = np.random.default_rng(5), -math.log(1.0 - p)
    held, ended = 0, True
    for _ in range(4000):
        low, high = stats.quantile_interval(np.sort(rng.exponential(size=n)), p)
        held += (low is None or low <= truth) and (high is None or truth <= high)
        ended = ended and high is not None
    assert held / 4000 >= 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 4000)
    if ended:
        assert held / 4000 <= 0.985


def test_mean_interval_is_student_s() -> None:
    values = np.random.default_rng(2).exponential(size=17)
    expected = scipy_stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert stats.mean_interval(values) == pytest.approx((expected.low, expected.high), rel=1e-12)
    assert stats.mean_interval(values[:1]) == (None, None)


def test_chi_square_bounds_by_the_table() -> None:
    assert stats.chi_square_bounds(9, 1) == pytest.approx((2.700, 19.023), abs=5e-4)
    assert stats.chi_square_bounds(2, 50) == pytest.approx((74.222 / 50.0, 129.561 / 50.0), abs=5e-5)
    assert stats.chi_square_bounds(9, 0) == (None, None)


def test_exceedance_by_hand() -> None:
    curve = stats.exceedance(np.array([1.0, 2.0, 2.0, 5.0]))
    assert curve.x.tolist() == [1.0, 2.0, 5.0]
    assert curve.share.tolist() == [1.0, 0.75, 0.25]
    for share, low, high in zip(curve.share, curve.low, curve.high, strict=True):
        exact = scipy_stats.binomtest(round(4 * share), 4).proportion_ci(0.95, "exact")
        assert (low, high) == pytest.approx((exact.low, exact.high))
    assert stats.exceedance(np.empty(0)).x.size == 0


def test_a_thinned_exceedance_keeps_the_largest_and_the_shares() -> None:
    values = np.sort(np.round(np.random.default_rng(1).normal(size=20_000), 4))
    curve = stats.exceedance(values, most=200)
    assert 100 < curve.x.size <= 200
    assert curve.x[-10:].tolist() == np.unique(values)[-10:].tolist()
    assert curve.share == pytest.approx([np.mean(values >= x) for x in curve.x], abs=1e-12)
    assert (curve.x[0], curve.share[0]) == (values[0], 1.0)


def test_rank_correlation_of_the_worked_example() -> None:
    found = stats.rank_correlation(np.array(IQ), np.array(HOURS))
    assert found.n == 10
    # without ties, ρ = 1 - 6 Σd²/(n (n² - 1)); the ranks, counted by hand, differ by squares of 194 in all
    assert found.rho == pytest.approx(1.0 - 6.0 * 194.0 / 990.0)


def test_rank_correlation_with_ties_and_gaps_is_pearson_s_of_mean_ranks() -> None:
    nan = math.nan
    x = np.array([3.0, 1.0, 2.0, 2.0, 5.0, nan, 4.0])
    y = np.array([1.0, 1.0, 1.0, 4.0, 9.0, 7.0, nan])
    found = stats.rank_correlation(x, y)
    # of the five that have both: ranks 4, 1, 2.5, 2.5, 5 and 2, 2, 2, 4, 5
    expected = np.corrcoef([4.0, 1.0, 2.5, 2.5, 5.0], [2.0, 2.0, 2.0, 4.0, 5.0])[0, 1]
    assert found.n == 5
    assert found.rho == pytest.approx(expected)
    many = np.random.default_rng(3).integers(0, 6, (2, 80)).astype(float)
    other = scipy_stats.spearmanr(*many)
    assert stats.rank_correlation(*many)[1:] == pytest.approx((other.statistic, other.pvalue))


@pytest.mark.parametrize("y", [[1.0, 2.0, 3.0, math.nan], [2.0, 2.0, 2.0, 2.0]])
def test_too_few_or_constant_columns_rank_nothing(y: list[float]) -> None:
    found = stats.rank_correlation(np.arange(4.0), np.array(y))
    assert found.rho is found.p is None


def test_p_values_are_adjusted_as_in_the_original_example() -> None:
    p = [0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459]
    p += [0.3240, 0.4262, 0.5719, 0.6528, 0.7590, 1.000]
    found = stats.adjusted([*p, math.nan])
    assert np.flatnonzero(found[:-1] < 0.05).tolist() == [0, 1, 2, 3]
    assert found[0] == pytest.approx(15 * 0.0001)
    assert found[3] == pytest.approx(15 * 0.0095 / 4)
    assert math.isnan(found[-1])
    assert np.isnan(stats.adjusted([math.nan])).all()


COVARIANCE = np.array([[9.0, -1.2], [-1.2, 0.25]])


@pytest.mark.parametrize("level", [0.5, 0.95, 0.997])
def test_ellipses_hold_their_share_of_ten_thousand_normal_points(level: float) -> None:
    rng = np.random.default_rng(4)
    points = rng.multivariate_normal((220.0, 0.3), COVARIANCE, 10_000)
    found = prediction_ellipse(points, level)
    assert found is not None
    assert abs(float(np.mean(found.holds(points))) - level) < 0.01
    others = rng.multivariate_normal((220.0, 0.3), COVARIANCE, 10_000)
    assert abs(float(np.mean(found.holds(others))) - level) < 0.01


def test_an_ellipse_of_few_flights_holds_the_next_one() -> None:
    """Of six flights: 95 % of the next ones, where the ellipse of a known covariance would hold four fifths."""
    rng, held, plain = np.random.default_rng(6), 0, 0
    for _ in range(4000):
        points = rng.multivariate_normal((0.0, 0.0), COVARIANCE, 7)
        found = prediction_ellipse(points[:6], 0.95)
        assert found is not None
        held += bool(found.holds(points[6:])[0])
        off = points[6] - points[:6].mean(axis=0)
        plain += off @ np.linalg.solve(np.cov(points[:6].T), off) <= scipy_stats.chi2.ppf(0.95, 2)
    assert held / 4000 == pytest.approx(0.95, abs=0.012)
    assert plain / 4000 < 0.85


def test_an_ellipse_laid_out_by_hand() -> None:
    """Axes of 6 and 2 times a common scale, the major one 30° from x towards y."""
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    ends = np.array([(6.0 * c, 6.0 * s), (-6.0 * c, -6.0 * s), (-2.0 * s, 2.0 * c), (2.0 * s, -2.0 * c)])
    points = ends + np.array((5.0, -1.0))
    found = prediction_ellipse(points, 0.5)
    assert found is not None
    assert found.center == pytest.approx((5.0, -1.0))
    assert math.degrees(found.angle) == pytest.approx(30.0)
    assert found.semi_major / found.semi_minor == pytest.approx(3.0)
    # F(0.5; 2, 2) = 1, so that the square of the scale is 2·3·5/(4·2) = 3.75, of variances 2·36/3 and 2·4/3
    assert found.semi_major == pytest.approx(math.sqrt(3.75 * 24.0))
    corners = found.polygon()
    assert corners[0] == pytest.approx((5.0 + found.semi_major * c, -1.0 + found.semi_major * s))
    np.testing.assert_array_equal(corners[0], corners[-1])
    inside = found.holds(np.array([corners[:-1].mean(axis=0), 1.001 * (corners[7] - found.center) + found.center]))
    assert inside.tolist() == [True, False]


@pytest.mark.parametrize(
    "points", [[], [(1.0, 2.0)], [(1.0, 2.0), (3.0, 4.0)], [(1.0, 2.0)] * 9, [(i, 2.0 * i) for i in range(9)]]
)
def test_too_few_points_or_points_on_a_line_have_no_ellipse(points: list[tuple[float, float]]) -> None:
    assert prediction_ellipse(np.array(points, dtype=float).reshape(-1, 2), 0.95) is None


def test_pairs_as_published() -> None:
    table = Table(both=1, first=1, second=7, neither=12)
    found = rate_difference(table)
    assert found["difference"] == pytest.approx(8 / 21 - 2 / 21)
    assert (found["low"], found["high"]) == pytest.approx((0.026, 0.507), abs=5.1e-4)
    assert mcnemar(table) == pytest.approx(2.0 * (1 + 8) / 2**8)  # none or one of eight to one side
    assert mcnemar(Table(5, 0, 0, 2)) is None
    assert rate_difference(Table(0, 0, 0, 0)) == {"difference": None, "low": None, "high": None}


def test_a_difference_of_rates_turns_its_sign_with_the_batches() -> None:
    one, other = rate_difference(Table(40, 3, 9, 8)), rate_difference(Table(40, 9, 3, 8))
    assert [one["low"], one["high"]] == pytest.approx([-other["high"], -other["low"]])  # type: ignore[operator]


def test_a_table_of_pairs() -> None:
    first, second = np.array([1, 1, 1, 0, 0, 0, 0], bool), np.array([1, 1, 0, 1, 0, 0, 0], bool)
    assert table_of(first, second) == Table(2, 1, 1, 3)


def test_paired_differences_are_over_the_pairs_that_have_both() -> None:
    rng = np.random.default_rng(8)
    first = rng.normal(10.0, 5.0, 400)
    second = first + rng.normal(0.3, 0.2, 400)
    first[0], second[1] = math.nan, math.nan
    found = paired_differences(first, second, np.random.default_rng(0))
    differences = (second - first)[2:]
    assert found["n"] == 398
    assert found["mean"]["value"] == pytest.approx(differences.mean())
    averages = (differences[:, None] + differences)[np.triu_indices(398)] / 2.0
    assert found["shift"]["value"] == pytest.approx(np.median(averages))
    # at n = 400 the bootstrap is Student's interval but for its own noise
    student = stats.mean_interval(differences)
    width = student.high - student.low  # type: ignore[operator]
    assert (found["mean"]["low"], found["mean"]["high"]) == pytest.approx(tuple(student), abs=0.06 * width)
    assert found["wilcoxon_p"] < 1e-30
    again = paired_differences(first, second, np.random.default_rng(0))
    assert again == found


def test_the_shift_of_a_sample_as_published() -> None:
    """Hamilton's depression scale before and after; M. Hollander and D. Wolfe, examples 3.1, 3.3 and 3.4."""
    before = np.array([1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30])
    after = np.array([0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29])
    change = np.sort(after - before)
    assert stats.walsh_median(change) == pytest.approx(-0.46)
    assert tuple(stats.walsh_interval(change)) == pytest.approx((-0.786, -0.010))
    assert stats.walsh_p(change) == pytest.approx(2.0 * 0.01953, abs=1e-5)


@pytest.mark.parametrize("n", [7, 20, 51, 149])
def test_signed_ranks_are_scipy_s(n: int) -> None:
    sample = np.sort(np.random.default_rng(n).standard_normal(n) + 0.2)
    assert stats.walsh_p(sample) == pytest.approx(scipy_stats.wilcoxon(sample, method="exact").pvalue)
    averages = np.sort((sample[:, None] + sample)[np.triu_indices(n)] / 2.0)
    assert stats.walsh_median(sample) == pytest.approx(np.median(averages), abs=1e-14)
    assert set(stats.walsh_interval(sample)) <= set(averages)


def test_many_signed_ranks_are_normal() -> None:
    sample = np.sort(np.random.default_rng(0).standard_normal(400) + 0.1)
    expected = scipy_stats.wilcoxon(sample, method="approx", correction=True).pvalue
    assert stats.walsh_p(sample) == pytest.approx(expected, rel=1e-6)


def test_the_interval_leaves_zero_out_just_where_the_test_does() -> None:
    """Also with ties and zeros, which round numbers have."""
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(400):
        sample = np.sort(rng.integers(-3, 6, rng.integers(1, 30)) / 4.0)
        low, high = stats.walsh_interval(sample)
        outside = low is not None and high is not None and not low <= 0.0 <= high
        assert outside == (stats.walsh_p(sample) <= 1.0 - stats.CONFIDENCE)
        seen.add(outside)
    assert seen == {True, False}
    assert stats.walsh_interval(np.arange(5.0)) == (None, None)  # five to one side happen in 1 of 16


def test_equal_batches_differ_by_nothing() -> None:
    found = paired_differences(np.arange(9.0), np.arange(9.0), np.random.default_rng(0))
    assert found["mean"] == {"value": 0.0, "low": 0.0, "high": 0.0}
    assert found["wilcoxon_p"] is None
    assert paired_differences(np.array([math.nan]), np.array([1.0]), np.random.default_rng(0))["n"] == 0
