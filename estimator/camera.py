"""The pinhole camera: pixels, rays and the planes that image lines span with the projection centre."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from estimator.so3 import Array, Vec3

Number: TypeAlias = Any
"""A float or an array: the closed forms below are written once and serve a single frame and a batch."""


class Intrinsics(NamedTuple):
    """Focal lengths and principal point, px."""

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Focal lengths, principal point and image size, all in pixels.

    Pixels are counted u to the right and v down from the centre of the top-left pixel, so the image reaches from
    -0.5 to ``width - 0.5`` and from -0.5 to ``height - 0.5``.

    Parameters
    ----------
    fx, fy : float
        Focal length over pixel pitch, px.
    cx, cy : float
        Principal point, px.
    width, height : int
        Image size, px.

    Raises
    ------
    ValueError
        If a value is not finite, or a focal length or a size is not positive.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def __post_init__(self) -> None:
        for name in ("fx", "fy", "width", "height"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"PinholeCamera: {name} must be finite and above zero, not {value!r}")
        for name in ("cx", "cy"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"PinholeCamera: {name} must be finite, not {getattr(self, name)!r}")

    @classmethod
    def from_lens(cls, focal_length: float, pixel: float, width: int, height: int) -> "PinholeCamera":
        """A camera with square pixels and its principal point in the middle of the image.

        Parameters
        ----------
        focal_length, pixel : float
            Of the lens, and pitch of the pixels, in the same unit.
        width, height : int
            px.

        Raises
        ------
        ValueError
            If the pixel pitch is not above zero, and as the class itself.
        """
        if not pixel > 0:
            raise ValueError(f"PinholeCamera: the pixel pitch must be above zero, not {pixel!r}")
        f = focal_length / pixel
        return cls(fx=f, fy=f, cx=0.5 * (width - 1), cy=0.5 * (height - 1), width=width, height=height)

    @property
    def intrinsics(self) -> Intrinsics:
        """Focal lengths and principal point."""
        return Intrinsics(self.fx, self.fy, self.cx, self.cy)

    def project(self, points_in_cam: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera frame; NaN for points that are not in front."""
        points = np.asarray(points_in_cam, dtype=float)
        depth = np.where(points[..., 2] > 0.0, points[..., 2], np.nan)
        return np.stack(
            (self.fx * points[..., 0] / depth + self.cx, self.fy * points[..., 1] / depth + self.cy), axis=-1
        )

    def plane_normal(self, a: Number, b: Number, c: Number) -> tuple[Number, Number, Number]:
        """Normal, camera frame, of the plane that the line a u + b v + c = 0 spans with the projection centre.

        The ray of a pixel is ((u - cx)/fx, (v - cy)/fy, 1); the normal is at right angles to the ray of every pixel
        of the line.  It is not normalised, and its sign is that of the line.
        """
        return a * self.fx, b * self.fy, a * self.cx + b * self.cy + c

    def line_of_plane(self, n: tuple[Number, Number, Number]) -> tuple[Number, Number, Number]:
        """The image line (a, b, c) of a plane through the projection centre: the inverse of `plane_normal`."""
        return line_of_plane(self.intrinsics, n)

    def clip(self, start_in_cam: Vec3, end_in_cam: Vec3, near: float) -> tuple[float, float, float, float] | None:
        """What is seen of a segment: u, v of both ends, or None where nothing is.

        The depth and the four sides of the image are half-spaces, linear in the point of the camera frame, so the
        segment is clipped in space (Liang-Barsky on five planes) and no point behind the camera is ever divided by
        its depth.

        Parameters
        ----------
        start_in_cam, end_in_cam : (3,) float
            Camera frame, m.
        near : float
            Smallest depth that is seen, m.
        """
        seen, u0, v0, u1, v1 = clip(self.intrinsics, self.width, self.height, start_in_cam, end_in_cam, near)
        return (u0, v0, u1, v1) if seen else None


def line_of_plane(camera: Intrinsics, n: tuple[Number, Number, Number]) -> tuple[Number, Number, Number]:
    """As `PinholeCamera.line_of_plane`."""
    a, b = n[0] / camera.fx, n[1] / camera.fy
    return a, b, n[2] - a * camera.cx - b * camera.cy


def clip(
    camera: Intrinsics, width: int, height: int, start_in_cam: Vec3, end_in_cam: Vec3, near: float
) -> tuple[bool, float, float, float, float]:
    """As `PinholeCamera.clip`: whether anything is seen, and u, v of both ends."""
    x0, y0, z0 = start_in_cam
    x1, y1, z1 = end_in_cam
    fx, fy, cx, cy = camera
    right, bottom = width - 0.5, height - 0.5
    if z0 >= near and z1 >= near:
        u0, v0 = fx * x0 / z0 + cx, fy * y0 / z0 + cy
        u1, v1 = fx * x1 / z1 + cx, fy * y1 / z1 + cy
        if -0.5 <= u0 <= right and -0.5 <= u1 <= right and -0.5 <= v0 <= bottom and -0.5 <= v1 <= bottom:
            return True, u0, v0, u1, v1
    enter, leave = 0.0, 1.0
    for g0, g1 in (
        (z0 - near, z1 - near),
        (fx * x0 + (cx + 0.5) * z0, fx * x1 + (cx + 0.5) * z1),
        ((right - cx) * z0 - fx * x0, (right - cx) * z1 - fx * x1),
        (fy * y0 + (cy + 0.5) * z0, fy * y1 + (cy + 0.5) * z1),
        ((bottom - cy) * z0 - fy * y0, (bottom - cy) * z1 - fy * y1),
    ):
        if g0 < 0.0:
            if g1 <= 0.0:
                return False, 0.0, 0.0, 0.0, 0.0
            enter = max(enter, g0 / (g0 - g1))
        elif g1 < 0.0:
            leave = min(leave, g0 / (g0 - g1))
    if enter >= leave:
        return False, 0.0, 0.0, 0.0, 0.0
    xa, ya, za = x0 + enter * (x1 - x0), y0 + enter * (y1 - y0), z0 + enter * (z1 - z0)
    xb, yb, zb = x0 + leave * (x1 - x0), y0 + leave * (y1 - y0), z0 + leave * (z1 - z0)
    return True, fx * xa / za + cx, fy * ya / za + cy, fx * xb / zb + cx, fy * yb / zb + cy
