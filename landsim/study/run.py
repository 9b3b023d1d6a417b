"""A whole study: its work cut into tasks, done in processes, and put together again in order.

Everything random comes from the study's seed by the task's own place in it, so the result does not depend on how many
processes there are, nor on which was faster.  Only the measured times differ from run to run.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.random import SeedSequence

from estimator.so3 import Array
from landsim.batch.pool import cores
from landsim.batch.row import Row, distances_of, flight_row
from landsim.config import Scenario, StudyConfig
from landsim.errors import InputError
from landsim.plain import as_json
from landsim.sensors import camera_of, number_of_points
from landsim.study.envelope import child, first_order, joined, sampled_rolls
from landsim.study.flights import as_flight, attitude_errors, envelopes, of_reading
from landsim.study.frames import Frames
from landsim.study.geometry import RollLimit, proportions, roll_bias, roll_limit
from landsim.study.judged import bounds_of
from landsim.study.model import OF_STAGE, Envelope, Reading, StageName
from landsim.study.paragraphs import paragraphs_of
from landsim.study.peers import DRAWS as PEER_DRAWS
from landsim.study.peers import peers
from landsim.study.plan import Plan, plan_of
from landsim.study.precision import required_precision
from landsim.study.tasks import Progress, Task, processes, run_tasks
from landsim.study.tilt import tilt
from landsim.study.timing import timing
from landsim.study.translations import translations
from landsim.study.verdict import verdict_of
from landsim.units import DEG
from landsim.versions import versions

NUMBERS_PER_SECOND = 2.5e7
"""Roughly, that are drawn and fitted: for the progress alone."""
FLIGHT_SECONDS = 0.5
"""Roughly."""
TASK_SECONDS = 0.5
"""Of sampling, roughly, in one task."""
LAST_SECONDS = 3.5
"""Of what waits for the flights, roughly."""
LARGEST_SEED = 2**63 - 1
"""That a table can hold."""
EXAMPLE_ROLL = 0.2 * DEG
"""Whose effect is told where the study states none."""
PROPORTION_DRAWS = 5000
"""At each listed range."""

# Places of the work in the study's seed; the next, 6, is `landsim.study.verdict.RESAMPLING`.
_FRAMES, _LISTED, _PRECISION, _ROLL, _PROPORTION, _CLAIMS = range(6)


@dataclass(frozen=True)
class StudyResult:
    """What a study leaves.

    Attributes
    ----------
    scenario : Scenario
    seed : int
    envelopes : tuple of Envelope
        By frame, as sampled, or by distance over the flights.
    listed : tuple of Envelope
        At ``study.ranges_m``, with ``study.listed_draws``; none if nothing is sampled.
    rows : tuple of dict
        The flights, see `landsim.batch.row.flight_row`.
    verdict : dict
        As in verdict.json.
    """

    scenario: Scenario
    seed: int
    envelopes: tuple[Envelope, ...]
    listed: tuple[Envelope, ...]
    rows: tuple[Row, ...]
    verdict: dict[str, Any]


def run_study(
    scenario: Scenario, seed: int = 0, progress: Progress | None = None, workers: int | None = None
) -> StudyResult:
    """Sample, fly and judge.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``study``.
    seed : int
        Not negative.  Flights have seeds from it on.
    progress : callable, optional
        Told how much is done, of how much, and what.
    workers : int, optional
        Processes; as many as there are cores by default.

    Returns
    -------
    StudyResult

    Raises
    ------
    InputError
        Before anything is done, if the study cannot be made as its scenario says, or if the seed is too large.
    """
    began = time.perf_counter()
    plan = plan_of(scenario)
    study, root = plan.study, SeedSequence(seed)
    if seed + study.flights > LARGEST_SEED:
        raise InputError(f"seed: must leave room for {study.flights} flights below {LARGEST_SEED}, not {seed}")
    flying = [
        Task(flight_row, (as_flight(scenario, reading), seed + i, distances_of(scenario)), FLIGHT_SECONDS, "flying")
        for reading in study.readings
        for i in range(study.flights)
    ]
    work = {
        "flights": flying,
        "precision": _precision_tasks(plan, root),
        "listed": _sampling_tasks(plan.listed, study.listed_draws, plan, child(root, _LISTED)),
        "frames": _sampling_tasks(plan.frames, study.draws, plan, child(root, _FRAMES)),
        "roll": _roll_tasks(plan, root),
        "proportion": _proportion_tasks(plan, root),
    }
    claimed = [child(root, _CLAIMS, i) for i in range(3)]
    work |= {
        "peers": [Task(partial(peers, draws=min(study.draws, PEER_DRAWS)), (scenario, claimed[1]), 8.0, "peers")],
        "tilt": [Task(partial(tilt, draws=study.draws), (scenario, claimed[2]), 8.0, "tilting the camera")],
    }
    tasks = [task for part in work.values() for task in part]
    total, done = sum(task.weight for task in tasks) + LAST_SECONDS, 0.0

    def finished(task: Task) -> None:
        nonlocal done
        done += task.weight
        if progress is not None:
            progress(done, total, task.what)

    if progress is not None:
        progress(0.0, total, tasks[0].what)
    with processes(min(cores() if workers is None else workers, len(tasks))) as executor:
        results = iter(run_tasks(tasks, executor, finished))
        found = {name: [next(results) for _ in part] for name, part in work.items()}
        rows: list[Row] = found["flights"]
        last = Task(
            partial(translations, draws=study.listed_draws),
            (scenario, claimed[0], _filter_errors(plan, rows)),
            LAST_SECONDS,
            "comparing translations",
        )
        (compared,) = run_tasks([last], executor, finished)
    flown = [e for reading in study.readings if rows for e in envelopes(scenario, rows, reading)]
    stages = {f.stage for f in plan.frames}
    if study.method == "flights":
        by_range = [e for e in flown if e.stage in stages]
    else:
        by_range = _whole(found["frames"]) + [e for e in flown if e.stage in stages and e.source == "fused"]
    listed = _whole(found["listed"])
    verdict = verdict_of(
        scenario,
        seed,
        by_range,
        listed,
        precisions=[p for p in found["precision"] if p is not None],
        roll_limits=[limit for part in found["roll"] for limit in part],
        shifts=_shifts(plan),
        found=[p for part in found["proportion"] for p in part],
        rows=rows,
        flown=flown,
    )
    verdict["paragraphs"] = paragraphs_of(verdict)
    verdict["claims"] = {
        "translations": compared,
        "peers": found["peers"][0],
        "timing": timing(scenario),  # when nothing else runs
        "tilt": found["tilt"][0],
    }
    verdict["versions"] = versions("opencv-python-headless", "poselib")
    verdict["wall_time_s"] = time.perf_counter() - began
    return StudyResult(scenario, seed, tuple(by_range), tuple(listed), tuple(rows), as_json(verdict))


def _sampling_tasks(parts: Sequence[Frames], draws: int, plan: Plan, seed: SeedSequence) -> list[Task]:
    """Chunks of frames of a like number of points, for each stage and reading."""
    study, settings = plan.study, plan.scenario.camera
    if study.method == "flights":
        return []
    tasks = []
    for frames in parts:
        lengths = np.nansum(
            np.hypot(frames.ends[..., 2] - frames.ends[..., 0], frames.ends[..., 3] - frames.ends[..., 1]), axis=1
        )
        rolls = _rolls(study, frames.stage)
        for number, reading in enumerate(study.readings):
            points = np.array([number_of_points(length, reading, settings.point_spacing_px) for length in lengths])
            seconds = (2.0 * points + 150.0 * len(rolls)) * draws / NUMBERS_PER_SECOND
            chunk = np.floor(np.cumsum(seconds) / TASK_SECONDS)
            own = child(seed, 0 if frames.stage == "early" else 1, number)
            for one in np.unique(chunk):
                indices = np.flatnonzero(chunk == one).tolist()
                arguments = (plan.scenario, frames, reading, draws, own, rolls, None, None, indices)
                tasks.append(Task(sampled_rolls, arguments, float(seconds[indices].sum()), "sampling"))
    return tasks


def _rolls(study: StudyConfig, stage: StageName) -> tuple[float, ...]:
    return (0.0,) if stage == "early" else tuple(angle * DEG for angle in study.roll_errors_deg)


def _whole(parts: Sequence[Sequence[Envelope]]) -> list[Envelope]:
    """The envelopes of which these are parts, in the order in which they first appear."""
    groups: dict[tuple[object, ...], list[Envelope]] = {}
    for part in parts:
        for envelope in part:
            groups.setdefault((envelope.stage, envelope.reading, envelope.roll_error), []).append(envelope)
    return [joined(group) for group in groups.values()]


def _precision_tasks(plan: Plan, root: SeedSequence) -> list[Task]:
    study = plan.study
    if study.method == "flights" or plan.scenario.camera.noise_px == 0.0:
        return []
    return [
        Task(
            required_precision,
            (plan.scenario, frames, name, reading, bound, child(root, _PRECISION, s, r, k)),
            1.0,
            "solving for the line precision",
        )
        for s, frames in enumerate(plan.frames)
        for r, reading in enumerate(study.readings)
        for k, (name, bound) in enumerate(bounds_of(study, frames.stage, OF_STAGE[frames.stage]).items())
    ]


def _roll_tasks(plan: Plan, root: SeedSequence) -> list[Task]:
    return [
        Task(roll_limits, (plan, reading, child(root, _ROLL, r)), 4.0, "solving for the roll error")
        for r, reading in enumerate(plan.study.readings)
        if plan.study.method == "sampling" and plan.frames[-1].stage == "late"
    ]


def roll_limits(plan: Plan, reading: Reading, seed: SeedSequence) -> list[RollLimit]:
    """The roll error up to which each bound of the late stage holds."""
    scenario, late, settings = plan.scenario, plan.late[plan.late.seen()], plan.scenario.camera
    sigma = first_order(
        camera_of(settings), late, reading, settings.point_spacing_px, settings.noise_px, scenario.runway.width_m
    )
    bounds = bounds_of(plan.study, "late", OF_STAGE["late"])
    return [
        roll_limit(scenario, late, sigma, name, bound, reading, plan.study.listed_draws, child(seed, k))
        for k, (name, bound) in enumerate(bounds.items())
    ]


def _proportion_tasks(plan: Plan, root: SeedSequence) -> list[Task]:
    return [
        Task(
            proportions,
            (plan.scenario, reading, frames.distance, PROPORTION_DRAWS, child(root, _PROPORTION, r)),
            0.6,
            "sampling",
        )
        for frames in plan.listed
        if frames.stage == "early"
        for r, reading in enumerate(plan.study.readings)
    ]


def _shifts(plan: Plan) -> list[tuple[float, float, float, float]]:
    """Distance, height, roll error and the cross estimate's shift by it, from the hand-over to the end."""
    if not plan.late.seen().any():
        return []
    seen = plan.late[plan.late.seen()]
    ends = [seen[[0, -1]]] if len(seen) > 1 else [seen]
    column = OF_STAGE["late"].index("cross")
    stated = tuple(angle for angle in _rolls(plan.study, "late") if angle != 0.0)
    result = []
    for frames in (*ends, *(part for part in plan.listed if part.stage == "late")):
        for roll_error in stated or (EXAMPLE_ROLL,):
            shift = roll_bias(plan.scenario, frames, roll_error)[:, column]
            result += [
                (float(d), float(h), roll_error, float(s))
                for d, h, s in zip(frames.distance, frames.height, shift, strict=True)
            ]
    return sorted(result, key=lambda one: (one[2], -one[0]))


def _filter_errors(plan: Plan, rows: Sequence[Row]) -> dict[tuple[Reading, float], Array] | None:
    """Attitude errors of the filter at the ranges of its rows, by reading and distance."""
    if not rows:
        return None
    found = {}
    for reading in plan.study.readings:
        flown = of_reading(rows, reading)
        for distance in flown[0]["distance_m"].tolist():
            errors = attitude_errors(flown, distance)
            if len(errors):
                found[reading, distance] = errors
    return found
