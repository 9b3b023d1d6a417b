"""What precision of the lines a budget asks for, when one thing about camera, runway or approach is another."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from landsim.budget.words import reference_px, requirement_text, setting_text
from landsim.metrics import Array
from landsim.plots.printed import DPI, UNDATED
from landsim.plots.style import BLACK, BLUE, GREEN, GREY, LABEL_PT, ORANGE, SKY, STYLE, VERMILION, number

READINGS = {
    "endpoints": "σ of the two ends of each line, px",
    "edge-points": "σ of each point, spaced {spacing} px, px",
}
"""Of the noise, and what its precision is that of."""
CURVES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "ls": "-", "marker": "o"},
    {"color": VERMILION, "ls": (0, (5, 1.6)), "marker": "s"},
    {"color": BLACK, "ls": (0, (1.2, 1.2)), "marker": "^"},
    {"color": ORANGE, "ls": "-.", "marker": "D"},
    {"color": GREEN, "ls": (0, (5, 1.4, 1, 1.4, 1, 1.4)), "marker": "v"},
    {"color": SKY, "ls": (0, (9, 2)), "marker": "P"},
)
"""Colour, line style and mark of a requirement; they come again after the sixth, in a thinner line."""
ENOUGH: dict[str, Any] = {"fc": "#ececec", "ec": "none"}
THERE: dict[str, Any] = {"color": BLACK, "lw": 0.8, "ls": (0, (6, 3))}
NOW: dict[str, Any] = {"color": GREY, "lw": 0.9, "ls": "-"}
WIDTH, ROW, FOOT = 8.3, 1.95, 0.35
"""Of the figure, of a row of panels and of what is below them, inches."""
LEAST, MOST = 1e-4, 1e4
"""No precision beyond these is drawn, px."""


@rc_context(STYLE)
def budget_sweeps(budget: Mapping[str, Any]) -> Figure:
    """The line precision that each requirement needs, a row of panels a swept parameter, a column a noise reading.

    Parameters
    ----------
    budget : mapping
        As in budget.json, with at least one requirement and one sweep: None for what does not exist.
    """
    sweeps, requirements = budget["sweeps"], budget["requirements"]
    names = [requirement_text(requirement) for requirement in requirements]
    columns = 3 if max(map(len, names)) < 30 else 2
    legend_rows = -(-(len(names) + 2) // columns)
    head = 0.92 + 0.18 * legend_rows
    height = head + ROW * len(sweeps) + FOOT
    figure = Figure(figsize=(WIDTH, height))
    _head(figure, budget, height)
    grid = figure.add_gridspec(
        len(sweeps), 2, left=0.085, right=0.985, top=1.0 - (head + 0.28) / height, bottom=(FOOT + 0.12) / height,
        hspace=0.5, wspace=0.09,
    )  # fmt: skip
    limits = _limits(budget)
    for i, sweep in enumerate(sweeps):
        for j, reading in enumerate(READINGS):
            axes = figure.add_subplot(grid[i, j])
            axes.set_yscale("log")
            axes.set_ylim(*limits)
            _panel(axes, sweep, reading, requirements, reference_px(budget))
            axes.set_ylabel("σ needed, px" if j == 0 else "")
            axes.tick_params(labelleft=j == 0)
            if i == 0:
                title = READINGS[reading].format(spacing=number(budget["camera"]["point_spacing_px"]))
                axes.set_title(f"{reading}: {title}", pad=14.0, fontsize=9.5)
    handles: list[Any] = [
        Line2D([], [], lw=_width(i), ms=4.0, **CURVES[i % len(CURVES)]) for i in range(len(requirements))
    ]
    handles += [Rectangle((0, 0), 1, 1, **ENOUGH), Line2D([], [], **THERE)]
    there = f"{'precision given' if 'precision' in budget else 'noise of the scenario'}, {reference_px(budget):.3g} px"
    figure.legend(
        handles, [*names, "all bounds hold", there],
        loc="upper left", bbox_to_anchor=(0.008, 1.0 - 0.76 / height), ncols=columns, markerscale=1.0,
    )  # fmt: skip
    return figure


def save_budget(budget: Mapping[str, Any], paths: Iterable[Path]) -> None:
    """Draw the figure and write it, as PNG or as PDF by the path's ending, each beside its place and then renamed.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    figure = budget_sweeps(budget)
    for path in paths:
        ending = path.suffix.lower().removeprefix(".")
        beside = path.with_name(f".{path.name}.part")
        try:
            with rc_context({**STYLE, "pdf.fonttype": 42}):
                figure.savefig(beside, format=ending, dpi=DPI, metadata=UNDATED[ending])
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)


def _head(figure: Figure, budget: Mapping[str, Any], height: float) -> None:
    percent = budget["confidence_percent"]
    texts = (
        f"{budget['scenario']}: line precision needed to keep each bound in {percent:g} % of frames",
        setting_text(budget),
        (
            "To first order, with one thing changed in each row. Where a curve ends, a line is out of the image,"
            " or no precision keeps the bound" + _doubt(budget)
        ),
    )
    for text, below, font, colour in zip(
        texts, (0.1, 0.36, 0.54), (12.0, 8.5, 8.5), (BLACK, "#404040", "#404040"), strict=True
    ):
        room = 72.0 * 0.975 * WIDTH / (0.53 * max(len(text), 1))  # a letter is about half as wide as its size
        figure.text(0.012, 1.0 - below / height, text, va="top", fontsize=min(font, room), color=colour)


