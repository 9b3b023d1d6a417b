"""Charts: what they draw stands in the summary, on axes that can show it, alike by either renderer."""

import json
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest
from flown import failed, good
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from reported import BATCHES, COMPARISONS, comparison, ordinary, summary

from landsim.charts.batch import SECTIONS, batch_charts
from landsim.charts.comparison import comparison_charts
from landsim.charts.extent import extent, names_above
from landsim.charts.landing import FARTHEST
from landsim.charts.model import (
    Axis,
    Band,
    Cells,
    Chart,
    Curve,
    Histogram,
    Limit,
    Note,
    Panel,
    Points,
    Region,
    Series,
)
from landsim.charts.navigation import clipped
from landsim.charts.shared import number, percent, with_unit
from landsim.log import QUANTITIES
from landsim.page.figure import chart_figures, panel_figure
from landsim.plots.chart import chart_figure, draw_chart

ROUNDING = 1e-9


def charts_of(found: dict[str, Any]) -> list[Chart]:
    sections = comparison_charts(found) if "pairs" in found else batch_charts(found)
    return [chart for charts in sections.values() for chart in charts]


@pytest.fixture(scope="module")
def summaries() -> dict[str, dict[str, Any]]:
    """As read back from files: what is drawn is in them."""
    found = {name: summary(rows) for name, rows in BATCHES.items()}
    found |= {f"comparison, {name}": comparison(**batches) for name, batches in COMPARISONS.items()}
    return {name: json.loads(json.dumps(one, allow_nan=False)) for name, one in found.items()}


def numbers_in(value: Any) -> Iterator[float]:
    if isinstance(value, dict):
        for inner in value.values():
            yield from numbers_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from numbers_in(inner)
    elif isinstance(value, int | float):
        yield float(value)


def drawn(panel: Panel) -> Iterator[float]:
    """The numbers that a panel shows, but for the places in a list of names."""
    for series in panel.series:
        if isinstance(series, Cells):
            values = [value for row in series.values for value in row]
        elif isinstance(series, Histogram):
            values = [*series.edges, *series.heights]
        elif isinstance(series, Band):
            values = [*series.x, *series.low, *series.high]
        else:
            bars = (series.x_bar or ()) if isinstance(series, Points) else ()
            values = [*series.x, *(() if panel.y.ticks else series.y), *(end for bar in bars for end in bar)]
        yield from (value for value in values if value is not None)
    for mention in panel.mentions:
        if isinstance(mention, Limit):
            yield mention.at
        elif isinstance(mention, Region):
            yield from (value for value in (*mention.x, *mention.y) if value is not None)


@pytest.mark.parametrize("name", [*BATCHES, *(f"comparison, {name}" for name in COMPARISONS)])
def test_every_number_of_a_chart_stands_in_the_file(summaries: dict[str, dict[str, Any]], name: str) -> None:
    """Or is one of them in another unit: a share in per cent, an error in σ or per degree of freedom, a half width."""
    found = summaries[name]
    stated = np.fromiter(numbers_in(found), float)
    shares = [
        100.0 * count / one["n"] for entry in found["distributions"] for one in entry.get("batches", ())
        if one["n"] for count in one["counts"]
    ]  # fmt: skip
    at_ends = [
        np.interp(-found["envelopes"]["distance_m"][0], -np.array(limit["distance_m"]), limit["value"])
        for limit in found.get("envelopes", {}).get("limits", ())
        if found["envelopes"]["distance_m"]
    ]
    half = [0.5 * found["touchdown"]["runway"]["width_m"]] if "touchdown" in found else []
    scaled = [stated * factor for factor in (1.0, -1.0, 100.0, 1.0 / 9.0, 1.0 / 15.0, 1.959963984540054)]
    known = np.sort(np.concatenate([*scaled, shares, at_ends, half, np.negative(half), [0.0, 1.0, FARTHEST]]))
    count = 0
    for chart in charts_of(found):
        for panel in chart.panels:
            ends = {*extent(panel, "x"), *extent(panel, "y")}  # what is beyond an axis is drawn at its end
            for value in drawn(panel):
                near = known[np.clip(np.searchsorted(known, value) + np.array([-1, 0]), 0, known.size - 1)]
                assert value in ends or np.isclose(near, value, rtol=ROUNDING, atol=1e-12).any(), (chart.name, value)
                count += 1
    assert count or name in {"no flight", "comparison, all raised"}


