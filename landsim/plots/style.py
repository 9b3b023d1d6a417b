"""Colours, line styles and the parts that several pictures share."""

import math
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from landsim.log import LINES
from landsim.metrics import CRASHES, Array, Log, find_touchdown, main_wheels
from landsim.state import Phase

if TYPE_CHECKING:
    from landsim.config import Scenario

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
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
}
POINTS = 1500
"""A line in a picture needs no more."""
AFTERMATH_S = 3.0
"""A picture goes on for as long after a crash or after leaving the runway, s."""
LABEL_PT = 8.0
"""Size of the names of vertical marks."""
LEVEL_PT = 9.5
"""From one row of such names to the next."""


class Failure(NamedTuple):
    """What failed a flight at its wheels."""

    row: int
    """Of the log."""
    name: str
    sliding: bool
    """Not on the wheels, or not on the runway: what follows is no flight."""


def new_figure(size: tuple[float, float], what: str, metrics: dict[str, Any]) -> Figure:
    """An empty figure with its headline: what it shows, of which flight, and how that ended."""
    figure = Figure(figsize=size)
    inch = 1.0 / size[1]
    headline, ending = f"{metrics['scenario']}, seed {metrics['seed']}: {what}", _how_it_ended(metrics)
    for text, below, font, colour in ((headline, 0.12, 13.0, BLACK), (ending, 0.44, 9.5, "#404040")):
        room = 72.0 * 0.97 * size[0] / (0.56 * max(len(text), 1))  # a letter is about half as wide as its size
        figure.text(0.012, 1.0 - below * inch, text, va="top", fontsize=min(font, room), color=colour)
    return figure


def _how_it_ended(metrics: dict[str, Any]) -> str:
    """Outcome and reason, and for a landing whether it met the box and which limits it did not."""
    outcome = str(metrics["outcome"])
    if metrics["in_box"]:
        outcome += ", in the box"
    elif outcome == "landed":
        missed = [
            f"{name} = {number(limit['limit'])} with {number(limit['value'], '.2f')}"
            for name, limit in metrics["box"].items()
            if not limit["ok"]
        ]
        return f"{outcome}, outside the box: misses {', '.join(missed)}"
    reason = metrics["reason"]
    told = reason if outcome == "go_around" else f"{outcome}: {reason}"  # which says it
    return re.sub(r"(?<![\w.])-(?=\d)", "−", told)