def _doubt(budget: Mapping[str, Any]) -> str:
    """What a hollow mark says, if there is one."""
    of = [requirement[reading] for requirement in budget["requirements"] for reading in READINGS]
    doubtful = any(one.get("first_order_holds") is False for one in of)
    return ". Hollow: first order is off by over 10 %" if doubtful else ""


def _width(i: int) -> float:
    return 1.5 if i < len(CURVES) else 0.8


def _panel(
    axes: Axes, sweep: Mapping[str, Any], reading: str, requirements: Sequence[Mapping[str, Any]], there: float
) -> None:
    values = np.asarray(sweep["values"], float)
    logarithmic = sweep["unit"] != "°"
    if logarithmic:
        axes.set_xscale("log")
    needed = [_drawn(row) for row in sweep["needed_noise_px"][reading]]
    # where one of them has no pose, not all bounds hold
    least = np.min(needed, axis=0)
    axes.fill_between(values, LEAST, least, where=np.isfinite(least).tolist(), zorder=0.5, lw=0.0, color=ENOUGH["fc"])
    for i, (row, requirement) in enumerate(zip(needed, requirements, strict=True)):
        # marks stand at other places on each curve, so that those which run side by side are told apart
        places = slice((1 + 2 * i) * len(values) // (4 * len(requirements)), None, max(1, len(values) // 2))
        axes.plot(values, row, lw=_width(i), zorder=3.0, ms=3.2, mew=0.0, markevery=places, **CURVES[i % len(CURVES)])
        present = sweep["present"][requirement["stage"]]
        now = _drawn([requirement[reading]["needed_noise_px"]])
        colour, doubtful = CURVES[i % len(CURVES)]["color"], requirement[reading]["first_order_holds"] is False
        axes.plot([present], now, ls="none", marker=CURVES[i % len(CURVES)]["marker"], ms=4.5, zorder=4.0,
                  mfc="white" if doubtful else colour, mec=colour if doubtful else "white",
                  mew=1.0 if doubtful else 0.5)  # fmt: skip
    if there > 0.0:
        axes.axhline(there, zorder=1.5, **THERE)
    axes.set_xlim(float(values[0]), float(values[-1]))
    stages = sorted({requirement["stage"] for requirement in requirements})
    if len({sweep["present"][stage] for stage in stages}) == 1:
        stages = stages[:1]
    for stage in stages:
        name = f"now, {stage}" if len(stages) > 1 else "now"
        _mark(axes, sweep["present"][stage], name, logarithmic)
    _ticks(axes, logarithmic)
    axes.set_xlabel(f"{sweep['label']}, {sweep['unit']}", labelpad=1.5, fontsize=9.0)


def _mark(axes: Axes, value: float, name: str, logarithmic: bool) -> None:
    """The scenario's own value, named above the panel."""
    low, high = axes.get_xlim()
    if not low <= value <= high:
        return
    axes.axvline(value, zorder=1.4, **NOW)
    share = np.log(value / low) / np.log(high / low) if logarithmic else (value - low) / (high - low)
    where = "left" if share < 0.1 else "right" if share > 0.9 else "center"
    axes.annotate(
        name, (value, 1.0), xycoords=axes.get_xaxis_transform(), xytext=(0.0, 2.0), textcoords="offset points",
        ha=where, va="bottom", fontsize=LABEL_PT, color="#404040", annotation_clip=False,
    )  # fmt: skip


def _ticks(axes: Axes, logarithmic: bool) -> None:
    plain = FuncFormatter(lambda value, _: number(value))
    for side in (axes.yaxis, axes.xaxis) if logarithmic else (axes.yaxis,):
        low, high = side.get_view_interval()
        decades = np.log10(high / low)
        subs = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if decades < 0.8 else (1.0, 2.0, 5.0) if decades < 1.8 else (1.0,)
        side.set_major_locator(LogLocator(subs=subs, numticks=20))
        side.set_major_formatter(plain)
        side.set_minor_formatter(NullFormatter())
    if not logarithmic:
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
        axes.xaxis.set_major_formatter(plain)


def _drawn(row: Sequence[float | None]) -> Array:
    """As floats: NaN for what does not exist, and for a bound that no precision keeps."""
    values = np.array([np.nan if value is None else value for value in row], float)
    return np.where(values > 0.0, values, np.nan)


def _limits(budget: Mapping[str, Any]) -> tuple[float, float]:
    """Of the axes of precision, the same in every panel, px."""
    rows = [row for sweep in budget["sweeps"] for rows in sweep["needed_noise_px"].values() for row in rows]
    values = np.concatenate([_drawn(row) for row in rows])
    values = np.append(values[np.isfinite(values)], [reference_px(budget) or 1.0])
    low, high = float(values.min()) / 1.5, float(values.max()) * 1.5
    return max(low, LEAST), max(min(high, MOST), 10.0 * max(low, LEAST))
