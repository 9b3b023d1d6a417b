"""The aircraft: JSBSim, seen through SI units and the runway frame.

The only file that imports jsbsim; feet, pounds and degrees end here.  An aircraft's folder holds ``<model>.xml`` with
``Systems/`` and ``Engines/`` beside it.  The model must offer what :class:`Plant` reads and writes (``imu/*``,
``nav/*``, ``ap/*``; its first three contacts are the nose, left and right main wheels); a property that it lacks is an
error, because JSBSim itself would make one silently.  To fly with another mass or centre of gravity than the nominal
ones it needs three point masses, the first of all that it has, of no weight: at the nominal centre of gravity, ahead of
it and behind it.

JSBSim's ground is the ellipsoid, raised; the runway is a plane.  The terrain under the aircraft is therefore set to the
runway's plane at every step, so that wheels touch where the runway frame's z says they do.
"""

import math
from pathlib import Path
from typing import NamedTuple

import jsbsim
import numpy as np

from estimator.compiled import compiled
from estimator.so3 import Array, Vec3, rotate, rotate_back
from estimator.strapdown import inertial, rows
from landsim.atmosphere import STANDARD_AIR, Atmosphere, standard_density
from landsim.attitude import runway_attitude
from landsim.config import AirConfig
from landsim.errors import InputError
from landsim.runway import Runway
from landsim.state import Command
from landsim.truth import MOTION, NOMINAL, NUMBERS, InitialState, Loading, Truth
from landsim.units import DEG, FT, HPA_IN_PSF, INCH, KELVIN_IN_RANKINE, LB, LBF, SLUG

RUN_UP_S = 1.0
"""Time the engine runs, airframe held, before trim: JSBSim's search for a steady propeller diverges from standstill."""
RUN_UP_THROTTLE = 0.3
TERRAIN_HEIGHT = 30.0
"""m; above it no aircraft feels the ground: the terrain is left as it is."""
CONTACT_HEIGHT = 10.0
"""m; above it none touches the ground: contacts are not asked."""
_ON_GROUND = MOTION + 6
_WIND = 15
"""Where the site's numbers end with the wind."""
_GUST = ("atmosphere/gust-north-fps", "atmosphere/gust-east-fps", "atmosphere/gust-down-fps")

_INTEGRATORS = (
    "simulation/integrator/rate/rotational",
    "simulation/integrator/rate/translational",
    "simulation/integrator/position/rotational",
    "simulation/integrator/position/translational",
)
_READ = (
    "position/ecef-x-ft",
    "position/ecef-y-ft",
    "position/ecef-z-ft",
    "position/lat-geod-rad",
    "position/long-gc-rad",
    "velocities/ecef-x-fps",
    "velocities/ecef-y-fps",
    "velocities/ecef-z-fps",
    "attitude/phi-rad",
    "attitude/theta-rad",
    "attitude/psi-rad",
    "velocities/vt-fps",
    "fcs/elevator-pos-rad",
    "fcs/left-aileron-pos-rad",
    "fcs/rudder-pos-rad",
    "fcs/throttle-pos-norm",
)
_WHEELS = ("gear/unit[0]/WOW", "gear/unit[1]/WOW", "gear/unit[2]/WOW")
_FEED = (
    "imu/p-rad_sec",
    "imu/q-rad_sec",
    "imu/r-rad_sec",
    "imu/ay-mps2",
    "nav/roll-rad",
    "nav/pitch-rad",
    "nav/airspeed-mps",
)
_COMMAND = (
    "ap/engaged",
    "ap/pitch-cmd-rad",
    "ap/roll-cmd-rad",
    "ap/airspeed-cmd-mps",
    "ap/idle",
    "ap/ground",
    "ap/steering-cmd-norm",
    "ap/brake-cmd-norm",
    "ap/align",
    "ap/rudder-align-rad",
)
_BALANCES = (  # what trim brings to zero, its tolerance in JSBSim's units, and what it moves to get there
    ("wdot", "accelerations/wdot-ft_sec2", 1e-3, "lift (angle of attack)"),
    ("udot", "accelerations/udot-ft_sec2", 1e-3, "speed (throttle)"),
    ("qdot", "accelerations/qdot-rad_sec2", 1e-4, "pitch (elevator)"),
    ("vdot", "accelerations/vdot-ft_sec2", 1e-3, "side force (bank)"),
    ("pdot", "accelerations/pdot-rad_sec2", 1e-4, "roll (aileron)"),
    ("rdot", "accelerations/rdot-rad_sec2", 1e-4, "yaw (rudder)"),
)


