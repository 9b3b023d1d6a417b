"""Errors by range: percentiles of what was sampled, the first-order sigma beside them, and a single realisation."""

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import ArrayLike

from estimator.camera import PinholeCamera
from estimator.covariance import LEFT, RIGHT, THRESHOLD, LineNoise, three_line_covariance, two_line_covariance
from estimator.so3 import Array
from landsim.config import Scenario
from landsim.sensors import camera_of, number_of_points
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.frames import LINES_OF_STAGE, Frames
from landsim.study.model import LEVELS, OF_STAGE, Envelope, Reading


def percentiles(errors: ArrayLike, levels: Sequence[float] = LEVELS) -> Array:
    """Percentiles (..., k, levels) of the absolute value of errors (..., draws, k): order statistics, without mixing.

    The percentile of a level is the smallest error that so many percent do not exceed.  NaN, where there was no
    solution, counts as infinitely large; without any draw the percentiles are NaN.
    """
    size = np.abs(np.asarray(errors, float))
    size[np.isnan(size)] = math.inf
    number = size.shape[-2]
    if number == 0:
        return np.full((*size.shape[:-2], size.shape[-1], len(levels)), math.nan)
    # 95 % of 1000 is the 950th, whatever the rounding of the product
    ranks = [max(math.ceil(level * number / 100.0 - 1e-9), 1) - 1 for level in levels]
    ordered = np.partition(size, sorted(set(ranks)), axis=-2)
    return np.moveaxis(ordered[..., ranks, :], -2, -1)


def line_noise(ends: ArrayLike, reading: Reading, spacing_px: float, noise_px: float) -> LineNoise:
    """How well points fix each of many lines: σ²/N across at the middle and σ²/S in angle, of points without noise.

    Parameters
    ----------
    ends : (..., 4) array_like
        u0, v0, u1, v1 of what is seen, px; NaN where it is not, and then so is the result.
    reading : {"endpoints", "edge-points"}
    spacing_px, noise_px : float

    Notes
    -----
    N points evenly spread over a length L have S = L² N (N + 1) / (12 (N - 1)) about their middle.
    """
    u0, v0, u1, v1 = np.moveaxis(np.asarray(ends, float), -1, 0)
    length = np.hypot(u1 - u0, v1 - v0)
    count = np.full(length.shape, np.nan)
    for i, one in np.ndenumerate(length):
        if math.isfinite(one):
            count[i] = number_of_points(float(one), reading, spacing_px)
    spread = length**2 * count * (count + 1.0) / (12.0 * (count - 1.0))
    variance = noise_px * noise_px
    return LineNoise(0.5 * (u0 + u1), 0.5 * (v0 + v1), variance / count, variance / spread)


def first_order(
    camera: PinholeCamera, frames: Frames, reading: Reading, spacing_px: float, noise_px: float, width: float
) -> Array:
    """Standard deviations (n, k) of the pose to first order in the noise, at the true pose: the Cramér-Rao bound.

    Total least squares attains the bound of the line to first order, and as many line parameters as unknowns leave the
    pose nothing to weigh.

    Parameters
    ----------
    camera : PinholeCamera
    frames : Frames
    reading : {"endpoints", "edge-points"}
    spacing_px, noise_px : float
    width : float
        Of the runway, m.

    Returns
    -------
    (n, k) array
        Of the quantities ``OF_STAGE[frames.stage]``, rad and m, the roll angle given to the late stage being the true
        one; NaN where a line is not seen.
    """
    noise = [line_noise(frames.ends[:, line], reading, spacing_px, noise_px) for line in (LEFT, THRESHOLD, RIGHT)]
    return pose_sigma(camera, frames, noise, width)


def pose_sigma(camera: PinholeCamera, frames: Frames, noise: Sequence[LineNoise], width: float) -> Array:
    """`first_order`, from how well each line is known: the noise of left edge, threshold and right edge, (n) each."""
    rotation = frames.R_cam_from_runway
    if frames.stage == "late":
        late = two_line_covariance(
            camera,
            noise[LEFT],
            noise[RIGHT],
            lateral=frames.position[:, 1],
            height=frames.height,
            R_cam_from_runway=rotation,
            runway_width=width,
        )
        variances = np.diagonal(late, axis1=-2, axis2=-1)
        return np.sqrt(variances[:, (1, 0, 2, 3)])  # pitch, yaw, cross, altitude
    early = three_line_covariance(
        camera,
        noise[LEFT],
        noise[THRESHOLD],
        noise[RIGHT],
        position=frames.position,
        R_cam_from_runway=rotation,
        runway_width=width,
    )
    # ψ = roll' forward + pitch' (right before roll) + yaw' down: the axes about which the angles turn
    forward = rotation[:, 2]
    zero, one = np.zeros(len(forward)), np.ones(len(forward))
    level = np.hypot(forward[:, 0], forward[:, 1])
    right = np.stack((-forward[:, 1] / level, forward[:, 0] / level, zero), axis=-1)
    angles_from_turn = np.linalg.inv(np.stack((forward, right, np.stack((zero, zero, one), axis=-1)), axis=-1))
    turn = angles_from_turn @ early[:, 3:, 3:] @ np.swapaxes(angles_from_turn, -1, -2)
    x, y, z = (early[:, i, i] for i in range(3))
    roll, pitch, yaw = (turn[:, i, i] for i in range(3))
    return np.sqrt(np.stack((roll, pitch, yaw, y, z, x), axis=-1))


