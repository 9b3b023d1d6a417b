"""The charts of a batch, from its summary alone: what is drawn stands in summary.json."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from landsim.charts.landing import distribution_charts, margin_charts, rate_charts, touchdown_charts, tracking_charts
from landsim.charts.model import Chart
from landsim.charts.navigation import consistency_charts, envelope_charts, sensitivity_charts
from landsim.charts.shared import flown

SECTIONS = {
    "verdict": margin_charts,
    "outcomes": rate_charts,
    "touchdown": touchdown_charts,
    "distributions": distribution_charts,
    "tracking": tracking_charts,
    "navigation": envelope_charts,
    "consistency": consistency_charts,
    "sensitivity": sensitivity_charts,
}
"""Section of the report to what makes its charts."""


def batch_charts(summary: Mapping[str, Any]) -> dict[str, tuple[Chart, ...]]:
    """Every chart of a batch, by section of its report.

    Parameters
    ----------
    summary : mapping
        Of ``landsim.batch.summary.summarise``.

    Returns
    -------
    dict of str to tuple of Chart
        Each of `SECTIONS`; a section has none where there is nothing to show.
    """
    batch = summary["batch"]
    of = flown(batch["scenario"], batch["n"], batch["seeds"])
    if batch["shard"] not in {None, "1/1"}:
        of += f", shard {batch['shard']}"
    return {
        section: tuple(replace(chart, subtitle=of) for chart in charts(summary)) for section, charts in SECTIONS.items()
    }
