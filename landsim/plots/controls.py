"""What was commanded and what came of it."""

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from landsim.metrics import Array, Log
from landsim.plots.style import (
    BLACK,
    BLUE,
    COMMAND,
    FUSED,
    GREY,
    SKY,
    STYLE,
    TRUE,
    VERMILION,
    failure,
    foot_of_head,
    legend_above,
    legend_in_head,
    new_figure,
    span,
    thinned,
    until_shortly_after,
)
from landsim.state import Phase

if TYPE_CHECKING:
    from landsim.config import Scenario

PHASE_SHADES = {
    Phase.ACQUIRE: "#cfcfcf",
    Phase.APPROACH: "#ffffff",
    Phase.FLARE: "#dceaf5",
    Phase.ROLLOUT: "#f7ead2",
    Phase.STOPPED: "#e3d2ae",
    Phase.GO_AROUND: "#e8d9ea",
}
HEAD, ROW, FOOT = 1.13, 1.64, 0.49
"""Of the figure: its head, a row of panels with what is between them, what is below; inches."""
CRASH: dict[str, Any] = {"color": VERMILION, "lw": 1.0, "ls": "-."}


@rc_context(STYLE)
def controls_and_attitude(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """What was commanded, what came of it, and what the controls did, over time.

    What is zero throughout, such as the weight on the wheels of a flight that never came down, is named and not drawn.
    The airspeed command is shown in the approach: from the flare on the throttle is at idle and nothing follows it.
    """
    failed = failure(log, scenario, metrics)
    log = until_shortly_after(log, failed)
    few = thinned(log)
    few["command_airspeed_mps"] = np.where(few["phase"] == Phase.APPROACH, few["command_airspeed_mps"], np.nan)
    rows: list[tuple[str, list[tuple[str, dict[str, Any]]]]] = [
        ("pitch, °", [("body_pitch_deg", TRUE), ("command_pitch_deg", COMMAND)]),
        ("bank, °", [("body_roll_deg", TRUE), ("command_roll_deg", COMMAND)]),
        ("heading relative\nto the runway, °", [("body_yaw_deg", TRUE)]),
        (
            "airspeed, m/s",
            [
                ("pitot_airspeed_mps", {"color": SKY, "lw": 0.8, "label": "measured"}),
                ("true_airspeed_mps", TRUE),
                ("command_airspeed_mps", COMMAND),
            ],
        ),
        ("sink rate, m/s", [("true_velocity_z_mps", TRUE), ("fused_velocity_z_mps", FUSED)]),
        ("control surfaces, °", _lines("elevator_deg", "aileron_deg", "rudder_deg")),
        ("share of full (1)", _lines("throttle", "brake")),
        ("steering, right (1)", [("steering", TRUE)]),
        ("camera tilt, ° down", [("tilt_deg", TRUE)]),
        ("weight on wheel (1)", _lines("wow_nose", "wow_left", "wow_right")),
    ]
    idle = [label for label, curves in rows if not any(_moves(few[name]) for name, _ in curves)]
    rows = [row for row in rows if row[0] not in idle]
    lines = max(-(-len(rows) // 2), 1)
    height = HEAD + ROW * lines + FOOT
    figure = new_figure((10.0, height), "attitude and controls", metrics)
    grid = figure.add_gridspec(
        lines, 2, left=0.09, right=0.985, top=1.0 - HEAD / height, bottom=FOOT / height, hspace=0.36, wspace=0.26
    )
    for i, (label, curves) in enumerate(rows):
        axes = figure.add_subplot(grid[i % lines, i // lines])
        for name, style in curves:
            axes.plot(few["time_s"], few[name], **style)
        axes.set_ylabel(label)
        axes.set_xlim(*span(log["time_s"], (0.0, 1.0)))
        axes.margins(y=0.08)
        _shade_phases(axes, log)
        if failed is not None:
            axes.axvline(log["time_s"][failed.row], **CRASH)
        axes.yaxis.set_label_coords(-0.125, 0.5)
        legend_above(axes)
        if i % lines == lines - 1 or i == len(rows) - 1:
            axes.set_xlabel("time, s")
    handles: list[Any] = [Rectangle((0, 0), 1, 1, fc=shade, ec=GREY, lw=0.6) for shade in PHASE_SHADES.values()]
    names = [phase.name.lower().replace("_", "-") for phase in PHASE_SHADES]
    names[0] = f"by guidance: {names[0]}"
    if failed is not None:
        handles.append(Line2D([], [], **CRASH))
        names.append(failed.name)
    legend_in_head(figure, handles, names)
    if idle:
        foot_of_head(
            figure, f"zero throughout: {', '.join(label.partition(',')[0].removesuffix(' (1)') for label in idle)}"
        )
    return figure


def _moves(values: Array) -> bool:
    """Whether there is anything else than zero to see."""
    return bool(np.any(np.isfinite(values) & (values != 0.0)))


def _lines(*names: str) -> list[tuple[str, dict[str, Any]]]:
    styles = (
        {"color": BLACK, "lw": 1.4},
        {"color": VERMILION, "lw": 1.2, "ls": (0, (4, 2))},
        {"color": BLUE, "lw": 1.2, "ls": (0, (1.5, 1.2))},
    )
    return [
        (name, {**style, "label": name.removesuffix("_deg").removeprefix("wow_")})
        for name, style in zip(names, styles, strict=False)
    ]


def _shade_phases(axes: Axes, log: Log) -> None:
    """The phases of guidance as shades; the approach is white."""
    time, phase = log["time_s"], log["phase"]
    if time.size < 2:
        return
    cuts = [0, *(np.flatnonzero(np.diff(phase)) + 1).tolist(), time.size]
    for begin, end in pairwise(cuts):
        kind = Phase(int(phase[begin]))
        during = float(time[begin]), float(time[min(end, time.size - 1)])
        axes.axvspan(*during, color=PHASE_SHADES[kind], lw=0.0, zorder=0.1)
