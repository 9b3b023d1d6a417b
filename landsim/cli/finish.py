"""From the flights of a batch to its summary and its report."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from landsim.terminal import print_tables, shown, tell

if TYPE_CHECKING:
    from landsim.batch.identity import Identity
    from landsim.config import Scenario


def summarised(folder: Path, scenario: "Scenario", identity: "Identity", flown: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of a batch whose flights are all there, written beside them.

    Parameters
    ----------
    folder : Path
        Of the batch.
    scenario, identity
        Of the batch.
    flown : mapping
        What is known of how it was flown, beside its identity: ``engine``, ``workers``, ``wall_time_s``.

    Raises
    ------
    RunFolderError
        If a file cannot be read or written.
    """
    from landsim.batch.durable import write_json
    from landsim.batch.flights import load_flights
    from landsim.batch.folder import FLIGHTS_FILE, SUMMARY_FILE
    from landsim.batch.summary import summarise
    from landsim.errors import RunFolderError

    summary = summarise(scenario, load_flights(folder / FLIGHTS_FILE), identity.as_dict() | dict(flown))
    try:
        write_json(folder / SUMMARY_FILE, summary)
    except OSError as error:
        raise RunFolderError(f"{folder / SUMMARY_FILE}: cannot be written: {error.strerror}") from None
    return summary


def flights_there(folder: Path, scenario: "Scenario", identity: "Identity") -> int:
    """How many of its flights the table of a batch holds.

    Raises
    ------
    RunFolderError
        If there is no table yet, or its flights are not those of the batch.
    """
    from landsim.batch.folder import FLIGHTS_FILE
    from landsim.batch.verify import check_flights
    from landsim.dispersion import keys_of
    from landsim.errors import RunFolderError

    if not (folder / FLIGHTS_FILE).is_file():
        raise RunFolderError(f"{folder}: the batch is not finished; landsim batch --resume goes on with it")
    return check_flights(folder / FLIGHTS_FILE, identity, keys_of(scenario))


def missing_flights(folder: Path, there: int, identity: "Identity") -> str:
    """A line on a batch of which not all flights are there."""
    from landsim.batch.identity import flights

    asked = len(identity.indices())
    return f"{shown(folder)}: {there} of its {flights(asked)} are there; landsim batch --resume flies the others"


def report(folder: Path, scenario: "Scenario", summary: dict[str, Any]) -> list[Path]:
    """Write a batch's report and its figures; RunFolderError if that cannot be."""
    from landsim.errors import RunFolderError
    from landsim.report import write_report

    try:
        return write_report(folder, scenario, summary)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None


def report_again(folder: Path, say: Callable[[str], None]) -> list[Path]:
    """The report of a batch from its table of flights, as they are."""
    import json

    from landsim.batch.folder import SUMMARY_FILE, load_batch, locked

    scenario, identity = load_batch(folder)
    there = flights_there(folder, scenario, identity)
    flown: dict[str, Any] = {}
    try:
        before = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))["batch"]
        flown = {name: before[name] for name in ("engine", "workers", "wall_time_s") if before.get(name) is not None}
    except (OSError, ValueError, KeyError, TypeError):
        pass  # it is made again without
    if there < len(identity.indices()):
        tell(missing_flights(folder, there, identity))
    with locked(folder):
        summary = summarised(folder, scenario, identity, flown)
        say("drawing")
        return report(folder, scenario, summary)


def clear_report(folder: Path, asked: int) -> None:
    """Remove what a killed process was drawing in a batch's folder, and a report of fewer flights than it is to have.

    What is removed are the files that `report` writes, by their names; of a report it says so in a line.

    Parameters
    ----------
    folder : Path
        Of the batch, locked.
    asked : int
        Flights that it is to have.

    Raises
    ------
    RunFolderError
        If a file cannot be removed.
    """
    import json

    from landsim.batch.folder import SUMMARY_FILE
    from landsim.batch.identity import flights
    from landsim.batch.sections.words import several
    from landsim.errors import RunFolderError
    from landsim.report import REPORT
    from landsim.study.words import listed

    try:
        summary = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
        described = summary["batch"]["n"]
    except (OSError, ValueError, KeyError, TypeError):
        summary, described = {}, None  # as where nothing has been summed up yet
    figures = _figures_of(summary)
    try:
        for name in (*REPORT, *figures):
            (folder / f".{name}.part").unlink(missing_ok=True)
        if described is None or described >= asked:
            return
        pages, drawn = ([name for name in names if (folder / name).is_file()] for names in (REPORT, figures))
        for name in (*pages, *drawn, SUMMARY_FILE):  # last what names the others, so that a killed one can go on
            (folder / name).unlink()
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None
    removed = [*pages, *([several(len(drawn), "figure")] if drawn else [])]
    if removed:
        what = f"{listed(removed)}, of {flights(described)}"
        tell(f"{shown(folder)}: removed {what}: the batch goes on to {asked}; landsim plot draws them again")


def _figures_of(summary: Mapping[str, Any]) -> list[str]:
    """The names of the files that the figures of a batch are in."""
    from landsim.charts.batch import batch_charts

    try:
        charts = [chart for section in batch_charts(summary).values() for chart in section]
    except (LookupError, TypeError, ValueError, AttributeError):  # not a summary of ours
        return []
    return [f"{chart.name}.{ending}" for chart in charts for ending in ("png", "pdf")]


def print_batch(summary: dict[str, Any]) -> None:
    """The tables of a batch."""
    from landsim.tables import batch_tables

    print_tables(lambda width: batch_tables(summary, width))
