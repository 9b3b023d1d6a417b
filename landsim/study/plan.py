"""What a study looks at, and whether it can."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landsim.config import Scenario, StudyConfig
from landsim.errors import ScenarioError
from landsim.study.frames import Frames, at_distances, straight_approach
from landsim.study.model import StageName

LEAST_NOISE_PX = 1e-6
"""Below it, errors are those of rounding."""


@dataclass(frozen=True)
class Plan:
    """What is looked at.

    Attributes
    ----------
    scenario : Scenario
    frames, listed : tuple of Frames
        Of the studied stages, all of them and those at the listed ranges; none listed where nothing is sampled.
    late : Frames
        Of the late stage, studied or not; may be empty.
    """

    scenario: Scenario
    frames: tuple[Frames, ...]
    listed: tuple[Frames, ...]
    late: Frames

    @property
    def study(self) -> StudyConfig:
        """The scenario's."""
        assert self.scenario.study is not None
        return self.scenario.study


def plan_of(scenario: Scenario) -> Plan:
    """The frames of a study, once it is known that there are any.

    Raises
    ------
    ScenarioError
        If the lines are without noise; if the straight approach does not have a stage, or if a listed range is not in
        one: the lines that the stage needs are not in the image there, or the approach does not pass it.
    ValueError
        If the scenario is not a study.
    """
    study = scenario.study
    if study is None:
        raise ValueError(f"{scenario.name}: a scenario of the kind {scenario.kind!r} is not studied")
    if scenario.camera.noise_px < LEAST_NOISE_PX:
        raise ScenarioError(
            f"{scenario.path}: camera.noise_px: must be at least {LEAST_NOISE_PX:g} to be studied, not"
            f" {scenario.camera.noise_px:g}: without noise there are no errors"
        )
    wanted: tuple[StageName, ...] = ("early", "late") if study.stage == "both" else (study.stage,)
    both = straight_approach(scenario)
    frames = tuple(f for f in both if f.stage in wanted)
    for stage in frames:
        if not stage.seen().any():
            raise ScenarioError(
                f"{scenario.path}: study.stage: the straight approach shows the lines of the {stage.stage} stage in no"
                " frame; another start, camera pitch or runway"
            )
    if study.method == "flights":
        return Plan(scenario, frames, (), both[1])
    over = both[1].distance[0] if len(both[1]) else -np.inf
    last = (both[1] if len(both[1]) else both[0]).distance[-1]
    by_stage: dict[StageName, list[float]] = {name: [] for name in wanted}
    for distance in study.ranges_m:
        name: StageName = "early" if distance > over else "late"
        if name not in wanted or not last <= distance <= -scenario.start.along_m:
            raise ScenarioError(_not_there(scenario, frames, distance))
        by_stage[name].append(distance)
    listed = tuple(at_distances(scenario, of, ranges) for of, ranges in by_stage.items() if ranges)
    for part in listed:
        for distance, there in zip(part.distance.tolist(), part.seen().tolist(), strict=True):
            if not there:
                raise ScenarioError(_not_there(scenario, frames, distance))
    return Plan(scenario, frames, listed, both[1])


def _not_there(scenario: Scenario, frames: Sequence[Frames], distance: float) -> str:
    spans = " and ".join(f"{f.distance[0]:.1f} to {f.distance[-1]:.1f} m ({f.stage})" for f in frames)
    return f"{scenario.path}: study.ranges_m: must be within {spans}, not {distance:g}"
