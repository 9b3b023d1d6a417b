"""When a landing is given up: protection level, tracking and alarms, from the decision height down.  Pure.

All heights are of the main wheels, by navigation.  The decision height is reached when they may be there, by the
vertical protection level: navigation that does not know its height must not put the decision off by it.
"""

import math
from typing import NamedTuple

from landsim.config import GoAroundConfig
from landsim.state import Alarm, NavState


class Doubt(NamedTuple):
    """What speaks against the landing, and for how long something has."""

    reason: str = ""
    lasting: float = 0.0
    """s."""


NO_DOUBT = Doubt()


def doubt_of(config: GoAroundConfig, nav: NavState, height: float, above_slope: float) -> str:
    """What speaks against going on with the landing; empty where nothing does.

    Parameters
    ----------
    config : GoAroundConfig
    nav : NavState
    height : float
        Of the main wheels, m.
    above_slope : float
        Of the centre of gravity above the glide slope, m; NaN where it is not to be judged, in the flare.
    """
    lowest = height if math.isnan(nav.vertical_protection) else height - nav.vertical_protection
    if height <= config.commit_height_m or lowest > config.decision_height_m:
        return ""
    alarm = nav.alarm
    if alarm & Alarm.INCONSISTENT:
        return "the lines contradict the navigation state"
    if alarm & Alarm.UNAIDED:
        return "no line has been believed for too long"
    if nav.lateral_protection > config.lateral_limit_m:
        return f"lateral protection level above {config.lateral_limit_m:g} m"
    if nav.vertical_protection > config.vertical_limit_m:
        return f"vertical protection level above {config.vertical_limit_m:g} m"
    if abs(nav.position[1]) > config.cross_limit_m:
        return f"more than {config.cross_limit_m:g} m off the centreline"
    if math.isfinite(above_slope) and abs(above_slope) > config.slope_limit_m:
        return f"more than {config.slope_limit_m:g} m off the glide slope"
    return ""


def doubted(doubt: Doubt, reason: str, height: float, dt: float) -> Doubt:
    """The doubt of this call, from that of the last one and what speaks against the landing now."""
    if not reason:
        return NO_DOUBT
    return Doubt(f"{reason}, {height:.1f} m up", doubt.lasting + dt)


def gives_up(config: GoAroundConfig, doubt: Doubt) -> bool:
    """Whether a doubt has lasted for so long that the aircraft goes around."""
    return bool(doubt.reason) and doubt.lasting >= config.confirm_s
