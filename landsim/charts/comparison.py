"""Charts of batches side by side, from their comparison alone: what is drawn stands in compare.json."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from landsim.batch.sections.words import flights_for
from landsim.charts.landing import FIRST, NO_LIMIT_MISSED, NONE_MISSED
from landsim.charts.model import Axis, Chart, Curve, Dash, Histogram, Limit, Panel, Points, Series, Tone
from landsim.charts.navigation import GROUPS, bounds_of, error_span
from landsim.charts.shared import (
    QUANTITIES,
    SOURCES,
    beyond,
    distance_axis,
    floor_of,
    flown,
    limits_near,
    number,
    rates,
    share_floor,
    there,
    unit_of,
    with_unit,
)

LOOKS: tuple[tuple[Tone, Dash], ...] = (
    ("blue", "solid"), ("vermilion", "dash"), ("orange", "dashdot"), ("purple", "dot"), ("sky", "dash"), ("ink", "dot")
)  # fmt: skip
"""Of the batches, in their order; after the last the first again."""


def comparison_charts(compared: Mapping[str, Any]) -> dict[str, tuple[Chart, ...]]:
    """Every chart of a comparison, by section of its report.

    Parameters
    ----------
    compared : mapping
        Of ``landsim.batch.compare.compare``.

    Returns
    -------
    dict of str to tuple of Chart
        A section has none where there is nothing to show.
    """
    of = "; ".join(f"{one['name']} = {flown(one['scenario'], one['n'], one['seeds'])}" for one in compared["batches"])
    sections = {
        "outcomes": _rates(compared),
        "differences": _differences(compared),
        "distributions": _distributions(compared),
        "navigation": _envelopes(compared),
    }
    return {section: tuple(replace(chart, subtitle=of) for chart in charts) for section, charts in sections.items()}


def _look(compared: Mapping[str, Any], name: str) -> tuple[Tone, Dash]:
    return LOOKS[[one["name"] for one in compared["batches"]].index(name) % len(LOOKS)]


def _rates(compared: Mapping[str, Any]) -> tuple[Chart, ...]:
    batches = [one for one in compared["batches"] if one["n"]]
    if not batches:
        return ()
    step = 0.5 / len(batches)
    offsets = [(k - 0.5 * (len(batches) - 1)) * step for k in range(len(batches))]
    ended = Panel(
        Axis("share of the flights", "%", span=(-2.0, 102.0)),
        Axis("", ticks=("landed in the box", "landed")),
        tuple(
            rates(one["name"], [one["success"], one["landed"]], [offset, 1.0 + offset], _look(compared, one["name"])[0])
            for one, offset in zip(batches, offsets, strict=True)
        ),
        title="success",
        height=0.25 + 0.12 * len(batches),
    )
    panels = [ended]
    keys = list(dict.fromkeys(limit["key"] for one in batches for limit in one["limits"] if limit["rate"] is not None))
    if any(limit["count"] for one in batches for limit in one["limits"]):
        every = [limit for one in batches for limit in one["limits"] if limit["rate"] is not None]
        floor = floor_of(every)
        titles = {limit["key"]: limit["title"] for limit in every}
        series = []
        for one, offset in zip(batches, offsets, strict=True):
            own = [limit for limit in one["limits"] if limit["rate"] is not None]
            rows = [keys.index(limit["key"]) + offset for limit in own]
            series.append(rates(one["name"], own, rows, _look(compared, one["name"])[0], floor))
        names = tuple(f"{titles[key]} ({'least' if '_min_' in key else 'most'})" for key in keys)
        panels.append(
            Panel(
                Axis("share of the flights beyond it", "%", log=True, span=(floor, 130.0)),
                Axis("", ticks=names),
                tuple(series),
                title=f"limits of the box that were missed; {NONE_MISSED}",
                height=0.3 + 0.08 * len(keys) * max(len(batches), 2),
            )
        )
    return (
        Chart(
            "compare-rates", "Success and missed limits, side by side", tuple(panels), 1,
            "Each batch by itself; the bars are two-sided Clopper–Pearson intervals with 95 % confidence."
            + ("" if len(panels) > 1 else NO_LIMIT_MISSED),
        ),
    )  # fmt: skip


def _differences(compared: Mapping[str, Any]) -> tuple[Chart, ...]:
    pairs = compared["pairs"]
    metrics: dict[str, Mapping[str, Any]] = {m["key"]: m for pair in pairs for m in pair["metrics"] if m["n"]}
    if not metrics:
        return ()
    reference = pairs[0]["reference"]
    others = tuple(pair["other"] for pair in pairs)
    panels = []
    for key, metric in metrics.items():
        series: list[Series] = []
        for significant in (True, False):
            own = [
                (row, m)
                for row, pair in enumerate(pairs)
                for m in pair["metrics"]
                if m["key"] == key and m["shift"]["value"] is not None and bool(m["significant"]) is significant
            ]
            if own:
                series.append(_forest(own, metric["unit"], significant=significant))
        panels.append(
            Panel(
                Axis("difference", unit_of(metric["unit"])), Axis("", ticks=others), tuple(series),
                (Limit("x", 0.0, "", "grey", "dash"),), title=metric["title"], height=0.2 + 0.1 * len(others),
            )
        )  # fmt: skip
    caption = (
        f"Shift from {reference} over common seeds by Hodges and Lehmann, with the 95 % interval of Wilcoxon's signed"
        " ranks; filled where these, adjusted for their number, differ significantly from none: then the interval"
        " leaves zero out."
    )
    return (Chart("compare-differences", f"Differences from {reference}", tuple(panels), 3, caption),)


def _forest(own: Sequence[tuple[int, Mapping[str, Any]]], unit: str, *, significant: bool) -> Points:
    x = tuple(m["shift"]["value"] for _, m in own)
    low, high = (
        tuple(m["shift"]["value"] if m["shift"][end] is None else m["shift"][end] for _, m in own)
        for end in ("low", "high")
    )
    hover = tuple(
        f"shift {with_unit(m['shift']['value'], unit)}"
        f" ({number(m['shift']['low'])} to {number(m['shift']['high'])})\n"
        f"{m['n']} pairs, adjusted p {number(m['p_adjusted'])}"
        for _, m in own
    )
    name, tone = ("significant", "vermilion") if significant else ("not significant", "blue")
    rows = tuple(float(row) for row, _ in own)
    mark = "square" if significant else "ring"
    return Points(name, x, rows, tone, mark, 4.5, hover, (low, high), bar_width=1.4)  # type: ignore[arg-type]


def _distributions(compared: Mapping[str, Any]) -> tuple[Chart, ...]:
    entries = compared["distributions"]
    first = [entry for key in FIRST for entry in entries if entry["key"] == key]
    others = [entry for entry in entries if entry["key"] not in FIRST]
    charts = []
    banded = "; the tint is its 95 % confidence" if _banded(compared) else ""
    for name, title, chosen in (
        ("compare-distributions", "Distributions at touchdown, and how many flights go beyond a value", first),
        ("compare-distributions-more", "Attitude at touchdown and the stop, and how many go beyond a value", others),
    ):
        if chosen:
            panels = tuple(
                panel for entry in chosen for panel in (_overlaid(compared, entry), _beyond(compared, entry))
            )
            charts.append(
                Chart(name, title, panels, 2, f"Left: share of each batch's flights a bin. Right: share{banded}.")
            )
    return tuple(charts)


def _banded(compared: Mapping[str, Any]) -> bool:
    """Whether the confidence is tinted: three tints over each other are none."""
    return len(compared["batches"]) <= 2


def _overlaid(compared: Mapping[str, Any], entry: Mapping[str, Any]) -> Panel:
    edges = tuple(entry["edges"])
    series = []
    for one in entry["batches"]:
        if one["n"]:
            tone, dash = _look(compared, one["name"])
            heights = tuple(100.0 * count / one["n"] for count in one["counts"])
            series.append(Histogram(one["name"], edges, heights, tone, dash, filled=False))
    values = list(dict.fromkeys(limit["value"] for limit in entry["limits"]))
    signed = [*(-value for value in values), *values] if entry["magnitude"] else values
    labelled = [(value, with_unit(value, entry["unit"])) for value in signed]
    near, far = limits_near(labelled, (edges[0], edges[-1]))
    return Panel(
        Axis(entry["title"], unit_of(entry["unit"])), Axis("flights in a bin", "%"), tuple(series), near, title=far
    )


def _beyond(compared: Mapping[str, Any], entry: Mapping[str, Any]) -> Panel:
    curves = [(one["name"], one["exceedance"]) for one in entry["batches"] if one["exceedance"] is not None]
    floor = share_floor(curve for _, curve in curves)
    series: list[Series] = []
    for name, curve in curves:
        series += beyond(name, curve, None, None, floor, *_look(compared, name), band=_banded(compared))
    values = dict.fromkeys(limit["value"] for limit in entry["limits"] if limit["side"] == "above")
    seen = [x for _, curve in curves for x in curve["x"]]
    labelled = [(value, with_unit(value, entry["unit"])) for value in values]
    near, far = limits_near(labelled, (min(seen), max(seen))) if seen else ((), "")
    title = f"|{entry['title']}|" if entry["magnitude"] else entry["title"]
    return Panel(
        Axis(title, unit_of(entry["unit"])), Axis("share at x or above", "%", log=True, span=(floor, 160.0)),
        tuple(series), near, title=far,
    )  # fmt: skip


def _envelopes(compared: Mapping[str, Any]) -> tuple[Chart, ...]:
    found = compared["envelopes"]
    if found is None or not found["distance_m"]:
        return ()
    charts = []
    for group, names in GROUPS.items():
        panels = tuple(_envelope(compared, found, source, name) for name in names for source in SOURCES)
        caption = (
            "Magnitude of the error that 50 % (thin) and 95 % (thick) of the flights with an estimate at a distance"
            f" stay below; 95 % takes {flights_for(95.0)} flights. The paper's bounds are those that its authors state."
        )
        charts.append(Chart(f"compare-errors-{group}", f"Navigation errors by range: {group}", panels, 2, caption))
    return tuple(charts)


def _envelope(compared: Mapping[str, Any], found: Mapping[str, Any], source: str, quantity: str) -> Panel:
    distances = tuple(found["distance_m"])
    of = next(s for s in found["series"] if s["source"] == source and s["quantity"] == quantity)
    span = error_span(found, quantity, ("p50", "p95"))
    series: list[Series] = []
    for one in of["batches"]:
        tone, dash = _look(compared, one["name"])
        for key, width in (("p50", 0.6), ("p95", 1.5)):
            level = f"{key[1:]} %"
            values = tuple(None if value is None else max(value, span[0]) for value in one[key])
            if there(values):
                series.append(Curve(f"{one['name']}, {level}", distances, values, tone, dash, width))
    name = QUANTITIES[quantity]
    return Panel(
        distance_axis(distances), Axis(f"|{name} error|", unit_of(of["unit"]), log=True, span=span),
        (*series, *bounds_of(found, quantity)), title=f"{name}: {SOURCES[source]}",
    )  # fmt: skip
