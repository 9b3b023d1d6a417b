"""Charts on paper: a figure a chart, as PNG and as PDF."""

import math
from pathlib import Path
from textwrap import wrap

from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from landsim.charts.extent import Along, extent, names_above
from landsim.charts.model import (
    COLOURS,
    Axis,
    Chart,
    Limit,
    Note,
    Panel,
    Region,
)
from landsim.plots.marks import draw_limit, draw_region, draw_series
from landsim.plots.printed import CM, PAGE, PRINTED, save
from landsim.plots.style import LABEL_PT, LEVEL_PT, note, number

PANEL = {1: 5.2 * CM, 2: 4.2 * CM, 3: 3.6 * CM}
"""Height of an ordinary panel, by how many stand side by side, inches."""
LEFT, RIGHT, GAP, BETWEEN, FOOT = 0.58, 0.14, 0.64, 0.42, 0.42
"""Margins, what is between columns and between rows beside the names of limits, and the foot, inches."""
TICKS = {1: 10, 2: 7, 3: 3}
"""Most numbers along a panel, by how many stand side by side."""
SHEET = 25.5 * CM
"""No figure is higher: panels of many rows are less high, inches."""
TITLE_ROW, SUBTITLE_ROW, LEGEND_ROW, HEAD = 0.2, 0.135, 0.145, 0.08
SLANT = 50.0
"""Of the names along a list that lies, degrees."""
SOFT = "#404040"
"""Of the subtitle."""
LETTER = 0.53
"""Width of a letter, as a share of its size."""


def draw_chart(folder: Path, chart: Chart) -> list[Path]:
    """Draw a chart into ``<name>.png`` and ``<name>.pdf``; the same chart makes the same bytes.

    Parameters
    ----------
    folder : Path
        Exists; figures of the same names in it are replaced.
    chart : Chart

    Returns
    -------
    list of Path

    Raises
    ------
    OSError
        If a figure cannot be written.
    """
    return save(chart_figure(chart), folder, chart.name)


@rc_context(PRINTED)
def chart_figure(chart: Chart) -> Figure:
    """The figure of `draw_chart`: a page wide, and as high as its panels are."""
    columns = min(chart.columns, len(chart.panels))
    rows = [chart.panels[i : i + columns] for i in range(0, len(chart.panels), columns)]
    heights = [PANEL[columns] * max(panel.height for panel in row) for row in rows]
    left = max(LEFT, *(_room_for_names(panel) for panel in chart.panels))
    width = (PAGE - left - RIGHT - (columns - 1) * max(GAP, left - 0.05)) / columns
    across = width + max(GAP, left - 0.05)
    heads = [max(_head_of(panel, width) for panel in row) for row in rows]
    figure = Figure(figsize=(PAGE, 1.0))
    legend = _legend(chart)
    lines = _broken(list(legend), PAGE)
    subtitle = wrap(chart.subtitle, int(72.0 * 0.97 * PAGE / (LETTER * 7.0)))
    above = HEAD + TITLE_ROW + SUBTITLE_ROW * len(subtitle) + (0.04 if subtitle else 0.0)
    head = above + LEGEND_ROW * len(lines) + 0.06
    names = [max(_room_below(panel) for panel in row) for row in rows]
    around = head + sum(heads) + sum(names) + BETWEEN * (len(rows) - 1) + FOOT
    fitting = min(1.0, max(SHEET - around, 1.0) / sum(heights))
    heights = [fitting * height for height in heights]
    total = around + sum(heights)
    figure.set_size_inches(PAGE, total)
    top = total - head
    for row, height, over, below in zip(rows, heights, heads, names, strict=True):
        top -= over + height
        for k, panel in enumerate(row):
            place = ((left + k * across) / PAGE, top / total, width / PAGE, height / total)
            axes = figure.add_axes(place)
            _panel(axes, panel, width, columns)
        top -= BETWEEN + below
    figure.text(0.012, 1.0 - HEAD / total, chart.title, va="top", fontsize=_fitting(chart.title, 8.5))
    for i, text in enumerate(subtitle):
        figure.text(
            0.012, 1.0 - (HEAD + TITLE_ROW + SUBTITLE_ROW * i) / total, text, va="top", fontsize=7.0, color=SOFT
        )
    for i, line in enumerate(lines):
        figure.legend(
            [legend[name] for name in line], line, loc="upper left", ncols=len(line), columnspacing=1.4,
            bbox_to_anchor=(0.008, 1.0 - (above + LEGEND_ROW * i) / total),
        )  # fmt: skip
    return figure