_TURN = ("velocities/r-rad_sec", "velocities/q-rad_sec")
_BALLAST = "inertia/pointmass-weight-lbs"
CALM: Vec3 = (0.0, 0.0, 0.0)


class PlantError(InputError):
    """The model cannot be loaded, or lacks a property."""


class TrimError(RuntimeError):
    """The aircraft has no steady flight at the state asked for."""


class StepError(RuntimeError):
    """JSBSim failed in flight."""


class TrimPoint(NamedTuple):
    """Steady flight as JSBSim found it."""

    alpha: float
    """Angle of attack, rad."""
    elevator: float
    """rad, trailing edge down positive."""
    thrust: float
    """N."""
    pitch: float
    """Relative to the local horizon, rad."""
    throttle: float
    """0 to 1."""


class _Listener(jsbsim.FGLogger):
    """Keeps what JSBSim would print, warnings and worse; nothing reaches the terminal."""

    def __init__(self) -> None:
        super().__init__()
        self._level = jsbsim.LogLevel.BULK
        self._words: list[str] = []

    def set_level(self, level: jsbsim.LogLevel) -> None:
        self._level = level

    def message(self, text: str) -> None:
        if self._level >= jsbsim.LogLevel.WARN:
            self._words.append(text)

    def file_location(self, filename: str, line: int) -> None:
        self._words.append(f"{Path(filename).name} line {line}: ")

    def format(self, style: jsbsim.LogFormat) -> None: ...

    def flush(self) -> None: ...

    @property
    def heard(self) -> str:
        return " ".join("".join(self._words).split())


def _direction(initial: InitialState) -> Vec3:
    """Of flight over the ground, runway frame."""
    climb, heading = initial.flight_path, initial.heading
    return math.cos(climb) * math.cos(heading), math.cos(climb) * math.sin(heading), -math.sin(climb)


def velocities(initial: InitialState) -> tuple[Vec3, Vec3]:
    """Over the ground and through the air, runway frame, m/s.

    Along the ground's direction d the speed is the s for which |s d - wind| is the airspeed.

    Raises
    ------
    TrimError
        When the wind across or ahead is faster than the aircraft.
    """
    along, wind, speed = _direction(initial), initial.wind, initial.speed
    ahead = along[0] * wind[0] + along[1] * wind[1] + along[2] * wind[2]
    square = ahead * ahead - (wind[0] ** 2 + wind[1] ** 2 + wind[2] ** 2) + speed * speed
    over = ahead + math.sqrt(max(square, 0.0))
    if square <= 0.0 or over <= 0.0:
        strength = math.hypot(*wind)
        raise TrimError(f"at {speed:.1f} m/s through the air it makes no way against a wind of {strength:.1f} m/s")
    x, y, z = (over * a for a in along)
    return (x, y, z), (x - wind[0], y - wind[1], z - wind[2])


def _listen() -> _Listener:
    """A fresh listener; JSBSim has one for the whole process."""
    listener = _Listener()
    jsbsim.set_logger(listener)
    return listener


