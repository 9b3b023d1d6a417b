"""Where it flew."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from landsim.metrics import Array, Log, error, main_wheels
from landsim.plots.style import (
    BLACK,
    BLUE,
    FUSED,
    GREEN,
    GREY,
    LEVEL_PT,
    LIMIT,
    STYLE,
    TRUE,
    VERMILION,
    VISION,
    Failure,
    failure,
    largest,
    legend_above,
    mark,
    new_figure,
    note,
    number,
    signed,
    span,
    thinned,
    until_shortly_after,
)
from landsim.state import Phase
from landsim.units import DEG

if TYPE_CHECKING:
    from landsim.config import Scenario

GLIDE_SLOPE_HALF_SCALE = 0.12
"""Half of an ILS needle's travel, as a share of the glide-slope angle: ICAO Annex 10, volume I, 3.1.5.6.2."""
FLARE_HEIGHT = 15.0
"""The lowest panel begins with the wheels this high, m."""
AFTER_S = 2.0
"""It ends as long after the touchdown, s."""
PHASES_MARKED = ((Phase.FLARE, "flare"), (Phase.GO_AROUND, "go-around"))
CRASH: dict[str, Any] = {"color": VERMILION, "mec": BLACK, "mew": 0.6, "ms": 8.0, "ls": "none", "zorder": 4.0}


