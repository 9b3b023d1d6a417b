"""verdict.md: the verdict as a page of tables and sentences, every figure of which is in verdict.json."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from landsim.errors import one_line
from landsim.study.judged import KEYS, LEAVES, allowed
from landsim.study.model import CHANCE, LEVEL, LEVELS
from landsim.study.paragraphs import figure, with_unit
from landsim.study.words import listed as in_words

Verdict = Mapping[str, Any]
Entry = Mapping[str, Any]
STATISTICS = (*((key, f"{level:g} %") for key, level in zip(KEYS, LEVELS, strict=True)), ("sigma", "σ"))
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
        return "not in every flight" if any(row["count"] for row in entry["listed"]) else "no data"
    if entry["holds"] is None:
        return f"too few {drawn(entry)}"
    if entry["holds"]:
        return "holds"
    return "does not hold" if entry["holds_from_m"] is None else f"from {entry['holds_from_m']:.0f} m"


def drawn(entry: Entry) -> str:
    """What an entry's errors are of."""
    return "flights" if entry["of_flights"] else "draws"


def cell(row: Mapping[str, Any], key: str) -> str:
    """A statistic at a listed range: a figure, or that it has no limit, or a dash where there is none."""
    if key in row["no_limit"]:
        return "no limit"
    return "–" if row[key] is None else figure(row[key])


def _with_interval(entry: Entry) -> str:
    """What is said of an entry, and between where and where its range is."""
    interval = entry["holds_from_interval_m"]
    if interval is None:
        return said(entry)
    low, high = ("not at the end" if end is None else f"{end:.0f}" for end in interval)
    return f"{said(entry)} ({low} m)" if low == high else f"{said(entry)} ({low} to {high} m)"


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
        " on: early from the first listed range, late from the hand-over; the fused solution from where it runs in"
        " every flight that comes there. Otherwise the range is named from which it does." + _of_flights(verdict)
    )
    yield ""
    yield from _table(
        ("stage", "source", "reading", "quantity", "bound", f"at {LEVEL:g} %", "line precision to hold throughout"),
        [
            (
                e["stage"] + (f", roll off by {figure(e['roll_error_deg'])}°" if e["roll_error_deg"] else ""),
                e["source"],
                e["reading"],
                e["quantity"],
                with_unit(e["bound"], e["unit"]),
                _with_interval(e),
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
            cells = [cell(row, key) for row in e["listed"]]
            rows.append((f"{e['quantity']}, {UNITS[e['unit']]}", name, *cells))
    counts = (
        drawn(entries[0]),
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
        span = f" ({STATISTICS[0][1]}: {min(ratios):.3f} to {max(ratios):.3f} times it)" if ratios else ""
        parts.append(f"{name}: " + (f"leaves it {'; '.join(words)}" if words else _close(entries)) + f"{span}.")
    head = "σ is what the first order (Cramér-Rao) predicts for vision, and the filter's own for what is fused."
    if not parts:
        return head
    how = (
        f"A percentile leaves the first order where it is off by more than {figure(100.0 * LEAVES)} % and by more than"
        f" {figure(CHANCE)} standard errors, which is what chance explains."
    )
    return f"{head} {how} " + " ".join(f"{part[0].upper()}{part[1:]}" for part in parts)


def _close(entries: Sequence[Entry]) -> str:
    """That no percentile leaves the first order, as far as so many errors can tell."""
    counts = sorted({row["count"] for e in entries for row in e["listed"] if row["count"]})
    there = [
        (level, key, allowed(level, counts[0]))
        for level, (key, _) in zip(LEVELS, STATISTICS, strict=False)
        if any(row[key] is not None for e in entries for row in e["listed"])
    ]
    if not there:
        return f"too few {drawn(entries[0])} to compare"
    if max(most for _, _, most in there) <= LEAVES:
        return f"within {figure(100.0 * LEAVES)} % of it everywhere"
    number = "–".join(map(str, dict.fromkeys((counts[0], counts[-1]))))
    off = ", ".join(f"{figure(100.0 * most)} % at {level:g} %" for level, _, most in there)
    return f"off it by no more than chance explains with n = {number} (by up to {off})"


def _of_flights(verdict: Verdict) -> str:
    """How well so many flights fix a range."""
    if all(e["holds_from_interval_m"] is None for e in verdict["entries"]):
        return ""
    return (
        f" In brackets, where the errors are those of flights: the interval in which that range is at {LEVEL:g} %, by"
        " drawing anew from the flights."
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
                _confirmed(p),
            )
        )
    heads = ("stage", "reading", "quantity", "bound", "σ of a point", "spacing", "points", "tightest at",
             f"sampled {LEVEL:g} %", "draws: confirmed, part within the bound")  # fmt: skip
    yield from _table(heads, rows)


def _confirmed(precision: Mapping[str, Any]) -> str:
    """Whether draws bear it out, and in which interval the part is that keeps the bound."""
    if not precision["draws"]:
        return "0: not drawn"
    low, high = precision["within_interval_percent"]
    return f"{precision['draws']}: {'yes' if precision['confirmed'] else 'no'}, {low:.1f} to {high:.1f} %"


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
            f"{'more than ' if x['holds_beyond'] else ''}{with_unit(x['roll_error_deg'], 'deg')}"
            f"{', beyond it no solution' if x.get('limited_by') == 'no solution' else ''}",
            f"{figure(x['at_range_m'])} m, {figure(x['at_height_m'])} m up",
            "–" if x["p95_over_bound"] is None else figure(x["p95_over_bound"]),
            str(x["draws"]),
        )
        for x in limits
    ]  # fmt: skip
    over = f"sampled {LEVEL:g} % over bound there"
    heads = ("reading", "quantity", "bound", "roll error", "decided at", over, "draws")
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