def load(folder: Path, model: str) -> jsbsim.FGFDMExec:
    """JSBSim with the model loaded, without a word on the terminal.

    Raises
    ------
    PlantError
        When there is no such file, or JSBSim finds fault with it.
    """
    folder = folder.resolve()
    path = folder / f"{model}.xml"
    if not path.is_file():
        raise PlantError(f"{path}: no such aircraft model")
    listener = _listen()
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    try:
        loaded = fdm.load_model_with_paths(model, str(folder), str(folder / "Engines"), str(folder / "Systems"), False)
    except jsbsim.BaseError as error:
        raise PlantError(f"{path}: JSBSim refuses it: {listener.heard or error}") from error
    if listener.heard or not loaded:
        raise PlantError(f"{path}: JSBSim refuses it: {listener.heard or 'no reason given'}")
    return fdm


def node(fdm: jsbsim.FGFDMExec, name: str) -> jsbsim.FGPropertyNode:
    """A property's node.

    Raises
    ------
    PlantError
        When the loaded model has no such property.
    """
    found = fdm.get_property_manager().get_node(name, False)
    if found is None:
        raise PlantError(f"{fdm.get_model_name()}: JSBSim has no property {name!r} in this model")
    return found


class Plant:
    """One flight of one aircraft.

    Parameters
    ----------
    folder : Path
        Holds the model.
    model : str
        Name of the model's file, without ``.xml``.
    runway : Runway
        Whose frame is used, and whose plane is the ground.
    rate_hz : float
        Steps a second.
    loading : Loading
        How its mass differs from the nominal one.
    atmosphere : Atmosphere, optional
        The wind along the way; without it the wind is that of the start throughout.
    air : AirConfig, optional
        How the air differs from the standard atmosphere.

    Attributes
    ----------
    density_ratio : float
        Density of the air at the start over that of the standard atmosphere there; exactly 1 where it is standard.

    Raises
    ------
    PlantError
        When the model does not load, lacks a property, or has no point masses and is to be loaded by them.
    """

    trim: TrimPoint

    def __init__(
        self,
        folder: Path,
        model: str,
        runway: Runway,
        rate_hz: float,
        loading: Loading = NOMINAL,
        atmosphere: Atmosphere | None = None,
        air: AirConfig = STANDARD_AIR,
    ) -> None:
        self._runway = runway
        self._atmosphere = atmosphere
        self._air = air
        self.density_ratio = 1.0
        self._site = np.array(
            (
                *(FT * r for r in runway.R_runway_from_ecef),
                *rotate(runway.R_runway_from_ecef, runway.origin_in_ecef),
                *(runway.latitude, runway.longitude, runway.heading),
                *CALM,
            )
        )
        self._rows = rows(NUMBERS)
        self._dt = 1.0 / rate_hz
        self._steps = 0
        self._started = False
        self._path = folder / f"{model}.xml"
        fdm = self._fdm = load(folder, model)
        fdm.set_dt(self._dt)
        self._run = fdm.run
        self._read = tuple(node(fdm, name).get_double_value for name in _READ)
        self._wheels = tuple(node(fdm, name).get_double_value for name in _WHEELS)
        contacts = int(node(fdm, "gear/num-units").get_double_value())
        manager = fdm.get_property_manager()
        structure = (manager.get_node(f"contact/unit[{i}]/WOW", False) for i in range(contacts))
        self._structure = tuple(contact.get_double_value for contact in structure if contact is not None)
        self._feed = tuple(node(fdm, name).set_double_value for name in _FEED)
        self._command = tuple(node(fdm, name).set_double_value for name in _COMMAND)
        self._altitude = node(fdm, "position/geod-alt-ft").get_double_value
        self._set_terrain = node(fdm, "position/terrain-elevation-asl-ft").set_double_value
        self._loading, self._cg_forward = loading, loading.cg_forward
        self._set_gust = tuple(node(fdm, name).set_double_value for name in _GUST)
        self._turn = tuple(node(fdm, name).get_double_value for name in _TURN)
        if loading != NOMINAL and any(manager.get_node(f"{_BALLAST}[{i}]", False) is None for i in range(3)):
            raise PlantError(
                f"{self._path}: the model cannot be loaded with another mass or centre of gravity: it needs three"
                " <pointmass> of no weight, at the centre of gravity, ahead of it and behind it"
            )

    def _set(self, name: str, value: float) -> None:
        node(self._fdm, name).set_double_value(value)

    def _get(self, name: str) -> float:
        return float(node(self._fdm, name).get_double_value())

    def start(self, initial: InitialState) -> Truth:
        """Put the aircraft in the air, engine running, in trim.

        Returns
        -------
        Truth
            At t = 0.

        Raises
        ------
        TrimError
            When JSBSim finds no steady flight; the message names what does not balance.
        PlantError
            When the model reads a property that nothing provides.
        """
        if self._started:
            raise RuntimeError("a Plant flies once: make a new one")
        self._started = True
        latitude, longitude, height = self._runway.to_geodetic(initial.position)
        R_runway_from_ned = self._runway.R_runway_from_ned_at(latitude, longitude)
        calm = initial.wind == CALM
        ground, air = (_direction(initial),) * 2 if calm else velocities(initial)
        north, east, down = rotate_back(R_runway_from_ned, air)
        self._set("ic/lat-geod-deg", latitude / DEG)
        self._set("ic/long-gc-deg", longitude / DEG)
        self._set("ic/terrain-elevation-ft", (height + initial.position[2] / R_runway_from_ned[8]) / FT)
        self._set("ic/h-sl-ft", height / FT)
        self._set("ic/psi-true-deg", math.atan2(east, north) / DEG % 360.0)
        self._set("ic/vt-fps", initial.speed / FT)
        self._set("ic/gamma-deg", math.atan2(-down, math.hypot(north, east)) / DEG)
        if self._air != STANDARD_AIR:
            self._set("atmosphere/delta-T", self._air.temperature_offset_c * KELVIN_IN_RANKINE)
            self._set("atmosphere/P-sl-psf", self._air.pressure_hpa * HPA_IN_PSF)
        self._site[_WIND:] = initial.wind
        self._start_wind, self._R_runway_from_ned = initial.wind, R_runway_from_ned
        try:
            self._fdm.run_ic()
            if self._loading != NOMINAL:
                self._load_up()
            # over raised terrain JSBSim misses the height it is given by millimetres
            self._set("ic/h-sl-ft", 2.0 * height / FT - self._get("position/geod-alt-ft"))
            self._fdm.run_ic()
        except jsbsim.BaseError as error:
            raise PlantError(f"{self._path}: JSBSim cannot run it: {error}") from error
        self._run_up()
        listener = _listen()
        try:
            self._fdm.do_trim(int(jsbsim.TrimMode.FULL))
        except jsbsim.TrimFailureError as error:
            raise TrimError(self._trim_message(initial, listener.heard)) from error
        if not calm:
            self._drift(rotate_back(R_runway_from_ned, ground), rotate_back(R_runway_from_ned, initial.wind))
        if self._air != STANDARD_AIR:
            self.density_ratio = self._get("atmosphere/rho-slugs_ft3") * SLUG / FT**3 / standard_density(height)
        truth = self._last = self._truth()
        self.trim = TrimPoint(
            alpha=self._get("aero/alpha-rad"),
            elevator=truth.elevator,
            thrust=LBF * self._get("propulsion/engine/thrust-lbs"),
            pitch=self._get("attitude/theta-rad"),
            throttle=truth.throttle,
        )
        return truth

    def _drift(self, ground: Vec3, wind: Vec3) -> None:
        """Set the mass of air in which it is trimmed in motion, and the aircraft with it.

        Trimmed in the wind itself JSBSim finds no steady flight where the wind is as fast as the ground goes by.
        Controls, engine and actuators stay as they are.  The order counts: with the wind set first, or with an airspeed
        in place of the velocity, JSBSim makes another state of them.

        Parameters
        ----------
        ground, wind : Vec3
            Velocity over the ground and of the air, north, east and down, m/s.
        """
        for angle, of in (("phi", "phi"), ("theta", "theta"), ("psi", "psi-true")):
            self._set(f"ic/{of}-rad", self._get(f"attitude/{angle}-rad"))
        for axis, speed in zip("ned", ground, strict=True):
            self._set(f"ic/v{axis}-fps", speed / FT)
        self._set("ic/vw-mag-fps", math.hypot(wind[0], wind[1]) / FT)
        self._set("ic/vw-dir-deg", math.atan2(wind[1], wind[0]) / DEG % 360.0)  # whither it blows
        self._fdm.run_ic()

    def _load_up(self) -> None:
        """Give the point masses the weights that make mass and centre of gravity those of the loading.

        The two ahead and behind weigh w and -w: no mass, and to first order no moment of inertia.
        """
        before, at = self._get("inertia/weight-lbs"), self._get("inertia/cg-x-in")
        extra, wanted = self._loading.extra_mass / LB, at - self._loading.cg_forward / INCH
        if not before + extra > 0.0:
            raise TrimError(f"no mass is left: {before * LB:.1f} kg and {self._loading.extra_mass:.1f} kg")
        middle, ahead, behind = (self._get(f"inertia/pointmass-location-X-inches[{i}]") for i in range(3))
        moved = ((before + extra) * wanted - before * at - extra * middle) / (ahead - behind)
        for i, weight in enumerate((extra, moved, -moved)):
            self._set(f"{_BALLAST}[{i}]", weight)

    def _run_up(self) -> None:
        """Run the engine at flying speed with the airframe held where it is."""
        self._set("propulsion/set-running", -1.0)
        self._set("fcs/throttle-cmd-norm", RUN_UP_THROTTLE)
        held = [(name, self._get(name)) for name in _INTEGRATORS]
        for name, _ in held:
            self._set(name, 0.0)
        for _ in range(round(RUN_UP_S / self._dt)):
            self._run()
        for name, value in held:
            self._set(name, value)

    def _trim_message(self, initial: InitialState, heard: str) -> str:
        off = [what for _, name, tolerance, what in _BALANCES if not abs(self._get(name)) < tolerance]
        named = [what for axis, _, _, what in _BALANCES if axis in heard]
        return (
            f"no steady flight at {initial.speed:.1f} m/s on a flight path of {initial.flight_path / DEG:.1f} deg: "
            f"no balance of {', '.join(named or off)}"
        )

    def linearised(self) -> tuple[tuple[str, ...], Array]:
        """The states and the state matrix of JSBSim's own linearisation about where the aircraft is now.

        Returns
        -------
        (n,) tuple of str, (n, n) array
            Angles and rates in rad and rad/s, speed and height in ft/s and ft.
        """
        linear = jsbsim.FGLinearization(self._fdm)
        return tuple(linear.x_names), np.array(linear.system_matrix, dtype=float)

    def command(self, command: Command) -> None:
        """Hand guidance's command to the inner loops."""
        engaged, pitch, roll, airspeed, idle, ground, steering, brake, align, rudder = self._command
        engaged(command.engaged)
        pitch(command.pitch)
        roll(command.roll)
        airspeed(command.airspeed)
        idle(command.idle)
        ground(command.ground)
        steering(command.steering)
        brake(command.brake)
        align(command.align)
        rudder(command.rudder)

    def feed(self, rate: Vec3, side_force: float, roll: float, pitch: float, airspeed: float) -> None:
        """Hand the inner loops their measurements.

        Parameters
        ----------
        rate : Vec3
            Body rates, rad/s.
        side_force : float
            Specific force along body y, m/s².
        roll, pitch : float
            rad.
        airspeed : float
            m/s.
        """
        set_p, set_q, set_r, set_ay, set_roll, set_pitch, set_airspeed = self._feed
        set_p(rate[0])
        set_q(rate[1])
        set_r(rate[2])
        set_ay(side_force)
        set_roll(roll)
        set_pitch(pitch)
        set_airspeed(airspeed)

    def step(self) -> Truth:
        """One step of JSBSim.

        Returns
        -------
        Truth
            At its end.

        Raises
        ------
        StepError
            When JSBSim fails.
        """
        if self._atmosphere is not None:
            self._blow(self._atmosphere)
        try:
            self._run()
        except jsbsim.BaseError as error:
            raise StepError(f"JSBSim failed in flight: {error}") from error
        self._steps += 1
        truth = self._last = self._truth()
        return truth

    def _blow(self, atmosphere: Atmosphere) -> None:
        """Set the wind of the next step: JSBSim has that of the start, and is given the difference as a gust."""
        wind = atmosphere.at(self._last.motion, self._last.airspeed)
        self._site[_WIND:] = wind
        x, y, z = self._start_wind
        gust = rotate_back(self._R_runway_from_ned, (wind[0] - x, wind[1] - y, wind[2] - z))
        for set_one, speed in zip(self._set_gust, gust, strict=True):
            set_one(speed / FT)

    def _truth(self) -> Truth:
        (
            x, y, z, latitude, longitude, vx, vy, vz, phi, theta, psi, airspeed, elevator, aileron, rudder, throttle,
        ) = [read() for read in self._read]  # fmt: skip
        motion, time, airspeed = next(self._rows), self._steps * self._dt, FT * airspeed
        down, cosine = _motion(
            motion, self._site, x, y, z, vx, vy, vz, latitude, longitude, phi, theta, psi,
            time, airspeed, elevator, aileron, rudder, throttle,
        )  # fmt: skip
        nose = left = right = touching = False
        if down > -TERRAIN_HEIGHT:
            # here the ellipsoid's normal through the aircraft meets the runway's plane
            self._set_terrain(self._altitude() + down / (FT * cosine))
            if down > -CONTACT_HEIGHT:
                on_nose, on_left, on_right = self._wheels
                nose, left, right = on_nose() != 0.0, on_left() != 0.0, on_right() != 0.0
                if nose or left or right:
                    motion[_ON_GROUND : _ON_GROUND + 3] = nose, left, right
                for touches in self._structure:
                    if touches() != 0.0:
                        touching = True
        if self._cg_forward != 0.0:
            # from the centre of gravity, which JSBSim tells of, back to where it nominally is
            back, (yawing, pitching) = -self._cg_forward, [read() for read in self._turn]
            attitude = inertial(motion).attitude
            motion[:3] += rotate(attitude, (back, 0.0, 0.0))
            motion[3:6] += rotate(attitude, (0.0, back * yawing, -back * pitching))
        return tuple.__new__(  # what Truth(...) does, at half the price
            Truth,
            (time, motion, airspeed, nose, left, right, touching),
        )


