"""landsim/plant.py: frames, truth, the ground, errors."""

import math
import re
import shutil
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng

from estimator.so3 import Vec3, from_euler, matmul, rotate, rotate_back, to_euler
from landsim import earth
from landsim.config import ImuConfig
from landsim.errors import InputError
from landsim.plant import Plant, PlantError, TrimError, TrimPoint, load, node
from landsim.resources import find_aircraft
from landsim.runway import Runway
from landsim.sensors import Imu, site_of
from landsim.state import Command
from landsim.truth import AFTER_MOTION, MOTION, NOMINAL, InitialState, Loading, Truth
from landsim.units import DEG, FT, STANDARD_GRAVITY

FOLDER = find_aircraft("pioneer")[1]
RATE = 120.0
PLAIN = Runway(2000.0, 30.0)
FAR = Runway(2000.0, 30.0, heading=4.4, latitude=0.83, longitude=-2.03, elevation=312.0)
SOUTH = Runway(2000.0, 30.0, heading=6.2, latitude=-0.4, longitude=3.1, elevation=35.0)
RUNWAYS = [PLAIN, FAR, SOUTH]
START = InitialState((-1000.0, 5.0, -60.0), 40.0, 0.03, -3.0 * DEG)


def started(runway: Runway = PLAIN, initial: InitialState = START) -> tuple[Plant, Truth]:
    plant = Plant(FOLDER, "pioneer", runway, RATE)
    return plant, plant.start(initial)


def read(plant: Plant, name: str) -> float:
    return float(node(plant._fdm, name).get_double_value())


def fly(plant: Plant, truth: Truth, seconds: float, pilot: Callable[[Truth, Command], Command]) -> list[Truth]:
    hold = Command(True, plant.trim.pitch, 0.0, truth.airspeed, False, False, 0.0, 0.0, 0.0)
    flown = [truth]
    for _ in range(round(seconds * RATE)):
        roll, pitch, _ = to_euler(truth.R_runway_from_body)
        rate = (
            read(plant, "velocities/p-rad_sec"),
            read(plant, "velocities/q-rad_sec"),
            read(plant, "velocities/r-rad_sec"),
        )
        plant.feed(rate, 0.0, roll, pitch, truth.airspeed)
        plant.command(pilot(truth, hold))
        truth = plant.step()
        flown.append(truth)
    return flown


def weave(truth: Truth, hold: Command) -> Command:
    return hold._replace(roll=0.2 * math.sin(truth.time), pitch=hold.pitch + 0.03 * math.sin(0.7 * truth.time))


# --- the start --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("runway", RUNWAYS)
@pytest.mark.parametrize(
    "initial",
    [
        START,
        InitialState((-1500.0, -300.0, -120.0), 38.0, -0.4, 0.0),
        InitialState((300.0, 2.0, -30.0), 42.0, 0.0, 0.02),
    ],
)
def test_it_starts_where_it_is_told(runway: Runway, initial: InitialState) -> None:
    plant, truth = started(runway, initial)
    assert truth.time == 0.0
    assert truth.position == pytest.approx(initial.position, abs=2e-4)
    speed, climb, track = initial.speed, initial.flight_path, initial.heading
    assert truth.airspeed == pytest.approx(speed, abs=1e-6)
    assert truth.velocity == pytest.approx(
        (
            speed * math.cos(climb) * math.cos(track),
            speed * math.cos(climb) * math.sin(track),
            -speed * math.sin(climb),
        ),
        abs=2e-3,  # trim holds the propeller's torque with a trace of bank and sideslip
    )
    roll, pitch, yaw = to_euler(truth.R_runway_from_body)
    assert roll == pytest.approx(0.0, abs=0.05 * DEG)
    assert yaw == pytest.approx(track, abs=0.01 * DEG)
    assert pitch == pytest.approx(climb + plant.trim.alpha, abs=0.02 * DEG)
    assert plant.trim.elevator == truth.elevator
    assert plant.trim.throttle == truth.throttle


