"""Errors by range against the bounds that are claimed: a figure a stage, a panel a quantity and noise reading.

The errors shrink by a factor of twenty and more on the way in, the filter's are a tenth of vision's, and what a reader
wants to know is where a curve crosses a bound.  On an axis that is linear in the signed error all of that happens
within a hair's breadth of zero, and the two halves of a symmetrical band say the same thing twice.  So the axis is the
logarithm of the error's magnitude: bands begin at its foot, a power of the distance is a smooth curve, a crossing can
be read to a few percent, and two readings that differ by a factor show it as the same step everywhere.  The single
realisation is a cloud of points below its band; what it loses is its sign.  The readings stand side by side on one
axis, which is what they are compared on, and not over each other, where six bands would hide one another.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from estimator.so3 import Array
from landsim.plots.printed import COLUMN, PAGE, PRINTED, save
from landsim.plots.style import BLACK, BLUE, GREEN, VERMILION, number
from landsim.study.model import (
    JUDGED,
    LEVEL,
    LEVELS,
    NORMAL,
    OF_STAGE,
    QUANTITIES,
    READINGS,
    Envelope,
    StageName,
    enough,
)
from landsim.units import DEG

SIGMAS = NORMAL[JUDGED]
"""So many σ hold 95 % of a normal distribution, either side."""
BANDS = ("#bdbdbd", "#d6d6d6", "#ececec")
"""Of the percentiles `LEVELS`, the more probable the darker."""
VISION: dict[str, Any] = {"color": VERMILION, "ls": "none", "marker": ".", "mew": 0.0, "zorder": 2.5}
FIRST_ORDER: dict[str, Any] = {"color": BLACK, "lw": 0.9, "zorder": 3.0}
ROLL_OFF: dict[str, Any] = {"color": BLACK, "lw": 0.9, "zorder": 3.1}
ROLL_DASHES = ((0, (1.0, 1.2)), (0, (3.5, 1.2, 1.0, 1.2)), (0, (1.0, 3.0)))
FUSED: dict[str, Any] = {"color": BLUE, "lw": 1.5, "zorder": 4.0}
FUSED_SIGMA: dict[str, Any] = {"color": BLUE, "lw": 1.0, "ls": (0, (1.0, 1.0)), "zorder": 4.1}
FUSED_SINGLE: dict[str, Any] = {"color": BLUE, "lw": 0.5, "zorder": 3.5}
BOUND: dict[str, Any] = {"color": GREEN, "lw": 1.2, "ls": (0, (5.0, 2.0)), "zorder": 4.5}
BOUND_LABEL = "claimed bound"
TITLES = {
    "endpoints": "endpoints: noise on both ends of a line",
    "edge-points": "edge-points: noise on points along it",
}
UNITS = {"deg": "°", "m": "m"}
PANEL, GAP, FOOT, LEFT, RIGHT, LEGEND_ROW = 1.13, 0.09, 0.34, 0.55, 0.36, 0.133
"""Heights of a panel, between panels and below them, margins, and a row of the legend, inches."""
LEAST, MOST = 1e-12, 1e12
"""No error that is drawn is outside these; a logarithmic axis has neither zero nor infinity."""


def draw_envelopes(
    folder: Path,
    stage: StageName,
    envelopes: Sequence[Envelope],
    bounds: Mapping[str, float],
    scenario_name: str,
    seed: int,
) -> list[Path]:
    """Draw the errors of one stage into ``errors-<stage>.png`` and ``.pdf``.

    Parameters
    ----------
    folder : Path
        Exists; figures of the same names in it are replaced.
    stage : {"early", "late"}
    envelopes : sequence of Envelope
        Of this stage; others are left out.  For each reading one of vision, further ones with other roll errors, and
        one of the filter, as far as there are any.
    bounds : mapping of str to float
        By quantity, rad and m; a quantity may have none.
    scenario_name : str
    seed : int
        Of the study.

    Returns
    -------
    list of Path
        Empty, and nothing is written, if the stage has no envelope.
    """
    there = [one for one in envelopes if one.stage == stage and one.distance.size]
    if not there:
        return []
    return save(envelope_figure(stage, there, bounds, f"{scenario_name}, seed {seed}"), folder, f"errors-{stage}")


@rc_context(PRINTED)
def envelope_figure(
    stage: StageName, envelopes: Sequence[Envelope], bounds: Mapping[str, float], of_what: str
) -> Figure:
    """The figure of `draw_envelopes`; a page wide with both readings, and a column wide with one."""
    readings = [reading for reading in READINGS if any(one.reading == reading for one in envelopes)]
    names = OF_STAGE[stage]
    both = len(readings) > 1
    figure = Figure(figsize=(PAGE if both else COLUMN, 1.0))
    grid = figure.add_gridspec(len(names), len(readings))
    limits = {name: _limits(envelopes, name, bounds.get(name)) for name in names}
    handles: dict[str, Artist] = {}
    for column, reading in enumerate(readings):
        own = [one for one in envelopes if one.reading == reading]
        for row, name in enumerate(names):
            axes = figure.add_subplot(grid[row, column])
            _panel(axes, own, name, bounds.get(name))
            axes.set_ylim(*limits[name])
            axes.set_xlim(*_span(envelopes))
            axes.tick_params(labelbottom=row == len(names) - 1, labelleft=column == 0)
            if column == 0:
                axes.set_ylabel(f"|{name} error|, {UNITS[QUANTITIES[name].unit]}")
            if row == 0:
                axes.set_title(TITLES[reading], loc="center", pad=25.0)
                _time_axis(axes, next((one for one in own if one.source == "vision"), own[0]))
            if name in bounds and column == len(readings) - 1:
                _name_bound(axes, name, bounds[name])
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        axes.set_xlabel("distance to the threshold, m")
    _lay_out(figure, grid, handles, f"{of_what}: errors of the camera's pose, {stage} stage")
    return figure


def _lay_out(figure: Figure, grid: GridSpec, handles: dict[str, Artist], title: str) -> None:
    """Give the figure its height: panels of one size below a head with the title and a legend of any length."""
    width, columns = figure.get_figwidth(), 3 if grid.ncols > 1 else 2
    # the columns of the legend: vision, what it is compared with, the filter
    labels = sorted(handles, key=lambda label: (label.startswith("fused"), label == BOUND_LABEL))
    head = 0.75 + LEGEND_ROW * -(-len(labels) // columns)
    height = head + grid.nrows * PANEL + (grid.nrows - 1) * GAP + FOOT
    figure.set_size_inches(width, height)
    figure.subplots_adjust(
        left=LEFT / width, right=1.0 - RIGHT / width, top=1.0 - head / height, bottom=FOOT / height,
        hspace=GAP / PANEL, wspace=0.05,
    )  # fmt: skip
    for axes in figure.axes:
        if axes.get_ylabel():
            axes.yaxis.set_label_coords(-0.37 / (axes.get_position().width * width), 0.5)
    figure.text(0.02, 1.0 - 0.04 / height, title, va="top", fontsize=8.5 if columns == 3 else 7.0)
    figure.legend(
        [handles[label] for label in labels], labels, loc="upper left", bbox_to_anchor=(0.01, 1.0 - 0.2 / height),
        ncols=columns, columnspacing=1.4,
    )  # fmt: skip


def _span(envelopes: Sequence[Envelope]) -> tuple[float, float]:
    """Distances from the first to the last, of vision if there is any: flights go on where a straight path ends."""
    vision = [one for one in envelopes if one.source == "vision"]
    distances = np.concatenate([one.distance for one in vision or envelopes])
    begin, end = float(distances.max()), float(distances.min())
    return begin, end if end < begin else begin - 1.0


def _panel(axes: Axes, envelopes: Sequence[Envelope], name: str, bound: float | None) -> None:
    """One quantity with one noise reading."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(numticks=20))
    axes.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0), numticks=40))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", length=1.3, width=0.5)
    vision = sorted((one for one in envelopes if one.source == "vision"), key=lambda one: abs(one.roll_error))
    for one in vision[:1]:
        _vision(axes, one, name)
    for one, dashes in zip(vision[1:], cycle(ROLL_DASHES), strict=False):
        distance, spread, _, _ = _shown(one, name)
        label = f"vision, {LEVEL:g} %, roll off by {number(one.roll_error / DEG, '.3g')}°"
        axes.plot(distance, spread[:, JUDGED], **ROLL_OFF, ls=dashes, label=label)
    for one in (one for one in envelopes if one.source == "fused"):
        _fused(axes, one, name)
    if bound is not None:
        axes.axhline(bound / QUANTITIES[name].scale, **BOUND, label=BOUND_LABEL)


