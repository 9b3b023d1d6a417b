"""What the command line needs of a terminal: streams that are there, one-line errors, a status line, a progress bar."""

import _thread
import codecs
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
    from rich.text import Text

EXIT_FAILURE = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130
WIDTH = 100
"""Of tables that are not printed to a terminal."""
NARROW = 72
"""Columns of a terminal in which a bar and what is told beside it have no room for each other."""
SAME_REQUEST_S = 1.0
"""A signal that follows another sooner means the same: a group and its leader are both told to end."""
SWALLOWED_AGAIN_S = 0.05
"""After which an interrupt is raised again that was raised where Python drops exceptions."""
IN_ASCII = {
    "±": "+/-", "≤": "<=", "≥": ">=", "…": "...", "–": "-", "—": "-", "−": "-", "°": " deg", "σ": "sigma", "χ": "chi",
    "ρ": "rho", "·": "*", "×": "x", "→": "->", "²": "^2", "³": "^3", "µ": "u", "“": '"', "”": '"', "’": "'",
}  # fmt: skip
"""How characters are spelled where a stream's encoding has them not."""
SPELLED = "landsim-spelled"
"""The error handler of streams that does it."""


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
    """Standard streams that take every character, in ASCII what their encoding has not, and that are there."""
    codecs.register_error(SPELLED, _spelled)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by who started this process
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=SPELLED)


def _spelled(failure: UnicodeError) -> tuple[str, int]:
    """What is written in the place of characters that a stream cannot carry."""
    if not isinstance(failure, UnicodeEncodeError):
        raise failure
    return "".join(IN_ASCII.get(c, "?") for c in failure.object[failure.start : failure.end]), failure.end


@contextmanager
def terminable() -> Iterator[Callable[[], bool]]:
    """Within it SIGTERM interrupts like Ctrl-C, so that nothing half-written stays behind, and neither gets lost.

    Python drops an exception that is raised in a destructor or in the callback of a weak reference, and prints it: such
    an interrupt is raised again.  One that has been dropped elsewhere is raised at the end, so that whatever becomes of
    it, what was interrupted does not end as if it had not been.

    Yields
    ------
    callable
        Whether there was a signal.

    Raises
    ------
    KeyboardInterrupt
        If there was a signal, and what was done inside has come to its end all the same.
    """
    if threading.current_thread() is not threading.main_thread():  # only that one is told of signals
        yield lambda: False
        return
    interrupts = _Interrupts()
    taken = [
        (number, was)
        for number, usual in ((signal.SIGTERM, signal.SIG_DFL), (signal.SIGINT, signal.default_int_handler))
        if (was := signal.getsignal(number)) == usual  # who began this process may have had it ignored
    ]
    tells = sys.unraisablehook
    interrupts.tells = tells
    for number, _ in taken:
        signal.signal(number, interrupts.take)
    sys.unraisablehook = interrupts.dropped
    try:
        yield lambda: interrupts.last is not None
    finally:
        interrupts.over = True
        sys.unraisablehook = tells
        for number, was in taken:
            signal.signal(number, was)
    if interrupts.last is not None:
        raise KeyboardInterrupt


class _Interrupts:
    """What has come of signals."""

    def __init__(self) -> None:
        self.last: float | None = None
        """When a signal was last taken for a request to end."""
        self.again = False
        self.over = False
        self.tells: Callable[[Any], object] = sys.__unraisablehook__

    def take(self, _number: int, _frame: FrameType | None) -> None:
        """A signal: the first interrupts, and so does any that comes later than those that mean the same."""
        now = time.monotonic()
        if not self.again and self.last is not None and now - self.last < SAME_REQUEST_S:
            return
        self.last, self.again = now, False
        raise KeyboardInterrupt

    def dropped(self, what: Any) -> None:
        """An exception that Python drops: if it is the interrupt, it is raised again a little later."""
        if self.last is None or not issubclass(what.exc_type, KeyboardInterrupt):
            self.tells(what)
            return
        later = threading.Timer(SWALLOWED_AGAIN_S, self._raise_again)  # here it would be dropped once more
        later.daemon = True
        later.start()

    def _raise_again(self) -> None:
        if not self.over:
            self.again = True
            _thread.interrupt_main()


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
            fail(reason, EXIT_BAD_INPUT)
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

    stream = sys.stderr if stderr else sys.stdout

    class Spelling(Console):
        def render_str(self, text: str, **how: Any) -> "Text":
            """Of a cell, spelled before it is laid out, so that the columns stay straight."""
            return super().render_str(carried(text, stream), **how)

    console = Spelling(stderr=stderr, highlight=False)
    console.width = max(console.width, NARROWEST) if console.is_terminal else WIDTH
    return console


def carried(text: str, stream: Any) -> str:
    """The text as a stream's encoding carries it: in ASCII what it has not."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        codecs.register_error(SPELLED, _spelled)
        return text.encode(encoding, SPELLED).decode(encoding)
    return text


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
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = console_of(stderr=True)
    percent = TextColumn("{task.percentage:3.0f} %")
    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), percent]
    columns += [TimeElapsedColumn(), TimeRemainingColumn()]
    if console.width < NARROW:
        columns = [percent, TimeElapsedColumn(), TimeRemainingColumn()]
    with Progress(*columns, console=console, transient=True) as bar:
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
        told = f"{rate:.1f} flights/s, {self._left(rate)} left"
        return f"{told}, {100.0 * self.succeeded / self.flown:.1f} % in the box"

    def short(self) -> str:
        """The same where there is room for little: for how long still, and how many of them succeed."""
        rate = self.per_second
        if rate is None:
            return "starting" if not self.flown else f"{self.succeeded} in box"
        return f"{self._left(rate)}, {100.0 * self.succeeded / self.flown:.1f} % in box"

    def _left(self, rate: float) -> str:
        left = round((self.total - self.done) / rate)
        return f"{left // 3600}:{left // 60 % 60:02d}:{left % 60:02d}"


@contextmanager
def flight_progress(text: str, rate: FlightRate) -> "Iterator[Callable[[bool], None]]":
    """Shows how far flights are: as a bar on a terminal, else as a line now and then.  What it yields counts one."""
    if not sys.stderr.isatty():
        with _plain_progress(text, rate) as count:
            yield count
        return
    from rich.markup import escape
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn

    console = console_of(stderr=True)
    columns: list[ProgressColumn] = [MofNCompleteColumn(separator=" of "), TextColumn("{task.fields[told]}")]
    tells = rate.short
    if console.width >= NARROW:
        columns = [TextColumn("{task.description}"), BarColumn(None), MofNCompleteColumn(), columns[-1]]
        tells = rate.text
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(escape(text), total=rate.total, completed=rate.done, told=tells())

        def count(success: bool) -> None:
            rate.add(success=success)
            bar.update(task, completed=rate.done, told=tells())

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
            tell(f"{text}: {rate.done} of {rate.total} flight{'' if rate.total == 1 else 's'}, {rate.text()}")

    yield count
