"""Which keys of a scenario may be drawn, and whether what is drawn for them is allowed."""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from landsim.errors import did_you_mean, what_is_wrong
from landsim.schema.base import Section, fields_by_key, refused, section_of
from landsim.schema.dispersions import MOST_SIGMAS, DrawConfig

NEVER = {
    "kind": "says what the file is",
    "aircraft": "says what flies",
    "study": "belongs to a study",
    "box": "judges a landing",
    "plug-ins": "says who steers",
    "dispersions": "says what is drawn",
}
"""Sections whose keys are not drawn, and why."""
RATES = ("camera.rate_hz", "imu.rate_hz", "simulation.rate_hz")
"""They have to divide each other, which hardly any number from a range does."""
SPREAD_BY_SEED = {
    "start.cross_m": "start.cross_sigma_m",
    "start.height_m": "start.height_sigma_m",
    "start.heading_deg": "start.heading_sigma_deg",
    "start.speed_mps": "start.speed_sigma_mps",
}
"""Keys to which each flight's seed adds a normal number by itself, and the σ of that."""

_File = TypeVar("_File", bound=Section)


@cache
def drawable(model: type[Section]) -> dict[str, bool]:
    """Dotted keys of the numbers in a scenario that may be drawn, and whether each is a whole number."""
    keys = {}
    for name, field in fields_by_key(model).items():
        section = section_of(model.model_fields[field].annotation)
        if section is None or name in NEVER:
            continue
        for key, inner in section.model_fields.items():
            kinds = set(_kinds(inner.annotation))
            if kinds <= {int, float, type(None)} and kinds & {int, float}:
                keys[f"{name}.{key}"] = int in kinds
    return keys


def _kinds(annotation: Any) -> Iterator[Any]:
    """The types of a field: of a union, its members', without their ranges."""
    inner = get_args(annotation)
    if not inner:
        yield annotation
    elif hasattr(annotation, "__metadata__"):
        yield from _kinds(inner[0])
    else:
        for kind in inner:
            yield from _kinds(kind)


def with_values(file: _File, values: Mapping[str, float]) -> _File:
    """A scenario with other values of some keys, and without dispersions, validated again.

    Raises
    ------
    pydantic.ValidationError
        If a value is refused.
    """
    model = type(file)
    whole = drawable(model)
    sections: dict[str, Any] = {name: getattr(file, field) for name, field in fields_by_key(model).items()}
    sections["dispersions"] = None
    for key, value in values.items():
        section, _, name = key.partition(".")
        if not isinstance(sections[section], dict):
            sections[section] = {
                field: getattr(sections[section], field) for field in type(sections[section]).model_fields
            }
        sections[section][name] = int(value) if whole[key] and float(value).is_integer() else value
    return model.model_validate(sections)


def refusal(file: Section, values: Mapping[str, float]) -> tuple[str, str] | None:
    """The key and what is wrong with it, if a scenario is refused with these values."""
    try:
        with_values(file, values)
    except ValidationError as failure:
        error = failure.errors(include_url=False)[0]
    else:
        return None
    place = [str(name) for name in error["loc"] if not str(name).startswith("function-")]
    own = error.get("ctx", {}).get("key")
    return ".".join([*place, own] if own else place), what_is_wrong(dict(error))


def value_of(file: Section, key: str) -> float | None:
    """The number that a key has."""
    section, _, name = key.partition(".")
    value: float | None = getattr(getattr(file, section), name)
    return value


def applied(draw: DrawConfig, own: float | None, number: float) -> float:
    """The value that a key gets: of what it has in the scenario and of the number drawn."""
    if draw.apply == "replace":
        return number
    assert own is not None, "a key without a value is refused when the scenario is loaded"
    return own + number if draw.apply == "add" else own * number


