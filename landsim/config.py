"""Scenario and aircraft files: TOML to the frozen models of :mod:`landsim.schema`, with errors that name file and key.

``load_scenario("landing", overrides={"runway.width_m": 45.0})`` is the way in; ``resolved_toml`` is the way back.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from landsim.errors import ScenarioError, did_you_mean, is_text, what_is_wrong
from landsim.resources import AIRCRAFT_FILE, find_aircraft, find_scenario
from landsim.schema import (
    AirConfig,
    AircraftChoice,
    AircraftConfig,
    AircraftFile,
    ApproachConfig,
    ApproachGains,
    BoundsConfig,
    BoxConfig,
    CameraConfig,
    ClimbGains,
    CorrelationConfig,
    DispersionsConfig,
    DrawConfig,
    FaultConfig,
    FlareGains,
    GearConfig,
    GoAroundConfig,
    GuidanceConfig,
    GustConfig,
    ImuConfig,
    LoadingConfig,
    MountConfig,
    NavigationConfig,
    PitotConfig,
    PlugInsConfig,
    RolloutGains,
    RunwayConfig,
    Scenario,
    ScenarioFile,
    Section,
    SimulationConfig,
    SpeedsConfig,
    StartConfig,
    StudyConfig,
    TurbulenceConfig,
    WindConfig,
    WindGains,
    field_names,
    fields_by_key,
)

__all__ = [
    "AirConfig",
    "AircraftChoice",
    "AircraftConfig",
    "AircraftFile",
    "ApproachConfig",
    "ApproachGains",
    "BoundsConfig",
    "BoxConfig",
    "CameraConfig",
    "ClimbGains",
    "CorrelationConfig",
    "DispersionsConfig",
    "DrawConfig",
    "FaultConfig",
    "FlareGains",
    "GearConfig",
    "GoAroundConfig",
    "GuidanceConfig",
    "GustConfig",
    "ImuConfig",
    "LoadingConfig",
    "MountConfig",
    "NavigationConfig",
    "PitotConfig",
    "PlugInsConfig",
    "RolloutGains",
    "RunwayConfig",
    "Scenario",
    "ScenarioError",
    "ScenarioFile",
    "SimulationConfig",
    "SpeedsConfig",
    "StartConfig",
    "StudyConfig",
    "TurbulenceConfig",
    "WindConfig",
    "WindGains",
    "load_aircraft",
    "load_scenario",
    "parse_setting",
    "resolved_toml",
]

ALL_BUT_THE_SAME = 0.85
"""Of 1: how alike a key of the same table has to be to one that is unknown, to be meant rather than one elsewhere."""

_Model = TypeVar("_Model", bound=Section)


def load_scenario(name_or_path: str | Path, overrides: Mapping[str, object] | None = None) -> Scenario:
    """Read, override and validate a scenario.

    Parameters
    ----------
    name_or_path : str or Path
        A scenario file, or the name of a shipped scenario; a file wins over a name.
    overrides : mapping, optional
        Dotted keys and values that replace the file's, such as ``{"runway.width_m": 45.0}``.  A relative path in
        ``aircraft.name`` is then relative to the working directory; in a file it is relative to the file.

    Returns
    -------
    Scenario
        Frozen, with its aircraft in ``aircraft_config``.

    Raises
    ------
    ScenarioError
        One line: file, dotted key, what is wrong, and the nearest right name.
    """
    if not str(name_or_path).strip():
        raise ScenarioError("no scenario named: give a shipped name (see: landsim list) or the path of a TOML file")
    try:
        path = find_scenario(name_or_path)
    except (OSError, RuntimeError) as error:  # a name too long, no such user's home
        reason = error.strerror if isinstance(error, OSError) else error
        raise ScenarioError(f"{name_or_path}: cannot be read: {reason}") from None
    if not is_text(str(path)):
        raise ScenarioError(f"{path}: the path of a scenario must be UTF-8 text")
    overrides = dict(overrides or {})
    table = _read(path)
    _settle_draws(table, overrides)
    for key, value in overrides.items():
        _override(table, key, value, path)
    settings = _validated(ScenarioFile, table, path, overrides)
    base = Path() if "aircraft.name" in overrides or "aircraft" in overrides else path.parent
    name, folder = _named(path, overrides, settings.aircraft.name, base)
    if not is_text(name):
        raise ScenarioError(f"{_where('aircraft.name', path, overrides)}: must be UTF-8 text, not {name}")
    sections = {key: getattr(settings, field) for key, field in fields_by_key(ScenarioFile).items()}
    aircraft = _aircraft_in(folder)
    if settings.approach.law == "wind" and aircraft.guidance.wind is None:
        where = _where("approach.law", path, overrides)
        raise ScenarioError(f'{where}: must be "calm": {aircraft.name} has no [guidance.wind] in {AIRCRAFT_FILE}')
    if settings.go_around.enabled and aircraft.guidance.climb is None:
        where = _where("go_around.enabled", path, overrides)
        raise ScenarioError(f"{where}: must be false: {aircraft.name} has no [guidance.climb] in {AIRCRAFT_FILE}")
    return Scenario(
        **{**sections, "aircraft": AircraftChoice(name=name)},
        name=path.stem,
        path=path,
        aircraft_config=aircraft,
    )


def load_aircraft(name_or_path: str | Path) -> AircraftConfig:
    """Read and validate an aircraft.

    Parameters
    ----------
    name_or_path : str or Path
        A folder that holds aircraft.toml, or the name of a shipped aircraft; a folder wins over a name.

    Raises
    ------
    ScenarioError
        One line: file, dotted key, what is wrong, and the nearest right name.
    """
    return _aircraft_in(find_aircraft(name_or_path)[1])


def resolved_toml(scenario: ScenarioFile) -> str:
    """The scenario as TOML that says every key, defaults and overrides included; it loads to an equal scenario."""
    import tomli_w

    # TOML has no null: a key that is None is left out, which is what None stands for.
    settings = {key: getattr(scenario, field) for key, field in fields_by_key(ScenarioFile).items()}
    tables = {
        key: value.model_dump(exclude_none=True) if isinstance(value, Section) else value
        for key, value in settings.items()
        if value is not None
    }
    return tomli_w.dumps(tables)


def parse_setting(text: str) -> tuple[str, object]:
    """Key and value of ``dotted.key=value``, where the value is TOML, or a bare word, which stands for a string.

    Raises
    ------
    ScenarioError
        If there is no ``=``, no key or no value.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not is_text(text):
        raise ScenarioError(f'setting "{text}": must be UTF-8 text')
    if not (equals and key and value):
        raise ScenarioError(f'setting "{text}": must be dotted.key=value')
    if not _is_dotted(key):
        raise ScenarioError(f'setting "{text}": the key has an empty part; must be as in runway.width_m=45.0')
    try:
        table = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        table = {}
    if list(table) == ["value"]:
        return key, table["value"]
    if value[0] in "[{\"'":
        raise ScenarioError(f'setting "{text}": the value is not TOML')
    return key, value


