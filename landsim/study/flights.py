"""The approach flown in JSBSim by vision alone: rows of `landsim.batch` to errors by range, of vision and the filter.

What a straight path by sampling cannot show is here: attitude motion, the roll that the filter lends to the late stage,
and what the inertial unit makes of it all.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimator.so3 import Array, from_euler
from landsim.batch.pool import fly_rows
from landsim.batch.row import Row, distances_of
from landsim.batch.rows import load_rows, save_rows
from landsim.config import Scenario
from landsim.scene import runway_of
from landsim.sensors import camera_of
from landsim.state import Stage
from landsim.study.envelope import first_order, percentiles
from landsim.study.frames import Frames, look
from landsim.study.model import OF_STAGE, QUANTITIES, SOURCES, Envelope, Reading, Source, StageName
from landsim.units import DEG

__all__ = [
    "FlownErrors",
    "as_flight",
    "attitude_errors",
    "envelopes",
    "flown_errors",
    "fly_study",
    "load_rows",
    "of_reading",
    "save_rows",
]

STAGES: dict[StageName, Stage] = {"early": Stage.EARLY, "late": Stage.LATE}
ATTITUDE = ("roll", "pitch", "yaw")
Inside: TypeAlias = NDArray[np.bool_]
"""Which flights are in a stage where, (flights, distances)."""
Ranges: TypeAlias = NDArray[np.intp]
"""Indices of the distances that belong to it."""
SHARE = 0.5
"""A range belongs to a stage if at least this share of the flights is in it there.

