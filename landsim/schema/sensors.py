"""The sensors, and what navigation makes of them."""

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from landsim.schema.base import LARGEST, NotNegative, Positive, Section, WindowS, refused, tuple_from_list
from landsim.schema.grades import GRADES


class CameraConfig(Section):
    """``[camera]``: lens, image and the noise of the lines."""

    focal_length_mm: Positive = 12.5
    """As calibrated."""
    focal_length_error: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0
    """By this share the lens is longer than navigation takes it for."""
    tilt_error_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = 0.0
    """By so much the optical axis lies lower than the mount's angle says; not known to navigation."""
    pixel_um: Annotated[float, Field(ge=0.01, le=LARGEST)] = 9.9
    width_px: Annotated[int, Field(ge=16, le=20000)] = 658
    height_px: Annotated[int, Field(ge=16, le=20000)] = 494
    rate_hz: Annotated[float, Field(ge=0.1, le=10000.0)] = 30.0
    line_noise: Literal["edge-points", "endpoints"] = "edge-points"
    """What is noisy: every point along a line, or only the two ends of what is seen of it."""
    noise_px: NotNegative = 2.0**0.5
    """1 σ of each noisy point, in u and in v, as navigation believes it."""
    noise_factor: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """By which the points' noise is greater than that."""
    point_spacing_px: Annotated[float, Field(ge=0.1, le=LARGEST)] = 1.0
    """Between the points along a line, with ``edge-points``."""
    min_line_px: Annotated[float, Field(ge=2.0)] = 8.0
    """A shorter line is not reported; in fog and with blur it has to be longer by as much as its points are noisier."""
    near_m: Positive = 1.0
    """Depth of the near plane."""
    pan_error_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = 0.0
    """By so much the optical axis points further to the right than the mount says: about the camera's own axis down."""
    roll_error_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = 0.0
    """By so much the camera is turned about the optical axis, the right side down."""
    principal_u_error_px: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    """By so much the principal point lies further right than calibrated,"""
    principal_v_error_px: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    """and further down."""
    radial_distortion: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0
    """What calibration left of it: a point at r focal lengths from the principal point is seen at r (1 + κ r²)."""
    latency_s: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    """From the capture of an image to its lines, known on board; rounded to intervals of the inertial unit."""
    dropped_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Of the frames, each lost by chance."""
    exposure_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Motion blur: an edge that moves by b pixels meanwhile is smeared evenly, which adds b²/12 to the variance of its
    points; the detector sees the smear and says so."""
    visibility_m: Annotated[float, Field(gt=0.0, le=1e6)] = 1e6
    """Fog: nothing beyond is seen, and contrast falls off as exp(-3 d/visibility) (Koschmieder's law, 5 % being the
    least that is seen), by which the noise grows; the detector says so."""
    outages_s: Annotated[tuple[WindowS, ...], BeforeValidator(tuple_from_list)] = ()
    """Windows [from, to] of time in which no line is reported."""

    @model_validator(mode="after")
    def _outages_in_order(self) -> Self:
        for start, end in self.outages_s:
            if not start < end:
                raise refused(f"each window must be [from, to] with from < to, not [{start:g}, {end:g}]", "outages_s")
        for (_, end), (start, _) in pairwise(self.outages_s):
            if start < end:
                raise refused(f"windows must follow each other: one begins at {start:g}, before {end:g}", "outages_s")
        return self


class FaultConfig(Section):
    """``[fault]``: a line that is missing for a while, or another one in its place."""

    kind: Literal["none", "missing", "wrong"] = "none"
    line: Literal["left", "threshold", "right", "edge", "any"] = "edge"
    """Which; of the edges, or of all three, each seed takes one."""
    at_s: NotNegative = 8.0
    """When it begins,"""
    lasting_s: NotNegative = 3.0
    """and for how long."""
    offset_m: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 10.0
    """A wrong edge lies so much further right on the ground, a wrong threshold so much further along,"""
    angle_deg: Annotated[float, Field(ge=-80.0, le=80.0)] = 0.0
    """and is turned clockwise, seen from above, about where the edge begins or the threshold has its middle."""


