"""First-order covariance of both poses.

====================  ============================================================================================
equations             finite differences of lines projected in the test
6 × 6 and 4 × 4       finite differences through the solvers; sampling at noise small enough to be first order
percentiles           68.27th of the absolute error at four ranges, both readings of the noise, from other code
====================  ============================================================================================
"""

import numpy as np
import pytest
from numpy.random import default_rng
from outside import (
    DEG,
    LENGTH,
    ODD,
    PAPER,
    WIDTH,
    Poses,
    camera_rotation,
    derivative,
    image_line,
    poses_of,
    rotation_angle,
    runway_lines,
    visible,
)
from scipy.spatial.transform import Rotation

from estimator import fit_line, three_line_pose, two_line_pose
from estimator.camera import PinholeCamera
from estimator.covariance import (
    LEFT,
    RIGHT,
    THRESHOLD,
    LineNoise,
    line_equations,
    predicted_line,
    three_line_covariance,
    two_line_covariance,
)
from estimator.so3 import Array

GEOMETRY = {
    LEFT: ((0.0, -WIDTH / 2, 0.0), (1.0, 0.0, 0.0)),
    THRESHOLD: ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    RIGHT: ((0.0, WIDTH / 2, 0.0), (1.0, 0.0, 0.0)),
}
CASES = [
    poses_of(np.array((-600.0, 12.0, -38.0)), 0.04, -0.08, 0.06),
    poses_of(np.array((-90.0, -4.0, -12.0)), -0.03, -0.1, -0.2),
    poses_of(np.array((-250.0, 40.0, -90.0)), -0.2, -0.3, 0.5),
]
SIGMAS = [(0.3, 0.004), (0.5, 0.006), (0.2, 0.003)]
"""Offset (px) and angle (rad) of left edge, threshold and right edge."""


def moved(pose: Poses, change: Array) -> Poses:
    """The pose with the camera shifted and turned, by a vector in the runway frame of either."""
    R = (Rotation.from_rotvec(change[3:]) * Rotation.from_matrix(pose.R.T)).as_matrix().T
    return Poses(pose.position + change[:3], R, pose.yaw, pose.pitch, pose.roll)


def middle(line: Array, towards: tuple[float, float]) -> Array:
    """The pixel of a line next to a given one."""
    a, b, c = line
    off = (a * towards[0] + b * towards[1] + c) / (a * a + b * b)
    return np.array((towards[0] - off * a, towards[1] - off * b))


@pytest.mark.parametrize("pose", CASES)
@pytest.mark.parametrize("line", [LEFT, THRESHOLD, RIGHT])
def test_equations_by_finite_differences(pose: Poses, line: int) -> None:
    axes = [tuple(row) for row in pose.R.tolist()]
    predicted = predicted_line(ODD.intrinsics, line, pose.position.tolist(), axes, WIDTH)
    point, direction = (np.array(vector) for vector in GEOMETRY[line])
    clean = image_line(ODD, pose, point, direction)
    gradient = np.hypot(clean[0], clean[1])
    assert predicted.gradient == pytest.approx(gradient)
    assert (predicted.a, predicted.b, predicted.c) == pytest.approx(clean, rel=1e-9)
    normal = np.cross(point - pose.position, direction)
    assert predicted.normal == pytest.approx(normal)

    # what a pixel of the line, and a step of one pixel along it, see of a moving camera
    here, along = middle(clean, (310.0, 300.0)), np.array((clean[1], -clean[0])) / gradient

    def residuals(change: Array) -> Array:
        a, b, c = image_line(ODD, moved(pose, change), point, direction) / gradient
        return np.array((a * here[0] + b * here[1] + c, a * along[0] + b * along[1]))

    offset, angle = derivative(residuals, np.zeros(6), np.repeat((1e-2, 1e-5), 3))
    equations = line_equations(ODD.intrinsics, line, predicted, axes, here[0], here[1])
    # (D × N)·ψ = share of the offset and share of the angle, N·dC = share of the offset - turn·ψ: for a unit of each of
    # dC and ψ
    turned = np.append(np.zeros(3), np.cross(direction, normal))
    shares = equations.offset_share * offset + equations.angle_share * angle
    assert shares == pytest.approx(turned, rel=1e-6, abs=1e-6 * np.abs(turned).max())
    shifted = np.append(normal, equations.turn)
    assert equations.plane_share * offset == pytest.approx(shifted, rel=1e-6, abs=1e-6 * np.abs(shifted).max())


def noise_of(lines: tuple[Array, ...], sigmas: list[tuple[float, float]]) -> list[LineNoise]:
    """Different noise for each line, its points about different pixels."""
    places = ((150.0, 300.0), (330.0, 250.0), (450.0, 330.0))
    result = []
    for line, at, (offset, angle) in zip(lines, places, sigmas, strict=False):
        u, v = middle(line, at).tolist()
        result.append(LineNoise(u, v, offset**2, angle**2))
    return result


