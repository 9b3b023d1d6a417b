"""Fixtures shared by the tests."""

import os

# Before numpy is imported anywhere: the filter's small matrices are slower on several threads.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import hypothesis
import numpy as np
import pytest

from landsim.log import COLUMNS, QUANTITIES, Log
from landsim.resources import shipped_aircraft

# The same examples every time, and no clock: a busy machine must not decide.
hypothesis.settings.register_profile(
    "landsim",
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow, hypothesis.HealthCheck.function_scoped_fixture],
)
hypothesis.settings.load_profile("landsim")


@dataclass(frozen=True)
class FakeFlight:
    """What a flight leaves, without flying."""

    metrics: dict[str, Any]
    log: Log


def fake_flight(scenario: str = "landing", seed: int = 0) -> FakeFlight:
    """A flight of three rows, with NaN in places, and metrics of every kind."""
    nan = float("nan")
    log = {column.name: np.array([i + 0.125, nan, -1e-300]) for i, column in enumerate(COLUMNS)}
    navigation = {
        source: {
            quantity: {
                "rms": np.float64(scale),
                "p95": 2.0 * scale,
                "frames": 700,
                "paired_rms": 0.5 * scale,
                "paired_frames": 640 + i,
            }
            for i, quantity in enumerate(QUANTITIES)
        }
        for source, scale in (("vision", 1.5), ("fused", 0.25))
    }
    metrics: dict[str, Any] = {
        "scenario": scenario,
        "seed": seed,
        "outcome": "landed",
        "reason": "stopped on the runway",
        "in_box": False,
        "box": {
            "along_min_m": {"value": 265.2, "limit": 100.0, "ok": True, "margin": 165.2},
            "along_max_m": {"value": 265.2, "limit": 450.0, "ok": True, "margin": 184.8},
            "cross_max_m": {"value": 0.3125, "limit": 2.0, "ok": True, "margin": 1.6875},
            "sink_max_mps": {"value": 1.25, "limit": 1.0, "ok": False, "margin": -0.25},
        },
        "touchdown": {
            "time_s": 30.0,
            "x_m": 265.2,
            "y_m": -0.3125,
            "sink_rate_mps": 1.25,
            "ground_speed_mps": 37.1,
            "pitch_deg": 2.6,
            "bank_deg": 0.1,
            "heading_error_deg": nan,
        },
        "stop": {"x_m": 612.0, "y_m": 0.2, "time_s": 45.0},
        "tracking": {
            "glide_slope_m": {"rms": 0.5, "p95": 1.0},
            "localizer_m": {"rms": 1.2, "p95": 4.0},
            "glide_slope_to_flare_m": {"rms": 0.25, "p95": 0.75},
        },
        "navigation": navigation,
        "consistency": {"early": {"nees9_mean": 9.1, "nees15_mean": nan, "frames": np.int64(600)}},
        "wall_time_s": 0.5,
        "versions": {"landsim": "0"},
    }
    return FakeFlight(metrics, log)


@pytest.fixture
def no_flying(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The simulation and the pictures replaced by stand-ins; the list gathers the seeds that were flown."""
    seeds: list[int] = []

    def fly(scenario: Any, seed: int = 0) -> FakeFlight:
        seeds.append(seed)
        return fake_flight(scenario.name, seed)

    def draw_run(folder: Path, scenario: Any, log: Log, metrics: dict[str, Any]) -> list[Path]:
        path = folder / "profile.png"
        path.write_bytes(b"picture")
        return [path]

    for name, function in (("simulate", fly), ("report", draw_run)):
        module = ModuleType(f"landsim.{name}")
        setattr(module, function.__name__, function)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return seeds


@pytest.fixture
def aircraft_copy(tmp_path: Path) -> Callable[[str], Path]:
    """Makes a copy of the shipped aircraft, in a folder of the given name below the test's own."""

    def copy(name: str) -> Path:
        return Path(shutil.copytree(shipped_aircraft()["pioneer"], tmp_path / name))

    return copy
