"""What a batch came to, from its summary, and how batches compare."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from landsim.errors import one_line
from landsim.tables.sheet import UNITS, Sheet, fitting, number

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text

QUANTILES = (0.05, 0.5, 0.95)
WORST = 5
"""Of the worst flights that are named."""
LONGEST_CAUSE = 28
"""Characters of an error, which have room in the narrowest terminal."""
OVERDUE = "took longer than the limit"
"""What `landsim.batch.process` says of a flight that it ended."""


def batch_tables(summary: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """The verdict, outcomes, touchdown and the worst flights of a batch.

    Parameters
    ----------
    summary : mapping
        As in summary.json: None for what does not exist.
    width : int
        Columns of the terminal, at least ``NARROWEST``: no figure is cut.
    """
    from rich.text import Text

    of, rates = summary["batch"], summary["rates"]
    yield Text.assemble(
        f"{one_line(of['scenario'])}, {of['n']} flight{'' if of['n'] == 1 else 's'} from seed {of['seed']} on: ",
        (f"{rate_text(rates['success'])} in the box", "bold"),
        f", with {100.0 * of['confidence']:g} % confidence",
    )
    if rates["gone_around"]["count"]:
        yield Text(f"{rate_text(rates['gone_around'])} went around, which is neither a landing nor a failure")
    for sheet in (_outcomes(rates), _verdict(summary), _touchdown(summary), _worst(summary)):
        if sheet.rows:
            yield from fitting(sheet, width)


def compare_tables(compared: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """Batches side by side; parameters as for `batch_tables`, of compare.json."""
    from rich.text import Text

    rows: list[list[str | Text]] = [
        [one_line(of["name"]), str(of["n"]), rate_text(of["success"]), rate_text(of["landed"])]
        for of in compared["batches"]
    ]
    yield from fitting(Sheet(("batch", "flights", "in the box", "landed"), rows), width)
    for pair in compared["pairs"]:
        for sentence in pair["text"]:
            yield Text(one_line(sentence))


def rate_text(rate: Mapping[str, Any]) -> str:
    """A rate with its interval, in percent."""
    if rate["rate"] is None:
        return "–"
    share, low, high = (100.0 * rate[name] for name in ("rate", "low", "high"))
    return f"{share:.4g} % ({low:.4g} … {high:.4g})"


def _outcomes(rates: Mapping[str, Any]) -> Sheet:
    rows: list[list[str | Text]] = [
        [outcome["outcome"].replace("_", " "), str(outcome["count"]), rate_text(outcome)]
        for outcome in rates["outcomes"]
        if outcome["count"]
    ]
    return Sheet(("outcome", "flights", "rate"), rows)


def _verdict(summary: Mapping[str, Any]) -> Sheet:
    """The room to each limit of the box: flights beyond it, and what is left at the 99 % quantile and in the worst."""
    rows: list[list[str | Text]] = []
    for one in summary["verdict"]["limits"] if summary["batch"]["n"] else ():
        unit = UNITS.get(one["unit"], one["unit"])
        sign = "≤" if one["side"] == "above" else "≥"
        limit = f"{sign} {one['limit']:g}{'' if unit == '°' else ' '}{unit}"
        margins = (number(one[key], unit) for key in ("margin", "margin_of_worst"))
        rows.append([one["title"], limit, f"{one['count']} of {one['n']}", *margins])
    return Sheet(("limit on", "limit", "beyond", "room,\n99 %", "room,\nworst"), rows)


def _touchdown(summary: Mapping[str, Any]) -> Sheet:
    rows: list[list[str | Text]] = []
    for of in summary["distributions"]:
        values = {round(q["p"], 6): q["value"] for q in of["quantiles"]}
        unit = UNITS.get(of["unit"], of["unit"])
        cells = [number(values.get(p), unit) for p in QUANTILES]
        limits = " … ".join(f"{limit['value']:g}" for limit in of["limits"])
        rows.append(
            [of["title"], *cells, f"{limits}{'' if unit == '°' or not limits else ' '}{unit}" if limits else ""]
        )
    return Sheet(("quantiles", *(f"{100 * p:g} %" for p in QUANTILES), "limits"), rows)


def _cause(flight: Mapping[str, Any]) -> str:
    """Why a flight came to nothing, in a few words."""
    reason = one_line(flight["reason"] or "")
    if reason.startswith(OVERDUE):
        return "time limit"
    return reason if len(reason) <= LONGEST_CAUSE else reason[: LONGEST_CAUSE - 3] + "..."


def _worst(summary: Mapping[str, Any]) -> Sheet:
    flights: Sequence[Mapping[str, Any]] = summary["worst"]["flights"][:WORST]
    rows: list[list[str | Text]] = []
    for flight in flights:
        what, limit = _cause(flight) if flight["outcome"] == "error" else "", flight["limit"]
        if limit:
            value = number(limit["value"], UNITS.get(limit["unit"], limit["unit"]))
            what = f"{limit['title']} {value} of {limit['limit']:g}"
        box = "in the box" if flight["in_box"] else "not in the box"
        rows.append([str(flight["index"]), flight["outcome"].replace("_", " "), box, what])
    return Sheet(("worst: flight", "outcome", "", "nearest limit, or the error"), rows)
