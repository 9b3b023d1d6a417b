"""A process that does what it is told over a pipe: the far end of `landsim.batch.pool.Processes`.

It reads calls from standard input and writes their results to what was standard output.  Only this process and the one
that began it hold the pipes, so that the end of either is seen by the other at once, in the middle of a message too: no
lock is shared, and nothing is left for a third to wait for.

Frames are a length of eight bytes and a pickle.
"""

import faulthandler
import gc
import os
import pickle
import signal
import struct
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from traceback import format_exception
from typing import Any, BinaryIO, NamedTuple

LENGTH = struct.Struct(">Q")
BEGIN = "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer); from landsim.batch.worker import main; main()"
"""What the interpreter of a worker runs: modules are found where the process that begins it finds them."""


class Call(NamedTuple):
    """What is asked of a worker."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    keywords: dict[str, Any]
    limit: float | None = None
    """Wall time after which the process ends itself, s."""


class Answer(NamedTuple):
    """What a call gave: a value, or what it raised."""

    value: Any = None
    failure: BaseException | None = None
    traceback: str = ""


def nothing() -> None:
    """What a worker begins with where there is nothing to begin with."""


def write_frame(stream: BinaryIO, content: bytes) -> None:
    """Write a frame, and flush.

    Raises
    ------
    OSError
        If nobody reads it.
    """
    stream.write(LENGTH.pack(len(content)))
    stream.write(content)
    stream.flush()


def read_frame(stream: BinaryIO) -> bytes:
    """Read a frame.

    Raises
    ------
    EOFError
        If the stream ends before the frame does.
    """
    head = stream.read(LENGTH.size)
    if len(head) == LENGTH.size:
        (length,) = LENGTH.unpack(head)
        content = stream.read(length)
        if len(content) == length:
            return content
    raise EOFError


def main() -> None:
    """Serve until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever began this process answers an interrupt, and ends it
    answers = _own_output()
    faulthandler.enable()  # what ends this process says so on standard error, which is a file of the other's
    calls: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, calls), daemon=True).start()
    _send(answers, _answer(calls.get())._replace(value=None))
    gc.collect()
    gc.freeze()  # what is loaded by now stays: no collection has to look at it again
    gc.disable()  # a flight makes many objects and few cycles: what these hold is freed between flights
    while True:
        _send(answers, _answer(calls.get()))
        gc.collect()


def _own_output() -> BinaryIO:
    """Standard output for the answers alone: what libraries print goes to standard error."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return answers


def _read(stream: BinaryIO, calls: "SimpleQueue[bytes]") -> None:
    """Hand calls over as they come; ends the process, whatever it is doing, when the other end has gone."""
    with suppress(EOFError, OSError):
        while True:
            calls.put(read_frame(stream))
    os._exit(0)


def _answer(frame: bytes) -> Answer:
    with suppress(OSError):  # what was said so far belongs to a call that is over
        os.ftruncate(2, 0)
        os.lseek(2, 0, os.SEEK_SET)
    try:
        call: Call = pickle.loads(frame)
        if call.limit is not None:
            # Not a timer of Python's: a thread of its own that needs no lock of the interpreter's.
            faulthandler.dump_traceback_later(call.limit, exit=True)
        try:
            return Answer(call.function(*call.arguments, **call.keywords))
        finally:
            faulthandler.cancel_dump_traceback_later()
    except BaseException as failure:  # noqa: BLE001 - the caller's to judge
        return Answer(None, failure, "".join(format_exception(failure)))


def _send(stream: BinaryIO, answer: Answer) -> None:
    try:
        content = pickle.dumps(answer, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as failure:  # noqa: BLE001 - it cannot be sent, but that can be told
        what = answer.failure if answer.failure is not None else failure
        told = RuntimeError(f"{type(what).__name__}: {what}")
        content = pickle.dumps(Answer(None, told, answer.traceback), protocol=pickle.HIGHEST_PROTOCOL)
    try:
        write_frame(stream, content)
    except OSError:
        os._exit(0)
