"""Guidance: glide slope and localizer, flare, touchdown and rollout.  Pure: (navigation state, phase) to command.

The phases follow one another and never go back: acquire, approach, flare, rollout, stopped; from approach or flare, a
landing that is given up leads to the go-around and to nothing else.  Everything that is carried from one call to the
next is in `GuidanceState`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from estimator.so3 import Vec3, rotate
from landsim.config import AircraftConfig, ApproachConfig, ClimbGains, GoAroundConfig
from landsim.go_around import NO_DOUBT, Doubt, doubt_of, doubted, gives_up
from landsim.state import Command, NavState, Phase
from landsim.units import DEG
from landsim.wind_law import (
    NO_WIND,
    WindLaw,
    WindMemory,
    airspeed_added,
    align_rudder,
    aligned,
    felt,
    kept_left,
    steered,
    wind_law_of,
)


@dataclass(frozen=True, slots=True)
class Law:
    """The control law of one aircraft on one approach, in SI; the gains are those of ``aircraft.toml``."""

    dt: float
    """Between calls, s."""
    gravity: float
    slope: float
    """Tangent of the glide slope."""
    aim_point: float
    approach_speed: float
    trim_alpha: float
    trim_alpha_slope: float
    height_gain: float
    pitch_gain: float
    pitch_integral: float
    integral_max: float
    """Most of the sink rate's integral, m."""
    max_sink: float
    pitch_min: float
    pitch_max: float
    lateral_gain: float
    lateral_speed_max: float
    bank_gain: float
    bank_max: float
    flare_height: float
    flare_time: float
    flare_bias: float
    touchdown_height: float
    lower_rate: float
    rollout_pitch: float
    brake_delay: float
    brake: float
    heading_gain: float
    heading_max: float
    steering_gain: float
    yaw_rate_gain: float
    stop_speed: float
    wheels: Vec3
    """Midpoint of the main wheels, body frame, m."""
    camera: Vec3
    """Projection centre, body frame, m."""
    tilt_early: float
    tilt_late: float
    tilt_rollout: float
    half_view: float
    """From the optical axis to the image's lower edge, rad."""
    go_around: GoAroundConfig | None = None
    """When the landing is given up; None where it never is."""
    wind: WindLaw | None = None
    """What is flown besides in wind."""
    climb: ClimbGains | None = None
    """How the go-around climbs, as in the aircraft's file; not None where there may be one."""