def test_left_alone_it_stays_in_trim() -> None:
    plant, truth = started(PLAIN, InitialState((-1000.0, 0.0, -300.0), 40.0, 0.0, 0.0))
    for _ in range(240):
        truth = plant.step()
    assert truth.airspeed == pytest.approx(40.0, abs=0.02)
    assert truth.velocity[2] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("speed", "flight_path_deg", "cause"), [(15.0, 0.0, "lift"), (60.0, 3.0, "speed"), (40.0, -12.0, "speed")]
)
def test_a_trim_that_fails_is_named(speed: float, flight_path_deg: float, cause: str) -> None:
    with pytest.raises(TrimError, match=rf"{speed:.1f} m/s on a flight path of {flight_path_deg:.1f} deg.*{cause}"):
        started(PLAIN, InitialState((-1000.0, 0.0, -60.0), speed, 0.0, flight_path_deg * DEG))


def test_it_flies_once() -> None:
    plant, _ = started()
    with pytest.raises(RuntimeError, match="once"):
        plant.start(START)


# --- truth ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("runway", RUNWAYS)
def test_truth_agrees_with_jsbsim_s_geodetic_state(runway: Runway) -> None:
    plant, truth = started(runway)
    truth = fly(plant, truth, 3.0, weave)[-1]
    latitude, longitude = read(plant, "position/lat-geod-rad"), read(plant, "position/long-gc-rad")
    place = earth.ecef_from_geodetic(latitude, longitude, read(plant, "position/geod-alt-ft") * FT)
    R_runway_from_ned = runway.R_runway_from_ned_at(latitude, longitude)
    ned = [FT * read(plant, f"velocities/v-{axis}-fps") for axis in ("north", "east", "down")]
    phi, theta, psi = (read(plant, f"attitude/{angle}-rad") for angle in ("phi", "theta", "psi"))
    assert truth.position == pytest.approx(runway.from_ecef(place), abs=2e-4)
    assert truth.velocity == pytest.approx(rotate(R_runway_from_ned, (ned[0], ned[1], ned[2])), abs=1e-6)
    assert truth.R_runway_from_body == pytest.approx(matmul(R_runway_from_ned, from_euler(phi, theta, psi)), abs=1e-12)
    assert truth.airspeed == pytest.approx(math.hypot(*ned), abs=1e-6)


@pytest.mark.parametrize("runway", RUNWAYS)
def test_velocity_is_the_rate_of_position(runway: Runway) -> None:
    plant, truth = started(runway, START._replace(position=(-1000.0, 5.0, -300.0)))
    flown = fly(plant, truth, 4.0, weave)[120:]  # past the moment of engaging
    for before, now, after in zip(flown, flown[1:], flown[2:], strict=False):
        moved = [0.5 * RATE * (b - a) for a, b in zip(before.position, after.position, strict=True)]
        assert moved == pytest.approx(now.velocity, abs=1e-4)


@pytest.mark.parametrize("runway", RUNWAYS)
def test_ideal_imu_reports_what_jsbsim_feels(runway: Runway) -> None:
    """Without errors the unit's increments are JSBSim's own accelerometers and inertial rates, in the middle of a
    step."""
    plant, truth = started(runway, START._replace(position=(-1000.0, 5.0, -300.0)))
    truth = fly(plant, truth, 1.0, weave)[-1]
    nothing = dict.fromkeys((key for key in ImuConfig.model_fields if key not in ("rate_hz", "grade")), 0.0)
    imu = Imu(ImuConfig.model_validate(nothing), site_of(runway), truth, default_rng(0))

    def felt() -> list[float]:
        forces = [
            STANDARD_GRAVITY * sign * read(plant, f"accelerations/N{axis}")
            for axis, sign in zip("xyz", (1, 1, -1), strict=True)
        ]
        return forces + [read(plant, f"velocities/{axis}i-rad_sec") for axis in "pqr"]

    before = felt()
    for _ in range(40):
        sample = imu.sample(plant.step())
        after = felt()
        middle = [0.5 * (a + b) for a, b in zip(before, after, strict=True)]
        assert [v * RATE for v in sample[3:]] == pytest.approx(middle[:3], abs=0.05)
        assert [a * RATE for a in sample[:3]] == pytest.approx(middle[3:], abs=2e-3)
        before = after


