"""The pictures: they say what they show, with units, for any log, and leave nothing behind."""

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from numpy.typing import NDArray
from scipy.stats import chi2
from synthetic import empty_log, flight_log, parts

from landsim import plots, report
from landsim.metrics import Log, flight_metrics
from landsim.plots import navigation, style

Array = NDArray[np.float64]
SCENARIO, AIRCRAFT = parts()
FIGURES: dict[str, Callable[[Log, dict[str, Any]], Figure]] = {
    "profile and plan": lambda log, metrics: plots.profile_and_plan(log, SCENARIO, metrics),
    "navigation errors": lambda log, metrics: plots.navigation_errors(log, SCENARIO, metrics),
    "attitude and controls": lambda log, metrics: plots.controls_and_attitude(log, SCENARIO, metrics),
    "what the camera saw": lambda log, metrics: plots.camera_views(log, SCENARIO, metrics),
    "consistency": lambda log, metrics: plots.consistency(log, SCENARIO, metrics),
    "integrity": lambda log, metrics: plots.integrity(log, SCENARIO, metrics),
}
PANELS = {
    "profile and plan": 3,
    "navigation errors": 8,
    "attitude and controls": 10,
    "what the camera saw": 12,
    "consistency": 4,
    "integrity": 5,
}
"""The errors have two, consistency and integrity one, axis of distances besides."""


@pytest.fixture(scope="module")
def flight() -> dict[str, Array]:
    return flight_log(np.random.default_rng(1))


def measured(log: Log, end: str = "stopped") -> dict[str, Any]:
    return flight_metrics(log, SCENARIO, AIRCRAFT, seed=7, end=end, wall_time_s=0.5, versions={})


def text_of(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.texts)


def line(axes: Axes, label: str) -> tuple[Array, Array]:
    """What a labelled line of a panel shows."""
    (found,) = [artist for artist in axes.lines if artist.get_label() == label]
    return np.asarray(found.get_xdata(), dtype=float), np.asarray(found.get_ydata(), dtype=float)


