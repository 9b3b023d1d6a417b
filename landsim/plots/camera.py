"""What the camera saw."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from landsim.log import ENDS, LINES
from landsim.metrics import Array, Log
from landsim.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    PALE,
    STYLE,
    VERMILION,
    failure,
    handed_over,
    legend_in_head,
    lines_seen,
    new_figure,
    note,
    number,
    until_shortly_after,
)

if TYPE_CHECKING:
    from landsim.config import Scenario

MOMENTS = 6
FLATTEST, TALLEST = 0.3, 0.8
"""Height over width of an image as drawn; one beyond is not drawn to scale."""
COUNTS = ("no line", "one line", "two lines", "three lines")
NEAR = 10.0
"""A frame within this of a round distance is named after it, m."""
LOW = 7.0
"""Wheels below this are near the ground, m."""
ANOTHER = "#eaa47f"
"""Of a line that stands for a painted one."""
LINE_STYLES: dict[str, dict[str, Any]] = {
    "left": {"color": BLUE, "lw": 1.3},
    "threshold": {"color": VERMILION, "lw": 1.3, "ls": (0, (4, 2))},
    "right": {"color": GREEN, "lw": 1.3, "ls": (0, (1.5, 1.2))},
}


@rc_context(STYLE)
def camera_views(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """The image at six moments, with the painted lines and the measured ones, and below it how far they are apart.

    An edge's offset is to the right, the threshold's down.
    """
    figure = new_figure((10.0, 9.6), "what the camera saw, and by how much it misread the lines", metrics)
    log = until_shortly_after(log, failure(log, scenario, metrics))
    moments = _moments(log, metrics)
    if not moments:
        axes = figure.add_axes((0.08, 0.1, 0.84, 0.75))
        axes.set_axis_off()
        note(axes, "the camera reported no line" if log["time_s"].size else "there was no flight")
        return figure
    offsets = [_offsets(log, row) for _, row in moments]
    worst = max([0.5, *(float(np.abs(y).max()) for lines in offsets for _, y in lines.values())])
    blocks = figure.add_gridspec(2, 3, left=0.07, right=0.985, top=0.85, bottom=0.035, hspace=0.26, wspace=0.24)
    named: dict[str, Any] = {}
    for i, (name, row) in enumerate(moments):
        column = i % 3
        block = blocks[i // 3, column].subgridspec(2, 1, hspace=0.38, height_ratios=(2.5, 1.0))
        image, residual = figure.add_subplot(block[0]), figure.add_subplot(block[1])
        _image(image, log, row, scenario)
        _residuals(residual, offsets[i], worst)
        image.set_title(f"{name}: {log['time_s'][row]:.2f} s\n{_seen(log, row)}\n{_where(log, row)}", fontsize=8.8)
        if column == 0:
            image.set_ylabel("v, px")
            residual.set_ylabel("offset, px")
        for axes in (image, residual):
            axes.yaxis.set_label_coords(-0.17, 0.5)
        for drawn in (image, residual):
            named |= {label: handle for handle, label in zip(*drawn.get_legend_handles_labels(), strict=True)}
    legend_in_head(figure, list(named.values()), list(named), markerscale=1.0)
    return figure


def _seen(log: Log, row: int) -> str:
    """How many lines were seen, which of them is another one, and whether the filter refused them."""
    count = sum(bool(seen[row]) for seen in lines_seen(log).values())
    wrong = [f", {line} wrong" for i, line in enumerate(LINES) if _is_wrong(log, i, row)]
    return "".join((COUNTS[count], *wrong, ", rejected" if log["accepted"][row] == 0.0 else ""))


def _is_wrong(log: Log, line: int, row: int) -> bool:
    """Whether what stands for a line is another one: at fault, and seen for all that."""
    return log["fault"][row] == line + 1 and bool(np.isfinite(_ends(log, LINES[line], "seen", row)).all())


def _where(log: Log, row: int) -> str:
    along, height = float(log["true_along_m"][row]), float(log["true_height_m"][row])
    return f"{abs(along):.0f} m {'before' if along < 0.0 else 'past'} the threshold, {number(height, '.1f')} m up"


def _moments(log: Log, metrics: dict[str, Any]) -> list[tuple[str, int]]:
    """Up to six frames in which lines were seen, spread over the flight, named, in order, each once."""
    frames = np.flatnonzero(np.any(list(lines_seen(log).values()), axis=0))
    if not frames.size:
        return []
    along, time, wheels = log["true_along_m"][frames], log["time_s"][frames], log["wheel_height_m"][frames]
    touched = math.inf if metrics["touchdown"] is None else metrics["touchdown"]["time_s"]
    wanted = [("first lines", int(frames[0]))]
    wrong = [row for row in frames.tolist() if any(_is_wrong(log, i, row) for i in range(len(LINES)))]
    if wrong:
        wanted.append(("a line is wrong", wrong[len(wrong) // 2]))
    for distance in (600.0, 200.0):
        nearest = int(np.argmin(np.abs(along + distance)))
        if abs(along[nearest] + distance) <= NEAR:
            wanted.append((f"{distance:g} m to go", int(frames[nearest])))
    late = handed_over(log)
    before = frames[frames < late] if late is not None else frames[:0]
    if before.size:
        wanted.append(("last before hand-over", int(before[-1])))
    low = np.flatnonzero((wheels < LOW) & (time < touched))
    if low.size:
        middle = int(low[low.size // 2])
        wanted.append((f"wheels {number(float(wheels[middle]), '.1f')} m up", int(frames[middle])))
    rolling = frames[time > touched]
    if rolling.size:
        wanted.append(("on the ground", int(rolling[rolling.size // 2])))
    chosen: dict[int, str] = {}
    spread = frames[np.linspace(frames.size - 1, 0, MOMENTS).round().astype(int)]
    for name, row in (*wanted, ("last lines", int(frames[-1])), *(("on the way", int(row)) for row in spread)):
        if len(chosen) < MOMENTS:
            chosen.setdefault(row, name)
    return sorted(((name, row) for row, name in chosen.items()), key=lambda moment: moment[1])


def _ends(log: Log, line: str, kind: str, row: int) -> Array:
    """Both ends of a line, (2, 2): u, v of each, px."""
    return np.array([log[f"{line}_{kind}_{end}"][row] for end in ENDS]).reshape(2, 2)


def _image(axes: Axes, log: Log, row: int, scenario: "Scenario") -> None:
    """The image frame with its lines; where they fill little of it, they are enlarged in a corner."""
    width, height = scenario.camera.width_px, scenario.camera.height_px
    shape = min(max(height / width, FLATTEST), TALLEST)
    axes.set_box_aspect(shape)
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.grid(visible=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)
    for spine in axes.spines.values():
        spine.set(linewidth=0.5, color=GREY)  # a line along the image's edge must show beside it
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(3, integer=True))
    to_scale = shape == height / width
    axes.set_xlabel("u, px" if to_scale else "not to scale; u, px", labelpad=1.0)
    axes.plot(0.5 * (width - 1), 0.5 * (height - 1), "+", color=GREY, ms=9, mew=0.9, label="principal point")
    ends = np.array([_ends(log, line, kind, row) for line in LINES for kind in ("true", "seen")]).reshape(-1, 2)
    ends = ends[np.isfinite(ends).all(axis=1)]
    _draw_lines(axes, log, row)
    if not ends.size:
        return
    low, high = ends.min(axis=0), ends.max(axis=0)
    centre, reach = 0.5 * (low + high), 0.58 * float(max(high[0] - low[0], high[1] - low[1]))
    if to_scale and reach < 0.2 * height:
        left = 0.64 if centre[0] < 0.6 * width else 0.015
        inset = axes.inset_axes((left, 0.02, 0.345, 0.345 * width / height))
        inset.set_xlim(centre[0] - reach, centre[0] + reach)
        inset.set_ylim(centre[1] + reach, centre[1] - reach)
        inset.set_xticks([])
        inset.set_yticks([])
        inset.grid(visible=False)
        for spine in inset.spines.values():
            spine.set_visible(True)
            spine.set_color(GREY)
        _draw_lines(inset, log, row)
        axes.indicate_inset_zoom(inset, edgecolor=GREY)


def _draw_lines(axes: Axes, log: Log, row: int) -> None:
    """Painted lines, one that stands for one of them, and measured ones, over the frame's edge too: they end there."""
    for i, line in enumerate(LINES):
        true, seen = _ends(log, line, "true", row), _ends(log, line, "seen", row)
        wrong = _is_wrong(log, i, row)
        axes.plot(
            *true.T, color=ANOTHER if wrong else PALE, lw=4.0, ls=(0, (1.2, 0.6)) if wrong else "-",
            solid_capstyle="butt", clip_on=False, zorder=2.6, label="another line" if wrong else "painted line",
        )  # fmt: skip
        axes.plot(
            *seen.T, color=BLACK, lw=1.0, ls=(0, (4, 2)), marker=".", ms=4.0, clip_on=False, zorder=2.7,
            label="measured",
        )  # fmt: skip


