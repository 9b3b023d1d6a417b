"""The report as Markdown: what the page says, read back by a parser of GitHub's kind of Markdown."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from flown import good
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from markdown_it.token import Token
from pages import Element, document_of, page_of, read, tree
from reported import BATCHES, COMPARISONS, SCENARIO, comparison, summary

from landsim.charts.model import Axis, Chart, Panel
from landsim.page.document import Block, Cell, Code, Document, Fact, Figure, Section, Table, Text
from landsim.page.markdown import markdown_of
from landsim.report import write_comparison, write_report

READER = MarkdownIt("commonmark").enable(["table", "strikethrough"])
INLINE = {
    "text", "text_special", "strong_open", "strong_close", "em_open", "em_close", "code_inline", "link_open",
    "link_close", "image",
}  # fmt: skip
"""All that a report has within its lines."""


@dataclass
class Grid:
    """A table: for each column whether its cells are set flush right, and what is in them."""

    right: list[bool] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


@dataclass
class Read:
    """A text as a forge shows it."""

    headings: list[tuple[str, str]] = field(default_factory=list)
    paragraphs: list[str] = field(default_factory=list)
    points: list[str] = field(default_factory=list)
    tables: list[Grid] = field(default_factory=list)
    codes: list[tuple[str, str]] = field(default_factory=list)
    pictures: list[tuple[str, str]] = field(default_factory=list)
    links: list[tuple[str, str]] = field(default_factory=list)
    spans: list[str] = field(default_factory=list)


def plain(tokens: Iterable[Token]) -> str:
    return "".join(token.content for token in tokens if token.type in {"text", "text_special", "code_inline"})


def reading(text: str) -> Read:
    """A construct that a report does not have is an error."""
    found = Read()
    within: list[str] = []
    for token in READER.parse(text):
        kind = token.type
        if kind == "inline":
            children = token.children or []
            assert {child.type for child in children} <= INLINE, token.content
            found.pictures += [(plain(c.children or []), str(c.attrs["src"])) for c in children if c.type == "image"]
            found.spans += [c.content for c in children if c.type == "code_inline"]
            said = plain(children)
            found.links += [(said, str(c.attrs["href"])) for c in children if c.type == "link_open"]
            if within[-1] in {"th", "td"}:
                found.tables[-1].rows[-1].append(said)
            elif within[-1] in {"h1", "h2"}:
                found.headings.append((within[-1], said))
            elif "li" in within:
                found.points.append(said)
            elif not any(child.type == "image" for child in children):
                found.paragraphs.append(said)
        elif kind == "fence":
            found.codes.append((token.info, token.content))
        elif kind == "hr":
            continue
        elif token.nesting == 1:
            assert token.tag in {"h1", "h2", "p", "ul", "li", "table", "thead", "tbody", "tr", "th", "td"}, kind
            within.append(token.tag)
            if token.tag == "table":
                found.tables.append(Grid())
            elif token.tag == "tr":
                found.tables[-1].rows.append([])
            elif token.tag == "th":
                found.tables[-1].right.append("right" in str(token.attrs.get("style", "")))
        else:
            assert token.nesting == -1, kind
            within.pop()
    return found


CHART = Chart("how-far", "How far", (Panel(Axis("x"), Axis("y")),), caption="A dot is a flight.")
DOCUMENT = Document(
    "batch",
    "storm_2: 2 flights",
    "pioneer; seed 0",
    (Fact("landed", "50 %", "1 % to 99 %"), Fact("touchdown", "291 m")),
    (
        Section("summary", "Summary", (Text(("Half landed.",), lead=True), Text(("One did not.", "So *what*?")))),
        Section(
            "limits",
            "Limits, and room",
            (
                Figure(CHART),
                Table(
                    "Limits",
                    ("limit on", "why", "most"),
                    (("|bank|", "a|b", "14°"), ("wind.cross_mps", "–", "5")),
                    words=frozenset({1}),
                ),
                Text(("first", "2. second", "- third"), points=True),
            ),
        ),
        Section(
            "again",
            "Again",
            (
                Table("Flights", ("rank", "fly it again"), (("1", Cell("landsim replay 'a|b' 1", command=True)),),
                      words=frozenset({1})),
                Code("scenario.toml", 'kind = "flight"\n'),
                Code("a flight again", "```landsim"),
            ),
        ),
    ),
)  # fmt: skip
EXPECTED = r"""# storm_2: 2 flights

*landsim batch report*

pioneer; seed 0

- landed: **50 %**, 1 % to 99 %
- touchdown: **291 m**

## Contents

