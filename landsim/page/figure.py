"""Charts on the page: a Plotly figure a panel, as the plain dictionaries that plotly.js takes.

Plotly reads texts as a small HTML of its own; whatever comes from a name or a file is escaped here.
"""

import math
from html import escape
from typing import Any

from landsim.charts.extent import extent, names_above
from landsim.charts.model import (
    COLOURS,
    Axis,
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
CONFIG: dict[str, Any] = {
    "displaylogo": False,
    "responsive": True,
    "showSendToCloud": False,
    "showLink": False,
    "plotlyServerURL": "",
    "modeBarButtons": [["toImage"], ["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
    "displayModeBar": "hover",
}
"""Of every figure.  Plotly's own buttons would offer to send its numbers to a server: these are all that there are."""


def panel_figure(panel: Panel, columns: int = 1) -> dict[str, Any]:
    """Data and layout of a panel, as plotly.js takes them and JSON holds them.

    Parameters
    ----------
    panel : Panel
    columns : int
        How many panels stand side by side.

    Returns
    -------
    dict
        ``data``, a list, and ``layout``.
    """
    data = [trace for series in panel.series for trace in traces_of(series, panel)]
    names = names_above(panel, NARROW, LETTER * SMALL)
    levels = 1 + max((name.level for name in names), default=-1)
    top = 8 + ROW * levels
    height = round(HEIGHT * panel.height)
    slanted = max((len(name) for name in panel.x.ticks), default=0)
    foot = max(46, round(LETTER * SIZE * slanted * math.sin(math.radians(SLANT))) + 16)
    layout = {
        "autosize": True,
        "height": height + top + foot,
        "margin": {"l": _left(panel), "r": 12, "t": top, "b": foot},
        "font": {"family": FONT, "size": SIZE, "color": COLOURS["ink"]},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "closest",
        "hoverlabel": {"align": "left", "bgcolor": "#ffffff", "bordercolor": "#555555", "font": {"color": "#000000"}},
        "showlegend": False,
        "dragmode": "zoom",
        "xaxis": _axis(panel.x, extent(panel, "x"), "x", TICKS[columns]),
        "yaxis": _axis(panel.y, extent(panel, "y"), "y", TICKS[columns]),
        "shapes": [shape for mention in panel.mentions for shape in _shapes(mention)],
        "annotations": [
            *({**_words(name.limit.label, name.limit.tone), "x": _placed(panel.x, name.limit.at), "xanchor": name.align,
               "y": 1.0, "yref": "y domain", "yanchor": "bottom", "yshift": ROW * name.level} for name in names),
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
    elif axis.log and (along == "x" or abs(last - first) < 1.5):
        look |= {"dtick": 1 if abs(last - first) > 2.2 else "D2"}
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
        "borderpad": 1,
    }  # fmt: skip
