"""What the landings come to: room to each limit, what went wrong without a warning, go-arounds, navigation's word."""

import re
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.so3 import Array
from landsim.alarms import PROTECTED
from landsim.batch.flights import Flights
from landsim.batch.measures import BoxLimit, box_of
from landsim.batch.published import TOUCHDOWN, TRACKING
from landsim.batch.sections.tracking import COLUMNS
from landsim.batch.sections.words import flights_for, number, several, with_unit
from landsim.batch.stats import (
    CONFIDENCE,
    clopper_pearson,
    flights_needed,
    quantile_interval,
    rate,
    ratio_interval,
    upper_bound,
)
from landsim.config import Scenario
from landsim.schema.plug_ins import OWN

FAR = 0.99
"""The quantile, towards a limit, whose room is said."""
USED = (0.05, 0.5, 0.95, FAR)
"""Quantiles of the share of a limit that is used."""
DETECTED_S = 1.0
"""Within which a wrong line ought to be found."""
CAME_DOWN_BADLY = ("crashed", "off_runway")
KINDS = {
    "in_box": "landed in the box",
    "outside_flagged": "landed outside the box, flagged",
    "outside": "landed outside the box without a flag",
    "crashed_flagged": "crashed or off the runway, flagged",
    "crashed": "crashed or off the runway without a flag",
    "go_around": "gone around",
    "other": "neither: diverged, out of time, or not flown to an end",
}
"""How a flight ended; each did in one of these ways."""
NEVER_FLOWN = ("error", "trim_failed")
_HEIGHT = re.compile(r", -?[0-9.]+ m up$")
_GONE = "gone around: "


def verdict(scenario: Scenario, flights: Flights) -> dict[str, Any]:
    """The section ``verdict``.

    A limit is judged over the flights that have its number, whether they landed or crashed: to leave out those whose
    sink rate broke the gear would flatter the sink rate.  A go-around has no touchdown.  ``flagged`` is a flight in
    which an alarm stood below the decision height.
    """
    result = {
        "confidence": CONFIDENCE,
        "limits": [_of_box(limit, flights) for limit in box_of(scenario)],
        "tracking": _tracking(flights),
        "outcomes": _outcomes(flights),
        "harm": _harm(flights),
        "go_arounds": _go_arounds(flights),
        "protection": _protection(flights, scenario.navigation.integrity_risk),
        "faults": _faults(scenario, flights),
    }
    return result | {"text": _text(result, flights.n)}


def _of_box(limit: BoxLimit, flights: Flights) -> dict[str, Any]:
    values = flights.numbers(limit.measure.key)
    values = values[np.isfinite(values)]
    asked = TOUCHDOWN.get(limit.key)
    return {
        "key": limit.key,
        "title": limit.measure.symbol,
        "unit": limit.measure.unit,
        "side": limit.side,
        "of": f"flights with a {limit.measure.of}",
        "source": "the scenario's box",
        "criterion": None if asked is None else asked._asdict(),
        **_room(np.abs(values) if limit.measure.magnitude else values, limit.limit, above=limit.side == "above"),
        "used": _used(limit.used(values)),
    }


def _tracking(flights: Flights) -> list[dict[str, Any]]:
    """The deviation that 95 % of each flight's approach keeps to, as another limit."""
    found = []
    for criterion in TRACKING:
        values = flights.numbers(criterion.column)
        values = values[np.isfinite(values)]
        name = criterion.column.removesuffix("_p95_m")
        found.append(
            {
                "key": criterion.column,
                "title": COLUMNS[name],
                "unit": "m",
                "side": "above",
                "of": "flights with an approach",
                "source": criterion.source,
                "estimate": criterion.estimate,
                "criterion": None,
                **_room(values, criterion.limit, above=True),
                "used": _used(values / criterion.limit),
            }
        )
    return found


