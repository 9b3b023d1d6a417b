"""Errors that are the user's to mend, each told in one line: where, what is wrong, what would be right."""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from traceback import extract_tb
from typing import Any

OWN_CHECK = "landsim"
"""Type of the errors that the models' own checks raise: their message is complete."""
_LONGEST_VALUE = 60
"""Characters of a refused value that are shown."""


def one_line(text: str) -> str:
    """The text with everything that does not print escaped, so that it stays on one line."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode("ascii") for c in text)


def traceback_of(failure: BaseException) -> str:
    """Where an exception came from, a line a call, the innermost last.

    Files are named without their folders: the same failure reads the same on every machine that flies for a batch.
    """
    calls = [
        f"{Path(call.filename).name}:{call.lineno} in {call.name}: {call.line}"
        for call in extract_tb(failure.__traceback__)
    ]
    return "\n".join([*calls, f"{type(failure).__name__}: {failure}"])


def is_text(value: str) -> bool:
    """Whether a string from the command line or the file system was UTF-8; bytes that are not come as surrogates."""
    return not any("\ud800" <= c <= "\udfff" for c in value)


class InputError(ValueError):
    """Something given by the user cannot be used; ``str()`` of it is one line."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class ScenarioError(InputError):
    """A scenario or an aircraft file cannot be used: file, dotted key, what is wrong and what would be right."""


class RunFolderError(InputError):
    """A run folder cannot be written, or one that should be read is not a run."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that a mistyped one most likely means, or None."""
    names = {k.lower(): k for k in known}
    close = difflib.get_close_matches(name.lower(), list(names), n=1, cutoff=0.5)
    return names[close[0]] if close else None


def did_you_mean(name: str, known: Sequence[str], prefix: str = "") -> str:
    """The end of a message about an unknown name: the nearest right one, or all of them."""
    close = nearest(name, known)
    if close is not None:
        return f"; did you mean {prefix}{close}?"
    return f"; known: {', '.join(known)}" if known else ""


def shown(value: object) -> str:
    """A refused value as it would stand in a TOML file, cut to a readable length."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, Mapping):
        text = "a table"
    elif isinstance(value, tuple):
        text = str(list(value))
    else:
        text = str(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


_BOUNDS = {
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at most"),
}
_TYPES = {
    "bool_type": "true or false",
    "float_type": "a number",
    "int_type": "a whole number",
    "model_type": "a table",
    "string_type": "a string",
    "tuple_type": "an array",
}


def what_is_wrong(error: Mapping[str, Any]) -> str:
    """One entry of pydantic's ``ValidationError.errors()`` in plain words, without its place."""
    kind, context, value = error["type"], error.get("ctx", {}), error["input"]
    if kind == "missing":
        return "is missing"
    if kind == "finite_number":
        return f"must be a finite number, not {shown(value)}"
    if kind in _BOUNDS:
        bound, word = _BOUNDS[kind]
        return f"must be {word} {context[bound]:g}, not {shown(value)}"
    if kind in _TYPES:
        return f"must be {_TYPES[kind]}, not {shown(value)}"
    if kind == "literal_error":
        hint = ""
        if isinstance(value, str):
            close = nearest(value, str(context["expected"]).replace("'", "").replace(" or ", ", ").split(", "))
            hint = f'; did you mean "{close}"?' if close else ""
        return f"must be {str(context['expected']).replace(chr(39), chr(34))}, not {shown(value)}{hint}"
    if kind == "too_short":
        least = context["min_length"]
        return f"must have at least {least} element{'' if least == 1 else 's'}, not {context['actual_length']}"
    if kind == "too_long":  # only arrays of a fixed length have a greatest one
        return f"must have {context['max_length']} elements, not {context['actual_length']}"
    if kind == OWN_CHECK:
        return str(error["msg"])
    return f"{error['msg']}, not {shown(value)}"
