"""The filter, on a flight made of splines with sensors made in the test.

====================  ============================================================================================
consistency           normalised errors squared over 30 draws, two-sided: 9 and 15 states, early and late
start                 the same of the covariance that the alignment gives; its velocity by hand
update                filterpy's own, with scipy's inverse
life                  three lines, two, three; none: it coasts; wrong ones are not believed
roll                  the late stage's roll is the filter's own: what its error does is in the covariance
====================  ============================================================================================
"""

import math
from typing import NamedTuple

import flight
import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from numpy.random import default_rng
from outside import DEG, LENGTH, PAPER, WIDTH, Poses, runway_lines
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from estimator import three_line_pose
from estimator.alignment import Alignment, Incidence, Start
from estimator.fusion import NO_UPDATE, Gates, InertialVisionFilter
from estimator.innovation import Innovation, LineObservation, Lines, pose_innovation
from estimator.mount import Mount, body_from_camera
from estimator.so3 import Array, flat
from estimator.strapdown import ACCEL_BIAS, GYRO_BIAS, Inertial, corrected, inertial

GATES = Gates(22.5, 18.5)
DRAWS = 30
START_SIGMA = np.array((5.0, 0.5, 0.7, 0.6, 0.6, 0.6, 0.006, 0.003, 0.003))


def drawn_start(rng: np.random.Generator) -> Start:
    """A start that is off from the truth by a draw of its own covariance."""
    t = flight.truth()
    sigma = np.append(START_SIGMA, np.repeat((flight.IMU.gyro_bias, flight.IMU.accel_bias), 3))
    true = Inertial(tuple(t.position[0].tolist()), tuple(t.velocity[0].tolist()), flat(t.R[0]))
    off = np.zeros(15)
    off[:9] = -START_SIGMA * rng.standard_normal(9)
    return Start(inertial(corrected(true.numbers(), off)), np.diag(sigma**2))


def filter_of(start: Start) -> InertialVisionFilter:
    return InertialVisionFilter(PAPER, WIDTH, flight.MOUNT, flight.SITE, flight.IMU, GATES, start)


def error_of(navigator: InertialVisionFilter, index: int, bias: Array) -> Array:
    """True less estimated, (15,)."""
    t = flight.truth()
    position, velocity, attitude = navigator.state
    turn = Rotation.from_matrix(t.R[index] @ np.reshape(attitude, (3, 3)).T).as_rotvec()
    return np.concatenate(
        (
            t.position[index] - position,
            t.velocity[index] - velocity,
            turn,
            bias[index] - navigator.bias,
        )
    )


class Record(NamedTuple):
    """Of one draw, a row a frame."""

    degrees: Array
    accepted: Array
    nis: Array
    nees9: Array
    nees15: Array


def flown(seed: int) -> Record:
    rng = default_rng(seed)
    navigator, sensed = filter_of(drawn_start(rng)), flight.readings(rng)
    rows = []
    for step in sensed.steps():
        navigator.propagate(step.sample, flight.DT)
        if step.lines is None:
            continue
        navigator.predict()
        update = navigator.observe(step.lines.numbers(), step.tilt)
        e, P = error_of(navigator, step.index, sensed.bias), navigator.covariance
        nees = [float(e[:k] @ np.linalg.solve(P[:k, :k], e[:k])) for k in (9, 15)]
        rows.append((update.degrees, update.accepted, update.nis, *nees))
    return Record(*np.array(rows, float).T)


def test_errors_and_innovations_are_as_large_as_the_covariance_says() -> None:
    records = [flown(seed) for seed in range(DRAWS)]
    degrees = np.stack([record.degrees for record in records])
    assert set(degrees[:, 60:].ravel()) == {4.0, 6.0}
    early, late = degrees[0] == 6.0, degrees[0] == 4.0
    assert early.sum() > 400
    assert late.sum() > 60
    nees9, nees15 = (np.stack([getattr(record, name) for record in records]) for name in ("nees9", "nees15"))
    for name, phase in (("early", early), ("late", late)):
        mean9, mean15 = nees9[:, phase].mean(), nees15[:, phase].mean()
        print(f"{name}: {mean9:.2f} of 9, {mean15:.2f} of 15")
        assert mean9 == pytest.approx(9.0, rel=0.15), name
        assert mean15 == pytest.approx(15.0, rel=0.15), name
    # at single moments: the sum over independent draws is chi-squared; both sides, once in 10,000 by chance
    for frame in (30, 150, 300, 450, 540, len(early) - 1):
        for nees, n in ((nees9, 9), (nees15, 15)):
            low, high = chi2.ppf((5e-5, 1.0 - 5e-5), n * DRAWS)
            assert low < nees[:, frame].sum() < high, (frame, n)
    for n in (6, 4):
        nis = np.concatenate([record.nis[record.degrees == n] for record in records])
        # frames are independent of one another: 0.5 % at 16,000, 1.5 % at 2000
        assert nis.mean() == pytest.approx(n, rel=0.06)
    believed = np.mean([record.accepted.mean() for record in records])
    assert 0.995 < believed < 0.9999  # either gate is passed by chance once in 1000


