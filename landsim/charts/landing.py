"""How often a batch landed, where, and how well: charts of the summary's rates, touchdown, distributions, tracking."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from landsim.charts.model import (
    Axis,
    Chart,
    Curve,
    Dash,
    Histogram,
    Limit,
    Mark,
    Numbers,
    Panel,
    Points,
    Region,
    Series,
    Tone,
)
from landsim.charts.shared import (
    PERCENT,
    beyond,
    floor_of,
    limits_near,
    number,
    percent,
    rates,
    several,
    share_floor,
    there,
    times,
    unit_of,
    with_unit,
)

ELLIPSES: Mapping[float, tuple[Dash, float]] = {50.0: ("solid", 1.0), 95.0: ("dash", 1.2), 99.7: ("dot", 1.5)}
"""Dash and width of an ellipse."""
FIRST = ("sink_rate_mps", "y_m", "x_m", "bank_deg", "ground_speed_mps")
"""Measures that stand in the first chart of distributions; the others are in a second."""
NONE_MISSED = "a bar without a point: no flight was beyond it"
NO_LIMIT_MISSED = " No flight was beyond a limit of the box."
FARTHEST = 250.0
"""Of a limit's use no more is drawn, %: one flight beside the runway would leave no room for the others."""
SHORT = 60.0
"""Of the approach before the threshold this much is drawn with the runway, m."""
BANDED = "; the tint is the 95 % confidence of the share, and where no flight is left it says what so many still allow"


def margin_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """How much of each limit the flights used: of the box, and of the tracking criteria."""
    found = summary["verdict"]
    entries = [one for one in (*found["limits"], *found["tracking"]) if one["n"]]
    if not entries:
        return ()
    names = tuple(
        f"{one['title']} {'>' if one['side'] == 'above' else '<'} {with_unit(one['limit'], one['unit'])}"
        for one in entries
    )
    rows = tuple(range(len(entries)))
    hover = tuple(
        f"worst {with_unit(one['worst'], one['unit'])}, limit {with_unit(one['limit'], one['unit'])}" for one in entries
    )

    def at(level: float) -> Numbers:
        by_level = ({q["p"]: q["value"] for q in one["used"]["quantiles"]} for one in entries)
        return _near(times((values.get(level) for values in by_level), PERCENT))

    worst = times((one["used"]["worst"] for one in entries), PERCENT)
    series: list[Series] = []
    if there(median := at(0.5)):
        bar = (at(0.05), at(0.95)) if there(at(0.95)) else None
        name = "median, and from 5 % to 95 % of the flights" if bar else "median"
        series.append(Points(name, _within(median), rows, "blue", size=5.0, x_bar=bar, bar_width=3.0))
    if there(_within(at(0.99))):
        series.append(Points("99 % quantile", _within(at(0.99)), rows, "blue", "ring", 6.0))
    far = tuple(value is not None and value > FARTHEST for value in worst)
    looks: tuple[tuple[str, bool, Mark], ...] = (
        ("worst flight", False, "cross"),
        (f"worst flight, beyond {FARTHEST:g} %", True, "triangle"),
    )
    for name, farther, mark in looks:
        chosen = [row for row in rows if far[row] is farther]
        if chosen:
            x, told = _near(worst[row] for row in chosen), tuple(hover[row] for row in chosen)
            series.append(Points(name, x, tuple(chosen), "vermilion", mark, 5.0, told))
    most = max(value for value in worst if value is not None)
    panel = Panel(
        Axis("used of the limit", "%", span=(-3.0, min(max(110.0, 1.05 * most), 1.03 * FARTHEST))),
        Axis("", ticks=names),
        tuple(series),
        (Limit("x", PERCENT, "limit"),),
        height=0.2 + 0.12 * len(entries),
    )
    caption = (
        "100 % is at the limit, more is beyond it. The longitudinal touchdown uses nothing of either limit in the"
        " middle of the box. The tracking criteria are published ones, the other limits the scenario's."
    )
    return (Chart("margins", "How much of each limit was used", (panel,), 1, caption),)


