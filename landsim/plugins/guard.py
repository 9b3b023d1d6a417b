"""Stands between the loop and a plug-in: what it raises and what it returns is checked at every call.

A plug-in gets copies of what it might write into.  What it returns is taken as arrays or sequences of any make, and
handed on as the loop and the recorder have it from our own.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from estimator.covariance import LEFT, RIGHT, THRESHOLD
from estimator.fusion import NO_UPDATE, Update
from estimator.mount import camera_axes
from estimator.so3 import IDENTITY, Array, Mat3, Vec3, from_euler
from estimator.strapdown import STATES, Inertial
from landsim.errors import one_line
from landsim.navigation import FrameResult
from landsim.plugins.interface import Controller, Estimator, not_ready
from landsim.state import Alarm, CameraFrame, Command, ImuSample, NavState, Phase, Stage

NAN = math.nan
ORTHONORMAL = 1e-3
"""Largest element by which Rᵀ R may differ from the identity, and R from the matrix of its Euler angles."""
WITHOUT_BIASES = 9
"""Errors of position, velocity and attitude."""

_T = TypeVar("_T")


class PlugInFault(Exception):
    """A plug-in raised, or returned what cannot be used; ``str()`` of it is one line, its cause is what it raised."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class Belief(NamedTuple):
    """What an estimator says of its errors."""

    covariance: Array
    """(15, 15); NaN for the biases where it has none."""
    bias: Array
    """(6,); NaN where it tells none."""


