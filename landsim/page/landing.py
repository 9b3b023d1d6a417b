"""Sections on how often a batch landed, where and how well."""

from collections.abc import Mapping, Sequence
from typing import Any

from landsim.charts.shared import number, percent, unit_of, with_unit
from landsim.page.document import Block, Charts, Table, Text, figures_of
from landsim.page.sentences import DASH, interval, rate_row


def outcomes_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """How the flights ended, and which limits they missed."""
    rates = summary["rates"]
    figures = figures_of(charts["outcomes"], "There is no flight.")
    if rates["success"]["rate"] is None:
        return figures
    percentage = f"{100.0 * rates['confidence']:g} % interval"
    ended = (
        rate_row("landed in the box", rates["success"]),
        *(rate_row(one["outcome"].replace("_", " "), one) for one in rates["outcomes"]),
    )
    limits = tuple(
        (
            one["title"],
            f"{'at most' if one['side'] == 'above' else 'at least'} {with_unit(one['limit'], one['unit'])}",
            *rate_row("", one)[1:],
        )
        for one in rates["limits"]
    )
    return (
        *figures,
        Table(
            f"How the flights ended; intervals: {rates['interval']}",
            ("outcome", "flights", "of", "rate", percentage),
            ended,
        ),
        Table(
            "How many flights missed each limit of the scenario's box, of those that touched down or stopped",
            ("limit on", "limit", "missed", "of", "rate", percentage),
            limits,
            words=frozenset({1}),
        ),
    )


def touchdown_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """Where they touched down."""
    found = summary["touchdown"]
    blocks: list[Block] = [*figures_of(charts["touchdown"], "No flight touched down."), Text(tuple(found["text"]))]
    drawn = [one for one in found["ellipses"] if one["center"] is not None]
    if drawn:
        rows = tuple(
            (
                f"{one['level']:g} %",
                f"{number(one['center']['x_m'], 5)}, {number(one['center']['y_m'])}",
                number(one["semi_major_m"]),
                number(one["semi_minor_m"]),
                f"{number(one['angle_deg'])}°",
                percent(one["inside"]["rate"]),
                interval(one["inside"]),
            )
            for one in drawn
        )
        head = ("ellipse", "centre along, cross, m", "semi-major, m", "semi-minor, m", "towards the right",
                "touchdowns inside", "95 % interval")  # fmt: skip
        blocks.append(Table("Ellipses, and how many of these touchdowns they hold", head, rows))
    return tuple(blocks)


def distributions_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """How well they did, in quantiles."""
    entries = summary["distributions"]
    blocks = list(figures_of(charts["distributions"], "No flight touched down: there is no distribution."))
    if entries:
        levels = [q["p"] for q in entries[0]["quantiles"]]
        rows = []
        for entry in entries:
            row = [
                f"{entry['title']}, {unit_of(entry['unit'])}",
                str(entry["n"]),
                number(entry["mean"], 4),
                number(entry["std"]),
            ]
            row += [number(q["value"], 4) for q in entry["quantiles"]]
            rows.append((*row, number(entry["min"], 4), number(entry["max"], 4)))
        quantiles = tuple(f"{100.0 * p:g} %" for p in levels)
        blocks.append(
            Table("Quantiles over the flights", ("", "flights", "mean", "σ", *quantiles, "least", "most"), tuple(rows))
        )
        blocks.append(_tails(entries))
    return tuple(blocks)


def _tails(entries: Sequence[Mapping[str, Any]]) -> Table:
    """The outer quantiles with their intervals: of the magnitude, where the sign does not count."""
    rows = []
    for entry in entries:
        chosen = entry["magnitude_quantiles"] or entry["quantiles"]
        title = f"|{entry['title']}|" if entry["magnitude_quantiles"] else entry["title"]
        rows += [
            (
                f"{title}, {unit_of(entry['unit'])}",
                f"{100.0 * q['p']:g} %",
                number(q["value"], 4),
                _interval(q),
            )
            for q in chosen
            if q["p"] in {0.95, 0.99}
        ]
    caption = "Tails with distribution-free 95 % intervals; a dash: the sample does not reach so far"
    return Table(caption, ("", "quantile", "value", "interval"), tuple(rows))


def _interval(quantile: Mapping[str, Any]) -> str:
    """Of a quantile; the end that the sample does not reach is a dash."""
    low, high = quantile["low"], quantile["high"]
    return DASH if low is None and high is None else f"{number(low, 4)} to {number(high, 4)}"


def tracking_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """How near they kept to the approach."""
    blocks = list(figures_of(charts["tracking"], "No flight has an approach to follow."))
    rows = []
    for entry in summary["tracking"]:
        for of, name in (("rms", "root mean square"), ("p95", "95 % within")):
            by_level = {q["p"]: number(q["value"]) for q in entry[of]["quantiles"]}
            rows.append(
                (entry["title"], name, str(entry[of]["n"]), *(by_level.get(p, DASH) for p in (0.5, 0.95, 0.99)))
            )
    head = ("deviation, m", "of a flight", "flights", "median", "95 %", "99 %")
    blocks.append(Table("Deviations over the flights", head, tuple(rows), words=frozenset({1})))
    criteria = tuple(
        (
            entry["title"],
            f"{'≈ ' if one['estimate'] else ''}{with_unit(one['limit'], 'm')}",
            percent(one["kept"]["rate"]),
            interval(one["kept"]),
            f"{one['text']}. {one['source']}",
        )
        for entry in summary["tracking"]
        for one in entry["criteria"]
    )
    if criteria:
        columns = ("deviation", "criterion", "flights within", "95 % interval", "where it is from")
        blocks.append(Table("Published criteria, for comparison", columns, criteria, words=frozenset({4})))
    return tuple(blocks)
