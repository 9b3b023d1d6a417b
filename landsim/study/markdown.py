"""verdict.md: the verdict as a page of tables and sentences, every figure of which is in verdict.json."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from landsim.errors import one_line
from landsim.study.paragraphs import figure, with_unit
from landsim.study.words import listed as in_words

Verdict = Mapping[str, Any]
Entry = Mapping[str, Any]
STATISTICS = (("p68", "68.27 %"), ("p95", "95 %"), ("p99_7", "99.73 %"), ("sigma", "σ"))
UNITS = {"deg": "°", "m": "m"}


def verdict_md(verdict: Verdict) -> str:
    """The page."""
    return "\n".join(_page(verdict)) + "\n"


def groups_of(verdict: Verdict) -> list[tuple[str, list[Entry]]]:
    """The entries of each envelope, with its name in words."""
    groups: dict[tuple[Any, ...], list[Entry]] = {}
    for e in verdict["entries"]:
        groups.setdefault((e["stage"], e["source"], e["reading"], e["roll_error_deg"]), []).append(e)
    return [
        (f"{stage}, {source}, {reading}" + (f", roll off by {figure(roll)}°" if roll else ""), entries)
        for (stage, source, reading, roll), entries in groups.items()
    ]


def said(entry: Entry) -> str:
    """Whether the bound holds, and from where."""
    if entry["bound"] is None:
        return "no bound"
    if entry["judged_from_m"] is None:
        return "no data"
    if entry["holds"]:
        return "holds"
    return "does not hold" if entry["holds_from_m"] is None else f"from {entry['holds_from_m']:.0f} m"


def needed(entry: Entry) -> str:
    """The line precision with which it would hold over the whole stage."""
    p = entry["precision"]
    if p is None:
        return "–"
    if p["spacing_px"] is None:
        return f"{figure(p['noise_px'])} px"
    counts = sorted({n for n in p["points"].values() if n})
    return "–".join(map(str, dict.fromkeys((counts[0], counts[-1])))) + " points"


def _page(verdict: Verdict) -> Iterator[str]:
    yield f"# {one_line(verdict['scenario'])}, seed {verdict['seed']}: what holds"
    yield ""
    yield _how(verdict)
    yield ""
    yield "## Verdict"
    yield ""
    yield (
        f"A bound holds if {figure(verdict['judged_at_percent'])} % of the errors keep it from the stage's first range"
        " on: early from the first listed range, late from the hand-over; the fused solution from where it begins."
        " Otherwise the range is named from which it does."
    )
    yield ""
    yield from _table(
        ("stage", "source", "reading", "quantity", "bound", "at 95 %", "line precision to hold throughout"),
        [
            (
                e["stage"] + (f", roll off by {figure(e['roll_error_deg'])}°" if e["roll_error_deg"] else ""),
                e["source"],
                e["reading"],
                e["quantity"],
                with_unit(e["bound"], e["unit"]),
                said(e),
                needed(e),
            )
            for e in verdict["entries"]
            if e["bound"] is not None
        ],
    )
    for text in verdict["paragraphs"].values():
        yield ""
        yield text
    yield ""
    yield "## Errors by range"
    yield ""
    yield _tails(verdict)
    for name, entries in groups_of(verdict):
        yield ""
        yield f"### {name[0].upper()}{name[1:]}"
        yield ""
        yield from _figures(entries)
    yield from _precisions(verdict)
    yield from _rolls(verdict)
    yield from _claims(verdict)
    yield ""
    yield "## Versions"
    yield ""
    yield ", ".join(f"{name} {version}" for name, version in verdict["versions"].items()) + "."


def _how(verdict: Verdict) -> str:
    readings = in_words(list(dict.fromkeys(f"`{e['reading']}`" for e in verdict["entries"])))
    if verdict["method"] == "flights":
        return f"Flown in JSBSim, by vision and with the inertial unit, with noise read as {readings}."
    draws = verdict["draws"]
    return (
        f"Sampled on a straight approach with noise read as {readings}: {draws['frame']} draws a frame,"
        f" {draws['listed']} at each listed range, on the points of each line and through the line fit."
    )


def _figures(entries: Sequence[Entry]) -> Iterator[str]:
    """Percentiles by range of one envelope, with what is behind them."""
    ranges = [row["range_m"] for row in entries[0]["listed"]]
    if not ranges:
        yield "None of the listed ranges is in it."
        return
    rows = []
    for e in entries:
        for key, name in STATISTICS:
            cells = ["–" if row[key] is None else figure(row[key]) for row in e["listed"]]
            rows.append((f"{e['quantity']}, {UNITS[e['unit']]}", name, *cells))
    counts = (
        "draws" if entries[0]["source"] == "vision" else "flights",
        "",
        *(str(row["count"]) for row in entries[0]["listed"]),
    )
    yield from _table(("", "", *(f"{figure(r)} m" for r in ranges)), [*rows, counts])


def _tails(verdict: Verdict) -> str:
    """Where the sampled percentiles leave the first order."""
    parts = []
    for name, entries in groups_of(verdict):
        if entries[0]["first_order_left"] is None or not entries[0]["listed"]:
            continue
        words = []
        for key, level in STATISTICS[:-1]:
            left = {e["quantity"]: e["first_order_left"][key] for e in entries if e["first_order_left"][key]}
            if left:
                each = [f"{q} at {in_words([figure(r) for r in ranges])} m" for q, ranges in left.items()]
                words.append(f"at {level} {in_words(each)}")
        ratios = [row["p68_over_first_order"] for e in entries for row in e["listed"] if row["p68_over_first_order"]]
        span = f" (68.27 %: {min(ratios):.3f} to {max(ratios):.3f} times it)" if ratios else ""
        parts.append(
            f"{name}: " + (f"leaves it {'; '.join(words)}" if words else "within 5 % of it everywhere") + f"{span}."
        )
    head = "σ is what the first order (Cramér-Rao) predicts for vision, and the filter's own for what is fused."
    if not parts:
        return head
    return f"{head} Where a percentile is more than 5 % off first order: " + " ".join(
        f"{part[0].upper()}{part[1:]}" for part in parts
    )


def _precisions(verdict: Verdict) -> Iterator[str]:
    solved = [e for e in verdict["entries"] if e["precision"] is not None]
    if not solved:
        return
    yield ""
    yield "## Line precision with which each bound would hold"
    yield ""
    yield (
        "Solved for over the whole stage and confirmed with independent draws at the ranges at which it is tightest."
        " With `endpoints` it is the σ of a line's ends, with `edge-points` the spacing of points with the scenario's"
        " noise, and how many that is on left edge, threshold and right edge where it is tightest."
    )
    yield ""
    rows = []
    for e in solved:
        p = e["precision"]
        points = ", ".join(str(n) for n in p["points"].values() if n) if p["spacing_px"] is not None else "2 each"
        rows.append(
            (
                e["stage"],
                e["reading"],
                e["quantity"],
                with_unit(e["bound"], e["unit"]),
                f"{figure(p['noise_px'])} px",
                "–" if p["spacing_px"] is None else f"{figure(p['spacing_px'])} px",
                points,
                f"{figure(p['at_range_m'])} m",
                "–" if p["p95"] is None else with_unit(p["p95"], e["unit"]),
                f"{p['draws']}: " + ("yes" if p["confirmed"] else "not drawn" if not p["draws"] else "no"),
            )
        )
    heads = ("stage", "reading", "quantity", "bound", "σ of a point", "spacing", "points", "tightest at",
             "sampled 95 %", "draws: confirmed")  # fmt: skip
    yield from _table(heads, rows)


def _rolls(verdict: Verdict) -> Iterator[str]:
    limits = verdict["roll_limits"]
    if not limits:
        return
    yield ""
    yield "## Roll error up to which each late bound holds"
    yield ""
    rows = [
        (
            x["reading"],
            x["quantity"],
            with_unit(x["bound"], x["unit"]),
            "does not hold with the true roll" if x["roll_error_deg"] is None else
            f"{'more than ' if x['holds_beyond'] else ''}{with_unit(x['roll_error_deg'], 'deg')}",
            f"{figure(x['at_range_m'])} m, {figure(x['at_height_m'])} m up",
            "–" if x["p95_over_bound"] is None else figure(x["p95_over_bound"]),
            str(x["draws"]),
        )
        for x in limits
    ]  # fmt: skip
    heads = ("reading", "quantity", "bound", "roll error", "decided at", "sampled 95 % over bound there", "draws")
    yield from _table(heads, rows)


def _claims(verdict: Verdict) -> Iterator[str]:
    texts = claim_texts(verdict)
    if not texts:
        return
    yield ""
    yield "## The paper's other claims, measured"
    for text in texts:
        yield ""
        yield text


def claim_texts(verdict: Verdict) -> list[str]:
    """The paragraphs of the paper's other claims."""
    claims = [claim for claim in verdict["claims"].values() if isinstance(claim, Mapping)]
    return [claim["text"] for claim in claims if claim.get("text")]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield "| " + " | ".join(heads) + " |"
    yield "|" + "|".join(" --- " for _ in heads) + "|"
    for row in rows:
        yield "| " + " | ".join(row) + " |"
