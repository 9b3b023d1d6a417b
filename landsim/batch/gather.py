"""Tables of flights to one table, in the order of their indices, however many there are: a part is read at a time."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from landsim.batch.durable import replacing
from landsim.batch.rows import HOW, check_columns
from landsim.errors import RunFolderError

if TYPE_CHECKING:
    import pyarrow as pa

GROUP = 250
"""Flights that are read and written at a time."""
TOLD = 5
"""Missing flights that are named."""


class _Place(NamedTuple):
    """Index of each flight and where it is, (n,) each, in the order of the indices."""

    flight: NDArray[np.int64]
    source: NDArray[np.intp]
    group: NDArray[np.intp]
    row: NDArray[np.intp]


def gather(sources: Sequence[Path], to: Path, indices: range) -> None:
    """Write one table of the flights of several.

    Parameters
    ----------
    sources : sequence of Path
        Tables of `landsim.batch.rows`, no flight in two of them.
    to : Path
        Written beside and then renamed; may be one of the sources.
    indices : range
        Of the flights that there have to be.

    Raises
    ------
    RunFolderError
        If a source cannot be read, a flight is missing, in two sources, or none of these, or the columns differ.
    OSError
        If the table cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    with ExitStack() as stack:
        files = []
        for path in sources:
            try:
                files.append(pq.ParquetFile(stack.enter_context(path.open("rb")), page_checksum_verification=True))
            except OSError as error:
                raise RunFolderError(f"{path}: cannot be read: {error.strerror or 'not a Parquet file'}") from None
            except pa.ArrowException:
                raise RunFolderError(f"{path}: cannot be read: not a Parquet file") from None
        schemas = [file.schema_arrow for file in files]
        for path, schema in zip(sources[:1], schemas, strict=False):  # the others must be the same
            check_columns(schema, path)
        for path, schema in zip(sources, schemas, strict=True):
            if not schema.equals(schemas[0]):
                raise RunFolderError(f"{path}: has not the columns of {sources[0]}")
        place = _placed(sources, files, indices)
        with replacing(to) as file, pq.ParquetWriter(file, schemas[0], **HOW) as writer:
            for table in _tables(sources, files, place):
                writer.write_table(table)


def _placed(sources: Sequence[Path], files: Sequence[Any], indices: range) -> _Place:
    parts: list[_Place] = []
    for s, (path, file) in enumerate(zip(sources, files, strict=True)):
        for g in range(file.num_row_groups):
            index = _group(path, file, g, ["index"])["index"].to_numpy()
            n = index.size
            parts.append(_Place(index, np.full(n, s), np.full(n, g), np.arange(n)))
    empty = _Place(np.empty(0, np.int64), *(np.empty(0, np.intp) for _ in range(3)))
    index, source, group, row = (np.concatenate(columns) for columns in zip(empty, *parts, strict=True))
    order = np.argsort(index, kind="stable")
    place = _Place(index[order], source[order], group[order], row[order])
    twice = np.flatnonzero(place.flight[1:] == place.flight[:-1])
    if twice.size:
        at = int(twice[0])
        one, other = (sources[place.source[i]] for i in (at, at + 1))
        where = f"in {one} and in {other}" if one != other else f"in {one} twice"
        raise RunFolderError(f"flight {place.flight[at]} is {where}")
    wanted = np.arange(indices.start, indices.stop, indices.step)
    strange = np.setdiff1d(place.flight, wanted)
    if strange.size:
        where = sources[place.source[int(np.searchsorted(place.flight, strange[0]))]]
        raise RunFolderError(f"{where}: holds flight {strange[0]}, which does not belong to the batch")
    missing = np.setdiff1d(wanted, place.flight)
    if missing.size:
        verb = "is" if missing.size == 1 else "are"
        raise RunFolderError(f"{missing.size} of {wanted.size} flights {verb} missing: {listed(missing.tolist())}")
    return place


def listed(indices: Sequence[int]) -> str:
    """The first of some indices, in words."""
    more = f" and {len(indices) - TOLD} more" if len(indices) > TOLD else ""
    return ", ".join(map(str, indices[:TOLD])) + more


def _tables(sources: Sequence[Path], files: Sequence[Any], place: _Place) -> Iterator["pa.Table"]:
    """The flights in their order, some at a time."""
    import pyarrow as pa

    held: Mapping[tuple[int, int], pa.Table] = {}
    for first in range(0, place.flight.size, GROUP):
        some = slice(first, first + GROUP)
        keys = np.stack((place.source[some], place.group[some]), axis=1)
        needed: list[tuple[int, int]] = [tuple(key) for key in np.unique(keys, axis=0).tolist()]
        held = {key: held[key] if key in held else _group(sources[key[0]], files[key[0]], key[1]) for key in needed}
        begin = dict(zip(needed, np.cumsum([0, *(held[key].num_rows for key in needed)]).tolist(), strict=False))
        at = [begin[tuple(key)] + row for key, row in zip(keys.tolist(), place.row[some].tolist(), strict=True)]
        yield pa.concat_tables([held[key] for key in needed]).take(at).combine_chunks()


def _group(path: Path, file: Any, number: int, columns: list[str] | None = None) -> "pa.Table":
    import pyarrow as pa

    try:
        return file.read_row_group(number, columns=columns)
    except (OSError, pa.ArrowException):
        raise RunFolderError(f"{path}: is damaged; the flights in it have to be flown again") from None