def _near(values: Iterable[float | None]) -> Numbers:
    """Shares (%) that are beyond an end of the axis at that end."""
    return tuple(None if value is None else min(max(value, 0.0), FARTHEST) for value in values)


def _within(values: Numbers) -> Numbers:
    """Without those at the far end, where the worst one stands for them."""
    return tuple(None if value == FARTHEST else value for value in values)


def rate_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Success and outcomes with their intervals, and how often each limit was missed."""
    found = summary["rates"]
    rows: list[tuple[str, Mapping[str, Any]]] = [("landed in the box", found["success"]), ("landed", found["landed"])]
    rows += [
        (one["outcome"].replace("_", " "), one)
        for one in found["outcomes"]
        if one["count"] and one["outcome"] != "landed"
    ]
    rows = [(name, entry) for name, entry in rows if entry["rate"] is not None]
    if not rows:
        return ()
    names, entries = tuple(name for name, _ in rows), [entry for _, entry in rows]
    outcome = Panel(
        Axis("share of the flights", "%", span=(-2.0, 102.0)),
        Axis("", ticks=names),
        (rates("rate", entries, range(len(rows)), "blue"),),
        title="how the flights ended",
        height=0.16 + 0.12 * len(rows),
    )
    panels = [outcome]
    limits = [one for one in found["limits"] if one["rate"] is not None]
    missed = any(one["count"] for one in limits)
    if missed:
        floor = floor_of(limits)
        labels = tuple(
            f"{one['title']} {'>' if one['side'] == 'above' else '<'} {with_unit(one['limit'], one['unit'])}"
            for one in limits
        )
        panels.append(
            Panel(
                Axis("share of the flights beyond it", "%", log=True, span=(floor, 130.0)),
                Axis("", ticks=labels),
                _missed(limits, floor),
                title=f"limits of the box that were missed; {NONE_MISSED}",
                height=0.16 + 0.12 * len(limits),
            )
        )
    caption = (
        f"{percent(found['success']['rate'])} of {found['success']['n']} flights landed in the box. The bars are"
        " two-sided Clopper–Pearson intervals with 95 % confidence."
    )
    if limits and not missed:
        most = percent(max(one["high"] for one in limits))
        caption += f"{NO_LIMIT_MISSED} So many flights still allow up to {most} of all to be beyond any one of them."
    return (Chart("rates", "Success, outcomes and missed limits", tuple(panels), 1, caption),)


def _missed(limits: Sequence[Mapping[str, Any]], floor: float) -> tuple[Points, ...]:
    """Those that some flight missed, and paler those that none did, of which there is an upper end alone."""
    looks: tuple[tuple[bool, str, Tone], ...] = (
        (True, "missed by some, with its 95 % interval", "vermilion"),
        (False, "missed by none: what so many flights still allow", "grey"),
    )
    found = []
    for some, name, tone in looks:
        rows = [row for row, one in enumerate(limits) if bool(one["count"]) is some]
        if rows:
            bars = rates(name, [limits[row] for row in rows], rows, tone, floor)
            found.append(bars if some else replace(bars, mark="none"))
    return tuple(found)


def touchdown_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Touchdowns on the runway as drawn, and closer."""
    found = summary["touchdown"]
    if not found["n"]:
        return ()
    points = _points(found)
    ellipses = tuple(
        Curve(
            f"{one['level']:g} % ellipse", tuple(one["polygon"]["x_m"]), tuple(one["polygon"]["y_m"]), "ink",
            *ELLIPSES.get(one["level"], ("dashdot", 1.0)),
        )
        for one in found["ellipses"]
        if one["center"] is not None
    )  # fmt: skip
    box, runway = found["box"], found["runway"]
    half, cross = 0.5 * runway["width_m"], box["cross_max_m"]
    farthest = max([box["along_max_m"], found["aim_point_m"], *found["points"]["x_m"]])
    nearest = min([-SHORT, *(x - SHORT for x in found["points"]["x_m"])])
    widest = max([half, cross, *(abs(y) for y in found["points"]["y_m"])])
    end = min(farthest * 1.12 + SHORT, max(runway["length_m"] + SHORT, farthest + SHORT))
    along, across = "past the threshold", "right of the centreline"
    boxed = f"box: {number(box['along_min_m'])} to {number(box['along_max_m'])} m, ±{number(cross)} m"
    whole = Panel(
        Axis(along, "m", span=(nearest, end)),
        Axis(across, "m", span=(-1.15 * widest, 1.15 * widest)),
        (Curve("", (0.0, runway["length_m"]), (0.0, 0.0), "grey", "dash", 0.8, legend=False), *points),
        (
            Region((0.0, runway["length_m"]), (-half, half), "", "pale", 0.35),
            Region((box["along_min_m"], box["along_max_m"]), (-cross, cross), boxed, "green"),
            Limit("x", 0.0, "threshold", "grey", "solid"),
            Limit("x", found["aim_point_m"], "aim point", "grey", "dot"),
        ),
        title="on the runway; scales differ",
    )
    x_span, y_span = _close(found, "x"), _close(found, "y")
    edges = [
        *(Limit("x", box[key], f"box: {number(box[key])} m") for key in ("along_min_m", "along_max_m")),
        *(Limit("y", side, f"box: {number(side)} m") for side in (-cross, cross)),
        Limit("y", 0.0, "", "grey", "dash"),
    ]
    spans = {"x": x_span, "y": y_span}
    seen = tuple(one for one in edges if spans[one.along][0] < one.at < spans[one.along][1])
    close = Panel(
        Axis(along, "m", span=x_span),
        Axis(across, "m", span=y_span),
        (*points, *ellipses),
        seen,
        title="closer: the touchdowns and the ellipses alone" if ellipses else "closer: the touchdowns alone",
        height=1.4,
    )
    caption = "Midpoint of the main wheels at first contact."
    if ellipses:
        caption += " An ellipse holds the next touchdown with its probability, if touchdowns are normally distributed."
    caption += f" Drawn: {found['points_rule']}."
    panels = (whole, close) if found["n"] > 1 else (whole,)  # of one there is nothing to see closer
    return (Chart("touchdown", f"Where {several(found['n'], 'flight')} touched down", panels, 1, caption),)


