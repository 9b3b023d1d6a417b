"""Where on the approach a bound holds with what a line is worth: to first order."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from estimator.so3 import Array
from landsim.budget.bias import believed, shifts
from landsim.budget.normal import bisected, bound_kept
from landsim.budget.requirements import Requirement
from landsim.budget.setting import Setting, frames_at, hand_over
from landsim.budget.solve import gains
from landsim.study.frames import Frames
from landsim.study.model import OF_STAGE, READINGS, Reading

GRID = 600
"""Distances of each stage at which a bound is looked at."""
FARTHEST_LATE = 1000.0
"""Where the threshold never is in the image, two lines are looked at from here on, m."""


class Course(NamedTuple):
    """First-order errors per px along the approach, one stage after the other."""

    distance: Array
    """(n,), falling, m."""
    gain: dict[Reading, Array]
    """(n, 6) of the quantities of the early stage, m/px and rad/px; NaN where one is not observed."""
    shift: Array
    """(n, 6), m and rad."""
    hand_over: float
    """m."""


def course(setting: Setting) -> Course:
    """The approach from where all three lines come into view, to the end of what is looked at."""
    over = hand_over(setting)
    end = _end(setting)
    distances = [np.empty(0), np.empty(0)]
    far = _farthest(setting, over) if math.isfinite(over) else over
    near = max(over, end) + 1e-6
    if math.isfinite(over) and far > near:
        distances[0] = near + (far - near) * np.linspace(1.0, 0.0, GRID) ** 2  # denser where the geometry changes fast
    begin = min(over - 1e-6, FARTHEST_LATE)
    if begin > end:
        distances[1] = np.linspace(begin, end, GRID)
    early = frames_at(setting, "early", distances[0])
    late = frames_at(setting, "late", distances[1])
    moved = [(frames, shifts(setting, frames)) for frames in (early, late)]
    return Course(
        distance=np.concatenate([frames.distance for frames, _ in moved]),
        gain={
            r: np.concatenate([_in_six(gains(setting, believed(setting, f, s), r), f) for f, s in moved])
            for r in READINGS
        },
        shift=np.concatenate([_in_six(s, f) for f, s in moved]),
        hand_over=over,
    )


def _in_six(values: Array, frames: Frames) -> Array:
    """The columns (n, k) of a stage's quantities among those of the early stage; NaN for the others."""
    names = OF_STAGE["early"]
    whole = np.full((len(frames), len(names)), np.nan)
    whole[:, [names.index(name) for name in OF_STAGE[frames.stage]]] = values
    return whole


def held(
    along: Course, requirement: Requirement, reading: Reading, noise_px: float, confidence: float
) -> list[tuple[float, float]]:
    """Where a bound holds with a σ of the points: stretches of the approach, from and to, m.

    The quantity need not be observed all the way; a stretch ends where it is not.
    """
    column = OF_STAGE["early"].index(requirement.quantity.name)
    kept = np.array(
        [
            bound_kept(noise_px * g, s, confidence) if math.isfinite(g) else math.nan
            for g, s in zip(along.gain[reading][:, column].tolist(), along.shift[:, column].tolist(), strict=True)
        ]
    )
    return list(_stretches(along.distance, kept, requirement.bound))


def _stretches(distance: Array, kept: Array, bound: float) -> Iterator[tuple[float, float]]:
    """Where kept does not exceed the bound; between two points the crossing is interpolated."""
    begin: float | None = None
    for i, value in enumerate(kept.tolist()):
        ok = value <= bound
        before = kept[i - 1] if i else math.nan
        if ok and begin is None:
            begin = _crossing(distance, kept, bound, i) if math.isfinite(before) else float(distance[i])
        elif not ok and begin is not None:
            yield begin, _crossing(distance, kept, bound, i) if math.isfinite(value) else float(distance[i - 1])
            begin = None
    if begin is not None:
        yield begin, float(distance[-1])


def _crossing(distance: Array, kept: Array, bound: float, i: int) -> float:
    """Between the points i - 1 and i, linear in the error."""
    share = (bound - kept[i - 1]) / (kept[i] - kept[i - 1])
    return float(distance[i - 1] + share * (distance[i] - distance[i - 1]))


def _farthest(setting: Setting, over: float) -> float:
    """The greatest distance at which all three lines are seen, without a gap from the hand-over on."""

    def seen(distance: float) -> bool:
        return bool(frames_at(setting, "early", np.array([distance])).seen()[0])

    near, far = over + 1e-3, over + 2e-3
    if not seen(near):
        return over
    while seen(far):
        near, far = far, over + 1.5 * (far - over)
        if far > 1e6:
            return near
    return bisected(seen, near, far)


def _end(setting: Setting) -> float:
    """Distance at which the camera has come down to the end height, or the runway ends, m."""
    end = -setting.runway.length
    if setting.glide_slope > 0.0:
        end = max(end, (setting.end_height - setting.threshold_height) / math.tan(setting.glide_slope))
    return end