def failure(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Failure | None:
    """Where a flight that crashed or left the runway did so; None for any other flight."""
    if metrics["outcome"] not in {"crashed", "off_runway"} or not log["time_s"].size:
        return None
    aircraft, runway = scenario.aircraft_config, scenario.runway
    touchdown = find_touchdown(log, aircraft)
    found = []
    nose = np.flatnonzero(log["wow_nose"] > 0.0)
    if nose.size and (touchdown is None or nose[0] <= touchdown.row):
        found.append(Failure(int(nose[0]), "crash", True))
    if metrics["end"] in CRASHES:
        found.append(Failure(log["time_s"].size - 1, "crash", True))
    if touchdown is not None:
        if touchdown.sink_rate > aircraft.gear.sink_limit_mps:
            found.append(Failure(touchdown.row, "crash", False))
        x, y = main_wheels(log, aircraft, slice(touchdown.row, None))
        off = np.flatnonzero((x < 0.0) | (x > runway.length_m) | (np.abs(y) > 0.5 * runway.width_m))
        if off.size:
            found.append(Failure(touchdown.row + int(off[0]), "off the runway", True))
    return min(found, key=lambda one: one.row, default=None)


def until_shortly_after(log: Log, failed: Failure | None) -> Log:
    """The log without what is no flight any more."""
    if failed is None or not failed.sliding:
        return log
    last = int(np.searchsorted(log["time_s"], log["time_s"][failed.row] + AFTERMATH_S, side="right"))
    return {name: values[:last] for name, values in log.items()}


def lines_seen(log: Log) -> dict[str, NDArray[np.bool_]]:
    """Whether each line was seen, a row each; False between frames."""
    return {line: np.isfinite(log[f"{line}_seen_u0"]) for line in LINES}


def handed_over(log: Log) -> int | None:
    """The first row with both edges and no threshold, after the last with all three; None if there is none."""
    seen = lines_seen(log)
    edges = seen["left"] & seen["right"]
    all_three = np.flatnonzero(edges & seen["threshold"])
    two = np.flatnonzero(edges & ~seen["threshold"])
    two = two[two > (all_three[-1] if all_three.size else -1)]
    return int(two[0]) if two.size else None


def event_times(log: Log, metrics: dict[str, Any], failed: Failure | None = None) -> list[tuple[float, str]]:
    """Hand-over from three lines to two, touchdown, go-around, the loss of all lines and a crash, by when they were."""
    time = log["time_s"]
    marks = []
    late = handed_over(log)
    if late is not None:
        marks.append((float(time[late]), "two lines"))
    if metrics["touchdown"] is not None:
        marks.append((metrics["touchdown"]["time_s"], "touchdown"))
    climbing = np.flatnonzero(log["phase"] == Phase.GO_AROUND)
    if climbing.size:
        marks.append((float(time[climbing[0]]), "go-around"))
    seen = np.flatnonzero(np.any(list(lines_seen(log).values()), axis=0))
    if seen.size and time[-1] - time[seen[-1]] > 1.0:
        marks.append((float(time[seen[-1]]), "no more lines"))
    if failed is not None:
        marks.append((float(time[failed.row]), failed.name))
    return marks


def usable_frames(log: Log) -> int | None:
    """If navigation never started, in how many frames the lines gave a whole pose; None if it did."""
    if np.isfinite(log["fused_along_m"]).any():
        return None
    return int(np.isfinite(log["vision_along_m"]).sum())


def never_started(frames: int) -> str:
    """What there is to say of such a flight."""
    return f"navigation never started: {frames} usable frame{'' if frames == 1 else 's'}"


def mark(axes: Axes, marks: Iterable[tuple[float, str]]) -> int:
    """Vertical lines with their names above the panel, where they hide nothing; returns how many rows of names.

    The limits along must be final: a name is kept within them, and a row up where it would meet another.
    """
    low, high = axes.get_xlim()
    width_pt, _ = _size_pt(axes)
    free: list[float] = []
    for where, name in sorted(marks):
        if not low <= where <= high:
            continue
        axes.axvline(where, color=GREY, lw=0.9, zorder=1.0)
        half = 0.5 * 0.58 * LABEL_PT * len(name) + 2.0
        at = (where - low) / (high - low) * width_pt
        middle = min(max(at, half), max(width_pt - half, half))
        level = next((i for i, end in enumerate(free) if middle - half >= end), len(free))
        free[level : level + 1] = [middle + half]
        axes.annotate(
            name, (where, 1.0), xycoords=axes.get_xaxis_transform(), xytext=(middle - at, 2.0 + LEVEL_PT * level),
            textcoords="offset points", ha="center", va="bottom", fontsize=LABEL_PT, color="#404040",
            bbox={"fc": "white", "ec": "none", "pad": 0.4}, annotation_clip=False,
        )  # fmt: skip
    return len(free)


def _size_pt(axes: Axes) -> tuple[float, float]:
    """Width and height of a panel, points."""
    figure, place = axes.get_figure(root=True), axes.get_position()
    if figure is None:
        raise ValueError("the panel is in no figure")
    return 72.0 * place.width * figure.get_figwidth(), 72.0 * place.height * figure.get_figheight()


def legend_above(axes: Axes, levels: int = 0, **how: Any) -> None:
    """A legend in one line above the panel and the names of its marks, at its right, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) > 1:
        _, height_pt = _size_pt(axes)
        base = 1.0 + LEVEL_PT * levels / height_pt
        axes.legend(handles, labels, loc="lower right", bbox_to_anchor=(1.0, base), ncols=len(handles), **how)


def legend_in_head(figure: Figure, handles: list[Any], labels: list[str], **how: Any) -> None:
    """One legend for all panels, in one line below the headline."""
    top = 1.0 - 0.72 / float(figure.get_figheight())
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.008, top), ncols=len(handles), **how)


def foot_of_head(figure: Figure, text: str) -> None:
    """A few words on all panels, at the right of the line with the legend."""
    top = 1.0 - 0.76 / float(figure.get_figheight())
    figure.text(0.985, top, text, ha="right", va="top", fontsize=8.5, color="#404040")


def note(axes: Axes, text: str) -> None:
    """A few words in the middle of a panel."""
    axes.text(
        0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#404040",
        bbox={"fc": "white", "ec": "none", "pad": 2.0},
    )  # fmt: skip


def number(value: float, how: str = "g") -> str:
    """A number in a text, with the minus sign of the axes."""
    return f"{value:{how}}".replace("-", "−")


def signed(value: float, digits: int) -> str:
    """A number with its sign, but zero without one."""
    text = f"{value:+.{digits}f}"
    return text[1:] if float(text) == 0.0 else text.replace("-", "−")


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


def distance_axis(axes: Axes, log: Log, levels: int) -> None:
    """Ticks above the panel, and above the names of its marks, where the camera passes round distances."""
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
    top.set_xticks(np.interp(ticks, passed, time), [number(tick) for tick in ticks])
    top.tick_params(length=2.5, pad=1.0)
    top.spines["top"].set_visible(True)
    top.spines["top"].set_position(("outward", 3.0 + LEVEL_PT * levels))
    top.set_xlabel("camera along the runway from the threshold, m", fontsize=8.5, labelpad=3.0)
