"""From a place and Euler angles to the attitude in the runway frame, at once."""

import math
from collections.abc import Callable

from estimator.so3 import Mat3

Rotation = Callable[[float, float, float, float, float], tuple[float, Mat3]]


def rotation_at(latitude0: float, longitude0: float, heading: float) -> Rotation:
    """A function that gives the attitude in the frame of the runway at latitude0, longitude0, heading (rad).

    Returns
    -------
    Rotation
        Takes an aircraft's geodetic latitude and longitude, and its phi, theta, psi relative to north, east and down
        there (rad).  Gives the cosine of the angle between the two verticals, and R_runway_from_body.

    Notes
    -----
    The same as ``Runway.R_runway_from_ned_at`` times ``so3.from_euler``, multiplied out: three times as fast, for every
    step.  With Δ the difference in longitude, s and c sine and cosine of the latitude (0: the runway's), north, east
    and down at the aircraft have these components along the runway's north, east and down::

        north  s0 s cos Δ + c0 c    -s sin Δ    c0 s cos Δ - s0 c
        east   s0 sin Δ              cos Δ      c0 sin Δ
        down   s0 c cos Δ - c0 s    -c sin Δ    c0 c cos Δ + s0 s

    Turned by the heading these are the columns of R_runway_from_ned; yaw, pitch and roll then mix two columns each.
    """
    sin, cos = math.sin, math.cos
    s0, c0 = sin(latitude0), cos(latitude0)
    sh, ch = sin(heading), cos(heading)

    def rotation(latitude: float, longitude: float, phi: float, theta: float, psi: float) -> tuple[float, Mat3]:
        s, c = sin(latitude), cos(latitude)
        sd, cd = sin(longitude - longitude0), cos(longitude - longitude0)
        sr, cr = sin(phi), cos(phi)
        sp, cp = sin(theta), cos(theta)
        sy, cy = sin(psi), cos(psi)
        scd, ccd = s * cd, c * cd
        # rows n, e, d: along the runway's north, east, down; columns n, e, d: north, east, down at the aircraft
        nn, ne, nd = s0 * scd + c0 * c, s0 * sd, s0 * ccd - c0 * s
        en, ed = -s * sd, -c * sd
        dn, de, dd = c0 * scd - s0 * c, c0 * sd, c0 * ccd + s0 * s
        # columns f, r: level, forward and right
        nf, nr = cy * nn + sy * ne, cy * ne - sy * nn
        ef, er = cy * en + sy * cd, cy * cd - sy * en
        zf, zr = cy * dn + sy * de, cy * de - sy * dn
        # rows x, y, z: along the runway's axes; column b: down after pitch
        xf, xr, xd = ch * nf + sh * ef, ch * nr + sh * er, ch * nd + sh * ed
        yf, yr, yd = ch * ef - sh * nf, ch * er - sh * nr, ch * ed - sh * nd
        xb, yb, zb = sp * xf + cp * xd, sp * yf + cp * yd, sp * zf + cp * dd
        return dd, (
            cp * xf - sp * xd, cr * xr + sr * xb, cr * xb - sr * xr,
            cp * yf - sp * yd, cr * yr + sr * yb, cr * yb - sr * yr,
            cp * zf - sp * dd, cr * zr + sr * zb, cr * zb - sr * zr,
        )  # fmt: skip

    return rotation
