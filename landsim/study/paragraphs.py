"""What the verdict's numbers say, in sentences: every figure in them comes from the verdict itself."""

from collections.abc import Mapping, Sequence
from typing import Any

from landsim.study.model import LEVEL, LEVELS, OF_STAGE, READINGS
from landsim.study.verdict import find
from landsim.study.words import listed

AT = f"{LEVEL:g} %"
"""The level at which a bound has to hold, as it is written."""
UNITS = {"deg": "°", "m": " m"}
Verdict = Mapping[str, Any]
Entry = Mapping[str, Any]


def figure(value: float) -> str:
    """Three significant digits, without an exponent."""
    if value == 0.0:
        return "0"
    text = f"{value:.3g}"
    return text if "e" not in text else f"{float(text):f}".rstrip("0").rstrip(".")


def with_unit(value: float, unit: str) -> str:
    """A figure and its unit, deg or m."""
    return f"{figure(value)}{UNITS[unit]}"


def paragraphs_of(verdict: Verdict) -> dict[str, str]:
    """The paragraphs of a verdict by name; one that has nothing to say is left out.

    Parameters
    ----------
    verdict : mapping
        As in verdict.json: ``entries``, ``bounds``, ``meeting``, ``proportions``, ``roll_limits``, ``roll_shifts``,
        ``flights``.
    """
    made = {
        **{f"closest_{stage}": closest(verdict, stage) for stage in OF_STAGE},
        "meeting": meeting(verdict),
        "roll": roll(verdict),
        "fused": fused(verdict),
    }
    return {name: text for name, text in made.items() if text}


def closest(verdict: Verdict, stage: str) -> str:
    """Which noise reading comes closest to the bounds of a stage, and where."""
    judged: dict[str, list[Entry]] = {}
    for reading in READINGS:
        entries = [e for e in find(verdict, stage, reading) if e["holds"] is not None]
        if entries and entries[0]["judged_from_m"] is not None:
            judged[reading] = entries
    if not judged:
        return ""
    order = sorted(judged, key=lambda r: max(_excess(e) for e in judged[r]))
    begin = judged[order[0]][0]["judged_from_m"]
    parts = []
    if len(order) > 1:
        parts.append(f"Of the readings `{order[0]}` comes closest to the bounds of the {stage} stage.")
    for name in order:
        entries = judged[name]
        parts.append(_span(name, entries))
        parts.append(_reach(name, entries, stage, "holds_from_m", f"At {AT}"))
        parts.append(_reach(name, entries, stage, "holds_from_m_at_68", f"At {LEVELS[0]:g} %"))
    if not any(all(e["holds"] for e in entries) for entries in judged.values()):
        parts.append(f"With the noise as stated no reading meets all bounds from {figure(begin)} m on.")
    parts.append(_needed(judged))
    return " ".join(part for part in parts if part)


def _excess(entry: Entry) -> float:
    """p95 over the bound at the first listed range at which there is one."""
    rows = [row["p95"] for row in entry["listed"] if row["count"] > 0]
    if not rows:
        return float("inf")
    return float("inf") if rows[0] is None else float(rows[0] / entry["bound"])


def _reach(reading: str, entries: Sequence[Entry], stage: str, key: str, level: str) -> str:
    never = [e["quantity"] for e in entries if e[key] is None]
    known = [e for e in entries if e[key] is not None]
    begin = entries[0]["judged_from_m"]
    if not never and all(e[key] >= begin - 1e-6 for e in known):
        return f"{level} all bounds hold with `{reading}` over the whole stage, from {figure(begin)} m on."
    text = f"{level} with `{reading}`"
    if not never:
        last = min(known, key=lambda e: e[key])
        first = max(known, key=lambda e: e[key])
        return (
            f"{text} all bounds hold from {figure(last[key])} m on; the first to hold is {first['quantity']}, from"
            f" {figure(first[key])} m, the last {last['quantity']}."
        )
    holding = [
        f"{e['quantity']} {'throughout' if e[key] >= begin - 1e-6 else f'from {figure(e[key])} m on'}" for e in known
    ]
    failing = f"{listed(never)} {'do' if len(never) > 1 else 'does'} not hold at the end of the {stage} stage"
    return f"{text} {failing}{'; ' + listed(holding) + (' does' if len(known) == 1 else ' do') if known else ''}."


def _span(reading: str, entries: Sequence[Entry]) -> str:
    """How far off the bounds are at the first listed range."""
    ratios = [(e, _excess(e)) for e in entries]
    if any(ratio == float("inf") for _, ratio in ratios):
        return ""
    best, worst = min(ratios, key=lambda pair: pair[1]), max(ratios, key=lambda pair: pair[1])
    place = next(row["range_m"] for row in worst[0]["listed"] if row["count"] > 0)
    return (
        f"At {figure(place)} m the {LEVEL:g}th percentile is {figure(best[1])} ({best[0]['quantity']}) to"
        f" {figure(worst[1])} ({worst[0]['quantity']}) times the bound with `{reading}`."
    )


