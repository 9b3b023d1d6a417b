"""The series of a chart as Plotly's traces, with what one reads off by hovering over them.

Plotly reads texts as a small HTML of its own; whatever comes from a name or a file is escaped here.
"""

from html import escape
from itertools import pairwise
from typing import Any

from landsim.charts.extent import tint
from landsim.charts.model import (
    COLOURS,
    Axis,
    Band,
    Cells,
    Curve,
    Dash,
    Histogram,
    Mark,
    Numbers,
    Panel,
    Points,
    Series,
    Step,
)

PX = 1.45
"""Pixels a point of line or mark."""
DASHES: dict[Dash, str] = {"solid": "solid", "dash": "8px,4px", "dot": "2px,3px", "dashdot": "8px,3px,2px,3px"}
MARKS: dict[Mark, str] = {
    "dot": "circle", "cross": "x-thin", "ring": "circle-open", "diamond": "diamond-open", "square": "square",
    "triangle": "triangle-up-open", "none": "circle",
}  # fmt: skip
SHAPES: dict[Step, str] = {"": "linear", "before": "vh", "after": "hv"}


def _value(axis: Axis, letter: str) -> str:
    """A number of an axis in a hover text, with its unit."""
    unit = axis.unit if axis.unit in {"°", "%", ""} else f" {axis.unit}"
    return f"{escape(axis.name, quote=False)}: %{{{letter}:.4~g}}{escape(unit, quote=False)}"


def _hover(series: Series, panel: Panel, *, own: bool = False) -> str:
    """What the label of a point says: whose it is, its numbers with their units, and what else there is."""
    lines = [f"<b>{escape(series.name, quote=False)}</b>"] if series.name else []
    lines += [_value(axis, letter) for axis, letter in ((panel.x, "x"), (panel.y, "y")) if not axis.ticks]
    lines += ["%{customdata}"] if own else []
    return "<br>".join(lines) + "<extra></extra>"


def traces_of(series: Series, panel: Panel) -> list[dict[str, Any]]:
    """A series as traces, each with what the label of a point says."""
    if isinstance(series, Cells):
        return [_cells(series)]
    colour = COLOURS[series.tone]
    if isinstance(series, Band):
        return _band(series, panel, colour)
    if isinstance(series, Histogram):
        return [_histogram(series, panel, colour)]
    base: dict[str, Any] = {
        "type": "scatter", "name": escape(series.name, quote=False), "x": list(series.x), "y": list(series.y),
    }  # fmt: skip
    if isinstance(series, Curve):
        line = {"color": colour, "width": PX * series.width, "dash": DASHES[series.dash]}
        line |= {"shape": SHAPES[series.step]}
        hover = {"hovertemplate": _hover(series, panel)} if series.name else {"hoverinfo": "skip"}
        return [base | {"mode": "lines", "line": line, "connectgaps": False} | hover]
    size = 1.7 * PX * series.size
    marker = {"symbol": MARKS[series.mark], "size": size, "color": colour, "line": {"width": 1.3, "color": colour}}
    if series.mark in {"dot", "square"}:
        marker |= {"line": {"width": 0}}
    trace = base | {"mode": "markers", "marker": marker, "hovertemplate": _hover(series, panel, own=bool(series.hover))}
    if series.hover:
        trace["customdata"] = [_lines(text) for text in series.hover]
    bars = (_bar(series, letter, *bar) for letter, bar in (("x", series.x_bar), ("y", series.y_bar)) if bar is not None)
    return [*bars, *([] if series.mark == "none" else [trace])]


