"""Interrupts that wait until nothing is held."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Within it no signal raises in the main thread; one that came is taken at its end.

    The methods of a future, and what waits for some, enter its condition by a function of Python.  An interrupt that is
    raised there leaves the lock taken, and whoever is to set the future's result waits for it without end.
    """
    if threading.current_thread() is not threading.main_thread():  # only that one is told of signals
        yield
        return
    came: list[int] = []
    usual = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            handler = signal.getsignal(number)
            if callable(handler):
                usual[number] = handler
                signal.signal(number, lambda number, _: came.append(number))
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
