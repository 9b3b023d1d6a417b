"""Rows of a batch that was not flown, with what they come to known beforehand."""

import math
from typing import Any

import numpy as np

from landsim.batch.row import ARRAYS, SCALARS, Row
from landsim.log import QUANTITIES

DISTANCE = np.array([1000.0, 500.0, 100.0, 0.0, -100.0])
NO_TOUCHDOWN: dict[str, Any] = dict.fromkeys(
    (
        "x_m", "y_m", "sink_rate_mps", "ground_speed_mps", "pitch_deg", "bank_deg", "heading_error_deg",
        "touchdown_time_s", "stop_x_m", "stop_y_m", "stop_time_s",
    )
)  # fmt: skip

NEVER = ("wrong_line_alarm_s", "unaided_alarm_s", "inconsistent_alarm_s", "fault_at_s", "fault_detected_after_s")
"""Of a flight in which there was no fault and no alarm."""


def good(index: int, **changes: Any) -> Row:
    """A landing in the box of ``landing``, in its middle and on the centreline; everything by name may be changed."""
    row: Row = {name: {int: 0, float: 0.0, str: "", bool: True}[kind] for name, kind in SCALARS.items()}
    row |= {name: np.zeros(DISTANCE.size) for name in ARRAYS}
    row |= {"index": index, "seed": index, "outcome": "landed", "end": "stopped", "traceback": None}
    row |= {"line_noise": "edge-points", "reason": "main wheels first", "in_box": True, "wall_time_s": 0.5}
    row |= {"x_m": 275.0, "sink_rate_mps": 0.5, "ground_speed_mps": 36.0, "touchdown_time_s": 30.0}
    row |= {"distance_m": DISTANCE, "time_s": np.array([0.0, 12.5, 22.5, 25.0, 27.5]), "stage": np.ones(5)}
    row |= {f"nees9_mean_{phase}": 9.0 for phase in ("early", "late", "coasting", "rollout")}
    row |= {f"nees15_mean_{phase}": 15.0 for phase in ("early", "late", "coasting", "rollout")}
    row |= {f"coverage95_{q}": 0.95 for q in QUANTITIES} | {"coverage_frames": 700}
    row |= {f"frames_{phase}": 100 for phase in ("early", "late", "coasting", "rollout")}
    row |= {f"{name}_protection_frames": 700 for name in ("lateral", "vertical")}
    row |= {"flagged": False, "false_alarm": False} | dict.fromkeys(NEVER)
    return row | changes


def aloft(index: int, **changes: Any) -> Row:
    """A flight that never came down."""
    return good(index, **(NO_TOUCHDOWN | {"outcome": "timeout", "in_box": False, "end": "timeout"} | changes))


def around(index: int, reason: str = "no line has been believed for too long, 21.5 m up", **changes: Any) -> Row:
    """A flight that went around."""
    changes = {
        "outcome": "go_around",
        "end": "go_around",
        "reason": f"gone around: {reason}",
        "flagged": True,
    } | changes
    return good(index, **(NO_TOUCHDOWN | {"in_box": False} | changes))


def failed(index: int, **changes: Any) -> Row:
    """A flight that raised."""
    row: Row = dict.fromkeys(good(0))
    row |= {name: np.full(DISTANCE.size, math.nan) for name in ARRAYS} | {"distance_m": DISTANCE}
    row |= {"index": index, "seed": index, "outcome": "error", "end": "error", "in_box": False}
    return row | {"reason": "ValueError: no", "line_noise": "edge-points"} | changes
