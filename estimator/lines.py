"""Image lines from edge points: total least squares, with the line's covariance.

A line is (a, b, c) with a u + b v + c = 0 and a² + b² = 1.  What noise does to it is told best in its own axes: the
offset across the line at the points' centroid and the angle, which are independent to first order, with variances σ²/N
and σ²/S, S the sum of squared distances of the N points from their centroid along the line (Golub and Van Loan, Matrix
Computations, 4th ed., section 6.3, for total least squares).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.camera import Number
from estimator.so3 import Array


@dataclass(frozen=True, slots=True)
class LineFit:
    """Lines fitted to points.

    Attributes
    ----------
    line : (..., 3) array
        a, b, c of a u + b v + c = 0, px, a² + b² = 1.
    centroid : (..., 2) array
        Of the points, px.
    spread : (...) array
        Sum of squared distances from the centroid along the line, px².
    points : int
        Number of points of each line.
    """

    line: Array
    centroid: Array
    spread: Array
    points: int

    def covariance(self, sigma: float) -> Array:
        """First-order covariance (..., 3, 3) of (a, b, c), for points with noise of `sigma` px on either axis."""
        a, b = self.line[..., 0], self.line[..., 1]
        u, v = self.centroid[..., 0], self.centroid[..., 1]
        # a turn by φ moves (a, b) to (a, b) + φ (-b, a) and keeps the line through its centroid
        turn = np.stack((-b, a, b * u - a * v), axis=-1)
        offset_variance, angle_variance = fit_variances(self.spread, self.points, sigma)
        with np.errstate(invalid="ignore"):  # a line of one point: infinity times the zeros of its turn
            covariance = np.asarray(angle_variance)[..., None, None] * turn[..., :, None] * turn[..., None, :]
        covariance[..., 2, 2] += offset_variance
        return covariance


def fit_variances(spread: Number, points: Number, sigma: float) -> tuple[Number, Number]:
    """Variances of a fitted line's offset at its centroid (px²) and of its angle (rad², infinite for a single point).

    The spread as measured holds the noise along the line too, (N - 1) σ² of it, which is no lever arm: it is taken off,
    down to a tenth of the measured value where the points are all noise.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        offset, angle = unguarded_variances(spread, points, sigma)
    return offset, np.where(np.asarray(spread) > 0.0, angle, np.inf)


def unguarded_variances(spread: Number, points: Number, sigma: float) -> tuple[Number, Number]:
    """The variances of `fit_variances`, without its care for a spread of zero."""
    noise = sigma * sigma
    return noise / points, noise / np.maximum(spread - (points - 1.0) * noise, 0.1 * spread)


def line_from_moments(
    u: Number, v: Number, suu: Number, suv: Number, svv: Number
) -> tuple[Number, Number, Number, Number]:
    """Line and spread (a, b, c, S) from the points' mean and centred second moments.

    The principal axis of the 2 × 2 scatter matrix in closed form.

    Parameters
    ----------
    u, v : float or (...) array
        Mean of the points, px.
    suu, suv, svv : float or (...) array
        Sums of products about the mean, px².
    """
    angle = 0.5 * np.arctan2(2.0 * suv, suu - svv)
    along_u, along_v = np.cos(angle), np.sin(angle)
    spread = along_u * along_u * suu + 2.0 * along_u * along_v * suv + along_v * along_v * svv
    a, b = -along_v, along_u
    return a, b, -(a * u + b * v), spread


def fit_line(points: ArrayLike) -> LineFit:
    """Total least squares through points.

    Parameters
    ----------
    points : (..., N, 2) array_like
        Pixels; N of at least two.

    Raises
    ------
    ValueError
        If the shape is not (..., N, 2) or N is below two.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim < 2 or points.shape[-1] != 2 or points.shape[-2] < 2:
        raise ValueError(f"fit_line: points must have the shape (..., N, 2) with N of at least 2, not {points.shape}")
    centroid = points.mean(axis=-2)
    centred = points - centroid[..., None, :]
    scatter = np.swapaxes(centred, -1, -2) @ centred
    a, b, c, spread = line_from_moments(
        centroid[..., 0], centroid[..., 1], scatter[..., 0, 0], scatter[..., 0, 1], scatter[..., 1, 1]
    )
    return LineFit(np.stack((a, b, c), axis=-1), centroid, np.asarray(spread), points.shape[-2])
