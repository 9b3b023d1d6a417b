"""Flights through an executor: so many of them at a time that memory does not depend on how many there are."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice

from landsim.batch.chunks import BatchStopped, NotWrittenError
from landsim.batch.deferred import uninterrupted
from landsim.batch.folder import BatchFolder
from landsim.batch.job import Job, Keeper, KeepError, fly_job, jobs_of, lost_job, warm_up
from landsim.batch.pool import workers
from landsim.batch.row import Row
from landsim.config import Scenario
from landsim.errors import traceback_of


@dataclass(frozen=True)
class Engine:
    """Who flies.

    Attributes
    ----------
    executor : concurrent.futures.Executor
        Of any make.
    window : int
        Jobs that it is given at a time.
    check : callable, optional
        Is called now and then while nothing comes; raises BatchStopped if nothing can come any more.
    """

    executor: Executor
    window: int
    check: Callable[[], None] | None = None


@contextmanager
def on_processes(count: int, time_limit: float) -> Iterator[Engine]:
    """So many processes of this machine, with a limit of wall time for each flight (s)."""
    with workers(count, time_limit, warm_up) as pool:
        yield Engine(pool, 2 * count)


PATIENCE_S = 1.0
"""How often to look whether an executor can still fly, and the longest that an interrupt waits."""


def rows_of_jobs(
    jobs: Iterable[Job],
    fly: Callable[[Job], Row],
    lost: Callable[[Job, str, str | None], Row],
    engine: Engine,
) -> Iterator[Row]:
    """Fly jobs, and yield the row of each as it is finished, in any order.

    A flight that raises, or whose worker dies or is ended, makes a row all the same.

    Parameters
    ----------
    jobs : iterable of Job
        Taken as they are needed.
    fly : callable
        Of a job; sent to the executor, and so a module's function, or a partial of one.
    lost : callable
        The row of a job that came to nothing, of the reason and the traceback.
    engine : Engine

    Raises
    ------
    BatchStopped
        If a flight could not be kept, or the executor does not fly any more.
    """
    todo = iter(jobs)
    flying: dict[Future[Row], Job] = {}
    try:
        while True:
            with uninterrupted():
                for job in islice(todo, engine.window - len(flying)):
                    flying[engine.executor.submit(fly, job)] = job
                done = wait(flying, timeout=PATIENCE_S, return_when=FIRST_COMPLETED).done if flying else set()
                rows = [_row(future, flying.pop(future), lost) for future in done]
            yield from rows
            if not flying and not rows:
                return
            if not rows and engine.check is not None:
                engine.check()
    except (BrokenExecutor, CancelledError) as failure:
        raise BatchStopped(str(failure) or "who was to fly has dropped the flights") from None
    finally:
        with uninterrupted():
            for future in flying:
                future.cancel()


def _row(future: "Future[Row]", job: Job, lost: Callable[[Job, str, str | None], Row]) -> Row:
    try:
        return future.result()
    except (BrokenExecutor, CancelledError):
        raise
    except KeepError as failure:
        raise NotWrittenError(f"flight {job.index} cannot be kept: {failure}") from None
    except Exception as failure:  # noqa: BLE001 - one flight must not take the others with it, and its row says why
        return lost(job, *reason_of(failure))


def reason_of(failure: BaseException) -> tuple[str, str | None]:
    """Why a flight came to nothing, in a line, and where.

    What a worker raised brings its traceback along, as ``traceback``, in a note or in its cause; what has none is told
    by its own.
    """
    if hasattr(failure, "traceback"):  # the worker's end: WorkerDied, TookTooLong
        return str(failure), failure.traceback
    notes = getattr(failure, "__notes__", ())
    text = notes[-1] if notes else traceback_of(failure)
    return f"{type(failure).__name__}: {failure}", text


def fly_batch(
    folder: BatchFolder,
    scenario: Scenario,
    engine: Engine,
    keeper: Keeper | None = None,
    progress: Callable[[Row], None] | None = None,
    fly: Callable[[Scenario, Keeper | None, Job], Row] = fly_job,
) -> None:
    """Fly what a batch has not flown yet, and keep the rows as they come.

    Parameters
    ----------
    folder : BatchFolder
        Of the batch.
    scenario : Scenario
    engine : Engine
    keeper : Keeper, optional
        Of whole flights.
    progress : callable, optional
        Is given each row once it is kept.
    fly : callable
        Of the scenario, the keeper and a job; a module's function.

    Raises
    ------
    BatchStopped
        If it cannot go on.
    """
    jobs = jobs_of(scenario, folder.identity, folder.chunks.missing())
    for row in rows_of_jobs(jobs, partial(fly, scenario, keeper), partial(lost_job, scenario), engine):
        folder.add(row)
        if progress is not None:
            progress(row)