def _room(values: Array, limit: float, *, above: bool) -> dict[str, Any]:
    """How many of the numbers (n,) are beyond a limit, what n of them can show, and how far from it they stay."""
    ordered, n = np.sort(values), int(values.size)
    beyond = int(np.sum(ordered > limit if above else ordered < limit))
    sign, p = (1.0, FAR) if above else (-1.0, 1.0 - FAR)
    worst = None if n == 0 else float(ordered[-1 if above else 0])
    quantile = None
    if n >= flights_for(100.0 * FAR):  # of fewer it is no more than the worst of them
        quantile = {"p": p, "value": float(np.quantile(ordered, p)), **quantile_interval(ordered, p)._asdict()}
    return {
        "limit": limit,
        **rate(beyond, n),
        "below": upper_bound(beyond, n),
        "quantile": quantile,
        "margin": None if quantile is None else sign * (limit - quantile["value"]),
        "worst": worst,
        "margin_of_worst": None if worst is None else sign * (limit - worst),
    }


def _used(shares: Array) -> dict[str, Any]:
    """Quantiles of the share of a limit that was used, 1 at the limit; those that n has room for."""
    n = int(shares.size)
    found: list[dict[str, Any]] = [
        {"p": p, "value": float(np.quantile(shares, p))} for p in USED if n >= flights_for(100.0 * max(p, 1.0 - p))
    ]
    return {"quantiles": found, "worst": float(shares.max()) if n else None}


def _kinds(flights: Flights) -> dict[str, NDArray[np.bool_]]:
    """Which flights (n,) are of each of `KINDS`."""
    flagged, landed = flights.flags("flagged"), flights.are("outcome", "landed")
    in_box, around = landed & flights.flags("in_box"), flights.are("outcome", "go_around")
    crashed = np.any([flights.are("outcome", outcome) for outcome in CAME_DOWN_BADLY], axis=0)
    outside = landed & ~in_box
    return {
        "in_box": in_box,
        "outside_flagged": outside & flagged,
        "outside": outside & ~flagged,
        "crashed_flagged": crashed & flagged,
        "crashed": crashed & ~flagged,
        "go_around": around,
        "other": ~(landed | crashed | around),
    }


def _outcomes(flights: Flights) -> list[dict[str, Any]]:
    kinds = _kinds(flights)
    return [{"key": key, "title": title, **rate(int(kinds[key].sum()), flights.n)} for key, title in KINDS.items()]


def _harm(flights: Flights) -> dict[str, Any]:
    """Of those that nobody was warned of: landings outside the box, and crashes."""
    kinds = _kinds(flights)
    count = int((kinds["outside"] | kinds["crashed"]).sum())
    return {**rate(count, flights.n), "below": upper_bound(count, flights.n)}


def _go_arounds(flights: Flights) -> list[dict[str, Any]]:
    """Reasons without the height at which each was had, the most frequent first."""
    around = flights.are("outcome", "go_around")
    reasons = [str(flights.columns["reason"][i] or "") for i in np.flatnonzero(around)]
    counts = Counter(_HEIGHT.sub("", reason.removeprefix(_GONE)) for reason in reasons)
    return [
        {"reason": reason, **rate(count, flights.n)}
        for reason, count in sorted(counts.items(), key=lambda one: (-one[1], one[0]))
    ]


