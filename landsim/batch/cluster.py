"""Flights on a Dask cluster, through the executor of its client.

A Dask worker does not fly itself: each of its threads has a process of `landsim.batch.pool` that does.  So a flight has
one thread of the matrix libraries, its limit of time and an end of its own there as it has here, whatever the cluster's
workers are like.
"""

import logging
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
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
"""For the scheduler to answer, and for the first of its workers to be there."""
ALONE_S = 60.0
"""A batch goes on for so long with no worker at all, or with no scheduler."""
IDLE_S = 300.0
"""A process on a worker that has had nothing to do for so long ends: its batch may have been killed."""


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
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError("--engine dask needs the package distributed: pip install 'landsim[cluster]'") from None
    _be_quiet()
    if address is None:
        with (
            LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=1,
                threads_per_worker=count,
                processes=False,
                memory_limit=0,
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
            ) as local,
            Client(local, set_as_default=False) as client,  # type: ignore[no-untyped-call]
        ):
            yield from _engine(client, time_limit)
        return
    client = _connected(Client, address)
    with client:
        _probe(client, address, aircraft, seen)
        yield from _engine(client, time_limit)


def _connected(connect: Callable[..., Any], address: str) -> Any:
    what = f"--scheduler {address}"
    try:
        client = connect(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # gaierror and TimeoutError are OSErrors
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{what}: no Dask scheduler answers there: {reason}") from None
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except TimeoutError:
        client.close()
        raise InputError(f"{what}: the scheduler has no workers; begin some with: dask worker {address}") from None
    return client


def _probe(client: Any, address: str, aircraft: Path, seen: Path | None) -> None:
    """InputError if a worker cannot fly the same flights."""
    what = f"--scheduler {address}: worker"
    for worker, found in client.run(probe, aircraft, seen, on_error="return").items():
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


def _engine(client: Any, time_limit: float) -> Iterator[Engine]:
    batch = uuid.uuid4().hex
    threads = sum(client.nthreads().values())
    try:
        yield Engine(_Flown(client.get_executor(pure=False), batch, time_limit), 2 * threads + 2, _Check(client))
    finally:
        # Not waited for without end: the scheduler may be what has failed.
        ending = threading.Thread(target=_end_flyers, args=(client, batch), daemon=True)
        ending.start()
        ending.join(CONNECT_S)


def _end_flyers(client: Any, batch: str) -> None:
    with suppress(Exception):
        client.run(end_flyers, batch, on_error="ignore")


def _be_quiet() -> None:
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
        if self._client.status != "running":
            return "the Dask scheduler does not answer any more"
        return None if self._client.nthreads() else "no Dask worker is left"


class _Flown(Executor):
    """The client's executor, where what is submitted is done by a process of the worker."""

    def __init__(self, executor: Executor, batch: str, time_limit: float) -> None:
        self._executor = executor
        self._call = partial(in_flyer, batch, time_limit)

    def submit(self, fn: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> "Future[_T]":
        return self._executor.submit(self._call, fn, args, kwargs)


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
