"""Rows of flights: what stands at which distance, whoever flies them, and what becomes of those that fail."""

import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from approach import paper
from numpy.typing import NDArray
from synthetic import empty_log

from landsim.batch import row as batch
from landsim.batch.pool import fly_rows, workers
from landsim.batch.row import ARRAYS, SCALARS, by_distance, distances_of, flight_row
from landsim.batch.rows import load_rows, save_rows
from landsim.config import Scenario, load_scenario
from landsim.errors import InputError, RunFolderError
from landsim.log import QUANTITIES, Log
from landsim.simulate import fly

SHORT = {"start.along_m": -260.0, "start.height_m": 21.2, "simulation.time_limit_s": 3.0}


@pytest.fixture(scope="module")
def short() -> Scenario:
    """Three seconds, begun near the runway."""
    return load_scenario("landing", overrides=SHORT)


def same(one: dict[str, Any], other: dict[str, Any], *, but: tuple[str, ...] = ("wall_time_s",)) -> None:
    assert list(one) == list(other) == [*SCALARS, *ARRAYS]
    for name in SCALARS:
        assert name in but or one[name] == other[name], name
        assert one[name] is None or type(one[name]) is SCALARS[name], name
    for name in ARRAYS:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def test_distances_are_those_divisible_by_ten_and_the_study_s_own() -> None:
    start = load_scenario("landing", overrides={"start.along_m": -57.0})
    expected = [50.0, 40.0, 30.0, 20.0, 10.0, 0.0, *(-10.0 * i for i in range(1, 31))]
    assert distances_of(start).tolist() == expected
    study = paper(start__along_m=-57.0, study__ranges_m=[52.5, 40.0, -301.0])
    assert distances_of(study).tolist() == [52.5, *expected, -301.0]


def approaching(along: list[float]) -> Log:
    log = empty_log(len(along))
    log["true_along_m"] = np.array(along)
    return log


def test_at_a_distance_stands_the_first_frame_at_or_past_it() -> None:
    """Frames are rows 0, 3, 6 and 9, at 30, 24, 18 and 12 m."""
    log = approaching([-30.0 + 2.0 * i for i in range(11)])
    row = by_distance(log, np.array([40.0, 34.0, 30.0, 29.0, 24.0, 19.0, 12.5, 12.0, 11.0]), 3)
    step = log["time_s"][1]
    # a first frame stands for 34 m, but not for 40 m; past 12 m there are rows, but no frame
    expected = np.array([math.nan, 0.0, 0.0, 3.0, 3.0, 6.0, 9.0, 9.0, math.nan]) * step
    np.testing.assert_allclose(row["time_s"], expected, rtol=1e-12)
    np.testing.assert_array_equal(row["true_along_m"][2:5], [-30.0, -24.0, -24.0])


def test_no_frame_in_the_row_of_a_crash() -> None:
    log = approaching([-30.0, -29.0, -28.0, -27.0])
    assert by_distance(log, np.array([27.0]), 3)["true_along_m"][0] == -27.0
    assert math.isnan(by_distance(log, np.array([27.0]), 3, crashed=True)["true_along_m"][0])


def test_a_log_without_a_row_has_nothing() -> None:
    row = by_distance(empty_log(0), np.array([10.0, 0.0]), 4)
    assert all(np.isnan(row[name]).all() for name in ARRAYS if name != "distance_m")


def test_errors_are_estimate_less_true_and_angles_are_wrapped() -> None:
    log = approaching([-20.0, -10.0])
    log |= {"true_cross_m": np.array([1.0, 2.0]), "vision_cross_m": np.array([1.5, math.nan])}
    log |= {"true_yaw_deg": np.array([179.5, 1.0]), "fused_yaw_deg": np.array([-179.5, 0.75])}
    log["sigma_yaw_deg"] = np.array([0.1, 0.2])
    row = by_distance(log, np.array([20.0, 10.0]), 1)
    np.testing.assert_array_equal(row["vision_error_cross_m"], [0.5, math.nan])
    np.testing.assert_allclose(row["fused_error_yaw_deg"], [1.0, -0.25], rtol=1e-12)
    np.testing.assert_array_equal(row["sigma_yaw_deg"], [0.1, 0.2])


