"""Flights on a Dask cluster, through the executor of its client.

A Dask worker does not fly itself: each of its threads has a process of `landsim.batch.pool` that does.  So a flight has
one thread of the matrix libraries, its limit of time and an end of its own there as it has here, whatever the cluster's
workers are like.
"""

import logging
import threading
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from landsim.batch.chunks import BatchStopped
from landsim.batch.engine import Engine
from landsim.batch.identity import differing_version
from landsim.batch.job import warm_up
from landsim.batch.pool import Processes
from landsim.errors import InputError
from landsim.versions import versions

_P = ParamSpec("_P")
_T = TypeVar("_T")

CONNECT_S = 10.0
"""For the scheduler to answer, whatever it is asked."""
WORKER_S = 10.0
"""For the first of its workers to be there."""
PROBE_S = 120.0
"""For every worker to say what it has: it loads the simulation first."""
ALONE_S = 60.0
"""A batch goes on for so long with no worker at all, or with no scheduler."""
IDLE_S = 300.0
"""A process on a worker that has had nothing to do for so long ends: its batch may have been killed."""

GONE = "the Dask scheduler does not answer any more"


@contextmanager
def on_dask(address: str | None, count: int, time_limit: float, aircraft: Path, seen: Path | None) -> Iterator[Engine]:
    """The workers of a scheduler, or, without an address, a cluster of so many threads in this process.

    Parameters
    ----------
    address : str, optional
        Such as ``tcp://host:8786``.
    count : int
        Of flights at a time, without an address.
    time_limit : float
        For each flight, s of wall time.
    aircraft : Path
        The aircraft's folder, which every worker has to have.
    seen : Path, optional
        A file that every worker has to find, since it keeps whole flights in the folder where that stands.

    Raises
    ------
    InputError
        If the scheduler does not answer, has no workers, or these would not fly the same flights.
    """
    try:
        from distributed import LocalCluster
    except ImportError:
        raise InputError("--engine dask needs the package distributed: pip install 'landsim[cluster]'") from None
    _be_quiet()
    if address is None:
        with _refused("--engine dask: no cluster begins in this process"):
            local = LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=1,
                threads_per_worker=count,
                processes=False,
                memory_limit=0,
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
            )
        try:
            with _refused("--engine dask: no cluster begins in this process"):
                client = _connected(local)
            with _closing(client):
                yield from _engine(client, "--engine dask", time_limit)
        finally:
            _ended(local.close)
        return
    what = f"--scheduler {address}"
    with _refused(f"{what}: no Dask scheduler answers there"):
        client = _connected(address)
    with _closing(client):
        with _refused(what):
            _wait_for_worker(client, address)
            _probe(client, address, aircraft, seen)
        yield from _engine(client, what, time_limit)


@contextmanager
def _refused(what: str) -> Iterator[None]:
    """Whatever is raised, in a line: Dask lets through what its sockets, its protocol and its timers raise."""
    try:
        yield
    except InputError:
        raise
    except Exception as failure:  # noqa: BLE001
        reason = str(failure).splitlines()[0] if str(failure) else type(failure).__name__
        raise InputError(f"{what}: {reason}") from None


def _within(limit: float, call: Callable[[], _T]) -> _T:
    """What a call gives within a limit of wall time (s); Dask's own limits leave out some of its waiting.

    Raises
    ------
    ConnectionError
        If it takes longer, and goes on in its thread.
    """
    done: Future[_T] = Future()

    def do() -> None:
        try:
            done.set_result(call())
        except Exception as failure:  # noqa: BLE001 - raised where it is waited for
            done.set_exception(failure)

    threading.Thread(target=do, daemon=True).start()
    if not wait([done], limit).done:
        raise ConnectionError(f"no answer within {limit:g} s")
    return done.result()


def _connected(address: Any) -> Any:
    """A client of a scheduler, by its address, or of a cluster."""
    from distributed import Client

    class Unattended(Client):
        def __del__(self) -> None:
            """Nothing: one that never had an answer would wait for it, and complain on standard error."""

    return _within(2.0 * CONNECT_S, partial(Unattended, address, timeout=CONNECT_S, set_as_default=False))


@contextmanager
def _closing(client: Any) -> Iterator[None]:
    try:
        yield
    finally:
        _ended(partial(client.close, None))


def _ended(end: Callable[[], object]) -> None:
    """Not waited for without end, and no failure: the scheduler may be what has failed."""
    with suppress(Exception):
        _within(CONNECT_S, end)


def _wait_for_worker(client: Any, address: str) -> None:
    try:
        _within(WORKER_S + CONNECT_S, partial(client.wait_for_workers, 1, timeout=WORKER_S))
    except TimeoutError:
        what = f"--scheduler {address}"
        raise InputError(f"{what}: the scheduler has no workers; begin some with: dask worker {address}") from None


