"""From the settings of a scenario to what the simulation is made of."""

from estimator.alignment import Incidence
from landsim.config import AircraftConfig, Scenario
from landsim.runway import Runway
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


def incidence_of(aircraft: AircraftConfig) -> Incidence:
    """The angle of attack of an aircraft in steady flight."""
    gains = aircraft.guidance.approach
    return Incidence(gains.trim_alpha_deg * DEG, gains.trim_alpha_slope_deg_per_mps * DEG, aircraft.speeds.approach_mps)
