"""What is true.  The plant makes it; the sensors, the simulation loop and its recorder may hold it, nobody else.

Named tuples and not dataclasses: one is made at every step, and a frozen dataclass costs five times as much.
"""

from typing import NamedTuple

from estimator.so3 import Array, Mat3, Vec3
from estimator.strapdown import inertial


class InitialState(NamedTuple):
    """Where a flight begins, in trim, wings level."""

    position: Vec3
    """Centre of gravity, runway frame, m."""
    speed: float
    """True airspeed, m/s."""
    heading: float
    """Heading and track relative to the runway's, rad, nose right positive (calm air)."""
    flight_path: float
    """Flight-path angle, rad, climb positive."""


class Truth(NamedTuple):
    """The aircraft at one instant."""

    time: float
    """s since the start."""
    motion: Array
    """(15,): position, velocity and attitude, as `estimator.strapdown.Inertial.numbers` begins; never written to."""
    airspeed: float
    """True airspeed, m/s."""
    wow_nose: bool
    wow_left: bool
    wow_right: bool
    """Weight on the nose, left main, right main wheel."""
    structure_contact: bool
    """A part that is not a wheel touches the ground."""
    elevator: float
    """rad, trailing edge down positive (nose down)."""
    aileron: float
    """rad, positive rolls right."""
    rudder: float
    """rad, positive yaws right."""
    throttle: float
    """0 to 1."""
    thrust: float
    """N."""

    @property
    def position(self) -> Vec3:
        """Centre of gravity, runway frame, m."""
        return inertial(self.motion).position

    @property
    def velocity(self) -> Vec3:
        """Relative to the ground, runway frame, m/s."""
        return inertial(self.motion).velocity

    @property
    def R_runway_from_body(self) -> Mat3:
        """Attitude: takes body vectors (forward, right, down) to the runway frame."""
        return inertial(self.motion).attitude