def law_of(
    aircraft: AircraftConfig,
    approach: ApproachConfig,
    gravity: float,
    half_view: float,
    dt: float,
    go_around: GoAroundConfig | None = None,
) -> Law:
    """The law of an aircraft's gains on an approach."""
    gains = aircraft.guidance
    a, f, r, wind = gains.approach, gains.flare, gains.rollout, gains.wind if approach.law == "wind" else None
    if approach.law == "wind" and wind is None:
        raise ValueError(f"{aircraft.name} has no [guidance.wind]")
    if go_around is not None and go_around.enabled and gains.climb is None:
        raise ValueError(f"{aircraft.name} has no [guidance.climb]")
    return Law(
        dt=dt,
        gravity=gravity,
        slope=math.tan(approach.glide_slope_deg * DEG),
        aim_point=approach.aim_point_m,
        approach_speed=aircraft.speeds.approach_mps,
        trim_alpha=a.trim_alpha_deg * DEG,
        trim_alpha_slope=a.trim_alpha_slope_deg_per_mps * DEG,
        height_gain=a.height_gain_per_s,
        pitch_gain=a.pitch_gain_rad_per_mps if wind is None else wind.pitch_gain_rad_per_mps,
        pitch_integral=a.pitch_integral_rad_per_m,
        integral_max=a.pitch_integral_max_deg * DEG / max(a.pitch_integral_rad_per_m, 1e-9),
        max_sink=a.max_sink_mps,
        pitch_min=a.pitch_min_deg * DEG,
        pitch_max=a.pitch_max_deg * DEG,
        lateral_gain=a.lateral_gain_per_s if wind is None else wind.lateral_gain_per_s,
        lateral_speed_max=a.lateral_speed_max_mps,
        bank_gain=a.bank_gain_per_s if wind is None else wind.bank_gain_per_s,
        bank_max=a.bank_max_deg * DEG,
        flare_height=f.height_m,
        flare_time=f.time_constant_s if wind is None else wind.flare_time_constant_s,
        flare_bias=f.height_bias_m if wind is None else wind.flare_height_bias_m,
        touchdown_height=f.touchdown_height_m,
        lower_rate=r.pitch_rate_deg_s * DEG,
        rollout_pitch=r.pitch_deg * DEG,
        brake_delay=r.brake_delay_s,
        brake=r.brake,
        heading_gain=r.heading_per_m,
        heading_max=r.heading_max_deg * DEG,
        steering_gain=r.steering_gain,
        yaw_rate_gain=r.yaw_rate_gain_s,
        stop_speed=r.stop_speed_mps,
        wheels=aircraft.gear.main_wheels_body_m,
        camera=aircraft.mount.position_body_m,
        tilt_early=aircraft.mount.tilt_early_deg * DEG,
        tilt_late=aircraft.mount.tilt_late_deg * DEG,
        tilt_rollout=aircraft.mount.tilt_rollout_deg * DEG,
        half_view=half_view,
        go_around=go_around if go_around is not None and go_around.enabled else None,
        climb=gains.climb,
        wind=None if wind is None else wind_law_of(wind),
    )


_ACQUIRE, _APPROACH, _FLARE, _ROLLOUT, _STOPPED, _GO_AROUND = Phase  # an enum's attributes are looked up slowly


class GuidanceState(NamedTuple):
    """What guidance remembers from one call to the next."""

    phase: Phase
    sink_integral: float
    """Of the sink rate's error, m."""
    pitch: float
    """Last pitch command, rad."""
    rollout_time: float
    """Since touchdown, s."""
    tilted: bool
    """The mount has been told to tilt for the late stage: in the air it is not told back."""
    doubt: Doubt = NO_DOUBT
    """Against the landing; that for which it was given up, once it was."""
    wind: WindMemory = NO_WIND


INITIAL = GuidanceState(Phase.ACQUIRE, 0.0, 0.0, 0.0, False)


def wheel_height(law: Law, nav: NavState) -> float:
    """Height of the midpoint of the main wheels, unloaded, above the runway, m."""
    x, y, z = law.wheels
    R = nav.R_runway_from_body
    return -nav.position[2] - (R[6] * x + R[7] * y + R[8] * z)


def next_phase(law: Law, nav: NavState, phase: Phase) -> Phase:
    """The phase that a navigation state calls for."""
    if not nav.ready:
        return phase
    if phase is _ACQUIRE:
        return _APPROACH
    if phase is _APPROACH and wheel_height(law, nav) < law.flare_height:
        return _FLARE
    if phase is _FLARE and wheel_height(law, nav) < law.touchdown_height:
        return _ROLLOUT
    if phase is _ROLLOUT and math.hypot(nav.velocity[0], nav.velocity[1]) < law.stop_speed:
        return _STOPPED
    return phase


def guide(law: Law, nav: NavState, state: GuidanceState) -> tuple[Command, GuidanceState]:
    """One call of guidance.

    Parameters
    ----------
    law : Law
    nav : NavState
        All that is known of the aircraft.
    state : GuidanceState
        From the last call, or `INITIAL`.

    Returns
    -------
    Command, GuidanceState
    """
    phase = next_phase(law, nav, state.phase)
    if law.go_around is not None and (phase is _APPROACH or phase is _FLARE):
        phase, state = _reconsidered(law, law.go_around, nav, phase, state)
    if phase is _GO_AROUND and law.climb is not None:
        return _climb(law, law.climb, nav, state)
    if phase is _ACQUIRE:
        return _HANDS_OFF._replace(airspeed=law.approach_speed, tilt=law.tilt_early), state
    if phase is _ROLLOUT or phase is _STOPPED:
        return _rollout(law, nav, phase, state)
    return _descend(law, nav, phase, state)