def test_an_ordinary_batch_has_every_chart(summaries: dict[str, dict[str, Any]]) -> None:
    charts = batch_charts(summaries["ordinary"])
    assert list(charts) == list(SECTIONS)
    assert all(charts.values())
    every = charts_of(summaries["ordinary"])
    assert len({chart.name for chart in every}) == len(every)
    titles = {panel.x.name for panel in charts["distributions"][0].panels}
    for measure in ("sink rate", "lateral touchdown", "longitudinal touchdown", "bank", "ground speed"):
        assert measure in titles
    assert {panel.title for chart in charts["navigation"] for panel in chart.panels} >= {
        f"{quantity}: {source}"
        for quantity in ("along", "cross", "height", "roll", "pitch", "yaw")
        for source in ("vision, a frame alone", "fused with the IMU")
    }


@pytest.mark.parametrize("name", [*BATCHES, *(f"comparison, {name}" for name in COMPARISONS)])
def test_axes_say_their_unit_and_a_logarithmic_one_has_no_zero(summaries: dict[str, dict[str, Any]], name: str) -> None:
    for chart in charts_of(summaries[name]):
        assert chart.title
        assert chart.panels
        for panel in chart.panels:
            for letter, axis in (("x", panel.x), ("y", panel.y)):
                assert axis.ticks or axis.name, chart.name
                low, high = extent(panel, "x" if letter == "x" else "y")
                assert np.isfinite([low, high]).all()
                assert low != high
                if axis.log:
                    assert min(low, high) > 0.0
                    values = [v for series in panel.series for v in along(series, letter) if v is not None]
                    assert all(value > 0.0 for value in values), (chart.name, panel.title)


def along(series: Series, letter: str) -> list[float | None]:
    if isinstance(series, Band):
        return [*series.x] if letter == "x" else [*series.low, *series.high]
    if isinstance(series, Histogram | Cells):
        return []
    bar = () if isinstance(series, Curve) else (series.x_bar if letter == "x" else series.y_bar) or ()
    return [*(series.x if letter == "x" else series.y), *(end for ends in bar for end in ends)]


def test_touchdowns_stand_on_the_runway_in_or_out_of_the_box(summaries: dict[str, dict[str, Any]]) -> None:
    (chart,) = batch_charts(summaries["ordinary"])["touchdown"]
    whole, close = chart.panels
    inside, outside = (next(s for s in whole.series if s.name == name) for name in ("in the box", "not in the box"))
    assert isinstance(inside, Points)
    assert isinstance(outside, Points)
    assert inside.mark != outside.mark
    wide = [row for row in BATCHES["ordinary"] if row["x_m"] is not None and not row["in_box"]]
    assert sorted(x for x in outside.x if x is not None) == sorted(row["x_m"] for row in wide)
    assert len(inside.x) + len(outside.x) == 58  # sixty less one in the air and one that raised
    assert "seed 58" in outside.hover[-1]
    runway, box = (mention for mention in whole.mentions if isinstance(mention, Region))
    assert (runway.x, runway.y) == ((0.0, 2000.0), (-15.0, 15.0))
    assert (box.x, box.y) == ((100.0, 450.0), (-2.0, 2.0))
    ellipses = [series for series in close.series if isinstance(series, Curve)]
    assert [one.name for one in ellipses] == ["50 % ellipse", "95 % ellipse", "99.7 % ellipse"]
    assert len({one.dash for one in ellipses}) == 3
    for one in ellipses:
        assert (one.x[0], one.y[0]) == (one.x[-1], one.y[-1])


def test_margins_are_drawn_as_shares_of_their_limits() -> None:
    """Sink rates 0 to 0.995 of 1 m/s; one flight 4 m beside a box of 2 m, and one 114 m."""
    rows = [good(i, sink_rate_mps=0.005 * i, y_m={7: -4.0}.get(i, 0.0)) for i in range(200)]
    (chart,) = batch_charts(summary(rows))["verdict"]
    (panel,) = chart.panels
    assert len(panel.y.ticks) == 8
    at = {series.name: series for series in panel.series if isinstance(series, Points)}
    assert list(at) == ["median, and from 5 % to 95 % of the flights", "99 % quantile", "worst flight"]
    sink, lateral = panel.y.ticks.index("sink rate > 1 m/s"), panel.y.ticks.index("|lateral touchdown| > 2 m")
    middle, tail, worst = at.values()
    assert middle.x_bar is not None
    assert (middle.x[sink], middle.x_bar[0][sink], middle.x_bar[1][sink]) == pytest.approx((49.75, 4.975, 94.525))
    assert (tail.x[sink], worst.x[sink], worst.x[lateral]) == pytest.approx((98.505, 99.5, 200.0))
    assert any(isinstance(one, Limit) and (one.along, one.at) == ("x", 100.0) for one in panel.mentions)
    rows[8]["y_m"] = -114.0
    (panel,) = batch_charts(summary(rows))["verdict"][0].panels
    *_, near, far = panel.series
    assert isinstance(near, Points)
    assert isinstance(far, Points)
    assert (far.x, far.y, far.mark) == ((FARTHEST,), (lateral,), "triangle")
    assert lateral not in near.y
    assert "worst 114 m" in far.hover[0]
    assert batch_charts(summary([failed(0)]))["verdict"] == ()


