"""Plug-ins for landsim: an estimator with fixed gains, and a flare that takes the sink off evenly with time."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from estimator import three_line_pose, two_line_pose
from estimator.mount import body_from_camera, camera_axes
from estimator.so3 import Array, Vec3, exp, from_euler, log, matmul, rotate, rotate_back, transpose
from estimator.strapdown import Inertial, propagate
from landsim.plugins import (
    CameraFrame,
    Command,
    ControllerSetup,
    EstimatorSetup,
    ImuSample,
    NavState,
    Phase,
    Stage,
    landsim_controller,
    nav_state,
    not_ready,
)


def refuse_unknown(settings: Mapping[str, Any], *known: str) -> None:
    """Refuse settings that nothing would read: one that is misspelt would change nothing, and nobody would notice."""
    for name in settings:
        if name not in known:
            raise ValueError(f"there is no setting {name}; there are {', '.join(known)}")


class AlphaBeta:
    """The inertial unit carries the state from frame to frame; each frame's pose takes it a fixed share of the way."""

    def __init__(self, setup: EstimatorSetup) -> None:
        refuse_unknown(setup.settings, "bandwidth_per_s", "turn_share")
        self.setup = setup
        bandwidth = setup.settings.get("bandwidth_per_s", 1.0)
        if not 0.0 < bandwidth * setup.frame_dt < 0.5:
            raise ValueError(f"bandwidth_per_s must be above 0 and below {0.5 / setup.frame_dt:g}, not {bandwidth}")
        self.alpha = math.sqrt(2.0) * bandwidth * setup.frame_dt  # of the position's error, a frame
        self.beta = bandwidth**2 * setup.frame_dt  # of the same, into the velocity
        self.gamma = setup.settings.get("turn_share", 0.02)  # of the attitude's error, a frame
        self.inertial: Inertial | None = None
        self.rate: Vec3 = (0.0, 0.0, 0.0)
        self.airspeed = math.nan
        self.frames = 0
        self.stage = Stage.NONE

    def take_airspeed(self, airspeed: float) -> None:
        """Smooth the pitot tube's noise."""
        if math.isnan(self.airspeed):
            self.airspeed = airspeed
        self.airspeed += self.setup.imu_dt / self.setup.config.airspeed_smoothing_s * (airspeed - self.airspeed)

    def propagate(self, sample: ImuSample) -> None:
        """Carry the state on by an interval of the inertial unit."""
        dt, site = self.setup.imu_dt, self.setup.site
        x, y, z, *force = sample.tolist()
        self.rate = (x / dt, y / dt, z / dt)
        if self.inertial is not None:
            self.inertial, _ = propagate(self.inertial, site, (x, y, z), tuple(force), dt)
            p, q, r = rotate_back(self.inertial.attitude, site.earth_rate)  # the unit feels the Earth turn
            self.rate = (x / dt - p, y / dt - q, z / dt - r)

    def observe(self, frame: CameraFrame) -> None:
        """Take the pose of three lines, or what two give of it."""
        camera, width = self.setup.camera, self.setup.runway_width
        left, threshold, right = frame.lines[:, :3]
        self.stage = Stage.NONE
        three = three_line_pose(camera, left, threshold, right, runway_width=width)
        if three.valid:
            self.stage = Stage.EARLY
            self.correct(three.position, three.R_cam_from_runway, frame.tilt)
        elif self.inertial is not None:
            position, _, attitude = self.inertial  # it lends what two lines do not give: roll and distance
            axis_right, down, _ = camera_axes(attitude, frame.tilt)
            roll = math.atan2(axis_right[2], down[2])
            two = two_line_pose(camera, left, right, runway_width=width, roll=roll)
            if two.valid:
                self.stage = Stage.LATE
                along = position[0] + rotate(attitude, self.setup.mount.lever)[0]
                triad = np.reshape(from_euler(roll, float(two.pitch), float(two.yaw)), (3, 3))
                R_cam_from_runway = triad.T[[1, 2, 0]]  # forward, right, down to right, down, forward
                self.correct(np.array((along, two.lateral, -two.height)), R_cam_from_runway, frame.tilt)

    def correct(self, position: Array, R_cam_from_runway: Array, tilt: float) -> None:
        """Move the state a share of the way to a pose of the camera."""
        seen = body_from_camera(position.tolist(), R_cam_from_runway, tilt, self.setup.mount.lever)
        if self.inertial is None:  # the first: as fast as the air passes, along where the nose points
            alpha = self.setup.incidence.at(self.airspeed)
            ahead = (self.airspeed * math.cos(alpha), 0.0, self.airspeed * math.sin(alpha))
            self.inertial = Inertial(seen.position, rotate(seen.attitude, ahead), seen.attitude)
        now = self.inertial
        self.frames += 1
        mean = 1.0 / self.frames  # at first all frames count alike
        error = np.subtract(seen.position, now.position)
        turn = max(self.gamma, mean) * np.array(log(matmul(seen.attitude, transpose(now.attitude))))
        self.inertial = Inertial(
            tuple((now.position + max(self.alpha, mean) * error).tolist()),
            tuple((now.velocity + self.beta * error).tolist()),
            matmul(exp(tuple(turn.tolist())), now.attitude),
        )

    def state(self, time: float) -> NavState:
        """What guidance is given."""
        if self.inertial is None or self.frames < self.setup.config.start_frames:
            return not_ready(time, self.airspeed)
        return nav_state(time, *self.inertial, self.rate, self.airspeed, self.stage)


class EvenFlare:
    """Landsim's own guidance, but for a flare whose sink rate falls evenly with time instead of with the height."""

    def __init__(self, setup: ControllerSetup) -> None:
        refuse_unknown(setup.settings, "touchdown_sink_mps")
        self.own = landsim_controller(setup)
        self.touchdown = setup.settings.get("touchdown_sink_mps", 0.4)

    def guide(self, nav: NavState) -> tuple[Command, Phase]:
        """Steer."""
        law = self.own.law
        command, phase = self.own.guide(nav)
        if phase is not Phase.FLARE:
            return command, phase
        height = max(-nav.position[2] - rotate(nav.R_runway_from_body, law.wheels)[2], 0.0)
        own = (height + law.flare_bias) / law.flare_time  # the sink rate that landsim's own flare asks for
        first = law.approach_speed * law.slope
        left = min(height / law.flare_height, 1.0)
        wanted = math.sqrt(self.touchdown**2 + left * (first**2 - self.touchdown**2))  # s² = s₁² + 2 a h
        pitch = command.pitch + (own - wanted) * (1.0 / nav.airspeed + law.pitch_gain)
        return command._replace(pitch=max(law.pitch_min, min(law.pitch_max, pitch))), phase
