"""The page of a batch and that of a comparison: whole, alone, and harmless whatever the names in it are."""

import json
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from flown import good
from pages import Element, page_of, read, section, tree
from reported import BATCHES, COMPARISONS, SCENARIO, comparison, ordinary, summary

from landsim.batch.flights import flights_of
from landsim.batch.summary import summarise
from landsim.config import load_scenario
from landsim.report import write_comparison, write_report

BATCH = [
    "summary", "verdict", "outcomes", "touchdown", "distributions", "tracking", "navigation", "consistency",
    "sensitivity", "worst", "scenario", "versions",
]  # fmt: skip
COMPARISON = ["summary", "outcomes", "settings", "differences", "distributions", "navigation"]


@pytest.fixture(scope="module")
def batch() -> dict[str, Any]:
    return dict(json.loads(json.dumps(summary(BATCHES["ordinary"]))))


@pytest.fixture(scope="module")
def page(batch: dict[str, Any]) -> str:
    return page_of(batch)


@pytest.mark.parametrize("kind", ["batch", "comparison"])
def test_a_page_has_its_sections_in_order_with_something_in_each(kind: str, page: str) -> None:
    root = tree(page if kind == "batch" else page_of(comparison(**COMPARISONS["ordinary"])))
    names = [one.attributes["id"] for one in root.all("section")]
    assert names == (BATCH if kind == "batch" else COMPARISON)
    (contents,) = root.all("nav")
    assert [one.attributes["href"] for one in contents.all("a")] == [f"#{name}" for name in names]
    for one in root.all("section"):
        (title,) = one.all("h2")
        assert one.attributes["aria-labelledby"] == title.attributes["id"]
        assert len(one.text) > len(title.text) + 20
        assert one.all("figure", "table", "p", "pre")
    drawn = {
        "verdict",
        "outcomes",
        "touchdown",
        "distributions",
        "tracking",
        "navigation",
        "consistency",
        "sensitivity",
    }
    with_figure = {one.attributes["id"] for one in root.all("section") if one.all("figure")}
    assert with_figure == (drawn if kind == "batch" else {"outcomes", "differences", "distributions", "navigation"})


@pytest.mark.parametrize("name", [*BATCHES, *(f"comparison, {name}" for name in COMPARISONS)])
def test_a_page_stands_alone_and_is_well_formed(name: str) -> None:
    """Nothing to load, one place a name, headings without a gap, tables with captions, a figure a chart."""
    found = summary(BATCHES[name]) if name in BATCHES else comparison(**COMPARISONS[name.partition(", ")[2]])
    page = page_of(found)
    root = tree(page)
    every = root.all(*set(re.findall(r"<([a-z0-9]+)", page)))
    for one in every:
        for attribute in ("src", "href", "srcset", "data", "action", "poster", "xlink:href"):
            assert one.attributes.get(attribute, "#").startswith(("#", "data:,")), (one.tag, attribute)
        assert not [attribute for attribute in one.attributes if attribute.startswith("on")]
    (policy,) = [m for m in root.all("meta") if m.attributes.get("http-equiv") == "Content-Security-Policy"]
    assert policy.attributes["content"].startswith("default-src 'none';")
    assert "http" not in policy.attributes["content"]
    (style,) = root.all("style")
    assert not re.search(r"@import|url\(|@font-face", style.text)
    names = [one.attributes["id"] for one in every if "id" in one.attributes]
    assert len(names) == len(set(names))
    levels = [int(one.tag[1]) for one in root.all("h1", "h2", "h3", "h4")]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    for table in root.all("table"):
        assert len(table.all("caption")) == 1
        (head,) = table.all("thead")
        assert all(one.attributes["scope"] == "col" for one in head.all("th"))
        (body,) = table.all("tbody")
        for row in body.all("tr"):
            assert row.inside[0].attributes["scope"] == "row"
            assert len(row.inside) == len(head.all("th")), read(table)
    figures = json.loads(next(s for s in root.all("script") if s.attributes.get("id") == "figures").text)
    assert [f"figure-{one['name']}" for one in figures] == [one.attributes["id"] for one in root.all("figure")]
    for one, figure in zip(figures, root.all("figure"), strict=True):
        plots = [p for p in figure.all("div") if p.attributes.get("class") == "plot"]
        assert len(plots) == len(one["panels"])
        assert all(p.attributes["aria-label"] for p in plots)
        assert len(figure.all("figcaption")) == 1


