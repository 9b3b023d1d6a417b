"""What navigation stated of itself in a flight, beside what was true: protection levels and alarms.  Pure.

All of it is from a log, up to the touchdown, the beginning of a go-around or the end, whichever comes first: what is
stated on the ground or on the way up lands nobody anywhere else.
"""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from landsim.log import LINES
from landsim.state import Alarm, Phase

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]

PROTECTED = {"lateral": "cross_m", "vertical": "height_m"}
"""Protection levels, and the quantities of ``landsim.log.QUANTITIES`` that they are of."""
OF_A_FAULT = Alarm.WRONG_LINE | Alarm.INCONSISTENT
"""Alarms that say that something is wrong; to be without lines is no fault of theirs."""
AGAINST_LANDING = Alarm.UNAIDED | Alarm.INCONSISTENT
"""Alarms that speak against a landing, as `landsim.go_around` has it: a wrong line is left out."""
DETECTION_S = 1.0
"""An alarm that is raised so long after a fault is over is not of that fault any more."""


def integrity(
    log: Mapping[str, Array], end_row: int, decision_height: float, commit_height: float, *, wrong: bool
) -> dict[str, Any]:
    """How navigation's word held, and what became of a fault.

    A protection level is of the body's origin, an error that of the camera, which a log has: they differ by the error
    of the attitude times the camera's lever arm, millimetres beside metres.

    Parameters
    ----------
    log : mapping of str to (n,) array
        The columns of ``landsim.log.COLUMNS``; n may be 0.
    end_row : int
        Of the touchdown, or n.
    decision_height, commit_height : float
        Of the main wheels, m: an alarm that stands neither at nor between them flags no landing, nor does one before
        navigation has started.
    wrong : bool
        Whether the line at fault is another one, and not missing.

    Returns
    -------
    dict
        None for what there is not.

        ``lateral``, ``vertical``   of the frames in the air for which guidance was given a protection level:
                                    ``frames``, ``exceeded_frames`` in which the error was greater, their ``share``;
                                    ``protection_max_m`` and ``protection_last_m`` of the level itself
        ``misleading_frames``       in which either error was greater while no alarm stood
        ``first_alarm_s``           when each of ``landsim.state.Alarm`` first stood
        ``fault_at_s``              of the first frame with a fault: a line missing, or another one in view
        ``fault_detected_after_s``  from a wrong line to the first of `OF_A_FAULT` that is raised because of it: since
                                    it began, and within `DETECTION_S` of its end
        ``false_alarm``             whether one of these stood before there was a fault or an error beyond its level:
                                    that the lines contradict a state that is wrong is true
        ``flagged``                 whether one of `AGAINST_LANDING` stood between decision and commitment, or a
                                    go-around began
    """
    time, rows = log["time_s"], np.arange(log["time_s"].size)
    climbing = (log["phase"] == Phase.GO_AROUND) & (rows < end_row)
    judged = rows < (int(np.argmax(climbing)) if climbing.any() else end_row)
    alarm = np.nan_to_num(log["alarm"]).astype(int)
    # guidance is called at captures, which are the rows that say whether there was a fault
    frame = judged & np.isfinite(log["fault"])
    flying = judged & (log["phase"] != Phase.ACQUIRE)  # whatever navigation takes itself for
    landing = frame & flying
    exceeded = np.zeros(rows.size, dtype=bool)
    result: dict[str, Any] = {}
    for name, quantity in PROTECTED.items():
        level, off = log[f"{name}_protection_m"], np.abs(log[f"fused_{quantity}"] - log[f"true_{quantity}"])
        stated = landing & np.isfinite(level) & np.isfinite(off)
        beyond = stated & (off > level)
        exceeded |= beyond
        frames, count = int(np.sum(stated)), int(np.sum(beyond))
        result[name] = {
            "frames": frames,
            "exceeded_frames": count,
            "share": count / frames if frames else None,
            "protection_max_m": float(level[stated].max()) if frames else None,
            "protection_last_m": float(level[stated][-1]) if frames else None,
        }
    fault_at = _first(time, frame & (_in_view(log) if wrong else log["fault"] > 0.0))
    warned = judged & ((alarm & OF_A_FAULT) != 0)
    first_warned = _first(time, warned)
    causes = [at for at in (fault_at, _first(time, exceeded)) if at is not None]
    detected = None
    if wrong and fault_at is not None:
        over = float(time[np.flatnonzero(frame & (log["fault"] > 0.0))[-1]])
        raised = warned & ~np.append(False, warned[:-1])
        detected = _first(time, raised & (time >= fault_at) & (time <= over + DETECTION_S))
    height = log["wheel_height_m"]
    low = judged & flying & (height <= decision_height) & (height > commit_height)
    return result | {
        "misleading_frames": int(np.sum(exceeded & (alarm == 0))),
        "first_alarm_s": {
            str(kind.name).lower(): _first(time, judged & ((alarm & kind) != 0)) for kind in Alarm if kind
        },
        "fault_at_s": fault_at,
        "fault_detected_after_s": None if fault_at is None or detected is None else detected - fault_at,
        "false_alarm": first_warned is not None and all(first_warned < at for at in causes),
        "flagged": bool(climbing.any() or (low & ((alarm & AGAINST_LANDING) != 0)).any()),
    }


def _in_view(log: Mapping[str, Array]) -> Flags:
    """Rows of frames in which the line at fault was seen: what is too far off, or in fog, nobody can detect."""
    seen = [(log["fault"] == i) & np.isfinite(log[f"{line}_seen_u0"]) for i, line in enumerate(LINES, 1)]
    return np.asarray(np.any(seen, axis=0))


def _first(time: Array, rows: Flags) -> float | None:
    found = np.flatnonzero(rows)
    return float(time[found[0]]) if found.size else None
