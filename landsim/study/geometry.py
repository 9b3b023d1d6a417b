"""What ties the errors of one pose together: cross to yaw, altitude to pitch, and late everything to the roll angle.

Late, two planes of the edges are known and the angle about the runway's axis is given.  A roll error δ turns the pair
of planes about that axis: to first order the lateral estimate moves by (h + L²/(4h)) δ at a camera height h over the
centreline of a runway L wide.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import ArrayLike

from estimator.lines import LineFit, fit_line
from estimator.so3 import Array
from estimator.two_line import two_line_pose
from landsim.config import Scenario
from landsim.sensors import camera_of
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.envelope import child, percentiles
from landsim.study.frames import LINES_OF_STAGE, Frames, at_distances
from landsim.study.model import CHANCE, LEVEL, LEVELS, OF_STAGE, Reading

GREATEST_ROLL = math.radians(20.0)
"""No roll error beyond it is looked at."""
SCAN = 80
"""Steps to it, in which the first roll error that breaks a bound is looked for."""
CLOSE = 0.002
"""Relative width of what a limit is known between; `FINEST` where the limit is next to nothing, rad."""
FINEST = 1e-6
SLACK = 1.1
"""Of the bound, to first order: no further than there does sampling correct a limit."""
STEP = 0.05
"""Of what is too much: the first step back from it."""
NEAR = 0.9
"""Frames that come so near to the worst are checked too: the first and the last of them."""
ROUNDS = 3
"""Searches, each with the frames in which the one before did not hold."""


@dataclass(frozen=True)
class RollLimit:
    """The roll error up to which a bound of the late stage holds at 95 %, all the way from the hand-over to the end.

    Attributes
    ----------
    quantity : str
    reading : {"endpoints", "edge-points"}
    bound : float
        m or rad.
    roll_error : float or None
        The bound holds with as much either way, rad; None where it does not hold with the true roll.
    beyond : bool
        Whether the bound still holds at `GREATEST_ROLL`, which ``roll_error`` then is.
    no_solution : bool
        The bound does not hold further on, or at all, because the two lines have no solution: most of the draws that do
        not keep it are such.
    distance, height : float
        Of the frame that decides, m.
    ratio : float
        95th percentile of the error there over the bound, at ``roll_error`` (0 where that is None) and the worse of
        its signs, from independent draws; infinite where more than 5 % have no solution.
    draws : int
        Behind ``ratio``, and in each other frame that was checked.
    checked : tuple of float
        Distances of the frames that were checked with independent draws, m: the one that decides, the first and the
        last of those that come near it, and the stage's first and last.
    confirmed : bool
        The bound holds in all of them, but for chance; where ``roll_error`` is None, it does not.
    """

    quantity: str
    reading: Reading
    bound: float
    roll_error: float | None
    beyond: bool
    no_solution: bool
    distance: float
    height: float
    ratio: float
    draws: int
    checked: tuple[float, ...]
    confirmed: bool


@dataclass(frozen=True)
class Proportion:
    """How the errors of two quantities go together at one range.

    Attributes
    ----------
    reading : {"endpoints", "edge-points"}
    distance : float
        m.
    cross_over_yaw, altitude_over_pitch : float
        Ratio of the 68.27th percentiles of the errors, m/rad, over the range: 1 where an error of the angle moves the
        position by range times angle and nothing else does.
    cross_yaw_correlation, altitude_pitch_correlation, cross_roll_correlation, yaw_roll_correlation : float
    sight, axis : float
        How far the threshold and the optical axis lie below the horizon, rad.
    """

    reading: Reading
    distance: float
    cross_over_yaw: float
    altitude_over_pitch: float
    cross_yaw_correlation: float
    altitude_pitch_correlation: float
    cross_roll_correlation: float
    yaw_roll_correlation: float
    sight: float
    axis: float


def lateral_shift(height: ArrayLike, width: float, roll_error: float) -> Array:
    """(h + L²/(4h)) δ: how far a roll error moves the cross estimate of two lines over the centreline, m."""
    h = np.asarray(height, float)
    return np.asarray((h + width * width / (4.0 * h)) * roll_error)


def roll_bias(scenario: Scenario, frames: Frames, roll_error: float) -> Array:
    """Errors (n, k) of the late pose from lines without noise and a roll angle that is off, estimate less truth.

    Parameters
    ----------
    scenario : Scenario
    frames : Frames
        Of the late stage; the camera neither rolls nor yaws.
    roll_error : float
        rad.
    """
    left, right = (fit_line(frames.ends[:, i].reshape(-1, 2, 2)).line for i in LINES_OF_STAGE["late"])
    pose = two_line_pose(camera_of(scenario.camera), left, right, runway_width=scenario.runway.width_m, roll=roll_error)
    errors = {
        "pitch": pose.pitch - frames.pitch,
        "yaw": pose.yaw,
        "cross": pose.lateral - frames.position[:, 1],
        "altitude": pose.height - frames.height,
    }
    return np.stack([errors[name] for name in OF_STAGE["late"]], axis=-1)


def biased_percentile(bias: ArrayLike, sigma: ArrayLike) -> Array:
    """95th percentile of the magnitude of a normal error with a bias: Φ((q - b)/σ) - Φ((-q - b)/σ) = 0.95."""
    from scipy.special import ndtr  # for this alone

    b, s = np.broadcast_arrays(np.abs(np.asarray(bias, float)), np.asarray(sigma, float))
    low, high = b, b + 2.0 * s
    for _ in range(60):
        middle = 0.5 * (low + high)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside = ndtr((middle - b) / s) - ndtr((-middle - b) / s)
        low, high = np.where(inside < LEVEL / 100.0, middle, low), np.where(inside < LEVEL / 100.0, high, middle)
    return np.asarray(np.where(s > 0.0, high, b))


class _Sample(NamedTuple):
    """Of the errors drawn in one frame, the worse of both signs of the roll error."""

    ratio: float
    """95th percentile over the bound."""
    lost: float
    """Share without a solution."""
    kept: float
    """Share within the bound."""

    @property
    def without(self) -> bool:
        """Whether most of those that are not within the bound have no solution."""
        return self.lost > 0.5 * (1.0 - self.kept)


@dataclass(frozen=True)
class _Question:
    """One quantity's error in the frames of the late stage, as a function of the roll error."""

    scenario: Scenario
    frames: Frames
    spread: Array
    column: int
    bound: float
    reading: Reading
    draws: int

    def ratios(self, roll_error: float) -> Array:
        """95th percentile over the bound to first order (n,), for the worse sign; infinite without a solution."""
        bias = np.stack([roll_bias(self.scenario, self.frames, sign * roll_error)[:, self.column] for sign in (1, -1)])
        p95 = biased_percentile(bias, self.spread)
        return np.asarray(np.where(np.isfinite(p95), p95, np.inf).max(axis=0) / self.bound)

    def breaks(self, part: float) -> tuple[float, float]:
        """Between which roll errors the first-order ratio first goes over ``part``.

        They are (0, 0) where it does so at once, and (`GREATEST_ROLL`, inf) where not at all.
        """
        low = 0.0
        if self.ratios(low).max() > part:
            return 0.0, 0.0
        for high in (np.arange(1, SCAN + 1) * (GREATEST_ROLL / SCAN)).tolist():
            if self.ratios(high).max() > part:
                break
            low = high
        else:
            return GREATEST_ROLL, math.inf
        while high - low > max(0.1 * CLOSE * high, FINEST):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.ratios(middle).max() > part else (middle, high)
        return low, high

    def lines(self, i: int, seed: SeedSequence) -> tuple[LineFit, ...]:
        """Drawn in a frame."""
        settings, rng = self.scenario.camera, default_rng(child(seed, i))
        which = LINES_OF_STAGE["late"]
        return draw_lines(
            self.frames.ends[i], which, self.reading, settings.point_spacing_px, settings.noise_px, self.draws, rng
        )

    def sample(self, i: int, fits: Sequence[LineFit], roll_error: float) -> _Sample:
        """What lines of a frame come to with a roll error."""
        camera, width = camera_of(self.scenario.camera), self.scenario.runway.width_m
        signed = (roll_error, -roll_error) if roll_error else (0.0,)
        errors = np.stack([pose_errors(camera, self.frames, i, fits, width, roll)[:, self.column] for roll in signed])
        return _Sample(
            float(percentiles(errors[..., None], (LEVEL,)).max()) / self.bound,
            float(np.isnan(errors).mean(axis=1).max()),
            float((np.abs(errors) <= self.bound).mean(axis=1).min()),
        )

    @property
    def chance(self) -> float:
        """Of the share in 95 % of the draws, `CHANCE` standard errors."""
        return CHANCE * math.sqrt(LEVEL / 100.0 * (1.0 - LEVEL / 100.0) / self.draws)

    def broken(self, sample: _Sample) -> bool:
        """Whether the bound does not hold, or so many have no solution that with other draws it may be over 5 %."""
        return sample.ratio > 1.0 or sample.lost > max(1.0 - LEVEL / 100.0 - self.chance, 0.0)

    def near(self, roll_error: float) -> set[int]:
        """The frames to look at: the worst to first order, those next to it, the first and the last."""
        ratios = self.ratios(roll_error)
        near = np.flatnonzero(ratios >= NEAR * ratios.max())
        return {int(np.argmax(ratios)), int(near[0]), int(near[-1]), 0, len(ratios) - 1}


