"""Time a frame of the two solvers, beside what the paper states for its own."""

import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np

from estimator.so3 import Array
from estimator.three_line import three_line_pose
from estimator.two_line import two_line_pose
from landsim.config import Scenario
from landsim.sensors import camera_of
from landsim.study.frames import Frames, straight_approach
from landsim.study.model import StageName

PAPER_MS: dict[StageName, float] = {"early": 1.3, "late": 0.2}
"""Time a frame that the paper states; on what machine and in what language it does not say."""
SHARE = 0.25
"""Of the paper's time that a single solve may take."""
BATCH_US = 1.0
"""That a frame of a batch may take."""

Clock = Callable[[], float]


def timing(
    scenario: Scenario,
    *,
    repeats: int = 25,
    calls: int = 200,
    batch: int = 1000,
    clock: Clock = time.perf_counter,
) -> dict[str, Any]:
    """Time a frame, single and in a batch, from lines to a pose.

    Parameters
    ----------
    scenario : Scenario
        A study; the frame in the middle of each stage of its straight approach is solved.
    repeats : int
        Of which the median is reported, with the fastest and the slowest.
    calls : int
        Single solves a repeat, of which the mean is taken.
    batch : int
        Frames of the batch.
    clock : callable
        s; how it is measured is the one thing in this package that is not repeatable.

    Returns
    -------
    dict
        By stage: ``paper_ms``, ``single_us`` with its fastest and slowest repeat, ``share_of_paper``, ``batch_us`` a
        frame, and whether each meets its target.  A stage that the approach does not have says so in ``omitted``.
    """
    result: dict[str, Any] = {"repeats": repeats, "calls_per_repeat": calls, "batch_frames": batch}
    camera, width = camera_of(scenario.camera), scenario.runway.width_m
    for frames in straight_approach(scenario):
        stage = frames.stage
        seen = np.flatnonzero(frames.seen())
        if not seen.size:
            result[stage] = {"omitted": "no frame of the approach shows all lines of this stage"}
            continue
        left, threshold, right = _lines(frames, int(seen[seen.size // 2]))
        many = [np.tile(line, (batch, 1)) for line in (left, threshold, right)]

        # a single frame and the batch are both solved by the public functions, checks and all
        def single(
            stage: StageName = stage, left: Array = left, threshold: Array = threshold, right: Array = right
        ) -> object:
            if stage == "early":
                return three_line_pose(camera, left, threshold, right, runway_width=width)
            return two_line_pose(camera, left, right, runway_width=width, roll=0.0)

        def at_once(stage: StageName = stage, many: list[Array] = many) -> object:
            if stage == "early":
                return three_line_pose(camera, *many, runway_width=width)
            return two_line_pose(camera, many[0], many[2], runway_width=width, roll=0.0)

        one = [1e6 * t for t in measured(single, repeats, calls, clock)]
        whole = [1e6 * t / batch for t in measured(at_once, repeats, max(1, calls // 50), clock)]
        result[stage] = _entry(stage, one, whole)
    return {**result, "text": _text(result)}


def measured(function: Callable[[], object], repeats: int, calls: int, clock: Clock) -> list[float]:
    """Mean time of a call, s, of each of several repeats."""
    function()
    times = []
    for _ in range(repeats):
        start = clock()
        for _ in range(calls):
            function()
        times.append((clock() - start) / calls)
    return times


def _lines(frames: Frames, i: int) -> tuple[Array, Array, Array]:
    """The noise-free lines of a frame, px; NaN for one that is not seen."""
    u0, v0, u1, v1 = np.moveaxis(frames.ends[i], -1, 0)
    a, b, c = np.stack((v0 - v1, u1 - u0, u0 * v1 - u1 * v0), axis=-1)
    return a, b, c


def _entry(stage: StageName, one: list[float], whole: list[float]) -> dict[str, Any]:
    single, batch, paper = median(one), median(whole), PAPER_MS[stage]
    share = single / (1e3 * paper)
    return {
        "paper_ms": paper,
        "single_us": single,
        "single_fastest_us": min(one),
        "single_slowest_us": max(one),
        "share_of_paper": share,
        "share_allowed": SHARE,
        "single_meets": share <= SHARE,
        "batch_us": batch,
        "batch_allowed_us": BATCH_US,
        "batch_meets": batch <= BATCH_US,
    }


def _text(result: dict[str, Any]) -> str:
    stages = [stage for stage in PAPER_MS if "single_us" in result[stage]]
    if not stages:
        return "Time a frame: no frame of the approach shows the lines."
    words = [
        f"{stage} {result[stage]['single_us']:.0f} µs against the paper's {result[stage]['paper_ms']:g} ms "
        f"({result[stage]['share_of_paper']:.1%}), {result[stage]['batch_us']:.2f} µs in a batch of "
        f"{result['batch_frames']}"
        for stage in stages
    ]
    return f"Time a frame from lines to pose, median of {result['repeats']} repeats: {'; '.join(words)}."
