"""The tables at the end of a flight, from its metrics, and of a study, from its verdict.

In a narrow terminal their columns go below each other.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from landsim.errors import one_line

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table
    from rich.text import Text

_NAMES = {
    "glide_slope_m": "off the glide slope",
    "glide_slope_to_flare_m": "off the glide slope, to the flare",
    "localizer_m": "off the centreline",
}
_UNITS = {"m": "m", "deg": "°", "mps": "m/s", "s": "s"}
NARROWEST = 40
"""Columns of a terminal in which every table has room, folded; a narrower terminal has to break the lines itself."""


def number(value: float | None, unit: str = "") -> str:
    """A figure to three digits or more, or a dash for what does not exist."""
    if value is None:
        return "–"
    digits = 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1
    space = "" if unit == "°" else " "
    return f"{value:.{digits}f}{space if unit else ''}{unit}"


def flight_tables(metrics: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """What a flight was worth: its outcome in a line, then touchdown and stop, tracking and navigation.

    Parameters
    ----------
    metrics : mapping
        As in metrics.json: None for what does not exist.
    width : int
        Columns of the terminal, at least ``NARROWEST``: no figure is cut.
    """
    from rich.text import Text

    landed = metrics["outcome"] == "landed"
    verdict = "in the box" if metrics["in_box"] else "not in the box"
    reason = metrics.get("reason")
    yield Text.assemble(
        f"{one_line(metrics['scenario'])}, seed {metrics['seed']}: ",
        (metrics["outcome"], "bold green" if landed else "bold red"),
        f", {verdict}" if landed else f": {one_line(reason)}" if reason else "",
    )
    for sheet in (_touchdown(metrics), _tracking(metrics), _navigation(metrics)):
        yield from _fitting(sheet, width)
        if sheet.note:
            yield Text(sheet.note + "\n", style="dim")


class _Sheet(NamedTuple):
    """A table before it is laid out: its headings, and as many cells in every row."""

    headings: Sequence[str]
    rows: "Sequence[Sequence[str | Text]]"
    note: str = ""


def _fitting(sheet: _Sheet, width: int) -> "Iterator[Table]":
    """The sheet as one table, or as several, each with the first column, where it is too wide."""
    columns: list[int] = []
    for i in range(1, len(sheet.headings)):
        if columns and _least_width(sheet, [*columns, i]) > width:
            yield _table(sheet, columns)
            columns = []
        columns.append(i)
    yield _table(sheet, columns)


def _table(sheet: _Sheet, columns: Sequence[int]) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column(sheet.headings[0], min_width=_longest_word(sheet))
    for i in columns:
        table.add_column(sheet.headings[i], justify="right", no_wrap=True)
    for row in sheet.rows:
        table.add_row(row[0], *(row[i] for i in columns))
    return table


def _least_width(sheet: _Sheet, columns: Sequence[int]) -> int:
    """Columns of the terminal that a table of these needs, with the words of its first column below each other."""
    cells = (sheet.headings, *sheet.rows)
    figures = sum(max(len(line) for row in cells for line in str(row[i]).split("\n")) for i in columns)
    return 2 + _longest_word(sheet) + figures + 2 * len(columns)  # a space at either edge, two between columns


def _longest_word(sheet: _Sheet) -> int:
    return max(len(word) for row in (sheet.headings, *sheet.rows) for word in str(row[0]).split())


def _touchdown(metrics: Mapping[str, Any]) -> _Sheet:
    from rich.text import Text

    touchdown, stop, limits = metrics["touchdown"] or {}, metrics["stop"] or {}, metrics.get("box") or {}
    rows: list[list[str | Text]] = []

    def row(name: str, value: float | None, unit: str, sign: str = "", *keys: str) -> None:
        known = [limits[key] for key in keys if key in limits]
        bounds = " … ".join(f"{limit['limit']:g}" for limit in known)
        bounds = f"{sign} {bounds}{'' if unit == '°' else ' '}{unit}".lstrip() if known else ""
        kept = all(limit["ok"] for limit in known)
        mark = Text("" if not known else "ok" if kept else "out", style="green" if kept else "red")
        rows.append([name, number(value, unit), bounds, mark])

    row("past the threshold", touchdown.get("x_m"), "m", "", "along_min_m", "along_max_m")
    row("right of the centreline", touchdown.get("y_m"), "m", "±", "cross_max_m")
    row("sink rate", touchdown.get("sink_rate_mps"), "m/s", "≤", "sink_max_mps")
    row("bank", touchdown.get("bank_deg"), "°", "±", "bank_max_deg")
    row("pitch", touchdown.get("pitch_deg"), "°")
    row("heading error", touchdown.get("heading_error_deg"), "°")
    row("ground speed", touchdown.get("ground_speed_mps"), "m/s")
    row("stop, past the threshold", stop.get("x_m"), "m")
    row("stop, right of the centreline", stop.get("y_m"), "m", "±", "stop_cross_max_m")
    return _Sheet(("touchdown", "value", "box", ""), rows)


def _tracking(metrics: Mapping[str, Any]) -> _Sheet:
    tracking = metrics["tracking"]
    order = [*(key for key in _NAMES if key in tracking), *(key for key in tracking if key not in _NAMES)]
    rows = []
    for key in order:
        name, _, suffix = key.rpartition("_")
        rows.append([_NAMES.get(key, name), *(number(tracking[key][kind], _UNITS[suffix]) for kind in ("rms", "p95"))])
    return _Sheet(("tracking", "rms", "p95"), rows)


_OWN = (("fused rms", "fused", "rms"), ("fused p95", "fused", "p95"))
_BOTH = (("both: fused rms", "fused", "paired_rms"), ("both: vision rms", "vision", "paired_rms"))
_VISION = (("vision rms", "vision", "rms"), ("vision p95", "vision", "p95"))


def _navigation(metrics: Mapping[str, Any]) -> _Sheet:
    """Errors of the filter and of vision; those over the frames that both have are told apart from those over all."""
    fused, vision = (metrics["navigation"][source] for source in ("fused", "vision"))
    columns = (
        *_OWN,
        *_VISION,
        ("both: fused rms", "fused", "paired_rms"),
        ("both: vision rms", "vision", "paired_rms"),
    )
    note = f"fused: {_frames(fused, 'frames', 'steps')}; vision: {_frames(vision, 'frames')}"
    note += f"; both: {_frames(vision, 'paired_frames')} that have both"
    rows = []
    for quantity in fused:
        name, _, suffix = quantity.rpartition("_")
        sources = {"fused": fused[quantity], "vision": vision[quantity]}
        rows.append([f"{name}, {_UNITS[suffix]}", *(number(sources[source].get(kind)) for _, source, kind in columns)])
    return _Sheet(("navigation", *(heading.replace(" ", "\n") for heading, _, _ in columns)), rows, note)


def _frames(figures: Mapping[str, Mapping[str, Any]], key: str, what: str = "frames") -> str:
    """Over how many frames the quantities were counted: a number, or the least and the greatest."""
    counts = sorted({of[key] for of in figures.values() if key in of})
    return f"{' to '.join(map(str, counts[:: len(counts) - 1 or 1]))} {what}"


def study_tables(verdict: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """What holds of the bounds: a table for each stage, source, noise reading and roll error, then the paragraphs.

    Parameters
    ----------
    verdict : mapping
        As in verdict.json.
    width : int
        Columns of the terminal, at least ``NARROWEST``: no figure is cut.
    """
    from rich.text import Text

    from landsim.study.markdown import groups_of

    yield Text(f"{one_line(verdict['scenario'])}, seed {verdict['seed']}", style="bold")
    for name, entries in groups_of(verdict):
        yield Text(f"\n{name}: 95 % of the errors stay below", style="bold")
        yield from _fitting(_errors(entries), width)
    for text in verdict["paragraphs"].values():
        yield Text(f"{text}\n")


def _errors(entries: Sequence[Mapping[str, Any]]) -> _Sheet:
    """The 95th percentiles at the listed ranges, and what becomes of the bound."""
    from rich.text import Text

    from landsim.study.markdown import cell, needed, said
    from landsim.study.paragraphs import figure

    ranges = [row["range_m"] for row in entries[0]["listed"]]
    solved = any(e["precision"] is not None for e in entries)
    unit = "px" if entries[0]["reading"] == "endpoints" else "points"
    headings = ["", "bound", *(f"{figure(r)} m" for r in ranges), "holds", *([f"needs {unit}"] if solved else [])]
    rows: list[list[str | Text]] = []
    for e in entries:
        cells: list[str | Text] = [f"{e['quantity']}, {_UNITS[e['unit']]}"]
        cells.append("–" if e["bound"] is None else figure(e["bound"]))
        cells += [cell(row, "p95") for row in e["listed"]]
        short = {"holds": "yes", "does not hold": "no"}.get(said(e), said(e))
        cells.append(Text(short, style="" if e["holds"] is None else "green" if e["holds"] else "red"))
        rows.append(cells + ([needed(e).removesuffix(f" {unit}")] if solved else []))
    return _Sheet(headings, rows)


def budget_tables(budget: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """What precision of the lines the bounds need, and where they hold with a given one.

    Parameters
    ----------
    budget : mapping
        As in budget.json: None for what does not exist.
    width : int
        Columns of the terminal, at least ``NARROWEST``: no figure is cut.
    """
    from rich.text import Text

    from landsim.budget.words import binding_text, setting_text

    percent = f"{budget['confidence_percent']:g} %"
    yield Text(f"{one_line(budget['scenario'])}: bounds kept in {percent} of the frames, to first order", style="bold")
    yield Text(setting_text(budget))
    if any(requirement["stage"] for requirement in budget["requirements"]):
        sheet = _needs(budget)
        yield from _fitting(sheet, width)
        yield Text(sheet.note, style="dim")
        yield Text(binding_text(budget) + "\n")
    if "precision" in budget:
        sheet = _held(budget)
        yield from _fitting(sheet, width)
        yield Text(sheet.note + "\n", style="dim")


def _needs(budget: Mapping[str, Any]) -> _Sheet:
    """The precision that each requirement with a range needs of each reading."""
    from rich.text import Text

    from landsim.budget.words import amount, reference_px, requirement_text, unit_of
    from landsim.study.model import READINGS

    drawn, there, noise = "confirmed" in budget, reference_px(budget), budget["camera"]["noise_px"]
    headings = ["requirement", "stage", "keeps now", "needs σ", *(["drawn"] if drawn else [])]
    headings += ["or points", "now"]
    rows: list[list[str | Text]] = []
    finer = doubtful = False
    for requirement in budget["requirements"]:
        if requirement["stage"] is None:
            continue
        unit = unit_of(requirement)
        name, stage = requirement_text(requirement), requirement["stage"]
        for reading in READINGS:
            of = requirement[reading]
            points = of.get("needed_points")
            present = of[f"present_{unit}"]
            cells: list[str | Text] = [f"{name}, {reading}", stage]
            cells += ["–" if present is None else amount(present, unit, ".3g"), _needed(of, there)]
            doubtful |= of["first_order_holds"] is False
            if drawn:
                cells.append(f"{of['inside_percent']:.1f} %" if "inside_percent" in of else "–")
            if points:
                closer = of["needed_spacing_px"] < 1.0
                finer |= closer
                cells += [
                    "/".join(map(str, points)) + ("*" if closer else ""),
                    "/".join(map(str, of["present_points"])),
                ]
            else:
                cells += ["", ""]
            rows.append(cells)
    note = (
        f"now: σ = {noise:.3g} px; points: a line, of that σ, on left edge/threshold/right edge, late on the two edges"
    )
    note += "; * closer than a pixel to each other" if finer else ""
    note += f"; {_doubt(budget)}" if doubtful else ""
    if drawn:
        note += f"; drawn: of {budget['confirmed']['draws']} draws with the σ needed, so many were within the bound"
    return _Sheet(headings, rows, note)


def _needed(of: Mapping[str, Any], there: float) -> "Text":
    """The σ that one requirement needs of one reading."""
    from rich.text import Text

    needed = of["needed_noise_px"]
    if needed is None:
        return Text("none", style="red")
    if not of["first_order_holds"]:
        return Text(f"{needed:.3g} px ?", style="yellow")
    return Text(f"{needed:.3g} px", style="green" if there <= needed else "red")


def _doubt(budget: Mapping[str, Any]) -> str:
    """What the mark of a figure says that drawing does not bear out."""
    percent = f"{budget['checked']['off_by_percent']:g} %"
    return f"? not to be trusted: as drawing shows, first order is off by more than {percent} there"


def _held(budget: Mapping[str, Any]) -> _Sheet:
    """Where each bound holds with the precision given."""
    from landsim.budget.words import requirement_text, signed

    precision = budget["precision"]
    rows: list[list[str]] = []
    doubtful = False
    for requirement in budget["requirements"]:
        cells = [requirement_text(requirement)]
        for reading in ("endpoints", "edge-points"):
            stretches = []
            for of in requirement[reading]["holds"]:
                mark = "" if of["first_order_holds"] else " ?"
                stretches.append(f"{signed(of['from_m'], '.4g')} … {signed(of['to_m'], '.4g')} m{mark}")
                doubtful |= bool(mark)
            cells.append("\n".join(stretches) or "nowhere")
        rows.append(cells)
    note = "the lines are never all in the image"
    if precision["far_m"] is not None:
        note = f"looked at from {signed(precision['far_m'], '.4g')} m to {signed(precision['end_m'], '.4g')} m; "
        if precision["hand_over_m"] is None:
            note += "the threshold, and with it roll and along, is never in the image"
        else:
            over = signed(precision["hand_over_m"], ".4g")
            note += f"the threshold leaves the image at {over} m, and with it roll and along"
    note += f"; {_doubt(budget)}, at one end or both" if doubtful else ""
    px = f"{precision['noise_px']:.3g} px"
    return _Sheet(("requirement", f"endpoints\nholds with {px}", f"edge-points\nholds with {px}"), rows, note)
