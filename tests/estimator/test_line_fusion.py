"""The filter that takes single lines and estimates the calibration, on the flight of `flight`.

====================  ============================================================================================
consistency           normalised errors of 9 states, of 15 and of all 23 over draws, calibration drawn with the rest
one edge              an edge alone keeps the lateral error from growing, as dead reckoning does not
wrong line            is left out, while the others count
seen late             from far beside: the covariance says how far off it is
numbers               the covariance stays symmetric and positive over a whole flight
====================  ============================================================================================
"""

from dataclasses import dataclass

import flight
import numpy as np
import pytest
from numpy.random import default_rng
from outside import DEG, PAPER, WIDTH, Poses, runway_lines
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from test_fusion import drawn_start, error_of

from estimator import line_fusion
from estimator.alignment import Start
from estimator.camera import PinholeCamera
from estimator.line_fusion import LineVisionFilter
from estimator.single_lines import CONSTANTS, Calibration, gates_of
from estimator.so3 import Array, flat
from estimator.strapdown import Inertial

SIGMA = np.array(
    Calibration(
        tilt=0.1 * DEG,
        pan=0.15 * DEG,
        roll=0.1 * DEG,
        focal_length=0.003,
        principal_u=3.0,
        principal_v=3.0,
        distortion=0.0,
        width=0.3,
    )
)
DRAWS = 20


@dataclass(frozen=True)
class Drawn:
    """One draw of everything: filter, readings, and by how much each frame's lines (frames, 3, 7) are moved."""

    running: LineVisionFilter
    sensed: flight.Readings
    off: Array
    lines: Array


def filter_of(start: Start, sigma: Array) -> LineVisionFilter:
    covariance = np.zeros((15 + CONSTANTS, 15 + CONSTANTS))
    covariance[:15, :15] = start.covariance
    covariance[15:, 15:] = np.diag(sigma**2)
    return LineVisionFilter(
        PAPER, WIDTH, flight.MOUNT, flight.SITE, flight.IMU, gates_of(1e-6), Start(start.state, covariance)
    )


def moved_by(off: Array) -> Array:
    """What a calibration makes of the flight's lines: offset and angle at their places, (frames, 3, 2)."""
    t = flight.truth()
    c = Calibration(*off.tolist())
    longer = 1.0 + c.focal_length
    camera = PinholeCamera(
        longer * PAPER.fx, longer * PAPER.fy, PAPER.cx + c.principal_u, PAPER.cy + c.principal_v, 658, 494
    )
    result = np.zeros((len(flight.clean_frames()), 3, 2))
    for frame, clean in enumerate(flight.clean_frames()):
        k = frame * flight.EVERY
        pose = flight.camera_pose(t.position[k], t.R[k], float(t.tilt[k]) + c.tilt)
        R = (pose.R.T @ Rotation.from_rotvec((0.0, c.pan, c.roll)).as_matrix()).T
        seen = runway_lines(camera, Poses(pose.position, R, pose.yaw, pose.pitch, pose.roll), width=WIDTH + c.width)
        for i, (line, before) in enumerate(zip(seen, clean, strict=True)):
            if before is not None:
                a, b, _ = before.line
                turned = np.sign(line[:2] @ (a, b)) * line
                result[frame, i] = -(turned[:2] @ before.centroid + turned[2]), a * turned[1] - b * turned[0]
    return result


def drawn(seed: int, sigma: Array = SIGMA) -> Drawn:
    rng = default_rng(seed)
    start, sensed = drawn_start(rng), flight.readings(rng)
    off = sigma * rng.standard_normal(CONSTANTS)
    rows = np.stack([lines.numbers() for lines in sensed.frames])
    shift = moved_by(off) if np.any(off) else np.zeros((len(rows), 3, 2))
    a, b, _, u, v = np.moveaxis(rows[..., :5], -1, 0).copy()
    turn = shift[..., 1]
    rows[..., 0], rows[..., 1] = a * np.cos(turn) - b * np.sin(turn), a * np.sin(turn) + b * np.cos(turn)
    rows[..., 3], rows[..., 4] = u + shift[..., 0] * a, v + shift[..., 0] * b
    rows[..., 2] = -(rows[..., 0] * rows[..., 3] + rows[..., 1] * rows[..., 4])
    return Drawn(filter_of(start, sigma), sensed, off, rows)


