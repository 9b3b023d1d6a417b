"""Study folders: scenario.toml, verdict.json, verdict.md, envelopes.parquet, and flights.parquet if any were flown.

The place is `landsim.runs.new_run`'s: a study is written as a whole or not at all.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from landsim.config import Scenario, load_scenario, resolved_toml
from landsim.errors import RunFolderError, is_text, one_line, what_is_wrong
from landsim.parquet import read_table, write_table
from landsim.study.model import OF_STAGE, QUANTITIES, READINGS, SOURCES, Envelope
from landsim.units import DEG

SCENARIO_FILE = "scenario.toml"
VERDICT_FILE = "verdict.json"
TEXT_FILE = "verdict.md"
ENVELOPES_FILE = "envelopes.parquet"
FLIGHTS_FILE = "flights.parquet"
WORDS = ("stage", "reading", "source", "quantity", "unit")
PERCENTILES = ("p68", "p95", "p99_7")
NUMBERS = ("roll_error_deg", "distance_m", "time_s", "height_m", "count", *PERCENTILES, "sigma", "single")
COLUMNS = ("listed", *WORDS, *NUMBERS)
"""Of envelopes.parquet: a row for each quantity of each range of each envelope, in the quantity's own ``unit``."""


class _Part(BaseModel):
    """What is read of a part of verdict.json; there is more in it."""

    model_config = ConfigDict(strict=True)


class _Curves(_Part):
    p95: list[list[float | None]]


class _TiltStage(_Part):
    range_m: list[float]
    height_m: list[float]
    endpoints: dict[str, _Curves]
    edge_points: Annotated[dict[str, _Curves], Field(alias="edge-points")]


class _Tilt(_Part):
    pitch_down_deg: Annotated[list[float], Field(min_length=2)]
    early: _TiltStage
    late: _TiltStage


class _Claims(_Part):
    tilt: _Tilt | None = None


class _Needed(_Part):
    scenario: str
    seed: Annotated[int, Field(ge=0)]
    entries: list[dict[str, Any]]
    claims: _Claims


class Study(NamedTuple):
    """A study as read back."""

    scenario: Scenario
    verdict: dict[str, Any]
    envelopes: tuple[Envelope, ...]


def write_study(
    folder: Path,
    scenario: Scenario,
    verdict: dict[str, Any],
    envelopes: Sequence[Envelope],
    listed: Sequence[Envelope],
    rows: Sequence[dict[str, Any]],
) -> None:
    """Write a study, but for its figures, into an existing folder.

    Parameters
    ----------
    folder : Path
    scenario, verdict, envelopes, listed, rows
        As in `landsim.study.run.StudyResult`.

    Raises
    ------
    RunFolderError
        If a file cannot be written.
    """
    from landsim.study.markdown import verdict_md

    seed = verdict["seed"]
    head = (
        f"# {one_line(scenario.name)}, seed {seed}, resolved: every key with the value that was studied.\n"
        f"# The same study again: landsim run DIR, where DIR is the folder of this file;"
        f" without its folder: landsim run {SCENARIO_FILE} --seed {seed}\n"
    )
    try:
        (folder / SCENARIO_FILE).write_text(head + resolved_toml(scenario), encoding="utf-8")
        text = json.dumps(verdict, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / VERDICT_FILE).write_text(text + "\n", encoding="utf-8")
        (folder / TEXT_FILE).write_text(verdict_md(verdict), encoding="utf-8")
        save_envelopes(folder / ENVELOPES_FILE, envelopes, listed)
        if rows:
            from landsim.batch.rows import save_rows

            save_rows(folder / FLIGHTS_FILE, rows)
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror or error}") from None


def read_study(folder: Path) -> Study:
    """Read a study back.

    Raises
    ------
    RunFolderError
        If the folder does not hold a study.
    ScenarioError
        If its scenario cannot be used any more.
    """
    scenario, _ = load_study(folder)
    verdict = _read_verdict(folder)
    return Study(scenario, verdict, load_envelopes(folder / ENVELOPES_FILE, listed=False))


def load_study(folder: Path, overrides: Mapping[str, object] | None = None) -> tuple[Scenario, int]:
    """The scenario of a study, under the name that it had, and its seed.

    Raises
    ------
    RunFolderError
        If the folder does not hold a study.
    ScenarioError
        If its scenario cannot be used.
    """
    if not (folder / SCENARIO_FILE).is_file():
        raise RunFolderError(f"{folder}: is not a study: {SCENARIO_FILE} is missing")
    verdict = _read_verdict(folder)
    scenario = load_scenario(folder / SCENARIO_FILE, overrides)
    return scenario.model_copy(update={"name": verdict["scenario"]}), verdict["seed"]


