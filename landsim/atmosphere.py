"""The air that an aircraft flies through: mean wind by height, a change of wind, a discrete gust, turbulence.

Mean wind in the boundary layer is that of MIL-F-8785C, 3.7.3.2, u(h) = u(h_ref) ln(h/z0) / ln(h_ref/z0), up to 1000 ft
and constant above.

Turbulence is Dryden's by MIL-F-8785C, 3.7.1.2 and 3.7.3.4, for low altitudes: with the height h above the ground in ft,
from 10 to 1000,

    σ_w = 0.1 W20,   σ_u = σ_v = σ_w / (0.177 + 0.000823 h)^0.4,
    L_w = h,         L_u = L_v = h / (0.177 + 0.000823 h)^1.2,

and, of the angular frequency ω at the airspeed V, with T = L/V, the one-sided spectra

    Φ_u = σ² (2 T/π) / (1 + (T ω)²),   Φ_v, Φ_w = σ² (T/π) (1 + 3 (T ω)²) / (1 + (T ω)²)².

White noise through 1/(1 + T s) and (1 + √3 T s)/(1 + T s)² has them.  Both are carried on exactly over a step, and
begin in their steady state.  u lies along the horizontal airspeed, v to the right of it, w down.  What differs from
wing tip to wing tip, rotational gusts, is left out: JSBSim takes none from outside.

The gust is that of CS-25.341, ½ U (1 - cos(2π s/L)), with s along the runway.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from estimator.compiled import compiled
from estimator.so3 import Array, Vec3
from landsim.config import AirConfig, GustConfig, TurbulenceConfig, WindConfig
from landsim.units import FT, STANDARD_GRAVITY

BLOCK = 256
"""Steps whose noise is drawn at once."""
TOP = 1000.0 * FT
"""Of the boundary layer, m."""
LEAST_HEIGHT_FT = 10.0
LEAST_AIRSPEED = 1.0
"""m/s; nearer to standstill the turbulence stands still."""
EARTH_RADIUS = 6_356_766.0
"""Of geopotential heights, m (ISO 2533)."""
STANDARD_AIR = AirConfig()
DRAWS, STATES = 5, 5
_HALF = math.sqrt(0.5)
_START = np.array((0.25 / _HALF, math.sqrt(0.25 - 0.125)))
"""Second row of the factor of the steady covariance [½ ¼; ¼ ¼] of the two states of v and w."""


def standard_density(height: float) -> float:
    """Density (kg/m³) of the standard atmosphere's lowest layer at a height above sea level (m).

    ISO 2533: 288.15 K and 101,325 Pa at sea level, 6.5 K colder a kilometre of geopotential height, R = 287.05287
    J/(kg K), g = 9.80665 m/s².
    """
    lapse, gas = 6.5e-3, 287.05287
    geopotential = EARTH_RADIUS * height / (EARTH_RADIUS + height)
    temperature = 288.15 - lapse * geopotential
    pressure: float = 101_325.0 * (temperature / 288.15) ** (STANDARD_GRAVITY / (gas * lapse))
    return pressure / (gas * temperature)


class Intensity(NamedTuple):
    """Of turbulence at a height."""

    sigma_horizontal: float
    sigma_vertical: float
    """m/s."""
    length_horizontal: float
    length_vertical: float
    """m."""


@compiled
def dryden(height: float, w20: float) -> Intensity:
    """Intensities and lengths at a height (m) above the ground, with a wind of w20 (m/s) at 20 ft."""
    h = min(max(height / FT, LEAST_HEIGHT_FT), 1000.0)
    base = 0.177 + 0.000823 * h
    vertical = 0.1 * w20
    return Intensity(vertical / base**0.4, vertical, h / base**1.2 * FT, h * FT)


@compiled
def _mean(setup: Array, height: float) -> tuple[float, float]:
    """Mean wind along x and y, m/s.

    `setup` is head and cross wind at the reference, whether there is a profile, reference height and roughness, change
    of head and cross wind, and the heights at which it begins and ends.
    """
    factor = 1.0
    if setup[2] != 0.0:
        h = min(max(height, setup[4]), TOP)
        factor = math.log(h / setup[4]) / math.log(setup[3] / setup[4])
    share = 0.0
    if setup[8] > setup[7]:
        share = min(max((height - setup[7]) / (setup[8] - setup[7]), 0.0), 1.0)
    return -(factor * setup[0] + share * setup[5]), factor * setup[1] + share * setup[6]


@compiled
def _turbulence(state: Array, noise: Array, airspeed: float, height: float, w20: float, dt: float) -> Vec3:
    """Carry the five states on by a step, and give u, v and w (m/s)."""
    of = dryden(height, w20)
    speed = max(airspeed, LEAST_AIRSPEED)
    decay = math.exp(-dt * speed / of.length_horizontal)
    state[0] = decay * state[0] + math.sqrt(1.0 - decay * decay) * noise[0]
    u = of.sigma_horizontal * state[0]
    v = of.sigma_horizontal * _second(state, 1, noise, dt * speed / of.length_horizontal)
    w = of.sigma_vertical * _second(state, 3, noise, dt * speed / of.length_vertical)
    return u, v, w


@compiled
def _second(state: Array, at: int, noise: Array, r: float) -> float:
    """The output of (1 + √3 T s)/(1 + T s)², of variance one, after a step of r time constants."""
    e = math.exp(-r)
    square = e * e
    q11 = 0.5 * (1.0 - square)
    q12 = 0.25 * (1.0 - square * (1.0 + 2.0 * r))
    q22 = 0.25 * (1.0 - square * (1.0 + 2.0 * r + 2.0 * r * r))
    a = math.sqrt(q11)
    b = q12 / a
    c = math.sqrt(max(q22 - b * b, 0.0))
    first, second = state[at], state[at + 1]
    state[at] = e * first + a * noise[at]
    state[at + 1] = e * (second + r * first) + b * noise[at] + c * noise[at + 1]
    root = math.sqrt(3.0)
    result: float = root * state[at] + (1.0 - root) * state[at + 1]
    return result


@compiled
def _gust(setup: Array, along: float) -> Vec3:
    """Of head, cross and upward speed, place and length: the gust's wind (m/s) at a place along the runway (m)."""
    s = along - setup[3]
    if not 0.0 < s < setup[4]:
        return 0.0, 0.0, 0.0
    share = 0.5 * (1.0 - math.cos(2.0 * math.pi * s / setup[4]))
    return -share * setup[0], share * setup[1], -share * setup[2]


