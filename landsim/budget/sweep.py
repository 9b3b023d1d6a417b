"""The precision needed when one thing about the camera, the runway or the approach is another."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from landsim.budget.requirements import Requirement
from landsim.budget.setting import Setting, setting_of, stage_at, why_not_seen
from landsim.budget.solve import needed_noise
from landsim.budget.typed import taken_apart
from landsim.config import Scenario
from landsim.errors import InputError, did_you_mean, what_is_wrong
from landsim.schema import CameraConfig, RunwayConfig, Section
from landsim.study.model import Reading, StageName
from landsim.units import DEG

VALUES = 61
"""Of a parameter, in a sweep that does not say how many."""
MOST_VALUES = 10_000


class Parameter(NamedTuple):
    """Something that can be swept."""

    name: str
    key: str
    """Its dotted key, as another name for it; empty if it has none."""
    label: str
    unit: str
    low: float
    high: float
    """Ends of the sweep that does not say them, in terms of the present value if that is not zero by rule."""
    logarithmic: bool = True
    whole: bool = False


PARAMETERS: dict[str, Parameter] = {
    p.name: p
    for p in (
        Parameter("focal-length", "camera.focal_length_mm", "focal length", "mm", 0.5, 4.0),
        Parameter("image-size", "", "image width, same pixels and shape", "px", 0.5, 4.0, whole=True),
        Parameter("runway-width", "runway.width_m", "runway width", "m", 0.5, 2.5),
        Parameter("runway-length", "runway.length_m", "runway length", "m", 0.125, 2.0),
        Parameter("tilt", "", "camera tilt below the runway's plane", "°", 0.0, 20.0, logarithmic=False),
        Parameter("resolution", "", "image width, same field of view", "px", 0.5, 8.0, whole=True),
        Parameter("image-width", "camera.width_px", "image width, same pixels", "px", 0.5, 4.0, whole=True),
        Parameter("image-height", "camera.height_px", "image height, same pixels", "px", 0.5, 4.0, whole=True),
    )
}
"""By name."""
DEFAULT_SWEEPS = ("focal-length", "image-size", "runway-width", "runway-length", "tilt")
"""What is swept if nothing is named."""


class SweepOrder(NamedTuple):
    """What to sweep."""

    parameter: Parameter
    low: float | None
    high: float | None
    """None for the parameter's own ends."""
    values: int
    source: str
    """Where it was given, for messages."""


class Sweep(NamedTuple):
    """The precision needed by value of a parameter."""

    parameter: Parameter
    values: list[float]
    present: dict[str, float]
    """The scenario's own value, by stage: they differ for the tilt alone."""
    needed: dict[Reading, list[list[float]]]
    """px, by reading: a list a requirement, of a number a value; NaN where there is no pose, 0 where the roll error
    alone breaks the bound."""


