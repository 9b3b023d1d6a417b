"""What an estimator and a controller are given, and what they have to have."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from numpy.random import Generator

from estimator.alignment import Incidence, Start
from estimator.camera import PinholeCamera
from estimator.mount import Mount
from estimator.so3 import IDENTITY, Array, Vec3, flat, to_euler
from estimator.strapdown import ImuNoise, Site
from landsim.config import AircraftConfig, ApproachConfig, GoAroundConfig, NavigationConfig
from landsim.navigation import FrameResult
from landsim.state import CameraFrame, Command, ImuSample, NavState, Phase, Stage


@dataclass(frozen=True)
class EstimatorSetup:
    """What is known on board when navigation is switched on.

    Attributes
    ----------
    camera : PinholeCamera
        As calibrated, px.
    noise_px : float
        1 σ of the points that a line is fitted to, in u and in v, px.
    runway_width : float
        Between the painted edges, as charted, m.
    site : Site
        Gravity (m/s²), the Earth's rotation (runway frame, rad/s) and radius (m).
    imu : ImuNoise
        The inertial unit's data sheet, SI.
    imu_dt : float
        Between samples of the inertial unit, and of the pitot tube as `Estimator.take_airspeed` gets them, s.
    frame_dt : float
        Between camera frames, s; a whole multiple of ``imu_dt``.
    mount : Mount
        Lever arm from the centre of gravity to the camera (body frame, m), variance of the tilt reading (rad²).
    incidence : Incidence
        Angle of attack by airspeed in steady flight.
    config : NavigationConfig
        The scenario's ``[navigation]``, for those who have a use for its gates.
    settings : mapping
        The scenario's ``[plug-ins.estimator_settings]``; empty without them.
    rng : numpy.random.Generator
        For an estimator that draws, such as a particle filter: its numbers come from the flight's seed.
    latency : float
        From a frame's capture, which is its ``time``, to `Estimator.observe`, s; a whole multiple of ``imu_dt``.
    handover : Start or None
        State and covariance (15, 15) that whatever flew before hands over at time zero; None where there is nothing.
    """

    camera: PinholeCamera
    noise_px: float
    runway_width: float
    site: Site
    imu: ImuNoise
    imu_dt: float
    frame_dt: float
    mount: Mount
    incidence: Incidence
    config: NavigationConfig
    settings: Mapping[str, Any]
    rng: Generator
    latency: float = 0.0
    handover: Start | None = None


@dataclass(frozen=True)
class ControllerSetup:
    """What is known on board when guidance is switched on.

    Attributes
    ----------
    aircraft : AircraftConfig
        The aircraft's file: speeds, gains, wheels, camera mount.
    approach : ApproachConfig
        Glide slope (deg) and aim point (m).
    runway_width : float
        Between the painted edges, as charted, m.
    camera : PinholeCamera
        As calibrated, px.
    gravity : float
        m/s².
    dt : float
        Between calls of `Controller.guide`: the camera's interval, s.
    settings : mapping
        The scenario's ``[plug-ins.controller_settings]``; empty without them.
    rng : numpy.random.Generator
        Its numbers come from the flight's seed.
    go_around : GoAroundConfig
        The scenario's ``[go_around]``.  A flight that is in `Phase.GO_AROUND` is over at its end height.
    """

    aircraft: AircraftConfig
    approach: ApproachConfig
    runway_width: float
    camera: PinholeCamera
    gravity: float
    dt: float
    settings: Mapping[str, Any]
    rng: Generator
    go_around: GoAroundConfig = GoAroundConfig()  # noqa: RUF009 - frozen


class Estimator(Protocol):
    """Navigation: from measurements to a navigation state.

    One interval of the inertial unit after the other: `take_airspeed`, `propagate` (but not at time zero, when no
    interval has passed), and, where a camera frame falls due, `observe`.  `state` is asked for in between.

    Three attributes are optional; one that is missing counts as None.

    ``diverged`` : str or None
        Why the estimate is no longer to be believed, which ends the flight; asked after each frame.
    ``covariance`` : (9, 9) or (15, 15) array or None
        Of the errors, true less estimated, of position (m) and velocity (m/s) in the runway frame, of the attitude
        (rotation vector in the runway frame, rad), and of the biases of gyros (rad/s) and accelerometers (m/s²).  The
        log's ``sigma_*`` and normalised errors come from it; without it they are NaN, and what the metrics say of
        consistency is None.
    ``bias`` : (6,) array or None
        Of gyros (rad/s) and accelerometers (m/s²), body frame; for the log.
    """

    def take_airspeed(self, airspeed: float) -> None:
        """Take in a sample of the pitot tube.

        Parameters
        ----------
        airspeed : float
            m/s, noisy and lagging; at the rate of the inertial unit, from time zero on.
        """

    def propagate(self, sample: ImuSample) -> None:
        """Take in a sample of the inertial unit, at the end of its interval.

        Parameters
        ----------
        sample : (6,) array
            Integrated over the interval: angular rate relative to inertial space (body frame, rad), specific force
            (body frame at the interval's start, m/s).
        """

    def observe(self, frame: CameraFrame) -> FrameResult | None:
        """Take in a camera frame.

        Parameters
        ----------
        frame : CameraFrame
            Time (s), lines (3, 7) of left edge, threshold and right edge, each as `LineReading` (a row of NaN for a
            line that is not in view), and the mount's angle as read (rad, optical axis down positive).

        Returns
        -------
        FrameResult or None
            For the log: the innovation and its gate, and the roll that two lines were given.  With None the frame is
            logged by the lines that it holds and the stage that `state` tells afterwards.
        """

    def state(self, time: float) -> NavState:
        """What is known now; asked any number of times, it changes nothing.

        Parameters
        ----------
        time : float
            Since the start, s: the end of the last interval that was propagated.

        Returns
        -------
        NavState
            Of the centre of gravity and the body, runway frame; `nav_state` makes one.  Until ``ready`` is true only
            the airspeed counts, which the inner loops need from the first sample on; `not_ready` makes such a one.
        """


class Controller(Protocol):
    """Guidance: from the navigation state to a command.

    ``reason``, a str, is optional: why it went around.
    """

    def guide(self, nav: NavState) -> tuple[Command, Phase]:
        """Steer; called once a camera interval, from time zero on, after what was measured by then.

        At time zero the order is `Estimator.take_airspeed`, `Estimator.observe` if frames arrive without latency,
        `Estimator.state`, and this.

        Parameters
        ----------
        nav : NavState
            All that is known of the flight.  While it is not ready, the aircraft flies in trim if the command is not
            engaged.

        Returns
        -------
        Command
            For the aircraft's inner loops, until the next call: pitch and bank (rad), airspeed (m/s), steering (-1 to
            1), brake (0 to 1), the camera's tilt (rad).
        Phase
            For the log; the metrics take the flare's beginning from it.
        """


def nav_state(
    time: float,
    position: Sequence[float] | Array,
    velocity: Sequence[float] | Array,
    R_runway_from_body: Sequence[float] | Array,
    rate: Sequence[float] | Array,
    airspeed: float,
    stage: Stage,
    *,
    side_force: float = 0.0,
) -> NavState:
    """A navigation state that is ready, with the Euler angles of its attitude.

    It states no protection level and no alarm; ``_replace`` puts them in.

    Parameters
    ----------
    time : float
        s.
    position, velocity : (3,) array_like
        Of the centre of gravity, runway frame, m and m/s.
    R_runway_from_body : (3, 3) array_like
        Or its nine numbers, row by row.
    rate : (3,) array_like
        Of the body relative to the ground, body frame, rad/s.
    airspeed : float
        m/s.
    stage : Stage
        What the last camera frame gave.
    side_force : float, optional
        Specific force along body y, less the estimated bias, m/s²; what holds the track in a cross wind goes by it.
    """
    attitude = flat(R_runway_from_body)
    roll, pitch, yaw = to_euler(attitude)
    return NavState(
        time,
        True,
        _vector(position),
        _vector(velocity),
        attitude,
        roll,
        pitch,
        yaw,
        _vector(rate),
        airspeed,
        stage,
        side_force=float(side_force),
    )


def not_ready(time: float, airspeed: float = math.nan) -> NavState:
    """A navigation state of which the airspeed (m/s) alone is known; NaN before the pitot tube's first sample."""
    return NavState(time, False, _ZERO, _ZERO, IDENTITY, 0.0, 0.0, 0.0, _ZERO, airspeed, Stage.NONE)


_ZERO: Vec3 = (0.0, 0.0, 0.0)


def _vector(values: Sequence[float] | Array) -> Vec3:
    x, y, z = values
    return float(x), float(y), float(z)