@compiled
def _wind(
    motion: Array, airspeed: float, mean: Array, gust: Array, w20: float, state: Array, noise: Array, dt: float
) -> Vec3:
    """The wind (m/s, runway frame) at the aircraft."""
    height = -motion[2]
    x, y = _mean(mean, height)
    gx, gy, gz = _gust(gust, motion[0])
    if w20 == 0.0:
        return x + gx, y + gy, gz
    ahead, right = motion[3] - x, motion[4] - y
    speed = math.hypot(ahead, right)
    c, s = (ahead / speed, right / speed) if speed > 0.0 else (1.0, 0.0)
    u, v, w = _turbulence(state, noise, airspeed, height, w20, dt)
    return x + gx + c * u - s * v, y + gy + s * u + c * v, gz + w


def _numbers_of_wind(config: WindConfig) -> Array:
    return np.array(
        (
            config.head_mps,
            config.cross_mps,
            float(config.profile == "logarithmic"),
            config.reference_height_m,
            config.roughness_m,
            config.shear_head_mps,
            config.shear_cross_mps,
            config.shear_low_m,
            config.shear_high_m,
        )
    )


def mean_wind(config: WindConfig, height: float) -> Vec3:
    """Velocity of the air without gust and turbulence (m/s, runway frame) at a height above the runway (m).

    A head wind comes against x, a cross wind blows along y.
    """
    x, y = _mean(_numbers_of_wind(config), height)
    return x, y, 0.0


def is_steady(wind: WindConfig, gust: GustConfig, turbulence: TurbulenceConfig) -> bool:
    """Whether the wind is the same everywhere and at all times."""
    calm = wind.head_mps == wind.cross_mps == 0.0
    changing = (
        (wind.profile != "uniform" and not calm)
        or wind.shear_head_mps != 0.0
        or wind.shear_cross_mps != 0.0
        or any(speed != 0.0 for speed in (gust.head_mps, gust.cross_mps, gust.up_mps))
        or turbulence.w20_mps != 0.0
    )
    return not changing


class Atmosphere:
    """The wind along one flight.

    Parameters
    ----------
    wind : WindConfig
    gust : GustConfig
    turbulence : TurbulenceConfig
    dt : float
        Between calls, s.
    rng : Generator
    """

    def __init__(
        self, wind: WindConfig, gust: GustConfig, turbulence: TurbulenceConfig, dt: float, rng: Generator
    ) -> None:
        self._mean = _numbers_of_wind(wind)
        self._gust = np.array((gust.head_mps, gust.cross_mps, gust.up_mps, gust.at_m, gust.length_m))
        self._w20 = turbulence.w20_mps
        self._dt = dt
        self._rng = rng
        self._state = rng.standard_normal(STATES)
        for first in (1, 3):
            self._state[first : first + 2] = (
                _HALF * self._state[first],
                float(_START @ self._state[first : first + 2]),
            )
        self._noise = rng.standard_normal((BLOCK, DRAWS))
        self._count = 0

    def at(self, motion: Array, airspeed: float) -> Vec3:
        """The wind of the next step (m/s, runway frame).

        Parameters
        ----------
        motion : (15 or more,) array
            Position, velocity and attitude of the aircraft, as `landsim.truth.Truth.motion`.
        airspeed : float
            m/s.
        """
        if self._count == BLOCK:
            self._rng.standard_normal(out=self._noise)
            self._count = 0
        noise = self._noise[self._count]
        self._count += 1
        return _wind(motion, airspeed, self._mean, self._gust, self._w20, self._state, noise, self._dt)
