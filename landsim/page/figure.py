"""Charts on the page: a Plotly figure a panel, as the plain dictionaries that plotly.js takes.

Plotly reads texts as a small HTML of its own; whatever comes from a name or a file is escaped here.
"""

import math
from html import escape
from typing import Any, NamedTuple

from landsim.charts.extent import Name, extent, names_above
from landsim.charts.model import (
    COLOURS,
    Axis,
    Chart,
    Limit,
    Note,
    Panel,
    Region,
    Tone,
)
from landsim.page.traces import DASHES, traces_of

FONT = "system-ui, -apple-system, 'Segoe UI', 'Liberation Sans', Arial, sans-serif"
SIZE, SMALL = 13, 12
"""Of letters, px."""
SLANT = 45.0
"""Of the names along a list that lies, degrees."""
LETTER = 0.52
"""Width of a letter, as a share of its size."""
LONG = 20
"""A name of a list that is longer takes two lines, letters."""
NARROW = 300.0
"""Names above a panel are laid out for one as narrow as this, px: they stay apart on a telephone."""
ROW = 15
"""From one row of such names to the next, px."""
TICKS = {1: 8, 2: 6, 3: 4}
"""Most numbers along a panel, by how many panels stand side by side."""
HEIGHT = 300
"""Of an ordinary panel, px."""
FEW_DECADES, MANY_DECADES = 1.3, 5.0
"""A logarithmic axis of fewer has numbers at 2 and 5 too, one of more no marks between the powers of ten."""
CONFIG: dict[str, Any] = {
    "displaylogo": False,
    "responsive": True,
    "showSendToCloud": False,
    "showLink": False,
    "plotlyServerURL": "",
    "modeBarButtons": [["toImage"], ["zoom2d", "pan2d", "resetScale2d"]],
    "displayModeBar": "hover",
}
"""Of every figure.  Plotly's own buttons would offer to send its numbers to a server: these are all that there are, and
few enough to stand beside the title of a narrow panel."""


class Frame(NamedTuple):
    """What is around a panel, px: panels that stand side by side, or one above the other, share it."""

    left: int
    top: int
    foot: int
    height: int
    """Of the panel itself."""


def chart_figures(chart: Chart) -> list[dict[str, Any]]:
    """The panels of a chart as `panel_figure` has them, in line with each other.

    Panels of a row have their axes at one height and are as high as the highest; all of a chart begin at one distance
    from the left.
    """
    frames = [_frame(panel) for panel in chart.panels]
    left = max(frame.left for frame in frames)
    figures = []
    for first in range(0, len(frames), chart.columns):
        row = frames[first : first + chart.columns]
        frame = Frame(left, *(max(one[i] for one in row) for i in (1, 2, 3)))
        figures += [panel_figure(panel, chart.columns, frame) for panel in chart.panels[first : first + chart.columns]]
    return figures


def _frame(panel: Panel) -> Frame:
    """The room that a panel needs by itself."""
    levels = 1 + max((name.level for name in _names(panel)), default=-1)
    slanted = max((len(name) for name in panel.x.ticks), default=0)
    foot = max(46, round(LETTER * SIZE * slanted * math.sin(math.radians(SLANT))) + 16)
    return Frame(_left(panel), 8 + ROW * levels, foot, round(HEIGHT * panel.height))


def _names(panel: Panel) -> list[Name]:
    return names_above(panel, NARROW, LETTER * SMALL)


def panel_figure(panel: Panel, columns: int = 1, frame: Frame | None = None) -> dict[str, Any]:
    """Data and layout of a panel, as plotly.js takes them and JSON holds them.

    Parameters
    ----------
    panel : Panel
    columns : int
        How many panels stand side by side.
    frame : Frame, optional
        What is around it; what it needs by itself if not given.

    Returns
    -------
    dict
        ``data``, a list, and ``layout``.
    """
    data = [trace for series in panel.series for trace in traces_of(series, panel)]
    frame = frame or _frame(panel)
    layout = {
        "autosize": True,
        "height": frame.height + frame.top + frame.foot,
        "margin": {"l": frame.left, "r": 12, "t": frame.top, "b": frame.foot},
        "font": {"family": FONT, "size": SIZE, "color": COLOURS["ink"]},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "closest",
        "hoverlabel": {"align": "left", "bgcolor": "#ffffff", "bordercolor": "#555555", "font": {"color": "#000000"}},
        "modebar": {"bgcolor": "#ffffff", "color": "#555555", "activecolor": "#005a8f"},
        "showlegend": False,
        "dragmode": "zoom",
        "xaxis": _axis(panel.x, extent(panel, "x"), "x", TICKS[columns]),
        "yaxis": _axis(panel.y, extent(panel, "y"), "y", TICKS[columns]),
        "shapes": [shape for mention in panel.mentions for shape in _shapes(mention)],
        "annotations": [
            *({**_words(name.limit.label, name.limit.tone), "x": _placed(panel.x, name.limit.at), "xanchor": name.align,
               "y": 1.0, "yref": "y domain", "yanchor": "bottom", "yshift": ROW * name.level}
              for name in _names(panel)),
            *(annotation for mention in panel.mentions for annotation in _annotations(mention)),
        ],
    }  # fmt: skip
    return {"data": data, "layout": layout}


