"""The air, against theory and against what JSBSim makes of it.

====================  ============================================================================================
turbulence            rms and spectrum of Dryden's, written here anew from MIL-F-8785C; axes independent
mean wind             hand numbers of the logarithm, the layer of a shear, the standard's 1 - cosine
JSBSim                total wind, angle of attack, sideslip and airspeed of a gust from each side
density               the gas law
====================  ============================================================================================
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.signal import welch

import landsim
from estimator.so3 import Array
from landsim.atmosphere import Atmosphere, dryden, is_steady, mean_wind, standard_density
from landsim.config import AirConfig, GustConfig, TurbulenceConfig, WindConfig, load_aircraft
from landsim.plant import Plant
from landsim.runway import Runway
from landsim.truth import InitialState

DT, KT, FT = 1.0 / 120.0, 0.514444, 0.3048
NO_GUST, NO_WIND = GustConfig(), WindConfig()


def motion_at(height: float, along: float = 0.0) -> Array:
    """Due along the runway at 40 m/s."""
    motion = np.zeros(15)
    motion[0], motion[2], motion[3] = along, -height, 40.0
    return motion


def series(height: float, w20: float, steps: int, seed: int, airspeed: float = 40.0) -> Array:
    air = Atmosphere(NO_WIND, NO_GUST, TurbulenceConfig(w20_mps=w20), DT, default_rng(seed))
    motion = motion_at(height)
    return np.array([air.at(motion, airspeed) for _ in range(steps)])


def theory(height_ft: float, w20: float) -> tuple[float, float, float, float]:
    """Sigmas of u and w (m/s), lengths (m)."""
    base = 0.177 + 0.000823 * height_ft
    return 0.1 * w20 / base**0.4, 0.1 * w20, height_ft / base**1.2 * FT, height_ft * FT


@pytest.mark.parametrize(
    "height_ft", [100.0, pytest.param(20.0, marks=pytest.mark.slow), pytest.param(500.0, marks=pytest.mark.slow)]
)
def test_turbulence_is_drydens(height_ft: float) -> None:
    """Within 5 % in rms and 1 dB in the spectrum from 0.05 to 5 rad/s, averaged in quarters of a decade.

    A band holds seven frequencies or more of 45 half-overlapping windows: a standard deviation of 0.25 dB at most.
    """
    w20, airspeed, steps = 30.0 * KT, 40.0, 3_000_000
    horizontal, vertical, long, short = theory(height_ft, w20)
    wind = series(height_ft * FT, w20, steps, 1)
    assert np.std(wind, axis=0) == pytest.approx((horizontal, horizontal, vertical), rel=0.05)
    frequency, spectrum = welch(wind, 1.0 / DT, nperseg=2**17, axis=0)
    omega = 2.0 * np.pi * frequency
    edges = np.geomspace(0.05, 5.0, 9)
    for axis, (sigma, length) in enumerate(((horizontal, long), (horizontal, long), (vertical, short))):
        x = omega * length / airspeed
        if axis == 0:
            phi = sigma**2 * 2.0 * length / (np.pi * airspeed) / (1.0 + x**2)
        else:
            phi = sigma**2 * length / (np.pi * airspeed) * (1.0 + 3.0 * x**2) / (1.0 + x**2) ** 2
        for low, high in pairwise(edges):
            there = (omega >= low) & (omega < high)
            ratio = (spectrum[there, axis] / (2.0 * np.pi)).mean() / phi[there].mean()
            assert abs(10.0 * math.log10(ratio)) < 1.0, (axis, low)


def test_axes_are_independent_and_begin_in_the_steady_state() -> None:
    horizontal, vertical, _, _ = theory(100.0, 10.0)
    first = np.array([series(100.0 * FT, 10.0, 1, seed)[0] for seed in range(3000)])
    assert np.std(first, axis=0) == pytest.approx((horizontal, horizontal, vertical), rel=0.05)
    correlation = np.corrcoef(first.T) - np.eye(3)
    assert np.abs(correlation).max() < 0.07
    # after a second of time the series has forgotten little: u's correlation is exp(-V t / L)
    runs = np.array([series(100.0 * FT, 10.0, 121, seed)[[0, 120], 0] for seed in range(2000)])
    _, _, length, _ = theory(100.0, 10.0)
    assert np.corrcoef(runs.T)[0, 1] == pytest.approx(math.exp(-40.0 / length), abs=0.05)


def test_turbulence_lies_along_the_airspeed() -> None:
    """Flying to the right of the runway's direction, what is u there is the runway's y."""
    air = [Atmosphere(NO_WIND, NO_GUST, TurbulenceConfig(w20_mps=10.0), DT, default_rng(4)) for _ in range(2)]
    ahead, right = motion_at(50.0), motion_at(50.0)
    right[3], right[4] = 0.0, 40.0
    for _ in range(300):
        (u, v, w), (x, y, z) = air[0].at(ahead, 40.0), air[1].at(right, 40.0)
    assert (x, y, z) == pytest.approx((-v, u, w), abs=1e-12)


def test_intensity_by_hand() -> None:
    """At 1000 ft the base is one: all sigmas 0.1 W20, all lengths 1000 ft; nothing changes beyond, or below 10 ft."""
    at_top = dryden(304.8, 20.0)
    assert tuple(at_top) == pytest.approx((2.0, 2.0, 304.8, 304.8), rel=1e-9)
    assert dryden(1000.0, 20.0) == at_top
    assert dryden(0.0, 20.0) == dryden(10.0 * FT, 20.0)
    # 100 ft: 0.177 + 0.0823 = 0.2593; 0.2593^0.4 = 0.58284, 0.2593^1.2 = 0.197954
    assert tuple(dryden(100.0 * FT, 20.0)) == pytest.approx((3.4317, 2.0, 153.976, 30.48), rel=1e-4)


def test_boundary_layer_by_hand() -> None:
    """ln(200 ft / 0.15 ft) / ln(20 ft / 0.15 ft) = 7.1954 / 4.8929."""
    wind = WindConfig(head_mps=10.0, cross_mps=-5.0, profile="logarithmic")
    assert mean_wind(wind, 20.0 * FT) == pytest.approx((-10.0, -5.0, 0.0), rel=1e-4)
    assert mean_wind(wind, 200.0 * FT) == pytest.approx((-14.706, -7.353, 0.0), rel=1e-4)
    assert mean_wind(wind, 0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert mean_wind(wind, 5000.0) == mean_wind(wind, 304.8)
    uniform = WindConfig(head_mps=10.0, cross_mps=-5.0)
    assert mean_wind(uniform, 0.0) == mean_wind(uniform, 500.0) == (-10.0, -5.0, 0.0)


def test_shear_by_hand() -> None:
    wind = WindConfig(head_mps=2.0, shear_head_mps=6.0, shear_cross_mps=-3.0, shear_low_m=20.0, shear_high_m=50.0)
    assert mean_wind(wind, 10.0) == (-2.0, 0.0, 0.0)
    assert mean_wind(wind, 30.0) == pytest.approx((-4.0, -1.0, 0.0))
    assert mean_wind(wind, 90.0) == pytest.approx((-8.0, -3.0, 0.0))


def test_gust_by_hand() -> None:
    gust = GustConfig(head_mps=4.0, cross_mps=6.0, up_mps=2.0, at_m=-300.0, length_m=100.0)
    air = Atmosphere(NO_WIND, gust, TurbulenceConfig(), DT, default_rng(0))
    assert air.at(motion_at(30.0, -301.0), 40.0) == (0.0, 0.0, 0.0)
    assert air.at(motion_at(30.0, -275.0), 40.0) == pytest.approx((-2.0, 3.0, -1.0))
    assert air.at(motion_at(30.0, -250.0), 40.0) == pytest.approx((-4.0, 6.0, -2.0))
    assert air.at(motion_at(30.0, -199.0), 40.0) == (0.0, 0.0, 0.0)


def test_what_is_steady() -> None:
    assert is_steady(WindConfig(head_mps=3.0), NO_GUST, TurbulenceConfig())
    assert is_steady(WindConfig(profile="logarithmic"), NO_GUST, TurbulenceConfig())
    assert not is_steady(WindConfig(head_mps=3.0, profile="logarithmic"), NO_GUST, TurbulenceConfig())
    assert not is_steady(WindConfig(shear_cross_mps=1.0), NO_GUST, TurbulenceConfig())
    assert not is_steady(NO_WIND, GustConfig(up_mps=-1.0), TurbulenceConfig())
    assert not is_steady(NO_WIND, NO_GUST, TurbulenceConfig(w20_mps=1.0))


HEADING = 0.6


def plant_in(gust: GustConfig, wind: WindConfig = NO_WIND, air: AirConfig | None = None) -> Plant:
    """In flight at (-1000 m, 60 m up) towards a runway that does not lie north."""
    aircraft = load_aircraft("pioneer")
    runway = Runway(2000.0, 30.0, HEADING, 0.3, 0.1, 500.0)
    atmosphere = Atmosphere(wind, gust, TurbulenceConfig(), DT, default_rng(0))
    plant = Plant(
        aircraft.folder, aircraft.model, runway, 120.0, atmosphere=atmosphere, air=AirConfig() if air is None else air
    )
    plant.start(InitialState((-1000.0, 0.0, -60.0), 40.0, 0.0, -0.05, mean_wind(wind, 60.0)))
    return plant


@pytest.mark.parametrize(
    ("gust", "angle", "sign"),
    [({"up_mps": 3.0}, "aero/alpha-rad", 1.0), ({"cross_mps": 3.0}, "aero/beta-rad", -1.0)],
)
def test_a_gust_meets_the_aircraft_from_the_right_side(gust: dict[str, float], angle: str, sign: float) -> None:
    """An updraught raises the angle of attack; air that goes right comes from the left: negative sideslip, 3/40 rad."""
    plant = plant_in(GustConfig(at_m=-1000.0, length_m=8.0, **gust))
    before = plant._get(angle)
    for _ in range(120):
        truth = plant.step()
        change = plant._get(angle) - before
        if truth.position[0] > -996.0:  # at the peak, a tenth of a second later
            break
    assert change * sign == pytest.approx(3.0 / 40.0, rel=0.2)


def test_jsbsim_flies_through_the_wind_that_is_logged() -> None:
    """Its own total wind, in NED, against the log's columns, which are the runway's; airspeed is the difference."""
    wind = WindConfig(head_mps=6.0, cross_mps=3.0, profile="logarithmic", shear_cross_mps=2.0)
    plant = plant_in(GustConfig(head_mps=4.0, up_mps=1.0, at_m=-990.0, length_m=60.0), wind)
    c, s = math.cos(HEADING), math.sin(HEADING)
    for _ in range(200):
        truth = plant.step()
        x, y, z = truth.motion[-3:].tolist()
        north, east, down = (FT * plant._get(f"atmosphere/total-wind-{name}-fps") for name in ("north", "east", "down"))
        assert (c * north + s * east, c * east - s * north, down) == pytest.approx((x, y, z), abs=2e-3)
    # the step's wind is that of its beginning, 8 ms earlier
    through = np.array(truth.velocity) - (x, y, z)
    assert truth.airspeed == pytest.approx(float(np.linalg.norm(through)), abs=1e-3)


def test_density_by_the_gas_law() -> None:
    """At 560 m: ISA pressure there times the ratio at sea level, over the warmer temperature."""
    plant = plant_in(NO_GUST, air=AirConfig(temperature_offset_c=25.0, pressure_hpa=990.0))
    height = 560.0
    ratio = plant.density_ratio
    standard = 288.15 - 0.0065 * height
    # warmer air is thinner, and its pressure falls off less; to first order that is h g δT / (R T²)
    lifted = math.exp(9.80665 * height / 287.053 * (1.0 / standard - 1.0 / (standard + 25.0)))
    assert ratio == pytest.approx(990.0 / 1013.25 * standard / (standard + 25.0) * lifted, rel=2e-3)
    assert plant_in(NO_GUST).density_ratio == 1.0
    # published: 1.2250 kg/m³ at sea level, 1.1117 at 1000 m
    assert (standard_density(0.0), standard_density(1000.0)) == pytest.approx((1.2250, 1.1117), abs=2e-4)


def test_the_same_seed_flies_through_the_same_air() -> None:
    scenario = landsim.load_scenario("landing", {"turbulence.w20_mps": 8.0, "simulation.time_limit_s": 2.0})
    first, again, other = (landsim.fly(scenario, seed).log for seed in (3, 3, 4))
    for axis in "xyz":
        name = f"wind_{axis}_mps"
        assert np.array_equal(first[name], again[name])
        assert not np.array_equal(first[name], other[name])
    calm = landsim.fly(landsim.load_scenario("landing", {"wind.head_mps": 2.0, "simulation.time_limit_s": 1.0})).log
    assert (calm["wind_x_mps"] == -2.0).all()
