"""A whole landing, as a ratio to JSBSim stepping the same aircraft and systems for as many steps alone."""

import statistics
import sys
import time
from typing import Any

import pytest

import landsim
from landsim.plant import Plant
from landsim.simulate import runway_of
from landsim.truth import InitialState
from landsim.units import DEG

ROUNDS = 7
HIGH = 1500.0
"""Height at which JSBSim flies alone, m: at its trimmed 3° down it meets no ground."""


@pytest.mark.benchmark(group="landing")
def test_landing(benchmark: Any, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = landsim.load_scenario("landing")
    aircraft = scenario.aircraft_config
    steps = len(landsim.fly(scenario, seed=0).log["time_s"]) - 1  # the first flight also warms everything up
    alone: list[float] = []
    landings: list[float] = []

    def fly_alone() -> None:
        plant = Plant(aircraft.folder, aircraft.model, runway_of(scenario), scenario.simulation.rate_hz)
        plant.start(InitialState((-1000.0, 0.0, -HIGH), aircraft.speeds.approach_mps, 0.0, -3.0 * DEG))
        run = plant._fdm.run
        began = time.perf_counter()
        for _ in range(steps):
            run()
        alone.append(time.perf_counter() - began)

    def land() -> Any:
        began = time.perf_counter()
        flight = landsim.fly(scenario, seed=0)
        landings.append(time.perf_counter() - began)
        return flight

    # the setup is called before every round, so that the two alternate and share what else the machine does
    flight = benchmark.pedantic(land, setup=fly_alone, rounds=ROUNDS)
    assert flight.metrics["outcome"] == "landed"
    ratios = [a / b for a, b in zip(landings, alone, strict=True)]
    ratio = statistics.median(ratios)
    benchmark.extra_info.update(
        steps=steps,
        jsbsim_ms=1e3 * statistics.median(alone),
        landing_ms=1e3 * statistics.median(landings),
        ratio_median=ratio,
        ratio_min=min(ratios),
        ratio_max=max(ratios),
    )
    with capsys.disabled():
        sys.stdout.write(
            f"\n{'':24}{'median ms':>12}{'us a step':>12}\n"
            + "".join(
                f"{name:24}{1e3 * value:12.1f}{1e6 * value / steps:12.2f}\n"
                for name, value in (
                    ("landing", statistics.median(landings)),
                    ("JSBSim alone", statistics.median(alone)),
                )
            )
            + f"ratio {ratio:.2f} ({min(ratios):.2f} to {max(ratios):.2f}, {ROUNDS} pairs, {steps} steps)\n"
        )