@pytest.mark.parametrize("runway", RUNWAYS)
def test_specific_force_by_velocity_is_jsbsim_s_accelerometer(runway: Runway) -> None:
    # f = dv/dt + 2 Ω x v - g, in the body frame; g along the ellipsoid's normal where the aircraft is
    plant, truth = started(runway, START._replace(position=(-1000.0, 5.0, -300.0)))
    fly(plant, truth, 1.0, weave)
    for _ in range(20):
        before, now = plant.step(), plant.step()
        measured = [STANDARD_GRAVITY * read(plant, f"accelerations/N{axis}") for axis in "xyz"]
        latitude, longitude = read(plant, "position/lat-geod-rad"), read(plant, "position/long-gc-rad")
        height = read(plant, "position/geod-alt-ft") * FT
        after = plant.step()
        down = rotate(runway.R_runway_from_ned_at(latitude, longitude), (0.0, 0.0, 1.0))
        gravity = earth.gravity(latitude, height)
        turn = np.cross(runway.earth_rate, now.velocity)
        gain = [0.5 * RATE * (b - a) for a, b in zip(before.velocity, after.velocity, strict=True)]
        x, y, z = (g + 2.0 * t - gravity * d for g, t, d in zip(gain, turn, down, strict=True))
        force = rotate_back(now.R_runway_from_body, (x, y, z))
        assert force == pytest.approx((measured[0], measured[1], -measured[2]), abs=0.01)


def test_yaw_does_not_jump_at_north() -> None:
    # psi leaves JSBSim in [0, 2π): a runway to the north, and headings on either side of it
    plant, truth = started(PLAIN, START._replace(heading=0.0))
    yaws = [to_euler(t.R_runway_from_body)[2] for t in fly(plant, truth, 6.0, weave)]
    assert min(yaws) < 0.0 < max(yaws)
    assert max(abs(b - a) for a, b in pairwise(yaws)) < 0.01


def test_command_and_feed_reach_their_properties() -> None:
    plant, _ = started()
    plant.command(Command(True, 0.1, 0.2, 41.0, True, True, -0.3, 0.4, 0.9, 0.5, 0.07))
    plant.feed((0.01, 0.02, 0.03), 0.04, 0.05, 0.06, 39.0)
    wanted = {
        "ap/engaged": 1.0, "ap/pitch-cmd-rad": 0.1, "ap/roll-cmd-rad": 0.2, "ap/airspeed-cmd-mps": 41.0, "ap/idle": 1.0,
        "ap/ground": 1.0, "ap/steering-cmd-norm": -0.3, "ap/brake-cmd-norm": 0.4, "ap/align": 0.5,
        "ap/rudder-align-rad": 0.07, "imu/p-rad_sec": 0.01,
        "imu/q-rad_sec": 0.02, "imu/r-rad_sec": 0.03, "imu/ay-mps2": 0.04, "nav/roll-rad": 0.05, "nav/pitch-rad": 0.06,
        "nav/airspeed-mps": 39.0,
    }  # fmt: skip
    assert {name: read(plant, name) for name in wanted} == wanted


def test_controls_and_wheels_of_the_truth_are_jsbsim_s() -> None:
    """With all surfaces off their trim, each by the name under which the log takes it down."""
    plant, truth = started()
    truth = fly(plant, truth, 1.5, weave)[-1]
    names = {
        "elevator": "fcs/elevator-pos-rad", "aileron": "fcs/left-aileron-pos-rad", "rudder": "fcs/rudder-pos-rad",
        "throttle": "fcs/throttle-pos-norm",
    }  # fmt: skip
    taken = {name: float(truth.motion[MOTION + AFTER_MOTION.index(name)]) for name in AFTER_MOTION}
    expected = {name: read(plant, of) for name, of in names.items()}
    assert len(set(expected.values())) == len(expected)
    assert {name: taken[name] for name in names} == expected
    assert {name: getattr(truth, name) for name in names} == expected
    assert (taken["time"], taken["airspeed"]) == (truth.time, truth.airspeed)
    assert [taken[f"wow_{wheel}"] for wheel in ("nose", "left", "right")] == [0.0, 0.0, 0.0]


