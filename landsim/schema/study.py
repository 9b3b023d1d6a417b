"""A study: the errors of an estimate by range, against bounds."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from landsim.schema.base import Positive, Section, refused, tuple_from_list


class BoundsConfig(Section):
    """``[study.bounds]``: the largest error that each quantity is claimed to have; none for one left out."""

    roll_deg: Positive | None = None
    pitch_deg: Positive | None = None
    yaw_deg: Positive | None = None
    cross_m: Positive | None = None
    altitude_m: Positive | None = None
    along_m: Positive | None = None


class StudyConfig(Section):
    """``[study]``: the errors of an estimate by range, sampled on a straight approach or taken from flights.

    The straight approach begins at ``start`` (its means) with the camera there, and is flown along
    ``start.flight_path_deg`` at the approach speed, with no roll and no yaw.
    """

    method: Literal["sampling", "flights"] = "sampling"
    """``sampling`` draws the noise of each frame many times; the fused errors come from flights in either case."""
    stage: Literal["early", "late", "both"] = "early"
    """Three lines, two lines with a roll angle, or one after the other."""
    readings: Annotated[
        tuple[Literal["endpoints", "edge-points"], ...], BeforeValidator(tuple_from_list), Field(min_length=1)
    ] = ("endpoints", "edge-points")
    """Of the noise, each studied in place of ``camera.line_noise``."""
    pitch_early_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = -3.0
    """Of the camera to the runway on the straight approach, while the threshold is in the image."""
    pitch_late_deg: Annotated[float, Field(ge=-45.0, le=45.0)] = -10.0
    """From when it has left."""
    end_height_m: Positive = 2.0
    """Camera height at which the late stage ends."""
    draws: Annotated[int, Field(ge=100, le=1_000_000)] = 1000
    """A frame."""
    ranges_m: Annotated[tuple[float, ...], BeforeValidator(tuple_from_list), Field(min_length=1)]
    """Distances to the threshold, negative past it, at which figures are listed."""
    listed_draws: Annotated[int, Field(ge=100, le=10_000_000)] = 20_000
    """At each of them."""
    roll_errors_deg: Annotated[
        tuple[Annotated[float, Field(ge=-45.0, le=45.0)], ...], BeforeValidator(tuple_from_list), Field(min_length=1)
    ] = (0.0,)
    """By which the roll angle given to the late stage is off."""
    flights: Annotated[int, Field(ge=0, le=100_000)] = 100
    """Flown with seeds from the run's own on, for each reading."""
    bounds: BoundsConfig = Field(default_factory=BoundsConfig)
    bounds_late: BoundsConfig = Field(default_factory=BoundsConfig)
    """``[study.bounds_late]``: those that are others in the late stage; each one left out is that of ``bounds``."""

    def bound(self, stage: Literal["early", "late"], key: str) -> float | None:
        """A bound of a stage by its key, such as ``cross_m``, in the unit that the key says."""
        late: float | None = getattr(self.bounds_late, key) if stage == "late" else None
        early: float | None = getattr(self.bounds, key)
        return early if late is None else late

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if any(a <= b for a, b in pairwise(self.ranges_m)):
            raise refused(f"must fall from each to the next, not {list(self.ranges_m)}", "ranges_m")
        for key in ("readings", "roll_errors_deg"):
            values: tuple[object, ...] = getattr(self, key)
            if len(set(values)) < len(values):
                raise refused(f"must not repeat any, not {list(values)}", key)
        if self.method == "flights" and self.flights < 2:
            raise refused(f'must be at least 2 with method = "flights", not {self.flights}', "flights")
        return self