_HANDS_OFF = Command(
    engaged=False, pitch=0.0, roll=0.0, airspeed=0.0, idle=False, ground=False, steering=0.0, brake=0.0, tilt=0.0
)


def threshold_leaves(law: Law, nav: NavState) -> bool:
    """Whether the threshold passes the image's lower edge, by the navigation state and the early tilt."""
    x, _, z = rotate(nav.R_runway_from_body, law.camera)
    below_horizon = math.atan2(-nav.position[2] - z, -nav.position[0] - x)
    return below_horizon > law.half_view + law.tilt_early - nav.pitch


def above_slope(law: Law, nav: NavState) -> float:
    """Of the centre of gravity above the glide slope, m."""
    return -nav.position[2] - (law.aim_point - nav.position[0]) * law.slope


def _within(least: float, value: float, most: float) -> float:
    """The value, held between two limits; `most` for one that is not a number."""
    return (least if value < least else value) if value < most else most


def _descend(law: Law, nav: NavState, phase: Phase, state: GuidanceState) -> tuple[Command, GuidanceState]:
    flare = phase is _FLARE
    tilted = state.tilted or threshold_leaves(law, nav)
    speed, sink = nav.velocity[0], nav.velocity[2]
    wind = law.wind
    least = law.pitch_min if wind is None or not flare else wind.flare_pitch_min
    if flare:
        wanted = (max(wheel_height(law, nav), 0.0) + law.flare_bias) / law.flare_time
        if wind is not None:  # against a head wind the slope's own sink rate may be less
            wanted = min(wanted, max(speed * law.slope, law.flare_bias / law.flare_time))
    else:
        wanted = speed * law.slope + law.height_gain * above_slope(law, nav)
    wanted = _within(-law.max_sink, wanted, law.max_sink)
    error = sink - wanted
    integral = _within(-law.integral_max, state.sink_integral + error * law.dt, law.integral_max)
    airspeed = max(nav.airspeed, 0.5 * law.approach_speed)
    alpha = law.trim_alpha + law.trim_alpha_slope * (airspeed - law.approach_speed)
    pitch = alpha - wanted / airspeed + law.pitch_gain * error + law.pitch_integral * integral
    pitch = _within(least, pitch, law.pitch_max)
    command = Command(
        engaged=True,
        pitch=pitch,
        roll=bank_command(law, nav.position[1], nav.velocity[1]) if wind is None else 0.0,
        airspeed=law.approach_speed,
        idle=flare,
        ground=False,
        steering=0.0,
        brake=0.0,
        tilt=law.tilt_late if tilted else law.tilt_early,
    )
    memory = state.wind
    if wind is not None:
        command, memory = _against_wind(law, wind, nav, flare, command, memory)
    return command, GuidanceState(phase, integral, pitch, 0.0, tilted, state.doubt, memory)


def _against_wind(
    law: Law, wind: WindLaw, nav: NavState, flare: bool, command: Command, memory: WindMemory
) -> tuple[Command, WindMemory]:
    """A command of the descent, with airspeed, bank and rudder as the wind asks for."""
    memory = felt(wind, nav, memory, law.dt)
    if flare:
        memory = aligned(wind, wheel_height(law, nav), memory, law.dt)
    else:
        memory = kept_left(wind, nav.position[1], memory, law.dt)
    bank = bank_command(law, nav.position[1], nav.velocity[1], memory.cross_speed, memory.align * memory.side_force)
    rudder = 0.0
    if memory.align > 0.0:
        bank = _within(-wind.align_bank_max, bank, wind.align_bank_max)
        rudder = align_rudder(wind, nav, memory)
    airspeed = law.approach_speed + airspeed_added(wind, memory)
    return command._replace(roll=bank, airspeed=airspeed, align=memory.align, rudder=rudder), memory


