"""What is known on board: measurements, the navigation state, the command.  Nothing here is true by construction."""

from enum import IntEnum
from typing import NamedTuple

from estimator.so3 import Mat3, Vec3


class Phase(IntEnum):
    """Phase of the flight, by guidance."""

    ACQUIRE = 0
    """Navigation has not started: surfaces at trim, rates damped."""
    APPROACH = 1
    FLARE = 2
    ROLLOUT = 3
    STOPPED = 4


class Stage(IntEnum):
    """What the last camera frame gave the filter."""

    NONE = 0
    """No usable lines: the filter coasts."""
    EARLY = 1
    """Both edges and the threshold: six numbers."""
    LATE = 2
    """Both edges: four numbers, with the filter's roll."""


class ImuSample(NamedTuple):
    """What the inertial unit reports over one of its intervals, at its end."""

    angle: Vec3
    """Integrated angular rate relative to inertial space, body frame, rad."""
    velocity: Vec3
    """Integrated specific force, body frame at the interval's start, m/s."""


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
    ends: tuple[float, float, float, float]
    """u, v of both ends of what was seen, moved onto the fitted line, px."""


class CameraFrame(NamedTuple):
    """One image as navigation receives it: a line that is not in view is None."""

    time: float
    left: LineReading | None
    threshold: LineReading | None
    right: LineReading | None
    tilt: float
    """Mount angle as read, rad, optical axis down from the body's x axis."""


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