def _offsets(log: Log, row: int) -> dict[str, tuple[Array, Array]]:
    """Where along a painted line the ends of the measured one are (0 to 1), and how far off it they are, px.

    An edge's offset is to the right, the threshold's down.  A line that was not seen is left out, and so is one for
    which another was taken.
    """
    result = {}
    for i, line in enumerate(LINES):
        if _is_wrong(log, i, row):
            continue
        true, seen = _ends(log, line, "true", row), _ends(log, line, "seen", row)
        length = float(np.hypot(*(true[1] - true[0])))
        if not (np.isfinite(seen).all() and length > 0.0):
            continue
        along = (true[1] - true[0]) / length
        normal = np.array([-along[1], along[0]])
        normal *= math.copysign(1.0, normal[1] if line == "threshold" else normal[0])
        result[line] = (seen - true[0]) @ along / length, (seen - true[0]) @ normal
    return result


def _residuals(axes: Axes, offsets: dict[str, tuple[Array, Array]], worst: float) -> None:
    """How far a measured line is from the painted one, along it, on a scale that holds ``worst``."""
    for line, style in LINE_STYLES.items():
        axes.plot(*offsets.get(line, ([], [])), **style, marker="o", ms=3.0, label=f"offset of {line}")
    axes.set_xlim(-0.04, 1.04)
    axes.set_ylim(-1.15 * worst, 1.15 * worst)
    axes.set_xticks([0.0, 1.0], ["near / left end", "far / right end"])
    first, last = axes.get_xticklabels()
    first.set_horizontalalignment("left")
    last.set_horizontalalignment("right")
    axes.axhline(0.0, color=GREY, lw=0.8)
