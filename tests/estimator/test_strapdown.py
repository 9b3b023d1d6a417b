"""Inertial mechanisation and its error model.

====================  ============================================================================================
by hand               free fall, a steady turn, gravity away from the threshold
Earth rate, Coriolis  a flight of 60 s integrated in inertial space by scipy, about the Earth's centre
inverse               increments and propagate, both ways
error model           transition by finite differences, process noise by the matrix exponential (Van Loan)
====================  ============================================================================================
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from outside import DEG, derivative
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from estimator.so3 import IDENTITY, Array, Mat3, Vec3, flat, from_euler
from estimator.strapdown import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    ImuNoise,
    Inertial,
    Site,
    corrected,
    gravity_at,
    increments,
    inertial,
    predicted,
    process_noise,
    propagate,
    transition,
)

RADIUS = 6_371_000.0
STILL = Site(9.8, (0.0, 0.0, 0.0), 1e15)
"""Flat, and not turning."""
TURNING = Site(9.8, (4.0e-5, -2.5e-5, -5.5e-5), RADIUS)


def fly(state: Inertial, site: Site, angle: Vec3, velocity: Vec3, dt: float, steps: int) -> Inertial:
    for _ in range(steps):
        state, _ = propagate(state, site, angle, velocity, dt)
    return state


def test_free_fall() -> None:
    # no force: v = v0 + g t, p = p0 + v0 t + g t²/2; after 3 s 29.4 m/s down, 44.1 m lower, 60 m on
    state = fly(Inertial((0.0, 0.0, -100.0), (20.0, 1.0, 0.0), IDENTITY), STILL, (0, 0, 0), (0, 0, 0), 0.01, 300)
    assert state.velocity == pytest.approx((20.0, 1.0, 29.4))
    assert state.position == pytest.approx((60.0, 3.0, -55.9))
    assert state.attitude == IDENTITY


def test_steady_turn() -> None:
    # 40 m/s at 30° of bank: a turn to the right of radius V²/(g tan φ) = 282.8 m at g tan φ / V = 0.14145 rad/s, in
    # which the wings feel g / cos φ upward and the body rates are (0, Ω sin φ, Ω cos φ)
    g, v, bank = 9.8, 40.0, 30.0 * DEG
    rate, lift = g * math.tan(bank) / v, g / math.cos(bank)
    radius = v / rate
    assert (radius, rate) == pytest.approx((282.78, 0.141451), rel=1e-4)
    dt, steps = 1.0 / 480.0, 4800
    angle = (0.0, rate * math.sin(bank) * dt, rate * math.cos(bank) * dt)
    # the increment of the force is that of a body which turns, seen from its attitude at the interval's start
    mid = Rotation.from_rotvec(0.5 * np.array(angle)).as_matrix() @ np.array((0.0, 0.0, -lift * dt))
    x, y, z = mid.tolist()
    state = fly(
        Inertial((0.0, 0.0, -50.0), (v, 0.0, 0.0), from_euler(bank, 0.0, 0.0)), STILL, angle, (x, y, z), dt, steps
    )
    psi = rate * dt * steps
    assert state.position == pytest.approx((radius * math.sin(psi), radius * (1.0 - math.cos(psi)), -50.0), abs=5e-3)
    assert state.velocity == pytest.approx((v * math.cos(psi), v * math.sin(psi), 0.0), abs=1e-3)
    assert state.attitude == pytest.approx(from_euler(bank, 0.0, psi), abs=1e-9)


def test_gravity_by_hand() -> None:
    # towards the centre of the Earth, 6371 km below: 1000 m before the threshold it leans forward by 1000/6371000 of g,
    # and at 1000 m of height it is less by 2/6371 of g (the free-air gradient)
    site = Site(9.8, (0.0, 0.0, 0.0), RADIUS)
    assert gravity_at(site, (-1000.0, 0.0, 0.0)) == pytest.approx((9.8 / 6371.0, 0.0, 9.8), rel=1e-6)
    assert gravity_at(site, (0.0, 500.0, 0.0))[1] == pytest.approx(-4.9 / 6371.0, rel=1e-6)
    assert gravity_at(site, (0.0, 0.0, -1000.0))[2] == pytest.approx(9.8 * (1.0 - 2.0 / 6371.0), rel=1e-9)
    # a hundred metres of the inverse-square law itself
    centre = np.array((0.0, 0.0, RADIUS))
    where = np.array((300.0, -200.0, -100.0))
    down = centre - where
    exact = 9.8 * RADIUS**2 * down / np.linalg.norm(down) ** 3
    assert gravity_at(site, (300.0, -200.0, -100.0)) == pytest.approx(exact, abs=1e-6)


def in_inertial_space(state: Inertial, site: Site, rates: Array, forces: Array, duration: float) -> Inertial:
    """A flight with constant body rates and forces, integrated about the centre of the Earth in axes that do not turn.

    The axes are those of the runway at the start.  Gravitation is gravity without the centrifugal acceleration.
    """
    omega, centre = np.array(site.earth_rate), np.array((0.0, 0.0, site.radius))

    def turned(t: float) -> Array:
        return np.asarray(Rotation.from_rotvec(omega * t).as_matrix())

    def slope(t: float, x: Array) -> Array:
        E = turned(t)
        place = E.T @ x[:3] + centre  # runway frame, from the threshold
        down = centre - place
        gravity = site.gravity * site.radius**2 * down / np.linalg.norm(down) ** 3
        gravitation = gravity + np.cross(omega, np.cross(omega, place - centre))
        R = x[6:].reshape(3, 3)
        p, q, r = rates
        spin = np.array(((0.0, -r, q), (r, 0.0, -p), (-q, p, 0.0)))
        return np.concatenate((x[3:6], E @ gravitation + R @ forces, (R @ spin).ravel()))

    from_centre = np.array(state.position) - centre
    start = np.concatenate((from_centre, np.array(state.velocity) + np.cross(omega, from_centre), state.attitude))
    x = solve_ivp(slope, (0.0, duration), start, rtol=1e-12, atol=1e-9).y[:, -1]
    E = turned(duration)
    place = E.T @ x[:3]
    velocity = E.T @ x[3:6] - np.cross(omega, place)
    px, py, pz = (place + centre).tolist()
    vx, vy, vz = velocity.tolist()
    return Inertial((px, py, pz), (vx, vy, vz), flat(E.T @ x[6:].reshape(3, 3)))


def test_flight_against_inertial_space() -> None:
    # Coriolis and Earth rate are worth 10 m and 0.2° over this minute
    rates, forces = np.array((0.002, 0.003, 0.05)), np.array((0.4, 2.0, -9.83))
    start = Inertial((-500.0, 20.0, -60.0), (40.0, 1.0, 2.0), from_euler(0.2, 0.05, 0.1))
    expected = in_inertial_space(start, TURNING, rates, forces, 60.0)
    dt, steps = 1.0 / 240.0, 14_400
    angle = (float(rates[0]) * dt, float(rates[1]) * dt, float(rates[2]) * dt)
    # ∫ exp(ω t) f dt over the interval by its series
    W = np.cross(np.eye(3), rates)  # W x = ω × x
    push = (np.eye(3) * dt + W * dt**2 / 2.0 + W @ W * dt**3 / 6.0) @ forces
    x, y, z = push.tolist()
    got = fly(start, TURNING, angle, (x, y, z), dt, steps)
    assert got.attitude == pytest.approx(expected.attitude, abs=1e-6)
    assert got.velocity == pytest.approx(expected.velocity, abs=2e-3)
    assert got.position == pytest.approx(expected.position, abs=0.05)
    R = np.reshape(got.attitude, (3, 3))
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-11  # no rounding gathers in it
    # and without the Earth's turn it would not do
    other = fly(start, TURNING._replace(earth_rate=(0.0, 0.0, 0.0)), angle, (x, y, z), dt, steps)
    assert np.linalg.norm(np.subtract(other.position, expected.position)) > 5.0


number = st.floats(-1.0, 1.0)
triple = st.tuples(number, number, number)


@given(triple, triple, triple, triple, triple)
def test_increments_are_the_inverse_of_propagate(p: Vec3, v: Vec3, e: Vec3, angle: Vec3, push: Vec3) -> None:
    start = Inertial((900.0 * p[0], 50.0 * p[1], 80.0 * p[2]), (40.0 * v[0], 40.0 * v[1], 9.0 * v[2]), from_euler(*e))
    dt = 1.0 / 120.0
    end, _ = propagate(start, TURNING, angle, push, dt)
    back_angle, back_push = increments(*start, end.velocity, end.attitude, TURNING, dt)
    assert back_angle == pytest.approx(angle, abs=1e-12)
    assert back_push == pytest.approx(push, abs=1e-12)


def test_increments_of_rest_are_gravity_and_the_earths_turn() -> None:
    # standing level: the unit feels 9.8 m/s² upward and turns with the Earth
    rest = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), from_euler(0.0, 0.0, math.pi / 2.0))
    angle, push = increments(*rest, rest.velocity, rest.attitude, TURNING, 0.1)
    ex, ey, ez = TURNING.earth_rate
    assert angle == pytest.approx((0.1 * ey, -0.1 * ex, 0.1 * ez))  # nose along y: its right is -x
    assert push == pytest.approx((0.0, 0.0, -0.98))


ATTITUDES = [from_euler(0.3, -0.1, 0.2), from_euler(-0.5, 0.4, 2.0)]
RATES, FORCES = (0.1, -0.2, 0.15), (1.5, -0.7, -10.2)


def errors_after(attitude: Mat3, error: Array, dt: float, steps: int) -> tuple[Array, Vec3, Mat3]:
    """Error (15,) at the end, of a truth that starts off by an error and flies on the same increments."""
    h = dt / steps
    angle = (RATES[0] * h, RATES[1] * h, RATES[2] * h)
    push = (FORCES[0] * h, FORCES[1] * h, FORCES[2] * h)
    estimated = Inertial((-300.0, 5.0, -20.0), (40.0, 1.0, 2.0), attitude)
    R = Rotation.from_rotvec(error[6:9]).as_matrix() @ np.reshape(attitude, (3, 3))
    px, py, pz = (np.array(estimated.position) + error[:3]).tolist()
    vx, vy, vz = (np.array(estimated.velocity) + error[3:6]).tolist()
    true = Inertial((px, py, pz), (vx, vy, vz), flat(R))
    gyro, accel = (h * error[GYRO_BIAS]).tolist(), (h * error[ACCEL_BIAS]).tolist()
    gathered = np.zeros(3)
    for _ in range(steps):
        estimated, force = propagate(estimated, TURNING, angle, push, h)
        gathered += force
        # a bias that is larger in truth than estimated is taken off the same readings
        true, _ = propagate(
            true,
            TURNING,
            (angle[0] - gyro[0], angle[1] - gyro[1], angle[2] - gyro[2]),
            (push[0] - accel[0], push[1] - accel[1], push[2] - accel[2]),
            h,
        )
    turn = np.reshape(true.attitude, (3, 3)) @ np.reshape(estimated.attitude, (3, 3)).T
    off = (np.subtract(true.position, estimated.position), np.subtract(true.velocity, estimated.velocity))
    x, y, z = gathered.tolist()
    return np.concatenate((*off, Rotation.from_matrix(turn).as_rotvec(), error[9:])), (x, y, z), estimated.attitude


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_transition_by_finite_differences(attitude: Mat3) -> None:
    dt, steps = 1.0 / 30.0, 4
    step = np.repeat((1e-2, 1e-2, 1e-5, 1e-5, 1e-3), 3)
    expected = derivative(lambda e: errors_after(attitude, e, dt, steps)[0], np.zeros(15), step)
    _, force, after = errors_after(attitude, np.zeros(15), dt, steps)
    got = transition(np.array((*[0.0] * 6, *after, *force)), dt)
    assert got[POSITION, VELOCITY] == pytest.approx(dt * np.eye(3))
    # what is left out: the body's turn within the time (0.27 rad/s × 1/60 s of each entry), Earth rate and gravity's
    # gradient (1e-4 and less), and a gyro bias in the velocity within the time (g dt²/2 = 6e-3)
    missing = np.zeros((15, 15))
    missing[VELOCITY, GYRO_BIAS] = 10.4 * dt**2 / 2.0
    missing[POSITION, GYRO_BIAS] = 10.4 * dt**3 / 6.0
    for block in (GYRO_BIAS, ACCEL_BIAS):
        missing[ATTITUDE, block] += 0.01 * dt
        missing[VELOCITY, block] += 0.01 * dt
        missing[POSITION, block] += 0.01 * dt**2
    missing[VELOCITY, ATTITUDE] = 0.005 * 10.4 * dt
    missing[POSITION, ATTITUDE] = 0.2 * 10.4 * dt**2 / 2.0
    assert (np.abs(got - expected) <= missing + 2e-5).all()
    # signs and places: each entry that the differences show is there
    shown = np.abs(expected) > 3.0 * missing + 1e-4
    assert shown.sum() > 45
    assert got[shown] == pytest.approx(expected[shown], rel=0.25)


def test_prediction_is_the_product_of_its_matrices() -> None:
    rng = np.random.default_rng(5)
    root = rng.normal(size=(15, 15))
    P, Q = root @ root.T, np.diag(rng.uniform(size=15))
    nominal = np.array((*rng.normal(size=6), *from_euler(0.1, -0.2, 0.3), *rng.normal(size=3)))
    before = nominal.copy()
    moved, got = predicted(nominal, P, Q, 1.0 / 30.0)
    F = transition(nominal, 1.0 / 30.0)
    np.testing.assert_allclose(got, F @ P @ F.T + Q, rtol=1e-12, atol=1e-12)
    assert np.array_equal(nominal, before)
    assert moved.tolist() == [*before[:15], 0.0, 0.0, 0.0]


def test_process_noise_is_van_loans() -> None:
    # expm([[-A, G Q Gᵀ], [0, Aᵀ]] dt) holds F⁻¹ Qd above Fᵀ; A with everything in it, also what the function leaves out
    noise = ImuNoise(3e-5, 1.7e-3, 2.4e-7, 5e-5, 5e-5, 1e-2)
    dt, R = 1.0 / 30.0, np.reshape(ATTITUDES[0], (3, 3))
    f = R @ np.array(FORCES)
    A = np.zeros((15, 15))
    A[POSITION, VELOCITY] = np.eye(3)
    A[VELOCITY, ATTITUDE] = np.cross(np.eye(3), f).T  # ψ × f
    A[ATTITUDE, GYRO_BIAS] = A[VELOCITY, ACCEL_BIAS] = -R
    density = np.diag(np.repeat((0.0, noise.accel, noise.gyro, noise.gyro_drift, noise.accel_drift), 3) ** 2)
    both = expm(np.block([[-A, density], [np.zeros((15, 15)), A.T]]) * dt)
    expected = both[15:, 15:].T @ both[:15, 15:]
    got = process_noise(noise, dt)
    size = np.sqrt(np.diag(expected))
    assert np.abs((got - expected) / np.outer(size, size)).max() < 0.01
    assert np.diag(got) == pytest.approx(np.diag(expected), rel=1e-3)


def test_corrected_is_the_true_state_of_an_error() -> None:
    error = np.array((1.0, -2.0, 3.0, 0.1, 0.2, -0.3, 0.01, -0.02, 0.03, *[0.0] * 6))
    state = Inertial((5.0, 6.0, 7.0), (40.0, 0.0, 1.0), ATTITUDES[0])
    result = inertial(corrected(state.numbers(), error))
    assert result.position == pytest.approx((6.0, 4.0, 10.0))
    assert result.velocity == pytest.approx((40.1, 0.2, 0.7))
    expected = Rotation.from_rotvec(error[6:9]).as_matrix() @ np.reshape(ATTITUDES[0], (3, 3))
    assert result.attitude == pytest.approx(expected.ravel(), abs=1e-12)