def _read_verdict(folder: Path) -> dict[str, Any]:
    """What verdict.json holds, once it is known to be a study's."""
    what = f"{folder}: is not a study: {VERDICT_FILE}"
    try:
        verdict: dict[str, Any] = json.loads((folder / VERDICT_FILE).read_text(encoding="utf-8"))
        name = _Needed.model_validate(verdict).scenario
    except ValidationError as failure:
        error = failure.errors(include_url=False)[0]
        place = ".".join(map(str, error["loc"]))
        raise RunFolderError(f"{what}: {place}{' ' if place else ''}{what_is_wrong(dict(error))}") from None
    except OSError as error:
        raise RunFolderError(f"{folder / VERDICT_FILE}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{what}: not JSON: {error}") from None
    if not name or name != Path(name).name or "\0" in name or not is_text(name):  # it becomes part of a folder's name
        raise RunFolderError(f'{what}: scenario cannot be a name: "{name}"')
    return verdict


def save_envelopes(path: Path, envelopes: Sequence[Envelope], listed: Sequence[Envelope]) -> None:
    """Write envelopes as one long table, angles in degrees.

    Parameters
    ----------
    path : Path
    envelopes, listed : sequence of Envelope
        Told apart by the column ``listed``.
    """
    import pyarrow as pa

    columns: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    for group, in_list in ((envelopes, False), (listed, True)):
        for envelope in group:
            for k, name in enumerate(envelope.quantities):
                _append(columns, envelope, k, name, listed=in_list)
    kinds = {"listed": pa.bool_(), "count": pa.int64(), **dict.fromkeys(WORDS, pa.string())}
    table = pa.table({name: pa.array(values, kinds.get(name, pa.float64())) for name, values in columns.items()})
    write_table(path, table)


def _append(columns: dict[str, list[Any]], envelope: Envelope, k: int, name: str, *, listed: bool) -> None:
    quantity, n = QUANTITIES[name], envelope.distance.size
    words = {"stage": envelope.stage, "reading": envelope.reading, "source": envelope.source}
    for key, word in {**words, "quantity": name, "unit": quantity.unit}.items():
        columns[key] += [word] * n
    columns["listed"] += [listed] * n
    columns["roll_error_deg"] += [envelope.roll_error / DEG] * n
    for key, values in (
        ("distance_m", envelope.distance),
        ("time_s", envelope.time),
        ("height_m", envelope.height),
        ("count", envelope.count),
        ("sigma", envelope.sigma[:, k] / quantity.scale),
        ("single", envelope.single[:, k] / quantity.scale),
        *((key, envelope.percentiles[:, k, level] / quantity.scale) for level, key in enumerate(PERCENTILES)),
    ):
        columns[key] += values.tolist()


_KNOWN: dict[str, tuple[str, ...]] = {
    "stage": tuple(OF_STAGE),
    "reading": READINGS,
    "source": SOURCES,
    "quantity": tuple(QUANTITIES),
}
"""The words that the columns may hold."""


def load_envelopes(path: Path, *, listed: bool) -> tuple[Envelope, ...]:
    """Read envelopes back: those by frame, or the listed ones.

    Raises
    ------
    RunFolderError
        If the file is not there or does not hold envelopes.
    """
    table = read_table(path)
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise RunFolderError(f"{path}: is not a table of envelopes: column {missing[0]} is missing")
    try:
        columns = {name: np.asarray(table[name].to_pylist()) for name in ("listed", *WORDS)}
        columns |= {name: table[name].to_numpy().astype(float) for name in NUMBERS}
        for name, known in _KNOWN.items():
            unknown = sorted(set(columns[name].tolist()) - set(known), key=str)
            if unknown:
                raise ValueError(f"{name} holds {unknown[0]!r}; known: {', '.join(known)}")
        for name in ("distance_m", "time_s", "count"):
            if not np.isfinite(columns[name]).all():
                raise ValueError(f"{name} has gaps")
        if not columns["listed"].size:
            raise ValueError("it has no rows")
        return _envelopes(columns, listed=listed)
    except (ValueError, TypeError, KeyError) as error:
        raise RunFolderError(f"{path}: is not a table of envelopes: {error}") from None


def _envelopes(columns: dict[str, np.ndarray[Any, Any]], *, listed: bool) -> tuple[Envelope, ...]:
    chosen = np.flatnonzero(columns["listed"] == listed)
    groups: dict[tuple[Any, ...], dict[str, list[int]]] = {}
    for i in chosen.tolist():
        key = tuple(columns[name][i] for name in ("stage", "reading", "source", "roll_error_deg"))
        groups.setdefault(key, {}).setdefault(str(columns["quantity"][i]), []).append(i)
    result = []
    for (stage, reading, source, roll_error), by_quantity in groups.items():
        names = tuple(by_quantity)
        rows = np.array([by_quantity[name] for name in names])  # (k, n)
        scale = np.array([QUANTITIES[name].scale for name in names])
        first = rows[0]
        result.append(
            Envelope(
                stage=str(stage),  # type: ignore[arg-type]
                reading=str(reading),  # type: ignore[arg-type]
                source=str(source),  # type: ignore[arg-type]
                roll_error=float(roll_error) * DEG,
                quantities=names,
                distance=columns["distance_m"][first],
                time=columns["time_s"][first],
                height=columns["height_m"][first],
                count=columns["count"][first].astype(int),
                percentiles=np.stack([columns[key][rows].T * scale for key in PERCENTILES], axis=-1),
                sigma=columns["sigma"][rows].T * scale,
                single=columns["single"][rows].T * scale,
            )
        )
    return tuple(result)
