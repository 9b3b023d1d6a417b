"""Camera, runway and approach of a budget, and what the camera sees of the runway on the way.

The camera is on the straight glide slope, with no roll and no yaw, and pitched as it is in the stage: early while the
threshold is in the image at the early pitch, late from where it has passed out of it.
"""

import math
from dataclasses import dataclass

import numpy as np

from estimator.camera import PinholeCamera
from estimator.covariance import THRESHOLD
from estimator.so3 import Array
from landsim.config import Scenario
from landsim.errors import InputError
from landsim.runway import Runway
from landsim.schema import StudyConfig
from landsim.sensors import camera_of
from landsim.study.frames import LINES_OF_STAGE, Frames, look, pitched
from landsim.study.model import StageName
from landsim.units import DEG

LINE_NAMES = ("left edge", "threshold", "right edge")


@dataclass(frozen=True)
class Setting:
    """What decides how a noisy line becomes an error.

    Attributes
    ----------
    camera : PinholeCamera
    runway : Runway
    spacing_px, noise_px, near_m, min_line_px : float
        As in the scenario's ``[camera]``.
    cross : float
        Of the camera, right of the centreline, m.
    threshold_height : float
        Of the camera above the threshold when it passes it, m.
    glide_slope : float
        Downward, rad.
    pitch_early, pitch_late : float
        Of the camera to the runway, rad.
    end_height : float
        Of the camera where the approach is no longer looked at, m.
    roll_error : float
        By which the roll angle given to the late stage is off, rad.
    """

    camera: PinholeCamera
    runway: Runway
    spacing_px: float
    noise_px: float
    near_m: float
    min_line_px: float
    cross: float
    threshold_height: float
    glide_slope: float
    pitch_early: float
    pitch_late: float
    end_height: float
    roll_error: float = 0.0

    def height(self, distance: float) -> float:
        """Of the camera at a distance to the threshold, m."""
        return self.threshold_height + distance * math.tan(self.glide_slope)

    def pitch(self, stage: StageName) -> float:
        """Of the camera in a stage, rad."""
        return self.pitch_early if stage == "early" else self.pitch_late


def setting_of(scenario: Scenario, roll_error: float = 0.0) -> Setting:
    """The setting of a scenario.

    A study says the straight approach and the camera's pitch.  For a flight they are those of a steady descent along
    ``[approach]``: the body's pitch is its angle of attack in trim less the glide slope, and the camera's is that less
    the mount's tilt.

    Parameters
    ----------
    scenario : Scenario
    roll_error : float
        By which the roll angle given to the late stage is off, rad.
    """
    start, approach, study, aircraft = scenario.start, scenario.approach, scenario.study, scenario.aircraft_config
    if study is not None:
        slope, cross = -start.flight_path_deg * DEG, start.cross_m
        threshold_height = start.height_m + start.along_m * math.tan(slope)
        pitch_early, pitch_late, end_height = study.pitch_early_deg, study.pitch_late_deg, study.end_height_m
    else:
        slope, cross = approach.glide_slope_deg * DEG, 0.0
        threshold_height = approach.aim_point_m * math.tan(slope)
        body = aircraft.guidance.approach.trim_alpha_deg - approach.glide_slope_deg
        pitch_early, pitch_late = body - aircraft.mount.tilt_early_deg, body - aircraft.mount.tilt_late_deg
        end_height = float(StudyConfig.model_fields["end_height_m"].default)
    return Setting(
        camera=camera_of(scenario.camera),
        runway=Runway(length=scenario.runway.length_m, width=scenario.runway.width_m),
        spacing_px=scenario.camera.point_spacing_px,
        noise_px=scenario.camera.noise_px,
        near_m=scenario.camera.near_m,
        min_line_px=scenario.camera.min_line_px,
        cross=cross,
        threshold_height=threshold_height,
        glide_slope=slope,
        pitch_early=pitch_early * DEG,
        pitch_late=pitch_late * DEG,
        end_height=end_height,
        roll_error=roll_error,
    )


