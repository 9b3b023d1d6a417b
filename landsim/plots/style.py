"""Colours, line styles and the parts that several pictures share."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from landsim.metrics import Array, Log
from landsim.state import Stage

BLACK, GREY, PALE = "#000000", "#7f7f7f", "#d9d9d9"
BLUE, SKY, ORANGE, VERMILION, GREEN = "#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#009E73"
TRUE: dict[str, Any] = {"color": BLACK, "lw": 1.6, "label": "true"}
FUSED: dict[str, Any] = {"color": BLUE, "lw": 1.2, "ls": (0, (5, 2)), "label": "fused"}
VISION: dict[str, Any] = {
    "color": ORANGE, "ls": "none", "marker": ".", "ms": 2.5, "mew": 0.0, "label": "vision", "zorder": 1.5
}  # fmt: skip
COMMAND: dict[str, Any] = {"color": VERMILION, "lw": 1.2, "ls": (0, (4, 2)), "label": "command"}
LIMIT: dict[str, Any] = {"color": GREEN, "lw": 1.0, "ls": (0, (1, 1.5))}
STYLE: Any = {
    "font.size": 9.5,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.borderpad": 0.0,
    "legend.borderaxespad": 0.3,
    "legend.handlelength": 2.4,
    "legend.markerscale": 3.0,
    "legend.columnspacing": 1.4,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.xmargin": 0.0,
}
POINTS = 1500
"""A line in a picture needs no more."""


def new_figure(size: tuple[float, float], what: str, metrics: dict[str, Any]) -> Figure:
    """An empty figure with its headline: what it shows, of which flight, and how that ended."""
    figure = Figure(figsize=size)
    inch = 1.0 / size[1]
    figure.text(
        0.012, 1.0 - 0.12 * inch, f"{metrics['scenario']}, seed {metrics['seed']}: {what}", va="top", fontsize=13.0
    )
    figure.text(0.012, 1.0 - 0.44 * inch, _how_it_ended(metrics), va="top", fontsize=9.5, color="#404040")
    return figure


def _how_it_ended(metrics: dict[str, Any]) -> str:
    """Outcome and reason, and for a landing whether it met the box and which limits it did not."""
    outcome = str(metrics["outcome"])
    if metrics["in_box"]:
        outcome += ", in the box"
    elif outcome == "landed":
        missed = [
            f"{name} = {limit['limit']:g} with {limit['value']:.2f}"
            for name, limit in metrics["box"].items()
            if not limit["ok"]
        ]
        return f"{outcome}, outside the box: misses {', '.join(missed)}"
    return f"{outcome}: {metrics['reason']}"


def event_times(log: Log, metrics: dict[str, Any]) -> list[tuple[float, str]]:
    """Hand-over, touchdown and the loss of all lines, by when they were."""
    time, stage = log["time_s"], log["stage"]
    marks = []
    late = np.flatnonzero(stage == Stage.LATE)
    if late.size:
        marks.append((float(time[late[0]]), "two lines"))
    if metrics["touchdown"] is not None:
        marks.append((metrics["touchdown"]["time_s"], "touchdown"))
    seen = np.flatnonzero(stage != Stage.NONE)
    if seen.size and time[-1] - time[seen[-1]] > 1.0:
        marks.append((float(time[seen[-1]]), "no more lines"))
    return marks


def mark(axes: Axes, marks: Iterable[tuple[float, str]]) -> None:
    """Vertical lines with their names along them, at the top."""
    for where, name in marks:
        axes.axvline(where, color=GREY, lw=0.9, zorder=1.0)
        axes.annotate(
            name, (where, 0.97), xycoords=axes.get_xaxis_transform(), xytext=(-2.0, 0.0), textcoords="offset points",
            rotation=90.0, ha="right", va="top", fontsize=8.0, color="#404040",
            bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 0.6}, zorder=1.8,
        )  # fmt: skip


def legend_above(axes: Axes, **how: Any) -> None:
    """A legend in one line above the panel, at its right, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) > 1:
        axes.legend(handles, labels, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles), **how)


def legend_in_head(figure: Figure, handles: list[Any], labels: list[str], **how: Any) -> None:
    """One legend for all panels, in one line below the headline."""
    top = 1.0 - 0.72 / float(figure.get_figheight())
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.008, top), ncols=len(handles), **how)


def note(axes: Axes, text: str) -> None:
    """A few words in the middle of a panel."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#404040")


def signed(value: float, digits: int) -> str:
    """A number with its sign, but zero without one."""
    text = f"{value:+.{digits}f}"
    return text[1:] if float(text) == 0.0 else text


def thinned(log: Log) -> dict[str, Array]:
    """Every so many rows of a log, and its last."""
    n = log["time_s"].size
    every = max(1, n // POINTS)
    rows = np.unique(np.append(np.arange(0, n, every), n - 1)) if n else np.arange(0)
    return {name: values[rows] for name, values in log.items()}


def span(values: Array, otherwise: tuple[float, float]) -> tuple[float, float]:
    """Least and largest of the finite values, if they differ."""
    finite = values[np.isfinite(values)]
    if not finite.size or not float(np.ptp(finite)) > 0.0:
        return otherwise
    return float(finite.min()), float(finite.max())


def largest(values: Array) -> float:
    """Largest finite value, or 0."""
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def distance_axis(axes: Axes, log: Log) -> None:
    """Ticks above the panel where the camera passes round distances from the threshold."""
    along, time = log["true_along_m"], log["time_s"]
    if along.size < 2:
        return
    passed = np.maximum.accumulate(along)
    begin, end = float(passed[0]), float(passed[-1])
    step = next((s for s in (50.0, 100.0, 200.0, 500.0, 1000.0) if (end - begin) / s <= 10.0), 2000.0)
    ticks = np.arange(math.ceil(begin / step), math.floor(end / step) + 1) * step
    top = axes.twiny()
    top.grid(visible=False)
    top.set_xlim(axes.get_xlim())
    top.set_xticks(np.interp(ticks, passed, time), [f"{tick:g}".replace("-", "−") for tick in ticks])
    top.tick_params(length=2.5, pad=1.0)
    top.spines["top"].set_visible(True)
    top.set_xlabel("along the runway from the threshold, m", fontsize=8.5, labelpad=3.0)
