"""Pages of batches and of comparisons, and their HTML taken apart."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any

from landsim.page.batch import batch_document
from landsim.page.comparison import comparison_document
from landsim.page.document import Document
from landsim.page.render import render

TOML = 'kind = "flight"\n\n[aircraft]\nname = "pioneer"\n'
VOID = {"meta", "link", "line", "rect", "circle", "path", "br"}


@dataclass
class Element:
    """An element of the page, with all its text."""

    tag: str
    attributes: dict[str, str]
    text: str = ""
    inside: list["Element"] = field(default_factory=list)

    def all(self, *tags: str) -> list["Element"]:
        return [one for child in self.inside for one in ([child] if child.tag in tags else []) + child.all(*tags)]


class Tree(HTMLParser):
    """The page as a browser takes it; an element that is closed by another one is an error."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open = [Element("", {})]
        self.feed(page)
        self.close()
        assert [one.tag for one in self.open] == [""]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.open[-1].inside.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open[-1].inside.append(Element(tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop().tag == tag

    def handle_data(self, data: str) -> None:
        for element in self.open:
            element.text += data


def document_of(found: Mapping[str, Any], folder: str = "runs/001-landing") -> Document:
    return comparison_document(found) if "pairs" in found else batch_document(found, TOML, folder)


def page_of(found: Mapping[str, Any], folder: str = "runs/001-landing") -> str:
    return render(document_of(found, folder), "1.2.3")


def tree(page: str) -> Element:
    return Tree(page).open[0]


def read(one: Element) -> str:
    return " ".join(one.text.replace("\u00a0", " ").split())


def section(root: Element, name: str) -> Element:
    (found,) = [one for one in root.all("section") if one.attributes["id"] == name]
    return found
