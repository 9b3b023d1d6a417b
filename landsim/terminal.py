"""What the command line needs of a terminal: streams that are there, one-line errors, a status line, a progress bar."""

import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

EXIT_FAILURE = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
WIDTH = 100
"""Of tables that are not printed to a terminal."""


def fail(message: str, code: int) -> NoReturn:
    """End the process with a line on stderr."""
    tell(message)
    sys.exit(code)


def tell(message: str) -> None:
    """A line on stderr, if anything can be written there."""
    from landsim.errors import one_line

    try:
        click.echo(f"landsim: {one_line(message)}", err=True)
        sys.stderr.flush()
    except OSError:
        discard(sys.stderr)


def make_printable() -> None:
    """Standard streams that take every character, and that are there."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by who started this process
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


@contextmanager
def terminable() -> Iterator[None]:
    """Within it SIGTERM interrupts like Ctrl-C, so that nothing half-written stays behind; a second one is ignored."""

    def interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise KeyboardInterrupt

    ours = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    if ours:
        signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def printing(done: str = "") -> Iterator[None]:
    """Within it a reader of stdout who has gone is no failure, and nor is a full disk if something is ``done``."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        discard(sys.stdout)
        if isinstance(error, BrokenPipeError):
            return
        reason = f"standard output cannot be written: {error.strerror}"
        if not done:
            fail(reason, EXIT_FAILURE)
        tell(f"{done}; {reason}")


def discard(stream: Any) -> None:
    """Let what is still in the stream's buffer go nowhere, where Python would complain about it at exit."""
    with suppress(OSError, ValueError):  # a stand-in without a file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def console_of(*, stderr: bool = False) -> "Console":
    """Where tables go: as wide as the terminal, or `WIDTH` where there is none."""
    from rich.console import Console

    from landsim.tables import NARROWEST

    console = Console(stderr=stderr, highlight=False)
    console.width = max(console.width, NARROWEST) if console.is_terminal else WIDTH
    return console


def print_tables(made: "Callable[[int], Iterable[RenderableType]]") -> None:
    """Print what is made for the width of the terminal."""
    console = console_of()
    with console.capture() as text:  # rich would end the process where the reader has gone
        for table in made(console.width):
            console.print(table, crop=False)
    sys.stdout.write(text.get())


def shown(path: Path) -> str:
    """The path as it is printed: from the working directory if it is below that, and on one line."""
    from landsim.errors import one_line

    with suppress(OSError, ValueError):  # no working directory any more, or not below it
        path = path.relative_to(Path.cwd())
    return one_line(str(path))


@contextmanager
def status(text: str) -> "Iterator[Callable[[str], None]]":
    """A line that lives while something is done, on a terminal only; what it yields changes its text."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.text import Text

    with console_of(stderr=True).status(Text(text)) as status:
        yield lambda changed: status.update(Text(changed))


@contextmanager
def after(seconds: float, what: Callable[[], None]) -> Iterator[None]:
    """Within it something is done once, if it lasts longer than so many seconds."""
    timer = threading.Timer(seconds, what)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


@contextmanager
def progress_bar(text: str) -> "Iterator[Callable[[float, float, str], None] | None]":
    """A bar that grows with what is done, on a terminal only."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
    with Progress(
        *columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console_of(stderr=True), transient=True
    ) as bar:
        task = bar.add_task(escape(text), total=None)
        yield lambda done, total, what: bar.update(
            task, completed=done, total=total, description=escape(f"{text}: {what}")
        )


PLAIN_EVERY_S = 10.0
"""Between the lines that tell how far flights are where there is no terminal."""


class FlightRate:
    """How fast flights come and how many of them succeed.

    Parameters
    ----------
    total, done : int
        Flights there are to be, and those that have been flown before.
    clock : callable
        Seconds, from any time on.
    """

    def __init__(self, total: int, done: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.total, self.done = total, done
        self.flown = self.succeeded = 0
        self.clock = clock
        self._first = self._last = 0.0

    def add(self, *, success: bool) -> None:
        """Count a flight that has just been finished."""
        self._last = self.clock()
        if not self.flown:
            self._first = self._last
        self.flown += 1
        self.done += 1
        self.succeeded += success

    @property
    def per_second(self) -> float | None:
        """Flights a second since the first was finished, so without the start of those who fly; None before two."""
        taken = self._last - self._first
        return (self.flown - 1) / taken if self.flown > 1 and taken > 0.0 else None

    def text(self) -> str:
        """How fast, for how long still, and how well, in words."""
        rate = self.per_second
        if rate is None:
            return "starting" if not self.flown else f"{self.succeeded} of {self.flown} in the box"
        left = round((self.total - self.done) / rate)
        told = f"{rate:.1f} flights/s, {left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"
        return f"{told}, {100.0 * self.succeeded / self.flown:.1f} % in the box"


@contextmanager
def flight_progress(text: str, rate: FlightRate) -> "Iterator[Callable[[bool], None]]":
    """Shows how far flights are: as a bar on a terminal, else as a line now and then.  What it yields counts one."""
    if not sys.stderr.isatty():
        with _plain_progress(text, rate) as count:
            yield count
        return
    from rich.markup import escape
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[told]}"))
    with Progress(*columns, console=console_of(stderr=True), transient=True) as bar:
        task = bar.add_task(escape(text), total=rate.total, completed=rate.done, told=rate.text())

        def count(success: bool) -> None:
            rate.add(success=success)
            bar.update(task, completed=rate.done, told=rate.text())

        yield count


@contextmanager
def _plain_progress(text: str, rate: FlightRate) -> "Iterator[Callable[[bool], None]]":
    last = rate.clock()

    def count(success: bool) -> None:
        nonlocal last
        rate.add(success=success)
        now = rate.clock()
        if now - last >= PLAIN_EVERY_S:
            last = now
            tell(f"{text}: {rate.done} of {rate.total} flights, {rate.text()}")

    yield count
