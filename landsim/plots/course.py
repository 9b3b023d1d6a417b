"""Where it flew."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from landsim.metrics import Log
from landsim.plots.style import (
    BLACK,
    BLUE,
    FUSED,
    GREEN,
    GREY,
    LIMIT,
    STYLE,
    TRUE,
    VERMILION,
    VISION,
    largest,
    legend_above,
    mark,
    new_figure,
    note,
    signed,
    span,
    thinned,
)
from landsim.state import Phase
from landsim.units import DEG

if TYPE_CHECKING:
    from landsim.config import Scenario

GLIDE_SLOPE_HALF_SCALE = 0.12
"""Half of an ILS needle's travel, as a share of the glide-slope angle: ICAO Annex 10, volume I, 3.1.5.6.2."""


@rc_context(STYLE)
def profile_and_plan(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """Where it flew: from the side against the glide slope, from above against the runway, and the flare enlarged."""
    figure = new_figure((10.0, 9.2), "profile and plan", metrics)
    grid = figure.add_gridspec(
        3, 1, left=0.075, right=0.985, top=0.895, bottom=0.06, hspace=0.36, height_ratios=(1.15, 1.0, 1.0)
    )
    side, plan, flare = (figure.add_subplot(grid[i]) for i in range(3))
    few = thinned(log)
    x = few["true_along_m"]
    begin, end = span(x, (-1000.0, 500.0))
    for axes, quantity in ((side, "height_m"), (plan, "cross_m")):
        axes.plot(log["vision_along_m"], log[f"vision_{quantity}"], **VISION)
        axes.plot(x, few[f"true_{quantity}"], **TRUE)
        axes.plot(few["fused_along_m"], few[f"fused_{quantity}"], **FUSED)
        axes.set_xlim(begin - 20.0, end + 40.0)
    _side_view(side, few, scenario, begin)
    _plan_view(plan, few, scenario, (begin - 20.0, end + 40.0))
    _flare_view(flare, log, scenario, metrics)
    for axes in (side, plan):
        _mark_along(axes, log, metrics)
    return figure


def _side_view(axes: Axes, log: Log, scenario: "Scenario", begin: float) -> None:
    aim, slope_deg = scenario.approach.aim_point_m, scenario.approach.glide_slope_deg
    x = np.array([begin, aim])
    axes.plot(
        x, (aim - x) * math.tan(slope_deg * DEG), color=GREEN, lw=1.0, ls="-.", label=f"{slope_deg:g}° glide slope"
    )
    for sign, label in ((1.0, f"± {GLIDE_SLOPE_HALF_SCALE * slope_deg:.2f}° (ILS half scale)"), (-1.0, None)):
        limit_deg = slope_deg * (1.0 + sign * GLIDE_SLOPE_HALF_SCALE)
        axes.plot(x, (aim - x) * math.tan(limit_deg * DEG), **LIMIT, label=label)
    limit_at_begin = (aim - begin) * math.tan((1.0 + GLIDE_SLOPE_HALF_SCALE) * slope_deg * DEG)
    top = 1.05 * max(1.1 * largest(log["true_height_m"]), limit_at_begin, 10.0)
    axes.add_patch(Rectangle((0.0, -0.05 * top), scenario.runway.length_m, 0.05 * top, color=GREY, lw=0.0))
    axes.set_ylim(-0.05 * top, top)
    axes.set_title("From the side, heights exaggerated")
    axes.set_ylabel("height of the camera, m")
    axes.set_xlabel("camera along the runway from the threshold, m")
    legend_above(axes)


def _plan_view(axes: Axes, log: Log, scenario: "Scenario", span: tuple[float, float]) -> None:
    runway, box = scenario.runway, scenario.box
    half = 0.5 * runway.width_m
    reach = 1.15 * max(largest(np.abs(log["true_cross_m"])), half)
    axes.add_patch(Rectangle((0.0, -half), runway.length_m, runway.width_m, fc="#ececec", ec=BLACK, lw=1.2, zorder=0.5))
    axes.plot([0.0, runway.length_m], [0.0, 0.0], color=GREY, lw=0.8, ls=(0, (12, 8)), zorder=1.2)
    size = (box.along_max_m - box.along_min_m, 2.0 * box.cross_max_m)
    axes.add_patch(Rectangle((box.along_min_m, -box.cross_max_m), *size, fill=False, **LIMIT, label="touchdown box"))
    axes.set_xlim(*span)
    axes.set_ylim(reach, -reach)  # as seen from above: right of the centreline is down
    axes.set_title("From above, across exaggerated")
    axes.set_ylabel("right of the centreline, m")
    axes.set_xlabel("camera along the runway from the threshold, m")
    legend_above(axes)


def _flare_view(axes: Axes, log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> None:
    """Height of the wheels over the last few metres, to a second after the touchdown."""
    time, height = log["time_s"], log["wheel_height_m"]
    touchdown = metrics["touchdown"]
    low = np.flatnonzero(height < 15.0)
    last = largest(time) if touchdown is None else touchdown["time_s"] + 2.0
    rows = low[time[low] <= last] if low.size else low
    axes.plot(log["body_x_m"][rows], height[rows], **TRUE)
    axes.set_title("Flare: height of the main wheels")
    axes.set_ylabel("height, m")
    axes.set_xlabel("centre of gravity along the runway from the threshold, m")
    axes.axhline(0.0, color=GREY, lw=0.8)
    box = scenario.box
    if touchdown is None:
        note(axes, "no touchdown")
        return
    flare = rows[log["phase"][rows] >= Phase.FLARE]
    if flare.size:
        start = int(flare[0])
        axes.plot(log["body_x_m"][start], height[start], "o", color=BLUE, ms=5, label="flare begins")
    axes.plot(touchdown["x_m"], 0.0, "v", color=VERMILION, ms=8, label="touchdown", zorder=3)
    text = (
        f"{touchdown['x_m']:.0f} m past the threshold (box {box.along_min_m:g} to {box.along_max_m:g})\n"
        f"{signed(touchdown['y_m'], 2)} m off the centreline (± {box.cross_max_m:g})\n"
        f"sink {touchdown['sink_rate_mps']:.2f} m/s (≤ {box.sink_max_mps:g}),"
        f" bank {signed(touchdown['bank_deg'], 1)}° (± {box.bank_max_deg:g})\n"
        f"pitch {signed(touchdown['pitch_deg'], 1)}°, {touchdown['ground_speed_mps']:.1f} m/s over the ground"
    )
    axes.text(0.99, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=8.5)
    legend_above(axes, markerscale=1.0)


def _mark_along(axes: Axes, log: Log, metrics: dict[str, Any]) -> None:
    """Flare, touchdown and stop, by where they were."""
    flare = np.flatnonzero(log["phase"] >= Phase.FLARE)
    marks = []
    if flare.size:
        marks.append((float(log["body_x_m"][flare[0]]), "flare"))
    if metrics["touchdown"] is not None:
        marks.append((metrics["touchdown"]["x_m"], "touchdown"))
    if metrics["stop"] is not None:
        marks.append((metrics["stop"]["x_m"], "stop"))
    mark(axes, marks)