def test_the_share_beyond_goes_down_in_steps_and_its_band_on_to_the_limit() -> None:
    """Four flights: 100, 75, 50 and 25 % are at their values or above; none of four leaves up to 60.24 %."""
    rows = [good(i, sink_rate_mps=rate) for i, rate in enumerate((0.2, 0.3, 0.4, 0.5))]
    chart = batch_charts(json.loads(json.dumps(summary(rows))))["distributions"][0]
    panel = next(p for p in chart.panels if p.x.name == "sink rate" and p.y.log)
    band, curve = panel.series
    assert isinstance(band, Band)
    assert isinstance(curve, Curve)
    assert curve.x == pytest.approx((0.2, 0.3, 0.4, 0.5))
    assert curve.y == pytest.approx((100.0, 75.0, 50.0, 25.0))
    assert curve.step == band.step == "before"
    assert band.x[-1] == 1.0
    assert band.high[-1] == pytest.approx(100.0 * (1.0 - 0.025**0.25))
    (limit,) = panel.mentions
    assert isinstance(limit, Limit)
    assert (limit.at, limit.label) == (1.0, "limit 1 m/s")


def test_a_rate_of_none_is_a_pale_bar_without_a_point() -> None:
    """One of ten beyond the lateral limit: the other five limits have an upper end alone."""
    rows = [good(i) for i in range(9)] + [good(9, y_m=2.5, in_box=False)]
    panel = batch_charts(summary(rows))["outcomes"][0].panels[1]
    some, none = panel.series
    assert isinstance(some, Points)
    assert isinstance(none, Points)
    assert (some.x, some.tone, none.tone) == ((10.0,), "vermilion", "grey")
    assert (some.mark, none.mark) == ("dot", "none")
    assert panel.y.ticks[int(some.y[0] or 0)] == "|lateral touchdown| > 2 m"
    assert set(none.x) == {None}
    assert none.x_bar is not None
    assert none.x_bar[1] == pytest.approx([100.0 * (1.0 - 0.025**0.1)] * 5)
    assert panel.x.span is not None
    assert set(none.x_bar[0]) == {panel.x.span[0]}


def test_where_no_limit_was_missed_a_sentence_says_so() -> None:
    (chart,) = batch_charts(summary([good(i) for i in range(10)]))["outcomes"]
    assert [panel.title for panel in chart.panels] == ["how the flights ended"]
    assert "No flight was beyond a limit" in chart.caption
    assert "up to 30.85 %" in chart.caption  # 1 - 0.025^(1/10)


def legend(charts: Sequence[Chart]) -> set[str]:
    return {series.name for chart in charts for panel in chart.panels for series in panel.series if series.legend}


def test_a_percentile_is_in_the_legend_where_there_are_flights_for_it_and_nowhere_else() -> None:
    errors = {f"{source}_error_cross_m": np.full(5, 0.3) for source in ("vision", "fused")}
    for n, there in (
        (1, set()),
        (2, {"50 %"}),
        (19, {"50 %"}),
        (20, {"50 %", "95 %"}),
        (371, {"50 %", "95 %", "99.73 %"}),
    ):
        position = batch_charts(summary([good(i, **errors) for i in range(n)]))["navigation"][0]
        named = {name.partition(",")[0] for name in legend([position]) if name.endswith((", vision", ", fused"))}
        assert named == there
        assert "95 % takes 20" in position.caption
        notes = {note.text for panel in position.panels for note in panel.mentions if isinstance(note, Note)}
        assert notes == (set() if there else {"too few flights: 50 % takes 2"})
    curves = [s for s in position.panels[2].series if isinstance(s, Curve) and s.name.endswith("vision")]
    assert len({(one.dash, one.width) for one in curves}) == 3  # told apart without a colour