@pytest.mark.parametrize(
    ("lines", "numbers", "known", "stage", "expected"),
    [
        ("left threshold right", 6.0, True, 1.0, 1.0),
        ("left threshold right", 6.0, True, 0.0, 1.0),  # refused by the gate, and an early frame all the same
        ("left right", 4.0, True, 0.0, 2.0),
        ("left threshold right", 4.0, True, 2.0, 2.0),  # latched: the threshold is back in view, and not used
        ("left threshold right", math.nan, False, 1.0, 1.0),  # one of those from which the filter starts
        ("left threshold right", math.nan, False, 0.0, 1.0),  # the same without a solution
        ("left threshold right", math.nan, True, 1.0, 1.0),  # that with which it starts
        ("left right", math.nan, False, 0.0, 0.0),
        ("right", math.nan, True, 0.0, 0.0),
    ],
)
def test_a_frame_has_the_stage_of_what_it_offered(
    lines: str, numbers: float, known: bool, stage: float, expected: float
) -> None:
    log = approaching([-20.0])
    for line in lines.split():
        log[f"{line}_seen_u0"][0] = 100.0
    log["lines_found"][0], log["stage"][0] = {6.0: 7.0, 4.0: 5.0}.get(numbers, 0.0), stage
    log["fused_along_m"][0] = -20.0 if known else math.nan
    assert by_distance(log, np.array([20.0]), 1)["stage"][0] == expected


def test_a_row_is_its_flight(short: Scenario) -> None:
    row, flight = flight_row(short, 3), fly(short, 3)
    log, metrics = flight.log, flight.metrics
    assert (row["seed"], row["outcome"], row["end"]) == (3, metrics["outcome"], "timeout")
    assert row["start_cross_m"] == metrics["start"]["cross_m"]
    assert row["touchdown_time_s"] is row["x_m"] is row["stop_x_m"] is None
    assert row["fused_cross_p95_m"] == metrics["navigation"]["fused"]["cross_m"]["p95"]
    assert row["glide_slope_rms_m"] == metrics["tracking"]["glide_slope_m"]["rms"]
    # the first camera frame, every fourth row, that is 200 m or less from the threshold
    at = next(i for i in range(0, log["time_s"].size, 4) if log["true_along_m"][i] >= -200.0)
    here = int(np.flatnonzero(row["distance_m"] == 200.0)[0])
    assert row["time_s"][here] == log["time_s"][at]
    for quantity in QUANTITIES:
        for source in ("vision", "fused"):
            expected = log[f"{source}_{quantity}"][at] - log[f"true_{quantity}"][at]
            assert math.isfinite(expected)
            assert row[f"{source}_error_{quantity}"][here] == pytest.approx(expected, abs=1e-12)
    same(row, flight_row(short, 3))


