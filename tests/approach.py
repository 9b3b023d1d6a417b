"""The paper's straight approach as a scenario, and cameras of any attitude on it."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from estimator.so3 import Array
from landsim.config import load_scenario
from landsim.schema import Scenario

RANGES = (1000.0, 800.0, 600.0, 400.0, 200.0, 100.0, 60.0)
F = 12500.0 / 9.9
"""Focal length, px: 12.5 mm over 9.9 µm."""


def paper(**changes: object) -> Scenario:
    """From (-1000, 0, -60) m at 3° and 40 m/s; changes are keys with a double underscore for each dot."""
    settings: dict[str, object] = {"kind": "study", "study.ranges_m": list(RANGES), "start.speed_mps": 40.0}
    settings |= {key.replace("__", "."): value for key, value in changes.items()}
    return load_scenario("landing", overrides=settings)


def camera_rotation(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Array:
    """R_cam_from_runway (3, 3) by scipy, of angles in rad."""
    triad = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()  # columns forward, right, down
    return np.stack((triad[:, 1], triad[:, 2], triad[:, 0]))
