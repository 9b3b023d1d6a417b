"""Whether a table of flights is one of a batch: what is read back may have been written by anybody."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landsim.batch.identity import Identity
from landsim.batch.row import DRAW
from landsim.batch.rows import check_columns
from landsim.errors import RunFolderError
from landsim.parquet import read_schema, read_table

if TYPE_CHECKING:
    import pyarrow as pa


def check_flights(path: Path, identity: Identity, keys: Iterable[str] = ()) -> int:
    """Refuse a table whose flights are not those of a batch; some of them may be missing.

    Parameters
    ----------
    path : Path
        Of Parquet.
    identity : Identity
        Of the batch.
    keys : iterable of str
        Dotted, that are drawn for every flight.

    Returns
    -------
    int
        How many flights it holds.

    Raises
    ------
    RunFolderError
        If it cannot be read, a column is missing or not of its type, or a flight is there twice, is not of the batch,
        or has another seed than its own, an outcome that there is not, or a draw that is no number.
    """
    keys = tuple(keys)
    check_columns(read_schema(path), path, keys)
    draws = [f"{DRAW}{key}" for key in keys]
    table = read_table(path, ["index", "seed", "in_box", "outcome", *draws])
    _check_indices(table, path, identity)
    for name in ("seed", "in_box", "outcome", *draws):
        _refuse_first(table, np.asarray(table[name].is_null()), path, f"has no {name}")
    index, seed = table["index"].to_numpy(), table["seed"].to_numpy()
    wrong = np.flatnonzero(seed - index != identity.seed)
    if wrong.size:
        at = int(wrong[0])
        told = f"flight {index[at]} has the seed {seed[at]}; it must be {identity.seed + int(index[at])}"
        raise RunFolderError(f"{path}: {told}, the batch's first plus the index")
    _check_outcomes(table, path)
    for name in draws:
        _refuse_first(table, ~np.isfinite(table[name].to_numpy()), path, f"has no number as {name}")
    return int(table.num_rows)


def _check_indices(table: "pa.Table", path: Path, identity: Identity) -> None:
    """Each is of the batch, and there once."""
    if table["index"].null_count:
        raise RunFolderError(f"{path}: is not a table of flights: one of them has no index")
    index, indices = table["index"].to_numpy(), identity.indices()
    strange = (index < indices.start) | (index >= indices.stop) | ((index - indices.start) % indices.step != 0)
    if strange.any():
        raise RunFolderError(f"{path}: holds flight {index[strange][0]}, which does not belong to the batch")
    found, counts = np.unique(index, return_counts=True)
    if found.size < index.size:
        often = found[counts > 1]
        raise RunFolderError(f"{path}: holds flight {often[0]} {counts.max()} times; each must be there once")


def _check_outcomes(table: "pa.Table", path: Path) -> None:
    from landsim.batch.sections.rates import OUTCOMES  # the statistics take half a second

    strange = [outcome for outcome in table["outcome"].unique().to_pylist() if outcome not in OUTCOMES]
    if strange:
        at = table["outcome"].to_pylist().index(strange[0])
        told = f'flight {table["index"][at]} has the outcome "{strange[0]}"; there are {", ".join(OUTCOMES)}'
        raise RunFolderError(f"{path}: {told}")


def _refuse_first(table: "pa.Table", wrong: NDArray[np.bool_], path: Path, what: str) -> None:
    """Tell of the first flight of which something is wrong."""
    at = np.flatnonzero(wrong)
    if at.size:
        raise RunFolderError(f"{path}: flight {table['index'][int(at[0])]} {what}")
