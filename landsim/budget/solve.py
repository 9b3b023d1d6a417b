"""What a line must be worth for a bound to hold, to first order, and what drawing the noise makes of it.

To first order an error is normal with a standard deviation in proportion to that of the points, σ_error = g σ_px, about
a shift b that a wrong roll angle makes late.  A bound B holds in a share p of the frames if

    Φ((B - b) / σ_error) - Φ((-B - b) / σ_error) = p,

which without a shift is σ_error = B / z, z = Φ⁻¹((1 + p) / 2).  More points of the same noise make g smaller, by
about the root of their number.
"""

import math
from collections.abc import Callable, Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng

from estimator.covariance import LEFT, RIGHT, LineNoise, two_line_covariance
from estimator.so3 import Array
from landsim.budget.requirements import Requirement
from landsim.budget.setting import Setting, frames_at
from landsim.errors import InputError
from landsim.sensors import number_of_points
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.envelope import child, first_order
from landsim.study.frames import LINES_OF_STAGE, Frames
from landsim.study.model import OF_STAGE, READINGS, Reading, StageName

NORMAL = NormalDist()
FINEST_PX = 1e-9
"""No spacing of points is looked for below this."""


class Need(NamedTuple):
    """What one requirement needs of one noise reading.

    Attributes
    ----------
    gain : float
        Standard deviation of the error per px of the points', m/px or rad/px.
    shift : float
        Size of the error that the roll error makes, m or rad.
    now : float
        What the error stays within with the scenario's noise, at the confidence, m or rad.
    noise_px : float or None
        The greatest σ of the points with which the bound holds; None if the roll error alone breaks it.
    points_now : tuple of int
        Points on each line of the stage, left edge first.
    spacing_px, points : float, tuple of int, or None
        For ``edge-points``: the widest spacing, at the scenario's noise, with which the bound holds, and how many
        points a line those are.  Both None for ``endpoints``, and where no number will do.
    """

    gain: float
    shift: float
    now: float
    noise_px: float | None
    points_now: tuple[int, ...]
    spacing_px: float | None
    points: tuple[int, ...] | None


class Confirmed(NamedTuple):
    """What became of a requirement when its need was drawn."""

    inside: float
    """Share of the draws within the bound."""
    draws: int


def inside(sigma: float, shift: float, bound: float) -> float:
    """Probability that a normal error of this σ about this shift is within ± bound."""
    if sigma <= 0.0:
        return 1.0 if abs(shift) <= bound else 0.0
    return NORMAL.cdf((bound - shift) / sigma) - NORMAL.cdf((-bound - shift) / sigma)


def sigma_within(bound: float, shift: float, confidence: float) -> float | None:
    """The greatest σ with which so large a share stays within ± bound; None if the shift alone is beyond it."""
    shift = abs(shift)
    if shift == 0.0:
        return bound / NORMAL.inv_cdf(0.5 + 0.5 * confidence)
    if shift >= bound:
        return None
    # the share falls with σ, and no shift leaves it larger than none does
    return bisected(
        lambda s: inside(s, shift, bound) >= confidence, 0.0, bound / NORMAL.inv_cdf(0.5 + 0.5 * confidence)
    )


def bound_kept(sigma: float, shift: float, confidence: float) -> float:
    """The bound within which so large a share stays."""
    half = sigma * NORMAL.inv_cdf(0.5 + 0.5 * confidence)
    if shift == 0.0 or not math.isfinite(sigma):
        return half
    return bisected(lambda bound: inside(sigma, shift, bound) < confidence, half, half + abs(shift))


def shifts(setting: Setting, frames: Frames) -> Array:
    """Size (n, k) of the errors that the setting's roll error makes, of the quantities of the frames' stage."""
    n, k = len(frames), len(OF_STAGE[frames.stage])
    if frames.stage == "early" or setting.roll_error == 0.0:
        return np.zeros((n, k))
    # lines without noise: what is left of the covariance is the roll's share
    middle = 0.5 * (frames.ends[..., :2] + frames.ends[..., 2:])
    left, right = (LineNoise(middle[:, line, 0], middle[:, line, 1], 0.0, 0.0) for line in (LEFT, RIGHT))
    covariance = two_line_covariance(
        setting.camera,
        left,
        right,
        lateral=frames.position[:, 1],
        height=frames.height,
        R_cam_from_runway=frames.R_cam_from_runway,
        runway_width=setting.runway.width,
        roll_variance=setting.roll_error**2,
    )
    yaw, pitch, cross, altitude = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1).T)
    of = {"pitch": pitch, "yaw": yaw, "cross": cross, "altitude": altitude}
    return np.stack([of[name] for name in OF_STAGE["late"]], axis=-1)


def gains(setting: Setting, frames: Frames, reading: Reading, spacing_px: float | None = None) -> Array:
    """Standard deviation (n, k) of the errors per px of the points'."""
    spacing = setting.spacing_px if spacing_px is None else spacing_px
    return first_order(setting.camera, frames, reading, spacing, 1.0, setting.runway.width)