def flown(draw: Drawn, lines: Array | None = None) -> Array:
    """Normalised errors squared (frames, 3) of 9, 15 and all that is not known exactly, and believed lines as bits."""
    lines = draw.lines if lines is None else lines
    known = np.append(np.ones(15, bool), np.diag(draw.running.augmented_covariance)[15:] > 0.0)
    rows = []
    for step in draw.sensed.steps():
        draw.running.propagate(step.sample, flight.DT)
        if step.lines is None:
            continue
        draw.running.predict()
        _, _, believed = draw.running.observe_lines(lines[step.index // flight.EVERY], np.zeros(3), step.tilt)
        e = np.append(error_of(draw.running, step.index, draw.sensed.bias), draw.off - draw.running.calibration)[known]
        P = draw.running.augmented_covariance[np.ix_(known, known)]
        rows.append((*(float(e[:k] @ np.linalg.solve(P[:k, :k], e[:k])) for k in (9, 15, len(e))), believed))
    return np.array(rows)


def test_errors_are_as_large_as_the_covariance_says_with_an_unknown_calibration() -> None:
    records = np.stack([flown(drawn(seed)) for seed in range(DRAWS)])
    assert (records[..., 3] > 0.0).mean() > 0.99
    for column, n in enumerate((9, 15, 22)):
        # at single moments: the sum over independent draws is chi-squared; both sides, once in 1000 by chance
        for frame in (30, 150, 300, 450, 540, records.shape[1] - 1):
            low, high = chi2.ppf((5e-4, 1.0 - 5e-4), n * DRAWS)
            assert low < records[:, frame, column].sum() < high, (frame, n)


def test_covariance_stays_symmetric_and_positive() -> None:
    draw = drawn(3, np.where(SIGMA == 0.0, 0.01, SIGMA))
    flown(draw)
    P = draw.running.augmented_covariance
    scale = np.sqrt(np.diag(P))
    assert (P == P.T).all()
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0.0


@pytest.mark.parametrize("kept", [0, 2])
def test_one_edge_is_worth_something(kept: int) -> None:
    """From 300 frames on: with one edge the sigma across stays below half of what it is without any line."""
    sigma = []
    for edges in ((kept,), ()):
        draw = drawn(4, np.zeros(CONSTANTS))
        lines = draw.lines.copy()
        gone = [i for i in range(3) if i not in edges]
        lines[300:, gone] = np.nan
        records = flown(draw, lines)
        assert set(records[310:, 3]) == {float(sum(1 << i for i in edges))}
        sigma.append(float(np.sqrt(draw.running.covariance[1, 1])))
        low, high = chi2.ppf((1e-6, 1.0 - 1e-6), 9)
        assert low < records[-1, 0] < high
    assert sigma[0] < 0.5 * sigma[1]


def test_a_wrong_line_is_left_out_and_the_others_count() -> None:
    """The right edge of a road 12 m further right for a hundred frames: 12 m are many pixels at any of them."""
    draw = drawn(5, np.zeros(CONSTANTS))
    lines, t = draw.lines.copy(), flight.truth()
    for frame in range(200, 300):
        k = frame * flight.EVERY
        pose = flight.camera_pose(t.position[k], t.R[k], float(t.tilt[k]))
        other = runway_lines(PAPER, pose, width=WIDTH + 24.0)[2]
        row = lines[frame, 2]
        off = other[:2] @ row[3:5] + other[2]
        row[:3], row[3:5] = other, row[3:5] - off * other[:2]
    records = flown(draw, lines)
    assert set(records[199:299, 3]) == {3.0}  # the first record is that of frame 1
    assert (records[299:320, 3].astype(int) & 4).all()
    assert records[299, 0] < chi2.isf(1e-6, 9)


@pytest.mark.parametrize("across", [-24.0, 24.0])
@pytest.mark.parametrize("frame", [300, 450])
def test_lines_seen_late_from_far_beside_do_not_make_it_sure_of_a_wrong_place(frame: int, across: float) -> None:
    """390 m and 185 m before the threshold, a state 24 m to the side of where it is, as it knows that it may be.

    The truth is within some sigma of what the filter then says; linearised once, at the predicted state, it is not.
    """
    start, lines, tilt, true = seen_from(frame, across)
    errors = []
    for far in (line_fusion.FAR, np.inf):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(line_fusion, "FAR", far)
            running = filter_of(start, np.zeros(CONSTANTS))
            believed = running.observe_lines(lines, np.zeros(3), tilt).believed
        off = true - np.array(running.state.position)
        errors.append((believed, float(off @ np.linalg.solve(running.covariance[:3, :3], off))))
    assert errors[0][0] == 7
    assert errors[0][1] < chi2.ppf(0.9999, 3)
    assert errors[1][1] > 10.0 * errors[0][1] or errors[1][0] != 7


@pytest.mark.parametrize("line", [0, 2])
@pytest.mark.parametrize("across", [-5.0, 5.0])
def test_a_wrong_edge_seen_from_afar_does_not_make_it_sure_of_a_wrong_place(line: int, across: float) -> None:
    """390 m before the threshold one edge is that of a road 40 m further out: the truth stays within some sigma."""
    start, lines, tilt, true = seen_from(300, across)
    t, k = flight.truth(), 300 * flight.EVERY
    other = runway_lines(PAPER, flight.camera_pose(t.position[k], t.R[k], tilt), width=WIDTH + 80.0)[line]
    row = lines[line]
    off = other[:2] @ row[3:5] + other[2]
    row[:3], row[3:5] = other, row[3:5] - off * other[:2]
    running = filter_of(start, np.zeros(CONSTANTS))
    believed = running.observe_lines(lines, np.zeros(3), tilt).believed
    off = true - np.array(running.state.position)
    assert not believed & (1 << line)
    assert off @ np.linalg.solve(running.covariance[:3, :3], off) < chi2.ppf(0.9999, 3)


def test_lines_that_lead_nowhere_are_not_believed() -> None:
    """18 m before the threshold and 24 m to the side the iteration does not settle: the state stays as it was."""
    start, lines, tilt, _ = seen_from(572, 24.0)
    running = filter_of(start, np.zeros(CONSTANTS))
    update = running.observe_lines(lines, np.zeros(3), tilt)
    assert (update.found, update.believed) == (7, 0)
    assert running.state.position == start.state.position


def seen_from(frame: int, across: float) -> tuple[Start, Array, float, Array]:
    """A start that is off by so many metres to the right, and may be; the frame's lines and tilt; the true position."""
    t, k = flight.truth(), frame * flight.EVERY
    (x, y, z), (vx, vy, vz) = t.position[k].tolist(), t.velocity[k].tolist()
    nominal = Inertial((x, y + across, z), (vx, vy, vz), flat(t.R[k]))
    sigma = np.array((4.0, 10.0, 2.0, 0.5, 0.5, 0.5, 2e-3, 2e-3, 8e-3, *[1e-5] * 3, *[1e-2] * 3))
    lines = drawn(6, np.zeros(CONSTANTS)).lines[frame]
    return Start(nominal, np.diag(sigma**2)), lines, float(t.tilt[k]), t.position[k]
