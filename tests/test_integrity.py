"""Navigation by single lines, late frames and a state that is handed over: what it knows of itself.

The flight is a straight line at 40 m/s without rotation, over an Earth that stands still: samples and lines by hand and
by the camera's own projection, which tests/test_sensors.py holds against the outside.
"""

import math
from typing import Any

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.stats import norm

from estimator.mount import Mount
from estimator.so3 import IDENTITY, Array
from estimator.strapdown import ATTITUDE, POSITION, VELOCITY, Inertial, Site, corrected, inertial
from landsim.config import CameraConfig, ImuConfig, NavigationConfig, load_aircraft
from landsim.handover import handed_over
from landsim.integrity import LineMonitor, is_strained, protection_factor
from landsim.navigation import Navigator
from landsim.runway import Runway
from landsim.scene import incidence_of
from landsim.sensors import LineCamera, camera_of, imu_noise
from landsim.state import Alarm, CameraFrame
from landsim.truth import NUMBERS, Truth

DT, EVERY, SPEED = 1.0 / 120.0, 4, 40.0
STILL = Site(9.8, (0.0, 0.0, 0.0), math.inf)
SAMPLE = np.array((0.0, 0.0, 0.0, 0.0, 0.0, -9.8 * DT))
TILT = math.radians(3.0)


def truth_at(step: int) -> Truth:
    motion = np.zeros(NUMBERS)
    time = step * DT
    motion[:15] = Inertial((-600.0 + SPEED * time, 2.0, -40.0), (SPEED, 0.0, 0.0), IDENTITY).numbers()[:15]
    return Truth(time, motion, SPEED)


def frames(noise: float = 1.0) -> list[CameraFrame]:
    """One every `EVERY` steps, twelve seconds long."""
    runway = Runway(2000.0, 30.0, 0.0, 0.0, 0.0, 0.0)
    camera = LineCamera(CameraConfig(noise_px=noise), (0.0, 0.0, 0.0), runway, default_rng(1))
    return [camera.view(truth_at(step), TILT, TILT).frame for step in range(0, 1440, EVERY)]


def navigator_of(latency: float = 0.0, **settings: Any) -> Navigator:
    config = NavigationConfig.model_validate({"start": "handover", **settings})
    start = handed_over(truth_at(0), config, imu_noise(ImuConfig()), default_rng(2))
    return Navigator(
        camera_of(CameraConfig()),
        1.0,
        30.0,
        STILL,
        imu_noise(ImuConfig()),
        DT,
        Mount((0.0, 0.0, 0.0), 0.0),
        config,
        incidence_of(load_aircraft("pioneer")),
        latency,
        start,
    )


def flown(navigator: Navigator, seen: list[CameraFrame], steps: int, lag: int = 0) -> list[Array]:
    """Fly, each frame delivered `lag` steps after its capture; the filter's own state after each step."""
    states = []
    for step in range(steps):
        if step > 0:
            navigator.propagate(SAMPLE.copy())
        frame, rest = divmod(step - lag, EVERY)
        if rest == 0 and 0 <= frame < len(seen):
            navigator.observe(seen[frame])
        assert navigator.filter is not None
        states.append(navigator.filter.nominal[:15].copy())
    return states


@pytest.mark.parametrize("aiding", ["pose", "lines"])
@pytest.mark.parametrize("lag", [6, 24])
def test_late_frames_are_used_at_their_capture(aiding: str, lag: int) -> None:
    """The filter that runs behind is the one without latency, bit for bit; the present is it, carried on."""
    seen = frames()
    now, late = navigator_of(aiding=aiding), navigator_of(lag * DT, aiding=aiding)
    at_once, behind = flown(now, seen, 600), flown(late, seen, 600 + lag, lag)
    for step in (0, 100, 399, 599):
        assert np.array_equal(behind[step + lag], at_once[step])
    state = late.state(0.0)
    true = truth_at(599 + lag)
    error = np.array(state.position) - true.motion[:3]
    assert late.covariance is not None
    assert now.covariance is not None
    sigma = np.sqrt(np.diag(late.covariance)[:3])
    assert (np.abs(error) < 4.0 * sigma).all()
    assert abs(error[0]) < 0.5 * SPEED * lag * DT  # and not where it was when the frame was taken
    assert (sigma > np.sqrt(np.diag(now.covariance)[:3])).all()