def test_late_errors_are_small() -> None:
    rng = default_rng(1)
    navigator, sensed = filter_of(drawn_start(rng)), flight.readings(rng)
    for step in sensed.steps():
        navigator.propagate(step.sample, flight.DT)
        if step.lines is not None:
            navigator.predict()
            navigator.observe(step.lines.numbers(), step.tilt)
    error = error_of(navigator, len(flight.truth().time) - 1, sensed.bias)
    assert np.abs(error[1:3]).max() < 0.1
    assert np.abs(error[6:9]).max() < 0.05 * DEG
    assert np.abs(error[3:6]).max() < 0.2


def warmed_up(frames: int, seed: int = 5) -> tuple[InertialVisionFilter, flight.Readings, list[flight.Step]]:
    """A filter after some frames, and the steps that follow."""
    rng = default_rng(seed)
    navigator, sensed = filter_of(drawn_start(rng)), flight.readings(rng)
    steps = list(sensed.steps())
    after = frames * flight.EVERY
    for step in steps[:after]:
        navigator.propagate(step.sample, flight.DT)
        if step.lines is not None:
            navigator.predict()
            navigator.observe(step.lines.numbers(), step.tilt)
    return navigator, sensed, steps[after:]


def test_coasting_grows_the_covariance_as_it_should() -> None:
    navigator, sensed, rest = warmed_up(300)
    sizes = [np.sqrt(np.diag(navigator.covariance))]
    for step in rest[: 4 * flight.RATE]:
        navigator.propagate(step.sample, flight.DT)
        if step.lines is not None:
            navigator.predict()
            before = navigator.state
            assert navigator.observe(Lines(None, None, None).numbers(), step.tilt) == pytest.approx(
                NO_UPDATE, nan_ok=True
            )
            assert navigator.state == before
            sizes.append(np.sqrt(np.diag(navigator.covariance)))
            last = step.index
    grown = np.diff(sizes, axis=0)
    assert (grown[:, 3:15] > 0.0).all()
    assert (grown[30:, :3] > 0.0).all()  # at first what is known of velocity and position may cancel
    assert sizes[-1][0] > 1.05 * sizes[0][0]
    assert sizes[-1][1] > 1.5 * sizes[0][1]
    assert (np.abs(error_of(navigator, last, sensed.bias)) < 4.0 * sizes[-1]).all()


def shifted(line: LineObservation | None, pixels: float) -> LineObservation:
    assert line is not None
    return line._replace(c=line.c - pixels, u=line.u + pixels * line.a, v=line.v + pixels * line.b)


@pytest.mark.parametrize("late", [False, True])
def test_a_wrong_line_is_not_believed(late: bool) -> None:
    navigator, _, rest = warmed_up(300)
    for step in rest:
        navigator.propagate(step.sample, flight.DT)
        if step.lines is not None:
            break
    navigator.predict()
    assert step.lines is not None
    state, bias, covariance = navigator.state, navigator.bias.tolist(), navigator.covariance.copy()
    good = step.lines._replace(threshold=None) if late else step.lines
    # a taxiway's edge, 30 px beside
    update = navigator.observe(good._replace(left=shifted(good.left, 30.0)).numbers(), step.tilt)
    assert not update.accepted
    assert update.degrees == (4 if late else 6)
    assert update.nis > (GATES.late if late else GATES.early)
    assert (navigator.state, navigator.bias.tolist()) == (state, bias)
    assert np.array_equal(navigator.covariance, covariance)
    # and the right one, right after, is
    update = navigator.observe(good.numbers(), step.tilt)
    assert update.accepted
    assert navigator.state != state
    assert (np.diag(navigator.covariance) <= np.diag(covariance)).all()


