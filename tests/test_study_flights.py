"""From rows of flights to errors by range."""

import math
from typing import Any

import numpy as np
import pytest
from approach import PROTOTYPE, paper

from landsim.batch.row import ARRAYS, SCALARS, Row
from landsim.log import QUANTITIES as COLUMNS
from landsim.study.flights import as_flight, attitude_errors, envelopes, fly_study, load_rows, of_reading, save_rows
from landsim.study.model import OF_STAGE, Envelope

DEGREE = math.pi / 180.0
TAN_3 = 0.0524077793


def flown(distance: list[float], **changes: Any) -> Row:
    """A row on the paper's straight path, with exact estimates and a σ of 1, three lines all the way."""
    d = np.array(distance)
    row: Row = dict.fromkeys(SCALARS)
    row |= {"seed": 0, "line_noise": "edge-points", "outcome": "landed", "touchdown_time_s": 1000.0}
    row |= {name: np.zeros(d.size) for name in ARRAYS}
    row |= {f"sigma_{column}": np.ones(d.size) for column in COLUMNS}
    row |= {"distance_m": d, "time_s": (1000.0 - d) / 39.945, "stage": np.ones(d.size), "true_along_m": -d}
    row |= {"true_height_m": 60.0 - (1000.0 - d) * TAN_3, "true_pitch_deg": np.full(d.size, -3.0)}
    return row | {name: np.asarray(value) if name in ARRAYS else value for name, value in changes.items()}


def named(found: tuple[Envelope, ...], stage: str, source: str) -> Envelope:
    (one,) = [e for e in found if (e.stage, e.source) == (stage, source)]
    return one


def column(envelope: Envelope, name: str) -> int:
    return envelope.quantities.index(name)


def test_a_flight_of_a_study_is_the_study_with_another_noise_reading() -> None:
    study = paper(navigation__handover="latched", runway__width_m=45.0)
    flight = as_flight(study, "endpoints")
    assert (flight.kind, flight.study, flight.camera.line_noise) == ("flight", None, "endpoints")
    assert flight.model_copy(update={"kind": "study", "study": study.study, "camera": study.camera}) == study


def test_percentiles_are_over_the_flights_and_in_radians() -> None:
    """Errors of ±1 to ±100 in a hundred flights: 69 of them are within 69, 95 within 95, all within 100."""
    rows = [
        flown([400.0], vision_error_pitch_deg=[(-1.0) ** i * i], fused_error_cross_m=[-0.01 * i], seed=i)
        for i in range(100, 0, -1)
    ]
    found = envelopes(paper(), rows, "edge-points")
    vision, fused = (named(found, "early", source) for source in ("vision", "fused"))
    np.testing.assert_allclose(vision.percentiles[0, column(vision, "pitch")] / DEGREE, [69.0, 95.0, 100.0])
    np.testing.assert_allclose(fused.percentiles[0, column(fused, "cross")], [0.69, 0.95, 1.0])
    assert vision.percentiles[0, column(vision, "cross")].tolist() == [0.0, 0.0, 0.0]
    # the first row's flight, with its sign
    assert vision.single[0, column(vision, "pitch")] == pytest.approx(100.0 * DEGREE)
    assert fused.single[0, column(fused, "cross")] == -1.0
    assert (vision.count[0], fused.count[0], vision.roll_error) == (100, 100, 0.0)


def test_sigma_of_the_filter_is_a_root_mean_square_over_the_flights_it_runs_in() -> None:
    nothing = {f"fused_error_{name}": [math.nan] for name in COLUMNS} | {
        f"sigma_{name}": [math.nan] for name in COLUMNS
    }
    rows = [
        flown([400.0], sigma_roll_deg=[3.0], sigma_along_m=[6.0]),
        flown([400.0], sigma_roll_deg=[4.0], sigma_along_m=[8.0]),
        flown([400.0], **nothing),
    ]
    fused = named(envelopes(paper(), rows, "edge-points"), "early", "fused")
    assert fused.count[0] == 2
    assert fused.sigma[0, column(fused, "roll")] == pytest.approx(math.sqrt(12.5) * DEGREE)
    assert fused.sigma[0, column(fused, "along")] == pytest.approx(math.sqrt(50.0))
    assert np.isfinite(fused.percentiles).all()


def test_a_range_without_a_filter_has_no_fused_errors() -> None:
    nothing = {f"fused_error_{name}": [math.nan] for name in COLUMNS} | {
        f"sigma_{name}": [math.nan] for name in COLUMNS
    }
    fused = named(envelopes(paper(), [flown([1000.0], **nothing)] * 3, "edge-points"), "early", "fused")
    assert fused.count.tolist() == [0]
    assert np.isnan(fused.percentiles).all()
    assert np.isnan(fused.sigma).all()


def test_lines_without_a_solution_are_infinitely_far_off() -> None:
    lost = {f"vision_error_{name}": [math.nan] for name in COLUMNS}
    rows = [flown([400.0]) for _ in range(9)] + [flown([400.0], **lost)]
    vision = named(envelopes(paper(), rows, "edge-points"), "early", "vision")
    assert vision.count[0] == 10
    assert vision.percentiles[0, 0].tolist() == [0.0, math.inf, math.inf]


