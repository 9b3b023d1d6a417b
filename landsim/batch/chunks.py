"""The flights of a batch that is being flown: files of neighbouring flights, each written once it is complete."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landsim.batch.durable import clear_partial
from landsim.batch.row import Row
from landsim.batch.rows import check_columns, rows_of, save_rows
from landsim.errors import RunFolderError

DAMAGED = ".damaged"
"""What the name of a file ends with that could not be read; its flights are flown again."""


class BatchStopped(Exception):
    """A batch cannot go on; what is on the disk already stays, and can be resumed.  ``str()`` of it is one line."""


class NotWrittenError(BatchStopped):
    """A batch cannot go on because of its folder's place: a full disk, no right to write."""


class Chunks:
    """Blocks of the batch's flights, so many of them a file.

    Parameters
    ----------
    folder : Path
        Of the files; made when the first is written.
    indices : range
        Of the batch's flights.
    size : int
        Flights a file.
    elsewhere : (n,) bool array
        Which of the flights are not to be kept here, since they are elsewhere.
    """

    def __init__(self, folder: Path, indices: range, size: int, elsewhere: NDArray[np.bool_]) -> None:
        import pyarrow.parquet  # noqa: F401 - now, so that memory does not grow at the first file

        self.folder = folder
        self.indices = indices
        self.size = size
        self.there = elsewhere.copy()
        self.damaged: list[Path] = []
        """What could not be read, under its new name."""
        self._elsewhere = elsewhere
        self._open: dict[int, dict[int, Row]] = defaultdict(dict)
        self._stale: dict[int, set[Path]] = defaultdict(set)
        if folder.is_dir():
            clear_partial(folder)
            for path in sorted(folder.glob("*.parquet")):
                self._take(path)

    def missing(self) -> Iterator[int]:
        """Indices of the flights that are not there yet."""
        for position in np.flatnonzero(~self.there).tolist():
            yield self.indices[position]

    def add(self, row: Row) -> None:
        """Take a row; writes a file if that makes one complete.

        Raises
        ------
        NotWrittenError
            If it cannot be written.
        """
        position = self._position(row["index"])
        block = position // self.size
        self._open[block][position] = row
        self.there[position] = True
        if len(self._open[block]) == self._wanted(block).size:
            self._write(block)

    def flush(self) -> None:
        """Write what there is, complete or not; raises as `add` does."""
        for block in list(self._open):
            self._write(block)

    def files(self) -> list[Path]:
        """Those that are written."""
        return sorted(self.folder.glob("*.parquet"))

    def _position(self, index: int) -> int:
        return (index - self.indices.start) // self.indices.step

    def _wanted(self, block: int) -> NDArray[np.intp]:
        """Positions that a block's file has when it is complete."""
        first = block * self.size
        return first + np.flatnonzero(~self._elsewhere[first : first + self.size])

    def _path(self, block: int) -> Path:
        first = block * self.size
        last = min(first + self.size, len(self.indices)) - 1
        return self.folder / f"{self.indices[first]:08d}-{self.indices[last]:08d}.parquet"

    def _write(self, block: int) -> None:
        path = self._path(block)
        rows = [row for _, row in sorted(self._open[block].items())]
        try:
            self.folder.mkdir(exist_ok=True)
            save_rows(path, rows)
            for stale in self._stale.pop(block, set()) - {path}:
                stale.unlink(missing_ok=True)
        except OSError as error:
            raise NotWrittenError(f"{path}: cannot be written: {error.strerror or error}") from None
        del self._open[block]

    def _take(self, path: Path) -> None:
        """What a file holds counts as flown; one that is not a whole block of this batch is taken up again."""
        try:
            table = _verified(path)
            positions = self._positions(path, table["index"].to_pylist())
        except _DamagedError:
            aside = path.with_name(path.name + DAMAGED)
            path.replace(aside)
            self.damaged.append(aside)
            return
        new = [i for i, position in enumerate(positions) if not self.there[position]]
        if not new:  # all of it is elsewhere
            path.unlink()
            return
        blocks = {position // self.size for position in positions}
        if len(blocks) == 1 and path == self._path(block := blocks.pop()):
            wanted = self._wanted(block)
            if len(new) == len(positions) == wanted.size:
                self.there[wanted] = True
                return
        for i, row in zip(new, rows_of(table.take(new), path), strict=True):
            block = positions[i] // self.size
            self._open[block][positions[i]] = row
            self._stale[block].add(path)
            self.there[positions[i]] = True

    def _positions(self, path: Path, indices: Sequence[int]) -> list[int]:
        strange = [index for index in indices if index not in self.indices]
        if strange:
            raise RunFolderError(f"{path}: holds flight {strange[0]}, which does not belong to the batch")
        return [self._position(index) for index in indices]


class _DamagedError(Exception):
    """A file is not as it was written."""


def _verified(path: Path) -> Any:
    """The table of a file, once the sums that were written with it agree."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with suppress(OSError, pa.ArrowException, RunFolderError), path.open("rb") as file:
        table = pq.read_table(file, page_checksum_verification=True)
        check_columns(table.schema, path)
        if table["index"].null_count == 0 and len(table["index"].unique()) == table.num_rows:
            return table
    raise _DamagedError
