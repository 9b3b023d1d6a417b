"""Draws the pictures of a run or a study into its folder."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from landsim.metrics import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from landsim.config import Scenario
    from landsim.study.model import Envelope

DPI = 150
PICTURES = ("profile.png", "navigation.png", "controls.png", "camera.png", "consistency.png")
"""What ``draw_run`` writes, in this order."""


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


def _save(figure: "Figure", path: Path) -> Path:
    """Write beside the path, then rename: a picture is whole or not there."""
    beside = path.with_name(f".{path.name}.part")
    try:
        figure.savefig(beside, format="png", dpi=DPI, metadata={"Software": None})
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    return path