def disturbed(line: Array, noise: LineNoise, offset: Array, angle: Array) -> Array:
    """The line shifted across itself and turned about the centroid of its points."""
    a, b = line[0], line[1]
    turned_a, turned_b = a * np.cos(angle) - b * np.sin(angle), a * np.sin(angle) + b * np.cos(angle)
    return np.stack((turned_a, turned_b, offset - turned_a * noise.u - turned_b * noise.v), axis=-1)


def early_errors(camera: PinholeCamera, pose: Poses, noise: list[LineNoise], errors: Array) -> Array:
    """Error (..., 6) of the three-line pose, from those (..., 6) of the lines: offset and angle of each."""
    lines = runway_lines(camera, pose)
    noisy = [
        disturbed(line, n, errors[..., 2 * i], errors[..., 2 * i + 1])
        for i, (line, n) in enumerate(zip(lines, noise, strict=True))
    ]
    result = three_line_pose(camera, *noisy, runway_width=WIDTH)
    assert result.valid.all()
    turn = np.swapaxes(result.R_cam_from_runway, -1, -2) @ pose.R  # R_runway_from_cam over the true one
    vector = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(turn.shape[:-1])
    return np.concatenate((result.position - pose.position, vector), axis=-1)


def late_errors(camera: PinholeCamera, pose: Poses, noise: list[LineNoise], errors: Array, roll_error: Array) -> Array:
    """Error (..., 4) of the two-line pose."""
    left, _, right = runway_lines(camera, pose)
    result = two_line_pose(
        camera,
        disturbed(left, noise[0], errors[..., 0], errors[..., 1]),
        disturbed(right, noise[1], errors[..., 2], errors[..., 3]),
        runway_width=WIDTH,
        roll=pose.roll + roll_error,
    )
    truth = np.array((pose.yaw, pose.pitch, pose.position[1], -pose.position[2]))
    return np.asarray(np.stack((result.yaw, result.pitch, result.lateral, result.height), axis=-1) - truth)


def assert_alike(got: Array, expected: Array, tolerance: float) -> None:
    """Covariances equal to a share of the standard deviations."""
    size = np.sqrt(np.diag(expected))
    assert (np.abs(got - expected) / np.outer(size, size)).max() < tolerance


@pytest.mark.parametrize("pose", CASES)
@pytest.mark.parametrize("camera", [PAPER, ODD])
def test_three_line_covariance(camera: PinholeCamera, pose: Poses) -> None:
    noise = noise_of(runway_lines(camera, pose), SIGMAS)
    got = three_line_covariance(camera, *noise, position=pose.position, R_cam_from_runway=pose.R, runway_width=WIDTH)
    sigma = np.ravel(SIGMAS)
    J = derivative(lambda e: early_errors(camera, pose, noise, e), np.zeros(6), 1e-3 * sigma)
    assert_alike(got, J * sigma**2 @ J.T, 1e-5)

    # 40,000 draws know a variance to 0.7 %; a hundredth of the noise is far inside first order
    errors = 0.01 * sigma * default_rng(1).standard_normal((40_000, 6))
    assert_alike(1e-4 * got, np.cov(early_errors(camera, pose, noise, errors).T), 0.04)


@pytest.mark.parametrize("pose", [*CASES, poses_of(np.array((150.0, 2.0, -3.0)), 0.01, -0.17, 0.02)])
@pytest.mark.parametrize("camera", [PAPER, ODD])
@pytest.mark.parametrize("roll_sigma", [0.0, 0.004])
def test_two_line_covariance(camera: PinholeCamera, pose: Poses, roll_sigma: float) -> None:
    left, _, right = runway_lines(camera, pose)
    sigmas = SIGMAS[:2]
    noise = noise_of((left, right), sigmas)
    got = two_line_covariance(
        camera,
        *noise,
        lateral=pose.position[1],
        height=-pose.position[2],
        R_cam_from_runway=pose.R,
        runway_width=WIDTH,
        roll_variance=roll_sigma**2,
    )
    step = 1e-3 * np.append(np.ravel(sigmas), 0.004)
    variances = np.append(np.ravel(sigmas), roll_sigma) ** 2
    J = derivative(lambda e: late_errors(camera, pose, noise, e[:4], e[4]), np.zeros(5), step)
    assert_alike(got, J * variances @ J.T, 1e-5)

    errors = 0.01 * np.sqrt(variances) * default_rng(2).standard_normal((40_000, 5))
    sampled = np.cov(late_errors(camera, pose, noise, errors[:, :4], errors[:, 4]).T)
    assert_alike(1e-4 * got, sampled, 0.04)


