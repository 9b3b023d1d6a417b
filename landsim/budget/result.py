"""A whole budget: what was asked, what it needs, and the sweeps, as plain data."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from numpy.random import SeedSequence

from landsim import __version__
from landsim.budget.course import course, held
from landsim.budget.drawn import CHECK_DRAWS, OF_CHECK, OF_HELD, OFF_BY, confirm, holds_when_drawn, seed_of
from landsim.budget.requirements import EXAMPLE, Requirement
from landsim.budget.setting import Setting, required_stage, setting_of, stage_at
from landsim.budget.solve import Need, moments, need
from landsim.budget.sweep import Sweep, SweepOrder, sweep
from landsim.config import Scenario
from landsim.errors import InputError
from landsim.schema import LARGEST
from landsim.study.model import READINGS, Reading, StageName
from landsim.units import DEG

LARGEST_ROLL_ERROR = 10.0 * DEG
"""No roll angle that is worth having is so wrong, rad."""
MOST_DRAWS = 1_000_000


class Order(NamedTuple):
    """What a budget is asked for."""

    requirements: tuple[Requirement, ...]
    confidence_percent: float = 95.0
    """Of the frames within each bound."""
    roll_error: float = 0.0
    """By which the roll angle given to the late stage is off, rad."""
    precision_px: float | None = None
    """σ of the points for which the ranges are asked; None if the precision is."""
    sweeps: tuple[SweepOrder, ...] = ()
    draws: int = 0
    """With which each need is confirmed; none if 0."""
    seed: int = 0
    """Of these draws and of those that first order is checked with."""


@dataclass(frozen=True)
class Row:
    """One requirement and what it needs.

    Attributes
    ----------
    requirement : Requirement
    stage : {"early", "late"} or None
        None, and ``needs`` empty, for a requirement without a distance.
    needs : dict
        By reading.
    trusted : dict
        By reading: whether drawing bears the need out; without an entry where no precision will do.
    inside : dict
        By reading: the share of the draws within the bound; empty if nothing was drawn.
    held : dict
        By reading: from and to where the bound holds, m; empty if no precision was given.
    held_trusted : dict
        By reading: whether drawing bears out both ends of each of these stretches.
    """

    requirement: Requirement
    stage: StageName | None
    needs: dict[Reading, Need]
    trusted: dict[Reading, bool]
    inside: dict[Reading, float]
    held: dict[Reading, list[tuple[float, float]]]
    held_trusted: dict[Reading, list[bool]]


@dataclass(frozen=True)
class Budget:
    """What came of it.

    Attributes
    ----------
    scenario : Scenario
    setting : Setting
    order : Order
    rows : tuple of Row
        A requirement each, in the order given.
    sweeps : tuple of Sweep
    hand_over : float or None
        Distance at which the threshold leaves the image, m; worked out with a precision alone.
    far, end : float or None
        Between which distances the bounds were looked at, m.
    """

    scenario: Scenario
    setting: Setting
    order: Order
    rows: tuple[Row, ...]
    sweeps: tuple[Sweep, ...]
    hand_over: float | None = None
    far: float | None = None
    end: float | None = None

    def binding(self, reading: Reading) -> int | None:
        """The row that needs the greatest precision, and so decides; None without one."""
        needs = {i: row.needs[reading].noise_px or 0.0 for i, row in enumerate(self.rows) if reading in row.needs}
        return min(needs, key=needs.__getitem__) if needs else None


def make_budget(scenario: Scenario, order: Order, tick: Callable[[str], None] = lambda _: None) -> Budget:
    """Work a budget out.

    Parameters
    ----------
    scenario : Scenario
        Of either kind: its camera, runway and approach count.
    order : Order
    tick : callable
        Told what was done, after each of `steps` of the order.

    Raises
    ------
    InputError
        If a requirement cannot be had where it is asked for, or a swept value is impossible.
    """
    _check(order)
    setting = setting_of(scenario, order.roll_error)
    confidence = order.confidence_percent / 100.0
    stages = [
        None if r.distance is None else required_stage(setting, r.quantity.name, r.distance, r.source)
        for r in order.requirements
    ]
    along = course(setting) if order.precision_px is not None else None
    rows = []
    for i, (requirement, stage) in enumerate(zip(order.requirements, stages, strict=True)):
        needs: dict[Reading, Need] = {}
        trusted: dict[Reading, bool] = {}
        inside: dict[Reading, float] = {}
        kept_trusted: dict[Reading, list[bool]] = {}
        kept: dict[Reading, list[tuple[float, float]]] = {}
        for reading in READINGS:
            if stage is not None:
                needs[reading] = found = need(setting, requirement, stage, reading, confidence)
                if found.noise_px is not None:
                    trusted[reading] = holds_when_drawn(
                        setting, requirement, stage, reading, found.noise_px, found.gain * found.noise_px, found.shift,
                        seed_of(order.seed, i, reading, OF_CHECK),
                    )  # fmt: skip
                if order.draws and found.noise_px is not None:
                    seed = seed_of(order.seed, i, reading)
                    drawn = confirm(setting, requirement, stage, reading, found.noise_px, order.draws, seed)
                    inside[reading] = drawn.inside
                    tick(f"drawing {requirement}")
            if along is not None and order.precision_px is not None:
                kept[reading] = held(along, requirement, reading, order.precision_px, confidence)
                seed = seed_of(order.seed, i, reading, OF_HELD)
                kept_trusted[reading] = [
                    all(_holds_at(setting, requirement, reading, order.precision_px, end, seed) for end in stretch)
                    for stretch in kept[reading]
                ]
        rows.append(Row(requirement, stage, needs, trusted, inside, kept, kept_trusted))
    sweeps = tuple(
        sweep(
            scenario,
            setting,
            order.requirements,
            [stage for stage in stages if stage is not None],
            confidence,
            one,
            lambda one=one: tick(f"sweeping {one.parameter.label}"),  # type: ignore[misc]
        )
        for one in order.sweeps
    )
    ends: dict[str, float | None] = {}
    if along is not None and along.distance.size:
        over = along.hand_over if math.isfinite(along.hand_over) else None
        ends = {"hand_over": over, "far": float(along.distance[0]), "end": float(along.distance[-1])}
    return Budget(scenario, setting, order, tuple(rows), sweeps, **ends)


def steps(order: Order) -> int:
    """How many times `make_budget` ticks at most."""
    drawn = sum(r.distance is not None for r in order.requirements) * len(READINGS) if order.draws else 0
    return drawn + sum(one.values for one in order.sweeps)


def as_dict(budget: Budget) -> dict[str, Any]:
    """The budget as in budget.json: units in the keys, NaN for what does not exist."""
    scenario, setting, order = budget.scenario, budget.setting, budget.order
    camera, runway = scenario.camera, scenario.runway
    result: dict[str, Any] = {
        "scenario": scenario.name,
        "confidence_percent": order.confidence_percent,
        "camera": {
            "focal_length_mm": camera.focal_length_mm,
            "pixel_um": camera.pixel_um,
            "width_px": camera.width_px,
            "height_px": camera.height_px,
            "noise_px": camera.noise_px,
            "point_spacing_px": camera.point_spacing_px,
            "min_line_px": camera.min_line_px,
            "pitch_early_deg": setting.pitch_early / DEG,
            "pitch_late_deg": setting.pitch_late / DEG,
        },
        "runway": {"width_m": runway.width_m, "length_m": runway.length_m},
        "approach": {
            "glide_slope_deg": setting.glide_slope / DEG,
            "threshold_height_m": setting.threshold_height,
            "cross_m": setting.cross,
            "roll_error_deg": setting.roll_error / DEG,
        },
        "requirements": [_row_as_dict(row, setting) for row in budget.rows],
        "binding": {reading: budget.binding(reading) for reading in READINGS},
        "sweeps": [_sweep_as_dict(one) for one in budget.sweeps],
        "checked": {"draws": CHECK_DRAWS, "seed": order.seed, "off_by_percent": 100.0 * OFF_BY},
        "versions": {"landsim": __version__},
    }
    if order.precision_px is not None:
        looked_at = {"far_m": budget.far, "hand_over_m": budget.hand_over, "end_m": budget.end}
        result["precision"] = {"noise_px": order.precision_px, **looked_at}
    if order.draws:
        result["confirmed"] = {"draws": order.draws, "seed": order.seed}
    return result


def _check(order: Order) -> None:
    """Whether the order's own numbers are possible, whatever the scenario is."""
    if not order.requirements:
        raise InputError(f"nothing is asked for: give bounds, such as --require {EXAMPLE}")
    for requirement in order.requirements:
        if requirement.distance is None and order.precision_px is None:
            raise InputError(f"{requirement.source}: the range is missing, as in {EXAMPLE}; with --precision it may be")
        if requirement.distance is None and order.sweeps:
            raise InputError(f"{requirement.source}: a sweep and its figure need a range, as in {EXAMPLE}")
    if not 0.0 < order.confidence_percent < 100.0:
        raise InputError(f"the confidence must be above 0 and below 100 %, not {order.confidence_percent:g}")
    if not abs(order.roll_error) <= LARGEST_ROLL_ERROR:
        limit = LARGEST_ROLL_ERROR / DEG
        raise InputError(f"the roll error must be within ±{limit:g}°, not {order.roll_error / DEG:g}")
    if order.precision_px is not None and not 0.0 < order.precision_px <= LARGEST:
        raise InputError(f"the precision must be a finite number of pixels above 0, not {order.precision_px:g}")
    if not 0 <= order.draws <= MOST_DRAWS:
        raise InputError(f"the draws must be 1 to {MOST_DRAWS}, not {order.draws}")


