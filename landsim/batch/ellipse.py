"""Ellipses that hold the next touchdown with a stated probability."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from estimator.so3 import Array

FLAT = 1e-9
"""Of a second axis this much shorter than the first there is no ellipse left."""
CORNERS = 120
"""Of an ellipse as a polygon."""


class Ellipse(NamedTuple):
    """In the plane of the runway; m and rad."""

    center: tuple[float, float]
    """Along, cross."""
    semi_major: float
    semi_minor: float
    angle: float
    """Of the major axis from the runway's x axis, towards y; in (-π/2, π/2]."""

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Which of the points (n, 2) are inside or on it, (n,) bool."""
        u = self._turned(points - np.array(self.center), -self.angle) / np.array((self.semi_major, self.semi_minor))
        return np.asarray(np.sum(u * u, axis=1) <= 1.0, dtype=bool)

    def polygon(self) -> Array:
        """Its corners (`CORNERS` + 1, 2), closed."""
        t = np.linspace(0.0, 2.0 * math.pi, CORNERS + 1)
        t[-1] = 0.0
        circle = np.stack((self.semi_major * np.cos(t), self.semi_minor * np.sin(t)), axis=1)
        return np.asarray(self._turned(circle, self.angle) + np.array(self.center))

    @staticmethod
    def _turned(points: Array, angle: float) -> Array:
        c, s = math.cos(angle), math.sin(angle)
        turned: Array = points @ np.array(((c, s), (-s, c)))
        return turned


def prediction_ellipse(points: Array, level: float) -> Ellipse | None:
    """The region that holds the next of a normally distributed series with a probability.

    The ellipse (x - m)ᵀ S⁻¹ (x - m) <= 2 (n - 1)(n + 1)/(n (n - 2)) F(level; 2, n - 2), with the sample's mean m and
    covariance S: Hotelling's region for one more observation (R. Johnson and D. Wichern, Applied Multivariate
    Statistical Analysis, 5.4-5.5).  Of few flights it is larger than the χ² ellipse that takes m and S for the truth,
    and of many the same.

    Parameters
    ----------
    points : (n, 2) array
    level : float
        Between 0 and 1.

    Returns
    -------
    Ellipse or None
        None of fewer than three points, and of points on a line.
    """
    n = len(points)
    if n < 3:
        return None
    size, axes = np.linalg.eigh(np.cov(points.T))
    if not size[1] > 0.0 or size[0] <= FLAT**2 * size[1]:
        return None
    scale = 2.0 * (n - 1) * (n + 1) / (n * (n - 2)) * float(stats.f.ppf(level, 2, n - 2))
    minor, major = np.sqrt(scale * size).tolist()
    angle = math.atan2(axes[1, 1], axes[0, 1])
    angle -= math.pi * math.ceil(angle / math.pi - 0.5)
    x, y = points.mean(axis=0).tolist()
    return Ellipse((x, y), major, minor, angle)