def parse_sweep(text: str) -> SweepOrder:
    """A sweep from ``name``, ``name=low:high`` or ``name=low:high:values``, where a dotted key stands for its name too.

    Raises
    ------
    InputError
        If it is none.
    """
    what, name, rest = taken_apart("sweep", text)
    keys = {p.key: p for p in PARAMETERS.values() if p.key} | PARAMETERS
    parameter = keys.get(name)
    if parameter is None:
        raise InputError(f'{what}: nothing called "{name}" can be swept{did_you_mean(name, list(keys))}')
    if rest is None:
        return SweepOrder(parameter, None, None, VALUES, what)
    right = f"must be {name}=low:high or {name}=low:high:values, in {parameter.unit}"
    parts = [part.strip() for part in rest.split(":")]
    if len(parts) not in {2, 3}:
        raise InputError(f"{what}: {right}")
    try:
        low, high = float(parts[0]), float(parts[1])
        values = int(parts[2]) if len(parts) == 3 else VALUES
    except ValueError:
        raise InputError(f"{what}: {right}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"{what}: low must be below high, not {parts[0]}:{parts[1]}")
    if parameter.name == "tilt" and not -45.0 <= low < high <= 45.0:
        raise InputError(f"{what}: a tilt must be within ±45°, not {parts[0]}:{parts[1]}")
    if parameter.logarithmic and low <= 0.0:
        raise InputError(f"{what}: low must be above 0, not {parts[0]}")
    if not 2 <= values <= MOST_VALUES:
        raise InputError(f"{what}: must have 2 to {MOST_VALUES} values, not {values}")
    return SweepOrder(parameter, low, high, values, what)


def sweep(
    scenario: Scenario,
    setting: Setting,
    requirements: Sequence[Requirement],
    stages: Sequence[StageName],
    confidence: float,
    order: SweepOrder,
    tick: Callable[[], None] = lambda: None,
) -> Sweep:
    """The precision that each requirement needs, by value of a parameter.

    The stage at each range is found anew for each value, but for the tilt, which is that of the requirement's stage.

    Parameters
    ----------
    scenario : Scenario
    setting : Setting
        Of the scenario.
    requirements : sequence of Requirement
        Each with a distance.
    stages : sequence of {"early", "late"}
        Of each requirement in the setting.
    confidence : float
        Share of the frames within a bound.
    order : SweepOrder
    tick : callable
        Called after each value.

    Raises
    ------
    InputError
        If a value is none that the scenario could have.
    """
    parameter = order.parameter
    present = {"early": present_value(scenario, setting, parameter, "early")}
    present["late"] = present_value(scenario, setting, parameter, "late")
    settings = list(_settings(scenario, setting, order, present["early"]))  # refused before anything is worked out
    needed: dict[Reading, list[list[float]]] = {
        "endpoints": [[] for _ in requirements],
        "edge-points": [[] for _ in requirements],
    }
    for _, other in settings:
        of = list(stages) if parameter.name == "tilt" else [_stage(other, requirement) for requirement in requirements]
        for reading, column in needed_noise(other, requirements, of, confidence).items():
            for row, value in zip(needed[reading], column, strict=True):
                row.append(value)
        tick()
    return Sweep(parameter, [value for value, _ in settings], present, needed)


def present_value(scenario: Scenario, setting: Setting, parameter: Parameter, stage: StageName) -> float:
    """The scenario's own value of a parameter, in its unit."""
    if parameter.name == "tilt":
        return 0.0 - setting.pitch(stage) / DEG
    if not parameter.key:
        return float(scenario.camera.width_px)
    section, _, key = parameter.key.partition(".")
    return float(getattr(getattr(scenario, section), key))


def _stage(setting: Setting, requirement: Requirement) -> StageName | None:
    distance = requirement.distance
    return None if distance is None or why_not_seen(setting, distance) else stage_at(setting, distance)


def _settings(
    scenario: Scenario, setting: Setting, order: SweepOrder, present: float
) -> Iterator[tuple[float, Setting]]:
    """Each value with its setting."""
    parameter = order.parameter
    scale = present if parameter.logarithmic else 1.0
    low = parameter.low * scale if order.low is None else order.low
    high = parameter.high * scale if order.high is None else order.high
    values = np.geomspace(low, high, order.values) if parameter.logarithmic else np.linspace(low, high, order.values)
    if parameter.whole:
        values = np.unique(np.maximum(np.round(values), 1.0))
    for value in values.tolist():
        yield value, _with(scenario, setting, parameter, value, order)


def _with(scenario: Scenario, setting: Setting, parameter: Parameter, value: float, order: SweepOrder) -> Setting:
    camera = scenario.camera
    changed: dict[str, Any]
    if parameter.name == "tilt":
        return replace(setting, pitch_early=-value * DEG, pitch_late=-value * DEG)
    if parameter.name == "image-size":
        shape = camera.height_px / camera.width_px
        changed = {"camera": {"width_px": int(value), "height_px": max(1, round(shape * value))}}
    elif parameter.name == "resolution":
        finer = camera.width_px / value
        height = max(1, round(camera.height_px / finer))
        changed = {"camera": {"width_px": int(value), "height_px": height, "pixel_um": camera.pixel_um * finer}}
    else:
        section, _, key = parameter.key.partition(".")
        changed = {section: {key: int(value) if parameter.whole else value}}
    sections = {name: _changed(getattr(scenario, name), name, keys, order) for name, keys in changed.items()}
    other = setting_of(scenario.model_copy(update=sections), setting.roll_error)
    return replace(other, pitch_early=setting.pitch_early, pitch_late=setting.pitch_late)


def _changed(section: Section, name: str, keys: dict[str, Any], order: SweepOrder) -> Section:
    """A section with other values, checked as those of a file are."""
    model: type[CameraConfig | RunwayConfig] = CameraConfig if name == "camera" else RunwayConfig
    try:
        return model.model_validate(section.model_dump() | keys)
    except ValidationError as failure:
        error = failure.errors(include_url=False)[0]
        key = ".".join((name, *map(str, error["loc"])))
        raise InputError(f"{order.source}: {key}: {what_is_wrong(dict(error))}") from None
