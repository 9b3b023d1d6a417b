"""Run folders: a flight's scenario.toml, log.parquet, metrics.json and pictures, written as a whole or not at all.

A run is written into a hidden folder beside its place, ``.<name>.partial``, and then renamed.  Making that folder
reserves the place: only one process can.  What a killed process leaves behind is such a folder, never half a run.
"""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Protocol

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from landsim.config import Scenario, load_scenario, resolved_toml
from landsim.errors import RunFolderError, is_text, one_line, what_is_wrong
from landsim.log import COLUMNS, Log, load_log, save_log
from landsim.plain import as_json
from landsim.resources import shipped_scenarios
from landsim.study.folder import VERDICT_FILE, load_study

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


class _Needed(BaseModel):
    """What the pictures and a repetition need of metrics.json; there is more in it."""

    model_config = ConfigDict(strict=True)


class _Limit(_Needed):
    ok: bool


class _Stop(_Needed):
    x_m: float


class _Touchdown(_Needed):
    time_s: float
    x_m: float
    y_m: float
    sink_rate_mps: float
    ground_speed_mps: float
    pitch_deg: float
    bank_deg: float


class _Metrics(_Needed):
    scenario: str
    seed: Annotated[int, Field(ge=0)]
    outcome: str
    reason: str
    in_box: bool
    box: dict[str, _Limit]
    touchdown: _Touchdown | None
    stop: _Stop | None


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
        Before anything is yielded, if the folder cannot be written, is a file or is not empty, or if another process is
        writing it.
    """
    final = None if out is None else _checked(out)
    parent = root if final is None else final.parent
    made = _make_parents(parent, root if out is None else out)
    try:
        try:
            place = _numbered(root, name) if out is None or final is None else _beside(final, out)
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


def numbered_folder(name: str, root: Path = Path("runs")) -> Path:
    """Make the next numbered folder, ``<root>/NNN-<name>``, which two processes never get both; it is empty.

    Raises
    ------
    RunFolderError
        If it cannot be made.
    """
    with new_run(name, root=root) as place:
        pass
    return place.final


def write_run(folder: Path, scenario: Scenario, flight: Flown) -> None:
    """Write scenario.toml, log.parquet and metrics.json into an existing folder.

    The comments at the head of scenario.toml name the scenario, the seed and the command that repeats the flight.

    Raises
    ------
    RunFolderError
        If a file cannot be written.
    """
    seed = flight.metrics["seed"]
    head = (
        f"# {one_line(scenario.name)}, seed {seed}, resolved: every key with the value that was flown.\n"
        f"# The same flight again: landsim run DIR, where DIR is the folder of this file;"
        f" without its folder: landsim run {SCENARIO_FILE} --seed {seed}\n"
    )
    try:
        (folder / SCENARIO_FILE).write_text(head + resolved_toml(scenario), encoding="utf-8")
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
    _must_hold(folder, FILES)
    metrics = _read_metrics(folder)
    scenario = load_scenario(folder / SCENARIO_FILE).model_copy(update={"name": metrics["scenario"]})
    try:
        log = load_log(folder / LOG_FILE)
    except RunFolderError:
        raise
    except (ValueError, TypeError) as error:  # a column that is not numbers
        raise RunFolderError(f"{folder}: is not a run: {LOG_FILE}: {error}") from None
    missing = [column.name for column in COLUMNS if column.name not in log]
    if missing:
        others = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        raise RunFolderError(f"{folder}: is not a run: {LOG_FILE}: column {missing[0]} is missing{others}")
    return Run(scenario, log, metrics)


def load_flight(name_or_path: str, overrides: Mapping[str, object] | None = None) -> tuple[Scenario, int | None]:
    """A scenario to fly or to study, and the seed to repeat if it was named by the folder of a run.

    Parameters
    ----------
    name_or_path : str
        As for `landsim.config.load_scenario`, or a folder that holds a run or a study.  A shipped name wins over a
        folder.
    overrides : mapping, optional
        As there.

    Returns
    -------
    (Scenario, int or None)
        Of a run, under the name it was flown by.

    Raises
    ------
    RunFolderError
        If a folder does not hold a run.
    ScenarioError
        If the scenario cannot be used.
    """
    folder = Path(name_or_path)
    try:
        may_hold_a_run = bool(name_or_path) and name_or_path not in shipped_scenarios() and folder.is_dir()
    except OSError:  # a name too long
        may_hold_a_run = False
    if not may_hold_a_run:
        return load_scenario(name_or_path, overrides), None
    if (folder / VERDICT_FILE).is_file():
        return load_study(folder, overrides)
    _must_hold(folder, (SCENARIO_FILE, METRICS_FILE))
    metrics = _read_metrics(folder)
    scenario = load_scenario(folder / SCENARIO_FILE, overrides)
    return scenario.model_copy(update={"name": metrics["scenario"]}), metrics["seed"]


def _must_hold(folder: Path, names: tuple[str, ...]) -> None:
    for name in names:
        if not (folder / name).is_file():
            raise RunFolderError(f"{folder}: is not a run: {name} is missing")


def _read_metrics(folder: Path) -> dict[str, Any]:
    """What metrics.json holds, once it is known to be a flight's."""
    what = f"{folder}: is not a run: {METRICS_FILE}"
    try:
        metrics: dict[str, Any] = json.loads((folder / METRICS_FILE).read_text(encoding="utf-8"))
        needed = _Metrics.model_validate(metrics)
    except ValidationError as failure:
        error = failure.errors(include_url=False)[0]
        place = ".".join(map(str, error["loc"]))
        raise RunFolderError(f"{what}: {place}{' ' if place else ''}{what_is_wrong(dict(error))}") from None
    except OSError as error:
        raise RunFolderError(f"{folder / METRICS_FILE}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{what}: not JSON: {error}") from None
    name = needed.scenario
    if not name or name != Path(name).name or "\0" in name or not is_text(name):  # it becomes part of a folder's name
        raise RunFolderError(f'{what}: scenario cannot be a name: "{name}"')
    return metrics


def _checked(out: Path) -> Path:
    """The folder to make, links resolved, if a run may be written there."""
    try:
        final = out.expanduser().resolve()
        if not is_text(str(final)):  # Parquet and TOML could not say it
            raise RunFolderError(f"{out}: cannot be written: its path must be UTF-8 text")
        if final.is_dir():
            if any((final / name).exists() for name in (*FILES, VERDICT_FILE)):
                raise RunFolderError(f"{out}: already holds a run; name a new folder")
            if any(final.iterdir()):
                raise RunFolderError(f"{out}: is not empty; name a new folder")
            if final.is_mount() or final.samefile("."):
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


def _beside(final: Path, out: Path) -> Place:
    """Reserve a name by making its temporary folder, which only one process can."""
    temporary = final.with_name(f".{final.name}.partial")
    try:
        temporary.mkdir()
    except FileExistsError:
        raise RunFolderError(
            f"{out}: is being written by another run; if none is at work, remove {temporary}, which one left behind"
        ) from None
    try:
        _checked(out)  # another may have finished it between our look and our mkdir
    except BaseException:
        temporary.rmdir()
        raise
    return Place(temporary, final)


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