def _points(found: Mapping[str, Any]) -> tuple[Points, ...]:
    """Touchdowns in the box, and those of flights that missed it."""
    p = found["points"]
    series = []
    looks: tuple[tuple[str, bool, Tone, Mark], ...] = (
        ("in the box", True, "blue", "dot"),
        ("not in the box", False, "vermilion", "cross"),
    )
    for name, inside, tone, mark in looks:
        rows = [i for i, one in enumerate(p["in_box"]) if bool(one) is inside]
        if rows:
            hover = tuple(
                f"flight {p['index'][i]}, seed {p['seed'][i]}\n{p['outcome'][i]}\nsink rate: "
                f"{with_unit(p['sink_rate_mps'][i], 'm/s')}"
                for i in rows
            )
            x, y = (tuple(p[key][i] for i in rows) for key in ("x_m", "y_m"))
            size = 4.5 if mark == "cross" else 3.5 if len(p["x_m"]) <= 300 else 2.2
            series.append(Points(name, x, y, tone, mark, size, hover))
    return tuple(series)


def _close(found: Mapping[str, Any], letter: str) -> tuple[float, float]:
    """What the touchdowns and the ellipses span, and a margin."""
    values = list(found["points"][f"{letter}_m"])
    values += [v for one in found["ellipses"] if one["center"] is not None for v in one["polygon"][f"{letter}_m"]]
    low, high = min(values), max(values)
    margin = 0.08 * (high - low) or 1.0
    return low - margin, high + margin


