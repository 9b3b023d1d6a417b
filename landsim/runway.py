"""The runway: its frame on the Earth, and its painted lines.

The runway frame has its origin at the middle of the threshold, x along the centreline in the landing direction, y
right, z down.  It is fixed to the Earth and flat: the tangent plane of the ellipsoid at the threshold, raised by the
elevation.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from estimator.so3 import Mat3, Vec3, matmul, rotate, rotate_back, transpose
from landsim import earth

Segment = tuple[Vec3, Vec3]


@dataclass(frozen=True)
class Runway:
    """A straight, flat runway.

    Parameters
    ----------
    length, width : float
        m; the width is between the painted edges.
    heading : float
        True heading of the landing direction, rad.
    latitude, longitude : float
        Geodetic, of the middle of the threshold, rad.
    elevation : float
        Of the threshold above the ellipsoid, m.
    """

    length: float
    width: float
    heading: float = 0.0
    latitude: float = 0.0
    longitude: float = 0.0
    elevation: float = 0.0

    @cached_property
    def origin_in_ecef(self) -> Vec3:
        """Middle of the threshold, ECEF, m."""
        return earth.ecef_from_geodetic(self.latitude, self.longitude, self.elevation)

    @cached_property
    def R_runway_from_ned(self) -> Mat3:
        """From north, east, down at the threshold to the runway frame."""
        s, c = math.sin(self.heading), math.cos(self.heading)
        return c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0

    @cached_property
    def R_runway_from_ecef(self) -> Mat3:
        """From ECEF to the runway frame."""
        return matmul(self.R_runway_from_ned, earth.ned_from_ecef(self.latitude, self.longitude))

    @cached_property
    def gravity(self) -> Vec3:
        """Gravity at the threshold, runway frame, m/s² (z down, so positive)."""
        return 0.0, 0.0, earth.gravity(self.latitude, self.elevation)

    @cached_property
    def earth_rate(self) -> Vec3:
        """The Earth's rotation, runway frame, rad/s."""
        return rotate(self.R_runway_from_ecef, (0.0, 0.0, earth.ROTATION_RATE))

    def from_ecef(self, position: Vec3) -> Vec3:
        """A point of ECEF in the runway frame, m."""
        o = self.origin_in_ecef
        return rotate(self.R_runway_from_ecef, (position[0] - o[0], position[1] - o[1], position[2] - o[2]))

    def to_ecef(self, position: Vec3) -> Vec3:
        """A point of the runway frame in ECEF, m."""
        o, d = self.origin_in_ecef, rotate_back(self.R_runway_from_ecef, position)
        return o[0] + d[0], o[1] + d[1], o[2] + d[2]

    def to_geodetic(self, position: Vec3) -> Vec3:
        """Geodetic latitude, longitude (rad) and height (m) of a point of the runway frame."""
        return earth.geodetic_from_ecef(self.to_ecef(position))

    def R_runway_from_ned_at(self, latitude: float, longitude: float) -> Mat3:
        """From north, east, down at another place (rad) to the runway frame."""
        return matmul(self.R_runway_from_ecef, transpose(earth.ned_from_ecef(latitude, longitude)))

    @cached_property
    def left_edge(self) -> Segment:
        """Painted left edge, from the threshold to the far end, runway frame, m."""
        return (0.0, -0.5 * self.width, 0.0), (self.length, -0.5 * self.width, 0.0)

    @cached_property
    def threshold(self) -> Segment:
        """Painted threshold, from left to right, runway frame, m."""
        return (0.0, -0.5 * self.width, 0.0), (0.0, 0.5 * self.width, 0.0)

    @cached_property
    def right_edge(self) -> Segment:
        """Painted right edge, from the threshold to the far end, runway frame, m."""
        return (0.0, 0.5 * self.width, 0.0), (self.length, 0.5 * self.width, 0.0)