def _reconsidered(
    law: Law, limits: GoAroundConfig, nav: NavState, phase: Phase, state: GuidanceState
) -> tuple[Phase, GuidanceState]:
    height = wheel_height(law, nav)
    above = math.nan if phase is _FLARE else above_slope(law, nav)
    doubt = doubted(state.doubt, doubt_of(limits, nav, height, above), height, law.dt)
    return _GO_AROUND if gives_up(limits, doubt) else phase, state._replace(doubt=doubt)


def _climb(law: Law, gains: ClimbGains, nav: NavState, state: GuidanceState) -> tuple[Command, GuidanceState]:
    """Full throttle, wings near level, along the runway; airspeed is held by the climb."""
    excess = nav.airspeed - law.approach_speed
    climb = _within(0.0, gains.angle_deg + gains.angle_deg_per_mps * excess, gains.angle_max_deg) * DEG
    alpha = law.trim_alpha + law.trim_alpha_slope * max(excess, -0.5 * law.approach_speed)
    pitch = _within(law.pitch_min, alpha + climb, law.pitch_max)
    bank = math.atan(-law.bank_gain * nav.velocity[1] / law.gravity)
    command = Command(
        engaged=True,
        pitch=pitch,
        roll=_within(-gains.bank_max_deg * DEG, bank, gains.bank_max_deg * DEG),
        airspeed=law.approach_speed + gains.airspeed_added_mps,
        idle=False,
        ground=False,
        steering=0.0,
        brake=0.0,
        tilt=law.tilt_late if state.tilted else law.tilt_early,
    )
    return command, state._replace(phase=_GO_AROUND, pitch=pitch)


def bank_command(
    law: Law, cross: float, cross_speed: float, added_speed: float = 0.0, side_force: float = 0.0
) -> float:
    """Bank angle (rad) that brings the aircraft to the centreline.

    Parameters
    ----------
    cross : float
        Right of the centreline, m: a positive one commands a bank to the left, which is negative.
    cross_speed : float
        m/s, to the right.
    added_speed : float
        Asked for besides what the distance asks for, m/s, to the right.
    side_force : float
        Specific force to the right that the bank is to balance, m/s².
    """
    wanted = _within(-law.lateral_speed_max, added_speed - law.lateral_gain * cross, law.lateral_speed_max)
    bank = math.atan((law.bank_gain * (wanted - cross_speed) - side_force) / law.gravity)
    return _within(-law.bank_max, bank, law.bank_max)


def steering_command(law: Law, cross: float, yaw: float, yaw_rate: float, added_heading: float = 0.0) -> float:
    """Nose wheel and rudder, -1 to 1, right positive, that hold the centreline on the ground."""
    heading = _within(-law.heading_max, added_heading - law.heading_gain * cross, law.heading_max)
    steering = law.steering_gain * (heading - yaw) - law.yaw_rate_gain * yaw_rate
    return _within(-1.0, steering, 1.0)


def _rollout(law: Law, nav: NavState, phase: Phase, state: GuidanceState) -> tuple[Command, GuidanceState]:
    time = state.rollout_time + law.dt
    start = state.pitch if state.rollout_time > 0.0 else nav.pitch
    pitch = max(law.rollout_pitch, start - law.lower_rate * law.dt)
    memory = state.wind if law.wind is None else steered(law.wind, nav.position[1], state.wind, law.dt)
    command = Command(
        engaged=True,
        pitch=pitch,
        roll=0.0,
        airspeed=law.approach_speed,
        idle=True,
        ground=True,
        steering=steering_command(law, nav.position[1], nav.yaw, nav.rate[2], memory.steering),
        brake=law.brake if time > law.brake_delay else 0.0,
        tilt=law.tilt_rollout,
    )
    return command, GuidanceState(phase, state.sink_integral, pitch, time, state.tilted, state.doubt, memory)
