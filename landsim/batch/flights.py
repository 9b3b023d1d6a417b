"""The flights of a batch as columns: what every statistic is made from."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.so3 import Array
from landsim.batch.row import ARRAYS, DRAW, SCALARS
from landsim.batch.rows import check_columns
from landsim.errors import RunFolderError
from landsim.parquet import read_schema, read_table


@dataclass(frozen=True)
class Flights:
    """The flights of a batch, one after the other.

    Attributes
    ----------
    n : int
        How many.
    columns : mapping of str to sequence
        The scalars of `landsim.batch.row.SCALARS` and the draws, n values each.  Floats are an array, NaN where there
        is nothing; flags are one, False where there is nothing; whole numbers are one if none is missing; what else
        there is is a list, with None.
    arrays : mapping of str to (n, m) array
        Those of `landsim.batch.row.ARRAYS`; NaN where there is nothing.  Of a file, each is read when it is asked for:
        all of them, of a hundred thousand flights, do not fit into memory.
    """

    n: int
    columns: Mapping[str, Any]
    arrays: Mapping[str, Array]

    @property
    def draws(self) -> tuple[str, ...]:
        """The dispersed keys, in the columns' order."""
        return tuple(name.removeprefix(DRAW) for name in self.columns if name.startswith(DRAW))

    @property
    def distances(self) -> Array:
        """To the threshold (m,), m, falling: at which the arrays have their numbers."""
        return np.asarray(self.arrays["distance_m"][0]) if self.n else np.empty(0)

    def numbers(self, name: str) -> Array:
        """A column (n,) of numbers; NaN where there is nothing."""
        return np.asarray(self.columns[name], dtype=float)  # None becomes NaN

    def flags(self, name: str) -> NDArray[np.bool_]:
        """A column (n,) of what is true; False where there is nothing."""
        return np.asarray(self.columns[name], dtype=bool)

    def are(self, name: str, text: str) -> NDArray[np.bool_]:
        """Where a column of texts says this, (n,)."""
        return np.array([v == text for v in self.columns[name]], dtype=bool).reshape(self.n)


def flights_of(rows: Sequence[Mapping[str, Any]]) -> Flights:
    """Flights from rows of `landsim.batch.row.flight_row`.

    Parameters
    ----------
    rows : sequence of dict
        All with the same columns and the same distances.

    Raises
    ------
    ValueError
        If the rows differ in their columns or distances.
    """
    first = rows[0] if rows else dict.fromkeys(SCALARS)
    names = [name for name in first if name not in ARRAYS]
    if any([name for name in row if name not in ARRAYS] != names for row in rows):
        raise ValueError("the rows differ in their columns")
    arrays = {name: _stacked([np.asarray(row[name], dtype=float) for row in rows]) for name in ARRAYS}
    if len(rows) and (arrays["distance_m"] != arrays["distance_m"][0]).any():
        raise ValueError("the rows differ in their distances")
    return Flights(len(rows), {name: _column(name, [row[name] for row in rows]) for name in names}, arrays)


def load_flights(path: Path) -> Flights:
    """The flights of a file that `landsim.batch.rows.save_rows` has written.

    Raises
    ------
    RunFolderError
        If the file is not there, is not Parquet, or holds no flights that can be laid over each other.
    """
    schema = read_schema(path)
    check_columns(schema, path)
    table = read_table(path, [name for name in schema.names if name in SCALARS or name.startswith(DRAW)])
    columns = {name: _column(name, table[name].to_pylist()) for name in table.column_names}
    flights = Flights(table.num_rows, columns, _Stored(path))
    if flights.n:
        distances = flights.arrays["distance_m"]
        if (distances != distances[0]).any():
            raise RunFolderError(f"{path}: is not a table of flights of one batch: the distances differ")
    return flights


class _Stored(Mapping[str, Array]):
    """Arrays that stay in their file until they are asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __getitem__(self, name: str) -> Array:
        if name not in ARRAYS:
            raise KeyError(name)
        table = read_table(self.path, [name])
        lists = table[name].combine_chunks()
        if not len(lists):
            return np.empty((0, 0))
        sizes = np.asarray(lists.value_lengths().fill_null(0))
        if (sizes != sizes[0]).any():
            raise RunFolderError(f"{self.path}: is not a table of flights of one batch: {name} differ in length")
        return np.asarray(lists.flatten().to_numpy(zero_copy_only=False), dtype=float).reshape(len(lists), sizes[0])

    def __iter__(self) -> Iterator[str]:
        return iter(ARRAYS)

    def __len__(self) -> int:
        return len(ARRAYS)


def _column(name: str, values: list[Any]) -> Any:
    """A column as `Flights` has it."""
    kind = SCALARS.get(name, float)
    if kind is float:
        return np.array(values, dtype=float)
    if kind is bool:
        return np.array(values, dtype=bool)
    return np.array(values, dtype=np.int64) if kind is int and None not in values else values


def _stacked(values: list[Array]) -> Array:
    if len({v.size for v in values}) > 1:
        raise ValueError("the rows differ in their distances")
    return np.array(values) if values else np.empty((0, 0))
