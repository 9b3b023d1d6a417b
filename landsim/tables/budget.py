"""What precision of the lines the bounds need."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from landsim.errors import one_line
from landsim.tables.sheet import Sheet, fitting

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text


def budget_tables(budget: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """What precision of the lines the bounds need, and where they hold with a given one.

    Parameters
    ----------
    budget : mapping
        As in budget.json: None for what does not exist.
    width : int
        Columns of the terminal, at least ``NARROWEST``: no figure is cut.
    """
    from rich.text import Text

    from landsim.budget.words import binding_text, setting_text

    percent = f"{budget['confidence_percent']:g} %"
    yield Text(f"{one_line(budget['scenario'])}: bounds kept in {percent} of the frames, to first order", style="bold")
    yield Text(setting_text(budget))
    if any(requirement["stage"] for requirement in budget["requirements"]):
        sheet = _needs(budget)
        yield from fitting(sheet, width)
        yield Text(sheet.note, style="dim")
        yield Text(binding_text(budget) + "\n")
    if "precision" in budget:
        sheet = _held(budget)
        yield from fitting(sheet, width)
        yield Text(sheet.note + "\n", style="dim")


def _needs(budget: Mapping[str, Any]) -> Sheet:
    """The precision that each requirement with a range needs of each reading."""
    from rich.text import Text

    from landsim.budget.words import amount, reference_px, requirement_text, unit_of
    from landsim.study.model import READINGS

    drawn, there, noise = "confirmed" in budget, reference_px(budget), budget["camera"]["noise_px"]
    headings = ["requirement", "stage", "keeps now", "needs σ", *(["drawn"] if drawn else [])]
    headings += ["or points", "now"]
    rows: list[list[str | Text]] = []
    finer = doubtful = False
    for requirement in budget["requirements"]:
        if requirement["stage"] is None:
            continue
        unit = unit_of(requirement)
        name, stage = requirement_text(requirement), requirement["stage"]
        for reading in READINGS:
            of = requirement[reading]
            points = of.get("needed_points")
            present = of[f"present_{unit}"]
            cells: list[str | Text] = [f"{name}, {reading}", stage]
            cells += ["–" if present is None else amount(present, unit, ".3g"), _needed(of, there)]
            doubtful |= of["first_order_holds"] is False
            if drawn:
                cells.append(f"{of['inside_percent']:.1f} %" if "inside_percent" in of else "–")
            if points:
                closer = of["needed_spacing_px"] < 1.0
                finer |= closer
                cells += [
                    "/".join(map(str, points)) + ("*" if closer else ""),
                    "/".join(map(str, of["present_points"])),
                ]
            else:
                cells += ["", ""]
            rows.append(cells)
    note = (
        f"now: σ = {noise:.3g} px; points: a line, of that σ, on left edge/threshold/right edge, late on the two edges"
    )
    note += "; * closer than a pixel to each other" if finer else ""
    note += f"; {_doubt(budget)}" if doubtful else ""
    if drawn:
        note += f"; drawn: of {budget['confirmed']['draws']} draws with the σ needed, so many were within the bound"
    return Sheet(headings, rows, note)


def _needed(of: Mapping[str, Any], there: float) -> "Text":
    """The σ that one requirement needs of one reading."""
    from rich.text import Text

    needed = of["needed_noise_px"]
    if needed is None:
        return Text("none", style="red")
    if not of["first_order_holds"]:
        return Text(f"{needed:.3g} px ?", style="yellow")
    return Text(f"{needed:.3g} px", style="green" if there <= needed else "red")


def _doubt(budget: Mapping[str, Any]) -> str:
    """What the mark of a figure says that drawing does not bear out."""
    percent = f"{budget['checked']['off_by_percent']:g} %"
    return f"? not to be trusted: as drawing shows, first order is off by more than {percent} there"


def _held(budget: Mapping[str, Any]) -> Sheet:
    """Where each bound holds with the precision given."""
    from landsim.budget.words import requirement_text, signed

    precision = budget["precision"]
    rows: list[list[str]] = []
    doubtful = False
    for requirement in budget["requirements"]:
        cells = [requirement_text(requirement)]
        for reading in ("endpoints", "edge-points"):
            stretches = []
            for of in requirement[reading]["holds"]:
                mark = "" if of["first_order_holds"] else " ?"
                stretches.append(f"{signed(of['from_m'], '.4g')} … {signed(of['to_m'], '.4g')} m{mark}")
                doubtful |= bool(mark)
            cells.append("\n".join(stretches) or "nowhere")
        rows.append(cells)
    note = "the lines are never all in the image"
    if precision["far_m"] is not None:
        note = f"looked at from {signed(precision['far_m'], '.4g')} m to {signed(precision['end_m'], '.4g')} m; "
        if precision["hand_over_m"] is None:
            note += "the threshold, and with it roll and along, is never in the image"
        else:
            over = signed(precision["hand_over_m"], ".4g")
            note += f"the threshold leaves the image at {over} m, and with it roll and along"
    note += f"; {_doubt(budget)}, at one end or both" if doubtful else ""
    px = f"{precision['noise_px']:.3g} px"
    return Sheet(("requirement", f"endpoints\nholds with {px}", f"edge-points\nholds with {px}"), rows, note)
