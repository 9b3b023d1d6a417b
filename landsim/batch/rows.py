"""Rows as Parquet."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from landsim.batch.durable import replacing
from landsim.batch.row import ARRAYS, DRAW, SCALARS, Row
from landsim.errors import RunFolderError
from landsim.parquet import read_table

if TYPE_CHECKING:
    import pyarrow as pa

HOW: dict[str, Any] = {"compression": "zstd", "write_page_checksum": True}
"""Of ``pyarrow.parquet``'s writers."""


def check_columns(schema: "pa.Schema", path: Path, keys: Iterable[str] = ()) -> None:
    """Refuse a table that is not one of flights.

    Parameters
    ----------
    schema : pyarrow.Schema
        Of the table.
    path : Path
        For the message.
    keys : iterable of str
        Dotted, of which every flight has a draw.

    Raises
    ------
    RunFolderError
        If a column is missing, or is not of its type.
    """
    import pyarrow as pa

    draws = [name for name in schema.names if name.startswith(DRAW)]
    scalars = SCALARS | dict.fromkeys([*draws, *(f"{DRAW}{key}" for key in keys)], float)
    wanted = {name: _types()[kind] for name, kind in scalars.items()} | dict.fromkeys(ARRAYS, pa.list_(pa.float64()))
    for name, kind in wanted.items():
        if schema.names.count(name) != 1:
            how = "is there twice" if name in schema.names else "is missing"
            raise RunFolderError(f"{path}: is not a table of flights: column {name} {how}")
        there = schema.field(name).type
        same = there.value_type == pa.float64() if name in ARRAYS and pa.types.is_list(there) else there == kind
        if not same:
            raise RunFolderError(f"{path}: is not a table of flights: column {name} must be {kind}, not {there}")


def _types() -> "dict[type, pa.DataType]":
    """What Parquet has for the types of scalars."""
    import pyarrow as pa

    return {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}


def table_of(rows: Sequence[Mapping[str, Any]]) -> "pa.Table":
    """Rows as a table, a row a flight, arrays as lists.

    Parameters
    ----------
    rows : sequence of dict
        Of `flight_row`, all of one scenario.  What else they have than `SCALARS` and `ARRAYS` are numbers: the draws.
    """
    import pyarrow as pa

    kinds = _types()
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
    check_columns(table.schema, path)
    columns: dict[str, list[Any]] = {name: table[name].to_pylist() for name in table.column_names if name not in ARRAYS}
    for name in ARRAYS:
        columns[name] = [np.asarray(value.values.to_numpy(), dtype=float) for value in table[name]]
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
