"""The loop of one flight; beside its recorder the only place that holds both the truth and the navigation state.

One step of the plant: the sensors measure its state, navigation takes the measurements in, guidance makes a command
from the navigation state, and the plant's own inner loops fly it until the next step.
"""

import importlib.metadata
import math
import platform
import time
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from numpy.random import Generator, SeedSequence, default_rng

from estimator.alignment import Incidence
from estimator.so3 import Array
from landsim.config import AircraftConfig, Scenario
from landsim.guidance import INITIAL, guide, law_of
from landsim.metrics import flight_metrics
from landsim.navigation import Navigator, mount_of
from landsim.plant import Plant, StepError, TrimError
from landsim.recorder import Recorder
from landsim.runway import Runway
from landsim.sensors import Imu, LineCamera, Pitot, TiltMount, camera_of, imu_noise, site_of
from landsim.truth import InitialState, Truth
from landsim.units import DEG

STANDSTILL = 0.05
"""Ground speed below which the aircraft stands, m/s."""
STANDSTILL_TIME = 0.5
"""For how long before the flight is over, s."""
BELOW_GROUND = -5.0
"""Height of the centre of gravity at which the flight is over, m."""


@dataclass(frozen=True)
class Flight:
    """What came of a flight.

    Attributes
    ----------
    metrics : dict
        As in metrics.json.
    log : dict of str to (n,) array
        The columns of `landsim.log.COLUMNS`, a row a step.
    """

    metrics: dict[str, Any]
    log: dict[str, Array]


def runway_of(scenario: Scenario) -> Runway:
    """The runway of a scenario."""
    r = scenario.runway
    return Runway(
        length=r.length_m,
        width=r.width_m,
        heading=r.heading_deg * DEG,
        latitude=r.latitude_deg * DEG,
        longitude=r.longitude_deg * DEG,
        elevation=r.elevation_m,
    )


def incidence_of(aircraft: AircraftConfig) -> Incidence:
    """The angle of attack of an aircraft in steady flight."""
    gains = aircraft.guidance.approach
    return Incidence(gains.trim_alpha_deg * DEG, gains.trim_alpha_slope_deg_per_mps * DEG, aircraft.speeds.approach_mps)


def draw_start(scenario: Scenario, rng: Generator) -> InitialState:
    """The start of one flight: the scenario's, with what the seed adds to it."""
    s = scenario.start
    cross, height, heading, speed = rng.standard_normal(4).tolist()
    nominal = scenario.aircraft_config.speeds.approach_mps if s.speed_mps is None else s.speed_mps
    return InitialState(
        position=(s.along_m, s.cross_m + s.cross_sigma_m * cross, -(s.height_m + s.height_sigma_m * height)),
        speed=nominal + s.speed_sigma_mps * speed,
        heading=(s.heading_deg + s.heading_sigma_deg * heading) * DEG,
        flight_path=s.flight_path_deg * DEG,
    )


def fly(scenario: Scenario, seed: int = 0) -> Flight:
    """Fly a scenario once.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``flight``.
    seed : int
        Not negative.  Everything random in the flight comes from it.

    Returns
    -------
    Flight

    Raises
    ------
    ValueError
        If the scenario is not a flight, or the seed is negative.
    """
    if scenario.kind != "flight":
        raise ValueError(f"{scenario.name}: a scenario of the kind {scenario.kind!r} is not flown")
    began = time.perf_counter()
    aircraft = scenario.aircraft_config
    recorder = Recorder(
        camera_of(scenario.camera), scenario.runway.width_m, mount_of(aircraft.mount), aircraft.gear.main_wheels_body_m
    )
    try:
        end = _fly(scenario, seed, recorder)
    except (StepError, ArithmeticError, ValueError) as error:  # LinAlgError is a ValueError
        end = End("error", f"{type(error).__name__}: {error}")
    log = recorder.table()
    metrics = flight_metrics(
        log,
        scenario,
        aircraft,
        seed=seed,
        end=end.kind,
        detail=end.detail,
        wall_time_s=time.perf_counter() - began,
        versions=_versions(),
    )
    return Flight(metrics, log)


class End(NamedTuple):
    """Why a flight was over: one of `landsim.metrics.ENDS`, and what there is to say of it."""

    kind: str
    detail: str = ""


