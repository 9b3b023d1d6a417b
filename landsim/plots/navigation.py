"""How well navigation knew where it was: its errors, and whether its own σ describe them."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator
from numpy.typing import NDArray
from scipy.special import chdtri

from estimator.single_lines import gates_of
from landsim.log import QUANTITIES
from landsim.metrics import Array, Log, error
from landsim.plots.style import (
    BLACK,
    BLUE,
    LIMIT,
    SKY,
    STYLE,
    VERMILION,
    VISION,
    distance_axis,
    event_times,
    failure,
    foot_of_head,
    largest,
    legend_in_head,
    mark,
    never_started,
    new_figure,
    note,
    number,
    span,
    thinned,
    until_shortly_after,
    usable_frames,
)

if TYPE_CHECKING:
    from landsim.config import Scenario

NO_COVARIANCE = "no covariance given"
"""What there is to say of an estimator that does not tell how sure it is."""


@rc_context(STYLE)
def navigation_errors(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """Errors of vision and of the filter in all six quantities, with the filter's ± 3 σ, over time.

    Vision errs many times more than the filter, and both shrink by as much on the way: the scale is that of square
    roots, so that all of it can be read.
    """
    figure = new_figure((10.0, 9.6), "navigation errors of the camera's pose, on axes of square roots", metrics)
    grid = figure.add_gridspec(3, 2, left=0.1, right=0.985, top=0.818, bottom=0.055, hspace=0.34, wspace=0.3)
    failed = failure(log, scenario, metrics)
    log = until_shortly_after(log, failed)
    few, frames = thinned(log), at_frames(log)
    marks = event_times(log, metrics, failed)
    unstarted = usable_frames(log)
    uncertain = gives_covariance(log)
    for i, quantity in enumerate(QUANTITIES):
        axes = figure.add_subplot(grid[i % 3, i // 3])
        name, unit = quantity.rsplit("_", 1)
        sigma = few[f"sigma_{quantity}"]
        vision, fused = error(log, "vision", quantity), error(log, "fused", quantity)[frames]
        axes.plot(log["time_s"], vision, **VISION)
        if uncertain:
            axes.fill_between(
                few["time_s"], -3.0 * sigma, 3.0 * sigma, color=SKY, alpha=0.35, lw=0.0, label="± 3 σ of the filter"
            )
        axes.plot(log["time_s"][frames], fused, color=BLUE, lw=0.5, label="fused, at camera frames", zorder=2.5)
        nothing = "no estimate" if unstarted is None else never_started(unstarted)
        _root_scale(axes, nothing, vision, fused, 3.0 * sigma)
        axes.set_ylabel(f"{name} error, {'°' if unit == 'deg' else unit}")
        axes.set_xlim(*span(log["time_s"], (0.0, 1.0)))
        levels = mark(axes, marks)
        if i % 3 == 0:
            distance_axis(axes, log, levels)
        if i % 3 == 2:
            axes.set_xlabel("time, s")
        axes.yaxis.set_label_coords(-0.17, 0.5)
        if i == 0:
            legend_in_head(figure, *axes.get_legend_handles_labels())
    words = "the times below and the distances above hold for the whole column"
    if unstarted is not None:
        words += f"\n{never_started(unstarted)}"
    elif not uncertain:
        words += f"\n{NO_COVARIANCE}: no ± 3 σ"
    foot_of_head(figure, words)
    return figure


def _root_scale(axes: Axes, nothing: str, *values: Array) -> None:
    """A symmetric y axis of signed square roots, with a few round numbers on it; it holds 99.5 % of each array.

    Without a number to show it says ``nothing``.
    """
    finite = [np.abs(v[np.isfinite(v)]) for v in values]
    top = 1.15 * max((float(np.quantile(v, 0.995)) for v in finite if v.size), default=0.0)
    if top <= 0.0:
        note(axes, nothing)
        axes.set_yticks([])
        return
    axes.set_yscale("function", functions=(signed_root, signed_square))
    most = round_below(top)
    fourths = 0.25 * most * np.arange(1.0, math.floor(4.0 * top / most) + 1.0)
    # on an axis of square roots these five are evenly spaced; the marks between them are so on a plain one
    axes.yaxis.set_major_locator(FixedLocator([-most, -0.25 * most, 0.0, 0.25 * most, most]))
    axes.yaxis.set_minor_locator(FixedLocator([*-fourths, *fourths]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(-top, top)


def signed_root(values: Array) -> Array:
    """The square root of the magnitude, with the sign."""
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))


def signed_square(values: Array) -> Array:
    """The square, with the sign: the inverse of ``signed_root``."""
    return np.asarray(np.sign(values) * np.square(values))


def round_below(value: float) -> float:
    """The next lower 0.8, 2 or 4 times a power of ten: round, and so is a quarter of it."""
    power = 10.0 ** math.floor(math.log10(value))
    return power * max(m for m in (0.8, 2.0, 4.0, 8.0) if m * power <= value * (1.0 + 1e-9))


def gives_covariance(log: Log) -> bool:
    """Whether the estimator says how sure it is; a plug-in need not."""
    return bool(np.isfinite(log["sigma_cross_m"]).any())


def at_frames(log: Log) -> NDArray[np.bool_]:
    """Whether a row is that of a camera frame, with lines in it or without: before the first and after the last too."""
    # an error has its square at each frame once there is a covariance; without one, captures are the next best
    named = log["nees9"] if gives_covariance(log) else log["fault"]
    result: NDArray[np.bool_] = np.isfinite(log["accepted"]) | np.isfinite(named)
    return result


def gates(log: Log, scenario: "Scenario") -> Array:
    """The gate that each row's normalised innovation squared was held against; NaN where there was none."""
    config = scenario.navigation
    by_degrees = {6.0: config.gate_early, 4.0: config.gate_late}
    if config.aiding == "lines":
        by_degrees = dict(zip((2.0, 4.0, 6.0), gates_of(config.line_gate_probability).tolist(), strict=True))
    result = np.full(log["nis_dof"].size, math.nan)
    for degrees, gate in by_degrees.items():
        result[log["nis_dof"] == degrees] = gate
    return result


