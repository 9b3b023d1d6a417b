"""Single lines as measurements of the filter's errors and of the calibration.

====================  ============================================================================================
d, H of the body      lines of a displaced truth, projected in the test, by finite differences
H of the calibration  the same with a camera that is turned, longer, shifted or distorting, and a wider runway
information           with all lines it is that of the pose
belief                a line that is off is left out; of two that disagree neither is believed
gates                 scipy's χ²
====================  ============================================================================================
"""

import math

import numpy as np
import pytest
from numpy.random import default_rng
from outside import PAPER, WIDTH, Poses, derivative, runway_lines
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from test_innovation import EARLY, LATE, MOUNT, PLACES, SIGMAS, Body, innovation, lines_of

from estimator.camera import PinholeCamera
from estimator.innovation import Eye
from estimator.mount import Mount
from estimator.single_lines import (
    AUGMENTED,
    CONSTANTS,
    NO_CALIBRATION,
    Calibration,
    believed_lines,
    gates_of,
    line_residuals,
    lines_innovation,
)
from estimator.so3 import Array, flat

NO_EXTENT = np.zeros(3)


def numbers(body: Body) -> Array:
    return np.array((*body.position, 0.0, 0.0, 0.0, *flat(body.R)))


def residuals(seen: Array, estimated: Body, calibration: Array = NO_CALIBRATION, extent: Array = NO_EXTENT) -> Array:
    eye = Eye(PAPER, WIDTH, MOUNT).numbers()
    d, _ = line_residuals(eye, seen, extent, numbers(estimated), calibration, estimated.tilt)
    return d


def seen_by(truth: Body, estimated: Body, off: Calibration) -> Array:
    """Lines (3, 7) that a camera sees which differs from what is believed, each through its own place."""
    pose = truth.camera(tilt_error=off.tilt)
    # about the camera's own axes: down for pan, forward for roll
    turned = pose.R.T @ Rotation.from_rotvec((0.0, off.pan, off.roll)).as_matrix()
    longer = 1.0 + off.focal_length
    camera = PinholeCamera(
        longer * PAPER.fx, longer * PAPER.fy, PAPER.cx + off.principal_u, PAPER.cy + off.principal_v, 658, 494
    )
    pose = Poses(pose.position, turned.T, pose.yaw, pose.pitch, pose.roll)
    return lines_of(camera, runway_lines(camera, pose, width=WIDTH + off.width), early=True).numbers()


@pytest.mark.parametrize("body", EARLY + LATE)
def test_residuals_are_the_errors_through_h(body: Body) -> None:
    eye = Eye(PAPER, WIDTH, MOUNT).numbers()
    nothing = Calibration()
    seen = seen_by(body, body, nothing)
    d, H = line_residuals(eye, seen, NO_EXTENT, numbers(body), NO_CALIBRATION, body.tilt)
    assert d == pytest.approx(0.0, abs=1e-9)
    step = np.repeat((1e-5, 1e-5, 1e-6, 1e-6, 1e-6), 3)
    by_difference = derivative(lambda e: residuals(seen_by(body.displaced(e), body, nothing), body), np.zeros(15), step)
    size = np.abs(by_difference).max(axis=1, keepdims=True)
    assert (np.abs(H[:, :15] - by_difference) / size).max() < 1e-5


@pytest.mark.parametrize("body", EARLY + LATE)
@pytest.mark.parametrize("name", [name for name in Calibration._fields if name != "distortion"])
def test_residuals_are_the_calibration_through_h(body: Body, name: str) -> None:
    eye = Eye(PAPER, WIDTH, MOUNT).numbers()
    _, H = line_residuals(eye, seen_by(body, body, Calibration()), NO_EXTENT, numbers(body), NO_CALIBRATION, body.tilt)
    column = 15 + Calibration._fields.index(name)

    def of(error: Array) -> Array:
        return residuals(seen_by(body, body, Calibration(**{name: float(error[0])})), body)

    by_difference = derivative(of, np.zeros(1), 1e-6)[:, 0]
    assert np.abs(by_difference).max() > 1e-3
    assert H[:, column] == pytest.approx(by_difference, abs=2e-5 * np.abs(by_difference).max())