@pytest.mark.parametrize("field", ["a", "b", "u", "v", "offset_variance", "angle_variance"])
def test_a_line_of_nans_is_not_believed(field: str) -> None:
    navigator, _, rest = warmed_up(100)
    lines = next(step.lines for step in rest if step.lines is not None)
    assert lines.left is not None
    state, covariance = navigator.state, navigator.covariance.copy()
    assert not navigator.observe(lines._replace(left=lines.left._replace(**{field: math.nan})).numbers(), 0.05).accepted
    assert navigator.state == state
    assert np.array_equal(navigator.covariance, covariance)


@pytest.mark.parametrize("numbers", [6, 4])
def test_an_update_is_filterpys(numbers: int) -> None:
    navigator, _, _ = warmed_up(300)
    navigator.predict()
    rng = default_rng(3)
    root = 0.1 * rng.normal(size=(numbers, numbers))
    y, H, R = rng.normal(size=numbers), rng.normal(size=(numbers, 15)), root @ root.T
    stock = ExtendedKalmanFilter(dim_x=15, dim_z=numbers)
    stock.x, stock.P, stock.R = np.zeros(15), navigator.covariance.copy(), R
    stock.update(y, lambda _: H, lambda _: np.zeros(numbers))
    before = navigator.nominal, navigator.bias
    update = navigator.apply(Innovation(y, H, R), math.inf)
    assert update.nis == pytest.approx(stock.mahalanobis**2, rel=1e-9)
    size = np.sqrt(np.diag(stock.P))
    assert np.abs((navigator.covariance - stock.P) / np.outer(size, size)).max() < 1e-8
    expected = np.append(corrected(before[0], stock.x), before[1] + stock.x[9:])
    np.testing.assert_allclose(np.append(navigator.nominal, navigator.bias), expected, rtol=1e-9, atol=1e-12)


def test_an_innovation_without_an_inverse_is_an_error() -> None:
    navigator, _, _ = warmed_up(300)
    navigator.predict()
    with pytest.raises(np.linalg.LinAlgError):
        navigator.apply(Innovation(np.zeros(4), np.zeros((4, 15)), np.zeros((4, 4))), math.inf)


def test_three_lines_two_three() -> None:
    navigator, sensed, rest = warmed_up(400)
    seen: list[int] = []
    for step in rest[: 45 * flight.EVERY]:
        navigator.propagate(step.sample, flight.DT)
        if step.lines is None:
            continue
        navigator.predict()
        lines = step.lines._replace(threshold=None) if 15 <= len(seen) < 30 else step.lines
        update = navigator.observe(lines.numbers(), step.tilt)
        assert update.accepted
        seen.append(update.degrees)
        error, sigma = error_of(navigator, step.index, sensed.bias), np.sqrt(np.diag(navigator.covariance))
        assert (np.abs(error[:9]) < 4.5 * sigma[:9]).all()
    assert seen == [6] * 15 + [4] * 15 + [6] * 15


def test_lines_that_no_prediction_sees_are_left_out() -> None:
    navigator, _, rest = warmed_up(10)
    lines = next(step.lines for step in rest if step.lines is not None)
    assert not navigator.observe(Lines(lines.left, lines.threshold, None).numbers(), 0.05).accepted
    assert navigator.observe(Lines(None, lines.threshold, lines.right).numbers(), 0.05).degrees == 0


@pytest.mark.parametrize("height", [9.6, 2.0])
def test_late_roll_is_part_of_the_state(height: float) -> None:
    # level, on the centreline; the filter knows its roll to 0.2° and its lateral position not at all, the lines are all
    # but exact.  Then the lateral position is known to (h + L²/(4h)) of the roll, and moves with it
    sigma = 0.2 * DEG
    k = height + WIDTH**2 / (4.0 * height)
    variance = np.repeat((25.0, 1.0, 1e-4, 1e-12, 1e-12), 3)
    variance[6] = sigma**2
    start = Start(Inertial((300.0, 0.0, -height), (40.0, 0.0, 0.0), flat(np.eye(3))), np.diag(variance))
    navigator = InertialVisionFilter(PAPER, WIDTH, Mount((0.0, 0.0, 0.0), 0.0), flight.SITE, flight.IMU, GATES, start)
    pose = Poses(np.array((300.0, 0.0, -height)), np.array(((0, 1.0, 0), (0, 0, 1.0), (1.0, 0, 0))), *np.zeros(3))
    left, _, right = runway_lines(PAPER, pose)
    exact = [LineObservation(a, b, c, -a * c, -b * c, 1e-8, 1e-12) for a, b, c in (left.tolist(), right.tolist())]
    for _ in range(20):  # again and again: the same lines cannot teach it the roll
        assert navigator.observe(Lines(exact[0], None, exact[1]).numbers(), 0.0).accepted
    P = navigator.covariance
    assert math.sqrt(P[6, 6]) == pytest.approx(sigma, rel=0.02)
    assert math.sqrt(P[1, 1]) == pytest.approx(k * sigma, rel=0.02)
    assert P[1, 6] / math.sqrt(P[1, 1] * P[6, 6]) > 0.99


