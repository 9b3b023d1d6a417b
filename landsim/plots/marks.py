"""The parts of a chart as matplotlib draws them: series, limits, regions."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from landsim.charts.extent import extent, tint
from landsim.charts.model import (
    COLOURS,
    Band,
    Cells,
    Curve,
    Limit,
    Mark,
    Numbers,
    Panel,
    Points,
    Region,
    Series,
    Step,
)
from landsim.plots.style import BLACK

DASHES: dict[str, Any] = {
    "solid": "-",
    "dash": (0, (5.0, 2.0)),
    "dot": (0, (1.0, 1.3)),
    "dashdot": (0, (5, 1.5, 1, 1.5)),
}
MARKS: dict[Mark, dict[str, Any]] = {
    "dot": {"marker": "o", "mew": 0.0},
    "cross": {"marker": "x", "mew": 0.9},
    "ring": {"marker": "o", "mew": 0.8, "mfc": "none"},
    "diamond": {"marker": "D", "mew": 0.8, "mfc": "none"},
    "square": {"marker": "s", "mew": 0.0},
    "triangle": {"marker": "^", "mew": 0.8, "mfc": "none"},
    "none": {"marker": ""},
}
CLEAR: dict[str, Any] = {"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.6}
"""Behind a name within a panel: no line runs through it."""
DRAWN: dict[Step, Any] = {"": "default", "before": "steps-pre", "after": "steps-post"}
FILLED: dict[Step, Any] = {"": None, "before": "pre", "after": "post"}


def draw_series(axes: Axes, series: Series) -> Artist:
    """Draw a series and return what stands for it in a legend."""
    if isinstance(series, Cells):
        return _cells(axes, series)
    colour = COLOURS[series.tone]
    if isinstance(series, Curve):
        return axes.plot(
            _array(series.x), _array(series.y), color=colour, lw=series.width, ls=DASHES[series.dash],
            drawstyle=DRAWN[series.step], zorder=3.0,
        )[0]  # fmt: skip
    if isinstance(series, Band):
        return axes.fill_between(
            _array(series.x), _array(series.low), _array(series.high), color=colour, alpha=series.strength, lw=0.0,
            step=FILLED[series.step], zorder=1.5,
        )  # fmt: skip
    if isinstance(series, Points):
        return _points(axes, series, colour)
    if series.filled:
        return axes.stairs(series.heights, series.edges, color=colour, alpha=0.35, fill=True, lw=0.0, zorder=2.0)
    return axes.stairs(series.heights, series.edges, color=colour, lw=1.2, ls=DASHES[series.dash], zorder=3.0)


def _points(axes: Axes, series: Points, colour: str) -> Artist:
    x, y = _array(series.x), _array(series.y)
    drawn: Artist | None = None
    for bar, (low, high) in (("x", series.x_bar or ((), ())), ("y", series.y_bar or ((), ()))):
        if len(low):
            lines = axes.hlines if bar == "x" else axes.vlines
            drawn = lines(
                y if bar == "x" else x,
                _array(low),
                _array(high),
                color=colour,
                lw=series.bar_width,
                zorder=2.6 if series.mark == "none" else 3.2,
            )
    if series.mark == "none" and drawn is not None:
        return drawn
    look = {"color": colour, "mec": colour, "ms": series.size, **MARKS[series.mark]}
    return axes.plot(x, y, ls="none", zorder=3.5, **look)[0]


def _cells(axes: Axes, cells: Cells) -> Artist:
    """Tints of the numbers, with their texts; a cell without a number stays white."""
    values = np.array([_array(row) for row in cells.values])
    rgb = np.array(
        [[[int(tint(value)[i : i + 2], 16) / 255.0 for i in (1, 3, 5)] for value in row] for row in cells.values]
    )
    image = axes.imshow(rgb, aspect="auto", interpolation="nearest", zorder=1.0)
    for row, line in enumerate(cells.texts):
        for column, text in enumerate(line):
            dark = abs(values[row, column]) > 0.75
            axes.text(column, row, text, ha="center", va="center", fontsize=6.5, color="white" if dark else BLACK)
    return image


def draw_limit(axes: Axes, limit: Limit) -> None:
    """A line right across the panel; the name of a horizontal one is inside it."""
    look: dict[str, Any] = {"color": COLOURS[limit.tone], "lw": 1.0, "ls": DASHES[limit.dash], "zorder": 2.8}
    if limit.along == "x":
        axes.axvline(limit.at, **look)
        return
    axes.axhline(limit.at, **look)
    axes.annotate(
        limit.label, (1.0, limit.at), xycoords=axes.get_yaxis_transform(), xytext=(-2.0, 1.5),
        textcoords="offset points", ha="right", va="bottom", fontsize=7.0, color=COLOURS[limit.tone], zorder=4.0,
        bbox=CLEAR,
    )  # fmt: skip


def draw_region(axes: Axes, panel: Panel, region: Region) -> None:
    """A rectangle with its name above it."""
    (x0, x1), (y0, y1) = _ends(region.x, extent(panel, "x")), _ends(region.y, extent(panel, "y"))
    colour = COLOURS[region.tone]
    if region.fill:
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fc=colour, ec="none", alpha=region.fill, zorder=0.5))
    if region.outline:
        axes.add_patch(
            Rectangle((x0, y0), x1 - x0, y1 - y0, fc="none", ec=colour, lw=1.1, ls=DASHES[region.dash], zorder=2.9)
        )
    if region.label:
        axes.annotate(
            region.label, (x0, y1), xytext=(0.0, 2.0), textcoords="offset points", ha="left", va="bottom", fontsize=7.0,
            color=colour, zorder=4.0, bbox=CLEAR,
        )  # fmt: skip


def _ends(own: tuple[float | None, float | None], panel: tuple[float, float]) -> tuple[float, float]:
    """From where to where a region is: its own ends, or the panel's where it has none."""
    low, high = (end if value is None else value for value, end in zip(own, sorted(panel), strict=True))
    return low, high


def _array(values: Numbers) -> Any:
    return np.array([np.nan if value is None else value for value in values], dtype=float)
