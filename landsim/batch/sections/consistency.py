"""Whether the filter knows how well it knows: normalised errors and their bounds, coverage of the predicted 95 %."""

import math
from typing import Any

import numpy as np

from landsim.batch.flights import Flights
from landsim.batch.row import PHASES
from landsim.batch.sections.words import number
from landsim.batch.stats import CONFIDENCE, chi_square_bounds, mean_interval, quantile_interval
from landsim.log import QUANTITIES

DEGREES = {"nees9": 9, "nees15": 15}
"""Of the normalised errors squared: position, velocity and attitude; all states."""
EXPECTED = 0.95
"""Share of errors within the predicted 95 %."""


def consistency(flights: Flights) -> dict[str, Any]:
    """The section ``consistency``.

    The frames of one flight share their errors and are not independent; flights are.  So a flight gives one number, its
    mean over the frames, and the interval of the mean is Student's over flights.  ``bound_low`` and ``bound_high`` are
    those of as many independent frames, one a flight: a mean over correlated frames scatters no more than one frame
    does, so that a consistent filter is within them with at least the confidence.  A single flight that diverged may
    carry the mean: the median of the flights stands beside it.
    """
    nees = [_nees(flights, name, phase) for phase in PHASES for name in DEGREES]
    coverage = [_coverage(flights, quantity) for quantity in QUANTITIES]
    return {"confidence": CONFIDENCE, "nees": nees, "coverage": coverage, "text": _text(nees, coverage)}


def _nees(flights: Flights, name: str, phase: str) -> dict[str, Any]:
    means = flights.numbers(f"{name}_mean_{phase}")
    means = means[np.isfinite(means)]
    dof = DEGREES[name]
    n = int(means.size)
    frames = int(np.nansum(flights.numbers(f"frames_{phase}")))
    mean = float(means.mean()) if n else None
    middle = quantile_interval(np.sort(means), 0.5)
    interval, bound = mean_interval(means), chi_square_bounds(dof, n)
    verdict = None
    if mean is not None and bound.low is not None and bound.high is not None:
        verdict = "consistent" if bound.low <= mean <= bound.high else "optimistic" if mean > dof else "timid"
    return {
        "key": name,
        "phase": phase,
        "dof": dof,
        "flights": n,
        "frames": frames,
        "mean": mean,
        "low": interval.low,
        "high": interval.high,
        "median": {"value": float(np.median(means)) if n else None, **middle._asdict()},
        "bound_low": bound.low,
        "bound_high": bound.high,
        "errors_over_sigma": None if mean is None else math.sqrt(mean / dof),
        "verdict": verdict,
    }


def _coverage(flights: Flights, quantity: str) -> dict[str, Any]:
    shares = flights.numbers(f"coverage95_{quantity}")
    shares = shares[np.isfinite(shares)]
    interval = mean_interval(shares)
    agrees = None
    if interval.low is not None and interval.high is not None:
        agrees = bool(interval.low <= EXPECTED <= interval.high)
    return {
        "quantity": quantity,
        "expected": EXPECTED,
        "flights": int(shares.size),
        "frames": int(np.nansum(flights.numbers("coverage_frames"))),
        "mean": float(shares.mean()) if shares.size else None,
        # Student's interval knows nothing of a share's ends
        "low": None if interval.low is None else max(interval.low, 0.0),
        "high": None if interval.high is None else min(interval.high, 1.0),
        "agrees": agrees,
    }


_MEANS = {
    "consistent": "within the bounds of a consistent filter",
    "optimistic": "above them: the errors are larger than the filter says",
    "timid": "below them: the errors are smaller than the filter says",
}


_READING = (
    "The frames of a flight share their errors, so each flight counts as one number, its mean, and the intervals are"
    " over flights. The bounds are those of one independent frame a flight; a mean over frames scatters less, so that a"
    " consistent filter is within them more often than the confidence says."
)


def _text(nees: list[dict[str, Any]], coverage: list[dict[str, Any]]) -> list[str]:
    means = [
        f"{entry['phase']}, {entry['dof']} states: mean {number(entry['mean'])} (median of the flights"
        f" {number(entry['median']['value'])}), expected {entry['dof']}, bounds"
        f" {number(entry['bound_low'])} to {number(entry['bound_high'])} over {entry['flights']} flights:"
        f" {_MEANS[entry['verdict']]} (errors {number(entry['errors_over_sigma'])} times the predicted σ)."
        for entry in nees
        if entry["verdict"] is not None
    ]
    shares = [
        f"{entry['quantity'].rsplit('_', 1)[0]}: {number(100.0 * entry['mean'])} % of the frames are within the"
        f" predicted 95 %, between {number(100.0 * entry['low'])} % and {number(100.0 * entry['high'])} %, which"
        f" {'agrees' if entry['agrees'] else 'does not agree'} with {100.0 * EXPECTED:g} %."
        for entry in coverage
        if entry["agrees"] is not None
    ]
    return [_READING, *means, *shares] if means or shares else ["No flight had a filter whose errors could be judged."]
