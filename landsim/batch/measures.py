"""What a flight is judged by: the numbers of a row that have a distribution, and the limits of the scenario's box."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.so3 import Array
from landsim.batch.flights import Flights
from landsim.config import Scenario

Side = Literal["above", "below"]


class Measure(NamedTuple):
    """A number of a flight."""

    key: str
    """Of a row, with its unit."""
    title: str
    unit: str
    magnitude: bool = False
    """Whether its size is what counts, whatever its sign."""
    of: str = "touchdown"
    """``touchdown`` or ``stop``: what a flight has to come to in order to have it."""

    @property
    def symbol(self) -> str:
        """The title, between bars if the magnitude counts."""
        return f"|{self.title}|" if self.magnitude else self.title


MEASURES: tuple[Measure, ...] = (
    Measure("sink_rate_mps", "sink rate", "m/s"),
    Measure("y_m", "lateral touchdown", "m", magnitude=True),
    Measure("x_m", "longitudinal touchdown", "m"),
    Measure("bank_deg", "bank", "deg", magnitude=True),
    Measure("ground_speed_mps", "ground speed", "m/s"),
    Measure("pitch_deg", "pitch", "deg"),
    Measure("heading_error_deg", "heading error", "deg", magnitude=True),
    Measure("stop_y_m", "lateral position at the stop", "m", magnitude=True, of="stop"),
)
"""Those whose distribution is shown."""
_BY_KEY = {measure.key: measure for measure in MEASURES}


class BoxLimit(NamedTuple):
    """One limit of the box."""

    key: str
    """In ``[box]``."""
    measure: Measure
    limit: float
    """In the measure's unit."""
    side: Side
    """On which a number misses it."""
    center: float
    """Where a number uses nothing of it; as far beyond as the limit it uses all."""

    def missed(self, values: Array) -> NDArray[np.bool_]:
        """Which numbers (n,) are beyond it; NaN is not."""
        size = np.abs(values) if self.measure.magnitude else values
        return np.asarray(size > self.limit if self.side == "above" else size < self.limit)

    def used(self, values: Array) -> Array:
        """How much of it each number (n,) uses: 1 at the limit, more beyond it; NaN stays NaN."""
        size = np.abs(values) if self.measure.magnitude else values
        return np.asarray((size - self.center) / np.copysign(max(abs(self.limit - self.center), 1e-9), self._sign))

    @property
    def _sign(self) -> float:
        return 1.0 if self.side == "above" else -1.0


def box_of(scenario: Scenario) -> tuple[BoxLimit, ...]:
    """The limits of a scenario's box that its flights have: none of the stop, where a flight ends at the touchdown."""
    box = scenario.box
    middle = 0.5 * (box.along_min_m + box.along_max_m)
    limits = (
        BoxLimit("along_min_m", _BY_KEY["x_m"], box.along_min_m, "below", middle),
        BoxLimit("along_max_m", _BY_KEY["x_m"], box.along_max_m, "above", middle),
        BoxLimit("cross_max_m", _BY_KEY["y_m"], box.cross_max_m, "above", 0.0),
        BoxLimit("sink_max_mps", _BY_KEY["sink_rate_mps"], box.sink_max_mps, "above", 0.0),
        BoxLimit("bank_max_deg", _BY_KEY["bank_deg"], box.bank_max_deg, "above", 0.0),
        BoxLimit("stop_cross_max_m", _BY_KEY["stop_y_m"], box.stop_cross_max_m, "above", 0.0),
    )
    return tuple(limit for limit in limits if limit.measure.of != "stop" or scenario.simulation.end == "stop")


def touched_down(flights: Flights) -> NDArray[np.bool_]:
    """Which flights (n,) have a touchdown, whatever became of them."""
    return np.isfinite(flights.numbers("x_m"))