def test_same_inputs_same_bits() -> None:
    flights = [fly(*started(FAR, START._replace(position=(-60.0, 0.0, -4.0))), 8.0, weave) for _ in range(2)]
    assert any(truth.wow_left for truth in flights[0])
    one, other = ([np.array((*t[:1], *t.motion, *t[2:])) for t in flown] for flown in flights)
    assert np.array_equal(one, other)


# --- wind and loading -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("runway", RUNWAYS)
@pytest.mark.parametrize("wind", [(-5.0, 3.0, 0.0), (4.0, -6.0, 0.0), (0.0, 8.0, 0.0), (-12.0, 0.0, 0.0)])
def test_it_starts_in_the_wind_at_its_airspeed_along_its_track(runway: Runway, wind: Vec3) -> None:
    """The ground's velocity less the wind's is the air's: as long as the airspeed, and where the nose points."""
    plant, truth = started(runway, START._replace(wind=wind, position=(-1000.0, 5.0, -300.0)))
    assert truth.position == pytest.approx((-1000.0, 5.0, -300.0), abs=2e-4)
    assert truth.airspeed == pytest.approx(START.speed, abs=1e-3)
    vx, vy, vz = truth.velocity
    assert math.atan2(vy, vx) == pytest.approx(START.heading, abs=2e-5)
    assert math.atan2(-vz, math.hypot(vx, vy)) == pytest.approx(START.flight_path, abs=1e-4)
    through_air = (vx - wind[0], vy - wind[1], vz - wind[2])
    assert math.hypot(*through_air) == pytest.approx(START.speed, abs=2e-3)
    roll, _, yaw = to_euler(truth.R_runway_from_body)
    assert yaw == pytest.approx(math.atan2(through_air[1], through_air[0]), abs=0.01 * DEG)
    assert roll == pytest.approx(0.0, abs=0.05 * DEG)
    blows = rotate(runway.R_runway_from_ned_at(runway.latitude, runway.longitude), ned(plant, "atmosphere/wind-{}-fps"))
    assert blows == pytest.approx(wind, abs=2e-3)  # north turns by 1e-4 rad over the kilometre
    for _ in range(240):
        truth = plant.step()
    assert truth.velocity == pytest.approx((vx, vy, vz), abs=0.05)
    assert truth.airspeed == pytest.approx(START.speed, abs=0.03)


def ned(plant: Plant, name: str) -> Vec3:
    north, east, down = (FT * read(plant, name.format(axis)) for axis in ("north", "east", "down"))
    return north, east, down


def test_a_head_wind_slows_it_over_the_ground_and_a_cross_wind_turns_its_nose() -> None:
    level = InitialState((-1000.0, 0.0, -60.0), 40.0, 0.0, 0.0)
    assert started(PLAIN, level._replace(wind=(-5.0, 0.0, 0.0)))[1].velocity[0] == pytest.approx(35.0, abs=1e-4)
    _, truth = started(PLAIN, level._replace(wind=(0.0, 8.0, 0.0)))  # from the left: the nose goes left
    assert truth.velocity[0] == pytest.approx(math.sqrt(40.0**2 - 8.0**2), abs=1e-3)
    assert to_euler(truth.R_runway_from_body)[2] == pytest.approx(-math.asin(0.2), abs=0.01 * DEG)


@pytest.mark.parametrize("wind", [(-41.0, 0.0, 0.0), (0.0, 40.5, 0.0)])
def test_a_wind_that_is_faster_than_the_aircraft_is_no_start(wind: Vec3) -> None:
    with pytest.raises(TrimError, match=r"at 40\.0 m/s through the air it makes no way against a wind of 4\d\.\d m/s"):
        started(PLAIN, START._replace(heading=0.0, flight_path=0.0, wind=wind))


