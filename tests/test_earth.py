"""The Earth's shape, gravity and axes, against published values and hand computation."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.so3 import matmul, rotate, transpose
from landsim import earth
from landsim.attitude import runway_attitude
from landsim.runway import Runway
from landsim.units import DEG

latitudes = st.floats(-89.9 * DEG, 89.9 * DEG)
longitudes = st.floats(-math.pi, math.pi)
angles = st.floats(-3.0, 3.0)


def test_semi_minor_axis_is_the_published_one() -> None:
    # NIMA TR8350.2, table 3.3: b = 6356752.3142 m
    assert earth.ecef_from_geodetic(math.pi / 2.0, 0.0, 0.0)[2] == pytest.approx(6356752.3142, abs=5e-5)


def test_ecef_of_a_published_place() -> None:
    # by hand at 45 N, 90 E, 0 m: N = a / sqrt(1 - e²/2) = 6388838.2901 m; y = N cos 45°, z = N (1 - e²) sin 45°
    x, y, z = earth.ecef_from_geodetic(45.0 * DEG, 90.0 * DEG, 0.0)
    assert x == pytest.approx(0.0, abs=1e-6)
    assert y == pytest.approx(4517590.8789, abs=1e-3)
    assert z == pytest.approx(4487348.4089, abs=1e-3)


@given(latitudes, longitudes, st.floats(-400.0, 9000.0))
def test_geodetic_round_trip(latitude: float, longitude: float, height: float) -> None:
    back = earth.geodetic_from_ecef(earth.ecef_from_geodetic(latitude, longitude, height))
    assert back[0] == pytest.approx(latitude, abs=1e-13)
    assert math.remainder(back[1] - longitude, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-13)
    assert back[2] == pytest.approx(height, abs=1e-5)


@pytest.mark.parametrize(
    ("latitude_deg", "gravity"),
    # on the ellipsoid: TR8350.2 table 3.4 for equator and pole; at 45° from these two, by Somigliana's own form
    # (a ge cos² + b gp sin²) / sqrt(a² cos² + b² sin²), by hand
    [(0.0, 9.7803253359), (45.0, 9.80619777), (90.0, 9.8321849378)],
)
def test_normal_gravity(latitude_deg: float, gravity: float) -> None:
    assert earth.gravity(latitude_deg * DEG, 0.0) == pytest.approx(gravity, abs=1e-8)


def test_gravity_falls_by_the_free_air_gradient() -> None:
    # 0.3086 mGal per metre: H. Moritz, Geodetic Reference System 1980
    fall = earth.gravity(45.0 * DEG, 0.0) - earth.gravity(45.0 * DEG, 100.0)
    assert fall == pytest.approx(100.0 * 0.3086e-5, rel=5e-3)


def test_north_east_down_at_the_origin_of_both_angles() -> None:
    # on the equator at Greenwich north is the pole's axis, east is y, down points to the centre along -x
    R = earth.ned_from_ecef(0.0, 0.0)
    assert rotate(R, (0.0, 0.0, 1.0)) == pytest.approx((1.0, 0.0, 0.0))
    assert rotate(R, (0.0, 1.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))
    assert rotate(R, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -1.0))


def test_down_is_the_ellipsoid_normal() -> None:
    # a metre up moves the point by minus the down axis
    latitude, longitude = 0.9, -2.1
    low = earth.ecef_from_geodetic(latitude, longitude, 0.0)
    high = earth.ecef_from_geodetic(latitude, longitude, 1.0)
    up = rotate(earth.ned_from_ecef(latitude, longitude), (high[0] - low[0], high[1] - low[1], high[2] - low[2]))
    assert up == pytest.approx((0.0, 0.0, -1.0), abs=1e-8)


@given(latitudes, longitudes, angles, st.tuples(angles, angles, angles))
def test_attitude_is_the_product_of_its_rotations(
    latitude: float, longitude: float, heading: float, euler: tuple[float, float, float]
) -> None:
    # z-y-x from single-axis matrices, so that neither the closed form nor so3.from_euler is its own judge
    phi, theta, psi = euler
    roll = (1.0, 0.0, 0.0, 0.0, math.cos(phi), -math.sin(phi), 0.0, math.sin(phi), math.cos(phi))
    pitch = (math.cos(theta), 0.0, math.sin(theta), 0.0, 1.0, 0.0, -math.sin(theta), 0.0, math.cos(theta))
    yaw = (math.cos(psi), -math.sin(psi), 0.0, math.sin(psi), math.cos(psi), 0.0, 0.0, 0.0, 1.0)
    runway = Runway(2000.0, 30.0, heading, latitude, longitude)
    place = 0.99 * latitude + 0.01, longitude - 0.02
    R_runway_from_ned = matmul(runway.R_runway_from_ecef, transpose(earth.ned_from_ecef(*place)))
    cosine, R = runway_attitude(latitude, longitude, heading, *place, *euler)
    assert pytest.approx(matmul(R_runway_from_ned, matmul(yaw, matmul(pitch, roll))), abs=1e-14) == R
    assert cosine == pytest.approx(R_runway_from_ned[8], abs=1e-15)