def test_what_is_known_without_latency_is_the_filters() -> None:
    navigator = navigator_of()
    flown(navigator, frames(), 50)
    assert navigator.known is navigator.filter


def test_a_handed_over_state_is_off_by_its_covariance() -> None:
    """Over draws; a full turn of nothing: true less estimated, as the filter's errors are."""
    config, imu = NavigationConfig(handover_cross_sigma_m=2.0, handover_heading_sigma_deg=1.0), imu_noise(ImuConfig())
    rng, true = default_rng(3), truth_at(0)
    errors = []
    for _ in range(2000):
        start = handed_over(true, config, imu, rng)
        position, velocity, _ = start.state
        back = corrected(start.state.numbers(), np.zeros(15))
        turn = inertial(back).attitude
        errors.append((*(true.motion[:3] - position), *(true.motion[3:6] - velocity), turn[5], -turn[2], turn[1]))
    sigma = np.sqrt(np.diag(start.covariance))
    assert sigma[POSITION] == pytest.approx((3.0, 2.0, 4.0))
    assert sigma[VELOCITY] == pytest.approx(0.2)
    assert np.degrees(sigma[ATTITUDE]) == pytest.approx((0.2, 0.2, 1.0))
    assert np.std(errors, axis=0) == pytest.approx(sigma[:9], rel=0.07)
    assert np.abs(np.mean(errors, axis=0) / sigma[:9]).max() < 0.1


@pytest.mark.parametrize("risk", [1e-2, 1e-4, 1e-7])
def test_protection_factor(risk: float) -> None:
    assert protection_factor(risk) == pytest.approx(norm.isf(0.5 * risk), rel=1e-9)


def test_protection_levels_are_sigmas_times_the_factor() -> None:
    navigator = navigator_of(aiding="lines", integrity_risk=1e-3)
    flown(navigator, frames(), 200)
    state = navigator.state(0.0)
    assert navigator.covariance is not None
    sigma = np.sqrt(np.diag(navigator.covariance))
    assert state.lateral_protection == pytest.approx(3.2905 * sigma[1], rel=1e-4)
    assert state.vertical_protection == pytest.approx(3.2905 * sigma[2], rel=1e-4)
    inflated = navigator_of(aiding="lines", integrity_risk=1e-3, protection_inflation=1.5)
    flown(inflated, frames(), 200)
    assert inflated.state(0.0).lateral_protection == pytest.approx(1.5 * state.lateral_protection)


def monitor_after(*frames_of: tuple[int, int, int]) -> tuple[LineMonitor, float]:
    """A monitor after runs of frames, 30 a second: how many, lines found, lines believed."""
    monitor, time = LineMonitor(0.3, 2.0), 0.0
    for count, found, believed in frames_of:
        for _ in range(count):
            time += 1.0 / 30.0
            monitor.take(time, found, believed)
    return monitor, time


def test_a_line_left_out_for_long_enough_is_wrong_until_it_is_believed_as_long() -> None:
    for count, alarm in ((8, Alarm.NONE), (10, Alarm.WRONG_LINE)):
        monitor, time = monitor_after((30, 7, 7), (count, 7, 5))
        assert monitor.alarm(time) == alarm
    assert monitor.wrong == 2
    monitor, time = monitor_after((30, 7, 7), (10, 7, 5), (8, 7, 7))
    assert monitor.alarm(time) == Alarm.WRONG_LINE
    monitor, time = monitor_after((30, 7, 7), (10, 7, 5), (10, 7, 7))
    assert monitor.alarm(time) == Alarm.NONE
    # one that is not seen says nothing, for or against
    monitor, time = monitor_after((30, 7, 7), (10, 7, 5), (60, 5, 5))
    assert monitor.alarm(time) == Alarm.WRONG_LINE


