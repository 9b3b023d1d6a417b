"""Batches side by side: counts, differences and settings that are known beforehand."""

import json
from typing import Any

import numpy as np
import pytest
from flown import DISTANCE, failed, good
from numpy.random import default_rng

from landsim.batch.compare import Batch, compare
from landsim.batch.flights import flights_of
from landsim.batch.row import Row
from landsim.config import load_scenario
from landsim.errors import InputError

SCENARIO = load_scenario("landing")
OTHER = load_scenario("landing", overrides={"camera.line_noise": "endpoints", "runway.width_m": 45.0})


def compared(*batches: tuple[str, list[Row]]) -> dict[str, Any]:
    scenarios = [SCENARIO, OTHER, OTHER]
    found = compare([(name, scenarios[i], flights_of(rows)) for i, (name, rows) in enumerate(batches)])
    json.dumps(found, allow_nan=False)
    return found


def one(entries: list[dict[str, Any]], **named: Any) -> dict[str, Any]:
    (found,) = [entry for entry in entries if all(entry[key] == value for key, value in named.items())]
    return found


def test_common_seeds_are_paired_whatever_their_order() -> None:
    """Seeds 0 to 29 and 39 to 10: twenty in common; of those three fail in the first alone and one in the second."""
    first = [good(i, in_box=i not in {1, 12, 13, 14}, sink_rate_mps=0.4 + 0.01 * i) for i in range(30)]
    second = [good(i, in_box=i not in {20, 35}, sink_rate_mps=0.45 + 0.01 * i + 0.001 * (i % 3)) for i in range(10, 40)]
    found = compared(("edge", first), ("end", second[::-1]))
    (pair,) = found["pairs"]
    assert (pair["reference"], pair["other"], pair["seeds"], pair["same_draws"]) == ("edge", "end", 20, True)
    success = pair["success"]
    counts = [success[key] for key in ("both", "reference_only", "other_only", "neither")]
    assert counts == [16, 1, 3, 0]
    assert success["difference"] == pytest.approx(0.1)
    assert success["low"] < 0.0 < success["high"]
    assert success["mcnemar_p"] == pytest.approx(2.0 * (1 + 4) / 2**4)  # none or one of four to one side
    sink = one(pair["metrics"], key="sink_rate_mps")
    differences = [0.05 + 0.001 * (i % 3) for i in range(10, 30)]
    assert (sink["n"], sink["mean"]["value"]) == (20, pytest.approx(np.mean(differences)))
    assert sink["mean"]["low"] <= np.mean(differences) <= sink["mean"]["high"]
    assert sink["shift"]["value"] == pytest.approx(0.051)
    assert sink["wilcoxon_p"] == pytest.approx(2.0 / 2**20)  # all twenty to one side
    assert sink["significant"]
    assert one(pair["metrics"], key="x_m")["wilcoxon_p"] is None
    assert "20 common seeds" in pair["text"][0]
    assert "sink rate +0.051 m/s" in pair["text"][2]


def test_what_is_significant_has_an_interval_without_zero_and_degrees_are_written_as_such() -> None:
    """Differences of either sign that lean to one side: the signed ranks see it, the median's signs would not."""
    rng = default_rng(4)
    lean = rng.normal(0.3, 1.0, (30, 40))
    significant = 0
    for of in lean:
        first = [good(i) for i in range(40)]
        second = [
            good(i, bank_deg=float(bank), x_m=275.0 + float(x))
            for i, (bank, x) in enumerate(zip(of, of[::-1], strict=True))
        ]
        (pair,) = compared(("a", first), ("b", second))["pairs"]
        for metric in pair["metrics"]:
            if metric["significant"]:
                significant += 1
                assert not metric["shift"]["low"] <= 0.0 <= metric["shift"]["high"]
        assert " deg" not in " ".join(pair["text"])
        if one(pair["metrics"], key="bank_deg")["significant"]:
            assert "bank +0." in pair["text"][2]
            assert "°" in pair["text"][2]
    assert significant > 10


def test_what_differs_in_the_scenarios_is_listed() -> None:
    found = compared(("a", [good(0)]), ("b", [good(0)]))
    assert found["settings"] == [
        {"key": "runway.width_m", "values": [30.0, 45.0]},
        {"key": "camera.line_noise", "values": ["edge-points", "endpoints"]},
    ]


