"""The approach and what it is flown over and through: aircraft, runway, wind, loading, start, simulation, box."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from landsim.schema.base import HeadingDeg, NotNegative, Positive, Section, refused


class AircraftChoice(Section):
    """``[aircraft]``: which aircraft flies."""

    name: Annotated[str, Field(min_length=1)]
    """Name of a shipped aircraft, or path of a folder that holds aircraft.toml, relative to the scenario file."""


class RunwayConfig(Section):
    """``[runway]``: a flat, straight runway on the WGS 84 ellipsoid."""

    width_m: Annotated[float, Field(gt=0.0, le=1000.0)] = 30.0
    """Between the painted edges."""
    width_error_m: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    """What navigation takes for the width, less the width."""
    length_m: Annotated[float, Field(gt=0.0, le=1e5)] = 2000.0
    heading_deg: HeadingDeg = 0.0
    """True heading of the landing direction."""
    latitude_deg: Annotated[float, Field(ge=-89.0, le=89.0)] = 0.0
    """Geodetic, of the middle of the threshold.  North is not a direction to fly by nearer to a pole."""
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)] = 0.0
    elevation_m: Annotated[float, Field(ge=-500.0, le=6000.0)] = 0.0
    """Of the threshold above the ellipsoid."""

    @model_validator(mode="after")
    def _believed_width(self) -> Self:
        if not self.width_m + self.width_error_m > 0.0:
            raise refused(f"must be above -width_m = {-self.width_m:g}, not {self.width_error_m:g}", "width_error_m")
        return self


class ApproachConfig(Section):
    """``[approach]``: the line to fly."""

    glide_slope_deg: Annotated[float, Field(gt=0.0, lt=15.0)] = 3.0
    aim_point_m: NotNegative = 145.0
    """Where the glide slope meets the runway, past the threshold."""
    law: Literal["calm", "wind"] = "calm"
    """``wind``: the aircraft's ``[guidance.wind]`` is flown too: airspeed by head wind, crab and de-crab, a
    flare that holds its sink rate, a rollout against the cross wind."""


class GoAroundConfig(Section):
    """``[go_around]``: when a landing is given up, judged by the navigation state, and how far it then climbs.

    The limits are ESTIMATES, scaled to a runway 30 m wide: half its width less half the track and a margin.
    """

    enabled: bool = False
    decision_height_m: Positive = 30.0
    """Of the main wheels, from which down the landing is judged without pause: from where they may be so low by the
    vertical protection level,"""
    commit_height_m: NotNegative = 2.0
    """and below which it is gone on with."""
    lateral_limit_m: Positive = 10.0
    """Greatest lateral protection level,"""
    vertical_limit_m: Positive = 5.0
    """and vertical one."""
    cross_limit_m: Positive = 8.0
    """Greatest distance from the centreline,"""
    slope_limit_m: Positive = 6.0
    """and, until the flare, from the glide slope."""
    confirm_s: NotNegative = 0.3
    """So long a reason has to last."""
    end_height_m: Positive = 60.0
    """Of the centre of gravity, above which the flight is over once it climbs."""

    @model_validator(mode="after")
    def _heights_in_order(self) -> Self:
        if not self.commit_height_m < self.decision_height_m:
            told = f"must be below decision_height_m = {self.decision_height_m:g}, not {self.commit_height_m:g}"
            raise refused(told, "commit_height_m")
        if not self.end_height_m > self.decision_height_m:
            told = f"must be above decision_height_m = {self.decision_height_m:g}, not {self.end_height_m:g}"
            raise refused(told, "end_height_m")
        return self


class StartConfig(Section):
    """``[start]``: the centre of gravity at the start, and the σ of what each seed adds, unknown to navigation."""

    along_m: Annotated[float, Field(lt=0.0, ge=-1e5)] = -1000.0
    """From the threshold, negative before it."""
    cross_m: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0
    """Right of the centreline."""
    height_m: Positive = 60.0
    """Above the threshold."""
    heading_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 0.0
    """Of the track over the ground, relative to the runway's, nose right positive; in a wind the nose points off it."""
    flight_path_deg: Annotated[float, Field(ge=-15.0, le=15.0)] = -3.0
    """Over the ground."""
    speed_mps: Positive | None = None
    """Airspeed; without it, the aircraft's approach speed."""
    cross_sigma_m: NotNegative = 8.0
    height_sigma_m: NotNegative = 4.0
    heading_sigma_deg: NotNegative = 2.0
    speed_sigma_mps: NotNegative = 1.0


_WindSpeed = Annotated[float, Field(ge=-100.0, le=100.0)]


