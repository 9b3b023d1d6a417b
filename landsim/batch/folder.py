"""A batch's folder.

::

    batch.json        what the batch is, see `landsim.batch.identity`
    scenario.toml     resolved, with its dispersions
    chunks/           files of neighbouring flights, while it is flown; a complete one is never written again
    flights.parquet   every flight, in the order of the indices, when all are flown; then there are no chunks any more
    kept/<index>/     whole flights, as ``landsim run`` leaves them

The process that writes it holds a lock.  A killed one leaves its complete chunks, and nothing half-written that counts.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landsim.batch.chunks import Chunks, NotWrittenError
from landsim.batch.durable import PARTIAL, clear_partial, write_json, write_text
from landsim.batch.gather import gather
from landsim.batch.identity import (
    BATCH_FILE,
    Identity,
    differing_key,
    differing_version,
    digest,
    flights,
    read_identity,
)
from landsim.batch.row import Row
from landsim.batch.verify import check_flights
from landsim.config import Scenario, load_scenario, resolved_toml
from landsim.errors import RunFolderError, is_text, one_line
from landsim.parquet import read_table

SCENARIO_FILE = "scenario.toml"
FLIGHTS_FILE = "flights.parquet"
SUMMARY_FILE = "summary.json"
CHUNKS = "chunks"
KEPT = "kept"
LOCK_FILE = ".lock"


def is_batch(folder: Path) -> bool:
    """Whether a folder looks like that of a batch, finished or not."""
    try:
        return (folder / BATCH_FILE).is_file()
    except OSError:  # a name too long
        return False


class BatchFolder:
    """The folder of a batch that is being flown; made by `open_batch`.

    Attributes
    ----------
    path : Path
    identity : Identity
    chunks : Chunks
    """

    def __init__(self, path: Path, identity: Identity) -> None:
        self.path = path
        self.identity = identity
        self.chunks = Chunks(path / CHUNKS, identity.indices(), identity.chunk, _finished(path, identity))

    @property
    def done(self) -> int:
        """Flights that have been flown."""
        return int(self.chunks.there.sum())

    def add(self, row: Row) -> None:
        """Take the row of a flight; raises NotWrittenError if it cannot be written."""
        self.chunks.add(row)

    def finish(self) -> Path:
        """All flights to one table, once they are there.

        Raises
        ------
        RunFolderError
            If some are missing.
        NotWrittenError
            If it cannot be written.
        """
        path = self.path / FLIGHTS_FILE
        self.chunks.flush()
        sources = [*([path] if path.is_file() else []), *self.chunks.files()]
        try:
            if sources != [path]:
                gather(sources, path, self.identity.indices())
            shutil.rmtree(self.path / CHUNKS, ignore_errors=True)
        except OSError as error:
            raise NotWrittenError(f"{path}: cannot be written: {error.strerror or error}") from None
        return path


def check_new(path: Path) -> None:
    """RunFolderError if no new batch can be written there: a folder that is not there yet, or is empty."""
    try:
        if not is_text(str(path)) or "\0" in str(path):
            raise RunFolderError(f"{path}: cannot be written: its path must be UTF-8 text")
        if not path.exists():
            return
        if not path.is_dir():
            raise RunFolderError(f"{path}: is a file; name a new folder")
        if is_batch(path):
            raise RunFolderError(f"{path}: already holds a batch; --resume goes on with it, or name a new folder")
        if any(not _is_left_behind(entry) for entry in path.iterdir()):
            raise RunFolderError(f"{path}: is not empty; name a new folder")
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror}") from None


def check_same(path: Path, scenario: Scenario, wanted: Identity) -> None:
    """RunFolderError if what is wanted is not the batch that a folder holds; it may have more flights than that.

    ScenarioError if the scenario that the folder holds cannot be read any more.
    """
    stored = read_identity(path)
    _stored_toml(path)
    if stored.scenario != wanted.scenario:
        raise RunFolderError(f"{path}: holds a batch of {stored.scenario}, not of {wanted.scenario}")
    text = resolved_toml(scenario)
    if digest(text) != stored.scenario_digest:
        there = resolved_toml(_stored_scenario(path, stored))
        raise RunFolderError(f"{path}: was begun with another scenario: {differing_key(there, text)}")
    _stored_scenario(path, stored, text)
    if wanted.aircraft_digest != stored.aircraft_digest:
        raise RunFolderError(f"{path}: was begun with another aircraft: its files have changed since")
    differs = differing_version(stored.versions, wanted.versions)
    if differs is not None:
        raise RunFolderError(f"{path}: was begun with other versions: {differs}; the flights would not compare")
    for name in ("seed", "shard", "keep", "time_limit_s", "chunk"):
        there, here = getattr(stored, name), getattr(wanted, name)
        if there != here:
            raise RunFolderError(f"{path}: was begun with another {name}: {there} there and {here} here")
    if wanted.n < stored.n:
        raise RunFolderError(f"{path}: holds a batch of {flights(stored.n)}, which is more than {wanted.n}")
    if wanted.n != stored.n and stored.sampling == "latin-hypercube":
        raise RunFolderError(
            f"{path}: holds a Latin hypercube of {flights(stored.n)}, which cannot grow to {wanted.n}: every draw of it"
            f" depends on their number"
        )


@contextmanager
def open_batch(path: Path, scenario: Scenario, identity: Identity, *, resume: bool) -> Iterator[BatchFolder]:
    """The folder of a batch, for as long as it is flown; on an exception the incomplete chunks are written too.

    Parameters
    ----------
    path : Path
        Made if it is not there, with those above it.
    scenario : Scenario
    identity : Identity
    resume : bool
        Whether it holds the batch already.

    Raises
    ------
    RunFolderError
        If it cannot be written, or not by `check_new` or `check_same`, or if another process is writing it.
    """
    if resume:
        check_same(path, scenario, identity)
    else:
        check_new(path)
    with locked(path):
        try:
            if resume:
                check_same(path, scenario, identity)  # another may have been at work between our look and our lock
            else:
                check_new(path)
            clear_partial(path)
            if not resume:
                write_text(path / SCENARIO_FILE, _head(scenario, identity) + resolved_toml(scenario))
            if not resume or read_identity(path) != identity:
                write_json(path / BATCH_FILE, identity.as_dict())
            folder = BatchFolder(path, identity)
        except OSError as error:
            raise RunFolderError(f"{path}: cannot be written: {error.strerror}") from None
        try:
            yield folder
        except BaseException:
            with suppress(NotWrittenError):
                folder.chunks.flush()
            raise


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Within it no other process writes a folder, which is made if it is not there; RunFolderError if one does."""
    from filelock import FileLock, Timeout

    try:
        path.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path / LOCK_FILE)
        lock.acquire(timeout=0)
    except Timeout:
        raise RunFolderError(f"{path}: a batch is being written there; wait for it, or name another") from None
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        yield
    finally:
        lock.release()