@pytest.mark.parametrize(("extra", "forward"), [(20.0, 0.0), (-25.0, 0.0), (0.0, 0.05), (15.0, -0.04)])
def test_mass_and_centre_of_gravity_are_what_was_asked_for(extra: float, forward: float) -> None:
    """Of JSBSim's own mass balance; the aircraft weighs 420 lb, and its centre of gravity lies at 60 in."""
    plant = Plant(FOLDER, "pioneer", PLAIN, RATE, Loading(extra, forward))
    plant.start(START)
    assert read(plant, "inertia/mass-slugs") * 14.593903 == pytest.approx(420.0 * 0.45359237 + extra, abs=1e-4)
    assert read(plant, "inertia/cg-x-in") == pytest.approx(60.0 - forward / 0.0254, abs=1e-9)
    assert [read(plant, f"inertia/cg-{axis}-in") for axis in "yz"] == [0.0, 0.0]
    # to first order the moments of inertia stay
    for axis, nominal in (("xx", 34.832), ("yy", 67.08), ("zz", 82.22)):
        assert read(plant, f"inertia/i{axis}-slugs_ft2") == pytest.approx(nominal, rel=0.01)


def trimmed(loading: Loading) -> TrimPoint:
    plant = Plant(FOLDER, "pioneer", PLAIN, RATE, loading)
    plant.start(InitialState((-1000.0, 0.0, -60.0), 40.0, 0.0, 0.0))
    return plant.trim


def test_trim_knows_the_loading() -> None:
    """Weight is carried by lift, and a centre of gravity further ahead by the tail.

    A tenth more weight asks for so much more lift coefficient, W / (q S).  By Bray's table 4.7 a degree of incidence
    gives 0.094 between 2° and 3°, and by table 4.4 a degree of elevator 0.0062, which goes up a degree with each degree
    of incidence (the trim table in the aircraft's README).
    """
    nominal = trimmed(NOMINAL)
    pressure = 0.5 * 1.2181 * 40.0**2 * 30.42 * 0.3048**2  # q S, at 60 m in the standard atmosphere
    weight = 420.0 * 4.4482216
    heavier = trimmed(Loading(extra_mass=0.1 * weight / 9.80665))
    assert (heavier.alpha - nominal.alpha) / DEG == pytest.approx(0.1 * weight / pressure / (0.094 - 0.0062), rel=0.05)
    ahead, behind = trimmed(Loading(cg_forward=0.03)), trimmed(Loading(cg_forward=-0.03))
    assert ahead.elevator < nominal.elevator - 0.5 * DEG
    assert behind.elevator > nominal.elevator + 0.5 * DEG


@pytest.mark.parametrize("forward", [0.0, 0.05, -0.08])
def test_truth_stays_with_the_airframe_when_the_centre_of_gravity_does_not(forward: float) -> None:
    """The wheels of aircraft.toml are as high as JSBSim says, and what moves there moves as the position does."""
    plant = Plant(FOLDER, "pioneer", FAR, RATE, Loading(0.0, forward))
    truth = plant.start(START._replace(position=(-30.0, 0.0, -12.0)))
    flown = fly(plant, truth, 2.0, weave)
    for number, wheel in {0: (1.2192, 0.0, 0.8382), 1: (-0.2794, -0.762, 0.8382)}.items():
        height = -(flown[-1].position[2] + rotate(flown[-1].R_runway_from_body, wheel)[2])
        assert read(plant, f"gear/unit[{number}]/AGL-ft") * FT == pytest.approx(height, abs=2e-3)
    for before, now, after in zip(flown[120:], flown[121:], flown[122:], strict=False):
        moved = [0.5 * RATE * (b - a) for a, b in zip(before.position, after.position, strict=True)]
        assert moved == pytest.approx(now.velocity, abs=1e-4)


def test_more_than_all_of_its_mass_cannot_be_taken_away() -> None:
    with pytest.raises(TrimError, match=r"no mass is left: 190\.5 kg and -200\.0 kg"):
        Plant(FOLDER, "pioneer", PLAIN, RATE, Loading(extra_mass=-200.0)).start(START)


