"""Rows as Parquet."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from landsim.batch.durable import replacing
from landsim.batch.row import ARRAYS, SCALARS, Row
from landsim.errors import RunFolderError
from landsim.parquet import read_table

if TYPE_CHECKING:
    import pyarrow as pa

HOW: dict[str, Any] = {"compression": "zstd", "write_page_checksum": True}
"""Of ``pyarrow.parquet``'s writers."""


def table_of(rows: Sequence[Mapping[str, Any]]) -> "pa.Table":
    """Rows as a table, a row a flight, arrays as lists.

    Parameters
    ----------
    rows : sequence of dict
        Of `flight_row`, all of one scenario.  What else they have than `SCALARS` and `ARRAYS` are numbers: the draws.
    """
    import pyarrow as pa

    kinds = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
    draws = [name for name in (rows[0] if rows else ()) if name not in SCALARS and name not in ARRAYS]
    scalars = SCALARS | dict.fromkeys(draws, float)
    columns = {name: pa.array([row[name] for row in rows], kinds[kind]) for name, kind in scalars.items()}
    for name in ARRAYS:
        values = [np.asarray(row[name], dtype=float) for row in rows]
        ends = np.cumsum([0, *(v.size for v in values)], dtype=np.int32)
        columns[name] = pa.ListArray.from_arrays(ends, pa.array(np.concatenate([np.empty(0), *values])))
    return pa.table(columns)


def save_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as Parquet; written beside and then renamed.

    Parameters
    ----------
    path : Path
    rows : sequence of dict
        As for `table_of`.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    import pyarrow.parquet as pq

    with replacing(path) as file:
        pq.write_table(table_of(rows), file, **HOW)


def load_rows(path: Path) -> list[Row]:
    """Rows as they were saved, bit for bit.

    Raises
    ------
    RunFolderError
        If the file is not there, is not Parquet or does not hold such rows.
    """
    return rows_of(read_table(path), path)


def rows_of(table: "pa.Table", path: Path) -> list[Row]:
    """The rows of a table of `table_of`; the path is for the message of RunFolderError, if they are none."""
    missing = [name for name in (*SCALARS, *ARRAYS) if name not in table.column_names]
    if missing:
        raise RunFolderError(f"{path}: is not a table of flights: column {missing[0]} is missing")
    columns: dict[str, list[Any]] = {name: table[name].to_pylist() for name in table.column_names if name not in ARRAYS}
    for name in ARRAYS:
        columns[name] = [np.asarray(value.values.to_numpy(), dtype=float) for value in table[name]]
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
