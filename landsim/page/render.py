"""A document as one HTML file that asks for nothing: plotly.js, the styles and the figures are inside it."""

import json
from functools import cache
from typing import Any

from landsim.charts.model import Chart
from landsim.page.document import Code, Document, Figure, Table, Text
from landsim.page.figure import CONFIG, chart_figures
from landsim.page.legend import HEIGHT, WIDTH, legend_of

KINDS = {Text: "text", Table: "table", Figure: "figure", Code: "code"}


def render(document: Document, version: str) -> str:
    """The page.

    Parameters
    ----------
    document : Document
    version : str
        Of landsim, for its foot.

    Returns
    -------
    str
        HTML; every text of the document is escaped.
    """
    from plotly.offline import get_plotlyjs

    charts = [block.chart for section in document.sections for block in section.blocks if isinstance(block, Figure)]
    page = _environment().get_template("page.html.j2")
    return str(
        page.render(
            document=document,
            figures=_for_script([_figure(chart) for chart in charts]),
            config=_for_script(CONFIG),
            plotly=get_plotlyjs(),
            swatch=(WIDTH, HEIGHT),
            version=version,
        )
    )


def _figure(chart: Chart) -> dict[str, Any]:
    return {"name": chart.name, "panels": chart_figures(chart)}


def _for_script(value: Any) -> str:
    """JSON that can stand within a script element, whatever the texts in it."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return (
        text.replace("<", "\\u003c")
        .replace(">", "\\u003e")
        .replace("&", "\\u0026")
        .replace("\u2028", "\\u2028")
        .replace("\u2029", "\\u2029")
    )


@cache
def _environment() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("landsim.page"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["kind"] = lambda block: KINDS[type(block)]
    environment.filters["legend"] = legend_of
    environment.filters["tidy"] = lambda text: text.replace(" %", "\u00a0%")  # a number is not parted from its sign
    return environment