def _fly(scenario: Scenario, seed: int, recorder: Recorder) -> End:
    """The loop; says why it ended."""
    aircraft, settings = scenario.aircraft_config, scenario.simulation
    dt = 1.0 / settings.rate_hz
    imu_every = round(settings.rate_hz / scenario.imu.rate_hz)
    frame_every = round(settings.rate_hz / scenario.camera.rate_hz)
    imu_dt = imu_every * dt
    limit = math.ceil(settings.time_limit_s * settings.rate_hz) + 1

    start_rng, imu_rng, pitot_rng, mount_rng, camera_rng = (default_rng(s) for s in SeedSequence(seed).spawn(5))
    runway = runway_of(scenario)
    site = site_of(runway)
    plant = Plant(aircraft.folder, aircraft.model, runway, settings.rate_hz)
    try:
        truth = plant.start(draw_start(scenario, start_rng))
    except TrimError as error:
        return End("trim_failed", str(error))

    imu = Imu(scenario.imu, site, truth, imu_rng)
    pitot = Pitot(scenario.pitot, dt, truth, limit, pitot_rng)
    mount = TiltMount(aircraft.mount, dt, limit, mount_rng)
    camera = LineCamera(scenario.camera, aircraft.mount.position_body_m, runway, camera_rng)
    navigator = Navigator(
        camera.camera,
        scenario.camera.noise_px,
        runway.width,
        site,
        imu_noise(scenario.imu),
        imu_dt,
        mount_of(aircraft.mount),
        scenario.navigation,
        incidence_of(aircraft),
    )
    half_view = math.atan((camera.camera.height - 0.5 - camera.camera.cy) / camera.camera.fy)
    law = law_of(aircraft, scenario.approach, site.gravity, half_view, frame_every * dt)
    guidance = INITIAL
    command, _ = guide(law, navigator.state(0.0), guidance)
    plant.command(command)

    rate, side_force = _ZERO, 0.0
    standing = 0.0
    diverged: str | None = None
    for step in range(limit):
        airspeed = pitot.sample(truth)
        if step % imu_every == 0:
            navigator.take_airspeed(airspeed)
            if step > 0:
                sample = imu.sample(truth)
                navigator.propagate(sample)
                x, y, z = sample.angle
                rate, side_force = (x / imu_dt, y / imu_dt, z / imu_dt), sample.velocity[1] / imu_dt
        tilt_reading = mount.read()
        if step % frame_every == 0:
            view = camera.view(truth, mount.tilt, tilt_reading)
            result = navigator.observe(view.frame)
            recorder.frame(view, result, navigator.filter, imu)
            diverged = navigator.diverged
            command, guidance = guide(law, navigator.state(truth.time), guidance)
            plant.command(command)
        recorder.step(truth, navigator, command, guidance.phase, airspeed, mount.tilt, tilt_reading)
        if diverged is not None:
            return End("diverged", diverged)
        standing = standing + dt if stands(truth) else 0.0
        if standing > STANDSTILL_TIME:
            return End("stopped")
        mount.move(command.tilt)
        roll, pitch = navigator.roll_and_pitch()
        plant.feed(rate, side_force, roll, pitch, navigator.airspeed)
        truth = plant.step()
        if truth.structure_contact or not -truth.position[2] > BELOW_GROUND:  # the latter catches NaN
            return _crash(recorder, truth, navigator, command, guidance.phase, airspeed, mount.tilt, tilt_reading)
    return End("timeout")


_ZERO = (0.0, 0.0, 0.0)


def stands(truth: Truth) -> bool:
    """Whether the aircraft stands on its main wheels."""
    return truth.wow_left and truth.wow_right and math.hypot(truth.velocity[0], truth.velocity[1]) < STANDSTILL


def _crash(recorder: Recorder, truth: Truth, *known: Any) -> End:
    """Why the flight is over with this state, which no sensor has to see any more."""
    if not all(map(math.isfinite, (*truth.position, *truth.velocity, *truth.R_runway_from_body))):
        return End("error", "JSBSim's state is not finite")
    recorder.step(truth, *known)
    return End("structure_contact" if truth.structure_contact else "below_ground")


@cache
def _versions() -> dict[str, str]:
    names = ("landsim", "jsbsim", "numpy", "scipy", "filterpy")
    found = {"python": platform.python_version()}
    for name in names:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found