Flights do not hand over, nor touch down, at the same place: without it, the last ranges of a stage would be those of
the few that came farthest.
"""


def as_flight(scenario: Scenario, reading: Reading) -> Scenario:
    """The flight scenario of a study: everything as it says, flown with one noise reading."""
    camera = scenario.camera.model_copy(update={"line_noise": reading})
    return scenario.model_copy(update={"kind": "flight", "study": None, "camera": camera})


def fly_study(
    scenario: Scenario,
    reading: Reading,
    seeds: Sequence[int],
    executor: Executor | None = None,
    progress: Callable[[Row], None] | None = None,
) -> list[Row]:
    """The flights of a study with one noise reading, one for each seed, with the study's ranges among the distances.

    Parameters and result are those of `landsim.batch.pool.fly_rows`.
    """
    return fly_rows(as_flight(scenario, reading), seeds, executor, progress, distances_of(scenario))


def of_reading(rows: Sequence[Row], reading: Reading) -> list[Row]:
    """Those of the rows that were flown with a noise reading."""
    return [row for row in rows if row["line_noise"] == reading]


def envelopes(scenario: Scenario, rows: Sequence[Row], reading: Reading) -> tuple[Envelope, ...]:
    """Errors by range over the flights of one noise reading.

    Parameters
    ----------
    scenario : Scenario
        As flown, or the study; a study's ``end_height_m`` ends the late stage here too, and the touchdown in any case.
    rows : sequence of dict
        Of `fly_study`, all with the same distances; those of other readings are left out.
    reading : {"endpoints", "edge-points"}

    Returns
    -------
    tuple of Envelope
        Of vision and of the filter, early and late, as far as there are ranges that belong to the stage, see `SHARE`.
        ``count`` is the number of flights that are in the stage there and, for the filter, in which it runs; the
        percentiles are over those, and a frame whose lines have no solution counts as infinitely large.  ``time`` and
        ``height`` are means, ``single`` is the first row's flight.  ``sigma`` is the root mean square over the
        flights: of the filter's own, or of the first order at each flight's true pose, without the roll that the late
        stage borrows.

    Raises
    ------
    ValueError
        If there is no row of the reading, or the rows' distances differ.
    """
    flown = of_reading(rows, reading)
    result = []
    for stage, inside, ranges in _stages(scenario, flown, reading):
        bounds = {
            "vision": _first_order(scenario, flown, stage, reading, inside, ranges),
            "fused": _own_sigma(flown, stage, inside, ranges),
        }
        result += [_envelope(flown, stage, reading, source, inside, ranges, bounds[source]) for source in SOURCES]
    return tuple(result)


@dataclass(frozen=True)
class FlownErrors:
    """What each flight has to do with an envelope; f flights, n distances, k quantities.

    Attributes
    ----------
    stage : {"early", "late"}
    reading : {"endpoints", "edge-points"}
    source : {"vision", "fused"}
    distance : (n,) array
        That of the envelope, m.
    size : (f, n, k) array
        Magnitude of the error, m and rad; infinite without a solution, NaN where the flight does not count.
    reached : (n,) int array
        Flights that are in the stage there, with a solution or without.
    """

    stage: StageName
    reading: Reading
    source: Source
    distance: Array
    size: Array
    reached: NDArray[np.int_]


def flown_errors(scenario: Scenario, rows: Sequence[Row], reading: Reading) -> tuple[FlownErrors, ...]:
    """The errors behind each of `envelopes`, in its order; parameters and exceptions are the same."""
    flown = of_reading(rows, reading)
    result = []
    for stage, inside, ranges in _stages(scenario, flown, reading):
        for source in SOURCES:
            errors = _errors(flown, stage, source)
            counted = _counted(errors, source, inside)
            size = np.where(np.isnan(errors), np.inf, np.abs(errors))
            size = np.where(counted[..., None], size, np.nan)[:, ranges]
            distance = np.asarray(flown[0]["distance_m"], dtype=float)[ranges]
            result.append(FlownErrors(stage, reading, source, distance, size, inside.sum(axis=0)[ranges]))
    return tuple(result)


def _stages(scenario: Scenario, flown: Sequence[Row], reading: Reading) -> Iterator[tuple[StageName, Inside, Ranges]]:
    """The stages that have ranges, with which flights are in them where."""
    if not flown:
        raise ValueError(f"no flight with {reading}")
    distance = np.asarray(flown[0]["distance_m"], dtype=float)
    if any(not np.array_equal(row["distance_m"], distance) for row in flown):
        raise ValueError("the rows' distances differ")
    lowest = 0.0 if scenario.study is None else scenario.study.end_height_m
    height = _stack(flown, "true_height_m")
    touchdown = np.array([np.inf if row["touchdown_time_s"] is None else row["touchdown_time_s"] for row in flown])
    airborne = (_stack(flown, "time_s") < touchdown[:, None]) & (height >= lowest)
    for stage, number in STAGES.items():
        inside = airborne & (_stack(flown, "stage") == number)
        ranges = np.flatnonzero(inside.mean(axis=0) >= SHARE)
        if ranges.size:
            yield stage, inside, ranges


def attitude_errors(rows: Sequence[Row], distance: float, source: Source = "fused") -> Array:
    """Errors of roll, pitch and yaw (m, 3), rad, of the flights that have them at one of the rows' distances (m).

    Raises
    ------
    ValueError
        If the rows do not have that distance.
    """
    result = []
    for row in rows:
        at = np.flatnonzero(np.isclose(row["distance_m"], distance, rtol=0.0, atol=1e-6))
        if not at.size:
            raise ValueError(f"the flights have no errors at {distance:g} m")
        result.append([row[f"{source}_error_{name}_deg"][at[0]] * DEG for name in ATTITUDE])
    errors = np.array(result, dtype=float).reshape(-1, 3)
    return np.asarray(errors[np.isfinite(errors).all(axis=1)])


def _stack(rows: Sequence[Row], name: str) -> Array:
    """An array of each row, as (flights, distances)."""
    return np.array([row[name] for row in rows], dtype=float)


def _errors(rows: Sequence[Row], stage: StageName, source: Source) -> Array:
    """Of every flight at every distance, (flights, distances, k), SI."""
    return np.stack(
        [_stack(rows, f"{source}_error_{QUANTITIES[q].column}") * QUANTITIES[q].scale for q in OF_STAGE[stage]],
        axis=-1,
    )


def _counted(errors: Array, source: Source, inside: Inside) -> Inside:
    """Which flights count where: a filter has to run, a frame without a solution is one all the same."""
    return inside if source == "vision" else inside & np.isfinite(errors).all(axis=-1)


def _envelope(
    rows: Sequence[Row],
    stage: StageName,
    reading: Reading,
    source: Source,
    inside: Inside,
    ranges: Ranges,
    sigma: Array,
) -> Envelope:
    """One envelope."""
    names = OF_STAGE[stage]
    errors = _errors(rows, stage, source)
    counted = _counted(errors, source, inside)
    spread = [percentiles(errors[counted[:, i], i]) for i in ranges]
    return Envelope(
        stage=stage,
        reading=reading,
        source=source,
        roll_error=0.0,
        quantities=names,
        distance=np.asarray(rows[0]["distance_m"], dtype=float)[ranges],
        time=_mean(_stack(rows, "time_s"), inside)[ranges],
        height=_mean(_stack(rows, "true_height_m"), inside)[ranges],
        count=counted[:, ranges].sum(axis=0),
        percentiles=np.array(spread),
        sigma=sigma,
        single=np.where(inside[0, ranges, None], errors[0, ranges], np.nan),
    )


def _mean(values: Array, inside: Inside) -> Array:
    """Over the flights that are inside, (distances,); NaN where there are none."""
    number = inside.sum(axis=0)
    total = np.where(inside, values, 0.0).sum(axis=0)
    return np.asarray(np.divide(total, number, out=np.full(number.shape, np.nan), where=number > 0))


def _root_mean_square(values: Array) -> Array:
    """Over the flights (flights, n, k) that have a number, (n, k); NaN where none has."""
    known = np.isfinite(values)
    squares = [_mean(values[..., j] ** 2, known[..., j]) for j in range(values.shape[-1])]
    return np.asarray(np.sqrt(np.stack(squares, axis=-1)))


def _own_sigma(rows: Sequence[Row], stage: StageName, inside: Inside, ranges: Ranges) -> Array:
    """The filter's own, (n, k), SI."""
    sigma = np.stack(
        [_stack(rows, f"sigma_{QUANTITIES[q].column}") * QUANTITIES[q].scale for q in OF_STAGE[stage]], axis=-1
    )
    return _root_mean_square(np.where(inside[..., None], sigma, np.nan)[:, ranges])


