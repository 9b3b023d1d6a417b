"""Who navigates and who steers: our own, or what others have installed."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from landsim.schema.base import Section, refused

OWN = "landsim"
"""What stands for our own estimator and controller where a plug-in may be named."""


def _plain(settings: dict[str, Any] | None) -> dict[str, Any] | None:
    """Settings of those types alone that TOML and JSON both have."""
    for place, value in _leaves(settings or {}):
        if not isinstance(value, bool | int | float | str):
            raise refused("must be a number, a string, true or false, or a table or an array of these", place)
        if isinstance(value, float) and not math.isfinite(value):
            raise refused(f"must be a finite number, not {value}", place)
    return settings


def _leaves(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted place and value of everything below tables and arrays."""
    if isinstance(value, dict | list):
        for name, below in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(below, f"{place}.{name}" if place else str(name))
    else:
        yield place, value


PlainTable = Annotated[dict[str, Any] | None, AfterValidator(_plain)]


class PlugInsConfig(Section):
    """``[plug-ins]``: who navigates and who steers, by the names of Python entry points; ``landsim`` is our own."""

    estimator: Annotated[str, Field(min_length=1)] = OWN
    """Of the group ``landsim.estimators``."""
    controller: Annotated[str, Field(min_length=1)] = OWN
    """Of the group ``landsim.controllers``."""
    estimator_settings: PlainTable = None
    """``[plug-ins.estimator_settings]``: handed to the estimator as it stands; its keys are the plug-in's own."""
    controller_settings: PlainTable = None
    """``[plug-ins.controller_settings]``: the same for the controller."""

    def others(self) -> dict[str, str]:
        """The names of those that are not our own, by ``estimator`` and ``controller``."""
        names = {"estimator": self.estimator, "controller": self.controller}
        return {role: name for role, name in names.items() if name != OWN}

    @model_validator(mode="after")
    def _our_own_has_none(self) -> Self:
        for role, place in (("estimator", "[navigation]"), ("controller", "the aircraft's file")):
            if getattr(self, role) == OWN and getattr(self, f"{role}_settings"):
                raise refused(
                    f'belongs to a plug-in; with {role} = "{OWN}" settings are in {place}', f"{role}_settings"
                )
        return self