def needed_noise(
    setting: Setting, requirements: Sequence[Requirement], stages: Sequence[StageName | None], confidence: float
) -> dict[Reading, list[float]]:
    """The greatest σ of the points, px, with which each requirement holds.

    Parameters
    ----------
    setting : Setting
    requirements : sequence of Requirement
        Each with a distance.
    stages : sequence of {"early", "late", None}
        Of each requirement; None where there is no pose.
    confidence : float
        Share of the frames within the bound.

    Returns
    -------
    dict
        By reading, a number a requirement: NaN where there is no pose, 0 where the roll error alone breaks the bound.
    """
    needed: dict[Reading, list[float]] = {reading: [math.nan] * len(requirements) for reading in READINGS}
    for stage in ("early", "late"):
        which = [i for i, of in enumerate(stages) if of == stage and requirements[i].quantity.name in OF_STAGE[stage]]
        if not which:
            continue
        frames = frames_at(setting, stage, np.array([requirements[i].distance for i in which], float))
        shift = shifts(setting, frames)
        for reading in READINGS:
            gain = gains(setting, frames, reading)
            for row, i in enumerate(which):
                column = OF_STAGE[stage].index(requirements[i].quantity.name)
                if math.isfinite(gain[row, column]):
                    sigma = sigma_within(requirements[i].bound, float(shift[row, column]), confidence)
                    needed[reading][i] = 0.0 if sigma is None else sigma / float(gain[row, column])
    return needed


def need(setting: Setting, requirement: Requirement, stage: StageName, reading: Reading, confidence: float) -> Need:
    """What a requirement at its distance needs of the lines.

    Raises
    ------
    InputError
        If no pose can be had there.
    ValueError
        If it has no distance.
    """
    if requirement.distance is None:
        raise ValueError("a requirement without a distance needs no particular precision")
    frames = frames_at(setting, stage, np.array([requirement.distance]))
    column = OF_STAGE[stage].index(requirement.quantity.name)
    gain = float(gains(setting, frames, reading)[0, column])
    if not math.isfinite(gain):
        raise InputError(f"{requirement.source}: at {requirement.distance:g} m the lines do not tell a pose")
    shift = float(shifts(setting, frames)[0, column])
    sigma = sigma_within(requirement.bound, shift, confidence)
    lengths = [math.hypot(end[2] - end[0], end[3] - end[1]) for end in frames.ends[0, LINES_OF_STAGE[stage]].tolist()]

    def points_at(spacing: float) -> tuple[int, ...]:
        return tuple(number_of_points(length, reading, spacing) for length in lengths)

    spacing = None
    if reading == "edge-points" and sigma is not None:
        largest = math.inf if setting.noise_px == 0.0 else sigma / setting.noise_px
        spacing = _widest_spacing(
            lambda s: float(gains(setting, frames, reading, s)[0, column]) <= largest, max(lengths)
        )
    return Need(
        gain=gain,
        shift=shift,
        now=bound_kept(gain * setting.noise_px, shift, confidence),
        noise_px=None if sigma is None else sigma / gain,
        points_now=points_at(setting.spacing_px),
        spacing_px=spacing,
        points=None if spacing is None else points_at(spacing),
    )


def confirm(
    setting: Setting,
    requirement: Requirement,
    stage: StageName,
    reading: Reading,
    noise_px: float,
    draws: int,
    seed: SeedSequence,
) -> Confirmed:
    """Draw the points of one frame many times with a σ, and count the errors within the bound."""
    if requirement.distance is None:
        raise ValueError("a requirement without a distance cannot be drawn")
    frames = frames_at(setting, stage, np.array([requirement.distance]))
    column = OF_STAGE[stage].index(requirement.quantity.name)
    fits = draw_lines(
        frames.ends[0], LINES_OF_STAGE[stage], reading, setting.spacing_px, noise_px, draws, default_rng(seed)
    )
    roll_error = setting.roll_error if stage == "late" else 0.0
    errors = pose_errors(setting.camera, frames, 0, fits, setting.runway.width, roll_error)[:, column]
    return Confirmed(float(np.mean(np.abs(errors) <= requirement.bound)), draws)


def seed_of(seed: int, requirement: int, reading: Reading) -> SeedSequence:
    """The seed of a requirement's draws, by its number: the others' do not change it."""
    return child(SeedSequence(seed), requirement, READINGS.index(reading))


def _widest_spacing(holds: Callable[[float], bool], length: float) -> float | None:
    """The widest spacing that holds, which a narrower one does too."""
    wide = length
    if holds(wide):
        return wide
    narrow = wide
    while not holds(narrow):
        wide, narrow = narrow, 0.5 * narrow
        if narrow < FINEST_PX:
            return None
    return bisected(holds, narrow, wide)


def bisected(holds: Callable[[float], bool], good: float, bad: float) -> float:
    """The last value, from good toward bad, that holds."""
    for _ in range(60):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good