def _probe(client: Any, address: str, aircraft: Path, seen: Path | None) -> None:
    """InputError if a worker cannot fly the same flights."""
    what = f"--scheduler {address}: worker"
    asked = _within(PROBE_S, partial(client.run, probe, aircraft, seen, on_error="return"))
    for worker, found in asked.items():
        if isinstance(found, BaseException):
            raise InputError(f"{what} {worker} cannot fly: {type(found).__name__}: {found}")
        there, has_aircraft, has_folder = found
        differs = differing_version(there, versions())
        if differs is not None:
            raise InputError(f"{what} {worker} has other versions: {differs}; its flights would differ")
        if not has_aircraft:
            raise InputError(f"{what} {worker} has no folder {aircraft}, where the aircraft is")
        if not has_folder:
            raise InputError(f"{what} {worker} does not see this machine's files, which --keep needs")


def probe(aircraft: Path, seen: Path | None) -> tuple[dict[str, str], bool, bool]:
    """What a worker has: its versions, and whether it finds the folder and the file."""
    return dict(versions()), aircraft.is_dir(), seen is None or seen.exists()


def _engine(client: Any, what: str, time_limit: float) -> Iterator[Engine]:
    batch = uuid.uuid4().hex
    with _refused(what):
        threads = sum(_within(CONNECT_S, client.nthreads).values())
        executor = client.get_executor(pure=False)
    try:
        yield Engine(_Flown(executor, batch, time_limit), 2 * threads + 2, _Check(client))
    finally:
        _ended(partial(client.run, end_flyers, batch, on_error="ignore"))


def _be_quiet() -> None:
    from distributed.versions import VersionMismatchWarning

    warnings.simplefilter("ignore", VersionMismatchWarning)  # of many lines; the versions that matter are compared here
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    for name in list(logging.root.manager.loggerDict):
        if name.startswith("distributed."):
            logging.getLogger(name).setLevel(logging.CRITICAL)


class _Check:
    """Raises BatchStopped when the cluster has been without workers, or without a scheduler, for long."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._since: float | None = None

    def __call__(self) -> None:
        gone = self._gone()
        if gone is None:
            self._since = None
            return
        now = time.monotonic()
        self._since = self._since or now
        if now - self._since > ALONE_S:
            raise BatchStopped(gone)

    def _gone(self) -> str | None:
        if self._client.status == "running":
            with suppress(Exception):
                return None if _within(CONNECT_S, self._client.nthreads) else "no Dask worker is left"
        return GONE


class _Flown(Executor):
    """The client's executor, where what is submitted is done by a process of the worker."""

    def __init__(self, executor: Executor, batch: str, time_limit: float) -> None:
        self._executor = executor
        self._call = partial(in_flyer, batch, time_limit)

    def submit(self, fn: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> "Future[_T]":
        try:
            return self._executor.submit(self._call, fn, args, kwargs)
        except Exception as failure:  # noqa: BLE001 - of a client that has given its scheduler up
            raise BrokenExecutor(f"{GONE}: {failure}") from None


class _Flyer:
    """A process of a Dask worker's thread; it ends when it has had nothing to do for long."""

    def __init__(self, time_limit: float) -> None:
        self._time_limit = time_limit
        self._busy = threading.Lock()
        self._pool: Processes | None = None
        self._idle: threading.Timer | None = None

    def do(self, function: Callable[..., Any], arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        with self._busy:
            if self._idle is not None:
                self._idle.cancel()
            if self._pool is None:
                self._pool = Processes(1, self._time_limit, warm_up)
            try:
                return self._pool.submit(function, *arguments, **keywords).result()
            finally:
                self._idle = threading.Timer(IDLE_S, self.rest)
                self._idle.daemon = True
                self._idle.start()

    def rest(self) -> None:
        with self._busy:
            if self._pool is not None:
                self._pool.shutdown()
                self._pool = None

    def end(self) -> None:
        """At once, whatever it is doing."""
        pool = self._pool
        if pool is not None:
            pool.kill()
        if self._idle is not None:
            self._idle.cancel()


_flyers: dict[tuple[str, int], _Flyer] = {}
_flyers_lock = threading.Lock()


def in_flyer(
    batch: str, time_limit: float, function: Callable[..., Any], arguments: tuple[Any, ...], keywords: dict[str, Any]
) -> Any:
    """Done by a worker's thread: the call, in the process that belongs to the batch and to the thread."""
    key = (batch, threading.get_ident())
    with _flyers_lock:
        flyer = _flyers.setdefault(key, _Flyer(time_limit))
    return flyer.do(function, arguments, keywords)


def end_flyers(batch: str) -> None:
    """End a worker's processes that belong to a batch."""
    with _flyers_lock:
        ended = [_flyers.pop(key) for key in list(_flyers) if key[0] == batch]
    for flyer in ended:
        flyer.end()