def _shown(one: Envelope, name: str) -> tuple[Array, Array, Array, Array]:
    """Distances (n,), percentiles (n, 3), σ (n,) and single error (n,) of a quantity, in its unit, as magnitudes.

    A percentile of too few errors is NaN.
    """
    k, scale = one.quantities.index(name), QUANTITIES[name].scale
    there = np.stack([enough(one.count, level) for level in LEVELS], axis=-1)
    spread = np.where(there, one.percentiles[:, k], np.nan)
    return one.distance, spread / scale, one.sigma[:, k] / scale, np.abs(one.single[:, k]) / scale


def _vision(axes: Axes, one: Envelope, name: str) -> None:
    distance, spread, sigma, single = _shown(one, name)
    low = np.full(distance.size, LEAST)
    for i, (level, colour) in enumerate(zip(LEVELS, BANDS, strict=True)):
        high = np.minimum(spread[:, i], MOST)  # infinite where there was no solution
        if not enough(one.count, level).any():
            continue
        axes.fill_between(distance, low, high, color=colour, lw=0.0, zorder=0.5, label=_band_label(one, level))
        low = high
    size = 2.0 if distance.size > 300 else 3.5
    axes.plot(distance, single, **VISION, ms=size, label="vision, one realisation")
    if np.isfinite(sigma).any():
        axes.plot(distance, SIGMAS * sigma, **FIRST_ORDER, label=f"Cramér–Rao bound, {SIGMAS:.3g} σ")


