"""Our own estimator and controller, made as a plug-in is: for the loop, and for those who vary them."""

import math

from landsim.guidance import INITIAL, guide, law_of
from landsim.navigation import Navigator
from landsim.plugins.interface import ControllerSetup, EstimatorSetup
from landsim.state import Command, NavState, Phase


def landsim_estimator(setup: EstimatorSetup) -> Navigator:
    """Our own estimator."""
    return Navigator(
        setup.camera,
        setup.noise_px,
        setup.runway_width,
        setup.site,
        setup.imu,
        setup.imu_dt,
        setup.mount,
        setup.config,
        setup.incidence,
        setup.latency,
        setup.handover,
    )


def landsim_controller(setup: ControllerSetup) -> "OwnController":
    """Our own controller."""
    return OwnController(setup)


class OwnController:
    """`landsim.guidance`, with what it remembers from call to call.

    Attributes
    ----------
    law : Law
        The aircraft's gains on this approach, SI; a plug-in may put another in its place (``dataclasses.replace``).
    memory : GuidanceState
        From the last call.
    """

    def __init__(self, setup: ControllerSetup) -> None:
        camera = setup.camera
        half_view = math.atan((camera.height - 0.5 - camera.cy) / camera.fy)
        self.law = law_of(setup.aircraft, setup.approach, setup.gravity, half_view, setup.dt, setup.go_around)
        self.memory = INITIAL

    def guide(self, nav: NavState) -> tuple[Command, Phase]:
        """As `Controller.guide`."""
        command, self.memory = guide(self.law, nav, self.memory)
        return command, self.memory.phase

    @property
    def reason(self) -> str:
        """Why the landing was given up; empty while it was not."""
        return self.memory.doubt.reason