def _aircraft_in(folder: Path) -> AircraftConfig:
    path = folder / AIRCRAFT_FILE
    settings = _validated(AircraftFile, _read(path), path)
    model = folder / f"{settings.model}.xml"
    if not model.is_file():
        raise ScenarioError(f"{path}: model: {model} does not exist")
    return AircraftConfig(**{key: getattr(settings, key) for key in AircraftFile.model_fields}, folder=folder)


def _named(path: Path, overrides: Mapping[str, object], name: str, base: Path) -> tuple[str, Path]:
    try:
        return find_aircraft(name, base)
    except ScenarioError as error:
        raise ScenarioError(f"{_where('aircraft.name', path, overrides)}: {error}") from None


def _read(path: Path) -> dict[str, Any]:
    """The tables of a TOML file."""
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path}: not valid TOML: {error}") from None
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ScenarioError(f"{path}: not valid TOML: line {line} is not UTF-8 text") from None
    except RecursionError:
        raise ScenarioError(f"{path}: not valid TOML: nested too deeply") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None


def _is_dotted(key: object) -> bool:
    return isinstance(key, str) and is_text(key) and all(part.strip() for part in key.split("."))


def _override(table: dict[str, Any], key: str, value: object, path: Path) -> None:
    """Set one dotted key of the tables."""
    if not _is_dotted(key):
        raise ScenarioError(f"{path}: override {key!r}: must be a dotted key, such as runway.width_m")
    *tables, last = key.split(".")
    for done, part in enumerate(tables, 1):
        name, index = _indexed(part)
        if index is None:
            inner = table.setdefault(name, {})
        else:
            inner = _element(table.get(name), index, f"{path}: override {key}: {'.'.join([*tables[: done - 1], name])}")
        if not isinstance(inner, dict):
            raise ScenarioError(f"{path}: override {key}: {'.'.join(tables[:done])} is not a table")
        table = inner
    table[last] = deepcopy(value)  # later overrides may write into it


