"""What a page holds: sections of paragraphs, facts, tables, figures and text to copy."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
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

    def is_number(self, column: int) -> bool:
        """Whether a column holds numbers, and is set flush right."""
        return column > 0 and column not in self.words


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

    @property
    def head(self) -> str:
        """What it is, above or below its title."""
        return f"landsim {self.kind} report"

    def foot(self, version: str) -> str:
        """What made it, and where its numbers are."""
        numbers = "summary.json" if self.kind == "batch" else "compare.json"
        return f"Made by landsim {version}. The numbers behind every figure are in {numbers}, in the same folder."

    def labelled(self) -> tuple[tuple[Section, tuple[tuple[Block, str], ...]], ...]:
        """The sections with their blocks, each with its label: tables and figures are counted through the page."""
        tables, figures = count(1), count(1)

        def label(block: Block) -> str:
            if isinstance(block, Table):
                return f"Table {next(tables)}. {block.caption}"
            if isinstance(block, Figure):
                return f"Figure {next(figures)}. {block.chart.title}."
            return block.label if isinstance(block, Code) else ""

        return tuple((one, tuple((block, label(block)) for block in one.blocks)) for one in self.sections)


def figures_of(charts: tuple[Chart, ...], otherwise: str) -> tuple[Block, ...]:
    """Charts as figures, or a sentence where there is none."""
    return tuple(Figure(chart) for chart in charts) or (Text((otherwise,)),)
