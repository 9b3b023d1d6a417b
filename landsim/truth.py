"""What is true.  The plant makes it; the sensors, the simulation loop and its recorder may hold it, nobody else.

Named tuples and not dataclasses: one is made at every step, and a frozen dataclass costs five times as much.  What the
log takes down stands in one array, so that it is copied at once.
"""

from typing import NamedTuple

from estimator.so3 import Array, Mat3, Vec3, to_euler
from estimator.strapdown import inertial


class InitialState(NamedTuple):
    """Where a flight begins, in trim, wings level, the nose into the wind that it feels."""

    position: Vec3
    """Centre of gravity, runway frame, m."""
    speed: float
    """True airspeed, m/s."""
    heading: float
    """Of the track over the ground relative to the runway's, rad, right positive; in calm air that of the nose too."""
    flight_path: float
    """Flight-path angle over the ground, rad, climb positive."""
    wind: Vec3 = (0.0, 0.0, 0.0)
    """Velocity of the air where it begins, runway frame, m/s."""


class Loading(NamedTuple):
    """How an aircraft's mass differs from the nominal one."""

    extra_mass: float = 0.0
    """At the nominal centre of gravity, kg."""
    cg_forward: float = 0.0
    """Of the centre of gravity from its nominal place, m."""


NOMINAL = Loading()


MOTION = 15
"""Numbers of position, velocity and attitude, as `estimator.strapdown.Inertial.numbers` begins."""
AFTER_MOTION = (
    "time", "airspeed", "elevator", "aileron", "rudder", "throttle", "wow_nose", "wow_left", "wow_right",
    "wind_x", "wind_y", "wind_z",
)  # fmt: skip
"""The single numbers that follow."""
NUMBERS = MOTION + len(AFTER_MOTION)
_TIME, _AIRSPEED, _ELEVATOR, _AILERON, _RUDDER, _THROTTLE = range(MOTION, MOTION + 6)


class Truth(NamedTuple):
    """The aircraft at one instant."""

    time: float
    """s since the start."""
    motion: Array
    """(27,): position, velocity and attitude, and what `AFTER_MOTION` names; never written to.

    They are those of the body's origin, which is the centre of gravity of the aircraft as it is nominally loaded.
    """
    airspeed: float
    """True airspeed, m/s."""
    wow_nose: bool = False
    wow_left: bool = False
    wow_right: bool = False
    """Weight on the nose, left main, right main wheel."""
    structure_contact: bool = False
    """A part that is not a wheel touches the ground."""

    @property
    def elevator(self) -> float:
        """rad, trailing edge down positive (nose down)."""
        return self.motion.item(_ELEVATOR)

    @property
    def aileron(self) -> float:
        """rad, positive rolls right."""
        return self.motion.item(_AILERON)

    @property
    def rudder(self) -> float:
        """rad, positive yaws right."""
        return self.motion.item(_RUDDER)

    @property
    def throttle(self) -> float:
        """0 to 1."""
        return self.motion.item(_THROTTLE)

    @property
    def position(self) -> Vec3:
        """Nominal centre of gravity, runway frame, m."""
        return inertial(self.motion).position

    @property
    def velocity(self) -> Vec3:
        """Relative to the ground, runway frame, m/s."""
        return inertial(self.motion).velocity

    @property
    def roll_and_pitch(self) -> tuple[float, float]:
        """Of the body, relative to the runway frame, rad."""
        roll, pitch, _ = to_euler(inertial(self.motion).attitude)
        return roll, pitch

    @property
    def R_runway_from_body(self) -> Mat3:
        """Attitude: takes body vectors (forward, right, down) to the runway frame."""
        return inertial(self.motion).attitude