def test_what_an_estimator_does_not_give_is_not_in_the_legend() -> None:
    nothing = np.full(5, np.nan)
    rows = [good(i, **{f"sigma_{q}": nothing for q in QUANTITIES}) for i in range(20)]
    assert not [name for name in legend(batch_charts(summary(rows))["navigation"]) if "predicts" in name]
    rows = [good(i, **{f"fused_error_{q}": nothing for q in QUANTITIES}) for i in range(20)]
    charts = batch_charts(summary(rows))["navigation"]
    assert not [name for name in legend(charts) if name.endswith("fused")]
    assert "no fused estimate" in [note.text for note in charts[0].panels[1].mentions if isinstance(note, Note)]


def test_of_one_value_there_is_a_line_and_of_one_touchdown_no_close_view() -> None:
    charts = batch_charts(summary([good(0)]))
    (shown,) = charts["distributions"][0].panels[0].series
    assert isinstance(shown, Points)
    assert (shown.x, shown.y, shown.y_bar) == ((0.5,), (1,), ((0,), (1,)))
    assert len(charts["touchdown"][0].panels) == 1


def test_a_figure_says_of_which_flights_it_is() -> None:
    charts = charts_of(summary([good(i) for i in range(5, 9)]))
    assert {chart.subtitle for chart in charts} == {"landing: 4 flights, seeds 5 to 8"}
    assert {chart.subtitle for chart in charts_of(summary([good(3)], shard="2/3"))} == {
        "landing: 1 flight, seed 3, shard 2/3"
    }
    words = [text.get_text() for text in chart_figure(charts[0]).texts]
    assert "landing: 4 flights, seeds 5 to 8" in words
    sides = {chart.subtitle for chart in charts_of(comparison(**COMPARISONS["ordinary"]))}
    assert sides == {"points = landing: 60 flights, seeds 0 to 59; ends = landing: 60 flights, seeds 0 to 59"}


def test_panels_side_by_side_are_in_line() -> None:
    for chart in charts_of(summary(BATCHES["ordinary"])):
        layouts = [figure["layout"] for figure in chart_figures(chart)]
        assert len({one["margin"]["l"] for one in layouts}) == 1
        for first in range(0, len(layouts), chart.columns):
            row = layouts[first : first + chart.columns]
            assert len({(one["height"], one["margin"]["t"], one["margin"]["b"]) for one in row}) == 1


def test_a_logarithmic_axis_has_no_digits_over_each_other() -> None:
    """Powers of ten alone, or 2 and 5 besides where there are fewer than one and a third of them."""
    for span, dtick in (((0.01, 100.0), 1), ((0.1, 2.1), 1), ((1.0, 10.0), "D2")):
        curve = Curve("", (0.0, 1.0), span)
        axis = panel_figure(Panel(Axis("x"), Axis("y", log=True, span=span), (curve,)))["layout"]["yaxis"]
        assert axis["dtick"] == dtick


def test_envelopes_have_the_paper_s_bounds_and_the_published_limits(summaries: dict[str, dict[str, Any]]) -> None:
    position = batch_charts(summaries["ordinary"])["navigation"][0]
    cross = [panel for panel in position.panels if panel.title.startswith("cross")]
    assert len(cross) == 2
    assert extent(cross[0], "y") == extent(cross[1], "y")
    for panel in cross:
        curves = {series.name: series for series in panel.series if isinstance(series, Curve)}
        assert {"bound of the paper", "Wayfinder", "ICAO CAT I", "ICAO CAT II-IIIA", "ICAO CAT IIIB"} <= set(curves)
        assert curves["ICAO CAT I"].y == pytest.approx((16.0, 16.0))
        # 18.4 m at 860 m and 33 m at 1450 m: at 1000 m, where the batch begins, 21.864 m
        assert curves["Wayfinder"].x == (1000.0, 860.0, 280.0)
        assert curves["Wayfinder"].y == pytest.approx((18.4 + 14.6 * 140.0 / 590.0, 18.4, 11.0))
    assert not [s for s in cross[0].series if "predicts" in s.name]
    assert [s for s in cross[1].series if "predicts" in s.name]