def _protection(flights: Flights, risk: float) -> dict[str, Any]:
    """Errors beyond the protection level, against the risk that it is stated with.

    The frames of a flight share their error: the interval of their share is over flights.  Where no flight has one, the
    share of the frames is no more than that of the flights with any.  Where few have, Student's interval is too narrow:
    its upper end is then no less than the greatest share of a flight times the upper end of the flights' rate, and that
    the level was kept is not said of fewer than `FEW`.
    """
    levels = []
    for name in PROTECTED:
        frames = np.nan_to_num(flights.numbers(f"{name}_protection_frames"))
        exceeded = np.nan_to_num(flights.numbers(f"{name}_exceeded_frames"))[frames > 0]
        frames = frames[frames > 0]
        n, any_beyond = int(frames.size), int(np.sum(exceeded > 0))
        low, high = ratio_interval(exceeded, frames)
        if n and any_beyond == 0:
            low, high = 0.0, float(clopper_pearson(0, n)[1])
        elif high is not None:
            high = max(high, float(np.max(exceeded / frames) * clopper_pearson(any_beyond, n)[1]))
        last = flights.numbers(f"{name}_protection_last_m")
        last = last[np.isfinite(last)]
        levels.append(
            {
                "name": name,
                "flights": rate(any_beyond, n),
                "frames": int(frames.sum()),
                "exceeded_frames": int(exceeded.sum()),
                "share": float(exceeded.sum() / frames.sum()) if n else None,
                "low": low,
                "high": high,
                "state": None if low is None or high is None else _against(low, high, risk, any_beyond),
                "last_m": float(np.median(last)) if last.size else None,
            }
        )
    stated = np.nan_to_num(flights.numbers("lateral_protection_frames")) > 0
    stated |= np.nan_to_num(flights.numbers("vertical_protection_frames")) > 0
    misled = np.nan_to_num(flights.numbers("misleading_frames"))[stated]
    return {
        "risk": risk,
        "levels": levels,
        "misleading": {**rate(int(np.sum(misled > 0)), int(stated.sum())), "frames": int(misled.sum())},
    }


FEW = 20
"""Flights with an error beyond its level, of fewer of which nothing can be said of the share in which it is."""


def _against(low: float, high: float, risk: float, flights: int) -> str:
    if low > risk:
        return "more"
    return "kept" if high <= risk and (flights == 0 or flights >= FEW) else "open"


def _faults(scenario: Scenario, flights: Flights) -> dict[str, Any]:
    """Wrong lines that were found, and alarms where there was nothing to find."""
    told = scenario.simulation.guidance_state != "truth"
    monitored = told and (scenario.navigation.aiding == "lines" or scenario.plug_ins.estimator != OWN)
    at, after = flights.numbers("fault_at_s"), flights.numbers("fault_detected_after_s")
    faulty = np.isfinite(at) if scenario.fault.kind == "wrong" else np.zeros(flights.n, dtype=bool)
    flown = ~np.any([flights.are("outcome", outcome) for outcome in NEVER_FLOWN], axis=0)
    sound = flown & ~np.isfinite(at) if monitored else np.zeros(flights.n, dtype=bool)
    known = after[faulty & np.isfinite(after)]
    in_time = known <= DETECTED_S + 1e-9  # times are multiples of a frame's, and their differences are rounded
    return {
        "monitored": monitored,
        "within_s": DETECTED_S,
        "detected": rate(int(np.sum(in_time)), int(faulty.sum())),
        "detected_ever": rate(int(known.size), int(faulty.sum())),
        "median_s": float(np.median(known)) if known.size else None,
        "longest_s": float(known.max()) if known.size else None,
        "false_alarms": rate(int(np.sum(flights.flags("false_alarm") & sound)), int(sound.sum())),
    }


def _share(one: dict[str, Any], of: str = "") -> str:
    """A rate in words."""
    share, low, high = (number(100.0 * one[key], 4) for key in ("rate", "low", "high"))
    return f"{one['count']:,} of {one['n']:,}{of and f' {of}'} ({share} %, between {low} % and {high} %)"


_STATES = {
    "more": "more than stated",
    "kept": "no more than stated",
    "open": "which leaves open whether it is more than stated",
}