@rc_context(STYLE)
def profile_and_plan(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """Where it flew: from the side against the glide slope, from above against the runway, and the flare enlarged.

    The upper two are of the centre of gravity, as guidance flies it: an estimate, which is of the camera, is drawn with
    its error at the true centre of gravity.  The flare is of the midpoint of the main wheels, as the touchdown is.
    """
    figure = new_figure((10.0, 9.6), "profile and plan", metrics)
    grid = figure.add_gridspec(
        3, 1, left=0.1, right=0.985, top=0.875, bottom=0.055, hspace=0.44, height_ratios=(1.15, 1.0, 1.0)
    )
    side, plan, flare = (figure.add_subplot(grid[i]) for i in range(3))
    failed = failure(log, scenario, metrics)
    log = until_shortly_after(log, failed)
    points = _centre_of_gravity(log)
    begin, end = span(log["body_x_m"], (-1000.0, 500.0))
    end = max(end, scenario.approach.aim_point_m)
    room = 0.03 * (end - begin)
    few = thinned({**log, **points})
    for axes, quantity in ((side, "height_m"), (plan, "cross_m")):
        axes.plot(points["vision_along_m"], points[f"vision_{quantity}"], **VISION)
        axes.plot(few["true_along_m"], few[f"true_{quantity}"], **TRUE)
        axes.plot(few["fused_along_m"], few[f"fused_{quantity}"], **FUSED)
        if failed is not None:
            at = points["true_along_m"][failed.row], points[f"true_{quantity}"][failed.row]
            axes.plot(*at, "X", **CRASH)
        axes.set_xlim(begin - room, end + room)
        axes.set_xlabel("centre of gravity along the runway from the threshold, m")
    _side_view(side, few, scenario, begin)
    _plan_view(plan, few, scenario, (begin - room, end + room))
    _flare_view(flare, log, scenario, metrics, failed)
    marks = _marks(log, metrics, failed)
    for axes in (side, plan):
        levels = mark(axes, marks)
        legend_above(axes, levels)
        axes.set_title(axes.get_title(loc="left"), pad=6.0 + LEVEL_PT * levels)
    for axes in figure.axes:
        axes.yaxis.set_label_coords(-0.085, 0.5)
    return figure


def _centre_of_gravity(log: Log) -> dict[str, Array]:
    """Its true place by the names of the camera's, and the estimates: the camera's errors added to it."""
    true = {"along_m": log["body_x_m"], "cross_m": log["body_y_m"], "height_m": log["body_height_m"]}
    estimates = {f"{source}_{q}": true[q] + error(log, source, q) for source in ("vision", "fused") for q in true}
    return {f"true_{q}": values for q, values in true.items()} | estimates


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
    axes.set_ylabel("height of the cg, m")


def _plan_view(axes: Axes, log: Log, scenario: "Scenario", limits: tuple[float, float]) -> None:
    runway, box = scenario.runway, scenario.box
    half = 0.5 * runway.width_m
    reach = 1.15 * max(largest(np.abs(log["true_cross_m"])), half)
    axes.add_patch(Rectangle((0.0, -half), runway.length_m, runway.width_m, fc="#ececec", ec=BLACK, lw=1.2, zorder=0.5))
    axes.plot([0.0, runway.length_m], [0.0, 0.0], color=GREY, lw=0.8, ls=(0, (12, 8)), zorder=1.2)
    size = (box.along_max_m - box.along_min_m, 2.0 * box.cross_max_m)
    axes.add_patch(Rectangle((box.along_min_m, -box.cross_max_m), *size, fill=False, **LIMIT, label="touchdown box"))
    axes.set_xlim(*limits)
    axes.set_ylim(reach, -reach)  # as seen from above: right of the centreline is down
    axes.set_title("From above, across exaggerated")
    axes.set_ylabel("cg right of the centreline, m")


def _flare_view(axes: Axes, log: Log, scenario: "Scenario", metrics: dict[str, Any], failed: Failure | None) -> None:
    """Height of the main wheels over the last ``FLARE_HEIGHT`` metres, to ``AFTER_S`` past the touchdown."""
    time, height = log["time_s"], log["wheel_height_m"]
    x, _ = main_wheels(log, scenario.aircraft_config)
    touchdown, box = metrics["touchdown"], scenario.box
    last = largest(time) if touchdown is None else touchdown["time_s"] + AFTER_S
    rows = np.flatnonzero((height < FLARE_HEIGHT) & (time <= last))
    axes.plot(x[rows], height[rows], **TRUE)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_title("The last metres: height of the main wheels")
    axes.set_ylabel("height of the wheels, m")
    axes.set_xlabel("midpoint of the main wheels along the runway from the threshold, m")
    top = 1.06 * FLARE_HEIGHT
    axes.set_ylim(min(-0.04 * top, 1.2 * float(height[rows].min(initial=0.0))), top)
    if rows.size:
        axes.set_xlim(*span(x[rows], (float(x[rows[0]]) - 1.0, float(x[rows[0]]) + 1.0)))
        flare = rows[log["phase"][rows] == Phase.FLARE]
        if flare.size and (touchdown is None or time[flare[0]] <= touchdown["time_s"]):
            start = int(flare[0])
            axes.plot(x[start], height[start], "o", color=BLUE, ms=5, label="flare begins, by guidance")
        up = np.flatnonzero(log["phase"] == Phase.GO_AROUND)
        if up.size and up[0] in rows:
            axes.plot(x[up[0]], height[up[0]], "^", color=BLUE, ms=6, label="go-around begins, by guidance")
    else:
        axes.set_xticks([])
    if failed is not None and failed.row in rows:
        at = x[failed.row], height[failed.row]
        axes.plot(*at, "X", **CRASH, label=failed.name)
    if touchdown is None:
        note(axes, "no touchdown" if rows.size else f"no touchdown: never below {FLARE_HEIGHT:g} m")
    else:
        axes.plot(touchdown["x_m"], 0.0, "v", color=BLUE, ms=8, label="touchdown", zorder=3)
        where = "past" if touchdown["x_m"] >= 0.0 else "before"
        text = (
            f"touchdown {abs(touchdown['x_m']):.0f} m {where} the threshold"
            f" (box {number(box.along_min_m)} to {number(box.along_max_m)} m past)\n"
            f"{signed(touchdown['y_m'], 2)} m right of the centreline (± {box.cross_max_m:g} m)\n"
            f"sink {number(touchdown['sink_rate_mps'], '.2f')} m/s (≤ {box.sink_max_mps:g} m/s),"
            f" bank {signed(touchdown['bank_deg'], 1)}° (± {box.bank_max_deg:g}°)\n"
            f"pitch {signed(touchdown['pitch_deg'], 1)}°, {touchdown['ground_speed_mps']:.1f} m/s over the ground"
        )
        axes.text(0.99, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=8.5)
    legend_above(axes, markerscale=1.0)


def _marks(log: Log, metrics: dict[str, Any], failed: Failure | None) -> list[tuple[float, str]]:
    """Flare, touchdown, stop, go-around and a crash, by where the centre of gravity then was."""
    x, time = log["body_x_m"], log["time_s"]
    begins = ((np.flatnonzero(log["phase"] == phase), name) for phase, name in PHASES_MARKED)
    marks = [(float(x[rows[0]]), name) for rows, name in begins if rows.size]
    if metrics["touchdown"] is not None:
        marks.append((float(np.interp(metrics["touchdown"]["time_s"], time, x)), "touchdown"))
    if metrics["stop"] is not None:
        marks.append((metrics["stop"]["x_m"], "stop"))
    if failed is not None:
        marks.append((float(x[failed.row]), failed.name))
    return marks
