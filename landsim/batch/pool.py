"""Processes that fly, and rows from any executor."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context

from numpy.typing import ArrayLike

from landsim.batch.row import Row, flight_row
from landsim.config import Scenario
from landsim.threads import THREAD_VARIABLES


def fly_rows(
    scenario: Scenario,
    seeds: Sequence[int],
    executor: Executor | None = None,
    progress: Callable[[Row], None] | None = None,
    distances: ArrayLike | None = None,
) -> list[Row]:
    """Fly a scenario once for each seed.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``flight``.
    seeds : sequence of int
    executor : concurrent.futures.Executor, optional
        Of any make, such as `workers` yields; without it the flights are flown here, one after the other.
    progress : callable, optional
        Is given each row when it is finished, in any order.
    distances : (n,) array_like, optional
        As for `flight_row`.

    Returns
    -------
    list of dict
        In the order of the seeds, whoever flew them.

    Raises
    ------
    InputError, ValueError
        As `flight_row` does; what has not begun then is not flown.
    """
    if executor is None:
        rows = []
        for seed in seeds:
            rows.append(flight_row(scenario, seed, distances))
            if progress is not None:
                progress(rows[-1])
        return rows
    futures: list[Future[Row]] = []
    try:
        futures += (executor.submit(flight_row, scenario, seed, distances) for seed in seeds)
        for future in as_completed(futures):
            row = future.result()
            if progress is not None:
                progress(row)
        return [future.result() for future in futures]
    except BaseException:
        for future in futures:
            future.cancel()
        raise


@contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes for `fly_rows`, each with the matrix libraries on one thread.

    The filter's matrices are small: more threads make them slower, and the processes' threads would compete.  The
    libraries read their number of threads once, when numpy loads them.  A forked process has numpy already, and may
    inherit a lock that one of its parent's other threads holds; so the processes are spawned.  Those load numpy as soon
    as they unpickle anything from here, before an initializer of the pool could run: the number has to be in the
    environment that they are born with, and stands in this process's for as long as the pool does.  It changes nothing
    here, where numpy is loaded.

    Parameters
    ----------
    count : int
        Of processes.
    """
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