def _fitting(text: str, size: float) -> float:
    """A size of letters, at most that given, with which a text fits across the page, points."""
    return min(size, max(7.0, 72.0 * 0.97 * PAGE / (LETTER * max(len(text), 1))))


def _room_for_names(panel: Panel) -> float:
    """Left of a panel whose axis is a list, inches."""
    longest = max((len(name) for name in panel.y.ticks), default=0)
    return 0.12 + 7.0 * LETTER * longest / 72.0 if longest else 0.0


def _room_below(panel: Panel) -> float:
    """Below a panel whose axis is a list, whose names are slanted, inches."""
    longest = max((len(name) for name in panel.x.ticks), default=0)
    return max(7.0 * LETTER * longest * math.sin(math.radians(SLANT)) / 72.0 - 0.2, 0.0)


def _head_of(panel: Panel, width: float) -> float:
    """Room above a panel for its title and for the names of its limits, inches."""
    levels = 1 + max((name.level for name in names_above(panel, 72.0 * width, LETTER * LABEL_PT)), default=-1)
    return (0.16 if panel.title else 0.0) + levels * LEVEL_PT / 72.0 + 0.04


def _broken(names: list[str], width: float) -> list[list[str]]:
    """The names of a legend in lines that fit."""
    lines: list[list[str]] = []
    used = 72.0 * width
    for name in names:
        needs = 7.0 * (LETTER * len(name) + 4.6)
        if used + needs > 72.0 * width - 14.0:
            lines.append([])
            used = 0.0
        lines[-1].append(name)
        used += needs
    return lines


def _legend(chart: Chart) -> dict[str, Artist]:
    """What the chart's series look like, by name; one series that is all there is needs no legend."""
    scratch = Figure().add_subplot()
    handles: dict[str, Artist] = {}
    for panel in chart.panels:
        for series in panel.series:
            if series.name and series.legend and series.name not in handles:
                handles[series.name] = draw_series(scratch, series)
    return handles if len(handles) > 1 else {}


def _panel(axes: Axes, panel: Panel, width: float, columns: int) -> None:
    _axis(axes, "x", panel.x, TICKS[columns])
    _axis(axes, "y", panel.y, 6)
    axes.set_xlim(*extent(panel, "x"))
    axes.set_ylim(*extent(panel, "y"))
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label)
    if not panel.y.ticks:
        axes.yaxis.set_label_coords(-0.41 / width, 0.5)
    for mention in panel.mentions:
        if isinstance(mention, Region):
            draw_region(axes, panel, mention)
        elif isinstance(mention, Limit):
            draw_limit(axes, mention)
        elif isinstance(mention, Note):
            note(axes, mention.text)
    for series in panel.series:
        draw_series(axes, series)
    names = names_above(panel, 72.0 * width, LETTER * LABEL_PT)
    for name in names:
        axes.annotate(
            name.limit.label, (name.at, 1.0), xycoords="axes fraction", xytext=(0.0, 2.0 + LEVEL_PT * name.level),
            textcoords="offset points", ha=name.align, va="bottom", fontsize=7.0, color=COLOURS[name.limit.tone],
            annotation_clip=False,
        )  # fmt: skip
    if panel.title:
        levels = 1 + max((name.level for name in names), default=-1)
        axes.set_title(panel.title, loc="left", pad=3.0 + LEVEL_PT * levels)


def _axis(axes: Axes, along: Along, axis: Axis, ticks: int) -> None:
    """Scale and ticks; a list has its names instead of numbers."""
    one = axes.xaxis if along == "x" else axes.yaxis
    (axes.set_xscale if along == "x" else axes.set_yscale)("log" if axis.log else "linear")
    if axis.ticks:
        one.set_major_locator(FixedLocator(list(range(len(axis.ticks)))))
        one.set_major_formatter(
            FuncFormatter(lambda at, _: axis.ticks[round(at)] if 0 <= round(at) < len(axis.ticks) else "")
        )
        one.set_minor_locator(NullLocator())
        axes.tick_params(axis=along, length=0.0)
        if along == "x":
            for name in axes.get_xticklabels():
                name.set(rotation=SLANT, ha="right", rotation_mode="anchor")
    else:
        if axis.log:
            one.set_major_locator(LogLocator(numticks=20))
            one.set_minor_locator(LogLocator(subs=(2.0, 5.0), numticks=40))
            one.set_minor_formatter(NullFormatter())
        else:
            one.set_major_locator(MaxNLocator(nbins=ticks, integer=axis.whole, steps=(1, 2, 2.5, 5, 10)))
        one.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
        axes.grid(visible=True, axis=along)
