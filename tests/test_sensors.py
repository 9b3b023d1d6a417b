"""The sensors against the outside: OpenCV's projection, hand computation, statistics of what was asked for."""

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from estimator.lines import fit_line
from estimator.so3 import Vec3, flat
from landsim.config import CameraConfig, ImuConfig, MountConfig, PitotConfig
from landsim.runway import Runway
from landsim.sensors import Imu, LineCamera, Pitot, TiltMount, _fitted, imu_noise, site_of
from landsim.truth import Truth

RUNWAY = Runway(length=2000.0, width=30.0, latitude=math.radians(45.0))
LEVER: Vec3 = (1.5, 0.0, 0.2)
F = 12500.0 / 9.9
"""Focal length of the default camera, px: 12.5 mm over 9.9 µm."""


def truth_at(
    position: Vec3 = (0.0, 0.0, -10.0),
    euler_deg: Vec3 = (0.0, 0.0, 0.0),
    velocity: Vec3 = (0.0, 0.0, 0.0),
    time: float = 0.0,
    airspeed: float = 40.0,
) -> Truth:
    """A true state; euler_deg is yaw, pitch, roll."""
    attitude = flat(Rotation.from_euler("ZYX", euler_deg, degrees=True).as_matrix())
    motion = np.array((*position, *velocity, *attitude))
    return Truth(time, motion, airspeed)


def camera(**changes: object) -> LineCamera:
    return LineCamera(CameraConfig.model_validate({"noise_px": 0.0, **changes}), LEVER, RUNWAY, default_rng(0))


def opencv_pixel(truth: Truth, tilt: float, point: Vec3, focal_length: float = F) -> np.ndarray:
    """A point of the runway frame by cv2.projectPoints, with rotations built by scipy."""
    R_runway_from_body = np.array(truth.R_runway_from_body).reshape(3, 3)
    R_body_from_triad = Rotation.from_euler("y", -tilt).as_matrix()
    R_triad_from_cam = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    R_cam_from_runway = (R_runway_from_body @ R_body_from_triad @ R_triad_from_cam).T
    centre = np.array(truth.position) + R_runway_from_body @ np.array(LEVER)
    matrix = np.array([[focal_length, 0.0, 328.5], [0.0, focal_length, 246.5], [0.0, 0.0, 1.0]])
    rotation = cv2.Rodrigues(R_cam_from_runway)[0]
    pixels, _ = cv2.projectPoints(np.array([point]), rotation, -R_cam_from_runway @ centre, matrix, None)
    return np.asarray(pixels).reshape(2)


@pytest.mark.parametrize("tilt_deg", [0.0, 3.0, 10.0])
@pytest.mark.parametrize("euler_deg", [(0.0, 0.0, 0.0), (2.0, -1.0, 5.0), (-3.0, 1.5, -12.0)])
def test_projected_ends_are_those_of_opencv(euler_deg: Vec3, tilt_deg: float) -> None:
    truth = truth_at((-600.0, 7.0, -35.0), euler_deg)
    tilt = math.radians(tilt_deg)
    view = camera().view(truth, tilt, tilt)
    left, threshold, right = view.true_ends
    for seen, ends in (
        (left, ((0.0, -15.0, 0.0), (2000.0, -15.0, 0.0))),
        (threshold, ((0.0, -15.0, 0.0), (0.0, 15.0, 0.0))),
        (right, ((0.0, 15.0, 0.0), (2000.0, 15.0, 0.0))),
    ):
        expected = np.concatenate([opencv_pixel(truth, tilt, end) for end in ends])
        np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_hand_computed_threshold_pixels() -> None:
    """Level, on the centreline, camera 100 m before the threshold and 10 m up, no tilt: (±15, 10)/100 × f from the
    centre."""
    truth = truth_at((-100.0 - LEVER[0], 0.0, -10.0 - LEVER[2]))
    threshold = camera().view(truth, 0.0, 0.0).true_ends[1]
    u, v = F * 0.15, F * 0.10
    np.testing.assert_allclose(threshold, (328.5 - u, 246.5 + v, 328.5 + u, 246.5 + v), atol=1e-9)


def middle_of_threshold(euler_deg: Vec3, tilt_deg: float = 0.0) -> np.ndarray:
    truth = truth_at((-400.0, 0.0, -25.0), euler_deg)
    ends = camera().view(truth, math.radians(tilt_deg), math.radians(tilt_deg)).true_ends[1]
    return np.array(
        [(ends[0] + ends[2]) / 2, (ends[1] + ends[3]) / 2, math.atan2(ends[3] - ends[1], ends[2] - ends[0])]
    )


