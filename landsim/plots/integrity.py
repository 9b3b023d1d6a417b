"""What navigation said of itself: how far off it may be, which lines it took, and its alarms."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from landsim.alarms import PROTECTED
from landsim.log import LINES
from landsim.metrics import Array, Log, error
from landsim.plots.style import (
    BLACK,
    BLUE,
    LIMIT,
    PALE,
    STYLE,
    VERMILION,
    distance_axis,
    event_times,
    failure,
    largest,
    legend_in_head,
    mark,
    new_figure,
    note,
    span,
    thinned,
    until_shortly_after,
)
from landsim.state import Alarm

if TYPE_CHECKING:
    from landsim.config import Scenario

LEAST = 1e-3
"""Least error drawn, m."""
ALARMS = tuple(kind for kind in Alarm if kind)
BARS: dict[str, dict[str, Any]] = {
    "seen": {"color": PALE, "height": 0.76},
    "believed": {"color": BLUE, "height": 0.42},
    "missing or another one": {"fc": "none", "ec": VERMILION, "height": 0.76, "hatch": "////", "lw": 0.9},
    "alarm": {"color": VERMILION, "height": 0.6},
}


@rc_context(STYLE)
def integrity(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """Errors across and in height beside the protection levels that were stated, lines by line, and alarms, over time.

    The levels are those that guidance was given; a limit is that of the go-around, where it is enabled.
    """
    figure = new_figure((10.0, 8.6), "integrity: what navigation said of itself, and how far off it was", metrics)
    grid = figure.add_gridspec(
        4, 1, left=0.12, right=0.985, top=0.8, bottom=0.065, hspace=0.2, height_ratios=(3.0, 3.0, 1.5, 1.5)
    )
    failed = failure(log, scenario, metrics)
    log = until_shortly_after(log, failed)
    time, few = log["time_s"], thinned(log)
    marks = event_times(log, metrics, failed)
    go_around = scenario.go_around
    limits = {"lateral": go_around.lateral_limit_m, "vertical": go_around.vertical_limit_m}
    handles: dict[str, Any] = {}
    for i in range(4):
        axes = figure.add_subplot(grid[i])
        axes.set_xlim(*span(time, (0.0, 1.0)))
        levels = mark(axes, marks if i == 0 else [(where, "") for where, _ in marks])
        if i == 0:
            distance_axis(axes, log, levels)
        if i < 2:
            name, quantity = list(PROTECTED.items())[i]
            _level(axes, log, few, name, quantity, limits[name] if go_around.enabled else None)
            axes.set_ylabel(f"{name}, m")
        elif i == 2:
            _lines(axes, log)
        else:
            _alarms(axes, log)
        axes.yaxis.set_label_coords(-0.085, 0.5)
        axes.tick_params(labelbottom=i == 3)
        for handle, of in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(of, handle)
    axes.set_xlabel("time, s")
    legend_in_head(figure, list(handles.values()), list(handles))
    return figure


def _level(axes: Axes, log: Log, few: Log, name: str, quantity: str, limit: float | None) -> None:
    """The magnitude of an error beside the level that it was said to keep within."""
    off, level = np.abs(error(log, "fused", quantity)), log[f"{name}_protection_m"]
    drawn, stated = np.abs(error(few, "fused", quantity)), few[f"{name}_protection_m"]
    with np.errstate(invalid="ignore"):
        beyond = np.flatnonzero(off > level)
    axes.plot(few["time_s"], np.maximum(drawn, LEAST), color=BLUE, lw=0.8, label="error")
    axes.plot(few["time_s"], stated, color=BLACK, lw=1.4, label="protection level")
    if beyond.size:
        some = beyond[:: max(1, beyond.size // 200)]
        axes.plot(
            log["time_s"][some], np.maximum(off[some], LEAST), color=VERMILION, ls="none", marker="x", ms=4.0, mew=0.9,
            label="error beyond it",
        )  # fmt: skip
    if limit is not None:
        axes.axhline(limit, **LIMIT, label="go-around above")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_locator(LogLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    top = max(largest(off), largest(level), 0.0 if limit is None else limit)
    if top == 0.0:
        note(axes, "navigation never started")
        axes.set_yticks([])
        return
    if not np.isfinite(level).any():
        note(axes, "no protection level was stated")
    small = off[np.isfinite(off) & (off > 0.0)]
    low = float(np.quantile(small, 0.05)) if small.size else LEAST
    axes.set_ylim(max(LEAST, min(low, 0.02 * top)), 2.0 * max(top, 10.0 * LEAST))


def _lines(axes: Axes, log: Log) -> None:
    """When each line was seen and believed, and when it was at fault."""
    found, believed = (np.nan_to_num(log[f"lines_{kind}"]).astype(int) for kind in ("found", "believed"))
    faults = np.flatnonzero(np.isfinite(log["fault"]))
    fault = np.zeros(log["time_s"].size, dtype=int)
    if faults.size:  # it holds from capture to capture
        fault[faults[0] :] = np.repeat(log["fault"][faults].astype(int), np.diff(np.append(faults, fault.size)))
    for place, line in enumerate(reversed(LINES)):
        i = LINES.index(line)
        _bars(axes, log["time_s"], (found & (1 << i)) != 0, place, "seen")
        _bars(axes, log["time_s"], (believed & (1 << i)) != 0, place, "believed")
        _bars(axes, log["time_s"], fault == i + 1, place, "missing or another one")
    _names(axes, tuple(reversed(LINES)))
    if not found.any():
        note(axes, "none was seen")


def _alarms(axes: Axes, log: Log) -> None:
    """When each alarm stood."""
    standing = np.nan_to_num(log["alarm"]).astype(int)
    for place, kind in enumerate(reversed(ALARMS)):
        _bars(axes, log["time_s"], (standing & kind) != 0, place, "alarm")
    _names(axes, tuple(str(kind.name).lower().replace("_", " ") for kind in reversed(ALARMS)))
    if not standing.any():
        note(axes, "none stood")


def _bars(axes: Axes, time: Array, rows: NDArray[np.bool_], place: int, what: str) -> None:
    """A bar for each time in which something held."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], rows, [False]))))
    ends = np.append(time, 2.0 * time[-1] - time[-2] if time.size > 1 else math.nan)
    pieces = [(float(ends[a]), float(ends[b] - ends[a])) for a, b in edges.reshape(-1, 2)]
    style = dict(BARS[what])
    height = style.pop("height")
    axes.broken_barh(pieces, (place - 0.5 * height, height), label=what if pieces else None, **{"lw": 0.0} | style)


def _names(axes: Axes, names: tuple[str, ...]) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0.0)
