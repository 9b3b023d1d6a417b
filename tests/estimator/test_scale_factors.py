"""Scale factors of the inertial unit as constants of the filter, against what they do to a mechanisation by hand."""

import flight
import numpy as np
import pytest
from numpy.random import default_rng
from outside import PAPER, WIDTH
from scipy.spatial.transform import Rotation
from test_fusion import drawn_start

from estimator.alignment import Start
from estimator.line_fusion import SCALED, LineVisionFilter, with_constants
from estimator.single_lines import AUGMENTED, CONSTANTS, gates_of
from estimator.so3 import Array
from estimator.strapdown import ACCEL_BIAS, Inertial, advance, predicted_with_constants

DT = 1.0 / 120.0
ATTITUDE = Rotation.from_euler("ZYX", (0.2, -0.05, 0.3))
STATE = Inertial((-500.0, 10.0, -30.0), (39.0, 2.0, 1.5), tuple(ATTITUDE.as_matrix().ravel().tolist()))
SAMPLES = default_rng(4).normal((0.001, -0.002, 0.0015, 0.02, -0.01, -0.08), 0.0002, (4, 6))
"""A turn by ten degrees a second and more, so that every axis counts."""


def carried_on(scale: Array) -> Array:
    """The state (18,) after the samples, of which the share `scale` is not true."""
    nominal = STATE.numbers()
    for sample in SAMPLES:
        nominal = advance(nominal, np.zeros(6), sample * (1.0 - scale), flight.SITE.numbers(), DT)
    return nominal


def error(true: Array, estimated: Array) -> Array:
    """Of position, velocity and attitude (9,), true less estimated."""
    R, S = (Rotation.from_matrix(n[6:15].reshape(3, 3)) for n in (true, estimated))
    return np.concatenate((true[:6] - estimated[:6], (R * S.inv()).as_rotvec()))


@pytest.mark.parametrize("axis", range(6))
def test_what_a_scale_factor_does_within_the_time_between_frames(axis: int) -> None:
    step = np.zeros(6)
    step[axis] = 1e-4
    plain = carried_on(np.zeros(6))
    expected = (error(carried_on(step), plain) - error(carried_on(-step), plain)) / 2e-4
    # one unit of that scale factor alone, known to be off: the covariance is then the square of what it does
    P = np.zeros((SCALED, SCALED))
    P[AUGMENTED + axis, AUGMENTED + axis] = 1.0
    turned = SAMPLES.sum(axis=0)
    _, after = predicted_with_constants(plain, P, np.zeros((15, 15)), 4 * DT, turned, AUGMENTED)
    done = after[:9, AUGMENTED + axis]
    size = max(np.abs(SAMPLES[:, axis]).sum(), 1e-3)
    assert np.abs(done[6:] - expected[6:]).max() < 0.03 * size  # the attitude turns meanwhile
    assert np.abs(done[6:] if axis < 3 else done[3:6]).max() > 0.5 * size
    if axis >= 3:  # what a gyro does to the velocity within the time is left to the next, by way of the attitude
        assert np.abs(done[3:6] - expected[3:6]).max() < 0.03 * size
        assert np.abs(done[:3] - expected[:3]).max() < 0.06 * size * 4 * DT
    assert after[:15, :15] == pytest.approx(np.outer(np.append(done, np.zeros(6)), np.append(done, np.zeros(6))))


def test_constants_move_nothing_and_stay() -> None:
    rng = default_rng(5)
    root = rng.normal(size=(AUGMENTED, AUGMENTED))
    P, Q, turned = root @ root.T, np.zeros((15, 15)), SAMPLES.sum(axis=0)
    plain = carried_on(np.zeros(6))
    _, small = predicted_with_constants(plain, P, Q, 4 * DT, turned, AUGMENTED)
    larger = np.zeros((SCALED, SCALED))
    larger[:AUGMENTED, :AUGMENTED] = P
    _, large = predicted_with_constants(plain, larger, Q, 4 * DT, turned, AUGMENTED)
    assert large[:AUGMENTED, :AUGMENTED] == pytest.approx(small, rel=1e-12, abs=1e-12)
    assert small[15:, 15:] == pytest.approx(P[15:, 15:], rel=1e-12)


def test_a_start_has_gravity_share_once() -> None:
    """Bias by itself 3, scale factor times gravity 4: 5 before, 3 and the scale factor after."""
    noise = flight.IMU._replace(accel_bias=5e-3, scale_factor=4e-4)
    start = Start(STATE, np.diag(np.full(15, 25e-6)))
    covariance = with_constants(start, np.zeros(CONSTANTS), noise, 10.0).covariance
    assert len(covariance) == SCALED
    assert np.diag(covariance)[ACCEL_BIAS] == pytest.approx(9e-6)
    assert np.diag(covariance)[AUGMENTED:] == pytest.approx(16e-8)
    assert len(with_constants(start, np.zeros(CONSTANTS), flight.IMU, 10.0).covariance) == AUGMENTED


def test_bias_and_scale_factor_together_are_what_the_unit_is_off_by() -> None:
    noise = flight.IMU._replace(accel_bias=5e-3, scale_factor=4e-4)
    start = with_constants(Start(STATE, np.diag(np.full(15, 25e-6))), np.zeros(CONSTANTS), noise, 10.0)
    running = LineVisionFilter(PAPER, WIDTH, flight.MOUNT, flight.SITE, noise, gates_of(1e-6), start)
    running.scale_factor = np.array((1e-3, 0.0, 0.0, 0.0, 0.0, 2e-3))
    rate = np.array((0.1, 0.0, 0.0, 0.0, 0.0, -10.0))
    bias, covariance = running.biases(rate, running.augmented_covariance)
    assert bias == pytest.approx((1e-4, 0.0, 0.0, 0.0, 0.0, -0.02))
    assert np.diag(covariance)[9:] == pytest.approx((25e-6 + 16e-10, 25e-6, 25e-6, 9e-6, 9e-6, 25e-6))
    assert running.unscaled(rate) == pytest.approx((0.0999, 0.0, 0.0, 0.0, 0.0, -9.98))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_they_are_found_with_their_signs(side: float) -> None:
    """Each sample is 1 / (1 - s) of what it should be, s = ± 2 %: the estimates end within 4 sigma of it.

    The flight tells those of the gyros and of the accelerometer that bears gravity by far more than that.
    """
    size, gravity, rng = 0.02, 9.80665, default_rng(6)
    scale = side * size * np.array((1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
    drawn, sensed = drawn_start(rng), flight.readings(rng)
    share = (size * gravity) ** 2 * np.eye(3)
    drawn.covariance[ACCEL_BIAS, ACCEL_BIAS] += share  # as a start that passes it for a bias has it
    noise = flight.IMU._replace(scale_factor=size)
    start = with_constants(drawn, np.zeros(CONSTANTS), noise, gravity)
    running = LineVisionFilter(PAPER, WIDTH, flight.MOUNT, flight.SITE, noise, gates_of(1e-6), start)
    for step in sensed.steps():
        running.propagate(step.sample / (1.0 - scale), flight.DT)
        if step.lines is not None:
            running.predict()
            running.observe_lines(step.lines.numbers(), np.zeros(3), step.tilt)
    sigma = np.sqrt(np.diag(running.augmented_covariance)[AUGMENTED:])
    assert (np.abs(running.scale_factor - scale) < 4.0 * sigma).all()
    assert (sigma[[0, 1, 2, 5]] < size / 6.0).all()