def test_what_it_says_is_made_from_the_numbers(page: str, batch: dict[str, Any]) -> None:
    root = tree(page)
    first = read(section(root, "summary"))
    success = batch["rates"]["success"]
    assert f"{success['count']} of 60 flights landed in the box" in first
    assert f"between {100.0 * success['low']:.4g} % and {100.0 * success['high']:.4g} %" in first
    assert "with 95 % confidence" in first
    outcomes = section(root, "outcomes").all("table")[0]
    rows = {read(row.inside[0]): [read(cell) for cell in row.inside[1:3]] for row in outcomes.all("tr")[1:]}
    assert rows["timeout"] == ["1", "60"]
    assert rows["error"] == ["1", "60"]
    assert rows["landed in the box"] == [str(success["count"]), "60"]
    assert "pioneer" in section(root, "scenario").all("pre")[0].text
    assert {"landsim", "1.2.3"} <= set(read(section(root, "versions")).split())


def test_the_verdict_says_what_the_summary_has(page: str, batch: dict[str, Any]) -> None:
    one = section(tree(page), "verdict")
    found = batch["verdict"]
    assert [read(text) for text in one.all("p", "li")][: len(found["text"])] == [
        read(Element("p", {}, text)) for text in found["text"]
    ]
    beyond, room, ended, levels = one.all("table")  # no go-around, and no monitor whose alarms could be counted
    rows = {read(row.inside[0]): [read(cell) for cell in row.inside[1:]] for row in beyond.all("tr")[1:]}
    assert rows["|lateral touchdown|"][:3] == ["at most 2 m", "1", "58"]
    assert rows["sink rate"][-1] == "1·10⁻⁶"
    assert len(rows) == 7  # of eight: both ends of the longitudinal touchdown have one name
    rows = {read(row.inside[0]): [read(cell) for cell in row.inside[1:]] for row in room.all("tr")[1:]}
    assert rows["|lateral touchdown|"] == ["at most 2 m", "–", "–", "–", "2.5 m", "−0.5 m"]
    assert sum(int(read(row.inside[1])) for row in ended.all("tr")[1:]) == 60
    assert [read(row.inside[0]) for row in levels.all("tr")[1:]] == ["lateral", "vertical"]


def test_go_arounds_and_alarms_have_their_tables() -> None:
    scenario = load_scenario("landing", overrides={"navigation.aiding": "lines", "fault.kind": "wrong"})
    rows = [*BATCHES["gone around"], good(30, fault_at_s=8.0, fault_detected_after_s=0.5)]
    found = summarise(scenario, flights_of(rows), {"scenario": "landing", "seed": 0, "versions": {}})
    tables = section(tree(page_of(found)), "verdict").all("table")
    captions = [read(table.all("caption")[0]) for table in tables]
    assert "Why they went around" in captions[3]
    (reason,) = tables[3].all("tr")[1:]
    assert [read(cell) for cell in reason.inside[:3]] == ["no line has been believed for too long", "5", "31"]
    assert captions[5].endswith("Alarms; found after 0.5 s (median), 0.5 s at most")
    assert [read(row.inside[1]) for row in tables[5].all("tr")[1:]] == ["1", "1", "0"]


def test_the_ten_worst_flights_each_have_the_command_that_flies_them_again(page: str, batch: dict[str, Any]) -> None:
    rows = section(tree(page), "worst").all("tbody")[0].all("tr")
    commands = [row.all("code")[0].text for row in rows]
    worst = [one["index"] for one in batch["worst"]["flights"]]
    assert commands == [f"landsim replay runs/001-landing {index}" for index in worst]
    assert len(rows) == 10
    assert {59, 57} <= set(worst)  # the one that raised and the one in the air
    assert "ValueError: no" in read(rows[worst.index(59)])


@pytest.mark.parametrize(("shard", "part"), [("1/1", False), ("2/3", True), (None, False)])
def test_only_a_shard_is_called_a_part_of_a_batch(shard: str | None, part: bool) -> None:
    found = summary(BATCHES["one flight"])
    found["batch"]["shard"] = shard
    assert ("a part of a batch" in page_of(found)) == part