class Guard:
    """Calls a plug-in.

    Parameters
    ----------
    who : str
        As it is told in errors.
    """

    def __init__(self, who: str) -> None:
        self.who = who

    def call(self, what: str, function: Callable[..., _T], *given: Any) -> _T:
        """Call a method; what it raises is its fault."""
        try:
            return function(*given)
        except (Exception, SystemExit) as failure:
            text = f"{type(failure).__name__}: {failure}" if str(failure) else type(failure).__name__
            raise PlugInFault(f"{self.who}: {what}: {text}") from failure

    def fault(self, what: str, told: str) -> PlugInFault:
        """A fault of something that was returned."""
        return PlugInFault(f"{self.who}: {what}: {told}")

    def array(self, what: str, value: Any, *shape: int) -> Array:
        """Finite numbers of a shape."""
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != shape:
            wanted = " by ".join(str(n) for n in shape)
            raise self.fault(what, f"must be {wanted} numbers, not {_shown(value)}")
        if not np.isfinite(array).all():
            raise self.fault(what, f"is not finite: {_shown(value)}")
        return array

    def numbers(self, what: str, name: str, value: Any, count: int) -> tuple[float, ...]:
        """So many finite numbers; of a sequence quickly, since the state is asked for at every step."""
        try:
            plain = isinstance(value, tuple | list) and len(value) == count
            floats = tuple(map(float, value if plain else np.asarray(value, dtype=float).ravel().tolist()))
        except (TypeError, ValueError):
            floats = ()
        if len(floats) != count:
            raise self.fault(what, f"{name} must be {count} numbers, not {_shown(value)}")
        if not all(map(math.isfinite, floats)):
            raise self.fault(what, f"{name} is not finite: {_shown(value)}")
        return floats

    def number(self, what: str, name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number in a range."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise self.fault(what, f"{name} must be a number, not {_shown(value)}") from None
        if not math.isfinite(number):
            raise self.fault(what, f"{name} is not finite: {_shown(value)}")
        if not low <= number <= high:
            raise self.fault(what, f"{name} must be from {low:g} to {high:g}, not {number:g}")
        return number


def _is_rotation(matrix: Mat3) -> bool:
    """Whether the columns are of length one, at right angles and right-handed, to `ORTHONORMAL`."""
    a, b, c, d, e, f, g, h, i = matrix
    products = (
        a * a + d * d + g * g - 1.0,
        b * b + e * e + h * h - 1.0,
        c * c + f * f + i * i - 1.0,
        a * b + d * e + g * h,
        a * c + d * f + g * i,
        b * c + e * f + h * i,
    )
    right_handed = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0
    return right_handed and max(map(abs, products)) < ORTHONORMAL


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


class GuardedEstimator:
    """An estimator of others, as the loop and the recorder take our own `landsim.navigation.Navigator`.

    Parameters
    ----------
    who : str
        As it is told in errors.
    plug_in : Estimator
    imu_dt : float
        Interval of the inertial unit, s.
    """

    def __init__(self, who: str, plug_in: Estimator, imu_dt: float) -> None:
        self._guard = Guard(who)
        self._plug_in = plug_in
        self._dt = imu_dt
        self._intervals = 0
        self._airspeeds = 0
        self._state: NavState | None = None
        self._nominal = _UNKNOWN

    def take_airspeed(self, airspeed: float) -> None:
        """As `Estimator.take_airspeed`."""
        self._guard.call("take_airspeed", self._plug_in.take_airspeed, airspeed)
        self._airspeeds += 1
        self._state = None

    def propagate(self, sample: ImuSample) -> None:
        """As `Estimator.propagate`."""
        self._guard.call("propagate", self._plug_in.propagate, sample.copy())
        self._intervals += 1
        self._state = None

    def observe(self, frame: CameraFrame) -> FrameResult:
        """Take in a camera frame."""
        before = self._known()
        given = self._guard.call("observe", self._plug_in.observe, frame._replace(lines=frame.lines.copy()))
        self._state = None
        after = self._known()
        if given is not None:
            return self._told(given)
        left, threshold, right = (not math.isnan(frame.lines[i, 0]) for i in (LEFT, THRESHOLD, RIGHT))
        late = after.stage is Stage.LATE and threshold
        if not (before.ready and left and right):
            return FrameResult(NO_UPDATE, after.stage, NAN, late)
        degrees = 6 if threshold and not late else 4
        roll = NAN
        if degrees == 4:
            right_axis, down, _ = camera_axes(before.R_runway_from_body, frame.tilt)
            roll = math.atan2(right_axis[2], down[2])
        return FrameResult(Update(degrees, NAN, after.stage is not Stage.NONE), after.stage, roll, late)

    def _told(self, given: Any) -> FrameResult:
        """What `observe` returned."""
        if not (isinstance(given, FrameResult) and isinstance(given.update, Update)):
            raise self._guard.fault("observe", f"must return a FrameResult or None, not {_shown(given)}")
        degrees, _, _ = given.update
        if degrees not in {0, 4, 6}:
            raise self._guard.fault("observe", f"degrees of freedom must be 6, 4 or 0, not {_shown(degrees)}")
        return given

    def _known(self) -> NavState:
        """The state, checked; asked for once, however often it is needed."""
        if self._state is None:
            self._state = self._checked(self._guard.call("state", self._plug_in.state, self._intervals * self._dt))
            s = self._state
            known = s.ready
            self._nominal = Inertial(s.position, s.velocity, s.R_runway_from_body).numbers() if known else _UNKNOWN
        return self._state

    def _checked(self, given: Any) -> NavState:
        guard = self._guard
        if not isinstance(given, NavState):
            raise guard.fault("state", f"must return a NavState, not {_shown(given)}")
        if not given.ready:
            told = NAN if self._airspeeds == 0 else guard.number("state", "airspeed", given.airspeed)
            return not_ready(given.time, told)._replace(stage=self._stage(given.stage))
        matrix = cast("Mat3", guard.numbers("state", "R_runway_from_body", given.R_runway_from_body, 9))
        angles = guard.numbers("state", "roll, pitch and yaw", (given.roll, given.pitch, given.yaw), 3)
        if not _is_rotation(matrix):
            raise guard.fault("state", "R_runway_from_body is not a rotation")
        roll, pitch, yaw = angles
        if max(abs(x - y) for x, y in zip(matrix, from_euler(roll, pitch, yaw), strict=True)) > ORTHONORMAL:
            raise guard.fault("state", "roll, pitch and yaw are not those of R_runway_from_body")
        return NavState(
            given.time,
            True,
            cast("Vec3", guard.numbers("state", "position", given.position, 3)),
            cast("Vec3", guard.numbers("state", "velocity", given.velocity, 3)),
            matrix,
            roll,
            pitch,
            yaw,
            cast("Vec3", guard.numbers("state", "rate", given.rate, 3)),
            guard.number("state", "airspeed", given.airspeed),
            self._stage(given.stage),
            self._level("lateral_protection", given.lateral_protection),
            self._level("vertical_protection", given.vertical_protection),
            self._alarm(given.alarm),
            guard.number("state", "side_force", given.side_force),
        )

    def _level(self, name: str, given: Any) -> float:
        """A protection level; NaN for none."""
        if isinstance(given, float) and math.isnan(given):
            return given
        return self._guard.number("state", name, given, low=0.0)

    def _alarm(self, given: Any) -> Alarm:
        try:
            return Alarm(given)
        except (TypeError, ValueError):
            raise self._guard.fault("state", f"alarm must be an Alarm, not {_shown(given)}") from None

    def _stage(self, given: Any) -> Stage:
        try:
            return Stage(given)
        except ValueError:
            raise self._guard.fault("state", f"stage must be a Stage, not {_shown(given)}") from None

    def _optional(self, name: str) -> Any:
        return self._guard.call(name, getattr, self._plug_in, name, None)

    @property
    def diverged(self) -> str | None:
        """Why it is no longer to be believed."""
        why = self._optional("diverged")
        if why is None or why is False:
            return None
        return one_line(why) if isinstance(why, str) else "it says so"

    @property
    def known(self) -> Belief | None:
        """What it says of its errors."""
        if not self.ready or (told := self._optional("covariance")) is None:
            return None
        size = STATES if np.shape(told) == (STATES, STATES) else WITHOUT_BIASES
        covariance = np.full((STATES, STATES), NAN)
        covariance[:size, :size] = self._guard.array("covariance", told, size, size)
        bias = self._optional("bias")
        return Belief(covariance, _NO_BIAS if bias is None else self._guard.array("bias", bias, 6))

    @property
    def ready(self) -> bool:
        """Whether there is a state."""
        return self._known().ready

    @property
    def stage(self) -> Stage:
        """What the last frame gave."""
        return self._known().stage

    @property
    def airspeed(self) -> float:
        """m/s."""
        return self._known().airspeed

    @property
    def nominal(self) -> Array:
        """As `Navigator.nominal`."""
        self._known()
        return self._nominal

    def roll_and_pitch(self) -> tuple[float, float]:
        """Of the body, rad."""
        state = self._known()
        return state.roll, state.pitch

    def state(self, time: float) -> NavState:
        """What guidance is given."""
        return self._known()._replace(time=time)


_UNKNOWN = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), IDENTITY).numbers()
_NO_BIAS = np.full(6, NAN)


