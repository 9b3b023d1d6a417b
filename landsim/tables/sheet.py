"""Tables that fit a terminal: in a narrow one their columns go below each other."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

UNITS = {"m": "m", "deg": "°", "mps": "m/s", "s": "s"}
"""As printed, of those at the end of names."""
NARROWEST = 40
"""Columns of a terminal in which every table has room, folded; a narrower terminal has to break the lines itself."""


def number(value: float | None, unit: str = "") -> str:
    """A figure to three digits or more, or a dash for what does not exist."""
    if value is None:
        return "–"
    digits = 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1
    space = "" if unit == "°" else " "
    return f"{value:.{digits}f}{space if unit else ''}{unit}"


class Sheet(NamedTuple):
    """A table before it is laid out: its headings, and as many cells in every row."""

    headings: Sequence[str]
    rows: "Sequence[Sequence[str | Text]]"
    note: str = ""


def fitting(sheet: Sheet, width: int) -> "Iterator[Table]":
    """The sheet as one table, or as several, each with the first column, where it is too wide."""
    columns: list[int] = []
    for i in range(1, len(sheet.headings)):
        if columns and _least_width(sheet, [*columns, i]) > width:
            yield _table(sheet, columns)
            columns = []
        columns.append(i)
    yield _table(sheet, columns)


def _table(sheet: Sheet, columns: Sequence[int]) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column(sheet.headings[0], min_width=_longest_word(sheet))
    for i in columns:
        table.add_column(sheet.headings[i], justify="right", no_wrap=True)
    for row in sheet.rows:
        table.add_row(row[0], *(row[i] for i in columns))
    return table


def _least_width(sheet: Sheet, columns: Sequence[int]) -> int:
    """Columns of the terminal that a table of these needs, with the words of its first column below each other."""
    cells = (sheet.headings, *sheet.rows)
    figures = sum(max(len(line) for row in cells for line in str(row[i]).split("\n")) for i in columns)
    return 2 + _longest_word(sheet) + figures + 2 * len(columns)  # a space at either edge, two between columns


def _longest_word(sheet: Sheet) -> int:
    return max(len(word) for row in (sheet.headings, *sheet.rows) for word in str(row[0]).split())