def test_a_line_is_cut_where_the_range_ends() -> None:
    assert clipped((100.0, 0.0), (10.0, 0.0), 80.0, 20.0) == ((80.0, 20.0), (8.0, 2.0))
    assert clipped((100.0, 50.0, 0.0), (1.0, 2.0, 3.0), 200.0, -5.0) == ((100.0, 50.0, 0.0), (1.0, 2.0, 3.0))
    assert clipped((10.0, 0.0), (1.0, 2.0), 200.0, 100.0) == ((), ())


def test_what_is_significant_carries_its_number(summaries: dict[str, dict[str, Any]]) -> None:
    found = summaries["ordinary"]["sensitivity"]
    (chart,) = batch_charts(summaries["ordinary"])["sensitivity"]
    by_value, by_spread = (panel.series[0] for panel in chart.panels)
    for cells, spread in ((by_value, False), (by_spread, True)):
        assert isinstance(cells, Cells)
        pairs = {(pair["input"], pair["result"]): pair["spread"] if spread else pair for pair in found["pairs"]}
        for i, one in enumerate(found["inputs"]):
            for j, result in enumerate(found["results"]):
                pair = pairs[one["key"], result["key"]]
                assert cells.values[i][j] == pair["rho"]
                assert bool(cells.texts[i][j]) is bool(pair["significant"])
    assert isinstance(by_value, Cells)
    row = [one["key"] for one in found["inputs"]].index("wind.cross_mps")
    column = [one["key"] for one in found["results"]].index("y_m")
    assert float(by_value.texts[row][column].replace("−", "-")) > 0.5  # the wind carries them sideways


def test_batches_side_by_side_differ_in_more_than_colour(summaries: dict[str, dict[str, Any]]) -> None:
    charts = comparison_charts(summaries["comparison, three"])
    assert all(charts.values())
    bins = [s for s in charts["distributions"][0].panels[0].series if isinstance(s, Histogram)]
    assert [one.name for one in bins] == ["points", "ends", "far"]
    assert len({(one.tone, one.dash) for one in bins}) == len({one.dash for one in bins}) == 3
    assert sum(bins[0].heights) == pytest.approx(100.0)
    (differences,) = charts["differences"]
    assert all(panel.y.ticks == ("ends", "far") for panel in differences.panels)


def test_names_of_limits_are_in_rows_that_do_not_meet() -> None:
    limits = tuple(Limit("x", at, f"limit {at:g} m") for at in (0.0, 0.1, 0.12, 0.5, 0.52, 1.0))
    panel = Panel(Axis("x", span=(0.0, 1.0)), Axis("y"), (), (*limits, Limit("x", 3.0, "out of sight")))
    names = names_above(panel, 200.0, 5.0)
    assert [name.limit for name in names] == list(limits)
    for level in {name.level for name in names}:
        spans = []
        for name in (name for name in names if name.level == level):
            width = len(name.limit.label) * 5.0 / 200.0
            end = name.at + (0.5 * width if name.align == "center" else 0.0)
            assert end <= 1.0
            spans.append((end - width, end))
        assert all(before[1] <= after[0] for before, after in pairwise(spans))


def test_an_axis_reaches_its_data_limits_and_regions() -> None:
    curve = Curve("", (1.0, 2.0, None), (0.001, 10.0, None))
    panel = Panel(Axis("x"), Axis("y", log=True), (curve,), (Limit("x", 5.0, "far"), Region((-1.0, 2.0), (None, None))))
    low, high = extent(panel, "x")
    assert low < -1.0
    assert high > 5.0
    low, high = extent(panel, "y")
    assert 0.0 < low < 0.001
    assert high > 10.0
    assert extent(Panel(Axis("x"), Axis("y", log=True)), "y")[0] > 0.0
    assert extent(Panel(Axis("x"), Axis("", ticks=("a", "b"))), "y") == (1.5, -0.5)  # a list is read from its top


def test_numbers_are_written_for_people() -> None:
    assert [number(v) for v in (None, 0.0, -1.5, 123456.0, 1e-6)] == ["–", "0", "−1.5", "1.23·10⁵", "1·10⁻⁶"]
    assert [number(v) for v in (1619.0, -1000.0, 99_900.0, -0.0)] == ["1620", "−1000", "99900", "0"]
    assert [with_unit(v, "deg", sign=True) for v in (0.5, -0.5, 0.0, None)] == ["+0.5°", "−0.5°", "0°", "?"]
    assert (with_unit(3.0, "deg"), with_unit(3.0, "m/s"), with_unit(None, "m")) == ("3°", "3 m/s", "–")
    assert (percent(1.0), percent(0.98172), percent(None)) == ("100 %", "98.17 %", "–")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ordinary", "one flight", "no touchdown", "comparison, three"])