def test_a_range_belongs_to_the_stage_that_half_of_the_flights_are_in() -> None:
    """Three hand over past 60, 40 and 20 m; the errors of those that have not, or that have, do not mix."""
    distance = [80.0, 60.0, 40.0, 20.0, 0.0]
    rows = [
        flown(distance, stage=stage, vision_error_cross_m=[0.1, 0.2, 0.3, 0.4, 0.5], time_s=[1.0, 2.0, third, 4.0, 5.0])
        for stage, third in (([1, 1, 2, 2, 2], 3.0), ([1, 1, 1, 2, 2], 3.5), ([1, 1, 1, 1, 0], 4.0))
    ]
    found = envelopes(paper(), rows, "edge-points")
    early, late = (named(found, stage, "vision") for stage in ("early", "late"))
    assert (early.distance.tolist(), early.count.tolist()) == ([80.0, 60.0, 40.0], [3, 3, 2])
    assert (late.distance.tolist(), late.count.tolist()) == ([20.0, 0.0], [2, 2])
    assert early.time.tolist() == [1.0, 2.0, 3.75]
    assert (early.quantities, late.quantities) == (OF_STAGE["early"], OF_STAGE["late"])
    single = early.single[:, column(early, "cross")]
    np.testing.assert_array_equal(single, [0.1, 0.2, math.nan])  # the first flight is late there


def test_the_late_stage_ends_at_the_study_s_height_and_at_the_touchdown() -> None:
    distance, stage = [20.0, 0.0, -20.0, -40.0], [2.0] * 4
    rows = [flown(distance, stage=stage, true_height_m=[9.0, 5.0, 2.5, 1.5], time_s=[1.0, 2.0, 3.0, 4.0])] * 3
    assert named(envelopes(paper(study__end_height_m=2.0), rows, "edge-points"), "late", "fused").distance[-1] == -20.0
    assert named(envelopes(paper(study__end_height_m=1.0), rows, "edge-points"), "late", "fused").distance[-1] == -40.0
    down = [row | {"touchdown_time_s": 3.0} for row in rows]
    assert named(envelopes(paper(study__end_height_m=1.0), down, "edge-points"), "late", "fused").distance[-1] == 0.0


def test_one_reading_at_a_time() -> None:
    rows = [flown([400.0]), flown([400.0], line_noise="endpoints", vision_error_cross_m=[2.0])]
    assert of_reading(rows, "endpoints") == rows[1:]
    vision = named(envelopes(paper(), rows, "endpoints"), "early", "vision")
    assert (vision.reading, vision.count[0], vision.percentiles[0, column(vision, "cross"), 0]) == ("endpoints", 1, 2.0)
    with pytest.raises(ValueError, match="no flight with edge-points"):
        envelopes(paper(), rows[1:], "edge-points")


def test_rows_at_different_distances_are_not_laid_over_each_other() -> None:
    with pytest.raises(ValueError, match="distances differ"):
        envelopes(paper(), [flown([400.0]), flown([300.0])], "edge-points")


@pytest.mark.parametrize(("distance", "reading"), PROTOTYPE)
def test_first_order_at_the_pose_flown(distance: float, reading: Any) -> None:
    rows = [flown([distance], line_noise=reading)] * 2
    vision = named(envelopes(paper(), rows, reading), "early", "vision")
    expected = np.array(PROTOTYPE[distance, reading]) * ([DEGREE] * 3 + [1.0] * 3)
    np.testing.assert_allclose(vision.sigma[0], expected, rtol=0.03)


def test_first_order_goes_by_the_attitude_flown() -> None:
    """Of two flights one is turned away until the threshold is out of sight: the other one counts."""
    rows = [flown([200.0], true_roll_deg=[roll], true_yaw_deg=[yaw]) for roll, yaw in ((5.0, 2.0), (0.0, 60.0))]
    both = named(envelopes(paper(), rows, "edge-points"), "early", "vision").sigma
    one = named(envelopes(paper(), rows[:1], "edge-points"), "early", "vision").sigma
    assert np.isfinite(one).all()
    np.testing.assert_array_equal(both, one)


def test_attitude_errors_of_the_flights_that_have_them() -> None:
    rows = [
        flown(
            [400.0, 200.0],
            fused_error_roll_deg=[9.0, roll],
            fused_error_pitch_deg=[9.0, 0.2],
            vision_error_yaw_deg=[9.0, 0.5],
        )
        for roll in (0.1, math.nan, -0.3)
    ]
    np.testing.assert_allclose(
        attitude_errors(rows, 200.0), np.array([[0.1, 0.2, 0.0], [-0.3, 0.2, 0.0]]) * DEGREE, rtol=1e-12
    )
    np.testing.assert_allclose(attitude_errors(rows, 200.0, "vision"), np.array([[0.0, 0.0, 0.5]] * 3) * DEGREE)
    with pytest.raises(ValueError, match="no errors at 250 m"):
        attitude_errors(rows, 250.0)
    assert attitude_errors([], 250.0).shape == (0, 3)


def test_a_short_study_flown(tmp_path: Any) -> None:
    """Two seeds over the last metres of the early stage, at the study's own range too, and through a file."""
    study = paper(
        start__along_m=-150.0, start__height_m=15.5, simulation__time_limit_s=3.0, study__ranges_m=[123.0, 60.0]
    )
    told: list[Row] = []
    rows = fly_study(study, "endpoints", [3, 4], progress=told.append)
    assert [row["seed"] for row in rows] == [row["seed"] for row in told] == [3, 4]
    save_rows(tmp_path / "flights.parquet", rows)
    found = envelopes(study, load_rows(tmp_path / "flights.parquet"), "endpoints")
    vision = named(found, "early", "vision")
    assert {123.0, 60.0} <= set(vision.distance.tolist())
    assert vision.distance[-1] > 20.0  # the threshold leaves the image 38 m before it, or thereabouts
    np.testing.assert_array_equal(vision.count, 2)
    # four standard deviations hold all but one in ten thousand
    assert (vision.percentiles[..., 2] < 4.0 * vision.sigma).all()
    assert (vision.percentiles[..., 2] > 0.0).all()
    fused = named(found, "early", "fused")
    assert (fused.sigma[-1] < vision.sigma[-1]).all()
