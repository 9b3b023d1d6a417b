"""Files that are whole or not there, and on the disk once they are: a power cut loses none of them."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

PARTIAL = ".partial"
"""What the names of files end with that are being written; those that a killed process left are worth nothing."""


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file beside a place, which takes the place if all goes well.

    Raises
    ------
    OSError
        If it cannot be written; nothing is left of it then.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        with beside.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        _sync_folder(path.parent)
    finally:
        beside.unlink(missing_ok=True)


def write_json(path: Path, value: Any) -> None:
    """Write JSON; raises as `replacing` does."""
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(path, text + "\n")


def write_text(path: Path, text: str) -> None:
    """Write text; raises as `replacing` does."""
    with replacing(path) as file:
        file.write(text.encode())


def clear_partial(folder: Path) -> None:
    """Remove what a killed process was writing in a folder."""
    for path in folder.glob(f".*{PARTIAL}"):
        path.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """The new name is on the disk as well, where the system knows how."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
