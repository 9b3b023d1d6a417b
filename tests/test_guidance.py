"""Guidance: which way it commands, when it changes its phase, and that it is a pure function."""

import math
from itertools import pairwise

import pytest

from estimator.so3 import from_euler
from landsim import guidance
from landsim.config import load_aircraft, load_scenario
from landsim.guidance import INITIAL, GuidanceState, Law, guide, law_of
from landsim.state import NavState, Phase, Stage

DEG = math.pi / 180.0


@pytest.fixture(scope="module")
def law() -> Law:
    half_view = math.atan(247.0 / (12500.0 / 9.9))
    return law_of(load_aircraft("pioneer"), load_scenario("landing").approach, 9.78, half_view, 1.0 / 30.0)


def nav(
    x: float = -600.0,
    y: float = 0.0,
    height: float | None = None,
    velocity: tuple[float, float, float] = (39.95, 0.0, 2.094),
    roll: float = 0.0,
    pitch: float = -0.3 * DEG,
    yaw: float = 0.0,
    rate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    airspeed: float = 40.0,
) -> NavState:
    """A navigation state; on the 3° slope to 145 m past the threshold unless a height is given."""
    up = (145.0 - x) * math.tan(3.0 * DEG) if height is None else height
    attitude = from_euler(roll, pitch, yaw)
    return NavState(10.0, True, (x, y, -up), velocity, attitude, roll, pitch, yaw, rate, airspeed, Stage.EARLY)


APPROACH = INITIAL._replace(phase=Phase.APPROACH)
FLARE = INITIAL._replace(phase=Phase.FLARE)
ROLLOUT = INITIAL._replace(phase=Phase.ROLLOUT, rollout_time=0.1)


def test_hands_off_until_navigation_is_ready(law: Law) -> None:
    command, state = guide(law, nav()._replace(ready=False), INITIAL)
    assert not command.engaged
    assert state.phase is Phase.ACQUIRE
    command, state = guide(law, nav(), INITIAL)
    assert command.engaged
    assert state.phase is Phase.APPROACH


def test_on_the_slope_it_commands_trim(law: Law) -> None:
    """On the line, at its sink rate: trim angle of attack less the slope, wings level."""
    command, _ = guide(law, nav(), APPROACH)
    assert command.pitch == pytest.approx((2.72 - 3.0) * DEG, abs=0.05 * DEG)
    assert command.roll == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("y", "speed", "sign"), [(5.0, 0.0, -1), (-5.0, 0.0, 1), (0.0, 1.0, -1), (0.0, -1.0, 1)])
def test_right_of_the_centreline_banks_left(law: Law, y: float, speed: float, sign: int) -> None:
    command, _ = guide(law, nav(y=y, velocity=(39.95, speed, 2.094)), APPROACH)
    assert math.copysign(1.0, command.roll) == sign
    assert abs(command.roll) > 0.5 * DEG


def test_above_the_slope_pitches_down(law: Law) -> None:
    on = guide(law, nav(), APPROACH)[0].pitch
    high = guide(law, nav(height=60.0), APPROACH)[0].pitch
    low = guide(law, nav(height=20.0), APPROACH)[0].pitch
    assert high < on - 1.0 * DEG
    assert low > on + 1.0 * DEG
    sinking = guide(law, nav(velocity=(39.95, 0.0, 3.0)), APPROACH)[0].pitch
    assert sinking > on + 0.5 * DEG, "sinking too fast pitches up"


def test_commands_are_limited(law: Law) -> None:
    far = guide(law, nav(y=1000.0, velocity=(39.95, 60.0, 2.0)), APPROACH)[0]
    assert far.roll == pytest.approx(-20.0 * DEG)
    assert guidance.bank_command(law, 1000.0, 0.0) == guidance.bank_command(law, 100.0, 0.0)
    steep = guide(law, nav(height=500.0), APPROACH)[0]
    assert steep.pitch > math.radians(-15.0)


def test_phases_follow_one_another(law: Law) -> None:
    """Wheels hang 0.84 m below the centre of gravity: the flare begins below 7 m of wheel height."""
    assert guidance.next_phase(law, nav(height=8.0, pitch=0.0), Phase.APPROACH) is Phase.APPROACH
    assert guidance.next_phase(law, nav(height=7.5, pitch=0.0), Phase.APPROACH) is Phase.FLARE
    assert guidance.next_phase(law, nav(height=9.0, pitch=0.0), Phase.FLARE) is Phase.FLARE, "never back"
    assert guidance.next_phase(law, nav(height=1.0, pitch=0.0), Phase.FLARE) is Phase.FLARE
    assert guidance.next_phase(law, nav(height=0.85, pitch=0.0), Phase.FLARE) is Phase.ROLLOUT
    rolling = nav(height=0.8, velocity=(20.0, 0.0, 0.0), pitch=0.0)
    assert guidance.next_phase(law, rolling, Phase.ROLLOUT) is Phase.ROLLOUT
    standing = rolling._replace(velocity=(0.1, 0.0, 0.0))
    assert guidance.next_phase(law, standing, Phase.ROLLOUT) is Phase.STOPPED
    assert guidance.next_phase(law, rolling, Phase.STOPPED) is Phase.STOPPED


