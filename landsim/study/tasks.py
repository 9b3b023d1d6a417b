"""Work in processes: many small tasks, their results in order, whatever the number of workers."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any, NamedTuple

from landsim.batch.pool import workers

Progress = Callable[[float, float, str], None]
"""Told how much is done, of how much, and what is being done."""


class Task(NamedTuple):
    """A call of a module's function, which can be sent to another process."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    weight: float
    """Its share of the progress: seconds, roughly."""
    what: str
    """Said of it."""


@contextmanager
def processes(count: int) -> Iterator[Executor | None]:
    """Workers for `run_tasks`; None with a count of one: the work is done in the calling process."""
    if count <= 1:
        yield None
        return
    with workers(count) as pool:
        yield pool


def run_tasks(
    tasks: Sequence[Task], executor: Executor | None = None, finished: Callable[[Task], None] | None = None
) -> list[Any]:
    """The results of the tasks, in their order.

    Parameters
    ----------
    tasks : sequence of Task
        Begun in their order: the longest are best first.
    executor : concurrent.futures.Executor, optional
        Without it the work is done in this process.
    finished : callable, optional
        Is given each task when it is done, in this process.

    Raises
    ------
    Exception
        What a task raised; those that have not begun are dropped then, and so they are on an interrupt.
    """
    results: list[Any] = [None] * len(tasks)
    if executor is None:
        for i, task in enumerate(tasks):
            results[i] = task.function(*task.arguments)
            if finished is not None:
                finished(task)
        return results
    from concurrent.futures import as_completed

    futures = {executor.submit(task.function, *task.arguments): i for i, task in enumerate(tasks)}
    try:
        for future in as_completed(futures):
            i = futures[future]
            results[i] = future.result()
            if finished is not None:
                finished(tasks[i])
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return results
