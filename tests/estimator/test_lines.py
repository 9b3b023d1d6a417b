"""Fitted lines, against the singular value decomposition, and their covariance against sampling."""

import math

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.random import default_rng

from estimator.lines import fit_line, fit_variances, line_from_moments
from estimator.so3 import Array

ANGLES_DEG = (-90.0, -60.0, -45.0, -1.0, 0.0, 20.0, 45.0, 89.0, 135.0)
pixel = st.floats(-1000.0, 1000.0)


def along(angle_deg: float, length: float, number: int) -> Array:
    """Points on a line through (300, 200)."""
    angle = math.radians(angle_deg)
    t = np.linspace(-0.5, 0.5, number) * length
    return np.stack((300.0 + t * math.cos(angle), 200.0 + t * math.sin(angle)), axis=-1)


@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_fit_is_the_svds(angle_deg: float) -> None:
    rng = default_rng(1)
    points = along(angle_deg, 60.0, 25) + rng.normal(0.0, 3.0, (200, 25, 2))
    fit = fit_line(points)
    centred = points - points.mean(axis=1, keepdims=True)
    _, singular, vt = np.linalg.svd(centred, full_matrices=False)
    normal = vt[:, 1]  # the direction of least spread
    sign = np.sign((fit.line[:, :2] * normal).sum(axis=-1))
    assert np.abs(fit.line[:, :2] - sign[:, None] * normal).max() < 1e-12
    assert np.abs(fit.line[:, 2] + sign * (normal * points.mean(axis=1)).sum(axis=-1)).max() < 1e-9
    assert fit.spread == pytest.approx(singular[:, 0] ** 2)
    assert np.abs(fit.centroid - points.mean(axis=1)).max() < 1e-10
    assert fit.points == 25


@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_covariance_by_sampling(angle_deg: float) -> None:
    # 40,000 lines: a variance is then known to 0.7 %, and the bound of 4 % is more than five of that
    sigma, number, length, draws = 0.5, 12, 120.0, 40_000
    clean = along(angle_deg, length, number)
    truth = fit_line(clean)
    noisy = clean + default_rng(2).normal(0.0, sigma, (draws, number, 2))
    fit = fit_line(noisy)
    lines = fit.line * np.sign((fit.line[:, :2] * truth.line[:2]).sum(axis=-1))[:, None]

    # by hand: offset σ²/N; angle σ²/S with S of the clean points, L² N (N + 1) / (12 (N - 1))
    S = length**2 * number * (number + 1) / (12.0 * (number - 1))
    centre = np.append(truth.centroid, 1.0)
    assert np.var(lines @ centre) == pytest.approx(sigma**2 / number, rel=0.04)
    turn = lines[:, 1] * truth.line[0] - lines[:, 0] * truth.line[1]
    assert np.var(turn) == pytest.approx(sigma**2 / S, rel=0.04)
    offset, angle = fit_variances(truth.spread, number, sigma)
    assert offset == pytest.approx(sigma**2 / number)
    assert angle == pytest.approx(sigma**2 / (S - (number - 1) * sigma**2))

    # the variance of where the line crosses any pixel, which is what (a, b, c) is for
    sampled, predicted = np.cov(lines.T), truth.covariance(sigma)
    # (six pixels fix all six numbers of it)
    for u, v in ((0.0, 0.0), (658.0, 0.0), (0.0, 494.0), (658.0, 494.0), (330.0, 0.0), (0.0, 250.0)):
        q = np.array((u, v, 1.0))
        assert q @ predicted @ q == pytest.approx(q @ sampled @ q, rel=0.04)


def test_covariance_of_a_batch_is_that_of_each() -> None:
    points = along(30.0, 80.0, 9) + default_rng(3).normal(0.0, 1.0, (2, 4, 9, 2))
    batch = fit_line(points).covariance(1.4)
    assert batch.shape == (2, 4, 3, 3)
    assert batch[1, 2] == pytest.approx(fit_line(points[1, 2]).covariance(1.4), rel=1e-9)


def test_noise_share_of_the_spread_is_taken_off() -> None:
    # a spread as measured is that of the clean points and, on average, (N - 1) σ² more: with it taken off the mean
    # is the clean one, to 0.5 % of it at 20,000 draws
    sigma, number = 2.0, 20
    clean = along(10.0, 30.0, number)
    spread = fit_line(clean + default_rng(4).normal(0.0, sigma, (20_000, number, 2))).spread
    _, angle = fit_variances(spread, number, sigma)
    true = 30.0**2 * number * (number + 1) / (12.0 * (number - 1))
    # the longest axis of the scatter takes in a little of the noise across too: of the order of σ²
    assert np.mean(sigma**2 / angle) == pytest.approx(true + sigma**2, rel=0.005)
    assert np.mean(spread) > true + 0.9 * (number - 1) * sigma**2


@pytest.mark.parametrize("spread", [0.5, np.array([0.5, 900.0])])
def test_angle_variance_of_pure_noise_is_finite_and_large(spread: float | Array) -> None:
    _, angle = fit_variances(spread, 10, 1.0)
    assert np.ravel(angle)[0] == pytest.approx(1.0 / 0.05)  # a tenth of the spread is kept


def test_moments_of_floats_and_arrays_agree() -> None:
    moments = (300.0, 200.0, 1000.0, -400.0, 300.0)
    one = line_from_moments(*moments)
    u, v, suu, suv, svv = (np.full(3, moment) for moment in moments)
    many = line_from_moments(u, v, suu, suv, svv)
    for single, array in zip(one, many, strict=True):
        assert array == pytest.approx(np.full(3, single), rel=1e-14)


@pytest.mark.parametrize("shape", [(2,), (1, 2), (5, 3), (0, 2), (4, 1, 2)])
def test_wrong_shapes(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"points must have the shape"):
        fit_line(np.zeros(shape))


def test_points_that_coincide_have_no_direction_and_no_warning() -> None:
    fit = fit_line([[[1.0, 2.0], [1.0, 2.0]], [[0.0, 0.0], [3.0, 4.0]]])
    offset, angle = fit_variances(fit.spread, fit.points, 1.0)
    assert offset == 0.5
    assert angle[0] == math.inf
    assert np.isfinite(angle[1])
    covariance = fit.covariance(1.0)
    assert not np.isfinite(covariance[0]).all()
    assert np.isfinite(covariance[1]).all()