@pytest.mark.parametrize("name", FIGURES)
def test_a_picture_says_what_it_shows_and_every_axis_has_a_unit(name: str, flight: dict[str, Array]) -> None:
    figure = FIGURES[name](flight, measured(flight))
    head = text_of(figure)
    assert head.startswith("landing, seed 7: ")
    assert name in head
    assert "landed, in the box" in head
    assert len(figure.axes) == PANELS[name]
    for axes in figure.axes:
        labels = [label for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
        for label in labels:
            assert re.search(r", (m|s|px|m/s|°|° down)$|\(1\)$", label), label
    named = [axes for axes in figure.axes if axes.get_ylabel() or axes.get_yticklabels()[0].get_text().isalpha()]
    assert len(named) >= min(3, PANELS[name])


SHORT = {
    "no row": (0, "trim_failed"),
    "one row": (1, "trim_failed"),
    "two rows": (2, "diverged"),
    "navigation never started": (400, "timeout"),
}


@pytest.mark.parametrize("case", SHORT)
def test_pictures_of_a_log_with_next_to_nothing_in_it(case: str) -> None:
    rows, end = SHORT[case]
    log = empty_log(rows)
    metrics = measured(log, end)
    for name, draw in FIGURES.items():
        figure = draw(log, metrics)
        figure.draw_without_rendering()
        assert name in text_of(figure)
        assert f"{metrics['outcome']}: {metrics['reason']}" in text_of(figure)


CUTS: dict[str, Callable[[dict[str, Array]], dict[str, Array]]] = {
    "in the flare": lambda log: {name: values[:3200] for name, values in log.items()},
    "the last row is the touchdown": lambda log: {name: values[: _touch(log) + 1] for name, values in log.items()},
    "from the touchdown on": lambda log: {name: values[_touch(log) :] for name, values in log.items()},
    "a hundred kilometres off": lambda log: log | {"true_cross_m": log["true_cross_m"] + 1e5},
    "every filter column NaN at the end": lambda log: {
        name: np.where(np.arange(values.size) > 3000, np.nan, values) if name.startswith(("fused", "sigma")) else values
        for name, values in log.items()
    },
}


def _touch(log: dict[str, Array]) -> int:
    return int(np.flatnonzero(log["wow_left"])[0])


@pytest.mark.parametrize("case", CUTS)
def test_pictures_of_half_a_flight(case: str, flight: dict[str, Array]) -> None:
    log = CUTS[case](flight)
    metrics = measured(log, "timeout")
    for draw in FIGURES.values():
        draw(log, metrics).draw_without_rendering()


def test_a_run_is_drawn_whole_and_nothing_else_is_left(flight: dict[str, Array], tmp_path: Path) -> None:
    style_before = dict(mpl.rcParams)
    (tmp_path / "camera.png").write_text("what stood there before")
    paths = report.draw_run(tmp_path, SCENARIO, flight, measured(flight))
    assert [path.name for path in paths] == list(report.PICTURES)
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    for path in paths:
        height, width = imread(path).shape[:2]
        assert width == 10 * report.DPI
        assert 7 * report.DPI < height < 10 * report.DPI
    assert dict(mpl.rcParams) == style_before


def test_a_picture_that_cannot_be_written_leaves_the_old_one(flight: dict[str, Array], tmp_path: Path) -> None:
    (tmp_path / "profile.png").mkdir()  # a folder in the way: the rename fails, also for root
    with pytest.raises(OSError, match=r"profile\.png"):
        report.draw_run(tmp_path, SCENARIO, flight, measured(flight))
    assert [path.name for path in tmp_path.iterdir()] == ["profile.png"]


def test_profile_shows_the_log_against_the_slope_and_the_box(flight: dict[str, Array]) -> None:
    metrics = measured(flight)
    figure = plots.profile_and_plan(flight, SCENARIO, metrics)
    side, plan, flare = figure.axes
    x, height = line(side, "true")
    np.testing.assert_allclose(height, np.interp(x, flight["body_x_m"], flight["body_height_m"]), atol=1e-9)
    x, height = line(side, "fused")  # at the cg too: a metre behind and 0.1 m below the camera
    shown = set(np.round(x[np.isfinite(x)], 6))
    assert shown
    assert shown <= set(np.round(flight["fused_along_m"] - 1.0, 6))
    assert set(np.round(height[np.isfinite(height)], 6)) <= set(np.round(flight["fused_height_m"] - 0.1, 6))
    x, height = line(side, "3° glide slope")
    # so many metres before the aim point the 3° line is so many times tan 3° up
    assert (x[1], height[1]) == (145.0, 0.0)
    assert height[0] == pytest.approx((145.0 - x[0]) * 0.0524077793)
    bottom, top = plan.get_ylim()
    assert bottom > 15.0 > 0.0 > top  # from above, flying to the right: right of the centreline is down
    x, height = line(flare, "touchdown")
    assert x[0] == metrics["touchdown"]["x_m"]
    assert f"{metrics['touchdown']['x_m']:.0f} m past the threshold" in flare.texts[0].get_text()


def test_errors_are_estimate_less_truth_in_a_band_of_three_sigma(flight: dict[str, Array]) -> None:
    figure = plots.navigation_errors(flight, SCENARIO, measured(flight))
    axes = next(a for a in figure.axes if a.get_ylabel() == "cross error, m")
    time, shown = line(axes, "fused, at camera frames")
    frames = np.isfinite(flight["nees9"])
    np.testing.assert_array_equal(time, flight["time_s"][frames])
    expected = (flight["fused_cross_m"] - flight["true_cross_m"])[frames]
    np.testing.assert_allclose(shown, expected, atol=1e-12)
    band = next(c for c in axes.collections if "3 σ" in str(c.get_label())).get_paths()[0].vertices
    vertices = np.asarray(band)
    assert vertices[:, 1].max() == pytest.approx(3.0 * np.nanmax(flight["sigma_cross_m"]), rel=1e-2)
    assert vertices[:, 1].min() == pytest.approx(-3.0 * np.nanmax(flight["sigma_cross_m"]), rel=1e-2)
    marks = {text.get_text(): text.xy[0] for text in axes.texts if hasattr(text, "xy")}
    assert marks["touchdown"] == flight["time_s"][_touch(flight)]
    assert marks["two lines"] == flight["time_s"][np.flatnonzero(flight["stage"] == 2)[0]]


def test_signed_roots_there_and_back() -> None:
    values = np.array([-9.0, -0.25, 0.0, 4.0])
    np.testing.assert_array_equal(navigation.signed_root(values), [-3.0, -0.5, 0.0, 2.0])
    np.testing.assert_array_equal(navigation.signed_square(navigation.signed_root(values)), values)


@pytest.mark.parametrize(("value", "expected"), [(7.9, 4.0), (8.0, 8.0), (0.03, 0.02), (1.0, 0.8), (199.0, 80.0)])
def test_ticks_are_round(value: float, expected: float) -> None:
    assert navigation.round_below(value) == pytest.approx(expected, rel=1e-12)


def test_numbers_on_an_axis_of_square_roots_are_evenly_spaced(flight: dict[str, Array]) -> None:
    figure = plots.navigation_errors(flight, SCENARIO, measured(flight))
    axes = next(a for a in figure.axes if a.get_ylabel() == "cross error, m")
    roots = navigation.signed_root(np.asarray(axes.get_yticks()))
    assert roots.size == 5
    np.testing.assert_allclose(np.diff(roots), roots[-1] / 2.0)
    assert roots[-1] < navigation.signed_root(np.array(axes.get_ylim()[1]))


def test_an_estimator_without_covariance_has_its_errors_drawn_and_its_silence_told(flight: dict[str, Array]) -> None:
    log = {
        name: np.full_like(v, np.nan) if name.startswith(("sigma_", "nees", "nis")) else v for name, v in flight.items()
    }
    metrics = measured(log)
    figure = plots.navigation_errors(log, SCENARIO, metrics)
    axes = next(a for a in figure.axes if a.get_ylabel() == "cross error, m")
    _, shown = line(axes, "fused, at camera frames")
    expected = (flight["fused_cross_m"] - flight["true_cross_m"])[np.isfinite(flight["accepted"])]
    np.testing.assert_allclose(shown, expected, atol=1e-12)
    assert np.isfinite(shown).sum() > 100
    assert "no covariance given" in text_of(figure)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["vision", "fused, at camera frames"]
    figure = plots.consistency(log, SCENARIO, metrics)
    panels = [axes for axes in figure.axes if axes.get_ylabel()]
    assert all("no covariance given" in [t.get_text() for t in axes.texts][-1] for axes in panels)
    assert not figure.legends


def test_what_is_zero_throughout_is_named_and_not_drawn(flight: dict[str, Array]) -> None:
    high = {name: values[:1150] for name, values in flight.items()} | {"steering": np.zeros(1150)}
    figure = plots.controls_and_attitude(high, SCENARIO, measured(high, "diverged"))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert not [label for label in labels if "weight" in label or "steering" in label]
    assert len(labels) == 8
    assert "zero throughout: steering, weight on wheel" in text_of(figure)
    assert sum(bool(axes.get_xlabel()) for axes in figure.axes) == 2


def test_six_moments_in_order(flight: dict[str, Array]) -> None:
    figure = plots.camera_views(flight, SCENARIO, measured(flight))
    images = [axes for axes in figure.axes if "px" in axes.get_xlabel()]
    titles = [axes.get_title(loc="left") for axes in images]
    starts = ["first lines", "600 m to go", "200 m to go", "last before hand-over", "wheels", "on the ground"]
    assert [title.split(":")[0] if "wheels" not in title else "wheels" for title in titles] == starts
    assert all("three lines" in title for title in titles[:4])
    assert all("two lines" in title for title in titles[4:])
    for axes in images:
        assert axes.get_xlim() == (-0.5, 657.5)
        assert axes.get_ylim() == (493.5, -0.5)  # v is down
        x, y = line(axes, "principal point")
        assert (x[0], y[0]) == (328.5, 246.5)


def test_six_moments_also_of_half_a_flight(flight: dict[str, Array]) -> None:
    half = {name: values[:1150] for name, values in flight.items()}  # to 618 m before the threshold
    figure = plots.camera_views(half, SCENARIO, measured(half, "timeout"))
    titles = [axes.get_title(loc="left") for axes in figure.axes if "px" in axes.get_xlabel()]
    assert [title.split(":")[0] for title in titles] == ["first lines", *["on the way"] * 4, "last lines"]
    times = [float(title.split(": ")[1].split(" s")[0]) for title in titles]
    assert np.all(np.diff(times) > 1.5)


def test_a_landing_outside_the_box_says_by_what(flight: dict[str, Array]) -> None:
    log = flight | {"body_y_m": flight["body_y_m"] + 2.0}
    head = text_of(plots.navigation_errors(log, SCENARIO, measured(log)))
    assert "landed, outside the box: misses cross_max_m = 2 with 2.17" in head  # 0.17 m before
    assert "stop_cross" not in head


def test_a_go_around_says_why(flight: dict[str, Array]) -> None:
    known = measured(flight) | {"outcome": "go_around", "in_box": False, "reason": "gone around: fog, -3.0 m up"}
    assert "\ngone around: fog, −3.0 m up\n" in text_of(plots.navigation_errors(flight, SCENARIO, known))


def test_the_end_of_all_lines_is_marked(flight: dict[str, Array]) -> None:
    log = dict(flight)
    for name in (f"{of}_seen_{end}" for of in ("left", "threshold", "right") for end in ("u0", "v0", "u1", "v1")):
        log[name] = np.where(flight["time_s"] > 12.0, np.nan, flight[name])
    marks = {name: when for when, name in style.event_times(log, measured(log))}
    assert marks == {"no more lines": 12.0, "touchdown": flight["time_s"][_touch(flight)]}


def test_offsets_of_the_lines_by_hand() -> None:
    """An upright edge, read 2 px to the right at its near and 1 px at its far end; a level threshold, 3 px down."""
    log = empty_log(1)
    log["stage"][0] = 1.0
    for name, ends in {
        "left_true": (100.0, 400.0, 100.0, 200.0),
        "left_seen": (102.0, 400.0, 101.0, 200.0),
        "threshold_true": (100.0, 400.0, 300.0, 400.0),
        "threshold_seen": (100.0, 403.0, 300.0, 403.0),
    }.items():
        for end, value in zip(("u0", "v0", "u1", "v1"), ends, strict=True):
            log[f"{name}_{end}"][0] = value
    figure = plots.camera_views(log, SCENARIO, measured(log, "timeout"))
    _, offsets = figure.axes
    x, y = line(offsets, "offset of left")
    np.testing.assert_allclose(x, [0.0, 1.0])
    np.testing.assert_allclose(y, [2.0, 1.0])
    np.testing.assert_allclose(line(offsets, "offset of threshold")[1], [3.0, 3.0])
    assert line(offsets, "offset of right")[0].size == 0


def test_a_long_log_is_thinned_and_keeps_its_ends() -> None:
    log = {"time_s": np.arange(6001.0), "other": np.arange(6001.0) ** 2}
    few = style.thinned(log)
    assert few["time_s"].size <= 2 * style.POINTS
    assert (few["time_s"][0], few["time_s"][-1]) == (0.0, 6000.0)
    np.testing.assert_array_equal(few["other"], few["time_s"] ** 2)
    assert style.thinned({"time_s": np.zeros(0)})["time_s"].size == 0


def test_zero_has_no_sign() -> None:
    assert [style.signed(value, 1) for value in (-0.04, 0.04, -0.06, 1.25)] == ["0.0", "0.0", "−0.1", "+1.2"]


def test_a_rejected_frame_is_told_by_what_was_seen(flight: dict[str, Array]) -> None:
    """The stage of a frame that the gate refused is 0: no reason to say that it saw nothing, or less."""
    frames = np.isfinite(flight["left_seen_u0"])
    log = flight | {"stage": np.zeros_like(flight["stage"]), "accepted": np.where(frames, 0.0, np.nan)}
    metrics = measured(log)
    assert style.event_times(log, metrics) == style.event_times(flight, measured(flight))
    images = [axes for axes in plots.camera_views(log, SCENARIO, metrics).axes if "px" in axes.get_xlabel()]
    titles = [axes.get_title(loc="left").split("\n")[1] for axes in images]
    assert titles == ["three lines, rejected"] * 4 + ["two lines, rejected"] * 2


def test_a_go_around_is_marked_and_what_there_is_not_is_not_in_the_legend(flight: dict[str, Array]) -> None:
    up = np.arange(flight["time_s"].size) >= 1500
    log = flight | {"phase": np.where(up, 5.0, flight["phase"]), "lines_found": np.zeros(up.size)}
    figure = plots.integrity(log, SCENARIO, measured(log))
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "go-around" in words
    assert "none was seen" in words
    assert "error beyond it" not in [text.get_text() for text in figure.legends[0].get_texts()]
    assert (float(flight["time_s"][1500]), "go-around") in style.event_times(log, measured(log))


def test_integrity_shows_levels_lines_and_alarms(flight: dict[str, Array]) -> None:
    """The level is passed by 1 m in rows 2000 to 2099; the left edge is at fault and left out in 1000 to 1199."""
    rows = np.arange(flight["time_s"].size)
    wrong, off = (rows >= 1000) & (rows < 1200), (rows >= 2000) & (rows < 2100)
    log = flight | {
        "lateral_protection_m": np.full(rows.size, 3.0),
        "fused_cross_m": np.where(off, flight["true_cross_m"] + 4.0, flight["fused_cross_m"]),
        "fault": np.where(wrong, 1.0, 0.0),
        "lines_found": np.full(rows.size, 7.0),
        "lines_believed": np.where(wrong, 6.0, 7.0),
        "alarm": np.where(wrong, 5.0, 0.0),
    }
    enabled: Any = SimpleNamespace(
        **{**vars(SCENARIO), "go_around": SCENARIO.go_around.model_copy(update={"enabled": True})}
    )
    panels = [axes for axes in plots.integrity(log, enabled, measured(log)).axes if axes.get_yticklabels()]
    lateral, _, lines, alarms = (axes for axes in panels if "along" not in axes.get_xlabel())
    _, beyond = line(lateral, "error beyond it")
    assert beyond == pytest.approx(4.0)
    assert line(lateral, "go-around above")[1] == pytest.approx(SCENARIO.go_around.lateral_limit_m)

    def spans(axes: Axes, what: str) -> list[tuple[float, float, float]]:
        """Begin and end, s, and place of the bars of a kind."""
        paths = [c.get_paths() for c in axes.collections if c.get_label() == what]
        boxes = [path.get_extents() for group in paths for path in group]
        return [(box.x0, box.x1, round(0.5 * (box.y0 + box.y1))) for box in boxes]

    time = flight["time_s"]
    left = 2  # the first is on top
    ((begin, end, place),) = spans(lines, "missing or another one")
    assert (begin, end) == pytest.approx((time[1000], time[1200]))
    assert place == left
    assert [place for _, _, place in spans(lines, "believed")].count(left) == 2
    assert sorted(place for _, _, place in spans(alarms, "alarm")) == [0, 2]  # inconsistent and wrong line
    names = [text.get_text() for text in alarms.get_yticklabels()]
    assert names == ["inconsistent", "unaided", "wrong line"]


def test_a_wrong_line_is_not_called_painted(flight: dict[str, Array]) -> None:
    taken = (flight["true_along_m"] > -560.0) & (flight["true_along_m"] < -500.0)
    log = flight | {"fault": np.where(taken, 3.0, 0.0)}
    figure = plots.camera_views(log, SCENARIO, measured(log))
    titles = [axes.get_title(loc="left") for axes in figure.axes if "px" in axes.get_xlabel()]
    (during,) = [title for title in titles if title.startswith("a line is wrong: ")]
    assert "\nthree lines, right wrong\n5" in during  # some 530 m before
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names[-1] == "another line"
    assert len(set(names)) == len(names)
    assert "another line" not in text_of(plots.camera_views(flight, SCENARIO, measured(flight)))


def test_offsets_have_one_scale(flight: dict[str, Array]) -> None:
    figure = plots.camera_views(flight, SCENARIO, measured(flight))
    assert len({axes.get_ylim() for axes in figure.axes if "px" not in axes.get_xlabel()}) == 1


def test_a_distance_is_named_only_near_it(flight: dict[str, Array]) -> None:
    log = dict(flight)
    hidden = (flight["true_along_m"] > -650.0) & (flight["true_along_m"] < -530.0)
    for name in log:
        if "_seen_" in name:
            log[name] = np.where(hidden, np.nan, flight[name])
    figure = plots.camera_views(log, SCENARIO, measured(log))
    titles = "".join(axes.get_title(loc="left") for axes in figure.axes)
    assert "600 m to go" not in titles
    assert "200 m to go" in titles


@pytest.mark.parametrize(("width", "height"), [(658, 16), (16, 658)])
def test_an_extreme_image_keeps_the_layout(width: int, height: int, flight: dict[str, Array]) -> None:
    camera = SCENARIO.camera.model_copy(update={"width_px": width, "height_px": height})
    scenario = SimpleNamespace(**{**vars(SCENARIO), "camera": camera})
    figure = plots.camera_views(flight, scenario, measured(flight))  # type: ignore[arg-type]
    figure.draw_without_rendering()
    for axes in (axes for axes in figure.axes if "px" in axes.get_xlabel()):
        box = axes.get_window_extent()
        assert 0.29 < box.height / box.width < 0.81
        assert axes.get_xlabel() == "not to scale; u, px"


def test_the_legend_of_the_consistency_holds_all_panels() -> None:
    """NIS in too few frames for a mean, errors in enough."""
    log = empty_log(400)
    log["nees9"][::4], log["nees15"][::4] = 9.0, 15.0
    log["nis"][:40:4], log["nis_dof"][:40:4] = 6.0, 6.0
    figure = plots.consistency(log, SCENARIO, measured(log, "timeout"))
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["each frame", "mean of 30 frames", "expected", "95 % of the frames", "gate"]


def test_gates_are_those_that_were_flown() -> None:
    """One in a million of chi-squared: of two degrees of freedom 2 ln 1e6 = 27.63, of six 38.26 by the tables."""
    log = empty_log(5)
    log["nis_dof"][:] = (2.0, 4.0, 6.0, np.nan, 6.0)
    flown = SCENARIO.navigation
    whole = navigation.gates(log, cast("Any", SimpleNamespace(navigation=flown)))
    np.testing.assert_array_equal(whole, (np.nan, flown.gate_late, flown.gate_early, np.nan, flown.gate_early))
    lines = flown.model_copy(update={"aiding": "lines", "line_gate_probability": 1e-6})
    gates = navigation.gates(log, cast("Any", SimpleNamespace(navigation=lines)))
    np.testing.assert_allclose(gates, chi2.isf(1e-6, log["nis_dof"]), rtol=1e-9)
    assert gates[0] == pytest.approx(27.631, abs=1e-3)


def test_errors_are_drawn_before_the_first_lines_and_after_the_last(flight: dict[str, Array]) -> None:
    """A state that is handed over has errors at each frame, whether it saw a line or not."""
    blind = (flight["time_s"] < 3.0) | (flight["time_s"] > 12.0)
    squares = np.where(np.arange(blind.size) % 4 == 0, 9.0, np.nan)
    log = flight | {"accepted": np.where(blind, np.nan, flight["accepted"]), "nees9": squares}
    axes = next(
        a for a in plots.navigation_errors(log, SCENARIO, measured(log)).axes if a.get_ylabel() == "cross error, m"
    )
    time, shown = line(axes, "fused, at camera frames")
    known = np.isfinite(shown)
    assert time[known][-1] > flight["time_s"][-1] - 0.1
    early = np.isfinite(flight["fused_cross_m"][flight["time_s"] < 3.0])
    assert (known & (time < 3.0)).sum() == pytest.approx(early.sum() / 4, abs=2)


def test_a_go_around_is_marked_where_it_begins(flight: dict[str, Array]) -> None:
    """From 12 m of height, out of the approach: no flare is marked, and the climb has no mark of one either."""
    begins = int(np.flatnonzero(flight["wheel_height_m"] < 12.0)[0])
    log = {name: values[: begins + 200] for name, values in flight.items()}
    log["phase"] = np.where(np.arange(begins + 200) >= begins, 5.0, log["phase"])
    side, _, last = plots.profile_and_plan(log, SCENARIO, measured(log, "go_around")).axes
    assert [text.get_text() for text in side.texts] == ["go-around"]
    _, y = line(last, "go-around begins, by guidance")
    assert y[0] == log["wheel_height_m"][begins]
    assert not [artist for artist in last.lines if "flare" in str(artist.get_label())]
    # out of the flare both are
    log["phase"][begins - 20 : begins] = 2.0
    side, _, last = plots.profile_and_plan(log, SCENARIO, measured(log, "go_around")).axes
    assert [text.get_text() for text in side.texts] == ["flare", "go-around"]
    assert line(last, "flare begins, by guidance")[1][0] == log["wheel_height_m"][begins - 20]


def test_names_of_marks_stay_inside_and_apart() -> None:
    figure = Figure(figsize=(4.0, 3.0))
    axes = figure.add_axes((0.2, 0.2, 0.7, 0.5))
    axes.set_xlim(0.0, 100.0)
    assert style.mark(axes, [(1.0, "no more lines"), (50.0, "touchdown"), (50.5, "crash"), (200.0, "beyond")]) == 2
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert [text.get_text() for text in axes.texts] == ["no more lines", "touchdown", "crash"]
    panel = axes.get_window_extent()
    for i, box in enumerate(boxes):
        assert panel.x0 <= box.x0 < box.x1 <= panel.x1
        assert box.y0 >= panel.y1  # above the panel: over no data
        assert not any(box.overlaps(other) for other in boxes[i + 1 :])


def test_a_filter_that_never_started_is_told() -> None:
    log = empty_log(400)
    log["vision_along_m"][:12:4] = -900.0
    figure = plots.navigation_errors(log, SCENARIO, measured(log, "timeout"))
    assert "navigation never started: 3 usable frames" in text_of(figure)
    assert [style.never_started(n) for n in (0, 1)] == [
        f"navigation never started: {n}" for n in ("0 usable frames", "1 usable frame")
    ]


def test_the_airspeed_command_is_that_of_the_approach(flight: dict[str, Array]) -> None:
    log = flight | {"command_airspeed_mps": np.full(flight["time_s"].size, 40.0)}
    figure = plots.controls_and_attitude(log, SCENARIO, measured(log))
    axes = next(a for a in figure.axes if a.get_ylabel() == "airspeed, m/s")
    time, shown = line(axes, "command")
    phase = np.interp(time, flight["time_s"], flight["phase"])
    np.testing.assert_array_equal(np.isfinite(shown), phase == 1.0)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [name.split()[-1] for name in names] == ["acquire", "approach", "flare", "rollout", "stopped", "go-around"]


def test_a_crash_is_marked_and_ends_the_pictures(flight: dict[str, Array]) -> None:
    touch = _touch(flight)
    log = flight | {"wow_nose": np.where(np.arange(flight["time_s"].size) >= touch - 1, 1.0, 0.0)}
    metrics = measured(log)
    failed = style.failure(log, SCENARIO, metrics)
    assert failed == style.Failure(touch - 1, "crash", True)
    time = float(flight["time_s"][touch - 1])
    shown = style.until_shortly_after(log, failed)["time_s"]
    assert shown[-1] == pytest.approx(time + 3.0, abs=0.01)
    assert (time, "crash") in style.event_times(log, metrics, failed)
    for draw in FIGURES.values():
        draw(log, metrics).draw_without_rendering()
    side = plots.profile_and_plan(log, SCENARIO, metrics).axes[0]
    assert "crash" in [text.get_text() for text in side.texts]
    assert side.get_xlim()[1] < 500.0  # it stops beyond


def test_a_flight_off_the_runway_is_marked_there(flight: dict[str, Array]) -> None:
    touch = _touch(flight)
    beside = np.where(np.arange(flight["time_s"].size) >= touch + 100, 15.5, 0.0)
    log = flight | {"body_y_m": flight["body_y_m"] + beside}
    assert style.failure(log, SCENARIO, measured(log)) == style.Failure(touch + 100, "off the runway", True)
    assert style.failure(flight, SCENARIO, measured(flight)) is None


def test_no_flight_no_picture(tmp_path: Path) -> None:
    log = empty_log(0)
    assert report.draw_run(tmp_path, SCENARIO, log, measured(log, "trim_failed")) == []
    assert list(tmp_path.iterdir()) == []


def test_minus_signs_are_those_of_the_axes() -> None:
    assert [style.signed(-1.26, 1), style.number(-106.6, ".0f"), style.number(2.0)] == ["−1.3", "−107", "2"]
