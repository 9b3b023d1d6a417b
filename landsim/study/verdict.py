"""What holds of the bounds: a study's results as data, as in verdict.json."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from numpy.random import SeedSequence

from landsim.config import Scenario
from landsim.study.envelope import child
from landsim.study.evidence import flights_entry, meeting_entries, proportion_entries, roll_entries, shift_entries
from landsim.study.geometry import Proportion, RollLimit
from landsim.study.judged import bound_key, bounds_of, entries_of, study_of
from landsim.study.model import LEVEL, LEVELS, OF_STAGE, QUANTITIES, Envelope
from landsim.study.precision import Precision

RESAMPLING = 6
"""Place of the intervals over the flights in the study's seed, after those of `landsim.study.run`."""


def verdict_of(
    scenario: Scenario,
    seed: int,
    envelopes: Sequence[Envelope],
    listed: Sequence[Envelope],
    *,
    precisions: Sequence[Precision] = (),
    roll_limits: Sequence[RollLimit] = (),
    shifts: Iterable[tuple[float, float, float, float]] = (),
    found: Sequence[Proportion] = (),
    rows: Sequence[Mapping[str, Any]] = (),
    flown: Sequence[Envelope] = (),
) -> dict[str, Any]:
    """Everything that is judged; the paragraphs are made from it.

    Parameters
    ----------
    scenario : Scenario
        A study.
    seed : int
    envelopes, listed, precisions
        As for `entries_of`.
    roll_limits, shifts, found
        As for `roll_entries`, `shift_entries` and `proportion_entries`.
    rows, flown
        The flights and their envelopes, as for `flights_entry`.
    """
    study = study_of(scenario)
    behind = []
    if rows:
        from landsim.study.flights import flown_errors  # what flies is not needed to read a verdict

        readings = dict.fromkeys(row["line_noise"] for row in rows)
        behind = [one for reading in readings for one in flown_errors(scenario, [dict(row) for row in rows], reading)]
    stages = dict.fromkeys(e.stage for e in envelopes)
    bounds = {
        stage: {bound_key(QUANTITIES[name]): value / QUANTITIES[name].scale for name, value in of.items()}
        for stage in stages
        for of in (bounds_of(study, stage, OF_STAGE[stage]),)
    }
    return {
        "scenario": scenario.name,
        "seed": seed,
        "method": study.method,
        "stage": study.stage,
        "levels_percent": list(LEVELS),
        "judged_at_percent": LEVEL,
        "draws": {"frame": study.draws, "listed": study.listed_draws} if study.method == "sampling" else None,
        "bounds": bounds,
        "entries": entries_of(scenario, envelopes, listed, precisions, behind, child(SeedSequence(seed), RESAMPLING)),
        "meeting": meeting_entries(study, envelopes),
        "proportions": proportion_entries(found),
        "roll_limits": roll_entries(roll_limits),
        "roll_shifts": shift_entries(scenario, shifts),
        "flights": flights_entry(rows, flown, study.ranges_m, seed, study.end_height_m),
    }


def find(
    verdict: Mapping[str, Any], stage: str, reading: str, source: str = "vision", roll_error_deg: float = 0.0
) -> list[Mapping[str, Any]]:
    """The entries of one envelope, in the order of its quantities."""
    wanted = (stage, reading, source, roll_error_deg)
    return [e for e in verdict["entries"] if (e["stage"], e["reading"], e["source"], e["roll_error_deg"]) == wanted]
