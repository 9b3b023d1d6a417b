"""What ties the errors of one pose together: cross to yaw, altitude to pitch, and late everything to the roll angle.

Late, two planes of the edges are known and the angle about the runway's axis is given.  A roll error δ turns the pair
of planes about that axis: to first order the lateral estimate moves by (h + L²/(4h)) δ at a camera height h over the
centreline of a runway L wide.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import ArrayLike

from estimator.lines import fit_line
from estimator.so3 import Array
from estimator.two_line import two_line_pose
from landsim.config import Scenario
from landsim.sensors import camera_of
from landsim.study.draws import draw_lines, pose_errors
from landsim.study.envelope import child, percentiles
from landsim.study.frames import LINES_OF_STAGE, Frames, at_distances
from landsim.study.model import LEVELS, OF_STAGE, Reading

LEVEL = 95.0
"""At which a bound has to hold, %."""

GREATEST_ROLL = math.radians(20.0)
"""No roll error beyond it is looked at."""
CORRECTIONS = 4
"""Steps from the first-order roll limit to the sampled one, at most."""
CLOSE = 0.005
"""Of the bound: nearer than this a limit needs no further step."""


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
        Of either sign, rad; None where the bound does not hold with the true roll.
    beyond : bool
        Whether the bound still holds at `GREATEST_ROLL`, which ``roll_error`` then is.
    distance, height : float
        Of the frame that decides, m.
    ratio : float
        95th percentile of the error there over the bound, at ``roll_error`` (0 where that is None), from independent
        draws.
    draws : int
        Behind ``ratio``.
    """

    quantity: str
    reading: Reading
    bound: float
    roll_error: float | None
    beyond: bool
    distance: float
    height: float
    ratio: float
    draws: int


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
    cross_yaw_correlation, altitude_pitch_correlation : float
    """

    reading: Reading
    distance: float
    cross_over_yaw: float
    altitude_over_pitch: float
    cross_yaw_correlation: float
    altitude_pitch_correlation: float


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
        For the confirmation.
    seed : SeedSequence
        Not spawned from.
    """
    column = OF_STAGE["late"].index(quantity)
    spread = sigma[:, column]

    def ratios(roll_error: float) -> Array:
        p95 = biased_percentile(roll_bias(scenario, frames, roll_error)[:, column], spread)
        return np.where(np.isfinite(p95), p95, np.inf) / bound

    def ratio_of(i: int, roll_error: float, kind: int) -> float:
        rng = default_rng(child(seed, kind))
        camera, settings = camera_of(scenario.camera), scenario.camera
        fits = draw_lines(
            frames.ends[i], LINES_OF_STAGE["late"], reading, settings.point_spacing_px, settings.noise_px, draws, rng
        )
        errors = pose_errors(camera, frames, i, fits, scenario.runway.width_m, roll_error)
        return float(percentiles(errors, (LEVEL,))[column, 0]) / bound

    def limit(roll_error: float | None, beyond: bool, i: int) -> RollLimit:
        return RollLimit(
            quantity,
            reading,
            bound,
            roll_error,
            beyond,
            float(frames.distance[i]),
            float(frames.height[i]),
            ratio_of(i, roll_error or 0.0, 1),
            draws,
        )

    if ratios(0.0).max() > 1.0:
        return limit(None, False, int(np.argmax(ratios(0.0))))
    if ratios(GREATEST_ROLL).max() <= 1.0:
        return limit(GREATEST_ROLL, True, int(np.argmax(ratios(GREATEST_ROLL))))
    low, high = 0.0, GREATEST_ROLL
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if ratios(middle).max() > 1.0 else (middle, high)
    i = int(np.argmax(ratios(low)))
    for _ in range(CORRECTIONS):
        off = ratio_of(i, low, 0) - 1.0
        if abs(off) < CLOSE:
            break
        step = 0.01 * low
        slope = float(ratios(low + step)[i] - ratios(low - step)[i]) / (2.0 * step)
        low = min(max(low - off / slope, 0.0), GREATEST_ROLL)
    return limit(low, False, i)


def proportions(
    scenario: Scenario, reading: Reading, distances: ArrayLike, draws: int, seed: SeedSequence
) -> tuple[Proportion, ...]:
    """How cross goes with yaw and altitude with pitch in the early stage, at given distances to the threshold, m."""
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
        found.append(
            Proportion(
                reading,
                distance,
                p68["cross"] / p68["yaw"] / distance,
                p68["altitude"] / p68["pitch"] / distance,
                float(np.corrcoef(of["cross"], of["yaw"])[0, 1]),
                float(np.corrcoef(of["altitude"], of["pitch"])[0, 1]),
            )
        )
    return tuple(found)
