"""What becomes of a first-order figure when the noise is drawn, with real line fits.

Where few draws already tell it apart from the truth, it is not to be trusted: far out a line's angle is so badly known
that the pose is no longer linear in it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng

from landsim.budget.normal import inside
from landsim.budget.requirements import Requirement
from landsim.budget.setting import Setting, frames_at
from landsim.sensors import number_of_points
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.envelope import child
from landsim.study.frames import LINES_OF_STAGE
from landsim.study.model import OF_STAGE, READINGS, Reading, StageName

CHECK_DRAWS = 2000
"""With which each figure is checked."""
MOST_NUMBERS = 20_000_000
"""Drawn for a check at most: with lines of very many points there are fewer draws, though not below `LEAST_DRAWS`."""
LEAST_DRAWS = 100
OFF_BY = 0.1
"""By which share of it a needed σ may be off."""
CHANCE = 3.0
"""Standard deviations of the share of the draws within a bound that are put down to chance."""
OF_CHECK, OF_HELD = 1, 2
"""Parts of a requirement's seed that the checks of its need and of where it holds draw from."""


class Confirmed(NamedTuple):
    """What became of a requirement when its need was drawn."""

    inside: float
    """Share of the draws within the bound."""
    draws: int


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


def holds_when_drawn(
    setting: Setting,
    requirement: Requirement,
    stage: StageName,
    reading: Reading,
    noise_px: float,
    sigma: float,
    shift: float,
    seed: SeedSequence,
) -> bool:
    """Whether a first-order error is near that of the solver: by a tenth, as far as few draws can tell.

    Parameters
    ----------
    setting, requirement, stage, reading, noise_px
        As for `confirm`.
    sigma, shift : float
        The error's standard deviation and mean at this noise, to first order, m or rad.
    seed : SeedSequence
        Not spawned from.

    Returns
    -------
    bool
        Whether the share of the draws within the bound is between those of a normal error with a σ a tenth larger and
        a tenth smaller, give or take `CHANCE` of its own standard deviations.
    """
    drawn = confirm(setting, requirement, stage, reading, noise_px, _draws(setting, requirement, stage, reading), seed)
    least, expected, most = (
        inside(factor * sigma, shift, requirement.bound) for factor in (1.0 + OFF_BY, 1.0, 1.0 - OFF_BY)
    )
    chance = CHANCE * math.sqrt(expected * (1.0 - expected) / drawn.draws) + 0.5 / drawn.draws
    return least - chance <= drawn.inside <= most + chance


def seed_of(seed: int, requirement: int, reading: Reading, *part: int) -> SeedSequence:
    """The seed of a requirement's draws, by its number: the others' do not change it."""
    return child(SeedSequence(seed), requirement, READINGS.index(reading), *part)


def _draws(setting: Setting, requirement: Requirement, stage: StageName, reading: Reading) -> int:
    """How many a check is made of."""
    ends = frames_at(setting, stage, np.array([requirement.distance], float)).ends[0, LINES_OF_STAGE[stage]]
    lengths = np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1]).tolist()
    numbers = 2 * sum(number_of_points(length, reading, setting.spacing_px) for length in lengths)
    return min(CHECK_DRAWS, max(LEAST_DRAWS, MOST_NUMBERS // numbers))