@rc_context(STYLE)
def consistency(log: Log, scenario: "Scenario", metrics: dict[str, Any]) -> Figure:
    """Normalised errors and innovations squared against the bounds that hold 95 % of a consistent filter's frames.

    The nine states are position, velocity and attitude; the fifteen have both biases besides.
    """
    figure = new_figure(
        (10.0, 8.6), "consistency of the filter: normalised errors (NEES) and innovations (NIS), squared", metrics
    )
    grid = figure.add_gridspec(3, 1, left=0.075, right=0.985, top=0.775, bottom=0.065, hspace=0.36)
    failed = failure(log, scenario, metrics)
    log = until_shortly_after(log, failed)
    time = log["time_s"]
    ones = np.ones(time.size)
    panels = (
        ("nees9", "NEES, 9 states (1)", 9.0 * ones, None),
        ("nees15", "NEES, 15 states (1)", 15.0 * ones, None),
        ("nis", "NIS (1)", log["nis_dof"], gates(log, scenario)),
    )
    marks = event_times(log, metrics, failed)
    unstarted = usable_frames(log)
    nothing = "no frame" if gives_covariance(log) else f"{NO_COVARIANCE}: nothing to normalise by"
    nothing = nothing if unstarted is None else never_started(unstarted)
    handles: dict[str, Any] = {}
    for i, (name, label, dof, gate) in enumerate(panels):
        axes = figure.add_subplot(grid[i])
        rows = np.flatnonzero(np.isfinite(log[name]) & np.isfinite(dof) & (log[name] > 0.0))
        t, values, n = time[rows], log[name][rows], dof[rows]
        axes.plot(t, values, **VISION | {"label": "each frame"})
        if rows.size >= 30:
            mean = np.convolve(values, np.ones(30) / 30.0, "valid")
            axes.plot(t[15 : 15 + mean.size], mean, color=BLUE, lw=1.4, label="mean of 30 frames")
        axes.plot(t, n, color=BLACK, lw=1.0, label="expected")
        axes.plot(t, chdtri(n, 0.025), **LIMIT, label="95 % of the frames")
        axes.plot(t, chdtri(n, 0.975), **LIMIT)
        if gate is not None:
            axes.plot(t, gate[rows], color=VERMILION, lw=1.0, ls=(0, (6, 2)), label="gate")
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylabel(label)
        axes.set_xlim(*span(time, (0.0, 1.0)))
        levels = mark(axes, marks)
        if i == 0:
            distance_axis(axes, log, levels)
        if not rows.size:
            note(axes, nothing)
            axes.set_yticks([])
            continue
        for handle, of in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(of, handle)
        top = 1.6 * max(largest(values), chdtri(float(n.max()), 0.025))
        if gate is not None:
            top = max(top, 1.2 * largest(gate[rows]))
        axes.set_ylim(0.4 * chdtri(float(n.min()), 0.975), top)
    axes.set_xlabel("time, s")
    if handles:
        legend_in_head(figure, list(handles.values()), list(handles))
    return figure