def test_flare_slows_the_descent_and_closes_the_throttle(law: Law) -> None:
    sinking = (39.0, 0.0, 2.0)
    high = guide(law, nav(height=7.0, velocity=sinking), FLARE)[0]
    low = guide(law, nav(height=2.0, velocity=sinking), FLARE)[0]
    assert high.idle
    assert low.pitch > high.pitch + 1.0 * DEG
    assert not guide(law, nav(), APPROACH)[0].idle


def test_rollout_lowers_the_nose_then_brakes(law: Law) -> None:
    state = GuidanceState(Phase.ROLLOUT, 0.0, 3.0 * DEG, 0.0, True)
    on_wheels = nav(x=250.0, height=0.8, velocity=(36.0, 0.0, 0.0), pitch=3.0 * DEG)
    pitches, brakes = [], []
    for _ in range(90):
        command, state = guide(law, on_wheels, state)
        pitches.append(command.pitch)
        brakes.append(command.brake)
        assert command.ground
        assert command.idle
    assert pitches[0] < 3.0 * DEG
    assert min((b - a) * 30.0 for a, b in pairwise(pitches)) >= -2.5 * DEG - 1e-9
    assert pitches[-1] == pytest.approx(law.rollout_pitch)
    assert brakes[50] == 0.0
    assert brakes[70] == law.brake


@pytest.mark.parametrize(
    ("y", "yaw", "rate", "sign"), [(1.0, 0.0, 0.0, -1), (0.0, 0.02, 0.0, -1), (0.0, 0.0, 0.1, -1), (-1.0, 0.0, 0.0, 1)]
)
def test_steering_turns_back_to_the_centreline(law: Law, y: float, yaw: float, rate: float, sign: int) -> None:
    command, _ = guide(law, nav(x=300.0, y=y, height=0.8, yaw=yaw, rate=(0.0, 0.0, rate)), ROLLOUT)
    assert math.copysign(1.0, command.steering) == sign
    assert abs(guidance.steering_command(law, 100.0, 0.0, 0.0)) <= 1.0


def test_camera_tilts_once_when_the_threshold_leaves(law: Law) -> None:
    """On the paper's path, camera 3° down, at 38.3 m before the threshold; by hand in the test of the sensors."""
    lever = law.camera
    level = -0.3 * DEG  # body pitch: the optical axis then points 3.3° down

    def leaves(before: float) -> bool:
        height = 7.593 + before * math.tan(3.0 * DEG)
        return guidance.threshold_leaves(law, nav(x=-before - lever[0], height=height + lever[2], pitch=level))

    assert not leaves(39.0)
    assert leaves(36.0)
    command, state = guide(law, nav(x=-20.0, height=9.0), APPROACH)
    assert command.tilt == law.tilt_late
    command, state = guide(law, nav(x=-200.0, height=18.0), state)
    assert command.tilt == law.tilt_late, "one way"
    assert guide(law, nav(x=300.0, height=0.8), ROLLOUT)[0].tilt == law.tilt_early


def test_guidance_is_pure(law: Law) -> None:
    state = GuidanceState(Phase.APPROACH, 0.3, 0.01, 0.0, False)
    first = guide(law, nav(y=3.0), state)
    guide(law, nav(y=-8.0, height=4.0), state)
    assert guide(law, nav(y=3.0), state) == first


def test_gear_of_the_law_is_the_middle_of_the_main_wheels(law: Law) -> None:
    gear = load_aircraft("pioneer").gear
    assert law.wheels[0] == gear.left_wheel_body_m[0] == gear.right_wheel_body_m[0]
    assert law.wheels[1] == 0.0
    assert guidance.wheel_height(law, nav(height=5.0, pitch=0.0)) == pytest.approx(5.0 - gear.left_wheel_body_m[2])
    # nose up by 10°: wheels behind the centre of gravity come lower
    assert guidance.wheel_height(law, nav(height=5.0, pitch=10.0 * DEG)) < 5.0 - gear.left_wheel_body_m[2]
