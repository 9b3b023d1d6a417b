"""What a page holds: sections of paragraphs, facts, tables, figures and text to copy."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from landsim.charts.model import Chart


@dataclass(frozen=True)
class Text:
    """Paragraphs, or the points of a list."""

    paragraphs: tuple[str, ...]
    points: bool = False
    lead: bool = False
    """Whether it is what the page says first."""


@dataclass(frozen=True)
class Cell:
    """A cell of a table."""

    text: str
    command: bool = False
    """Something to type, which can be copied."""


@dataclass(frozen=True)
class Table:
    """A table; the first column says what a row is about."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str | Cell, ...], ...]
    words: frozenset[int] = frozenset()
    """Columns that hold words, and are set flush left like the first; others hold numbers."""


@dataclass(frozen=True)
class Figure:
    """A chart in its place."""

    chart: Chart


@dataclass(frozen=True)
class Code:
    """Text to read as it stands, and to copy."""

    label: str
    text: str
    folded: bool = False
    """Whether it is shown when asked for; a print has it in any case."""


Block: TypeAlias = Text | Table | Figure | Code
Charts: TypeAlias = Mapping[str, tuple[Chart, ...]]
"""By section."""


@dataclass(frozen=True)
class Section:
    """A part of a page with a place in its table of contents."""

    name: str
    """Its id."""
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Fact:
    """One of the few numbers at the head of a page."""

    name: str
    value: str
    detail: str = ""


@dataclass(frozen=True)
class Document:
    """A page."""

    kind: Literal["batch", "comparison"]
    title: str
    subtitle: str
    facts: tuple[Fact, ...]
    sections: tuple[Section, ...]


def figures_of(charts: tuple[Chart, ...], otherwise: str) -> tuple[Block, ...]:
    """Charts as figures, or a sentence where there is none."""
    return tuple(Figure(chart) for chart in charts) or (Text((otherwise,)),)
