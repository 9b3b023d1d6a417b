"""The table at the end of a flight, from its metrics."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

_NAMES = {
    "along": "along",
    "cross": "cross",
    "height": "height",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
    "glide_slope": "off the glide slope",
    "glide_slope_to_flare": "the same, to the flare",
    "localizer": "off the centreline",
}
_UNITS = {"m": "m", "deg": "°", "mps": "m/s", "s": "s"}


def number(value: float | None, unit: str = "") -> str:
    """A figure to three digits or more, or a dash for what does not exist."""
    if value is None:
        return "–"
    digits = 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1
    space = "" if unit == "°" else " "
    return f"{value:.{digits}f}{space if unit else ''}{unit}"


def flight_tables(metrics: Mapping[str, Any]) -> "Iterable[RenderableType]":
    """What a flight was worth: its outcome in a line, then touchdown and stop, tracking and navigation.

    Parameters
    ----------
    metrics : mapping
        As in metrics.json: None for what does not exist.
    """
    from rich.text import Text

    landed = metrics["outcome"] == "landed"
    verdict = "in the box" if metrics["in_box"] else "not in the box"
    reason = metrics.get("reason")
    yield Text.assemble(
        f"{metrics['scenario']}, seed {metrics['seed']}: ",
        (metrics["outcome"], "bold green" if landed else "bold red"),
        f", {verdict}" if landed else f": {reason}" if reason else "",
    )
    yield _touchdown(metrics)
    yield _accuracy(metrics)


def _table(*columns: str) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right", no_wrap=True)
    return table


def _touchdown(metrics: Mapping[str, Any]) -> "Table":
    touchdown, stop, limits = metrics["touchdown"] or {}, metrics["stop"] or {}, metrics.get("box") or {}
    table = _table("touchdown", "value", "box", "")

    def row(name: str, value: float | None, unit: str, *keys: str) -> None:
        known = [limits[key] for key in keys if key in limits]
        bounds = " … ".join(f"{limit['limit']:g}" for limit in known)
        bounds = f"{'≤ ' if len(known) == 1 else ''}{bounds} {unit}" if known else ""
        kept = all(limit["ok"] for limit in known)
        mark = "" if not known else "[green]ok[/]" if kept else "[red]out[/]"
        table.add_row(name, number(value, unit), bounds.replace(" °", "°"), mark)

    row("past the threshold", touchdown.get("x_m"), "m", "along_min_m", "along_max_m")
    row("right of the centreline", touchdown.get("y_m"), "m", "cross_max_m")
    row("sink rate", touchdown.get("sink_rate_mps"), "m/s", "sink_max_mps")
    row("bank", touchdown.get("bank_deg"), "°", "bank_max_deg")
    row("pitch", touchdown.get("pitch_deg"), "°")
    row("heading error", touchdown.get("heading_error_deg"), "°")
    row("ground speed", touchdown.get("ground_speed_mps"), "m/s")
    row("stop, past the threshold", stop.get("x_m"), "m")
    row("stop, right of the centreline", stop.get("y_m"), "m", "stop_cross_max_m")
    return table


def _accuracy(metrics: Mapping[str, Any]) -> "Table":
    table = _table("errors", "rms", "p95", "vision rms", "vision p95")

    def row(key: str, own: Mapping[str, Any], vision: Mapping[str, Any] | None = None) -> None:
        name, _, suffix = key.rpartition("_")
        unit = _UNITS[suffix]
        figures = [number(source[kind], unit) for source in (own, vision) if source for kind in ("rms", "p95")]
        table.add_row(_NAMES.get(name, name), *figures)

    for key, figures in metrics["tracking"].items():
        row(key, figures)
    table.add_section()
    navigation = metrics["navigation"]
    for key, figures in navigation["fused"].items():
        row(key, figures, navigation["vision"][key])
    return table
