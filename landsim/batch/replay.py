"""One flight of a batch again, and whether it is the same."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from landsim.batch.folder import CHUNKS, FLIGHTS_FILE, load_batch
from landsim.batch.identity import Identity, flights
from landsim.batch.job import Job
from landsim.batch.row import DRAW, Row, flight_row
from landsim.batch.rows import rows_of
from landsim.batch.verify import check_flights
from landsim.config import Scenario
from landsim.dispersion import keys_of
from landsim.errors import RunFolderError
from landsim.parquet import read_table
from landsim.simulate import Flight

WALL_TIME = "wall_time_s"
"""The one column that may differ."""


class Recorded(NamedTuple):
    """A flight of a batch as the batch has it."""

    scenario: Scenario
    """Of the batch, with its dispersions."""
    identity: Identity
    job: Job
    row: Row


class Replayed(NamedTuple):
    """A flight again."""

    flight: Flight | None
    """None if it raised again."""
    row: Row


def find_flight(folder: Path, index: int) -> Recorded:
    """A flight of a batch, finished or not, with what was drawn for it then.

    Raises
    ------
    RunFolderError
        If the folder holds no batch, or it has not that flight.
    """
    scenario, identity = load_batch(folder)
    if index not in identity.indices():
        of = "" if identity.shard.of == 1 else f" shard {identity.shard} of"
        there = f"{flights(identity.n)}, {'0' if identity.n == 1 else f'0 to {identity.n - 1}'}"
        raise RunFolderError(f"{folder}: holds{of} a batch of {there}, not {index}")
    row = _find(folder, index, scenario, identity)
    if row is None:
        raise RunFolderError(f"{folder}: flight {index} has not been flown yet")
    draws = {key: row[f"{DRAW}{key}"] for key in keys_of(scenario)}
    return Recorded(scenario, identity, Job(index, row["seed"], draws), row)


def _find(folder: Path, index: int, scenario: Scenario, identity: Identity) -> Row | None:
    import pyarrow.parquet as pq

    for path in (folder / FLIGHTS_FILE, *sorted((folder / CHUNKS).glob("*.parquet"))):
        if not path.is_file():
            continue
        check_flights(path, identity, keys_of(scenario))
        at = np.flatnonzero(read_table(path, ["index"])["index"].to_numpy() == index)
        if not at.size:
            continue
        row, first = int(at[0]), 0
        with path.open("rb") as file:
            parts = pq.ParquetFile(file)
            for group in range(parts.num_row_groups):
                size = parts.metadata.row_group(group).num_rows
                if row < first + size:
                    return rows_of(parts.read_row_group(group).slice(row - first, 1), path)[0]
                first += size
    return None


def replay(recorded: Recorded) -> Replayed:
    """Fly a flight of a batch again, in this process, with its seed and its draws."""
    scenario, job = recorded.scenario, recorded.job
    flown: list[Flight] = []
    row = flight_row(scenario, job.seed, draws=job.draws, look=flown.append) | {"index": job.index}
    return Replayed(flown[0] if flown else None, row)


def first_difference(one: Row, other: Row) -> str | None:
    """The first column in which two rows differ by a bit, the wall time left out; None if there is none."""
    for name in dict.fromkeys((*one, *other)):
        if name == WALL_TIME:
            continue
        if name not in one or name not in other or not _same(one[name], other[name]):
            return name
    return None


def _same(one: Any, other: Any) -> bool:
    """Whether two values have the same bits; any NaN is the other's equal."""
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        if one.shape != other.shape:
            return False
        return bool(((one.view(np.int64) == other.view(np.int64)) | (np.isnan(one) & np.isnan(other))).all())
    if isinstance(one, float) and isinstance(other, float):
        return _same(np.array([one]), np.array([other]))
    return bool(type(one) is type(other) and one == other)
