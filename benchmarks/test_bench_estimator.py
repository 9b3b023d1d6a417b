"""The solvers next to poselib's p3ll on the same lines, and a step of the filter."""

import math
from typing import Any, NamedTuple

import numpy as np
import poselib
import pytest
from numpy.random import default_rng

from estimator import PinholeCamera, three_line_pose, two_line_pose
from estimator.alignment import Start
from estimator.fusion import Gates, InertialVisionFilter
from estimator.innovation import LineObservation, Lines
from estimator.mount import Mount
from estimator.so3 import IDENTITY, Array
from estimator.strapdown import ImuNoise, Inertial, Site

CAMERA = PinholeCamera.from_lens(12.5e-3, 9.9e-6, 658, 494)
WIDTH = 30.0
FRAMES = 1000
CORNERS = np.array(((0.0, -15.0, 0.0), (2000.0, -15.0, 0.0), (0.0, 15.0, 0.0), (2000.0, 15.0, 0.0)))
POINTS = np.array(((0.0, -15.0, 0.0), (0.0, 0.0, 0.0), (0.0, 15.0, 0.0)))
DIRECTIONS = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))


class Scene(NamedTuple):
    """Lines (n, 3) of n frames, and the normals (n, 3, 3) of their planes, a row a line, for p3ll."""

    left: Array
    threshold: Array
    right: Array
    normals: Array


def scene(n: int) -> Scene:
    """Level cameras along the approach, one pixel of noise on each corner."""
    rng = default_rng(1)
    position = rng.uniform((-1000.0, -10.0, -60.0), (-100.0, 10.0, -20.0), (n, 3))
    offset = CORNERS - position[:, None, :]
    pixels = CAMERA.project(offset[..., [1, 2, 0]]) + rng.normal(size=(n, 4, 2))
    points = np.concatenate((pixels, np.ones((n, 4, 1))), axis=-1)
    left, right = np.cross(points[:, 0], points[:, 1]), np.cross(points[:, 2], points[:, 3])
    threshold = np.cross(points[:, 0], points[:, 2])
    K = np.array(((CAMERA.fx, 0.0, CAMERA.cx), (0.0, CAMERA.fy, CAMERA.cy), (0.0, 0.0, 1.0)))
    normals = np.stack((left, threshold, right), axis=1) @ K
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return Scene(left, threshold, right, normals)


@pytest.mark.benchmark(group="three lines, one frame")
def test_three_line_pose(benchmark: Any) -> None:
    left, threshold, right, _ = (array[0] for array in scene(1))
    result = benchmark(lambda: three_line_pose(CAMERA, left, threshold, right, runway_width=WIDTH))
    assert result.valid


@pytest.mark.benchmark(group="three lines, one frame")
def test_p3ll(benchmark: Any) -> None:
    normals = scene(1).normals[0]
    assert benchmark(lambda: poselib.p3ll(normals, POINTS, DIRECTIONS))


@pytest.mark.benchmark(group="three lines, 1000 frames")
def test_three_line_pose_batch(benchmark: Any) -> None:
    left, threshold, right, _ = scene(FRAMES)
    result = benchmark(lambda: three_line_pose(CAMERA, left, threshold, right, runway_width=WIDTH))
    assert result.valid.all()


@pytest.mark.benchmark(group="three lines, 1000 frames")
def test_p3ll_in_a_loop(benchmark: Any) -> None:
    normals = list(scene(FRAMES).normals)
    assert len(benchmark(lambda: [poselib.p3ll(n, POINTS, DIRECTIONS) for n in normals])) == FRAMES


@pytest.mark.benchmark(group="two lines")
def test_two_line_pose(benchmark: Any) -> None:
    left, _, right, _ = (array[0] for array in scene(1))
    assert benchmark(lambda: two_line_pose(CAMERA, left, right, runway_width=WIDTH, roll=0.0)).valid


@pytest.mark.benchmark(group="two lines")
def test_two_line_pose_batch(benchmark: Any) -> None:
    left, _, right, _ = scene(FRAMES)
    assert benchmark(lambda: two_line_pose(CAMERA, left, right, runway_width=WIDTH, roll=0.0)).valid.all()


SITE = Site(9.8, (0.0, 0.0, 0.0), 6.371e6)
STANDING = Inertial((-400.0, 0.0, -25.0), (0.0, 0.0, 0.0), IDENTITY)
"""A filter that hovers can be stepped for ever, and costs what one that flies does."""


def hovering() -> tuple[InertialVisionFilter, Array]:
    """A filter in a steady state, and the lines that it sees."""
    sigma = np.repeat((1.0, 0.1, 0.005, 5e-5, 1e-2), 3)
    start = Start(STANDING, np.diag(sigma**2))
    noise = ImuNoise(3e-5, 1.7e-3, 2.4e-7, 5e-5, 5e-5, 1e-2)
    mount = Mount((0.0, 0.0, 0.0), 1e-6)
    navigator = InertialVisionFilter(CAMERA, WIDTH, mount, SITE, noise, Gates(22.5, 18.5), start)
    points = np.append(CAMERA.project((CORNERS - STANDING.position)[:, [1, 2, 0]]), np.ones((4, 1)), axis=1)
    found = []
    for i, k in ((0, 1), (0, 2), (2, 3)):
        a, b, c = (np.cross(points[i], points[k]) / np.linalg.norm(points[i, :2] - points[k, :2])).tolist()
        u, v = (0.5 * (points[i, :2] + points[k, :2])).tolist()
        found.append(LineObservation(a, b, c, u, v, 0.02, 1e-5))
    return navigator, Lines(*found).numbers()


STILL = np.array((0.0, 0.0, 0.0, 0.0, 0.0, -SITE.gravity / 120.0))
"""What the inertial unit reports of it."""


@pytest.mark.benchmark(group="filter")
@pytest.mark.parametrize("lines", ["three", "two"])
def test_filter_step(benchmark: Any, lines: str) -> None:
    navigator, seen = hovering()
    if lines == "two":
        seen[1] = np.nan

    def step() -> bool:
        navigator.propagate(STILL, 1.0 / 120.0)
        navigator.predict()
        return navigator.observe(seen, 0.0).accepted

    assert benchmark(step)
    assert math.isfinite(navigator.state.position[0])


@pytest.mark.benchmark(group="filter")
def test_inertial_interval(benchmark: Any) -> None:
    navigator, _ = hovering()
    benchmark(lambda: navigator.propagate(STILL, 1.0 / 120.0))