def test_signs_of_attitude_in_the_image() -> None:
    level = middle_of_threshold((0.0, 0.0, 0.0))
    assert middle_of_threshold((0.0, 1.0, 0.0))[1] > level[1] + 20.0, "nose up moves the runway down"
    assert middle_of_threshold((1.0, 0.0, 0.0))[0] < level[0] - 20.0, "nose right moves the runway left"
    # the camera turns clockwise, so the world in its image turns anticlockwise: the right end goes up, v falls
    assert middle_of_threshold((0.0, 0.0, 5.0))[2] == pytest.approx(-math.radians(5.0), abs=2e-3)
    assert middle_of_threshold((0.0, 0.0, 0.0), tilt_deg=1.0)[1] < level[1] - 20.0, "tilting down moves the runway up"


def test_lines_leave_the_image_where_the_geometry_says() -> None:
    """The image's lower edge lies atan(247/f) = 11.07° below the axis, which points 3° down, and the camera 7.59 m + x
    tan 3° up.

    So the threshold leaves at 7.59 m / (tan 14.07° - tan 3°) = 38.3 m.  Its corners leave where the depth is f/329 × 15
    m = 57.6 m.
    """
    seen = {}
    for before in range(30, 70):
        height = 60.0 - (1000.0 - before) * math.tan(math.radians(3.0))
        truth = truth_at((-before - LEVER[0], 0.0, -height - LEVER[2]))
        ends = camera().view(truth, math.radians(3.0), 0.0).true_ends[1]
        seen[before] = 0.0 if np.isnan(ends).all() else ends[2] - ends[0]
    assert next(b for b in seen if seen[b] > 0.0) == 39
    assert seen[57] == pytest.approx(658.0)
    assert seen[59] < 658.0


def test_line_that_is_too_short_and_outage() -> None:
    truth = truth_at((-1000.0, 0.0, -60.0))
    assert camera(min_line_px=50.0).view(truth, 0.0, 0.0).frame.reading(1) is None
    blind = camera(outages_s=[[1.0, 2.0]])
    for time, expected in ((0.99, False), (1.0, True), (1.99, True), (2.0, False)):
        view = blind.view(truth._replace(time=time), 0.0, 0.0)
        assert (view.frame.reading(0) is None) is expected
        assert np.isfinite(view.true_ends[0]).all()


def noisy_readings(line_noise: str, number: int) -> tuple[np.ndarray, np.ndarray]:
    truth = truth_at((-300.0, 0.0, -18.0))
    config = CameraConfig.model_validate({"line_noise": line_noise, "noise_px": 1.5})
    device = LineCamera(config, LEVER, RUNWAY, default_rng(3))
    readings, ends = [], np.empty(4)
    for _ in range(number):
        view = device.view(truth, 0.0, 0.0)
        reading, ends = view.frame.reading(1), view.true_ends[1]
        assert reading is not None
        u0, _, u1, _ = ends
        middle = -(reading.a * 0.5 * (u0 + u1) + reading.c) / reading.b
        readings.append((middle - ends[1], math.atan(-reading.a / reading.b), reading.points))
    return np.array(readings), ends


@pytest.mark.parametrize("line_noise", ["endpoints", "edge-points"])
def test_noise_of_a_line_is_that_of_its_points(line_noise: str) -> None:
    """A least-squares line through N points: offset σ²/N, slope σ²/Σ(x - x̄)², which for two points is 2 σ²/length²."""
    readings, ends = noisy_readings(line_noise, 4000)
    length = ends[2] - ends[0]
    number = 2 if line_noise == "endpoints" else math.floor(length) + 1
    assert set(readings[:, 2]) == {number}
    places = np.linspace(0.0, length, number)
    lever = ((places - places.mean()) ** 2).sum()
    # 4000 draws: the deviation of a standard deviation is 1.1 %
    assert readings[:, 0].std() == pytest.approx(1.5 / math.sqrt(number), rel=0.05)
    assert readings[:, 1].std() == pytest.approx(1.5 / math.sqrt(lever), rel=0.05)
    assert abs(readings[:, 0].mean()) < 4.0 * 1.5 / math.sqrt(number * 4000)


