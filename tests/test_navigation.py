"""What the loop knows and takes down, against the truth: vision poses, body rates, angle of attack."""

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import landsim
from estimator.alignment import Incidence, Start
from estimator.covariance import THRESHOLD
from estimator.fusion import NO_UPDATE, Update
from estimator.line_fusion import LineVisionFilter
from estimator.mount import Mount
from estimator.so3 import IDENTITY, Array
from estimator.strapdown import Inertial, Site
from landsim.config import CameraConfig, ImuConfig, NavigationConfig, load_aircraft
from landsim.navigation import Navigator
from landsim.scene import incidence_of
from landsim.sensors import camera_of, imu_noise
from landsim.state import CameraFrame


def test_vision_of_perfect_lines_is_the_truth() -> None:
    """Early to rounding; late but for the borrowed roll, of which an error δ costs (h + L²/(4 h)) δ across."""
    log = landsim.fly(landsim.load_scenario("landing", overrides={"camera.noise_px": 0.0}), seed=0).log
    early = np.isfinite(log["vision_along_m"])
    late = np.isfinite(log["vision_cross_m"]) & ~early
    assert early.sum() > 600
    assert late.sum() > 600
    for quantity in ("along_m", "cross_m", "height_m", "roll_deg", "pitch_deg", "yaw_deg"):
        error = np.abs(log[f"vision_{quantity}"] - log[f"true_{quantity}"])
        assert error[early].max() < 1e-6, quantity
        if quantity in ("height_m", "pitch_deg", "yaw_deg"):
            assert error[late].max() < 0.03, quantity
    h = log["true_height_m"][late]
    borrowed = np.radians(np.abs(log["fused_roll_deg"] - log["true_roll_deg"])[late])
    across = np.abs(log["vision_cross_m"] - log["true_cross_m"])[late]
    assert (across < 1.2 * (h + 225.0 / h) * borrowed + 0.01).all()


def navigator_of(config: NavigationConfig, handover: Start | None = None) -> Navigator:
    """With a rate of 100 Hz, on an Earth that turns about a leaning axis."""
    return Navigator(
        camera_of(CameraConfig()),
        1.0,
        30.0,
        Site(9.8, (1e-3, -2e-3, 3e-3), 6.4e6),
        imu_noise(ImuConfig()),
        0.01,
        Mount((0.0, 0.0, 0.0), 0.0),
        config,
        incidence_of(load_aircraft("pioneer")),
        handover=handover,
    )


def test_body_rate_is_less_bias_and_the_turning_earth() -> None:
    navigator = navigator_of(NavigationConfig())
    still = Inertial((0.0, 0.0, -9.0), (0.0, 0.0, 0.0), IDENTITY)
    bias = np.array((0.01, 0.02, -0.03, 0.0, 0.0, 0.0))
    running = SimpleNamespace(
        bias=bias, nominal=still.numbers(), state=still, covariance=np.eye(15), propagate=lambda *_: None
    )
    navigator.filter = cast("Any", running)
    navigator.propagate(np.array((0.001, 0.002, 0.003, 0.0, 0.0, 0.0)))
    # 0.1, 0.2, 0.3 rad/s as measured
    assert navigator.state(0.0).rate == pytest.approx((0.1 - 0.01 - 0.001, 0.2 - 0.02 + 0.002, 0.3 + 0.03 - 0.003))


def test_what_is_felt_is_less_bias_and_scale_factor() -> None:
    still = Inertial((0.0, 0.0, -9.0), (0.0, 0.0, 0.0), IDENTITY)
    navigator = navigator_of(NavigationConfig(aiding="lines"), Start(still, 1e-6 * np.eye(15)))
    running = navigator.filter
    assert isinstance(running, LineVisionFilter)
    running.bias = np.array((0.01, 0.02, -0.03, 0.4, 0.05, 0.6))
    running.scale_factor = np.array((0.02, -0.05, 0.04, 0.1, 0.03, 0.1))
    # 0.1, 0.2, 0.3 rad/s as measured, and 2 m/s² to the right
    navigator.propagate(np.array((0.001, 0.002, 0.003, 0.0, 0.02, -0.098)))
    state = navigator.state(0.0)
    expected = (0.1 - 0.01 - 0.002 - 0.001, 0.2 - 0.02 + 0.01 + 0.002, 0.3 + 0.03 - 0.012 - 0.003)
    assert state.rate == pytest.approx(expected, abs=2e-5)  # the Earth's share turns by as much as the body
    assert state.side_force == pytest.approx(2.0 - 0.05 - 0.06)


@pytest.mark.parametrize(("handover", "three_again"), [("in-view", True), ("latched", False)])
def test_latched_handover_leaves_a_threshold_that_comes_back_alone(handover: str, three_again: bool) -> None:
    navigator = navigator_of(NavigationConfig.model_validate({"handover": handover}))
    taken: list[bool] = []

    def observe(lines: Array, _: float) -> Update:
        taken.append(bool(np.isfinite(lines[THRESHOLD]).all()))
        return NO_UPDATE

    still = Inertial((0.0, 0.0, -9.0), (0.0, 0.0, 0.0), IDENTITY)
    running = SimpleNamespace(nominal=still.numbers(), state=still, predict=lambda: None, observe=observe)
    navigator.filter = cast("Any", running)
    seen = np.tile((0.0, 1.0, -300.0, 320.0, 300.0, 1e5, 100.0), (3, 1))
    gone, blind = seen.copy(), np.full((3, 7), np.nan)
    gone[THRESHOLD] = np.nan
    results = [navigator.observe(CameraFrame(0.0, lines, 0.05)) for lines in (seen, blind, seen, gone, seen)]
    # all lines lost is no hand-over: the threshold alone has to leave
    assert taken == [True, False, True, False, three_again]
    assert [result.late for result in results] == [False, False, False, not three_again, not three_again]
    assert math.isnan(results[-1].roll) is three_again


def test_incidence_follows_the_trim_table() -> None:
    """By the published coefficients: 2.7° at 40 m/s, 4.6° at 36 m/s."""
    incidence = incidence_of(load_aircraft("pioneer"))
    assert isinstance(incidence, Incidence)
    assert math.degrees(incidence.at(40.0)) == pytest.approx(2.72, abs=0.05)
    assert math.degrees(incidence.at(36.0)) == pytest.approx(4.6, abs=0.1)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda running: running._ekf.P.__setitem__((1, 1), -1e-9), "a variance of it is negative"),
        (lambda running: running._ekf.P.__setitem__((2, 2), math.nan), "its position is not finite"),
        (lambda running: running.nominal.__setitem__(0, math.inf), "its position is not finite"),
        (lambda running: running._ekf.P.__setitem__((0, 0), 1e6), "its position sigma is"),
    ],
)
def test_a_filter_whose_numbers_cannot_be_is_not_believed(spoil: Any, told: str) -> None:
    state = Inertial((-900.0, 0.0, -50.0), (40.0, 0.0, 2.0), IDENTITY)
    navigator = navigator_of(NavigationConfig(), Start(state, np.eye(15)))
    assert navigator.diverged is None
    spoil(navigator.filter)
    assert told in str(navigator.diverged)