class WindConfig(Section):
    """``[wind]``: the mean wind; nobody on board is told of it."""

    head_mps: _WindSpeed = 0.0
    """Against the landing direction; a tail wind is negative."""
    cross_mps: _WindSpeed = 0.0
    """Towards the right, as ``cross_m`` is: from the left."""
    profile: Literal["uniform", "logarithmic"] = "uniform"
    """The same everywhere down to the ground, or that of the boundary layer, with the speeds above at a height."""
    reference_height_m: Positive = 6.096
    """That height, 20 ft, above the runway."""
    roughness_m: Positive = 0.0457
    """At and below which the air stands still, with ``logarithmic``: 0.15 ft (MIL-F-8785C, terminal flight phases)."""
    shear_head_mps: _WindSpeed = 0.0
    """By so much the head wind is stronger above a layer in which it changes evenly,"""
    shear_cross_mps: _WindSpeed = 0.0
    """and the cross wind."""
    shear_low_m: Annotated[float, Field(ge=0.0)] = 20.0
    """The layer's lower end, above the runway,"""
    shear_high_m: Annotated[float, Field(ge=0.0)] = 50.0
    """and its upper one."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.roughness_m < self.reference_height_m:
            told = f"must be below reference_height_m = {self.reference_height_m:g}, not {self.roughness_m:g}"
            raise refused(told, "roughness_m")
        if not self.shear_low_m < self.shear_high_m:
            raise refused(
                f"must be above shear_low_m = {self.shear_low_m:g}, not {self.shear_high_m:g}", "shear_high_m"
            )
        return self


class TurbulenceConfig(Section):
    """``[turbulence]``: Dryden's, by MIL-F-8785C."""

    w20_mps: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Wind at 20 ft that its strength goes by: 15, 30, 45 kt (7.7, 15.4, 23.2 m/s) are light, moderate, severe."""


class GustConfig(Section):
    """``[gust]``: one discrete gust, ½ U (1 - cos(2π s/L)) along the way (CS-25.341)."""

    head_mps: _WindSpeed = 0.0
    """At its peak, against the landing direction,"""
    cross_mps: _WindSpeed = 0.0
    """towards the right"""
    up_mps: _WindSpeed = 0.0
    """and upwards."""
    at_m: Annotated[float, Field(ge=-1e5, le=1e5)] = -300.0
    """Where it begins, along the runway from the threshold."""
    length_m: Positive = 150.0


class AirConfig(Section):
    """``[air]``: the standard atmosphere, and how the air differs from it; nobody on board is told of it."""

    temperature_offset_c: Annotated[float, Field(ge=-80.0, le=60.0)] = 0.0
    """Warmer by so much, at all heights."""
    pressure_hpa: Annotated[float, Field(ge=800.0, le=1100.0)] = 1013.25
    """At sea level."""


class LoadingConfig(Section):
    """``[loading]``: what the aircraft carries besides its nominal mass; guidance's gains are not told of it."""

    extra_mass_kg: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0
    """At the nominal centre of gravity, so that the moments of inertia stay; negative for what is left at home."""
    cg_forward_m: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.0
    """Of the nominal centre of gravity, by ballast that is moved along the fuselage."""


class SimulationConfig(Section):
    """``[simulation]``: the plant's step and the longest flight."""

    rate_hz: Annotated[float, Field(ge=20.0, le=10000.0)] = 120.0
    """``imu.rate_hz`` must divide it, and ``camera.rate_hz`` must divide both."""
    time_limit_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 120.0
    end: Literal["stop", "touchdown"] = "stop"
    """Where a flight ends: at the stop, or at the touchdown, where what comes after is of no interest."""
    guidance_state: Literal["navigation", "truth"] = "navigation"
    """What guidance and the attitude loops are given.  ``truth``, for comparison alone, is the true state in place of
    navigation's: what a flight is then off by is the control's own share.  Navigation runs along and is logged."""


class BoxConfig(Section):
    """``[box]``: what a good landing is.  It judges, and does not steer."""

    along_min_m: float = 100.0
    """Touchdown, past the threshold."""
    along_max_m: float = 450.0
    cross_max_m: NotNegative = 2.0
    """Touchdown, either side of the centreline."""
    sink_max_mps: NotNegative = 1.0
    bank_max_deg: NotNegative = 3.0
    stop_cross_max_m: NotNegative = 3.0

    @model_validator(mode="after")
    def _along_in_order(self) -> Self:
        if not self.along_min_m < self.along_max_m:
            raise refused(f"must be above along_min_m = {self.along_min_m:g}, not {self.along_max_m:g}", "along_max_m")
        return self
