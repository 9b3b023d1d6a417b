"""What a scenario file and an aircraft file may hold: frozen models, with the default and the range of every key.

The models are the reference of the keys: a section of the file is a model, a key is a field, and the text under a field
says what it means.  Keys carry their unit.  Unknown keys, values of another type (whole numbers stand for floats,
nothing else is converted), NaN and infinities are refused.
"""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from landsim.errors import OWN_CHECK


def _tuple_from_list(value: Any) -> Any:
    """TOML has arrays; a frozen model holds tuples."""
    return tuple(value) if isinstance(value, list) else value


def _refused(message: str, key: str | None = None) -> PydanticCustomError:
    """What a check over several keys raises: a complete message and the dotted key to name, seen from the model."""
    return PydanticCustomError(OWN_CHECK, "{message}", {"message": message, "key": key or ""})


LARGEST = 1e6
"""No quantity of a landing is larger, in any of the units that are used."""
Positive = Annotated[float, Field(gt=0.0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0.0, le=LARGEST)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
HeadingDeg = Annotated[float, Field(ge=-360.0, le=360.0)]
PointM = Annotated[tuple[float, float, float], BeforeValidator(_tuple_from_list)]
WindowS = Annotated[tuple[NotNegative, NotNegative], BeforeValidator(_tuple_from_list)]


class Section(BaseModel):
    """A table of a file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class AircraftChoice(Section):
    """``[aircraft]``: which aircraft flies."""

    name: Annotated[str, Field(min_length=1)]
    """Name of a shipped aircraft, or path of a folder that holds aircraft.toml, relative to the scenario file."""


class RunwayConfig(Section):
    """``[runway]``: a flat, straight runway on the WGS 84 ellipsoid."""

    width_m: Annotated[float, Field(gt=0.0, le=1000.0)] = 30.0
    """Between the painted edges."""
    length_m: Annotated[float, Field(gt=0.0, le=1e5)] = 2000.0
    heading_deg: HeadingDeg = 0.0
    """True heading of the landing direction."""
    latitude_deg: Annotated[float, Field(ge=-89.0, le=89.0)] = 0.0
    """Geodetic, of the middle of the threshold.  North is not a direction to fly by nearer to a pole."""
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)] = 0.0
    elevation_m: Annotated[float, Field(ge=-500.0, le=6000.0)] = 0.0
    """Of the threshold above the ellipsoid."""


class ApproachConfig(Section):
    """``[approach]``: the line to fly."""

    glide_slope_deg: Annotated[float, Field(gt=0.0, lt=15.0)] = 3.0
    aim_point_m: NotNegative = 145.0
    """Where the glide slope meets the runway, past the threshold."""


class StartConfig(Section):
    """``[start]``: the centre of gravity at the start, and the σ of what each seed adds, unknown to navigation."""

    along_m: Annotated[float, Field(lt=0.0, ge=-1e5)] = -1000.0
    """From the threshold, negative before it."""
    cross_m: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0
    """Right of the centreline."""
    height_m: Positive = 60.0
    """Above the threshold."""
    heading_deg: Annotated[float, Field(ge=-90.0, le=90.0)] = 0.0
    """Relative to the runway's, nose right positive."""
    flight_path_deg: Annotated[float, Field(ge=-15.0, le=15.0)] = -3.0
    speed_mps: Positive | None = None
    """Airspeed; without it, the aircraft's approach speed."""
    cross_sigma_m: NotNegative = 8.0
    height_sigma_m: NotNegative = 4.0
    heading_sigma_deg: NotNegative = 2.0
    speed_sigma_mps: NotNegative = 1.0


class CameraConfig(Section):
    """``[camera]``: lens, image and the noise of the lines."""

    focal_length_mm: Positive = 12.5
    pixel_um: Annotated[float, Field(ge=0.01, le=LARGEST)] = 9.9
    width_px: Annotated[int, Field(ge=16, le=20000)] = 658
    height_px: Annotated[int, Field(ge=16, le=20000)] = 494
    rate_hz: Annotated[float, Field(ge=0.1, le=10000.0)] = 30.0
    line_noise: Literal["edge-points", "endpoints"] = "edge-points"
    """What is noisy: every point along a line, or only the two ends of what is seen of it."""
    noise_px: NotNegative = 2.0**0.5
    """1 σ of each noisy point, in u and in v."""
    point_spacing_px: Annotated[float, Field(ge=0.1, le=LARGEST)] = 1.0
    """Between the points along a line, with ``edge-points``."""
    min_line_px: Annotated[float, Field(ge=2.0)] = 8.0
    """A shorter line is not reported."""
    near_m: Positive = 1.0
    """Depth of the near plane."""
    outages_s: Annotated[tuple[WindowS, ...], BeforeValidator(_tuple_from_list)] = ()
    """Windows [from, to] of time in which no line is reported."""

    @model_validator(mode="after")
    def _outages_in_order(self) -> Self:
        for start, end in self.outages_s:
            if not start < end:
                raise _refused(f"each window must be [from, to] with from < to, not [{start:g}, {end:g}]", "outages_s")
        for (_, end), (start, _) in pairwise(self.outages_s):
            if start < end:
                raise _refused(f"windows must follow each other: one begins at {start:g}, before {end:g}", "outages_s")
        return self


class ImuConfig(Section):
    """``[imu]``: the one inertial unit; 1 σ each, drawn per seed and axis; a drift is a random walk."""

    rate_hz: Annotated[float, Field(ge=1.0, le=10000.0)] = 120.0
    gyro_bias_deg_h: NotNegative = 10.0
    gyro_bias_drift_deg_h_sqrt_h: NotNegative = 3.0
    """deg/h after one hour."""
    gyro_noise_deg_sqrt_h: NotNegative = 0.1
    """Angle random walk."""
    accel_bias_mg: NotNegative = 1.0
    accel_bias_drift_mg_sqrt_h: NotNegative = 0.3
    """mg after one hour."""
    accel_noise_mps_sqrt_h: NotNegative = 0.1
    """Velocity random walk."""
    scale_factor: Annotated[float, Field(ge=0.0, lt=0.5)] = 3e-4
    """Relative, of each gyro and accelerometer."""


class PitotConfig(Section):
    """``[pitot]``: the airspeed measurement."""

    noise_mps: NotNegative = 0.3
    """1 σ of each sample."""
    lag_s: NotNegative = 0.1
    """Time constant."""


class NavigationConfig(Section):
    """``[navigation]``: how the filter starts, what it believes and when it gives up."""

    start_frames: Annotated[int, Field(ge=2, le=1000)] = 15
    """Camera frames from which the first state is made."""
    start_speed_sigma_mps: Positive = 0.5
    """Of the first velocity, on each axis: the wind, the pitot tube and the sideslip are in it."""
    gate_early: Positive = 22.5
    """Greatest normalised innovation squared of three lines, six numbers."""
    gate_late: Positive = 18.5
    """The same of two lines, four numbers."""
    start_attitude_sigma_deg: Positive = 5.0
    """The filter waits while one frame's attitude is known no better than this: a mean of such poses is no start."""
    min_noise_px: Positive = 0.05
    """The filter believes no line's points better than this: beyond it, the curvature of the projection counts."""
    airspeed_smoothing_s: Positive = 0.2
    """Time constant of the low-pass on the pitot tube's noise."""
    max_position_sigma_m: Positive = 500.0
    """Diverged when the filter's own σ of the position passes this."""
    max_rejected_frames: Annotated[int, Field(ge=1)] = 300
    """Diverged when more frames than this in succession do not pass the gate."""
    handover: Literal["in-view", "latched"] = "in-view"
    """When three lines are used: whenever the threshold is in view, or until it has once left the image."""


class SimulationConfig(Section):
    """``[simulation]``: the plant's step and the longest flight."""

    rate_hz: Annotated[float, Field(ge=20.0, le=10000.0)] = 120.0
    """``imu.rate_hz`` must divide it, and ``camera.rate_hz`` must divide both."""
    time_limit_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 120.0
    end: Literal["stop", "touchdown"] = "stop"
    """Where a flight ends: at the stop, or at the touchdown, where what comes after is of no interest."""


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
            raise _refused(f"must be above along_min_m = {self.along_min_m:g}, not {self.along_max_m:g}", "along_max_m")
        return self


class BoundsConfig(Section):
    """``[study.bounds]``: the largest error that each quantity is claimed to have; none for one left out."""

    roll_deg: Positive | None = None
    pitch_deg: Positive | None = None
    yaw_deg: Positive | None = None
    cross_m: Positive | None = None
    altitude_m: Positive | None = None
    along_m: Positive | None = None


class StudyConfig(Section):
    """``[study]``: the errors of an estimate by range, sampled on a straight approach or taken from flights.

    The straight approach begins at ``start`` (its means) with the camera there, and is flown along
    ``start.flight_path_deg`` at the approach speed, with no roll and no yaw.
    """

    method: Literal["sampling", "flights"] = "sampling"
    """``sampling`` draws the noise of each frame many times; the fused errors come from flights in either case."""
    stage: Literal["early", "late", "both"] = "early"
    """Three lines, two lines with a roll angle, or one after the other."""
    readings: Annotated[
        tuple[Literal["endpoints", "edge-points"], ...], BeforeValidator(_tuple_from_list), Field(min_length=1)
    ] = ("endpoints", "edge-points")
    """Of the noise, each studied in place of ``camera.line_noise``."""
    pitch_early_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = -3.0
    """Of the camera to the runway on the straight approach, while the threshold is in the image."""
    pitch_late_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = -10.0
    """From when it has left."""
    end_height_m: Positive = 2.0
    """Camera height at which the late stage ends."""
    draws: Annotated[int, Field(ge=100, le=1_000_000)] = 1000
    """A frame."""
    ranges_m: Annotated[tuple[float, ...], BeforeValidator(_tuple_from_list), Field(min_length=1)]
    """Distances to the threshold, negative past it, at which figures are listed."""
    listed_draws: Annotated[int, Field(ge=100, le=10_000_000)] = 20_000
    """At each of them."""
    roll_errors_deg: Annotated[
        tuple[Annotated[float, Field(ge=-45.0, le=45.0)], ...], BeforeValidator(_tuple_from_list), Field(min_length=1)
    ] = (0.0,)
    """By which the roll angle given to the late stage is off."""
    flights: Annotated[int, Field(ge=0, le=100_000)] = 100
    """Flown with seeds from the run's own on, for each reading."""
    bounds: BoundsConfig = Field(default_factory=BoundsConfig)
    bounds_late: BoundsConfig = Field(default_factory=BoundsConfig)
    """``[study.bounds_late]``: those that are others in the late stage; each one left out is that of ``bounds``."""

    def bound(self, stage: Literal["early", "late"], key: str) -> float | None:
        """A bound of a stage by its key, such as ``cross_m``, in the unit that the key says."""
        late: float | None = getattr(self.bounds_late, key) if stage == "late" else None
        early: float | None = getattr(self.bounds, key)
        return early if late is None else late

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if any(a <= b for a, b in pairwise(self.ranges_m)):
            raise _refused(f"must fall from each to the next, not {list(self.ranges_m)}", "ranges_m")
        for key in ("readings", "roll_errors_deg"):
            values: tuple[object, ...] = getattr(self, key)
            if len(set(values)) < len(values):
                raise _refused(f"must not repeat any, not {list(values)}", key)
        if self.method == "flights" and self.flights < 2:
            raise _refused(f'must be at least 2 with method = "flights", not {self.flights}', "flights")
        return self


class ScenarioFile(Section):
    """Everything that a scenario file may say."""

    kind: Literal["flight", "study"]
    aircraft: AircraftChoice
    runway: RunwayConfig = Field(default_factory=RunwayConfig)
    approach: ApproachConfig = Field(default_factory=ApproachConfig)
    start: StartConfig = Field(default_factory=StartConfig)
    camera: CameraConfig = Field(default_factory=CameraConfig)
    imu: ImuConfig = Field(default_factory=ImuConfig)
    pitot: PitotConfig = Field(default_factory=PitotConfig)
    navigation: NavigationConfig = Field(default_factory=NavigationConfig)
    simulation: SimulationConfig = Field(default_factory=SimulationConfig)
    box: BoxConfig = Field(default_factory=BoxConfig)
    study: StudyConfig | None = None
    """Of the kind ``study`` alone."""

    @model_validator(mode="after")
    def _sections_agree(self) -> Self:
        if (self.kind == "study") != (self.study is not None):
            wanted = "is missing, which" if self.study is None else "belongs to"
            raise _refused(f'{wanted} kind = "study"{" needs" if self.study is None else ""}', "study")
        step_rate = self.simulation.rate_hz
        for key, rate in (("imu.rate_hz", self.imu.rate_hz), ("camera.rate_hz", self.camera.rate_hz)):
            steps = step_rate / rate
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-9 * steps:
                raise _refused(f"must divide simulation.rate_hz = {step_rate:g}; {rate:g} does not", key)
        frames = self.imu.rate_hz / self.camera.rate_hz
        if round(frames) < 1 or abs(frames - round(frames)) > 1e-9 * frames:
            raise _refused(
                f"must divide imu.rate_hz = {self.imu.rate_hz:g}; {self.camera.rate_hz:g} does not", "camera.rate_hz"
            )
        if self.approach.aim_point_m >= self.runway.length_m:
            length, aim_point = self.runway.length_m, self.approach.aim_point_m
            raise _refused(f"must be below runway.length_m = {length:g}, not {aim_point:g}", "approach.aim_point_m")
        return self


class MountConfig(Section):
    """``[mount]``: the camera's tilting mount.  Tilt is the optical axis' angle below the body's forward axis."""

    position_body_m: PointM
    """Projection centre from the centre of gravity: forward, right, down."""
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
    """``[gear]``: where the wheels touch, unloaded, from the centre of gravity: forward, right, down."""

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


class GuidanceConfig(Section):
    """``[guidance]``: gains by phase."""

    approach: ApproachGains
    flare: FlareGains
    rollout: RolloutGains


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


class Scenario(ScenarioFile):
    """A scenario as loaded, with its aircraft; complete, so that a flight needs nothing else but a seed."""

    name: str
    """The file's name without its ending."""
    path: Path
    """The file it was read from, absolute."""
    aircraft_config: AircraftConfig


def _section_of(annotation: Any) -> type[Section] | None:
    """The model of a field that holds a table, or may hold one."""
    for kind in (annotation, *get_args(annotation)):
        if isinstance(kind, type) and issubclass(kind, Section):
            return kind
    return None


def field_names(model: type[Section], place: tuple[int | str, ...]) -> list[str]:
    """The keys that are right in the table at a place below a model."""
    for name in place:
        field = model.model_fields.get(str(name))
        inner = _section_of(field.annotation) if field else None
        if inner is None:
            return []
        model = inner
    return list(model.model_fields)


def rows(section: Section, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Dotted key and value of everything in a model, in the file's order."""
    for name in type(section).model_fields:
        value = getattr(section, name)
        if isinstance(value, Section):
            yield from rows(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
