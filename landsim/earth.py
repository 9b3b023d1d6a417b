"""The WGS 84 Earth: where a geodetic position is, what gravity is there, and how fast it turns.

Source of the constants and of Somigliana's formula: NIMA TR8350.2, Department of Defense World Geodetic System 1984,
third edition (2000), tables 3.1 and 3.4 and equation 4-1.
"""

import math

from estimator.so3 import Mat3, Vec3

SEMI_MAJOR_AXIS = 6378137.0
"""m."""
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)
ROTATION_RATE = 7.292115e-5
"""rad/s."""
EQUATOR_GRAVITY = 9.7803253359
"""m/s², centrifugal part included."""
SOMIGLIANA = 0.00193185265241
MEAN_RADIUS = 6371008.8
"""m."""


def ecef_from_geodetic(latitude: float, longitude: float, height: float) -> Vec3:
    """Earth-centred, Earth-fixed position (m) of a geodetic latitude, longitude (rad) and height (m)."""
    s, c = math.sin(latitude), math.cos(latitude)
    normal = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY2 * s * s)
    return (
        (normal + height) * c * math.cos(longitude),
        (normal + height) * c * math.sin(longitude),
        (normal * (1.0 - ECCENTRICITY2) + height) * s,
    )


def geodetic_from_ecef(position: Vec3) -> Vec3:
    """Geodetic latitude, longitude (rad) and height (m) of an ECEF position; for heights within 10 km of the ellipsoid.

    Bowring's iteration on the latitude, run until it no longer moves (a few rounds).
    """
    x, y, z = position
    p = math.hypot(x, y)
    latitude = math.atan2(z, p * (1.0 - ECCENTRICITY2))
    height = 0.0
    for _ in range(8):
        s = math.sin(latitude)
        normal = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY2 * s * s)
        height = p * math.cos(latitude) + z * s - SEMI_MAJOR_AXIS**2 / normal
        latitude = math.atan2(z, p * (1.0 - ECCENTRICITY2 * normal / (normal + height)))
    return latitude, math.atan2(y, x), height


def ned_from_ecef(latitude: float, longitude: float) -> Mat3:
    """The matrix that takes ECEF vectors to north, east, down at a place (rad)."""
    sl, cl = math.sin(latitude), math.cos(latitude)
    so, co = math.sin(longitude), math.cos(longitude)
    return -sl * co, -sl * so, cl, -so, co, 0.0, -cl * co, -cl * so, -sl


def gravity(latitude: float, height: float) -> float:
    """Normal gravity (m/s², centrifugal part included) at a geodetic latitude (rad) and height (m)."""
    s2 = math.sin(latitude) ** 2
    at_ellipsoid = EQUATOR_GRAVITY * (1.0 + SOMIGLIANA * s2) / math.sqrt(1.0 - ECCENTRICITY2 * s2)
    return at_ellipsoid * (1.0 - 2.0 * height / MEAN_RADIUS)
