"""A whole landing, as a ratio to JSBSim stepping the same aircraft and systems through the same landing alone.

Alone means from the recorded inputs of its systems: nothing is read, no sensor, filter or guidance runs.
"""

import statistics
import sys
import time
from typing import Any

import pytest
from numpy.random import SeedSequence, default_rng

import landsim
from landsim.plant import Plant
from landsim.scene import runway_of
from landsim.simulate import draw_start

ROUNDS = 7


@pytest.mark.benchmark(group="landing")
def test_landing(benchmark: Any, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = landsim.load_scenario("landing")
    aircraft = scenario.aircraft_config
    inputs: list[tuple[str, tuple[Any, ...]]] = []
    with pytest.MonkeyPatch.context() as patch:  # the first flight also warms everything up
        for name in ("feed", "command"):
            original = getattr(Plant, name)

            def recorded(plant: Plant, *given: Any, name: str = name, original: Any = original) -> None:
                inputs.append((name, given))
                original(plant, *given)

            patch.setattr(Plant, name, recorded)
        landsim.fly(scenario, seed=0)
    steps = sum(name == "feed" for name, _ in inputs)
    start = draw_start(scenario, default_rng(SeedSequence(0).spawn(5)[0]))
    alone: list[float] = []
    landings: list[float] = []

    def fly_alone() -> None:
        plant = Plant(aircraft.folder, aircraft.model, runway_of(scenario), scenario.simulation.rate_hz)
        plant.start(start)
        run, feed, command = plant._fdm.run, plant.feed, plant.command
        began = time.perf_counter()
        for name, given in inputs:
            if name == "command":
                command(*given)
            else:
                feed(*given)
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
