"""The landing is given up for a reason that lasts, between two heights, and then the aircraft climbs out."""

import math

import pytest

import landsim
from landsim.config import load_scenario
from landsim.go_around import NO_DOUBT, Doubt, doubt_of, doubted, gives_up
from landsim.guidance import INITIAL, guide, law_of
from landsim.plugins import nav_state
from landsim.schema.flight import GoAroundConfig
from landsim.simulate import warns
from landsim.state import Alarm, NavState, Phase, Stage

LIMITS = GoAroundConfig(enabled=True)
GOOD = nav_state(1.0, (-300.0, 1.0, -25.0), (39.0, 0.0, 2.0), (1, 0, 0, 0, 1, 0, 0, 0, 1), (0, 0, 0), 40.0, Stage.LATE)
GOOD = GOOD._replace(lateral_protection=3.0, vertical_protection=2.0)


@pytest.mark.parametrize(
    ("nav", "above", "told"),
    [
        (GOOD, 0.5, ""),
        (GOOD._replace(lateral_protection=math.nan, vertical_protection=math.nan), 0.5, ""),
        (GOOD._replace(alarm=Alarm.WRONG_LINE), 0.5, ""),  # it is left out, and what is left is judged
        (GOOD._replace(alarm=Alarm.UNAIDED), 0.5, "no line"),
        (GOOD._replace(alarm=Alarm.INCONSISTENT), 0.5, "contradict"),
        (GOOD._replace(lateral_protection=10.1), 0.5, "lateral protection"),
        (GOOD._replace(vertical_protection=5.1), 0.5, "vertical protection"),
        (GOOD._replace(position=(-300.0, -8.1, -25.0)), 0.5, "centreline"),
        (GOOD, -6.1, "glide slope"),
        (GOOD, math.nan, ""),
    ],
)
def test_each_limit_has_its_reason(nav: NavState, above: float, told: str) -> None:
    reason = doubt_of(LIMITS, nav, 20.0, above)
    assert (told in reason) if told else reason == ""


@pytest.mark.parametrize(
    ("height", "level", "judged"),
    [
        (32.1, 2.0, False),  # the wheels may be at 30.1 m,
        (32.0, 2.0, True),  # and here at 30 m
        (2.1, 2.0, True),
        (2.0, 2.0, False),
        (59.0, 28.9, False),
        (59.0, 29.0, True),
        (30.1, math.nan, False),
        (30.0, math.nan, True),
    ],
)
def test_it_is_judged_between_decision_and_commitment(height: float, level: float, judged: bool) -> None:
    nav = GOOD._replace(alarm=Alarm.UNAIDED, vertical_protection=level)
    assert bool(doubt_of(LIMITS, nav, height, 0.0)) is judged


def test_height_that_is_not_known_does_not_put_the_decision_off() -> None:
    """In fog of 316 m, with a height that navigation has 17 m too great in the end: it climbs while it is high."""
    flight = landsim.fly(landsim.load_scenario("weather"), seed=881)
    assert flight.metrics["outcome"] == "go_around"
    assert flight.log["wheel_height_m"].min() > 10.0


def test_a_reason_has_to_last() -> None:
    doubt, calls = NO_DOUBT, 0
    while not gives_up(LIMITS, doubt):
        doubt, calls = doubted(doubt, "fog", 20.0, 0.1), calls + 1
    assert calls == pytest.approx(3, abs=1)  # 0.3 s of tenths, which are not exact
    assert doubted(doubt, "", 20.0, 0.1) == NO_DOUBT
    assert not gives_up(LIMITS, Doubt("", 9.0))


@pytest.mark.parametrize("drift", [1.0, -1.0, 2.0, -2.0, 0.0])
def test_it_banks_against_its_drift(drift: float) -> None:
    """As g tan(bank) = -k v asks for, to 5° at most: in the direction of the runway and not back to its middle."""
    scenario = load_scenario("landing")
    law = law_of(scenario.aircraft_config, scenario.approach, 9.78, 0.3, 1.0 / 30.0, LIMITS)
    drifting = GOOD._replace(velocity=(39.0, drift, 2.0))
    command, state = guide(law, drifting, INITIAL._replace(phase=Phase.GO_AROUND))
    assert state.phase is Phase.GO_AROUND
    bank = min(math.atan(law.bank_gain * abs(drift) / 9.78), math.radians(5.0))
    assert command.roll == pytest.approx(-math.copysign(bank, drift))
    assert drift * command.roll < 0.0 or drift == command.roll == 0.0


def test_blinded_before_the_decision_height_it_climbs_out() -> None:
    blind = {
        "navigation.aiding": "lines", "go_around.enabled": True, "camera.outages_s": [[14.0, 60.0]],
    }  # fmt: skip
    flight = landsim.fly(landsim.load_scenario("landing", overrides=blind), seed=1)
    assert flight.metrics["outcome"] == flight.metrics["end"] == "go_around"
    assert "no line has been believed" in flight.metrics["reason"]
    assert not flight.metrics["in_box"]
    height, up = flight.log["body_height_m"], flight.log["phase"] == 5.0
    assert height[-1] >= 60.0
    assert height.min() > 20.0
    # wings near level, and an airspeed far from the stall, which is at 29 m/s
    assert abs(flight.log["body_roll_deg"][up]).max() < 6.0
    assert flight.log["true_airspeed_mps"].min() > 35.0


def test_a_filter_that_diverges_is_left_to_guidance_where_it_may_give_up() -> None:
    """An edge that is wrong from the start, which no line agrees with: without go-arounds the flight ends there."""
    wrong = {"fault.kind": "wrong", "fault.at_s": 0.0, "fault.lasting_s": 1000.0}
    scenario = landsim.load_scenario("weather", wrong)
    flight = landsim.fly(scenario, seed=15)
    assert flight.metrics["outcome"] == "go_around"
    assert "the lines contradict the navigation state" in flight.metrics["reason"]
    never = landsim.load_scenario("weather", wrong | {"go_around.enabled": False})
    assert landsim.fly(never, seed=15).metrics["outcome"] == "diverged"


@pytest.mark.parametrize(
    ("nav", "warned"),
    [
        (GOOD, False),
        (GOOD._replace(alarm=Alarm.WRONG_LINE), False),
        (GOOD._replace(alarm=Alarm.UNAIDED), True),
        (GOOD._replace(alarm=Alarm.INCONSISTENT), True),
        (GOOD._replace(alarm=Alarm.INCONSISTENT, position=(-300.0, math.nan, -25.0)), False),
        (GOOD._replace(alarm=Alarm.INCONSISTENT, velocity=(39.0, 0.0, math.inf)), False),
    ],
)
def test_guidance_is_warned_of_a_divergence_by_an_alarm_and_a_state_to_climb_out_by(
    nav: NavState, warned: bool
) -> None:
    assert warns(nav) is warned


def test_the_heights_are_in_order() -> None:
    with pytest.raises(ValueError, match="commit_height_m"):
        landsim.load_scenario("landing", overrides={"go_around.commit_height_m": 31.0})
