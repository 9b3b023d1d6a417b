"""The straight approach: where the camera is at each frame, and what it sees of the runway without noise.

The camera begins at the means of ``start`` and moves along the runway at the approach speed, down (or up)
``start.flight_path_deg``.  It neither rolls nor yaws, and its pitch is that of the stage.  The hand-over is latched:
the early stage ends for good with the first frame in which the threshold line, having been there, is no longer in the
image.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.camera import PinholeCamera
from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.so3 import Array, Vec3
from landsim.config import Scenario
from landsim.errors import ScenarioError
from landsim.runway import Runway
from landsim.scene import runway_of
from landsim.schema import StudyConfig
from landsim.sensors import camera_of
from landsim.study.model import StageName
from landsim.units import DEG

LINES_OF_STAGE: dict[StageName, tuple[int, ...]] = {"early": (LEFT, THRESHOLD, RIGHT), "late": (LEFT, RIGHT)}
"""Which lines the pose of a stage is made of."""
MOST_FRAMES = 100_000
"""More than this is no approach."""


@dataclass(frozen=True)
class Frames:
    """Camera frames of one stage, without noise; n of them, in the order of time.

    Attributes
    ----------
    stage : {"early", "late"}
    time : (n,) array
        s since the start.
    position : (n, 3) array
        Of the camera, runway frame, m.
    pitch : (n,) array
        Of the camera, rad.
    R_cam_from_runway : (n, 3, 3) array
    ends : (n, 3, 4) array
        u0, v0, u1, v1 of left edge, threshold and right edge as projected and clipped, px; NaN where not seen.
    """

    stage: StageName
    time: Array
    position: Array
    pitch: Array
    R_cam_from_runway: Array
    ends: Array

    @property
    def distance(self) -> Array:
        """From the camera forward to the threshold, m; negative past it."""
        return np.asarray(0.0 - self.position[:, 0])  # and not -0.0

    @property
    def height(self) -> Array:
        """Of the camera above the runway, m."""
        return np.asarray(-self.position[:, 2])

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, chosen: slice | Sequence[int] | NDArray[Any]) -> "Frames":
        """Some of the frames: a slice, indices or a mask."""
        return Frames(
            self.stage,
            self.time[chosen],
            self.position[chosen],
            self.pitch[chosen],
            self.R_cam_from_runway[chosen],
            self.ends[chosen],
        )

    def seen(self) -> NDArray[np.bool_]:
        """Where all lines that the stage's pose is made of are seen, (n,) bool."""
        return np.asarray(np.isfinite(self.ends[:, LINES_OF_STAGE[self.stage]]).all(axis=(1, 2)))


def straight_approach(scenario: Scenario) -> tuple[Frames, Frames]:
    """The early and the late frames of a scenario's straight approach, one every ``1 / camera.rate_hz``.

    The late stage ends with the last frame in which the camera is not below ``study.end_height_m``, or with the end of
    the runway.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``study``.

    Returns
    -------
    early, late : Frames
        Either may be empty.

    Raises
    ------
    ScenarioError
        If there is no frame, or if there are more than `MOST_FRAMES`.
    """
    study, camera, runway = _study_of(scenario), camera_of(scenario.camera), runway_of(scenario)
    forward, down = _velocity(scenario)
    dt = 1.0 / scenario.camera.rate_hz
    duration = (runway.length - scenario.start.along_m) / forward
    if down > 0.0:
        duration = min(duration, (scenario.start.height_m - study.end_height_m) / down)
    if duration < 0.0:
        raise ScenarioError(
            f"{scenario.path}: study.end_height_m: must be below start.height_m = {scenario.start.height_m:g}, "
            f"not {study.end_height_m:g}"
        )
    if duration / dt >= MOST_FRAMES:
        raise ScenarioError(
            f"{scenario.path}: start.speed_mps: an approach of {duration:.0f} s has more than {MOST_FRAMES} frames; "
            "a greater speed, a nearer start or a lower camera.rate_hz"
        )
    # a whole number of frames to rounding is a whole number
    time = np.arange(math.floor(duration / dt + 1e-9) + 1, dtype=float) * dt
    position = _position(scenario, time)
    early = _frames(scenario, camera, runway, "early", time, position, study.pitch_early_deg * DEG)
    in_view = np.isfinite(early.ends[:, THRESHOLD]).all(axis=1)
    left = np.flatnonzero(~in_view & np.logical_or.accumulate(in_view))
    over = (left[0] if left.size else time.size) if in_view.any() else 0
    late = _frames(scenario, camera, runway, "late", time[over:], position[over:], study.pitch_late_deg * DEG)
    return early[:over], late


