"""Parquet files: whole or not there, and told in one line when they cannot be read."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

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


def read_table(path: Path) -> "pa.Table":
    """Read a table.

    Raises
    ------
    RunFolderError
        If the file is not there or is not Parquet.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        # Not by name, which would look for partitions in the names of the folders above.
        with path.open("rb") as file:
            return pq.read_table(file)
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror or 'not a Parquet file'}") from None
    except pa.ArrowException:
        raise RunFolderError(f"{path}: cannot be read: not a Parquet file") from None
