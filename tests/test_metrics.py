"""Metrics against numbers worked out by hand."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic import empty_log, flight_log, parts

from landsim import metrics
from landsim.log import QUANTITIES
from landsim.metrics import Log

SCENARIO, AIRCRAFT = parts()
TOUCH, LAST = 10, 40


def landing(**changes: dict[int, float]) -> Any:
    """41 rows at 40 m/s along the centreline from x = 200 m: in the air until row 10, the nose comes down at row 20.

    ``changes`` are {row: value} of a column; row -1 is every row.
    """
    log = empty_log(LAST + 1)
    rows = np.arange(LAST + 1)
    log["phase"] = np.where(rows < 5, 1.0, np.where(rows < TOUCH, 2.0, 3.0))
    log["body_x_m"] = 200.0 + rows / 3.0
    log["wheel_height_m"] = np.maximum(0.006 * (TOUCH - rows), -0.03)  # 0.006 m a step is 0.72 m/s
    log["body_height_m"] = log["wheel_height_m"] + 0.8382
    log["true_velocity_x_mps"][:] = 40.0
    log["true_velocity_y_mps"][:] = 9.0
    log["wow_left"] = log["wow_right"] = (rows >= TOUCH).astype(float)
    log["wow_nose"] = (rows >= 20).astype(float)
    for name, values in changes.items():
        log[name] = log[name].copy()
        for row, value in values.items():
            if row < 0:
                log[name][:] = value
            else:
                log[name][row] = value
    return log


def measured(log: Log, end: str = "stopped") -> dict[str, Any]:
    return metrics.flight_metrics(log, SCENARIO, AIRCRAFT, seed=7, end=end, wall_time_s=0.5, versions={"landsim": "1"})


def spread(rows: range, value: float) -> dict[int, float]:
    return dict.fromkeys(rows, value)


def test_rms_and_p95_by_hand() -> None:
    assert metrics.rms([3.0, -4.0, math.nan]) == pytest.approx(math.sqrt(12.5))
    # of the magnitudes 0, 1 … 20 the 95th percentile is 19
    assert metrics.p95([-20.0, *range(20)]) == pytest.approx(19.0)
    assert metrics.rms([math.nan]) is None
    assert metrics.p95([]) is None


def test_angles_are_wrapped() -> None:
    wrapped = metrics.wrapped_deg([359.0, -359.0, 180.0, 540.5, 12.0])
    np.testing.assert_allclose(wrapped, [-1.0, 1.0, -180.0, -179.5, 12.0])


@given(st.floats(-1e4, 1e4))
def test_wrapping_moves_by_whole_turns(angle_deg: float) -> None:
    wrapped = float(metrics.wrapped_deg(angle_deg))
    turns = (angle_deg - wrapped) / 360.0
    assert -180.0 <= wrapped < 180.0
    assert turns == pytest.approx(round(turns), abs=1e-9)


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw", "ahead", "right"),
    [
        (0.0, 0.0, 0.0, -0.2794, 0.0),
        (0.0, 0.0, 90.0, 0.0, -0.2794),  # facing right: behind the cg is left of it
        (30.0, 0.0, 0.0, -0.2794, -0.4191),  # right side down: the wheels swing left by half their depth
        (0.0, 90.0, 0.0, 0.8382, 0.0),  # on its tail: the belly faces forward
    ],
)
def test_main_wheels_by_hand(roll: float, pitch: float, yaw: float, ahead: float, right: float) -> None:
    log = landing(body_roll_deg={-1: roll}, body_pitch_deg={-1: pitch}, body_yaw_deg={-1: yaw}, body_y_m={-1: 5.0})
    x, y = metrics.main_wheels(log, AIRCRAFT)
    assert x[0] == pytest.approx(200.0 + ahead, abs=1e-9)
    assert y[0] == pytest.approx(5.0 + right, abs=1e-9)


def test_main_wheels_against_scipy() -> None:
    rng = np.random.default_rng(2)
    log = empty_log(50)
    angles = rng.uniform(-80.0, 80.0, (50, 3))
    log["body_yaw_deg"], log["body_pitch_deg"], log["body_roll_deg"] = angles.T
    expected = Rotation.from_euler("ZYX", angles, degrees=True).apply([-0.2794, 0.0, 0.8382])
    np.testing.assert_allclose(metrics.main_wheels(log, AIRCRAFT), expected[:, :2].T, atol=1e-12)


def test_touchdown_by_hand() -> None:
    found = measured(landing(body_roll_deg={TOUCH: 30.0}, body_yaw_deg={TOUCH: 359.0}, body_pitch_deg={TOUCH: 0.0}))
    t = found["touchdown"]
    # behind the cg 0.2794 m, and 0.4191 m left with the bank, turned by -1°
    sine, cosine = math.sin(math.radians(1.0)), math.cos(math.radians(1.0))
    assert t["x_m"] == pytest.approx(200.0 + 10.0 / 3.0 - 0.2794 * cosine - 0.4191 * sine)
    assert t["y_m"] == pytest.approx(0.2794 * sine - 0.4191 * cosine)
    assert t["sink_rate_mps"] == pytest.approx(0.72)
    assert t["ground_speed_mps"] == pytest.approx(41.0)  # 9, 40, 41
    assert t["bank_deg"] == 30.0
    assert t["heading_error_deg"] == pytest.approx(-1.0)
    assert t["time_s"] == pytest.approx(10.0 / 120.0)


def test_sink_rate_is_of_the_wheels_and_not_of_the_cg() -> None:
    """The cg sinks at 1 m/s while the nose rises at 0.1 rad/s: wheels 0.2794 m behind it sink 0.02794 m/s faster."""
    time = np.arange(LAST + 1) / 120.0
    pitch = 0.1 * time
    wheel = -1.0 * time - 0.2794 * np.sin(pitch) - 0.8382 * np.cos(pitch)
    log = landing(true_velocity_z_mps={-1: 1.0}) | {"wheel_height_m": wheel - wheel[TOUCH]}
    # at row 8.5 the pitch is 0.4°: the wheels' depth adds 0.1 · 0.8382 sin(0.4°), 0.6 mm/s
    assert measured(log)["touchdown"]["sink_rate_mps"] == pytest.approx(1.02794 - 0.0006, abs=1e-4)


def test_compression_of_the_gear_is_not_sink() -> None:
    log = landing(wheel_height_m={TOUCH: -5.0})
    assert measured(log)["touchdown"]["sink_rate_mps"] == pytest.approx(0.72)


def test_a_flight_that_begins_on_its_wheels_has_a_touchdown() -> None:
    for row, sink in ((0, 0.4), (1, 0.72)):
        log = landing(wow_left={row: 1.0}, true_velocity_z_mps={-1: 0.4})
        assert measured(log)["touchdown"]["sink_rate_mps"] == pytest.approx(sink)


OFF = "off_runway"
ALOFT: dict[str, dict[int, float]] = {"wow_left": {-1: 0.0}, "wow_right": {-1: 0.0}}
NO_CONTACT = ALOFT | {"wow_nose": {-1: 0.0}}
HOP = {"wow_left": {25: 0.0}, "wow_right": {25: 0.0}}
CASES: list[tuple[str, str, dict[str, dict[int, float]], str, str]] = [
    ("landed", "stopped", {}, "landed", "main wheels first"),
    ("one main wheel first", "stopped", {"wow_right": spread(range(TOUCH, 15), 0.0)}, "landed", "main wheels first"),
    ("nose first", "stopped", {"wow_nose": {9: 1.0}}, "crashed", "nose wheel"),
    ("nose in the same step", "stopped", {"wow_nose": {10: 1.0}}, "crashed", "nose wheel"),
    ("nose a step later", "stopped", {"wow_nose": {11: 1.0}}, "landed", "main wheels first"),
    ("nose alone", "timeout", ALOFT, "crashed", "nose wheel"),
    ("sink at the limit", "stopped", {"wheel_height_m": {8: 0.0249, 9: 0.0}}, "landed", "main wheels first"),
    ("sink past the limit", "stopped", {"wheel_height_m": {8: 0.0251, 9: 0.0}}, "crashed", "3.01 m/s"),
    ("short", "stopped", {"body_x_m": {TOUCH: 0.27}}, OFF, "touched down off"),
    ("just on", "stopped", {"body_x_m": {TOUCH: 0.28}}, "landed", "main wheels first"),
    ("just short of it in the air", "stopped", {"body_x_m": {TOUCH - 1: -5.0}}, "landed", "main wheels first"),
    ("beyond the end", "stopped", {"body_x_m": {LAST: 2000.29}}, OFF, "rolled off"),
    ("right of it", "stopped", {"body_y_m": {25: 15.1}}, OFF, "+15.1 m across"),
    ("left of it", "stopped", {"body_y_m": {25: -15.1}}, OFF, "-15.1 m across"),
    ("off it while bouncing", "stopped", HOP | {"body_y_m": {25: 15.1}}, OFF, "15.1"),
    ("off, then filter lost", "diverged", {"body_y_m": {25: 15.1}}, OFF, "rolled"),
    ("off, then on its belly", "structure_contact", {"body_y_m": {25: 15.1}}, OFF, "rolled"),
    ("belly in the step that leaves", "structure_contact", {"body_y_m": {LAST: 15.1}}, "crashed", "not a wheel"),
    ("belly", "structure_contact", {}, "crashed", "not a wheel"),
    ("underground", "below_ground", {}, "crashed", "below the ground"),
    ("filter lost", "diverged", {}, "diverged", "filter"),
    ("too long on the ground", "timeout", {}, "timeout", "still rolling"),
    ("too long in the air", "timeout", NO_CONTACT, "timeout", "in the air"),
    ("stopped in the air", "stopped", NO_CONTACT, "error", "without contact"),
    ("no trim", "trim_failed", {}, "trim_failed", "trim"),
    ("failure", "error", {}, "error", "failed"),
]


@pytest.mark.parametrize(("end", "changes", "outcome", "reason"), [c[1:] for c in CASES], ids=[c[0] for c in CASES])
def test_outcome(end: str, changes: dict[str, dict[int, float]], outcome: str, reason: str) -> None:
    found = measured(landing(**changes), end)
    assert found["outcome"] == outcome
    assert reason in found["reason"]
    assert found["box"]["outcome"]["ok"] is (outcome == "landed")


def test_a_landing_within_every_limit_is_in_the_box() -> None:
    found = measured(landing())
    assert found["in_box"]
    # 203.054 m past the threshold, on the centreline, at 0.72 of 1 m/s
    margins = {key: limit["margin"] for key, limit in found["box"].items() if key != "outcome"}
    assert margins == pytest.approx({
        "along_min_m": 103.05393, "along_max_m": 246.94607, "cross_max_m": 2.0, "sink_max_mps": 0.28,
        "bank_max_deg": 3.0, "stop_cross_max_m": 3.0,
    })  # fmt: skip
    assert not measured(landing(), "timeout")["in_box"]


def test_an_unknown_end_is_refused() -> None:
    with pytest.raises(ValueError, match=r"end: 'landed' is not one of stopped, touchdown"):
        measured(landing(), "landed")


@pytest.mark.parametrize(
    ("key", "changes", "value"),
    [
        ("along_min_m", {"body_x_m": {TOUCH: 100.2}}, 99.9206),
        ("along_max_m", {"body_x_m": {TOUCH: 450.3}}, 450.0206),
        ("cross_max_m", {"body_y_m": {TOUCH: -2.1}}, 2.1),
        ("sink_max_mps", {"wheel_height_m": {8: 0.0201, 9: 0.01}}, 1.212),
        ("bank_max_deg", {"body_roll_deg": {TOUCH: -3.1}}, 3.1),
        ("stop_cross_max_m", {"body_y_m": {LAST: 3.1}}, 3.1),
    ],
)
def test_each_limit_of_the_box(key: str, changes: dict[str, dict[int, float]], value: float) -> None:
    found = measured(landing(**changes))
    assert found["outcome"] == "landed"
    assert not found["in_box"]
    assert [name for name, limit in found["box"].items() if not limit["ok"]] == [key]
    assert found["box"][key]["value"] == pytest.approx(value)
    assert found["box"][key]["limit"] == getattr(SCENARIO.box, key)
    beyond = value - found["box"][key]["limit"] if key != "along_min_m" else found["box"][key]["limit"] - value
    assert found["box"][key]["margin"] == pytest.approx(-beyond)
    assert beyond > 0.0


def test_the_box_needs_a_touchdown_and_a_stop() -> None:
    found = measured(empty_log(0), "trim_failed")
    assert found["touchdown"] is None
    assert not any(limit["ok"] for limit in found["box"].values())
    assert {limit["margin"] for limit in found["box"].values()} == {None}
    running = measured(landing(), "timeout")
    assert running["stop"] is None
    assert not running["box"]["stop_cross_max_m"]["ok"]


def test_stop_is_where_the_log_ends() -> None:
    stop = measured(landing(body_y_m={LAST: 0.7}))["stop"]
    assert stop == pytest.approx({"x_m": 200.0 + 40.0 / 3.0, "y_m": 0.7, "time_s": 40.0 / 120.0})


def test_bounces_are_long_enough_and_come_back() -> None:
    def in_the_air(*gaps: range) -> int:
        lifted = {row: 0.0 for gap in gaps for row in gap}
        return int(measured(landing(wow_left=lifted, wow_right=lifted))["bounces"])

    assert in_the_air() == 0
    assert in_the_air(range(12, 24)) == 0  # 12 steps are 0.1 s, no longer
    assert in_the_air(range(12, 25)) == 1
    assert in_the_air(range(11, 25), range(26, 40)) == 2
    assert in_the_air(range(12, 41)) == 0  # it does not come back
    only_left = spread(range(12, 30), 0.0)
    assert measured(landing(wow_left=only_left))["bounces"] == 0


def test_tracking_by_hand() -> None:
    """From 1000 m before the threshold to the flare, at row 5, and to the touchdown, at row 10."""
    log = landing(body_x_m={0: -1000.5, 1: 145.0 - 1000.0, 2: 145.0, 3: 145.0, 4: 145.0, 5: 145.0})
    drop = 1000.0 * math.tan(math.radians(3.0))
    for row, height in enumerate((500.0, drop + 2.0, 1.0, -1.0, 2.0, 500.0)):
        log["body_height_m"][row] = height
    log["body_y_m"][:11] = [900.0, 3.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 900.0]
    found = measured(log)["tracking"]
    # magnitudes 1, 1, 2, 2: the 95th percentile, at 0.95 · 3 = 2.85 of the sorted four, is 2
    assert found["glide_slope_to_flare_m"] == pytest.approx({"rms": math.sqrt(10.0 / 4.0), "p95": 2.0})
    # eight of magnitude 1 and a 3: at 0.95 · 8 = 7.6 of the sorted nine, 1 + 0.6 · 2
    assert found["localizer_m"] == pytest.approx({"rms": math.sqrt(17.0 / 9.0), "p95": 2.2})
    assert found["glide_slope_m"]["rms"] > 100.0


def test_navigation_errors() -> None:
    nan = math.nan
    log = landing(true_along_m={0: -1000.5}, true_yaw_deg={-1: 359.0})
    log["vision_yaw_deg"][:12] = [50.0, 2.0, nan, -3.0, 1.0, nan, nan, nan, nan, nan, 77.0, 77.0]
    log["fused_yaw_deg"][:12] = [50.0, nan, 9.0, -2.0, 0.0, 9.0, 9.0, 9.0, 9.0, 9.0, 77.0, 77.0]
    found = measured(log)["navigation"]
    # past 1000 m before the threshold and before the touchdown at row 10; 359° is -1°.  Vision errs by 3, -2, 2: the
    # 95th # percentile is at 0.95 · 2 = 1.9 of the sorted three; the filter by -1, 1 and six times 10; rows 3 and 4
    # have both
    vision = {"rms": math.sqrt(17.0 / 3.0), "p95": 2.9, "frames": 3, "paired_rms": 2.0, "paired_frames": 2}
    fused = {"rms": math.sqrt(602.0 / 8.0), "p95": 10.0, "frames": 8, "paired_rms": 1.0, "paired_frames": 2}
    assert found["vision"]["yaw_deg"] == pytest.approx(vision)
    assert found["fused"]["yaw_deg"] == pytest.approx(fused)
    nothing = {"rms": None, "p95": None, "frames": 0, "paired_rms": None, "paired_frames": 0}
    assert found["vision"]["along_m"] == nothing


def test_consistency_by_phase() -> None:
    log = landing(phase={LAST: 4.0})
    for name in ("nees9", "nees15", "nis_dof", "accepted", "lines_found"):
        log[name][:] = np.nan
    for row, value in {0: 8.0, 2: 7.0, 4: 10.0, 6: 3.0, 9: 5.0, 10: 20.0, 30: 30.0, LAST: 1000.0}.items():
        log["nees9"][row], log["nees15"][row] = value, 2.0 * value
    for row, numbers, accepted in ((0, 6.0, 1.0), (4, 6.0, 0.0), (6, 4.0, 1.0), (9, 4.0, 1.0), (10, 4.0, 0.0)):
        log["nis_dof"][row], log["accepted"][row] = numbers, accepted
        log["lines_found"][row] = 7.0 if numbers == 6.0 else 5.0
    assert measured(log)["consistency"] == {
        "early": {"nees9_mean": 9.0, "nees15_mean": 18.0, "frames": 2, "rejected": 1},
        "late": {"nees9_mean": 4.0, "nees15_mean": 8.0, "frames": 2, "rejected": 0},
        "coasting": {"nees9_mean": 7.0, "nees15_mean": 14.0, "frames": 1, "rejected": 0},
        "rollout": {"nees9_mean": 25.0, "nees15_mean": 50.0, "frames": 2, "rejected": 1},
    }


def test_coverage_counts_the_frames_in_the_air_within_the_predicted_95_percent() -> None:
    """Five frames, two of them on the ground; rows that are no frames do not count."""
    log = landing()
    log["nees9"][:] = np.nan
    log["nees9"][[0, 4, 8, 12, 16]] = 9.0
    log["sigma_cross_m"][:], log["sigma_yaw_deg"][:] = 2.0, 1.0
    log["fused_cross_m"] = log["true_cross_m"] + 100.0
    log["fused_cross_m"][[0, 4, 8]] = log["true_cross_m"][[0, 4, 8]] + [3.91, -3.93, 0.0]  # 1.96 σ are 3.92 m
    log["true_yaw_deg"][:] = 359.0
    log["fused_yaw_deg"][:] = 0.5
    found = measured(log)["coverage"]
    assert (found["frames"], found["cross_m"], found["yaw_deg"]) == (3, pytest.approx(2.0 / 3.0), 1.0)
    log["nees9"][:] = np.nan
    assert measured(log)["coverage"] == {"frames": 0} | dict.fromkeys(QUANTITIES)


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("end", metrics.ENDS)
def test_short_logs_give_valid_json(rows: int, end: str) -> None:
    found = measured(empty_log(rows), end)
    json.dumps(found, allow_nan=False)
    assert found["touchdown"] is None


def test_a_whole_flight_lands_in_the_box() -> None:
    found = measured(flight_log(np.random.default_rng(1)))
    json.dumps(found, allow_nan=False)
    assert (found["scenario"], found["seed"], found["outcome"], found["in_box"]) == ("landing", 7, "landed", True)
    assert found["bounces"] == 0
    for quantity, vision in found["navigation"]["vision"].items():
        assert found["navigation"]["fused"][quantity]["rms"] < vision["rms"]