def test_a_model_without_point_masses_flies_at_its_nominal_mass_alone(tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(FOLDER, folder)
    text = (folder / "pioneer.xml").read_text(encoding="utf-8")
    bare = re.sub(r"<pointmass.*?</pointmass>", "", text, flags=re.DOTALL)
    assert bare != text
    (folder / "pioneer.xml").write_text(bare, encoding="utf-8")
    with pytest.raises(
        PlantError, match=r"pioneer\.xml: the model cannot be loaded with another mass .* three <pointmass>"
    ):
        Plant(folder, "pioneer", PLAIN, RATE, Loading(cg_forward=0.01))
    one = Plant(folder, "pioneer", PLAIN, RATE)
    other, truth = started()
    assert np.array_equal(one.start(START).motion, truth.motion)
    assert one.trim == other.trim


# --- the ground -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("runway", RUNWAYS)
@pytest.mark.parametrize("along", [0.0, 1500.0])
def test_the_ground_is_the_runway_s_plane(runway: Runway, along: float) -> None:
    # the main wheels of aircraft.toml; the plane lies 18 cm above the ellipsoid's curve 1500 m on
    wheels = {1: (-0.2794, -0.762, 0.8382), 2: (-0.2794, 0.762, 0.8382)}
    plant, truth = started(runway, START._replace(position=(along - 20.0, 0.0, -5.0)))
    truth = fly(plant, truth, 0.5, lambda _, hold: hold)[-1]
    for number, wheel in wheels.items():
        height = -(truth.position[2] + rotate(truth.R_runway_from_body, wheel)[2])
        assert read(plant, f"gear/unit[{number}]/AGL-ft") * FT == pytest.approx(height, abs=2e-3)


@pytest.mark.parametrize(("bank", "first"), [(-8.0, "left"), (8.0, "right")])
def test_the_low_wing_s_wheel_touches_first(bank: float, first: str) -> None:
    plant, truth = started(PLAIN, START._replace(position=(-50.0, 0.0, -6.0)))
    flown = fly(plant, truth, 6.0, lambda _, hold: hold._replace(roll=bank * DEG))
    touch = next(t for t in flown if t.wow_left or t.wow_right)
    assert (touch.wow_left, touch.wow_right) == (first == "left", first == "right")
    assert not any(t.wow_left or t.wow_right or t.structure_contact for t in flown if t.position[2] < -3.0)


def test_a_dive_into_the_ground_is_a_structure_contact() -> None:
    plant, truth = started(PLAIN, START._replace(position=(-50.0, 0.0, -15.0)))
    flown = fly(plant, truth, 3.0, lambda _, hold: hold._replace(pitch=-0.5))
    assert any(t.structure_contact for t in flown)
    assert not flown[0].structure_contact


# --- errors and silence -----------------------------------------------------------------------------------------------


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    plant, truth = started(PLAIN, START._replace(position=(-50.0, 0.0, -6.0)))
    fly(plant, truth, 6.0, lambda _, hold: hold)
    with pytest.raises(TrimError):
        started(PLAIN, START._replace(speed=15.0))
    assert capfd.readouterr() == ("", "")


def test_a_wrong_path_is_said(tmp_path: Path) -> None:
    with pytest.raises(PlantError, match=r"pioneer\.xml: no such aircraft model"):
        load(tmp_path, "pioneer")
    with pytest.raises(InputError, match=r"piper\.xml: no such"):
        Plant(FOLDER, "piper", PLAIN, RATE)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("pioneer.xml", "</aerodynamics>", "", "XML parse error"),
        ("pioneer.xml", '<engine file="pioneer_engine">', '<engine file="nowhere">', "nowhere"),
        ("Systems/inner_loops.xml", "imu/q-rad_sec", "imu/qq-rad_sec", "no property 'imu/q-rad_sec'"),
        ("Systems/inner_loops.xml", "ap/engaged lt 0.5", "ap/engaged lt", "inner_loops.xml line"),
    ],
)
def test_a_faulty_model_is_an_error(tmp_path: Path, file: str, old: str, new: str, message: str) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(FOLDER, folder)
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(PlantError, match=message):
        Plant(folder, "pioneer", PLAIN, RATE)


def test_a_property_that_is_not_there_is_an_error() -> None:
    plant, _ = started()
    with pytest.raises(PlantError, match="aero/alfa-deg"):
        node(plant._fdm, "aero/alfa-deg")
    assert read(plant, "aero/alpha-deg") > 0.0