def sightings(seed: int, frames: int) -> tuple[Alignment, Start, flight.Readings]:
    """The alignment and its start, from the first frames of a draw."""
    sensed = flight.readings(default_rng(seed))
    airspeed = float(np.linalg.norm(flight.truth().velocity[0]))
    alignment = Alignment(flight.SITE, frames, Incidence(0.0, 0.0, 40.0), 3.0)
    enough = False
    for step in sensed.steps():
        alignment.propagate(step.sample, flight.DT)
        if step.lines is None:
            continue
        assert not enough
        left, threshold, right = (np.array(line[:3]) for line in step.lines if line is not None)
        pose = three_line_pose(PAPER, left, threshold, right, runway_width=WIDTH)
        body = body_from_camera(pose.position.tolist(), pose.R_cam_from_runway, step.tilt, flight.LEVER)
        enough = alignment.add(body, airspeed)
        if enough:
            state = alignment.mean(airspeed)
            frame = pose_innovation(PAPER, WIDTH, flight.MOUNT, step.lines, state.position, state.attitude, step.tilt)
            assert frame is not None
            return alignment, alignment.start(airspeed, frame, flight.MOUNT, flight.IMU), sensed
    raise AssertionError("the alignment never had enough")


def test_body_from_camera_is_the_inverse_of_the_mount() -> None:
    t = flight.truth()
    for k in (0, 900, 2000):
        pose = flight.camera_pose(t.position[k], t.R[k], 0.17)
        body = body_from_camera(pose.position.tolist(), pose.R, 0.17, flight.LEVER)
        assert body.position == pytest.approx(t.position[k], abs=1e-9)
        assert body.attitude == pytest.approx(t.R[k].ravel(), abs=1e-14)


def test_velocity_at_the_start_is_along_the_nose() -> None:
    # 40 m/s, nose 5° up, 3° of angle of attack: climbing at 2°, 40 sin 2° = 1.396 m/s
    alignment = Alignment(flight.SITE, 1, Incidence(3.0 * DEG, 0.0, 40.0), 1.0)
    attitude = flat(Rotation.from_euler("ZYX", (0.0, 5.0 * DEG, 0.0)).as_matrix())
    pose = flight.camera_pose(np.array((-800.0, 0.0, -50.0)), np.reshape(attitude, (3, 3)), 0.1)
    assert alignment.add(body_from_camera(pose.position.tolist(), pose.R, 0.1, flight.LEVER), 40.0)
    assert alignment.mean(40.0).velocity == pytest.approx((39.97563, 0.0, -1.39598), abs=1e-5)