def _axis(axis: Axis, ends: tuple[float, float], along: str, ticks: int) -> dict[str, Any]:
    first, last = (math.log10(end) for end in ends) if axis.log else ends
    look: dict[str, Any] = {
        "title": {"text": escape(axis.label, quote=False), "standoff": 6, "font": {"size": SIZE}},
        "range": [first, last],
        "type": "log" if axis.log else "linear",
        "showgrid": not axis.ticks,
        "gridcolor": "#e6e6e6",
        "zeroline": False,
        "showline": True,
        "linecolor": "#444444",
        "ticks": "" if axis.ticks else "outside",
        "ticklen": 4,
        "automargin": False,  # it moves the panel while one zooms, and on paper does not always come to an end
        "exponentformat": "none" if axis.log else "power",
        "minexponent": 4,
    }
    if axis.ticks:
        look |= {
            "tickmode": "array",
            "tickvals": list(range(len(axis.ticks))),
            "ticktext": [_tick(name, along) for name in axis.ticks],
        }
        look |= {"tickangle": -SLANT} if along == "x" else {}
    elif axis.log:
        # by itself Plotly writes every digit between the powers of ten, one over the other; page.js does as here
        # where one zooms
        look |= {"dtick": 1 if abs(last - first) > FEW_DECADES else "D2"}
        look |= {"minor": {"ticks": "outside", "ticklen": 2, "dtick": "D1"}} if abs(last - first) < MANY_DECADES else {}
    elif axis.whole:
        look |= {"dtick": _whole_step(abs(last - first) / 6.0), "tick0": 0}
    elif along == "x":
        look |= {"nticks": ticks, "tickangle": 0}
    return look


def _left(panel: Panel) -> int:
    """Room for what is written left of a panel, px: names, or numbers and what they are."""
    if panel.y.ticks:
        return round(LETTER * SIZE * max(len(line) for name in panel.y.ticks for line in wrapped(name))) + 14
    low, high = sorted(extent(panel, "y"))
    least = low if panel.y.log else (high - low) / 4.0
    decimals = max(-math.floor(math.log10(least)), 0)
    return round(0.6 * SIZE * max(len(f"{end:.{decimals}f}") for end in (low, high))) + 38


def wrapped(name: str) -> list[str]:
    """A name of a list in one line, or in two of about the same length."""
    spaces = [i for i, letter in enumerate(name) if letter == " "]
    if len(name) <= LONG or not spaces:
        return [name]
    middle = min(spaces, key=lambda i: abs(i - len(name) / 2))
    return [name[:middle], name[middle + 1 :]]


def _tick(name: str, along: str) -> str:
    if along == "x":
        return escape(name, quote=False)
    return "<br>".join(escape(line, quote=False) for line in wrapped(name))


def _placed(axis: Axis, value: float) -> float:
    """A number as annotations take it: on a logarithmic axis its logarithm."""
    return math.log10(value) if axis.log else value


def _whole_step(least: float) -> int:
    """1, 2 or 5 times a power of ten that is not less."""
    power = int(10.0 ** math.floor(math.log10(max(least, 1.0))))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least)


def _shapes(mention: Limit | Region | Note) -> list[dict[str, Any]]:
    if isinstance(mention, Note):
        return []
    line = {"color": COLOURS[mention.tone], "width": 1.5, "dash": DASHES[mention.dash]}
    if isinstance(mention, Limit):
        other = "y" if mention.along == "x" else "x"
        return [
            {"type": "line", "line": line, f"{mention.along}0": mention.at, f"{mention.along}1": mention.at,
             f"{other}0": 0, f"{other}1": 1, f"{other}ref": f"{other} domain"}
        ]  # fmt: skip
    ends: dict[str, Any] = {}
    for letter, (low, high) in (("x", mention.x), ("y", mention.y)):
        whole = low is None and high is None
        ends |= {f"{letter}ref": f"{letter} domain" if whole else letter}
        ends |= {f"{letter}0": 0 if whole else low, f"{letter}1": 1 if whole else high}
    box = {
        "type": "rect",
        "layer": "below" if mention.fill else "above",
        "line": line if mention.outline else {"width": 0},
        **ends,
    }
    return [{**box, "fillcolor": COLOURS[mention.tone] if mention.fill else "rgba(0,0,0,0)",
             "opacity": mention.fill or 1.0} if not (mention.fill and mention.outline) else
            {**box, "fillcolor": _faint(mention.tone, mention.fill)}]  # fmt: skip


def _faint(tone: Tone, strength: float) -> str:
    red, green, blue = (int(COLOURS[tone][i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{strength:g})"


def _annotations(mention: Limit | Region | Note) -> list[dict[str, Any]]:
    if isinstance(mention, Note):
        words = {**_words(mention.text, "ink"), "bgcolor": "#ffffff"}
        return [words | {"x": 0.5, "xref": "x domain", "y": 0.5, "yref": "y domain"}]
    if isinstance(mention, Limit):
        if mention.along == "x" or not mention.label:
            return []
        words = _words(mention.label, mention.tone)
        return [words | {"x": 1.0, "xref": "x domain", "xanchor": "right", "y": mention.at, "yanchor": "bottom"}]
    if not mention.label or mention.x[0] is None or mention.y[1] is None:
        return []
    words = _words(mention.label, mention.tone)
    return [words | {"x": mention.x[0], "xanchor": "left", "y": mention.y[1], "yanchor": "bottom"}]


def _words(text: str, tone: Tone) -> dict[str, Any]:
    return {
        "text": escape(text, quote=False), "showarrow": False, "font": {"size": SMALL, "color": COLOURS[tone]},
        "borderpad": 1, "bgcolor": "rgba(255,255,255,0.8)",
    }  # fmt: skip