def _search(breaks: Callable[[float], bool], first: float, cap: float) -> tuple[float, float | None]:
    """The limit near ``first`` and not beyond ``cap``: a roll error that holds and, if it was met, one that does not.

    Every roll error that is taken to hold has been asked for, and 0 is known to.
    """
    low, high = 0.0, first
    if not breaks(first):
        if cap == first or not breaks(cap):
            return cap, None
        low, high = first, cap
    step = max(STEP * high, FINEST)
    while low == 0.0 and high - step > FINEST:
        if not breaks(high - step):
            low = high - step
        else:
            high, step = high - step, 2.0 * step
    while high - low > max(CLOSE * high, FINEST):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if breaks(middle) else (middle, high)
    return low, high


def roll_limit(
    scenario: Scenario,
    frames: Frames,
    sigma: Array,
    quantity: str,
    bound: float,
    reading: Reading,
    draws: int,
    seed: SeedSequence,
) -> RollLimit:
    """Solve for the roll error at which a bound stops to hold, to first order, and correct and confirm by sampling.

    The two lines have no solution once the roll error turns an edge's plane past the horizontal: with a level camera
    at tan δ = h / (L/2 + abs(y)).  From there on no bound holds, however large.

    Parameters
    ----------
    scenario : Scenario
    frames : Frames
        The whole late stage.
    sigma : (n, k) array
        First-order 1 σ of the pose in these frames.
    quantity, bound, reading
        m or rad.
    draws : int
        In each frame, for the correction and, anew, for the confirmation.
    seed : SeedSequence
        Not spawned from.
    """
    column = OF_STAGE["late"].index(quantity)
    ask = _Question(scenario, frames, sigma[:, column], column, bound, reading, draws)
    (first, _), (cap, past) = ask.breaks(1.0), ask.breaks(SLACK)
    drawn: dict[int, tuple[LineFit, ...]] = {}

    def samples(looked: Iterable[int], roll_error: float) -> dict[int, _Sample]:
        for i in looked:
            if i not in drawn:
                drawn[i] = ask.lines(i, child(seed, 0))
        return {i: ask.sample(i, drawn[i], roll_error) for i in looked}

    def answer(roll_error: float | None, beyond: bool, without: bool, i: int) -> tuple[RollLimit, list[int]]:
        limit = roll_error or 0.0
        found = {
            k: ask.sample(k, ask.lines(k, child(seed, 1)), limit)
            for k in sorted({i} if roll_error is None else ask.near(limit) | {i})
        }
        # both the correction's share and this one are by chance
        wrong = [k for k, one in found.items() if one.kept < LEVEL / 100.0 - math.sqrt(2.0) * ask.chance]
        made = RollLimit(
            quantity, reading, bound, roll_error, beyond, without, float(frames.distance[i]), float(frames.height[i]),
            found[i].ratio, draws, tuple(float(frames.distance[k]) for k in found),
            bool(wrong) if roll_error is None else not wrong,
        )  # fmt: skip
        return made, wrong

    looked = sorted({int(np.argmax(ask.ratios(first))), len(frames) - 1})
    for _ in range(ROUNDS):
        with_true = samples(looked, 0.0)
        if any(ask.broken(one) for one in with_true.values()):
            i = max(with_true, key=lambda k: with_true[k].ratio)
            return answer(None, False, with_true[i].without, i)[0]

        def breaks(roll_error: float, where: Sequence[int] = looked) -> bool:
            return any(ask.broken(one) for one in samples(where, roll_error).values())

        low, high = _search(breaks, first, cap)
        if high is None:  # to first order alone it goes no further
            ratios = ask.ratios(min(past, GREATEST_ROLL))
            i, beyond = int(np.argmax(ratios)), not math.isfinite(past)
            without = not beyond and math.isinf(ratios[i])
        else:
            at = samples(looked, high)
            i, beyond = max((k for k in at if ask.broken(at[k])), key=lambda k: at[k].ratio), False
            without = at[i].without
        limit, wrong = answer(low, beyond, without, i)
        if set(wrong) <= set(looked):
            break
        looked = sorted({*looked, *wrong})
    return limit