def _bar(series: Points, letter: str, low: Numbers, high: Numbers) -> dict[str, Any]:
    """From where to where each point may be: lines, which are there where the point itself is not."""
    other = series.y if letter == "x" else series.x
    texts = series.hover or ("",) * len(other)
    rows = [(*row, None) for row in zip(low, high, strict=True)]
    return {
        "type": "scatter", "mode": "lines", "name": escape(series.name, quote=False),
        letter: [value for row in rows for value in row],
        "y" if letter == "x" else "x": [value for at in other for value in (at, at, None)],
        "line": {"color": COLOURS[series.tone], "width": PX * series.bar_width}, "connectgaps": False,
        "customdata": [_lines(text) for text in texts for _ in range(3)],
        "hovertemplate": f"<b>{escape(series.name, quote=False)}</b><br>%{{customdata}}<extra></extra>",
        **({} if series.hover else {"hoverinfo": "skip", "hovertemplate": None}),
    }  # fmt: skip


def _band(series: Band, panel: Panel, colour: str) -> list[dict[str, Any]]:
    """A polygon a stretch without a gap, and both its edges to hover over."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    shape = SHAPES[series.step]
    traces: list[dict[str, Any]] = []
    for x, low, high in _stretches(series):
        edge = {
            "type": "scatter", "mode": "lines", "x": x, "name": escape(series.name, quote=False),
            "line": {"width": 0, "color": colour, "shape": shape},
        }  # fmt: skip
        traces.append({**edge, "y": low, "hovertemplate": _hover(series, panel)})
        fill = {"fill": "tonexty", "fillcolor": f"rgba({red},{green},{blue},{series.strength:g})"}
        traces.append({**edge, **fill, "y": high, "hovertemplate": _hover(series, panel)})
    return traces


def _stretches(series: Band) -> list[tuple[list[float], list[float], list[float]]]:
    """A band's x, low and high where all three are there."""
    found: list[tuple[list[float], list[float], list[float]]] = []
    whole = False
    for x, low, high in zip(series.x, series.low, series.high, strict=True):
        if x is None or low is None or high is None:
            whole = False
            continue
        if not whole:
            found.append(([], [], []))
            whole = True
        for values, value in zip(found[-1], (x, low, high), strict=True):
            values.append(value)
    return found


def _cells(series: Cells) -> dict[str, Any]:
    scale = [[k / 8, tint(k / 4 - 1.0)] for k in range(9)]
    return {
        "type": "heatmap", "name": escape(series.name, quote=False), "z": [list(row) for row in series.values],
        "zmin": -1, "zmax": 1, "colorscale": scale, "showscale": False, "xgap": 1, "ygap": 1,
        "text": [list(row) for row in series.texts], "texttemplate": "%{text}", "textfont": {"size": 11},
        "customdata": [[_lines(text) for text in row] for row in series.hover],
        "hovertemplate": "%{customdata}<extra></extra>", "hoverongaps": False,
    }  # fmt: skip


def _lines(text: str) -> str:
    """A text of several lines for Plotly."""
    return escape(text, quote=False).replace("\n", "<br>")


def _histogram(series: Histogram, panel: Panel, colour: str) -> dict[str, Any]:
    """Its outline, which also shows in grey, over a fill."""
    edges, heights = series.edges, series.heights
    unit = escape(f" {panel.x.unit}" if panel.x.unit else "", quote=False)
    if series.filled:
        return {
            "type": "bar", "name": escape(series.name, quote=False), "y": list(heights),
            "x": [0.5 * (a + b) for a, b in pairwise(edges)], "width": [b - a for a, b in pairwise(edges)],
            "marker": {"color": colour, "opacity": 0.45, "line": {"width": 0}},
            "customdata": [f"{a:.4g} to {b:.4g}{unit}" for a, b in pairwise(edges)],
            "hovertemplate": f"%{{customdata}}<br>{_value(panel.y, 'y')}<extra></extra>",
        }  # fmt: skip
    x = [edge for edge in edges for _ in (0, 1)]
    y = [0.0, *(height for height in heights for _ in (0, 1)), 0.0]
    return {
        "type": "scatter", "mode": "lines", "name": escape(series.name, quote=False), "x": x, "y": y,
        "line": {"color": colour, "width": 1.8, "dash": DASHES[series.dash]}, "hovertemplate": _hover(series, panel),
    }  # fmt: skip
