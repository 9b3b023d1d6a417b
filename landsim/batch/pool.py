"""Processes that fly, as an executor, and rows from any executor.

Each process has pipes of its own.  The executors of the standard library and of pebble share one pipe, and locks on it,
among all of their processes: one that is killed while it writes its result leaves the others waiting for ever.
"""

import os
import pickle
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import Any, ParamSpec, TypeVar

from numpy.typing import ArrayLike

from landsim.batch.process import Process, WorkerDied
from landsim.batch.row import Row, flight_row
from landsim.batch.worker import Call, nothing
from landsim.config import Scenario

_P = ParamSpec("_P")
_T = TypeVar("_T")

START_LIMIT_S = 300.0
"""For the start of a process, its initializer included."""
START_ATTEMPTS = 10
"""Of a process that dies before it is ready: it may be killed then as well as later."""


class Processes(Executor):
    """An executor of processes that may die.

    Each has the matrix libraries on one thread: the filter's matrices are small, more threads make them slower, and
    those of several processes would compete.  The libraries read their number of threads when numpy loads them, so it
    stands in the environment that a process is born with.

    Processes begin at the first `submit`, and the clock of a call does when one of them takes it up.  An interrupt from
    the terminal does not reach them.  They end when this process does, however that ends.

    Parameters
    ----------
    count : int
        Of processes.
    time_limit : float, optional
        For each call, s of wall time.  The future of a call that takes longer raises `TookTooLong`, that of one whose
        process dies raises `WorkerDied`; another process takes the place.
    initializer : callable, optional
        Is called in each process at its start, before any limit.
    initargs : tuple
        Its arguments.
    """

    def __init__(
        self,
        count: int,
        time_limit: float | None = None,
        initializer: Callable[..., Any] | None = None,
        initargs: tuple[Any, ...] = (),
    ) -> None:
        if count < 1:
            raise ValueError(f"there must be a process at least, not {count}")
        self.count = count
        self.time_limit = time_limit
        self._first = _dumps(Call(initializer or nothing, initargs, {}, START_LIMIT_S))
        self._waiting: SimpleQueue[tuple[Future[Any], bytes] | None] = SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._processes: set[Process] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._stopped = False
        self._broken: str | None = None

    def submit(self, fn: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> "Future[_T]":
        """As of any executor; the function has to be one of a module.

        Raises
        ------
        RuntimeError
            After `shutdown`; BrokenExecutor, which is one, if the processes do not start.
        """
        message = _dumps(Call(fn, args, kwargs, self.time_limit))
        future: Future[_T] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("the executor is shut down")
            if self._broken is not None:
                raise BrokenExecutor(self._broken)
            self._waiting.put((future, message))
            if not self._threads:
                self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(self.count)]
                for thread in self._threads:
                    thread.start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """As of any executor."""
        with self._lock:
            if not self._closed:
                self._closed = True
                if cancel_futures:
                    self._drain(None)
                for _ in self._threads:
                    self._waiting.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def kill(self) -> None:
        """End every process at once, whatever it is doing; what has no result yet is cancelled."""
        with self._lock:
            self._closed = self._stopped = True
            self._drain(None)
            for process in self._processes:
                process.kill()
            for _ in self._threads:
                self._waiting.put(None)
        for thread in self._threads:
            thread.join()

    def pids(self) -> list[int]:
        """Of the processes that there are now."""
        with self._lock:
            return [process.pid for process in self._processes if process.lives()]

    def _serve(self) -> None:
        """One process after the other, and a call at a time."""
        process: Process | None = None
        item: tuple[Future[Any], bytes] | None = None
        try:
            process = self._start()
            while (item := self._waiting.get()) is not None:
                future, message = item
                if not future.set_running_or_notify_cancel():
                    continue
                while not process.lives() or not process.tell(message):  # it died while it had nothing to do
                    process = self._start(process)
                self._settle(future, process)
                item = None
                if not process.lives() and not self._stopped:
                    process = self._start(process)
        except (BrokenExecutor, OSError) as failure:
            broken = BrokenExecutor(str(failure))
            with self._lock:
                self._broken = str(failure)
                self._drain(broken)
            if item is not None:
                item[0].set_exception(broken)
        finally:
            if process is not None:
                self._forget(process)

    def _settle(self, future: "Future[Any]", process: Process) -> None:
        try:
            answer = process.hear(self.time_limit)
        except WorkerDied as failure:
            future.set_exception(CancelledError() if self._stopped else failure)
            return
        except Exception as failure:  # noqa: BLE001 - what cannot be read is no result
            future.set_exception(failure)
            return
        if answer.failure is None:
            future.set_result(answer.value)
        else:
            if answer.traceback:
                answer.failure.add_note(answer.traceback)
            future.set_exception(answer.failure)

    def _start(self, before: Process | None = None) -> Process:
        if before is not None:
            self._forget(before)
        said, final = "", False
        for _ in range(START_ATTEMPTS):
            process = Process()
            with self._lock:
                self._processes.add(process)
                if self._stopped:
                    process.kill()
            try:
                if process.tell(self._first):
                    answer = process.hear(START_LIMIT_S)
                    if answer.failure is None:
                        return process
                    said, final = f"{type(answer.failure).__name__}: {answer.failure}", True
            except WorkerDied as failure:
                said = str(failure)
            self._forget(process)
            if final or self._stopped:
                break
        raise BrokenExecutor(f"no process could be started: {said or 'it ended at once'}")

    def _forget(self, process: Process) -> None:
        with self._lock:
            self._processes.discard(process)
        process.close()

    def _drain(self, failure: Exception | None) -> None:
        """Nothing that waits is done any more."""
        with suppress(Empty):
            while (item := self._waiting.get_nowait()) is not None:
                if failure is None:
                    item[0].cancel()
                elif item[0].set_running_or_notify_cancel():
                    item[0].set_exception(failure)
            self._waiting.put(None)  # that was a thread's sign to end


def _dumps(call: Call) -> bytes:
    return pickle.dumps(call, protocol=pickle.HIGHEST_PROTOCOL)


def cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def workers(
    count: int,
    time_limit: float | None = None,
    initializer: Callable[..., Any] | None = None,
    initargs: tuple[Any, ...] = (),
) -> Iterator[Processes]:
    """Processes, as long as they are needed; on an exception they are killed.  Parameters are those of `Processes`."""
    pool = Processes(count, time_limit, initializer, initargs)
    try:
        yield pool
    except BaseException:
        pool.kill()
        raise
    pool.shutdown()


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