def proportions(
    scenario: Scenario, reading: Reading, distances: ArrayLike, draws: int, seed: SeedSequence
) -> tuple[Proportion, ...]:
    """How cross goes with yaw and altitude with pitch in the early stage, at given distances to the threshold, m.

    Both angles turn the sight line to the threshold, whose bearing in the image is known far better.  A roll error δ
    turns its heading as well, by sin(depression) δ; and so it does that of the optical axis, which is the yaw.
    """
    frames, settings = at_distances(scenario, "early", distances), scenario.camera
    camera, names = camera_of(settings), OF_STAGE["early"]
    found = []
    for i, distance in enumerate(frames.distance.tolist()):
        rng = default_rng(child(seed, i))
        fits = draw_lines(
            frames.ends[i], LINES_OF_STAGE["early"], reading, settings.point_spacing_px, settings.noise_px, draws, rng
        )
        errors = pose_errors(camera, frames, i, fits, scenario.runway.width_m)
        errors = errors[np.isfinite(errors).all(axis=1)]
        of = {name: errors[:, k] for k, name in enumerate(names)}
        p68 = dict(zip(names, percentiles(errors, LEVELS[:1])[:, 0].tolist(), strict=True))
        tied = [
            float(np.corrcoef(of[one], of[other])[0, 1])
            for one, other in (("cross", "yaw"), ("altitude", "pitch"), ("cross", "roll"), ("yaw", "roll"))
        ]
        found.append(
            Proportion(
                reading,
                distance,
                p68["cross"] / p68["yaw"] / distance,
                p68["altitude"] / p68["pitch"] / distance,
                *(*tied, math.atan2(float(frames.height[i]), distance), -float(frames.pitch[i])),
            )
        )
    return tuple(found)
