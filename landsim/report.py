"""Pictures of a run, a study, a batch and a comparison, and the pages of the last two, into their folder."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from landsim.metrics import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from landsim.charts.model import Chart
    from landsim.config import Scenario
    from landsim.page.document import Document
    from landsim.study.model import Envelope

DPI = 150
PICTURES = ("profile.png", "navigation.png", "controls.png", "camera.png", "consistency.png", "integrity.png")
"""What ``draw_run`` writes, in this order."""
REPORT, COMPARISON = ("report.html", "report.md"), ("compare.html", "compare.md")
"""The page, and the same as Markdown, of a batch and of a comparison."""


def draw_run(folder: Path, scenario: "Scenario", log: Log, metrics: dict[str, Any]) -> list[Path]:
    """Draw every picture of a flight.

    Parameters
    ----------
    folder : Path
        Exists; pictures of the same names in it are replaced.
    scenario : Scenario
        As flown.
    log : mapping of str to (n,) array
        The columns of ``landsim.log.COLUMNS``; n may be 0.
    metrics : dict
        Of ``landsim.metrics.flight_metrics``.

    Returns
    -------
    list of Path
        Those of ``PICTURES`` in the folder; none, and nothing is written, for a log without a row: no flight.

    Raises
    ------
    OSError
        If a picture cannot be written; what stood there before then stands there still.
    """
    if not log["time_s"].size:
        return []
    from landsim import plots  # matplotlib takes most of a second

    draw = (
        plots.profile_and_plan,
        plots.navigation_errors,
        plots.controls_and_attitude,
        plots.camera_views,
        plots.consistency,
        plots.integrity,
    )
    figures = [picture(log, scenario, metrics) for picture in draw]
    return [_save(figure, folder / name) for figure, name in zip(figures, PICTURES, strict=True)]


def draw_study(
    folder: Path, scenario: "Scenario", envelopes: "Sequence[Envelope]", verdict: dict[str, Any]
) -> list[Path]:
    """Draw every figure of a study, as PNG and as PDF.

    Parameters
    ----------
    folder : Path
        Exists; figures of the same names in it are replaced.
    scenario : Scenario
        As studied.
    envelopes : sequence of Envelope
        Of ``landsim.study.run.StudyResult``.
    verdict : dict
        As in verdict.json.

    Returns
    -------
    list of Path

    Raises
    ------
    OSError
        If a figure cannot be written.
    """
    from landsim.plots.envelope import draw_envelopes  # matplotlib takes most of a second
    from landsim.plots.tilt import draw_tilt
    from landsim.study.judged import bounds_of
    from landsim.study.model import OF_STAGE

    name, seed = verdict["scenario"], verdict["seed"]
    paths: list[Path] = []
    for stage, quantities in OF_STAGE.items():
        bounds = {} if scenario.study is None else bounds_of(scenario.study, stage, quantities)
        paths += draw_envelopes(folder, stage, envelopes, bounds, name, seed)
    if "tilt" in verdict["claims"]:
        paths += draw_tilt(folder, verdict["claims"]["tilt"], scenario, seed)
    return paths


def write_report(folder: Path, scenario: "Scenario", summary: Mapping[str, Any], *, plots: bool = True) -> list[Path]:
    """Write the report of a batch: ``report.html``, ``report.md``, and each of its figures as PNG and as PDF.

    Parameters
    ----------
    folder : Path
        Exists; files of the same names in it are replaced.
    scenario : Scenario
        Of the batch, with its dispersions.
    summary : mapping
        Of ``landsim.batch.summary.summarise``, or as summary.json has it.
    plots : bool
        Whether to draw the figures as files too; the Markdown shows none without.

    Returns
    -------
    list of Path
        The page first, then the Markdown.

    Raises
    ------
    OSError
        If a file cannot be written; what stood there before then stands there still.
    """
    from landsim.charts.batch import batch_charts
    from landsim.config import resolved_toml
    from landsim.page.batch import batch_document

    document = batch_document(summary, resolved_toml(scenario), _named(folder))
    return _write_document(folder, REPORT, document, batch_charts(summary).values() if plots else None)


def write_comparison(folder: Path, compared: Mapping[str, Any], *, plots: bool = True) -> list[Path]:
    """Write the report of a comparison: ``compare.html``, ``compare.md``, and each of its figures as PNG and as PDF.

    Parameters
    ----------
    folder : Path
        Exists; files of the same names in it are replaced.
    compared : mapping
        Of ``landsim.batch.compare.compare``, or as compare.json has it.
    plots : bool
        Whether to draw the figures as files too; the Markdown shows none without.

    Returns
    -------
    list of Path
        The page first, then the Markdown.

    Raises
    ------
    OSError
        As `write_report` does.
    """
    from landsim.charts.comparison import comparison_charts
    from landsim.page.comparison import comparison_document

    charts = comparison_charts(compared).values() if plots else None
    return _write_document(folder, COMPARISON, comparison_document(compared), charts)


def _write_document(
    folder: Path, names: tuple[str, str], document: "Document", sections: "Iterable[Sequence[Chart]] | None"
) -> list[Path]:
    """The page, the same as Markdown, and the figures that are to be drawn; the Markdown last, as it shows them."""
    from landsim import __version__
    from landsim.page.markdown import markdown_of
    from landsim.page.render import render

    page = _write(folder / names[0], render(document, __version__))
    figures = [] if sections is None else _draw_charts(folder, sections)
    text = _write(folder / names[1], markdown_of(document, __version__, pictures=sections is not None))
    return [page, text, *figures]


def _draw_charts(folder: Path, sections: "Iterable[Sequence[Chart]]") -> list[Path]:
    from landsim.plots.chart import draw_chart  # matplotlib takes most of a second

    return [path for charts in sections for chart in charts for path in draw_chart(folder, chart)]


def _named(folder: Path) -> str:
    """A folder as a shell takes it: as it was given, or its name alone where that is the whole path of a machine."""
    return shlex.quote(folder.name if folder.is_absolute() else folder.as_posix())


def _write(path: Path, text: str) -> Path:
    """Write beside the path, then rename."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text, encoding="utf-8", newline="\n")
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    return path


def _save(figure: "Figure", path: Path) -> Path:
    """Write beside the path, then rename: a picture is whole or not there."""
    beside = path.with_name(f".{path.name}.part")
    try:
        figure.savefig(beside, format="png", dpi=DPI, metadata={"Software": None})
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    return path