class ImuConfig(Section):
    """``[imu]``: the one inertial unit; 1 σ each, drawn per seed and axis; a drift is a random walk."""

    grade: Literal["custom", "consumer", "industrial", "tactical"] = "custom"
    """All but ``custom`` put the numbers of such a unit, `landsim.schema.grades`, in place of the defaults below."""
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
    gyro_bias_instability_deg_h: NotNegative = 0.0
    """Flicker of the bias: B of IEEE Std 952, whose Allan deviation has the floor 0.664 B."""
    accel_bias_instability_mg: NotNegative = 0.0
    scale_factor: Annotated[float, Field(ge=0.0, lt=0.5)] = 3e-4
    """Relative, of each gyro and accelerometer."""
    error_factor: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """By which all these errors are greater than navigation believes, which is what the other keys say."""

    @model_validator(mode="before")
    @classmethod
    def _of_its_grade(cls, given: Any) -> Any:
        grade = given.get("grade") if isinstance(given, dict) else None
        if not isinstance(grade, str) or grade not in GRADES:
            return given
        return GRADES[grade] | {key: x for key, x in given.items() if key == "grade" or x != _default(cls, key)}


def _default(section: type[Section], key: str) -> Any:
    field = section.model_fields.get(key)
    return None if field is None else field.default


class PitotConfig(Section):
    """``[pitot]``: the airspeed measurement."""

    noise_mps: NotNegative = 0.3
    """1 σ of each sample."""
    lag_s: NotNegative = 0.1
    """Time constant."""
    scale_error: Annotated[float, Field(ge=-0.5, le=0.5)] = 0.0
    """By this share it reads too high: calibration, and where on the airframe it sits."""


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
    aiding: Literal["pose", "lines"] = "pose"
    """What the filter takes: the pose of three lines or two, or whatever lines there are, each judged by itself."""
    line_gate_probability: Annotated[float, Field(gt=0.0, lt=0.5)] = 1e-6
    """At which a good line is left out by chance, with ``aiding = "lines"``."""
    monitor_s: Positive = 0.3
    """A line that has been left out for so long is taken for another, and an alarm is raised."""
    unaided_s: Positive = 2.0
    """So long without a believed line raises an alarm."""
    integrity_risk: Annotated[float, Field(gt=0.0, lt=0.5)] = 1e-4
    """With which the error may pass the protection level, at any one time."""
    protection_inflation: Annotated[float, Field(ge=1.0, le=10.0)] = 1.0
    """By which the filter's own σ is taken larger for the protection level: room for what its model does not have."""
    tilt_sigma_deg: NotNegative = 0.0
    """1 σ, as the filter believes, of the camera's calibration, which it estimates with ``aiding = "lines"``: of the
    optical axis against the mount's angle,"""
    pan_sigma_deg: NotNegative = 0.0
    """to the side,"""
    roll_sigma_deg: NotNegative = 0.0
    """about the optical axis,"""
    focal_length_sigma: NotNegative = 0.0
    """of the focal length, as a share of it,"""
    principal_sigma_px: NotNegative = 0.0
    """of the principal point, in u and in v,"""
    distortion_sigma: NotNegative = 0.0
    """of the radial distortion that calibration left,"""
    width_sigma_m: NotNegative = 0.0
    """and of the runway's width."""
    start: Literal["vision", "handover"] = "vision"
    """From what the filter starts: the first vision poses, or a state that a GNSS/INS approach hands over, off by
    numbers that each seed draws from the standard deviations that it comes with:"""
    handover_along_sigma_m: Positive = 3.0
    handover_cross_sigma_m: Positive = 3.0
    handover_height_sigma_m: Positive = 4.0
    handover_velocity_sigma_mps: Positive = 0.2
    """On each axis."""
    handover_attitude_sigma_deg: Positive = 0.2
    """Of roll and of pitch."""
    handover_heading_sigma_deg: Positive = 0.5

    @model_validator(mode="after")
    def _calibration_by_lines(self) -> Self:
        names = (
            "tilt_sigma_deg", "pan_sigma_deg", "roll_sigma_deg", "focal_length_sigma", "principal_sigma_px",
            "distortion_sigma", "width_sigma_m",
        )  # fmt: skip
        if self.aiding == "pose":
            for name in names:
                if getattr(self, name) > 0.0:
                    raise refused('must be 0 with aiding = "pose": the calibration is estimated from lines', name)
        return self
