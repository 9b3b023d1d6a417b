"""What a line must be worth for a bound to hold, to first order in the noise.

To first order an error is normal with a standard deviation in proportion to that of the points, σ_error = g σ_px, about
a shift that a wrong roll angle makes late.  The shift is the solver's own, and g is that at the shifted pose.  More
points of the same noise make g smaller, by about the root of their number.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from estimator.so3 import Array
from landsim.budget.bias import believed, shifts
from landsim.budget.normal import bisected, bound_kept, sigma_within
from landsim.budget.requirements import Requirement
from landsim.budget.setting import Setting, frames_at
from landsim.errors import InputError
from landsim.sensors import number_of_points
from landsim.study.envelope import first_order
from landsim.study.frames import LINES_OF_STAGE, Frames
from landsim.study.model import OF_STAGE, READINGS, Reading, StageName

FINEST_PX = 1e-9
"""No spacing of points is looked for below this."""


class Need(NamedTuple):
    """What one requirement needs of one noise reading.

    Attributes
    ----------
    gain : float
        Standard deviation of the error per px of the points', m/px or rad/px.
    shift : float
        Error that the roll error makes, m or rad.  It, ``gain`` and ``now`` are NaN if with it there is no pose.
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


def gains(setting: Setting, frames: Frames, reading: Reading, spacing_px: float | None = None) -> Array:
    """Standard deviation (n, k) of the errors per px of the points', for the camera where the frames have it."""
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
        shift, seen = shifts(setting, frames), frames.seen()
        for reading in READINGS:
            gain = gains(setting, believed(setting, frames, shift), reading)
            for row, i in enumerate(which):
                column = OF_STAGE[stage].index(requirements[i].quantity.name)
                sigma = sigma_within(requirements[i].bound, float(shift[row, column]), confidence)
                if seen[row] and sigma is None:
                    needed[reading][i] = 0.0
                elif sigma is not None and math.isfinite(gain[row, column]):
                    needed[reading][i] = sigma / float(gain[row, column])
    return needed


def moments(setting: Setting, requirement: Requirement, stage: StageName, reading: Reading) -> tuple[float, float]:
    """Standard deviation per px and mean of a requirement's error at its distance, m or rad."""
    frames, shift, column = _moved(setting, requirement, stage)
    return float(gains(setting, frames, reading)[0, column]), shift


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
    frames, shift, column = _moved(setting, requirement, stage)
    gain = float(gains(setting, frames, reading)[0, column])
    if math.isfinite(shift) and not math.isfinite(gain):
        raise InputError(f"{requirement.source}: at {requirement.distance:g} m the lines do not tell a pose")
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


def _moved(setting: Setting, requirement: Requirement, stage: StageName) -> tuple[Frames, float, int]:
    """The frame of a requirement from where the roll error has the camera, its error by that, and its column."""
    frames = frames_at(setting, stage, np.array([requirement.distance], float))
    column = OF_STAGE[stage].index(requirement.quantity.name)
    shift = shifts(setting, frames)
    return believed(setting, frames, shift), float(shift[0, column]), column


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
