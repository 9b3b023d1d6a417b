"""Guidance in wind: signs by hand, and landings in cross wind from either side.

Air that moves to the right comes from the left.  A nose on the runway's heading is then slipped to the left: the air
pushes the aircraft to the right, turns its nose to the left, and is met with right rudder and the left wing down.
"""

import math
from typing import Any

import numpy as np
import pytest

import landsim
from landsim.config import load_aircraft, load_scenario
from landsim.errors import InputError
from landsim.guidance import INITIAL, Law, bank_command, guide, law_of
from landsim.plugins import nav_state
from landsim.state import NavState, Phase, Stage
from landsim.wind_law import (
    NO_WIND,
    WindLaw,
    airspeed_added,
    align_rudder,
    aligned,
    felt,
    kept_left,
    steered,
    wind_law_of,
)

DEG = math.pi / 180.0
DT = 1.0 / 30.0


@pytest.fixture(scope="module")
def law() -> WindLaw:
    gains = load_aircraft("pioneer").guidance.wind
    assert gains is not None
    return wind_law_of(gains)


@pytest.fixture(scope="module")
def whole() -> Law:
    scenario = load_scenario("crosswind")
    return law_of(scenario.aircraft_config, scenario.approach, 9.78, 0.3, DT)


def nav(
    velocity: tuple[float, float, float] = (39.4, 0.0, 2.0),
    yaw: float = 0.0,
    airspeed: float = 40.0,
    side_force: float = 0.0,
    y: float = 0.0,
    wheels: float = 20.0,
) -> NavState:
    c, s = math.cos(yaw), math.sin(yaw)
    return nav_state(
        1.0,
        (-300.0, y, -wheels - 0.84),
        velocity,
        (c, -s, 0, s, c, 0, 0, 0, 1),
        (0, 0, 0),
        airspeed,
        Stage.LATE,
        side_force=side_force,
    )


def test_the_wind_is_ground_velocity_less_airspeed_along_the_nose(law: WindLaw) -> None:
    """The nose 10° left of a track along the runway at 40 m/s: 40 sin 10° = 6.95 m/s blow to the right.  The head wind
    is 40 cos 10° = 39.39 m/s less what is made good over the ground."""
    memory = felt(law, nav((33.0, 0.0, 2.0), -10.0 * DEG), NO_WIND, DT)
    assert memory.cross == pytest.approx(6.946, abs=1e-3)
    assert memory.head == pytest.approx(6.392, abs=1e-3)
    later = felt(law, nav((39.39, 0.0, 2.0), -10.0 * DEG), memory, law.estimate_time)
    assert later.head == pytest.approx(memory.head * math.exp(-1.0), abs=0.01)
    # with the nose being turned onto the runway there is sideslip, and the wind is no longer told so
    held = felt(law, nav((33.0, 0.0, 2.0), 0.0), memory._replace(align=0.5), 1.0)
    assert held.cross == memory.cross


def test_the_side_force_is_felt_quickly_and_with_its_sign(law: WindLaw) -> None:
    pushed = felt(law, nav(side_force=1.5), NO_WIND, DT)
    assert pushed.side_force == 1.5
    later = felt(law, nav(side_force=-1.5), pushed, law.side_force_time)
    assert later.side_force == pytest.approx(-1.5 + 3.0 * math.exp(-1.0))


@pytest.mark.parametrize(("head", "added"), [(-5.0, 0.0), (0.0, 0.0), (5.0, 1.5), (40.0, 4.0)])
def test_a_head_wind_is_flown_faster(law: WindLaw, head: float, added: float) -> None:
    assert airspeed_added(law, NO_WIND._replace(head=head)) == pytest.approx(added)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_rudder_and_bank_against_wind_and_nose(law: WindLaw, whole: Law, side: float) -> None:
    blown = NO_WIND._replace(cross=side * 5.0, align=1.0)
    assert side * align_rudder(law, nav(), blown) > 2.0 * DEG, "wind to the right: right rudder"
    assert side * align_rudder(law, nav(yaw=-side * 5.0 * DEG), NO_WIND) > 2.0 * DEG, "nose left: right rudder"
    assert side * bank_command(whole, 0.0, 0.0, 0.0, side * 1.0) < -5.0 * DEG, "pushed right: left wing down"
    # g tan(bank) balances the force
    assert bank_command(whole, 0.0, 0.0, 0.0, 1.0) == pytest.approx(-math.atan(1.0 / 9.78))


