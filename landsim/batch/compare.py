"""Batches side by side: what they differ in, how often each succeeds, and differences over seeds that they share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng

from estimator.so3 import Array
from landsim.batch.flights import Flights
from landsim.batch.measures import MEASURES, box_of
from landsim.batch.paired import mcnemar, paired_differences, rate_difference, table_of
from landsim.batch.row import DRAW
from landsim.batch.sections.envelopes import bands, in_the_air, paper_bounds
from landsim.batch.sections.sensitivity import RESULTS
from landsim.batch.sections.words import number, signed, span_of, with_unit
from landsim.batch.stats import CONFIDENCE, SIGNIFICANT, adjusted, exceedance, rate
from landsim.config import Scenario, ScenarioFile
from landsim.errors import InputError
from landsim.log import QUANTITIES
from landsim.plain import as_json
from landsim.schema import Section

FORMAT = 1
BINS = 60
ENVELOPES = ("p50", "p95", "count", "share")


class Batch(NamedTuple):
    """One of those that are compared."""

    name: str
    """As it is called in the comparison; no two alike."""
    scenario: Scenario
    flights: Flights


def compare(batches: Sequence[Batch | tuple[str, Scenario, Flights]]) -> dict[str, Any]:
    """The comparison, as ``compare.json`` has it.

    Parameters
    ----------
    batches : sequence of Batch
        Two or more.  The first is the reference: each other is compared with it over the seeds that both flew.

    Returns
    -------
    dict
        As JSON has it.

        ====================  ======================================================================================
        ``batches``           [``name``, ``scenario``, ``n``, ``seeds`` [first, last], ``success``: rate, ``landed``:
                              rate, ``limits``: [``key``, rate of those that missed it]]
        ``settings``          scenario keys that differ: [``key``, ``values``: one a batch, None where it has none]
        ``pairs``             each batch with the reference: [``reference``, ``other``, ``seeds`` in common,
                              ``same_draws``, ``success``: {``both``, ``reference_only``, ``other_only``, ``neither``,
                              ``difference``, ``low``, ``high``, ``mcnemar_p``}, ``metrics``: [``key``, ``title``,
                              ``unit``, ``n``, ``mean`` and ``shift`` {``value``, ``low``, ``high``}, ``wilcoxon_p``,
                              ``p_adjusted`` for their number, ``significant``], ``text``]; a difference is the other
                              less the reference, its shift Hodges and Lehmann's
        ``distributions``     [``key``, ``title``, ``unit``, ``edges``, ``limits``, ``batches``: [``name``, ``n``,
                              ``counts``, ``ecdf`` {``x``, ``share``}, ``exceedance``]]
        ``envelopes``         ``distance_m``, ``series``: [``source``, ``quantity``, ``unit``, ``batches``: [``name``,
                              ``p50``, ``p95``, ``count``, ``share``]], ``bounds``; None if the batches have not one
                              distance in common
        ====================  ======================================================================================

    Raises
    ------
    InputError
        If there are fewer than two, two have one name, or one shares no seed with the first.
    """
    flown = [Batch(*batch) for batch in batches]
    if len(flown) < 2:
        raise InputError(f"a comparison needs two batches or more, not {len(flown)}")
    names = [batch.name for batch in flown]
    if len(set(names)) < len(names):
        raise InputError(f"two of the batches are called {max(names, key=names.count)}: give each its own name")
    reference, *others = flown
    return dict(
        as_json(
            {
                "format": FORMAT,
                "confidence": CONFIDENCE,
                "batches": [_overview(batch) for batch in flown],
                "settings": _settings(flown),
                "pairs": [_pair(reference, other) for other in others],
                "distributions": _distributions(flown),
                "envelopes": _envelopes(flown),
            }
        )
    )


def _overview(batch: Batch) -> dict[str, Any]:
    flights = batch.flights
    limits = []
    for limit in box_of(batch.scenario):
        values = flights.numbers(limit.measure.key)
        missed = rate(int(limit.missed(values).sum()), int(np.isfinite(values).sum()))
        limits.append({"key": limit.key, "title": limit.measure.symbol, "limit": limit.limit, **missed})
    return {
        "name": batch.name,
        "scenario": batch.scenario.name,
        "n": flights.n,
        "seeds": span_of(flights.columns["seed"]),
        "success": rate(int(flights.flags("in_box").sum()), flights.n),
        "landed": rate(int(flights.are("outcome", "landed").sum()), flights.n),
        "limits": limits,
    }


def _settings(batches: Sequence[Batch]) -> list[dict[str, Any]]:
    """The keys that are not the same in all, in the order of the file."""
    tables = [_keys(batch.scenario) for batch in batches]
    keys = dict.fromkeys(key for table in tables for key in table)
    found = [{"key": key, "values": [table.get(key) for table in tables]} for key in keys]
    return [entry for entry in found if any(value != entry["values"][0] for value in entry["values"])]


def _keys(scenario: Scenario) -> dict[str, Any]:
    """Dotted key and value of all that a scenario file says."""
    result: dict[str, Any] = {}
    for name in ScenarioFile.model_fields:
        value = getattr(scenario, name)
        _flatten(value.model_dump(mode="json") if isinstance(value, Section) else value, name, result)
    return result


def _flatten(value: Any, key: str, into: dict[str, Any]) -> None:
    if isinstance(value, dict):
        for name, inner in value.items():
            _flatten(inner, f"{key}.{name}", into)
    elif value is not None:
        into[key] = value


def _pair(reference: Batch, other: Batch) -> dict[str, Any]:
    """The other batch less the reference, over the seeds of both."""
    here, there = _shared(reference, other)
    first, second = reference.flights, other.flights
    success = table_of(first.flags("in_box")[here], second.flags("in_box")[there])
    streams = SeedSequence(0).spawn(len(RESULTS))  # the intervals must not change from one look to the next
    metrics = [
        {
            "key": result.key,
            "title": result.title,
            "unit": result.unit,
            **paired_differences(
                result.take(first.numbers(result.column))[here],
                result.take(second.numbers(result.column))[there],
                default_rng(stream),
            ),
        }
        for result, stream in zip(RESULTS, streams, strict=True)
        if result.key != "in_box"
    ]
    found = {
        "reference": reference.name,
        "other": other.name,
        "seeds": len(here),
        "same_draws": _same_draws(first, second, here, there),
        "success": {
            "both": success.both,
            "reference_only": success.first,
            "other_only": success.second,
            "neither": success.neither,
            **rate_difference(success),
            "mcnemar_p": mcnemar(success),
        },
        "metrics": metrics,
    }
    p = adjusted([np.nan if metric["wilcoxon_p"] is None else metric["wilcoxon_p"] for metric in metrics])
    for metric, one in zip(metrics, p.tolist(), strict=True):
        known = metric["wilcoxon_p"] is not None
        metric["p_adjusted"], metric["significant"] = (one, one < SIGNIFICANT) if known else (None, None)
    found["text"] = _text(found)
    return found


def _shared(reference: Batch, other: Batch) -> tuple[list[int], list[int]]:
    """Rows of either batch that have one seed."""
    rows = {seed: row for row, seed in enumerate(other.flights.columns["seed"])}
    found = [(row, rows[seed]) for row, seed in enumerate(reference.flights.columns["seed"]) if seed in rows]
    if not found:
        raise InputError(
            f"{reference.name} and {other.name} have no seed in common, so that their flights cannot be compared:"
            " fly both with the same --seed"
        )
    return [pair[0] for pair in found], [pair[1] for pair in found]


def _same_draws(first: Flights, second: Flights, here: list[int], there: list[int]) -> bool:
    """Whether flights of one seed have the same draws, of the keys that both batches draw."""
    keys = [f"{DRAW}{key}" for key in first.draws if key in second.draws]
    return all(np.array_equal(first.numbers(k)[here], second.numbers(k)[there], equal_nan=True) for k in keys)


def _text(pair: dict[str, Any]) -> list[str]:
    s, other, reference = pair["success"], pair["other"], pair["reference"]
    found = [
        f"{metric['title']} {with_unit(metric['shift']['value'], metric['unit'], sign=True)}"
        f" ({signed(metric['shift']['low'])} to {signed(metric['shift']['high'])})"
        for metric in pair["metrics"]
        if metric["significant"]
    ]
    p = "" if s["mcnemar_p"] is None else f" (McNemar's exact p {number(s['mcnemar_p'])})"
    outcome = (
        f"Of {pair['seeds']} common seeds {s['both']} succeeded in both, {s['reference_only']} in {reference} alone,"
        f" {s['other_only']} in {other} alone, {s['neither']} in neither."
    )
    difference = (
        f"The success rate of {other} less that of {reference} is {signed(100.0 * s['difference'])} points, between"
        f" {signed(100.0 * s['low'])} and {signed(100.0 * s['high'])} with {100.0 * CONFIDENCE:g} % confidence{p}."
    )
    others = f"No other number of {other} differs significantly from that of {reference}."
    if found:
        others = (
            f"Shift of {other} from {reference} (Hodges–Lehmann), where Wilcoxon's signed ranks differ significantly:"
            f" {'; '.join(found)}."
        )
    text = [outcome, difference, others]
    if not pair["same_draws"]:
        text.append(
            "The flights of one seed do not have the same draws in both: the differences are not over equal conditions,"
            " and the pairing removes less of the scatter."
        )
    return text


def _distributions(batches: Sequence[Batch]) -> list[dict[str, Any]]:
    """Histograms on common bins, and the shares below and beyond."""
    found = []
    for measure in MEASURES:
        samples = [_known(batch.flights.numbers(measure.key)) for batch in batches]
        everything = np.concatenate(samples)
        if not everything.size:
            continue
        low, high = float(everything.min()), float(everything.max())
        bins = min(max(len(np.histogram_bin_edges(everything, "auto")) - 1, 1), BINS) if low < high else 1
        edges = np.linspace(low, high, bins + 1) if low < high else np.array((low - 0.5, low + 0.5))
        limits = [
            {"batch": b.name, "key": limit.key, "value": limit.limit, "side": limit.side}
            for b in batches
            for limit in box_of(b.scenario)
            if limit.measure == measure
        ]
        found.append(
            {
                "key": measure.key,
                "title": measure.title,
                "unit": measure.unit,
                "magnitude": measure.magnitude,
                "edges": edges,
                "limits": limits,
                "batches": [
                    {"name": batch.name, **_shape(sample, edges, magnitude=measure.magnitude)}
                    for batch, sample in zip(batches, samples, strict=True)
                ],
            }
        )
    return found


def _shape(sample: Array, edges: Array, *, magnitude: bool) -> dict[str, Any]:
    if not sample.size:
        return {"n": 0, "counts": np.zeros(edges.size - 1, dtype=int), "ecdf": None, "exceedance": None}
    ordered = np.sort(sample)
    rows = np.unique(np.linspace(0, ordered.size - 1, min(ordered.size, 300)).astype(int))
    return {
        "n": int(ordered.size),
        "counts": np.histogram(ordered, edges)[0],
        "ecdf": {"x": ordered[rows], "share": (rows + 1) / ordered.size},
        "exceedance": exceedance(np.sort(np.abs(ordered)) if magnitude else ordered)._asdict(),
    }


def _known(values: Array) -> Array:
    return np.asarray(values[np.isfinite(values)])


def _envelopes(batches: Sequence[Batch]) -> dict[str, Any] | None:
    """Percentiles by distance, at the distances that all have."""
    distance = batches[0].flights.distances
    for batch in batches[1:]:
        distance = np.intersect1d(distance, batch.flights.distances)
    if not distance.size:
        return None
    distance = np.sort(distance)[::-1]
    places = [np.flatnonzero(np.isin(batch.flights.distances, distance)) for batch in batches]
    airborne = [in_the_air(batch.flights) for batch in batches]
    series = []
    for source in ("vision", "fused"):
        for quantity in QUANTITIES:
            lines = []
            for batch, place, counted in zip(batches, places, airborne, strict=True):
                of = bands(batch.flights.arrays[f"{source}_error_{quantity}"][:, place], counted[:, place])
                lines.append({"name": batch.name, **{key: of[key] for key in ENVELOPES}})
            series.append(
                {"source": source, "quantity": quantity, "unit": quantity.rsplit("_", 1)[1], "batches": lines}
            )
    return {"distance_m": distance, "series": series, "bounds": paper_bounds()}
