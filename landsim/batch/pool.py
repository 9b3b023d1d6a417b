"""Processes that fly, as an executor, and rows from any executor.

Each process has pipes of its own.  The executors of the standard library and of pebble share one pipe, and locks on it,
among all of their processes: one that is killed while it writes its result leaves the others waiting for ever.
"""

import os
import pickle
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import IO, Any, ParamSpec, TypeVar

from numpy.typing import ArrayLike

from landsim.batch.row import Row, flight_row
from landsim.batch.worker import BEGIN, Answer, Call, nothing, read_frame, write_frame
from landsim.config import Scenario
from landsim.threads import THREAD_VARIABLES

_P = ParamSpec("_P")
_T = TypeVar("_T")

GRACE_S = 3.0
"""A process that has not ended itself so long after its limit is killed: one that is stopped cannot."""
START_LIMIT_S = 300.0
"""For the start of a process, its initializer included."""
START_ATTEMPTS = 10
"""Of a process that dies before it is ready: it may be killed then as well as later."""
LONGEST_TRACEBACK = 20_000
"""Characters that are kept of what a process said when it ended."""


class WorkerDied(RuntimeError):
    """The process ended while it was at work.

    Attributes
    ----------
    traceback : str or None
        Where it was, a line a call, the innermost last, if it could still say so.
    """

    def __init__(self, message: str, traceback: str | None = None) -> None:
        super().__init__(message)
        self.traceback = traceback


class TookTooLong(WorkerDied):
    """The process was ended because it was at work for longer than its limit."""


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
        self._processes: set[_Process] = set()
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
            return [process.pid for process in self._processes]

    def _serve(self) -> None:
        """One process after the other, and a call at a time."""
        process: _Process | None = None
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
        except BrokenExecutor as failure:
            with self._lock:
                self._broken = str(failure)
                self._drain(failure)
            if item is not None:
                item[0].set_exception(failure)
        finally:
            if process is not None:
                self._forget(process)

    def _settle(self, future: "Future[Any]", process: "_Process") -> None:
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

    def _start(self, before: "_Process | None" = None) -> "_Process":
        if before is not None:
            self._forget(before)
        said, final = "", False
        for _ in range(START_ATTEMPTS):
            process = _Process()
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

    def _forget(self, process: "_Process") -> None:
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


class _Process:
    """A worker and the pipes to it."""

    def __init__(self) -> None:
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        apart: dict[str, Any] = {"process_group": 0} if os.name == "posix" else {"creationflags": 0x200}
        self._popen = subprocess.Popen(
            [sys.executable, "-c", BEGIN],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env=os.environ | dict.fromkeys(THREAD_VARIABLES, "1"),
            **apart,  # an interrupt from the terminal is for its foreground group
        )
        self.pid = self._popen.pid
        self._begun = time.monotonic()
        with suppress(OSError):  # it may have been killed already
            pickle.dump(sys.path, self._to)
            self._to.flush()

    @property
    def _to(self) -> Any:
        return self._popen.stdin

    def lives(self) -> bool:
        return self._popen.poll() is None

    def kill(self) -> None:
        self._popen.kill()

    def close(self) -> None:
        with suppress(OSError):
            self._to.close()  # at which it ends
        with suppress(subprocess.TimeoutExpired):
            self._popen.wait(GRACE_S)
        self._popen.kill()
        self._popen.wait()
        if self._popen.stdout is not None:
            self._popen.stdout.close()
        self._said.close()

    def tell(self, message: bytes) -> bool:
        """Whether it could be told."""
        self._begun = time.monotonic()
        try:
            write_frame(self._to, message)
        except OSError:
            return False
        return True

    def hear(self, limit: float | None) -> Answer:
        """What it answers, within a limit of wall time (s).

        Raises
        ------
        WorkerDied
        """
        heard = threading.Event()

        def overdue() -> None:
            if not heard.wait(1.0):  # an answer that has come by now, while this process itself was stopped, is good
                self._popen.kill()

        timer = None
        if limit is not None:
            timer = threading.Timer(limit + GRACE_S, overdue)
            timer.daemon = True
            timer.start()
        try:
            frame = read_frame(self._popen.stdout)  # type: ignore[arg-type]
        except (EOFError, OSError):
            raise self._why(limit) from None
        finally:
            heard.set()
            if timer is not None:
                timer.cancel()
        answer: Answer = pickle.loads(frame)
        return answer

    def _why(self, limit: float | None) -> WorkerDied:
        taken = time.monotonic() - self._begun
        with suppress(subprocess.TimeoutExpired):
            self._popen.wait(GRACE_S)  # it has closed its pipe: it is about to end
        self._popen.kill()
        code = self._popen.wait()
        self._said.seek(0)
        said = self._said.read(LONGEST_TRACEBACK).decode(errors="replace")
        if limit is not None and taken >= limit:
            return TookTooLong(f"took longer than the limit of {limit:g} s of wall time", calls_of(said))
        return WorkerDied(f"worker died: {f'signal {-code}' if code < 0 else f'exit code {code}'}", calls_of(said))


def calls_of(dump: str) -> str | None:
    """Where a process was, of what ``faulthandler`` wrote: a line a call of its main thread, the innermost last."""
    threads = re.split(r"^(?:Current thread|Thread) .*\n", dump, flags=re.MULTILINE)
    found = re.findall(r'^  File "(?:.*[/\\])?(.*)", line (\d+) in (.*)$', threads[-1], re.MULTILINE)
    calls = [f"{file}:{line} in {name}" for file, line, name in reversed(found)]
    own = [i for i, call in enumerate(calls) if call.startswith("worker.py:")]
    return "\n".join(calls[own[-1] + 1 :] if own else calls) or None


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