def _first_order(
    scenario: Scenario, rows: Sequence[Row], stage: StageName, reading: Reading, inside: Inside, ranges: Ranges
) -> Array:
    """Of a vision pose at the poses flown, (n, k), SI."""
    settings, runway = scenario.camera, runway_of(scenario)
    camera = camera_of(settings)
    result = np.full((len(rows), ranges.size, len(OF_STAGE[stage])), np.nan)
    for one, row in enumerate(rows):
        there = np.flatnonzero(inside[one, ranges])
        at = ranges[there]
        position = np.stack((row["true_along_m"][at], row["true_cross_m"][at], -row["true_height_m"][at]), axis=-1)
        angles = np.stack([row[f"true_{name}_deg"][at] * DEG for name in ATTITUDE], axis=-1)
        rotation = np.array([_camera_axes(*three) for three in angles]).reshape(-1, 3, 3)
        ends = [
            look(camera, runway, where, axes, settings.near_m, settings.min_line_px)
            for where, axes in zip(position, rotation, strict=True)
        ]
        frames = Frames(stage, row["time_s"][at], position, angles[:, 1], rotation, np.array(ends).reshape(-1, 3, 4))
        result[one, there] = first_order(
            camera, frames, reading, settings.point_spacing_px, settings.noise_px, runway.width
        )
    return _root_mean_square(result)


def _camera_axes(roll: float, pitch: float, yaw: float) -> Array:
    """R_cam_from_runway (3, 3) of a triad's angles (rad): its rows are right, down and forward."""
    forward, right, down = np.reshape(from_euler(roll, pitch, yaw), (3, 3)).T
    return np.stack((right, down, forward))