def _text(found: dict[str, Any], n: int) -> list[str]:
    if n == 0:
        return ["No flight was flown: there is no verdict."]
    harm, kinds = found["harm"], {one["key"]: one for one in found["outcomes"]}
    what = "landed outside the box, crashed or left the runway without a flag"
    unwarned = f"{_share(harm, 'flights')} {what}."
    if harm["count"] == 0:
        confident = f"with {100.0 * CONFIDENCE:g} % confidence fewer than {number(100.0 * harm['below'])} % of all do"
        unwarned = f"No flight of {n:,} {what}: {confident}."
    ended = [f"{_share(kinds['in_box'], 'flights')} landed in the box"]
    ended.append(f"{_share(kinds['go_around'])} went around" if kinds["go_around"]["count"] else "none went around")
    if warned := kinds["outside_flagged"]["count"] + kinds["crashed_flagged"]["count"]:
        ended.append(f"{warned} missed the box or crashed with a flag")
    if others := kinds["other"]["count"]:
        ended.append(f"{others} diverged, ran out of time or did not fly to an end")
    text = [f"{', '.join(ended)}.", unwarned, *_room_text(found["limits"])]
    text += _protection_text(found["protection"]) + _fault_text(found["faults"])
    asked = {one["criterion"]["rate"] for one in found["limits"] if one["criterion"]}
    needed = flights_needed(max(asked))
    enough = "no more than the intervals say" if n >= needed else "nothing of the kind"
    text.append(
        f"The standards for transport aircraft ask for rates below {number(max(asked))} and less, which take"
        f" {needed:,} flights without a single one beyond; this batch shows {enough}."
    )
    return text


def _room_text(limits: list[dict[str, Any]]) -> list[str]:
    """The limit with the least room."""
    known = [one for one in limits if one["n"]]
    if not known:
        return ["No flight touched down: nothing is said of any limit."]
    nearest = max(known, key=lambda one: float(one["used"]["worst"]))
    unit = nearest["unit"]
    limit, worst, room = (with_unit(nearest[key], unit) for key in ("limit", "worst", "margin_of_worst"))
    left = f"{room} of room" if nearest["margin_of_worst"] >= 0.0 else f"{room.lstrip('−')} beyond it"
    told = f"The nearest to its limit, {limit}, is {nearest['title']}: {worst} in the worst flight, {left}"
    if nearest["quantile"] is not None:
        told += f"; {with_unit(nearest['quantile']['value'], unit)} at the {100.0 * FAR:g} % quantile"
    beyond = [f"{one['title']} ({one['count']} of {one['n']:,})" for one in known if one["count"]]
    every = f"Limits that some flight went beyond: {', '.join(beyond)}." if beyond else "No flight went beyond a limit."
    return [f"{told}. {every}"]


def _protection_text(found: dict[str, Any]) -> list[str]:
    told = [
        f"the {one['name']} error was beyond its own in {number(100.0 * one['share'])} % of"
        f" {several(one['frames'], 'frame')} (between {number(100.0 * one['low'])} % and"
        f" {number(100.0 * one['high'])} %), {_STATES[one['state']]}"
        for one in found["levels"]
        if one["state"] is not None
    ]
    if not told:
        return []
    levels = f"Protection levels, stated with a risk of {number(100.0 * found['risk'])} %: {'; '.join(told)}."
    return [f"{levels} While no alarm stood one of them was passed in {_share(found['misleading'], 'flights')}."]


def _fault_text(found: dict[str, Any]) -> list[str]:
    if not found["monitored"]:
        return ["No line was judged by itself: there is no alarm that guidance could have been given."]
    text = []
    if found["detected"]["n"]:
        told = f"A wrong line in view was found within {found['within_s']:g} s"
        in_time = f"in {_share(found['detected'], 'flights')}"
        longest = f"; it took {number(found['longest_s'])} s at most" if found["longest_s"] is not None else ""
        missed = found["detected_ever"]["n"] - found["detected_ever"]["count"]
        text.append(f"{told} {in_time}{longest}{f', and was never found in {missed}' if missed else ''}.")
    if found["false_alarms"]["n"]:
        text.append(f"Without a fault there was a false alarm in {_share(found['false_alarms'], 'flights')}.")
    return text