def test_of_a_line_that_never_agreed_it_is_not_known_whether_it_is_the_line_that_is_wrong() -> None:
    """The right edge first seen when the left one has long been believed, which may be the wrong one of the two."""
    monitor, time = monitor_after((60, 1, 1), (12, 5, 1))
    assert monitor.alarm(time) == Alarm.WRONG_LINE | Alarm.INCONSISTENT
    for count, alarm in ((7, Alarm.WRONG_LINE | Alarm.INCONSISTENT), (11, Alarm.WRONG_LINE)):
        monitor, time = monitor_after((60, 1, 1), (count, 5, 5), (12, 5, 1))
        assert monitor.alarm(time) == alarm


def test_constants_that_cannot_be_say_that_the_state_may_be_wrong() -> None:
    sigma = np.array((0.1, 0.0, 2.0))
    assert not is_strained(np.array((0.49, 0.0, -9.9)), sigma)
    assert is_strained(np.array((0.0, 0.0, -10.1)), sigma)
    monitor, time = monitor_after((30, 7, 7))
    monitor.take(time, 7, 7, strained=True)
    assert monitor.alarm(time) == Alarm.INCONSISTENT
    monitor.take(time, 7, 7)
    assert monitor.alarm(time) == Alarm.NONE


def test_edges_that_lie_wrong_from_the_start_strain_the_width() -> None:
    """Two edges 34 m apart where 30 m are believed, to 0.1 m: the lines agree, each frame, and the alarm stands."""
    runway = Runway(2000.0, 34.0, 0.0, 0.0, 0.0, 0.0)
    camera = LineCamera(CameraConfig(noise_px=1.0), (0.0, 0.0, 0.0), runway, default_rng(1))
    seen = [camera.view(truth_at(step), TILT, TILT).frame for step in range(0, 720, EVERY)]
    navigator = navigator_of(aiding="lines", width_sigma_m=0.1, handover_along_sigma_m=50.0)
    flown(navigator, seen, 720)
    assert navigator.state(6.0).alarm & Alarm.INCONSISTENT


def test_no_line_for_long_and_lines_that_all_disagree() -> None:
    monitor, time = monitor_after((30, 7, 7), (59, 0, 0))
    assert monitor.alarm(time) == Alarm.NONE
    assert monitor.alarm(time + 0.1) == Alarm.UNAIDED
    monitor, time = monitor_after((30, 7, 7), (10, 7, 0))
    assert monitor.alarm(time) == Alarm.WRONG_LINE | Alarm.INCONSISTENT


@pytest.mark.parametrize("line", [0, 1, 2])
def test_a_wrong_line_in_flight_raises_the_alarm_within_a_second(line: int) -> None:
    """From the fifth second on one line is that of a runway 8 m further to the right or beyond."""
    seen = frames()
    other = LineCamera(
        CameraConfig(noise_px=1.0), (0.0, 0.0, 0.0), Runway(2000.0, 30.0, 0.0, 0.0, 0.0, 0.0), default_rng(1)
    )
    for frame in range(150, len(seen)):
        moved = truth_at(frame * EVERY)
        motion = moved.motion.copy()
        motion[0 if line == 1 else 1] -= 8.0
        wrong = other.view(moved._replace(motion=motion), TILT, TILT).frame
        seen[frame].lines[line] = wrong.lines[line]
    navigator = navigator_of(aiding="lines")
    flown(navigator, seen, 600)
    assert navigator.state(5.0).alarm == Alarm.NONE
    navigator = navigator_of(aiding="lines")
    flown(navigator, seen, 720)
    state = navigator.state(6.0)
    assert state.alarm == Alarm.WRONG_LINE
    error = np.array(state.position) - truth_at(719).motion[:3]
    assert abs(error[1]) < 0.5
    assert abs(error[2]) < 0.5


def test_a_first_frame_that_comes_late_counts_as_no_time() -> None:
    """One frame in which a line is left out, nine seconds after the start, is no lasting disagreement."""
    monitor = LineMonitor(0.3, 2.0)
    monitor.take(9.0, 7, 5)
    assert monitor.alarm(9.0) == Alarm.NONE
    for frame in range(1, 11):
        monitor.take(9.0 + frame / 30.0, 7, 5)
    assert monitor.alarm(9.4) & Alarm.WRONG_LINE
