"""Draws the pictures of a run into its folder."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from landsim.metrics import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from landsim.config import Scenario

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


def _save(figure: "Figure", path: Path) -> Path:
    """Write beside the path, then rename: a picture is whole or not there."""
    beside = path.with_name(f".{path.name}.part")
    try:
        figure.savefig(beside, format="png", dpi=DPI, metadata={"Software": None})
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    return path
