"""Whole landings.

What each case verifies:

=========================================  ==========================================================================
``test_landings[...]``                     twenty seeds, and eighty more among the slow tests, land in the box; fused
                                           beats raw vision in every quantity; normalised errors squared are what a
                                           consistent filter's are, two-sided
``test_same_seed_same_bits``               the log is a function of scenario and seed
``test_blinded_camera_does_not_land``      nothing else than the camera brings the aircraft to the runway
``test_coasting``                          without lines the covariance grows, and holds
``test_no_trim``, ``test_divergence``      failures have names and keep their log
``test_every_shipped_scenario``            what is shipped flies
``test_elsewhere_on_the_earth``            another heading, latitude and elevation is the same landing
=========================================  ==========================================================================
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import landsim
from landsim.config import ScenarioError, load_scenario
from landsim.log import COLUMNS
from landsim.metrics import find_touchdown
from landsim.resources import shipped_scenarios
from landsim.simulate import Flight
from landsim.state import Phase, Stage

PHASES = ("early", "late", "rollout")


def fly(seed: int = 0, **overrides: object) -> Flight:
    settings = {key.replace("__", "."): value for key, value in overrides.items()}
    flight: Flight = landsim.fly(landsim.load_scenario("landing", overrides=settings), seed=seed)
    return flight


@pytest.mark.parametrize(
    "seeds", [range(20), pytest.param(range(20, 100), marks=pytest.mark.slow)], ids=["20", "80 more"]
)
@pytest.mark.parametrize("line_noise", ["edge-points", "endpoints"])
def test_landings(line_noise: str, seeds: range, record_property: Callable[[str, object], None]) -> None:
    nees: dict[str, list[float]] = {phase: [] for phase in PHASES}
    nees15: dict[str, list[float]] = {phase: [] for phase in PHASES}
    for seed in seeds:
        flight = fly(seed, camera__line_noise=line_noise)
        metrics = flight.metrics
        where = f"{line_noise}, seed {seed}: {metrics['reason']}, {metrics['touchdown']}"
        assert metrics["outcome"] == "landed", where
        assert metrics["in_box"], where
        touchdown = metrics["touchdown"]
        assert 100.0 <= touchdown["x_m"] <= 450.0, where
        assert abs(touchdown["y_m"]) <= 2.0, where
        assert touchdown["sink_rate_mps"] <= 1.0, where
        assert abs(touchdown["bank_deg"]) <= 3.0, where
        assert abs(metrics["stop"]["y_m"]) <= 3.0, where
        log = flight.log
        first_main = np.flatnonzero((log["wow_left"] > 0) | (log["wow_right"] > 0))[0]
        assert first_main < np.flatnonzero(log["wow_nose"] > 0)[0], where
        for quantity, vision in metrics["navigation"]["vision"].items():
            fused = metrics["navigation"]["fused"][quantity]
            assert fused["paired_rms"] < vision["paired_rms"], f"{where}: {quantity}"
            assert fused["rms"] < vision["rms"], f"{where}: {quantity}"
        for phase in PHASES:
            nees[phase].append(metrics["consistency"][phase]["nees9_mean"])
            nees15[phase].append(metrics["consistency"][phase]["nees15_mean"])
    for phase, values in nees.items():
        means = float(np.mean(values)), float(np.mean(nees15[phase]))
        record_property(f"NEES of 9 and of 15 states, {line_noise}, {phase}", "{:.2f} {:.2f}".format(*means))
    for phase in ("early", "late"):
        assert np.mean(nees15[phase]) == pytest.approx(15.0, rel=0.15), f"{line_noise}, {phase}: all 15 states"
    for phase, values in nees.items():
        assert np.mean(values) == pytest.approx(9.0, rel=0.15), f"{line_noise}, {phase}: {np.mean(values):.2f}"


def test_same_seed_same_bits() -> None:
    first, again, other = fly(3), fly(3), fly(4)
    assert list(first.log) == [column.name for column in COLUMNS]
    for name, values in first.log.items():
        assert values.tobytes() == again.log[name].tobytes(), name
    assert first.log["fused_cross_m"].tobytes() != other.log["fused_cross_m"].tobytes()
    for flight in (first, again):
        flight.metrics.pop("wall_time_s")
    assert first.metrics == again.metrics


def test_phases_and_stages_come_in_order() -> None:
    log = fly(1).log
    phases = log["phase"]
    assert (np.diff(phases) >= 0).all()
    assert set(phases) >= {Phase.ACQUIRE, Phase.APPROACH, Phase.FLARE, Phase.ROLLOUT}
    stages = log["stage"][log["phase"] >= Phase.APPROACH]
    assert set(stages) <= {Stage.EARLY, Stage.LATE, Stage.NONE}
    numbers = log["nis_dof"][np.isfinite(log["nis_dof"])]
    assert (numbers[:500] == 6).all(), "the threshold is in view"
    assert (numbers[-500:] == 4).all(), "the threshold is behind"
    frames = (log["nis_dof"] == 4) & np.isfinite(log["vision_cross_m"])
    assert frames.sum() > 400
    assert np.isnan(log["vision_along_m"][frames]).all(), "two lines do not give the longitudinal position"


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4])
def test_blinded_camera_does_not_land(seed: int) -> None:
    flight = fly(seed, camera__outages_s=[[0.0, 1000.0]])
    assert flight.metrics["outcome"] in {"crashed", "off_runway", "timeout"}
    assert (flight.log["phase"] == Phase.ACQUIRE).all()
    assert np.isnan(flight.log["fused_cross_m"]).all()
    assert fly(seed).metrics["in_box"], "with its eyes open the same start lands"


def test_coasting() -> None:
    """Blind from one second on: dead reckoning drifts off, and the filter knows it."""
    log = fly(0, camera__outages_s=[[1.0, 1000.0]]).log
    blind = log["time_s"] > 1.1
    assert np.isnan(log["vision_cross_m"][blind]).all()
    assert (log["stage"][blind] == Stage.NONE).all()
    for quantity in ("along_m", "cross_m", "height_m"):
        sigma = log[f"sigma_{quantity}"][blind]
        assert sigma[-1] > 3.0 * sigma[0], quantity
        error = np.abs(log[f"fused_{quantity}"] - log[f"true_{quantity}"])[blind]
        assert (error < 5.0 * sigma).all(), quantity


def test_filter_that_believes_nothing_is_named() -> None:
    flight = fly(0, navigation__gate_early=1e-3, navigation__gate_late=1e-3, navigation__max_rejected_frames=60)
    assert flight.metrics["outcome"] == "diverged"
    assert "rejected" in flight.metrics["reason"]
    assert flight.metrics["consistency"]["early"]["rejected"] > 60


def test_start_from_farther_than_a_pose_can_tell() -> None:
    """From 2500 m the filter waits, and then is as consistent as ever."""
    metrics = fly(1, start__along_m=-2500.0, start__height_m=138.0).metrics
    assert metrics["in_box"]
    assert metrics["consistency"]["early"]["nees9_mean"] < 20.0


@pytest.mark.parametrize("noise_px", [0.0, 10.0])
def test_lines_much_better_and_much_worse(noise_px: float) -> None:
    metrics = fly(0, camera__noise_px=noise_px).metrics
    assert metrics["outcome"] == "landed"


def test_no_trim() -> None:
    """15 m/s is far below the stall speed of 27 m/s."""
    flight = fly(0, start__speed_mps=15.0, start__speed_sigma_mps=0.0)
    assert flight.metrics["outcome"] == "trim_failed"
    assert "balance of lift" in flight.metrics["reason"]
    assert flight.metrics["touchdown"] is None
    assert set(flight.log) == {column.name for column in COLUMNS}


def test_divergence() -> None:
    flight = fly(0, camera__outages_s=[[2.0, 1000.0]], navigation__max_position_sigma_m=5.0)
    assert flight.metrics["outcome"] == "diverged"
    assert flight.log["time_s"].size > 240
    sigmas = [flight.log[f"sigma_{q}"][-1] for q in ("along_m", "cross_m", "height_m")]
    assert np.hypot.reduce(sigmas) == pytest.approx(5.0, rel=0.05)


@pytest.mark.parametrize("name", [n for n in shipped_scenarios() if load_scenario(n).kind == "flight"])
def test_every_shipped_scenario(name: str) -> None:
    scenario = load_scenario(name)
    metrics = landsim.fly(scenario, seed=0).metrics
    assert metrics["outcome"] == "landed"
    assert metrics["in_box"]


@pytest.mark.parametrize(
    ("heading", "latitude", "longitude", "elevation"), [(245.0, 52.3, 4.8, 300.0), (10.0, -33.9, 151.2, 0.0)]
)
def test_elsewhere_on_the_earth(heading: float, latitude: float, longitude: float, elevation: float) -> None:
    here = fly(5)
    there = fly(
        5,
        runway__heading_deg=heading,
        runway__latitude_deg=latitude,
        runway__longitude_deg=longitude,
        runway__elevation_m=elevation,
    )
    assert there.metrics["in_box"]
    for metrics in (here.metrics, there.metrics):
        assert metrics["navigation"]["fused"]["cross_m"]["rms"] < 0.2
    a, b = here.metrics["touchdown"], there.metrics["touchdown"]
    assert abs(a["y_m"] - b["y_m"]) < 0.5
    assert abs(a["x_m"] - b["x_m"]) < 40.0


def test_another_rate_of_camera_and_imu() -> None:
    flight = fly(2, camera__rate_hz=10.0, imu__rate_hz=60.0)
    assert flight.metrics["in_box"]


def test_touchdown_is_the_first_contact() -> None:
    flight = fly(0)
    scenario = load_scenario("landing")
    touchdown = find_touchdown(flight.log, scenario.aircraft_config)
    assert touchdown is not None
    before = flight.log["wheel_height_m"][touchdown.row - 1]
    assert -0.02 < before < 0.02, "the wheels were at the ground the step before"


def test_a_flight_may_end_at_the_touchdown() -> None:
    whole, short = fly(), fly(simulation__end="touchdown")
    assert short.metrics["outcome"] == "landed"
    assert short.metrics["in_box"]
    assert short.metrics["stop"] is None
    assert "stop_cross_max_m" not in short.metrics["box"]
    assert short.metrics["touchdown"] == whole.metrics["touchdown"]
    rows = short.log["time_s"].size
    assert short.log["time_s"][-1] == whole.metrics["touchdown"]["time_s"]
    for name, values in short.log.items():
        np.testing.assert_array_equal(values, whole.log[name][:rows], err_msg=name)


def test_start_under_the_ground_is_named() -> None:
    flight = fly(0, start__height_m=0.5, start__height_sigma_m=0.0)
    assert flight.metrics["outcome"] == "trim_failed"
    assert "under the ground" in flight.metrics["reason"]
    assert flight.metrics["start"]["height_m"] == 0.5


def test_a_failed_landing_is_soon_over() -> None:
    """Three seconds after the wheel that should not have touched first."""
    flight = fly(0, camera__outages_s=[[1.0, 1000.0]])
    assert flight.metrics["outcome"] == "crashed"
    touched = flight.log["time_s"][np.flatnonzero(flight.log["wow_nose"] > 0.0)[0]]
    assert flight.metrics["flight_time_s"] == pytest.approx(touched + 3.0, abs=0.05)
    assert "believed no frame" in flight.metrics["reason"]
    assert np.nanmax(np.abs(flight.log["command_pitch_deg"])) <= 12.0


@pytest.mark.parametrize("seed", [-1, True, None, 1.5, "x"])
def test_seed_is_a_whole_number(seed: Any) -> None:
    with pytest.raises(ValueError, match="seed must be a whole number"):
        landsim.fly(load_scenario("landing"), seed=seed)


@pytest.mark.parametrize(("imu", "camera"), [(40.0, 30.0), (30.0, 40.0), (20.0, 30.0)])
def test_frames_between_samples_of_the_imu_are_refused(imu: float, camera: float) -> None:
    with pytest.raises(ScenarioError, match=r"must divide imu\.rate_hz"):
        load_scenario("landing", overrides={"imu.rate_hz": imu, "camera.rate_hz": camera})