def at_distances(scenario: Scenario, stage: StageName, distances: ArrayLike, pitch: float | None = None) -> Frames:
    """Frames of the same straight path at given distances to the threshold.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``study``.
    stage : {"early", "late"}
        Wherever the hand-over is on the way.
    distances : (n,) array_like
        m, negative past the threshold.
    pitch : float, optional
        Of the camera, rad; without it, the stage's.

    Returns
    -------
    Frames
        In the order of the distances.  A line that is not in the image is NaN there, and so is each where the path is
        not above the runway.
    """
    study = _study_of(scenario)
    if pitch is None:
        pitch = (study.pitch_early_deg if stage == "early" else study.pitch_late_deg) * DEG
    ahead = -np.atleast_1d(np.asarray(distances, float)) - scenario.start.along_m
    time: Array = ahead / _velocity(scenario)[0]
    return _frames(
        scenario, camera_of(scenario.camera), runway_of(scenario), stage, time, _position(scenario, time), pitch
    )


def look(
    camera: PinholeCamera,
    runway: Runway,
    position: Sequence[float],
    R_cam_from_runway: ArrayLike,
    near_m: float,
    min_line_px: float,
) -> Array:
    """What is seen of the runway's lines: u0, v0, u1, v1 of left edge, threshold and right edge.

    Parameters
    ----------
    camera : PinholeCamera
    runway : Runway
    position : (3,) float
        Of the camera, runway frame, m.
    R_cam_from_runway : (3, 3) array_like
    near_m : float
        Smallest depth that is seen, m.
    min_line_px : float
        A shorter line is not seen.

    Returns
    -------
    (3, 4) array
        px; NaN for a line that is not seen, and for all where the camera is not above the runway.
    """
    rotation, centre = np.asarray(R_cam_from_runway, float), np.asarray(position, float)
    ends = np.full((3, 4), np.nan)
    if not centre[2] < 0.0:
        return ends
    for i, segment in enumerate((runway.left_edge, runway.threshold, runway.right_edge)):
        start, end = ((np.asarray(segment) - centre) @ rotation.T).tolist()
        seen = camera.clip(start, end, near_m)
        if seen is not None and math.hypot(seen[2] - seen[0], seen[3] - seen[1]) >= min_line_px:
            ends[i] = seen
    return ends


def pitched(pitch: float) -> Array:
    """R_cam_from_runway (3, 3) of a camera that neither rolls nor yaws: its rows are right, down and forward."""
    s, c = math.sin(pitch), math.cos(pitch)
    return np.array(((0.0, 1.0, 0.0), (s, 0.0, c), (c, 0.0, -s)))


def _study_of(scenario: Scenario) -> StudyConfig:
    if scenario.study is None:
        raise ValueError(f"{scenario.name}: a scenario of the kind {scenario.kind!r} has no straight approach")
    return scenario.study


def _velocity(scenario: Scenario) -> tuple[float, float]:
    """Forward and down, m/s."""
    start = scenario.start
    speed = scenario.aircraft_config.speeds.approach_mps if start.speed_mps is None else start.speed_mps
    angle = start.flight_path_deg * DEG
    return speed * math.cos(angle), -speed * math.sin(angle)


def _position(scenario: Scenario, time: Array) -> Array:
    """Of the camera (n, 3), runway frame, m."""
    start, (forward, down) = scenario.start, _velocity(scenario)
    first: Vec3 = (start.along_m, start.cross_m, -start.height_m)
    return np.asarray(first + time[:, None] * np.array((forward, 0.0, down)))


def _frames(
    scenario: Scenario,
    camera: PinholeCamera,
    runway: Runway,
    stage: StageName,
    time: Array,
    position: Array,
    pitch: float,
) -> Frames:
    rotation, settings, n = pitched(pitch), scenario.camera, time.size
    ends = np.full((n, 3, 4), np.nan)
    for i, where in enumerate(position):
        ends[i] = look(camera, runway, where, rotation, settings.near_m, settings.min_line_px)
    return Frames(stage, time, position, np.full(n, pitch), np.tile(rotation, (n, 1, 1)), ends)