def load_batch(path: Path) -> tuple[Scenario, Identity]:
    """The scenario and the identity of a batch, finished or not.

    Raises
    ------
    RunFolderError
        If the folder does not hold one.
    ScenarioError
        If its scenario cannot be used any more.
    """
    identity = read_identity(path)
    _stored_toml(path)
    return _stored_scenario(path, identity), identity


def _stored_scenario(path: Path, identity: Identity, original: str | None = None) -> Scenario:
    """The scenario that a folder holds, if it is still the one that the batch was begun with, ``original`` as TOML."""
    scenario = load_scenario(path / SCENARIO_FILE).model_copy(update={"name": identity.scenario})
    text = resolved_toml(scenario)
    if digest(text) != identity.scenario_digest:
        differs = "" if original is None else f": {differing_key(text, original)}"
        raise RunFolderError(
            f"{path / SCENARIO_FILE}: is not the scenario that the batch was flown with{differs}; put back what it was"
        )
    return scenario


def _stored_toml(path: Path) -> str:
    try:
        return (path / SCENARIO_FILE).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise RunFolderError(f"{path}: is not a batch: {SCENARIO_FILE} is missing") from None
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{path / SCENARIO_FILE}: cannot be read: {error}") from None


def _finished(path: Path, identity: Identity) -> NDArray[np.bool_]:
    """Which flights are in the table of all that had been asked for when it was written."""
    there = np.zeros(len(identity.indices()), dtype=bool)
    table = path / FLIGHTS_FILE
    if table.is_file():
        check_flights(table, identity)
        indices = identity.indices()
        for index in read_table(table, ["index"])["index"].to_pylist():
            there[indices.index(index)] = True
    return there


def _is_left_behind(entry: Path) -> bool:
    return entry.name == LOCK_FILE or entry.name.endswith(PARTIAL)


def _head(scenario: Scenario, identity: Identity) -> str:
    shard = "" if identity.shard.of == 1 else f" --shard {identity.shard}"
    again = f"landsim batch {SCENARIO_FILE} -n {identity.n} --seed {identity.seed}{shard}"
    return (
        f"# {one_line(scenario.name)}, resolved: every key as it was flown, {flights(identity.n)} from seed"
        f" {identity.seed} on.\n# The same batch again: {again}\n"
    )
