"""How near the flights kept to the glide slope and the centreline, beside published criteria."""

from typing import Any

import numpy as np

from landsim.batch.flights import Flights
from landsim.batch.published import TRACKING
from landsim.batch.sections.distributions import histogram, quantiles_of
from landsim.batch.stats import rate

COLUMNS = {
    "glide_slope_to_flare": "glide slope, to the flare",
    "glide_slope": "glide slope, to the touchdown",
    "localizer": "centreline, to the touchdown",
}


def tracking(flights: Flights) -> list[dict[str, Any]]:
    """The section ``tracking``: an entry for each deviation, of the centre of gravity, from 1000 m in."""
    found = []
    for name, title in COLUMNS.items():
        entry: dict[str, Any] = {"key": name, "title": title, "unit": "m", "criteria": []}
        for of in ("rms", "p95"):
            values = flights.numbers(f"{name}_{of}_m")
            values = np.sort(values[np.isfinite(values)])
            entry[of] = {
                "n": int(values.size),
                "quantiles": quantiles_of(values, (0.5, 0.95, 0.99)) if values.size else [],
                "histogram": histogram(values) if values.size else None,
            }
            entry["criteria"] += [
                {
                    "limit": criterion.limit,
                    "text": criterion.text,
                    "estimate": criterion.estimate,
                    "source": criterion.source,
                    "kept": rate(int((values <= criterion.limit).sum()), int(values.size)),
                }
                for criterion in TRACKING
                if criterion.column == f"{name}_{of}_m"
            ]
        found.append(entry)
    return found
