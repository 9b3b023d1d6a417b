"""The section that says what the landings come to."""

from collections.abc import Mapping, Sequence
from typing import Any

from landsim.charts.shared import number, percent, with_unit
from landsim.page.document import Block, Charts, Table, Text, figures_of
from landsim.page.sentences import DASH, interval, rate_row

STATES = {"kept": "no more than stated", "more": "more than stated", "open": "open: too few flights"}


def verdict_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """The verdict in sentences, the room to each limit, what went wrong unwarned, and navigation's word."""
    found = summary["verdict"]
    lead, *others = found["text"]
    blocks: list[Block] = [Text((lead,), lead=True), Text(tuple(others), points=True)]
    if not found["outcomes"][0]["n"]:
        return tuple(blocks)
    blocks += figures_of(charts["verdict"], "No flight touched down: there is no margin to draw.")
    percentage = f"{100.0 * found['confidence']:g} % interval"
    blocks += _limits(found, percentage)
    blocks.append(
        Table(
            "How the flights ended, and whether an alarm stood below the decision height",
            ("outcome", "flights", "of", "rate", percentage),
            tuple(rate_row(one["title"], one) for one in found["outcomes"]),
        )
    )
    if found["go_arounds"]:
        blocks.append(
            Table(
                "Why they went around",
                ("reason", "flights", "of", "rate", percentage),
                tuple(rate_row(one["reason"] or DASH, one) for one in found["go_arounds"]),
            )
        )
    blocks.append(_protection(found["protection"]))
    if found["faults"]["monitored"]:
        blocks.append(_faults(found["faults"], percentage))
    return tuple(blocks)


def _limits(found: Mapping[str, Any], percentage: str) -> list[Block]:
    entries: Sequence[Mapping[str, Any]] = [*found["limits"], *found["tracking"]]
    beyond = tuple(
        (_title(one), _limit(one), *rate_row("", one)[1:], percent(one["below"]), _asked(one)) for one in entries
    )
    room = tuple((_title(one), _limit(one), *_room(one)) for one in entries)
    criteria = [one["criterion"] for one in found["limits"] if one["criterion"]]
    standing = "; ".join(dict.fromkeys(f"{one['text']} (below {number(one['rate'])})" for one in criteria))
    notes = (
        f"In place of the box the standards have: {standing}. {criteria[0]['source']}.",
        "The approach is counted from 1000 m before the threshold, with what the start was off by.",
    )
    return [
        Table(
            "How many flights were beyond each limit of the scenario's box, and beyond the tracking criteria in 95 % of"
            " their approach",
            ("limit on", "limit", "beyond", "of", "rate", percentage, "so many show below", "standards ask below"),
            beyond,
            words=frozenset({1}),
        ),
        Text(notes),
        Table(
            "The room to each limit: what is left of it at the 99 % quantile, which takes 100 flights, and in the worst"
            " flight; negative beyond it",
            ("limit on", "limit", "99 % quantile", percentage, "margin", "worst", "margin of the worst"),
            room,
            words=frozenset({1}),
        ),
    ]


def _title(one: Mapping[str, Any]) -> str:
    return str(one["title"])


def _limit(one: Mapping[str, Any]) -> str:
    about = "≈ " if one.get("estimate") else ""
    return f"{'at most' if one['side'] == 'above' else 'at least'} {about}{with_unit(one['limit'], one['unit'])}"


def _asked(one: Mapping[str, Any]) -> str:
    return DASH if one["criterion"] is None else number(one["criterion"]["rate"])


def _room(one: Mapping[str, Any]) -> tuple[str, ...]:
    unit, quantile = one["unit"], one["quantile"] or {"value": None, "low": None, "high": None}
    low, high = quantile["low"], quantile["high"]
    between = DASH if low is None and high is None else f"{number(low)} to {number(high)}"
    room = (with_unit(one[key], unit) for key in ("margin", "worst", "margin_of_worst"))
    return with_unit(quantile["value"], unit), between, *room


def _protection(found: Mapping[str, Any]) -> Table:
    rows = tuple(
        (
            one["name"],
            f"{one['exceeded_frames']:,}",
            f"{one['frames']:,}",
            percent(one["share"]),
            interval(one),
            DASH if one["state"] is None else STATES[one["state"]],
            f"{one['flights']['count']} of {one['flights']['n']}",
            interval(one["flights"]),
            with_unit(one["last_m"], "m"),
        )
        for one in found["levels"]
    )
    head = ("error", "frames beyond", "of", "share", "interval over flights", "against the risk", "flights with any",
            "95 % interval", "last level, median")  # fmt: skip
    caption = (
        "Errors of the camera's position beyond the protection level that navigation stated, in the air;"
        f" the risk is {percent(found['risk'])}"
    )
    return Table(caption, head, rows, words=frozenset({5}))


def _faults(found: Mapping[str, Any], percentage: str) -> Table:
    within = f"{found['within_s']:g} s"
    rows = (
        rate_row(f"a wrong line in view, found within {within}", found["detected"]),
        rate_row("a wrong line in view, found at all", found["detected_ever"]),
        rate_row("a false alarm in a flight without a fault", found["false_alarms"]),
    )
    times = ""
    if found["median_s"] is not None:
        median, longest = (with_unit(found[key], "s") for key in ("median_s", "longest_s"))
        times = f"; found after {median} (median), {longest} at most"
    return Table(f"Alarms{times}", ("", "flights", "of", "rate", percentage), rows)