def check_draw(file: Section, draw: DrawConfig, place: str, drawn: set[str]) -> None:
    """Refuse a draw of what cannot be drawn, and one whose numbers cannot all be used.

    Parameters
    ----------
    file : ScenarioFile
        Valid but for its dispersions.
    draw : DrawConfig
    place : str
        Dotted, of the draw.
    drawn : set of str
        All keys that are.

    Raises
    ------
    PydanticCustomError
        With a complete message and the place.
    """
    _check_key(type(file), draw.key, f"{place}.key")
    continuous = draw.distribution != "discrete"
    if continuous and drawable(type(file))[draw.key]:
        raise refused(
            f"{draw.key} is a whole number: only a discrete distribution gives those", f"{place}.distribution"
        )
    if continuous and draw.key in RATES:
        told = f"{draw.key} must divide other rates, as hardly any number from a range does: use discrete"
        raise refused(told, f"{place}.distribution")
    spread = SPREAD_BY_SEED.get(draw.key)
    if spread is not None and spread in drawn:
        raise refused(f"{draw.key} would be drawn twice: {spread}, which is drawn too, spreads it", f"{place}.key")
    if spread is not None and (sigma := value_of(file, spread)):
        told = f"{draw.key} would be drawn twice: {spread} = {sigma:g} spreads it with each seed; set that to 0"
        raise refused(told, f"{place}.key")
    own = value_of(file, draw.key)
    if draw.apply != "replace" and own is None:
        raise refused(f'{draw.key} has no value of its own; give it one, or use "replace"', f"{place}.apply")
    if draw.apply == "multiply" and own == 0.0:
        raise refused(f'{draw.key} is 0 and stays 0 whatever multiplies it; use "add" or "replace"', f"{place}.apply")
    for name, number in _points(draw):
        why = _refused_at(file, draw, applied(draw, own, number))
        if why is not None:
            raise refused(f"{number:g} is drawn, but {why}", f"{place}.{name}")
    for name, end, away, number in _tails(draw):
        value = applied(draw, own, number)
        why = _refused_at(file, draw, value)
        if why is not None:
            drawn_too = f"{draw.distribution} draws {value:.4g} too, {away:.3g} sigma out, but {why}"
            advice = f'use "truncated-normal" with {end}, or a smaller {name}'
            raise refused(f"{drawn_too}; {advice}", f"{place}.{name}")


def without_value(what: str) -> str:
    """What is wrong with a value, where the value has been said already."""
    return what.rpartition(", not ")[0] or what


def _refused_at(file: Section, draw: DrawConfig, value: float) -> str | None:
    """Why a scenario cannot have a value that is drawn; None if it can."""
    wrong = refusal(file, {draw.key: value})
    if wrong is None:
        return None
    key, what = wrong
    if key != draw.key:
        return f"with {draw.key} = {value:g}, {key} {what}"
    return f"{key} {without_value(what) if draw.apply == 'replace' else what}"


def _tails(draw: DrawConfig) -> Iterator[tuple[str, str, float, float]]:
    """The parameter, the end that is open, and so far out there that next to none lies beyond: in sigmas, and a number.

    Beyond a cut at a sigma, of the normal distribution that is left as much lies past sqrt(a² + 6²) as of a whole one
    past 6.
    """
    if draw.median is not None and draw.sigma_log is not None:
        for end, sign in (("low", -1.0), ("high", 1.0)):
            yield "sigma_log", end, MOST_SIGMAS, draw.median * math.exp(sign * MOST_SIGMAS * draw.sigma_log)
    if draw.mean is None or draw.sigma is None:
        return
    for end, other, sign in (("low", draw.high, -1.0), ("high", draw.low, 1.0)):
        if getattr(draw, end) is None:
            cut = 0.0 if other is None else max(sign * (other - draw.mean) / draw.sigma, 0.0)
            away = math.hypot(cut, MOST_SIGMAS)
            yield "sigma", end, away, draw.mean + sign * away * draw.sigma


def _check_key(model: type[Section], key: str, place: str) -> None:
    known = drawable(model)
    if key in known:
        return
    section, _, name = key.partition(".")
    if section in NEVER:
        raise refused(f"{key} cannot be drawn: {section} {NEVER[section]}", place)
    field = model.model_fields.get(section)
    inner = None if field is None else section_of(field.annotation)
    if inner is not None and name in inner.model_fields:
        raise refused(f"{key} is not a number, and only numbers are drawn", place)
    if inner is not None and not name:
        raise refused(
            f"{key} is a section; name one of its keys, such as {key}.{next(iter(inner.model_fields))}", place
        )
    raise refused(f'there is no key "{key}" to draw{did_you_mean(key, list(known))}', place)


def _points(draw: DrawConfig) -> list[tuple[str, float]]:
    """Numbers that must be allowed, by the parameter that gives them: the ends, or what half of all go beyond.

    Those of the open ends are `_tails`.
    """
    if draw.values is not None:
        return [(f"values[{i}]", value) for i, value in enumerate(draw.values)]
    ends = [(name, end) for name, end in (("low", draw.low), ("high", draw.high)) if end is not None]
    if draw.distribution == "log-normal" and draw.median is not None:
        return [("median", draw.median)]
    return ends if ends or draw.mean is None else [("mean", draw.mean)]
