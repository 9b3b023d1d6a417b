"""Parquet files: whole or not there, and told in one line when they cannot be read."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from landsim.errors import RunFolderError

if TYPE_CHECKING:
    import pyarrow as pa


def write_table(path: Path, table: "pa.Table", **how: Any) -> None:
    """Write a table beside its place, then rename it.

    Parameters
    ----------
    path : Path
    table : pyarrow.Table
    **how
        For ``pyarrow.parquet.write_table``.
    """
    import pyarrow.parquet as pq

    beside = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        pq.write_table(table, beside, compression="zstd", **how)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def read_table(path: Path, columns: Sequence[str] | None = None) -> "pa.Table":
    """Read a table.

    Parameters
    ----------
    path : Path
    columns : sequence of str, optional
        Those to read, if not all.

    Raises
    ------
    RunFolderError
        If the file is not there or is not Parquet.
    """
    import pyarrow.parquet as pq

    # From an open file and not by name, which would look for partitions in the names of the folders above.
    with _opened(path) as file:
        return pq.read_table(file, columns=None if columns is None else list(columns))


def read_schema(path: Path) -> "pa.Schema":
    """Names and types of a table's columns, without the table; raises as `read_table` does."""
    import pyarrow.parquet as pq

    with _opened(path) as file:
        return pq.read_schema(file)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A file to read Parquet from; what is wrong with it is told in one line."""
    import pyarrow as pa

    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror or 'not a Parquet file'}") from None
    except pa.ArrowException:
        raise RunFolderError(f"{path}: cannot be read: not a Parquet file") from None
