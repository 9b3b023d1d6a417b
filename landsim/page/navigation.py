"""Sections on how well a batch navigated, and on what matters."""

from collections.abc import Mapping
from typing import Any

from landsim.charts.shared import QUANTITIES, number, with_unit
from landsim.page.document import Block, Charts, Table, Text, figures_of
from landsim.page.sentences import DASH


def navigation_blocks(summary: Mapping[str, Any], charts: Charts) -> tuple[Block, ...]:
    """Errors by range against bounds."""
    found = summary["envelopes"]
    blocks: list[Block] = [
        *figures_of(charts["navigation"], "No flight was in the air at any of the distances."),
        Text(tuple(found["text"])),
    ]
    if found["bounds"] and any(found["in_the_air"]):
        rows = tuple(
            (
                f"{QUANTITIES[one['quantity']]}, {one['stage']} stage",
                with_unit(one["value"], one["quantity"].rsplit("_", 1)[1]),
                f"{number(one['from_m'], 4)} to {number(one['to_m'], 4)} m",
                *(_from(one["p95_within_from_m"][source], one) for source in ("vision", "fused")),
            )
            for one in found["bounds"]
        )
        head = ("bound of the paper", "stays within", "stated from", "vision, 95 %, from", "fused, 95 %, from")
        blocks.append(
            Table("From which distance on 95 % of the flights keep to the paper's bounds", head, rows, frozenset({2}))
        )
    names: dict[str, list[str]] = {}
    for one in (*found["bounds"], *found["limits"]):
        name = one.get("name", "bounds of the paper")
        if name not in names.setdefault(one["source"], []):
            names[one["source"]].append(name)
    if names:
        blocks.append(Text(tuple(f"{', '.join(of)}: {source}" for source, of in names.items()), points=True))
    return tuple(blocks)


def _from(value: float | None, bound: Mapping[str, Any]) -> str:
    if value is None:
        return "not to the end"
    return "throughout" if value >= bound["from_m"] else f"{number(value, 4)} m on"


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
