"""What is true.  The plant makes it; the sensors, the simulation loop and its recorder may hold it, nobody else.

Named tuples and not dataclasses: one is made at every step, and a frozen dataclass costs five times as much.
"""

from typing import NamedTuple

from estimator.so3 import Array, Mat3, Vec3
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
    """Velocity of the air, runway frame, m/s: steady, the same everywhere."""


class Loading(NamedTuple):
    """How an aircraft's mass differs from the nominal one."""

    extra_mass: float = 0.0
    """At the nominal centre of gravity, kg."""
    cg_forward: float = 0.0
    """Of the centre of gravity from its nominal place, m."""


NOMINAL = Loading()


class Truth(NamedTuple):
    """The aircraft at one instant."""

    time: float
    """s since the start."""
    motion: Array
    """(15,): position, velocity and attitude, as `estimator.strapdown.Inertial.numbers` begins; never written to.

    They are those of the body's origin, which is the centre of gravity of the aircraft as it is nominally loaded.
    """
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
        """Nominal centre of gravity, runway frame, m."""
        return inertial(self.motion).position

    @property
    def velocity(self) -> Vec3:
        """Relative to the ground, runway frame, m/s."""
        return inertial(self.motion).velocity

    @property
    def R_runway_from_body(self) -> Mat3:
        """Attitude: takes body vectors (forward, right, down) to the runway frame."""
        return inertial(self.motion).attitude