def _band_label(one: Envelope, level: float) -> str:
    return f"vision, {level:.3g} % of n = {int(one.count.max())}"


def _fused(axes: Axes, one: Envelope, name: str) -> None:
    distance, spread, sigma, single = _shown(one, name)
    axes.plot(distance, single, **FUSED_SINGLE, label="fused, one flight")
    if enough(one.count, LEVEL).any():
        label = f"fused, {LEVEL:g} % of n = {int(one.count.max())}"
        axes.plot(distance, spread[:, JUDGED], **FUSED, label=label)
    axes.plot(distance, SIGMAS * sigma, **FUSED_SIGMA, label=f"fused, {SIGMAS:.3g} σ of the filter")


def _limits(envelopes: Sequence[Envelope], name: str, bound: float | None) -> tuple[float, float]:
    """Of the axis of a quantity, in its unit: it holds every curve and the foot of no band."""
    values = [np.empty(0) if bound is None else np.array([bound / QUANTITIES[name].scale])]
    for one in envelopes:
        _, spread, sigma, _ = _shown(one, name)
        values += [spread[:, 0 if one.source == "vision" else JUDGED], spread[:, 2], SIGMAS * sigma]
    every = np.concatenate(values)
    every = every[np.isfinite(every) & (every > 0.0)]
    if not every.size:
        return 0.1, 10.0
    return 0.3 * float(every.min()), 1.5 * float(every.max())


def _time_axis(axes: Axes, one: Envelope) -> None:
    """Round times above the panel, where the camera is there."""
    known = np.isfinite(one.time)
    distance, time = one.distance[known], one.time[known]
    if time.size < 2:
        return
    step = next((s for s in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if np.ptp(time) / s <= 6.0), 1000.0)
    ticks = np.arange(np.ceil(time.min() / step), np.floor(time.max() / step) + 1.0) * step
    top = axes.twiny()
    top.set_xlim(axes.get_xlim())
    top.set_xticks(np.interp(ticks, time, distance), [number(tick) for tick in ticks])
    top.spines["top"].set_visible(True)
    top.set_xlabel("time, s", labelpad=2.5)


def _name_bound(axes: Axes, name: str, bound: float) -> None:
    """Its value, at the right of the panel."""
    value, unit = bound / QUANTITIES[name].scale, UNITS[QUANTITIES[name].unit]
    axes.annotate(
        f"{value:.3g}{'' if unit == '°' else ' '}{unit}", (1.0, value), xycoords=axes.get_yaxis_transform(),
        xytext=(2.5, 0.0), textcoords="offset points", ha="left", va="center", fontsize=7.0, color=GREEN,
        annotation_clip=False,
    )  # fmt: skip
