"""Run folders: a flight's scenario.toml, log.parquet, metrics.json and pictures, written as a whole or not at all.

A run is written into a hidden folder beside its place, ``.<name>.partial``, and then renamed.  What a killed process
leaves behind is such a hidden folder, never half a run.
"""

import json
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count, takewhile
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from landsim.config import Scenario, load_scenario, resolved_toml
from landsim.errors import RunFolderError
from landsim.log import Log, load_log, save_log

SCENARIO_FILE = "scenario.toml"
LOG_FILE = "log.parquet"
METRICS_FILE = "metrics.json"
FILES = (SCENARIO_FILE, LOG_FILE, METRICS_FILE)


class Flown(Protocol):
    """What a flight leaves: ``landsim.simulate.Flight`` is one."""

    @property
    def metrics(self) -> dict[str, Any]:
        """As in metrics.json."""

    @property
    def log(self) -> Log:
        """As in log.parquet."""


class Run(NamedTuple):
    """A run as read back."""

    scenario: Scenario
    log: Log
    metrics: dict[str, Any]


class Place(NamedTuple):
    """Where a run is written, and where it will be."""

    temporary: Path
    final: Path


@contextmanager
def new_run(name: str, out: Path | None = None, root: Path = Path("runs")) -> Iterator[Place]:
    """A place for a run: a temporary folder, renamed to the final one if all goes well and removed if not.

    Parameters
    ----------
    name : str
        Of the scenario.
    out : Path, optional
        The final folder: not there yet, or empty.  By default ``<root>/NNN-<name>``, where NNN is one more than the
        greatest number there; two processes never get the same.
    root : Path
        Folder of the numbered runs.

    Raises
    ------
    RunFolderError
        Before anything is yielded, if the folder cannot be written, is a file or is not empty.
    """
    final = None if out is None else _checked(out)
    parent = root if final is None else final.parent
    made = _make_parents(parent, root if out is None else out)
    try:
        try:
            place = _numbered(root, name) if final is None else _beside(final)
        except OSError as error:
            raise RunFolderError(f"{out or root}: cannot be written: {error.strerror}") from None
        try:
            yield place
            _finish(place)
        except BaseException:  # not in any case: once renamed, another process may hold a folder of that name
            shutil.rmtree(place.temporary, ignore_errors=True)
            raise
    except BaseException:
        _remove_empty(made)
        raise


def write_run(folder: Path, scenario: Scenario, flight: Flown) -> None:
    """Write scenario.toml, log.parquet and metrics.json into an existing folder.

    Raises
    ------
    RunFolderError
        If a file cannot be written.
    """
    first_line = f"# {scenario.name}, resolved: every key with the value that was flown.\n"
    try:
        (folder / SCENARIO_FILE).write_text(first_line + resolved_toml(scenario), encoding="utf-8")
        save_log(folder / LOG_FILE, flight.log)
        text = json.dumps(as_json(flight.metrics), indent=2, ensure_ascii=False, allow_nan=False)
        (folder / METRICS_FILE).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror or error}") from None


def read_run(folder: Path) -> Run:
    """Read a run back; what was NaN in its metrics is None.

    Raises
    ------
    RunFolderError
        If the folder does not hold a run.
    ScenarioError
        If its scenario cannot be used any more.
    """
    for name in FILES:
        if not (folder / name).is_file():
            raise RunFolderError(f"{folder}: is not a run: {name} is missing")
    try:
        metrics = json.loads((folder / METRICS_FILE).read_text(encoding="utf-8"))
        name = str(metrics["scenario"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunFolderError(f"{folder / METRICS_FILE}: cannot be read as a flight's metrics: {error!r}") from None
    scenario = load_scenario(folder / SCENARIO_FILE).model_copy(update={"name": name})
    return Run(scenario, load_log(folder / LOG_FILE), metrics)


def as_json(value: Any) -> Any:
    """A copy in JSON's own types: numpy scalars and arrays become plain, tuples lists, NaN and infinities None."""
    if isinstance(value, Mapping):
        return {str(key): as_json(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _checked(out: Path) -> Path:
    """The folder to make, links resolved, if a run may be written there."""
    try:
        final = out.expanduser().resolve()
        if final.is_dir():
            if any((final / name).exists() for name in FILES):
                raise RunFolderError(f"{out}: already holds a run; name a new folder")
            if any(final.iterdir()):
                raise RunFolderError(f"{out}: is not empty; name a new folder")
            if final.is_mount() or final == Path.cwd():
                raise RunFolderError(f"{out}: cannot be replaced by the finished run; name a folder inside it")
        elif final.exists():
            raise RunFolderError(f"{out}: is a file; name a new folder")
    except OSError as error:
        raise RunFolderError(f"{out}: cannot be written: {error.strerror}") from None
    except (RuntimeError, ValueError) as error:  # a loop of links, no home folder, a null character
        if isinstance(error, RunFolderError):
            raise
        raise RunFolderError(f"{out}: is not a folder's name: {error}") from None
    return final


def _make_parents(parent: Path, asked: Path) -> list[Path]:
    """Make a folder with those above it; returns what was made, the deepest first."""
    made: list[Path] = []
    try:
        missing = list(takewhile(lambda folder: not folder.exists(), (parent, *parent.parents)))
        for folder in reversed(missing):
            folder.mkdir(exist_ok=True)
            made.insert(0, folder)
    except OSError as error:
        _remove_empty(made)
        raise RunFolderError(f"{asked}: cannot be written: {error.filename}: {error.strerror}") from None
    return made


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:  # somebody else has put something there
            break


def _beside(final: Path) -> Place:
    for attempt in count():
        temporary = final.with_name(f".{final.name}.{os.getpid()}-{attempt}.partial")
        try:
            temporary.mkdir()
        except FileExistsError:
            continue
        return Place(temporary, final)
    raise AssertionError


def _finish(place: Place) -> None:
    try:
        place.temporary.replace(place.final)
    except OSError as error:
        raise RunFolderError(f"{place.final}: cannot be written: {error.strerror}") from None


def _numbered(root: Path, name: str) -> Place:
    """Reserve the next number by making its temporary folder, which only one process can."""
    while True:
        number = max(_numbers(root), default=0) + 1
        temporary = root / f".{number:03d}.partial"
        try:
            temporary.mkdir()
        except FileExistsError:
            continue
        if number not in _numbers(root, finished=True):  # another may have finished it between our look and our mkdir
            return Place(temporary, root / f"{number:03d}-{name}")
        temporary.rmdir()


def _numbers(root: Path, *, finished: bool = False) -> set[int]:
    """The run numbers in a folder, those being written included unless only the finished are asked for."""
    numbers = set()
    for entry in root.iterdir():
        if finished and entry.name.startswith("."):
            continue
        digits = entry.name.lstrip(".").split("-")[0].split(".")[0]
        if digits.isascii() and digits.isdigit():
            numbers.add(int(digits))
    return numbers
