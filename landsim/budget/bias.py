"""What a wrong roll angle makes of the late pose when the lines have no noise.

The two-line solver itself says it, and not its derivative: on the centreline altitude does not move to first order,
and 2 m above a runway 30 m wide a roll angle 2° off still costs 0.13 m.  Nor has the solver a solution for every roll
angle: one that is off by more than an edge of the runway is below the horizon puts that edge above it.
"""

from dataclasses import replace

import numpy as np

from estimator.lines import fit_line
from estimator.mount import camera_axes
from estimator.so3 import Array, from_euler
from landsim.budget.setting import Setting
from landsim.study.draws import pose_errors
from landsim.study.frames import LINES_OF_STAGE, Frames
from landsim.study.model import OF_STAGE


def shifts(setting: Setting, frames: Frames) -> Array:
    """Errors (n, k) of the frames' pose from lines without noise and the setting's roll error, estimate less truth.

    Returns
    -------
    (n, k) array
        Of the quantities ``OF_STAGE[frames.stage]``, rad and m: zero early, where the roll is not given; NaN where the
        lines are not seen or the solver has no solution.
    """
    shift = np.zeros((len(frames), len(OF_STAGE[frames.stage])))
    if frames.stage == "early" or setting.roll_error == 0.0:
        return shift
    for i, seen in enumerate(frames.seen().tolist()):
        shift[i] = np.nan
        if seen:
            fits = [fit_line(frames.ends[i, line].reshape(1, 2, 2)) for line in LINES_OF_STAGE["late"]]
            shift[i] = pose_errors(setting.camera, frames, i, fits, setting.runway.width, setting.roll_error)[0]
    return shift


def believed(setting: Setting, frames: Frames, shift: Array) -> Frames:
    """The same lines from where the shifted pose has the camera: what noise does is told there.

    The pose of given lines and a given roll angle changes with the lines as it would for a camera that truly is at that
    pose, since such a camera sees those lines.
    """
    if frames.stage == "early" or setting.roll_error == 0.0:
        return frames
    of = dict(zip(OF_STAGE["late"], shift.T, strict=True))
    pitch = frames.pitch + of["pitch"]
    position = frames.position + np.stack((np.zeros(len(frames)), of["cross"], -of["altitude"]), axis=-1)
    rotation = np.array(
        [camera_axes(from_euler(setting.roll_error, p, y), 0.0) for p, y in zip(pitch, of["yaw"], strict=True)]
    ).reshape(-1, 3, 3)
    return replace(frames, position=position, pitch=pitch, R_cam_from_runway=rotation)
