"""Finds plug-ins by name among the installed packages' entry points, and makes them."""

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

from landsim.config import Scenario
from landsim.errors import InputError, did_you_mean
from landsim.navigation import Navigator
from landsim.plugins.guard import Guard, GuardedController, GuardedEstimator, PlugInFault
from landsim.plugins.interface import ControllerSetup, EstimatorSetup
from landsim.plugins.own import OwnController, landsim_controller, landsim_estimator
from landsim.schema import OWN
from landsim.versions import versions

Setup: TypeAlias = EstimatorSetup | ControllerSetup

METHODS: dict[str, dict[str, int]] = {
    "estimator": {"take_airspeed": 1, "propagate": 1, "observe": 1, "state": 1},
    "controller": {"guide": 1},
}
"""What each has to have, and with how many arguments it is called."""
DIGITS = 12
"""Of the digest of a plug-in's source that are told."""


class PlugInError(InputError):
    """A plug-in that a scenario names cannot be used."""


def estimator_of(name: str, setup: EstimatorSetup) -> Navigator | GuardedEstimator:
    """The estimator of that name.

    Raises
    ------
    PlugInError
        If none is installed under the name, or it does not import.
    PlugInFault
        If it raises when it is made, or lacks a method.
    """
    if name == OWN:
        return landsim_estimator(setup)
    return GuardedEstimator(_who("estimator", name), _made("estimator", name, setup), setup.imu_dt)


def controller_of(name: str, setup: ControllerSetup) -> OwnController | GuardedController:
    """The controller of that name; raises as `estimator_of`."""
    if name == OWN:
        return landsim_controller(setup)
    return GuardedController(_who("controller", name), _made("controller", name, setup))


def refuse_bad(scenario: Scenario, estimator: EstimatorSetup, controller: ControllerSetup) -> None:
    """Refuse a scenario whose plug-ins cannot fly.

    Parameters
    ----------
    scenario : Scenario
    estimator : EstimatorSetup
    controller : ControllerSetup
        With which they are made, for a try.

    Raises
    ------
    PlugInError
        If one is not installed, does not import, raises when it is made, or lacks a method: one line with the file and
        the key.
    """
    for role, name in scenario.plug_ins.others().items():
        try:
            _made(role, name, estimator if role == "estimator" else controller)
        except (PlugInError, PlugInFault) as error:
            raise PlugInError(f"{scenario.path}: plug-ins.{role}: {error}") from None


def versions_of(scenario: Scenario) -> dict[str, str]:
    """`landsim.versions.versions`, and of each plug-in: its package, version, and a digest of the package's source."""
    own = versions()
    return own | {f"{role} {name}": _version(role, name) for role, name in scenario.plug_ins.others().items()}


def _who(role: str, name: str) -> str:
    return f'{role} "{name}"'


@cache
def _entry(role: str, name: str) -> EntryPoint:
    group = f"landsim.{role}s"
    found = entry_points(group=group)
    named = [entry for entry in found if entry.name == name]
    if not named:
        known = [OWN, *sorted({entry.name for entry in found} - {OWN})]
        hint = did_you_mean(name, known)
        installed = "" if hint.startswith("; known") else f" (installed: {', '.join(known)})"
        raise PlugInError(f'no {role} "{name}" is installed (entry points of {group}){hint}{installed}')
    if len(named) > 1:
        raise PlugInError(f"{_who(role, name)} is offered by several packages: {', '.join(map(_package, named))}")
    return named[0]


def _package(entry: EntryPoint) -> str:
    """Name and version of the package that has an entry point."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown package"


@cache
def _factory(role: str, name: str) -> Callable[[Setup], Any]:
    entry = _entry(role, name)
    try:
        factory = entry.load()
    except (Exception, SystemExit) as failure:
        told = f"{type(failure).__name__}: {failure}"
        raise PlugInError(f"{_who(role, name)} of {_package(entry)} does not import: {told}") from failure
    if not callable(factory):
        wanted = "EstimatorSetup" if role == "estimator" else "ControllerSetup"
        raise PlugInError(f"{_who(role, name)}: {entry.value} is not a class or function that takes a {wanted}")
    made: Callable[[Setup], Any] = factory
    return made


def _made(role: str, name: str, setup: Setup) -> Any:
    """The plug-in, with all its methods."""
    factory = _factory(role, name)
    guard = Guard(_who(role, name))
    plug_in = guard.call("start", factory, setup)
    for method, arguments in METHODS[role].items():
        function = getattr(plug_in, method, None)
        if not callable(function):
            raise PlugInFault(f"{guard.who}: {type(plug_in).__name__} has no method {method}")
        try:
            inspect.signature(function).bind(*[None] * arguments)
        except TypeError:
            told = f"{method} must take {arguments} argument beside self, as landsim.plugins.{role.title()} says"
            raise PlugInFault(f"{guard.who}: {told}") from None
        except ValueError:  # one that is not written in Python tells nothing
            continue
    return plug_in


@cache
def _version(role: str, name: str) -> str:
    entry = _entry(role, name)
    return f"{_package(entry)}, source {_digest(entry.module)}"


def _digest(module: str) -> str:
    """Of the Python files of the package that a module is in: a version number stays while its author still edits."""
    top = module.partition(".")[0]
    spec = find_spec(top)
    digest = hashlib.sha256()
    if spec is not None:
        folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
        files = [(path.relative_to(folder).as_posix(), path) for folder in folders for path in folder.rglob("*.py")]
        if not files and spec.origin:
            files = [(top, Path(spec.origin))]
        for place, path in sorted(files):
            digest.update(f"{place}\n".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:DIGITS]
