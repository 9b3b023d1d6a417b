"""What a chart shows, and nothing of how it is drawn.

A chart is data: panels with axes that say their unit, series, limits and labels.  Each renderer, matplotlib for paper
and Plotly for the page, draws the same one, so that a picture and the page cannot show different numbers.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

Tone: TypeAlias = Literal["ink", "grey", "pale", "blue", "sky", "orange", "vermilion", "green", "purple"]
"""A colour by its name; those that lie over each other in a chart also differ in dash, marker or lightness."""
Dash: TypeAlias = Literal["solid", "dash", "dot", "dashdot"]
Mark: TypeAlias = Literal["dot", "cross", "ring", "diamond", "square", "triangle", "none"]
Step: TypeAlias = Literal["", "before", "after"]
"""A curve that is level between its points has each number before it, down from the last point, or after it."""
Numbers: TypeAlias = tuple[float | None, ...]
"""None where there is no number: a gap in a curve."""

COLOURS: dict[Tone, str] = {
    "ink": "#000000",
    "grey": "#7f7f7f",
    "pale": "#d9d9d9",
    "blue": "#0072B2",
    "sky": "#56B4E9",
    "orange": "#E69F00",
    "vermilion": "#D55E00",
    "green": "#009E73",
    "purple": "#CC79A7",
}
"""Okabe and Ito's, which keep apart for the colour-blind; grey ones beside them."""


@dataclass(frozen=True)
class Axis:
    """One axis of a panel."""

    name: str
    """What is along it."""
    unit: str = ""
    """Of its numbers, as printed; empty for a plain number."""
    log: bool = False
    span: tuple[float, float] | None = None
    """From the left or the bottom to the other end, falling where it runs backward; None is what the data needs."""
    whole: bool = False
    """Whether its numbers are counts."""
    ticks: tuple[str, ...] = ()
    """Names at 0, 1, 2, ..: the axis of a list of things.  Without them, numbers."""

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name}, {self.unit}" if self.unit else self.name


@dataclass(frozen=True)
class Curve:
    """A line through points; an ellipse is one that comes back to where it began."""

    name: str
    x: Numbers
    y: Numbers
    tone: Tone = "blue"
    dash: Dash = "solid"
    width: float = 1.2
    """Points."""
    step: Step = ""
    legend: bool = True
    """Whether the legend names it."""


@dataclass(frozen=True)
class Band:
    """What lies between two curves."""

    name: str
    x: Numbers
    low: Numbers
    high: Numbers
    tone: Tone = "blue"
    strength: float = 0.2
    """Opacity, 0 to 1."""
    step: Step = ""
    legend: bool = True


@dataclass(frozen=True)
class Points:
    """Marks, each with what to say of it, and bars of what it may be off by."""

    name: str
    x: Numbers
    y: Numbers
    tone: Tone = "blue"
    mark: Mark = "dot"
    size: float = 3.5
    """Points."""
    hover: tuple[str, ...] = ()
    """A line or several for each, beside its numbers; none, or as many as there are points."""
    x_bar: tuple[Numbers, Numbers] | None = None
    """From where to where along x."""
    y_bar: tuple[Numbers, Numbers] | None = None
    bar_width: float = 1.0
    """Points."""
    legend: bool = True


@dataclass(frozen=True)
class Histogram:
    """How many in each bin."""

    name: str
    edges: tuple[float, ...]
    """(n + 1,)"""
    heights: tuple[float, ...]
    """(n,)"""
    tone: Tone = "blue"
    dash: Dash = "solid"
    filled: bool = True
    """Otherwise its outline alone, as when several lie over each other."""
    legend: bool = True


@dataclass(frozen=True)
class Cells:
    """A number from -1 to 1 at each crossing of two lists of names."""

    name: str
    values: tuple[Numbers, ...]
    """A row a name of y, a column a name of x."""
    texts: tuple[tuple[str, ...], ...]
    """What is written into each; empty for nothing."""
    hover: tuple[tuple[str, ...], ...]
    legend: bool = False


@dataclass(frozen=True)
class Limit:
    """A line right across the panel, at a value of one axis, with its name beside it."""

    along: Literal["x", "y"]
    """The axis whose value it is at."""
    at: float
    label: str
    tone: Tone = "green"
    dash: Dash = "dash"


@dataclass(frozen=True)
class Region:
    """A rectangle, behind the data or around it; None is the end of the panel."""

    x: tuple[float | None, float | None]
    y: tuple[float | None, float | None]
    label: str = ""
    tone: Tone = "green"
    fill: float = 0.0
    """Opacity; 0 is its outline alone."""
    outline: bool = True
    dash: Dash = "solid"


@dataclass(frozen=True)
class Note:
    """A few words in the middle of a panel, where there is nothing else to see."""

    text: str


Series: TypeAlias = Curve | Band | Points | Histogram | Cells
Mention: TypeAlias = Limit | Region | Note


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    x: Axis
    y: Axis
    series: tuple[Series, ...] = ()
    mentions: tuple[Mention, ...] = ()
    title: str = ""
    height: float = 1.0
    """Against that of an ordinary panel."""


@dataclass(frozen=True)
class Chart:
    """A figure: what it shows, its panels and how many of them stand side by side."""

    name: str
    """Of its files, and of its place on the page: small letters, digits and hyphens."""
    title: str
    panels: tuple[Panel, ...]
    columns: int = 1
    caption: str = ""
    """What one has to know to read it."""
    subtitle: str = ""
    """Of what: scenario, flights and seeds, for a figure that stands alone."""

    @property
    def alternative(self) -> str:
        """What stands for the figure where it cannot be seen."""
        seen = "; ".join(f"{panel.y.label} over {panel.x.label}" for panel in self.panels)
        return f"{self.title}. {seen}."
