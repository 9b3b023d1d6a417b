"""The figures of a study: what they show is the numbers, at a size that prints, in the same bytes every time."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from approach import paper
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text
from numpy.typing import NDArray

from landsim.plots.envelope import draw_envelopes, envelope_figure
from landsim.plots.tilt import draw_tilt, tilt_figure
from landsim.study.model import OF_STAGE, READINGS, SOURCES, Envelope, Reading, Source, StageName

Array = NDArray[np.float64]
DEGREE = math.pi / 180.0
CM = 1.0 / 2.54
BOUNDS: dict[StageName, dict[str, float]] = {
    "early": {"roll": 0.8 * DEGREE, "pitch": 0.1 * DEGREE, "yaw": 0.1 * DEGREE, "cross": 0.5, "altitude": 0.5},
    "late": {"pitch": 0.1 * DEGREE, "yaw": 0.1 * DEGREE, "cross": 0.2, "altitude": 0.2},
}


def envelope(
    stage: StageName, reading: Reading = "edge-points", source: Source = "vision", roll: float = 0.0
) -> Envelope:
    """Errors in proportion to the distance, or to what is left of the height."""
    distance = np.linspace(1000.0, 40.0, 97) if stage == "early" else np.linspace(37.0, -106.0, 40)
    shape = distance / 1000.0 if stage == "early" else 0.02 + 0.0002 * (37.0 - distance)
    k = len(OF_STAGE[stage])
    size = np.outer(shape, np.arange(1.0, k + 1.0)) * (0.03 if source == "vision" else 0.003) + abs(roll)
    return Envelope(
        stage, reading, source, roll, OF_STAGE[stage], distance, (1000.0 - distance) / 40.0, 60.0 * shape,
        np.full(distance.size, 1000 if source == "vision" else 100),
        size[..., None] * np.array([1.0, 2.0, 3.0]), size, size * np.sin(np.arange(distance.size))[:, None],
    )  # fmt: skip


def everything(stage: StageName) -> list[Envelope]:
    found = [envelope(stage, reading, source) for reading in READINGS for source in ("vision", "fused")]
    if stage == "late":
        found += [envelope(stage, reading, "vision", 0.2 * DEGREE) for reading in READINGS]
    return found


def panels(figure: Figure) -> list[Axes]:
    """Without the axes above them."""
    return [axes for axes in figure.axes if axes.xaxis.get_label_position() == "bottom"]


def panel(figure: Figure, name: str, column: int = 0) -> Axes:
    every = panels(figure)
    rows = len(every) // 2
    labels = [axes.get_ylabel().split(" ")[0] for axes in every[:rows]]
    return every[labels.index(f"|{name}") + column * rows]


def line(axes: Axes, label: str) -> tuple[Array, Array]:
    (found,) = [one for one in axes.lines if str(one.get_label()) == label]
    return np.asarray(found.get_xdata(), dtype=float), np.asarray(found.get_ydata(), dtype=float)


def texts(figure: Figure) -> list[Text]:
    return [one for one in figure.findobj(Text) if isinstance(one, Text) and one.get_text() and one.get_visible()]


@pytest.mark.parametrize("stage", ["early", "late"])
def test_a_panel_a_quantity_and_reading_with_letters_of_seven_points_at_a_page_s_width(stage: StageName) -> None:
    figure = envelope_figure(stage, everything(stage), BOUNDS[stage], "fig, seed 3")
    assert figure.get_figwidth() == pytest.approx(17.5 * CM)
    assert len(panels(figure)) == 2 * len(OF_STAGE[stage])
    assert all(float(text.get_fontsize()) >= 7.0 for text in texts(figure))
    assert figure.texts[0].get_text() == f"fig, seed 3: errors of the camera's pose, {stage} stage"
    labels = [axes.get_ylabel() for axes in panels(figure) if axes.get_ylabel()]
    units = {"roll": "°", "pitch": "°", "yaw": "°", "cross": "m", "altitude": "m", "along": "m"}
    assert labels == [f"|{name} error|, {units[name]}" for name in OF_STAGE[stage]]
    one = envelope_figure(stage, [envelope(stage)], BOUNDS[stage], "fig, seed 3")
    assert one.get_figwidth() == pytest.approx(8.5 * CM)
    assert len(panels(one)) == len(OF_STAGE[stage])
    assert all(float(text.get_fontsize()) >= 7.0 for text in texts(one))


CASES = {
    "early": lambda: envelope_figure("early", everything("early"), BOUNDS["early"], "paper-fig3, seed 0"),
    "late": lambda: envelope_figure("late", everything("late"), BOUNDS["late"], "paper-fig4, seed 0"),
    "a column": lambda: envelope_figure("early", everything("early")[2:], BOUNDS["early"], "paper-fig3, seed 0"),
    "many rolls": lambda: envelope_figure(
        "late",
        [envelope("late", roll=i * 0.1 * DEGREE) for i in range(4)] + everything("late"),
        BOUNDS["late"],
        "paper-fig4, seed 0",
    ),
    "tilt": lambda: tilt_figure(tilted(), paper(), "paper-fig3, seed 0"),
}


@pytest.mark.parametrize("case", CASES)
def test_no_text_is_cut_off_or_hidden(case: str) -> None:
    figure = CASES[case]()
    figure.draw_without_rendering()
    page, heading = figure.bbox, figure.texts[0].get_window_extent()
    legends = [legend.get_window_extent() for legend in figure.legends]
    around = [axes.get_tightbbox() for axes in figure.axes]  # with ticks, labels and titles
    assert legends
    for box in (heading, *legends, *around):
        assert box is not None
        assert page.x0 <= box.x0 < box.x1 <= page.x1
        assert page.y0 <= box.y0 < box.y1 <= page.y1
    for legend in legends:
        assert not legend.overlaps(heading)
        assert not any(legend.overlaps(box) for box in around if box is not None)


def test_curves_are_magnitudes_in_degrees_and_metres() -> None:
    given = everything("early")
    figure = envelope_figure("early", given, BOUNDS["early"], "fig")
    vision, fused = given[2], given[3]  # edge-points
    for name, unit in (("yaw", DEGREE), ("altitude", 1.0)):
        k, axes = OF_STAGE["early"].index(name), panel(figure, name, 1)
        x, y = line(axes, "vision, one realisation")
        np.testing.assert_array_equal(x, vision.distance)
        np.testing.assert_allclose(y, np.abs(vision.single[:, k]) / unit)
        np.testing.assert_allclose(line(axes, "Cramér–Rao bound, 1.96 σ")[1], 1.96 * vision.sigma[:, k] / unit, 1e-4)
        np.testing.assert_allclose(line(axes, "fused, 95 % of n = 100")[1], fused.percentiles[:, k, 1] / unit)
        np.testing.assert_allclose(line(axes, "fused, 1.96 σ of the filter")[1], 1.96 * fused.sigma[:, k] / unit, 1e-4)
        np.testing.assert_allclose(line(axes, "fused, one flight")[1], np.abs(fused.single[:, k]) / unit)
        bands = {str(c.get_label()): c for c in axes.collections if isinstance(c, PolyCollection)}
        assert list(bands) == [f"vision, {level} % of n = 1000" for level in ("68.3", "95", "99.7")]
        for i, band in enumerate(bands.values()):
            vertices = np.asarray(band.get_paths()[0].vertices)
            assert vertices[:, 1].max() == pytest.approx(vision.percentiles[:, k, i].max() / unit)
    assert line(panel(figure, "roll"), "claimed bound")[1][0] == pytest.approx(0.8)
    assert not [one for one in panel(figure, "along").lines if one.get_label() == "claimed bound"]  # none is claimed


def test_a_percentile_of_too_few_is_not_drawn() -> None:
    vision, fused = (replace(envelope("early", source=source), count=np.full(97, 19)) for source in SOURCES)
    axes = panel(envelope_figure("early", [vision, fused], BOUNDS["early"], "fig"), "yaw", 0)
    bands = [str(c.get_label()) for c in axes.collections if isinstance(c, PolyCollection)]
    assert bands == ["vision, 68.3 % of n = 19"]
    assert not [one for one in axes.lines if str(one.get_label()).startswith("fused, 95 %")]


def test_distance_falls_to_the_right_with_the_time_above_it() -> None:
    figure = envelope_figure("early", everything("early"), {}, "fig")
    assert panel(figure, "along").get_xlim() == (1000.0, 40.0)
    (top, _) = [axes for axes in figure.axes if axes.get_xlabel() == "time, s"]
    assert top.get_xlim() == (1000.0, 40.0)
    shown = {text.get_text(): float(where) for text, where in zip(top.get_xticklabels(), top.get_xticks(), strict=True)}
    assert shown == {"0": 1000.0, "5": 800.0, "10": 600.0, "15": 400.0, "20": 200.0}


def test_readings_share_an_axis_that_holds_every_curve() -> None:
    large, small = envelope("early", "endpoints"), envelope("early", "edge-points", "fused")
    figure = envelope_figure("early", [large, small], BOUNDS["early"], "fig")
    for name in OF_STAGE["early"]:
        left, right = panel(figure, name, 0), panel(figure, name, 1)
        assert left.get_ylim() == right.get_ylim()
        low, high = left.get_ylim()
        k, unit = OF_STAGE["early"].index(name), DEGREE if name in ("roll", "pitch", "yaw") else 1.0
        assert low < small.percentiles[:, k, 1].min() / unit
        assert high > large.percentiles[:, k, 2].max() / unit


def test_a_roll_error_is_a_curve_of_its_own() -> None:
    rolled = envelope("late", roll=-0.2 * DEGREE)
    figure = envelope_figure("late", [rolled, *everything("late")[:4]], BOUNDS["late"], "fig")
    axes = panel(figure, "cross", 1)
    k = OF_STAGE["late"].index("cross")
    np.testing.assert_allclose(line(axes, "vision, 95 %, roll off by −0.2°")[1], rolled.percentiles[:, k, 1])
    bands = [c for c in axes.collections if isinstance(c, PolyCollection)]
    assert len(bands) == 3  # those of the true roll alone
    assert np.asarray(bands[0].get_paths()[0].vertices)[:, 1].max() < rolled.percentiles[:, k, 0].max()


def broken(one: Envelope) -> Envelope:
    """Half without a solution, half without an estimate."""
    half = one.distance.size // 2
    for array in (one.percentiles, one.sigma, one.single):
        array[half:] = math.nan
    one.percentiles[:half] = math.inf
    return one


@pytest.mark.parametrize(
    "given",
    [
        [broken(envelope("early"))],
        [broken(envelope("early", source="fused"))],
        [envelope("early", source="fused")],
        [envelope("late", roll=0.1)],
    ],
)
def test_figures_of_little(given: list[Envelope]) -> None:
    envelope_figure(given[0].stage, given, {}, "fig").draw_without_rendering()


def test_a_single_range_is_a_figure_too() -> None:
    one = envelope("early")
    first = {
        name: getattr(one, name)[:1]
        for name in ("distance", "time", "height", "count", "percentiles", "sigma", "single")
    }
    figure = envelope_figure(
        "early", [Envelope("early", "edge-points", "vision", 0.0, one.quantities, **first)], {}, "fig"
    )
    figure.draw_without_rendering()


@pytest.mark.slow
def test_files_are_whole_and_the_same_every_time(tmp_path: Path) -> None:
    style_before = dict(mpl.rcParams)
    folders = [tmp_path / name for name in ("one", "two")]
    for folder in folders:
        folder.mkdir()
        (folder / "errors-late.png").write_text("what stood there before")
        paths = draw_envelopes(
            folder, "late", everything("early")[:1] + everything("late")[2:4], BOUNDS["late"], "fig", 3
        )
        paths += draw_tilt(folder, tilted(), paper(), 3)
        assert [path.name for path in paths] == ["errors-late.png", "errors-late.pdf", "tilt.png", "tilt.pdf"]
        assert sorted(folder.iterdir()) == sorted(paths)
    for name in ("errors-late.png", "errors-late.pdf", "tilt.png", "tilt.pdf"):
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name
    pdf = (folders[0] / "errors-late.pdf").read_bytes()
    assert b"/FontFile2" in pdf  # a TrueType font, embedded
    assert b"/Type3" not in pdf
    assert b"Date" not in pdf
    assert imread(folders[0] / "tilt.png").shape[1] / (17.5 * CM) > 200.0  # points an inch
    assert dict(mpl.rcParams) == style_before


def test_a_stage_that_was_not_studied_has_no_figure(tmp_path: Path) -> None:
    assert draw_envelopes(tmp_path, "late", everything("early"), {}, "fig", 0) == []
    assert list(tmp_path.iterdir()) == []


def tilted() -> dict[str, Any]:
    """Two places a stage, with the second out of sight from 10° on."""
    pitch = [0.0, 5.0, 10.0, 15.0, 20.0]
    result: dict[str, Any] = {"pitch_down_deg": pitch}
    for stage, where in (("early", {"range_m": [800.0, 100.0]}), ("late", {"height_m": [8.0, 2.0]})):
        units = {name: "deg" if name in ("roll", "pitch", "yaw") else "m" for name in OF_STAGE[stage]}  # type: ignore[index]
        tables = {
            reading: {
                f"{name}_{unit}": {"p95": [[factor * (2.0 + p) for p in pitch], [factor, factor, None, None, math.nan]]}
                for name, unit in units.items()
            }
            for reading, factor in (("endpoints", 1.0), ("edge-points", 0.1))
        }
        result[stage] = where | tables
    return result


def test_errors_against_tilt() -> None:
    figure = tilt_figure(tilted(), paper(), "fig")
    early, late = (panels(figure)[: len(OF_STAGE["early"])], panels(figure)[len(OF_STAGE["early"]) :])
    assert [axes.get_ylabel() for axes in late] == [
        "|pitch error|, °",
        "|yaw error|, °",
        "|cross error|, m",
        "|altitude error|, m",
    ]
    assert len(early) == 6
    curves = [one for one in early[3].lines if np.size(one.get_xdata()) == 5]
    assert len(curves) == 4
    np.testing.assert_array_equal(np.asarray(curves[0].get_ydata(), float), [2.0, 7.0, 12.0, 17.0, 22.0])
    np.testing.assert_array_equal(np.asarray(curves[1].get_ydata(), float), [1.0, 1.0, math.nan, math.nan, math.nan])
    marks = [float(np.asarray(one.get_xdata())[0]) for one in early[3].lines if np.size(one.get_xdata()) == 2]
    assert marks == [3.0, 10.0]  # the pitches of the early and the late stage
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert names[:2] == ["three lines: 800 m to the threshold", "three lines: 100 m to the threshold"]
    assert names[-2:] == ["two lines: camera 8 m up", "two lines: camera 2 m up"]


def test_the_vanishing_point_is_at_f_times_the_tangent_of_the_tilt() -> None:
    """12.5 mm over 9.9 µm are 1262.6 px: 100 px at 4.528°, and 247 px, half of 494, at 11.07°."""
    figure = tilt_figure(tilted(), paper(), "fig")
    top = next(axes for axes in figure.axes if "vanishing point" in axes.get_xlabel())
    shown = {text.get_text(): float(at) for text, at in zip(top.get_xticklabels(), top.get_xticks(), strict=True)}
    assert shown["0"] == 0.0
    assert shown["100"] == pytest.approx(4.528, abs=0.001)
    assert top.get_xlim() == (0.0, 20.0)
    (outside,) = panels(figure)[0].patches
    assert outside.get_extents().transformed(panels(figure)[0].transData.inverted()).x0 == pytest.approx(
        11.07, abs=0.005
    )
