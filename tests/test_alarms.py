"""What navigation stated beside what was true, counted by hand.

====================  ============================================================================================
protection levels     a log of 40 rows, a frame every second one, whose errors and levels are written into it
alarms, faults        times of rows; the touchdown and the go-around end what is counted
a flight              the log has what guidance was given, held from frame to frame, and NaN where there is none
====================  ============================================================================================
"""

import json
import math
from typing import Any

import numpy as np
import pytest
from batches import short
from synthetic import STEP, empty_log

from landsim.alarms import integrity
from landsim.navigation import Navigator
from landsim.simulate import fly
from landsim.state import Alarm, NavState, Phase

ROWS, DOWN = 40, 30


def approach(**columns: list[tuple[slice, float]]) -> Any:
    """On the approach to row 20, in the flare to the touchdown at row 30; 1 m and 2 m are stated, and none is off."""
    log = empty_log(ROWS)
    log["phase"][:] = Phase.APPROACH
    log["phase"][20:] = Phase.FLARE
    log["phase"][DOWN:] = Phase.ROLLOUT
    log["wheel_height_m"][:DOWN], log["wheel_height_m"][DOWN:] = 10.0, 0.0
    log["fault"][::2] = 0.0
    log["lateral_protection_m"][:], log["vertical_protection_m"][:] = 1.0, 2.0
    for quantity in ("cross_m", "height_m"):
        log[f"true_{quantity}"][:] = 7.0
        log[f"fused_{quantity}"] = log[f"true_{quantity}"].copy()
    for name, values in columns.items():
        for rows, value in values:
            log[name][rows] = value
    return log


def stated(log: Any, end_row: int = DOWN, *, wrong: bool = True) -> dict[str, Any]:
    found = integrity(log, end_row, 30.0, 2.0, wrong=wrong)
    json.dumps(found, allow_nan=False)
    return found


def at(row: int) -> Any:
    return pytest.approx(row * STEP, abs=1e-12)


def test_errors_beyond_the_protection_level_are_counted_in_frames_in_the_air() -> None:
    """Rows 4 to 9 are 1.01 m right, 12 to 14 two metres low, which is not beyond 2 m; on the ground all is off."""
    log = approach(
        fused_cross_m=[(slice(4, 10), 8.01), (slice(DOWN, ROWS), 99.0)],
        fused_height_m=[(slice(12, 15), 5.0), (slice(24, 25), 4.9), (slice(25, 26), 0.0)],
        lateral_protection_m=[(slice(0, 2), 3.0), (slice(28, DOWN), 0.5)],
        phase=[(slice(0, 2), float(Phase.ACQUIRE))],
    )
    found = stated(log)
    # frames are 2, 4, .., 28; of rows 4 to 9 three
    assert found["lateral"] == {
        "frames": 14, "exceeded_frames": 3, "share": 3.0 / 14.0, "protection_max_m": 1.0, "protection_last_m": 0.5,
    }  # fmt: skip
    assert (found["vertical"]["exceeded_frames"], found["vertical"]["protection_max_m"]) == (1, 2.0)
    assert found["misleading_frames"] == 4
    assert (found["flagged"], found["false_alarm"]) == (False, False)


def test_navigation_that_believes_itself_down_while_it_flies_counts() -> None:
    log = approach(phase=[(slice(20, None), float(Phase.ROLLOUT))], fused_cross_m=[(slice(22, None), 9.0)])
    found = stated(log)
    assert (found["lateral"]["frames"], found["lateral"]["exceeded_frames"], found["misleading_frames"]) == (15, 4, 4)


def test_an_error_that_an_alarm_goes_with_misleads_nobody() -> None:
    log = approach(fused_cross_m=[(slice(4, 10), 5.0)], alarm=[(slice(6, 8), float(Alarm.UNAIDED))])
    found = stated(log)
    assert (found["lateral"]["exceeded_frames"], found["misleading_frames"]) == (3, 2)
    assert found["first_alarm_s"] == {"wrong_line": None, "unaided": at(6), "inconsistent": None}
    assert (found["flagged"], found["false_alarm"]) == (True, False)  # to be without lines is not said of a fault


def test_without_a_protection_level_or_an_estimate_nothing_is_counted() -> None:
    log = approach(lateral_protection_m=[(slice(None), math.nan)], fused_height_m=[(slice(4, None), math.nan)])
    found = stated(log)
    nothing = {"share": None, "protection_max_m": None, "protection_last_m": None}
    assert found["lateral"] == {"frames": 0, "exceeded_frames": 0} | nothing
    assert found["vertical"]["frames"] == 2
    empty = stated(empty_log(0), 0)
    assert empty["lateral"] == empty["vertical"] == {"frames": 0, "exceeded_frames": 0} | nothing


def faulty(line: str, *, seen: slice = slice(None), **alarm: list[tuple[slice, float]]) -> Any:
    """A fault of a line in the frames of rows 10 to 19."""
    number = {"left": 1.0, "threshold": 2.0, "right": 3.0}[line]
    return approach(fault=[(slice(10, 20, 2), number)], **{f"{line}_seen_u0": [(seen, 100.0)]}, **alarm)


def test_a_wrong_line_is_detected_from_when_it_is_seen() -> None:
    late = faulty("right", seen=slice(13, None), alarm=[(slice(18, 22), float(Alarm.WRONG_LINE))])
    found = stated(late)
    assert (found["fault_at_s"], found["fault_detected_after_s"]) == (at(14), at(4))
    assert (found["flagged"], found["false_alarm"]) == (False, False)  # it is left out, and what is left may land
    found = stated(faulty("left", alarm=[(slice(12, 13), float(Alarm.UNAIDED)), (slice(16, 18), 6.0)]))
    assert (found["fault_detected_after_s"], found["first_alarm_s"]["inconsistent"]) == (at(6), at(16))
    missed = stated(faulty("threshold", alarm=[(slice(DOWN, None), float(Alarm.WRONG_LINE))]))
    assert (missed["fault_at_s"], missed["fault_detected_after_s"], missed["flagged"]) == (at(10), None, False)


