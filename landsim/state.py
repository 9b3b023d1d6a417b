"""What is known on board: measurements, the navigation state, the command.  Nothing here is true by construction."""

import math
from enum import IntEnum, IntFlag
from typing import NamedTuple, TypeAlias

from estimator.so3 import Array, Mat3, Vec3


class Phase(IntEnum):
    """Phase of the flight, by guidance."""

    ACQUIRE = 0
    """Navigation has not started: surfaces at trim, rates damped."""
    APPROACH = 1
    FLARE = 2
    ROLLOUT = 3
    STOPPED = 4
    GO_AROUND = 5
    """The landing was given up: climbing out on the runway's heading."""


class Stage(IntEnum):
    """What the last camera frame gave the filter."""

    NONE = 0
    """No usable lines: the filter coasts."""
    EARLY = 1
    """Both edges and the threshold: six numbers."""
    LATE = 2
    """Both edges: four numbers, with the filter's roll."""


class Alarm(IntFlag):
    """What navigation finds wrong with itself; several may stand at once."""

    NONE = 0
    WRONG_LINE = 1
    """A line has disagreed with all else for so long that it is taken for another and left out."""
    UNAIDED = 2
    """No line has been believed for longer than allowed."""
    INCONSISTENT = 4
    """So much disagrees, or for so long, that it may be the state that is wrong."""


ImuSample: TypeAlias = Array
"""What the inertial unit reports over one of its intervals, at its end: (6,), integrated angular rate relative to
inertial space (body frame, rad), integrated specific force (body frame at the interval's start, m/s)."""


class LineReading(NamedTuple):
    """One image line, fitted to its points."""

    a: float
    b: float
    c: float
    """a u + b v + c = 0, pixels, a² + b² = 1."""
    centroid_u: float
    centroid_v: float
    """Centre of the points, px."""
    spread: float
    """Sum of squared distances of the points from their centre, along the line, px²."""
    points: float
    """Number of points."""


class CameraFrame(NamedTuple):
    """One image as navigation receives it."""

    time: float
    lines: Array
    """(3, 7): left edge, threshold and right edge, each as `LineReading`; NaN for a line that is not in view."""
    tilt: float
    """Mount angle as read, rad, optical axis down from the body's x axis."""

    def reading(self, line: int) -> LineReading | None:
        """A line by its row; None if it is not in view."""
        numbers = LineReading(*self.lines[line].tolist())
        return None if math.isnan(numbers.a) else numbers


class NavState(NamedTuple):
    """What navigation gives to guidance."""

    time: float
    ready: bool
    """False until the filter has started; the rest is then not to be used."""
    position: Vec3
    """Centre of gravity, runway frame, m."""
    velocity: Vec3
    """Runway frame, m/s."""
    R_runway_from_body: Mat3
    roll: float
    pitch: float
    yaw: float
    """Of the body, relative to the runway frame, rad."""
    rate: Vec3
    """Body rates relative to the ground, less the estimated bias, rad/s."""
    airspeed: float
    """From the pitot tube, m/s."""
    stage: Stage
    lateral_protection: float = math.nan
    """Of the centre of gravity, m: what its lateral error exceeds with no more than the stated risk; NaN where
    navigation states none."""
    vertical_protection: float = math.nan
    alarm: Alarm = Alarm.NONE
    side_force: float = 0.0
    """Specific force along body y at the inertial unit, less the estimated bias, m/s²."""


class Command(NamedTuple):
    """What guidance asks of the inner loops."""

    engaged: bool
    """False: surfaces and throttle stay at trim, and only the rates are damped."""
    pitch: float
    """rad."""
    roll: float
    """rad."""
    airspeed: float
    """m/s."""
    idle: bool
    """Throttle to idle whatever the airspeed."""
    ground: bool
    """On the wheels: the rudder and the nose wheel follow ``steering`` instead of coordinating turns."""
    steering: float
    """-1 to 1, right positive."""
    brake: float
    """0 to 1, both main wheels."""
    tilt: float
    """Camera mount angle asked for, rad, down positive."""
    align: float = 0.0
    """In the air: from 0, the rudder coordinates turns, to 1, it is ``rudder`` instead."""
    rudder: float = 0.0
    """Rudder asked for, besides the yaw damper's, as far as ``align`` says, rad, nose right positive."""