def _needed(judged: Mapping[str, Sequence[Entry]]) -> str:
    """The line precision at which all of them would hold."""
    words = []
    for reading, entries in judged.items():
        needed = [e for e in entries if e["precision"] is not None]
        if len(needed) < len(entries):
            continue
        if reading == "endpoints":
            worst = min(needed, key=lambda e: e["precision"]["noise_px"])
            what = f"{figure(worst['precision']['noise_px'])} px at each end of a line (`endpoints`)"
        else:
            worst = min(needed, key=lambda e: e["precision"]["spacing_px"])
            counts = [n for n in worst["precision"]["points"].values() if n]
            what = f"points {figure(worst['precision']['spacing_px'])} px apart (`edge-points`)"
            what += f", that is {' and '.join(map(str, sorted({min(counts), max(counts)})))} on the lines"
        words.append(f"{what}, because of {worst['quantity']}")
    if not words:
        return ""
    return f"For every bound to hold over the whole stage it would take {'; or '.join(words)}."


def meeting(verdict: Verdict) -> str:
    """Why a bound of an angle and one of a position meet at a range."""
    found = [m for m in verdict["meeting"] if m["stage"] == "early"]
    if not found:
        return ""
    parts = []
    for m in found:
        parts.append(
            f"{m['angle'].capitalize()} and {m['position']}: an error of the {m['angle']} alone turns the runway about"
            f" the camera and moves the {m['position']} estimate by range times angle, so that bounds of"
            f" {with_unit(m['angle_bound_deg'], 'deg')} and {with_unit(m['position_bound_m'], 'm')} ask the same at"
            f" {figure(m['position_bound_m'])} m / {with_unit(m['angle_bound_deg'], 'deg')} ="
            f" {figure(m['range_m'])} m. At {figure(m['first_range_m'])} m the {m['position']} bound alone asks for"
            f" {with_unit(m['angle_asked_deg'], 'deg')}."
        )
        tight = [
            f"{figure(one['range_m'])} m with `{one['reading']}`"
            for one in m["equally_tight"]
            if one["range_m"] is not None
        ]
        if tight:
            parts.append(f"By the {LEVEL:g}th percentiles both are equally tight at {listed(tight)}.")
    parts.append(_borne_out(verdict["proportions"]))
    return " ".join(part for part in parts if part)


def _borne_out(rows: Sequence[Mapping[str, Any]]) -> str:
    """Whether the errors go as range times angle."""
    parts = []
    for position, angle in (("cross", "yaw"), ("altitude", "pitch")):
        ratio, tied = f"{position}_over_range_times_{angle}", f"{position}_{angle}_correlation"
        known = [row for row in rows if row[ratio] is not None and row[tied] is not None]
        if not known:
            continue
        far, near = max(known, key=lambda row: row["range_m"]), min(known, key=lambda row: row["range_m"])
        low, high = min(row[ratio] for row in known), max(row[ratio] for row in known)
        parts.append(
            f"As drawn, {position} over {angle} is {figure(low)} to {figure(high)} times the range in either reading;"
            f" with `{far['reading']}` the {angle} error explains {_share(far[tied])} of the {position} error's"
            f" variance at {figure(far['range_m'])} m and {_share(near[tied])} at {figure(near['range_m'])} m."
        )
    parts.append(_roll_in_it(rows))
    return " ".join(part for part in parts if part)


def _share(correlation: float) -> str:
    return f"{figure(100.0 * correlation**2)} %"


def _roll_in_it(rows: Sequence[Mapping[str, Any]]) -> str:
    """What of the cross error, and of the yaw that goes with it, is roll."""
    known = [row for row in rows if None not in (row["cross_roll_correlation"], row["yaw_roll_correlation"])]
    if not known:
        return ""
    far = max(known, key=lambda row: row["range_m"])
    return (
        "What moves the cross estimate is the heading of the sight line to the threshold,"
        f" {figure(far['sight_line_down_deg'])}° below the horizon at {figure(far['range_m'])} m."
        " A roll error turns it by the sine of that angle, which over the range is the camera's height times the roll."
        f" The yaw shares it as far as the optical axis, {figure(far['optical_axis_down_deg'])}° down, lies near that"
        f" line. With `{far['reading']}` the roll error explains {_share(far['cross_roll_correlation'])} of the cross"
        f" error's variance there and {_share(far['yaw_roll_correlation'])} of the yaw's: a camera pitched otherwise"
        " has another yaw error and the same cross error."
    )


