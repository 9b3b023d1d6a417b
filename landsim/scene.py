"""From the settings of a scenario to what the simulation is made of."""

from numpy.random import Generator

from estimator.alignment import Incidence
from estimator.so3 import Vec3
from landsim.atmosphere import Atmosphere, is_steady, mean_wind
from landsim.config import AircraftConfig, Scenario
from landsim.runway import Runway
from landsim.truth import Loading
from landsim.units import DEG


def runway_of(scenario: Scenario) -> Runway:
    """The runway of a scenario."""
    r = scenario.runway
    return Runway(
        length=r.length_m,
        width=r.width_m,
        heading=r.heading_deg * DEG,
        latitude=r.latitude_deg * DEG,
        longitude=r.longitude_deg * DEG,
        elevation=r.elevation_m,
    )


def believed_width(scenario: Scenario) -> float:
    """What navigation takes for the runway's width, m."""
    return scenario.runway.width_m + scenario.runway.width_error_m


def wind_of(scenario: Scenario, height: float) -> Vec3:
    """Mean velocity of the air at a height above the runway (m), runway frame, m/s."""
    return mean_wind(scenario.wind, height)


def atmosphere_of(scenario: Scenario, rng: Generator) -> Atmosphere | None:
    """The wind along a flight; None if it is the same everywhere and at all times."""
    if is_steady(scenario.wind, scenario.gust, scenario.turbulence):
        return None
    return Atmosphere(scenario.wind, scenario.gust, scenario.turbulence, 1.0 / scenario.simulation.rate_hz, rng)


def loading_of(scenario: Scenario) -> Loading:
    """What the aircraft carries besides its nominal mass, and where."""
    return Loading(scenario.loading.extra_mass_kg, scenario.loading.cg_forward_m)


def incidence_of(aircraft: AircraftConfig) -> Incidence:
    """The angle of attack of an aircraft in steady flight."""
    gains = aircraft.guidance.approach
    return Incidence(gains.trim_alpha_deg * DEG, gains.trim_alpha_slope_deg_per_mps * DEG, aircraft.speeds.approach_mps)
