"""What is typed after an option: a name and what it is to be."""

from landsim.errors import InputError, is_text


def taken_apart(kind: str, text: str) -> tuple[str, str, str | None]:
    """``name=rest`` of a kind of thing: what to call it in messages, the name, and the rest, None without a ``=``.

    Raises
    ------
    InputError
        If it is no text.
    """
    what = f'{kind} "{text}"'
    if not is_text(text):
        raise InputError(f"{what}: must be UTF-8 text")
    name, equals, rest = (part.strip() for part in text.partition("="))
    return what, name, rest if equals else None
