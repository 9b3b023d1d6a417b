"""One flight of a batch: what is done in a worker, or anywhere else, for it."""

import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from landsim.batch.durable import PARTIAL
from landsim.batch.identity import Identity, Keep
from landsim.batch.row import Row, distances_of, flight_row, lost_row
from landsim.config import Scenario, load_scenario
from landsim.dispersion import Design, dispersed
from landsim.errors import InputError, traceback_of
from landsim.simulate import Flight, fly

WARM_UP = {"start.along_m": -260.0, "start.height_m": 21.2, "simulation.time_limit_s": 3.0}
"""Of a flight by which everything is loaded, and compiled where it has not been: three seconds near the runway."""


@dataclass(frozen=True)
class Job:
    """A flight to be flown."""

    index: int
    seed: int
    draws: dict[str, float] = field(default_factory=dict)
    """What the dispersed keys have in it."""


class KeepError(Exception):
    """The log of a flight could not be kept; ``str()`` of it is one line."""


@dataclass(frozen=True)
class Keeper:
    """Keeps whole flights beside the batch's rows.

    Attributes
    ----------
    folder : Path
        Of the flights' folders, each with the flight's index as its name.
    which : {"none", "failures", "all"}
        Failures are all but landings in the box.
    write : callable
        Of a folder that is there, the scenario as flown and the flight; writes what is to be kept.
    """

    folder: Path
    which: Keep
    write: Callable[[Path, Scenario, Flight], None]

    def keep(self, scenario: Scenario, job: Job, flight: Flight) -> None:
        """Keep a flight, if it is one of those that are kept; KeepError if it cannot be written."""
        if self.which == "none" or (self.which == "failures" and flight.metrics["in_box"]):
            return
        final = self.folder / str(job.index)
        beside = self.folder / f".{job.index}{PARTIAL}"
        try:
            shutil.rmtree(beside, ignore_errors=True)
            beside.mkdir(parents=True)
            self.write(beside, as_flown(scenario, job.draws), flight)
            shutil.rmtree(final, ignore_errors=True)
            beside.replace(final)
        except (OSError, ValueError) as error:
            shutil.rmtree(beside, ignore_errors=True)
            raise KeepError(getattr(error, "strerror", None) or str(error)) from None


def as_flown(scenario: Scenario, draws: dict[str, float]) -> Scenario:
    """The scenario of one flight: with what was drawn for it, and no dispersions any more."""
    return dispersed(scenario, draws) if draws else scenario


def jobs_of(scenario: Scenario, identity: Identity, indices: Iterable[int]) -> Iterator[Job]:
    """The jobs of some flights of a batch: seeds count up from the batch's own, draws are those of its design."""
    design = Design(scenario, identity.seed, identity.n)
    for index in indices:
        yield Job(index, identity.seed + index, design.draws(index))


def fly_job(scenario: Scenario, keeper: Keeper | None, job: Job) -> Row:
    """Fly a flight of a batch, and keep it if it is to be kept.

    Returns
    -------
    dict
        Of `flight_row`.  What cannot be flown with what was drawn for it, where others can, is a row with the outcome
        ``error`` as well.

    Raises
    ------
    KeepError
        If it could not be kept.
    """
    flown: list[Flight] = []
    try:
        row = flight_row(scenario, job.seed, draws=job.draws, look=flown.append)
    except InputError as failure:
        return lost_job(scenario, job, f"{type(failure).__name__}: {failure}", traceback_of(failure))
    if keeper is not None and flown:
        keeper.keep(scenario, job, flown[0])
    return row | {"index": job.index}


def lost_job(scenario: Scenario, job: Job, reason: str, traceback: str | None) -> Row:
    """The row of a flight of a batch that came to nothing."""
    return lost_row(scenario, job.seed, distances_of(scenario), reason, traceback, job.draws) | {"index": job.index}


def warm_up() -> None:
    """Load and compile what a flight needs, so that the first one of a process takes no longer than the others."""
    fly(load_scenario("landing", WARM_UP))