@pytest.mark.parametrize("name", [name for name in Calibration._fields if name != "distortion"])
def test_what_is_estimated_is_taken_off(name: str) -> None:
    """With the calibration known there is nothing left of it, at sizes far beyond first order."""
    size = {"focal_length": 0.02, "principal_u": 6.0, "principal_v": -7.0, "width": 0.8}.get(name, 0.02)
    off = Calibration(**{name: size})
    seen = seen_by(EARLY[1], EARLY[1], off)
    assert np.abs(residuals(seen, EARLY[1])).max() > 0.1
    assert residuals(seen, EARLY[1], np.array(off)) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("body", EARLY)
def test_distortion_of_points_along_the_line(body: Body) -> None:
    """Points are moved outwards one by one and fitted by numpy; both numbers come out of the closed form."""
    kappa = 0.02
    eye = Eye(PAPER, WIDTH, MOUNT).numbers()
    rows, extent, slopes = [], [], []
    for line in runway_lines(PAPER, body.camera()):
        a, b, c = line / math.hypot(line[0], line[1])
        along = np.linspace(-60.0, 90.0, 400)
        foot = np.array((330.0, 280.0)) - (330.0 * a + 280.0 * b + c) * np.array((a, b))
        points = foot + along[:, None] * np.array((b, -a))
        r = points - (PAPER.cx, PAPER.cy)
        seen = points + kappa * r * ((r / (PAPER.fx, PAPER.fy)) ** 2).sum(axis=1, keepdims=True)
        across, position = seen @ (a, b) + c, seen @ (b, -a)
        slope, _ = np.polyfit(position, across, 1)
        u, v = seen.mean(axis=0)
        turned = np.array((a, b)) - slope * np.array((b, -a))
        turned /= np.linalg.norm(turned)
        rows.append((*turned, -turned @ (u, v), u, v, 1.0, 1.0))
        extent.append(position.var())
        slopes.append(slope)
    assert np.abs(slopes).max() > 1e-5
    d, H = line_residuals(eye, np.array(rows), np.array(extent), numbers(body), NO_CALIBRATION, body.tilt)
    by_distortion = H[:, 15 + Calibration._fields.index("distortion")] * kappa
    assert d == pytest.approx(by_distortion, rel=0.03, abs=0.01 * np.abs(by_distortion).max())


def test_all_lines_tell_what_the_pose_tells() -> None:
    """The same gain on the same residuals: Hᵀ R⁻¹ H and Hᵀ R⁻¹ y of either form."""
    mount = Mount(MOUNT.lever, (0.05 * math.pi / 180.0) ** 2)
    truth = EARLY[1].displaced(np.array((3.0, 0.4, -0.3, 0, 0, 0, 0.004, -0.002, 0.003, 0, 0, 0, 0, 0, 0)))
    pose = innovation(PAPER, truth, EARLY[1], early=True, mount=mount)
    lines = lines_of(PAPER, runway_lines(PAPER, truth.camera()), early=True).numbers()
    y, H, R, found, believed, _ = lines_innovation(
        Eye(PAPER, WIDTH, mount).numbers(),
        lines,
        NO_EXTENT,
        numbers(EARLY[1]),
        NO_CALIBRATION,
        EARLY[1].tilt,
        np.diag(np.append(np.full(15, 1.0), np.zeros(CONSTANTS))),
        np.full(3, np.inf),
        np.zeros(AUGMENTED),
    )
    assert (found, believed, H.shape) == (7, 7, (6, AUGMENTED))
    weighed, of_pose = np.linalg.solve(R, H[:, :15]), np.linalg.solve(pose.R, pose.H)
    information = pose.H.T @ of_pose
    size = np.sqrt(np.outer(np.diag(information), np.diag(information))) + 1e-300
    assert (np.abs(H[:, :15].T @ weighed - information) / size).max() < 1e-6
    assert weighed.T @ y == pytest.approx(of_pose.T @ pose.y, rel=1e-6, abs=1e-6 * np.abs(of_pose.T @ pose.y).max())


