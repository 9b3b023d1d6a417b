"""Estimators and controllers of others: what they are given, what they give, and how they are found.

A scenario names them, and a package that is installed beside landsim declares them as Python entry points::

    [plug-ins]                                      # in the scenario
    estimator = "alpha-beta"

    [project.entry-points."landsim.estimators"]     # in the package's pyproject.toml
    alpha-beta = "landing_example:AlphaBeta"

The object named is called once a flight with an `EstimatorSetup` and returns an `Estimator`; one of the group
``landsim.controllers`` is called with a `ControllerSetup` and returns a `Controller`.  Both know what is known on
board: measurements, data sheets and their own settings.  Nothing that is true is within their reach.

This module is what a plug-in imports; what stands in ``__all__`` keeps its names.  Frames, signs and units are those of
``estimator/__init__.py``: SI and radians, the runway frame with x along the landing direction, y right and z down.
``docs/plug-ins.md`` makes a package step by step.

::

    interface    the setups, the protocols, and a navigation state from its numbers
    own          landsim's own two, for those who vary them
    loading      found by name, made, and told by version
    guard        what a plug-in raises or returns, checked at every call
"""

from estimator.alignment import Incidence
from estimator.camera import PinholeCamera
from estimator.fusion import NO_UPDATE, Update
from estimator.mount import Mount
from estimator.strapdown import ImuNoise, Site
from landsim.config import AircraftConfig, ApproachConfig, NavigationConfig
from landsim.guidance import Law
from landsim.navigation import FrameResult
from landsim.plugins.guard import PlugInFault
from landsim.plugins.interface import Controller, ControllerSetup, Estimator, EstimatorSetup, nav_state, not_ready
from landsim.plugins.loading import controller_of, estimator_of, refuse_bad, versions_of
from landsim.plugins.own import OwnController, landsim_controller, landsim_estimator
from landsim.state import Alarm, CameraFrame, Command, ImuSample, LineReading, NavState, Phase, Stage

__all__ = [
    "NO_UPDATE",
    "AircraftConfig",
    "Alarm",
    "ApproachConfig",
    "CameraFrame",
    "Command",
    "Controller",
    "ControllerSetup",
    "Estimator",
    "EstimatorSetup",
    "FrameResult",
    "ImuNoise",
    "ImuSample",
    "Incidence",
    "Law",
    "LineReading",
    "Mount",
    "NavState",
    "NavigationConfig",
    "OwnController",
    "Phase",
    "PinholeCamera",
    "PlugInFault",
    "Site",
    "Stage",
    "Update",
    "controller_of",
    "estimator_of",
    "landsim_controller",
    "landsim_estimator",
    "nav_state",
    "not_ready",
    "refuse_bad",
    "versions_of",
]