def _settle_draws(table: dict[str, Any], overrides: Mapping[str, object]) -> None:
    """Give an overridden key for which the file draws another value a distribution that has the one value.

    It stays among the draws, so that those of the other keys are the same as without the override.
    """
    dispersions = table.get("dispersions")
    draws = dispersions.get("draw") if isinstance(dispersions, dict) else None
    if not isinstance(draws, list):
        return
    for i, draw in enumerate(draws):
        key = draw.get("key") if isinstance(draw, dict) else None
        if isinstance(key, str) and key in overrides and draw.get("apply", "replace") == "replace":
            draws[i] = {"key": key, "distribution": "discrete", "values": [overrides[key]]}


def _indexed(part: str) -> tuple[str, int | None]:
    """``draw[2]`` as a name and an index, and any other part of a key as it is."""
    found = re.fullmatch(r"(.+)\[(\d{1,9})\]", part)
    return (part, None) if found is None else (found[1], int(found[2]))


def _element(tables: object, index: int, place: str) -> object:
    if not isinstance(tables, list):
        raise ScenarioError(f"{place} is not an array")
    if index >= len(tables):
        raise ScenarioError(f"{place} has {len(tables)} elements, so there is no [{index}]: the first is [0]")
    return tables[index]


def _dotted(place: Iterable[int | str]) -> str:
    """A place in nested tables as a file's reader would write it: ``dispersions.draw[2].sigma``."""
    text = ""
    for name in place:
        text += f"[{name}]" if isinstance(name, int) else f".{name}" if text else name
    return text


def _whose(table: Any, place: Iterable[int | str]) -> str:
    """Which key a place in a draw speaks of, since the draws of a file bear no numbers."""
    for name in place:
        try:
            table = table[name]
        except (LookupError, TypeError):
            return ""
        if isinstance(name, int) and isinstance(table, dict) and isinstance(table.get("key"), str):
            return f" ({table['key']})"
    return ""


def _validated(
    model: type[_Model], table: Mapping[str, Any], path: Path, overrides: Mapping[str, object] | None = None
) -> _Model:
    """The model of a file's tables; of several things wrong, the first is told."""
    try:
        return model.model_validate(table)
    except ValidationError as failure:
        errors = failure.errors(include_url=False)
    # A misspelt key is told before what it is missed as.
    error = next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])
    place = tuple(name for name in error["loc"] if not (isinstance(name, str) and name.startswith("function-")))
    if key := error.get("ctx", {}).get("key"):
        place += tuple(key.split("."))
    dotted = _dotted(place) + _whose(table, place)
    if error["type"] == "extra_forbidden":
        what = f"unknown key{_meant(model, place)}"
    elif error["type"] == "missing" and isinstance(place[-1], int):
        dotted = _dotted(place[:-1])
        what = f"element {place[-1] + 1} is missing"
    else:
        what = what_is_wrong(dict(error))
    others = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    raise ScenarioError(f"{_where(dotted, path, overrides or {})}: {what}{others}")


def _meant(model: type[Section], place: tuple[int | str, ...]) -> str:
    """The end of a message about an unknown key: where a key of that very name is, or the nearest one in its table."""
    name = str(place[-1])
    here = field_names(model, place[:-1])
    elsewhere = [key for key in _keys(model) if key.rpartition(".")[2] == name]
    if elsewhere and not get_close_matches(name, here, cutoff=ALL_BUT_THE_SAME):
        *first, last = elsewhere
        return f"; did you mean {', '.join(first)}{' or ' if first else ''}{last}?"
    return did_you_mean(name, here, _dotted([*place[:-1], ""]))


def _keys(model: type[Section], place: tuple[str, ...] = ()) -> Iterator[str]:
    """Every dotted key of a model, tables themselves left out."""
    for name in field_names(model, place):
        below = (*place, name)
        if field_names(model, below):
            yield from _keys(model, below)
        else:
            yield ".".join(below)


def _where(dotted: str, path: Path, overrides: Mapping[str, object]) -> str:
    """File and key; says so when it is not the file that holds the value."""
    bare = dotted.partition(" ")[0]
    overridden = any(
        bare == key or bare.startswith((f"{key}.", f"{key}[")) or key.startswith((f"{bare}.", f"{bare}["))
        for key in overrides
    )
    return f"{path}: {'override ' if overridden else ''}{dotted}"