def test_a_page_of_little_says_why_there_is_nothing() -> None:
    root = tree(page_of(summary(BATCHES["no touchdown"])))
    assert "No flight touched down" in read(section(root, "touchdown"))
    root = tree(page_of(summary(BATCHES["no flight"])))
    assert "nothing is shown" in read(section(root, "summary"))
    assert "There is no flight" in read(section(root, "worst"))
    root = tree(page_of(summary(BATCHES["one flight"])))
    assert "1 of 1 flights" in read(section(root, "summary"))


HOSTILE = (
    '<script>alert("in")</script>',
    "</script><script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "{{ 7 * 7 }}{% raw %}",
    "a & b <!-- c",
    "\u2028\u2029",
)


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_text_and_nothing_else(name: str) -> None:
    """As scenario, reason, draw, version, seed's neighbour and folder: the page has the elements that it would have."""
    rows = [good(i, reason=name, in_box=False, **{"draw." + name: float(i * i % 7)}) for i in range(12)]
    hostile = summary(rows, scenario=name, versions={name: name})
    tame = summary(
        [row | {"reason": "r"} for row in rows], scenario="s", versions={"v": "v"}
    )  # the draw is hostile here too
    root = tree(page_of(hostile, name))
    assert name.split() == root.all("h1")[0].text.rpartition(":")[0].split()
    assert [one.tag for one in root.all("script", "img", "iframe")] == ["script"] * 4
    counted = {tag: len(root.all(tag)) for tag in ("section", "figure", "table", "tr", "td", "p", "style", "button")}
    assert counted == {tag: len(tree(page_of(tame)).all(tag)) for tag in counted}
    figures = next(s for s in root.all("script") if s.attributes.get("id") == "figures")
    assert not re.search(r"[<>&\u2028\u2029]", figures.text)
    json.loads(figures.text)
    other = tree(page_of(comparison(**{name: ordinary(20), "other": ordinary(20, seed=2)})))
    assert [one.tag for one in other.all("script", "img", "iframe")] == ["script"] * 4


def test_a_report_is_written_whole_beside_its_pictures(tmp_path: Path) -> None:
    paths = write_report(tmp_path, SCENARIO, summary([good(i, x_m=270.0 + i) for i in range(5)]))
    assert paths[:2] == [tmp_path / "report.html", tmp_path / "report.md"]
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in paths}
    names = {path.stem for path in paths[2:]}
    assert {"rates", "touchdown", "distributions", "errors-position", "consistency"} <= names
    for name in names:
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / f"{name}.pdf").read_bytes().startswith(b"%PDF")
    text = paths[0].read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert 'name = "pioneer"' in tree(text).all("pre")[0].text
    assert write_report(tmp_path, SCENARIO, summary([good(0)]), plots=False) == paths[:2]


def test_the_same_summary_makes_the_same_page(tmp_path: Path) -> None:
    written = []
    for _ in range(2):
        paths = write_comparison(tmp_path, comparison(**COMPARISONS["ordinary"]), plots=False)
        written.append([path.read_bytes() for path in paths])
    assert written[0] == written[1]
    assert [path.name for path in paths] == ["compare.html", "compare.md"]


def test_what_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "report.html").mkdir()
    (tmp_path / "report.html" / "mine").touch()
    with pytest.raises(IsADirectoryError):
        write_report(tmp_path, SCENARIO, summary([good(0)]))
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html" / "mine").exists()


def test_markdown_that_cannot_be_written_leaves_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "report.md").mkdir()
    (tmp_path / "report.md" / "mine").touch()
    with pytest.raises(IsADirectoryError):
        write_report(tmp_path, SCENARIO, summary([good(0)]), plots=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "report.md"]
    assert (tmp_path / "report.md" / "mine").exists()


def test_nothing_heavy_is_loaded_before_it_is_needed() -> None:
    code = (
        "import sys, landsim.report, landsim.page.render, landsim.page.markdown, landsim.charts.batch;"
        "print(sorted({'plotly', 'matplotlib', 'jinja2', 'pandas', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
