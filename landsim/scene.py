"""From the settings of a scenario to what the simulation is made of."""

from estimator.alignment import Incidence
from estimator.so3 import Vec3
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


def wind_of(scenario: Scenario) -> Vec3:
    """Velocity of the air, runway frame, m/s: a head wind comes against x, a cross wind blows along y."""
    return -scenario.wind.head_mps, scenario.wind.cross_mps, 0.0


def loading_of(scenario: Scenario) -> Loading:
    """What the aircraft carries besides its nominal mass, and where."""
    return Loading(scenario.loading.extra_mass_kg, scenario.loading.cg_forward_m)


def incidence_of(aircraft: AircraftConfig) -> Incidence:
    """The angle of attack of an aircraft in steady flight."""
    gains = aircraft.guidance.approach
    return Incidence(gains.trim_alpha_deg * DEG, gains.trim_alpha_slope_deg_per_mps * DEG, aircraft.speeds.approach_mps)