def frames_at(setting: Setting, stage: StageName, distances: Array) -> Frames:
    """What the camera sees at distances (n,) to the threshold, in a stage.

    Returns
    -------
    Frames
        NaN for a line that is not in the image; without times.
    """
    pitch, n = setting.pitch(stage), distances.size
    rotation = pitched(pitch)
    ends, position = np.empty((n, 3, 4)), np.empty((n, 3))
    for i, distance in enumerate(distances.tolist()):
        position[i] = -distance, setting.cross, -setting.height(distance)
        ends[i] = look(
            setting.camera, setting.runway, position[i].tolist(), rotation, setting.near_m, setting.min_line_px
        )
    return Frames(stage, np.full(n, np.nan), position, np.full(n, pitch), np.tile(rotation, (n, 1, 1)), ends)


def stage_at(setting: Setting, distance: float) -> StageName | None:
    """The stage at a distance: late if the threshold has passed out of the image below, early if it is seen.

    None where the threshold is not in the image for another reason, told by `why_not_seen`.
    """
    if np.isfinite(frames_at(setting, "early", np.array([distance])).ends[0, THRESHOLD]).all():
        return "early"
    return "late" if _below(setting, distance) else None


def why_not_seen(setting: Setting, distance: float) -> str | None:
    """Why the pose of a requirement's stage cannot be had at a distance, in words; None if it can."""
    where = f"at {distance:g} m"
    if not setting.height(distance) > 0.0:
        return f"{where} the straight approach has {_end_of_path(setting)}"
    stage = stage_at(setting, distance)
    pitch = f"with the camera pitched {setting.pitch(stage or 'early') / DEG:.4g}°"
    if stage is None:
        return f"{where} the threshold is not in view {pitch}: it is {_place_of_threshold(setting, distance)}"
    frames = frames_at(setting, stage, np.array([distance]))
    for line in LINES_OF_STAGE[stage]:
        if not np.isfinite(frames.ends[0, line]).all():
            return f"{where}, in the {stage} stage, the {LINE_NAMES[line]} is not in view {pitch}"
    return None


def hand_over(setting: Setting) -> float:
    """Distance at which the threshold passes out of the image, at the early pitch, m."""
    far = -setting.runway.length
    near = far
    step = 1.0
    while _below(setting, far):
        near, far, step = far, far + step, 1.5 * step
        if far > 1e7:
            return math.inf
    for _ in range(60):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if _below(setting, middle) else (near, middle)
    return 0.5 * (near + far)


def required_stage(setting: Setting, name: str, distance: float, source: str) -> StageName:
    """The stage in which a quantity is had at a distance.

    Raises
    ------
    InputError
        If the pose cannot be had there, or the quantity is not observed in the stage there.
    """
    why = why_not_seen(setting, distance)
    stage = None if why else stage_at(setting, distance)
    if stage is None:
        raise InputError(f"{source}: {why}")
    if stage == "late" and name in {"roll", "along"}:
        raise InputError(
            f"{source}: two edges do not tell {name}: below {hand_over(setting):.4g} m the threshold is out of the"
            " image; pitch, yaw, cross and altitude can be asked for there"
        )
    return stage


def _below(setting: Setting, distance: float) -> bool:
    """Whether all of the threshold is behind the camera or below the image, at the early pitch."""
    rotation = pitched(setting.pitch_early)
    centre = np.array((-distance, setting.cross, -setting.height(distance)))
    for point in setting.runway.threshold:
        _, down, depth = (rotation @ (np.asarray(point) - centre)).tolist()
        v_bottom = setting.camera.height - 0.5
        if depth >= setting.near_m and setting.camera.fy * down / depth + setting.camera.cy <= v_bottom:
            return False
    return True


def _place_of_threshold(setting: Setting, distance: float) -> str:
    camera, rotation = setting.camera, pitched(setting.pitch_early)
    centre = np.array((-distance, setting.cross, -setting.height(distance)))
    left, right = (rotation @ (np.asarray(point) - centre) for point in setting.runway.threshold)
    seen = camera.clip(tuple(left.tolist()), tuple(right.tolist()), setting.near_m)
    if seen is not None:
        length = math.hypot(seen[2] - seen[0], seen[3] - seen[1])
        return f"{length:.1f} px long, below camera.min_line_px = {setting.min_line_px:g}"
    middle = camera.project(0.5 * (left + right))
    return "above the image" if middle[1] < 0.0 else "beside the image"


def _end_of_path(setting: Setting) -> str:
    if setting.glide_slope <= 0.0:
        return "not left the ground"
    past = setting.threshold_height / math.tan(setting.glide_slope)
    return f"met the ground: it does so {past:.4g} m past the threshold"