def distribution_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """A histogram and the share beyond on a logarithmic scale, a row a measure."""
    entries = summary["distributions"]
    first = [entry for key in FIRST for entry in entries if entry["key"] == key]
    others = [entry for entry in entries if entry["key"] not in FIRST]
    charts = []
    for name, title, chosen in (
        ("distributions", "Distributions at touchdown, and how many flights go beyond a value", first),
        ("distributions-more", "Attitude at touchdown and the stop, and how many flights go beyond a value", others),
    ):
        if chosen:
            panels = tuple(panel for entry in chosen for panel in (_histogram(entry), _beyond(entry)))
            charts.append(Chart(name, title, panels, 2, f"Left: flights a bin. Right: share of the flights{BANDED}."))
    return tuple(charts)


def _limits(entry: Mapping[str, Any]) -> list[tuple[float, str]]:
    """Limits of a measure with their labels; of a magnitude to either side."""
    found = []
    for limit in entry["limits"]:
        signs = (-1.0, 1.0) if limit["magnitude"] else (1.0,)
        found += [(sign * limit["value"], with_unit(sign * limit["value"], entry["unit"])) for sign in signs]
    return found


def _histogram(entry: Mapping[str, Any]) -> Panel:
    edges, counts = entry["histogram"]["edges"], entry["histogram"]["counts"]
    span = (edges[0], edges[-1])
    shown: Series = Histogram("flights", tuple(edges), tuple(counts), legend=False)
    if entry["min"] == entry["max"]:  # a bar would be as wide as one likes
        span, n = (entry["min"], entry["max"]), entry["n"]
        shown = Points("flights", (entry["min"],), (n,), size=4.5, y_bar=((0,), (n,)), bar_width=1.4, legend=False)
    near, far = limits_near(_limits(entry), span)
    median = next((q["value"] for q in entry["quantiles"] if q["p"] == 0.5), None)
    middle = () if median is None else (Limit("x", median, "median", "ink", "dot"),)
    return Panel(
        Axis(entry["title"], unit_of(entry["unit"])),
        Axis("flights", whole=True),
        (shown,),
        (*middle, *near),
        title=far,
    )


def _beyond(entry: Mapping[str, Any]) -> Panel:
    curves = entry["exceedance"]
    floor = share_floor(curves)
    missed = {limit["side"]: limit["missed"] for limit in entry["limits"]}
    one = len(curves) == 1
    looks: Mapping[str, tuple[Tone, Dash]] = {"above": ("blue", "solid"), "below": ("vermilion", "dash")}
    series: list[Series] = []
    for curve in curves:
        side = curve["side"]
        series += beyond(f"at x or {side}", curve, missed.get(side), curve["limit"], floor, *looks[side])
    title = f"|{entry['title']}|" if curves and curves[0]["magnitude"] else entry["title"]
    limits = tuple(
        Limit("x", curve["limit"], f"limit {with_unit(curve['limit'], entry['unit'])}")
        for curve in curves
        if curve["limit"] is not None
    )
    label = "share at x or above" if one else "share at x or beyond"
    return Panel(
        Axis(title, unit_of(entry["unit"])),
        Axis(label, "%", log=True, span=(floor, 160.0)),
        tuple(series),
        limits,
    )


def tracking_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Each flight's 95th percentile of the deviation, beside the published criteria."""
    panels = [_tracking(entry) for entry in summary["tracking"] if entry["p95"]["histogram"] is not None]
    if not panels:
        return ()
    caption = (
        "Each flight gives one number: the deviation that 95 % of its approach stays within, from 1000 m before the"
        " threshold. The limits are published ones for transport aircraft, from secondary sources; to meet one"
        " certifies nothing."
    )
    return (
        Chart("tracking", "How near the flights kept to the glide slope and the centreline", tuple(panels), 3, caption),
    )


def _tracking(entry: Mapping[str, Any]) -> Panel:
    shape = entry["p95"]["histogram"]
    criteria = tuple(
        Limit("x", one["limit"], f"criterion {'≈ ' if one['estimate'] else ''}{with_unit(one['limit'], 'm')}")
        for one in entry["criteria"]
    )
    bins = Histogram("flights", tuple(shape["edges"]), tuple(shape["counts"]), legend=False)
    return Panel(
        Axis("95 % of the approach within", "m"), Axis("flights", whole=True), (bins,), criteria, entry["title"]
    )