@pytest.mark.parametrize("numbers", [(2, 2, 2), (37, 0, 5), (400, 61, 333)])
def test_fitted_lines_are_those_of_their_points(numbers: tuple[int, ...]) -> None:
    """The compiled moments against `estimator.lines.fit_line` on the points themselves, made one by one."""
    rng, sigma = default_rng(sum(numbers)), 1.7
    ends = rng.uniform(0.0, 600.0, (3, 4))
    noise = rng.standard_normal(2 * sum(numbers))
    readings, seen = _fitted(ends, np.array(numbers), noise, sigma)
    across, down = noise.reshape(2, -1)
    first = 0
    for line, number in enumerate(numbers):
        if number == 0:
            assert np.isnan(readings[line]).all()
            assert np.isnan(seen[line]).all()
            continue
        begin, end = ends[line, :2], ends[line, 2:]
        middle, step = (begin + end) / 2.0, (end - begin) / (number - 1)
        places = np.arange(number) - (number - 1) / 2.0
        errors = np.stack((across[first : first + number], down[first : first + number]), axis=1)
        first += number
        fit = fit_line(middle + places[:, None] * step + sigma * errors)
        expected = (*fit.line, *fit.centroid, float(fit.spread), fit.points)
        sign = 1.0 if readings[line, :2] @ fit.line[:2] > 0.0 else -1.0
        np.testing.assert_allclose(readings[line] * (sign, sign, sign, 1.0, 1.0, 1.0, 1.0), expected, rtol=1e-9)
        for end_seen, end_true in zip(seen[line].reshape(2, 2), (begin, end), strict=True):
            off = fit.line[:2] @ end_true + fit.line[2]  # moved across the line onto it
            np.testing.assert_allclose(end_seen, end_true - off * fit.line[:2], rtol=1e-9)


def test_lens_and_mount_have_errors_that_navigation_is_not_told_of() -> None:
    """A lens that is 2 % longer and an axis that lies 0.4° lower than the mount says, by OpenCV's projection."""
    truth = truth_at((-600.0, 7.0, -35.0), (2.0, -1.0, 5.0))
    device = camera(focal_length_error=0.02)
    config = MountConfig(position_body_m=LEVER, tilt_rate_deg_s=10.0, tilt_reading_sigma_deg=0.0)
    mount = TiltMount(config, 0.1, default_rng(0), math.radians(0.4))
    assert mount.read() == math.radians(3.0)
    view = device.view(truth, mount.tilt, mount.read())
    expected = [opencv_pixel(truth, math.radians(3.4), (0.0, y, 0.0), 1.02 * F) for y in (-15.0, 15.0)]
    np.testing.assert_allclose(view.true_ends[1], np.concatenate(expected), atol=1e-6)
    assert view.frame.tilt == math.radians(3.0)
    assert device.camera.intrinsics[:2] == pytest.approx((F, F))
    for _ in range(8):
        mount.move(math.radians(10.0))
    assert mount.read() == math.radians(10.0)
    assert mount.tilt == pytest.approx(math.radians(10.4))


def test_points_are_noisier_by_the_factor() -> None:
    """The offset of a line through N points has σ²/N."""
    truth = truth_at((-300.0, 0.0, -18.0))
    device = camera(noise_px=0.5, noise_factor=3.0)
    offsets, points = [], 0.0
    for _ in range(2000):
        view = device.view(truth, 0.0, 0.0)
        reading = view.frame.reading(1)
        assert reading is not None
        u0, v0, u1, v1 = view.true_ends[1]
        offsets.append((reading.a * (u0 + u1) + reading.b * (v0 + v1)) / 2.0 + reading.c)
        points = reading.points
    assert np.std(offsets) == pytest.approx(1.5 / math.sqrt(points), rel=0.07)


def test_imu_errors_grow_by_their_factor() -> None:
    """With the same random numbers, each error is three times as large: bias, drift, white noise and scale factor."""
    states = [
        truth_at((40.0 * t, 0.0, -10.0), (3.0 * t, 2.0 * t, -5.0 * t), (40.0 + t, t, 0.5 * t)) for t in (0.0, 0.1)
    ]
    config, site = ImuConfig(), site_of(RUNWAY)
    perfect = ImuConfig.model_validate(
        dict.fromkeys((k for k in ImuConfig.model_fields if k not in ("rate_hz", "grade")), 0.0)
    )
    one, three, ideal = (
        Imu(c, site, states[0], default_rng(5)).sample(states[1])
        for c in (config, ImuConfig.model_validate({"error_factor": 3.0}), perfect)
    )
    np.testing.assert_allclose(three - ideal, 3.0 * (one - ideal), rtol=1e-7)
    assert np.abs(one - ideal).min() > 0.0
    assert imu_noise(ImuConfig.model_validate({"error_factor": 3.0})) == imu_noise(config)


def test_pitot_reads_too_much_by_its_error_of_scale() -> None:
    fast = truth_at(airspeed=40.0)
    tube = Pitot(PitotConfig(noise_mps=0.0, scale_error=0.03), 0.01, fast, default_rng(0))
    assert tube.sample(fast) == pytest.approx(41.2)


