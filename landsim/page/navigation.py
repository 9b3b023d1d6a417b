"""Sections on how well a batch navigated, and on what matters."""

from collections.abc import Mapping
from typing import Any

from landsim.batch.sections.words import flights_for
from landsim.charts.shared import QUANTITIES, SOURCES, number, with_unit
from landsim.page.document import Block, Charts, Table, Text, figures_of
from landsim.page.sentences import DASH

NOT_JUDGED = {"too few": "too few flights", "none": "no estimate"}
"""States of a limit that nothing can be said of."""


def navigation_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """Errors by range against bounds."""
    found = summary["envelopes"]
    blocks: list[Block] = [
        *figures_of(charts["navigation"], "No flight was in the air at any of the distances."),
        Text(tuple(found["text"])),
    ]
    if any(found["in_the_air"]):
        blocks.append(_limits(found))
    names: dict[str, list[str]] = {}
    for one in (*found["bounds"], *found["limits"]):
        name = one.get("name", "bounds of the paper")
        if name not in names.setdefault(one["source"], []):
            names[one["source"]].append(name)
    if names:
        blocks.append(Text(tuple(f"{', '.join(of)}: {source}" for source, of in names.items()), points=True))
    return tuple(blocks)


def _limits(found: Mapping[str, Any]) -> Table:
    """Whether 95 % of the flights keep to the paper's bounds and to the published limits, and how far that is known."""
    rows = [
        (
            f"{QUANTITIES[one['quantity']]}, {one['stage']} stage",
            "the paper",
            with_unit(one["value"], one["quantity"].rsplit("_", 1)[1]),
            f"{number(one['from_m'], 4)} to {number(one['to_m'], 4)} m",
            *(_judged(one["p95"][source]) for source in SOURCES),
        )
        for one in found["bounds"]
    ]
    rows += [
        (
            QUANTITIES[one["quantity"]],
            one["name"],
            " to ".join(dict.fromkeys((number(one["value"][0]), number(one["value"][-1])))) + " m",
            f"{number(one['distance_m'][0], 4)} to {number(one['distance_m'][-1], 4)} m",
            *(_judged(one["p95"][source]) for source in SOURCES),
        )
        for one in found["limits"]
    ]
    head = ("error of", "limit by", "limit", "stated from", *(f"{source}, 95 % of the flights" for source in SOURCES))
    caption = (
        "Whether 95 % of the flights keep to the paper's bounds and to published limits; in brackets the distances at"
        f" which {flights_for(found['levels']['p95'])} flights have an estimate"
    )
    return Table(caption, head, tuple(rows), words=frozenset({1, 2, 3, 4, 5}))


def _judged(one: Mapping[str, Any]) -> str:
    """Kept, broken or not known, and from where to where that was looked at."""
    if one["state"] in NOT_JUDGED:
        return NOT_JUDGED[one["state"]]
    seen = f"({number(one['first_m'], 4)} to {number(one['last_m'], 4)} m)"
    if one["state"] == "kept":
        return f"kept {seen}"
    rest = "" if one["within_from_m"] is None else f", kept from {number(one['within_from_m'], 4)} m on"
    return f"broken{rest} {seen}"


def consistency_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """Whether the filter knows its errors."""
    found = summary["consistency"]
    blocks: list[Block] = [*figures_of(charts["consistency"], "")] if charts["consistency"] else []
    first, *others = found["text"]
    blocks.append(Text((first,)))
    if others:
        blocks.append(Text(tuple(others), points=True))
    rows = tuple(
        (
            f"{one['phase']}, {one['dof']} states",
            number(one["mean"]),
            f"{number(one['low'])} to {number(one['high'])}",
            f"{number(one['bound_low'])} to {number(one['bound_high'])}",
            number(one["errors_over_sigma"]),
            str(one["flights"]),
            str(one["frames"]),
            one["verdict"] or DASH,
        )
        for one in found["nees"]
    )
    head = ("phase", "mean", "95 % interval", "bounds", "errors / σ", "flights", "frames", "verdict")
    blocks.append(Table("Normalised errors squared", head, rows, words=frozenset({7})))
    return tuple(blocks)


def sensitivity_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """Which draws matter."""
    found = summary["sensitivity"]
    first, *others = found["text"]
    figures: tuple[Block, ...] = figures_of(charts["sensitivity"], "") if charts["sensitivity"] else ()
    blocks: list[Block] = [Text((first,)), *figures]
    if others:
        blocks.append(Text(tuple(others), points=True))
    if found["inputs"]:
        told = {"dispersion": "a dispersion of the scenario", "seed": "the start as the seed draws it"}
        rows = tuple((one["key"], told.get(one["drawn_by"], one["drawn_by"])) for one in found["inputs"])
        blocks.append(Table("What varies from flight to flight", ("draw", "drawn by"), rows, words=frozenset({1})))
    return tuple(blocks)
