"""The loop of one flight; beside its recorder the only place that holds both the truth and the navigation state.

One step of the plant: the sensors measure its state, navigation takes the measurements in, guidance makes a command
from the navigation state, and the plant's own inner loops fly it until the next step.
"""

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from numpy.random import Generator, SeedSequence, default_rng

from estimator.compiled import compiled, rotate
from estimator.so3 import Array, Vec3
from estimator.strapdown import unpacked
from landsim.alarms import AGAINST_LANDING
from landsim.camera_errors import line_camera
from landsim.config import Scenario
from landsim.dispersion import dispersed, draws_of_seed
from landsim.errors import InputError, traceback_of
from landsim.handover import handed_over
from landsim.metrics import flight_metrics
from landsim.navigation import mount_of
from landsim.omniscient import true_state
from landsim.onboard import on_board
from landsim.plant import Plant, StepError, TrimError
from landsim.plugins import ControllerSetup, EstimatorSetup, PlugInFault, controller_of, estimator_of, versions_of
from landsim.recorder import Recorder
from landsim.runway import Runway
from landsim.scene import atmosphere_of, believed_width, loading_of, runway_of, wind_of
from landsim.sensors import Imu, Pitot, TiltMount, View, camera_of, imu_noise, site_of
from landsim.state import NavState, Phase
from landsim.truth import InitialState, Truth
from landsim.units import DEG

STANDSTILL = 0.05
"""Ground speed below which the aircraft stands, m/s."""
STANDSTILL_TIME = 0.5
"""For how long before the flight is over, s."""
AFTERMATH = 3.0
"""For how long a flight goes on after what failed it, s."""
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


def draw_start(scenario: Scenario, rng: Generator) -> InitialState:
    """The start of one flight: the scenario's, with what the seed adds to it."""
    s = scenario.start
    cross, height, heading, speed = rng.standard_normal(4).tolist()
    nominal = scenario.aircraft_config.speeds.approach_mps if s.speed_mps is None else s.speed_mps
    up = s.height_m + s.height_sigma_m * height
    return InitialState(
        position=(s.along_m, s.cross_m + s.cross_sigma_m * cross, -up),
        speed=nominal + s.speed_sigma_mps * speed,
        heading=(s.heading_deg + s.heading_sigma_deg * heading) * DEG,
        flight_path=s.flight_path_deg * DEG,
        wind=wind_of(scenario, up),
    )


def fly(scenario: Scenario, seed: int = 0, draws: Mapping[str, float] | None = None) -> Flight:
    """Fly a scenario once.

    Parameters
    ----------
    scenario : Scenario
        Of the kind ``flight``.
    seed : int
        Not negative.  Everything random in the flight comes from it.
    draws : mapping, optional
        The values of the dispersed keys, as `landsim.dispersion.Design.draws` gives them; without them, those that the
        seed gives by plain random sampling.

    Returns
    -------
    Flight

    Raises
    ------
    InputError
        If the aircraft's model does not load, the scenario does not allow a drawn value, or a plug-in is not installed
        or does not import.
    ValueError
        If the scenario is not a flight, or the seed is not a whole number of zero or more.
    """
    must_fly(scenario, seed)
    began = time.perf_counter()
    draws = draws_of_seed(scenario, seed) if draws is None else draws
    scenario = dispersed(scenario, draws)
    aircraft = scenario.aircraft_config
    recorder = Recorder(
        camera_of(scenario.camera),
        believed_width(scenario),
        mount_of(aircraft.mount),
        aircraft.gear.main_wheels_body_m,
        scenario.camera.pan_error_deg * DEG,
        scenario.camera.roll_error_deg * DEG,
    )
    seeds = SeedSequence(seed).spawn(8)
    start = draw_start(scenario, default_rng(seeds[0]))
    traceback = None
    try:
        end = _fly(scenario, start, seeds[1:], *on_board(scenario, seed), recorder)
    except InputError:
        raise
    except PlugInFault as fault:
        end = End("error", str(fault))
        traceback = None if fault.__cause__ is None else traceback_of(fault.__cause__)
    except (StepError, ArithmeticError, ValueError) as error:  # LinAlgError is a ValueError
        end = End("error", f"{type(error).__name__}: {error}")
        traceback = traceback_of(error)
    log = recorder.table()
    metrics = flight_metrics(
        log,
        scenario,
        aircraft,
        seed=seed,
        end=end.kind,
        detail=end.detail,
        start={
            "along_m": start.position[0],
            "cross_m": start.position[1],
            "height_m": -start.position[2],
            "heading_deg": start.heading / DEG,
            "speed_mps": start.speed,
        },
        wall_time_s=time.perf_counter() - began,
        versions=versions_of(scenario),
    )
    metrics["traceback"] = traceback
    metrics["draws"] = dict(draws)
    return Flight(metrics, log)


