"""From the flights of a batch to its summary and its report."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from landsim.terminal import print_tables

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


def report(folder: Path, scenario: "Scenario", summary: dict[str, Any]) -> list[Path]:
    """Write a batch's report and its figures; RunFolderError if that cannot be."""
    from landsim.errors import RunFolderError
    from landsim.report import write_report

    try:
        return write_report(folder, scenario, summary)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror}") from None


def report_again(folder: Path, say: Callable[[str], None]) -> list[Path]:
    """The report of a finished batch from its flights, as they are."""
    import json

    from landsim.batch.folder import FLIGHTS_FILE, SUMMARY_FILE, load_batch, locked
    from landsim.errors import RunFolderError

    scenario, identity = load_batch(folder)
    if not (folder / FLIGHTS_FILE).is_file():
        raise RunFolderError(f"{folder}: the batch is not finished; landsim batch --resume goes on with it")
    flown: dict[str, Any] = {}
    try:
        before = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))["batch"]
        flown = {name: before[name] for name in ("engine", "workers", "wall_time_s") if before.get(name) is not None}
    except (OSError, ValueError, KeyError, TypeError):
        pass  # it is made again without
    with locked(folder):
        summary = summarised(folder, scenario, identity, flown)
        say("drawing")
        return report(folder, scenario, summary)


def print_batch(summary: dict[str, Any]) -> None:
    """The tables of a batch."""
    from landsim.tables import batch_tables

    print_tables(lambda width: batch_tables(summary, width))