def _holds_at(
    setting: Setting, requirement: Requirement, reading: Reading, noise_px: float, distance: float, seed: SeedSequence
) -> bool:
    """Whether drawing bears first order out where a bound is kept with a σ of the points."""
    there, stage = requirement._replace(distance=distance), stage_at(setting, distance)
    if stage is None:
        return False
    gain, shift = moments(setting, there, stage, reading)
    return holds_when_drawn(setting, there, stage, reading, noise_px, gain * noise_px, shift, seed)


def _row_as_dict(row: Row, setting: Setting) -> dict[str, Any]:
    requirement, unit = row.requirement, row.requirement.quantity.unit
    scale = requirement.quantity.scale
    result: dict[str, Any] = {
        "quantity": requirement.quantity.name,
        f"bound_{unit}": requirement.bound / scale,
        "range_m": requirement.distance,
        "stage": row.stage,
        "height_m": None if requirement.distance is None else setting.height(requirement.distance),
    }
    for reading in READINGS:
        of: dict[str, Any] = {}
        if reading in row.needs:
            found = row.needs[reading]
            of |= {
                f"sigma_{unit}_per_px": found.gain / scale,
                f"roll_shift_{unit}": found.shift / scale,
                f"present_{unit}": found.now / scale,
                "needed_noise_px": found.noise_px,
                "first_order_holds": row.trusted.get(reading),
                "present_points": list(found.points_now),
            }
            if reading == "edge-points":
                of |= {
                    "needed_spacing_px": found.spacing_px,
                    "needed_points": None if found.points is None else list(found.points),
                }
        if reading in row.inside:
            of["inside_percent"] = 100.0 * row.inside[reading]
        if row.held:
            of["holds"] = [
                {"from_m": begin, "to_m": end, "first_order_holds": trusted}
                for (begin, end), trusted in zip(row.held[reading], row.held_trusted[reading], strict=True)
            ]
        result[reading] = of
    return result


def _sweep_as_dict(one: Sweep) -> dict[str, Any]:
    return {
        "name": one.parameter.name,
        "label": one.parameter.label,
        "unit": one.parameter.unit,
        "present": one.present,
        "values": one.values,
        "needed_noise_px": one.needed,
    }
