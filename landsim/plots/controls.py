"""What was commanded and what came of it."""

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from landsim.metrics import Log
from landsim.plots.style import (
    BLACK,
    BLUE,
    COMMAND,
    FUSED,
    PALE,
    SKY,
    STYLE,
    TRUE,
    VERMILION,
    legend_above,
    legend_in_head,
    new_figure,
    span,
    thinned,
)
from landsim.state import Phase

PHASE_SHADES = {Phase.ACQUIRE: "#f0f0f0", Phase.FLARE: "#dceaf5", Phase.ROLLOUT: "#f7ead2"}


@rc_context(STYLE)
def controls_and_attitude(log: Log, metrics: dict[str, Any]) -> Figure:
    """What was commanded, what came of it, and what the controls did, over time."""
    figure = new_figure((10.0, 9.2), "attitude and controls", metrics)
    grid = figure.add_gridspec(4, 2, left=0.08, right=0.985, top=0.885, bottom=0.055, hspace=0.3, wspace=0.21)
    few = thinned(log)
    rows: list[tuple[str, list[tuple[str, dict[str, Any]]]]] = [
        ("pitch, °", [("body_pitch_deg", TRUE), ("command_pitch_deg", COMMAND)]),
        ("bank, °", [("body_roll_deg", TRUE), ("command_roll_deg", COMMAND)]),
        ("heading to the runway, °", [("body_yaw_deg", TRUE)]),
        (
            "airspeed, m/s",
            [
                ("pitot_airspeed_mps", {"color": SKY, "lw": 0.8, "label": "measured"}),
                ("true_airspeed_mps", TRUE),
                ("command_airspeed_mps", COMMAND),
            ],
        ),
        ("control surfaces, °", _lines("elevator_deg", "aileron_deg", "rudder_deg")),
        ("share of full (1)", _lines("throttle", "brake", "steering")),
        ("camera tilt, ° down", [("tilt_deg", TRUE)]),
        ("sink rate, m/s", [("true_velocity_z_mps", TRUE), ("fused_velocity_z_mps", FUSED)]),
    ]
    for i, (label, curves) in enumerate(rows):
        axes = figure.add_subplot(grid[i % 4, i // 4])
        for name, style in curves:
            axes.plot(few["time_s"], few[name], **style)
        axes.set_ylabel(label)
        axes.set_xlim(*span(log["time_s"], (0.0, 1.0)))
        axes.margins(y=0.08)
        _shade_phases(axes, log)
        axes.yaxis.set_label_coords(-0.115, 0.5)
        legend_above(axes)
        if i % 4 == 3:
            axes.set_xlabel("time, s")
    shades = [Rectangle((0.0, 0.0), 1.0, 1.0, fc=shade, ec=PALE, lw=0.6) for shade in PHASE_SHADES.values()]
    legend_in_head(figure, shades, [phase.name.lower() for phase in PHASE_SHADES])
    return figure


def _lines(*names: str) -> list[tuple[str, dict[str, Any]]]:
    styles = (
        {"color": BLACK, "lw": 1.4},
        {"color": VERMILION, "lw": 1.2, "ls": (0, (4, 2))},
        {"color": BLUE, "lw": 1.2, "ls": (0, (1.5, 1.2))},
    )
    return [(name, {**style, "label": name.removesuffix("_deg")}) for name, style in zip(names, styles, strict=True)]


def _shade_phases(axes: Axes, log: Log) -> None:
    """The phases of guidance as shades; the approach has none."""
    time, phase = log["time_s"], log["phase"]
    if time.size < 2:
        return
    cuts = [0, *(np.flatnonzero(np.diff(phase)) + 1).tolist(), time.size]
    for begin, end in pairwise(cuts):
        kind = Phase(int(phase[begin]))
        span = float(time[begin]), float(time[min(end, time.size - 1)])
        if kind in PHASE_SHADES:
            axes.axvspan(*span, color=PHASE_SHADES[kind], lw=0.0, zorder=0.1)
