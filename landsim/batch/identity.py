"""What a batch is: what has to be the same for its flights to belong together."""

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from landsim.config import Scenario, resolved_toml
from landsim.errors import InputError, RunFolderError, is_text, shown, what_is_wrong
from landsim.plugins import versions_of

BATCH_FILE = "batch.json"
FORMAT = 1
"""Of a batch's folder."""
MOST_FLIGHTS = 10_000_000
LARGEST_SEED = 2**63 - 1
"""Of any flight: a table holds no larger number."""
Keep = Literal["none", "failures", "all"]


@dataclass(frozen=True)
class Shard:
    """The flights of a batch that one of several machines flies: every ``of``-th, from the ``number``-th on."""

    number: int = 1
    of: int = 1

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Of ``2/3``; InputError if it is none."""
        number, _, of = text.partition("/")
        if not all(part.isascii() and part.isdigit() and len(part) < 9 for part in (number, of)):
            raise InputError(f"shard: must be i/n, as 1/3, not {shown(text)}")
        if not 1 <= int(number) <= int(of):
            raise InputError(f"shard: must be i/n with i from 1 to n, as 1/3, not {text}")
        return cls(int(number), int(of))

    def indices(self, n: int) -> range:
        """Of its flights in a batch of n."""
        return range(self.number - 1, n, self.of)


@dataclass(frozen=True)
class Identity:
    """A batch, or a shard of one.

    Attributes
    ----------
    scenario : str
        Its name.
    n : int
        Flights of the batch, of all its shards together.
    seed : int
        Of its first flight; flight i has ``seed + i``.
    sampling : str
        Of the dispersions, ``random`` where there are none.
    shard : Shard
    keep : {"none", "failures", "all"}
        Of which flights the whole log is kept.
    time_limit_s : float
        For a flight, wall time.
    chunk : int
        Flights a file while it runs.
    scenario_digest, aircraft_digest : str
        Of the resolved scenario, and of the aircraft's files.
    versions : dict of str to str
        Of what decides the bits of a result.
    """

    scenario: str
    n: int
    seed: int
    sampling: str
    shard: Shard
    keep: Keep
    time_limit_s: float
    chunk: int
    scenario_digest: str
    aircraft_digest: str
    versions: Mapping[str, str]

    def indices(self) -> range:
        """Of its flights."""
        return self.shard.indices(self.n)

    def as_dict(self) -> dict[str, Any]:
        """As in batch.json."""
        return {"format": FORMAT, **asdict(self), "shard": str(self.shard)}


def flights(n: int) -> str:
    """So many flights, in words."""
    return f"{n} flight{'' if n == 1 else 's'}"


def identify(
    scenario: Scenario, n: int, seed: int, shard: Shard, keep: Keep, time_limit_s: float, chunk: int
) -> Identity:
    """The identity of a batch that is to be flown here and now.

    Raises
    ------
    InputError
        If there cannot be such a batch.
    """
    if scenario.kind != "flight":
        raise InputError(f"{scenario.name}: kind: a {scenario.kind} is not flown in a batch; landsim run makes it")
    if not 1 <= n <= MOST_FLIGHTS:
        raise InputError(f"n: must be 1 to {MOST_FLIGHTS}, not {shown(n)}")
    if not 0 <= seed <= LARGEST_SEED - n:
        raise InputError(f"seed: must leave room below 2**63 for {flights(n)}, not {shown(seed)}")
    if shard.number > n:
        raise InputError(f"shard: {shard} has no flight in a batch of {n}")
    if not 0.0 < time_limit_s <= 1e6:
        raise InputError(f"time limit: must be above 0 and at most 1e6 s, not {time_limit_s:g}")
    if not 1 <= chunk <= 100_000:
        raise InputError(f"chunk: must be 1 to 100000 flights, not {shown(chunk)}")
    return Identity(
        scenario=scenario.name,
        n=n,
        seed=seed,
        sampling=sampling_of(scenario),
        shard=shard,
        keep=keep,
        time_limit_s=time_limit_s,
        chunk=chunk,
        scenario_digest=digest(resolved_toml(scenario)),
        aircraft_digest=digest_of_files(scenario.aircraft_config.folder),
        versions=versions_of(scenario),
    )


def sampling_of(scenario: Scenario) -> str:
    """How what is dispersed is sampled."""
    return "random" if scenario.dispersions is None else scenario.dispersions.sampling


def digest(text: str) -> str:
    """Of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def digest_of_files(folder: Path) -> str:
    """Of the TOML and XML files in and below a folder, with their names."""
    found = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.suffix in {".toml", ".xml"} and path.is_file()):
        for part in (path.relative_to(folder).as_posix().encode(), path.read_bytes()):
            found.update(len(part).to_bytes(8, "big") + part)
    return found.hexdigest()


class _Stored(BaseModel):
    model_config = ConfigDict(strict=True)

    format: int
    scenario: Annotated[str, Field(min_length=1)]
    n: Annotated[int, Field(ge=1, le=MOST_FLIGHTS)]
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)]
    sampling: str
    shard: str
    keep: Keep
    time_limit_s: Annotated[float, Field(gt=0.0)]
    chunk: Annotated[int, Field(ge=1)]
    scenario_digest: str
    aircraft_digest: str
    versions: dict[str, str]


def read_identity(folder: Path) -> Identity:
    """What batch.json says.

    Raises
    ------
    RunFolderError
        If the folder does not hold a batch.
    """
    what = f"{folder}: is not a batch: {BATCH_FILE}"
    try:
        content = json.loads((folder / BATCH_FILE).read_text(encoding="utf-8"))
        stored = _Stored.model_validate(content)
    except ValidationError as failure:
        error = failure.errors(include_url=False)[0]
        place = ".".join(map(str, error["loc"]))
        raise RunFolderError(f"{what}: {place}{' ' if place else ''}{what_is_wrong(dict(error))}") from None
    except FileNotFoundError:
        raise RunFolderError(f"{what} is missing") from None
    except OSError as error:
        raise RunFolderError(f"{folder / BATCH_FILE}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{what}: not JSON: {error}") from None
    if stored.format != FORMAT:
        raise RunFolderError(f"{what}: has the format {stored.format}; this landsim reads {FORMAT}")
    name = stored.scenario
    if name != Path(name).name or "\0" in name or not is_text(name):  # it becomes part of a folder's name
        raise RunFolderError(f'{what}: scenario cannot be a name: "{name}"')
    fields = stored.model_dump(exclude={"format"})
    try:
        shard = Shard.parse(stored.shard)
    except InputError as error:
        raise RunFolderError(f"{what}: {error}") from None
    return Identity(**{**fields, "shard": shard})


def differing_key(one: str, other: str) -> str:
    """The first key in which two scenarios as TOML differ, with both values."""
    here, there = (dict(_leaves(tomllib.loads(text))) for text in (one, other))
    for key in dict.fromkeys((*here, *there)):
        if key not in here or key not in there or here[key] != there[key]:
            values = [shown(values[key]) if key in values else "nothing" for values in (here, there)]
            return f"{key} is {values[0]} there and {values[1]} here"
    return "its text differs"


def _leaves(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def differing_version(one: Mapping[str, str], other: Mapping[str, str]) -> str | None:
    """The first library of which two results were not made with the same version, with both; None if all are equal."""
    for name in dict.fromkeys((*one, *other)):
        if one.get(name) != other.get(name):
            return f"{name} {one.get(name, 'nowhere')} there and {other.get(name, 'nowhere')} here"
    return None