def test_imu_at_rest_feels_gravity_and_the_turning_earth() -> None:
    """At 45° north, heading north: 9.8062 m/s² upward, and ω (cos 45°, 0, -sin 45°)."""
    still = truth_at((0.0, 0.0, 0.0))
    config = ImuConfig.model_validate(
        dict.fromkeys((k for k in ImuConfig.model_fields if k not in ("rate_hz", "grade")), 0.0)
    )
    imu = Imu(config, site_of(RUNWAY), still, default_rng(0))
    sample = imu.sample(still)
    np.testing.assert_allclose(sample[3:] * 120.0, (0.0, 0.0, -9.80620), atol=1e-4)
    rate = 7.292115e-5 * math.cos(math.radians(45.0))
    np.testing.assert_allclose(sample[:3] * 120.0, (rate, 0.0, -rate), atol=1e-10)


def test_imu_errors_have_the_stated_size() -> None:
    still = truth_at((0.0, 0.0, 0.0))
    config, site = ImuConfig(), site_of(RUNWAY)
    biases, white = [], []
    for seed in range(300):
        imu = Imu(config, site, still, default_rng(seed))
        samples = np.array([imu.sample(still) for _ in range(60)])
        white.append(np.diff(samples, axis=0).std(axis=0) / math.sqrt(2.0))
        biases.append(imu.errors())
    deviation = np.std(biases, axis=0)
    hour, milli_g = math.radians(1.0) / 3600.0, 9.80665e-3
    np.testing.assert_allclose(deviation[:3], 10.0 * hour, rtol=0.15)
    # 1 mg of bias, and on the vertical axis 3e-4 of gravity besides
    np.testing.assert_allclose(deviation[3:5], milli_g, rtol=0.15)
    assert deviation[5] == pytest.approx(math.hypot(1.0, 0.3) * milli_g, rel=0.15)
    step = math.sqrt(1.0 / 120.0) / 60.0  # √s in √h, for densities per root hour
    np.testing.assert_allclose(np.mean(white, axis=0)[:3], math.radians(0.1) * step, rtol=0.05)
    np.testing.assert_allclose(np.mean(white, axis=0)[3:], 0.1 * step, rtol=0.05)


def test_imu_reports_its_errors_as_the_filter_defines_them() -> None:
    """A sample less the ideal one is errors() × interval and white noise, and nothing else."""
    config = ImuConfig.model_validate({"gyro_noise_deg_sqrt_h": 0.0, "accel_noise_mps_sqrt_h": 0.0})
    perfect = ImuConfig.model_validate(
        dict.fromkeys((k for k in ImuConfig.model_fields if k not in ("rate_hz", "grade")), 0.0)
    )
    states = [
        truth_at((40.0 * t, 0.0, -10.0), (3.0 * t, 2.0 * t, -5.0 * t), (40.0 + t, t, 0.5 * t)) for t in (0.0, 0.1, 0.2)
    ]
    site = site_of(RUNWAY)
    real, ideal = Imu(config, site, states[0], default_rng(5)), Imu(perfect, site, states[0], default_rng(5))
    for state in states[1:]:
        a, b = real.sample(state), ideal.sample(state)
        np.testing.assert_allclose(a - b, np.array(real.errors()) / 120.0, rtol=1e-9, atol=1e-15)
    assert imu_noise(config).accel_bias == pytest.approx(math.hypot(1e-3, 3e-4) * 9.80665)


def test_pitot_lags_and_is_noisy() -> None:
    before, after = truth_at(airspeed=30.0), truth_at(airspeed=40.0)
    tube = Pitot(PitotConfig.model_validate({"noise_mps": 0.0, "lag_s": 0.5}), 0.01, before, default_rng(0))
    readings = [tube.sample(after) for _ in range(50)]
    assert readings[-1] == pytest.approx(30.0 + 10.0 * (1.0 - math.exp(-1.0)), abs=1e-6)
    assert all(a < b for a, b in pairwise(readings))
    noisy = Pitot(PitotConfig.model_validate({"noise_mps": 0.3}), 0.01, after, default_rng(1))
    values = np.array([noisy.sample(after) for _ in range(5000)])
    assert values.mean() == pytest.approx(40.0, abs=0.02)
    assert values.std() == pytest.approx(0.3, rel=0.05)


def test_mount_turns_at_its_rate_and_is_read_with_its_error() -> None:
    config = MountConfig(position_body_m=LEVER, tilt_rate_deg_s=10.0, tilt_reading_sigma_deg=0.005)
    mount = TiltMount(config, 0.1, default_rng(0))
    angles = []
    for _ in range(12):
        mount.move(math.radians(10.0))
        angles.append(math.degrees(mount.tilt))
    np.testing.assert_allclose(angles, [4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0] + [10.0] * 5, atol=1e-9)
    readings = np.degrees([mount.read() for _ in range(3000)])
    assert readings.mean() == pytest.approx(10.0, abs=5e-4)
    assert readings.std() == pytest.approx(0.005, rel=0.05)