def test_covariance_at_the_start_by_sampling() -> None:
    # an aircraft that flies along its nose but for a gust, seen four times at one moment, by a camera far from the
    # inertial unit; all noise a hundredth of what is usual.  3000 draws know a correlation to 0.02
    frames, draws, speed_sigma, scale, tilt = 4, 3000, 0.002, 0.01, 0.1
    lever, airspeed = (8.0, 3.0, -4.0), 40.0
    mount = Mount(lever, (scale * 0.003) ** 2)
    rng = default_rng(11)
    R = Rotation.from_euler("ZYX", (0.05, 0.03, -0.1)).as_matrix()
    position = np.array((-150.0, 4.0, -15.0))
    triad = R @ Rotation.from_euler("y", -tilt).as_matrix()
    cam = Poses(position + R @ lever, np.stack((triad[:, 1], triad[:, 2], triad[:, 0])), *np.zeros((3, 1)))
    sigmas = scale * np.array(((0.3, 0.004), (0.5, 0.006), (0.2, 0.003)))
    clean = [
        flight.CleanLine(line, np.array(at), float(sigma[0]), float(sigma[1]))
        for line, at, sigma in zip(
            runway_lines(PAPER, cam), ((200.0, 300.0), (330.0, 250.0), (450.0, 330.0)), sigmas, strict=True
        )
    ]
    errors = []
    for _ in range(draws):
        alignment = Alignment(flight.SITE, frames, Incidence(0.0, 0.0, 40.0), speed_sigma)
        for _ in range(frames):
            seen = Lines(*(flight.measured(rng, line) for line in clean))
            reading = tilt + scale * 0.003 * rng.standard_normal()
            left, threshold, right = (np.array(line[:3]) for line in seen if line is not None)
            pose = three_line_pose(PAPER, left, threshold, right, runway_width=WIDTH)
            alignment.add(body_from_camera(pose.position.tolist(), pose.R_cam_from_runway, reading, lever), airspeed)
        state = alignment.mean(airspeed)
        velocity = airspeed * R[:, 0] + speed_sigma * rng.standard_normal(3)
        turn = Rotation.from_matrix(R @ np.reshape(state.attitude, (3, 3)).T).as_rotvec()
        errors.append(np.concatenate((position - state.position, velocity - state.velocity, turn)))
    frame = pose_innovation(PAPER, WIDTH, mount, seen, state.position, state.attitude, tilt)
    assert frame is not None
    P = alignment.start(airspeed, frame, mount, flight.IMU).covariance[:9, :9]
    size = np.sqrt(np.diag(P))
    assert np.abs((np.cov(np.transpose(errors)) - P) / np.outer(size, size)).max() < 0.1


def test_start_is_as_good_as_its_covariance_says() -> None:
    frames, draws = 15, 60
    k = frames * flight.EVERY
    total9, pose6 = 0.0, 0.0
    for seed in range(100, 100 + draws):
        _, start, sensed = sightings(seed, frames)
        e = error_of(filter_of(start), k, sensed.bias)
        P = start.covariance
        assert np.abs(P - P.T).max() < 1e-12
        total9 += float(e[:9] @ np.linalg.solve(P[:9, :9], e[:9])) / draws
        pose = [0, 1, 2, 6, 7, 8]
        pose6 += float(e[pose] @ np.linalg.solve(P[np.ix_(pose, pose)], e[pose])) / draws
        assert math.sqrt(P[9, 9]) == pytest.approx(flight.IMU.gyro_bias)
        assert math.sqrt(P[14, 14]) == pytest.approx(flight.IMU.accel_bias)
    print(f"start: {total9:.2f} of 9, {pose6:.2f} of 6 (pose)")
    # the mean of 60 draws of chi² with 6 degrees of freedom, five deviations either side, and room for the first order
    assert 6.0 - 5.0 * math.sqrt(2.0 * 6.0 / draws) - 0.5 < pose6 < 6.0 + 5.0 * math.sqrt(2.0 * 6.0 / draws) + 0.5
    # this flight has no wind: of the velocity's three numbers nothing is left but what the attitude gives
    assert pose6 - 1.0 < total9 < 9.0 + 5.0 * math.sqrt(2.0 * 9.0 / draws)


def test_the_filter_goes_on_from_its_alignment() -> None:
    _, start, sensed = sightings(7, 15)
    navigator = filter_of(start)
    believed = []
    for step in sensed.steps():
        if step.index <= 15 * flight.EVERY:
            continue
        navigator.propagate(step.sample, flight.DT)
        if step.lines is None:
            continue
        navigator.predict()
        believed.append(navigator.observe(step.lines.numbers(), step.tilt).accepted)
    assert np.mean(believed) > 0.99
    error, P = error_of(navigator, len(flight.truth().time) - 1, sensed.bias), navigator.covariance
    assert float(error[:9] @ np.linalg.solve(P[:9, :9], error[:9])) < chi2.ppf(0.9999, 9)
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert (np.sqrt(np.diag(P))[[*range(15)[GYRO_BIAS], *range(15)[ACCEL_BIAS]]] > 0.0).all()


def test_the_flight_is_one() -> None:
    # the increments, integrated back by trapezoids, give the splines' positions: the test's own kinematics
    t = flight.truth()
    assert t.position[-1, 0] == pytest.approx(102.0)
    assert t.position[-1, 0] < LENGTH
    middle = 0.5 * (t.velocity[1:] + t.velocity[:-1]) * flight.DT
    assert t.position[0] + middle.sum(axis=0) == pytest.approx(t.position[-1], abs=1e-2)
