"""The true state in place of navigation's, for comparison alone: ``simulation.guidance_state = "truth"``.

With it a flight shows what control and weather make of a landing that knows where it is.  Sensors that steer directly
stay what they are: the inertial unit's rates and side force, and the pitot tube.
"""

from estimator.so3 import Array, log_between, to_euler
from estimator.strapdown import inertial
from landsim.state import NavState, Stage
from landsim.truth import Truth


def true_state(truth: Truth, before: Array, dt: float, airspeed: float, side_force: float) -> NavState:
    """What guidance is given when it is given the truth.

    Parameters
    ----------
    truth : Truth
        Now.
    before : (15 or more,) array
        ``Truth.motion`` a step ago: the body rates are the mean ones since.
    dt : float
        The step, s.
    airspeed : float
        From the pitot tube, m/s.
    side_force : float
        Specific force along body y as measured, m/s².
    """
    position, velocity, attitude = inertial(truth.motion)
    turn = log_between(inertial(before).attitude, attitude)
    roll, pitch, yaw = to_euler(attitude)
    rate = (turn[0] / dt, turn[1] / dt, turn[2] / dt)
    return NavState(
        truth.time,
        True,
        position,
        velocity,
        attitude,
        roll,
        pitch,
        yaw,
        rate,
        airspeed,
        Stage.EARLY,
        side_force=side_force,
    )
