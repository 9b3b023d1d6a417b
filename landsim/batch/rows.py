"""Rows as Parquet."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from landsim.batch.row import ARRAYS, SCALARS, Row
from landsim.errors import RunFolderError
from landsim.parquet import read_table, write_table


def save_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as Parquet, a row a flight, arrays as lists; written beside and then renamed.

    Parameters
    ----------
    path : Path
    rows : sequence of dict
        Of `flight_row`.
    """
    import pyarrow as pa

    kinds = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
    columns = {name: pa.array([row[name] for row in rows], kinds[kind]) for name, kind in SCALARS.items()}
    for name in ARRAYS:
        values = [np.asarray(row[name], dtype=float) for row in rows]
        ends = np.cumsum([0, *(v.size for v in values)], dtype=np.int32)
        columns[name] = pa.ListArray.from_arrays(ends, pa.array(np.concatenate([np.empty(0), *values])))
    write_table(path, pa.table(columns))


def load_rows(path: Path) -> list[Row]:
    """Rows as they were saved, bit for bit.

    Raises
    ------
    RunFolderError
        If the file is not there, is not Parquet or does not hold such rows.
    """
    table = read_table(path)
    missing = [name for name in (*SCALARS, *ARRAYS) if name not in table.column_names]
    if missing:
        raise RunFolderError(f"{path}: is not a table of flights: column {missing[0]} is missing")
    columns: dict[str, list[Any]] = {name: table[name].to_pylist() for name in SCALARS}
    for name in ARRAYS:
        columns[name] = [np.asarray(value.values.to_numpy(), dtype=float) for value in table[name]]
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
