"""A document as Markdown of GitHub's kind: for a forge or a terminal, with the pictures beside it as its figures.

Whatever comes from a name or a file is escaped here, and what means nothing where it stands is left as it is.
"""

import re
from collections.abc import Iterator, Sequence

from landsim.errors import one_line
from landsim.page.document import Block, Cell, Code, Document, Figure, Table, Text

INLINE = re.compile(
    r"[\\`*\[\]#~$]"
    r"|(?<![^\W_])_|_(?![^\W_])"  # within a word, as in camera.noise_px, it is no emphasis
    r"|<(?=[A-Za-z/!?])"
    r"|&(?=[A-Za-z#])"
)
"""What would begin or end something within a line."""
AT_FIRST = re.compile(r"^(?:(?P<sign>[-+>=])|(?P<number>\d{1,9})(?=[.)]))")
"""What would make a paragraph a list, a quotation or a rule."""
NARROWEST = 3
"""A column of a table, letters: room for the dashes below its head."""


def markdown_of(document: Document, version: str, *, pictures: bool = True) -> str:
    """The page as Markdown.

    Parameters
    ----------
    document : Document
    version : str
        Of landsim, for its foot.
    pictures : bool
        Whether each figure's PNG is in the folder that the text is for; otherwise its caption alone is there.

    Returns
    -------
    str
        Headings, sentences, tables and code as on the page of `landsim.page.render.render`, figures as links to
        ``<name>.png``.  Every text of the document is escaped; a paragraph is a line.
    """
    return "\n\n".join(_parts(document, version, pictures)) + "\n"


def _parts(document: Document, version: str, pictures: bool) -> Iterator[str]:
    """What is divided by empty lines."""
    yield f"# {_inline(document.title)}"
    yield f"*{_inline(document.head)}*"
    yield from _paragraphs([document.subtitle])
    if document.facts:
        yield "\n".join(
            f"- {_first(fact.name)}: **{_inline(fact.value)}**" + (f", {_inline(fact.detail)}" if fact.detail else "")
            for fact in document.facts
        )
    yield "## Contents"
    titles = [section.title for section in document.sections]
    places = _anchors([document.title, "Contents", *titles])[2:]
    yield "\n".join(f"- [{_inline(title)}](#{place})" for title, place in zip(titles, places, strict=True))
    for section, blocks in document.labelled():
        yield f"## {_inline(section.title)}"
        for block, label in blocks:
            yield from _block(block, label, pictures)
    yield "---"
    yield _first(document.foot(version))


def _block(block: Block, label: str, pictures: bool) -> Iterator[str]:
    if isinstance(block, Text):
        texts = _paragraphs(block.paragraphs)
        if not block.points:
            yield from (f"**{text}**" if block.lead else text for text in texts)
        elif texts:
            yield "\n".join(f"- {text}" for text in texts)
    elif isinstance(block, Table):
        yield f"*{_inline(label)}*"
        yield "\n".join(_table(block))
    elif isinstance(block, Figure):
        if pictures:
            yield f"![{_inline(block.chart.title)}]({block.chart.name}.png)"
        yield f"**{_inline(label)}** {_inline(block.chart.caption)}".rstrip()
    else:
        yield f"*{_inline(label)}*"
        yield _code_block(block)


def _anchors(titles: Sequence[str]) -> list[str]:
    """What forges call the places of headings, from first to last: one that is there already has a number behind it."""
    slugs = [re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles]
    return [f"{slug}-{before}" if (before := slugs[:i].count(slug)) else slug for i, slug in enumerate(slugs)]


def _table(table: Table) -> Iterator[str]:
    """Columns as wide as what is in them: numbers stand one below the other in a terminal too."""
    rows = [[_cell(cell) for cell in row] for row in (table.head, *table.rows)]
    widths = [max(NARROWEST, *(len(cell) for cell in column)) for column in zip(*rows, strict=True)]
    numbers = [table.is_number(i) for i in range(len(widths))]
    rule = [f"{'-' * (width - 1)}:" if right else "-" * width for width, right in zip(widths, numbers, strict=True)]
    for row in (rows[0], rule, *rows[1:]):
        set_flush = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numbers, strict=True)
        )
        yield f"| {' | '.join(set_flush)} |"


def _cell(cell: str | Cell) -> str:
    """A bar within it is escaped, in code too: a table takes the line apart before anything else is looked at."""
    if isinstance(cell, str):
        return _inline(cell).replace("|", "\\|")
    if not cell.command:
        return _cell(cell.text)
    command = one_line(cell.text)
    # A backslash before a bar within code has no spelling on which all readers agree.
    return _cell(command) if "\\|" in command else _code_span(command).replace("|", "\\|")


def _code_span(text: str) -> str:
    fence = "`" * (_longest_run(text) + 1)
    room = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{room}{text}{room}{fence}"


def _code_block(block: Code) -> str:
    """Fenced by more backticks than it holds; a label that is a file's name says what language it is."""
    named = re.fullmatch(r"\S+\.(\w+)", block.label)
    fence = "`" * max(3, _longest_run(block.text) + 1)
    return f"{fence}{named[1] if named else ''}\n{block.text.removesuffix(chr(10))}\n{fence}"


def _longest_run(text: str) -> int:
    """Of backticks."""
    return max(map(len, re.findall("`+", text)), default=0)


def _paragraphs(texts: Sequence[str]) -> list[str]:
    """Those that say something, as they begin a line."""
    return [text for text in map(_first, texts) if text]


def _first(text: str) -> str:
    """A text that begins a line."""
    return AT_FIRST.sub(
        lambda found: f"{found['number']}\\" if found["number"] else f"\\{found['sign']}", _inline(text)
    )


def _inline(text: str) -> str:
    """A text within a line, as nothing but text: spaces as a browser has them, and what does not print spelt out."""
    return INLINE.sub(r"\\\g<0>", one_line(" ".join(text.split())))