def test_a_line_that_disagrees_is_left_out() -> None:
    S, gates = np.eye(6), gates_of(1e-4)
    assert believed_lines(np.array((0.5, 0.1, 9.0, 0.0, -1.0, 0.3)), S, gates)[:2] == (7, 5)
    missing = np.array((0.5, 0.1, np.nan, np.nan, -1.0, 0.3))
    found, believed, nis = believed_lines(missing, S, gates)
    assert (found, believed) == (5, 5)
    assert nis == pytest.approx(0.25 + 0.01 + 1.0 + 0.09)
    assert believed_lines(np.full(6, np.nan), S, gates)[:2] == (0, 0)


def test_lines_that_disagree_with_each_other() -> None:
    """Where the prediction knows little, one line cannot be told from the state, but from the other two."""
    vague = np.full((6, 6), 100.0) * (np.arange(6) % 2 == 0) * (np.arange(6) % 2 == 0)[:, None] + np.eye(6)
    gates = gates_of(1e-4)
    third = np.array((10.0, 0.0, -9.0, 0.0, 10.5, 0.0))
    assert believed_lines(third, vague, gates)[:2] == (7, 5)
    two = np.array((10.0, 0.0, np.nan, np.nan, -9.0, 0.0))
    found, believed, nis = believed_lines(two, vague, gates)
    assert (found, believed) == (5, 0)
    assert nis == pytest.approx(two[[0, 1, 4, 5]] @ np.linalg.solve(vague[:4, :4], two[[0, 1, 4, 5]]))


def test_of_two_that_could_be_wrong_neither_is_believed() -> None:
    """Edges that contradict each other, and a threshold that agrees with either."""
    S = np.eye(6)
    S[0, 4] = S[4, 0] = 0.9
    edges = np.array((3.0, 0.0, 0.3, -0.2, -3.0, 0.0))
    found, believed, nis = believed_lines(edges, S, gates_of(1e-4))
    assert (found, believed) == (7, 2)
    assert nis == pytest.approx(0.09 + 0.04)


def test_where_none_is_believed_the_square_is_of_all_that_was_found() -> None:
    d = np.array((100.0, 0.0, 3.5, 3.5, -3.5, -3.5))
    found, believed, nis = believed_lines(d, np.eye(6), gates_of(1e-4))
    assert (found, believed) == (7, 0)
    assert nis == pytest.approx(1e4 + 4.0 * 3.5**2)


@pytest.mark.parametrize("probability", [1e-2, 1e-6])
def test_gates(probability: float) -> None:
    assert gates_of(probability) == pytest.approx(chi2.isf(probability, (2, 4, 6)), rel=1e-9)


def test_sampled_residuals_are_as_large_as_their_covariance() -> None:
    rng = default_rng(3)
    body = EARLY[1]
    seen = seen_by(body, body, Calibration())
    noisy = []
    for _ in range(4000):
        lines = seen.copy()
        for i, (offset, angle) in enumerate(SIGMAS):
            turn, shift = angle * rng.standard_normal(), offset * rng.standard_normal()
            a, b = lines[i, :2]
            a, b = a * math.cos(turn) - b * math.sin(turn), a * math.sin(turn) + b * math.cos(turn)
            u, v = lines[i, 3] + shift * a, lines[i, 4] + shift * b
            lines[i, :5] = a, b, -(a * u + b * v), u, v
        noisy.append(residuals(lines, body))
    sigma = np.ravel(SIGMAS)
    assert np.std(noisy, axis=0) == pytest.approx(sigma, rel=0.05)
    assert len(PLACES) == 3