def roll(verdict: Verdict) -> str:
    """What a roll error does late."""
    limits = verdict["roll_limits"]
    shifts = [s for s in verdict["roll_shifts"] if s["measured_m"] is not None]
    parts = []
    if shifts:
        off = shifts[0]["roll_error_deg"]
        same = [s for s in shifts if s["roll_error_deg"] == off]
        high, low = max(same, key=lambda s: s["height_m"]), min(same, key=lambda s: s["height_m"])
        apart = max(abs(s["measured_m"] - s["formula_m"]) / abs(s["formula_m"]) for s in shifts)
        parts.append(
            "Late, a roll error δ turns the planes of both edges about the runway's axis and moves the cross estimate"
            f" by (h + L²/(4h)) δ at a camera height h: {with_unit(off, 'deg')} costs"
            f" {figure(abs(high['measured_m']))} m at {figure(high['height_m'])} m and"
            f" {figure(abs(low['measured_m']))} m at {figure(low['height_m'])} m (the solver on lines without noise;"
            f" the formula is within {figure(100.0 * apart)} % of it)."
        )
    for reading in READINGS:
        own = [x for x in limits if x["reading"] == reading]
        if own:
            parts.append(_limits(reading, own))
    return " ".join(parts)


def _limits(reading: str, limits: Sequence[Mapping[str, Any]]) -> str:
    none = [x["quantity"] for x in limits if x["roll_error_deg"] is None]
    some = sorted((x for x in limits if x["roll_error_deg"] is not None), key=lambda x: x["roll_error_deg"])
    words = []
    if some:
        stated = [
            f"{x['quantity']} ({with_unit(x['bound'], x['unit'])}) {'beyond' if x['holds_beyond'] else 'up to'}"
            f" {with_unit(x['roll_error_deg'], 'deg')}"
            for x in some
        ]
        words.append(
            f"the bounds hold at {AT} to the end of the stage with a roll error of either sign: {listed(stated)}"
        )
    if none:
        words.append(f"{listed(none)} {'do' if len(none) > 1 else 'does'} not hold even with the true roll")
    parts = [f"With `{reading}` {'; '.join(words)}."]
    without = [x for x in some if x["limited_by"] == "no solution"]
    if without:
        heights = sorted({with_unit(x["at_height_m"], "m") for x in without})
        names = listed([x["quantity"] for x in without]).capitalize()
        parts.append(
            f"{names} {'are' if len(without) > 1 else 'is'} limited by no solution: beyond that, most of the draws that"
            f" do not keep the bound are two lines without one, at a camera height of {listed(heights)}."
        )
    off = [
        abs(x["p95_over_bound"] - 1.0) for x in some if x["limited_by"] == "bound" and x["p95_over_bound"] is not None
    ]
    if off:
        parts.append(f"Sampled there, the {LEVEL:g}th percentile is within {figure(100.0 * max(off))} % of the bound.")
    doubtful = [x["quantity"] for x in some if not x["confirmed"]]
    if doubtful:
        parts.append(f"Independent draws do not confirm it for {listed(doubtful)}.")
    return " ".join(parts)


def fused(verdict: Verdict) -> str:
    """Where the fused errors come from."""
    flights = verdict["flights"]
    if not flights:
        return (
            "There were no flights, so that nothing is said of the fused solution."
            if verdict["method"] == "sampling"
            else ""
        )
    parts = []
    for reading, f in flights.items():
        ends = listed([f"{number} {outcome}" for outcome, number in f["outcomes"].items()])
        text = (
            f"With `{reading}` the fused errors are those of {f['flights']} flight{'' if f['flights'] == 1 else 's'} in"
            f" JSBSim, seeds {f['first_seed']} to {f['last_seed']} ({ends})."
        )
        if f["fused_in_all_from_m"] is not None:
            text += (
                f" The filter starts from the first frames' poses and runs in every flight from"
                f" {figure(f['fused_in_all_from_m'])} m on, from where it is judged."
            )
        if f["late_roll"]:
            worst = max(f["late_roll"], key=lambda at: at["p95_deg"])
            text += (
                f" The roll angle that it lends to the late stage is off by at most"
                f" {with_unit(worst['p95_deg'], 'deg')} in {AT} of the flights at each of the listed ranges (most at"
                f" {figure(worst['range_m'])} m)"
                f"{_borne(verdict, reading)}."
            )
        parts.append(text)
        for stage in OF_STAGE:
            judged = [e for e in find(verdict, stage, reading, "fused") if e["holds"] is not None]
            if judged:
                parts.append(_reach(reading, judged, stage, "holds_from_m", f"Fused, {stage}, at {AT}"))
    return " ".join(parts)


def _borne(verdict: Verdict, reading: str) -> str:
    """What roll error the bound that bears least of it would bear, if all hold with the true roll."""
    limits = [x for x in verdict["roll_limits"] if x["reading"] == reading]
    if not limits or any(x["roll_error_deg"] is None for x in limits):
        return ""
    least = min(limits, key=lambda x: x["roll_error_deg"])
    bears = f"{'more than ' if least['holds_beyond'] else ''}{with_unit(least['roll_error_deg'], 'deg')}"
    return f", where the bound of {least['quantity']} bears {bears}"
