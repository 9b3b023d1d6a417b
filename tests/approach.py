"""The paper's straight approach as a scenario, and cameras of any attitude on it."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from estimator.so3 import Array
from landsim.config import load_scenario
from landsim.schema import Scenario
from landsim.study.model import Reading

RANGES = (1000.0, 800.0, 600.0, 400.0, 200.0, 100.0, 60.0)
F = 12500.0 / 9.9
"""Focal length, px: 12.5 mm over 9.9 µm."""

# Source: an independent prototype, 50,000 draws; 68.27th percentile of the absolute error, runway 2000 m by 30 m,
# camera on the centreline.  roll, pitch, yaw (deg), cross, altitude, along (m).
PROTOTYPE: dict[tuple[float, Reading], tuple[float, ...]] = {
    (1000.0, "endpoints"): (3.03, 0.296, 0.176, 3.82, 6.89, 56.0),
    (1000.0, "edge-points"): (1.18, 0.0928, 0.0664, 1.44, 2.32, 15.3),
    (400.0, "endpoints"): (1.21, 0.119, 0.0892, 0.982, 1.16, 10.5),
    (400.0, "edge-points"): (0.304, 0.0274, 0.0215, 0.251, 0.303, 2.15),
    (200.0, "endpoints"): (0.606, 0.0783, 0.0732, 0.455, 0.386, 3.26),
    (200.0, "edge-points"): (0.107, 0.0140, 0.0130, 0.0886, 0.0805, 0.500),
    (60.0, "edge-points"): (0.0181, 0.00597, 0.00852, 0.0187, 0.0108, 0.0369),
}


def paper(**changes: object) -> Scenario:
    """From (-1000, 0, -60) m at 3° and 40 m/s; changes are keys with a double underscore for each dot."""
    settings: dict[str, object] = {"kind": "study", "study.ranges_m": list(RANGES), "start.speed_mps": 40.0}
    settings |= {key.replace("__", "."): value for key, value in changes.items()}
    return load_scenario("landing", overrides=settings)


def camera_rotation(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Array:
    """R_cam_from_runway (3, 3) by scipy, of angles in rad."""
    triad = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()  # columns forward, right, down
    return np.stack((triad[:, 1], triad[:, 2], triad[:, 0]))
