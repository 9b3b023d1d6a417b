"""From a place and Euler angles to the attitude in the runway frame, at once."""

import math

from estimator.so3 import Mat3


def runway_attitude(
    latitude0: float,
    longitude0: float,
    heading: float,
    latitude: float,
    longitude: float,
    phi: float,
    theta: float,
    psi: float,
) -> tuple[float, Mat3]:
    """The attitude of an aircraft in the frame of a runway.

    Parameters
    ----------
    latitude0, longitude0, heading : float
        Of the runway; geodetic, true heading of the landing direction, rad.
    latitude, longitude : float
        Of the aircraft, geodetic, rad.
    phi, theta, psi : float
        Of the aircraft, relative to north, east and down where it is, rad.

    Returns
    -------
    float, Mat3
        The cosine of the angle between the two verticals, and R_runway_from_body.

    Notes
    -----
    The same as ``Runway.R_runway_from_ned_at`` times ``so3.from_euler``, multiplied out, for every step.  With Δ the
    difference in longitude, s and c sine and cosine of the latitude (0: the runway's), north, east and down at the
    aircraft have these components along the runway's north, east and down::

        north  s0 s cos Δ + c0 c    -s sin Δ    c0 s cos Δ - s0 c
        east   s0 sin Δ              cos Δ      c0 sin Δ
        down   s0 c cos Δ - c0 s    -c sin Δ    c0 c cos Δ + s0 s

    Turned by the heading these are the columns of R_runway_from_ned; yaw, pitch and roll then mix two columns each.
    """
    s0, c0 = math.sin(latitude0), math.cos(latitude0)
    sh, ch = math.sin(heading), math.cos(heading)
    s, c = math.sin(latitude), math.cos(latitude)
    sd, cd = math.sin(longitude - longitude0), math.cos(longitude - longitude0)
    sr, cr = math.sin(phi), math.cos(phi)
    sp, cp = math.sin(theta), math.cos(theta)
    sy, cy = math.sin(psi), math.cos(psi)
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
