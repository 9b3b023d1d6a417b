"""How well a batch navigated: errors by range, whether the filter knows them, and which draws matter."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from landsim.batch.sections.words import flights_for
from landsim.charts.model import (
    Axis,
    Band,
    Cells,
    Chart,
    Curve,
    Dash,
    Limit,
    Mark,
    Mention,
    Note,
    Numbers,
    Panel,
    Points,
    Series,
    Tone,
)
from landsim.charts.shared import PERCENT, QUANTITIES, SOURCES, distance_axis, number, percent, there, times, unit_of

TONES: dict[str, Tone] = {"vision": "orange", "fused": "blue"}
PERCENTILES: Mapping[str, tuple[Dash, float, float]] = {
    "p50": ("dash", 0.8, 0.3),
    "p95": ("solid", 1.8, 0.1),
    "p99_7": ("dashdot", 0.8, 0.0),
}
"""Dash and width of each, from the inmost, and how strong the tint is from the one before it."""
SIGMAS = 1.959963984540054
"""So many σ hold 95 % of a normal distribution, either side."""
LIMITS: tuple[tuple[Tone, Dash], ...] = (("purple", "dash"), ("purple", "dot"), ("purple", "dashdot"), ("ink", "dash"))
BOUND: tuple[Tone, Dash] = ("green", "dash")
DECADES = 4.0
"""What an axis of errors shows at most, below its largest."""
GROUPS = {"position": ("along_m", "cross_m", "height_m"), "attitude": ("roll_deg", "pitch_deg", "yaw_deg")}
PHASES = {"early": "three lines", "late": "two lines", "coasting": "no lines", "rollout": "rolling"}
VERDICTS: Mapping[str, tuple[str, Tone, Mark]] = {
    "consistent": ("within the bounds", "blue", "dot"),
    "optimistic": ("errors larger than predicted", "vermilion", "triangle"),
    "timid": ("errors smaller than predicted", "orange", "square"),
}
"""Of a summary, and how they are shown."""


def envelope_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Percentiles of the errors by range, of vision and of the filter side by side, and how many have an estimate."""
    found = summary["envelopes"]
    if not found["distance_m"] or not any(found["in_the_air"]):
        return ()
    charts = []
    for group, names in GROUPS.items():
        panels = tuple(_envelope(found, source, name) for name in names for source in SOURCES)
        caption = (
            "Magnitude of the error that the stated share of the flights stays below, of those in the air at a distance"
            f" that have an estimate there. {_takes(found['levels'])} Dotted: what the filter itself predicts."
            " The paper's bounds are those that its authors state; the published limits are from secondary sources, for"
            " comparison."
        )
        charts.append(Chart(f"errors-{group}", f"Navigation errors by range: {group}", panels, 2, caption))
    return (*charts, _availability(found))


def _takes(levels: Mapping[str, float]) -> str:
    """From how many flights on there is a percentile."""
    needs = (f"{levels[key]:g} % takes {flights_for(levels[key])}" for key in ("p95", "p99_7"))
    return f"A line begins and ends where the flights are enough for it: {', '.join(needs)}."


def _of(found: Mapping[str, Any], source: str, quantity: str) -> Mapping[str, Any]:
    return next(s for s in found["series"] if s["source"] == source and s["quantity"] == quantity)


def _envelope(found: Mapping[str, Any], source: str, quantity: str) -> Panel:
    distances = tuple(found["distance_m"])
    of, tone = _of(found, source, quantity), TONES[source]
    span = error_span(found, quantity)
    series: list[Series] = []
    below: Numbers = tuple(span[0] for _ in distances)
    for key, (dash, width, strength) in PERCENTILES.items():
        if not there(of[key]):
            continue
        level, here = found["levels"][key], _floored(of[key], span[0])
        if strength:
            low = tuple(span[0] if b is None else min(b, span[1]) for b in below)
            band = Band(f"{level:g} % of the flights", distances, low, here, tone, strength, legend=False)
            series.append(band)
            below = tuple(b if v is None else v for b, v in zip(below, here, strict=True))
        series.append(Curve(f"{level:g} %, {source}", distances, here, tone, dash, width))
    nothing: tuple[Mention, ...] = ()
    if not there(of["p50"]):
        few = f"too few flights: 50 % takes {flights_for(found['levels']['p50'])}"
        nothing = (Note(few if any(of["count"]) else f"no {source} estimate"),)
    if there(of.get("sigma_rms", ())):
        predicted = _floored(times(of["sigma_rms"], SIGMAS), span[0])
        series.append(Curve("95 % as the filter predicts, 1.96 σ", distances, predicted, "ink", "dot", 1.2))
    series += bounds_of(found, quantity)
    series += _published(found, quantity)
    name, unit = QUANTITIES[quantity], unit_of(of["unit"])
    return Panel(
        distance_axis(distances), Axis(f"|{name} error|", unit, log=True, span=span), tuple(series),
        nothing, f"{name}: {SOURCES[source]}",
    )  # fmt: skip


