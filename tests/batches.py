"""Batches that cost nothing, flights that go wrong on order, and whether two tables of flights are the same."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from landsim.batch.engine import Engine, fly_batch
from landsim.batch.folder import open_batch
from landsim.batch.identity import Identity, Keep, Shard, identify
from landsim.batch.job import Job, Keeper, fly_job
from landsim.batch.row import ARRAYS, SCALARS, Row
from landsim.config import Scenario, load_scenario

SHORT = {"start.along_m": -260.0, "start.height_m": 21.2, "simulation.time_limit_s": 3.0}
"""Three seconds, begun near the runway."""
DRAWN = {
    "sampling": "random",
    "draw": [
        {"key": "camera.noise_px", "distribution": "uniform", "low": 0.2, "high": 0.8},
        {"key": "camera.tilt_error_deg", "distribution": "normal", "mean": 0.0, "sigma": 0.05},
    ],
}


def short(**overrides: object) -> Scenario:
    """A flight of three seconds."""
    return load_scenario("landing", overrides=SHORT | overrides)


def drawn(sampling: str = "random") -> Scenario:
    """The same with something drawn for each flight."""
    return short(dispersions=DRAWN | {"sampling": sampling})


def identity(scenario: Scenario, n: int, *, seed: int = 0, shard: str = "1/1", chunk: int = 4, **more: Any) -> Identity:
    settings: dict[str, Any] = {"keep": "none", "time_limit_s": 60.0} | more
    keep: Keep = settings["keep"]
    return identify(scenario, n, seed, Shard.parse(shard), keep, settings["time_limit_s"], chunk)


def made_up(scenario: Scenario, keeper: Keeper | None, job: Job) -> Row:
    """A row that was not flown."""
    rng = np.random.default_rng(job.seed)
    kinds: dict[type, Any] = {int: job.seed, float: float(rng.standard_normal()), str: f"σ {job.seed}", bool: True}
    arrays: dict[str, Any] = {name: rng.standard_normal(3) for name in ARRAYS}
    arrays["sigma_cross_m"][1] = np.nan
    scalars = {name: kinds[kind] for name, kind in SCALARS.items()}
    return {**scalars, **{f"draw.{key}": value for key, value in job.draws.items()}, **arrays, "index": job.index}


def spoiled(scenario: Scenario, keeper: Keeper | None, job: Job) -> Row:
    """The flight, but for one that raises, one that hangs, one that cannot be ended by Python, and one that is shot."""
    if job.index == 1:
        raise RuntimeError("wings fell off")
    if job.index == 3:
        time.sleep(3600.0)
    if job.index == 4:
        hang_without_python()
    if job.index == 6:
        os.kill(os.getpid(), signal.SIGKILL)
    return fly_job(scenario, keeper, job)


def hang_without_python() -> None:
    """Holds the interpreter's lock for as long as nobody ends the process."""
    sum(range(10**18))


def fly_into(
    folder: Path,
    scenario: Scenario,
    wanted: Identity,
    *,
    resume: bool = False,
    engine: Engine | None = None,
    **how: Any,
) -> None:
    """A batch, by threads of this process unless it says otherwise."""
    with open_batch(folder, scenario, wanted, resume=resume) as batch:
        if engine is None:
            with ThreadPoolExecutor(2) as pool:
                fly_batch(batch, scenario, Engine(pool, 3), **how)
        else:
            fly_batch(batch, scenario, engine, **how)
        batch.finish()


def table(folder: Path) -> pa.Table:
    return pq.read_table(folder / "flights.parquet")


def same(one: Path, other: Path) -> None:
    """Bit for bit in all columns but the wall time, in the same order."""
    equal(one / "flights.parquet", other / "flights.parquet")


def equal(one: Path, other: Path) -> None:
    first, second = (pq.read_table(path).combine_chunks() for path in (one, other))
    assert first.schema.equals(second.schema)
    assert first.num_rows == second.num_rows
    for name in first.column_names:
        if name == "wall_time_s":
            continue
        a, b = first[name], second[name]
        assert a.null_count == b.null_count, name
        if pa.types.is_list(a.type):
            assert a.combine_chunks().offsets.equals(b.combine_chunks().offsets), name
            a, b = (np.asarray(x.combine_chunks().values) for x in (a, b))
            assert a.tobytes() == b.tobytes(), name
        elif pa.types.is_floating(a.type):
            assert a.is_null().equals(b.is_null()), name
            assert a.to_numpy().tobytes() == b.to_numpy().tobytes(), name
        else:
            assert a.to_pylist() == b.to_pylist(), name