def test_each_batch_has_its_own_rates() -> None:
    found = compared(("a", [good(i) for i in range(9)]), ("b", [good(0), failed(1), good(2, y_m=2.5, in_box=False)]))
    assert [(b["name"], b["n"], b["success"]["count"], b["landed"]["count"]) for b in found["batches"]] == [
        ("a", 9, 9, 9), ("b", 3, 1, 2),
    ]  # fmt: skip
    assert one(found["batches"][1]["limits"], key="cross_max_m")["count"] == 1
    assert one(found["batches"][1]["limits"], key="cross_max_m")["n"] == 2


def test_every_other_batch_is_held_against_the_first() -> None:
    found = compared(("a", [good(0), good(1)]), ("b", [good(0)]), ("c", [good(1)]))
    assert [(pair["reference"], pair["other"], pair["seeds"]) for pair in found["pairs"]] == [
        ("a", "b", 1),
        ("a", "c", 1),
    ]


def test_distributions_are_on_common_bins() -> None:
    first = [good(i, sink_rate_mps=0.1 * i) for i in range(5)]
    second = [good(i, sink_rate_mps=0.1 * i + 0.4) for i in range(5)]
    sink = one(compared(("a", first), ("b", second))["distributions"], key="sink_rate_mps")
    assert (sink["edges"][0], sink["edges"][-1]) == pytest.approx((0.0, 0.8))
    assert [sum(batch["counts"]) for batch in sink["batches"]] == [5, 5]
    assert sink["batches"][1]["ecdf"]["x"] == pytest.approx([0.4, 0.5, 0.6, 0.7, 0.8])
    assert sink["batches"][1]["ecdf"]["share"] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert sink["batches"][0]["exceedance"]["share"] == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2])
    assert {limit["value"] for limit in sink["limits"]} == {1.0}


def test_envelopes_are_at_the_distances_that_all_have() -> None:
    errors = default_rng(0).standard_normal((2, 30, 5))
    first = [good(i, fused_error_cross_m=e) for i, e in enumerate(errors[0])]
    shifted = np.array([1000.0, 100.0, 50.0, 0.0, -50.0])
    second = [good(i, fused_error_cross_m=e, distance_m=shifted) for i, e in enumerate(errors[1])]
    found = compared(("a", first), ("b", second))["envelopes"]
    assert found["distance_m"] == [1000.0, 100.0, 0.0]
    cross = one(found["series"], source="fused", quantity="cross_m")
    for batch, sample, places in zip(cross["batches"], errors, ([0, 2, 3], [0, 1, 3]), strict=True):
        assert batch["p95"] == pytest.approx(np.percentile(np.abs(sample[:, places]), 95.0, axis=0))
        assert batch["count"] == [30, 30, 30]
    apart = compared(("a", [good(0)]), ("b", [good(0, distance_m=DISTANCE + 5.0)]))
    assert apart["envelopes"] is None


def test_other_draws_for_the_same_seed_are_said() -> None:
    first = [good(i) | {"draw.wind.head_mps": float(i)} for i in range(3)]
    second = [good(i) | {"draw.wind.head_mps": float(i * i)} for i in range(3)]
    (pair,) = compared(("a", first), ("b", second))["pairs"]
    assert not pair["same_draws"]
    assert "same draws" in pair["text"][-1]
    (pair,) = compared(("a", first), ("b", [good(i) for i in range(3)]))["pairs"]
    assert pair["same_draws"]


def test_batches_that_have_nothing_in_common_are_refused_in_a_line() -> None:
    here, there = [good(0)], [good(1)]
    with pytest.raises(InputError, match=r"^a and b have no seed in common.*--seed$"):
        compared(("a", here), ("b", there))
    with pytest.raises(InputError, match="no seed in common"):
        compared(("a", here), ("b", []))
    with pytest.raises(InputError, match="two of the batches are called a"):
        compared(("a", here), ("a", here))
    with pytest.raises(InputError, match="two batches or more, not 1"):
        compare([Batch("a", SCENARIO, flights_of(here))])


def test_failed_flights_compare() -> None:
    (pair,) = compared(("a", [failed(0), failed(1)]), ("b", [failed(0), failed(1)]))["pairs"]
    assert pair["success"]["neither"] == 2
    assert {metric["n"] for metric in pair["metrics"]} == {0}


def test_the_same_batches_have_the_same_comparison() -> None:
    rng = default_rng(5)
    rows = [good(i, x_m=270.0 + x) for i, x in enumerate(rng.standard_normal(50).tolist())]
    others = [good(i, x_m=271.0 + x) for i, x in enumerate(rng.standard_normal(50).tolist())]
    texts = {json.dumps(compared(("a", rows), ("b", others))) for _ in range(2)}
    assert len(texts) == 1
