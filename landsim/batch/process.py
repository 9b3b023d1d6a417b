"""A process at the other end of two pipes, and how it ended."""

import os
import pickle
import re
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from typing import IO, Any

from landsim.batch.worker import BEGIN, Answer, read_frame, write_frame
from landsim.threads import THREAD_VARIABLES

GRACE_S = 3.0
"""A process that has not ended itself so long after its limit is killed: one that is stopped cannot."""
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


class Process:
    """A worker and the pipes to it; OSError if it cannot be begun.

    Attributes
    ----------
    pid : int
    """

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
        """Whether it has not ended."""
        return self._popen.poll() is None

    def kill(self) -> None:
        """End it at once."""
        self._popen.kill()

    def close(self) -> None:
        """End it, and wait until it has."""
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