def test_on_paper_every_word_is_on_the_sheet_and_none_is_tiny(summaries: dict[str, dict[str, Any]], name: str) -> None:
    for chart in charts_of(summaries[name]):
        figure = chart_figure(chart)
        FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]
        sheet = figure.bbox
        assert figure.get_figwidth() == pytest.approx(17.5 / 2.54)
        assert figure.get_figheight() < 27.0 / 2.54  # a page
        shown = [t for t in figure.findobj(Text) if isinstance(t, Text) and t.get_visible() and t.get_text()]
        for text in shown:
            box = text.get_window_extent()
            if box.width == 0.0 or (text.axes is not None and not text.get_in_layout()):
                continue
            assert float(text.get_fontsize()) >= 6.5
            if text.get_text() in ticks_out_of_sight(figure):
                continue
            inside = box.x0 >= -1.0 and box.y0 >= -1.0 and box.x1 <= sheet.x1 + 1.0 and box.y1 <= sheet.y1 + 1.0
            assert inside, (chart.name, text.get_text())


def ticks_out_of_sight(figure: Any) -> set[str]:
    """Labels of ticks beyond the ends of their axis, which matplotlib keeps and does not draw."""
    found = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            found |= {t.label1.get_text() for t in axis.get_major_ticks() if not low <= t.get_loc() <= high}
    return found


@pytest.mark.slow
def test_the_same_chart_makes_the_same_bytes(summaries: dict[str, dict[str, Any]], tmp_path: Path) -> None:
    (chart,) = batch_charts(summaries["ordinary"])["touchdown"]
    written = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        paths = draw_chart(tmp_path / name, chart)
        assert [path.name for path in paths] == ["touchdown.png", "touchdown.pdf"]
        written.append([path.read_bytes() for path in paths])
    assert written[0] == written[1]
    assert b"CreationDate" not in written[0][1]
    assert [path.name for path in (tmp_path / "one").iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize("name", [*BATCHES, *(f"comparison, {name}" for name in COMPARISONS)])
def test_plotly_takes_every_panel(summaries: dict[str, dict[str, Any]], name: str) -> None:
    """Its own validation refuses a property or a value that it does not know."""
    for chart in charts_of(summaries[name]):
        for panel in chart.panels:
            figure = panel_figure(panel)
            json.dumps(figure, allow_nan=False)
            go.Figure(**figure)


def test_both_renderers_show_the_same_numbers(summaries: dict[str, dict[str, Any]]) -> None:
    chart = batch_charts(summaries["ordinary"])["navigation"][0]
    axes = chart_figure(chart).axes
    for panel, one in zip(chart.panels, axes, strict=True):
        figure = panel_figure(panel)
        assert figure["layout"]["yaxis"]["range"] == pytest.approx(np.log10(one.get_ylim()))
        assert figure["layout"]["xaxis"]["range"] == pytest.approx(one.get_xlim())
        traces = {trace["name"]: trace for trace in figure["data"] if "fill" not in trace}
        for series in panel.series:
            if isinstance(series, Curve):
                lines = [np.asarray(line.get_ydata(), dtype=float) for line in one.lines]
                wanted = np.array([np.nan if v is None else v for v in series.y])
                assert any(np.array_equal(line, wanted, equal_nan=True) for line in lines)
                assert series.name in traces


def test_a_hover_label_has_numbers_units_and_what_else_is_known(summaries: dict[str, dict[str, Any]]) -> None:
    (chart,) = batch_charts(summaries["ordinary"])["touchdown"]
    trace = next(t for t in panel_figure(chart.panels[0])["data"] if t["name"] == "not in the box")
    assert "past the threshold: %{x:.4~g} m" in trace["hovertemplate"]
    assert "seed 58" in trace["customdata"][-1]
    assert "sink rate: " in trace["customdata"][-1]


def test_names_that_look_like_markup_stay_text() -> None:
    rows = {"<b>a</b>": ordinary(20), "<script>": ordinary(20, seed=2)}
    for chart in charts_of(comparison(**rows)):
        for panel in chart.panels:
            text = json.dumps(panel_figure(panel))
            assert "<script" not in text
            assert "<b>a<" not in text
