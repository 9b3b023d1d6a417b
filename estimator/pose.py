"""What the two solvers return."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.so3 import Array


@dataclass(frozen=True, slots=True)
class ThreeLinePose:
    """Pose of the camera from both edges and the threshold; NaN where `valid` is False.

    Attributes
    ----------
    position : (..., 3) array
        Of the projection centre, runway frame, m.
    R_cam_from_runway : (..., 3, 3) array
        Takes runway vectors to the camera frame.
    yaw, pitch, roll : (...) array
        Of the camera triad relative to the runway frame, rad.
    valid : (...) bool array
    """

    position: Array
    R_cam_from_runway: Array
    yaw: Array
    pitch: Array
    roll: Array
    valid: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TwoLinePose:
    """What both edges and a roll angle give; NaN where `valid` is False.

    Attributes
    ----------
    yaw, pitch : (...) array
        Of the camera triad relative to the runway frame, rad.
    lateral, height : (...) array
        Right of the centreline and above the runway, m.
    valid : (...) bool array
    """

    yaw: Array
    pitch: Array
    lateral: Array
    height: Array
    valid: NDArray[np.bool_]
