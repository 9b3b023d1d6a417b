"""The legend of a chart as the page has it: above the panels, where it hides nothing, and printed with them."""

from typing import NamedTuple

from landsim.charts.model import COLOURS, Band, Cells, Chart, Curve, Mark, Points, Series
from landsim.page.traces import PX

DASHES = {"solid": "", "dash": "8 4", "dot": "2 3", "dashdot": "8 3 2 3"}
WIDTH, HEIGHT = 30, 14
"""Of a swatch, px."""


class Entry(NamedTuple):
    """A name and the parts of its swatch, as SVG has them."""

    name: str
    parts: tuple[dict[str, str], ...]
    """Each with ``tag`` and its attributes; numbers and colours alone."""


def legend_of(chart: Chart) -> tuple[Entry, ...]:
    """What the series of a chart look like, each name once; nothing if there is one alone, which needs none."""
    found: dict[str, Entry] = {}
    for panel in chart.panels:
        for series in panel.series:
            if series.name and series.legend and series.name not in found:
                found[series.name] = Entry(series.name, _swatch(series))
    return tuple(found.values()) if len(found) > 1 else ()


def _line(colour: str, width: float, dash: str) -> dict[str, str]:
    middle = f"{HEIGHT / 2:g}"
    return {
        "tag": "line", "x1": "1", "x2": f"{WIDTH - 1}", "y1": middle, "y2": middle, "stroke": colour,
        "stroke-width": f"{width:g}", "stroke-dasharray": dash,
    }  # fmt: skip


def _box(colour: str, opacity: float) -> dict[str, str]:
    return {
        "tag": "rect", "x": "3", "y": "1", "width": f"{WIDTH - 6}", "height": f"{HEIGHT - 2}", "fill": colour,
        "fill-opacity": f"{opacity:g}",
    }  # fmt: skip


def _swatch(series: Series) -> tuple[dict[str, str], ...]:
    if isinstance(series, Cells):
        return ()
    colour = COLOURS[series.tone]
    if isinstance(series, Curve):
        return (_line(colour, PX * series.width, DASHES[series.dash]),)
    if isinstance(series, Band):
        return (_box(colour, series.strength),)
    if isinstance(series, Points):
        bars = series.x_bar or series.y_bar
        bar = (_line(colour, PX * series.bar_width, ""),) if bars else ()
        return (*bar, *_mark(series.mark, colour))
    return (_box(colour, 0.45),) if series.filled else (_line(colour, 1.8, DASHES[series.dash]),)


def _mark(mark: Mark, colour: str) -> tuple[dict[str, str], ...]:
    x, y, r = WIDTH / 2, HEIGHT / 2, 4.5
    drawn = {"fill": "none", "stroke": colour, "stroke-width": "1.5"}
    filled = {"fill": colour}
    left, right, top, foot = x - r, x + r, y - r, y + r
    paths: dict[Mark, str] = {
        "cross": f"M{left:g} {top:g}L{right:g} {foot:g}M{left:g} {foot:g}L{right:g} {top:g}",
        "diamond": f"M{x:g} {top:g}L{right:g} {y:g}L{x:g} {foot:g}L{left:g} {y:g}Z",
        "triangle": f"M{x:g} {top:g}L{right:g} {foot:g}L{left:g} {foot:g}Z",
    }
    if mark in paths:
        return ({"tag": "path", "d": paths[mark], **drawn},)
    if mark == "none":
        return ()
    if mark == "square":
        return ({"tag": "rect", "x": f"{x - 4:g}", "y": f"{y - 4:g}", "width": "8", "height": "8", **filled},)
    look = drawn if mark == "ring" else filled
    return ({"tag": "circle", "cx": f"{x:g}", "cy": f"{y:g}", "r": f"{r - 0.5:g}", **look},)