def child(seed: SeedSequence, *key: int) -> SeedSequence:
    """The seed of a part, by its number: what ``spawn`` would give, without counting on the parent.

    Unlike ``spawn`` it leaves the parent as it is, so that a part has the same seed whoever asks, and in any order.
    """
    return SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *key), pool_size=seed.pool_size)


def sampled(
    scenario: Scenario,
    frames: Frames,
    reading: Reading,
    draws: int,
    seed: SeedSequence,
    roll_error: float = 0.0,
    noise_px: float | None = None,
    spacing_px: float | None = None,
    indices: Sequence[int] | None = None,
) -> Envelope:
    """Errors of the vision pose at each frame, by drawing the noise many times.

    Each frame draws from a seed of its own, ``child(seed, i)``: the result of some of the frames is a part of the
    result of all.

    Parameters
    ----------
    scenario : Scenario
    frames : Frames
    reading : {"endpoints", "edge-points"}
    draws : int
        A frame.
    seed : SeedSequence
        It is not changed.
    roll_error : float
        By which the roll angle given to the late stage is off, rad.
    noise_px, spacing_px : float, optional
        Without them, the camera's of the scenario.
    indices : sequence of int, optional
        Of the frames to sample; without it, all.

    Returns
    -------
    Envelope
        Of the source "vision", a row a frame; NaN and a count of 0 where not all lines of the stage are seen.
    """
    return sampled_rolls(scenario, frames, reading, draws, seed, (roll_error,), noise_px, spacing_px, indices)[0]


def sampled_rolls(
    scenario: Scenario,
    frames: Frames,
    reading: Reading,
    draws: int,
    seed: SeedSequence,
    roll_errors: Sequence[float],
    noise_px: float | None = None,
    spacing_px: float | None = None,
    indices: Sequence[int] | None = None,
) -> tuple[Envelope, ...]:
    """An envelope for each of several roll errors, from the same noisy lines: `sampled` of each, at the price of one.

    Parameters
    ----------
    roll_errors : sequence of float
        rad.  The early stage takes no roll angle, and its roll errors must be zero.
    scenario, frames, reading, draws, seed, noise_px, spacing_px, indices
        As in `sampled`.

    Raises
    ------
    ValueError
        If a roll error is not zero with early frames.
    """
    if frames.stage == "early" and any(roll_errors):
        raise ValueError("the early stage takes no roll angle: its roll error must be zero")
    settings, width = scenario.camera, scenario.runway.width_m
    noise = settings.noise_px if noise_px is None else noise_px
    spacing = settings.point_spacing_px if spacing_px is None else spacing_px
    camera, which = camera_of(settings), LINES_OF_STAGE[frames.stage]
    chosen = np.arange(len(frames)) if indices is None else np.asarray(indices, int)
    rolls, n, k = len(roll_errors), chosen.size, len(OF_STAGE[frames.stage])
    spread = np.full((rolls, n, k, len(LEVELS)), math.nan)
    single = np.full((rolls, n, k), math.nan)
    seen = frames.seen()
    for row, i in enumerate(chosen.tolist()):
        if seen[i]:
            fits = draw_lines(frames.ends[i], which, reading, spacing, noise, draws, default_rng(child(seed, i)))
            for j, roll_error in enumerate(roll_errors):
                errors = pose_errors(camera, frames, i, fits, width, roll_error)
                spread[j, row], single[j, row] = percentiles(errors), errors[0]
    there = frames[chosen]
    sigma = first_order(camera, there, reading, spacing, noise, width)
    return tuple(
        Envelope(
            stage=frames.stage,
            reading=reading,
            source="vision",
            roll_error=roll_error,
            quantities=OF_STAGE[frames.stage],
            distance=there.distance,
            time=there.time,
            height=there.height,
            count=np.where(seen[chosen], draws, 0),
            percentiles=spread[j],
            sigma=sigma,
            single=single[j],
        )
        for j, roll_error in enumerate(roll_errors)
    )


def joined(parts: Sequence[Envelope]) -> Envelope:
    """One envelope of parts of the same approach, in the order of time.

    Raises
    ------
    ValueError
        If there are none, or if they are not of one stage, reading, source and roll error.
    """
    if len({(p.stage, p.reading, p.source, p.roll_error, p.quantities) for p in parts}) != 1:
        raise ValueError("only envelopes of one stage, reading, source and roll error can be joined")
    arrays = [f.name for f in fields(Envelope) if isinstance(getattr(parts[0], f.name), np.ndarray)]
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in arrays}
    order = np.argsort(whole["time"], kind="stable")
    return replace(parts[0], **{name: values[order] for name, values in whole.items()})