def test_a_centroid_beside_the_predicted_line_counts_where_it_is_next_to_it() -> None:
    pose = CASES[1]
    lines = runway_lines(ODD, pose)
    on = noise_of(lines, SIGMAS)
    beside = [n._replace(u=n.u + 8.0 * line[0], v=n.v + 8.0 * line[1]) for n, line in zip(on, lines, strict=True)]
    expected, got = (
        three_line_covariance(ODD, *noise, position=pose.position, R_cam_from_runway=pose.R, runway_width=WIDTH)
        for noise in (on, beside)
    )
    assert_alike(got, expected, 1e-9)


def test_batches_broadcast_and_degenerate_geometry_is_nan() -> None:
    noise = noise_of(runway_lines(PAPER, CASES[0]), SIGMAS)
    positions = np.stack([case.position for case in CASES] + [np.zeros(3)])
    rotations = np.stack([case.R for case in CASES] + [CASES[0].R])
    batch = three_line_covariance(PAPER, *noise, position=positions, R_cam_from_runway=rotations, runway_width=WIDTH)
    assert batch.shape == (4, 6, 6)
    alone = three_line_covariance(
        PAPER, *noise, position=positions[1], R_cam_from_runway=rotations[1], runway_width=WIDTH
    )
    assert batch[1] == pytest.approx(alone, rel=1e-9)
    assert np.isnan(batch[3]).all()  # on the ground, in the plane of all three lines


def glide(distance: float) -> Poses:
    """The published simulation: 3° from (-1000, 0, -60) m, camera 3° down."""
    height = 60.0 - (1000.0 - distance) * np.tan(3.0 * DEG)
    return poses_of(np.array((-distance, 0.0, -height)), 0.0, -3.0 * DEG, 0.0)


# 68.27th percentiles of the absolute error: roll, pitch, yaw (deg), cross, altitude, along (m), from 50,000 draws of an
# independent implementation
TABLE = [
    (1000.0, "endpoints", (3.03, 0.296, 0.176, 3.82, 6.89, 56.0)),
    (1000.0, "edge-points", (1.18, 0.0928, 0.0664, 1.44, 2.32, 15.3)),
    (400.0, "endpoints", (1.21, 0.119, 0.0892, 0.982, 1.16, 10.5)),
    (400.0, "edge-points", (0.304, 0.0274, 0.0215, 0.251, 0.303, 2.15)),
    (200.0, "endpoints", (0.606, 0.0783, 0.0732, 0.455, 0.386, 3.26)),
    (200.0, "edge-points", (0.107, 0.0140, 0.0130, 0.0886, 0.0805, 0.500)),
    (60.0, "edge-points", (0.0181, 0.00597, 0.00852, 0.0187, 0.0108, 0.0369)),
]


@pytest.mark.parametrize(("distance", "reading", "expected"), TABLE)
def test_percentiles_of_other_code(distance: float, reading: str, expected: tuple[float, ...]) -> None:
    draws, chunk = 20_000, 1_000
    rng, pose = default_rng(3), glide(distance)
    near_left, near_right = (0.0, -WIDTH / 2, 0.0), (0.0, WIDTH / 2, 0.0)
    far_left, far_right = (LENGTH, -WIDTH / 2, 0.0), (LENGTH, WIDTH / 2, 0.0)
    clean = []
    for start, end in ((near_left, far_left), (near_left, near_right), (near_right, far_right)):
        seen = visible(PAPER, pose, start, end)
        assert seen is not None
        first, last = seen.ends
        number = 2 if reading == "endpoints" else int(np.linalg.norm(last - first)) + 1
        clean.append(first + np.linspace(0.0, 1.0, number)[:, None] * (last - first))
    errors = []
    for _ in range(draws // chunk):
        lines = [fit_line(points + rng.normal(0.0, np.sqrt(2.0), (chunk, *points.shape))).line for points in clean]
        result = three_line_pose(PAPER, *lines, runway_width=WIDTH)
        assert result.valid.mean() > 0.99
        off = result.position - pose.position
        angles = (result.roll, result.pitch - pose.pitch, result.yaw)
        errors.append(np.stack((*(angle / DEG for angle in angles), off[:, 1], off[:, 2], off[:, 0]), axis=-1))
    percentiles = np.nanpercentile(np.abs(np.concatenate(errors)), 68.27, axis=0)
    assert percentiles == pytest.approx(expected, rel=0.05)


def test_a_turn_about_the_runways_vertical_is_yaw() -> None:
    pose = poses_of(np.zeros(3), 0.1, 0.0, 0.0)
    turned = moved(pose, np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.2)))
    assert rotation_angle(turned.R, camera_rotation(0.3, 0.0, 0.0)) < 1e-9