def test_a_landing_has_its_touchdown_by_the_names_of_metrics_json(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_scenario("landing")
    flown = fly(load_scenario("landing", overrides=SHORT), 0)
    touchdown = {name: 0.5 + i for i, name in enumerate((*batch.TOUCHDOWN, "time_s"))}
    stop = {"x_m": 600.0, "y_m": -0.25, "time_s": 48.0}
    metrics = flown.metrics | {"touchdown": touchdown, "stop": stop, "bounces": 2, "end": "stopped"}
    row = batch.row_of(scenario, type(flown)(metrics, flown.log), np.array([100.0]))
    assert {name: row[name] for name in batch.TOUCHDOWN} == {name: touchdown[name] for name in batch.TOUCHDOWN}
    assert (row["touchdown_time_s"], row["stop_y_m"], row["bounces"]) == (touchdown["time_s"], -0.25, 2)
    # a wheel that touched on the way up is no touchdown of a landing
    climbed = metrics | {"outcome": "go_around", "end": "go_around", "stop": None}
    row = batch.row_of(scenario, type(flown)(climbed, flown.log), np.array([100.0]))
    assert [row[name] for name in (*batch.TOUCHDOWN, "touchdown_time_s")] == [None] * 8


def test_a_wrong_line_is_in_the_row_and_so_is_what_navigation_made_of_it() -> None:
    wrong = {"navigation.aiding": "lines", "fault.kind": "wrong", "fault.at_s": 2.0, "fault.offset_m": -10.0}
    row = flight_row(load_scenario("landing", overrides=SHORT | wrong | {"simulation.time_limit_s": 4.0}), 1, [100.0])
    assert row["fault_at_s"] == pytest.approx(2.0, abs=1.0 / 30.0)
    assert row["wrong_line_alarm_s"] == row["fault_at_s"] + row["fault_detected_after_s"]
    assert 0.0 < row["fault_detected_after_s"] < 1.0
    assert (row["unaided_alarm_s"], row["flagged"], row["false_alarm"]) == (None, False, False)
    # a frame in 1/30 s, from when the filter starts
    assert 60 < row["lateral_protection_frames"] == row["vertical_protection_frames"] <= 121
    assert 0.0 < row["lateral_protection_last_m"] < row["lateral_protection_max_m"]


def test_an_exception_is_a_row(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(scenario: Scenario, seed: int, draws: object) -> None:
        raise RuntimeError("wings fell off")

    monkeypatch.setattr(batch, "fly", fail)
    row = flight_row(short, 5, [20.0, 10.0])
    assert (row["seed"], row["outcome"], row["in_box"]) == (5, "error", False)
    assert row["reason"] == "RuntimeError: wings fell off"
    assert list(row) == [*SCALARS, *ARRAYS]
    assert row["distance_m"].tolist() == [20.0, 10.0]
    assert np.isnan(row["fused_error_cross_m"]).all()


def test_what_the_user_can_mend_is_not_a_row(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(scenario: Scenario, seed: int, draws: object) -> None:
        raise InputError("pioneer.xml does not load")

    monkeypatch.setattr(batch, "fly", fail)
    with pytest.raises(InputError, match=r"pioneer\.xml"):
        flight_row(short, 0)
    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError, match=r"pioneer\.xml"):
        fly_rows(short, range(3), pool)


@pytest.mark.parametrize("seed", [-1, 1.5, True, "1"])
def test_a_seed_is_a_whole_number(seed: Any, short: Scenario) -> None:
    with pytest.raises(ValueError, match="seed must be a whole number"):
        flight_row(short, seed)


def test_a_study_is_not_flown() -> None:
    with pytest.raises(ValueError, match="kind 'study' is not flown"):
        flight_row(paper(), 0)


class Backwards(Executor):
    """Finishes what it was given last first."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.waiting.append((future, lambda: fn(*args, **kwargs)))
        if len(self.waiting) == 3:
            for one, work in reversed(self.waiting):
                one.set_result(work())
        return future


def test_rows_are_in_the_order_of_the_seeds(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "flight_row", lambda scenario, seed, distances: {"seed": seed})
    for executor in (None, Backwards()):
        told: list[int] = []
        rows = fly_rows(short, [4, 7, 5], executor, lambda row, told=told: told.append(row["seed"]))  # type: ignore[misc]
        assert [row["seed"] for row in rows] == [4, 7, 5]
        assert sorted(told) == [4, 5, 7]


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts threads by /proc")
def test_processes_fly_the_same_rows_with_one_thread_each(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    monkeypatch.delenv("OMP_NUM_THREADS")
    here = fly_rows(short, range(3), distances=[250.0, 200.0])
    with workers(2) as pool:
        there = fly_rows(short, range(3), pool, distances=[250.0, 200.0])
        threads = pool.submit(os.listdir, "/proc/self/task").result()
        of_python = pool.submit(threading.active_count).result()
    for one, other in zip(here, there, strict=True):
        same(one, other)
    assert len(threads) == of_python  # numpy is loaded there: its library would have made more
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"
    assert "OMP_NUM_THREADS" not in os.environ


def numbers(seed: int) -> dict[str, Any]:
    """A row that was not flown."""
    rng = np.random.default_rng(seed)
    kinds: dict[type, Any] = {int: seed, float: float(rng.standard_normal()), str: f"σ {seed}", bool: seed % 2 == 0}
    arrays: dict[str, NDArray[np.float64]] = {name: rng.standard_normal(4) for name in ARRAYS}
    arrays["sigma_cross_m"][2] = math.nan
    return {name: kinds[kind] for name, kind in SCALARS.items()} | arrays


def test_rows_come_back_from_a_file_bit_for_bit(tmp_path: Path) -> None:
    rows = [numbers(seed) for seed in range(3)]
    rows[1] |= {"x_m": None, "stop_time_s": None, "bounces": None}
    rows[2] |= {name: np.zeros(0) for name in ARRAYS}
    save_rows(tmp_path / "flights.parquet", rows)
    assert [path.name for path in tmp_path.iterdir()] == ["flights.parquet"]
    for one, other in zip(rows, load_rows(tmp_path / "flights.parquet"), strict=True):
        same(one, other, but=())


def test_no_rows_come_back_as_none(tmp_path: Path) -> None:
    save_rows(tmp_path / "flights.parquet", [])
    assert load_rows(tmp_path / "flights.parquet") == []


def test_a_file_that_is_no_table_of_flights_is_told_in_a_line(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "flights.parquet"
    with pytest.raises(RunFolderError, match="No such file"):
        load_rows(path)
    path.write_text("nothing")
    with pytest.raises(RunFolderError, match="not a Parquet file"):
        load_rows(path)
    pq.write_table(pa.table({"index": [0], "seed": [1]}), path)
    with pytest.raises(RunFolderError, match="column line_noise is missing"):
        load_rows(path)
