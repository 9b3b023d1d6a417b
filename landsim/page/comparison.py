"""The page of batches side by side, every number of which stands in their comparison."""

from collections.abc import Mapping
from typing import Any

from landsim.charts.comparison import comparison_charts
from landsim.charts.shared import PERCENT, number, percent, several, with_unit
from landsim.page.document import Block, Document, Fact, Section, Table, Text, figures_of
from landsim.page.sentences import DASH, interval


def comparison_document(compared: Mapping[str, Any]) -> Document:
    """The report of a comparison.

    Parameters
    ----------
    compared : mapping
        Of ``landsim.batch.compare.compare``.

    Returns
    -------
    Document
    """
    charts = comparison_charts(compared)
    names = [batch["name"] for batch in compared["batches"]]
    said = tuple(text for pair in compared["pairs"] for text in pair["text"])
    sections = (
        Section("summary", "Summary", (Text(said[:1], lead=True), Text(said[1:])) if said else (Text(("No pair.",)),)),
        Section(
            "outcomes", "Success, side by side",
            (*figures_of(charts["outcomes"], "There is no flight."), *_rates(compared)),
        ),
        Section("settings", "What differs", _settings(compared, names)),
        Section(
            "differences", "Differences over common seeds",
            (*figures_of(charts["differences"], "No flight of one batch has a counterpart in another."),
             *_pairs(compared)),
        ),
        Section(
            "distributions", "Distributions",
            figures_of(charts["distributions"], "No flight touched down in any batch."),
        ),
        Section(
            "navigation", "Navigation errors by range",
            figures_of(charts["navigation"], "The batches have no distance in common."),
        ),
    )  # fmt: skip
    facts = tuple(
        Fact(f"{one['name']}: landed in the box", percent(one["success"]["rate"]), interval(one["success"]))
        for one in compared["batches"]
    )
    flights = "; ".join(
        f"{one['name']}: {several(one['n'], 'flight')} of {one['scenario']}" for one in compared["batches"]
    )
    return Document("comparison", f"Comparison: {' and '.join(names)}", flights, facts, sections)


def _rates(compared: Mapping[str, Any]) -> tuple[Block, ...]:
    rows = tuple(
        (one["name"], one["scenario"], str(one["n"]), percent(one["success"]["rate"]), interval(one["success"]),
         percent(one["landed"]["rate"]), interval(one["landed"]))
        for one in compared["batches"]
    )  # fmt: skip
    head = ("batch", "scenario", "flights", "in the box", "95 % interval", "landed", "95 % interval")
    return (Table("Success, each batch by itself", head, rows, words=frozenset({1})),)


def _settings(compared: Mapping[str, Any], names: list[str]) -> tuple[Block, ...]:
    if not compared["settings"]:
        return (Text(("The scenarios of the batches do not differ.",)),)
    rows = tuple(
        (one["key"], *(DASH if value is None else str(value) for value in one["values"]))
        for one in compared["settings"]
    )
    every = frozenset(range(1, len(names) + 1))
    return (Table("Scenario keys that are not the same in all", ("key", *names), rows, words=every),)


def _pairs(compared: Mapping[str, Any]) -> tuple[Block, ...]:
    blocks: list[Block] = []
    for pair in compared["pairs"]:
        s = pair["success"]
        counts = (
            ("succeeded in both", str(s["both"])),
            (f"in {pair['reference']} alone", str(s["reference_only"])),
            (f"in {pair['other']} alone", str(s["other_only"])),
            ("in neither", str(s["neither"])),
            ("difference of the rates", _points(s["difference"])),
            ("95 % interval", f"{_points(s['low'])} to {_points(s['high'])}"),
            ("McNemar's exact p", number(s["mcnemar_p"])),
        )
        blocks.append(
            Table(f"{pair['other']} against {pair['reference']}: {pair['seeds']} common seeds", ("", "flights"), counts)
        )
        rows = tuple(
            (
                m["title"],
                with_unit(m["mean"]["value"], m["unit"]),
                f"{number(m['mean']['low'])} to {number(m['mean']['high'])}",
                with_unit(m["shift"]["value"], m["unit"]),
                f"{number(m['shift']['low'])} to {number(m['shift']['high'])}",
                number(m["p_adjusted"]),
                DASH if m["significant"] is None else "yes" if m["significant"] else "no",
            )
            for m in pair["metrics"]
            if m["n"]
        )
        head = (
            "number of a flight",
            "mean difference",
            "95 % interval",
            "shift",
            "95 % interval",
            "adjusted p",
            "significant",
        )
        blocks.append(Table(f"{pair['other']} less {pair['reference']}", head, rows))
    return tuple(blocks)


def _points(difference: float | None) -> str:
    return DASH if difference is None else f"{number(PERCENT * difference)} points"
