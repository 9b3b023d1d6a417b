"""The line precision with which a bound holds.

The precision is solved for to first order at every frame, corrected by sampling where it binds (at long range the tails
are heavier than a Gaussian's), and confirmed with other draws.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import SeedSequence, default_rng

from estimator.camera import PinholeCamera
from estimator.so3 import Array
from landsim.config import Scenario
from landsim.sensors import camera_of
from landsim.study.draws import draw_line, draw_lines, points_on, pose_errors
from landsim.study.envelope import child, first_order, line_noise, percentiles, pose_sigma
from landsim.study.frames import LINES_OF_STAGE, Frames
from landsim.study.model import CHANCE, JUDGED, LEVEL, NORMAL, OF_STAGE, Reading, StageName

SHARE = LEVEL / 100.0
"""Of the errors that keeps the bound."""
SOLVED = 2e-3
"""Relative difference between the sampled percentile and the bound at which the search ends."""
ROUNDS = 12
"""Most samplings of a search."""
FEW_POINTS = 16
"""Points a line with which a search makes do: see `_Question.tail`."""
SEARCH_DRAWS = 4
"""Draws of a search for each one of the confirmation: its error must be the smaller one."""
MOST_POINTS = 5_000_000
"""On a line: a bound that asks for more is out of reach."""
BUDGET = 60_000_000
"""Numbers that a confirmation draws at most, at the frame where the bound is met last; at others a quarter of it."""
LEAST_DRAWS = 200
"""Fewer say nothing of a 95th percentile."""


@dataclass(frozen=True)
class Precision:
    """What the lines must be, for a bound to hold at 95 % through a whole stage.

    Attributes
    ----------
    stage, reading, quantity : str
    bound : float
        rad or m.
    noise_px : float
        1 σ of the points: with ``endpoints`` what was solved for, with ``edge-points`` the scenario's.
    spacing_px : float or None
        Between the points of a line, with ``edge-points``: what was solved for.
    ends_suffice : bool
        The bound holds with points at the two ends alone, and spacing_px is the longest line's length: any larger one
        is as good.
    first_order : float
        What was solved for, as the first order alone would have it, px.
    distance : float
        To the threshold, of the frame at which the bound is met last, m.
    points : (3,) tuple of int
        On left edge, threshold and right edge there; 0 on one that the stage does not use.
    draws : int
        Of the confirmation there; 0 if a line has more points than can be drawn often enough.
    p95 : float
        95th percentile of the absolute error in them, rad or m; NaN without draws.
    within : float
        Part of the draws that keeps the bound; NaN without draws.
    within_interval : (2,) tuple of float
        In which that part is by the number of draws, at 95 %, see `wilson`; NaN without draws.
    checked : tuple of float
        Distances of this frame and of others that come within a tenth of it, m.
    confirmed : bool
        Whether no fewer than 95 % of the draws keep the bound at each of these, and at one of them no more either, to
        `CHANCE` standard errors.  More may keep it if the ends suffice, or if one point less on a line breaks it.
    """

    stage: StageName
    reading: Reading
    quantity: str
    bound: float
    noise_px: float
    spacing_px: float | None
    ends_suffice: bool
    first_order: float
    distance: float
    points: tuple[int, int, int]
    draws: int
    p95: float
    within: float
    within_interval: tuple[float, float]
    checked: tuple[float, ...]
    confirmed: bool


def required_precision(
    scenario: Scenario,
    frames: Frames,
    quantity: str,
    reading: Reading,
    bound: float,
    seed: SeedSequence,
    draws: int | None = None,
) -> Precision | None:
    """The line precision with which a quantity's 95th percentile keeps a bound through a whole stage.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``study``.
    frames : Frames
        Of the stage; of early ones those from the first of ``study.ranges_m`` on count.
    quantity : str
        Of ``OF_STAGE[frames.stage]``.
    reading : {"endpoints", "edge-points"}
        With ``endpoints`` the σ of the ends is solved for, with ``edge-points`` the spacing of the points at the
        scenario's ``camera.noise_px``.
    bound : float
        rad or m, above zero.
    seed : SeedSequence
        It is not changed.
    draws : int, optional
        At each frame; without it, ``study.listed_draws``.  The confirmation draws fewer where a line has thousands of
        points.

    Returns
    -------
    Precision or None
        None if there are no such frames, or if a line is not seen in one of them: no precision helps then.  None too
        if a line would need more than `MOST_POINTS`.

    Raises
    ------
    ValueError
        If the quantity is not of the stage, the bound is not above zero, or the noise to which points are to be added
        is zero.
    """
    if quantity not in OF_STAGE[frames.stage]:
        raise ValueError(f"{quantity!r} is not a quantity of the {frames.stage} stage")
    if not bound > 0.0:
        raise ValueError(f"a bound must be above zero, not {bound!r}")
    if scenario.study is None:
        raise ValueError(f"{scenario.name}: a scenario of the kind {scenario.kind!r} has no ranges")
    if reading == "edge-points" and scenario.camera.noise_px == 0.0:
        raise ValueError("points without noise need no precision: camera.noise_px must be above zero")
    if frames.stage == "early":
        frames = frames[frames.distance <= scenario.study.ranges_m[0] * (1.0 + 1e-9)]
    if len(frames) == 0 or not frames.seen().all():
        return None
    question = _Question(
        camera_of(scenario.camera),
        scenario.runway.width_m,
        scenario.camera.noise_px,
        frames,
        OF_STAGE[frames.stage].index(quantity),
        reading,
        bound,
    )
    number = scenario.study.listed_draws if draws is None else draws
    longest = float(question.lengths.max())
    start, loosest = question.to_first_order(longest)
    if reading == "edge-points" and longest / start > MOST_POINTS:
        return None
    value, stepped = question.solve(start, loosest, longest, SEARCH_DRAWS * number, child(seed, 0))
    ratios = question.ratios(value)
    worst = int(np.argmax(ratios))
    main = question.confirm(value, worst, number, BUDGET, child(seed, 1))
    others = [question.confirm(value, i, number, BUDGET // 4, child(seed, 1)) for i in _near_worst(ratios)]
    checks = (main, *others)
    ends_suffice = reading == "edge-points" and value >= longest
    return Precision(
        stage=frames.stage,
        reading=reading,
        quantity=quantity,
        bound=bound,
        noise_px=value if reading == "endpoints" else scenario.camera.noise_px,
        spacing_px=None if reading == "endpoints" else value,
        ends_suffice=ends_suffice,
        first_order=start,
        distance=float(frames.distance[worst]),
        points=question.points(value, worst),
        draws=main.draws,
        p95=main.p95,
        within=main.within,
        within_interval=wilson(main.within, main.draws),
        checked=tuple(float(frames.distance[check.frame]) for check in checks),
        confirmed=confirmed(checks, at_most=not (ends_suffice or stepped)),
    )


@dataclass(frozen=True)
class _Check:
    frame: int
    draws: int
    p95: float
    within: float

    @property
    def off(self) -> float:
        """By how many standard errors the share that keeps the bound is above the one that is asked."""
        return (self.within - SHARE) / math.sqrt(SHARE * (1.0 - SHARE) / self.draws) if self.draws else math.nan


def confirmed(checks: Sequence[_Check], *, at_most: bool) -> bool:
    """Whether enough draws keep the bound at every frame; with `at_most`, and at one of them not too many."""
    off = [check.off for check in checks]
    return all(x >= -CHANCE for x in off) and (not at_most or any(abs(x) <= CHANCE for x in off))


def wilson(share: float, draws: int) -> tuple[float, float]:
    """The interval in which a probability is at 95 %, if it came to a share of so many draws; NaN without draws.

    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212: the probabilities p with |share - p| ≤ z √(p (1 - p)/n).
    """
    if draws == 0:
        return math.nan, math.nan
    z2 = NORMAL[JUDGED] ** 2 / draws
    middle = share + 0.5 * z2
    half = math.sqrt(z2 * (share * (1.0 - share) + 0.25 * z2))
    return (middle - half) / (1.0 + z2), (middle + half) / (1.0 + z2)


@dataclass(frozen=True)
class _Question:
    """One quantity's error at the frames of one stage, as a function of σ (endpoints) or spacing (edge-points)."""

    camera: PinholeCamera
    width: float
    noise_px: float
    frames: Frames
    column: int
    reading: Reading
    bound: float

    @property
    def lengths(self) -> Array:
        """Of the lines that the stage uses, (n, 2 or 3) px."""
        ends = self.frames.ends[:, LINES_OF_STAGE[self.frames.stage]]
        return np.asarray(np.hypot(ends[..., 2] - ends[..., 0], ends[..., 3] - ends[..., 1]))

    def setting(self, value: float) -> tuple[float, float]:
        """Spacing and noise, px."""
        return (1.0, value) if self.reading == "endpoints" else (value, self.noise_px)

    def ratios(self, value: float) -> Array:
        """95th percentile over bound at every frame, to first order."""
        spacing, noise = self.setting(value)
        sigma = first_order(self.camera, self.frames, self.reading, spacing, noise, self.width)[:, self.column]
        return np.asarray(NORMAL[JUDGED] * sigma / self.bound)

    def points(self, value: float, frame: int) -> tuple[int, int, int]:
        """On left edge, threshold and right edge of a frame."""
        spacing, _ = self.setting(value)
        counts = [0, 0, 0]
        for line in LINES_OF_STAGE[self.frames.stage]:
            counts[line] = points_on(self.frames.ends[frame, line], self.reading, spacing).shape[1]
        return counts[0], counts[1], counts[2]

    def to_first_order(self, longest: float) -> tuple[float, bool]:
        """The greatest value that keeps the bound at every frame, and whether no greater one changes anything."""
        if self.reading == "endpoints":
            return 1.0 / float(self.ratios(1.0).max()), False
        high = longest
        if self.ratios(high).max() <= 1.0:
            return high, True
        low = high
        while self.ratios(low).max() > 1.0:  # the ratio falls with the root of the spacing: it comes to an end
            low, high = 0.25 * low, low
        while high / low > 1.0 + 1e-4:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.ratios(middle).max() <= 1.0 else (low, middle)
        return low, False

    def solve(self, start: float, loosest: bool, longest: float, draws: int, seed: SeedSequence) -> tuple[float, bool]:
        """The same by sampling: a secant in logarithms, kept between values that hold and values that do not.

        Second, whether the percentile steps over the bound: the value holds with room to spare, and the least bit more
        does not.
        """
        slope = 1.0 if self.reading == "endpoints" else 0.5
        value, holds, fails = start, 0.0, math.inf
        before: tuple[float, float] | None = None
        for _ in range(ROUNDS):
            ratios = self.ratios(value)
            # the worst frame to first order, and the farthest, where the tails are heaviest
            probes = {0, int(np.argmax(ratios))}
            excess = max(math.log(ratios[frame] * self.tail(value, frame, draws, seed)) for frame in probes)
            if excess <= 0.0:
                holds = max(holds, value)
            else:
                fails = min(fails, value)
            if abs(excess) < SOLVED or (loosest and excess <= 0.0) or fails < holds * (1.0 + SOLVED):
                break
            if before is not None and value != before[0] and math.isfinite(excess):
                change = (excess - before[1]) / math.log(value / before[0])
                slope = min(max(change, 0.25 * slope), 4.0 * slope)
            before = (value, excess) if math.isfinite(excess) else None
            value *= math.exp(-max(min(excess, 2.0), -2.0) / slope)
            if holds > 0.0 and not holds < value < fails:
                value = math.sqrt(holds * fails) if math.isfinite(fails) else 2.0 * holds
            elif value >= fails:
                value = 0.5 * fails
            if self.reading == "edge-points":
                value, loosest = min(value, longest), value >= longest
        if holds == 0.0 or abs(excess) < SOLVED:
            return value, False
        return holds, fails < holds * (1.0 + SOLVED)

    def tail(self, value: float, frame: int, draws: int, seed: SeedSequence) -> float:
        """Sampled 95th percentile of a frame over that of the first order.

        Of N points with the noise σ on a line, no more than `FEW_POINTS` are drawn, their noise less by the root of the
        ratio.  The pose sees the line and not the points, and the few points' own first order is what is divided by;
        only the fit's terms of the order of (σ / length)², under a hundredth, are lost.  The confirmation draws all.
        """
        spacing, noise = self.setting(value)
        rng = default_rng(child(seed, frame))
        used, lines, known = LINES_OF_STAGE[self.frames.stage], self.frames.ends[frame], []
        fits = []
        for line, ends in enumerate(lines):
            how: tuple[Reading, float, float] = self.reading, spacing, noise
            if line in used and (number := self.points(value, frame)[line]) > FEW_POINTS:
                length = math.hypot(ends[2] - ends[0], ends[3] - ends[1])
                how = "edge-points", length / (FEW_POINTS - 0.5), noise * math.sqrt(FEW_POINTS / number)
            known.append(line_noise(ends[None], *how))
            if line in used:
                fits.append(draw_line(ends, *how, draws, rng))
        errors = pose_errors(self.camera, self.frames, frame, fits, self.width)[:, self.column]
        sigma = pose_sigma(self.camera, self.frames[frame : frame + 1], known, self.width)[0, self.column]
        return float(percentiles(errors[:, None])[0, JUDGED] / (NORMAL[JUDGED] * sigma))

    def confirm(self, value: float, frame: int, draws: int, budget: int, seed: SeedSequence) -> _Check:
        """Every point of every line drawn, at a frame."""
        spacing, noise = self.setting(value)
        number = min(draws, budget // (2 * sum(self.points(value, frame))))
        if number < LEAST_DRAWS:
            return _Check(frame, 0, math.nan, math.nan)
        which, rng = LINES_OF_STAGE[self.frames.stage], default_rng(child(seed, frame))
        fits = draw_lines(self.frames.ends[frame], which, self.reading, spacing, noise, number, rng)
        errors = pose_errors(self.camera, self.frames, frame, fits, self.width)[:, self.column]
        within = float(np.mean(np.abs(errors) <= self.bound))
        return _Check(frame, number, float(percentiles(errors[:, None])[0, JUDGED]), within)


def _near_worst(ratios: Array) -> list[int]:
    """The first and the last of the other frames that come within a tenth of the worst."""
    near = set(np.flatnonzero(ratios >= 0.9 * ratios.max()).tolist()) - {int(np.argmax(ratios))}
    return sorted({min(near), max(near)}) if near else []