def _floored(values: Sequence[float | None], floor: float) -> tuple[float | None, ...]:
    return tuple(None if value is None else max(value, floor) for value in values)


def bounds_of(found: Mapping[str, Any], quantity: str) -> list[Curve]:
    """The paper's bounds on a quantity, over the ranges for which they are stated."""
    return [
        Curve("bound of the paper", (one["from_m"], one["to_m"]), (one["value"], one["value"]), *BOUND, width=1.4)
        for one in found["bounds"]
        if one["quantity"] == quantity
    ]


def _published(found: Mapping[str, Any], quantity: str) -> list[Curve]:
    """The published limits, from the farthest distance of the batch on."""
    first, last = max(found["distance_m"]), min(found["distance_m"])
    limits = found.get("limits", ())
    names = list(dict.fromkeys(one["name"] for one in limits))
    curves = []
    for one in limits:
        if one["quantity"] == quantity:
            tone, dash = LIMITS[names.index(one["name"]) % len(LIMITS)]
            x, y = clipped(one["distance_m"], one["value"], first, last)
            curves.append(Curve(one["name"], x, y, tone, dash, 1.0))
    return curves


def clipped(
    distances: Sequence[float], values: Sequence[float], first: float, last: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The part of a line by falling distance between two of them, with its ends worked out where they cut it."""
    points = list(zip(distances, values, strict=True))
    kept = [point for point in points if last <= point[0] <= first]
    kept += [
        (cut, v0 + (v1 - v0) * (cut - d0) / (d1 - d0))
        for (d0, v0), (d1, v1) in pairwise(points)
        for cut in (first, last)
        if d1 < cut < d0
    ]
    kept.sort(key=lambda point: -point[0])
    return tuple(d for d, _ in kept), tuple(v for _, v in kept)


def error_span(
    found: Mapping[str, Any], quantity: str, keys: Sequence[str] = ("p50", "p95", "p99_7")
) -> tuple[float, float]:
    """One axis for vision and the filter, that they can be compared on: what they need, and the bounds of the paper."""
    values = [
        value
        for of in found["series"]
        if of["quantity"] == quantity
        for curve in (of.get("batches") or [of])
        for key in keys
        for value in (curve.get(key) or ())
        if value is not None and value > 0.0
    ]
    values += [one["value"] for one in found["bounds"] if one["quantity"] == quantity]
    values += [value for curve in _published(found, quantity) for value in curve.y if value is not None]
    if not values:
        return 0.1, 1.0
    high = 1.5 * max(values)
    return max(0.7 * min(values), high * 10.0**-DECADES), high


def _availability(found: Mapping[str, Any]) -> Chart:
    distances = tuple(found["distance_m"])
    kinds: tuple[tuple[str, str, str, Tone, Dash], ...] = (
        ("vision", "along_m", "vision: a whole pose, of three lines", "ink", "dot"),
        ("vision", "cross_m", "vision: cross, height, pitch and yaw, of two lines or three", "orange", "solid"),
        ("fused", "cross_m", "fused", "blue", "dash"),
    )
    curves = tuple(
        Curve(label, distances, times(_of(found, source, quantity)["share"], PERCENT), tone, dash)
        for source, quantity, label, tone, dash in kinds
        if any(_of(found, source, quantity)["count"])
    )
    share = Panel(distance_axis(distances), Axis("flights with an estimate", "%", span=(-3.0, 105.0)), curves)
    number_of = Curve("flights in the air", distances, tuple(found["in_the_air"]), "ink", "dot", legend=False)
    most = max(found["in_the_air"])
    flights = Panel(
        distance_axis(distances), Axis("flights in the air", whole=True, span=(-0.03 * most, 1.05 * most)), (number_of,)
    )
    return Chart(
        "availability", "How many flights have an estimate, by range", (share, flights), 2,
        "Left: of the flights in the air at a distance, the share with an estimate there. Right: how many those are.",
    )  # fmt: skip


def consistency_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Normalised errors against the bounds of a consistent filter, and coverage of the predicted 95 %."""
    found = summary["consistency"]
    nees = [one for one in found["nees"] if one["mean"] is not None]
    panels = []
    if nees:
        panels.append(_nees(nees))
    coverage = [one for one in found["coverage"] if one["mean"] is not None]
    if coverage:
        panels.append(_coverage(coverage))
    if not panels:
        return ()
    caption = (
        "Left: mean over the flights of the normalised error squared, divided by its expected value: 1 is a filter that"
        " knows its errors. Right: share of the frames whose error is within 1.96 of the filter's own σ. Coloured bars"
        " are 95 % intervals over the flights."
    )
    return (Chart("consistency", "Whether the filter knows how well it knows", tuple(panels), 2, caption),)


def _nees(nees: Sequence[Mapping[str, Any]]) -> Panel:
    names = tuple(f"{one['phase']}, {one['dof']} states" for one in nees)
    ratios = [
        one[key] / one["dof"] for one in nees for key in ("mean", "low", "high", "bound_low", "bound_high") if one[key]
    ]
    wide = max(ratios) > 4.0
    every = [(row, one) for row, one in enumerate(nees) if one["bound_low"] is not None]
    series: list[Series] = [
        Points(
            "bounds of a consistent filter", tuple(1.0 for _ in every), tuple(row for row, _ in every), "pale", "none",
            x_bar=(_per_degree(every, "bound_low"), _per_degree(every, "bound_high")), bar_width=7.0,
        )
    ]  # fmt: skip
    for verdict, (label, tone, mark) in VERDICTS.items():
        own = [(row, one) for row, one in enumerate(nees) if (one["verdict"] or "consistent") == verdict]
        if own:
            bars = tuple(
                tuple(
                    one["mean"] / one["dof"] if one[key] is None else max(one[key], 1e-3) / one["dof"] for _, one in own
                )
                for key in ("low", "high")
            )
            hover = tuple(
                f"{names[row]}: mean {number(one['mean'])}, expected {one['dof']}\n{one['flights']} flights,"
                f" {one['frames']} frames"
                for row, one in own
            )
            x = tuple(one["mean"] / one["dof"] for _, one in own)
            rows = tuple(float(row) for row, _ in own)
            series.append(Points(label, x, rows, tone, mark, 4.5, hover, (bars[0], bars[1]), bar_width=1.4))
    return Panel(
        Axis("mean / expected", log=wide), Axis("", ticks=names), tuple(series),
        (Limit("x", 1.0, "expected", "green"),), title="normalised errors squared", height=0.3 + 0.1 * len(nees),
    )  # fmt: skip


def _per_degree(rows: Sequence[tuple[int, Mapping[str, Any]]], key: str) -> Numbers:
    """A number of each row, divided by what a consistent filter has on average."""
    return tuple(one[key] / one["dof"] for _, one in rows)


def _coverage(coverage: Sequence[Mapping[str, Any]]) -> Panel:
    names = tuple(QUANTITIES[one["quantity"]] for one in coverage)
    series = []
    looks: tuple[tuple[bool, str, Tone, Mark], ...] = (
        (True, "agrees", "blue", "dot"),
        (False, "does not agree", "vermilion", "triangle"),
    )
    for agrees, label, tone, mark in looks:
        own = [(row, one) for row, one in enumerate(coverage) if (one["agrees"] is not False) is agrees]
        if own:
            low, high = (
                tuple(PERCENT * (one["mean"] if one[key] is None else one[key]) for _, one in own)
                for key in ("low", "high")
            )
            hover = tuple(
                f"{percent(one['mean'])} of {one['frames']} frames, {one['flights']} flights" for _, one in own
            )
            x, rows = tuple(PERCENT * one["mean"] for _, one in own), tuple(float(row) for row, _ in own)
            series.append(
                Points(f"coverage {label} with 95 %", x, rows, tone, mark, 4.5, hover, (low, high), bar_width=1.4)
            )
    return Panel(
        Axis("frames within the predicted 95 %", "%"), Axis("", ticks=names), tuple(series),
        (Limit("x", PERCENT * coverage[0]["expected"], "expected", "green"),), title="coverage of the predicted 95 %",
        height=0.3 + 0.1 * len(coverage),
    )  # fmt: skip


def sensitivity_charts(summary: Mapping[str, Any]) -> tuple[Chart, ...]:
    """Rank correlation of every draw with every result; the significant ones carry their number."""
    found = summary["sensitivity"]
    if not found["pairs"]:
        return ()
    inputs, results = [one["key"] for one in found["inputs"]], found["results"]
    pairs = {(one["input"], one["result"]): one for one in found["pairs"]}
    level = found["significant_below"]
    panels = []
    for title, spread in (("by the value of a draw", False), ("by its distance from the median, to either side", True)):
        values, texts, hover = [], [], []
        for key in inputs:
            row = [pairs[key, result["key"]] for result in results]
            of = [one["spread"] if spread else one for one in row]
            values.append(tuple(one["rho"] for one in of))
            texts.append(tuple(f"{one['rho']:.2f}".replace("-", "−") if one["significant"] else "" for one in of))
            hover.append(
                tuple(
                    f"{key}\n{result['title']}\nρ {number(one['rho'])}, adjusted p {number(one['p_adjusted'])},"
                    f" {whole['n']} flights\n{'significant' if one['significant'] else 'not significant'}"
                    for result, one, whole in zip(results, of, row, strict=True)
                )
            )
        cells = Cells("rank correlation", tuple(values), tuple(texts), tuple(hover))
        panels.append(
            Panel(
                Axis("", ticks=tuple(result["title"] for result in results)), Axis("", ticks=tuple(inputs)), (cells,),
                title=title, height=max(0.12 * len(inputs), 0.3),
            )
        )  # fmt: skip
    caption = (
        "Spearman's rank correlation ρ, from −1 (blue) to +1 (red-brown); a number stands where it is significant:"
        f" p below {number(level)}, adjusted for all {found['tests']} tests by Benjamini and Hochberg."
    )
    return (Chart("sensitivity", "Which draws matter, and for what", tuple(panels), 1, caption),)