class GuardedController:
    """A controller of others, as the loop takes our own.

    Parameters
    ----------
    who : str
        As it is told in errors.
    plug_in : Controller
    """

    def __init__(self, who: str, plug_in: Controller) -> None:
        self._guard = Guard(who)
        self._plug_in = plug_in

    @property
    def reason(self) -> str:
        """Why the landing was given up: the plug-in's optional ``reason``."""
        return str(getattr(self._plug_in, "reason", ""))

    def guide(self, nav: NavState) -> tuple[Command, Phase]:
        """As `Controller.guide`."""
        guard = self._guard
        given: Any = guard.call("guide", self._plug_in.guide, nav)
        if not (isinstance(given, tuple) and len(given) == 2 and isinstance(given[0], Command)):
            raise guard.fault("guide", f"must return a Command and a Phase, not {_shown(given)}")
        command, phase = given
        try:
            phase = Phase(phase)
        except ValueError:
            raise guard.fault("guide", f"must return a Phase with the command, not {_shown(phase)}") from None
        return Command(
            engaged=bool(command.engaged),
            pitch=guard.number("guide", "pitch", command.pitch),
            roll=guard.number("guide", "roll", command.roll),
            airspeed=guard.number("guide", "airspeed", command.airspeed),
            idle=bool(command.idle),
            ground=bool(command.ground),
            steering=guard.number("guide", "steering", command.steering, -1.0, 1.0),
            brake=guard.number("guide", "brake", command.brake, 0.0, 1.0),
            tilt=guard.number("guide", "tilt", command.tilt),
            align=guard.number("guide", "align", command.align, 0.0, 1.0),
            rudder=guard.number("guide", "rudder", command.rudder),
        ), phase
