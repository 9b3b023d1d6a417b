"""The true state as guidance is given it: what it knows of motion, turn and push, each with its sign."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from landsim.omniscient import true_state
from landsim.truth import NUMBERS, Truth

DT = 1.0 / 120.0
RATE = (0.1, -0.2, 0.3)
"""Of the body, rad/s."""
ANGLES = (0.3, -0.05, 0.2)
"""Yaw, pitch, roll, rad."""


def motion(attitude: Rotation) -> np.ndarray:
    numbers = np.zeros(NUMBERS)
    numbers[:6] = (-300.0, 4.0, -25.0, 39.0, -2.0, 1.5)
    numbers[6:15] = attitude.as_matrix().ravel()
    return numbers


@pytest.mark.parametrize("side_force", [1.5, -0.7])
def test_the_truth_is_handed_on_with_its_signs(side_force: float) -> None:
    now = Rotation.from_euler("ZYX", ANGLES)
    before = now * Rotation.from_rotvec(np.multiply(RATE, DT)).inv()
    state = true_state(Truth(8.0, motion(now), 41.0), motion(before), DT, 40.0, side_force)
    assert state.ready
    assert (state.time, state.airspeed, state.side_force) == (8.0, 40.0, side_force)  # the tube's, not the true one
    assert (state.position, state.velocity) == ((-300.0, 4.0, -25.0), (39.0, -2.0, 1.5))
    assert state.R_runway_from_body == pytest.approx(now.as_matrix().ravel())
    assert (state.yaw, state.pitch, state.roll) == pytest.approx(ANGLES)
    assert state.rate == pytest.approx(RATE, rel=1e-6)
