"""Noisy points, through the line fit, to poses and their errors.

The noise is drawn on the points that a line is fitted to, and never from the fit's own covariance.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.random import Generator

from estimator.camera import PinholeCamera
from estimator.lines import LineFit, fit_line
from estimator.so3 import Array
from estimator.three_line import angles, three_line_pose
from estimator.two_line import two_line_pose
from landsim.sensors import number_of_points
from landsim.study.frames import Frames
from landsim.study.model import OF_STAGE, Reading

BLOCK = 65_536
"""Numbers that are drawn and fitted at once: half a megabyte stays in a processor's cache.  It decides no result."""


def points_on(ends: Array, reading: Reading, spacing_px: float) -> Array:
    """The points (2, N) of a line before there is noise, u and v, evenly spread from end to end.

    Parameters
    ----------
    ends : (4,) array
        u0, v0, u1, v1 of what is seen, px.
    reading : {"endpoints", "edge-points"}
    spacing_px : float

    Raises
    ------
    ValueError
        If the line is not seen.
    """
    u0, v0, u1, v1 = np.asarray(ends, float).tolist()
    length = math.hypot(u1 - u0, v1 - v0)
    if not math.isfinite(length):
        raise ValueError("a line that is not seen has no points")
    number = number_of_points(length, reading, spacing_px)
    return np.stack((np.linspace(u0, u1, number), np.linspace(v0, v1, number)))


def _noisy(clean: Array, noise_px: float, rng: Generator, buffer: Array) -> Array:
    """Points (draws, 2, N) in the buffer, filled with noise about (2, N)."""
    rng.standard_normal(out=buffer)
    buffer *= noise_px
    buffer += clean
    return buffer


def draw_points(ends: Array, reading: Reading, spacing_px: float, noise_px: float, draws: int, rng: Generator) -> Array:
    """Noisy points of one line.

    Parameters
    ----------
    ends : (4,) array
        u0, v0, u1, v1 of what is seen, px.
    reading : {"endpoints", "edge-points"}
        Its two ends, or points evenly spread between them.
    spacing_px : float
        Between the points, with ``edge-points``.
    noise_px : float
        1 σ in u and in v.
    draws : int
    rng : Generator

    Returns
    -------
    (draws, N, 2) array
        px.

    Raises
    ------
    ValueError
        If the line is not seen.
    """
    clean = points_on(ends, reading, spacing_px)
    points = _noisy(clean, noise_px, rng, np.empty((draws, *clean.shape)))
    return np.swapaxes(points, -1, -2)


def draw_line(ends: Array, reading: Reading, spacing_px: float, noise_px: float, draws: int, rng: Generator) -> LineFit:
    """Lines fitted to the points of `draw_points`: the same numbers, drawn and fitted a block at a time."""
    clean = points_on(ends, reading, spacing_px)
    number = clean.shape[1]
    block = max(1, min(draws, BLOCK // (2 * number)))
    buffer = np.empty((block, 2, number))
    line, centroid, spread = np.empty((draws, 3)), np.empty((draws, 2)), np.empty(draws)
    for first in range(0, draws, block):
        part = slice(first, min(first + block, draws))
        points = _noisy(clean, noise_px, rng, buffer[: part.stop - first])
        fit = fit_line(np.swapaxes(points, -1, -2))
        line[part], centroid[part], spread[part] = fit.line, fit.centroid, fit.spread
    return LineFit(line, centroid, spread, number)


def draw_lines(
    ends: Array,
    which: Iterable[int],
    reading: Reading,
    spacing_px: float,
    noise_px: float,
    draws: int,
    rng: Generator,
) -> tuple[LineFit, ...]:
    """Lines of one frame, fitted to noisy points.

    Parameters
    ----------
    ends : (3, 4) array
        Of a row of `Frames.ends`, px.
    which : iterable of int
        Of `estimator.covariance.LEFT`, `THRESHOLD`, `RIGHT`; the fits come in this order.
    reading, spacing_px, noise_px, draws, rng
        As in `draw_points`.

    Raises
    ------
    ValueError
        If one of the lines is not seen.
    """
    return tuple(draw_line(ends[i], reading, spacing_px, noise_px, draws, rng) for i in which)


def pose_errors(
    camera: PinholeCamera,
    frames: Frames,
    i: int,
    fits: Sequence[LineFit],
    width: float,
    roll_error: float = 0.0,
) -> Array:
    """Errors of the pose that the lines give, estimate less truth.

    Parameters
    ----------
    camera : PinholeCamera
    frames : Frames
    i : int
        The frame.
    fits : sequence of LineFit
        Left edge, threshold and right edge for an early frame, left and right edge for a late one.
    width : float
        Of the runway, m.
    roll_error : float
        By which the roll angle given to the late stage is off, rad.

    Returns
    -------
    (draws, k) array
        Of the quantities ``OF_STAGE[frames.stage]``, rad (within ±π) and m; NaN where there is no solution.
    """
    x, y, z = frames.position[i].tolist()
    rotation = frames.R_cam_from_runway[i]
    yaw, pitch, roll = angles(math, *(tuple(column) for column in rotation.T.tolist()))
    truth = {"roll": roll, "pitch": pitch, "yaw": yaw, "cross": y, "altitude": -z, "along": x}
    estimate: dict[str, Array]
    if frames.stage == "early":
        left, threshold, right = (fit.line for fit in fits)
        pose = three_line_pose(camera, left, threshold, right, runway_width=width)
        estimate = {
            "roll": pose.roll,
            "pitch": pose.pitch,
            "yaw": pose.yaw,
            "cross": pose.position[..., 1],
            "altitude": -pose.position[..., 2],
            "along": pose.position[..., 0],
        }
    else:
        left, right = (fit.line for fit in fits)
        late = two_line_pose(camera, left, right, runway_width=width, roll=roll + roll_error)
        estimate = {"pitch": late.pitch, "yaw": late.yaw, "cross": late.lateral, "altitude": late.height}
    errors = np.stack([estimate[name] - truth[name] for name in OF_STAGE[frames.stage]], axis=-1)
    turns = [name in ("roll", "pitch", "yaw") for name in OF_STAGE[frames.stage]]
    errors[..., turns] = (errors[..., turns] + math.pi) % (2.0 * math.pi) - math.pi
    return errors
