"""Errors against the camera's tilt: what pitching it down buys, and from where on it costs.

A row a quantity, three lines at the left and two at the right, each at several places of the approach.  The axis of
errors is logarithmic, as in the figures by range.  A curve ends where a line that its pose needs is not in the image.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from estimator.camera import PinholeCamera
from landsim.config import Scenario
from landsim.plots.printed import PAGE, PRINTED, save
from landsim.plots.style import BLACK, BLUE, GREY, SKY, VERMILION, number
from landsim.sensors import camera_of
from landsim.study.model import OF_STAGE, QUANTITIES, READINGS, StageName
from landsim.units import DEG

PLACES = ((BLACK, "o"), (BLUE, "s"), (VERMILION, "^"), (SKY, "D"), (GREY, "v"), (BLACK, "x"))
"""Colour and marker of each place, in the order of the approach."""
DASHES: dict[str, Any] = {"endpoints": (0, (4.0, 1.6)), "edge-points": "-"}
OUTSIDE = "#ededed"
UNITS = {"deg": "°", "m": "m"}
PANEL, GAP, HEAD, FOOT, LEFT, RIGHT, BETWEEN = 1.13, 0.09, 0.74, 0.34, 0.55, 0.1, 0.62
"""Heights of a panel, between panels, above and below them, margins, and between the columns, inches."""


def draw_tilt(folder: Path, result: Mapping[str, Any], scenario: Scenario, seed: int) -> list[Path]:
    """Draw ``tilt.png`` and ``tilt.pdf``.

    Parameters
    ----------
    folder : Path
        Exists; figures of the same names in it are replaced.
    result : mapping
        Of `landsim.study.tilt.tilt`; None may stand for NaN.
    scenario : Scenario
        The study: its camera, and the pitches that it flies.
    seed : int

    Returns
    -------
    list of Path
    """
    return save(tilt_figure(result, scenario, f"{scenario.name}, seed {seed}"), folder, "tilt")


@rc_context(PRINTED)
def tilt_figure(result: Mapping[str, Any], scenario: Scenario, of_what: str) -> Figure:
    """The figure of `draw_tilt`, two columns of a page wide."""
    names = OF_STAGE["early"]
    height = HEAD + len(names) * PANEL + (len(names) - 1) * GAP + FOOT
    figure = Figure(figsize=(PAGE, height))
    each = 0.5 * (PAGE - LEFT - RIGHT - BETWEEN)
    grid = figure.add_gridspec(
        len(names), 2, left=LEFT / PAGE, right=1.0 - RIGHT / PAGE, top=1.0 - HEAD / height, bottom=FOOT / height,
        hspace=GAP / PANEL, wspace=BETWEEN / each,
    )  # fmt: skip
    figure.text(0.02, 1.0 - 0.04 / height, f"{of_what}: 95 % of the errors of vision against the camera's tilt",
                va="top", fontsize=8.5)  # fmt: skip
    camera = camera_of(scenario.camera)
    study = scenario.study
    in_use = () if study is None else (-study.pitch_early_deg, -study.pitch_late_deg)
    stages: tuple[tuple[StageName, str], ...] = (("early", "three lines"), ("late", "two lines, true roll"))
    for column, (stage, title) in enumerate(stages):
        first, last = OF_STAGE[stage][0], OF_STAGE[stage][-1]
        for row, name in enumerate(names):
            if name not in OF_STAGE[stage]:
                continue
            axes = figure.add_subplot(grid[row, column])
            _panel(axes, result, stage, name, camera, in_use)
            axes.yaxis.set_label_coords(-0.37 / each, 0.5)
            axes.tick_params(labelbottom=name == last)
            if name == last:
                axes.set_xlabel("tilt of the optical axis below the horizon, °")
            if name == first:
                axes.set_title(title, loc="center", pad=26.0)
                _vanishing_point_axis(axes, camera)
    # in the places of roll and along, which two lines do not give
    x = (LEFT + each + BETWEEN - 0.1) / PAGE
    foot = grid[len(names) - 1, 1].get_position(figure).y1
    above = [*_places(result, "early"), *_marks()]
    for handles, y in ((above, 1.0 - 0.2 / height), (_places(result, "late"), foot - 0.36 / height)):
        figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(x, y))
    return figure


def _panel(
    axes: Axes,
    result: Mapping[str, Any],
    stage: StageName,
    name: str,
    camera: PinholeCamera,
    in_use: tuple[float, ...],
) -> None:
    """One quantity of one stage: a curve for each place and noise reading."""
    pitch, unit = np.asarray(result["pitch_down_deg"], dtype=float), QUANTITIES[name].unit
    for reading in READINGS:
        for values, (colour, marker) in zip(result[stage][reading][f"{name}_{unit}"]["p95"], PLACES, strict=False):
            axes.plot(
                pitch, np.asarray(values, dtype=float), color=colour, ls=DASHES[reading], lw=0.9, marker=marker, ms=2.6,
                mew=0.6, markevery=2,
            )  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlim(float(pitch.min()), float(pitch.max()))
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=(1, 2, 5, 10)))
    axes.yaxis.set_major_locator(LogLocator(numticks=20))
    axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0), numticks=40))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", length=1.3, width=0.5)
    axes.set_ylabel(f"|{name} error|, {UNITS[unit]}")
    for angle in in_use:
        axes.axvline(angle, color=GREY, lw=0.7, zorder=0.8)
    limit = math.atan((camera.cy + 0.5) / camera.fy) / DEG
    if limit < pitch.max():
        axes.axvspan(limit, float(pitch.max()), color=OUTSIDE, lw=0.0, zorder=0.2)


def _vanishing_point_axis(axes: Axes, camera: PinholeCamera) -> None:
    """Above the panel, how far the vanishing point of the edges is above the principal point, f tan(tilt)."""
    begin, end = axes.get_xlim()
    low, high = (camera.fy * math.tan(angle * DEG) for angle in (begin, end))
    step = next((s for s in (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0) if (high - low) / s <= 6.0), 2000.0)
    ticks = np.arange(math.ceil(low / step), math.floor(high / step) + 1) * step
    top = axes.twiny()
    top.set_xlim(begin, end)
    top.set_xticks(np.degrees(np.arctan(ticks / camera.fy)), [number(tick) for tick in ticks])
    top.spines["top"].set_visible(True)
    top.set_xlabel("vanishing point above the principal point, px", labelpad=2.5)


def _places(result: Mapping[str, Any], stage: StageName) -> list[Line2D]:
    """The legend's entries for the places of a stage."""
    if stage == "early":
        texts = [f"three lines: {number(value, '.0f')} m to the threshold" for value in result[stage]["range_m"]]
    else:
        texts = [f"two lines: camera {number(value, '.3g')} m up" for value in result[stage]["height_m"]]
    return [
        Line2D([], [], color=colour, lw=0.9, marker=marker, ms=2.6, mew=0.6, label=text)
        for text, (colour, marker) in zip(texts, PLACES, strict=False)
    ]


def _marks() -> list[Line2D | Patch]:
    return [
        *(Line2D([], [], color=BLACK, lw=0.9, ls=DASHES[reading], label=reading) for reading in reversed(READINGS)),
        Line2D([], [], color=GREY, lw=0.7, label="tilt in use"),
        Patch(color=OUTSIDE, lw=0.0, label="vanishing point outside the image"),
    ]
