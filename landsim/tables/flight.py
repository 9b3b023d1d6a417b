"""What a flight was worth."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from landsim.errors import one_line
from landsim.tables.sheet import UNITS, Sheet, fitting, number

if TYPE_CHECKING:
    from rich.console import RenderableType

_NAMES = {
    "glide_slope_m": "off the glide slope",
    "glide_slope_to_flare_m": "off the glide slope, to the flare",
    "localizer_m": "off the centreline",
}


_STYLES = {"landed": "bold green", "go_around": "bold yellow"}
"""Of an outcome; what is neither a landing nor given up in time went wrong."""


def flight_tables(metrics: Mapping[str, Any], width: int = 100) -> "Iterator[RenderableType]":
    """What a flight was worth: its outcome in a line, then touchdown and stop, tracking and navigation.

    Parameters
    ----------
    metrics : mapping
        As in metrics.json: None for what does not exist.
    width : int
        Columns of the terminal, at least ``NARROWEST``: no figure is cut.
    """
    from rich.text import Text

    landed = metrics["outcome"] == "landed"
    verdict = "in the box" if metrics["in_box"] else "not in the box"
    reason = metrics.get("reason")
    yield Text.assemble(
        f"{one_line(metrics['scenario'])}, seed {metrics['seed']}: ",
        (metrics["outcome"], _STYLES.get(metrics["outcome"], "bold red")),
        f", {verdict}" if landed else f": {one_line(reason)}" if reason else "",
    )
    for sheet in (_touchdown(metrics), _tracking(metrics), _navigation(metrics)):
        yield from fitting(sheet, width)
        if sheet.note:
            yield Text(sheet.note + "\n", style="dim")


def _touchdown(metrics: Mapping[str, Any]) -> Sheet:
    from rich.text import Text

    touchdown, stop, limits = metrics["touchdown"] or {}, metrics["stop"] or {}, metrics.get("box") or {}
    rows: list[list[str | Text]] = []

    def row(name: str, value: float | None, unit: str, sign: str = "", *keys: str) -> None:
        known = [limits[key] for key in keys if key in limits]
        bounds = " … ".join(f"{limit['limit']:g}" for limit in known)
        bounds = f"{sign} {bounds}{'' if unit == '°' else ' '}{unit}".lstrip() if known else ""
        kept = all(limit["ok"] for limit in known)
        told = "" if not known else "ok" if kept else "not reached" if value is None else "out"
        mark = Text(told, style="green" if kept else "red")
        room = [limit["margin"] for limit in known if limit["margin"] is not None]
        rows.append([name, number(value, unit), bounds, number(min(room), unit) if room else "", mark])

    row("past the threshold", touchdown.get("x_m"), "m", "", "along_min_m", "along_max_m")
    row("right of the centreline", touchdown.get("y_m"), "m", "±", "cross_max_m")
    row("sink rate", touchdown.get("sink_rate_mps"), "m/s", "≤", "sink_max_mps")
    row("bank", touchdown.get("bank_deg"), "°", "±", "bank_max_deg")
    row("pitch", touchdown.get("pitch_deg"), "°")
    row("heading error", touchdown.get("heading_error_deg"), "°")
    row("ground speed", touchdown.get("ground_speed_mps"), "m/s")
    row("stop, past the threshold", stop.get("x_m"), "m")
    row("stop, right of the centreline", stop.get("y_m"), "m", "±", "stop_cross_max_m")
    return Sheet(("touchdown", "value", "box", "room", ""), rows)


def _tracking(metrics: Mapping[str, Any]) -> Sheet:
    tracking = metrics["tracking"]
    order = [*(key for key in _NAMES if key in tracking), *(key for key in tracking if key not in _NAMES)]
    rows = []
    for key in order:
        name, _, suffix = key.rpartition("_")
        rows.append([_NAMES.get(key, name), *(number(tracking[key][kind], UNITS[suffix]) for kind in ("rms", "p95"))])
    return Sheet(("tracking", "rms", "p95"), rows)


_OWN = (("fused rms", "fused", "rms"), ("fused p95", "fused", "p95"))
_BOTH = (("both: fused rms", "fused", "paired_rms"), ("both: vision rms", "vision", "paired_rms"))
_VISION = (("vision rms", "vision", "rms"), ("vision p95", "vision", "p95"))


def _navigation(metrics: Mapping[str, Any]) -> Sheet:
    """Errors of the filter and of vision; those over the frames that both have are told apart from those over all."""
    fused, vision = (metrics["navigation"][source] for source in ("fused", "vision"))
    columns = (
        *_OWN,
        *_VISION,
        ("both: fused rms", "fused", "paired_rms"),
        ("both: vision rms", "vision", "paired_rms"),
    )
    note = f"fused: {_frames(fused, 'frames', 'steps')}; vision: {_frames(vision, 'frames')}"
    note += f"; both: {_frames(vision, 'paired_frames')} that have both"
    rows = []
    for quantity in fused:
        name, _, suffix = quantity.rpartition("_")
        sources = {"fused": fused[quantity], "vision": vision[quantity]}
        rows.append([f"{name}, {UNITS[suffix]}", *(number(sources[source].get(kind)) for _, source, kind in columns)])
    return Sheet(("navigation", *(heading.replace(" ", "\n") for heading, _, _ in columns)), rows, note)


def _frames(figures: Mapping[str, Mapping[str, Any]], key: str, what: str = "frames") -> str:
    """Over how many frames the quantities were counted: a number, or the least and the greatest."""
    counts = sorted({of[key] for of in figures.values() if key in of})
    return f"{' to '.join(map(str, counts[:: len(counts) - 1 or 1]))} {what}"
