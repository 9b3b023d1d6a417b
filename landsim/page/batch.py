"""The page of a batch: sections, tables and sentences, every number of which stands in its summary."""

from collections.abc import Mapping
from typing import Any

from landsim.charts.batch import batch_charts
from landsim.charts.shared import number, percent, several, with_unit
from landsim.page.document import Block, Cell, Code, Document, Fact, Section, Table, Text
from landsim.page.landing import distributions_blocks, outcomes_blocks, touchdown_blocks, tracking_blocks
from landsim.page.navigation import consistency_blocks, navigation_blocks, sensitivity_blocks
from landsim.page.sentences import DASH, interval
from landsim.page.verdict import verdict_blocks

AGAIN = (
    "The same scenario, seed and versions on the same kind of machine give the same flights. Flight i has the seed of"
    " the batch plus i. To fly one again:"
)


def batch_document(summary: Mapping[str, Any], scenario_toml: str, folder: str) -> Document:
    """The report of a batch.

    Parameters
    ----------
    summary : mapping
        Of ``landsim.batch.summary.summarise``.
    scenario_toml : str
        The scenario as it was flown.
    folder : str
        That of the batch, as the commands name it.

    Returns
    -------
    Document
    """
    charts = batch_charts(summary)
    sections = (
        Section("summary", "Summary", _summary(summary)),
        Section("verdict", "Verdict", verdict_blocks(summary, charts)),
        Section("outcomes", "Outcomes", outcomes_blocks(summary, charts)),
        Section("touchdown", "Touchdown", touchdown_blocks(summary, charts)),
        Section("distributions", "Distributions", distributions_blocks(summary, charts)),
        Section("tracking", "Tracking", tracking_blocks(summary, charts)),
        Section("navigation", "Navigation errors by range", navigation_blocks(summary, charts)),
        Section("consistency", "Consistency of the filter", consistency_blocks(summary, charts)),
        Section("sensitivity", "Which dispersions matter", sensitivity_blocks(summary, charts)),
        Section("worst", "The worst flights", _worst(summary, folder)),
        Section("scenario", "Scenario", (Code("scenario.toml", scenario_toml),)),
        Section("versions", "Versions and seed", _versions(summary, folder)),
    )
    batch = summary["batch"]
    return Document(
        "batch",
        f"{batch['scenario']}: {several(batch['n'], 'flight')}",
        f"{batch['aircraft']}; seed {number(batch['seed'], 12)}, draws by {batch['sampling']} sampling",
        _facts(summary),
        sections,
    )


def _facts(summary: Mapping[str, Any]) -> tuple[Fact, ...]:
    """What one looks for first."""
    rates = summary["rates"]
    success, shown = rates["success"], rates["can_show"]
    facts = [Fact("landed in the box", percent(success["rate"]), interval(success))]
    if shown["failure_rate_below"] is not None:
        facts.append(
            Fact("rate of failure below", percent(shown["failure_rate_below"]), "one-sided, with 95 % confidence")
        )
    found = summary["touchdown"]
    if found["mean"] is not None:
        spread = found["std"] or {}
        for key, name in (("x_m", "touchdown past the threshold"), ("y_m", "touchdown right of the centreline")):
            detail = f"± {with_unit(spread[key], 'm')} (1 σ)" if spread else ""
            facts.append(Fact(name, with_unit(found["mean"][key], "m"), detail))
    return tuple(facts)


def _summary(summary: Mapping[str, Any]) -> tuple[Block, ...]:
    batch, rates = summary["batch"], summary["rates"]
    first, *others = rates["text"]
    blocks: list[Block] = [Text((first,), lead=True)]
    if others:
        blocks.append(Text(tuple(others)))
    if batch["asked"] is not None and batch["n"] != batch["asked"]:
        blocks.append(Text((f"{batch['n']} of {several(batch['asked'], 'flight')} asked for are in this report.",)))
    if batch["shard"] not in {None, "1/1"}:
        blocks.append(Text((f"This is shard {batch['shard']}: a part of a batch.",)))
    return tuple(blocks)


def _worst(summary: Mapping[str, Any], folder: str) -> tuple[Block, ...]:
    found = summary["worst"]
    if not found["flights"]:
        return (Text(("There is no flight.",)),)
    rows = []
    for one in found["flights"]:
        limit = one["limit"]
        nearest = DASH
        if limit is not None:
            value, most = with_unit(limit["value"], limit["unit"]), with_unit(limit["limit"], limit["unit"])
            nearest = f"{limit['title']} {value} (limit {most})"
        hints = ", ".join(f"{d['key']} = {number(d['value'])} ({number(d['spreads_off'], 2)} σ)" for d in one["draws"])
        rows.append(
            (
                str(one["rank"]),
                str(one["index"]),
                one["outcome"].replace("_", " "),
                "yes" if one["in_box"] else "no",
                one["reason"] or DASH,
                nearest,
                DASH if one["score"] is None else f"{100.0 * one['score']:.0f} %",
                hints or DASH,
                Cell((one["command"] or DASH).replace(" DIR ", f" {folder} "), command=one["command"] is not None),
            )
        )
    head = (
        "rank",
        "flight",
        "outcome",
        "in the box",
        "reason",
        "nearest limit",
        "used of it",
        "unusual draws",
        "fly it again",
    )
    return (
        Text((f"Ranked: {found['rule']}. The draws are those farthest from their median, a hint and not a cause.",)),
        Table("The ten worst flights" if len(rows) == 10 else "The worst flights", head, tuple(rows),
              words=frozenset({2, 3, 4, 5, 7, 8})),
    )  # fmt: skip


def _versions(summary: Mapping[str, Any], folder: str) -> tuple[Block, ...]:
    batch = summary["batch"]
    facts = [
        ("scenario", str(batch["scenario"])),
        ("seed", number(batch["seed"], 12)),
        ("flights", f"{batch['n']} of {batch['asked']}"),
        ("sampling", str(batch["sampling"])),
    ]
    if batch["wall_time_s"]:
        facts.append(
            (
                "wall time",
                f"{with_unit(batch['wall_time_s'], 's')}, {number(batch['flights_per_second'])} flights a second",
            )
        )
    took = batch["flight_wall_time_s"]
    if took is not None:
        facts.append(
            ("a flight took", f"{with_unit(took['median'], 's')} (median), 95 % below {with_unit(took['p95'], 's')}")
        )
    return (
        Table("The batch", ("", "value"), tuple(facts), words=frozenset({1})),
        Table("Versions that decide the bits of a result", ("library", "version"),
              tuple((name, str(version)) for name, version in summary["versions"].items()), words=frozenset({1})),
        Text((AGAIN,)),
        Code("a flight again, with its log and pictures", f"landsim replay {folder} INDEX"),
    )  # fmt: skip
