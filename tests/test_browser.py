"""The pages in a real browser: drawn, without an error and without a request; read by section, hovered over, printed.

They need Chromium, which pip cannot bring; without it they fail, since a page that was not opened is not tested.
"""

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright
from reported import BATCHES, COMPARISONS, SCENARIO, comparison, summary

from landsim.report import write_comparison, write_report

pytestmark = pytest.mark.browser

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
INSIDE = ("file:", "data:", "blob:")
DRAWN = 60_000
"""Within which a page is to be drawn, ms; so long that only a page that never is takes it."""
DESK, TELEPHONE = (1280, 900), (390, 844)
PAGES = ("report.html", "compare.html", "one.html", "none.html")


@dataclass
class Opened:
    """A page, and what it said and asked for since it was opened."""

    page: Page
    path: Path
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.fail(f"no Chromium: none of {', '.join(NAMES)} is on the path (Debian: apt-get install chromium)")
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=[*QUIET])
        yield started
        started.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An ordinary report and comparison, and reports of one flight and of none that came down."""
    folder = tmp_path_factory.mktemp("pages")
    for name, batch in (("one.html", "one flight"), ("none.html", "no touchdown"), ("report.html", "ordinary")):
        path, _ = write_report(folder, SCENARIO, summary(BATCHES[batch]), plots=False)
        path.replace(folder / name)
    write_comparison(folder, comparison(**COMPARISONS["ordinary"]), plots=False)
    return folder


@pytest.fixture(scope="module")
def opened(browser: Browser, folder: Path, request: pytest.FixtureRequest) -> Iterator[Opened]:
    name, (width, height) = getattr(request, "param", ("report.html", DESK))
    context = browser.new_context(viewport={"width": width, "height": height}, reduced_motion="reduce")
    page = context.new_page()
    one = Opened(page, folder / name)
    page.on("console", lambda message: one.said.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: one.said.append(f"error: {error}"))
    page.on("requestfailed", lambda asked: one.said.append(f"failed: {asked.url[:100]}"))
    page.on("request", lambda asked: one.asked.append(asked.url[:100]))
    page.goto(one.path.as_uri())
    page.wait_for_selector("body.ready", timeout=DRAWN)
    yield one
    context.close()


def pages(*sizes: tuple[int, int]) -> pytest.MarkDecorator:
    """For each page on a desk, and the largest on other screens."""
    cases = [(name, size) for name in PAGES for size in sizes if size == DESK or name == PAGES[0]]
    return pytest.mark.parametrize("opened", cases, indirect=True, ids=[f"{name}-{size[0]}" for name, size in cases])


@pages(DESK, TELEPHONE)
def test_a_page_is_drawn_in_silence_and_asks_for_nothing(opened: Opened) -> None:
    page = opened.page
    assert page.evaluate("typeof Plotly.newPlot") == "function"
    plots = page.locator(".plot").count()
    assert plots == page.locator(".plot.drawn svg.main-svg").evaluate_all(
        "all => new Set(all.map(s => s.closest('.plot'))).size"
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= page.evaluate("window.innerWidth")
    page.mouse.wheel(0, 20_000)
    assert opened.said == []
    assert opened.asked[0] == opened.path.as_uri()
    assert [url for url in opened.asked if not url.startswith(INSIDE)] == []


@pages(DESK)
def test_the_contents_lead_to_sections_that_hold_something(opened: Opened) -> None:
    page = opened.page
    links = page.locator("nav a")
    assert links.count() >= 6
    for link in links.all():
        target = (link.get_attribute("href") or "")[1:]
        link.click()
        assert page.evaluate("location.hash") == f"#{target}"
        section = page.locator(f"section#{target}")
        section.scroll_into_view_if_needed()
        assert section.locator("h2").inner_text()
        assert len(section.inner_text()) > 60
        for table in section.locator("table").all():
            assert table.locator("caption").inner_text()
            assert table.locator("tbody tr").count() > 0
        for plot in section.locator(".plot").all():
            box = plot.bounding_box()
            assert box is not None
            assert box["width"] > 150
            assert box["height"] > 60
            marks = "path.point, .scatterlayer .js-line, .js-fill, .heatmaplayer image, .bars .point, .shapelayer path"
            assert plot.locator(marks).count() > 0, (target, plot.get_attribute("aria-label"))
    assert opened.said == []


def test_a_report_has_the_figures_that_it_is_for(opened: Opened) -> None:
    page = opened.page
    in_box, ellipses = page.locator("#touchdown .plot").nth(0), page.locator("#touchdown .plot").nth(1)
    assert in_box.locator("path.point").count() == 58  # sixty less one in the air and one that raised
    assert ellipses.locator(".js-line").count() == 3
    assert page.locator("#worst tbody tr").count() == 10
    for section, least in (("outcomes", 2), ("distributions", 16), ("tracking", 3), ("navigation", 14),
                           ("consistency", 2), ("sensitivity", 2)):  # fmt: skip
        assert page.locator(f"section#{section} .plot.drawn").count() >= least


def test_hovering_reads_a_value_off_with_its_unit(opened: Opened) -> None:
    page = opened.page
    plot = page.locator("section#touchdown .plot").nth(1)
    plot.scroll_into_view_if_needed()
    point = plot.locator("path.point").first
    box = point.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"], steps=5)
    label = plot.locator(".hoverlayer .hovertext")
    label.first.wait_for(timeout=DRAWN)
    text = label.first.text_content() or ""
    rows = [row for row in BATCHES["ordinary"] if row["x_m"] is not None]
    (seed,) = re.findall(r"seed (\d+)", text)
    (flight,) = [row for row in rows if row["seed"] == int(seed)]
    assert f"past the threshold: {flight['x_m']:.4g} m" in text
    assert re.search(rf"right of the centreline: {flight['y_m']:.4g} m".replace("-", "[−-]"), text)
    assert f"sink rate: {flight['sink_rate_mps']:.3g} m/s" in text
    assert opened.said == []


def test_no_button_of_a_figure_leads_out_of_the_page(opened: Opened) -> None:
    """Plotly has one that sends the numbers to a server."""
    buttons = opened.page.locator(".modebar-btn")
    titles = set(buttons.evaluate_all("all => all.map(b => b.dataset.title)"))
    assert titles == {"Download plot as a PNG", "Zoom", "Pan", "Reset axes"}
    assert opened.page.locator(".plot a").count() == 0


def test_a_command_is_copied(opened: Opened) -> None:
    page = opened.page
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    row = page.locator("#worst tbody tr").first
    row.locator("button").click()
    row.get_by_text("copied").wait_for(timeout=DRAWN)
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied == row.locator("code").inner_text()
    assert re.fullmatch(r"landsim replay \S+ \d+", copied)


@pages(DESK)
def test_it_prints_and_is_as_it_was_afterwards(opened: Opened, tmp_path: Path) -> None:
    page = opened.page
    sections = page.locator("main > section").count()
    widths = (
        "[...document.querySelectorAll('.plot')].map(p => p.querySelector('.main-svg').getBoundingClientRect().width)"
    )
    before = page.evaluate(widths)
    paper = tmp_path / "paper.pdf"
    page.pdf(path=paper, prefer_css_page_size=True, print_background=True)
    data = paper.read_bytes()
    assert data.startswith(b"%PDF")
    sheets = [int(n) for n in re.findall(rb"/Type\s*/Pages\s.*?/Count\s+(\d+)|/Count\s+(\d+)", data) for n in n if n]
    assert max(sheets) >= sections // 3
    boxes = {tuple(round(float(v)) for v in box.split()) for box in re.findall(rb"/MediaBox\s*\[([^\]]*)\]", data)}
    assert boxes == {(0, 0, 595, 842)}  # A4, points
    page.wait_for_timeout(200)
    assert page.evaluate(widths) == pytest.approx(before, abs=2.0)
    assert opened.said == []


def test_a_page_that_is_printed_before_it_is_drawn_has_all_its_figures(browser: Browser, folder: Path) -> None:
    context = browser.new_context(viewport={"width": DESK[0], "height": DESK[1]})
    page = context.new_page()
    # the page draws a panel at a time and waits in between: here for ever
    page.add_init_script("window.setTimeout = () => 0")
    page.goto((folder / "report.html").as_uri())
    waiting = page.locator(".plot:not(:has(svg.main-svg))").count()
    assert waiting > 20
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.locator(".plot:not(:has(svg.main-svg))").count() == 0
    assert page.locator("#sensitivity .heatmaplayer image").count() == 2
    context.close()


def test_the_buttons_of_a_figure_cover_none_of_it(opened: Opened) -> None:
    plot = opened.page.locator("section#distributions .plot").nth(1)
    plot.scroll_into_view_if_needed()
    plot.hover()
    buttons, figure = plot.locator(".modebar").bounding_box(), plot.bounding_box()
    assert buttons is not None
    assert figure is not None
    assert buttons["y"] + buttons["height"] <= figure["y"] + 2.0


def test_zooming_into_a_logarithmic_axis_keeps_its_digits_apart(opened: Opened) -> None:
    page = opened.page
    ticks = """async (range) => {
        const place = document.querySelectorAll("#navigation .plot")[0];
        await Plotly.relayout(place, { "yaxis.range": range });
        await new Promise((done) => setTimeout(done, 100));
        return place.layout.yaxis.dtick;
    }"""
    assert [page.evaluate(ticks, [low, 1.0]) for low in (-2.0, 0.5, -2.0)] == [1, "D2", 1]


def test_a_wide_table_scrolls_within_itself(browser: Browser, folder: Path) -> None:
    page = browser.new_page(viewport={"width": 500, "height": 900})
    page.goto((folder / "report.html").as_uri())
    for table in page.locator("main table").all():
        box = table.locator("xpath=..")
        assert box.evaluate("box => getComputedStyle(box).overflowX") == "auto"
        assert box.evaluate("box => box.getBoundingClientRect().right") <= 500.0
    page.close()


def test_on_paper_no_figure_is_wider_than_the_sheet(opened: Opened) -> None:
    page = opened.page
    page.set_viewport_size({"width": 688, "height": 1000})  # A4 less its margins, CSS pixels
    page.emulate_media(media="print")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    rights = page.locator(".plot .main-svg").evaluate_all("all => all.map(s => s.getBoundingClientRect().right)")
    assert max(rights) <= 688.0
    assert page.locator("nav").evaluate("nav => getComputedStyle(nav).position") == "static"
    assert not page.locator("button.copy").first.is_visible()
