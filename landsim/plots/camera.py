"""What the camera saw."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from landsim.log import ENDS, LINES
from landsim.metrics import Array, Log
from landsim.plots.style import BLACK, BLUE, GREEN, GREY, PALE, STYLE, VERMILION, legend_in_head, new_figure, note
from landsim.state import Phase, Stage

if TYPE_CHECKING:
    from landsim.config import Scenario

MOMENTS = 6
STAGE_NAMES = {Stage.NONE: "no lines", Stage.EARLY: "three lines", Stage.LATE: "two lines"}
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
    figure = new_figure((10.0, 8.7), "what the camera saw, and by how much it misread the lines", metrics)
    moments = _moments(log)
    if not moments:
        axes = figure.add_axes((0.08, 0.1, 0.84, 0.75))
        axes.set_axis_off()
        note(axes, "the camera reported no line")
        return figure
    blocks = figure.add_gridspec(2, 3, left=0.06, right=0.985, top=0.845, bottom=0.045, hspace=0.22, wspace=0.2)
    for i, (name, row) in enumerate(moments):
        column = i % 3
        block = blocks[i // 3, column].subgridspec(2, 1, hspace=0.28, height_ratios=(2.55, 1.0))
        image, residual = figure.add_subplot(block[0]), figure.add_subplot(block[1])
        _image(image, log, row, scenario)
        _residuals(residual, log, row)
        stage = STAGE_NAMES[Stage(int(log["stage"][row]))]
        place = (
            f"{-log['true_along_m'][row]:.0f} m before"
            if log["true_along_m"][row] < 0.0
            else f"{log['true_along_m'][row]:.0f} m past"
        )
        image.set_title(
            f"{name}: {log['time_s'][row]:.2f} s, {stage}\n{place} the threshold, {log['true_height_m'][row]:.1f} m up",
            fontsize=8.8,
        )
        if column == 0:
            image.set_ylabel("v, px")
            residual.set_ylabel("offset, px")
        for axes in (image, residual):
            axes.yaxis.set_label_coords(-0.15, 0.5)
        if i == 0:
            handles, labels = image.get_legend_handles_labels()
            more, names = residual.get_legend_handles_labels()
            legend_in_head(figure, handles + more, labels + names, markerscale=1.0)
    return figure


def _moments(log: Log) -> list[tuple[str, int]]:
    """Up to six frames in which lines were seen, spread over the flight, named, in order, each once."""
    seen = np.isfinite(log["left_seen_u0"]) | np.isfinite(log["right_seen_u0"]) | np.isfinite(log["threshold_seen_u0"])
    frames = np.flatnonzero(seen)
    if not frames.size:
        return []
    along, phase = log["true_along_m"][frames], log["phase"][frames]
    late = np.flatnonzero(log["stage"][frames] == Stage.LATE)
    wanted = [("first lines", int(frames[0]))]
    wanted += [
        (f"{distance:g} m to go", int(frames[np.argmax(along >= -distance)]))
        for distance in (600.0, 200.0)
        if along[0] < -distance < along[-1]
    ]
    if late.size and late[0] > 0:
        wanted.append(("last before hand-over", int(frames[late[0] - 1])))
    for name, during in (("flare", phase == Phase.FLARE), ("rollout", phase >= Phase.ROLLOUT)):
        rows = frames[during]
        if rows.size:
            wanted.append((name, int(rows[rows.size // 2])))
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
    axes.set_aspect("equal")
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.grid(visible=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)
    axes.xaxis.set_major_locator(MultipleLocator(200.0))
    axes.yaxis.set_major_locator(MultipleLocator(200.0))
    axes.set_xlabel("u, px", labelpad=0.0)
    axes.plot(0.5 * (width - 1), 0.5 * (height - 1), "+", color=GREY, ms=9, mew=0.9, label="principal point")
    ends = np.array([_ends(log, line, kind, row) for line in LINES for kind in ("true", "seen")]).reshape(-1, 2)
    ends = ends[np.isfinite(ends).all(axis=1)]
    _draw_lines(axes, log, row)
    if not ends.size:
        return
    low, high = ends.min(axis=0), ends.max(axis=0)
    centre, reach = 0.5 * (low + high), 0.58 * float(max(high[0] - low[0], high[1] - low[1]))
    if reach < 0.2 * height:
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
    for i, line in enumerate(LINES):
        true, seen = _ends(log, line, "true", row), _ends(log, line, "seen", row)
        axes.plot(*true.T, color=PALE, lw=4.0, solid_capstyle="butt", label="painted line" if i == 0 else None)
        axes.plot(
            *seen.T, color=BLACK, lw=1.0, ls=(0, (4, 2)), marker=".", ms=4.0, label="measured" if i == 0 else None
        )


def _residuals(axes: Axes, log: Log, row: int) -> None:
    """How far a measured line is from the painted one, along it: to the right, or for the threshold down."""
    worst = 0.5
    for line, style in LINE_STYLES.items():
        true, seen = _ends(log, line, "true", row), _ends(log, line, "seen", row)
        length = float(np.hypot(*(true[1] - true[0])))
        if not (np.isfinite(seen).all() and length > 0.0):
            axes.plot([], [], **style, label=f"offset of {line}")
            continue
        along = (true[1] - true[0]) / length
        normal = np.array([-along[1], along[0]])
        normal *= math.copysign(1.0, normal[1] if line == "threshold" else normal[0])
        offsets = (seen - true[0]) @ normal
        axes.plot((seen - true[0]) @ along / length, offsets, **style, marker="o", ms=3.0, label=f"offset of {line}")
        worst = max(worst, float(np.abs(offsets).max()))
    axes.set_xlim(-0.04, 1.04)
    axes.set_ylim(-1.15 * worst, 1.15 * worst)
    axes.set_xticks([0.0, 1.0], ["near / left end", "far / right end"])
    first, last = axes.get_xticklabels()
    first.set_horizontalalignment("left")
    last.set_horizontalalignment("right")
    axes.axhline(0.0, color=GREY, lw=0.8)
