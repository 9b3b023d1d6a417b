"""From what is typed to an order, and the files of a budget."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from landsim.budget.requirements import parse_requirement, read_requirements
from landsim.budget.result import Order
from landsim.budget.sweep import DEFAULT_SWEEPS, parse_sweep
from landsim.errors import InputError, is_text
from landsim.units import DEG

JSON_FILE = "budget.json"
FIGURES = ("budget.png", "budget.pdf")
ENDINGS = (".png", ".pdf")


def order_of(
    *,
    required: Sequence[str],
    file: Path | None,
    confidence_percent: float,
    roll_error_deg: float,
    precision_px: float | None,
    swept: Sequence[str],
    drawn: bool,
    shown: bool,
    draws: int,
    seed: int,
) -> Order:
    """An order from the command line's words.

    Parameters
    ----------
    required, swept : sequence of str
        As for `parse_requirement` and `parse_sweep`.
    file : Path or None
        As for `read_requirements`; its requirements come first.
    confidence_percent, roll_error_deg, precision_px, draws, seed
        As in `Order`.
    drawn, shown : bool
        Whether there will be a figure, which without a sweep named is of the usual ones; or the numbers themselves.

    Raises
    ------
    InputError
        If one of the words is none, or a sweep would be seen nowhere.
    """
    if swept and not (drawn or shown):
        raise InputError("a sweep is drawn or printed as JSON: give --plot FILE, --out DIR or --json")
    requirements = [*(read_requirements(file) if file is not None else []), *map(parse_requirement, required)]
    return Order(
        requirements=tuple(requirements),
        confidence_percent=confidence_percent,
        roll_error=roll_error_deg * DEG,
        precision_px=precision_px,
        sweeps=tuple(map(parse_sweep, swept or (DEFAULT_SWEEPS if drawn else ()))),
        draws=draws,
        seed=seed,
    )


def check_figure(path: Path) -> None:
    """Refuse a file that no figure can be written to.

    Raises
    ------
    InputError
    """
    if not is_text(str(path)) or "\0" in str(path):
        raise InputError(f"{path}: the path of a figure must be UTF-8 text")
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: a figure's name must end in {' or '.join(ENDINGS)}")
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        if not path.parent.is_dir():
            raise InputError(f"{path}: cannot be written: {path.parent} is not a folder")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


def to_text(budget: dict[str, Any]) -> str:
    """The text of budget.json."""
    return json.dumps(budget, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
