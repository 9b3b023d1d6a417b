"""What guidance adds in wind: airspeed, crab and its end, a held sink rate, the rollout.  Pure.

In the air the aircraft crabs: it flies without sideslip, and the wind is what its ground velocity has beyond its
airspeed along the nose.  Just above the ground the rudder turns the nose onto the runway; the side force of the
sideslip that this makes is held by bank into the wind, so that the track stays.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from landsim.config import WindGains
from landsim.state import NavState
from landsim.units import DEG


@dataclass(frozen=True, slots=True)
class WindLaw:
    """The gains of ``[guidance.wind]`` of an aircraft, in SI."""

    estimate_time: float
    speed_per_head_wind: float
    speed_added_max: float
    cross_integral: float
    cross_integral_max: float
    align_height: float
    align_time: float
    align_gain: float
    rudder_per_sideslip: float
    rudder_max: float
    align_bank_max: float
    side_force_time: float
    flare_pitch_min: float
    rollout_integral: float
    rollout_integral_max: float


def wind_law_of(gains: WindGains) -> WindLaw:
    """The law of an aircraft's gains."""
    return WindLaw(
        estimate_time=gains.estimate_time_s,
        speed_per_head_wind=gains.speed_per_head_wind,
        speed_added_max=gains.speed_added_max_mps,
        cross_integral=gains.cross_integral_per_s2,
        cross_integral_max=gains.cross_integral_max_mps,
        align_height=gains.align_height_m,
        align_time=gains.align_time_s,
        align_gain=gains.align_gain,
        rudder_per_sideslip=gains.rudder_per_sideslip,
        rudder_max=gains.rudder_max_deg * DEG,
        align_bank_max=gains.align_bank_max_deg * DEG,
        side_force_time=gains.side_force_time_s,
        flare_pitch_min=gains.flare_pitch_min_deg * DEG,
        rollout_integral=gains.rollout_integral_rad_per_m_s,
        rollout_integral_max=gains.rollout_integral_max_deg * DEG,
    )


class WindMemory(NamedTuple):
    """What is remembered of the wind from one call to the next."""

    known: bool = False
    head: float = 0.0
    """Wind against the landing direction, low-passed, m/s."""
    cross: float = 0.0
    """Towards the right, m/s; both stay what they were when the nose began to be turned onto the runway."""
    side_force: float = 0.0
    """Specific force along body y, low-passed, m/s²."""
    cross_speed: float = 0.0
    """What the integral of the distance from the centreline adds to the lateral speed asked for, m/s."""
    align: float = 0.0
    """As `landsim.state.Command.align`."""
    steering: float = 0.0
    """Integral of the distance from the centreline on the ground: heading, rad."""


NO_WIND = WindMemory()


def felt(law: WindLaw, nav: NavState, memory: WindMemory, dt: float) -> WindMemory:
    """The memory with this call's wind in it: ground velocity less airspeed along the nose, level, low-passed."""
    head = nav.airspeed * math.cos(nav.yaw) - nav.velocity[0]
    cross = nav.velocity[1] - nav.airspeed * math.sin(nav.yaw)
    if not memory.known:
        return memory._replace(known=True, head=head, cross=cross, side_force=nav.side_force)
    slow, quick = 1.0 - math.exp(-dt / law.estimate_time), 1.0 - math.exp(-dt / law.side_force_time)
    side_force = memory.side_force + quick * (nav.side_force - memory.side_force)
    if memory.align > 0.0:
        return memory._replace(side_force=side_force)
    return memory._replace(
        head=memory.head + slow * (head - memory.head),
        cross=memory.cross + slow * (cross - memory.cross),
        side_force=side_force,
    )


def airspeed_added(law: WindLaw, memory: WindMemory) -> float:
    """By how much the approach is flown faster, m/s: a part of the head wind, which is weaker near the ground."""
    return min(max(law.speed_per_head_wind * memory.head, 0.0), law.speed_added_max)


def kept_left(law: WindLaw, cross: float, memory: WindMemory, dt: float) -> WindMemory:
    """The memory with the integral of the distance from the centreline (m) carried on."""
    most = law.cross_integral_max
    speed = memory.cross_speed - law.cross_integral * cross * dt
    return memory._replace(cross_speed=min(max(speed, -most), most))


def aligned(law: WindLaw, height: float, memory: WindMemory, dt: float) -> WindMemory:
    """The memory with the nose turned further onto the runway, once the wheels (m) are low enough."""
    if memory.align == 0.0 and height > law.align_height:
        return memory
    return memory._replace(align=min(memory.align + dt / law.align_time, 1.0))


def align_rudder(law: WindLaw, nav: NavState, memory: WindMemory) -> float:
    """Rudder (rad) that turns the nose onto the runway and holds the sideslip which the cross wind then makes.

    With a wind towards the right the air comes from the left, which turns the nose to the left: right rudder holds it.
    """
    sideslip = math.atan2(memory.cross, max(nav.airspeed, 1.0))
    rudder = law.rudder_per_sideslip * sideslip - law.align_gain * nav.yaw
    return min(max(rudder, -law.rudder_max), law.rudder_max)


def steered(law: WindLaw, cross: float, memory: WindMemory, dt: float) -> WindMemory:
    """The memory with the integral of the distance from the centreline on the ground (m) carried on."""
    most = law.rollout_integral_max
    heading = memory.steering - law.rollout_integral * cross * dt
    return memory._replace(steering=min(max(heading, -most), most))