def test_the_nose_is_turned_once_low_enough_and_not_back(law: WindLaw) -> None:
    assert aligned(law, law.align_height + 0.1, NO_WIND, DT).align == 0.0
    begun = aligned(law, law.align_height - 0.1, NO_WIND, DT)
    assert begun.align == pytest.approx(DT / law.align_time)
    assert aligned(law, 50.0, begun, DT).align > begun.align
    assert aligned(law, 0.0, NO_WIND._replace(align=0.99), 1.0).align == 1.0


def test_integrals_bring_it_back_and_end(law: WindLaw) -> None:
    assert kept_left(law, 5.0, NO_WIND, 1.0).cross_speed == pytest.approx(-0.1)
    assert kept_left(law, -5.0, NO_WIND, 1e6).cross_speed == law.cross_integral_max
    assert steered(law, 1.0, NO_WIND, 1.0).steering == pytest.approx(-0.01)
    assert steered(law, -1.0, NO_WIND, 1e6).steering == law.rollout_integral_max


def test_on_the_ground_the_integral_steers(whole: Law) -> None:
    """A second at 1 m to the right makes a heading of 0.01 rad to the left, which is steered for on the centreline."""
    state = INITIAL._replace(phase=Phase.ROLLOUT, rollout_time=0.1)
    right, middle = (nav((30.0, 0.0, 0.0), y=y, wheels=-0.05) for y in (1.0, 0.0))
    assert guide(whole, middle, state)[0].steering == 0.0
    for _ in range(30):
        _, state = guide(whole, right, state)
    steering = guide(whole, middle, state)[0].steering
    assert steering == pytest.approx(-0.01 * whole.steering_gain, rel=1e-6)
    assert steering < 0.0


def test_the_flare_asks_for_no_more_sink_than_the_slope(whole: Law) -> None:
    """Against 13 m/s of head wind 27 m/s are made good: 1.41 m/s on 3°, and the pitch is that for it, not for more."""
    fast = guide(whole, nav((40.0, 0.0, 1.41), wheels=6.9, airspeed=36.0), INITIAL._replace(phase=Phase.FLARE))[0]
    slow = guide(whole, nav((27.0, 0.0, 1.41), wheels=6.9, airspeed=36.0), INITIAL._replace(phase=Phase.FLARE))[0]
    assert slow.pitch > fast.pitch + 0.5 * DEG


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_landing_in_cross_wind(side: float) -> None:
    flight = landsim.fly(load_scenario("crosswind", overrides={"wind.cross_mps": side * 7.7}), seed=2)
    touchdown = flight.metrics["touchdown"]
    assert flight.metrics["in_box"], flight.metrics["reason"]
    log = flight.log
    high = (log["phase"] == Phase.APPROACH) & (log["body_height_m"] < 30.0)
    assert side * np.mean(log["body_yaw_deg"][high]) < -8.0, "it crabs into the wind"
    assert abs(touchdown["heading_error_deg"]) < 4.0, "and lands along the runway"
    assert side * touchdown["bank_deg"] < -1.0, "with the wing into the wind down"
    assert abs(flight.metrics["stop"]["y_m"]) < 2.0


def test_told_the_truth_it_lands_without_a_camera() -> None:
    blind: dict[str, Any] = {"camera.outages_s": [[5.0, 120.0]], "navigation.max_position_sigma_m": 5.0}
    told = load_scenario("landing", overrides=blind | {"simulation.guidance_state": "truth"})
    assert landsim.fly(told, seed=1).metrics["outcome"] == "landed"
    assert landsim.fly(load_scenario("landing", overrides=blind), seed=1).metrics["outcome"] != "landed"


def test_an_aircraft_without_the_gains_is_refused(tmp_path: Any) -> None:
    folder = load_aircraft("pioneer").folder
    bare = tmp_path / "bare"
    bare.mkdir()
    for part in ("Engines", "Systems", "pioneer.xml"):
        (bare / part).symlink_to(folder / part)
    text = (folder / "aircraft.toml").read_text()
    first, last = text.index("[guidance.wind]"), text.index("[guidance.rollout]")  # the climb's gains stand between
    (bare / "aircraft.toml").write_text(text[:first] + text[last:])
    load_scenario("landing", overrides={"aircraft.name": str(bare)})
    with pytest.raises(InputError, match=r"approach\.law: must be \"calm\""):
        load_scenario("landing", overrides={"aircraft.name": str(bare), "approach.law": "wind"})
    with pytest.raises(InputError, match=r"go_around\.enabled: must be false"):
        load_scenario("landing", overrides={"aircraft.name": str(bare), "go_around.enabled": True})
