"""What an aircraft's file may hold."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from landsim.schema.base import Fraction, NotNegative, PointM, Positive, Section


class MountConfig(Section):
    """``[mount]``: the camera's tilting mount.  Tilt is the optical axis' angle below the body's forward axis."""

    position_body_m: PointM
    """Projection centre from the nominal centre of gravity: forward, right, down."""
    tilt_early_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = 3.0
    """While the threshold is in view."""
    tilt_late_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = 10.0
    """From when the threshold leaves the image to the touchdown."""
    tilt_rollout_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = 3.0
    """On the ground, where the late tilt and the nose going down under braking would lose the edges."""
    tilt_rate_deg_s: Positive = 10.0
    tilt_reading_sigma_deg: NotNegative = 0.005
    """1 σ of each reading of the angle, white."""


class GearConfig(Section):
    """``[gear]``: where the wheels touch, unloaded, from the nominal centre of gravity: forward, right, down."""

    nose_wheel_body_m: PointM
    left_wheel_body_m: PointM
    right_wheel_body_m: PointM
    sink_limit_mps: Positive = 3.0
    """Touchdown beyond it is a crash."""

    @property
    def main_wheels_body_m(self) -> tuple[float, float, float]:
        """Midpoint of the main wheels, from the centre of gravity."""
        a, b, c = (0.5 * (x + y) for x, y in zip(self.left_wheel_body_m, self.right_wheel_body_m, strict=True))
        return a, b, c


class SpeedsConfig(Section):
    """``[speeds]``: speeds to fly."""

    approach_mps: Positive


class ApproachGains(Section):
    """``[guidance.approach]``: glide slope and localizer."""

    trim_alpha_deg: Annotated[float, Field(ge=-30.0, le=30.0)]
    """Angle of attack in trim at the approach speed."""
    trim_alpha_slope_deg_per_mps: float
    """Its change with airspeed."""
    height_gain_per_s: NotNegative
    """Sink rate asked for, per metre above the slope."""
    pitch_gain_rad_per_mps: NotNegative
    pitch_integral_rad_per_m: NotNegative
    pitch_integral_max_deg: Positive = 3.0
    """Most that the integral may ask for."""
    max_sink_mps: Positive
    pitch_min_deg: Annotated[float, Field(ge=-45.0, le=0.0)] = -10.0
    pitch_max_deg: Annotated[float, Field(ge=0.0, le=45.0)] = 12.0
    """Least and most pitch that is commanded."""
    lateral_gain_per_s: NotNegative
    """Lateral speed asked for, per metre off the centreline."""
    lateral_speed_max_mps: Positive
    bank_gain_per_s: NotNegative
    """Lateral acceleration asked for, per m/s of lateral speed error."""
    bank_max_deg: Annotated[float, Field(gt=0.0, le=60.0)]


class FlareGains(Section):
    """``[guidance.flare]``: sink rate (wheel height + bias) / time constant."""

    height_m: Positive
    """Wheel height at which the flare begins."""
    time_constant_s: Positive
    height_bias_m: NotNegative
    """So that some sink rate is left when the wheels meet the ground."""
    touchdown_height_m: Positive = 0.05
    """Wheel height, by navigation, below which the wheels are taken to be on the ground."""


class RolloutGains(Section):
    """``[guidance.rollout]``: from touchdown to the stop."""

    pitch_rate_deg_s: Positive
    """At which the nose is lowered."""
    pitch_deg: Annotated[float, Field(ge=-10.0, le=10.0)] = -1.0
    """Pitch command once the nose is down: it keeps weight on the nose wheel."""
    brake_delay_s: NotNegative
    brake: Fraction
    heading_per_m: NotNegative
    """Heading asked for (rad) per metre off the centreline."""
    heading_max_deg: Annotated[float, Field(gt=0.0, le=45.0)] = 5.0
    steering_gain: NotNegative
    """Steering per radian of heading error."""
    yaw_rate_gain_s: NotNegative
    """Steering per rad/s of yaw rate, as damping."""
    stop_speed_mps: Positive


class WindGains(Section):
    """``[guidance.wind]``: what is flown with ``approach.law = "wind"``."""

    estimate_time_s: Positive = 4.0
    """Low-pass of the wind that guidance reckons with."""
    speed_per_head_wind: NotNegative
    """Airspeed added per m/s of head wind,"""
    speed_added_max_mps: NotNegative
    """and most of it."""
    pitch_gain_rad_per_mps: NotNegative
    lateral_gain_per_s: NotNegative
    bank_gain_per_s: NotNegative
    """In place of those of ``[guidance.approach]``."""
    cross_integral_per_s2: NotNegative
    """Lateral speed asked for, per metre off the centreline and second,"""
    cross_integral_max_mps: NotNegative
    """and most of it."""
    align_height_m: NotNegative
    """Wheel height at which the nose begins to be turned onto the runway."""
    align_time_s: Positive
    """For how long turn coordination is faded out then."""
    align_gain: NotNegative
    """Rudder per radian of heading error,"""
    rudder_per_sideslip: NotNegative
    """and per radian of the sideslip that it holds."""
    rudder_max_deg: Positive
    align_bank_max_deg: Positive
    """Most bank into the wind meanwhile."""
    side_force_time_s: Positive = 0.2
    """Low-pass of the side force that the bank balances."""
    flare_time_constant_s: Positive
    flare_height_bias_m: NotNegative
    """In place of those of ``[guidance.flare]``."""
    flare_pitch_min_deg: Annotated[float, Field(ge=-10.0, le=20.0)]
    """Least pitch that is commanded in the flare, so that the main wheels touch first when a gust makes it fast."""
    rollout_integral_rad_per_m_s: NotNegative
    """Heading asked for on the ground, per metre off the centreline and second,"""
    rollout_integral_max_deg: NotNegative
    """and most of it."""


class ClimbGains(Section):
    """``[guidance.climb]``: the go-around, at full throttle, for scenarios that have one."""

    angle_deg: Positive
    """Climb asked for at the approach speed,"""
    angle_deg_per_mps: NotNegative
    """more or less by so much per m/s of airspeed above or below it,"""
    angle_max_deg: Positive
    """and at most; at least none."""
    bank_max_deg: Annotated[float, Field(gt=0.0, le=60.0)]
    """It keeps the track along the runway, not the place beside it."""
    airspeed_added_mps: Positive
    """Above the approach speed: so fast the throttle is told to become, which opens it fully."""


class GuidanceConfig(Section):
    """``[guidance]``: gains by phase."""

    approach: ApproachGains
    flare: FlareGains
    rollout: RolloutGains
    wind: WindGains | None = None
    climb: ClimbGains | None = None


class AircraftFile(Section):
    """Everything that an aircraft.toml may say."""

    name: Annotated[str, Field(min_length=1)]
    title: str
    model: Annotated[str, Field(min_length=1)]
    """The flight-dynamics model is ``<model>.xml`` in the same folder."""
    mount: MountConfig
    gear: GearConfig
    speeds: SpeedsConfig
    guidance: GuidanceConfig


class AircraftConfig(AircraftFile):
    """An aircraft as loaded."""

    folder: Path
    """Absolute; holds aircraft.toml and the model."""