- [Summary](#summary)
- [Limits, and room](#limits-and-room)
- [Again](#again)

## Summary

**Half landed.**

One did not.

So \*what\*?

## Limits, and room

![How far](how-far.png)

**Figure 1. How far.** A dot is a flight.

*Table 1. Limits*

| limit on       | why  | most |
| -------------- | ---- | ---: |
| \|bank\|       | a\|b |  14° |
| wind.cross_mps | –    |    5 |

- first
- 2\. second
- \- third

## Again

*Table 2. Flights*

| rank | fly it again              |
| ---- | ------------------------- |
| 1    | `landsim replay 'a\|b' 1` |

*scenario.toml*

```toml
kind = "flight"
```

*a flight again*

````
```landsim
````

---

Made by landsim 1.2.3. The numbers behind every figure are in summary.json, in the same folder.
"""


def test_a_document_as_one_would_write_it_by_hand() -> None:
    assert markdown_of(DOCUMENT, "1.2.3") == EXPECTED


def test_without_pictures_their_captions_are_there_alone() -> None:
    assert markdown_of(DOCUMENT, "1.2.3", pictures=False) == EXPECTED.replace("![How far](how-far.png)\n\n", "")


def captioned(one: Element, kind: str) -> list[str]:
    return [read(found) for found in one.all(kind)]


def grid(table: Element) -> Grid:
    """A table of the page; a command without its button."""
    head = table.all("thead")[0].all("th")
    right = [one.attributes.get("class") == "number" for one in head]
    rows = [[read(cell.all("code")[0] if cell.all("code") else cell) for cell in row.inside] for row in table.all("tr")]
    return Grid(right, rows)


@pytest.mark.parametrize("name", [*BATCHES, *(f"comparison, {name}" for name in COMPARISONS)])
def test_it_says_what_the_page_says(name: str) -> None:
    """Headings, contents, sentences, points, captions, every cell with its side, code; and a picture a figure."""
    found = summary(BATCHES[name]) if name in BATCHES else comparison(**COMPARISONS[name.partition(", ")[2]])
    page, text = tree(page_of(found)), reading(markdown_of(document_of(found), "1.2.3"))
    titles = [(one.tag, read(one)) for one in page.all("h1", "h2")]
    assert text.headings == titles
    assert [said for said, _ in text.links] == [title for _, title in titles[2:]]
    (main,) = page.all("main")
    assert text.tables == [grid(table) for table in main.all("table")]
    facts = [f"{read(one.all('dt')[0])}: {', '.join(captioned(one, 'span'))}" for one in page.all("dl")[0].all("div")]
    points = [read(one) for listing in main.all("ul") if "class" not in listing.attributes for one in listing.all("li")]
    assert text.points == [*facts, *(title for _, title in titles[2:]), *points]
    labels = [read(one.all("span")[0]) for one in main.all("div") if one.attributes.get("class") == "code"]
    assert [(label, code) for label, (_, code) in zip(labels, text.codes, strict=True)] == [
        (label, one.text.removesuffix("\n") + "\n") for label, one in zip(labels, main.all("pre"), strict=True)
    ]
    (kind, under), (foot,) = page.all("header")[0].all("p"), page.all("footer")
    sentences = [
        read(one)
        for part in main.all("section")
        for one in part.all("p")
        if one.attributes.get("class") in {None, "lead"} and not one.all("span", "button")
    ]
    captions = [*captioned(main, "caption"), *captioned(main, "figcaption")]
    assert sorted(text.paragraphs) == sorted(
        [read(kind), read(under), *sentences, *captions, *labels, read(foot)],
    )
    figures = [one.attributes["id"].removeprefix("figure-") for one in main.all("figure")]
    assert [source for _, source in text.pictures] == [f"{figure}.png" for figure in figures]
    bold = [read(one) for caption in main.all("figcaption") for one in caption.all("b")]
    assert [f"Figure {i}. {title}." for i, (title, _) in enumerate(text.pictures, 1)] == bold


@pytest.mark.parametrize("kind", ["batch", "comparison"])
def test_every_picture_that_it_shows_is_beside_it(kind: str, tmp_path: Path) -> None:
    if kind == "batch":
        _, path, *figures = write_report(tmp_path, SCENARIO, summary([good(0)]))
    else:
        _, path, *figures = write_comparison(tmp_path, comparison(**COMPARISONS["all raised"]))
    text = path.read_text(encoding="utf-8")
    shown = [source for _, source in reading(text).pictures]
    assert shown
    assert all((tmp_path / source).read_bytes().startswith(b"\x89PNG") for source in shown)
    assert sorted(shown) == sorted(one.name for one in figures if one.suffix == ".png")
    assert path.stat().st_size < 100_000


def test_contents_lead_to_headings_as_forges_name_them() -> None:
    """The second and third of these are those of GitHub's own account of it."""
    titles = ["Navigation errors by range", "This heading is not unique in the file"]
    titles += [titles[-1], titles[-1], "Limits, (and) room: 95 %"]
    sections = tuple(Section(f"s{i}", title, ()) for i, title in enumerate(titles))
    (*places,) = (place for _, place in reading(markdown_of(document(sections=sections), "1")).links)
    assert places == [
        "#navigation-errors-by-range",
        "#this-heading-is-not-unique-in-the-file",
        "#this-heading-is-not-unique-in-the-file-1",
        "#this-heading-is-not-unique-in-the-file-2",
        "#limits-and-room-95-",
    ]


def document(title: str = "t", sections: tuple[Section, ...] = (), facts: tuple[Fact, ...] = ()) -> Document:
    return Document("comparison", title, "", facts, sections)


def blocks(text: str) -> tuple[Block, ...]:
    rows = ((text, "x", text, Cell(text, command=True)), ("x", text, text, "x"))
    return (
        Text((text, "between")),
        Text((text,), lead=True),
        Text((text, text), points=True),
        Table(text, (text, "a", text, "b"), rows, words=frozenset({3})),
        Figure(Chart("name", text, (), caption=text)),
        Code(text, text),
    )


MARKS = st.text(st.sampled_from("|`*_[]()<>!#&~$\\+-=.:;1a \t\n\r\u2028\u00a0σ\"'/"), min_size=1, max_size=12)
WORDS = st.one_of(MARKS, st.text(min_size=1, max_size=8)).filter(lambda text: bool(text.split()))


def spelt(text: str) -> str:
    """As one reads it: spaces as in a browser, and what does not print by its code."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))


@given(text=WORDS)
@example("a|b")
@example("\\|")
@example("``|`")
@example("<script>alert(1)</script>")
@example("<!-- c")
@example("&amp; &#124;")
@example("| --- |")
@example("1. a")
@example("1) a")
@example("# a #")
@example("---")
@example("===")
@example("~~~")
@example("* * *")
@example("_a_ b_c __d__")
@example("![a](b.png) [c](d)")
@example("    a")
def test_any_text_is_text_and_nothing_else(text: str) -> None:
    """Everywhere: nothing of it is taken for a construct, and every sign of it is there."""
    said = spelt(text)
    found = reading(markdown_of(document(text, (Section("s", text, blocks(text)),), (Fact(text, text, text),)), "1"))
    assert found.headings == [("h1", said), ("h2", "Contents"), ("h2", said)]
    assert [link for link, _ in found.links] == [said]
    assert found.points == [f"{said}: {said}, {said}", said, said, said]
    label, figure = f"Table 1. {text}", f"Figure 1. {text}. {text}"
    assert found.paragraphs[1:-1] == [said, "between", said, spelt(label), spelt(figure), said]
    assert found.pictures == [(said, "name.png")]
    assert [found.tables[0].rows[0], found.tables[0].rows[2]] == [[said, "a", said, "b"], ["x", said, said, "x"]]
    assert found.tables[0].rows[1][:3] == [said, "x", said]
    assert found.tables[0].right == [False, True, True, False]


@given(text=MARKS)
@example("a|b")
@example("`a| b`")
@example("\\")
@example("a\\|b")
def test_a_command_and_a_text_to_copy_stand_as_they_are(text: str) -> None:
    code = text.replace("\r", "\n").replace("\u2028", "\n") + "a"
    found = reading(markdown_of(document(sections=(Section("s", "s", blocks(code)),)), "1"))
    assert [content for _, content in found.codes] == [f"{code}\n"]
    command = found.tables[0].rows[1][3]
    assert command.split() == "".join(c if c.isprintable() else ascii(c)[1:-1] for c in code).split()
    assert found.spans == ([] if "\\|" in code else [command])


def test_the_names_of_a_batch_are_text_and_nothing_else() -> None:
    name = "</h1><script>|`*_x_*`|\n# a"
    rows = [good(i, reason=name, in_box=False, **{"draw." + name: float(i * i % 7)}) for i in range(12)]
    found: dict[str, Any] = summary(rows, scenario=name, versions={name: name})
    text = markdown_of(document_of(found, f"'{name}'"), "1.2.3")
    assert reading(text).headings[0][1] == f"{' '.join(name.split())}: 12 flights"
    assert [grid(table) for table in tree(page_of(found, f"'{name}'")).all("table")][-1] == reading(text).tables[-1]