def must_fly(scenario: Scenario, seed: int) -> None:
    """Raise ValueError if the scenario is not a flight, or the seed is not a whole number of zero or more."""
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ValueError(f"seed must be a whole number that is not negative, not {seed!r}")
    if scenario.kind != "flight":
        raise ValueError(f"{scenario.name}: a scenario of the kind {scenario.kind!r} is not flown")


class End(NamedTuple):
    """Why a flight was over: one of `landsim.metrics.ENDS`, and what there is to say of it."""

    kind: str
    detail: str = ""


def _fly(
    scenario: Scenario,
    start: InitialState,
    seeds: Sequence[SeedSequence],
    estimator: EstimatorSetup,
    controller: ControllerSetup,
    recorder: Recorder,
) -> End:
    """The loop; says why it ended."""
    aircraft, settings = scenario.aircraft_config, scenario.simulation
    dt = 1.0 / settings.rate_hz
    imu_every = round(settings.rate_hz / scenario.imu.rate_hz)
    frame_every = round(settings.rate_hz / scenario.camera.rate_hz)
    imu_dt = imu_every * dt
    limit = math.ceil(settings.time_limit_s * settings.rate_hz) + 1

    imu_rng, pitot_rng, mount_rng, camera_rng = (default_rng(seed) for seed in seeds[:4])
    runway = runway_of(scenario)
    site = site_of(runway)
    atmosphere = atmosphere_of(scenario, default_rng(seeds[4]))
    loading = loading_of(scenario)
    plant = Plant(aircraft.folder, aircraft.model, runway, settings.rate_hz, loading, atmosphere, scenario.air)
    wheels = aircraft.gear.main_wheels_body_m
    height = -start.position[2]
    if height < wheels[2]:
        return End("trim_failed", f"it starts under the ground, {height:.2f} m up with wheels {wheels[2]:.2f} m lower")
    try:
        truth = plant.start(start)
    except TrimError as error:
        return End("trim_failed", str(error))

    imu = Imu(scenario.imu, site, truth, imu_rng)
    pitot = Pitot(scenario.pitot, dt, truth, pitot_rng, plant.density_ratio)
    mount = TiltMount(aircraft.mount, dt, mount_rng, scenario.camera.tilt_error_deg * DEG)
    lever, chance = aircraft.mount.position_body_m, default_rng(seeds[5])
    believed_px = max(scenario.camera.noise_px, scenario.navigation.min_noise_px)
    camera = line_camera(scenario.camera, scenario.fault, lever, runway, camera_rng, chance, believed_px)
    lag = imu_every * round(scenario.camera.latency_s * scenario.imu.rate_hz)
    on_the_way: deque[tuple[int, View, int]] = deque()
    if scenario.navigation.start == "handover":
        handover = handed_over(truth, scenario.navigation, imu_noise(scenario.imu), default_rng(seeds[6]))
        estimator = replace(estimator, handover=handover)
    navigator = estimator_of(scenario.plug_ins.estimator, estimator)
    guidance = controller_of(scenario.plug_ins.controller, controller)
    omniscient, before = settings.guidance_state == "truth", truth.motion

    rate, side_force = _ZERO, 0.0
    standing = 0.0
    diverged: str | None = None
    faulty, mains_down = math.inf, False
    phase, climbed = Phase.ACQUIRE, scenario.go_around.end_height_m
    may_give_up = scenario.go_around.enabled
    for step in range(limit):
        airspeed = pitot.sample(truth)
        if step % imu_every == 0:
            navigator.take_airspeed(airspeed)
            if step > 0:
                sample = imu.sample(truth)
                navigator.propagate(sample)
                x, y, z, _, side, _ = sample.tolist()
                rate, side_force = (x / imu_dt, y / imu_dt, z / imu_dt), side / imu_dt
        tilt_reading = mount.read()
        frame_due = step % frame_every == 0
        if frame_due:
            view = camera.view(truth, mount.tilt, tilt_reading, rate)
            if lag == 0:
                result = navigator.observe(view.frame)
                recorder.frame(view, result, navigator.known, imu)
                diverged = navigator.diverged
            else:
                on_the_way.append((step + lag, view, recorder.row))
        if on_the_way and on_the_way[0][0] == step:
            _, view, row = on_the_way.popleft()
            result = navigator.observe(view.frame)
            recorder.frame(view, result, navigator.known, imu, row)
            diverged = navigator.diverged
        if frame_due:
            if omniscient:
                nav = true_state(truth, before, dt, navigator.airspeed, side_force)
            else:
                nav = navigator.state(truth.time)
            command, phase = guidance.guide(nav)
            recorder.command(command, phase, navigator.stage, nav)
            plant.command(command)
        recorder.step(truth, navigator, airspeed, mount.tilt, tilt_reading)
        if phase is _GO_AROUND:
            if -truth.motion.item(2) >= climbed and truth.motion.item(5) < 0.0:
                return End("go_around", guidance.reason)
        elif diverged is not None and not (omniscient or (may_give_up and warns(nav))):
            return End("diverged", diverged)
        if truth.wow_nose or truth.wow_left or truth.wow_right:
            if faulty == math.inf:
                faulty = _fault_time(truth, runway, wheels, mains_down)
            mains_down = mains_down or truth.wow_left or truth.wow_right
            if truth.time > faulty + AFTERMATH:
                return End("fault")
            if mains_down and settings.end == "touchdown" and faulty == math.inf and phase is not _GO_AROUND:
                return End("touchdown")
        standing = standing + dt if truth.wow_left and stands(truth) else 0.0
        if standing > STANDSTILL_TIME:
            return End("stopped")
        mount.move(command.tilt)
        roll, pitch = truth.roll_and_pitch if omniscient else navigator.roll_and_pitch()
        plant.feed(rate, side_force, roll, pitch, navigator.airspeed)
        before = truth.motion
        truth = plant.step()
        if truth.structure_contact or not -truth.motion.item(2) > BELOW_GROUND:  # the latter catches NaN
            return _crash(recorder, truth, navigator, airspeed, mount.tilt, tilt_reading)
    return End("timeout")


