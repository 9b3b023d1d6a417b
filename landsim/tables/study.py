"""What holds of the bounds of a study."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from landsim.errors import one_line
from landsim.tables.sheet import UNITS, Sheet, fitting

if TYPE_CHECKING:
    from rich.console import RenderableType


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
        yield from fitting(_errors(entries), width)
    for text in verdict["paragraphs"].values():
        yield Text(f"{text}\n")


def _errors(entries: Sequence[Mapping[str, Any]]) -> Sheet:
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
        cells: list[str | Text] = [f"{e['quantity']}, {UNITS[e['unit']]}"]
        cells.append("–" if e["bound"] is None else figure(e["bound"]))
        cells += [cell(row, "p95") for row in e["listed"]]
        short = {"holds": "yes", "does not hold": "no"}.get(said(e), said(e))
        cells.append(Text(short, style="" if e["holds"] is None else "green" if e["holds"] else "red"))
        rows.append(cells + ([needed(e).removesuffix(f" {unit}")] if solved else []))
    return Sheet(headings, rows)