def test_a_wrong_line_that_nobody_saw_excuses_no_alarm_and_a_missing_one_is_not_to_be_detected() -> None:
    alarm = [(slice(18, 22), float(Alarm.WRONG_LINE))]
    unseen = stated(faulty("threshold", seen=slice(20, None), alarm=alarm))
    assert (unseen["fault_at_s"], unseen["fault_detected_after_s"], unseen["false_alarm"]) == (None, None, True)
    missing = stated(faulty("threshold", seen=slice(20, None), alarm=alarm), wrong=False)
    assert (missing["fault_at_s"], missing["fault_detected_after_s"], missing["false_alarm"]) == (at(10), None, False)


def test_an_alarm_that_is_over_above_the_decision_height_flags_no_landing() -> None:
    high = [(slice(0, 10), 30.1)]
    assert not stated(approach(wheel_height_m=high, alarm=[(slice(0, 10), 2.0)]))["flagged"]
    assert stated(approach(wheel_height_m=high, alarm=[(slice(0, 11), 2.0)]))["flagged"]


def test_an_alarm_below_the_commitment_or_before_navigation_has_started_flags_no_landing() -> None:
    low = [(slice(20, DOWN), 2.0)]
    assert not stated(approach(wheel_height_m=low, alarm=[(slice(20, DOWN), 2.0)]))["flagged"]
    assert stated(approach(wheel_height_m=low, alarm=[(slice(19, DOWN), 2.0)]))["flagged"]
    waiting = [(slice(0, 12), float(Phase.ACQUIRE))]
    assert not stated(approach(phase=waiting, alarm=[(slice(0, 12), 2.0)]))["flagged"]
    assert not stated(approach(alarm=[(slice(0, 12), float(Alarm.WRONG_LINE))]))["flagged"]


def test_an_alarm_that_stood_before_or_comes_long_after_has_not_found_the_fault() -> None:
    standing = stated(faulty("left", alarm=[(slice(6, 12), float(Alarm.WRONG_LINE))]))
    assert (standing["fault_at_s"], standing["fault_detected_after_s"], standing["false_alarm"]) == (at(10), None, True)
    again = stated(faulty("left", alarm=[(slice(6, 12), 1.0), (slice(14, 16), 1.0)]))
    assert again["fault_detected_after_s"] == at(4)


def test_an_alarm_is_not_false_when_it_is_the_state_that_is_wrong() -> None:
    for first, false in ((9, False), (11, True)):  # frames are the even rows
        log = approach(fused_cross_m=[(slice(first, None), 9.0)], alarm=[(slice(10, 12), float(Alarm.INCONSISTENT))])
        assert stated(log)["false_alarm"] is false


@pytest.mark.parametrize(("row", "false"), [(8, True), (10, False), (24, False)])
def test_an_alarm_before_any_fault_is_a_false_one(row: int, false: bool) -> None:
    assert stated(faulty("left", alarm=[(slice(row, row + 2), float(Alarm.WRONG_LINE))]))["false_alarm"] is false
    assert stated(approach(alarm=[(slice(row, row + 2), float(Alarm.INCONSISTENT))]))["false_alarm"]


def test_a_go_around_is_a_flag_and_what_is_stated_on_the_way_up_does_not_count() -> None:
    climb = [(slice(16, None), float(Phase.GO_AROUND))]
    log = approach(phase=climb, fused_cross_m=[(slice(14, None), 99.0)], alarm=[(slice(18, None), 1.0)])
    found = stated(log)
    assert (found["lateral"]["frames"], found["lateral"]["exceeded_frames"]) == (8, 1)
    assert (found["flagged"], found["false_alarm"], found["first_alarm_s"]["wrong_line"]) == (True, False, None)
    after = stated(approach(phase=[(slice(DOWN, None), float(Phase.GO_AROUND))]))
    assert not after["flagged"]


def test_the_log_has_what_guidance_was_given_held_to_the_next_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, given = Navigator.state, list[NavState]()

    def state(self: Navigator, time: float) -> NavState:
        made = ours(self, time)
        alarm = Alarm(len(given) % 8)
        given.append(made._replace(alarm=alarm, lateral_protection=made.lateral_protection + len(given)))
        return given[-1]

    monkeypatch.setattr(Navigator, "state", state)
    log = fly(short(), 2).log
    for name, values in (
        ("alarm", [nav.alarm for nav in given]),
        ("lateral_protection_m", [nav.lateral_protection for nav in given]),
        ("vertical_protection_m", [nav.vertical_protection for nav in given]),
    ):
        np.testing.assert_array_equal(log[name], np.repeat(values, 4)[: log[name].size], err_msg=name)
    assert np.isnan(log["lateral_protection_m"][0])
    assert np.isfinite(log["lateral_protection_m"][-1])


def test_guidance_that_is_given_the_truth_is_given_no_protection_level() -> None:
    flight = fly(short(**{"simulation.guidance_state": "truth", "camera.outages_s": [[1.0, 2.0]]}), 2)
    assert np.isnan(flight.log["lateral_protection_m"]).all()
    assert not flight.log["alarm"].any()
    assert set(flight.log["stage"]) == {0.0, 1.0}, "the stage stays that of the frames"
    assert flight.metrics["integrity"]["lateral"]["frames"] == 0