_ZERO = (0.0, 0.0, 0.0)
_GO_AROUND = Phase.GO_AROUND  # a member looked up in its class costs as much as a call


def warns(nav: NavState) -> bool:
    """Whether navigation that has diverged says so to guidance, which then has a reason to climb out by a state."""
    return bool(nav.alarm & AGAINST_LANDING) and all(map(math.isfinite, (*nav.position, *nav.velocity)))


def _fault_time(truth: Truth, runway: Runway, wheels: Vec3, mains_down: bool) -> float:
    """The time, if a state on the wheels fails the landing: nose wheel first, or main wheels off the runway."""
    if truth.wow_nose and not mains_down:
        return truth.time
    if not (truth.wow_left or truth.wow_right):
        return math.inf
    on_it = _on_runway(truth.motion, *wheels, runway.length, runway.width)
    return math.inf if on_it else truth.time


@compiled
def _on_runway(motion: Array, ahead: float, right: float, down: float, length: float, width: float) -> bool:
    """Whether a point of the body is over the runway."""
    position, _, attitude = unpacked(motion)
    x, y, _ = rotate(attitude, (ahead, right, down))
    x, y = x + position[0], y + position[1]
    return 0.0 <= x <= length and abs(y) <= 0.5 * width


def stands(truth: Truth) -> bool:
    """Whether the aircraft stands on its main wheels."""
    if not (truth.wow_left and truth.wow_right):
        return False
    return math.hypot(truth.motion.item(3), truth.motion.item(4)) < STANDSTILL


def _crash(recorder: Recorder, truth: Truth, *known: Any) -> End:
    """Why the flight is over with this state, which no sensor has to see any more."""
    if not math.isfinite(truth.motion.sum()):
        return End("error", "JSBSim's state is not finite")
    recorder.step(truth, *known)
    return End("structure_contact" if truth.structure_contact else "below_ground")