_attitude = compiled(runway_attitude)


@compiled
def _motion(
    motion: Array,
    site: Array,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
    latitude: float,
    longitude: float,
    phi: float,
    theta: float,
    psi: float,
    time: float,
    airspeed: float,
    elevator: float,
    aileron: float,
    rudder: float,
    throttle: float,
) -> tuple[float, float]:
    """Write to `motion`, which is `Truth.motion`, from JSBSim's position and velocity (ECEF, ft) and angles (rad).

    The rest of its numbers stands there as it is given, with no wheel on the ground.

    `site` is R_runway_from_ecef times a foot, the origin in its axes (m), latitude, longitude, heading and the wind
    (runway frame, m/s).  Returned are the z of the position (m) and the cosine of the angle between the verticals.
    """
    cosine, attitude = _attitude(site[12], site[13], site[14], latitude, longitude, phi, theta, psi)
    for i in range(3):
        a, b, c = site[3 * i], site[3 * i + 1], site[3 * i + 2]
        motion[i] = a * x + b * y + c * z - site[9 + i]
        motion[3 + i] = a * vx + b * vy + c * vz
    for i in range(9):
        motion[6 + i] = attitude[i]
    motion[15], motion[16], motion[17], motion[18] = time, airspeed, elevator, aileron
    motion[19], motion[20] = rudder, throttle
    motion[21], motion[22], motion[23] = 0.0, 0.0, 0.0
    motion[24], motion[25], motion[26] = site[15], site[16], site[17]
    return motion[2], cosine
